"""The measurement: every candidate's time in one interleaved run, its error on points that no search has seen.

Comes in: a Scene, sizes and counts, a seed. Goes out: Report, and what was drawn. Never done here: printing.

    points of the search      seed
    points of the report      seed + 1: another draw, so that nothing was chosen by them
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.cost.bounds import proved_bounds
from symrender_cg.cost.break_even import break_evens
from symrender_cg.cost.front import steps_along, with_front
from symrender_cg.cost.ready import Ready
from symrender_cg.cost.report import Entry, Report, Spread, finite, this_machine
from symrender_cg.cost.sample import Sample, draw_sample, errors_of
from symrender_cg.cost.search import BUDGET, search
from symrender_cg.cost.timing import interleaved
from symrender_cg.cost.variants import DEFAULT
from symrender_cg.scene import Scene

ROUNDS: Final = 15
POINTS: Final = 4000
HARD: Final = 500
QUICK_ROUNDS: Final = 7
QUICK_POINTS: Final = 1000

Told = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Measured:
    """A report, and the ways that it is about, in the order of its entries; top: the brightest value of its points."""

    report: Report
    ready: tuple[Ready, ...]
    top: float


def measure(
    scene: Scene,
    name: str,
    size: tuple[int, int] = (256, 256),
    *,
    rounds: int | None = None,
    seed: int = 1,
    quick: bool = False,
    told: Told = lambda what: None,
) -> Measured:
    """What accuracy costs in a scene. `quick`: the named ways alone, fewer rounds and points. `told` says what is done.

    Raises ToolchainError without a compiler, SceneError or OutsidePlanError for a scene that has no kernel.
    """
    begin = time.perf_counter()
    budget = 0 if quick else BUDGET
    count = rounds or (QUICK_ROUNDS if quick else ROUNDS)
    found = search(scene, size, seed=seed, budget=budget, told=told)
    told("the oracle")
    sample = draw_sample(scene, size, QUICK_POINTS if quick else POINTS, HARD, seed + 1)
    times = interleaved([one.draw for one in found.ready], count, seed, lambda: told("a round"))
    entries = with_front(entries_of(found.ready, times, sample, size))
    report = Report(
        scene=name,
        toml=scene.to_toml(),
        width=size[0],
        height=size[1],
        rounds=count,
        seed=seed,
        quick=quick,
        machine=this_machine(),
        entries=entries,
        steps=steps_along(entries),
        break_even=break_evens(entries, size),
        tried=found.tried,
        budget=budget,
        seconds=time.perf_counter() - begin,
    )
    return Measured(report, found.ready, float(np.abs(sample.truth.value).max(initial=0.0)))


def entries_of(
    ready: Sequence[Ready], times: Sequence[list[float]], sample: Sample, size: tuple[int, int]
) -> list[Entry]:
    """An entry of each way: its time in nanoseconds a pixel, its ratio to `double`, its errors."""
    pixels = size[0] * size[1]
    samples = np.asarray(times) * (1e9 / pixels)
    base = samples[next(number for number, one in enumerate(ready) if one.way.name == DEFAULT)]
    unit = float(np.nanmedian(base))
    return [_entry(one, samples[number] / base, unit, sample) for number, one in enumerate(ready)]


def _entry(ready: Ready, ratios: NDArray[np.float64], unit: float, sample: Sample) -> Entry:
    """`ratios` to `double` in every round, NaN where the way sat out; `unit`: nanoseconds a pixel of `double`."""
    way = ready.way
    ratio = Spread.of(ratios[np.isfinite(ratios)].tolist())
    proved = proved_bounds(sample.scene, way.variant)
    return Entry(
        name=way.name,
        kind=way.kind,
        does=way.does,
        level=way.level,
        choices=way.choices,
        target=way.target,
        bake=way.bake,
        ns=Spread(unit * ratio.median, unit * ratio.low, unit * ratio.high),
        ratio=ratio,
        errors=errors_of(ready.field, sample, way.side),
        bound=None if proved is None else finite(proved[0]),
        lines=ready.lines,
        operations=ready.operations,
        derive=ready.derive,
        compile=ready.compile,
    )
