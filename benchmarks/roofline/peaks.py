"""What the machine can do: operations a nanosecond of one core, kind by kind, and stores by the size of the array.

Comes in: a Toolchain. Goes out: Peaks. The loops are C compiled with the flags of the kernels, so that they get the
vectors that kernels get; each applies a chain of one kind of operation to 2,048 numbers in the first-level cache, 16
vectors side by side, so that none waits for itself. Never done here: a kernel.
"""

from __future__ import annotations

import ctypes
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import take_turns
from symrender_cg.build import Toolchain, compile_library

COUNT: Final = 2048
ABREAST: Final = 16
"""Chains that run side by side: more than the latency of any pipelined operation times how many start in a cycle."""
CHAIN: Final = 8
REPEATS: Final = {"div": 50, "sqrt": 50, "div sqrt": 25}
MOST_REPEATS: Final = 500
CALLS: Final = 5
"""Calls of a sample, some 300 us each; the fastest counts."""

CHAINS: Final = {
    "mul": ("V = V * c;",) * CHAIN,
    "add": ("V = V + c;",) * CHAIN,
    "mul add": ("V = V * c;", "V = V + d;") * CHAIN,
    "fma": ("V = FMA(V, c, d);",) * CHAIN,
    "select": ("V = V > c ? V : c;", "V = V > d ? V : d;") * (CHAIN // 2),
    "div": ("V = c / V;",) * CHAIN,
    "sqrt": ("V = SQRT(V);",) * CHAIN,
    "div sqrt": ("V = c / V;", "V = SQRT(V);") * CHAIN,
}
"""One of each kind a step; a kind of two words is a step of each."""

FORMATS: Final = {"float64": ("double", ""), "float32": ("float", "f")}

_LOOP = """
static __attribute__((noinline)) void once_{name}({real} *restrict to, const {real} *restrict from, {real} c, {real} d)
{{
    (void)c, (void)d;
    for (int i = 0; i < {stride}; ++i) {{
        {steps}
    }}
}}

void {name}({real} *one, {real} *other, int repeats, {real} c, {real} d)
{{
    for (int repeat = 0; repeat < repeats; ++repeat) {{
        once_{name}(one, other, c, d);
        once_{name}(other, one, c, d);
    }}
}}
"""

_FILL = """
void fill_{format}({real} *restrict out, ptrdiff_t count, {real} value)
{{
    for (ptrdiff_t i = 0; i < count; ++i)
        out[i] = value;
}}
"""


@dataclass(frozen=True, slots=True)
class Peaks:
    """Nanoseconds of one step, (format, kind) by CHAINS, on one core; nanoseconds a byte stored, (format, size)."""

    step_ns: Mapping[tuple[str, str], float]
    store_ns: Mapping[tuple[str, int], float]

    def gflops(self, form: str, kind: str) -> float:
        """10^9 operations a second; an fma is two."""
        return (2.0 if kind == "fma" else 1.0) / self.step_ns[form, kind]

    def pipes_ns(self, operations: Mapping[tuple[str, str], float]) -> float:
        """The least time of mul, add, select and fma, if nothing waits and no instruction but them is needed.

        mul and add count together where the machine was seen to do them one after the other, else the longer one
        counts; all of them together start at most as fast as mul and add in turn. Integer operations are left out: the
        bound stays a lower one.
        """
        return sum(self._pipes(operations, form) for form in FORMATS)

    def divider_ns(self, operations: Mapping[tuple[str, str], float]) -> float:
        """The least time of div and sqrt: of both together where one unit does both, else of the longer one."""
        return sum(self._root(operations, form) for form in FORMATS)

    def _pipes(self, operations: Mapping[tuple[str, str], float], form: str) -> float:
        step = self.step_ns
        amounts = {kind: operations.get((form, kind), 0.0) for kind in ("mul", "add", "select", "fma")}
        mul, add = amounts["mul"] * step[form, "mul"], amounts["add"] * step[form, "add"]
        every = sum(amounts.values()) * step[form, "mul add"] / 2.0
        select = amounts["select"] * step[form, "select"]
        return max(self._together(form, mul, add, "mul", "add"), every, select)

    def _root(self, operations: Mapping[tuple[str, str], float], form: str) -> float:
        div = operations.get((form, "div"), 0.0) * self.step_ns[form, "div"]
        sqrt = operations.get((form, "sqrt"), 0.0) * self.step_ns[form, "sqrt"]
        return self._together(form, div, sqrt, "div", "sqrt")

    def _together(self, form: str, first: float, second: float, one: str, other: str) -> float:
        both = self.step_ns[form, f"{one} {other}"]
        in_turn = self.step_ns[form, one] + self.step_ns[form, other]
        return first + second if both > 0.75 * in_turn else max(first, second)


def source() -> str:
    """The C text of all loops."""
    parts = ["#include <math.h>\n#include <stddef.h>\n"]
    for form, (real, suffix) in FORMATS.items():
        for kind, steps in CHAINS.items():
            stride = COUNT // ABREAST
            lines = [f"{real} v{k} = from[i + {k * stride}];" for k in range(ABREAST)]
            lines += [step.replace("V", f"v{k}") for step in steps for k in range(ABREAST)]
            lines += [f"to[i + {k * stride}] = v{k};" for k in range(ABREAST)]
            text = "\n        ".join(lines).replace("FMA", f"fma{suffix}").replace("SQRT", f"sqrt{suffix}")
            name = f"{kind.replace(' ', '_')}_{form}"
            parts.append(_LOOP.format(name=name, real=real, stride=stride, steps=text))
        parts.append(_FILL.format(format=form, real=real))
    return "\n".join(parts)


def measure_peaks(
    toolchain: Toolchain, sizes: tuple[int, ...], rounds: int, seed: int, told: Callable[[str], None]
) -> Peaks:
    """Every loop in turn in each round; a peak is the best of the rounds. sizes: numbers of pixels that are filled."""
    told("peaks: compile")
    with tempfile.TemporaryDirectory(prefix="symrender_peaks_") as folder:
        place = Path(folder, "peaks.so")
        compile_library({"peaks.c": source()}, place, toolchain=toolchain)
        library = ctypes.CDLL(str(place))
    memory = {form: np.zeros(max(*sizes, COUNT), form) for form in FORMATS}
    steps: dict[str, Callable[[], float]] = {}
    for form in FORMATS:
        for kind in CHAINS:
            steps[f"{form}|{kind}"] = partial(_chain, library, form, kind)
        for size in sizes:
            steps[f"{form}|{size}"] = _fill(library, form, memory[form][:size])
    samples = take_turns(steps, rounds, seed, lambda number: told(f"peaks: round {number + 1} of {rounds}"))
    best = {name: min(values) for name, values in samples.items()}
    return Peaks(
        {(form, kind): best[f"{form}|{kind}"] for form in FORMATS for kind in CHAINS},
        {(form, size): best[f"{form}|{size}"] for form in FORMATS for size in sizes},
    )


def _chain(library: Any, form: str, kind: str) -> float:
    """Nanoseconds of a step of a chain."""
    real = ctypes.c_double if form == "float64" else ctypes.c_float
    function = getattr(library, f"{kind.replace(' ', '_')}_{form}")
    function.restype = None
    function.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, real, real]
    given, out = np.linspace(1.0, 2.0, COUNT, dtype=form), np.empty(COUNT, form)
    repeats = REPEATS.get(kind, MOST_REPEATS)
    seconds = min(
        _seconds(lambda: function(out.ctypes.data, given.ctypes.data, repeats, 1.0 + 2.0**-20, 2.0**-20))
        for _ in range(CALLS)
    )
    steps = len(CHAINS[kind]) // len(kind.split())
    return seconds * 1e9 / (2 * repeats * COUNT * steps)


def _fill(library: Any, form: str, out: NDArray[Any]) -> Callable[[], float]:
    """A call that gives the nanoseconds of a byte stored into this array, warm."""
    real = ctypes.c_double if form == "float64" else ctypes.c_float
    function = getattr(library, f"fill_{form}")
    function.restype = None
    function.argtypes = [ctypes.c_void_p, ctypes.c_ssize_t, real]
    calls = max(1, min(1000, (1 << 25) // out.nbytes))

    def sample() -> float:
        function(out.ctypes.data, out.size, 0.5)
        seconds = min(_seconds(lambda: function(out.ctypes.data, out.size, 0.25)) for _ in range(calls))
        return seconds * 1e9 / out.nbytes

    return sample


def _seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start
