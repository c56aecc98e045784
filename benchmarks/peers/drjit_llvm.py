"""Dr.Jit with its LLVM backend: `formula.intensity` traced, compiled once and recalled by the trace's hash.

Comes in: a Case. Goes out: arrangements: traced again in each call, as Dr.Jit programs are, or frozen (dr.freeze).
Arguments are opaque, so that their values are not compiled in. Never done here: a transfer, the result is a view.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from benchmarks.peers.case import Arrangements, Case, Grid, Render
from benchmarks.peers.formula import Arithmetic, intensity


def drjit(case: Case, threads: int) -> Arrangements:
    """The LLVM backend; coordinates come from an index, so that nothing but the image is written."""
    dr: Any = import_module("drjit")
    llvm: Any = import_module("drjit.llvm")
    dr.set_thread_count(threads)
    real = llvm.Float64 if case.format == "float64" else llvm.Float32
    # not dr.maximum: LLVM 15 cannot compile it for x86, and ends the process
    arithmetic = Arithmetic(dr.sqrt, lambda a: dr.select(a > 0, a, 0), dr.select, dr.power)
    numbers = case.numbers.in_order()

    def trace(size: int, window: tuple[Any, ...], given: tuple[Any, ...]) -> Any:
        index = dr.arange(llvm.UInt32, size * size)
        row = index // size
        left, top, step = window
        return intensity(left + real(index - row * size) * step, top - real(row) * step, given or numbers, arithmetic)

    def by(wrap: Callable[[Callable[..., Any]], Callable[..., Any]]) -> Callable[[Grid], Render]:
        def draw(grid: Grid) -> Render:
            window = tuple(dr.opaque(real, value) for value in (grid.left, grid.top, grid.step))
            given = () if case.baked else tuple(dr.opaque(real, value) for value in numbers)
            traced = wrap(lambda window, given: trace(grid.size, window, given))

            def render() -> Any:
                image = traced(window, given)
                dr.eval(image)
                dr.sync_thread()
                return image.numpy().reshape(grid.size, grid.size)

            return render

        return draw

    return {"traced": by(lambda function: function), "frozen": by(dr.freeze)}
