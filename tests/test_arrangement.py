"""Laws of the arrangement: what it leaves out changes no pixel, it is exact where it says so, and it is the same scene
however it is written.

The main law draws scenes from their arrangements alone (`arranged.draw`) and compares with brute force, which has none.
"""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from arranged import draw
from evaluators import THOROUGH
from msgspec import structs
from scene_strategies import random_scene, scaled, scene_points

from symrender_cg.plan.arrangement import Arrangement, arrange
from symrender_cg.plan.nearby import near_pairs
from symrender_cg.plan.order import front_to_back
from symrender_cg.reference import brute_force
from symrender_cg.scene import (
    Camera,
    DirectionalLight,
    Gradient,
    Phong,
    Plane,
    PointLight,
    Scene,
    Sphere,
)
from symrender_cg.scene.random import random_spheres

SEEDS = range(6000 if THOROUGH else 240)
FORCES = (
    "behind_eye",
    "in_view",
    "hidden",
    "order",
    "front_test",
    "plane",
    "checker",
    "lights",
    "diffuse",
    "specular",
    "shadow",
    "mirror",
    "mirror_depth",
)
MATTE = Phong(0.1, 0.7, 0.0)
GATED = Phong(gate_specular=True)
CAMERA = Camera((0.0, 0.0, 4.0), half_height=2.0)


def differences(frame: Scene, found: Arrangement, aspect: float | None, seed: int) -> tuple[float, int, int]:
    """(largest difference of a value from brute force, points with another surface, points compared)."""
    x, y = scene_points(frame, 120, seed)
    half_height = frame.camera.half_height
    assert half_height is not None
    if aspect is not None:
        x = x * aspect
        inside = (np.abs(x) < half_height * aspect) & (np.abs(y) < half_height)
        x, y = x[inside], y[inside]
    true, drawn = brute_force.trace(frame, x, y), draw(frame, found, x, y)
    sure = (true.doubt > 1e-9) & (true.condition < 1e6)
    value = np.atleast_2d(true.value if true.value.ndim == 1 else true.value.T)
    error = np.abs(value - drawn.value).max(axis=0, initial=0.0)
    return float(error[sure].max(initial=0.0)), int((true.index != drawn.index)[sure].sum()), int(sure.sum())


@pytest.mark.parametrize("aspect", [None, 1.0, 2.0])
def test_a_scene_drawn_from_its_arrangement_is_the_scene(aspect: float | None) -> None:
    """Measured over 8,000 scenes: 2e-12, the rounding of the two ways to shade."""
    compared = 0
    for seed in SEEDS:
        frame = random_scene(seed).in_camera_frame()
        error, wrong, points = differences(frame, arrange(frame, aspect=aspect), aspect, seed)
        assert (error < 1e-9, wrong) == (True, 0), seed
        compared += points
    assert compared > 50 * len(SEEDS)


@pytest.mark.parametrize("name", FORCES)
def test_an_effect_forced_in_changes_no_pixel(name: str) -> None:
    for seed in SEEDS[:40]:
        frame = random_scene(seed).in_camera_frame()
        error, wrong, _ = differences(frame, arrange(frame, aspect=1.0, force=frozenset({name})), 1.0, seed)
        assert (error < 1e-9, wrong) == (True, 0), seed


def totals(found: Arrangement) -> dict[str, int]:
    """How much each effect leaves in."""
    return {
        "behind_eye": found.visible,
        "in_view": found.visible,
        "hidden": found.visible,
        "order": len(found.partners),
        "front_test": int(found.at_eye.sum()),
        "plane": int(found.plane_seen),
        "checker": len(found.plane_materials),
        "lights": len(found.lamp_light),
        "diffuse": int(found.lamp_diffuse.sum()),
        "specular": int(found.lamp_specular.sum()),
        "shadow": len(found.blockers),
        "mirror": len(found.mirrors),
        "mirror_depth": found.bounces,
    }


