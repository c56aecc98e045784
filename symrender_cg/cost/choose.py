"""`choose`: the fastest way on this machine whose bound meets what is asked for, or an error that says why not.

Comes in: a Scene and one of max_error, max_ulp, bits. Goes out: Choice, with everything that was considered. Never done
here: drawing the image; a measurement (looking.py) and the order in which ways are looked at (walk.py).

    max_error   absolute, on the unclipped field
    max_ulp     units in the last place of the result's format: float64, or what `dtype` says
    bits        half a step of so many bits, 0.5 / (2^bits - 1), on the image cut to [0, 1]

The ways are those of `cost` that render_image can draw (variants.requestable): every level, every combination of
choices, plans within a tolerance; baked kernels where `bake` asks for them, as each is compiled for one scene alone.

A bound is *proved* for `stable` and `certified`, whatever the scene. For the others it is *measured*: the largest error
against the oracle over POINTS points of the window and hard points of the scene (both sides of outlines; terminator and
highlight of one sphere; places on every surface), times MARGIN (in ulp ULP_MARGIN), and never below MARGIN units in the
last place of the brightest value seen. Where the image jumps (edges of shadows, tiles, mirrored and intersecting
surfaces, gated highlights) a float32 kernel takes the other side within some 1e-7 of an edge, which no sample of points
bounds: of what is not proved such scenes are drawn by `double` alone, or by a plan that leaves out what jumps because
it is within the tolerance. And where `double` hands over to `stable`, no kernel stands in for it that would not.

What proves its values costs more than what does not, so it is compiled and timed only if nothing else meets the bound,
or if `proved` asks for it. Times are kept for a plan, errors and the choice for a scene; a second call looks it up.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final, Literal

import msgspec
import numpy as np
from numpy.typing import DTypeLike

from symrender_cg.cost.bounds import brightest, proved_bounds, strength_of_highlights
from symrender_cg.cost.looking import Looking, window_of
from symrender_cg.cost.records import Largest, keep_choice, kept_choice
from symrender_cg.cost.variants import DEFAULT, Way, requestable
from symrender_cg.cost.walk import BUILDS, walk
from symrender_cg.errors import AccuracyError, ArgumentError
from symrender_cg.pipeline import planned
from symrender_cg.plan.plan import Plan
from symrender_cg.run.levels import hands_over, job_of
from symrender_cg.scene import Scene, load_scene

MARGIN: Final = 4.0
ULP_MARGIN: Final = 8.0
"""Errors in ulp have a longer tail: a value near 0 that no sample found has many of them."""
LEAST_ERROR: Final = {"coarse": 4e-4, "fast": 3e-5}
"""Of powers by polynomials, for each unit of intensity that highlights may have: a quarter of what is usual. A request
for less builds no kernel with them."""

JUMPS: Final = frozenset({"intersections", "crossing", "checker", "specular_gate", "shadows", "mirrors"})
"""Flags of a plan whose image has edges that no exact test decides at every level."""

Unit = Literal["absolute", "ulp"]
Kind = Literal["proved", "measured"]


class Considered(msgspec.Struct, frozen=True):
    """A way that was looked at: its time, its bound in the unit that was asked for, and whether that is enough."""

    way: str
    result: str
    kind: Kind
    bound: float
    meets: bool
    ns: float | None = None


class Choice(msgspec.Struct, frozen=True):
    """What render_image and evaluate draw with: `accuracy`, `target`, `bake` as they take them.

    asked       the request in words
    unit        of the bound: absolute, or ulp of the result's format
    kind        proved, or measured with a margin
    ns          nanoseconds a pixel on one thread, as it was timed for this plan
    tolerance   what its plan may leave out, part of the bound; 0 for the scene's own plan, which `accuracy` alone means
    considered  everything that was looked at, the fastest first; what was not timed last
    possible    how many ways of the scene could have been looked at
    """

    asked: str
    way: str
    accuracy: str
    target: str | None
    bound: float
    unit: Unit
    kind: Kind
    ns: float | None
    considered: tuple[Considered, ...]
    bake: bool = False
    tolerance: float = 0.0
    possible: int = 0

    def __str__(self) -> str:
        unit = "" if self.unit == "absolute" else " ulp"
        margin = MARGIN if self.unit == "absolute" else ULP_MARGIN
        how = "proved" if self.kind == "proved" else f"measured, times a margin of {margin:g}"
        if self.tolerance:
            how += f", and {self.tolerance:g} for what is left out"
        return f"{self.asked}: `{self.way}`, bound {self.bound:.2g}{unit} ({how}), {self.ns:.2f} ns a pixel"


def choose(
    scene: Scene | str | Path | None = None,
    *,
    max_error: float | None = None,
    max_ulp: float | None = None,
    bits: float | None = None,
    proved: bool = False,
    dtype: DTypeLike | None = None,
    reach: float = 1.0,
    aspect: float = 1.0,
    flags: bool = True,
    plans: bool = True,
    bake: bool = False,
    builds: int = BUILDS,
    cache: str | Path | None = None,
) -> Choice:
    """The fastest way that meets max_error, max_ulp or bits; exactly one of them is given.

    proved   take a proved bound and no measured one
    dtype    the format of the result: float32 or float64; any for max_error and bits, float64 for max_ulp, if left out
    reach    half-heights of the window that points may be away from its middle, for `evaluate`
    aspect   width of the image over its height
    flags    take also ways that are compiled with flags of their own; without them for C that others compile
    plans    take also plans that leave out what is within a tolerance
    bake     take also kernels with the scene's numbers folded in (one sphere): each is compiled for this scene alone
    builds   kernels that may be compiled to find what has no proved bound

    Raises AccuracyError (exit code 4) with the reason where nothing meets it, ArgumentError for a request that is none.
    """
    asked, limit, unit = _request(max_error, max_ulp, bits)
    wanted = None if dtype is None else np.dtype(dtype).name
    if wanted not in (None, "float32", "float64"):
        raise ArgumentError(f"dtype: {wanted} holds no intensities; expected float32 or float64")
    if unit == "ulp" and wanted is None:
        wanted = "float64"
    chosen = load_scene(scene)
    bench = Looking(chosen, reach=reach, aspect=window_of(aspect), cache=cache)
    request = repr((asked, limit, wanted, proved, flags, plans, bake, builds, bench.places, bench.searched))
    if (kept := kept_choice(Choice, chosen, request, cache)) is not None:
        return kept
    every = [
        way
        for way in requestable(chosen, bake=bake)
        if wanted in (None, way.variant.result)
        and way.variant.result != "uint8"
        and (flags or not way.variant.flags)
        and (plans or not way.tolerance)
    ]
    task = _Task(chosen, asked, limit, unit, bench, len(every))
    found = None if proved else task.measured([way for way in every if task.may_be_measured(way)], builds)
    found = found or task.proved([way for way in every if way.variant.settles])
    if found is None:
        raise AccuracyError(task.refusal(proved=proved))
    keep_choice(chosen, request, found, cache)
    return found


def jumps(found: Plan) -> bool:
    """Whether the image of a plan has edges that are no sphere's outline."""
    if found.arrangement is None:
        return found.needs("specular_gate")
    return bool(found.flags & JUMPS)


