"""The failure atlas: how far each accuracy level is from the truth along five axes, and where each breaks.

Comes in: names of levels, a seed. Goes out: Atlas: for each axis and level the worst error of every bin, in the
level's own ulp and absolute, on the unclipped field against the oracle; where its promise breaks first on the way out
from where the axis is easy. Never done here: the scenes (sweeps), the drawing (atlas_chart).

A level whose promise has no figure, such as `literal`, is held to one of atlas_limits.HELD_TO.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import AccuracyError, ArgumentError, OutsidePlanError
from symrender_cg.lower.variants import ACCURACIES
from symrender_cg.reference import oracle
from symrender_cg.run.render import evaluate
from symrender_cg.stress.atlas_limits import Limit, Measure, limit_of
from symrender_cg.stress.conditioning import Conditioning, condition_at
from symrender_cg.stress.sweeps import AXES, Axis, Case, cases_of

Floats: TypeAlias = npt.NDArray[np.float64]

LEVELS: Final = ("literal", "double", "stable")
SEED: Final = 1
SCENES: Final = 24
POINTS: Final = 12
"""Scenes a bin and points a scene, unless asked otherwise."""
FLOAT32_ULP: Final = 2.0**29
"""An ulp of float32 in ulp of float64."""
EVERY_DIGIT: Final = 2.0**53
"""Stands for any error of that many ulp and more, and for an infinite one: no digit is right."""


@dataclass(frozen=True, slots=True)
class Bin:
    """The worst of the points whose abscissa lies in [low, high), exponents of the axis' base.

    ulp, absolute: the largest error; infinite where a value is not finite or where truth is 0 and the value is not.
    flips: points where exactly one of value and truth is 0, or the background. nonfinite: NaN and infinite values.
    refused: points of scenes that the level refuses to render, or declares undecided. count: points, refused included.
    excess: the largest error over what half an ulp of every input, in the level's format, moves the point, and half an
    ulp of the value; points that such a move flips are left out.
    """

    low: float
    high: float
    ulp: float
    absolute: float
    flips: int
    nonfinite: int
    refused: int
    count: int
    excess: float

    def error(self, measure: Measure) -> float:
        """The largest error of that kind."""
        return self.ulp if measure == "ulp" else self.absolute


@dataclass(frozen=True, slots=True)
class Curve:
    """One level on one axis. breaks: the first points beyond the limit, going down and going up from the easy place, as
    exponents of the axis' base; None where there is none."""

    level: str
    bins: tuple[Bin, ...]
    limit: Limit
    breaks: tuple[float | None, float | None]

    @property
    def worst(self) -> tuple[float, float]:
        """The largest error of all bins in ulp, and absolute."""
        return max((b.ulp for b in self.bins), default=0.0), max((b.absolute for b in self.bins), default=0.0)

    @property
    def excess(self) -> float:
        """The largest excess of all bins."""
        return max((b.excess for b in self.bins), default=0.0)


@dataclass(frozen=True, slots=True)
class Panel:
    """One axis with a curve for each level; moved: for each bin what half an ulp of every float64 input moves a point
    at most, in ulp and absolute, infinite where a point flips."""

    axis: str
    title: str
    base: int
    easy: float
    curves: tuple[Curve, ...]
    moved: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Atlas:
    """All panels; the same seed and counts give the same scenes and points."""

    panels: tuple[Panel, ...]
    levels: tuple[str, ...]
    seed: int
    scenes: int
    points: int

    @property
    def count(self) -> int:
        """Points a level."""
        return sum(b.count for panel in self.panels for b in panel.curves[0].bins) if self.levels else 0


def measure_atlas(
    levels: Iterable[str] | None = None,
    *,
    seed: int = SEED,
    scenes: int = SCENES,
    points: int = POINTS,
    axes: Iterable[str] | None = None,
    done: Callable[[str], None] | None = None,
) -> Atlas:
    """Measures the levels along the axes; a few seconds a level.

    levels: names; None is literal, double and stable. axes: names of sweeps.AXES; None is all.
    done: called with the name of each axis that is finished. Raises ArgumentError for an unknown name or no points.
    """
    names = known_levels(levels)
    if min(scenes, points) < 1:
        raise ArgumentError(f"scenes and points: {scenes} and {points}; expected at least 1 of each")
    panels = []
    for axis in _chosen(axes):
        panels.append(_panel(axis, names, seed, scenes, points))
        if done is not None:
            done(axis.name)
    return Atlas(tuple(panels), names, seed, scenes, points)


def draw_atlas(path: str | Path, atlas: Atlas) -> None:
    """Writes the chart: .png, .svg or .pdf by the name. Raises ArgumentError for another, or without matplotlib."""
    from symrender_cg.stress.atlas_chart import draw

    draw(path, atlas)


def known_levels(levels: Iterable[str] | None) -> tuple[str, ...]:
    """The levels asked for, each once; None: those of LEVELS. Raises ArgumentError for an unknown one."""
    names = LEVELS if levels is None else tuple(dict.fromkeys(levels))
    for name in names:
        if name not in ACCURACIES:
            raise ArgumentError(f"levels: {name!r} is not known; expected some of {', '.join(ACCURACIES)}")
    return names


