"""Kernels that bound their own error: ranges of every step, C without a warning, bounds that no oracle ever breaks."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from evaluators import STRUCTURES, THOROUGH, FloatArray, modest, same_bits, square_of_points
from hypothesis import given
from hypothesis import strategies as st
from strategies import image_points, nasty_scenes, ordinary_scenes
from test_emission import COMPILERS, checked, own_files

from symrender_cg.build import find_toolchain
from symrender_cg.build.vectorisation import report
from symrender_cg.errors import AccuracyError, OutsidePlanError
from symrender_cg.lower.nodes import Call
from symrender_cg.lower.program import KernelProgram, Step
from symrender_cg.lower.ranges import to_ranges
from symrender_cg.lower.variants import LEVELS, Variant
from symrender_cg.pipeline import SphereTranslation, pixel_size, planned, settling_kernel, translate
from symrender_cg.reference import oracle
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.threads import over_rows
from symrender_cg.scene import Phong, PointLight, Scene
from symrender_cg.stress.families import FAMILIES

BY_NAME = {level.name: level for level in LEVELS}
KERNELS = [(name, level) for name in STRUCTURES for level in BY_NAME]
CASES = 120 if THOROUGH else 8
SCENES = 3_000 if THOROUGH else 120
RUN = (
    list(STRUCTURES)
    if THOROUGH
    else ["centred_sphere", "centred_sphere_flat", "off_axis_sphere_gated", "any_sphere_specular"]
)
"""Structures whose kernels are compiled and called; all of them are checked by the compilers."""
PLANS = {"centred_sphere", "centred_sphere_matte", "centred_sphere_gated", "any_sphere"}
"""Plans that the hunts look at, unless thorough: each costs four kernels."""


@cache
def translated(name: str, level: str) -> SphereTranslation:
    found = translate(STRUCTURES[name], BY_NAME[level])
    assert isinstance(found, SphereTranslation)
    return found


def program_of(name: str, level: str) -> KernelProgram:
    return translated(name, level).program


def results_of(program: KernelProgram) -> tuple[str, ...]:
    """The quantities that the C of a kernel bounds: see emit/settling.py."""
    return (program.result, *(name for name in ("n_dot_l", "w_dot_mirror", "w2") if name in program))


def source(name: str, level: str) -> str:
    files = translated(name, level).emitted
    return files.files[f"{files.name}.c"]


# -------------------------------------------------------------------------------------------------- steps in ranges


def leading(program: KernelProgram) -> list[Step]:
    """The steps that lead to what is bounded."""
    needed = set(results_of(program))
    for step in reversed(program.steps):
        if step.name in needed:
            needed |= step.uses()
    return [step for step in program.steps if step.name in needed]


@pytest.mark.parametrize(("name", "level"), KERNELS)
def test_each_step_that_leads_to_the_value_has_a_range_or_is_exact(name: str, level: str) -> None:
    program = program_of(name, level)
    found = {step.name: step for step in to_ranges(program, results_of(program))}
    for step in leading(program):
        assert step.name in found, step.name
        bound = found[step.name]
        if bound.format == "range":
            same = bound.value.is_Symbol and bound.uses() <= ranged(found)
            assert same or bound.value.function.startswith("range_"), step.name
            continue
        exact = step.format == "int" or step.name.startswith("from_center_") or not step.uses() & ranged(found)
        assert exact, f"{step.name} is taken as exact, and uses what is not"
        assert bound.value == step.value
    assert program.result in found
    assert found[program.result].format == "range"


def ranged(found: dict[str, Step]) -> set[str]:
    return {name for name, step in found.items() if step.format == "range"} | {"x", "y"}


KNOWN = {"x", "y", "INFINITY", "SURE_HIT", "least_cos2", "FLOAT64", "PAIR", "DOUBLE_DOUBLE"}
KNOWN |= {"POWER_ERROR", "PRECISE_POWER_ERROR", "PRECISE_POWER_FLOOR"}


@pytest.mark.parametrize(("name", "level"), KERNELS)
def test_ranges_come_after_what_they_use_and_are_defined_once(name: str, level: str) -> None:
    program = program_of(name, level)
    defined = KNOWN | set(program.inputs)
    for step in to_ranges(program, results_of(program)):
        assert step.name not in defined
        unknown = {used for used in step.uses() - defined if not re.fullmatch(r"0x1p-?\d+", used)}
        assert not unknown, f"{step.name} uses {unknown}"
        assert step.rate == "frame"
        defined.add(step.name)


@pytest.mark.parametrize(("name", "level"), KERNELS)
def test_making_ranges_leaves_the_kernel_as_it_was_and_gives_the_same_again(name: str, level: str) -> None:
    program = program_of(name, level)
    before = program.text()
    first, second = (to_ranges(program, results_of(program)) for _k in range(2))
    assert program.text() == before
    assert first == second


@pytest.mark.parametrize(("name", "level"), KERNELS)
def test_the_c_of_the_bounds_names_every_definition_that_leads_to_the_value(name: str, level: str) -> None:
    text = source(name, level)
    body = text[text.index("static bounds bounds_of(") : text.index("bounds b = {")]
    for step in leading(program_of(name, level)):
        assert re.search(rf"\bconst (range|int|double|double_double) {step.name} =", body), step.name


@pytest.mark.parametrize(("name", "level"), KERNELS)
def test_operations_on_double_doubles_are_given_no_pairs(name: str, level: str) -> None:
    """The bounds of double_double.h are for normalised operands, which pairs are not."""
    program = program_of(name, level)
    pairs = {step.name for step in program.steps if step.format == "pair"}
    for step in program.steps:
        for node in calls_in(step.value):
            if node.function in ("dd_add", "dd_add_double", "dd_sub", "dd_mul", "dd_mul_double", "dd_div", "dd_sqrt"):
                assert not {s.name for s in node.free_symbols} & pairs, f"{step.name}: {node.function}"


def calls_in(value: object) -> Iterator[Call]:
    if isinstance(value, Call):
        yield value
    for argument in getattr(value, "args", ()):
        yield from calls_in(argument)


# ---------------------------------------------------------------------------------------------------------------- C


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("level", BY_NAME)
def test_every_structure_is_strict_c99_without_a_warning(compiler: str, level: str, tmp_path: Path) -> None:
    for name in STRUCTURES:
        folder = tmp_path / name
        folder.mkdir()
        said = checked(compiler, translated(name, level).emitted, folder, "-Wshadow", "-Wfloat-conversion", "-Wundef")
        assert said == "", name


def test_lines_are_at_most_120_columns_and_end_in_no_space() -> None:
    for name, level in KERNELS:
        for file, text in own_files(translated(name, level).emitted).items():
            for number, line in enumerate(text.split("\n"), 1):
                assert len(line) <= 120, f"{file}:{number}"
                assert line == line.rstrip(), f"{file}:{number}"


@pytest.mark.parametrize("level", BY_NAME)
@pytest.mark.parametrize("name", ["centred_sphere", "any_sphere_specular"])
def test_the_loop_over_pixels_is_a_loop_over_vectors(name: str, level: str) -> None:
    files = translated(name, level).emitted
    toolchain = find_toolchain()
    found = {
        loop.line: loop.bytes for loop in report(files.files, toolchain=toolchain) if loop.file == f"{files.name}.c"
    }
    lines = files.files[f"{files.name}.c"].split("\n")
    stages = translated(name, level).program.stages
    text = files.files[f"{files.name}.c"]
    begin = text[: text.index("void finish(") if stages else text.index("_rows(")].count("\n")
    end = text[: text.index("/* The bounds for points")].count("\n")
    called = re.compile(r"^ +stage_\d+\(" if stages else r"sample s = shade\(")
    shading = [number for number in range(begin, end) if called.search(lines[number])]
    assert len({lines[number].partition("(")[0].strip() for number in shading}) == max(1, len(stages)), shading
    for number in shading:
        assert found.get(number, 0) >= min(32, toolchain.target(False).vector_bytes), lines[number - 1]


# -------------------------------------------------------------------------------------------------------- one frame


def rows_of(scene: Scene, level: Variant, side: int, threads: int = 1) -> tuple[np.ndarray, list[int]]:
    """The image of a kernel and the pixels that it leaves over."""
    found = settling_kernel(scene, level, aspect=1.0)
    assert found is not None
    kernel, frame = found
    image = np.empty((side, side), kernel.dtype)
    pixel = pixel_size(frame, side)
    numbers = kernel.numbers(numbers_of(frame))
    left: list[int] = []

    def some(begin: int, end: int) -> None:
        left.extend(kernel.settle_rows(image, numbers, pixel=pixel, white=1.0, begin=begin, end=end).tolist())

    over_rows(some, side, threads)
    return image, sorted(left)


@pytest.mark.parametrize(("name", "level"), [entry for entry in KERNELS if entry[0] in RUN])
def test_rows_and_points_settle_the_same_values(name: str, level: str) -> None:
    scene, side = STRUCTURES[name], 30
    image, left = rows_of(scene, BY_NAME[level], side)
    found = settling_kernel(scene, BY_NAME[level], aspect=1.0)
    assert found is not None
    kernel, frame = found
    columns, rows = pixel_centres(side, side, pixel_size(frame, side))
    x, y = (np.ascontiguousarray(a).ravel() for a in np.meshgrid(columns, rows))
    values = np.empty(x.size, kernel.dtype)
    left_of_points = kernel.settle_points(values, x, y, kernel.numbers(numbers_of(frame)), white=1.0)
    both = np.ones(x.size, dtype=bool)
    both[left] = both[left_of_points] = False
    assert both.mean() > 0.5, "a kernel settles most of an ordinary image"
    assert same_bits(image.ravel()[both], values[both])


@pytest.mark.parametrize("level", BY_NAME)
@pytest.mark.parametrize("name", ["centred_sphere", "off_axis_sphere_gated", "any_sphere_specular"])
def test_any_number_of_threads_settles_the_same_pixels(name: str, level: str) -> None:
    alone = rows_of(STRUCTURES[name], BY_NAME[level], 37)
    for threads in (2, 3, 16):
        image, left = rows_of(STRUCTURES[name], BY_NAME[level], 37, threads)
        assert same_bits(image, alone[0])
        assert left == alone[1]


@pytest.mark.parametrize("level", BY_NAME)
def test_settled_values_are_what_the_level_says_they_are(level: str) -> None:
    """A settled pixel is the oracle's rounding, or within 4 ulp of the true value."""
    for name in RUN:
        scene = STRUCTURES[name]
        image, left = rows_of(scene, BY_NAME[level], 16)
        x, y = square_of_points(scene, 16)
        true = oracle.evaluate(scene, x, y)
        settled = np.ones(x.size, dtype=bool)
        settled[left] = False
        values = image.ravel()[settled]
        if level == "stable":
            wanted = np.minimum(true.value, 1.0)[settled]
            assert (np.abs(values - wanted) <= 4 * np.spacing(wanted)).all(), name
        else:
            answers = {"float64": np.minimum(true.value, 1.0), "uint8": true.value8}
            answers["float32"] = np.minimum(true.value32, np.float32(1.0))
            assert same_bits(values, answers[BY_NAME[level].settles or ""][settled]), name


