"""The oracle of scenes: against the one-sphere oracle, mpmath, the brute-force reference, and laws of true values.

SYMRENDER_THOROUGH=1 compares thousands of random scenes with the brute-force reference instead of a few hundred.
"""

from __future__ import annotations

import json
import math
import os
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from flint import ctx, fmpq, fmpz
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs
from scene_strategies import random_scene, scaled, scene_points, scenes
from strategies import image_points, nasty_scenes

from symrender_cg.errors import AccuracyError, ArgumentError
from symrender_cg.reference import brute_force, hard_places, oracle
from symrender_cg.reference.compare import measure
from symrender_cg.reference.oracle import Answers
from symrender_cg.reference.oracle.one_sphere import OneSphere, takes
from symrender_cg.reference.oracle.rounding import FULL
from symrender_cg.reference.oracle.scene import AnyScene
from symrender_cg.reference.oracle.surds import Surd, ball, floor_over_root, rational, sign, sqrt_of
from symrender_cg.scene import Camera, DirectionalLight, Phong, Plane, PointLight, Scene, Sphere

THOROUGH = os.environ.get("SYMRENDER_THOROUGH") == "1"
CASES: list[dict[str, Any]] = json.loads(Path(__file__).with_name("hardcases.json").read_text())["cases"]
CAMERA = Camera((0.0, 0.0, 4.0), half_height=2.0)
DARK = Phong(0.0, 0.0, 0.0)


def shade(value: float) -> Phong:
    return Phong(value, 0.0, 0.0)


def assert_equal_answers(here: Answers, there: Answers) -> None:
    for name in ("value", "residual", "value32", "value8", "index"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name), name)


# ----------------------------------------------------------------------------------------------- one sphere, one light


def assert_as_one_sphere(scene: Scene, x: Any, y: Any) -> None:
    frame = scene.in_camera_frame()
    assert takes(frame)
    columns, rows = np.ravel(x).astype(np.float64), np.ravel(y).astype(np.float64)
    assert OneSphere(frame).answers(columns, rows, FULL) == AnyScene(frame).answers(columns, rows, FULL)
    assert OneSphere(frame).seen(columns, rows) == AnyScene(frame).seen(columns, rows)


def test_kept_hard_cases_are_the_one_sphere_oracle_s_bit_for_bit() -> None:
    cases = [
        case for case in CASES if case["status"] in ("ok", "miss", "undefined:w=0") and case["domain"] == "regular"
    ]
    assert len(cases) > 270
    for case in cases:
        r, e, lx, ly, lz, ka, kd, ks, n = (float.fromhex(number) for number in case["theta"])
        sphere = Sphere((0.0, 0.0, 0.0), r, Phong(ka, kd, ks, n))
        scene = Scene(Camera((0.0, 0.0, e), half_height=1.0), (sphere,), (PointLight((lx, ly, lz)),))
        assert_as_one_sphere(scene, float.fromhex(case["x"]), float.fromhex(case["y"]))


@settings(max_examples=100)
@given(data=st.data())
def test_nasty_scenes_of_one_sphere_are_the_one_sphere_oracle_s_bit_for_bit(data: st.DataObject) -> None:
    scene = data.draw(nasty_scenes())
    assert_as_one_sphere(scene, *data.draw(image_points(scene)))


def test_silhouettes_terminators_and_highlights_are_the_one_sphere_oracle_s_bit_for_bit() -> None:
    for gate in (False, True):
        material = Phong(0.1, 0.7, 0.5, 37.5, gate)
        scene = Scene(CAMERA, (Sphere((0.3, -0.2, 0.5), 0.8, material),), (PointLight((2.0, 3.0, 1.0), 0.9),), 0.25)
        for find in (hard_places.near_silhouette, hard_places.near_terminator, hard_places.near_highlight):
            assert_as_one_sphere(scene, *find(scene, 60, 3))


