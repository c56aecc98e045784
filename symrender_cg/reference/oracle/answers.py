"""What the oracle answers with. Never done here: a computation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from symrender_cg.reference.points import FloatArray


@dataclass(frozen=True, slots=True)
class Answers:
    """Correctly rounded intensities; `points` is the broadcast shape of x and y, `channels` () or (3,) for colour.

    value: float64 nearest to the true value, unclipped; residual: float64 nearest to true - value; value32: float32
    nearest to the true value; ties of these go to even. value8: uint8, floor(255 clip(true, 0, 1) + 1/2).
    Each has shape points + channels.
    index: points, int64: which of scene.spheres is seen, len(scene.spheres) for the plane, -1 for neither.
    """

    value: FloatArray
    residual: FloatArray
    value32: npt.NDArray[np.float32]
    value8: npt.NDArray[np.uint8]
    index: npt.NDArray[np.int64]

    @property
    def hit(self) -> npt.NDArray[np.bool_]:
        """Whether anything is seen but background; shape points."""
        return np.asarray(self.index >= 0)

    def at(self, places: Any) -> Answers:
        """The answers at some of the points: whatever numpy takes as an index of the leading axes."""
        return Answers(
            self.value[places], self.residual[places], self.value32[places], self.value8[places], self.index[places]
        )


@dataclass(frozen=True, slots=True)
class Enclosures:
    """Balls that contain the true values: arrays of fractions.Fraction (dtype object), shape points + channels.

    |true - middle| <= radius, a proved bound; radius is 0 where the value is known exactly.
    """

    middle: npt.NDArray[np.object_]
    radius: npt.NDArray[np.object_]
