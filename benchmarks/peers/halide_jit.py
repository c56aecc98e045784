"""Halide through its Python binding: `formula.intensity` as a pure function, scheduled by hand, compiled for this host.

Comes in: a Case. Goes out: arrangements: vectors of one or two registers, rows in parallel where there are threads.
Never done here: a bounds query or an assertion in the pipeline (both are switched off, as its users do for speed).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache as once
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Grid, Render
from benchmarks.peers.formula import Arithmetic, intensity


def halide(case: Case, threads: int) -> Arrangements:
    """Func.compile_jit, realized into a buffer over a numpy array."""
    hl: Any = import_module("halide")
    bits = 8 * case.dtype.itemsize
    real = hl.Float(bits)

    constant: Any = hl.f64 if bits == 64 else hl.f32
    zero = constant(0.0)
    arithmetic = Arithmetic(hl.sqrt, lambda a: hl.max(a, zero), hl.select, hl.pow)
    host = hl.get_host_target()
    lanes = max(host.natural_vector_size(real), 2)
    target = host.with_feature(hl.TargetFeature.NoAsserts).with_feature(hl.TargetFeature.NoBoundsQuery)

    def made(width: int) -> tuple[Any, Any]:
        """(the numbers' place, the compiled function)"""
        given = hl.ImageParam(real, 1, "given")  # not Param: its set() rounds to float32
        left, top, step = (given[k] for k in range(3))
        if case.baked:
            *front, exponent = case.numbers.in_order()
            numbers: tuple[Any, ...] = (*(constant(value) for value in front), exponent)
        else:
            numbers = tuple(given[3 + k] for k in range(9))
        i, j = hl.Var("i"), hl.Var("j")
        image = hl.Func("image")
        x, y = left + hl.cast(real, i) * step, top - hl.cast(real, j) * step
        image[i, j] = intensity(x, y, numbers, arithmetic)
        image.vectorize(i, width, hl.TailStrategy.GuardWithIf)
        if threads > 1:
            inner, outer = hl.Var("inner"), hl.Var("outer")
            image.split(j, outer, inner, 16).parallel(outer)
        image.compile_jit(target)
        return given, image

    def by(width: int) -> Callable[[Grid], Render]:
        compiled = once(partial(made, width))

        def draw(grid: Grid) -> Render:
            given, image = compiled()
            out = np.empty((grid.size, grid.size), case.dtype)
            buffer = hl.Buffer(out)  # its first axis is numpy's last
            values = hl.Buffer(np.array((grid.left, grid.top, grid.step, *case.numbers.in_order()), case.dtype))

            def render() -> NDArray[Any]:
                given.set(values)
                image.realize(buffer, target)
                return out

            return render

        return draw

    return {f"vectors of {lanes}": by(lanes), f"vectors of {2 * lanes}": by(2 * lanes)}
