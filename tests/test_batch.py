"""`render_batch`: every image has the bits of render_image, however sets are run together, and errors say which set."""

from __future__ import annotations

import math
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluators import modest, same_bits
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs
from numpy.typing import NDArray

from symrender_cg import (
    Camera,
    DirectionalLight,
    Gradient,
    Phong,
    Plane,
    PointLight,
    Scene,
    Sphere,
    render_batch,
    render_image,
)
from symrender_cg.errors import ArgumentError, OutsidePlanError, SceneError
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import planned, statistics
from symrender_cg.run import alike, batch
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.levels import drawn_as, job_of, steep_part
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.parameters import parameter_sets
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.threads import block_ends

CENTERS = {"spheres.0.center": 3, "lights.0.position": 3}
NUMBERS = ("spheres.0.radius", "lights.0.intensity", "background")
COEFFICIENTS = ("ambient", "diffuse", "specular", "shininess")
PATHS = (*CENTERS, *NUMBERS, *(f"spheres[0].material.{name}" for name in COEFFICIENTS), "lights.0.position.2")

PAIR = Scene(
    Camera((0.0, 0.0, 6.0), half_height=1.5),
    (Sphere((-0.5, 0.0, 0.0), 0.5), Sphere((0.6, 0.1, 0.3), 0.5)),
    (PointLight((9.0, 9.0, 6.0)),),
)


def circling(count: int) -> NDArray[np.float64]:
    """Places of a light, far enough for plain float64 to keep the promise of `double`."""
    angles = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    return np.stack([14.0 * np.sin(angles), 5.0 + 0.0 * angles, 14.0 + 2.0 * np.cos(angles)], axis=1)


def one_by_one(scene: Scene, parameters: Mapping[str, Any], *size: int, **options: Any) -> NDArray[Any]:
    """What render_batch is to be equal to, by scenes built by hand."""
    sets = parameter_sets(scene, parameters)
    return np.stack([render_image(sets.scene(k), *size, **options) for k in range(sets.count)])


def handed_over(scene: Scene, accuracy: str) -> bool:
    """Whether `double` leaves a square image of the scene to the kernel of `stable`."""
    return job_of(scene, accuracy, clip=True, aspect=1.0) is not None


# ---- the same bits


@st.composite
def columns(draw: st.DrawFn) -> dict[str, NDArray[np.float64]]:
    """Some of the paths of one sphere and its light, for up to 12 sets, with what plans turn on: 0, and far out."""
    count = draw(st.integers(1, 12))
    names = draw(st.lists(st.sampled_from(PATHS), min_size=1, max_size=4, unique=True))
    if "lights.0.position" in names and "lights.0.position.2" in names:
        names.remove("lights.0.position.2")
    ranges: dict[str, st.SearchStrategy[float]] = {
        "spheres.0.center": st.one_of(st.just(0.0), st.floats(-0.8, 0.8)),
        "lights.0.position": st.floats(4.0, 30.0),
        "lights.0.position.2": st.floats(4.0, 30.0),
        "spheres.0.radius": st.one_of(st.floats(0.01, 1.2), st.sampled_from((1e-6, 1.0, 1.5))),
        "spheres[0].material.shininess": st.one_of(st.floats(0.0, 3.0), st.floats(1.0, 60.0), st.just(2000.0)),
    }
    found = {}
    for name in names:
        values = ranges.get(name, st.one_of(st.just(0.0), st.floats(0.0, 1.2)))
        size = count * CENTERS.get(name, 1)
        array = np.array(draw(st.lists(values, min_size=size, max_size=size)))
        found[name] = array.reshape(count, 3) if name in CENTERS else array
    return found


