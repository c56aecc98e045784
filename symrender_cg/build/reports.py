"""A kernel's C, a compiler, a processor that need not be here -> for each loop the width of its vectors, or why not.

In:  sources by file name. Out: Loop, Goal and Verdict, plain data.
Never here: a kernel run. Goals are compiled for; what runs on this machine is for others to say.
"""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from symrender_cg.build import vectorisation
from symrender_cg.build.compile import project_flags
from symrender_cg.build.portable import every_build
from symrender_cg.build.toolchain import run_compiler, which

VECTOR_BYTES = {"x86-64": 16, "x86-64-v3": 32, "x86-64-v4": 64, "aarch64": 16}
SILENCE = "nothing said: no loop is left, or none that is tried"


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop of C text: its function, its lines (1-based, first and last), what it does, whether it holds loops."""

    function: str
    line: int
    last: int
    does: str
    holds_loops: bool


@dataclass(frozen=True, slots=True)
class Goal:
    """What is compiled for: a compiler's kind, a processor, the command and flags for it, bytes of its vectors."""

    kind: str
    processor: str
    command: tuple[str, ...]
    bytes: int

    @property
    def is_foreign(self) -> bool:
        """Whether the processor is of another kind than this machine's, so that nothing made for it runs here."""
        return _architecture(self.processor) != platform.machine()


@dataclass(frozen=True, slots=True)
class Verdict:
    """A loop under a goal: bytes of its widest vectors, or 0 and the compiler's reasons against them."""

    bytes: int
    reasons: tuple[str, ...]


def goals() -> tuple[Goal, ...]:
    """What can be compiled for here, by gcc and by clang: the levels of x86-64, and aarch64.

    For another kind of processor gcc is a program of its own (aarch64-linux-gnu-gcc), clang takes --target; both find
    the headers of the C library in Debian's libc6-dev-arm64-cross.
    """
    choices = [(build.name, build.flags) for build in every_build()] + [("aarch64", ("-march=armv8-a",))]
    found = []
    for kind in ("gcc", "clang"):
        for processor, flags in choices:
            architecture = _architecture(processor)
            own = architecture == platform.machine()
            path = which(kind if own or kind == "clang" else f"{architecture}-linux-gnu-gcc")
            if path is not None and (kind == "clang" or _is_gcc(path)):
                target = () if own or kind == "gcc" else (f"--target={architecture}-linux-gnu",)
                command = (path, *target, *project_flags(), *flags)
                if own or _has_headers((path, *target)):
                    found.append(Goal(kind, processor, command, VECTOR_BYTES[processor]))
    return tuple(found)


def verdicts(sources: Mapping[str, str], file: str, goal: Goal) -> dict[int, Verdict]:
    """The verdict on every loop of a file of the sources, by the line of its head. Raises CompileError."""
    heard = vectorisation.judged(sources, command=goal.command, kind=goal.kind, limit=goal.bytes)
    widths = {loop.line: loop.bytes for loop in heard.loops if loop.file == file}
    return {
        loop.line: Verdict(
            widths.get(loop.line, 0),
            () if loop.line in widths else heard.reasons.get((file, loop.line), (SILENCE,)),
        )
        for loop in loops_of(sources[file])
    }


def loops_of(text: str) -> tuple[Loop, ...]:
    """The loops of a C text that is laid out as the kernels are: a body is indented deeper than its loop's head."""
    lines = text.splitlines()
    found = []
    for number, line in enumerate(lines, 1):
        if re.match(r" +(for|while) \(", line):
            last = _end(lines, number)
            holds = any(re.match(r" +(for|while) \(", inner) for inner in lines[number:last])
            found.append(Loop(function_at(lines, number), number, last, _what_it_does(lines, number, last), holds))
    return tuple(found)


def function_at(lines: list[str], line: int) -> str:
    """The name of the C function that a line (1-based) stands in: the last definition that starts before it."""
    for text in reversed(lines[:line]):
        if text and text[0].isalpha() and "(" in text and not text.startswith("typedef"):
            return text.split("(")[0].split()[-1].lstrip("*")
    return ""


@cache
def _has_headers(command: tuple[str, ...]) -> bool:
    """Whether a compiler for another kind of processor has the headers of a C library for it."""
    return run_compiler((*command, "-E", "-x", "c", "-include", "math.h", os.devnull)).returncode == 0


@cache
def _is_gcc(path: str) -> bool:
    """Whether a program called gcc is one: on macOS it is clang."""
    return "clang" not in run_compiler((path, "--version")).stdout


def _architecture(processor: str) -> str:
    return "aarch64" if processor == "aarch64" else "x86_64"


def _body(lines: list[str], number: int) -> int:
    """The index in `lines` of the first line after the head of the loop that starts at line `number` (1-based)."""
    depth = 0
    for index in range(number - 1, len(lines)):
        depth += lines[index].count("(") - lines[index].count(")")
        if depth <= 0:
            return index + 1
    return len(lines)


def _end(lines: list[str], number: int) -> int:
    """The last line of the loop whose head is at line `number`: the next line that is as deep as the head closes it."""
    indent = _indent(lines[number - 1])
    for index in range(_body(lines, number), len(lines)):
        line = lines[index].strip()
        if line and _indent(lines[index]) <= indent and line != "{":
            return index + 1 if line == "}" else index
    return len(lines)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _what_it_does(lines: list[str], number: int, last: int) -> str:
    """The comment that opens the loop's body, else the one above its head, else the first thing that it writes."""
    body = [text for line in lines[_body(lines, number) : last] if (text := line.strip()) not in ("", "{", "}")]
    above = lines[number - 2].strip() if number > 1 else ""
    for text in (*body[:1], above):
        comment = re.match(r"/\* (.*?)(?: \[.*)?(?:\.? \*/.*)?$", text)
        if comment is not None:
            return comment[1]
    writes = (text for text in body if re.match(r"(\+\+|--|[\w.>\[\]-]+(\+\+)? (=|\+=|-=) )", text))
    return next(writes, next(iter(body), "")).split("/*")[0].strip()
