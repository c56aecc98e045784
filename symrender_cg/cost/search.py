"""Which ways are tried: from every level coordinate by coordinate, then what was worth it combined, then baked.

Comes in: a Scene, a size, a seed, a budget. Goes out: Candidates, ready to be drawn. Never done here: the final
measurement; it uses other points.

    1  levels, baked levels, plans, references, supersampling          always
    2  from each level that one kernel draws alone, every single move
    3  of each level, its moves that are dominated by nothing, two by two, and three by three if room is left
    4  of one sphere: what is on the front of 1 to 3, baked

Kernels with the same content are tried once. The budget is a number of kernels; 2 to 4 stop when it is used up, in that
order. What is dominated is found by a short measurement on points of the search's own seed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from symrender_cg.cost.front import with_front
from symrender_cg.cost.ready import Ready, make_ready
from symrender_cg.cost.report import Entry, Spread
from symrender_cg.cost.sample import Sample, draw_sample, errors_of
from symrender_cg.cost.timing import interleaved
from symrender_cg.cost.variants import STARTS, Way, baked, combined, content, moved, named_ways
from symrender_cg.pipeline import planned
from symrender_cg.scene import Scene

BUDGET = 64
"""Kernels that a search may build beside the named ways."""
SCREENING_ROUNDS = 5
SCREENING_POINTS, SCREENING_HARD = 400, 100

Told = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Candidates:
    """What a search tried, ready to be drawn, and how many kernels beside the named ways it built."""

    ready: tuple[Ready, ...]
    tried: int


class _Search:
    """Ways that were made ready so far, by content."""

    def __init__(self, scene: Scene, size: tuple[int, int], seed: int, budget: int, told: Told) -> None:
        self.scene, self.size, self.seed, self.told = scene, size, seed, told
        self.left = budget
        self.known: dict[object, Ready] = {}
        self._sample: Sample | None = None

    @property
    def sample(self) -> Sample:
        if self._sample is None:
            self._sample = draw_sample(self.scene, self.size, SCREENING_POINTS, SCREENING_HARD, self.seed)
        return self._sample

    def add(self, ways: Iterable[Way], *, free: bool = False) -> list[Ready]:
        """Makes ready what is new among the ways and within the budget."""
        fresh: dict[object, Way] = {}
        for way in ways:
            key = content(way)
            if key not in self.known and key not in fresh:
                fresh[key] = way
        chosen = list(fresh.items()) if free else list(fresh.items())[: self.left]
        self.left -= 0 if free else len(chosen)
        made = make_ready([way for _, way in chosen], self.scene, self.size, self.told)
        self.known |= {key: one for (key, _), one in zip(chosen, made, strict=True)}
        return made

    def front(self, kinds: Sequence[str]) -> list[Way]:
        """The ways of these kinds that nothing dominates, by a short measurement."""
        ready = [one for one in self.known.values() if one.way.kind in kinds]
        times = interleaved([one.draw for one in ready], SCREENING_ROUNDS, self.seed)
        base = np.median(np.asarray(times), axis=0)
        entries = [
            _screened(one, np.asarray(samples) / base, self.sample) for one, samples in zip(ready, times, strict=True)
        ]
        on_front = {entry.name for entry in with_front(entries) if entry.on_front}
        self.told("screening")
        return [one.way for one in ready if one.way.name in on_front]


def search(
    scene: Scene,
    size: tuple[int, int],
    *,
    seed: int,
    budget: int = BUDGET,
    told: Told = lambda name: None,
) -> Candidates:
    """Everything that is worth measuring; with a budget of 0 the named ways alone. `told` after each kernel."""
    work = _Search(scene, size, seed, budget, told)
    work.add(named_ways(scene, size), free=True)
    starts = [one.way for one in work.known.values() if one.way.kind == "level" and one.way.level in STARTS]
    if budget:
        work.add(move for start in starts for move in moved(start, scene, size))
        good = [way for way in work.front(("level", "choice")) if way.choices]
        for count in (2, 3):
            pairs = [combined(ways) for ways in _of_one_level(good, count)]
            work.add(way for way in pairs if way is not None)
        if planned(scene, aspect=size[0] / size[1]).arrangement is None:
            best = work.front(("level", "choice"))
            work.add(way for one in best if one.choices and (way := baked(one)) is not None)
    return Candidates(tuple(work.known.values()), budget - work.left)


def _of_one_level(ways: Sequence[Way], count: int) -> list[tuple[Way, ...]]:
    return [group for group in combinations(ways, count) if len({way.level for way in group}) == 1]


def _screened(ready: Ready, ratios: NDArray[np.float64], sample: Sample) -> Entry:
    way = ready.way
    median = float(np.nanmedian(ratios))
    errors = errors_of(ready.field, sample, way.side)
    return Entry(
        name=way.name,
        kind=way.kind,
        does=way.does,
        level=way.level,
        choices=way.choices,
        target=way.target,
        bake=way.bake,
        ns=Spread(median, median, median),
        ratio=Spread(1.0, 1.0, 1.0),
        errors=errors,
        bound=None,
        lines=ready.lines,
        operations=ready.operations,
        derive=ready.derive,
        compile=ready.compile,
    )
