"""`stack_of`: the numbers of many sets of a batch as arrays, where they are those of one kind of scene.

In: the sets of a batch, the first of them as a scene. Out: a Stack, or None where something changes that it has no
place for: a camera, a plane, a mirror, a direction. And `structures_of`: the structures of C of those that are decided
to be alike. Never here: a decision.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symrender_cg.errors import SceneError
from symrender_cg.plan.measures import colour
from symrender_cg.plan.plan import Plan
from symrender_cg.plan.stack import Stack
from symrender_cg.plan.stack_lists import Decided
from symrender_cg.run.enclosure_kernel import EnclosureKernel
from symrender_cg.run.parameters import Path, Sets
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.structures import lead
from symrender_cg.scene import DirectionalLight, Gradient, PointLight, Scene, Sphere
from symrender_cg.scene.framing import framed_half_height

Floats = NDArray[np.float64]

_COEFFICIENTS = ("ambient", "diffuse", "specular")


def stack_of(scene: Scene, found: Plan, sets: Sets, looked_at: Sequence[int]) -> tuple[Stack, list[int]] | None:
    """Those of the sets that are of the kind of `scene`, which is one of the batch's and has that plan, and their
    numbers; None where there is none, or where something changes that a stack has no place for."""
    if sets.scenes:
        read = stack_of_scenes(scene, found, [sets.scenes[index] for index in looked_at])
        return None if read is None else (read[0], [looked_at[k] for k in read[1]])
    columns = {path: column[looked_at] for path, column in sets.columns.items()}
    stack = _of_columns(scene, found, columns, len(looked_at))
    return None if stack is None else (stack, list(looked_at))


def _of_columns(scene: Scene, found: Plan, columns: dict[Path, NDArray[Any]], count: int) -> Stack | None:
    arrays = _read(scene)
    wide: dict[str, NDArray[np.float64]] = {}
    for path, column in columns.items():
        place = _place(scene, path)
        if place is None or column.dtype.kind == "b":
            return None
        name, at = place
        if name not in wide:
            wide[name] = np.repeat(arrays[name][np.newaxis], count, axis=0)
        values = column.astype(np.float64) + 0.0
        target = wide[name][(slice(None), *at)]
        target[...] = values if values.ndim == target.ndim else values[:, np.newaxis]
    moved = "center" in wide or "radius" in wide
    every = {name: wide.get(name, np.broadcast_to(array, (count, *array.shape))) for name, array in arrays.items()}
    return _stack(scene, found, every, moved)


def _place(scene: Scene, path: Path) -> tuple[str, tuple[Any, ...]] | None:
    """Which array a path is in, and where; None for what no array holds."""
    match path:
        case ("spheres", int(k), "radius"):
            return "radius", (k,)
        case ("spheres", int(k), "center", *axis):
            return "center", (k, *axis)
        case ("spheres", int(k), "material", "shininess"):
            return "shininess", (k,)
        case ("spheres", int(k), "material", str(name), *axis) if name in _COEFFICIENTS:
            return name, (k, *axis)
        case ("lights", int(k), "position", *axis) if isinstance(scene.lights[k], PointLight):
            return "place", (k, *axis)
        case ("lights", int(k), "intensity", *axis):
            return "intensity", (k, *axis)
        case ("background", *axis) if not isinstance(scene.background, Gradient):
            return "background", tuple(axis)
    return None


def _read(scene: Scene) -> dict[str, Floats]:
    """The arrays of one scene, without the axis of scenes."""
    spheres = scene.spheres
    materials = [sphere.material for sphere in spheres]
    found: dict[str, Any] = {
        "center": [sphere.center for sphere in spheres],
        "radius": [sphere.radius for sphere in spheres],
        "shininess": [material.shininess for material in materials],
        "place": [light.direction if isinstance(light, DirectionalLight) else light.position for light in scene.lights],
        "intensity": [colour(light.intensity) for light in scene.lights],
    }
    found |= {name: [colour(getattr(material, name)) for material in materials] for name in _COEFFICIENTS}
    if not isinstance(scene.background, Gradient):
        found["background"] = colour(scene.background)
    arrays = {name: np.array(values, dtype=np.float64) for name, values in found.items()}
    return arrays | {name: arrays[name].reshape(-1, 3) for name in ("place", "intensity")}


def stack_of_scenes(scene: Scene, found: Plan, scenes: Sequence[Scene]) -> tuple[Stack, list[int]] | None:
    """Those of the scenes that differ from this one in what a stack holds alone, and which they are."""
    kind = _kind(scene)
    chosen = [k for k, each in enumerate(scenes) if each is scene or _kind(each) == kind]
    if not chosen:
        return None
    alike = [scenes[k] for k in chosen]
    moved = any(each.spheres is not scene.spheres and _shapes(each) != _shapes(scene) for each in alike)
    read: dict[int, dict[str, Floats]] = {}
    rows = []
    for each in alike:
        spheres = read.get(id(each.spheres))
        if spheres is None:
            spheres = read[id(each.spheres)] = _read(each)
        rows.append(spheres | _lights(each))
    return _stack(scene, found, {name: np.array([row[name] for row in rows]) for name in rows[0]}, moved), chosen


def _lights(scene: Scene) -> dict[str, Floats]:
    """What `_read` has that is not of spheres."""
    lit = {
        "place": [light.direction if isinstance(light, DirectionalLight) else light.position for light in scene.lights],
        "intensity": [colour(light.intensity) for light in scene.lights],
    }
    found = {name: np.array(values, dtype=np.float64).reshape(-1, 3) for name, values in lit.items()}
    if not isinstance(scene.background, Gradient):
        found["background"] = np.array(colour(scene.background), dtype=np.float64)
    return found


def _shapes(scene: Scene) -> list[tuple[Any, ...]]:
    return [(sphere.center, sphere.radius) for sphere in scene.spheres]


def _kind(scene: Scene) -> tuple[Any, ...]:
    """What a stack does not hold."""
    materials = [(sphere.material.gate_specular, sphere.material.reflect) for sphere in scene.spheres]
    lights = [
        light.attenuation if isinstance(light, PointLight) else ("parallel", light.direction) for light in scene.lights
    ]
    background = scene.background if isinstance(scene.background, Gradient) else None
    return scene.camera, materials, lights, background, scene.plane, scene.shadows, scene.max_bounces


def _stack(scene: Scene, found: Plan, arrays: dict[str, Floats], moved: bool) -> Stack:
    half_height = found.scene.camera.half_height
    assert half_height is not None, "a camera-frame scene has its half_height"
    half_heights = np.full(len(arrays["radius"]), half_height)
    if moved and scene.camera.half_height is None:
        half_heights = _framed(scene.camera.eye[2], arrays["center"], arrays["radius"])
    return Stack(
        center=arrays["center"],
        radius=arrays["radius"],
        place=arrays["place"],
        ambient=arrays["ambient"],
        diffuse=arrays["diffuse"],
        specular=arrays["specular"],
        shininess=arrays["shininess"],
        intensity=arrays["intensity"],
        background=arrays.get("background"),
        half_height=half_heights,
        moved=moved,
    )


def _framed(eye: float, center: Floats, radius: Floats) -> Floats:
    """The half-heights that frame the spheres of each scene; nan where there is none."""
    found = np.full(len(radius), np.nan)
    for k, (places, sizes) in enumerate(zip(center.tolist(), radius.tolist(), strict=True)):
        try:
            spheres = tuple(Sphere((c[0], c[1], c[2]), r) for c, r in zip(places, sizes, strict=True))
            found[k] = framed_half_height(eye, spheres)
        except SceneError:
            break
    return found


def structures_of(
    kernel: SceneKernel | EnclosureKernel, same: Mapping[str, Any], stack: Stack, decided: Decided
) -> tuple[NDArray[Any], tuple[Any, ...]]:
    """The scenes whose lists are decided, as the C sees them; what has to be kept for them.

    same: the numbers of one of their kind, for what they have in common.
    """
    made = np.zeros(len(decided.chosen), dtype=kernel.structure)
    size, channels = decided.spheres.shape[1], kernel.channels
    lists = _lists(stack, decided, channels, same)
    keeps: list[NDArray[Any]] = []
    for name, shape in kernel.fields:
        if shape in ("number", "whole"):
            made[name] = size if name in ("spheres", "receivers") else same[name]
        else:
            values, sizes = lists.get(name, (np.asarray(same[name]), 0))
            keeps.append(lead(made, name, values.astype(np.float64 if shape == "reals" else np.int32), sizes))
    return made, tuple(keeps)


def _lists(
    stack: Stack, decided: Decided, channels: int, same: Mapping[str, Any]
) -> dict[str, tuple[NDArray[Any], ArrayLike]]:
    """The fields that differ from scene to scene: all lists one after the other, and how long they are."""
    rows, size = decided.chosen, decided.spheres.shape[1]
    at = rows[:, np.newaxis], decided.spheres
    found: dict[str, tuple[NDArray[Any], ArrayLike]] = {
        "radius": (stack.radius[at], size),
        "shininess": (stack.shininess[at], size),
        "light_intensity": _colours(stack.intensity[rows], channels),
        "lamps_begin": (decided.lamps_begin, size + 1),
        "lamp_light": (decided.lamp_light, decided.lamps),
        "lamp_terms": (decided.lamp_terms, decided.lamps),
        "blockers_begin": (decided.blockers_begin, decided.lamps + 1),
        "blockers": (decided.blockers, decided.shades),
    }
    found |= {name: _colours(getattr(stack, name)[at], channels) for name in _COEFFICIENTS}
    if stack.background is not None:
        found["background"] = _colours(stack.background[rows, np.newaxis], channels)
    for i, axis in enumerate("xyz"):
        found[f"center_{axis}"] = stack.center[at][..., i], size
        places = np.where(same["nearness"] == 0.0, same[f"light_{axis}"], stack.place[rows, :, i])
        found[f"light_{axis}"] = places, places.shape[1]
    return found


def _colours(values: Floats, channels: int) -> tuple[Floats, int]:
    """(T, n, 3) in the channels of a kernel, and how many numbers a scene has of them."""
    return values[..., :channels], values.shape[1] * channels
