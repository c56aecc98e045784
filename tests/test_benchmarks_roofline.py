"""`python -m benchmarks roofline`: operations counted as by hand, bounds that follow their laws."""

from __future__ import annotations

import io
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.machine import this_machine
from benchmarks.roofline.chart import draw_chart
from benchmarks.roofline.counting import LOOP, Work, functions_of, operations_in, work_of
from benchmarks.roofline.measure import row
from benchmarks.roofline.peaks import CHAINS, FORMATS, Peaks, measure_peaks
from benchmarks.roofline.report import Report
from symrender_cg import Scene, translate
from symrender_cg.build import find_toolchain
from symrender_cg.errors import ArgumentError
from symrender_cg.lower.program import operations_of
from symrender_cg.pipeline import SphereTranslation
from symrender_cg.resources import template_path

C = """
/* a * b + c, in a comment */
static inline double fused(double a, double b, double c)
{
    return fma(a, b, c);
}

SYMRENDER_INLINE double both(double a, double b)
{
    const double s = a / (2.0 + a), z = s * s;   /* 1 / 2 */
    double p = -0.5;
    p = p * z + (a - -1.5e-3 * b);
    const int is_small = a < b;
    const uint64_t bits = (power_bits(a) << 52) + 7;
    return is_small ? sqrt(p) : fused(p, s, fused(a, b, z)) - (double)INFINITY;
}

static inline uint64_t power_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}
"""


def translation(accuracy: str, *, bake: bool = False) -> SphereTranslation:
    found = translate(Scene.chapter1(), accuracy, bake=bake)
    assert isinstance(found, SphereTranslation)
    return found


def test_operations_of_a_c_function_are_those_counted_by_hand() -> None:
    counts = operations_in("both", functions_of({"a.h": C}))
    assert counts == Counter({"div": 1, "add": 4, "mul": 3, "sqrt": 1, "fma": 2, "select": 1, "int": 2})


def test_the_logarithm_of_the_power_has_its_operations() -> None:
    text = template_path("support/power.h").read_text(encoding="utf-8")
    functions = functions_of({"power.h": text})
    assert operations_in("power_ln_of_sum", functions) == Counter({"mul": 12, "add": 10, "div": 1})
    assert operations_in("power_exp2_minus_one", functions) == Counter({"mul": 12, "add": 10})


def test_a_function_that_is_nowhere_is_an_error() -> None:
    with pytest.raises(ArgumentError, match=r"'mystery'.*not found"):
        operations_in("mystery", functions_of({"a.h": C}))


@pytest.mark.parametrize("accuracy", ["literal", "double", "single", "fast"])
def test_no_operation_of_the_program_is_left_out(accuracy: str) -> None:
    found = translation(accuracy)
    whole = replace(found, program=replace(found.program, stages=(), mirrored=0, twins=0))
    work = work_of(whole)
    steps: Counter[str] = Counter()
    for step in whole.program.at("pixel"):
        steps += operations_of(step)
    for kind in ("mul", "add", "div", "sqrt"):
        counted = sum(count for (_, name), count in work.operations.items() if name == kind)
        assert counted >= steps[kind] + LOOP[kind] > 0
    assert work.bytes == (8 if accuracy in ("literal", "double") else 4)


@pytest.mark.parametrize(("twins", "part"), [(0, 0.5), (1, 0.25)])
def test_what_pixels_share_counts_in_part_for_each(twins: int, part: float) -> None:
    found = translation("double")
    names = tuple(step.name for step in found.program.at("pixel"))
    whole = work_of(replace(found, program=replace(found.program, stages=(), mirrored=0, twins=0)))
    shared = work_of(replace(found, program=replace(found.program, stages=(names,), mirrored=1, twins=twins)))
    for key, count in whole.operations.items():
        outside = LOOP[key[1]] if key[0] == "float64" else 0
        assert shared.operations[key] == pytest.approx(outside + part * (count - outside))


def test_baking_the_exponent_takes_the_power_out() -> None:
    general, baked = work_of(translation("double")), work_of(translation("double", bake=True))
    assert baked.flops() < general.flops()
    assert not baked.operations.get(("float64", "int"))


