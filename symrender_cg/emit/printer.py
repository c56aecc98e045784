"""The printer: `Node` trees as C99, in the order in which they were frozen.

A subclass of sympy's C99CodePrinter: sympy prints declarations, comments and blocks, this class the frozen operations,
the constants of each format to as many digits as it has, and the names by where they live (local, row, frame, scene).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping

import sympy as sp
from sympy.codegen.ast import Declaration, Type
from sympy.printing.c import C99CodePrinter

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
)

C_TYPES: Mapping[str, Type] = {
    "int": Type("int"),
    "float32": Type("float"),
    "float64": Type("double"),
    "double_double": Type("double_double"),
    "pair": Type("double_double"),
    "range": Type("range"),
    "ball": Type("ball"),
}

_ATOM, _PREFIX, _TIMES, _PLUS, _COMPARE, _AND, _CHOICE = range(7)

_LEVEL: Mapping[type[Node], int] = {
    Sum: _PLUS,
    Difference: _PLUS,
    Product: _TIMES,
    Quotient: _TIMES,
    Negative: _PREFIX,
    Cast: _PREFIX,
    Larger: _CHOICE,
    Select: _CHOICE,
    Positive: _COMPARE,
    Greater: _COMPARE,
    NotNegative: _COMPARE,
    Zero: _COMPARE,
    Both: _AND,
}


def literal(value: sp.Rational, form: str) -> str:
    """The shortest decimal that reads back as the value: 17 digits at most for float64, 9 and an f for float32.

    >>> literal(sp.Rational(1, 10), "float64"), literal(sp.Integer(2), "float32")
    ('0.1', '2.0f')
    """
    if form == "int":
        return str(int(value))
    text = repr(float(value))
    if form == "float32":
        text = next(t for n in range(1, 10) if _same_single(t := f"{float(value):.{n}g}", float(value)))
        text = text if any(c in text for c in ".en") else text + ".0"
    return text + ("f" if form == "float32" else "")


def _same_single(text: str, value: float) -> bool:
    return struct.pack("f", float(text)) == struct.pack("f", value)


class KernelPrinter(C99CodePrinter):  # type: ignore[misc]
    """Prints frozen steps; `places` says where each name lives: `f->` before it, `p->{}[i]`
    around it, or `=p->n_x[i]` in its place."""

    def __init__(self, places: Mapping[str, str], single: bool) -> None:
        super().__init__()
        self._places = places
        self._single = single

    def _print_Symbol(self, symbol: sp.Symbol) -> str:
        name: str = symbol.name
        place, bare = self._places.get(name, ""), name.removeprefix("scene_")
        if place.startswith("="):
            return place[1:]
        return place.replace("{}", bare) if "{}" in place else place + bare

    def _operand(self, node: sp.Basic, level: int) -> str:
        text: str = self._print(node)
        return f"({text})" if _LEVEL.get(type(node), _ATOM) > level else text

    def _print_Number(self, node: sp.Basic) -> str:
        return literal(node.value, node.format) if isinstance(node, Number) else literal(node, "int")

    _print_Integer = _print_Number
    _print_One = _print_Number
    _print_Zero_ = _print_Number

    def _print_Sum(self, node: Sum) -> str:
        return f"{self._operand(node.args[0], _PLUS)} + {self._operand(node.args[1], _TIMES)}"

    def _print_Difference(self, node: Difference) -> str:
        return f"{self._operand(node.args[0], _PLUS)} - {self._operand(node.args[1], _TIMES)}"

    def _print_Product(self, node: Product) -> str:
        return f"{self._operand(node.args[0], _TIMES)} * {self._operand(node.args[1], _PREFIX)}"

    def _print_Quotient(self, node: Quotient) -> str:
        return f"{self._operand(node.args[0], _TIMES)} / {self._operand(node.args[1], _PREFIX)}"

    def _print_Negative(self, node: Negative) -> str:
        return f"-{self._operand(node.args[0], _ATOM)}"

    def _print_Root(self, node: Root) -> str:
        return f"{'sqrtf' if self._single else 'sqrt'}({self._print(node.args[0])})"

    def _print_Larger(self, node: Larger) -> str:
        a, b = (self._operand(argument, _PLUS) for argument in node.args)
        return f"{a} > {b} ? {a} : {b}"

    def _print_Select(self, node: Select) -> str:
        condition, first, second = node.args
        return f"{self._operand(condition, _COMPARE)} ? {self._operand(first, _PLUS)} : {self._operand(second, _PLUS)}"

    def _print_Positive(self, node: Positive) -> str:
        return f"{self._operand(node.args[0], _PLUS)} > {self._zero()}"

    def _print_Greater(self, node: Greater) -> str:
        return f"{self._operand(node.args[0], _PLUS)} > {self._operand(node.args[1], _PLUS)}"

    def _print_NotNegative(self, node: NotNegative) -> str:
        return f"{self._operand(node.args[0], _PLUS)} >= {self._zero()}"

    def _print_Zero(self, node: sp.Basic) -> str:
        if not isinstance(node, Zero):  # sympy's own number 0 has the same class name
            return literal(node, "int")
        return f"{self._operand(node.args[0], _PLUS)} == {self._zero()}"

    def _zero(self) -> str:
        return "0.0f" if self._single else "0.0"

    def _print_Both(self, node: Both) -> str:
        return " & ".join(f"({self._print(argument)})" for argument in node.args)

    def _print_Cast(self, node: Cast) -> str:
        return f"(float){self._operand(node.args[1], _ATOM)}"

    def _print_Part(self, node: Part) -> str:
        return f"{self._print(node.args[1])}.{node.args[0].name}"

    def _print_Call(self, node: Call) -> str:
        name = node.function + ("f" if node.function == "square" and self._single else "")
        return f"{name}({', '.join(self._print(argument) for argument in node.args[1:])})"

    def _print_Declaration(self, node: Declaration) -> str:
        variable = node.variable
        return f"const {self._print(variable.type)} {variable.symbol.name} = {self._print(variable.value)}"

    def _print_Type(self, node: Type) -> str:
        return str(node.name)
