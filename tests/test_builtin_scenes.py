"""Laws of the built-in scenes: each shows what its first line says, which is decided from its numbers alone."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest

import symrender_cg
from symrender_cg.errors import SceneError
from symrender_cg.scene import DirectionalLight, Gradient, PointLight, Scene, Sphere, Vector, load_scene
from symrender_cg.scene.builtin import builtin_description
from symrender_cg.scene.exact import excess_over_sphere
from symrender_cg.scene.random import random_spheres

ONE_SPHERE = ("chapter1", "close_up", "far", "grazing_light", "off_axis")
MANY = ("eye_plane", "far_small", "hidden", "hundred", "intersecting", "lights", "mirrors", "shadow", "two_spheres")
SCENES = Path(symrender_cg.__file__).parent / "scenes"


def half_angle(seen_from: Vector, sphere: Sphere) -> float:
    return math.asin(sphere.radius / math.dist(seen_from, sphere.center))


def angle(seen_from: Vector, one: Sphere, two: Sphere) -> float:
    """The angle between two centres."""
    a, b = ([c - e for c, e in zip(s.center, seen_from, strict=True)] for s in (one, two))
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.atan2(math.hypot(*cross), sum(p * q for p, q in zip(a, b, strict=True)))


def is_apart(seen_from: Vector, one: Sphere, two: Sphere) -> bool:
    return angle(seen_from, one, two) > half_angle(seen_from, one) + half_angle(seen_from, two)


def is_before(seen_from: Vector, near: Sphere, far: Sphere) -> bool:
    """Whether all of `near` is seen before `far`: its cone is inside the other's, and it ends nearer."""
    inside = angle(seen_from, near, far) + half_angle(seen_from, near) < half_angle(seen_from, far)
    return inside and math.dist(seen_from, near.center) + near.radius < math.dist(seen_from, far.center) - far.radius


def gap(one: Sphere, two: Sphere) -> float:
    return math.dist(one.center, two.center) - one.radius - two.radius


def test_built_in_scenes_are_these() -> None:
    assert Scene.builtin_names() == tuple(sorted((*ONE_SPHERE, *MANY)))


@pytest.mark.parametrize("name", Scene.builtin_names())
def test_built_in_scene_has_an_image_and_opens_with_one_line_that_says_what_it_shows(name: str) -> None:
    scene = Scene.builtin(name)
    assert scene.in_camera_frame().camera.half_height is not None
    assert scene.lights
    assert load_scene(name) == scene
    first, second = (SCENES / f"{name}.toml").read_text(encoding="utf-8").splitlines()[:2]
    assert builtin_description(name) == first.removeprefix("# ")
    assert len(first) > 40
    assert first.endswith(".")
    assert second == ""


@pytest.mark.parametrize("name", MANY)
def test_highlights_of_scenes_of_several_spheres_are_gated_except_in_chapter_1_s_last_cell(name: str) -> None:
    scene = Scene.builtin(name)
    assert len(scene.spheres) > 1
    assert {sphere.material.gate_specular for sphere in scene.spheres} == {name != "two_spheres"}


def test_scenes_of_one_sphere_are_what_their_names_say() -> None:
    for name in ONE_SPHERE:
        scene = Scene.builtin(name)
        assert (len(scene.spheres), len(scene.lights), scene.channels, scene.plane) == (1, 1, 1, None)
    assert Scene.builtin("chapter1") == Scene.chapter1()
    close, far, grazing, off_axis = map(Scene.builtin, ("close_up", "far", "grazing_light", "off_axis"))
    assert 1.0 < close.camera.eye[2] / close.spheres[0].radius < 1.01
    assert far.camera.eye[2] / far.spheres[0].radius == 1e4
    light = grazing.lights[0]
    assert isinstance(light, PointLight)
    assert light.position[2] < 0.0 < grazing.camera.eye[2]
    center = off_axis.in_camera_frame().spheres[0].center
    assert all(abs(coordinate) > 0.1 for coordinate in center)