@pytest.mark.parametrize("eye", [4.0, 6.0])  # t = 3/4, and 5/6, which no ball holds exactly
@pytest.mark.parametrize("shininess", [1.0, 37.5, 1e300])
def test_ties_of_rational_values_go_to_even(eye: float, shininess: float) -> None:
    camera, far = Camera((0.0, 0.0, eye), half_height=2.0), Sphere((0.0, 0.0, -9.0), 1.0, DARK)
    falling = PointLight((0.0, 0.0, 9.0), 64.0, (0.0, 4.0, 0.5))  # 64 / (4 8 + 64 / 2) = 1
    mirrored = Plane((0.0, 0.0, 12.0), (0.0, 0.0, 1.0), shade(2.0**-53))
    for ambient, wanted in ((1.0, 1.0), (1.0 + 2.0**-52, 1.0 + 2.0**-51)):
        ball = Sphere(material=Phong(ambient, 2.0**-54, 2.0**-54, shininess))
        for light in (PointLight((0.0, 0.0, 9.0)), DirectionalLight((0.0, 0.0, -3.0)), falling):
            scene = Scene(camera, (far, ball), (light,))
            assert float(oracle.evaluate(scene, 0.0, 0.0).value) == wanted
        silver = Sphere(material=Phong(ambient, 2.0**-54, 0.0, shininess, reflect=0.5))
        scene = Scene(camera, (far, silver), (PointLight((0.0, 0.0, 9.0)),), 0.0, mirrored)
        assert float(oracle.evaluate(scene, 0.0, 0.0).value) == wanted


# ---------------------------------------------------------------------------------------------- the brute-force image


def test_random_scenes_are_the_brute_force_reference_s_wherever_that_is_in_no_doubt() -> None:
    """Measured over 7,000 scenes of 24 points: largest error 6.5e-13 of max(1, value); 61 points were in doubt."""
    count, each, doubtful = (4000, 24, 0) if THOROUGH else (300, 12, 0)
    for seed in range(count):
        scene = random_scene(seed + 10_000)
        x, y = scene_points(scene, each, seed)
        seen, truth = brute_force.trace(scene, x, y), oracle.evaluate(scene, x, y)
        sure = seen.doubt > 1e-9
        doubtful += int(np.count_nonzero(~sure))
        np.testing.assert_array_equal(seen.index[sure], truth.index[sure], str(seed))
        np.testing.assert_allclose(seen.value[sure], truth.value[sure], rtol=1e-11, atol=1e-11, err_msg=str(seed))
    assert doubtful <= 0.002 * count * each


@pytest.mark.parametrize("name", Scene.builtin_names())
def test_built_in_scenes_are_the_brute_force_reference_s(name: str) -> None:
    scene = Scene.builtin(name)
    seen = brute_force.image(scene, 14, 10)
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None
    step = 2.0 * half_height / 10
    truth = oracle.evaluate(scene, (np.arange(14) - 6.5) * step, ((4.5 - np.arange(10)) * step)[:, np.newaxis])
    sure = seen.doubt > 1e-9
    assert sure.mean() > 0.99
    np.testing.assert_array_equal(seen.index[sure], truth.index[sure])
    np.testing.assert_allclose(seen.value[sure], truth.value[sure], rtol=1e-12, atol=1e-12)


@settings(max_examples=60)
@given(scene=scenes(), seed=st.integers(0, 99))
def test_scenes_of_hypothesis_are_the_brute_force_reference_s_too(scene: Scene, seed: int) -> None:
    x, y = scene_points(scene, 8, seed)
    seen = brute_force.trace(scene, x, y)
    sure = seen.doubt > 1e-9
    try:
        truth = oracle.evaluate(scene, x[sure], y[sure])
    except AccuracyError:
        return  # two surfaces that mirror one point alike
    np.testing.assert_array_equal(seen.index[sure], truth.index)
    np.testing.assert_allclose(seen.value[sure], truth.value, rtol=1e-11, atol=1e-11)
    np.testing.assert_array_equal(oracle.index(scene, x[sure], y[sure]), truth.index)