@pytest.mark.parametrize("name", FORCES)
def test_an_effect_forced_in_is_in(name: str) -> None:
    """Never less than without, and more in some scene."""
    mirror = Phong(reflect=0.5)
    level = Plane((0.0, 9.0, 0.0), (0.0, 1.0, -0.6), MATTE, MATTE)
    more, aspect = 0, None if name == "behind_eye" else 1.0
    for frame in (
        *(random_scene(seed).in_camera_frame() for seed in range(100)),
        Scene(CAMERA, (Sphere(material=mirror),), (), 0.5, level),
        Scene(CAMERA, (Sphere(material=mirror),), (), 0.5),
        Scene(CAMERA, (), (), 0.5, level),
    ):
        without = totals(arrange(frame, aspect=aspect))[name]
        forced = totals(arrange(frame, aspect=aspect, force=frozenset({name})))[name]
        assert forced >= without
        more += forced > without
    assert more > 0


def as_sets(frame: Scene, found: Arrangement) -> dict[str, Any]:
    """An arrangement by the surfaces and lights themselves, without an index."""
    spheres = [(s.center, s.radius, repr(s.material)) for s in (frame.spheres[i] for i in found.spheres.tolist())]
    lights = [repr(frame.lights[i]) for i in found.lamp_light.tolist()]
    return {
        "spheres": spheres,
        "visible": found.visible,
        "lamps": (lights, found.lamps_begin.tolist(), found.lamp_diffuse.tolist(), found.lamp_specular.tolist()),
        "blockers": (found.blockers.tolist(), found.blockers_begin.tolist()),
        "mirrors": (found.mirrors.tolist(), found.mirrors_begin.tolist(), found.bounces),
        "partners": (found.partners.tolist(), found.partners_begin.tolist()),
        "at_eye": found.at_eye.tolist(),
        "plane": (found.plane_seen, found.plane_mirrored, repr(found.plane_materials), found.crosses_plane.tolist()),
    }


def test_the_order_in_the_file_does_not_matter() -> None:
    for seed in SEEDS[:80]:
        frame = random_scene(seed).in_camera_frame()
        if len({(s.center, s.radius) for s in frame.spheres}) < len(frame.spheres):
            continue  # of spheres that coincide the first one in the file is seen
        random = np.random.default_rng(seed)
        spheres = tuple(frame.spheres[i] for i in random.permutation(len(frame.spheres)))
        lights = tuple(frame.lights[i] for i in random.permutation(len(frame.lights)))
        shuffled = structs.replace(frame, spheres=spheres, lights=lights)
        assert as_sets(frame, arrange(frame, aspect=1.0)) == as_sets(shuffled, arrange(shuffled, aspect=1.0)), seed


@pytest.mark.parametrize("k", [-300, -7, 1, 60, 400])
def test_the_unit_of_length_does_not_matter(k: int) -> None:
    for seed in SEEDS[:40]:
        frame = random_scene(seed).in_camera_frame()
        other = scaled(frame, k).in_camera_frame()
        ours, theirs = arrange(frame, aspect=1.0), arrange(other, aspect=1.0)
        for name in Arrangement.__dataclass_fields__:
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), (seed, name)


def test_arrays_are_consistent_with_each_other() -> None:
    for seed in SEEDS[:80]:
        frame = random_scene(seed).in_camera_frame()
        found = arrange(frame, aspect=1.0)
        size, receivers = len(found.spheres), found.receivers
        assert receivers == size + len(found.plane_materials) == len(found.mirrored) == len(found.mirror)
        assert len(set(found.spheres.tolist())) == size
        groups = (
            ("partners", found.visible, size),
            ("lamps", receivers, None),
            ("blockers", len(found.lamp_light), size),
            ("mirrors", receivers, size),
        )
        for name, count, limit in groups:
            begin = getattr(found, f"{name}_begin")
            assert begin.dtype == np.int32
            assert len(begin) == count + 1
            assert begin[0] == 0
            assert (np.diff(begin) >= 0).all()
            if limit is None:
                continue
            members = getattr(found, name)
            assert begin[-1] == len(members)
            assert members.dtype == np.int32
            assert ((members >= 0) & (members < limit)).all()
            for a, b in itertools.pairwise(begin):
                assert (np.diff(members[a:b]) > 0).all()
        assert (found.lamp_diffuse | found.lamp_specular).all()
        assert not (found.lamp_gated & ~found.lamp_specular).any()
        used = set(found.blockers.tolist()) | set(np.flatnonzero(found.mirrored[:size]).tolist())
        assert set(range(found.visible, size)) <= used


# ------------------------------------------------------------------------------------------------------------- order


