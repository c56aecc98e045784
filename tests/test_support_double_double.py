"""double_double.h against rational arithmetic: exact where it says exact, else within the bound that it states."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from c_harness import COMPILERS, SnippetLibrary, compile_c, loop_line, vectorised_lines
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

Pair = tuple[float, float]
U = Fraction(1, 2**53)

OPERATIONS = {
    "sum": "dd_sum(x.hi, y.hi)",
    "difference": "dd_difference(x.hi, y.hi)",
    "product": "dd_product(x.hi, y.hi)",
    "neg": "dd_neg(x)",
    "scale": "dd_scale(x, 0x1p-40)",
    "from": "dd_from(dd_to_double(x))",
    "is_negative": "dd_from(dd_is_negative(x))",
    "add_double": "dd_add_double(x, y.hi)",
    "add": "dd_add(x, y)",
    "sub": "dd_sub(x, y)",
    "mul_double": "dd_mul_double(x, y.hi)",
    "mul": "dd_mul(x, y)",
    "div": "dd_div(x, y)",
    "sqrt": "dd_sqrt(x)",
}

EXACT: dict[str, Callable[[Fraction, Fraction, Fraction, Fraction], Fraction]] = {
    "sum": lambda xh, xl, yh, yl: xh + yh,
    "difference": lambda xh, xl, yh, yl: xh - yh,
    "product": lambda xh, xl, yh, yl: xh * yh,
    "neg": lambda xh, xl, yh, yl: -xh - xl,
    "scale": lambda xh, xl, yh, yl: (xh + xl) / 2**40,
    "from": lambda xh, xl, yh, yl: xh,
    "is_negative": lambda xh, xl, yh, yl: Fraction(int(xh + xl < 0)),
}
# operation -> real result of the operands, stated bound in u^2; beside it the largest error seen over 60,000 operands
BOUNDED: dict[str, tuple[Callable[[Fraction, Fraction, Fraction], Fraction], Fraction]] = {
    "add_double": (lambda x, y, yh: x + yh, Fraction(2)),  # 1.00
    "add": (lambda x, y, yh: x + y, 3 / (1 - 4 * U)),  # 2.00
    "sub": (lambda x, y, yh: x - y, 3 / (1 - 4 * U)),  # 1.71
    "mul_double": (lambda x, y, yh: x * yh, Fraction(2)),  # 1.74
    "mul": (lambda x, y, yh: x * y, Fraction(4)),  # 3.24
    "div": (lambda x, y, yh: x / y, 15 + 56 * U),  # 6.21
}
SQRT_BOUND = Fraction(25, 8)  # 2.66


def snippet(name: str) -> str:
    return f"""
#include "double_double.h"
#include <stddef.h>

