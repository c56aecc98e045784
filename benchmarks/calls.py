"""`python -m benchmarks.calls`: what a call costs beyond its kernel, what a second thread brings, what a batch saves.

Comes in: rounds, a seed. Goes out: three tables. Contestants take turns, in another order every round; a ratio is the
median of the ratios within a round. Beside the gain of two threads stands what two threads of this machine can gain at
all: each draws an image of its own, and neither waits for the other.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.machine import Spread, spread, take_turns, this_machine, warm_sample
from symrender_cg import Scene, render_batch, render_image
from symrender_cg.pipeline import draw

SCENES = ("chapter1", "two_spheres", "hundred")
SIDES = (256, 512, 1024, 2048)
SETS = 500


@dataclass(frozen=True, slots=True)
class Row:
    """One line of a table: what it is of, and its numbers in the order of the columns."""

    name: str
    numbers: tuple[Spread, ...]


def overheads(rounds: int, seed: int) -> list[Row]:
    """Microseconds of a warm render_image, of its kernel alone, and between them."""
    rows = []
    for name in SCENES:
        scene = Scene.builtin(name)
        for side in (1, 64):
            drawing = draw(scene, size=(side, side), clip=True)
            image = np.empty(drawing.shape(side, side), drawing.dtype)
            write = drawing.onto(image)
            calls = {
                "call": warm_sample(lambda scene=scene, side=side: render_image(scene, side, side)),  # type: ignore[misc]
                "kernel": warm_sample(lambda write=write, side=side: write(0, side)),  # type: ignore[misc]
            }
            found = take_turns(calls, rounds, seed, lambda _: None)
            call, kernel = (1e3 * np.array(found[key]) for key in ("call", "kernel"))
            rows.append(
                Row(f"{name} {side} x {side}", tuple(spread(v.tolist()) for v in (call, kernel, call - kernel)))
            )
    return rows


def gains(rounds: int, seed: int) -> list[Row]:
    """Milliseconds of an image on one thread and on two, their ratio, and the ratio that the machine can give."""
    rows = []
    for name in SCENES:
        scene = Scene.builtin(name)
        for side in SIDES:
            images = [render_image(scene, side, side, threads=2) for _ in range(2)]
            calls = {
                "one": warm_sample(lambda s=scene, n=side, o=images[0]: render_image(s, n, n, threads=1, out=o)),  # type: ignore[misc]
                "two": warm_sample(lambda s=scene, n=side, o=images[0]: render_image(s, n, n, threads=2, out=o)),  # type: ignore[misc]
                "own": lambda s=scene, n=side, o=images: _two_at_once(s, n, o),  # type: ignore[misc]
            }
            found = {key: np.array(values) for key, values in take_turns(calls, rounds, seed, lambda _: None).items()}
            numbers = found["one"], found["two"], found["one"] / found["two"], 2.0 * found["one"] / found["own"]
            rows.append(Row(f"{name} {side} x {side}", tuple(spread(v.tolist()) for v in numbers)))
    return rows


def _two_at_once(scene: Scene, side: int, images: Sequence[np.ndarray]) -> float:
    """Milliseconds in which two threads each draw an image of their own, many times over."""
    count = max(4, (1 << 22) // (side * side))

    def many(image: np.ndarray) -> float:
        start = time.perf_counter()
        for _ in range(count):
            render_image(scene, side, side, threads=1, out=image)
        return 1e3 * (time.perf_counter() - start) / count

    with ThreadPoolExecutor(2) as pool:
        return float(np.mean(list(pool.map(many, images))))


def batches(rounds: int, seed: int) -> list[Row]:
    """Microseconds an image of render_batch on one thread, of render_image in a loop, and their ratio."""
    angles = np.linspace(0.0, 2.0 * math.pi, SETS, endpoint=False)
    places = np.stack([14.0 * np.sin(angles), np.full(SETS, 5.0), 14.0 + 2.0 * np.cos(angles)], axis=1)
    rows = []
    for side in (16, 64, 256):
        images = np.empty((SETS, side, side))

        def batch(side: int = side, images: np.ndarray = images) -> float:
            start = time.perf_counter()
            render_batch(None, {"lights.0.position": places}, side, side, out=images, threads=1)
            return 1e6 * (time.perf_counter() - start) / SETS

        def loop(side: int = side, images: np.ndarray = images) -> float:
            start = time.perf_counter()
            for image, place in zip(images, places.tolist(), strict=True):
                render_image(Scene.chapter1(light=place), side, side, out=image, threads=1)
            return 1e6 * (time.perf_counter() - start) / SETS

        drawn: dict[str, Callable[[], float]] = {"batch": batch, "loop": loop}
        for call in drawn.values():
            call()
        found = {key: np.array(values) for key, values in take_turns(drawn, rounds, seed, lambda _: None).items()}
        numbers = found["batch"], found["loop"], found["loop"] / found["batch"]
        rows.append(Row(f"{SETS} lights, {side} x {side}", tuple(spread(v.tolist()) for v in numbers)))
    return rows


def main(argv: Sequence[str] | None = None) -> int:
    """Measures and prints."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calls", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="samples of each contestant (15)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the order of turns (1)")
    options = parser.parse_args(argv)
    console = Console(width=140)
    console.print(this_machine().line(), highlight=False)
    tables = (
        ("a warm call, us", ("call", "kernel alone", "beyond the kernel"), overheads),
        ("a second thread, ms", ("one thread", "two threads", "gain", "gain of two images at once"), gains),
        ("a batch, us an image", ("render_batch", "render_image in a loop", "ratio"), batches),
    )
    for title, heads, measured in tables:
        table = Table(title=title)
        table.add_column("scene")
        for head in heads:
            table.add_column(head, justify="right")
        for row in measured(options.rounds, options.seed):
            table.add_row(row.name, *(number.shown() for number in row.numbers))
        console.print(table)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
