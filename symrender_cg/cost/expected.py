"""What a way that was not timed may take, as a ratio to `double`, so that what may be fastest is looked at first.

Comes in: ways, ratios measured for the plan, ratios usual on this machine. Goes out: a ratio. It decides the order in
which kernels are built and when to stop, never what is chosen: that is measured. Never done here: a measurement.

    timed for this plan           that
    another way of its level is   its ratio, times the guesses of the two
    otherwise                     the guess: usual on this machine, else LEVELS times MOVES

What coordinates save or cost is nearly independent of one another, so that products are good to some 10 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from symrender_cg.cost.variants import Way

LEVELS: Final = {"fast": 0.65, "single": 0.68, "double": 1.0}
MOVES: Final = {
    "coarse": 0.98,
    "fast": 1.05,
    "own": 1.0,
    "libm": 3.0,
    "tested": 4.0,
    "complement": 0.93,
    "side": 1.05,
    "inner": 0.84,
    "fused": 0.97,
    "whole": 1.5,
    "lopsided": 1.1,
}
BAKED: Final = 0.9
PLANNED: Final = 0.9
"""What a plan within a tolerance may save; how much it does depends on what it leaves out."""


def expected(way: Way, timed: Mapping[str, float], usual: Mapping[str, float], ways: Sequence[Way]) -> float:
    """The ratio to `double` that a way may have; `ways` are those that names in `timed` may be of."""
    if way.name in timed:
        return timed[way.name]
    near = [one for one in ways if one.name in timed and one.level == way.level and one.tolerance == way.tolerance]
    if not near:
        return _guess(way, usual)
    nearest = min(near, key=lambda one: (_apart(one, way), one.name))
    known = usual if way.name in usual and nearest.name in usual else {}
    return timed[nearest.name] * _guess(way, known) / _guess(nearest, known)


def _guess(way: Way, usual: Mapping[str, float]) -> float:
    if way.name in usual:
        return usual[way.name]
    ratio = LEVELS.get(way.level, 2.0) * math.prod(MOVES.get(name, 1.0) for name in way.choices)
    return ratio * (BAKED if way.bake else 1.0) * (PLANNED if way.tolerance else 1.0)


def _apart(one: Way, other: Way) -> int:
    return len(set(one.choices) ^ set(other.choices)) + (one.bake != other.bake)
