"""Laws of portable libraries and of two compilers: every build of a kernel, by gcc or clang, gives the same bits."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_golden import KERNELS

from symrender_cg import render_image
from symrender_cg.build import Cache, Library, compile_library, find_toolchain, load
from symrender_cg.build.library import read_kernel
from symrender_cg.build.portable import Build, builds_of, entry_points, every_build, picking_text
from symrender_cg.build.reports import goals
from symrender_cg.errors import CompileError, LibraryError

ROOT = Path(__file__).resolve().parents[1]
GENERATED = ROOT / "generated"
C_PROGRAM = ROOT / "tests" / "c_program"
WIDTH, HEIGHT = 75, 62

CDEF = "typedef struct { double factor; } scale;\ndouble scaled(const scale *by, double x);\nvoid nothing(void);"
SCALE = {
    "scale.c": """\
#include "scale.h"
double scaled(const scale *by, double x) { return by->factor * x; }
void nothing(void) {}
""",
    "scale.h": CDEF + "\n",
}
WORDS = {"literal": "literal", "single": "single", "double": "double", "baked": "double"}
"""The words that the C program takes, and the accuracy that each stands for."""


def need(program: str, package: str) -> None:
    """Skip a test where a program is not installed, naming the package that has it."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed: apt install {package}")


def need_levels() -> None:
    """Skip a test of several builds where a portable library has one."""
    if not builds_of(find_toolchain()):
        pytest.skip(f"{find_toolchain().version} makes one build for {platform.machine()}")


