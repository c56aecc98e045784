"""Operations counted: of one swollen formula, of named definitions, and of what the kernels compute."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy as sp

from symrender_cg.lower.program import RATES, operations_of

if TYPE_CHECKING:
    from symrender_cg.derive.parts import Part
    from symrender_cg.derive.program import ImageProgram
    from symrender_cg.lower.program import KernelProgram
    from symrender_cg.pipeline import Translation


@dataclass(frozen=True, slots=True)
class Swell:
    """Operations of a part: its results, each as one formula in the inputs; its named definitions; its steps."""

    closed: int
    named: int
    kernel: int


def swollen_operations(image: ImageProgram) -> dict[str, int]:
    """Operations of each named quantity, and of the `image`, written as one formula in the inputs (sympy's count).

    Every definition is substituted into those that use it, the first one first: so each Max is built once.
    """
    closed: dict[sp.Symbol, sp.Expr] = {}
    counts: dict[str, int] = {}
    for definition in image.definitions:
        closed[definition.symbol] = definition.value.xreplace(closed)
        counts[definition.name] = int(sp.count_ops(closed[definition.symbol]))
    # the Piecewise around shading and condition adds the comparisons alone
    counts["image"] = counts[image.value] + int(sp.count_ops(image.condition()))
    return counts


def swell_of(part: Part, program: KernelProgram) -> Swell:
    """The swell of one part of a scene's kernel."""
    closed: dict[sp.Symbol, sp.Expr] = {}
    total = named = 0
    for definition in part.definitions:
        closed[definition.symbol] = definition.value.xreplace(closed)
        named += int(sp.count_ops(definition.value))
        if definition.name in part.results:
            total += int(sp.count_ops(closed[definition.symbol]))
    return Swell(total, named, sum(program.operations().values()))


def part_operations(translation: Translation) -> dict[str, dict[str, dict[str, int]]]:
    """Part of a scene's kernel -> rate -> kind -> operations; rates without any are left out. Empty for one sphere."""
    from symrender_cg.pipeline import SceneTranslation

    if not isinstance(translation, SceneTranslation):
        return {}
    return {name: by_rate(program) for name, program in translation.programs.items()}


def by_format(program: KernelProgram) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """(number format, the quantities in it), in the order in which the formats first appear."""
    found: dict[str, list[str]] = {}
    for step in program.steps:
        found.setdefault(step.format, []).append(step.name)
    return tuple((form, tuple(names)) for form, names in found.items())


def by_rate(program: KernelProgram) -> dict[str, dict[str, int]]:
    """Rate -> kind -> operations, in the order of the rates."""
    found: dict[str, dict[str, int]] = {}
    for rate in RATES:
        total: Counter[str] = Counter()
        for step in program.at(rate):
            total += operations_of(step)
        if total:
            found[rate] = dict(sorted(total.items()))
    return found
