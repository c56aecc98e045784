"""`Kernel`: one loaded kernel, called with numpy arrays. The one place that knows the C signatures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.build.library import CachedKernel, Library
from symrender_cg.errors import LibraryError
from symrender_cg.run.pool import NativeRows

GRID = np.dtype([("width", np.int32), ("height", np.int32), ("pixel", np.float64), ("white", np.float64)])
"""symrender_grid, as the C lays it out."""


def pointer_to(image: NDArray[Any], kind: str, library: Library, *, first: int = 0) -> Any:
    """A pointer to row 0 of the image whose rows from `first` on the array holds, to be written from there on.

    For a contiguous array that begins with row 0 it keeps the memory alive.
    """
    if first == 0 and image.flags.c_contiguous and image.size:
        return library.ffi.from_buffer(kind, image, True)
    return library.ffi.cast(kind, image.ctypes.data - first * image.strides[0])


@dataclass(frozen=True)
class Kernel:
    """A native kernel and how to call it.

    name      its C name; the entry points are name_rows and name_points
    inputs    the scene's numbers in the order of its scene structure; none where they are baked in
    dtype     float64 or float32
    cached    where its library, C and manifest are, and whether they were there already
    """

    name: str
    inputs: tuple[str, ...]
    dtype: np.dtype[Any]
    cached: CachedKernel
    library: Library
    baked: bool

    def numbers(self, values: Mapping[str, float]) -> Any:
        """The scene structure as C sees it, to be reused over calls; nothing for a baked kernel."""
        if self.baked:
            return None
        return self.library.ffi.new("double[]", [values[name] for name in self.inputs])

    def rows(
        self,
        image: NDArray[Any],
        numbers: Any,
        *,
        pixel: float,
        white: float,
        begin: int,
        end: int,
    ) -> None:
        """Writes rows [begin, end) of an image of this kernel's dtype whose rows are contiguous. Releases the GIL."""
        height, width = image.shape
        self.onto(image, numbers, self.grid(width, height, pixel, white))(begin, end)

    def grid(self, width: int, height: int, pixel: float, white: float) -> Any:
        """The grid structure as C sees it, to be reused over calls."""
        return self.library.ffi.new("symrender_grid *", (width, height, pixel, white))

    def onto(self, image: NDArray[Any], numbers: Any, grid: Any, *, first: int = 0) -> NativeRows:
        """The C function that writes rows [begin, end), bound to everything else: a call of it runs no Python.

        first: the row that row 0 of the array is; it may hold a part of the image's rows. The array must be kept.
        """
        entry, kind = self._rows_of
        pointer = pointer_to(image, kind, self.library, first=first)
        stride = image.strides[0] // image.itemsize
        rows = (
            NativeRows(entry, pointer, stride, grid)
            if self.baked
            else NativeRows(entry, pointer, stride, grid, numbers)
        )
        rows.library, rows.pairs = self.library, self._pairs
        return rows

    def onto_many(self, images: NDArray[Any], numbers: NDArray[np.float64], grids: NDArray[Any]) -> Callable[..., None]:
        """The C function that writes rows [begin, end) of many images, counted through: row j of image k is number
        k * height + j.

        images: (count, height, width) with contiguous rows. numbers: (count, inputs). grids: (count,) of GRID. All
        three must be kept.
        """
        ffi, item = self.library.ffi, images.itemsize
        pointer = pointer_to(images, f"{self._real} *", self.library)
        strides = images.strides[0] // item, images.strides[1] // item
        grid, scenes = ffi.from_buffer("symrender_grid *", grids), ffi.from_buffer("double *", numbers)
        rows = NativeRows(self._entry("batch"), pointer, *strides, grid, scenes)
        rows.library, rows.pairs = self.library, None
        return rows

    def points(
        self, values: NDArray[Any], x: NDArray[np.float64], y: NDArray[np.float64], numbers: Any, *, white: float
    ) -> None:
        """Writes the intensities at contiguous points. Releases the GIL."""
        ffi = self.library.ffi
        pointers = [
            ffi.cast(f"{self._real} *", values.ctypes.data),
            ffi.cast("double *", x.ctypes.data),
            ffi.cast("double *", y.ctypes.data),
        ]
        arguments = (*pointers, values.size, white)
        self._entry("points")(*(arguments if self.baked else (*arguments, numbers)))

    def __getstate__(self) -> dict[str, Any]:
        """Without what another process finds for itself."""
        return {name: value for name, value in self.__dict__.items() if name not in ("_rows_of", "_pairs")}

    @cached_property
    def _rows_of(self) -> tuple[Any, str]:
        """The entry point for rows, and the pointer that it takes."""
        return self._entry("rows"), f"{self._real} *"

    @cached_property
    def _pairs(self) -> Any:
        """The entry point for rows at y and -y together, None where they share nothing."""
        return getattr(self.library.lib, f"{self.name}_row_pairs", None)

    @property
    def _real(self) -> str:
        return "float" if self.dtype == np.float32 else "double"

    def _entry(self, suffix: str) -> Any:
        try:
            return getattr(self.library.lib, f"{self.name}_{suffix}")
        except AttributeError as problem:
            raise LibraryError(
                f"{self.library.path} has no entry point {self.name}_{suffix}; "
                "remove that folder of the cache and try again"
            ) from problem


def rows_are_contiguous(image: NDArray[Any], channels: int = 1) -> bool:
    """Whether a kernel can write to an image, or to many: contiguous rows, whole numbers of values apart, aligned."""
    item, strides = image.itemsize, image.strides
    steps = (item,) if channels == 1 else (item * channels, item)
    if strides[-len(steps) :] != steps or not image.flags.aligned:
        return False
    return strides[0] % item == 0 and strides[1] % item == 0
