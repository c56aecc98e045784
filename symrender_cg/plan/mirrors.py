"""What may be seen in what: spheres and the plane in mirrors, and how many bounces can matter.

Comes in: Measures, and what the eye may see. Goes out: Mirrors. Never done here: shading.

B is seen in A, from the eye, only if part of it is above the tangent plane of some visible point of A: left out where
    psi_B - phi_E > acos((R_A - R_B) / |C_B - C_A|)
with psi_B the angle at C_A between eye and C_B. In the plane, only if its mirror image is in the window. A surface that
is itself seen in a mirror sees whatever no other sphere contains and the plane does not cut off. No sphere mirrors
itself (it is convex), nor does a plane. A mirror that sees nothing but a background of 0 is none.
The depth is the longest chain eye, mirror, mirror, ... whose links may see one another, at most max_bounces.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import numpy as np

from symrender_cg.plan.measures import (
    ANGLE,
    LENGTH,
    Floats,
    Indices,
    Measures,
    Truths,
    angle,
    cap_above,
    narrow,
    norm,
    wide,
)
from symrender_cg.plan.visibility import outside_window

_BATCH: Final = 1 << 20


@dataclass(frozen=True)
class Mirrors:
    """seen[r] = indices of spheres seen in receiver r; plane (receivers,): the plane may be; mirror (receivers,): adds
    anything; mirrored (receivers,): may itself be seen in a mirror; bounces: depth that can matter."""

    seen: dict[int, Indices]
    plane: Truths
    mirror: Truths
    mirrored: Truths
    bounces: int


def find_mirrors(
    measures: Measures,
    visible: Truths,
    plane_seen: bool,
    nowhere: Truths,
    aspect: float | None,
    limit: int,
    force: Collection[str] = (),
) -> Mirrors:
    """visible, nowhere (N,): spheres that the eye may see, and those that no ray from outside can meet.

    limit: bounces asked for."""
    count = measures.count
    receivers = count + len(measures.plane_materials)
    materials = [measures.materials[k].reflect for k in measures.material]
    materials += [material.reflect for material in measures.plane_materials]
    reflects = np.array(materials, dtype=np.float64) > 0.0
    forced = "mirror" in force
    if forced:
        reflects[:] = True
    has_plane = measures.plane is not None
    candidates = np.arange(count) if forced else np.flatnonzero(~nowhere)

    first = np.zeros(receivers, dtype=bool)
    first[:count] = visible
    first[count:] = plane_seen
    first &= reflects
    mirrored = np.zeros(receivers, dtype=bool)
    if forced:
        mirrored[:] = True
    seen: dict[int, Indices] = {}
    if limit == 0 or not first.any():
        nobody = np.zeros(receivers, dtype=bool)
        return Mirrors(seen, nobody, nobody, nobody.copy(), 0)

    if forced:
        seen.update((int(r), candidates[candidates != r]) for r in np.flatnonzero(first))
    else:
        seen.update(_seen_from_eye(measures, np.flatnonzero(first[:count]), candidates))
        seen.update(
            (int(r), _seen_in_plane(measures, candidates, aspect)) for r in np.flatnonzero(first[count:]) + count
        )
    while True:
        mirrored_before = int(mirrored.sum())
        for receiver, others in seen.items():
            mirrored[others] = True
            if has_plane and receiver < count:
                mirrored[count:] = True
        again = np.flatnonzero(mirrored & reflects) if limit > 1 else np.empty(0, dtype=np.int64)
        seen.update((int(r), candidates[candidates != r]) for r in again)
        if int(mirrored.sum()) == mirrored_before:
            break

    plane = np.zeros(receivers, dtype=bool)
    plane[:count] = has_plane
    adds = np.array([bool(seen[r].size) if r in seen else False for r in range(receivers)]) | plane
    adds |= not measures.black_background
    mirror = np.zeros(receivers, dtype=bool)
    mirror[list(seen)] = True
    mirror &= adds | forced
    bounces = limit if forced or "mirror_depth" in force else _depth(seen, mirror, first, plane, count, limit)
    seen = {r: others for r, others in sorted(seen.items()) if mirror[r]}
    return Mirrors(seen, plane & mirror, mirror, mirrored, bounces if mirror.any() else 0)


def _depth(seen: dict[int, Indices], mirror: Truths, first: Truths, plane: Truths, count: int, limit: int) -> int:
    """Length of the longest chain of mirrors, at most `limit`."""
    level, depth = first & mirror, 0
    while depth < limit and level.any():
        depth += 1
        following = np.zeros_like(level)
        for receiver in np.flatnonzero(level):
            following[seen[int(receiver)]] = True
            if plane[receiver]:
                following[count:] = True
        following &= mirror
        if bool((following == level).all()):
            return limit
        level = following
    return depth


def _seen_from_eye(measures: Measures, chosen: Indices, candidates: Indices) -> dict[int, Indices]:
    """The spheres that may be seen in each of the chosen ones from the eye."""
    result: dict[int, Indices] = {}
    if not chosen.size:
        return result
    step = max(1, _BATCH // max(1, len(candidates)))
    for begin in range(0, len(chosen), step):
        some = chosen[begin : begin + step]
        below = below_horizon(measures, some[:, np.newaxis], candidates[np.newaxis, :])
        below |= some[:, np.newaxis] == candidates
        for row, receiver in enumerate(some):
            result[int(receiver)] = candidates[~below[row]]
    return result


def below_horizon(measures: Measures, a: Indices, b: Indices) -> Truths:
    """Sphere b is below the tangent plane of every point of sphere a that the eye sees; a and b broadcast."""
    to_eye = -measures.m[a]
    between = measures.center[b] - measures.center[a]
    gap = norm(between)
    less = measures.radius[a] - measures.radius[b]
    farther = np.where(less > 0.0, wide(gap), narrow(gap))
    root = np.sqrt(np.maximum(farther - less, 0.0) * np.maximum(farther + less, 0.0))
    horizon = np.arctan2(root, less)
    psi = angle(np.broadcast_to(to_eye, between.shape), between)
    return np.asarray(psi - cap_above(measures.distance[a], measures.radius[a]) > horizon + ANGLE)


def _seen_in_plane(measures: Measures, candidates: Indices, aspect: float | None) -> Indices:
    """The spheres whose mirror image in the plane may be in view."""
    assert measures.normal is not None, "there is a plane"
    height, _ = measures.sphere_heights
    m, radius = measures.m[candidates], measures.radius[candidates]
    image: Floats = m - 2.0 * height[candidates, np.newaxis] * measures.normal
    # the image is off by roundings of lengths to the plane's point and the eye: its ball is taken that much larger
    assert measures.point is not None, "a plane has a point"
    size = norm(measures.center[candidates] - measures.point) + norm(m)
    larger = radius + 4.0 * LENGTH * size
    keep = ~(-image[:, 2] < -larger)
    if aspect is not None:
        keep &= ~outside_window(measures, image, larger, aspect)
    return candidates[keep]
