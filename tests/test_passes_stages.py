"""Laws of symmetry and fission: what is called even is so to the last bit, stages lose nothing, and no pass changes a
bit that it does not say it changes."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from evaluators import STRUCTURES, FloatArray, Values, same_bits

from symrender_cg.derive.symbols import symbol, symbols
from symrender_cg.emit.printer import C_TYPES
from symrender_cg.lower import fission
from symrender_cg.lower.fission import crossing, cut, cycles, weight
from symrender_cg.lower.freeze import freeze
from symrender_cg.lower.program import KernelProgram, Step
from symrender_cg.lower.switches import NAMES, Passes
from symrender_cg.lower.symmetry import gather_mirrored, parities
from symrender_cg.lower.variants import Variant, variant
from symrender_cg.pipeline import SphereTranslation, draw, translate
from symrender_cg.reference import oracle
from symrender_cg.scene import Scene

LEVELS = ("fast", "single", "double")
STAGED = tuple(name for name in STRUCTURES if not name.startswith("any_sphere") and not name.endswith("_flat"))
"""Structures whose pixels differ, and whose rows of hits have ends in closed form."""

CENTRED = tuple(name for name in STAGED if name.startswith("centred_sphere"))
X, Y, A, REACH = (*symbols("x y"), symbol("a"), symbol("reach"))


def without(level: str, *passes: str) -> Variant:
    """A level with some of its passes off."""
    found = variant(level)
    return replace(found, name=f"{level}_without", passes=Passes().without(*passes))


@cache
def translated(name: str, level: str, bake: bool = False) -> SphereTranslation:
    found = translate(STRUCTURES[name], level, bake=bake)
    assert isinstance(found, SphereTranslation)
    return found


def image_and_points(scene: Scene, level: str | Variant, width: int, height: int) -> tuple[Values, Values]:
    """The image by rows, and the same pixels as points: their centres as the kernel of rows has them."""
    drawing = draw(scene, level, size=(width, height))
    image = np.empty((height, width), drawing.dtype)
    drawing.rows(image, 0, height)
    x, y = centres(drawing.pixel, width, height)
    values = np.empty((height, width), drawing.dtype)
    draw(scene, level).points(values, x, y)
    return image, values


def centres(pixel: float, width: int, height: int) -> tuple[FloatArray, FloatArray]:
    columns = (np.arange(width) + (0.5 - 0.5 * width)) * pixel
    rows = ((0.5 * height - 0.5) - np.arange(height)) * pixel
    return np.ascontiguousarray(np.tile(columns, (height, 1))), np.ascontiguousarray(np.tile(rows, (width, 1)).T)


def step(name: str, value: sp.Basic, rate: str = "pixel") -> Step:
    return Step(name, value, "section", rate=rate)  # type: ignore[arg-type]


def span_program(*steps: Step, right: sp.Expr = REACH) -> KernelProgram:
    """A program whose rows' hits end at -reach and `right`."""
    ends = (step("reach", symbol("b") + Y, "row"), step("x_left", -REACH, "row"), step("x_right", right, "row"))
    return KernelProgram("p", (*ends, *steps), (), ("x_left", "x_right"), steps[-1].name, ("a", "b"))


# ---- parity


@pytest.mark.parametrize(
    ("value", "parity"),
    [
        (X**2, "even"),
        (X * A, "odd"),
        (-X, "odd"),
        (X + A, None),
        ((X - symbol("x_left")) * (symbol("x_right") - X), "even"),
        ((X - symbol("x_left")) * (symbol("x_right") + X), None),
        (X**2 + Y, "even"),
        (X / (X**2 + A), "odd"),
        (sp.sqrt(X**2 + A), "even"),
        (sp.sqrt(X + A), None),
        (sp.Max(0, X), None),
        (sp.Max(0, X**2 - A), "even"),
        (sp.Piecewise((X**2, A > 0), (0, True)), "even"),
        (sp.Piecewise((X**2, X > 0), (0, True)), None),
    ],
    ids=str,
)
def test_parity_is_found_in_the_operations(value: sp.Expr, parity: str | None) -> None:
    assert parities(freeze(span_program(step("value", value)))).get("value") == parity


def test_without_mirrored_ends_of_a_row_nothing_is_even() -> None:
    assert parities(freeze(span_program(step("value", X**2), right=REACH + 1))) == {}
    assert parities(replace(freeze(span_program(step("value", X**2))), ends=None)) == {}


