"""The brute-force reference: laws that the definition of the image obeys, and pictures whose numbers are known."""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs
from scene_strategies import random_scene, scaled, scene_points, scenes, turned
from strategies import ordinary_scenes

from symrender_cg.errors import ArgumentError
from symrender_cg.reference import brute_force, oracle
from symrender_cg.reference.brute_force import Traced
from symrender_cg.reference.per_pixel import evaluate_per_pixel
from symrender_cg.scene import Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere

SURE = 1e-9
"""Doubt above which two evaluations have to take the same decisions."""
FIELDS = ("value", "index", "normal", "background", "ambient", "diffuse", "specular", "reflected", "doubt", "condition")
FLAT = Phong(0.25, 0.0, 0.0)
CAMERA = Camera((0.0, 0.0, 4.0), half_height=2.0)


def traced(scene: Scene, count: int, seed: int) -> Traced:
    return brute_force.trace(scene, *scene_points(scene, count, seed))


def over_channels(values: npt.NDArray[np.float64], points: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """The largest |values| of each point."""
    return np.asarray(np.abs(values).reshape(points.size, -1).max(axis=1))


def compare(scene: Scene, other: Scene, seed: int, bound: float) -> float:
    """Asserts that two scenes of one camera look the same where the first is in no doubt; returns the share of such."""
    x, y = scene_points(scene, 60, seed)
    here, there = brute_force.trace(scene, x, y), brute_force.trace(other, x, y)
    sure = here.doubt > SURE
    difference = over_channels(here.value - there.value, here.index)
    assert (difference[sure] <= bound * (1.0 + here.condition[sure])).all(), difference[sure].max()
    return float(sure.mean())


# ------------------------------------------------------------------------------------------------------------- laws


@settings(max_examples=60)
@given(scene=scenes(), seed=st.integers(0, 99))
def test_terms_sum_to_the_value_and_the_background_is_all_there_is_beside_surfaces(scene: Scene, seed: int) -> None:
    seen = traced(scene, 40, seed)
    channels = () if scene.channels == 1 else (3,)
    assert seen.value.shape == (40, *channels)
    assert seen.diffuse.shape == seen.specular.shape == (len(scene.lights), 40, *channels)
    total = seen.background + seen.ambient + seen.diffuse.sum(axis=0) + seen.specular.sum(axis=0) + seen.reflected
    np.testing.assert_array_equal(total, seen.value)
    assert np.isfinite(seen.value).all()
    assert (seen.value >= 0.0).all()
    assert not np.isnan(seen.doubt).any()
    assert (seen.doubt >= 0.0).all()
    missed = seen.index < 0
    np.testing.assert_array_equal(seen.background[missed], seen.value[missed])
    np.testing.assert_array_equal(np.isinf(seen.depth), missed)
    assert not seen.background[~missed].any()
    assert not seen.normal[missed].any()
    np.testing.assert_allclose(np.linalg.norm(seen.normal[~missed], axis=-1), 1.0, rtol=1e-14)
    if not isinstance(scene.background, Gradient):
        wanted = np.broadcast_to(np.asarray(scene.background), seen.value[missed].shape)
        np.testing.assert_array_equal(seen.value[missed], wanted)


@settings(max_examples=40)
@given(scene=scenes(), seed=st.integers(0, 99), k=st.sampled_from((-300, -3, 1, 300)))
def test_every_length_times_a_power_of_two_changes_no_bit(scene: Scene, seed: int, k: int) -> None:
    frame = scene.in_camera_frame()
    x, y = scene_points(frame, 30, seed)
    here, there = brute_force.trace(frame, x, y), brute_force.trace(scaled(frame, k), np.ldexp(x, k), np.ldexp(y, k))
    attenuated = any(isinstance(li, PointLight) and li.attenuation != (1.0, 0.0, 0.0) for li in scene.lights)
    for name in FIELDS:
        if attenuated and name in ("value", "diffuse", "specular", "reflected"):
            np.testing.assert_allclose(getattr(here, name), getattr(there, name), rtol=1e-15, atol=0.0)
        else:
            np.testing.assert_array_equal(getattr(here, name), getattr(there, name), name)
    np.testing.assert_array_equal(np.ldexp(here.depth, k), there.depth)


def test_turning_scene_and_camera_together_changes_little() -> None:
    share = [compare(random_scene(seed), turned(random_scene(seed), seed), seed, 2e-12) for seed in range(60)]
    assert np.mean(share) > 0.99


def test_the_order_of_spheres_and_lights_in_a_scene_does_not_matter() -> None:
    for seed in range(60):
        scene = random_scene(seed)
        order = np.random.default_rng(seed).permutation(len(scene.spheres))
        other = structs.replace(
            scene, spheres=tuple(scene.spheres[k] for k in order), lights=tuple(reversed(scene.lights))
        )
        geometry = [(s.center, s.radius) for s in scene.spheres]
        x, y = scene_points(scene, 60, seed)
        here, there = brute_force.trace(scene, x, y), brute_force.trace(other, x, y)
        if len(set(geometry)) == len(geometry):
            surfaces = np.append(order, [len(order), -1])
            np.testing.assert_array_equal(here.index[here.doubt > 0], surfaces[there.index][here.doubt > 0])
            np.testing.assert_array_equal(here.depth, there.depth)
            np.testing.assert_allclose(here.value, there.value, rtol=0.0, atol=4e-15)


def test_a_light_of_intensity_0_changes_no_bit_and_two_halves_are_the_light() -> None:
    for seed in range(60):
        scene = random_scene(seed)
        here = traced(scene, 40, seed)
        dark = structs.replace(scene, lights=(*scene.lights, PointLight((1.0, 2.0, 3.0), 0.0)))
        np.testing.assert_array_equal(here.value, traced(dark, 40, seed).value)
        halves = tuple(
            structs.replace(li, intensity=tuple(0.5 * v for v in np.broadcast_to(li.intensity, 3).tolist()))
            if isinstance(li.intensity, tuple)
            else structs.replace(li, intensity=0.5 * li.intensity)
            for li in scene.lights
            for _ in range(2)
        )
        np.testing.assert_allclose(
            traced(structs.replace(scene, lights=halves), 40, seed).value, here.value, rtol=4e-15
        )


def test_without_shadows_and_mirrors_spheres_that_are_not_seen_can_go() -> None:
    gone = 0
    for seed in range(60):
        scene = structs.replace(random_scene(seed).in_camera_frame(), shadows=False, max_bounces=0)
        here = brute_force.image(scene, 24, 24)
        kept = tuple(sphere for k, sphere in enumerate(scene.spheres) if (here.index == k).any())
        gone += len(scene.spheres) - len(kept)
        there = brute_force.image(structs.replace(scene, spheres=kept), 24, 24)
        if kept or scene.channels == structs.replace(scene, spheres=kept).channels:
            np.testing.assert_array_equal(here.value, np.broadcast_to(there.value, here.value.shape))
    assert gone > 50


def test_shadows_only_take_light_away_and_bounces_only_add() -> None:
    darker = brighter = 0
    for seed in range(80):
        scene = random_scene(seed)
        shadowed, open_ = (traced(structs.replace(scene, shadows=on), 60, seed).value for on in (True, False))
        assert (shadowed <= open_).all()
        darker += bool((shadowed < open_).any())
        levels = [traced(structs.replace(scene, max_bounces=n), 60, seed) for n in range(4)]
        assert not levels[0].reflected.any()
        for fewer, more in itertools.pairwise(levels):
            assert (fewer.value <= more.value).all()
        brighter += bool((levels[0].value < levels[3].value).any())
    assert darker > 30
    assert brighter > 15


@settings(max_examples=40)
@given(scene=ordinary_scenes(), seed=st.integers(0, 99))
def test_one_sphere_and_one_light_are_the_per_pixel_loop_s(scene: Scene, seed: int) -> None:
    material = structs.replace(scene.spheres[0].material, shininess=max(1.0, scene.spheres[0].material.shininess))
    scene = structs.replace(scene, spheres=(structs.replace(scene.spheres[0], material=material),))
    try:
        x, y = scene_points(scene, 30, seed)
    except ValueError:
        return  # nothing to frame
    seen = brute_force.trace(scene, x, y)
    sure = seen.doubt > 1e-5  # the loop's formulas lose half of the digits near the silhouette
    np.testing.assert_allclose(seen.value[sure], evaluate_per_pixel(scene, x, y)[sure], rtol=0.0, atol=1e-9)


# --------------------------------------------------------------------------------------------- margins and accuracy


def test_either_side_of_a_jump_of_the_image_is_in_doubt() -> None:
    jumps = 0
    for seed in range(24):
        scene = random_scene(seed)
        a, b = scene_points(scene, 60, seed), scene_points(scene, 60, seed + 1000)
        at_a, at_b = brute_force.trace(scene, *a).value, brute_force.trace(scene, *b).value
        for _ in range(50):  # halve each pair of points on the side where the value changes more
            m = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])
            seen = brute_force.trace(scene, *m)
            first = over_channels(at_a - seen.value, seen.index) >= over_channels(seen.value - at_b, seen.index)
            a, b = (
                (np.where(side, end[0], m[0]), np.where(side, end[1], m[1])) for side, end in ((first, a), (~first, b))
            )
            wide = first.reshape(-1, *(1,) * (at_a.ndim - 1))
            at_a, at_b = np.where(wide, at_a, seen.value), np.where(wide, seen.value, at_b)
        jump = over_channels(at_a - at_b, seen.index) > 1e-4
        doubt = np.minimum(*(brute_force.trace(scene, *end).doubt for end in (a, b)))
        jumps += int(jump.sum())
        assert (doubt[jump] < 1e-11).all(), (seed, doubt[jump].max())
    assert jumps > 600


