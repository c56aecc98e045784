"""The failure atlas as a chart: a row of two panels an axis, the absolute error left, the error in ulp right.

Comes in: an Atlas and a file name. Goes out: a .png, .svg or .pdf, a page that reads in print and without colour:
levels differ by line style and are named at the line's end; where one first breaks its limit it has a mark and the
abscissa.
Never done here: a measurement. matplotlib is imported when a chart is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from symrender_cg.errors import ArgumentError
from symrender_cg.output import replacing
from symrender_cg.stress.atlas import EVERY_DIGIT, Atlas, Curve, Panel, power_text
from symrender_cg.stress.atlas_limits import Measure, limit_of, promised_range

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES: Final = (".png", ".svg", ".pdf")
LOWEST: Final[dict[Measure, float]] = {"absolute": 1e-17, "ulp": 0.25}
"""The lower ends of the two scales; smaller errors, also 0, are drawn there."""
HIGHEST: Final[dict[Measure, float]] = {"absolute": 2.0, "ulp": EVERY_DIGIT}
"""The upper ends; larger errors, also infinite ones, are drawn there."""
BEYOND: Final[dict[Measure, float]] = {"absolute": 1e2, "ulp": 1e19}
"""The tops of the panels: room for a label above a line at the upper end."""
LEAST_GAP: Final = 0.085
"""Two labels at line ends are at least that share of a panel's height apart."""


@dataclass(frozen=True, slots=True)
class Style:
    """How a level's line looks: readable by its dashes and width alone."""

    colour: str
    dashes: str | tuple[int, tuple[float, ...]]
    width: float
    marker: str


STYLES: Final[dict[str, Style]] = {
    "literal": Style("#b5482a", (0, (1.0, 1.6)), 1.7, "X"),
    "fast": Style("#8a6fb0", (0, (6.0, 1.5, 1.0, 1.5, 1.0, 1.5)), 1.1, "P"),
    "single": Style("#6b6b6b", (0, (5.0, 1.6, 1.0, 1.6)), 1.1, "s"),
    "double": Style("#1f5f99", (0, (4.0, 1.8)), 1.4, "D"),
    "stable": Style("#111111", "-", 1.5, "o"),
    "certified": Style("#3a7d44", "-", 0.7, "^"),
}


def draw(path: str | Path, atlas: Atlas) -> None:
    """Writes the chart. Raises ArgumentError for another suffix, without matplotlib, or for an unwritable place."""
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise ArgumentError(f"{target}: {suffix!r} is not the suffix of a chart; expected {', '.join(SUFFIXES)}")
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise ArgumentError("matplotlib draws the chart and is missing; install it: pip install matplotlib") from None
    settings: dict[Any, Any] = {
        "svg.hashsalt": "symrender_cg",
        "svg.fonttype": "none",
        "font.size": 8.0,
        "axes.linewidth": 0.6,
    }
    with mpl.rc_context(settings):
        rows = len(atlas.panels)
        figure = Figure(figsize=(9.6, 1.4 + 2.0 * rows))
        FigureCanvasAgg(figure)
        grid = figure.subplots(rows, 2, squeeze=False)
        for axes, panel in zip(grid, atlas.panels, strict=True):
            _draw_panel(axes[0], panel, "absolute")
            _draw_panel(axes[1], panel, "ulp")
        inch = 1.0 / figure.get_figheight()
        figure.subplots_adjust(0.055, 0.28 * inch, 0.935, 1.0 - 1.3 * inch, wspace=0.22, hspace=0.4)
        figure.text(0.02, 1.0 - 0.22 * inch, "Where each accuracy level breaks", size=12.0, weight="bold", va="center")
        for row, line in enumerate(_caption(atlas)):
            figure.text(0.02, 1.0 - (0.44 + 0.15 * row) * inch, line, size=7.5, va="center", color="#333333")
        for axes, heading in zip(grid[0], ("absolute error", "error in ulp of the level's format"), strict=True):
            left = axes.get_position().x0
            figure.text(left, 1.0 - 1.0 * inch, heading, size=9.5, weight="bold", va="center")
        metadata: dict[str, Any] = {"Date": None} if suffix == ".svg" else {}
        with replacing(target) as file:
            figure.savefig(file, format=suffix[1:], dpi=160, metadata=metadata)