def test_the_nearer_of_two_spheres_on_the_view_axis_leaves_a_ring_of_the_other() -> None:
    scene = Scene.builtin("two_spheres")
    far, near = scene.spheres
    assert far == Scene.chapter1().spheres[0]
    assert (scene.lights, scene.camera.eye, scene.shadows) == (Scene.chapter1().lights, (0.0, 0.0, 4.0), False)
    assert near.center[:2] == (0.0, 0.0)
    assert far.center[2] + far.radius < near.center[2] - near.radius
    assert 0.4 < half_angle(scene.camera.eye, near) / half_angle(scene.camera.eye, far) < 0.8


def test_the_small_sphere_of_the_shadow_shadows_the_large_one_and_hides_none_of_it() -> None:
    scene = Scene.builtin("shadow")
    (light,), (receiver, blocker) = scene.lights, scene.spheres
    assert isinstance(light, PointLight)
    assert scene.shadows
    assert is_before(light.position, blocker, receiver)
    assert is_apart(scene.camera.eye, receiver, blocker)


def test_the_intersecting_spheres_intersect_and_neither_holds_the_other() -> None:
    one, two = Scene.builtin("intersecting").spheres
    assert gap(one, two) < 0.0 < math.dist(one.center, two.center) - abs(one.radius - two.radius)


def test_the_mirrors_are_five_colours_on_a_mirroring_checkered_plane_under_two_kinds_of_light() -> None:
    scene = Scene.builtin("mirrors")
    assert scene.channels == 3
    assert len({sphere.material for sphere in scene.spheres}) == 5
    assert {sphere.material.reflect for sphere in scene.spheres} == {0.3}
    assert isinstance(scene.background, Gradient)
    assert [type(light) for light in scene.lights] == [PointLight, DirectionalLight]
    assert scene.plane is not None
    assert scene.plane.checker is not None
    assert scene.plane.checker != scene.plane.material
    for sphere in scene.spheres:
        assert sphere.center[1] - sphere.radius == scene.plane.point[1]
    assert all(gap(one, two) > 0.0 for one, two in itertools.combinations(scene.spheres, 2))


def test_the_hundred_are_the_random_scene_that_the_document_names() -> None:
    assert Scene.builtin("hundred") == random_spheres(100, 1)
    assert Scene.builtin("hundred").shadows


def test_the_far_sphere_is_lost_in_float32_and_looks_as_large_as_the_near_speck() -> None:
    scene = Scene.builtin("far_small")
    far, near = scene.spheres
    e = scene.camera.eye[2]
    assert e / far.radius == 1e6
    assert e * e - far.radius**2 - e * e < 0.0 < 1.0 - (e * e - far.radius**2) / (e * e) < 2.0**-24
    assert 0.25 < half_angle(scene.camera.eye, near) / half_angle(scene.camera.eye, far) < 1.0
    assert is_apart(scene.camera.eye, far, near)
    assert excess_over_sphere(scene.camera.eye, near.center, near.radius) == 1


def test_the_lights_are_three_colours_that_fade_in_three_ways() -> None:
    scene = Scene.builtin("lights")
    lights = [light for light in scene.lights if isinstance(light, PointLight)]
    assert len(lights) == len(scene.lights) == 3
    colours = [light.intensity for light in lights if isinstance(light.intensity, tuple)]
    assert [colour.index(max(colour)) for colour in colours] == [0, 1, 2]
    assert len({light.attenuation for light in lights}) == 3
    assert all(any(light.attenuation[1:]) for light in lights)
    assert {isinstance(sphere.material.diffuse, tuple) for sphere in scene.spheres} == {False, True}


def test_one_sphere_of_the_eye_plane_crosses_it_and_enters_the_window() -> None:
    scene = Scene.builtin("eye_plane")
    e, half_height = scene.camera.eye[2], scene.camera.half_height
    assert half_height is not None
    assert scene.plane is not None
    depths = [(e - sphere.center[2]) / sphere.radius for sphere in scene.spheres]
    assert [abs(depth) < 1.0 for depth in depths] == [False, True, False]
    beside = scene.spheres[1]
    aside = math.atan2(abs(beside.center[0]), e - beside.center[2])
    assert aside - half_angle(scene.camera.eye, beside) < math.atan2(half_height, e) < aside
    assert all(sphere.center[1] - sphere.radius >= scene.plane.point[1] for sphere in scene.spheres)
    with pytest.raises(SceneError, match="reaches the plane through the eye"):
        Scene(spheres=scene.spheres).in_camera_frame()


