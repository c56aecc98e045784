"""Families of one sphere whose light, highlight or exponent is what is hard.

Comes in: dice. Goes out: the numbers of a scene and a point, or None where the dice hold no such case. Never done here:
an evaluation.
"""

from __future__ import annotations

import math
from dataclasses import replace

from symrender_cg.stress.cases import Dice, Drawn, Inputs
from symrender_cg.stress.searches import (
    Signs,
    edge_in_row,
    exact_signs,
    inside_point,
    outline_radius,
    surface_at,
)
from symrender_cg.stress.sphere_families import ordinary

SMALL_SHININESS = (1e-3, 0.01, 0.1, 0.25, 0.5, 0.9, 1.0, 1.5)
EXACT_POINTS = ((3.0, 0.0, 4.0, 5.0), (0.0, -3.0, 4.0, 5.0), (-4.0, 0.0, 3.0, 5.0), (2.0, 1.0, 2.0, 3.0))
"""Points (x, y, z) of a sphere of radius r that are whole numbers."""
EYES = {5.0: (8.0, 16.0, 10.0, 20.0), 3.0: (8.0, 10.0, 18.0)}
"""Radius -> eyes from which the light at those points is seen through a point that is a float."""


def light_near(dice: Dice) -> Drawn | None:
    """A light 2^-4 to 2^-52 R above the point that is seen: w = L - P cancels."""
    numbers = ordinary(dice)
    x, y = inside_point(numbers, dice)
    surface = surface_at(numbers, x, y)
    if surface is None:
        return None
    way = dice.direction()
    if sum(float(n) * d for n, d in zip(surface.normal, way, strict=True)) < 0.0:
        way = (-way[0], -way[1], -way[2])
    k = dice.whole(4, 52)
    light = surface.along(way, numbers.radius * 2.0**-k)
    return replace(numbers, light=light), x, y, f"the light 2^-{k} R from the point"


def light_inside(dice: Dice) -> Drawn:
    """A light in the sphere: n.l < 0 everywhere, and r.v > 0 in places."""
    numbers = ordinary(dice)
    away = numbers.radius * dice.one((dice.real(0.0, 0.99), dice.ten_to(-3.0, 0.0), 1.0 - dice.ten_to(-15.0, -1.0)))
    x, y, z = dice.direction()
    light = (away * x, away * y, away * z)
    return replace(numbers, light=light), *inside_point(numbers, dice), "the light in the sphere"


def light_at_hit(dice: Dice) -> Drawn | None:
    """A light exactly at the point that is seen, where it adds nothing, or one float beside it."""
    unit = 2.0 ** dice.whole(-4, 4)
    if dice.often(0.5):
        radius = dice.one((0.75, 1.25, 3.5, 6.0, dice.real(0.5, 2.0)))
        numbers = replace(ordinary(dice), radius=radius, eye=radius * dice.one((1.5, 2.0, 4.0)))
        point, x, y = (0.0, 0.0, radius), 0.0, 0.0
    else:
        a, b, c, r = dice.one(EXACT_POINTS)
        eye = dice.one(EYES[r])
        if a * a + b * b >= c * (eye - c):
            return None
        numbers = replace(ordinary(dice), radius=r * unit, eye=eye * unit)
        point, x, y = (a * unit, b * unit, c * unit), a * eye / (eye - c) * unit, b * eye / (eye - c) * unit
    light = list(point)
    if dice.often(0.6):
        k = dice.whole(0, 2)
        light[k] = math.nextafter(light[k], dice.one((-9.0, 9.0)) * numbers.radius)
        if light[k] != 0.0 and abs(light[k]) < 2.0**-900:
            light[k] = math.copysign(2.0 ** -dice.whole(52, 400), light[k])
    return replace(numbers, light=(light[0], light[1], light[2])), x, y, "the light at the point, or a float beside it"


def light_behind(dice: Dice) -> Drawn:
    """A light behind the sphere: no diffuse light, and a highlight of the ungated formula."""
    numbers = ordinary(dice)
    x, y, z = numbers.light
    light = (x, y, -abs(z) - numbers.radius * dice.real(0.0, 2.0))
    return replace(numbers, light=light), *inside_point(numbers, dice), "the light behind the sphere"


def light_far(dice: Dice) -> Drawn:
    """|L| from 1e14 to 1e300: its square overflows, and the light's direction must not."""
    numbers = ordinary(dice)
    away = dice.ten_to(14.0, 299.5) if dice.often(0.7) else dice.one((1e150, 1e154, 1e160, 1e300))
    x, y, z = dice.direction()
    light = (away * x, away * y, away * (abs(z) if dice.often(0.8) else z))
    return replace(numbers, light=light), *inside_point(numbers, dice), f"the light {away:.0e} away"


def _row_edge(dice: Dice, numbers: Inputs, kind: str) -> tuple[float, float] | None:
    """A point beside a change of sign of n.l, or of r.v, among the hits of a row."""
    rho, signs = outline_radius(numbers), exact_signs(numbers)
    y = rho * dice.real(-0.95, 0.95)
    half = math.sqrt(rho * rho - y * y) * (1.0 - 2.0**-40)

    def side(x: float, y: float) -> bool:
        found: Signs = signs(x, y)
        return (found.n_dot_l if kind == "n.l" else found.r_dot_v) > 0

    x = edge_in_row(side, -half, half, y, dice)
    return None if x is None else (x, y)


