"""What `check` found: Row, one evaluator on one set of points; Report, all of them and the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from symrender_cg.errors import AccuracyError

STATED_ULP: Final = {"stable": 4.0, "certified": 0.5}
"""What levels that prove their values state of them, in units of the last place of float64."""
FAST_SHININESS: Final = 1000.0
"""The exponent up to which `fast` states a bound."""


@dataclass(frozen=True, slots=True)
class Row:
    """One evaluator on one set of points.

    evaluator    `kernel double`, `numpy stable`, `numpy literal`, `per pixel`; of scenes `kernel double`, `brute force`
    accuracy     of a kernel, else empty
    where        the set of points;  count: how many were compared
    max_ulp, max_abs      largest error against the oracle, in ulp of the answer and absolute; where a bound in ulp is
                 stated, a 0 in place of another value, or the other way round, is infinitely many ulp
    wrong_hits   points where hit or miss, of scenes what is seen, differs from the oracle's exact decision
    in_doubt     points that miss the bound, and whose value rests on a decision within rounding: a gated highlight at
                 the terminator, of scenes also a shadow's or a tile's edge, an outline in a mirror; the field jumps
                 there, and no bound is stated of them; they are left out of the errors
    non_finite   values that are NaN or infinite where the truth is not
    from_numpy, from_per_pixel    largest absolute difference of a kernel from the float references, None for those
    bound        the stated bound on max_abs, None where none is stated;  bound_ulp: the same on max_ulp
    """

    evaluator: str
    accuracy: str
    where: str
    count: int
    max_ulp: float
    max_abs: float
    wrong_hits: int
    in_doubt: int
    non_finite: int
    from_numpy: float | None = None
    from_per_pixel: float | None = None
    bound: float | None = None
    bound_ulp: float | None = None

    @property
    def states(self) -> bool:
        """Whether anything is stated of this evaluator."""
        return self.bound is not None or self.bound_ulp is not None

    @property
    def holds(self) -> bool:
        """Whether what is stated holds: the bounds, no wrong hit, nothing that is not finite. True where nothing is."""
        if not self.states:
            return True
        if (self.bound is not None and self.max_abs > self.bound) or self._misses_ulp:
            return False
        return self.wrong_hits == 0 and self.non_finite == 0

    @property
    def _misses_ulp(self) -> bool:
        return self.bound_ulp is not None and self.max_ulp > self.bound_ulp

    @property
    def stated(self) -> str:
        """The error beside the bound that it misses, else beside the one that is stated; in words."""
        if self.bound is None or self._misses_ulp:
            return f"largest error {self.max_ulp:.3g} ulp, stated bound {self.bound_ulp:g} ulp"
        return f"largest error {self.max_abs:.3g}, stated bound {self.bound:.3g}"


@dataclass(frozen=True, slots=True)
class Report:
    """All rows, the image's size, and how many points the per-pixel loop computed of each set (it draws no scenes)."""

    width: int
    height: int
    per_pixel_points: dict[str, int]
    rows: tuple[Row, ...]

    def require(self) -> None:
        """Raises AccuracyError naming the first row whose stated bound is broken."""
        for row in self.rows:
            if not row.holds:
                broken = sum(not r.holds for r in self.rows)
                raise AccuracyError(
                    f"{row.evaluator}, {row.where}: {row.stated}; "
                    f"{row.wrong_hits} wrong hits, {row.non_finite} values not finite, both stated as 0 "
                    f"({broken} of {len(self.rows)} rows broken); please report the scene"
                )
