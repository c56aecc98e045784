"""`Target`: where a batch is drawn, and how.

In: an array of images, a level, threads; from a lot, what draws rows. Out: rows drawn on the threads, into the images
or through memory where a kernel cannot write to them, and values of the pixels that a kernel left open.
Never here: a plan, or a kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import AccuracyError, OutsidePlanError, SceneError
from symrender_cg.run.certificate import Job
from symrender_cg.run.certify import settle_by_oracle
from symrender_cg.run.kernel import GRID, rows_are_contiguous
from symrender_cg.run.settling_many import enclosed_many
from symrender_cg.run.threads import MOST_PIXELS, over_rows, thread_count
from symrender_cg.scene import Scene

Places = NDArray[np.intp]
Rows = Callable[[int, int], object]
Images = Sequence[NDArray[Any]] | NDArray[Any]
Ask = Callable[[int, Job, Places], tuple[Places, NDArray[Any]]]
"""(number of an image, its job, pixels of it) -> those that are known, and their values (pixels, channels)."""


@dataclass(frozen=True, eq=False)
class Target:
    """Where a batch is drawn, and how.

    images    (count, height, width) or (count, height, width, 3)
    job       of the level, whose scene is to be replaced: what is left open is settled by it
    scene     the scene of a set
    told      makes of what draws rows one that tells how many rows are done
    """

    images: NDArray[Any]
    job: Job
    threads: int | None
    scene: Callable[[int], Scene]
    told: Callable[[Rows], Rows]

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of an image."""
        height, width = self.images.shape[1:3]
        return height, width

    def grids(self, pixels: NDArray[np.float64]) -> NDArray[Any]:
        """The grids of images whose pixels have these sides."""
        found = np.empty(len(pixels), GRID)
        found["height"], found["width"] = self.size
        found["pixel"], found["white"] = pixels, self.job.white
        return found

    def draw(self, rows: Rows, count: int) -> None:
        """Draws the rows of so many images on the threads."""
        self._over_rows(self.told(rows), count)

    def left_open(self, rows: Callable[[int, int], Places], count: int, *, again: bool = False) -> dict[int, Places]:
        """The same of rows that return what they leave open; by image, pixels row * width + column in their order.

        again: these rows were drawn before, and told of.
        """
        found: list[Places] = []

        def collected(begin: int, end: int) -> None:
            found.append(rows(begin, end))

        self._over_rows(collected if again else self.told(collected), count)
        every = np.sort(np.concatenate(found))
        if not every.size:
            return {}
        pixels = self.size[0] * self.size[1]
        which, begins = np.unique(every // pixels, return_index=True)
        return {
            int(image): part - int(image) * pixels
            for image, part in zip(which, np.split(every, begins[1:]), strict=True)
        }

    def settle(self, sets: Sequence[int], images: Images, left: Mapping[int, Places], ask: Ask | None = None) -> None:
        """Writes the pixels that are left of the images of the sets: one call of an enclosure for all, then `ask`.

        ask: None for the oracle, which raises AccuracyError, with the number of the set, for what it does not know.
        """
        if not left:
            return
        height, width = self.size
        jobs = [replace(self.job, scene=self.scene(sets[k])) for k in left]
        found = enclosed_many(jobs, list(left.values()), width, height, self.threads)
        for (k, places), job, (values, known) in zip(left.items(), jobs, found, strict=True):
            _write(images[k], places[known], values[known])
            if not known.all():
                with named(sets[k]):
                    asked = (ask or self._by_oracle)(k, job, places[~known])
                _write(images[k], *asked)

    def _by_oracle(self, _: int, job: Job, places: Places) -> tuple[Places, NDArray[Any]]:
        height, width = self.size
        return places, settle_by_oracle(job, width, height, places).reshape(len(places), -1)

    def direct(self, channels: int) -> bool:
        """Whether a kernel can write to the images: it has their channels, and their rows are contiguous."""
        shape = self.size if channels == 1 else (*self.size, channels)
        return self.images.shape[1:] == shape and rows_are_contiguous(self.images, channels)

    def neighbours(self, sets: Sequence[int]) -> Iterator[tuple[slice, NDArray[Any]]]:
        """The images of the sets, of one channel, as arrays for a kernel: each with the part of the sets that it holds.

        Sets that are neighbours are drawn in place, where the array allows it; others through memory of `pieces`.
        """
        if self.direct(1) and sets[-1] - sets[0] == len(sets) - 1:
            yield slice(0, len(sets)), self.images[sets[0] : sets[0] + len(sets)]
        else:
            yield from self.pieces(sets, 1)

    def pieces(self, sets: Sequence[int], channels: int) -> Iterator[tuple[slice, NDArray[Any]]]:
        """Memory for at most MOST_PIXELS pixels, or one image, that goes to the sets' images when it is drawn; grey
        values go to three channels."""
        height, width = self.size
        shape = (height, width) if channels == 1 else (height, width, channels)
        some = max(1, min(len(sets), MOST_PIXELS // (height * width)))
        canvas = np.empty((some, *shape), self.images.dtype)
        for begin in range(0, len(sets), some):
            piece = slice(begin, min(begin + some, len(sets)))
            drawn = canvas[: piece.stop - begin]
            yield piece, drawn
            for index, image in zip(sets[piece], drawn, strict=True):
                self.images[index] = image if image.shape == self.images.shape[1:] else image[..., np.newaxis]

    def _over_rows(self, rows: Rows, count: int) -> None:
        height, width = self.size
        over_rows(rows, count * height, thread_count(self.threads, count * height * width), width=width)


def _write(image: NDArray[Any], places: Places, values: NDArray[Any]) -> None:
    """Values (places, channels), one of which may stand for three, or three equal ones for one."""
    image[np.divmod(places, image.shape[1])] = values[:, 0] if image.ndim == 2 else values


@contextmanager
def named(index: int) -> Iterator[None]:
    """Errors that are about a set say which."""
    where = f"parameters, set {index}: "
    try:
        yield
    except (SceneError, OutsidePlanError, AccuracyError) as problem:
        if str(problem).startswith("parameters, set "):
            raise
        if isinstance(problem, SceneError):
            raise SceneError(where + problem.place, problem.problem) from None
        if isinstance(problem, AccuracyError):
            raise AccuracyError(f"{where}{problem}", problem.points) from None
        raise OutsidePlanError(f"{where}{problem}") from None
