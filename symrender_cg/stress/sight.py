"""The value of a scene along rays as numbers that know their derivatives, and the decisions that it rests on.

Comes in: a camera-frame scene as brute_rays.World, points of the image plane. Goes out: a Number for each channel; and,
when asked for, each decision that lies within `doubt` of its border: a Number whose sign it is. Never done here: a
backward sweep. The decisions are those of reference.brute_force, and so are the formulas:

    normal       (c x D - sqrt(disc) D) / (R |D|^2),  c = m x D,  disc = R^2 |D|^2 - |c|^2
    mirrored     M = D - 2 (n.D) n
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from symrender_cg.reference.brute_rays import Rays, World, first_hit
from symrender_cg.scene import Gradient
from symrender_cg.stress.adjoint import (
    Floats,
    Indices,
    Mask,
    Number,
    Tape,
    Triple,
    cross,
    dot,
    minus,
    over,
    scaled,
    take,
    unit,
    values,
)
from symrender_cg.stress.hit_edges import collect_hits
from symrender_cg.stress.light_terms import MOST_GROWTH, lit
from symrender_cg.stress.shadow_edges import Surface


@dataclass(frozen=True, slots=True)
class Decision:
    """margin >= 0 decides what is computed; the points of the chunk that it decides for, in the margin's order; what it
    decides; whether its value is exact."""

    margin: Number
    points: Indices
    what: str
    exact: bool


@dataclass(slots=True)
class Walk:
    """One chunk of points on its way through a scene.

    doubt: None where decisions are of no interest, else how near to its border, relative to what it compares and to the
    growth of roundings on the way, a decision is collected. suspects: an array to mark those points in, instead of
    keeping the decisions.
    """

    world: World
    tape: Tape
    x: Floats
    y: Floats
    doubt: float | None = None
    suspects: Mask | None = None
    decisions: list[Decision] = field(default_factory=list)

    def collect(self, margin: Number, near: Floats, points: Indices, what: str, *, exact: bool = False) -> None:
        """Keeps a decision for those points at which `near`, its margin over what it compares, is small."""
        if self.doubt is None:
            return
        chosen = np.flatnonzero(np.abs(near) < self.doubt)
        if self.suspects is not None:
            self.suspects[points[chosen]] = True
        elif chosen.size:
            self.decisions.append(Decision(margin.take(chosen), points[chosen], what, exact))

    def vector(self, place: str, rows: Floats, index: Indices | int, points: Indices) -> Triple:
        """Three inputs, place[0] .. place[2]; rows: (3, n) or (3, 1)."""
        x, y, z = (self.tape.input(f"{place}[{axis}]", rows[axis], index, points) for axis in range(3))
        return x, y, z


@dataclass(frozen=True, slots=True)
class Ray:
    """From base + offset along direction; own: the surface it leaves, -1 the eye; points: places in the chunk; growth:
    about how many roundings its direction may be off."""

    base: Triple
    offset: Triple
    direction: Triple
    own: Indices
    points: Indices
    growth: Floats

    def some(self, chosen: Indices) -> Ray:
        """The same of some of the rays."""
        return Ray(
            take(self.base, chosen),
            take(self.offset, chosen),
            take(self.direction, chosen),
            self.own[chosen],
            self.points[chosen],
            self.growth[chosen],
        )

    def plain(self) -> Rays:
        """The same in floats, without a history of roundings."""
        zeros = np.zeros(self.own.size)
        return Rays(values(self.base), values(self.offset), values(self.direction), self.own, zeros, zeros)


def look(walk: Walk) -> tuple[list[Number], Indices]:
    """(a Number a channel, index of the surface seen or -1) of all points of the chunk."""
    count = walk.x.size
    every = np.arange(count)
    x, y = (walk.tape.input(name, given / walk.world.scale, 0, every) for name, given in (("x", walk.x), ("y", walk.y)))
    eye = walk.tape.input("eye", walk.world.eye[2], 0, every)
    nothing = x.made(np.zeros(count))
    ray = Ray(
        (nothing, nothing, eye), (nothing, nothing, nothing), (x, y, -eye), np.full(count, -1), every, np.ones(count)
    )
    return _look(walk, ray, walk.world.frame.max_bounces)


def _look(walk: Walk, ray: Ray, bounces: int) -> tuple[list[Number], Indices]:
    """colour(ray, bounces): the background, or ambient + light by light + reflect colour(mirrored, bounces - 1)"""
    world, count = walk.world, ray.own.size
    index, distance, _ = first_hit(world, ray.plain())
    if walk.doubt is not None:
        collect_hits(walk, ray, index, distance)
    missed = np.flatnonzero(index < 0)
    sums = [number.placed(missed, count) for number in _background(walk, ray.some(missed))]
    spheres = len(world.radii)
    for on_plane in (False, True):
        chosen = np.flatnonzero(index == spheres if on_plane else (index >= 0) & (index < spheres))
        if chosen.size:
            some = ray.some(chosen)
            seen = _plane_point(walk, some) if on_plane else _sphere_point(walk, some, index[chosen])
            shaded = _shade(walk, seen, some.direction, bounces)
            sums = [total + part.placed(chosen, count) for total, part in zip(sums, shaded, strict=True)]
    return sums, index


def _background(walk: Walk, ray: Ray) -> list[Number]:
    """The constant, or bottom (1 - s) + top s with s = (1 + up.D / (|up| |D|)) / 2."""
    world, points, background = walk.world, ray.points, walk.world.frame.background
    channels = range(world.channels)
    if not isinstance(background, Gradient):
        colour = world.colour(background)
        return [walk.tape.input(f"background[{k}]", colour[k], 0, points) for k in channels]
    up = walk.vector("background.up", np.array(background.up)[:, np.newaxis], 0, points)
    s = (dot(unit(up)[0], unit(ray.direction)[0]) + 1.0) * 0.5
    found = []
    for k in channels:
        bottom, top = (
            walk.tape.input(f"background.{name}[{k}]", world.colour(colour)[k], 0, points)
            for name, colour in (("bottom", background.bottom), ("top", background.top))
        )
        found.append(bottom + (top - bottom) * s)
    return found


# ------------------------------------------------------------------------------------------------- points of surfaces


def _sphere_point(walk: Walk, ray: Ray, index: Indices) -> Surface:
    world = walk.world
    center = walk.vector("spheres[{}].center", np.array(world.centers)[index].T, index, ray.points)
    radius = walk.tape.input("spheres[{}].radius", np.array(world.radii)[index], index, ray.points)
    d = ray.direction
    c = cross(minus(minus(center, ray.base), ray.offset), d)
    square = dot(d, d)
    root = (radius * radius * square - dot(c, c)).root()
    normal = over(minus(cross(c, d), scaled(d, root)), square * radius)
    reach = np.array(world.radii)[index]
    away = np.abs(values(center) - values(ray.base)).max(axis=0)
    growth = _grown(ray.growth * (1.0 + 2.0 * away / reach), root.value / np.sqrt(square.value) / reach)
    return Surface(index, index, ray.points, center, scaled(normal, radius), normal, reach, growth)


def _plane_point(walk: Walk, ray: Ray) -> Surface:
    """The point where n.(X - point) = 0, kept as the plane's point and what is left; tiles choose the material."""
    world, plane = walk.world, walk.world.frame.plane
    ground = world.plane
    assert plane is not None, "an index beyond the spheres is the plane's"
    assert ground is not None, "as above"
    point = walk.vector("plane.point", ground.point[:, np.newaxis], 0, ray.points)
    given = walk.vector("plane.normal", np.array(plane.normal)[:, np.newaxis], 0, ray.points)
    upwards = unit(given)[0]
    normal = scaled(upwards, 1.0 if float(ground.normal @ np.array(plane.normal)) > 0.0 else -1.0)
    towards = minus(minus(point, ray.base), ray.offset)
    t = dot(normal, towards) / dot(normal, ray.direction)
    away = minus(scaled(ray.direction, t), towards)
    index = np.full(ray.own.size, len(world.radii))
    material = index.copy()
    if not ground.plain:
        axis = walk.vector("plane.axis", np.array(plane.axis)[:, np.newaxis], 0, ray.points)
        across = unit(minus(axis, scaled(upwards, dot(axis, upwards))))[0]
        side = walk.tape.input("plane.tile", np.array(plane.tile / world.scale), 0, ray.points)
        odd = np.zeros(material.shape)
        for direction in (across, cross(upwards, across)):
            tile = dot(direction, away) / side
            odd += np.floor(tile.value)
            off = tile - np.round(tile.value)
            walk.collect(off, off.value / (1.0 + np.abs(tile.value)) / ray.growth, ray.points, "tile")
        material += (odd % 2.0 != 0.0).astype(np.int64)
    reach = np.abs(values(away)).max(axis=0)
    fall = np.abs(dot(normal, unit(ray.direction)[0]).value)
    return Surface(index, material, ray.points, point, away, normal, reach, _grown(ray.growth, fall))


