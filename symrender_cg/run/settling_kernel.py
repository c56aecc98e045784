"""`SettlingKernel`: a kernel of one sphere that bounds its own error, and says what that does not settle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.build.library import Library
from symrender_cg.run.kernel import Kernel, pointer_to
from symrender_cg.run.pool import SETTLED_PIXELS, Pool, Shared
from symrender_cg.run.scratch import scratch


class SettlingRows(Shared):
    """Rows of an image that a kernel settles; what it leaves over is collected in `left_over`, places of the image.

    arguments   the image, its stride, the grid and the scene, as C takes them; the image must be kept
    width       pixels of what counts as a row
    pairs       the entry point that settles rows j and height - 1 - j for begin <= j < end, or None
    """

    __slots__ = ("arguments", "entry", "left_over", "library", "pairs", "width")
    least_pixels = SETTLED_PIXELS

    def __init__(
        self, library: Library, entry: Any, arguments: tuple[Any, Any, Any, Any], width: int, pairs: Any = None
    ) -> None:
        self.library, self.entry, self.arguments, self.width, self.pairs = library, entry, arguments, width, pairs
        self.left_over: list[NDArray[np.intp]] = []

    def __call__(self, begin: int, end: int, /) -> None:
        places = scratch((end - begin) * self.width)
        found = self.entry(*self.arguments, begin, end, self.library.ffi.from_buffer("ptrdiff_t *", places))
        self.left_over.append(places[:found].copy())

    def share(self, pool: Pool, begin: int, end: int, least: int, threads: int) -> None:
        """Settles rows [begin, end) on so many threads, at least so many rows at a time."""
        folded = self.folded(begin, end)
        if folded is not None:
            folded.share(pool, 0, end - end // 2, -(-least // 2), threads)
            return
        self.left_over.append(pool.listing_rows(self.entry, *self.arguments, begin, end, least, threads, self.width))

    def folded(self, begin: int, end: int) -> SettlingRows | None:
        """Rows j and height - 1 - j as one, where rows [begin, end) are the whole image and the kernel has them; what
        is left over goes to the same list."""
        if self.pairs is None or begin != 0 or end != self.arguments[2].height:
            return None
        rows = SettlingRows(self.library, self.pairs, self.arguments, 2 * self.width)
        rows.left_over = self.left_over
        return rows


@dataclass(frozen=True, eq=False)
class SettlingKernel(Kernel):
    """A `Kernel` whose entry points return the places of what they could not settle."""

    def settle_rows(
        self,
        image: NDArray[Any],
        numbers: Any,
        *,
        pixel: float,
        white: float,
        begin: int,
        end: int,
        first: int = 0,
        height: int | None = None,
    ) -> NDArray[np.intp]:
        """Writes rows [begin, end) of an image with contiguous rows; the numbers row * width + column of the pixels of
        them that are not settled. Releases the GIL.

        The array may hold a part of an image of that height, from row `first` on.
        """
        ffi = self.library.ffi
        held, width = image.shape
        left_over = scratch((end - begin) * width)
        found = self._entry("rows")(
            pointer_to(image, f"{self._real} *", self.library, first=first),
            image.strides[0] // image.itemsize,
            self.grid(width, held if height is None else height, pixel, white),
            numbers,
            begin,
            end,
            ffi.cast("ptrdiff_t *", left_over.ctypes.data),
        )
        return left_over[:found].copy()

    def shared_rows(
        self, image: NDArray[Any], numbers: Any, *, pixel: float, white: float, first: int, height: int
    ) -> SettlingRows:
        """As `settle_rows`, of an image of that height whose rows from `first` on the array holds; the threads of the
        pool may draw them."""
        grid = self.grid(image.shape[1], height, pixel, white)
        entry, kind = self._rows_of
        bound = pointer_to(image, kind, self.library, first=first), image.strides[0] // image.itemsize
        return SettlingRows(self.library, entry, (*bound, grid, numbers), image.shape[1], self._pairs)

    @property
    def box_entry(self) -> Any:
        """The C function (image, stride, box, scene, begin, end, places) -> how many pixels are left over."""
        return self._entry("box")

    def settle_many(
        self, images: NDArray[Any], numbers: NDArray[np.float64], grids: NDArray[Any]
    ) -> Callable[[int, int], NDArray[np.intp]]:
        """What writes rows [begin, end) of many images, counted through, as `onto_many` does; it returns the pixels
        (k * height + row) * width + column that are not settled. Releases the GIL. All three arrays must be kept.
        """
        return self._listing_many("batch", "symrender_grid *", images, numbers, grids)

    def settle_boxes(
        self, images: NDArray[Any], numbers: NDArray[np.float64], boxes: NDArray[Any]
    ) -> Callable[[int, int], NDArray[np.intp]]:
        """The same of a box of each image; boxes: (count,) of symrender_cg.run.box_pixels.BOX."""
        return self._listing_many("boxes", "symrender_box *", images, numbers, boxes)

    def _listing_many(
        self, entry: str, kind: str, images: NDArray[Any], numbers: NDArray[np.float64], which: NDArray[Any]
    ) -> Callable[[int, int], NDArray[np.intp]]:
        function, buffer, width = self._entry(entry), self.library.ffi.from_buffer, images.shape[2]
        pointer = pointer_to(images, f"{self._real} *", self.library)
        strides = images.strides[0] // images.itemsize, images.strides[1] // images.itemsize
        arguments = (pointer, *strides, buffer(kind, which), buffer("double *", numbers))

        def rows(begin: int, end: int) -> NDArray[np.intp]:
            places = scratch((end - begin) * width)
            found = function(*arguments, begin, end, buffer("ptrdiff_t *", places))
            return places[:found].copy()

        return rows

    def settle_points(
        self, values: NDArray[Any], x: NDArray[np.float64], y: NDArray[np.float64], numbers: Any, *, white: float
    ) -> NDArray[np.intp]:
        """Writes the values at contiguous points; the indices of those that are not settled. Releases the GIL."""
        ffi = self.library.ffi
        left_over = scratch(values.size)
        found = self._entry("points")(
            ffi.cast(f"{self._real} *", values.ctypes.data),
            ffi.cast("double *", x.ctypes.data),
            ffi.cast("double *", y.ctypes.data),
            values.size,
            white,
            numbers,
            ffi.cast("ptrdiff_t *", left_over.ctypes.data),
        )
        return left_over[:found].copy()

    def enclose(self, x: NDArray[np.float64], y: NDArray[np.float64], numbers: Any) -> tuple[NDArray[np.float64], ...]:
        """(hi, lo, error) at contiguous points: |true value - (hi + lo)| <= error, inf if nothing is known."""
        ffi = self.library.ffi
        found = tuple(np.empty(x.shape) for _ in range(3))
        pointers = [ffi.cast("double *", a.ctypes.data) for a in (*found, x, y)]
        self._entry("enclose")(*pointers, x.size, numbers)
        return found

    def bound(self, numbers: Any, *, width: int, height: int, pixel: float) -> float:
        """How far the kernel's own value of any pixel that it settles can be from the true one."""
        grid = self.library.ffi.new("symrender_grid *", (width, height, pixel, 1.0))
        return float(self._entry("bound")(grid, numbers))

    @property
    def _real(self) -> str:
        return {"float64": "double", "float32": "float", "uint8": "unsigned char"}[self.dtype.name]
