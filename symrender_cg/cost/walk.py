"""Which ways a request looks at: in the order of the time that they may take, and no more than may win.

Comes in: ways, a bench that measures, the rule of the request. Goes out: nothing; the bench knows what was measured.
Never done here: a compilation, a choice.

    1  next are the ways without a known error, the fastest expected first, that are expected to be faster than the
       fastest way that is known to meet the request; none of them: the walk is over
    2  of ways that differ in nothing that moves their errors much (order of rows, passes, contraction) one is looked
       at first; where its error is SLACK times too large, or two of them fail, the others are left out
    3  what is too wrong whatever the scene (`hopeless`) is left out
    4  BATCH of them are compiled side by side, their errors measured; what meets the request is timed
    5  a request compiles at most BUILDS kernels; what is compiled already counts for nothing

After a run of `cost` the errors and times of its ways are known, and nothing is left to do for that scene.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Protocol

from symrender_cg.cost.expected import expected
from symrender_cg.cost.records import Largest
from symrender_cg.cost.variants import Way

BUILDS: Final = 8
BATCH: Final = 3
SLACK: Final = 2.0
TRIES: Final = 2


class Bench(Protocol):
    """What measures: errors and ratios to `double` by name of the way, as far as they are known."""

    @property
    def errors(self) -> Mapping[str, Largest]: ...

    @property
    def ratios(self) -> Mapping[str, float]: ...

    @property
    def usual(self) -> Mapping[str, float]: ...

    def built(self, way: Way) -> bool:
        """Whether its kernel is compiled already."""
        ...

    def look(self, ways: Sequence[Way]) -> None:
        """Measures their errors."""
        ...

    def time(self, ways: Sequence[Way]) -> None:
        """Measures their ratios."""
        ...


def walk(
    ways: Sequence[Way],
    bench: Bench,
    *,
    excess: Callable[[Way, Largest], float],
    hopeless: Callable[[Way], bool] = lambda way: False,
    builds: int = BUILDS,
) -> None:
    """Looks at ways until the fastest that meets the request is known, or nothing else is expected to, or `builds`
    kernels are compiled.

    excess     bound of the way over the limit of the request: at most 1 where it meets it
    hopeless   what is not worth a kernel, asked only where the error is not known
    """
    while True:
        known = {way.name: excess(way, bench.errors[way.name]) for way in ways if way.name in bench.errors}
        good = [way for way in ways if known.get(way.name, math.inf) <= 1.0]
        if untimed := [way for way in good if way.name not in bench.ratios]:
            bench.time(untimed)
        best = min((bench.ratios[way.name] for way in good), default=math.inf)
        failed = _failed(ways, known)
        seen = {kind_of(way) for way in ways if way.name in known}
        batch: list[Way] = []
        costs = 0
        for way in _in_order([way for way in ways if way.name not in known], bench, ways, best):
            kind = kind_of(way)
            if kind in failed or hopeless(way):
                continue
            if kind not in seen and any(kind_of(one) == kind for one in batch):
                continue
            if not bench.built(way):
                if costs >= builds:
                    continue
                costs += 1
            batch.append(way)
            if len(batch) == BATCH:
                break
        if not batch:
            return
        builds -= costs
        bench.look(batch)


def kind_of(way: Way) -> tuple[object, ...]:
    """What moves its errors by more than a factor of about SLACK: format, powers, form of the highlight, plan."""
    variant = way.variant
    return variant.shading, variant.powers, "complement" in variant.forms, way.tolerance


def _failed(ways: Sequence[Way], known: Mapping[str, float]) -> set[tuple[object, ...]]:
    """Kinds of ways that will not meet the request: one is far from it, or TRIES are not far but none does."""
    over = [(kind_of(way), known[way.name]) for way in ways if known.get(way.name, 0.0) > 1.0]
    met = {kind_of(way) for way in ways if known.get(way.name, math.inf) <= 1.0}
    tries = Counter(kind for kind, _ in over)
    return {kind for kind, far in over if far > SLACK or (tries[kind] >= TRIES and kind not in met)}


def _in_order(pending: Sequence[Way], bench: Bench, ways: Sequence[Way], best: float) -> list[Way]:
    """The ways that are expected to be faster than `best`, the fastest first."""
    times = {way.name: expected(way, bench.ratios, bench.usual, ways) for way in pending}
    return sorted((way for way in pending if times[way.name] < best), key=lambda way: (times[way.name], way.name))
