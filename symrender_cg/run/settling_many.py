"""What kernels left open of many images -> its values: one call of an enclosure for all, then the oracle, each image.

Comes in: jobs, and pixels of the image of each. Goes out: their values by the job's rule, and which of them are known.
Values are those of symrender_cg.run.certify, which settles one image; enclosures do not depend on their neighbours.
Never done here: a first stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.pipeline import enclosure_kernel
from symrender_cg.plan.stack import effects_of, is_stackable, weigh
from symrender_cg.plan.stack_lists import decide
from symrender_cg.run.certificate import Job
from symrender_cg.run.enclosure_kernel import EnclosureKernel, settle_many
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.stack_structures import structures_of
from symrender_cg.run.stacking import stack_of_scenes

Places = NDArray[np.intp]

MOST_ALIKE: Final = 256
"""Scenes that are compared together, each read sphere by sphere; fewer of many spheres, by pairs of these."""

MOST_PAIRS: Final = 1 << 19
"""Pairs of spheres that are looked at together."""


def enclosed_many(
    jobs: Sequence[Job], places: Sequence[Places], width: int, height: int, threads: int | None
) -> list[tuple[NDArray[Any], NDArray[np.bool_]]]:
    """For each job, the values of pixels row * width + column of its image, shape (pixels, channels of its enclosure),
    and which of them are settled in every channel. Scenes of one structure are enclosed in one call.

    The jobs differ in their scenes alone.
    """
    found: dict[int, tuple[NDArray[Any], NDArray[np.bool_]]] = {}
    for group in _groups(jobs, width / height):
        scenes = np.empty(len(group.members), group.kernel.structure)
        np.concatenate(group.structures, out=scenes)
        points = [
            _points(places[k], half_height, width, height)
            for k, half_height in zip(group.members, group.half_heights, strict=True)
        ]
        x, y = [at for at, _ in points], [at for _, at in points]
        settled = settle_many(group.kernel, scenes, x, y, jobs[0].rule, jobs[0].white, threads)
        found |= dict(zip(group.members, settled, strict=True))
    return [found[k] for k in range(len(jobs))]


@dataclass(eq=False)
class _Group:
    """Jobs whose scenes have one enclosure; members are their numbers."""

    kernel: EnclosureKernel
    members: list[int] = field(default_factory=list)
    structures: list[NDArray[Any]] = field(default_factory=list)
    half_heights: list[float] = field(default_factory=list)
    keeps: list[Any] = field(default_factory=list)

    def add(self, members: Sequence[int], made: NDArray[Any], keeps: Any, half_heights: Sequence[float]) -> None:
        """Scenes of these jobs."""
        self.members += members
        self.structures.append(made)
        self.keeps.append(keeps)
        self.half_heights += half_heights


def _groups(jobs: Sequence[Job], aspect: float) -> list[_Group]:
    """The jobs by enclosure, for images of that aspect. Scenes that differ from one before them in numbers alone are
    not planned."""
    groups: dict[tuple[str, int], _Group] = {}
    left = list(range(len(jobs)))
    while left:
        job = jobs[left[0]]
        kernel = enclosure_kernel(job.scene, aspect=aspect, portable=job.portable, cache=job.cache)
        group = groups.setdefault((kernel.name, id(kernel.library)), _Group(kernel))
        together = max(1, min(MOST_ALIKE, MOST_PAIRS // (len(job.scene.spheres) ** 2 + 1)))
        taken = _add_alike(group, kernel, jobs, left[:together])
        if not taken:
            half_height = kernel.plan.given.camera.half_height
            assert half_height is not None, "a camera-frame scene has its half_height"
            group.add(left[:1], *kernel.structures(), [half_height])
            taken = left[:1]
        gone = set(taken)
        left = [k for k in left if k not in gone]
    return list(groups.values())


def _add_alike(group: _Group, kernel: EnclosureKernel, jobs: Sequence[Job], left: Sequence[int]) -> list[int]:
    """Adds the jobs that surely have the enclosure of the first, with its effects; their numbers."""
    scene, found = jobs[left[0]].scene, kernel.plan
    if len(left) < 2 or kernel.nearer or not is_stackable(scene, found):
        return []
    read = stack_of_scenes(scene, [jobs[k].scene for k in left])
    if read is None:
        return []
    stack, kept = read
    weighed = weigh(found, stack, np.ones(stack.count, dtype=np.bool_))
    chosen = np.flatnonzero(weighed.alike & (weighed.effects == effects_of(found)))
    members = [left[kept[k]] for k in chosen.tolist()]
    if members:
        made, keeps = structures_of(kernel, found.scene, kernel.numbers(), stack, decide(weighed, chosen))
        group.add(members, made, keeps, stack.half_height[chosen].tolist())
    return members


def _points(
    places: Places, half_height: float, width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x and y of pixels."""
    columns, rows = pixel_centres(width, height, 2.0 * half_height / height)
    return columns[places % width], rows[places // width]
