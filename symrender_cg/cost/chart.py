"""A report as a chart: the largest error against nanoseconds a pixel, both on log scales, the fronts drawn.

Comes in: a Report and a file name. Goes out: a .png, .svg or .pdf that reads in print and without colour: kinds differ
by their marks, ways with flips are hollow, levels and the front are named. Never done here: a measurement. matplotlib
is imported when a chart is drawn.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from symrender_cg.cost.report import Entry, Report
from symrender_cg.errors import ArgumentError
from symrender_cg.output import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES: Final = (".png", ".svg", ".pdf")
LEAST: Final = 1e-17
"""An error of 0 is drawn here."""
MARKS: Final = {
    "level": ("o", "#111111", 52.0, "accuracy level"),
    "choice": (".", "#7d7d7d", 40.0, "choice beside a level"),
    "baked": ("D", "#1f5f99", 26.0, "numbers baked in"),
    "plan": ("s", "#3a7d44", 30.0, "planned within a tolerance"),
    "general": ("X", "#9a7b2f", 34.0, "less left out by the plan"),
    "reference": ("^", "#b5482a", 40.0, "numpy, lambdify"),
    "samples": ("P", "#8a6fb0", 42.0, "four rays a pixel"),
}
"""Kind -> mark, colour, size, words."""


def write_chart(path: str | Path, report: Report) -> None:
    """Writes the chart. Raises ArgumentError for another suffix, without matplotlib, or for an unwritable place."""
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise ArgumentError(f"{target}: {target.suffix!r} is not the suffix of a chart; expected {', '.join(SUFFIXES)}")
    data = picture(report, suffix.removeprefix("."))
    with replacing(target) as file:
        file.write(data)


def picture(report: Report, kind: str) -> bytes:
    """The chart as the bytes of a file of that kind; the same bytes for the same report."""
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise ArgumentError("a chart needs matplotlib, which is not installed; pip install matplotlib") from None
    with mpl.rc_context({"font.size": 9.0, "svg.hashsalt": "symrender_cg", "svg.fonttype": "none"}):
        figure = Figure(figsize=(8.6, 5.8), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        _draw(axes, report)
        held = io.BytesIO()
        metadata: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})
        figure.savefig(held, format=kind, dpi=160, metadata=metadata)
    return held.getvalue()


def _draw(axes: Axes, report: Report) -> None:
    for kind, (mark, colour, size, words) in MARKS.items():
        for sound in (True, False):
            chosen = [e for e in report.entries if e.kind == kind and e.errors.sound == sound]
            if chosen:
                face = colour if sound else "none"
                x, y = [e.ns.median for e in chosen], [_height(e) for e in chosen]
                label = words if sound else None
                mark_of = mark if mark != "." or sound else "o"
                axes.scatter(
                    x, y, s=size, marker=mark_of, facecolor=face, edgecolor=colour, linewidth=0.9, label=label, zorder=3
                )
                for entry in chosen:
                    axes.plot(
                        (entry.ns.low, entry.ns.high), (_height(entry),) * 2, color=colour, linewidth=0.6, alpha=0.5
                    )
    for front, style, words in (
        (report.front, "-", "front"),
        (report.baked_front, (0, (3.0, 2.0)), "front of what is baked"),
    ):
        if front:
            axes.step(
                [e.ns.median for e in front],
                [_height(e) for e in front],
                where="post",
                color="#111111" if style == "-" else "#1f5f99",
                linestyle=style,
                linewidth=1.1,
                label=words,
                zorder=1,
            )
    if any(not entry.errors.sound for entry in report.entries):
        axes.scatter([], [], s=40.0, marker="o", facecolor="none", edgecolor="#555555", label="hollow: flips at edges")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(f"nanoseconds a pixel, one thread, {report.width} x {report.height}")
    axes.set_ylabel("largest error of the unclipped field")
    axes.set_title(f"What accuracy costs in time: {Path(report.scene).stem}", loc="left", fontsize=11)
    low, high = axes.get_xlim()
    axes.set_xlim(low * 0.9, high * 1.5)
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    legend = axes.legend(loc="best", fontsize=7.5, frameon=True, framealpha=0.9)
    axes.figure.canvas.draw()
    corners = legend.get_window_extent().transformed(axes.transAxes.inverted())
    _name(axes, report, (corners.x0, corners.y0, corners.x1, corners.y1))


def _height(entry: Entry) -> float:
    return max(entry.errors.largest, LEAST)


Box = tuple[float, float, float, float]
"""Left, bottom, right, top, as shares of the axes."""


def _name(axes: Axes, report: Report, legend: Box) -> None:
    """The names of levels, fronts and references, each moved up or down until it covers no other."""
    chosen = [e for e in report.entries if e.kind in ("level", "reference", "samples", "plan", "general") or e.on_front]
    left, right = (math.log10(v) for v in axes.get_xlim())
    low, high = (math.log10(v) for v in axes.get_ylim())
    across, up = 0.0088, 0.026
    taken: list[Box] = [legend]
    for entry in report.entries:
        u, v = (math.log10(entry.ns.median) - left) / (right - left), (math.log10(_height(entry)) - low) / (high - low)
        taken.append((u - 0.008, v - 0.01, u + 0.008, v + 0.01))
    for entry in sorted(chosen, key=lambda e: (not e.on_front, e.kind != "level", e.ns.median)):
        u, v = (math.log10(entry.ns.median) - left) / (right - left), (math.log10(_height(entry)) - low) / (high - low)
        width = across * len(entry.name)
        for step in range(40):
            shift = (step + 1) // 2 * (1 if step % 2 else -1)
            for to_right in (True, False):
                x0 = u + 0.012 if to_right else u - 0.012 - width
                y0 = v + shift * up * 0.55 - up / 2
                box = (x0, y0, x0 + width, y0 + up)
                inside = box[0] >= 0.0 and box[2] <= 1.0 and box[1] >= 0.0 and box[3] <= 1.0
                if inside and not any(_overlap(box, other) for other in taken):
                    break
            else:
                continue
            break
        else:
            continue
        taken.append(box)
        heavy = entry.kind == "level"
        axes.annotate(
            entry.name,
            xy=(u, v),
            xycoords="axes fraction",
            xytext=(x0, y0 + up / 2),
            textcoords="axes fraction",
            va="center",
            ha="left",
            fontsize=7.2,
            fontweight="bold" if heavy else "normal",
            color=MARKS[entry.kind][1] if entry.kind != "choice" else "#444444",
            arrowprops={"arrowstyle": "-", "linewidth": 0.4, "color": "#999999"} if abs(shift) > 1 else None,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.4},
            zorder=4,
        )


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
