"""precise_power.h against Arb: the laws of a power, the proved bounds, the vectors, and the header's own derivation."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Callable
from typing import Any

import flint
import mpmath
import numpy as np
import pytest
from c_harness import COMPILERS, SUPPORT, SnippetLibrary, compile_c, loop_line, vectorised_lines
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from symrender_cg.functions.pairs import (
    DOUBLE_DOUBLE,
    LARGEST_S,
    LOWEST_MANTISSA,
    PRECISE,
    ZONES,
    PairLevel,
    pair_tables,
)
from symrender_cg.functions.precise_header import as_power_of_two, proved_bounds, render_precise_header

Array = NDArray[Any]
Columns = tuple[Array, Array, Array, Array, Array]

LEVELS = (PRECISE, DOUBLE_DOUBLE)
BOTH = [(level, compiler) for level in LEVELS for compiler in COMPILERS]
named = pytest.mark.parametrize("level", LEVELS, ids=lambda level: level.prefix.rstrip("_"))

POWER = "{p}power_of_cosine(cos2, sin2, n[i])"
LOG2 = "{p}log2_of_parts(precise_split(cos2))"
EXP2 = "{p}exp2_of_fraction(cos2)"


def snippet(level: PairLevel, call: str) -> str:
    return f"""
#include "precise_power.h"
#include <stddef.h>

void run(const double *restrict cos2_hi, const double *restrict cos2_lo, const double *restrict sin2_hi,
         const double *restrict sin2_lo, const double *restrict n, double *restrict hi, double *restrict lo,
         ptrdiff_t count)
{{
    for (ptrdiff_t i = 0; i < count; ++i) {{
        const double_double cos2 = {{cos2_hi[i], cos2_lo[i]}}, sin2 = {{sin2_hi[i], sin2_lo[i]}};
        const double_double result = {call.format(p=level.prefix)};
        (void)cos2, (void)sin2, (void)n;
        hi[i] = result.hi;
        lo[i] = result.lo;
    }}
}}
"""


def library(level: PairLevel, call: str, compiler: str) -> SnippetLibrary:
    pointers = ", ".join(["const double *"] * 5 + ["double *"] * 2)
    return compile_c(snippet(level, call), f"void run({pointers}, ptrdiff_t);", compiler=compiler)


def run(level: PairLevel, *columns: Any, call: str = POWER, compiler: str = "gcc") -> tuple[Array, Array]:
    """(hi, lo); the columns are cos2.hi, cos2.lo, sin2.hi, sin2.lo, n, and missing ones are 0."""
    given_columns = [np.asarray(c, dtype=np.float64) for c in (*columns, *[0.0] * (5 - len(columns)))]
    arrays = [np.ascontiguousarray(c) for c in np.broadcast_arrays(*given_columns)]
    hi, lo = np.empty(arrays[0].shape), np.empty(arrays[0].shape)
    library(level, call, compiler).call("run", *arrays, hi, lo, hi.size)
    return hi, lo


def true_power(cos2: Any, sin2: Any, n: float, is_near: bool) -> Any:
    """cos^n from exact arguments, in Arb: from sin^2 where that is below 1/2."""
    log = (-sin2).log1p() if is_near else cos2.log()
    return (log * n / 2).exp()


def largest_error(level: PairLevel, columns: Columns, compiler: str = "gcc") -> float:
    """Largest error relative to the power: the upper end of a ball, never too small."""
    hi, lo = run(level, *columns, compiler=compiler)
    worst = 0.0
    with flint.ctx.workprec(300):
        for high, low, *row in zip(hi.tolist(), lo.tolist(), *(c.tolist() for c in columns), strict=True):
            c, c_lo, s, s_lo, n = row
            exact = true_power(flint.arb(c) + c_lo, flint.arb(s) + s_lo, n, s < 0.5)
            worst = max(worst, float((abs(flint.arb(high) + low - exact) / exact).upper()))
    return worst


def largest_relative(pairs: tuple[Array, Array], true: Callable[[Any], Any], x: Array, x_lo: Array) -> float:
    worst = 0.0
    with flint.ctx.workprec(300):
        for high, low, a, b in zip(*(c.tolist() for c in (*pairs, x, x_lo)), strict=True):
            exact = true(flint.arb(a) + b)
            worst = max(worst, float((abs(flint.arb(high) + low - exact) / abs(exact)).upper()))
    return worst


def with_low(level: PairLevel, draw: np.random.Generator, high: Array) -> tuple[Array, Array]:
    """A low part as large as the level takes: a pair of `precise` need not be normalised."""
    low = high * float(level.largest_low) * draw.uniform(-1.0, 1.0, high.size)
    if level is PRECISE:
        return high, low
    total = high + low
    return total, low - (total - high)


def seeded(level: PairLevel, count: int, seed: int) -> Columns:
    """Angles of every kind, with exponents that put the power between the level's limit and 1."""
    draw = np.random.default_rng(seed)
    near, tiny = draw.uniform(0.0, 0.5, count), 10.0 ** draw.uniform(-40.0, -0.4, count)
    far = draw.uniform(0.5, 1.0, count)
    sin2, sin2_lo = with_low(level, draw, np.concatenate([near, tiny, far]))
    cos2, cos2_lo = with_low(level, draw, draw.uniform(0.0, 0.5, 3 * count) ** draw.integers(1, 20, 3 * count))
    log = np.where(sin2 < 0.5, -np.log1p(-np.minimum(sin2, 0.5)), -np.log(cos2))
    deepest = (-level.lowest_power - 1) * math.log(2.0)
    n = 2.0 * np.minimum(deepest * 10.0 ** draw.uniform(-4.0, 0.0, log.size) / log, 2.0**199)
    return cos2, cos2_lo, sin2, sin2_lo, n


