"""Rays through a scene in balls, each decision proved: first hits, who stands before a light, what is mirrored.

Comes in: a scene in whole numbers, a ray. Goes out: Site, the point that is seen; booleans about it. Never done here:
shading, rounding, a guess: what the precision at hand leaves open raises Undecided.

A primary ray is whole numbers, and its hit point lies in Q(q), q = sqrt(disc). Each formula below is written once and
takes either numbers: balls first, and where they do not decide, the exact ones (Surd). Behind a mirror there are only
balls.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from flint import arb, fmpq, fmpz

from symrender_cg.reference.scene_whole import (
    Ball,
    Ground,
    Lamp,
    Number,
    Vector,
    World,
    cross,
    dot,
    minus,
    plus,
    scaled,
    square_of,
)
from symrender_cg.reference.surds import Surd, floor_over_root, order
from symrender_cg.scene import Phong


class Undecided(Exception):  # noqa: N818 - not an error: the next precision may decide it
    """A sign that balls of this precision leave open."""


# ------------------------------------------------------------------------------------------------------- first hits


@dataclass(frozen=True, slots=True)
class Ray:
    """origin + t direction; own: index of the surface that it leaves, -1 the eye, where all numbers are whole."""

    origin: Vector
    direction: Vector
    own: int


@dataclass(frozen=True, slots=True)
class Site:
    """What a ray sees: the surface's index, the point, its normal (not normalised; n2 its square), the ray's D.

    exactly: the same site in exact numbers, of a primary ray; None behind a mirror, and of the exact site itself.
    """

    index: int
    on_plane: bool
    point: Vector
    normal: Vector
    n2: Number
    direction: Vector
    exactly: Callable[[], Site] | None


def first_hit(world: World, ray: Ray) -> Site | None:
    """The nearest surface, the lowest index where several are equally near; None for the background."""
    if ray.own < 0:
        return _first_hit_from_eye(world, ray)
    best: tuple[int, Number] | None = None
    open_: list[Number] = []
    a_dd = square_of(ray.direction)
    for index, ball in enumerate(world.balls):
        if ball.kind != index or index == ray.own:
            continue
        m = minus(ball.center, ray.origin)
        along = dot(m, ray.direction)
        disc = ball.r2 * a_dd - square_of(cross(m, ray.direction))
        met = _all_true(_at_least_0(disc), _above_0(along))
        if met is None:
            open_.append((along - _root(disc)) / a_dd)
        elif met:
            best = _nearer(best, (index, (along - disc.sqrt()) / a_dd))
    ground = world.ground
    if ground is not None and ray.own != len(world.balls):
        fall = -dot(ground.normal, ray.direction)
        meets = _above_0(fall)
        if meets is None:
            raise Undecided
        if meets:
            height = dot(ground.normal, minus(ray.origin, ground.point))
            best = _nearer(best, (len(world.balls), height / fall))
    if open_ and (best is None or not all(t > best[1] for t in open_)):
        raise Undecided
    if best is None:
        return None
    index, t = best
    return _site(world, ray, index, t, None)


def _nearer(best: tuple[int, Number] | None, other: tuple[int, Number]) -> tuple[int, Number]:
    if best is None or other[1] < best[1]:
        return other
    if other[1] > best[1] or (other[1] - best[1]).is_zero():
        return best
    raise Undecided


def _first_hit_from_eye(world: World, ray: Ray) -> Site | None:
    """The same in whole numbers: disc, then depths by balls, and by exact order where two balls overlap."""
    d = ray.direction
    a_dd = square_of(d)
    best: tuple[int, Number, Surd] | None = None
    for index, ball in enumerate(world.balls):
        if ball.kind != index:
            continue
        along = dot(minus(ball.center, ray.origin), d)
        if along <= 0:
            continue
        disc = along * along - a_dd * ball.power
        if disc >= 0:
            best = _nearer_exactly(best, index, (along - arb(disc).sqrt()) / a_dd, (along, disc, a_dd))
    ground = world.ground
    if ground is not None:
        fall = -dot(ground.normal, d)
        if fall > 0:
            height = dot(ground.normal, minus(ray.origin, ground.point))
            t = fmpq(height, fall)
            best = _nearer_exactly(best, len(world.balls), arb(t), (t, fmpz(0), fmpz(1)))
    if best is None:
        return None
    index, t, exact = best
    return _site(world, ray, index, t, exact)


def _nearer_exactly(
    best: tuple[int, Number, Surd] | None, index: int, t: Number, parts: tuple[Number, fmpz, fmpz]
) -> tuple[int, Number, Surd]:
    """parts: (a, disc, A) of t = (a - sqrt(disc)) / A."""
    if best is not None and t > best[1]:
        return best
    a, disc, a_dd = parts
    exact = (Surd(a) - Surd.root(disc)) / a_dd
    if best is None or t < best[1] or order(exact, best[2]) < 0:
        return index, t, exact
    return best


def _site(world: World, ray: Ray, index: int, t: Number, exact: Surd | None) -> Site:
    point = plus(ray.origin, scaled(ray.direction, t))
    if index < len(world.balls):
        ball = world.balls[index]
        normal, n2 = minus(point, ball.center), ball.r2
    else:
        assert world.ground is not None, "an index beyond the spheres is the plane's"
        normal, n2 = world.ground.normal, world.ground.n2
    exactly = None if exact is None else lambda: _site(world, ray, index, exact, None)
    return Site(index, index == len(world.balls), point, normal, n2, ray.direction, exactly)


def mirrored(site: Site) -> Ray:
    """D - 2 (n.D) n from the point."""
    d = site.direction
    factor = arb(2) * dot(site.normal, d) / site.n2
    return Ray(site.point, minus(d, scaled(site.normal, factor)), site.index)


# ------------------------------------------------------------------------------------------------ decisions at a site


def sign_at(site: Site, number: Callable[[Site], Number]) -> int:
    """The sign of a number that is made of a site: by balls, else exactly. Raises Undecided."""
    value = number(site)
    if isinstance(value, Surd):
        return value.sign()
    if value > 0:
        return 1
    if value < 0:
        return -1
    if value == 0:
        return 0
    if site.exactly is None:
        raise Undecided
    return sign_at(site.exactly(), number)


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
            if sign_at(site, lambda s: dot(ground.normal, minus(s.point, ground.point))) > 0:
                return True
        except Undecided:
            undecided = True
    own = -1 if site.on_plane else world.balls[site.index].kind
    for index, ball in enumerate(world.balls):
        if index == site.index:
            continue
        try:
            if ball.kind == own:  # the same sphere again: the segment enters it where it leaves the point inwards
                if sign_at(site, lambda s: normal_to_lamp(s, lamp)) < 0:
                    return True
            elif ball.kind == index and _stands_before(site, ball, lamp, lamp.inside[index]):
                return True
        except Undecided:
            undecided = True
    if undecided:
        raise Undecided
    return False


def _stands_before(site: Site, ball: Ball, lamp: Lamp, inside: bool) -> bool:
    """The closed ball meets P + s w, 0 < s < 1 (s > 0 for a direction); P is not inside it.

    disc = R^2 |w|^2 - |m x w|^2 >= 0 and m.w > 0, m = C - P, and m.w < |w|^2 unless the light is inside.
    """
    w = to_lamp(site, lamp)
    m = minus(ball.center, site.point)
    along = dot(m, w)
    ahead = _above_0(along)
    if ahead is False:
        return False
    w2 = square_of(w)
    reached = True if inside or lamp.position is None else _above_0(w2 - along)
    met = _all_true(ahead, reached, _at_least_0(ball.r2 * w2 - square_of(cross(m, w))))
    if met is not None:
        return met
    if site.exactly is None:
        raise Undecided
    return _stands_before(site.exactly(), ball, lamp, inside)


def material_at(world: World, site: Site) -> Phong:
    """The sphere's, the plane's, or that of the plane's tile."""
    if not site.on_plane:
        return world.balls[site.index].material
    ground = world.ground
    assert ground is not None, "an index beyond the spheres is the plane's"
    if ground.checker == ground.material:
        return ground.material
    return ground.checker if (_tile(ground, site, 0) + _tile(ground, site, 1)) % 2 else ground.material


