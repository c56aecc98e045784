"""A proved bound of the rounding errors of precise_power.h, by running error analysis in Arb's balls.

Comes in: the `PairTables` of one level. Goes out: `PairBounds`. Every step of the C text is repeated here on a piece of
its argument's range. A pair (hi, lo) is followed as a ball for the number it stands for, a bound of |hi + lo - number|,
and a bound of |lo|: what a product of high parts loses, fma returns exactly, so that only the sums of low parts round.
Never done here: a measurement; the tests measure, and the measured errors stay below.

The model: RN(x) errs by at most u |x|, u = 2^-53; an intermediate that underflows errs by 2^-1074, which is nothing
beside the other terms, even 2^200 times as large.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass, replace
from fractions import Fraction

import flint

from symrender_cg.functions.pairs import (
    EXP2_INTERVAL,
    MIDDLE_ZONE,
    SQUARINGS,
    ZONES,
    Pair,
    PairTables,
    Zone,
    exact_pair,
)
from symrender_cg.functions.rounding import above, below, between, octave_edges, upward
from symrender_cg.functions.supremum import PRECISION, Ball, ball

U = Fraction(1, 2**53)
PIECES_OF_A_ZONE = 64
PIECES_OF_A_UNIT = 128
SMALLEST_OCTAVE = -64
BINADES = (-2, -1, 0, 1, 2)
"""Powers of two k in log2 x = k + log2 m. Beyond, the error grows by 2 u^2 |k| at most, the logarithm by |k|."""


@dataclass(frozen=True, slots=True)
class Part:
    """A computed number in one double (`low` is 0) or two: |hi + lo - value| <= error, |lo| <= low."""

    value: Ball
    error: Ball
    low: Ball

    @property
    def high(self) -> Ball:
        """A bound of |hi|."""
        return above(above(self.value) + self.error + self.low)


@dataclass(frozen=True, slots=True)
class PairBounds:
    """Proved errors: of log2 (relative), of 2^y with y as given (relative), of the power (relative).

    `log2_low` bounds the low part of log2 as a fraction of it.
    """

    log2: float
    exp2: float
    power: float
    log2_low: float


@functools.cache
def bound_pairs(tables: PairTables) -> PairBounds:
    """The bounds of one level, for arguments whose low part is at most `level.largest_low` of the high part."""
    with flint.ctx.workprec(PRECISION):
        log2, log2_low = _bound_log2(tables)
        without_power = PairBounds(upward(log2), upward(_bound_exp2(tables)), 1.0, upward(log2_low))
        lowest = tables.level.lowest_power
        power = bound_of_power(without_power, 1 - lowest) + 2.0 ** (-1074 - lowest)
        return replace(without_power, power=upward(flint.arb(power)))


def _bound_log2(tables: PairTables) -> tuple[Ball, Ball]:
    """(relative error, |lo| relative) of log2 of a pair x > 0, or of 1 - g with g a pair below 1/2."""
    relative, low = flint.arb(0), flint.arb(0)
    largest_low = ball(tables.level.largest_low)
    for f in _pieces_near_one():
        part = _log2_of_sum(tables, _normalised(Part(f, flint.arb(0), above(largest_low * above(f)))))
        true = (1 + f).log() / flint.arb(2).log()
        relative, low = _larger(relative, part.error / below(true)), _larger(low, part.low / below(true))
    for zone, k in itertools.product(ZONES, BINADES):
        if zone is MIDDLE_ZONE and k == 0:
            continue
        constant = _whole_part(k, zone, tables.zone_logs[ZONES.index(zone)])
        for m in _pieces_of(zone):
            part = _log2_of_sum(tables, _reduced(m, zone, largest_low), constant)
            true = k + m.log() / flint.arb(2).log()
            relative, low = _larger(relative, part.error / below(true)), _larger(low, part.low / below(true))
    return relative, low


def _reduced(m: Ball, zone: Zone, largest_low: Ball) -> Part:
    """f = m c - 1 from g = 1 - m as (c - 1) - g c: the product is exact in two doubles, the difference by Sterbenz.

    g.lo is at most 3/2 of `largest_low`: m is below 3/2; and where 1 - g was formed from a g below 1/2 and doubled, it
    keeps twice u/2 of its rounding and twice the low part of g, which is at most u/4 where numbers are normalised, and
    half of a `largest_low` far above u where they are not.
    """
    unit, factor = ball(U), ball(zone.factor)
    g_low = 3 * largest_low / 2
    low = g_low * factor + (unit * above(1 - m) * factor if zone is not MIDDLE_ZONE else 0)
    return _normalised(Part(m * factor - 1, above(unit * g_low * factor + unit * low), above(low)))


def _normalised(f: Part) -> Part:
    """Fast2Sum of both parts: exact, if the high part is the larger one; else two roundings of the low one at most."""
    unit = ball(U)
    error = f.error if below(f.value) > 2 * f.low else f.error + 4 * unit * f.low
    return Part(f.value, above(error), above(unit * f.high))


def _log2_of_sum(tables: PairTables, f: Part, constant: Part | None = None) -> Part:
    """constant + log2(1 + f) = constant + s E(z), with the error of the polynomial."""
    s = _quotient(f)
    factor = polynomial(tables.log_pairs, tables.log_tail, _square(s))
    log2 = step(constant or Part(flint.arb(0), flint.arb(0), flint.arb(0)), s, factor)
    of_sum = (1 + f.value).log() / flint.arb(2).log()
    return Part(log2.value, above(log2.error + above(of_sum) * flint.arb(tables.log_error)), log2.low)


def _quotient(f: Part) -> Part:
    """s = f / (2 + f): s.hi = f.hi (1 / d), and the remainder f - s.hi d times 1 / d; d + dl = 2 + f."""
    unit = ball(U)
    d = 2 + f.value
    dl = 2 * unit + f.low
    hi = f.high / below(d) * (1 + 4 * unit)
    remainder = (2 * unit + 4 * unit**2) * f.high + f.low + hi * dl
    exact = remainder / below(d)
    error = (unit * f.high * 3 * unit + 2 * unit * remainder + hi * unit * dl) / below(d)
    error += exact * (2 * unit + dl / below(d)) + 2 * f.error / below(d) ** 2
    return Part(1 - 2 / d, above(error * (1 + 8 * unit)), above(exact * (1 + 8 * unit)))


def _square(s: Part) -> Part:
    """s^2: the product of the high parts and its remainder, 2 s.hi s.lo; s.lo^2 is left out."""
    unit = ball(U)
    lows = unit * s.high**2 + 2 * s.high * s.low
    error = 2 * above(s.value) * s.error + s.error**2 + s.low**2 + unit * lows
    return Part(s.value**2, above(error), above(lows * (1 + unit)))


def polynomial(pairs: tuple[Pair, ...], tail: tuple[float, ...], z: Part) -> Part:
    """Horner's rule: the tail in doubles, one sum that keeps its remainder, then sums and products that keep theirs."""
    unit = ball(U)
    total = Part(flint.arb(tail[-1]), flint.arb(0), flint.arb(0))
    for coefficient in tail[-2::-1]:
        product = _times_high(total, z)
        value = flint.arb(coefficient) + total.value * z.value
        total = Part(value, above(product + unit * (above(value) + product)), flint.arb(0))
    value = exact_pair(pairs[-1]) + total.value * z.value
    product, dropped = _times_high(total, z), _dropped(exact_pair(pairs[-1]), value)
    lows = dropped + abs(flint.arb(pairs[-1][1]))
    total = Part(value, above(product + unit * (dropped + lows)), above(lows * (1 + unit)))
    for pair in pairs[-2::-1]:
        total = step(Part(exact_pair(pair), flint.arb(0), abs(flint.arb(pair[1]))), z, total)
    return total


