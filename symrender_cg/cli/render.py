"""`render`: a scene -> an image file, with a progress bar where it takes longer than a second.

On a warm start: no sympy, no templates, no rich.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.cli.console import Column, Table, duration
from symrender_cg.errors import ArgumentError
from symrender_cg.output import image_format, write_image
from symrender_cg.pipeline import compile_kernel, statistics
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.render import evaluate, pixel_size
from symrender_cg.run.threads import over_rows, thread_count
from symrender_cg.scene import Scene, load_scene

BAR_AFTER_SECONDS = 1.0
PIXELS_A_BLOCK = 1 << 20


def run(arguments: argparse.Namespace) -> int:
    """Renders, writes, and says what was written in one line."""
    if arguments.list:
        return _list_scenes()
    if arguments.output is None:
        raise ArgumentError("-o FILE is missing: where should the image go? expected a .png, .npy or .pfm file")
    target = Path(arguments.output)
    form = image_format(target, bits=arguments.bits, encoding=arguments.encoding)
    if arguments.no_clip and not form.keeps_field:
        raise ArgumentError(f"--no-clip: a {form.suffix} cannot hold intensities above 1; write a .npy or .pfm")
    if target.is_dir() or not target.parent.is_dir():
        raise ArgumentError(
            f"{target}: {'is a folder' if target.is_dir() else 'its folder does not exist'}; expected a file's name in "
            "a folder that exists"
        )
    width, height = arguments.size
    scene = load_scene(arguments.scene)
    begin = time.perf_counter()
    try:
        with Progress(height) as progress:
            values, kernel = render_in_blocks(
                scene,
                width,
                height,
                accuracy=arguments.accuracy,
                clip=not arguments.no_clip,
                threads=arguments.threads,
                portable=arguments.portable,
                backend=arguments.backend,
                rows_done=progress.rows_done,
            )
            seconds = time.perf_counter() - begin
            progress.writing(target.name)
            write_image(target, values, bits=arguments.bits, encoding=arguments.encoding)
    except MemoryError:
        raise ArgumentError(
            f"--size {width}x{height}: this image does not fit into memory; render a smaller one"
        ) from None
    print(f"{target}: {width} x {height}, {form}; {arguments.accuracy}, {kernel}, rendered in {duration(seconds)}")
    return 0


def render_in_blocks(
    scene: Scene,
    width: int,
    height: int,
    *,
    accuracy: str,
    clip: bool,
    threads: int | None,
    portable: bool,
    backend: str,
    rows_done: Callable[[int], None],
) -> tuple[NDArray[Any], str]:
    """The image of render_image, bit for bit, made block by block of rows, and where its kernel came from, in words.

    `rows_done` is called with the number of rows of each block that is finished.
    """
    rows = max(1, PIXELS_A_BLOCK // width)
    frame = scene.in_camera_frame()
    if backend == "numpy":
        return _by_numpy(frame, width, height, rows, accuracy, clip, rows_done), "numpy"
    compiled, derived = statistics.compiled, statistics.derived
    kernel = compile_kernel(scene, accuracy, portable=portable)
    origin = "just derived" if statistics.derived > derived else "from the cache"
    origin += " and compiled" if statistics.compiled > compiled else ""
    image = np.empty((height, width), kernel.dtype)
    numbers = kernel.numbers(numbers_of(frame))
    pixel, white = pixel_size(frame, height), 1.0 if clip else math.inf
    for first in range(0, height, rows):
        last = min(first + rows, height)

        def some(begin: int, end: int, first: int = first) -> None:
            kernel.rows(image, numbers, pixel=pixel, white=white, begin=first + begin, end=first + end)

        over_rows(some, last - first, thread_count(threads, (last - first) * width))
        rows_done(last - first)
    return image, f"{kernel.name} {origin}"


def _by_numpy(
    frame: Scene, width: int, height: int, rows: int, accuracy: str, clip: bool, rows_done: Callable[[int], None]
) -> NDArray[Any]:
    from symrender_cg.reference.points import pixel_centres

    x, y = pixel_centres(frame, width, height)
    image = np.empty((height, width), np.float32 if accuracy == "single" else np.float64)
    for first in range(0, height, rows):
        block = y[first : first + rows, np.newaxis]
        image[first : first + rows] = evaluate(
            frame, x[np.newaxis, :], block, accuracy=accuracy, clip=clip, backend="numpy"
        )
        rows_done(block.size)
    return image


class Progress:
    """A bar on stderr over the rows of an image; it appears after a second, and only on a terminal."""

    def __init__(self, rows: int) -> None:
        self._rows = rows
        self._done = 0
        self._begin = time.perf_counter()
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def rows_done(self, count: int) -> None:
        """Counts finished rows."""
        self._done += count
        if self._appears():
            self._bar.update(self._task, completed=self._done)

    def writing(self, name: str) -> None:
        """From here on the file is written."""
        if self._appears():
            self._bar.update(self._task, description=f"writing {name}", completed=self._rows)

    def _appears(self) -> bool:
        if self._bar is None and time.perf_counter() - self._begin > BAR_AFTER_SECONDS and sys.stderr.isatty():
            from rich import progress
            from rich.console import Console

            columns = (
                progress.TextColumn("{task.description}"),
                progress.BarColumn(),
                progress.TextColumn("{task.completed} of {task.total} rows"),
                progress.TimeRemainingColumn(),
            )
            self._bar = progress.Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task("rendering", total=self._rows, completed=self._done)
            self._bar.start()
        return self._bar is not None


def _list_scenes() -> int:
    from symrender_cg.scene.builtin import builtin_description, builtin_names

    table = Table((Column("scene"), Column("what it shows")))
    for name in builtin_names():
        table.add(name, builtin_description(name))
    table.show()
    return 0