def measured_bound(errors: Largest, top: float, result: str, tolerance: float, unit: Unit) -> float:
    """The margin times the largest error, not below that of one unit in the last place; inf where there is none."""
    if unit == "ulp":
        return ULP_MARGIN * max(errors.ulp, 0.5)
    return tolerance + MARGIN * max(errors.absolute, float(np.spacing(np.asarray(top, result))))


def _request(max_error: float | None, max_ulp: float | None, bits: float | None) -> tuple[str, float, Unit]:
    given = [(n, v) for n, v in (("max_error", max_error), ("max_ulp", max_ulp), ("bits", bits)) if v is not None]
    if len(given) != 1:
        names = ", ".join(name for name, _ in given) or "none"
        raise ArgumentError(f"max_error, max_ulp, bits: {names} given; expected exactly one of them")
    name, value = given[0]
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0.0 < value < math.inf:
        raise ArgumentError(f"{name}: {value!r}; expected a finite number above 0")
    number = float(value)
    if name == "bits" and not 1.0 <= number <= 1000.0:
        raise ArgumentError(f"bits: {value!r}; expected a number of bits from 1 to 1000")
    limit = 0.5 / (2.0**number - 1.0) if name == "bits" else number
    return f"{name}={number:g}", limit, "ulp" if name == "max_ulp" else "absolute"