# ------------------------------------------------------------------------------------------------------------- laws


def test_true_values_do_not_depend_on_order_on_scale_or_on_how_a_light_is_written() -> None:
    for seed in range(60):
        scene = random_scene(seed).in_camera_frame()
        x, y = scene_points(scene, 8, seed)
        here = oracle.evaluate(scene, x, y)
        lights = tuple(reversed(scene.lights))
        halves = tuple(
            structs.replace(li, intensity=tuple(v / 2 for v in li.intensity) if isinstance(li.intensity, tuple) else v)
            for li in lights
            for v in ((li.intensity / 2 if not isinstance(li.intensity, tuple) else 0.0),) * 2
        )
        assert_equal_answers(here, oracle.evaluate(structs.replace(scene, lights=halves), x, y))
        dark = structs.replace(scene, lights=(PointLight((1.0, 2.0, 3.0), 0.0), *lights))
        assert_equal_answers(here, oracle.evaluate(dark, x, y))
        if all(isinstance(li, DirectionalLight) or li.attenuation == (1.0, 0.0, 0.0) for li in lights):
            there = oracle.evaluate(scaled(scene, 300), np.ldexp(x, 300), np.ldexp(y, 300))
            assert_equal_answers(here, there)
        if len({(s.center, s.radius) for s in scene.spheres}) == len(scene.spheres):
            other = oracle.evaluate(structs.replace(scene, spheres=tuple(reversed(scene.spheres))), x, y)
            np.testing.assert_array_equal(here.value, other.value)
            np.testing.assert_array_equal(here.residual, other.residual)


def test_answers_have_the_broadcast_shape_and_one_axis_more_for_colour() -> None:
    grey = Scene(CAMERA, (Sphere(),), (PointLight(),), 0.125)
    coloured = structs.replace(grey, background=(0.125, 0.25, 0.5))
    x, y = [[0.0, 9.0]], [[0.0], [0.1], [9.0]]
    here, there = oracle.evaluate(grey, x, y), oracle.evaluate(coloured, x, y)
    assert here.value.shape == here.index.shape == (3, 2)
    assert there.value.shape == there.residual.shape == there.value32.shape == (3, 2, 3)
    assert there.value32.dtype == np.float32
    assert there.index.tolist() == [[0, -1], [0, -1], [-1, -1]]
    np.testing.assert_array_equal(there.value[0, 0], np.repeat(here.value[0, 0], 3))
    np.testing.assert_array_equal(there.value[0, 1], (0.125, 0.25, 0.5))
    assert there.hit.shape == (3, 2)
    errors = measure(there.value, there, hit=there.hit)
    assert (errors.flips, errors.count) == (0, 18)
    assert errors.max_ulp <= 0.5
    assert oracle.evaluate(coloured, [], []).value.shape == (0, 3)
    with pytest.raises(ArgumentError, match="y: holds NaN or infinity"):
        oracle.evaluate(grey, 0.0, math.nan)


def test_the_precision_of_python_flint_is_left_as_it_was() -> None:
    before = ctx.prec
    oracle.evaluate(random_scene(3), 0.0, 0.0)
    oracle.index(random_scene(3), 0.0, 0.0)
    assert ctx.prec == before


# ------------------------------------------------------------------------------------- what only exact numbers decide


def test_two_spheres_that_meet_under_the_ray_give_the_lower_index() -> None:
    left, right = Sphere((-0.5, 0.0, 0.0), 1.0, shade(0.25)), Sphere((0.5, 0.0, 0.0), 1.0, shade(0.75))
    y = np.array([0.0, 0.3, -0.1, 1.0 / 3.0])
    for spheres in ((left, right), (right, left)):
        seen = oracle.evaluate(Scene(CAMERA, spheres), np.zeros(4), y)
        assert seen.index.tolist() == [0] * 4
        assert set(seen.value.tolist()) == {spheres[0].material.ambient}
        beside = oracle.index(Scene(CAMERA, spheres), np.array([-(2.0**-60), 2.0**-60]), np.zeros(2))
        assert beside.tolist() == ([0, 1] if spheres[0] is left else [1, 0])


