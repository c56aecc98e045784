"""`check`: the comparison of symrender_cg.reference.check as one table, or as JSON."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict
from typing import Any

from symrender_cg.cli.console import Column, Table
from symrender_cg.cli.levels import accuracies_for
from symrender_cg.plan.plan import plan
from symrender_cg.reference.check import check
from symrender_cg.reference.check_rows import Report, Row
from symrender_cg.scene import load_scene


def run(arguments: argparse.Namespace) -> int:
    """Compares, prints, and only then raises AccuracyError where a stated bound is broken."""
    width, height = arguments.size
    scene = load_scene(arguments.scene)
    plan(scene)  # what no plan covers is refused as such
    report = check(
        scene,
        width=width,
        height=height,
        count=arguments.points,
        seed=arguments.seed,
        accuracies=accuracies_for(scene, arguments.accuracy),
        portable=arguments.portable,
    )
    if arguments.json:
        print(json.dumps(as_data(report), indent=2, allow_nan=False))
    else:
        _print(report)
    report.require()
    return 0


_DOUBT = """
in doubt: the gate n.l > 0 makes the field jump at the terminator; at these points it lies within a few roundings,
and they are left out of the errors"""

_DOUBT_SCENE = """
in doubt: points that miss the bound, and where the field jumps within rounding (a shadow's or a tile's edge, an outline
in a mirror, a gated highlight at the terminator), rounding decides which of two surfaces is in front, or grows beyond
the bound from mirror to mirror; they are left out of the errors"""


def as_data(report: Report) -> dict[str, Any]:
    """The report as what JSON holds; what is infinite becomes null."""
    rows = [
        {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in asdict(row).items()}
        | {"holds": row.holds}
        for row in report.rows
    ]
    return {
        "size": [report.width, report.height],
        "per_pixel_points": report.per_pixel_points,
        "rows": rows,
        "holds": all(row.holds for row in report.rows),
    }


def _print(report: Report) -> None:
    table = Table(
        (
            Column("evaluator"),
            Column("points"),
            Column("count", right=True),
            Column("ulp", right=True),
            Column("error", right=True),
            Column("wrong hits", right=True),
            Column("in doubt", right=True),
            Column("nan, inf", right=True),
            Column("from numpy", right=True),
            Column("from loop", right=True),
            Column("bound", right=True),
            Column(""),
        )
    )
    last = ""
    for row in report.rows:
        if row.evaluator != last:
            table.section()
            last = row.evaluator
        verdict = "" if not row.states else "holds" if row.holds else "BROKEN"
        table.add(
            row.evaluator,
            row.where,
            str(row.count),
            f"{row.max_ulp:.3g}",
            f"{row.max_abs:.2e}",
            str(row.wrong_hits),
            str(row.in_doubt),
            str(row.non_finite),
            _apart(row.from_numpy),
            _apart(row.from_per_pixel),
            _bound(row),
            verdict,
        )
    table.show()
    if any(row.in_doubt for row in report.rows):
        print(_DOUBT_SCENE if not report.per_pixel_points else _DOUBT)
    print(
        "\nulp, error: the largest of the unclipped field, against the oracle, which is correctly rounded and decides"
        "\nhits exactly; from numpy, from loop: the largest difference of a kernel from those references"
    )
    if report.per_pixel_points:
        of_loop = ", ".join(f"{count} ({where})" for where, count in report.per_pixel_points.items())
        print(f"points of the per-pixel loop: {of_loop}")
    else:
        print(
            "wrong hits: points where another surface is seen than the nearest; errors are the largest of any channel"
        )


def _bound(row: Row) -> str:
    if row.bound_ulp is not None:
        return f"{row.bound_ulp:g} ulp"
    return "none" if row.bound is None else f"{row.bound:.2e}"


def _apart(difference: float | None) -> str:
    return "" if difference is None else f"{difference:.2e}"
