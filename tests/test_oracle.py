"""The oracle against answers computed elsewhere, against mpmath, and against the laws that a true value obeys."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from flint import ctx
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import image_points, nasty_scenes, scaled

from symrender_cg.errors import ArgumentError, SceneError
from symrender_cg.reference import camera_numbers, hard_places, oracle, points
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

CASES: list[dict[str, Any]] = json.loads(Path(__file__).with_name("hardcases.json").read_text())["cases"]
ANSWERED = [case for case in CASES if case["status"] in ("ok", "miss") and case["domain"] == "regular"]

# In these the kept residual is what a ball of finite precision had left, not I - expect to 53 bits; each is checked by
# mpmath in test_residuals_that_differ_from_the_kept_ones_are_right. The kept value and float32 value are right in all.
ROUGH_RESIDUALS = frozenset(
    {
        "light_at_hit-PUB1-4",
        "light_behind-PUB1-2",
        "highlight_exact-PUB1-0",
        "highlight_exact-PUB1-1",
        "highlight_exact-PUB1-2",
        "highlight_exact-PUB1-3",
        "highlight_exact-PUB1-7",
        "highlight_exact-PUB1-9",
        "highlight_exact-PUB1-10",
        "n_huge-PUB1-3",
    }
)


def scene_of(case: dict[str, Any]) -> Scene:
    r, e, lx, ly, lz, ka, kd, ks, n = (float.fromhex(number) for number in case["theta"])
    sphere = Sphere((0.0, 0.0, 0.0), r, Phong(ka, kd, ks, n))
    return Scene(Camera((0.0, 0.0, e), half_height=1.0), (sphere,), (PointLight((lx, ly, lz)),))


def point_of(case: dict[str, Any]) -> tuple[float, float]:
    return float.fromhex(case["x"]), float.fromhex(case["y"])


def by_mpmath(scene: Scene, x: float, y: float, digits: int) -> mpmath.mpf | None:
    """Chapter 1's formula as it stands at `digits` digits; None for a miss."""
    f = camera_numbers.frame_numbers(scene)
    with mpmath.workdps(digits):
        eye, ray = mpmath.matrix([0, 0, f.eye]), mpmath.matrix([x, y, -f.eye])
        center, light, radius = mpmath.matrix(f.center), mpmath.matrix(f.light), mpmath.mpf(f.radius)

        def dot(a: mpmath.matrix, b: mpmath.matrix) -> mpmath.mpf:
            return mpmath.fsum(a[i] * b[i] for i in range(3))

        a, b = dot(ray, ray), dot(eye - center, ray)
        disc = b * b - a * (dot(eye - center, eye - center) - radius * radius)
        if disc < 0 or b > 0:
            return None
        hit = eye + (-b - mpmath.sqrt(disc)) / a * ray
        n = (hit - center) / radius
        w = light - hit
        w = w / mpmath.sqrt(dot(w, w))
        v = (eye - hit) / mpmath.sqrt(dot(eye - hit, eye - hit))
        n_dot_l = dot(n, w)
        r_dot_v = dot(2 * n_dot_l * n - w, v)
        specular = mpmath.mpf(f.specular) * max(mpmath.mpf(0), r_dot_v) ** mpmath.mpf(f.shininess)
        if f.gate_specular and n_dot_l <= 0:
            specular = mpmath.mpf(0)
        return f.ambient + mpmath.mpf(f.intensity) * (mpmath.mpf(f.diffuse) * max(mpmath.mpf(0), n_dot_l) + specular)


# ------------------------------------------------------------------------------------------------- the kept cases


@pytest.mark.parametrize("family", sorted({case["family"] for case in ANSWERED}))
def test_kept_answers_are_the_oracle_s_bit_for_bit(family: str) -> None:
    cases = [case for case in ANSWERED if case["family"] == family]
    assert cases
    for case in cases:
        answers = oracle.evaluate(scene_of(case), *point_of(case))
        assert bool(answers.hit) == (case["status"] == "ok"), case["id"]
        assert float(answers.value).hex() == case["expect"], case["id"]
        assert float(answers.value32) == float.fromhex(case["f32"]), case["id"]
        assert int(answers.value8) == case["u8"], case["id"]
        if case["id"] not in ROUGH_RESIDUALS:
            assert float(answers.residual) == float.fromhex(case["residual"]), case["id"]
        exact = Fraction(float(answers.value)) + Fraction(float(answers.residual))
        assert math.floor(255 * min(max(exact, Fraction(0)), Fraction(1)) + Fraction(1, 2)) == case["u8"], case["id"]


