"""The driver: from a scene to a loaded kernel, one timed call a stage.

    stage    in -> out                            owner
    plan     Scene -> Plan                        symrender_cg.plan
    derive   Plan -> ImageProgram, or Parts       symrender_cg.derive
    lower    each of them -> KernelProgram        symrender_cg.lower
    emit     KernelPrograms -> C text             symrender_cg.emit
    build    C text -> library                    symrender_cg.build
    run      library + numbers -> image           symrender_cg.run

What is one sphere under one light is one ImageProgram; every other scene is drawn by loops over the Parts of one.

A kernel is remembered twice: in this process, and in the cache on disk under its recipe (plan, accuracy, version of the
compiler), so that neither sympy nor a C compiler is touched when only numbers change. When numbers change so that the
plan does, the scene gets another kernel, and a line at debug level says so.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache as once
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.build.cache import Cache, default_root
from symrender_cg.build.library import CachedKernel
from symrender_cg.errors import ArgumentError, OutsidePlanError
from symrender_cg.lower.variants import Variant, variant
from symrender_cg.plan.plan import Plan, plan, require_format
from symrender_cg.resources import templates
from symrender_cg.run.drawing import Drawing, SamePlan, bind
from symrender_cg.run.enclosure_kernel import EnclosureKernel
from symrender_cg.run.enclosure_numbers import brought_nearer
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.scene import Scene
from symrender_cg.version import VERSION

if TYPE_CHECKING:
    from symrender_cg.derive.parts import Part
    from symrender_cg.derive.program import ImageProgram
    from symrender_cg.emit.c99 import Emitted
    from symrender_cg.lower.lower import Stage
    from symrender_cg.lower.program import KernelProgram

log = logging.getLogger("symrender_cg")
Floats = NDArray[np.float64]


@dataclass
class Statistics:
    """What this process did so far: kernels derived, compiled, recalled from the cache on disk, reused in memory, and
    how often a scene was planned and its plan was another one than that of the scene before it."""

    planned: int = 0
    replanned: int = 0
    derived: int = 0
    compiled: int = 0
    recalled: int = 0
    reused: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def add(self, what: str) -> None:
        """Counts one more of that kind."""
        with self.lock:
            setattr(self, what, getattr(self, what) + 1)


statistics = Statistics()


@dataclass(frozen=True)
class SphereTranslation:
    """The C text of the kernel of one sphere and how it came about: the programs, every pass, seconds of each stage."""

    plan: Plan
    variant: Variant
    emitted: Emitted
    seconds: dict[str, float]
    image: ImageProgram
    program: KernelProgram
    passes: tuple[Stage, ...]


@dataclass(frozen=True)
class SceneTranslation:
    """The C text of the kernel of a scene and how it came about: its parts, derived and lowered.

    Of a level that proves its values this is the enclosure of the scene: one text for all such levels.
    """

    plan: Plan
    variant: Variant
    emitted: Emitted
    seconds: dict[str, float]
    parts: dict[str, Part]
    programs: dict[str, KernelProgram]

    @property
    def encloses(self) -> bool:
        """Whether the kernel gives enclosures (hi, lo, error), not values."""
        return self.variant.settles is not None


Translation = SphereTranslation | SceneTranslation

ENCLOSURE = "enclosure"
"""Stands in recipes and manifests in place of a level: several levels rest on it."""

_kernels: dict[tuple[Any, ...], Kernel | SceneKernel] = {}
_locks: dict[tuple[Any, ...], threading.Lock] = {}
_guard = threading.Lock()


def compile_kernel(
    scene: Scene,
    accuracy: str | Variant = "double",
    *,
    bake: bool = False,
    portable: bool = False,
    force: Iterable[str] = (),
    cache: str | Path | None = None,
) -> Kernel | SceneKernel:
    """The kernel for a scene, at any point of the image plane: from memory, from the cache on disk, or compiled now."""
    found = planned(scene, force=tuple(force))
    return _compiled(found, variant(accuracy), bake=bake, portable=portable, cache=cache)


def draw(
    scene: Scene,
    accuracy: str | Variant = "double",
    *,
    size: tuple[int, int] | None = None,
    clip: bool = False,
    bake: bool = False,
    portable: bool = False,
    force: Iterable[str] = (),
    max_error: float = 0.0,
    cache: str | Path | None = None,
) -> Drawing:
    """A scene bound to its kernel: for an image of `size` (width, height) pixels, or for points where it is None.

    Raises ArgumentError for a level that several stages prove: no kernel draws it alone.
    """
    if variant(accuracy).settles:
        raise ArgumentError(
            f"accuracy: {variant(accuracy).name!r} is proved value by value, in stages; expected a level that one "
            "kernel draws alone: 'fast', 'single', 'literal' or 'double'"
        )
    aspect = None if size is None else size[0] / size[1]
    found = planned(scene, force=tuple(force), aspect=aspect, max_error=max_error)
    kernel = _compiled(found, variant(accuracy), bake=bake, portable=portable, cache=cache)
    white = 1.0 if clip else math.inf
    decide = partial(_decided, scene, portable, cache) if found.arrangement is not None else None
    if size is None:
        return bind(kernel, found, white=white, decide=decide)
    pixel = pixel_size(found.scene, size[1])
    return bind(kernel, found, width=size[0], height=size[1], pixel=pixel, white=white, decide=decide)


def _decided(scene: Scene, portable: bool, cache: str | Path | None, x: Floats, y: Floats) -> tuple[Any, Any]:
    """Values within 4 ulp at points where rounding decided a kernel of a scene, and which of them are known."""
    from symrender_cg.run.certify import Job, settle_if_known

    return settle_if_known(Job(scene, variant("stable"), False, portable, cache, 1), x, y)


def pixel_size(frame: Scene, height: int) -> float:
    """The side of a pixel of an image with that many rows, in scene units; `frame` is a camera-frame scene."""
    half_height = frame.camera.half_height
    assert half_height is not None, "a camera-frame scene has its half_height"
    return 2.0 * half_height / height


def planned(scene: Scene, *, force: tuple[str, ...] = (), aspect: float | None = None, max_error: float = 0.0) -> Plan:
    """The plan of a scene, remembered: a scene is drawn more than once."""
    found = _planned(scene, force, aspect, max_error)
    note(found)
    return found


def note(found: Plan) -> None:
    """Counts and logs it where the plan that is drawn by is of another structure than the one before."""
    if _last[0] is found:
        return
    with _guard:
        before, _last[0] = _last[0], found
    if before is not None and before.key != found.key:
        statistics.add("replanned")
        gone, new = sorted(set(before.key) - set(found.key)), sorted(set(found.key) - set(before.key))
        log.debug("replanned: %s after %s; in: %s; out: %s", found.name, before.name, new or "-", gone or "-")


_last: list[Plan | None] = [None]


@lru_cache(maxsize=256)
def _planned(scene: Scene, force: tuple[str, ...], aspect: float | None, max_error: float) -> Plan:
    statistics.add("planned")
    return plan(scene, force=force, aspect=aspect, max_error=max_error)


def translate(
    scene: Scene,
    accuracy: str | Variant = "double",
    *,
    target: str | None = None,
    bake: bool = False,
    force: Iterable[str] = (),
    aspect: float | None = None,
    max_error: float = 0.0,
    name: str | None = None,
    command: str | None = None,
) -> Translation:
    """Plan, derive, lower and emit: the C text of a scene's kernel, without compiling it.

    Of `stable` and `certified` that is the kernel that bounds its own error, where there is one sphere under one light,
    and else the enclosure; `target` is what `certified` rounds to.
    """
    chosen = variant(accuracy, target)
    start = time.perf_counter()
    found = plan(scene, force=force, aspect=aspect, max_error=max_error)
    seconds = {"plan": time.perf_counter() - start}
    return _translated(found, chosen, seconds, bake=bake, name=name, command=command)


def _translated(
    found: Plan,
    chosen: Variant,
    seconds: dict[str, float],
    *,
    bake: bool = False,
    name: str | None = None,
    command: str | None = None,
) -> Translation:
    require_kind(found, chosen, bake=bake)
    if chosen.settles and found.arrangement is not None:
        return translate_enclosure(found, chosen, seconds, name=name, command=command)
    level, _, target = chosen.name.partition("_")
    told = command or f"python -m symrender_cg build SCENE --accuracy {level}{f' --target {target}' if target else ''}"
    statistics.add("derived")
    if found.arrangement is None:
        return _translated_sphere(found, chosen, seconds, bake=bake, name=name, command=told)
    return _translated_scene(found, chosen, seconds, name=name, command=told)


def require_kind(found: Plan, chosen: Variant, *, bake: bool) -> None:
    """Raises where there is no such kernel of scenes: baked, or by the formula of the seed, which has one sphere."""
    if bake and chosen.settles:
        raise ArgumentError(f"bake: a kernel of {chosen.name!r} takes its numbers as arguments; leave bake out")
    if found.arrangement is None:
        return
    if bake:
        raise ArgumentError(
            "bake: the kernel of a scene loops over arrays of spheres and lights, so there are no numbers to fold in; "
            "baked kernels are of one sphere and one light; leave bake out"
        )
    if not chosen.exact:
        raise OutsidePlanError(
            f"accuracy: {chosen.name!r} is the formula of one sphere under one light; this scene has more; "
            "use 'double' or 'single'"
        )


def _translated_sphere(
    found: Plan, chosen: Variant, seconds: dict[str, float], *, bake: bool, name: str | None, command: str
) -> SphereTranslation:
    from symrender_cg.derive.exact import sign_tests
    from symrender_cg.derive.image import derive
    from symrender_cg.emit.c99 import emit
    from symrender_cg.lower.lower import lower

    start = time.perf_counter()
    image = derive(found)
    tests = sign_tests(image)
    derived = time.perf_counter()
    numbers = numbers_of(found.scene) if bake else None
    program, passes = lower(image, found, chosen, numbers=numbers)
    lowered = time.perf_counter()
    emitted = emit(
        program,
        plan=found,
        variant=chosen,
        sign_tests=tests,
        command=command,
        numbers=numbers,
        name=name or (f"{program.name}_baked" if bake else None),
    )
    seconds |= {"derive": derived - start, "lower": lowered - derived, "emit": time.perf_counter() - lowered}
    return SphereTranslation(found, chosen, emitted, seconds, image, program, passes)


def _translated_scene(
    found: Plan, chosen: Variant, seconds: dict[str, float], *, name: str | None, command: str
) -> SceneTranslation:
    from symrender_cg.emit.scene import emit_scene, marks_doubt, scene_parts
    from symrender_cg.emit.scene_fields import Needs
    from symrender_cg.lower.parts import lower_part

    start = time.perf_counter()
    need = Needs.of(found.flags)
    parts = scene_parts(need, marks=marks_doubt(chosen))
    derived = time.perf_counter()
    programs = {key: lower_part(part, chosen) for key, part in parts.items()}
    lowered = time.perf_counter()
    emitted = emit_scene(
        programs,
        need=need,
        plan=found,
        variant=chosen,
        command=command,
        name=name or f"{found.name}_{chosen.name}",
    )
    seconds |= {"derive": derived - start, "lower": lowered - derived, "emit": time.perf_counter() - lowered}
    return SceneTranslation(found, chosen, emitted, seconds, parts, programs)


def settling_kernel(
    scene: Scene,
    chosen: Variant,
    *,
    aspect: float | None = None,
    portable: bool = False,
    cache: str | Path | None = None,
) -> tuple[SettlingKernel, Scene] | None:
    """The kernel that bounds its own error, and the scene that it draws; None where a scene has more than one sphere
    under one light: then the enclosure is the first stage."""
    found = planned(scene, aspect=aspect)
    if found.arrangement is not None:
        return None
    kernel = _compiled(found, chosen, bake=False, portable=portable, cache=cache)
    assert isinstance(kernel, SettlingKernel), f"{chosen.name} settles"
    return kernel, found.scene


def enclosure_kernel(scene: Scene, *, portable: bool = False, cache: str | Path | None = None) -> EnclosureKernel:
    """The kernel that encloses a scene's intensities at any points of the image plane, bound to the scene."""
    found, nearer = planned(scene), None
    if found.arrangement is None:
        nearer = brought_nearer(found.scene)
        found = planned(nearer or scene, force=("scene",))
    root = Path(cache) if cache is not None else default_root()
    key = (found.key, "enclosure", portable, root)
    with _lock_of(key):
        kernel = _enclosures.get(key)
        if kernel is None:
            kernel = _enclosures[key] = _enclosure(found, portable=portable, root=root)
    return _enclosing(kernel, SamePlan(found), nearer is not None)


