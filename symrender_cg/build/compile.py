"""C texts -> a shared library, by running the compiler ourselves in the folder of the sources.

In:  sources by file name, a Toolchain, flags. Out: the library and a CompileRecord. A portable library of declared
functions is compiled once for each of its builds (`portable.py`) and linked from all of them.
Never here: a cache, a fall-back, or a lost message: a failure is a CompileError with command, status and stderr.
"""

from __future__ import annotations

import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from symrender_cg.build import portable as portable_library
from symrender_cg.build.toolchain import Toolchain, run_compiler
from symrender_cg.errors import ArgumentError, CompileError
from symrender_cg.resources import template_path

SHARED_FLAGS = ("-fPIC", "-shared")
LINK_FLAGS = ("-lm",)
FLAGS_FILE = "compile-flags.txt"


@dataclass(frozen=True, slots=True)
class CompileRecord:
    """What was run: its command (file names relative to its folder), wall-clock seconds, and stderr.

    Of several commands it is the script that holds them all.
    """

    command: tuple[str, ...]
    seconds: float
    stderr: str


def project_flags() -> tuple[str, ...]:
    """The flags of templates/compile-flags.txt, in order: the one list that CMake reads too."""
    lines = template_path(FLAGS_FILE).read_text(encoding="utf-8").splitlines()
    return tuple(line.strip() for line in lines if line.startswith("-"))


def kernel_flags(toolchain: Toolchain, portable: bool, extra_flags: Sequence[str] = ()) -> tuple[str, ...]:
    """All flags of a compilation: the project's, the target's, the caller's. Later ones win."""
    return (*project_flags(), *toolchain.target(portable).flags, *extra_flags)


def compile_library(
    sources: Mapping[str, str],
    output: Path,
    *,
    toolchain: Toolchain,
    portable: bool = False,
    extra_flags: Sequence[str] = (),
    declarations: str = "",
) -> CompileRecord:
    """Write `sources` (file name -> text, headers included) beside `output` and compile the .c files among them.

    A portable library with `declarations`, the C prototypes of its functions, carries a build for each level of
    processor and picks one when it is loaded; without them it is one build, for the least.
    Raises CompileError where the compiler refuses or cannot be started, and leaves no partial library behind;
    OSError where the folder cannot be written; ArgumentError for a file name that leaves the folder; LibraryError for
    declarations that cannot be passed on.
    """
    folder = output.parent
    write_sources(sources, folder)
    units = c_files(sources)
    builds = portable_library.builds_of(toolchain) if portable and declarations else ()
    if builds:
        return _compile_builds(units, output, toolchain, builds, extra_flags, declarations)
    flags = kernel_flags(toolchain, portable, extra_flags)
    command = (*toolchain.command, *flags, *SHARED_FLAGS, "-o", output.name, *units, *LINK_FLAGS)
    return run_checked(command, folder, output)


def _compile_builds(
    units: Sequence[str],
    output: Path,
    toolchain: Toolchain,
    builds: Sequence[portable_library.Build],
    extra_flags: Sequence[str],
    declarations: str,
) -> CompileRecord:
    """Every unit for every build, the file that picks, and all of them linked; the commands are kept as a script."""
    folder = output.parent
    (folder / portable_library.PICKING_NAME).write_bytes(portable_library.picking_text(declarations).encode())
    common = (*toolchain.command, *project_flags())
    jobs = [(portable_library.PICKING_NAME, "picking.o", builds[0].flags)]
    for build in builds:
        own = (*build.flags, "-fvisibility=hidden", *portable_library.definitions(declarations, build))
        jobs += [(unit, f"unit_{number}{build.suffix}.o", own) for number, unit in enumerate(units)]
    objects = [made for _, made, _ in jobs]
    commands = [(*common, *own, *extra_flags, "-fPIC", "-c", "-o", made, unit) for unit, made, own in jobs]
    commands.append((*common, *SHARED_FLAGS, "-o", output.name, *objects, *LINK_FLAGS))
    lines = (shlex.join(command) for command in commands)
    (folder / portable_library.SCRIPT_NAME).write_text(
        "set -e\n" + "\n".join(lines) + f"\nrm {shlex.join(objects)}\n", encoding="utf-8"
    )
    try:
        records = [run_checked(command, folder) for command in commands]
    except CompileError:
        output.unlink(missing_ok=True)
        raise
    finally:
        for made in objects:
            (folder / made).unlink(missing_ok=True)
    seconds = sum(record.seconds for record in records)
    return CompileRecord(("sh", portable_library.SCRIPT_NAME), seconds, "".join(record.stderr for record in records))


def run_checked(command: tuple[str, ...], folder: Path, output: Path | None = None) -> CompileRecord:
    """Run a compile command in `folder`. Raises CompileError, after removing the partial `output`."""
    start = time.perf_counter()
    try:
        answer = run_compiler(command, folder)
    except OSError as problem:
        raise CompileError(command, 127, f"the compiler could not be started: {problem}") from problem
    if answer.returncode != 0 or (output is not None and not output.is_file()):
        if output is not None:
            output.unlink(missing_ok=True)
        raise CompileError(command, answer.returncode, answer.stderr or answer.stdout or "(no message)")
    return CompileRecord(command, time.perf_counter() - start, answer.stderr)


def write_sources(sources: Mapping[str, str], folder: Path) -> None:
    """Write each text under its name, byte for byte. Raises ArgumentError for a name that leaves the folder."""
    for name, text in sorted(sources.items()):
        parts = PurePosixPath(name).parts
        if not parts or name.startswith(("/", "-")) or ".." in parts or "\\" in name:
            raise ArgumentError(f"sources[{name!r}]: expected a relative file name such as 'kernel.c'")
        path = folder.joinpath(*parts)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode("utf-8"))


def c_files(sources: Mapping[str, str]) -> tuple[str, ...]:
    """The names of the translation units, sorted. Raises ArgumentError where there are none."""
    units = tuple(sorted(name for name in sources if name.endswith(".c")))
    if not units:
        raise ArgumentError(f"sources hold no .c file, only {sorted(sources)}; nothing to compile")
    return units
