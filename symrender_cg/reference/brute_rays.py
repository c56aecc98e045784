"""Rays of the brute-force reference: the scene's numbers, lines against spheres and the plane, the first hit; numpy.

Comes in: a camera-frame Scene, rays as arrays of shape (3, n). Goes out: World, Rays, Chord; which surface each ray
meets first, how far away, and the margin of that decision (see brute_force, whose rays these are). Never done here:
shading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.scene import Phong, Plane, Scene

Floats: TypeAlias = npt.NDArray[np.float64]
Indices: TypeAlias = npt.NDArray[np.int64]

LEAST_COSINE: Final = 1e-9
"""Stands for the cosine of a ray that touches a sphere, where errors grow without a limit."""


class World:
    """The camera-frame scene with its lengths over 2^k of the eye's distance, so that squares stay in range."""

    def __init__(self, frame: Scene) -> None:
        self.frame = frame
        self.scale = math.ldexp(1.0, math.frexp(frame.camera.eye[2])[1])
        self.channels: int = frame.channels
        self.eye = np.array(frame.camera.eye) / self.scale
        self.centers = [np.array(sphere.center) / self.scale for sphere in frame.spheres]
        self.radii = [sphere.radius / self.scale for sphere in frame.spheres]
        first: dict[object, int] = {}
        self.kind = np.array(
            [first.setdefault((sphere.center, sphere.radius), k) for k, sphere in enumerate(frame.spheres)], dtype=int
        )  # the lowest index of a sphere with the same centre and radius
        self.plane = None if frame.plane is None else Ground(frame.plane, self)
        materials: list[Phong] = [sphere.material for sphere in frame.spheres]
        if frame.plane is not None:
            materials += [frame.plane.material, frame.plane.checker or frame.plane.material]
        self.ambient, self.diffuse, self.specular = (
            np.array([self.colour(getattr(m, name)) for m in materials]).reshape(-1, self.channels)
            for name in ("ambient", "diffuse", "specular")
        )
        self.shininess = np.array([m.shininess for m in materials])
        self.gated = np.array([m.gate_specular for m in materials], dtype=bool)
        self.reflect = np.array([m.reflect for m in materials])

    def colour(self, value: float | tuple[float, float, float]) -> Floats:
        """(channels,)"""
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (self.channels,))


class Ground:
    """n.(X - point) = 0 with n towards the eye, and the two axes of its tiles over the side of a tile."""

    def __init__(self, plane: Plane, world: World) -> None:
        self.point = np.array(plane.point) / world.scale
        given = unit(np.array(plane.normal))
        self.eye_height = float(given @ (world.eye - self.point))
        self.normal = given if self.eye_height > 0.0 else -given
        axis = unit(np.array(plane.axis))
        across = unit(axis - (axis @ given) * given)
        tile = plane.tile / world.scale
        self.tiles = np.array([across, np.cross(given, across)]) / tile
        self.tile = tile
        self.plain = plane.checker is None or plane.checker == plane.material


