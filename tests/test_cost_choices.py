"""Laws of the choices beside the levels: each is another kernel, has a name, compiles, and draws the same scene."""

from __future__ import annotations

import math

import numpy as np
import pytest

from symrender_cg import Scene, evaluate, translate
from symrender_cg.cost.sample import Sample, draw_sample, errors_of
from symrender_cg.cost.variants import Way, baked, combined, content, moved, named_ways, way_of
from symrender_cg.errors import ArgumentError
from symrender_cg.lower.choices import CHOICES, UNSTATED, chosen, named
from symrender_cg.lower.variants import ACCURACIES, VARIANTS, variant

SIZE = (64, 64)
LEVELS = [entry.name for entry in VARIANTS]
MOVES = [(level, entry.name) for level in LEVELS for entry in CHOICES if chosen(level, entry.name) is not None]

LARGEST = {
    "double_libm": 5e-13,
    "double_unsettled": 1e-7,
    "double_tested": 5e-15,
    "double_complement": 5e-13,
    "double_inner": 5e-13,
    "double_fused": 5e-15,
    "double_whole": 5e-15,
    "double_lopsided": 5e-15,
    "single_narrow": 1e-2,
    "single_inner": 5e-4,
    "single_fused": 5e-6,
    "fast_own": 5e-4,
    "fast_coarse": 5e-3,
    "fast_inner": 5e-3,
    "fast_fused": 5e-4,
    "literal_lagrange": 1e-6,
}
"""Far above the errors seen: a choice that draws another image is found out, not one that rounds otherwise."""


@pytest.fixture(scope="module")
def sample() -> Sample:
    return draw_sample(Scene.chapter1(), SIZE, 400, 60, 5)


@pytest.mark.parametrize(("level", "move"), MOVES)
def test_every_choice_changes_the_variant_and_promises_nothing(level: str, move: str) -> None:
    found = chosen(level, move)
    assert found is not None
    assert found.name == f"{level}_{move}"
    assert found.promise == UNSTATED
    assert found.key != variant(level).key
    assert variant(found.name) == found


def test_a_choice_that_is_made_already_is_none() -> None:
    assert chosen("double", "fused", "fused") is None
    assert chosen("double", "own") is None
    assert chosen("double", "narrow") is None
    assert named("double_gold") is None
    assert named("gold_fused") is None
    with pytest.raises(ArgumentError, match="accuracy: 'double_gold' is not known"):
        variant("double_gold")


def test_levels_that_prove_their_values_have_no_choices() -> None:
    assert all(chosen("stable", entry.name) is None for entry in CHOICES)


def test_no_level_has_the_name_of_a_choice() -> None:
    assert all(named(name) is None for name in (*ACCURACIES, "certified_float32", "certified_uint8") if "_" in name)


@pytest.mark.parametrize("name", LARGEST)
def test_every_choice_draws_the_scene(name: str, sample: Sample) -> None:
    way = way_of(name)

    def field(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return evaluate(Scene.chapter1(), x, y, accuracy=way.accuracy)

    errors = errors_of(field, sample)
    assert errors.largest <= LARGEST[name]
    assert errors.nonfinite == 0
    assert errors.right8 > 0.98
    assert (errors.flips == 0) == variant(name).exact


def test_the_coarse_power_is_off_by_less_than_its_header_says() -> None:
    """k_s times the error of the power, over cosines and exponents."""
    scene = Scene.chapter1(ambient=0.0, diffuse=0.0, specular=1.0)
    for shininess in (1.0, 2.5, 32.0, 200.0):
        one = Scene.chapter1(ambient=0.0, diffuse=0.0, specular=1.0, shininess=shininess)
        errors = errors_of(
            lambda x, y, one=one: evaluate(one, x, y, accuracy="fast_coarse"), draw_sample(one, SIZE, 500, 60, 3)
        )
        assert 1e-4 < errors.largest < 0.003
    assert variant("fast_coarse").functions == "coarse"
    assert "coarse_power.h" in translate(scene, "fast_coarse").emitted.files


def test_a_fused_kernel_is_compiled_with_contraction_and_no_other_is() -> None:
    flagged = {name for name in LARGEST if variant(name).flags}
    assert flagged == {"double_fused", "single_fused", "fast_fused"}
    assert variant("double_fused").flags == ("-ffp-contract=fast",)
    fused = translate(Scene.chapter1(), "double_fused").emitted
    plain = translate(Scene.chapter1(), "double").emitted
    assert fused.operations == plain.operations


def test_of_chapter_1_there_are_at_least_twenty_ways_of_every_kind() -> None:
    ways = named_ways(Scene.chapter1(), SIZE)
    moves = [one for way in ways for one in moved(way, Scene.chapter1(), SIZE)]
    assert len({content(way) for way in (*ways, *moves)}) >= 40
    kinds = {way.kind for way in (*ways, *moves)}
    assert kinds == {"level", "choice", "baked", "general", "reference", "samples"}
    assert {way.maker for way in ways} == {"native", "numpy", "lambdify"}


def test_scenes_of_many_spheres_have_their_own_ways() -> None:
    ways = {way.name for way in named_ways(Scene.builtin("mirrors"), SIZE)}
    assert {"fast", "single", "double", "stable", "double unplanned", "double -0.01", "numpy", "double 2x2"} <= ways
    assert not {"literal", "double baked", "lambdify"} & ways
    moves = {one.name for one in moved(way_of("double"), Scene.builtin("mirrors"), SIZE)}
    assert "double_fused" in moves
    assert "double_tested" not in moves


def test_moves_are_combined_where_they_are_of_different_coordinates() -> None:
    found = combined((way_of("double_fused"), way_of("double_complement")))
    assert found is not None
    assert found.name == "double_complement_fused"
    assert combined((way_of("fast_coarse"), way_of("fast_own"))) is None
    assert combined((way_of("fast_fused"), way_of("double_fused"))) is None


def test_what_proves_its_values_is_not_baked() -> None:
    stable = Way("stable", "level", "", "stable")
    assert baked(stable) is None
    assert baked(way_of("double_fused")) is not None
    assert math.isclose(way_of("double").tolerance, 0.0)