void apply_{name}(const double *restrict x_hi, const double *restrict x_lo, const double *restrict y_hi,
                  const double *restrict y_lo, double *restrict out_hi, double *restrict out_lo, ptrdiff_t count)
{{
    for (ptrdiff_t i = 0; i < count; ++i) {{
        const double_double x = {{x_hi[i], x_lo[i]}}, y = {{y_hi[i], y_lo[i]}};
        const double_double z = {OPERATIONS[name]};
        (void)y;
        out_hi[i] = z.hi;
        out_lo[i] = z.lo;
    }}
}}
"""


def library_of(name: str, compiler: str) -> SnippetLibrary:
    pointers = "const double *, const double *, const double *, const double *, double *, double *, ptrdiff_t"
    return compile_c(snippet(name), f"void apply_{name}({pointers});", compiler=compiler)


def apply(name: str, x: list[Pair], y: list[Pair], compiler: str = "gcc") -> list[Pair]:
    columns: list[NDArray[np.float64]] = [np.array(c, dtype=np.float64) for c in (*zip(*x), *zip(*y))]  # noqa: B905
    hi, lo = np.empty(len(x)), np.empty(len(x))
    library_of(name, compiler).call(f"apply_{name}", *columns, hi, lo, len(x))
    return list(zip(hi.tolist(), lo.tolist(), strict=True))


def value(pair: Pair) -> Fraction:
    return Fraction(pair[0]) + Fraction(pair[1])


def normalised(hi: float, fraction_of_half_ulp: float) -> Pair:
    """hi + lo with |lo| <= ulp(hi) / 2, and hi the nearest double to the sum."""
    lo = fraction_of_half_ulp * math.ulp(hi) * 0.5
    total = Fraction(hi) + Fraction(lo)
    nearest = total.numerator / total.denominator
    return nearest, float(total - Fraction(nearest))


def nasty_pairs(count: int, seed: int, exponents: tuple[int, int]) -> list[Pair]:
    """Mantissas at random, just above a power of two, of few bits, and low parts at, near and far below half an ulp."""
    draw = random.Random(seed)
    low_parts = (1.0, -1.0, 1.0 - 2.0**-52, 2.0**-52, -(2.0**-40), 0.0)
    pairs = []
    for _ in range(count):
        mantissa = draw.choice(
            (
                draw.uniform(1.0, 2.0),
                1.0 + draw.randrange(8) * 2.0**-52,
                2.0 - draw.randrange(1, 8) * 2.0**-52,
                1.5,
                1.0,
            )
        )
        fraction = draw.choice((draw.uniform(-1.0, 1.0), draw.choice(low_parts)))
        hi = math.ldexp(draw.choice((1.0, -1.0)) * mantissa, draw.randint(*exponents))
        pairs.append(normalised(hi, fraction))
    return pairs


def operands(count: int, seed: int) -> tuple[list[Pair], list[Pair]]:
    """Pairs of operands, a third of them nearly opposite or nearly equal, so that sums cancel."""
    x, y = nasty_pairs(count, seed, (-60, 60)), nasty_pairs(count, seed + 1, (-60, 60))
    draw = random.Random(seed + 2)
    for i in range(0, count, 3):
        hi = x[i][0] * draw.choice((1.0, -1.0)) + draw.randint(-2, 2) * math.ulp(x[i][0])
        y[i] = normalised(hi, draw.uniform(-1.0, 1.0))
    return x, y


def assert_normalised(pair: Pair) -> None:
    assert pair[0] + pair[1] == pair[0]


finite = st.floats(min_value=2.0**-200, max_value=2.0**200).flatmap(lambda a: st.sampled_from([a, -a]))
pairs = st.builds(normalised, finite, st.floats(min_value=-1.0, max_value=1.0))


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", EXACT)
def test_operations_that_claim_no_error_have_none(name: str, compiler: str) -> None:
    x, y = operands(2000, seed=11)
    for (xh, xl), (yh, yl), result in zip(x, y, apply(name, x, y, compiler), strict=True):
        assert value(result) == EXACT[name](Fraction(xh), Fraction(xl), Fraction(yh), Fraction(yl))
        assert_normalised(result)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", BOUNDED)
def test_each_operation_keeps_its_stated_bound(name: str, compiler: str) -> None:
    formula, bound = BOUNDED[name]
    x, y = operands(4000, seed=12)
    for a, b, result in zip(x, y, apply(name, x, y, compiler), strict=True):
        true = formula(value(a), value(b), Fraction(b[0]))
        assert abs(value(result) - true) <= bound * U * U * abs(true), (a, b)
        assert_normalised(result)


@settings(max_examples=150, deadline=None)
@given(operand_pairs=st.lists(st.tuples(pairs, pairs), min_size=1, max_size=8))
def test_no_operands_that_hypothesis_finds_break_a_bound(operand_pairs: list[tuple[Pair, Pair]]) -> None:
    x, y = [a for a, _ in operand_pairs], [b for _, b in operand_pairs]
    for name, (formula, bound) in BOUNDED.items():
        for a, b, result in zip(x, y, apply(name, x, y), strict=True):
            true = formula(value(a), value(b), Fraction(b[0]))
            assert abs(value(result) - true) <= bound * U * U * abs(true)


def sqrt_error(x: Fraction, result: Fraction) -> Fraction:
    """Relative error of `result` as sqrt(x), to 2^-150, through (r^2 - x) / (2 x) = e + e^2 / 2."""
    twice = (result * result - x) / x
    return twice / 2 - twice * twice / 8


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_square_root_keeps_its_stated_bound(compiler: str) -> None:
    x = [
        normalised(abs(hi), math.copysign(1.0, hi) * lo / math.ulp(hi)) for hi, lo in nasty_pairs(8000, 13, (-300, 300))
    ]
    for a, result in zip(x, apply("sqrt", x, x, compiler), strict=True):
        assert abs(sqrt_error(value(a), value(result))) <= SQRT_BOUND * U * U
        assert_normalised(result)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_square_root_of_zero_is_zero_and_of_tiny_numbers_is_safe(compiler: str) -> None:
    draw = random.Random(14)
    tiny = [math.ldexp(draw.uniform(1.0, 2.0), draw.randint(-1074, -900)) for _ in range(2000)]
    results = apply("sqrt", [(0.0, 0.0), *((a, 0.0) for a in tiny)], [(1.0, 0.0)] * (1 + len(tiny)), compiler)
    assert results[0] == (0.0, 0.0)
    for a, result in zip(tiny, results[1:], strict=True):
        allowed = SQRT_BOUND * U * U + min(2 * U, Fraction(1, 2**1075) / Fraction(a))
        assert abs(sqrt_error(Fraction(a), value(result))) <= allowed


def test_squares_are_inverted_to_the_bound_where_a_double_forgets_half_its_digits() -> None:
    """sqrt((1 + d)^2 - 1) for small d: a double keeps half the digits of d, a double-double keeps all of them."""
    x = [(1.0 + k * 2.0**-45, 0.0) for k in range(1, 200)]
    squares = apply("mul", x, x)
    differences = apply("add_double", squares, [(-1.0, 0.0)] * len(x))
    for a, result in zip(x, apply("sqrt", differences, x), strict=True):
        true_square = value(a) ** 2 - 1
        assert abs(sqrt_error(true_square, value(result))) <= Fraction(1, 2**58)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", ["sum", "product", "add", "mul", "div", "sqrt"])
def test_a_loop_over_an_operation_vectorises(name: str, compiler: str) -> None:
    source = snippet(name)
    widest = vectorised_lines(source, compiler=compiler).get(loop_line(source), 0)
    assert widest >= (32 if compiler == "gcc" else 4)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_header_compiles_without_a_warning_when_nothing_of_it_is_used(compiler: str) -> None:
    compile_c('#include "double_double.h"\nint unused(void) { return 0; }\n', "int unused(void);", compiler=compiler)
