"""One contestant's process: `python -m benchmarks.peers.worker FACTORY THREADS PROCESSORS`, lines of JSON in and out.

Comes in, a line each on stdin: {"ask": "first", "case", "size"}, {"ask": "prepare", "case", "size"}, {"ask": "sample",
"case"}, {"ask": "picture", "case", "grid", "path"}. Goes out, a line each: what was measured, or {"error": why}.
What a contestant prints goes to stderr. Never done here: an import that its contestant does not need, because the
clock of its cold start runs.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Mapping
from importlib import import_module
from typing import Any, Final, TextIO

import numpy as np

from benchmarks.peers.case import Arrangements, Case, Draw, Factory, Grid, Render, image_grid

SHORTEST_SAMPLE: Final = 0.015
"""Seconds that a sample takes at least: what is faster is called several times, and the fastest call counts."""
TRIALS: Final = 5
HOPELESS: Final = 2.0
"""An arrangement that takes this many times the best one in its first trial has no other."""


class Contestant:
    """What a process keeps: for each case the fastest of its arrangements, compiled and warm."""

    def __init__(self, factory: Factory, threads: int) -> None:
        self.factory, self.threads = factory, threads
        self.made: dict[Case, tuple[Arrangements, float]] = {}
        self.chosen: dict[Case, tuple[Draw, Render, int, int]] = {}
        self.earlier: dict[tuple[Case, str], float] = {}

    def answer(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """What was asked for; see the module."""
        case = Case.of(asked["case"])
        if asked["ask"] == "first":
            return self.first(case, asked["size"])
        if asked["ask"] == "prepare":
            return self.prepare(case, asked["size"])
        if asked["ask"] == "sample":
            return {"ns": self.sample(case)}
        assert asked["ask"] == "picture", asked
        draw, *_ = self.chosen[case]
        np.save(asked["path"], np.asarray(draw(Grid(**asked["grid"]))()))
        return {}

    def arrangements(self, case: Case) -> tuple[Arrangements, float]:
        """(the arrangements, seconds that making them took), made once."""
        if case not in self.made:
            start = time.perf_counter()
            self.made[case] = self.factory(case, self.threads), time.perf_counter() - start
        return self.made[case]

    def first(self, case: Case, size: int) -> dict[str, Any]:
        """An image by the first arrangement: what there is to wait for after the start."""
        arrangements, _ = self.arrangements(case)
        for name, draw in arrangements.items():
            start = time.perf_counter()
            draw(image_grid(case.numbers, size))()
            self.earlier[case, name] = time.perf_counter() - start
            return {"drawn": True}
        return {"drawn": False}

    def prepare(self, case: Case, size: int) -> dict[str, Any]:
        """Every arrangement compiled, timed and the fastest kept: its name and the seconds to its first image."""
        arrangements, making = self.arrangements(case)
        best = None
        for name, draw in arrangements.items():
            start = time.perf_counter()
            render = draw(image_grid(case.numbers, size))
            render()
            first = self.earlier.get((case, name), time.perf_counter() - start)
            calls = _calls(render)
            seconds = _timed(render, calls)
            if best is None or seconds < HOPELESS * best[0]:
                seconds = min(seconds, *(_timed(render, calls) for _ in range(TRIALS - 1)))
            if best is None or seconds < best[0]:
                best = seconds, name, max(making + first - seconds, 0.0), (draw, render, calls, size)
        if best is None:
            return {"arrangement": ""}
        self.chosen[case] = best[3]
        return {"arrangement": best[1], "compile_seconds": best[2]}

    def sample(self, case: Case) -> float:
        """Nanoseconds a pixel, after an image that is not timed: another contestant has had the caches."""
        _, render, calls, size = self.chosen[case]
        render()
        return _timed(render, calls) / size**2 * 1e9


def serve(factory: Factory, threads: int, lines: TextIO, out: TextIO) -> None:
    """Answers until the lines end. An error is an answer, not an end."""
    contestant = Contestant(factory, threads)
    for line in lines:
        try:
            answer = contestant.answer(json.loads(line))
        except Exception as problem:  # whatever a peer raises is its answer
            answer = {"error": f"{type(problem).__name__}: {problem}"}
        out.write(json.dumps(answer) + "\n")
        out.flush()


def _calls(render: Render) -> int:
    """How many images make up a sample."""
    return max(1, round(SHORTEST_SAMPLE / max(_timed(render, 1), 1e-7)))


def _timed(render: Render, calls: int) -> float:
    """Seconds of the fastest of some images: one that another process did not interrupt."""
    best = float("inf")
    for _ in range(calls):
        start = time.perf_counter()
        render()
        best = min(best, time.perf_counter() - start)
    return best


def main(argv: list[str]) -> None:
    """Binds the process to its processors, keeps stdout for answers alone, and serves."""
    where, threads, processors = argv
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(number) for number in processors.split(",")})
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    module, _, function = where.partition(":")
    serve(getattr(import_module(module), function), int(threads), sys.stdin, out)


if __name__ == "__main__":
    main(sys.argv[1:])
