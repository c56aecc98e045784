"""Laws of the camera's frame: exact where it can be, correctly rounded elsewhere, and independent of unit and place."""

from __future__ import annotations

import itertools
import math
import random
import sys

import mpmath
import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scene_strategies import scaled as scaled_with_all_parts
from scene_strategies import scenes
from strategies import centred_scenes, image_points, nasty_scenes, ordinary_scenes, points, scaled

from symrender_cg.errors import SceneError
from symrender_cg.scene import (
    Camera,
    DirectionalLight,
    Gradient,
    Light,
    Plane,
    PointLight,
    Scene,
    Sphere,
    Vector,
)
from symrender_cg.scene.exact import nearest_root
from symrender_cg.scene.framing import MARGIN, framed_half_height
from symrender_cg.scene.random import random_spheres

WORK_BITS = 400


def half_height(scene: Scene) -> float:
    value = scene.in_camera_frame().camera.half_height
    assert value is not None
    return value


def moved_by(scene: Scene, turn: list[list[int]], shift: Vector = (0.0, 0.0, 0.0)) -> Scene:
    """The scene with every point X replaced by turn X + shift, and every direction d by turn d."""

    def direction(v: Vector) -> Vector:
        x, y, z = (sum(entry * v[axis] for axis, entry in enumerate(row)) for row in turn)
        return x, y, z

    def point(v: Vector) -> Vector:
        x, y, z = (a + b for a, b in zip(direction(v), shift, strict=True))
        return x, y, z

    def light(it: Light) -> Light:
        if isinstance(it, DirectionalLight):
            return DirectionalLight(direction(it.direction), it.intensity)
        return PointLight(point(it.position), it.intensity, it.attenuation)

    camera, plane, background = scene.camera, scene.plane, scene.background
    if plane is not None:
        normal, axis = direction(plane.normal), direction(plane.axis)
        plane = Plane(point(plane.point), normal, plane.material, plane.checker, plane.tile, axis)
    if isinstance(background, Gradient):
        background = Gradient(background.bottom, background.top, direction(background.up))
    return Scene(
        Camera(point(camera.eye), point(camera.look_at), direction(camera.up), camera.half_height),
        tuple(Sphere(point(s.center), s.radius, s.material) for s in scene.spheres),
        tuple(map(light, scene.lights)),
        background,
        plane,
        scene.shadows,
        scene.max_bounces,
    )


def position(light: Light) -> Vector:
    assert isinstance(light, PointLight)
    return light.position


def frame_of(camera: Camera) -> list[mpmath.matrix]:
    """right, up and backward of the camera as unit vectors of mpmath, from the textbook's cross products."""
    eye, look_at, up = (mpmath.matrix(v) for v in (camera.eye, camera.look_at, camera.up))
    backward = eye - look_at
    backward /= mpmath.sqrt(sum(v * v for v in backward))
    right = cross(up, backward)
    right /= mpmath.sqrt(sum(v * v for v in right))
    return [right, cross(backward, right), backward]


def cross(a: mpmath.matrix, b: mpmath.matrix) -> mpmath.matrix:
    return mpmath.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


TURNS = [
    [[sign * (column == axis) for column in range(3)] for axis, sign in zip(order, signs, strict=True)]
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1, -1), repeat=3)
    if math.prod(signs) * (1 if order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1) == 1
]


@given(centred_scenes(), st.sampled_from([(0, 1, 0), (0, 1e-300, 0), (0, 2, 5), (0, 0.1, -1e300)]))
def test_scene_already_in_the_frame_keeps_its_numbers(scene: Scene, up: Vector) -> None:
    tilted = Scene(Camera(scene.camera.eye, up=up, half_height=0.1), scene.spheres, scene.lights, scene.background)
    expected = Scene(Camera(scene.camera.eye, half_height=0.1), scene.spheres, scene.lights, scene.background)
    assert tilted.in_camera_frame() == expected
    assert repr(tilted.in_camera_frame()) == repr(expected)


