"""The true values that everything here is measured against, from the oracle.

Comes in: a scene of any kind and points. Goes out: Truth, correctly rounded. Never done here: a digit of our own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from symrender_cg.reference import oracle
from symrender_cg.scene import Scene


@dataclass(frozen=True, slots=True)
class Truth:
    """Of n points in c channels: value, residual (true - value), value32, value8: (n, c); hit: (n,)."""

    value: npt.NDArray[np.float64]
    residual: npt.NDArray[np.float64]
    value32: npt.NDArray[np.float32]
    value8: npt.NDArray[np.uint8]
    hit: npt.NDArray[np.bool_]


def truth(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> Truth:
    """The true values at points (x, y), flat. Raises AccuracyError where the oracle leaves one open."""
    found = oracle.evaluate(scene, x, y)
    hit = np.ravel(found.hit)
    shape = (hit.size, -1)
    return Truth(
        found.value.reshape(shape),
        found.residual.reshape(shape),
        found.value32.reshape(shape),
        found.value8.reshape(shape),
        hit,
    )


def true_value(scene: Scene, x: float, y: float) -> float:
    """The value of the first channel at one point."""
    return float(truth(scene, x, y).value[0, 0])


def first_surface(scene: Scene, x: float, y: float) -> int:
    """Which sphere is seen at one point, len(spheres) for the plane, -1 for neither."""
    return int(oracle.index(scene, x, y))