@lru_cache(maxsize=8)
def _enclosing(kernel: EnclosureKernel, same: SamePlan, nearer: bool) -> EnclosureKernel:
    """The kernel bound to a scene, remembered with the scene's tables."""
    return replace(kernel, plan=same.plan, nearer=nearer)


_enclosures: dict[tuple[Any, ...], EnclosureKernel] = {}


def translate_enclosure(
    found: Plan,
    chosen: Variant | None = None,
    seconds: dict[str, float] | None = None,
    *,
    name: str | None = None,
    command: str | None = None,
) -> SceneTranslation:
    """Derive, lower and emit: the C text of the enclosure of a planned scene, which has an arrangement.

    The text is the same for every level that rests on it; `chosen` is the one that asks for it, certified by default.
    """
    from symrender_cg.emit.enclosure import emit_enclosure, enclosure_parts
    from symrender_cg.emit.scene_fields import Needs
    from symrender_cg.lower.enclose import enclose_part

    statistics.add("derived")
    spent = {} if seconds is None else seconds
    start = time.perf_counter()
    need = Needs.of(found.flags)
    parts = enclosure_parts(need)
    derived = time.perf_counter()
    programs = {key: enclose_part(part) for key, part in parts.items()}
    lowered = time.perf_counter()
    told = command or "python -m symrender_cg build SCENE --accuracy certified"
    emitted = emit_enclosure(programs, need=need, plan=found, command=told, name=name or enclosure_name(found))
    spent |= {"derive": derived - start, "lower": lowered - derived, "emit": time.perf_counter() - lowered}
    return SceneTranslation(found, chosen or variant("certified"), emitted, spent, parts, programs)


