"""The polynomial of least weighted error: a function, an interval and a degree in, coefficients of 40 digits out.

Remez' exchange on a fixed grid, in mpmath. Comes in: the function and the weight as mpmath callables. Goes out: the
coefficients, lowest first, before any rounding to a machine format. Never done here: a claim about the error between
the grid's points; that is `supremum.py`, in ball arithmetic, on the rounded coefficients.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath

Real = Any  # mpmath.mpf: mpmath has no type information

DIGITS = 40
GRID = 400
EXCHANGES = 40


def fit_minimax(
    function: Callable[[Real], Real],
    weight: Callable[[Real], Real],
    interval: tuple[Real, Real],
    degree: int,
    *,
    digits: int = DIGITS,
) -> tuple[Real, ...]:
    """Coefficients c of the polynomial p with the least max of |weight (p - function)| over the interval's grid.

    The grid is Chebyshev's and avoids both ends, so function and weight may be singular there. The weight is positive.
    Remez, "Sur le calcul effectif des polynomes d'approximation de Tchebichef", 1934.
    """
    with mpmath.workdps(digits):
        middle, radius = (mpmath.mpf(interval[0]) + interval[1]) / 2, (mpmath.mpf(interval[1]) - interval[0]) / 2
        grid = [middle - radius * mpmath.cos(mpmath.pi * (2 * k + 1) / (2 * GRID)) for k in range(GRID)]
        values, weights = [function(x) for x in grid], [weight(x) for x in grid]
        points = [round((GRID - 1) * (k + 0.5) / (degree + 2)) for k in range(degree + 2)]
        coefficients: tuple[Real, ...] = ()
        for _ in range(EXCHANGES):
            coefficients = _levelled([(grid[k], values[k], weights[k]) for k in points], degree)
            errors = [
                w * (mpmath.polyval(coefficients[::-1], x) - f) for x, f, w in zip(grid, values, weights, strict=True)
            ]
            exchanged = _alternation(errors, degree + 2)
            if exchanged == points:
                return coefficients
            points = exchanged
        raise ArithmeticError(f"the exchange of degree {degree} did not settle within {EXCHANGES} steps")


def _levelled(samples: list[tuple[Real, Real, Real]], degree: int) -> tuple[Real, ...]:
    """The polynomial whose weighted errors at degree + 2 points are equal in size and alternate in sign."""
    rows = [[*(x**k for k in range(degree + 1)), (-1) ** i / w] for i, (x, _, w) in enumerate(samples)]
    solution = mpmath.lu_solve(mpmath.matrix(rows), mpmath.matrix([f for _, f, _ in samples]))
    return tuple(solution[k] for k in range(degree + 1))


def _alternation(errors: list[Real], count: int) -> list[int]:
    """Indices of the largest error in each run of one sign; if there are too many runs, the weaker end goes."""
    peaks = [0]
    for k, error in enumerate(errors):
        if error * errors[peaks[-1]] < 0:
            peaks.append(k)
        elif abs(error) > abs(errors[peaks[-1]]):
            peaks[-1] = k
    while len(peaks) > count:
        peaks.pop(0 if abs(errors[peaks[0]]) < abs(errors[peaks[-1]]) else -1)
    if len(peaks) < count:
        raise ArithmeticError(f"the error changes sign {len(peaks) - 1} times, {count - 1} are needed")
    return peaks