def test_touching_spheres_hide_each_other_exactly() -> None:
    near, far = Sphere((0.0, 0.0, 1.0), 0.5, shade(0.25)), Sphere((0.0, 0.0, 0.0), 0.5, shade(0.75))
    assert int(oracle.index(Scene(CAMERA, (far, near)), 0.0, 0.0)) == 1
    wall = Plane((0.0, 0.0, 0.5), (0.0, 0.0, 1.0), shade(0.5))
    assert int(oracle.index(Scene(CAMERA, (far,), (), 0.0, wall), 0.0, 0.0)) == 0
    recessed = structs.replace(wall, point=(0.0, 0.0, math.nextafter(0.5, 1.0)))
    assert int(oracle.index(Scene(CAMERA, (far,), (), 0.0, recessed), 0.0, 0.0)) == 1


def test_a_ray_that_touches_a_sphere_meets_it_and_one_a_hair_beside_it_does_not() -> None:
    touched = Scene(CAMERA, (Sphere((1.0, 0.0, 2.0), 1.0, shade(0.25)),))
    assert oracle.index(touched, [0.0, -(2.0**-80), 2.0**-80], 0.0).tolist() == [0, -1, 0]


@pytest.mark.parametrize(("eye", "wall_z", "x"), [(8.0, 0.0, 2.0), (6.0, -2.0, 1.5)])
def test_a_shadow_ray_that_touches_a_sphere_is_blocked_and_one_a_hair_beside_it_is_not(
    eye: float, wall_z: float, x: float
) -> None:
    wall = Plane((0.0, 0.0, wall_z), (0.0, 0.0, 1.0), Phong(0.125, 0.5, 0.0))  # seen at (2, 0, wall_z), t = 1 or 4/3
    camera = Camera((0.0, 0.0, eye), half_height=1.0)
    scene = Scene(camera, (Sphere((3.0, 0.0, 2.0), 1.0),), (DirectionalLight((0.0, 0.0, -3.0)),), 0.0, wall)
    seen = oracle.evaluate(scene, [x, math.nextafter(x, 0.0), math.nextafter(x, 3.0)], 0.0)
    assert seen.index.tolist() == [1, 1, 1]
    assert seen.value.tolist() == [0.125, 0.625, 0.125]


def test_a_light_on_a_sphere_and_one_inside_it() -> None:
    wall = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), Phong(0.125, 0.5, 0.0))
    globe = Sphere((3.0, 0.0, 2.0), 1.0)
    camera = Camera((0.0, 0.0, 8.0), half_height=1.0)
    for z, lit in ((1.0, True), (math.nextafter(1.0, 2.0), False), (math.nextafter(1.0, 0.0), True)):
        scene = Scene(camera, (globe,), (PointLight((3.0, 0.0, z)),), 0.0, wall)
        assert (float(oracle.evaluate(scene, 1.5, 0.0).value) > 0.125) is lit


def test_equal_spheres_shadow_each_other_only_from_within() -> None:
    material = Phong(0.125, 0.5, 0.25, 0.0)
    twins = (Sphere(material=material), Sphere(material=Phong(0.75)))
    lights: tuple[PointLight | DirectionalLight, ...] = (
        PointLight((0.0, 0.0, 9.0)),
        PointLight((0.0, 0.0, -9.0)),
        DirectionalLight((0.0, 0.0, 1.0)),
    )
    for light, wanted in zip(lights, (0.875, 0.125, 0.125), strict=True):
        seen = oracle.evaluate(Scene(CAMERA, twins, (light,)), 0.0, 0.0)
        assert (int(seen.index), float(seen.value)) == (0, wanted)
        alone = oracle.evaluate(Scene(CAMERA, twins[:1], (light,)), 0.0, 0.0)
        assert float(alone.value) == (0.875 if wanted == 0.875 else 0.375), "a surface never shadows itself"