def enclosure_name(found: Plan) -> str:
    """The C name of a scene's enclosure."""
    return f"{found.name}_enclosure"


def _enclosure(found: Plan, *, portable: bool, root: Path) -> EnclosureKernel:
    recipe = recipe_of(found, ENCLOSURE, (), portable)
    store = Cache(root)
    recalled = store.recall(recipe, portable=portable)
    if recalled is not None:
        cached, payload = recalled
        statistics.add("recalled")
    else:
        translation = translate_enclosure(found)
        cached = build_kernel(translation, portable=portable, root=root, recipe=recipe)
        payload = _payload(translation)
    fields = tuple((str(name), str(shape)) for name, shape in payload["fields"])
    channels = 3 if "colour" in found.flags else 1
    return EnclosureKernel(payload["name"], fields, channels, found, cached, store.load(cached))


def build_kernel(
    translation: Translation, *, portable: bool = False, root: Path | None = None, recipe: str | None = None
) -> CachedKernel:
    """The compiled library of a translation, from the cache where it is there; remembered under `recipe`, if given."""
    store = Cache(root if root is not None else default_root())
    emitted = translation.emitted
    flags = translation.variant.flags
    cached = store.kernel(emitted.files, emitted.cdef, portable=portable, extra_flags=flags)
    if not cached.from_cache:
        statistics.add("compiled")
    if recipe is not None:
        store.remember(recipe, cached, _payload(translation))
    return cached


