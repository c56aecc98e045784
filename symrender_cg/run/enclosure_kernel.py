"""`EnclosureKernel`: the native kernel that encloses a scene's intensities, called with numpy arrays.

Comes in: a plan with an arrangement, points of the image plane. Goes out: Enclosure, hi, lo and error with
|true intensity - (hi + lo)| <= error; or values by a rule, where these settle them. Never done here: a bound.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symrender_cg.build.library import CachedKernel, Library
from symrender_cg.plan.plan import Plan
from symrender_cg.run.enclosure_numbers import exact_numbers
from symrender_cg.run.scene_numbers import scene_numbers
from symrender_cg.run.structures import layout, structures
from symrender_cg.run.threads import over_rows, thread_count

_CHUNK: Final = 1024
"""Points that a thread takes at a time, each time with tables of its own."""

_AS_PIXELS: Final = 64
"""A point takes as long as so many pixels of an image: by that the number of threads is chosen."""

RULES: Final = {"ulp": 0, "float64": 1, "float32": 2, "uint8": 3}
"""How values are settled: within 4 ulp, as the nearest number of a format, as the grey level; `settling_rule` of C."""


@dataclass(frozen=True, slots=True, eq=False)
class Enclosure:
    """|true intensity - (hi + lo)| <= error, for each point and channel.

    float64, shape of the points, with a last axis of 3 for a scene with colours. hi is the float64 nearest to hi + lo.
    error is inf, and hi and lo are 0, where nothing is known.
    """

    hi: NDArray[np.float64]
    lo: NDArray[np.float64]
    error: NDArray[np.float64]


class SettledPoints(NamedTuple):
    """What enclosures settled: values (points, channels), as float64 which each of them is, and whether all channels of
    a point are settled, (points,); the largest error of those that are."""

    values: NDArray[np.float64]
    is_settled: NDArray[np.bool_]
    bound: float


@dataclass(frozen=True, slots=True, eq=False)
class EnclosureKernel:
    """A native enclosure bound to a scene.

    name      its C name; the entry points are name_points, name_settle and name_batch
    fields    (name, shape) of its scene structure's fields
    channels  1 or 3
    plan      of the scene that is enclosed
    nearer    its lights were brought nearer along their directions, see enclosure_numbers.brought_nearer
    """

    name: str
    fields: tuple[tuple[str, str], ...]
    channels: int
    plan: Plan
    cached: CachedKernel
    library: Library
    nearer: bool = False

    def enclose(self, x: ArrayLike, y: ArrayLike, *, threads: int | None = None) -> Enclosure:
        """The intensities at points of the image plane; x and y broadcast. Releases the GIL.

        Raises MemoryError.
        """
        given_x, given_y = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        columns, rows = np.ascontiguousarray(given_x).reshape(-1), np.ascontiguousarray(given_y).reshape(-1)
        count = columns.size
        hi, lo, error = (np.empty((count, self.channels)) for _ in range(3))
        scene, keeps = _structure(self)
        entry = getattr(self.library.lib, f"{self.name}_points")
        as_pointer = self.library.ffi.cast

        def some(begin: int, end: int) -> None:
            first, last = begin * _CHUNK, min(end * _CHUNK, count)
            pointers = [as_pointer("double *", a[first:last].ctypes.data) for a in (hi, lo, error, columns, rows)]
            if entry(*pointers, last - first, scene):
                raise MemoryError(f"no memory for the tables of a scene of {len(keeps)} arrays")

        if count:
            over_rows(some, -(-count // _CHUNK), thread_count(threads, _AS_PIXELS * count))
        shape = given_x.shape if self.channels == 1 else (*given_x.shape, self.channels)
        return Enclosure(hi.reshape(shape), lo.reshape(shape), error.reshape(shape))

    def settle(
        self, x: NDArray[np.float64], y: NDArray[np.float64], rule: str, white: float, *, threads: int | None = None
    ) -> SettledPoints:
        """The intensities at contiguous points (points,) by a rule of RULES, at most `white`. Releases the GIL.

        Raises MemoryError.
        """
        count = x.size
        values, is_settled = np.empty((count, self.channels)), np.empty(count, dtype=np.bool_)
        scene, keeps = _structure(self)
        entry, view = getattr(self.library.lib, f"{self.name}_settle"), self.library.ffi.from_buffer
        pointers = (
            view("double *", values),
            view("unsigned char *", is_settled),
            view("double *", x),
            view("double *", y),
        )
        how = RULES[rule], _cut_at(rule, white), scene
        if count <= _CHUNK:
            return SettledPoints(values, is_settled, _known(entry(*pointers, count, *how), len(keeps)))
        bounds: list[float] = []

        def some(begin: int, end: int) -> None:
            first, last = begin * _CHUNK, min(end * _CHUNK, count)
            at = pointers[0] + self.channels * first, *(pointer + first for pointer in pointers[1:])
            bounds.append(_known(entry(*at, last - first, *how), len(keeps)))

        over_rows(some, -(-count // _CHUNK), thread_count(threads, _AS_PIXELS * count))
        return SettledPoints(values, is_settled, max(bounds))

    @property
    def structure(self) -> np.dtype[Any]:
        """The scene's structure as numpy sees it."""
        return layout(self.library, f"{self.name}_scene", self.fields)

    def structures(self) -> tuple[NDArray[Any], tuple[Any, ...]]:
        """The scene as an array of one structure, and what it refers to."""
        return structures(self.library, f"{self.name}_scene", self.fields, [self.numbers()])

    def numbers(self) -> dict[str, Any]:
        """The scene as the kernel takes it: numbers and arrays by the names of its fields."""
        found = self.plan.arrangement
        assert found is not None, "an enclosure is for plans with an arrangement"
        frame = self.plan.scene
        return scene_numbers(frame, found, self.channels) | exact_numbers(frame, nearer=self.nearer)


