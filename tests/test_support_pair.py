"""pair.h against rational arithmetic: what an operation loses is within the bound of its comment, cancelling or not."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from c_harness import COMPILERS, SnippetLibrary, compile_c, loop_line, vectorised_lines
from evaluators import THOROUGH, modest
from hypothesis import given
from hypothesis import strategies as st

Pair = tuple[float, float]
U = Fraction(1, 2**53)
COUNT = 100_000 if THOROUGH else 2_500

OPERATIONS = {
    "add": "pair_add(x, y)",
    "add_double": "pair_add_double(x, y.hi)",
    "sub": "pair_sub(x, y)",
    "mul": "pair_mul(x, y)",
    "mul_double": "pair_mul_double(x, y.hi)",
    "square": "pair_square(x)",
    "inverse": "pair_inverse(x)",
    "div": "pair_div(x, y)",
    "sqrt": "pair_sqrt(x)",
    "positive_part": "pair_positive_part(x)",
    "select": "pair_select(x.hi > y.hi, x, y)",
}


class Sizes:
    """What a bound speaks of: |a|, |b| as the larger of |hi| and |hi + lo|, L_a, L_b the lows."""

    def __init__(self, x: Pair, y: Pair) -> None:
        self.a, self.b = largest(x), largest(y)
        self.least_a, self.least_b = least(x), least(y)
        self.la, self.lb = abs(Fraction(x[1])), abs(Fraction(y[1]))


def largest(pair: Pair) -> Fraction:
    return max(abs(Fraction(pair[0])), abs(value(pair)))


def least(pair: Pair) -> Fraction:
    return min(abs(Fraction(pair[0])), abs(value(pair)))


def value(pair: Pair) -> Fraction:
    return Fraction(pair[0]) + Fraction(pair[1])


Exact = Callable[[Fraction, Fraction, Fraction], Fraction]
Bound = Callable[[Sizes, Fraction], Fraction]
# operation -> the real result of x, y and y.hi; the bound of its comment, |a + b| that of the sum of the high words
BOUNDED: dict[str, tuple[Exact, Bound]] = {
    "add": (lambda x, y, _: x + y, lambda s, r: U * (2 * s.la + 2 * s.lb + U * r)),
    "sub": (lambda x, y, _: x - y, lambda s, r: U * (2 * s.la + 2 * s.lb + U * r)),
    "add_double": (lambda x, _, yh: x + yh, lambda s, r: U * (s.la + U * r)),
    "mul": (
        lambda x, y, _: x * y,
        lambda s, r: s.la * s.lb + U * (2 * s.a * s.lb + 3 * s.b * s.la + 3 * U * s.a * s.b),
    ),
    "mul_double": (lambda x, _, yh: x * yh, lambda s, r: U * (s.b * s.la + U * s.a * s.b)),
    "square": (lambda x, _, __: x * x, lambda s, r: s.la**2 + U * (2 * s.a * s.la + U * s.a**2)),
    "inverse": (
        lambda x, _, __: 1 / x,
        lambda s, r: (s.la / s.least_a + 5 * U) * (s.la / s.least_a + U) / s.least_a,
    ),
    "div": (
        lambda x, y, _: x / y,
        lambda s, r: (s.a / s.least_b) * (s.lb / s.least_b + 5 * U) * (s.la / s.least_a + s.lb / s.least_b + U),
    ),
}
AWAY = ("inverse", "div")
"""No bound of these speaks of operands that cancelled down to their own lo."""
ROOM = 1 + Fraction(1, 2**18)
"""Terms of third order: the lows here go up to 2^-20 of the high words."""


def snippet(name: str) -> str:
    return f"""
#include "pair.h"
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
    columns = [np.array(c, dtype=np.float64) for c in (*zip(*x, strict=True), *zip(*y, strict=True))]
    hi, lo = np.empty(len(x)), np.empty(len(x))
    library_of(name, compiler).call(f"apply_{name}", *columns, hi, lo, len(x))
    return list(zip(hi.tolist(), lo.tolist(), strict=True))


def a_pair(draw: random.Random, exponents: tuple[int, int] = (-80, 80)) -> Pair:
    """hi of any kind of mantissa, |lo| from 0 to 2^-20 |hi|."""
    mantissa = draw.choice((1.0, 1.5, draw.uniform(1.0, 2.0), 1.0 + draw.randrange(8) * 2.0**-52, 2.0 - 2.0**-52))
    hi = math.ldexp(draw.choice((1.0, -1.0)) * mantissa, draw.randint(*exponents))
    part = draw.choice((0.0, 2.0**-20, 2.0**-53, 2.0**-54, 2.0 ** -draw.randint(20, 70), draw.random() * 2.0**-52))
    return hi, hi * part * draw.choice((1.0, -1.0))


