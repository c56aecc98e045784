"""Ranges: a kernel's own steps, evaluated once a frame over all pixels that hit, bound how far its values may be off.

    n_x = inv_d2 * (a - b)    ->  n_x = range_within(range_product(FLOAT64, inv_d2, range_difference(FLOAT64, a, b)),
                                                     -1, 1)
    w2 = pair_add(p, q)       ->  w2 = range_within(range_sum(PAIR, p, q), light_gap2, INFINITY)

Comes in: a `KernelProgram` whose formats are converted. Goes out: steps of the format "range" (range.h), each the bound
of the definition of the same name: its operations in their order, each with the error of its own format. What the
mathematics knows of a quantity, but its computation does not show, is in `FACTS`. Never done here: a bound for one
pixel; conditions are taken as decided, and a pixel where one is not asks for more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy as sp
from sympy.core.symbol import Str

from symrender_cg.derive.symbols import symbol
from symrender_cg.lower.nodes import (
    INTEGER_FUNCTIONS,
    Call,
    Difference,
    Larger,
    Negative,
    Number,
    Part,
    Product,
    Quotient,
    Root,
    Select,
    Sum,
    call,
    number,
)
from symrender_cg.lower.passes import arrange
from symrender_cg.lower.program import KernelProgram, Shortcut, Step

_NONE, _ONE = number(0), number(1)
_INFINITE = symbol("INFINITY")

_SURE_HIT = symbol("SURE_HIT")
"""A pixel whose facing2 is below this part of |D|^2, and |D| >= 1, is in doubt anyway."""

FACTS: Mapping[str, tuple[sp.Basic, sp.Basic]] = {
    "from_left": (_NONE, _INFINITE),
    "to_right": (_NONE, _INFINITE),
    "facing2": (_SURE_HIT, symbol("farthest2")),
    **{f"n_{axis}": (number(-1), _ONE) for axis in "xyz"},
    "n_dot_lamp": (Negative(symbol("lamp_length")), symbol("lamp_length")),
    "w2": (symbol("light_gap2"), _INFINITE),
    "n_dot_l": (number(-1), _ONE),
    "cos2": (symbol("least_cos2"), _ONE),
    "sin2": (_NONE, _ONE),
}
"""What is known of a pixel that hits: |n| = 1, facing <= |D|, |w| >= ||lamp| - 1|, and a cosine is one.

