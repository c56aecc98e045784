"""Pairs of float64 arrays, hi + lo: exact sums and products, and the determinants and squares made of them.

Comes in: float64 arrays, alone or in two parts. Goes out: pairs. Never done here: a test for overflow: sizes stay below
2^990 and products above the subnormal numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Pair: TypeAlias = tuple[Floats, Floats]


def determinant(p: Pair, q: Pair, dp: Floats, dq: Floats) -> Pair:
    """p dq - q dp with p and q in two parts."""
    first, first_low = two_product(p[0], dq)
    second, second_low = two_product(q[0], dp)
    high, low = two_sum(first, -second)
    low = low + ((first_low - second_low) + (p[1] * dq - q[1] * dp))
    total = high + low
    return total, low - (total - high)


def square_sum(values: Sequence[tuple[Floats, Floats | None]]) -> Pair:
    """The sum of the squares of three numbers, each alone or in two parts."""
    total, rest = two_product(values[0][0], values[0][0])
    if values[0][1] is not None:
        rest = rest + 2.0 * values[0][0] * values[0][1]
    for value, value_rest in values[1:]:
        square, square_rest = two_product(value, value)
        if value_rest is not None:
            square_rest = square_rest + 2.0 * value * value_rest
        total, error = two_sum(total, square)
        rest = rest + (error + square_rest)
    return total, rest


def two_sum(a: Floats, b: Floats) -> Pair:
    """a + b = sum + error, exactly (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def two_product(a: Floats, b: Floats) -> Pair:
    """a b = product + error, exactly short of subnormal numbers (Veltkamp, Dekker); sizes below 2^990."""
    product = a * b
    a_high, a_low = _split(a)
    b_high, b_low = _split(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _split(a: Floats) -> Pair:
    wide = a * 134217729.0
    high = wide - (wide - a)
    return high, a - high
