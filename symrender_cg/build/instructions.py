"""A kernel's C and an x86-64 compiler -> the packed arithmetic of each inner loop, counted in the assembly.

In:  sources by file name, a Goal for gcc. Out: one Counted a loop that became vector code.
Never here: a machine that runs it, or a time. A count is the same on a busy machine as on an idle one.

A loop of the assembly is what stands between a label and the last jump back to it with no such loop inside. Line marks
(.loc, from -g1, which changes no instruction) say which loop of the C it came from: one whose lines it has, else one
that calls the function whose lines it has, in the function of the assembly if it can be.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from symrender_cg.build.compile import run_checked, write_sources
from symrender_cg.build.reports import Goal, Loop, function_at, loops_of
from symrender_cg.build.vectorisation import GCC_ALL, heard_from_gcc

# After vectorising, gcc may unroll a loop over a short array whole, which leaves no turn to count: not in this compile.
AS_LOOPS = ("-fdisable-tree-cunroll",)
FAMILIES = {
    "div": re.compile(r"v?divp[sd]"),
    "sqrt": re.compile(r"v?sqrtp[sd]"),
    "mul": re.compile(r"v?mulp[sd]"),
    "add": re.compile(r"v?(add|sub)p[sd]"),
    "fma": re.compile(r"vfn?m(add|sub)\d+p[sd]"),
}
STORE = re.compile(r"v?mov(?:[au](?P<kind>p[sd])|dqu(?P<bits>8|16)) %[xyz]mm\d+(?:\{%k\d\})?, (?P<place>\S*\(\S+\))$")
STORED_BYTES = {"ps": 4, "pd": 8, "8": 1, "16": 2}
STEP = re.compile(r"(add|sub)q \$(-?\d+), (%r\w+)")


@dataclass(frozen=True, slots=True)
class Counted:
    """A loop of the C as vector code: bytes of its vectors, and what one turn of it does.

    `values`: how many elements of its output a turn writes, where no store shows it those of one vector of float64;
    `instructions`: how many there are; `arithmetic`: packed operations of each family for one value. A loop without
    any of those has 0 everywhere.
    """

    loop: Loop
    bytes: int
    values: int
    instructions: int
    arithmetic: dict[str, float]


def counted(sources: Mapping[str, str], file: str, goal: Goal) -> tuple[Counted, ...]:
    """Every loop of a file that became vector code, in the order of the C; of several versions of a loop the longest.

    Raises CompileError.
    """
    loops = loops_of(sources[file])
    with tempfile.TemporaryDirectory(prefix="symrender_cg-") as place:
        folder = Path(place)
        write_sources(sources, folder)
        output = folder / "unit.s"
        asked = (*goal.command, *AS_LOOPS, GCC_ALL, "-fPIC", "-g1", "-S", "-o", output.name, file)
        said = run_checked(asked, folder, output).stderr
        assembly = output.read_text()
    widths = {loop.line: loop.bytes for loop in heard_from_gcc([said]).loops if loop.file == file}
    longest: dict[int, Counted] = {}
    for function, lines, code in _inner_loops(assembly, file):
        arithmetic = _arithmetic(code, goal.bytes)
        loop = _owner(sources[file].splitlines(), loops, function, lines)
        if loop is None or not any(arithmetic.values()):
            continue
        values = _values(code) or goal.bytes // 8  # where no store shows it: one vector of float64
        a_value = {family: count / values for family, count in arithmetic.items()}
        found = Counted(loop, widths.get(loop.line, 0), values, len(code), a_value)
        if loop.line not in longest or longest[loop.line].instructions < found.instructions:
            longest[loop.line] = found
    plain = dict.fromkeys(FAMILIES, 0.0)
    return tuple(
        longest.get(loop.line, Counted(loop, widths[loop.line], 0, 0, plain)) for loop in loops if loop.line in widths
    )


def _inner_loops(assembly: str, file: str) -> list[tuple[str, list[int], list[str]]]:
    """(function of the assembly, lines of the file, instructions) of every loop without a loop inside."""
    names = {number for number, path in re.findall(r'^\s*\.file (\d+) "([^"]+)"', assembly, re.M) if path == file}
    names |= {n for n, path in re.findall(r'^\s*\.file (\d+) "[^"]*" "([^"]+)"', assembly, re.M) if path == file}
    rows: list[tuple[int | None, str]] = []  # (line of the file where it is one, instruction or "")
    labels: dict[str, int] = {}
    functions: list[tuple[int, str]] = [(0, "")]
    ends: dict[int, list[int]] = {}
    for text in assembly.splitlines():
        label = re.match(r"(\.L\w+):", text)
        mark = re.match(r"\s+\.loc (\d+) (\d+)", text)
        name = re.match(r"([A-Za-z]\w*)(\.\w+)*:", text)
        if label is not None:
            labels[label[1]] = len(rows)
        elif name is not None:
            functions.append((len(rows), name[1]))
        elif mark is not None:
            rows.append((int(mark[2]) if mark[1] in names else None, ""))
        elif re.match(r"\s+[a-z]", text):
            words = " ".join(text.split())
            jump = re.match(r"j\w+ (\.L\w+)$", words)
            if jump is not None and jump[1] in labels:
                ends.setdefault(labels[jump[1]], []).append(len(rows))
            rows.append((None, words))
    inner = []
    for begin, jumps in ends.items():
        # a jump back from code that was put aside, behind other loops, is not this loop's end
        alone = [end for end in jumps if not any(begin < other <= min(ends[other]) <= end for other in ends)]
        inner += [(begin, max(alone))] if alone else []
    found = []
    for begin, end in sorted(inner):
        inside = rows[begin : end + 1]
        function = next(name for start, name in reversed(functions) if start <= begin)
        lines = [line for line, _ in inside if line is not None]
        found.append((function, lines, [text for _, text in inside if text]))
    return found


def _owner(text: list[str], loops: Sequence[Loop], function: str, lines: Sequence[int]) -> Loop | None:
    """The loop of the C text that code of these lines, in this function of the assembly, was made from."""
    owners = Counter(loop for line in lines if (loop := _innermost(loops, line)) is not None)
    if owners:
        return owners.most_common(1)[0][0]
    for called, _ in Counter(function_at(text, line) for line in lines).most_common():
        call = re.compile(rf"\b{called}\(")
        calling = [
            loop for loop in loops if not loop.holds_loops and call.search("\n".join(text[loop.line : loop.last]))
        ]
        # inlined twice into two functions: the loop of this one, else one of a function that was itself inlined here
        inlined = _called_by(text, function)
        order = sorted(calling, key=lambda loop: (loop.function != function, loop.function not in inlined))
        if order:
            return order[0]
    return None


def _called_by(text: list[str], function: str) -> set[str]:
    """The functions of the file that one calls, and those that they call."""
    bodies: dict[str, list[str]] = {}
    current = ""
    for number, line in enumerate(text, 1):
        if line and line[0].isalpha():
            current = function_at(text, number)
        else:
            bodies.setdefault(current, []).append(line)
    found: set[str] = set()
    waiting = [function]
    while waiting:
        words = set(re.findall(r"(\w+)\(", "\n".join(bodies.get(waiting.pop(), []))))
        new = (words & bodies.keys()) - found
        found |= new
        waiting += new
    return found


def _innermost(loops: Sequence[Loop], line: int) -> Loop | None:
    holding = [loop for loop in loops if loop.line <= line <= loop.last]
    return max(holding, key=lambda loop: loop.line, default=None)


def _arithmetic(code: Sequence[str], width: int) -> dict[str, int]:
    """How many single operations the instructions on vectors of `width` bytes make, of each family."""
    register = {64: "%zmm", 32: "%ymm", 16: "%xmm"}[width]
    names = [text.split(" ", 1)[0] for text in code if register in text]
    return {
        family: sum(width // STORED_BYTES[name[-2:]] for name in names if pattern.fullmatch(name))
        for family, pattern in FAMILIES.items()
    }


def _values(code: Sequence[str]) -> int:
    """Elements that a turn writes: how far the address of a vector store moves on, over the size of an element."""
    steps = {register: abs(int(number)) for _, number, register in STEP.findall("\n".join(code))}
    for text in code:
        store = STORE.match(text)
        if store is None:
            continue
        base, index, scale = (*re.split(r"[(),]+", store["place"])[1:-1], "", "")[:3]
        moved = steps.get(base, 0) + steps.get(index, 0) * int(scale or 1)
        if moved:
            return moved // STORED_BYTES[store["kind"] or store["bits"]]
    return 0
