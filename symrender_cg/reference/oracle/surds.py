"""Exact real numbers: fractions, and s + t sqrt(d) with s, t and d such numbers. Hit points of rays are made of them.

Comes in: whole numbers and fractions of python-flint. Goes out: Surd, with + - * / and an exact sign; square roots;
floors. Never done here: rounding.

A primary ray's hit point lies in Q(q), q = sqrt(disc); each mirror adds one more root, of a number of the field before
it. Roots are numbered as they are made, and the outermost root of a number is the last made, so numbers over different
roots meet in the field of both. A sign is asked of a ball first. Where the ball holds 0,
    sign(s + t r) = sign(s)                     where s and t have one sign, or t = 0
                  = sign(s) sign(s^2 - t^2 d)   else,
and the numbers under `sign` have one root less. Nothing here rests on d being no square of its field, though `sqrt_of`
sees to that where the roots of d are all that there are.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import count
from typing import Any, Final, TypeAlias

from flint import arb, ctx, fmpq, fmpz

Exact: TypeAlias = Any
"""int, fmpz, fmpq or Surd"""

_NUMBERS: Final = count()


class _Root:
    """sqrt(square) > 0, which no number of the roots before it is (as far as `sqrt_of` knows)."""

    __slots__ = ("_ball", "_bits", "below", "number", "square")

    def __init__(self, square: Exact) -> None:
        self.square, self.number = square, next(_NUMBERS)
        self.below: _Root | None = square.root if isinstance(square, Surd) else None
        self._bits, self._ball = 0, arb(0)

    def ball(self) -> arb:
        if self._bits != ctx.prec:
            square = ball(self.square)
            self._ball = square.sqrt() if square > 0 else arb(0).union(arb(square.upper()).sqrt())
            self._bits = ctx.prec
        return self._ball


class Surd:
    """s + t sqrt(d), t != 0, with s and t rational or surds over earlier roots."""

    __slots__ = ("root", "s", "t")

    def __init__(self, s: Exact, t: Exact, root: _Root) -> None:
        self.s, self.t, self.root = s, t, root

    def __add__(self, other: Exact) -> Exact:
        if not isinstance(other, Surd):
            return Surd(self.s + other, self.t, self.root)
        if self.root is other.root:
            return _surd(self.s + other.s, self.t + other.t, self.root)
        if self.root.number > other.root.number:
            return Surd(self.s + other, self.t, self.root)
        return Surd(other.s + self, other.t, other.root)

    def __mul__(self, other: Exact) -> Exact:
        if not isinstance(other, Surd):
            return _surd(self.s * other, self.t * other, self.root)
        if self.root is other.root:
            both = self.t * other.t * self.root.square
            return _surd(self.s * other.s + both, self.s * other.t + self.t * other.s, self.root)
        if self.root.number > other.root.number:
            return _surd(self.s * other, self.t * other, self.root)
        return _surd(other.s * self, other.t * self, other.root)

    def __neg__(self) -> Exact:
        return Surd(-self.s, -self.t, self.root)

    def __sub__(self, other: Exact) -> Exact:
        return self + (-other)

    def __rsub__(self, other: Exact) -> Exact:
        return -self + other

    def __truediv__(self, other: Exact) -> Exact:
        return self * _inverse(other)

    def __rtruediv__(self, other: Exact) -> Exact:
        return _inverse(self) * other

    __radd__ = __add__
    __rmul__ = __mul__

    def norm(self) -> Exact:
        """s^2 - t^2 d = (s + t sqrt(d)) (s - t sqrt(d))"""
        return self.s * self.s - self.t * self.t * self.root.square


def sign(value: Exact) -> int:
    """-1, 0 or 1, whatever the precision of the balls."""
    if not isinstance(value, Surd):
        return int(value > 0) - int(value < 0)
    near = ball(value)
    if near > 0:
        return 1
    if near < 0:
        return -1
    s, t = sign(value.s), sign(value.t)
    if s == t or t == 0:
        return s
    return t if s == 0 else s * sign(value.norm())


def ball(value: Exact) -> arb:
    """A ball that holds the number, at the precision of the context."""
    return ball(value.s) + ball(value.t) * value.root.ball() if isinstance(value, Surd) else arb(fmpq(value))


def rational(value: Exact) -> Fraction | None:
    """The value where it is rational, else None."""
    if isinstance(value, Surd):
        return None
    number = fmpq(value)
    return Fraction(int(number.p), int(number.q))


def sqrt_of(value: Exact) -> Exact:
    """The square root of a number >= 0: in the field of the number where it is there, else over one more root."""
    found = root_within(value)
    return Surd(fmpq(0), fmpq(1), _Root(value)) if found is None else found


def root_within(value: Exact, field: Exact = 0) -> Exact | None:
    """The square root of a number >= 0 where it lies in the field of `value`, or in that of `field`; else None."""
    outer = max((v.root for v in (value, field) if isinstance(v, Surd)), key=lambda r: r.number, default=None)
    found = _root_over(value, outer)
    return found if found is None or sign(found) >= 0 else -found


def _root_over(value: Exact, root: _Root | None) -> Exact | None:
    """A root of `value` in the field of `root` and those below it.

    Of s: one of the field below, or q sqrt(d) with q a root of s / d.
    Of s + t sqrt(d): p + t / (2 p) sqrt(d), where p^2 is (s + m) / 2 or (s - m) / 2 with m a root of s^2 - t^2 d.
    """
    if root is None:
        return None if isinstance(value, Surd) else _rational_root(fmpq(value))
    if not isinstance(value, Surd) or value.root is not root:
        found = _root_over(value, root.below)
        if found is not None:
            return found
        q = _root_over(fmpq(1) * value / root.square, root.below)
        return None if q is None else _surd(fmpq(0), q, root)
    norm = value.norm()
    m = _root_over(norm, root.below) if sign(norm) >= 0 else None
    if m is None:
        return None
    for square in ((value.s + m) / 2, (value.s - m) / 2):
        p = _root_over(square, root.below) if sign(square) > 0 else None
        if p is not None:
            return _surd(p, value.t / (p * 2), root)
    return None


def _rational_root(value: fmpq) -> fmpq | None:
    numerator, denominator = int(value.p), int(value.q)
    if numerator < 0:
        return None
    above, below = math.isqrt(numerator), math.isqrt(denominator)
    if above * above != numerator or below * below != denominator:
        return None
    return fmpq(fmpz(above), fmpz(below))


def floor_over_root(value: Exact, square: fmpz, near: int) -> int:
    """floor(value / sqrt(square)), square > 0, known to be near - 1 or near."""
    return near if sign(value - sqrt_of(square) * near) >= 0 else near - 1


def _surd(s: Exact, t: Exact, root: _Root) -> Exact:
    return s if not isinstance(t, Surd) and t == 0 else Surd(s, t, root)


def _inverse(value: Exact) -> Exact:
    """1 / value; where the norm is 0 but the value is not, t sqrt(d) = s, and the value is 2 s."""
    if not isinstance(value, Surd):
        return 1 / fmpq(value)
    norm = value.norm()
    if sign(norm) == 0:
        return _inverse(value.s * 2)
    inverse = _inverse(norm)
    return _surd(value.s * inverse, -value.t * inverse, value.root)
