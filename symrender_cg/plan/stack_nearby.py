"""Which balls come near one another, in many scenes at once: symrender_cg.plan.nearby, with an axis of scenes.

Comes in: centres and reaches. Goes out: triples of scene and two balls. Never done here: the decision about a pair.
"""

from __future__ import annotations

import numpy as np

from symrender_cg.plan.measures import Floats, Indices, Truths, norm


def all_true(truths: Truths) -> tuple[Indices, ...]:
    """The indices of what is true, in their order, axis by axis; of large arrays much sooner than by np.nonzero."""
    return np.unravel_index(np.flatnonzero(truths), truths.shape)


def near_pairs_of_all(place: Floats, reach: Floats, first: Truths, second: Truths) -> tuple[Indices, Indices, Indices]:
    """(scene, a, b) with a != b: every pair with |p - q| <= r + s of balls, and few others.

    place (T, N, 3), reach (T, N); a is one of the first (T, N), b one of the second.

    2 (p.q + r s) + (r^2 - p^2) + (s^2 - q^2) >= 0 is one product of matrices, good to 2^-44 of the squares; what
    passes is looked at again.
    """
    square = np.einsum("tni,tni->tn", place, place)
    extent = square.max(axis=1)
    reach = reach * (1.0 + 2.0**-40) + 2.0**-39 * np.sqrt(extent)[:, np.newaxis]
    rest, ones = 0.5 * (reach * reach - square), np.ones(square.shape)
    left = np.stack((*place.transpose(2, 0, 1), reach, rest, ones), axis=2)
    right = np.stack((*place.transpose(2, 0, 1), reach, ones, rest), axis=1)
    least = -(2.0**-44) * (extent + (reach * reach).max(axis=1))
    meets = left @ right >= least[:, np.newaxis, np.newaxis]
    meets &= first[:, :, np.newaxis]
    meets &= second[:, np.newaxis]
    number = np.arange(square.shape[1])
    meets[:, number, number] = False
    t, a, b = all_true(meets)
    near = norm(place[t, a] - place[t, b]) <= reach[t, a] + reach[t, b]
    return t[near], a[near], b[near]
