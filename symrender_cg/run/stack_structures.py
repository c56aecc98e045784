"""`structures_of`: scenes that were decided together as the C sees them, without a scene or a plan for each.

In: a Stack, and what was decided about some of its scenes. Out: the numbers and lists of symrender_cg.run.scene_numbers
and enclosure_numbers, of all scenes one after the other, and an array of structures that lead into them. Numbers that
are the same in every scene are there once. Never here: a decision.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from msgspec import structs
from numpy.typing import ArrayLike, NDArray

from symrender_cg.plan.stack_lists import Decided
from symrender_cg.plan.stack_numbers import Stack
from symrender_cg.run.enclosure_kernel import EnclosureKernel
from symrender_cg.run.enclosure_numbers import exact_numbers
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.scene_numbers import ground_numbers
from symrender_cg.run.structures import lead
from symrender_cg.run.turned import unit_vectors
from symrender_cg.scene import Camera, DirectionalLight, Gradient, Plane, Scene
from symrender_cg.scene.exact import Vector

Floats = NDArray[np.float64]
Values = dict[str, tuple[NDArray[Any], ArrayLike]]
"""Values of all scenes one after the other by the names of fields, and how many of them a scene has."""

_GROUND: Final = frozenset({"eye", "point", "normal", "axis", "tile"})


def structures_of(
    kernel: SceneKernel | EnclosureKernel, scene: Scene, same: Mapping[str, Any], stack: Stack, decided: Decided
) -> tuple[NDArray[Any], tuple[Any, ...]]:
    """The scenes whose lists are decided, as the C sees them; what has to be kept for them.

    scene: one of their kind in the camera's frame; same: its numbers, for what all have in common.
    """
    made = np.zeros(len(decided.chosen), dtype=kernel.structure)
    in_full = isinstance(kernel, EnclosureKernel)
    numbers, lists = numbers_of_stack(scene, same, stack, decided, kernel.channels, in_full=in_full)
    keeps: list[NDArray[Any]] = []
    for name, shape in kernel.fields:
        if shape in ("number", "whole"):
            made[name] = numbers.get(name, same.get(name))
        else:
            values, sizes = lists[name] if name in lists else (np.asarray(same[name]), 0)
            keeps.append(lead(made, name, values.astype(np.float64 if shape == "reals" else np.int32), sizes))
    return made, tuple(keeps)


def numbers_of_stack(
    scene: Scene, same: Mapping[str, Any], stack: Stack, decided: Decided, channels: int, *, in_full: bool
) -> tuple[dict[str, NDArray[Any]], Values]:
    """What differs from scene to scene: numbers (T,), and lists. in_full: as an enclosure takes them."""
    rows = decided.chosen
    numbers: dict[str, NDArray[Any]] = {
        "eye": stack.eye[rows],
        "spheres": decided.sizes,
        "visible": decided.visible,
        "receivers": decided.receivers,
        "plane_seen": decided.plane_seen,
        "bounces": decided.bounces,
    }
    lists = _lists(decided) | _materials(stack, decided, channels)
    lists |= _places(stack, decided, same) | _lights(scene, stack, rows, same, channels, in_full=in_full)
    if stack.background is not None:
        lists["background"] = _colours(stack.background[rows, np.newaxis], channels)
    turned = stack.up is not None and "up" in stack.changes
    moved = stack.ground is not None and not _GROUND.isdisjoint(stack.changes)
    if stack.up is not None and turned:
        up = unit_vectors(stack.up[rows])
        numbers |= {f"up_{axis}": up[:, i] for i, axis in enumerate("xyz")}
    if moved or (turned and in_full):
        found = [_of_frame(_frame(scene, stack, t), in_full=in_full) for t in rows.tolist()]
        _add_frames(found, decided, decided.materials >= stack.spheres, numbers, lists)
    return numbers, lists


def _lists(decided: Decided) -> Values:
    found: Values = {
        "at_eye": (decided.at_eye, decided.sizes),
        "crosses_plane": (decided.crosses, decided.sizes),
        "lamp_light": (decided.lamp_light, decided.lamps.sizes),
        "lamp_terms": (decided.lamp_terms, decided.lamps.sizes),
        "lamps_begin": (decided.lamps.begin, decided.lamps.begins),
        "mirror_plane": (decided.mirror_plane, decided.receivers),
    }
    for name in ("partners", "blockers", "mirrors"):
        lists = getattr(decided, name)
        found |= {name: (lists.members, lists.sizes), f"{name}_begin": (lists.begin, lists.begins)}
    return found


def _materials(stack: Stack, decided: Decided, channels: int) -> Values:
    at = np.repeat(decided.chosen, decided.receivers), decided.materials
    sizes = decided.receivers
    found: Values = {
        name: (getattr(stack, name)[at][:, :channels], sizes * channels) for name in ("ambient", "diffuse", "specular")
    }
    found["shininess"] = stack.shininess[at], sizes
    found["reflect"] = np.where(decided.mirror, stack.reflect[at], 0.0), sizes
    return found


def _places(stack: Stack, decided: Decided, same: Mapping[str, Any]) -> Values:
    """Centres and radii; of the plane the eye and its height, which `_add_frames` fills in where it changes."""
    scene = np.repeat(decided.chosen, decided.receivers)
    of_sphere = decided.materials < stack.spheres
    center = np.zeros((len(scene), 3))
    center[:, 2] = stack.eye[scene]
    radius, low = np.zeros(len(scene)), np.zeros(len(scene))
    if stack.ground is not None and not of_sphere.all():
        radius[:], low[:] = same["radius"][-1], same["radius_low"][-1]
    at = scene[of_sphere], decided.materials[of_sphere]
    center[of_sphere], radius[of_sphere], low[of_sphere] = stack.center[at], stack.radius[at], 0.0
    found: Values = {f"center_{axis}": (center[:, i], decided.receivers) for i, axis in enumerate("xyz")}
    return found | {"radius": (radius, decided.receivers), "radius_low": (low, decided.receivers)}


def _lights(
    scene: Scene, stack: Stack, rows: NDArray[np.int64], same: Mapping[str, Any], channels: int, *, in_full: bool
) -> Values:
    found: Values = {}
    if "intensity" in stack.changes:
        found["light_intensity"] = _colours(stack.intensity[rows], channels)
    if "place" in stack.changes:
        place = stack.place[rows].copy()
        for index, light in enumerate(scene.lights):
            if isinstance(light, DirectionalLight):
                place[:, index] = -place[:, index] if in_full else unit_vectors(-place[:, index])
        found |= {f"light_{axis}": (place[..., i], place.shape[1]) for i, axis in enumerate("xyz")}
    return found


def _frame(scene: Scene, stack: Stack, t: int) -> Scene:
    """What a scene has beside spheres and lights, in the camera's frame."""
    background, plane = scene.background, None
    if isinstance(background, Gradient):
        assert stack.up is not None, "a gradient has a direction"
        background = structs.replace(background, up=_vector(stack.up[t]))
    if stack.ground is not None:
        ground = stack.ground
        point, normal, axis = (_vector(part[t]) for part in (ground.point, ground.normal, ground.axis))
        tiles = None if scene.plane is None else scene.plane.checker
        plane = Plane(point, normal, checker=tiles, tile=float(ground.tile[t]), axis=axis)
    return Scene(Camera((0.0, 0.0, float(stack.eye[t])), half_height=1.0), (), (), background, plane)


