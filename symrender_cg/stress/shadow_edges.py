"""Which points of surfaces see a light, and the shadow decisions among them that lie near their border.

Comes in: points of surfaces and the way to a light as Numbers. Goes out: 1 where the light is seen, else 0; decisions
for the walk to keep. Never done here: shading, or a sweep. A sphere blocks where, with m = C - P,
    R^2 - |m x l|^2 >= 0  and  m.l > 0  and  (m.l < d or the light is inside)
and the plane where it parts the point from the light. Of these parts one decides at a point if all others hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symrender_cg.reference.brute_rays import Ground, World, dot, from_to, length
from symrender_cg.scene import DirectionalLight, PointLight
from symrender_cg.stress import adjoint
from symrender_cg.stress.adjoint import (
    Floats,
    Indices,
    Mask,
    Number,
    Triple,
    cross,
    minus,
    plus,
    sum_of,
    take,
    unit,
    values,
)

if TYPE_CHECKING:
    from symrender_cg.stress.sight import Walk


@dataclass(frozen=True, slots=True)
class Surface:
    """Points base + offset of surfaces. index: of the surface; material: its row of the world's materials; points:
    places in the chunk; normal: of length 1; reach: the length that roundings of the offset are relative to; growth:
    about how many roundings the normal may be off."""

    index: Indices
    material: Indices
    points: Indices
    base: Triple
    offset: Triple
    normal: Triple
    reach: Floats
    growth: Floats

    def to(self, place: Triple) -> Triple:
        """place - (base + offset), its value with what the subtractions round off added again."""
        rounded = minus(minus(place, self.base), self.offset)
        first, rest = sum_of(values(place), -values(self.base))
        second, more = sum_of(first, -values(self.offset))
        x, y, z = (part.made(second[i] + (rest[i] + more[i]), (part, 1.0)) for i, part in enumerate(rounded))
        return x, y, z

    def some(self, chosen: Indices) -> Surface:
        """The same of some of the points."""
        return Surface(
            self.index[chosen],
            self.material[chosen],
            self.points[chosen],
            take(self.base, chosen),
            take(self.offset, chosen),
            take(self.normal, chosen),
            self.reach[chosen],
            self.growth[chosen],
        )


def visible(
    walk: Walk,
    seen: Surface,
    l_hat: Triple,
    distance: Number,
    number: int,
    light: PointLight | DirectionalLight,
    matters: Mask,
) -> Floats:
    """1 where neither a sphere nor the plane stands before the light, else 0; decisions are kept where it matters."""
    world = walk.world
    margins = [_blocker_margins(world, seen, values(l_hat), distance.value, k, light) for k in range(len(world.radii))]
    apart = _parting_margins(world, seen, light)
    blocked = [m.min(axis=0) for m in (*margins, *([] if apart is None else [apart]))]
    shown = np.where(np.array(blocked).max(axis=0, initial=-np.inf) >= 0.0, 0.0, 1.0)
    if walk.doubt is None:
        return shown
    sure = sum((margin > walk.doubt).astype(np.int64) for margin in blocked)
    for k, parts in enumerate(margins):
        alone = matters & (sure - (blocked[k] > walk.doubt) == 0)
        chosen = np.flatnonzero(alone & (np.abs(blocked[k]) < walk.doubt))
        if chosen.size:
            _collect_blocker(walk, seen.some(chosen), take(l_hat, chosen), distance.take(chosen), k, parts[:, chosen])
    if apart is not None:
        alone = matters & (sure - (blocked[-1] > walk.doubt) == 0)
        chosen = np.flatnonzero(alone & (np.abs(blocked[-1]) < walk.doubt))
        if chosen.size:
            _collect_parting(walk, seen.some(chosen), number, light, apart[:, chosen])
    return shown


def _blocker_margins(
    world: World, seen: Surface, l_hat: Floats, distance: Floats, k: int, light: PointLight | DirectionalLight
) -> Floats:
    """(3, n): meets, ahead, reached, each over what it compares and the growth; -inf for the sphere of the point."""
    radius = world.radii[k]
    first, rest = from_to(values(seen.base), values(seen.offset), world.centers[k])
    m = first + rest
    c, along, far = np.cross(m, l_hat, axis=0), dot(m, l_hat), length(m)
    meets = (radius * radius - dot(c, c)) / (radius * radius) / (1.0 + far / radius)
    reached = np.full(along.shape, np.inf)
    if isinstance(light, PointLight):
        depth = math.dist(world.centers[k], np.array(light.position) / world.scale)
        inside = np.inf if depth < radius else -np.inf
        reached = np.maximum(inside, (distance - along) / distance)
    margins = np.array([meets, along / far, reached]) / seen.growth
    margins[:, seen.index == k] = -np.inf
    return margins


def _collect_blocker(walk: Walk, seen: Surface, l_hat: Triple, distance: Number, k: int, parts: Floats) -> None:
    center = walk.vector("spheres[{}].center", world_column(walk.world.centers[k]), k, seen.points)
    radius = walk.tape.input("spheres[{}].radius", np.array(walk.world.radii[k]), k, seen.points)
    m = seen.to(center)
    c, along = cross(m, l_hat), adjoint.dot(m, l_hat)
    names = ("shadow's outline", "shadow at the blocker's side", "light at the blocker")
    for part, margin in enumerate((radius * radius - adjoint.dot(c, c), along, distance - along)):
        others = np.delete(parts, part, axis=0).min(axis=0)
        walk.collect(margin, np.where(others > -(walk.doubt or 0.0), parts[part], np.inf), seen.points, names[part])


def _parting_margins(world: World, seen: Surface, light: PointLight | DirectionalLight) -> Floats | None:
    """(2, n): the point on the eye's side of the plane, the light on the other; None on the plane, or without one."""
    plane = world.plane
    if plane is None:
        return None
    base = plane.normal @ (values(seen.base) - plane.point[:, np.newaxis])
    above = (base + plane.normal @ values(seen.offset)) / (np.abs(base) + seen.reach)
    below = np.full(above.shape, _below(plane, world, light))
    margins = np.array([above / seen.growth, np.where(below == 0.0, -np.inf, below)])
    margins[:, seen.index == len(world.radii)] = -np.inf
    return margins


