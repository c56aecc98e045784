"""The table of families: name, title, what is hard about it, where it is known from, the function that draws a case.

Comes in: nothing. Goes out: FAMILIES, in the order in which they are printed. Never done here: a draw. The first 26 are
those of the kept cases of tests/hardcases.json, under the same names; then what they leave out, and what many spheres
bring.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Final

from symrender_cg.errors import ArgumentError
from symrender_cg.stress import light_families as light
from symrender_cg.stress import scene_families as scene
from symrender_cg.stress import sphere_families as sphere
from symrender_cg.stress.cases import Family

_GOLDBERG = "Goldberg 1991, cancellation"
_KAHAN = "Kahan 2004, discriminants"
_HAINES = "Haines, Günther, Akenine-Möller 2019, ray and sphere"
_PHONG = "Phong 1975, the formula"
_WOO = "Woo, Pearce, Ouellette 1996"
_IEEE = "IEEE 754-2019"

FAMILIES: Final[tuple[Family, ...]] = (
    Family(
        "default",
        "Chapter 1's scene",
        "nothing: the scene that the formula was written for",
        "Chapter 1",
        sphere.default,
    ),
    Family("generic", "ordinary scenes", "nothing in particular: what a level costs every day", _PHONG, sphere.generic),
    Family(
        "sil_ulps",
        "within 6 floats of the outline",
        "disc = e^2 R^2 - (e^2 - R^2)(x^2 + y^2) is a difference of nearly equal numbers, and its sign is hit or miss",
        _KAHAN,
        sphere.outline_ulps,
    ),
    Family(
        "sil_exact",
        "on the outline exactly",
        "disc is 0, which is a hit; one float on it is a miss",
        "Pythagorean triples",
        sphere.outline_exact,
    ),
    Family(
        "sil_search",
        "searched for the least disc",
        "disc is about 2^-58 of its terms, below any rounding of float64",
        _KAHAN,
        sphere.outline_search,
    ),
    Family(
        "eye_near",
        "the eye just above the surface",
        "e^2 - R^2 cancels, down to one unit in the last place of e",
        _GOLDBERG,
        sphere.eye_near,
    ),
    Family(
        "eye_far",
        "the eye far away",
        "the hit point is the difference of two numbers that are e/R times larger",
        _HAINES,
        sphere.eye_far,
    ),
    Family(
        "scale",
        "every length times 2^k",
        "fourth powers of lengths over- or underflow, though the value does not change",
        _IEEE,
        sphere.scale,
    ),
    Family(
        "light_near",
        "a light at the surface",
        "w = L - P keeps no digit where the light is 2^-52 R from the point that is seen",
        _GOLDBERG,
        light.light_near,
    ),
    Family(
        "light_inside",
        "a light in the sphere",
        "no point is lit, and yet r.v > 0 in places",
        _PHONG,
        light.light_inside,
    ),
    Family(
        "light_at_hit",
        "a light at the point that is seen",
        "w is 0, where the light adds nothing, or one float away from it",
        _IEEE + ", 0/0",
        light.light_at_hit,
    ),
    Family(
        "light_behind",
        "a light behind the sphere",
        "the highlight is not gated by n.l, so that it can be seen where no light arrives",
        _PHONG,
        light.light_behind,
    ),
    Family(
        "terminator",
        "on the terminator",
        "n.l is a difference of nearly equal numbers, and where nothing else is added it is the value",
        _GOLDBERG,
        light.terminator,
    ),
    Family(
        "light_far",
        "a light up to 1e300 away",
        "the square of its distance overflows; its direction is an ordinary one",
        _IEEE,
        light.light_far,
    ),
    Family(
        "highlight",
        "the highlight, n to 1e12",
        "the relative error of (r.v)^n is n times that of r.v",
        _PHONG,
        light.highlight,
    ),
    Family(
        "highlight_exact",
        "the middle of the highlight",
        "r.v is 1: computed as more than 1, its power is anything",
        _PHONG,
        light.highlight_exact,
    ),
    Family(
        "rdv0",
        "opposite the highlight, small n",
        "for n < 1 the power magnifies r.v near 0, and its sign decides between 0 and nearly 1",
        _PHONG,
        light.opposite,
    ),
    Family(
        "n0",
        "n = 0",
        "max(0, r.v)^0 is 1 everywhere; for n = 5e-324 it is 0 where r.v <= 0",
        _IEEE + ", pow(0, 0) = 1",
        light.no_shininess,
    ),
    Family(
        "pow_uflow",
        "powers that underflow",
        "(r.v)^n is subnormal: squares and exponentials on the way to it are rounded to a few bits, or to 0",
        _IEEE + ", subnormal numbers",
        light.power_underflow,
    ),
    Family(
        "denormal",
        "subnormal numbers",
        "lengths, coordinates or coefficients have few bits, and products of them none",
        _IEEE + ", subnormal numbers",
        sphere.subnormal,
    ),
    Family(
        "eye_in",
        "the eye on or in the sphere",
        "the formula goes on and paints a plausible image: it must be refused",
        "Chapter 1, e > R",
        sphere.eye_inside,
        refused=True,
    ),
    Family(
        "R0",
        "no radius, or a tiny one",
        "N = 0/0, or R^2 underflows: refused, or right",
        "Chapter 1, R > 0",
        sphere.no_radius,
        refused=True,
    ),
    Family(
        "kzero",
        "coefficients of 0",
        "nothing hides what the other terms lose",
        _PHONG,
        sphere.zero_coefficients,
    ),
    Family(
        "invalid",
        "NaN, infinite and negative numbers",
        "max(0, NaN) is 0, which is a plausible value: it must be refused",
        _IEEE + ", maximum of a NaN",
        sphere.invalid,
        refused=True,
    ),
    Family(
        "huge_xy",
        "points up to 1e305",
        "x^2 + y^2 overflows, and inf - inf is no miss",
        _IEEE,
        sphere.huge_points,
    ),
    Family(
        "n_huge",
        "n from 1e15 to 1e300",
        "the highlight is narrower than the spacing of floats: 1, 0, or a number in between",
        _PHONG,
        light.huge_shininess,
    ),
    Family(
        "sil_off_axis",
        "the outline off the axis",
        "disc is a difference of products of lengths: m x D keeps the digits that m.D loses",
        _HAINES,
        sphere.outline_off_axis,
    ),
    Family(
        "gate",
        "a gated highlight at the terminator",
        "the image jumps where n.l changes sign",
        _WOO,
        light.gated_terminator,
    ),
    Family(
        "shadow_edge",
        "a shadow's edge, light grazing",
        "whether the way to the light passes a sphere is the sign of a small difference",
        _WOO,
        scene.shadow_edge,
    ),
    Family(
        "contact",
        "spheres that touch, to a float",
        "near the contact which sphere is seen, and which shadows which, hangs on the last place",
        _WOO,
        scene.contact,
    ),
    Family(
        "eye_plane",
        "a sphere across the eye's plane",
        "its outline runs to infinity, and half of it is behind the eye",
        _HAINES,
        scene.eye_plane,
    ),
    Family(
        "far_mirror",
        "a mirror of a far sphere",
        "a rounding of the mirrored ray's direction moves its far end by the distance",
        "Igehy 1999, ray differentials",
        scene.far_mirror,
    ),
    Family(
        "mirror_edge",
        "an outline in a mirror",
        "what a mirrored ray meets is decided after it was rounded",
        "Igehy 1999, ray differentials",
        scene.mirrored_outline,
    ),
    Family(
        "near_depths",
        "depths that are nearly equal",
        "which of two spheres that cut each other is in front, and which shadows the other, at 1e-1 to 1e-17",
        "Catmull 1974, depth buffer",
        scene.near_depths,
    ),
    Family(
        "horizon_light",
        "a light in the plane",
        "n.l is 0, or 1e-16 of the distance, all over the plane",
        _GOLDBERG,
        scene.horizon_light,
    ),
    Family(
        "tile_edge",
        "the edges of tiles",
        "the floor of a number that is whole, to rounding",
        _GOLDBERG,
        scene.tile_edge,
    ),
)

KEPT_FAMILIES: Final = 26
"""So many of FAMILIES are those of the kept cases."""


def family(name: str) -> Family:
    """The family of that name. Raises ArgumentError that names the nearest and all of them when there is none such."""
    for entry in FAMILIES:
        if entry.name == name:
            return entry
    names = [entry.name for entry in FAMILIES]
    nearest = difflib.get_close_matches(name, names, n=1)
    suggestion = f"; did you mean {nearest[0]!r}?" if nearest else ""
    raise ArgumentError(f"family: {name!r} is not known; expected one of {', '.join(names)}{suggestion}")


def families(names: Sequence[str]) -> tuple[Family, ...]:
    """The families of these names in the table's order, each once; all of them for no name."""
    chosen = {family(name).name for name in names}
    return tuple(entry for entry in FAMILIES if not names or entry.name in chosen)
