"""A rigorous bound on |polynomial| over an interval, in Arb's ball arithmetic.

Comes in: a polynomial whose coefficients are balls. Goes out: a double that is nowhere exceeded, proved by enclosure
and not by sampling. Never done here: an estimate.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import flint

Ball = Any  # flint.arb and flint.arb_poly: python-flint has no complete type information
BallPolynomial = Any

PRECISION = 200
PIECES = 512


def bound_of_quotient(
    numerator: BallPolynomial,
    denominator: Callable[[Ball], Ball],
    interval: tuple[Fraction, Fraction],
) -> float:
    """An upper bound of |numerator(x) / denominator(x)| over the interval; a double, rounded up.

    On each of 512 pieces, numerator(c + h t) = sum of b_k t^k with |t| <= 1, so |numerator| <= sum |b_k|: no dependency
    between the terms is lost, however strongly they cancel. `denominator` maps a ball to a ball and may not contain 0.
    """
    lowest, highest = interval
    half_width = (highest - lowest) / (2 * PIECES)
    bounds = []
    with flint.ctx.workprec(PRECISION):
        for piece in range(PIECES):
            center, radius = ball(lowest + (2 * piece + 1) * half_width), ball(half_width)
            shifted = numerator(flint.arb_poly([center, radius]))
            above = sum((abs(coefficient) for coefficient in shifted.coeffs()), flint.arb(0))
            below = abs(denominator(center + radius * flint.arb(0, 1)))
            bounds.append(float((above / below).upper()))
    return max(bounds) * (1.0 + 2.0**-50)


def ball(value: Fraction) -> Ball:
    """The ball that encloses a rational."""
    return flint.arb(value.numerator) / flint.arb(value.denominator)
