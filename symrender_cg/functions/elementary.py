"""Proved error bounds of elementary.h: exp2, log2, expm1, log1p and pow for all their arguments.

Comes in: a format, double or float, whose polynomials are those of power.h. Goes out: `ElementaryBounds`, relative
errors. Never done here: fitting, for every polynomial has one home; double-double, that is `elementary_pairs.py`.

The model is that of `rounding.py`: each operation of the C text is repeated on pieces of its argument's range.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from fractions import Fraction

import flint
import mpmath

from symrender_cg.functions.formats import DOUBLE, FLOAT, Format
from symrender_cg.functions.pair_rounding import bound_of_power, bound_pairs
from symrender_cg.functions.pairs import PRECISE, pair_tables
from symrender_cg.functions.power import HIGHEST_MANTISSA, LOWEST_MANTISSA, PowerTables, power_tables
from symrender_cg.functions.rounding import (
    Rounded,
    above,
    below,
    between,
    exp2_minus_one,
    half_ulp,
    ln_of_sum,
    octave_edges,
    upward,
)
from symrender_cg.functions.supremum import PRECISION, Ball, ball, bound_of_quotient

BINADES = (-120, *range(-23, 0), *range(1, 24), 120)
"""Powers of two k that are looked at; beyond, the term of k is all of the result, and its error is in proportion."""

PIECES = 128
DIGITS = 60


@dataclass(frozen=True, slots=True)
class ElementaryBounds:
    """Relative errors: of double and float in unit roundoffs of the format, of double-double as they are."""

    exp2: float
    log2: float
    expm1: float
    log1p: float
    pow: float


@dataclass(frozen=True, slots=True)
class Logarithms:
    """ln 2 and 1 / ln 2 as sums of two numbers of a format; k times the first of ln 2 is exact for every exponent k."""

    ln2_high: float
    ln2_low: float
    inverse_high: float
    inverse_low: float


@functools.cache
def logarithms(form: Format) -> Logarithms:
    """The constants of a format."""
    with mpmath.workdps(DIGITS):
        ln2, inverse = mpmath.log(2), 1 / mpmath.log(2)
        bits = form.precision - (form.width - form.precision)
        ln2_high = float(mpmath.floor(ln2 * 2**bits) / 2**bits)
        inverse_high = form.round(inverse)
        return Logarithms(ln2_high, form.round(ln2 - ln2_high), inverse_high, form.round(inverse - inverse_high))


@functools.cache
def elementary_bounds(form: Format) -> ElementaryBounds:
    """The bounds of one format, about a second."""
    tables = power_tables(form)
    with flint.ctx.workprec(PRECISION):
        unit = ball(form.unit_roundoff)
        log2, log1p = _log_errors(tables, unit)
        expm1 = _expm1_error(tables, unit)
        return ElementaryBounds(
            exp2=tables.bounds.exp2,
            log2=upward(log2 / unit),
            expm1=upward(expm1 / unit),
            log1p=upward(log1p / unit),
            pow=pow_bound(form),
        )


def _log_errors(tables: PowerTables, unit: Ball) -> tuple[Ball, Ball]:
    """Largest relative errors of log2 x and log1p x: near 1 and 0 that of ln(1 + f), elsewhere with the term of k."""
    constants, fit = logarithms(tables.format), flint.arb(tables.log_error)
    ln2 = flint.arb(2).log()
    ln2_error = above(ln2 - flint.arb(constants.ln2_high) - flint.arb(constants.ln2_low))
    scale = Rounded(1 / ln2, above(tables.inverse_ln2 - 1 / ln2), unit)
    log2, log1p = flint.arb(tables.bounds.log2_unit) * unit, flint.arb(0)
    for end in (LOWEST_MANTISSA - 1, HIGHEST_MANTISSA - 1):
        sign = 1 if end > 0 else -1
        for high, low in itertools.pairwise(octave_edges(abs(end), -2 * tables.format.precision)):
            f = Rounded(between(sign * high, sign * low), flint.arb(0), unit)
            ln, true = ln_of_sum(f, tables.log_tail), (1 + f.value).log()
            ln_error = above(ln.error + above(true) * fit)
            log1p = _larger(log1p, ln_error / below(true))
            if high < Fraction(1, 64):
                continue
            scaled = above((Rounded(true, ln_error, unit) * scale).error)
            for k in BINADES:
                total = k + true / ln2
                log2 = _larger(log2, (scaled + half_ulp(above(total) + scaled, unit)) / below(total))
                error = ln_error + abs(k) * ln2_error + _rest_error(k, constants, unit)
                error += half_ulp(above(true) + error + above(unit) * (abs(k) + 2), unit)
                total = k * ln2 + true
                log1p = _larger(log1p, (error + half_ulp(above(total) + error, unit)) / below(total))
    return log2, log1p


def _rest_error(k: int, constants: Logarithms, unit: Ball) -> Ball:
    """Error of k LN2_LOW + c / u, where 1 + x = u + c and |c| <= unit u: three roundings, and (c / u)^2 / 2."""
    low = abs(k) * abs(flint.arb(constants.ln2_low))
    return above(unit * low + 2 * unit**2 + unit * (low + 2 * unit))


def _expm1_error(tables: PowerTables, unit: Ball) -> Ball:
    """Largest relative error of expm1: near 0 that of 2^r - 1, elsewhere with 2^k - 1."""
    form = tables.format
    constants, fit = logarithms(form), flint.arb(bound_exp2_minus_one(tables))
    ln2 = flint.arb(2).log()
    constant_error = above(ln2 * (1 / ln2 - flint.arb(constants.inverse_high) - flint.arb(constants.inverse_low)))
    largest = above(unit) / 4 if form is DOUBLE else above(unit)  # below 2^-precision - 1, x itself: x / 2 is left out
    for sign in (-1, 1):
        for high, low in itertools.pairwise(octave_edges(Fraction(1, 2), -form.precision - 2)):
            r = Rounded(between(sign * high, sign * low), flint.arb(0), unit)
            part, true = exp2_minus_one(r, tables.exp2_tail), (r.value * ln2).exp() - 1
            for k in (0, *(BINADES if high > Fraction(1, 8) else (-1, 1))):
                y = above(k + r.value)
                error = part.error + above(true) * fit + _carried_error(y, above(true), constant_error, unit)
                error += half_ulp(above(true) + error, unit)
                total = flint.arb(2) ** k * (true + 1) - 1
                if k == 0:
                    largest = _larger(largest, error / below(true))
                    continue
                error *= flint.arb(2) ** k
                if abs(k) >= form.precision:
                    error += half_ulp(above(flint.arb(2) ** k - 1), unit)
                largest = _larger(largest, (error + half_ulp(above(total) + error, unit)) / below(total))
    return largest


def _carried_error(y: Ball, true: Ball, constant_error: Ball, unit: Ball) -> Ball:
    """Error of (1 + e) ln 2 y_low, y + y_low = x / ln 2: four roundings, y_low^2, and the constant's own error."""
    low = y * unit * (1 + unit)
    one = 1 + true
    return above(one * (low * 5 * unit + low**2 + y * constant_error * 2 + y * unit**2 * 4))


