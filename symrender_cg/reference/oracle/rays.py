"""Rays through a scene, each decision proved: what a ray meets first, and what is mirrored.

Comes in: a scene in whole numbers, a ray. Goes out: Site, the point that is seen. Never done here: shading, rounding, a
guess: what the precision at hand leaves open raises Undecided.

Each formula below is written once and takes balls or exact numbers (surds): balls first, and where they do not decide,
the exact ones. A primary ray is whole numbers; its hit point, and with it the mirrored ray, lies in Q(sqrt(disc)); each
mirror adds one root.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from flint import arb, fmpq

from symrender_cg.reference.oracle.signs import Exactly, above_0, all_true, at_least_0
from symrender_cg.reference.oracle.surds import ball, sign, sqrt_of
from symrender_cg.reference.oracle.whole import Ball, Number, Vector, World, cross, dot, minus, plus, scaled, square_of


@dataclass(frozen=True, slots=True)
class Ray:
    """origin + t direction; own: index of the surface that it leaves, -1 the eye, where all numbers are whole.

    mirrors: how many it comes from; exactly: the same ray in exact numbers, None for a ray that is in them.
    """

    origin: Vector
    direction: Vector
    own: int
    mirrors: int
    exactly: Exactly[Ray] | None


@dataclass(frozen=True, slots=True)
class Site:
    """What a ray sees: the surface's index, the point, its normal (not normalised; n2 its square), the ray.

    exactly: the same site in exact numbers, None for a site that is in them.
    """

    index: int
    on_plane: bool
    point: Vector
    normal: Vector
    n2: Number
    ray: Ray
    exactly: Exactly[Site] | None


def first_hit(world: World, ray: Ray) -> Site | None:
    """The nearest surface, the lowest index where several are equally near; None for the background."""
    return _first_hit_from_eye(world, ray) if ray.own < 0 else _first_hit_from_surface(world, ray)


def _first_hit_from_eye(world: World, ray: Ray) -> Site | None:
    """disc in whole numbers, then depths by balls, and by exact order where two balls overlap."""
    d = ray.direction
    a_dd = square_of(d)
    best: tuple[int, Number, Callable[[], Number]] | None = None
    for index in _possible(world, ray):
        sphere = world.balls[index]
        if sphere.kind != index:
            continue
        along = dot(sphere.from_eye, d)
        if along <= 0:
            continue
        disc = along * along - a_dd * sphere.power
        if disc >= 0:
            t = (along - arb(disc).sqrt()) / a_dd
            if best is None or not t > best[1]:
                best = _nearer(best, index, t, partial(_entry, along, disc, a_dd))
    ground = world.ground
    if ground is not None:
        fall = -dot(ground.normal, d)
        if fall > 0:
            best = _nearer(
                best, len(world.balls), arb(ground.eye_height) / fall, partial(fmpq, ground.eye_height, fall)
            )
    if best is None:
        return None
    index, t, exact_t = best
    return _site(world, ray, index, t, exact_t)


def _first_hit_from_surface(world: World, ray: Ray) -> Site | None:
    """The same for a mirrored ray in balls; spheres in doubt are asked exactly unless they are surely behind."""
    best: tuple[int, Number, Callable[[], Number]] | None = None
    doubtful: list[tuple[int, Number]] = []
    a_dd = square_of(ray.direction)
    for index in _possible(world, ray):
        sphere = world.balls[index]
        if sphere.kind != index or index == ray.own:
            continue
        along, disc = _along_and_disc(ray, a_dd, sphere)
        met = all_true(at_least_0(disc), above_0(along))
        if met is None:
            doubtful.append((index, (along - _root(disc)) / a_dd))
        elif met:
            best = _nearer(best, index, (along - disc.sqrt()) / a_dd, partial(_depth, world, ray, index))
    ground, count = world.ground, len(world.balls)
    if ground is not None and ray.own != count:
        fall = -dot(ground.normal, ray.direction)
        meets = above_0(fall)
        if meets is None:
            exact = _exactly(ray)
            meets = sign(-dot(ground.normal, exact.direction)) > 0
        if meets:
            height = dot(ground.normal, minus(ray.origin, ground.point))
            best = _nearer(best, count, height / fall, partial(_depth, world, ray, count))
    for index, t in doubtful:
        if best is not None and t > best[1]:
            continue
        exact = _exactly(ray)
        along, disc = _along_and_disc(exact, square_of(exact.direction), world.balls[index])
        if sign(along) > 0 and sign(disc) >= 0:
            depth = _depth(world, ray, index)
            best = _nearer(best, index, ball(depth), partial(_depth, world, ray, index))
    if best is None:
        return None
    index, t, exact_t = best
    return _site(world, ray, index, t, exact_t)


def _possible(world: World, ray: Ray) -> Sequence[int]:
    """The spheres that the ray could meet, and perhaps others."""
    return range(len(world.balls)) if world.near is None else world.near.of_ray(ray.origin, ray.direction)


def _along_and_disc(ray: Ray, a_dd: Number, sphere: Ball) -> tuple[Number, Number]:
    """m.D and R^2 |D|^2 - |m x D|^2 with m = C - origin."""
    m = minus(sphere.center, ray.origin)
    return dot(m, ray.direction), a_dd * sphere.r2 - square_of(cross(m, ray.direction))


def _depth(world: World, ray: Ray, index: int) -> Number:
    """t of a ray that meets the surface, in exact numbers."""
    exact = _exactly(ray)
    if index == len(world.balls):
        ground = world.ground
        assert ground is not None, "an index beyond the spheres is the plane's"
        height = dot(ground.normal, minus(exact.origin, ground.point))
        return height * fmpq(-1) / dot(ground.normal, exact.direction)
    a_dd = square_of(exact.direction)
    return _entry(*_along_and_disc(exact, a_dd, world.balls[index]), a_dd)


def _entry(along: Number, disc: Number, a_dd: Number) -> Number:
    """(m.D - sqrt(disc)) / |D|^2 in exact numbers"""
    return (fmpq(1) * along - sqrt_of(disc)) / a_dd


def _nearer(
    best: tuple[int, Number, Callable[[], Number]] | None, index: int, t: Number, exact: Callable[[], Number]
) -> tuple[int, Number, Callable[[], Number]]:
    """The nearer of two; the lower index where they are equally near."""
    if best is None or t < best[1]:
        return index, t, exact
    if t > best[1]:
        return best
    apart = 0 if (t - best[1]).is_zero() else sign(exact() - best[2]())
    return (index, t, exact) if apart < 0 or (apart == 0 and index < best[0]) else best


def _site(world: World, ray: Ray, index: int, t: Number, exact_t: Callable[[], Number] | None) -> Site:
    point = plus(ray.origin, scaled(ray.direction, t))
    if index < len(world.balls):
        sphere = world.balls[index]
        normal, n2 = minus(point, sphere.center), sphere.r2
    else:
        assert world.ground is not None, "an index beyond the spheres is the plane's"
        normal, n2 = world.ground.normal, world.ground.n2
    twin: Exactly[Site] | None = None
    if exact_t is not None:
        twin = Exactly(ray.mirrors, lambda: _site(world, _exactly(ray), index, exact_t(), None))
    return Site(index, index == len(world.balls), point, normal, n2, ray, twin)


def mirrored(site: Site) -> Ray:
    """D - 2 (n.D) n from the point."""
    mirrors, source = site.ray.mirrors + 1, site.exactly
    twin = None if source is None else Exactly(mirrors, lambda: mirrored(source()))
    d = site.ray.direction
    two = fmpq(2) if source is None else arb(2)
    factor = two * dot(site.normal, d) / site.n2
    return Ray(site.point, minus(d, scaled(site.normal, factor)), site.index, mirrors, twin)


def _exactly(ray: Ray) -> Ray:
    return ray if ray.exactly is None else ray.exactly()


def _root(value: Number) -> Number:
    """sqrt(max(0, value)) of a ball that reaches below 0."""
    return arb(0).union(arb(value.upper()).sqrt())
