"""Laws of the machine code of the kernels: inner loops stay vector code of full width, and take no more arithmetic.

tests/vector_widths.txt holds what gcc made of each vectorised loop of generated/. Nothing is run and nothing is timed,
so a busy machine changes no verdict. When loops change for good: python -m pytest tests/test_vector_widths.py --update
"""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from symrender_cg.build.instructions import FAMILIES, Counted, counted
from symrender_cg.build.reports import Goal, goals, loops_of
from symrender_cg.build.toolchain import run_compiler

ROOT = Path(__file__).resolve().parents[1]
GENERATED = ROOT / "generated"
TABLE = Path(__file__).with_name("vector_widths.txt")
UPDATE = "python -m pytest tests/test_vector_widths.py --update"
KERNELS = tuple(sorted(path.stem for path in GENERATED.glob("*/*.c")))
PROCESSORS = ("x86-64-v3", "x86-64-v4")
OTHER_VERSIONS = 1.25
"""Another major version of gcc than the table's may take this much more."""

MOVES = 1.05
"""Instructions of all kinds may be this many more: moves between registers come and go."""

SHADING = {"span_surface", "plane_surface", "reach", "shade_matte", "shade_glossy", "cast_shadows", "find_in_mirror"}
"""Functions of scene kernels whose inner loops are where the time goes."""

HEADINGS = ("function", "loop", "processor", "bytes", "values", "code", *FAMILIES)
EXPLANATION = """\
# Loops of generated/ that gcc makes vector code of, as counted in its assembly. bytes: of a vector. values: how many
# one turn writes. code: instructions of a turn. div to fma: packed operations for one value. Where values is 0 there
# is no packed arithmetic, and the width alone is held.
# Written by: {update}
# gcc {version}
"""


@dataclass(frozen=True)
class Row:
    """What a loop of a kernel costs on a processor; `place` is (kernel, function, what it does, processor)."""

    place: tuple[str, str, str, str]
    bytes: int
    values: int
    code: int
    arithmetic: dict[str, float]


def goal_of(processor: str) -> Goal:
    """gcc for a processor; the test is skipped where it is not installed."""
    for goal in goals():
        if (goal.kind, goal.processor) == ("gcc", processor):
            return goal
    pytest.skip("gcc for x86-64 is not installed: apt install gcc (elsewhere gcc-x86-64-linux-gnu)")


def gcc_version() -> int:
    """The major version of the gcc that is asked."""
    answer = run_compiler((goal_of(PROCESSORS[0]).command[0], "-dumpversion")).stdout
    return int(answer.split(".")[0])


def sources_of(kernel: str) -> dict[str, str]:
    paths = (*(GENERATED / kernel).glob("*.[ch]"), *(GENERATED / "support").glob("*.h"))
    return {path.name: path.read_text() for path in sorted(paths)}


@functools.cache
def vector_code(kernel: str, processor: str) -> tuple[Counted, ...]:
    """The loops of a kernel that are vector code; each kernel is compiled once a processor."""
    return counted(sources_of(kernel), f"{kernel}.c", goal_of(processor))


@functools.cache
def found(kernel: str, processor: str) -> tuple[Row, ...]:
    """The rows of a kernel as its C compiles today; loops that do the same in one function are numbered."""
    rows: dict[tuple[str, str, str, str], Row] = {}
    for entry in vector_code(kernel, processor):
        function, does = entry.loop.function.removeprefix(f"{kernel}_"), entry.loop.does[:60].replace("|", "/").strip()
        place, number = (kernel, function, does, processor), 1
        while place in rows:
            number += 1
            place = (kernel, function, f"{does} ({number})", processor)
        rows[place] = row_of(place, entry)
    return tuple(rows.values())


def row_of(place: tuple[str, str, str, str], entry: Counted) -> Row:
    rounded = {family: round(count, 1) for family, count in entry.arithmetic.items()}
    return Row(place, entry.bytes, entry.values, entry.instructions, rounded)


