"""Decisions at a point that is seen: signs, who stands before a light, which tile it is.

Comes in: a Site and a light. Goes out: signs, booleans, a material. Never done here: shading, rounding, a guess: what
the precision at hand leaves open raises Undecided. Balls are asked first, exact numbers where they do not decide.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from flint import arb, fmpz

from symrender_cg.reference.oracle.rays import Site
from symrender_cg.reference.oracle.signs import Undecided, above_0, all_true, at_least_0
from symrender_cg.reference.oracle.surds import floor_over_root, sign
from symrender_cg.reference.oracle.whole import (
    Ball,
    Ground,
    Lamp,
    Number,
    Paint,
    Vector,
    World,
    cross,
    dot,
    minus,
    square_of,
)


def sign_at(site: Site, value: Number, number: Callable[[Site], Number]) -> int:
    """The sign of value = number(site): by its ball, else exactly. Raises Undecided."""
    if value > 0:
        return 1
    if value < 0:
        return -1
    if value == 0:
        return 0
    assert site.exactly is not None, "only balls leave a sign open"
    return sign(number(site.exactly()))


def to_lamp(site: Site, lamp: Lamp) -> Vector:
    """w, from the point to the light; towards it for a direction."""
    return lamp.towards if lamp.position is None else minus(lamp.position, site.point)


def normal_to_lamp(site: Site, lamp: Lamp) -> Number:
    """n.w; on the plane the light's height above it, whatever the point."""
    return lamp.height if site.on_plane else dot(site.normal, to_lamp(site, lamp))


def blocked(world: World, site: Site, lamp: Lamp) -> bool:
    """Whether another sphere meets the open segment to the light, or the plane parts the two."""
    ground = world.ground
    undecided = False
    if ground is not None and lamp.height < 0 and not site.on_plane:
        try:
            if sign_at(site, _height(ground, site), lambda s: _height(ground, s)) > 0:
                return True
        except Undecided:
            undecided = True
    own = -1 if site.on_plane else world.balls[site.index].kind
    w = to_lamp(site, lamp)
    w2 = square_of(w)
    for index in _between(world, site, lamp, w):
        sphere = world.balls[index]
        if index == site.index:
            continue
        try:
            if sphere.kind == own:  # the same sphere again: the segment enters it where it leaves the point inwards
                if sign_at(site, normal_to_lamp(site, lamp), lambda s: normal_to_lamp(s, lamp)) < 0:
                    return True
            elif sphere.kind == index and _stands_before(site, sphere, lamp, bool(lamp.inside[index]), w, w2):
                return True
        except Undecided:
            undecided = True
    if undecided:
        raise Undecided
    return False


def _between(world: World, site: Site, lamp: Lamp, w: Vector) -> Sequence[int]:
    """The spheres that the segment could meet, and perhaps others."""
    if world.near is None:
        return range(len(world.balls))
    if lamp.position is None:
        return world.near.of_ray(site.point, w)
    return world.near.of_segment(site.point, w, lamp.inside)


def _height(ground: Ground, site: Site) -> Number:
    return dot(ground.normal, minus(site.point, ground.point))


def _stands_before(site: Site, sphere: Ball, lamp: Lamp, inside: bool, w: Vector, w2: Number) -> bool:
    """The closed ball meets P + s w, 0 < s < 1 (s > 0 for a direction); P is not inside it.

    disc = R^2 |w|^2 - |m x w|^2 >= 0 and m.w > 0, m = C - P, and m.w < |w|^2 unless the light is inside.
    """
    m = minus(sphere.center, site.point)
    along = dot(m, w)
    ahead = above_0(along)
    if ahead is False:
        return False
    reached = True if inside or lamp.position is None else above_0(w2 - along)
    met = all_true(ahead, reached, at_least_0(w2 * sphere.r2 - square_of(cross(m, w))))
    if met is not None:
        return met
    assert site.exactly is not None, "only balls leave a sign open"
    exact = site.exactly()
    exact_w = to_lamp(exact, lamp)
    return _stands_before(exact, sphere, lamp, inside, exact_w, square_of(exact_w))


def paint_at(world: World, site: Site) -> Paint:
    """The sphere's, the plane's, or that of the plane's tile."""
    if not site.on_plane:
        return world.balls[site.index].paint
    ground = world.ground
    assert ground is not None, "an index beyond the spheres is the plane's"
    if ground.checker is ground.paint:
        return ground.paint
    return ground.checker if (_tile(ground, site, 0) + _tile(ground, site, 1)) % 2 else ground.paint


def _tile(ground: Ground, site: Site, axis: int) -> int:
    """floor(u.(P - point) / tile) with u = axis / |axis|."""
    square = ground.axes2[axis] * ground.tile**2
    tiles = arb(dot(ground.axes[axis], minus(site.point, ground.point))) / arb(square).sqrt()
    whole = tiles.floor().unique_fmpz()
    if whole is not None:
        return int(whole)
    near = (tiles + 0.5).floor().unique_fmpz()
    if near is None:
        raise Undecided
    assert site.exactly is not None, "only balls leave a sign open"
    exact = dot(ground.axes[axis], minus(site.exactly().point, ground.point))
    return floor_over_root(exact, fmpz(square), int(near))
