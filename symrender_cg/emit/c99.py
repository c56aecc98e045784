"""`emit(...)` -> the C text of one kernel: its .c, its .h, the support headers it uses, and its cffi declarations.

The functions' bodies are sympy.codegen.ast declarations printed by `KernelPrinter`; what surrounds them (loops, entry
points, comments) is in templates/kernel.c.j2 and kernel.h.j2, which contain no mathematics of the image.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import jinja2

from symrender_cg.derive.exact import SignTest
from symrender_cg.derive.symbols import INPUTS
from symrender_cg.emit.bodies import Bodies, counts, operations
from symrender_cg.emit.settling import settling
from symrender_cg.emit.stages import stages_of
from symrender_cg.lower.nodes import Call, walk
from symrender_cg.lower.program import RATES, KernelProgram
from symrender_cg.lower.variants import Variant
from symrender_cg.plan.plan import Plan
from symrender_cg.resources import template_path, templates
from symrender_cg.version import VERSION

SUPPORT = {
    "inline.h": None,
    "span.h": None,
    "units.h": ("unit_exponent", "light_exponent", "point_unit"),
    "square.h": ("square",),
    "block.h": None,
    "phong_power.h": ("power", "powerf", "power_of_cosine", "power_of_cosinef"),
    "lobe_power.h": ("log2_of_lobe", "log2_of_lobef"),
    "fast_power.h": ("fast_powerf", "fast_power_of_cosinef", "fast_log2_of_lobef", "fast_log2_of_squaref"),
    "coarse_power.h": ("coarse_powerf", "coarse_power_of_cosinef"),
    "libm_power.h": ("libm_power", "libm_powerf", "libm_power_of_cosine", "libm_power_of_cosinef"),
    "double_double.h": ("dd_",),
    "pair.h": ("pair_",),
    "precise_power.h": ("precise_power_of_cosine",),
    "whole_power.h": ("whole_powers_of_square", "whole_powers_of_pair"),
    "exact_sign.h": None,
    "range.h": None,
    "settle.h": None,
}
"""Support headers and the functions that call for them, in the order in which they are included."""

CARRIED = {
    "whole_power.h": ("pair.h", "double_double.h"),
    "phong_power.h": ("power.h",),
    "fast_power.h": ("power.h",),
    "coarse_power.h": ("fast_power.h", "power.h"),
    "lobe_power.h": ("power.h",),
    "precise_power.h": ("power.h",),
}
"""Headers that a support header includes itself."""


@dataclass(frozen=True, slots=True)
class Emitted:
    """The text of a kernel. `files` maps file names to text (the kernel's own two first); `cdef` is what cffi reads.

    `fields` are names and shapes of a scene kernel's structure, see symrender_cg.emit.scene_fields.
    """

    name: str
    files: Mapping[str, str]
    cdef: str
    inputs: tuple[str, ...]
    result_type: str
    operations: dict[str, dict[str, int]]
    fields: tuple[tuple[str, str], ...] = ()


def emit(
    program: KernelProgram,
    *,
    plan: Plan,
    variant: Variant,
    sign_tests: Sequence[SignTest],
    command: str,
    numbers: Mapping[str, float] | None = None,
    name: str | None = None,
) -> Emitted:
    """C99 text of a lowered kernel. `command` is the line that regenerates it; `numbers` are those baked in."""
    kernel = name or program.name

    def place(factor: str) -> str:
        if factor in ("x", "y"):
            return factor
        return repr(float(numbers[factor])) if numbers is not None else f"scene->{factor}"

    writer = Bodies(program, baked=numbers is not None)
    twins = tuple(program[entry] for stage in program.stages[: program.twins] for entry in stage)
    shared = tuple(program[entry] for stage in program.stages[program.twins : program.mirrored] for entry in stage)
    uses = {node.function for step in program.steps for node in walk(step.value) if isinstance(node, Call)}
    uses |= {program.shortcut.function} if program.shortcut else set()
    formats = {step.format for step in program.steps}
    always = {"inline.h"}
    always |= {"exact_sign.h"} if variant.exact and (program.ends or not variant.settles) else set()
    always |= {"span.h"} if program.ends else set()
    always |= {"block.h"} if program.stages else set()
    always |= {"units.h"} if variant.exact and not program.ends else set()
    always |= {"double_double.h"} if "double_double" in formats else set()
    always |= {"pair.h"} if "pair" in formats else set()
    always |= {"range.h", "settle.h"} if variant.settles else set()
    includes = [h for h, functions in SUPPORT.items() if h in always or uses & set(functions or ())]
    context = {
        "name": kernel,
        "version": VERSION,
        "command": command,
        "plan": plan,
        "variant": variant,
        "baked": numbers is not None,
        "baked_numbers": ", ".join(f"{key} {value:.6g}" for key, value in (numbers or {}).items()),
        "includes": includes,
        "real": variant.c_type,
        "single": variant.shading == "float32",
        "side_type": "float" if variant.shading == "float32" else "double",
        "span": program.ends is not None,
        "exact": variant.exact,
        "scaled": "plane_unit" in program,
        "counts": {rate: counts(program.at(rate)) for rate in RATES},
        "fields": [(row.name, row.meaning) for row in INPUTS if f"scene_{row.name}" in program.inputs],
        "sign_tests": [printed_test(test, place) for test in sign_tests],
        "result": program.result,
        "tests_front": len(program.hit) > 1,
        "sight": program.hit,
        "twin_counts": counts(twins) if twins else "",
        "shared_counts": counts(shared) if shared else "",
        "stages": stages_of(program, writer.frame_places, writer.pixel_places),
        "writer": writer,
    }
    if variant.settles:
        assert numbers is None, "a kernel that bounds its error has its numbers as arguments"
        context |= settling(program, writer)
    template = "settling.c.j2" if variant.settles else "kernel.c.j2"
    source = environment().get_template(template).render(context)
    header = environment().get_template("kernel.h.j2").render(context)
    files = {f"{kernel}.c": source, f"{kernel}.h": header}
    files |= support_files(("grid.h", *includes))
    return Emitted(
        name=kernel,
        files=files,
        cdef=environment().get_template("kernel.cdef.j2").render(context),
        inputs=tuple(entry.removeprefix("scene_") for entry in program.inputs),
        result_type=str(context["real"]),
        operations={rate: dict(operations(program.at(rate))) for rate in RATES if rate != "sphere"},
    )


def support_files(headers: Sequence[str]) -> dict[str, str]:
    """The texts of support headers and of those that they include themselves, by name."""
    wanted = dict.fromkeys((*headers, *(inner for header in headers for inner in CARRIED.get(header, ()))))
    return {header: template_path(f"support/{header}").read_text(encoding="utf-8") for header in wanted}


@cache
def environment() -> jinja2.Environment:
    """The templates, as jinja2 reads them."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates()),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def printed_test(test: SignTest, place: Callable[[str], str]) -> dict[str, object]:
    """A sign test with its factors as C expressions, padded with 1 to four; `place` says where a factor lives."""
    products = []
    for monomial in test.monomials:
        factors = [place(factor) for factor in monomial.factors]
        products.append((monomial.coefficient, [*factors, *["1.0"] * (4 - len(factors))]))
    return {"name": test.name, "compare": "> 0" if test.strict else ">= 0", "products": products}