@named
def test_the_proved_bound_of_a_power_meets_its_target(level: PairLevel) -> None:
    assert proved_bounds(level).power <= {"precise_": 2.0**-68, "dd_": 2.0**-90}[level.prefix]


@named
def test_the_macro_that_callers_add_is_not_below_the_proved_bound(level: PairLevel) -> None:
    text = (SUPPORT / "precise_power.h").read_text()
    stated = re.search(rf"#define {level.prefix.upper()}POWER_ERROR 0x1p(-\d+)\n", text)
    assert stated is not None
    assert 0.5 * 2.0 ** int(stated[1]) < proved_bounds(level).power <= 2.0 ** int(stated[1])


@pytest.mark.parametrize(("level", "compiler"), BOTH)
def test_a_power_stays_within_the_proved_bound(level: PairLevel, compiler: str) -> None:
    assert largest_error(level, seeded(level, 1000, seed=41), compiler) <= proved_bounds(level).power


# (cos2, sin2, exponent): the worst of 250 million powers (precise, 2^-70.05) and of 4 million (dd, 2^-93.0)
WORST = {
    PRECISE: (
        (0.0, 0.0, "0x1.f9b558ee26b34p-4", "0x1.0d850e193f3e2p-58", "0x1.24698dd14d097p+13"),
        (0.0, 0.0, "0x1.9e13535cb1353p-66", "-0x1.e0387cab50bafp-122", "0x1.80991afb057adp+75"),
        (0.0, 0.0, "0x1.cbc8893294538p-32", "0x1.a5ff14d2e4b58p-87", "0x1.5ac00cd264b8cp+41"),
        (0.0, 0.0, "0x1.3823fea30ef27p-15", "-0x1.ece3a0de96968p-69", "0x1.fec0c501b6445p+24"),
    ),
    DOUBLE_DOUBLE: (
        (0.0, 0.0, "0x1.05554f5beef04p-3", "0x1.5d514b6d210a5p-57", "0x1.1205eb64f3e3fp+13"),
        (0.0, 0.0, "0x1.aa914a3c8f342p-4", "0x1.e7817a86caa8ap-58", "0x1.4daee568ba194p+13"),
        (0.0, 0.0, "0x1.0fd228ee00da8p-4", "0x1.a19db956a170ap-58", "0x1.177086bd00e42p+14"),
    ),
}
WORST_LOG2 = {PRECISE: -70.05, DOUBLE_DOUBLE: -93.0}