@pytest.mark.parametrize("level", LEVELS)
def test_only_spheres_on_the_axis_share_stages(level: str) -> None:
    for name in STRUCTURES:
        assert (translated(name, level).program.mirrored > 0) == (name in CENTRED), name


@pytest.mark.parametrize("bake", [False, True], ids=["arguments", "baked"])
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", CENTRED)
def test_a_row_and_its_points_have_the_same_bits_left_and_right(name: str, level: str, bake: bool) -> None:
    """Points compute x and -x each by itself; rows share. Widths: odd, even, beyond one block, not whole vectors."""
    if bake and name != "centred_sphere":
        return
    scene = STRUCTURES[name]
    for width, height in ((1, 5), (2, 4), (37, 11), (64, 6), (611, 4)):
        image, values = image_and_points(scene, level, width, height)
        assert same_bits(image, values), (width, height)


def test_gathering_moves_the_even_members_of_a_sum_into_a_step() -> None:
    even, odd = step("even", X**2 + A), step("odd", X * A)
    mixed = symbol("mixed")
    program = span_program(
        even, odd, step("mixed", X + A), step("sum", mixed**2 + symbol("even") ** 2 + A**2 + symbol("odd") * A)
    )
    gathered = gather_mirrored(program)
    assert gathered["sum_even"].value == A**2 + symbol("even") ** 2
    assert gathered["sum_odd"].value == A * symbol("odd")
    assert gathered["sum"].value == mixed**2 + symbol("sum_even") + symbol("sum_odd")
    assert gather_mirrored(gathered) == gathered
    gathered.check()


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", CENTRED)
def test_what_was_gathered_as_even_or_odd_is_so_to_the_last_bit(name: str, level: str) -> None:
    program = translated(name, level).program
    found = parities(program)
    gathered = [s.name for s in program.at("pixel") if re.search(r"_(even|odd)(_\d+)?$", s.name)]
    assert gathered
    for entry in gathered:
        assert found.get(entry) == re.findall("_(even|odd)", entry)[-1], entry


def test_what_rests_on_a_step_without_parity_has_none() -> None:
    far, root = symbol("far"), symbol("root")
    program = span_program(
        step("far", X + A + Y), step("root", 1 / far), step("sum", sp.sqrt(root) * (X + A) + X**2 + A**2)
    )
    assert [entry.name for entry in gather_mirrored(program).steps][3:] == ["far", "root", "sum_even", "sum"]


def test_gathering_leaves_a_sphere_off_the_axis_alone() -> None:
    program = span_program(step("mixed", X + A), step("sum", symbol("mixed") + X**2 + A**2), right=2 * REACH)
    assert gather_mirrored(program) is program


# ---- stages


@pytest.mark.parametrize("bake", [False, True], ids=["arguments", "baked"])
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", STRUCTURES)
def test_stages_hold_each_step_once_and_nothing_before_what_it_uses(name: str, level: str, bake: bool) -> None:
    program = translated(name, level, bake).program
    order = [entry for stage in program.stages for entry in stage]
    assert bool(order) == (name in STAGED)
    assert len(set(order)) == len(order)
    pixel = {entry.name for entry in program.at("pixel")}
    for at, entry in enumerate(order):
        assert program[entry].uses() & pixel <= set(order[:at]), entry
    if order:
        assert order[-1] == program.result or program.result in order


@pytest.mark.parametrize("level", LEVELS)
def test_what_crosses_between_stages_fits_the_first_level_cache(level: str) -> None:
    for name in STRUCTURES:
        program = translated(name, level).program
        sizes = {"float": 4, "double": 8}
        held = sum(sizes[str(C_TYPES[program[n].format].name)] for names in crossing(program) for n in names)
        text = "".join(translated(name, level).emitted.files.values())
        pixels = int(re.findall(r"POINTS = (\d+)", text)[0])
        assert pixels % 16 == 0
        assert pixels * (held + 16) <= 32 * 1024, name


