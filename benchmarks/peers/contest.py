"""The contest: every contestant started, compiled, looked at and then timed in turn with all others.

Comes in: a size, rounds, points, entries. Goes out: a `report.Report`. One process answers at a time and the others
wait, so that a round holds one sample of each contestant in each case, in another seeded order every round; the ratio
to our kernel is the median of the ratios within a round. With several threads the contest is held again. Never done
here: a formula, a table.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import Spread, cores, spread, take_turns, this_machine
from benchmarks.peers.case import Case, Grid, Numbers, image_grid, outline_grid
from benchmarks.peers.ours import scene_of
from benchmarks.peers.process import ContestantError, Process
from benchmarks.peers.registry import BASES, ENTRIES, Entry, present
from benchmarks.peers.report import Report, Row, Start
from symrender_cg.reference import oracle
from symrender_cg.reference.compare import measure

Told = Callable[[str], None]

CASES: Final = (
    Case("float64", True),
    Case("float64", False, Numbers(shininess=37.5)),
    Case("float32", True),
    Case("float32", False, Numbers(shininess=37.5)),
)

FIRST_SIZE: Final = 256
"""Side of the image that a cold start is timed to."""

OUTLINE_SIZE: Final = 64


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is measured: side of the image, rounds, pixels compared with the oracle, seed, numbers of threads."""

    size: int = 1024
    rounds: int = 15
    points: int = 16384
    seed: int = 1
    threads: tuple[int, ...] = ()

    @staticmethod
    def quick(seed: int = 1) -> Plan:
        """Less than two minutes: 512 x 512, one thread, five rounds."""
        return Plan(size=512, rounds=5, points=4096, seed=seed, threads=(1,))

    def thread_counts(self) -> tuple[int, ...]:
        """One, and those that were asked for, or as many as there are processors."""
        return tuple(sorted({1, *(self.threads or (cores(),))}))


def measure_peers(plan: Plan, told: Told, entries: Sequence[Entry] = ENTRIES) -> Report:
    """The contest, with one thread and then with more; told(text) says what is going on."""
    able, absent = present(entries)
    with tempfile.TemporaryDirectory(prefix="symrender_peers_") as folder:
        told("the oracle")
        truths = {case: _truths(case, plan) for case in CASES}
        contests = {
            threads: _contest(plan, able, threads, truths, Path(folder, f"threads_{threads}"), told)
            for threads in plan.thread_counts()
        }
    alone = contests[1]
    rows = []
    for case in CASES:
        for entry in entries:
            key = entry.title, case.name
            if key in alone.rows:
                several = {n: found.times[key] for n, found in contests.items() if n > 1 and key in found.times}
                rows.append(alone.row(case, entry, several))
    failed = {title: why for found in contests.values() for title, why in found.failed.items()}
    names = tuple(case.name for case in CASES)
    points = (min(plan.points, plan.size**2), OUTLINE_SIZE**2)
    return Report(
        machine=this_machine(),
        size=plan.size,
        rounds=plan.rounds,
        points=points,
        seed=plan.seed,
        cases=names,
        bases={case.name: BASES[case.format, case.baked] for case in CASES},
        versions={entry.title: entry.version() for entry in able if entry.version()},
        absent=absent,
        failed=failed,
        rows=tuple(rows),
        starts=tuple(alone.starts),
    )


@dataclass(slots=True)
class _Contest:
    """What one contest found, by (title, case)."""

    rows: dict[tuple[str, str], dict[str, Any]]
    times: dict[tuple[str, str], Spread]
    ratios: dict[tuple[str, str], Spread]
    starts: list[Start]
    failed: dict[str, str]

    def row(self, case: Case, entry: Entry, several: dict[int, Spread]) -> Row:
        key = entry.title, case.name
        return Row(
            case=case.name,
            title=entry.title,
            ours=entry.ours,
            ns_a_pixel=self.times[key],
            times_base=self.ratios.get(key),
            several_threads={str(n): value for n, value in several.items()},
            **self.rows[key],
        )


