"""`KernelProgram`: the steps of a kernel, each with the rate at which it changes, its number format and its formula."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import sympy as sp

from symrender_cg.derive.symbols import symbol
from symrender_cg.lower.nodes import Node, count

Rate = Literal["frame", "sphere", "row", "pixel"]
Format = Literal["int", "float32", "float64", "double_double", "pair", "range", "ball"]
Anchor = Literal["first", "middle", "last"]
RATES: tuple[Rate, ...] = ("frame", "sphere", "row", "pixel")
"""From the slowest to the fastest. Kernels of one sphere have no step at the rate of the sphere: it is the frame's."""


@dataclass(frozen=True, slots=True)
class Step:
    """name = value, once a frame, a sphere, a row or a pixel; a sympy expression, and after freezing a `Node`."""

    name: str
    value: sp.Basic
    section: str
    meaning: str = ""
    source: str = ""
    rate: Rate = "frame"
    format: Format = "float64"

    @property
    def symbol(self) -> sp.Symbol:
        """The symbol that later steps use for this one."""
        return symbol(self.name)

    def uses(self) -> set[str]:
        """Names that the value refers to."""
        return {s.name for s in self.value.free_symbols}


@dataclass(frozen=True, slots=True)
class Shortcut:
    """function(source[], room[], result[], when, count) in place of the stages `stages`, where `when` is not 0.

    `room` is the step before the result, or "" where there is none: then the source is used up.
    """

    function: str
    source: str
    room: str
    result: str
    when: str
    stages: tuple[int, ...] = ()

    @property
    def held(self) -> tuple[str, ...]:
        """The steps whose arrays it works on."""
        return tuple(name for name in (self.source, self.room, self.result) if name)

    @property
    def replaced(self) -> tuple[str, ...]:
        """The steps that it stands for."""
        return tuple(name for name in (self.room, self.result) if name)


@dataclass(frozen=True, slots=True)
class KernelProgram:
    """The steps of one kernel in their order.

    hit      names whose signs decide whether the ray hits: the first not negative, the others positive
    ends     names of the row's left and right end of the hits on it, or none: then every pixel is tested
    result   the name of the intensity where the ray hits
    inputs   names of the numbers that the kernel is called with, in the order of its scene structure
    wanted   other names that are needed of it
    judged   names of a pixel's quantities that say how far its value may be off: their high words are kept for that
    rates    rates of its symbols that change within a frame, by the inputs' names without `scene_`
    narrow   inputs that come in the format of the shading, from an array that another part wrote
    anchors  float32 numbers of a pixel that move one for one with x, and the hit that each is counted from: anchors.py
    stages   names of the steps of a pixel in the stages of fission.py, or none: then they are one piece
    mirrored how many of the stages, from the first on, are the same for the pixels at x and -x
    twins    how many of these, from the first on, are the same for the rows at y and -y, too
    shortcut what computes a step for a whole block where a number of the frame is not 0, in place of some stages
    """

    name: str
    steps: tuple[Step, ...]
    hit: tuple[str, ...]
    ends: tuple[str, str] | None
    result: str
    inputs: tuple[str, ...]
    background: str = "background"
    wanted: tuple[str, ...] = ()
    judged: tuple[str, ...] = ()
    rates: tuple[tuple[str, Rate], ...] = (("y", "row"), ("x", "pixel"))
    narrow: frozenset[str] = frozenset()
    anchors: tuple[tuple[str, Anchor], ...] = ()
    stages: tuple[tuple[str, ...], ...] = ()
    mirrored: int = 0
    twins: int = 0
    shortcut: Shortcut | None = None

    def __getitem__(self, name: str) -> Step:
        for step in self.steps:
            if step.name == name:
                return step
        raise KeyError(name)

    def __contains__(self, name: object) -> bool:
        return any(step.name == name for step in self.steps)

    def at(self, rate: Rate) -> tuple[Step, ...]:
        """The steps of one rate."""
        return tuple(step for step in self.steps if step.rate == rate)

    @property
    def outputs(self) -> frozenset[str]:
        """Names that the entry points need, beside what steps use of one another."""
        ends = self.ends or ()
        scale = {"plane_unit"} if "plane_unit" in self else set()
        return frozenset({self.result, self.background, "d_dot_d", *self.hit, *ends, *scale, *self.wanted})

    def input_rates(self) -> dict[str, int]:
        """The rate of each symbol that is no step and changes within a frame, as a place in RATES."""
        given = {name: RATES.index(rate) for name, rate in self.rates}
        return given | {f"scene_{name}": rate for name, rate in given.items()}

    def with_steps(self, steps: Iterable[Step]) -> KernelProgram:
        """The same kernel with other steps."""
        return replace(self, steps=tuple(steps))

    def map(self, change: dict[str, sp.Basic]) -> KernelProgram:
        """The same kernel with the values of the named steps replaced."""
        return self.with_steps(
            replace(step, value=change[step.name]) if step.name in change else step for step in self.steps
        )

    def check(self) -> None:
        """The invariants that hold after every pass: names defined once, before they are used, at no slower rate."""
        rates: dict[str, int] = {}
        given = {*self.inputs, *self.input_rates()}
        for step in self.steps:
            assert step.name not in rates, f"{step.name} is defined twice"
            for name in step.uses():
                known = name in rates or name in given
                assert known, f"{step.name} uses {name} before its definition"
                assert rates.get(name, 0) <= RATES.index(step.rate), f"{step.name} changes slower than {name}"
            rates[step.name] = RATES.index(step.rate)

    def operations(self) -> Counter[str]:
        """Operations of all steps, each once: by kind after freezing, as sympy counts them (`ops`) before."""
        total: Counter[str] = Counter()
        for step in self.steps:
            total += operations_of(step)
        return total

    def text(self) -> str:
        """The program as text, a line a step: what a user prints after any pass."""
        return "\n".join(f"{step.rate:5} {step.format:13} {step.name} = {step.value}" for step in self.steps)


def operations_of(step: Step) -> Counter[str]:
    """Operations of one step."""
    if isinstance(step.value, Node):
        return count(step.value)
    return Counter({"ops": int(sp.count_ops(step.value))})