`farthest2`, `lamp_length`, `light_gap2` and `least_cos2` are numbers of the frame: the largest |D|^2, the largest
|lamp|, the least |w|^2, and how small a cosine may be before the pixel asks for more (0, but for n < 1).
"""

ROOT_FACTS: Mapping[str, sp.Basic] = {"reach": symbol("least_reach2"), "row_half": symbol("least_half2")}
"""How small the argument of a root may be: facing2 = alpha (x - x_left)(x_right - x) is at most alpha reach^2, and
row_half^2 / alpha, so that a row of hits that are sure has no shorter span."""

BLUR = {"float64": symbol("0x1p-58"), "double_double": symbol("0x1p-195")}
"""What bringing a light nearer turns its direction by: see passes.scale_lengths."""

_SUMS = {"add", "add_double", "sum"}
_PRODUCTS = {"mul", "mul_double", "product"}


def to_ranges(program: KernelProgram, results: tuple[str, ...]) -> tuple[Step, ...]:
    """The steps that bound the named results, in their order.

    Whole numbers and what is exact stay as they are, and so do differences of inputs, which a whole number is read off.
    """
    exact: dict[str, sp.Basic] = {name: call("range_exact", symbol(name)) for name in program.inputs}
    steps: list[Step] = []
    needed = _needed(program, results)
    for step in program.steps:
        if step.name not in needed:
            continue
        if step.format == "int" or _is_exact(step, exact):
            exact[step.name] = call("range_exact", step.symbol)
        elif step.name.startswith("from_center_"):
            exact[step.name] = call("range_known" if step.format == "float64" else "range_known_wide", step.symbol)
        if step.name in exact:
            steps.append(replace(step, rate="frame", meaning="", source=""))
            continue
        value = _Ranges(exact, step, program.shortcut).of(step.value)
        if step.name in ROOT_FACTS:
            root, form, square = value.args
            value = call("range_root", form, call("range_within", square, ROOT_FACTS[step.name], _INFINITE))
            assert root.name == "range_root", f"{step.name} is a root"
        if step.name.startswith("lamp_"):
            value = call("range_blurred", value, BLUR[step.format])
        if step.name in FACTS:
            value = call("range_within", value, *FACTS[step.name])
        steps.append(replace(step, value=value, rate="frame", format="range", meaning="", source=""))
        steps += _facts_after(program, step)
    wanted, kept = set(results), []
    for step in reversed(arrange(program.with_steps(steps)).steps):
        if step.name in wanted:
            wanted |= step.uses()
            kept.append(step)
    return tuple(reversed(kept))


def _facts_after(program: KernelProgram, step: Step) -> list[Step]:
    """Numbers of the frame that facts speak of, as soon as they are known."""
    alpha = symbol("alpha")
    if step.name == "alpha" and "reach" in program:
        least = Quotient(_SURE_HIT, call("range_size", alpha))
        return [Step("least_reach2", least, step.section, "of a row with hits that are sure", format="float64")]
    if step.name == "alpha":
        least = Product(_SURE_HIT, call("range_least_size", alpha))
        return [Step("least_half2", least, step.section, "of a row with hits that are sure", format="float64")]
    if step.name == "lamp_z":
        gap = call("range_light_gap2", *(symbol(f"lamp_{axis}") for axis in "xyz"))
        found = [Step("light_gap2", gap, step.section, "the least |w|^2: (|lamp| - 1)^2", format="float64")]
        if "n_dot_lamp" in program:
            length = call("range_length", *(symbol(f"lamp_{axis}") for axis in "xyz"))
            found.append(Step("lamp_length", length, step.section, "the largest |lamp|", format="float64"))
        return found
    if step.name == "d_dot_d":
        most = call("range_size", symbol("d_dot_d"))
        return [Step("farthest2", most, step.section, "the largest |D|^2", format="float64")]
    return []


def _needed(program: KernelProgram, results: tuple[str, ...]) -> set[str]:
    """Names that lead to the results, and those that facts about them speak of."""
    needed = {*results, "d_dot_d", *(f"lamp_{axis}" for axis in "xyz")}
    needed |= {program.shortcut.when} if program.shortcut else set()
    for step in reversed(program.steps):
        if step.name in needed:
            needed |= step.uses()
    return needed


def _is_exact(step: Step, exact: Mapping[str, sp.Basic]) -> bool:
    """Whether the step's value is held exactly: lengths times powers of two, 0 or 1."""
    value = step.value
    if step.format != "float64" or not step.uses() <= exact.keys():
        return False
    if isinstance(value, Select):
        return all(isinstance(branch, Number) for branch in value.args[1:])
    return isinstance(value, Call) and value.function in INTEGER_FUNCTIONS