@given(columns(), st.sampled_from(("double", "double", "single", "fast", "literal")), st.booleans(), st.integers(1, 3))
@modest(40)
def test_every_image_has_the_bits_of_render_image(
    parameters: dict[str, NDArray[np.float64]], accuracy: str, clip: bool, threads: int
) -> None:
    scene = Scene.chapter1(light=(8.0, 6.0, 14.0))
    wanted = one_by_one(scene, parameters, 11, 7, accuracy=accuracy, clip=clip)
    found = render_batch(scene, parameters, 11, 7, accuracy=accuracy, clip=clip, threads=threads)
    assert same_bits(found, wanted)
    sets = parameter_sets(scene, parameters)
    scenes = [sets.scene(k) for k in range(sets.count)]
    assert same_bits(render_batch(None, scenes, 11, 7, accuracy=accuracy, clip=clip, threads=threads), wanted)


@given(columns(), st.sampled_from(("double", "single", "fast")), st.booleans())
@modest(150)
def test_sets_that_are_run_together_have_one_plan_one_level_and_the_numbers_of_their_scenes(
    parameters: dict[str, NDArray[np.float64]], accuracy: str, gated: bool
) -> None:
    base = Scene(spheres=(Sphere(material=Phong(gate_specular=gated)),), lights=(PointLight((8.0, 6.0, 14.0)),))
    sets = parameter_sets(base, parameters)
    inputs = alike.inputs_of(sets.columns)
    assert inputs is not None
    scene = sets.scene(0)
    plan = planned(scene, aspect=1.0)
    order = tuple(numbers_of(plan.scene))
    handed = handed_over(scene, accuracy)
    numbers, half_heights, _ = alike.rows_alike(scene, plan, inputs, accuracy, order, handed=handed)
    assert 1 <= len(numbers) == len(half_heights) <= sets.count
    for k, (row, half_height) in enumerate(zip(numbers.tolist(), half_heights.tolist(), strict=True)):
        each = sets.scene(k)
        other = planned(each, aspect=1.0)
        assert other.key == plan.key
        assert other.fits_single or not plan.fits_single or accuracy == "double"
        assert row == [numbers_of(other.scene)[name] for name in order]
        assert half_height == other.scene.camera.half_height
        assert drawn_as(each, accuracy) == drawn_as(scene, accuracy)
        assert k == 0 or handed_over(each, accuracy) == handed
        assert k == 0 or handed or accuracy != "double" or steep_part(each, 1.0) is None


FRAMED = Camera(half_height=1.5)
DULL = (Sphere(material=Phong(0.1, 0.7, 0.1)),)
FAR_LIGHT = (PointLight((8.0, 6.0, 14.0)),)
ENDS: dict[str, tuple[Scene, dict[str, list[Any]], str]] = {
    "the light too near for float64": (
        Scene.chapter1(),
        {"lights.0.position": [[9, 5, 14], [0, 0, 1.01]]},
        "double",
    ),
    "the light too far to be too near": (
        Scene.chapter1(),
        {"lights.0.position": [[0, 0, 1.01], [9, 5, 14]]},
        "double",
    ),
    "a broken power": (Scene.chapter1(light=(8, 6, 14)), {"spheres.0.material.shininess": [9.0, 0.5]}, "double"),
    "a gated highlight": (
        Scene(spheres=(Sphere(material=Phong(0.1, 0.0, 0.0, gate_specular=True)),), lights=FAR_LIGHT),
        {"spheres.0.material.specular": [0.0, 0.5], "lights.0.intensity": [1.0, 0.0]},
        "double",
    ),
    "a power beyond fast": (Scene.chapter1(), {"spheres.0.material.shininess": [9.0, 2000.0]}, "fast"),
    "off the axis": (Scene(lights=FAR_LIGHT), {"spheres.0.center.0": [0.0, 0.25]}, "double"),
    "onto the axis": (Scene(spheres=DULL, lights=FAR_LIGHT), {"spheres.0.center.0": [0.25, 0.0]}, "double"),
    "the plane of the eye": (
        Scene(FRAMED, DULL, FAR_LIGHT),
        {"spheres.0.center": [[1.5, 0, 0], [1.5, 0, 3.2]]},
        "double",
    ),
    "behind the eye": (Scene(FRAMED, DULL, FAR_LIGHT), {"spheres.0.center": [[1.5, 0, 0], [1.5, 0, 9.0]]}, "double"),
    "far aside": (Scene(FRAMED, DULL, FAR_LIGHT), {"spheres.0.center.0": [1.0, 1500.0]}, "double"),
    "small": (Scene(FRAMED, DULL, FAR_LIGHT), {"spheres.0.radius": [1.0, 1e-12]}, "single"),
    "dark": (Scene(lights=FAR_LIGHT), {"lights.0.intensity": [1.0, 0.0]}, "double"),
    "matte": (Scene(lights=FAR_LIGHT), {"spheres.0.material.specular": [0.5, 0.0]}, "double"),
    "without a diffuse term": (Scene(lights=FAR_LIGHT), {"spheres.0.material.diffuse": [0.5, 0.0]}, "double"),
    "a mirrored background": (
        Scene(spheres=(Sphere(material=Phong(reflect=0.5)),), lights=FAR_LIGHT),
        {"background": [0.0, 0.25]},
        "double",
    ),
}


