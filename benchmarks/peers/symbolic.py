"""What sympy and symengine make of the seed's closed form: lambdify, lambdify(cse=True), ufuncify, symengine's LLVM.

Comes in: a Case. Goes out: arrangements of the function that each of them returns for the Piecewise of Cell 2. Baked
means that the numbers are substituted first, as exact rationals. Never done here: a formula of our own.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from fractions import Fraction
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Grid, Render, strips_of


def _closed_form(case: Case) -> tuple[list[Any], Any, tuple[float, ...]]:
    """(symbols that stay arguments, the Piecewise, values of those after x and y)."""
    import sympy as sp

    from symrender_cg.derive.seed import cell_2

    seed = cell_2()
    x, y, *others = seed.parameters
    values = case.numbers.in_order()
    if not case.baked:
        return [x, y, *others], seed.I_img, values
    exact = {s: sp.Rational(Fraction(str(value))) for s, value in zip(others, values, strict=True)}
    return [x, y], seed.I_img.subs(exact), ()


def lambdify(case: Case, threads: int) -> Arrangements:
    """sympy.lambdify, modules="numpy", as the seed's Cell 3 calls it."""
    return _lambdified(case, cse=False)


def lambdify_cse(case: Case, threads: int) -> Arrangements:
    """The same with cse=True."""
    return _lambdified(case, cse=True)


def _lambdified(case: Case, *, cse: bool) -> Arrangements:
    import sympy as sp

    parameters, image, values = _closed_form(case)
    function = sp.lambdify(parameters, image, modules="numpy", cse=cse)

    def whole(grid: Grid) -> Render:
        x, y = np.meshgrid(*grid.axes(case.dtype))

        def render() -> NDArray[Any]:
            with np.errstate(invalid="ignore", divide="ignore"):
                image: NDArray[Any] = function(x, y, *values)
            return image

        return render

    def strips(grid: Grid) -> Render:
        x, y = grid.axes(case.dtype)
        out = np.empty((grid.size, grid.size), case.dtype)

        def render() -> NDArray[Any]:
            with np.errstate(invalid="ignore", divide="ignore"):
                for strip in strips_of(grid.size):
                    out[strip] = function(x[np.newaxis, :], y[strip, np.newaxis], *values)
            return out

        return render

    return {"strips of rows": strips, "whole image": whole}


def ufuncify(case: Case, threads: int) -> Arrangements:
    """sympy.utilities.autowrap.ufuncify, backend "numpy": a C function behind a numpy ufunc; float64 alone."""
    if case.format != "float64":
        return {}
    from sympy.utilities.autowrap import ufuncify as made

    parameters, image, values = _closed_form(case)
    # its C calls pow(a, -1.0/2.0), which only -ffast-math takes apart
    before, os.environ["CFLAGS"] = os.environ.get("CFLAGS", ""), "-O3 -march=native -ffast-math"
    try:
        with tempfile.TemporaryDirectory(prefix="ufuncify_") as folder:
            function = made(parameters, image, backend="numpy", tempdir=folder)
    finally:
        os.environ["CFLAGS"] = before

    def draw(grid: Grid) -> Render:
        columns, rows = grid.axes(case.dtype)
        x, y = columns[np.newaxis, :], rows[:, np.newaxis]
        out = np.empty((grid.size, grid.size), case.dtype)

        def render() -> NDArray[Any]:
            image: NDArray[Any] = function(x, y, *values, out=out)
            return image

        return render

    return {"C, -O3 -ffast-math": draw}


def symengine_llvm(case: Case, threads: int) -> Arrangements:
    """symengine.Lambdify, backend "llvm", opt_level 3, with cse and without; a call takes rows of (x, y, numbers)."""
    se = import_module("symengine")
    parameters, image, values = _closed_form(case)
    arguments, formula = [se.sympify(p) for p in parameters], se.sympify(image)

    def by(cse: bool) -> Callable[[Grid], Render]:
        def draw(grid: Grid) -> Render:
            function = se.Lambdify(
                arguments, [formula], cse=cse, backend="llvm", opt_level=3, dtype=case.dtype.type, real=True
            )
            x, y = grid.axes(case.dtype)
            strips = strips_of(grid.size)
            points = np.empty((strips[0].stop, grid.size, len(arguments)), case.dtype)
            points[..., 0], points[..., 2:] = x[np.newaxis, :], values
            out = np.empty((grid.size, grid.size, 1), case.dtype)

            def render() -> NDArray[Any]:
                for strip in strips:
                    part = points[: strip.stop - strip.start]
                    part[..., 1] = y[strip, np.newaxis]
                    function(part, out=out[strip])
                image: NDArray[Any] = out[..., 0]
                return image

            return render

        return draw

    return {"cse": by(True), "no cse": by(False)}
