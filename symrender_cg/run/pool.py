"""The pool of threads in C (templates/pool/): compiled once beside the kernels, then a call hands it the rows to draw.

In: a kernel's C function bound to an image (`NativeRows`, or whatever else is `Shared`), rows, a number of threads.
Out: the rows drawn; or None in place of the pool, where it cannot be compiled (no pthreads, no compiler, a cache that
cannot be written). Never here: rows that Python draws, see `threads`.
"""

from __future__ import annotations

import os
from abc import abstractmethod
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.build.cache import Cache
from symrender_cg.build.library import Library
from symrender_cg.errors import ArgumentError, LibraryError, ToolchainError
from symrender_cg.resources import template_path
from symrender_cg.run.scratch import scratch

SPIN_VARIABLE = "SYMRENDER_SPIN_MICROSECONDS"
"""How long a thread that has drawn looks out for more before it sleeps; 0: not at all."""

SPIN_MICROSECONDS = 100.0

FLAGS = ("-std=c11", "-pthread")
"""Beside those of kernels: atomics are C11's."""

SPHERE_PIXELS = 1 << 11
"""The least that a thread takes of a kernel of one sphere: some 2 us of work, where taking it costs 0.1."""

SCENE_PIXELS = 1 << 12
"""The same for a kernel of scenes, which makes its lists anew: 1 us for two spheres, a few for a hundred."""


SETTLED_PIXELS = 1 << 12
"""The same for kernels that bound their own error, which do so anew for the rows of a call."""


class Shared:
    """Rows that the threads of the pool can draw; called with (begin, end), it draws them in this thread.

    library       of the kernel: the pool is kept beside it
    least_pixels  the least that a thread takes at a time

    No ABC: every call asks whether its rows are Shared, and a metaclass would take 0.2 us to answer.
    """

    __slots__ = ()
    library: Library
    least_pixels: int

    @abstractmethod
    def share(self, pool: Pool, begin: int, end: int, least: int, threads: int) -> None:
        """Draws rows [begin, end) on so many threads, at least so many rows at a time."""

    def folded(self, begin: int, end: int) -> Shared | None:
        """What draws rows [begin, end) folded in the middle, the first with the last, where that takes less time."""
        return None


class NativeRows(partial[None], Shared):
    """A C function bound to all but the rows [begin, end) that it draws: a call of it runs no Python.

    The arguments are (image, stride, grid, scene), the same without the scene, or (images, image_stride, stride, grids,
    scenes).

    pairs   the C function that draws rows j and height - 1 - j for begin <= j < end, or None
    """

    __slots__ = ("library", "pairs")
    library: Library
    pairs: Any
    least_pixels = SPHERE_PIXELS

    def share(self, pool: Pool, begin: int, end: int, least: int, threads: int) -> None:
        """Draws rows [begin, end) on so many threads, at least so many rows at a time."""
        arguments, function = self.args, self.func
        if self._folds(begin, end):  # as `folded`, without an object for it
            function, end, least = self.pairs, end - end // 2, -(-least // 2)
        entry, addresses, pointer_type = pool.kinds[len(arguments)]
        address = addresses.get(function)
        if address is None:
            address = addresses[function] = pool.library.ffi.cast(pointer_type, function)
        entry(address, *arguments, begin, end, least, threads)

    def _folds(self, begin: int, end: int) -> bool:
        """Whether these rows are the whole image, and the kernel draws it in pairs of rows."""
        return self.pairs is not None and begin == 0 and end == self.args[2].height

    def folded(self, begin: int, end: int) -> NativeRows | None:
        """Rows j and height - 1 - j as one, where rows [begin, end) are the whole image and the kernel has them."""
        if not self._folds(begin, end):
            return None
        rows = NativeRows(self.pairs, *self.args)
        rows.library, rows.pairs = self.library, None
        return rows


