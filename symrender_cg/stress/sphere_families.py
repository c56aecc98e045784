"""Families of one sphere whose eye, outline, size or coefficients are what is hard; some are numbers without an image.

Comes in: dice. Goes out: the numbers of a scene and a point, or None where the dice hold no such case. Never done here:
an evaluation.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from symrender_cg.reference.camera_numbers import frame_numbers
from symrender_cg.reference.decisions import exact_hit_test
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere, Vector
from symrender_cg.stress.cases import Dice, Drawn, Inputs
from symrender_cg.stress.searches import disc, edge_in_row, inside_point, outline_radius, outline_x

SHININESS = (0.5, 1.0, 2.0, 8.0, 32.0, 100.0, 200.0)
TRIPLES = ((3, 4, 5), (5, 12, 13), (8, 15, 17), (7, 24, 25), (20, 21, 29), (9, 40, 41), (12, 35, 37))
LARGEST_SCALE = 500


def ordinary(dice: Dice) -> Inputs:
    """R in [0.5, 2], e/R - 1 in [0.1, 10], a light 1.05 to 20 R from the centre, mostly on the side that is seen."""
    radius = dice.real(0.5, 2.0)
    x, y, z = dice.direction()
    away = radius * dice.ten_to(0.02, 1.3)
    light = (away * x, away * y, away * (abs(z) if dice.often(0.8) else z))
    return Inputs(
        radius,
        radius * (1.0 + dice.ten_to(-1.0, 1.0)),
        light,
        dice.one((0.0, 0.0, 0.1)),
        shininess=dice.one(SHININESS),
    )


def default(dice: Dice) -> Drawn:
    """A pixel centre of an image of Chapter 1's scene."""
    numbers = Inputs(1.0, 4.0, (5.0, 5.0, 10.0))
    half_height = 1.25 * outline_radius(numbers)
    size = dice.whole(200, 2000)
    i, j = dice.whole(0, size - 1), dice.whole(0, size - 1)
    step = 2.0 * half_height / size
    x, y = (i + 0.5 - 0.5 * size) * step, (0.5 * size - 0.5 - j) * step
    return numbers, x, y, f"Chapter 1's scene, a pixel centre of {size} x {size}"


def generic(dice: Dice) -> Drawn:
    """Any point inside the outline of an ordinary scene."""
    numbers = ordinary(dice)
    return numbers, *inside_point(numbers, dice), "an ordinary scene"


def outline_ulps(dice: Dice) -> Drawn | None:
    """One of the two floats beside disc = 0 in a row, and up to 6 floats beside them."""
    numbers = ordinary(dice)
    y = outline_radius(numbers) * dice.real(-1.0, 1.0)
    x = outline_x(numbers, y)
    if x is None:
        return None
    x = dice.stepped(x, 6) * dice.one((1.0, -1.0))
    return numbers, *(dice.one(((x, y), (y, x)))), "within 6 floats of the outline"


def outline_exact(dice: Dice) -> Drawn:
    """disc = 0 exactly: e = bc, R = ab, rho = ac for a triple a^2 + b^2 = c^2; and the floats beside it."""
    a, b, c = dice.one(TRIPLES)
    if dice.often(0.5):
        a, b = b, a
    p, q, r = dice.one((*TRIPLES, (0, 1, 1), (0, 1, 1)))
    unit = r * 2.0 ** dice.whole(-6, 6)
    numbers = replace(ordinary(dice), radius=a * b * unit, eye=b * c * unit)
    x, y = a * c * unit / r * p * dice.one((1.0, -1.0)), a * c * unit / r * q * dice.one((1.0, -1.0))
    lx, ly, lz = dice.direction()
    away = numbers.radius * dice.ten_to(0.02, 1.0)
    numbers = replace(numbers, light=(away * lx, away * ly, away * lz))
    if dice.often(0.5):
        x, y = y, x
    if dice.often(0.7):
        x = dice.stepped(x, 1) if x else x
        y = dice.stepped(y, 1) if y else y
    return numbers, x, y, "disc = 0 exactly, or one float beside it"


