"""What each pass of a kernel of one sphere gains: `python -m benchmarks.passes [--size N] [--rounds N]`.

Comes in: Chapter 1's scene. Goes out: for each level the time of a pixel with no pass, with one, and with all but one,
on one thread, and the ratio to none. All kernels of a level take turns in one run, so that ratios hold on a machine
with other work; the least time of many rounds is shown. Never done here: a judgement.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.lower.switches import ALL, NAMES, Passes
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import draw, pixel_size
from symrender_cg.run.certificate import Job
from symrender_cg.run.certify import first_stage
from symrender_cg.scene import Scene

PROVED = ("stable", "certified_float64", "certified_float32", "certified_uint8")
CASES = (
    *((level, bake, 32.0 if bake else 37.5) for level in ("double", "single", "fast") for bake in (False, True)),
    *((level, False, 32.0) for level in PROVED),
)
"""Level, whether numbers are baked, exponent. Kernels that bound their own error take an even whole one by squaring."""


def passes_of() -> dict[str, Passes]:
    """No pass, each by itself, all but each, all. Halves gain nothing without fission, and are left to `all but`."""
    none = ALL.without(*NAMES)
    alone = {f"{name} alone": replace(none, **{name: True}) for name in ("symmetry", "fission")}
    without = {f"all but {name}": ALL.without(name) for name in NAMES}
    return {"none": none, **alone, **without, "all": ALL}


def writers(
    level: str, bake: bool, shininess: float, target: NDArray[Any]
) -> dict[str, Callable[[], Callable[[int, int], object]]]:
    """For each combination of passes, what makes the function that writes rows of the target."""
    scene, given, size = Scene.chapter1(shininess=shininess), variant(level), len(target)
    found: dict[str, Callable[[], Callable[[int, int], object]]] = {}
    for name, passes in passes_of().items():
        chosen = replace(given, passes=passes)
        if given.settles is None:
            found[name] = partial(draw(scene, chosen, size=(size, size), clip=True, bake=bake).onto, target)
            continue
        first = first_stage(Job(scene, chosen, clip=True), aspect=1.0)
        assert first is not None, "one sphere under one light has a kernel"
        pixel, rows = pixel_size(first.frame, size), first.kernel.shared_rows
        found[name] = partial(rows, target, first.numbers, pixel=pixel, white=1.0, first=0, height=size)
    return found


def measure(level: str, bake: bool, shininess: float, size: int, rounds: int) -> list[tuple[str, float, float]]:
    """(passes, nanoseconds a pixel, largest difference from the image of no pass) of each combination."""
    target = np.empty((size, size), variant(level).result)
    drawings = writers(level, bake, shininess, target)
    images = {}
    for name, drawing in drawings.items():
        drawing()(0, size)
        images[name] = target.copy()
    least = dict.fromkeys(drawings, np.inf)
    for _ in range(rounds):
        for name, drawing in drawings.items():
            write = drawing()
            start = time.perf_counter()
            write(0, size)
            least[name] = min(least[name], time.perf_counter() - start)
    first = images["none"].astype(np.float64)
    return [(name, 1e9 * least[name] / size**2, float(np.max(np.abs(images[name] - first)))) for name in drawings]


def main() -> int:
    """Print the table of every level."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.passes", description=__doc__)
    parser.add_argument("--size", type=int, default=1024, help="pixels a side (default: 1024)")
    parser.add_argument("--rounds", type=int, default=40, help="rounds of each kernel (default: 40)")
    options = parser.parse_args()
    for level, bake, shininess in CASES:
        rows = measure(level, bake, shininess, options.size, options.rounds)
        told = f"numbers baked, n = {shininess:g}" if bake else f"n = {shininess:g} an argument"
        print(f"{level}, {told}: {options.size} x {options.size}")
        for name, nanoseconds, difference in rows:
            print(f"  {name:20s} {nanoseconds:6.3f} ns  {nanoseconds / rows[0][1]:5.2f}  differs by {difference:.1e}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
