"""Rows over threads: blocks of rows, taken in turn by the caller and by a pool that lives as long as the process.

The kernel releases the GIL, rows do not depend on one another, so any number of threads gives the same bits.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from threading import Lock

from symrender_cg.errors import ArgumentError

PIXELS_A_THREAD = 1 << 16
"""Below this many pixels a thread costs more than it brings; the default number of threads grows with it."""

_BLOCKS_A_THREAD = 4


def thread_count(threads: int | None, pixels: int) -> int:
    """How many threads to use: as asked, or by default one for every 65,536 pixels up to the processors at hand."""
    if threads is None:
        return max(1, min(_processors(), pixels // PIXELS_A_THREAD))
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise ArgumentError(f"threads: {threads!r} is not a number of threads; expected a whole number from 1 up")
    return threads


def over_rows(render: Callable[[int, int], None], height: int, threads: int) -> None:
    """Calls render(begin, end) for blocks of rows that cover [0, height), on that many threads with the caller's.

    A thread of the pool that wakes late finds nothing left to do, and is not waited for.
    """
    if threads == 1 or height == 1:
        render(0, height)
        return
    blocks = min(height, threads * _BLOCKS_A_THREAD)
    ends = [height * k // blocks for k in range(blocks + 1)]
    turns = iter(pairwise(ends))
    lock = Lock()

    def work() -> None:
        while True:
            with lock:
                turn = next(turns, None)
            if turn is None:
                return
            render(*turn)

    futures = [_pool(threads - 1).submit(work) for _ in range(threads - 1)]
    try:
        work()
    finally:
        for future in futures:
            if not future.cancel():
                future.result()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="symrender_cg")


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
