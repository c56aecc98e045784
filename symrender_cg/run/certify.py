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
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import AccuracyError
from symrender_cg.lower.variants import Variant
from symrender_cg.pipeline import enclosure_kernel, pixel_size, settling_kernel
from symrender_cg.run.enclosure_kernel import EnclosureKernel
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.settling import settled
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.threads import over_rows, thread_count
from symrender_cg.scene import Scene

Floats = NDArray[np.float64]
Places = NDArray[np.intp]


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
        """See symrender_cg.run.settling."""
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


class _Points(Protocol):
    """The points that are asked for, in an order; aspect: of the window that they are in, None for any points."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    @property
    def aspect(self) -> float | None: ...

    def at(self, places: Places) -> tuple[Floats, Floats]: ...

    def name(self, place: int) -> str: ...

    def settle(self, job: Job, kernel: SettlingKernel, numbers: Any) -> tuple[NDArray[Any], Places, float]: ...


@dataclass(frozen=True, eq=False)
class _Image:
    """Rows of an image of that height, from row `first` on; all of them, or some."""

    shape: tuple[int, int]
    pixel: float
    height: int
    first: int = 0

    @property
    def aspect(self) -> float:
        return self.shape[1] / self.height

    def at(self, places: Places) -> tuple[Floats, Floats]:
        width = self.shape[1]
        columns, rows = pixel_centres(width, self.height, self.pixel)
        return columns[places % width], rows[self.first + places // width]

    def name(self, place: int) -> str:
        return f"column {place % self.shape[1]}, row {self.first + place // self.shape[1]}"

    def settle(self, job: Job, kernel: SettlingKernel, numbers: Any) -> tuple[NDArray[Any], Places, float]:
        """The rows, the pixels of them that are left over, and the kernel's bound."""
        image = np.empty(self.shape, dtype=kernel.dtype)
        left_over = self.onto(image, job, kernel, numbers, job.threads)
        bound = kernel.bound(numbers, width=self.shape[1], height=self.height, pixel=self.pixel)
        return image, left_over, bound

    def onto(self, image: NDArray[Any], job: Job, kernel: SettlingKernel, numbers: Any, threads: int | None) -> Places:
        """Writes the rows by the kernel; the pixels of them that are left over."""
        count, width = self.shape
        first, height = self.first, self.height
        rows = kernel.shared_rows(image, numbers, pixel=self.pixel, white=job.white, first=first, height=height)
        over_rows(rows, count, thread_count(threads, width * count), width=width, first=first)
        found = rows.left_over
        places = found[0] if len(found) == 1 else np.concatenate(found)
        return np.sort(places) - first * width if places.size else places


@dataclass(frozen=True, eq=False)
class _Cloud:
    shape: tuple[int, ...]
    x: Floats
    y: Floats
    aspect: float | None = None

    def at(self, places: Places) -> tuple[Floats, Floats]:
        return self.x[places], self.y[places]

    def name(self, place: int) -> str:
        return f"({float(self.x[place])!r}, {float(self.y[place])!r})"

    def settle(self, job: Job, kernel: SettlingKernel, numbers: Any) -> tuple[NDArray[Any], Places, float]:
        """The values, the points that are left over, and a bound for the square that holds all points."""
        values = np.empty(self.x.size, dtype=kernel.dtype)
        left_over = kernel.settle_points(values, self.x, self.y, numbers, white=job.white)
        side = 2.0 * float(max(np.abs(self.x).max(), np.abs(self.y).max())) if values.size else 0.0
        return values, left_over, kernel.bound(numbers, width=1, height=1, pixel=side)


def settle_image(job: Job, width: int, height: int) -> Certified:
    """Every pixel of an image by the job's rule; shape (height, width), or (height, width, 3) for a scene with colours.

    Raises AccuracyError naming the pixels that even the oracle leaves open.
    """
    return settle_rows(job, width, height, 0, height)


