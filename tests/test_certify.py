"""Certified and stable values: the oracle's own rounding everywhere, certificates that add up, errors naming pixels."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from c_harness import compile_c
from evaluators import STRUCTURES, THOROUGH, same_bits, square_of_points
from scene_strategies import random_scene, scene_points

from symrender_cg import certify, evaluate, render_image
from symrender_cg.errors import AccuracyError, ArgumentError, OutsidePlanError
from symrender_cg.pipeline import pixel_size, planned
from symrender_cg.reference import oracle
from symrender_cg.run.certificate import Certificate, Stage
from symrender_cg.run.enclosure_kernel import RULES as BY_RULE
from symrender_cg.run.enclosure_kernel import EnclosureKernel, SettledPoints
from symrender_cg.run.grid import pixel_centres
from symrender_cg.scene import Phong, PointLight, Scene, Sphere
from symrender_cg.stress.families import FAMILIES

TARGETS = oracle.TARGETS

SIDE = 32
CASES = 100 if THOROUGH else 6
SEEDS = range(300 if THOROUGH else 5)
PLANS = {"centred_sphere", "centred_sphere_gated", "any_sphere"}
"""Plans of which all cases are looked at; of others the first of a family, unless thorough: each costs kernels."""
RULES = {"float64": np.float64, "float32": np.float32, "uint8": np.uint8}


def pixels(scene: Scene, width: int, height: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    columns, rows = pixel_centres(width, height, pixel_size(scene.in_camera_frame(), height))
    x, y = np.meshgrid(columns, rows)
    return x, y


# ------------------------------------------------------------------------------------------------------------ images


@pytest.mark.parametrize("name", Scene.builtin_names())
def test_each_pixel_of_a_built_in_scene_is_the_rounding_of_the_truth(name: str) -> None:
    scene = Scene.builtin(name)
    x, y = pixels(scene, SIDE, SIDE)
    true = oracle.evaluate(scene, x, y)
    answers = {"float64": true.value, "float32": true.value32, "uint8": true.value8}
    for target in TARGETS:
        found = certify(scene, SIDE, SIDE, target=target, clip=False)
        assert same_bits(found.values, np.ascontiguousarray(answers[target]))
        assert_adds_up(found.certificate, SIDE * SIDE)
    stable = render_image(scene, SIDE, SIDE, accuracy="stable", clip=False)
    assert_within_four_ulp(stable, true, name)


def assert_adds_up(certificate: Certificate, points: int) -> None:
    names = [stage.name for stage in certificate.stages]
    assert certificate.points == points
    assert sum(stage.settled for stage in certificate.stages) == points
    assert names == [name for name in ("kernel", "enclosure", "oracle") if name in names]
    assert all(stage.settled >= 0 and stage.bound >= 0.0 for stage in certificate.stages)
    assert all(math.isfinite(stage.bound) for stage in certificate.stages if stage.settled)
    assert certificate.bound == max((s.bound for s in certificate.stages if s.settled), default=0.0)


def assert_within_four_ulp(values: npt.NDArray[Any], true: oracle.Answers, where: str) -> None:
    """|value - truth| <= 4 ulp of the truth; 0 where the truth is 0."""
    zeros = (true.value == 0.0) & (true.residual == 0.0)
    assert (values[zeros] == 0.0).all(), where
    assert not (values[~zeros & (true.value != 0.0)] == 0.0).any(), where
    with np.errstate(over="ignore"):
        ulp = np.abs(np.spacing(true.value))
    away = np.abs((values - true.value) - true.residual)
    assert (away <= 4.0 * ulp).all(), f"{where}: {float((away / ulp).max())} ulp"


def test_the_first_stage_settles_nearly_all_of_chapter_1_and_the_second_most_of_the_rest() -> None:
    for target, most in (("float64", 0.02), ("float32", 0.02), ("uint8", 0.02)):
        found = certify(Scene.chapter1(), 96, 96, target=target).certificate
        by_name = {stage.name: stage for stage in found.stages}
        assert by_name["kernel"].settled >= (1.0 - most) * found.points
        assert by_name.get("oracle", Stage("oracle", 0, 0.0)).settled <= 4


def test_a_frame_of_more_columns_than_rows_and_any_threads_gives_the_same_certified_image() -> None:
    for target in TARGETS:
        images = [certify("off_axis", 41, 17, target=target, threads=threads).values for threads in (1, 2, 5)]
        scene = Scene.builtin("off_axis")
        true = oracle.settle(scene, *pixels(scene, 41, 17), target, clip=True)
        for image in images:
            assert same_bits(image, np.ascontiguousarray(true))


def test_points_are_settled_as_pixels_are() -> None:
    for name in ("chapter1", "lights"):
        scene = Scene.builtin(name)
        x, y = pixels(scene, 12, 12)
        for target in TARGETS:
            values = evaluate(scene, x, y, accuracy="certified", target=target, clip=True)
            assert same_bits(np.ascontiguousarray(values), certify(scene, 12, 12, target=target).values)
            lines = render_image(scene, 12, 12, accuracy="certified", target=target)
            assert same_bits(np.ascontiguousarray(lines), certify(scene, 12, 12, target=target).values)
        none = evaluate(scene, [], [], accuracy="certified")
        assert none.shape == ((0,) if scene.channels == 1 else (0, 3))


# -------------------------------------------------------------------------------------------------------- hard cases


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_hard_points_are_rounded_as_the_oracle_rounds_them(family: Any) -> None:
    """Every target, and within 4 ulp for stable."""
    for case in family.cases(31, CASES):
        if case.refused or case.scene is None:
            continue
        x, y = np.array([case.x, case.x]), np.array([case.y, case.y * (1.0 + 2.0**-40)])
        finite = np.isfinite(x) & np.isfinite(y)
        x, y = x[finite], y[finite]
        few = (*TARGETS, "stable") if THOROUGH or case.number < 2 else ("float64", "stable")
        try:
            if case.number > 0 and not THOROUGH and planned(case.scene).name not in PLANS:
                continue
            true = oracle.evaluate(case.scene, x, y)
            found = {target: values_of(case.scene, x, y, target) for target in few}
        except (AccuracyError, OutsidePlanError):
            continue
        assert_within_four_ulp(found["stable"], true, case.name)
        answers = {"float64": true.value, "float32": true.value32, "uint8": true.value8}
        for target in few:
            if target != "stable":
                assert same_bits(found[target], np.asarray(answers[target])), f"{case.name} {target}: {found[target]}"


def values_of(scene: Scene, x: Any, y: Any, target: str) -> npt.NDArray[Any]:
    if target == "stable":
        return np.asarray(evaluate(scene, x, y, accuracy="stable"))
    return np.ascontiguousarray(evaluate(scene, x, y, accuracy="certified", target=target))


def test_stable_is_within_four_ulp_in_scenes_of_any_kind() -> None:
    looked = 0
    for seed in SEEDS:
        scene = random_scene(seed + 700)
        x, y = scene_points(scene, 40, seed)
        try:
            true = oracle.evaluate(scene, x, y)
            values = evaluate(scene, x, y, accuracy="stable")
            certified = evaluate(scene, x, y, accuracy="certified")
        except AccuracyError:
            continue
        assert_within_four_ulp(values, true, f"seed {seed + 700}")
        assert same_bits(np.ascontiguousarray(certified), true.value)
        looked += 1
    assert looked > len(SEEDS) // 2


# -------------------------------------------------------------------------------------------------------- grey levels


@pytest.mark.parametrize("ambient", [0.1, 0.3, 0.5, 0.7, 25.5 / 255.0, math.nextafter(0.1, 0.0), 0.5 / 255.0, 1.0])
def test_grey_levels_half_way_between_two_are_right(ambient: float) -> None:
    """255 k_a = 25.5 + 1.4e-15 for k_a = 0.1, and so it is for all pixels in the dark."""
    scene = Scene.chapter1(ambient=ambient, light=(5.0, 5.0, 1.0))
    level = math.floor(255 * min(Fraction(ambient), Fraction(1)) + Fraction(1, 2))
    image = certify(scene, SIDE, SIDE, target="uint8").values
    x, y = pixels(scene, SIDE, SIDE)
    true = oracle.evaluate(scene, x, y)
    dark = (true.value == ambient) & (true.residual == 0.0)
    assert dark.sum() > 20
    assert (image[dark] == level).all()
    assert same_bits(image, true.value8)


def test_grey_levels_are_those_of_the_clipped_image_whatever_clip_is() -> None:
    scene = Scene.chapter1()
    images = [render_image(scene, 40, 40, accuracy="certified", target="uint8", clip=clip) for clip in (True, False)]
    assert same_bits(*images)
    assert images[0].max() == 255


def test_clipping_is_the_last_step() -> None:
    for target in ("float64", "float32"):
        free = certify(Scene.chapter1(), 40, 40, target=target, clip=False).values
        cut = certify(Scene.chapter1(), 40, 40, target=target, clip=True).values
        assert free.max() > 1.0
        assert same_bits(cut, np.minimum(free, free.dtype.type(1.0)))


# ------------------------------------------------------------------------------------------- the rounding of enclosures


def enclosures(seed: int, count: int) -> Sequence[tuple[float, float, float, Fraction]]:
    """hi, lo, error and a true value that they enclose; many close to where a rounding jumps."""
    draw = random.Random(seed)
    found = []
    for _k in range(count):
        kind = draw.choice(("float64", "float32", "uint8", "any", "ends"))
        base = Fraction(draw.uniform(0.0, 1.3))
        if kind == "float64":
            base = Fraction(float(base)) + Fraction(math.ulp(float(base))) / 2
        if kind == "float32":
            single = np.float32(float(base))
            base = Fraction(float(single)) + Fraction(float(np.spacing(single))) / 2
        if kind == "uint8":
            base = Fraction(2 * draw.randint(0, 254) + 1, 510)
        if kind == "ends":
            base = Fraction(draw.choice((0, 1)))
        error = draw.choice((0.0, 2.0 ** -draw.randint(20, 110)))
        true = base + draw.choice((0, 1, -1)) * Fraction(draw.choice((error, 2.0 ** -draw.randint(30, 120))))
        middle = true + draw.choice((-1, 0, 1, Fraction(1, 3))) * Fraction(error)
        hi = float(middle)
        lo = float(middle - Fraction(hi))
        if Fraction(hi) + Fraction(lo) != middle:
            true += Fraction(hi) + Fraction(lo) - middle
        found.append((hi, lo, error, true))
    return found


def nearest_float32(value: Fraction) -> np.float32:
    """Ties to even."""
    about = np.float32(float(value))
    near = [about, np.nextafter(about, np.float32(-9)), np.nextafter(about, np.float32(9))]
    return min(near, key=lambda f: (abs(Fraction(float(f)) - value), f.view(np.uint32) & 1))


SETTLED_BY = """
#include <stddef.h>
#include "settle.h"

