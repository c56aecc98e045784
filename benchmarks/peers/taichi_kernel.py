"""taichi: a kernel over pixels on its CPU backend, fast_math on, writing into a numpy array.

Comes in: a Case. Goes out: arrangements. Never done here: its cache on disk, which would hide what compiling costs.
taichi's compiler reads the kernel's source, so that its formula is written out here; it is `formula.intensity`'s.
"""

# mypy: disable-error-code="valid-type, attr-defined, index"
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Draw, Grid, Render

_STARTED: list[str] = []


def taichi(case: Case, threads: int) -> Arrangements:
    """A kernel whose outermost loop is over all pixels, or over rows."""
    ti: Any = import_module("taichi")
    # one runtime has one default format, and a second init throws away the kernels of the first: formats are explicit
    if not _STARTED:
        ti.init(
            arch=ti.cpu,
            fast_math=True,
            cpu_max_num_threads=threads,
            offline_cache=False,
            log_level=ti.ERROR,
            default_fp=ti.f64,
        )
        _STARTED.append("cpu")
    return {"a loop over pixels": _arranged(ti, case, False), "a loop over rows": _arranged(ti, case, True)}


def _arranged(ti: Any, case: Case, by_rows: bool) -> Draw:
    real: Any = ti.f64 if case.format == "float64" else ti.f32
    nine = ti.types.vector(9, real)
    image_type = ti.types.ndarray(dtype=real, ndim=2)
    whole = case.baked and case.numbers.shininess == int(case.numbers.shininess)
    exponent = int(case.numbers.shininess)
    baked = case.baked
    R0, e0, lx0, ly0, lz0, ka0, kd0, ks0, n0 = case.numbers.in_order()

    @ti.func
    def shade(x, y, given):  # type: ignore[no-untyped-def]
        R, e, lx, ly, lz = given[0], given[1], given[2], given[3], given[4]
        ka, kd, ks, n = given[5], given[6], given[7], given[8]
        if ti.static(baked):
            R, e, lx, ly, lz = (
                ti.cast(R0, real),
                ti.cast(e0, real),
                ti.cast(lx0, real),
                ti.cast(ly0, real),
                ti.cast(lz0, real),
            )
            ka, kd, ks, n = ti.cast(ka0, real), ti.cast(kd0, real), ti.cast(ks0, real), ti.cast(n0, real)
        s = x * x + y * y
        disc = e * e * R * R - (e * e - R * R) * s
        value = ti.cast(0, real)
        if disc >= 0:
            root = ti.sqrt(disc)
            inv_a = 1 / (s + e * e)
            t = (e * e - root) * inv_a
            px, py, pz = t * x, t * y, e - t * e
            wx, wy, wz = lx - px, ly - py, lz - pz
            inv_w2 = 1 / (wx * wx + wy * wy + wz * wz)
            n_dot_w = (px * wx + py * wy + pz * wz) * (1 / R)
            mirrored = (2 / R) * (n_dot_w * root) - (e * wz - x * wx - y * wy)
            n_dot_l = n_dot_w * ti.sqrt(inv_w2)
            r_dot_v = ti.max(mirrored * ti.sqrt(inv_a * inv_w2), ti.cast(0, real))
            lobe = r_dot_v**exponent if ti.static(whole) else r_dot_v**n
            value = ka + kd * ti.max(n_dot_l, ti.cast(0, real)) + ks * lobe
        return value

    if by_rows:

        @ti.kernel  # type: ignore[untyped-decorator]
        def fill(out: image_type, left: real, top: real, step: real, given: nine):  # type: ignore[no-untyped-def]
            for j in range(out.shape[0]):
                y = top - ti.cast(j, real) * step
                for i in range(out.shape[1]):
                    out[j, i] = shade(left + ti.cast(i, real) * step, y, given)

    else:

        @ti.kernel  # type: ignore[untyped-decorator]
        def fill(out: image_type, left: real, top: real, step: real, given: nine):  # type: ignore[no-untyped-def]
            for j, i in out:
                out[j, i] = shade(left + ti.cast(i, real) * step, top - ti.cast(j, real) * step, given)

    def draw(grid: Grid) -> Render:
        out = np.empty((grid.size, grid.size), case.dtype)
        given = nine(case.numbers.in_order())

        def render() -> NDArray[Any]:
            fill(out, grid.left, grid.top, grid.step, given)
            return out

        return render

    return draw