def _times_high(x: Part, z: Part) -> Ball:
    """Error of the number x times z.hi as a stand-in for x z, before it is rounded."""
    return above(x.error * z.high + above(x.value) * (z.low + z.error))


def step(c: Part, z: Part, x: Part) -> Part:
    """c + z x: hi = RN(c.hi + z.hi x.hi), and lo the sum of what that drops and all else but z.lo x.lo."""
    unit = ball(U)
    value = c.value + z.value * x.value
    dropped = _dropped(c.value, value)
    first = z.high * x.low + c.low
    second = first + z.low * x.high
    third = second + dropped
    error = c.error + above(z.value) * x.error + above(x.value) * z.error + x.error * z.error + z.low * x.low
    error += unit * (first + second + third + dropped) * (1 + 4 * unit)
    return Part(value, above(error), above(third * (1 + 4 * unit)))


def _dropped(c: Ball, total: Ball) -> Ball:
    """A bound of |total - RN(total)|. c - RN(total) is exact: c is 0, or RN(total) / c is in [1/2, 2] (Sterbenz)."""
    if not c.is_zero():
        ratio = total / c
        assert 0.5001 < ratio < 1.9999, f"the sum {total} is too far from its first term {c}"
    return ball(U) * above(total) * (1 + ball(U) * 2**20)


