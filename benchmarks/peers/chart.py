"""The contest as a picture: largest error against nanoseconds a pixel, both logarithmic.

Comes in: a Report, a path that ends in .png or .svg. Goes out: the file. Each contestant has a marker of its own in
grey, ours are filled and dark, so that it reads in print. Never done here: a measurement.
"""

from __future__ import annotations

from math import log10
from pathlib import Path
from typing import Any, Final

from benchmarks.peers.report import Report, Row
from symrender_cg.errors import ArgumentError

MARKERS: Final = "osD^v<>pPXhd*8H"
INK, GREY, OURS = "#222222", "#777777", "#b03a2e"
LEAST: Final = {"float64": 1e-17, "float32": 1e-9}
"""Where an error of 0 is drawn."""


def require_chart(path: Path) -> None:
    """Raises ArgumentError where the chart could not be written: another ending, or matplotlib is not installed."""
    from importlib.util import find_spec

    if path.suffix not in (".png", ".svg"):
        raise ArgumentError(f"--plot: {path.name!r}; expected a name that ends in .png or .svg")
    if find_spec("matplotlib") is None:
        raise ArgumentError("--plot: matplotlib is not installed; pip install matplotlib, or leave --plot out")


def draw_chart(report: Report, path: Path) -> None:
    """A column for numbers that are constants and one for arguments; a row for float32 and one for float64."""
    require_chart(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 8.4), layout="constrained")
    FigureCanvasAgg(figure)
    peers = list(dict.fromkeys(row.title for row in report.rows if not row.ours))
    formats, kinds = ("float32", "float64"), list(dict.fromkeys(case.partition(", ")[2] for case in report.cases))
    panels = figure.subplots(len(formats), len(kinds), sharex="col", sharey="row", squeeze=False)
    handles: dict[str, Any] = {}
    for line, form in zip(panels, formats, strict=True):
        for panel, kind in zip(line, kinds, strict=True):
            _panel(panel, report.of(f"{form}, {kind}"), peers, handles)
            panel.set_title(f"{form}, {kind}", fontsize=10)
        line[0].set_ylabel("largest error of the unclipped intensity")
    for panel in panels[-1]:
        panel.set_xlabel("ns a pixel, one thread")
    titles = [title for title in (*peers, "ours") if title in handles]
    figure.legend(
        [handles[title] for title in titles], titles, loc="outside lower center", ncols=7, frameon=False, fontsize=9
    )
    figure.suptitle(f"Chapter 1's scene, {report.size} x {report.size}: left and down is better", fontsize=11)
    figure.savefig(path, dpi=160)


def _panel(panel: Any, rows: list[Row], peers: list[str], handles: dict[str, Any]) -> None:
    """The contestants of a case; ours carry their names, above and below in turn where they stand close."""
    panel.set(xscale="log", yscale="log")
    panel.grid(True, which="major", color="#dddddd", linewidth=0.6)
    panel.set_axisbelow(True)
    panel.margins(0.12, 0.16)
    for row in rows:
        if not row.ours:
            marker = MARKERS[peers.index(row.title) % len(MARKERS)]
            (handle,) = panel.plot(*_place(row), marker, markersize=8, mfc="white", mec=GREY, mew=1.4, zorder=3)
            handles.setdefault(row.title, handle)
    ours = sorted((row for row in rows if row.ours), key=lambda row: (round(2.0 * log10(_place(row)[1])), row.title))
    for number, row in enumerate(ours):
        (handle,) = panel.plot(*_place(row), "o", markersize=8, color=OURS, zorder=4)
        handles.setdefault("ours", handle)
        up = number % 2 == 0
        panel.annotate(
            row.title,
            _place(row),
            (0, 9 if up else -9),
            textcoords="offset points",
            fontsize=8,
            color=INK,
            ha="center",
            va="bottom" if up else "top",
            zorder=5,
        )


def _place(row: Row) -> tuple[float, float]:
    """(ns a pixel, largest error)"""
    return row.ns_a_pixel.median, max(row.errors.max_abs, LEAST[row.case.partition(",")[0]])