def settle_rows(job: Job, width: int, height: int, first: int, last: int) -> Certified:
    """Rows [first, last) of that image, the same bits; shape (last - first, width), or (last - first, width, 3)."""

    def rows(frame: Scene) -> _Image:
        return _Image((last - first, width), pixel_size(frame, height), height, first)

    return _settled(job, rows, width / height)


def settle_points(job: Job, x: Floats, y: Floats) -> Certified:
    """The same for points of the image plane; x and y of one shape, which is that of the values."""
    columns, rows = (np.ascontiguousarray(a, dtype=np.float64).reshape(-1) for a in (x, y))
    return _settled(job, lambda _: _Cloud(x.shape, columns, rows), None)


def settle_if_known(
    job: Job, x: Floats, y: Floats, aspect: float | None = None
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Values at points by the job's rule, by enclosure and oracle, and which of them are known: not those that rest on
    a tie that nothing decides. x and y of shape (points,); values (points, channels).

    aspect: of the image that the points are in, whose plan then serves here too; None for any points.
    """
    points = _Cloud(x.shape, x, y, aspect)
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
    image = _Image((height, width), pixel_size(job.scene.in_camera_frame(), height), height)
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
        return _enclosing(self.job, self.aspect)


def first_stage(job: Job, aspect: float | None) -> FirstStage | None:
    """The first stage of a job; None where the enclosure is the first."""
    found = settling_kernel(job.scene, job.variant, aspect=aspect, portable=job.portable, cache=job.cache)
    return None if found is None else FirstStage(job, aspect, *found, _numbers(*found))


def settle_onto(first: FirstStage, rows: NDArray[Any], height: int, begin: int, threads: int | None) -> None:
    """Writes rows of an image of that height, from row `begin` on, into an array of contiguous rows, grey; the bits of
    `settle_rows`, which also says what was proved."""
    count, width = rows.shape
    points = _Image((count, width), pixel_size(first.frame, height), height, begin)
    places = points.onto(rows, first.job, first.kernel, first.numbers, threads)
    if places.size:
        job = replace(first.job, threads=threads)
        for open_places, rounded, _ in _later_stages(job, points, places, first.enclosing):
            rows[open_places // width, open_places % width] = rounded.reshape(-1)


def _settled(job: Job, points_of: Callable[[Scene], _Points], aspect: float | None) -> Certified:
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
    for open_places, rounded, stage in _later_stages(job, points, places):
        values[open_places] = rounded.reshape(open_places.size, -1)
        stages.append(stage)
    shape = points.shape if channels == 1 else (*points.shape, channels)
    return Certified(values.reshape(shape), Certificate(job.claim, count, tuple(stages)))


def _later_stages(
    job: Job, points: _Points, places: Places, kernel: EnclosureKernel | None = None
) -> Iterator[tuple[Places, NDArray[Any], Stage]]:
    """Places that are open, the values that the next stage gives them, settled or not, and what it settled."""
    for name, stage in (("enclosure", partial(_enclosed, kernel=kernel)), ("oracle", _asked)):
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


def _enclosing(job: Job, aspect: float | None) -> EnclosureKernel:
    return enclosure_kernel(job.scene, aspect=aspect, portable=job.portable, cache=job.cache)


def _enclosed(
    job: Job, points: _Points, places: Places, kernel: EnclosureKernel | None = None
) -> tuple[NDArray[Any], NDArray[np.bool_], float]:
    """Values at places, which of them are settled, and the largest error of those: by the enclosure kernel."""
    found = (kernel or _enclosing(job, points.aspect)).enclose(*points.at(places), threads=job.threads)
    rounded, is_settled = settled(found, job.rule)
    whole = np.asarray(is_settled.reshape(places.size, -1).all(axis=1), dtype=np.bool_)
    errors = found.error.reshape(places.size, -1)[whole]
    return _cut(job, rounded), whole, float(errors.max(initial=0.0))


def _asked(job: Job, points: _Points, places: Places) -> tuple[NDArray[Any], NDArray[np.bool_], float]:
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
