"""Memory that a thread keeps for the places that a kernel lists: fresh memory costs more than a kernel's work on it."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

KEPT = 1 << 20
"""Places that a thread keeps memory for."""

_of_thread = threading.local()


def scratch(size: int) -> NDArray[np.intp]:
    """Memory for as many places, to be copied from before the thread asks again."""
    if size > KEPT:
        return np.empty(size, dtype=np.intp)
    kept: NDArray[np.intp] | None = getattr(_of_thread, "places", None)
    if kept is None or kept.size < size:
        kept = _of_thread.places = np.empty(size, dtype=np.intp)
    return kept[:size]
