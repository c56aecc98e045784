"""The numbers of a camera-frame scene as arrays, and the bounds of angles that every condition is made of.

Comes in: a Scene in the camera's frame. Goes out: Measures, float64 arrays with lengths over the power of two just
above the eye's distance, so that squares stay in range. Never done here: a decision.

Differences of inputs have one rounding; a length has at most 4 more, an angle between two vectors is at most 16
roundings (2^-53) off. `narrow` and `wide` move a length by 2^-49 of itself first, so that what is made of it by a
monotone formula is a lower or an upper bound; `ANGLE` exceeds the error of a sum of three angles, `LENGTH` that of the
longest formula for a length, in the largest length that occurs in it. The bounds of a plan keep squares in range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.scene import DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, exact

Floats: TypeAlias = npt.NDArray[np.float64]
Truths: TypeAlias = npt.NDArray[np.bool_]
Indices: TypeAlias = npt.NDArray[np.int64]
Ints: TypeAlias = npt.NDArray[np.int32]

ANGLE: Final = 2.0**-46
"""Exceeds the error of a sum of three computed angles: 128 roundings of 1."""

LENGTH: Final = 2.0**-44
"""Exceeds the relative error of every formula for a length below: 512 roundings of the largest length in it."""


def narrow(length: Floats) -> Floats:
    """A lower bound of a length that is at most 8 roundings off."""
    return length * (1.0 - 2.0**-49)


def wide(length: Floats) -> Floats:
    """An upper bound of a length that is at most 8 roundings off."""
    return length * (1.0 + 2.0**-49)


def norm(v: Floats) -> Floats:
    """|v| along the last axis."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", v, v)))


def dot(a: Floats, b: Floats) -> Floats:
    """a . b along the last axis."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def cross(a: Floats, b: Floats) -> Floats:
    """a x b along the last axis."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-1)


def angle(a: Floats, b: Floats) -> Floats:
    """The angle between two vectors, 0 to pi, well conditioned for each."""
    return np.asarray(np.arctan2(norm(cross(a, b)), dot(a, b)))


def tangent_length(distance: Floats, radius: Floats) -> Floats:
    """sqrt(d^2 - R^2), 0 where d <= R."""
    return np.asarray(np.sqrt(np.maximum(distance - radius, 0.0) * (distance + radius)))


def cone_above(distance: Floats, radius: Floats) -> Floats:
    """At least the half-angle asin(R / d) of the cone about a sphere; pi where the point may be in it."""
    nearer = narrow(distance)
    return np.where(nearer > radius, np.arctan2(radius, tangent_length(nearer, radius)), np.pi)


def cone_below(distance: Floats, radius: Floats) -> Floats:
    """At most the half-angle asin(R / d) of the cone about a sphere."""
    return np.asarray(np.arctan2(radius, tangent_length(wide(distance), radius)))


def cap_above(distance: Floats, radius: Floats) -> Floats:
    """At least the half-angle acos(R / d) of the cap that is visible from a point at that distance of the centre."""
    return np.asarray(np.arctan2(tangent_length(wide(distance), radius), radius))


def colour(value: Any) -> tuple[float, float, float]:
    """A colour as its three channels."""
    return (value, value, value) if isinstance(value, float) else value


