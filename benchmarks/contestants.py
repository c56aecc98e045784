"""The contestants of `speed`: ours, the seed's, and the peers that happen to be installed.

Comes in: a scene of Chapter 1's kind (centred sphere, light of intensity 1). Goes out: for each contestant a call that
renders an image of a size, and one that evaluates the unclipped field at points. Never done here: timing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import seed
from symrender_cg import Scene, compile_kernel, evaluate, render_image
from symrender_cg.reference.vectorised import evaluate_vectorised, render_vectorised
from symrender_cg.run.numbers import numbers_of

FloatArray = NDArray[np.float64]
Field = Callable[[FloatArray, FloatArray], NDArray[Any]]
BASE = "double"
"""The contestant that ratios are taken to."""


@dataclass(frozen=True, slots=True)
class Contestant:
    """One way to an image. `renderer(size)` -> a call that renders size x size pixels, its buffers already made.

    field: the unclipped intensity at points, the same arithmetic as the render's; note: what the time includes.
    """

    name: str
    threads: int
    note: str
    renderer: Callable[[int], Callable[[], object]]
    field: Field


def contestants(scene: Scene, cores: int) -> tuple[list[Contestant], list[str]]:
    """All contestants that can run here, and a sentence for each that cannot."""
    entries = [*_seed(scene), *_numpy(scene)]
    missing = []
    if find_spec("numexpr"):
        entries.append(_numexpr(scene))
    else:
        missing.append("numexpr is not installed and left out; pip install numexpr")
    for threads in sorted({1, cores}):
        entries += [_ours(scene, accuracy, threads, bake=False) for accuracy in ("literal", "double", "single")]
        entries.append(_ours(scene, "double", threads, bake=True))
    return entries, missing


def seed_numbers(scene: Scene) -> tuple[float, ...]:
    """R, e, l_x, l_y, l_z, k_a, k_d, k_s, n: the scene in the order of the seed's params."""
    numbers = numbers_of(scene)
    order = "radius eye light_x light_y light_z k_ambient k_diffuse k_specular shininess"
    return tuple(numbers[name] for name in order.split())


def _ours(scene: Scene, accuracy: str, threads: int, *, bake: bool) -> Contestant:
    def renderer(size: int) -> Callable[[], object]:
        out = np.empty((size, size), compile_kernel(scene, accuracy, bake=bake).dtype)
        return partial(render_image, scene, size, size, accuracy=accuracy, bake=bake, out=out, threads=threads)

    name = accuracy + (" baked" if bake else "") + (f", {threads} threads" if threads > 1 else "")
    return Contestant(name, threads, "clip", renderer, partial(evaluate, scene, accuracy=accuracy, bake=bake))


def _seed(scene: Scene) -> list[Contestant]:
    numbers = seed_numbers(scene)

    def lambdified(cse: bool) -> Contestant:
        function = seed.cell_3(cse=cse)

        def field(x: FloatArray, y: FloatArray) -> FloatArray:
            with np.errstate(invalid="ignore", divide="ignore"):
                return function(x, y, *numbers)

        def renderer(size: int) -> Callable[[], object]:
            return partial(field, *seed.cell_3_grid(size, size, *numbers[:2]))

        return Contestant("lambdify, cse" if cse else "lambdify (seed)", 1, "no grid, no clip", renderer, field)

    return [lambdified(False), lambdified(True)]


def _numpy(scene: Scene) -> list[Contestant]:
    numbers = seed_numbers(scene)

    def cell_4(size: int) -> Callable[[], object]:
        return partial(seed.cell_4, size, size, *numbers)

    def stable(size: int) -> Callable[[], object]:
        return partial(render_vectorised, scene, size, size)

    def cell_4_field(x: FloatArray, y: FloatArray) -> FloatArray:
        return seed.cell_4_field(x, y, *numbers)

    return [
        Contestant("numpy (seed)", 1, "grid, clip", cell_4, cell_4_field),
        Contestant("numpy, stable forms", 1, "grid, clip", stable, partial(evaluate_vectorised, scene)),
    ]


def _numexpr(scene: Scene) -> Contestant:
    """Cell 4's formula in five passes of numexpr, on one thread."""
    numexpr = import_module("numexpr")
    names = ("R", "e", "lx", "ly", "lz", "ka", "kd", "ks", "n")
    numbers = dict(zip(names, seed_numbers(scene), strict=True))
    w2 = "(lx - t*x)**2 + (ly - t*y)**2 + (lz - e*(1 - t))**2"
    nw = "(t*x*(lx - t*x) + t*y*(ly - t*y) + e*(1 - t)*(lz - e*(1 - t)))"
    wv = "(e*(lz - e*(1 - t)) - x*(lx - t*x) - y*(ly - t*y))"

    def field(x: FloatArray, y: FloatArray) -> FloatArray:
        numexpr.set_num_threads(1)
        known: dict[str, Any] = {**numbers, "x": x, "y": y}
        known["disc"] = numexpr.evaluate("e**2*R**2 - (e**2 - R**2)*(x**2 + y**2)", known)
        known["q"] = numexpr.evaluate("sqrt(where(disc > 0, disc, 0))", known)
        known["t"] = numexpr.evaluate("(e**2 - q)/(x**2 + y**2 + e**2)", known)
        known["wn"] = numexpr.evaluate(f"sqrt({w2})", known)
        known["ndl"] = numexpr.evaluate(f"{nw}/(R*wn)", known)
        known["rdv"] = numexpr.evaluate(f"(2*ndl*q/R - {wv}/wn)/sqrt(x**2 + y**2 + e**2)", known)
        shade = "ka + kd*where(ndl > 0, ndl, 0) + ks*where(rdv > 0, rdv, 0)**n"
        values: FloatArray = numexpr.evaluate(f"where(disc >= 0, {shade}, 0)", known)
        return values

    def renderer(size: int) -> Callable[[], object]:
        return partial(field, *seed.cell_3_grid(size, size, numbers["R"], numbers["e"]))

    return Contestant("numexpr", 1, "no grid, no clip", renderer, field)
