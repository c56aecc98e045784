"""`render_batch`: many sets of parameters -> one array of images, without a return to Python between them.

In: a scene, what changes from set to set, a size. Out: an array (count, height, width), or (count, height, width, 3).
Sets in a row that one kernel of one sphere draws are one call of it, whose rows the threads share; a set that calls for
another kernel, or for stages that prove its values, is drawn by itself. Every image has the bits of render_image.
Never here: a plan, or a check of a scene's numbers.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock, get_ident
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import pixel_size
from symrender_cg.run.alike import inputs_of, inputs_of_scenes, rows_alike
from symrender_cg.run.certify import Job, settle_image
from symrender_cg.run.kernel import GRID, Kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.parameters import Parameters, Sets, parameter_sets
from symrender_cg.run.ready import Ready, checked_out, make_ready, rows_are_contiguous, shape_of, side
from symrender_cg.run.threads import over_rows, thread_count
from symrender_cg.scene import Scene, load_scene

Progress = Callable[[int, int], object]

MOST_SETS = 4096
"""Sets whose numbers are made ready before they are drawn."""

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
    dtype = np.dtype(variant(accuracy, target).result)
    images = np.empty(shape, dtype) if out is None else checked_out(out, shape, dtype, "count, height, width")
    thread_count(threads, 0)
    batch = _Batch(sets, images, accuracy, target, clip, threads, portable, cache, _Tell(progress, sets.count))
    first = 0
    while first < sets.count:
        first = batch.draw(first)
        batch.tell.done(first)
    batch.tell.all_done()
    return images


@dataclass
class _Tell:
    """Passes on how much is done, at a bounded rate."""

    progress: Progress | None
    total: int
    last: float = field(default_factory=time.monotonic)

    def done(self, count: int) -> None:
        if self.progress is None or count >= self.total:
            return
        now = time.monotonic()
        if now - self.last >= SECONDS_BETWEEN:
            self.last = now
            self.progress(count, self.total)

    def all_done(self) -> None:
        if self.progress is not None:
            self.progress(self.total, self.total)


@dataclass(frozen=True)
class _Run:
    """Consecutive sets that one call of one kernel draws."""

    kernel: Kernel
    numbers: NDArray[np.float64]
    pixels: NDArray[np.float64]


@dataclass(frozen=True)
class _Batch:
    sets: Sets
    images: NDArray[Any]
    accuracy: str
    target: str | None
    clip: bool
    threads: int | None
    portable: bool
    cache: str | Path | None
    tell: _Tell

    def draw(self, first: int) -> int:
        """Draws some sets, from that one on. The first one that is left."""
        runs: list[_Run] = []
        end, begun = first, time.monotonic()
        while end < min(self.sets.count, first + MOST_SETS):
            found = self._made(end)
            run = self._run(found, end)
            if run is None or (runs and run.kernel is not runs[0].kernel):
                break
            runs.append(run)
            end += len(run.pixels)
            if time.monotonic() - begun > SECONDS_BETWEEN:
                break
        if runs:
            self._draw_runs(runs, first, end)
            return end
        if isinstance(found, Job):
            height, width = self.images.shape[1:3]
            self.images[first] = settle_image(found, width, height).values
        else:
            found.draw(self.images[first], threads=self.threads)
        return first + 1

    def _made(self, index: int) -> Ready | Job:
        height, width = self.images.shape[1:3]
        return make_ready(
            self.sets.scene(index),
            width,
            height,
            self.accuracy,
            self.target,
            clip=self.clip,
            threads=self.threads,
            portable=self.portable,
            cache=self.cache,
        )

    def _run(self, found: Ready | Job, first: int) -> _Run | None:
        """The sets from the first on that the first one's kernel surely draws; None where it draws one at a time."""
        if isinstance(found, Job) or not isinstance(found.drawing.kernel, Kernel) or not found.direct:
            return None
        if not rows_are_contiguous(self.images):
            return None
        drawing, kernel, height = found.drawing, found.drawing.kernel, self.images.shape[1]
        last = first + MOST_SETS
        if self.sets.scenes:
            inputs = inputs_of_scenes(self.sets.scenes[first:last])
        else:
            inputs = inputs_of({path: column[first:last] for path, column in self.sets.columns.items()})
        if inputs:
            numbers, half_heights = rows_alike(found.scene, drawing.plan, inputs, self.accuracy, kernel.inputs)
            return _Run(kernel, numbers, 2.0 * half_heights / height)
        values = numbers_of(drawing.plan.scene)
        pixel = pixel_size(drawing.plan.scene, height)
        return _Run(kernel, np.array([[values[name] for name in kernel.inputs]]), np.array([pixel]))

    def _draw_runs(self, runs: list[_Run], first: int, end: int) -> None:
        _, height, width = self.images.shape
        images, numbers = self.images[first:end], np.concatenate([run.numbers for run in runs])
        grids = np.empty(end - first, GRID)
        grids["width"], grids["height"] = width, height
        grids["pixel"] = np.concatenate([run.pixels for run in runs])
        grids["white"] = 1.0 if self.clip else np.inf
        render = runs[0].kernel.onto_many(images, numbers, grids)
        rows = (end - first) * height
        threads = thread_count(self.threads, rows * width)
        over_rows(render if self.tell.progress is None else self._told(render, first), rows, threads, width=width)

    def _told(self, render: Callable[[int, int], object], first: int) -> Callable[[int, int], None]:
        """The same, that tells after a block of the caller how many images' worth of rows are done."""
        caller, guard, height, done = get_ident(), Lock(), self.images.shape[1], [0]

        def told(begin: int, end: int) -> None:
            render(begin, end)
            with guard:
                done[0] += end - begin
            if get_ident() == caller:
                self.tell.done(first + done[0] // height)

        return told
