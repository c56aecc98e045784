"""The polynomials behind precise_power.h: log2 and 2^r for results in two doubles, fitted, rounded and proved.

    log2(1 + f) = s E(s^2),  s = f / (2 + f)       E(z) = 2 / ln 2 (1 + z/3 + z^2/5 + ...)
    2^r = (1 + r D(r))^8                           D(r) = (2^(r/8) - 1) / r

Comes in: a level of accuracy and nothing else. Goes out: `PairTables`, coefficients with the proved bounds of the
polynomials. Never done here: roundings of the C text, that is `pair_rounding.py`; C text, that is `precise_header.py`.

Which terms need a pair: term k of E is z^k / (2 k + 1) of the first one, z <= 2^-7.6, and a double's 2^-53 of it must
be below what is wanted of the sum. Three squarings take a factor 8 out of r and cost less than the terms they save.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import flint
import mpmath

from symrender_cg.functions.minimax import fit_minimax
from symrender_cg.functions.supremum import PRECISION, ball, bound_of_quotient

Pair = tuple[float, float]

DIGITS = 64
TAYLOR_TERMS = 40

LOWEST_MANTISSA = Fraction(45, 64)
HIGHEST_MANTISSA = 2 * LOWEST_MANTISSA


@dataclass(frozen=True, slots=True)
class Zone:
    """Mantissas m of [low, high]: multiplied by `factor`, of few bits, they come close to 1."""

    low: Fraction
    high: Fraction
    factor: Fraction


LOW_ZONE = Zone(LOWEST_MANTISSA, Fraction(111, 128), Fraction(5, 4))
MIDDLE_ZONE = Zone(Fraction(111, 128), Fraction(147, 128), Fraction(1))
HIGH_ZONE = Zone(Fraction(147, 128), HIGHEST_MANTISSA, Fraction(13, 16))
ZONES = (LOW_ZONE, MIDDLE_ZONE, HIGH_ZONE)

LARGEST_F = max(abs(m * zone.factor - 1) for zone in ZONES for m in (zone.low, zone.high))
LARGEST_S = max(abs((m * zone.factor - 1) / (m * zone.factor + 1)) for zone in ZONES for m in (zone.low, zone.high))
WIDENED = 1 + Fraction(1, 2**20)
"""The intervals of the polynomials are this much wider: a low part may carry an argument beyond them."""

LOG_INTERVAL = (Fraction(0), LARGEST_S**2 * WIDENED)
EXP2_INTERVAL = (-Fraction(1, 2) * WIDENED, Fraction(1, 2) * WIDENED)
SQUARINGS = 3


@dataclass(frozen=True, slots=True)
class PairLevel:
    """How many terms: `*_pairs` leading coefficients in two doubles (the 1 of P not counted), then `*_tail` in one.

    Arguments have |lo| <= `largest_low` |hi|, and are normalised where that is 2^-53. Powers below 2^`lowest_power`
    are 0.
    """

    prefix: str
    log_pairs: int
    log_tail: int
    exp2_pairs: int
    exp2_tail: int
    lowest_power: int
    largest_low: Fraction


PRECISE = PairLevel("precise_", 4, 4, 3, 6, -1000, Fraction(1, 2**40))
DOUBLE_DOUBLE = PairLevel("dd_", 7, 4, 7, 5, -900, Fraction(1, 2**53))


@dataclass(frozen=True, slots=True)
class PairTables:
    """Coefficients of one level, lowest first, and the proved relative errors of the two polynomials.

    `zone_logs` are -log2 of the factors of the zones, each a pair.
    """

    level: PairLevel
    log_pairs: tuple[Pair, ...]
    log_tail: tuple[float, ...]
    exp2_pairs: tuple[Pair, ...]
    exp2_tail: tuple[float, ...]
    zone_logs: tuple[Pair, ...]
    log_error: float
    exp2_error: float


@functools.cache
def pair_tables(level: PairLevel) -> PairTables:
    """Fit, round, and prove."""
    log_degree, exp2_degree = level.log_pairs + level.log_tail - 1, level.exp2_pairs + level.exp2_tail - 1
    log_pairs, log_tail = _fitted(_log_factor, LOG_INTERVAL, log_degree, level.log_pairs)
    exp2_pairs, exp2_tail = _fitted(_exp2_tail, EXP2_INTERVAL, exp2_degree, level.exp2_pairs)
    with mpmath.workdps(DIGITS):
        zone_logs = tuple(as_pair(-mpmath.log(_mpf(zone.factor), 2)) for zone in ZONES)
    return PairTables(
        level,
        log_pairs,
        log_tail,
        exp2_pairs,
        exp2_tail,
        zone_logs,
        bound_log_error(log_pairs, log_tail),
        bound_exp2_error(exp2_pairs, exp2_tail),
    )


def _fitted(
    function: Callable[[Any], Any], interval: tuple[Fraction, Fraction], degree: int, pairs: int
) -> tuple[tuple[Pair, ...], tuple[float, ...]]:
    """The polynomial of least error, its first coefficients rounded to pairs and the others to doubles."""
    coefficients = fit_minimax(function, lambda _: mpmath.mpf(1), _real(interval), degree, digits=DIGITS)
    with mpmath.workdps(DIGITS):
        return tuple(map(as_pair, coefficients[:pairs])), tuple(map(float, coefficients[pairs:]))


def as_pair(value: Any) -> Pair:
    """An mpmath number as the sum of two doubles, each the nearest to what is left."""
    high = float(value)
    return high, float(value - high)


def _log_factor(z: Any) -> Any:
    """2 atanh(s) / (s ln 2) at s = sqrt(z)."""
    s = mpmath.sqrt(z)
    return 2 * mpmath.atanh(s) / (s * mpmath.log(2))


def _exp2_tail(r: Any) -> Any:
    """(2^(r/8) - 1) / r."""
    return mpmath.expm1(r * mpmath.log(2) / 2**SQUARINGS) / r


def bound_log_error(pairs: tuple[Pair, ...], tail: tuple[float, ...]) -> float:
    """A proved bound of |E(z) / (2 atanh(s) / (s ln 2)) - 1|, s = sqrt(z), over the interval of z.

    The series 2 / ln 2 (1 + z/3 + z^2/5 + ...) is at least 2 / ln 2; from its 40th term on it sums to less than 10^-90.
    """
    with flint.ctx.workprec(PRECISION):
        log_2 = flint.arb(2).log()
        terms = [2 / (log_2 * (2 * k + 1)) for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-90), *terms[1:]])
        return bound_of_quotient(polynomial_of(pairs, tail) - true, lambda z: 2 / log_2 + z * 0, LOG_INTERVAL)


def bound_exp2_error(pairs: tuple[Pair, ...], tail: tuple[float, ...]) -> float:
    """A proved bound of |1 + r p(r) - 2^(r/8)| / 2^(r/8) over [-1/2, 1/2].

    2^(r/8) is its Taylor polynomial of 40 terms and a remainder below 2 (ln 2 / 16)^40 / 40! < 10^-100.
    """
    with flint.ctx.workprec(PRECISION):
        log_2 = flint.arb(2).log() / 2**SQUARINGS
        terms = [log_2**k / flint.arb(k + 1).gamma() for k in range(TAYLOR_TERMS)]
        true = flint.arb_poly([terms[0] + flint.arb(0, 1e-100), *terms[1:]])
        approximate = polynomial_of(((1.0, 0.0), *pairs), tail)
        return bound_of_quotient(approximate - true, lambda r: (r * log_2).exp(), EXP2_INTERVAL)


def polynomial_of(pairs: tuple[Pair, ...], tail: tuple[float, ...]) -> Any:
    """The polynomial with exactly these coefficients, in balls."""
    return flint.arb_poly([*(flint.arb(high) + flint.arb(low) for high, low in pairs), *map(flint.arb, tail)])


def exact_pair(pair: Pair) -> Any:
    """The sum of a pair, as a ball."""
    return ball(Fraction(pair[0]) + Fraction(pair[1]))


def _real(interval: tuple[Fraction, Fraction]) -> tuple[Any, Any]:
    with mpmath.workdps(DIGITS):
        lowest, highest = map(_mpf, interval)
        return lowest, highest


def _mpf(value: Fraction) -> Any:
    return mpmath.mpf(value.numerator) / value.denominator
