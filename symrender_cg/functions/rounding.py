"""A proved bound of the rounding errors of power.h, by running error analysis in Arb's balls.

Comes in: the coefficients of one format. Goes out: `PowerBounds`. Every operation of the C text is repeated here on a
piece of its argument's range: a ball for the value without rounding, and a bound of how far the computed number is from
it. Never done here: a measurement; the tests measure, and the measured errors stay below.

The model: RN of a number below 2^(e+1) in size errs by at most 2^e u, u = 2^-precision. An intermediate that underflows
does so beside a term 2^60 times as large or more, and changes nothing.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from fractions import Fraction

import flint

from symrender_cg.functions.supremum import PRECISION, Ball, ball

PIECES_OF_AN_OCTAVE = 24
PIECES_OF_A_UNIT = 128
SMALLEST_OCTAVE = -64
LOWEST_EXPONENT = -24
LOWEST_BINADE = -8
SECOND_ORDER = 1.0 + 2.0**-20  # pays for products of two errors, each below 2^-21


@dataclass(frozen=True, slots=True)
class Rounded:
    """A computed quantity: the ball of its values without rounding, a bound of its error, and the unit roundoff."""

    value: Ball
    error: Ball
    unit: Ball

    def __add__(self, other: Rounded) -> Rounded:
        return self._after(self.value + other.value, self.error + other.error)

    def __sub__(self, other: Rounded) -> Rounded:
        return self._after(self.value - other.value, self.error + other.error)

    def __mul__(self, other: Rounded) -> Rounded:
        crossed = above(self.value) * other.error + above(other.value) * self.error
        return self._after(self.value * other.value, crossed + self.error * other.error)

    def __truediv__(self, other: Rounded) -> Rounded:
        quotient = self.value / other.value
        divisor = below(other.value) - other.error
        return self._after(quotient, (self.error + above(quotient) * other.error) / divisor)

    def _after(self, value: Ball, inherited: Ball) -> Rounded:
        inherited = above(inherited)
        return Rounded(value, above(inherited + half_ulp(above(value) + inherited, self.unit)), self.unit)


@dataclass(frozen=True, slots=True)
class PowerBounds:
    """Proved errors of power.h in one format: relative ones in unit roundoffs, that of the power absolute."""

    log2_of_sum: float
    log2_unit: float
    exp2: float
    power: float


def bound_power(
    log_tail: tuple[float, ...],
    log_error: float,
    exp2_tail: tuple[float, ...],
    exp2_error: float,
    *,
    inverse_ln2: float,
    precision: int,
) -> PowerBounds:
    """Bounds for the rounded coefficients, lowest first, and for 1 / ln 2 as rounded; the two errors are relative."""
    with flint.ctx.workprec(PRECISION):
        unit = ball(Fraction(1, 2**precision))
        sums = {sign: _log2_errors(log_tail, inverse_ln2, ball(Fraction(log_error)), unit, sign) for sign in (-1, 1)}
        of_sum = max(relative for pieces in sums.values() for _, _, relative in pieces)
        unit_log = max(of_sum, *(_below_one(k, sums, unit) for k in range(-1, LOWEST_BINADE - 1, -1)))
        exps = _exp2_errors(exp2_tail, ball(Fraction(exp2_error)), unit)
        exp2 = max(relative for _, _, relative in exps)
        power = max(power_error(k, exps, unit_log, unit) for k in range(0, LOWEST_EXPONENT, -1))
        return PowerBounds(*(upward(x) for x in (of_sum / unit, unit_log / unit, exp2 / unit, power)))


def _log2_errors(
    tail: tuple[float, ...], inverse_ln2: float, fit: Ball, unit: Ball, sign: int
) -> list[tuple[Ball, Ball, Ball]]:
    """(log2(1 + f), absolute error, relative error) on pieces of f of one sign, down to |f| = 2^-64.

    Below, f - (...) rounds to f, and the error is that of a rounded constant and one product: less than on any piece.
    """
    pieces = []
    edges = octave_edges(Fraction(5, 16) if sign < 0 else Fraction(3, 8), SMALLEST_OCTAVE)
    inverse = 1 / flint.arb(2).log()
    scale = Rounded(inverse, above(inverse_ln2 - inverse), unit)
    for high, low in itertools.pairwise(edges):
        f = Rounded(between(sign * high, sign * low), flint.arb(0), unit)
        log2 = ln_of_sum(f, tail) * scale
        true = (1 + f.value).log() * inverse
        absolute = log2.error + above(true) * fit
        pieces.append((true, absolute, above(absolute / below(true))))
    return pieces


def ln_of_sum(f: Rounded, tail: tuple[float, ...]) -> Rounded:
    """ln(1 + f) as power.h computes it, without the error of the polynomial."""
    s = f / (exact(2, f.unit) + f)
    z = s * s
    half_square = exact(0.5, f.unit) * f * f
    return f - (half_square - s * (half_square + z * _by_pairs(tail, z)))


def octave_edges(limit: Fraction, smallest_octave: int) -> list[Fraction]:
    """Points from `limit` down to about 2^smallest_octave, each octave in equal steps: relative errors need them."""
    edges = [limit]
    for octave in range(-1, smallest_octave, -1):
        steps = (Fraction(2) ** octave * (1 - Fraction(k, 2 * PIECES_OF_AN_OCTAVE)) for k in range(PIECES_OF_AN_OCTAVE))
        edges += [edge for edge in steps if edge < limit]
    return edges


def between(one: Fraction, other: Fraction) -> Ball:
    """The ball of all numbers from one end to the other."""
    return ball((one + other) / 2) + ball(abs(one - other) / 2) * flint.arb(0, 1)


def _below_one(k: int, sums: dict[int, list[tuple[Ball, Ball, Ball]]], unit: Ball) -> Ball:
    """Largest relative error of k + log2(1 + f). For k < -8 it is below that of k = -1: u / 4 and the last rounding."""
    errors = []
    for log2, absolute, _ in (piece for pieces in sums.values() for piece in pieces):
        total = k + log2
        errors.append(above((absolute + half_ulp(above(total) + absolute, unit)) / below(total)))
    return max(errors)


def _exp2_errors(tail: tuple[float, ...], fit: Ball, unit: Ball) -> list[tuple[Ball, Ball, Ball]]:
    """(r, absolute error of 2^r, relative error) on pieces of -1/2 <= r <= 1/2."""
    log_2 = flint.arb(2).log()
    width = Fraction(1, PIECES_OF_A_UNIT)
    pieces = []
    for piece in range(PIECES_OF_A_UNIT):
        r_ball = ball((piece + Fraction(1, 2)) * width - Fraction(1, 2)) + ball(width / 2) * flint.arb(0, 1)
        r = Rounded(r_ball, flint.arb(0), unit)
        power = exact(1, unit) + exp2_minus_one(r, tail)
        true = (r_ball * log_2).exp()
        absolute = power.error + above(true) * fit
        pieces.append((r_ball, absolute, above(absolute / below(true))))
    return pieces


def exp2_minus_one(r: Rounded, tail: tuple[float, ...]) -> Rounded:
    """2^r - 1 as power.h computes it, without the error of the polynomial."""
    r2 = r * r
    return exact(tail[0], r.unit) * r + r2 * _by_pairs(tail[1:], r, r2)


def power_error(k: int, exps: list[tuple[Ball, Ball, Ball]], log2_error: Ball, unit: Ball) -> Ball:
    """Largest absolute error of 2^y, y = k + r = n log2 x, from all three: the logarithm, the product with n, and 2^y.

    From y = -24 down, v (|ln v| e + e') is below 2^-18 of its maximum.
    """
    log_2 = flint.arb(2).log()
    errors = []
    for r, absolute, _ in exps:
        y = k + r
        if not y < 0.01:
            continue
        y_error = above(y) * log2_error + half_ulp(above(y) * (1 + log2_error), unit)
        value = above((y * log_2).exp())
        errors.append(above(SECOND_ORDER * (value * y_error * log_2 + absolute * flint.arb(2) ** k)))
    return max(errors)


def _by_pairs(tail: tuple[float, ...], x: Rounded, x2: Rounded | None = None) -> Rounded:
    """p(x) as power.h evaluates it: Horner's rule in x^2 over the pairs c + c' x."""
    square = x * x if x2 is None else x2
    pairs = [tail[k : k + 2] for k in range(0, len(tail), 2)]
    terms = [
        exact(pair[0], x.unit) + exact(pair[1], x.unit) * x if len(pair) == 2 else exact(pair[0], x.unit)
        for pair in pairs
    ]
    total = terms[-1]
    for term in terms[-2::-1]:
        total = total * square + term
    return total


def exact(constant: float, unit: Ball) -> Rounded:
    """A constant without error."""
    return Rounded(flint.arb(constant), flint.arb(0), unit)


def half_ulp(magnitude: Ball, unit: Ball) -> Ball:
    """2^e u for numbers up to `magnitude` < 2^(e+1)."""
    size = upward(magnitude)
    return unit * flint.arb(2) ** (math.frexp(size)[1] - 1) if size > 0.0 else flint.arb(0)


def above(x: Ball) -> Ball:
    """The least upper bound of |x|, as a ball without width."""
    return abs(x).upper()


def below(x: Ball) -> Ball:
    """A lower bound of |x|, as a ball without width; x may not contain 0."""
    return abs(x).lower()


def upward(x: Ball) -> float:
    """A double that is at least x >= 0."""
    return float(x.upper()) * (1.0 + 2.0**-50)
