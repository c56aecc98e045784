"""Families of more than one sphere: shadow edges, contacts, the plane of the eye, far mirrors, depths that are nearly
equal, a plane with its tiles and its horizon.

Comes in: dice. Goes out: a scene in the camera's frame and a point, or None where the dice hold no such case; edges are
found by the oracle, to neighbouring floats. Never done here: an evaluation in floating point.
"""

from __future__ import annotations

import math
from typing import Final

from msgspec import structs

from symrender_cg.errors import AccuracyError
from symrender_cg.scene import Camera, DirectionalLight, Phong, Plane, PointLight, Scene, Sphere, Vector
from symrender_cg.stress.cases import Dice, Drawn
from symrender_cg.stress.searches import Side, edge_in_row
from symrender_cg.stress.truth import first_surface, true_value

MATERIAL: Final = Phong(0.1, 0.7, 0.5, 32.0)
OTHER: Final = Phong(0.3, 0.6, 0.2, 8.0)
DARK: Final = Phong(0.0, 0.7, 0.5, 32.0)
MIRROR: Final = Phong(0.05, 0.2, 0.5, 32.0, reflect=0.8)
EYE: Final = 4.0
CAMERA: Final = Camera((0.0, 0.0, EYE), half_height=2.0)
TRIPLES: Final = (
    (3.0, 4.0, 0.0, 5.0),
    (4.0, 3.0, 0.0, 5.0),
    (2.0, 1.0, 2.0, 3.0),
    (1.0, 2.0, -2.0, 3.0),
    (2.0, 3.0, 6.0, 7.0),
)
"""(x, y, z) of length r, all whole."""


def shadow_edge(dice: Dice) -> Drawn | None:
    """A sphere's shadow on another, its edge between neighbouring floats, light as flat as 1e-6 to the surface."""
    normal = _towards_eye(dice)
    point = _plus((0.0, 0.0, 0.0), normal, 1.0)
    tangent = _unit(_cross(normal, dice.direction()))
    grazing = dice.ten_to(-6.0, -0.1)
    way = _unit(_plus(_times(tangent, math.sqrt(max(0.0, 1.0 - grazing * grazing))), normal, grazing))
    away = dice.ten_to(0.0, 1.0)
    radius = dice.real(0.1, 0.6)
    between = away * dice.real(0.3, 0.8)
    aside = _unit(_cross(way, dice.direction()))
    blocker = Sphere(_plus(_plus(point, way, between), aside, radius), radius, OTHER)
    if math.hypot(*blocker.center) < 1.0 + radius or blocker.center[2] + radius > EYE:
        return None
    lights = (PointLight(_plus(point, way, away)),)
    scene = _scene((Sphere((0.0, 0.0, 0.0), 1.0, MATERIAL), blocker), lights)
    if scene is None:
        return None
    x, y = _on_plane(point)
    bare = _without_highlights(scene)
    found = _edge(lambda u, v: true_value(bare, u, v) > 0.0, x, y, dice.ten_to(-4.0, -1.0), dice)
    return None if found is None else (scene, found, y, f"a shadow's edge, the light {grazing:.0e} above the surface")


def contact(dice: Dice) -> Drawn | None:
    """Two spheres that touch exactly, or are one float apart or together, near the point of contact."""
    x, y, z, r = dice.one(TRIPLES)
    share = dice.one((0.5, 0.25, 0.75, 0.125))
    unit = 2.0 ** dice.whole(-3, -2)
    center = (x * unit * dice.one((1.0, -1.0)), y * unit * dice.one((1.0, -1.0)), z * unit)
    first, second = r * unit * share, r * unit * (1.0 - share)
    if (gap := dice.whole(-2, 2)) and dice.often(0.7):
        second = second + gap * math.ulp(second)
    light = (dice.real(-5.0, 5.0), dice.real(1.0, 5.0), dice.real(1.0, 8.0))
    scene = _scene((Sphere((0.0, 0.0, 0.0), first, MATERIAL), Sphere(center, second, OTHER)), (PointLight(light),))
    if scene is None:
        return None
    u, v = _on_plane(_times(center, share))
    away, turn = 0.0 if dice.often(0.1) else dice.ten_to(-17.0, -1.0) * unit, dice.real(0.0, 2.0 * math.pi)
    return scene, u + away * math.cos(turn), v + away * math.sin(turn), "two spheres that touch, to a float"


