"""Lots of sets of one sphere under one light each: a kernel's `_batch` for all of them, and what it leaves open.

In: the numbers of each set. Out: images with the bits of render_image. Never here: a plan, or a choice of kernels.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.box_pixels import box_pixels
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.target import Target

Floats = NDArray[np.float64]


@dataclass(eq=False)
class _SphereLot(ABC):
    """Sets of one kernel.

    names     what the columns of numbers are, among them the kernel's inputs
    numbers   (sets, names) of sets that follow one another
    pixels    (sets,) sides of their pixels
    """

    kernel: Kernel
    names: tuple[str, ...]
    sets: list[int] = field(default_factory=list)
    numbers: list[Floats] = field(default_factory=list)
    pixels: list[Floats] = field(default_factory=list)

    def add(self, sets: list[int], numbers: Floats, pixels: Floats) -> None:
        """More sets."""
        self.sets += sets
        self.numbers.append(numbers)
        self.pixels.append(pixels)

    def draw(self, onto: Target) -> None:
        """Draws the images of the sets."""
        grids = onto.grids(np.concatenate(self.pixels))
        for piece, images in onto.neighbours(self.sets):
            self._draw(onto, piece, images, grids[piece])

    @abstractmethod
    def _draw(self, onto: Target, piece: slice, images: NDArray[Any], grids: NDArray[Any]) -> None:
        """Draws the images of some of the sets, which follow one another in the batch."""

    def _given(self, kernel: Kernel, piece: slice) -> Floats:
        """(sets, inputs): what a kernel takes of a part of the sets."""
        columns = [self.names.index(name) for name in kernel.inputs]
        return np.ascontiguousarray(np.concatenate(self.numbers)[piece, columns])


@dataclass(eq=False)
class PlainLot(_SphereLot):
    """Of a kernel that leaves nothing open. `double` has boxes of some sets drawn by the kernel of `stable`.

    edges     (sets, 4) of those boxes, NaN for none, of sets that follow one another
    stable    that kernel, where there are boxes
    """

    edges: list[Floats] = field(default_factory=list)
    stable: SettlingKernel | None = None

    def _draw(self, onto: Target, piece: slice, images: NDArray[Any], grids: NDArray[Any]) -> None:
        onto.draw(self.kernel.onto_many(images, self._given(self.kernel, piece), grids), len(images))
        if self.stable is not None:
            boxes = box_pixels(np.concatenate(self.edges)[piece], grids)
            rows = self.stable.settle_boxes(images, self._given(self.stable, piece), boxes)
            onto.settle(self.sets[piece], images, onto.left_open(rows, len(images), again=True))


@dataclass(eq=False)
class SettlingLot(_SphereLot):
    """Of a kernel that bounds its own error."""

    kernel: SettlingKernel

    def _draw(self, onto: Target, piece: slice, images: NDArray[Any], grids: NDArray[Any]) -> None:
        rows = self.kernel.settle_many(images, self._given(self.kernel, piece), grids)
        onto.settle(self.sets[piece], images, onto.left_open(rows, len(images)))
