"""`rows_alike`: the numbers of many sets of parameters that one kernel of one sphere draws, without a plan for each.

In: the first set, planned as ever, and columns of numbers. Out: how many of the sets after it surely have the same
kernel, and the numbers of those as the kernel takes them. "Surely" is an inequality in float64 with room to spare; the
first set for which it does not hold is planned by itself, and so begins the next run.
Never here: a scene that is refused, or another kernel; both are for the plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symrender_cg.lower.variants import MOST_ROUNDOFFS
from symrender_cg.plan.effects import FARTHEST_ASIDE
from symrender_cg.plan.plan import Plan
from symrender_cg.run.framed import framed_half_heights
from symrender_cg.run.levels import MOST_SHININESS
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.parameters import Path, Sets
from symrender_cg.run.stacking import stack_of
from symrender_cg.run.steep import boxes_drawn, least_roundoffs, roundoffs
from symrender_cg.scene import Gradient, PointLight, Scene
from symrender_cg.scene.camera_frame import is_in_frame

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ROOM = 1e-9
"""Relative room that every inequality has here: rounding is 1e-15."""

LARGEST, SMALLEST = 2.0**40, 2.0**-40
"""Lengths and intensities in here, in ratios below MOST_RADII, are in reach of every kernel and every scene."""

MOST_RADII = 2.0**14

_INPUTS: Mapping[Path, str] = {
    ("spheres", 0, "radius"): "radius",
    ("spheres", 0, "center"): "center_",
    ("spheres", 0, "material", "ambient"): "k_ambient",
    ("spheres", 0, "material", "diffuse"): "k_diffuse",
    ("spheres", 0, "material", "specular"): "k_specular",
    ("spheres", 0, "material", "shininess"): "shininess",
    ("lights", 0, "position"): "light_",
    ("lights", 0, "intensity"): "light_intensity",
    ("background",): "background",
}
"""Which number of the derivation a path is; a name that ends in _ has three, for x, y and z."""


def inputs_for(scene: Scene, sets: Sets, looked_at: Sequence[int]) -> dict[str, Floats] | None:
    """Columns of the first of those sets by the names of the derivation's inputs, in the frames of their cameras; with
    `eye` and `half_height` where cameras turn. None where something else of the scene changes.

    scene: the first of the sets.
    """
    if is_in_frame(scene.camera):
        if sets.scenes:
            found = inputs_of_scenes([sets.scenes[index] for index in looked_at])
        else:
            found = inputs_of({path: column[looked_at] for path, column in sets.columns.items()})
        if found and len(found.get("radius", looked_at)) > 1:
            return found
    return _inputs_in_frames(scene, sets, looked_at)


def _inputs_in_frames(scene: Scene, sets: Sets, looked_at: Sequence[int]) -> dict[str, Floats] | None:
    if len(scene.spheres) != 1 or len(scene.lights) != 1 or scene.plane is not None or scene.channels != 1:
        return None
    read = stack_of(scene, sets, looked_at) if isinstance(scene.lights[0], PointLight) else None
    if read is None or read[0].background is None or "reflect" in read[0].changes:
        return None
    stack, members = read
    count = next((k for k, index in enumerate(members) if index != looked_at[k]), len(members))
    found = {"eye": stack.eye, "half_height": stack.half_height, "radius": stack.radius[:, 0]}
    found |= {"shininess": stack.shininess[:, 0], "light_intensity": stack.intensity[:, 0, 0]}
    found |= {"background": stack.background[:, 0]} if stack.background is not None else {}
    found |= {f"k_{name}": getattr(stack, name)[:, 0, 0] for name in ("ambient", "diffuse", "specular")}
    for k, axis in enumerate("xyz"):
        found |= {f"center_{axis}": stack.center[:, 0, k], f"light_{axis}": stack.place[:, 0, k]}
    return {name: column[:count] for name, column in found.items()}


def inputs_of(columns: Mapping[Path, NDArray[Any]]) -> dict[str, Floats] | None:
    """The columns by the names of the derivation's inputs; None where one of them is something else of the scene."""
    found: dict[str, Floats] = {}
    for path, column in columns.items():
        name, axis = _INPUTS.get(path), slice(0, 3)
        if name is None and isinstance(path[-1], int):
            name, axis = _INPUTS.get(path[:-1]), slice(path[-1], path[-1] + 1)
        if name is None or (column.ndim == 2) != (name.endswith("_") and axis == slice(0, 3)):
            return None
        values = column.astype(np.float64).reshape(len(column), -1) + 0.0
        names = [name + axis for axis in "xyz"[axis]] if name.endswith("_") else [name]
        found |= {each: values[:, k] for k, each in enumerate(names)}
    return found


