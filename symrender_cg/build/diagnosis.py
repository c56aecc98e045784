"""This machine -> what `doctor` prints: compiler, flags, target, cache, a trial build, and what is missing.

In:  the root of a cache, or none. Out: Diagnosis, plain data.
Never here: printing, or an exception for something that is missing: that is what the answer is about.
"""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass
from pathlib import Path

from symrender_cg.build import library, vectorisation
from symrender_cg.build.cache import Cache, CacheSize
from symrender_cg.build.compile import compile_library, kernel_flags
from symrender_cg.build.portable import binding_text
from symrender_cg.build.toolchain import REMEDIES, Target, Toolchain
from symrender_cg.errors import CompileError, CompilerNotFoundError, ToolchainError

TRIAL_SOURCES = {
    "trial.c": """\
#include <math.h>
void trial(const double *restrict x, double *restrict y, int n);
void trial(const double *restrict x, double *restrict y, int n)
{
    for (int i = 0; i < n; ++i)
        y[i] = sqrt(x[i]) + 1.0;
}
"""
}
TRIAL_CDEF = "void trial(const double *x, double *y, int n);"
TRIAL_LOOP_LINE = 5


@dataclass(frozen=True, slots=True)
class Problem:
    """Something that is missing or broken, and how to get it. `text` may have several lines."""

    text: str
    remedies: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """All that `doctor` knows. Without a compiler `toolchain` and `target` are None, and `problems` says why.

    `trial_seconds` is the time of a small compilation that was loaded and called with the right result, None where
    that failed; `trial_vector_bytes` the vector width of its loop by the compiler's report, 0 where not vectorised.
    `trial_processor` is the build of a portable trial that runs here, empty where there is one build alone.
    """

    python: str
    system: str
    cffi: str
    cc_setting: str
    toolchain: Toolchain | None
    target: Target | None
    flags: tuple[str, ...]
    trial_seconds: float | None
    trial_vector_bytes: int
    trial_processor: str
    cache_root: Path
    cache_size: CacheSize
    cache_writable: bool
    problems: tuple[Problem, ...]


def diagnose(root: Path | str | None = None, *, portable: bool = False) -> Diagnosis:
    """Look at everything between C text and a loaded library, once. Never raises a ToolchainError."""
    cache = Cache(root)
    problems: list[Problem] = []
    unwritable = cache.problem()
    if unwritable is not None:
        remedy = "set SYMRENDER_CACHE_DIR to a folder that can be written; until then every start compiles again"
        problems.append(Problem(f"the cache {cache.root} cannot be written: {unwritable}", (remedy,)))
    toolchain: Toolchain | None = None
    seconds: float | None = None
    width = 0
    processor = ""
    try:
        toolchain = cache.toolchain()
        seconds, processor = _trial(toolchain, portable)
        width = _trial_vector_bytes(toolchain, portable)
    except CompilerNotFoundError as problem:
        # the message ends with the remedies; here they have a field of their own
        problems.append(Problem(str(problem).split("\n    1. ")[0].removesuffix("\n  remedies:"), REMEDIES))
    except ToolchainError as problem:
        problems.append(Problem(str(problem), REMEDIES))
    if toolchain is not None and seconds is not None and width == 0:
        text = f"{toolchain.version} does not vectorise a plain loop; kernels are right but several times slower"
        problems.append(Problem(text, ("install a recent gcc or clang, and name it in CC",)))
    return Diagnosis(
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        cffi=library.cffi_version(),
        cc_setting=os.environ.get("CC", ""),
        toolchain=toolchain,
        target=None if toolchain is None else toolchain.target(portable),
        flags=() if toolchain is None else kernel_flags(toolchain, portable),
        trial_seconds=seconds,
        trial_vector_bytes=width,
        trial_processor=processor,
        cache_root=cache.root,
        cache_size=cache.size(),
        cache_writable=unwritable is None,
        problems=tuple(problems),
    )


def _trial_vector_bytes(toolchain: Toolchain, portable: bool) -> int:
    try:
        loops = vectorisation.report(TRIAL_SOURCES, toolchain=toolchain, portable=portable)
    except CompileError:  # a compiler that has no such report still compiles
        return 0
    return next((loop.bytes for loop in loops if loop.line == TRIAL_LOOP_LINE), 0)


def processor_here(toolchain: Toolchain) -> str:
    """The last of a portable library's builds that this processor can run; empty where there is one build alone.

    Raises ToolchainError.
    """
    return _trial(toolchain, portable=True)[1]


def _trial(toolchain: Toolchain, portable: bool) -> tuple[float, str]:
    """Seconds to compile a small kernel, which is then loaded and called, and the build that ran.

    Raises ToolchainError.
    """
    import tempfile

    with tempfile.TemporaryDirectory(prefix="symrender_cg-") as place:
        folder = Path(place)
        output = folder / library.LIBRARY_NAME
        told = TRIAL_CDEF if portable else ""
        record = compile_library(TRIAL_SOURCES, output, toolchain=toolchain, portable=portable, declarations=told)
        library.write_binding(binding_text(TRIAL_CDEF, toolchain, portable=portable), folder)
        opened = library.load(folder)
        squares = [float(i * i) for i in range(64)]
        roots = opened.ffi.new("double[]", len(squares))
        opened.lib.trial(opened.ffi.new("double[]", squares), roots, len(squares))
        if list(roots) != [i + 1.0 for i in range(64)]:
            raise ToolchainError(f"{toolchain.version} compiled a loop of sqrt wrongly: {list(roots)[:4]}...")
        return record.seconds, opened.processor
