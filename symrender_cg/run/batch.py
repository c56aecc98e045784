"""`render_batch`: many sets of parameters -> one array of images, without a return to Python between them.

In: a scene, what changes from set to set, a size. Out: an array (count, height, width), or (count, height, width, 3).
Sets are made ready in chunks of bounded memory and drawn lot by lot: a lot is one call of one kernel, whose rows the
threads share. Every image has the bits of render_image.
Never here: a plan, a choice of kernels, or a check of a scene's numbers.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from threading import Lock, get_ident
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.lower.variants import variant
from symrender_cg.run.certificate import Job
from symrender_cg.run.chunks import Asked, Waiting, make_chunk
from symrender_cg.run.parameters import Parameters, parameter_sets
from symrender_cg.run.ready import checked_out, shape_of, side
from symrender_cg.run.target import Rows, Target
from symrender_cg.run.threads import thread_count
from symrender_cg.scene import Scene, load_scene

Progress = Callable[[int, int], object]

SECONDS_BETWEEN = 0.1
"""`progress` is called at most so often, and sets are made ready for no longer before they are drawn."""


def render_batch(
    scene: Scene | str | Path | None,
    parameters: Parameters,
    width: int = 256,
    height: int = 256,
    *,
    accuracy: str = "double",
    target: str | None = None,
    clip: bool = True,
    out: NDArray[Any] | None = None,
    threads: int | None = None,
    portable: bool = False,
    cache: str | Path | None = None,
    progress: Progress | None = None,
) -> NDArray[Any]:
    """The images of many sets of parameters: shape (count, height, width), or (count, height, width, 3) with colours.

    Image k has the bits of render_image for set k.

    parameters   a mapping of paths in the scene to arrays of one value a set, such as
                     {"lights.0.position": (count, 3), "spheres.0.radius": (count,)},
                 or a sequence of scenes, which then need nothing of `scene`
    out          array of that shape and dtype to write into, a numpy.memmap for one larger than memory; any strides
    threads      threads over the rows of all images; any number gives the same bits
    progress     called as progress(done, total) in images, about ten times a second and at the end, in the thread that
                 called; an error that it raises ends the batch, and is raised here

    Other arguments as for render_image. Raises ArgumentError for parameters that do not fit the scene, SceneError with
    the number of the set for one that has no image, and what render_image raises.
    """
    width, height = side("width", width), side("height", height)
    sets = parameter_sets(load_scene(scene), parameters)
    shape = (sets.count, *shape_of(sets.scene(0), height, width))
    chosen = variant(accuracy, target)
    dtype = np.dtype(chosen.result)
    images = np.empty(shape, dtype) if out is None else checked_out(out, shape, dtype, "count, height, width")
    thread_count(threads, 0)
    tell = _Tell(progress, sets.count, height)
    asked = Asked(sets, width, height, accuracy, target, clip, threads, portable, cache)
    job = Job(sets.base, chosen if chosen.settles else variant("stable"), clip, portable, cache, threads)
    waiting, done = Waiting(deque(range(sets.count))), 0
    while waiting.sets:
        chunk = make_chunk(asked, waiting, SECONDS_BETWEEN)
        onto = Target(images, job, threads, partial(chunk.scene, sets), tell.told)
        for lot in chunk.lots.values():
            lot.draw(onto)
            done += len(lot.sets)
            tell.done(done)
    tell.all_done()
    return images


@dataclass
class _Tell:
    """Passes on how much is done, at a bounded rate."""

    progress: Progress | None
    total: int
    height: int
    rows: int = 0
    last: float = field(default_factory=time.monotonic)
    guard: Lock = field(default_factory=Lock)

    def done(self, count: int) -> None:
        """So many images are done."""
        self.rows = count * self.height
        self._tell()

    def told(self, render: Rows) -> Rows:
        """What draws rows, made to tell, after a block of the caller, how many images' worth of rows are done."""
        if self.progress is None:
            return render
        caller = get_ident()

        def told(begin: int, end: int) -> None:
            render(begin, end)
            with self.guard:
                self.rows += end - begin
            if get_ident() == caller:
                self._tell()

        return told

    def _tell(self) -> None:
        count = self.rows // self.height
        if self.progress is None or count >= self.total:
            return
        now = time.monotonic()
        if now - self.last >= SECONDS_BETWEEN:
            self.last = now
            self.progress(count, self.total)

    def all_done(self) -> None:
        """Everything is."""
        if self.progress is not None:
            self.progress(self.total, self.total)
