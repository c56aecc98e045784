"""`Drawing`: a scene bound to its kernel, ready to write rows of its image or values at points.

The two kinds of kernels, of one sphere and of scenes, look the same from here on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.plan.plan import Plan
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.pool import SCENE_PIXELS, Pool, Shared
from symrender_cg.run.scene_kernel import Prepared, SceneKernel
from symrender_cg.run.scene_numbers import scene_numbers
from symrender_cg.run.steep_rows import BoundBox, Steep, SteepRows, bound_box
from symrender_cg.run.threads import over_rows


@dataclass(frozen=True, eq=False)
class Drawing:
    """What it takes to draw one scene on one grid of pixels, or at points.

    plan       what is drawn, and why it is enough
    kernel     the native kernel
    numbers    the scene as the kernel takes it
    pixel      side of a pixel in scene units
    white      intensity above which white is written, inf for the field itself
    decide     (x, y) -> values at points where rounding may have decided, and which of them are known; None: the kernel
               of the level decides nothing by rounding, or promises nothing of it
    width      of the image in pixels, and its height; 1 and 1 for points
    steep      what draws a box of the image in place of the kernel of one sphere, see steep_rows.py
    """

    plan: Plan
    kernel: Kernel | SceneKernel
    numbers: Any
    pixel: float
    white: float
    decide: Decide | None = None
    width: int = 1
    height: int = 1
    steep: Steep | None = None

    @cached_property
    def grid(self) -> Any:
        """The pixels as the kernel of one sphere takes them."""
        assert isinstance(self.kernel, Kernel), "a scene's tables hold its grid"
        return self.kernel.grid(self.width, self.height, self.pixel, self.white)

    @cached_property
    def box(self) -> BoundBox | None:
        """The pixels that `steep` draws; None where there are none."""
        if self.steep is None:
            return None
        return bound_box(self.steep, self.width, self.height, self.pixel, self.white)

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

    def onto(self, image: NDArray[Any], first: int = 0) -> Callable[[int, int], None]:
        """What writes rows [begin, end) of the image into an array with contiguous rows, whose row 0 is row `first`."""
        if isinstance(self.kernel, Kernel):
            rows = self.kernel.onto(image, self.numbers, self.grid, first=first)
            return rows if self.box is None else SteepRows(rows, self.box, image, first)
        return SceneRows(self, image, first)

    def rows(
        self,
        image: NDArray[Any],
        begin: int,
        end: int,
        layers: Mapping[str, NDArray[Any]] | None = None,
        *,
        first: int = 0,
    ) -> None:
        """Writes rows [begin, end) of the image into an array with contiguous rows, whose row 0 is row `first`.

        `layers` only of kernels of scenes, and of the whole image; with layers the image stays as the kernel has it, in
        doubtful pixels too: it is the sum of its terms.
        """
        if isinstance(self.kernel, Kernel):
            self.onto(image, first)(begin, end)
            return
        doubtful = self.kernel.rows(image, self.numbers, begin=begin, end=end, layers=layers, first=first)
        if layers is None:
            self.settle(image, doubtful, first)

    def settle(self, image: NDArray[Any], doubtful: NDArray[np.intp], first: int) -> None:
        """Writes those pixels, row * width + column, that are known without rounding, where the level promises it."""
        if doubtful.size and self.decide is not None:
            row, column = doubtful // self.width, doubtful % self.width
            x = (column + (0.5 - 0.5 * self.width)) * np.float64(self.pixel)
            y = ((0.5 * self.height - 0.5) - row) * np.float64(self.pixel)
            values, known = self.decide(x, y)
            image[row[known] - first, column[known]] = self._narrowed(values[known])

    def points(self, values: NDArray[Any], x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        """Writes the intensities at contiguous points of the image plane."""
        if isinstance(self.kernel, SceneKernel):
            doubtful = self.kernel.points(values, x, y, self.numbers)
            if doubtful.size and self.decide is not None:
                found, known = self.decide(x.reshape(-1)[doubtful], y.reshape(-1)[doubtful])
                flat = values.reshape(x.size, *values.shape[x.ndim :])
                flat[doubtful[known]] = self._narrowed(found[known])
        else:
            self.kernel.points(values, x, y, self.numbers, white=self.white)
            if self.steep is not None and (inside := self.steep.box.holds(x, y).reshape(-1)).any():
                found = self.steep.values(x.reshape(-1)[inside], y.reshape(-1)[inside])
                values.reshape(-1)[inside] = np.minimum(found, self.white)

    def _narrowed(self, values: NDArray[Any]) -> NDArray[Any]:
        """Settled values as the kernel would have written them: in its channels, white at most."""
        cut: NDArray[Any] = np.minimum(values, self.white)
        return cut[:, 0] if self.channels == 1 else cut


class SceneRows(Shared):
    """Rows of a scene's image, which the threads of the pool may draw; what rounding decided is settled after them."""

    __slots__ = ("drawing", "first", "image", "library")
    least_pixels = SCENE_PIXELS

    def __init__(self, drawing: Drawing, image: NDArray[Any], first: int) -> None:
        self.drawing, self.image, self.first = drawing, image, first
        self.library = drawing.kernel.library

    def __call__(self, begin: int, end: int, /) -> None:
        self.drawing.rows(self.image, begin, end, first=self.first)

    def share(self, pool: Pool, begin: int, end: int, least: int, threads: int) -> None:
        """Draws rows [begin, end) on so many threads, at least so many rows at a time."""
        drawing, image, first = self.drawing, self.image, self.first
        assert isinstance(drawing.kernel, SceneKernel), "a kernel of one sphere binds its rows itself"
        doubtful = drawing.kernel.share_rows(pool, image, drawing.numbers, begin, end, first, least, threads)
        if doubtful.size < LEAST_SHARED:
            drawing.settle(image, doubtful, first)
        else:
            over_rows(lambda k, last: drawing.settle(image, doubtful[k:last], first), doubtful.size, threads)


LEAST_SHARED = 256
"""So many points in doubt are some milliseconds of work: enough to wake threads of Python for."""


Decide = Callable[[NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[Any], NDArray[np.bool_]]]


def bind(
    kernel: Kernel | SceneKernel,
    plan: Plan,
    *,
    width: int = 1,
    height: int = 1,
    pixel: float = 1.0,
    white: float,
    decide: Decide | None = None,
    steep: Steep | None = None,
) -> Drawing:
    """A kernel and a plan that it was made for, with the numbers of the plan's scene."""
    if isinstance(kernel, SceneKernel):
        numbers: Any = _prepared(kernel, SamePlan(plan), width, height, pixel, white)
    else:
        numbers = kernel.numbers(numbers_of(plan.scene))
    return Drawing(plan, kernel, numbers, pixel, white, decide, width, height, steep)


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
