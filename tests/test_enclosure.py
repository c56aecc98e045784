"""Enclosures against the oracle: the true intensity is never outside, and where nothing is in doubt the error is tiny.

Built-in scenes have kernels of their own. Random scenes share one kernel with every effect in its text, so that many
are tried: whatever a scene does not call for is in their lists as nothing. Kept hard cases bring their answers along.
SYMRENDER_THOROUGH=1 tries forty times as many random scenes.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_harness import COMPILERS
from mpmath import mp, mpf
from scene_strategies import random_scene, scaled, scene_points
from test_scene_emission import MORE_WARNINGS, covering

from benchmarks.random_scenes import EVERY_EFFECT
from symrender_cg.build import Cache, project_flags
from symrender_cg.build.cache import default_root
from symrender_cg.derive import parts
from symrender_cg.derive.parts import Part
from symrender_cg.emit.c99 import Emitted
from symrender_cg.emit.enclosure import emit_enclosure, enclosure_parts
from symrender_cg.emit.scene_fields import Needs
from symrender_cg.errors import OutsidePlanError
from symrender_cg.lower import passes
from symrender_cg.lower.enclose import enclose, enclose_part
from symrender_cg.lower.freeze import freeze
from symrender_cg.lower.program import KernelProgram, Rate, Step
from symrender_cg.pipeline import enclosure_kernel, planned, statistics
from symrender_cg.plan.effects import SCENE
from symrender_cg.plan.plan import Plan
from symrender_cg.reference import oracle
from symrender_cg.run import enclosure
from symrender_cg.run.enclosure_kernel import Enclosure, EnclosureKernel
from symrender_cg.run.enclosure_numbers import as_triple
from symrender_cg.scene import Camera, DirectionalLight, Phong, Plane, PointLight, Scene, Sphere
from symrender_cg.scene.builtin import builtin_names

CASES: list[dict[str, Any]] = json.loads(Path(__file__).with_name("hardcases.json").read_text())["cases"]
ANSWERED = [case for case in CASES if case["status"] in ("ok", "miss") and case["domain"] == "regular"]
SEEDS = 2000 if os.environ.get("SYMRENDER_THOROUGH") == "1" else 50
POINTS = 24


def outside(found: Enclosure, true: oracle.Answers) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Where the true intensity is not enclosed. The oracle's value + residual is within 2^-53 of the residual of it."""
    value, residual = true.value, true.residual
    with np.errstate(all="ignore"):
        off = np.abs((value - found.hi) + (residual - found.lo))
        return np.asarray(~((off <= found.error + 2.0**-52 * np.abs(residual)) | np.isinf(found.error)))


# ------------------------------------------------------------------------------------------------------ true scenes


@pytest.mark.parametrize("name", builtin_names())
def test_no_true_intensity_of_a_built_in_scene_is_outside(name: str) -> None:
    scene = Scene.builtin(name)
    x, y = scene_points(scene, 60, 3)
    found = enclosure.enclose(scene, x, y)
    true = oracle.evaluate(scene, x, y)
    assert not outside(found, true).any()
    assert np.isfinite(found.error).all()
    ordinary = found.error <= 2.0**-80 * np.maximum(np.abs(found.hi), 2.0**-20)
    assert ordinary.mean() > 0.95, "an enclosure is worth its name where nothing is ill-conditioned"
    assert (found.hi + found.lo == found.hi).all()


class EveryEffect(EnclosureKernel):
    """The enclosure of three channels with every effect in its text: it takes any scene, whatever its plan."""

    def numbers(self) -> dict[str, Any]:
        lacking: dict[str, Any] = {name: 0.0 for name, shape in self.fields if shape == "number"}
        lacking["ground"] = np.tile([1.0, 0.0, 0.0], 4)
        lacking["tiles"] = one_tile = np.zeros(24)
        one_tile[[9, 21]] = 0.5  # the plane is in the middle of the tile numbered 0
        lacking["upward"] = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        numbers = super().numbers()
        assert self.plan.arrangement is not None
        if self.plan.arrangement.plane_materials and len(self.plan.arrangement.plane_materials) < 2:
            numbers["tiles"] = one_tile
        return lacking | {"background_top": numbers["background"]} | numbers


@cache
def parts_in_balls() -> dict[str, KernelProgram]:
    return {name: enclose_part(part) for name, part in enclosure_parts(EVERY_EFFECT).items()}


