"""The plan of a scene that is not one sphere and one light: its arrangement, or the one sphere that is left of it.

Comes in: a Scene in the camera's frame. Goes out: Plan. Kept apart from `plan`, which needs no numpy. Never done here:
what `examination` and `arrangement` do.
"""

from __future__ import annotations

import numpy as np
from msgspec import structs

from symrender_cg.plan.arrangement import Arrangement, assemble
from symrender_cg.plan.bounds import require_comparable, require_lengths, require_spheres
from symrender_cg.plan.effects import SCENE
from symrender_cg.plan.examination import Examination, examine, look
from symrender_cg.plan.flags import fades, scene_flags
from symrender_cg.plan.plan import Plan
from symrender_cg.scene import Gradient, PointLight, Scene, Sphere


def arranged(frame: Scene, force: frozenset[str], aspect: float | None, max_error: float) -> Plan:
    """The plan of a scene in the camera's frame. Raises OutsidePlanError for lengths too far apart in size."""
    require_lengths(frame)
    require_comparable(frame)
    views = look(frame, aspect=aspect, force=force)
    require_spheres(frame, np.flatnonzero(views.visible).tolist())
    found = examine(views, max_error)
    arrangement = assemble(found)
    reduced = None if SCENE in force else _reduced(frame, found, arrangement)
    if reduced is not None:
        return Plan(reduced, frame, frozenset(), force, aspect, max_error)
    return Plan(frame, frame, scene_flags(frame, arrangement, force), force, aspect, max_error, arrangement)


def _reduced(frame: Scene, found: Examination, arrangement: Arrangement) -> Scene | None:
    """The one sphere and the one point light that are left of a scene; None where more is.

    Terms that are left out have the coefficient 0 there. Without any light one of intensity 0 takes its place.
    """
    if not (arrangement.visible == len(arrangement.spheres) == 1) or arrangement.plane_seen or arrangement.bounces:
        return None
    if frame.channels != 1 or isinstance(frame.background, Gradient):
        return None
    index = int(arrangement.spheres[0])
    used = arrangement.lamp_light[: arrangement.lamps_begin[1]].tolist()
    light = frame.lights[used[0]] if used else PointLight((0.0, 0.0, frame.camera.eye[2]), 0.0)
    if len(used) > 1 or not isinstance(light, PointLight) or fades(light):
        return None
    sphere = frame.spheres[index]
    material = structs.replace(
        sphere.material,
        diffuse=sphere.material.diffuse if bool(found.lamps.diffuse[index].any()) else 0.0,
        specular=sphere.material.specular if bool(found.lamps.specular[index].any()) else 0.0,
        reflect=0.0,
    )
    spheres = (Sphere(sphere.center, sphere.radius, material),)
    return Scene(frame.camera, spheres, (light,), frame.background, None, frame.shadows, 0)