@given(scenes(), st.sampled_from([(0, 1, 0), (0, 0.1, -1e300)]))
def test_scene_with_all_parts_that_is_in_the_frame_keeps_its_numbers(scene: Scene, up: Vector) -> None:
    framed = scene.in_camera_frame()
    camera = framed.camera
    tilted = msgspec.structs.replace(framed, camera=Camera(camera.eye, camera.look_at, up, camera.half_height))
    assert tilted.in_camera_frame() == framed
    assert repr(tilted.in_camera_frame()) == repr(framed)


@given(scenes())
def test_what_is_no_length_and_no_direction_is_kept(scene: Scene) -> None:
    moved = scene.in_camera_frame()
    assert [(s.radius, s.material) for s in moved.spheres] == [(s.radius, s.material) for s in scene.spheres]
    assert [(type(li), li.intensity) for li in moved.lights] == [(type(li), li.intensity) for li in scene.lights]
    for before, after in zip(scene.lights, moved.lights, strict=True):
        if isinstance(before, PointLight) and isinstance(after, PointLight):
            assert after.attenuation == before.attenuation
    assert (moved.shadows, moved.max_bounces, moved.channels) == (scene.shadows, scene.max_bounces, scene.channels)
    if scene.plane is None:
        assert moved.plane is None
    else:
        assert moved.plane is not None
        kept = msgspec.structs.replace(
            moved.plane, point=scene.plane.point, normal=scene.plane.normal, axis=scene.plane.axis
        )
        assert kept == scene.plane
    if isinstance(scene.background, Gradient):
        assert isinstance(moved.background, Gradient)
        assert msgspec.structs.replace(moved.background, up=scene.background.up) == scene.background
    else:
        assert moved.background == scene.background
    assert moved.in_camera_frame() is moved


@given(st.one_of(ordinary_scenes(), nasty_scenes()))
def test_moving_twice_is_moving_once(scene: Scene) -> None:
    once = scene.in_camera_frame()
    assert once.in_camera_frame() is once
    camera = once.camera
    assert camera.eye[:2] == (0.0, 0.0)
    assert camera.eye[2] > 0.0
    assert (camera.look_at, camera.up) == ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert camera.half_height is not None
    assert [s.radius for s in once.spheres] == [s.radius for s in scene.spheres]
    assert [s.material for s in once.spheres] == [s.material for s in scene.spheres]
    assert [li.intensity for li in once.lights] == [li.intensity for li in scene.lights]
    assert once.background == scene.background


@given(ordinary_scenes(), st.integers(-300, 300), st.integers(-300, 300))
def test_every_coordinate_is_the_float_nearest_to_the_true_one(scene: Scene, k: int, light_k: int) -> None:
    light = position(scene.lights[0])
    scene = scaled(scene, k)
    scene = Scene(scene.camera, scene.spheres, (PointLight((light[0] * 2.0**light_k, light[1], light[2])),))
    try:
        moved = scene.in_camera_frame()
    except SceneError as error:
        pytest.fail(str(error))
    with mpmath.workprec(WORK_BITS + 4 * 600):
        axes = frame_of(scene.camera)
        look_at = mpmath.matrix(scene.camera.look_at)
        pairs = [
            (scene.camera.eye, moved.camera.eye),
            (scene.spheres[0].center, moved.spheres[0].center),
            (position(scene.lights[0]), position(moved.lights[0])),
        ]
        for before, after in pairs:
            offset = mpmath.matrix(before) - look_at
            for axis, value in zip(axes, after, strict=True):
                true = sum(a * b for a, b in zip(axis, offset, strict=True))
                size = max(abs(v) for v in offset) * mpmath.mpf(2) ** -WORK_BITS
                assert abs(mpmath.mpf(value) - true) <= mpmath.mpf(math.ulp(value)) / 2 + size


def directions_of(scene: Scene) -> list[Vector]:
    """Every direction of a scene, in one order."""
    found = [light.direction for light in scene.lights if isinstance(light, DirectionalLight)]
    if scene.plane is not None:
        found += [scene.plane.normal, scene.plane.axis]
    return [*found, scene.background.up] if isinstance(scene.background, Gradient) else found


