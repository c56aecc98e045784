"""fast_power.h against Arb: the bound for grey levels, the laws of a power, the vectors, the derivation."""

from __future__ import annotations

import math
import platform
from typing import Any

import flint
import mpmath
import numpy as np
import pytest
from c_harness import COMPILERS, SUPPORT, compile_c, loop_line, vectorised_lines
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from symrender_cg.functions.fast import bound_lobe_error, fast_tables
from symrender_cg.functions.fast_header import render_fast_header

Array = NDArray[np.float32]

POWER = "fast_powerf(cos2[i], n[i])"
COSINE = "fast_power_of_cosinef(cos2[i], sin2[i], n[i])"
LOG2 = "fast_log2_of_partsf(fast_splitf(cos2[i]))"
EXP2 = "fast_exp2f(cos2[i])"
CALLS = (POWER, COSINE, LOG2, EXP2)


def snippet(call: str) -> str:
    return f"""
#include "fast_power.h"
#include <stddef.h>

void run(const float *restrict cos2, const float *restrict sin2, const float *restrict n, float *restrict out,
         ptrdiff_t count)
{{
    (void)cos2, (void)sin2, (void)n;
    for (ptrdiff_t i = 0; i < count; ++i)
        out[i] = {call};
}}
"""


def run(call: str, cos2: Any, sin2: Any = 0.0, n: Any = 0.0, compiler: str = "gcc") -> Array:
    columns = [
        np.ascontiguousarray(c) for c in np.broadcast_arrays(*(np.asarray(x, np.float32) for x in (cos2, sin2, n)))
    ]
    out = np.empty_like(columns[0])
    declaration = "void run(const float *, const float *, const float *, float *, ptrdiff_t);"
    compile_c(snippet(call), declaration, compiler=compiler).call("run", *columns, out, out.size)
    return out


def seeded(count: int, seed: int) -> tuple[Array, Array]:
    """Numbers of (0, 1] in every size, and exponents that put the power between e^-20 and 1."""
    draw = np.random.default_rng(seed)
    sizes = (
        draw.uniform(0.0, 1.0, count),
        1.0 - 10.0 ** draw.uniform(-7.0, -0.3, count),
        10.0 ** draw.uniform(-30.0, 0.0, count),
    )
    x = np.concatenate(sizes).astype(np.float32)
    x = x[(x > 0.0) & (x < 1.0)]
    return x, (np.exp(draw.uniform(-6.0, 3.0, x.size)) / -np.log(x.astype(np.float64))).astype(np.float32)


def largest_error(computed: Array, exact: list[Any], *, relative: bool = False) -> float:
    worst = 0.0
    for value, true in zip(computed.tolist(), exact, strict=True):
        worst = max(worst, float((abs(value - true) / (abs(true) if relative else 1)).upper()))
    return worst


def test_the_proved_bound_is_below_what_a_grey_level_of_eight_bits_needs() -> None:
    assert fast_tables().power_bound <= 2.0**-12
    assert "#define FAST_POWER_ERROR 0x1p-12f\n" in (SUPPORT / "fast_power.h").read_text()


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_power_stays_within_the_proved_bound_and_comes_near_it(compiler: str) -> None:
    x, n = seeded(3000, seed=51)
    exact = [flint.arb(b) ** flint.arb(e) for b, e in zip(x.tolist(), n.tolist(), strict=True)]
    error = largest_error(run(POWER, x, n=n, compiler=compiler), exact)
    assert 0.8 * fast_tables().power_bound <= error <= fast_tables().power_bound


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_power_of_a_cosine_stays_within_the_proved_bound_however_large_the_exponent(compiler: str) -> None:
    s, n = seeded(3000, seed=52)
    near = s <= np.float32(0.3125)
    s, n, near = s[s > 1e-28], n[s > 1e-28], near[s > 1e-28]
    n = (n * np.log(s.astype(np.float64)) / np.log1p(-np.minimum(s, np.float32(0.999999)).astype(np.float64))).astype(
        np.float32
    )
    c = np.where(near, np.float32(0.1), s)
    exact = [
        (((-flint.arb(a)).log1p() if is_near else flint.arb(b).log()) * flint.arb(e) / 2).exp()
        for a, b, e, is_near in zip(s.tolist(), c.tolist(), n.tolist(), near.tolist(), strict=True)
    ]
    assert largest_error(run(COSINE, c, s, n, compiler=compiler), exact) <= fast_tables().power_bound


