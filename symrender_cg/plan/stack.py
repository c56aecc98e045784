"""Many scenes that differ in numbers from one that is planned: which of them the eye sees alike, and what lights them.

Comes in: the plan of one scene, and a `Stack`: the numbers that change as arrays, one scene after the other. Goes out:
`Weighed`: which scenes have the same visible spheres, their order, which light adds what to each, and what may come
between. The conditions are those of symrender_cg.plan, by the same functions, or by the same formulas over all scenes
at once. A scene for which a comparison is too close to call, or whose numbers are out of the ordinary, is not said to
be alike: it is planned by itself. The lists of the others are made in symrender_cg.plan.stack_lists.
Never done here: a plane, a mirror, another camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import frexp, ldexp
from typing import Final

import numpy as np

from symrender_cg.plan.arrangement import Arrangement
from symrender_cg.plan.effects import FARTHEST_ASIDE, SCENE
from symrender_cg.plan.flags import fades
from symrender_cg.plan.lamps import caps_apart
from symrender_cg.plan.measures import (
    ANGLE,
    LENGTH,
    Floats,
    Indices,
    Measures,
    Truths,
    angle,
    cone_above,
    cone_below,
    norm,
    unit_vector,
    wide,
)
from symrender_cg.plan.plan import Plan
from symrender_cg.plan.shadows import across, misses_sphere
from symrender_cg.plan.visibility import HIDERS
from symrender_cg.scene import DirectionalLight, PointLight, Scene
from symrender_cg.scene.camera_frame import is_in_frame

ORDINARY: Final = 2.0**14
"""Lengths within this many distances of the eye, radii and coefficients as near to 1, are in reach of every kernel."""

MOST_SPHERES: Final = 512
"""Of more, all pairs cost more than to look for near ones, which a plan does."""

EFFECTS: Final = ("diffuse", "specular", "specular_gate", "attenuation", "shadows")
"""Flags of symrender_cg.plan.flags that lights and shadows decide; `Weighed.effects` has a bit for each."""

ROOM: Final = 1e-12
"""Relative room of comparisons for which a plan goes on to whole numbers."""


@dataclass(frozen=True, eq=False)
class Stack:
    """T scenes of N spheres and L lights, in the camera's frame.

    center (T, N, 3), radius (T, N); place (T, L, 3): positions, and directions as the scene has them;
    ambient, diffuse, specular (T, N, 3), shininess (T, N); intensity (T, L, 3); background (T, 3), or None for a
    gradient; half_height (T,). `moved`: spheres differ in place or size, not only in what they are made of.
    """

    center: Floats
    radius: Floats
    place: Floats
    ambient: Floats
    diffuse: Floats
    specular: Floats
    shininess: Floats
    intensity: Floats
    background: Floats | None
    half_height: Floats
    moved: bool

    @property
    def count(self) -> int:
        """T."""
        return len(self.radius)


def is_stackable(scene: Scene, found: Plan) -> bool:
    """Whether scenes can be compared with this one: several spheres seen by a plain camera, no plane, no mirror; or one
    sphere, where the plan keeps it a scene."""
    arrangement = found.arrangement
    if arrangement is None or found.force - {SCENE} or found.max_error > 0.0:
        return False
    if arrangement.visible < (1 if found.force else 2):
        return False
    plain = is_in_frame(scene.camera) and scene.plane is None and len(scene.spheres) <= MOST_SPHERES
    return plain and (scene.max_bounces == 0 or all(s.material.reflect == 0.0 for s in scene.spheres))


@dataclass(frozen=True, eq=False)
class Weighed:
    """What was found out about the scenes of a stack.

    alike (T,): the eye sees the same spheres as in the planned scene, and what follows is right; effects (T,): a number
    for each set of effects that lights and shadows add, equal for scenes of one kernel. front (T, visible): the visible
    spheres in their order.
    """

    stack: Stack
    scene: Scene
    measures: Measures
    front: Indices
    lamps: Terms
    shades: Pairs
    alike: Truths
    effects: Indices


def effects_of(found: Plan) -> int:
    """The bits of a plan's effects, as `Weighed` has them."""
    return sum(1 << bit for bit, name in enumerate(EFFECTS) if name in found.flags)


