"""The pass that encloses: every step of a part of a scene's kernel becomes calls of ball.h; its value is then proved.

    n_dot_l = sqrt(1 / w2) (n.w)     ->  ball n_dot_l = ball_mul(ball_sqrt(inv_w2), ball_add(...))
    x^2 + y^2                        ->  ball_add(ball_product(x, x), ball_product(y, y)): products of inputs are exact
    a where p > 0, else b            ->  ball_select(ball_positive(p), a, b): the hull of both where p is in doubt
    floor(u) + floor(v)              ->  ball_floor(u) + ball_floor(v): whole numbers, exact as they are; NaN in doubt

Comes in: a Part. Goes out: a KernelProgram of two rates, sphere and pixel, whose steps have the format "ball", but for
whole numbers and what is an input itself, which are float64. Never done here: a length in another unit than that of the
inputs, a guard against negative roots (ball_sqrt takes what a ball reaches below 0 for 0).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, cast

import sympy as sp

from symrender_cg.derive.parts import Part
from symrender_cg.lower import passes
from symrender_cg.lower.freeze import freeze
from symrender_cg.lower.nodes import (
    Both,
    Call,
    Difference,
    Larger,
    Negative,
    NotNegative,
    Number,
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
from symrender_cg.lower.program import Format, KernelProgram, Rate, Step

EXACT = frozenset({"x", "y", "eye", "shininess", "nearness"})
"""Inputs that are float64 numbers; all others are balls."""

_FUNCTIONS = {"power": "ball_power", "cosine": "ball_power_of_cosine"}

_Kind = Literal["ball", "float64", "whole", "truth"]
"""What an expression is: a ball, a number known exactly, a whole number, a decision."""


def enclose_part(part: Part) -> KernelProgram:
    """One part lowered to balls; its inputs keep their names."""
    slow: Mapping[str, Rate] = {"frame": "sphere", "row": "pixel"}
    steps = tuple(Step(d.name, d.value, d.section, d.meaning, d.source) for d in part.definitions)
    program = KernelProgram(
        part.name,
        steps,
        hit=(),
        ends=None,
        result="",
        inputs=tuple(name for name in part.inputs if name not in ("x", "y")),
        background="",
        wanted=part.results,
        rates=tuple((name, slow.get(rate, cast(Rate, rate))) for name, rate in part.rates),
    )
    for step in (
        lambda p: passes.lower_powers(p, _FUNCTIONS),
        passes.place,
        passes.hoist,
        passes.share,
        passes.place,
        freeze,
        enclose,
        passes.prune,
        passes.arrange,
    ):
        program = step(program)
        program.check()
    return program


def enclose(program: KernelProgram) -> KernelProgram:
    """Each step of a frozen program as an expression of balls, which encloses its true value.

    A decision that several steps share goes back to where it is used.
    """
    kinds: dict[str, _Kind] = {}
    decisions: dict[sp.Basic, sp.Basic] = {}
    steps: list[Step] = []
    for step in program.steps:
        value, kind = _enclosed(step.value.xreplace(decisions), kinds)
        if kind == "truth":
            decisions[step.symbol] = step.value.xreplace(decisions)
            continue
        if kind == "float64" and not step.value.is_Symbol:
            value, kind = call("ball_from", value), "ball"
        kinds[step.name] = kind
        form: Format = "ball" if kind == "ball" else "float64"
        steps.append(replace(step, value=value, format=form))
    return program.with_steps(steps)


def _enclosed(value: sp.Basic, kinds: Mapping[str, _Kind]) -> tuple[sp.Basic, _Kind]:
    """A frozen expression in calls of ball.h, and what it is."""

    def ball(node: sp.Basic) -> sp.Basic:
        inner, kind = go(node)
        return inner if kind == "ball" else call("ball_from", inner)

    def truth(node: sp.Basic) -> sp.Basic:
        inner, kind = go(node)
        assert kind == "truth", f"{node} is no decision"
        return inner

    def binary(node: sp.Basic) -> tuple[sp.Basic, _Kind]:
        (a, kind_a), (b, kind_b) = go(node.args[0]), go(node.args[1])
        if {kind_a, kind_b} <= {"whole"} or (kind_a == "whole" and isinstance(node.args[1], Number)):
            return node.func(a, b), "whole"
        if {kind_a, kind_b} == {"whole", "float64"} and isinstance(node.args[0], Number):
            return node.func(a, b), "whole"
        if isinstance(node, Quotient):
            return call("ball_div", ball(node.args[0]), ball(node.args[1])), "ball"
        if isinstance(node, Product) and node.args[0] == node.args[1] and kind_a == "ball":
            return call("ball_square", a), "ball"
        exact = {Sum: "ball_sum", Difference: "ball_difference", Product: "ball_product"}[type(node)]
        mixed = {Sum: "ball_add_double", Difference: "ball_add_double", Product: "ball_mul_double"}[type(node)]
        full = {Sum: "ball_add", Difference: "ball_sub", Product: "ball_mul"}[type(node)]
        if kind_a != "ball" and kind_b != "ball":
            return call(exact, a, b), "ball"
        if kind_a == kind_b == "ball":
            return call(full, a, b), "ball"
        if isinstance(node, Difference):
            return (
                (call(mixed, a, Negative(b)), "ball")
                if kind_a == "ball"
                else (call(mixed, call("ball_neg", b), a), "ball")
            )
        return (call(mixed, a, b), "ball") if kind_a == "ball" else (call(mixed, b, a), "ball")

    def go(node: sp.Basic) -> tuple[sp.Basic, _Kind]:
        if node.is_Symbol:
            return node, "float64" if node.name in EXACT else kinds.get(node.name, "ball")
        if isinstance(node, Number):
            return number(node.value, "float64"), "float64"
        if isinstance(node, Sum | Difference | Product | Quotient):
            return binary(node)
        if isinstance(node, Negative):
            inner, kind = go(node.args[0])
            return (call("ball_neg", inner), kind) if kind == "ball" else (Negative(inner), kind)
        if isinstance(node, Root):
            return call("ball_sqrt", ball(node.args[0])), "ball"
        if isinstance(node, Larger):
            assert node.args[1].value == 0, "only max(0, a) has a form in balls"
            return call("ball_positive_part", ball(node.args[0])), "ball"
        if isinstance(node, Select):
            condition, first, second = node.args
            return call("ball_select", truth(condition), ball(first), ball(second)), "ball"
        if isinstance(node, Both):
            return call("ball_both", truth(node.args[0]), truth(node.args[1])), "truth"
        if isinstance(node, Positive | NotNegative | Zero):
            test = {Positive: "ball_positive", NotNegative: "ball_not_negative", Zero: "ball_zero"}[type(node)]
            return call(test, ball(node.args[0])), "truth"
        assert isinstance(node, Call), f"{node} has no form in balls"
        return function(node)

    def function(node: Call) -> tuple[sp.Basic, _Kind]:
        arguments = node.args[1:]
        if node.function == "square":
            inner, kind = go(arguments[0])
            return (call("ball_square", inner) if kind == "ball" else call("ball_product", inner, inner)), "ball"
        if node.function == "floor":
            inner, kind = go(arguments[0])
            return (call("ball_floor", inner) if kind == "ball" else call("floor", inner)), "whole"
        assert node.function == "ball_power_of_cosine", f"{node.function} has no form in balls"
        cos2, sin2, exponent = arguments
        return call("ball_power_of_cosine", ball(cos2), ball(sin2), go(exponent)[0]), "ball"

    return go(value)
