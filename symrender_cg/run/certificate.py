"""`Certificate`: what was proved of the values of an image or at points, and `Job`: what is to be proved.

Never done here: a proof.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symrender_cg.lower.variants import Variant
from symrender_cg.scene import Scene


class Stage(NamedTuple):
    """How many points a stage settled, and the largest bound of the error of a value that it settled.

    The bound is on the stage's own number, before rounding; that of the oracle is 0: it rounds the true value.
    """

    name: str
    settled: int
    bound: float


@dataclass(frozen=True, slots=True)
class Certificate:
    """What was proved: `claim` holds for every one of `points` pixels or points, each settled by one of the stages."""

    claim: str
    points: int
    stages: tuple[Stage, ...]

    @property
    def bound(self) -> float:
        """The largest bound of any stage that settled something."""
        return max((stage.bound for stage in self.stages if stage.settled), default=0.0)

    def __str__(self) -> str:
        words = [f"{stage.name} {stage.settled:,} (error at most {stage.bound:.1e})" for stage in self.stages]
        return f"{self.claim} at all {self.points:,}: {', '.join(words)}"


class Certified(NamedTuple):
    """An image or values at points, and the proof."""

    values: NDArray[Any]
    certificate: Certificate


@dataclass(frozen=True, slots=True)
class Job:
    """What is to be settled, by which rule, and how."""

    scene: Scene
    variant: Variant
    clip: bool
    portable: bool = False
    cache: str | Path | None = None
    threads: int | None = None

    @property
    def white(self) -> float:
        """The intensity above which white is written."""
        return 1.0 if self.clip else float(np.inf)

    @property
    def rule(self) -> str:
        """One of symrender_cg.run.enclosure_kernel.RULES."""
        assert self.variant.settles is not None, f"{self.variant.name} settles nothing"
        return self.variant.settles

    @property
    def claim(self) -> str:
        """What is proved, in words."""
        return {
            "ulp": "within 4 ulp",
            "float64": "the nearest float64",
            "float32": "the nearest float32",
            "uint8": "the right grey level",
        }[self.rule]
