"""The table that `build` prints of kernels that were derived: stages, passes or parts, and the swell meter."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import sympy as sp

from symrender_cg import pipeline
from symrender_cg.cli.build import Built
from symrender_cg.cli.console import Column, Table, counted, duration, listed
from symrender_cg.cli.timing import nanoseconds_a_pixel
from symrender_cg.explain import swollen_operations
from symrender_cg.explain.operations import by_rate, swell_of
from symrender_cg.lower.program import operations_of
from symrender_cg.pipeline import SceneTranslation, SphereTranslation, Translation

_COLUMNS = (
    Column("stage"),
    Column("time", right=True),
    Column("operations", right=True),
    Column("after", right=True),
    Column("result"),
)
_SWELL = (
    ("t_hit", "t"),
    ("n.l", "n_dot_l"),
    ("r.v", "r_dot_v"),
    ("shading", "value"),
    ("image", "image"),
)


def build_table(kernels: Sequence[Built], *, passes: bool) -> Table:
    """Stages of every kernel with their time and operations, then the swell meter. Of a scene: part by part."""
    table = Table(_COLUMNS)
    first = kernels[0].translation
    assert first is not None, "a fresh kernel has its translation"
    closed = swollen_operations(first.image) if isinstance(first, SphereTranslation) else {}
    for built in kernels:
        translation = built.translation
        assert translation is not None, "a fresh kernel has its translation"
        table.section()
        table.add(built.name)
        if isinstance(translation, SphereTranslation):
            _sphere_rows(table, built, translation, closed["image"], passes=passes)
        else:
            _scene_rows(table, built, translation, passes=passes)
    table.section()
    table.add("swell meter", "", "one formula", "named", "operations as sympy counts them, then those of the kernels")
    if isinstance(first, SphereTranslation):
        for label, name in _SWELL:
            if name in closed:
                inside = [f"{built.order.kernel} {_kernel_operations(built, name) or '-'}" for built in kernels]
                table.add(f"  {label}", "", str(closed[name]), str(_named_operations(first, name)), ", ".join(inside))
    else:
        _part_swell(table, kernels)
    return table


def _sphere_rows(table: Table, built: Built, translation: SphereTranslation, image: int, *, passes: bool) -> None:
    seconds = translation.seconds
    named = translation.image.operations()
    _plan_row(table, translation)
    definitions = counted(len(translation.image.definitions), "named definition")
    table.add("  derive", duration(seconds["derive"]), str(image), str(named), f"one formula -> {definitions}")
    total = sum(translation.program.operations().values())
    listed_by = "" if passes else " (--passes lists them)"
    ran = f"{len(translation.passes)} passes{listed_by}: {_rates(translation)}"
    table.add("  lower", duration(seconds["lower"]), str(named), str(total), ran)
    if passes:
        before = named
        for stage in translation.passes:
            after = sum(stage.operations.values())
            steps = counted(len(stage.program.steps), "step")
            table.add(f"    {stage.name}", duration(stage.seconds), str(before), str(after), steps)
            before = after
    _last_rows(table, built, translation)


def _scene_rows(table: Table, built: Built, translation: SceneTranslation, *, passes: bool) -> None:
    seconds, parts = translation.seconds, translation.parts
    swells = {name: swell_of(part, translation.programs[name]) for name, part in parts.items()}
    closed, named, kernel = (
        str(sum(getattr(swell, kind) for swell in swells.values())) for kind in ("closed", "named", "kernel")
    )
    _plan_row(table, translation)
    definitions = counted(sum(len(part.definitions) for part in parts.values()), "named definition")
    table.add(
        "  derive", duration(seconds["derive"]), closed, named, f"{counted(len(parts), 'part')} with {definitions}"
    )
    table.add("  lower", duration(seconds["lower"]), named, kernel, _rates(translation))
    if passes:
        for name, swell in swells.items():
            rates = ", ".join(
                f"{sum(counts.values())} a {rate}" for rate, counts in by_rate(translation.programs[name]).items()
            )
            table.add(f"    {name}", "", str(swell.named), str(swell.kernel), rates)
    _last_rows(table, built, translation)


def _plan_row(table: Table, translation: Translation) -> None:
    decisions = translation.plan.decisions
    needed = [d.effect.name for d in decisions if d.needed]
    out = f"{listed(needed)} in, {len(decisions) - len(needed)} effects proved away"
    table.add("  plan", duration(translation.seconds["plan"]), "", "", out)


def _rates(translation: Translation) -> str:
    """`12 a frame, 30 a row, 40 a pixel`"""
    operations = translation.emitted.operations
    return ", ".join(f"{sum(counts.values())} a {rate}" for rate, counts in operations.items())


def _last_rows(table: Table, built: Built, translation: Translation) -> None:
    emitted = translation.emitted
    lines = {name: text.count("\n") for name, text in emitted.files.items()}
    spent = duration(translation.seconds["emit"])
    table.add("  emit", spent, "", "", f"{emitted.name}.c, {lines[f'{emitted.name}.c']} lines")
    if built.order.bake:
        table.add("  bake", "", "", "", _saved(built))
    made = "the library was in the cache" if built.cached.from_cache else "compiled"
    table.add("  build", duration(built.seconds), "", "", made)


def _part_swell(table: Table, kernels: Sequence[Built]) -> None:
    """A line a part: its results as one formula each, its named definitions, its steps in every kernel that has it.

    Enclosures have parts of their own; where a part is in several kernels, its definitions are those of the first.
    """
    translations = []
    for built in kernels:
        assert isinstance(built.translation, SceneTranslation), "kernels of one scene are of one kind"
        translations.append((built.order.kernel, built.translation))
    for name in dict.fromkeys(name for _, translation in translations for name in translation.parts):
        having = [(kernel, translation) for kernel, translation in translations if name in translation.parts]
        inside = [f"{kernel} {sum(t.programs[name].operations().values())}" for kernel, t in having]
        _, first = having[0]
        swell = swell_of(first.parts[name], first.programs[name])
        table.add(f"  {name}", "", str(swell.closed), str(swell.named), ", ".join(inside))


def _named_operations(translation: SphereTranslation, name: str) -> int:
    """Operations of the definitions that the quantity rests on, each counted once."""
    image = translation.image
    if name == "image":
        return image.operations()
    needed, total = {name}, 0
    for definition in reversed(image.definitions):
        if definition.name in needed:
            total += int(sp.count_ops(definition.value))
            needed |= {s.name for s in definition.value.free_symbols}
    return total


def _kernel_operations(built: Built, name: str) -> int | None:
    """Operations of the kernel's steps that the quantity rests on; None where the kernel has no such step."""
    assert isinstance(built.translation, SphereTranslation), "kernels of one scene are of one kind"
    program = built.translation.program
    if name == "image":
        return sum(program.operations().values())
    wanted = program.result if name == "value" else name
    if wanted not in program:
        return None
    needed = {wanted}
    total: Counter[str] = Counter()
    for step in reversed(program.steps):
        if step.name in needed:
            total += operations_of(step)
            needed |= step.uses()
    return sum(total.values())


def _saved(built: Built) -> str:
    """What baking saved: operations with the numbers as arguments, without, and after how many pixels it pays."""
    order = built.order
    assert built.translation is not None, "a fresh kernel has its translation"
    free = pipeline.translate(order.scene, order.accuracy)
    before = {rate: sum(counts.values()) for rate, counts in free.emitted.operations.items()}
    after = {rate: sum(counts.values()) for rate, counts in built.translation.emitted.operations.items()}
    parts = ", ".join(f"{before[rate]} -> {after[rate]} a {rate}" for rate in before)
    slow, fast = (
        nanoseconds_a_pixel(order.scene, order.accuracy, bake=bake, portable=order.portable) for bake in (False, True)
    )
    text = f"{parts}; {slow:.2f} -> {fast:.2f} ns a pixel"
    cost = sum(built.translation.seconds.values()) + built.seconds
    if fast < slow:
        return f"{text}, pays after {cost / (slow - fast) * 1e9:.2g} pixels"
    return f"{text}, which saves nothing here"
