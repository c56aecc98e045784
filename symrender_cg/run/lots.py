"""Lots: the sets of a batch that one kernel draws, in one call, into their images.

    lot          sets                                        what a call leaves open
    PlainLot     one sphere, levels that one kernel draws    nothing
    SettlingLot  one sphere, levels that prove values        to the enclosure, then the oracle
    SceneLot     many surfaces, levels that a kernel draws   what rounding may have decided, to the same two
    ProvedLot    many surfaces, levels that prove values     every pixel
    OwnLot       one set, drawn as render_image does         nothing

In: the numbers of each set as its kernel takes them. Out: images with the bits of render_image. What is left open of a
lot is enclosed in one call for all its images. Never here: a plan, or a choice of kernels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import AccuracyError, OutsidePlanError, SceneError
from symrender_cg.lower.variants import variant
from symrender_cg.run.certify import Job, settle_by_oracle, settle_if_known
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.kernel import GRID, Kernel, rows_are_contiguous
from symrender_cg.run.ready import Ready
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.settled_rows import SettledRows
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.settling_many import enclosed_many
from symrender_cg.run.threads import MOST_PIXELS, over_rows, thread_count
from symrender_cg.scene import Scene

Places = NDArray[np.intp]
Rows = Callable[[int, int], object]


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

    def jobs(self, sets: Sequence[int]) -> list[Job]:
        """What settles the images of those sets."""
        return [replace(self.job, scene=self.scene(index)) for index in sets]

    def grids(self, pixels: NDArray[np.float64]) -> NDArray[Any]:
        """The grids of images whose pixels have these sides."""
        found = np.empty(len(pixels), GRID)
        found["height"], found["width"] = self.size
        found["pixel"], found["white"] = pixels, self.job.white
        return found

    def draw(self, rows: Rows, count: int) -> None:
        """Draws the rows of so many images on the threads."""
        height, width = self.size
        over_rows(self.told(rows), count * height, thread_count(self.threads, count * height * width), width=width)

    def left_open(self, rows: Callable[[int, int], Places], count: int) -> dict[int, Places]:
        """The same of rows that return what they leave open; by image, pixels row * width + column in their order."""
        found: list[Places] = []
        self.draw(lambda begin, end: found.append(rows(begin, end)), count)
        every = np.sort(np.concatenate(found))
        if not every.size:
            return {}
        pixels = self.size[0] * self.size[1]
        which, begins = np.unique(every // pixels, return_index=True)
        return {
            int(image): part - int(image) * pixels
            for image, part in zip(which, np.split(every, begins[1:]), strict=True)
        }

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


class Lot(Protocol):
    """Sets that are drawn together."""

    @property
    def sets(self) -> Sequence[int]:
        """Their numbers, ascending."""

    def draw(self, onto: Target) -> None:
        """Draws their images."""


@dataclass(eq=False)
class PlainLot:
    """One sphere under one light, by a kernel that leaves nothing open."""

    kernel: Kernel
    sets: list[int] = field(default_factory=list)
    numbers: list[NDArray[np.float64]] = field(default_factory=list)
    pixels: list[NDArray[np.float64]] = field(default_factory=list)

    def draw(self, onto: Target) -> None:
        """Draws the images of the sets."""
        numbers, grids = np.concatenate(self.numbers), onto.grids(np.concatenate(self.pixels))
        for piece, images in onto.neighbours(self.sets):
            onto.draw(self.kernel.onto_many(images, numbers[piece], grids[piece]), len(images))


@dataclass(eq=False)
class SettlingLot:
    """One sphere under one light, by a kernel that bounds its own error."""

    kernel: SettlingKernel
    sets: list[int] = field(default_factory=list)
    numbers: list[NDArray[np.float64]] = field(default_factory=list)
    pixels: list[NDArray[np.float64]] = field(default_factory=list)

    def draw(self, onto: Target) -> None:
        """Draws the images of the sets, and settles what the kernel left open."""
        numbers, grids = np.concatenate(self.numbers), onto.grids(np.concatenate(self.pixels))
        for piece, images in onto.neighbours(self.sets):
            rows = self.kernel.settle_many(images, numbers[piece], grids[piece])
            left = onto.left_open(rows, len(images))
            _prove(onto, self.sets[piece], images, left)


@dataclass(eq=False)
class SceneLot:
    """Many surfaces, by a kernel that lists what rounding may have decided."""

    kernel: SceneKernel
    sets: list[int] = field(default_factory=list)
    structures: list[NDArray[Any]] = field(default_factory=list)
    keeps: list[Any] = field(default_factory=list)
    pixels: list[float] = field(default_factory=list)

    def draw(self, onto: Target) -> None:
        """Draws the images of the sets, and settles what is in doubt, as far as anybody knows it."""
        grids, structures = onto.grids(np.array(self.pixels)), np.empty(len(self.sets), self.kernel.structure)
        np.concatenate(self.structures, out=structures)  # what it makes by itself has no gaps between fields
        if onto.direct(self.kernel.channels):
            whole = [onto.images[index] for index in self.sets]
            self._draw(onto, slice(0, len(whole)), whole, structures, grids)
            return
        for piece, images in onto.pieces(self.sets, self.kernel.channels):
            self._draw(onto, piece, list(images), structures[piece], grids[piece])

    def _draw(
        self, onto: Target, piece: slice, images: list[NDArray[Any]], structures: NDArray[Any], grids: NDArray[Any]
    ) -> None:
        prepared = self.kernel.prepare_many(structures, grids)
        doubtful = onto.left_open(self.kernel.onto_many(images, prepared), len(images))
        del prepared
        if doubtful:
            self._settle(onto, piece, images, doubtful)

    def _settle(self, onto: Target, piece: slice, images: list[NDArray[Any]], doubtful: dict[int, Places]) -> None:
        height, width = onto.size
        sure = Job(onto.job.scene, variant("stable"), False, onto.job.portable, onto.job.cache, 1)
        jobs = [replace(sure, scene=onto.scene(self.sets[piece][k])) for k in doubtful]
        found = enclosed_many(jobs, list(doubtful.values()), width, height, onto.threads)
        for (k, places), job, (values, known) in zip(doubtful.items(), jobs, found, strict=True):
            self._write(images[k], places[known], values[known], onto.job.white)
            if not known.all():
                rest = places[~known]
                columns, rows = pixel_centres(width, height, self.pixels[piece][k])
                values, known = settle_if_known(job, columns[rest % width], rows[rest // width], width / height)
                self._write(images[k], rest[known], values[known], onto.job.white)

    def _write(self, image: NDArray[Any], places: Places, values: NDArray[Any], white: float) -> None:
        row, column = np.divmod(places, image.shape[1])
        cut = np.minimum(values, white)
        image[row, column] = cut[:, 0] if self.kernel.channels == 1 else cut


@dataclass(eq=False)
class ProvedLot:
    """Many surfaces, every pixel by the enclosure."""

    sets: list[int] = field(default_factory=list)

    def draw(self, onto: Target) -> None:
        """Encloses every pixel of the sets' images, and settles what is left."""
        every = np.arange(math.prod(onto.size), dtype=np.intp)
        images = [onto.images[index] for index in self.sets]
        _prove(onto, self.sets, images, dict.fromkeys(range(len(images)), every))