def test_residuals_that_differ_from_the_kept_ones_are_right() -> None:
    rough = [case for case in ANSWERED if case["id"] in ROUGH_RESIDUALS]
    assert len(rough) == len(ROUGH_RESIDUALS)
    for case in rough:
        answers = oracle.evaluate(scene_of(case), *point_of(case))
        truth = by_mpmath(scene_of(case), *point_of(case), digits=1300)
        assert truth is not None
        with mpmath.workdps(1300):
            rest = float(truth - mpmath.mpf(float(answers.value)))
        assert float(answers.residual) == rest != float.fromhex(case["residual"]), case["id"]
        assert abs(rest - float.fromhex(case["residual"])) < 2.0**-120, case["id"]


def test_kept_cases_without_a_meaning_are_refused() -> None:
    refused = [case for case in CASES if case["status"].startswith("invalid") or case["domain"] == "continuation"]
    assert {case["family"] for case in refused} == {"invalid", "eye_in", "R0"}
    assert len(refused) == 12 + 12 + 6
    for case in refused:
        with pytest.raises((SceneError, ArgumentError)):  # ArgumentError: one case has its infinity in x
            oracle.evaluate(scene_of(case), *point_of(case))


def test_every_kept_case_is_answered_refused_or_has_its_light_at_the_hit_point() -> None:
    at_light = [case for case in CASES if case["status"] == "undefined:w=0"]
    assert len(ANSWERED) + 30 + len(at_light) == len(CASES) == 312
    for case in at_light:
        answers = oracle.evaluate(scene_of(case), *point_of(case))
        assert bool(answers.hit)
        assert float(answers.value) == float.fromhex(case["theta"][5]), "a light at the hit point adds nothing"


# -------------------------------------------------------------------------------------------------------- mpmath


def random_scene(random: np.random.Generator) -> Scene:
    radius = float(random.uniform(0.3, 2.0))
    e = float(random.uniform(1.0, 9.0))
    center = np.array([*random.uniform(-1.5, 1.5, 2), e - radius * random.uniform(1.5, 9.0)])
    direction = random.normal(size=3)
    light = center + direction / np.linalg.norm(direction) * radius * 10.0 ** random.uniform(-1.0, 2.0)
    material = Phong(
        float(random.choice([0.0, 0.1])), 0.7, 0.5, float(random.choice([0.5, 3, 32, 500])), bool(random.integers(2))
    )
    return Scene(
        Camera((0.0, 0.0, e), half_height=3.0),
        (Sphere(tuple(map(float, center)), radius, material),),
        (PointLight(tuple(map(float, light)), float(random.uniform(0.1, 3.0))),),
        0.25,
    )


def test_off_axis_values_are_mpmath_s_at_120_digits() -> None:
    random = np.random.default_rng(1)
    hits = 0
    for index in range(40):
        scene = random_scene(random)
        x, y = (
            np.concatenate(parts)
            for parts in zip(
                hard_places.near_silhouette(scene, 6, index),
                hard_places.near_terminator(scene, 6, index),
                hard_places.near_highlight(scene, 4, index),
                random.uniform(-3.0, 3.0, (2, 6)),
                strict=True,
            )
        )
        answers = oracle.evaluate(scene, x, y)
        for i in range(x.size):
            truth = by_mpmath(scene, float(x[i]), float(y[i]), digits=120)
            assert (truth is not None) == answers.hit[i]
            if truth is None:
                assert answers.value[i] == answers.value32[i] == 0.25
                continue
            hits += 1
            with mpmath.workdps(120):
                assert float(truth) == answers.value[i]
                assert float(truth - mpmath.mpf(float(answers.value[i]))) == answers.residual[i]
                nearest = answers.value32[i]
                for side in (-np.inf, np.inf):
                    other = mpmath.mpf(float(np.nextafter(nearest, np.float32(side))))
                    assert abs(truth - mpmath.mpf(float(nearest))) <= abs(truth - other)
    assert hits > 300


