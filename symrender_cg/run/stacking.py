"""`stack_of`: the numbers of many sets of a batch as arrays, where they are those of one kind of scene.

In: the sets of a batch, one of them as a scene. Out: a Stack in the frames of the sets' cameras, or None where
something changes that it has no place for: an attenuation, a gradient's colours, a switch. Never here: a decision.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.plan.measures import colour
from symrender_cg.plan.stack_numbers import Ground, Stack, repeated
from symrender_cg.run.framed import framed_half_heights
from symrender_cg.run.parameters import Path, Sets
from symrender_cg.run.turned import frames_of
from symrender_cg.scene import DirectionalLight, Gradient, Phong, PointLight, Scene

Floats = NDArray[np.float64]
Arrays = Mapping[str, Floats]
"""The numbers of scenes as they are given, by name; with an axis of scenes, of which one may stand for all."""

_COEFFICIENTS: Final = ("ambient", "diffuse", "specular")
_MATERIAL: Final = (*_COEFFICIENTS, "shininess", "reflect")
_CAMERA: Final = ("eye", "look_at", "upright")


def stack_of(scene: Scene, sets: Sets, looked_at: Sequence[int]) -> tuple[Stack, list[int]] | None:
    """Those of the sets that are of the kind of `scene`, which is one of the batch's, and their numbers; None where
    there is none, or where something changes that a stack has no place for."""
    if sets.scenes:
        read = stack_of_scenes(scene, [sets.scenes[index] for index in looked_at])
        return None if read is None else (read[0], [looked_at[k] for k in read[1]])
    columns = {path: column[looked_at] for path, column in sets.columns.items()}
    stack = _of_columns(scene, columns, len(looked_at))
    return None if stack is None else (stack, list(looked_at))


def _of_columns(scene: Scene, columns: dict[Path, NDArray[Any]], count: int) -> Stack | None:
    arrays = {name: array[np.newaxis] for name, array in _read(scene).items()}
    wide: set[str] = set()
    for path, column in columns.items():
        place = _place(scene, path)
        if place is None or column.dtype.kind == "b":
            return None
        name, at = place
        if name not in wide:
            arrays[name] = np.repeat(arrays[name], count, axis=0)
            wide.add(name)
        values = column.astype(np.float64) + 0.0
        target = arrays[name][(slice(None), *at)]
        target[...] = values if values.ndim == target.ndim else values[:, np.newaxis]
    return _stack(scene, arrays, count)


def _place(scene: Scene, path: Path) -> tuple[str, tuple[Any, ...]] | None:
    """Which array a path is in, and where; None for what no array holds."""
    match path:
        case ("spheres", int(k), "radius"):
            return "radius", (k,)
        case ("spheres", int(k), "center", *axis):
            return "center", (k, *axis)
        case ("spheres", int(k), "material", str(name), *axis) if name in _MATERIAL:
            return name, (k, *axis)
        case ("plane", "material" | "checker" as which, str(name), *axis) if name in _MATERIAL:
            return name, (len(scene.spheres) + (which == "checker"), *axis)
        case ("plane", "point" | "normal" | "axis" | "tile" as name, *axis):
            return name, tuple(axis)
        case ("lights", int(k), "position" | "direction", *axis):
            return "place", (k, *axis)
        case ("lights", int(k), "intensity", *axis):
            return "intensity", (k, *axis)
        case ("camera", "eye" | "look_at" | "half_height" as name, *axis):
            return name, tuple(axis)
        case ("camera", "up", *axis):
            return "upright", tuple(axis)
        case ("background", "up", *axis):
            return "up", tuple(axis)
        case ("background", *axis) if not isinstance(scene.background, Gradient):
            return "background", tuple(axis)
    return None


def _read(scene: Scene) -> dict[str, Floats]:
    """The arrays of one scene, without the axis of scenes; half_height nan for one that frames the spheres."""
    found = _of_surfaces(scene) | _of_lights(scene)
    return {name: np.array(values, dtype=np.float64).reshape(_shape(name)) for name, values in found.items()}


def _shape(name: str) -> tuple[int, ...]:
    """Of an array of one scene; one that is empty has its shape too."""
    if name in ("center", "place", "intensity", *_COEFFICIENTS):
        return (-1, 3)
    return () if name in ("half_height", "tile") else (-1,)


def _of_surfaces(scene: Scene) -> dict[str, Any]:
    spheres, materials = scene.spheres, _materials(scene)
    found: dict[str, Any] = {
        "center": [sphere.center for sphere in spheres],
        "radius": [sphere.radius for sphere in spheres],
        "shininess": [material.shininess for material in materials],
        "reflect": [material.reflect for material in materials],
    }
    return found | {name: [colour(getattr(material, name)) for material in materials] for name in _COEFFICIENTS}


def _of_lights(scene: Scene) -> dict[str, Any]:
    """What is neither a sphere nor a material."""
    camera, plane, background = scene.camera, scene.plane, scene.background
    found: dict[str, Any] = {
        "eye": camera.eye,
        "look_at": camera.look_at,
        "upright": camera.up,
        "half_height": np.nan if camera.half_height is None else camera.half_height,
        "place": [light.direction if isinstance(light, DirectionalLight) else light.position for light in scene.lights],
        "intensity": [colour(light.intensity) for light in scene.lights],
    }
    if plane is not None:
        found |= {"point": plane.point, "normal": plane.normal, "axis": plane.axis, "tile": plane.tile}
    return found | ({"up": background.up} if isinstance(background, Gradient) else {"background": colour(background)})


def _materials(scene: Scene) -> list[Phong]:
    """Those of the spheres, then of the plane."""
    materials = [sphere.material for sphere in scene.spheres]
    planes = () if scene.plane is None else (scene.plane.material, scene.plane.checker)
    return [*materials, *(material for material in planes if material is not None)]


def stack_of_scenes(scene: Scene, scenes: Sequence[Scene]) -> tuple[Stack, list[int]] | None:
    """Those of the scenes that differ from this one in what a stack holds alone, and which they are."""
    kind = _kind(scene)
    chosen = [k for k, each in enumerate(scenes) if each is scene or _kind(each) == kind]
    if not chosen:
        return None
    read: dict[tuple[int, int], dict[str, Any]] = {}
    rows = []
    for each in (scenes[k] for k in chosen):
        surfaces = id(each.spheres), id(each.plane)
        if surfaces not in read:
            read[surfaces] = _of_surfaces(each)
        rows.append(read[surfaces] | _of_lights(each))
    arrays = {}
    for name in rows[0]:
        first = rows[0][name]
        same = all(row[name] is first for row in rows)
        values = np.array([first] if same else [row[name] for row in rows], dtype=np.float64)
        array = values.reshape(len(values), *(_shape(name) if values.size else (0, *_shape(name)[1:])))
        arrays[name] = array[:1] if np.array_equal(array, np.broadcast_to(array[:1], array.shape), True) else array
    return _stack(scene, arrays, len(chosen)), chosen


def _kind(scene: Scene) -> tuple[Any, ...]:
    """What a stack does not hold."""
    plane, background = scene.plane, scene.background
    lights = [light.attenuation if isinstance(light, PointLight) else "parallel" for light in scene.lights]
    tiles = None if plane is None else plane.checker is not None
    gates = [material.gate_specular for material in _materials(scene)]
    sky = (background.bottom, background.top) if isinstance(background, Gradient) else None
    return len(scene.spheres), tiles, gates, lights, sky, scene.shadows, scene.max_bounces


def _stack(scene: Scene, given: Arrays, count: int) -> Stack:
    """The arrays in the frames of their cameras."""
    cameras = max(len(given[name]) for name in _CAMERA)
    moved = dict(given)
    with np.errstate(all="ignore"):
        frames = frames_of(*(repeated(given[name], cameras) for name in _CAMERA))
        moved["center"] = frames.points(given["center"])
        moved["eye"] = frames.eye_distance
        parallel = np.array([isinstance(light, DirectionalLight) for light in scene.lights], dtype=bool)
        places = frames.points(given["place"]) if not parallel.all() else given["place"]
        if parallel.any():
            places = np.where(parallel[:, np.newaxis], frames.directions(given["place"]), places)
        moved["place"] = places
        if "up" in given:
            moved["up"] = frames.directions(given["up"][:, np.newaxis])[:, 0]
        if "point" in given:
            moved["point"] = frames.points(given["point"][:, np.newaxis])[:, 0]
            for name in ("normal", "axis"):
                moved[name] = frames.directions(given[name][:, np.newaxis])[:, 0]
        moved["half_height"] = _half_heights(given["half_height"], moved["eye"], moved["center"], moved["radius"])
    changes = frozenset(name for name, array in moved.items() if len(array) > 1)
    every: dict[str, Any] = {
        name: repeated(array, count) for name, array in moved.items() if name not in ("look_at", "upright")
    }
    ground = None
    if scene.plane is not None:
        ground = Ground(*(every.pop(name) for name in ("point", "normal", "axis", "tile")))
    return Stack(
        **({"background": None, "up": None} | every),
        ground=ground,
        changes=changes - {"look_at", "upright"},
    )


def _half_heights(given: Floats, eye: Floats, center: Floats, radius: Floats) -> Floats:
    """Those that are given, and those that frame the spheres, in the camera's frame."""
    if not np.isnan(given).any():
        return given
    count = max(map(len, (given, eye, center, radius)))
    found = np.array(repeated(given, count))
    framed = np.isnan(found)
    if max(map(len, (eye, center, radius))) == 1:
        found[framed] = framed_half_heights(eye, center, radius)
    else:
        parts = (repeated(array, count)[framed] for array in (eye, center, radius))
        found[framed] = framed_half_heights(*parts)
    return found
