"""Families by levels: each case at each level against the truth, and one row for each pair.

Comes in: families or a scene's own hard points, levels, how many, a seed. Goes out: Report. Never done here: printing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from symrender_cg.errors import AccuracyError, OutsidePlanError
from symrender_cg.scene import Scene
from symrender_cg.stress.cases import Case, Family
from symrender_cg.stress.conditioning import condition_at
from symrender_cg.stress.measure import outcome_of, outcomes_at, truth_of
from symrender_cg.stress.promises import Outcome, broken
from symrender_cg.stress.truth import Truth, truth

COUNT = 200
"""Cases of a family, unless told."""
SEED = 1


@dataclass(frozen=True, slots=True)
class Row:
    """A level on the cases of a family, or on one set of hard points of a scene.

    cases       how many were looked at; refused: so many the level refused, or that had to be refused
    ulp, error  the largest, in units of the last place of the level's format and absolute; without those that flipped
    hit_flips, zero_flips, non_finite, wrong    how many, see Outcome; wrong: another float than the nearest
    broken      cases that break what the level states; first: the worst of these, in words
    worst       the case to look at first
    """

    family: str
    level: str
    cases: int
    refused: int
    ulp: float
    error: float
    hit_flips: int
    zero_flips: int
    non_finite: int
    wrong: int
    broken: int
    first: str
    worst: Case | None
    worst_outcome: Outcome | None


@dataclass(frozen=True, slots=True)
class Report:
    """The rows, family by family, level by level; and how many cases the oracle left open."""

    rows: tuple[Row, ...]
    seed: int
    undecided: int

    @property
    def holds(self) -> bool:
        """Whether every level keeps what it states."""
        return all(row.broken == 0 for row in self.rows)

    def require(self) -> None:
        """Raises AccuracyError that names level, family and case of the first promise that is broken."""
        failures = [row for row in self.rows if row.broken]
        if failures:
            row = failures[0]
            more = f" ({len(failures)} of {len(self.rows)} rows broken)" if len(failures) > 1 else ""
            raise AccuracyError(
                f"{row.level} on {row.family}: {row.broken} of {row.cases} cases break what is stated; "
                f"{row.first}{more}"
            )


def run(
    families: Iterable[Family],
    levels: Iterable[str],
    *,
    count: int = COUNT,
    seed: int = SEED,
    done: Callable[[int], None] | None = None,
) -> Report:
    """`count` cases of each family at each level; `done` is told of every case and level."""
    chosen = tuple(levels)
    rows: list[Row] = []
    undecided = 0
    for family in families:
        cases = []
        for case in family.cases(seed, count):
            try:
                cases.append((case, truth_of(case)))
            except AccuracyError:
                undecided += 1
        for level in chosen:
            outcomes = []
            for case, true in cases:
                outcomes.append((case, outcome_of(case, level, true)))
                if done is not None:
                    done(1)
            rows.append(row_of(family.name, level, outcomes))
    return Report(tuple(rows), seed, undecided)


def run_scene(
    sets: Iterable[tuple[str, Scene, list[tuple[float, float]]]],
    levels: Iterable[str],
    *,
    seed: int = SEED,
    done: Callable[[int], None] | None = None,
) -> Report:
    """A scene's hard points, (name, scene, points) a set, at each level."""
    chosen = tuple(levels)
    rows: list[Row] = []
    undecided = 0
    for name, scene, points in sets:
        kept, true, left = _truth_of_points(scene, points)
        undecided += left
        cases = [Case(name, number, scene, x, y, name) for number, (x, y) in enumerate(kept)]
        for level in chosen:
            found = outcomes_at(scene, kept, level, true) if true is not None else ()
            rows.append(row_of(name, level, list(zip(cases, found, strict=True))))
            if done is not None:
                done(len(kept))
    return Report(tuple(rows), seed, undecided)


def _truth_of_points(
    scene: Scene, points: list[tuple[float, float]]
) -> tuple[list[tuple[float, float]], Truth | None, int]:
    """The points that the oracle decides, their truth, and how many it does not."""
    if not points:
        return points, None, 0
    try:
        return points, truth(scene, [x for x, _ in points], [y for _, y in points]), 0
    except AccuracyError:
        kept = [point for point in points if _decided(scene, point)]
    if not kept:
        return kept, None, len(points)
    return kept, truth(scene, [x for x, _ in kept], [y for _, y in kept]), len(points) - len(kept)


def _decided(scene: Scene, point: tuple[float, float]) -> bool:
    try:
        truth(scene, *point)
    except AccuracyError:
        return False
    return True


def row_of(name: str, level: str, outcomes: list[tuple[Case, Outcome]]) -> Row:
    """The row of a level's outcomes."""
    answered = [(case, outcome) for case, outcome in outcomes if outcome.refused is None]
    failures = []
    for case, outcome in answered:
        if case.refused:
            failures.append((case, outcome, "a value of what has no image"))
        elif case.scene is not None and (why := broken(level, case.scene, outcome)):
            failures.append((case, outcome, why))
    first = ""
    if failures:
        case, _, why = max(failures, key=lambda failure: failure[1].badness)
        first = f"{case.name} ({case.note}): {why}"
    worst = max(answered, key=lambda pair: (pair[1].badness, pair[1].error), default=None)
    finite = [outcome for _, outcome in answered if not outcome.non_finite]
    return Row(
        family=name,
        level=level,
        cases=len(outcomes),
        refused=len(outcomes) - len(answered),
        ulp=max((outcome.ulp for outcome in finite), default=0.0),
        error=max((outcome.error for outcome in finite), default=0.0),
        hit_flips=sum(outcome.hit_flip for _, outcome in answered),
        zero_flips=sum(outcome.zero_flip for _, outcome in answered),
        non_finite=sum(outcome.non_finite for _, outcome in answered),
        wrong=sum(outcome.wrong for _, outcome in answered),
        broken=len(failures),
        first=first,
        worst=None if worst is None else worst[0],
        worst_outcome=None if worst is None else worst[1],
    )


def input_move(row: Row) -> float | None:
    """How far half an ulp of every input moves the true value at the row's worst case, absolute; inf where it flips.

    None where there is no such case, or where the derivatives leave float64.
    """
    worst = row.worst
    if worst is None or worst.scene is None or worst.refused:
        return None
    try:
        moved = float(condition_at(worst.scene, [worst.x], [worst.y]).absolute[0])
    except OutsidePlanError:
        return None
    return None if math.isnan(moved) else moved


def limited(value: float) -> float | None:
    """The number, None where it is infinite or NaN, as JSON has it."""
    return value if math.isfinite(value) else None