def points_of(scene: Scene) -> list[Vector]:
    """Every point of a scene, in one order."""
    found = [scene.camera.eye, *(sphere.center for sphere in scene.spheres)]
    found += [light.position for light in scene.lights if isinstance(light, PointLight)]
    return found if scene.plane is None else [*found, scene.plane.point]


@given(scenes())
def test_every_coordinate_of_every_part_is_the_float_nearest_to_the_true_one(scene: Scene) -> None:
    moved = scene.in_camera_frame()
    with mpmath.workprec(WORK_BITS):
        axes = frame_of(scene.camera)
        look_at = mpmath.matrix(scene.camera.look_at)
        pairs = [(mpmath.matrix(v) - look_at, w) for v, w in zip(points_of(scene), points_of(moved), strict=True)]
        pairs += [(mpmath.matrix(v), w) for v, w in zip(directions_of(scene), directions_of(moved), strict=True)]
        for before, after in pairs:
            size = max(abs(v) for v in before) * mpmath.mpf(2) ** (20 - WORK_BITS)
            for axis, value in zip(axes, after, strict=True):
                true = sum(a * b for a, b in zip(axis, before, strict=True))
                assert abs(mpmath.mpf(value) - true) <= mpmath.mpf(math.ulp(value)) / 2 + size


@given(scenes(), st.integers(-300, 300))
def test_scaling_all_lengths_of_a_scene_with_all_parts_scales_the_frame_exactly(scene: Scene, k: int) -> None:
    assert scaled_with_all_parts(scene, k).in_camera_frame() == scaled_with_all_parts(scene.in_camera_frame(), k)


@given(scenes(), st.sampled_from(TURNS))
def test_turning_a_scene_with_all_parts_and_its_camera_together_changes_no_bit(
    scene: Scene, turn: list[list[int]]
) -> None:
    assert moved_by(scene, turn).in_camera_frame() == scene.in_camera_frame()


@given(points(9.0).filter(any), st.integers(-900, 900))
def test_length_of_a_direction_changes_only_the_length_of_the_turned_one(v: Vector, k: int) -> None:
    """By the same power of two, to the bit."""
    camera = Camera((1, 2, 9), (0, 0.5, 0), (1, 3, 1), 1)
    short, long = (
        Scene(camera, (), (DirectionalLight(way),), Gradient(up=way)).in_camera_frame()
        for way in (v, times_power_of_two(v, k))
    )
    assert directions_of(long) == [times_power_of_two(way, k) for way in directions_of(short)]


def times_power_of_two(v: Vector, k: int) -> Vector:
    return math.ldexp(v[0], k), math.ldexp(v[1], k), math.ldexp(v[2], k)


@pytest.mark.parametrize("size", [5e-324, 1e-323, 1e-300, 1e300, 1.7976931348623157e308])
def test_direction_at_either_end_of_float64_keeps_its_way(size: float) -> None:
    """(1, 1, 1) and (1, 1, 0) at every size are turned as they are at size 1; the length may change by a power of 2."""
    camera = Camera((3, 2, 9), (0, 0.5, 0), (1, 3, 1), 1)

    def turned(v: Vector) -> Scene:
        floor = Plane((0, -9, 0), v, axis=(0, 0, v[0]))
        return Scene(camera, (), (DirectionalLight(v),), Gradient(up=v), floor).in_camera_frame()

    for entry in (0.0, 1.0):
        ordinary, extreme = turned((1.0, 1.0, entry)), turned((size, size, size * entry))
        for one, two in zip(directions_of(ordinary), directions_of(extreme), strict=True):
            largest = max(map(abs, two))
            assert 0.0 < largest < math.inf
            ratio = largest / max(map(abs, one))
            for a, b in zip(one, two, strict=True):
                assert b / ratio == pytest.approx(a, abs=1e-14)