def eye_plane(dice: Dice) -> Drawn | None:
    """A sphere that crosses the plane of the eye: rays to it are long, and half of it is behind the eye."""
    radius = dice.real(0.5, 2.0)
    depth = radius * dice.one((0.0, 1.0, dice.real(-0.99, 0.99), dice.ten_to(-12.0, -1.0)))
    aside, turn = radius * (1.0 + dice.ten_to(-6.0, 0.5)), dice.real(0.0, 2.0 * math.pi)
    center = (aside * math.cos(turn), aside * math.sin(turn), EYE - depth)
    normal = _unit(_plus(_plus((0.0, 0.0, EYE), center, -1.0), dice.direction(), aside * dice.real(0.0, 1.0)))
    point = _plus(center, normal, radius)
    to_eye = _plus((0.0, 0.0, EYE), point, -1.0)
    if _dot(to_eye, normal) <= 0.0 or point[2] >= EYE - 1e-9:
        return None
    light = _plus(point, dice.direction(), radius * dice.ten_to(0.0, 1.0))
    scene = _scene((Sphere(center, radius, MATERIAL),), (PointLight(light),), 4.0 * EYE)
    return None if scene is None else (scene, *_on_plane(point), "a sphere across the plane of the eye")


def far_mirror(dice: Dice) -> Drawn | None:
    """A sphere 10 to 1e6 radii away, seen in a mirror: rounding turns the mirrored ray, and the far end moves."""
    away = dice.ten_to(1.0, 6.0)
    size = away * dice.real(0.02, 0.3)
    normal = _towards_eye(dice, 0.5)
    view = _unit(_plus((0.0, 0.0, EYE), normal, -1.0))
    twice = 2.0 * _dot(normal, view)
    way = _unit(_plus(_times(view, -1.0), normal, twice))
    seen = _plus(normal, way, away)
    off = _times(_unit(_cross(way, dice.direction())), size * dice.one((0.0, dice.real(0.0, 0.99))))
    light = _plus(seen, _unit(_plus(_times(way, -1.0), dice.direction(), 0.7)), size * dice.real(2.0, 9.0))
    ball = Sphere(_plus(_plus(seen, way, size), off, 1.0), size, OTHER)
    if abs(ball.center[2] - EYE) < 1.01 * size:
        return None
    scene = _scene((Sphere((0.0, 0.0, 0.0), 1.0, MIRROR), ball), (PointLight(light),))
    return None if scene is None else (scene, *_on_plane(normal), f"a mirrored sphere {away:.0e} away")


def mirrored_outline(dice: Dice) -> Drawn | None:
    """The outline of a sphere as it is seen in a mirror, between floats."""
    drawn = far_mirror(dice)
    if drawn is None or not isinstance(drawn[0], Scene):
        return None
    scene, x, y, _ = drawn
    assert isinstance(scene, Scene)
    mirror, ball = scene.spheres
    coded = structs.replace(
        scene,
        spheres=(_plain(mirror, 0.0, 0.5), _plain(ball, 1.0, 0.0)),
        lights=(),
        background=0.0,
    )
    found = _edge(lambda u, v: true_value(coded, u, v) > 0.0, x, y, 0.3, dice)
    return None if found is None else (scene, found, y, "an outline in a mirror")


def near_depths(dice: Dice) -> Drawn | None:
    """Two spheres that cut each other, beside the line of equal depths: the difference is 1e-1 to 1e-17."""
    radius = dice.real(0.5, 1.0)
    way = dice.direction()
    size = dice.real(0.3, 1.0)
    center = _times(way, dice.real(abs(radius - size) + 0.05, radius + size - 0.05))
    light = (dice.real(-5.0, 5.0), dice.real(1.0, 5.0), dice.real(3.0, 8.0))
    scene = _scene((Sphere((0.0, 0.0, 0.0), radius, MATERIAL), Sphere(center, size, OTHER)), (PointLight(light),))
    if scene is None:
        return None
    y = dice.real(-1.0, 1.0) * radius
    found = _between(scene, (0, 1), y, dice)
    return None if found is None else (scene, found, y, "two depths that are nearly equal")


def horizon_light(dice: Dice) -> Drawn | None:
    """A light in a plane, or up to 1e-15 above it: the plane is lit along itself, and a sphere shadows it for ever."""
    height = dice.one((0.0, 1.0, 1.0)) * dice.ten_to(-16.0, -3.0)
    if dice.often(0.5):
        turn = dice.real(0.0, 2.0 * math.pi)
        light: PointLight | DirectionalLight = DirectionalLight((math.cos(turn), -height, math.sin(turn)))
    else:
        light = PointLight((dice.real(-4.0, 4.0), -1.0 + height, dice.real(-6.0, 2.0)))
    scene = _with_plane(light, None)
    x, y = dice.real(-1.5, 1.5), -dice.ten_to(-4.0, 0.2)
    if scene is None or dice.often(0.3):
        return None if scene is None else (scene, x, -dice.ten_to(-15.0, -3.0), "a light in the plane, at the horizon")
    return scene, x, y, "a light in the plane"


