"""Which spheres a ray could meet: float64 with a margin that no rounding reaches, so that few are asked exactly.

Comes in: the spheres of a scene in whole numbers; a ray or a segment. Goes out: indices of all spheres that it meets,
and of some that it does not. Never done here: a decision.

P and w are rounded from balls, each to within 2^-50 of itself. With a = |C| + |P| + R, b = |w| (sums of magnitudes) and
m = C - P, whose error is then below 2^-49 a, float64 finds
    m.w                      to within 2^-46 a b
    R^2 |w|^2 - |m x w|^2    to within 2^-43 a^2 b^2
The margins below are 2^-36 of these products, with a floor for what underflows. Where something overflows or is no
number the comparison is false, and the sphere stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from flint import arb, fmpq

MARGIN: Final = 2.0**-36
FLOOR: Final = 1e-270
ROUNDED: Final = 2.0**-51


class Near:
    """The spheres as float64; `unit` is the length that 1 stands for in the rays that are asked about."""

    def __init__(self, centers: Sequence[tuple[float, float, float]], radii: Sequence[float], unit: fmpq) -> None:
        self.centers = np.array(centers, dtype=np.float64).T.copy()
        self.r2 = np.square(np.array(radii, dtype=np.float64))
        self.sizes = np.abs(self.centers).sum(axis=0) + np.array(radii, dtype=np.float64)
        self.unit = unit

    def of_ray(self, origin: tuple[Any, Any, Any], way: tuple[Any, Any, Any]) -> list[int]:
        """Indices of the spheres that origin + s way, s > 0, could meet."""
        return self._kept(origin, way, arb(1), None)

    def of_segment(
        self, origin: tuple[Any, Any, Any], way: tuple[Any, Any, Any], inside: npt.NDArray[np.bool_]
    ) -> list[int]:
        """Indices of the spheres that origin + s way, 0 < s < 1, could meet; `inside`: those that hold its end."""
        return self._kept(origin, way, arb(self.unit), inside)

    def _kept(
        self,
        origin: tuple[Any, Any, Any],
        way: tuple[Any, Any, Any],
        factor: arb,
        inside: npt.NDArray[np.bool_] | None,
    ) -> list[int]:
        length = arb(self.unit)
        (px, py, pz), p_size, p_fine = _floats([arb(c) * length for c in origin])
        (wx, wy, wz), w_size, w_fine = _floats([arb(c) * factor for c in way])
        if not (p_fine and w_fine):
            return list(range(self.r2.size))
        with np.errstate(all="ignore"):
            x, y, z = self.centers
            mx, my, mz = x - px, y - py, z - pz
            along = mx * wx + my * wy + mz * wz
            w2 = wx * wx + wy * wy + wz * wz
            kx, ky, kz = my * wz - mz * wy, mz * wx - mx * wz, mx * wy - my * wx
            product = (self.sizes + p_size) * w_size
            away = along < -(MARGIN * product + FLOOR)
            away |= self.r2 * w2 - (kx * kx + ky * ky + kz * kz) < -(MARGIN * (product * product) + FLOOR)
            if inside is not None:
                away |= (along - w2 > MARGIN * (product + w_size * w_size) + FLOOR) & ~inside
        kept: list[int] = np.flatnonzero(~away).tolist()
        return kept


def _floats(balls: list[arb]) -> tuple[tuple[float, float, float], float, bool]:
    """(float64 of each, the sum of their magnitudes, whether they are as near as the module's docstring says)."""
    x, y, z = map(float, balls)
    size = abs(x) + abs(y) + abs(z)
    return (x, y, z), size, all(float(part.rad()) <= ROUNDED * size for part in balls)