# ----------------------------------------------------------------------------------------------------------- laws


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_enclosures_contain_the_answer_and_hits_are_the_same(data: st.DataObject) -> None:
    scene = data.draw(nasty_scenes())
    x, y = data.draw(image_points(scene))
    answers = oracle.evaluate(scene, x, y)
    assert answers.hit == oracle.hits(scene, x, y)
    balls = oracle.enclose(scene, x, y, bits=300)
    middle, radius = balls.middle.item(), balls.radius.item()
    assert radius <= abs(middle) / 2**300
    distance = abs(middle - Fraction(float(answers.value)) - Fraction(float(answers.residual)))
    assert distance - radius <= Fraction(math.ulp(float(answers.residual)) if answers.residual else 2.0**-1074)
    assert abs(float(answers.residual)) <= 0.5 * math.ulp(float(answers.value))


@settings(max_examples=40, deadline=None)
@given(data=st.data(), k=st.sampled_from((-500, -60, 1, 500)))
def test_scaling_all_lengths_by_a_power_of_two_changes_nothing(data: st.DataObject, k: int) -> None:
    scene = Scene(
        Camera((0.0, 0.0, 4.0), half_height=1.5),
        (Sphere((0.25, -0.5, 0.125), 1.0, Phong(0.1, 0.7, 0.5, 37.5)),),
        (PointLight((data.draw(st.floats(-9.0, 9.0).filter(lambda v: v == 0 or abs(v) > 1e-9)), 2.0, 3.0)),),
    )
    x, y = hard_places.near_silhouette(scene, 12, 3)
    x, y = np.append(x, np.linspace(-1.0, 1.0, 8)), np.append(y, np.linspace(0.5, -0.25, 8))
    here, there = oracle.evaluate(scene, x, y), oracle.evaluate(scaled(scene, k), np.ldexp(x, k), np.ldexp(y, k))
    for name in ("value", "residual", "hit", "value32"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))


def test_tangency_is_a_hit_and_its_outer_neighbour_a_miss() -> None:
    scene = Scene(Camera((0.0, 0.0, 5.0), half_height=5.0), (Sphere((0.0, 0.0, 0.0), 3.0),))
    x = np.array([3.75, math.nextafter(3.75, 4.0), math.nextafter(3.75, 3.0), -3.75, 2.25])
    y = np.array([0.0, 0.0, 0.0, 0.0, 3.0])
    assert oracle.hits(scene, x, y).tolist() == [True, False, True, True, True]
    assert not oracle.hits(scene, 2.25, math.nextafter(3.0, 4.0))


def test_a_sphere_behind_the_eye_is_never_hit() -> None:
    behind = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (Sphere((0.0, 0.0, 8.0), 1.0),))
    assert not oracle.hits(behind, [0.0, 0.1], [0.0, 0.2]).any()


def headlight(ambient: float, diffuse: float, specular: float, shininess: float) -> Scene:
    """Eye and light on the axis: at (0, 0) n.l = r.v = 1 exactly."""
    material = Phong(ambient, diffuse, specular, shininess)
    return Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (Sphere(material=material),), (PointLight((0.0, 0.0, 9.0)),))


@pytest.mark.parametrize("shininess", [1.0, 37.5, 1e300])
def test_exact_ties_of_float64_go_to_even(shininess: float) -> None:
    down = oracle.evaluate(headlight(1.0, 2.0**-54, 2.0**-54, shininess), 0.0, 0.0)
    assert (float(down.value), float(down.residual)) == (1.0, 2.0**-53)
    up = oracle.evaluate(headlight(1.0 + 2.0**-52, 2.0**-54, 2.0**-54, shininess), 0.0, 0.0)
    assert (float(up.value), float(up.residual)) == (1.0 + 2.0**-51, -(2.0**-53))


