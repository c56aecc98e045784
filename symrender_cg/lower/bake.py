"""Bake: partial evaluation. Every frame step becomes a number, computed to 200 bits and rounded once, and what a factor
of 1 or a term of 0 leaves of the other steps is folded.

The numbers of the scene are then part of the kernel: it has no scene argument.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import replace

import mpmath
import sympy as sp
from sympy.core.symbol import Str

from symrender_cg.lower.nodes import (
    Both,
    Call,
    Cast,
    Difference,
    Greater,
    Larger,
    Negative,
    Node,
    NotNegative,
    Number,
    Part,
    Positive,
    Product,
    Quotient,
    Root,
    Select,
    Sum,
    Zero,
    call,
    number,
)
from symrender_cg.lower.program import KernelProgram, Step

_BITS = 200
"""Precision of the evaluation: far above the 106 bits of the widest format."""


def bake(program: KernelProgram, numbers: Mapping[str, float] | None) -> KernelProgram:
    """The program with the scene's numbers in it; `numbers` by the names of the inputs without `scene_`."""
    assert numbers is not None
    with mpmath.workprec(_BITS):
        known: dict[str, mpmath.mpf] = {
            name: mpmath.mpf(numbers[name.removeprefix("scene_")]) for name in program.inputs
        }
        steps: list[Step] = []
        constants: dict[sp.Basic, sp.Basic] = {}
        for name in program.inputs:
            constants[sp.Symbol(name, real=True)] = _constant(known[name], "float64")
        for step in program.steps:
            if step.rate != "frame":
                steps.append(step)
                continue
            known[step.name] = _evaluate(step.value, known)
            steps.append(replace(step, value=_constant(known[step.name], step.format)))
    unit = {
        step.symbol: step.value
        for step in steps
        if step.rate == "frame" and isinstance(step.value, Number) and step.value.value in (0, 1)
    }
    inputs = {s: constants[s] for step in steps for s in step.value.free_symbols if s in constants}
    folded = [
        step if step.rate == "frame" else replace(step, value=_fold(step.value.xreplace(unit | inputs)))
        for step in steps
    ]
    background = Step("background", _constant(known[program.background], "float64"), "background", "where no ray hits")
    return replace(program, steps=(background, *folded), inputs=(), background="background")


def _constant(value: mpmath.mpf, form: str) -> sp.Basic:
    """A number rounded to a format, as a node; a double-double as two words."""
    if form == "int":
        return number(int(value), "int")
    if form == "float32":
        return number(_rational(struct.unpack("f", struct.pack("f", float(value)))[0]), "float32")
    high = float(value)
    if form == "float64":
        return number(_rational(high))
    return call("dd_words", number(_rational(high)), number(_rational(float(value - high))))


def _rational(value: float) -> sp.Rational:
    return sp.Rational(*value.as_integer_ratio())


def _evaluate(value: sp.Basic, known: Mapping[str, mpmath.mpf]) -> mpmath.mpf:
    """The exact meaning of a frozen frame step, to 200 bits; a condition is true or false."""

    def go(node: sp.Basic) -> mpmath.mpf:
        if node.is_Symbol:
            return known[node.name]
        if isinstance(node, Number):
            return mpmath.mpf(node.value.p) / node.value.q
        if isinstance(node, Select):
            condition, first, second = node.args
            return go(first) if go(condition) else go(second)
        arguments = [go(argument) for argument in node.args if not isinstance(argument, Str)]
        if isinstance(node, Call):
            return _CALLS[node.function](*arguments)
        return _OPERATIONS[type(node)](*arguments)

    return go(value)


def _unit_exponent(length: mpmath.mpf) -> mpmath.mpf:
    return mpmath.mpf(1 - mpmath.frexp(length)[1])


def _light_exponent(world: mpmath.mpf, radius: mpmath.mpf, *offsets_and_farthest: mpmath.mpf) -> mpmath.mpf:
    *offsets, farthest = offsets_and_farthest
    longest = max(radius, *(abs(offset) for offset in offsets))
    return min(world, farthest + _unit_exponent(longest))


_OPERATIONS: dict[type[Node], Callable[..., mpmath.mpf]] = {
    Sum: lambda a, b: a + b,
    Difference: lambda a, b: a - b,
    Product: lambda a, b: a * b,
    Quotient: lambda a, b: a / b,
    Negative: lambda a: -a,
    Root: mpmath.sqrt,
    Larger: max,
    Positive: lambda a: a > 0,
    Greater: lambda a, b: a > b,
    NotNegative: lambda a: a >= 0,
    Zero: lambda a: a == 0,
    Both: lambda a, b: a and b,
    Cast: lambda a: a,
    Part: lambda a: a,
}

_CALLS: dict[str, Callable[..., mpmath.mpf]] = {
    "dd_from": lambda a: a,
    "dd_sum": lambda a, b: a + b,
    "dd_add": lambda a, b: a + b,
    "dd_add_double": lambda a, b: a + b,
    "dd_difference": lambda a, b: a - b,
    "dd_sub": lambda a, b: a - b,
    "dd_product": lambda a, b: a * b,
    "dd_mul": lambda a, b: a * b,
    "dd_mul_double": lambda a, b: a * b,
    "dd_div": lambda a, b: a / b,
    "dd_sqrt": mpmath.sqrt,
    "dd_neg": lambda a: -a,
    "dd_positive_part": lambda a: max(a, mpmath.mpf(0)),
    "square": lambda a: a * a,
    "ldexp": lambda a, k: mpmath.ldexp(a, int(k)),
    "unit_exponent": _unit_exponent,
    "light_exponent": _light_exponent,
}


def _fold(value: sp.Basic) -> sp.Basic:
    """1 a -> a, 0 a -> 0, a + 0 -> a, a - 0 -> a: exact for every finite a, up to the sign of a zero."""
    if not isinstance(value, Node) or isinstance(value, Number | Part | Cast):
        return value
    node = value.func(*(a if isinstance(a, Str) else _fold(a) for a in value.args))
    first = node.args[0] if node.args else None
    if isinstance(node, Product):
        a, b = node.args
        for one, other in ((a, b), (b, a)):
            if isinstance(one, Number) and one.value == 1:
                return other
            if isinstance(one, Number) and one.value == 0:
                return one
    if isinstance(node, Sum | Difference):
        a, b = node.args
        if isinstance(b, Number) and b.value == 0:
            return a
        if isinstance(a, Number) and a.value == 0:
            return b if isinstance(node, Sum) else Negative(b)
    if isinstance(node, Select) and isinstance(first, Zero) and isinstance(first.args[0], Number):
        return node.args[1] if first.args[0].value == 0 else node.args[2]
    return node
