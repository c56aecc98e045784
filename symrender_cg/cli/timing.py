"""Quick measurements of drawings, side by side: enough to say what baking or an effect costs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from symrender_cg.pipeline import draw
from symrender_cg.run.drawing import Drawing
from symrender_cg.scene import Scene

SIDE = 256
ROUNDS = 15


def nanoseconds_a_pixel(scene: Scene, accuracy: str, *, bake: bool, portable: bool) -> float:
    """The median time of rendering 256 x 256 pixels on one thread, a pixel, in nanoseconds."""
    drawing = draw(scene, accuracy, size=(SIDE, SIDE), bake=bake, portable=portable)
    (median,) = interleaved_medians([drawing], (SIDE, SIDE), rounds=ROUNDS)
    return median / (SIDE * SIDE) * 1e9


def interleaved_medians(
    drawings: Sequence[Drawing], size: tuple[int, int], *, rounds: int, done: Callable[[], None] = lambda: None
) -> list[float]:
    """Median seconds of one image of width x height on one thread, each drawing once a round, in turn.

    `done` is called after every round.
    """
    width, height = size
    images = [np.empty(drawing.shape(height, width), drawing.dtype) for drawing in drawings]
    times: list[list[float]] = [[] for _ in drawings]
    for _ in range(rounds):
        for drawing, image, spent in zip(drawings, images, times, strict=True):
            begin = time.perf_counter()
            drawing.rows(image, 0, height)
            spent.append(time.perf_counter() - begin)
        done()
    return [sorted(spent)[len(spent) // 2] for spent in times]
