"""A scene in whole numbers, for rays that are decided exactly: spheres, lights, the plane; and vectors of any numbers.

Comes in: a camera-frame Scene. Goes out: World, all of whose lengths are multiples of one unit; directions have a grid
of their own, as no scale of theirs has any effect; intensities are balls of radius 0. Never done here: a rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
from flint import arb, fmpq, fmpz

from symrender_cg.reference.camera_numbers import whole_numbers
from symrender_cg.reference.oracle.near import Near
from symrender_cg.reference.points import FloatArray
from symrender_cg.scene import DirectionalLight, Phong, Plane, PointLight, Scene

Number: TypeAlias = Any
"""int, fmpz, fmpq or Surd, which are exact, or arb"""
Vector: TypeAlias = tuple[Number, Number, Number]


_FAR: Final = 1 << 20
"""Stands for the exponent of 0, which has none."""
FEW: Final = 12
"""So many spheres are asked one by one."""
Colour: TypeAlias = float | tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Paint:
    """A material with its numbers as balls of radius 0, those of colours for each channel."""

    material: Phong
    ambient: tuple[arb, ...]
    diffuse: tuple[arb, ...]
    specular: tuple[arb, ...]
    is_diffuse: bool
    is_specular: bool
    shininess: arb
    reflect: arb


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere of the scene."""

    center: Vector
    from_eye: Vector
    """C - E"""
    r2: fmpz
    power: fmpz
    """|E - C|^2 - R^2 > 0"""
    paint: Paint
    kind: int
    """The lowest index of a sphere with the same centre and radius."""


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light: a point, or the direction towards it."""

    number: int
    intensity: tuple[arb, ...]
    is_dark: bool
    fading: tuple[arb, arb, arb] | None
    """(a, b, c) of the attenuation; None where it is 1 everywhere."""
    position: Vector | None
    towards: Vector
    inside: npt.NDArray[np.bool_]
    """Which spheres it lies inside of."""
    height: fmpz
    """n.(L - point) with the plane's normal towards the eye, n.l of a direction; below 0 on the plane's other side."""


@dataclass(frozen=True, slots=True)
class Ground:
    """The plane, its normal towards the eye, and the axes of its tiles, not normalised."""

    point: Vector
    normal: Vector
    n2: fmpz
    eye_height: fmpz
    """n.(E - point) > 0"""
    axes: tuple[Vector, Vector]
    axes2: tuple[fmpz, fmpz]
    tile: fmpz
    paint: Paint
    checker: Paint


class World:
    """The camera-frame scene in whole numbers; `unit` is the length that 1 stands for."""

    def __init__(self, frame: Scene) -> None:
        self.frame = frame
        self.channels = frame.channels
        plane = frame.plane
        points = [frame.camera.eye, *(s.center for s in frame.spheres)]
        points += [li.position for li in frame.lights if isinstance(li, PointLight)]
        points += [] if plane is None else [plane.point, (plane.tile, 0.0, 0.0)]
        lengths = [c for point in points for c in point] + [s.radius for s in frame.spheres]
        whole = whole_numbers(tuple(lengths))
        common = math.gcd(*whole)
        numbers = iter([fmpz(number // common) for number in whole])
        eye, *others = [(next(numbers), next(numbers), next(numbers)) for _ in points]
        rest = iter(others)
        self.unit = Fraction(frame.camera.eye[2]) / int(eye[2])
        self.eye: Vector = eye
        centers = [next(rest) for _ in frame.spheres]
        positions = [next(rest) if isinstance(li, PointLight) else None for li in frame.lights]
        first: dict[object, int] = {}
        balls = []
        for index, (center, sphere) in enumerate(zip(centers, frame.spheres, strict=True)):
            r2 = next(numbers) ** 2
            m = minus(center, eye)
            kind = first.setdefault((sphere.center, sphere.radius), index)
            balls.append(Ball(center, m, r2, dot(m, m) - r2, self._paint(sphere.material), kind))
        self.balls = tuple(balls)
        self.near: Near | None = None
        """Which spheres a ray could meet at all, where asking each costs more."""
        if len(balls) > FEW:
            unit = fmpq(self.unit.numerator, self.unit.denominator)
            self.near = Near([s.center for s in frame.spheres], [s.radius for s in frame.spheres], unit)
        self.ground: Ground | None = None
        if plane is not None:
            point, (tile, _, _) = next(rest), next(rest)
            paint = self._paint(plane.material)
            checker = paint if plane.checker in (None, plane.material) else self._paint(plane.checker)
            self.ground = _ground(plane, point, tile, eye, paint, checker)
        self.lamps = tuple(self._lamp(k, position) for k, position in enumerate(positions))

    def _lamp(self, number: int, position: Vector | None) -> Lamp:
        light = self.frame.lights[number]
        towards: Vector = (fmpz(0), fmpz(0), fmpz(0))
        inside = np.zeros(len(self.balls), dtype=np.bool_)
        if position is None:
            assert not isinstance(light, PointLight), "a point light has its position"
            towards = direction_of(light.direction, -1)
        else:
            inside[:] = [square_of(minus(position, ball.center)) < ball.r2 for ball in self.balls]
        height = fmpz(0)
        if self.ground is not None:
            reached = towards if position is None else minus(position, self.ground.point)
            height = dot(self.ground.normal, reached)
        intensity = self.channels_of(light.intensity)
        fading: tuple[arb, arb, arb] | None = None
        if not isinstance(light, DirectionalLight) and light.attenuation != (1.0, 0.0, 0.0):
            a, b, c = light.attenuation
            fading = arb(a), arb(b), arb(c)
        return Lamp(number, intensity, not any_of(light.intensity), fading, position, towards, inside, height)

    def channels_of(self, colour: Colour) -> tuple[arb, ...]:
        """The colour's channels as balls of radius 0."""
        return tuple(arb(c) for c in (colour if isinstance(colour, tuple) else (colour,) * self.channels))

    def _paint(self, material: Phong) -> Paint:
        return Paint(
            material,
            self.channels_of(material.ambient),
            self.channels_of(material.diffuse),
            self.channels_of(material.specular),
            any_of(material.diffuse),
            any_of(material.specular),
            arb(material.shininess),
            arb(material.reflect),
        )


