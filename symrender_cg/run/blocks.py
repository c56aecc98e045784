"""`render_blocks`: an image of any height, block of rows by block of rows, at constant memory.

In: the arguments of render_image. Out: (first row, the block's rows) in turn, with the bits of render_image. Of levels
that prove their values each block is proved by itself. Never here: the image as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import ArgumentError
from symrender_cg.run.ready import Ready, make_ready, side
from symrender_cg.run.settled_rows import SettledRows
from symrender_cg.run.threads import thread_count
from symrender_cg.scene import Scene, load_scene

PIXELS_A_BLOCK = 1 << 20
"""Of the blocks that render_blocks makes by default: 8 MB of float64."""


def render_blocks(
    scene: Scene | str | Path | None = None,
    width: int = 256,
    height: int = 256,
    *,
    block_rows: int | None = None,
    accuracy: str = "double",
    target: str | None = None,
    clip: bool = True,
    threads: int | None = None,
    portable: bool = False,
    cache: str | Path | None = None,
) -> Iterator[tuple[int, NDArray[Any]]]:
    """(first_row, rows) of an image, from the top: rows[j] is row first_row + j of render_image, bit for bit.

    rows has shape (block_rows, width), or (block_rows, width, 3) with colours; the last block may have fewer. Each is
    an array of its own, to be kept or dropped. Memory does not grow with the height of the image.

    block_rows   rows of a block; by default as many as a million pixels are

    Other arguments as for render_image, and its errors: those of the arguments at once, not at the first block.
    """
    width, height = side("width", width), side("height", height)
    if block_rows is None:
        block_rows = max(1, PIXELS_A_BLOCK // width)
    elif isinstance(block_rows, bool) or not isinstance(block_rows, int | np.integer) or block_rows < 1:
        raise ArgumentError(f"block_rows: {block_rows!r} is not a number of rows; expected a whole number from 1 up")
    thread_count(threads, 0)
    found = make_ready(
        load_scene(scene),
        width,
        height,
        accuracy,
        target,
        clip=clip,
        portable=portable,
        cache=cache,
        threads=threads,
    )
    return _blocks(found, int(block_rows), threads)


def _blocks(source: Ready | SettledRows, block_rows: int, threads: int | None) -> Iterator[tuple[int, NDArray[Any]]]:
    height = source.shape[0]
    for first in range(0, height, block_rows):
        rows = np.empty((min(block_rows, height - first), *source.shape[1:]), source.dtype)
        source.draw(rows, first, threads=threads)
        yield first, rows
        del rows  # the block that was handed on is not kept while the next one is made
