"""elementary.h against mpmath: each function in each format within its proved bound, and what it says at the edges."""

from __future__ import annotations

import dataclasses
import math
import platform
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from c_harness import COMPILERS, SUPPORT, compile_c, loop_line, vectorised_lines
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from symrender_cg.functions.elementary import elementary_bounds, logarithms
from symrender_cg.functions.elementary_header import render_elementary_header
from symrender_cg.functions.elementary_pairs import dd_bounds
from symrender_cg.functions.formats import DOUBLE, FLOAT, Format

Array = NDArray[Any]

INF, NAN = math.inf, math.nan
NAMES = ("exp2", "log2", "expm1", "log1p", "pow")
SUFFIXES = {DOUBLE: "double", FLOAT: "single"}
FORMATS = (DOUBLE, FLOAT)
TRUE: dict[str, Callable[[Any, Any], Any]] = {
    "exp2": lambda x, _: mpmath.power(2, x),
    "log2": lambda x, _: mpmath.log(x) / mpmath.log(2),
    "expm1": lambda x, _: mpmath.expm1(x),
    "log1p": lambda x, _: mpmath.log1p(x),
    "pow": mpmath.power,
}
CASES = [(form, name, compiler) for form in FORMATS for name in NAMES for compiler in COMPILERS]
PAIR_CASES = [(name, compiler) for name in NAMES for compiler in COMPILERS]


def snippet(name: str, form: Format) -> str:
    arguments = "x[i], y[i]" if name == "pow" else "x[i]"
    return f"""
#include "elementary.h"
#include <stddef.h>

void run(const {form.name} *restrict x, const {form.name} *restrict y, {form.name} *restrict out, ptrdiff_t count)
{{
    (void)y;
    for (ptrdiff_t i = 0; i < count; ++i)
        out[i] = {name}_{SUFFIXES[form]}({arguments});
}}
"""


def pair_snippet(name: str) -> str:
    arguments = "number, y[i]" if name == "pow" else "number"
    return f"""
#include "elementary.h"
#include <stddef.h>

void run(const double *restrict x, const double *restrict x_lo, const double *restrict y, double *restrict hi,
         double *restrict lo, ptrdiff_t count)
{{
    (void)y;
    for (ptrdiff_t i = 0; i < count; ++i) {{
        const double_double number = {{x[i], x_lo[i]}};
        const double_double result = dd_{name}({arguments});
        hi[i] = result.hi;
        lo[i] = result.lo;
    }}
}}
"""


def run(name: str, form: Format, x: Any, y: Any = 0.0, *, compiler: str = "gcc") -> Array:
    kind = np.float64 if form is DOUBLE else np.float32
    columns = [np.ascontiguousarray(c) for c in np.broadcast_arrays(np.asarray(x, kind), np.asarray(y, kind))]
    out = np.empty_like(columns[0])
    declaration = f"void run(const {form.name} *, const {form.name} *, {form.name} *, ptrdiff_t);"
    compile_c(snippet(name, form), declaration, compiler=compiler).call("run", *columns, out, out.size)
    return out


def run_pairs(name: str, x: Any, x_lo: Any = 0.0, y: Any = 0.0, *, compiler: str = "gcc") -> tuple[Array, Array]:
    columns = [np.ascontiguousarray(c) for c in np.broadcast_arrays(*(np.asarray(c, np.float64) for c in (x, x_lo, y)))]
    hi, lo = np.empty_like(columns[0]), np.empty_like(columns[0])
    declaration = "void run(const double *, const double *, const double *, double *, double *, ptrdiff_t);"
    compile_c(pair_snippet(name), declaration, compiler=compiler).call("run", *columns, hi, lo, hi.size)
    return hi, lo


def relative_error(name: str, result: Any, x: Any, y: float) -> Any:
    true = TRUE[name](x, y)
    return abs((result - true) / true) if true else abs(mpmath.mpf(result))


def largest_error(name: str, form: Format, x: Array, y: Array, *, compiler: str = "gcc") -> float:
    """Largest error in unit roundoffs, where the result is a normal number."""
    smallest, largest = 2.0 ** (1 - form.bias), (2.0 - 2.0**-20) * 2.0**form.bias
    results = run(name, form, x, y, compiler=compiler)
    normal = (np.abs(results) >= smallest) & (np.abs(results) <= largest)
    assert np.count_nonzero(normal) > 0.8 * x.size
    rows = zip(*(column[normal].tolist() for column in (results, x, y)), strict=True)
    with mpmath.workdps(60):
        return float(max(relative_error(name, r, mpmath.mpf(a), b) for r, a, b in rows) * 2**form.precision)


