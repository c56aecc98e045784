"""`near_pairs`: which balls of two sets may come near one another, without looking at all pairs.

Comes in: centres and reaches of two sets in up to three dimensions. Goes out: index pairs, a superset of those with
|p - q| <= reach_p + reach_q. Never done here: the decision about a pair.

Balls are sorted into levels by the power of two above twice their reach. A ball of one level is in a cell of at least
that size, or in one of the 26 around it, of every ball that it comes near; a row of three cells is one range of the
sorted cells. N balls that overlap k others each cost about N (log N + k) for every pair of levels that occurs.
"""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np

from symrender_cg.plan.measures import Floats, Indices

_LEVELS: Final = 24
"""Levels are joined into coarser ones until at most so many occur."""

_CELL_BITS: Final = 20
"""Cells along one axis: three coordinates fit a 64-bit key."""

_BATCH: Final = 1 << 21
"""Pairs looked at in one go: bounds the memory."""

_FEW: Final = 1 << 14
"""So many pairs are looked at one by one: cells cost more."""

_ROUNDING: Final = 2.0**-40
"""Reaches grow by this much of themselves and of the largest coordinate: more than cells and distances are off."""


def near_pairs(p: Floats, reach_p: Floats, q: Floats, reach_q: Floats) -> tuple[Indices, Indices]:
    """(i, j), int64: every pair with |p_i - q_j| <= reach_p_i + reach_q_j, and few others; p (n, 3), q (k, 3)."""
    nothing = np.empty(0, dtype=np.int64)
    if not len(p) or not len(q):
        return nothing, nothing
    low = np.minimum(p.min(axis=0), q.min(axis=0))
    p, q = p - low, q - low
    extent = float(max(p.max(), q.max()))
    slack = _ROUNDING * extent
    reach_p, reach_q = reach_p * (1.0 + _ROUNDING) + slack, reach_q * (1.0 + _ROUNDING) + slack
    if len(p) * len(q) <= _FEW:
        apart, reach = p[:, np.newaxis] - q, reach_p[:, np.newaxis] + reach_q
        i, j = np.nonzero(np.einsum("nki,nki->nk", apart, apart) <= reach * reach)
        return i, j
    level_p, level_q = _levels(np.concatenate((reach_p, reach_q)), len(p))
    found = [(nothing, nothing)]
    for level in np.unique(np.concatenate((level_p, level_q))):
        here_p, here_q = np.flatnonzero(level_p == level), np.flatnonzero(level_q == level)
        below_p, below_q = np.flatnonzero(level_p < level), np.flatnonzero(level_q <= level)
        size = float(np.ldexp(1.0, int(level)))
        if here_p.size and below_q.size:  # the wider or equal one is in p
            j, i = _join(q, reach_q, below_q, p, reach_p, here_p, size)
            found.append((i, j))
        if here_q.size and below_p.size:
            found.append(_join(p, reach_p, below_p, q, reach_q, here_q, size))
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])


def _levels(reach: Floats, split: int) -> tuple[Indices, Indices]:
    """Exponents such that 2^level >= 2 reach, joined until few occur."""
    _, exponent = np.frexp(np.maximum(2.0 * reach, 2.0**-1000))
    level = exponent.astype(np.int64)
    step = 1
    while np.unique(level).size > _LEVELS:
        step *= 2
        level = -(-exponent.astype(np.int64) // step) * step
    return level[:split], level[split:]


def _join(
    p: Floats, reach_p: Floats, chosen_p: Indices, q: Floats, reach_q: Floats, chosen_q: Indices, size: float
) -> tuple[Indices, Indices]:
    """Pairs of chosen ones, no reach above size / 2: those in the same cell of that size or in neighbours."""
    low = np.minimum(p[chosen_p].min(axis=0), q[chosen_q].min(axis=0))
    extent = float(max((p[chosen_p] - low).max(), (q[chosen_q] - low).max()))
    size = max(size, extent * 2.0 ** (2 - _CELL_BITS))
    cell_q = np.floor((q[chosen_q] - low) / size).astype(np.int64) + 1
    key_q = _key(cell_q)
    order = np.argsort(key_q, kind="stable")
    key_q, chosen_q = key_q[order], chosen_q[order]
    cell_p = np.floor((p[chosen_p] - low) / size).astype(np.int64) + 1
    base = _key(cell_p)
    order = np.argsort(base, kind="stable")
    base, chosen_p = base[order], chosen_p[order]
    found_p, found_q = [], []
    for x in (-1, 0, 1):
        for y in (-1, 0, 1):
            row = base + ((x << 2 * (_CELL_BITS + 1)) + (y << (_CELL_BITS + 1)))
            begin = np.searchsorted(key_q, row - 1, side="left")
            count = np.searchsorted(key_q, row + 1, side="right") - begin
            some = np.flatnonzero(count)
            for part in _batches(count[some]):
                i, j = _ranges(begin[some[part]], count[some[part]])
                i, j = chosen_p[some[part]][i], chosen_q[j]
                between = p[i] - q[j]
                reach = reach_p[i] + reach_q[j]
                near = np.einsum("ni,ni->n", between, between) <= reach * reach
                found_p.append(i[near])
                found_q.append(j[near])
    nothing = np.empty(0, dtype=np.int64)
    return np.concatenate([nothing, *found_p]), np.concatenate([nothing, *found_q])


def _key(cell: Indices) -> Indices:
    bits = _CELL_BITS + 1
    return np.asarray((cell[:, 0] << 2 * bits) + (cell[:, 1] << bits) + cell[:, 2])


def _batches(count: Indices) -> list[slice]:
    """Consecutive ranges of at most _BATCH pairs, or one entry."""
    if not count.size:
        return []
    total = np.cumsum(count)
    cuts = np.unique(np.searchsorted(total, np.arange(_BATCH, total[-1], _BATCH)))
    edges = [0, *(int(cut) for cut in cuts if cut > 0), len(count)]
    return [slice(a, b) for a, b in itertools.pairwise(edges)]


def _ranges(begin: Indices, count: Indices) -> tuple[Indices, Indices]:
    """(which, value): begin[k], begin[k] + 1, ... of every range k."""
    which = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    return which, np.arange(len(which)) - first[which] + begin[which]
