"""JAX: `formula.intensity` under jax.jit, with and without giving the last image's memory back to the next one.

Comes in: a Case. Goes out: arrangements. XLA's threads are as many as the process may use processors (`worker` binds it
before the import). Never done here: a transfer, the result is read where it lies.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Grid, Render
from benchmarks.peers.formula import Arithmetic, intensity


def jax(case: Case, threads: int) -> Arrangements:
    """XLA's CPU compiler on a row of x and a column of y."""
    jx: Any = import_module("jax")
    jnp: Any = import_module("jax.numpy")
    jx.config.update("jax_enable_x64", True)
    arithmetic = Arithmetic(jnp.sqrt, lambda a: jnp.maximum(a, 0), jnp.where, jnp.power)
    numbers = case.numbers.in_order()
    arguments = () if case.baked else tuple(jnp.asarray(value, case.dtype) for value in numbers)

    def image(x: Any, y: Any, *given: Any) -> Any:
        return intensity(x, y, given or numbers, arithmetic)

    def coordinates(grid: Grid) -> tuple[Any, Any]:
        columns, rows = grid.axes(case.dtype)
        return jnp.asarray(columns[np.newaxis, :]), jnp.asarray(rows[:, np.newaxis])

    plain = jx.jit(image)

    def draw(grid: Grid) -> Render:
        x, y = coordinates(grid)
        return lambda: np.asarray(plain(x, y, *arguments).block_until_ready())

    def into(out: Any, *given: Any) -> Any:
        return jnp.asarray(image(*given), out.dtype)

    reusing = jx.jit(into, donate_argnums=0, keep_unused=True)

    def draw_reusing(grid: Grid) -> Render:
        x, y = coordinates(grid)
        kept = [jnp.zeros((grid.size, grid.size), case.dtype)]

        def render() -> NDArray[Any]:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                kept[0] = reusing(kept[0], x, y, *arguments).block_until_ready()
            return np.asarray(kept[0])

        return render

    return {"jit": draw, "jit, donated output": draw_reusing}