def made_peaks(*, pipes_apart: bool, units_apart: bool) -> Peaks:
    """A machine that does a mul, an add or a select a ns, a div in 4, a sqrt in 8; float32 twice as fast."""
    step = {"mul": 1.0, "add": 1.0, "select": 1.0, "fma": 1.0, "div": 4.0, "sqrt": 8.0}
    step |= {"mul add": 1.0 if pipes_apart else 2.0, "div sqrt": 8.0 if units_apart else 12.0}
    each = {(form, kind): ns / (1.0 if form == "float64" else 2.0) for form in FORMATS for kind, ns in step.items()}
    return Peaks(each, {(form, size): 0.25 for form in FORMATS for size in (64, 4096)})


OPERATIONS = {("float64", "mul"): 10.0, ("float64", "add"): 6.0, ("float64", "div"): 2.0, ("float64", "sqrt"): 3.0}


def test_pipes_that_are_apart_take_the_longer_and_one_pipe_takes_the_sum() -> None:
    assert made_peaks(pipes_apart=True, units_apart=True).pipes_ns(OPERATIONS) == 10.0
    assert made_peaks(pipes_apart=False, units_apart=True).pipes_ns(OPERATIONS) == 16.0
    assert made_peaks(pipes_apart=True, units_apart=True).divider_ns(OPERATIONS) == 24.0
    assert made_peaks(pipes_apart=True, units_apart=False).divider_ns(OPERATIONS) == 32.0


def test_bounds_grow_with_every_operation_and_double_with_all_of_them() -> None:
    for peaks in (made_peaks(pipes_apart=True, units_apart=False), made_peaks(pipes_apart=False, units_apart=True)):
        twice = {key: 2.0 * count for key, count in OPERATIONS.items()}
        assert peaks.pipes_ns(twice) == pytest.approx(2.0 * peaks.pipes_ns(OPERATIONS))
        assert peaks.divider_ns(twice) == pytest.approx(2.0 * peaks.divider_ns(OPERATIONS))
        more = {**OPERATIONS, ("float32", "mul"): 4.0}
        assert peaks.pipes_ns(more) == pytest.approx(peaks.pipes_ns(OPERATIONS) + 2.0)
        assert peaks.pipes_ns({("float64", "int"): 100.0}) == 0.0


def test_every_loop_of_the_peaks_compiles_and_measures_something() -> None:
    peaks = measure_peaks(find_toolchain(), (64, 4096), 1, 1, lambda text: None)
    assert set(peaks.step_ns) == {(form, kind) for form in FORMATS for kind in CHAINS}
    assert all(0.0 < value < 1e3 for value in (*peaks.step_ns.values(), *peaks.store_ns.values()))
    assert peaks.gflops("float64", "fma") == 2.0 / peaks.step_ns["float64", "fma"]


def made_report() -> Report:
    peaks = made_peaks(pipes_apart=True, units_apart=True)
    rows = tuple(
        row(name, Work(OPERATIONS, size, everywhere), 8, 0.5, 30.0, peaks)
        for name, size, everywhere in (("double", 8, False), ("single", 4, False), ("literal", 8, True))
    )
    levels = {form: {kind: peaks.gflops(form, kind) for kind in CHAINS if " " not in kind} for form in FORMATS}
    return Report(this_machine(), 1, levels, {form: {"8": 4.0} for form in FORMATS}, rows)


def test_background_that_is_filled_is_no_work_and_is_stored_all_the_same() -> None:
    double, _, literal = made_report().rows
    assert (double.pipes_ns, double.divider_ns, double.store_ns) == (5.0, 12.0, 2.0)
    assert (literal.pipes_ns, literal.divider_ns, literal.store_ns) == (10.0, 24.0, 2.0)
    assert (double.flops, literal.flops) == (10.5, 21.0)
    assert double.bound == "divider"
    assert double.times_bound == 30.0 / 12.0


def test_the_report_shows_every_kernel_and_is_json(tmp_path: Path) -> None:
    report = made_report()
    console = Console(width=200, file=io.StringIO())
    report.show(console)
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert all(name in text for name in ("double", "single", "literal", "divider", "times the bound"))
    assert json.dumps(report.to_dict())
    draw_chart(report, tmp_path / "roof.png")
    assert (tmp_path / "roof.png").read_bytes()[:4] == b"\x89PNG"