def _below(plane: Ground, world: World, light: PointLight | DirectionalLight) -> float:
    """How far the light is behind the plane, over what that is the difference of."""
    if isinstance(light, DirectionalLight):
        direction = np.array(light.direction)
        return float(plane.normal @ direction) / float(np.abs(direction).max())
    away = np.array(light.position) / world.scale - plane.point
    return -float(plane.normal @ away) / max(float(np.abs(away).max()), 1e-300)


def _collect_parting(
    walk: Walk, seen: Surface, number: int, light: PointLight | DirectionalLight, parts: Floats
) -> None:
    world, plane = walk.world, walk.world.frame.plane
    ground = world.plane
    assert plane is not None, "only a plane parts points from lights"
    assert ground is not None, "as above"
    point = walk.vector("plane.point", world_column(ground.point), 0, seen.points)
    normal = unit(walk.vector("plane.normal", world_column(np.array(plane.normal)), 0, seen.points))[0]
    sign = 1.0 if float(ground.normal @ np.array(plane.normal)) > 0.0 else -1.0
    above = adjoint.dot(normal, plus(minus(seen.base, point), seen.offset)) * sign
    if isinstance(light, PointLight):
        position = world_column(np.array(light.position) / world.scale)
        away = minus(walk.vector(f"lights[{number}].position", position, 0, seen.points), point)
        below = adjoint.dot(normal, away) * -sign
    else:
        direction = walk.vector(f"lights[{number}].direction", world_column(np.array(light.direction)), 0, seen.points)
        below = adjoint.dot(normal, direction) * sign
    for part, margin in enumerate((above, below)):
        near = np.where(parts[1 - part] > -(walk.doubt or 0.0), parts[part], np.inf)
        walk.collect(margin, near, seen.points, "light behind the plane")


def world_column(v: Floats) -> Floats:
    """(3,) as (3, 1), the same for every point."""
    return np.asarray(v, dtype=np.float64)[:, np.newaxis]