# ------------------------------------------------------------------------------------------------------- the bounds


def violations(scene: Scene, x: FloatArray, y: FloatArray) -> tuple[list[str], int]:
    """Points where the truth is farther from a kernel's value than its bound; and how many bounds were finite."""
    plan = planned(scene)
    if plan.arrangement is not None or not (THOROUGH or plan.name in PLANS):
        return [], 0
    try:
        true = oracle.evaluate(scene, x, y)
    except AccuracyError:
        return [], 0
    found, bounded = [], 0
    for level in LEVELS:
        kernel_and_frame = settling_kernel(scene, level)
        assert kernel_and_frame is not None
        kernel, frame = kernel_and_frame
        parts = kernel.enclose(x, y, kernel.numbers(numbers_of(frame)))
        for k, (hi, lo, error) in enumerate(zip(*(part.tolist() for part in parts), strict=True)):
            if error == math.inf:
                continue
            bounded += 1
            value, residual = float(true.value[k]), float(true.residual[k])
            away = (
                f"{level.name} at {(x[k], y[k])}: {hi!r} + {lo!r} +- {error!r}, true {value!r} + {residual!r}, {scene}"
            )
            if not (math.isfinite(hi + lo) and error >= 0.0):
                found.append(away)
                continue
            distance = abs(Fraction(hi) + Fraction(lo) - Fraction(value) - Fraction(residual))
            if distance > Fraction(error) + abs(Fraction(residual)) / 2**52:
                found.append(away)
    return found, bounded


