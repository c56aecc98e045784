"""What render_image and evaluate do with max_error, max_ulp and bits: the kernel that meets them.

Comes in: the arguments of such a call. Goes out: (accuracy, target, bake, tolerance of the plan). Never done here: a
choice; choose.py makes it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.cost.choose import choose
from symrender_cg.errors import ArgumentError
from symrender_cg.scene import Scene, load_scene

Drawn = tuple[str, str | None, bool, float]


def meeting(
    scene: Scene | str | Path | None,
    *,
    max_error: float | None,
    max_ulp: float | None,
    bits: float | None,
    given: dict[str, Any],
    bake: bool = False,
    aspect: float = 1.0,
    out: NDArray[Any] | None = None,
    points: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    cache: str | Path | None = None,
) -> Drawn:
    """Accuracy, target, bake and tolerance of the fastest variant that meets the request; see symrender_cg.cost.choose.

    given    other arguments of the call by name, and what they are if left out: ArgumentError where they differ, as
             they choose a kernel too
    points   where values are asked for, in place of an image: there the whole plan draws
    """
    form = None if out is None else str(getattr(out, "dtype", ""))
    key = (id(scene), max_error, max_ulp, bits, bake, aspect, str(cache), form)
    keeps = points is None and (scene is None or type(scene) is Scene)
    kept = _kept.get(key) if keeps else None
    if kept is not None and all(value == usual for value, usual in given.values()):
        return kept[1]
    for name, (value, usual) in given.items():
        if value != usual:
            raise ArgumentError(
                f"{name}: {value!r} chooses a kernel, and so do max_error, max_ulp and bits; leave one of them out"
            )
    chosen = load_scene(scene)
    dtype = None if not isinstance(out, np.ndarray) else out.dtype
    reach = 1.0 if points is None else reach_of(chosen, *points)
    found = choose(
        chosen,
        max_error=max_error,
        max_ulp=max_ulp,
        bits=bits,
        dtype=dtype,
        reach=reach,
        aspect=aspect,
        plans=points is None,
        bake=bake,
        cache=cache,
    )
    drawn = found.accuracy, found.target, found.bake, found.tolerance
    if keeps:
        while len(_kept) >= MOST_KEPT:
            _kept.pop(next(iter(_kept)), None)
        _kept[key] = chosen, drawn
    return drawn


MOST_KEPT = 16
_kept: dict[tuple[object, ...], tuple[Scene, Drawn]] = {}
"""What scenes were drawn with, each kept so that its identity is no other's."""


def reach_of(scene: Scene, x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """How many half-heights of the window the farthest point lies from its middle: 1, 2, 4, ... up to 2^40."""
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None, "a scene in the camera's frame has a half_height"
    farthest = max(float(np.abs(x).max(initial=0.0)), float(np.abs(y).max(initial=0.0))) / half_height
    return 2.0 ** min(40, max(0, math.ceil(math.log2(farthest)))) if farthest > 1.0 else 1.0
