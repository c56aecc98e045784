"""Which light adds what to which surface, in many scenes at once: symrender_cg.plan.lamps, with an axis of scenes.

Comes in: Stacked, what the eye sees, and what mirrors show. Goes out: Terms, truths for each receiver and light of each
scene. Never done here: blockers of one pair.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symrender_cg.plan.lamps import caps_apart
from symrender_cg.plan.measures import Truths, norm, wide
from symrender_cg.plan.stack_measures import Stacked
from symrender_cg.plan.stack_mirrors import StackMirrors
from symrender_cg.plan.stack_views import StackViews
from symrender_cg.scene import PointLight


@dataclass(frozen=True, eq=False)
class Terms:
    """(T, N + P, L) each: the terms that can be other than 0; a receiver is a sphere, then a material of the plane."""

    diffuse: Truths
    specular: Truths
    gated: Truths

    @property
    def any(self) -> Truths:
        """Where the light adds anything."""
        return np.asarray(self.diffuse | self.specular)


def find_all_lamps(stacked: Stacked, views: StackViews, mirrors: StackMirrors) -> Terms:
    """The lamps of the receivers that may be seen."""
    stack, scene, number = stacked.stack, stacked.scene, stacked.spheres
    matters = mirrors.mirrored.copy()
    matters[:, :number] |= views.visible
    matters[:, number:] |= views.plane_seen[:, np.newaxis] & views.kept
    facing, dark = _facing(stacked, matters, mirrors.mirrored), _dark(stacked)
    lit = (stack.intensity > 0.0)[:, np.newaxis]
    planes = () if scene.plane is None else (scene.plane.material, scene.plane.checker)[: stacked.planes]
    materials = (*(sphere.material for sphere in scene.spheres), *planes)
    gates = np.array([material is not None and material.gate_specular for material in materials], dtype=bool)[:, None]
    some = matters[..., np.newaxis] & ~dark
    diffuse = ((stack.diffuse > 0.0)[:, :, np.newaxis] & lit).any(axis=3) & facing & some
    specular = ((stack.specular > 0.0)[:, :, np.newaxis] & lit).any(axis=3) & (facing | ~gates) & some
    return Terms(diffuse, specular, specular & gates)


def _facing(stacked: Stacked, matters: Truths, mirrored: Truths) -> Truths:
    """(T, N + P, L): some point of the surface that may be seen has the light above its horizon; of those that
    matter."""
    number, lights = stacked.spheres, stacked.lights
    facing = np.zeros((*matters.shape, lights), dtype=bool)
    t, k = np.nonzero(matters[:, :number])
    for light in range(lights):
        apart = caps_apart(stacked.flat, t * lights + light, t * number + k, ~mirrored[t, k])
        facing[t, k, light] = ~apart
    facing[:, number:] = ~stacked.separated[:, np.newaxis]
    return facing


def _dark(stacked: Stacked) -> Truths:
    """(T, N + P, L): the light is inside a sphere other than the receiver, or beyond the plane."""
    count, number, scene = stacked.count, stacked.spheres, stacked.scene
    dark = np.zeros((count, number + stacked.planes, stacked.lights), dtype=bool)
    if not scene.shadows:
        return dark
    for light, given in enumerate(scene.lights):
        if isinstance(given, PointLight):
            away = norm(stacked.center - stacked.at[:, light, np.newaxis])
            inside = wide(away) < stacked.radius
            others = np.repeat(inside.sum(axis=1)[:, np.newaxis], number + stacked.planes, axis=1)
            others[:, :number] -= inside
            dark[..., light] = others > 0
    dark[:, :number] |= stacked.separated[:, np.newaxis]
    return dark
