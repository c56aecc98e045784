"""What `settle` and `enclose` promise: one target alone, rounded as `evaluate` rounds it; balls that hold the truth."""

from __future__ import annotations

import doctest
import json
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import arb, ctx
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec import structs
from scene_strategies import random_scene, scaled, scene_points
from strategies import image_points, nasty_scenes

from symrender_cg.errors import ArgumentError
from symrender_cg.reference import oracle
from symrender_cg.reference.oracle import rounding, whole
from symrender_cg.reference.oracle.scene import AnyScene
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

CASES: list[dict[str, Any]] = json.loads(Path(__file__).with_name("hardcases.json").read_text())["cases"]
ANSWERED = [case for case in CASES if case["status"] in ("ok", "miss") and case["domain"] == "regular"]


def answers_are_settled(scene: Scene, x: Any, y: Any) -> None:
    answers = oracle.evaluate(scene, x, y)
    rounded: tuple[Any, ...] = (answers.value, answers.value32, answers.value8)
    for target, wanted in zip(oracle.TARGETS, rounded, strict=True):
        found = oracle.settle(scene, x, y, target)
        assert found.dtype == wanted.dtype == np.dtype(target)
        np.testing.assert_array_equal(found, wanted, target)


def test_kept_cases_are_settled_one_target_at_a_time() -> None:
    """All 276 that have an answer, float64, float32 and 8 bit each."""
    assert len(ANSWERED) == 276
    for case in ANSWERED:
        r, e, lx, ly, lz, ka, kd, ks, n = (float.fromhex(number) for number in case["theta"])
        sphere = Sphere((0.0, 0.0, 0.0), r, Phong(ka, kd, ks, n))
        scene = Scene(Camera((0.0, 0.0, e), half_height=1.0), (sphere,), (PointLight((lx, ly, lz)),))
        point = float.fromhex(case["x"]), float.fromhex(case["y"])
        assert float(oracle.settle(scene, *point)).hex() == case["expect"]
        assert float(oracle.settle(scene, *point, "float32")) == float.fromhex(case["f32"])
        assert int(oracle.settle(scene, *point, "uint8")) == case["u8"]


@given(data=st.data())
def test_nasty_scenes_are_settled_as_they_are_evaluated(data: st.DataObject) -> None:
    scene = data.draw(nasty_scenes())
    answers_are_settled(scene, *data.draw(image_points(scene)))


def test_clipping_after_rounding_is_rounding_what_is_clipped() -> None:
    bright = Scene(Camera(), (Sphere(material=Phong(0.25, 2.0, 1.0)),), (PointLight(),), 1.5)
    x, y = np.linspace(-1.2, 1.2, 40), np.linspace(-1.0, 0.9, 40)
    for target in ("float64", "float32"):
        open_ = oracle.settle(bright, x, y, target)
        clipped = oracle.settle(bright, x, y, target, clip=True)
        assert clipped.dtype == open_.dtype
        assert clipped.max() == 1.0 < open_.max()
        np.testing.assert_array_equal(clipped, np.minimum(open_, 1))
    np.testing.assert_array_equal(oracle.settle(bright, x, y, "uint8"), oracle.settle(bright, x, y, "uint8", clip=True))


def test_shapes_are_those_of_the_points_and_one_axis_more_for_colour() -> None:
    grey = Scene(Camera(), (Sphere(),), (PointLight(),), 0.125)
    coloured = structs.replace(grey, background=(0.125, 0.25, 0.5))
    for x, y, shape in ((0.0, 0.1, ()), ([], [], (0,)), ([[0.0, 9.0]], [[0.0], [0.1], [9.0]], (3, 2))):
        for scene, channels in ((grey, ()), (coloured, (3,))):
            wanted = shape + channels
            assert oracle.settle(scene, x, y).shape == oracle.settle(scene, x, y, "uint8").shape == wanted
            balls = oracle.enclose(scene, x, y, bits=60)
            assert balls.middle.shape == balls.radius.shape == wanted
            answers = oracle.evaluate(scene, x, y)
            assert answers.value8.shape == answers.value.shape == wanted
            assert answers.hit.shape == answers.index.shape == shape
    some = oracle.evaluate(coloured, [0.0, 9.0, 0.1], 0.0).at([1, 2])
    assert some.hit.tolist() == [False, True]
    assert some.value.shape == some.value32.shape == (2, 3)


def test_the_session_in_the_document_is_what_is_printed() -> None:
    page = Path(__file__).parent.parent / "docs" / "oracle.md"
    failed, run = doctest.testfile(str(page), module_relative=False)
    assert (failed, run) == (0, 10)


def test_what_no_target_or_ball_is_refused() -> None:
    with pytest.raises(ArgumentError, match="target: 'float16'; expected one of 'float64', 'float32', 'uint8'"):
        oracle.settle(Scene(), 0.0, 0.0, "float16")  # type: ignore[arg-type]
    for bits in (0, 40000, 1.5, True):
        with pytest.raises(ArgumentError, match=r"bits: .*; expected a whole number from 1 to 32768"):
            oracle.enclose(Scene(), 0.0, 0.0, bits=bits)  # type: ignore[arg-type]


# ----------------------------------------------------------------------------------------------------------- balls


