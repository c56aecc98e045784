"""Frozen expressions: nodes that sympy carries about, hashes and substitutes, but never rearranges.

sympy is free to turn 2*(a - b) into 2*a - 2*b and to flatten (x - hi) - lo; in floating point these differ. After the
freeze pass an expression consists of the nodes below alone, each one floating-point operation in a fixed order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import sympy as sp
from sympy.core.symbol import Str


class Node(sp.Expr):  # type: ignore[misc]
    """Base of the frozen operations; construction evaluates nothing."""

    is_commutative = True
    is_real = True
    symbol_name = ""

    def __new__(cls, *args: sp.Basic) -> Node:
        node: Node = sp.Basic.__new__(cls, *args)
        return node

    def _sympystr(self, printer: sp.printing.printer.Printer) -> str:
        """As text: the name of the operation and its operands."""
        words = [str(a.name) if isinstance(a, Str) else printer._print(a) for a in self.args]
        if isinstance(self, Call):
            return f"{words[0]}({', '.join(words[1:])})"
        if isinstance(self, Number):
            return words[0]
        return f"{type(self).__name__}({', '.join(words)})"


class Sum(Node):
    """a + b"""

    symbol_name = "add"


class Difference(Node):
    """a - b"""

    symbol_name = "add"


class Product(Node):
    """a * b"""

    symbol_name = "mul"


class Quotient(Node):
    """a / b"""

    symbol_name = "div"


class Negative(Node):
    """-a"""


class Root(Node):
    """sqrt(a)"""

    symbol_name = "sqrt"


class Larger(Node):
    """a > b ? a : b, which compilers turn into one instruction (and fmax into a call)."""

    symbol_name = "max"


class Positive(Node):
    """The condition a > 0."""


class Greater(Node):
    """The condition a > b."""


class NotNegative(Node):
    """The condition a >= 0."""


class Zero(Node):
    """The condition a == 0."""


class Both(Node):
    """The condition a && b, both evaluated: there is no branch in it."""


class Select(Node):
    """condition ? a : b"""

    symbol_name = "select"


class Number(Node):
    """A constant of a format: Number(value, Str(format))."""

    @property
    def value(self) -> sp.Expr:
        """The constant, exactly."""
        return self.args[0]

    @property
    def format(self) -> str:
        """float64, float32 or int."""
        return str(self.args[1].name)


class Cast(Node):
    """A value rounded to a narrower format: Cast(Str(format), a)."""


class Part(Node):
    """The high or the low word of a double-double: Part(Str("hi" | "lo"), a)."""


class Call(Node):
    """A C function of the support headers or of math.h: Call(Str(name), a, b, ...)."""

    symbol_name = "call"

    @property
    def function(self) -> str:
        """The name of the C function."""
        return str(self.args[0].name)


INTEGER_FUNCTIONS = frozenset({"ldexp", "dd_ldexp", "unit_exponent", "light_exponent"})
"""Functions whose whole-number arguments are of type int."""


def call(function: str, *args: sp.Basic) -> Call:
    """The node for function(*args)."""
    return Call(Str(function), *args)


def number(value: sp.Expr | int, form: str = "float64") -> Number:
    """The node for a constant of that format."""
    return Number(sp.sympify(value), Str(form))


def walk(expression: sp.Basic) -> Iterator[sp.Basic]:
    """Every node of a frozen expression, the expression itself first; a number counts as a leaf."""
    yield expression
    if not isinstance(expression, Number):
        for argument in expression.args:
            if not isinstance(argument, Str):
                yield from walk(argument)


def count(expression: sp.Basic) -> Counter[str]:
    """Floating-point operations of a frozen expression by kind: add, mul, div, sqrt, max, select, call."""
    return Counter(node.symbol_name for node in walk(expression) if isinstance(node, Node) and node.symbol_name)
