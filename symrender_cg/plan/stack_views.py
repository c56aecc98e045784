"""What the eye sees of many scenes at once: symrender_cg.plan.visibility and .order, with an axis of scenes.

Comes in: Stacked. Goes out: StackViews, truths for each sphere of each scene. What a plan decides in whole numbers is
decided so here, where float64 does not. Never done here: shadows and mirrors.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Final

import numpy as np

from symrender_cg.plan.effects import FARTHEST_ASIDE
from symrender_cg.plan.measures import (
    ANGLE,
    LENGTH,
    Floats,
    Indices,
    Truths,
    angle,
    cone_above,
    cone_below,
    norm,
    tangent_length,
)
from symrender_cg.plan.order import front_to_back
from symrender_cg.plan.stack_measures import Stacked, unit_vectors
from symrender_cg.plan.stack_nearby import all_true, near_pairs_of_all
from symrender_cg.plan.visibility import HIDERS
from symrender_cg.scene import Sphere

_LEAST_LEAN: Final = 2.0**-10
"""See symrender_cg.plan.visibility.one_tile: an axis that leans less, a ray that falls less, is not followed."""


@dataclass(frozen=True, eq=False)
class StackViews:
    """What may be seen in T scenes of N spheres and P materials of a plane.

    visible, at_eye (T, N); rank (T, N): place of a visible sphere front to back; nowhere (T, N): no ray from outside
    all spheres, on the eye's side of the plane, meets it first; touching (T, N, N): both are visible and not proved
    disjoint; plane_seen (T,); kept (T, P): materials of the plane that are told apart.
    """

    visible: Truths
    at_eye: Truths
    rank: Indices
    nowhere: Truths
    touching: Truths
    plane_seen: Truths
    kept: Truths

    def repeated(self, count: int) -> StackViews:
        """The views of one scene for each of so many."""
        every = (getattr(self, entry.name) for entry in fields(self))
        return StackViews(*(np.broadcast_to(value, (count, *value.shape[1:])) for value in every))


def look_at_all(stacked: Stacked) -> StackViews:
    """What the eye may see of each scene."""
    front, behind = _deeper(stacked, 1), ~_deeper(stacked, -1)
    near, inside = _neighbours(stacked)
    nowhere = stacked.beyond_plane | inside
    dropped = behind | _outside(stacked) | nowhere
    dropped |= _hidden(stacked, dropped)
    visible = ~dropped
    plane_seen = _plane_in_view(stacked)
    return StackViews(
        visible=visible,
        at_eye=~front | _aside(stacked),
        rank=_ranks(stacked, visible),
        nowhere=nowhere,
        touching=near & visible[:, :, np.newaxis] & visible[:, np.newaxis],
        plane_seen=plane_seen,
        kept=_kept(stacked, visible, plane_seen),
    )


def _deeper(stacked: Stacked, factor: int) -> Truths:
    """(T, N): e - z > factor R, exactly: rounding keeps order, so that equal float64 alone are in doubt."""
    depth, bound = stacked.eye[:, np.newaxis] - stacked.center[..., 2], factor * stacked.radius
    truths = np.asarray(depth > bound)
    for t, k in np.argwhere(depth == bound).tolist():
        e, z, r = stacked.stack.eye[t], stacked.stack.center[t, k, 2], stacked.stack.radius[t, k]
        truths[t, k] = Fraction(float(e)) - Fraction(float(z)) > factor * Fraction(float(r))
    return truths


def _aside(stacked: Stacked) -> Truths:
    """(T, N): max(|x|, |y|) > 256 (e - z), exactly."""
    depth = stacked.eye[:, np.newaxis] - stacked.center[..., 2]
    bound = np.abs(stacked.center[..., :2]).max(axis=2) / FARTHEST_ASIDE
    truths = np.asarray(bound > depth)
    for t, k in np.argwhere((bound == depth) | ((bound > 0.0) & (bound < 2.0**-1000))).tolist():
        x, y, z = (Fraction(v) for v in stacked.stack.center[t, k].tolist())
        truths[t, k] = max(abs(x), abs(y)) > FARTHEST_ASIDE * (Fraction(float(stacked.stack.eye[t])) - z)
    return truths


def _neighbours(stacked: Stacked) -> tuple[Truths, Truths]:
    """(T, N, N): not proved disjoint, for two spheres; (T, N): lies strictly inside another one."""
    center, radius = stacked.center, stacked.radius
    every = np.ones(radius.shape, dtype=bool)
    t, i, j = near_pairs_of_all(center, radius, every, every)
    between, reach = norm(center[t, i] - center[t, j]), radius[t, i] + radius[t, j]
    touching = ~(between > reach * (1.0 + LENGTH))
    t, i, j, between = t[touching], i[touching], j[touching], between[touching]
    within = between + radius[t, i] < radius[t, j] * (1.0 - LENGTH)
    near, inside = np.zeros((*radius.shape, stacked.spheres), dtype=bool), np.zeros(radius.shape, dtype=bool)
    near[t, i, j] = True
    inside[t[within], i[within]] = True
    return near, inside


def _outside(stacked: Stacked) -> Truths:
    """(T, N): beyond one side of the window, which holds every pixel centre."""
    m, radius = stacked.m, stacked.radius
    found = np.zeros(radius.shape, dtype=bool)
    if stacked.slopes is None:
        return found
    for axis in (0, 1):
        found |= beyond_side(m, radius, stacked.slopes[:, axis, np.newaxis], axis)
    return found


def beyond_side(m: Floats, radius: Floats, slope: Floats, axis: int) -> Truths:
    """Balls at m (..., 3) from the eye that lie wholly beyond one of two sides of the window."""
    place, depth = np.abs(m[..., axis]), -m[..., 2]
    reach = radius * np.hypot(1.0, slope)
    return np.asarray(place - slope * depth - reach > LENGTH * (place + slope * np.abs(depth) + reach))


def _hidden(stacked: Stacked, dropped: Truths) -> Truths:
    """(T, N): one of the widest others hides the sphere wholly, as symrender_cg.plan.visibility.hidden finds it."""
    m, distance, radius, center = stacked.m, stacked.distance, stacked.radius, stacked.center
    alpha, beta = cone_below(distance, radius), cone_above(distance, radius)
    widest = np.argsort(np.where(dropped, np.inf, -alpha), axis=1, kind="stable")[:, :HIDERS]
    every = np.arange(len(radius))[:, np.newaxis]
    # gamma < alpha: cos gamma > cos alpha, both times |m_A| |m_B|, with room for rounding
    cosine = tangent_length(distance, radius)[every, widest]
    covers = np.einsum("thi,tni->thn", m[every, widest], m) > (cosine * (1.0 - 2.0**-40))[..., np.newaxis] * (
        distance[:, np.newaxis] * (1.0 - 2.0**-40)
    )
    covers &= ~dropped[every, widest][..., np.newaxis]
    covers &= ~dropped[:, np.newaxis]
    covers &= beta[:, np.newaxis] < alpha[every, widest][..., np.newaxis]
    t, rank, n = all_true(covers)
    h = widest[t, rank]
    gamma = angle(m[t, h], m[t, n])
    apart = norm(center[t, n] - center[t, h]) > (radius[t, n] + radius[t, h]) * (1.0 + LENGTH)
    power = (distance[t, n] - radius[t, n]) * (distance[t, n] + radius[t, n])
    ahead = (distance[t, h] - radius[t, h]) * (distance[t, h] + radius[t, h])
    before = power - ahead > LENGTH * (distance[t, n] ** 2 + distance[t, h] ** 2)
    covered = (gamma + beta[t, n] < alpha[t, h] - ANGLE) & apart & before
    result = np.zeros(radius.shape, dtype=bool)
    result[t[covered], n[covered]] = True
    return result


def _ranks(stacked: Stacked, visible: Truths) -> Indices:
    """(T, N): place in the order of the visible ones by the power of the eye; where float64 does not tell two apart,
    a scene's are ordered by whole numbers."""
    d, r = stacked.distance, stacked.radius
    key, error = (d - r) * (d + r), 2.0**-49 * d * d
    low, high = np.where(visible, key - error, np.inf), np.where(visible, key + error, np.inf)
    order = np.argsort(low, axis=1, kind="stable")
    low, high = np.take_along_axis(low, order, axis=1), np.take_along_axis(high, order, axis=1)
    close = (low[:, 1:] <= np.maximum.accumulate(high, axis=1)[:, :-1]) & np.isfinite(low[:, 1:])
    for t in np.flatnonzero(close.any(axis=1)).tolist():
        places, sizes = stacked.stack.center[t].tolist(), stacked.stack.radius[t].tolist()
        spheres = [Sphere((x, y, z), size) for (x, y, z), size in zip(places, sizes, strict=True)]
        seen, eye = np.flatnonzero(visible[t]), (0.0, 0.0, float(stacked.stack.eye[t]))
        order[t, : len(seen)] = front_to_back(spheres, seen, eye, d[t], r[t])
    return inverse(order)


