"""A scene in whole numbers, for rays that are decided exactly: spheres, lights, the plane; and vectors of any numbers.

Comes in: a camera-frame Scene. Goes out: World, all of whose lengths are multiples of one unit; directions have a grid
of their own, as no scale of theirs has any effect. Never done here: a rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

from flint import fmpz

from symrender_cg.reference.points import whole_numbers
from symrender_cg.scene import Phong, Plane, PointLight, Scene

Number: TypeAlias = Any
"""int, fmpz, fmpq, arb or Surd"""
Vector: TypeAlias = tuple[Number, Number, Number]


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere of the scene."""

    center: Vector
    r2: fmpz
    power: fmpz
    """|E - C|^2 - R^2 > 0"""
    material: Phong
    kind: int
    """The lowest index of a sphere with the same centre and radius."""


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light: a point, or the direction towards it."""

    number: int
    position: Vector | None
    towards: Vector
    inside: tuple[bool, ...]
    """Which spheres it lies inside of."""
    height: fmpz
    """n.(L - point) with the plane's normal towards the eye, n.l of a direction; below 0 on the plane's other side."""


@dataclass(frozen=True, slots=True)
class Ground:
    """The plane, its normal towards the eye, and the axes of its tiles, not normalised."""

    point: Vector
    normal: Vector
    n2: fmpz
    axes: tuple[Vector, Vector]
    axes2: tuple[fmpz, fmpz]
    tile: fmpz
    material: Phong
    checker: Phong


class World:
    """The camera-frame scene in whole numbers; `unit` is the length that 1 stands for."""

    def __init__(self, frame: Scene) -> None:
        self.frame = frame
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
            balls.append(Ball(center, r2, dot(m, m) - r2, sphere.material, kind))
        self.balls = tuple(balls)
        self.ground: Ground | None = None
        if plane is not None:
            point, (tile, _, _) = next(rest), next(rest)
            self.ground = _ground(plane, point, tile, eye)
        self.lamps = tuple(self._lamp(k, position) for k, position in enumerate(positions))

    def _lamp(self, number: int, position: Vector | None) -> Lamp:
        light = self.frame.lights[number]
        towards: Vector = (fmpz(0), fmpz(0), fmpz(0))
        inside: tuple[bool, ...] = (False,) * len(self.balls)
        if position is None:
            assert not isinstance(light, PointLight), "a point light has its position"
            towards = direction_of(light.direction, -1)
        else:
            inside = tuple(square_of(minus(position, ball.center)) < ball.r2 for ball in self.balls)
        height = fmpz(0)
        if self.ground is not None:
            reached = towards if position is None else minus(position, self.ground.point)
            height = dot(self.ground.normal, reached)
        return Lamp(number, position, towards, inside, height)


def _ground(plane: Plane, point: Vector, tile: fmpz, eye: Vector) -> Ground:
    given = direction_of(plane.normal)
    n2, axis = square_of(given), direction_of(plane.axis)
    across = minus(scaled(axis, n2), scaled(given, dot(axis, given)))
    along = cross(given, across)
    towards_eye = given if dot(given, minus(eye, point)) > 0 else scaled(given, fmpz(-1))
    return Ground(
        point=point,
        normal=towards_eye,
        n2=n2,
        axes=(across, along),
        axes2=(square_of(across), square_of(along)),
        tile=tile,
        material=plane.material,
        checker=plane.material if plane.checker is None else plane.checker,
    )


def direction_of(v: tuple[float, float, float], sign: int = 1) -> Vector:
    """v times a positive number that makes it whole."""
    whole = whole_numbers(v)
    common = math.gcd(*whole) or 1
    x, y, z = (fmpz(sign * number // common) for number in whole)
    return x, y, z


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