@pytest.mark.parametrize("case", ENDS)
def test_a_run_ends_before_a_set_that_calls_for_another_kernel(case: str) -> None:
    base, lists, accuracy = ENDS[case]
    parameters = {name: np.array([values[0], values[0], values[1]], dtype=np.float64) for name, values in lists.items()}
    sets = parameter_sets(base, parameters)
    inputs = alike.inputs_of(sets.columns)
    assert inputs is not None
    scene = sets.scene(0)
    plan = planned(scene, aspect=1.0)
    order = tuple(numbers_of(plan.scene))
    numbers, *_ = alike.rows_alike(scene, plan, inputs, accuracy, order, handed=handed_over(scene, accuracy))
    assert len(numbers) == (1 if "mirrored" in case else 2)
    found = render_batch(base, parameters, 9, 9, accuracy=accuracy)
    assert same_bits(found, one_by_one(base, parameters, 9, 9, accuracy=accuracy))


GLOSSY = Sphere(material=Phong(gate_specular=True))
OTHERS: dict[str, Scene] = {
    "another camera": Scene(Camera((0.0, 0.0, 5.0)), lights=FAR_LIGHT),
    "another frame": Scene(Camera(half_height=2.0), lights=FAR_LIGHT),
    "a gate": Scene(spheres=(GLOSSY,), lights=FAR_LIGHT),
    "a mirror and a background": Scene(
        spheres=(Sphere(material=Phong(reflect=0.5)),), lights=FAR_LIGHT, background=0.5
    ),
    "a fading light": Scene(lights=(PointLight((8.0, 6.0, 14.0), 1.0, (0.0, 0.1, 0.0)),)),
    "a light with a direction": Scene(lights=(DirectionalLight((-1.0, -1.0, -2.0)),)),
    "two spheres": PAIR,
    "two lights": Scene(lights=FAR_LIGHT * 2),
    "none": Scene(spheres=()),
    "a plane": Scene(lights=FAR_LIGHT, plane=Plane((0.0, -1.0, 0.0))),
    "a gradient": Scene(lights=FAR_LIGHT, background=Gradient(0.0, 0.5)),
    "a turned camera": Scene(Camera((1.0, 0.0, 4.0)), lights=FAR_LIGHT),
}


@pytest.mark.parametrize("case", OTHERS)
def test_a_scene_of_another_kind_ends_the_run_and_begins_its_own(case: str) -> None:
    plain = Scene(lights=FAR_LIGHT)
    scenes = [plain, plain, OTHERS[case], OTHERS[case], plain]
    inputs = alike.inputs_of_scenes(scenes)
    assert inputs is not None
    assert {len(column) for column in inputs.values()} == {2}
    found = render_batch(None, scenes, 13, 9, clip=False)
    assert same_bits(found, np.stack([render_image(scene, 13, 9, clip=False) for scene in scenes]))


@pytest.mark.parametrize("path", ["spheres.0.material.reflect", "camera.eye.2", "lights.0.attenuation"])
def test_paths_that_are_no_number_of_one_sphere_are_planned_set_by_set(path: str) -> None:
    values = np.ones((3, 3)) if path.endswith("attenuation") else np.full(3, 0.5)
    assert alike.inputs_of(parameter_sets(Scene.chapter1(), {path: values, "background": np.zeros(3)}).columns) is None


