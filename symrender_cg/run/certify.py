"""Values that are proved, stage by stage, and the certificate that says so.

    stage       what it is                                              takes
    kernel      vectorised, with one bound for the frame                images of one sphere under one light
    enclosure   every number a ball of double-doubles                   what the kernel left, and all other scenes
    oracle      exact signs, Arb balls of growing precision             what the enclosure left

Each stage settles what its bound can decide and hands on the rest. What the oracle leaves is an error that names the
pixels. Never done here: a value that is not proved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import AccuracyError
from symrender_cg.pipeline import enclosure_kernel, pixel_size, settling_kernel
from symrender_cg.run.certificate import Certificate, Certified, Job, Stage
from symrender_cg.run.enclosure_kernel import EnclosureKernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.sought import Pixels, Points, Sought
from symrender_cg.scene import Scene

Floats = NDArray[np.float64]
Places = NDArray[np.intp]


def settle_image(job: Job, width: int, height: int) -> Certified:
    """Every pixel of an image by the job's rule; shape (height, width), or (height, width, 3) for a scene with colours.

    Raises AccuracyError naming the pixels that even the oracle leaves open.
    """
    return settle_rows(job, width, height, 0, height)


def settle_rows(job: Job, width: int, height: int, first: int, last: int) -> Certified:
    """Rows [first, last) of that image, the same bits; shape (last - first, width), or (last - first, width, 3)."""

    def rows(frame: Scene) -> Pixels:
        return Pixels((last - first, width), pixel_size(frame, height), height, first)

    return _settled(job, rows, width / height)


def settle_points(job: Job, x: Floats, y: Floats) -> Certified:
    """The same for points of the image plane; x and y of one shape, which is that of the values."""
    columns, rows = (np.ascontiguousarray(a, dtype=np.float64).reshape(-1) for a in (x, y))
    return _settled(job, lambda _: Points(x.shape, columns, rows), None)


def settle_if_known(
    job: Job, x: Floats, y: Floats, aspect: float | None = None
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Values at points by the job's rule, by enclosure and oracle, and which of them are known: not those that rest on
    a tie that nothing decides. x and y of shape (points,); values (points, channels).

    aspect: of the image that the points are in, whose plan then serves here too; None for any points.
    """
    points = Points(x.shape, x, y, aspect)
    values = np.empty((x.size, _channels(job.scene)), dtype=job.variant.result)
    known = np.zeros(x.size, dtype=np.bool_)
    places = np.arange(x.size)
    for stage in (_enclosed, _asked):
        try:
            rounded, is_settled, _ = stage(job, points, places)
        except AccuracyError as open_points:
            places = np.setdiff1d(places, np.asarray(open_points.points, dtype=np.intp))
            if not places.size:
                break
            rounded, is_settled, _ = stage(job, points, places)
        settled_here = places[is_settled]
        values[settled_here] = rounded.reshape(places.size, -1)[is_settled]
        known[settled_here] = True
        places = places[~is_settled]
        if not places.size:
            break
    return values, known


def settle_by_oracle(job: Job, width: int, height: int, places: Places) -> NDArray[Any]:
    """The values of some pixels of an image, row * width + column, by the job's rule: shape (places, channels), or
    (places,) of one channel. Raises AccuracyError naming those that even the oracle leaves open."""
    image = Pixels((height, width), pixel_size(job.scene.in_camera_frame(), height), height)
    return _asked(job, image, places)[0]


@dataclass(frozen=True, eq=False)
class FirstStage:
    """The kernel that settles most of a job in images of that aspect (None: at any points), the scene that it draws,
    and the numbers that it takes."""

    job: Job
    aspect: float | None
    kernel: SettlingKernel
    frame: Scene
    numbers: Any

    @cached_property
    def enclosing(self) -> EnclosureKernel:
        """The second stage."""
        job = self.job
        return enclosure_kernel(job.scene, aspect=self.aspect, portable=job.portable, cache=job.cache)


def first_stage(job: Job, aspect: float | None) -> FirstStage | None:
    """The first stage of a job; None where the enclosure is the first."""
    found = settling_kernel(job.scene, job.variant, aspect=aspect, portable=job.portable, cache=job.cache)
    return None if found is None else FirstStage(job, aspect, *found, _numbers(*found))


