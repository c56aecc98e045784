"""The numbers and lists of a scene as its kernel takes them: by the names of the kernel's fields.

Comes in: a scene in the camera's frame and the arrangement that its plan found. Goes out: numbers and arrays; every
number is the scene's own, or rounded once from it. Never done here: a decision about what can be seen or lit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.plan.arrangement import Arrangement
from symrender_cg.run.enclosure_numbers import as_triple
from symrender_cg.scene import Colour, Gradient, Phong, PointLight, Scene, exact
from symrender_cg.scene.exact import Vector

DIFFUSE, SPECULAR, GATED = 1, 2, 4
"""Terms of a lamp, as the C has them."""


@dataclass(frozen=True)
class _Ground:
    """The plane: unit normal on the eye's side, height of the eye above it, the eye's tile and the steps of tiles.

    Of normal and height also what rounding left, for kernels that take them in two words.
    """

    normal: Vector
    normal_low: Vector
    height: float
    height_low: float
    across: Vector
    across_0: float
    along: Vector
    along_0: float


def scene_numbers(frame: Scene, found: Arrangement, channels: int) -> dict[str, Any]:
    """Field name -> number, whole number, or array of float64 or int32."""
    spheres = [frame.spheres[i] for i in found.spheres.tolist()]
    materials: list[Phong] = [*(sphere.material for sphere in spheres), *found.plane_materials]
    eye = frame.camera.eye[2]
    ground = _ground(frame) if frame.plane is not None else None
    centers = [*(sphere.center for sphere in spheres), *([(0.0, 0.0, eye)] * len(found.plane_materials))]
    radii = [sphere.radius for sphere in spheres]
    low_words: list[float] = []
    if ground is not None:
        radii += [ground.height] * len(found.plane_materials)
        low_words = [ground.height_low] * len(found.plane_materials)
    place = np.array(centers, dtype=np.float64).reshape(-1, 3)
    numbers: dict[str, Any] = {
        "eye": eye,
        "spheres": len(spheres),
        "visible": found.visible,
        "receivers": len(materials),
        **{f"center_{axis}": np.ascontiguousarray(place[:, i]) for i, axis in enumerate("xyz")},
        "radius": _reals(radii),
        "radius_low": _reals([0.0] * len(spheres) + low_words),
        "at_eye": _wholes(found.at_eye),
        "partners_begin": _wholes(found.partners_begin),
        "partners": _wholes(found.partners),
        "crosses_plane": _wholes(found.crosses_plane),
        "ambient": _colours([m.ambient for m in materials], channels),
        "diffuse": _colours([m.diffuse for m in materials], channels),
        "specular": _colours([m.specular for m in materials], channels),
        "shininess": _reals([m.shininess for m in materials]),
        "reflect": np.where(found.mirror, _reals([m.reflect for m in materials]), 0.0),
        "bounces": found.bounces,
        "mirrors_begin": _wholes(found.mirrors_begin),
        "mirrors": _wholes(found.mirrors),
        "mirror_plane": _wholes(found.mirror_plane),
        "plane_seen": int(found.plane_seen),
    }
    return numbers | _lights(frame, channels) | _lamps(found) | _background(frame, channels) | _plane(ground)


def _reals(values: list[float]) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)


def _wholes(values: NDArray[Any]) -> NDArray[np.int32]:
    return np.ascontiguousarray(values, dtype=np.int32)


def _colours(values: list[Colour], channels: int) -> NDArray[np.float64]:
    """Channels one after the other; where there is one, a colour is three equal numbers."""
    rows = [value[:channels] if isinstance(value, tuple) else (value,) * channels for value in values]
    return np.array(rows, dtype=np.float64).ravel()


def _lights(frame: Scene, channels: int) -> dict[str, Any]:
    """Places of point lights, and unit vectors towards those in parallel."""
    place: list[Vector] = []
    fades: list[tuple[float, float, float]] = []
    for light in frame.lights:
        if isinstance(light, PointLight):
            place.append(light.position)
            fades.append(light.attenuation)
        else:
            x, y, z = light.direction
            place.append(_unit((-x, -y, -z)))
            fades.append((1.0, 0.0, 0.0))
    at = np.array(place, dtype=np.float64).reshape(-1, 3)
    fade = np.array(fades, dtype=np.float64).reshape(-1, 3)
    return {
        **{f"light_{axis}": np.ascontiguousarray(at[:, i]) for i, axis in enumerate("xyz")},
        "nearness": _reals([float(isinstance(light, PointLight)) for light in frame.lights]),
        "light_intensity": _colours([light.intensity for light in frame.lights], channels),
        **{f"fade_{k}": np.ascontiguousarray(fade[:, i]) for i, k in enumerate("abc")},
    }


def _lamps(found: Arrangement) -> dict[str, Any]:
    terms = DIFFUSE * found.lamp_diffuse + SPECULAR * found.lamp_specular + GATED * found.lamp_gated
    return {
        "lamps_begin": _wholes(found.lamps_begin),
        "lamp_light": _wholes(found.lamp_light),
        "lamp_terms": _wholes(terms),
        "blockers_begin": _wholes(found.blockers_begin),
        "blockers": _wholes(found.blockers),
    }


def _background(frame: Scene, channels: int) -> dict[str, Any]:
    background = frame.background
    if not isinstance(background, Gradient):
        return {"background": _colours([background], channels)}
    up = _unit(background.up)
    return {
        "background": _colours([background.bottom], channels),
        "background_top": _colours([background.top], channels),
        **{f"up_{axis}": up[i] for i, axis in enumerate("xyz")},
    }


def _plane(ground: _Ground | None) -> dict[str, Any]:
    if ground is None:
        return {}
    numbers: dict[str, Any] = {"across_0": ground.across_0, "along_0": ground.along_0}
    for i, axis in enumerate("xyz"):
        numbers |= {
            f"plane_{axis}": ground.normal[i],
            f"plane_{axis}_low": ground.normal_low[i],
            f"across_{axis}": ground.across[i],
            f"along_{axis}": ground.along[i],
        }
    return numbers


def _unit(direction: Vector) -> Vector:
    """A direction of length 1, each coordinate the float64 nearest to the true one."""
    whole = exact.vector_on_grid(direction, exact.grid_of(direction))
    square = exact.dot(whole, whole)
    x, y, z = (exact.nearest_root(coordinate, square, 0) for coordinate in whole)
    return x, y, z


def _ground(frame: Scene) -> _Ground:
    """The plane's numbers, from whole numbers: n to the eye's side, h = n.(E - p) / |n|, tiles in steps of h."""
    plane = frame.plane
    assert plane is not None
    grid = exact.grid_of((*frame.camera.eye, *plane.point))
    offset = exact.difference(exact.vector_on_grid(frame.camera.eye, grid), exact.vector_on_grid(plane.point, grid))
    normal = exact.vector_on_grid(plane.normal, exact.grid_of(plane.normal))
    square = exact.dot(normal, normal)
    height = exact.dot(normal, offset)
    sign = 1 if height > 0 else -1
    x, y, z = (sign * exact.nearest_root(coordinate, square, 0) for coordinate in normal)
    axis = exact.vector_on_grid(plane.axis, exact.grid_of(plane.axis))
    along_normal = exact.dot(axis, normal)
    across = (
        axis[0] * square - normal[0] * along_normal,
        axis[1] * square - normal[1] * along_normal,
        axis[2] * square - normal[2] * along_normal,
    )
    along = exact.cross(normal, across)
    tall = sign * exact.nearest_root(height, square, grid)

    words = [as_triple(sign * coordinate, square, 0) for coordinate in normal]
    a, b, c = ((hi - nearest) + lo for (hi, lo, _), nearest in zip(words, (x, y, z), strict=True))
    low = (a, b, c)
    hi, lo, _ = as_triple(sign * height, square, grid)
    height_low = (hi - tall) + lo

    def tiles(direction: exact.GridVector) -> tuple[Vector, float]:
        length = exact.dot(direction, direction)
        a, b, c = (exact.nearest_root(coordinate, length, 0) * tall / plane.tile for coordinate in direction)
        return (a, b, c), exact.nearest_root(exact.dot(direction, offset), length, grid) / plane.tile

    if plane.checker is None:
        nowhere = 0.0, 0.0, 0.0
        return _Ground((x, y, z), low, tall, height_low, nowhere, 0.0, nowhere, 0.0)
    (across_step, across_0), (along_step, along_0) = tiles(across), tiles(along)
    return _Ground((x, y, z), low, tall, height_low, across_step, across_0, along_step, along_0)


def ground_numbers(frame: Scene) -> dict[str, Any]:
    """What the plane of a scene adds to its numbers: those of the plane itself, and as `radius` and `radius_low` the
    height of the eye above it, of which each of its materials has one entry."""
    ground = _ground(frame)
    return {"radius": ground.height, "radius_low": ground.height_low} | _plane(ground)