def _vector(v: Floats) -> Vector:
    x, y, z = v.tolist()
    return x, y, z


def _of_frame(frame: Scene, *, in_full: bool) -> dict[str, Any]:
    """The numbers that are not made of one coordinate each, from whole numbers."""
    if not in_full:
        return ground_numbers(frame) if frame.plane is not None else {}
    found = exact_numbers(frame)
    return found | ({"radius": found["ground"][9]} if "ground" in found else {})


def _add_frames(
    found: list[dict[str, Any]], decided: Decided, of_plane: NDArray[np.bool_], numbers: dict[str, Any], lists: Values
) -> None:
    """Adds the numbers of each frame to those of all scenes, and the eye's height to the materials of its plane."""
    for name in found[0]:
        values = np.array([each[name] for each in found], dtype=np.float64)
        if name in ("radius", "radius_low"):
            every, sizes = lists[name]
            lists[name] = np.where(of_plane, np.repeat(values, decided.receivers), every), sizes
        elif values.ndim == 1:
            numbers[name] = values
        elif values.shape[1]:
            lists[name] = values, values.shape[1]


def _colours(values: Floats, channels: int) -> tuple[Floats, int]:
    """(T, n, 3) in the channels of a kernel, and how many numbers a scene has of them."""
    return values[..., :channels], values.shape[1] * channels
