"""Symbolic Rendering, Chapter 1 (Van Warren): the symbolic cells of the seed, statement by statement, under its names.

Comes in: nothing but sympy. Goes out: the seed's expressions (Cells 2, 6, 7, 8) and its numpy functions (Cell 3).
Never done here: anything better than the seed does; its swollen expressions are what the walk measures against.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from symrender_cg.derive.seed import SeedImage

FloatArray = NDArray[np.float64]

SCENE = (1.0, 4.0, 5.0, 5.0, 10.0, 0.1, 0.7, 0.5, 32.0)
"""R, e, l_x, l_y, l_z, k_a, k_d, k_s, n: the seed's scene in the order of its parameters after x and y."""


def cell_3_function(seed: SeedImage, expression: Any) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Cell 3's `lambdify(params, expression)` with the seed's scene filled in: (X, Y) -> values."""
    heaviside = {"Heaviside": lambda u, _: (u >= 0).astype(float)}
    function = sp.lambdify(seed.parameters, expression, modules=["numpy", heaviside])

    def at(X: FloatArray, Y: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore", divide="ignore"):
            values: FloatArray = function(X, Y, *SCENE)
        return values

    return at


def cell_1_grid(width: int, height: int) -> tuple[FloatArray, FloatArray]:
    """Cell 1's pixel centres, y of shape (height, 1) and x of shape (1, width), each by its own expression."""
    half = 1.25 * 4.0 * 1.0 / np.sqrt(4.0**2 - 1.0**2)
    y = np.array([half * (1.0 - 2.0 * (j + 0.5) / height) for j in range(height)])
    x = np.array([half * (2.0 * (i + 0.5) / width - 1.0) for i in range(width)])
    return x[np.newaxis, :], y[:, np.newaxis]


def cell_3_grid(width: int, height: int) -> tuple[FloatArray, FloatArray]:
    """Cell 3's pixel centres, X and Y of shape (height, width): linspace, an ulp or so from Cell 1's."""
    half = 1.25 * 4.0 * 1.0 / np.sqrt(4.0 * 4.0 - 1.0 * 1.0)
    xs = np.linspace(-half + half / width, half - half / width, width)
    ys = np.linspace(half - half / height, -half + half / height, height)
    X, Y = np.meshgrid(xs, ys)
    return X, Y


def cell_5_rho2(seed: SeedImage) -> Any:
    """Solves disc = 0 for s = x^2 + y^2."""
    x, y = seed.parameters[:2]
    s = sp.symbols("s", positive=True)
    return sp.solve(sp.Eq(sp.expand(seed.disc).xreplace({x**2: s - y**2}), 0), s)[0]


def cell_6_derivative(seed: SeedImage) -> Any:
    """dI/dl_x of the field without its clamps, as Cell 6 differentiates it."""
    *_, ka, kd, ks, n = seed.parameters
    return sp.diff(ka + kd * seed.ndl + ks * seed.rdv**n, seed.parameters[4])


def cell_6_baked(seed: SeedImage) -> Any:
    """The image with the scene's numbers substituted."""
    return seed.I_img.subs(dict(zip(seed.parameters[2:], SCENE, strict=True)))


def cell_7_images(seed: SeedImage) -> tuple[Any, Any]:
    """H(disc) I_shade, and the same with sqrt(disc) replaced by sqrt(max(0, disc))."""
    raw = seed.I_shade * sp.Heaviside(seed.disc, 0)
    return raw, raw.subs(sp.sqrt(seed.disc), sp.sqrt(sp.Max(0, seed.disc)))


def cell_8_image(seed: SeedImage) -> tuple[Any, tuple[Any, ...]]:
    """The naive image of two spheres on the axis, with its arguments (x, y, R, e, R_2, c_z, I_A, I_B)."""
    x, y, R, e = seed.parameters[:4]
    R2, cz = sp.symbols("R_2 c_z", positive=True)
    shade_a, shade_b = sp.symbols("I_A I_B")
    E, D = sp.Matrix([0, 0, e]), sp.Matrix([x, y, -e])
    C2 = sp.Matrix([0, 0, cz])
    b2 = (E - C2).dot(D)
    c2 = (E - C2).dot(E - C2) - R2**2
    disc2 = sp.expand(b2**2 - seed.A * c2)
    image = sp.Piecewise((shade_a, (seed.disc >= 0) & (disc2 < 0)), (shade_b, disc2 >= 0), (0, True))
    return image, (x, y, R, e, R2, cz, shade_a, shade_b)