@dataclass(frozen=True)
class Measures:
    """Arrays of a scene, lengths over `unit`. N spheres, L lights.

    center (N, 3), radius (N,); m (N, 3) = C - E, distance (N,) = |m|; material (N,) indexes `materials`.
    at (L, 3): position of a point light, or the unit direction to a directional one; directional (L,) says which.
    normal (3,), point (3,): the plane's unit normal on the eye's side, its point; None without a plane.
    plane_materials: those of the plane that are told apart, none to two.
    """

    scene: Scene
    unit: float
    eye: float
    center: Floats
    radius: Floats
    m: Floats
    distance: Floats
    materials: tuple[Phong, ...]
    material: Indices
    at: Floats
    directional: Truths
    normal: Floats | None
    point: Floats | None
    plane_materials: tuple[Phong, ...]

    @property
    def count(self) -> int:
        """Number of spheres."""
        return len(self.radius)

    @property
    def plane(self) -> Plane | None:
        """The scene's plane."""
        return self.scene.plane

    def slopes(self, aspect: float) -> tuple[float, float]:
        """Half the width and half the height of the window at depth 1."""
        half_height = self.scene.camera.half_height
        assert half_height is not None, "a scene in the camera's frame has a half_height"
        slope = half_height / self.scene.camera.eye[2]
        return slope * aspect, slope

    def heights(self, points: Floats) -> tuple[Floats, Floats]:
        """(height above the plane on the eye's side, its error) of points (..., 3)."""
        assert self.normal is not None, "there is a plane"
        assert self.point is not None, "there is a plane"
        away = points - self.point
        height = np.asarray(away @ self.normal)
        return height, LENGTH * norm(away)

    @cached_property
    def sphere_heights(self) -> tuple[Floats, Floats]:
        """heights() of the centres."""
        return self.heights(self.center)

    @cached_property
    def light_heights(self) -> tuple[Floats, Floats]:
        """heights() of the lights; of a directional one how fast a point rises on its way to it."""
        assert self.normal is not None, "there is a plane"
        height, error = self.heights(self.at)
        rise = np.asarray(self.at @ self.normal)
        return np.where(self.directional, rise, height), np.where(self.directional, LENGTH, error)

    @cached_property
    def separated(self) -> Truths:
        """(L,): the light is on the other side of the plane than the eye, and than all that is seen; exactly."""
        plane, scene = self.plane, self.scene
        if plane is None:
            return np.zeros(len(self.at), dtype=bool)
        side = exact.side_of_plane(scene.camera.eye, plane.point, plane.normal)
        found = [
            -exact.side_of_plane(light.direction, (0.0, 0.0, 0.0), plane.normal)
            if isinstance(light, DirectionalLight)
            else exact.side_of_plane(light.position, plane.point, plane.normal)
            for light in scene.lights
        ]
        return np.array(found, dtype=np.int64) * side < 0

    @cached_property
    def beyond_plane(self) -> Truths:
        """(N,): the whole sphere lies on the other side of the plane than the eye."""
        if self.plane is None:
            return np.zeros(self.count, dtype=bool)
        height, error = self.sphere_heights
        return np.asarray(height + self.radius < -error - LENGTH * self.radius)

    @cached_property
    def crosses_plane(self) -> Truths:
        """(N,): not proved to lie wholly on the eye's side of the plane."""
        if self.plane is None:
            return np.zeros(self.count, dtype=bool)
        height, error = self.sphere_heights
        return np.asarray(~(height - self.radius > error + LENGTH * self.radius))

    @cached_property
    def black_background(self) -> bool:
        """Whether the background is 0 in every direction."""
        background = self.scene.background
        both = (background.bottom, background.top) if isinstance(background, Gradient) else (background,)
        return not any(channel for value in both for channel in colour(value))


def measure(scene: Scene) -> Measures:
    """The Measures of a scene in the camera's frame."""
    eye = scene.camera.eye[2]
    unit = math.ldexp(1.0, math.frexp(eye)[1])
    spheres = scene.spheres
    center = np.array([sphere.center for sphere in spheres], dtype=np.float64).reshape(-1, 3) / unit
    radius = np.array([sphere.radius for sphere in spheres], dtype=np.float64) / unit
    m = center - np.array((0.0, 0.0, eye / unit))
    numbers: dict[Phong, int] = {}
    material = np.array([numbers.setdefault(sphere.material, len(numbers)) for sphere in spheres], dtype=np.int64)
    directional = np.array([isinstance(light, DirectionalLight) for light in scene.lights], dtype=bool)
    at = np.array([_place(light, unit) for light in scene.lights], dtype=np.float64).reshape(-1, 3)
    normal = point = None
    if scene.plane is not None:
        normal = unit_vector(scene.plane.normal)
        point = np.array(scene.plane.point) / unit
        if exact.side_of_plane(scene.camera.eye, scene.plane.point, scene.plane.normal) < 0:
            normal = -normal
    return Measures(
        scene=scene,
        unit=unit,
        eye=eye / unit,
        center=center,
        radius=radius,
        m=m,
        distance=norm(m),
        materials=tuple(numbers),
        material=material,
        at=at,
        directional=directional,
        normal=normal,
        point=point,
        plane_materials=_materials(scene.plane),
    )


def _materials(plane: Plane | None) -> tuple[Phong, ...]:
    if plane is None:
        return ()
    return (plane.material,) if plane.checker is None else (plane.material, plane.checker)


def unit_vector(v: tuple[float, float, float]) -> Floats:
    """v / |v|, at most 4 roundings off."""
    array = np.array(v, dtype=np.float64)
    array = np.ldexp(array, -int(np.frexp(np.abs(array).max())[1]))
    return np.asarray(array / math.sqrt(float(array @ array)))


def _place(light: PointLight | DirectionalLight, unit: float) -> Any:
    if isinstance(light, DirectionalLight):
        return -unit_vector(light.direction)
    return np.array(light.position) / unit
