"""`python -m benchmarks scaling lights`: the time of an image against the number of its lights, beside POV-Ray.

Comes in: counts of lights, a size, rounds. Goes out: LightsReport and its table. Scenes: ten random spheres with hard
shadows, and so many point lights on a ring about the view, which share one light's intensity. `planning` is apart: the
first image less a warm one. Never done here: Mitsuba, whose scene here has one light.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks import povray
from benchmarks.machine import Machine, Spread, cores, milliseconds, spread, take_turns, this_machine, warm_sample
from benchmarks.scaling.growth import exponent
from benchmarks.scaling.spheres import GAIN, LEVEL, POV
from symrender_cg import PointLight, Scene, render_image
from symrender_cg.scene.random import random_spheres

SPHERES: Final = 10
ACCURACIES: Final = ("double", "single")


@dataclass(frozen=True, slots=True)
class Row:
    """One count: milliseconds of planning and of an image by contestant; pixels of POV-Ray's more than a level off."""

    count: int
    planning_ms: float
    milliseconds: dict[str, Spread]
    over: int


@dataclass(frozen=True, slots=True)
class LightsReport:
    """What `scaling lights` measured."""

    machine: Machine
    peers: tuple[str, ...]
    missing: tuple[str, ...]
    size: int
    rounds: int
    threads: int
    rows: tuple[Row, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One line a count; the last line has the exponents."""
        console.print(self.machine.line(), highlight=False)
        for line in (*self.peers, *self.missing):
            console.print(line, highlight=False)
        names = tuple(dict.fromkeys(name for row in self.rows for name in row.milliseconds))
        title = f"milliseconds against lights, {SPHERES} spheres, {self.size} x {self.size}, {self.rounds} rounds"
        table = Table(title=title)
        for head in ("lights", "planning", *names, "POV-Ray > 1 level off"):
            table.add_column(head, justify="right")
        for row in self.rows:
            times = [f"{row.milliseconds[name].median:.2f}" for name in names]
            over = f"{row.over:,}" if POV in row.milliseconds else "-"
            table.add_row(str(row.count), f"{row.planning_ms:.1f}", *times, over)
        if len(self.rows) > 1:
            counts = [row.count for row in self.rows]
            fits = [exponent(counts, [row.milliseconds[name].median for row in self.rows]) for name in names]
            table.add_row("exponent", "", *(f"{value:.2f}" for value in fits), "")
        console.print(table)
        console.print(f"exponent: p of time ~ lights^p; 't' are threads; POV-Ray has {self.threads}, its trace alone.")


def ring_of_lights(count: int, seed: int) -> Scene:
    """`random_spheres(10, seed)` lit by `count` point lights of intensity 1 / count, 9 from the axis."""
    turns = (2.0 * math.pi * (k + 0.25) / count for k in range(count))
    lights = tuple(
        PointLight((9.0 * math.cos(turn), 9.0 * math.sin(turn), 10.0), intensity=1.0 / count) for turn in turns
    )
    return replace(random_spheres(SPHERES, seed), lights=lights)


def measure_lights(
    counts: Sequence[int], size: int, rounds: int, seed: int, told: Callable[[str], None]
) -> LightsReport:
    """Counts one after another, contestants in turns; told(text) says what is going on."""
    program = povray.find()
    told("lights: kernels")
    for accuracy in ACCURACIES:  # the kernel has the effects and not the number of lights, and is compiled here
        for count in sorted({1, 2}):
            render_image(ring_of_lights(count, seed + 1), size, size, accuracy=accuracy)
    rows = tuple(_row(count, size, rounds, seed, program, told) for count in counts)
    peers = (povray.version(program),) if program else ()
    missing = () if program else (f"POV-Ray is not installed and left out; {povray.INSTALL}",)
    return LightsReport(this_machine(), peers, missing, size, rounds, cores(), rows)


def _row(count: int, size: int, rounds: int, seed: int, program: str | None, told: Callable[[str], None]) -> Row:
    scene = ring_of_lights(count, seed)
    told(f"{count} lights")
    calls: dict[str, Callable[[], float]] = {}
    pictures: list[NDArray[np.float64]] = []
    planning = float("nan")
    for accuracy in ACCURACIES:
        for threads in sorted({1, cores()}):
            draw = partial(render_image, scene, size, size, accuracy=accuracy, threads=threads, clip=False)
            first = milliseconds(draw)
            out = draw()
            if not pictures:
                planning = max(first - min(milliseconds(draw) for _ in range(3)), 0.0)
                pictures.append(np.array(out, dtype=np.float64))
            calls[f"{accuracy} {threads}t"] = warm_sample(partial(draw, out=out))
    over = 0
    if program:
        trace = partial(povray.draw, program, scene, size, size, threads=cores(), gain=GAIN)
        over = int((np.abs(trace().image - pictures[0]) > LEVEL).sum())
        calls[POV] = lambda: 1e3 * trace().trace_seconds
    samples = take_turns(calls, rounds, seed, lambda number: told(f"{count} lights: round {number + 1} of {rounds}"))
    return Row(count, planning, {name: spread(values) for name, values in samples.items()}, over)
