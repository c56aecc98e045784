"""`python -m benchmarks random-scenes`: thousands of random scenes, every kernel against brute force and the oracle.

Comes in: how many scenes, the size of their images. Goes out: Report: the largest errors, wrong indices, pixels whose
decisions are in doubt, what changed where something left out was put back, distinct kernels. Scenes are those of the
test suite, by number, so that each finding is one: `random_scene(seed)`.

    image       the kernel of the scene's own plan, float64, against brute_force (numpy, no plan) where its doubt allows
    index       the same kernel's layer against oracle (exact), at every pixel
    text        the same scene drawn by the kernel with every effect in its text: what was left out of the C
    forced      that kernel again, with one effect after another forced into the plan: what was left out of the lists
    points      that kernel's other entry point, at the pixel centres, under the plan that knows no window
    single      that kernel in float32

Never done here: a judgement. What must be 0 and what is within rounding is for the reader and the tests.
"""

from __future__ import annotations

import importlib.util
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.machine import Machine, cores, this_machine
from symrender_cg.build import Cache
from symrender_cg.derive.parts import Part
from symrender_cg.emit.scene import emit_scene, marks_doubt, scene_parts
from symrender_cg.emit.scene_fields import Needs
from symrender_cg.errors import OutsidePlanError
from symrender_cg.lower.parts import lower_part
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import pixel_size, planned
from symrender_cg.plan.effects import EFFECTS, SCENE
from symrender_cg.plan.plan import Plan, require_format
from symrender_cg.reference import brute_force, oracle
from symrender_cg.run.render import render_layers
from symrender_cg.run.scene_kernel import LAYERS, SceneKernel, layer_arrays
from symrender_cg.run.scene_numbers import scene_numbers
from symrender_cg.scene import Scene

Floats = NDArray[np.float64]

EVERY_EFFECT: Final = Needs(
    channels=3,
    **dict.fromkeys(sorted(set(Needs.__dataclass_fields__) - {"channels"}), True),
)
OPTIONAL: Final = tuple(entry.name for entry in EFFECTS if entry.optional)
"""Effects that can be forced in."""

TERMS: Final = ("background", "ambient", "reflected", "diffuse", "specular")

OTHER_FORM: Final = frozenset({"front_test"})
"""Effects that change the form in which a normal is computed, not only what is looped over."""

DOUBT: Final = {"double": 1e-9, "single": 1e-4}
"""A pixel is compared where every decision that it rests on is so clear of its border (Traced.doubt)."""

ROOT: Final = Path(__file__).resolve().parents[1]
LISTED: Final = 12


