"""Settling enclosures: what hi, lo, error say of the rounding of the true value, by numpy.

Comes in: an `Enclosure` and what is to be settled. Goes out: values, and where they are settled. Never done here: a
guess; what is not settled is somebody else's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.run.enclosure import Enclosure

FOUR_ULP = 2.0**-52
"""A value within half an ulp and this part of its size of the true one is within 3 ulp: ulp(v) >= |v| 2^-53."""


def settled(found: Enclosure, rule: str) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """The values by the rule "ulp", "float64", "float32" or "uint8", and whether they are settled."""
    return _RULES[rule](found)


def _ulp(found: Enclosure) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    exact = (found.error == 0.0) & (found.lo == 0.0)
    return found.hi, exact | (found.error <= FOUR_ULP * np.abs(found.hi))


def _float64(found: Enclosure) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """hi is the float64 nearest to hi + lo; it is that of the true value if it is that of both ends (Ziv 1991)."""
    room = np.where(found.error > 0.0, found.error * (1.0 + 2.0**-40) + 2.0**-52 * np.abs(found.lo), 0.0)
    with np.errstate(invalid="ignore"):
        same = (found.hi + (found.lo + room) == found.hi) & (found.hi + (found.lo - room) == found.hi)
    return found.hi, same


def _float32(found: Enclosure) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Both ends of the enclosure, moved outwards in float64, round to one float32."""
    exact = (found.error == 0.0) & (found.lo == 0.0)
    room = np.where(exact, 0.0, found.error + np.abs(found.lo) + 2.0**-50 * np.abs(found.hi))
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = (found.hi - room).astype(np.float32), (found.hi + room).astype(np.float32)
    return high, low == high  # of -0.0 and 0.0 the latter


def _uint8(found: Enclosure) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """floor(255 v + 1/2), where 255 v is farther from a jump than the enclosure is wide.

    255 hi = 256 hi - hi = p + e exactly (TwoSum), and p - floor(p) - 1/2 is exact.
    """
    reach = np.abs(found.lo) + found.error
    above, below = found.hi - reach >= 1.0, found.hi + reach <= 0.0
    hi, lo = np.where(above | below, 0.0, found.hi), np.where(above | below, 0.0, found.lo)
    p = 256.0 * hi - hi
    seen = p - 256.0 * hi
    e = (256.0 * hi - (p - seen)) + (-hi - seen)
    whole = np.floor(p)
    rest = e + 255.0 * lo
    beyond = ((p - whole) - 0.5) + rest
    level = np.where(beyond >= 0.0, whole + 1.0, whole)
    room = np.where(
        (found.error == 0.0) & (lo == 0.0),
        -1.0,
        255.0 * found.error * (1.0 + 2.0**-40) + 2.0**-50 * (np.abs(e) + 255.0 * np.abs(lo)),
    )
    level = np.where(above, 255.0, np.where(below, 0.0, np.clip(level, 0.0, 255.0)))
    with np.errstate(invalid="ignore"):
        return level.astype(np.uint8), above | below | (np.abs(beyond) > room)


_RULES = {"ulp": _ulp, "float64": _float64, "float32": _float32, "uint8": _uint8}
