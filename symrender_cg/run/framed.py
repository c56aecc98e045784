"""`framed_half_heights`: the half-heights that frame the spheres of many scenes, as symrender_cg.scene.framing has one.

In: eyes and spheres in the camera's frame. Out: a half-height for each scene, nan where it has none. Which spheres may
reach farthest is found for all scenes at once, and how far in two words; where these do not tell which float64 is the
nearest, or a sphere is close to the plane of the eye, whole numbers do. Never here: another rounding than theirs.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import SceneError
from symrender_cg.reference.pairs import Pair, two_product, two_sum
from symrender_cg.run.two_words import is_nearest, product_of, quotient_of, root_of, sum_of
from symrender_cg.scene import Sphere
from symrender_cg.scene.framing import MARGIN, framed_half_height

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

_ERROR: Final = 2.0**-90
"""Exceeds the relative error of an outline in two words: some 60 roundings of 2^-104, divided by the least gap."""

_LEAST_GAP: Final = 2.0**-8
"""Of depth and radius, in depths: nearer, their difference is not good enough in two words."""


def framed_half_heights(eye: Floats, center: Floats, radius: Floats) -> Floats:
    """eye (T,), center (T, N, 3), radius (T, N) -> (T,).

    The slope of an outline is good to 1e-9 where the centre is more than 1e-6 of its depth farther than the radius, see
    symrender_cg.scene.framing; spheres that are 2e-6 less steep than the steepest are left out, all others looked at.
    """
    with np.errstate(all="ignore"):
        k, m = eye[:, np.newaxis] - center[..., 2], np.abs(center[..., :2]).max(axis=2)
        plain = (radius > 1e-60) & (k - radius > 1e-6 * k) & (k + m < 1e60)
        square = np.where(plain, (k - radius) * (k + radius), 1.0)
        slope = np.where(plain, (k * m + radius * np.sqrt(square + m * m)) / square, np.inf)
        steepest = np.where(plain, slope, 0.0).max(axis=1, initial=0.0)
        behind = ~plain & (k < -1.00001 * radius) & (k > -1e60) & (radius > 0.0)
        wide = ~(slope < steepest[:, np.newaxis] * (1.0 - 2e-6)) & ~behind
        alone = radius.shape[1] == 1
        as_ever = plain & (k - radius > _LEAST_GAP * k)
        if alone:  # at the origin it is framed by another formula
            as_ever &= (center != 0.0).any(axis=2)
        found, known = _in_two_words(eye, center, radius, m, wide & as_ever)
    known &= (~wide | as_ever).all(axis=1) & wide.any(axis=1)
    for t in np.flatnonzero(~known).tolist():
        found[t] = _framed(float(eye[t]), center[t, wide[t]], radius[t, wide[t]], alone=alone)
    return found


def _in_two_words(eye: Floats, center: Floats, radius: Floats, m: Floats, wide: Truths) -> tuple[Floats, Truths]:
    """(T,) each: 1.25 e times the largest slope of the outlines of some spheres, and whether that is known.

    (k m + R sqrt(k^2 + m^2 - R^2)) / (k^2 - R^2) with k = e - z, m = max(|x|, |y|).
    """
    t, i = np.nonzero(wide)
    e, r, aside = eye[t], radius[t, i], m[t, i]
    nothing = np.zeros(len(t))
    depth = two_sum(e, -center[t, i, 2])
    size: Pair = r, nothing
    square = product_of(sum_of([depth, (-r, nothing)]), sum_of([depth, size]))
    root = root_of(sum_of([square, two_product(aside, aside)]))
    top = sum_of([product_of(depth, (aside, nothing)), product_of(root, size)])
    height = quotient_of(product_of(top, two_product(e, np.full(len(t), MARGIN))), square)
    found, known = np.zeros(len(eye)), np.ones(len(eye), dtype=bool)
    np.maximum.at(found, t, height[0])
    np.logical_and.at(known, t, is_nearest(height, _ERROR * height[0]))
    return found, known


def _framed(eye: float, center: Floats, radius: Floats, *, alone: bool) -> float:
    """The same of one scene, by those of its spheres that may reach farthest; nan where it cannot be framed."""
    try:
        places = zip(center.tolist(), radius.tolist(), strict=True)
        spheres = tuple(Sphere((x, y, z), size) for (x, y, z), size in places)
        if not spheres or not eye > 0.0:
            return np.nan
        return framed_half_height(eye, spheres if alone or len(spheres) > 1 else spheres * 2)
    except SceneError:
        return np.nan
