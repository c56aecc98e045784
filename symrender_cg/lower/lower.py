"""The driver of the passes: an ordered tuple, each timed, counted and checked.

choose forms    ImageProgram -> KernelProgram     the variant's forms replace the textbook's definitions
formats         which quantity is float32, float64 or double-double
scale lengths   powers of two, so that no square overflows (exact variants)
regularise      every step total
lower powers    b^n: a chain of products, or a call
place, hoist    frame, row or pixel by the youngest symbol; the slow part of a sum apart
share           common subexpressions, format by format
freeze          trees of single operations
convert         operands rounded to their operation, double-double to calls
bake            frame steps to numbers (only when asked)
prune, arrange  what nothing uses is left out, sections are brought together
anchor          a pixel's place in its row, counted from the ends of the hits (float32; narrow products: before sharing)
cut             a pixel's steps in stages, the first ones the same for x and -x (kernels of one sphere that fill spans)
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import sympy as sp

from symrender_cg.derive import forms
from symrender_cg.derive.program import ImageProgram
from symrender_cg.derive.symbols import INPUTS, symbol
from symrender_cg.lower import passes
from symrender_cg.lower.anchors import anchor, narrow_products
from symrender_cg.lower.bake import bake
from symrender_cg.lower.fission import cut
from symrender_cg.lower.formats import convert_formats
from symrender_cg.lower.freeze import freeze
from symrender_cg.lower.program import KernelProgram, Step
from symrender_cg.lower.symmetry import gather_mirrored
from symrender_cg.lower.variants import Variant
from symrender_cg.plan.plan import Plan

FUNCTIONS = {
    "float64": {
        "power": "power",
        "cosine": "power_of_cosine",
        "log2": "log2_of_lobe",
        "exp2": "power_of_lobe",
        "whole": "whole_powers_of_lobe",
        "bounded": "whole_powers_of_square",
    },
    "float32": {
        "power": "powerf",
        "cosine": "power_of_cosinef",
        "log2": "log2_of_lobef",
        "exp2": "power_of_lobef",
        "whole": "whole_powers_of_lobef",
    },
    "fast": {
        "power": "fast_powerf",
        "cosine": "fast_power_of_cosinef",
        "log2": "fast_log2_of_lobef",
        "log2_of_square": "fast_log2_of_squaref",
        "exp2": "fast_power_of_lobef",
        "large": "fast_powers_of_lobef",
    },
    "pair": {"power": "power", "cosine": "precise_power_of_cosine", "bounded": "whole_powers_of_pair"},
    "coarse": {"power": "coarse_powerf", "cosine": "coarse_power_of_cosinef"},
    "libm": {"power": "libm_power", "cosine": "libm_power_of_cosine"},
    "libmf": {"power": "libm_powerf", "cosine": "libm_power_of_cosinef"},
}


@dataclass(frozen=True, slots=True)
class Stage:
    """One pass as it ran: seconds, operations after it, and the program that it gave."""

    name: str
    seconds: float
    operations: Counter[str]
    program: KernelProgram


def lower(
    image: ImageProgram, plan: Plan, variant: Variant, *, numbers: Mapping[str, float] | None = None
) -> tuple[KernelProgram, tuple[Stage, ...]]:
    """The kernel program of a variant, and a record of every pass. `numbers` bakes the scene's numbers in."""
    exponent = _whole_number(numbers)

    def baked_exponent(program: KernelProgram) -> KernelProgram:
        if exponent is None:
            return program
        n = {symbol("shininess"): sp.Integer(exponent), symbol("scene_shininess"): sp.Integer(exponent)}
        lobe = _cosine_chain(program, exponent)
        return lobe.with_steps(replace(step, value=_folded(step.value.xreplace(n))) for step in lobe.steps)

    def cut_in_stages(program: KernelProgram) -> KernelProgram:
        chosen = variant.passes
        return cut(program, fission=chosen.fission, symmetry=chosen.symmetry, twins=chosen.twins)

    staged = variant.staged and not plan.needs("front_test")
    anchored = staged and variant.passes.anchors and variant.shading == "float32"
    halves = staged and variant.passes.halves and variant.settles is None
    by_squaring = staged and variant.passes.fission and variant.passes.whole and numbers is None
    by_squaring = by_squaring and (halves or variant.settles is not None)
    whole = FUNCTIONS[variant.powers].get("bounded" if variant.settles else "whole") if by_squaring else None
    large = FUNCTIONS[variant.powers].get("large") if by_squaring else None
    sequence: list[tuple[str, Callable[[KernelProgram], KernelProgram]]] = [
        ("assign formats", lambda program: passes.assign_formats(program, variant)),
        ("scale lengths", passes.scale_lengths if variant.exact else _raw_inputs),
        ("regularise", passes.regularise),
        *((("whole exponent", baked_exponent),) if exponent is not None else ()),
        ("lower powers", lambda program: passes.lower_powers(program, FUNCTIONS[variant.powers], halves=halves)),
        *((("whole exponent", lambda program: passes.shortcut_power(program, whole)),) if whole else ()),
        *((("large exponent", lambda program: passes.shortcut_narrow_lobe(program, large)),) if large else ()),
        ("place", passes.place),
        ("hoist", passes.hoist),
        *((("narrow products", narrow_products),) if anchored else ()),
        *((("gather mirrored", gather_mirrored),) if staged and variant.passes.symmetry else ()),
        ("share", passes.share),
        ("place shares", passes.place),
        *((("carry slow steps in full", passes.carry_slow_in_full),) if variant.shading == "pair" else ()),
        ("freeze", freeze),
        ("convert formats", convert_formats),
        *((("bake", lambda program: bake(program, numbers)),) if numbers is not None else ()),
        ("prune", passes.prune),
        ("arrange", passes.arrange),
        *((("anchor", anchor),) if anchored else ()),
        *((("cut", cut_in_stages),) if staged else ()),
    ]
    start = time.perf_counter()
    program = choose_forms(image, plan, variant)
    stages = [Stage("choose forms", time.perf_counter() - start, program.operations(), program)]
    for name, step in sequence:
        start = time.perf_counter()
        program = step(program)
        program.check()
        stages.append(Stage(name, time.perf_counter() - start, program.operations(), program))
    return program, tuple(stages)