def _tile(ground: Ground, site: Site, axis: int) -> int:
    """floor(u.(P - point) / tile) with u = axis / |axis|."""
    square = ground.axes2[axis] * ground.tile**2
    across = dot(ground.axes[axis], minus(site.point, ground.point))
    if isinstance(across, Surd):
        value = across.rational()
        assert value is not None, "a ray of whole numbers meets a plane of whole numbers in a rational point"
        return floor_over_root(value, Fraction(int(square)))
    whole = (across / arb(square).sqrt()).floor().unique_fmpz()
    if whole is not None:
        return int(whole)
    if site.exactly is None:
        raise Undecided
    return _tile(ground, site.exactly(), axis)


def _above_0(value: Number) -> bool | None:
    """value > 0, None where a ball leaves it open."""
    if isinstance(value, Surd):
        return value.sign() > 0
    return True if value > 0 else False if value <= 0 else None


def _at_least_0(value: Number) -> bool | None:
    if isinstance(value, Surd):
        return value.sign() >= 0
    return True if value >= 0 else False if value < 0 else None


def _all_true(*parts: bool | None) -> bool | None:
    """False where one part is, None where none is false and one is open."""
    if False in parts:
        return False
    return None if None in parts else True


def _root(value: Number) -> Number:
    """sqrt(max(0, value)) of a ball that reaches below 0."""
    return arb(0).union(arb(value.upper()).sqrt())