def inputs_of_scenes(scenes: Sequence[Scene]) -> dict[str, Floats] | None:
    """The same of scenes, read off them: of the first ones, as long as they differ in nothing else.

    None where the first is not one sphere under one light, seen from a camera that needs no turning.
    """
    if not scenes or not _reads_off(scenes[0]):
        return None
    first, rows = scenes[0], []
    unlike = _unlike(first)
    for scene in scenes:
        if scene is not first and (not _reads_off(scene) or _unlike(scene) != unlike):
            break
        sphere, light = scene.spheres[0], scene.lights[0]
        material = sphere.material
        assert isinstance(light, PointLight)
        numbers = (material.ambient, material.diffuse, material.specular, light.intensity, scene.background)
        rows.append((*numbers, sphere.radius, material.shininess, *sphere.center, *light.position))
    names = ["k_ambient", "k_diffuse", "k_specular", "light_intensity", "background", "radius", "shininess"]
    names += [f"{what}_{axis}" for what in ("center", "light") for axis in "xyz"]
    return dict(zip(names, np.array(rows, dtype=np.float64).T, strict=True))


def _reads_off(scene: Scene) -> bool:
    """Whether the numbers of a scene in its own frame are those of a kernel of one sphere."""
    if len(scene.spheres) != 1 or len(scene.lights) != 1 or scene.plane is not None or scene.channels != 1:
        return False
    plain = isinstance(scene.lights[0], PointLight) and not isinstance(scene.background, Gradient)
    return plain and is_in_frame(scene.camera)


def _unlike(scene: Scene) -> tuple[object, ...]:
    """What `inputs_of_scenes` does not read."""
    material, light = scene.spheres[0].material, scene.lights[0]
    assert isinstance(light, PointLight)
    mirror = (material.reflect, scene.background if material.reflect else None)
    return scene.camera, light.attenuation, material.gate_specular, mirror, scene.shadows, scene.max_bounces


class Alike(NamedTuple):
    """Sets of one kernel.

    numbers       (sets, inputs) as the kernel takes them
    half_heights  (sets,) of their frames
    edges         (sets, 4) of the boxes that another kernel draws in their images (symrender_cg.run.steep.boxes_drawn),
                  NaN for none
    """

    numbers: Floats
    half_heights: Floats
    edges: Floats