def recorded() -> dict[tuple[str, str, str, str], Row]:
    """The table, by place."""
    rows = {}
    kernel = ""
    for line in TABLE.read_text().splitlines():
        cells = tuple(cell.strip() for cell in line.split("|"))
        if line.startswith("["):
            kernel = line.strip("[]")
        elif len(cells) == len(HEADINGS) and cells != HEADINGS:
            function, does, processor, *numbers = cells
            place = (kernel, function, does, processor)
            arithmetic = dict(zip(FAMILIES, map(float, numbers[3:]), strict=True))
            rows[place] = Row(place, int(numbers[0]), int(numbers[1]), int(numbers[2]), arithmetic)
    return rows


def recorded_version() -> int:
    (version,) = re.findall(r"^# gcc (\d+)$", TABLE.read_text(), re.MULTILINE)
    return int(version)


def write_table() -> None:
    sections = []
    for kernel in KERNELS:
        cells = [HEADINGS]
        rows = [row for processor in PROCESSORS for row in found(kernel, processor)]
        for row in sorted(rows, key=lambda row: row.place):
            numbers = (row.bytes, row.values, row.code, *(f"{row.arithmetic[family]:g}" for family in FAMILIES))
            cells.append((*row.place[1:], *map(str, numbers)))
        columns = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = []
        for line in cells:
            words = [*map(str.ljust, line[:3], columns), *map(str.rjust, line[3:], columns[3:])]
            lines.append(" | ".join(words).rstrip())
        sections.append(f"[{kernel}]\n" + "\n".join(lines) + "\n")
    TABLE.write_text(EXPLANATION.format(update=UPDATE, version=gcc_version()) + "\n" + "\n".join(sections))


@pytest.fixture(scope="module")
def table(request: pytest.FixtureRequest) -> dict[tuple[str, str, str, str], Row]:
    """What is recorded, brought up to date first if that was asked."""
    goal_of(PROCESSORS[0])
    if request.config.getoption("--update"):
        write_table()
    return recorded()


def complaints(row: Row, ceiling: Row, room: float) -> list[str]:
    """In what a loop is worse than recorded."""
    worse = []
    if row.bytes < ceiling.bytes:
        worse.append(f"vectors of {row.bytes} bytes, not {ceiling.bytes}")
    if row.values and ceiling.values:
        pairs = [(name, row.arithmetic[name], ceiling.arithmetic[name]) for name in FAMILIES]
        worse += [f"{new:g} {name} a value, more than {old:g}" for name, new, old in pairs if new > old * room + 0.05]
        code, before = row.code / row.values, ceiling.code / ceiling.values
        if code > before * max(room, MOVES):
            worse.append(f"{code:.2f} instructions a value, more than {before:.2f}")
    elif row.values != ceiling.values:
        worse.append("packed arithmetic where there was none" if row.values else "no packed arithmetic any more")
    return worse


@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.parametrize("kernel", KERNELS)
def test_no_loop_loses_its_width_or_takes_more_arithmetic_than_recorded(
    kernel: str, processor: str, table: dict[tuple[str, str, str, str], Row]
) -> None:
    room = 1.0 if gcc_version() == recorded_version() else OTHER_VERSIONS
    here = {row.place: row for row in found(kernel, processor)}
    problems = []
    for place, ceiling in table.items():
        if place[0] == kernel and place[3] == processor:
            name = f"{place[1]}: {place[2]}"
            if place not in here:
                problems.append(f"{name}: no vector code any more, or another loop")
            else:
                problems += [f"{name}: {text}" for text in complaints(here[place], ceiling, room)]
    if room == 1.0:
        problems += [f"{place[1]}: {place[2]}: a new loop" for place in here if place not in table]
    if problems:
        lines = "\n  ".join(problems)
        pytest.fail(f"{kernel} for {processor}:\n  {lines}\nIf this change is meant: {UPDATE}", pytrace=False)


