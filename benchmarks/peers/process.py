"""`Process`: a contestant that is asked questions and answers them, one line of JSON each.

Comes in: an Entry, a number of threads, a folder that stands in for its home. Goes out: answers. A contestant that
ends, hangs or raises becomes a `ContestantError`, which says what it said last. Never done here: timing, but for the
cold start, whose clock begins before the process does.
"""

from __future__ import annotations

import json
import os
import select
import site
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from benchmarks.machine import cores
from benchmarks.peers.case import Case, Grid
from benchmarks.peers.registry import Entry

PATIENCE: Final = 300.0
"""Seconds that an answer may take."""


class ContestantError(Exception):
    """A contestant that did not answer, and why."""


class Process:
    """A contestant's process. With one thread it is bound to the last processor, with more to all of them."""

    def __init__(self, entry: Entry, threads: int, home: Path) -> None:
        self.entry = entry
        self._said = home / "stderr.txt"
        home.mkdir(parents=True, exist_ok=True)
        everything = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(cores()))
        processors = everything[-1:] if threads == 1 else everything
        command = [sys.executable, "-m", "benchmarks.peers.worker", entry.factory, str(threads)]
        self._started = time.perf_counter()
        with self._said.open("wb") as said:
            self._process = subprocess.Popen(
                [*command, ",".join(map(str, processors))],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=said,
                env=_environment(home, threads),
            )

    def cold_start(self, case: Case, size: int) -> float | None:
        """Seconds from before the process was started to its first image; None where it has none for the case."""
        answer = self.ask("first", case, size=size)
        return time.perf_counter() - self._started if answer["drawn"] else None

    def prepare(self, case: Case, size: int) -> tuple[str, float] | None:
        """(the fastest arrangement, seconds of compiling); None where it has none for the case."""
        answer = self.ask("prepare", case, size=size)
        return (answer["arrangement"], answer["compile_seconds"]) if answer["arrangement"] else None

    def sample(self, case: Case) -> float:
        """Nanoseconds a pixel, warm."""
        return float(self.ask("sample", case)["ns"])

    def picture(self, case: Case, grid: Grid, path: Path) -> None:
        """Draws the grid and leaves the values at `path` as a .npy file."""
        window = {name: getattr(grid, name) for name in ("size", "left", "top", "step")}
        self.ask("picture", case, grid=window, path=str(path))

    def ask(self, what: str, case: Case, **more: Any) -> dict[str, Any]:
        """The answer. Raises ContestantError."""
        question = json.dumps({"ask": what, "case": case.to_dict(), **more}) + "\n"
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(question.encode())
            self._process.stdin.flush()
        except BrokenPipeError:
            raise ContestantError(self._last_words()) from None
        ready, _, _ = select.select([self._process.stdout], [], [], PATIENCE)
        if not ready:
            self._process.kill()
            raise ContestantError(f"no answer within {PATIENCE:g} s")
        line = self._process.stdout.readline()
        if not line:
            raise ContestantError(self._last_words())
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise ContestantError(_one_line(answer["error"]))
        return answer

    def close(self) -> None:
        """Ends the process."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        try:
            self._process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _last_words(self) -> str:
        status = self._process.wait()
        text = self._said.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        telling = [line for line in text if "rror" in line] or text[-1:] or ["it said nothing"]
        return _one_line(f"ended with status {status}: {telling[-1]}")


def _one_line(text: str) -> str:
    first = " ".join(text.split())
    return first if len(first) <= 200 else first[:199] + "…"


def _environment(home: Path, threads: int) -> dict[str, str]:
    """An empty home, so that no contestant finds what it compiled before; thread counts that only a variable sets."""
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    counts = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMEXPR_MAX_THREADS", "HL_NUM_THREADS")
    return {
        **os.environ,
        "PYTHONPATH": path,
        "PYTHONUSERBASE": site.getuserbase(),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"),
        "SYMRENDER_CACHE_DIR": str(home / "kernels"),
        **{name: str(threads) for name in counts},
    }
