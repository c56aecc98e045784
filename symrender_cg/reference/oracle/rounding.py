"""From a ball to correctly rounded numbers: float64, float32, 8 bit, all of them, or a ball as narrow as was asked.

Comes in: a value as ground + added, an exact number and a ball, or as a fraction. Goes out: a tuple of Python numbers;
None where the ball leaves a digit open. Never done here: a guess; the caller comes back with a narrower ball.

ground and added are kept apart because ground is most often exact: value - v = (ground - v) + added then has all digits
of a tiny `added`, where their sum would have lost them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, Generic, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt
from flint import arb

from symrender_cg.reference.points import FloatArray

T = TypeVar("T")
Full: TypeAlias = tuple[float, float, int, int]
"""value, residual, the sign of truth - value (where it matters, see `full_of_ball`), 8-bit level"""
Interval: TypeAlias = tuple[Fraction, Fraction]
"""middle, radius"""


@dataclass(frozen=True, slots=True)
class Rounding(Generic[T]):
    """One way to round: what a ball gives, or None where it does not decide; what an exact value gives.

    parts: how many numbers that is; a tuple of them unless it is one.
    """

    parts: int
    of_ball: Callable[[arb, arb], T | None]
    of_fraction: Callable[[Fraction], T]


# ------------------------------------------------------------------------------------------------------- everything


def full_of_ball(ground: arb, added: arb) -> Full | None:
    """float64 nearest to ground + added, float64 nearest to what is left, its sign, and the 8-bit level.

    The sign is 0 where nothing depends on it: it is decided only where `value` is in the middle of two float32.
    """
    total = ground + added
    value = float(total)
    if not -math.inf < value < math.inf:
        return None
    rest = (ground - value) + added
    low_ball, high_ball = rest.lower(), rest.upper()
    low, high = float(low_ball), float(high_ball)
    if low != high:
        return None
    if low_ball > 0:
        side = 1
    elif high_ball < 0:
        side = -1
    elif rest.is_zero() or not is_float32_tie(value):
        side = 0
    else:
        return None
    if abs(low) >= 0.24 * math.ulp(value) and not (float(total.lower()) == float(total.upper()) == value):
        return None
    level = _level(value, ground, added)
    return None if level is None else (value, low + 0.0, side, level)


def full_of_fraction(value: Fraction) -> Full:
    nearest = value.numerator / value.denominator
    rest = value - Fraction(nearest)
    return nearest, rest.numerator / rest.denominator, (rest > 0) - (rest < 0), level_of_fraction(value)


FULL: Final = Rounding(4, full_of_ball, full_of_fraction)

# -------------------------------------------------------------------------------------------------- one target each


def float64_of_ball(ground: arb, added: arb) -> float | None:
    """float64 nearest to ground + added; ties to even."""
    total = ground + added
    low = float(total.lower())
    return low if low == float(total.upper()) and math.isfinite(low) else None


def float32_of_ball(ground: arb, added: arb) -> tuple[float, int] | None:
    """A float64 near ground + added, and the sign of what is left of it: `to_float32` rounds the two once.

    The middles of float32 are float64 numbers of 25 bits: within 3/4 ulp of a float64 lies no other of them.
    """
    value = float(ground + added)
    if not -math.inf < value < math.inf:
        return None
    rest = (ground - value) + added
    if not abs(rest) <= 0.75 * math.ulp(value):
        return None
    if not is_float32_tie(value) or rest.is_zero():
        return value, 0
    return (value, 1) if rest > 0 else (value, -1) if rest < 0 else None


def float32_of_fraction(value: Fraction) -> tuple[float, int]:
    nearest, _, side, _ = full_of_fraction(value)
    return nearest, side


def level_of_ball(ground: arb, added: arb) -> int | None:
    """floor(255 clip(ground + added, 0, 1) + 1/2)"""
    total = ground + added
    if total >= 1:
        return 255
    if total <= 0:
        return 0
    return _level(float(total), ground, added) if total.rad() < 1e-12 else None


def level_of_fraction(value: Fraction) -> int:
    return math.floor(255 * min(max(value, Fraction(0)), Fraction(1)) + Fraction(1, 2))


def _level(value: float, ground: arb, added: arb) -> int | None:
    """The level of a number that is within 1e-12 of `value`: from `value` unless an edge between two levels is near."""
    scaled = 255.0 * min(max(value, 0.0), 1.0) + 0.5
    edge = round(scaled)
    if abs(scaled - edge) > 1e-9:
        return int(scaled)
    above = (ground * 510 - (2 * edge - 1)) + added * 510
    return edge if above >= 0 else edge - 1 if above < 0 else None


FLOAT64: Final = Rounding(1, float64_of_ball, lambda value: value.numerator / value.denominator)
FLOAT32: Final = Rounding(2, float32_of_ball, float32_of_fraction)
UINT8: Final = Rounding(1, level_of_ball, level_of_fraction)


def to_float32(value: FloatArray, sides: npt.NDArray[np.int8]) -> npt.NDArray[np.float32]:
    """float32 nearest to the true values: a float64 in the middle of two float32 gives way to the side of the truth.

    Beside the largest float32 stands infinity, in the place of 2^128.
    """
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        nearest = value.astype(np.float32)
        away = value - _as_number(nearest)
        other = np.nextafter(nearest, np.where(away > 0, np.float32(np.inf), np.float32(-np.inf)))
        tie = (away != 0.0) & (_as_number(other) - value == away)
    return np.where(tie & (sides == np.sign(away)), other, nearest)


def _as_number(single: npt.NDArray[np.float32]) -> FloatArray:
    wide = np.asarray(single, dtype=np.float64)
    return np.where(np.isinf(wide), np.copysign(2.0**128, wide), wide)


def is_float32_tie(value: float) -> bool:
    """Whether `value` is an odd multiple of half a float32's last place, so that only what is left of it decides."""
    fraction, exponent = math.frexp(value)
    return abs(math.ldexp(fraction, 25 if exponent >= -125 else exponent + 150)) % 2.0 == 1.0


# ------------------------------------------------------------------------------------------------------ balls asked


def interval(bits: int) -> Rounding[Interval]:
    """A ball whose radius is at most 2^-bits of its middle, as fractions; radius 0 for a value known exactly."""
    scale = arb(2) ** -bits

    def of_ball(ground: arb, added: arb) -> Interval | None:
        total = ground + added
        if not total.is_finite() or not total.rad() <= abs(total.mid()) * scale:
            return None
        return fraction_of(total.mid()), fraction_of(total.rad())

    return Rounding(2, of_ball, lambda value: (value, Fraction(0)))


def fraction_of(number: arb) -> Fraction:
    """An exact ball as a fraction."""
    mantissa, exponent = number.man_exp()
    whole, twos = Fraction(int(mantissa)), int(exponent)
    return whole * (1 << twos) if twos >= 0 else whole / (1 << -twos)
