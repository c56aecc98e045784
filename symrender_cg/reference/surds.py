"""Exact numbers s + t sqrt(d) with rational s and t: what a primary ray's hit point is made of.

Comes in: whole numbers and fractions of python-flint. Goes out: Surd, with + - * / and an exact sign; the order of two
surds over different d; rational square roots. Never done here: rounding.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, TypeAlias

from flint import fmpq, fmpz

Rational: TypeAlias = Any
"""int, fmpz or fmpq"""


class Surd:
    """s + t sqrt(d), d >= 0 whole and no square unless t = 0. Two surds in one sum or product share their d."""

    __slots__ = ("d", "s", "t")

    def __init__(self, s: Rational, t: Rational = 0, d: Rational = 0) -> None:
        self.s, self.t, self.d = fmpq(s), fmpq(t), d

    @staticmethod
    def root(d: fmpz) -> Surd:
        """sqrt(d), whole where d is a square."""
        whole = fmpz(math.isqrt(int(d)))
        return Surd(whole) if whole * whole == d else Surd(0, 1, d)

    def sign(self) -> int:
        """-1, 0 or 1."""
        s, t = _sign(self.s), _sign(self.t)
        if s == t or t == 0:
            return s
        if s == 0:
            return t
        return s * _sign(self.s * self.s - self.t * self.t * self.d)

    def rational(self) -> Fraction | None:
        """The value where it is rational, else None."""
        return None if self.t != 0 else Fraction(int(self.s.p), int(self.s.q))

    def __add__(self, other: Any) -> Surd:
        if isinstance(other, Surd):
            return Surd(self.s + other.s, self.t + other.t, self.d or other.d)
        return Surd(self.s + other, self.t, self.d)

    def __mul__(self, other: Any) -> Surd:
        if isinstance(other, Surd):
            d = self.d or other.d
            return Surd(self.s * other.s + self.t * other.t * d, self.s * other.t + self.t * other.s, d)
        return Surd(self.s * other, self.t * other, self.d)

    def __neg__(self) -> Surd:
        return Surd(-self.s, -self.t, self.d)

    def __sub__(self, other: Any) -> Surd:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Surd:
        return self.__neg__().__add__(other)

    def __truediv__(self, other: Any) -> Surd:
        if isinstance(other, Surd):
            norm = other.s * other.s - other.t * other.t * other.d
            return self * Surd(other.s / norm, -other.t / norm, other.d)
        return Surd(self.s / other, self.t / other, self.d)

    __radd__ = __add__
    __rmul__ = __mul__


def order(a: Surd, b: Surd) -> int:
    """The sign of a - b = s + u, u = t1 sqrt(d1) - t2 sqrt(d2), whatever d1 and d2."""
    s = _sign(a.s - b.s)
    first, second = a.t * a.t * a.d, b.t * b.t * b.d
    t1, t2 = _sign(a.t), _sign(b.t)
    u = (t1 - t2 > 0) - (t1 - t2 < 0) if t1 != t2 else t1 * _sign(first - second)
    if s == u or u == 0:
        return s
    if s == 0:
        return u
    both = Surd(a.t * b.t) * Surd.root(fmpz(a.d) * b.d)
    between: Surd = both * 2 + ((a.s - b.s) * (a.s - b.s) - first - second)
    return s * between.sign()


def rational_root(square: Fraction) -> Fraction | None:
    """The square root of a fraction >= 0 where it is rational, else None."""
    root = Fraction(math.isqrt(square.numerator), math.isqrt(square.denominator))
    return root if root * root == square else None


def floor_over_root(value: Fraction, square: Fraction) -> int:
    """floor(value / sqrt(square)), square > 0."""
    ratio = value * value / square
    below = math.isqrt(ratio.numerator // ratio.denominator)
    if value >= 0:
        return below
    return -below if below * below == ratio else -below - 1


def _sign(value: Rational) -> int:
    return int(value > 0) - int(value < 0)
