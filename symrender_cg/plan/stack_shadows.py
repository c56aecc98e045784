"""Which sphere may keep which light from which surface, in many scenes at once: symrender_cg.plan.shadows, with an axis
of scenes.

Comes in: Stacked, lamps, and what mirrors show. Goes out: Pairs. Never done here: what mirrors see.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symrender_cg.plan.measures import LENGTH, Floats, Indices, Truths, cone_above, norm
from symrender_cg.plan.shadows import misses_sphere
from symrender_cg.plan.stack_lamps import Terms
from symrender_cg.plan.stack_measures import Stacked
from symrender_cg.plan.stack_nearby import near_pairs_of_all
from symrender_cg.scene import DirectionalLight


@dataclass(frozen=True, eq=False)
class Pairs:
    """One entry a pair of lamp and blocker: scene, receiver, light, index of the blocker."""

    scene: Indices
    receiver: Indices
    light: Indices
    blocker: Indices


def find_all_blockers(stacked: Stacked, lamps: Terms, mirrored: Truths) -> Pairs:
    """Every pair that may matter; mirrored (T, N + P): may be seen in a mirror."""
    number = stacked.spheres
    nothing = np.empty(0, dtype=np.int64)
    found = [(nothing, nothing, nothing, nothing)]
    for light in range(stacked.lights) if stacked.scene.shadows else ():
        lit = lamps.any[..., light]
        leaking = (lamps.specular & ~lamps.gated)[:, :number, light]
        pairs = [_on_spheres(stacked, light, lit[:, :number], leaking)] if lit[:, :number].any() else []
        planes = lit[:, number:]
        if planes.any():
            whole = _on_plane(stacked, light)
            in_view = whole & ~_misses_window(stacked, light)
            shown = np.where(mirrored[:, number:, np.newaxis], whole[:, np.newaxis], in_view[:, np.newaxis])
            t, p, b = np.nonzero(planes[..., np.newaxis] & shown)
            pairs.append((t, number + p, b))
        found += [(t, a, np.full(len(t), light), b) for t, a, b in pairs]
    return Pairs(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _on_spheres(stacked: Stacked, light: int, lit: Truths, leaking: Truths) -> tuple[Indices, Indices, Indices]:
    """(scene, receiver, blocker) among spheres: near as seen from the light, and not proved to miss."""
    number, lights = stacked.spheres, stacked.lights
    useful = np.ones(lit.shape, dtype=bool)
    if stacked.normal is not None:
        height, error = stacked.light_heights
        above = height[:, light] > error[:, light]
        useful = ~(above[:, np.newaxis] & stacked.beyond_plane)
    if isinstance(stacked.scene.lights[light], DirectionalLight):
        place, reach = _across(stacked, light), stacked.radius
    else:
        away = stacked.center - stacked.at[:, light, np.newaxis]
        distance = norm(away)
        place = away / np.maximum(distance, 2.0**-1000)[..., np.newaxis]
        reach = cone_above(distance, stacked.radius)
    t, a, b = near_pairs_of_all(place, reach, lit, useful)
    missed = misses_sphere(stacked.flat, t * lights + light, t * number + a, t * number + b, leaking.reshape(-1))
    return t[~missed], a[~missed], b[~missed]


def _across(stacked: Stacked, light: int) -> Floats:
    """(T, N, 3): the centres seen along a directional light, two coordinates across it and a 0."""
    towards = stacked.at[:, light]
    first = np.zeros(towards.shape)
    first[np.arange(len(towards)), np.argmin(np.abs(towards), axis=1)] = 1.0
    first = np.cross(towards, first)
    first /= norm(first)[:, np.newaxis]
    basis = np.stack((first, np.cross(towards, first), np.zeros(towards.shape)), axis=2)
    return np.asarray(stacked.center @ basis)


# ---- on the plane


def _on_plane(stacked: Stacked, light: int) -> Truths:
    """(T, N): spheres that may darken a point of the plane: those between it and the light's height."""
    (height, error), radius = stacked.sphere_heights, stacked.radius
    up, up_error = (part[:, light, np.newaxis] for part in stacked.light_heights)
    slack = error + LENGTH * radius
    keep_above, keep_below = ~(height + radius < -slack), ~(height - radius > slack)
    if not isinstance(stacked.scene.lights[light], DirectionalLight):
        keep_above &= ~(height - radius - up > slack + up_error)
        keep_below &= ~(height + radius - up < -slack - up_error)
    return np.where(up > up_error, keep_above, np.where(up < -up_error, keep_below, True))


def _misses_window(stacked: Stacked, light: int) -> Truths:
    """(T, N): beyond one side of the window lies the sphere and all that it keeps the light from.

    See symrender_cg.plan.shadows: n.(C - E) < -R and n.(C - L) <= -R for an inward normal n of a side.
    """
    radius, m = stacked.radius, stacked.m
    found = np.zeros(radius.shape, dtype=bool)
    if stacked.slopes is None:
        return found
    count, ones = stacked.count, np.ones(stacked.count)
    zeros, (x, y) = np.zeros(count), stacked.slopes.T
    sides = ((ones, zeros, -x), (-ones, zeros, -x), (zeros, ones, -y), (zeros, -ones, -y), (zeros, zeros, -ones))
    directional = isinstance(stacked.scene.lights[light], DirectionalLight)
    away = stacked.center - stacked.at[:, light, np.newaxis]
    for side in sides:
        normal = np.stack(side, axis=1)
        length = norm(normal)[:, np.newaxis]
        place, size = np.einsum("tni,ti->tn", m, normal), norm(m) * length
        beyond = place + radius * length < -LENGTH * (size + radius * length)
        if directional:
            leads = -np.einsum("ti,ti->t", stacked.at[:, light], normal)[:, np.newaxis] < -LENGTH * length
        else:
            towards = np.einsum("tni,ti->tn", away, normal)
            leads = towards + radius * length < -LENGTH * (norm(away) + radius) * length
        found |= beyond & leads
    return found
