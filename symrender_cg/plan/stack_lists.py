"""The lists of scenes that were weighed together: the rows of their Arrangements, without an Arrangement for each.

Comes in: `Weighed`, and which of its scenes. Goes out: `Decided`: spheres, partners, lamps, blockers and mirrors by
positions, in the order that symrender_cg.plan.arrangement gives them. Never done here: a comparison of geometry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from symrender_cg.plan.measures import Floats, Indices, Truths
from symrender_cg.plan.stack import Weighed
from symrender_cg.plan.stack_nearby import all_true
from symrender_cg.plan.stack_numbers import Stack
from symrender_cg.plan.stack_views import inverse
from symrender_cg.scene import DirectionalLight, PointLight, Scene


@dataclass(frozen=True, eq=False)
class Lists:
    """Lists of T scenes, one after the other, as an Arrangement has them in `*_begin` and `*`.

    begin: where the lists of a scene begin in its members, one entry more than it has lists, `begins` (T,) of each
    scene; members, `sizes` (T,) of each.
    """

    begin: Indices
    begins: Indices
    members: Indices
    sizes: Indices


@dataclass(frozen=True, eq=False)
class Decided:
    """The lists of some scenes of a stack, T of them, each what the Arrangement of its plan has.

    chosen           (T,): which scenes of the stack
    spheres          of all scenes one after the other, `sizes` (T,) each: indices of the scene's spheres; the visible
                     ones first, `visible` (T,), then others that are seen in mirrors or cast shadows
    materials        the same with the plane's materials after the spheres of each scene, `receivers` (T,) each: rows of
                     the stack's coefficients
    at_eye, crosses  one for each of `spheres`; a sphere that is not visible is not at the eye
    lamps, lamp_light, lamp_terms    terms are 1 for diffuse, 2 for specular, 4 for gated
    mirror, mirror_plane             one for each of `materials`
    """

    chosen: Indices
    spheres: Indices
    sizes: Indices
    visible: Indices
    materials: Indices
    receivers: Indices
    at_eye: Truths
    crosses: Truths
    partners: Lists
    lamp_light: Indices
    lamp_terms: Indices
    lamps: Lists
    blockers: Lists
    mirror: Truths
    mirror_plane: Truths
    mirrors: Lists
    plane_seen: Truths
    bounces: Indices


def decide(weighed: Weighed, chosen: Indices) -> Decided:
    """The lists of the chosen scenes, which are alike, ascending."""
    rows, count = weighed.row[chosen], len(chosen)
    views, mirrors, terms, measures = weighed.views, weighed.mirrors, weighed.lamps, weighed.measures
    number, visible = measures.spheres, views.visible[rows]
    place = np.full(measures.count, -1, dtype=np.int64)
    place[rows] = np.arange(count)
    shades = weighed.shades
    some = place[shades.scene] >= 0
    t, a, light, b = (part[some] for part in (place[shades.scene], shades.receiver, shades.light, shades.blocker))

    needed = visible | mirrors.mirrored[rows, :number]
    needed[t, b] = True
    order = _order(measures.center[rows], measures.radius[rows], visible, views.rank[rows], needed)
    sizes, kept = needed.sum(axis=1), views.kept[rows]
    receivers = sizes + kept.sum(axis=1)
    position = np.full((count, number + kept.shape[1]), -1, dtype=np.int64)
    np.put_along_axis(position, order, np.broadcast_to(np.arange(number), order.shape), axis=1)
    position[:, :number][~needed] = -1
    position[:, number:] = np.where(kept, sizes[:, np.newaxis] + np.cumsum(kept, axis=1) - 1, -1)
    which, of = _in_order(position)

    order_of_lights = _light_order(weighed.stack, measures.scene, chosen)
    rank = inverse(order_of_lights)
    adds = terms.any[rows] & (position >= 0)[..., np.newaxis]
    lt, lr, ll = np.nonzero(adds)
    sort = np.lexsort((rank[lt, ll], position[lt, lr], lt))
    lt, lr, ll = lt[sort], lr[sort], ll[sort]
    lamps = _lists(lt, position[lt, lr], np.zeros(len(lt), dtype=np.int64), receivers)
    number_of = np.zeros(adds.shape, dtype=np.int64)
    number_of[lt, lr, ll] = np.arange(len(lt)) - np.repeat(np.cumsum(lamps.sizes) - lamps.sizes, lamps.sizes)
    bits = sum(
        holds[rows][lt, lr, ll].astype(np.int64) << bit
        for bit, holds in enumerate((terms.diffuse, terms.specular, terms.gated))
    )

    pt, pi, pj = all_true(views.touching[rows])
    later = position[pt, pi] > position[pt, pj]
    pt, pi, pj = pt[later], pi[later], pj[later]
    mt, mr, mb = all_true(mirrors.seen[rows] & (position >= 0)[..., np.newaxis])
    spheres = of < number
    at_eye = views.at_eye[rows] & visible
    return Decided(
        chosen=chosen,
        spheres=of[spheres],
        sizes=sizes,
        visible=visible.sum(axis=1),
        materials=of,
        receivers=receivers,
        at_eye=at_eye[which[spheres], of[spheres]],
        crosses=measures.crosses_plane[rows][which[spheres], of[spheres]],
        partners=_lists(pt, position[pt, pi], position[pt, pj], visible.sum(axis=1)),
        lamp_light=ll,
        lamp_terms=np.asarray(bits, dtype=np.int64) + np.zeros(len(ll), dtype=np.int64),
        lamps=lamps,
        blockers=_lists(t, number_of[t, a, light], position[t, b], lamps.sizes),
        mirror=mirrors.mirror[rows][which, of],
        mirror_plane=mirrors.plane[rows][which, of],
        mirrors=_lists(mt, position[mt, mr], position[mt, mb], receivers),
        plane_seen=views.plane_seen[rows],
        bounces=mirrors.bounces[rows],
    )


def _order(center: Floats, radius: Floats, visible: Truths, rank: Indices, needed: Truths) -> Indices:
    """(T, N): the spheres of each scene: visible ones front to back, others that are needed by radius, centre, then
    index, and those that are not."""
    number = radius.shape[1]
    key = np.where(visible, rank, 2 * number)
    others = needed & ~visible
    if others.any():
        index = np.broadcast_to(np.arange(number), radius.shape)
        canonical = np.lexsort((index, center[..., 2], center[..., 1], center[..., 0], radius), axis=1)
        key = np.where(others, number + inverse(canonical), key)
    return np.argsort(key, axis=1, kind="stable")


def _in_order(position: Indices) -> tuple[Indices, Indices]:
    """(scene, which) of everything that has a position, scene by scene in the order of positions."""
    t, k = np.nonzero(position >= 0)
    sort = np.lexsort((position[t, k], t))
    return t[sort], k[sort]


def _lists(scene: Indices, group: Indices, member: Indices, groups: Indices) -> Lists:
    """Members by scene and list, ascending; groups (T,): how many lists a scene has."""
    count = len(groups)
    begins = np.cumsum(groups) - groups
    held = np.bincount(begins[scene] + group, minlength=int(groups.sum()))
    sizes = np.bincount(scene, minlength=count)
    ends = np.cumsum(held) - np.repeat(np.cumsum(sizes) - sizes, groups)
    begin = np.zeros(len(held) + count, dtype=np.int64)
    begin[np.arange(len(held)) + np.repeat(np.arange(count), groups) + 1] = ends
    return Lists(begin, groups + 1, member[np.lexsort((member, group, scene))], sizes)


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
