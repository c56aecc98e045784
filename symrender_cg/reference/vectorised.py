"""The image by numpy: the seed's Cell 4 as it stands, and the cancellation-free forms with exact hit and miss.

Comes in: a Scene with one sphere and one light, points or an image size. Goes out: float64 or float32 intensities. The
stable form is the backend that needs no compiler (stable_tiles, stable_view, stable_shading). Never done here: symbols,
compiled code, balls.
"""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import ArgumentError
from symrender_cg.reference.camera_numbers import FrameNumbers, frame_numbers
from symrender_cg.reference.points import as_points, pixel_centres
from symrender_cg.reference.stable_tiles import shade_points
from symrender_cg.scene import Scene

Form: TypeAlias = Literal["literal", "stable"]
Floats: TypeAlias = npt.NDArray[Any]
"""float64, or float32 where the caller asked for it"""


def render_vectorised(
    scene: Scene,
    width: int,
    height: int,
    *,
    form: Form = "stable",
    clip: bool = True,
    dtype: npt.DTypeLike = np.float64,
) -> Floats:
    """The image, (height, width) of `dtype`, row 0 at the top; clipped to [0, 1] unless clip=False."""
    columns, rows = pixel_centres(scene, width, height)
    image = evaluate_vectorised(scene, columns[np.newaxis, :], rows[:, np.newaxis], form=form, dtype=dtype)
    return np.clip(image, 0.0, 1.0, out=image) if clip else image


def evaluate_vectorised(
    scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike, *, form: Form = "stable", dtype: npt.DTypeLike = np.float64
) -> Floats:
    """The unclipped intensity at points (x, y) of the image plane, of `dtype`, in the broadcast shape.

    form "literal": Symbolic Rendering, Chapter 1, Cell 4 (render_numeric_vec), off the axis disc = (m.D)^2 - A (|m|^2 -
    R^2); all operations in `dtype`, with all that the formula does in hard cases. form "stable": see the module; hit or
    miss is exact in both dtypes, there is no warning and no overflow; float32 shades in float32.
    Raises ArgumentError for another form or dtype, or for points that are NaN or infinite.
    """
    numeric: np.dtype[Any] = np.dtype(dtype)
    if numeric not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise ArgumentError(f"dtype: {numeric}; expected float64 or float32")
    if form not in ("literal", "stable"):
        raise ArgumentError(f"form: {form!r}; expected 'literal' or 'stable'")
    numbers = frame_numbers(scene)
    columns, rows = as_points(x, y)
    if form == "literal":
        with np.errstate(all="ignore"):
            return _literal(numbers, columns.astype(numeric, copy=False), rows.astype(numeric, copy=False))
    return shade_points(numbers, columns, rows, numeric)


def _literal(numbers: FrameNumbers, X: Floats, Y: Floats) -> Floats:
    """Cell 4: masks instead of branches, the formula as it stands, every operation in the dtype of X."""
    number = X.dtype.type
    R, e = number(numbers.radius), number(numbers.eye)
    Cx, Cy, Cz = (number(v) for v in numbers.center)
    Lx, Ly, Lz = (number(v) for v in numbers.light)
    ka, n = number(numbers.ambient), number(numbers.shininess)
    kd, ks = number(numbers.intensity * numbers.diffuse), number(numbers.intensity * numbers.specular)
    A = X**2 + Y**2 + e**2
    if numbers.center == (0.0, 0.0, 0.0):
        b = -(e**2)
        disc = e**2 * R**2 - (e**2 - R**2) * (X**2 + Y**2)
    else:
        b = -Cx * X - Cy * Y - (e - Cz) * e
        c = Cx**2 + Cy**2 + (e - Cz) ** 2 - R**2
        disc = b**2 - A * c
    hit = (disc >= 0) & (b < 0)
    sq = np.sqrt(np.maximum(disc, 0))
    t = (-b - sq) / A
    Px, Py, Pz = t * X, t * Y, e * (1 - t)
    Nx, Ny, Nz = (Px - Cx) / R, (Py - Cy) / R, (Pz - Cz) / R
    wx, wy, wz = Lx - Px, Ly - Py, Lz - Pz
    wn = np.sqrt(wx**2 + wy**2 + wz**2)
    ndl = (Nx * wx + Ny * wy + Nz * wz) / wn
    va = np.sqrt(A)
    vx, vy, vz = -X / va, -Y / va, e / va
    rdv = 2 * ndl * (Nx * vx + Ny * vy + Nz * vz) - (wx * vx + wy * vy + wz * vz) / wn
    specular = ks * np.maximum(0, rdv) ** n
    if numbers.gate_specular:
        specular = np.where(ndl > 0, specular, number(0.0))
    value = np.where(wn > 0, ka + kd * np.maximum(0, ndl) + specular, ka)
    image: Floats = np.where(hit, value, number(numbers.background))
    return image