@named
def test_the_worst_known_powers_err_as_much_as_was_measured_and_no_more(level: PairLevel) -> None:
    rows = [[float.fromhex(x) if isinstance(x, str) else x for x in row] for row in WORST[level]]
    cos2, cos2_lo, sin2, sin2_lo, n = (np.array(column) for column in zip(*rows, strict=True))
    error = math.log2(largest_error(level, (cos2, cos2_lo, sin2, sin2_lo, n)))
    assert WORST_LOG2[level] - 0.02 <= error <= WORST_LOG2[level] + 0.01


@settings(max_examples=300, deadline=None)
@given(
    sin2=st.floats(0.0, 1.0),
    cos2=st.floats(2.0**-1022, 0.75),
    lows=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    n=st.one_of(st.floats(0.0, 2.0**200), st.floats(0.0, 64.0), st.integers(0, 2000)),
)
@example(sin2=0.296875, cos2=0.5, lows=(1.0, 1.0), n=1000.0)
@example(sin2=math.nextafter(0.296875, 1.0), cos2=0.5, lows=(-1.0, 1.0), n=1000.0)
@example(sin2=math.nextafter(0.5, 0.0), cos2=0.5, lows=(-1.0, 1.0), n=1000.0)
@example(sin2=0.5, cos2=0.5, lows=(1.0, 1.0), n=1000.0)
@example(sin2=1.0, cos2=2.0**-1022, lows=(0.0, 0.0), n=1e-3)
@example(sin2=0.1328125, cos2=0.5, lows=(1.0, 1.0), n=6000.0)
@example(sin2=0.2, cos2=0.5, lows=(-1.0, 1.0), n=5500.0)
def test_no_power_that_hypothesis_finds_breaks_the_bound(
    sin2: float, cos2: float, lows: tuple[float, float], n: float
) -> None:
    for level in LEVELS:
        c_lo, s_lo = (x * low * float(level.largest_low) for x, low in zip((cos2, sin2), lows, strict=True))
        if level is DOUBLE_DOUBLE:
            cos2, c_lo = cos2 + c_lo, c_lo - ((cos2 + c_lo) - cos2)
            sin2, s_lo = sin2 + s_lo, s_lo - ((sin2 + s_lo) - sin2)
        hi, lo = run(level, [cos2], [c_lo], [sin2], [s_lo], [float(n)])
        with flint.ctx.workprec(400):
            exact = true_power(flint.arb(cos2) + c_lo, flint.arb(sin2) + s_lo, float(n), sin2 < 0.5)
            allowed = exact * proved_bounds(level).power + flint.arb(2) ** level.lowest_power
            assert abs(flint.arb(float(hi[0])) + float(lo[0]) - exact) <= allowed


@pytest.mark.parametrize(("level", "compiler"), BOTH)
def test_the_logarithm_stays_within_its_proved_relative_bound(level: PairLevel, compiler: str) -> None:
    draw = np.random.default_rng(42)
    binades = draw.uniform(0.5, 2.0, 600) * 2.0 ** draw.integers(-800, 2, 600)
    edges = [float(m) for zone in ZONES for m in (zone.low, zone.high)]
    at_edges = [math.nextafter(edge, direction) for edge in edges for direction in (0.0, 2.0)]
    x, x_lo = with_low(level, draw, np.concatenate([binades, draw.uniform(0.5, 2.0, 600), at_edges]))
    log2_2 = largest_relative(
        run(level, x, x_lo, call=LOG2, compiler=compiler), lambda a: a.log() / flint.arb(2).log(), x, x_lo
    )
    assert log2_2 <= proved_bounds(level).log2


@pytest.mark.parametrize(("level", "compiler"), BOTH)
def test_two_to_a_fraction_stays_within_its_proved_relative_bound(level: PairLevel, compiler: str) -> None:
    draw = np.random.default_rng(43)
    r = np.concatenate([draw.uniform(-0.5, 0.5, 2000), [-0.5, 0.0, 0.5], 10.0 ** draw.uniform(-300.0, -1.0, 50)])
    r_lo = np.minimum(np.abs(r), 1.0) * 2.0**-53 * draw.uniform(-1.0, 1.0, r.size)
    error = largest_relative(
        run(level, r, r_lo, call=EXP2, compiler=compiler), lambda a: (a * flint.arb(2).log()).exp(), r, r_lo
    )
    assert error <= proved_bounds(level).exp2


