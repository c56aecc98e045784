"""Everything that planning finds out about a scene, by indices of its spheres and lights.

    look      which spheres the eye may see, and the plane
    mirrors   what is seen in what
    lamps     which light adds what to what
    budget    what a tolerance leaves out of that
    blockers  which sphere may come between

Comes in: a Scene in the camera's frame, the aspect of the window. Goes out: Examination. Never done here: an order.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symrender_cg.plan.lamps import Lamps, find_lamps
from symrender_cg.plan.measures import Floats, Indices, Measures, Truths, measure
from symrender_cg.plan.mirrors import Mirrors, find_mirrors
from symrender_cg.plan.shadows import find_blockers
from symrender_cg.plan.tolerance import Budget, spend
from symrender_cg.plan.visibility import (
    behind_eye,
    contained,
    hidden,
    one_tile,
    outside_window,
    plane_in_view,
    touching_pairs,
)
from symrender_cg.scene import Scene


@dataclass(frozen=True)
class Views:
    """What the eye may see of a scene, and why not: truths (N,), one a sphere of the scene."""

    measures: Measures
    behind: Truths
    outside: Truths
    beyond: Truths
    contained: Truths
    hidden: Truths
    touching: tuple[Indices, Indices, Floats]
    visible: Truths
    plane_seen: bool
    aspect: float | None
    force: Collection[str]

    @cached_property
    def nowhere(self) -> Truths:
        """(N,): no ray from outside all spheres, on the eye's side of the plane, meets it first."""
        return self.beyond | self.contained


def look(scene: Scene, *, aspect: float | None, force: Collection[str] = ()) -> Views:
    """What the eye may see of a scene in the camera's frame."""
    measures = measure(scene)
    count = measures.count
    touching = touching_pairs(measures)
    behind, inner = behind_eye(measures), contained(measures, touching)
    outside = np.zeros(count, dtype=bool)
    if aspect is not None:
        outside = outside_window(measures, measures.m, measures.radius, aspect)
    dropped = np.zeros(count, dtype=bool)
    for name, truths in (("behind_eye", behind), ("in_view", outside), ("hidden", measures.beyond_plane | inner)):
        if name not in force:
            dropped |= truths
    covered = np.zeros(count, dtype=bool)
    left = np.flatnonzero(~dropped)
    covered[left] = hidden(measures, left)
    if "hidden" not in force:
        dropped |= covered
    plane_seen = measures.plane is not None and ("plane" in force or plane_in_view(measures, aspect))
    return Views(
        measures=measures,
        behind=behind,
        outside=outside,
        beyond=measures.beyond_plane,
        contained=inner,
        hidden=covered,
        touching=touching,
        visible=~dropped,
        plane_seen=plane_seen,
        aspect=aspect,
        force=force,
    )


@dataclass(frozen=True)
class Examination:
    """What may be seen, mirrored, lit and darkened; `budget` is what the tolerance has left out of it, if there is one.

    lamps_before: the lamps before the budget. blockers: (receiver, light, blocker) of every pair that may matter.
    """

    views: Views
    mirrors: Mirrors
    lamps: Lamps
    lamps_before: Lamps
    blockers: tuple[Indices, Indices, Indices]
    budget: Budget | None

    @property
    def measures(self) -> Measures:
        """The numbers of the scene."""
        return self.views.measures

    @cached_property
    def matters(self) -> Truths:
        """(receivers,): may be seen by the eye or in a mirror."""
        return _matters(self.views, self.mirrors)


def examine(views: Views, max_error: float = 0.0) -> Examination:
    """Everything about the scene that was looked at."""
    views = _with_plane_materials(views)
    measures, force, aspect = views.measures, views.force, views.aspect
    mirrors = _mirrors(views, measures.scene.max_bounces)
    lamps = _lamps(views, mirrors)
    budget, before = None, lamps
    if max_error > 0.0:
        budget = spend(measures, mirrors, lamps, max_error, force)
        if budget.bounces < mirrors.bounces:
            mirrors = _mirrors(views, budget.bounces)
            before = _lamps(views, mirrors)
        diffuse, specular = before.diffuse & ~budget.diffuse, before.specular & ~budget.specular
        lamps = Lamps(diffuse, specular, before.gated & specular)
    blockers = find_blockers(measures, lamps, mirrors.mirrored, aspect, force)
    return Examination(views, mirrors, lamps, before, blockers, budget)


def _mirrors(views: Views, limit: int) -> Mirrors:
    args = (views.visible, views.plane_seen, views.nowhere, views.aspect, limit, views.force)
    return find_mirrors(views.measures, *args)


def _matters(views: Views, mirrors: Mirrors) -> Truths:
    result = mirrors.mirrored.copy()
    result[: views.measures.count] |= views.visible
    result[views.measures.count :] |= views.plane_seen
    return result


def _lamps(views: Views, mirrors: Mirrors) -> Lamps:
    """The lamps of the receivers that may be seen."""
    lamps, some = find_lamps(views.measures, mirrors.mirrored, views.force), _matters(views, mirrors)[:, np.newaxis]
    return Lamps(lamps.diffuse & some, lamps.specular & some, lamps.gated & some)


def _with_plane_materials(views: Views) -> Views:
    """The views with one material of the plane where its tiles cannot be told apart."""
    measures = views.measures
    materials = measures.plane_materials
    if len(materials) < 2 or "checker" in views.force:
        return views
    if materials[0] == materials[1]:
        return replace(views, measures=replace(measures, plane_materials=materials[:1]))
    reflecting = np.array([material.reflect > 0.0 for material in measures.materials], dtype=bool)
    if measures.scene.max_bounces > 0 and (reflecting[measures.material] & views.visible).any():
        return views
    parity = one_tile(measures, views.aspect) if views.plane_seen and "mirror" not in views.force else None
    if parity is None:
        return views
    return replace(views, measures=replace(measures, plane_materials=(materials[parity],)))
