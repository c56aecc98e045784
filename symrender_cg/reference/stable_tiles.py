"""The stable form over many points: tiles that stay in the cache, hits decided exactly, the edge in double-double.

Comes in: camera-frame numbers, points. Goes out: unclipped intensities, float64 or float32. Never done here: a pixel
grid, a clip; the light of a hit is in stable_shading.

With m = C - E, D = (x, y, -e), A = |D|^2:
    c = m x D = m x (D - D_0), D_0 the ray to the centre: c keeps its relative accuracy
    disc = R^2 A - |c|^2                     Lagrange's identity; in double-double where disc < R^2 A / 16
The sign of disc: float64, where it exceeds `View.doubt` A; then double-double, where it exceeds `View.deep_doubt` A;
then whole numbers.
"""

from __future__ import annotations

import math
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.reference.camera_numbers import FrameNumbers
from symrender_cg.reference.pairs import determinant, square_sum, two_product, two_sum
from symrender_cg.reference.points import FloatArray
from symrender_cg.reference.stable_shading import Floats, Triple, at, shade
from symrender_cg.reference.stable_view import UNIT_ROUNDOFF, View, view_of

Indices: TypeAlias = npt.NDArray[np.intp]

CHUNK: Final = 16384
"""Points a block: the arrays of one block stay in the cache."""
LOW: Final = 1.0 / 16.0
"""disc / (R^2 A) = (n.v)^2 below which disc is computed in double-double."""
STEEP: Final = 2.0**60
"""max(|x|, |y|) / e above which D is scaled point by point."""