SINES = [0.0, 5e-324, 1e-300, 1e-20, 0.25, 0.296875, 0.4, 0.5, 0.6, 1.0]
EXPONENTS = [5e-324, 1e-30, 1e-3, 0.5, 1.0, 32.0, 1e6, 1e30, 2.0**200]


@named
def test_the_zeroth_power_is_one_also_of_zero(level: PairLevel) -> None:
    hi, lo = run(level, np.maximum(1.0 - np.array(SINES), 0.0), 0.0, SINES, 0.0, 0.0)
    assert np.all(hi == 1.0)
    assert np.all(lo == 0.0)


@named
def test_every_positive_power_of_zero_is_zero_and_of_one_is_one(level: PairLevel) -> None:
    zero_hi, zero_lo = run(level, 0.0, 0.0, 1.0, 0.0, EXPONENTS)
    one_hi, one_lo = run(level, 1.0, 0.0, 0.0, 0.0, EXPONENTS)
    assert not np.any(zero_hi)
    assert not np.any(zero_lo)
    assert np.all(one_hi == 1.0)
    assert not np.any(one_lo)


@named
def test_a_power_is_never_nan_never_negative_and_never_above_one(level: PairLevel) -> None:
    sines, exponents = (column.ravel() for column in np.meshgrid(SINES, [0.0, *EXPONENTS, 1e308, math.inf]))
    for cos2 in (0.0, 5e-324, 1e-310, 0.1, 0.75, 1.0, 1.0 + 2.0**-52):
        hi, lo = run(level, cos2, 0.0, sines, 0.0, exponents)
        assert np.all((hi >= 0.0) & (hi <= 1.0) & (hi + lo <= 1.0))
        assert np.all((lo <= 0.0) | (hi < 1.0))


@named
def test_a_result_is_normalised_and_zero_below_the_limit_of_its_level(level: PairLevel) -> None:
    columns = seeded(level, 2000, seed=44)
    hi, lo = run(level, *columns)
    assert np.array_equal(hi + lo, hi)
    limit = -level.lowest_power
    below = run(level, 0.5, 0.0, 0.5, 0.0, [2.0 * limit, math.nextafter(2.0 * limit, math.inf), 1e30])
    assert below[0].tolist() == [2.0**-limit, 0.0, 0.0]
    assert not np.any(below[1])


@named
def test_powers_of_a_subnormal_cosine_are_powers_of_its_value(level: PairLevel) -> None:
    cos2 = np.array([5e-324 * k for k in (1, 3, 1000, 12345)])
    zero, n = np.zeros(4), np.full(4, 0.01)
    assert largest_error(level, (cos2, zero, zero + 1.0, zero, n)) <= proved_bounds(level).power


@named
def test_the_sine_decides_below_one_half_and_the_cosine_above(level: PairLevel) -> None:
    near, far = np.array([1e-20, 0.2, 0.2968, 0.2969, 0.49]), np.array([0.5, 0.7, 1.0])
    assert np.array_equal(run(level, 0.1, 0.0, near, 0.0, 7.5), run(level, 0.9, 0.0, near, 0.0, 7.5))
    assert np.array_equal(run(level, 0.3, 0.0, far, 0.0, 7.5), run(level, 0.3, 0.0, 0.5, 0.0, [7.5] * 3))


@named
def test_low_parts_count_where_the_high_parts_alone_would_lose_the_highlight(level: PairLevel) -> None:
    """(1 - s)^(n/2) for n s of order 10: leaving out s.lo costs 10 times its relative size."""
    cos2, cos2_lo, sin2, sin2_lo, n = seeded(level, 300, seed=45)
    with_lows = run(level, cos2, cos2_lo, sin2, sin2_lo, n)
    without = run(level, cos2, 0.0, sin2, 0.0, n)
    change = np.abs((with_lows[0] - without[0]) + (with_lows[1] - without[1])) / np.maximum(without[0], 2.0**-900)
    assert np.max(change) >= 10.0 * float(level.largest_low)


