"""What `check` found: Row, one evaluator on one set of points; Report, all of them and the verdict."""

from __future__ import annotations

from dataclasses import dataclass

from symrender_cg.errors import AccuracyError


@dataclass(frozen=True, slots=True)
class Row:
    """One evaluator on one set of points.

    evaluator    `kernel double`, `numpy stable`, `numpy literal`, `per pixel`; of scenes `kernel double`, `brute force`
    accuracy     of a kernel, else empty
    where        the set of points;  count: how many were compared
    max_ulp, max_abs      largest error against the oracle, in ulp of the answer and absolute
    wrong_hits   points where hit or miss, of scenes what is seen, differs from the oracle's exact decision
    in_doubt     points that miss the bound, and whose value rests on a decision within rounding: a gated highlight at
                 the terminator, of scenes also a shadow's or a tile's edge, an outline in a mirror; the field jumps
                 there, and no bound is stated of them; they are left out of the errors
    non_finite   values that are NaN or infinite where the truth is not
    from_numpy, from_per_pixel    largest absolute difference of a kernel from the float references, None for those
    bound        the stated bound on max_abs, None where none is stated
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

    @property
    def holds(self) -> bool:
        """Whether what is stated holds: the bound, no wrong hit, nothing that is not finite. True where nothing is."""
        if self.bound is None:
            return True
        return self.max_abs <= self.bound and self.wrong_hits == 0 and self.non_finite == 0


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
                    f"{row.evaluator}, {row.where}: largest error {row.max_abs:.3g}, stated bound {row.bound:.3g}; "
                    f"{row.wrong_hits} wrong hits, {row.non_finite} values not finite, both stated as 0 "
                    f"({broken} of {len(self.rows)} rows broken); please report the scene"
                )