def choose_forms(image: ImageProgram, plan: Plan, variant: Variant) -> KernelProgram:
    """The variant's forms that fit the plan in place of the textbook's definitions, as the steps of a kernel."""
    off_axis, front_test = plan.needs("off_axis"), plan.needs("front_test")
    entries = (forms.form(name) for name in variant.forms)
    chosen = tuple(entry for entry in entries if entry.fits(image, off_axis=off_axis, front_test=front_test))
    ends = next((entry.ends for entry in chosen if entry.ends), None) if variant.fills else None
    wanted = ("extent_x", "extent_y") if variant.settles and ends else ()
    judged: tuple[str, ...] = ("facing2", "d_dot_d", "n_dot_l", "w_dot_mirror") if variant.settles else ()
    sight = ("d_dot_d",) if variant.exact else ()  # how sure a hit is, is in |D|^2
    program = forms.apply(image, chosen, keep=(*sight, *wanted))
    steps = tuple(Step(d.name, d.value, d.section, d.meaning, d.source) for d in program.definitions)
    order = [row.name for row in INPUTS]
    inputs = tuple(sorted((name for name in program.inputs if name not in ("x", "y")), key=order.index))
    name = f"{plan.name}_{variant.name}"
    held = {step.name for step in steps}
    judged = tuple(entry for entry in judged if entry in held)
    return KernelProgram(name, steps, program.guard, ends, program.value, inputs, program.background, wanted, judged)


def _raw_inputs(program: KernelProgram) -> KernelProgram:
    """Inputs under the names of the scene structure, unscaled."""
    raw = {symbol(name): symbol(f"scene_{name}") for name in program.inputs}
    return replace(
        program.with_steps(replace(step, value=step.value.xreplace(raw)) for step in program.steps),
        inputs=tuple(f"scene_{name}" for name in program.inputs),
        background=f"scene_{program.background}",
    )


def _whole_number(numbers: Mapping[str, float] | None) -> int | None:
    """The exponent that is worth a chain of products: a whole number of at most 1024, when numbers are baked."""
    if numbers is None or "shininess" not in numbers:
        return None
    shininess = Fraction(numbers["shininess"])
    return int(shininess) if shininess.denominator == 1 and shininess <= 1024 else None


def _folded(value: sp.Basic) -> sp.Basic:
    """A Piecewise whose condition became decided is its branch."""
    return value.doit() if value.has(sp.Piecewise) else value


def _cosine_chain(program: KernelProgram, exponent: int) -> KernelProgram:
    """cos2^(n/2) for a whole n: products of `lobe`, which is cos2, from sin2 where that is the more accurate.

    highlight = lobe^(n div 2), times sqrt(lobe) for an odd n
    """
    if "highlight" not in program:
        return program
    cos2, sin2, lobe = symbol("cos2"), symbol("sin2"), symbol("lobe")
    steps: list[Step] = []
    for step in program.steps:
        if step.name != "highlight":
            steps.append(step)
            continue
        better = sp.Piecewise((1 - sin2, sp.Rational(1, 2) - sin2 > 0), (cos2, True))
        better = cos2 if program["sin2"].value == 1 - cos2 else better
        steps.append(
            replace(step, name="lobe", value=better, meaning="(r.v)^2, accurate where r.v is near 1", source="")
        )
        whole = lobe ** (exponent // 2)
        steps.append(replace(step, value=whole * sp.sqrt(lobe) if exponent % 2 else whole))
    return program.with_steps(steps)
