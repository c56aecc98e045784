"""`SceneKernel`: the loaded kernel of a scene of many spheres, and the scene as its C structure.

The one place that knows how arrays of Python become the pointers of C, and that keeps them alive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.build.library import CachedKernel, Library
from symrender_cg.run.kernel import pointer_to
from symrender_cg.run.pool import Pool
from symrender_cg.run.structures import layout, structures

LAYERS = ("depth", "normal", "index", "background", "ambient", "reflected", "diffuse", "specular")
"""What a kernel can write beside the image, in the order of its C structure's fields."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene made ready for an image of one size, or for points: the C's frame and everything it refers to."""

    frame: Any
    keeps: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class PreparedMany:
    """Scenes of one structure made ready for images of one size: the C's frames and everything that they refer to."""

    frames: Any
    keeps: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class SceneKernel:
    """A native kernel of a scene and how to call it.

    name       its C name; the entry points are name_prepare, name_rows, name_points, name_release, and name_batch with
               name_prepare_many and name_release_many
    fields     (name, shape) of its scene structure's fields; shape is number, whole, reals or wholes
    channels   1 or 3
    dtype      float64 or float32
    """

    name: str
    fields: tuple[tuple[str, str], ...]
    channels: int
    dtype: np.dtype[Any]
    cached: CachedKernel
    library: Library

    def prepare(
        self, numbers: Mapping[str, Any], *, width: int = 1, height: int = 1, pixel: float = 1.0, white: float
    ) -> Prepared:
        """The scene's numbers as the C sees them, with what does not change within a frame computed."""
        ffi, lib = self.library.ffi, self.library.lib
        scene = ffi.new(f"{self.name}_scene *")
        keeps: list[Any] = [scene]
        for name, shape in self.fields:
            value = numbers[name]
            if shape in ("reals", "wholes"):
                array = np.ascontiguousarray(value, dtype=np.float64 if shape == "reals" else np.int32)
                keeps.append(array)
                setattr(scene, name, ffi.cast("double *" if shape == "reals" else "int *", array.ctypes.data))
            else:
                setattr(scene, name, value)
        grid = ffi.new("symrender_grid *", (width, height, pixel, white))
        frame = getattr(lib, f"{self.name}_prepare")(scene, grid)
        if frame == ffi.NULL:
            raise MemoryError(f"no memory for the tables of {len(numbers['radius'])} spheres")
        return Prepared(ffi.gc(frame, getattr(lib, f"{self.name}_release")), tuple(keeps))

    def rows(
        self,
        image: NDArray[Any],
        prepared: Prepared,
        *,
        begin: int,
        end: int,
        layers: Mapping[str, NDArray[Any]] | None = None,
        first: int = 0,
    ) -> NDArray[np.intp]:
        """Writes rows [begin, end) of an image whose rows are contiguous; which pixels, row * width + column, rounding
        may have decided. Releases the GIL.

        layers: by names of LAYERS, contiguous arrays of whole images; float64, int32 for `index`.
        first: the row that row 0 of the array is; it may hold a part of the image's rows.
        """
        ffi = self.library.ffi
        pointer = pointer_to(image, f"{self._real} *", self.library, first=first)
        wanted = ffi.NULL
        if layers:
            wanted = ffi.new(f"{self.name}_layers *")
            for name, array in layers.items():
                setattr(wanted, name, ffi.cast("int *" if name == "index" else "double *", array.ctypes.data))
        unsettled = np.empty((end - begin) * image.shape[1], dtype=np.intp)
        found = getattr(self.library.lib, f"{self.name}_rows")(
            pointer,
            image.strides[0] // image.itemsize,
            prepared.frame,
            wanted,
            begin,
            end,
            ffi.cast("ptrdiff_t *", unsettled.ctypes.data),
        )
        if found < 0:
            raise MemoryError(f"no memory for rows {begin} to {end} of the image")
        return unsettled[:found].copy()

    def share_rows(
        self,
        pool: Pool,
        image: NDArray[Any],
        prepared: Prepared,
        begin: int,
        end: int,
        first: int,
        least: int,
        threads: int,
    ) -> NDArray[np.intp]:
        """As `rows` does without layers, on so many threads of the pool, each at least so many rows at a time."""
        pointer = pointer_to(image, f"{self._real} *", self.library, first=first)
        stride, entry = image.strides[0] // image.itemsize, getattr(self.library.lib, f"{self.name}_rows")
        bound = entry, pointer, stride, prepared.frame, self.library.ffi.NULL
        return pool.listing_rows(*bound, begin, end, least, threads, image.shape[1])

    @property
    def structure(self) -> np.dtype[Any]:
        """The scene's structure as numpy sees it."""
        return layout(self.library, f"{self.name}_scene", self.fields)

    def structures(self, scenes: Sequence[Mapping[str, Any]]) -> tuple[NDArray[Any], tuple[Any, ...]]:
        """The numbers of many scenes as the C sees them, and what has to be kept for them."""
        return structures(self.library, f"{self.name}_scene", self.fields, scenes)

    def prepare_many(self, scenes: NDArray[Any], grids: NDArray[Any]) -> PreparedMany:
        """Structures of many scenes, each with its grid (an array of kernel.GRID), as `prepare` has those of one.

        What the structures refer to must be kept.
        """
        ffi, lib = self.library.ffi, self.library.lib
        frames, count = ffi.new(f"{self.name}_frame *[]", len(scenes)), len(scenes)
        made = ffi.from_buffer(f"{self.name}_scene *", scenes)
        given = ffi.from_buffer("symrender_grid *", grids)
        if getattr(lib, f"{self.name}_prepare_many")(frames, made, count, given):
            raise MemoryError(f"no memory for the tables of {count} scenes")
        release = getattr(lib, f"{self.name}_release_many")
        return PreparedMany(ffi.gc(frames, lambda held: release(held, count)), (scenes, grids))

    def onto_many(
        self, images: Sequence[NDArray[Any]], prepared: PreparedMany
    ) -> Callable[[int, int], NDArray[np.intp]]:
        """What writes rows [begin, end) of many images, counted through: row j of image k is number k * height + j; it
        returns the pixels (k * height + row) * width + column that rounding may have decided. Releases the GIL.

        images: arrays of one shape with contiguous rows, equally far apart. They and `prepared` must be kept.
        """
        ffi = self.library.ffi
        height, width = images[0].shape[:2]
        stride = images[0].strides[0] // images[0].itemsize
        pointers = ffi.new(f"{self._real} *[]", [ffi.cast(f"{self._real} *", image.ctypes.data) for image in images])
        entry = getattr(self.library.lib, f"{self.name}_batch")

        def rows(begin: int, end: int) -> NDArray[np.intp]:
            unsettled = np.empty((end - begin) * width, dtype=np.intp)
            listed = ffi.cast("ptrdiff_t *", unsettled.ctypes.data)
            found = entry(pointers, stride, prepared.frames, begin, end, listed)
            if found < 0:
                raise MemoryError(f"no memory for rows {begin} to {end} of {len(images)} images of {height}")
            return unsettled[:found].copy()

        return rows

    def points(
        self, values: NDArray[Any], x: NDArray[np.float64], y: NDArray[np.float64], prepared: Prepared
    ) -> NDArray[np.intp]:
        """Writes the intensities at contiguous points; which of them rounding may have decided. Releases the GIL."""
        ffi = self.library.ffi
        unsettled = np.empty(x.size, dtype=np.intp)
        found = getattr(self.library.lib, f"{self.name}_points")(
            ffi.cast(f"{self._real} *", values.ctypes.data),
            ffi.cast("double *", x.ctypes.data),
            ffi.cast("double *", y.ctypes.data),
            x.size,
            prepared.frame,
            ffi.cast("ptrdiff_t *", unsettled.ctypes.data),
        )
        if found < 0:
            raise MemoryError("no memory for the points")
        return unsettled[:found].copy()

    @property
    def _real(self) -> str:
        return "float" if self.dtype == np.float32 else "double"


def layer_arrays(names: Sequence[str], shape: tuple[int, int], channels: int, lights: int) -> dict[str, NDArray[Any]]:
    """Empty arrays for layers of an image of that shape; terms of a light that adds none stay 0."""
    colour = (*shape, channels)
    shapes: dict[str, tuple[int, ...]] = {
        "depth": shape,
        "normal": (*shape, 3),
        "index": shape,
        "background": colour,
        "ambient": colour,
        "reflected": colour,
        "diffuse": (lights, *colour),
        "specular": (lights, *colour),
    }
    return {name: np.zeros(shapes[name], np.int32 if name == "index" else np.float64) for name in names}