def weigh(found: Plan, stack: Stack, among: Truths) -> Weighed:
    """What is known of the scenes of a stack by the plan of one of their kind; `among` (T,): those asked for."""
    arrangement, scene = found.arrangement, found.scene
    assert arrangement is not None, "a plan that is stackable has an arrangement"
    front = np.broadcast_to(
        arrangement.spheres[: arrangement.visible].astype(np.int64), (stack.count, arrangement.visible)
    )
    with np.errstate(all="ignore"):
        alike = among & _ordinary(stack, scene.camera.eye[2]) & (_is_grey(stack) == scene.is_grey)
        measures = _measures(scene, stack)
        if stack.moved:
            same, front = _same_views(measures, stack, found, arrangement)
            alike = alike & same
        lamps = _lamps(measures, stack, scene, front)
        shades = _shades(measures, stack, scene, front, lamps)
    return Weighed(stack, scene, measures, front, lamps, shades, alike, _effects(scene, lamps, shades, stack.count))


def _ordinary(stack: Stack, eye: float) -> Truths:
    """(T,): numbers that make a scene, of ordinary size, with the eye outside every sphere."""
    longest, least = ORDINARY * eye, eye / ORDINARY
    views = (stack.half_height >= least) & (stack.half_height <= longest)
    lengths = views & (np.abs(stack.center).max(axis=(1, 2)) <= longest)
    lengths &= (stack.radius >= least).all(axis=1) & (stack.radius <= longest).all(axis=1)
    lengths &= np.isfinite(stack.place).all(axis=(1, 2)) & (np.abs(stack.place).max(axis=(1, 2)) <= ORDINARY * longest)
    away = norm(stack.center - np.array((0.0, 0.0, eye)))
    sure = lengths & (away > stack.radius * (1.0 + ROOM)).all(axis=1)
    given = (stack.ambient, stack.diffuse, stack.specular, stack.shininess, stack.intensity, stack.background)
    for value in given:
        if value is not None:
            axes = tuple(range(1, value.ndim))
            sure &= (value >= 0.0).all(axis=axes) & (value <= ORDINARY * ORDINARY).all(axis=axes)
    return np.asarray(sure, dtype=np.bool_)


def _is_grey(stack: Stack) -> Truths:
    """(T,): the channels of every colour are equal; of a gradient those of its colours are not looked at."""
    grey = np.ones(stack.count, dtype=np.bool_)
    for value in (stack.ambient, stack.diffuse, stack.specular, stack.intensity, stack.background):
        if value is not None:
            grey &= (value == value[..., :1]).all(axis=tuple(range(1, value.ndim)))
    return grey


def _measures(scene: Scene, stack: Stack) -> Measures:
    """The measures of all scenes as those of one: sphere i of scene t is number t N + i, light l is t L + l."""
    eye = scene.camera.eye[2]
    unit = ldexp(1.0, frexp(eye)[1])
    directional = np.array([isinstance(light, DirectionalLight) for light in scene.lights], dtype=bool)
    at = np.array(stack.place / unit)
    for index, light in enumerate(scene.lights):
        if isinstance(light, DirectionalLight):
            at[:, index] = -unit_vector(light.direction)
    center = (stack.center / unit).reshape(-1, 3)
    m = center - np.array((0.0, 0.0, eye / unit))
    nothing = np.empty(0, dtype=np.int64)
    return Measures(
        scene=scene,
        unit=unit,
        eye=eye / unit,
        center=center,
        radius=(stack.radius / unit).reshape(-1),
        m=m,
        distance=norm(m),
        materials=(),
        material=nothing,
        at=at.reshape(-1, 3),
        directional=np.tile(directional, stack.count),
        normal=None,
        point=None,
        plane_materials=(),
    )


# ---- what the eye sees


