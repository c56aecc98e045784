"""`stress`: families of hard cases by accuracy levels, as a table or as JSON; of a scene its own hard points."""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

from symrender_cg.cli.console import Column, Table, counted, listed
from symrender_cg.cli.levels import accuracies_for
from symrender_cg.cli.progress import Progress
from symrender_cg.errors import ArgumentError
from symrender_cg.plan.plan import plan
from symrender_cg.scene import load_scene
from symrender_cg.stress.families import families
from symrender_cg.stress.hard_points import hard_points
from symrender_cg.stress.kept import keep, worst_points
from symrender_cg.stress.measure import chosen_levels
from symrender_cg.stress.promises import NOTHING, promise_of
from symrender_cg.stress.run import Report, Row, input_move, limited, run_scene
from symrender_cg.stress.run import run as run_families


def run(arguments: argparse.Namespace) -> int:
    """Measures, prints, keeps, and only then raises AccuracyError where a level breaks what it states."""
    if arguments.atlas is not None:
        from symrender_cg.cli.atlas import show

        return show(arguments.atlas, levels=arguments.level or None, seed=arguments.seed, as_json=arguments.json)
    levels = chosen_levels(arguments.level)
    report = _of_families(arguments, levels) if arguments.scene is None else _of_scene(arguments, levels)
    if arguments.json:
        print(json.dumps(as_data(report), indent=2, allow_nan=False))
    else:
        _print(report)
    if arguments.keep is not None:
        new = keep(arguments.keep, worst_points(report))
        if not arguments.json:
            print(f"\n{counted(new, 'point')} added to {arguments.keep}")
    report.require()
    return 0


def _of_families(arguments: argparse.Namespace, levels: tuple[str, ...]) -> Report:
    chosen = families(arguments.family)
    with Progress(len(chosen) * len(levels) * arguments.count, "hard cases", "cases") as progress:
        return run_families(chosen, levels, count=arguments.count, seed=arguments.seed, done=progress.done)


def _of_scene(arguments: argparse.Namespace, levels: tuple[str, ...]) -> Report:
    if arguments.family:
        raise ArgumentError(
            f"--family {arguments.family[0]}: families have scenes of their own; leave out --family, or the scene"
        )
    scene = load_scene(arguments.scene)
    plan(scene)  # what no plan covers is refused as such
    frame = scene.in_camera_frame()
    sets = hard_points(frame, arguments.count, arguments.seed)
    accuracies = dict.fromkeys(level.partition(":")[0] for level in levels)
    possible = accuracies_for(scene, tuple(accuracies) if arguments.level else "all")
    levels = tuple(level for level in levels if level.partition(":")[0] in possible)
    with Progress(len(sets) * len(levels) * arguments.count, "hard points", "points") as progress:
        return run_scene(
            ((entry.name, frame, entry.points) for entry in sets),
            levels,
            seed=arguments.seed,
            done=progress.done,
        )


def as_data(report: Report) -> dict[str, Any]:
    """The report as what JSON holds; what is infinite becomes null."""
    return {
        "seed": report.seed,
        "undecided": report.undecided,
        "holds": report.holds,
        "stated": {level: promise_of(level).words for level in dict.fromkeys(row.level for row in report.rows)},
        "rows": [_row_data(row) for row in report.rows],
    }


def _row_data(row: Row) -> dict[str, Any]:
    worst, moved = row.worst, input_move(row)
    return {
        "family": row.family,
        "level": row.level,
        "cases": row.cases,
        "refused": row.refused,
        "max_ulp": limited(row.ulp),
        "max_abs": limited(row.error),
        "hit_flips": row.hit_flips,
        "zero_flips": row.zero_flips,
        "non_finite": row.non_finite,
        "wrong": row.wrong,
        "broken": row.broken,
        "first_broken": row.first or None,
        "worst": None if worst is None else {"case": worst.name, "note": worst.note, "x": worst.x, "y": worst.y},
        "inputs_move": None if moved is None else limited(moved),
        "inputs_flip": moved is not None and math.isinf(moved),
    }


def _print(report: Report) -> None:
    table = Table(
        (
            Column("family"),
            Column("level"),
            Column("cases", right=True),
            Column("refused", right=True),
            Column("ulp", right=True),
            Column("error", right=True),
            Column("hit flips", right=True),
            Column("zero flips", right=True),
            Column("nan, inf", right=True),
            Column("wrong", right=True),
            Column("inputs", right=True),
            Column(""),
        )
    )
    last = ""
    for row in report.rows:
        if row.family != last:
            table.section()
        silent = row.refused == row.cases
        table.add(
            "" if row.family == last else row.family,
            row.level,
            str(row.cases),
            str(row.refused),
            *("" if silent else text for text in _numbers(row)),
            f"{row.broken} BROKEN" if row.broken else "",
        )
        last = row.family
    table.show()
    print(
        "\nulp, error: the largest of the unclipped field against the oracle, in units of the last place of the level's"
        "\nformat and absolute; hit flips: hit or miss is wrong; zero flips: exactly one of value and truth is 0 (both"
        "\nwithout an ulp); wrong: another float than the nearest; refused: no kernel, or numbers without an image;"
        "\ninputs: how far half an ulp of every input moves the true value of the worst case (flips: turns a decision)"
    )
    if report.undecided:
        print(f"{counted(report.undecided, 'point')} that the oracle leaves open: exact ties behind mirrors")
    levels = list(dict.fromkeys(row.level for row in report.rows))
    print("\nstated")
    for level in levels:
        print(f"  {level:<19}{promise_of(level).words}")
    print()
    for row in report.rows:
        if row.broken:
            print(f"BROKEN: {row.level}, {row.first}")
    stating = [level for level in levels if promise_of(level) is not NOTHING]
    if report.holds and stating:
        print(f"{listed(stating)}: kept")


def _numbers(row: Row) -> tuple[str, ...]:
    counts = (row.hit_flips, row.zero_flips, row.non_finite, row.wrong)
    return f"{row.ulp:.3g}", f"{row.error:.2e}", *map(str, counts), _moved(input_move(row))


def _moved(move: float | None) -> str:
    return "" if move is None else f"{move:.2e}" if math.isfinite(move) else "flips"
