"""The three short polynomials behind fast_power.h, fitted, rounded and proved.

    log2(1 + f) = f p(f)        11/16 <= 1 + f <= 11/8
    2^r = 1 + r q(r)            -1/2 <= r <= 1/2
    log2(1 - g) = -g s(g)       0 <= g <= 7/16, for exponents from 32 on

Comes in: nothing. Goes out: `FastTables`, coefficients as rounded to float and the proved bounds of what the C text
computes. Never done here: C text; that is `fast_header.py`.

An error e of log2, relative, and d of 2^y make an absolute error v |ln v| e + v d <= e / exp(1) + d of a power v <= 1.
With degrees 3 and 2 both are about 10^-4; one degree less of either, and one of them alone is beyond 2^-11.

A lobe of a large exponent is narrow: where g > 7/16, (1 - g)^16 and what is computed for it lie between 0 and
1.1 10^-4, so no logarithm is needed there, and none has to be split into exponent and mantissa.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import flint
import mpmath

from symrender_cg.functions.formats import FLOAT
from symrender_cg.functions.minimax import DIGITS, fit_minimax
from symrender_cg.functions.power import HIGHEST_MANTISSA, LOWEST_MANTISSA, bound_exp2_error
from symrender_cg.functions.rounding import (
    Rounded,
    above,
    below,
    between,
    exact,
    half_ulp,
    octave_edges,
    power_error,
    upward,
)
from symrender_cg.functions.supremum import PRECISION, Ball, ball, bound_of_quotient

LOG_DEGREE, EXP2_DEGREE, LOBE_DEGREE = 3, 2, 3
LEAST_LARGE_EXPONENT = 32
LOG_INTERVAL = (LOWEST_MANTISSA - 1, HIGHEST_MANTISSA - 1)
EXP2_INTERVAL = (Fraction(-1, 2), Fraction(1, 2))
LOBE_INTERVAL = (Fraction(0), Fraction(7, 16))

TAYLOR_TERMS = 60
PIECES = 512
SMALLEST_OCTAVE = -24
BINADES = range(-8, 1)
"""Powers of two k in log2 x = k + log2(1 + f); with a k further down the relative error is smaller."""


@dataclass(frozen=True, slots=True)
class FastTables:
    """Coefficients, lowest first; `*_error` are the polynomials' relative errors, the others hold the roundings too.

    `lobe_bound` is that of y = n/2 log2(1 - g), `narrow_bound` the absolute one of a power of an exponent from 32 on.
    """

    log: tuple[float, ...]
    exp2: tuple[float, ...]
    lobe: tuple[float, ...]
    log_error: float
    exp2_error: float
    log_bound: float
    exp2_bound: float
    power_bound: float
    lobe_bound: float
    narrow_bound: float


@functools.cache
def fast_tables() -> FastTables:
    """Fit, round, and prove."""
    with mpmath.workdps(DIGITS):
        log_ends, exp2_ends, lobe_ends = (
            tuple(mpmath.mpf(end.numerator) / end.denominator for end in interval)
            for interval in (LOG_INTERVAL, EXP2_INTERVAL, LOBE_INTERVAL)
        )
    log = fit_minimax(_log2_quotient, lambda f: 1 / _log2_quotient(f), (log_ends[0], log_ends[1]), LOG_DEGREE)
    exp2 = fit_minimax(
        lambda r: mpmath.expm1(r * mpmath.log(2)) / r,
        lambda r: abs(r) / mpmath.power(2, r),
        (exp2_ends[0], exp2_ends[1]),
        EXP2_DEGREE,
    )
    lobe = fit_minimax(
        lambda g: _log2_quotient(-g), lambda g: 1 / _log2_quotient(-g), (lobe_ends[0], lobe_ends[1]), LOBE_DEGREE
    )
    p, q, s = (tuple(map(FLOAT.round, found)) for found in (log, exp2, lobe))
    log_error, exp2_error = bound_log_error(p), bound_exp2_error(q)
    with flint.ctx.workprec(PRECISION):
        unit = ball(FLOAT.unit_roundoff)
        log_bound = _log2_error(p, flint.arb(log_error), unit)
        exps = _exp2_errors(q, flint.arb(exp2_error), unit)
        exp2_bound = max(relative for _, _, relative in exps)
        power_bound = max(power_error(k, exps, log_bound, unit) for k in range(0, -24, -1))
        lobe_bound = _lobe_error(s, flint.arb(bound_lobe_error(s)), unit)
        narrow_bound = max(
            *(power_error(k, exps, lobe_bound, unit) for k in range(0, -24, -1)), _outside_lobe(s, exp2_bound)
        )
    found = map(upward, (log_bound, exp2_bound, power_bound, lobe_bound, narrow_bound))
    return FastTables(p, q, s, log_error, exp2_error, *found)


def _log2_quotient(f: Any) -> Any:
    """log2(1 + f) / f."""
    return mpmath.log1p(f) / (f * mpmath.log(2)) if f else 1 / mpmath.log(2)


def bound_log_error(coefficients: tuple[float, ...]) -> float:
    """A proved bound of |f p(f) / log2(1 + f) - 1| over the interval.

    log2(1 + f) / f is 1 / ln 2 (1 - f/2 + f^2/3 - ...), whose terms from the 60th on sum to less than 10^-25 on
    |f| <= 3/8, and at least 2 / ((2 + f) ln 2), the first term of 2 atanh(f / (2 + f)).
    """
    with flint.ctx.workprec(PRECISION):
        log_2 = flint.arb(2).log()
        terms = [(-1) ** k / (log_2 * (k + 1)) for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-25), *terms[1:]])
        difference = flint.arb_poly([flint.arb(c) for c in coefficients]) - true
        return bound_of_quotient(difference, lambda f: 2 / ((2 + f) * log_2), LOG_INTERVAL)


def _log2_error(p: tuple[float, ...], fit: Ball, unit: Ball) -> Ball:
    """Largest relative error of k + f p(f) as C computes it."""
    largest = flint.arb(0)
    for f_ball in _pieces_of_f():
        f = Rounded(f_ball, flint.arb(0), unit)
        sum_ = f * _by_pairs(p, f, f * f)
        true = (1 + f_ball).log() / flint.arb(2).log()
        absolute = sum_.error + above(true) * fit
        largest = max(largest, above(absolute / below(true)))
        for k in BINADES[:-1]:
            rounded = absolute + half_ulp(above(k + true) + absolute, unit)
            largest = max(largest, above(rounded / below(k + true)))
    return largest


def bound_lobe_error(coefficients: tuple[float, ...]) -> float:
    """A proved bound of |g s(g) / log2(1 - g) + 1| over the interval.

    -log2(1 - g) / g is 1 / ln 2 (1 + g/2 + g^2/3 + ...), whose terms from the 60th on sum to less than 10^-22 on
    g <= 7/16, and at least the sum of its first four.
    """
    with flint.ctx.workprec(PRECISION):
        log_2 = flint.arb(2).log()
        terms = [1 / (log_2 * (k + 1)) for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-22), *terms[1:]])
        difference = flint.arb_poly([flint.arb(c) for c in coefficients]) - true
        return bound_of_quotient(difference, lambda g: (1 + g / 2 + g**2 / 3 + g**3 / 4) / log_2, LOBE_INTERVAL)


def _lobe_error(s: tuple[float, ...], fit: Ball, unit: Ball) -> Ball:
    """Largest relative error of h g s(g) as C computes it, g given, h exact; below g = 2^-24 it is that of s(0)."""
    log_2 = flint.arb(2).log()
    largest = flint.arb(0)
    for high, low in itertools.pairwise(octave_edges(LOBE_INTERVAL[1], SMALLEST_OCTAVE)):
        g_ball = between(high, low)
        g = Rounded(g_ball, flint.arb(0), unit)
        product = g * exact(1.0, unit) * _by_pairs(s, g, g * g)  # h g: one rounding, relative; so is that of 1 g
        true = -(1 - g_ball).log() / log_2
        largest = max(largest, above((product.error + above(true) * fit) / below(true)))
    return largest


def _outside_lobe(s: tuple[float, ...], exp2_bound: Ball) -> Ball:
    """The largest power beyond the interval, true or computed: both fall as g grows, for s has no negative member."""
    assert min(s) > 0.0, "g s(g) grows with g"
    g = ball(LOBE_INTERVAL[1])
    half = ball(Fraction(LEAST_LARGE_EXPONENT, 2))
    total = sum((flint.arb(c) * g**k for k, c in enumerate(s)), flint.arb(0))
    computed = flint.arb(2) ** (-half * g * total * (1 - flint.arb("1e-5"))) * (1 + exp2_bound)
    return max(above((1 - g) ** half), above(computed))


def _exp2_errors(q: tuple[float, ...], fit: Ball, unit: Ball) -> list[tuple[Ball, Ball, Ball]]:
    """(r, absolute error of 2^r, relative error) on pieces of -1/2 <= r <= 1/2."""
    pieces = []
    for piece in range(PIECES):
        r_ball = between(Fraction(piece, PIECES) - Fraction(1, 2), Fraction(piece + 1, PIECES) - Fraction(1, 2))
        r = Rounded(r_ball, flint.arb(0), unit)
        power = exact(1.0, unit) + r * (exact(q[0], unit) + r * (exact(q[1], unit) + r * exact(q[2], unit)))
        true = (r_ball * flint.arb(2).log()).exp()
        absolute = power.error + above(true) * fit
        pieces.append((r_ball, absolute, above(absolute / below(true))))
    return pieces


def _pieces_of_f() -> list[Ball]:
    """Pieces of both signs, down to |f| = 2^-24; below, f p(f) is c f with a rounding of each."""
    pieces = []
    for end in LOG_INTERVAL:
        sign = 1 if end > 0 else -1
        edges = octave_edges(abs(end), SMALLEST_OCTAVE)
        pieces += [between(sign * high, sign * low) for high, low in itertools.pairwise(edges)]
    return pieces


def _by_pairs(p: tuple[float, ...], f: Rounded, f2: Rounded) -> Rounded:
    """(p0 + p1 f) + (p2 + p3 f) f^2."""
    low, high = (exact(p[k], f.unit) + exact(p[k + 1], f.unit) * f for k in (0, 2))
    return low + high * f2
