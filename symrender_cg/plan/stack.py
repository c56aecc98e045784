"""Many scenes that differ in numbers from one that is planned: what the eye sees of each, and what lights it.

    stack_numbers   the scenes as arrays, and which of them have ordinary numbers
    stack_measures  their measures
    stack_views     which spheres the eye may see, in which order; the plane and its tiles
    stack_mirrors   what is seen in what, how deep
    stack_lamps     which light adds which term to which surface
    stack_shadows   which spheres may come between
    stack_lists     the rows of their Arrangements

Comes in: the plan of one scene, and a `Stack`. Goes out: `Weighed`. The conditions are those of symrender_cg.plan, by
the same functions, or by the same formulas over all scenes at once; what a plan decides in whole numbers is decided so
here. A scene whose numbers are out of the ordinary, or of which the kernel of one sphere may be left, is not said to be
alike: it is planned by itself. Never done here: a kernel, or a number for one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from symrender_cg.plan.effects import SCENE
from symrender_cg.plan.flags import fades
from symrender_cg.plan.measures import Indices, Truths
from symrender_cg.plan.plan import Plan
from symrender_cg.plan.stack_lamps import Terms, find_all_lamps
from symrender_cg.plan.stack_measures import Stacked, stacked
from symrender_cg.plan.stack_mirrors import StackMirrors, find_all_mirrors
from symrender_cg.plan.stack_numbers import ORDINARY, Ground, Stack, is_grey, is_ordinary
from symrender_cg.plan.stack_shadows import Pairs, find_all_blockers
from symrender_cg.plan.stack_views import StackViews, look_at_all
from symrender_cg.scene import Gradient, PointLight, Scene

MOST_SPHERES: Final = 512
"""Of more, all pairs cost more than to look for near ones, which a plan does."""

EFFECTS: Final = (
    "spans",
    "at_eye",
    "intersections",
    "plane",
    "checker",
    "crossing",
    "diffuse",
    "specular",
    "specular_gate",
    "attenuation",
    "shadows",
    "mirrors",
    "gradient",
    "colour",
)
"""The flags of symrender_cg.plan.flags; `Weighed.effects` has a bit for each."""


def is_stackable(scene: Scene, found: Plan) -> bool:
    """Whether scenes can be compared with this one: it has an arrangement, and not too many spheres for all pairs."""
    if found.arrangement is None or found.force - {SCENE} or found.max_error > 0.0:
        return False
    fade = [light.attenuation[0] for light in scene.lights if isinstance(light, PointLight)]
    bright = all(constant == 0.0 or constant >= ORDINARY**-8 for constant in fade)
    return bright and 0 < len(scene.spheres) <= MOST_SPHERES


@dataclass(frozen=True, eq=False)
class Weighed:
    """What was found out about the scenes of a stack.

    alike (T,): what follows is right; effects (T,): a number for each set of effects, equal for scenes of one kernel.
    Of those that are alike, one after the other: measures, views, mirrors, lamps, shades; row (T,) says where.
    """

    stack: Stack
    alike: Truths
    effects: Indices
    row: Indices
    measures: Stacked
    views: StackViews
    mirrors: StackMirrors
    lamps: Terms
    shades: Pairs


def effects_of(found: Plan) -> int:
    """The bits of a plan's effects, as `Weighed` has them."""
    return sum(1 << bit for bit, name in enumerate(EFFECTS) if name in found.flags)


