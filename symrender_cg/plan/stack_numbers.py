"""`Stack`: the numbers of many scenes of one kind as arrays, in the camera's frame; which of them are ordinary ones.

Comes in: arrays. Goes out: truths, one a scene: numbers that make a scene for which every kernel is proved right.
Never done here: what the eye sees, or a light adds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from symrender_cg.plan.measures import Floats, Truths, norm
from symrender_cg.scene import PointLight, Scene

ORDINARY: Final = 2.0**14
"""Lengths within this many distances of the eye, radii and coefficients as near to 1, are in reach of every kernel."""

ROOM: Final = 1e-12
"""Relative room of comparisons that a scene decides in whole numbers: rounding is 1e-15."""

SHAPES: Final = frozenset({"eye", "half_height", "center", "radius", "point", "normal", "axis", "tile"})
"""The arrays that say what is where: if none of them changes, the eye sees the same in every scene."""


@dataclass(frozen=True, eq=False)
class Ground:
    """The planes of T scenes, in the camera's frame: point, normal, axis (T, 3), tile (T,), as a Plane has them."""

    point: Floats
    normal: Floats
    axis: Floats
    tile: Floats


@dataclass(frozen=True, eq=False)
class Stack:
    """T scenes of N spheres, P materials of a plane and L lights, in the camera's frame.

    eye, half_height (T,); center (T, N, 3), radius (T, N); place (T, L, 3): positions, and directions of lights in
    parallel; ambient, diffuse, specular (T, N + P, 3), shininess, reflect (T, N + P); intensity (T, L, 3); background
    (T, 3), and up None; or of a gradient None, and up (T, 3), its direction. ground None: without a plane.
    changes: which of the arrays differ between scenes; the others are one scene's, repeated.
    """

    eye: Floats
    half_height: Floats
    center: Floats
    radius: Floats
    place: Floats
    ambient: Floats
    diffuse: Floats
    specular: Floats
    shininess: Floats
    reflect: Floats
    intensity: Floats
    background: Floats | None
    up: Floats | None
    ground: Ground | None
    changes: frozenset[str]

    @property
    def count(self) -> int:
        """T."""
        return len(self.eye)

    @property
    def spheres(self) -> int:
        """N."""
        return int(self.radius.shape[1])

    @property
    def moved(self) -> bool:
        """Whether anything that the eye may see is elsewhere, or of another size."""
        return not SHAPES.isdisjoint(self.changes)


def is_ordinary(stack: Stack, scene: Scene) -> Truths:
    """(T,): numbers that make a scene, of ordinary size, with the eye outside every sphere and off the plane.

    scene: one of their kind, in the camera's frame, with a plan.
    """
    eye, given = stack.eye, scene.camera.eye[2]
    longest, least = ORDINARY * eye, eye / ORDINARY
    sure = (eye >= given / ORDINARY) & (eye <= given * ORDINARY)
    sure &= (stack.half_height >= least) & (stack.half_height <= longest)
    sure &= (np.abs(stack.center) <= longest[:, np.newaxis, np.newaxis]).all(axis=(1, 2))
    sure &= ((stack.radius >= least[:, np.newaxis]) & (stack.radius <= longest[:, np.newaxis])).all(axis=1)
    farthest = ORDINARY * longest
    for index, light in enumerate(scene.lights):
        place = np.abs(stack.place[:, index])
        sure &= (
            (place <= farthest[:, np.newaxis]).all(axis=1) if isinstance(light, PointLight) else _is_direction(place)
        )
    away = norm(stack.center - _at_eye(stack))
    sure &= (away > stack.radius * (1.0 + ROOM)).all(axis=1)
    if stack.ground is not None:
        sure &= _is_ground(stack, stack.ground)
    if stack.up is not None:
        sure &= _is_direction(np.abs(stack.up))
    coefficients = (stack.ambient, stack.diffuse, stack.specular, stack.shininess, stack.intensity, stack.background)
    for value in coefficients:
        if value is not None:
            axes = tuple(range(1, value.ndim))
            sure &= (value >= 0.0).all(axis=axes) & (value <= ORDINARY * ORDINARY).all(axis=axes)
    sure &= ((stack.reflect >= 0.0) & (stack.reflect <= 1.0)).all(axis=1)
    return np.asarray(sure, dtype=np.bool_)


def _at_eye(stack: Stack) -> Floats:
    """(T, 1, 3): the eyes."""
    found = np.zeros((stack.count, 1, 3))
    found[:, 0, 2] = stack.eye
    return found


def _is_direction(size: Floats) -> Truths:
    """(T,): vectors (T, 3), without their signs, whose squares are in range."""
    longest = size.max(axis=1)
    return np.asarray((longest >= ORDINARY**-8) & (longest <= ORDINARY**8))


def _is_ground(stack: Stack, ground: Ground) -> Truths:
    """(T,): planes that are proper, ordinary, and that the eye is off."""
    normal, axis = np.abs(ground.normal), np.abs(ground.axis)
    sure = _is_direction(normal) & _is_direction(axis)
    with np.errstate(all="ignore"):
        n = ground.normal / norm(ground.normal)[:, np.newaxis]
        a = ground.axis / norm(ground.axis)[:, np.newaxis]
        leaning = norm(np.cross(n, a)) > 2.0**-10
        away = _at_eye(stack)[:, 0] - ground.point
        height = np.abs(np.einsum("ti,ti->t", away, n))
    sure &= leaning & (np.abs(ground.point) <= ORDINARY * stack.eye[:, np.newaxis]).all(axis=1)
    sure &= (ground.tile >= stack.eye / ORDINARY) & (ground.tile <= ORDINARY * stack.eye)
    return np.asarray(sure & (height > ROOM * norm(away)))


def is_grey(stack: Stack) -> Truths:
    """(T,): the channels of every colour are equal; of a gradient those of its colours are not looked at."""
    grey = np.ones(stack.count, dtype=np.bool_)
    for value in (stack.ambient, stack.diffuse, stack.specular, stack.intensity, stack.background):
        if value is not None:
            grey &= (value == value[..., :1]).all(axis=tuple(range(1, value.ndim)))
    return grey


def repeated(array: Floats, count: int) -> Floats:
    """(count, ...): an array of one scene for each of many, without a copy."""
    return np.broadcast_to(array, (count, *array.shape[1:]))
