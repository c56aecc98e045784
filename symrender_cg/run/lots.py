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
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.certificate import Job
from symrender_cg.run.certify import settle_if_known
from symrender_cg.run.grid import pixels_at
from symrender_cg.run.ready import Ready
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.settled_rows import SettledRows
from symrender_cg.run.target import Places, Target, named


class Lot(Protocol):
    """Sets that are drawn together."""

    @property
    def sets(self) -> Sequence[int]:
        """Their numbers, ascending."""

    def draw(self, onto: Target) -> None:
        """Draws their images."""


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
        height, width = onto.size

        def ask(k: int, job: Job, places: Places) -> tuple[Places, NDArray[Any]]:
            row, column = np.divmod(places, width)
            x, y = pixels_at(column, row, width, height, self.pixels[piece][k])
            values, known = settle_if_known(job, x, y, width / height)
            return places[known], values[known]

        onto.settle(self.sets[piece], images, doubtful, ask)


@dataclass(eq=False)
class ProvedLot:
    """Many surfaces, every pixel by the enclosure."""

    sets: list[int] = field(default_factory=list)

    def draw(self, onto: Target) -> None:
        """Encloses every pixel of the sets' images, and settles what is left."""
        every = np.arange(math.prod(onto.size), dtype=np.intp)
        images = [onto.images[index] for index in self.sets]
        onto.settle(self.sets, images, dict.fromkeys(range(len(images)), every))


@dataclass(eq=False)
class OwnLot:
    """One set, whose image is drawn in parts as render_image draws it."""

    sets: list[int]
    source: Ready | SettledRows

    def draw(self, onto: Target) -> None:
        """Draws the image."""
        with named(self.sets[0]):
            self.source.draw(onto.images[self.sets[0]], threads=onto.threads)
