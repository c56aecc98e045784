"""Structures of C for many scenes, made by numpy: numbers and arrays by name -> one array of structures.

Comes in: the numbers of each scene, as symrender_cg.run.scene_numbers has them. Goes out: a contiguous array with the
C's layout, whose pointers lead into arrays that hold the lists of all scenes one after the other, and what has to be
kept while it is used. Never done here: a number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symrender_cg.build.library import Library

Fields = tuple[tuple[str, str], ...]
"""(name, shape) of a structure's fields; shape is number, whole, reals or wholes."""

_TYPES = {"number": np.float64, "whole": np.intc, "reals": np.float64, "wholes": np.int32}


def structures(
    library: Library, kind: str, fields: Fields, scenes: Sequence[Mapping[str, Any]]
) -> tuple[NDArray[Any], tuple[Any, ...]]:
    """(structures, one a scene; what they refer to)."""
    made, keeps = np.zeros(len(scenes), dtype=layout(library, kind, fields)), []
    for name, shape in fields:
        values = [numbers[name] for numbers in scenes]
        if shape in ("number", "whole"):
            made[name] = values
            continue
        arrays = [np.asarray(value, dtype=_TYPES[shape]).reshape(-1) for value in values]
        keeps.append(lead(made, name, np.concatenate(arrays), [array.size for array in arrays]))
    return made, tuple(keeps)


def lead(made: NDArray[Any], name: str, whole: NDArray[Any], sizes: ArrayLike) -> NDArray[Any]:
    """Lets the pointer of each structure lead into an array that holds lists of these sizes one after the other; the
    array, contiguous, to be kept."""
    held = np.ascontiguousarray(whole).reshape(-1)
    ends = np.cumsum(np.broadcast_to(np.asarray(sizes, dtype=np.int64), made.shape))
    begins = np.concatenate(([0], ends[:-1])).astype(np.uintp)
    made[name] = np.uintp(held.ctypes.data) + begins * np.uintp(held.itemsize)
    return held


@lru_cache(maxsize=64)
def layout(library: Library, kind: str, fields: Fields) -> np.dtype[Any]:
    """The structure as numpy sees it; a pointer is a whole number of its size."""
    ffi = library.ffi
    formats = [np.dtype(np.uintp if shape in ("reals", "wholes") else _TYPES[shape]) for _, shape in fields]
    names = [name for name, _ in fields]
    offsets = [ffi.offsetof(kind, name) for name in names]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": ffi.sizeof(kind)})
