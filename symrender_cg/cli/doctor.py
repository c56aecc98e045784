"""`doctor`: what this machine has and lacks, for people or as JSON.

`--clear-cache` empties the cache instead, `--vectors` says what compilers make of a kernel's loops (`vectors.py`).
"""

from __future__ import annotations

import argparse
import json
import shlex
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from symrender_cg.build.cache import Cache
from symrender_cg.build.diagnosis import Diagnosis, Problem, diagnose
from symrender_cg.build.reports import function_at
from symrender_cg.build.toolchain import Toolchain
from symrender_cg.cli.console import counted, duration, size
from symrender_cg.errors import CompileError, ToolchainError

PACKAGES = (
    ("sympy", "deriving a kernel"),
    ("numpy", "everything"),
    ("cffi", "calling kernels"),
    ("jinja2", "writing C"),
    ("msgspec", "scenes"),
    ("pillow", ".png files"),
    ("python-flint", "the oracle of check"),
    ("rich", "tables and progress on a terminal"),
)

LOOPING_SCENE = "mirrors"
"""The built-in scene whose kernel has the most loops."""


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop of a kernel that became vector code: the function it is in, its line there, bytes of its vectors."""

    kernel: str
    function: str
    line: int
    bytes: int


def run(arguments: argparse.Namespace) -> int:
    """Prints the diagnosis; 0 where kernels can be built, 5 where not."""
    if arguments.clear_cache:
        return _clear(as_json=arguments.json)
    if arguments.vectors is not None:
        from symrender_cg.cli import vectors

        return vectors.run(arguments.vectors, as_json=arguments.json)
    found = diagnose(portable=arguments.portable)
    usable = found.trial_seconds is not None
    loops: tuple[Loop, ...] = ()
    problems = list(found.problems)
    missing = [(name, use) for name, use in PACKAGES if _installed(name) is None]
    for name, use in missing:
        problems.append(Problem(f"the Python package {name} is missing, needed for {use}", (f"pip install {name}",)))
    if found.toolchain is not None and usable:
        try:
            loops = kernel_loops(found.toolchain, portable=arguments.portable)
        except CompileError as problem:
            problems.append(Problem(f"the kernels' vectorisation report failed: {problem}", ()))
    if arguments.json:
        print(json.dumps(as_data(found, loops, problems), indent=2, allow_nan=False))
    else:
        _print(found, loops, problems)
    return 0 if usable else ToolchainError.exit_code


def kernel_loops(toolchain: Toolchain, *, portable: bool) -> tuple[Loop, ...]:
    """The vectorised loops of Chapter 1's kernels and of a scene's, as the compiler reports them. Compiles each.

    Of the kernels that bound their own error one in pairs and one in float64; the others have the same loops.
    Raises CompileError.
    """
    from symrender_cg.build import vectorisation
    from symrender_cg.lower.variants import VARIANTS
    from symrender_cg.pipeline import translate
    from symrender_cg.scene import Scene

    loops: list[Loop] = []
    levels: list[tuple[str, str | None]] = [(entry.name, None) for entry in VARIANTS]
    levels += [("stable", None), ("certified", "uint8")]
    asked = [(Scene.chapter1(), *level) for level in levels]
    for scene, accuracy, target in (*asked, (Scene.builtin(LOOPING_SCENE), "double", None)):
        emitted = translate(scene, accuracy, target=target).emitted
        own = f"{emitted.name}.c"
        lines = emitted.files[own].splitlines()
        found = vectorisation.report(emitted.files, toolchain=toolchain, portable=portable)
        loops += [
            Loop(emitted.name, function_at(lines, loop.line), loop.line, loop.bytes)
            for loop in found
            if loop.file.endswith(own)
        ]
    return tuple(loops)


def as_data(found: Diagnosis, loops: tuple[Loop, ...], problems: list[Problem]) -> dict[str, Any]:
    """The diagnosis as what JSON holds."""
    data = asdict(found) | {"cache_root": str(found.cache_root)}
    data["problems"] = [asdict(problem) for problem in problems]
    data["loops"] = [asdict(loop) for loop in loops]
    data["packages"] = {name: _installed(name) for name, _ in PACKAGES}
    data["usable"] = found.trial_seconds is not None
    return data


def _print(found: Diagnosis, loops: tuple[Loop, ...], problems: list[Problem]) -> None:
    rows = [("python", f"{found.python} on {found.system}, cffi {found.cffi}")]
    if found.toolchain is not None and found.target is not None:
        vectors = f"vectors of {found.target.vector_bytes} bytes"
        rows += [
            ("compiler", f"{found.toolchain.version} ({found.toolchain.kind}), {found.toolchain.path}"),
            ("command", shlex.join(found.toolchain.command)),
            ("flags", " ".join(found.flags)),
            ("target", f"{found.target.triple}, {found.target.cpu}, {vectors}"),
        ]
    if found.cc_setting:
        rows.append(("CC", found.cc_setting))
    if found.trial_seconds is not None:
        width = f"{found.trial_vector_bytes} byte vectors" if found.trial_vector_bytes else "not vectorised"
        if found.trial_processor:
            width += f" at least; of a portable library the build for {found.trial_processor} runs here"
        rows.append(("trial", f"compiled, loaded and called in {duration(found.trial_seconds)}, {width}"))
    rows += [("loops", _summary(kernel, loops)) for kernel in dict.fromkeys(loop.kernel for loop in loops)]
    held = found.cache_size
    writable = "" if found.cache_writable else ", NOT WRITABLE"
    contents = f"{counted(held.kernels, 'kernel')}, {counted(held.recipes, 'recipe')}, {size(held.bytes)}{writable}"
    rows.append(("cache", f"{found.cache_root}: {contents}"))
    rows.append(("packages", ", ".join(f"{name} {_installed(name) or 'MISSING'}" for name, _ in PACKAGES)))
    for name, text in rows:
        print(f"{name:9} {text}")
    print()
    if not problems:
        print("nothing is missing")
    for problem in problems:
        print(f"problem: {problem.text}")
        for number, remedy in enumerate(problem.remedies, 1):
            print(f"    {number}. {remedy}")


def _summary(kernel: str, loops: tuple[Loop, ...]) -> str:
    """`kernel, bytes of the vectors: rows 64 (line 210), 64 (line 213); points 64 (line 240)`."""
    parts = []
    mine = [loop for loop in loops if loop.kernel == kernel]
    for function in dict.fromkeys(loop.function for loop in mine):
        inside = [loop for loop in mine if loop.function == function]
        lines = ", ".join(f"{loop.bytes} (line {loop.line})" for loop in inside)
        parts.append(f"{function.removeprefix(kernel + '_')} {lines}")
    return f"{kernel}, bytes of the vectors: {'; '.join(parts)}"


def _clear(*, as_json: bool) -> int:
    cache = Cache()
    held = cache.clear()
    if as_json:
        print(json.dumps({"cache_root": str(cache.root), "removed": asdict(held)}, indent=2))
    else:
        kernels, recipes = counted(held.kernels, "kernel"), counted(held.recipes, "recipe")
        print(f"removed {kernels}, {recipes}, {size(held.bytes)} from {cache.root}")
    return 0


def _installed(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