@cache
def lowered(part: Part) -> KernelProgram:
    return enclose_part(part)


def emitted(need: Needs) -> Emitted:
    programs = {name: lowered(part) for name, part in enclosure_parts(need).items()}
    found = planned(Scene.chapter1(), force=(SCENE,))
    return emit_enclosure(programs, need=need, plan=found, command="none", name="scene_enclosure")


@cache
def every_effect() -> EveryEffect:
    text = emitted(EVERY_EFFECT)
    store = Cache(default_root())
    cached = store.kernel(text.files, text.cdef)
    plan = planned(Scene.chapter1(), force=(SCENE,))
    return EveryEffect(text.name, text.fields, 3, plan, cached, store.load(cached))


def enclosed(plan: Plan, x: Any, y: Any) -> Enclosure:
    """By the kernel with every effect; of a grey scene one channel."""
    kernel = every_effect()
    own = EveryEffect(kernel.name, kernel.fields, 3, plan, kernel.cached, kernel.library)
    found = own.enclose(x, y)
    if plan.given.channels == 3:
        return found
    assert (found.hi == found.hi[..., :1]).all(), "equal colours in, equal colours out"
    return Enclosure(found.hi[..., 0], found.lo[..., 0], found.error[..., 0])


def test_no_true_intensity_of_a_random_scene_is_outside() -> None:
    """50 scenes, 24 points each, half of them at outlines or in spheres. Of 475,240 values of 4,700 more none was."""
    tried, unknown, wide = 0, 0, 0
    for seed in range(SEEDS):
        scene = random_scene(seed)
        x, y = scene_points(scene, POINTS, seed)
        found = enclosed(planned(scene, force=(SCENE,)), x, y)
        wrong = outside(found, oracle.evaluate(scene, x, y))
        assert not wrong.any(), f"random_scene({seed}) at {np.argwhere(wrong)[0]}"
        tried, unknown = tried + found.error.size, unknown + int(np.isinf(found.error).sum())
        wide += int((found.error > 2.0**-80 * np.maximum(np.abs(found.hi), 2.0**-20)).sum())
    assert unknown <= 1e-3 * tried
    assert wide <= 0.01 * tried


@pytest.mark.parametrize("k", [-400, -150, 200, 400])
def test_scaling_a_scene_by_a_power_of_two_changes_no_bit(k: int) -> None:
    for seed in range(12):
        scene = random_scene(seed)
        x, y = scene_points(scene, 8, seed)
        one = enclosed(planned(scene, force=(SCENE,)), x, y)
        other = enclosed(planned(scaled(scene, k), force=(SCENE,)), np.ldexp(x, k), np.ldexp(y, k))
        for name in ("hi", "lo", "error"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), f"random_scene({seed})"


def test_no_kept_hard_case_is_outside() -> None:
    answered = 0
    for case in ANSWERED:
        r, e, lx, ly, lz, ka, kd, ks, n = (float.fromhex(number) for number in case["theta"])
        try:
            scene = Scene.chapter1(r, e, (lx, ly, lz), ka, kd, ks, n)
            plan = planned(scene, force=(SCENE,))
        except OutsidePlanError:
            continue
        found = enclosed(plan, float.fromhex(case["x"]), float.fromhex(case["y"]))
        value, residual = float.fromhex(case["expect"]), float.fromhex(case["residual"])
        off = abs((value - found.hi) + (residual - found.lo))
        assert off <= found.error + 2.0**-52 * abs(residual) or np.isinf(found.error), case["id"]
        answered += bool(found.error <= 2.0**-40 * max(abs(value), 2.0**-900))
    assert answered > 0.75 * len(ANSWERED)


def test_a_radius_is_not_wider_than_the_true_error_by_more_than_its_rounding_accounts_for() -> None:
    """Radius over true error on Chapter 1's lit points: each of some 150 operations adds its worst."""
    scene = Scene.chapter1()
    x, y = scene_points(scene, 400, 5)
    found = enclosure.enclose(scene, x, y)
    inexact = oracle.enclose(scene, x, y, bits=200)
    ratios = []
    for hi, lo, error, middle in zip(found.hi, found.lo, found.error, inexact.middle, strict=True):
        off = abs(float(middle - (Fraction(float(hi)) + Fraction(float(lo)))))
        if off > 0.0 and error > 0.0:
            ratios.append(float(error) / off)
    assert len(ratios) > 100
    assert min(ratios) >= 1.0
    assert np.median(ratios) < 5000.0