class _Ranges:
    """The expressions of one step in calls of range.h."""

    def __init__(self, exact: Mapping[str, sp.Basic], step: Step, shortcut: Shortcut | None) -> None:
        self.exact = exact
        self.shortcut = shortcut
        self.format = symbol("FLOAT64" if step.format == "float64" else "DOUBLE_DOUBLE")

    def of(self, node: sp.Basic) -> sp.Basic:
        """A range for the node's value, computed as the kernel does."""
        if node.is_Symbol:
            return self.exact.get(node.name, node)
        if isinstance(node, Number):
            return call("range_exact", number(node.value))
        if isinstance(node, Call):
            return self._called(node)
        if isinstance(node, Part):
            return call("range_high", self.of(node.args[1]))
        if isinstance(node, Select):
            return call("range_either", self.of(node.args[1]), self.of(node.args[2]))
        if isinstance(node, Larger):
            assert node.args[1].value == 0, "only max(0, a) has a range"
            return call("range_positive_part", self.of(node.args[0]))
        if isinstance(node, Negative):
            return call("range_neg", self.of(node.args[0]))
        if isinstance(node, Root):
            return call("range_root", self.format, self.of(node.args[0]))
        in_order = _in_order(node)
        if in_order is not None:
            return call("range_difference_in_order", *map(self.of, in_order))
        first, second = (self.of(argument) for argument in node.args)
        if isinstance(node, Product) and node.args[0] == node.args[1]:
            return call("range_square", self.format, first)
        if isinstance(node, Quotient) and isinstance(node.args[0], Number) and node.args[0].value == 1:
            return call("range_inverse", self.format, second)
        names = {Sum: "range_sum", Difference: "range_difference", Product: "range_product", Quotient: "range_quotient"}
        return call(names[type(node)], self.format, first, second)

    def _called(self, node: Call) -> sp.Basic:
        function, arguments = node.function, node.args[1:]
        if function == "dd_from":
            return self.of(arguments[0])
        if function == "dd_neg":
            return call("range_neg", self.of(arguments[0]))
        if function == "dd_scale":
            return call("range_scaled", self.of(arguments[0]), arguments[1])
        if function == "dd_ldexp":
            return call("range_ldexp", self.of(arguments[0]), arguments[1])
        if function == "ldexp":
            return call("range_ldexp", self.of(arguments[0]), arguments[1])
        if function == "pair_select":
            return call("range_either", self.of(arguments[1]), self.of(arguments[2]))
        if function == "pair_normalised":
            return self.of(arguments[0])
        if function in ("power_of_cosine", "precise_power_of_cosine"):
            return self._power(function, arguments)
        kind, _, operation = function.partition("_")
        form = {"dd": symbol("DOUBLE_DOUBLE"), "pair": symbol("PAIR")}.get(kind)
        if function == "square":
            return call("range_square", self.format, self.of(arguments[0]))
        assert form is not None, f"{function} has no range"
        operands = [self.of(argument) for argument in arguments]
        if operation == "positive_part":
            return call("range_positive_part", *operands)
        if operation in _SUMS:
            return call("range_sum", form, *operands)
        if operation in ("sub", "difference"):
            return call("range_difference", form, *operands)
        if operation in _PRODUCTS:
            if arguments[0] == arguments[1]:
                return call("range_square", form, operands[0])
            return call("range_product", form, *operands)
        names = {"square": "range_square", "inverse": "range_inverse", "div": "range_quotient", "sqrt": "range_root"}
        return call(names[operation], form, *operands)

    def _power(self, function: str, arguments: tuple[sp.Basic, ...]) -> sp.Basic:
        plain = function == "power_of_cosine"
        own = (
            (_NONE, symbol("POWER_ERROR")) if plain else (symbol("PRECISE_POWER_ERROR"), symbol("PRECISE_POWER_FLOOR"))
        )
        form = symbol("FLOAT64" if plain else "PAIR")
        told = [self.of(argument) for argument in arguments]
        if self.shortcut is not None:
            return call("range_lobe", form, *told, symbol(self.shortcut.when), *own)
        return call("range_power_of_cosine", form, *told, *own)


def _in_order(node: sp.Basic) -> tuple[sp.Basic, sp.Basic] | None:
    """(a, b) where the node is a - b with one of them a double-double taken word by word: see formats._split.

    (a - b.hi) - b.lo  and  (a.hi - b) + a.lo
    """
    if not isinstance(node, Sum | Difference) or not isinstance(node.args[0], Difference):
        return None
    inner, last = node.args
    if not isinstance(last, Part) or last.args[0].name != "lo":
        return None
    wide = last.args[1]
    high = Part(Str("hi"), wide)
    if isinstance(node, Difference) and inner.args[1] == high:
        return inner.args[0], wide
    return (wide, inner.args[1]) if isinstance(node, Sum) and inner.args[0] == high else None
