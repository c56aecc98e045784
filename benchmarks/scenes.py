"""`python -m benchmarks scenes`: what the plan is worth, scene by scene.

Comes in: built-in names or files, a size, rounds. Goes out: Report and its table: effects in and out, nanoseconds a
pixel with the plan and with every effect forced in, the largest difference of the two images, lines of C, seconds of
the compiler. Both kernels are scene kernels, take turns in one run, and use one thread. Never done here: a peer.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.machine import Machine, Spread, spread, take_turns, this_machine
from symrender_cg import Scene, load_scene, translate
from symrender_cg.pipeline import build_kernel, draw
from symrender_cg.plan.effects import EFFECTS

OPTIONAL = tuple(effect.name for effect in EFFECTS if effect.optional and effect.name != "front_test")
"""All that can be forced in, but for the test of spheres at the plane of the eye: it brings other formulas for the same
numbers, which differ in the last places."""


@dataclass(frozen=True, slots=True)
class Row:
    """One scene: its kernel, effects in and out, times, the largest difference, what the kernel's C takes."""

    scene: str
    kernel: str
    effects_in: tuple[str, ...]
    effects_out: tuple[str, ...]
    planned_ns: Spread
    own_ns: Spread
    forced_ns: Spread
    ratio: float
    largest_change: float
    lines: int
    compile_seconds: float


@dataclass(frozen=True, slots=True)
class Report:
    """What `scenes` measured."""

    machine: Machine
    size: int
    rounds: int
    seed: int
    rows: tuple[Row, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One line a scene, then the effects that are in."""
        console.print(self.machine.line(), highlight=False)
        table = Table(title=f"double, {self.size} x {self.size}, one thread, {self.rounds} rounds; ns a pixel")
        for head in (
            "scene",
            "in",
            "out",
            "chosen",
            "planned",
            "all forced in",
            "ratio",
            "change",
            "lines",
            "compile s",
        ):
            table.add_column(head, justify="left" if head == "scene" else "right")
        for row in self.rows:
            table.add_row(
                row.scene,
                str(len(row.effects_in)),
                str(len(row.effects_out)),
                f"{row.own_ns.median:.2f}",
                f"{row.planned_ns.median:.2f}",
                f"{row.forced_ns.median:.2f}",
                f"{row.ratio:.2f}",
                f"{row.largest_change:.1e}" if row.largest_change else "0",
                str(row.lines),
                f"{row.compile_seconds:.2f}",
            )
        console.print(table)
        console.print(
            "'chosen': the kernel that render_image takes, for one sphere one of its own; 'planned' and 'all forced "
            "in': kernels of scenes, so that the difference is the plan's."
        )
        for row in self.rows:
            console.print(f"{row.scene} ({row.kernel}) in: {', '.join(row.effects_in) or '-'}", highlight=False)


def measure_scenes(names: Sequence[str], size: int, rounds: int, seed: int, told: Callable[[str], None]) -> Report:
    """Every scene in turn; told(text) says what is going on."""
    chosen = names or Scene.builtin_names()
    return Report(this_machine(), size, rounds, seed, tuple(_row(name, size, rounds, seed, told) for name in chosen))


def _row(name: str, size: int, rounds: int, seed: int, told: Callable[[str], None]) -> Row:
    told(f"{name}: kernels")
    scene = load_scene(name)
    translation = translate(scene, aspect=1.0)
    with tempfile.TemporaryDirectory() as folder:
        seconds = build_kernel(translation, root=Path(folder)).compile_seconds
    images: dict[str, NDArray[Any]] = {}
    calls: dict[str, Callable[[], float]] = {}
    for key, force in (("own", ()), ("planned", ("scene",)), ("forced", ("scene", *OPTIONAL))):
        drawing = draw(scene, size=(size, size), force=force)
        images[key] = np.empty(drawing.shape(size, size), drawing.dtype)
        calls[key] = _sample(drawing.rows, images[key], size)
        calls[key]()
    samples = take_turns(calls, rounds, seed, lambda number: told(f"{name}: round {number + 1} of {rounds}"))
    times = {key: spread(values) for key, values in samples.items()}
    summary = translation.plan.summary
    return Row(
        scene=name,
        kernel=translation.emitted.name,
        effects_in=tuple(decision.effect.name for decision in summary if decision.needed),
        effects_out=tuple(decision.effect.name for decision in summary if not decision.needed),
        planned_ns=times["planned"],
        own_ns=times["own"],
        forced_ns=times["forced"],
        ratio=times["forced"].median / times["planned"].median,
        largest_change=float(np.abs(images["forced"] - images["planned"]).max()),
        lines=len(translation.emitted.files[f"{translation.emitted.name}.c"].splitlines()),
        compile_seconds=seconds,
    )


def _sample(rows: Callable[[NDArray[Any], int, int], None], image: NDArray[Any], size: int) -> Callable[[], float]:
    """Nanoseconds a pixel of one image."""

    def call() -> float:
        start = time.perf_counter()
        rows(image, 0, size)
        return (time.perf_counter() - start) * 1e9 / size**2

    return call
