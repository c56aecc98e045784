"""The stable form's constants of a frame: scales, the sphere and the light in them, where float64 decides a sign.

Comes in: the camera-frame numbers of one sphere and one light. Goes out: a View, worked out in fractions, each number
rounded once. Never done here: an array, a ray.

Lengths are scaled by powers of two: D so that e is in [1, 2), the sphere so that R is (short of |m|/R = 2^900), the
light by its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from symrender_cg.reference.camera_numbers import FrameNumbers
from symrender_cg.reference.decisions import exact_hit_test, exact_lit_test

UNIT_ROUNDOFF: Final = 2.0**-53


@dataclass(frozen=True, slots=True)
class View:
    """What does not change within a frame, scaled by powers of two, each number rounded once."""

    ray_shift: int
    """x, y and e are taken times 2^ray_shift"""
    eye: float
    m: tuple[float, float, float]
    m_z_rest: float
    """m_z = m[2] + m_z_rest, exact"""
    r: float
    r2: tuple[float, float]
    """R^2 = r2[0] + r2[1] to 2^-106"""
    toward: tuple[float, float, float, float] | None
    """x_0 + its rest, y_0 + its rest: the ray to the centre meets the plane there; None for a centre beside the eye"""
    doubt: float
    """a float64 disc above doubt * A in size has the right sign"""
    deep_doubt: float
    light: tuple[float, float, float]
    r_light: float
    """R in the light's scale"""
    on_axis: bool
    """the centre lies on the view axis, so m.D > 0 for every D"""
    normal_doubt: float
    """N of float64 is good to normal_doubt u"""
    numbers: FrameNumbers
    hit: Callable[[float, float], bool]
    lit: Callable[[float, float, float], bool]


def view_of(numbers: FrameNumbers) -> View:
    """The frame's constants, from exact fractions.

    With kappa = 16 (1 + tan) for a centre at the angle atan(tan) from the view axis, c is computed with an error
    |dc| <= u kappa (|c| + u |m||D|) and disc with at most 2 u (40 + 8 kappa) (R + u kappa |m|)^2 A where |c| <= 2 R |D|
    (beyond, its sign is not in doubt). Where tan exceeds |m|/R, c is better as the plain cross product (`toward` None):
    |dc| <= 5 u |m||D|, and 64 u |m| max(R, 64 u |m|) A bounds the error of disc. The double-double disc is good to
    1024 u^2 |m| max(R, 1024 u^2 |m|) A.
    """
    u = UNIT_ROUNDOFF
    eye = Fraction(numbers.eye)
    center = [Fraction(v) for v in numbers.center]
    m = [center[0], center[1], center[2] - eye]
    radius = Fraction(numbers.radius)
    ray_shift = 1 - math.frexp(numbers.eye)[1]
    ratio = max(_exponent(max(map(abs, m))) - _exponent(radius), 0)
    shrunk = max(ratio - 900, 0)
    scale = _power_of_two(-_exponent(radius) - shrunk)
    scaled = [v * scale for v in m]
    r = radius * scale
    m_z = float(scaled[2])
    length = float(sum(abs(v) for v in scaled))
    beside = abs(m[2]) * round(min(max(8.0, length / float(r)), 2.0**30)) < abs(m[0]) + abs(m[1])
    toward = None
    if not beside:
        x_0, y_0 = (-eye * _power_of_two(ray_shift) * v / m[2] for v in m[:2])
        toward = (*_pair(x_0), *_pair(y_0))
        kappa = 16.0 * (1.0 + float((abs(m[0]) + abs(m[1])) / abs(m[2])))
        reach = float(r) + u * kappa * length
        doubt = 2.0 * u * (40.0 + 8.0 * kappa) * reach * reach
    else:
        doubt = 64.0 * u * length * max(float(r), 64.0 * u * length)
        kappa = 16.0 * (1.0 + length / float(r))
    light = [Fraction(v) - c for v, c in zip(numbers.light, center, strict=True)]
    light_scale = _power_of_two(-_exponent(max(radius, *map(abs, light))))
    return View(
        ray_shift=ray_shift,
        eye=float(eye * _power_of_two(ray_shift)),
        m=(float(scaled[0]), float(scaled[1]), m_z),
        m_z_rest=float(scaled[2] - Fraction(m_z)),
        r=float(r),
        r2=_pair(r * r),
        toward=toward,
        doubt=doubt,
        deep_doubt=1024.0 * u * u * length * max(float(r), 1024.0 * u * u * length),
        light=(float(light[0] * light_scale), float(light[1] * light_scale), float(light[2] * light_scale)),
        r_light=float(radius * light_scale),
        on_axis=numbers.center[0] == 0.0 and numbers.center[1] == 0.0 and m[2] < 0,
        numbers=numbers,
        normal_doubt=128.0 * kappa,
        hit=exact_hit_test(numbers),
        lit=exact_lit_test(numbers),
    )


def _exponent(value: Fraction) -> int:
    """k with value / 2^k in (1/2, 2)."""
    return value.numerator.bit_length() - value.denominator.bit_length()


def _power_of_two(exponent: int) -> Fraction:
    return Fraction(1 << exponent) if exponent >= 0 else Fraction(1, 1 << -exponent)


def _pair(value: Fraction) -> tuple[float, float]:
    """value as hi + lo."""
    high = float(value)
    return high, float(value - Fraction(high))
