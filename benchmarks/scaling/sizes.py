"""`python -m benchmarks scaling sizes`: Chapter 1's scene from 64 x 64 to 8192 x 8192 pixels.

Comes in: sides, rounds. Goes out: SizesReport and its table: microseconds of small images, nanoseconds a pixel of all,
and the exponent p of time ~ pixels^p from 256 x 256 up, which is 1 where the cost is linear. One array a format serves
every size (512 MB in float64 at 8192 x 8192). Beside them stands numpy's fill of the same pixels: what storing costs.
Never done here: a peer.
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

from benchmarks.machine import Machine, Spread, cores, spread, take_turns, this_machine, warm_sample
from benchmarks.scaling.growth import exponent
from symrender_cg import Scene, render_image

LEVELS: Final = (("double", "float64"), ("single", "float32"))
LINEAR_FROM: Final = 256


@dataclass(frozen=True, slots=True)
class Series:
    """One contestant: ns a pixel by size, and the exponent of its time from LINEAR_FROM up, NaN for fewer than two."""

    name: str
    ns_a_pixel: tuple[Spread, ...]
    exponent: float

    def microseconds(self, sizes: Sequence[int]) -> list[float]:
        """Median time of an image, by size."""
        return [1e-3 * value.median * size**2 for size, value in zip(sizes, self.ns_a_pixel, strict=True)]


@dataclass(frozen=True, slots=True)
class SizesReport:
    """What `scaling sizes` measured."""

    machine: Machine
    rounds: int
    sizes: tuple[int, ...]
    series: tuple[Series, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """A line a size, a column a contestant; the last line has the exponents."""
        console.print(self.machine.line(), highlight=False)
        table = Table(title=f"ns a pixel against size, {self.rounds} rounds; 't' are threads")
        table.add_column("size", justify="right")
        for entry in self.series:
            table.add_column(entry.name, justify="right")
        for k, size in enumerate(self.sizes):
            cells = []
            for entry in self.series:
                cell = f"{entry.ns_a_pixel[k].median:.2f}"
                if size < LINEAR_FROM:
                    cell += f" ({entry.microseconds(self.sizes)[k]:.0f} us)"
                cells.append(cell)
            table.add_row(f"{size}²", *cells)
        table.add_row("exponent", *(f"{entry.exponent:.3f}" for entry in self.series))
        console.print(table)
        console.print(f"exponent: p of time ~ pixels^p from {LINEAR_FROM}² up; in parentheses: microseconds an image.")


def measure_sizes(sizes: Sequence[int], rounds: int, seed: int, told: Callable[[str], None]) -> SizesReport:
    """Sizes one after another, contestants in turns; told(text) says what is going on."""
    scene = Scene.chapter1()
    memory = {form: np.empty(max(sizes) ** 2, form) for _, form in LEVELS}
    found: dict[str, list[Spread]] = {}
    for size in sizes:
        told(f"{size} x {size}")
        calls = _calls(scene, size, memory)
        samples = take_turns(calls, rounds, seed, partial(_say, told, size, rounds))
        for name, taken in samples.items():
            found.setdefault(name, []).append(spread([1e6 * value / size**2 for value in taken]))
    series = tuple(Series(name, tuple(values), _exponent(sizes, values)) for name, values in found.items())
    return SizesReport(this_machine(), rounds, tuple(sizes), series)


def _say(told: Callable[[str], None], size: int, rounds: int, number: int) -> None:
    told(f"{size} x {size}: round {number + 1} of {rounds}")


def _calls(scene: Scene, size: int, memory: dict[str, NDArray[Any]]) -> dict[str, Callable[[], float]]:
    """Milliseconds of an image by each level and number of threads, and of a fill."""
    calls: dict[str, Callable[[], float]] = {}
    for accuracy, form in LEVELS:
        out = memory[form][: size * size].reshape(size, size)
        calls[f"fill {form}"] = warm_sample(partial(out.fill, 0.5))
        for threads in sorted({1, cores()}):
            draw = partial(render_image, scene, size, size, accuracy=accuracy, threads=threads, clip=False, out=out)
            calls[f"{accuracy} {threads}t"] = warm_sample(draw)
    return calls


def _exponent(sizes: Sequence[int], values: Sequence[Spread]) -> float:
    large = [
        (size**2, size**2 * value.median) for size, value in zip(sizes, values, strict=True) if size >= LINEAR_FROM
    ]
    return exponent(*zip(*large, strict=True)) if len(large) > 1 else float("nan")