@dataclass(frozen=True)
class EveryEffect:
    """The kernel of three channels with every effect in its text: it draws any scene of spheres, whatever its plan."""

    kernel: SceneKernel

    @staticmethod
    def compiled(accuracy: str, root: Path) -> EveryEffect:
        """Derived, lowered, emitted and compiled; from the cache at `root` where it is there."""
        chosen = variant(accuracy)
        programs = {name: lower_part(part, chosen) for name, part in _parts(accuracy).items()}
        emitted = emit_scene(
            programs,
            need=EVERY_EFFECT,
            plan=planned(Scene.chapter1(), force=(SCENE,)),
            variant=chosen,
            command="none",
            name=f"every_effect_{accuracy}",
        )
        store = Cache(root)
        cached = store.kernel(emitted.files, emitted.cdef)
        dtype = np.dtype(np.float32 if emitted.result_type == "float" else np.float64)
        return EveryEffect(SceneKernel(emitted.name, emitted.fields, 3, dtype, cached, store.load(cached)))

    def image(self, found: Plan, width: int, height: int, layers: Mapping[str, NDArray[Any]] | None = None) -> Any:
        """(height, width, 3), or (height, width) of a scene whose plan is grey; the field itself, not clipped."""
        prepared = self.kernel.prepare(
            numbers_for_every_effect(found, self.kernel.fields),
            width=width,
            height=height,
            pixel=pixel_size(found.scene, height),
            white=np.inf,
        )
        image = np.empty((height, width, 3), self.kernel.dtype)
        self.kernel.rows(image, prepared, begin=0, end=height, layers=layers)
        return _in_channels_of(found, image)

    def layers(self, found: Plan, width: int, height: int) -> dict[str, NDArray[Any]]:
        """What `render_layers` returns: the image, depth, normal, index and terms."""
        arrangement = found.arrangement
        assert arrangement is not None, "planned with the kernel of scenes forced"
        arrays = layer_arrays(LAYERS, (height, width), 3, len(found.given.lights))
        image = self.image(found, width, height, arrays)
        plane, spheres = len(found.given.spheres), arrangement.spheres
        table = np.array([*spheres.tolist(), *[plane] * (arrangement.receivers - len(spheres)), -1], dtype=np.int32)
        for name in TERMS:
            arrays[name] = _in_channels_of(found, arrays[name])
        return {"image": image, **arrays, "index": table[arrays["index"]]}

    def points(self, found: Plan, x: Floats, y: Floats) -> Any:
        """The same as the image at points, which have one shape."""
        prepared = self.kernel.prepare(numbers_for_every_effect(found, self.kernel.fields), white=np.inf)
        values = np.empty((*x.shape, 3), self.kernel.dtype)
        self.kernel.points(values, np.ascontiguousarray(x), np.ascontiguousarray(y), prepared)
        return _in_channels_of(found, values)


