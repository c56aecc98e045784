"""`python -m benchmarks scaling compile`: seconds from a scene to a library, by kernel and compiler.

Comes in: rounds. Goes out: CompileReport and its table: derivation (plan to C text), lines of C, and the compiler's
seconds and bytes of the library under gcc and clang, whichever there are. Compilers take turns; nothing is cached.
Never done here: an image.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from benchmarks.machine import Machine, Spread, spread, take_turns, this_machine
from symrender_cg import Scene, translate
from symrender_cg.build import Toolchain, compile_library, find_toolchain
from symrender_cg.errors import CompileError, ToolchainError

COMPILERS: Final = ("gcc", "clang")
KERNELS: Final = (
    ("chapter1", "literal", False),
    ("chapter1", "fast", False),
    ("chapter1", "single", False),
    ("chapter1", "double", False),
    ("chapter1", "double", True),
    ("chapter1", "stable", False),
    ("chapter1", "certified", False),
    ("shadow", "double", False),
    ("lights", "double", False),
    ("mirrors", "double", False),
    ("mirrors", "stable", False),
)
"""(built-in scene, accuracy, baked)"""
MOST_ROUNDS: Final = 3


@dataclass(frozen=True, slots=True)
class Row:
    """One kernel. bytes and seconds by compiler; failed: what a compiler said that refused it."""

    scene: str
    accuracy: str
    baked: bool
    derive_seconds: float
    lines: int
    compile_seconds: dict[str, Spread]
    library_bytes: dict[str, int]
    failed: dict[str, str]


@dataclass(frozen=True, slots=True)
class CompileReport:
    """What `scaling compile` measured."""

    machine: Machine
    compilers: dict[str, str]
    missing: tuple[str, ...]
    rounds: int
    rows: tuple[Row, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """One line a kernel."""
        console.print(self.machine.line(), highlight=False)
        for name, version in self.compilers.items():
            console.print(f"{name}: {version}", highlight=False)
        for line in self.missing:
            console.print(line, highlight=False)
        table = Table(title=f"seconds to build a kernel, {self.rounds} rounds")
        heads = [head for name in self.compilers for head in (f"{name} s", f"{name} kB")]
        for head in ("scene", "accuracy", "derive s", "lines of C", *heads):
            table.add_column(head, justify="left" if head in ("scene", "accuracy") else "right")
        for row in self.rows:
            cells = []
            for name in self.compilers:
                seconds = row.compile_seconds.get(name)
                cells.append("failed" if seconds is None else f"{seconds.median:.2f}")
                cells.append("-" if seconds is None else f"{row.library_bytes[name] / 1000.0:.0f}")
            level = f"{row.accuracy}{', baked' if row.baked else ''}"
            table.add_row(row.scene, level, f"{row.derive_seconds:.2f}", str(row.lines), *cells)
        console.print(table)
        for row in self.rows:
            for name, why in row.failed.items():
                console.print(f"{row.scene}, {row.accuracy}, {name}: {why}", highlight=False)


def measure_compiling(rounds: int, told: Callable[[str], None]) -> CompileReport:
    """Every kernel under every compiler; told(text) says what is going on."""
    toolchains, missing = compilers()
    some = min(rounds, MOST_ROUNDS)
    told("a first derivation, which imports sympy")
    translate(Scene.builtin("chapter1"))
    rows = tuple(_row(*kernel, toolchains, some, told) for kernel in KERNELS)
    versions = {name: toolchain.version for name, toolchain in toolchains.items()}
    return CompileReport(this_machine(), versions, missing, some, rows)


def compilers() -> tuple[dict[str, Toolchain], tuple[str, ...]]:
    """(the compilers that are there, a sentence for each that is not)"""
    found, missing = {}, []
    for name in COMPILERS:
        with _chosen(name):
            try:
                found[name] = find_toolchain()
            except ToolchainError:
                missing.append(f"{name} is not installed and left out; apt-get install {name}")
    return found, tuple(missing)


@contextmanager
def _chosen(compiler: str) -> Iterator[None]:
    """CC names this compiler meanwhile."""
    before = os.environ.get("CC")
    os.environ["CC"] = compiler
    try:
        yield
    finally:
        if before is None:
            del os.environ["CC"]
        else:
            os.environ["CC"] = before


def _row(
    scene: str, accuracy: str, baked: bool, toolchains: dict[str, Toolchain], rounds: int, told: Callable[[str], None]
) -> Row:
    told(f"{scene}, {accuracy}{', baked' if baked else ''}")
    start = time.perf_counter()
    emitted = translate(Scene.builtin(scene), accuracy, bake=baked).emitted
    derived = time.perf_counter() - start
    sizes: dict[str, int] = {}
    failed: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="symrender_compile_") as folder:

        def compiled(name: str) -> float:
            place = Path(folder, name)
            place.mkdir(exist_ok=True)
            try:
                seconds = compile_library(emitted.files, place / "kernel.so", toolchain=toolchains[name]).seconds
            except CompileError as problem:
                failed[name] = str(problem).splitlines()[0]
                return float("nan")
            sizes[name] = (place / "kernel.so").stat().st_size
            return seconds

        calls: dict[str, Callable[[], float]] = {name: partial(compiled, name) for name in toolchains}
        samples = take_turns(calls, rounds, 1, lambda number: None)
    times = {name: spread(taken) for name, taken in samples.items() if name not in failed}
    lines = len(emitted.files[f"{emitted.name}.c"].splitlines())
    return Row(scene, accuracy, baked, derived, lines, times, sizes, failed)