def settle_many(
    kernel: EnclosureKernel,
    scenes: NDArray[Any],
    x: Sequence[NDArray[np.float64]],
    y: Sequence[NDArray[np.float64]],
    rule: str,
    white: float,
    threads: int | None,
) -> list[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
    """Values at points of many scenes by a rule, and which are settled, as `EnclosureKernel.settle` gives them, in one
    call a thread and chunk; x and y (points,) of each scene.

    scenes: structures of the kernel's kind, one a scene; what they refer to must be kept. Raises MemoryError.
    """
    entry, ffi = getattr(kernel.library.lib, f"{kernel.name}_batch"), kernel.library.ffi
    begins = np.cumsum([0, *(part.size for part in x)], dtype=np.intp)
    columns, rows = (np.ascontiguousarray(np.concatenate(parts), dtype=np.float64) for parts in (x, y))
    values, is_settled = np.empty((columns.size, kernel.channels)), np.empty(columns.size, dtype=np.bool_)

    def some(begin: int, end: int) -> None:
        at, last = begin * _CHUNK, min(end * _CHUNK, columns.size)
        low = int(np.searchsorted(begins, at, side="right")) - 1
        high = int(np.searchsorted(begins, last, side="left"))
        bounds = np.clip(begins[low : high + 1], at, last) - at
        pointers = (
            ffi.from_buffer("double *", values[at:last]),
            ffi.from_buffer("unsigned char *", is_settled[at:last]),
            *(ffi.from_buffer("double *", part[at:last]) for part in (columns, rows)),
        )
        given = ffi.from_buffer("ptrdiff_t *", bounds), RULES[rule], _cut_at(rule, white)
        _known(
            entry(*pointers, *given, ffi.from_buffer(f"{kernel.name}_scene *", scenes) + low, high - low), high - low
        )

    if columns.size:
        over_rows(some, -(-columns.size // _CHUNK), thread_count(threads, _AS_PIXELS * columns.size))
    pieces = [slice(begins[k], begins[k + 1]) for k in range(len(scenes))]
    return [(values[piece], is_settled[piece]) for piece in pieces]


def _cut_at(rule: str, white: float) -> float:
    """The white of values by a rule; grey levels end at 255 by themselves."""
    return math.inf if rule == "uint8" else white


def _known(bound: float, arrays: int) -> float:
    """The largest error that a call returned. Raises MemoryError where it was out of memory."""
    if bound < 0.0:
        raise MemoryError(f"no memory for the tables of {arrays} arrays or scenes")
    return bound


@lru_cache(maxsize=8)
def _structure(kernel: EnclosureKernel) -> tuple[Any, tuple[Any, ...]]:
    """The scene as C sees it, and the arrays that it refers to; remembered: a scene is asked about more than once."""
    made, keeps = kernel.structures()
    return kernel.library.ffi.from_buffer(f"{kernel.name}_scene *", made), (made, *keeps)
