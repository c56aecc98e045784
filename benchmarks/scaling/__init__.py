"""`python -m benchmarks scaling`: what an image costs as its scene or its size grows, and what a kernel costs to build.

    spheres   milliseconds against the number of spheres, beside POV-Ray and Mitsuba
    lights    milliseconds against the number of lights, beside POV-Ray
    sizes     nanoseconds a pixel from 64 x 64 to 8192 x 8192, beside a fill of the same array
    compile   seconds to derive and to compile each kernel, by each compiler at hand

`measure_all` runs those that are asked for, one after another. Cold and warm starts are `python -m benchmarks start`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from rich.console import Console

from benchmarks.scaling.compiling import CompileReport, measure_compiling
from benchmarks.scaling.lights import LightsReport, measure_lights
from benchmarks.scaling.sizes import SizesReport, measure_sizes
from benchmarks.scaling.spheres import SpheresReport, measure_spheres

KINDS: Final = ("spheres", "lights", "sizes", "compile")


@dataclass(frozen=True, slots=True)
class Plan:
    """What is measured and how much of it; `quick` is a few seconds for each."""

    kinds: tuple[str, ...] = KINDS
    counts: tuple[int, ...] = (1, 10, 100, 1_000, 10_000)
    lights: tuple[int, ...] = (1, 2, 4, 8, 16, 32)
    sizes: tuple[int, ...] = (64, 128, 256, 512, 1024, 2048, 4096, 8192)
    size: int = 512
    rounds: int = 9
    seed: int = 1

    @staticmethod
    def quick(kinds: tuple[str, ...], size: int, seed: int) -> Plan:
        """Up to 100 spheres, 8 lights, 2048 x 2048, in three rounds."""
        return Plan(kinds, (1, 10, 100), (1, 2, 4, 8), (64, 128, 256, 512, 1024, 2048), size, 3, seed)


@dataclass(frozen=True, slots=True)
class Report:
    """What `scaling` measured, by kind."""

    parts: tuple[tuple[str, SpheresReport | LightsReport | SizesReport | CompileReport], ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return {kind: part.to_dict() for kind, part in self.parts}

    def show(self, console: Console) -> None:
        """The tables of each kind."""
        for _, part in self.parts:
            part.show(console)


def measure_all(plan: Plan, told: Callable[[str], None]) -> Report:
    """Each kind in its turn; told(text) says what is going on."""
    runs: dict[str, Callable[[], SpheresReport | LightsReport | SizesReport | CompileReport]] = {
        "spheres": lambda: measure_spheres(plan.counts, plan.size, plan.rounds, plan.seed, told),
        "lights": lambda: measure_lights(plan.lights, plan.size, plan.rounds, plan.seed, told),
        "sizes": lambda: measure_sizes(plan.sizes, plan.rounds, plan.seed, told),
        "compile": lambda: measure_compiling(plan.rounds, told),
    }
    return Report(tuple((kind, runs[kind]()) for kind in KINDS if kind in plan.kinds))
