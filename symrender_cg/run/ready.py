"""`ready`: all that a call of render_image looks up, remembered for a scene that is drawn again.

In: the arguments of render_image. Out: a `Ready`, which draws rows of that image into any array, or the `Job` of what
is proved value by value. A scene is known by its identity: nothing is hashed or compared, so a warm call costs a look
into a dictionary, of however many spheres the scene is. Never here: an image.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import Variant
from symrender_cg.pipeline import draw, note, statistics
from symrender_cg.run.certify import Job
from symrender_cg.run.drawing import Drawing
from symrender_cg.run.levels import drawn_as, job_of
from symrender_cg.run.threads import MOST_PIXELS, over_rows, thread_count
from symrender_cg.scene import Scene, load_scene

MOST_KEPT = 8
"""Images that are remembered: the tables of a scene of 100,000 spheres take tens of megabytes."""

LARGEST_SIDE = 1 << 24


@dataclass(frozen=True, eq=False)
class Ready:
    """An image that only has to be drawn.

    scene      that of the call, kept so that its identity is no other's
    shape      (height, width) or (height, width, 3), what the user sees
    direct     whether the kernel's own array has that shape; else its grey values go to three channels
    """

    scene: Scene
    drawing: Drawing
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    direct: bool

    def draw(self, rows: NDArray[Any], first: int = 0, *, threads: int | None = None) -> None:
        """Writes as many rows of the image as the array has, from row `first` on; any strides."""
        count, width = rows.shape[:2]
        threads = thread_count(threads, count * width)
        if self.direct and rows_are_contiguous(rows, self.drawing.channels):
            _draw(self.drawing.onto(rows, first), first, count, width, threads)
            return
        some = max(1, min(count, MOST_PIXELS // width))
        canvas = np.empty(self.drawing.shape(some, width), self.dtype)
        write: Callable[[int, int], None]
        for begin in range(0, count, some):
            block = rows[begin : begin + some]
            write = self.drawing.onto(canvas, first + begin)
            _draw(write, first + begin, len(block), width, threads)
            block[...] = canvas[: len(block)] if self.direct else canvas[: len(block), :, np.newaxis]


def ready(
    scene: Scene | str | Path | None,
    width: int,
    height: int,
    *,
    accuracy: str | Variant,
    target: str | None,
    clip: bool,
    bake: bool,
    portable: bool,
    cache: str | Path | None,
    threads: int | None,
) -> Ready | Job:
    """The image that these arguments ask for, made ready, or the job of their level.

    Raises what render_image raises for its arguments.
    """
    key: tuple[object, ...] | None = None
    if (scene is None or type(scene) is Scene) and type(width) is int and type(height) is int and type(accuracy) is str:
        folder = os.environ.get("SYMRENDER_CACHE_DIR") if cache is None else cache
        key = (id(scene), width, height, accuracy, target, clip, bake, portable, folder)
        try:
            found = _kept.get(key)
        except TypeError:  # an argument of no known type, which is refused below
            key = found = None
        if found is not None:
            note(found.drawing.plan)
            statistics.add("reused")
            return found
    width, height = side("width", width), side("height", height)
    made = make_ready(
        load_scene(scene),
        width,
        height,
        accuracy,
        target,
        clip=clip,
        bake=bake,
        portable=portable,
        cache=cache,
        threads=threads,
    )
    if key is not None and isinstance(made, Ready):
        _keep(key, made)
    return made


def make_ready(
    scene: Scene,
    width: int,
    height: int,
    accuracy: str | Variant,
    target: str | None = None,
    *,
    clip: bool,
    bake: bool = False,
    portable: bool = False,
    cache: str | Path | None = None,
    threads: int | None = None,
) -> Ready | Job:
    """The same, looked up or planned by the scene's value, and not remembered here."""
    job = job_of(scene, accuracy, target, clip=clip, bake=bake, portable=portable, cache=cache, threads=threads)
    if job is not None:
        return job
    drawn = drawn_as(scene, accuracy)
    drawing = draw(scene, drawn, size=(width, height), clip=clip, bake=bake, portable=portable, cache=cache)
    shape = shape_of(scene, height, width)
    return Ready(scene, drawing, shape, drawing.dtype, drawing.shape(height, width) == shape)


_kept: dict[tuple[object, ...], Ready] = {}
_guard = Lock()


def _keep(key: tuple[object, ...], made: Ready) -> None:
    with _guard:
        while len(_kept) >= MOST_KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = made


def _draw(write: Callable[[int, int], None], first: int, count: int, width: int, threads: int) -> None:
    if first == 0:
        over_rows(write, count, threads, width=width)
    else:
        over_rows(lambda begin, end: write(first + begin, first + end), count, threads, width=width)


def shape_of(scene: Scene, *points: int) -> tuple[int, ...]:
    """The shape of a scene's intensities at an array of points of that shape."""
    channels = _channels(scene)
    return points if channels == 1 else (*points, channels)


@lru_cache(maxsize=256)
def _channels(scene: Scene) -> int:
    return scene.channels


def side(name: str, value: int) -> int:
    """A width or a height, checked."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 1 <= value <= LARGEST_SIDE:
        raise ArgumentError(
            f"{name}: {value!r} is not a number of pixels; expected a whole number from 1 to {LARGEST_SIDE}"
        )
    return int(value)


def checked_out(
    out: NDArray[Any], shape: tuple[int, ...], dtype: np.dtype[Any], words: str = "height, width"
) -> NDArray[Any]:
    """`out`, if it is an array of that shape and dtype that can be written to; `words` name the shape's axes."""
    if not isinstance(out, np.ndarray):
        raise ArgumentError(f"out: expected a numpy array of shape {shape} and dtype {dtype}, not {type(out).__name__}")
    if out.shape != shape:
        axes = words if len(shape) == words.count(",") + 1 else f"{words}, 3"
        raise ArgumentError(f"out: has shape {out.shape}; expected ({axes}) = {shape}")
    if out.dtype != dtype:
        raise ArgumentError(f"out: has dtype {out.dtype}; this accuracy writes {dtype}")
    if not out.flags.writeable:
        raise ArgumentError("out: is read-only; pass an array that can be written to")
    return out


def rows_are_contiguous(image: NDArray[Any], channels: int = 1) -> bool:
    """Whether a kernel can write to an image, or to many: contiguous rows, whole numbers of values apart, aligned."""
    item, strides = image.itemsize, image.strides
    steps = (item,) if channels == 1 else (item * channels, item)
    if strides[-len(steps) :] != steps or not image.flags.aligned:
        return False
    return strides[0] % item == 0 and strides[1] % item == 0
