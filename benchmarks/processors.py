"""The builds of a portable library side by side with the machine's own: `python -m benchmarks.processors [--size N]`.

Comes in: a size. Goes out: a table of ns a pixel, medians of interleaved rounds, with ratios to gcc's build for this
machine; compile time and bytes of the libraries. Every picture is compared with the first, bit for bit.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from symrender_cg import render_image
from symrender_cg.build.library import read_kernel
from symrender_cg.build.portable import PROCESSOR_VARIABLE, every_build
from symrender_cg.build.toolchain import which
from symrender_cg.cli.console import Column, Table

KERNELS = (("chapter1", "literal"), ("chapter1", "single"), ("chapter1", "double"), ("chapter1", "stable"))
SCENES = (("shadow", "double"),)
ROUNDS = 15


@dataclass(frozen=True, slots=True)
class Contestant:
    """A way to compile: a name, the compiler, whether it is portable, and the build that is asked for, if any."""

    name: str
    compiler: str
    portable: bool
    processor: str


def contestants() -> tuple[Contestant, ...]:
    """gcc and clang for this machine, and gcc's portable library: as it chooses, and each of its builds that runs."""
    own = [Contestant(f"{name}, native", name, False, "") for name in ("gcc", "clang") if which(name)]
    forced = [Contestant(f"gcc, {build.name}", "gcc", True, build.name) for build in every_build()]
    return (*own, Contestant("gcc, portable", "gcc", True, ""), *forced)


def compare(scene: str, accuracy: str, size: int, place: Path) -> dict[str, float]:
    """Median ns a pixel of each contestant that can run; the pictures are compared."""
    draws: dict[str, partial[Any]] = {}
    first: bytes | None = None
    for one in contestants():
        cache = place / f"{one.compiler}-{one.portable}-{one.processor}"
        source = place / f"{one.compiler}-{one.portable}-"
        if one.processor and source.is_dir():
            shutil.copytree(source, cache, dirs_exist_ok=True)
        os.environ["CC"] = one.compiler
        os.environ.pop(PROCESSOR_VARIABLE, None)
        if one.processor:
            os.environ[PROCESSOR_VARIABLE] = one.processor
        draw = partial(
            render_image, scene, size, size, accuracy=accuracy, portable=one.portable, cache=cache, threads=1
        )
        try:
            picture = draw().tobytes()
        except Exception as problem:  # this processor does not run the build
            if PROCESSOR_VARIABLE not in str(problem):
                raise
            continue
        first = first or picture
        assert picture == first, f"{scene} at {accuracy}: {one.name} draws another picture"
        draws[one.name] = draw
    os.environ.pop(PROCESSOR_VARIABLE, None)
    times: dict[str, list[float]] = {name: [] for name in draws}
    for _ in range(ROUNDS):
        for name, draw in draws.items():
            start = time.perf_counter()
            draw()
            times[name].append(time.perf_counter() - start)
    return {name: statistics.median(taken) / size**2 * 1e9 for name, taken in times.items()}


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.processors", description=__doc__)
    parser.add_argument("--size", type=int, default=512, help="side of the picture in pixels (default: 512)")
    size = parser.parse_args().size
    names = [one.name for one in contestants()]
    table = Table((Column("kernel"), *(Column(name, right=True) for name in names)))
    built: dict[str, list[tuple[float, int]]] = {}
    with tempfile.TemporaryDirectory(prefix="symrender_cg-") as folder:
        for scene, accuracy in (*KERNELS, *SCENES):
            place = Path(folder, f"{scene}-{accuracy}")
            found = compare(scene, accuracy, size, place)
            unit = found[names[0]]
            cells = (f"{found[name]:.2f} ({found[name] / unit:.2f})" if name in found else "-" for name in names)
            table.add(f"{scene} {accuracy}", *cells)
            for label, kept in (("native", "gcc-False-"), ("portable", "gcc-True-")):
                for kernel in (place / kept / "kernels").iterdir():
                    made = read_kernel(kernel)
                    assert made is not None, "a kernel that was just called is whole"
                    built.setdefault(label, []).append((made.manifest.seconds, made.library_path.stat().st_size))
    print(f"ns a pixel, {size} x {size}, one thread, medians of {ROUNDS} interleaved rounds (ratio to {names[0]})")
    table.show()
    for label, costs in built.items():
        print(f"{label}: {sum(s for s, _ in costs):.1f} s to compile, {sum(b for _, b in costs) / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