void settle_all(double *values, unsigned char *is_settled, const double *hi, const double *lo, const double *error,
    ptrdiff_t count, int rule)
{
    for (ptrdiff_t i = 0; i < count; ++i) {
        const double_double v = {hi[i], lo[i]};
        const settled_value found = settled_by((settling_rule)rule, v, error[i]);
        values[i] = found.value;
        is_settled[i] = (unsigned char)found.is_settled;
    }
}
"""


def settled(parts: Sequence[npt.NDArray[np.float64]], rule: str) -> tuple[npt.NDArray[Any], npt.NDArray[np.bool_]]:
    """What templates/support/settle.h makes of enclosures hi, lo, error."""
    prototype = SETTLED_BY[SETTLED_BY.index("void") : SETTLED_BY.index("\n{")] + ";"
    values, is_settled = np.empty(len(parts[0])), np.empty(len(parts[0]), dtype=np.bool_)
    library = compile_c(SETTLED_BY, prototype)
    library.call("settle_all", values, is_settled.view(np.uint8), *parts, len(values), BY_RULE[rule])
    return values, is_settled


@pytest.mark.parametrize("rule", ["ulp", *TARGETS])
def test_what_an_enclosure_settles_is_settled_right(rule: str) -> None:
    cases = enclosures(5, 20_000 if THOROUGH else 3_000)
    parts = [np.array([case[k] for case in cases]) for k in range(3)]
    values, is_settled = settled(parts, rule)
    assert 0.2 < is_settled.mean() < 1.0
    for (hi, lo, error, true), value, ready in zip(cases, values, is_settled, strict=True):
        if not ready:
            continue
        where = f"{hi!r} + {lo!r} +- {error!r}"
        if rule == "ulp":
            assert abs(Fraction(float(value)) - true) <= 4 * Fraction(math.ulp(float(true))), where
        elif rule == "float64":
            assert value == true.numerator / true.denominator, where
        elif rule == "float32":
            assert value == nearest_float32(true), where
        else:
            assert value == math.floor(255 * min(max(true, Fraction(0)), Fraction(1)) + Fraction(1, 2)), where


def test_an_enclosure_that_knows_nothing_settles_nothing() -> None:
    for hi in (0.0, 0.3, 2.0):
        nothing = [np.full(3, hi), np.zeros(3), np.full(3, np.inf)]
        for rule in ("ulp", *TARGETS):
            assert not settled(nothing, rule)[1].any()


# ------------------------------------------------------------------------------------------------ arguments and errors


def test_a_colour_scene_has_its_three_channels_rounded() -> None:
    scene = Scene.builtin("lights")
    for target, dtype in RULES.items():
        image = render_image(scene, 20, 10, accuracy="certified", target=target)
        assert image.shape == (10, 20, 3)
        assert image.dtype == dtype


def test_out_is_filled_with_any_strides_and_returned() -> None:
    for target, dtype in RULES.items():
        wanted = certify("chapter1", 21, 13, target=target).values
        wide = np.zeros((26, 42), dtype)
        out = wide[::2, ::2]
        assert render_image("chapter1", 21, 13, accuracy="certified", target=target, out=out) is out
        assert same_bits(np.ascontiguousarray(out), wanted)
    with pytest.raises(ArgumentError, match="out: has dtype float64; this accuracy writes uint8"):
        render_image("chapter1", 8, 8, accuracy="certified", target="uint8", out=np.zeros((8, 8)))
    with pytest.raises(ArgumentError, match=re.escape("out: has shape (8, 9); expected (height, width) = (8, 8)")):
        render_image("chapter1", 8, 8, accuracy="stable", out=np.zeros((8, 9)))


def test_arguments_that_do_not_go_together_are_refused_by_name() -> None:
    with pytest.raises(
        ArgumentError, match="target: 'float16' is not known; expected one of 'float64', 'float32', 'uint8'"
    ):
        certify("chapter1", 8, 8, target="float16")
    with pytest.raises(
        ArgumentError, match="target: 'uint8' is for accuracy='certified', not for 'double'; leave it out"
    ):
        render_image("chapter1", 8, 8, target="uint8")
    with pytest.raises(ArgumentError, match="target: 'float64' is for accuracy='certified', not for 'stable'"):
        evaluate("chapter1", 0.0, 0.0, accuracy="stable", target="float64")
    for level in ("stable", "certified"):
        with pytest.raises(ArgumentError, match="bake: a kernel of '" + level + "' takes its numbers as arguments"):
            render_image("chapter1", 8, 8, accuracy=level, bake=True)


def nothing_settled(kernel: EnclosureKernel, x: Any, y: Any, *_how: Any, **_more: Any) -> SettledPoints:
    """As though no enclosure were narrow enough."""
    return SettledPoints(np.zeros((x.size, kernel.channels)), np.zeros(x.size, dtype=np.bool_), 0.0)


def test_what_the_oracle_leaves_open_is_an_error_that_names_the_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """The two stages before it settle nothing, and the oracle all but its third and fifth point."""
    scene = Scene.builtin("two_spheres")

    def open_(scene: Scene, x: Any, y: Any, target: str = "float64", **_more: Any) -> Any:
        raise AccuracyError("2 points", (2, 4))

    monkeypatch.setattr(oracle, "settle", open_)
    monkeypatch.setattr(EnclosureKernel, "settle", nothing_settled)
    with pytest.raises(AccuracyError) as raised:
        render_image(scene, 4, 3, accuracy="certified")
    assert raised.value.points == (2, 4)
    assert "2 of 12 values are not settled: column 2, row 0; column 0, row 1; each" in str(raised.value)
    with pytest.raises(AccuracyError, match=re.escape("(0.25, 0.5); (0.5, 0.75)")) as raised:
        evaluate(scene, [0.0, 0.1, 0.25, 0.3, 0.5], [0.0, 0.1, 0.5, 0.6, 0.75], accuracy="stable")
    assert raised.value.points == (2, 4)


def test_many_open_pixels_are_shown_by_the_first_eight(monkeypatch: pytest.MonkeyPatch) -> None:
    def open_(scene: Scene, x: Any, y: Any, target: str = "float64", **_more: Any) -> Any:
        raise AccuracyError("all", tuple(range(len(x))))

    monkeypatch.setattr(oracle, "settle", open_)
    monkeypatch.setattr(EnclosureKernel, "settle", nothing_settled)
    with pytest.raises(AccuracyError, match="12 of 12 values are not settled: ") as raised:
        render_image("two_spheres", 4, 3, accuracy="certified", target="uint8")
    assert str(raised.value).count("column") == 8
    assert "; ...; each" in str(raised.value)


def test_what_the_enclosure_leaves_over_the_oracle_settles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Were the enclosure's bounds infinite, the values would be the same, and the certificate would say whose."""

    wanted = {target: certify("shadow", 10, 10, target=target).values for target in TARGETS}
    monkeypatch.setattr(EnclosureKernel, "settle", nothing_settled)
    for target in TARGETS:
        found = certify("shadow", 10, 10, target=target)
        assert same_bits(found.values, wanted[target])
        assert [stage.name for stage in found.certificate.stages] == ["enclosure", "oracle"]
        assert [stage.settled for stage in found.certificate.stages] == [0, 100]
        assert found.certificate.bound == 0.0