def settle_onto(first: FirstStage, rows: NDArray[Any], height: int, begin: int, threads: int | None) -> None:
    """Writes rows of an image of that height, from row `begin` on, into an array of contiguous rows, grey; the bits of
    `settle_rows`, which also says what was proved."""
    count, width = rows.shape
    points = Pixels((count, width), pixel_size(first.frame, height), height, begin)
    places = points.onto(rows, first.job, first.kernel, first.numbers, threads)
    if places.size:
        for open_places, rounded, _ in _later_stages(first.job, points, places, threads, first.enclosing):
            rows[np.divmod(open_places, width)] = rounded.reshape(-1)


def _settled(job: Job, points_of: Callable[[Scene], Sought], aspect: float | None) -> Certified:
    channels = _channels(job.scene)
    first = first_stage(job, aspect)
    stages: list[Stage] = []
    if first is None:
        points = points_of(job.scene.in_camera_frame())
        count = math.prod(points.shape)
        values, places = np.empty((count, channels), dtype=job.variant.result), np.arange(count)
    else:
        points = points_of(first.frame)
        count = math.prod(points.shape)
        found, places, bound = points.settle(job, first.kernel, first.numbers)
        values = found.reshape(count, 1)
        stages.append(Stage("kernel", count - places.size, bound))
        if channels == 3:
            values = np.repeat(values, 3, axis=1)
    for open_places, rounded, stage in _later_stages(job, points, places, job.threads):
        values[open_places] = rounded.reshape(open_places.size, -1)
        stages.append(stage)
    shape = points.shape if channels == 1 else (*points.shape, channels)
    return Certified(values.reshape(shape), Certificate(job.claim, count, tuple(stages)))


def _later_stages(
    job: Job, points: Sought, places: Places, threads: int | None, kernel: EnclosureKernel | None = None
) -> Iterator[tuple[Places, NDArray[Any], Stage]]:
    """Places that are open, the values that the next stage gives them, settled or not, and what it settled.

    kernel: of the enclosure, where it is known.
    """
    for name, stage in (("enclosure", partial(_enclosed, threads=threads, kernel=kernel)), ("oracle", _asked)):
        if not places.size:
            return
        rounded, is_settled, bound = stage(job, points, places)
        yield places, rounded, Stage(name, int(is_settled.sum()), bound)
        places = places[~is_settled]


@lru_cache(maxsize=64)
def _channels(scene: Scene) -> int:
    return scene.channels


@lru_cache(maxsize=64)
def _numbers(kernel: SettlingKernel, frame: Scene) -> Any:
    """The scene as the kernel takes it, remembered: a scene is drawn more than once."""
    return kernel.numbers(numbers_of(frame))


def _enclosed(
    job: Job, points: Sought, places: Places, threads: int | None = None, kernel: EnclosureKernel | None = None
) -> tuple[NDArray[Any], NDArray[np.bool_], float]:
    """Values at places, which of them are settled, and the largest error of those: by the enclosure kernel."""
    enclosing = kernel or enclosure_kernel(job.scene, aspect=points.aspect, portable=job.portable, cache=job.cache)
    return enclosing.settle(*points.at(places), job.rule, job.white, threads=threads)


def _asked(job: Job, points: Sought, places: Places) -> tuple[NDArray[Any], NDArray[np.bool_], float]:
    """The same by the oracle, which leaves nothing, or raises AccuracyError."""
    from symrender_cg.reference import oracle

    target = job.rule if job.rule in oracle.TARGETS else "float64"
    try:
        rounded = oracle.settle(job.scene, *points.at(places), target)
    except AccuracyError as open_points:
        left = [int(places[k]) for k in open_points.points]
        shown = "; ".join(points.name(place) for place in left[:8]) + ("; ..." if len(left) > 8 else "")
        raise AccuracyError(
            f"{job.variant.name}: {len(left)} of {math.prod(points.shape)} values are not settled: {shown}; each "
            "rests on a tie that neither balls nor exact numbers decide; move the scene or the camera by one float",
            left,
        ) from None
    return _cut(job, rounded), np.ones(places.size, dtype=bool), 0.0


def _cut(job: Job, values: NDArray[Any]) -> NDArray[Any]:
    """To [0, 1] where the image is clipped; rounding and cutting change places freely."""
    return np.clip(values, 0, 1) if job.clip and values.dtype.kind == "f" else values
