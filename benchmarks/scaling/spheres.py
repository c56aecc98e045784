"""`python -m benchmarks scaling spheres`: an image against the number of spheres, beside POV-Ray and Mitsuba.

Comes in: counts of spheres, a size, rounds. Goes out: SpheresReport and its table. Scenes:
`random_spheres(count, seed)`, with hard shadows and without. Contestants take turns in every round; ours keep their
output array, the plan and the kernel; Mitsuba keeps its scene and kernels; of POV-Ray it is the trace time that its own
statistics state (to 1 ms).
`planning` is apart: the first image of a scene with other spheres, its kernel compiled already, less a warm one.
Never done here: a comparison of pixels finer than counting those more than an 8-bit level apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks import mitsuba, povray
from benchmarks.machine import (
    Machine,
    Spread,
    cores,
    milliseconds,
    spread,
    take_turns,
    this_machine,
    warm_sample,
)
from symrender_cg import Scene, render_image
from symrender_cg.errors import OutsidePlanError
from symrender_cg.scene.random import random_spheres

COUNTS: Final = (1, 10, 100, 1_000, 10_000)
QUICK_COUNTS: Final = (1, 10, 100)
ACCURACIES: Final = ("double", "single")
PLANNED: Final = 3
"""Scenes that planning is timed on."""

IDLE: Final = 0.06
"""Seconds of images that follow one another, of which the fastest counts: the threads of the contestant before look out
for work, each on a processor, for tens of milliseconds after their last image."""

LEVEL: Final = 1.0 / 255.0
OTHER_PICTURE: Final = 0.01
"""The part of the pixels from which on a ratio of times would compare two different pictures."""

GAIN: Final = 0.5
"""Of POV-Ray's intensities, which end at 1; the brightest of these scenes is 1.3."""

POV, POV_BSP, AS_IS, LEAN = "POV-Ray", "POV-Ray, BSP", "Mitsuba, as is", "Mitsuba, lean"


@dataclass(frozen=True, slots=True)
class Row:
    """One count, with or without shadows; milliseconds by contestant.

    over: by contestant, the pixels more than a level from the picture of `base`, our double where we draw the scene.
    planning_ms: None where no kernel draws the scene; then `refused` says why.
    """

    count: int
    shadows: bool
    planning_ms: Spread | None
    milliseconds: dict[str, Spread]
    base: str
    over: dict[str, int]
    refused: str

    def better_peer(self) -> str | None:
        """The fastest peer, by the median."""
        peers = [name for name in (POV, POV_BSP, AS_IS, LEAN) if name in self.milliseconds]
        return min(peers, key=lambda name: self.milliseconds[name].median, default=None)


