"""Text for people: tables, times and counts; by rich on a terminal, plain elsewhere.

Comes in: rows of text. Goes out: lines on stdout. rich is imported only where a table goes to a terminal.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

FOLDED_WIDTH = 30
"""The last column of a table is not made narrower than this on a terminal."""


@dataclass(frozen=True, slots=True)
class Column:
    """A head, and whether its cells are set to the right, as numbers are."""

    head: str
    right: bool = False


@dataclass(slots=True)
class Table:
    """Rows of cells under heads; `section` draws a line before the next row."""

    columns: tuple[Column, ...]
    rows: list[tuple[str, ...] | None] = field(default_factory=list)

    def add(self, *cells: str) -> None:
        """One more row; cells that are left out are empty."""
        assert len(cells) <= len(self.columns), "a row has no more cells than the table has columns"
        self.rows.append(cells + ("",) * (len(self.columns) - len(cells)))

    def section(self) -> None:
        """What follows belongs together and apart from what came before."""
        if self.rows and self.rows[-1] is not None:
            self.rows.append(None)

    def plain(self) -> str:
        """The table as aligned text, a blank line between sections."""
        heads = tuple(column.head for column in self.columns)
        filled = [heads, *(row for row in self.rows if row is not None)]
        widths = [max(len(row[i]) for row in filled) for i in range(len(heads))]
        lines = []
        for row in (heads, *self.rows):
            cells = row or ()
            padded = (
                cell.rjust(width) if column.right else cell.ljust(width)
                for cell, width, column in zip(cells, widths, self.columns, strict=False)
            )
            lines.append("  ".join(padded).rstrip())
        return "\n".join(lines)

    def show(self) -> None:
        """Prints the table to stdout. On a terminal only the last column is folded; one too narrow gets plain text."""
        if not sys.stdout.isatty():
            print(self.plain())
            return
        import shutil

        filled = [tuple(column.head for column in self.columns), *(row for row in self.rows if row is not None)]
        widths = [max(len(row[i]) for row in filled) for i in range(len(self.columns))]
        if sum(widths[:-1]) + 2 * len(widths) + min(widths[-1], FOLDED_WIDTH) > shutil.get_terminal_size().columns:
            print(self.plain())
            return
        from rich import box
        from rich.console import Console
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for column in self.columns:
            last = column is self.columns[-1]
            table.add_column(
                column.head, justify="right" if column.right else "left", no_wrap=not last, overflow="fold"
            )
        for row in self.rows:
            if row is None:
                table.add_section()
            else:
                table.add_row(*(Text(cell) for cell in row))
        Console().print(table)


def duration(seconds: float) -> str:
    """A time in the unit that leaves one to three digits before the point: `37.6 ms`, `1.24 s`, `0.42 us`."""
    for unit, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}" if seconds < 999.5 * unit else f"{seconds / unit:.0f} {name}"
    return f"{seconds / 1e-9:.3g} ns"


def size(count: int) -> str:
    """Bytes in a unit that a person reads: `812 bytes`, `1.4 MB`."""
    for unit, name in ((10**9, "GB"), (10**6, "MB"), (10**3, "kB")):
        if count >= unit:
            return f"{count / unit:.1f} {name}"
    return f"{count} byte{'' if count == 1 else 's'}"


def counted(count: int, thing: str) -> str:
    """`1 kernel`, `2 kernels`."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def listed(words: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1]))) if words else "none"
