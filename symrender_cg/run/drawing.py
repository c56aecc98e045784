"""`Drawing`: a scene bound to its kernel, ready to write rows of its image or values at points.

The two kinds of kernels, of one sphere and of scenes, look the same from here on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.plan.plan import Plan
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.scene_kernel import Prepared, SceneKernel
from symrender_cg.run.scene_numbers import scene_numbers


@dataclass(frozen=True, eq=False)
class Drawing:
    """What it takes to draw one scene on one grid of pixels, or at points.

    plan       what is drawn, and why it is enough
    kernel     the native kernel
    numbers    the scene as the kernel takes it
    pixel      side of a pixel in scene units
    white      intensity above which white is written, inf for the field itself
    """

    plan: Plan
    kernel: Kernel | SceneKernel
    numbers: Any
    pixel: float
    white: float

    @property
    def dtype(self) -> np.dtype[Any]:
        """float64 or float32."""
        return self.kernel.dtype

    @property
    def channels(self) -> int:
        """1, or 3 for the kernel of a scene with colours."""
        return self.kernel.channels if isinstance(self.kernel, SceneKernel) else 1

    def shape(self, *points: int) -> tuple[int, ...]:
        """The shape of an array of intensities: that of the points, and the channels where there are three."""
        return points if self.channels == 1 else (*points, self.channels)

    def rows(self, image: NDArray[Any], begin: int, end: int, layers: Mapping[str, NDArray[Any]] | None = None) -> None:
        """Writes rows [begin, end) of an image with contiguous rows; `layers` only of kernels of scenes."""
        if isinstance(self.kernel, SceneKernel):
            self.kernel.rows(image, self.numbers, begin=begin, end=end, layers=layers)
        else:
            self.kernel.rows(image, self.numbers, pixel=self.pixel, white=self.white, begin=begin, end=end)

    def points(self, values: NDArray[Any], x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        """Writes the intensities at contiguous points of the image plane."""
        if isinstance(self.kernel, SceneKernel):
            self.kernel.points(values, x, y, self.numbers)
        else:
            self.kernel.points(values, x, y, self.numbers, white=self.white)


def bind(
    kernel: Kernel | SceneKernel, plan: Plan, *, width: int = 1, height: int = 1, pixel: float = 1.0, white: float
) -> Drawing:
    """A kernel and a plan that it was made for, with the numbers of the plan's scene."""
    if isinstance(kernel, SceneKernel):
        numbers: Any = _prepared(kernel, SamePlan(plan), width, height, pixel, white)
    else:
        numbers = kernel.numbers(numbers_of(plan.scene))
    return Drawing(plan, kernel, numbers, pixel, white)


class SamePlan:
    """A plan as the key of a cache: equal to itself alone, so that no scene is compared with another."""

    __slots__ = ("plan",)

    def __init__(self, plan: Plan) -> None:
        self.plan = plan

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SamePlan) and other.plan is self.plan

    def __hash__(self) -> int:
        return id(self.plan)


@lru_cache(maxsize=8)
def _prepared(kernel: SceneKernel, same: SamePlan, width: int, height: int, pixel: float, white: float) -> Prepared:
    """The tables of a scene, remembered: a scene is drawn more than once, and threads may share them."""
    return kernel.prepare(_numbers(same, kernel.channels), width=width, height=height, pixel=pixel, white=white)


@lru_cache(maxsize=8)
def _numbers(same: SamePlan, channels: int) -> dict[str, Any]:
    found = same.plan.arrangement
    assert found is not None, "a kernel of scenes is for plans with an arrangement"
    return scene_numbers(same.plan.scene, found, channels)
