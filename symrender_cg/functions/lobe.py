"""Powers of a cosine in two halves, log2 and 2^y, for loops that are bound by how long operations wait for one another.

    log2(1 + f) = s (c + z p(z)),  s = f / (2 + f),  z = s^2,  c = 2 / ln 2     11/16 <= 1 + f <= 11/8
    2^r = 1 + (r ln 2 + r^2 q(r))                                               -1/2 <= r <= 1/2

Comes in: a format. Goes out: `LobeTables`, the coefficients as rounded and the proved bounds of what lobe_power.h
computes. Never done here: C text; that is `lobe_header.py`.

The logarithm of power.h keeps its leading term f exact, which is worth a unit roundoff and costs five operations; here
they are saved. The polynomials are those of power.h, summed four terms at a time (Estrin 1960) instead of two.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from fractions import Fraction

import flint
import mpmath

from symrender_cg.functions.formats import Format
from symrender_cg.functions.minimax import DIGITS, fit_minimax
from symrender_cg.functions.power import (
    DEGREES,
    HIGHEST_MANTISSA,
    LARGEST_S,
    LOWEST_MANTISSA,
    TAYLOR_TERMS,
    bound_exp2_error,
    power_tables,
)
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

LOG_INTERVAL = (Fraction(0), LARGEST_S**2)
GROUP = 4
"""Terms of a polynomial that are summed by themselves."""

_PIECES = 128
_SMALLEST_OCTAVE = -64
_BINADES = range(-8, 1)
_LOWEST_EXPONENT = -24


@dataclass(frozen=True, slots=True)
class LobeTables:
    """Coefficients, lowest first: of log2 c and then p, of 2^r ln 2 and then q.

    Bounds are relative, in unit roundoffs; that of the power is absolute.
    """

    format: Format
    log: tuple[float, ...]
    exp2: tuple[float, ...]
    log2_bound: float
    exp2_bound: float
    power_bound: float


@functools.cache
def lobe_tables(form: Format) -> LobeTables:
    """Fit, round, and prove; about a second."""
    _, degree = DEGREES[form]
    with mpmath.workdps(DIGITS):
        ends = tuple(mpmath.mpf(end.numerator) / end.denominator for end in LOG_INTERVAL)
        scale = 2 / mpmath.log(2)
    tail = fit_minimax(
        lambda z: scale * (mpmath.atanh(mpmath.sqrt(z)) / mpmath.sqrt(z) - 1) / z,
        lambda z: z,
        (ends[0], ends[1]),
        degree,
    )
    log = (form.round(scale), *(form.round(c) for c in tail))
    exp2 = power_tables(form).exp2_tail
    with flint.ctx.workprec(PRECISION):
        unit = ball(form.unit_roundoff)
        log2 = _log2_error(log, flint.arb(bound_log_error(log)), unit)
        exps = _exp2_errors(exp2, flint.arb(bound_exp2_error(exp2)), unit)
        exponential = max(relative for _, _, relative in exps)
        power = max(power_error(k, exps, log2, unit) for k in range(0, _LOWEST_EXPONENT, -1))
        return LobeTables(form, log, exp2, upward(log2 / unit), upward(exponential / unit), upward(power))


def bound_log_error(log: tuple[float, ...]) -> float:
    """A proved bound of |s (c + z p(z)) / log2(1 + f) - 1|, s = sqrt(z), over the interval of z.

    log2(1 + f) / s = 2 / ln 2 (1 + z/3 + z^2/5 + ...); from its 40th term on the sum is less than 10^-55.
    """
    with flint.ctx.workprec(PRECISION):
        scale = 2 / flint.arb(2).log()
        terms = [scale / (2 * k + 1) for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-55), *terms[1:]])
        difference = flint.arb_poly([flint.arb(c) for c in log]) - true
        return bound_of_quotient(difference, lambda z: scale + z * 0, LOG_INTERVAL)


def in_groups(coefficients: tuple[float, ...], x: Rounded, x2: Rounded, x4: Rounded) -> Rounded:
    """p(x) as lobe_power.h sums it: groups (c0 + c1 x) + (c2 + c3 x) x^2 by Horner's rule in x^4."""
    total: Rounded | None = None
    for first in range((len(coefficients) - 1) // GROUP * GROUP, -1, -GROUP):
        group = _group(coefficients[first : first + GROUP], x, x2)
        total = group if total is None else total * x4 + group
    assert total is not None, "a polynomial has a coefficient"
    return total


def _group(members: tuple[float, ...], x: Rounded, x2: Rounded) -> Rounded:
    def pair(two: tuple[float, ...]) -> Rounded:
        first = exact(two[0], x.unit)
        return first if len(two) == 1 else first + exact(two[1], x.unit) * x

    return pair(members[:2]) if len(members) <= 2 else pair(members[:2]) + pair(members[2:]) * x2


def log2_of_sum(f: Rounded, log: tuple[float, ...]) -> Rounded:
    """log2(1 + f) as lobe_power.h computes it, without the error of the polynomial."""
    s = f / (exact(2, f.unit) + f)
    z = s * s
    z2 = z * z
    p = in_groups(log[1:], z, z2, z2 * z2)
    return s * (exact(log[0], f.unit) + z * p)


def two_to(r: Rounded, exp2: tuple[float, ...]) -> Rounded:
    """2^r as lobe_power.h computes it, without the error of the polynomial."""
    r2 = r * r
    q = in_groups(exp2[1:], r, r2, r2 * r2)
    return exact(1, r.unit) + (exact(exp2[0], r.unit) * r + r2 * q)


def _log2_error(log: tuple[float, ...], fit: Ball, unit: Ball) -> Ball:
    """Largest relative error of k + log2(1 + f), k <= 0; below |f| = 2^-64 that of two products and a quotient."""
    largest = flint.arb(0)
    for sign, limit in ((-1, 1 - LOWEST_MANTISSA), (1, HIGHEST_MANTISSA - 1)):
        for high, low in itertools.pairwise(octave_edges(limit, _SMALLEST_OCTAVE)):
            f = Rounded(between(sign * high, sign * low), flint.arb(0), unit)
            true = (1 + f.value).log() / flint.arb(2).log()
            absolute = log2_of_sum(f, log).error + above(true) * fit
            largest = max(largest, above(absolute / below(true)))
            for k in _BINADES[:-1]:
                total = absolute + half_ulp(above(k + true) + absolute, unit)
                largest = max(largest, above(total / below(k + true)))
    return largest


def _exp2_errors(exp2: tuple[float, ...], fit: Ball, unit: Ball) -> list[tuple[Ball, Ball, Ball]]:
    """(r, absolute error of 2^r, relative error) on pieces of -1/2 <= r <= 1/2."""
    pieces = []
    for piece in range(_PIECES):
        edges = (Fraction(piece + k, _PIECES) - Fraction(1, 2) for k in (0, 1))
        r = Rounded(between(*edges), flint.arb(0), unit)
        true = (r.value * flint.arb(2).log()).exp()
        absolute = two_to(r, exp2).error + above(true) * fit
        pieces.append((r.value, absolute, above(absolute / below(true))))
    return pieces
