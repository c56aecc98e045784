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
from symrender_cg.lower.anchors import anchor, anchoring, narrow_products
from symrender_cg.lower.fission import crossing, cut, cycles, weight
from symrender_cg.lower.formats import convert_formats
from symrender_cg.lower.freeze import freeze
from symrender_cg.lower.program import KernelProgram, Step
from symrender_cg.lower.switches import NAMES, Passes
from symrender_cg.lower.symmetry import alike_in_twin_rows, gather_mirrored, parities
from symrender_cg.lower.variants import Variant, variant
from symrender_cg.pipeline import SphereTranslation, draw, translate
from symrender_cg.reference import oracle
from symrender_cg.run.pool import NativeRows
from symrender_cg.scene import Scene

LEVELS = ("fast", "single", "double")
STAGED = tuple(name for name in STRUCTURES if not name.startswith("any_sphere") and not name.endswith("_flat"))
"""Structures whose pixels differ, and whose rows of hits have ends in closed form."""

CENTRED = tuple(name for name in STAGED if name.startswith("centred_sphere"))
X, Y, A, REACH = (*symbols("x y"), symbol("a"), symbol("reach"))


CLOSE = {"single": 3e-6, "fast": 4e-4}
"""Rows count pixels in float32 where points do not: both are within the promise, some units in the last place apart,
and for fast, where one of its polynomials gives way to the next, twice the bound of a power."""


def without(level: str, *passes: str) -> Variant:
    """A level with some of its passes off."""
    found = variant(level)
    return replace(found, name=f"{level}_without", passes=Passes().without(*passes))


def uncounted(level: str) -> str | Variant:
    """A level whose rows and points have the same bits: the pixels of its rows are not counted in float32."""
    return level if level == "double" else without(level, "anchors")


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
        image, values = image_and_points(scene, uncounted(level), width, height)
        assert same_bits(image, values), (width, height)


@pytest.mark.parametrize("level", ["fast", "single"])
@pytest.mark.parametrize("name", ["centred_sphere", "centred_sphere_gated", "off_axis_sphere", "off_axis_sphere_matte"])
def test_pixels_counted_in_float32_are_close_to_points(name: str, level: str) -> None:
    """Widths: odd, even, beyond one block, not whole vectors. What hits is the same."""
    scene = STRUCTURES[name]
    for width, height in ((1, 5), (2, 4), (37, 11), (611, 4)):
        image, values = image_and_points(scene, level, width, height)
        assert np.max(np.abs(image - values)) <= CLOSE[level], (width, height)
        assert np.array_equal(image == scene.background, values == scene.background)


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


# ---- rows at y and -y


@pytest.mark.parametrize(
    ("steps", "alike"),
    [
        ((step("value", X**2 + Y**2),), {"value"}),
        ((step("value", X * A),), {"value"}),
        ((step("value", X + Y),), set()),
        ((step("odd", X * Y), step("value", symbol("odd") ** 2)), set()),
        ((step("even", X + Y**2), step("value", symbol("even") * Y)), {"even"}),
    ],
    ids=str,
)
def test_rows_share_what_does_not_change_with_the_sign_of_y(steps: tuple[Step, ...], alike: set[str]) -> None:
    """An even step that is made of an odd one is left to each row, which has the odd one to itself."""
    program = span_program(*steps)
    even = program.map({"reach": symbol("b") + Y**2})
    assert alike_in_twin_rows(freeze(even)) == alike
    assert alike_in_twin_rows(freeze(program)) == frozenset(), "the hits of the two rows end elsewhere"
    assert alike_in_twin_rows(replace(freeze(even), ends=None)) == frozenset()


@pytest.mark.parametrize("level", LEVELS)
def test_only_spheres_on_the_axis_have_twin_rows(level: str) -> None:
    for name in STRUCTURES:
        program = translated(name, level).program
        assert (program.twins > 0) == (name in CENTRED), name
        shared = {entry for stage in program.stages[: program.twins] for entry in stage}
        assert shared <= alike_in_twin_rows(program)
        assert ("_row_pairs" in translated(name, level).emitted.cdef) == (name in CENTRED)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("height", [1, 2, 7, 12])
