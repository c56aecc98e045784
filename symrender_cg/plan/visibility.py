"""What the eye may see: spheres in view, behind the eye, hidden; the plane, and whether one tile of it is all there is.

Comes in: Measures. Goes out: truths, one a sphere. Never done here: shadows and mirrors, for which a sphere that the
eye cannot see may still matter.

    behind      depth of the centre <= -R: every ray leads away from it (exact)
    in view     outside if, for one side of the window with inward unit normal n, n.m < -R
    hidden      the cone of B lies in that of A, gamma + beta <= alpha, and A is in front: disjoint, the smaller power
    inside      |C_A - C_B| + R_B < R_A: A is opaque and the eye outside it
    beyond      the plane is between: the whole sphere on its other side

(DESIGN: view frustum culling; the order of disjoint spheres by power: power diagrams, Aurenhammer 1987.)
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from symrender_cg.plan.effects import FARTHEST_ASIDE
from symrender_cg.plan.measures import (
    ANGLE,
    LENGTH,
    Floats,
    Indices,
    Measures,
    Truths,
    angle,
    cone_above,
    cone_below,
    norm,
    unit_vector,
)
from symrender_cg.plan.nearby import near_pairs
from symrender_cg.plan.order import deeper, seen_aside

HIDERS: Final = 64
"""So many of the widest cones are tried as what hides others."""


def behind_eye(measures: Measures) -> Truths:
    """(N,): no ray meets the sphere, as it lies wholly behind the plane of the eye or touches it from behind."""
    return ~deeper(measures.scene.spheres, measures.scene.camera.eye[2], -1)


def at_eye(measures: Measures) -> Truths:
    """(N,): the sphere reaches the plane of the eye, or is seen more than FARTHEST_ASIDE its depth off the axis."""
    spheres, eye = measures.scene.spheres, measures.scene.camera.eye[2]
    return ~deeper(spheres, eye, 1) | seen_aside(spheres, eye, FARTHEST_ASIDE)


def outside_window(measures: Measures, m: Floats, radius: Floats, aspect: float) -> Truths:
    """(n,): balls at m from the eye that lie wholly beyond one side of the window, which holds every pixel centre."""
    result = np.zeros(len(m), dtype=bool)
    depth = -m[:, 2]
    for axis, slope in enumerate(measures.slopes(aspect)):
        beyond = np.abs(m[:, axis]) - slope * depth
        reach = radius * math.hypot(1.0, slope)
        error = LENGTH * (np.abs(m[:, axis]) + slope * np.abs(depth) + reach)
        result |= beyond - reach > error
    return result


def window_normals(measures: Measures, aspect: float) -> Floats:
    """(5, 3): inward normals, of any length, of the sides of the window's cone and of the plane of the eye."""
    x, y = measures.slopes(aspect)
    return np.array([(1.0, 0.0, -x), (-1.0, 0.0, -x), (0.0, 1.0, -y), (0.0, -1.0, -y), (0.0, 0.0, -1.0)])


def touching_pairs(measures: Measures) -> tuple[Indices, Indices, Floats]:
    """(i, j, distance of the centres) with i < j of the spheres that are not proved disjoint."""
    i, j = near_pairs(measures.center, measures.radius, measures.center, measures.radius)
    i, j = i[i < j], j[i < j]
    between = norm(measures.center[i] - measures.center[j])
    reach = measures.radius[i] + measures.radius[j]
    near = ~(between > reach * (1.0 + LENGTH))
    return i[near], j[near], between[near]


def contained(measures: Measures, touching: tuple[Indices, Indices, Floats]) -> Truths:
    """(N,): the sphere lies strictly inside another one."""
    i, j, between = touching
    radius = measures.radius
    result = np.zeros(measures.count, dtype=bool)
    for inner, outer in ((i, j), (j, i)):
        result[inner[between + radius[inner] < radius[outer] * (1.0 - LENGTH)]] = True
    return result


def hidden(measures: Measures, chosen: Indices) -> Truths:
    """(n,): the chosen spheres that one of the widest others hides from the eye wholly."""
    m, d, radius = measures.m[chosen], measures.distance[chosen], measures.radius[chosen]
    alpha, beta = cone_below(d, radius), cone_above(d, radius)
    result = np.zeros(len(chosen), dtype=bool)
    for hider in np.argsort(-alpha, kind="stable")[:HIDERS]:
        narrower = np.flatnonzero((beta < alpha[hider]) & ~result)
        gamma = angle(np.broadcast_to(m[hider], (len(narrower), 3)), m[narrower])
        between = norm(measures.center[chosen[narrower]] - measures.center[chosen[hider]])
        apart = between > (radius[narrower] + radius[hider]) * (1.0 + LENGTH)
        power = (d[narrower] - radius[narrower]) * (d[narrower] + radius[narrower])
        front = (d[hider] - radius[hider]) * (d[hider] + radius[hider])
        before = power - front > LENGTH * (d[narrower] ** 2 + d[hider] ** 2)
        result[narrower[(gamma + beta[narrower] < alpha[hider] - ANGLE) & apart & before]] = True
    return result


def plane_in_view(measures: Measures, aspect: float | None) -> bool:
    """Whether some ray falls towards the plane: n.D < 0 at a corner of the window; anywhere on the image plane if None.

    n is the unit normal on the eye's side. n.D is linear in D, so that the corners decide.
    """
    if measures.normal is None:
        return False
    x, y, z = measures.normal
    if aspect is None:
        return bool(x != 0.0 or y != 0.0 or z > 0.0)
    slope_x, slope_y = measures.slopes(aspect)
    lowest = -abs(x) * slope_x - abs(y) * slope_y - z
    return not lowest > LENGTH * (1.0 + slope_x + slope_y)


def one_tile(measures: Measures, aspect: float | None) -> int | None:
    """The parity of the one tile that holds all of the plane in view; None where several may be seen.

    The part in view is the projection of the window, a convex quadrangle when all four corners meet the plane; a
    tile is convex, so it holds the part if it holds the corners.
    """
    plane, normal, point = measures.plane, measures.normal, measures.point
    if plane is None or plane.checker is None or normal is None or point is None or aspect is None:
        return None
    turned = unit_vector(plane.normal)
    axis = unit_vector(plane.axis)
    across = axis - (axis @ turned) * turned
    lean = float(norm(across))
    if lean < 2.0**-10:
        return None
    across = across / lean
    tile = plane.tile / measures.unit
    slope_x, slope_y = measures.slopes(aspect)
    cells = set()
    eye = np.array((0.0, 0.0, measures.eye))
    height = float((eye - point) @ normal)
    for x in (-slope_x, slope_x):
        for y in (-slope_y, slope_y):
            d = np.array((x, y, -1.0))
            fall = -float(normal @ d)
            if not fall > 2.0**-10 * float(norm(d)):
                return None
            away = eye - point + height / fall * d
            error = 2.0**-30 * (float(norm(away)) + float(norm(eye - point))) / tile
            if not error < 1.0:
                return None
            for direction in (across, np.cross(turned, across)):
                place = float(away @ direction) / tile
                if math.floor(place - error) != math.floor(place + error):
                    return None
            cells.add(
                (math.floor(float(away @ across) / tile), math.floor(float(away @ np.cross(turned, across)) / tile))
            )
    if len(cells) != 1:
        return None
    u, v = cells.pop()
    return (u + v) % 2
