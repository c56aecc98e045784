"""C sources -> which loops the compiler vectorised, read from the compiler's own report.

In:  sources by file name, a Toolchain, flags. Out: one VectorisedLoop a loop, or the reasons why a line has none.
Never here: a judgement of whether a loop should have been vectorised. Nothing is kept: objects go to a folder that is
removed.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from symrender_cg.build.compile import c_files, kernel_flags, run_checked, write_sources
from symrender_cg.build.toolchain import Toolchain

GCC_ALL = "-fopt-info-vec-optimized-missed=stderr"
GCC_MISSED = ("-fopt-info-vec-missed=stderr",)
# zig adds arguments of its own that clang then calls unused
CLANG_EXTRA = ("-gline-tables-only", "-Wno-unused-command-line-argument")
CLANG_REPORT = ("-Rpass=loop-vectorize", *CLANG_EXTRA)
CLANG_MISSED = ("-Rpass-missed=loop-vectorize", "-Rpass-analysis=loop-vectorize", *CLANG_EXTRA)
ELEMENT_BYTES = {"double": 8, "i64": 8, "float": 4, "i32": 4, "half": 2, "i16": 2, "i8": 1}


@dataclass(frozen=True, slots=True, order=True)
class VectorisedLoop:
    """A loop that became vector instructions: source file, line of its head (1-based), bytes of its widest vector."""

    file: str
    line: int
    bytes: int


@dataclass(frozen=True, slots=True)
class Report:
    """What a compiler said of loops: those it vectorised, and by file and line what is against it."""

    loops: tuple[VectorisedLoop, ...]
    reasons: dict[tuple[str, int], tuple[str, ...]]


def report(
    sources: Mapping[str, str], *, toolchain: Toolchain, portable: bool = False, extra_flags: Sequence[str] = ()
) -> tuple[VectorisedLoop, ...]:
    """Every vectorised loop of the sources, one entry a line, sorted by file and line.

    gcc states the bytes. clang states lanes; the bytes are lanes times the widest element in the loop's vector code,
    no more than the target's vectors. Raises CompileError.
    """
    command = (*toolchain.command, *kernel_flags(toolchain, portable, extra_flags))
    limit = toolchain.target(portable).vector_bytes
    return judged(sources, command=command, kind=toolchain.kind, limit=limit).loops


def judged(sources: Mapping[str, str], *, command: Sequence[str], kind: str, limit: int) -> Report:
    """What a compiler of that kind, run by `command` with all its flags, says of every loop; vectors of `limit` bytes.

    Raises CompileError.
    """
    if kind == "gcc":
        return heard_from_gcc([said for said, _ in _compiled(sources, (*command, GCC_ALL), "-c")])
    texts = _compiled(sources, (*command, *CLANG_REPORT, *CLANG_MISSED, "-emit-llvm"), "-S")
    pattern = r"^([^:\n]+):(\d+):\d+: remark: vectorized loop \(vectorization width: (\d+)"
    found = [
        (f, int(line), min(limit, int(lanes) * _element_bytes(code, int(line), int(lanes))))
        for said, code in texts
        for f, line, lanes in re.findall(pattern, said, re.M)
    ]
    return _report(found, [entry for said, _ in texts for entry in _against_by_clang(said)])


def _against_by_clang(said: str) -> list[tuple[str, str, str]]:
    """(file, line of the loop's head, reason): clang gives the reason at the place to blame, then names the loop."""
    entries = []
    reason = ""
    for file, line, text in re.findall(r"^([^:\n]+):(\d+):\d+: remark: (.*?) \[-R", said, re.M):
        if text.startswith("loop not vectorized: "):
            reason = text.removeprefix("loop not vectorized: ")
        elif text.startswith("the cost-model indicates that vectorization"):
            entries.append((file, line, text.removeprefix("the ")))
        elif text == "loop not vectorized" and reason:
            entries.append((file, line, reason))
            reason = ""
    return entries


def heard_from_gcc(texts: Sequence[str]) -> Report:
    """The report in what gcc said under GCC_ALL, one text a translation unit."""
    pattern = r"^([^:\n]+):(\d+):\d+: optimized: loop vectorized using (\d+) byte vectors"
    found = [(f, int(line), int(width)) for said in texts for f, line, width in re.findall(pattern, said, re.M)]
    against = r"^([^:\n]+):(\d+):\d+: missed: couldn't vectorize loop\n\S+ missed:\s+(?:not vectorized[:,] )?(.*?)\.?$"
    return _report(found, [entry for said in texts for entry in re.findall(against, said, re.M)])


def _report(found: Sequence[tuple[str, int, int]], against: Sequence[tuple[str, str, str]]) -> Report:
    """Of several verdicts on a line the widest vectors, and every reason once."""
    widest: dict[tuple[str, int], int] = {}
    for file, line, width in found:
        widest[file, line] = max(width, widest.get((file, line), 0))
    reasons: dict[tuple[str, int], tuple[str, ...]] = {}
    for file, text, reason in against:
        place = (file, int(text))
        reasons[place] = tuple(dict.fromkeys((*reasons.get(place, ()), reason)))
    return Report(tuple(sorted(VectorisedLoop(*place, width) for place, width in widest.items())), reasons)


def missed(
    sources: Mapping[str, str],
    file: str,
    line: int,
    *,
    toolchain: Toolchain,
    portable: bool = False,
    extra_flags: Sequence[str] = (),
) -> tuple[str, ...]:
    """What the compiler says against vectorising the loop at a line, in its order, each reason once.

    A loop that was vectorised may have entries too: the compiler reports every attempt. Raises CompileError.
    """
    asked = GCC_MISSED if toolchain.kind == "gcc" else CLANG_MISSED
    texts = _compiled(sources, (*toolchain.command, *kernel_flags(toolchain, portable, extra_flags), *asked), "-c")
    pattern = rf"^{re.escape(file)}:{line}:\d+: (?:missed|remark):\s+(.+)$"
    return tuple(dict.fromkeys(reason.strip() for said, _ in texts for reason in re.findall(pattern, said, re.M)))


def _compiled(sources: Mapping[str, str], command: Sequence[str], stage: str) -> list[tuple[str, str]]:
    """(stderr, text of the output where the stage is -S) of each translation unit."""
    with tempfile.TemporaryDirectory(prefix="symrender_cg-") as place:
        folder = Path(place)
        write_sources(sources, folder)
        texts = []
        for unit in c_files(sources):
            output = folder / "unit.out"
            said = run_checked((*command, "-fPIC", stage, "-o", output.name, unit), folder, output).stderr
            texts.append((said, output.read_text(errors="replace") if stage == "-S" else ""))
        return texts


def _element_bytes(code: str, line: int, lanes: int) -> int:
    """The widest element among `<lanes x T>` in the LLVM code of the loops whose head is at `line`.

    A vectorised loop's last block branches back with !llvm.loop metadata that names the first line of the loop.
    Where no such block holds vectors of that many lanes, the whole file is read.
    """
    nodes = dict(re.findall(r"^(!\d+) = (.*)$", code, re.M))
    blocks = re.split(r"\n\n|^[\w.]+:.*$", code, flags=re.M)
    vectors = re.compile(rf"<{lanes} x (\w+)>")
    inside = []
    for block in blocks:
        loop = re.search(r"!llvm\.loop (!\d+)", block)
        if loop is not None and _first_line(nodes, loop[1]) == line:
            inside.append(block)
    elements = vectors.findall("\n".join(inside)) or vectors.findall(code)
    return max((ELEMENT_BYTES.get(element, 1) for element in elements), default=1)


def _first_line(nodes: Mapping[str, str], loop: str) -> int | None:
    for member in re.findall(r"!\d+", nodes.get(loop, "")):
        place = re.match(r"!DILocation\(line: (\d+)", nodes.get(member, ""))
        if place is not None:
            return int(place[1])
    return None
