"""The seed's own renderers, as Symbolic Rendering, Chapter 1 (Van Warren) has them: Cells 2, 3 and 4.

Comes in: numpy arrays and the numbers of a scene. Goes out: intensities. The formulas are not to be improved: they are
what the kernels are measured against.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def cell_3(*, cse: bool = False) -> Callable[..., FloatArray]:
    """Cell 3: f_img = lambdify(params, I_img); with cse=True what sympy can do about its swelling."""
    import sympy as sp

    from symrender_cg.derive.seed import cell_2

    seed = cell_2()
    function: Callable[..., FloatArray] = sp.lambdify(seed.parameters, seed.I_img, modules="numpy", cse=cse)
    return function


def cell_3_grid(W: int, H: int, R: float, e: float) -> tuple[FloatArray, FloatArray]:
    """Cell 3: pixel centres."""
    half = 1.25 * e * R / np.sqrt(e * e - R * R)
    xs = np.linspace(-half + half / W, half - half / W, W)
    ys = np.linspace(half - half / H, -half + half / H, H)
    X, Y = np.meshgrid(xs, ys)
    return X, Y


def cell_4_field(
    X: FloatArray,
    Y: FloatArray,
    R: float,
    e: float,
    Lx: float,
    Ly: float,
    Lz: float,
    ka: float,
    kd: float,
    ks: float,
    shin: float,
) -> FloatArray:
    """Cell 4 between its grid and its clip: masks in place of branches."""
    A = X**2 + Y**2 + e**2
    disc = e**2 * R**2 - (e**2 - R**2) * (X**2 + Y**2)
    hit = disc >= 0
    sq = np.sqrt(np.maximum(disc, 0))
    t = (e**2 - sq) / A
    Px, Py, Pz = t * X, t * Y, e * (1 - t)
    Nx, Ny, Nz = Px / R, Py / R, Pz / R
    wx, wy, wz = Lx - Px, Ly - Py, Lz - Pz
    wn = np.sqrt(wx**2 + wy**2 + wz**2)
    ndl = (Nx * wx + Ny * wy + Nz * wz) / wn
    va = np.sqrt(A)
    vx, vy, vz = -X / va, -Y / va, e / va
    rdv = 2 * ndl * (Nx * vx + Ny * vy + Nz * vz) - (wx * vx + wy * vy + wz * vz) / wn
    field: FloatArray = np.where(hit, ka + kd * np.maximum(0, ndl) + ks * np.maximum(0, rdv) ** shin, 0.0)
    return field


def cell_4(width: int, height: int, *numbers: float) -> FloatArray:
    """Cell 4, render_numeric_vec: grid, field, clip."""
    X, Y = cell_3_grid(width, height, numbers[0], numbers[1])
    return np.clip(cell_4_field(X, Y, *numbers), 0, 1)
