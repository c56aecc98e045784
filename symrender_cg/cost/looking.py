"""What a request measures: kernels compiled, errors against the oracle at its points, ratios to `double`.

Comes in: a Scene, ways, where its points lie. Goes out: errors and ratios by name of the way, kept for later requests.
Never done here: a choice; walk.py says what is looked at.

A way by a plan within a tolerance is compared with `double` by the same plan, whose promise is 1e-15 max(1, value):
what the plan leaves out is bounded by its tolerance, and added to the bound of the way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final

import msgspec
import numpy as np

from symrender_cg.build.cache import Cache
from symrender_cg.cost.ready import Place, drawer, field_of, make_ready, recipe_for
from symrender_cg.cost.records import (
    MOST,
    ErrorsSeen,
    Largest,
    errors_seen,
    habits_of,
    keep_errors,
    keep_times,
    times_of,
)
from symrender_cg.cost.report import Entry, Report
from symrender_cg.cost.sample import Sample, draw_sample, errors_of
from symrender_cg.cost.timing import interleaved
from symrender_cg.cost.variants import DEFAULT, Kind, Way, content, requestable, way_of
from symrender_cg.scene import Scene

POINTS: Final = 1000
HARD: Final = 250
SEED: Final = 20_240_501
ROUNDS: Final = 5
TIMED: Final = (256, 256)


def learn(scene: Scene, report: Report, top: float, *, cache: Place = None) -> None:
    """Keeps what a run of `cost` measured for the requests that follow; top: the brightest value of its sample.

    Errors are kept where the plan was the scene's own, for the widest window of requests that the image covered. After
    a run with a search requests choose among the ways that it timed.
    """
    entries = entries_by_way(scene, report)
    known = times_of(scene, cache).with_ratios(0.0, {way.name: one.ratio.median for way, one in entries.items()})
    unit, searched = report.entry(DEFAULT).ns.median, known.searched + (not report.quick)
    keep_times(scene, msgspec.structs.replace(known, unit=unit, searched=searched), cache)
    aspect = report.width / report.height
    if aspect < 1.0:
        return
    places = Looking(scene, reach=1.0, aspect=2.0 ** math.floor(math.log2(aspect)), cache=cache).places
    found = {
        way.name: Largest(one.errors.largest, one.errors.ulp) if one.errors.sound else Largest(MOST, MOST)
        for way, one in entries.items()
        if not way.tolerance
    }
    seen = errors_seen(scene, places, cache)
    brightest = top if seen.top is None else max(top, seen.top)
    keep_errors(scene, places, ErrorsSeen(brightest, {**seen.largest, **found}), cache)


def entries_by_way(scene: Scene, report: Report) -> dict[Way, Entry]:
    """The entries of a report that a request can choose; a way has one name here, and may have another there."""
    ways = {content(way): way for way in requestable(scene, bake=True)}
    plans = {way.name: way for way in ways.values() if way.tolerance}
    found = {}
    for one in report.entries:
        if one.kind == "plan":
            way = plans.get(one.name)
        elif one.kind in ("level", "choice", "baked"):
            kind: Kind = "baked" if one.bake else "choice" if one.choices else "level"
            way = ways.get(content(Way(one.name, kind, one.does, one.level, one.choices, one.target, one.bake)))
        else:
            way = None
        if way is not None:
            found[way] = one
    return found


def window_of(aspect: float) -> float:
    """How many times as wide as high the window of points is, for an image of that aspect: 1, 2, 4, ..."""
    return 2.0 ** max(0, math.ceil(math.log2(aspect)))


class Looking:
    """Measurements of one scene: those that are known, and, once `look` and `time` are asked for more, those as well.

    reach    half-heights of the window that points may be away from its middle
    aspect   how many times as wide as high the window is, 1 or more
    """

    def __init__(self, scene: Scene, *, reach: float, aspect: float, cache: Place) -> None:
        self.scene, self.cache = scene, cache
        self.size = (round(TIMED[0] * aspect), TIMED[1])
        self.reach = reach
        self.places = f"{POINTS} {HARD} {SEED} {reach} {self.size}"
        self._seen = errors_seen(scene, self.places, cache)
        self._times = times_of(scene, cache)
        self.usual = habits_of(scene, cache)

    @property
    def errors(self) -> Mapping[str, Largest]:
        return self._seen.largest

    @property
    def ratios(self) -> Mapping[str, float]:
        return self._times.ratios

    @property
    def unit(self) -> float:
        """Nanoseconds a pixel of `double` on one thread."""
        return self._times.unit

    @property
    def searched(self) -> int:
        """How many runs of `cost` looked at this plan."""
        return self._times.searched

    @property
    def top(self) -> float:
        """The brightest value of the sample."""
        if self._seen.top is None:
            self._seen = msgspec.structs.replace(self._seen, top=self._brightest())
        assert self._seen.top is not None
        return self._seen.top

    def built(self, way: Way) -> bool:
        """Whether its kernel is in the cache."""
        recipe = recipe_for(way, self.scene)
        return Cache(self.cache).recall(recipe, extra_flags=way.variant.flags) is not None

    def look(self, ways: Sequence[Way]) -> None:
        """The largest errors of the ways at the sample's points."""
        self._build([*ways, way_of(DEFAULT)])
        found = {way.name: self._largest(way) for way in ways}
        self._seen = ErrorsSeen(self.top, {**self._seen.largest, **found})
        keep_errors(self.scene, self.places, self._seen, self.cache)

    def time(self, ways: Sequence[Way]) -> None:
        """Ratios of the ways to `double`: of the shortest rounds, as one that was disturbed must decide nothing."""
        base = way_of(DEFAULT)
        every = [base, *(way for way in ways if way.name != DEFAULT)]
        self._build(every)
        samples = interleaved([drawer(way, self.scene, TIMED, cache=self.cache) for way in every], ROUNDS, SEED)
        least = np.nanmin(np.asarray(samples), axis=1)
        unit = float(least[0]) * 1e9 / (TIMED[0] * TIMED[1])
        ratios = {way.name: float(seconds / least[0]) for way, seconds in zip(every, least, strict=True)}
        self._times = times_of(self.scene, self.cache).with_ratios(unit, ratios)
        keep_times(self.scene, self._times, self.cache)

    @cached_property
    def _sample(self) -> Sample:
        return draw_sample(self.scene, self.size, POINTS, HARD, SEED, reach=self.reach)

    def _brightest(self) -> float:
        return float(np.abs(self._sample.truth.value).max(initial=0.0))

    def _largest(self, way: Way) -> Largest:
        values = field_of(way, self.scene, self.size, cache=self.cache)
        if not way.tolerance:
            found = errors_of(values, self._sample)
            return Largest(MOST, MOST) if not found.sound else Largest(found.largest, min(found.ulp, MOST))
        same = field_of(replace(way_of(DEFAULT), tolerance=way.tolerance), self.scene, self.size, cache=self.cache)
        x, y = self._sample.x, self._sample.y
        truth = np.asarray(same(x, y), np.float64)
        apart = np.abs(np.asarray(values(x, y), np.float64) - truth)
        promised = 1e-15 * max(1.0, float(np.abs(truth).max(initial=0.0)))
        largest = float(apart.max(initial=0.0)) + promised
        return Largest(largest if math.isfinite(largest) else MOST, MOST)

    def _build(self, ways: Sequence[Way]) -> None:
        """Compiles what the cache lacks, side by side."""
        missing = [way for way in dict.fromkeys(ways) if not way.variant.settles and not self.built(way)]
        if missing:
            make_ready(missing, self.scene, TIMED, cache=self.cache)