def test_few_points_are_in_doubt() -> None:
    doubtful = [np.count_nonzero(traced(random_scene(seed), 60, seed).doubt <= SURE) for seed in range(100)]
    assert sum(doubtful) < 0.002 * 60 * 100


def test_a_small_sphere_a_million_radii_away_keeps_its_digits() -> None:
    spheres = (Sphere((0.3e6, -0.4e6, -1e6), 1.0), Sphere((0.3e6 + 1.5, -0.4e6 + 0.25, -1e6 + 2.0), 0.5))
    scene = Scene(
        Camera((0.0, 0.0, 3.0), half_height=1.5), spheres, (PointLight((0.3e6 + 5.0, -0.4e6 + 6.0, -1e6 + 9.0)),)
    )
    random = np.random.default_rng(0)
    x, y = ((0.3 + random.uniform(-2e-6, 2e-6, 60)) * 3.0, (-0.4 + random.uniform(-2e-6, 2e-6, 60)) * 3.0)
    seen, truth = brute_force.trace(scene, x, y), oracle.evaluate(scene, x, y)
    assert set(seen.index.tolist()) == {-1, 0, 1}
    assert (seen.doubt > SURE).all()
    np.testing.assert_array_equal(seen.index, truth.index)
    np.testing.assert_allclose(seen.value, truth.value, rtol=0.0, atol=1e-13)