def recipe_of(scene_plan: Plan, accuracy: str, baked: Iterable[tuple[str, float]], portable: bool) -> str:
    """What determines a kernel's C text, without deriving it: the version of this compiler, the plan, the variant."""
    exact = [(name, value.hex()) for name, value in baked]
    reasons = [f"{d.effect.name}: {d.reason}" for d in scene_plan.decisions] if exact else []
    return json.dumps([VERSION, _source_digest(), scene_plan.key, reasons, accuracy, exact, portable])


def _compiled(
    found: Plan, chosen: Variant, *, bake: bool, portable: bool, cache: str | Path | None
) -> Kernel | SceneKernel:
    require_kind(found, chosen, bake=bake)
    if chosen.settles and found.arrangement is not None:
        raise OutsidePlanError(
            f"accuracy: {chosen.name!r} has a kernel of its own for one sphere under one light; this scene has more, "
            "and is drawn by its enclosure"
        )
    require_format(found, chosen.shading)
    root = Path(cache) if cache is not None else default_root()
    baked = tuple(sorted(numbers_of(found.scene).items())) if bake else ()
    key = (found.key, chosen.key, baked, portable, root)
    kernel = _kernels.get(key)
    if kernel is not None:
        statistics.add("reused")
        return kernel
    with _lock_of(key):
        kernel = _kernels.get(key)
        if kernel is None:
            kernel = _kernels[key] = _kernel(found, chosen, baked, portable=portable, root=root)
    return kernel


