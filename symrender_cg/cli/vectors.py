"""`doctor --vectors`: each loop of a kernel, how wide its vectors are by compiler and processor, or why it has none.

Comes in: what the user named. Goes out: a table and the reasons, or JSON. Never here: a kernel that runs. A processor
of another kind than this machine's is compiled for and no more; the last lines say which those are.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from symrender_cg.build.cache import Cache
from symrender_cg.build.diagnosis import processor_here
from symrender_cg.build.portable import every_build
from symrender_cg.build.reports import Goal, Loop, Verdict, goals, loops_of, verdicts
from symrender_cg.cli.console import Column, Table
from symrender_cg.errors import ArgumentError, CompileError, CompilerNotFoundError

LOOP_WIDTH = 52


@dataclass(frozen=True, slots=True)
class Survey:
    """The loops of a kernel's C that hold no loop themselves, and a verdict on each under each goal.

    A goal that could not be compiled for is in `failed`, with the first line of what the compiler said.
    """

    kernel: str
    loops: tuple[Loop, ...]
    verdicts: dict[Goal, dict[int, Verdict]]
    failed: dict[Goal, str]


def run(name: str, *, as_json: bool) -> int:
    """Prints the survey of a kernel: `name` is an accuracy (of Chapter 1's scene), a scene, or a kernel's .c file."""
    found = survey(*_sources(name))
    here = _runs_here()
    if as_json:
        print(json.dumps(as_data(found, here), indent=2))
        return 0
    print(f"{found.kernel}: bytes of the vectors of each loop, by compiler and processor; - where it is no vector code")
    print()
    table(found).show()
    print()
    for line in against(found):
        print(line)
    foreign = sorted({goal.processor for goal in found.verdicts if goal.processor not in here})
    print(f"runs here: {', '.join(here)}" + (f"; compiled only: {', '.join(foreign)}" if foreign else ""))
    for goal, said in found.failed.items():
        print(f"not compiled: {goal.kind} for {goal.processor}: {said}")
    for text in _missing(found):
        print(text)
    return 0


def survey(kernel: str, sources: dict[str, str]) -> Survey:
    """Compile a kernel for everything that can be compiled for here, and gather the verdicts."""
    loops = tuple(loop for loop in loops_of(sources[f"{kernel}.c"]) if not loop.holds_loops)
    given: dict[Goal, dict[int, Verdict]] = {}
    failed: dict[Goal, str] = {}
    for goal in goals():
        try:
            given[goal] = verdicts(sources, f"{kernel}.c", goal)
        except CompileError as problem:
            lines = problem.stderr.strip().splitlines()
            failed[goal] = next((line for line in lines if "error" in line), *lines[:1] or ["no message"])
    return Survey(kernel, loops, given, failed)


def table(found: Survey) -> Table:
    """A row a loop, a column a goal."""
    heads = [Column("line", right=True), Column("function"), Column("loop")]
    heads += [Column(f"{goal.kind} {goal.processor.removeprefix('x86-64-')}", right=True) for goal in found.verdicts]
    shown = Table(tuple(heads))
    for loop in found.loops:
        widths = (given[loop.line].bytes for given in found.verdicts.values())
        function = loop.function.removeprefix(f"{found.kernel}_")
        shown.add(str(loop.line), function, loop.does[:LOOP_WIDTH], *(str(width) if width else "-" for width in widths))
    return shown


def against(found: Survey) -> list[str]:
    """Why a loop is no vector code: one line a loop, compiler and reason, with the processors it was said for."""
    lines = []
    for loop in found.loops:
        said: dict[tuple[str, str], list[str]] = {}
        for goal, given in found.verdicts.items():
            for reason in given[loop.line].reasons[:1]:
                said.setdefault((goal.kind, reason), []).append(goal.processor)
        for (kind, reason), processors in said.items():
            everywhere = len(processors) == sum(1 for goal in found.verdicts if goal.kind == kind)
            where = "" if everywhere else f" ({', '.join(processors)})"
            lines.append(f"line {loop.line}, {kind}{where}: {reason}")
    return [*lines, ""] if lines else []


def as_data(found: Survey, here: tuple[str, ...]) -> dict[str, Any]:
    """The survey as what JSON holds."""
    rows = [
        {
            "line": loop.line,
            "function": loop.function,
            "does": loop.does,
            "verdicts": [
                {
                    "compiler": goal.kind,
                    "processor": goal.processor,
                    "bytes": given[loop.line].bytes,
                    "reasons": given[loop.line].reasons,
                }
                for goal, given in found.verdicts.items()
            ],
        }
        for loop in found.loops
    ]
    failed = [{"compiler": goal.kind, "processor": goal.processor, "said": text} for goal, text in found.failed.items()]
    return {"kernel": found.kernel, "runs_here": list(here), "loops": rows, "not_compiled": failed}


def _sources(name: str) -> tuple[str, dict[str, str]]:
    """(kernel, sources) of what the user named. Raises ArgumentError, SceneError."""
    path = Path(name)
    if path.suffix == ".c":
        if not path.is_file():
            raise ArgumentError(f"--vectors: there is no file {name}; expected a kernel's C, a scene or an accuracy")
        near = (*path.parent.glob("*.h"), *path.parent.parent.glob("support/*.h"), *path.parent.glob("support/*.h"))
        return path.stem, {near_path.name: near_path.read_text(encoding="utf-8") for near_path in (path, *near)}
    from symrender_cg.lower.variants import ACCURACIES
    from symrender_cg.pipeline import translate
    from symrender_cg.scene import load_scene

    scene, accuracy = ("chapter1", name) if name in ACCURACIES else (name, "double")
    emitted = translate(load_scene(scene), accuracy).emitted
    return emitted.name, dict(emitted.files)


def _runs_here() -> tuple[str, ...]:
    """The processors of the table that this one is: found out by a portable library that is built and loaded."""
    try:
        best = processor_here(Cache().toolchain())
    except CompilerNotFoundError:
        return ()
    names = [build.name for build in every_build()]
    if best in names:
        return tuple(names[: names.index(best) + 1])
    import platform

    return (platform.machine(),)


def _missing(found: Survey) -> list[str]:
    """How to get what would have added columns."""
    have = {(goal.kind, goal.processor) for goal in (*found.verdicts, *found.failed)}
    lines = []
    if not any(kind == "clang" for kind, _ in have):
        lines.append("clang is not installed: apt install clang")
    if ("gcc", "aarch64") not in have:
        lines.append("no gcc for aarch64, or no headers: apt install gcc-aarch64-linux-gnu libc6-dev-arm64-cross")
    return lines
