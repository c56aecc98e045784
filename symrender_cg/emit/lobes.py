"""The loops of a highlight over points of a scene: what comes before its power, the power in halves, what follows.

Comes in: the part `glossy` lowered to a KernelProgram whose power is two steps, and where its numbers live. Goes out:
the lines of each loop, with what it leaves for the next ones. Never done here: a formula.

A processor looks some hundred operations ahead, and the power alone is two polynomials that wait for one another: in
loops of their own several vectors of points are on their way at once (lower/fission.py, for kernels of one sphere).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from symrender_cg.emit.bodies import body, closure
from symrender_cg.emit.printer import C_TYPES
from symrender_cg.lower.fission import weight
from symrender_cg.lower.nodes import Select, walk
from symrender_cg.lower.program import KernelProgram, Step

POWER = ("highlight_log2", "highlight")
"""The two halves of the power."""

_AGAIN = 3
"""A step of arrays alone that is worth so many operations is computed where it is used, and not stored."""


@dataclass(frozen=True, slots=True)
class Lobes:
    """Lines of the loops: before the power, its two halves, and after it; `left` are the arrays between them."""

    before: list[str]
    halves: tuple[list[str], ...]
    after: list[str]
    left: tuple[str, ...]


def lobes_of(program: KernelProgram, results: Sequence[str], places: Mapping[str, str], indent: str) -> Lobes | None:
    """The loops of a highlight, None where its power is one step; `places` are those of the arrays that others wrote.

    n_dot_l, cos2, sin2, highlight, cosine, lobe  ->  (n_dot_l, cos2, sin2, cosine), (log2), (2^y), (lobe)
    """
    if POWER[0] not in program:
        return None
    pixel = program.at("pixel")
    uses = {step.name: step.uses() for step in pixel}
    raised: set[str] = {*POWER}
    for step in pixel:
        if step.uses() & raised:
            raised.add(step.name)
    again: set[str] = set()
    for step in pixel:
        if step.name not in results and weight(step) <= _AGAIN and not (step.uses() & uses.keys()) - again:
            again.add(step.name)
    ending = [name for name in results if name in raised]
    after = closure([s for s in pixel if s.name in again or (s.name in raised and s.name not in POWER)], ending)
    power = [next(step for step in pixel if step.name == name) for name in POWER]
    needed = {name for step in (*power, *after) for name in step.uses()} - {step.name for step in after}
    wanted = needed | (set(results) - set(ending))
    before = closure([step for step in pixel if step.name not in raised], wanted)
    told = {step.name for step in before}
    left = tuple(name for name in (*(step.name for step in before), *POWER) if name in needed and name not in results)
    stored = dict(places) | dict.fromkeys(left, "p->{}[i]")
    here = {name for name in told if name not in results}
    first = body(before, stored | dict.fromkeys(here, ""), indent)
    return Lobes(
        [*first, "", *_stores((*(n for n in left if n in told), *(n for n in results if n in told)), indent)],
        tuple(_loop((step,), (step.name,), stored, indent) for step in power),
        _loop(after, tuple(ending), stored, indent),
        left,
    )


def _loop(steps: Sequence[Step], leaves: Sequence[str], places: Mapping[str, str], indent: str) -> list[str]:
    """The body of a loop: what is chosen from is read first, for a read under a condition stops vectorisation."""
    own = {step.name for step in steps}
    selects = [node for step in steps for node in walk(step.value) if isinstance(node, Select)]
    chosen = {branch.name for node in selects for branch in node.args[1:] if branch.is_Symbol}
    read = sorted(name for name in chosen - own if "[i]" in places.get(name, ""))
    kind = C_TYPES[steps[-1].format].name
    lines = [f"{indent}const {kind} {name} = {places[name].replace('{}', name)};" for name in read]
    lines += [""] if lines else []
    here = dict(places) | dict.fromkeys((*own, *read), "")
    return [*lines, *body(steps, here, indent), "", *_stores(leaves, indent)]


def _stores(names: Sequence[str], indent: str) -> list[str]:
    return [f"{indent}p->{name}[i] = {name};" for name in names]
