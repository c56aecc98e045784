"""Proved error bounds of the double-double functions of elementary.h.

Comes in: nothing; the polynomials are those of precise_power.h. Goes out: `ElementaryBounds`, relative errors. Never
done here: fitting.

The model is that of `pair_rounding.py`, with the bounds of double_double.h for its operations: sum 3 u^2, sum with a
double 2 u^2, product 4 u^2.
"""

from __future__ import annotations

import functools
import itertools
from fractions import Fraction

import flint

from symrender_cg.functions.elementary import ElementaryBounds
from symrender_cg.functions.pair_rounding import Part, bound_of_power, bound_pairs, polynomial, step
from symrender_cg.functions.pairs import (
    DOUBLE_DOUBLE,
    EXP2_INTERVAL,
    HIGHEST_MANTISSA,
    LOWEST_MANTISSA,
    SQUARINGS,
    TAYLOR_TERMS,
    PairTables,
    pair_tables,
    polynomial_of,
)
from symrender_cg.functions.rounding import above, below, between, octave_edges, upward
from symrender_cg.functions.supremum import PRECISION, Ball, ball, bound_of_quotient

U = Fraction(1, 2**53)
LARGEST_EXPONENT = 1024
SMALLEST_OCTAVE = -110
BINADES = (*range(-12, 13), -LARGEST_EXPONENT, LARGEST_EXPONENT)


@functools.cache
def dd_bounds() -> ElementaryBounds:
    """Relative errors of the double-double functions, for normalised arguments.

    exp2 and log2 are those of precise_power.h. log1p multiplies by ln 2, a constant to u^2, and where 1 + x is formed
    it passes that error on to a logarithm of at least that of the nearer end of the mantissas.
    """
    tables = pair_tables(DOUBLE_DOUBLE)
    bounds = bound_pairs(tables)
    with flint.ctx.workprec(PRECISION):
        u2 = ball(U**2)
        smallest = below(ball(HIGHEST_MANTISSA).log())
        assert smallest < below(ball(LOWEST_MANTISSA).log()), "the upper end of the mantissas is the nearer one to 1"
        log1p = (flint.arb(bounds.log2) + 5 * u2 + 2 * u2 / smallest) * (1 + 8 * u2)
        expm1 = _expm1_error(tables)
        return ElementaryBounds(
            bounds.exp2, bounds.log2, upward(expm1), upward(log1p), bound_of_power(bounds, LARGEST_EXPONENT)
        )


def _expm1_error(tables: PairTables) -> Ball:
    """Largest relative error of expm1: near 0 that of 2^r - 1 with r = x / ln 2, elsewhere with 2^k - 1.

    The product x / ln 2 errs by 5 u^2, and r.lo by nothing: the difference y - k is exact in two doubles.
    """
    unit, u2, ln2 = ball(U), ball(U**2), flint.arb(2).log()
    fit, largest = flint.arb(bound_exp2_quotient(tables)), flint.arb(0)
    for sign in (-1, 1):
        for high, low in itertools.pairwise(octave_edges(EXP2_INTERVAL[1], SMALLEST_OCTAVE)):
            r = between(sign * high, sign * low)
            e = _start(tables, r, fit)
            for _ in range(SQUARINGS):
                e = _doubled(e)
            true = (r * ln2).exp() - 1
            reduction = above((true + 1) * ln2 * 5 * u2 * (1 + unit))
            largest = _larger(largest, (e.error + reduction * above(r)) / below(true))
            for k in BINADES if high > Fraction(1, 8) else (-1, 1):
                if k == 0:
                    continue
                total = true + 1 - flint.arb(2) ** -k
                error = e.error + reduction * above(k + r)
                error += u2 * 4 * (above(total) + error)
                largest = _larger(largest, error / below(total))
    return largest


def _start(tables: PairTables, r: Ball, fit: Ball) -> Part:
    """2^(r/8) - 1 = r d(r) + (r.lo ln 2 / 8) 2^(r/8), normalised; r.lo is at most u r, and four roundings touch it."""
    unit, scale = ball(U), flint.arb(2).log() / 2**SQUARINGS
    argument = Part(r, flint.arb(0), flint.arb(0))
    product = step(
        Part(flint.arb(0), flint.arb(0), flint.arb(0)),
        argument,
        polynomial(tables.exp2_pairs, tables.exp2_tail, argument),
    )
    true = (r * scale).exp() - 1
    carried = unit * above(r) * scale * above(true + 1)
    error = product.error + above(true) * fit + carried * (5 * unit + carried)
    error += unit * (product.low + carried) * (1 + unit)
    return Part(true, above(error), flint.arb(0))


def _doubled(e: Part) -> Part:
    """e (2 + e): the sum errs by 2 u^2, the product by 4 u^2."""
    u2 = ball(U**2)
    other = 2 + e.value
    other_error = e.error + 2 * u2 * (above(other) + e.error)
    value = e.value * other
    error = above(e.value) * other_error + above(other) * e.error + e.error * other_error
    return Part(value, above(error + 4 * u2 * (above(value) + error)), flint.arb(0))


def bound_exp2_quotient(tables: PairTables) -> float:
    """A proved bound of |d(r) / ((2^(r/8) - 1) / r) - 1|; the quotient grows with r, and is 0.0847 or more at -1/2."""
    with flint.ctx.workprec(PRECISION):
        log_2 = flint.arb(2).log() / 2**SQUARINGS
        terms = [log_2 ** (k + 1) / flint.arb(k + 2).gamma() for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-100), *terms[1:]])
        lowest = flint.arb("0.0847")
        half = ball(EXP2_INTERVAL[1])
        assert lowest < (1 - (-half * log_2).exp()) / half, "the lower bound of the quotient is not one"
        difference = polynomial_of(tables.exp2_pairs, tables.exp2_tail) - true
        return bound_of_quotient(difference, lambda r: lowest + 0 * r, EXP2_INTERVAL)


def _larger(one: Ball, other: Ball) -> Ball:
    one, other = above(one), above(other)
    return one if one > other else other
