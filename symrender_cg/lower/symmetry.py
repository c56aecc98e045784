"""Symmetry: what the pixels at x and -x have in common, and those at y and -y, found by looking and not by being told.

Comes in: a KernelProgram, before freezing (`gather_mirrored`) or after (`parities`, `alike_in_twin_rows`). Goes out:
the same program with the symmetric parts of its sums and products as steps of their own; the parity in x of each of its
steps; which of them twin rows share. Never done here: a decision for a kind of scene. Where the sphere lies off the
axis nothing is even, and nothing changes.

A step is even where it is the same for x and -x, and odd where it is the same up to its sign. After freezing this is a
statement on bits: rounding to nearest commutes with a change of sign, sums and products commute, so two trees of
operations that differ by these laws alone give the same number, up to the sign of a zero. Products of pairs commute in
their high words; their low words may differ by what a pair's bound counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import sympy as sp
from sympy.core.symbol import Str

from symrender_cg.derive.symbols import symbol
from symrender_cg.lower.nodes import Call, Cast, Difference, Negative, Node, Number, Part, Product, Quotient, Root, Sum
from symrender_cg.lower.program import KernelProgram, Step

Parity = Literal["even", "odd"]

_X = symbol("x")
_SHORT = 2
"""Symbols of an expression without parity that others are looked through to: (x - x_left)(x_right - x) is even."""


def gather_mirrored(program: KernelProgram) -> KernelProgram:
    """The even, and the odd, members of a sum or product of a pixel become a step. Exact in the reals; in floating
    point a sum or product is associated anew, within its own rounding error.

        w2 = w_x^2 + w_y^2 + w_z^2    ->  w2_even = w_y^2 + w_z^2;       w2 = w_x^2 + w2_even
        side_y = w_z m_x - w_x m_z    ->  side_y_odd = m_x w_z;          side_y = side_y_odd - w_x m_z
    """
    images = _Images(program)
    if not images.symmetric:
        return program
    steps: list[Step] = []
    for step in program.steps:
        if step.rate == "pixel":
            parts: list[Step] = []
            value = _gathered(step.value, step, images, parts)
            steps += [*parts, replace(step, value=value)]
            for new in steps[-1 - len(parts) :]:
                images.learn(new)
        else:
            steps.append(step)
    return program.with_steps(steps)


class _Images:
    """The mirror image of each step of a pixel, as far as it is one in terms of others."""

    def __init__(self, program: KernelProgram) -> None:
        self.pixel = {_X}
        self.image: dict[sp.Symbol, sp.Expr] = {_X: -_X}
        self.whole: dict[sp.Symbol, sp.Basic] = {}
        self.lopsided: set[sp.Symbol] = set()
        for step in program.steps:
            if step.rate == "row" and (step.value.is_Symbol or (-step.value).is_Symbol):
                self.whole[step.symbol] = step.value
        ends = [self.whole.get(symbol(name), symbol(name)) for name in program.ends or ()]
        self.symmetric = len(ends) == 2 and ends[0] == -ends[1]

    def learn(self, step: Step) -> None:
        """Adds a step: its own image where it has a parity, else what it consists of, where that is short."""
        self.pixel.add(step.symbol)
        parity = self.parity(step.value)
        if parity is not None:
            self.image[step.symbol] = step.symbol if parity == "even" else -step.symbol
            return
        whole = step.value.xreplace(self.whole)
        if len(whole.free_symbols) <= _SHORT and not whole.free_symbols & self.lopsided:
            self.whole[step.symbol] = whole
        else:
            self.lopsided.add(step.symbol)

    def parity(self, value: sp.Basic) -> Parity | None:
        """The parity of an expression in x, None where it has none."""
        if value.free_symbols & self.lopsided:
            return None
        whole = value.xreplace(self.whole)
        image = whole.xreplace(self.image)
        if image == whole:
            return "even"
        return "odd" if image == -whole else None

    def moves(self, value: sp.Basic) -> bool:
        """Whether it changes with the pixel."""
        return bool(value.free_symbols & self.pixel)


def _gathered(value: sp.Basic, step: Step, images: _Images, parts: list[Step]) -> sp.Basic:
    if not (value.is_Add or value.is_Mul) or not images.moves(value) or images.parity(value) is not None:
        return value
    found: dict[str, list[sp.Basic]] = {"even": [], "odd": [], "": []}
    for argument in value.args:
        parity = None if argument.is_Number else images.parity(argument)
        found[parity or ""].append(argument)
    kept = [_gathered(argument, step, images, parts) for argument in found[""]]
    for word in ("even", "odd"):
        members = found[word]
        joined = value.func(*members)
        plain = joined.is_Atom or (-joined).is_Atom or not images.moves(joined)
        kept += members if plain else [_named(joined, word, step, parts)]
    return value.func(*kept)


def _named(value: sp.Basic, parity: str, step: Step, parts: list[Step]) -> sp.Symbol:
    name = f"{step.name}_{parity}"
    if any(part.name == name for part in parts):
        name += f"_{len(parts)}"
    told = "what x and -x share" if parity == "even" else "what x and -x share up to the sign"
    parts.append(replace(step, name=name, value=value, meaning=f"{told} in {step.name}", source=""))
    return parts[-1].symbol


def parities(program: KernelProgram) -> dict[str, Parity]:
    """The parity in x of each step of a frozen program that has one, pixel by pixel steps only; `x` itself is odd.

    Empty unless the two ends of a row's hits mirror one another: without that no two pixels of a row correspond.
    """
    here, there = _both_sides(program, "x")
    ends = [here.get(name) for name in program.ends or ()]
    if len(ends) != 2 or ends[0] is None or ends[1] != _negated(ends[0]):
        return {}
    found: dict[str, Parity] = {"x": "odd"}
    for step in program.at("pixel"):
        if here[step.name] == there[step.name]:
            found[step.name] = "even"
        elif here[step.name] == _negated(there[step.name]):
            found[step.name] = "odd"
    return found


def alike_in_twin_rows(program: KernelProgram) -> frozenset[str]:
    """The steps of a pixel that are the same in the rows at y and -y, and are made of such steps alone.

    Empty unless both rows have their hits, and the numbers that their pixels are counted from, at the same places.
    """
    here, there = _both_sides(program, "y")
    places = {*(program.ends or ()), *(name for name, _ in program.anchors)}
    if not program.ends or any(here[name] != there[name] for name in places):
        return frozenset()
    pixel, found = {step.name for step in program.at("pixel")}, set(places)
    for step in program.at("pixel"):
        if here[step.name] == there[step.name] and step.uses() & pixel <= found:
            found.add(step.name)
    return frozenset(found & pixel)


def _both_sides(program: KernelProgram, axis: str) -> tuple[dict[str, _Signed], dict[str, _Signed]]:
    """The numbers of the steps of rows and pixels, here and where x or y is replaced by its negative."""
    numbers = _Numbers()
    here, there = {axis: numbers.of_symbol(axis)}, {axis: _negated(numbers.of_symbol(axis))}
    for step in program.steps:
        if step.rate in ("row", "pixel"):
            for known in (here, there):
                known[step.name] = numbers.of(step.value, known)
    return here, there


_SUMS: Mapping[str, tuple[str, bool]] = {
    **{name: (name, False) for name in ("dd_sum", "dd_add", "pair_add", "dd_add_double", "pair_add_double")},
    "dd_difference": ("dd_sum", True),
    "dd_sub": ("dd_add", True),
    "pair_sub": ("pair_add", True),
}
_PRODUCTS = {"dd_product", "dd_mul", "dd_mul_double", "pair_mul", "pair_mul_double"}
_ODD = {"dd_from", "dd_scale", "dd_div", "pair_div", "pair_inverse", "pair_normalised"}
"""What the functions of wide numbers are, as to signs and order."""

_Signed = tuple[int, int]
"""A number of a value up to its sign, and the sign."""


def _negated(value: _Signed) -> _Signed:
    return value[0], -value[1]


class _Numbers:
    """Value numbering (Cocke and Schwartz 1970): trees get one number where they give the same floating-point value."""

    def __init__(self) -> None:
        self._known: dict[tuple[object, ...], int] = {}

    def of_symbol(self, name: str) -> _Signed:
        return self._number("symbol", name), 1

    def of(self, node: sp.Basic, known: Mapping[str, _Signed]) -> _Signed:
        """The number of a frozen tree whose symbols have the numbers `known`, or one of their own."""
        if node.is_Symbol:
            return known.get(node.name, self.of_symbol(node.name))
        if isinstance(node, Number):
            value = node.value
            return self._number("number", node.format, abs(value)), -1 if value < 0 else 1
        arguments = [self.of(a, known) for a in node.args if not isinstance(a, Str)]
        if isinstance(node, Negative):
            return _negated(arguments[0])
        if isinstance(node, Call):
            return self._called(node.function, arguments)
        if isinstance(node, Cast | Part):
            (inner, sign) = arguments[0]
            return self._number(type(node), node.args[0].name, inner), sign
        if isinstance(node, Sum | Difference):
            a, b = arguments
            first, second = sorted((a, _negated(b) if isinstance(node, Difference) else b))
            return self._number(Sum, first[0], second[0], first[1] * second[1]), first[1]
        if isinstance(node, Product):
            return self._number(Product, *sorted(a[0] for a in arguments)), arguments[0][1] * arguments[1][1]
        if isinstance(node, Quotient):
            return self._number(Quotient, *(a[0] for a in arguments)), arguments[0][1] * arguments[1][1]
        assert isinstance(node, Node | Root), f"{node} is not frozen"
        return self._number(type(node), *arguments), 1

    def _called(self, function: str, arguments: list[_Signed]) -> _Signed:
        if function == "dd_neg":
            return _negated(arguments[0])
        if function in ("square", "pair_square"):
            return self._number(Product, function, arguments[0][0], arguments[0][0]), 1
        if function in _SUMS:
            added, minus = _SUMS[function]
            first, second = sorted((arguments[0], _negated(arguments[1]) if minus else arguments[1]))
            return self._number(Sum, added, first[0], second[0], first[1] * second[1]), first[1]
        if function in _PRODUCTS:
            sign = math.prod(a[1] for a in arguments)
            return self._number(Product, function, *sorted(a[0] for a in arguments)), sign
        if function in _ODD:
            return self._number(Call, function, *(a[0] for a in arguments)), math.prod(a[1] for a in arguments)
        return self._number(Call, function, *arguments), 1

    def _number(self, *key: object) -> int:
        return self._known.setdefault(key, len(self._known))