def _grown(growth: Floats, cosine: Floats) -> Floats:
    """Errors across a ray become errors along a surface: over the cosine; MOST_GROWTH where there is no end to it."""
    return np.minimum(growth / np.maximum(cosine, 1.0 / MOST_GROWTH), MOST_GROWTH)


# --------------------------------------------------------------------------------------------------------- their light


def _shade(walk: Walk, seen: Surface, direction: Triple, bounces: int) -> list[Number]:
    """ambient + sum over lights of share intensity (k_d max(0, n.l) + k_s max(0, r.v)^n) + reflect (mirrored ray)"""
    world, points, material = walk.world, seen.points, seen.material
    channels = range(world.channels)
    ahead = unit(direction)[0]
    mirrored = minus(ahead, scaled(seen.normal, dot(seen.normal, ahead) * 2.0))
    names = ("ambient", "diffuse", "specular")
    k_ambient, k_diffuse, k_specular = (
        [walk.tape.input(f"{{}}.{name}[{k}]", getattr(world, name)[material, k], material, points) for k in channels]
        for name in names
    )
    shininess = walk.tape.input("{}.shininess", world.shininess[material], material, points)
    sums = k_ambient
    for number, light in enumerate(world.frame.lights):
        n_dot_l, power, share, shown = lit(walk, seen, mirrored, shininess, number, light)
        colour = world.colour(light.intensity)
        for k in channels:
            intensity = walk.tape.input(f"lights[{number}].intensity[{k}]", colour[k], 0, points)
            surface = k_diffuse[k] * n_dot_l + k_specular[k] * power
            sums[k] = sums[k] + intensity * share * surface * shown
    mirrors = np.flatnonzero(world.reflect[material] > 0.0)
    if bounces > 0 and mirrors.size:
        reflect = walk.tape.input("{}.reflect", world.reflect[material[mirrors]], material[mirrors], points[mirrors])
        ray = Ray(
            take(seen.base, mirrors),
            take(seen.offset, mirrors),
            take(mirrored, mirrors),
            seen.index[mirrors],
            points[mirrors],
            seen.growth[mirrors],
        )
        beyond, _ = _look(walk, ray, bounces - 1)
        sums = [total + (reflect * part).placed(mirrors, points.size) for total, part in zip(sums, beyond, strict=True)]
    return sums
