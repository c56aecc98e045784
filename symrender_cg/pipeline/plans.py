"""Plans of scenes, remembered, and the debug line where a scene calls for another kernel than the one before it.

In: a scene, effects to force in, the shape of the window, a tolerance. Out: its Plan. Never here: how a plan is made
(symrender_cg.plan does that), or a kernel.
"""

from __future__ import annotations

import logging
import threading
from functools import lru_cache

from symrender_cg.pipeline.counts import statistics
from symrender_cg.plan.plan import Plan, plan
from symrender_cg.scene import Scene

log = logging.getLogger("symrender_cg")

_last: list[Plan | None] = [None]
_guard = threading.Lock()


def planned(scene: Scene, *, force: tuple[str, ...] = (), aspect: float | None = None, max_error: float = 0.0) -> Plan:
    """The plan of a scene, remembered: a scene is drawn more than once."""
    found = _planned(scene, force, aspect, max_error)
    note(found)
    return found


def note(found: Plan) -> None:
    """Counts and logs it where the plan that is drawn by is of another structure than the one before."""
    if _last[0] is found:
        return
    with _guard:
        before, _last[0] = _last[0], found
    if before is not None and before.key != found.key:
        statistics.add("replanned")
        gone, new = sorted(set(before.key) - set(found.key)), sorted(set(found.key) - set(before.key))
        log.debug("replanned: %s after %s; in: %s; out: %s", found.name, before.name, new or "-", gone or "-")


@lru_cache(maxsize=256)
def _planned(scene: Scene, force: tuple[str, ...], aspect: float | None, max_error: float) -> Plan:
    statistics.add("planned")
    return plan(scene, force=force, aspect=aspect, max_error=max_error)


def pixel_size(frame: Scene, height: int) -> float:
    """The side of a pixel of an image with that many rows, in scene units; `frame` is a camera-frame scene."""
    half_height = frame.camera.half_height
    assert half_height is not None, "a camera-frame scene has its half_height"
    return 2.0 * half_height / height