@pytest.mark.parametrize("level", LEVELS)
def test_cuts_are_the_cheapest_there_are(level: str) -> None:
    """Against every way to cut what x and -x do not share."""
    found = translate(STRUCTURES["centred_sphere"], without(level, "whole"))
    assert isinstance(found, SphereTranslation)
    program = found.program
    rest = [program[name] for stage in program.stages[program.mirrored :] for name in stage]
    narrow = any(entry.format == "float32" for entry in rest)
    weights = [weight(entry, wide=narrow and entry.format != "float32") for entry in rest]

    def cost(places: tuple[int, ...]) -> float:
        total = 0.0
        for begin, end in itertools.pairwise((0, *places, len(rest))):
            total += cycles(sum(weights[begin:end]))
        for at in places:
            later = {used for entry in rest[at:] for used in entry.uses()}
            total += fission.CROSSING * sum(entry.name in later for entry in rest[:at])
        return total

    inner = range(1, len(rest))
    best = min(cost(places) for count in range(4) for places in itertools.combinations(inner, count))
    sizes = [len(stage) for stage in program.stages[program.mirrored :]]
    chosen = tuple(itertools.accumulate(sizes))[:-1]
    assert cost(chosen) == pytest.approx(best) if len(chosen) < 4 else cost(chosen) <= best


@pytest.mark.parametrize("name", ["centred_sphere", "off_axis_sphere"])
def test_cutting_leaves_its_input_untouched_and_gives_the_same_again(name: str) -> None:
    program = translated(name, "double").program
    text = program.text()
    assert cut(program, fission=True, symmetry=True) == program
    assert program.text() == text
    assert len(cut(replace(program, shortcut=None), fission=False, symmetry=False).stages) == 1


# ---- switches


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", ["centred_sphere", "off_axis_sphere", "centred_sphere_gated"])
def test_fission_changes_no_bit(name: str, level: str) -> None:
    scene = STRUCTURES[name]
    with_it, _ = image_and_points(scene, without(level, "whole"), 61, 40)
    whole, points = image_and_points(scene, without(level, "fission"), 61, 40)
    assert same_bits(with_it, whole)
    assert same_bits(whole, points)


@pytest.mark.parametrize(
    "off", [("symmetry",), ("halves",), ("prefetch",), ("symmetry", "fission"), NAMES], ids=" ".join
)
@pytest.mark.parametrize("level", LEVELS)
def test_each_pass_can_be_left_out_and_the_promise_stands(level: str, off: tuple[str, ...]) -> None:
    scene = Scene.chapter1(shininess=37.5)
    bound = {"double": 1e-15, "single": 5e-6, "fast": 1.0 / 255.0}[level]
    chosen = without(level, *off)
    image, values = image_and_points(scene, chosen, 30, 24)
    assert same_bits(image, values)
    drawing = draw(scene, chosen, size=(30, 24))
    for x, y, value in zip(*(a.ravel() for a in centres(drawing.pixel, 30, 24)), image.ravel(), strict=True):
        if (x, y) != (0.0, 0.0) and abs(x) + abs(y) < 1.5:
            assert abs(float(value) - oracle.evaluate(scene, x, y).value) <= bound


@pytest.mark.parametrize("level", ["single", "double"])
@pytest.mark.parametrize("shininess", [8.0, 10.0, 32.0, 100.0])
def test_an_even_whole_exponent_takes_the_shortcut_and_keeps_the_promise(level: str, shininess: float) -> None:
    """The same kernel with and without it."""
    scene = Scene.chapter1(shininess=shininess)
    image, values = image_and_points(scene, level, 40, 33)
    plain, _ = image_and_points(scene, without(level, "whole"), 40, 33)
    assert same_bits(image, values)
    assert not same_bits(image, plain), "it was taken"
    bound = {"double": 2e-15, "single": 5e-6}[level]
    assert np.max(np.abs(image.astype(np.float64) - plain)) <= bound


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("shininess", [0.0, 1.0, 2.0, 2.5, 6.0, 37.5, 33.0, 1026.0, 1e300])
def test_other_exponents_take_the_way_of_all(level: str, shininess: float) -> None:
    scene = Scene.chapter1(shininess=shininess)
    image, _ = image_and_points(scene, level, 40, 33)
    plain, _ = image_and_points(scene, without(level, "whole"), 40, 33)
    assert same_bits(image, plain)


def test_with_all_passes_off_a_pixel_is_one_function() -> None:
    text = translate(Scene.chapter1(), without("double", *NAMES)).emitted.files
    source = next(body for name, body in text.items() if name.endswith(".c"))
    assert "shade(" in source
    assert "stage_1" not in source
    assert "power_of_cosine(" in source
