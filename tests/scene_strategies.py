"""Scenes of every kind that has an image, from hypothesis or from a seed: one builder, two sources of choices.

    scenes()                    hypothesis: shrinks to few spheres, round numbers, no plane, no colour
    random_scene(seed)          the same kinds without hypothesis, a function of the seed; about 0.2 ms
    scene_points(scene, count, seed)   points of the image plane: over the window, at outlines, at centres
    scaled(scene, k)            every length times 2^k
    turned(scene, seed)         scene and camera moved together

1 to 12 spheres: apart, touching or cutting one another, nested, twice the same, hidden, behind the eye, outside the
window, far and small, crossing the plane of the eye; 0 to 3 lights: points (with attenuation, inside a sphere, on or
near a surface, behind the plane) and directions; grey or RGB; gated or not; a plane, plain or checkered, level, tilted,
cutting spheres; mirrors, 0 to 3 bounces; a gradient; a camera in its own frame or anywhere. One scene in eight has all
coordinates on a grid of 1/4, so that things touch and tie exactly. Every scene has `in_camera_frame()`.
Nothing here is an expectation of a value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np
import numpy.typing as npt
from hypothesis import strategies as st
from msgspec import structs

from symrender_cg.errors import SceneError
from symrender_cg.scene import Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere, Vector

T = TypeVar("T")
Colour = float | tuple[float, float, float]

KINDS = (
    "apart",
    "apart",
    "apart",
    "cutting",
    "touching",
    "nested",
    "same",
    "hidden",
    "behind",
    "outside",
    "far",
    "beside",
)


class Choices(Protocol):
    """Where a scene's numbers come from."""

    def real(self, low: float, high: float) -> float: ...

    def whole(self, low: int, high: int) -> int:
        """low <= result <= high"""

    def one(self, values: Sequence[T]) -> T: ...

    def often(self, share: float) -> bool:
        """True about so often."""


