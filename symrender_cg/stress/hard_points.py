"""The hard points of a scene of one's own: where its image turns on the last place of a number.

Comes in: a Scene of any kind, how many points, a seed. Goes out: sets of points of its image plane. Never done here: an
evaluation of a kernel.

    image         anywhere in the window, which is square
    outlines      of each sphere: the two floats beside disc = 0 in a row, within 6 floats, 1e-15 to 1e-3 off
    terminators   of each sphere under each point light: n.l = 0, to 1e-17 radians
    highlights    of the same: r.v = 1, and the flanks
    edges         what is seen, what is mirrored, what is lit changes: halved up to 45 times from pixel to pixel
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from msgspec import structs

from symrender_cg.reference import hard_places, points
from symrender_cg.reference.check_scene import edge_points
from symrender_cg.scene import Phong, PointLight, Scene

Search: TypeAlias = Callable[[Scene, int, int], points.Points]
MOST_PAIRS: Final = 24
"""Of more pairs of sphere and light than these every k-th is looked at."""


@dataclass(frozen=True, slots=True)
class HardPoints:
    """A set of points, and what they lie near to."""

    name: str
    points: list[tuple[float, float]]


def hard_points(frame: Scene, count: int, seed: int) -> tuple[HardPoints, ...]:
    """Up to `count` points a set of a scene in its camera's frame; a set without points is left out."""
    half_height = frame.camera.half_height
    assert half_height is not None, "a scene in the camera's frame has a half_height"
    x, y = np.random.default_rng(seed).uniform(-half_height, half_height, (2, count))
    pairs = _every_kth(list(_pairs(frame)))
    spheres = _every_kth(list({id(pair.spheres[0]): pair for pair in pairs}.values()))
    sets = [HardPoints("image", list(zip(x.tolist(), y.tolist(), strict=True)))]
    sets.append(HardPoints("outlines", _pooled(hard_places.near_silhouette, spheres, count, seed)))
    sets.append(HardPoints("terminators", _pooled(hard_places.near_terminator, pairs, count, seed)))
    sets.append(HardPoints("highlights", _pooled(hard_places.near_highlight, pairs, count, seed)))
    for edge in edge_points(frame, 1.0, count, seed):
        found = list(zip(edge.x.tolist(), edge.y.tolist(), strict=True))
        sets.append(HardPoints(edge.where.replace("near ", "edges: "), found))
    return tuple(entry for entry in sets if entry.points)


def _pairs(frame: Scene) -> Iterator[Scene]:
    """For each sphere and point light (or none) the scene of these two alone, grey."""
    lights = [light for light in frame.lights if isinstance(light, PointLight)] or [PointLight()]
    for sphere in frame.spheres:
        material = Phong(shininess=sphere.material.shininess, gate_specular=sphere.material.gate_specular)
        bare = structs.replace(sphere, material=material)
        for light in lights:
            yield Scene(frame.camera, (bare,), (PointLight(light.position),))


def _every_kth(scenes: list[Scene]) -> list[Scene]:
    return scenes[:: -(-len(scenes) // MOST_PAIRS)] if scenes else []


def _pooled(search: Search, scenes: list[Scene], count: int, seed: int) -> list[tuple[float, float]]:
    """About `count` points of all the scenes together."""
    found: list[tuple[float, float]] = []
    share = -(-count // len(scenes)) if scenes else 0
    for number, scene in enumerate(scenes):
        x, y = search(scene, share, seed + number)
        found += zip(x.tolist(), y.tolist(), strict=True)
    return found[:count]