@dataclass(frozen=True, slots=True)
class SpheresReport:
    """What `scaling spheres` measured."""

    machine: Machine
    peers: tuple[str, ...]
    missing: tuple[str, ...]
    size: int
    rounds: int
    seed: int
    threads: int
    rows: tuple[Row, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One line a count, with shadows and without."""
        console.print(self.machine.line(), highlight=False)
        for line in (*self.peers, *self.missing):
            console.print(line, highlight=False)
        ours = [ours_name(accuracy, threads) for accuracy in ACCURACIES for threads in sorted({1, self.threads})]
        peers = (POV, POV_BSP, AS_IS, LEAN)
        title = f"milliseconds, {self.size} x {self.size}, {self.rounds} rounds; peers with {self.threads} threads"
        table = Table(title=title)
        for head in ("spheres", "shadows", "planning", *ours, *peers, "better peer / double", "/ single"):
            table.add_column(head, justify="right")
        for row in self.rows:
            best = row.better_peer()
            ratios = [self._ratio(row, best, ours_name(accuracy, self.threads)) for accuracy in ACCURACIES]
            times = [
                f"{row.milliseconds[name].median:.2f}" if name in row.milliseconds else "-" for name in [*ours, *peers]
            ]
            planning = "-" if row.planning_ms is None else f"{row.planning_ms.median:.2f}"
            table.add_row(f"{row.count:,}", "yes" if row.shadows else "no", planning, *times, *ratios)
        console.print(table)
        console.print(
            "'as is': Mitsuba's surface interactions; 'lean': its hits alone, normals by us; both float32. "
            "BSP: POV-Ray's +BM2. Ours: 't' are threads."
        )
        for row in self.rows:
            shadows = "with" if row.shadows else "without"
            apart = ", ".join(f"{name} {pixels:,}" for name, pixels in row.over.items() if pixels)
            if apart:
                console.print(f"{row.count:,} spheres {shadows} shadows: pixels > 1 level from {row.base}: {apart}")
            if row.refused:
                console.print(f"{row.count:,} spheres {shadows} shadows: not drawn by us: {row.refused}")

    def _ratio(self, row: Row, best: str | None, ours: str) -> str:
        """The peer's time over ours, where both drew the same picture."""
        if best is None or ours not in row.milliseconds:
            return "-"
        if row.over[best] > OTHER_PICTURE * self.size**2 or row.over.get(ours, 0) > OTHER_PICTURE * self.size**2:
            return "another picture"
        return f"{row.milliseconds[best].median / row.milliseconds[ours].median:.2f}"


def ours_name(accuracy: str, threads: int) -> str:
    """The contestant's name."""
    return f"{accuracy} {threads}t"


def measure_spheres(
    counts: Sequence[int], size: int, rounds: int, seed: int, told: Callable[[str], None]
) -> SpheresReport:
    """Each count with shadows and without; told(text) says what is going on."""
    program, lacking = povray.find(), mitsuba.missing()
    absent = [] if program else [f"POV-Ray is not installed and left out; {povray.INSTALL}"]
    absent += [lacking] if lacking else []
    peers = ([povray.version(program)] if program else []) + ([] if lacking else [mitsuba.version()])
    cases = [(count, shadows) for count in counts for shadows in (True, False)]
    rows = [_row(count, shadows, size, rounds, seed, program, not lacking, told) for count, shadows in cases]
    return SpheresReport(this_machine(), tuple(peers), tuple(absent), size, rounds, seed, cores(), tuple(rows))


def _row(
    count: int,
    shadows: bool,
    size: int,
    rounds: int,
    seed: int,
    program: str | None,
    with_mitsuba: bool,
    told: Callable[[str], None],
) -> Row:
    name = f"{count:,} spheres {'with' if shadows else 'without'} shadows"
    told(f"{name}: scene, plan, kernels")
    scene = random_spheres(count, seed, shadows=shadows)
    calls: dict[str, Callable[[], float]] = {}
    pictures: dict[str, NDArray[Any]] = {}
    planning, refused = None, ""
    try:
        for accuracy in ACCURACIES:
            for threads in sorted({1, cores()}):
                draw = _ours(scene, size, accuracy, threads)
                pictures[ours_name(accuracy, threads)] = draw()
                calls[ours_name(accuracy, threads)] = warm_sample(draw, IDLE)
        planning = _planning(count, seed, shadows, size)
    except OutsidePlanError as reason:
        refused = str(reason)
    if program:
        for peer, bsp in ((POV, False), (POV_BSP, True)):
            trace = partial(povray.draw, program, scene, size, size, threads=cores(), gain=GAIN, bsp=bsp)
            pictures[peer] = trace().image
            calls[peer] = partial(_trace_milliseconds, trace)
    if with_mitsuba:
        for peer, lean in ((AS_IS, False), (LEAN, True)):
            image = mitsuba.picture(scene, size, size, threads=cores(), lean=lean)
            pictures[peer] = image()
            calls[peer] = warm_sample(image, IDLE)
    samples = take_turns(calls, rounds, seed, lambda number: told(f"{name}: round {number + 1} of {rounds}"))
    times = {contestant: spread(values) for contestant, values in samples.items()}
    base, *others = pictures or [""]
    over = {other: _pixels_apart(pictures[base], pictures[other]) for other in others}
    return Row(count, shadows, planning, times, base, over, refused)


def _ours(scene: Scene, size: int, accuracy: str, threads: int) -> Callable[[], NDArray[Any]]:
    """A call that draws the unclipped image into an array of its own."""
    out = render_image(scene, size, size, accuracy=accuracy, threads=threads, clip=False)
    return partial(render_image, scene, size, size, accuracy=accuracy, threads=threads, clip=False, out=out)


def _planning(count: int, seed: int, shadows: bool, size: int) -> Spread:
    """Milliseconds of the first image of a scene less those of the next one, over scenes of other seeds."""
    samples = []
    for other in range(seed + 1, seed + 1 + PLANNED):
        scene = random_spheres(count, other, shadows=shadows)
        draw = partial(render_image, scene, size, size, threads=1, clip=False)
        first, warm = milliseconds(draw), min(milliseconds(draw) for _ in range(3))
        samples.append(max(first - warm, 0.0))
    return spread(samples)


def _trace_milliseconds(trace: Callable[[], povray.Drawn]) -> float:
    return 1e3 * trace().trace_seconds


def _pixels_apart(one: NDArray[Any], other: NDArray[Any]) -> int:
    """Pixels more than a level apart."""
    return int((np.abs(one.astype(np.float64) - other) > LEVEL).sum())