def tile_edge(dice: Dice) -> Drawn | None:
    """A tile's edge, exactly or between floats: which colour is a floor of a rounded number."""
    scene = _with_plane(PointLight((3.0, 4.0, 2.0)), dice)
    if scene is None:
        return None
    coded = structs.replace(
        scene,
        spheres=(_plain(scene.spheres[0], 0.5, 0.0),),
        plane=_coded(scene.plane),
        lights=(),
        background=0.25,
    )
    if dice.often(0.3):
        y = -(2.0 ** -dice.whole(0, 4))
        return scene, dice.whole(-6, 6) * 0.5 * -y, y, "a tile's edge, exactly"
    y = -dice.ten_to(-1.5, 0.2)
    found = _edge(lambda u, v: true_value(coded, u, v), dice.real(-1.0, 1.0), y, 0.6, dice)
    return None if found is None else (scene, found, y, "a tile's edge, to a float")


# ------------------------------------------------------------------------------------------------------------- pieces


def _scene(
    spheres: tuple[Sphere, ...], lights: tuple[PointLight | DirectionalLight, ...], half_height: float = 2.0
) -> Scene | None:
    """The scene in the camera's frame; None where the eye is in a sphere, or within 1e-6 of it."""
    for sphere in spheres:
        if math.dist(sphere.center, (0.0, 0.0, EYE)) <= sphere.radius * (1.0 + 1e-7):
            return None
    return Scene(structs.replace(CAMERA, half_height=half_height), spheres, lights)


def _with_plane(light: PointLight | DirectionalLight, tiles: Dice | None) -> Scene | None:
    """The plane y = -1, plain and with a sphere that is sunk in it, or in tiles of a half under a sphere."""
    plane = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), DARK)
    if tiles is not None:
        plane = structs.replace(plane, material=MATERIAL, checker=OTHER, tile=0.5)
    sphere = Sphere((0.5, -0.75 if tiles is None else -0.25, -1.0), 0.5, MATERIAL)
    return Scene(CAMERA, (sphere,), (light,), plane=plane)


def _coded(plane: Plane | None) -> Plane | None:
    """The same tiles as numbers of their own, without light."""
    if plane is None:
        return None
    return structs.replace(plane, material=Phong(1.0, 0.0, 0.0, 1.0), checker=Phong(2.0, 0.0, 0.0, 1.0))


def _plain(sphere: Sphere, ambient: float, reflect: float) -> Sphere:
    return structs.replace(sphere, material=Phong(ambient, 0.0, 0.0, 1.0, reflect=reflect))


def _without_highlights(scene: Scene) -> Scene:
    """Diffuse light alone, on the first sphere alone."""
    first, *rest = scene.spheres
    lit = structs.replace(first, material=Phong(0.0, 1.0, 0.0, 1.0))
    return structs.replace(scene, spheres=(lit, *(_plain(sphere, 0.0, 0.0) for sphere in rest)))


def _edge(side: Side, x: float, y: float, reach: float, dice: Dice) -> float | None:
    """An edge of the row y within `reach` of x; None where there is none or where the oracle leaves it open."""
    try:
        return edge_in_row(side, x - reach, x + reach, y, dice)
    except AccuracyError:
        return None


def _between(scene: Scene, surfaces: tuple[int, int], y: float, dice: Dice) -> float | None:
    """An edge of the row y between two surfaces, both of them seen."""
    xs = [-1.5 + 3.0 * k / 48 for k in range(49)]
    seen = [first_surface(scene, x, y) for x in xs]
    pairs = [(a, b) for a, b, i, j in zip(xs, xs[1:], seen, seen[1:], strict=False) if {i, j} == set(surfaces)]
    if not pairs:
        return None
    low, high = dice.one(pairs)
    return _edge(lambda u, v: first_surface(scene, u, v), 0.5 * (low + high), y, 0.5 * (high - low), dice)


def _towards_eye(dice: Dice, least: float = 0.3) -> Vector:
    """A normal of the unit sphere at the origin that is seen from the eye, n.v at least about `least`."""
    while True:
        x, y, z = dice.direction()
        if z >= 1.0 / EYE + least * 0.9:
            return x, y, z


def _on_plane(point: Vector) -> tuple[float, float]:
    """Where a point is seen on the image plane, to rounding."""
    depth = (EYE - point[2]) / EYE
    return point[0] / depth, point[1] / depth


def _plus(a: Vector, b: Vector, factor: float) -> Vector:
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _times(a: Vector, factor: float) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _unit(a: Vector) -> Vector:
    return _times(a, 1.0 / math.sqrt(_dot(a, a)))