@pytest.mark.parametrize("eye", [(3.0, 4.0, 0.0), (0.0, 5.0, 12.0), (8.0, 0.0, 15.0), (2.0, 3.0, 6.0)])
def test_eye_that_rounding_puts_on_the_plane_is_refused_in_the_camera_frame(eye: Vector) -> None:
    """e is whole, the plane faces the eye, and its point is nearer to the eye's plane than half an ulp of e."""
    axis = 0 if eye[0] else 1
    for toward in (0.0, math.inf):
        point = [*eye]
        point[axis] = math.nextafter(eye[axis], toward)
        plane = Plane((point[0], point[1], point[2]), eye, axis=(1, 1, 1))
        scene = Scene(Camera(eye, half_height=1, up=(1, 1, 1)), (), plane=plane)
        with pytest.raises(SceneError, match="rounding puts it on the plane") as caught:
            scene.in_camera_frame()
        assert caught.value.place == "camera.eye"
        assert "move it away" in caught.value.problem


def test_axis_that_rounding_makes_parallel_to_the_normal_is_refused_with_its_place() -> None:
    refusals = []
    for x, y, z in itertools.product((0.1, 0.3, 0.7), repeat=3):
        plane = Plane((0, -9, 0), (x, y, z), axis=(math.nextafter(x, 1.0), y, z))
        scene = Scene(Camera((3, 2, 9), (0, 0.5, 0), (1, 3, 1), 1), (), plane=plane)
        try:
            scene.in_camera_frame()
        except SceneError as refusal:
            refusals.append(refusal)
    assert refusals
    for error in refusals:
        assert error.place == "plane.axis"
        assert "rounding makes them parallel" in error.problem


@pytest.mark.parametrize(
    ("scene", "place"),
    [
        (Scene(Camera((4, 4, 4), half_height=1), plane=Plane((-1.7e308,) * 3)), "plane.point"),
        (
            Scene(Camera((4, 4, 4), half_height=1), lights=(DirectionalLight(), PointLight((1.7e308,) * 3))),
            "lights[1].position",
        ),
    ],
)
def test_point_of_any_part_that_leaves_float64_is_refused_with_its_place(scene: Scene, place: str) -> None:
    with pytest.raises(SceneError, match="leaves the range of float64") as caught:
        scene.in_camera_frame()
    assert caught.value.place == place


def test_plane_is_not_framed() -> None:
    assert half_height(Scene(plane=Plane())) == half_height(Scene())
    assert half_height(Scene(Camera((0, 0, 3)), spheres=(), plane=Plane())) == 3.0


def one_by_one(e: float, spheres: tuple[Sphere, ...]) -> float:
    """The largest of the half-heights that frame the spheres one at a time, each twice: Chapter 1's rule is for one."""
    heights = []
    for sphere in spheres:
        try:
            heights.append(framed_half_height(e, (sphere, sphere)))
        except SceneError as error:
            if "no sphere is in front" not in error.problem:
                raise
    return max(heights)


@given(st.integers(0, 10**6), st.integers(-400, 400), st.floats(0.1, 100.0))
def test_many_spheres_are_framed_by_the_one_that_reaches_furthest(seed: int, k: int, depth: float) -> None:
    spheres = random_spheres(30, seed).spheres
    center = times_power_of_two((0.5, -0.25, -depth), k)
    spheres = tuple(Sphere(times_power_of_two(s.center, k), math.ldexp(s.radius, k)) for s in spheres)
    spheres += (Sphere(center, math.ldexp(0.5, k)), Sphere(times_power_of_two((9, 9, 9), k), math.ldexp(0.5, k)))
    e = math.ldexp(4.0, k)
    assert framed_half_height(e, spheres) == one_by_one(e, spheres)


def test_framing_keeps_a_sphere_whose_depth_rounds_away_from_its_radius() -> None:
    """k = 4 - 1e-16 rounds to 4, so k - R = 3.4e-16 is taken for 4.4e-16 and the outline for a quarter less wide."""
    radius = 4.0 - math.ulp(2.0)
    wider, narrower = Sphere((1, 0, 1e-16), radius), Sphere((1.1, 0, 0), radius)
    assert one_by_one(4.0, (wider,)) > one_by_one(4.0, (narrower,))
    for spheres in ((wider, narrower), (narrower, wider)):
        assert framed_half_height(4.0, spheres) == one_by_one(4.0, spheres)


