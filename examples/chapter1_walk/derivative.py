"""The derivative of an image, name by name: forward mode over the definitions of an `ImageProgram`.

Comes in: a program (an ordered list of named definitions) and the name of an input. Goes out: the same list with a
slope beside every name that depends on the input, and its values by numpy. Never done here: substitution into one
expression, which is what makes the seed's derivative swell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol


def differentiate(program: ImageProgram, parameter: str) -> ImageProgram:
    """d(value)/d(parameter): the chain rule over names, slope_f = sum of (df/dg) slope_g over the g that f is made of.

    A clamp max(0, u) has the slope H(u) of its kink. The value of the result is `slope_value`, where disc >= 0.
    """
    slopes: dict[sp.Symbol, sp.Expr] = {symbol(parameter): sp.Integer(1)}
    steps: list[Definition] = []
    for definition in program.definitions:
        steps.append(definition)
        used = sorted((s for s in definition.value.free_symbols if s in slopes), key=lambda s: s.name)
        # diff gives max(0, u)^n H(u) / max(0, u), which is 0/0 in the dark; one power is total
        total = sp.Add(*(sp.powsimp(sp.diff(definition.value, s), combine="exp") * slopes[s] for s in used))
        if total != 0:
            name = f"slope_{definition.name}"
            steps.append(Definition(name, total, "derivative", f"d {definition.name} / d {parameter}"))
            slopes[definition.symbol] = symbol(name)
    return replace(program, value=f"slope_{program.value}").replacing(tuple(steps))


def evaluate_by_name(program: ImageProgram, inputs: Mapping[str, Any]) -> NDArray[np.float64]:
    """The value of a program by numpy, one definition after another; 0 where the guard does not hold.

    inputs: numbers and arrays that broadcast, by the names of the program's inputs.
    """
    known: dict[str, Any] = dict(inputs)
    heaviside = {"Heaviside": lambda u, *_: np.where(u > 0, 1.0, 0.0)}
    with np.errstate(invalid="ignore"):
        for definition in program.definitions:
            names = sorted(s.name for s in definition.value.free_symbols)
            function = sp.lambdify([symbol(name) for name in names], definition.value, [heaviside, "numpy"])
            known[definition.name] = function(*(known[name] for name in names))
    hit = np.logical_and.reduce([known[name] >= 0 if name == "disc" else known[name] > 0 for name in program.guard])
    values: NDArray[np.float64] = np.where(hit, known[program.value], 0.0)
    return values