def test_what_is_seen_lies_on_its_surface_at_its_depth() -> None:
    for seed in range(40):
        scene = random_scene(seed).in_camera_frame()
        x, y = scene_points(scene, 60, seed)
        seen = brute_force.trace(scene, x, y)
        e = scene.camera.eye[2]
        ray = np.stack([x, y, np.full(x.shape, -e)], axis=-1)
        ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
        assert (np.sum(ray * seen.normal, axis=-1)[seen.index >= 0] <= 1e-12).all()
        for k, sphere in enumerate(scene.spheres):
            on = seen.index == k
            point = np.array([0.0, 0.0, e]) + seen.depth[on, np.newaxis] * ray[on]
            wanted = sphere.center + sphere.radius * seen.normal[on]
            size = float(np.abs(sphere.center).max()) + e + sphere.radius
            np.testing.assert_allclose(point, wanted, rtol=0.0, atol=1e-9 * size)
        if scene.plane is not None:
            on = seen.index == len(scene.spheres)
            point = np.array([0.0, 0.0, e]) + seen.depth[on, np.newaxis] * ray[on]
            away = (point - scene.plane.point) @ scene.plane.normal / np.linalg.norm(scene.plane.normal)
            np.testing.assert_allclose(away, 0.0, atol=1e-12 * (1.0 + np.abs(point).max(initial=0.0)))


# ---------------------------------------------------------------------------------------------------- known pictures


def one(scene: Scene, x: float = 0.0, y: float = 0.0) -> float:
    return float(brute_force.trace(scene, x, y).value)