def rows_alike(
    scene: Scene,
    found: Plan,
    inputs: Mapping[str, Floats],
    accuracy: str,
    order: tuple[str, ...],
    *,
    handed: bool = False,
    boxed: bool = False,
) -> Alike:
    """The first sets that have the kernel of the scene, which is that of the first set; at least that one.

    inputs: columns of the sets, the scene's own first. order: the kernel's inputs.
    handed: `double` hands the scene over, see symrender_cg.run.levels.hands_over.
    boxed: sets are wanted, too, of which `double` has another kernel draw a box; all edges are NaN where it is not so.
    """
    frame = found.scene
    numbers = numbers_of(frame)
    count = len(next(iter(inputs.values())))
    half_height = frame.camera.half_height
    assert half_height is not None, "a camera-frame scene has its half_height"
    material = scene.spheres[0].material if scene.spheres else None
    plain = found.arrangement is None and found.scene is found.given and material is not None
    changing = "background" in inputs and bool((inputs["background"] != inputs["background"][0]).any())
    mirrors = material is not None and material.reflect != 0.0 and changing
    turned = "eye" in inputs
    if not plain or mirrors or not (turned or is_in_frame(scene.camera)) or found.needs("front_test"):
        count = 1
    every = {name: np.broadcast_to(np.float64(value), count) for name, value in numbers.items()}
    half_heights = np.full(count, half_height)
    if count > 1:
        every |= {name: column[:count] for name, column in inputs.items()}
    edges = boxes_drawn(every) if boxed else np.full((count, 4), np.nan)
    if count > 1:
        assert material is not None, "there is one sphere"
        has_box = ~np.isnan(edges[:, 0])
        sure = _surely(every, numbers, accuracy, gated=material.gate_specular, handed=handed, has_box=has_box)
        sure[0] = True
        count = int(np.argmin(sure)) if not sure.all() else count
        if turned:
            half_heights = inputs["half_height"][:count]
        elif scene.camera.half_height is None and not {"radius", "center_x", "center_y", "center_z"}.isdisjoint(inputs):
            half_heights = _framed(every, count)
        eye = every["eye"][:count]
        sure = (
            (half_heights[:count] <= MOST_RADII * eye) & (half_heights[:count] * MOST_RADII >= eye) & (eye >= SMALLEST)
        )
        sure[0] = True
        count = int(np.argmin(sure)) if not sure.all() else count
    return Alike(np.stack([every[name][:count] for name in order], axis=1), half_heights[:count], edges[:count])


def _surely(
    every: Mapping[str, Floats], first: Mapping[str, float], accuracy: str, *, gated: bool, handed: bool, has_box: Bools
) -> Bools:
    """Which sets have a scene, a plan of the same effects as the first, and the same level's kernel."""
    center, light = ([every[f"{what}_{axis}"] for axis in "xyz"] for what in ("center", "light"))
    radius, shininess = every["radius"], every["shininess"]
    diffuse, specular, intensity = every["k_diffuse"], every["k_specular"], every["light_intensity"]
    aside = np.maximum(np.abs(center[0]), np.abs(center[1]))
    with np.errstate(all="ignore"):
        depth = every["eye"] - center[2]
        sure = (radius >= SMALLEST) & (radius <= LARGEST) & (every["eye"] <= MOST_RADII * radius)
        for coordinate in center:
            sure &= np.abs(coordinate) <= MOST_RADII * radius
        for coordinate in light:
            sure &= np.abs(coordinate) <= LARGEST
        for value in (every["k_ambient"], diffuse, specular, intensity, shininess, every["background"]):
            sure &= (value >= 0.0) & (value <= LARGEST)
        sure &= (depth > (1.0 + ROOM) * radius) & (aside <= (1.0 - ROOM) * FARTHEST_ASIDE * depth)
        off_axis = (center[0] != 0.0) | (center[1] != 0.0) | (center[2] != 0.0)
        sure &= off_axis == any(first[f"center_{axis}"] != 0.0 for axis in "xyz")
        lit = first["light_intensity"] != 0.0
        sure &= ((diffuse != 0.0) & (intensity != 0.0)) == (first["k_diffuse"] != 0.0 and lit)
        sure &= ((specular != 0.0) & (intensity != 0.0)) == (first["k_specular"] != 0.0 and lit)
        sure &= (shininess <= MOST_SHININESS) == (first["shininess"] <= MOST_SHININESS)
        if accuracy == "double":
            signs = (specular > 0.0) & (gated | ((shininess > 0.0) & (shininess < 1.0)))
            above = least_roundoffs(every) >= (1.0 + ROOM) * MOST_ROUNDOFFS
            found = roundoffs(every)
            below = (found <= (1.0 - ROOM) * MOST_ROUNDOFFS) | (has_box & (found >= (1.0 + ROOM) * MOST_ROUNDOFFS))
            sure &= (signs | above) if handed else (~signs & below)
    return np.asarray(sure, dtype=np.bool_)


def _framed(every: Mapping[str, Floats], count: int) -> Floats:
    """The half-heights that frame each set's sphere."""
    center = np.stack([every[f"center_{axis}"][:count] for axis in "xyz"], axis=1)
    return framed_half_heights(every["eye"][:count], center[:, np.newaxis], every["radius"][:count, np.newaxis])