def test_sets_in_a_row_are_run_together() -> None:
    """A moving light, and a growing radius: nothing but the first set is planned."""
    scene = Scene.chapter1(light=(8.0, 6.0, 14.0), specular=0.2)
    for parameters in (
        {"lights.0.position": circling(500)},
        {"spheres.0.radius": np.linspace(0.5, 1.0, 500)},
        {"spheres.0.center": np.linspace((0.1, 0.1, -0.5), (0.3, 0.2, 0.2), 500), "background": np.zeros(500)},
        {"spheres.0.material.shininess": np.linspace(1.0, 32.0, 500), "lights.0.intensity": np.linspace(0.1, 1.0, 500)},
    ):
        render_batch(scene, {name: array[:1] for name, array in parameters.items()}, 8, 8)
        planned_before = statistics.planned
        found = render_batch(scene, parameters, 8, 8)
        assert statistics.planned <= planned_before + 2
        some = slice(None, None, 97)
        assert same_bits(found[some], one_by_one(scene, {n: a[some] for n, a in parameters.items()}, 8, 8))
        sets = parameter_sets(scene, parameters)
        planned_before = statistics.planned
        assert same_bits(render_batch(None, [sets.scene(k) for k in range(500)], 8, 8), found)
        assert statistics.planned <= planned_before + 2


def test_images_of_a_run_are_drawn_in_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    onto = Kernel.onto_many

    def counted(self: Kernel, images: NDArray[Any], numbers: Any, grids: Any) -> Any:
        write = onto(self, images, numbers, grids)

        def call(begin: int, end: int) -> None:
            calls.append(end - begin)
            write(begin, end)

        return call

    monkeypatch.setattr(Kernel, "onto_many", counted)
    render_batch(None, {"lights.0.position": circling(1000)}, 16, 16, threads=1)
    assert calls == [16 * 1000]


def test_a_sequence_of_scenes_of_any_kinds_is_drawn_in_its_order() -> None:
    grounded = structs.replace(PAIR, plane=Plane((0.0, -1.0, 0.0)))
    single = [Scene.chapter1(light=tuple(place)) for place in circling(5).tolist()]
    near = Scene.chapter1(light=(0.0, 0.0, 1.2))
    scenes = [*single[:3], PAIR, near, *single[3:], Scene(spheres=()), grounded, single[0]]
    found = render_batch(None, scenes, 21, 14, clip=False)
    assert found.shape == (len(scenes), 14, 21)
    assert same_bits(found, np.stack([render_image(scene, 21, 14, clip=False) for scene in scenes]))


@pytest.mark.parametrize(("accuracy", "target"), [("stable", None), ("certified", "float64"), ("certified", "uint8")])
def test_levels_that_prove_their_values_have_the_same_bits_too(accuracy: str, target: str | None) -> None:
    parameters = {"lights.0.position": circling(3)}
    options = {"accuracy": accuracy, "target": target}
    found = render_batch(None, parameters, 12, 9, **options)  # type: ignore[arg-type]
    assert found.dtype == variant(accuracy, target).result
    assert same_bits(found, one_by_one(Scene.chapter1(), parameters, 12, 9, **options))


@pytest.mark.parametrize("accuracy", ["double", "single"])
def test_lights_move_through_a_scene_of_many_surfaces(accuracy: str) -> None:
    parameters = {"lights.0.position": circling(6), "spheres.1.radius": np.linspace(0.2, 0.5, 6)}
    found = render_batch(PAIR, parameters, 24, 16, accuracy=accuracy, threads=2)
    assert same_bits(found, one_by_one(PAIR, parameters, 24, 16, accuracy=accuracy))


def test_colours_have_a_last_axis_and_grey_ones_fill_it() -> None:
    intensities = np.array([[1.0, 0.5, 0.25], [0.5, 0.5, 0.5], [0.0, 1.0, 2.0]])
    for scene in (Scene.chapter1(), PAIR):
        found = render_batch(scene, {"lights.0.intensity": intensities}, 10, 8)
        assert found.shape == (3, 8, 10, 3)
        assert same_bits(found, one_by_one(scene, {"lights.0.intensity": intensities}, 10, 8))


