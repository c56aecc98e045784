"""Points on a scene's image plane: a caller's, checked, and the pixel centres of an image.

Comes in: coordinates, or a Scene with one sphere and one light and a size. Goes out: arrays of float64 points (x, y) on
the plane z = 0. Never done here: shading. Points where an image is hard to get right are found by hard_places.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import ArgumentError
from symrender_cg.reference.camera_numbers import frame_numbers
from symrender_cg.scene import Scene

FloatArray: TypeAlias = npt.NDArray[np.float64]
Points: TypeAlias = tuple[FloatArray, FloatArray]


def as_points(x: npt.ArrayLike, y: npt.ArrayLike) -> Points:
    """x and y as float64 arrays that broadcast against each other. Raises ArgumentError where they are no points."""
    columns: npt.NDArray[Any] = np.asarray(x)
    rows: npt.NDArray[Any] = np.asarray(y)
    for name, values in (("x", columns), ("y", rows)):
        if values.dtype.kind not in "fiu":
            raise ArgumentError(f"{name}: dtype {values.dtype}; expected real numbers; pass an array of float64")
        if not np.isfinite(values).all():
            raise ArgumentError(f"{name}: holds NaN or infinity; expected finite coordinates on the image plane")
    try:
        np.broadcast_shapes(columns.shape, rows.shape)
    except ValueError:
        raise ArgumentError(
            f"x and y: shapes {columns.shape} and {rows.shape} do not broadcast; expected one y for each x; reshape one"
        ) from None
    return columns.astype(np.float64, copy=False), rows.astype(np.float64, copy=False)


def pixel_centres(scene: Scene, width: int, height: int) -> Points:
    """x_i = (i + 1/2 - width/2) p and y_j = (height/2 - j - 1/2) p with p = 2 half_height / height.

    Shapes (width,) and (height,); row 0 at the top. The brackets are exact, so the centres mirror exactly.
    Raises ArgumentError for an image without pixels.
    """
    for name, size in (("width", width), ("height", height)):
        if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
            raise ArgumentError(f"{name}: {size!r}; expected a whole number of pixels, at least 1")
    step = 2.0 * frame_numbers(scene).half_height / height
    columns = np.arange(width, dtype=np.float64) + (0.5 - width / 2.0)
    rows = (height / 2.0 - 0.5) - np.arange(height, dtype=np.float64)
    return columns * step, rows * step


def whole_image(scene: Scene, width: int, height: int) -> Points:
    """All pixel centres, row by row: two float64 arrays of width * height entries."""
    columns, rows = pixel_centres(scene, width, height)
    return np.tile(columns, height), np.repeat(rows, width)
