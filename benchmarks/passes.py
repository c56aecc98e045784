"""What each pass of a kernel of one sphere gains: `python -m benchmarks.passes [--size N] [--rounds N]`.

Comes in: Chapter 1's scene. Goes out: for each level the time of a pixel with no pass, with one, and with all but one,
on one thread, and the ratio to none. All kernels of a level take turns in one run, so that ratios hold on a machine
with other work; the least time of many rounds is shown. Never done here: a judgement.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from symrender_cg.lower.switches import ALL, NAMES, Passes
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import draw
from symrender_cg.scene import Scene

LEVELS = (("double", False), ("double", True), ("single", False), ("single", True), ("fast", False), ("fast", True))
SHININESS = {False: 37.5, True: 32.0}


def passes_of() -> dict[str, Passes]:
    """No pass, each by itself, all but each, all. Halves gain nothing without fission, and are left to `all but`."""
    none = ALL.without(*NAMES)
    alone = {f"{name} alone": replace(none, **{name: True}) for name in ("symmetry", "fission")}
    without = {f"all but {name}": ALL.without(name) for name in NAMES}
    return {"none": none, **alone, **without, "all": ALL}


def measure(level: str, bake: bool, size: int, rounds: int) -> list[tuple[str, float, float]]:
    """(passes, nanoseconds a pixel, largest difference from the image of no pass) of each combination."""
    scene = Scene.chapter1(shininess=SHININESS[bake])
    given = variant(level)
    target = np.empty((size, size), given.result)
    drawings = {
        name: draw(scene, replace(given, passes=passes), size=(size, size), clip=True, bake=bake)
        for name, passes in passes_of().items()
    }
    images = {}
    for name, drawing in drawings.items():
        drawing.rows(target, 0, size)
        images[name] = target.copy()
    least = dict.fromkeys(drawings, np.inf)
    for _ in range(rounds):
        for name, drawing in drawings.items():
            write = drawing.onto(target)
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
    for level, bake in LEVELS:
        rows = measure(level, bake, options.size, options.rounds)
        print(
            f"{level}{', numbers baked, n = 32' if bake else ', n = 37.5 an argument'}: {options.size} x {options.size}"
        )
        for name, nanoseconds, difference in rows:
            print(f"  {name:20s} {nanoseconds:6.3f} ns  {nanoseconds / rows[0][1]:5.2f}  differs by {difference:.1e}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
