"""What is dominated by what, and what each step along the front buys.

Comes in: entries with times and errors. Goes out: the same with `dominated_by`, and Steps. Never done here: a
measurement.

Two fronts: of kernels that take any scene's numbers, and, below it, of those with this scene's numbers baked in, which
a new scene pays for anew (break_even.py says when that pays). A baked kernel dominates baked ones only.

A way is dominated where one of the front is no slower, flips no more points, gives no more values that are not finite,
and has a largest error that is no larger by more than a tenth: a slower way has to buy something. Hit-or-miss flips are
an axis of their own: what is fast and wrong at an outline is on the front only while nothing sound is as fast.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

from msgspec.structs import replace

from symrender_cg.cost.report import Entry, Step

LEAST_GAIN = 1.1
OTHER_IMAGE, OTHER_PLAN = "another image", "a general kernel"
BESIDE = (OTHER_IMAGE, OTHER_PLAN)
"""Stand in place of a dominating way where nothing dominates and yet the way is on no front."""


def beside(entry: Entry) -> str:
    """Why a way stands beside the front, or nothing: four rays a pixel and grey levels round it are another image."""
    if entry.kind == "samples" or entry.target == "uint8":
        return OTHER_IMAGE
    return OTHER_PLAN if entry.kind == "general" else ""


def dominates(one: Entry, other: Entry) -> bool:
    """Whether `one` is no slower, no more wrong, and as accurate but for LEAST_GAIN."""
    return (
        one.ns.median <= other.ns.median
        and _wrong(one) <= _wrong(other)
        and one.errors.largest <= other.errors.largest * LEAST_GAIN
    )


def _wrong(entry: Entry) -> int:
    return entry.errors.flips + entry.errors.nonfinite


def with_front(entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """Every entry with the most accurate way of the front that dominates it; of equals the first is on the front."""
    everything = tuple(entries)
    fronts: dict[bool, list[Entry]] = {False: [], True: []}
    found: dict[str, str] = {}
    for entry in sorted(everything, key=lambda e: (e.ns.median, e.errors.largest, _wrong(e), e.name)):
        rivals = fronts[False] + (fronts[True] if entry.bake else [])
        better = [rival for rival in rivals if dominates(rival, entry)]
        best = min(better, key=lambda rival: (rival.errors.largest, _wrong(rival), rival.ns.median), default=None)
        if best is not None:
            found[entry.name] = best.name
        elif (reason := beside(entry)) != "":
            found[entry.name] = reason
        else:
            fronts[entry.bake].append(entry)
    return tuple(replace(entry, dominated_by=found.get(entry.name, "")) for entry in everything)


def steps_along(entries: Sequence[Entry]) -> tuple[Step, ...]:
    """From each way of the front that is sound to the next: slower, and more accurate.

    What flips is left out of the walk, but for its fastest: the first step says what soundness costs.
    """
    front = sorted((entry for entry in entries if entry.on_front and not entry.bake), key=lambda e: e.ns.median)
    sound = [entry for entry in front if entry.errors.sound]
    walk = [entry for entry in front[:1] if not entry.errors.sound] + sound
    return tuple(
        Step(
            before.name,
            after.name,
            after.ns.median / before.ns.median,
            before.errors.largest,
            after.errors.largest,
            before.errors.flips,
            after.errors.flips,
        )
        for before, after in pairwise(walk)
    )
