"""Parts of a scene's kernel through the passes: each `Part` of the derivation becomes a `KernelProgram` of its own.

The passes are those of the kernels of one sphere, in the same order; a part has no background and is never baked.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import sympy as sp

from symrender_cg.derive.parts import Part
from symrender_cg.derive.symbols import symbol
from symrender_cg.lower import passes
from symrender_cg.lower.formats import convert_formats
from symrender_cg.lower.freeze import freeze
from symrender_cg.lower.lower import FUNCTIONS
from symrender_cg.lower.program import KernelProgram, Rate, Step
from symrender_cg.lower.variants import Variant

PRIMARY = frozenset({"span", "near", "plane"})
"""Parts that take the eye's ray, in the unit of the image plane."""

_SCALED = PRIMARY | {"lamp"}


def lower_part(part: Part, variant: Variant) -> KernelProgram:
    """One part lowered; its inputs keep their names, those of the scene with `scene_` before them."""
    steps = tuple(Step(d.name, d.value, d.section, d.meaning, d.source) for d in part.definitions)
    rates = tuple((name, cast(Rate, rate)) for name, rate in part.rates)
    inputs = tuple(name for name in part.inputs if name not in ("x", "y"))
    single = variant.shading == "float32"
    program = KernelProgram(
        part.name,
        steps,
        hit=(),
        ends=part.ends,
        result="",
        inputs=inputs,
        background="",
        wanted=part.results,
        rates=rates,
        narrow=frozenset(part.arrays) if single else frozenset(),
    )
    if single:
        program = _with_exact_depth(program)
    program = passes.assign_formats(program, variant, exact=part.name in ("span", "near"))
    if part.name in _SCALED:
        program = passes.scale_lengths(program, farthest=30 if single else 60)
    for step in (
        passes.regularise,
        lambda p: passes.lower_powers(p, FUNCTIONS[variant.powers]),
        passes.place,
        passes.hoist,
        passes.share,
        passes.place,
        freeze,
        convert_formats,
        passes.prune,
        passes.arrange,
    ):
        program = step(program)
        program.check()
    return program


def _with_exact_depth(program: KernelProgram) -> KernelProgram:
    """The distance of a hit from a root in float64: depths that nearly meet are told apart as well as in `double`.

    hit_distance = ... / (ahead + facing)  ->  wide_facing = sqrt(facing2); hit_distance = ... / (ahead + wide_facing)
    """
    if "hit_distance" not in program or "facing2" not in program:
        return program
    steps: list[Step] = []
    for step in program.steps:
        if step.name == "hit_distance":
            wide = Step("wide_facing", sp.sqrt(symbol("facing2")), step.section, "facing, in float64")
            change = {symbol("facing"): wide.symbol}
            steps += [wide, replace(step, value=step.value.xreplace(change))]
        else:
            steps.append(step)
    return program.with_steps(steps)
