"""A C snippet becomes a loaded library: `compile_c` builds it with the project's flags, `vectorised_lines` asks why.

Comes in: C text that includes the support headers by name, and a compiler. Goes out: a `SnippetLibrary` whose functions
are called with numpy arrays and Python numbers, or the compiler's own report. Never done here: a fallback when a
compiler fails; a warning is an error, because the headers promise none.
"""

from __future__ import annotations

import atexit
import functools
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import cffi
import numpy as np

TEMPLATES = Path(__file__).resolve().parent.parent / "templates"
SUPPORT = TEMPLATES / "support"

FLAGS = (
    *(line for line in (TEMPLATES / "compile-flags.txt").read_text().splitlines() if line.startswith("-")),
    "-march=native",
)
"""The flags of every generated kernel, and the vector instructions of this machine."""

COMPILERS = tuple(name for name in ("gcc", "clang") if shutil.which(name))
"""The compilers of this machine, gcc first; tests parametrise over them."""


class SnippetLibrary:
    """Functions of one compiled snippet: `library.call("name", array, 3, 0.5)`; arrays go as their data pointers."""

    def __init__(self, path: Path, declarations: str) -> None:
        self._ffi = cffi.FFI()
        self._ffi.cdef(declarations)
        self._library = self._ffi.dlopen(str(path))
        self.path = path

    def call(self, name: str, *arguments: Any) -> Any:
        """Call one function. Arrays must be C-contiguous and of the type that the C function names."""
        function = getattr(self._library, name)
        kinds = self._ffi.typeof(function).args
        assert len(kinds) == len(arguments), f"{name} takes {len(kinds)} arguments, got {len(arguments)}"
        return function(*(self._as_c(kind, value) for kind, value in zip(kinds, arguments, strict=True)))

    def _as_c(self, kind: Any, value: Any) -> Any:
        if not isinstance(value, np.ndarray):
            return value
        assert value.flags.c_contiguous, "a C function reads its array without strides"
        assert kind.kind == "pointer", f"an array was given where C expects {kind.cname}"
        assert self._ffi.sizeof(kind.item) == value.itemsize, f"{value.dtype} does not fit {kind.cname}"
        return self._ffi.cast(kind, value.ctypes.data)


@functools.cache
def _build_directory() -> Path:
    folder = tempfile.mkdtemp(prefix="symrender-c-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _run(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stderr}"
    return done.stderr


@functools.cache
def compile_c(
    source: str, declarations: str, *, compiler: str = "gcc", extra_flags: tuple[str, ...] = ()
) -> SnippetLibrary:
    """Compile C text into a shared library and load it; `declarations` are the prototypes in cffi's form.

    Raises AssertionError with the command and the compiler's message. The same text is compiled once a process.
    """
    folder = Path(tempfile.mkdtemp(dir=_build_directory()))
    text, library = folder / "snippet.c", folder / "snippet.so"
    text.write_text(source)
    _run([compiler, *FLAGS, *extra_flags, f"-I{SUPPORT}", "-shared", "-fPIC", str(text), "-o", str(library), "-lm"])
    return SnippetLibrary(library, declarations)


@functools.cache
def vectorised_lines(source: str, *, compiler: str = "gcc", extra_flags: tuple[str, ...] = ()) -> dict[int, int]:
    """Line of the snippet -> widest vector in bytes of a loop there, as the compiler itself reports it.

    gcc says "loop vectorized using 64 byte vectors"; clang says "vectorization width: 8", which counts elements: there
    the number is elements, not bytes. Lines of included headers are left out.
    """
    folder = Path(tempfile.mkdtemp(dir=_build_directory()))
    text = folder / "snippet.c"
    text.write_text(source)
    ask = "-fopt-info-vec-optimized" if compiler == "gcc" else "-Rpass=loop-vectorize"
    quiet = () if compiler == "gcc" else ("-Wno-error",)
    report = _run(
        [compiler, *FLAGS, *quiet, *extra_flags, f"-I{SUPPORT}", "-c", ask, str(text), "-o", str(folder / "snippet.o")]
    )
    pattern = r"snippet\.c:(\d+):\d+: .*?(?:vectorized using (\d+) byte|vectorization width: (\d+))"
    widths: dict[int, int] = {}
    for line, in_bytes, in_elements in re.findall(pattern, report):
        widths[int(line)] = max(widths.get(int(line), 0), int(in_bytes or in_elements))
    return widths


def loop_line(source: str, marker: str = "for (") -> int:
    """Number of the first line of `source` that holds `marker`."""
    return next(number for number, line in enumerate(source.splitlines(), start=1) if marker in line)