def _whole_part(k: int, zone: Zone, zone_log: Pair) -> Part:
    """k - log2 c, c the factor of the zone: Fast2Sum of k and the high part, then one sum of low parts."""
    unit = ball(U)
    exact = -(ball(zone.factor).log() / flint.arb(2).log())
    whole = above(k + flint.arb(zone_log[0]))
    low = unit * whole + abs(flint.arb(zone_log[1]))
    error = above(exact - exact_pair(zone_log)) + unit * low
    return Part(k + exact, above(error), above(low * (1 + unit)))


def _bound_exp2(tables: PairTables) -> Ball:
    """Relative error of 2^(r.hi + r.lo), |r.hi| <= 1/2 and r.lo <= 2^-53."""
    unit, log_2 = ball(U), flint.arb(2).log() / 2**SQUARINGS
    low, half = 2 * unit, EXP2_INTERVAL[1]
    width = 2 * half / PIECES_OF_A_UNIT
    largest = flint.arb(0)
    for piece in range(PIECES_OF_A_UNIT):
        r = between(piece * width - half, (piece + 1) * width - half)
        power = polynomial(((1.0, 0.0), *tables.exp2_pairs), tables.exp2_tail, Part(r, flint.arb(0), flint.arb(0)))
        true = (r * log_2).exp()
        x = low * log_2
        error = power.error + above(true) * (flint.arb(tables.exp2_error) + x**2)
        error += 4 * unit * x * power.high + unit * power.low + x * (power.low + power.error)
        power = Part(true, above(error), above(power.low + 2 * x * power.high))
        for _ in range(SQUARINGS):
            power = _square(power)
        largest = _larger(largest, power.error / below(power.value))
    return largest


def bound_of_power(bounds: PairBounds, largest: int) -> float:
    """Relative error of 2^y, y = n log2 x and |y| <= largest: y carries the error of the logarithm. No underflow."""
    with flint.ctx.workprec(PRECISION):
        unit = ball(U)
        y_low = largest * (unit + bounds.log2_low * (1 + unit))
        y_error = largest * flint.arb(bounds.log2) * (1 + 4 * unit) + 4 * unit * y_low
        return upward((y_error * flint.arb(2).log()).exp() * (1 + flint.arb(bounds.exp2)) - 1)


def _pieces_near_one() -> list[Ball]:
    """Pieces of f = m - 1 for m of the middle zone, down to |f| = 2^-64; below, s E(z) is a constant times f / 2."""
    ends = ((-1, 1 - MIDDLE_ZONE.low), (1, MIDDLE_ZONE.high - 1))
    edges = [(sign, octave_edges(limit, SMALLEST_OCTAVE)) for sign, limit in ends]
    return [between(sign * high, sign * low) for sign, points in edges for high, low in itertools.pairwise(points)]


def _pieces_of(zone: Zone) -> list[Ball]:
    step = (zone.high - zone.low) / PIECES_OF_A_ZONE
    return [between(zone.low + k * step, zone.low + (k + 1) * step) for k in range(PIECES_OF_A_ZONE)]


def _larger(one: Ball, other: Ball) -> Ball:
    one, other = above(one), above(other)
    return one if one > other else other