def inverse(order: Indices) -> Indices:
    """(T, n): where each number stands in a row that has all of them."""
    found = np.empty_like(order)
    np.put_along_axis(found, order, np.broadcast_to(np.arange(order.shape[1]), order.shape), axis=1)
    return found


# ---- the plane


def _plane_in_view(stacked: Stacked) -> Truths:
    """(T,): some ray falls towards the plane."""
    if stacked.normal is None:
        return np.zeros(stacked.count, dtype=bool)
    x, y, z = stacked.normal.T
    if stacked.slopes is None:
        return np.asarray((x != 0.0) | (y != 0.0) | (z > 0.0))
    slope_x, slope_y = stacked.slopes.T
    lowest = -np.abs(x) * slope_x - np.abs(y) * slope_y - z
    return np.asarray(~(lowest > LENGTH * (1.0 + slope_x + slope_y)))


def _kept(stacked: Stacked, visible: Truths, plane_seen: Truths) -> Truths:
    """(T, P): one material of the plane where its tiles cannot be told apart."""
    stack, number = stacked.stack, stacked.spheres
    kept = np.ones((stacked.count, stacked.planes), dtype=bool)
    plane = stacked.scene.plane
    if plane is None or plane.checker is None:
        return kept
    one, other = plane.material, plane.checker
    equal = np.full(stacked.count, one.gate_specular == other.gate_specular)
    for value in (stack.ambient, stack.diffuse, stack.specular, stack.shininess, stack.reflect):
        same = value[:, number] == value[:, number + 1]
        equal &= same if same.ndim == 1 else same.all(axis=1)
    kept[equal, 1] = False
    mirrors = (stack.reflect[:, :number] > 0.0) & visible & (stacked.scene.max_bounces > 0)
    odd, even = _tiles(stacked)
    alone = ~equal & ~mirrors.any(axis=1) & plane_seen
    kept[alone & odd, 0] = False
    kept[alone & even, 1] = False
    return kept