@settings(max_examples=300, deadline=None)
@given(
    base=st.floats(2.0**-126, 1.0, width=32),
    n=st.one_of(st.floats(0.0, 2.0**100, width=32), st.floats(0.0, 64.0, width=32), st.integers(0, 1000)),
)
def test_no_power_that_hypothesis_finds_breaks_the_bound(base: float, n: float) -> None:
    assert largest_error(run(POWER, [base], n=[n]), [flint.arb(base) ** flint.arb(n)]) <= fast_tables().power_bound


def test_logarithm_and_power_of_two_stay_within_their_proved_relative_bounds() -> None:
    x, _ = seeded(3000, seed=53)
    logs = [flint.arb(b).log() / flint.arb(2).log() for b in x.tolist()]
    assert largest_error(run(LOG2, x), logs, relative=True) <= fast_tables().log_bound
    y = np.random.default_rng(54).uniform(-125.0, 0.0, 5000).astype(np.float32)
    powers = [flint.arb(2) ** flint.arb(b) for b in y.tolist()]
    assert largest_error(run(EXP2, y), powers, relative=True) <= fast_tables().exp2_bound


NARROW = """
#include "fast_power.h"

void run(const float *cos2, float *y, float *power, double n, int count)
{
    fast_powers_of_lobef(cos2, y, power, half_of_large((float)n), count);
}

double half(double n)
{
    return half_of_large((float)n);
}
"""
DECLARED = "void run(const float *, float *, float *, double, int); double half(double);"


def narrow(cos2: Any, n: float, compiler: str = "gcc") -> Array:
    """Powers of cosines by the polynomial for exponents from 32 on."""
    given = np.ascontiguousarray(np.asarray(cos2, np.float32))
    room, out = np.empty_like(given), np.empty_like(given)
    compile_c(NARROW, DECLARED, compiler=compiler).call("run", given, room, out, n, out.size)
    return out


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_power_of_a_large_exponent_stays_within_its_proved_bound_and_comes_near_it(compiler: str) -> None:
    draw = np.random.default_rng(55)
    largest = 0.0
    for n in (32.0, 37.5, 100.0, 999.5, 1e5):
        lobe = 1.0 - draw.uniform(0.0, 24.0 / n, 600)
        cos2 = np.clip(np.concatenate([lobe, draw.uniform(0.0, 1.0, 300)]), 0.0, 1.0).astype(np.float32)
        exact = [flint.arb(b) ** (flint.arb(n) / 2) for b in cos2.tolist()]
        largest = max(largest, largest_error(narrow(cos2, n, compiler), exact))
    assert 0.8 * fast_tables().narrow_bound <= largest <= fast_tables().narrow_bound


def test_a_large_exponent_is_one_of_at_least_32_and_its_powers_are_in_the_unit_interval() -> None:
    compiled = compile_c(NARROW, DECLARED)
    assert [compiled.call("half", n) for n in (0.0, 2.5, 31.99, 32.0, 37.5)] == [0.0, 0.0, 0.0, 16.0, 18.75]
    for n in (32.0, 1000.0, 1e30, math.inf):
        assert narrow([1.0, np.nextafter(np.float32(1), np.float32(2)), 1.01], n).tolist() == [1.0, 1.0, 1.0]
        powers = narrow(np.linspace(0.0, 1.0, 257), n)
        assert np.all((powers >= 0.0) & (powers <= 1.0))
        assert np.all(powers[:128] < 1e-4)


def test_the_polynomial_of_a_narrow_lobe_has_its_proved_error() -> None:
    tables = fast_tables()
    with mpmath.workdps(30):
        gs = mpmath.linspace(mpmath.mpf(1) / 1000, mpmath.mpf(7) / 16, 801)
        errors = [abs(g * mpmath.polyval(tables.lobe[::-1], g) * mpmath.log(2) / mpmath.log1p(-g) + 1) for g in gs]
        assert 0.95 * bound_lobe_error(tables.lobe) <= max(errors) <= bound_lobe_error(tables.lobe)