def arguments(name: str, form: Format, count: int, seed: int) -> tuple[Array, Array]:
    """Arguments of every size for which the result is neither beyond the range nor below it."""
    draw = np.random.default_rng(seed)
    kind = np.float64 if form is DOUBLE else np.float32
    depth, limit = form.bias - 2, (form.bias - 2) * math.log(2.0)
    sign = draw.choice([-1.0, 1.0], count)
    sizes = 10.0 ** draw.uniform(-4.0, 0.0, count)
    binades = draw.uniform(1.0, 2.0, count) * 2.0 ** draw.integers(-depth, depth, count)
    near_one = 1.0 + sign * 10.0 ** draw.uniform(-6.0, -0.31, count)
    columns = {
        "exp2": (depth * sign * sizes, depth * draw.uniform(-1.0, 1.0, count)),
        "log2": (binades, near_one),
        "expm1": (limit * np.where(sign > 0.0, 1.0, -0.3) * sizes, sign * 10.0 ** draw.uniform(-12.0, 0.0, count)),
        "log1p": (sign * 10.0 ** draw.uniform(-12.0, -0.01, count), binades),
        "pow": (binades, near_one),
    }
    x = np.concatenate(columns[name]).astype(kind)
    x = x[(x != 1.0) & (x != 0.0)]
    y = np.zeros_like(x)
    if name == "pow":
        log2 = np.log2(x.astype(np.float64))
        y = (draw.uniform(-0.99, 0.99, x.size) * depth / np.where(log2 == 0.0, 1.0, log2)).astype(kind)
    return x, y


@pytest.mark.parametrize(("form", "name", "compiler"), CASES)
def test_a_function_stays_within_its_proved_bound(form: Format, name: str, compiler: str) -> None:
    error = largest_error(name, form, *arguments(name, form, 300, seed=61), compiler=compiler)
    assert error <= getattr(elementary_bounds(form), name)