# ---------------------------------------------------------------------------------------------------- decisions


def looked(scene: Scene, x: Any, y: Any) -> Enclosure:
    return enclosed(planned(scene, force=(SCENE,)), x, y)


def two_spheres(**changes: Any) -> Scene:
    near = Sphere((0.0, 0.0, 1.0), 0.5, Phong(0.125, 0.5, 0.25, 8.0))
    far = Sphere((0.0, 0.0, -2.0), 1.5, Phong(0.25, 0.5, 0.0, 1.0))
    given: dict[str, Any] = {
        "camera": Camera((0.0, 0.0, 4.0), half_height=2.0),
        "spheres": (near, far),
        "lights": (PointLight((0.0, 0.0, 8.0), 1.0),),
    }
    return Scene(**(given | changes))


def test_a_ray_that_touches_a_sphere_hits_it() -> None:
    """Eye 5, radius 3: the silhouette is at x^2 + y^2 = 225 / 16, which (3.75, 0) is on."""
    scene = Scene.chapter1(radius=3.0, eye=5.0, ambient=0.5, diffuse=0.0, specular=0.0)
    ends = [np.nextafter(3.75, 0.0), 3.75, np.nextafter(3.75, 9.0)]
    found = looked(scene, ends, 0.0)
    assert found.hi.tolist() == [0.5, 0.5, 0.0]
    assert (found.error < 2.0**-100).all()


def test_the_edge_of_a_shadow_is_enclosed_with_both_its_sides() -> None:
    """A light straight above a sphere on the axis: points of the plane at the very edge of its shadow are in doubt."""
    scene = Scene(
        Camera((0.0, 0.0, 4.0), half_height=4.0),
        (Sphere((0.0, 0.0, -3.0), 1.0),),
        (DirectionalLight((0.0, 0.0, -1.0), 1.0),),
        plane=Plane((0.0, 0.0, -8.0), (0.0, 0.0, 1.0), Phong(0.125, 0.5, 0.0)),
    )
    edge = 4.0 / 12.0  # the ray through it meets the plane at x = 1 to rounding
    x = np.array([edge - 1e-9, edge, edge + 1e-9])
    found = looked(scene, x * 0.0 + x, np.zeros(3))
    assert not outside(found, oracle.evaluate(scene, x, np.zeros(3))).any()
    assert found.error[0] < 1e-20


def test_where_two_spheres_are_met_in_one_point_nothing_is_claimed() -> None:
    """Two equal spheres about (+-1, 0, 0): on x = 0 their depths are equal, and the materials differ."""
    spheres = (
        Sphere((-1.0, 0.0, 0.0), 1.5, Phong(0.25, 0.0, 0.0)),
        Sphere((1.0, 0.0, 0.0), 1.5, Phong(0.5, 0.0, 0.0)),
    )
    scene = two_spheres(spheres=spheres)
    found = looked(scene, [-(2.0**-60), 0.0, 2.0**-60], 0.25)
    assert np.isinf(found.error[1])
    assert (found.hi[0], found.hi[2]) == (0.25, 0.5)
    assert (found.error[[0, 2]] == 0.0).all()


def test_a_sphere_that_is_there_twice_is_seen_once() -> None:
    sphere = Sphere((0.0, 0.0, 0.0), 1.0, Phong(0.125, 0.5, 0.25))
    one, two = two_spheres(spheres=(sphere,)), two_spheres(spheres=(sphere, sphere))
    x, y = np.linspace(-0.5, 0.5, 7), np.linspace(-0.3, 0.6, 7)
    first, second = looked(one, x, y), looked(two, x, y)
    assert np.isfinite(second.error).all()
    assert (np.abs((first.hi - second.hi) + (first.lo - second.lo)) <= first.error + second.error).all()


def test_a_light_at_the_point_that_is_seen_is_not_guessed_at() -> None:
    """Chapter 1's sphere with the light at its pole: at (0, 0) it adds nothing, which balls cannot know."""
    scene = Scene.chapter1(radius=1.0, eye=4.0, light=(0.0, 0.0, 1.0))
    found = looked(scene, [0.0, 2.0**-30], 0.0)
    true = oracle.evaluate(scene, [0.0, 2.0**-30], 0.0)
    assert not outside(found, true).any()


