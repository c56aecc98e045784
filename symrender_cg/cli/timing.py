"""A quick measurement of one kernel, enough to say what baking saved. Benchmarks are elsewhere."""

from __future__ import annotations

import math
import time

import numpy as np

from symrender_cg.pipeline import compile_kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.render import pixel_size
from symrender_cg.scene import Scene

SIDE = 256
ROUNDS = 15


def nanoseconds_a_pixel(scene: Scene, accuracy: str, *, bake: bool, portable: bool) -> float:
    """The median time of rendering 256 x 256 pixels on one thread, a pixel, in nanoseconds."""
    kernel = compile_kernel(scene, accuracy, bake=bake, portable=portable)
    frame = scene.in_camera_frame()
    image = np.empty((SIDE, SIDE), kernel.dtype)
    numbers = kernel.numbers(numbers_of(frame))
    times = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        kernel.rows(image, numbers, pixel=pixel_size(frame, SIDE), white=math.inf, begin=0, end=SIDE)
        times.append(time.perf_counter() - begin)
    return sorted(times)[ROUNDS // 2] / (SIDE * SIDE) * 1e9
