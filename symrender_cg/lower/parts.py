"""Parts of a scene's kernel through the passes: each `Part` of the derivation becomes a `KernelProgram` of its own.

The passes are those of the kernels of one sphere, in the same order; a part has no background and is never baked.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import sympy as sp

from symrender_cg.derive.parts import Part, low
from symrender_cg.derive.symbols import symbol
from symrender_cg.lower import passes
from symrender_cg.lower.formats import convert_formats
from symrender_cg.lower.freeze import freeze
from symrender_cg.lower.lower import FUNCTIONS
from symrender_cg.lower.nodes import call
from symrender_cg.lower.program import Format, KernelProgram, Rate, Step
from symrender_cg.lower.variants import Variant, variant

PRIMARY = frozenset({"span", "near", "plane"})
"""Parts that take the eye's ray, in the unit of the image plane."""

_SCALED = PRIMARY | {"lamp"}


def lower_part(part: Part, chosen: Variant) -> KernelProgram:
    """One part lowered; its inputs keep their names, those of the scene with `scene_` before them.

    What leads to results in two words is computed in the formats of `stable`; what leads to second words is, again.
    """
    steps = tuple(Step(d.name, d.value, d.section, d.meaning, d.source) for d in part.definitions)
    rates = tuple((name, cast(Rate, rate)) for name, rate in part.rates)
    inputs = tuple(name for name in part.inputs if name not in ("x", "y"))
    single = chosen.shading == "float32"
    if part.name == "glossy":  # 0 or 1, and of each point: in its own format
        chosen = replace(chosen, float64=chosen.float64 - {"zero_power"})
    program = KernelProgram(
        part.name,
        steps,
        hit=(),
        ends=part.ends,
        result="",
        inputs=inputs,
        background="",
        wanted=(*part.results, *(low(name) for name in part.second_words)),
        rates=rates,
        narrow=frozenset(part.arrays) if single else frozenset(),
    )
    if single:
        program = _with_exact_depth(program)
    program = passes.assign_formats(program, chosen, exact=part.name in ("span", "near"))
    program = _widened(program, part.in_full)
    program = _with_second_words(program, part.second_words, part.low_inputs)
    if part.name in _SCALED:
        program = passes.scale_lengths(program, farthest=30 if single else 60)
    for step in (
        passes.regularise,
        lambda p: passes.lower_powers(p, FUNCTIONS[chosen.powers], halves=chosen.passes.halves),
        passes.place,
        passes.hoist,
        passes.share,
        passes.place,
        passes.carry_slow_in_full,
        freeze,
        convert_formats,
        lambda p: _normalised(p, part.in_full),
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


def _widened(program: KernelProgram, in_full: tuple[str, ...]) -> KernelProgram:
    """Float64 steps that lead to the named ones get the formats of `stable`: pairs, or what it keeps in another."""
    rounded = _rounded(program, in_full)
    return program.with_steps(
        replace(step, format=_wide(step.name)) if step.name in rounded else step for step in program.steps
    )


def _with_second_words(program: KernelProgram, names: tuple[str, ...], low_inputs: tuple[str, ...]) -> KernelProgram:
    """What leads to the named steps once more, in the formats of `stable`, and what it has beyond them. They stay.

    n_x = a b  ->  n_x = a b; full_n_x = full_a full_b, a pair; n_x_low = full_n_x - n_x
    """
    rounded = _rounded(program, names)
    full = {symbol(name): symbol(f"full_{name}") for name in (*low_inputs, *sorted(rounded))}
    steps = [
        Step(f"full_{name}", symbol(name) + symbol(low(name)), "inputs in full", format="pair") for name in low_inputs
    ]
    for step in program.steps:
        steps.append(step)
        if step.name in rounded:
            value = step.value.xreplace(full)
            twin = replace(step, name=f"full_{step.name}", value=value, format=_wide(step.name))
            steps.append(replace(twin, meaning="", source=""))
        if step.name in names:
            left = Step(low(step.name), full[step.symbol] - step.symbol, step.section, "what rounding left")
            steps.append(replace(left, meaning=left.meaning if step.name == names[0] else ""))
    return program.with_steps(steps)


def _rounded(program: KernelProgram, names: tuple[str, ...]) -> frozenset[str]:
    """Float64 steps that lead to the named ones, without those that float64 holds exactly."""
    exact = variant("stable").float64
    needed = set(names)
    found: set[str] = set()
    for step in reversed(program.steps):
        if step.name in needed:
            needed |= step.uses()
            if step.format == "float64" and step.name not in exact:
                found.add(step.name)
    return frozenset(found)


def _wide(name: str) -> Format:
    return "double_double" if name in variant("stable").double_double else "pair"


def _normalised(program: KernelProgram, in_full: tuple[str, ...]) -> KernelProgram:
    """A pair that is handed on gets the nearest float64 as its first word: that alone is what light falls on.

    n_x = pair_mul(a, b)  ->  loose_n_x = pair_mul(a, b); n_x = pair_normalised(loose_n_x)
    """
    steps: list[Step] = []
    for step in program.steps:
        if step.name in in_full and step.format == "pair":
            loose = replace(step, name=f"loose_{step.name}")
            words = call("pair_normalised", loose.symbol)
            steps += [loose, replace(step, value=words, meaning="", source="", format="double_double")]
        else:
            steps.append(step)
    return program.with_steps(steps)