@pytest.mark.parametrize("far", [1e3, 1e30, 1e61, 1e100, 1e300])
def test_a_light_at_any_distance_is_enclosed_as_closely(far: float) -> None:
    """Farther than 2^200 times the eye no plan of several surfaces reaches: there the light is brought nearer."""
    scene = Scene.chapter1(light=(0.3 * far, 0.2 * far, far))
    x, y = scene_points(scene, 24, 3)
    found = enclosure.enclose(scene, x, y)
    assert not outside(found, oracle.evaluate(scene, x, y)).any()
    assert np.median(found.error[found.hi > 0.0]) < 2.0**-85


@pytest.mark.parametrize("tiny", [2.0**-420, 2.0**-1022, 5e-324])
def test_points_that_nearly_are_on_an_axis_are_enclosed_as_closely(tiny: float) -> None:
    scene = Scene.chapter1(eye=1.5)
    x, y = np.array([tiny, 0.0, -tiny, 0.25]), np.array([0.0, tiny, tiny, -tiny])
    found = enclosure.enclose(scene, x, y)
    assert not outside(found, oracle.evaluate(scene, x, y)).any()
    assert (found.error < 2.0**-80).all()


@pytest.mark.parametrize("far", [2.0**210, 2.0**1000])
def test_points_out_of_all_range_are_left_open(far: float) -> None:
    found = enclosure.enclose(None, [far, 0.25, -far], [0.0, 0.25, far])
    assert np.isinf(found.error).tolist() == [True, False, True]
    assert (found.hi[[0, 2]] == 0.0).all()


def test_points_that_are_no_numbers_are_left_open() -> None:
    assert np.isinf(enclosure.enclose(None, [np.nan, np.inf], 0.0).error).all()


def test_a_direction_counts_as_it_is_given_and_not_as_its_rounded_unit_vector() -> None:
    """(1, 2, 2) has length 3; its unit vector in float64 is off by more than the enclosure is wide."""
    scene = two_spheres(lights=(DirectionalLight((-1.0, -2.0, -2.0), 1.0),))
    x, y = scene_points(scene, 200, 9)
    found = looked(scene, x, y)
    assert not outside(found, oracle.evaluate(scene, x, y)).any()
    assert np.median(found.error) < 2.0**-85


# ------------------------------------------------------------------------------------------------ numbers, arrays


def test_numbers_that_no_float64_holds_come_with_their_error() -> None:
    random = np.random.default_rng(2)
    with mp.workprec(700):
        for _ in range(300):
            numerator = int(random.integers(-(2**62), 2**62)) * int(random.integers(1, 2**62)) ** int(
                random.integers(6)
            )
            radicand = int(random.integers(1, 2**62)) ** int(random.integers(1, 6))
            grid = int(random.integers(-300, 300))
            hi, lo, error = as_triple(numerator, radicand, grid)
            true = mpf(numerator) / mp.sqrt(mpf(radicand)) * mpf(2) ** grid
            assert abs(mpf(hi) + mpf(lo) - true) <= mpf(error) <= abs(mpf(hi)) * mpf(2) ** -103 + mpf(2) ** -999
            assert hi + lo == hi
    assert as_triple(0, 3, 5) == (0.0, 0.0, 0.0)
    assert as_triple(6, 4, 0)[:2] == (3.0, 0.0)


def test_any_number_of_threads_gives_the_same_bits() -> None:
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 90), np.linspace(-1.0, 1.0, 60))
    one, four = (enclosure.enclose(None, x, y, threads=n) for n in (1, 4))
    for name in ("hi", "lo", "error"):
        assert np.array_equal(getattr(one, name), getattr(four, name))


def test_a_portable_kernel_gives_the_same_bits() -> None:
    """Every operation is one of IEEE 754, and fma is where it is written: in software where there is no instruction."""
    x, y = scene_points(Scene.chapter1(), 200, 4)
    own, portable = (enclosure.enclose(None, x, y, portable=choice) for choice in (False, True))
    for name in ("hi", "lo", "error"):
        assert np.array_equal(getattr(own, name), getattr(portable, name))


