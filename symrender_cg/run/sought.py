"""Where values are sought: `Pixels` of an image, or `Points` of the image plane.

In: rows of an image, or coordinates. Out: places in an order, their coordinates and names, and what a first stage
leaves over of them. Never done here: a later stage.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.certificate import Job
from symrender_cg.run.grid import pixels_at
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.threads import over_rows, thread_count

Floats = NDArray[np.float64]
Places = NDArray[np.intp]


class Sought(Protocol):
    """The points whose values are sought, in an order; aspect: of the window that they are in, None for any points."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def aspect(self) -> float | None: ...

    def at(self, places: Places) -> tuple[Floats, Floats]: ...

    def name(self, place: int) -> str: ...

    def settle(self, job: Job, kernel: SettlingKernel, numbers: Any) -> tuple[NDArray[Any], Places, float]: ...


@dataclass(frozen=True, eq=False)
class Pixels:
    """Rows of an image of that height, from row `first` on; all of them, or some."""

    shape: tuple[int, int]
    pixel: float
    height: int
    first: int = 0

    @property
    def aspect(self) -> float:
        return self.shape[1] / self.height

    def at(self, places: Places) -> tuple[Floats, Floats]:
        row, column = np.divmod(places, self.shape[1])
        return pixels_at(column, row + self.first, self.shape[1], self.height, self.pixel)

    def name(self, place: int) -> str:
        return f"column {place % self.shape[1]}, row {self.first + place // self.shape[1]}"

    def settle(self, job: Job, kernel: SettlingKernel, numbers: Any) -> tuple[NDArray[Any], Places, float]:
        """The rows, the pixels of them that are left over, and the kernel's bound."""
        image = np.empty(self.shape, dtype=kernel.dtype)
        left_over = self.onto(image, job, kernel, numbers, job.threads)
        bound = kernel.bound(numbers, width=self.shape[1], height=self.height, pixel=self.pixel)
        return image, left_over, bound

    def onto(self, image: NDArray[Any], job: Job, kernel: SettlingKernel, numbers: Any, threads: int | None) -> Places:
        """Writes the rows by the kernel; the pixels of them that are left over."""
        count, width = self.shape
        first, height = self.first, self.height
        rows = kernel.shared_rows(image, numbers, pixel=self.pixel, white=job.white, first=first, height=height)
        over_rows(rows, count, thread_count(threads, width * count), width=width, first=first)
        found = rows.left_over
        places = found[0] if len(found) == 1 else np.concatenate(found)
        return np.sort(places) - first * width if places.size else places


@dataclass(frozen=True, eq=False)
class Points:
    """Points of the image plane; x and y one after the other, `shape` that of what they were given as."""

    shape: tuple[int, ...]
    x: Floats
    y: Floats
    aspect: float | None = None

    def at(self, places: Places) -> tuple[Floats, Floats]:
        return self.x[places], self.y[places]

    def name(self, place: int) -> str:
        return f"({float(self.x[place])!r}, {float(self.y[place])!r})"

    def settle(self, job: Job, kernel: SettlingKernel, numbers: Any) -> tuple[NDArray[Any], Places, float]:
        """The values, the points that are left over, and a bound for the square that holds all points."""
        values = np.empty(self.x.size, dtype=kernel.dtype)
        left_over = kernel.settle_points(values, self.x, self.y, numbers, white=job.white)
        side = 2.0 * float(max(np.abs(self.x).max(), np.abs(self.y).max())) if values.size else 0.0
        return values, left_over, kernel.bound(numbers, width=1, height=1, pixel=side)
