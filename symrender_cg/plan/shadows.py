"""Which sphere may keep which light from which surface: pairs (blocker, lamp), found without looking at all of them.

Comes in: Measures and Lamps. Goes out: blockers of every lamp, indices of spheres. Never done here: what mirrors see.

B may darken a point of A for the light L only if it meets the hull of L and A. With a = C_A - L, q = C_B - L, p and h
the parts of q along and across a, sin(alpha) = R_A / |a|:
    foot s = (p + h tan(alpha)) / |a|;   distance of C_B from the hull:
    0 < s < 1: h cos(alpha) - p sin(alpha)      s >= 1: |C_B - C_A| - R_A      s <= 0: |q|
    from a direction: across or, for spheres behind A, |C_B - C_A|, each less R_A.
B is left out where that exceeds R_B. Where every point that is lit faces the light (no ungated highlight), B inside A
is left out too. For a plane at height 0 and a light at height h: B at or below 0, or wholly at or above h.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final

import numpy as np

from symrender_cg.plan.lamps import Lamps
from symrender_cg.plan.measures import LENGTH, Floats, Indices, Measures, Truths, cone_above, cross, dot, norm
from symrender_cg.plan.nearby import near_pairs
from symrender_cg.plan.visibility import window_normals

_STEEPEST: Final = 16.0
"""Largest tan(alpha) for which the distance from the hull is computed; nearer the surface the powers decide."""

_HULL: Final = 2.0**-40
"""Exceeds the error of the distance from the hull, in the lengths of its triangle: 8,192 roundings, with tan <= 16."""

_BATCH: Final = 1 << 18


def find_blockers(
    measures: Measures, lamps: Lamps, mirrored: Truths, aspect: float | None, force: Collection[str] = ()
) -> tuple[Indices, Indices, Indices]:
    """(receiver, light, blocker) of every pair that may matter, blockers as indices of spheres."""
    receivers: list[Indices] = [np.empty(0, dtype=np.int64)]
    lights, blockers = list(receivers), list(receivers)
    for light in range(len(measures.at)) if measures.scene.shadows else ():
        lit = np.flatnonzero(lamps.any[:, light])
        spheres, planes = lit[lit < measures.count], lit[lit >= measures.count]
        leaking = lamps.specular[:, light] & ~lamps.gated[:, light]
        if "shadow" in force:
            every = np.arange(measures.count)
            a, b = np.repeat(lit, measures.count), np.tile(every, len(lit))
            found = [(a[a != b], b[a != b])]
        else:
            found = [_on_spheres(measures, light, spheres, leaking)]
            for plane in planes:
                chosen = _on_plane(measures, light, None if mirrored[plane] else aspect)
                found.append((np.full(len(chosen), plane), chosen))
        for a, b in found:
            receivers.append(a)
            lights.append(np.full(len(a), light))
            blockers.append(b)
    return np.concatenate(receivers), np.concatenate(lights), np.concatenate(blockers)


def _on_spheres(measures: Measures, light: int, chosen: Indices, leaking: Truths) -> tuple[Indices, Indices]:
    """(receiver, blocker) among spheres, for one light."""
    useful = np.arange(measures.count)
    if measures.plane is not None:
        height, error = measures.light_heights
        if height[light] > error[light]:
            useful = useful[~measures.beyond_plane]
    if measures.directional[light]:
        place, reach = across(measures, light), measures.radius
    else:
        away = measures.center - measures.at[light]
        distance = norm(away)
        place = away / np.maximum(distance, 2.0**-1000)[:, np.newaxis]
        reach = cone_above(distance, measures.radius)
    a, b = near_pairs(place[chosen], reach[chosen], place[useful], reach[useful])
    a, b = chosen[a], useful[b]
    a, b = a[a != b], b[a != b]
    missed = np.concatenate(
        [
            misses_sphere(measures, light, a[k : k + _BATCH], b[k : k + _BATCH], leaking)
            for k in range(0, len(a), _BATCH)
        ]
        or [np.zeros(0, dtype=bool)]
    )
    return a[~missed], b[~missed]


def across(measures: Measures, light: int) -> Floats:
    """(N, 3): the centres seen along a directional light, two coordinates across it and a 0."""
    towards = measures.at[light]
    first = np.zeros(3)
    first[np.argmin(np.abs(towards))] = 1.0
    first = np.cross(towards, first)
    first /= np.sqrt(first @ first)
    basis = np.array([first, np.cross(towards, first), np.zeros(3)])
    return np.asarray(measures.center @ basis.T)


def misses_sphere(measures: Measures, light: int | Indices, a: Indices, b: Indices, leaking: Truths) -> Truths:
    """(n,): blocker b provably darkens no point of sphere a; `leaking` (receivers,): unlit points matter too.

    light: one for all pairs, or one a pair, all of one kind.
    """
    center, radius = measures.center, measures.radius
    between = center[b] - center[a]
    gap = norm(between)
    reach = radius[a] + radius[b]
    apart = gap > reach * (1.0 + LENGTH)
    contained = ~leaking[a] & (gap + radius[b] < radius[a] * (1.0 - LENGTH))
    if np.all(measures.directional[light]):
        towards = np.broadcast_to(measures.at[light], between.shape)
        aside, behind = norm(cross(between, towards)), dot(between, towards) < 0.0
        error = LENGTH * (gap + reach)
        return np.asarray(contained | (aside - reach > error) | (behind & (gap - reach > error)))
    to_a, to_b = center[a] - measures.at[light], center[b] - measures.at[light]
    d, q = norm(to_a), norm(to_b)
    power_a, power_b = (d - radius[a]) * (d + radius[a]), (q - radius[b]) * (q + radius[b])
    result = contained | (apart & (power_b - power_a > LENGTH * (d * d + q * q + reach * reach)))
    outside = d > radius[a] * math.hypot(1.0, 1.0 / _STEEPEST)
    safe = np.where(outside, d, 2.0 * radius[a])
    root = np.sqrt((safe - radius[a]) * (safe + radius[a]))
    sine, cosine = radius[a] / safe, root / safe
    along, aside = dot(to_a, to_b) / safe, norm(cross(to_a, to_b)) / safe
    foot = (along + aside * (radius[a] / root)) / safe
    hull = np.where(foot >= 1.0, gap - radius[a], np.where(foot <= 0.0, q, aside * cosine - along * sine))
    result |= outside & (hull - radius[b] > _HULL * (q + d + reach))
    return np.asarray(result)


def _on_plane(measures: Measures, light: int, aspect: float | None) -> Indices:
    """Spheres that may darken a point of the plane; of the part in the window if `aspect` is given."""
    height, error = measures.sphere_heights
    up, up_error = measures.light_heights
    radius = measures.radius
    slack = error + LENGTH * radius
    above, below = ~(height + radius < -slack), ~(height - radius > slack)
    if up[light] > up_error[light]:
        keep = above
        if not measures.directional[light]:
            keep = keep & ~(height - radius - up[light] > slack + up_error[light])
    elif up[light] < -up_error[light]:
        keep = below
        if not measures.directional[light]:
            keep = keep & ~(height + radius - up[light] < -slack - up_error[light])
    else:
        keep = np.ones(measures.count, dtype=bool)
    if aspect is not None:
        keep = keep & ~_shadow_misses_window(measures, light, aspect)
    return np.flatnonzero(keep)


def _shadow_misses_window(measures: Measures, light: int, aspect: float) -> Truths:
    """(N,): beyond one side of the window lies the sphere and all that it keeps the light from.

    What it darkens is X + s (X - L), X in the ball, s > 0: on the outer side of a plane through the eye with the ball,
    where X - L does not lead to the inner side: n.(C - E) < -R and n.(C - L) <= -R.
    """
    result = np.zeros(measures.count, dtype=bool)
    radius = measures.radius
    for normal in window_normals(measures, aspect):
        length = float(np.sqrt(normal @ normal))
        place, size = measures.m @ normal, norm(measures.m) * length
        beyond = place + radius * length < -LENGTH * (size + radius * length)
        if measures.directional[light]:
            leads = np.full(measures.count, -(measures.at[light] @ normal) < -LENGTH * length)
        else:
            away = measures.center - measures.at[light]
            leads = away @ normal + radius * length < -LENGTH * (norm(away) + radius) * length
        result |= beyond & leads
    return result