def test_float32_is_rounded_once_not_through_float64() -> None:
    tie = 1.0 + 2.0**-24
    assert float(oracle.evaluate(headlight(tie, 0.0, 0.0, 1.0), 0.0, 0.0).value32) == 1.0
    above = oracle.evaluate(headlight(tie, 0.0, 2.0**-1074, 1.0), 0.0, 0.0)
    assert (float(above.value), float(above.residual), float(above.value32)) == (tie, 2.0**-1074, 1.0 + 2.0**-23)
    too_small_for_a_residual = oracle.evaluate(headlight(tie, 0.0, 0.5, 1e9), 1e-2, 0.0)
    assert float(too_small_for_a_residual.residual) == 0.0
    assert float(too_small_for_a_residual.value32) == 1.0 + 2.0**-23


def test_an_irrational_value_within_2_to_the_minus_1000_of_a_tie_is_decided() -> None:
    scene = headlight(1.0, 2.0**-53, 0.0, 1.0)
    answers = oracle.evaluate(scene, 2.0**-500, 0.0)
    assert float(answers.value) == 1.0, "n.l is below 1 by about 2^-1000"
    above = oracle.evaluate(headlight(1.0 + 2.0**-52, 2.0**-53, 0.0, 1.0), 2.0**-500, 0.0)
    assert float(above.value) == 1.0 + 2.0**-52


def test_gating_removes_the_highlight_where_n_dot_l_is_not_positive() -> None:
    material = Phong(0.0, 0.0, 1.0, 1.0)
    light = (PointLight((0.0, 3.0, -6.0)),)
    ungated = Scene(Camera(), (Sphere(material=material),), light)
    gated = Scene(Camera(), (Sphere(material=Phong(0.0, 0.0, 1.0, 1.0, gate_specular=True)),), light)
    x, y = points.whole_image(ungated, 32, 32)
    lit = oracle.evaluate(Scene(Camera(), (Sphere(material=Phong(0.0, 1.0, 0.0)),), light), x, y).value > 0.0
    open_, closed = oracle.evaluate(ungated, x, y).value, oracle.evaluate(gated, x, y).value
    assert (open_[~lit] > 0.0).sum() > 10
    np.testing.assert_array_equal(closed, np.where(lit, open_, 0.0))


def test_shininess_zero_adds_the_whole_specular_term_wherever_the_light_acts() -> None:
    scene = Scene(Camera(), (Sphere(material=Phong(0.25, 0.0, 0.5, 0.0)),), (PointLight((0.0, 0.0, -9.0)),))
    assert float(oracle.evaluate(scene, 0.1, 0.2).value) == 0.75


def test_answers_have_the_broadcast_shape_and_misses_the_background() -> None:
    scene = Scene(background=0.125)
    answers = oracle.evaluate(scene, [[0.0, 9.0]], [[0.0], [0.1], [9.0]])
    assert answers.value.shape == answers.residual.shape == answers.hit.shape == answers.value32.shape == (3, 2)
    assert answers.hit.tolist() == [[True, False], [True, False], [False, False]]
    assert set(answers.value[~answers.hit].tolist()) == {0.125}
    assert oracle.evaluate(scene, [], []).value.shape == (0,)


def test_scenes_and_points_that_have_no_answer_are_refused() -> None:
    with pytest.raises(ArgumentError, match="y: holds NaN or infinity"):
        oracle.evaluate(Scene(), 0.0, math.nan)
    with pytest.raises(ArgumentError, match="do not broadcast"):
        oracle.evaluate(Scene(), [0.0, 1.0], [0.0, 1.0, 2.0])
    with pytest.raises(ArgumentError, match="x: dtype complex128"):
        oracle.evaluate(Scene(), 1j, 0.0)


def test_the_precision_of_python_flint_is_left_as_it_was() -> None:
    before = ctx.prec
    oracle.evaluate(Scene(), 0.0, 0.0)
    oracle.enclose(Scene(), 0.0, 0.0, bits=500)
    hard_places.near_highlight(Scene(), 3, 0)
    assert ctx.prec == before