# The worst arguments found and their error in u. float: of all 2^32 numbers (pow: 2^27 pairs); double: of about 10^8.
WORST: dict[Format, dict[str, tuple[str, str, float]]] = {
    FLOAT: {
        "exp2": ("0x1.023406p-1", "0", 1.557),
        "log2": ("0x1.6a5bdcp+0", "0", 2.606),
        "expm1": ("0x1.6341p-2", "0", 3.991),
        "log1p": ("0x1.88053cp-2", "0", 1.831),
        "pow": ("0x1.71d73cp+32", "0x1.b0d27p+1", 0.999),
    },
    DOUBLE: {
        "exp2": ("-0x1.3ded8dd19b452p+1", "0", 1.612),
        "log2": ("0x1.6a98bf97626a7p+0", "0", 2.659),
        "expm1": ("0x1.62e6303467b47p-2", "0", 3.273),
        "log1p": ("0x1.86a04aec918c4p-2", "0", 1.799),
        "pow": ("0x1.3d3df337d346cp+1", "0x1.c6648d2e588dcp+8", 0.999),
    },
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", FORMATS, ids=SUFFIXES.get)
def test_the_worst_known_arguments_err_as_much_as_was_measured_and_no_more(form: Format, name: str) -> None:
    x, y, measured = WORST[form][name]
    kind = np.float64 if form is DOUBLE else np.float32
    columns = (np.array([float.fromhex(c)], dtype=kind) for c in (x, y))
    assert measured <= largest_error(name, form, *columns) <= measured + 0.0011


@pytest.mark.parametrize("form", FORMATS, ids=SUFFIXES.get)
@settings(max_examples=150, deadline=None)
@given(number=st.floats(2.0**-100, 2.0**100, width=32), exponent=st.floats(-80.0, 80.0, width=32))
def test_no_argument_that_hypothesis_finds_breaks_a_bound(form: Format, number: float, exponent: float) -> None:
    kind = np.float64 if form is DOUBLE else np.float32
    points = {"exp2": exponent, "log2": number, "expm1": exponent, "log1p": number, "pow": number}
    for name, x in points.items():
        y = exponent / max(1.0, abs(math.log2(number))) if name == "pow" else 0.0
        result = run(name, form, [x], [y])
        with mpmath.workdps(60):
            error = relative_error(name, float(result[0]), mpmath.mpf(float(kind(x))), float(kind(y)))
        assert error * 2**form.precision <= getattr(elementary_bounds(form), name) or float(kind(x)) == 0.0


@pytest.mark.parametrize(("name", "compiler"), PAIR_CASES)
def test_a_double_double_function_stays_within_its_proved_bound(name: str, compiler: str) -> None:
    draw = np.random.default_rng(62)
    x, y = arguments(name, DOUBLE, 150, seed=63)
    keep = np.abs(x) < 2.0**900 if name != "expm1" else x < 620.0
    x, y = x[keep], 0.85 * y[keep]
    x_lo = 0.5 * np.spacing(np.abs(x)) * draw.uniform(-1.0, 1.0, x.size)
    hi, lo = run_pairs(name, x, x_lo, y, compiler=compiler)
    with mpmath.workdps(80):
        errors = [
            relative_error(name, mpmath.mpf(h) + low, mpmath.mpf(a) + b, c)
            for h, low, a, b, c in zip(*(c.tolist() for c in (hi, lo, x, x_lo, y)), strict=True)
            if 2.0**-900 <= abs(h) < INF
        ]
        assert len(errors) > 0.8 * x.size
        assert max(errors) <= getattr(dd_bounds(), name)
    safe = np.abs(hi) >= 2.0**-900
    assert np.array_equal((hi + lo)[safe], hi[safe])


# The worst of 20,000 each, as powers of two: far from the bounds, which add up what rarely happens at once.
WORST_PAIRS = {
    "exp2": ("0x1.b744629f2474ap-2", "0x1.e82b950fed95fp-56", "0", -98.94),
    "log2": ("0x1.d480196894da5p-1", "-0x1.526e7591c103ap-55", "0", -103.46),
    "expm1": ("0x1.339a35f4d7a4bp+9", "0x1.d2b49d37a6506p-45", "0", -96.05),
    "log1p": ("0x1.1c46c640ae464p-5", "0x1.913302a666d4dp-59", "0", -102.76),
    "pow": ("0x1.7e8cb1ee1e6d5p+1", "0x1.0548665d7d845p-56", "0x1.1376b96eae150p+9", -95.73),
}


@pytest.mark.parametrize("name", NAMES)
def test_the_worst_known_double_doubles_err_as_much_as_was_measured_and_no_more(name: str) -> None:
    x, x_lo, y = (float.fromhex(c) for c in WORST_PAIRS[name][:3])
    hi, lo = run_pairs(name, [x], x_lo, y)
    with mpmath.workdps(80):
        error = relative_error(name, mpmath.mpf(float(hi[0])) + float(lo[0]), mpmath.mpf(x) + x_lo, y)
        assert abs(float(mpmath.log(error, 2)) - WORST_PAIRS[name][3]) <= 0.02


def same(results: Array, expected: list[float]) -> bool:
    return np.array_equal(results, np.array(expected, dtype=results.dtype), equal_nan=True)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("form", FORMATS, ids=SUFFIXES.get)
def test_edges_of_the_range_have_the_values_that_mathematics_gives_them(form: Format, compiler: str) -> None:
    huge, smallest = 3e38, 2.0 ** (2 - form.bias - form.precision)

    def at(name: str, x: list[float], y: list[float] | float = 0.0) -> Array:
        return run(name, form, x, y, compiler=compiler)

    assert same(at("exp2", [-INF, -huge, 0.0, 1.0, -2.0, huge, INF, NAN]), [0.0, 0.0, 1.0, 2.0, 0.25, INF, INF, NAN])
    assert same(at("log2", [-1.0, 0.0, 0.25, 1.0, 2.0, INF, NAN]), [NAN, -INF, -2.0, 0.0, 1.0, INF, NAN])
    assert same(at("log2", [smallest]), [2.0 - form.bias - form.precision])
    tiny = [-1e-30, -smallest, 0.0, smallest, 1e-30]
    assert same(at("expm1", [-INF, -huge, *tiny, huge, INF, NAN]), [-1.0, -1.0, *tiny, INF, INF, NAN])
    assert same(at("log1p", [-2.0, -1.0, *tiny, INF, NAN]), [NAN, -INF, *tiny, INF, NAN])
    assert same(at("pow", [0.0, 0.0, 0.0, 1.0, INF, INF, -1.0], [0.0, 2.0, -2.0, huge, 2.0, -2.0, 2.0]),
                [1.0, 0.0, INF, 1.0, INF, 0.0, NAN])  # fmt: skip
    assert same(at("pow", [2.0, 2.0, 0.5, 0.5, NAN], [huge, -huge, huge, -huge, 1.0]), [INF, 0.0, 0.0, INF, NAN])


@pytest.mark.parametrize("form", FORMATS, ids=SUFFIXES.get)
def test_a_power_of_two_below_the_normal_numbers_is_within_half_of_the_smallest_one(form: Format) -> None:
    lowest = 1 - form.bias
    y = np.random.default_rng(64).uniform(lowest - form.precision, lowest, 400)
    y = y.astype(np.float64 if form is DOUBLE else np.float32)
    smallest = mpmath.mpf(2) ** (lowest - form.precision + 1)
    for value, exponent in zip(run("exp2", form, y).tolist(), y.tolist(), strict=True):
        assert (
            abs(value - mpmath.power(2, exponent))
            <= 0.5000001 * smallest + mpmath.power(2, exponent - form.precision) * 2
        )


def test_double_double_edges_are_infinite_zero_or_one_and_never_carry_a_low_part() -> None:
    hi, lo = run_pairs("pow", [0.0, 0.0, 0.0, 2.0, 2.0, 0.5], 0.0, [0.0, 2.0, -2.0, 2000.0, -2000.0, 0.0])
    assert (hi.tolist(), lo.tolist()) == ([1.0, 0.0, INF, INF, 0.0, 1.0], [0.0] * 6)
    hi, lo = run_pairs("exp2", [-2000.0, 0.0, 2000.0])
    assert (hi.tolist(), lo.tolist()) == ([0.0, 1.0, INF], [0.0] * 3)
    hi, lo = run_pairs("log2", [1.0, 2.0, 2.0**1022])
    assert (hi.tolist(), lo.tolist()) == ([0.0, 1.0, 1022.0], [0.0] * 3)


def test_ln2_of_a_format_is_split_so_that_every_exponent_times_its_first_part_is_exact() -> None:
    for form in FORMATS:
        constants = logarithms(form)
        assert all(
            form.round(k * constants.ln2_high) == k * constants.ln2_high for k in range(-form.bias - 60, form.bias)
        )
        with mpmath.workdps(60):
            rest = mpmath.log(2) - constants.ln2_high - constants.ln2_low
            assert abs(rest) <= mpmath.mpf(2) ** (-2 * form.precision + form.width - form.precision)


@pytest.mark.parametrize("form", FORMATS, ids=SUFFIXES.get)
def test_every_compiler_gives_the_same_bits(form: Format) -> None:
    for name in NAMES:
        x, y = arguments(name, form, 200, seed=65)
        results = [run(name, form, x, y, compiler=compiler) for compiler in COMPILERS]
        assert all(np.array_equal(result, results[0]) for result in results)


TARGETS = ((), ("-march=x86-64-v3",)) if platform.machine() == "x86_64" else ((),)


@pytest.mark.parametrize("target", TARGETS, ids=lambda flags: "".join(flags) or "native")
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", NAMES)
def test_every_loop_over_the_header_vectorises(name: str, compiler: str, target: tuple[str, ...]) -> None:
    for source in (pair_snippet(name), *(snippet(name, form) for form in FORMATS)):
        widths = vectorised_lines(source, compiler=compiler, extra_flags=target)
        assert widths.get(loop_line(source), 0) >= (32 if compiler == "gcc" else 4)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("flags", ["-O0", "-O2"])
def test_the_header_compiles_without_a_warning_used_or_not(compiler: str, flags: str) -> None:
    nothing = (
        '#include "elementary.h"\n#include "fast_power.h"\n#include "phong_power.h"\nint unused(void) { return 0; }\n'
    )
    compile_c(nothing, "int unused(void);", compiler=compiler, extra_flags=(flags,))


def test_the_header_is_what_its_template_and_tables_give() -> None:
    rendered = render_elementary_header((SUPPORT / "elementary.h.j2").read_text())
    assert rendered == (SUPPORT / "elementary.h").read_text(), "run: python -m symrender_cg.functions --write"


def test_the_header_states_every_bound() -> None:
    text = (SUPPORT / "elementary.h").read_text()
    for name, bound in dataclasses.asdict(dd_bounds()).items():
        stated = next(line for line in text.splitlines() if line.startswith(f" *   {name} "))
        assert stated.endswith(f"2^{math.floor(-10.0 * math.log2(bound)) / -10.0:.1f}")
