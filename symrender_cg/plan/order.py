"""Orders and comparisons that are exact: float64 where it decides, whole numbers where it does not.

Comes in: spheres in the camera's frame. Goes out: an order or truths, each as if computed without rounding.
Never done here: a margin; tangency is told apart from either side.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from symrender_cg.plan.measures import Floats, Indices, Truths
from symrender_cg.scene import Sphere, Vector, exact


def front_to_back(spheres: Sequence[Sphere], chosen: Indices, eye: Vector, distance: Floats, radius: Floats) -> Indices:
    """`chosen` by the power of the eye |E - C|^2 - R^2, exactly; ties by centre, radius, then index.

    The float64 key (d - R)(d + R) is at most 16 roundings of d^2 off, for d > R; where two keys are nearer than that,
    their spheres are ordered by whole numbers.
    """
    d, r = distance[chosen], radius[chosen]
    key, error = (d - r) * (d + r), 2.0**-49 * d * d
    low, high = key - error, key + error
    by_low = np.argsort(low, kind="stable")
    chosen, low, high = chosen[by_low], low[by_low], np.maximum.accumulate(high[by_low])
    starts = np.flatnonzero(np.concatenate(([True], low[1:] > high[:-1]))) if chosen.size else np.empty(0, np.int64)
    ends = np.append(starts[1:], chosen.size)
    result = chosen.copy()
    for begin, end in zip(starts[ends - starts > 1], ends[ends - starts > 1], strict=True):
        run = [int(index) for index in chosen[begin:end]]
        grid = exact.grid_of(v for index in run for v in (*eye, *spheres[index].center, spheres[index].radius))
        origin = exact.vector_on_grid(eye, grid)

        def power(index: int, grid: int = grid, origin: exact.GridVector = origin) -> tuple[int, Vector, float, int]:
            sphere = spheres[index]
            m = exact.difference(exact.vector_on_grid(sphere.center, grid), origin)
            square = exact.dot(m, m) - exact.on_grid(sphere.radius, grid) ** 2
            return square, sphere.center, sphere.radius, index

        result[begin:end] = sorted(run, key=power)
    return result


def canonical(center: Floats, radius: Floats, chosen: Indices) -> Indices:
    """`chosen` by radius, centre, then index: an order that does not depend on that of the file."""
    c = center[chosen]
    return np.asarray(chosen[np.lexsort((chosen, c[:, 2], c[:, 1], c[:, 0], radius[chosen]))])


def deeper(spheres: Sequence[Sphere], eye: float, factor: int) -> Truths:
    """(N,): e - z > factor R, exactly; factor is 1 or -1.

    Rounding keeps order: where the float64 of e - z is not R itself, it lies on the side where the true one does.
    """
    depth = np.array([eye - sphere.center[2] for sphere in spheres], dtype=np.float64)
    bound = factor * np.array([sphere.radius for sphere in spheres], dtype=np.float64)
    truths = np.asarray(depth > bound)
    for index in np.flatnonzero(depth == bound).tolist():
        sphere = spheres[index]
        truths[index] = Fraction(eye) - Fraction(sphere.center[2]) > factor * Fraction(sphere.radius)
    return truths


def seen_aside(spheres: Sequence[Sphere], eye: float, farthest: int) -> Truths:
    """(N,): max(|x|, |y|) > farthest (e - z), exactly; farthest is a power of two."""
    depth = np.array([eye - sphere.center[2] for sphere in spheres], dtype=np.float64)
    aside = np.array([max(abs(sphere.center[0]), abs(sphere.center[1])) for sphere in spheres], dtype=np.float64)
    bound = aside / farthest
    truths = np.asarray(bound > depth)
    for index in np.flatnonzero((bound == depth) | (bound < 2.0**-1000)).tolist():
        x, y, z = spheres[index].center
        truths[index] = Fraction(max(abs(x), abs(y))) > farthest * (Fraction(eye) - Fraction(z))
    return truths