class _Seeded:
    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def real(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def whole(self, low: int, high: int) -> int:
        return int(self.random.integers(low, high + 1))

    def one(self, values: Sequence[T]) -> T:
        return values[int(self.random.integers(len(values)))]

    def often(self, share: float) -> bool:
        return bool(self.random.random() < share)


class _Drawn:
    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw

    def real(self, low: float, high: float) -> float:
        floats = st.floats(low, high, allow_nan=False, allow_infinity=False, allow_subnormal=False)
        return self.draw(floats.map(lambda value: 0.0 if abs(value) < 2.0**-60 else value))

    def whole(self, low: int, high: int) -> int:
        return self.draw(st.integers(low, high))

    def one(self, values: Sequence[T]) -> T:
        return self.draw(st.sampled_from(values))

    def often(self, share: float) -> bool:
        return self.draw(st.integers(0, 99)) >= 100 * (1.0 - share)


def random_scene(seed: int) -> Scene:
    """A scene of any kind, a function of `seed`."""
    return _scene(_Seeded(seed))


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Scenes of every kind of this module; none needs an `assume`."""
    return _scene(_Drawn(draw))


# ------------------------------------------------------------------------------------------------------- the builder


def _scene(c: Choices) -> Scene:
    e = c.one((1.0, 2.0, 4.0, 4.0, c.real(1.0, 9.0)))
    half_height = e * c.one((0.25, 0.5, 0.5, 1.0, c.real(0.1, 2.0)))
    rgb, mirrors, gate = c.often(0.5), c.often(0.4), c.often(0.5)
    round_numbers = c.often(0.125)
    spheres: list[Sphere] = []
    for _ in range(c.whole(1, 12) if c.often(0.95) else 0):
        sphere = _sphere(c, e, half_height, spheres, _material(c, rgb, mirrors, gate))
        if round_numbers:
            sphere = Sphere(_rounded(sphere.center), max(0.25, round(4.0 * sphere.radius) / 4.0), sphere.material)
        if math.dist(sphere.center, (0.0, 0.0, e)) > sphere.radius * 1.0001:
            spheres.append(sphere)
    plane = _plane(c, e, spheres, rgb, mirrors, gate, round_numbers) if c.often(0.5) else None
    lights = tuple(_light(c, e, spheres, plane, rgb, round_numbers) for _ in range(c.whole(0, 3)))
    if lights and c.often(0.05):
        lights = (*lights[:-1], lights[0])
    background: Colour | Gradient = c.one((0.0, 0.0, 0.25, _colour(c, rgb, 1.0)))
    if c.often(0.3):
        background = Gradient(_colour(c, rgb, 1.0), _colour(c, rgb, 1.0), c.one(((0.0, 1.0, 0.0), _direction(c))))
    scene = Scene(
        Camera((0.0, 0.0, e), half_height=half_height),
        tuple(spheres),
        lights,
        background,
        plane,
        shadows=c.often(0.85),
        max_bounces=c.whole(0, 3),
    )
    if c.often(0.3):
        scene = _moved(scene, _axes(c), (c.real(-3.0, 3.0), c.real(-3.0, 3.0), c.real(-3.0, 3.0)))
    if c.often(0.3):
        scene = _framed(scene)
    return scene


def _sphere(c: Choices, e: float, half_height: float, others: list[Sphere], material: Phong) -> Sphere:
    """A sphere of one of the KINDS; in the window unless its kind says otherwise."""
    kind = c.one(KINDS)
    depth = e * c.real(0.5, 2.5)
    seen = half_height * depth / e
    center = (seen * c.real(-1.0, 1.0), seen * c.real(-1.0, 1.0), e - depth)
    radius = seen * c.real(0.1, 0.5)
    if kind in ("cutting", "touching", "nested", "same", "hidden") and others:
        other = c.one(others)
        way, size = _direction(c), other.radius
        if kind == "cutting":
            radius = size * c.real(0.3, 1.5)
            center = _along(other.center, way, c.real(abs(size - radius), size + radius))
        elif kind == "touching":
            radius = size * c.one((0.25, 0.5, 1.0))
            center = _along(other.center, c.one((way, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))), size + radius)
        elif kind == "nested":
            radius = size * c.real(0.1, 0.9)
            center = _along(other.center, way, c.real(0.0, 1.0) * (size - radius))
        elif kind == "same":
            center, radius = other.center, size
        else:
            beyond, radius = c.real(1.0, 2.0), size * c.real(0.2, 1.0)
            x, y, z = other.center
            away = math.dist(other.center, (0.0, 0.0, e))
            step = (1.2 * size + beyond * radius) / away
            center = (x + step * x, y + step * y, z + step * (z - e))
    elif kind == "behind":
        center = (center[0], center[1], e + depth)
    elif kind == "outside":
        center = (center[0] + 4.0 * seen, center[1], center[2])
    elif kind == "far":
        away = 10.0 ** c.real(1.0, 3.0)
        center = (center[0] * away, center[1] * away, e - depth * away)
        radius *= away ** c.real(0.3, 1.0)
    elif kind == "beside":
        radius, turn = e * c.real(0.2, 0.6), c.real(0.0, 2.0 * math.pi)
        far = radius * c.real(1.05, 3.0)
        center = (far * math.cos(turn), far * math.sin(turn), e + radius * c.real(-1.2, 0.8))
    return Sphere(center, radius, material)


def _material(c: Choices, rgb: bool, mirrors: bool, gate: bool) -> Phong:
    return Phong(
        _colour(c, rgb, 0.3),
        _colour(c, rgb, 1.0),
        c.one((0.0, _colour(c, rgb, 1.0))),
        c.one((0.0, 1.0, 2.0, 8.0, 32.0, 32.0, 100.0, c.real(1.0, 60.0), c.real(0.0, 1.0))),
        gate if c.often(0.9) else not gate,
        c.one((0.0, 0.3, 1.0, c.real(0.0, 1.0))) if mirrors else 0.0,
    )


def _colour(c: Choices, rgb: bool, largest: float) -> Colour:
    if rgb and c.often(0.6):
        return c.real(0.0, largest), c.real(0.0, largest), c.real(0.0, largest)
    return c.one((0.0, largest, c.real(0.0, largest)))


def _plane(
    c: Choices, e: float, spheres: list[Sphere], rgb: bool, mirrors: bool, gate: bool, round_numbers: bool
) -> Plane | None:
    """A floor, a ceiling, a tilted plane, or one through a sphere; None where it would pass through the eye."""
    normal = c.one(((0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, -2.0, 0.0), (0.0, 1.0, 0.25), _direction(c)))
    point: Vector = (c.real(-1.0, 1.0), e * c.one((-0.5, -0.25, -1.0, 0.5)), c.real(-1.0, 1.0))
    if spheres and c.often(0.3):
        point = c.one(spheres).center
    axis = c.one(((1.0, 0.0, 0.0), (1.0, 0.5, -0.75), _direction(c)))
    tile = e * c.one((0.25, 0.5, 2.0, c.real(0.1, 1.0)))
    if round_numbers:
        point, normal = _rounded(point), (0.0, 1.0, 0.0)
    height = sum(n * (a - b) for n, a, b in zip(normal, (0.0, 0.0, e), point, strict=True))
    parallel = math.sqrt(sum(v * v for v in _cross(normal, axis)))
    if abs(height) < 1e-3 * e or parallel < 1e-2:
        return None
    checker = _material(c, rgb, mirrors, gate) if c.often(0.6) else None
    return Plane(point, normal, _material(c, rgb, mirrors, gate), checker, tile, axis)


def _light(
    c: Choices, e: float, spheres: list[Sphere], plane: Plane | None, rgb: bool, round_numbers: bool
) -> PointLight | DirectionalLight:
    intensity = c.one((1.0, _colour(c, rgb, 1.5)))
    if c.often(0.3):
        return DirectionalLight(c.one(((-5.0, -5.0, -10.0), (0.0, -1.0, 0.0), _direction(c))), intensity)
    kind = c.one(("above", "above", "anywhere", "anywhere", "near", "inside", "plane"))
    position: Vector = (e * c.real(-2.0, 2.0), e * c.real(-2.0, 2.0), e * c.real(-2.0, 2.0))
    if kind == "above":
        position = (position[0], e * c.real(0.5, 3.0), e * c.real(0.0, 3.0))
    elif kind in ("near", "inside") and spheres:
        sphere = c.one(spheres)
        away = c.real(1.01, 1.5) if kind == "near" else c.real(0.0, 0.95)
        position = _along(sphere.center, _direction(c), sphere.radius * away)
    elif kind == "plane" and plane is not None:
        position = _along(plane.point, plane.normal, e * c.real(-1.0, 1.0))
    if round_numbers:
        position = _rounded(position)
    attenuation = (1.0, 0.0, 0.0)
    if c.often(0.3):
        attenuation = c.one(((0.0, 0.0, 1.0), (1.0, 0.1, 0.01), (0.5, 0.25, 0.0), (0.0, 1.0 / e, 0.0)))
    return PointLight(position, intensity, attenuation)


def _direction(c: Choices) -> Vector:
    z, turn = c.real(-1.0, 1.0), c.real(0.0, 2.0 * math.pi)
    flat = math.sqrt(max(0.0, 1.0 - z * z))
    return flat * math.cos(turn), flat * math.sin(turn), z


def _axes(c: Choices) -> npt.NDArray[np.float64]:
    """Three perpendicular unit vectors, right-handed, as rows."""
    backward = np.array(_direction(c))
    seed = np.array((0.0, 1.0, 0.0) if abs(backward[1]) < 0.9 else (1.0, 0.0, 0.0))
    right = np.cross(seed, backward)
    right /= np.linalg.norm(right)
    upward, roll = np.cross(backward, right), c.real(0.0, 2.0 * math.pi)
    x = math.cos(roll) * right + math.sin(roll) * upward
    return np.array([x, np.cross(backward, x), backward])


def _rounded(v: Vector) -> Vector:
    x, y, z = (round(4.0 * part) / 4.0 for part in v)
    return x, y, z


def _along(origin: Vector, way: Vector, length: float) -> Vector:
    x, y, z = (o + length * w for o, w in zip(origin, way, strict=True))
    return x, y, z


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _framed(scene: Scene) -> Scene:
    """The scene with a half-height that frames its spheres, itself where there is none."""
    try:
        framed = structs.replace(scene, camera=structs.replace(scene.camera, half_height=None))
        framed.in_camera_frame()
    except SceneError:
        return scene
    return framed


# ------------------------------------------------------------------------------------------------ moving and scaling


def scaled(scene: Scene, k: int) -> Scene:
    """`scene` with every length times 2^k, attenuations so that no value changes; exact short of subnormal numbers."""

    def length(value: float) -> float:
        return math.ldexp(value, k)

    def vector(v: Vector) -> Vector:
        return length(v[0]), length(v[1]), length(v[2])

    def light(it: PointLight | DirectionalLight) -> PointLight | DirectionalLight:
        if isinstance(it, DirectionalLight):
            return it
        a, b, c = it.attenuation
        return PointLight(vector(it.position), it.intensity, (a, math.ldexp(b, -k), math.ldexp(c, -2 * k)))

    camera, plane = scene.camera, scene.plane
    half_height = None if camera.half_height is None else length(camera.half_height)
    return structs.replace(
        scene,
        camera=Camera(vector(camera.eye), vector(camera.look_at), camera.up, half_height),
        spheres=tuple(Sphere(vector(s.center), length(s.radius), s.material) for s in scene.spheres),
        lights=tuple(map(light, scene.lights)),
        plane=None if plane is None else structs.replace(plane, point=vector(plane.point), tile=length(plane.tile)),
    )


def turned(scene: Scene, seed: int) -> Scene:
    """Scene and camera turned and shifted together, to rounding."""
    c = _Seeded(seed)
    return _moved(scene, _axes(c), (c.real(-3.0, 3.0), c.real(-3.0, 3.0), c.real(-3.0, 3.0)))


def _moved(scene: Scene, axes: npt.NDArray[np.float64], shift: Vector) -> Scene:
    def way(v: Vector) -> Vector:
        x, y, z = (float(part) for part in np.array(v) @ axes)
        return x, y, z

    def point(v: Vector) -> Vector:
        return _along(way(v), shift, 1.0)

    def light(it: PointLight | DirectionalLight) -> PointLight | DirectionalLight:
        if isinstance(it, DirectionalLight):
            return structs.replace(it, direction=way(it.direction))
        return structs.replace(it, position=point(it.position))

    camera, plane, background = scene.camera, scene.plane, scene.background
    if plane is not None:
        plane = structs.replace(plane, point=point(plane.point), normal=way(plane.normal), axis=way(plane.axis))
    if isinstance(background, Gradient):
        background = structs.replace(background, up=way(background.up))
    return structs.replace(
        scene,
        camera=Camera(point(camera.eye), point(camera.look_at), way(camera.up), camera.half_height),
        spheres=tuple(structs.replace(s, center=point(s.center)) for s in scene.spheres),
        lights=tuple(map(light, scene.lights)),
        plane=plane,
        background=background,
    )


# ------------------------------------------------------------------------------------------------------------- points


def scene_points(scene: Scene, count: int, seed: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """(x, y) on the image plane, float64: half over a square window, a quarter within 1e-3 of outlines, a quarter in
    spheres; all over the window where no sphere is in front of the eye."""
    random = np.random.default_rng(seed)
    frame = scene.in_camera_frame()
    half_height, e = frame.camera.half_height, frame.camera.eye[2]
    assert half_height is not None
    x, y = random.uniform(-half_height, half_height, (2, count))
    ahead = [s for s in frame.spheres if e - s.center[2] > 1.01 * s.radius]
    for k in range(count // 2 if ahead else 0):
        sphere = ahead[int(random.integers(len(ahead)))]
        m = np.array(sphere.center) - (0.0, 0.0, e)
        away = np.linalg.norm(m)
        across = np.linalg.svd(m[np.newaxis, :])[2][1:]
        part = 1.0 + random.choice([-1.0, 1.0]) * 10.0 ** random.uniform(-6.0, -3.0) if k % 2 else random.random()
        sine, turn = min(sphere.radius / away * part, 1.0), random.uniform(0.0, 2.0 * math.pi)
        ray = m / away * math.sqrt(1.0 - sine * sine)
        ray = ray + sine * (math.cos(turn) * across[0] + math.sin(turn) * across[1])
        if ray[2] < 0.0:
            x[k], y[k] = e * ray[0] / -ray[2], e * ray[1] / -ray[2]
    return x, y
