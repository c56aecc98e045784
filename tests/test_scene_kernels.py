"""Scene kernels draw what brute force draws: every ray, every sphere, every blocker, every bounce, and no plan.

Hundreds of random scenes go through one compiled kernel, which has every effect in its text and draws any scene by its
own plan (benchmarks.random_scenes); the scenes of a few structures go through their own kernels too, bit for bit the
same. `python -m benchmarks random-scenes` does that for thousands, each by its own kernel.

Figures in docstrings were measured over random_scene(0) to random_scene(2099), 24 x 20 pixels each.
"""

from __future__ import annotations

import os
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs
from scene_strategies import random_scene, scenes

from benchmarks.random_scenes import (
    OPTIONAL,
    OTHER_FORM,
    Compared,
    EveryEffect,
    compare,
    errors,
    every_effect,
    grid,
    largest_change,
    sum_of_terms,
)
from symrender_cg import evaluate, render_image
from symrender_cg.build import default_root
from symrender_cg.pipeline import draw, planned
from symrender_cg.plan.effects import SCENE
from symrender_cg.plan.plan import Plan
from symrender_cg.reference import brute_force, oracle
from symrender_cg.run.render import render_layers
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.scene import Camera, Gradient, Phong, PointLight, Scene, Sphere

THOROUGH = os.environ.get("SYMRENDER_THOROUGH") == "1"
WIDTH, HEIGHT = 24, 20
SEEDS = range(3000 if THOROUGH else 100)
BOUND = 1e-12
"""Of |value - brute force| / max(1, value), where no decision is in doubt by 1e-9. Measured: 3.9e-14."""

BOUND_SINGLE = 1e-5
"""The same for float32, where no decision is in doubt by 1e-4. Measured: 1.6e-6."""

Floats = npt.NDArray[np.float64]


@cache
def root() -> Path:
    return Path(default_root())


@cache
def compared(seed: int) -> Compared:
    """A random scene by the kernel of every effect, against all that is known of it."""
    return compare(random_scene(seed), seed, WIDTH, HEIGHT, root(), own=False)


def every(accuracy: str = "double") -> EveryEffect:
    return every_effect(accuracy, root())


def scene_plan(scene: Scene, *, aspect: float | None = WIDTH / HEIGHT) -> Plan:
    return planned(scene, force=(SCENE,), aspect=aspect)


# ------------------------------------------------------------------------------------------------------ brute force


def test_a_scene_is_brute_force_s_at_every_pixel_that_is_not_in_doubt() -> None:
    found = [compared(seed) for seed in SEEDS]
    assert [one.seed for one in found if not one.error < BOUND] == []
    for seed in range(5000, 5100):
        scene, traced = random_scene(seed), brute_force.image(random_scene(seed), WIDTH, HEIGHT)
        assert errors(every().image(scene_plan(scene), WIDTH, HEIGHT), traced.value, traced.doubt > 1e-9) < BOUND, seed
    assert sum(one.doubtful for one in found) < 0.01 * sum(one.pixels for one in found)


def test_a_scene_in_float32_is_brute_force_s_at_every_pixel_that_is_not_in_doubt() -> None:
    found = [compared(seed) for seed in SEEDS]
    assert [scene.seed for scene in found if not scene.error_single < BOUND_SINGLE] == []
    assert sum(scene.doubtful_single for scene in found) < 0.05 * sum(scene.pixels for scene in found)
    assert sum(scene.refused for scene in found) < 0.1 * len(found)


def test_every_value_is_a_number() -> None:
    """Also where a decision is in doubt."""
    assert [seed for seed in (*SEEDS, 1137) if compared(seed).infinite] == []


def test_depths_and_normals_are_brute_force_s() -> None:
    """Measured: 9.7e-13, of the depth or of 1."""
    assert [seed for seed in SEEDS if not compared(seed).geometry < 1e-11] == []


def test_the_terms_add_up_to_the_image() -> None:
    """At every pixel; as sums of other orders do, to a few ulp. Measured: 4.2e-16."""
    assert [seed for seed in SEEDS if not compared(seed).terms < 2e-15] == []


def test_the_index_is_the_oracle_s_at_every_pixel() -> None:
    """Exactly, whatever the doubt."""
    assert [seed for seed in SEEDS if compared(seed).wrong] == []