def test_spheres_are_front_to_back_by_the_exact_power_of_the_eye() -> None:
    """Also where float64 cannot tell: centres that differ in the last place, radii that make up for it."""
    random = np.random.default_rng(7)
    for _ in range(60):
        e = float(random.uniform(1e3, 1e6))
        spheres = []
        for _ in range(30):
            radius = float(random.choice([1.0, 1.0 + 2.0**-52, 1.0 - 2.0**-53, 2.0]))
            spheres.append(Sphere((float(random.normal() * 1e-9), 0.0, float(random.choice([0.0, 2.0**-60]))), radius))
        distance = np.array([np.hypot(s.center[0], e - s.center[2]) for s in spheres])
        radii = np.array([s.radius for s in spheres])
        order = front_to_back(spheres, np.arange(30), (0.0, 0.0, e), distance, radii)

        def power(index: int, spheres: list[Sphere] = spheres, e: float = e) -> tuple[Fraction, Any, float, int]:
            sphere = spheres[index]
            x, y, z = (Fraction(v) for v in sphere.center)
            square = x * x + y * y + (z - Fraction(e)) ** 2 - Fraction(sphere.radius) ** 2
            return square, sphere.center, sphere.radius, index

        assert order.tolist() == sorted(range(30), key=power)


def test_the_order_is_that_of_powers_and_not_of_distances() -> None:
    """The centre of the large sphere is farther, yet its power is the smaller one: 40 against 42.4."""
    large, small = Sphere((0.0, 0.0, -3.0), 3.0), Sphere((5.0, 0.0, -0.2), 0.5)
    frame = Scene(CAMERA, (small, large), ())
    assert arrange(frame, aspect=None).spheres.tolist() == [1, 0]


def test_spheres_that_touch_are_compared_in_depth() -> None:
    """Tangency counts as needed; apart by more than the margin it is not."""
    for gap, partners in ((0.0, 1), (2.0**-50, 1), (-0.5, 1), (1e-9, 0)):
        frame = Scene(CAMERA, (Sphere((-1.0, 0.0, 0.0), 1.0), Sphere((1.0 + gap, 0.0, 0.0), 1.0)), ())
        assert len(arrange(frame, aspect=None).partners) == partners, gap


# -------------------------------------------------------------------------------------------------------- visibility


def visible(frame: Scene, aspect: float | None = 1.0) -> set[int]:
    found = arrange(frame, aspect=aspect)
    return set(found.spheres[: found.visible].tolist())


@pytest.mark.parametrize(("z", "seen"), [(5.0, False), (np.nextafter(5.0, 0.0), True), (4.0, True), (6.0, False)])
def test_a_sphere_wholly_behind_the_eye_is_not_seen(z: float, seen: bool) -> None:
    """At z = 5 the sphere touches the plane of the eye from behind."""
    assert bool(visible(Scene(CAMERA, (Sphere((2.0, 0.0, float(z)), 1.0),), ()), None)) is seen


@pytest.mark.parametrize(("x", "seen"), [(3.0, True), (3.1180339887498, True), (3.118033988751, False), (3.2, False)])
def test_a_sphere_wholly_outside_the_window_is_not_seen(x: float, seen: bool) -> None:
    """n.m = -R at x = 2 + sqrt(5) / 2: the side of the window leans by atan(1 / 2)."""
    frame = Scene(CAMERA, (Sphere((x, 0.0, 0.0), 1.0),), ())
    assert bool(visible(frame)) is seen
    assert visible(frame, None) == {0}
    assert bool(visible(frame, 0.5)) is False
    assert bool(visible(frame, 3.0)) is True


@pytest.mark.parametrize(("radius", "seen"), [(0.25, False), (0.4375, False), (0.5, True), (0.6, True)])
def test_a_sphere_in_the_cone_of_one_in_front_is_not_seen(radius: float, seen: bool) -> None:
    """Cones with one axis: sin(alpha) = 1/4 against R / 2, equal at 1/2, which is needed."""
    front, behind = Sphere((0.0, 0.0, 3.0), 0.25), Sphere((0.0, 0.0, 2.0), radius)
    assert (1 in visible(Scene(CAMERA, (front, behind), ()))) is seen