def _same_views(measures: Measures, stack: Stack, found: Plan, arrangement: Arrangement) -> tuple[Truths, Indices]:
    """(T,): the same spheres are visible; the same of them may touch, or reach the eye's plane. (T, visible): their
    order, which is that of the planned scene where any does."""
    count, number = stack.count, stack.radius.shape[1]
    front = arrangement.spheres[: arrangement.visible].astype(np.int64)
    seen = np.zeros(number, dtype=bool)
    seen[front] = True
    radius = measures.radius.reshape(count, number)
    m, distance = measures.m.reshape(count, number, 3), measures.distance.reshape(count, number)
    depth, aside = measures.eye - measures.center.reshape(count, number, 3)[..., 2], np.abs(m[..., :2]).max(axis=2)

    sure = np.ones(count, dtype=bool)
    for bound, other in ((radius, depth), (-radius, depth), (aside / FARTHEST_ASIDE, depth)):
        sure &= (np.abs(other - bound) > ROOM * (radius + measures.eye + np.abs(depth))).all(axis=1)
    near = ~(depth > radius) | (aside / FARTHEST_ASIDE > depth)
    sure &= (near[:, front] == arrangement.at_eye).all(axis=1)

    i, j = np.triu_indices(number, 1)
    center = measures.center.reshape(count, number, 3)
    between = norm(center[:, i] - center[:, j])
    touching = ~(between > (radius[:, i] + radius[:, j]) * (1.0 + LENGTH))
    inside = np.zeros((count, number), dtype=bool)
    for inner, outer in ((i, j), (j, i)):
        within = touching & (between + radius[:, inner] < radius[:, outer] * (1.0 - LENGTH))
        scene, pair = np.nonzero(within)
        inside[scene, inner[pair]] = True
    partners = np.zeros((number, number), dtype=bool)
    later = np.repeat(front, np.diff(arrangement.partners_begin))
    earlier = front[arrangement.partners]
    partners[np.minimum(later, earlier), np.maximum(later, earlier)] = True
    both = seen[i] & seen[j]
    sure &= (touching[:, both] == partners[i, j][both]).all(axis=1)

    dropped = ~(depth > -radius) | inside
    if found.aspect is not None:
        upright = (stack.half_height / found.scene.camera.eye[2])[:, np.newaxis]
        for axis, slope in enumerate((upright * found.aspect, upright)):
            beyond = np.abs(m[..., axis]) - slope * depth
            reach = radius * np.hypot(1.0, slope)
            dropped |= beyond - reach > LENGTH * (np.abs(m[..., axis]) + slope * np.abs(depth) + reach)
    sure &= ~dropped[:, front].any(axis=1)
    dropped |= _hidden(m, distance, radius, center, dropped)
    sure &= (~dropped == seen).all(axis=1)

    d, r = distance[:, front], radius[:, front]
    key, error = (d - r) * (d + r), 2.0**-49 * d * d
    ranks = np.argsort(key, axis=1, kind="stable")
    low, high = (np.take_along_axis(end, ranks, axis=1) for end in (key - error, key + error))
    sure &= (low[:, 1:] > high[:, :-1]).all(axis=1)
    if len(arrangement.partners) or arrangement.at_eye.any():
        sure &= (ranks == np.arange(len(front))).all(axis=1)
    return np.asarray(sure, dtype=np.bool_), front[ranks]


def _hidden(m: Floats, distance: Floats, radius: Floats, center: Floats, dropped: Truths) -> Truths:
    """(T, N): one of the widest others hides the sphere wholly, as symrender_cg.plan.visibility.hidden finds it."""
    count, number = radius.shape
    alpha, beta = cone_below(distance, radius), cone_above(distance, radius)
    widest = np.argsort(np.where(dropped, np.inf, -alpha), axis=1, kind="stable")[:, :HIDERS]
    result = np.zeros((count, number), dtype=bool)
    every = np.arange(count)
    for rank in range(widest.shape[1]):
        hider = widest[:, rank]
        able = ~dropped[every, hider]
        t, n = np.nonzero((beta < alpha[every, hider][:, np.newaxis]) & ~result & ~dropped & able[:, np.newaxis])
        h = hider[t]
        gamma = angle(m[t, h], m[t, n])
        apart = norm(center[t, n] - center[t, h]) > (radius[t, n] + radius[t, h]) * (1.0 + LENGTH)
        power = (distance[t, n] - radius[t, n]) * (distance[t, n] + radius[t, n])
        ahead = (distance[t, h] - radius[t, h]) * (distance[t, h] + radius[t, h])
        before = power - ahead > LENGTH * (distance[t, n] ** 2 + distance[t, h] ** 2)
        covered = (gamma + beta[t, n] < alpha[t, h] - ANGLE) & apart & before
        result[t[covered], n[covered]] = True
    return result


# ---- what lights it


@dataclass(frozen=True, eq=False)
class Terms:
    """(T, visible, L) each, visible spheres front to back."""

    diffuse: Truths
    specular: Truths
    gated: Truths

    @property
    def any(self) -> Truths:
        """Where the light adds anything."""
        return np.asarray(self.diffuse | self.specular)


def _lamps(measures: Measures, stack: Stack, scene: Scene, front: Indices) -> Terms:
    """See symrender_cg.plan.lamps; without a plane and mirrors."""
    count, number, lights = stack.count, stack.radius.shape[1], stack.place.shape[1]
    visible = front.shape[1]
    every = np.arange(count)[:, np.newaxis]
    chosen = (every * number + front).reshape(-1)
    from_eye = np.ones(len(chosen), dtype=bool)
    facing, dark = np.empty((count, visible, lights), dtype=bool), np.zeros((count, visible, lights), dtype=bool)
    for light in range(lights):
        of = np.repeat(np.arange(count) * lights + light, visible)
        facing[..., light] = ~caps_apart(measures, of, chosen, from_eye).reshape(count, -1)
        if scene.shadows and isinstance(scene.lights[light], PointLight):
            away = norm(measures.center.reshape(count, number, 3) - measures.at[light::lights][:, np.newaxis])
            inside = wide(away) < measures.radius.reshape(count, number)
            dark[..., light] = inside.sum(axis=1)[:, np.newaxis] - inside[every, front] > 0
    lit = (stack.intensity > 0.0)[:, np.newaxis]
    gates = np.array([sphere.material.gate_specular for sphere in scene.spheres], dtype=bool)[front][..., np.newaxis]
    diffuse = ((stack.diffuse[every, front] > 0.0)[:, :, np.newaxis] & lit).any(axis=3) & facing & ~dark
    specular = ((stack.specular[every, front] > 0.0)[:, :, np.newaxis] & lit).any(axis=3) & (facing | ~gates) & ~dark
    return Terms(diffuse, specular, specular & gates)