def shade_points(numbers: FrameNumbers, x: FloatArray, y: FloatArray, dtype: np.dtype[Any]) -> Floats:
    """Tiles that stay in the cache, then all points near the edge of the sphere together."""
    view = view_of(numbers)
    shape = np.broadcast_shapes(x.shape, y.shape)
    image: Floats = np.full(shape, numbers.background, dtype=dtype)
    if image.size == 0:
        return image
    if len(shape) == 2 and x.shape == (1, shape[1]) and y.shape == (shape[0], 1):
        grid = image
    else:
        grid = image.reshape(1, -1)
        x, y = (np.reshape(values, (1, -1)) for values in np.broadcast_arrays(x, y))
    height, width = grid.shape
    step = max(1, CHUNK // width)
    edges: list[tuple[Indices, Indices]] = []
    with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
        for row in range(0, height, step):
            for column in range(0, width, CHUNK):
                tile = np.s_[row : row + step, column : column + CHUNK]
                near = _shade_inside(view, _cut(x, tile), _cut(y, tile), grid[tile])
                if near[0].size:
                    edges.append((near[0] + row, near[1] + column))
        if edges:
            rows, columns = (np.concatenate(part) for part in zip(*edges, strict=True))
            for first in range(0, rows.size, CHUNK):
                places = rows[first : first + CHUNK], columns[first : first + CHUNK]
                _shade_edge(view, at(x, places), at(y, places), grid, places)
    return image


def _shade_inside(view: View, x: FloatArray, y: FloatArray, image: Floats) -> tuple[Indices, ...]:
    """Shades what plain float64 is sure to hit and has n.v > 1/4; returns the points of the tile left to `_shade_edge`.

    Works on the smallest rectangle of the tile that holds those hits; the others in it are shaded in vain and masked.
    Rows and columns of a grid stay one-dimensional as long as a quantity depends on one of them.
    """
    d = _rays(view, x, y)
    c = _cross(view, d)
    a_dd = d[0] * d[0] + d[2] * d[2] + d[1] * d[1]
    disc = view.r2[0] * a_dd - c[0] * c[0]
    disc -= c[1] * c[1]
    if not view.on_axis:
        disc -= c[2] * c[2]
    possible = disc >= a_dd * -view.doubt
    if not possible.any():
        return np.nonzero(possible)
    hit = disc > a_dd * max(view.r2[0] * LOW, view.doubt)
    if not _all_before_eye(view, d):
        before, slack = _before_eye(view, d)
        possible &= before >= -slack
        hit &= before > slack
    possible &= ~hit
    columns = np.flatnonzero(hit.any(axis=0))
    if columns.size:
        rows = np.flatnonzero(hit.any(axis=1))
        window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        d = (_cut(d[0], window), _cut(d[1], window), _cut(d[2], window))
        c = (_cut(c[0], window), _cut(c[1], window), _cut(c[2], window))
        value = _shade_in_dtype(view, d, c, a_dd[window], np.maximum(disc[window], 0.0), image.dtype)
        np.copyto(image[window], value, where=hit[window])
    return np.nonzero(possible)


def _shade_edge(view: View, x: FloatArray, y: FloatArray, grid: Floats, places: tuple[Indices, Indices]) -> None:
    """Shades points near the edge, on either side: disc in double-double, each hit decided exactly."""
    x, y = x[np.newaxis, :], y[np.newaxis, :]
    d = _rays(view, x, y)
    a_dd = d[0] * d[0] + d[2] * d[2] + d[1] * d[1]
    disc = _deep_disc(view, d)
    hit = disc >= 0.0
    doubtful = np.abs(disc) <= view.deep_doubt * a_dd
    if not view.on_axis:
        before, slack = _before_eye(view, d)
        hit &= before > 0.0
        doubtful |= np.abs(before) <= slack
    for index in np.flatnonzero(doubtful):
        hit[0, index] = view.hit(float(x[0, index]), float(y[0, index]))
    value = _shade_in_dtype(view, d, _cross(view, d), a_dd, np.maximum(disc, 0.0), grid.dtype)
    rows, columns = places
    grid[rows[hit[0]], columns[hit[0]]] = value[hit]


def _shade_in_dtype(view: View, d: Triple, c: Triple, a_dd: Floats, disc: FloatArray, dtype: np.dtype[Any]) -> Floats:
    """`shade` with c and sqrt(disc) over R, everything rounded to `dtype` first; disc >= 0 is used up."""
    root = np.sqrt(disc, out=disc)
    if view.r != 1.0:
        inverse = 1.0 / view.r
        root *= inverse
        c = (c[0] * inverse, c[1] * inverse, c[2] * inverse)
    if dtype == root.dtype:
        return shade(view, d, d, c, a_dd, root)
    rounded = (d[0].astype(dtype), d[1].astype(dtype), d[2].astype(dtype))
    c = (c[0].astype(dtype), c[1].astype(dtype), c[2].astype(dtype))
    return shade(view, d, rounded, c, a_dd.astype(dtype), root.astype(dtype))


def _deep_disc(view: View, d: Triple) -> Floats:
    """R^2 A - |m x D|^2, every product and sum with its error; good to view.deep_doubt A before the last sum."""
    dx, dy, dz = d
    rests = (0.0, 0.0, view.m_z_rest)
    mx, my, mz = ((np.asarray(v), np.asarray(rest)) for v, rest in zip(view.m, rests, strict=True))
    components = (determinant(my, mz, dy, dz), determinant(mz, mx, dz, dx), determinant(mx, my, dx, dy))
    a_high, a_low = square_sum(((dx, None), (dy, None), (dz, None)))
    c_high, c_low = square_sum(components)
    high, low = two_product(np.asarray(view.r2[0]), a_high)
    low = low + (view.r2[0] * a_low + view.r2[1] * a_high)
    disc, rest = two_sum(high, -c_high)
    disc += rest + (low - c_low)
    return disc


def _cut(values: Floats, window: tuple[slice, slice]) -> Floats:
    """values[window], where an axis of length 1 stands for all."""
    rows, columns = (part if size > 1 else slice(None) for part, size in zip(window, values.shape, strict=True))
    return values[rows, columns]


def _before_eye(view: View, d: Triple) -> tuple[Floats, Floats]:
    """m.D, and a bound of its error."""
    (mx, my, mz), (dx, dy, dz) = view.m, d
    size = np.abs(dx) + np.abs(dy) + np.abs(dz)
    return mx * dx + my * dy + mz * dz, 16.0 * UNIT_ROUNDOFF * (abs(mx) + abs(my) + abs(mz)) * size


def _all_before_eye(view: View, d: Triple) -> bool:
    """Whether m.D > 0 on the whole tile: always on the axis, else by the tile's largest |x| and |y|."""
    if view.on_axis:
        return True
    (mx, my, mz), (dx, dy, dz) = view.m, d
    aside = abs(mx) * np.abs(dx).max() + abs(my) * np.abs(dy).max()
    return bool((mz * dz).min() > 1.001 * aside)


def _rays(view: View, x: FloatArray, y: FloatArray) -> Triple:
    """D = (x, y, -e) times a power of two, the same for all points unless one is beyond STEEP."""
    dx, dy = np.ldexp(x, view.ray_shift), np.ldexp(y, view.ray_shift)
    dz = np.full((1, 1), -view.eye)
    if max(np.abs(dx).max(), np.abs(dy).max()) <= STEEP:
        return dx, dy, dz
    shift = -np.maximum(np.frexp(np.maximum(np.abs(x), np.abs(y)))[1], math.frexp(view.numbers.eye)[1])
    return np.ldexp(x, shift), np.ldexp(y, shift), np.ldexp(np.full(shift.shape, -view.numbers.eye), shift)


def _cross(view: View, d: Triple) -> Triple:
    """c = m x D; from D - D_0, whose z is 0, where the centre is not beside the eye."""
    (mx, my, mz), (dx, dy, dz) = view.m, d
    if view.toward is None:
        return my * dz - mz * dy, mz * dx - mx * dz, mx * dy - my * dx
    if view.on_axis:
        return -mz * dy, mz * dx, np.zeros((1, 1))
    x_0, x_rest, y_0, y_rest = view.toward
    scale = dz / -view.eye
    dx = (dx - x_0 * scale) - x_rest * scale
    dy = (dy - y_0 * scale) - y_rest * scale
    return -mz * dy, mz * dx, mx * dy - my * dx
