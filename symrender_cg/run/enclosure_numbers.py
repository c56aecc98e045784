"""The numbers of a scene that no float64 holds, for its enclosure: unit vectors, heights, steps of tiles.

Comes in: a scene in the camera's frame. Goes out: each number as hi, lo, error with |number - (hi + lo)| <= error; and,
of directions and of the plane's normal, the coordinates as they are given. Never done here: a root in floating point.
"""

from __future__ import annotations

from math import frexp, isqrt, ldexp
from typing import Any, Final

import numpy as np
from msgspec import structs

from symrender_cg.plan.bounds import FARTHEST
from symrender_cg.scene import DirectionalLight, Gradient, PointLight, Scene, exact
from symrender_cg.scene.exact import GridVector

Triple = tuple[float, float, float]
"""hi, lo, error"""

_BITS: Final = 192
"""Bits of a square root before it becomes two doubles."""


def exact_numbers(frame: Scene, *, nearer: bool = False) -> dict[str, Any]:
    """The fields of an enclosure's scene structure that differ from those of the scene's kernel, by name."""
    numbers: dict[str, Any] = {"nearer": np.full(len(frame.lights), float(nearer))}
    if any(isinstance(light, DirectionalLight) for light in frame.lights):
        place = [
            tuple(-c for c in light.direction) if isinstance(light, DirectionalLight) else light.position
            for light in frame.lights
        ]
        at = np.array(place, dtype=np.float64)
        numbers |= {f"light_{axis}": np.ascontiguousarray(at[:, i]) for i, axis in enumerate("xyz")}
    if frame.plane is not None:
        numbers |= _ground(frame)
    if isinstance(frame.background, Gradient):
        up = exact.vector_on_grid(frame.background.up, exact.grid_of(frame.background.up))
        numbers["upward"] = [number for c in up for number in as_triple(c, exact.dot(up, up), 0)]
    return numbers


def _ground(frame: Scene) -> dict[str, Any]:
    """The plane's normal as given, and its numbers as hi, lo, error; p = (P - E) / h, a tile's number floor(u.p + u_0).

    u = (axis / |axis|) h / tile, u_0 = axis.(E - point) / (|axis| tile).
    """
    plane = frame.plane
    assert plane is not None
    grid = exact.grid_of((*frame.camera.eye, *plane.point))
    offset = exact.difference(exact.vector_on_grid(frame.camera.eye, grid), exact.vector_on_grid(plane.point, grid))
    given = exact.vector_on_grid(plane.normal, exact.grid_of(plane.normal))
    sign = 1 if exact.dot(given, offset) > 0 else -1
    normal: GridVector = (sign * given[0], sign * given[1], sign * given[2])
    square = exact.dot(normal, normal)
    height = exact.dot(normal, offset)
    axis = exact.vector_on_grid(plane.axis, exact.grid_of(plane.axis))
    along_normal = exact.dot(axis, given)
    across: GridVector = (
        axis[0] * square - given[0] * along_normal,
        axis[1] * square - given[1] * along_normal,
        axis[2] * square - given[2] * along_normal,
    )
    along = exact.cross(given, across)
    tile_grid = exact.grid_of((plane.tile,))
    tile = exact.on_grid(plane.tile, tile_grid)
    ground = [as_triple(c, square, 0) for c in normal] + [as_triple(height, square, grid)]
    tiles = []
    for direction in (across, along) if plane.checker is not None else ():
        length = exact.dot(direction, direction) * tile * tile
        tiles += [as_triple(c * height, length * square, grid - tile_grid) for c in direction]
        tiles.append(as_triple(exact.dot(direction, offset), length, grid - tile_grid))
    return {
        "ground": [number for triple in ground for number in triple],
        "tiles": [number for triple in tiles for number in triple],
        **{f"plane_{axis}": sign * plane.normal[i] for i, axis in enumerate("xyz")},
    }


def brought_nearer(frame: Scene) -> Scene | None:
    """The camera-frame scene of one sphere and one point light with that light at s L instead of L, s a power of two.

    None where the light is near enough to be planned as it is. From s L the direction is known as well as |P| / |s L|
    of the points P that are seen, for |s L| about 2^199 times the distance of the eye; the kernel counts that.
    """
    light, eye = frame.lights[0], frame.camera.eye[2]
    assert isinstance(light, PointLight), "what is left of a scene is one sphere and one point light"
    farthest = max(abs(c) for c in light.position)
    if farthest <= FARTHEST * eye:
        return None
    less = frexp(eye)[1] + 199 - frexp(farthest)[1]
    x, y, z = (ldexp(c, less) for c in light.position)
    return structs.replace(frame, lights=(structs.replace(light, position=(x, y, z)),))


def as_triple(numerator: int, radicand: int, grid: int) -> Triple:
    """hi, lo, error of (numerator / sqrt(radicand)) 2^grid, radicand > 0: error <= 2^-104 |hi| + 2^-1000.

    The root is cut off after 192 bits; lo is the float64 nearest to what hi leaves of that.
    """
    square = numerator * numerator
    shift = max(0, _BITS + 1 + (radicand.bit_length() - square.bit_length()) // 2)
    root = isqrt((square << 2 * shift) // radicand)
    root, grid = (root if numerator > 0 else -root), grid - shift
    hi = exact.nearest_ratio(root, 1, grid)
    fine = min(grid, exact.grid_of((hi,))) if hi else grid
    rest = (root << (grid - fine)) - exact.on_grid(hi, fine)
    lo = exact.nearest_ratio(rest, 1, fine)
    return hi, lo, 0.0 if not numerator else abs(hi) * 2.0**-104 + 2.0**-1000