def _kernel(
    found: Plan, chosen: Variant, baked: tuple[tuple[str, float], ...], *, portable: bool, root: Path
) -> Kernel | SceneKernel:
    recipe = recipe_of(found, chosen.key, baked, portable)
    store = Cache(root)
    recalled = store.recall(recipe, portable=portable, extra_flags=chosen.flags)
    if recalled is not None:
        cached, payload = recalled
        statistics.add("recalled")
        log.debug("kernel %s recalled from %s", payload["name"], cached.folder)
    else:
        translation = _translated(found, chosen, {}, bake=bool(baked))
        cached = build_kernel(translation, portable=portable, root=root, recipe=recipe)
        payload = _payload(translation)
        log.debug("kernel %s compiled: %s", payload["name"], " ".join(cached.manifest.command))
    dtype = np.dtype({"float": "float32", "unsigned char": "uint8"}.get(payload["type"], "float64"))
    library = store.load(cached)
    if "fields" in payload:
        fields = tuple((str(name), str(shape)) for name, shape in payload["fields"])
        return SceneKernel(payload["name"], fields, int(payload["channels"]), dtype, cached, library)
    return (SettlingKernel if chosen.settles else Kernel)(
        name=payload["name"],
        inputs=tuple(payload["inputs"]),
        dtype=dtype,
        cached=cached,
        library=library,
        baked=payload["baked"],
    )


def _payload(translation: Translation) -> dict[str, Any]:
    emitted = translation.emitted
    payload: dict[str, Any] = {
        "name": emitted.name,
        "inputs": list(emitted.inputs),
        "type": emitted.result_type,
        "baked": not emitted.inputs,
        "operations": emitted.operations,
    }
    if isinstance(translation, SceneTranslation):
        payload["fields"] = [list(field) for field in emitted.fields]
        payload["channels"] = 3 if "colour" in translation.plan.flags else 1
    return payload


def _lock_of(key: tuple[Any, ...]) -> threading.Lock:
    with _guard:
        return _locks.setdefault(key, threading.Lock())


@once
def _source_digest() -> str:
    """A digest of everything that the C text depends on: the sources of the compiler's stages and the templates."""
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    files = [path for stage in ("plan", "derive", "lower", "emit") for path in (package / stage).rglob("*.py")]
    files += [path for path in templates().rglob("*") if path.suffix in (".j2", ".h")]
    for path in sorted(files, key=lambda p: p.parts[-3:]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
