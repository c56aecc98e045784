"""The light along a ray as a fraction, where it is one: then a tie is a tie.

Comes in: a Look, whose signs are decided, and one of its channels. Goes out: its value as a fraction, or None. The
terms are exact numbers of the hit point's field Q(sqrt(disc), ...) and over the distances of a few lights, so that
irrational ones may add up to a fraction. Never done here: powers with other than small exponents, unless of fractions.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Final

from flint import arb, fmpq

from symrender_cg.reference.oracle.light import Lit, Look, towards_eye
from symrender_cg.reference.oracle.rays import Site
from symrender_cg.reference.oracle.rounding import fraction_of
from symrender_cg.reference.oracle.signs import Undecided
from symrender_cg.reference.oracle.sites import normal_to_lamp, to_lamp
from symrender_cg.reference.oracle.surds import Exact, Surd, rational, root_within, sign, sqrt_of
from symrender_cg.reference.oracle.whole import Lamp, Number, World, direction_of, dot, square_of
from symrender_cg.scene import Gradient

LARGEST_POWER: Final = 4096
LARGEST_IRRATIONAL_POWER: Final = 128
MOST_LIGHTS: Final = 3
"""Of so many lights each may add the root of its own distance to the field."""


def rational_value(world: World, look: Look, channel: int) -> Fraction | None:
    """The value of a channel where each of its terms is rational, else None."""
    try:
        value = _value(world, look, channel)
    except Undecided:
        return None
    return None if value is None else rational(value)


def _value(world: World, look: Look, channel: int) -> Exact | None:
    if look.site is None or look.paint is None:
        return _background(world, look, channel)
    value: Exact = number_of(look.paint.ambient[channel])
    if look.lit:
        assert look.site.exactly is not None, "a look is in balls"
        exact = look.site.exactly()
        for light in look.lit:
            added = _light(world, exact, look, light, channel)
            if added is None:
                return None
            value = added + value
    if look.beyond is not None:
        shown = _value(world, look.beyond, channel)
        if shown is None:
            return None
        value += shown * number_of(look.paint.reflect)
    return value


def _background(world: World, look: Look, channel: int) -> Exact | None:
    """The constant, or bottom + (top - bottom) (1 + cosine) / 2."""
    background = world.frame.background
    if not isinstance(background, Gradient):
        return number_of(world.channels_of(background)[channel])
    low, high = (number_of(world.channels_of(c)[channel]) for c in (background.bottom, background.top))
    if low == high:
        return low
    ray = look.ray if look.ray.exactly is None else look.ray.exactly()
    up = direction_of(background.up)
    cosine = _ratio(dot(up, ray.direction), None, square_of(ray.direction), dot(up, up), fmpq(1))
    return None if cosine is None else (cosine + 1) * ((high - low) / 2) + low


def _light(world: World, exact: Site, look: Look, light: Lit, channel: int) -> Exact | None:
    """What one light adds: intensity share (diffuse n.l + specular (r.v)^n)"""
    paint, lamp = look.paint, light.lamp
    assert paint is not None, "lights shine on surfaces"
    intensity, diffuse, specular = (number_of(c[channel]) for c in (lamp.intensity, paint.diffuse, paint.specular))
    if not intensity:
        return fmpq(0)
    d2 = square_of(exact.ray.direction)
    w2 = square_of(to_lamp(exact, lamp))
    length = sqrt_of(w2) if len(look.lit) <= MOST_LIGHTS else root_within(w2)
    value: Exact = fmpq(0)
    if light.facing and diffuse:
        n_dot_l = _ratio(normal_to_lamp(exact, lamp), length, w2, exact.n2, fmpq(1))
        if n_dot_l is None:
            return None
        value = n_dot_l * diffuse
    if light.shining and specular:
        power: Exact | None = fmpq(1)
        if not paint.shininess.is_zero():
            power = _power(_ratio(towards_eye(exact, lamp), length, w2, d2, exact.n2), paint.material.shininess)
        if power is None:
            return None
        value = power * specular + value
    share = _share(world, lamp, w2, length)
    return None if share is None else value * share * intensity


def _share(world: World, lamp: Lamp, w2: Number, length: Exact | None) -> Exact | None:
    """1 / (a + b l + c l^2)"""
    if lamp.fading is None:
        return fmpq(1)
    a, b, c = map(number_of, lamp.fading)
    unit = fmpq(world.unit.numerator, world.unit.denominator)
    squared = fmpq(1) * w2 * (c * unit * unit) + a
    if not b:
        return 1 / squared
    return None if length is None else 1 / (length * (b * unit) + squared)


def _ratio(numerator: Number, length: Exact | None, w2: Number, square: Number, factor: Number) -> Exact | None:
    """numerator / (sqrt(w2 square) factor): in the field of the numbers where it is there, else with sqrt(w2) = length.

    It may be in the field without its parts being there: a highlight seen in its middle has r.v = 1.
    """
    root = root_within(numerator * numerator * fmpq(1) / (w2 * square), numerator)
    if root is not None:
        return root * sign(numerator) / factor
    return None if length is None else fmpq(1) * numerator / (length * sqrt_of(square) * factor)


def _power(base: Exact | None, exponent: float) -> Exact | None:
    """base^exponent where it is in the same field and small enough to write down."""
    if base is None or (not isinstance(base, Surd) and base == 1):
        return base
    numerator, denominator = exponent.as_integer_ratio()
    if numerator > (LARGEST_IRRATIONAL_POWER if isinstance(base, Surd) else LARGEST_POWER):
        return None
    for _ in range(denominator.bit_length() - 1):
        base = root_within(base)
        if base is None:
            return None
    power: Exact = fmpq(1)
    for digit in f"{numerator:b}":
        power = power * power * base if digit == "1" else power * power
    return power


def number_of(ball: arb) -> fmpq:
    """A ball of radius 0 as a fraction."""
    number = fraction_of(ball)
    return fmpq(number.numerator, number.denominator)
