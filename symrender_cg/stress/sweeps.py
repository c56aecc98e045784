"""The axes of the failure atlas: along each, one number of an ordinary one-sphere scene goes to where it is hard.

Comes in: a seed and counts. Goes out: for each bin of an axis its Cases, scenes of one sphere and one light with points
on their image planes. Everything that an axis does not vary is ordinary: e/R from 2 to 8, a light 1 to 20 R from the
surface on the eye's side, 1 <= n <= 64. Never done here: an evaluation.

Where an abscissa is small beside the spacing of floats (a light 1e-16 R above the surface, a point 1e-17 R from the
silhouette), all coordinates but one are drawn, the last one is solved for in whole numbers and rounded; it is the
smallest of them, so its rounding is far below the others'. The abscissa is then computed from the rounded numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

Floats: TypeAlias = npt.NDArray[np.float64]
Random: TypeAlias = np.random.Generator
Edges: TypeAlias = tuple[float, ...]

_ROOT_BITS: Final = 256


@dataclass(frozen=True, slots=True)
class Case:
    """A scene, points (x, y) of its image plane, and the abscissa of each as log10 (log2 on the axis of scales)."""

    scene: Scene
    x: Floats
    y: Floats
    abscissa: Floats


@dataclass(frozen=True, slots=True)
class Axis:
    """One abscissa: what it is, the edges of its bins as exponents of `base`, where it is easy, and its cases.

    easy: the exponent from which a search for the first failure goes outwards, to both ends.
    cases(random, low, high, points): one scene with that many points whose abscissa is meant to lie in the bin.
    """

    name: str
    title: str
    base: int
    edges: Edges
    easy: float
    cases: Callable[[Random, float, float, int], Case]


def cases_of(axis: Axis, seed: int, scenes: int, points: int) -> Iterator[Case]:
    """`scenes` cases for each bin, with `points` points each; the same for the same arguments."""
    for bin_, (low, high) in enumerate(zip(axis.edges, axis.edges[1:], strict=False)):
        random = np.random.default_rng([seed, *axis.name.encode(), bin_])
        for _ in range(scenes):
            yield axis.cases(random, low, high, points)


# ----------------------------------------------------------------------------------------------------- the five axes


def _eye(random: Random, low: float, high: float, count: int) -> Case:
    """e/R - 1 from 1e-15 to 1e12: the cap that is seen shrinks to a point, or the sphere does."""
    eye = 1.0 + 10.0 ** random.uniform(low, high)
    if eye == 1.0:
        eye = math.nextafter(1.0, 2.0)
    normals = _visible(random, eye, count)
    light = _towards(random, normals[:, 0], eye)
    x, y = _seen(normals, eye)
    return Case(_scene(random, eye, light), x, y, np.full(count, math.log10(eye - 1.0)))


def _light_distance(random: Random, low: float, high: float, count: int) -> Case:
    """The distance of the light from the surface, 1e-16 R to 1e300 R, seen near the light's foot where it is near."""
    eye = random.uniform(2.0, 8.0)
    distance = 10.0 ** random.uniform(low, high)
    foot = _visible(random, eye, 1)[:, 0]
    if distance < 1e-3:
        light, distance = _just_above(random, eye, distance)
        foot = np.array(light) / math.hypot(*light)
        angles = 10.0 ** random.uniform(max(math.log10(distance) - 1.0, -17.0), 0.0, count)
        normals = _turned(random, foot, angles)
    else:
        light = (
            float(foot[0] * (1.0 + distance)),
            float(foot[1] * (1.0 + distance)),
            float(foot[2] * (1.0 + distance)),
        )
        normals = _visible(random, eye, count)
    normals = np.where(_is_visible(normals, eye), normals, foot[:, np.newaxis])
    x, y = _seen(normals, eye)
    return Case(_scene(random, eye, light), x, y, np.full(count, math.log10(distance)))