def numbers_for_every_effect(found: Plan, fields: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """A scene's numbers, and for what it lacks of plane, tiles and gradient numbers that do not matter."""
    assert found.arrangement is not None, "planned with the kernel of scenes forced"
    numbers = scene_numbers(found.scene, found.arrangement, 3)
    lacking: dict[str, Any] = {"background_top": numbers["background"], "up_y": 1.0, "plane_z": -1.0}
    single_material: dict[str, Any] = {}
    if len(found.arrangement.plane_materials) < 2:  # every tile is the one numbered 0
        single_material = {name: 0.0 for name, _ in fields if name.startswith(("across", "along"))}
    zeros = {name: 0.0 for name, shape in fields if shape == "number"}
    return zeros | lacking | numbers | single_material


@cache
def _parts(accuracy: str) -> dict[str, Part]:
    return scene_parts(EVERY_EFFECT, marks=marks_doubt(variant(accuracy)))


def _in_channels_of(found: Plan, values: NDArray[Any]) -> NDArray[Any]:
    if found.given.channels == 3:
        return values
    assert (values == values[..., :1]).all(), "equal colours in, equal colours out"
    return np.ascontiguousarray(values[..., 0])


# ------------------------------------------------------------------------------------------------------ one scene


@dataclass(frozen=True, slots=True)
class Compared:
    """One scene. Errors over max(1, value); `key` names its kernel; `refused`: by float32.

    doubtful     pixels not compared, of double and of single
    infinite     values of double and of single that are no finite numbers
    wrong        pixels with another index than the oracle's; `sure`: of them those not in doubt
    changed      by what was put back, the largest change of any pixel; only changes
    """

    seed: int
    key: str
    pixels: int
    doubtful: int
    doubtful_single: int
    error: float
    error_single: float
    geometry: float
    terms: float
    infinite: int
    wrong: int
    sure: int
    changed: dict[str, float]
    refused: bool


def compare(scene: Scene, seed: int, width: int, height: int, root: Path, *, own: bool = True) -> Compared:
    """A scene by every kernel that can draw it, against what is known to be true.

    own: the scene's own kernel is compiled and judged; without it the one with every effect is.
    """
    traced = brute_force.image(scene, width, height)
    aspect = width / height
    found = planned(scene, force=(SCENE,), aspect=aspect)
    every = every_effect("double", root)
    drawn = render_layers(scene, width, height, cache=root) if own else every.layers(found, width, height)
    x, y = grid(found.scene, width, height)
    true = oracle.index(scene, x, y)
    clear = traced.doubt > DOUBT["double"]
    wrong = drawn["index"] != true

    changed = {"text": largest_change(every.image(found, width, height), drawn["image"])}
    for name in OPTIONAL:
        forced = planned(scene, force=tuple(sorted({SCENE, name})), aspect=aspect)
        changed[name] = largest_change(every.image(forced, width, height), drawn["image"])
    anywhere = planned(scene, force=(SCENE,))
    changed["points"] = largest_change(every.points(anywhere, x, y), drawn["image"])

    infinite = int((~np.isfinite(drawn["image"])).sum())
    refused, error_single, clear_single = False, 0.0, traced.doubt > DOUBT["single"]
    try:
        require_format(found, "float32")
    except OutsidePlanError:
        refused = True
    else:
        narrow = every_effect("single", root).image(found, width, height)
        error_single = errors(narrow, traced.value, clear_single)
        infinite += int((~np.isfinite(narrow)).sum())
    everywhere = np.ones(traced.doubt.shape, dtype=bool)
    return Compared(
        seed=seed,
        key=" ".join(found.key),
        pixels=clear.size,
        doubtful=int((~clear).sum()),
        doubtful_single=int((~clear_single).sum()),
        error=errors(drawn["image"], traced.value, clear),
        error_single=error_single,
        geometry=max(relative(drawn["depth"], traced.depth, clear), errors(drawn["normal"], traced.normal, clear)),
        terms=errors(sum_of_terms(drawn), drawn["image"], everywhere),
        infinite=infinite,
        wrong=int(wrong.sum()),
        sure=int((wrong & clear).sum()),
        changed={name: change for name, change in changed.items() if change != 0.0},
        refused=refused,
    )


def sum_of_terms(drawn: Mapping[str, NDArray[Any]]) -> Any:
    """What the layers of terms add up to."""
    first = drawn["background"] + drawn["ambient"] + drawn["reflected"]
    return first + drawn["diffuse"].sum(axis=0) + drawn["specular"].sum(axis=0)


def grid(frame: Scene, width: int, height: int) -> tuple[Floats, Floats]:
    """Pixel centres of an image, (height, width) each."""
    step = np.float64(pixel_size(frame, height))
    columns = (np.arange(width, dtype=np.float64) + 0.5 - 0.5 * width) * step
    rows = (0.5 * height - 0.5 - np.arange(height, dtype=np.float64)) * step
    x, y = np.broadcast_arrays(columns[np.newaxis, :], rows[:, np.newaxis])
    return x, y


def errors(values: Any, true: Any, where: Any) -> float:
    """The largest |value - true| / max(1, |true|) of the pixels `where`; inf for what is no number."""
    with np.errstate(invalid="ignore"):
        error = np.abs(values - true) / np.maximum(1.0, np.abs(true))
    return float(np.where(np.isnan(error), np.inf, error)[where].max(initial=0.0))


def relative(values: Any, true: Any, where: Any) -> float:
    """The largest |value - true| / |true|, two infinite ones being equal."""
    with np.errstate(invalid="ignore"):
        error = np.where(values == true, 0.0, np.abs(values - true) / np.abs(true))
    return float(np.where(np.isnan(error), np.inf, error)[where].max(initial=0.0))


def largest_change(values: Any, others: Any) -> float:
    """The largest |difference|; inf where one is no number and the other is."""
    same = (values == others) | (np.isnan(values) & np.isnan(others))
    with np.errstate(invalid="ignore"):
        change = np.where(same, 0.0, np.abs(values - others))
    return float(np.where(np.isnan(change), np.inf, change).max(initial=0.0))


@cache
def every_effect(accuracy: str, root: Path) -> EveryEffect:
    """`EveryEffect.compiled`, once a process."""
    return EveryEffect.compiled(accuracy, root)


# ------------------------------------------------------------------------------------------------------ all of them


@dataclass(frozen=True, slots=True)
class Report:
    """What `random-scenes` found."""

    machine: Machine
    size: tuple[int, int]
    first: int
    seconds: float
    scenes: tuple[Compared, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One table of figures, one of what changed, and the scenes worth a look."""
        console.print(self.machine.line(), highlight=False)
        for line in self.figures():
            console.print(line, highlight=False)
        table = Table(title="what was left out, put back: scenes with a changed pixel, largest change")
        for head in ("put back", "scenes", "largest", "seed"):
            table.add_column(head, justify="left" if head == "put back" else "right")
        for name in ("text", "points", *OPTIONAL):
            some = [scene for scene in self.scenes if name in scene.changed]
            most = max(some, key=lambda scene: scene.changed[name], default=None)
            cells = ("0", "-") if most is None else (f"{most.changed[name]:.1e}", str(most.seed))
            table.add_row(name, f"{len(some):,}", *cells)
        console.print(table)

    def figures(self) -> list[str]:
        """The figures of all scenes together, a line each."""
        pixels = sum(scene.pixels for scene in self.scenes)
        kernels = len({scene.key for scene in self.scenes})
        lines = [
            f"{len(self.scenes):,} scenes from number {self.first}, {self.size[0]} x {self.size[1]} pixels each; "
            f"{kernels} kernels; {self.seconds:.0f} s"
        ]
        for title, name in (
            ("double: largest error", "error"),
            ("depth and normal: largest error", "geometry"),
            ("terms against the image: largest difference", "terms"),
            ("single: largest error", "error_single"),
        ):
            worst = sorted(self.scenes, key=attrgetter(name), reverse=True)[:LISTED]
            told = ", ".join(f"{getattr(scene, name):.1e} ({scene.seed})" for scene in worst[:4])
            lines.append(f"{title} (scene): {told}")
        wrong, sure = (sum(getattr(scene, name) for scene in self.scenes) for name in ("wrong", "sure"))
        seeds = [str(scene.seed) for scene in self.scenes if scene.wrong][:LISTED]
        lines.append(f"wrong indices: {wrong} of {pixels:,}, {sure} of them not in doubt {' '.join(seeds)}".rstrip())
        lines.append(
            f"pixels in doubt, not compared: double {sum(s.doubtful for s in self.scenes):,}, "
            f"single {sum(s.doubtful_single for s in self.scenes):,} of {pixels:,}; "
            f"scenes that single refuses: {sum(s.refused for s in self.scenes)}"
        )
        seeds = [str(scene.seed) for scene in self.scenes if scene.infinite][:LISTED]
        lines.append(
            f"values that are no finite number: {sum(s.infinite for s in self.scenes)} {' '.join(seeds)}".rstrip()
        )
        return lines


def measure_random_scenes(
    count: int, first: int, size: tuple[int, int], jobs: int | None, told: Callable[[str], None]
) -> Report:
    """`count` scenes, numbered from `first`, each on images of `size`, on that many processes (all processors)."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="symrender_cg-") as place:
        root = Path(place)
        for accuracy in ("double", "single"):
            every_effect(accuracy, root)
        found: list[Compared] = []
        with ProcessPoolExecutor(jobs or cores()) as pool:
            tasks = [(seed, size, root) for seed in range(first, first + count)]
            for one in pool.map(_compared, tasks, chunksize=4):
                found.append(one)
                told(f"{len(found):,} of {count:,} scenes, {len({scene.key for scene in found})} kernels")
    found = [replace(scene) for scene in found]
    return Report(this_machine(), size, first, time.perf_counter() - start, tuple(found))


def _compared(task: tuple[int, tuple[int, int], Path]) -> Compared:
    seed, (width, height), root = task
    return compare(random_scenes()(seed), seed, width, height, root)


@cache
def random_scenes() -> Callable[[int], Scene]:
    """The test suite's function of a number, which is no part of any package."""
    place = ROOT / "tests" / "scene_strategies.py"
    specification = importlib.util.spec_from_file_location("scene_strategies", place)
    assert specification is not None, place
    assert specification.loader is not None, place
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    found: Callable[[int], Scene] = module.random_scene
    return found