def test_points_are_pixels_bit_for_bit() -> None:
    """Although the plan for points knows no window and leaves less out."""
    assert [seed for seed in SEEDS if "points" in compared(seed).changed] == []


@pytest.mark.parametrize("effect", OPTIONAL)
def test_an_effect_forced_in_changes_no_bit(effect: str) -> None:
    """What is left out adds 0, is never nearer, never darkens; so sums and comparisons stay what they are, bit by bit.

    front_test alone takes another form of the same normal, by the cross product: equal to rounding. Measured: 1.8e-14.
    """
    changes = {seed: compared(seed).changed.get(effect, 0.0) for seed in SEEDS}
    if effect in OTHER_FORM:
        assert max(changes.values()) < BOUND
        assert any(changes.values())
    else:
        assert [seed for seed, change in changes.items() if change] == []


@settings(max_examples=1000 if THOROUGH else 60)
@given(scene=scenes(), effect=st.sampled_from(OPTIONAL))
def test_a_scene_of_hypothesis_is_brute_force_s_with_and_without_an_effect_forced_in(scene: Scene, effect: str) -> None:
    traced = brute_force.image(scene, 10, 8)
    clear = traced.doubt > 1e-9
    found = scene_plan(scene, aspect=1.25)
    drawn = every().layers(found, 10, 8)
    assert errors(drawn["image"], traced.value, clear) < BOUND
    assert errors(sum_of_terms(drawn), drawn["image"], np.ones(clear.shape, dtype=bool)) < 2e-15
    np.testing.assert_array_equal(drawn["index"], oracle.index(scene, *grid(found.scene, 10, 8)))
    forced = planned(scene, force=tuple(sorted({SCENE, effect})), aspect=1.25)
    change = largest_change(every().image(forced, 10, 8), drawn["image"])
    assert change == 0.0 or (effect in OTHER_FORM and change < BOUND)


# ---------------------------------------------------------------------------------------------- the scene's own kernel

STRUCTURES = 2
RICH = frozenset({"spans", "diffuse", "specular"})


@cache
def structures() -> dict[tuple[str, ...], list[int]]:
    """The commonest structures that shade, with the numbers of scenes that have them."""
    found: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for seed in range(600):
        key = scene_plan(random_scene(seed)).key
        if set(key) >= RICH and len(key) > 6:
            found[key].append(seed)
    most = Counter({key: len(seeds) for key, seeds in found.items()}).most_common(STRUCTURES)
    return {key: found[key] for key, _ in most}


def left_open(scene: Scene) -> npt.NDArray[np.bool_]:
    """The pixels that the kernel leaves to the enclosure."""
    drawing = draw(scene, size=(WIDTH, HEIGHT), force=(SCENE,))
    assert isinstance(drawing.kernel, SceneKernel)
    image = np.empty(drawing.shape(HEIGHT, WIDTH))
    found = np.zeros(HEIGHT * WIDTH, dtype=np.bool_)
    found[drawing.kernel.rows(image, drawing.numbers, begin=0, end=HEIGHT)] = True
    return found.reshape(HEIGHT, WIDTH)


def test_a_scene_s_own_kernel_draws_what_the_kernel_of_every_effect_draws_bit_for_bit() -> None:
    """What the plan leaves out of the C changes nothing."""
    assert len(structures()) == STRUCTURES
    for seeds in structures().values():
        assert len(seeds) >= 3
        for seed in seeds:
            scene = random_scene(seed)
            own, whole = render_layers(scene, WIDTH, HEIGHT), every().layers(scene_plan(scene), WIDTH, HEIGHT)
            assert own.keys() == whole.keys()
            for name in own:
                np.testing.assert_array_equal(own[name], whole[name], f"{name} of scene {seed}")
            image, open_pixels = render_image(scene, WIDTH, HEIGHT, clip=False), left_open(scene)
            np.testing.assert_array_equal(image[~open_pixels], own["image"][~open_pixels])
            assert errors(own["image"], brute_force.image(scene, WIDTH, HEIGHT).value, own["index"] < 0) < BOUND


@pytest.fixture(scope="module")
def colourful() -> Scene:
    """A scene whose kernel is compiled anyway, with three channels."""
    return next(random_scene(seeds[0]) for key, seeds in structures().items() if "colour" in key)


