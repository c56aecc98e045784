"""The two polynomials behind power.h, fitted, rounded and proved, for double and float.

    exp2 tail q    2^r = 1 + r q(r)                                          -1/2 <= r <= 1/2
    log tail p     ln(1 + f) = 2 s + s z p(z),  s = f / (2 + f),  z = s^2     11/16 <= 1 + f <= 11/8

Comes in: a format and nothing else. Goes out: `PowerTables`, the coefficients as rounded to the format with proved
bounds: of each polynomial, of log2 and 2^y as C computes them, and of the power. Never done here: C text; that is
`header.py`.

Why 1 + f starts at 11/16 and not at sqrt(1/2): an argument x <= 1 of a power is 2^k (1 + f) with k = 0 or k <= -1. The
worst cancellation in log2 x = k + log2(1 + f) is that of k = -1 at the upper end of 1 + f, and lowering both ends moves
it away from the place where the result is small.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import flint
import mpmath

from symrender_cg.functions.formats import DOUBLE, FLOAT, Format
from symrender_cg.functions.minimax import DIGITS, fit_minimax
from symrender_cg.functions.rounding import PowerBounds, bound_power
from symrender_cg.functions.supremum import PRECISION, bound_of_quotient

LOWEST_MANTISSA = Fraction(11, 16)
HIGHEST_MANTISSA = 2 * LOWEST_MANTISSA
LARGEST_S = (1 - LOWEST_MANTISSA) / (1 + LOWEST_MANTISSA)

EXP2_INTERVAL = (Fraction(-1, 2), Fraction(1, 2))
LOG_INTERVAL = (Fraction(0), LARGEST_S**2)

DEGREES = {DOUBLE: (10, 6), FLOAT: (5, 2)}
"""Degrees of q and p: the lowest at which the polynomial contributes less than 0.2 unit roundoffs."""

TAYLOR_TERMS = 40


@dataclass(frozen=True, slots=True)
class PowerTables:
    """What power.h needs for one format: coefficients, lowest first, and proved bounds.

    `exp2_error` and `log_error` are those of the polynomials, relative; `bounds` holds them and every rounding as well.
    """

    format: Format
    exp2_tail: tuple[float, ...]
    log_tail: tuple[float, ...]
    inverse_ln2: float
    exp2_error: float
    log_error: float
    bounds: PowerBounds

    def in_roundoffs(self, error: float) -> float:
        """An error in unit roundoffs of the format."""
        return float(Fraction(error) / self.format.unit_roundoff)


@functools.cache
def power_tables(form: Format) -> PowerTables:
    """Fit, round, and prove; about half a second."""
    exp2_degree, log_degree = DEGREES[form]
    exp2_tail = _rounded(form, fit_minimax(_exp2_tail, lambda _: mpmath.mpf(1), _real(EXP2_INTERVAL), exp2_degree))
    log_tail = _rounded(form, fit_minimax(_log_tail, lambda z: z, _real(LOG_INTERVAL), log_degree))
    with mpmath.workdps(DIGITS):
        inverse_ln2 = form.round(1 / mpmath.log(2))
    exp2_error, log_error = bound_exp2_error(exp2_tail), bound_log_error(log_tail)
    bounds = bound_power(log_tail, log_error, exp2_tail, exp2_error, inverse_ln2=inverse_ln2, precision=form.precision)
    return PowerTables(form, exp2_tail, log_tail, inverse_ln2, exp2_error, log_error, bounds)


def _exp2_tail(r: Any) -> Any:
    """(2^r - 1) / r."""
    return mpmath.expm1(r * mpmath.log(2)) / r


def _log_tail(z: Any) -> Any:
    """(2 atanh(s) - 2 s) / s^3 at s = sqrt(z): 2/3 + 2/5 z + ..."""
    s = mpmath.sqrt(z)
    return 2 * (mpmath.atanh(s) / s - 1) / z


def bound_exp2_error(tail: tuple[float, ...]) -> float:
    """A proved bound of |1 + r q(r) - 2^r| / 2^r over [-1/2, 1/2].

    2^r is its Taylor polynomial of 40 terms and a remainder below 2 (ln 2 / 2)^40 / 40! < 10^-65.
    """
    with flint.ctx.workprec(PRECISION):
        log_2 = flint.arb(2).log()
        terms = [log_2**k / flint.arb(k + 1).gamma() for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-65), *terms[1:]])
        approximate = flint.arb_poly([flint.arb(1), *(flint.arb(c) for c in tail)])
        return bound_of_quotient(approximate - true, lambda r: (r * log_2).exp(), EXP2_INTERVAL)


def bound_log_error(tail: tuple[float, ...]) -> float:
    """A proved bound of |s z p(z) - (2 atanh(s) - 2 s)| / |2 atanh(s)|, s = sqrt(z), over the interval of z.

    2 atanh(s) / s = 2 + 2/3 z + 2/5 z^2 + ... is at least 2; from its 40th term on it sums to less than 10^-55.
    """
    with flint.ctx.workprec(PRECISION):
        terms = [2 / flint.arb(2 * k + 3) for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-55), *terms[1:]])
        difference = flint.arb_poly([flint.arb(c) for c in tail]) - true
        return bound_of_quotient(difference * flint.arb_poly([0, 1]), lambda z: 2 + z * 0, LOG_INTERVAL)


def _rounded(form: Format, coefficients: tuple[Any, ...]) -> tuple[float, ...]:
    return tuple(form.round(c) for c in coefficients)


def _real(interval: tuple[Fraction, Fraction]) -> tuple[Any, Any]:
    with mpmath.workdps(DIGITS):
        lowest, highest = (mpmath.mpf(end.numerator) / end.denominator for end in interval)
        return lowest, highest
