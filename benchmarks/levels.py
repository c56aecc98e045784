"""`python -m benchmarks levels`: what each accuracy costs, and what it delivers, scene by scene.

Comes in: built-in names or files, a size, rounds. Goes out: Report and its table: nanoseconds a pixel of render_image
at every level that the scene can have, its ratio to `double`, the largest error against the oracle over seeded pixels
of the unclipped field, and for levels that prove their values which stage settled how many pixels, with which bound.
All levels of a scene take turns in one run, on one thread. Never done here: a peer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.machine import Machine, Spread, spread, take_turns, this_machine
from symrender_cg import Scene, load_scene, render_image
from symrender_cg.errors import OutsidePlanError
from symrender_cg.pipeline import pixel_size, settling_kernel
from symrender_cg.reference import oracle
from symrender_cg.run.certify import settle_image
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.levels import job_of
from symrender_cg.run.numbers import numbers_of

LEVELS: tuple[tuple[str, str | None], ...] = (
    ("literal", None),
    ("fast", None),
    ("single", None),
    ("double", None),
    ("stable", None),
    ("certified", "uint8"),
    ("certified", "float32"),
    ("certified", "float64"),
)


@dataclass(frozen=True, slots=True)
class Row:
    """A level of a scene.

    error, ulp   the largest over the sampled pixels, ulp of the level's own format
    wrong        values that are not the rounding of the true value to that format
    settled      pixels by stage
    tightness    the kernel's bound over the largest true error of its own values
    """

    scene: str
    level: str
    ns: Spread
    ratio: float
    error: float
    ulp: float
    wrong: int
    settled: dict[str, int]
    bound: float
    tightness: float


@dataclass(frozen=True, slots=True)
class Report:
    """What `levels` measured."""

    machine: Machine
    size: int
    rounds: int
    points: int
    seed: int
    rows: tuple[Row, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One line a level, scene by scene."""
        console.print(self.machine.line(), highlight=False)
        table = Table(
            title=f"{self.size} x {self.size}, one thread, {self.rounds} rounds; errors at {self.points} pixels"
        )
        heads = (
            "scene",
            "level",
            "ns a pixel",
            "to double",
            "error",
            "ulp",
            "wrong",
            "settled by",
            "bound",
            "bound / error",
        )
        for head in heads:
            table.add_column(head, justify="left" if head in ("scene", "level", "settled by") else "right")
        last = ""
        for row in self.rows:
            table.add_row(
                "" if row.scene == last else row.scene,
                row.level,
                row.ns.shown(),
                f"{row.ratio:.2f}",
                f"{row.error:.1e}",
                f"{row.ulp:.3g}",
                str(row.wrong),
                ", ".join(f"{name} {count:,}" for name, count in row.settled.items()),
                f"{row.bound:.1e}" if row.settled else "",
                f"{row.tightness:.0f}" if np.isfinite(row.tightness) else "",
            )
            last = row.scene
        console.print(table)
        console.print(
            "error: of the unclipped field against the oracle; grey levels count as level / 255. bound: the largest of "
            "a stage's own values; bound / error: the kernel's bound of the frame over its largest error at these "
            "pixels."
        )


def measure_levels(
    names: Sequence[str], size: int, rounds: int, points: int, seed: int, told: Callable[[str], None]
) -> Report:
    """Every scene in turn; told(text) says what is going on."""
    rows = [row for name in names or Scene.builtin_names() for row in _rows(name, size, rounds, points, seed, told)]
    return Report(this_machine(), size, rounds, points, seed, tuple(rows))


def _rows(name: str, size: int, rounds: int, points: int, seed: int, told: Callable[[str], None]) -> list[Row]:
    scene = load_scene(name)
    told(f"{name}: the oracle")
    places = np.random.default_rng(seed).choice(size * size, min(points, size * size), replace=False)
    columns, lines = pixel_centres(size, size, pixel_size(scene.in_camera_frame(), size))
    where = columns[places % size], lines[places // size]
    truth = oracle.evaluate(scene, *where)
    calls: dict[str, Callable[[], float]] = {}
    values: dict[str, NDArray[Any]] = {}
    for level, target in LEVELS:
        key = level if target is None else f"{level} {target}"
        told(f"{name}: {key}")
        try:
            image = render_image(scene, size, size, accuracy=level, target=target, clip=False, threads=1)
        except OutsidePlanError:
            continue
        values[key] = image.reshape(size * size, -1)[places].reshape(truth.value.shape)
        calls[key] = _sample(scene, size, level, target)
    samples = take_turns(calls, rounds, seed, lambda number: told(f"{name}: round {number + 1} of {rounds}"))
    times = {key: spread(taken) for key, taken in samples.items()}
    rows = []
    for level, target in LEVELS:
        key = level if target is None else f"{level} {target}"
        if key not in times:
            continue
        error, ulp, wrong = _errors(values[key], truth)
        job = job_of(scene, level, target, clip=False, threads=1)
        stages = settle_image(job, size, size).certificate.stages if job is not None else ()
        rows.append(
            Row(
                name,
                key,
                times[key],
                times[key].median / times["double"].median,
                error,
                ulp,
                wrong,
                {stage.name: stage.settled for stage in stages},
                max((stage.bound for stage in stages if stage.settled), default=0.0),
                _tightness(scene, level, target, where, truth) if stages else np.nan,
            )
        )
    return rows


def _tightness(
    scene: Scene, level: str, target: str | None, where: tuple[NDArray[Any], NDArray[Any]], truth: oracle.Answers
) -> float:
    """The bound of the kernel's own values over the largest error of them; NaN where the scene has no such kernel."""
    job = job_of(scene, level, target, clip=False)
    found = settling_kernel(scene, job.variant) if job is not None else None
    if found is None:
        return float("nan")
    kernel, frame = found
    x, y = (np.ascontiguousarray(part) for part in where)
    hi, lo, error = kernel.enclose(x, y, kernel.numbers(numbers_of(frame)))
    known = np.isfinite(error) & (error > 0.0)
    apart = np.abs(((hi - truth.value) + (lo - truth.residual))[known])
    return float(error[known].max() / apart.max()) if apart.size and apart.max() > 0.0 else float("nan")


def _errors(values: NDArray[Any], truth: oracle.Answers) -> tuple[float, float, int]:
    """Largest absolute error, largest in ulp of the values' format, how many are not the right rounding."""
    if values.dtype == np.uint8:
        wrong = int(np.count_nonzero(values != truth.value8))
        return float(np.abs(values / 255.0 - np.clip(truth.value, 0.0, 1.0)).max()), 0.0, wrong
    right = truth.value32 if values.dtype == np.float32 else truth.value
    error = np.abs((values.astype(np.float64) - truth.value) - truth.residual)
    ulps = error / np.spacing(np.abs(right)).astype(np.float64)
    return float(error.max()), float(ulps.max()), int(np.count_nonzero(values != right))


def _sample(scene: Scene, size: int, level: str, target: str | None) -> Callable[[], float]:
    """Nanoseconds a pixel of one image: the best of two, the second of which finds the memory of the first."""

    def call() -> float:
        best = float("inf")
        for _ in range(2):
            start = time.perf_counter()
            render_image(scene, size, size, accuracy=level, target=target, clip=False, threads=1)
            best = min(best, (time.perf_counter() - start) * 1e9 / size**2)
        return best

    return call
