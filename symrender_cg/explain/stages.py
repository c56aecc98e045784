"""How a level proves its values: what is claimed, the chain of stages, and the bound of its first kernel for one image;
and where `double` has another kernel draw a part of the image.

Comes in: a scene, a level, a size. Goes out: Proof, frozen, or None for a level that one kernel draws alone. The bound
is computed by the kernel itself, so that it is compiled here if it has not been; without a compiler it is None.
Never done here: drawing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from symrender_cg.errors import ToolchainError
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import enclosure_name, pixel_size, planned, settling_kernel
from symrender_cg.run.box_pixels import box_pixels
from symrender_cg.run.certificate import Job
from symrender_cg.run.kernel import GRID
from symrender_cg.run.levels import job_of, steep_part
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Scene

FORMATS: Final = {
    "int": "whole number",
    "float32": "float32",
    "float64": "float64",
    "pair": "pair of float64, hi + lo, not renormalised",
    "double_double": "double-double, 106 bits",
    "ball": "ball: a double-double and a bound of its error",
}
"""Number formats in words, in the order in which they are listed."""

_ORACLE: Final = "exact signs, and Arb balls of growing precision"
_ENCLOSURE: Final = "every number a double-double with a bound of its error"


@dataclass(frozen=True, slots=True)
class ProofStage:
    """One stage.

    what     how it computes
    takes    which points it is given
    kernel   C name of its kernel, empty where it has none
    bound    how far its own value of any pixel can be from the true one, before rounding; None where not one number is
             said of all pixels
    """

    name: str
    what: str
    takes: str
    kernel: str = ""
    bound: float | None = None


@dataclass(frozen=True, slots=True)
class Proof:
    """What is proved of every value, how, and for which image.

    handed_over   the level is one of plain float64, and the compensated kernel draws in its place
    """

    claim: str
    handed_over: bool
    width: int
    height: int
    stages: tuple[ProofStage, ...]


@dataclass(frozen=True, slots=True)
class SteepHighlight:
    """Where a highlight is too steep for plain float64, and which kernel draws there in place of that of `double`.

    left, right, bottom, top   of a box of the image plane, scene units
    columns, rows              how many of an image of width x height pixels it holds
    kernel                     C name
    """

    left: float
    right: float
    bottom: float
    top: float
    columns: int
    rows: int
    width: int
    height: int
    kernel: str


def steep_highlight_of(scene: Scene, accuracy: str, *, width: int, height: int) -> SteepHighlight | None:
    """The box of an image at `double` that the kernel of `stable` draws; None where there is none."""
    box = steep_part(scene, width / height) if accuracy == "double" else None
    if box is None:
        return None
    found = planned(scene, aspect=width / height)
    grid = np.array([(width, height, pixel_size(found.scene, height), 1.0)], dtype=GRID)
    pixels = box_pixels(box.edges, grid)[0]
    columns, rows = (int(pixels[f"{side}_end"] - pixels[f"{side}_begin"]) for side in ("column", "row"))
    edges = (box.left, box.right, box.bottom, box.top)
    return SteepHighlight(*edges, columns, rows, width, height, f"{found.name}_{variant('stable').name}")


def proof_of(scene: Scene, accuracy: str, target: str | None, *, width: int, height: int) -> Proof | None:
    """The chain of stages that proves an image of that size; None where one kernel draws it alone.

    Raises ArgumentError for an unknown level or target.
    """
    job = job_of(scene, accuracy, target, clip=False, aspect=width / height)
    if job is None:
        return None
    found = planned(scene, aspect=width / height)
    stages: list[ProofStage] = []
    if found.arrangement is None:
        words = "pairs" if job.variant.shading == "pair" else job.variant.shading
        bound = _bound(job, width, height)
        stages.append(
            ProofStage(
                "kernel",
                f"loops over pixels in {words}, with one bound for the whole frame",
                "all points",
                f"{found.name}_{job.variant.name}",
                bound,
            )
        )
    whole = planned(scene)
    if whole.arrangement is None:
        whole = planned(scene, force=("scene",))
    takes = "what the kernel leaves" if stages else "all points"
    stages.append(ProofStage("enclosure", _ENCLOSURE, takes, enclosure_name(whole)))
    stages.append(ProofStage("oracle", _ORACLE, "what the enclosure leaves; a tie that it cannot decide is an error"))
    handed_over = not variant(accuracy, target).settles
    return Proof(job.claim, handed_over, width, height, tuple(stages))


def _bound(job: Job, width: int, height: int) -> float | None:
    """The bound of a job's kernel for an image of that size."""
    try:
        first = settling_kernel(job.scene, job.variant, aspect=width / height)
    except ToolchainError:
        return None
    assert first is not None, "one sphere under one light has the kernel of one sphere"
    kernel, frame = first
    numbers = kernel.numbers(numbers_of(frame))
    return kernel.bound(numbers, width=width, height=height, pixel=pixel_size(frame, height))
