"""The roofline as a picture: operations a second against operations a byte, both logarithmic.

Comes in: a Report, a path that ends in .png or .svg. Goes out: the file. Never done here: a measurement.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.peers.chart import GREY, INK, OURS, require_chart
from benchmarks.roofline.report import Report

STYLES: Final = ("-", "--", ":", "-.")
SIZES: Final = "^so*v"
"""Markers of the kernels by size, the smallest first, as the styles of the stores."""


def draw_chart(report: Report, path: Path) -> None:
    """A panel a format: roofs of stores by size and of mul and add; a point a kernel and size, a bar to its bound."""
    require_chart(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(report.peaks), sharey=True, squeeze=False)[0]
    for panel, form in zip(panels, report.peaks, strict=True):
        _panel(panel, report, form)
    panels[0].set_ylabel("10^9 operations a second, one core")
    figure.suptitle(
        "Kernels (dots), the bound of each one's own operations (bars) and the machine's roofs", fontsize=11
    )
    figure.savefig(path, dpi=160)


def _panel(panel: Any, report: Report, form: str) -> None:
    peaks, bytes_each = report.peaks[form], 8 if form == "float64" else 4
    reach, flat = np.geomspace(0.5, 64.0, 50), peaks["mul"] + peaks["add"]
    for number, (size, rate) in enumerate(report.stores[form].items()):
        roof = np.minimum(reach * rate, flat)
        panel.plot(reach, roof, STYLES[number % len(STYLES)], color=GREY, linewidth=1.2, label=f"stores, {size}²")
    for kind, level in (("mul and add", flat), ("div", peaks["div"]), ("sqrt", peaks["sqrt"])):
        panel.axhline(level, color="#bbbbbb", linewidth=0.9, zorder=1)
        panel.annotate(kind, (0.5, level), (0, 2), textcoords="offset points", fontsize=8, color=INK)
    rows = [row for row in report.rows if row.bytes == bytes_each]
    sizes = sorted({row.size for row in rows})
    for row in rows:
        bound = row.flops / row.bounds[row.bound]
        panel.plot([row.intensity] * 2, [row.gflops, bound], color=OURS, linewidth=0.8, zorder=2)
        panel.plot(row.intensity, bound, "_", color=OURS, markersize=10, zorder=2)
        marker = SIZES[sizes.index(row.size) % len(SIZES)]
        panel.plot(row.intensity, row.gflops, marker, color=OURS, markersize=5, zorder=3)
        if row.size == sizes[-1]:
            offset = (4, 8) if "baked" in row.kernel else (4, -10)
            panel.annotate(
                row.kernel,
                (row.intensity, bound),
                offset,
                textcoords="offset points",
                fontsize=8,
                color=INK,
                rotation=30,
            )
    panel.set(xscale="log", yscale="log", title=form, xlabel="operations a byte stored")
    panel.legend(loc="lower right", frameon=False, fontsize=8)
