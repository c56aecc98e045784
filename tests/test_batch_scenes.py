"""`render_batch` of scenes of many surfaces and of levels that prove their values: the bits of render_image, few plans,
few calls, bounded memory, errors that name the set."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluators import same_bits
from msgspec import structs
from numpy.typing import NDArray

from symrender_cg import (
    Camera,
    DirectionalLight,
    Phong,
    Plane,
    PointLight,
    Scene,
    Sphere,
    render_batch,
    render_image,
)
from symrender_cg.errors import AccuracyError, OutsidePlanError, SceneError
from symrender_cg.pipeline import statistics
from symrender_cg.run import batch, chunks, settling_many, target
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.parameters import parameter_sets
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.threads import block_ends

FRAME = Camera((0.0, 0.0, 6.0), half_height=1.5)
NEAR = Sphere((-0.5, 0.0, 0.5), 0.5, Phong(gate_specular=True))
FAR = Sphere((0.4, 0.1, -0.6), 0.6, Phong(0.05, 0.6, 0.0))
SHADED = Scene(FRAME, (NEAR, FAR), (PointLight((-6.0, 2.0, 6.0)),))
TWICE = Scene(FRAME, (NEAR, FAR), (PointLight((9.0, 9.0, 6.0)), DirectionalLight((1.0, -1.0, -1.0), 0.25)))
GROUNDED = structs.replace(SHADED, plane=Plane((0.0, -1.0, 0.0)))
SIZE = (24, 18)


def around(place: tuple[float, float, float], count: int, far: float, seed: int = 0) -> NDArray[np.float64]:
    """Places about one."""
    return np.array(place) + np.random.default_rng(seed).uniform(-far, far, (count, 3))


def lit_from(count: int, seed: int = 0) -> dict[str, NDArray[np.float64]]:
    """A light that moves, so that the shadow of the near sphere meets the other one or does not."""
    return {"lights.0.position": around((-5.0, 2.0, 6.0), count, 4.0, seed)}


CHANGES: dict[str, tuple[Scene, dict[str, Any]]] = {
    "a light moves": (SHADED, lit_from(14)),
    "one of two lights moves, and grows brighter": (
        TWICE,
        {"lights.0.position": around((9.0, 9.0, 6.0), 9, 6.0), "lights.0.intensity": np.linspace(0.0, 1.0, 9)},
    ),
    "a light in parallel turns": (TWICE, {"lights.1.direction": around((1.0, -1.0, -1.0), 4, 0.5)}),
    "a sphere moves in depth and changes the order": (SHADED, {"spheres.0.center.2": np.linspace(1.5, -2.0, 12)}),
    "a sphere moves behind the other": (SHADED, {"spheres.1.center.0": np.linspace(-1.0, 2.5, 12)}),
    "a sphere grows until both touch": (SHADED, {"spheres.0.radius": np.linspace(0.3, 1.2, 10)}),
    "materials change, and a term goes": (
        SHADED,
        {
            "spheres.0.material.diffuse": np.array([0.5, 0.25, 0.0, 0.0, 0.75]),
            "spheres.1.material.specular": np.array([0.0, 0.5, 0.25, 0.0, 0.0]),
            "spheres.0.material.shininess": np.array([1.0, 2000.0, 0.5, 30.0, 60.5]),
            "background": np.linspace(0.0, 0.5, 5),
        },
    ),
    "the frame follows the spheres": (
        structs.replace(SHADED, camera=Camera((0.0, 0.0, 6.0))),
        {"spheres.1.center": around((0.4, 0.1, -0.6), 6, 0.2), "spheres.1.radius": np.linspace(0.4, 0.6, 6)},
    ),
    "a light in colour": (SHADED, {"lights.0.intensity": np.linspace((1.0, 1.0, 1.0), (0.5, 0.75, 1.0), 5)}),
    "above a plane": (GROUNDED, lit_from(5)),
    "seen by a turned camera": (structs.replace(SHADED, camera=Camera((2.0, 1.0, 6.0), half_height=1.5)), lit_from(4)),
}


@pytest.mark.parametrize(
    ("case", "accuracy"),
    [
        *((case, level) for case in CHANGES for level in ("double", "single")),
        ("materials change, and a term goes", "fast"),
    ],
)
def test_every_image_of_a_scene_has_the_bits_of_render_image(case: str, accuracy: str) -> None:
    scene, parameters = CHANGES[case]
    sets = parameter_sets(scene, parameters)
    scenes = [sets.scene(k) for k in range(sets.count)]
    wanted = np.stack([render_image(each, *SIZE, accuracy=accuracy, clip=False) for each in scenes])
    for threads in (1, 3):
        assert same_bits(render_batch(scene, parameters, *SIZE, accuracy=accuracy, clip=False, threads=threads), wanted)
    assert same_bits(render_batch(None, scenes, *SIZE, accuracy=accuracy, clip=False), wanted)


@pytest.mark.parametrize(("accuracy", "target"), [("stable", None), ("certified", "float32"), ("certified", "uint8")])
@pytest.mark.parametrize("scene", [Scene.chapter1(), SHADED, GROUNDED])
def test_levels_that_prove_their_values_have_the_bits_of_render_image(
    scene: Scene, accuracy: str, target: str | None
) -> None:
    parameters: dict[str, Any] = {**lit_from(5), "background": np.linspace(0.0, 0.5, 5)}
    sets = parameter_sets(scene, parameters)
    wanted = np.stack([render_image(sets.scene(k), 16, 12, accuracy=accuracy, target=target) for k in range(5)])
    for threads in (1, 2):
        found = render_batch(scene, parameters, 16, 12, accuracy=accuracy, target=target, threads=threads)
        assert same_bits(found, wanted)


def test_sets_of_double_that_are_handed_over_have_the_bits_of_render_image() -> None:
    """Among others that are not: the light comes close, the exponent falls below 1."""
    parameters = {
        "lights.0.position": np.linspace((3.0, 2.0, 9.0), (0.3, 0.2, 1.2), 9),
        "spheres.0.material.shininess": np.array([9.0, 0.5, 0.5, 9.0, 9.0, 0.25, 9.0, 9.0, 9.0]),
    }
    sets = parameter_sets(Scene.chapter1(), parameters)
    wanted = np.stack([render_image(sets.scene(k), *SIZE) for k in range(sets.count)])
    assert same_bits(render_batch(None, parameters, *SIZE), wanted)


@pytest.mark.parametrize("order", ["rows apart", "columns apart"])
@pytest.mark.parametrize("accuracy", ["double", "stable"])
def test_images_of_scenes_go_into_any_array(order: str, accuracy: str) -> None:
    big = np.full((12, 40, 60), np.nan)
    out = {"rows apart": big[::2, 3:15, 2:18], "columns apart": big[::2, :12, :32:2]}[order]
    for scene in (SHADED, Scene.chapter1()):
        big[...] = np.nan
        render_batch(scene, lit_from(6), 16, 12, accuracy=accuracy, out=out)
        assert same_bits(np.ascontiguousarray(out), render_batch(scene, lit_from(6), 16, 12, accuracy=accuracy))
        assert np.isnan(big).sum() == big.size - out.size


# ---- few calls


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """How often each function that draws many images was called, from the first use on."""
    found: dict[str, int] = {}

    def count(holder: Any, name: str) -> None:
        original: Callable[..., Any] = getattr(holder, name)

        def called(*arguments: Any) -> Any:
            key = f"{getattr(holder, '__name__', holder)}.{name}".rsplit("symrender_cg.run.", 1)[-1]
            found[key] = found.get(key, 0) + 1
            return original(*arguments)

        monkeypatch.setattr(holder, name, called)

    for holder, name in (
        (SceneKernel, "onto_many"),
        (SettlingKernel, "settle_many"),
        (Kernel, "onto_many"),
        (settling_many, "settle_many"),
    ):
        count(holder, name)
    return found


def test_a_scene_is_planned_once_for_a_light_that_moves(
    counted: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As often as lights and shadows make another kernel, and no more; each kernel is called once."""
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 60.0)
    render_batch(SHADED, lit_from(2, seed=1), 8, 8, accuracy="single")
    before = statistics.planned
    counted.clear()
    render_batch(SHADED, lit_from(300, seed=2), 8, 8, accuracy="single")
    assert statistics.planned - before <= 3
    assert counted == {"SceneKernel.onto_many": 2}