def test_any_range_of_rows_has_the_bits_of_the_image_and_writes_no_other_row(level: str, height: int) -> None:
    drawing = draw(STRUCTURES["centred_sphere"], level, size=(37, height))
    whole = np.empty((height, 37), drawing.dtype)
    drawing.rows(whole, 0, height)
    for begin, end in itertools.combinations(range(height + 1), 2):
        image = np.full((height, 37), -7.0, drawing.dtype)
        drawing.rows(image, begin, end)
        assert same_bits(image[begin:end], whole[begin:end]), (begin, end)
        assert (image[:begin] == -7.0).all(), (begin, end)
        assert (image[end:] == -7.0).all(), (begin, end)


@pytest.mark.parametrize("level", LEVELS)
def test_rows_that_share_have_the_bits_of_rows_that_do_not(level: str) -> None:
    scene = STRUCTURES["centred_sphere"]
    for width, height in ((64, 48), (301, 33)):
        image, _ = image_and_points(scene, level, width, height)
        alone, _ = image_and_points(scene, without(level, "twins"), width, height)
        assert same_bits(image, alone)


@pytest.mark.parametrize("height", [5, 8])
def test_a_folded_image_is_drawn_from_both_ends(height: int) -> None:
    drawing = draw(STRUCTURES["centred_sphere"], "double", size=(16, height))
    image, whole = np.full((height, 16), -7.0), np.empty((height, 16))
    drawing.rows(whole, 0, height)
    rows = drawing.onto(image)
    assert isinstance(rows, NativeRows)
    folded = rows.folded(0, height)
    assert folded is not None
    folded(1, 2)
    drawn = [1, height - 2]
    assert same_bits(image[drawn], whole[drawn])
    assert (np.delete(image, drawn, axis=0) == -7.0).all()
    assert rows.folded(0, height - 1) is None, "a part of the image"
    assert folded.folded(0, height) is None, "folded once"


# ---- stages


@pytest.mark.parametrize("bake", [False, True], ids=["arguments", "baked"])
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", STRUCTURES)
def test_stages_hold_each_step_once_and_nothing_before_what_it_uses(name: str, level: str, bake: bool) -> None:
    program = translated(name, level, bake).program
    order = [entry for stage in program.stages for entry in stage]
    assert bool(order) == (name in STAGED)
    assert len(set(order)) == len(order)
    pixel = {entry.name for entry in program.at("pixel")} - dict(program.anchors).keys()
    assert not pixel & dict(program.anchors).keys()
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
    assert cut(program, fission=True, symmetry=True, twins=True) == program
    assert program.text() == text
    assert len(cut(replace(program, shortcut=None), fission=False, symmetry=False, twins=False).stages) == 1


# ---- switches


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", ["centred_sphere", "off_axis_sphere", "centred_sphere_gated"])
def test_fission_changes_no_bit(name: str, level: str) -> None:
    scene = STRUCTURES[name]
    with_it, _ = image_and_points(scene, without(level, "whole"), 61, 40)
    whole, points = image_and_points(scene, without(level, "fission"), 61, 40)
    assert same_bits(with_it, whole)
    assert same_bits(whole, points) if level == "double" else np.max(np.abs(whole - points)) <= CLOSE[level]


@pytest.mark.parametrize(
    "off",
    [("symmetry",), ("twins",), ("halves",), ("anchors",), ("prefetch",), ("symmetry", "fission"), NAMES],
    ids=" ".join,
)
@pytest.mark.parametrize("level", LEVELS)
def test_each_pass_can_be_left_out_and_the_promise_stands(level: str, off: tuple[str, ...]) -> None:
    scene = Scene.chapter1(shininess=37.5)
    bound = {"double": 1e-15, "single": 5e-6, "fast": 1.0 / 255.0}[level]
    chosen = without(level, *off)
    image, values = image_and_points(scene, chosen, 30, 24)
    counted = level != "double" and "anchors" not in off and chosen.passes.staged
    assert np.max(np.abs(image - values)) <= CLOSE[level] if counted else same_bits(image, values)
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
    assert same_bits(image, values) if level == "double" else np.max(np.abs(image - values)) <= CLOSE[level]
    assert not same_bits(image, plain), "it was taken"
    bound = {"double": 2e-15, "single": 5e-6}[level]
    assert np.max(np.abs(image.astype(np.float64) - plain)) <= bound


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("shininess", [0.0, 1.0, 2.0, 2.5, 6.0, 37.5, 33.0, 1026.0, 1e300])
def test_other_exponents_take_the_way_of_all(level: str, shininess: float) -> None:
    scene = Scene.chapter1(shininess=shininess)
    image, _ = image_and_points(scene, without(level), 40, 33)
    plain, _ = image_and_points(scene, without(level, "whole"), 40, 33)
    assert same_bits(image, plain) == (level != "fast" or not 32.0 <= shininess < 1e10)


