"""gcc -O3 -ffast-math (or whatever C compiler is found) on the literal loop of the seed's Cell 1, pixel after pixel.

Comes in: a Case. Goes out: one arrangement; threads each call the entry point for a strip of rows. The formulas are
Cell 1's with vectors written out, baked numbers are constants. Never done here: a step that Cell 1 does not have.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Grid, Render

FLAGS: Final = ("-std=c99", "-O3", "-march=native", "-ffast-math", "-fPIC", "-shared")
NAMES: Final = ("R", "e", "lx", "ly", "lz", "ka", "kd", "ks", "n")

_LOOP: Final = """
#include <tgmath.h>

typedef {real} real;

void rows(real *restrict image, int size, int begin, int end, real left, real top, real step,
    const real *restrict given)
{{
    {numbers}
    for (int j = begin; j < end; ++j)
        for (int i = 0; i < size; ++i) {{
            const real x = left + i * step, y = top - j * step;
            const real A = x * x + y * y + e * e, b = -e * e, c = e * e - R * R;
            const real disc = b * b - A * c;
            real value = 0;
            if (!(disc < 0)) {{
                const real t = (-b - sqrt(disc)) / A;
                const real Px = t * x, Py = t * y, Pz = e - t * e;
                const real Nx = Px / R, Ny = Py / R, Nz = Pz / R;
                const real wx = lx - Px, wy = ly - Py, wz = lz - Pz, wn = sqrt(wx * wx + wy * wy + wz * wz);
                const real hx = wx / wn, hy = wy / wn, hz = wz / wn;
                const real ex = -Px, ey = -Py, ez = e - Pz, en = sqrt(ex * ex + ey * ey + ez * ez);
                const real ndl = Nx * hx + Ny * hy + Nz * hz;
                const real rx = 2 * ndl * Nx - hx, ry = 2 * ndl * Ny - hy, rz = 2 * ndl * Nz - hz;
                const real rdv = (rx * ex + ry * ey + rz * ez) / en;
                value = ka + kd * (ndl > 0 ? ndl : 0) + ks * pow(rdv > 0 ? rdv : (real)0, n);
            }}
            image[(long)j * size + i] = value;
        }}
}}
"""


def c_text(case: Case) -> str:
    """The C of a case."""
    real = "double" if case.format == "float64" else "float"
    values = case.numbers.in_order()
    each = (
        f"{name} = (real){value!r}" if case.baked else f"{name} = given[{k}]"
        for k, (name, value) in enumerate(zip(NAMES, values, strict=True))
    )
    return _LOOP.format(real=real, numbers=f"const real {', '.join(each)};")


def fast_math_loop(case: Case, threads: int) -> Arrangements:
    """The compiled loop, called through ctypes, which releases the GIL."""
    from symrender_cg.build import find_toolchain

    with tempfile.TemporaryDirectory(prefix="fast_math_") as folder:
        Path(folder, "loop.c").write_text(c_text(case), encoding="utf-8")
        command = [*find_toolchain().command, *FLAGS, "-o", "loop.so", "loop.c", "-lm"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        library = ctypes.CDLL(str(Path(folder, "loop.so")))
    kind: Any = ctypes.c_double if case.format == "float64" else ctypes.c_float
    rows = library.rows
    rows.restype = None
    rows.argtypes = [ctypes.c_void_p, *[ctypes.c_int] * 3, kind, kind, kind, ctypes.c_void_p]
    given = np.array(case.numbers.in_order(), case.dtype)
    pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def draw(grid: Grid) -> Render:
        out = np.empty((grid.size, grid.size), case.dtype)
        strips = 4 * threads if threads > 1 else 1
        cuts = [grid.size * k // strips for k in range(strips + 1)]

        def strip(k: int) -> None:
            rows(out.ctypes.data, grid.size, cuts[k], cuts[k + 1], grid.left, grid.top, grid.step, given.ctypes.data)

        def render() -> NDArray[Any]:
            if pool is None:
                strip(0)
            else:
                list(pool.map(strip, range(strips)))
            return out

        return render

    return {"literal loop": draw}