def test_a_turned_camera_and_a_camera_that_moves_are_drawn() -> None:
    eyes = np.array([(0.0, 0.0, 5.0), (3.0, 1.0, 4.0), (-2.0, 2.0, 4.0)])
    for parameters in ({"camera.eye": eyes}, {"camera.half_height": np.array([0.5, 1.0, 3.0])}):
        assert same_bits(render_batch(None, parameters, 9, 9), one_by_one(Scene.chapter1(), parameters, 9, 9))
    turned = Scene(Camera((3.0, 1.0, 4.0)), lights=(PointLight((9.0, 9.0, 9.0)),))
    lights = {"lights.0.position": circling(4)}
    assert same_bits(render_batch(turned, lights, 9, 9), one_by_one(turned, lights, 9, 9))


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("size", [(1, 1), (5, 1), (1, 5), (64, 48)])
def test_any_number_of_threads_gives_the_same_bits(threads: int, size: tuple[int, int]) -> None:
    parameters = {"lights.0.position": circling(30)}
    found = render_batch(None, parameters, *size, threads=threads)
    assert same_bits(found, one_by_one(Scene.chapter1(), parameters, *size))


# ---- out=


def test_out_may_be_a_file_larger_than_what_is_held_in_memory(tmp_path: Path) -> None:
    out = np.lib.format.open_memmap(tmp_path / "images.npy", mode="w+", dtype=np.float64, shape=(40, 16, 20))
    assert render_batch(None, {"lights.0.position": circling(40)}, 20, 16, out=out) is out
    out.flush()
    kept = np.load(tmp_path / "images.npy")
    assert same_bits(kept, render_batch(None, {"lights.0.position": circling(40)}, 20, 16))


@pytest.mark.parametrize("view", ["rows apart", "columns apart", "images backwards", "rows backwards"])
def test_out_may_have_any_strides_and_nothing_beside_it_is_touched(view: str) -> None:
    big = np.full((12, 12, 16), np.nan)
    out = {
        "rows apart": big[::2, 3:9, 2:10],
        "columns apart": big[::2, ::2, ::2],
        "images backwards": big[::-2, :6, :8],
        "rows backwards": big[:6, 5::-1, :8],
    }[view]
    parameters = {"lights.0.position": circling(6)}
    assert render_batch(None, parameters, 8, 6, out=out) is out
    assert same_bits(np.ascontiguousarray(out), render_batch(None, parameters, 8, 6))
    assert np.isnan(big).sum() == big.size - out.size