def test_the_image_is_seen_on_the_pixel_centres_and_holds_its_rows_from_the_top() -> None:
    scene = Scene(CAMERA, (Sphere((0.0, 1.0, 0.0), 0.8, FLAT), Sphere((-1.5, -1.0, 0.0), 0.8, FLAT)), ())
    seen = brute_force.image(scene, 6, 4)
    step = 2.0 * 2.0 / 4
    x, y = (np.arange(6) - 2.5) * step, (1.5 - np.arange(4)) * step
    np.testing.assert_array_equal(seen.index, brute_force.trace(scene, x[np.newaxis, :], y[:, np.newaxis]).index)
    assert seen.value.shape == seen.depth.shape == seen.doubt.shape == (4, 6)
    assert seen.normal.shape == (4, 6, 3)
    assert seen.diffuse.shape == (0, 4, 6)
    assert (seen.index == 0).nonzero()[0].max() < 2 <= (seen.index == 1).nonzero()[0].min()
    assert (seen.index == 1).nonzero()[1].max() < 3


def test_the_nearer_of_two_spheres_is_seen_and_the_first_of_two_equal_ones() -> None:
    near, far = Sphere((0.0, 0.0, 1.0), 0.5, Phong(0.5)), Sphere((0.0, 0.0, -1.0), 1.0, FLAT)
    for spheres, wanted in (((near, far), 0), ((far, near), 1), ((far, far), 0), ((far, near, near), 1)):
        assert int(brute_force.trace(Scene(CAMERA, spheres), 0.0, 0.0).index) == wanted
    behind = Sphere((0.0, 0.0, 8.0), 1.0)
    assert int(brute_force.trace(Scene(CAMERA, (behind,)), 0.0, 0.0).index) == -1


def test_a_sphere_between_a_point_and_its_light_makes_it_dark_and_one_beyond_the_light_does_not() -> None:
    surface = Sphere(material=Phong(0.125, 0.5, 0.0))
    for z, lit in ((2.5, False), (6.0, True), (3.9, False), (-3.0, True)):
        for light in (PointLight((0.0, 3.0, 3.4)), DirectionalLight((0.0, -3.0, -2.4))):
            way = np.array((0.0, 3.0, 2.4)) / math.hypot(3.0, 2.4)
            center = tuple(np.array((0.0, 0.0, 1.0)) + way * (z - 1.0))
            scene = Scene(CAMERA, (surface, Sphere(center, 0.3)), (light,))
            visible = lit if isinstance(light, PointLight) else z < 0.0
            value = one(scene)
            assert (value > 0.125) is visible, (z, light)
            assert one(structs.replace(scene, shadows=False)) > 0.125


def test_a_light_inside_a_sphere_lights_nothing_outside_and_not_that_sphere() -> None:
    surface, globe = Sphere(material=Phong(0.125, 0.5, 0.0)), Sphere((1.0, 1.5, 2.0), 0.5, Phong(0.125, 0.5, 0.0))
    light = PointLight((1.0, 1.5, 2.1))
    x, y = np.linspace(-2.0, 2.0, 21), np.linspace(-2.0, 2.0, 21)[:, np.newaxis]
    seen = brute_force.trace(Scene(CAMERA, (surface, globe), (light,)), x, y)
    assert set(seen.index.ravel().tolist()) == {-1, 0, 1}
    assert (seen.value[seen.index >= 0] == 0.125).all()
    alone = brute_force.trace(Scene(CAMERA, (surface,), (light,)), x, y)
    assert alone.value.max() > 0.5


def test_a_plane_hides_what_is_beneath_it_and_parts_spheres_from_lights_below() -> None:
    floor = Plane((0.0, -1.0, 0.0), (0.0, 3.0, 0.0), FLAT)
    ball = Sphere((0.0, 0.0, 0.0), 0.5, Phong(0.125, 0.5, 0.0))
    below = Sphere((0.0, -2.0, 0.0), 0.5, FLAT)
    scene = Scene(CAMERA, (below, ball), (PointLight((0.0, -1.5, 3.0)),), 0.0, floor)
    assert one(scene) == 0.125
    assert one(structs.replace(scene, plane=None)) > 0.125
    assert one(structs.replace(scene, lights=(DirectionalLight((0.0, 1.0, -2.0)),))) == 0.125
    seen = brute_force.image(scene, 32, 32)
    assert set(seen.index.ravel().tolist()) == {-1, 1, 2}
    np.testing.assert_array_equal(seen.normal[seen.index == 2][0], (0.0, 1.0, 0.0))
    ceiling = structs.replace(scene, plane=structs.replace(floor, point=(0.0, 1.0, 0.0)))
    np.testing.assert_array_equal(brute_force.image(ceiling, 9, 9).normal[0, 0], (0.0, -1.0, 0.0))


