"""`SettledRows`: an image of a level that proves its values, to be drawn rows by rows, as `Ready` draws others.

In: a job and a size. Out: rows, straight into the array where the job has a first kernel. What that kernel takes is
looked up once: an image is drawn more than once. Never here: a stage.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.certificate import Job
from symrender_cg.run.certify import FirstStage, first_stage, settle_onto, settle_rows
from symrender_cg.run.kernel import rows_are_contiguous
from symrender_cg.run.threads import MOST_PIXELS


@dataclass(frozen=True, eq=False)
class SettledRows:
    """An image of a level that proves its values.

    shape   (height, width) or (height, width, 3)
    """

    job: Job
    width: int
    height: int

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """(height, width) or (height, width, 3)."""
        return (self.height, self.width) if self.job.scene.channels == 1 else (self.height, self.width, 3)

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Of what the level writes."""
        return np.dtype(self.job.variant.result)

    def draw(self, rows: NDArray[Any], first: int = 0, *, threads: int | None = None) -> None:
        """Writes as many rows of the image as the array has, from row `first` on; any strides."""
        some = max(1, MOST_PIXELS // self.width)
        straight = self._first is not None and rows.ndim == 2 and rows_are_contiguous(rows)
        for begin in range(0, len(rows), some):
            block = rows[begin : begin + some]
            if straight and self._first is not None:
                settle_onto(self._first, block, self.height, first + begin, threads)
                continue
            job = replace(self.job, threads=threads)
            block[...] = settle_rows(job, self.width, self.height, first + begin, first + begin + len(block)).values

    @cached_property
    def _first(self) -> FirstStage | None:
        return first_stage(self.job, self.width / self.height)
