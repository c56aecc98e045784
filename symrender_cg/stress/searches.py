"""Points found exactly: neighbouring floats between which a sign changes, and points of a sphere to 256 bits.

Comes in: the numbers of a centred sphere, or a function that tells two sides of an edge apart. Goes out: float64
coordinates on the image plane z = 0, or a light's place, each rounded once. Never done here: a random choice but where
the dice are given.

Signs of n.l and r.v come from whole numbers and one square root, q = sqrt(disc), as in the oracle:
    n.l ~ u - g q,    r.v ~ (2 u + A R^2) q + g (A R^2 - 2 disc)
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, TypeAlias

from flint import arb, ctx

from symrender_cg.reference.camera_numbers import whole_numbers
from symrender_cg.scene import Vector
from symrender_cg.stress.cases import Dice, Inputs

BITS: Final = 256
SAMPLES: Final = 17
"""An edge is looked for between so many points of a row."""

Side: TypeAlias = Callable[[float, float], Hashable]
"""(x, y) -> what is on this side of an edge."""
Balls: TypeAlias = tuple[arb, arb, arb]


def outline_radius(numbers: Inputs) -> float:
    """rho = e R / sqrt(e^2 - R^2), the radius of a centred sphere's outline on the image plane, to about 1e-15."""
    e, r = numbers.eye, numbers.radius
    return r / (math.sqrt((e - r) / e) * math.sqrt((e + r) / e))


def inside_point(numbers: Inputs, dice: Dice, largest: float = 1.0) -> tuple[float, float]:
    """A point inside the outline, uniform over the disc of `largest` times its radius."""
    radius = outline_radius(numbers) * min(largest, 1.0 - 2.0**-40) * math.sqrt(dice.real(0.0, 1.0))
    turn = dice.real(0.0, 2.0 * math.pi)
    return radius * math.cos(turn), radius * math.sin(turn)


def outline_x(numbers: Inputs, y: float) -> float | None:
    """The float nearest to x >= 0 with x^2 + y^2 = e^2 R^2 / (e^2 - R^2), None where there is none."""
    e, r, row = Fraction(numbers.eye), Fraction(numbers.radius), Fraction(y)
    square = e * e * r * r / (e * e - r * r) - row * row
    return None if square < 0 else _root(square)


def disc(numbers: Inputs, x: float, y: float) -> Fraction:
    """e^2 R^2 - (e^2 - R^2) (x^2 + y^2), exactly."""
    e, r, u, v = (Fraction(number) for number in (numbers.eye, numbers.radius, x, y))
    return e * e * r * r - (e * e - r * r) * (u * u + v * v)