@dataclass(eq=False)
class OwnLot:
    """One set, whose image is drawn in parts as render_image draws it."""

    sets: list[int]
    source: Ready | SettledRows

    def draw(self, onto: Target) -> None:
        """Draws the image."""
        with named(self.sets[0]):
            self.source.draw(onto.images[self.sets[0]], threads=onto.threads)


def _prove(
    onto: Target, sets: Sequence[int], images: Sequence[NDArray[Any]] | NDArray[Any], left: Mapping[int, Places]
) -> None:
    """Values of the pixels that are left of the images of the sets. Raises AccuracyError with the number of a set."""
    if not left:
        return
    height, width = onto.size
    jobs = onto.jobs([sets[k] for k in left])
    found = enclosed_many(jobs, list(left.values()), width, height, onto.threads)
    for (k, places), job, (values, known) in zip(left.items(), jobs, found, strict=True):
        _write(images[k], places[known], values[known])
        if not known.all():
            with named(sets[k]):
                asked = settle_by_oracle(job, width, height, places[~known])
            _write(images[k], places[~known], asked.reshape(len(asked), -1))


def _write(image: NDArray[Any], places: Places, values: NDArray[Any]) -> None:
    """Values (places, channels), one of which may stand for three."""
    row, column = np.divmod(places, image.shape[1])
    image[row, column] = values[:, 0] if image.ndim == 2 else values


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
