"""`python -m benchmarks start`: wall time from the start of a process to its first image.

Comes in: a size and rounds. Goes out: Report, and its table. Each case is a fresh interpreter with its own cache
folder; the clock starts before the process does and stops when its line "image" arrives. Modules are compiled to byte
code by a first run that is not counted. Never done here: a warm import.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.machine import Machine, Spread, spread, take_turns, this_machine

_NUMPY = "import numpy; numpy.zeros(({size}, {size})); print('image', flush=True); print(0)"

_OURS = """
import time
from symrender_cg import Scene, render_image
render_image(Scene.chapter1(), {size}, {size})
print("image", flush=True)
other = Scene.chapter1(radius=0.9, eye=5.0, light=(-3.0, 4.0, 9.0), shininess=20.5)
start = time.perf_counter()
render_image(other, {size}, {size})
print(time.perf_counter() - start)
"""

_SEED = """
import numpy as np
from benchmarks.seed import cell_3, cell_3_grid
with np.errstate(invalid="ignore", divide="ignore"):
    cell_3()(*cell_3_grid({size}, {size}, 1.0, 4.0), 1.0, 4.0, 5.0, 5.0, 10.0, 0.1, 0.7, 0.5, 32.0)
print("image", flush=True)
print(0)
"""

EMPTY, WARM = "first image, empty cache", "first image, warm cache"
SECOND_EMPTY, SECOND_WARM = "second scene, after an empty cache", "second scene, after a warm cache"
FLOOR, SEED = "Python and numpy alone", "the seed's Cells 2 and 3"


@dataclass(frozen=True, slots=True)
class Report:
    """Seconds of every case."""

    machine: Machine
    size: int
    rounds: int
    seconds: dict[str, Spread]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One line a case."""
        console.print(self.machine.line(), highlight=False)
        title = f"seconds to an image of {self.size} x {self.size}, {self.rounds} rounds"
        table = Table(title=title)
        table.add_column("case")
        for head in ("median", "quartiles"):
            table.add_column(head, justify="right")
        for case, value in self.seconds.items():
            table.add_row(case, f"{value.median:.4f}", f"{value.low:.4f} .. {value.high:.4f}")
        console.print(table)
        console.print(
            "First images: from the start of the process. Second scenes: the call alone, other numbers, same structure."
        )


def measure_start(size: int, rounds: int, seed: int, told: Callable[[str], None]) -> Report:
    """All cases take turns; a cache is filled once for the warm ones, and every cold one has a new folder."""
    seconds: dict[str, list[float]] = {SECOND_EMPTY: [], SECOND_WARM: []}
    with tempfile.TemporaryDirectory(prefix="symrender_start_") as folder:
        warm = Path(folder, "warm")
        told("a first run of each, not counted")
        for code in (_NUMPY, _OURS, _SEED):
            _first_image(code, size, warm)
        cold = 0

        def empty() -> float:
            nonlocal cold
            cold += 1
            first, second = _first_image(_OURS, size, Path(folder, f"cold_{cold}"))
            seconds[SECOND_EMPTY].append(second)
            return first

        def filled() -> float:
            first, second = _first_image(_OURS, size, warm)
            seconds[SECOND_WARM].append(second)
            return first

        calls = {
            FLOOR: lambda: _first_image(_NUMPY, size, warm)[0],
            WARM: filled,
            EMPTY: empty,
            SEED: lambda: _first_image(_SEED, size, warm)[0],
        }
        seconds |= take_turns(calls, rounds, seed, lambda number: told(f"round {number + 1} of {rounds}"))
    order = (FLOOR, WARM, EMPTY, SECOND_WARM, SECOND_EMPTY, SEED)
    return Report(this_machine(), size, rounds, {case: spread(seconds[case]) for case in order})


def _first_image(code: str, size: int, cache: Path) -> tuple[float, float]:
    """(seconds to the line "image", the number that the process prints next). Raises where the process fails."""
    root = str(Path(__file__).resolve().parents[1])
    path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": path, "SYMRENDER_CACHE_DIR": str(cache)}
    start = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-c", code.format(size=size)], stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        seconds = time.perf_counter() - start
        rest = process.stdout.read()
    if process.returncode != 0 or line.strip() != "image":
        raise RuntimeError(f"a measured process failed with exit status {process.returncode}; it said {line + rest!r}")
    return seconds, float(rest)