def test_a_hidden_sphere_still_casts_its_shadow_and_is_mirrored() -> None:
    hider, sphere = Sphere((0.0, 0.0, 2.0), 0.5, GATED), Sphere((0.0, 0.0, 0.0), 0.5, GATED)
    ground = Sphere((0.0, -101.0, 0.0), 100.0, structs.replace(GATED, reflect=0.5))
    frame = Scene(CAMERA, (hider, sphere, ground), (PointLight((0.0, 5.0, 0.0)),))
    found = arrange(frame, aspect=1.0)
    assert found.spheres[found.visible :].tolist() == [1]
    receiver = found.spheres.tolist().index(2)
    assert 2 in found.blockers[found.blockers_begin[found.lamps_begin[receiver]] :].tolist()
    assert 2 in found.mirrors[found.mirrors_begin[receiver] : found.mirrors_begin[receiver + 1]].tolist()
    assert found.mirrored[2]


def test_what_is_beyond_the_plane_is_not_seen_and_lights_there_are_dark() -> None:
    floor = Plane((0.0, -1.0, 0.0), (0.0, -3.0, 0.0), GATED)
    spheres = (Sphere((0.0, 0.5, 0.0), 1.0, MATTE), Sphere((0.0, -2.5, 0.0), 1.0), Sphere((1.5, -1.5, 0.0), 1.0, MATTE))
    lights = (PointLight((0.0, -3.0, 3.0)), DirectionalLight((0.0, 1.0, 0.0)), PointLight((0.0, 3.0, 3.0)))
    found = arrange(Scene(CAMERA, spheres, lights, 0.0, floor), aspect=None)
    assert set(found.spheres[: found.visible].tolist()) == {0, 2}
    assert set(found.lamp_light.tolist()) == {2}
    assert found.crosses_plane[found.spheres.tolist().index(2)]
    assert not found.crosses_plane[found.spheres.tolist().index(0)]


@pytest.mark.parametrize(("normal", "aspect", "seen"), [
    ((0.0, 1.0, 0.0), 1.0, True),
    ((0.0, 1.0, -0.6), 1.0, False),
    ((0.0, 1.0, -0.6), None, True),
    ((0.0, 1.0, -0.5), 1.0, True),
    ((0.0, 0.0, 1.0), None, True),
    ((0.0, 0.0, -1.0), None, False),
])  # fmt: skip
def test_the_plane_is_seen_where_a_ray_of_the_window_falls_towards_it(
    normal: tuple[float, float, float], aspect: float | None, seen: bool
) -> None:
    """n.D at the lower corners is -n_y / 2 - n_z: zero at n_z = -1/2, where the horizon touches the window."""
    eye = np.array((0.0, 0.0, 4.0))
    x, y, z = (float(v) for v in eye - np.array(normal))
    frame = Scene(CAMERA, (), (), 0.0, Plane((x, y, z), normal))
    assert arrange(frame, aspect=aspect).plane_seen is seen


def test_one_tile_is_one_material() -> None:
    def materials(tile: float, point: float, aspect: float | None = 1.0, reflect: float = 0.0) -> tuple[Phong, ...]:
        wall = Plane((point, -30.0, 0.0), (0.0, 0.0, 1.0), MATTE, GATED, tile)
        sphere = Sphere((0.0, 0.0, 1.0), 0.25, Phong(reflect=reflect))
        return arrange(Scene(CAMERA, (sphere,), (), 0.0, wall), aspect=aspect).plane_materials

    assert materials(100.0, -30.0) == (MATTE,)
    assert materials(100.0, 30.0) == (GATED,)
    assert materials(100.0, -30.0, None) == (MATTE, GATED)
    assert materials(100.0, -2.0) == (MATTE, GATED)
    assert materials(100.0, -30.0, reflect=0.5) == (MATTE, GATED)
    assert materials(1.0, -30.0) == (MATTE, GATED)


# ----------------------------------------------------------------------------------------------------------- mirrors


def bounces(spheres: tuple[Sphere, ...], background: float | Gradient = 0.25, limit: int = 4, **more: Any) -> int:
    return arrange(Scene(CAMERA, spheres, (), background, max_bounces=limit, **more), aspect=1.0).bounces


