"""Which light adds what to which surface: the terms that can be other than 0.

Comes in: Measures, and which surfaces may be seen in a mirror. Goes out: Lamps, truths (receivers, lights). A receiver
is a sphere, and after the N spheres the plane's material and its checker. Never done here: blockers of one pair.

    factor      coefficient times intensity is 0 in every channel
    caps        the caps of the sphere that eye and light see are apart: psi >= phi_E + phi_L; for the diffuse term and
                gated highlights only: others can leak past the terminator; not where a mirror sees the sphere
    inside      a light in the sphere itself is below every horizon of it
    enclosed    a light in another sphere is dark for all that is seen: what is seen lies outside every sphere
    separated   a light on the other side of the plane is dark for every sphere that is seen (exact)
    below       the plane sees no light from behind it, except an ungated highlight
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from symrender_cg.plan.measures import ANGLE, Floats, Indices, Measures, Truths, angle, cap_above, colour, norm, wide
from symrender_cg.scene import Phong


@dataclass(frozen=True)
class Lamps:
    """(receivers, lights) each: the terms that can be other than 0, and whether a highlight is gated."""

    diffuse: Truths
    specular: Truths
    gated: Truths

    @property
    def any(self) -> Truths:
        """Where the light adds anything."""
        return self.diffuse | self.specular


def find_lamps(measures: Measures, mirrored: Truths, force: Collection[str] = ()) -> Lamps:
    """The lamps of every receiver; `mirrored` (receivers,) says which may be seen from elsewhere than the eye."""
    materials = (*measures.materials, *measures.plane_materials)
    planes = np.arange(len(measures.materials), len(materials))
    which = np.concatenate((measures.material, planes))
    diffuse = _factors(measures, materials, "diffuse")[which]
    specular = _factors(measures, materials, "specular")[which]
    if "diffuse" in force:
        diffuse[:] = True
    if "specular" in force:
        specular[:] = True
    gated = np.array([material.gate_specular for material in materials], dtype=bool)[which][:, np.newaxis]
    facing, dark = _facing(measures, mirrored), _dark(measures)
    if "lights" in force:
        facing[:], dark[:] = True, False
    if measures.scene.shadows:
        dark[: measures.count] |= measures.separated
    diffuse &= facing & ~dark
    specular &= (facing | ~gated) & ~dark
    gated = np.broadcast_to(gated, specular.shape) & specular
    return Lamps(diffuse, specular, gated)


def _factors(measures: Measures, materials: tuple[Phong, ...], name: str) -> Truths:
    """(materials, lights): coefficient times intensity is not 0 in some channel."""
    coefficient = np.array([colour(getattr(m, name)) for m in materials], dtype=np.float64).reshape(-1, 1, 3)
    intensity = np.array([colour(light.intensity) for light in measures.scene.lights], dtype=np.float64)
    return np.asarray(((coefficient > 0.0) & (intensity.reshape(1, -1, 3) > 0.0)).any(axis=2))


def enclosing(measures: Measures) -> Truths:
    """(N, L): the light is strictly inside the sphere."""
    away = norm(measures.center[:, np.newaxis] - measures.at)
    return np.asarray((wide(away) < measures.radius[:, np.newaxis]) & ~measures.directional)


def _dark(measures: Measures) -> Truths:
    """(receivers, L): the light is inside a sphere other than the receiver."""
    inside = enclosing(measures)
    receivers = measures.count + len(measures.plane_materials)
    if not measures.scene.shadows:
        return np.zeros((receivers, len(measures.at)), dtype=bool)
    enclosers = np.broadcast_to(inside.sum(axis=0), (receivers, len(measures.at))).copy()
    enclosers[: measures.count] -= inside
    return enclosers > 0


def _facing(measures: Measures, mirrored: Truths) -> Truths:
    """(receivers, L): some point of the surface that may be seen has the light above its horizon."""
    count, lights = measures.count, len(measures.at)
    result = np.ones((len(mirrored), lights), dtype=bool)
    for light in range(lights):
        result[:count, light] = ~caps_apart(measures, light, np.arange(count), ~mirrored[:count])
    if measures.normal is not None:
        result[count:] = ~measures.separated
    return result


def caps_apart(measures: Measures, light: int | Indices, chosen: Indices, from_eye: Truths) -> Truths:
    """(n,): psi > phi_E + phi_L for the chosen spheres, phi_E = pi where they are not seen `from_eye` alone.

    light: one for all, or one a sphere, all of one kind.
    """
    to_eye, radius = -measures.m[chosen], measures.radius[chosen]
    visible = cap_above(measures.distance[chosen], radius)
    if np.all(measures.directional[light]):
        to_light = np.broadcast_to(measures.at[light], to_eye.shape)
        lit: Floats = np.full(len(chosen), np.pi / 2)
        inside = np.zeros(len(chosen), dtype=bool)
    else:
        to_light = measures.at[light] - measures.center[chosen]
        away = norm(to_light)
        lit = cap_above(away, radius)
        inside = wide(away) < radius
    apart = from_eye & (angle(to_eye, to_light) > visible + lit + ANGLE)
    return np.asarray(apart | inside)
