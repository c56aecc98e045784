"""What changes in sets of scenes that are planned in arrays; and what their own plans say, in the same words."""

from __future__ import annotations

from typing import Any

import numpy as np

from symrender_cg import PointLight, Scene
from symrender_cg.plan.arrangement import Arrangement
from symrender_cg.plan.stack_lists import Decided, Lists
from symrender_cg.scene import Gradient, Vector


def changes(scene: Scene, seed: int, count: int) -> dict[str, Any]:
    """Something of a scene of at least a sphere that moves or changes: by a little, by much, or in steps of 1/4, so
    that things touch and tie exactly."""
    draws = np.random.default_rng(1000 + seed)
    far = (0.02, 0.3, 3.0, 0.0)[seed % 4]
    camera, plane, last = scene.camera, scene.plane, len(scene.spheres) - 1
    first, sphere = scene.spheres[0], scene.spheres[-1]

    def about(place: Vector, share: float) -> Any:
        moves = draws.uniform(-far, far, (count, 3)) * share if far else draws.integers(-2, 3, (count, 3)) / 4.0
        return np.array(place) + moves

    found: list[dict[str, Any]] = [
        {f"spheres.{last}.center": about(sphere.center, 0.3)},
        {
            "spheres.0.radius": first.radius
            * (draws.uniform(0.5, 1.5, count) if far else 2.0 ** draws.integers(-1, 2, count))
        },
        {
            "spheres.0.material.specular": draws.choice([0.0, 0.5], count),
            f"spheres.{last}.material.diffuse": draws.choice([0.0, 0.5], count),
            f"spheres.{last}.material.reflect": draws.choice([0.0, 0.5], count),
        },
        {"camera.eye": about(camera.eye, 0.5)},
        {"camera.look_at": about(camera.look_at, 0.2), "camera.up": about(camera.up, 0.1)},
        {"camera.half_height": draws.uniform(0.5, 3.0, count)},
    ]
    for k, light in enumerate(scene.lights[:2]):
        given = ("position", light.position) if isinstance(light, PointLight) else ("direction", light.direction)
        found.append({f"lights.{k}.{given[0]}": about(given[1], 1.0)})
        found.append({f"lights.{k}.intensity": draws.choice([0.0, 1.0], count)})
    if plane is not None:
        found.append({"plane.point": about(plane.point, 1.0), "plane.axis": about(plane.axis, 0.1)})
        found.append({"plane.normal": about(plane.normal, 0.1), "plane.tile": draws.uniform(0.5, 9.0, count)})
        found.append({"plane.material.reflect": draws.choice([0.0, 0.5], count)})
    if isinstance(scene.background, Gradient):
        found.append({"background.up": about(scene.background.up, 0.5)})
    else:
        found.append({"background": draws.choice([0.0, 0.5], count)})
    return found[seed // 4 % len(found)]


# ---- what plans say, and what was decided together, in the same words


def lists_of(found: Arrangement) -> dict[str, Any]:
    """All of an arrangement but materials, which are rows of a stack."""
    terms = found.lamp_diffuse + 2 * found.lamp_specular + 4 * found.lamp_gated
    names = ("partners", "blockers", "mirrors")
    every: dict[str, Any] = {
        "spheres": found.spheres,
        "visible": found.visible,
        "receivers": found.receivers,
        "at_eye": found.at_eye,
        "crosses": found.crosses_plane,
        "plane_seen": found.plane_seen,
        "lamps": found.lamps_begin,
        "lamp_light": found.lamp_light,
        "lamp_terms": terms,
        "mirror": found.mirror,
        "mirror_plane": found.mirror_plane,
        "bounces": found.bounces,
        **{name: getattr(found, name) for name in names},
        **{f"{name}_begin": getattr(found, f"{name}_begin") for name in names},
    }
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in every.items()}


def decided_lists(decided: Decided) -> list[dict[str, Any]]:
    """The same of every scene that was decided."""

    def parts(values: Any, sizes: Any) -> list[Any]:
        return [part.tolist() for part in np.split(values, np.cumsum(sizes)[:-1])]

    def begins(lists: Lists) -> list[Any]:
        return parts(lists.begin, lists.begins)

    every = {
        "spheres": parts(decided.spheres, decided.sizes),
        "visible": decided.visible.tolist(),
        "receivers": decided.receivers.tolist(),
        "at_eye": parts(decided.at_eye, decided.sizes),
        "crosses": parts(decided.crosses, decided.sizes),
        "plane_seen": decided.plane_seen.tolist(),
        "lamps": begins(decided.lamps),
        "lamp_light": parts(decided.lamp_light, decided.lamps.sizes),
        "lamp_terms": parts(decided.lamp_terms, decided.lamps.sizes),
        "mirror": parts(decided.mirror, decided.receivers),
        "mirror_plane": parts(decided.mirror_plane, decided.receivers),
        "bounces": decided.bounces.tolist(),
    }
    for name in ("partners", "blockers", "mirrors"):
        lists: Lists = getattr(decided, name)
        every |= {name: parts(lists.members, lists.sizes), f"{name}_begin": begins(lists)}
    rows = [{name: values[k] for name, values in every.items()} for k in range(len(decided.chosen))]
    for row in rows:
        row["at_eye"] = row["at_eye"][: row["visible"]]
    return rows