def test_the_depth_of_mirrors_is_that_of_the_longest_chain() -> None:
    mirror = Phong(reflect=0.5)
    one, two = Sphere((-1.0, 0.0, 0.0), 0.5, mirror), Sphere((1.0, 0.0, 0.0), 0.5, mirror)
    plain = Sphere((0.0, 1.0, 0.0), 0.25, MATTE)
    assert bounces((plain,)) == 0
    assert bounces((one, plain)) == 1
    assert bounces((one,)) == 1
    assert bounces((one,), 0.0) == 0
    assert bounces((one,), Gradient(0.0, 0.0)) == 0
    assert bounces((one,), Gradient(0.0, 0.5)) == 1
    assert bounces((one, two, plain)) == 4
    assert bounces((one, two, plain), limit=1) == 1
    assert bounces((one, two, plain), limit=0) == 0
    floor = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), mirror)
    assert bounces((plain,), plane=floor) == 1
    assert bounces((one,), plane=floor) == 4
    assert bounces((), plane=floor) == 1
    behind_it = Sphere((-2.0, 0.0, -6.0), 0.5, mirror)
    assert bounces((one, Sphere((-1.0, 0.0, -3.0), 0.25, mirror), behind_it)) == 4


def test_a_sphere_under_every_visible_tangent_plane_is_not_mirrored() -> None:
    mirror = Sphere((0.0, 0.0, 0.0), 1.0, Phong(reflect=0.5))
    for x, z, seen in ((0.0, 3.0, True), (3.0, 0.0, True), (0.6, -3.0, False), (2.9, -3.0, True)):
        found = arrange(Scene(CAMERA, (mirror, Sphere((x, 0.0, z), 0.25)), ()), aspect=None)
        assert bool(found.mirrors.size) is seen, (x, z)


# --------------------------------------------------------------------------------------------------------- near pairs


@pytest.mark.parametrize("spread", [0.0, 3.0, 40.0])
def test_near_pairs_are_all_pairs_that_come_near(spread: float) -> None:
    random = np.random.default_rng(3)
    for count in (0, 1, 2, 40, 300):
        p, q = random.normal(size=(count, 3)), random.normal(size=(2 * count, 3)) * (1.0, 1.0, 0.0)
        r = 0.1 * np.exp2(spread * random.normal(size=count))
        s = 0.1 * np.exp2(spread * random.normal(size=2 * count))
        i, j = near_pairs(p, r, q, s)
        gap = np.sqrt(((p[:, np.newaxis] - q) ** 2).sum(axis=2)).reshape(count, 2 * count)
        reach = r[:, np.newaxis] + s
        found = set(zip(i.tolist(), j.tolist(), strict=True))
        assert len(found) == len(i)
        assert {tuple(pair) for pair in np.argwhere(gap <= reach).tolist()} <= found
        assert found <= {tuple(pair) for pair in np.argwhere(gap <= 1.001 * reach + 1e-6).tolist()}


def test_near_pairs_of_points_far_from_the_origin_and_of_reach_0() -> None:
    p = np.array([[1e9, 1e9, 1e9], [1e9 + 1.0, 1e9, 1e9]])
    i, j = near_pairs(p, np.zeros(2), p, np.zeros(2))
    assert {(0, 0), (1, 1)} <= set(zip(i.tolist(), j.tolist(), strict=True))


def test_lists_of_a_scene_that_fills_the_view_grow_with_its_spheres() -> None:
    """Blockers of a sphere grow like the cube root of the number; all pairs would be 2,000 of each."""
    few, many = (arrange(random_spheres(n, 1).in_camera_frame(), aspect=1.0) for n in (250, 2000))
    per_sphere = [len(found.blockers) / len(found.lamp_light) for found in (few, many)]
    assert per_sphere[1] < 3.0 * per_sphere[0]
    assert len(many.partners) == 0


def test_one_giant_does_not_make_all_pairs_near() -> None:
    """A ground sphere beside small ones: what comes near is looked at, not everything in one cell."""
    random = np.random.default_rng(5)
    p = np.vstack((random.uniform(-1.0, 1.0, (2000, 3)), [[0.0, -1e9, 0.0]]))
    r = np.append(np.full(2000, 0.01), 1e9)
    i, _ = near_pairs(p, r, p, r)
    assert 2000 < len(i) < 20_000


def test_nothing_to_draw_is_an_arrangement_too() -> None:
    found = arrange(Scene(CAMERA, (), ()), aspect=1.0)
    assert (found.visible, len(found.spheres), found.receivers, found.bounces) == (0, 0, 0, 0)
    assert not found.plane_seen
