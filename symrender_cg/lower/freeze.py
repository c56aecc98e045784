"""Freeze: sympy expressions become trees of `Node`, one floating-point operation each, in an order that stays.

A sum starts with its positive terms, a product with its number and its slowest factors; a quotient is one division.
Exact in the reals; from here on the order of the operations is the order in the C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import reduce

import sympy as sp

from symrender_cg.lower.nodes import (
    INTEGER_FUNCTIONS,
    Both,
    Call,
    Difference,
    Greater,
    Larger,
    Negative,
    Node,
    NotNegative,
    Number,
    Positive,
    Product,
    Quotient,
    Root,
    Select,
    Sum,
    Zero,
    number,
)
from symrender_cg.lower.program import KernelProgram


def freeze(program: KernelProgram) -> KernelProgram:
    """The program with every value frozen; already frozen values stay as they are."""
    ranks = {step.name: i for i, step in enumerate(program.steps)}

    def rank(expression: sp.Basic) -> int:
        return max((ranks.get(s.name, -1) for s in expression.free_symbols), default=-1)

    return program.with_steps(replace(step, value=frozen(step.value, rank)) for step in program.steps)


def frozen(value: sp.Basic, rank: Callable[[sp.Basic], int] = lambda _: 0) -> sp.Basic:
    """One expression frozen; `rank` orders the factors of a product, smallest first."""

    def go(expression: sp.Basic) -> sp.Basic:
        if isinstance(expression, Call):
            kind = "int" if expression.function in INTEGER_FUNCTIONS else "float64"
            arguments = (number(a, kind) if a.is_Integer else go(a) for a in expression.args[1:])
            return Call(expression.args[0], *arguments)
        if expression.is_Symbol or isinstance(expression, Node):
            return expression
        if expression.is_Number:
            return _number(expression)
        if expression.is_Add:
            return _sum(expression)
        if expression.is_Mul:
            return _product(expression)
        if expression.is_Pow:
            return _power(expression)
        if isinstance(expression, sp.Max):
            assert len(expression.args) == 2, f"a maximum of two is expected, not {expression}"
            return Larger(*sorted((go(argument) for argument in expression.args), key=lambda a: isinstance(a, Number)))
        if isinstance(expression, sp.Piecewise):
            (first, condition), (second, otherwise) = expression.args
            assert otherwise == sp.true, f"a Piecewise of two is expected, not {expression}"
            return Select(go(condition), go(first), go(second))
        return _condition(expression)

    def _number(expression: sp.Basic) -> sp.Basic:
        if expression.is_Rational and expression.q & (expression.q - 1):
            return Quotient(number(expression.p), number(expression.q))
        return Negative(number(-expression)) if expression.is_negative else number(expression)

    def _sum(expression: sp.Basic) -> sp.Basic:
        terms = sorted(expression.args, key=lambda term: (rank(term), sp.default_sort_key(term)))
        positive = [term for term in terms if not term.could_extract_minus_sign()]
        negative = [-term for term in terms if term.could_extract_minus_sign()]
        if not positive:
            return Difference(Negative(go(negative[0])), reduce(Sum, map(go, negative[1:])))
        total = reduce(Sum, map(go, positive))
        return reduce(Difference, map(go, negative), total)

    def _product(expression: sp.Basic) -> sp.Basic:
        if expression.could_extract_minus_sign() and expression.args[0].is_Number:
            return Negative(go(-expression))
        above, below = [], []
        for factor in expression.args:
            if factor.is_Pow and factor.exp.is_Rational and factor.exp.is_negative:
                below.append(factor.base**-factor.exp)
            elif factor.is_Rational and not factor.is_Integer:
                if factor.p != 1:
                    above.append(sp.Integer(factor.p))
                below.append(sp.Integer(factor.q))
            else:
                above.append(factor)
        if len(below) == 1 and below[0].is_Integer and not int(below[0]) & (int(below[0]) - 1):
            above.insert(0, 1 / below.pop())

        def order(factor: sp.Basic) -> tuple[bool, int, object]:
            return (not factor.is_Number, rank(factor), sp.default_sort_key(factor))

        numerator = reduce(Product, (go(f) for f in sorted(above, key=order))) if above else number(1)
        if not below:
            return numerator
        return Quotient(numerator, reduce(Product, (go(f) for f in sorted(below, key=order))))

    def _power(expression: sp.Basic) -> sp.Basic:
        base, exponent = expression.args
        if exponent == 2:
            inner = go(base)
            return Product(inner, inner) if base.is_Symbol else Call(sp.core.symbol.Str("square"), inner)
        if exponent == sp.Rational(1, 2):
            return Root(go(base))
        assert exponent in (-1, -2, sp.Rational(-1, 2)), f"{expression} should have been lowered before freezing"
        return Quotient(number(1), go(base**-exponent))

    def _condition(expression: sp.Basic) -> sp.Basic:
        if isinstance(expression, sp.And):
            return reduce(Both, (go(argument) for argument in sorted(expression.args, key=sp.default_sort_key)))
        if isinstance(expression, sp.StrictLessThan):
            return Greater(go(expression.rhs), go(expression.lhs))
        assert isinstance(expression, sp.Rel), f"cannot freeze {expression}"
        assert expression.rhs == 0, f"cannot freeze {expression}"
        kinds = {sp.StrictGreaterThan: Positive, sp.GreaterThan: NotNegative, sp.Equality: Zero}
        return kinds[type(expression)](go(expression.lhs))

    return go(value)