def outline_search(dice: Dice) -> Drawn | None:
    """Of 24 rows the point with the least |disc|, about 2^-58 of its terms: the float64 formula cannot see its sign."""
    numbers = ordinary(dice)
    rho = outline_radius(numbers)
    found = []
    for _ in range(24):
        y = rho * dice.real(-0.999, 0.999)
        x = outline_x(numbers, y)
        if x is not None:
            found.append((abs(disc(numbers, x, y)), x, y))
    if not found:
        return None
    _, x, y = min(found)
    return numbers, *dice.one(((x, y), (-x, y), (y, x), (y, -x))), "the least |disc| of 24 rows"


def outline_off_axis(dice: Dice) -> Drawn | None:
    """The outline of a sphere anywhere before the eye, in a row: neighbouring floats on both sides of it."""
    radius, e = dice.real(0.5, 2.0), dice.real(0.5, 8.0)
    depth = radius * dice.ten_to(0.1, 2.5)
    aside, turn = depth * dice.real(0.05, 1.0), dice.real(0.0, 2.0 * math.pi)
    center = (aside * math.cos(turn), aside * math.sin(turn), e - depth)
    lx, ly, lz = dice.direction()
    away = radius * dice.real(1.5, 9.0)
    light = (center[0] + away * lx, center[1] + away * ly, center[2] + away * lz)
    material = Phong(dice.one((0.0, 0.1)), 0.7, 0.5, dice.one(SHININESS))
    sphere = Sphere(center, radius, material)
    scene = Scene(Camera((0.0, 0.0, e), half_height=e), (sphere,), (PointLight(light),))
    hit = exact_hit_test(frame_numbers(scene))
    size = radius / depth * e
    x, y = center[0] / depth * e, center[1] / depth * e
    y += size * dice.real(-0.95, 0.95)
    found = edge_in_row(hit, x - 3.0 * size, x + 3.0 * size, y, dice)
    return None if found is None else (scene, found, y, "the outline of a sphere off the axis")


def eye_near(dice: Dice) -> Drawn:
    """e = R (1 + 2^-k), k up to 52, or the next floats: e^2 - R^2 cancels; points from the middle to the outline."""
    numbers = ordinary(dice)
    r = numbers.radius
    e = max(r * (1.0 + 2.0 ** -dice.whole(1, 52)), math.nextafter(r, math.inf))
    if dice.often(0.2):
        e = r + dice.whole(1, 8) * math.ulp(r)
    numbers = replace(numbers, eye=e)
    rho, turn = outline_radius(numbers), dice.real(0.0, 2.0 * math.pi)
    away = min(r * 10.0 ** dice.real(-1.0, math.log10(rho / r)), rho * (1.0 - 2.0**-40))
    return numbers, away * math.cos(turn), away * math.sin(turn), "the eye just above the surface"


def eye_far(dice: Dice) -> Drawn:
    """e/R from 1e3 to 1e12: the textbook's t is a difference of two numbers of size e."""
    numbers = ordinary(dice)
    numbers = replace(numbers, eye=numbers.radius * dice.ten_to(3.0, 12.0))
    return numbers, *inside_point(numbers, dice), "the eye far away"


def scale(dice: Dice) -> Drawn:
    """An ordinary scene times 2^k, |k| <= 500: squares over- or underflow, the value stays what it is."""
    numbers = ordinary(dice)
    k = dice.whole(-LARGEST_SCALE, LARGEST_SCALE)
    x, y = inside_point(numbers, dice)
    moved = replace(
        numbers, radius=math.ldexp(numbers.radius, k), eye=math.ldexp(numbers.eye, k), light=_scaled(numbers.light, k)
    )
    return moved, math.ldexp(x, k), math.ldexp(y, k), f"every length times 2^{k}"


def _scaled(v: Vector, k: int) -> Vector:
    return math.ldexp(v[0], k), math.ldexp(v[1], k), math.ldexp(v[2], k)


def zero_coefficients(dice: Dice) -> Drawn:
    """Some coefficients 0, so that nothing hides what the others lose."""
    numbers = ordinary(dice)
    ambient, diffuse, specular = (dice.one((0.0, 0.1, 0.7)) for _ in range(3))
    numbers = replace(numbers, ambient=ambient, diffuse=diffuse, specular=specular)
    return numbers, *inside_point(numbers, dice), "coefficients of 0"


def huge_points(dice: Dice) -> Drawn:
    """Points far outside, up to 1e300: their squares overflow."""
    numbers = ordinary(dice)
    sign = dice.one((1.0, -1.0))
    x, y = sign * dice.ten_to(2.0, 305.0), dice.one((0.0, dice.ten_to(2.0, 305.0), -dice.ten_to(-300.0, 300.0)))
    return numbers, *dice.one(((x, y), (y, x))), "a point far outside"