@pytest.mark.parametrize(
    ("out", "message"),
    [
        (np.zeros((2, 6, 8)), r"out: has shape \(2, 6, 8\); expected \(count, height, width\) = \(3, 6, 8\)"),
        (np.zeros((3, 6, 8), np.float32), "out: has dtype float32; this accuracy writes float64"),
        (np.broadcast_to(0.0, (3, 6, 8)), "out: is read-only"),
    ],
)
def test_an_out_that_cannot_take_the_images_is_refused(out: NDArray[Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        render_batch(None, {"lights.0.position": circling(3)}, 8, 6, out=out)


# ---- progress


@pytest.fixture(autouse=True)
def usual_blocks() -> Iterator[None]:
    """What a test with blocks of another size left behind is forgotten."""
    yield
    block_ends.cache_clear()


def test_progress_is_told_in_the_caller_s_thread_and_never_goes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 0.0)
    monkeypatch.setattr("symrender_cg.run.threads.MOST_PIXELS", 1 << 12)
    block_ends.cache_clear()
    told: list[tuple[int, int]] = []
    threads = set()

    def progress(done: int, total: int) -> None:
        told.append((done, total))
        threads.add(threading.get_ident())

    for scene, count, number in ((Scene.chapter1(), 500, 1), (Scene.chapter1(), 500, 2), (PAIR, 3, 2)):
        told.clear()
        render_batch(scene, {"lights.0.position": circling(count)}, 16, 17, threads=number, progress=progress)
        assert len(told) > 2 or (number == 2 and scene is not PAIR)  # there the other thread may have drawn it all
        assert told == sorted(told)
        assert told[-1] == (count, count)
        assert told.count((count, count)) == 1
        assert all(total == count for _, total in told)
    assert threads == {threading.get_ident()}


def test_progress_is_told_at_a_bounded_rate() -> None:
    told: list[float] = []
    begin = time.monotonic()
    render_batch(PAIR, {"lights.0.position": circling(40)}, 4, 4, progress=lambda *_: told.append(time.monotonic()))
    assert len(told) <= 1 + (told[-1] - begin) / batch.SECONDS_BETWEEN


def slow(onto: Callable[..., Callable[..., Any]]) -> Callable[..., Any]:
    """A kernel's function for many images, made to take 2 ms more."""

    def made(*arguments: Any) -> Callable[..., Any]:
        write = onto(*arguments)

        def call(*rows: Any) -> Any:
            time.sleep(2e-3)
            return write(*rows)

        return call

    return made


def slowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes every block of a lot take 2 ms, and blocks small."""
    for kind in (Kernel, SceneKernel):
        monkeypatch.setattr(kind, "onto_many", slow(kind.onto_many))
    monkeypatch.setattr("symrender_cg.run.threads.MOST_PIXELS", 1 << 9)
    monkeypatch.setattr("symrender_cg.run.threads.LEAST_PIXELS", 1 << 9)
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 0.0)
    block_ends.cache_clear()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("scene", [Scene.chapter1(), PAIR])
def test_an_error_in_progress_ends_the_batch_and_reaches_the_caller(
    scene: Scene, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    slowed(monkeypatch)
    out = np.full((60, 17, 16), np.nan)

    def stop(done: int, total: int) -> None:
        if done >= 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_batch(scene, {"lights.0.position": circling(60)}, 16, 17, threads=threads, out=out, progress=stop)
    begun = np.isfinite(out).sum()
    assert 0 < begun < out.size
    assert np.isnan(out[-1]).all()
    time.sleep(0.02)
    assert np.isfinite(out).sum() == begun
    whole = render_batch(scene, {"lights.0.position": circling(60)}, 16, 17, threads=threads)
    assert np.isfinite(whole).all()


# ---- refusals

REFUSED: dict[str, tuple[Any, str]] = {
    "nothing": ({}, "parameters: is empty"),
    "a scene": (Scene.chapter1(), "parameters: Scene is not known; expected a sequence of scenes, or a mapping"),
    "an array": (np.zeros(3), "parameters: ndarray is not known"),
    "no scenes": ([], "parameters: there is no set"),
    "not a scene": ([Scene.chapter1(), "chapter1"], "parameters[1]: expected a Scene, not str"),
    "no field": ({"lights.0.place": circling(2)}, "parameters['lights.0.place']: lights.0 has no 'place'; it has pos"),
    "a slip": ({"spheres.0.radus": [1.0]}, "did you mean 'radius'?"),
    "no sphere": ({"spheres.1.radius": [1.0]}, "spheres has no '1'; expected a number from 0 to 0"),
    "no number": ({"spheres.first.radius": [1.0]}, "spheres has no 'first'"),
    "too deep": ({"spheres.0.radius.x": [1.0]}, "spheres.0.radius is 1.0, which has no parts; leave 'x' out"),
    "too little": ({"spheres.0": [1.0]}, "has parts of its own; name one of them: center, radius, material"),
    "all spheres": ({"spheres": [1.0]}, "has parts of its own"),
    "no plane": ({"plane": [1.0]}, "parameters['plane']: is None; give the scene one"),
    "inside no plane": ({"plane.tile": [1.0]}, "plane is None, which has no parts"),
    "not text": ({3: [1.0]}, "parameters: 3 is not a path"),
    "words": ({"spheres.0.radius": ["a"]}, "expected real numbers, not an array of <U1"),
    "one number": ({"spheres.0.radius": 1.0}, "has shape (); expected (count,), one value a set"),
    "a vector for a number": (
        {"spheres.0.radius": circling(2)},
        "has shape (2, 3); expected (count,), one value a set",
    ),
    "numbers for a vector": ({"lights.0.position": [1.0]}, "has shape (1,); expected (count, 3), one value a set"),
    "two numbers for a colour": ({"background": [[1.0, 2.0]]}, "expected (count,) or (count, 3), one value a set"),
    "counts": (
        {"lights.0.position": circling(2), "background": np.zeros(3)},
        "parameters['background']: has 3 sets, and parameters['lights.0.position'] has 2",
    ),
    "no values": ({"background": []}, "parameters['background']: there is no set"),
    "twice": ({"spheres.0.radius": [1.0], "spheres[0].radius": [1.0]}, "another entry sets it too"),
    "a part twice": ({"lights.0.position": circling(1), "lights.0.position.2": [1.0]}, "another entry sets it too"),
    "two kinds": (
        [Scene.chapter1(), Scene(background=(0.0, 0.0, 0.0))],
        "parameters[1]: is in colour, and parameters[0] is grey; expected one kind",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_parameters_that_fit_nothing_are_refused(case: str) -> None:
    parameters, message = REFUSED[case]
    with pytest.raises(ArgumentError, match=re.escape(message)):
        render_batch(Scene.chapter1(), parameters, 8, 8)


@pytest.mark.parametrize(
    ("name", "bad", "message"),
    [
        ("spheres.0.radius", -1.0, r"parameters, set 2: spheres\[0\]\.radius: -1.0 is not positive"),
        ("spheres.0.radius", 4.0, r"parameters, set 2: camera\.eye: .* is on spheres\[0\]"),
        ("spheres.0.material.shininess", math.nan, r"parameters, set 2: spheres\[0\]\.material\.shininess: nan is not"),
        ("lights.0.position.0", math.inf, r"parameters, set 2: lights\[0\]\.position.*: inf is not finite"),
        ("background", -0.5, r"parameters, set 2: background: -0.5 is negative"),
    ],
)
def test_a_set_that_has_no_image_is_named_with_its_number(name: str, bad: float, message: str) -> None:
    values = np.array([1.0, 1.0, bad, 1.0])
    with pytest.raises(SceneError, match=message):
        render_batch(None, {name: values}, 8, 8)


def test_numbers_outside_every_plan_are_refused() -> None:
    with pytest.raises(OutsidePlanError):
        render_batch(Scene(Camera(half_height=1.0)), {"spheres.0.radius": [1.0, 1e-280]}, 8, 8)


def test_gradients_planes_and_switches_can_be_set() -> None:
    scene = Scene(PAIR.camera, PAIR.spheres, PAIR.lights, Gradient(0.0, 0.5), plane=Plane((0.0, -1.0, 0.0)))
    parameters: dict[str, Any] = {
        "background.top": [0.25, 0.75],
        "plane.point": [[0.0, -0.5, 0.0], [0.0, -2.0, 0.0]],
        "shadows": [True, False],
        "max_bounces": [0, 3],
        "spheres.1.material.reflect": [0.0, 0.5],
        "lights.0.attenuation": [[1.0, 0.0, 0.0], [0.0, 0.1, 0.0]],
    }
    found = render_batch(scene, parameters, 12, 10)
    assert same_bits(found, one_by_one(scene, parameters, 12, 10))
    assert not same_bits(found[0], found[1])


# ---- the document

DOCUMENT = Path(__file__).resolve().parent.parent / "docs" / "batches.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize("index", range(len(EXAMPLES)))
def test_the_examples_of_the_document_run(
    index: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(EXAMPLES[index], f"{DOCUMENT.name}, example {index}", "exec"), {})
    if "progress" in EXAMPLES[index]:
        assert capsys.readouterr().out.endswith("100 of 100\n")


def test_the_document_has_examples_of_each_function() -> None:
    assert len(EXAMPLES) >= 6
    for name in ("render_batch(", "render_blocks(", "render_image(", "progress=", "open_memmap("):
        assert any(name in example for example in EXAMPLES)
