"""`Kernel`: one loaded kernel, called with numpy arrays. The one place that knows the C signatures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.build.library import CachedKernel, Library
from symrender_cg.errors import LibraryError


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
        ffi = self.library.ffi
        height, width = image.shape
        grid = ffi.new("symrender_grid *", (width, height, pixel, white))
        pointer = ffi.cast(f"{self._real} *", image.ctypes.data)
        stride = image.strides[0] // image.itemsize
        arguments = (pointer, stride, grid) if self.baked else (pointer, stride, grid, numbers)
        self._entry("rows")(*arguments, begin, end)

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
