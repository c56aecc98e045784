"""`python -m benchmarks speed`: nanoseconds a pixel of every contestant, beside its largest error.

Comes in: sizes, rounds, a seed. Goes out: Report, and its tables. The contestants take turns, in another order every
round; a ratio is the median of the ratios within a round. Errors are those of the unclipped field against the oracle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.contestants import BASE, Contestant, contestants
from benchmarks.machine import Machine, Spread, cores, spread, take_turns, this_machine, warm_sample
from symrender_cg import Scene
from symrender_cg.reference import oracle
from symrender_cg.reference.compare import Errors, measure
from symrender_cg.reference.hard_places import near_silhouette
from symrender_cg.reference.points import whole_image

SHORTEST_SAMPLE = 0.015
"""Seconds of a sample: a faster contestant is called several times, and its fastest call counts."""


@dataclass(frozen=True, slots=True)
class Row:
    """One contestant at one size. errors: on the pixels; at_silhouette: within a few floats of the outline."""

    name: str
    threads: int
    note: str
    ns_a_pixel: Spread
    times_base: Spread
    errors: Errors
    at_silhouette: Errors


@dataclass(frozen=True, slots=True)
class SizeReport:
    """All contestants at one size; pixels: how many of the image's the errors were taken on."""

    size: int
    pixels: int
    silhouette_points: int
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """What `speed` measured."""

    machine: Machine
    shininess: float
    rounds: int
    seed: int
    missing: tuple[str, ...]
    sizes: tuple[SizeReport, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One table a size."""
        console.print(self.machine.line(), highlight=False)
        for line in self.missing:
            console.print(line)
        for part in self.sizes:
            title = f"{part.size} x {part.size}, shininess {self.shininess:g}, {self.rounds} rounds"
            table = Table(title=title)
            table.add_column("contestant")
            for head in (
                "threads",
                "ns a pixel (quartiles)",
                f"times {BASE}",
                "largest error",
                "ulp",
                "flips",
                "at the outline",
            ):
                table.add_column(head, justify="right")
            for row in part.rows:
                table.add_row(
                    row.name,
                    str(row.threads),
                    row.ns_a_pixel.shown(),
                    f"{row.times_base.median:.2f}",
                    f"{row.errors.max_abs:.1e}",
                    f"{row.errors.max_ulp:,.0f}",
                    str(row.errors.flips + row.errors.nonfinite),
                    f"{row.at_silhouette.max_abs:.0e}, {row.at_silhouette.flips + row.at_silhouette.nonfinite} flips",
                )
            console.print(table)
            which = (
                "all" if part.pixels == part.size**2 else f"{part.pixels:,} (seed {self.seed}) of the {part.size**2:,}"
            )
            console.print(
                f"Errors: unclipped field against the oracle on {which} pixels, in ulp of the result's own format; "
                f"flips: zero or not, wrongly. The outline: {part.silhouette_points:,} points within 1e-3 of it."
            )


def measure_speed(
    sizes: Sequence[int], rounds: int, shininess: float, points: int, seed: int, told: Callable[[str], None]
) -> Report:
    """Chapter 1's scene with that shininess, at each size; told(text) says what is going on."""
    scene = Scene.chapter1(shininess=shininess)
    told("the seed's derivation, and kernels")
    entries, missing = contestants(scene, cores())
    reports = tuple(_at_size(scene, entries, size, rounds, points, seed, told) for size in sizes)
    return Report(this_machine(), shininess, rounds, seed, tuple(missing), reports)


def _at_size(
    scene: Scene,
    entries: Sequence[Contestant],
    size: int,
    rounds: int,
    points: int,
    seed: int,
    told: Callable[[str], None],
) -> SizeReport:
    told(f"{size} x {size}: errors")
    x, y = _pixels(scene, size, points, seed)
    edge = near_silhouette(scene, 2000, seed)
    truth, edge_truth = oracle.evaluate(scene, x, y), oracle.evaluate(scene, *edge)
    errors = {entry.name: measure(entry.field(x, y), truth) for entry in entries}
    edges = {entry.name: measure(entry.field(*edge), edge_truth) for entry in entries}
    calls = {entry.name: _sample(entry.renderer(size), size) for entry in entries}
    samples = take_turns(calls, rounds, seed, lambda number: told(f"{size} x {size}: round {number + 1} of {rounds}"))
    base = np.asarray(samples[BASE])
    rows = tuple(
        Row(
            entry.name,
            entry.threads,
            entry.note,
            spread(samples[entry.name]),
            spread(list(np.asarray(samples[entry.name]) / base)),
            errors[entry.name],
            edges[entry.name],
        )
        for entry in entries
    )
    return SizeReport(size, x.size, edge[0].size, rows)


def _pixels(scene: Scene, size: int, points: int, seed: int) -> tuple[Any, Any]:
    """All pixel centres, or a seeded choice of so many of them."""
    x, y = whole_image(scene, size, size)
    if x.size <= points:
        return x, y
    chosen = np.sort(np.random.default_rng(seed).choice(x.size, points, replace=False))
    return x[chosen], y[chosen]


def _sample(render: Callable[[], object], size: int) -> Callable[[], float]:
    """A call that draws enough images for one sample and returns nanoseconds a pixel of the fastest."""
    sample = warm_sample(render, SHORTEST_SAMPLE)
    return lambda: sample() * 1e6 / size**2