def _tiles(stacked: Stacked) -> tuple[Truths, Truths]:
    """(T,) twice: all of the plane in view is one odd tile, one even tile; see visibility.one_tile."""
    count, ground, normal, point = stacked.count, stacked.stack.ground, stacked.normal, stacked.point
    nothing = np.zeros(count, dtype=bool)
    if ground is None or normal is None or point is None or stacked.slopes is None:
        return nothing, nothing
    turned, axis = unit_vectors(ground.normal), unit_vectors(ground.axis)
    across = axis - np.einsum("ti,ti->t", axis, turned)[:, np.newaxis] * turned
    lean = norm(across)
    sure = lean >= _LEAST_LEAN
    across = across / np.maximum(lean, _LEAST_LEAN)[:, np.newaxis]
    along = np.cross(turned, across)
    tile = ground.tile / stacked.unit
    offset = np.stack((-point[:, 0], -point[:, 1], stacked.eye - point[:, 2]), axis=1)
    height = np.einsum("ti,ti->t", offset, normal)
    cells = []
    for right in (-1.0, 1.0):
        for up in (-1.0, 1.0):
            d = np.concatenate((stacked.slopes * (right, up), np.full((count, 1), -1.0)), axis=1)
            fall = -np.einsum("ti,ti->t", normal, d)
            falls = fall > _LEAST_LEAN * norm(d)
            away = offset + (height / np.where(falls, fall, 1.0))[:, np.newaxis] * d
            error = 2.0**-30 * (norm(away) + norm(offset)) / tile
            sure &= falls & (error < 1.0)
            cell = []
            for direction in (across, along):
                place = np.einsum("ti,ti->t", away, direction) / tile
                sure &= np.floor(place - error) == np.floor(place + error)
                cell.append(np.floor(place))
            cells.append(cell)
    u, v = cells[0]
    for other_u, other_v in cells[1:]:
        sure &= (other_u == u) & (other_v == v)
    odd = np.mod(u + v, 2.0) == 1.0
    return np.asarray(sure & odd), np.asarray(sure & ~odd)
