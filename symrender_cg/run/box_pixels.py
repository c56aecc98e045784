"""`box_pixels`: which pixels of an image have their centres in a box of the image plane.

In: edges of boxes in scene units, a size, sides of pixels. Out: boxes as the kernels of `stable` take them. A centre on
an edge is in the box; centres are those of symrender_cg.run.grid, bit for bit. Never here: where a box is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.kernel import GRID

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

BOX = np.dtype([("grid", GRID), *((name, np.int32) for name in ("column_begin", "column_end", "row_begin", "row_end"))])
"""symrender_box, as the C lays it out."""


def box_pixels(edges: Floats, grids: NDArray[Any]) -> NDArray[Any]:
    """(count,) of BOX: the pixels of each of the grids that lie in its box; none where the edges are NaN.

    edges: (count, 4), left <= right and bottom <= top of each. grids: (count,) of GRID.
    """
    found = np.zeros(len(edges), dtype=BOX)
    found["grid"] = grids
    known = np.flatnonzero(~np.isnan(edges[:, 0]))
    left, right, bottom, top = edges[known].T
    width, height, side = (grids[name][known].astype(np.float64) for name in ("width", "height", "pixel"))
    column, row = 0.5 - 0.5 * width, 0.5 * height - 0.5
    with np.errstate(over="ignore"):  # a box far away, in pixels
        found["column_begin"][known] = _first(lambda i: (i + column) * side >= left, left / side - column, width)
        found["column_end"][known] = _first(lambda i: (i + column) * side > right, right / side - column, width)
        found["row_begin"][known] = _first(lambda j: (row - j) * side <= top, row - top / side, height)
        found["row_end"][known] = _first(lambda j: (row - j) * side < bottom, row - bottom / side, height)
    return found


def _first(holds: Callable[[Floats], Bools], about: Floats, count: Floats) -> Floats:
    """The first of the numbers 0, 1, ... for which it holds, as it does for all after it; `count` where it does for
    none below that. `about`: where that is, but for rounding."""
    found = np.clip(np.ceil(about), 0.0, count)
    found = np.where((found > 0.0) & holds(found - 1.0), found - 1.0, found)
    return np.where((found < count) & ~holds(found), found + 1.0, found)
