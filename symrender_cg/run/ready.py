"""`ready`: all that a call of render_image looks up, remembered for a scene that is drawn again.

In: the arguments of render_image. Out: a `Ready`, or `SettledRows` where each value is proved: both draw rows of that
image into any array. A scene is known by its identity: nothing is hashed or compared, so a warm call costs a look
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
from symrender_cg.run.drawing import Drawing
from symrender_cg.run.kernel import rows_are_contiguous
from symrender_cg.run.levels import drawn_as, job_of
from symrender_cg.run.settled_rows import SettledRows
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
            over_rows(self.drawing.onto(rows, first), count, threads, width=width, first=first)
            return
        some = max(1, min(count, MOST_PIXELS // width))
        canvas = np.empty(self.drawing.shape(some, width), self.dtype)
        write: Callable[[int, int], None]
        for begin in range(0, count, some):
            block = rows[begin : begin + some]
            write = self.drawing.onto(canvas, first + begin)
            over_rows(write, len(block), threads, width=width, first=first + begin)
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
    tolerance: float = 0.0,
) -> Ready | SettledRows:
    """The image that these arguments ask for, made ready.

    Raises what render_image raises for its arguments.
    """
    key: tuple[object, ...] | None = None
    if (scene is None or type(scene) is Scene) and type(width) is int and type(height) is int and type(accuracy) is str:
        folder = os.environ.get("SYMRENDER_CACHE_DIR") if cache is None else cache
        key = (id(scene), width, height, accuracy, target, clip, bake, portable, folder, tolerance)
        try:
            found = _kept.get(key)
        except TypeError:  # an argument of no known type, which is refused below
            key = found = None
        if found is not None:
            if isinstance(found, Ready):
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
        tolerance=tolerance,
    )
    if key is not None:
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
    tolerance: float = 0.0,
) -> Ready | SettledRows:
    """The same, looked up or planned by the scene's value, and not remembered here.

    tolerance   how much any pixel may change by what the plan leaves out, where one kernel draws
    """
    job = job_of(
        scene,
        accuracy,
        target,
        clip=clip,
        bake=bake,
        portable=portable,
        cache=cache,
        threads=threads,
        aspect=width / height,
    )
    if job is not None:
        return SettledRows(job, width, height)
    drawn = drawn_as(scene, accuracy)
    drawing = draw(
        scene,
        drawn,
        size=(width, height),
        clip=clip,
        bake=bake,
        portable=portable,
        max_error=tolerance,
        cache=cache,
    )
    shape = shape_of(scene, height, width)
    return Ready(scene, drawing, shape, drawing.dtype, drawing.shape(height, width) == shape)


_kept: dict[tuple[object, ...], Ready | SettledRows] = {}
_guard = Lock()


def _keep(key: tuple[object, ...], made: Ready | SettledRows) -> None:
    with _guard:
        while len(_kept) >= MOST_KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = made


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