@pytest.mark.parametrize("seed", range(40))
def test_framing_tells_outlines_apart_that_differ_in_their_last_place(seed: int) -> None:
    """The first sphere nearly reaches the plane of the eye; the second's outline ends within 1e-15 of the first's."""
    numbers = random.Random(seed)
    e, z = numbers.uniform(3.0, 5.0), numbers.uniform(-1.0, 1.0)
    first = Sphere((numbers.uniform(0.5, 2.0), 0, z), (e - z) * (1.0 - 10.0 ** numbers.uniform(-5.5, -3.0)))
    reach = one_by_one(e, (first,))
    low, high = 0.0, reach
    for _ in range(80):
        middle = (low + high) / 2.0
        below = one_by_one(e, (Sphere((middle, 0, 0), 0.25),)) <= reach
        low, high = (middle, high) if below else (low, middle)
    for aside in (low, high):
        spheres = (first, Sphere((aside, 0, 0), 0.25))
        assert framed_half_height(e, spheres) == one_by_one(e, spheres)


@pytest.mark.parametrize("shift", [0.0, 1e-13, 1e-9, -1e-9, 1e-7])
def test_spheres_of_nearly_the_same_reach_are_framed_by_the_larger_to_the_bit(shift: float) -> None:
    near, far = Sphere((1, 0, 2), 0.25), Sphere((2.0 + shift, 0, 0), 0.5)
    grazing = Sphere((0.0, -1.0, 3.0 - 1e-12), 1.0 - 2e-12)
    for spheres in ((near, far), (far, near), (near, far, grazing), (grazing, far, near)):
        assert framed_half_height(4.0, spheres) == one_by_one(4.0, spheres)


@given(st.one_of(ordinary_scenes(), nasty_scenes()), st.integers(-500, 500))
def test_scaling_all_lengths_by_a_power_of_two_scales_the_frame_exactly(scene: Scene, k: int) -> None:
    moved = scene.in_camera_frame()
    lengths = [
        *moved.camera.eye,
        *moved.spheres[0].center,
        moved.spheres[0].radius,
        *position(moved.lights[0]),
        half_height(scene),
        *(v for s in scene.spheres for v in s.center),
        *(v for li in scene.lights for v in position(li)),
        *scene.camera.eye,
        *scene.camera.look_at,
    ]
    smallest = min(abs(v) for v in lengths if v)
    if math.frexp(smallest)[1] + k <= sys.float_info.min_exp or math.frexp(max(map(abs, lengths)))[1] + k >= 1024:
        k = 0 if smallest < 1.0 else -1
    assert scaled(scene, k).in_camera_frame() == scaled(moved, k)


@given(ordinary_scenes(), st.sampled_from(TURNS))
def test_turning_scene_and_camera_together_changes_no_bit(scene: Scene, turn: list[list[int]]) -> None:
    assert moved_by(scene, turn).in_camera_frame() == scene.in_camera_frame()


@given(st.data())
def test_turning_by_an_exact_3_4_5_rotation_changes_no_bit(data: st.DataObject) -> None:
    """Whole coordinates that are multiples of 5 turn by the angle of (3/5, 4/5) without rounding."""
    axis = st.integers(-1000, 1000).map(lambda v: 5.0 * v)
    eye, look_at, center, light = (data.draw(st.tuples(axis, axis, axis)) for _ in range(4))
    eye = (eye[0], eye[1], 20000.0)
    scene = Scene(Camera(eye, look_at, (0, 5, 0), 1.0), (Sphere(center, 5.0),), (PointLight(light),))
    turned = moved_by(scene, [[3, -4, 0], [4, 3, 0], [0, 0, 5]])
    exact = Scene(
        Camera(fifth(turned.camera.eye), fifth(turned.camera.look_at), turned.camera.up, 1.0),
        (Sphere(fifth(turned.spheres[0].center), 5.0),),
        (PointLight(fifth(position(turned.lights[0]))),),
    )
    assert exact.in_camera_frame() == scene.in_camera_frame()


