"""evaluate(..., with_bound=True): no value of any level is farther from the truth than the bound beside it."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from evaluators import STRUCTURES, THOROUGH, same_bits, square_of_points
from scene_strategies import random_scene, scene_points

from symrender_cg import evaluate
from symrender_cg.errors import AccuracyError, OutsidePlanError
from symrender_cg.lower.variants import ACCURACIES, TARGETS
from symrender_cg.pipeline import planned
from symrender_cg.reference import oracle
from symrender_cg.run.bounds import error_bounds
from symrender_cg.scene import Scene
from symrender_cg.stress.families import FAMILIES

LEVELS = (
    *((name, None) for name in ACCURACIES if name != "certified"),
    *(("certified", target) for target in TARGETS),
)
EXACT = [entry for entry in LEVELS if entry[0] != "literal"]
CASES = 60 if THOROUGH else 4
SEEDS = range(200 if THOROUGH else 3)
PLANS = {"centred_sphere", "centred_sphere_gated", "any_sphere"}
"""Plans that are looked at, unless thorough: each costs the kernels of all levels."""
Floats = npt.NDArray[np.float64]


def as_intensity(value: Any) -> Fraction:
    return Fraction(int(value), 255) if isinstance(value, np.uint8) else Fraction(float(value))


def distances(values: npt.NDArray[Any], true: oracle.Answers) -> list[tuple[Fraction, Fraction]]:
    """|value - true value|, and how far the oracle's own two words may be from the truth."""
    found = []
    for value, near, residual in zip(values.ravel(), true.value.ravel(), true.residual.ravel(), strict=True):
        exact = Fraction(float(near)) + Fraction(float(residual))
        found.append((abs(as_intensity(value) - exact), abs(Fraction(float(residual))) / 2**52))
    return found


def check(scene: Scene, x: Floats, y: Floats, levels: list[tuple[str, str | None]]) -> dict[str, list[float]]:
    """No bound is broken; ratios of bound to error by level, where both are more than 0 and finite."""
    ratios: dict[str, list[float]] = {}
    true = oracle.evaluate(scene, x, y)
    for level, target in levels:
        values, bounds = evaluate(scene, x, y, accuracy=level, target=target, with_bound=True)
        assert bounds.shape == values.shape == true.value.shape
        assert bounds.dtype == np.float64
        assert not np.isnan(bounds).any()
        assert same_bits(values, evaluate(scene, x, y, accuracy=level, target=target))
        for k, (distance, slack) in enumerate(distances(values, true)):
            bound = float(bounds.ravel()[k])
            if bound == math.inf:
                continue
            where = f"{level} {target} at {x[k // scene.channels]!r}, {y[k // scene.channels]!r}"
            assert distance <= Fraction(bound) + slack, f"{where}: off {float(distance)}, bound {bound}, {scene}"
            if distance > 4 * slack and distance > Fraction(1, 2**900):
                ratios.setdefault(level, []).append(bound / float(distance))
    return ratios


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_no_bound_is_broken_in_a_family_of_hard_cases(family: Any) -> None:
    for case in family.cases(29, CASES):
        if case.refused or case.scene is None:
            continue
        x, y = np.array([case.x, case.x]), np.array([case.y, 0.5 * case.y])
        try:
            plan = planned(case.scene)
            if THOROUGH or plan.name in PLANS:
                check(case.scene, x, y, list(LEVELS if plan.arrangement is None else EXACT))
        except (AccuracyError, OutsidePlanError):
            continue


def test_no_bound_is_broken_in_scenes_of_any_kind() -> None:
    looked = 0
    for seed in SEEDS:
        scene = random_scene(seed)
        x, y = scene_points(scene, 6, seed)
        try:
            check(scene, x, y, [entry for entry in EXACT if THOROUGH or entry in (("double", None), ("stable", None))])
        except AccuracyError:
            continue
        looked += 1
    assert looked > len(SEEDS) // 2


@pytest.mark.parametrize("name", ["centred_sphere", "any_sphere"])
def test_bounds_of_double_and_stable_are_less_than_ten_times_the_error(name: str) -> None:
    scene = STRUCTURES[name]
    ratios = check(scene, *square_of_points(scene, 20), [("double", None), ("stable", None), ("single", None)])
    for level, found in ratios.items():
        median = float(np.median(found))
        print(f"{name} {level}: bound / error, median {median:.4f}, largest {max(found):.3g} of {len(found)}")
        assert median < 10.0
    assert len(ratios["double"]) > 60


def test_a_bound_of_0_says_that_the_value_is_the_truth() -> None:
    scene = Scene.chapter1()
    values, bounds = evaluate(scene, [0.0, 1.2], [0.0, 1.2], with_bound=True, accuracy="certified")
    assert bounds[1] == 0.0
    assert values[1] == 0.0
    assert 0.0 < bounds[0] < 2.0**-52


def test_bounds_are_of_the_values_given_whoever_computed_them() -> None:
    """A value that is off by 1e-3 has a bound a little above 1e-3."""
    scene = Scene.chapter1()
    x, y = square_of_points(scene, 8)
    true = oracle.evaluate(scene, x, y)
    off = error_bounds(scene, true.value + 1e-3, x, y)
    assert (off >= 1e-3 * (1.0 - 1e-12)).all()
    assert (off <= 1e-3 * (1.0 + 1e-9)).all()


def test_clipping_moves_no_value_farther_from_the_clipped_truth() -> None:
    scene = Scene.chapter1()
    x, y = square_of_points(scene, 16)
    free, bounds = evaluate(scene, x, y, with_bound=True)
    cut, bounds_of_cut = evaluate(scene, x, y, with_bound=True, clip=True)
    assert free.max() > 1.0
    assert same_bits(cut, np.clip(free, 0.0, 1.0))
    assert same_bits(bounds, bounds_of_cut)


def test_points_of_any_shape_and_colour_have_bounds_of_the_shape_of_the_values() -> None:
    colour = Scene.builtin("lights")
    assert colour.channels == 3
    values, bounds = evaluate(colour, np.zeros((2, 1)), np.linspace(-0.1, 0.1, 3), with_bound=True)
    assert values.shape == bounds.shape == (2, 3, 3)
    value, bound = evaluate(Scene.chapter1(), 0.1, 0.2, with_bound=True)
    assert value.shape == bound.shape == ()
    none, no_bounds = evaluate(Scene.chapter1(), [], [], with_bound=True)
    assert none.shape == no_bounds.shape == (0,)
