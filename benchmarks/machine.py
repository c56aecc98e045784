"""What belongs to every figure: the machine's line, samples, medians, turns. Never here: a path, a host, a date."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import sympy as sp

from symrender_cg.build import find_toolchain
from symrender_cg.errors import ToolchainError

SHORTEST_SAMPLE: Final = 0.01
"""Seconds that a sample takes at least: what is faster is called several times, and the fastest call counts."""


@dataclass(frozen=True, slots=True)
class Machine:
    """What the figures were measured on."""

    cpu: str
    cores: int
    compiler: str
    target: str
    python: str
    numpy: str
    sympy: str
    load: float
    """processes that wanted to run in the last minute of the benchmark: above `cores`, distrust the times"""

    def line(self) -> str:
        """The machine in one line."""
        versions = f"Python {self.python}, numpy {self.numpy}, sympy {self.sympy}"
        return f"{self.cpu}, {self.cores} cores; {self.compiler} for {self.target}; {versions}; load {self.load:.1f}"


def this_machine() -> Machine:
    """The machine that this process runs on."""
    try:
        toolchain = find_toolchain()
        compiler, target = toolchain.version, f"{toolchain.native.cpu}, {8 * toolchain.native.vector_bytes}-bit vectors"
    except ToolchainError:
        compiler, target = "no C compiler", "nothing"
    return Machine(
        cpu=cpu_model(),
        cores=cores(),
        compiler=compiler,
        target=target,
        python=platform.python_version(),
        numpy=np.__version__,
        sympy=sp.__version__,
        load=os.getloadavg()[0],
    )


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def cpu_model() -> str:
    """The processor's own name for itself, from the system."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
            names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()


@dataclass(frozen=True, slots=True)
class Spread:
    """Median and quartiles of some samples."""

    median: float
    low: float
    high: float

    def shown(self, pattern: str = "{:.2f}") -> str:
        """`median (low .. high)`."""
        return f"{pattern.format(self.median)} ({pattern.format(self.low)} .. {pattern.format(self.high)})"


def spread(samples: Sequence[float]) -> Spread:
    """Median and quartiles, interpolated."""
    low, median, high = (float(value) for value in np.quantile(np.asarray(samples), (0.25, 0.5, 0.75)))
    return Spread(median, low, high)


def milliseconds(call: Callable[[], object]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    call()
    return 1e3 * (time.perf_counter() - start)


def warm_sample(draw: Callable[[], object], shortest: float = SHORTEST_SAMPLE) -> Callable[[], float]:
    """A call that draws for that many seconds and returns the milliseconds of the fastest image.

    The fastest is one that no other process interrupted. Before the samples, and before the timed images of each, one
    is drawn that is not timed: what ran before has taken the caches, and the allocator's pages.
    """
    draw()
    calls = max(1, round(shortest / max(1e-3 * milliseconds(draw), 1e-6)))

    def sample() -> float:
        draw()
        return min(milliseconds(draw) for _ in range(calls))

    return sample


def take_turns(
    calls: dict[str, Callable[[], float]], rounds: int, seed: int, told: Callable[[int], None]
) -> dict[str, list[float]]:
    """What each call returned in each round, the calls in another seeded order every round; told(round) before each."""
    order = np.random.default_rng(seed)
    names = list(calls)
    samples: dict[str, list[float]] = {name: [] for name in names}
    for number in range(rounds):
        told(number)
        for index in order.permutation(len(names)):
            samples[names[index]].append(calls[names[index]]())
    return samples
