"""`SettlingKernel`: a kernel of one sphere that bounds its own error, and says what that does not settle."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.kernel import Kernel, pointer_to

_KEPT = 1 << 20
"""Places that a thread keeps memory for: fresh memory costs more than a kernel's work on it."""

_of_thread = threading.local()


def _scratch(size: int) -> NDArray[np.intp]:
    """Memory for as many places, to be copied from before the thread asks again."""
    if size > _KEPT:
        return np.empty(size, dtype=np.intp)
    kept: NDArray[np.intp] | None = getattr(_of_thread, "places", None)
    if kept is None or kept.size < size:
        kept = _of_thread.places = np.empty(size, dtype=np.intp)
    return kept[:size]


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
        left_over = _scratch((end - begin) * width)
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

    def settle_points(
        self, values: NDArray[Any], x: NDArray[np.float64], y: NDArray[np.float64], numbers: Any, *, white: float
    ) -> NDArray[np.intp]:
        """Writes the values at contiguous points; the indices of those that are not settled. Releases the GIL."""
        ffi = self.library.ffi
        left_over = _scratch(values.size)
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
