"""What a light adds to points of surfaces, as numbers that know their derivatives: n.l, the highlight, the attenuation.

Comes in: points, the mirrored ray, a light. Goes out: max(0, n.l), max(0, r.v)^n, 1 / (a + b l + c l^2), whether the
light is seen, and decisions for the walk to keep. Never done here: a path, a sweep.

    r.v = l.M, M the mirrored ray of unit length;  max(0, r.v)^n = exp(n/2 log1p(-|l x M|^2)) where r.v > STEEP

At n.l = 0 and r.v = 0 the image bends: close to it the steeper side's slope is taken.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from symrender_cg.scene import DirectionalLight, PointLight
from symrender_cg.stress.adjoint import Floats, Indices, Number, Triple, cross, dot, scaled, unit
from symrender_cg.stress.shadow_edges import Surface, visible

if TYPE_CHECKING:
    from symrender_cg.stress.sight import Walk

KINK: Final = 2.0**-50
"""n.l and r.v below 0 by that much, times what a near light adds, still have the slope of the lit side: a few
roundings."""
MOST_GROWTH: Final = 1e7
"""Roundings that are taken to be off at most, so that not everything behind many mirrors is in doubt."""
STEEP: Final = 0.7
"""r.v above which its power is taken from the sine."""


def lit(
    walk: Walk, seen: Surface, mirrored: Triple, shininess: Number, number: int, light: PointLight | DirectionalLight
) -> tuple[Number, Number, Number, Floats]:
    """max(0, n.l), max(0, r.v)^n, the attenuation, and 1 where the light is seen."""
    world, points = walk.world, seen.points
    one = shininess.made(np.ones(points.size))
    if isinstance(light, DirectionalLight):
        given = walk.vector(f"lights[{number}].direction", np.array(light.direction)[:, np.newaxis], 0, points)
        l_hat, distance, share = unit(scaled(given, -1.0))[0], one.made(np.full(points.size, np.inf)), one
    else:
        position = (np.array(light.position) / world.scale)[:, np.newaxis]
        place = walk.vector(f"lights[{number}].position", position, 0, points)
        l_hat, distance = unit(seen.to(place))
        share = _attenuation(walk, distance, number, light, points) if light.attenuation != (1.0, 0.0, 0.0) else one
        walk.collect(distance, distance.value / seen.reach / seen.growth, points, "light on the surface")
    acts = distance.value > 0.0
    facing, shining = dot(seen.normal, l_hat), dot(l_hat, mirrored)
    growth = seen.growth * (1.0 + seen.reach / distance.value)
    edge = KINK * np.minimum(1.0 + seen.reach / distance.value, MOST_GROWTH)
    diffuse = facing.made(np.maximum(facing.value, 0.0), (facing, np.where(facing.value > -edge, 1.0, 0.0)))
    aside = cross(l_hat, mirrored)
    power = _power(shining, dot(aside, aside).value, shininess, edge)
    gated = world.gated[seen.material]
    highlight = power.value * (world.specular[seen.material] * world.colour(light.intensity)).max(axis=1) > 0.0
    near = facing.value / growth
    walk.collect(facing, np.where(gated & highlight, near, np.inf), points, "gate of a highlight")
    steep = (shininess.value > 0.0) & (shininess.value < 1.0)
    walk.collect(shining, np.where(steep, shining.value / growth, np.inf), points, "highlight of n < 1")
    dark = gated & ~(facing.value > 0.0)
    power = power.made(np.where(dark, 0.0, power.value), (power, np.where(dark, 0.0, 1.0)))
    shown = np.where(acts, 1.0, 0.0)
    if world.frame.shadows:
        matters = acts & ((diffuse.value > 0.0) | (power.value > 0.0))
        shown = shown * visible(walk, seen, l_hat, distance, number, light, matters)
    return diffuse, power, share, shown


def _attenuation(walk: Walk, distance: Number, number: int, light: PointLight, points: Indices) -> Number:
    """1 / (a + b l + c l^2), l in scene units; 0, and at rest, where the sum is beyond float64."""
    far = distance * walk.world.scale
    a, b, c = (
        walk.tape.input(f"lights[{number}].attenuation[{k}]", np.array(entry), 0, points)
        for k, entry in enumerate(light.attenuation)
    )
    total = a.value + b.value * far.value + c.value * far.value * far.value
    share = 1.0 / total

    def slope(of_total: Floats) -> Floats:
        return np.where(share > 0.0, -share * (share * of_total), 0.0)

    return a.made(
        share,
        (a, slope(np.ones(points.size))),
        (b, slope(far.value)),
        (c, slope(far.value * far.value)),
        (far, slope(b.value + 2.0 * c.value * far.value)),
    )


def _power(cosine: Number, sine2: Floats, shininess: Number, edge: Floats) -> Number:
    """max(0, cosine)^n, 1 where n = 0. Within `edge` of 0 its slope is at least 1: c^n <= c for n >= 1."""
    n, c = shininess.value, np.maximum(cosine.value, 0.0)
    log = np.where(cosine.value > STEEP, 0.5 * np.log1p(-np.minimum(sine2, 0.75)), np.log(c))
    value = np.where(n == 0.0, 1.0, np.exp(n * log))
    lit = (cosine.value > 0.0) & (value > 0.0)
    slope = np.where(lit, n * value / np.where(lit, c, 1.0), 0.0)
    at_edge = (n >= 1.0) & (np.abs(cosine.value) < edge)
    by_n = np.where(lit, value * np.where(lit, log, 0.0), 0.0)
    return cosine.made(value, (cosine, np.where(at_edge, np.maximum(slope, 1.0), slope)), (shininess, by_n))