@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.parametrize("kernel", [kernel for kernel in KERNELS if not kernel.endswith("_enclosure")])
def test_the_loops_that_shade_fill_the_registers_whatever_is_recorded(kernel: str, processor: str) -> None:
    file = f"{kernel}.c"
    sources, lines = sources_of(kernel), sources_of(kernel)[file].splitlines()
    inner = [loop for loop in loops_of(sources[file]) if not loop.holds_loops]
    must = []
    for loop in inner:
        body = "\n".join(lines[loop.line - 1 : loop.last])
        shades = re.search(r"\b(shade|stage_\d+|sight)\(", body) is not None and "hits_exactly(" not in body
        in_scene = kernel.startswith("scene_") and loop.function in SHADING and "[i] =" in body
        if (shades and not kernel.startswith("scene_")) or in_scene:
            must.append(loop)
    assert len(must) >= 2, "the pixels of a row, and points"
    seen = {entry.loop.line: (entry.bytes, entry.values > 0) for entry in vector_code(kernel, processor)}
    full = (goal_of(processor).bytes, True)
    assert {loop.line: seen.get(loop.line) for loop in must} == {loop.line: full for loop in must}


KNOWN = {
    "known.c": """\
#include <math.h>
void known(const double *restrict x, double *restrict y, int n);
void narrow(const float *restrict x, float *restrict y, int n);
void known(const double *restrict x, double *restrict y, int n)
{
    for (int i = 0; i < n; ++i)
        y[i] = sqrt(x[i]) / (x[i] * x[i] + 2.0 EXTRA);
    for (int i = 0; i < n; ++i)
        y[i] = fma(y[i], x[i], 3.0) - 1.0;
}
void narrow(const float *restrict x, float *restrict y, int n)
{
    for (int i = 0; i < n; ++i)
        y[i] = x[i] * x[i] * 3.0f;
    for (int i = 1; i < n; ++i)
        y[i] = y[i - 1] * x[i] + 1.0f;
}
"""
}


def known(processor: str, extra: str = "", *flags: str) -> tuple[Counted, ...]:
    goal = goal_of(processor)
    asked = Goal(goal.kind, goal.processor, (*goal.command, f"-DEXTRA={extra}", *flags), goal.bytes)
    return counted(KNOWN, "known.c", asked)


@pytest.mark.parametrize("processor", PROCESSORS)
def test_the_arithmetic_of_a_plain_loop_is_counted_to_the_instruction(processor: str) -> None:
    full = goal_of(processor).bytes
    first, second, third = known(processor)
    assert [entry.loop.line for entry in (first, second, third)] == [6, 8, 13]
    assert {entry.bytes for entry in (first, second, third)} == {full}
    assert (first.values, second.values, third.values) == (full // 8, full // 8, full // 4)
    assert first.arithmetic == {"div": 1, "sqrt": 1, "mul": 1, "add": 1, "fma": 0}
    assert second.arithmetic == {"div": 0, "sqrt": 0, "mul": 0, "add": 1, "fma": 1}
    assert third.arithmetic == {"div": 0, "sqrt": 0, "mul": 2, "add": 0, "fma": 0}


def test_one_more_division_and_a_lost_vectorisation_are_complaints() -> None:
    place = ("known", "known", "y", "x86-64-v3")
    before, after = (row_of(place, known("x86-64-v3", extra)[0]) for extra in ("", "/x[i]"))
    assert complaints(before, before, 1.0) == []
    assert complaints(after, before, 1.0)[0] == "2 div a value, more than 1"
    assert known("x86-64-v3", "", "-fno-tree-vectorize") == ()
    assert complaints(row_of(place, known("x86-64-v3", "", "-mprefer-vector-width=128")[0]), before, 1.0)[0] == (
        "vectors of 16 bytes, not 32"
    )