def weigh(found: Plan, stack: Stack, among: Truths) -> Weighed:
    """What is known of the scenes of a stack by the plan of one of their kind; `among` (T,): those asked for."""
    scene, aspect = found.scene, found.aspect
    with np.errstate(all="ignore"):
        alike = among & is_ordinary(stack, scene) & (is_grey(stack) == scene.is_grey)
        some = stack if alike.all() else _some(stack, np.flatnonzero(alike))
        measures = stacked(scene, some, aspect)
        if stack.moved or not some.count:
            views = look_at_all(measures)
        else:
            views = look_at_all(stacked(scene, _some(some, np.arange(1)), aspect)).repeated(some.count)
        mirrors = find_all_mirrors(measures, views)
        lamps = find_all_lamps(measures, views, mirrors)
        shades = find_all_blockers(measures, lamps, mirrors.mirrored)
    effects = np.zeros(stack.count, dtype=np.int64)
    effects[alike] = _effects(measures, views, mirrors, lamps, shades)
    row = np.cumsum(alike) - 1
    if SCENE not in found.force:
        alike = alike.copy()
        alike[alike] = ~_may_reduce(measures, views, mirrors, lamps, shades)
    return Weighed(stack, alike, effects, row, measures, views, mirrors, lamps, shades)


def _some(stack: Stack, chosen: Indices) -> Stack:
    """Some of the scenes."""
    ground = stack.ground
    kept: dict[str, Any] = {}
    for entry in fields(Stack):
        value = getattr(stack, entry.name)
        if entry.name not in ("ground", "changes"):
            kept[entry.name] = None if value is None else value[chosen]
    if ground is not None:
        ground = Ground(ground.point[chosen], ground.normal[chosen], ground.axis[chosen], ground.tile[chosen])
    return replace(stack, ground=ground, **kept)


def _may_reduce(measures: Stacked, views: StackViews, mirrors: StackMirrors, lamps: Terms, shades: Pairs) -> Truths:
    """(T,): one sphere under one light may be all that is left, which has another kernel; see plan.arranging."""
    scene, number = measures.scene, measures.spheres
    nothing = np.zeros(measures.count, dtype=bool)
    if not scene.is_grey or isinstance(scene.background, Gradient):
        return nothing
    needed = views.visible | mirrors.mirrored[:, :number]
    needed[shades.scene, shades.blocker] = True
    alone = (views.visible.sum(axis=1) == 1) & (needed.sum(axis=1) == 1) & ~views.plane_seen & (mirrors.bounces == 0)
    used = lamps.any[:, :number].any(axis=1)
    plain = [isinstance(light, PointLight) and not fades(light) for light in scene.lights]
    return np.asarray(alone & (used.sum(axis=1) <= 1) & ~(used & ~np.array(plain, dtype=bool)).any(axis=1))


def _effects(measures: Stacked, views: StackViews, mirrors: StackMirrors, lamps: Terms, shades: Pairs) -> Indices:
    """(T,): the flags of symrender_cg.plan.flags, as bits."""
    scene, number, background = measures.scene, measures.spheres, measures.scene.background
    fading = np.array([fades(light) for light in scene.lights], dtype=bool)
    near = views.visible & views.at_eye
    plane = views.plane_seen | mirrors.mirrored[:, number:].any(axis=1)
    steady = np.ones(measures.count, dtype=bool)
    holds: dict[str, Any] = {
        "spans": (views.visible & ~views.at_eye).any(axis=1),
        "at_eye": near.any(axis=1),
        "intersections": views.touching.any(axis=(1, 2)),
        "plane": plane,
        "checker": plane & (views.kept.sum(axis=1) > 1),
        "crossing": views.plane_seen & (views.visible & measures.crosses_plane).any(axis=1),
        "diffuse": lamps.diffuse.any(axis=(1, 2)),
        "specular": lamps.specular.any(axis=(1, 2)),
        "specular_gate": lamps.gated.any(axis=(1, 2)),
        "attenuation": (lamps.any.any(axis=1) & fading).any(axis=1),
        "shadows": np.bincount(shades.scene, minlength=measures.count) > 0,
        "mirrors": mirrors.bounces > 0,
        "gradient": steady & (isinstance(background, Gradient) and background.bottom != background.top),
        "colour": steady & (not scene.is_grey),
    }
    found = np.zeros(measures.count, dtype=np.int64)
    for bit, name in enumerate(EFFECTS):
        found |= holds[name].astype(np.int64) << bit
    return found
