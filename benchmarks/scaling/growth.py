"""time ~ amount^p: the exponent of a series, by least squares on logarithms. Never here: a measurement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symrender_cg.errors import ArgumentError


def exponent(amounts: Sequence[float], times: Sequence[float]) -> float:
    """p of the best fit log time = p log amount + c: 1 for a series that is linear, 0 for one that does not grow.

    Both positive, at least two different amounts. Raises ArgumentError.
    """
    x, y = np.asarray(amounts, dtype=np.float64), np.asarray(times, dtype=np.float64)
    if x.shape != y.shape or np.unique(x).size < 2 or not (x > 0).all() or not (y > 0).all():
        raise ArgumentError(
            f"amounts, times: {list(amounts)}, {list(times)}; expected as many times as amounts, all positive, and two "
            "different amounts"
        )
    u, v = np.log(x) - np.log(x).mean(), np.log(y) - np.log(y).mean()
    return float((u * v).sum() / (u * u).sum())