def fifth(v: Vector) -> Vector:
    assert all(entry % 5.0 == 0.0 for entry in v)
    return v[0] / 5.0, v[1] / 5.0, v[2] / 5.0


@given(centred_scenes(), st.tuples(*[st.integers(-64, 64).map(float)] * 3))
def test_shifting_scene_and_camera_together_by_an_exact_vector_changes_no_bit(scene: Scene, shift: Vector) -> None:
    def coarse(v: Vector) -> Vector:
        x, y, z = (round(entry * 256.0) / 256.0 for entry in v)
        return x, y, z

    light = PointLight(coarse(position(scene.lights[0])))
    eye = (0.0, 0.0, math.ceil(scene.camera.eye[2] * 256.0) / 256.0)
    scene = Scene(Camera(eye), (Sphere((0, 0, 0), scene.spheres[0].radius),), (light,))
    identity = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert moved_by(scene, identity, shift).in_camera_frame() == scene.in_camera_frame()


def test_right_is_x_up_is_y_and_towards_the_eye_is_z() -> None:
    camera = Camera(eye=(7, 0, 0), look_at=(2, 0, 0), up=(0, 0, 3), half_height=1)
    spheres = (Sphere((2, 1, 0), 0.5), Sphere((2, 0, 1), 0.5), Sphere((3, 0, 0), 0.5))
    moved = Scene(camera, spheres).in_camera_frame()
    assert moved.camera.eye == (0.0, 0.0, 5.0)
    assert [sphere.center for sphere in moved.spheres] == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]


@pytest.mark.parametrize(
    ("camera", "center"),
    [
        (Camera((0, 0, 4), up=(1, 0, 0), half_height=1), (-2.0, 1.0, 3.0)),
        (Camera((0, 0, 4), up=(3, 4, 0), half_height=1), (-0.4, 2.2, 3.0)),
        (Camera((0, 0, 4), up=(0, -1, 0), half_height=1), (-1.0, -2.0, 3.0)),
        (Camera((0, 0, -4), up=(0, 1, 0), half_height=1), (-1.0, 2.0, -3.0)),
        (Camera((0, 0, 4), (0, 0, 1), (0, 1, 0), half_height=1), (1.0, 2.0, 2.0)),
    ],
)
def test_camera_on_the_axis_that_rolls_or_looks_back_is_not_taken_for_the_frame(camera: Camera, center: Vector) -> None:
    moved = Scene(camera, (Sphere((1, 2, 3), 0.25),)).in_camera_frame()
    assert moved.spheres[0].center == center
    assert moved.camera.eye[2] == abs(camera.eye[2] - camera.look_at[2])


def test_numbers_at_both_ends_of_float64_move_without_overflow_or_loss() -> None:
    smallest, largest = 5e-324, sys.float_info.max
    scene = Scene(
        Camera((largest, 0, 0), (0, 0, 0), (0, smallest, 0), 1.0),
        (Sphere((0, smallest, 0), smallest),),
        (PointLight((0, 0, largest)),),
    )
    moved = scene.in_camera_frame()
    assert moved.camera.eye == (0.0, 0.0, largest)
    assert moved.spheres[0].center == (0.0, smallest, 0.0)
    assert position(moved.lights[0]) == (-largest, 0.0, 0.0)


@pytest.mark.parametrize(
    ("scene", "place"),
    [
        (Scene(Camera((1e308, 1e308, 1.4e308), half_height=1)), "camera.eye"),
        (Scene(Camera((4, 4, 4), half_height=1), lights=(PointLight((1.7e308,) * 3),)), "lights[0].position"),
        (Scene(Camera((4, 4, 4), half_height=1), (Sphere((-1.7e308,) * 3),)), "spheres[0].center"),
    ],
)
def test_coordinate_that_leaves_float64_is_refused_with_its_place(scene: Scene, place: str) -> None:
    with pytest.raises(SceneError, match="leaves the range of float64") as caught:
        scene.in_camera_frame()
    assert caught.value.place == place


