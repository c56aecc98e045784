"""Numbers in two words, hi + lo, in arrays: sums, products, quotients, roots, and vectors made of them.

In: pairs, hi the float64 nearest to hi + lo. Out: pairs, some roundings of 2^-104 off, relative to the largest of what
was added; and whether hi is known to be the nearest float64. Never here: whole numbers, or a test for overflow: sizes
stay within 2^400 and 2^-400.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symrender_cg.reference.pairs import Pair, two_product, two_sum

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]


def is_nearest(value: Pair, error: float | Floats) -> Truths:
    """Whether hi is the float64 nearest to all numbers that are at most that far from hi + lo (Ziv 1991)."""
    high, low = value
    return np.asarray((high + (low + error) == high) & (high + (low - error) == high))


def sum_of(terms: Sequence[Pair]) -> Pair:
    """The sum of some pairs."""
    high, low = terms[0]
    for more, rest in terms[1:]:
        high, error = two_sum(high, more)
        low = low + (error + rest)
    return _normalised(high, low)


def _normalised(high: Floats, low: Floats) -> Pair:
    """high + low for |low| <= |high|, without an error (Dekker)."""
    total = high + low
    return total, low - (total - high)


def product_of(a: Pair, b: Pair) -> Pair:
    """a b."""
    high, low = two_product(a[0], b[0])
    return _normalised(high, low + (a[0] * b[1] + a[1] * b[0]))


def quotient_of(a: Pair, b: Pair) -> Pair:
    """a / b."""
    first = a[0] / b[0]
    high, low = two_product(first, b[0])
    left = (a[0] - high) - low + a[1] - first * b[1]
    return _normalised(first, left / b[0])


def root_of(a: Pair) -> Pair:
    """The square root of a > 0."""
    first = np.sqrt(a[0])
    high, low = two_product(first, first)
    return _normalised(first, ((a[0] - high) - low + a[1]) / (2.0 * first))


# ---- vectors: the last axis is that of coordinates


def dot_of(a: Pair, b: Pair) -> Pair:
    """a . b"""
    high, low = product_of(a, b)
    return sum_of([(high[..., k], low[..., k]) for k in range(3)])


def cross_of(a: Pair, b: Pair) -> Pair:
    """a x b"""
    parts = []
    for i, j in ((1, 2), (2, 0), (0, 1)):
        first, second = (
            product_of(_coordinate(a, i), _coordinate(b, j)),
            product_of(_coordinate(a, j), _coordinate(b, i)),
        )
        parts.append(sum_of([first, (-second[0], -second[1])]))
    return np.stack([high for high, _ in parts], axis=-1), np.stack([low for _, low in parts], axis=-1)


def _coordinate(v: Pair, k: int) -> Pair:
    return v[0][..., k], v[1][..., k]


def unit_of(v: Pair) -> Pair:
    """v / |v|, scaled by a power of two first."""
    _, exponent = np.frexp(np.abs(v[0]).max(axis=-1))
    scale = np.ldexp(1.0, -exponent)[..., np.newaxis]
    scaled = v[0] * scale, v[1] * scale
    high, low = root_of(dot_of(scaled, scaled))
    return quotient_of(scaled, (high[..., np.newaxis], low[..., np.newaxis]))