def test_threads_give_the_same_bits(colourful: Scene) -> None:
    one = render_image(colourful, 61, 53, threads=1)
    assert len(np.unique(one)) > 100
    for threads in (2, 3, 7):
        np.testing.assert_array_equal(one, render_image(colourful, 61, 53, threads=threads))


def test_out_may_have_any_strides(colourful: Scene) -> None:
    wanted = render_image(colourful, 31, 17, clip=False)
    whole = np.full((40, 70, 4), 7.0)
    views = (
        whole[:17, :31, :3],
        whole[:34:2, :62:2, 1:],
        whole[16::-1, 30::-1, 2::-1],
        whole[:17, 31:62, ::-1][..., :3],
    )
    for view in views:
        whole[...] = 7.0
        assert render_image(colourful, 31, 17, clip=False, out=view) is view
        np.testing.assert_array_equal(view, wanted)
        assert (whole == 7.0).sum() == whole.size - wanted.size + (wanted == 7.0).sum()


def test_points_of_the_own_kernel_are_its_pixels_in_any_order_and_number(colourful: Scene) -> None:
    """More points than are shaded together, and none."""
    wanted = render_image(colourful, 61, 53, clip=False)
    x, y = grid(colourful.in_camera_frame(), 61, 53)
    order = np.random.default_rng(4).permutation(x.size)
    found = evaluate(colourful, x.ravel()[order], y.ravel()[order])
    np.testing.assert_array_equal(found, wanted.reshape(-1, 3)[order])
    assert evaluate(colourful, [], []).shape == (0, 3)
    for count in (1, 127, 128, 129, 257):
        np.testing.assert_array_equal(
            evaluate(colourful, x.ravel()[:count], y.ravel()[:count]), wanted.reshape(-1, 3)[:count]
        )


def channel_of(scene: Scene, k: int) -> Scene:
    """The grey scene of one channel."""

    def grey(colour: float | tuple[float, float, float]) -> float:
        return colour[k] if isinstance(colour, tuple) else colour

    def material(it: Phong) -> Phong:
        return structs.replace(it, ambient=grey(it.ambient), diffuse=grey(it.diffuse), specular=grey(it.specular))

    plane, background = scene.plane, scene.background
    if plane is not None:
        checker = None if plane.checker is None else material(plane.checker)
        plane = structs.replace(plane, material=material(plane.material), checker=checker)
    if isinstance(background, Gradient):
        background = structs.replace(background, bottom=grey(background.bottom), top=grey(background.top))
    else:
        background = grey(background)
    return structs.replace(
        scene,
        spheres=tuple(structs.replace(s, material=material(s.material)) for s in scene.spheres),
        lights=tuple(structs.replace(light, intensity=grey(light.intensity)) for light in scene.lights),
        plane=plane,
        background=background,
    )


def test_a_channel_is_the_image_of_the_grey_scene_of_its_colours_bit_for_bit() -> None:
    tried = 0
    for seed in SEEDS[:80]:
        scene = random_scene(seed)
        if scene.channels == 1:
            continue
        image = every().image(scene_plan(scene), WIDTH, HEIGHT)
        for k in range(3):
            grey = channel_of(scene, k)
            assert grey.channels == 1
            np.testing.assert_array_equal(every().image(scene_plan(grey), WIDTH, HEIGHT), image[..., k])
        tried += 1
    assert tried > 20


# --------------------------------------------------------------------------------------- which surface, at the borders


def painted(scene: Scene) -> Scene:
    """The scene in flat colours: the value at a point says which surface is seen there (see `index_of`)."""

    def paint(number: int) -> Phong:
        return Phong((number + 2) / 64.0, 0.0, 0.0)

    plane = scene.plane
    if plane is not None:
        plane = structs.replace(plane, material=paint(len(scene.spheres)), checker=None)
    spheres = tuple(structs.replace(s, material=paint(k)) for k, s in enumerate(scene.spheres))
    return structs.replace(scene, spheres=spheres, lights=(), plane=plane, background=1.0 / 64.0)


def index_of(values: Any) -> npt.NDArray[np.int64]:
    """The index of the surface that has this value in a painted scene; -1 for the background."""
    return np.asarray(np.rint(64.0 * values) - 2.0, dtype=np.int64)


