"""The image of a scene by the definition: every ray, every sphere, every blocker, every bounce; numpy, no plan.

Comes in: a Scene of any number of spheres and lights, with or without a plane, and points of the image plane. Goes out:
Traced: the value, what is seen first, the terms whose sum is the value, and two figures that say how far rounding may
be trusted at each point. Never done here: leaving out what cannot matter, or an exact decision.

    first hit    disc = R^2 |D|^2 - |m x D|^2 >= 0 and m.D > 0, m = C - O; t = (m.D - sqrt(disc)) / |D|^2
    normal       (c x D / |D|^2 - sqrt(disc) / |D|^2 D) / R with c = m x D: the foot of the perpendicular from the
                 centre, then half a chord towards the eye; no difference of long lengths
    blocked      the ball |X - C| <= R meets the open segment P + s l, 0 < s < d, of unit direction l: disc >= 0 and
                 m.l > 0 and (m.l < d or the light is inside), m = C - P
    mirrored     D - 2 (n.D) n from P

A point is kept as the centre of its sphere and an offset from it, so that no digits are lost far from the origin.

Every decision has a signed margin, positive where it is taken: a relative distance from its border over the growth of
the errors so far. A conjunction has the smallest margin of its parts, an alternative the largest. `doubt` is the
smallest |margin| of all decisions that the value of a point rests on, `condition` is how many roundings its normals and
directions may be off. Both are estimates: they say where to compare, they are not bounds. Lengths should lie within
2^+-400 of the eye's distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import ArgumentError
from symrender_cg.reference.brute_rays import (
    Floats,
    Indices,
    Rays,
    World,
    chord_of,
    dot,
    first_hit,
    from_to,
    length,
    unit,
)
from symrender_cg.reference.points import as_points
from symrender_cg.scene import DirectionalLight, Gradient, PointLight, Scene

PIECE: Final = 1 << 21
"""Points times spheres that are held in memory at once."""


@dataclass(frozen=True, slots=True)
class Traced:
    """What is seen at each point. `points` is the broadcast shape of x and y; channels: nothing if grey, else (3,).

    value       points + channels, unclipped: the sum of the terms below
    index       points, int64: which of scene.spheres is seen first, len(scene.spheres) for the plane, -1 for neither
    depth       points: distance of the hit point from the eye in scene units, inf at the background
    normal      points + (3,): unit normal in the camera's frame, on the plane towards the eye; 0 at the background
    background, ambient, reflected    points + channels
    diffuse, specular                 (lights,) + points + channels
    doubt       points: smallest relative margin of any decision, see above; inf where none was taken
    condition   points: how many roundings the normals and directions may be off, at least 1
    """

    value: Floats
    index: Indices
    depth: Floats
    normal: Floats
    background: Floats
    ambient: Floats
    diffuse: Floats
    specular: Floats
    reflected: Floats
    doubt: Floats
    condition: Floats


def image(scene: Scene, width: int, height: int) -> Traced:
    """`trace` on the pixel centres of an image: points is (height, width), row 0 at the top, y upwards."""
    for name, size in (("width", width), ("height", height)):
        if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
            raise ArgumentError(f"{name}: {size!r}; expected a whole number of pixels, at least 1")
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None, "a scene in the camera's frame has a half_height"
    step = np.float64(2.0 * half_height / height)
    columns = (np.arange(width, dtype=np.float64) + 0.5 - 0.5 * width) * step
    rows = (0.5 * height - 0.5 - np.arange(height, dtype=np.float64)) * step
    return trace(scene, columns[np.newaxis, :], rows[:, np.newaxis])


def trace(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> Traced:
    """The scene seen through points (x, y) of the image plane, which broadcast against each other."""
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    shape, count = columns.shape, columns.size
    world = World(scene.in_camera_frame())
    direction = np.empty((3, count))
    direction[0], direction[1], direction[2] = columns.ravel(), rows.ravel(), -world.frame.camera.eye[2]
    zeros = np.zeros(count)
    rays = Rays(
        base=np.repeat(world.eye[:, np.newaxis], count, axis=1),
        offset=np.zeros((3, count)),
        direction=direction / world.scale,
        own=np.full(count, -1),
        blur=zeros,
        turn=zeros,
    )
    piece = max(1, PIECE // (1 + len(world.radii)))
    with np.errstate(all="ignore"):
        seen = _joined(
            [
                _look(world, rays.where(np.arange(begin, min(begin + piece, count))), world.frame.max_bounces)
                for begin in range(0, max(count, 1), piece)
            ]
        )

    def shaped(values: Floats) -> Floats:
        """(..., channels, count) -> (...) + points + channels."""
        moved = np.moveaxis(values, -2, -1)
        moved = moved.reshape(*values.shape[:-2], *shape, world.channels)
        return moved[..., 0] if world.channels == 1 else moved

    return Traced(
        value=shaped(seen.value()),
        index=seen.index.reshape(shape),
        depth=(seen.distance * world.scale).reshape(shape),
        normal=np.moveaxis(seen.normal, 0, -1).reshape(*shape, 3),
        background=shaped(seen.background),
        ambient=shaped(seen.ambient),
        diffuse=shaped(seen.diffuse),
        specular=shaped(seen.specular),
        reflected=shaped(seen.reflected),
        doubt=seen.doubt.reshape(shape),
        condition=seen.condition.reshape(shape),
    )


@dataclass(slots=True)
class _Seen:
    """What rays see; terms are (channels, n), those of lights (lights, channels, n)."""

    index: Indices
    distance: Floats
    normal: Floats
    background: Floats
    ambient: Floats
    diffuse: Floats
    specular: Floats
    reflected: Floats
    doubt: Floats
    condition: Floats

    def value(self) -> Floats:
        return np.asarray(
            self.background + self.ambient + self.diffuse.sum(axis=0) + self.specular.sum(axis=0) + self.reflected
        )


def _joined(parts: list[_Seen]) -> _Seen:
    """The same of all points one after another."""
    if len(parts) == 1:
        return parts[0]
    return _Seen(*(np.concatenate([getattr(part, f.name) for part in parts], axis=-1) for f in fields(_Seen)))


def _look(world: World, rays: Rays, bounces: int) -> _Seen:
    """colour(ray, bounces): the background, or ambient + light by light + reflect colour(mirrored, bounces - 1)"""
    count, frame = rays.own.size, world.frame
    index, distance, doubt = first_hit(world, rays)
    lights = len(frame.lights)
    seen = _Seen(
        index=index,
        distance=distance,
        normal=np.zeros((3, count)),
        background=np.zeros((world.channels, count)),
        ambient=np.zeros((world.channels, count)),
        diffuse=np.zeros((lights, world.channels, count)),
        specular=np.zeros((lights, world.channels, count)),
        reflected=np.zeros((world.channels, count)),
        doubt=doubt,
        condition=np.ones(count),
    )
    missed, hit = np.flatnonzero(index < 0), np.flatnonzero(index >= 0)
    seen.background[:, missed] = _background(world, rays.direction[:, missed])
    seen.condition[missed] += rays.turn[missed]
    if hit.size == 0:
        return seen
    there = _points(world, rays.where(hit), index[hit], distance[hit])
    seen.normal[:, hit] = there.normal
    seen.doubt[hit] = np.minimum(seen.doubt[hit], there.doubt)
    seen.condition[hit] += there.bend + there.turn
    seen.ambient[:, hit] = world.ambient[there.material].T
    for number, light in enumerate(frame.lights):
        lit = _light(world, there, light)
        seen.diffuse[number][:, hit] = lit.diffuse
        seen.specular[number][:, hit] = lit.specular
        seen.doubt[hit] = np.minimum(seen.doubt[hit], lit.doubt)
        seen.condition[hit] = np.maximum(seen.condition[hit], lit.condition)
    mirrors = np.flatnonzero(world.reflect[there.material] > 0.0)
    if bounces > 0 and mirrors.size:
        beyond = _look(world, there.mirrored(mirrors), bounces - 1)
        seen.reflected[:, hit[mirrors]] = world.reflect[there.material[mirrors]] * beyond.value()
        seen.doubt[hit[mirrors]] = np.minimum(seen.doubt[hit[mirrors]], beyond.doubt)
        seen.condition[hit[mirrors]] = np.maximum(seen.condition[hit[mirrors]], beyond.condition)
    return seen


def _background(world: World, direction: Floats) -> Floats:
    """The constant, or bottom (1 - s) + top s with s = (1 + up.D / (|up| |D|)) / 2; (channels, n)."""
    background = world.frame.background
    if not isinstance(background, Gradient):
        return np.broadcast_to(world.colour(background)[:, np.newaxis], (world.channels, direction.shape[1]))
    s = 0.5 * (1.0 + unit(np.array(background.up)) @ direction / length(direction))
    bottom, top = world.colour(background.bottom)[:, np.newaxis], world.colour(background.top)[:, np.newaxis]
    return np.asarray(bottom * (1.0 - s) + top * s)


# ------------------------------------------------------------------------------------------- the point and its light


@dataclass(frozen=True, slots=True)
class _Points:
    """Hit points base + offset with unit normal and v = -D / |D|; errors as in Rays, bend: that of the normal."""

    index: Indices
    base: Floats
    offset: Floats
    normal: Floats
    direction: Floats
    material: Indices
    reach: Floats
    blur: Floats
    turn: Floats
    bend: Floats
    doubt: Floats

    def mirrored(self, chosen: Indices) -> Rays:
        """The rays D - 2 (n.D) n that leave these points."""
        normal, d = self.normal[:, chosen], self.direction[:, chosen]
        d = d / length(d)
        return Rays(
            self.base[:, chosen],
            self.offset[:, chosen],
            d - 2.0 * dot(normal, d) * normal,
            self.index[chosen],
            self.blur[chosen],
            self.turn[chosen] + 2.0 * self.bend[chosen],
        )


def _points(world: World, rays: Rays, index: Indices, distance: Floats) -> _Points:
    """Hit points, normals, materials."""
    count = index.size
    base, offset, normal = np.empty((3, count)), np.empty((3, count)), np.empty((3, count))
    material, reach = index.copy(), np.empty(count)
    blur, bend, doubt = np.empty(count), np.ones(count), np.full(count, np.inf)
    for k, radius in enumerate(world.radii):
        chosen = np.flatnonzero(index == k)
        some = rays.where(chosen)
        chord = chord_of(world, some, k)
        root = np.sqrt(np.maximum(chord.disc, 0.0))
        n = (np.cross(chord.c, some.direction, axis=0) - root * some.direction) / (chord.square * radius)
        n /= length(n)
        base[:, chosen], normal[:, chosen], offset[:, chosen] = world.centers[k][:, np.newaxis], n, radius * n
        reach[chosen] = radius
        lateral = some.blur + some.turn * length(chord.m) + radius
        bend[chosen] = lateral / radius / chord.cosine(radius)
        blur[chosen] = radius * bend[chosen]
    plane = world.plane
    if plane is not None:
        chosen = np.flatnonzero(index == len(world.radii))
        some, far = rays.where(chosen), distance[chosen]
        step = some.direction * (far / length(some.direction))
        away = (some.base - plane.point[:, np.newaxis]) + some.offset + step
        away -= plane.normal[:, np.newaxis] * (plane.normal @ away)
        base[:, chosen], offset[:, chosen] = plane.point[:, np.newaxis], away
        normal[:, chosen] = plane.normal[:, np.newaxis]
        reach[chosen] = length(away)
        fall = np.abs(plane.normal @ some.direction) / length(some.direction)
        blur[chosen] = (some.blur + (1.0 + some.turn) * far) / fall + length(away)
        tiles = plane.tiles @ away
        odd = np.floor(tiles).sum(axis=0) % 2.0 != 0.0
        material[chosen] += odd
        if not plane.plain:
            edge = np.abs(tiles - np.round(tiles)) / (1.0 + blur[chosen] / plane.tile)
            doubt[chosen] = edge.min(axis=0)
    return _Points(index, base, offset, normal, rays.direction, material, reach, blur, rays.turn, bend, doubt)


@dataclass(frozen=True, slots=True)
class _Lit:
    diffuse: Floats
    specular: Floats
    doubt: Floats
    condition: Floats


def _light(world: World, there: _Points, light: PointLight | DirectionalLight) -> _Lit:
    """visible attenuation intensity (k_d max(0, n.l), k_s max(0, r.v)^n)   (Phong 1975)"""
    count, material = there.index.size, there.material
    attenuation = np.ones(count)
    if isinstance(light, DirectionalLight):
        l_hat = np.repeat(-unit(np.array(light.direction))[:, np.newaxis], count, axis=1)
        distance = np.full(count, np.inf)
    else:
        w = sum(from_to(there.base, there.offset, np.array(light.position) / world.scale))
        scale = np.abs(w).max(axis=0)
        w = w / np.where(scale > 0.0, scale, 1.0)
        l_hat, distance = w / length(w), length(w) * scale
        a, b, c = light.attenuation
        far = distance * world.scale
        attenuation = 1.0 / (a + b * far + c * far * far)
    acts = distance > 0.0
    v = -there.direction / length(there.direction)
    n_dot_l = dot(there.normal, l_hat)
    r_dot_v = 2.0 * n_dot_l * dot(there.normal, v) - dot(l_hat, v)
    shininess, gated = world.shininess[material], world.gated[material]
    power = np.where(shininess == 0.0, 1.0, np.maximum(r_dot_v, 0.0) ** shininess)
    open_power = power
    power = np.where(gated & ~(n_dot_l > 0.0), 0.0, power)

    blur = there.blur / distance
    error = 1.0 + there.bend + there.turn + blur
    doubt = np.where(acts & (distance < np.inf), distance / (there.reach + there.blur), np.inf)
    intensity = world.colour(light.intensity)[:, np.newaxis] * np.where(acts, attenuation, 0.0)
    diffuse = intensity * world.diffuse[material].T * np.maximum(n_dot_l, 0.0)
    specular = intensity * world.specular[material].T * power
    highlight = (intensity * world.specular[material].T * open_power).max(axis=0)
    doubt = np.where(gated & (highlight > 0.0), np.minimum(doubt, np.abs(n_dot_l) / error), doubt)
    steep = (shininess > 0.0) & (shininess < 1.0) & (highlight > 0.0)
    doubt = np.where(steep, np.minimum(doubt, np.abs(r_dot_v) / error), doubt)
    if world.frame.shadows:
        blocked = _blocked(world, there, light, l_hat, distance)
        matters = (diffuse + specular).max(axis=0) > 0.0
        doubt = np.where(matters, np.minimum(doubt, np.abs(blocked)), doubt)
        visible = np.where(blocked >= 0.0, 0.0, 1.0)
        diffuse, specular = diffuse * visible, specular * visible
    dark = ~acts
    diffuse[:, dark], specular[:, dark] = 0.0, 0.0
    return _Lit(diffuse, specular, np.where(dark, 0.0, doubt), np.where(dark, np.inf, error))


def _blocked(
    world: World, there: _Points, light: PointLight | DirectionalLight, l_hat: Floats, distance: Floats
) -> Floats:
    """Margin of: some other sphere meets the open segment to the light, or the plane separates the two."""
    margin = np.full(there.index.size, -np.inf)
    for k, radius in enumerate(world.radii):
        m, rest = from_to(there.base, there.offset, world.centers[k])
        m = m + rest
        c, along, far = np.cross(m, l_hat, axis=0), dot(m, l_hat), length(m)
        swing = there.blur * (1.0 + far / distance) + far + radius
        meets = (radius * radius - dot(c, c)) / (radius * radius) / (swing / radius)
        before = along / far / (1.0 + there.blur / far + there.blur / distance)
        reaches = np.full(margin.shape, np.inf)
        if isinstance(light, PointLight):
            depth = math.dist(world.centers[k], np.array(light.position) / world.scale)
            inside = (radius - depth) / (radius + depth)
            inside = -np.inf if inside == 0.0 else inside
            reaches = np.maximum(inside, (distance - along) / distance / (1.0 + (there.blur + far) / distance))
        this = np.minimum(np.minimum(meets, before), reaches)
        margin = np.maximum(margin, np.where(there.index == k, -np.inf, this))
    plane = world.plane
    if plane is not None:
        base = plane.normal @ (there.base - plane.point[:, np.newaxis])
        above = (base + plane.normal @ there.offset) / (np.abs(base) + there.reach + there.blur)
        if isinstance(light, PointLight):
            away = np.array(light.position) / world.scale - plane.point
            below = -float(plane.normal @ away) / max(float(np.abs(away).max()), 1e-300)
        else:
            below = float(plane.normal @ unit(np.array(light.direction)))
        separates = np.minimum(above, below if below != 0.0 else -np.inf)
        margin = np.maximum(margin, np.where(there.index == len(world.radii), -np.inf, separates))
    return margin
