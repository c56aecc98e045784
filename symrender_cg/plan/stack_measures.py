"""The measures of many scenes: those of symrender_cg.plan.measures, with an axis of scenes.

Comes in: a `Stack`, and a scene of its kind. Goes out: Stacked: float64 arrays with lengths over the power of two just
above each eye's distance. Which side of the plane something is on is decided exactly. Never done here: a margin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symrender_cg.plan.measures import LENGTH, Floats, Indices, Measures, Truths, norm
from symrender_cg.plan.stack_numbers import Stack
from symrender_cg.scene import DirectionalLight, Scene, exact


@dataclass(frozen=True, eq=False)
class Stacked:
    """T scenes of N spheres and L lights, as Measures has one.

    flat: all of them as the Measures of one scene: sphere i of scene t is number t N + i, light l is t L + l.
    slopes (T, 2): half the width and half the height of the window at depth 1; None where any point may be asked for.
    normal, point (T, 3): the plane's unit normal on the eye's side, its point; sign (T,): 1 where the given normal is
    on the eye's side, else -1. None without a plane.
    """

    stack: Stack
    scene: Scene
    flat: Measures
    unit: Floats
    eye: Floats
    slopes: Floats | None
    normal: Floats | None
    point: Floats | None
    sign: Indices | None

    @property
    def count(self) -> int:
        """T."""
        return self.stack.count

    @property
    def spheres(self) -> int:
        """N."""
        return self.stack.spheres

    @property
    def lights(self) -> int:
        """L."""
        return len(self.scene.lights)

    @property
    def planes(self) -> int:
        """P: materials that the plane is given."""
        return int(self.stack.shininess.shape[1]) - self.spheres

    @property
    def center(self) -> Floats:
        """(T, N, 3)"""
        return self.flat.center.reshape(self.count, self.spheres, 3)

    @property
    def radius(self) -> Floats:
        """(T, N)"""
        return self.flat.radius.reshape(self.count, self.spheres)

    @property
    def m(self) -> Floats:
        """(T, N, 3): C - E."""
        return self.flat.m.reshape(self.count, self.spheres, 3)

    @property
    def distance(self) -> Floats:
        """(T, N): |C - E|."""
        return self.flat.distance.reshape(self.count, self.spheres)

    @property
    def at(self) -> Floats:
        """(T, L, 3): position of a point light, or the unit direction to another."""
        return self.flat.at.reshape(self.count, self.lights, 3)

    def heights(self, points: Floats) -> tuple[Floats, Floats]:
        """(height above the plane on the eye's side, its error), (T, n) each, of points (T, n, 3)."""
        assert self.normal is not None, "there is a plane"
        assert self.point is not None, "there is a plane"
        away = points - self.point[:, np.newaxis]
        return np.einsum("tni,ti->tn", away, self.normal), LENGTH * norm(away)

    @cached_property
    def sphere_heights(self) -> tuple[Floats, Floats]:
        """heights() of the centres."""
        return self.heights(self.center)

    @cached_property
    def light_heights(self) -> tuple[Floats, Floats]:
        """heights() of the lights; of a directional one how fast a point rises on its way to it."""
        assert self.normal is not None, "there is a plane"
        height, error = self.heights(self.at)
        directional = [isinstance(light, DirectionalLight) for light in self.scene.lights]
        rise = np.einsum("tli,ti->tl", self.at, self.normal)
        return np.where(directional, rise, height), np.where(directional, LENGTH, error)

    @cached_property
    def beyond_plane(self) -> Truths:
        """(T, N): the whole sphere lies on the other side of the plane than the eye."""
        if self.normal is None:
            return np.zeros((self.count, self.spheres), dtype=bool)
        height, error = self.sphere_heights
        return np.asarray(height + self.radius < -error - LENGTH * self.radius)

    @cached_property
    def crosses_plane(self) -> Truths:
        """(T, N): not proved to lie wholly on the eye's side of the plane."""
        if self.normal is None:
            return np.zeros((self.count, self.spheres), dtype=bool)
        height, error = self.sphere_heights
        return np.asarray(~(height - self.radius > error + LENGTH * self.radius))

    @cached_property
    def separated(self) -> Truths:
        """(T, L): the light is on the other side of the plane than the eye, exactly."""
        ground = self.stack.ground
        if ground is None:
            return np.zeros((self.count, self.lights), dtype=bool)
        assert self.sign is not None, "there is a plane"
        height, error = self.light_heights
        found = height < 0.0
        for t, light in np.argwhere(~(np.abs(height) > error)).tolist():
            x, y, z = self.stack.place[t, light].tolist()
            px, py, pz = ground.point[t].tolist()
            nx, ny, nz = ground.normal[t].tolist()
            if isinstance(self.scene.lights[light], DirectionalLight):
                side = -exact.side_of_plane((x, y, z), (0.0, 0.0, 0.0), (nx, ny, nz))
            else:
                side = exact.side_of_plane((x, y, z), (px, py, pz), (nx, ny, nz))
            found[t, light] = side * int(self.sign[t]) < 0
        return np.asarray(found)


def stacked(scene: Scene, stack: Stack, aspect: float | None) -> Stacked:
    """The measures of all scenes of a stack; those that are not ordinary may have none, and have any numbers."""
    _, exponent = np.frexp(np.where(np.isfinite(stack.eye), stack.eye, 1.0))
    unit = np.ldexp(1.0, exponent)
    eye = stack.eye / unit
    center = stack.center / unit[:, np.newaxis, np.newaxis]
    m = center - np.stack((np.zeros_like(eye), np.zeros_like(eye), eye), axis=1)[:, np.newaxis]
    at = stack.place / unit[:, np.newaxis, np.newaxis]
    for index, light in enumerate(scene.lights):
        if isinstance(light, DirectionalLight):
            at[:, index] = -unit_vectors(stack.place[:, index])
    normal = point = sign = None
    if stack.ground is not None:
        normal, point = unit_vectors(stack.ground.normal), stack.ground.point / unit[:, np.newaxis]
        away = np.stack((-point[:, 0], -point[:, 1], eye - point[:, 2]), axis=1)
        sign = np.where(np.einsum("ti,ti->t", away, normal) < 0.0, -1, 1)
        normal = normal * sign[:, np.newaxis]
    slopes = None
    if aspect is not None:
        upright = stack.half_height / stack.eye
        slopes = np.stack((upright * aspect, upright), axis=1)
    directional = np.array([isinstance(light, DirectionalLight) for light in scene.lights], dtype=bool)
    flat = m.reshape(-1, 3)
    measures = Measures(
        scene=scene,
        unit=1.0,
        eye=1.0,
        center=center.reshape(-1, 3),
        radius=(stack.radius / unit[:, np.newaxis]).reshape(-1),
        m=flat,
        distance=norm(flat),
        materials=(),
        material=np.empty(0, dtype=np.int64),
        at=at.reshape(-1, 3),
        directional=np.tile(directional, stack.count),
        normal=None,
        point=None,
        plane_materials=(),
    )
    return Stacked(stack, scene, measures, unit, eye, slopes, normal, point, sign)


def unit_vectors(v: Floats) -> Floats:
    """(T, 3): v / |v|, at most 4 roundings off."""
    _, exponent = np.frexp(np.abs(v).max(axis=1))
    scaled = np.ldexp(v, -exponent[:, np.newaxis])
    return np.asarray(scaled / norm(scaled)[:, np.newaxis])
