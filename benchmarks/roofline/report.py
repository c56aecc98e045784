"""The roofline as records and tables. Comes in: rows. Goes out: tables, dictionaries. Never here: a measurement."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.machine import Machine
from benchmarks.roofline.counting import KINDS


@dataclass(frozen=True, slots=True)
class Row:
    """A kernel at one size.

    operations   of a pixel of the sphere, by kind
    flops        of a pixel of the image, on average: background is no work where it is filled
    bytes        stored a pixel
    measured_ns  a pixel of the image
    pipes_ns     the least that multiplications, additions and selects take
    divider_ns   the least that divisions and square roots take
    store_ns     what filling the same array takes
    """

    kernel: str
    size: int
    operations: dict[str, float]
    flops: float
    bytes: int
    measured_ns: float
    pipes_ns: float
    divider_ns: float
    store_ns: float

    @property
    def intensity(self) -> float:
        """Operations a byte that is stored."""
        return self.flops / self.bytes

    @property
    def gflops(self) -> float:
        """10^9 operations a second."""
        return self.flops / self.measured_ns

    @property
    def bounds(self) -> dict[str, float]:
        """The three bounds by name, in ns a pixel of the image."""
        return {"pipes": self.pipes_ns, "divider": self.divider_ns, "stores": self.store_ns}

    @property
    def bound(self) -> str:
        """The name of the largest bound."""
        return max(self.bounds, key=lambda name: self.bounds[name])

    @property
    def times_bound(self) -> float:
        """How many times the largest bound the kernel takes; 1 is the roof."""
        return self.measured_ns / self.bounds[self.bound]


@dataclass(frozen=True, slots=True)
class Report:
    """What `roofline` measured. peaks: 10^9 operations a second by format and kind; stores: bytes a ns by side."""

    machine: Machine
    rounds: int
    peaks: dict[str, dict[str, float]]
    stores: dict[str, dict[str, float]]
    rows: tuple[Row, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """The machine's peaks, then a line a kernel and size."""
        console.print(self.machine.line(), highlight=False)
        console.print(self._peaks_table())
        console.print(self._operations_table())
        console.print(self._kernel_table())
        console.print(
            "Operations: counted in the lowered program and in the functions it calls; int: bit operations, not in a "
            "bound. Bounds and times: ns a pixel of the image, one thread, best of the rounds. pipes: mul, add and "
            "select at the machine's rate; divider: div and sqrt; stores: a fill of the same array."
        )

    def _peaks_table(self) -> Table:
        kinds = list(next(iter(self.peaks.values())))
        sizes = list(next(iter(self.stores.values())))
        table = Table(title=f"one core: 10^9 operations a second; GB/s stored; best of {self.rounds} rounds")
        for head in ("format", *kinds, *(f"{size}²" for size in sizes)):
            table.add_column(head, justify="left" if head == "format" else "right")
        for form, peaks in self.peaks.items():
            stores = (f"{self.stores[form][size]:.0f}" for size in sizes)
            table.add_row(form, *(f"{peaks[kind]:.1f}" for kind in kinds), *stores)
        return table

    def _operations_table(self) -> Table:
        table = Table(title="operations of a pixel of the sphere")
        kinds = [kind for kind in KINDS if any(row.operations.get(kind) for row in self.rows)]
        for head in ("kernel", *kinds, "flop/byte"):
            table.add_column(head, justify="left" if head == "kernel" else "right")
        for row in {row.kernel: row for row in self.rows}.values():
            counts = (f"{row.operations.get(kind, 0.0):g}" for kind in kinds)
            table.add_row(row.kernel, *counts, f"{row.intensity:.1f}")
        return table

    def _kernel_table(self) -> Table:
        table = Table(title="kernels beside their bounds")
        for head in ("kernel", "size", "pipes", "divider", "stores", "time", "GFLOP/s", "times the bound", "bound"):
            table.add_column(head, justify="left" if head in ("kernel", "bound") else "right")
        for row in self.rows:
            table.add_row(
                row.kernel,
                f"{row.size}²",
                *(f"{value:.2f}" for value in row.bounds.values()),
                f"{row.measured_ns:.2f}",
                f"{row.gflops:.0f}",
                f"{row.times_bound:.2f}",
                row.bound,
            )
        return table