def test_a_tile_holds_its_lower_edges() -> None:
    floor = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), shade(0.25), shade(0.75), 0.5, (0.0, 0.0, 1.0))
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (), (), 0.0, floor)
    # y = -1/2: t = 2, P = (2 x, -1, -4); u = z, v = x; floor(-8) is even, floor(2 x / tile) decides
    x = np.array([0.0, -(2.0**-70), 0.125, 0.25, math.nextafter(0.25, 0.0), -0.25, math.nextafter(-0.25, -1.0)])
    seen = oracle.evaluate(scene, x, np.full(x.shape, -0.5))
    assert seen.value.tolist() == [0.25, 0.75, 0.25, 0.75, 0.25, 0.75, 0.25]
    slanted = structs.replace(scene, plane=structs.replace(floor, axis=(1.0, 0.0, 1.0)))
    # u = (1, 0, 1) / sqrt(2): u.P = (2 x - 4) / sqrt(2), v = (1, 0, -1) / sqrt(2): v.P = (2 x + 4) / sqrt(2)
    for x_here in (0.0, 2.0, -2.0):
        u, v = ((2.0 * x_here + side * 4.0) / math.sqrt(2.0) / 0.5 for side in (-1, 1))
        odd = (math.floor(u) + math.floor(v)) % 2
        value = float(oracle.evaluate(slanted, x_here, -0.5).value)
        assert value == (0.75 if odd else 0.25)


def test_mirrors_that_look_straight_at_each_other_are_decided() -> None:
    balls = tuple(
        Sphere((0.0, 0.0, z), 0.5, Phong(a, 0.5, 0.5, 8.0, reflect=0.5)) for z, a in ((0.0, 0.25), (-3.0, 1.0))
    )
    wall = Plane((0.0, 0.0, 6.0), (0.0, 0.0, 1.0), Phong(0.125, 0.0, 0.0, reflect=0.5))
    scene = Scene(CAMERA, balls, (PointLight((0.0, 0.0, 5.0)),), 0.0, wall, max_bounces=3)
    # ambient + diffuse + specular = 1.25, then the wall 1/8, the ball again, the wall
    wanted = Fraction(5, 4) + Fraction(1, 2) * (Fraction(1, 8) + Fraction(1, 2) * (Fraction(5, 4) + Fraction(1, 16)))
    assert Fraction(float(oracle.evaluate(scene, 0.0, 0.0).value)) == wanted


def test_a_mirrored_ray_that_meets_two_spheres_in_one_point_gives_the_lower_index() -> None:
    mirror = Sphere((0.0, 0.0, 0.0), 1.0, Phong(0.0, 0.0, 0.0, reflect=1.0))
    pair = tuple(Sphere((x, 3.0, 2.0), 1.0, shade(s)) for x, s in ((-0.5, 0.25), (0.5, 0.75)))
    scene = Scene(CAMERA, (mirror, *pair), (), max_bounces=1)
    y = 0.55
    assert float(oracle.evaluate(scene, 1e-3, y).value) == 0.75
    assert float(oracle.evaluate(scene, -1e-3, y).value) == 0.25
    assert float(oracle.evaluate(scene, 0.0, y).value) == 0.25
    swapped = structs.replace(scene, spheres=(mirror, pair[1], pair[0]))
    assert float(oracle.evaluate(swapped, 0.0, y).value) == 0.75
    assert int(oracle.index(scene, 0.0, y)) == 0
    assert float(oracle.evaluate(structs.replace(scene, max_bounces=0), 0.0, y).value) == 0.0


# ------------------------------------------------------------------------------------------------------------- surds


WHOLE = st.integers(-6, 6)
Numbers = st.tuples(WHOLE, WHOLE, WHOLE)


