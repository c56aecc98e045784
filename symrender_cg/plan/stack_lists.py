"""The lists of scenes that were weighed together: the rows of their Arrangements, without an Arrangement for each.

Comes in: `Weighed`, and which of its scenes. Goes out: `Decided`, spheres, lamps and blockers by positions, in the
order that symrender_cg.plan.arrangement gives them. Never done here: a comparison of geometry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from symrender_cg.plan.measures import Indices, Truths
from symrender_cg.plan.stack import Stack, Weighed
from symrender_cg.scene import DirectionalLight, PointLight, Scene


@dataclass(frozen=True, eq=False)
class Decided:
    """The lists of some scenes of a stack, T of them.

    chosen          (T,): which scenes of the stack
    spheres         (T, S): indices of the scene's spheres; visible ones front to back, then others that cast shadows
    lamps_begin     (T, S + 1); lamp_light, lamp_terms: the lamps of all scenes one after the other, `lamps` (T,) each
    blockers_begin  lamps + 1 of each scene, one after the other; blockers: `shades` (T,) each
    terms are 1 for diffuse, 2 for specular, 4 for gated.
    """

    chosen: Indices
    spheres: Indices
    lamps: Indices
    lamps_begin: Indices
    lamp_light: Indices
    lamp_terms: Indices
    shades: Indices
    blockers_begin: Indices
    blockers: Indices


def decide(weighed: Weighed, chosen: Indices) -> Decided:
    """The lists of the chosen scenes, ascending, by positions in their spheres, as symrender_cg.plan.arrangement has
    them."""
    stack, lamps, shades = weighed.stack, weighed.lamps, weighed.shades
    number, count, front = stack.radius.shape[1], len(chosen), weighed.front[chosen]
    place = np.full(stack.count, -1, dtype=np.int64)
    place[chosen] = np.arange(count)
    some = place[shades.scene] >= 0
    t, v, light, b = (part[some] for part in (place[shades.scene], shades.rank, shades.light, shades.blocker))
    spheres = np.concatenate((front, _others(stack, chosen, front, b)), axis=1)
    position = np.full((count, number), -1, dtype=np.int64)
    np.put_along_axis(position, spheres, np.broadcast_to(np.arange(spheres.shape[1]), spheres.shape), axis=1)

    order = _light_order(stack, weighed.scene, chosen)
    rank_of = np.argsort(order, axis=1)

    def by_rank(terms: Truths) -> Truths:
        return np.asarray(np.take_along_axis(terms[chosen], order[:, np.newaxis], axis=2))

    adds = by_rank(lamps.any)
    number_of = np.cumsum(adds.reshape(count, -1), axis=1).reshape(adds.shape) - 1
    counts = adds.sum(axis=(1, 2))
    begin = np.zeros((count, spheres.shape[1] + 1), dtype=np.int64)
    begin[:, 1 : front.shape[1] + 1] = np.cumsum(adds.sum(axis=2), axis=1)
    begin[:, front.shape[1] + 1 :] = counts[:, np.newaxis]
    lamp_scene, _, rank = np.nonzero(adds)
    terms = np.zeros(adds.shape, dtype=np.int64)
    for term, holds in enumerate((lamps.diffuse, lamps.specular, lamps.gated)):
        terms += by_rank(holds).astype(np.int64) << term

    lamp = (np.cumsum(counts) - counts)[t] + number_of[t, v, rank_of[t, light]]
    at = position[t, b]
    ordered = np.lexsort((at, lamp))
    held = np.bincount(lamp, minlength=int(counts.sum()))
    shaded = np.bincount(t, minlength=count)
    ends = np.cumsum(held) - np.repeat(np.cumsum(shaded) - shaded, counts)
    blockers_begin = np.zeros(int(counts.sum()) + count, dtype=np.int64)
    blockers_begin[np.arange(len(ends)) + lamp_scene + 1] = ends
    return Decided(
        chosen=chosen,
        spheres=spheres,
        lamps=counts,
        lamps_begin=begin,
        lamp_light=order[lamp_scene, rank],
        lamp_terms=terms[adds],
        shades=shaded,
        blockers_begin=blockers_begin,
        blockers=at[ordered],
    )


def _others(stack: Stack, chosen: Indices, front: Indices, blockers: Indices) -> Indices:
    """(T, others): spheres that are not visible and cast a shadow in some scene, by radius, centre, then index.

    One that casts none in a scene is in none of its lists.
    """
    unseen = np.bincount(blockers, minlength=stack.radius.shape[1]).astype(bool)
    unseen[front[0]] = False
    others = np.flatnonzero(unseen)
    c, r = stack.center[chosen][:, others], stack.radius[chosen][:, others]
    ranks = np.lexsort((np.broadcast_to(others, r.shape), c[..., 2], c[..., 1], c[..., 0], r), axis=1)
    return np.asarray(others[ranks])


def _light_order(stack: Stack, scene: Scene, chosen: Indices) -> Indices:
    """(T, L): lights by kind, place, intensity, attenuation, then index."""
    lights = len(scene.lights)
    kind = np.array([isinstance(light, DirectionalLight) for light in scene.lights], dtype=np.int64)
    fade: Any = [light.attenuation if isinstance(light, PointLight) else (0.0, 0.0, 0.0) for light in scene.lights]
    constant = [np.arange(lights), *np.array(fade, dtype=np.float64).reshape(-1, 3).T[::-1]]
    place, intensity = stack.place[chosen], stack.intensity[chosen]
    shape = (len(chosen), lights)
    keys = [np.broadcast_to(key, shape) for key in constant]
    keys += [intensity[..., k] for k in (2, 1, 0)] + [place[..., k] for k in (2, 1, 0)]
    return np.asarray(np.lexsort((*keys, np.broadcast_to(kind, shape)), axis=1), dtype=np.int64)