def bound_exp2_minus_one(tables: PowerTables) -> float:
    """A proved bound of |r q(r) / (2^r - 1) - 1| over [-1/2, 1/2]; (2^r - 1) / r is at least 0.5857, as at -1/2."""
    with flint.ctx.workprec(PRECISION):
        log_2 = flint.arb(2).log()
        terms = [log_2 ** (k + 1) / flint.arb(k + 2).gamma() for k in range(40)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-65), *terms[1:]])
        difference = flint.arb_poly([flint.arb(c) for c in tables.exp2_tail]) - true
        interval = (Fraction(-1, 2), Fraction(1, 2))
        return bound_of_quotient(difference, lambda r: flint.arb("0.5857") + 0 * r, interval)


def pow_bound(form: Format) -> float:
    """Relative error of pow in the format's unit roundoffs: the last rounding, and what is carried to it.

    double: the pair of `precise_` is rounded once. float: log2 and exp2 of double are, for |y log2 x| <= 150.
    """
    with flint.ctx.workprec(PRECISION):
        if form is DOUBLE:
            carried = flint.arb(bound_of_power(bound_pairs(pair_tables(PRECISE)), 1076)) / ball(DOUBLE.unit_roundoff)
        else:
            double = elementary_bounds(DOUBLE)
            u = ball(DOUBLE.unit_roundoff)
            exponent = 150 * (flint.arb(double.log2) + 1) * u * flint.arb(2).log()
            carried = (exponent * (1 + exponent) + flint.arb(double.exp2) * u * 2) / ball(FLOAT.unit_roundoff)
        return upward(1 + carried * (1 + ball(form.unit_roundoff) * 2))


def _larger(one: Ball, other: Ball) -> Ball:
    one, other = above(one), above(other)
    return one if one > other else other