def _ground(plane: Plane, point: Vector, tile: fmpz, eye: Vector, paint: Paint, checker: Paint) -> Ground:
    given = direction_of(plane.normal)
    n2, axis = square_of(given), direction_of(plane.axis)
    across = minus(scaled(axis, n2), scaled(given, dot(axis, given)))
    along = cross(given, across)
    towards_eye = given if dot(given, minus(eye, point)) > 0 else scaled(given, fmpz(-1))
    return Ground(
        point=point,
        normal=towards_eye,
        n2=n2,
        eye_height=dot(towards_eye, minus(eye, point)),
        axes=(across, along),
        axes2=(square_of(across), square_of(along)),
        tile=tile,
        paint=paint,
        checker=checker,
    )


def any_of(colour: Colour) -> bool:
    return any(colour) if isinstance(colour, tuple) else colour > 0.0


def direction_of(v: tuple[float, float, float], sign: int = 1) -> Vector:
    """v times a positive number that makes it whole."""
    whole = whole_numbers(v)
    common = math.gcd(*whole) or 1
    x, y, z = (fmpz(sign * number // common) for number in whole)
    return x, y, z


def primary_directions(eye: float, columns: FloatArray, rows: FloatArray) -> Iterator[tuple[fmpz, fmpz, fmpz]]:
    """D = (x, y, -eye) times a power of two that makes it whole, for each point."""
    numerator, denominator = eye.as_integer_ratio()
    twos = (numerator & -numerator).bit_length() - 1
    depth, depth_exponent = fmpz(-(numerator >> twos)), twos - (denominator.bit_length() - 1)
    significands, exponents = [], []
    for values in (columns, rows):
        fraction, exponent = np.frexp(values)
        significands.append((fraction * 2.0**53).astype(np.int64).tolist())
        exponents.append(np.where(fraction == 0.0, _FAR, exponent.astype(np.int64) - 53).tolist())
    for x, y, x_exponent, y_exponent in zip(*significands, *exponents, strict=True):
        grid = min(x_exponent, y_exponent, depth_exponent)
        dx = fmpz(x) << (x_exponent - grid) if x else fmpz(0)
        dy = fmpz(y) << (y_exponent - grid) if y else fmpz(0)
        yield dx, dy, depth << (depth_exponent - grid)


# ------------------------------------------------------------------------------------------------------------ vectors


def dot(a: Vector, b: Vector) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def scaled(a: Vector, factor: Number) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


def square_of(a: Vector) -> Number:
    return dot(a, a)
