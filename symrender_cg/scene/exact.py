"""Exact arithmetic on lengths: float64 coordinates as integers on one common grid, and rounding back, once.

Comes in: finite float64 numbers. Goes out: integers v with value = v * 2^grid, exact decisions, and the float64 nearest
to a rational or to the square root of one. Every float64 is an integer times a power of two, so on a fine enough grid
sums, products and comparisons are those of whole numbers; no fraction is ever reduced. Never done here: a rounding in
between.

The grid follows the exponents of the values, so lengths that are all multiplied by 2^k give the same integers, and
every result is multiplied by exactly 2^k as long as nothing is subnormal.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Protocol, TypeAlias

Vector: TypeAlias = tuple[float, float, float]
GridVector: TypeAlias = tuple[int, int, int]

_SIGNIFICAND_BITS = 53
_ROOT_BITS = 64
"""Bits of a square root before it is rounded to 53: enough for one rounding, the rest is one sticky bit."""


class Ball(Protocol):
    """What has a centre and a radius > 0."""

    @property
    def center(self) -> Vector: ...
    @property
    def radius(self) -> float: ...


def grid_of(values: Iterable[float]) -> int:
    """g such that each value is a multiple of 2^g: the smallest exponent minus 53, or 0 when all are zero."""
    return min((math.frexp(value)[1] - _SIGNIFICAND_BITS for value in values if value), default=0)


def on_grid(value: float, grid: int) -> int:
    """value / 2^grid, an integer when grid <= grid_of([value])."""
    if not value:
        return 0
    significand, exponent = math.frexp(value)
    return int(math.ldexp(significand, _SIGNIFICAND_BITS)) << (exponent - _SIGNIFICAND_BITS - grid)


def vector_on_grid(point: Vector, grid: int) -> GridVector:
    """A point as three integers in units of 2^grid."""
    x, y, z = point
    return on_grid(x, grid), on_grid(y, grid), on_grid(z, grid)


def difference(a: GridVector, b: GridVector) -> GridVector:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: GridVector, b: GridVector) -> int:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: GridVector, b: GridVector) -> GridVector:
    """a x b, right-handed."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def nearest_ratio(numerator: int, denominator: int, grid: int) -> float:
    """The float64 nearest to (numerator / denominator) 2^grid, ties to even, subnormal results included.

    denominator > 0. Raises OverflowError when the result is beyond float64. Python's division of two integers is
    correctly rounded, so scaling the integers first leaves one rounding.
    """
    if grid >= 0:
        return (numerator << grid) / denominator
    return numerator / (denominator << -grid)


def nearest_root(numerator: int, radicand: int, grid: int) -> float:
    """The float64 nearest to (numerator / sqrt(radicand)) 2^grid, ties to even.

    radicand > 0. Raises OverflowError when the result is beyond float64. With q = floor(numerator^2 4^s / radicand) the
    root lies in [isqrt(q), isqrt(q) + 1) 2^-s and meets its lower end only if both steps were exact; one sticky bit
    below the 64 or more of isqrt(q) keeps that, so the only rounding is the last one.
    """
    if not numerator:
        return 0.0
    square = numerator * numerator
    shift = _ROOT_BITS + 1 + (radicand.bit_length() - square.bit_length()) // 2
    if shift >= 0:
        quotient, remainder = divmod(square << 2 * shift, radicand)
    else:
        quotient, remainder = divmod(square, radicand << -2 * shift)
    root = math.isqrt(quotient)
    sticky = remainder != 0 or root * root != quotient
    signed = 2 * root + sticky
    return nearest_ratio(signed if numerator > 0 else -signed, 1, grid - shift - 1)


def side_of_plane(point: Vector, on_plane: Vector, normal: Vector) -> int:
    """Sign of normal . (point - on_plane), exact: 1 on the side of the normal, 0 on the plane, -1 behind it."""
    grid = grid_of((*point, *on_plane))
    offset = difference(vector_on_grid(point, grid), vector_on_grid(on_plane, grid))
    side = dot(offset, vector_on_grid(normal, grid_of(normal)))
    return (side > 0) - (side < 0)


def are_parallel(a: Vector, b: Vector) -> bool:
    """Whether a x b = 0, exact; a vector of length 0 is parallel to all."""
    return not any(cross(vector_on_grid(a, grid_of(a)), vector_on_grid(b, grid_of(b))))


def excess_over_sphere(eye: Vector, center: Vector, radius: float) -> int:
    """Sign of |eye - center|^2 - radius^2, exact: 1 outside the sphere, 0 on it, -1 inside."""
    grid = grid_of((*eye, *center, radius))
    offset = difference(vector_on_grid(center, grid), vector_on_grid(eye, grid))
    excess = dot(offset, offset) - on_grid(radius, grid) ** 2
    return (excess > 0) - (excess < 0)


def first_not_outside(eye: Vector, balls: Sequence[Ball]) -> int | None:
    """The first index whose sphere the eye is in or on, exact; None when the eye is outside every one.

    The float64 value of |eye - center|^2 is within 6 units of 2^-53 of the true one between 1e-280 and 1e300, that of
    radius^2 within one; where the first is larger by 1e-12 of itself the sign is proved, elsewhere it is decided in
    whole numbers.
    """
    e_x, e_y, e_z = eye
    for index, ball in enumerate(balls):
        x, y, z = ball.center
        x, y, z = x - e_x, y - e_y, z - e_z
        square, radius = x * x + y * y + z * z, ball.radius
        if 1e-280 < square < 1e300 and radius * radius < square * (1.0 - 1e-12):
            continue
        if excess_over_sphere(eye, ball.center, radius) <= 0:
            return index
    return None
