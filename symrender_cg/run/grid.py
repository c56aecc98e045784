"""The grid of pixel centres on the image plane, bit for bit as the kernels compute it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def pixel_centres(width: int, height: int, pixel: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x of every column, y of every row from the top, of square pixels with that side: (i + 1/2 - width / 2) pixel."""
    columns = (np.arange(width, dtype=np.float64) + 0.5 - 0.5 * width) * np.float64(pixel)
    rows = (0.5 * height - 0.5 - np.arange(height, dtype=np.float64)) * np.float64(pixel)
    return columns, rows


def pixels_at(
    column: NDArray[np.intp], row: NDArray[np.intp], width: int, height: int, pixel: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x and y of some pixels, the same bits."""
    side = np.float64(pixel)
    return (column + (0.5 - 0.5 * width)) * side, ((0.5 * height - 0.5) - row) * side