def test_sets_of_kinds_that_take_turns_are_sorted_by_kernel(
    counted: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 60.0)
    rows = lit_from(10, seed=3)["lights.0.position"].tolist()
    scenes = [
        structs.replace((SHADED, GROUNDED)[k % 2], lights=(PointLight(tuple(place)),)) for k, place in enumerate(rows)
    ]
    found = render_batch(None, scenes, *SIZE)
    kernels = counted["SceneKernel.onto_many"]
    assert kernels <= 4
    assert same_bits(found, np.stack([render_image(scene, *SIZE) for scene in scenes]))


@pytest.mark.parametrize("accuracy", ["stable", "certified"])
def test_one_sphere_under_a_light_that_moves_is_settled_in_one_call(accuracy: str, counted: dict[str, int]) -> None:
    """And enclosed in one, where anything is left; planned for the kernel, and twice for the enclosure."""
    places = {"lights.0.position": around((5.0, 5.0, 10.0), 60, 2.0)}
    render_batch(None, {name: array[:1] for name, array in places.items()}, 8, 8, accuracy=accuracy)
    counted.clear()
    before = statistics.planned
    found = render_batch(None, places, 8, 8, accuracy=accuracy)
    assert counted["SettlingKernel.settle_many"] == 1
    assert counted.get("settling_many.settle_many", 0) <= 1
    assert statistics.planned - before <= 4
    sets = parameter_sets(Scene.chapter1(), places)
    assert same_bits(found[7], render_image(sets.scene(7), 8, 8, accuracy=accuracy))