def few_points(scene: Scene, x: float, y: float, draw: random.Random) -> tuple[FloatArray, FloatArray]:
    """The point alone, or with points of the window: the bound is that of all of them."""
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None
    points = [(x, y), (x * (1.0 + 2.0**-30), y)]
    if draw.random() < 0.5:
        points += [
            (draw.uniform(-half_height, half_height), draw.uniform(-half_height, half_height)) for _k in range(4)
        ]
    finite = [(a, b) for a, b in points if math.isfinite(a) and math.isfinite(b)]
    return np.array([a for a, _b in finite]), np.array([b for _a, b in finite])


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_no_bound_is_broken_in_a_family_of_hard_cases(family: object) -> None:
    found = []
    for case in family.cases(11, CASES):  # type: ignore[attr-defined]
        if case.refused or case.scene is None:
            continue
        try:
            broken, _finite = violations(case.scene, *few_points(case.scene, case.x, case.y, random.Random(case.name)))
        except OutsidePlanError:
            continue
        found += broken
    assert not found, f"{len(found)}; {found[0]}"


def hard_scene(seed: int) -> Scene:
    """e / R - 1, the light's distance from the surface and n over many powers of ten; gated, without ambient."""
    draw = random.Random(seed)
    radius = draw.choice((1.0, draw.uniform(0.5, 2.0)))
    eye = radius * (1.0 + 10.0 ** draw.uniform(-6.0, 6.0))
    n = draw.choice((10.0 ** draw.uniform(-3.0, 13.0), float(draw.randint(0, 200)), draw.uniform(0.0, 2.0), 1.0, 2.0))
    way = np.array([draw.gauss(0.0, 1.0) for _k in range(3)])
    way /= np.linalg.norm(way)
    away = radius * (1.0 + draw.choice((1.0, 1.0, -0.5)) * 10.0 ** draw.uniform(-16.0, 3.0))
    material = Phong(
        draw.choice((0.0, 0.1)), draw.choice((0.0, 0.7)), draw.choice((0.0, 0.5)), n, gate_specular=draw.random() < 0.3
    )
    x, y, z = (float(part) for part in away * way)
    base = Scene.chapter1(radius=radius, eye=eye)
    sphere = type(base.spheres[0])((0.0, 0.0, 0.0), radius, material)
    return Scene(base.camera, (sphere,), (PointLight((x, y, z)),))


