"""Laws of the C library: made without Python, found by other builds, and its images are Python's bit for bit."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from symrender_cg import __version__, render_image
from symrender_cg.build import find_toolchain, kernel_flags, project_flags
from symrender_cg.build.toolchain import Toolchain
from symrender_cg.build.vectorisation import missed, report

ROOT = Path(__file__).resolve().parents[1]
GENERATED = ROOT / "generated"
C_PROGRAM = ROOT / "tests" / "c_program"
DEBIAN_PACKAGES = {
    "cmake": "cmake",
    "pkg-config": "pkg-config",
    "gcc": "gcc",
    "clang": "clang",
    "g++": "g++",
    "clang++": "clang",
}
KERNELS = tuple(sorted(path.stem for path in GENERATED.glob("*/*.c")))
RENDERED = {"literal": "literal", "single": "single", "double": "double", "baked": "double"}
"""The words that the C program takes, and the accuracy that each stands for."""

WIDTH, HEIGHT = 200, 150


def need(*programs: str) -> None:
    """Skip a test where a program is not installed, naming the package that has it."""
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed: apt install {DEBIAN_PACKAGES[program]}")


def run(*command: str | Path, **environment: str) -> str:
    """The output of a command that must succeed."""
    done = refused(*command, **environment)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}"
    return done.stdout


def refused(*command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """A command that may fail; no compiler flag of the caller's environment reaches it."""
    inherited = {name: value for name, value in os.environ.items() if name not in ("CFLAGS", "CC", "LDFLAGS")}
    return subprocess.run(
        list(map(str, command)), env={**inherited, **environment}, capture_output=True, text=True, check=False
    )


@dataclass(frozen=True)
class Installation:
    """A place where the library was installed, and the C program built against it; the compiler it was made with."""

    prefix: Path
    program: Path
    compiler: str

    def render(self, word: str, folder: Path) -> bytes:
        """What the C program writes."""
        path = folder / f"{word}.raw"
        run(self.program, word, str(WIDTH), str(HEIGHT), path, LD_LIBRARY_PATH=str(self.prefix / "lib"))
        return path.read_bytes()


