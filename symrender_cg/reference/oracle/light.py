"""The light along a ray, in balls: ambient, and light by light what reaches the eye, and what a mirror shows.

Comes in: a scene in whole numbers, a ray, how many bounces are left. Goes out: Look, a ball for each channel and what
it is made of. Never done here: a rounding; a sign that balls and exact numbers leave open raises Undecided.

    n.l = (n.w) / (|n| |w|),   r.v = (w.D n2 - 2 (n.w) (n.D)) / (n2 |w| |D|)   with n, w and D as they are
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import arb, fmpq

from symrender_cg.reference.oracle.rays import Ray, Site, first_hit, mirrored
from symrender_cg.reference.oracle.sites import blocked, normal_to_lamp, paint_at, sign_at, to_lamp
from symrender_cg.reference.oracle.whole import Lamp, Number, Paint, World, direction_of, dot, square_of
from symrender_cg.scene import Gradient


@dataclass(frozen=True, slots=True)
class Lit:
    """A light that adds something: on the surface (n.l > 0), in its highlight. Balls: n.l, (r.v)^n, attenuation."""

    lamp: Lamp
    facing: bool
    shining: bool
    n_dot_l: arb
    power: arb
    share: arb


@dataclass(frozen=True, slots=True)
class Look:
    """What a ray sees: for each channel a number and a ball whose sum is the value; and what they are made of.

    site, paint: None for the background; beyond: what the mirror shows, None where there is none.
    """

    channels: list[tuple[arb, arb]]
    ray: Ray
    site: Site | None
    paint: Paint | None
    lit: tuple[Lit, ...]
    beyond: Look | None


def look(world: World, ray: Ray, bounces: int) -> Look:
    """colour(ray, bounces): the background, or ambient + light by light + reflect colour(mirrored, bounces - 1)"""
    site = first_hit(world, ray)
    if site is None:
        return Look(_background(world, ray), ray, None, None, (), None)
    paint = paint_at(world, site)
    lit = tuple(found for lamp in world.lamps if (found := _lit(world, site, paint, lamp)) is not None)
    added: list[arb | None] = [None] * len(paint.ambient)
    for light in lit:
        for k, intensity in enumerate(light.lamp.intensity):
            more = _surface(paint, light, k) * light.share * intensity
            before = added[k]
            added[k] = more if before is None else before + more
    beyond: Look | None = None
    if bounces > 0 and not paint.reflect.is_zero():
        beyond = look(world, mirrored(site), bounces - 1)
        for k, (ground, above) in enumerate(beyond.channels):
            more, before = (ground + above) * paint.reflect, added[k]
            added[k] = more if before is None else before + more
    nothing = arb(0)
    sums = [(ground, nothing if more is None else more) for ground, more in zip(paint.ambient, added, strict=True)]
    return Look(sums, ray, site, paint, lit, beyond)


def _surface(paint: Paint, light: Lit, channel: int) -> arb:
    """diffuse max(0, n.l) + specular max(0, r.v)^n, where one of them is above 0"""
    if not light.shining:
        return light.n_dot_l * paint.diffuse[channel]
    highlight = light.power * paint.specular[channel]
    return light.n_dot_l * paint.diffuse[channel] + highlight if light.facing else highlight


def _background(world: World, ray: Ray) -> list[tuple[arb, arb]]:
    """The constant, or bottom + (top - bottom) s with s = (1 + up.D / (|up| |D|)) / 2."""
    background = world.frame.background
    if not isinstance(background, Gradient):
        return [(c, arb(0)) for c in world.channels_of(background)]
    up, d = direction_of(background.up), ray.direction
    s = (arb(dot(up, d)) / (arb(dot(up, up)) * dot(d, d)).sqrt() + 1) / 2
    bottom, top = world.channels_of(background.bottom), world.channels_of(background.top)
    return [(low, (high - low) * s) for low, high in zip(bottom, top, strict=True)]


def _lit(world: World, site: Site, paint: Paint, lamp: Lamp) -> Lit | None:
    """The signs of n.l and r.v, whether the light is seen, and how much of it; None where it adds nothing."""
    if lamp.is_dark or not (paint.is_diffuse or paint.is_specular):
        return None
    w = to_lamp(site, lamp)
    w2 = square_of(w)
    if lamp.position is not None and sign_at(site, w2, lambda s: square_of(to_lamp(s, lamp))) == 0:
        return None
    n_dot_w = normal_to_lamp(site, lamp)
    facing = sign_at(site, n_dot_w, lambda s: normal_to_lamp(s, lamp)) > 0
    shining, mirrored_w = False, n_dot_w
    if paint.is_specular and (facing or not paint.material.gate_specular):
        mirrored_w = towards_eye(site, lamp)
        shining = paint.shininess.is_zero() or sign_at(site, mirrored_w, lambda s: towards_eye(s, lamp)) > 0
    if not shining and not (facing and paint.is_diffuse):
        return None
    if world.frame.shadows and blocked(world, site, lamp):
        return None
    one = arb(1)
    inverse_w = arb(w2).rsqrt()
    n_dot_l = n_dot_w * inverse_w * arb(site.n2).rsqrt() if facing else one
    power = share = one
    if shining and not paint.shininess.is_zero():
        power = (mirrored_w * inverse_w * arb(square_of(site.ray.direction)).rsqrt() / site.n2) ** paint.shininess
    if lamp.fading is not None:
        a, b, c = lamp.fading
        unit = arb(fmpq(world.unit.numerator, world.unit.denominator))
        share = 1 / (a + b * unit * arb(w2).sqrt() + c * unit * unit * w2)
    return Lit(lamp, facing, shining, n_dot_l, power, share)


def towards_eye(site: Site, lamp: Lamp) -> Number:
    """r.v |w| |D| n2 = w.D n2 - 2 (n.w) (n.D), with n and w as they are."""
    w, d = to_lamp(site, lamp), site.ray.direction
    return dot(w, d) * site.n2 - normal_to_lamp(site, lamp) * dot(site.normal, d) * 2
