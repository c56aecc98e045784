"""A kernel's C -> the parts of one library that runs well on every processor of its kind.

In:  the C declarations of a kernel, a Toolchain. Out: the builds that the library carries, the text of the C file that
picks one of them when the library is loaded, and what must be defined so that the builds keep apart.
Never here: a compiler, or a file written. On processors whose kind has no such levels (aarch64) there is one build, and
nothing to pick.

A kernel is compiled once for each build, its functions renamed on the command line (-Dname=name_x86_64_v3); the C of
the kernel does not know of it. CMakeLists.txt does the same from the same two files, templates/portable/.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from symrender_cg.build.toolchain import Toolchain
from symrender_cg.errors import LibraryError
from symrender_cg.resources import template_path

BUILDS_FILE = "portable/x86-64.txt"
PICKING_FILE = "portable/portable.c.in"
PICKING_NAME = "portable.c"
SCRIPT_NAME = "compile.sh"
PROCESSOR_FUNCTION = "symrender_processor"
PROCESSOR_DECLARATION = f"const char *{PROCESSOR_FUNCTION}(void);"
PROCESSOR_VARIABLE = "SYMRENDER_PROCESSOR"


@dataclass(frozen=True, slots=True)
class Build:
    """One build of a portable library: what it is called (x86-64-v3) and the flags that make it."""

    name: str
    flags: tuple[str, ...]

    @property
    def suffix(self) -> str:
        """What is added to the names of its functions: _x86_64_v3."""
        return "_" + self.name.replace("-", "_")


@dataclass(frozen=True, slots=True)
class EntryPoint:
    """A function of a kernel: what it returns, its name, its parameters as C text, and the names of those."""

    returns: str
    name: str
    parameters: str
    arguments: tuple[str, ...]


def every_build() -> tuple[Build, ...]:
    """The builds of a portable library for x86-64, the least processor first."""
    lines = template_path(BUILDS_FILE).read_text(encoding="utf-8").splitlines()
    words = [line.split() for line in lines if line.startswith("x")]
    return tuple(Build(name, tuple(flags)) for name, *flags in words)


def builds_of(toolchain: Toolchain) -> tuple[Build, ...]:
    """The builds that a portable library made by this compiler carries; none where it is compiled once.

    zig has names of its own for processors: -mcpu=x86_64_v3 where gcc and clang say -march=x86-64-v3.
    """
    if not toolchain.knows_levels:
        return ()
    if toolchain.kind != "zig":
        return every_build()
    own = {f"-march={build.name}": f"-mcpu={build.name.replace('-', '_')}" for build in every_build()}
    return tuple(Build(build.name, tuple(own.get(flag, flag) for flag in build.flags)) for build in every_build())


def fingerprint(toolchain: Toolchain) -> str:
    """What decides a portable library besides the kernel and the compiler: the texts of templates/portable/."""
    if not builds_of(toolchain):
        return ""
    return "".join(template_path(name).read_text(encoding="utf-8") for name in (BUILDS_FILE, PICKING_FILE))


def entry_points(declarations: str) -> tuple[EntryPoint, ...]:
    """The functions that C declarations name, in their order.

    Raises LibraryError for a parameter without a name, or that is a function written out in place.
    """
    text = re.sub(r"/\*.*?\*/", " ", declarations, flags=re.DOTALL)
    text = re.sub(r"^\s*#.*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"\{[^{}]*\}", " ", text)
    found = []
    for statement in text.split(";"):
        words = " ".join(statement.split())
        prototype = re.fullmatch(r"(?!typedef\b)(.*?[\s*])(\w+) ?\((.*)\)", words)
        if prototype is not None:
            returns, name, parameters = prototype.groups()
            found.append(EntryPoint(returns.strip(), name, parameters, _names(name, parameters)))
    return tuple(found)


def picking_text(declarations: str) -> str:
    """The C file that passes every declared function on to the build for this processor."""
    functions = "\n\n".join(_passed_on(entry) for entry in entry_points(declarations))
    known = f"#include <stddef.h>\n#include <stdint.h>\n\n{declarations.strip()}\n"
    text = template_path(PICKING_FILE).read_text(encoding="utf-8")
    return text.replace("@includes@", known).replace("@functions@", functions)


def definitions(declarations: str, build: Build) -> tuple[str, ...]:
    """The flags that give the functions of a build names of their own."""
    return tuple(f"-D{entry.name}={entry.name}{build.suffix}" for entry in entry_points(declarations))


def binding_text(declarations: str, toolchain: Toolchain, *, portable: bool) -> str:
    """The declarations of all functions of a library: the kernel's, and where builds differ the one that names it."""
    if not portable or not builds_of(toolchain):
        return declarations
    return f"{declarations}\n{PROCESSOR_DECLARATION}\n"


def require_asked_processor(runs: str) -> None:
    """Raise LibraryError where SYMRENDER_PROCESSOR asks for another build than the one that `runs`."""
    asked = os.environ.get(PROCESSOR_VARIABLE, "").strip()
    if asked and asked != runs:
        names = ", ".join(build.name for build in every_build())
        raise LibraryError(
            f"{PROCESSOR_VARIABLE} is {asked!r}, but a portable kernel runs here as {runs!r}: expected one of {names} "
            "that this processor can run. Set it before the first kernel is loaded, or unset it."
        )


def _passed_on(entry: EntryPoint) -> str:
    result = "" if entry.returns == "void" else "return "
    return (
        f"DECLARE({entry.name});\n"
        f"{entry.returns} {entry.name}({entry.parameters})\n"
        f"{{\n    {result}PICK({entry.name}, ({', '.join(entry.arguments)}));\n}}"
    )


def _names(function: str, parameters: str) -> tuple[str, ...]:
    if parameters.strip() in ("", "void"):
        return ()
    names = []
    for parameter in parameters.split(","):
        named = re.fullmatch(r".*[\s*](\w+)(?:\[\w*\])?", parameter.strip())
        if named is None or "(" in parameters:
            raise LibraryError(
                f"{function}({parameters}): a portable library passes parameters on by name, and "
                f"{parameter.strip()!r} is not of the form 'type name'; give the type a name of its own with typedef"
            )
        names.append(named[1])
    return tuple(names)