@dataclass(frozen=True, eq=False)
class Pairs:
    """One entry a pair of lamp and blocker: scene, rank of the visible sphere, light, index of the blocker."""

    scene: Indices
    rank: Indices
    light: Indices
    blocker: Indices


def _shades(measures: Measures, stack: Stack, scene: Scene, front: Indices, lamps: Terms) -> Pairs:
    """See symrender_cg.plan.shadows: near as seen from the light, and not proved to miss."""
    count, number, lights = stack.count, stack.radius.shape[1], stack.place.shape[1]
    every = np.arange(count)[:, np.newaxis]
    nothing = np.empty(0, dtype=np.int64)
    found = [(nothing, nothing, nothing, nothing)]
    for light in range(lights) if scene.shadows else ():
        lit = lamps.any[..., light]
        if not lit.any():
            continue
        leaking = np.zeros((count, number), dtype=bool)
        leaking[every, front] = (lamps.specular & ~lamps.gated)[..., light]
        radius = measures.radius.reshape(count, number)
        if isinstance(scene.lights[light], DirectionalLight):
            place, reach = across(measures, light).reshape(count, number, 3), radius
        else:
            away = measures.center.reshape(count, number, 3) - measures.at[light::lights][:, np.newaxis]
            distance = norm(away)
            place = away / np.maximum(distance, 2.0**-1000)[..., np.newaxis]
            reach = cone_above(distance, radius)
        t, v, b = _near(place, reach, front, lit)
        missed = misses_sphere(
            measures, t * lights + light, t * number + front[t, v], t * number + b, leaking.reshape(-1)
        )
        kept = ~missed
        found.append((t[kept], v[kept], np.full(int(kept.sum()), light), b[kept]))
    return Pairs(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _near(place: Floats, reach: Floats, front: Indices, lit: Truths) -> tuple[Indices, Indices, Indices]:
    """(scene, rank of a visible sphere that is lit, index of another): |p - q| <= r + s of their places and reaches.

    2 (p.q + r s) + (r^2 - p^2) + (s^2 - q^2) >= 0 is one product of matrices, good to 2^-44 of the squares; what
    passes is looked at again.
    """
    every = np.arange(len(front))[:, np.newaxis]
    square = np.einsum("tni,tni->tn", place, place)
    extent = square.max(axis=1)
    reach = reach * (1.0 + 2.0**-40) + 2.0**-39 * np.sqrt(extent)[:, np.newaxis]
    rest, ones = 0.5 * (reach * reach - square), np.ones(square.shape)
    left = np.stack((*place[every, front].transpose(2, 0, 1), reach[every, front], rest[every, front]), axis=2)
    left = np.concatenate((left, np.ones((*front.shape, 1))), axis=2)
    right = np.stack((*place.transpose(2, 0, 1), reach, ones, rest), axis=1)
    t, v, b = np.nonzero(
        left @ right >= -(2.0**-44) * (extent + (reach * reach).max(axis=1))[:, np.newaxis, np.newaxis]
    )
    a = front[t, v]
    near = lit[t, v] & (a != b)
    t, v, a, b = t[near], v[near], a[near], b[near]
    near = norm(place[t, a] - place[t, b]) <= reach[t, a] + reach[t, b]
    return t[near], v[near], b[near]


def _effects(scene: Scene, lamps: Terms, shades: Pairs, count: int) -> Indices:
    """(T,): the flags of symrender_cg.plan.flags that depend on lamps and blockers, as bits."""
    fading = np.array([fades(light) for light in scene.lights], dtype=bool)
    flags = [
        *(terms.any(axis=(1, 2)) for terms in (lamps.diffuse, lamps.specular, lamps.gated)),
        np.asarray(lamps.any.any(axis=1))[:, fading].any(axis=1),
        np.bincount(shades.scene, minlength=count) > 0,
    ]
    return np.asarray(sum(np.asarray(flag, dtype=np.int64) << bit for bit, flag in enumerate(flags)), dtype=np.int64)
