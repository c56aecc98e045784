"""The image of a scene drawn from its Arrangement alone: what a scene kernel does, in plain numpy.

Comes in: a Scene in the camera's frame, its Arrangement, points. Goes out: what brute force gives for them, if nothing
that matters was left out. The rays and their formulas are brute force's own, so that the two differ only where the
arrangement says so. Every flag is believed: a sphere not at the eye is not asked whether it is before it, a pair that
is no pair of partners is not compared in depth, a term or a blocker that is not listed is not there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.plan.arrangement import Arrangement
from symrender_cg.reference.brute_rays import Rays, World, above, chord_of, dot, from_to, length, unit
from symrender_cg.scene import Gradient, Phong, PointLight, Scene

Floats: TypeAlias = npt.NDArray[np.float64]
Indices: TypeAlias = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Drawn:
    """value (channels, n); index (n,) of scene.spheres, len(spheres) for the plane, -1 for the background."""

    value: Floats
    index: Indices


def draw(frame: Scene, found: Arrangement, x: Floats, y: Floats) -> Drawn:
    """The scene seen through points (x, y), one-dimensional, of the image plane."""
    world = World(frame)
    direction = np.stack((x, y, np.full(x.shape, -frame.camera.eye[2]))) / world.scale
    zeros = np.zeros(x.size)
    rays = Rays(
        np.repeat(world.eye[:, np.newaxis], x.size, axis=1),
        np.zeros((3, x.size)),
        direction,
        np.full(x.size, -1),
        zeros,
        zeros,
    )
    with np.errstate(all="ignore"):
        surface = _first(world, found, rays)
        value = _colour(world, found, rays, surface, found.bounces)
    index = np.full(x.size, -1)
    spheres = len(found.spheres)
    on = (surface >= 0) & (surface < spheres)
    index[on] = found.spheres[surface[on]]
    index[surface == spheres] = len(frame.spheres)
    return Drawn(value, index)


def _first(world: World, found: Arrangement, rays: Rays) -> Indices:
    """Position of the sphere that each ray of the eye meets first, S for the plane, -1 for nothing."""
    count, spheres = rays.own.size, len(found.spheres)
    owner, depth = np.full(count, -1), np.full(count, np.inf)
    for k in range(found.visible):
        chord = chord_of(world, rays, int(found.spheres[k]))
        hit = chord.disc >= 0.0
        if found.at_eye[k]:
            hit &= chord.along > 0.0
        partners = found.partners[found.partners_begin[k] : found.partners_begin[k + 1]]
        wins = hit & ((owner < 0) | (np.isin(owner, partners) & (chord.near < depth)))
        owner[wins], depth[wins] = k, chord.near[wins]
    if found.plane_seen:
        assert world.plane is not None
        fall = -(world.plane.normal @ rays.direction)
        near = np.where(fall > 0.0, above(world.plane, rays) / fall, np.inf)
        compared = np.append(found.crosses_plane, True)[owner]
        wins = (near < np.inf) & ((owner < 0) | (compared & (near < depth)))
        owner[wins] = spheres
    return owner


def _mirrored_first(world: World, found: Arrangement, rays: Rays, receiver: int) -> Indices:
    """The same for rays that leave a receiver."""
    owner, depth = np.full(rays.own.size, -1), np.full(rays.own.size, np.inf)
    for k in found.mirrors[found.mirrors_begin[receiver] : found.mirrors_begin[receiver + 1]]:
        index = int(found.spheres[k])
        chord = chord_of(world, rays, index)
        twin = receiver < len(found.spheres) and _same(world.frame, int(found.spheres[receiver]), index)
        wins = (chord.disc >= 0.0) & (chord.along > 0.0) & (chord.near < depth) & (not twin)
        owner[wins], depth[wins] = k, chord.near[wins]
    if found.mirror_plane[receiver]:
        assert world.plane is not None
        fall = -(world.plane.normal @ rays.direction)
        near = np.where(fall > 0.0, above(world.plane, rays) / fall, np.inf)
        owner[near < depth] = len(found.spheres)
    return owner


def _same(frame: Scene, a: int, b: int) -> bool:
    """Whether two spheres coincide: a ray that leaves one does not meet the other."""
    one, other = frame.spheres[a], frame.spheres[b]
    return (one.center, one.radius) == (other.center, other.radius)


def _colour(world: World, found: Arrangement, rays: Rays, surface: Indices, bounces: int) -> Floats:
    """(channels, n)"""
    value = _background(world, rays.direction)
    for position in np.unique(surface[surface >= 0]):
        chosen = np.flatnonzero(surface == position)
        some = rays.where(chosen)
        if position < len(found.spheres):
            value[:, chosen] = _sphere(world, found, some, int(position), bounces)
        else:
            value[:, chosen] = _plane(world, found, some, bounces)
    return value


def _background(world: World, direction: Floats) -> Floats:
    background = world.frame.background
    if not isinstance(background, Gradient):
        return np.repeat(world.colour(background)[:, np.newaxis], direction.shape[1], axis=1)
    s = 0.5 * (1.0 + unit(np.array(background.up)) @ direction / length(direction))
    return np.asarray(
        world.colour(background.bottom)[:, np.newaxis] * (1.0 - s) + world.colour(background.top)[:, np.newaxis] * s
    )


def _sphere(world: World, found: Arrangement, rays: Rays, position: int, bounces: int) -> Floats:
    index = int(found.spheres[position])
    chord, radius = chord_of(world, rays, index), world.radii[index]
    root = np.sqrt(np.maximum(chord.disc, 0.0))
    n = np.cross(chord.c, rays.direction, axis=0) - root * rays.direction
    n /= length(n)
    base = np.repeat(world.centers[index][:, np.newaxis], rays.own.size, axis=1)
    material = world.frame.spheres[index].material
    return _shaded(world, found, position, index, material, base, radius * n, n, rays.direction, bounces)


def _plane(world: World, found: Arrangement, rays: Rays, bounces: int) -> Floats:
    plane, spheres = world.plane, len(found.spheres)
    assert plane is not None
    fall = -(plane.normal @ rays.direction)
    away = rays.base - plane.point[:, np.newaxis] + rays.offset + rays.direction * (above(plane, rays) / fall)
    away -= plane.normal[:, np.newaxis] * (plane.normal @ away)
    base = np.repeat(plane.point[:, np.newaxis], rays.own.size, axis=1)
    n = np.repeat(plane.normal[:, np.newaxis], rays.own.size, axis=1)
    kind = np.zeros(rays.own.size, dtype=np.int64)
    if len(found.plane_materials) == 2:
        kind = (np.floor(plane.tiles @ away).sum(axis=0) % 2.0 != 0.0).astype(np.int64)
    value = np.empty((world.channels, rays.own.size))
    for which, material in enumerate(found.plane_materials):
        some = kind == which
        args = (base[:, some], away[:, some], n[:, some], rays.direction[:, some])
        value[:, some] = _shaded(world, found, spheres + which, len(world.radii), material, *args, bounces)
    return value


def _shaded(
    world: World,
    found: Arrangement,
    receiver: int,
    own: int,
    material: Phong,
    base: Floats,
    offset: Floats,
    n: Floats,
    direction: Floats,
    bounces: int,
) -> Floats:
    """Ambient, the lamps of the receiver, and what is mirrored in it."""
    count = n.shape[1]
    value = np.repeat(world.colour(material.ambient)[:, np.newaxis], count, axis=1)
    v = -direction / length(direction)
    for lamp in range(found.lamps_begin[receiver], found.lamps_begin[receiver + 1]):
        light = world.frame.lights[found.lamp_light[lamp]]
        strength = np.ones(count)
        if isinstance(light, PointLight):
            w = _from(base, offset, np.array(light.position) / world.scale)
            distance = length(w)
            l_hat, far = w / distance, distance * world.scale
            a, b, c = light.attenuation
            strength = np.where(distance > 0.0, 1.0 / (a + b * far + c * far * far), 0.0)
        else:
            l_hat, distance = (
                np.repeat(-unit(np.array(light.direction))[:, np.newaxis], count, axis=1),
                np.full(count, np.inf),
            )
        n_dot_l = dot(n, l_hat)
        r_dot_v = 2.0 * n_dot_l * dot(n, v) - dot(l_hat, v)
        visible = _visible(world, found, lamp, own, base, offset, light, l_hat, distance)
        coefficient: Any = 0.0
        if found.lamp_diffuse[lamp]:
            coefficient = world.colour(material.diffuse)[:, np.newaxis] * np.maximum(n_dot_l, 0.0)
        if found.lamp_specular[lamp]:
            power = np.ones(count) if material.shininess == 0.0 else np.maximum(r_dot_v, 0.0) ** material.shininess
            if found.lamp_gated[lamp]:
                power = np.where(n_dot_l > 0.0, power, 0.0)
            coefficient = coefficient + world.colour(material.specular)[:, np.newaxis] * power
        term = world.colour(light.intensity)[:, np.newaxis] * strength * coefficient
        value += np.where(visible & (distance > 0.0), term, 0.0)
    if bounces > 0 and found.mirror[receiver]:
        d = direction / length(direction)
        zeros = np.zeros(count)
        rays = Rays(base, offset, d - 2.0 * dot(n, d) * n, np.full(count, own), zeros, zeros)
        beyond = _colour(world, found, rays, _mirrored_first(world, found, rays, receiver), bounces - 1)
        value += material.reflect * beyond
    return value


def _from(base: Floats, offset: Floats, target: Floats) -> Floats:
    """target - (base + offset)"""
    first, rest = from_to(base, offset, target)
    return np.asarray(first + rest)


def _visible(
    world: World,
    found: Arrangement,
    lamp: int,
    own: int,
    base: Floats,
    offset: Floats,
    light: Any,
    l_hat: Floats,
    distance: Floats,
) -> npt.NDArray[np.bool_]:
    result = np.ones(distance.shape, dtype=bool)
    for k in found.blockers[found.blockers_begin[lamp] : found.blockers_begin[lamp + 1]]:
        index = int(found.spheres[k])
        radius = world.radii[index]
        m = _from(base, offset, world.centers[index])
        c, along = np.cross(m, l_hat, axis=0), dot(m, l_hat)
        reaches: Any = along < distance
        if isinstance(light, PointLight):
            reaches = reaches | (math.dist(world.centers[index], np.array(light.position) / world.scale) < radius)
        result &= ~((dot(c, c) <= radius * radius) & (along > 0.0) & reaches)
    return result
