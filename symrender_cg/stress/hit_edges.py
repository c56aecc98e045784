"""The decisions of a first hit that lie near their border: outlines, depths that nearly coincide, the plane's horizon.

Comes in: rays and what they hit. Goes out: decisions for the walk to keep. Never done here: the hit itself. Of primary
rays disc = R^2 |D|^2 - |m x D|^2 is computed exactly: its rounding is as large as what half ulps move it by. Of two
spheres in one place half ulps decide which is seen.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from symrender_cg.reference.brute_rays import chord_of, length
from symrender_cg.stress.adjoint import Floats, Indices, Number, cross, dot, minus, unit
from symrender_cg.stress.shadow_edges import world_column

if TYPE_CHECKING:
    from symrender_cg.stress.sight import Ray, Walk

BEHIND = 1e-6
"""What lies behind the surface that is seen by more than that share of its distance decides nothing."""


def collect_hits(walk: Walk, ray: Ray, index: Indices, distance: Floats) -> None:
    """Keeps the decisions that made `index` and `distance` what they are (brute_rays.first_hit)."""
    world, plain = walk.world, ray.plain()
    doubt, spheres = walk.doubt or 0.0, len(world.radii)
    speed = length(plain.direction)
    kinds = np.append(world.kind, [spheres, -1])
    first: dict[object, int] = {}
    looks = np.array([first.setdefault(sphere, k) for k, sphere in enumerate(world.frame.spheres)] + [spheres, -1])
    for k, radius in enumerate(world.radii):
        chord = chord_of(world, plain, k)
        near = chord.near * speed
        counts = (chord.along > 0.0) & (near < distance * (1.0 + BEHIND)) & (kinds[ray.own] != world.kind[k])
        growth = ray.growth * (1.0 + length(chord.m) / radius)
        outline = np.where(counts, chord.disc / (radius * radius * chord.square) / growth, np.inf)
        chosen = np.flatnonzero(np.abs(outline) < doubt)
        if chosen.size:
            some = ray.some(chosen)
            primary = bool((some.own < 0).all())
            walk.collect(_disc(walk, some, k), outline[chosen], some.points, "outline", exact=primary)
        rival = counts & (chord.disc > 0.0) & (index >= 0) & (looks[index] != looks[k])
        depth = np.where(rival, (near - distance) / distance / growth, np.inf)
        chosen = np.flatnonzero(np.abs(depth) < doubt)
        if chosen.size:
            some = ray.some(chosen)
            gap = _depth(walk, some, np.full(chosen.size, k)) - _depth(walk, some, index[chosen])
            walk.collect(gap, depth[chosen], some.points, "depth")
    if world.plane is not None:
        fall = (world.plane.normal @ plain.direction) / speed / ray.growth
        horizon = np.where(((index < 0) | (index == spheres)) & (ray.own != spheres), fall, np.inf)
        chosen = np.flatnonzero(np.abs(horizon) < doubt)
        if chosen.size:
            some = ray.some(chosen)
            normal = unit(_plane_vector(walk, "normal", some.points))[0]
            walk.collect(dot(normal, some.direction), horizon[chosen], some.points, "horizon")


def _disc(walk: Walk, ray: Ray, k: int) -> Number:
    center = walk.vector("spheres[{}].center", world_column(walk.world.centers[k]), k, ray.points)
    radius = walk.tape.input("spheres[{}].radius", np.array(walk.world.radii[k]), k, ray.points)
    d = ray.direction
    c = cross(minus(minus(center, ray.base), ray.offset), d)
    disc = radius * radius * dot(d, d) - dot(c, c)
    if walk.suspects is not None:
        return disc
    exact = disc.value.copy()
    for at in np.flatnonzero(ray.own < 0).tolist():
        mx, my, mz = (Fraction(center[i].value[at]) - Fraction(ray.base[i].value[at]) for i in range(3))
        dx, dy, dz = (Fraction(d[i].value[at]) for i in range(3))
        a, b, g = my * dz - mz * dy, mz * dx - mx * dz, mx * dy - my * dx
        r = Fraction(radius.value[at])
        exact[at] = float(r * r * (dx * dx + dy * dy + dz * dz) - (a * a + b * b + g * g))
    return disc.made(exact, (disc, 1.0))


def _depth(walk: Walk, ray: Ray, index: Indices) -> Number:
    """t of the hit with the sphere of that index, or with the plane."""
    world = walk.world
    on_plane = index == len(world.radii)
    parts = []
    for which in (np.flatnonzero(~on_plane), np.flatnonzero(on_plane)):
        if not which.size:
            continue
        some = ray.some(which)
        if on_plane[which[0]]:
            normal = unit(_plane_vector(walk, "normal", some.points))[0]
            point = _plane_vector(walk, "point", some.points)
            t = dot(normal, minus(minus(point, some.base), some.offset)) / dot(normal, some.direction)
        else:
            center = walk.vector(
                "spheres[{}].center", np.array(world.centers)[index[which]].T, index[which], some.points
            )
            radii = np.array(world.radii)[index[which]]
            radius = walk.tape.input("spheres[{}].radius", radii, index[which], some.points)
            m = minus(minus(center, some.base), some.offset)
            c, square = cross(m, some.direction), dot(some.direction, some.direction)
            t = (dot(m, some.direction) - (radius * radius * square - dot(c, c)).root()) / square
        parts.append(t.placed(which, index.size))
    return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def _plane_vector(walk: Walk, name: str, points: Indices) -> tuple[Number, Number, Number]:
    plane = walk.world.frame.plane
    ground = walk.world.plane
    assert plane is not None, "the plane's vectors are asked for where there is one"
    assert ground is not None, "as above"
    rows = ground.point if name == "point" else np.array(plane.normal)
    return walk.vector(f"plane.{name}", world_column(rows), 0, points)