EXPONENTS = [1.4e-45, 1e-30, 1e-3, 0.5, 1.0, 32.0, 1e6, 1e30, 3e38, math.inf]


def test_the_laws_of_a_power_hold_at_zero_and_one() -> None:
    assert np.all(run(POWER, [0.0, 1e-40, 0.3, 1.0], n=0.0) == 1.0)
    assert np.all(run(COSINE, [0.0, 0.5, 1.0], [1.0, 0.5, 0.0], 0.0) == 1.0)
    assert not np.any(run(POWER, 0.0, n=[2.0**-119, *EXPONENTS[1:]]))
    assert not np.any(run(COSINE, 0.0, 1.0, [2.0**-119, *EXPONENTS[1:]]))
    assert np.all(run(POWER, 1.0, n=EXPONENTS) == 1.0)
    assert np.all(run(COSINE, 1.0, 0.0, EXPONENTS) == 1.0)


def test_a_power_of_a_cosine_is_in_the_unit_interval_and_a_base_beyond_one_may_reach_infinity() -> None:
    cos2, n = (c.ravel() for c in np.meshgrid([0.0, 1.4e-45, 1e-30, 0.1, 0.6875, 0.75, 1.0], [0.0, *EXPONENTS]))
    result = run(COSINE, cos2, 1.0 - cos2, n)
    assert np.all((result >= 0.0) & (result <= 1.0))
    beyond = run(POWER, [1.25, 1.25, 2.0, 2.0], n=[2.0, math.inf, 126.0, 127.0])
    assert abs(beyond[0] - 1.5625) < 1.6 * fast_tables().power_bound * math.e
    assert beyond[1:].tolist() == [math.inf, 2.0**126, math.inf]


def test_every_compiler_gives_the_same_bits() -> None:
    x, n = seeded(500, seed=55)
    results = [run(POWER, x, n=n, compiler=compiler) for compiler in COMPILERS]
    assert all(np.array_equal(result, results[0]) for result in results)


TARGETS = ((), ("-march=x86-64-v3",)) if platform.machine() == "x86_64" else ((),)


@pytest.mark.parametrize("target", TARGETS, ids=lambda flags: "".join(flags) or "native")
@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_loop_over_the_header_vectorises(compiler: str, target: tuple[str, ...]) -> None:
    for call in CALLS:
        widths = vectorised_lines(snippet(call), compiler=compiler, extra_flags=target)
        assert widths.get(loop_line(snippet(call)), 0) >= (32 if compiler == "gcc" else 8)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_header_compiles_without_a_warning_used_or_not(compiler: str) -> None:
    nothing = '#include "fast_power.h"\nint unused(void) { return 0; }\n'
    compile_c(nothing, "int unused(void);", compiler=compiler, extra_flags=("-O0",))


def test_the_header_is_what_its_template_and_tables_give() -> None:
    rendered = render_fast_header((SUPPORT / "fast_power.h.j2").read_text())
    assert rendered == (SUPPORT / "fast_power.h").read_text(), "run: python -m symrender_cg.functions --write"


def test_the_proved_error_of_each_polynomial_is_reached_and_never_exceeded() -> None:
    tables = fast_tables()
    with mpmath.workdps(30):
        fs = [f for f in mpmath.linspace(mpmath.mpf(-5) / 16, mpmath.mpf(3) / 8, 801) if f != 0]
        log = [abs(f * mpmath.polyval(tables.log[::-1], f) * mpmath.log(2) / mpmath.log1p(f) - 1) for f in fs]
        rs = mpmath.linspace(mpmath.mpf(-1) / 2, mpmath.mpf(1) / 2, 801)
        exp2 = [abs((1 + r * mpmath.polyval(tables.exp2[::-1], r)) / mpmath.power(2, r) - 1) for r in rs]
        assert 0.95 * tables.log_error <= max(log) <= tables.log_error
        assert 0.95 * tables.exp2_error <= max(exp2) <= tables.exp2_error
