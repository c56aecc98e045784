"""How far a float evaluator is from the truth: largest error in ulp and absolute, and flips.

Comes in: values of float64 or float32, the oracle's Answers for the same points. Goes out: Errors, a handful of
numbers. Never done here: evaluation, or a judgement about what is good enough. Values are the unclipped field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import ArgumentError
from symrender_cg.reference.oracle import Answers


@dataclass(frozen=True, slots=True)
class Errors:
    """What `measure` found; errors over the points that are finite, in ulp only where nothing flipped.

    max_ulp: largest |value - truth| in ulp of the answer, in the format of the values.
    max_abs, p999_abs: largest |value - truth| and its 99.9th percentile.
    flips: points where exactly one of value and truth is 0, or where hit or miss differs.
    nonfinite: values that are NaN or infinite where the truth is not.
    count: points.  worst: index of the point to look at first (a nonfinite one, else a flip, else the largest error in
    ulp); () without points.
    """

    max_ulp: float
    max_abs: float
    p999_abs: float
    flips: int
    nonfinite: int
    count: int
    worst: tuple[int, ...]


def measure(values: npt.ArrayLike, answers: Answers, hit: npt.ArrayLike | None = None) -> Errors:
    """error = (value - answers.value) - answers.residual, for float64 or float32 values in the shape of the answers.

    hit: the evaluator's own hit or miss decisions, one a point, when it has them; a flip counts in each channel.
    Raises ArgumentError for another dtype or shape.
    """
    given = np.asarray(values)
    if given.dtype not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise ArgumentError(f"values: dtype {given.dtype}; expected float64 or float32, the format whose ulp is meant")
    single = given.dtype == np.dtype(np.float32)
    answer = answers.value32 if single else answers.value
    decided = None if hit is None else np.asarray(hit, dtype=np.bool_)
    for name, array, shape in (("values", given, answer.shape), ("hit", decided, answers.index.shape)):
        if array is not None and array.shape != shape:
            raise ArgumentError(f"{name}: shape {array.shape}; expected that of the answers, {shape}")
    if given.size == 0:
        return Errors(0.0, 0.0, 0.0, 0, 0, 0, ())
    broken = ~np.isfinite(given) & np.isfinite(answer)
    flipped = ((given == 0) != (answer == 0)) & ~broken
    if decided is not None:
        other = decided != answers.hit
        flipped |= other if other.ndim == flipped.ndim else other[..., np.newaxis]
    usable = np.isfinite(given) & np.isfinite(answer)
    error = np.zeros(given.shape)
    np.subtract(given, answers.value, out=error, where=usable, dtype=np.float64)
    np.subtract(error, answers.residual, out=error, where=usable)
    np.abs(error, out=error)
    with np.errstate(over="ignore", invalid="ignore"):
        ulps = np.where(usable & ~flipped, error / np.abs(np.spacing(answer)).astype(np.float64), 0.0)
    rank = np.where(broken, np.inf, np.where(flipped, np.finfo(np.float64).max, ulps))
    worst = np.unravel_index(int(np.argmax(rank)), given.shape)
    return Errors(
        max_ulp=float(ulps.max()),
        max_abs=float(error.max()),
        p999_abs=float(np.quantile(error, 0.999)),
        flips=int(np.count_nonzero(flipped)),
        nonfinite=int(np.count_nonzero(broken)),
        count=given.size,
        worst=tuple(int(index) for index in worst),
    )