def test_a_chunk_of_images_is_enclosed_in_one_call(counted: dict[str, int]) -> None:
    lights = {"lights.0.intensity": np.linspace(0.5, 1.0, 6)}
    render_batch(SHADED, lights, 8, 8, accuracy="stable")
    assert counted == {"settling_many.settle_many": 1}


# ---- bounded memory


def peak(draw: Callable[[], object]) -> int:
    """The most bytes that a call holds at once."""
    draw()
    tracemalloc.start()
    draw()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


@pytest.mark.parametrize(("scene", "accuracy"), [(SHADED, "double"), (Scene.chapter1(), "stable"), (SHADED, "stable")])
def test_a_batch_ten_times_longer_holds_no_more_at_once(
    scene: Scene, accuracy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With chunks of 16 images, or of one that is enclosed."""
    side = 16
    for module in (chunks, target):
        monkeypatch.setattr(module, "MOST_PIXELS", 16 * side * side)
    held = {}
    for count in (32, 320) if accuracy == "double" else (8, 80):
        out = np.lib.format.open_memmap(
            tmp_path / f"{count}.npy", mode="w+", dtype=np.float64, shape=(count, side, side)
        )
        places = {"lights.0.intensity": np.linspace(0.5, 1.0, count)}

        def draw(out: Any = out, places: Any = places) -> object:
            return render_batch(scene, places, side, side, out=out, accuracy=accuracy, threads=1)

        held[count] = peak(draw)
    few, many = held.values()
    assert many < 1.5 * few + 100_000


# ---- progress


@pytest.fixture(autouse=True)
def usual_blocks() -> Iterator[None]:
    """What a test with blocks of another size left behind is forgotten."""
    yield
    block_ends.cache_clear()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    ("scene", "accuracy"), [(SHADED, "double"), (GROUNDED, "double"), (Scene.chapter1(), "stable"), (SHADED, "stable")]
)
def test_counts_of_progress_increase_up_to_all(
    scene: Scene, accuracy: str, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 0.0)
    monkeypatch.setattr(chunks, "MOST_PIXELS", 512)
    told: list[tuple[int, int]] = []
    render_batch(
        scene, lit_from(12), 16, 16, accuracy=accuracy, threads=threads, progress=lambda *counts: told.append(counts)
    )
    assert len(told) > 2
    assert told == sorted(told)
    assert told[-1] == (12, 12)
    assert told.count((12, 12)) == 1
    assert all(total == 12 for _, total in told)


# ---- errors name the set


def test_a_scene_that_no_plan_covers_is_named_by_its_set() -> None:
    tiny = structs.replace(SHADED, spheres=(NEAR, Sphere((1e-3, 0.0, -0.6), 1e-30)))
    for accuracy in ("double", "stable"):
        with pytest.raises(OutsidePlanError, match=r"^parameters, set 2: spheres\[1\]\.radius"):
            render_batch(None, [SHADED, TWICE, tiny, SHADED], 8, 8, accuracy=accuracy)


def test_a_camera_that_frames_nothing_is_named_by_its_set() -> None:
    behind = Scene(Camera((0.0, 0.0, 6.0)), (Sphere((0.0, 0.0, 9.0), 1.0), Sphere((3.0, 0.0, 9.0), 1.0)))
    with pytest.raises(SceneError, match=r"^parameters, set 1: camera\.half_height: no sphere is in front") as caught:
        render_batch(None, [SHADED, behind], 8, 8)
    assert caught.value.place == "parameters, set 1: camera.half_height"


def test_numbers_of_a_set_that_make_no_scene_are_named_by_it() -> None:
    radii = np.full(9, 0.5)
    radii[6] = -0.5
    with pytest.raises(SceneError, match=r"^parameters, set 6: spheres\[0\]\.radius: -0.5 is not positive"):
        render_batch(SHADED, {"spheres.0.radius": radii}, 8, 8)
    radii[6] = 7.0
    with pytest.raises(SceneError, match=r"^parameters, set 6: camera\.eye: .* is inside spheres\[0\]"):
        render_batch(SHADED, {"spheres.0.radius": radii}, 8, 8)


def test_pixels_that_nothing_decides_are_named_with_their_set(monkeypatch: pytest.MonkeyPatch) -> None:
    def open_ended(*_: Any) -> Any:
        raise AccuracyError("stable: 1 of 64 values are not settled", [5])

    def nothing(jobs: Any, places: Any, *_: Any) -> Any:
        return [(np.zeros((len(p), 1)), np.zeros(len(p), dtype=bool)) for p in places]

    monkeypatch.setattr(target, "enclosed_many", nothing)
    monkeypatch.setattr(target, "settle_by_oracle", open_ended)
    with pytest.raises(AccuracyError, match=r"^parameters, set 0: stable: 1 of 64") as caught:
        render_batch(SHADED, {"lights.0.intensity": [1.0, 0.5]}, 8, 8, accuracy="stable")
    assert caught.value.points == (5,)
