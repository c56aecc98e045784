"""What the cells of the walk share: `Lab`, what goes into a cell; `Finding`, what comes out; and how times are taken.

Never done here: a cell.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from chapter1_walk.pictures import Gallery
from symrender_cg import Scene, compile_kernel, render_image
from symrender_cg.derive.seed import SeedImage

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the table: a cell, what was looked at, what the seed says of it, and what was measured."""

    cell: int
    key: str
    what: str
    seed_says: str
    value: Any
    shown: str = ""


@dataclass(frozen=True, slots=True)
class Lab:
    """What the cells share: the scene, the image's side, its grid, the seed's derivation, the per-pixel image."""

    scene: Scene
    size: int
    x: FloatArray
    y: FloatArray
    seed: SeedImage
    per_pixel: FloatArray
    gallery: Gallery
    console: Console


def ns_of_kernel(scene: Scene, side: int, accuracy: str, *, bake: bool = False) -> float:
    """Nanoseconds a pixel of `render_image` on one thread into an array that is there."""
    out = np.empty((side, side), compile_kernel(scene, accuracy, bake=bake).dtype)
    render = partial(render_image, scene, side, side, accuracy=accuracy, bake=bake, out=out, threads=1)
    return ns_a_pixel(render, side, 20)


def ns_a_pixel(render: Callable[[], Any], side: int, rounds: int = 3) -> float:
    """Nanoseconds a pixel of a square image: the median over the rounds."""
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        render()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds) / side**2 * 1e9
