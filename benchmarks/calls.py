"""`python -m benchmarks.calls`: what a call costs beyond its kernel, what a second thread brings, what a batch saves.

Comes in: rounds, a seed. Goes out: tables. Contestants take turns, in another order every round; a ratio is the
median of the ratios within a round. Beside the gain of two threads stands what threads of Python would gain in place of
the pool in C, and what two threads of this machine can gain at all: each draws an image of its own, and neither waits
for the other.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.machine import Spread, milliseconds, spread, take_turns, this_machine, warm_sample
from symrender_cg import PointLight, Scene, render_batch, render_image
from symrender_cg.pipeline import draw
from symrender_cg.run.batch import SECONDS_BETWEEN
from symrender_cg.run.chunks import Asked, Waiting, make_chunk
from symrender_cg.run.parameters import parameter_sets
from symrender_cg.run.threads import over_rows

Floats = NDArray[np.float64]

SCENES = ("chapter1", "two_spheres", "hundred")
SIDES = (256, 512, 1024, 2048)
SETS = 500
PAUSE = 0.01
"""Seconds between calls that come rarely."""

BATCHED = ("two_spheres", "shadow", "hundred")
GROUNDED = ("eye_plane", "mirrors")
LOOPED = 20
"""Images of a loop over render_image that are measured."""

PAUSES = 10
"""Such calls a sample."""


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
                "call": warm_sample(partial(render_image, scene, side, side)),
                "kernel": warm_sample(partial(write, 0, side)),
            }
            found = take_turns(calls, rounds, seed, lambda _: None)
            call, kernel = (1e3 * np.array(found[key]) for key in ("call", "kernel"))
            rows.append(
                Row(f"{name} {side} x {side}", tuple(spread(v.tolist()) for v in (call, kernel, call - kernel)))
            )
    return rows


def gains(rounds: int, seed: int) -> list[Row]:
    """Milliseconds of an image on one thread and on two, their ratio, that of threads of Python in place of the pool,
    and the ratio that the machine can give."""
    rows = []
    for name in SCENES:
        scene = Scene.builtin(name)
        for side in SIDES:
            images = [render_image(scene, side, side, threads=2) for _ in range(2)]
            write = draw(scene, size=(side, side), clip=True).onto(images[0])

            def python(write: Callable[[int, int], object] = write, side: int = side) -> None:
                over_rows(lambda begin, end: write(begin, end), side, 2, width=side)

            calls: dict[str, Callable[[], float]] = {
                "python": warm_sample(python),
                "one": warm_sample(partial(render_image, scene, side, side, threads=1, out=images[0])),
                "two": warm_sample(partial(render_image, scene, side, side, threads=2, out=images[0])),
                "own": partial(_two_at_once, scene, side, images),
            }
            found = {key: np.array(values) for key, values in take_turns(calls, rounds, seed, lambda _: None).items()}
            gained = (found["one"] / found["two"], found["one"] / found["python"], 2.0 * found["one"] / found["own"])
            numbers = found["one"], found["two"], *gained
            rows.append(Row(f"{name} {side} x {side}", tuple(spread(v.tolist()) for v in numbers)))
    return rows


def pauses(rounds: int, seed: int) -> list[Row]:
    """The same of calls that come rarely, when the other thread sleeps: medians of calls after pauses."""
    rows = []
    for name in SCENES[:2]:
        scene = Scene.builtin(name)
        for side in SIDES:
            image = render_image(scene, side, side, threads=2)

            def after_pauses(threads: int, scene: Scene = scene, side: int = side, image: np.ndarray = image) -> float:
                taken = []
                for _ in range(PAUSES):
                    time.sleep(PAUSE)
                    taken.append(milliseconds(lambda: render_image(scene, side, side, threads=threads, out=image)))
                return float(np.median(taken))

            calls: dict[str, Callable[[], float]] = {"one": partial(after_pauses, 1), "two": partial(after_pauses, 2)}
            found = {key: np.array(values) for key, values in take_turns(calls, rounds, seed, lambda _: None).items()}
            numbers = found["one"], found["two"], found["one"] / found["two"]
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
    """Microseconds an image of render_batch on one thread, of render_image in a loop, and their ratio: Chapter 1's
    sphere under a light that moves, and with highlights whose steep part `double` has the kernel of `stable` draw."""
    angles = np.linspace(0.0, 2.0 * math.pi, SETS, endpoint=False)
    places = np.stack([14.0 * np.sin(angles), np.full(SETS, 5.0), 14.0 + 2.0 * np.cos(angles)], axis=1)
    moved: dict[str, dict[str, Floats]] = {
        "lights": {"lights.0.position": places},
        "exponents from 41 to 200": {"spheres.0.material.shininess": np.linspace(41.0, 200.0, SETS)},
    }
    rows = []
    for (what, parameters), side in product(moved.items(), (16, 64, 256)):
        images = np.empty((SETS, side, side))
        sets = parameter_sets(Scene.chapter1(), parameters)
        scenes = [sets.scene(index) for index in range(SETS)]

        def batch(side: int = side, images: Floats = images, parameters: dict[str, Floats] = parameters) -> float:
            start = time.perf_counter()
            render_batch(None, parameters, side, side, out=images, threads=1)
            return 1e6 * (time.perf_counter() - start) / SETS

        def loop(side: int = side, images: Floats = images, scenes: Sequence[Scene] = scenes) -> float:
            start = time.perf_counter()
            for image, scene in zip(images, scenes, strict=True):
                render_image(scene, side, side, out=image, threads=1)
            return 1e6 * (time.perf_counter() - start) / SETS

        drawn: dict[str, Callable[[], float]] = {"batch": batch, "loop": loop}
        for call in drawn.values():
            call()
        found = {key: np.array(values) for key, values in take_turns(drawn, rounds, seed, lambda _: None).items()}
        numbers = found["batch"], found["loop"], found["loop"] / found["batch"]
        rows.append(Row(f"{SETS} {what}, {side} x {side}", tuple(spread(v.tolist()) for v in numbers)))
    return rows


def scene_batches(rounds: int, seed: int) -> list[Row]:
    """Microseconds an image of render_batch of scenes of many surfaces on one thread, of which to make its sets ready,
    of render_image in a loop, and their ratio; a light or a sphere moves, to places that were never planned before."""
    return [
        _moving(name, path, far, side, count, rounds, seed)
        for name in BATCHED
        for path, far in (("lights.0.position", 0.25), ("spheres.0.center", 0.02))
        for side, count in ((64, 200), (256, 40))
    ]


def ground_batches(rounds: int, seed: int) -> list[Row]:
    """The same of scenes with a plane, with mirrors, and of cameras that move."""
    paths = (("lights.0.position", 0.25), ("spheres.0.center", 0.02), ("camera.eye", 0.1))
    moves = [(name, *path) for name in GROUNDED for path in paths]
    moves += [(name, "camera.eye", 0.1) for name in ("chapter1", "off_axis", *BATCHED)]
    return [_moving(name, path, far, 64, SETS, rounds, seed) for name, path, far in moves]


def _moving(name: str, path: str, far: float, side: int, count: int, rounds: int, seed: int) -> Row:
    """The row of a scene in which a point moves by up to that far along each axis."""
    draws, scene = np.random.default_rng(seed), Scene.builtin(name)
    light = scene.lights[0]
    assert isinstance(light, PointLight), "the first lights of these scenes have a position"
    what, place = {
        "lights.0.position": ("a light", light.position),
        "spheres.0.center": ("a sphere", scene.spheres[0].center),
        "camera.eye": ("the eye", scene.camera.eye),
    }[path]
    images = np.empty((count, side, side) if scene.channels == 1 else (count, side, side, 3))

    def sets() -> Floats:
        return np.array(place) + draws.uniform(-far, far, (count, 3))

    def batch() -> float:
        places, start = sets(), time.perf_counter()
        render_batch(scene, {path: places}, side, side, out=images, threads=1)
        return 1e6 * (time.perf_counter() - start) / count

    def ready() -> float:
        found = parameter_sets(scene, {path: sets()})
        asked = Asked(found, side, side, "double", None, True, 1, False, None)
        waiting, start = Waiting(deque(range(count))), time.perf_counter()
        while waiting.sets:
            make_chunk(asked, waiting, SECONDS_BETWEEN)
        return 1e6 * (time.perf_counter() - start) / count

    def loop() -> float:
        some = parameter_sets(scene, {path: sets()[:LOOPED]})
        start = time.perf_counter()
        for index in range(some.count):
            render_image(some.scene(index), side, side, out=images[index], threads=1)
        return 1e6 * (time.perf_counter() - start) / some.count

    drawn: dict[str, Callable[[], float]] = {"batch": batch, "ready": ready, "loop": loop}
    for call in drawn.values():
        call()
    found = {key: np.array(v) for key, v in take_turns(drawn, rounds, seed, lambda _: None).items()}
    numbers = found["batch"], found["ready"], found["loop"], found["loop"] / found["batch"]
    return Row(f"{name}, {what} moves, {side} x {side}", tuple(spread(v.tolist()) for v in numbers))


def proved_batches(rounds: int, seed: int) -> list[Row]:
    """The same of levels that prove their values: Chapter 1's sphere under a light that moves, and two spheres."""
    draws = np.random.default_rng(seed)
    rows = []
    for name, accuracy, count in (
        ("chapter1", "stable", 100),
        ("chapter1", "certified", 100),
        ("two_spheres", "stable", 10),
    ):
        scene = Scene.builtin(name)
        light = scene.lights[0]
        assert isinstance(light, PointLight), "a scene of the benchmark"
        images = np.empty((count, 64, 64))

        def sets(count: int = count, place: tuple[float, float, float] = light.position) -> Floats:
            return np.array(place) + draws.uniform(-0.25, 0.25, (count, 3))

        def batch(
            scene: Scene = scene, accuracy: str = accuracy, images: Floats = images, sets: Callable[[], Floats] = sets
        ) -> float:
            places, start = sets(), time.perf_counter()
            render_batch(scene, {"lights.0.position": places}, 64, 64, accuracy=accuracy, out=images, threads=1)
            return 1e6 * (time.perf_counter() - start) / len(images)

        def loop(
            scene: Scene = scene, accuracy: str = accuracy, images: Floats = images, sets: Callable[[], Floats] = sets
        ) -> float:
            some = parameter_sets(scene, {"lights.0.position": sets()})
            start = time.perf_counter()
            for index in range(some.count):
                render_image(some.scene(index), 64, 64, accuracy=accuracy, out=images[index], threads=1)
            return 1e6 * (time.perf_counter() - start) / some.count

        drawn: dict[str, Callable[[], float]] = {"batch": batch, "loop": loop}
        for call in drawn.values():
            call()
        found = {key: np.array(values) for key, values in take_turns(drawn, rounds, seed, lambda _: None).items()}
        numbers = found["batch"], found["loop"], found["loop"] / found["batch"]
        rows.append(Row(f"{name}, {accuracy}, 64 x 64", tuple(spread(v.tolist()) for v in numbers)))
    return rows


def main(argv: Sequence[str] | None = None) -> int:
    """Measures and prints."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calls", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="samples of each contestant (15)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the order of turns (1)")
    parser.add_argument("--only", default="", help="the tables whose title has this text (all)")
    options = parser.parse_args(argv)
    console = Console(width=140)
    console.print(this_machine().line(), highlight=False)
    tables = (
        ("a warm call, us", ("call", "kernel alone", "beyond the kernel"), overheads),
        ("a second thread, ms", ("one thread", "two threads", "gain", "of Python's threads", "of two images"), gains),
        ("a second thread that slept, ms", ("one thread", "two threads", "gain"), pauses),
        ("a batch, us an image", ("render_batch", "render_image in a loop", "ratio"), batches),
        (
            "a batch of scenes, us an image",
            ("render_batch", "of that to make ready", "render_image in a loop", "ratio"),
            scene_batches,
        ),
        (
            "a batch of planes, mirrors and cameras, us an image",
            ("render_batch", "of that to make ready", "render_image in a loop", "ratio"),
            ground_batches,
        ),
        ("a batch proved, us an image", ("render_batch", "render_image in a loop", "ratio"), proved_batches),
    )
    for title, heads, measured in tables:
        if options.only not in title:
            continue
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