def test_no_bound_is_broken_in_random_scenes_of_one_sphere() -> None:
    found, bounded = [], 0
    for seed in range(SCENES):
        scene, draw = hard_scene(seed), random.Random(seed)
        half_height = scene.in_camera_frame().camera.half_height
        assert half_height is not None
        narrow = 10.0 ** -draw.choice((0.0, 0.0, draw.uniform(0.0, 12.0)))
        x0, y0 = (draw.uniform(-0.8, 0.8) * half_height for _k in range(2))
        x = np.array([x0 + narrow * draw.uniform(-0.2, 0.2) * half_height for _k in range(8)])
        y = np.array([y0 + narrow * draw.uniform(-0.2, 0.2) * half_height for _k in range(8)])
        broken, finite = violations(scene, x, y)
        found += broken
        bounded += finite
    assert not found, f"{len(found)}; {found[0]}"
    assert bounded > 2 * SCENES, "bounds are finite"


@modest(40)
@given(st.one_of(nasty_scenes(), ordinary_scenes()), st.data())
def test_no_bound_that_hypothesis_looks_at_is_broken(scene: Scene, data: st.DataObject) -> None:
    points = data.draw(st.lists(image_points(scene), min_size=1, max_size=3))
    try:
        found, _bounded = violations(scene, np.array([x for x, _y in points]), np.array([y for _x, y in points]))
    except OutsidePlanError:
        return
    assert not found, found[0]
