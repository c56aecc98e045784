"""Pictures side by side: ours, the peer's, and 100 times their difference, in one PNG.

Comes in: two images of one shape, linear. Goes out: a file, 8 bits, sRGB. Never done here: a comparison in numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.output import srgb

GAIN: Final = 100.0
GAP: Final = 4
"""Grey pixels between the pictures."""


def strip(ours: NDArray[Any], theirs: NDArray[Any]) -> NDArray[np.uint8]:
    """(h, 3 w + 2 GAP, 3) bytes: ours and theirs in sRGB, |ours - theirs| 100 in linear bytes (255 from 0.01 on)."""
    pair = [np.asarray(image, dtype=np.float64) for image in (ours, theirs)]
    pair = [image if image.ndim == 3 else np.repeat(image[..., np.newaxis], 3, axis=-1) for image in pair]
    pictures = [srgb(np.clip(image, 0.0, 1.0)) for image in pair]
    pictures.append(np.clip(GAIN * np.abs(pair[0] - pair[1]), 0.0, 1.0))
    gap = np.full((pair[0].shape[0], GAP, 3), 0.5)
    row = np.concatenate([pictures[0], gap, pictures[1], gap, pictures[2]], axis=1)
    return np.asarray(np.rint(255.0 * row), dtype=np.uint8)


def save_strip(path: Path, ours: NDArray[Any], theirs: NDArray[Any]) -> None:
    """Writes `strip` as a PNG; the folder is made where it is missing."""
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(strip(ours, theirs)).save(path)