def _root(square: Fraction) -> float:
    """The float nearest to the square root, but for ties: 2 units of 2^-200 of it are not looked at."""
    if square == 0:
        return 0.0
    size = (square.numerator.bit_length() - square.denominator.bit_length()) // 2
    shift = 2 * (200 - size)
    scaled = square.numerator << shift if shift >= 0 else square.numerator
    divisor = square.denominator if shift >= 0 else square.denominator << -shift
    return float(Fraction(math.isqrt(scaled // divisor)) * Fraction(2) ** (-shift // 2))


# ----------------------------------------------------------------------------------------------------- exact signs


@dataclass(frozen=True, slots=True)
class Signs:
    """What an eye ray meets: hit or miss, the signs of n.l and r.v (0 for a miss)."""

    hit: bool
    n_dot_l: int = 0
    r_dot_v: int = 0


def exact_signs(numbers: Inputs) -> Callable[[float, float], Signs]:
    """A function (x, y) -> Signs for a centred sphere, in whole numbers."""
    e, r, lx, ly, lz = whole_numbers((numbers.eye, numbers.radius, *numbers.light))
    kappa, excess, r2 = r * r - lz * e, e * e - r * r, r * r

    def signs(x: float, y: float) -> Signs:
        dx, dy, dz = whole_numbers((x, y, -numbers.eye))
        a_dd, a = dx * dx + dy * dy + dz * dz, -e * dz
        square = a * a - a_dd * excess
        if square < 0:
            return Signs(False)
        g = lx * dx + ly * dy + lz * dz
        u = a * g - a_dd * kappa
        area = a_dd * r2
        return Signs(True, _sign(u, -g, square), _sign(g * (area - 2 * square), 2 * u + area, square))

    return signs


def _sign(s: int, t: int, square: int) -> int:
    """The sign of s + t sqrt(square)."""
    if t * t * square == s * s:
        return 0 if (s > 0) != (t > 0) or s == 0 else (s > 0) - (s < 0)
    larger = t if t * t * square > s * s else s
    return (larger > 0) - (larger < 0)


# ------------------------------------------------------------------------------------------------ edges between floats


def edge_in_row(side: Side, low: float, high: float, y: float, dice: Dice, *, deep: float = 0.6) -> float | None:
    """An x of [low, high] beside a place where side(x, y) changes; None where none of SAMPLES points differ.

    With probability `deep` one of two neighbouring floats that lie on different sides, or up to 3 floats beside them;
    else a point after fewer halvings, so that its distance from the edge is of any size.
    """
    points = [low + (high - low) * k / (SAMPLES - 1) for k in range(SAMPLES)]
    sides = [side(x, y) for x in points]
    changes = [k for k in range(SAMPLES - 1) if sides[k] != sides[k + 1]]
    if not changes:
        return None
    k = dice.one(changes)
    near, far = neighbours(side, points[k], points[k + 1], y, 64 if dice.often(deep) else dice.whole(2, 48))
    return dice.stepped(dice.one((near, far)), dice.one((0, 0, 3)))


def neighbours(side: Side, near: float, far: float, y: float, halvings: int = 64) -> tuple[float, float]:
    """(near, far) moved together over the floats between them, still on different sides: neighbours after 64 times."""
    of_near, a, b = side(near, y), _ordinal(near), _ordinal(far)
    for _ in range(halvings):
        middle = (a + b) // 2
        if middle in (a, b):
            break
        if side(_float_at(middle), y) == of_near:
            a = middle
        else:
            b = middle
    return _float_at(a), _float_at(b)


def _ordinal(value: float) -> int:
    """The floats counted in order: neighbours have neighbouring numbers."""
    (bits,) = struct.unpack("<q", struct.pack("<d", value))
    return int(bits if bits >= 0 else -(bits & 0x7FFFFFFFFFFFFFFF))


def _float_at(ordinal: int) -> float:
    (value,) = struct.unpack("<d", struct.pack("<q", abs(ordinal)))
    return float(value if ordinal >= 0 else -value)


# --------------------------------------------------------------------------------------------------- 256-bit geometry


@dataclass(frozen=True, slots=True)
class Surface:
    """The point of a centred sphere that is seen at (x, y), as balls: the point and unit vectors n, v."""

    point: Balls
    normal: Balls
    view: Balls

    def mirrored_view(self) -> Balls:
        """2 (n.v) n - v: where light must come from to be mirrored into the eye."""
        with ctx.workprec(BITS):
            twice = 2 * _dot(self.normal, self.view)
            x, y, z = (twice * n - v for n, v in zip(self.normal, self.view, strict=True))
            return x, y, z

    def along(self, way: Balls | Vector, length: float) -> Vector:
        """point + length way, rounded."""
        with ctx.workprec(BITS):
            px, py, pz = self.point
            return float(px + length * way[0]), float(py + length * way[1]), float(pz + length * way[2])


def surface_at(numbers: Inputs, x: float, y: float) -> Surface | None:
    """What is seen at (x, y) of a centred sphere; None for a miss."""
    square = disc(numbers, x, y)
    if square < 0:
        return None
    with ctx.workprec(BITS):
        e, u, v = arb(numbers.eye), arb(x), arb(y)
        a_dd = u * u + v * v + e * e
        q = (arb(square.numerator) / arb(square.denominator)).sqrt()
        t = (e * e - numbers.radius * arb(numbers.radius)) / (e * e + q)
        px, py, pz = t * u, t * v, e * (1 - t)
        length, r = a_dd.sqrt(), arb(numbers.radius)
        return Surface((px, py, pz), (px / r, py / r, pz / r), (-u / length, -v / length, e / length))


def _dot(a: Balls, b: Balls) -> arb:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