def install(folder: Path, compiler: str, *options: str) -> Installation:
    """Configure, build and install the library; move it away; then build the C program with find_package."""
    built_for, moved_to = folder / "built-for", folder / "moved-to"
    chosen = f"-DCMAKE_C_COMPILER={compiler}"
    asked = (chosen, "-DCMAKE_INSTALL_LIBDIR=lib", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", *options)
    run("cmake", "-S", ROOT, "-B", folder / "library", *asked)
    run("cmake", "--build", folder / "library")
    run("cmake", "--install", folder / "library", "--prefix", built_for)
    built_for.rename(moved_to)
    run("cmake", "-S", C_PROGRAM, "-B", folder / "program", chosen, f"-DCMAKE_PREFIX_PATH={moved_to}")
    run("cmake", "--build", folder / "program")
    return Installation(moved_to, folder / "program" / "render", compiler)


@pytest.fixture(scope="module")
def toolchain() -> Toolchain:
    """The compiler that Python's kernels are made with."""
    return find_toolchain()


@pytest.fixture(scope="module")
def shared(toolchain: Toolchain, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """The shared library, by the compiler and for the processor of Python's kernels."""
    need("cmake")
    return install(tmp_path_factory.mktemp("shared"), toolchain.path)


def python_image(word: str) -> bytes:
    """The unclipped image of Chapter 1's scene as Python renders it."""
    image = render_image("chapter1", WIDTH, HEIGHT, accuracy=RENDERED[word], bake=word == "baked", clip=False)
    return image.tobytes()


@pytest.mark.parametrize("word", RENDERED)
def test_a_c_program_that_found_the_package_renders_pythons_bits(
    shared: Installation, word: str, tmp_path: Path
) -> None:
    written = shared.render(word, tmp_path)
    assert written == python_image(word)
    image = np.frombuffer(written, np.float32 if word == "single" else np.float64).reshape(HEIGHT, WIDTH)
    assert 1.2 < image.max() < 1.3
    assert image[0, 0] == 0.0


def test_a_c_program_that_asked_pkg_config_renders_pythons_bits(shared: Installation, tmp_path: Path) -> None:
    need("pkg-config")
    place = str(shared.prefix / "lib" / "pkgconfig")
    answer = run("pkg-config", "--cflags", "--libs", "symrender_cg", PKG_CONFIG_PATH=place).split()
    program = tmp_path / "render"
    run(shared.compiler, "-std=c99", C_PROGRAM / "render.c", *answer, "-lm", "-o", program)
    assert Installation(shared.prefix, program, shared.compiler).render("double", tmp_path) == python_image("double")
    version = run("pkg-config", "--modversion", "symrender_cg", PKG_CONFIG_PATH=place)
    assert version.strip() == __version__


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("native", ["ON", "OFF"])
def test_neither_compiler_nor_processor_nor_kind_of_library_changes_a_bit(
    compiler: str, native: str, tmp_path: Path
) -> None:
    need("cmake", compiler)
    static = install(tmp_path, compiler, f"-DSYMRENDER_NATIVE={native}", "-DBUILD_SHARED_LIBS=OFF")
    assert (static.prefix / "lib" / "libsymrender_cg.a").is_file()
    for word in RENDERED:
        assert static.render(word, tmp_path) == python_image(word), word


def test_cmake_compiles_with_the_flags_of_the_python_build(
    shared: Installation, toolchain: Toolchain, tmp_path: Path
) -> None:
    expected = kernel_flags(toolchain, portable=False)
    commands = json.loads((shared.prefix.parent / "library" / "compile_commands.json").read_text())
    assert len(commands) == len(KERNELS)
    for command in commands:
        words = command["command"].split()
        assert [word for word in words if word in expected] == list(expected)
        assert not [
            word for word in words if re.match(r"-(O|f|m|std)", word) and word not in (*expected, "-fPIC", "-o")
        ]


def test_a_package_of_another_minor_version_is_not_found(shared: Installation, tmp_path: Path) -> None:
    project = tmp_path / "CMakeLists.txt"
    project.write_text(
        "cmake_minimum_required(VERSION 3.20)\nproject(newer C)\nfind_package(symrender_cg 0.99 CONFIG REQUIRED)\n"
    )
    answer = refused("cmake", "-S", tmp_path, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={shared.prefix}")
    assert answer.returncode != 0
    assert f"version: {__version__}" in answer.stderr


def test_flags_that_undo_compensated_arithmetic_are_refused(tmp_path: Path) -> None:
    need("cmake")
    answer = refused("cmake", "-S", ROOT, "-B", tmp_path, "-DCMAKE_C_FLAGS=-O2 -ffast-math")
    assert answer.returncode != 0
    assert "-ffast-math in the C flags" in answer.stderr


def test_a_folder_without_kernels_is_refused(tmp_path: Path) -> None:
    need("cmake")
    answer = refused("cmake", "-S", ROOT, "-B", tmp_path, f"-DSYMRENDER_KERNELS={tmp_path}")
    assert answer.returncode != 0
    assert f"no kernel in {tmp_path}: expected" in " ".join(answer.stderr.split())


def test_the_installed_headers_are_those_that_a_user_includes(shared: Installation) -> None:
    installed = sorted(path.name for path in (shared.prefix / "include" / "symrender_cg").iterdir())
    assert installed == sorted(["grid.h", *(f"{kernel}.h" for kernel in KERNELS)])


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_a_cpp_program_links_to_the_library(shared: Installation, compiler: str, tmp_path: Path) -> None:
    need(compiler)
    source = tmp_path / "value.cpp"
    includes = "".join(f"#include <symrender_cg/{kernel}.h>\n" for kernel in KERNELS)
    call = "double v = 0, x = 0, y = 0; centred_sphere_double_baked_points(&v, &x, &y, 1, 1); return !(v > 0);"
    source.write_text(f"{includes}int main() {{ {call} }}\n")
    library = shared.prefix / "lib"
    flags = ("-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{shared.prefix / 'include'}", f"-L{library}")
    run(compiler, *flags, source, "-o", tmp_path / "value", "-lsymrender_cg", "-lm")
    run(tmp_path / "value", LD_LIBRARY_PATH=str(library))


def test_the_line_that_the_readme_of_generated_gives_compiles_a_kernel(tmp_path: Path) -> None:
    need("gcc")
    shutil.copytree(GENERATED, tmp_path / "generated")
    shutil.copytree(ROOT / "templates", tmp_path / "templates")
    (line,) = re.findall(r"^gcc .*$", (GENERATED / "README.md").read_text(), re.MULTILINE)
    subprocess.run(line, shell=True, check=True, cwd=tmp_path / "generated")
    assert (tmp_path / "generated" / "kernel.so").is_file()


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_a_kernel_is_strict_c99_without_a_warning(compiler: str, kernel: str, tmp_path: Path) -> None:
    need(compiler)
    assert {"-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"} <= set(project_flags())
    source, support = GENERATED / kernel / f"{kernel}.c", GENERATED / "support"
    more = ("-pedantic-errors", "-Wshadow", "-Wstrict-prototypes", "-Wmissing-prototypes")
    run(compiler, *project_flags(), *more, f"-I{support}", "-c", source, "-o", tmp_path / "kernel.o")


@dataclass(frozen=True)
class Loop:
    """A `for` of the generated C: its line, 1-based, and the text of its body."""

    line: int
    head: str
    body: str


def loops(text: str) -> list[Loop]:
    """Every `for` of a C text; by its indentation a body ends."""
    lines = text.splitlines()
    found = []
    for number, line in enumerate(lines, 1):
        if re.match(r" *for \(", line):
            indent = len(line) - len(line.lstrip())
            body = []
            for inner in lines[number:]:
                if inner.strip() and len(inner) - len(inner.lstrip()) <= indent:
                    break
                body.append(inner)
            found.append(Loop(number, line.strip(), "\n".join(body)))
    return found


def inner_loops(text: str) -> list[Loop]:
    """The loops without a loop inside, save those that settle the few doubtful points by exact arithmetic, and the one
    over the images of a batch."""
    outer = ("for (", "hits_exactly(", "_rows(")
    return [loop for loop in loops(text) if not any(word in loop.body for word in outer)]


@pytest.mark.parametrize("kernel", [k for k in KERNELS if not re.search("^scene|_stable$|_certified", k)])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_every_inner_loop_becomes_vector_code(compiler: str, kernel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    need(compiler)
    monkeypatch.setenv("CC", compiler)
    chosen = find_toolchain()
    if chosen.native.vector_bytes < 32:
        pytest.skip(f"the vectors of this processor have {chosen.native.vector_bytes} bytes; the law is for AVX and up")
    paths = (GENERATED / kernel / f"{kernel}.c", GENERATED / kernel / f"{kernel}.h", *(GENERATED / "support").iterdir())
    sources = {path.name: path.read_text() for path in paths}
    file = f"{kernel}.c"
    inner = inner_loops(sources[file])

    stages = len(set(re.findall(r"^SYMRENDER_INLINE void (stage_\d+)", sources[file], flags=re.MULTILINE)))
    shading = [loop for loop in inner if re.search(r"shade\(|stage_\d", loop.body)]
    values = [loop for loop in inner if "at_most(" in loop.body and loop not in shading]
    fills = [loop for loop in inner if loop not in shading + values]
    assert len(shading) == 2 * max(1, stages), "each stage, for the pixels of a row and for points"
    assert bool(values) == bool(stages), "values are written in loops of their own where the steps of a pixel are"
    assert len(fills) == (2 if stages or "pixel_span" in sources[file] else 0), (
        "background to the left and to the right of a span"
    )

    vectorised = {loop.line for loop in report(sources, toolchain=chosen) if loop.file == file}
    for loop in inner:
        reasons = missed(sources, file, loop.line, toolchain=chosen) if loop.line not in vectorised else ()
        assert loop.line in vectorised, f"{file}:{loop.line}: {loop.head}\n  " + "\n  ".join(reasons)


def test_a_loop_that_calls_a_function_is_not_taken_for_vector_code() -> None:
    text = "void f(double *x, int n)\n{\n    for (int i = 0; i < n; ++i)\n        x[i] = g(x[i]);\n}\n"
    assert [loop.line for loop in inner_loops(text)] == [3]
    sources = {"f.c": "double g(double x);\nvoid f(double *x, int n);\n" + text}
    assert report(sources, toolchain=find_toolchain()) == ()
