"""The oracle of scenes: against the one-sphere oracle, mpmath, the brute-force reference, and laws of true values.

SYMRENDER_THOROUGH=1 compares thousands of random scenes with the brute-force reference instead of a few hundred.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
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
from symrender_cg.reference import brute_force, oracle, points, scene_oracle
from symrender_cg.reference.compare import measure
from symrender_cg.reference.scene_oracle import SceneAnswers
from symrender_cg.reference.surds import Surd, floor_over_root, order, rational_root
from symrender_cg.scene import Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere

THOROUGH = os.environ.get("SYMRENDER_THOROUGH") == "1"
CASES: list[dict[str, Any]] = json.loads(Path(__file__).with_name("hardcases.json").read_text())["cases"]
CAMERA = Camera((0.0, 0.0, 4.0), half_height=2.0)
DARK = Phong(0.0, 0.0, 0.0)


def shade(value: float) -> Phong:
    return Phong(value, 0.0, 0.0)


def assert_equal_answers(here: SceneAnswers, there: SceneAnswers) -> None:
    for name in ("value", "residual", "value32", "index"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name), name)


# ----------------------------------------------------------------------------------------------- one sphere, one light


def assert_as_one_sphere(scene: Scene, x: Any, y: Any) -> None:
    wanted, found = oracle.evaluate(scene, x, y), scene_oracle.evaluate(scene, x, y)
    for name in ("value", "residual", "value32", "hit"):
        np.testing.assert_array_equal(getattr(wanted, name), getattr(found.answers, name), name)


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
        for find in (points.near_silhouette, points.near_terminator, points.near_highlight):
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
            assert float(scene_oracle.evaluate(scene, 0.0, 0.0).value) == wanted
        silver = Sphere(material=Phong(ambient, 2.0**-54, 0.0, shininess, reflect=0.5))
        scene = Scene(camera, (far, silver), (PointLight((0.0, 0.0, 9.0)),), 0.0, mirrored)
        assert float(scene_oracle.evaluate(scene, 0.0, 0.0).value) == wanted


# ---------------------------------------------------------------------------------------------------------- mpmath


Mp = Any
MpVector = tuple[Mp, Mp, Mp]


def mp_vector(v: Sequence[float]) -> MpVector:
    return mpmath.mpf(v[0]), mpmath.mpf(v[1]), mpmath.mpf(v[2])


def mp_dot(a: MpVector, b: MpVector) -> Mp:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def mp_add(a: MpVector, b: MpVector, factor: Any = 1) -> MpVector:
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def mp_unit(v: MpVector) -> MpVector:
    length = mpmath.sqrt(mp_dot(v, v))
    return v[0] / length, v[1] / length, v[2] / length


class ByMpmath:
    """The definition once more: unit rays, the roots of each quadratic along them; at the digits of the context."""

    def __init__(self, frame: Scene) -> None:
        self.frame = frame
        self.plane = frame.plane
        if self.plane is not None:
            self.up, self.at = mp_unit(mp_vector(self.plane.normal)), mp_vector(self.plane.point)

    def roots(self, origin: MpVector, way: MpVector, sphere: Sphere) -> tuple[Mp, Mp] | None:
        """Where origin + t way, |way| = 1, enters and leaves the sphere."""
        o = mp_add(origin, mp_vector(sphere.center), -1)
        half = mp_dot(o, way)
        disc = half * half - mp_dot(o, o) + mpmath.mpf(sphere.radius) ** 2
        return None if disc < 0 else (-half - mpmath.sqrt(disc), -half + mpmath.sqrt(disc))

    def colour(self, origin: MpVector, way: MpVector, own: int, left: int) -> tuple[int, list[Mp]]:
        frame, count = self.frame, len(self.frame.spheres)
        found = []
        for k, sphere in enumerate(frame.spheres):
            roots = self.roots(origin, way, sphere)
            if k != own and roots is not None and roots[0] > 0:
                found.append((roots[0], k))
        if self.plane is not None and own != count and mp_dot(self.up, way) != 0:
            t = mp_dot(self.up, mp_add(self.at, origin, -1)) / mp_dot(self.up, way)
            found += [(t, count)] if t > 0 else []
        if not found:
            return -1, self.background(way)
        t, index = min(found)
        point = mp_add(origin, way, t)
        if index < count:
            sphere = frame.spheres[index]
            normal, material = mp_unit(mp_add(point, mp_vector(sphere.center), -1)), sphere.material
        else:
            normal, material = self.up, self.tile(point)
            if mp_dot(normal, way) > 0:
                normal = mp_add((0, 0, 0), normal, -1)
        total = [mpmath.mpf(c) for c in self.channels(material.ambient)]
        for light in frame.lights:
            for k, added in enumerate(self.light(point, way, normal, index, material, light)):
                total[k] += added
        if material.reflect and left:
            mirrored = mp_add(way, normal, -2 * mp_dot(normal, way))
            for k, seen in enumerate(self.colour(point, mirrored, index, left - 1)[1]):
                total[k] += material.reflect * seen
        return index, total

    def light(
        self, point: MpVector, way: MpVector, normal: MpVector, index: int, material: Phong, light: Any
    ) -> list[Mp]:
        far, strength = mpmath.inf, mpmath.mpf(1)
        if isinstance(light, DirectionalLight):
            to_light = mp_unit(mp_vector([-c for c in light.direction]))
        else:
            w = mp_add(mp_vector(light.position), point, -1)
            far, to_light = mpmath.sqrt(mp_dot(w, w)), mp_unit(w)
            a, b, c = light.attenuation
            strength = 1 / (a + b * far + c * far**2)
        if self.frame.shadows and self.dark(point, to_light, far, index):
            return [mpmath.mpf(0)] * self.frame.channels
        n_dot_l = mp_dot(normal, to_light)
        r = mp_add(mp_add((0, 0, 0), normal, 2 * n_dot_l), to_light, -1)
        power = max(mpmath.mpf(0), -mp_dot(r, way)) ** mpmath.mpf(material.shininess)
        if material.gate_specular and n_dot_l <= 0:
            power = mpmath.mpf(0)
        return [
            strength * i * (mpmath.mpf(d) * max(mpmath.mpf(0), n_dot_l) + mpmath.mpf(s) * power)
            for i, d, s in zip(*map(self.channels, (light.intensity, material.diffuse, material.specular)), strict=True)
        ]

    def dark(self, point: MpVector, way: MpVector, far: Mp, index: int) -> bool:
        for k, sphere in enumerate(self.frame.spheres):
            roots = self.roots(point, way, sphere)
            if k != index and roots is not None and roots[0] < far and roots[1] > mpmath.mpf(10) ** -80:
                return True
        if self.plane is None or index == len(self.frame.spheres) or mp_dot(self.up, way) == 0:
            return False
        t = mp_dot(self.up, mp_add(self.at, point, -1)) / mp_dot(self.up, way)
        return bool(0 < t < far)

    def tile(self, point: MpVector) -> Phong:
        plane = self.plane
        assert plane is not None
        axis = mp_vector(plane.axis)
        u = mp_unit(mp_add(axis, self.up, -mp_dot(axis, self.up)))
        n = self.up
        v = (n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0])
        away = mp_add(point, self.at, -1)
        odd = sum(int(mpmath.floor(mp_dot(side, away) / plane.tile)) for side in (u, v)) % 2
        return plane.checker if odd and plane.checker is not None else plane.material

    def background(self, way: MpVector) -> list[Mp]:
        background = self.frame.background
        if not isinstance(background, Gradient):
            return [mpmath.mpf(c) for c in self.channels(background)]
        s = (1 + mp_dot(mp_unit(mp_vector(background.up)), way)) / 2
        ends = zip(self.channels(background.bottom), self.channels(background.top), strict=True)
        return [bottom * (1 - s) + top * s for bottom, top in ends]

    def channels(self, colour: Any) -> list[float]:
        return list(colour) if isinstance(colour, tuple) else [colour] * self.frame.channels


def test_values_are_mpmath_s_at_100_digits_rounded_once() -> None:
    seen: dict[str, int] = {"surface": 0, "plane": 0, "mirrored": 0}
    for seed in range(200):
        scene = random_scene(seed).in_camera_frame()
        if len({(s.center, s.radius) for s in scene.spheres}) < len(scene.spheres):
            continue  # rounding at 100 digits cannot tell a point on two equal spheres from one inside
        x, y = scene_points(scene, 6, seed)
        brute, found = brute_force.trace(scene, x, y), scene_oracle.evaluate(scene, x, y)
        e = scene.camera.eye[2]
        for k in np.flatnonzero(brute.doubt > 1e-30):
            with mpmath.workdps(100):
                way = mp_unit(mp_vector((x[k], y[k], -e)))
                index, value = ByMpmath(scene).colour(mp_vector((0.0, 0.0, e)), way, -1, scene.max_bounces)
                assert index == found.index[k]
                for truth, here, rest in zip(
                    value, np.atleast_1d(found.value[k]), np.atleast_1d(found.residual[k]), strict=True
                ):
                    assert float(truth) == here, (seed, k)
                    assert float(truth - mpmath.mpf(float(here))) == pytest.approx(rest, rel=1e-12, abs=1e-90)
            seen["surface"] += 0 <= index < len(scene.spheres)
            seen["plane"] += index == len(scene.spheres)
            seen["mirrored"] += bool(brute.reflected[k].any())
    assert min(seen.values()) >= 20, seen


# ---------------------------------------------------------------------------------------------- the brute-force image


def test_random_scenes_are_the_brute_force_reference_s_wherever_that_is_in_no_doubt() -> None:
    """Measured over 7,000 scenes of 24 points: largest error 6.5e-13 of max(1, value); 61 points were in doubt."""
    count, each, doubtful = (4000, 24, 0) if THOROUGH else (300, 12, 0)
    for seed in range(count):
        scene = random_scene(seed + 10_000)
        x, y = scene_points(scene, each, seed)
        seen, truth = brute_force.trace(scene, x, y), scene_oracle.evaluate(scene, x, y)
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
    truth = scene_oracle.evaluate(scene, (np.arange(14) - 6.5) * step, ((4.5 - np.arange(10)) * step)[:, np.newaxis])
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
        truth = scene_oracle.evaluate(scene, x[sure], y[sure])
    except AccuracyError:
        return  # two surfaces that mirror one point alike
    np.testing.assert_array_equal(seen.index[sure], truth.index)
    np.testing.assert_allclose(seen.value[sure], truth.value, rtol=1e-11, atol=1e-11)
    np.testing.assert_array_equal(scene_oracle.index(scene, x[sure], y[sure]), truth.index)


# ------------------------------------------------------------------------------------------------------------- laws


def test_true_values_do_not_depend_on_order_on_scale_or_on_how_a_light_is_written() -> None:
    for seed in range(60):
        scene = random_scene(seed).in_camera_frame()
        x, y = scene_points(scene, 8, seed)
        here = scene_oracle.evaluate(scene, x, y)
        lights = tuple(reversed(scene.lights))
        halves = tuple(
            structs.replace(li, intensity=tuple(v / 2 for v in li.intensity) if isinstance(li.intensity, tuple) else v)
            for li in lights
            for v in ((li.intensity / 2 if not isinstance(li.intensity, tuple) else 0.0),) * 2
        )
        assert_equal_answers(here, scene_oracle.evaluate(structs.replace(scene, lights=halves), x, y))
        dark = structs.replace(scene, lights=(PointLight((1.0, 2.0, 3.0), 0.0), *lights))
        assert_equal_answers(here, scene_oracle.evaluate(dark, x, y))
        if all(isinstance(li, DirectionalLight) or li.attenuation == (1.0, 0.0, 0.0) for li in lights):
            there = scene_oracle.evaluate(scaled(scene, 300), np.ldexp(x, 300), np.ldexp(y, 300))
            assert_equal_answers(here, there)
        if len({(s.center, s.radius) for s in scene.spheres}) == len(scene.spheres):
            other = scene_oracle.evaluate(structs.replace(scene, spheres=tuple(reversed(scene.spheres))), x, y)
            np.testing.assert_array_equal(here.value, other.value)
            np.testing.assert_array_equal(here.residual, other.residual)


def test_answers_have_the_broadcast_shape_and_one_axis_more_for_colour() -> None:
    grey = Scene(CAMERA, (Sphere(),), (PointLight(),), 0.125)
    coloured = structs.replace(grey, background=(0.125, 0.25, 0.5))
    x, y = [[0.0, 9.0]], [[0.0], [0.1], [9.0]]
    here, there = scene_oracle.evaluate(grey, x, y), scene_oracle.evaluate(coloured, x, y)
    assert here.value.shape == here.index.shape == (3, 2)
    assert there.value.shape == there.residual.shape == there.value32.shape == (3, 2, 3)
    assert there.value32.dtype == np.float32
    assert there.index.tolist() == [[0, -1], [0, -1], [-1, -1]]
    np.testing.assert_array_equal(there.value[0, 0], np.repeat(here.value[0, 0], 3))
    np.testing.assert_array_equal(there.value[0, 1], (0.125, 0.25, 0.5))
    assert there.answers.hit.shape == (3, 2, 3)
    errors = measure(there.value, there.answers, hit=there.answers.hit)
    assert (errors.flips, errors.count) == (0, 18)
    assert errors.max_ulp <= 0.5
    assert scene_oracle.evaluate(coloured, [], []).value.shape == (0, 3)
    with pytest.raises(ArgumentError, match="y: holds NaN or infinity"):
        scene_oracle.evaluate(grey, 0.0, math.nan)


def test_the_precision_of_python_flint_is_left_as_it_was() -> None:
    before = ctx.prec
    scene_oracle.evaluate(random_scene(3), 0.0, 0.0)
    scene_oracle.index(random_scene(3), 0.0, 0.0)
    assert ctx.prec == before


# ------------------------------------------------------------------------------------- what only exact numbers decide


def test_two_spheres_that_meet_under_the_ray_give_the_lower_index() -> None:
    left, right = Sphere((-0.5, 0.0, 0.0), 1.0, shade(0.25)), Sphere((0.5, 0.0, 0.0), 1.0, shade(0.75))
    y = np.array([0.0, 0.3, -0.1, 1.0 / 3.0])
    for spheres in ((left, right), (right, left)):
        seen = scene_oracle.evaluate(Scene(CAMERA, spheres), np.zeros(4), y)
        assert seen.index.tolist() == [0] * 4
        assert set(seen.value.tolist()) == {spheres[0].material.ambient}
        beside = scene_oracle.index(Scene(CAMERA, spheres), np.array([-(2.0**-60), 2.0**-60]), np.zeros(2))
        assert beside.tolist() == ([0, 1] if spheres[0] is left else [1, 0])


def test_touching_spheres_hide_each_other_exactly() -> None:
    near, far = Sphere((0.0, 0.0, 1.0), 0.5, shade(0.25)), Sphere((0.0, 0.0, 0.0), 0.5, shade(0.75))
    assert int(scene_oracle.index(Scene(CAMERA, (far, near)), 0.0, 0.0)) == 1
    wall = Plane((0.0, 0.0, 0.5), (0.0, 0.0, 1.0), shade(0.5))
    assert int(scene_oracle.index(Scene(CAMERA, (far,), (), 0.0, wall), 0.0, 0.0)) == 0
    recessed = structs.replace(wall, point=(0.0, 0.0, math.nextafter(0.5, 1.0)))
    assert int(scene_oracle.index(Scene(CAMERA, (far,), (), 0.0, recessed), 0.0, 0.0)) == 1


def test_a_ray_that_touches_a_sphere_meets_it_and_one_a_hair_beside_it_does_not() -> None:
    touched = Scene(CAMERA, (Sphere((1.0, 0.0, 2.0), 1.0, shade(0.25)),))
    assert scene_oracle.index(touched, [0.0, -(2.0**-80), 2.0**-80], 0.0).tolist() == [0, -1, 0]


@pytest.mark.parametrize(("eye", "wall_z", "x"), [(8.0, 0.0, 2.0), (6.0, -2.0, 1.5)])
def test_a_shadow_ray_that_touches_a_sphere_is_blocked_and_one_a_hair_beside_it_is_not(
    eye: float, wall_z: float, x: float
) -> None:
    wall = Plane((0.0, 0.0, wall_z), (0.0, 0.0, 1.0), Phong(0.125, 0.5, 0.0))  # seen at (2, 0, wall_z), t = 1 or 4/3
    camera = Camera((0.0, 0.0, eye), half_height=1.0)
    scene = Scene(camera, (Sphere((3.0, 0.0, 2.0), 1.0),), (DirectionalLight((0.0, 0.0, -3.0)),), 0.0, wall)
    seen = scene_oracle.evaluate(scene, [x, math.nextafter(x, 0.0), math.nextafter(x, 3.0)], 0.0)
    assert seen.index.tolist() == [1, 1, 1]
    assert seen.value.tolist() == [0.125, 0.625, 0.125]


def test_a_light_on_a_sphere_and_one_inside_it() -> None:
    wall = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), Phong(0.125, 0.5, 0.0))
    globe = Sphere((3.0, 0.0, 2.0), 1.0)
    camera = Camera((0.0, 0.0, 8.0), half_height=1.0)
    for z, lit in ((1.0, True), (math.nextafter(1.0, 2.0), False), (math.nextafter(1.0, 0.0), True)):
        scene = Scene(camera, (globe,), (PointLight((3.0, 0.0, z)),), 0.0, wall)
        assert (float(scene_oracle.evaluate(scene, 1.5, 0.0).value) > 0.125) is lit


def test_equal_spheres_shadow_each_other_only_from_within() -> None:
    material = Phong(0.125, 0.5, 0.25, 0.0)
    twins = (Sphere(material=material), Sphere(material=Phong(0.75)))
    lights: tuple[PointLight | DirectionalLight, ...] = (
        PointLight((0.0, 0.0, 9.0)),
        PointLight((0.0, 0.0, -9.0)),
        DirectionalLight((0.0, 0.0, 1.0)),
    )
    for light, wanted in zip(lights, (0.875, 0.125, 0.125), strict=True):
        seen = scene_oracle.evaluate(Scene(CAMERA, twins, (light,)), 0.0, 0.0)
        assert (int(seen.index), float(seen.value)) == (0, wanted)
        alone = scene_oracle.evaluate(Scene(CAMERA, twins[:1], (light,)), 0.0, 0.0)
        assert float(alone.value) == (0.875 if wanted == 0.875 else 0.375), "a surface never shadows itself"


def test_a_tile_holds_its_lower_edges() -> None:
    floor = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), shade(0.25), shade(0.75), 0.5, (0.0, 0.0, 1.0))
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (), (), 0.0, floor)
    # y = -1/2: t = 2, P = (2 x, -1, -4); u = z, v = x; floor(-8) is even, floor(2 x / tile) decides
    x = np.array([0.0, -(2.0**-70), 0.125, 0.25, math.nextafter(0.25, 0.0), -0.25, math.nextafter(-0.25, -1.0)])
    seen = scene_oracle.evaluate(scene, x, np.full(x.shape, -0.5))
    assert seen.value.tolist() == [0.25, 0.75, 0.25, 0.75, 0.25, 0.75, 0.25]
    slanted = structs.replace(scene, plane=structs.replace(floor, axis=(1.0, 0.0, 1.0)))
    # u = (1, 0, 1) / sqrt(2): u.P = (2 x - 4) / sqrt(2), v = (1, 0, -1) / sqrt(2): v.P = (2 x + 4) / sqrt(2)
    for x_here in (0.0, 2.0, -2.0):
        u, v = ((2.0 * x_here + side * 4.0) / math.sqrt(2.0) / 0.5 for side in (-1, 1))
        odd = (math.floor(u) + math.floor(v)) % 2
        value = float(scene_oracle.evaluate(slanted, x_here, -0.5).value)
        assert value == (0.75 if odd else 0.25)


def test_mirrors_that_look_straight_at_each_other_are_decided() -> None:
    balls = tuple(
        Sphere((0.0, 0.0, z), 0.5, Phong(a, 0.5, 0.5, 8.0, reflect=0.5)) for z, a in ((0.0, 0.25), (-3.0, 1.0))
    )
    wall = Plane((0.0, 0.0, 6.0), (0.0, 0.0, 1.0), Phong(0.125, 0.0, 0.0, reflect=0.5))
    scene = Scene(CAMERA, balls, (PointLight((0.0, 0.0, 5.0)),), 0.0, wall, max_bounces=3)
    # ambient + diffuse + specular = 1.25, then the wall 1/8, the ball again, the wall
    wanted = Fraction(5, 4) + Fraction(1, 2) * (Fraction(1, 8) + Fraction(1, 2) * (Fraction(5, 4) + Fraction(1, 16)))
    assert Fraction(float(scene_oracle.evaluate(scene, 0.0, 0.0).value)) == wanted


def test_a_mirrored_ray_that_meets_two_spheres_in_one_point_is_refused_by_name() -> None:
    mirror = Sphere((0.0, 0.0, 0.0), 1.0, Phong(0.0, 0.0, 0.0, reflect=1.0))
    pair = tuple(Sphere((x, 3.0, 2.0), 1.0, shade(s)) for x, s in ((-0.5, 0.25), (0.5, 0.75)))
    scene = Scene(CAMERA, (mirror, *pair), (), max_bounces=1)
    y = 0.55
    assert float(scene_oracle.evaluate(scene, 1e-3, y).value) == 0.75
    assert float(scene_oracle.evaluate(scene, -1e-3, y).value) == 0.25
    with pytest.raises(AccuracyError, match=r"the value at \(0\.0, 0\.55\) of a scene of 3 spheres rests on a sign"):
        scene_oracle.evaluate(scene, 0.0, y)
    assert int(scene_oracle.index(scene, 0.0, y)) == 0
    assert float(scene_oracle.evaluate(structs.replace(scene, max_bounces=0), 0.0, y).value) == 0.0


# ------------------------------------------------------------------------------------------------------------- surds


WHOLE = st.integers(-6, 6)


def value_of(s: Surd) -> Any:
    with mpmath.workdps(60):
        return mpmath.mpf(int(s.s.p)) / int(s.s.q) + mpmath.mpf(int(s.t.p)) / int(s.t.q) * mpmath.sqrt(int(s.d))


@given(a=st.tuples(WHOLE, WHOLE), b=st.tuples(WHOLE, WHOLE), d=st.tuples(st.integers(0, 12), st.integers(0, 12)))
def test_signs_and_orders_of_surds_are_those_of_their_values(
    a: tuple[int, int], b: tuple[int, int], d: tuple[int, int]
) -> None:
    first, second = (s + Surd.root(fmpz(root)) * t for (s, t), root in zip((a, b), d, strict=True))
    with mpmath.workdps(60):
        difference = value_of(first) - value_of(second)
        tiny = abs(difference) < mpmath.mpf(10) ** -50
        assert order(first, second) == (0 if tiny else int(mpmath.sign(difference)))
        size = value_of(first)
        assert first.sign() == (0 if abs(size) < mpmath.mpf(10) ** -50 else int(mpmath.sign(size)))


@given(a=st.tuples(WHOLE, WHOLE), b=st.tuples(WHOLE, WHOLE), d=st.sampled_from((2, 3, 7, 9)))
def test_surds_of_one_root_add_multiply_and_divide(a: tuple[int, int], b: tuple[int, int], d: int) -> None:
    first, second = (s + Surd.root(fmpz(d)) * t for s, t in (a, b))
    with mpmath.workdps(60):
        for found, wanted in (
            (first + second, value_of(first) + value_of(second)),
            (1 - first * second, 1 - value_of(first) * value_of(second)),
        ):
            assert abs(value_of(found) - wanted) < mpmath.mpf(10) ** -50
        if second.sign():
            assert (first / second * second - first).sign() == 0
    assert (first / fmpq(3, 2) * fmpq(3, 2) - first).sign() == 0


def test_rational_roots_and_floors_over_roots_are_exact() -> None:
    assert rational_root(Fraction(9, 16)) == Fraction(3, 4)
    assert rational_root(Fraction(2)) is None
    for value in (-6, -5, -4, 0, 4, 5, 6):
        assert floor_over_root(Fraction(value), Fraction(4)) == value // 2
        assert floor_over_root(Fraction(value), Fraction(2)) == math.floor(value / math.sqrt(2.0))
    assert Surd.root(fmpz(9)).rational() == 3
    assert Surd.root(fmpz(8)).rational() is None