class _Task:
    """A request in one scene."""

    def __init__(self, scene: Scene, asked: str, limit: float, unit: Unit, bench: Looking, possible: int) -> None:
        self.scene, self.asked, self.limit, self.unit, self.bench = scene, asked, limit, unit, bench
        self.possible = possible
        self.considered: list[Considered] = []
        self._plain = not jumps(planned(scene)) and not hands_over(scene)

    def may_be_measured(self, way: Way) -> bool:
        """Whether a sample of points tells the errors of the way."""
        if way.variant.settles or (way.tolerance and (self.unit == "ulp" or way.tolerance >= self.limit)):
            return False
        if way.name == DEFAULT or self._plain:
            return True
        if not way.tolerance:
            return False
        return way.level == DEFAULT or not jumps(planned(self.scene, max_error=way.tolerance))

    def measured(self, ways: list[Way], builds: int) -> Choice | None:
        """The fastest of what was looked at that meets the request, where any does."""
        if self.unit == "ulp" and self.limit < ULP_MARGIN * 0.5:
            return None
        known = {way.name: proof for way in ways if (proof := self._handed_over(way)) is not None}
        if not known and self.bench.searched and self._plain:
            ways = [way for way in ways if way.name in self.bench.ratios or way.tolerance]
        if not known:
            walk(ways, self.bench, excess=self._excess, hopeless=self._hopeless, builds=builds)
        seen = [way for way in ways if way.name in known or way.name in self.bench.errors]
        bounds = {way.name: known.get(way.name) or self._bound(way) for way in seen}
        return self._fastest(seen, bounds, "proved" if known else "measured")

    def proved(self, ways: list[Way]) -> Choice | None:
        """The fastest of what proves its values and meets the request, where any does."""
        bounds = {way.name: self._of(proved_bounds(self.scene, way.variant)) for way in ways}
        return self._fastest(ways, bounds, "proved")

    def refusal(self, *, proved: bool) -> str:
        """Why nothing meets the request."""
        if not self.considered:
            what = "no variant of this scene gives results of that format"
            return f"{self.asked}: {what}; leave `dtype`, or `out`, as it is"
        best = min(self.considered, key=lambda entry: entry.bound)
        word = "ulp" if self.unit == "ulp" else "absolute"
        how = "proved" if best.kind == "proved" else "measured with its margin"
        only = " that is proved" if proved else ""
        return (
            f"{self.asked}: no variant{only} has a bound of {self.limit:.3g} {word} on this scene; the nearest is "
            f"{best.way!r} with {best.bound:.3g} ({how}); ask for that much, or let certify() name what is left"
        )

    def _fastest(self, ways: list[Way], bounds: dict[str, float], kind: Kind) -> Choice | None:
        good = [way for way in ways if bounds[way.name] <= self.limit]
        if untimed := [way for way in good if way.name not in self.bench.ratios]:
            self.bench.time(untimed)
        times = {name: ratio * self.bench.unit for name, ratio in self.bench.ratios.items()}
        order = sorted(ways, key=lambda way: (times.get(way.name, math.inf), way.name))
        self.considered += [
            Considered(
                way.name,
                way.variant.result,
                kind,
                bounds[way.name],
                bounds[way.name] <= self.limit,
                times.get(way.name),
            )
            for way in order
        ]
        if not good:
            return None
        best = next(way for way in order if bounds[way.name] <= self.limit)
        return Choice(
            self.asked,
            best.name,
            best.accuracy,
            best.target,
            bounds[best.name],
            self.unit,
            kind,
            times[best.name],
            tuple(self.considered),
            best.bake,
            best.tolerance,
            self.possible,
        )

    def _handed_over(self, way: Way) -> float | None:
        """The bound of `double` where `stable` draws for it."""
        if way.name != DEFAULT or (job := job_of(self.scene, DEFAULT, clip=False)) is None:
            return None
        return self._of(proved_bounds(self.scene, job.variant))

    def _of(self, bounds: tuple[float, float] | None) -> float:
        assert bounds is not None, "the variant proves its values"
        return min(bounds[0] if self.unit == "absolute" else bounds[1], 1e300)

    def _bound(self, way: Way) -> float:
        errors = self.bench.errors[way.name]
        return min(measured_bound(errors, self.bench.top, way.variant.result, way.tolerance, self.unit), 1e300)

    def _excess(self, way: Way, errors: Largest) -> float:
        return self._bound(way) / self.limit

    def _hopeless(self, way: Way) -> bool:
        """Whether the least error that the format, or powers by polynomials, can have is too large already."""
        if self.unit == "ulp":
            unit = float(np.spacing(np.float32(min(brightest(self.scene), 1e30))))
            floor = ULP_MARGIN * LEAST_ERROR.get(way.variant.functions, 0.0) * strength_of_highlights(self.scene) / unit
            return floor > self.limit
        least = LEAST_ERROR.get(way.variant.functions, 0.0) * strength_of_highlights(self.scene)
        return (
            measured_bound(Largest(least, 0.0), self.bench.top, way.variant.result, way.tolerance, "absolute")
            > self.limit
        )