def terminator(dice: Dice) -> Drawn | None:
    """n.l about 0, mostly neighbouring floats on both sides of it: a small difference, and all that there is."""
    numbers = ordinary(dice)
    point = _row_edge(dice, numbers, "n.l")
    if point is None:
        return None
    numbers = replace(numbers, specular=dice.one((0.0, 0.5)))
    return numbers, *point, "n.l about 0"


def gated_terminator(dice: Dice) -> Drawn | None:
    """n.l about 0 with a gated highlight: the image jumps there by the highlight's height."""
    numbers = ordinary(dice)
    point = _row_edge(dice, numbers, "n.l")
    if point is None:
        return None
    return replace(numbers, gate_specular=True, shininess=dice.one((0.5, 1.0, 2.0, 8.0))), *point, "a gate at n.l = 0"


def opposite(dice: Dice) -> Drawn | None:
    """r.v about 0 and a small exponent: whether it is positive decides between 0 and nearly 1."""
    numbers = replace(ordinary(dice), shininess=dice.one(SMALL_SHININESS), diffuse=dice.one((0.0, 0.7)))
    point = _row_edge(dice, numbers, "r.v")
    return None if point is None else (numbers, *point, "r.v about 0")


def highlight(dice: Dice) -> Drawn | None:
    """The highlight's peak and flank, n from 1e-3 to 1e12: an error of r.v is multiplied by n."""
    numbers = ordinary(dice)
    x, y = inside_point(numbers, dice, 0.98)
    surface = surface_at(numbers, x, y)
    if surface is None:
        return None
    light = surface.along(surface.mirrored_view(), numbers.radius * dice.ten_to(-1.0, 1.3))
    n = dice.ten_to(-3.0, 12.0)
    if dice.often(0.7):
        turn, away = dice.real(0.0, 2.0 * math.pi), dice.ten_to(-3.0, 0.3) / math.sqrt(max(n, 1.0))
        x += numbers.radius * away * math.cos(turn)
        y += numbers.radius * away * math.sin(turn)
    return replace(numbers, light=light, shininess=n), x, y, f"the highlight, n = {n:.1e}"


def highlight_exact(dice: Dice) -> Drawn:
    """The light before the eye or behind it, on the axis: r.v is 1 in the middle, exactly or almost."""
    numbers = ordinary(dice)
    numbers = replace(
        numbers, light=(0.0, 0.0, numbers.radius * dice.real(1.1, 20.0)), shininess=dice.ten_to(-3.0, 12.0)
    )
    x = dice.one((0.0, 5e-324, 1e-300, 1e-200, numbers.radius * dice.ten_to(-17.0, -5.0)))
    y = dice.one((0.0, 0.0, x, numbers.radius * dice.ten_to(-17.0, -5.0)))
    return numbers, x, y, "r.v = 1, exactly or almost"


def no_shininess(dice: Dice) -> Drawn:
    """n = 0, -0 or 5e-324: max(0, r.v)^0 is 1 also where r.v <= 0."""
    numbers = replace(ordinary(dice), shininess=dice.one((0.0, -0.0, 5e-324, 1e-300)))
    return numbers, *inside_point(numbers, dice), "n = 0, or next to it"


def power_underflow(dice: Dice) -> Drawn | None:
    """(r.v)^n from 1e-300 to 1e-324: the power, its logarithm or its chain of squares underflows."""
    numbers = ordinary(dice)
    x, y = inside_point(numbers, dice)
    surface = surface_at(numbers, x, y)
    if surface is None:
        return None
    to_light = [light - float(p) for light, p in zip(numbers.light, surface.point, strict=True)]
    length = math.hypot(*to_light)
    cosine = sum(m * float(v) for m, v in zip(to_light, surface.mirrored_view(), strict=True)) / length
    if not 0.01 < cosine < 0.9999:
        return None
    n = dice.real(300.0, 324.0) * math.log(10.0) / -math.log(cosine)
    specular = dice.one((1.0, 0.5, 1e-5))
    return replace(numbers, ambient=0.0, diffuse=0.0, specular=specular, shininess=n), x, y, "a power that underflows"


def huge_shininess(dice: Dice) -> Drawn | None:
    """n from 1e15 to 1e300: a highlight narrower than the spacing of floats, or exactly in its middle."""
    n = dice.one((1e15, 1e20, 1e100, 1e300, dice.ten_to(15.0, 300.0)))
    if dice.often(0.4):
        numbers = replace(ordinary(dice), shininess=n)
        numbers = replace(numbers, light=(0.0, 0.0, numbers.radius * dice.real(1.1, 12.0)))
        x = dice.one(
            (0.0, 0.0, numbers.radius / math.sqrt(n) * dice.real(0.1, 2.0), numbers.radius * dice.real(0.0, 0.9))
        )
        return numbers, x, 0.0, f"n = {n:.0e}"
    drawn = highlight(dice)
    if drawn is None or not isinstance(drawn[0], Inputs):
        return None
    return replace(drawn[0], shininess=n), drawn[1], drawn[2], f"n = {n:.0e}"
