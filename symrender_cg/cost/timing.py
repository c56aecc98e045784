"""Interleaved rounds: what each call takes a pixel, measured side by side in one run.

Comes in: calls that draw an image. Goes out: seconds of every call in every round. Never done here: statistics of one
call alone, a thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

SHORTEST: Final = 0.001
"""Seconds: what is faster is drawn several times in one run."""
RUNS: Final = 3
"""Runs of a sample, of which the shortest counts: another process that took the core must not."""
LONG: Final = 0.02
"""Seconds: the sample of what is slower is one run."""
MOST: Final = 1.5
"""Seconds that one call may take over all its rounds: what is slow takes part in some of them, at least two."""


def interleaved(
    calls: Sequence[Callable[[], object]], rounds: int, seed: int, told: Callable[[], None] = lambda: None
) -> list[list[float]]:
    """Seconds of one image of each call, NaN in rounds that it sits out; another seeded order every round.

    The sample of a short call is the shortest of RUNS runs, the first of which also fills the caches. `told` after each
    round.
    """
    repeats, every, slow = [], [], []
    for call in calls:
        once = _once(call)
        slow.append(once > LONG)
        repeats.append(max(1, round(SHORTEST / once)))
        part = max(2, min(rounds, int(MOST / (once * (1 if once > LONG else RUNS)))))
        every.append(-(-rounds // part))
    order = np.random.default_rng(seed)
    samples: list[list[float]] = [[] for _ in calls]
    for number in range(rounds):
        for index in order.permutation(len(calls)):
            if number % every[index]:
                samples[index].append(float("nan"))
                continue
            call, count = calls[index], repeats[index]
            runs = (_seconds(call, count) for _ in range(1 if slow[index] else RUNS))
            samples[index].append(min(runs) / count)
        told()
    return samples


def _seconds(call: Callable[[], object], count: int) -> float:
    begin = time.perf_counter()
    for _ in range(count):
        call()
    return time.perf_counter() - begin


def _once(call: Callable[[], object]) -> float:
    """Seconds of one call, the second where the first was short: it may have loaded what others find loaded."""
    begin = time.perf_counter()
    call()
    once = time.perf_counter() - begin
    if once < 0.2:
        begin = time.perf_counter()
        call()
        once = time.perf_counter() - begin
    return max(once, 1e-7)
