"""What may be seen in what, in many scenes at once: symrender_cg.plan.mirrors, with an axis of scenes.

Comes in: Stacked, and what the eye sees. Goes out: StackMirrors. Never done here: shading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symrender_cg.plan.measures import LENGTH, Indices, Truths, norm
from symrender_cg.plan.mirrors import below_horizon
from symrender_cg.plan.stack_measures import Stacked
from symrender_cg.plan.stack_nearby import all_true
from symrender_cg.plan.stack_views import StackViews, beyond_side


@dataclass(frozen=True, eq=False)
class StackMirrors:
    """Of T scenes; a receiver is a sphere, then a material of the plane, N + P of them.

    seen (T, N + P, N): the sphere may be seen in the receiver; plane, mirror, mirrored (T, N + P): the plane may be
    seen in it; it adds anything; it may itself be seen in a mirror. bounces (T,): depth that can matter.
    """

    seen: Truths
    plane: Truths
    mirror: Truths
    mirrored: Truths
    bounces: Indices


def find_all_mirrors(stacked: Stacked, views: StackViews) -> StackMirrors:
    """What may be seen in the mirrors of each scene."""
    count, number, limit = stacked.count, stacked.spheres, stacked.scene.max_bounces
    receivers = number + stacked.planes
    kept = np.concatenate((np.ones((count, number), dtype=bool), views.kept), axis=1)
    reflects = (stacked.stack.reflect > 0.0) & kept
    first = np.concatenate((views.visible, views.kept & views.plane_seen[:, np.newaxis]), axis=1) & reflects
    seen = np.zeros((count, receivers, number), dtype=bool)
    mirrored, nobody = (np.zeros((count, receivers), dtype=bool) for _ in range(2))
    if limit == 0 or not first.any():
        return StackMirrors(seen, nobody, nobody, mirrored, np.zeros(count, dtype=np.int64))

    candidates = ~views.nowhere
    itself = np.eye(receivers, number, dtype=bool)
    _see_from_eye(stacked, first[:, :number], candidates, seen)
    if stacked.planes:
        seen[:, number:] = first[:, number:, np.newaxis] & _seen_in_plane(stacked, candidates)[:, np.newaxis]
    looks = first.copy()
    every = candidates[:, np.newaxis] & ~itself
    while True:
        before = int(mirrored.sum())
        mirrored[:, :number] |= seen.any(axis=1)
        if stacked.planes:
            mirrored[:, number:] |= looks[:, :number].any(axis=1, keepdims=True) & views.kept
        if limit > 1:
            again = mirrored & reflects
            looks |= again
            seen = np.where(again[..., np.newaxis], every, seen)
        if int(mirrored.sum()) == before:
            break

    plane = np.zeros((count, receivers), dtype=bool)
    plane[:, :number] = stacked.normal is not None
    mirror = looks & (seen.any(axis=2) | plane | ~_is_black(stacked)[:, np.newaxis])
    bounces = _depths(seen, mirror, first, plane & mirror, views.kept, limit)
    return StackMirrors(seen & mirror[..., np.newaxis], plane & mirror, mirror, mirrored, bounces)


def _is_black(stacked: Stacked) -> Truths:
    """(T,): the background is 0 in every direction."""
    background = stacked.stack.background
    if background is None:
        return np.full(stacked.count, stacked.flat.black_background)
    return np.asarray((background == 0.0).all(axis=1))


def _see_from_eye(stacked: Stacked, chosen: Truths, candidates: Truths, seen: Truths) -> None:
    """Marks in `seen` the spheres that may be seen in each of the chosen ones (T, N) from the eye."""
    number = stacked.spheres
    t, a, b = all_true(chosen[:, :, np.newaxis] & candidates[:, np.newaxis] & ~np.eye(number, dtype=bool))
    above = ~below_horizon(stacked.flat, t * number + a, t * number + b)
    seen[t[above], a[above], b[above]] = True


def _seen_in_plane(stacked: Stacked, candidates: Truths) -> Truths:
    """(T, N): the spheres whose mirror image in the plane may be in view."""
    assert stacked.normal is not None, "there is a plane"
    assert stacked.point is not None, "there is a plane"
    height, _ = stacked.sphere_heights
    m, radius = stacked.m, stacked.radius
    image = m - 2.0 * height[..., np.newaxis] * stacked.normal[:, np.newaxis]
    # the image is off by roundings of lengths to the plane's point and the eye: its ball is taken that much larger
    size = norm(stacked.center - stacked.point[:, np.newaxis]) + norm(m)
    larger = radius + 4.0 * LENGTH * size
    keep = candidates & ~(-image[..., 2] < -larger)
    if stacked.slopes is not None:
        for axis in (0, 1):
            keep &= ~beyond_side(image, larger, stacked.slopes[:, axis, np.newaxis], axis)
    return keep


def _depths(seen: Truths, mirror: Truths, first: Truths, plane: Truths, kept: Truths, limit: int) -> Indices:
    """(T,): length of the longest chain of mirrors, at most `limit`."""
    number = seen.shape[2]
    level, depth = first & mirror, np.zeros(len(seen), dtype=np.int64)
    going = level.any(axis=1)
    for _ in range(limit):
        if not going.any():
            break
        depth[going] += 1
        following = np.zeros_like(level)
        following[:, :number] = (level[..., np.newaxis] & seen).any(axis=1)
        following[:, number:] = (level & plane).any(axis=1, keepdims=True) & kept
        following &= mirror
        steady = going & (following == level).all(axis=1)
        depth[steady] = limit
        going &= ~steady & following.any(axis=1)
        level = following
    return depth