def _contest(
    plan: Plan, entries: Sequence[Entry], threads: int, truths: dict[Case, _Truths], folder: Path, told: Told
) -> _Contest:
    found = _Contest({}, {}, {}, [], {})
    asked: dict[tuple[str, str], Callable[[], float]] = {}
    with _processes() as started:
        for number, entry in enumerate(entries):
            if threads > 1 and not entry.threads:
                continue
            told(f"{threads} threads: {entry.title}: start")
            home = folder / str(number)
            process = Process(entry, threads, home)
            started.append(process)
            try:
                if threads == 1:
                    found.starts += _starts(entry, process, home, started)
                for case in CASES:
                    told(f"{threads} threads: {entry.title}: {case.name}")
                    looked = _prepared(process, case, plan, truths[case], home)
                    if looked is not None:
                        found.rows[entry.title, case.name] = looked
                        asked[entry.title, case.name] = partial(_sample, process, case, found.failed)
            except ContestantError as problem:
                found.failed[entry.title] = str(problem)
        names = {f"{title}|{case}": call for (title, case), call in asked.items()}
        samples = take_turns(
            names,
            plan.rounds,
            plan.seed,
            lambda number: told(f"{threads} threads: round {number + 1} of {plan.rounds}"),
        )
    for case in CASES:
        base = np.asarray(samples.get(f"{BASES[case.format, case.baked]}|{case.name}", ()))
        for title, name in asked:
            values = np.asarray(samples[f"{title}|{name}"])
            if name != case.name or not np.isfinite(values).all():
                continue
            found.times[title, name] = spread(list(values))
            if base.size and np.isfinite(base).all():
                found.ratios[title, name] = spread(list(values / base))
    found.rows = {key: row for key, row in found.rows.items() if key in found.times}
    return found


@contextmanager
def _processes() -> Iterator[list[Process]]:
    """A list of processes that are ended with it."""
    started: list[Process] = []
    try:
        yield started
    finally:
        for process in started:
            process.close()


def _sample(process: Process, case: Case, failed: dict[str, str]) -> float:
    """Nanoseconds a pixel; NaN from one that has failed, which is then said."""
    if process.entry.title in failed:
        return float("nan")
    try:
        return process.sample(case)
    except ContestantError as problem:
        failed[process.entry.title] = str(problem)
        return float("nan")


def _starts(entry: Entry, process: Process, home: Path, started: list[Process]) -> list[Start]:
    """The cold start of a contestant, and of ours another one that finds the kernel in the cache."""
    for case in CASES:
        seconds = process.cold_start(case, FIRST_SIZE)
        if seconds is None:
            continue
        starts = [Start(entry.title, entry.ours, seconds)]
        if entry.again:
            again = Process(entry, 1, home)
            started.append(again)
            seconds = again.cold_start(case, FIRST_SIZE)
            assert seconds is not None
            starts.append(Start(f"{entry.title}; kernel in the cache", True, seconds))
            started.remove(again)
            again.close()
        return starts
    return []


@dataclass(frozen=True, slots=True)
class _Truths:
    """Where a case's values are compared with the oracle: chosen pixels of the image, all points of the close-up."""

    image: Grid
    pixels: NDArray[np.intp]
    values: oracle.Answers
    outline: Grid
    outline_values: oracle.Answers


def _truths(case: Case, plan: Plan) -> _Truths:
    scene = scene_of(case.numbers)
    image = image_grid(case.numbers, plan.size)
    every = plan.size**2
    pixels = np.sort(np.random.default_rng(plan.seed).choice(every, min(plan.points, every), replace=False))
    x, y = image.axes(np.dtype(np.float64))
    values = oracle.evaluate(scene, x[pixels % plan.size], y[pixels // plan.size])
    outline = outline_grid(case.numbers, case.format, OUTLINE_SIZE)
    near_x, near_y = np.meshgrid(*outline.axes(np.dtype(np.float64)))
    return _Truths(image, pixels, values, outline, oracle.evaluate(scene, near_x, near_y))


def _prepared(process: Process, case: Case, plan: Plan, truths: _Truths, home: Path) -> dict[str, Any] | None:
    """What does not need rounds: arrangement, compile time, errors; None where there is nothing for the case."""
    prepared = process.prepare(case, plan.size)
    if prepared is None:
        return None
    path = home / "values.npy"
    process.picture(case, truths.image, path)
    image = measure(_values(path, case).ravel()[truths.pixels], truths.values)
    process.picture(case, truths.outline, path)
    outline = measure(_values(path, case), truths.outline_values)
    os.remove(path)
    return {
        "arrangement": prepared[0],
        "compile_seconds": prepared[1],
        "errors": image,
        "outline_flips": outline.flips + outline.nonfinite,
    }


def _values(path: Path, case: Case) -> NDArray[Any]:
    """The values as they are, but for a format that is neither of the two: then in the case's."""
    values: NDArray[Any] = np.load(path)
    return values if values.dtype in (np.float64, np.float32) else values.astype(case.dtype)
