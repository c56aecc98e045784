"""What else a kernel knows of each pixel, as files beside the image: out.png -> out-depth.png, out-normal.png, ...

Comes in: the arrays of render_layers. Goes out: one file a layer, or, for a .npz, all of them in the image's own file.

    .npy, .pfm     the numbers (float32 in a .pfm)
    .png           depth     near is white, far is dark, linear in 1 / depth; the background is black
                   normal    (n + 1) / 2 as RGB, camera's frame; the background is black
                   index     one colour a sphere, by turns of the golden angle; the background is black
                   terms     as the image: cut to [0, 1], its bits and its encoding
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.output import replacing, write_arrays, write_image, write_levels
from symrender_cg.run.scene_kernel import LAYERS

TERMS = ("background", "ambient", "diffuse", "specular", "reflected")
DARKEST = 0.15
"""The grey of the farthest point; black is left to the background."""
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


def chosen_layers(asked: tuple[str, ...]) -> tuple[str, ...]:
    """The layers of render_layers that are asked for, in its order; `terms` are five of them, `all` is all."""
    if "all" in asked:
        return LAYERS
    wanted = set(asked) | (set(TERMS) if "terms" in asked else set())
    return tuple(name for name in LAYERS if name in wanted)


def write_layers(
    target: Path, found: Mapping[str, NDArray[Any]], *, bits: int | None, encoding: str | None
) -> list[tuple[Path, str]]:
    """Writes every layer beside the image `target` in its format; what was written, and what a picture shows of it."""
    if target.suffix.lower() == ".npz":
        write_arrays(target, found)
        return []
    said = []
    for name, array in found.items():
        if name != "image":
            for suffix, one in _single(name, array):
                place = target.with_name(f"{target.stem}-{suffix}{target.suffix}")
                said.append((place, _write(place, name, one, bits, encoding)))
    return said


def _single(name: str, array: NDArray[Any]) -> list[tuple[str, NDArray[Any]]]:
    """Terms of lights one by one: diffuse-0, diffuse-1, ..."""
    if name in ("diffuse", "specular"):
        return [(f"{name}-{light}", one) for light, one in enumerate(array)]
    return [(name, array)]


def _write(place: Path, name: str, array: NDArray[Any], bits: int | None, encoding: str | None) -> str:
    if place.suffix.lower() == ".npy":
        with replacing(place) as file:
            np.save(file, array, allow_pickle=False)
        return ""
    if place.suffix.lower() == ".pfm":
        write_image(place, array.astype(np.float32))
        return ""
    if name not in ("depth", "normal", "index"):
        write_image(place, np.clip(array, 0.0, 1.0), bits=bits, encoding=encoding)
        return ""
    white = 2 ** (bits or 8) - 1
    shown, said = {"depth": depth_picture, "normal": normal_picture, "index": index_picture}[name](array)
    write_levels(place, np.rint(white * shown).astype(np.uint8 if white == 255 else np.uint16))
    return said


def depth_picture(depth: NDArray[Any]) -> tuple[NDArray[Any], str]:
    """Grey, linear in 1 / depth, 1 at the nearest and DARKEST at the farthest point, 0 where nothing is seen.

    And the two depths in words. A plane goes on to the horizon: linear in the depth all that is near would be white.
    """
    seen = np.isfinite(depth)
    if not seen.any():
        return np.zeros(depth.shape), "nothing is seen"
    near, far = float(depth[seen].min()), float(depth[seen].max())
    share = (near / depth - near / far) / (1.0 - near / far) if far > near else np.ones(depth.shape)
    shown = np.where(seen, DARKEST + (1.0 - DARKEST) * share, 0.0)
    return shown, f"1 / depth, {near:.6g} is white, {far:.6g} dark grey, the background black"


def normal_picture(normal: NDArray[Any]) -> tuple[NDArray[Any], str]:
    """(n + 1) / 2 as RGB, 0 where nothing is seen."""
    seen = np.any(normal != 0.0, axis=-1, keepdims=True)
    return np.where(seen, 0.5 * (np.clip(normal, -1.0, 1.0) + 1.0), 0.0), "(n + 1) / 2, the background black"


def index_picture(index: NDArray[Any]) -> tuple[NDArray[Any], str]:
    """A colour for each index, far apart for neighbours; black for -1."""
    count = int(index.max()) + 1
    hues = [(_GOLDEN * k % 1.0, 0.75 if k % 2 else 0.55, 1.0 if k % 3 else 0.8) for k in range(count)]
    table = np.array([*(colorsys.hsv_to_rgb(*hue) for hue in hues), (0.0, 0.0, 0.0)])
    return table[index], f"a colour for each of {len(np.unique(index[index >= 0]))} that are seen, the background black"
