"""What the contest found, as records and as tables.

Comes in: rows. Goes out: tables on a console, plain dictionaries for JSON. Never done here: a measurement.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.machine import Machine, Spread
from symrender_cg.reference.compare import Errors


@dataclass(frozen=True, slots=True)
class Row:
    """One contestant in one case.

    ns_a_pixel       one thread; several_threads: the same with so many of them
    times_base       over our kernel's time in the same round, None where that is missing
    errors           of chosen pixels of the image, unclipped, against the oracle
    outline_flips    hit or miss wrong, of the points of the close-up of the outline
    arrangement      the fastest of its arrangements
    compile_seconds  from its formula to its first image in this case, less a warm one
    """

    case: str
    title: str
    ours: bool
    ns_a_pixel: Spread
    times_base: Spread | None
    several_threads: dict[str, Spread]
    errors: Errors
    outline_flips: int
    arrangement: str
    compile_seconds: float


@dataclass(frozen=True, slots=True)
class Start:
    """Seconds from the start of a contestant's process to its first image, 256 x 256."""

    title: str
    ours: bool
    seconds: float


@dataclass(frozen=True, slots=True)
class Report:
    """What `peers` measured. points: how many of the image and of the close-up; bases: by case, whose time is 1."""

    machine: Machine
    size: int
    rounds: int
    points: tuple[int, int]
    seed: int
    cases: tuple[str, ...]
    bases: dict[str, str]
    versions: dict[str, str]
    absent: dict[str, str]
    failed: dict[str, str]
    rows: tuple[Row, ...]
    starts: tuple[Start, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def of(self, case: str) -> list[Row]:
        """The rows of a case, the slowest first, ours after the peers."""
        return sorted((r for r in self.rows if r.case == case), key=lambda r: (r.ours, -r.ns_a_pixel.median))

    def best_peer(self, case: str) -> Row | None:
        """The fastest contestant of a case that is not ours."""
        return min((r for r in self.of(case) if not r.ours), key=lambda r: r.ns_a_pixel.median, default=None)

    def show(self, console: Console) -> None:
        """A table a case, then the cold starts, and who is missing."""
        console.print(self.machine.line(), highlight=False)
        console.print(", ".join(f"{title} {version}" for title, version in self.versions.items()), highlight=False)
        for case in self.cases:
            console.print(self._case_table(case))
        console.print(
            f"Times: {self.size} x {self.size}, unclipped, warm, one thread on one processor unless the column says "
            f"more, median (quartiles) of {self.rounds} rounds in which all contestants take turns, each in its "
            "fastest arrangement; in a round the fastest call of 15 ms counts. Errors: against the oracle "
            f"on {self.points[0]:,} pixels (seed {self.seed}), ulp of the format; flips: hit or miss wrong, of these "
            f"pixels and of {self.points[1]:,} points of the outline two floats apart. Compile: to the first image of "
            "the case, less a warm one.",
            highlight=False,
        )
        console.print(self._start_table())
        for title, why in (*self.absent.items(), *self.failed.items()):
            console.print(f"{title}: {why}", highlight=False)

    def _case_table(self, case: str) -> Table:
        rows = self.of(case)
        threads = sorted({int(n) for row in rows for n in row.several_threads})
        table = Table(title=case)
        table.add_column("contestant")
        table.add_column("arrangement")
        heads = ("ns a pixel", f"times {self.bases[case]}", *(f"ns, {n} threads" for n in threads))
        for head in (*heads, "largest error", "ulp", "flips", "of the outline", "compile s"):
            table.add_column(head, justify="right")
        for row in rows:
            several = [row.several_threads.get(str(n)) for n in threads]
            table.add_row(
                f"[bold]{row.title}[/bold]" if row.ours else row.title,
                row.arrangement,
                row.ns_a_pixel.shown(),
                "-" if row.times_base is None else f"{row.times_base.median:.2f}",
                *("-" if value is None else f"{value.median:.2f}" for value in several),
                f"{row.errors.max_abs:.1e}",
                f"{row.errors.max_ulp:,.0f}",
                str(row.errors.flips + row.errors.nonfinite),
                f"{row.outline_flips:,}",
                f"{row.compile_seconds:.2f}",
            )
        known = {row.title for row in rows}
        for title, why in (*self.absent.items(), *self.failed.items()):
            if title not in known:
                table.add_row(title, why, *["-"] * (len(table.columns) - 2))
        return table

    def _start_table(self) -> Table:
        table = Table(title="cold start: from before the process starts to its first image, 256 x 256")
        table.add_column("contestant")
        table.add_column("seconds", justify="right")
        for start in self.starts:
            table.add_row(f"[bold]{start.title}[/bold]" if start.ours else start.title, f"{start.seconds:.2f}")
        return table