def test_tiles_are_counted_from_the_point_of_the_plane_along_axis_and_across() -> None:
    floor = Plane((0.25, -1.0, 0.5), (0.0, -1.0, 0.0), Phong(0.25), Phong(0.75), 0.5, (0.0, 5.0, 1.0))
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (), (), 0.0, floor)
    x, y = np.linspace(-0.93, 0.91, 40), np.linspace(-0.953, -0.057, 30)[:, np.newaxis]
    seen = brute_force.trace(scene, x, y)
    t = -1.0 / y  # the ray is at height -1
    point_x, point_z = x * t, 4.0 - 4.0 * t
    u, v = point_z - 0.5, -(point_x - 0.25)  # u = (0, 0, 1), v = (0, -1, 0) x u = (-1, 0, 0)
    odd = (np.floor(u / 0.5) + np.floor(v / 0.5)) % 2 != 0
    sure = seen.doubt > SURE
    assert sure.mean() > 0.99
    np.testing.assert_array_equal(seen.value[sure], np.where(odd, 0.75, 0.25)[sure])


def test_a_gradient_is_its_bottom_top_and_middle_where_the_ray_says_so() -> None:
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (), (), Gradient((0.0, 0.5, 1.0), 1.0, (0.0, 2.0, 0.0)))
    seen = brute_force.trace(scene, [0.0, 0.0, 0.0, 3.0], [0.0, 4.0, -1e12, 0.0])
    np.testing.assert_allclose(seen.value[0], (0.5, 0.75, 1.0), rtol=1e-15)
    share = 0.5 * (1.0 + math.sqrt(0.5))
    np.testing.assert_allclose(seen.value[1], (share, 0.5 + 0.5 * share, 1.0), rtol=1e-15)
    np.testing.assert_allclose(seen.value[2], (0.0, 0.5, 1.0), atol=1e-11)
    np.testing.assert_allclose(seen.value[3], seen.value[0], rtol=1e-15)


def test_a_point_light_falls_off_with_its_distance_in_scene_units() -> None:
    ball = Sphere(material=Phong(0.0, 1.0, 0.0))
    for attenuation, wanted in (((0.0, 0.0, 1.0), 1 / 25), ((0.0, 2.0, 0.0), 1 / 10), ((1.0, 1.0, 1.0), 1 / 31)):
        scene = Scene(CAMERA, (ball,), (PointLight((0.0, 0.0, 6.0), 1.0, attenuation),))
        assert one(scene) == pytest.approx(wanted, rel=1e-15)


def test_a_mirror_shows_what_stands_before_it_as_often_as_bounces_are_left() -> None:
    mirror, wall = Sphere(material=Phong(0.0, 0.0, 0.0, reflect=0.5)), Plane((0.0, 0.0, 9.0), (0.0, 0.0, 1.0), FLAT)
    scene = Scene(CAMERA, (mirror,), (), 1.0, wall, max_bounces=1)
    assert one(scene) == 0.5 * 0.25
    assert one(structs.replace(scene, max_bounces=0)) == 0.0
    both = structs.replace(
        scene, plane=structs.replace(wall, material=Phong(0.25, 0.0, 0.0, reflect=0.5)), max_bounces=16
    )
    for bounces, wanted in ((1, 0.125), (2, 0.125), (3, 0.15625)):
        assert one(structs.replace(both, max_bounces=bounces)) == wanted
    assert one(both) == pytest.approx(0.125 / (1.0 - 0.25), rel=1e-4)
    assert one(structs.replace(scene, plane=None)) == 0.5