def unit(v: Floats) -> Floats:
    v = v / np.abs(v).max()
    return np.asarray(v / math.sqrt(float(v @ v)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Rays:
    """From base + offset along direction, each (3, n).

    own: index of the surface that the ray leaves, -1 the eye. blur, turn: how far off the origin (a length) and the
    direction (an angle) may be, in roundings.
    """

    base: Floats
    offset: Floats
    direction: Floats
    own: Indices
    blur: Floats
    turn: Floats

    def where(self, chosen: Indices) -> Rays:
        return Rays(
            self.base[:, chosen],
            self.offset[:, chosen],
            self.direction[:, chosen],
            self.own[chosen],
            self.blur[chosen],
            self.turn[chosen],
        )


# ----------------------------------------------------------------------------------------------------- first hit


def first_hit(world: World, rays: Rays) -> tuple[Indices, Floats, Floats]:
    """(index, distance, doubt): the nearest surface, the lowest index where several are equally near."""
    count, spheres = rays.own.size, len(world.radii)
    surfaces = spheres + (world.plane is not None)
    if surfaces == 0:
        return np.full(count, -1), np.full(count, np.inf), np.full(count, np.inf)
    near = np.empty((surfaces, count))  # distance of the hit, or of the foot point where there is none
    slip = np.empty((surfaces, count))  # how far off it may be, in roundings
    sure = np.empty((surfaces, count))  # margin of the hit
    speed = length(rays.direction)
    left = rays.own == np.arange(surfaces)[:, np.newaxis]  # the surface that the ray leaves, and its doubles
    if spheres:
        mirrored = np.flatnonzero((rays.own >= 0) & (rays.own < spheres))
        left[:spheres, mirrored] = world.kind[:, np.newaxis] == world.kind[rays.own[mirrored]]
    for k in range(spheres):
        chord = chord_of(world, rays, k)
        lateral = rays.blur + rays.turn * length(chord.m) + world.radii[k]
        sure[k] = np.where(
            left[k],
            -np.inf,
            np.minimum(
                chord.disc / (world.radii[k] ** 2 * chord.square) / (lateral / world.radii[k]),
                chord.along / (length(chord.m) * speed) / (1.0 + rays.turn + rays.blur / length(chord.m)),
            ),
        )
        near[k] = chord.near * speed
        slip[k] = length(chord.m) + lateral / chord.cosine(world.radii[k])
    if world.plane is not None:
        height, fall = above(world.plane, rays), -(world.plane.normal @ rays.direction) / speed
        sure[spheres] = np.where(left[spheres], -np.inf, fall / (1.0 + rays.turn))
        near[spheres] = height / fall
        slip[spheres] = (rays.blur + (1.0 + rays.turn) * np.abs(near[spheres])) / np.abs(fall)
    found = np.where(sure >= 0.0, near, np.inf)
    if world.plane is not None:
        found[spheres][sure[spheres] == 0.0] = np.inf  # a ray in the plane's direction never meets it
    index = np.argmin(found, axis=0)
    every = np.arange(count)
    distance = found[index, every]
    index = np.where(distance < np.inf, index, -1)

    depth = np.where(index < 0, np.inf, distance)
    gap = (near - depth) / (np.abs(depth) + slip + np.where(index < 0, 0.0, slip[index, every]))
    rival = np.where(index < 0, sure, np.minimum(sure, -gap))
    rival[index, every] = np.where(index < 0, rival[index, every], -np.inf)
    rival[left] = -np.inf
    if spheres:
        among = np.flatnonzero((index >= 0) & (index < spheres))
        same = world.kind[:, np.newaxis] == world.kind[index[among]]
        rival[:spheres, among] = np.where(same, -np.inf, rival[:spheres, among])
    own = np.where(index < 0, np.inf, sure[index, every])
    return index, distance, np.abs(np.minimum(own, -rival.max(axis=0)))


@dataclass(frozen=True, slots=True)
class Chord:
    """A line against a sphere: m = C - O, c = m x D, |D|^2, m.D, disc = R^2 |D|^2 - |c|^2, and the nearer root t."""

    m: Floats
    c: Floats
    square: Floats
    along: Floats
    disc: Floats
    near: Floats

    def cosine(self, radius: float) -> Floats:
        """n.v of the hit point."""
        return np.maximum(np.sqrt(np.maximum(self.disc, 0.0) / self.square) / radius, LEAST_COSINE)


def chord_of(world: World, rays: Rays, k: int) -> Chord:
    radius, d = world.radii[k], rays.direction
    m, rest = from_to(rays.base, rays.offset, world.centers[k])
    square, along = dot(d, d), dot(m, d)
    c = cross(m, d) + np.cross(rest, d, axis=0)
    disc = radius * radius * square - dot(c, c)
    root = np.sqrt(np.maximum(disc, 0.0))
    outside = (length(m) - radius) * (length(m) + radius)
    near = np.where(root > 0.5 * along, outside / (along + root), (along - root) / square)
    return Chord(m, c, square, along, disc, near)


def above(plane: Ground, rays: Rays) -> Floats:
    """Height of the rays' origins above the plane, on the eye's side."""
    return np.asarray(plane.normal @ (rays.base - plane.point[:, np.newaxis]) + plane.normal @ rays.offset)


# -------------------------------------------------------------------------------------------------------- vectors


def from_to(base: Floats, offset: Floats, target: Floats) -> tuple[Floats, Floats]:
    """target - (base + offset) as a rounded vector and what the rounding left."""
    first, rest = _sum(target[:, np.newaxis], -base)
    second, more = _sum(first, -offset)
    return second, rest + more


def _sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """a + b = sum + error, exactly   (Knuth)"""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def length(a: Floats) -> Floats:
    return np.asarray(np.sqrt(dot(a, a)))


def cross(a: Floats, b: Floats) -> Floats:
    """a x b, each component to about an ulp of itself."""
    halves = [(_halves(a[i]), _halves(b[i])) for i in range(3)]

    def determinant(i: int, j: int) -> Any:
        p, p_rest = _product(a[i], b[j], halves[i][0], halves[j][1])
        q, q_rest = _product(a[j], b[i], halves[j][0], halves[i][1])
        return (p - q) + (p_rest - q_rest)

    return np.stack([determinant(1, 2), determinant(2, 0), determinant(0, 1)])


def _halves(a: Floats) -> tuple[Floats, Floats]:
    """a = high + low, 26 bits each   (Veltkamp)"""
    wide = a * 134217729.0
    high = wide - (wide - a)
    return high, a - high


def _product(a: Floats, b: Floats, a_halves: tuple[Floats, Floats], b_halves: tuple[Floats, Floats]) -> Any:
    """a b = product + error, exactly   (Dekker)"""
    product = a * b
    (a_high, a_low), (b_high, b_low) = a_halves, b_halves
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