def test_arrays_have_the_shape_of_the_points_and_three_channels_for_colours() -> None:
    assert enclosure.enclose(None, 0.0, 0.0).hi.shape == ()
    assert enclosure.enclose(None, np.zeros((3, 1)), np.zeros(4)).error.shape == (3, 4)
    assert enclosure.enclose(None, np.zeros(0), 0.0).lo.shape == (0,)
    assert enclosure.enclose("mirrors", np.zeros(2), 0.0).hi.shape == (2, 3)
    grey = two_spheres(background=(0.5, 0.5, 0.5))
    found = enclosure.enclose(grey, [0.0, 1.9], [0.0, 1.9])
    assert found.hi.shape == (2, 3)
    assert (found.hi[1] == 0.5).all()


def test_a_kernel_is_compiled_once_for_scenes_of_one_plan() -> None:
    enclosure_kernel(Scene.chapter1())
    before = statistics.compiled
    x, y = scene_points(Scene.chapter1(), 5, 1)
    for radius in (0.5, 0.75):
        scene = Scene.chapter1(radius=radius)
        assert not outside(enclosure.enclose(scene, x, y), oracle.evaluate(scene, x, y)).any()
    assert statistics.compiled == before


# ------------------------------------------------------------------------------------------------------------ the C


@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_combination_is_strict_c99_without_a_warning(compiler: str, tmp_path: Path) -> None:
    for number, need in enumerate(covering()):
        files = emitted(need)
        for name, text in files.files.items():
            (tmp_path / name).write_text(text, encoding="utf-8")
        optimised = [] if need == EVERY_EFFECT else ["-fsyntax-only"]
        command = [compiler, *project_flags(), *MORE_WARNINGS, *optimised, "-c", f"{files.name}.c"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.stderr, done.returncode) == ("", 0), f"{number}: {need}"


def test_every_text_is_ascii_within_120_columns_and_tidy() -> None:
    for need in covering():
        for file, text in emitted(need).files.items():
            assert text.isascii()
            assert text.endswith("\n")
            for number, line in enumerate(text.split("\n"), 1):
                assert len(line) <= 120, f"{file}:{number}: {line}"
                assert line == line.rstrip(), f"{file}:{number} ends in space"
                assert "\t" not in line


TRACES = {
    "intersections": r"partners",
    "plane": r"\bplane_(surface|is_met|z)\b|\bground\b|descent",
    "checker": r"parity|tile_|across_|along_",
    "crossing": r"crosses_plane",
    "specular": r"lobe|shininess|ball_power|highlight|\bleaf\b",
    "specular_gate": r"\bGATED\b(?! = 4)",
    "attenuation": r"fade|fading|attenuation",
    "shadows": r"shadow|blocker|is_dark",
    "mirrors": r"arrive\(|mirrors_begin|\bweight\b|next_hit",
    "gradient": r"background_top|\bup_[xyz]\b|climb|upward",
}


@pytest.mark.parametrize("flag", TRACES)
def test_an_effect_left_out_leaves_no_trace_in_the_text_and_one_left_in_does(flag: str) -> None:
    for need in covering():
        files = emitted(need)
        text, header = files.files[f"{files.name}.c"], files.files[f"{files.name}.h"]
        body = text[text.index("*/") :] + header[header.index("*/") :]
        assert bool(re.search(TRACES[flag], body)) == getattr(need, flag), need


def test_enclosing_leaves_no_operation_of_plain_floating_point_in_a_part() -> None:
    """But sums and floors of whole numbers, which are exact."""
    for part, program in parts_in_balls().items():
        for step in program.steps:
            plain = step.format == "float64"
            assert plain == (step.name in ("focal", "tile_u", "tile_v", "tile", "parity")), f"{part}: {step.name}"
            assert step.format in ("ball", "float64")


def test_the_pass_leaves_its_argument_as_it_was_and_frees_no_decision() -> None:
    """A step that is a decision goes back to where it is used: all that is left are balls."""
    part = parts.shading_part(glossy=True)
    steps = tuple(Step(d.name, d.value, d.section) for d in part.definitions)
    given = KernelProgram("glossy", steps, (), None, "", part.inputs, "", part.results, part_rates(part))
    program = freeze(passes.share(passes.place(passes.lower_powers(given, {"cosine": "ball_power_of_cosine"}))))
    before = program.text()
    first, second = enclose(program), enclose(program)
    assert program.text() == before
    assert first.text() == second.text()
    assert {step.format for step in first.steps} == {"ball"}
    assert "ball_select(ball_positive(w2), " in first.text()


def part_rates(part: Part) -> tuple[tuple[str, Rate], ...]:
    return tuple((name, "pixel") for name, _ in part.rates)