def test_eye_that_rounding_puts_on_the_sphere_is_refused_in_the_camera_frame() -> None:
    """Outside by one part in 1e16 in the world; the camera's frame cannot tell that from touching."""
    refusals = []
    coordinates = (0.1, 0.3, 0.7)
    for eye in itertools.product(coordinates, coordinates, coordinates):
        radius = math.sqrt(sum(v * v for v in eye))
        for candidate in (math.nextafter(radius, 0.0), radius):
            try:
                scene = Scene(Camera(eye), (Sphere((0, 0, 0), candidate),))
            except SceneError:
                continue
            try:
                moved = scene.in_camera_frame()
            except SceneError as refusal:
                refusals.append(refusal)
            else:
                assert moved.camera.eye[2] > candidate
    assert refusals
    for error in refusals:
        assert error.place == "camera.eye"
        assert "rounding puts it on or in the sphere" in error.problem
        assert "move it away" in error.problem


@given(st.floats(1.0, 1e12, exclude_min=True), st.floats(0.1, 10.0))
@example(4.0, 1.0)
def test_centred_sphere_is_framed_as_in_chapter_1_bit_for_bit(ratio: float, radius: float) -> None:
    e = max(ratio * radius, math.nextafter(radius, math.inf))
    assert half_height(Scene.chapter1(radius=radius, eye=e)) == 1.25 * e * radius / math.sqrt(e * e - radius * radius)


def test_chapter_1_is_framed_at_the_seeds_number() -> None:
    assert half_height(Scene.chapter1()) == 1.25 * 4.0 * 1.0 / math.sqrt(4.0**2 - 1.0**2) == 1.2909944487358056


@given(centred_scenes(), st.integers(-900, 900))
def test_framing_a_centred_sphere_neither_overflows_nor_loses_digits_at_any_scale(scene: Scene, k: int) -> None:
    scene = Scene(Camera(scene.camera.eye), scene.spheres, ())
    assert half_height(scaled(scene, k)) == math.ldexp(half_height(scene), k)


@given(ordinary_scenes())
def test_frame_is_a_quarter_larger_than_the_outline(scene: Scene) -> None:
    """The largest |x|, |y| of the tangent cone's rays on the plane, by brute force, is half_height / 1.25."""
    camera = scene.camera
    moved = Scene(Camera(camera.eye, camera.look_at, camera.up), scene.spheres).in_camera_frame()
    sphere, e = moved.spheres[0], moved.camera.eye[2]
    m = [sphere.center[0], sphere.center[1], sphere.center[2] - e]
    distance = math.hypot(*m)
    axis = [v / distance for v in m]
    first = [axis[2], 0.0, -axis[0]]
    first = [v / math.hypot(*first) for v in first]
    second = [
        axis[1] * first[2] - axis[2] * first[1],
        axis[2] * first[0] - axis[0] * first[2],
        axis[0] * first[1] - axis[1] * first[0],
    ]
    sine = sphere.radius / distance
    cosine = math.sqrt(1.0 - sine * sine)
    reach = 0.0
    for step in range(2000):
        angle = 2.0 * math.pi * step / 2000.0
        ray = [
            cosine * a + sine * (math.cos(angle) * f + math.sin(angle) * s)
            for a, f, s in zip(axis, first, second, strict=True)
        ]
        reach = max(reach, e * abs(ray[0] / ray[2]), e * abs(ray[1] / ray[2]))
    assert moved.camera.half_height is not None
    outline = moved.camera.half_height / MARGIN
    assert outline * (1.0 - 1e-4) <= reach <= outline * (1.0 + 1e-9)