def value_of(number: Any) -> Any:
    """A surd by mpmath, from its parts."""
    if isinstance(number, Surd):
        return value_of(number.s) + value_of(number.t) * mpmath.sqrt(value_of(number.root.square))
    number = fmpq(number)
    return mpmath.mpf(int(number.p)) / int(number.q)


def tower(parts: tuple[int, int, int], d: int, e: int) -> Any:
    """a + b sqrt(d) + c sqrt(e + sqrt(d)): roots of d, and of a number over it."""
    a, b, c = parts
    inner = sqrt_of(fmpz(d))
    return inner * b + sqrt_of(inner + fmpq(e)) * c + fmpq(a)


ROOTS = st.sampled_from((2, 3, 5, 7, 8, 9, 12))


@settings(max_examples=300)
@given(a=Numbers, b=Numbers, d=ROOTS, e=st.integers(0, 9), other=ROOTS)
def test_exact_numbers_over_nested_roots_have_the_signs_of_their_values(
    a: tuple[int, int, int], b: tuple[int, int, int], d: int, e: int, other: int
) -> None:
    first, second = tower(a, d, e), tower(b, other, e)
    with mpmath.workdps(60):
        for number in (first, second, first - second, first * second, first * first - second * second):
            truth = value_of(number)
            assert sign(number) == (0 if abs(truth) < mpmath.mpf(10) ** -45 else int(mpmath.sign(truth)))
        near = mpmath.mpf(10) ** -45
        assert abs(value_of(first - second) - (value_of(first) - value_of(second))) < near
        assert abs(value_of(1 - first * second) - (1 - value_of(first) * value_of(second))) < near
    assert ball(first).overlaps(ball(first - second) + ball(second))


@settings(max_examples=100)
@given(a=Numbers, b=Numbers, d=ROOTS, e=st.integers(0, 9))
def test_exact_numbers_divide_and_their_squares_have_them_as_roots(
    a: tuple[int, int, int], b: tuple[int, int, int], d: int, e: int
) -> None:
    inner = sqrt_of(fmpz(d))
    outer = sqrt_of(inner + fmpq(e))  # one root, as numbers of one ray have it
    first, second = (inner * v + outer * w + fmpq(u) for u, v, w in (a, b))
    if sign(second):
        assert sign(first / second * second - first) == 0
        assert sign(1 / second * second - 1) == 0
    root = sqrt_of(first * first)
    assert sign(root) >= 0
    assert sign(root * root - first * first) == 0
    assert sign(root - first) == 0 or sign(root + first) == 0


def test_equal_numbers_over_different_roots_are_equal() -> None:
    two, eight = sqrt_of(fmpz(2)), sqrt_of(fmpz(8))
    assert sign(two * 2 - eight) == 0
    assert sign(sqrt_of(two + 3) - sqrt_of(eight / 2 + 3)) == 0
    assert sign(two * 2 - eight + fmpq(1, 10**300)) == 1
    same = two * sqrt_of(fmpz(2))
    assert sign(same - 2) == 0
    assert sign(1 / (same + 1) * 3 - 1) == 0, "the norm of same + 1 may be 0, the number is not"
    assert rational(sqrt_of(two * 2 + 3)) is None
    assert sign(sqrt_of(two * 2 + 3) - two - 1) == 0
    assert sqrt_of(two * 2 + 3).root is two.root, "a square of the field adds no root"
    assert rational(sqrt_of(two * 2 + 3) - two) == 1


def test_rational_roots_and_floors_over_roots_are_exact() -> None:
    for value in (-6, -5, -4, 0, 4, 5, 6):
        for square in (4, 2):
            floor = math.floor(value / math.sqrt(float(square)))
            for near in (floor, floor + 1):
                assert floor_over_root(fmpq(value), fmpz(square), near) == floor
    assert rational(sqrt_of(fmpz(9))) == 3
    assert rational(sqrt_of(fmpz(8))) is None
    assert rational(sqrt_of(fmpq(9, 4))) == Fraction(3, 2)
