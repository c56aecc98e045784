"""Rows over threads: a kernel's own rows by the pool in C, all others in blocks by threads of Python that sleep between
calls.

In: a function that draws rows [begin, end) and releases the GIL, a number of rows, a number of threads. Out: every row
drawn once. Rows do not depend on one another, so any number of threads gives the same bits.
Never here: what a row is, a process, a wait for a thread that has not begun.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from functools import cache, lru_cache
from threading import Lock, Thread

from symrender_cg.errors import ArgumentError
from symrender_cg.run.pool import Shared, pool_beside, processors

PIXELS_A_THREAD = 1 << 16
"""Below this many pixels a thread costs more than it brings; the default number of threads grows with it."""

LEAST_PIXELS = 1 << 13
"""A block has at least so many pixels where the width is known: some 20 us of work, many times what taking it costs."""

MOST_BLOCKS = 32
"""About so many blocks a thread: a kernel of a scene makes lists of its spheres for each."""

MOST_PIXELS = 1 << 21
"""A block has no more pixels than this, also on one thread: what a kernel notes beside the image stays small."""

LEAST_TURNS = 4
"""Rows that threads take in fewer turns than this are not worth a word to another thread, let alone waking it."""

MOST_ROUNDS = 4
"""The pool in C is given at most so many times MOST_PIXELS at a time; in between an interrupt is seen."""

MOST_ROWS = (1 << 31) - 1
"""The pool in C counts rows as its kernels do."""

Render = Callable[[int, int], object]


def thread_count(threads: int | None, pixels: int) -> int:
    """How many threads to use: as asked, or by default one for every 65,536 pixels up to the processors at hand."""
    if threads is None:
        return 1 if pixels < 2 * PIXELS_A_THREAD else max(1, min(processors(), pixels // PIXELS_A_THREAD))
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise ArgumentError(f"threads: {threads!r} is not a number of threads; expected a whole number from 1 up")
    return threads


def over_rows(render: Render, height: int, threads: int, *, width: int = 1, first: int = 0) -> None:
    """Calls render(begin, end) for blocks of rows that cover [first, first + height), on that many threads with the
    caller's.

    A kernel's own rows are drawn by the pool in C (`pool`), everything else by threads of Python. Blocks shrink towards
    the end, so that all end together. A thread that wakes late finds nothing left to do, and is not waited for. The
    first error of any thread is raised in the caller, when no thread draws any more; blocks that nobody has begun are
    then left out.
    """
    pixels = height * width
    if threads == 1 and pixels <= MOST_PIXELS:
        render(first, first + height)
        return
    if pixels > MOST_PIXELS and isinstance(render, Shared):
        folded = render.folded(first, first + height)
        if folded is not None:
            render, height, width = folded, height - height // 2, 2 * width
    if threads > 1 and first + height <= MOST_ROWS and isinstance(render, Shared):
        if pixels < LEAST_TURNS * render.least_pixels:
            render(first, first + height)
            return
        found = pool_beside(render.library)
        if found is not None:
            least = -(-render.least_pixels // width)
            if pixels <= MOST_PIXELS:
                render.share(found, first, first + height, least, threads)
                return
            some = max(1, min(threads, MOST_ROUNDS) * MOST_PIXELS // width)
            for begin in range(first, first + height, some):
                render.share(found, begin, min(begin + some, first + height), min(some, least), threads)
            return
    turns = block_ends(height, width, threads)
    if first:
        turns = tuple((first + begin, first + end) for begin, end in turns)
    if threads == 1 or len(turns) == 1:
        for begin, end in turns:
            render(begin, end)
        return
    _Work(render, turns).share(min(threads, len(turns)) - 1)


@lru_cache(maxsize=256)
def block_ends(height: int, width: int, threads: int) -> tuple[tuple[int, int], ...]:
    """(begin, end) of blocks of rows: each a fair share of a fourth of what is left, the last ones of a least size.

    Guided self-scheduling, Polychronopoulos and Kuck 1987.
    """
    most = max(1, MOST_PIXELS // width)
    least = min(most, max(1, height // (threads * MOST_BLOCKS), -(-LEAST_PIXELS // width) if width > 1 else 1))
    blocks, row = [], 0
    while row < height:
        share = most if threads == 1 else min(most, max(least, (height - row) // (4 * threads)))
        end = min(height, row + share)
        blocks.append((row, end))
        row = end
    return tuple(blocks)


class _Work:
    """One call's blocks, and who is at them."""

    __slots__ = ("failure", "last", "render", "running", "turns")

    def __init__(self, render: Render, turns: tuple[tuple[int, int], ...]) -> None:
        self.render = render
        self.turns = deque(turns)
        self.running = 0
        self.failure: BaseException | None = None
        self.last: Lock | None = None  # released by the last thread that is at a block, when the caller waits for it

    def share(self, others: int) -> None:
        """Draws everything, with so many other threads."""
        pool = _pool()
        workers = pool.call(self, others)
        try:
            self.draw()
        finally:
            self.turns.clear()
            pool.dismiss(self, workers)
        if self.failure is not None:
            raise self.failure

    def draw(self) -> None:
        """Takes blocks until there are none; any thread."""
        take, render = self.turns.popleft, self.render
        while True:
            try:
                begin, end = take()
            except IndexError:
                return
            render(begin, end)


