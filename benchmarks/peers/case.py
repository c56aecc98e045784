"""What a contestant is asked for: numbers of the scene, a format and what is known when it compiles, a grid of points.

Comes in: plain numbers. Goes out: frozen records that travel as JSON. Never done here: an import that takes time,
because every process of a contestant begins with this one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

Format = Literal["float64", "float32"]
Render = Callable[[], NDArray[Any]]
"""Draws the grid once more and returns the image, (size, size); the next call may write into the same array."""
Draw = Callable[["Grid"], Render]
"""Makes what a grid needs (coordinates, an output array) and returns the call that is timed."""
Arrangements = Mapping[str, Draw]
"""Ways to arrange one contestant's loops, by name; the fastest one counts. Empty: it has nothing for this case."""
Factory = Callable[["Case", int], Arrangements]
"""(case, threads) -> arrangements; what it does before the first call counts as compile time."""


STRIP: Final = 1 << 13
"""Pixels of a strip of rows, for contestants that work on arrays."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """R, e, l, k_a, k_d, k_s, n: a sphere of radius R at the origin, seen from (0, 0, e), lit from l, background 0."""

    radius: float = 1.0
    eye: float = 4.0
    light_x: float = 5.0
    light_y: float = 5.0
    light_z: float = 10.0
    ambient: float = 0.1
    diffuse: float = 0.7
    specular: float = 0.5
    shininess: float = 32.0

    def in_order(self) -> tuple[float, ...]:
        """The numbers in the order of the fields, which is that of the seed's params."""
        return tuple(asdict(self).values())

    @property
    def half(self) -> float:
        """Half the side of the image: 1.25 e R / sqrt(e^2 - R^2), as in the seed's Cell 1."""
        e, r = self.eye, self.radius
        return 1.25 * e * r / float(np.sqrt(e * e - r * r))


@dataclass(frozen=True, slots=True)
class Case:
    """The numbers, the format to compute in, and whether the numbers may be constants of what is compiled.

    baked: the numbers are constants where a contestant can fold them in; else each of them is an argument, the
    exponent too. The grid is an argument in both.
    """

    format: Format
    baked: bool
    numbers: Numbers = Numbers()

    @property
    def name(self) -> str:
        """Such as `float64, n = 32 baked`."""
        return f"{self.format}, n = {self.numbers.shininess:g} {'baked' if self.baked else 'an argument'}"

    @property
    def dtype(self) -> np.dtype[Any]:
        """The numpy type of the format."""
        return np.dtype(self.format)

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries, for JSON."""
        return asdict(self)

    @staticmethod
    def of(told: Mapping[str, Any]) -> Case:
        """The case that `to_dict` told."""
        return Case(told["format"], told["baked"], Numbers(**told["numbers"]))


@dataclass(frozen=True, slots=True)
class Grid:
    """size x size points: x = left + i step of column i, y = top - j step of row j."""

    size: int
    left: float
    top: float
    step: float

    def axes(self, dtype: np.dtype[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """x of the columns and y of the rows, computed in float64 and rounded once to the format."""
        index = np.arange(self.size)
        return (self.left + index * self.step).astype(dtype), (self.top - index * self.step).astype(dtype)


def strips_of(size: int) -> tuple[slice, ...]:
    """The rows of an image in strips of about STRIP pixels: a dozen arrays of one stay in the second-level cache."""
    rows = max(1, STRIP // size)
    return tuple(slice(begin, min(begin + rows, size)) for begin in range(0, size, rows))


def image_grid(numbers: Numbers, size: int) -> Grid:
    """The pixel centres of the seed's image, its side rounded so that each of them is a float32 up to 2048 pixels.

    The step has 12 bits and (i + 1/2 - size / 2) at most 12: no contestant is charged for the rounding of its
    coordinates, in either format, however it computes them.
    """
    step = 2.0 * numbers.half / size
    unit = 2.0 ** (np.floor(np.log2(step)) - 11)
    step = float(np.round(step / unit) * unit)
    return Grid(size, (0.5 - size / 2) * step, (size / 2 - 0.5) * step, step)


def outline_grid(numbers: Numbers, case_format: str, size: int) -> Grid:
    """A close-up of the outline: points two floats of the format apart, about the point of it at 30 degrees.

    Every coordinate is a float of the format and is computed without rounding, also as left + i step in that format:
    what goes wrong here is the arithmetic's, not the grid's.
    """
    rho = numbers.half / 1.25
    dtype = np.dtype(case_format)
    x, y = (np.asarray(rho * factor, dtype) for factor in (np.sqrt(0.75), 0.5))
    step = 2.0 * float(max(np.spacing(x), np.spacing(y)))
    left, top = (round(float(value) / step) * step for value in (x, y))
    return Grid(size, left - step * (size // 2), top + step * (size // 2), step)
