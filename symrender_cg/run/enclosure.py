"""`enclose`: what is true of a scene's intensities at points, as numbers with a proved error.

Comes in: a scene and points. Goes out: Enclosure. Never done here: a rounding to the format of an image.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symrender_cg.pipeline import enclosure_kernel
from symrender_cg.run.enclosure_kernel import Enclosure
from symrender_cg.scene import Scene, load_scene

__all__ = ["Enclosure", "enclose"]


def enclose(
    scene: Scene | str | Path | None,
    x: ArrayLike,
    y: ArrayLike,
    *,
    threads: int | None = None,
    portable: bool = False,
    cache: str | Path | None = None,
) -> Enclosure:
    """hi, lo, error with |true intensity - (hi + lo)| <= error, at points (x, y) of the image plane, unclipped.

    x and y broadcast; each array has their shape, and a last axis of 3 channels for a scene with colours. The error is
    about 1e-28 of the brightest light where nothing is ill-conditioned, the width of a jump where a shadow's edge is in
    doubt, and inf where nobody knows which surface is seen, or x or y is out of all range.
    Arguments as those of `evaluate`. Raises SceneError, OutsidePlanError or ToolchainError.
    """
    chosen = load_scene(scene)
    found = enclosure_kernel(chosen, portable=portable, cache=cache).enclose(x, y, threads=threads)
    if found.hi.ndim == np.broadcast(x, y).ndim and chosen.channels == 3:
        return Enclosure(_in_colour(found.hi), _in_colour(found.lo), _in_colour(found.error))
    return found


def _in_colour(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Grey values of a scene whose colours are all grey, in its three channels."""
    return np.repeat(values[..., np.newaxis], 3, axis=-1)