def test_colours_multiply_channel_by_channel_and_equal_channels_are_grey() -> None:
    red = Sphere(material=Phong((0.5, 0.0, 0.25), (1.0, 0.5, 0.0), 0.0))
    scene = Scene(CAMERA, (red,), (PointLight((0.0, 0.0, 9.0), (0.5, 1.0, 2.0)),))
    np.testing.assert_array_equal(brute_force.trace(scene, 0.0, 0.0).value, (1.0, 0.5, 0.25))
    for seed in range(10):
        grey = random_scene(seed)
        if grey.channels == 1 and not isinstance(grey.background, Gradient):
            shade = (grey.background,) * 3
            seen = traced(structs.replace(grey, background=shade), 30, seed)
            np.testing.assert_array_equal(seen.value, np.repeat(traced(grey, 30, seed).value[:, np.newaxis], 3, axis=1))


def test_a_light_exactly_at_the_point_adds_nothing() -> None:
    scene = Scene(
        CAMERA, (Sphere(material=Phong(0.125, 0.5, 0.5)),), (PointLight((0.0, 0.0, 1.0), 1.0, (0.0, 0.0, 1.0)),)
    )
    seen = brute_force.trace(scene, 0.0, 0.0)
    assert float(seen.value) == 0.125
    assert float(seen.doubt) == 0.0


def test_sizes_and_points_that_are_none_are_refused() -> None:
    with pytest.raises(ArgumentError, match="width: 0; expected a whole number of pixels, at least 1"):
        brute_force.image(Scene(), 0, 4)
    with pytest.raises(ArgumentError, match=r"height: 2\.5"):
        brute_force.image(Scene(), 4, 2.5)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="x: holds NaN or infinity"):
        brute_force.trace(Scene(), math.nan, 0.0)
    assert brute_force.trace(Scene(), [], []).value.shape == (0,)


def test_points_are_the_same_in_whatever_pieces_they_are_held(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(12):
        scene = random_scene(seed)
        whole = traced(scene, 50, seed)
        monkeypatch.setattr(brute_force, "PIECE", 7 * (1 + len(scene.spheres)))
        pieces = traced(scene, 50, seed)
        monkeypatch.undo()
        np.testing.assert_array_equal(whole.index, pieces.index)
        np.testing.assert_array_equal(whole.normal, pieces.normal)
        np.testing.assert_allclose(whole.value, pieces.value, rtol=1e-14)


def test_seeded_scenes_are_a_function_of_their_seed_and_of_every_kind() -> None:
    drawn = [random_scene(seed) for seed in range(400)]
    assert drawn[:40] == [random_scene(seed) for seed in range(40)]
    lights = [light for scene in drawn for light in scene.lights]
    materials = [sphere.material for scene in drawn for sphere in scene.spheres]
    counts = {
        "no sphere": sum(not scene.spheres for scene in drawn),
        "nine spheres": sum(len(scene.spheres) >= 9 for scene in drawn),
        "no light": sum(not scene.lights for scene in drawn),
        "directions": sum(isinstance(light, DirectionalLight) for light in lights),
        "attenuated": sum(isinstance(li, PointLight) and li.attenuation != (1.0, 0.0, 0.0) for li in lights),
        "inside": sum(
            any(math.dist(li.position, s.center) < s.radius for s in scene.spheres)
            for scene in drawn
            for li in scene.lights
            if isinstance(li, PointLight)
        ),
        "coloured": sum(scene.channels == 3 for scene in drawn),
        "grey": sum(scene.channels == 1 for scene in drawn),
        "plain": sum(scene.plane is not None and scene.plane.checker is None for scene in drawn),
        "checkered": sum(scene.plane is not None and scene.plane.checker is not None for scene in drawn),
        "mirrors": sum(material.reflect > 0.0 for material in materials),
        "gated": sum(material.gate_specular for material in materials),
        "ungated": sum(not material.gate_specular for material in materials),
        "gradient": sum(isinstance(scene.background, Gradient) for scene in drawn),
        "turned": sum(scene.camera.look_at != (0.0, 0.0, 0.0) for scene in drawn),
        "framed": sum(scene.camera.half_height is None for scene in drawn),
        "without shadows": sum(not scene.shadows for scene in drawn),
        "doubles": sum(len({(s.center, s.radius) for s in scene.spheres}) < len(scene.spheres) for scene in drawn),
        "behind": sum(
            any(s.center[2] >= scene.camera.eye[2] + s.radius for s in scene.in_camera_frame().spheres)
            for scene in drawn
        ),
    }
    assert min(counts.values()) >= 8, counts
