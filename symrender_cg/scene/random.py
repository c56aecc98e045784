"""Scenes of many random disjoint spheres: the same count and seed give the same scene on every machine.

Comes in: how many, and a seed. Goes out: a Scene in the camera's frame whose spheres fill the view. Never done here: a
search over all pairs; each new sphere is compared with those of the 27 cells around it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from random import Random
from typing import Final

from symrender_cg.scene import values
from symrender_cg.scene.camera import Camera
from symrender_cg.scene.exact import Vector
from symrender_cg.scene.lights import PointLight
from symrender_cg.scene.materials import Phong
from symrender_cg.scene.model import Scene
from symrender_cg.scene.surfaces import Sphere

MOST_SPHERES: Final = 1_000_000

_LARGEST_RADIUS: Final = 0.8
"""Radius of the largest sphere in units of count^(-1/3): about an eighth of the box is filled, far from jamming."""

_GAP: Final = 0.02
"""Least distance between two spheres, in the same unit."""

_DIGITS: Final = 6
"""Decimals of every coordinate and radius, so that a file of such a scene is readable; 2e-6 is well below any gap."""

_PATIENCE: Final = 50
"""Places that are tried in vain before a sphere is made smaller: a few spheres can leave no room for one more."""

_AROUND: Final = tuple(product((-1, 0, 1), repeat=3))


def random_spheres(count: int, seed: int = 0, *, shadows: bool = True) -> Scene:
    """A scene of `count` disjoint spheres with centres in the cube [-1, 1]^3, seen from (0, 0, 4), half-height 1.

    Radii are 0.4 to 0.8 times count^(-1/3), the gap between two spheres at least 0.02 times that. One grey material
    with gated highlights, one point light at (5, 5, 10), black background. 0 <= count <= 1,000,000.
    """
    count = values.whole("count", count, "a number of spheres", MOST_SPHERES)
    material = Phong(gate_specular=True)
    spheres = tuple(Sphere(center, radius, material) for center, radius in _disjoint(count, Random(seed)))
    return Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), spheres, (PointLight(),), shadows=shadows)


def _disjoint(count: int, random: Random) -> Iterator[tuple[Vector, float]]:
    """(centre, radius) of `count` balls no two of which are nearer than the gap."""
    unit = max(count, 1) ** (-1.0 / 3.0)
    gap = _GAP * unit
    edge = 2.0 * _LARGEST_RADIUS * unit + gap
    cells: dict[tuple[int, int, int], list[tuple[float, float, float, float]]] = {}
    for _ in range(count):
        largest, failures = _LARGEST_RADIUS * unit, 0
        while True:
            x, y, z = (round(random.uniform(-1.0, 1.0), _DIGITS) for _ in range(3))
            radius = round(largest * random.uniform(0.5, 1.0), _DIGITS)
            i, j, k = int(x // edge), int(y // edge), int(z // edge)
            if all(
                (x - a) * (x - a) + (y - b) * (y - b) + (z - c) * (z - c) >= (radius + r + gap) ** 2
                for di, dj, dk in _AROUND
                for a, b, c, r in cells.get((i + di, j + dj, k + dk), ())
            ):
                break
            failures += 1
            if failures % _PATIENCE == 0:
                largest *= 0.875
        cells.setdefault((i, j, k), []).append((x, y, z, radius))
        yield (x, y, z), radius
