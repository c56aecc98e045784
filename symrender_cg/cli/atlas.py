"""`stress --atlas`: the failure atlas is measured, where each level breaks is printed, the chart is written."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from symrender_cg.cli.console import Column, Table
from symrender_cg.errors import ArgumentError
from symrender_cg.stress.atlas import (
    POINTS,
    SCENES,
    SEED,
    as_data,
    breaking_points,
    draw_atlas,
    known_levels,
    measure_atlas,
)
from symrender_cg.stress.atlas_chart import SUFFIXES

_NOTE = """
breaks below, above: the first point whose error exceeds the limit, on the way from where the axis is easy; ulp, error:
the largest of the unclipped field along the whole axis, against the oracle; over inputs: the largest error over what
half an ulp of every input moves the point: where it is a few, the error is the scene's and not the level's"""


def show(
    path: str | Path,
    *,
    levels: Iterable[str] | None = None,
    seed: int = SEED,
    scenes: int = SCENES,
    points: int = POINTS,
    as_json: bool = False,
) -> int:
    """Measures the levels (None: literal, double, stable), prints a table or JSON, writes the chart to `path`.

    Returns the exit code 0: a level that breaks out here breaks no promise about ordinary scenes. Raises ArgumentError
    for a name or a place that will not do, before anything is measured.
    """
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise ArgumentError(
            f"{target}: {target.suffix!r} is not the suffix of a chart; expected {', '.join(SUFFIXES)}; rename it"
        )
    if target.is_dir() or not target.parent.is_dir():
        raise ArgumentError(f"{target}: not a place for a file; expected a file's name in a folder that exists")
    chosen = known_levels(levels)
    atlas = measure_atlas(
        chosen, seed=seed, scenes=scenes, points=points, done=None if as_json else _said(sys.stderr.isatty())
    )
    draw_atlas(target, atlas)
    if as_json:
        print(json.dumps(as_data(atlas), indent=2, allow_nan=False))
        return 0
    table = Table(
        (
            Column("axis"),
            Column("level"),
            Column("limit", right=True),
            Column("breaks below", right=True),
            Column("breaks above", right=True),
            Column("ulp", right=True),
            Column("error", right=True),
            Column("over inputs", right=True),
        )
    )
    last = ""
    for row in breaking_points(atlas):
        if row[0] != last:
            table.section()
            last = row[0]
        table.add(*row)
    table.show()
    print(_NOTE)
    print(f"\n{target}: {len(atlas.panels)} axes, {atlas.count} points a level, seed {atlas.seed}")
    return 0


def _said(terminal: bool) -> Callable[[str], None] | None:
    """What tells a person at a terminal that an axis is done."""
    return (lambda name: print(f"measured: {name}", file=sys.stderr)) if terminal else None
