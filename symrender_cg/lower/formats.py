"""Formats: after freezing, every operation is given operands of its own format, and wide formats their functions.

float64 and float32 steps keep their operations; a wider operand is rounded on the way in. A double-double step becomes
calls of double_double.h, a step of pairs calls of pair.h, each with the error bound stated there: two_sum and two_prod
where both operands are float64.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import sympy as sp
from sympy.core.symbol import Str

from symrender_cg.derive.symbols import symbol
from symrender_cg.lower.nodes import (
    INTEGER_FUNCTIONS,
    Both,
    Call,
    Cast,
    Difference,
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
from symrender_cg.lower.program import RATES, Format, KernelProgram, Rate, Step

WIDE: tuple[Format, ...] = ("double_double", "pair")
"""Formats whose numbers are hi + lo; both are of the C type double_double."""


@dataclass(frozen=True, slots=True)
class _Words:
    """The functions of a wide format; what is exact (dd_sum, dd_product, dd_neg, dd_scale) serves both."""

    add: str
    add_double: str
    mul: str
    mul_double: str
    div: str
    sqrt: str
    positive_part: str


_WORDS: dict[str, _Words] = {
    "double_double": _Words(
        "dd_add", "dd_add_double", "dd_mul", "dd_mul_double", "dd_div", "dd_sqrt", "dd_positive_part"
    ),
    "pair": _Words(
        "pair_add", "pair_add_double", "pair_mul", "pair_mul_double", "pair_div", "pair_sqrt", "pair_positive_part"
    ),
}


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
                if wide(used) in ("float64", *WIDE) and used not in rounded:
                    rounded.add(used)
                    source = Part(Str("hi"), symbol(used)) if wide(used) in WIDE else symbol(used)
                    value = Cast(Str("float32"), source)
                    rate = rates.get(used, "frame")
                    steps.append(Step(_single(used), value, step.section, "", "", rate, "float32"))
            value = step.value.xreplace({symbol(u): symbol(_single(u)) for u in step.uses() & rounded})
            steps.append(replace(step, value=_typed(value, "float32")))
        elif step.format in WIDE:
            value, is_wide = _in_words(step.value, wide, step.format)
            steps.append(replace(step, value=value if is_wide else call("dd_from", value)))
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
        return bool(a.is_Symbol and format_of(a.name) in WIDE)

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


def _in_words(value: sp.Basic, format_of: Callable[[str], Format], target: Format) -> tuple[sp.Basic, bool]:
    """A frozen expression in calls of the target's functions, and whether it is wide or a float64."""
    words = _WORDS[target]

    def lift(operand: tuple[sp.Basic, bool]) -> sp.Basic:
        node, is_wide = operand
        return node if is_wide else call("dd_from", node)

    def go(node: sp.Basic) -> tuple[sp.Basic, bool]:
        if node.is_Symbol:
            return node, format_of(node.name) in WIDE
        if isinstance(node, Number):
            return number(node.value, "float64"), False
        if isinstance(node, Select):
            condition, first, second = node.args
            chosen = [lift(go(branch)) for branch in (first, second)]
            return call("pair_select", _condition(condition), *chosen), True
        if isinstance(node, Call):
            return _called(node)
        operands = [go(argument) for argument in node.args]
        if isinstance(node, Negative):
            inner, is_wide = operands[0]
            return (call("dd_neg", inner), True) if is_wide else (Negative(inner), False)
        if isinstance(node, Root):
            return call(words.sqrt, lift(operands[0])), True
        if isinstance(node, Larger):
            assert node.args[1].value == 0, "only max(0, a) has a wide form"
            return call(words.positive_part, lift(operands[0])), True
        if isinstance(node, Quotient):
            if target == "pair" and isinstance(node.args[0], Number) and node.args[0].value == 1:
                return call("pair_inverse", lift(operands[1])), True
            return call(words.div, lift(operands[0]), lift(operands[1])), True
        first, second = operands
        if isinstance(node, Product):
            if target == "pair" and second[1] and node.args[0] == node.args[1]:
                return call("pair_square", second[0]), True
            if isinstance(first[0], Number) and second[1] and _is_power_of_two(first[0]):
                return call("dd_scale", second[0], first[0]), True
            return _binary("dd_product", words.mul_double, words.mul, first, second), True
        if isinstance(node, Sum):
            return _binary("dd_sum", words.add_double, words.add, first, second), True
        assert isinstance(node, Difference), f"{node} has no wide form"
        if not first[1] and not second[1]:
            return call("dd_difference", first[0], second[0]), True
        if not second[1]:
            return call(words.add_double, first[0], Negative(second[0])), True
        if not first[1]:
            return call(words.add_double, call("dd_neg", second[0]), first[0]), True
        return call(words.add.replace("add", "sub"), first[0], second[0]), True

    def _called(node: Call) -> tuple[sp.Basic, bool]:
        arguments = node.args[1:]
        if node.function == "square":
            inner = go(arguments[0])
            if target == "pair" and inner[1]:
                return call("pair_square", inner[0]), True
            return _binary("dd_product", words.mul_double, words.mul, inner, inner), True
        if node.function == "ldexp":
            inner = go(arguments[0])
            return (call("dd_ldexp", inner[0], arguments[1]), True) if inner[1] else (node, False)
        assert node.function == "precise_power_of_cosine", f"{node} has no wide form"
        exponent, is_wide = go(arguments[2])
        assert not is_wide, "an exponent is an input"
        cosines = (call("pair_normalised", lift(go(argument))) for argument in arguments[:2])
        return call(node.function, *cosines, exponent), True

    def _condition(node: sp.Basic) -> sp.Basic:
        if isinstance(node, Both):
            return Both(*(_condition(argument) for argument in node.args))
        assert isinstance(node, Positive | NotNegative | Zero), f"{node} is no condition on a wide number"
        inner, is_wide = go(node.args[0])
        return node.func(Sum(Part(Str("hi"), inner), Part(Str("lo"), inner)) if is_wide else inner)

    return go(value)


def _is_power_of_two(node: Number) -> bool:
    value = sp.Rational(node.value)
    return bool(value > 0 and (value.p & (value.p - 1)) == 0 and (value.q & (value.q - 1)) == 0)


def _binary(exact: str, mixed: str, full: str, first: tuple[sp.Basic, bool], second: tuple[sp.Basic, bool]) -> sp.Basic:
    """The call for a commutative operation on operands of either kind."""
    (a, wide_a), (b, wide_b) = first, second
    if wide_a == wide_b:
        return call(full if wide_a else exact, a, b)
    return call(mixed, a, b) if wide_a else call(mixed, b, a)