def _caption(atlas: Atlas) -> tuple[str, ...]:
    limits = "; ".join(
        f"{name} {'promises' if limit_of(name).promised else 'is held to'} {limit_of(name)}" for name in atlas.levels
    )
    return (
        f"Largest error of {atlas.scenes * atlas.points} points a bin, unclipped, against the oracle; what an axis "
        "does not vary is ordinary (e/R 2 to 8, light 1 to 20 R away, n 1 to 64).",
        "A mark and its number: the first point beyond the limit. Shaded: what half an ulp of every input moves. Open "
        "marks below: refused.",
        f"{limits[:1].upper()}{limits[1:]}.",
    )


# ------------------------------------------------------------------------------------------------------ one panel


def _draw_panel(axes: Axes, panel: Panel, measure: Measure) -> None:
    place = _places(panel.axis)
    low, high = panel.curves[0].bins[0].low, panel.curves[0].bins[-1].high
    axes.set_xlim(place(low), place(high))
    axes.set_yscale("log")
    axes.set_ylim(LOWEST[measure] * 0.6, BEYOND[measure])
    ticks = TICKS[panel.axis]
    axes.set_xticks([place(tick) for tick in ticks], [_tick(panel.base, tick) for tick in ticks])
    _set_y_ticks(axes, measure)
    axes.grid(True, which="major", color="#dddddd", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(length=2.5, width=0.6, pad=2.0, labelsize=7.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.axhline(HIGHEST[measure], color="#999999", linewidth=0.5)
    if measure == "ulp":
        axes.annotate(
            "no digit right",
            (1.0, HIGHEST[measure]),
            xycoords=("axes fraction", "data"),
            xytext=(0.0, 2.0),
            textcoords="offset points",
            fontsize=6.0,
            ha="right",
            color="#666666",
        )
    axes.set_title(panel.title.replace(" - ", " \u2212 "), loc="left", fontsize=8.5, pad=3.0)
    for curve in panel.curves:
        if curve.limit.measure == measure and curve.limit.promised:
            ends = promised_range(curve.level, panel.axis)
            first, last = place(max(low, ends[0])), place(min(high, ends[1]))
            axes.hlines(curve.limit.most, first, last, color=STYLES[curve.level].colour, linewidth=0.6)
    _draw_moved(axes, panel, measure, place)
    for curve in panel.curves:
        _draw_curve(axes, curve, measure, place)
    _mark_breaks(axes, panel, measure, place)
    _name_lines(axes, panel, measure)


def _draw_moved(axes: Axes, panel: Panel, measure: Measure, place: Callable[[float], float]) -> None:
    """A shade up to what half an ulp of every input moves: an error inside it is the scene's, not the level's."""
    bins = panel.curves[0].bins
    heights = [_clamped(moved[0 if measure == "ulp" else 1], measure) for moved in panel.moved]
    ends = [place(end) for b in bins for end in (b.low, b.high)]
    tops = [height for height in heights for _ in range(2)]
    axes.fill_between(ends, LOWEST[measure] * 0.6, tops, color="#e9e4d4", linewidth=0.0, zorder=0.5)


def _draw_curve(axes: Axes, curve: Curve, measure: Measure, place: Callable[[float], float]) -> None:
    style = STYLES[curve.level]
    drawn = [b for b in curve.bins if b.count > b.refused]
    axes.plot(
        [place(0.5 * (b.low + b.high)) for b in drawn],
        [_clamped(b.error(measure), measure) for b in drawn],
        color=style.colour,
        linestyle=style.dashes,
        linewidth=style.width,
        solid_capstyle="butt",
    )
    refused = [place(0.5 * (b.low + b.high)) for b in curve.bins if b.refused]
    bottom = [LOWEST[measure] * 0.6] * len(refused)
    axes.plot(refused, bottom, style.marker, color=style.colour, mfc="white", markersize=3.5, clip_on=False)


def _mark_breaks(axes: Axes, panel: Panel, measure: Measure, place: Callable[[float], float]) -> None:
    """A mark at the limit, at the abscissa of the first point beyond it, and that abscissa in words."""
    for curve in panel.curves:
        if curve.limit.measure != measure:
            continue
        style = STYLES[curve.level]
        for at, side in zip(curve.breaks, (-1, 1), strict=True):
            if at is None:
                continue
            axes.plot(
                place(at), curve.limit.most, style.marker, color=style.colour, markersize=5.0, mec="white", mew=0.6
            )
            left, right = axes.get_xlim()
            share = (place(at) - left) / (right - left)
            leftwards = share > 0.88 or (side < 0 and share > 0.12)
            axes.annotate(
                power_text(panel.base, at),
                (place(at), curve.limit.most),
                xytext=(-5.0 if leftwards else 5.0, -7.5 if curve.level != "literal" else 4.0),
                textcoords="offset points",
                ha="right" if leftwards else "left",
                fontsize=6.5,
                color=style.colour,
                bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.4},
            )


def _name_lines(axes: Axes, panel: Panel, measure: Measure) -> None:
    """Each level's name at the right end of its line, pushed apart where lines end together."""
    ends = []
    for curve in panel.curves:
        drawn = [b for b in curve.bins if b.count > b.refused]
        if drawn:
            ends.append((_height(_clamped(drawn[-1].error(measure), measure), measure), curve.level))
    heights: list[float] = []
    for height, _ in sorted(ends):
        heights.append(max(height, heights[-1] + LEAST_GAP if heights else height))
    overshoot = max(heights, default=0.0) - 1.0
    for height, (_, level) in zip(heights, sorted(ends), strict=True):
        style = STYLES[level]
        axes.annotate(
            level,
            (1.0, height - max(overshoot, 0.0)),
            xycoords="axes fraction",
            xytext=(3.0, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=7.0,
            color=style.colour,
            annotation_clip=False,
        )


def _clamped(error: float, measure: Measure) -> float:
    return min(max(error, LOWEST[measure]), HIGHEST[measure])


def _height(error: float, measure: Measure) -> float:
    """The share of the panel's height at which an error is drawn."""
    low, high = math.log10(LOWEST[measure] * 0.6), math.log10(BEYOND[measure])
    return (math.log10(error) - low) / (high - low)


# ----------------------------------------------------------------------------------------------------------- abscissas

TICKS: Final[dict[str, tuple[int, ...]]] = {
    "eye": (-15, -12, -9, -6, -3, 0, 3, 6, 9, 12),
    "light": (-16, -12, -8, -4, 0, 5, 10, 20, 50, 100, 300),
    "shininess": (-3, -1, 0, 1, 3, 5, 7, 9, 12),
    "scale": (-500, -400, -300, -200, -100, 0, 100, 200, 300, 400, 500),
    "silhouette": (-17, -15, -13, -11, -9, -7, -5, -3, -1),
}
CROWDED: Final = 5.0
"""Exponent from which the axis of light distances is drawn narrower and narrower."""


def _places(axis: str) -> Callable[[float], float]:
    """Where an exponent is drawn: in step, but for the light, whose last 295 decades get half of the width."""

    def place(exponent: float) -> float:
        if axis != "light" or exponent <= CROWDED:
            return exponent
        return CROWDED + 7.0 * math.log1p((exponent - CROWDED) / 7.0)

    return place


def _tick(base: int, exponent: int) -> str:
    return "1" if exponent == 0 else f"${base}^{{{exponent}}}$"


def _set_y_ticks(axes: Axes, measure: Measure) -> None:
    exponents = (-16, -12, -8, -4, 0) if measure == "absolute" else (0, 4, 8, 12, 16)
    axes.set_yticks([10.0**e for e in exponents], [_tick(10, e) for e in exponents])
    axes.minorticks_off()