@named
def test_every_compiler_gives_the_same_bits_in_vectors_and_one_by_one(level: PairLevel) -> None:
    columns = seeded(level, 200, seed=46)
    together = [run(level, *columns, compiler=compiler) for compiler in COMPILERS]
    assert all(np.array_equal(result, together[0]) for result in together)
    for k in range(0, columns[0].size, 37):
        alone = run(level, *(c[k : k + 1] for c in columns))
        assert (alone[0][0], alone[1][0]) == (together[0][0][k], together[0][1][k])


TARGETS = ((), ("-march=x86-64-v3",)) if platform.machine() == "x86_64" else ((),)


@pytest.mark.parametrize("target", TARGETS, ids=lambda flags: "".join(flags) or "native")
@pytest.mark.parametrize(("level", "compiler"), BOTH)
def test_a_loop_over_powers_of_a_cosine_vectorises(level: PairLevel, compiler: str, target: tuple[str, ...]) -> None:
    source = snippet(level, POWER)
    widths = vectorised_lines(source, compiler=compiler, extra_flags=target)
    assert widths.get(loop_line(source), 0) >= (32 if compiler == "gcc" else 4)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("flags", [(), ("-O0",), ("-march=x86-64",) if platform.machine() == "x86_64" else ("-O1",)])
def test_the_header_compiles_without_a_warning_used_or_not(compiler: str, flags: tuple[str, ...]) -> None:
    nothing = '#include "precise_power.h"\n#include "power.h"\nint unused(void) { return 0; }\n'
    compile_c(nothing, "int unused(void);", compiler=compiler, extra_flags=flags)
    compile_c(snippet(PRECISE, POWER), "", compiler=compiler, extra_flags=flags)


def test_the_header_is_what_its_template_and_tables_give() -> None:
    rendered = render_precise_header((SUPPORT / "precise_power.h.j2").read_text())
    assert rendered == (SUPPORT / "precise_power.h").read_text(), "run: python -m symrender_cg.functions --write"


@named
def test_the_proved_error_of_each_polynomial_is_reached_and_never_exceeded(level: PairLevel) -> None:
    tables = pair_tables(level)
    with mpmath.workdps(60):
        log = [mpmath.mpf(high) + low for high, low in tables.log_pairs] + list(tables.log_tail)
        exp2 = [mpmath.mpf(high) + low for high, low in tables.exp2_pairs] + list(tables.exp2_tail)
        largest_s = mpmath.mpf(LARGEST_S.numerator) / LARGEST_S.denominator
        log_errors = [
            abs(s * mpmath.polyval(log[::-1], s * s) * mpmath.log(2) / (2 * mpmath.atanh(s)) - 1)
            for s in mpmath.linspace(largest_s / 500, largest_s, 500)
        ]
        half = mpmath.mpf(1) / 2
        exp2_errors = [
            abs((1 + r * mpmath.polyval(exp2[::-1], r)) / mpmath.power(2, r / 8) - 1)
            for r in mpmath.linspace(-half, half, 501)
        ]
        assert 0.5 * tables.log_error <= max(log_errors) <= tables.log_error
        assert 0.5 * tables.exp2_error <= max(exp2_errors) <= tables.exp2_error


def test_the_zones_cover_an_octave_and_leave_mantissas_near_one() -> None:
    assert [zone.high for zone in ZONES[:-1]] == [zone.low for zone in ZONES[1:]]
    assert (ZONES[0].low, ZONES[-1].high) == (LOWEST_MANTISSA, 2 * LOWEST_MANTISSA)


@pytest.mark.parametrize(("bound", "text"), [(2.0**-69, "2^-69.0"), (2.0**-69.66, "2^-69.6"), (0.9, "2^-0.1")])
def test_a_bound_is_printed_as_a_power_of_two_never_below_it(bound: float, text: str) -> None:
    assert as_power_of_two(bound) == text