def as_data(atlas: Atlas) -> dict[str, Any]:
    """The atlas as what JSON holds; an infinite error becomes null."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain(entry) for key, entry in value.items()}
        if isinstance(value, (list, tuple)):
            return [plain(entry) for entry in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return dict(plain(asdict(atlas)))


def power_text(base: int, exponent: float) -> str:
    """An abscissa to two digits: `3.2e-4`, `0.68`, `740`, `2^-275`."""
    if base == 2:
        return f"2^{exponent:.0f}"
    if -2.0 <= exponent < 3.0:
        text = f"{10.0**exponent:.2g}"
        return f"{float(text):g}"
    whole = math.floor(exponent)
    digits = f"{10.0 ** (exponent - whole):.1f}"
    if digits == "10.0":
        digits, whole = "1.0", whole + 1
    return f"{digits.removesuffix('.0')}e{whole}"


# ------------------------------------------------------------------------------------------------------- measurement


@dataclass(slots=True)
class _Worst:
    """What the points of one bin add up to; failing: the abscissas of those beyond the level's limit."""

    ulp: float = 0.0
    absolute: float = 0.0
    flips: int = 0
    nonfinite: int = 0
    refused: int = 0
    count: int = 0
    excess: float = 0.0
    failing: list[float] = field(default_factory=list)


def _chosen(names: Iterable[str] | None) -> tuple[Axis, ...]:
    if names is None:
        return AXES
    wanted = tuple(names)
    for name in wanted:
        if name not in {axis.name for axis in AXES}:
            raise ArgumentError(f"axes: {name!r} is not known; expected some of {', '.join(a.name for a in AXES)}")
    return tuple(axis for axis in AXES if axis.name in wanted)


def _panel(axis: Axis, levels: tuple[str, ...], seed: int, scenes: int, points: int) -> Panel:
    bins = {level: [_Worst() for _ in axis.edges[1:]] for level in levels}
    moved = [(0.0, 0.0)] * (len(axis.edges) - 1)
    for case in cases_of(axis, seed, scenes, points):
        truth = oracle.evaluate(case.scene, case.x, case.y)
        moves = condition_at(case.scene, case.x, case.y)
        place = np.clip(np.searchsorted(axis.edges, case.abscissa, side="right") - 1, 0, len(axis.edges) - 2)
        for bin_ in np.unique(place):
            here = place == bin_
            ulps, absolute = float(moves.ulps[here].max()), float(moves.absolute[here].max())
            moved[bin_] = max(moved[bin_][0], ulps), max(moved[bin_][1], absolute)
        for level in levels:
            values = _values(case, level)
            for bin_ in np.unique(place):
                _count(bins[level][bin_], case, values, truth, moves, place == bin_, limit_of(level))
    curves = tuple(_curve(axis, level, bins[level]) for level in levels)
    return Panel(axis.name, axis.title, axis.base, axis.easy, curves, tuple(moved))


def _values(case: Case, level: str) -> npt.NDArray[Any] | None:
    """The level's unclipped values; None where it refuses the scene."""
    try:
        return np.asarray(evaluate(case.scene, case.x, case.y, accuracy=level, clip=False))
    except (OutsidePlanError, AccuracyError):
        return None


def _count(
    into: _Worst,
    case: Case,
    values: npt.NDArray[Any] | None,
    truth: oracle.Answers,
    moves: Conditioning,
    chosen: npt.NDArray[np.bool_],
    limit: Limit,
) -> None:
    """Adds what `values` are off at the chosen points; None stands for a refusal."""
    into.count += int(np.count_nonzero(chosen))
    if values is None:
        into.refused += int(np.count_nonzero(chosen))
        return
    given = values[chosen]
    answer = (truth.value if given.dtype == np.float64 else truth.value32)[chosen]
    finite = np.isfinite(given)
    with np.errstate(all="ignore"):
        error = np.abs((given.astype(np.float64) - truth.value[chosen]) - truth.residual[chosen])
        error = np.where(finite, error, np.inf)
        unit = np.abs(np.spacing(answer)).astype(np.float64)
        format_ratio = 1.0 if given.dtype == np.float64 else FLOAT32_ULP
        excess = error / (format_ratio * moves.absolute[chosen] + 0.5 * unit)
        ulps = np.where(error == 0.0, 0.0, np.where(answer == 0, np.inf, error / unit))
    into.absolute = max(into.absolute, float(error.max()))
    into.ulp = max(into.ulp, float(ulps.max()))
    into.flips += int(np.count_nonzero(finite & ((given == 0) != (answer == 0))))
    into.nonfinite += int(np.count_nonzero(~finite))
    beyond = (ulps if limit.measure == "ulp" else error) > limit.most
    into.failing += [float(at) for at in case.abscissa[chosen][beyond]]
    into.excess = max(into.excess, float(np.where(moves.flips[chosen] | (error == 0.0), 0.0, excess).max()))


def _curve(axis: Axis, level: str, found: list[_Worst]) -> Curve:
    bins = tuple(
        Bin(low, high, w.ulp, w.absolute, w.flips, w.nonfinite, w.refused, w.count, w.excess)
        for low, high, w in zip(axis.edges, axis.edges[1:], found, strict=False)
    )
    failing = [at for w in found for at in w.failing]
    below = max((at for at in failing if at <= axis.easy), default=None)
    above = min((at for at in failing if at > axis.easy), default=None)
    return Curve(level, bins, limit_of(level), (below, above))


def breaking_points(atlas: Atlas) -> tuple[tuple[str, ...], ...]:
    """A row of text for each axis and level: title, level, limit, breaks below, above, worst ulp, error, excess."""
    rows = []
    for panel in atlas.panels:
        for curve in panel.curves:
            below, above = ("never" if at is None else power_text(panel.base, at) for at in curve.breaks)
            ulp, absolute = curve.worst
            figures = f"{ulp:.3g}", f"{absolute:.2e}", f"{curve.excess:.2g}"
            rows.append((panel.title, curve.level, str(curve.limit), below, above, *figures))
    return tuple(rows)