def border_points(frame: Scene, seed: int, count: int) -> Iterator[tuple[str, float, float]]:
    """Points of the image plane, float64, whose rays touch a sphere, or meet two surfaces in one point, to rounding."""
    chance = np.random.default_rng(seed)
    eye = np.array(frame.camera.eye)
    for kind, point in _borders(frame, chance, count):
        ray = point - eye
        if ray[2] < -1e-9 * np.linalg.norm(ray):
            x, y = eye[2] * ray[:2] / -ray[2]
            for step in (-2.0, -1.0, 0.0, 1.0, 2.0, *(10.0 ** chance.uniform(1.0, 8.0, 2) * (-1.0, 1.0))):
                yield kind, float(x * (1.0 + step * 2.0**-53)), float(y)


def _borders(frame: Scene, chance: np.random.Generator, count: int) -> Iterator[tuple[str, Floats]]:
    eye = np.array(frame.camera.eye)
    spheres = [(np.array(s.center), s.radius) for s in frame.spheres]
    for center, radius in spheres:
        m = center - eye
        sine = radius / np.linalg.norm(m)
        if sine < 1.0:
            for across in _circle(m, chance, count):
                yield "silhouette", eye + m * (1.0 - sine * sine) + across * radius * np.sqrt(1.0 - sine * sine)
    for k, (center, radius) in enumerate(spheres):
        for other, size in spheres[:k]:
            way = other - center
            apart = float(np.linalg.norm(way))
            if abs(radius - size) < apart < radius + size:
                along = (apart * apart + radius * radius - size * size) / (2.0 * apart)
                for across in _circle(way, chance, count):
                    yield "cut", center + way * (along / apart) + across * np.sqrt(radius * radius - along * along)
    if frame.plane is not None:
        normal = np.array(frame.plane.normal) / np.linalg.norm(frame.plane.normal)
        for center, radius in spheres:
            along = float(normal @ (np.array(frame.plane.point) - center))
            if abs(along) < radius:
                for across in _circle(normal, chance, count):
                    yield "waterline", center + normal * along + across * np.sqrt(radius * radius - along * along)


def _circle(axis: Floats, chance: np.random.Generator, count: int) -> Iterator[Floats]:
    """Unit vectors perpendicular to an axis."""
    across = np.linalg.svd(axis[np.newaxis, :])[2][1:]
    for turn in chance.uniform(0.0, 2.0 * np.pi, count):
        yield np.cos(turn) * across[0] + np.sin(turn) * across[1]


@pytest.mark.parametrize(("accuracy", "rounding"), [("double", 4e-15), ("single", 1e-8)])
def test_points_at_silhouettes_and_at_equal_depths_show_the_surface_that_the_oracle_sees(
    accuracy: str, rounding: float
) -> None:
    """A silhouette is settled exactly. Which of two surfaces is in front is settled by rounded depths, so that they may
    change places where these are equal to rounding: measured, where brute force's doubt is below 2e-16 or 2.1e-9.
    """
    tried: Counter[str] = Counter()
    for seed in range(400 if THOROUGH else 60):
        scene = painted(random_scene(seed))
        found = scene_plan(scene, aspect=None)
        points = list(border_points(found.scene, seed, 3))
        if not points:
            continue
        kinds, x, y = np.array([kind for kind, _, _ in points]), *(np.array([p[k] for p in points]) for k in (1, 2))
        values = every(accuracy).points(found, x, y)
        true, clear = oracle.index(scene, x, y), brute_force.trace(scene, x, y).doubt > rounding
        wrong = index_of(values[..., 0] if values.ndim == 2 else values) != true
        assert not (wrong & (clear | (kinds == "silhouette"))).any(), seed
        tried.update(kinds.tolist())
    assert min(tried[kind] for kind in ("silhouette", "cut", "waterline")) > 500


def touching_half_heights(frame: Scene, k: int, column: float, row: float, height: int) -> list[float]:
    """Half-heights of the camera at which the ray through a pixel, so many pixels from the axis, touches sphere k."""
    m = np.array(frame.spheres[k].center) - np.array(frame.camera.eye)
    across, along = np.array([column, row, 0.0]), np.array([0.0, 0.0, -frame.camera.eye[2]])
    radius2, a, b = frame.spheres[k].radius ** 2, np.cross(m, across), np.cross(m, along)
    terms = [
        radius2 * (across @ across) - a @ a,
        -2.0 * (a @ b),
        radius2 * (along @ along) - b @ b,
    ]
    with np.errstate(all="ignore"):
        roots = np.roots(terms) if abs(terms[0]) > 0.0 else np.array([])
    return [float(p.real) * height / 2 for p in roots if abs(p.imag) == 0.0 and p.real > 1e-6]


