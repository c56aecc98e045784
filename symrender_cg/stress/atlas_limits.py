"""What each level is held to in the failure atlas: the figure of its promise, or one of ours where it promises none.

Comes in: a level's name. Goes out: Limit, and where along an axis it is promised. Never done here: a measurement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from symrender_cg.stress.promises import LARGEST_SHININESS, NEAREST_LIGHT, promise_of

Measure: TypeAlias = Literal["absolute", "ulp"]


@dataclass(frozen=True, slots=True)
class Limit:
    """What a level is held to: an absolute error or one in ulp; `promised` False where the level itself states none."""

    measure: Measure
    most: float
    promised: bool = True

    def __str__(self) -> str:
        return f"{self.most:g} ulp" if self.measure == "ulp" else f"{self.most:.3g}"


HELD_TO: Final = {"literal": 1e-13, "single": 5e-6, "fast": 1.0 / 255.0}
"""Absolute errors by which levels are judged that promise none: ten times the largest of `literal` on ordinary scenes,
a few units of 1e-6, one grey level."""


def limit_of(level: str) -> Limit:
    """The figure of the level's promise, else what it is held to."""
    promise = promise_of(level)
    if promise.rounded:
        return Limit("ulp", 0.5)
    if promise.ulp < math.inf:
        return Limit("ulp", promise.ulp)
    if promise.absolute < math.inf:
        return Limit("absolute", promise.absolute)
    return Limit("absolute", HELD_TO.get(level, 1e-15), promised=False)


def promised_range(level: str, axis: str) -> tuple[float, float]:
    """Exponents of the axis' base between which the limit of the level is promised; elsewhere it only holds it up."""
    if limit_of(level).measure == "absolute":
        if axis == "light":
            return math.log10(NEAREST_LIGHT), math.inf
        if axis == "shininess":
            return -math.inf, math.log10(LARGEST_SHININESS)
    return -math.inf, math.inf
