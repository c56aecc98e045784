"""What this process did so far, counted: plans, kernels derived, compiled, recalled and reused.

In: the name of a count, from whichever module did the thing. Out: `statistics`, which a user may read and a test
compares before and after. Never here: a time, or a decision that rests on a count.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field


@dataclass
class Statistics:
    """What this process did so far: kernels derived, compiled, recalled from the cache on disk, reused in memory, and
    how often a scene was planned and its plan was another one than that of the scene before it."""

    planned: int = 0
    replanned: int = 0
    derived: int = 0
    compiled: int = 0
    recalled: int = 0
    reused: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def add(self, what: str) -> None:
        """Counts one more of that kind."""
        with self.lock:
            setattr(self, what, getattr(self, what) + 1)


statistics = Statistics()