def test_the_hidden_spheres_are_hidden_each_in_the_way_that_its_comment_says() -> None:
    scene = Scene.builtin("hidden")
    first, partly, cut, wholly, inside, blocker, behind, outside = scene.spheres
    eye, half_height, (light,) = scene.camera.eye, scene.camera.half_height, scene.lights
    assert half_height is not None
    e = eye[2]
    assert not is_apart(eye, first, partly)
    assert angle(eye, first, partly) + half_angle(eye, partly) > half_angle(eye, first)
    assert angle(eye, first, wholly) + half_angle(eye, wholly) < half_angle(eye, first)
    assert gap(first, wholly) > 0.0
    assert math.dist(eye, first.center) < math.dist(eye, wholly.center)
    assert math.dist(first.center, inside.center) + inside.radius < first.radius
    assert all(sphere.center[2] - sphere.radius > e for sphere in (blocker, behind))
    assert isinstance(light, PointLight)
    assert scene.shadows
    assert is_before(light.position, blocker, first)
    assert is_apart(light.position, behind, first)
    edge = math.atan2(half_height, e)
    for sphere, nearest in ((cut, -1.0), (outside, 1.0)):
        aside = math.atan2(abs(sphere.center[0]), e - sphere.center[2])
        flat = math.asin(sphere.radius / math.hypot(sphere.center[0], e - sphere.center[2]))
        assert nearest * (aside - flat - edge) > 0.0
        assert aside + flat > edge


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 8, 13, 200])
@pytest.mark.parametrize("seed", range(3))
def test_random_spheres_are_as_many_as_asked_disjoint_with_a_gap_and_of_the_stated_size(count: int, seed: int) -> None:
    scene = random_spheres(count, seed)
    unit = max(count, 1) ** (-1 / 3)
    assert len(scene.spheres) == count
    assert scene == random_spheres(count, seed)
    assert all(gap(one, two) > 0.019 * unit for one, two in itertools.combinations(scene.spheres, 2))
    assert all(abs(coordinate) <= 1.0 for sphere in scene.spheres for coordinate in sphere.center)
    assert all(sphere.radius <= 0.8001 * unit for sphere in scene.spheres)
    if count > 10:
        assert all(sphere.radius >= 0.3999 * unit for sphere in scene.spheres)
    assert scene.in_camera_frame() is scene
    assert all(sphere.material.gate_specular for sphere in scene.spheres)
    assert (scene.lights, scene.background, scene.shadows) == ((PointLight(),), 0.0, True)
    assert not random_spheres(count, seed, shadows=False).shadows


def test_ten_thousand_random_spheres_keep_their_gap_to_every_other() -> None:
    """Sorted along x, only spheres within one largest diameter can meet."""
    spheres = sorted(random_spheres(10_000, 5).spheres, key=lambda sphere: sphere.center[0])
    reach = 2.01 * max(sphere.radius for sphere in spheres)
    smallest = math.inf
    for index, one in enumerate(spheres):
        for two in itertools.islice(spheres, index + 1, None):
            if two.center[0] - one.center[0] > reach:
                break
            if abs(two.center[1] - one.center[1]) < reach:
                smallest = min(smallest, gap(one, two))
    assert smallest > 0.019 * 10_000 ** (-1 / 3)


def test_random_spheres_of_two_seeds_are_two_scenes_and_any_machine_makes_the_same() -> None:
    assert random_spheres(10, 1) != random_spheres(10, 2)
    assert random_spheres(3, 1).spheres[0].center == FIRST_OF_SEED_1


FIRST_OF_SEED_1 = (-0.731272, 0.694867, 0.527549)


@pytest.mark.parametrize("count", [-1, 1_000_001, 2.0, True, "ten"])
def test_number_of_random_spheres_that_is_not_one_is_refused(count: object) -> None:
    with pytest.raises(SceneError, match="expected a number of spheres, a whole number") as caught:
        random_spheres(count)  # type: ignore[arg-type]
    assert caught.value.place == "count"
