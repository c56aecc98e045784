"""Formats: after freezing, every operation is given operands of its own format, and double-double its functions.

float64 and float32 steps keep their operations; a wider operand is rounded on the way in. A double-double step becomes
calls of double_double.h, each with the error bound stated there: two_sum and two_prod where both operands are float64.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import sympy as sp
from sympy.core.symbol import Str

from symrender_cg.derive.symbols import symbol
from symrender_cg.lower.nodes import (
    INTEGER_FUNCTIONS,
    Call,
    Cast,
    Difference,
    Larger,
    Negative,
    Node,
    Number,
    Part,
    Product,
    Quotient,
    Root,
    Sum,
    call,
    number,
)
from symrender_cg.lower.program import RATES, Format, KernelProgram, Rate, Step


def convert_formats(program: KernelProgram) -> KernelProgram:
    """Operands wider than their operation are rounded; double-double ends are subtracted in two exact-order steps.

    float64:  x - x_left      ->  (x - x_left.hi) - x_left.lo
    float64:  alpha a         ->  alpha.hi a
    float32:  k_ambient + a   ->  k_ambient_single + a, with k_ambient_single = (float)k_ambient at its own rate
    int:      ldexp arguments stay as they are
    """
    formats: dict[str, Format] = {step.name: step.format for step in program.steps}
    of_inputs: dict[str, Rate] = {name: RATES[rate] for name, rate in program.input_rates().items()}
    rates = of_inputs | {step.name: step.rate for step in program.steps}
    steps: list[Step] = []
    rounded: set[str] = set()

    def wide(name: str) -> Format:
        return formats.get(name, "float32" if name in program.narrow else "float64")

    for step in program.steps:
        if step.format == "float32":
            for used in sorted(step.uses()):
                if wide(used) in ("float64", "double_double") and used not in rounded:
                    rounded.add(used)
                    source = Part(Str("hi"), symbol(used)) if wide(used) == "double_double" else symbol(used)
                    value = Cast(Str("float32"), source)
                    rate = rates.get(used, "frame")
                    steps.append(Step(_single(used), value, step.section, "", "", rate, "float32"))
            value = step.value.xreplace({symbol(u): symbol(_single(u)) for u in step.uses() & rounded})
            steps.append(replace(step, value=_typed(value, "float32")))
        elif step.format == "double_double":
            value, form = _double_double(step.value, wide)
            steps.append(replace(step, value=value if form == "double_double" else call("dd_from", value)))
        else:
            value = _typed(step.value, "float64") if step.format == "float64" else step.value
            steps.append(replace(step, value=_split(value, wide)))
    return program.with_steps(steps)


def _single(name: str) -> str:
    """The name of a step that is another one, or an input, rounded to float32."""
    return name.removeprefix("scene_") + "_single"


def _typed(value: sp.Basic, form: Format) -> sp.Basic:
    """The same operations with every constant of that format; integer arguments of ldexp and the like stay."""
    if isinstance(value, Number):
        return number(value.value, form)
    if isinstance(value, Call) and value.function in INTEGER_FUNCTIONS:
        return value
    if not isinstance(value, Node) or isinstance(value, Cast | Part):
        return value
    return value.func(*(a if isinstance(a, Str) else _typed(a, form) for a in value.args))


def _split(value: sp.Basic, format_of: Callable[[str], Format]) -> sp.Basic:
    """float64 operations on double-double symbols: the high word, or both where the symbol is added to a float64."""

    def is_wide(a: sp.Basic) -> bool:
        return bool(a.is_Symbol and format_of(a.name) == "double_double")

    def go(node: sp.Basic) -> sp.Basic:
        if is_wide(node):
            return Part(Str("hi"), node)
        if isinstance(node, Sum | Difference) and not is_wide(node.args[0]) and is_wide(node.args[1]):
            first, second = node.args
            return node.func(node.func(go(first), Part(Str("hi"), second)), Part(Str("lo"), second))
        if isinstance(node, Difference) and is_wide(node.args[0]) and not is_wide(node.args[1]):
            first, second = node.args
            return Sum(Difference(Part(Str("hi"), first), go(second)), Part(Str("lo"), first))
        if isinstance(node, Node) and not isinstance(node, Number | Part):
            return node.func(*(a if isinstance(a, Str) else go(a) for a in node.args))
        return node

    return go(value)


def _double_double(value: sp.Basic, format_of: Callable[[str], Format]) -> tuple[sp.Basic, Format]:
    """A frozen expression in calls of double_double.h, and whether it is a float64 leaf or a double-double."""

    def lift(node: sp.Basic, form: Format) -> sp.Basic:
        return node if form == "double_double" else call("dd_from", node)

    def go(node: sp.Basic) -> tuple[sp.Basic, Format]:
        if node.is_Symbol:
            return node, "double_double" if format_of(node.name) == "double_double" else "float64"
        if isinstance(node, Number):
            return number(node.value, "float64"), "float64"
        if isinstance(node, Call) and node.function == "square":
            inner, form = go(node.args[1])
            return _binary("dd_product", "dd_mul_double", "dd_mul", (inner, form), (inner, form)), "double_double"
        operands = [go(argument) for argument in node.args]
        if isinstance(node, Negative):
            inner, form = operands[0]
            return (call("dd_neg", inner), form) if form == "double_double" else (Negative(inner), form)
        if isinstance(node, Root):
            return call("dd_sqrt", lift(*operands[0])), "double_double"
        if isinstance(node, Larger):
            assert node.args[1].value == 0, "only max(0, a) has a double-double form"
            return call("dd_positive_part", lift(*operands[0])), "double_double"
        if isinstance(node, Quotient):
            return call("dd_div", lift(*operands[0]), lift(*operands[1])), "double_double"
        first, second = operands
        if isinstance(node, Product):
            return _binary("dd_product", "dd_mul_double", "dd_mul", first, second), "double_double"
        if isinstance(node, Sum):
            return _binary("dd_sum", "dd_add_double", "dd_add", first, second), "double_double"
        assert isinstance(node, Difference), f"{node} has no double-double form"
        if first[1] == second[1] == "float64":
            return call("dd_difference", first[0], second[0]), "double_double"
        if second[1] == "float64":
            return call("dd_add_double", first[0], Negative(second[0])), "double_double"
        return call("dd_sub", lift(*first), second[0]), "double_double"

    return go(value)


def _binary(
    exact: str,
    mixed: str,
    full: str,
    first: tuple[sp.Basic, Format],
    second: tuple[sp.Basic, Format],
) -> sp.Basic:
    """The call for a commutative operation on operands of either format."""
    (a, form_a), (b, form_b) = first, second
    if form_a == form_b:
        return call(full if form_a == "double_double" else exact, a, b)
    return call(mixed, a, b) if form_a == "double_double" else call(mixed, b, a)
