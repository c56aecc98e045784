"""`error_bounds`: how far values at points can be from the true ones, proved, whoever computed them.

The enclosure kernel gives a ball that holds the true value; a value is no farther from it than from the ball's far end.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.pipeline import enclosure_kernel
from symrender_cg.scene import Scene


def error_bounds(
    scene: Scene,
    values: NDArray[Any],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    portable: bool = False,
    cache: str | Path | None = None,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """|value - true value| <= bound, of the shape of the values; grey levels are taken as intensities of level / 255.

    |(v - hi) - lo| + error, rounded upwards; inf where nothing is known.
    """
    found = enclosure_kernel(scene, portable=portable, cache=cache).enclose(x, y, threads=threads)
    hi, lo, error = (_of_shape(part, values.shape) for part in (found.hi, found.lo, found.error))
    wide = values.astype(np.float64) / 255.0 if values.dtype == np.uint8 else values.astype(np.float64)
    apart = wide - hi
    bounds: NDArray[np.float64] = np.nextafter((np.abs(apart - lo) + error) * (1.0 + 2.0**-40), np.inf)
    rounding = 2.0**-52 * np.abs(apart) + (2.0**-52 * np.abs(wide) if values.dtype == np.uint8 else 0.0)
    exact = (apart == 0.0) & (lo == 0.0) & (error == 0.0)
    return np.where(exact, 0.0, bounds + rounding)


def _of_shape(part: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Grey enclosures of a scene whose colours are all grey, in its three channels; others as they are."""
    return part if part.shape == shape else np.broadcast_to(part[..., np.newaxis], shape)
