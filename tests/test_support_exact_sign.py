"""exact_sign.h against rational arithmetic: the sign of a polynomial in doubles is a fact, whatever the doubles."""

from __future__ import annotations

import functools
import math
import random
from fractions import Fraction

import numpy as np
import pytest
from c_harness import COMPILERS, SnippetLibrary, compile_c
from hypothesis import given, settings
from hypothesis import strategies as st

Monomial = tuple[int, float, float, float, float]

SOURCE = """
#include "exact_sign.h"

int sign_of(const int32_t *coefficients, const double *factors, int count)
{
    exact_sum sum;
    exact_sum_clear(&sum);
    for (int i = 0; i < count; ++i, factors += 4)
        exact_sum_add_product(&sum, coefficients[i], factors[0], factors[1], factors[2], factors[3]);
    return exact_sum_sign(&sum);
}
"""

LARGEST = 1.7976931348623157e308
SMALLEST = 5e-324
INT_MIN = -(2**31)


@pytest.fixture(scope="module", params=COMPILERS)
def library(request: pytest.FixtureRequest) -> SnippetLibrary:
    return compile_c(SOURCE, "int sign_of(const int32_t *, const double *, int);", compiler=request.param)


def sign(library: SnippetLibrary, monomials: list[Monomial]) -> int:
    coefficients = np.array([m[0] for m in monomials], dtype=np.int32)
    factors = np.array([m[1:] for m in monomials], dtype=np.float64).reshape(-1, 4)
    return int(library.call("sign_of", coefficients, factors, len(monomials)))


def exact(monomials: list[Monomial]) -> int:
    total = sum((Fraction(k) * math.prod(map(Fraction, factors)) for k, *factors in monomials), Fraction(0))
    return (total > 0) - (total < 0)


finite = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([0.0, -0.0, 1.0, -1.0, SMALLEST, -SMALLEST, 2.2250738585072014e-308, LARGEST, -LARGEST]),
    st.builds(math.ldexp, st.floats(min_value=-1.0, max_value=1.0), st.integers(min_value=-1070, max_value=1000)),
)
coefficient = st.one_of(st.integers(-8, 8), st.integers(INT_MIN, 2**31 - 1))
monomial = st.tuples(coefficient, finite, finite, finite, finite)


@settings(max_examples=300, deadline=None)
@given(monomials=st.lists(monomial, max_size=12))
def test_the_sign_of_any_finite_polynomial_is_that_of_rational_arithmetic(monomials: list[Monomial]) -> None:
    for compiler in COMPILERS:
        library = compile_c(SOURCE, "int sign_of(const int32_t *, const double *, int);", compiler=compiler)
        assert sign(library, monomials) == exact(monomials)


@settings(max_examples=300, deadline=None)
@given(monomials=st.lists(monomial, min_size=1, max_size=6), seed=st.integers(0, 2**32), nudge=st.integers(-1, 1))
def test_a_sum_that_cancels_but_for_the_smallest_unit_keeps_the_sign_of_that_unit(
    monomials: list[Monomial], seed: int, nudge: int
) -> None:
    shuffle = random.Random(seed)
    kept = [m for m in monomials if m[0] != INT_MIN]
    negated: list[Monomial] = [(-k, d, b, a, c) for k, a, b, c, d in kept]
    cancelling: list[Monomial] = [*kept, *negated, (nudge, SMALLEST, SMALLEST, SMALLEST, SMALLEST)]
    shuffle.shuffle(cancelling)
    for compiler in COMPILERS:
        library = compile_c(SOURCE, "int sign_of(const int32_t *, const double *, int);", compiler=compiler)
        assert sign(library, cancelling) == nudge


def test_the_discriminant_at_the_silhouette_has_its_exact_sign(library: SnippetLibrary) -> None:
    """disc = e^2 R^2 - (e^2 - R^2)(x^2 + y^2) within a few ulp of 0, where a double formula returns noise."""
    random_numbers = random.Random(20)
    signs = set()
    for _ in range(400):
        e, r = random_numbers.uniform(1.5, 10.0), random_numbers.uniform(0.1, 1.4)
        x = random_numbers.uniform(0.0, 0.7) * r
        y = math.sqrt(e * e * r * r / (e * e - r * r) - x * x)
        y += random_numbers.randint(-2, 2) * math.ulp(y)
        monomials: list[Monomial] = [
            (1, e, e, r, r),
            (-1, e, e, x, x),
            (-1, e, e, y, y),
            (1, r, r, x, x),
            (1, r, r, y, y),
        ]
        assert sign(library, monomials) == exact(monomials)
        signs.add(exact(monomials))
    assert signs == {-1, 1}


def test_equal_numbers_written_differently_cancel_to_exactly_zero(library: SnippetLibrary) -> None:
    e, r = 1.1, 0.7
    square_of_sum: list[Monomial] = [
        (1, e, e, 1.0, 1.0),
        (2, e, r, 1.0, 1.0),
        (1, r, r, 1.0, 1.0),
        (-4, 0.5 * e, 0.5 * e, 1.0, 1.0),
        (-1, 2.0 * e, r, 1.0, 1.0),
        (-16, 0.25 * r, 0.25 * r, 1.0, 1.0),
    ]
    assert sign(library, square_of_sum) == 0
    assert sign(library, []) == 0


def test_neither_the_largest_nor_the_smallest_product_is_lost(library: SnippetLibrary) -> None:
    largest: Monomial = (INT_MIN, LARGEST, LARGEST, LARGEST, LARGEST)
    smallest: Monomial = (1, SMALLEST, SMALLEST, SMALLEST, SMALLEST)
    assert sign(library, [smallest]) == 1
    assert sign(library, [largest]) == -1
    assert sign(library, [largest] * 1000 + [smallest]) == -1
    opposite: Monomial = (INT_MIN, -LARGEST, LARGEST, LARGEST, LARGEST)
    assert sign(library, [largest, smallest, opposite]) == 1
    assert sign(library, [largest, (-1, SMALLEST, SMALLEST, SMALLEST, SMALLEST), opposite]) == -1
    assert sign(library, [largest, opposite]) == 0


def test_a_carry_runs_through_every_limb(library: SnippetLibrary) -> None:
    """The sum of 2^k for -4000 <= k < 4000 is 2^4000 - 2^-4000: 8,000 ones in a row."""
    huge: Monomial = (1, 2.0**1000, 2.0**1000, 2.0**1000, 2.0**1000)
    tiny: Monomial = (1, 2.0**-1000, 2.0**-1000, 2.0**-1000, 2.0**-1000)
    power_of_two = functools.partial(math.ldexp, 1.0)  # 2^k is the product of four: k = sum of floor((k + i) / 4)
    run_of_ones: list[Monomial] = [
        (1, power_of_two(k // 4), power_of_two((k + 1) // 4), power_of_two((k + 2) // 4), power_of_two((k + 3) // 4))
        for k in range(-4000, 4000)
    ]
    assert sign(library, [*run_of_ones, tiny, (-1, *huge[1:])]) == 0
    assert sign(library, [*run_of_ones, (-1, *huge[1:])]) == -1
    assert sign(library, [*run_of_ones, tiny, tiny, (-1, *huge[1:])]) == 1


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_header_compiles_without_a_warning_when_nothing_of_it_is_used(compiler: str) -> None:
    compile_c('#include "exact_sign.h"\nint unused(void) { return 0; }\n', "int unused(void);", compiler=compiler)