def runnable() -> list[str]:
    """The builds that this processor can run, the least first, as the system describes it."""
    described = Path("/proc/cpuinfo")
    words = set(described.read_text().split()) if described.is_file() else set[str]()
    asked = {
        "x86-64": set[str](),
        "x86-64-v3": {"avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm"},
        "x86-64-v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    }
    found: list[str] = []
    for name, features in asked.items():
        if not features <= words:
            break
        found.append(name)
    return found


def image(kernel: tuple[str, str, str | None, bool], cache: Path, *, portable: bool = False) -> bytes:
    """The picture of a checked-in kernel's scene, compiled into a cache of its own."""
    scene, accuracy, target, bake = kernel
    return render_image(
        scene, WIDTH, HEIGHT, accuracy=accuracy, target=target, bake=bake, portable=portable, cache=cache, threads=1
    ).tobytes()


def run(*command: str | Path, **environment: str) -> str:
    """The output of a command that must succeed."""
    done = subprocess.run(
        list(map(str, command)), env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(autouse=True)
def _nothing_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.delenv("SYMRENDER_PROCESSOR", raising=False)


def loaded(folder: Path, **options: bool) -> Library:
    """A portable library of two functions, from a cache in a folder."""
    cache = Cache(folder)
    return cache.load(cache.kernel(SCALE, CDEF, portable=options.get("portable", True)))


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache of kernels that gcc made for this machine, for all tests here."""
    return tmp_path_factory.mktemp("gcc")


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: "-".join(map(str, kernel)))
def test_gcc_and_clang_give_the_same_bits(
    kernel: tuple[str, str, str | None, bool], own_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = []
    for compiler, cache in (("gcc", own_cache), ("clang", tmp_path)):
        need(compiler, compiler)
        monkeypatch.setenv("CC", compiler)
        pictures.append(image(kernel, cache))
        made = [read_kernel(folder) for folder in (cache / "kernels").iterdir()]
        assert made
        assert all(kernel is not None and compiler in kernel.manifest.command[0] for kernel in made)
    assert pictures[0] == pictures[1]
    assert len(set(pictures[0])) > 1


@pytest.mark.parametrize(
    "kernel",
    [
        ("chapter1", "literal", None, False),
        ("chapter1", "double", None, False),
        ("chapter1", "stable", None, False),
        ("shadow", "double", None, False),
    ],
    ids=lambda kernel: "-".join(map(str, kernel[:2])),
)
def test_every_build_of_a_portable_library_gives_the_bits_of_the_machines_own(
    kernel: tuple[str, str, str | None, bool], own_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need_levels()
    need("gcc", "gcc")
    monkeypatch.setenv("CC", "gcc")
    expected = image(kernel, own_cache)
    assert image(kernel, tmp_path / "portable", portable=True) == expected
    for name in runnable():
        shutil.copytree(tmp_path / "portable", tmp_path / name)
        monkeypatch.setenv("SYMRENDER_PROCESSOR", name)
        assert image(kernel, tmp_path / name, portable=True) == expected, name
        assert {load(folder).processor for folder in (tmp_path / name / "kernels").iterdir()} == {name}


def test_a_portable_library_runs_the_best_build_of_this_processor(tmp_path: Path) -> None:
    need_levels()
    library = loaded(tmp_path)
    assert library.processor == runnable()[-1]
    assert library.lib.scaled(library.ffi.new("scale *", {"factor": 3.0}), 14.0) == 42.0
    library.lib.nothing()


@pytest.mark.parametrize("name", runnable())
def test_the_variable_chooses_a_lesser_build(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_levels()
    monkeypatch.setenv("SYMRENDER_PROCESSOR", name)
    assert loaded(tmp_path).processor == name


@pytest.mark.parametrize("asked", ["x86-64-v9", "pentium", "X86-64"])
def test_a_processor_that_is_none_of_the_builds_is_an_error_that_names_them(
    asked: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need_levels()
    monkeypatch.setenv("SYMRENDER_PROCESSOR", asked)
    with pytest.raises(
        LibraryError, match=rf"SYMRENDER_PROCESSOR is '{asked}'.*x86-64, x86-64-v3, x86-64-v4"
    ) as caught:
        loaded(tmp_path)
    assert caught.value.exit_code == 5


def test_a_library_for_this_machine_alone_has_nothing_to_pick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYMRENDER_PROCESSOR", "pentium")
    assert loaded(tmp_path, portable=False).processor == ""


def test_a_processor_named_in_cc_leaves_one_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_levels()
    monkeypatch.setenv("CC", "gcc -march=x86-64-v2")
    assert builds_of(find_toolchain()) == ()
    assert loaded(tmp_path).processor == ""


def test_the_script_in_a_kernels_folder_builds_the_library_again(tmp_path: Path) -> None:
    need_levels()
    cache = Cache(tmp_path)
    kernel = cache.kernel(SCALE, CDEF, portable=True)
    assert kernel.manifest.command == ("sh", "compile.sh")
    before = sorted(kernel.folder.iterdir())
    kernel.library_path.unlink()
    subprocess.run(kernel.manifest.command, cwd=kernel.folder, check=True)
    assert sorted(kernel.folder.iterdir()) == before
    assert cache.load(kernel).processor == runnable()[-1]


def test_a_portable_library_shows_its_own_functions_and_none_of_its_builds(tmp_path: Path) -> None:
    need_levels()
    need("nm", "binutils")
    listing = run("nm", "-D", "--defined-only", loaded(tmp_path).path)
    assert {line.split()[-1] for line in listing.splitlines()} >= {"scaled", "nothing", "symrender_processor"}
    assert "_x86_64" not in listing


def test_a_build_that_the_compiler_refuses_leaves_no_library(tmp_path: Path) -> None:
    need_levels()
    bad = {**SCALE, "scale.c": SCALE["scale.c"] + "#ifdef __AVX512F__\n#error no such vectors\n#endif\n"}
    with pytest.raises(CompileError, match="no such vectors") as caught:
        compile_library(bad, tmp_path / "kernel.so", toolchain=find_toolchain(), portable=True, declarations=CDEF)
    assert "-march=x86-64-v4" in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["compile.sh", "portable.c", "scale.c", "scale.h"]


def test_the_functions_of_declarations_are_found_whatever_stands_around_them() -> None:
    text = """\
#include <stddef.h>
/* not (a) function; */
typedef struct { double x, y; } pair;
typedef struct frame frame;
frame *made(const pair *p, ptrdiff_t   count);
void gone(frame *f);
const char *told(void);
double first(double values[4],
    int n);
"""
    assert [(e.returns, e.name, e.arguments) for e in entry_points(text)] == [
        ("frame *", "made", ("p", "count")),
        ("void", "gone", ("f",)),
        ("const char *", "told", ()),
        ("double", "first", ("values", "n")),
    ]


@pytest.mark.parametrize("text", ["void f(double);", "void f(int n, void (*each)(int));"])
def test_a_parameter_that_cannot_be_passed_on_by_name_is_refused(text: str) -> None:
    with pytest.raises(LibraryError, match=r"f\(.*\): a portable library passes parameters on by name"):
        picking_text(text)


def test_zig_is_asked_for_the_builds_by_its_own_names() -> None:
    builds = builds_of(replace(find_toolchain(), kind="zig", knows_levels=True))
    assert [build.name for build in builds] == ["x86-64", "x86-64-v3", "x86-64-v4"]
    assert [build.flags[0] for build in builds] == ["-mcpu=x86_64", "-mcpu=x86_64_v3", "-mcpu=x86_64_v4"]


def test_the_builds_of_the_list_are_those_of_the_c_file() -> None:
    text = (ROOT / "templates" / "portable" / "portable.c.in").read_text()
    (listed,) = re.findall(r"BUILDS\[\] = \{(.*)\}", text)
    assert [name.strip(' "') for name in listed.split(",")] == [build.name for build in every_build()]
    assert all(f"name##{build.suffix}" in text for build in every_build())
    assert every_build()[1] == Build("x86-64-v3", ("-march=x86-64-v3",))


# --- the C library ---


@pytest.fixture(scope="module")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The kernels that the C program uses, and no other."""
    folder = tmp_path_factory.mktemp("kernels")
    for name in re.findall(r"<symrender_cg/(\w+)\.h>", (C_PROGRAM / "render.c").read_text()):
        shutil.copytree(GENERATED / name, folder / name)
    shutil.copytree(GENERATED / "support", folder / "support")
    return folder


@pytest.fixture(scope="module")
def program(kernels: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The C program, linked to a static portable library that was added to its project as a subdirectory."""
    need("cmake", "cmake")
    need_levels()
    folder = tmp_path_factory.mktemp("program")
    (folder / "main.c").write_text((C_PROGRAM / "render.c").read_text())
    (folder / "which.c").write_text(
        "#include <stdio.h>\nconst char *symrender_processor(void);\n"
        "int main(void) { return puts(symrender_processor()) < 0; }\n"
    )
    (folder / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.20)\nproject(user C)\n"
        f'add_subdirectory("{ROOT}" library)\n'
        "foreach(name main which)\n  add_executable(${name} ${name}.c)\n"
        "  target_link_libraries(${name} PRIVATE symrender_cg::symrender_cg)\nendforeach()\n"
    )
    options = ("-DSYMRENDER_PORTABLE=ON", f"-DSYMRENDER_KERNELS={kernels}", "-DBUILD_SHARED_LIBS=OFF")
    run("cmake", "-S", folder, "-B", folder / "build", *options)
    run("cmake", "--build", folder / "build")
    return folder / "build"


def python_image(word: str) -> bytes:
    """The unclipped image of Chapter 1's scene as Python renders it."""
    picture = render_image("chapter1", WIDTH, HEIGHT, accuracy=WORDS[word], bake=word == "baked", clip=False)
    assert 1.2 < np.max(picture) < 1.3
    return picture.tobytes()


def drawn(*command: str | Path, place: Path, **environment: str) -> bytes:
    """What the C program writes."""
    run(*command, str(WIDTH), str(HEIGHT), place, **environment)
    return place.read_bytes()


@pytest.mark.parametrize("name", runnable())
def test_each_build_of_the_c_library_draws_pythons_bits(program: Path, name: str, tmp_path: Path) -> None:
    assert run(program / "which", SYMRENDER_PROCESSOR=name).strip() == name
    for word in WORDS:
        assert drawn(program / "main", word, place=tmp_path / word, SYMRENDER_PROCESSOR=name) == python_image(word), (
            word
        )


def test_the_c_library_passes_over_a_name_that_it_does_not_know(program: Path) -> None:
    assert run(program / "which").strip() == runnable()[-1]
    assert run(program / "which", SYMRENDER_PROCESSOR="pentium").strip() == runnable()[-1]


@pytest.mark.parametrize(
    ("processor", "expected"), [("qemu64", "x86-64"), ("Nehalem", "x86-64"), ("Haswell", "x86-64-v3")]
)
def test_an_emulated_processor_gets_the_build_that_it_can_run(
    program: Path, processor: str, expected: str, tmp_path: Path
) -> None:
    need("qemu-x86_64", "qemu-user")
    emulated = ("qemu-x86_64", "-cpu", processor)
    assert run(*emulated, program / "which", SYMRENDER_PROCESSOR="x86-64-v4").strip() == expected
    assert drawn(*emulated, program / "main", "double", place=tmp_path / "raw") == python_image("double")


@pytest.mark.parametrize("compiler", ["aarch64-linux-gnu-gcc", "clang"])
def test_an_emulated_aarch64_draws_the_bits_of_this_machine(compiler: str, kernels: Path, tmp_path: Path) -> None:
    need(compiler, "gcc-aarch64-linux-gnu" if compiler.startswith("aarch64") else compiler)
    if ("clang" if compiler == "clang" else "gcc", "aarch64") not in {(g.kind, g.processor) for g in goals()}:
        pytest.skip("no C library for aarch64 is installed: apt install libc6-dev-arm64-cross gcc-aarch64-linux-gnu")
    need("qemu-aarch64", "qemu-user")
    headers = tmp_path / "include" / "symrender_cg"
    headers.mkdir(parents=True)
    for path in kernels.glob("*/*.h"):
        shutil.copy(path, headers)
    flags = [line for line in (ROOT / "templates" / "compile-flags.txt").read_text().splitlines() if line[:1] == "-"]
    target = ("--target=aarch64-linux-gnu",) if compiler == "clang" else ()
    units = (C_PROGRAM / "render.c", *sorted(kernels.glob("*/*.c")))
    include = (f"-I{tmp_path / 'include'}", f"-I{kernels / 'support'}")
    run(compiler, *target, *flags, *include, "-static", *units, "-o", tmp_path / "render", "-lm")
    for word in WORDS:
        picture = drawn("qemu-aarch64", tmp_path / "render", word, place=tmp_path / word)
        assert picture == python_image(word), word
