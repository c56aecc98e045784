"""Conditioning as a picture: a colour a pixel on a log scale, pixels that flip marked, a colour bar with the figures.

Comes in: Conditioning of an image, a file name. Goes out: a .png, .svg or .pdf. Never done here: a derivative.
matplotlib is imported when the picture is drawn.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from symrender_cg.errors import ArgumentError
from symrender_cg.output import replacing
from symrender_cg.stress.conditioning import Conditioning

Measure: TypeAlias = Literal["ulp", "absolute"]

SUFFIXES: Final = (".png", ".svg", ".pdf")
COLOURS: Final = "viridis"
"""A map whose lightness grows evenly, so that it reads without colour."""
FLIP: Final = "#e8112d"
STILL: Final = "#ffffff"
"""Pixels that no input moves, such as a black background."""
HEIGHT: Final = 4.6
"""Of the picture's page, in inches."""
LEAST_GAP: Final = 0.09


def draw_conditioning(path: str | Path, found: Conditioning, title: str, *, measure: Measure = "ulp") -> None:
    """Writes the picture. Raises ArgumentError for another suffix, without matplotlib, or for points without rows."""
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise ArgumentError(f"{target}: {suffix!r} is not the suffix of a picture; expected {', '.join(SUFFIXES)}")
    if found.ulps.ndim != 2:
        raise ArgumentError(f"found: of shape {found.ulps.shape}; expected conditioning of an image, (height, width)")
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.colors import LogNorm
        from matplotlib.figure import Figure
    except ImportError:
        raise ArgumentError("matplotlib draws the picture and is missing; install it: pip install matplotlib") from None
    shown = found.ulps if measure == "ulp" else found.absolute
    rows, columns = shown.shape
    moves = np.isfinite(shown) & (shown > 0.0)
    low, high = _scale(shown[moves])
    settings: dict[Any, Any] = {"svg.hashsalt": "symrender_cg", "font.size": 8.0, "axes.linewidth": 0.6}
    with mpl.rc_context(settings):
        width = min(max(HEIGHT * 0.82 * columns / rows, 3.0), 12.0)
        page = width + 1.85
        figure = Figure(figsize=(page, HEIGHT))
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.35 / page, 0.06, width / page, 0.82))
        image = axes.imshow(
            np.ma.masked_where(~moves, shown),
            norm=LogNorm(low, high),
            cmap=mpl.colormaps[COLOURS].with_extremes(bad=STILL),
            interpolation="nearest",
        )
        places = np.argwhere(found.flips)
        side = max(1.5, 72.0 * HEIGHT * 0.82 / rows)
        axes.scatter(places[:, 1], places[:, 0], s=side * side, c=FLIP, marker="s", linewidths=0.0)
        axes.set_xticks([0, columns - 1])
        axes.set_yticks([0, rows - 1])
        axes.tick_params(length=2.0, width=0.6, labelsize=6.5)
        figure.text(0.35 / page, 0.965, title, fontsize=10.0, weight="bold", va="center")
        unit = "ulp of the pixel" if measure == "ulp" else "absolute"
        figure.text(0.35 / page, 0.92, f"moved by half an ulp of every input, {unit}", fontsize=8.0, va="center")
        bar = figure.colorbar(
            image, cax=figure.add_axes(((0.8 + width) / page, 0.12, 0.16 / page, 0.72)), extend="both"
        )
        bar.ax.tick_params(length=2.0, width=0.6, labelsize=7.0)
        bar.ax.yaxis.set_ticks_position("left")
        for height, words in _labels(shown[moves], low, high):
            bar.ax.annotate(
                words,
                (1.0, height),
                xycoords="axes fraction",
                xytext=(4.0, 0.0),
                textcoords="offset points",
                va="center",
                fontsize=6.5,
                annotation_clip=False,
            )
        words = f"\u25a0 {len(places)} that flip" if len(places) else "none flips"
        figure.text((0.5 + width) / page, 0.05, words, fontsize=7.0, color=FLIP if len(places) else "#444444")
        metadata: dict[str, Any] = {"Date": None} if suffix == ".svg" else {}
        with replacing(target) as file:
            figure.savefig(file, format=suffix[1:], dpi=160, metadata=metadata)


def _scale(numbers: Any) -> tuple[float, float]:
    """The ends of the scale: whole decades around all but the outermost thousandths."""
    if not numbers.size:
        return 0.1, 1.0
    low = math.floor(math.log10(float(np.quantile(numbers, 0.001))))
    high = math.ceil(math.log10(float(np.quantile(numbers, 0.999))))
    return 10.0**low, 10.0 ** max(high, low + 1)


def _labels(numbers: Any, low: float, high: float) -> list[tuple[float, str]]:
    """What is written beside the bar, and at which share of its height: apart from one another by LEAST_GAP."""
    if not numbers.size:
        return []
    found: list[tuple[float, str]] = []
    for name, number in (
        ("median", float(np.median(numbers))),
        ("99.9 % below", float(np.quantile(numbers, 0.999))),
        ("worst", float(numbers.max())),
    ):
        share = math.log(min(max(number, low), high) / low) / math.log(high / low)
        least = found[-1][0] + LEAST_GAP if found else 0.0
        found.append((max(share, least), f"\u2013 {name}\n   {number:.3g}"))
    return found