def test_narrower_balls_lie_about_the_same_truth() -> None:
    for seed in range(25):
        scene = random_scene(seed)
        x, y = scene_points(scene, 4, seed)
        answers = oracle.evaluate(scene, x, y)
        exact = np.vectorize(Fraction, otypes=[object])
        truth, spare = exact(answers.value) + exact(answers.residual), exact(np.spacing(np.abs(answers.residual)))
        before = None
        for bits in (1, 70, 1000, 4000):
            balls = oracle.enclose(scene, x, y, bits=bits)
            assert (balls.radius <= abs(balls.middle) / 2**bits).all()
            assert (abs(balls.middle - truth) <= balls.radius + spare).all()
            if before is not None:
                assert (abs(balls.middle - before.middle) <= balls.radius + before.radius).all()
            before = balls


# --------------------------------------------------------------------------------------------- rounding, by itself


floats = st.floats(0.0, 2.0, allow_nan=False) | st.floats(0.0, 1e-300) | st.floats(1e37, 1e300)
tiny = st.sampled_from((0.0, 2.0**-1100, -(2.0**-1100), 2.0**-300, -(2.0**-300)))


@given(value=floats, power=st.integers(0, 1200), side=st.sampled_from((-1, 0, 1)), wide=st.booleans())
@example(value=0.5, power=60, side=-1, wide=False)
@example(value=1.0 + 2.0**-24, power=1100, side=1, wide=False)
@example(value=2.0**-150, power=1190, side=1, wide=False)
@example(value=float(np.finfo(np.float32).max) + 2.0**103, power=500, side=-1, wide=False)
def test_each_target_rounds_a_ball_to_what_its_exact_number_rounds_to_or_leaves_it_open(
    value: float, power: int, side: int, wide: bool
) -> None:
    """The value is a float64 and side 2^-power, whose sign alone decides ties; a wide ball may not decide."""
    exact = max(Fraction(value) + side * Fraction(1, 2**power), Fraction(0))
    with ctx.workprec(2600):
        ground, added = arb(value), arb(exact.numerator) / exact.denominator - arb(value)
        if wide:
            added = added + arb(0, 2.0**-60)
        for one in TARGETS:
            of_ball, of_fraction = one.of_ball(ground, added), one.of_fraction(exact)
            if of_ball is None:
                assert wide or one in (rounding.FULL, rounding.FLOAT64)
            elif one is rounding.FLOAT32:
                assert single(of_ball) == single(of_fraction) == nearest_single(exact)
            elif one is rounding.FULL:
                (value64, rest, ball_side, level), (exact64, exact_rest, _, exact_level) = of_ball, of_fraction
                assert (value64, rest, level) == (exact64, exact_rest, exact_level)
                assert single((value64, ball_side)) == nearest_single(exact)
            else:
                assert of_ball == of_fraction
    assert rounding.UINT8.of_fraction(exact) == math.floor(255 * min(exact, Fraction(1)) + Fraction(1, 2))


TARGETS: tuple[rounding.Rounding[Any], ...] = (rounding.FULL, rounding.FLOAT64, rounding.FLOAT32, rounding.UINT8)


def single(value_and_side: Any) -> float:
    value, side = value_and_side
    return float(rounding.to_float32(np.array([value]), np.array([side], dtype=np.int8))[0])


def nearest_single(exact: Fraction) -> float:
    """By distance among three neighbours, the even one of two equally near; infinite from the last middle on."""
    if exact >= Fraction(2) ** 128 - Fraction(2) ** 103:
        return math.inf
    with np.errstate(all="ignore"):
        near = np.float32(min(float(exact), float(np.finfo(np.float32).max)))
        around = [np.nextafter(near, np.float32(0)), near, np.nextafter(near, np.float32(np.inf))]
    finite = [float(one) for one in around if np.isfinite(one)]
    return min(finite, key=lambda one: (abs(Fraction(one) - exact), np.float32(one).view(np.uint32) & 1))


@given(value=floats)
def test_only_odd_halves_of_a_last_place_are_float32_ties(value: float) -> None:
    if value >= 2.0**128:
        return
    up, down = (float(rounding.to_float32(np.array([value]), np.array([side], dtype=np.int8))[0]) for side in (1, -1))
    assert rounding.is_float32_tie(value) == (up != down)
    with np.errstate(all="ignore"):
        low = np.float32(value)
        middle = (float(low) + float(np.nextafter(low, np.float32(np.inf)))) / 2.0
    assert rounding.is_float32_tie(middle) or middle >= 2.0**128


# ------------------------------------------------------------------------------------------- what is left out unasked


@pytest.mark.parametrize("k", [0, -400, 400])
def test_spheres_that_float64_rules_out_change_nothing(k: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """250 scenes with the float64 test made to run for each, and without it: equal in all digits."""
    for seed in range(250 if k == 0 else 40):
        scene = random_scene(seed).in_camera_frame()
        x, y = scene_points(scene, 6, seed)
        scene, x, y = scaled(scene, k), np.ldexp(x, k), np.ldexp(y, k)
        with monkeypatch.context() as patch:
            patch.setattr(whole, "FEW", 0)
            with_near = AnyScene(scene)
        assert (with_near.world.near is None) == (not scene.spheres)
        without = AnyScene(scene)
        without.world.near = None
        assert with_near.answers(x, y, rounding.FULL) == without.answers(x, y, rounding.FULL)
        assert with_near.seen(x, y) == without.seen(x, y)


def test_float64_rules_most_spheres_out() -> None:
    scene = Scene.builtin("hundred").in_camera_frame()
    world = AnyScene(scene).world
    assert world.near is not None
    origin = tuple(world.eye)
    kept = world.near.of_ray((origin[0], origin[1], origin[2]), (0, 0, -1))
    assert len(kept) < 10
    assert kept == sorted(kept)