def test_a_certificate_says_its_claim_and_who_settled_how_many() -> None:
    found = certify("chapter1", 16, 16, target="uint8").certificate
    assert found.claim == "the right grey level"
    assert str(found).startswith("the right grey level at all 256: kernel ")
    assert Certificate("within 4 ulp", 0, ()).bound == 0.0


def test_light_at_the_surface_is_certified_too() -> None:
    """A light at the point that is seen, exactly, and one float beside it: there it adds nothing, here all it can."""
    for z in (1.0, math.nextafter(1.0, 2.0), math.nextafter(1.0, 0.0)):
        scene = Scene(Scene.chapter1().camera, (Sphere((0.0, 0.0, 0.0), 1.0, Phong()),), (PointLight((0.0, 0.0, z)),))
        x, y = np.array([0.0, 0.0, 1e-17, 0.3]), np.array([0.0, 1e-300, 0.0, 0.1])
        for target in TARGETS:
            values = evaluate(scene, x, y, accuracy="certified", target=target)
            assert same_bits(np.ascontiguousarray(values), oracle.settle(scene, x, y, target))


@pytest.mark.parametrize("name", list(STRUCTURES) if THOROUGH else ["any_sphere", "off_axis_sphere_gated"])
def test_dense_points_of_a_structure_are_the_oracles(name: str) -> None:
    x, y = square_of_points(STRUCTURES[name], 40)
    true = oracle.evaluate(STRUCTURES[name], x, y)
    for target, answer in (("float64", true.value), ("float32", true.value32), ("uint8", true.value8)):
        assert same_bits(values_of(STRUCTURES[name], x, y, target), answer)


def test_no_certified_image_is_written_for_a_folder_that_is_no_scene(tmp_path: Path) -> None:
    with pytest.raises(Exception, match=re.escape(str(tmp_path))):
        certify(tmp_path, 4, 4)