def _shininess(random: Random, low: float, high: float, count: int) -> Case:
    """n from 1e-3 to 1e12, within 3/sqrt(n) of the mirror point; for small n half of the points where r.v ~ 0."""
    shininess = 10.0 ** random.uniform(low, high)
    eye = random.uniform(2.0, 8.0)
    mirror = _visible(random, eye, 1)
    x, y = _seen(mirror, eye)
    view = np.array([-float(x[0]), -float(y[0]), eye])
    view /= math.hypot(*view)
    direction = 2.0 * float(mirror[:, 0] @ view) * mirror[:, 0] - view
    place = mirror[:, 0] + direction * 10.0 ** random.uniform(0.0, 1.3)
    light = (float(place[0]), float(place[1]), float(place[2]))
    widest = min(3.0 / math.sqrt(shininess), 1.0)
    angles = widest * np.where(random.random(count) < 0.5, random.random(count), 10.0 ** random.uniform(-4, 0, count))
    normals = _turned(random, mirror[:, 0], angles)
    if shininess < 4.0:
        normals[:, ::2] = _sideways(random, mirror[:, 0], place, eye, (count + 1) // 2)
    normals = np.where(_is_visible(normals, eye), normals, mirror)
    x, y = _seen(normals, eye)
    return Case(_scene(random, eye, light, shininess), x, y, np.full(count, math.log10(shininess)))


def _scale(random: Random, low: float, high: float, count: int) -> Case:
    """All lengths times 2^k, which changes no digit of the true image."""
    power = round(random.uniform(math.ceil(low), math.floor(high)))
    eye = random.uniform(2.0, 8.0)
    normals = _visible(random, eye, count)
    x, y = _seen(normals, eye)
    scene = _scene(random, eye, _towards(random, normals[:, 0], eye), scale=power)
    return Case(scene, np.ldexp(x, power), np.ldexp(y, power), np.full(count, float(power)))


def _silhouette(random: Random, low: float, high: float, count: int) -> Case:
    """The distance of the point from the silhouette on the image plane, in radii of the outline, on both sides."""
    eye = random.uniform(2.0, 8.0)
    rho2 = Fraction(eye) ** 2 / (Fraction(eye) ** 2 - 1)
    points = [_near_circle(random, rho2, 10.0 ** random.uniform(low, high)) for _ in range(count)]
    x, y, away = (np.array(column, dtype=np.float64) for column in zip(*points, strict=True))
    inside = float(x[0]) / math.sqrt(rho2), float(y[0]) / math.sqrt(rho2)
    rim = np.array([*inside, 0.0]) * math.sqrt(1.0 - 1.0 / eye**2) + np.array([0.0, 0.0, 1.0 / eye])
    scene = _scene(random, eye, _towards(random, rim / math.hypot(*rim), eye))
    return Case(scene, x, y, np.log10(np.maximum(away, 1e-300)))


# --------------------------------------------------------------------------------------------- scenes and their parts


def _scene(
    random: Random, eye: float, light: tuple[float, float, float], shininess: float | None = None, scale: int = 0
) -> Scene:
    """The unit sphere at the origin times 2^scale, with coefficients whose sum is at most 1."""
    ambient, diffuse, specular = random.uniform(0.02, 0.1), random.uniform(0.2, 0.5), random.uniform(0.1, 0.4)
    exponent = float(2.0 ** random.uniform(0.0, 6.0)) if shininess is None else shininess
    x, y, z = (math.ldexp(coordinate, scale) for coordinate in light)
    one = math.ldexp(1.0, scale)
    return Scene(
        Camera((0.0, 0.0, math.ldexp(eye, scale)), half_height=one),
        (Sphere((0.0, 0.0, 0.0), one, Phong(ambient, diffuse, specular, exponent)),),
        (PointLight((x, y, z)),),
    )


def _visible(random: Random, eye: float, count: int) -> Floats:
    """Normals of points that the eye sees, (3, count), even in angle over the cap of half-angle acos(1/e)."""
    cap = 2.0 * math.asin(math.sqrt((eye - 1.0) / (2.0 * eye)))
    angle, turn = 0.999 * cap * np.sqrt(random.random(count)), random.uniform(0.0, 2.0 * math.pi, count)
    return np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


def _is_visible(normals: Floats, eye: float) -> npt.NDArray[np.bool_]:
    return np.asarray(normals[2] * eye > 1.0)


def _seen(normals: Floats, eye: float) -> tuple[Floats, Floats]:
    """Where points with these normals appear: e n_xy / (e - n_z), with 1 - n_z = n_xy^2 / (1 + n_z) near the eye."""
    across = normals[0] ** 2 + normals[1] ** 2
    gap = np.where(normals[2] > 0.0, (eye - 1.0) + across / (1.0 + normals[2]), eye - normals[2])
    return normals[0] * eye / gap, normals[1] * eye / gap


def _towards(random: Random, normal: Floats, eye: float) -> tuple[float, float, float]:
    """A light that the point with this normal faces, 1 to 20 R away."""
    while True:
        direction = random.normal(size=3)
        direction /= math.hypot(*direction)
        if float(direction @ normal) > 0.2 and (eye < 2.0 or direction[2] > -0.3):
            break
    place = normal + direction * 10.0 ** random.uniform(0.0, 1.3)
    return float(place[0]), float(place[1]), float(place[2])


def _turned(random: Random, normal: Floats, angles: Floats) -> Floats:
    """`normal` turned by each angle, each about an axis of its own; (3, count)."""
    across = np.cross(normal[np.newaxis, :], random.normal(size=(angles.size, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(normal[:, np.newaxis] * np.cos(angles) + across.T * np.sin(angles))


def _sideways(random: Random, mirror: Floats, light: Floats, eye: float, count: int) -> Floats:
    """Normals where r.v is about 0: `mirror` is turned until it is, by bisection, then a little more; (3, count)."""
    across = np.cross(mirror[np.newaxis, :], random.normal(size=(count, 3)))
    across = (across / np.linalg.norm(across, axis=1, keepdims=True)).T

    def turned(angle: Floats) -> Floats:
        return np.asarray(mirror[:, np.newaxis] * np.cos(angle) + across * np.sin(angle))

    low, high = np.zeros(count), np.full(count, 0.5 * math.pi)
    for _ in range(54):
        angle = 0.5 * (low + high)
        n = turned(angle)
        w, v = light[:, np.newaxis] - n, np.array([0.0, 0.0, eye])[:, np.newaxis] - n
        bright = 2.0 * (n * w).sum(axis=0) * (n * v).sum(axis=0) - (w * v).sum(axis=0) > 0.0
        low, high = np.where(bright, angle, low), np.where(bright, high, angle)
    return turned(low + np.where(random.random(count) < 0.5, 1.0, -1.0) * 10.0 ** random.uniform(-17.0, -1.0, count))


def _just_above(random: Random, eye: float, distance: float) -> tuple[tuple[float, float, float], float]:
    """A light `distance` above the unit sphere, and the distance that is left of it after rounding, > 0."""
    target = (1 + Fraction(distance)) ** 2
    while True:
        polar = random.uniform(0.0, 0.9) * math.acos(1.0 / eye)
        x, z = math.sin(polar), math.cos(polar)
        shrunk = 1.0 - 10.0 ** random.uniform(-6.0, -2.0)
        x, z = x * shrunk, z * shrunk
        rest = target - Fraction(x) ** 2 - Fraction(z) ** 2
        y = _root(rest) * (1.0 if random.random() < 0.5 else -1.0)
        excess = Fraction(x) ** 2 + Fraction(y) ** 2 + Fraction(z) ** 2 - 1
        if excess > 0:
            light = (x, y, z) if random.random() < 0.5 else (y, x, z)
            return light, float(excess) / (1.0 + math.sqrt(1.0 + float(excess)))


def _near_circle(random: Random, rho2: Fraction, distance: float) -> tuple[float, float, float]:
    """(x, y, distance from the circle in radii), x^2 + y^2 about rho^2, inside or outside."""
    side = -1 if random.random() < 0.5 else 1
    target = rho2 * (1 + side * Fraction(distance)) ** 2
    if distance > 1e-3:
        turn, radius = random.uniform(0.0, 2.0 * math.pi), math.sqrt(target)
        x, y = radius * math.cos(turn), radius * math.sin(turn)
    else:
        x = math.sqrt(target) * (1.0 - 10.0 ** random.uniform(-8.0, -1.0))
        y = _root(target - Fraction(x) ** 2)
        x, y = (x, y) if random.random() < 0.5 else (y, -x)
    square = Fraction(x) ** 2 + Fraction(y) ** 2
    return x, y, abs(float((square - rho2) / rho2)) / (1.0 + math.sqrt(square / rho2))


def _root(square: Fraction) -> float:
    """sqrt of a positive fraction, rounded once; a floor of 2^-256 stands for what is below."""
    return math.isqrt(max(int(square * (1 << 2 * _ROOT_BITS)), 1)) / (1 << _ROOT_BITS)


def _decades(low: int, high: int, a_decade: int = 1) -> Edges:
    return tuple(low + step / a_decade for step in range((high - low) * a_decade + 1))


AXES: Final[tuple[Axis, ...]] = (
    Axis("eye", "e/R - 1: the eye above the surface", 10, _decades(-15, 12), 0.5, _eye),
    Axis(
        "light",
        "the light above the surface, in R",
        10,
        (*_decades(-16, 20), *(float(edge) for edge in range(30, 301, 10))),
        0.5,
        _light_distance,
    ),
    Axis("shininess", "n: the shininess", 10, _decades(-3, 12, 2), 0.75, _shininess),
    Axis("scale", "2^k: all lengths times that", 2, tuple(float(edge) for edge in range(-500, 501, 25)), 0.0, _scale),
    Axis("silhouette", "the point off the silhouette, in R", 10, _decades(-17, 0), -0.5, _silhouette),
)