def operands(count: int, seed: int) -> tuple[list[Pair], list[Pair]]:
    """Pairs of pairs; of a third the high words, of some the values too, cancel."""
    draw = random.Random(seed)
    x, y = [a_pair(draw) for _k in range(count)], [a_pair(draw) for _k in range(count)]
    for i in range(0, count, 3):
        sign = draw.choice((1.0, -1.0))
        hi = sign * x[i][0] * (1.0 + draw.choice((0, 0, 1, -1, 2)) * 2.0**-52)
        y[i] = (hi, draw.choice((sign * x[i][1], -sign * x[i][1], a_pair(draw)[1] / 2.0**100, 0.0)))
    return x, y


def check(name: str, x: list[Pair], y: list[Pair], results: list[Pair]) -> None:
    formula, bound = BOUNDED[name]
    for a, b, result in zip(x, y, results, strict=True):
        high = abs(Fraction(a[0]) + (Fraction(b[0]) if name != "sub" else -Fraction(b[0])))
        true = formula(value(a), value(b), Fraction(b[0]))
        lost = abs(value(result) - true)
        allowed = bound(Sizes(a, b if "double" not in name else (b[0], 0.0)), max(abs(true), high))
        assert lost <= ROOM * allowed, f"{a} {b}: {float(lost)} > {float(allowed)}"


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", BOUNDED)
def test_each_operation_loses_no_more_than_its_comment_says(name: str, compiler: str) -> None:
    x, y = operands(COUNT, seed=21)
    check(name, x, y, apply(name, x, y, compiler))


finite = st.floats(min_value=2.0**-150, max_value=2.0**150).flatmap(lambda a: st.sampled_from([a, -a]))
parts = st.one_of(st.just(0.0), st.floats(-(2.0**-20), 2.0**-20, allow_subnormal=False))
pairs = st.builds(lambda hi, part: (hi, hi * part if abs(part) > 2.0**-200 else 0.0), finite, parts)


@modest(100)
@given(st.lists(st.tuples(pairs, pairs), min_size=1, max_size=6))
def test_no_operands_that_hypothesis_finds_lose_more(both: list[tuple[Pair, Pair]]) -> None:
    x, y = [a for a, _b in both], [b for _a, b in both]
    for name in BOUNDED:
        check(name, x, y, apply(name, x, y))


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_square_root_loses_no_more_than_its_comment_says(compiler: str) -> None:
    """sqrt(v) - r by (v - r^2) / (r + sqrt v), where sqrt v is between r and v / r."""
    draw = random.Random(22)
    x = [(abs(hi), lo) for hi, lo in (a_pair(draw, (-300, 300)) for _k in range(COUNT))]
    for a, result in zip(x, apply("sqrt", x, x, compiler), strict=True):
        v, r = value(a), value(result)
        t = abs(Fraction(a[1])) / least(a)
        lost = abs(v - r * r) / (r + min(r, v / r))
        root = r * (1 - 2 * abs(v - r * r) / v)
        assert lost <= ROOM * (t + 5 * U) * (t + U) * root, a


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_pair_whose_high_word_cancelled_keeps_its_value(compiler: str) -> None:
    """(a + b) - a for a = 1 + lo: hi is 0 or an ulp, lo is all that is left, and the sum is right to u^2."""
    draw = random.Random(23)
    x = [a_pair(draw, (0, 0)) for _k in range(2000)]
    y = [(-hi, draw.uniform(-1.0, 1.0) * 2.0**-30) for hi, _lo in x]
    for a, b, result in zip(x, y, apply("add", x, y, compiler), strict=True):
        assert result[0] == 0.0
        assert abs(result[1] - float(value(a) + value(b))) <= 2.0**-53 * 2.0 * (abs(a[1]) + abs(b[1]))


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_root_of_zero_is_zero_and_nothing_negative_has_one(compiler: str) -> None:
    x = [(0.0, 0.0), (0.0, 1e-20), (-0.0, 0.0)]
    assert apply("sqrt", x, x, compiler)[0] == (0.0, 0.0)
    assert all(math.isfinite(hi + lo) for hi, lo in apply("sqrt", x, x, compiler))


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_positive_part_is_decided_by_both_words(compiler: str) -> None:
    x = [(1.0, -2.0), (-1.0, 2.0), (0.0, 1e-30), (0.0, -1e-30), (0.0, 0.0), (2.0, 0.5), (-2.0, 0.5)]
    for a, result in zip(x, apply("positive_part", x, x, compiler), strict=True):
        assert value(result) == max(value(a), 0)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_choice_is_one_of_the_two_bit_for_bit(compiler: str) -> None:
    x, y = operands(500, seed=24)
    for a, b, result in zip(x, y, apply("select", x, y, compiler), strict=True):
        assert result == (a if a[0] > b[0] else b)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", OPERATIONS)
def test_a_loop_over_an_operation_vectorises(name: str, compiler: str) -> None:
    source = snippet(name)
    widest = vectorised_lines(source, compiler=compiler).get(loop_line(source), 0)
    assert widest >= (32 if compiler == "gcc" else 4)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_header_compiles_without_a_warning_when_nothing_of_it_is_used(compiler: str) -> None:
    compile_c('#include "pair.h"\nint unused(void) { return 0; }\n', "int unused(void);", compiler=compiler)
