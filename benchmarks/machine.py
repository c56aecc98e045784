"""The line that belongs to every figure: processor, cores, compiler, versions. Never here: a path, a host, a date."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from symrender_cg.build import find_toolchain
from symrender_cg.errors import ToolchainError


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