@given(st.floats(0.1, 3.0), st.floats(1.0001, 1e6))
def test_framing_is_continuous_from_the_centred_to_the_displaced_sphere(radius: float, ratio: float) -> None:
    e = radius * ratio
    displaced = Scene(Camera((0, 0, e)), (Sphere((math.ulp(0.0), 0, 0), radius),), ())
    assert half_height(displaced) == pytest.approx(half_height(Scene.chapter1(radius, e)), rel=1e-15 * e / (e - radius))


def test_several_spheres_are_all_framed_and_those_behind_the_eye_are_left_out() -> None:
    small, wide, behind = Sphere((0, 0, 0), 0.5), Sphere((1, -2, 0), 0.5), Sphere((50, 0, 9), 2)
    both = half_height(Scene(spheres=(small, wide), lights=()))
    assert both == half_height(Scene(spheres=(wide,), lights=()))
    assert both > half_height(Scene(spheres=(small,), lights=()))
    assert both == half_height(Scene(spheres=(small, behind, wide), lights=()))


def test_scene_without_spheres_is_framed_at_ninety_degrees() -> None:
    assert half_height(Scene(Camera((0, 0, 3)), spheres=())) == 3.0


@pytest.mark.parametrize(
    ("sphere", "words"),
    [
        (Sphere((3, 0, 3), 1), "reaches the plane through the eye"),
        (Sphere((3, 0, 3.5), 1), "reaches the plane through the eye"),
        (Sphere((3, 0, 4.5), 1), "reaches the plane through the eye"),
        (Sphere((0, 0, 9), 1), "no sphere is in front of the eye"),
        (Sphere((3, 0, 5), 1), "no sphere is in front of the eye"),
        (Sphere((0, 5e-324, -1e300), 5e-324), "smaller than the smallest float64"),
        (Sphere((1.7e308, 0, 3.9), 0.05), "larger than the largest float64"),
    ],
)
def test_sphere_that_cannot_be_framed_asks_for_a_half_height_and_accepts_one(sphere: Sphere, words: str) -> None:
    with pytest.raises(SceneError, match=words) as caught:
        Scene(spheres=(sphere,)).in_camera_frame()
    assert caught.value.place == "camera.half_height"
    assert "give one" in caught.value.problem
    assert half_height(Scene(Camera(half_height=2.5), (sphere,))) == 2.5


def test_sphere_an_ulp_in_front_of_the_eye_plane_is_framed() -> None:
    """k = R (1 + 2^-52): the outline is a bounded ellipse, some 1e16 wide; k = R is a parabola and is refused."""
    width = half_height(Scene(spheres=(Sphere((3, 0, math.nextafter(3.0, 0.0)), 1),)))
    assert 1e15 < width < 1e18


@given(st.integers(-(10**30), 10**30), st.integers(1, 10**40), st.integers(-1200, 900))
@example(3, 9, 0)
@example(10**30, 1, -1150)
@example((2**53 + 1) * 2**200 + 1, 2**400, 0)
@example(-(2**53 + 1) * 2**200 - 1, 2**400, 0)
@example((2**53 + 1) * 2**200, 2**400, 0)
def test_nearest_root_is_nearest_subnormal_results_included(numerator: int, radicand: int, grid: int) -> None:
    value = nearest_root(numerator, radicand, grid)
    with mpmath.workprec(600):
        true = mpmath.ldexp(mpmath.mpf(numerator) / mpmath.sqrt(radicand), grid)
        error = abs(mpmath.mpf(value) - true)
        assert error <= abs(mpmath.mpf(math.nextafter(value, math.inf)) - true)
        assert error <= abs(mpmath.mpf(math.nextafter(value, -math.inf)) - true)


@given(st.data(), st.one_of(ordinary_scenes(), nasty_scenes()))
def test_drawn_points_are_finite_and_every_drawn_scene_has_one_sphere_and_one_light(
    data: st.DataObject, scene: Scene
) -> None:
    assert (len(scene.spheres), len(scene.lights)) == (1, 1)
    x, y = data.draw(image_points(scene))
    assert math.isfinite(x)
    assert math.isfinite(y)