class Pool:
    """The loaded pool. Its threads are the process's: there is one, in whichever cache it was found first."""

    def __init__(self, library: Library, spin_microseconds: float, processors: int) -> None:
        self.library = library
        lib = library.lib
        lib.symrender_pool_set(round(1e3 * spin_microseconds), processors)
        # by how many arguments are bound: the pool's function, and kernels' functions as it takes them
        self.kinds: dict[int, tuple[Any, dict[Any, Any], str]] = {
            3: (lib.symrender_pool_baked, {}, "symrender_baked_rows *"),
            4: (lib.symrender_pool_sphere, {}, "symrender_sphere_rows *"),
            5: (lib.symrender_pool_batch, {}, "symrender_batch_rows *"),
        }
        self._listing: dict[Any, Any] = {}

    def listing_rows(
        self,
        function: Any,
        image: Any,
        stride: int,
        grid: Any,
        scene: Any,
        begin: int,
        end: int,
        least: int,
        threads: int,
        width: int,
    ) -> NDArray[np.intp]:
        """Rows of a kernel that lists pixels, row * width + column, and those pixels, in order.

        Raises MemoryError.
        """
        ffi, count = self.library.ffi, end - begin
        known = self._listing.get(function)
        if known is None:
            known = self._listing[function] = ffi.cast("symrender_listing_rows *", function)
        unsettled, found = scratch(count * width), np.zeros(count, dtype=np.intp)
        pointer = ffi.from_buffer
        total = self.library.lib.symrender_pool_listing(
            known,
            image,
            stride,
            grid,
            scene,
            begin,
            end,
            least,
            threads,
            pointer("ptrdiff_t *", unsettled),
            width,
            pointer("ptrdiff_t *", found),
        )
        if total < 0:
            raise MemoryError(f"no memory for rows {begin} to {end} of the image")
        if total == 0:
            return np.empty(0, dtype=np.intp)
        return np.concatenate([unsettled[row * width :][: found[row]] for row in np.flatnonzero(found)])

    def started(self) -> int:
        """Threads that were started."""
        return int(self.library.lib.symrender_pool_started())

    def awake(self) -> int:
        """Threads that draw or look out for rows at this moment."""
        return int(self.library.lib.symrender_pool_awake())


_found: dict[str, Pool | None] = {}


def pool_beside(library: Library) -> Pool | None:
    """The pool, compiled into the cache of that kernel at the first call of the process; None where it cannot be.

    Raises ArgumentError for a time to spin that is none.
    """
    try:
        return _found["pool"]
    except KeyError:
        kernels = library.path.parent.parent
        root = kernels.parent if kernels.name == "kernels" else None
        return _found.setdefault("pool", _load(Cache(root), spin_microseconds()))


def _load(cache: Cache, spin: float) -> Pool | None:
    sources = {name: template_path(f"pool/{name}").read_text(encoding="utf-8") for name in ("pool.c", "pool.h")}
    recipe = f"pool\n{sources['pool.h']}{sources['pool.c']}"
    try:
        known = cache.recall(recipe, extra_flags=FLAGS)
        if known is None and cache.problem() is not None:
            return None
        kernel = cache.kernel(sources, sources["pool.h"], extra_flags=FLAGS) if known is None else known[0]
        if known is None:
            cache.remember(recipe, kernel, None)
        library = cache.load(kernel)
        # never closed, not at the end of the process either: a thread that looks out runs in it
        library.ffi.dlopen(str(library.path), os.RTLD_NOW | os.RTLD_NODELETE)
        return Pool(library, spin, processors())
    except (ToolchainError, LibraryError, OSError):
        return None


def spin_microseconds() -> float:
    """As SYMRENDER_SPIN_MICROSECONDS says. Raises ArgumentError where it is no number from 0 up."""
    text = os.environ.get(SPIN_VARIABLE, "").strip()
    try:
        value = float(text) if text else SPIN_MICROSECONDS
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1e9:
        raise ArgumentError(f"{SPIN_VARIABLE}: {text!r} is no time; expected microseconds from 0 up, such as 100")
    return value


def processors() -> int:
    """Processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