class _Worker:
    """A thread that sleeps until it is given work. `wake` is unlocked while it has been called and has not looked."""

    __slots__ = ("pool", "wake", "work")

    def __init__(self, pool: _Pool, work: _Work) -> None:
        self.pool = pool
        self.work: _Work | None = work
        self.wake = Lock()
        Thread(target=self._serve, name="symrender_cg", daemon=True).start()

    def _serve(self) -> None:
        while True:
            self.wake.acquire()
            work = self.pool.begun(self)
            if work is None:
                continue
            try:
                work.draw()
            except BaseException as problem:  # the caller raises it
                work.failure = work.failure or problem
                work.turns.clear()
            self.pool.ended(self, work)
            del work  # not kept, nor its image, while this thread sleeps


class _Pool:
    """Threads that sleep. A worker is idle, or called (it has work), or at it (it has taken its work)."""

    def __init__(self) -> None:
        self._guard = Lock()
        self._idle: list[_Worker] = []

    def call(self, work: _Work, count: int) -> list[_Worker]:
        """Wakes so many workers for the work, starting what is missing; fewer where no thread can be started."""
        with self._guard:
            called = [self._idle.pop() for _ in range(min(count, len(self._idle)))]
        for worker in called:
            worker.work = work
            if worker.wake.locked():
                worker.wake.release()
        while len(called) < count:
            try:
                called.append(_Worker(self, work))
            except RuntimeError:  # the system gives no more threads
                break
        return called

    def begun(self, worker: _Worker) -> _Work | None:
        """The worker's work, which it is at from now on; None where the caller has done without it."""
        with self._guard:
            work, worker.work = worker.work, None
            if work is not None:
                work.running += 1
            return work

    def ended(self, worker: _Worker, work: _Work) -> None:
        """The worker is idle; the caller goes on if it waits for nobody else."""
        with self._guard:
            self._idle.append(worker)
            work.running -= 1
            if work.running == 0 and work.last is not None:
                work.last.release()

    def dismiss(self, work: _Work, called: list[_Worker]) -> None:
        """Waits for those who are at the work; the others become idle."""
        with self._guard:
            for worker in called:
                if worker.work is work:
                    worker.work = None
                    self._idle.append(worker)
            if work.running == 0:
                return
            work.last = Lock()
            work.last.acquire()
        try:
            work.last.acquire()
        except BaseException:  # an interrupt: the image is still being written to
            work.last.acquire()
            raise


@cache
def _pool() -> _Pool:
    return _Pool()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
