"""Fission: the steps of a pixel cut into stages, each to become a short loop over a block of pixels.

Comes in: a frozen, pruned and arranged KernelProgram. Goes out: the same one with its `stages`. Never done here: a
change of a value, or of what is computed; that is why kernels with and without stages give the same bits.

Why it pays: a processor looks some hundred operations ahead. The steps of a pixel wait for one another, through square
roots, divisions and two polynomials, for about 250 cycles, and one vector of pixels fills its view. In a loop of thirty
operations it sees several vectors at once, and while one waits another goes on. What one stage leaves for a later one
crosses in an array of a block, which stays in the first level cache.

Where to cut: where the cycles of the stages and of the values that cross, by a model of four numbers, sum to the least
(dynamic programming over the places between two steps).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

from symrender_cg.lower.formats import WIDE
from symrender_cg.lower.nodes import Call, Cast, Quotient, Root, walk
from symrender_cg.lower.program import KernelProgram, Shortcut, Step, operations_of
from symrender_cg.lower.symmetry import alike_in_twin_rows, parities

ISSUED, IN_VIEW, CROSSING, LOOP = 3.0, 100.0, 1.0, 1.0
"""Operations issued a cycle; operations at which a stage takes as many cycles, by waiting; cycles of a value that
crosses, and of a loop. Fitted to stages measured on AMD Zen 5. What matters: short loops win, and a cut has a price."""

IN_VIEW_OF_PAIRS = 400.0
"""The same where the operations are those of pairs: half of them wait for none of the others."""

_SLOW: Mapping[type, int] = {Quotient: 4, Root: 7}
"""Divisions and square roots keep their unit busy for so many cycles."""

_CALLS: Mapping[str, int] = {
    "square": 1,
    **dict.fromkeys(("log2_of_lobe", "log2_of_lobef"), 36),
    **dict.fromkeys(("power_of_lobe", "power_of_lobef"), 31),
    "fast_log2_of_lobef": 24,
    "fast_log2_of_squaref": 20,
    "fast_power_of_lobef": 20,
}
_OTHER_CALL = 60
"""A whole power."""

_WIDE_CALLS: Mapping[str, int] = {
    **dict.fromkeys(("dd_from", "dd_neg", "dd_scale", "pair_select"), 2),
    "dd_product": 2,
    **dict.fromkeys(("dd_sum", "dd_difference", "pair_normalised"), 6),
    **dict.fromkeys(("pair_mul_double", "pair_positive_part"), 3),
    **dict.fromkeys(("pair_mul", "pair_square"), 4),
    "pair_add_double": 7,
    **dict.fromkeys(("pair_add", "pair_sub"), 8),
    **dict.fromkeys(("pair_inverse", "pair_div"), 9),
    "pair_sqrt": 18,
    **dict.fromkeys(("dd_add_double", "dd_mul", "dd_mul_double"), 10),
    **dict.fromkeys(("dd_add", "dd_sub"), 20),
    "precise_power_of_cosine": 180,
}
"""Operations of double_double.h, pair.h and precise_power.h."""

_SIMPLE = ("add", "mul", "max", "select")


def cut(program: KernelProgram, *, fission: bool, symmetry: bool, twins: bool) -> KernelProgram:
    """The program with the steps of its pixels in stages; the first `mirrored` of them are the same for x and -x, the
    first `twins` of these for y and -y too.

    ray, normal, light, diffuse, specular  ->  (ray, normal), (what x and -x share), (light, diffuse), (log2), (2^y)
    """
    outcome = {program.result, *program.judged}
    if all(step.name != program.result for step in program.at("pixel")):
        return program  # the value is the same everywhere
    anchors = dict(program.anchors)
    pixel = _leading_to([step for step in program.at("pixel") if step.name not in anchors], outcome)
    parity = parities(program) if symmetry else {}
    shared = _leading_to(pixel, parity) if parity else ()
    names = {step.name for step in shared}
    rest = tuple(step for step in pixel if step.name not in names)
    alike = alike_in_twin_rows(program) if twins and shared else frozenset()
    halves = [part for part in _parted(shared, alike) if part]
    first = tuple(stage for part in halves for stage in _stages(part, (*halves, rest), outcome, fission))
    in_both = sum(set(stage) <= alike for stage in first)
    parts = _around(rest, program.shortcut)
    last = tuple(stage for part in parts for stage in _stages(part, parts, outcome, fission))
    stages = (*first, *last)
    if program.shortcut is None:
        return replace(program, stages=stages, mirrored=len(first), twins=in_both)
    replaced = {step.name for step in _standing_for(rest, program.shortcut)}
    where = tuple(number for number, names in enumerate(stages) if set(names) <= replaced)
    assert {name for number in where for name in stages[number]} == replaced, "what is replaced is in stages of its own"
    shortcut = replace(program.shortcut, stages=where)
    return replace(program, stages=stages, mirrored=len(first), twins=in_both, shortcut=shortcut)


def _parted(steps: tuple[Step, ...], names: Collection[str]) -> tuple[tuple[Step, ...], tuple[Step, ...]]:
    """Those with these names, and the others."""
    return tuple(s for s in steps if s.name in names), tuple(s for s in steps if s.name not in names)


def _standing_for(steps: tuple[Step, ...], shortcut: Shortcut) -> tuple[Step, ...]:
    """The steps that a shortcut saves: those that it replaces, and what is made of its source for them alone."""
    saved = set(shortcut.replaced)
    for step in reversed(steps):
        users = {other.name for other in steps if step.name in other.uses()}
        if step.name != shortcut.source and users and users <= saved and step.uses() <= {shortcut.source}:
            saved.add(step.name)
    return tuple(step for step in steps if step.name in saved)


def _around(steps: tuple[Step, ...], shortcut: Shortcut | None) -> tuple[tuple[Step, ...], ...]:
    """The steps before, of and after what a shortcut saves, which stands together: both halves of a power do."""
    if shortcut is None:
        return (steps,) if steps else ()
    saved = _standing_for(steps, shortcut)
    end = next(i for i, step in enumerate(steps) if step.name == shortcut.result)
    before = tuple(step for step in steps[:end] if step not in saved)
    return tuple(part for part in (before, saved, steps[end + 1 :]) if part)


def _stages(
    part: tuple[Step, ...], parts: Sequence[tuple[Step, ...]], outcome: set[str], fission: bool
) -> tuple[tuple[str, ...], ...]:
    """The stages of one part of the steps; what the parts after it use is kept."""
    after = parts[parts.index(part) + 1 :]
    needed = {name for later in after for step in later for name in step.uses()} | outcome
    return _cut(part, needed) if fission else (tuple(step.name for step in part),)


def cycles(stage: int, in_view: float = IN_VIEW) -> float:
    """About how many cycles a vector of pixels takes in a loop of that weight.

    Operations are issued some three at a time; how long they wait for one another grows with their square.
    """
    return LOOP + max(stage / ISSUED, stage * stage / in_view)


def weight(step: Step, *, wide: bool = False) -> int:
    """What a step is worth, in simple operations; twice that where it is of a `wide` format among narrower ones."""
    counted = operations_of(step)
    total = sum(counted[kind] for kind in _SIMPLE)
    for node in walk(step.value):
        total += 1 if isinstance(node, Cast) else _SLOW.get(type(node), 0)
        if isinstance(node, Call):
            total += _CALLS.get(node.function) or _WIDE_CALLS.get(node.function, _OTHER_CALL)
    return 2 * total if wide else total


def crossing(program: KernelProgram) -> tuple[tuple[str, ...], ...]:
    """For each stage the names that it leaves for later ones, in their order."""
    later: set[str] = set()
    found: list[tuple[str, ...]] = []
    for stage in reversed(program.stages):
        found.append(tuple(name for name in stage if name in later))
        later |= {used for name in stage for used in program[name].uses()}
    return tuple(reversed(found))


def _leading_to(steps: Sequence[Step], names: Iterable[str]) -> tuple[Step, ...]:
    needed = set(names)
    kept: list[Step] = []
    for step in reversed(steps):
        if step.name in needed:
            kept.append(step)
            needed |= step.uses()
    return tuple(reversed(kept))


def _cut(steps: Sequence[Step], needed: set[str]) -> tuple[tuple[str, ...], ...]:
    """The cheapest cuts."""
    if not steps:
        return ()
    names = [step.name for step in steps]
    last_use = {name: len(steps) if name in needed else i for i, name in enumerate(names)}
    for i, step in enumerate(steps):
        for name in step.uses() & last_use.keys():
            last_use[name] = max(last_use[name], i)
    narrow = any(step.format == "float32" for step in steps)
    weights = [weight(step, wide=narrow and step.format != "float32") for step in steps]

    in_view = IN_VIEW_OF_PAIRS if any(step.format == "pair" for step in steps) else IN_VIEW
    words = [2 if step.format in WIDE else 1 for step in steps]

    def crosses(at: int) -> int:
        return sum(words[i] for i, name in enumerate(names[:at]) if last_use[name] >= at)

    best: list[tuple[float, int]] = [(0.0, 0)]  # cycles of the stages so far, where the last one begins
    for end in range(1, len(steps) + 1):
        options = []
        for begin in range(end):
            carried = CROSSING * crosses(begin) if begin else 0.0
            options.append((best[begin][0] + carried + cycles(sum(weights[begin:end]), in_view), begin))
        best.append(min(options))
    stages: list[tuple[str, ...]] = []
    end = len(steps)
    while end:
        begin = best[end][1]
        stages.append(tuple(names[begin:end]))
        end = begin
    return tuple(reversed(stages))