def test_pixels_at_silhouettes_show_the_surface_that_the_oracle_sees() -> None:
    """Rows, whose spans have ends in closed form: the camera's half-height puts a pixel on a silhouette."""
    chance, tried, edges = np.random.default_rng(8), 0, 0
    for seed in range(300 if THOROUGH else 100):
        frame = painted(random_scene(seed)).in_camera_frame()
        for _ in range(3 if frame.spheres else 0):
            k, i, j = int(chance.integers(len(frame.spheres))), int(chance.integers(8)), int(chance.integers(8))
            for half_height in touching_half_heights(frame, k, i - 3.5, 3.5 - j, 8)[:1]:
                for step in (-1, 0, 1):
                    camera = structs.replace(frame.camera, half_height=half_height * (1.0 + step * 2.0**-52))
                    scene = structs.replace(frame, camera=camera)
                    found = scene_plan(scene, aspect=1.0)
                    x, y = grid(found.scene, 8, 8)
                    for accuracy in ("double", "single"):
                        drawn = every(accuracy).layers(found, 8, 8)
                        np.testing.assert_array_equal(drawn["index"], oracle.index(scene, x, y), f"scene {seed}")
                    edges += int(brute_force.trace(scene, x[j, i], y[j, i]).doubt < 1e-14)
                    tried += 1
    assert tried > 100
    assert edges > 50


SILVER = Phong(0.1, 0.6, 0.4, 20.0, reflect=0.5)


def test_a_mirror_that_sees_itself_in_a_mirror_ends_after_the_bounces_asked_for() -> None:
    """Two spheres face to face: each bounce adds a term, and the last one sees nothing."""
    spheres = (Sphere((-1.02, 0.0, 0.0), 1.0, SILVER), Sphere((1.02, 0.0, 0.0), 1.0, SILVER))
    camera, lights = Camera((0.0, 0.0, 6.0), half_height=1.0), (PointLight((1.0, 5.0, 8.0)),)
    images = []
    for bounces in (0, 1, 2, 3, 16):
        scene = Scene(camera, spheres, lights, 0.25, max_bounces=bounces)
        traced = brute_force.image(scene, WIDTH, HEIGHT)
        image = every().image(scene_plan(scene), WIDTH, HEIGHT)
        assert errors(image, traced.value, traced.doubt > 1e-9) < BOUND
        images.append(image)
    assert all(largest_change(one, other) > 1e-9 for one, other in pairwise(images))


@pytest.mark.parametrize("accuracy", ["double", "single"])
@pytest.mark.parametrize("force", [(), ("front_test",)])
@pytest.mark.parametrize(
    ("radius", "eye", "touching"), [(3.0, 5.0, 3.75), (15.0, 17.0, 31.875), (63.0, 65.0, 255.9375)]
)
def test_a_ray_that_touches_a_sphere_hits_it_and_the_next_float_misses(
    radius: float, eye: float, touching: float, force: tuple[str, ...], accuracy: str
) -> None:
    """disc = 0 exactly, at x = e R / sqrt(e^2 - R^2): no rounded disc has a sign there."""
    pixel = touching / 7.5  # of 16 in a row the outermost are the touching ones; of 15 rows one is in the middle
    camera = Camera((0.0, 0.0, eye), half_height=7.5 * pixel)
    scene = painted(Scene(camera, (Sphere((0.0, 0.0, 0.0), radius),)))
    found = planned(scene, force=tuple(sorted({SCENE, *force})))
    beyond, zeros = np.nextafter(touching, np.inf), np.zeros(4)
    ends = np.array([touching, -touching, beyond, -beyond])
    for x, y in ((ends, zeros), (zeros, ends)):
        assert index_of(every(accuracy).points(found, x, y)).tolist() == [0, 0, -1, -1]
    x, y = grid(found.scene, 16, 15)
    assert (x[7, -1], y[7, -1]) == (touching, 0.0)
    seen = every(accuracy).layers(found, 16, 15)["index"]
    assert seen[7].tolist() == [0] * 16
    np.testing.assert_array_equal(seen, oracle.index(scene, x, y))
