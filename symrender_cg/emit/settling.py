"""What templates/settling.c.j2 needs of a kernel that bounds its own error: its steps in ranges, printed."""

from __future__ import annotations

from symrender_cg.emit.bodies import Bodies, body
from symrender_cg.lower.program import KernelProgram
from symrender_cg.lower.ranges import to_ranges


def settling(program: KernelProgram, writer: Bodies) -> dict[str, object]:
    """The entries of the template's context, by name."""
    facing_light, specular = "n_dot_l" in program, "w_dot_mirror" in program
    results = [program.result]
    results += ["n_dot_l"] if facing_light else []
    results += ["w_dot_mirror", "w2", "farthest2"] if specular else []
    return {
        "lit": facing_light or specular,
        "facing_light": facing_light,
        "specular": specular,
        "gated": specular and "n_dot_l" in program["specular"].uses(),
        "range_lines": body(to_ranges(program, tuple(results)), dict.fromkeys(program.inputs, "scene->")),
        "word": writer.word,
    }
