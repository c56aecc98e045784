"""`SteepRows`: rows of an image of one sphere, and after them what they have of the box where the highlight is steep.

In: the kernel's own rows, and a box that the kernel of `stable` draws over them. Out: rows, in this thread or on the
pool's. What does not change from call to call is looked up once, in `BoundBox`. Never here: where a box is, or a stage
after the kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.box_pixels import box_pixels
from symrender_cg.run.kernel import GRID
from symrender_cg.run.pool import NativeRows, Pool, Shared
from symrender_cg.run.scratch import scratch
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.steep import Box
from symrender_cg.run.threads import LEAST_TURNS

BOX_PIXELS = 1 << 11
"""The least that a thread takes of a box: some 10 us of work, beside 4 for what it computes once a call."""

Places = NDArray[np.intp]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Steep:
    """A box of the image plane, and what draws it in place of the kernel of `double`.

    kernel   () -> the kernel of `stable` and the scene's numbers
    values   (x, y) -> values at points, unclipped
    settled  (places, width, height) -> values of pixels row * width + column that the kernel leaves open, unclipped
    """

    box: Box
    kernel: Callable[[], tuple[SettlingKernel, Any]]
    values: Callable[[Floats, Floats], NDArray[Any]]
    settled: Callable[[Places, int, int], NDArray[Any]]


class BoundBox:
    """The pixels of a box in images of one size, with all that their kernel takes but the image and rows.

    begin, end   rows of the box
    columns      how many there are
    """

    __slots__ = ("begin", "columns", "end", "entry", "library", "numbers", "pixels", "settled", "size", "view", "white")

    def __init__(self, steep: Steep, pixels: NDArray[Any]) -> None:
        kernel, self.numbers = steep.kernel()
        self.library, self.view = kernel.library, kernel.library.ffi.from_buffer
        self.entry, self.pixels = kernel.box_entry, self.view("symrender_box *", pixels)
        self.begin, self.end = int(pixels["row_begin"][0]), int(pixels["row_end"][0])
        self.columns = int(pixels["column_end"][0] - pixels["column_begin"][0])
        grid = pixels["grid"]
        self.size, self.white = (int(grid["width"][0]), int(grid["height"][0])), float(grid["white"][0])
        self.settled = steep.settled

    def draw(self, rows: NativeRows, image: NDArray[Any], first: int, begin: int, end: int) -> None:
        """Writes what rows [begin, end) have of the box. `rows` draw onto the array, whose row 0 is row `first`."""
        begin, end = max(begin, self.begin), min(end, self.end)
        if begin < end:
            places = scratch((end - begin) * self.columns)
            onto, stride = rows.args[:2]
            found = self.entry(onto, stride, self.pixels, self.numbers, begin, end, self.view("ptrdiff_t *", places))
            if found:
                self.settle(image, first, places[:found].copy())

    def share(
        self, pool: Pool, rows: NativeRows, image: NDArray[Any], first: int, begin: int, end: int, threads: int
    ) -> None:
        """The same on so many threads."""
        low, high = max(begin, self.begin), min(end, self.end)
        if (high - low) * self.columns < LEAST_TURNS * BOX_PIXELS:
            self.draw(rows, image, first, begin, end)
            return
        onto, stride = rows.args[:2]
        least = -(-BOX_PIXELS // self.columns)
        places = pool.listing_rows(
            self.entry, onto, stride, self.pixels, self.numbers, low, high, least, threads, self.columns
        )
        if places.size:
            self.settle(image, first, places)

    def settle(self, image: NDArray[Any], first: int, places: Places) -> None:
        """Writes the pixels that the kernel left open."""
        row, column = np.divmod(places, self.size[0])
        image[row - first, column] = np.minimum(self.settled(places, *self.size), self.white)


def bound_box(steep: Steep, width: int, height: int, pixel: float, white: float) -> BoundBox | None:
    """The box of images of that size; None where it holds no pixel of theirs."""
    pixels = box_pixels(steep.box.edges, np.array([(width, height, pixel, white)], dtype=GRID))
    empty = pixels["column_begin"] >= pixels["column_end"], pixels["row_begin"] >= pixels["row_end"]
    return None if any(empty) else BoundBox(steep, pixels)


class SteepRows(Shared):
    """Rows of one sphere's image, and after them what they have of the box."""

    __slots__ = ("box", "first", "image", "library", "rows")
    least_pixels = NativeRows.least_pixels

    def __init__(self, rows: NativeRows, box: BoundBox, image: NDArray[Any], first: int) -> None:
        self.rows, self.box, self.image, self.first = rows, box, image, first
        self.library = rows.library

    def __call__(self, begin: int, end: int, /) -> None:
        self.rows(begin, end)
        self.box.draw(self.rows, self.image, self.first, begin, end)

    def share(self, pool: Pool, begin: int, end: int, least: int, threads: int) -> None:
        """Draws rows [begin, end) on so many threads, at least so many rows at a time."""
        self.rows.share(pool, begin, end, least, threads)
        self.box.share(pool, self.rows, self.image, self.first, begin, end, threads)

    def folded(self, begin: int, end: int) -> FoldedSteepRows | None:
        """Rows j and height - 1 - j as one, where the kernel's rows are drawn so."""
        rows = self.rows.folded(begin, end)
        return None if rows is None else FoldedSteepRows(rows, self.box, self.image, self.first)


class FoldedSteepRows(SteepRows):
    """The same of rows j and height - 1 - j, begin <= j < end."""

    __slots__ = ()

    def __call__(self, begin: int, end: int, /) -> None:
        height = self.box.size[1]
        self.rows(begin, end)
        for first, last in ((begin, end), (height - end, height - begin)):
            self.box.draw(self.rows, self.image, self.first, first, last)

    def share(self, pool: Pool, begin: int, end: int, least: int, threads: int) -> None:
        """Draws rows [begin, end), and those that they are folded with, on so many threads."""
        height = self.box.size[1]
        self.rows.share(pool, begin, end, least, threads)
        for first, last in ((begin, end), (height - end, height - begin)):
            self.box.share(pool, self.rows, self.image, self.first, first, last, threads)

    def folded(self, begin: int, end: int) -> None:
        """They are."""