def subnormal(dice: Dice) -> Drawn:
    """Subnormal numbers: all lengths, one coordinate of the light or of the point, or the coefficients."""
    numbers = ordinary(dice)
    x, y = inside_point(numbers, dice)
    small = dice.one((5e-324, -5e-324, dice.ten_to(-322.0, -308.0), -dice.ten_to(-322.0, -308.0)))
    kind = dice.one(("lengths", "point", "light", "coefficients"))
    if kind == "lengths":
        k = -dice.whole(1025, 1060)
        radius, eye = math.ldexp(numbers.radius, k), math.ldexp(numbers.eye, k)
        if not 0.0 < radius < eye:
            radius, eye = 2e-320, 5e-320
        light = _scaled(numbers.light, k) if dice.often(0.5) else numbers.light
        return replace(numbers, radius=radius, eye=eye, light=light), math.ldexp(x, k), math.ldexp(y, k), "all lengths"
    if kind == "point":
        return numbers, *dice.one(((small, y), (x, small))), "one coordinate of the point"
    if kind == "light":
        lx, ly, lz = numbers.light
        return replace(numbers, light=dice.one(((small, ly, lz), (lx, small, lz)))), x, y, "one coordinate of the light"
    diffuse, specular = dice.ten_to(-318.0, -306.0), dice.one((0.0, dice.ten_to(-318.0, -306.0)))
    return replace(numbers, ambient=0.0, diffuse=diffuse, specular=specular), x, y, "the coefficients"


def no_radius(dice: Dice) -> Drawn:
    """R = 0 or -0, which is no sphere, or R from 5e-324 to 1e-12 before an eye at 4: its middle, or beside it."""
    if dice.often(0.25):
        light = (5.0, 5.0, dice.real(1.0, 9.0))
        numbers = Inputs(dice.one((0.0, -0.0)), dice.one((4.0, 0.0, dice.real(1.0, 9.0))), light)
        return numbers, dice.one((0.0, 1.0)), 0.0, "a sphere without size"
    radius = dice.one((5e-324, 1e-300, 1e-200, dice.ten_to(-60.0, -12.0), dice.ten_to(-60.0, -12.0)))
    x = dice.one((0.0, 0.0, 1.0, radius, -0.5 * radius))
    return Inputs(radius, 4.0, (5.0, 5.0, dice.real(1.0, 10.0)), dice.one((0.0, 0.1))), x, 0.0, "a tiny sphere"


def eye_inside(dice: Dice) -> Drawn:
    """e <= R: the formula goes on, but there is no picture of the outside."""
    numbers = ordinary(dice)
    eye = numbers.radius * dice.one((1.0, 0.5, 2.0**-20, 1.0 - 2.0**-53, dice.real(0.01, 1.0)))
    x, y = (numbers.radius * dice.real(-3.0, 3.0) for _ in range(2))
    return replace(numbers, eye=eye), x, y, "the eye on or in the sphere"


def invalid(dice: Dice) -> Drawn:
    """A NaN, an infinity, or a number of the wrong sign in one place."""
    numbers = Inputs(1.0, 4.0, (5.0, 5.0, 10.0))
    x, y = dice.real(-1.0, 1.0), dice.real(-1.0, 1.0)
    bad = dice.one((math.nan, math.inf, -math.inf))
    place = dice.one(("radius", "eye", "light", "ambient", "diffuse", "specular", "shininess", "x", "y", "sign"))
    if place == "x":
        return numbers, bad, y, "x is not a number"
    if place == "y":
        return numbers, x, bad, "y is not a number"
    if place == "light":
        light = [5.0, 5.0, 10.0]
        light[dice.whole(0, 2)] = bad
        return replace(numbers, light=(light[0], light[1], light[2])), x, y, "a light that is nowhere"
    if place == "sign":
        negative = dice.one((-1.0, -5e-324, -1e300))
        field = dice.one(("radius", "eye", "ambient", "diffuse", "specular", "shininess"))
        return _with(numbers, field, negative), x, y, f"{field} is negative"
    return _with(numbers, place, bad), x, y, f"{place} is not a number"


def _with(numbers: Inputs, field: str, value: float) -> Inputs:
    fields: dict[str, Any] = {field: value}
    return replace(numbers, **fields)