@pytest.mark.parametrize("shininess", [32.0, 37.5, 100.0, 999.5])
def test_a_narrow_lobe_of_fast_stays_within_a_grey_level(shininess: float) -> None:
    """Against float64; the bound is that of the power, doubled for cos^2 in float32."""
    scene = Scene.chapter1(shininess=shininess)
    image, _ = image_and_points(scene, "fast", 200, 200)
    exact, _ = image_and_points(scene, "double", 200, 200)
    assert np.max(np.abs(image - exact)) <= 4e-4


# ---- anchors


@pytest.mark.parametrize("level", ["fast", "single"])
@pytest.mark.parametrize("name", STAGED)
def test_what_moves_with_x_is_counted_and_no_stage_needs_x(name: str, level: str) -> None:
    program = translated(name, level).program
    places = dict(program.anchors)
    assert (places["from_left_single"], places["x_single"], places["to_right_single"]) == ("first", "middle", "last")
    staged = {entry for stage in program.stages for entry in stage}
    assert all(program[entry].format == "float32" for entry in staged)
    assert "x" not in {used for entry in staged for used in program[entry].uses()}
    assert {entry.name for entry in anchoring(program)} >= {"from_left", "to_right"}


def test_double_counts_no_pixels() -> None:
    assert translated("centred_sphere", "double").program.anchors == ()


@pytest.mark.parametrize(
    ("value", "place"),
    [
        (X - A, "middle"),
        (X - symbol("x_left"), "first"),
        (symbol("x_right") - X, "last"),
        (A - X, None),
        (2 * X, None),
        (X**2, None),
        (X + X * A, None),
        (A * 2, None),
    ],
    ids=str,
)
def test_an_anchor_moves_one_for_one_with_x_and_is_counted_from_where_it_vanishes(
    value: sp.Expr, place: str | None
) -> None:
    program = freeze(
        span_program(step("moved", value), replace(step("result", symbol("moved") ** 2), format="float32"))
    )
    found = anchor(convert_formats(program)).anchors
    assert found == ((("moved_single", place),) if place else ())


def test_where_x_is_used_otherwise_nothing_is_counted() -> None:
    far, wide = replace(step("far", symbol("moved") * symbol("wide")), format="float32"), step("wide", X**2)
    program = convert_formats(freeze(span_program(step("moved", X - A), wide, far)))
    assert anchor(program).anchors == ()


def test_only_products_are_narrowed() -> None:
    moved, narrow = symbol("moved"), step("chord", symbol("moved") * A)
    program = span_program(step("moved", X - A), narrow, step("sum", moved + A), step("result", moved**2 * A))
    formats = {entry.name: entry.format for entry in narrow_products(program).at("pixel")}
    assert formats == {"moved": "float64", "chord": "float32", "sum": "float64", "result": "float64"}
    assert narrow_products(narrow_products(program)) == narrow_products(program)


@pytest.mark.parametrize("level", ["fast", "single"])
@pytest.mark.parametrize("eye", [1.0009, 4.0, 1e6, 2.0**49.9])
def test_the_outline_is_as_good_where_pixels_are_counted(level: str, eye: float) -> None:
    """The first and the last hit of every row of a wide image, where the root of a small difference is taken: as far
    from float64 as where each pixel is computed from its own x."""
    scene = Scene.chapter1(eye=eye, shininess=37.5)
    bound = {"single": 3e-6, "fast": 1e-3}[level]
    rows, _ = image_and_points(scene, level, 2001, 25)
    exact, points = image_and_points(scene, "double", 2001, 25)
    assert same_bits(exact, points)
    hit = exact != scene.background
    assert np.array_equal(rows != scene.background, hit)
    ends = [(j, i) for j in range(25) if hit[j].any() for i in np.nonzero(hit[j])[0][[0, -1]]]
    assert len(ends) > 30
    assert max(abs(float(rows[j, i]) - exact[j, i]) for j, i in ends) <= bound


def test_with_all_passes_off_a_pixel_is_one_function() -> None:
    text = translate(Scene.chapter1(), without("double", *NAMES)).emitted.files
    source = next(body for name, body in text.items() if name.endswith(".c"))
    assert "shade(" in source
    assert "stage_1" not in source
    assert "power_of_cosine(" in source
