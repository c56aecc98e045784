"""`python -m benchmarks peers`: the same picture by everyone, what is missing said, what is wrong seen."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from benchmarks.machine import Spread, this_machine
from benchmarks.peers.case import Case, Grid, Numbers, image_grid, outline_grid, strips_of
from benchmarks.peers.chart import draw_chart
from benchmarks.peers.contest import CASES, Plan, measure_peers
from benchmarks.peers.formula import power
from benchmarks.peers.ours import scene_of
from benchmarks.peers.process import ContestantError, Process
from benchmarks.peers.registry import BASES, ENTRIES, Entry
from benchmarks.peers.report import Report, Row, Start
from benchmarks.peers.worker import serve
from symrender_cg.errors import ArgumentError
from symrender_cg.reference import oracle
from symrender_cg.reference.compare import Errors, measure

SMALL = Plan(size=32, rounds=2, points=200, threads=(1,))
TITLES = {entry.title: entry for entry in ENTRIES}
TOLERANCE = {"float64": 1e-12, "float32": 5e-4}
HERE = ("lambdify", "lambdify, cse", "numpy by hand")
"""Peers that may run in the tests' own process; a library made with -ffast-math changes how all of it rounds to 0."""

BROKEN = """
import os, sys
import numpy as np
from benchmarks.peers.arrays import numpy_by_hand

def brighter(case, threads):
    return numpy_by_hand(__import__("dataclasses").replace(case, numbers=__import__("dataclasses").replace(
        case.numbers, diffuse=case.numbers.diffuse * 1.001)), threads)

def larger(case, threads):
    return numpy_by_hand(__import__("dataclasses").replace(case, numbers=__import__("dataclasses").replace(
        case.numbers, radius=case.numbers.radius * (1 + 1e-5))), threads)

def ends(case, threads):
    print("fatal error: no such instruction", file=sys.stderr, flush=True)
    os._exit(3)

def refuses(case, threads):
    raise ValueError("cannot do that")

def chats(case, threads):
    print("hello from a library")
    return numpy_by_hand(case, threads)
"""


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder with contestants that are made wrong, on the path of the processes."""
    folder = tmp_path_factory.mktemp("broken")
    (folder / "broken_peers.py").write_text(BROKEN, encoding="utf-8")
    return str(folder)


@pytest.fixture(scope="module")
def report(broken: str) -> Report:
    """A contest of numpy, one that is not installed, and one of each kind of failure."""
    patch = pytest.MonkeyPatch()
    patch.setenv("PYTHONPATH", os.pathsep.join([broken, os.environ.get("PYTHONPATH", "")]))
    patch.setattr("benchmarks.peers.contest.BASES", dict.fromkeys(BASES, "numpy by hand"))
    made = [Entry(name, f"broken_peers:{name}") for name in ("brighter", "larger", "ends", "refuses", "chats")]
    absent = Entry("absent", "benchmarks.peers.nowhere:absent", ("no_such_module",), "no-such-distribution")
    try:
        return measure_peers(SMALL, lambda text: None, (TITLES["numpy by hand"], absent, *made))
    finally:
        patch.undo()


def shown(found: Report) -> str:
    console = Console(width=250, file=io.StringIO())
    found.show(console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_a_peer_that_is_not_installed_is_said_and_the_others_are_measured(report: Report) -> None:
    assert report.absent == {"absent": "not installed; pip install no-such-distribution"}
    assert "not installed; pip install no-such-distribution" in shown(report)
    assert {row.case for row in report.rows if row.title == "numpy by hand"} == {case.name for case in CASES}


def test_a_peer_that_ends_or_raises_says_why_and_the_others_are_measured(report: Report) -> None:
    assert report.failed == {
        "ends": "ended with status 3: fatal error: no such instruction",
        "refuses": "ValueError: cannot do that",
    }
    assert not [row for row in report.rows if row.title in report.failed]
    assert "no such instruction" in shown(report)


def test_a_peer_that_shades_wrongly_is_seen_in_the_error_column(report: Report) -> None:
    for row in report.rows:
        if row.title == "brighter":
            assert row.errors.max_abs > 1e-4
        if row.title in ("numpy by hand", "chats"):
            assert row.errors.max_abs < {"float64": 1e-13, "float32": 1e-4}[row.case[:7]]


def test_a_peer_whose_sphere_is_a_little_larger_is_seen_at_the_outline(report: Report) -> None:
    flips = {(row.title, row.case): row.outline_flips for row in report.rows}
    for case in CASES:
        assert flips["larger", case.name] > 1000
        assert flips["numpy by hand", case.name] < 100


def test_the_contestant_that_times_are_compared_with_is_1(report: Report) -> None:
    base = [row for row in report.rows if row.title == "numpy by hand"]
    assert len(base) == len(CASES)
    assert all(row.times_base == Spread(1.0, 1.0, 1.0) for row in base)


def test_a_peer_that_prints_does_not_disturb_the_answers(report: Report) -> None:
    assert len([row for row in report.rows if row.title == "chats"]) == len(CASES)


def test_the_report_is_json_and_names_the_best_peer(report: Report) -> None:
    assert json.loads(json.dumps(report.to_dict()))["cases"] == [case.name for case in CASES]
    for case in CASES:
        best = report.best_peer(case.name)
        assert best is not None
        assert best.ns_a_pixel.median == min(row.ns_a_pixel.median for row in report.of(case.name))


@pytest.mark.parametrize("title", [entry.title for entry in ENTRIES])
def test_every_contestant_draws_the_picture_of_the_oracle(title: str, tmp_path: Path) -> None:
    entry = TITLES[title]
    if why := entry.missing():
        pytest.skip(f"{title}: {why}")
    drawn = 0
    with _painter(entry, tmp_path) as paint:
        for case in CASES:
            grid = image_grid(case.numbers, 24)
            x, y = np.meshgrid(*grid.axes(np.dtype(np.float64)))
            truth = oracle.evaluate(scene_of(case.numbers), x, y)
            for values in paint(case, grid):
                found = measure(values, truth)
                drawn += 1
                assert values.dtype == case.dtype
                assert found.max_abs < TOLERANCE[case.format], (title, case.name)
                assert found.flips == found.nonfinite == 0, (title, case.name)
    assert drawn, title


@contextmanager
def _painter(entry: Entry, folder: Path) -> Iterator[Callable[[Case, Grid], list[Any]]]:
    """The picture of every arrangement, or of the chosen one where the contestant has to have its own process."""
    if entry.ours or entry.title in HERE:
        module, _, function = entry.factory.partition(":")
        factory = getattr(import_module(module), function)
        yield lambda case, grid: [np.array(draw(grid)()) for draw in factory(case, 1).values()]
        return
    process = Process(entry, 1, folder / "home")

    def paint(case: Case, grid: Grid) -> list[Any]:
        if process.prepare(case, grid.size) is None:
            return []
        process.picture(case, grid, folder / "values.npy")
        return [np.load(folder / "values.npy")]

    try:
        yield paint
    finally:
        process.close()


@pytest.mark.parametrize("size", [24, 64, 256, 512, 1000, 1024, 2048])
def test_every_pixel_centre_is_a_float32_however_it_is_computed(size: int) -> None:
    grid = image_grid(Numbers(), size)
    for axis in grid.axes(np.dtype(np.float64)):
        assert (axis.astype(np.float32) == axis).all()
    x, y = grid.axes(np.dtype(np.float64))
    index = np.arange(size, dtype=np.float32)
    assert (np.float32(grid.left) + index * np.float32(grid.step) == x).all()
    assert (x == -x[::-1]).all()
    assert (y == x[::-1]).all()
    assert abs(grid.step * size / (2.0 * Numbers().half) - 1.0) < 2.0**-11


@pytest.mark.parametrize("form", ["float64", "float32"])
def test_the_close_up_lies_on_the_outline_and_on_floats_of_the_format(form: str) -> None:
    grid = outline_grid(Numbers(), form, 64)
    exact = grid.axes(np.dtype(np.float64))
    for axis, told in zip(exact, grid.axes(np.dtype(form)), strict=True):
        assert (axis == told).all()
        assert np.unique(axis).size == 64
    hit = oracle.evaluate(scene_of(Numbers()), *np.meshgrid(*exact)).hit
    assert 1000 < np.count_nonzero(hit) < 3096


@pytest.mark.parametrize("size", [1, 7, 64, 100, 10000])
def test_strips_cover_every_row_once(size: int) -> None:
    rows = np.concatenate([np.arange(size)[strip] for strip in strips_of(size)])
    assert (rows == np.arange(size)).all()


@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.0, 32.0, 37.0, 1024.0])
def test_a_whole_exponent_is_a_chain_of_products(exponent: float) -> None:
    def never(base: float, exponent: float) -> float:
        raise AssertionError("a whole exponent needs no power function")

    assert power(0.99, exponent, never) == pytest.approx(0.99**exponent, rel=1e-12)
    assert power(0.99, 37.5, lambda base, exponent: (base, exponent)) == (0.99, 37.5)


def test_a_case_travels_as_json() -> None:
    for case in CASES:
        assert Case.of(json.loads(json.dumps(case.to_dict()))) == case


def test_an_error_is_an_answer_and_not_an_end() -> None:
    def factory(case: Case, threads: int) -> Any:
        raise RuntimeError("no")

    asked = json.dumps({"ask": "prepare", "case": CASES[0].to_dict(), "size": 8}) + "\n"
    out = io.StringIO()
    serve(factory, 1, io.StringIO(asked + asked), out)
    assert [json.loads(line) for line in out.getvalue().splitlines()] == [{"error": "RuntimeError: no"}] * 2


def test_a_process_that_is_gone_says_so(broken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([broken, os.environ.get("PYTHONPATH", "")]))
    process = Process(Entry("ends", "broken_peers:ends"), 1, tmp_path / "home")
    try:
        for _ in range(2):
            with pytest.raises(ContestantError, match="status 3"):
                process.prepare(CASES[0], 8)
    finally:
        process.close()


def made_report() -> Report:
    """A report of two contestants, without a contest."""
    errors = Errors(1.0, 1e-15, 1e-15, 0, 0, 1, ())
    row = Row(CASES[0].name, "Peer", False, Spread(2.0, 2.0, 2.0), None, {}, errors, 0, "loop", 0.5)
    rows = tuple(
        replace(row, case=case.name, title=title, ours=ours)
        for case in CASES
        for title, ours in (("Peer", False), ("double", True))
    )
    return Report(
        machine=this_machine(),
        size=8,
        rounds=1,
        points=(1, 1),
        seed=1,
        cases=tuple(case.name for case in CASES),
        bases={case.name: "double" for case in CASES},
        versions={},
        absent={},
        failed={},
        rows=rows,
        starts=(Start("Peer", False, 1.0),),
    )


def test_the_chart_names_every_peer_and_ours(tmp_path: Path) -> None:
    draw_chart(made_report(), tmp_path / "chart.svg")
    draw_chart(made_report(), tmp_path / "chart.png")
    assert (tmp_path / "chart.png").read_bytes()[:4] == b"\x89PNG"
    text = (tmp_path / "chart.svg").read_text(encoding="utf-8")
    assert text.count("<!-- double -->") == len(CASES)
    assert text.count("<!-- Peer -->") == 1
    assert text.count("<!-- ours -->") == 1


def test_a_chart_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"chart\.pdf.*\.png or \.svg"):
        draw_chart(made_report(), tmp_path / "chart.pdf")
