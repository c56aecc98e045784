"""What a specialisation costs to build, what it saves a pixel, and after how many pixels it has paid.

Comes in: measured entries. Goes out: BreakEven, one a specialisation. Never done here: a measurement.

    baked              the scene's numbers folded in: a kernel of its own for every scene, so that deriving and
                       compiling it are paid again for each
    planned            the kernel of this plan against one with more effects in, that could draw other scenes too
    one sphere         the loops of one sphere against those of scenes

The general kernel is taken as built already: what pays is the whole build of the special one.
"""

from __future__ import annotations

from collections.abc import Sequence

from symrender_cg.cost.report import BreakEven, Entry
from symrender_cg.cost.variants import DEFAULT

_PLANS = {
    "+off_axis": "planned as centred",
    "+scene": "loops of one sphere",
    "unplanned": "planned: effects left out",
}


def break_evens(entries: Sequence[Entry], size: tuple[int, int]) -> tuple[BreakEven, ...]:
    """Every pair of a special and a general kernel among the entries."""
    by_name = {entry.name: entry for entry in entries}
    pairs = [
        ("numbers folded in", entry, by_name[entry.name.removesuffix(" baked")])
        for entry in entries
        if entry.kind == "baked" and entry.name.removesuffix(" baked") in by_name
    ]
    for suffix, what in _PLANS.items():
        general = by_name.get(f"{DEFAULT} {suffix}")
        if general is not None:
            pairs.append((what, by_name[DEFAULT], general))
    return tuple(break_even(what, special, general, size) for what, special, general in pairs)


def break_even(what: str, special: Entry, general: Entry, size: tuple[int, int]) -> BreakEven:
    """pixels = build / (time of the general kernel - time of the special one)."""
    build = special.derive + special.compile
    saved = general.ns.median - special.ns.median
    pixels = build / (saved * 1e-9) if saved > 0.0 else None
    images = None if pixels is None else pixels / (size[0] * size[1])
    return BreakEven(what, special.name, general.name, build, saved, pixels, images)
