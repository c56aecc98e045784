"""numba: loops over pixels compiled by LLVM with fastmath, in four arrangements.

Comes in: a Case. Goes out: arrangements; several threads go over rows (prange, or target="parallel"). Baked numbers
are globals of the compiled function, which numba freezes. Never done here: a formula other than `formula.intensity`'s.
"""

from __future__ import annotations

from functools import cache as once
from importlib import import_module
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Draw, Grid, Render


def numba(case: Case, threads: int) -> Arrangements:
    """The faster of: a loop without branches, a loop that skips the background, and each as a ufunc by @vectorize."""
    nb: Any = import_module("numba")
    nb.set_num_threads(min(threads, nb.config.NUMBA_NUM_THREADS))
    real: Any = case.dtype.type
    compiled = nb.njit(fastmath=True, error_model="numpy", inline="always")
    zero, one, two = real(0), real(1), real(2)
    squarings = _squarings(case)

    @compiled  # type: ignore[untyped-decorator]
    def power(base: Any, exponent: Any) -> Any:
        if squarings:
            for _ in range(squarings):
                base = base * base
            return base
        return base**exponent

    @compiled  # type: ignore[untyped-decorator]
    def lit(
        x: Any, y: Any, s: Any, disc: Any, R: Any, e: Any, lx: Any, ly: Any, lz: Any, ka: Any, kd: Any, ks: Any, n: Any
    ) -> Any:
        root = sqrt(disc if disc > zero else zero)
        inv_a = one / (s + e * e)
        t = (e * e - root) * inv_a
        px, py, pz = t * x, t * y, e - t * e
        wx, wy, wz = lx - px, ly - py, lz - pz
        inv_w2 = one / (wx * wx + wy * wy + wz * wz)
        n_dot_w = (px * wx + py * wy + pz * wz) * (one / R)
        mirrored = (two / R) * (n_dot_w * root) - (e * wz - x * wx - y * wy)
        n_dot_l = n_dot_w * sqrt(inv_w2)
        r_dot_v = mirrored * sqrt(inv_a * inv_w2)
        diffuse = n_dot_l if n_dot_l > zero else zero
        return ka + kd * diffuse + ks * power(r_dot_v if r_dot_v > zero else zero, n)

    @compiled  # type: ignore[untyped-decorator]
    def smooth(x: Any, y: Any, R: Any, e: Any, lx: Any, ly: Any, lz: Any, ka: Any, kd: Any, ks: Any, n: Any) -> Any:
        s = x * x + y * y
        disc = e * e * R * R - (e * e - R * R) * s
        value = lit(x, y, s, disc, R, e, lx, ly, lz, ka, kd, ks, n)
        return value if disc >= zero else zero

    @compiled  # type: ignore[untyped-decorator]
    def branching(x: Any, y: Any, R: Any, e: Any, lx: Any, ly: Any, lz: Any, ka: Any, kd: Any, ks: Any, n: Any) -> Any:
        s = x * x + y * y
        disc = e * e * R * R - (e * e - R * R) * s
        if disc < zero:
            return zero
        return lit(x, y, s, disc, R, e, lx, ly, lz, ka, kd, ks, n)

    numbers = tuple(real(value) for value in case.numbers.in_order())
    return {
        "loop": _loop(nb, case, smooth, numbers, threads),
        "loop with a branch": _loop(nb, case, branching, numbers, threads),
        "@vectorize": _ufunc(nb, case, smooth, numbers, threads),
        "@vectorize with a branch": _ufunc(nb, case, branching, numbers, threads),
    }


def _loop(nb: Any, case: Case, shade: Any, numbers: tuple[Any, ...], threads: int) -> Draw:
    """Rows and columns by loops, coordinates from indices."""
    real: Any = case.dtype.type
    ranges = nb.prange if threads > 1 else range
    compiled = nb.njit(fastmath=True, error_model="numpy", parallel=threads > 1)
    if case.baked:
        R, e, lx, ly, lz, ka, kd, ks, n = numbers

        @compiled  # type: ignore[untyped-decorator]
        def render(out: Any, left: Any, top: Any, step: Any) -> None:
            for j in ranges(out.shape[0]):
                y = top - real(j) * step
                for i in range(out.shape[1]):
                    out[j, i] = shade(left + real(i) * step, y, R, e, lx, ly, lz, ka, kd, ks, n)
    else:

        @compiled  # type: ignore[untyped-decorator]
        def render(
            out: Any,
            left: Any,
            top: Any,
            step: Any,
            R: Any,
            e: Any,
            lx: Any,
            ly: Any,
            lz: Any,
            ka: Any,
            kd: Any,
            ks: Any,
            n: Any,
        ) -> None:
            for j in ranges(out.shape[0]):
                y = top - real(j) * step
                for i in range(out.shape[1]):
                    out[j, i] = shade(left + real(i) * step, y, R, e, lx, ly, lz, ka, kd, ks, n)

    arguments = () if case.baked else numbers

    def draw(grid: Grid) -> Render:
        out = np.empty((grid.size, grid.size), case.dtype)
        window = (real(grid.left), real(grid.top), real(grid.step))

        def again() -> NDArray[Any]:
            render(out, *window, *arguments)
            return out

        return again

    return draw


def _ufunc(nb: Any, case: Case, shade: Any, numbers: tuple[Any, ...], threads: int) -> Draw:
    """numba.vectorize on a row of x and a column of y."""
    kind = nb.float64 if case.format == "float64" else nb.float32
    options = {"target": "parallel"} if threads > 1 else {"fastmath": True}
    signature = kind(*[kind] * (2 if case.baked else 2 + len(numbers)))
    R0, e0, lx0, ly0, lz0, ka0, kd0, ks0, n0 = numbers

    def one(x: Any, y: Any) -> Any:
        return shade(x, y, R0, e0, lx0, ly0, lz0, ka0, kd0, ks0, n0)

    def every(x: Any, y: Any, R: Any, e: Any, lx: Any, ly: Any, lz: Any, ka: Any, kd: Any, ks: Any, n: Any) -> Any:
        return shade(x, y, R, e, lx, ly, lz, ka, kd, ks, n)

    @once
    def compiled() -> Any:
        return nb.vectorize([signature], **options)(one if case.baked else every)

    arguments = () if case.baked else numbers

    def draw(grid: Grid) -> Render:
        columns, rows = grid.axes(case.dtype)
        x, y = columns[np.newaxis, :], rows[:, np.newaxis]
        out = np.empty((grid.size, grid.size), case.dtype)
        function = compiled()

        def render() -> NDArray[Any]:
            image: NDArray[Any] = function(x, y, *arguments, out=out)
            return image

        return render

    return draw


def _squarings(case: Case) -> int:
    """How often a base is squared for a baked exponent that is a power of two; 0 where pow is called."""
    n = case.numbers.shininess
    return int(n).bit_length() - 1 if case.baked and n == int(n) and int(n) & (int(n) - 1) == 0 else 0
