"""numpy by hand, and numexpr: arrays of all pixels, one operation or one formula after another.

Comes in: a Case. Goes out: arrangements. Never done here: a loop over pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Grid, Render, strips_of
from benchmarks.peers.formula import Arithmetic, intensity

NUMPY: Final = Arithmetic(np.sqrt, lambda a: np.maximum(a, 0), np.where, np.power)


def numpy_by_hand(case: Case, threads: int) -> Arrangements:
    """`formula.intensity` on a row of x and a column of y, for strips of rows or for the whole image."""
    del threads  # numpy has none for this
    numbers = case.numbers.in_order()

    def by(strips: Callable[[int], tuple[slice, ...]]) -> Callable[[Grid], Render]:
        def draw(grid: Grid) -> Render:
            x, y = grid.axes(case.dtype)
            out = np.empty((grid.size, grid.size), case.dtype)

            def render() -> NDArray[Any]:
                for strip in strips(grid.size):
                    out[strip] = intensity(x[np.newaxis, :], y[strip, np.newaxis], numbers, NUMPY)
                return out

            return render

        return draw

    return {"strips of rows": by(strips_of), "whole image": by(lambda size: (slice(0, size),))}


def numexpr(case: Case, threads: int) -> Arrangements:
    """The formula in eight expressions, each evaluated block by block by numexpr."""
    ne = import_module("numexpr")
    names = ("R", "e", "lx", "ly", "lz", "ka", "kd", "ks", "n")
    real = case.dtype.type
    n_dot_w = "(t*x*(lx - t*x) + t*y*(ly - t*y) + (e - t*e)*(lz - (e - t*e)))/R"
    mirrored = "(2*n_dot_w*root/R - (e*(lz - (e - t*e)) - x*(lx - t*x) - y*(ly - t*y)))"
    exponent = f"{case.numbers.shininess:g}" if _is_small(case) else "n"
    steps = {
        "disc": "e*e*R*R - (e*e - R*R)*(x*x + y*y)",
        "root": "sqrt(where(disc > 0, disc, 0*disc))",
        "t": "(e*e - root)/(x*x + y*y + e*e)",
        "inv_w2": "1/((lx - t*x)**2 + (ly - t*y)**2 + (lz - (e - t*e))**2)",
        "n_dot_w": n_dot_w,
        "r_dot_v": f"{mirrored}*sqrt(inv_w2/(x*x + y*y + e*e))",
        "lobe": f"where(r_dot_v > 0, r_dot_v, 0*r_dot_v)**{exponent}",
        "image": "where(disc >= 0, ka + kd*where(n_dot_w > 0, n_dot_w, 0*n_dot_w)*sqrt(inv_w2) + ks*lobe, 0*disc)",
    }
    ne.set_num_threads(threads)

    def draw(grid: Grid) -> Render:
        x, y = grid.axes(case.dtype)
        shape = (grid.size, grid.size)
        known: dict[str, Any] = {name: real(value) for name, value in zip(names, case.numbers.in_order(), strict=True)}
        known |= {"x": x[np.newaxis, :], "y": y[:, np.newaxis]}
        known |= {name: np.empty(shape, case.dtype) for name in steps}

        def render() -> NDArray[Any]:
            for name, text in steps.items():
                ne.evaluate(text, known, out=known[name], casting="same_kind")
            image: NDArray[Any] = known["image"]
            return image

        return render

    return {"eight expressions": draw}


def _is_small(case: Case) -> bool:
    """Whether numexpr multiplies out the power: a whole exponent of at most 50, known when the expression is read."""
    n = case.numbers.shininess
    return case.baked and n == int(n) and 0 < n <= 50
