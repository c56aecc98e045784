"""Anchors: where a pixel lies in its row is known in float64 at the ends of the row's hits, and counted from there.

Comes in: a KernelProgram that shades in float32 and whose rows' hits have ends in closed form. Goes out: the same one
with products of float64 numbers narrowed (`narrow_products`, before freezing), and with its `anchors` (`anchor`, after
it). Never done here: a narrower sum. What vanishes at an end of the hits is a difference, and stays in float64.

Why it is as good: x - x_left grows by one step a pixel. From the first hit on it is the difference there, rounded once,
and a number of steps: a sum of two numbers that are not negative, good to three units of roundoff. What is measured
from the right end is counted from the last hit, for the same reason. Other numbers, x itself among them, are counted
from the middle between the two, to both sides alike: what is symmetric stays so to the last bit.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp
from sympy.core.symbol import Str

from symrender_cg.lower.nodes import Cast, Difference, Negative, Sum
from symrender_cg.lower.program import Anchor, KernelProgram, Step


def narrow_products(program: KernelProgram) -> KernelProgram:
    """Products of a pixel's float64 numbers are float32: each operand is rounded once, and no product cancels.

    float64: chord = from_left to_right  ->  float32: chord = from_left_single to_right_single

    Bound: a unit of roundoff, 2^-24, for each operand and each product.
    """
    return program.with_steps(
        replace(step, format="float32")
        if step.rate == "pixel" and step.format == "float64" and _is_product(step.value)
        else step
        for step in program.steps
    )


def _is_product(value: sp.Basic) -> bool:
    return bool(value.is_Mul and all(factor.is_Symbol for factor in value.args))


def anchor(program: KernelProgram) -> KernelProgram:
    """The program with its anchors: the float32 roundings of numbers that move with x, one for one, each with where it
    is counted from. None where a float64 number of a pixel is used in another way: then x itself is needed.
    """
    places = _places(program)
    found = {
        step.name: places[step.value.args[1].name]
        for step in program.at("pixel")
        if isinstance(step.value, Cast) and step.value.args[1].name in places
    }
    needed = {program.result}
    for step in reversed(program.at("pixel")):
        if step.name in needed and step.name not in found:
            needed |= step.uses()
    free = "x" not in needed and all(step.format == "float32" for step in program.at("pixel") if step.name in needed)
    return replace(program, anchors=tuple(found.items()) if free else ())


def anchoring(program: KernelProgram) -> tuple[Step, ...]:
    """The steps of a pixel that give its anchors, in their order."""
    needed = {name for name, _ in program.anchors}
    kept: list[Step] = []
    for step in reversed(program.at("pixel")):
        if step.name in needed:
            kept.append(step)
            needed |= step.uses()
    return tuple(reversed(kept))


def _places(program: KernelProgram) -> dict[str, Anchor]:
    """x and the float64 sums of a pixel that move with it: where each is counted from, at an end where it vanishes."""
    slopes = _slopes(program)
    left, right = program.ends or ("", "")
    found: dict[str, Anchor] = {"x": "middle"}
    for name, slope in slopes.items():
        uses = program[name].uses() if name in program else set()
        if slope == 1:
            found[name] = "first" if left in uses else "middle"
        elif right in uses:
            found[name] = "last"
    return found


def _slopes(program: KernelProgram) -> dict[str, int]:
    """By how much x and the float64 sums of a pixel grow where x grows by one; those that are not straight are left
    out."""
    known = {"x": 1}
    pixel = {step.name for step in program.at("pixel")} | {"x"}

    def slope(node: sp.Basic) -> int | None:
        if node.is_Symbol:
            return known.get(node.name) if node.name in pixel else 0
        if not any(entry.name in pixel for entry in node.free_symbols):
            return 0
        inner = [slope(argument) for argument in node.args if not isinstance(argument, Str)]
        if isinstance(node, Negative) and inner[0] is not None:
            return -inner[0]
        if not isinstance(node, Sum | Difference) or inner[0] is None or inner[1] is None:
            return None
        return inner[0] + inner[1] if isinstance(node, Sum) else inner[0] - inner[1]

    for step in program.at("pixel"):
        if step.format == "float64":
            grows = slope(step.value)
            if grows in (1, -1):
                known[step.name] = grows
    return known
