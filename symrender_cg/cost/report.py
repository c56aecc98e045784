"""What the cost of accuracy was measured to be, as data that is written to JSON and read back.

Comes in: nothing. Goes out: frozen structures. Never done here: a measurement, a picture.
"""

from __future__ import annotations

import math
import os
import platform
from typing import Final

import msgspec
import numpy as np

from symrender_cg.build.cache import Cache
from symrender_cg.build.toolchain import cpu_identity
from symrender_cg.errors import ToolchainError
from symrender_cg.version import VERSION

FORMAT: Final = 2
"""Counts the changes of what is stored, so that what an older version kept is not read."""


class Machine(msgspec.Struct, frozen=True):
    """What the figures were measured on; `load` is how many processes wanted to run when the measurement ended."""

    cpu: str
    cores: int
    compiler: str
    target: str
    python: str
    numpy: str
    version: str
    load: float = 0.0

    def line(self) -> str:
        """The machine in one line."""
        return (
            f"{self.cpu}, {self.cores} cores, load {self.load:.1f}; {self.compiler} for {self.target}; "
            f"Python {self.python}, numpy {self.numpy}; symrender_cg {self.version}"
        )


class Spread(msgspec.Struct, frozen=True):
    """Median and quartiles of the rounds."""

    median: float
    low: float
    high: float

    @staticmethod
    def of(samples: list[float]) -> Spread:
        """Interpolated quantiles."""
        low, median, high = (float(value) for value in np.quantile(np.asarray(samples), (0.25, 0.5, 0.75)))
        return Spread(median, low, high)


class Errors(msgspec.Struct, frozen=True):
    """How far the values of a way are from the truth, over points that did not flip.

    largest, p999          of |value - truth|: the largest at any point, the 99.9th percentile of those in the window
    ulp, ulp_p999          the same in units of the last place of the way's own format; of grey levels in levels
    right8                 share of the points in the window whose grey level of 256 is the right one
    flips                  points where background is taken for a surface, or a surface for background, or where the
                           other side of an edge is shown: of a shadow, a tile, a mirrored surface
    nonfinite              NaN or infinity where the truth is none
    points, hard           how many points there were anywhere in the window, how many hard ones; all count for errors
    histogram              points by error in ulp: exactly 0, up to 2^-3, up to 2^-2, ... up to 2^60
    """

    largest: float
    p999: float
    ulp: float
    ulp_p999: float
    right8: float
    flips: int
    nonfinite: int
    points: int
    hard: int
    histogram: tuple[int, ...] = ()

    @property
    def sound(self) -> bool:
        """Whether nothing flipped and everything is finite."""
        return self.flips == 0 and self.nonfinite == 0


class Entry(msgspec.Struct, frozen=True):
    """One way as it was measured; names and words as in symrender_cg.cost.variants.Way.

    ratio        its time over that of `double`, the median and quartiles of the ratios within a round
    ns           the same in nanoseconds a pixel of one image on one thread: times the median of `double`
    bound        how far a value can be from the truth, proved; None where nothing is
    lines, operations, derive, compile   of its C, see symrender_cg.cost.ready
    dominated_by    the way that is no slower, no less accurate and flips no more, empty on the front
    """

    name: str
    kind: str
    does: str
    level: str
    choices: tuple[str, ...]
    target: str | None
    bake: bool
    ns: Spread
    ratio: Spread
    errors: Errors
    bound: float | None
    lines: int
    operations: int
    derive: float
    compile: float
    dominated_by: str = ""

    @property
    def on_front(self) -> bool:
        """Whether nothing dominates it."""
        return not self.dominated_by


class Step(msgspec.Struct, frozen=True):
    """From one way of the front to the next slower one: what it costs, what it buys."""

    before: str
    after: str
    time: float
    error_before: float
    error_after: float
    flips_before: int
    flips_after: int

    def __str__(self) -> str:
        bought = f"error {self.error_before:.1e} -> {self.error_after:.1e}"
        if self.flips_before != self.flips_after:
            bought += f", flips {self.flips_before} -> {self.flips_after}"
        return f"from `{self.before}` to `{self.after}`: {self.time:.2f} times the time, {bought}"


class BreakEven(msgspec.Struct, frozen=True):
    """A specialisation against the kernel that does without it.

    build     seconds that its own kernel takes to be derived and compiled
    saved     nanoseconds a pixel; negative where it is slower
    pixels    after which it pays, inf (null in JSON) where it never does
    images    the same in images of the report's size
    """

    what: str
    special: str
    general: str
    build: float
    saved: float
    pixels: float | None
    images: float | None


class Effect(msgspec.Struct, frozen=True):
    """The scene with one effect more: time a pixel, and what that effect alone added."""

    effect: str
    did: str
    ns: Spread
    added: float


class Report(msgspec.Struct, frozen=True):
    """Everything that one run of `cost` found."""

    scene: str
    toml: str
    width: int
    height: int
    rounds: int
    seed: int
    quick: bool
    machine: Machine
    entries: tuple[Entry, ...]
    steps: tuple[Step, ...] = ()
    break_even: tuple[BreakEven, ...] = ()
    effects: tuple[Effect, ...] = ()
    tried: int = 0
    budget: int = 0
    seconds: float = 0.0

    @property
    def front(self) -> tuple[Entry, ...]:
        """What nothing dominates and takes any scene's numbers, the fastest first."""
        return self._front(bake=False)

    @property
    def baked_front(self) -> tuple[Entry, ...]:
        """What nothing dominates and has this scene's numbers baked in, the fastest first."""
        return self._front(bake=True)

    def _front(self, *, bake: bool) -> tuple[Entry, ...]:
        chosen = (entry for entry in self.entries if entry.on_front and entry.bake == bake)
        return tuple(sorted(chosen, key=lambda entry: entry.ns.median))

    def entry(self, name: str) -> Entry:
        """The entry of that name. KeyError if there is none."""
        for found in self.entries:
            if found.name == name:
                return found
        raise KeyError(name)


def this_machine(*, with_load: bool = True) -> Machine:
    """The machine that this process runs on."""
    try:
        toolchain = Cache().toolchain()
        compiler, target = toolchain.version, f"{toolchain.native.cpu}, {8 * toolchain.native.vector_bytes}-bit vectors"
    except ToolchainError:
        compiler, target = "no C compiler", "nothing"
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    load = os.getloadavg()[0] if with_load and hasattr(os, "getloadavg") else 0.0
    return Machine(_cpu(), cores, compiler, target, platform.python_version(), np.__version__, VERSION, load)


def _cpu() -> str:
    """The processor's own name for itself, from the system."""
    for fact in msgspec.json.decode(cpu_identity(), type=list[str]):
        name, _, value = fact.partition(":")
        if name.strip() == "model name":
            return value.strip()
    return platform.processor() or platform.machine()


def finite(value: float) -> float | None:
    """What JSON can hold: None for infinity and NaN."""
    return value if math.isfinite(value) else None
