"""Laws of finding a compiler, of its flags, of compiling, of the vectorisation report and of the diagnosis."""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from symrender_cg.build import (
    Cache,
    compile_library,
    find_toolchain,
    kernel_flags,
    project_flags,
    reports,
    vectorisation,
)
from symrender_cg.build import toolchain as toolchain_module
from symrender_cg.build.diagnosis import diagnose
from symrender_cg.build.toolchain import REMEDIES, RecordStore, Toolchain
from symrender_cg.cli import vectors
from symrender_cg.cli.main import main
from symrender_cg.errors import ArgumentError, CompileError, CompilerNotFoundError

ROOT = Path(__file__).resolve().parents[1]
GCC = shutil.which("gcc") or "gcc"
ADD = {
    "add.c": '#include "add.h"\ndouble add(double a, double b) { return a + b; }\n',
    "add.h": "double add(double a, double b);\n",
}
LOOPS = {
    "loops.c": """\
#include <math.h>
void roots(const double *restrict x, double *restrict y, int n);
void singles(const float *restrict x, float *restrict y, int n);
void decay(const double *restrict x, double *restrict y, double p, int n);
static inline double shade(double x) { return x > 0.0 ? sqrt(x) : 0.0; }
void roots(const double *restrict x, double *restrict y, int n)
{
    for (int i = 0; i < n; ++i)
        y[i] = shade(x[i]);
}
void singles(const float *restrict x, float *restrict y, int n)
{
    for (int i = 0; i < n; ++i)
        y[i] = sqrtf(x[i]) * 2.0f;
}
void decay(const double *restrict x, double *restrict y, double p, int n)
{
    for (int i = 1; i < n; ++i)
        y[i] = y[i - 1] * p + x[i];
}
"""
}


class MemoryRecords(RecordStore):
    def __init__(self) -> None:
        self.texts: dict[str, str] = {}

    def read(self, name: str) -> str | None:
        return self.texts.get(name)

    def write(self, name: str, text: str) -> None:
        self.texts[name] = text


@pytest.fixture(autouse=True)
def _no_cc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)


@pytest.fixture
def bare_path(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A PATH of one empty folder, and no ziglang wheel."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(toolchain_module, "_zig_wheel", lambda: None)
    return folder


def script(path: Path, body: str) -> Path:
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return path


def no_process(*args: object, **kwargs: object) -> None:
    raise AssertionError(f"a process was started: {args}")


def test_cc_with_arguments_comes_first_and_keeps_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"{GCC} -DCHOSEN='1 2'")
    found = find_toolchain()
    assert found.command == (GCC, "-DCHOSEN=1 2")
    assert found.path == GCC
    assert found.kind == "gcc"
    assert "version" in found.version


def test_a_missing_cc_is_an_error_that_names_it_and_never_a_fall_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(CompilerNotFoundError, match="CC is 'no-such-compiler -m64'") as caught:
        find_toolchain()
    assert all(remedy in str(caught.value) for remedy in REMEDIES)
    assert caught.value.exit_code == 5


def test_a_cc_that_does_not_compile_is_an_error_with_what_it_said(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CC", str(script(tmp_path / "broken", "echo out of order >&2; exit 3")))
    with pytest.raises(CompilerNotFoundError, match=r"CC .*broken.*exit status 3, it said: out of order"):
        find_toolchain()


def test_a_cc_that_is_no_command_line_is_an_error_that_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "gcc 'unclosed")
    with pytest.raises(CompilerNotFoundError, match=r"CC is .*not a command"):
        find_toolchain()


def test_without_any_compiler_the_error_names_the_places_and_three_remedies(bare_path: Path) -> None:
    with pytest.raises(CompilerNotFoundError) as caught:
        find_toolchain()
    text = str(caught.value)
    for expected in ("CC (not set)", "cc, gcc, clang on PATH", str(bare_path), "ziglang wheel"):
        assert expected in text
    for expected in ("apt install gcc", "xcode-select --install", "pip install ziglang", 'backend="numpy"'):
        assert expected in text
    assert len(REMEDIES) == 3


def test_a_compiler_on_path_that_does_not_work_is_passed_over(bare_path: Path) -> None:
    script(bare_path / "cc", "exit 1")
    (bare_path / "gcc").symlink_to(GCC)
    assert find_toolchain().path == str(bare_path / "gcc")


def test_cc_gcc_clang_are_tried_in_that_order(bare_path: Path) -> None:
    for name in ("clang", "gcc", "cc"):
        script(bare_path / name, f'exec {GCC} "$@"')
        assert find_toolchain().path == str(bare_path / name)


def test_the_ziglang_wheel_is_the_last_resort(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = tmp_path / "site" / "ziglang"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "__main__.py").write_text(
        "import os, sys\n"
        "words = [w for w in sys.argv[2:] if w != '-mcpu=baseline']\n"
        f"os.execv({GCC!r}, [{GCC!r}, *words])\n"
    )
    script(package / "zig", "exit 0")
    monkeypatch.syspath_prepend(str(package.parent))
    monkeypatch.setenv("PYTHONPATH", str(package.parent))
    assert find_toolchain().kind != "zig"
    empty = tmp_path / "bin"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))
    found = find_toolchain()
    assert found.kind == "zig"
    assert found.command == (sys.executable, "-m", "ziglang", "cc")
    assert found.path == str(package / "zig")
    assert found.portable.flags == ("-mcpu=baseline",)


def test_a_known_compiler_is_recognised_without_a_process(monkeypatch: pytest.MonkeyPatch) -> None:
    records = MemoryRecords()
    first = find_toolchain(records=records)
    monkeypatch.setattr(subprocess, "Popen", no_process)
    assert find_toolchain(records=records) == first
    assert len(records.texts) == 1


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"path": "/usr/bin/cc"}'])
def test_a_damaged_record_is_asked_for_again(damage: str) -> None:
    records = MemoryRecords()
    first = find_toolchain(records=records)
    records.texts = dict.fromkeys(records.texts, damage)
    assert find_toolchain(records=records) == first
    assert damage not in records.texts.values()


def test_a_replaced_compiler_or_another_processor_is_asked_anew(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    records = MemoryRecords()
    wrapper = script(tmp_path / "mycc", f'exec {GCC} "$@"')
    monkeypatch.setenv("CC", str(wrapper))
    find_toolchain(records=records)
    os.utime(wrapper, ns=(1, 1))
    find_toolchain(records=records)
    assert len(records.texts) == 2
    monkeypatch.setattr(toolchain_module, "cpu_identity", lambda: "another machine")
    find_toolchain(records=records)
    assert len(records.texts) == 3


def test_a_toolchain_survives_its_record_and_pickle() -> None:
    found = find_toolchain()
    assert Toolchain.from_json(found.to_json()) == found
    assert pickle.loads(pickle.dumps(found)) == found


def test_the_portable_target_has_no_machine_flag_and_no_wider_vectors() -> None:
    found = find_toolchain()
    assert not any(flag.startswith(("-march", "-mcpu")) for flag in kernel_flags(found, portable=True))
    assert found.target(True) == found.portable
    assert found.target(False).flags in (("-march=native",), ("-mcpu=native",), ())
    assert 16 <= found.portable.vector_bytes <= found.native.vector_bytes


def test_an_architecture_chosen_in_cc_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    baseline = find_toolchain().portable
    if not baseline.triple.startswith("x86_64"):
        pytest.skip("the architecture named here is x86-64")
    monkeypatch.setenv("CC", f"{GCC} -march=x86-64")
    assert find_toolchain().native.flags == ()
    assert find_toolchain().native.vector_bytes == 16


def test_every_project_flag_has_a_comment_and_none_relaxes_ieee_values() -> None:
    lines = (ROOT / "templates" / "compile-flags.txt").read_text().splitlines()
    flags = [line for line in lines if line.startswith("-")]  # what CMake's REGEX "^-" selects
    assert tuple(flags) == project_flags()
    assert all(line.startswith(("#", "-")) or not line for line in lines)
    explained = [index for index, line in enumerate(lines) if line in flags and not line.startswith("-W")]
    assert all(lines[index - 1].startswith("#") for index in explained)
    assert {"-std=c99", "-O3", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror"} <= set(flags)
    assert not {"-ffast-math", "-Ofast", "-funsafe-math-optimizations"} & set(flags)


def test_a_refused_source_raises_with_command_status_and_stderr_and_leaves_no_library(tmp_path: Path) -> None:
    output = tmp_path / "kernel.so"
    with pytest.raises(CompileError) as caught:
        compile_library({"bad.c": "int f(void) { return undeclared; }\n"}, output, toolchain=find_toolchain())
    assert "undeclared" in caught.value.stderr
    assert caught.value.status == 1
    text = str(caught.value)
    assert "bad.c" in text
    assert "-ffp-contract=off" in text
    assert "exit status 1" in text
    assert not output.exists()


def test_a_warning_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="unused"):
        compile_library(
            {"warns.c": "int f(void); int f(void) { int unused; return 1; }\n"},
            tmp_path / "kernel.so",
            toolchain=find_toolchain(),
        )


def test_a_compiler_that_vanished_is_a_compile_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wrapper = script(tmp_path / "mycc", f'exec {GCC} "$@"')
    monkeypatch.setenv("CC", str(wrapper))
    found = find_toolchain()
    wrapper.unlink()
    with pytest.raises(CompileError, match="could not be started"):
        compile_library(ADD, tmp_path / "kernel.so", toolchain=found)


@pytest.mark.parametrize("name", ["../out.c", "/out.c", "a/../../out.c", "-o.c", ""])
def test_a_source_name_that_leaves_the_folder_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ArgumentError, match="relative file name"):
        compile_library({name: "int x;\n"}, tmp_path / "kernel.so", toolchain=find_toolchain())


def test_sources_without_a_c_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"no \.c file"):
        compile_library({"only.h": "int x;\n"}, tmp_path / "kernel.so", toolchain=find_toolchain())


def test_sources_in_folders_and_extra_flags_reach_the_compiler(tmp_path: Path) -> None:
    sources = {
        "main.c": '#include "support/level.h"\nint level(void) { return LEVEL + EXTRA; }\n',
        "support/level.h": "#define LEVEL 40\nint level(void);\n",
    }
    record = compile_library(sources, tmp_path / "kernel.so", toolchain=find_toolchain(), extra_flags=("-DEXTRA=2",))
    assert "-DEXTRA=2" in record.command
    assert record.seconds > 0.0
    assert (tmp_path / "kernel.so").is_file()


def compilers() -> list[str]:
    return [name for name in ("gcc", "clang") if shutil.which(name)]


@pytest.mark.parametrize("compiler", compilers())
def test_the_report_gives_line_and_bytes_of_each_vectorised_loop(
    compiler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", compiler)
    found = find_toolchain()
    for portable in (False, True):
        loops = vectorisation.report(LOOPS, toolchain=found, portable=portable)
        assert [(loop.file, loop.line) for loop in loops] == [("loops.c", 8), ("loops.c", 13)]
        limit = found.target(portable).vector_bytes
        assert all(16 <= loop.bytes <= limit for loop in loops)
        if portable:
            assert {loop.bytes for loop in loops} == {16}


@pytest.mark.parametrize("compiler", compilers())
def test_a_recurrence_is_missed_with_a_reason(compiler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", compiler)
    found = find_toolchain()
    assert all(loop.line != 18 for loop in vectorisation.report(LOOPS, toolchain=found))
    assert vectorisation.missed(LOOPS, "loops.c", 18, toolchain=found)


def test_a_flag_that_stops_vectorising_empties_the_report() -> None:
    found = find_toolchain()
    assert vectorisation.report(LOOPS, toolchain=found, extra_flags=("-fno-tree-vectorize",)) == ()


def test_the_diagnosis_of_a_working_machine_has_no_problem(tmp_path: Path) -> None:
    seen = diagnose(tmp_path / "cache")
    assert seen.problems == ()
    assert seen.toolchain == find_toolchain()
    assert seen.target == seen.toolchain.native
    assert seen.flags[: len(project_flags())] == project_flags()
    assert seen.trial_seconds is not None
    assert 16 <= seen.trial_vector_bytes <= seen.target.vector_bytes
    assert seen.cache_writable
    assert seen.cache_root == tmp_path / "cache"


def test_the_diagnosis_without_a_compiler_names_the_remedies(bare_path: Path, tmp_path: Path) -> None:
    seen = diagnose(tmp_path / "cache")
    assert seen.toolchain is None
    assert seen.target is None
    assert seen.flags == ()
    assert seen.trial_seconds is None
    (problem,) = seen.problems
    assert problem.text.startswith("no C compiler found")
    assert problem.text.endswith("ziglang wheel")
    assert problem.remedies == REMEDIES


def test_the_diagnosis_of_a_cache_that_cannot_be_written_says_where_and_why(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    seen = diagnose(tmp_path / "file" / "cache")
    assert not seen.cache_writable
    (problem,) = seen.problems
    assert str(tmp_path / "file" / "cache") in problem.text
    assert "Not a directory" in problem.text
    assert "SYMRENDER_CACHE_DIR" in problem.remedies[0]


def test_importing_build_loads_no_compiler_runner_no_parser_and_no_mathematics() -> None:
    program = (
        "import sys, types\n"
        "package = types.ModuleType('symrender_cg')\n"  # without what the package's own __init__ may import
        f"package.__path__ = [{str(ROOT / 'symrender_cg')!r}]\n"
        "sys.modules['symrender_cg'] = package\n"
        "import symrender_cg.build\n"
        "heavy = {'sympy', 'numpy', 'jinja2', 'rich', 'msgspec', 'cffi', 'platformdirs', 'subprocess', 'tempfile'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
    )
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def test_the_cache_remembers_its_toolchain_between_instances(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    first = Cache(tmp_path).toolchain()
    monkeypatch.setattr(subprocess, "Popen", no_process)
    assert Cache(tmp_path).toolchain() == first


def test_a_compiler_knows_the_levels_of_x86_64_where_it_makes_code_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    found = find_toolchain()
    if not found.portable.triple.startswith("x86_64"):
        assert not found.knows_levels
        return
    command = [*found.command, "-march=x86-64-v3", "-E", "-x", "c", os.devnull]
    assert found.knows_levels == (subprocess.run(command, capture_output=True, check=False).returncode == 0)
    monkeypatch.setenv("CC", f"{GCC} -march=x86-64-v2")
    assert not find_toolchain().knows_levels


def test_the_levels_are_those_that_the_versions_of_the_compilers_know() -> None:
    for kind, macros, expected in (
        ("gcc", {"__x86_64__": "1", "__GNUC__": "11"}, True),
        ("gcc", {"__x86_64__": "1", "__GNUC__": "10"}, False),
        ("gcc", {"__aarch64__": "1", "__GNUC__": "12"}, False),
        ("clang", {"__x86_64__": "1", "__GNUC__": "4", "__clang_major__": "14"}, True),
        ("clang", {"__x86_64__": "1", "__GNUC__": "4", "__clang_major__": "11"}, False),
        ("clang", {"__x86_64__": "1", "__clang_major__": "12", "__apple_build_version__": "1"}, False),
        ("zig", {"__x86_64__": "1", "__clang_major__": "18"}, True),
    ):
        assert toolchain_module._knows_levels(kind, macros) is expected, (kind, macros)


NESTED = """\
static double total(
    const double *x, int n)
{
    double sum = 0.0;
    /* all of them */
    for (int i = 0; i < n; ++i)
        sum += x[i];
    while (sum > 1.0
           && n > 0) {
        const double half = 0.5;
        sum *= half;
        sum = sum - half;
    }
    return sum;
}

void each(double *x, int n)
{
    for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
            /* light [4 mul] */
            x[i] = x[j];
        }
    }
}
"""


def test_loops_are_found_with_their_function_lines_and_purpose() -> None:
    found = [(o.function, o.line, o.last, o.does, o.holds_loops) for o in reports.loops_of(NESTED)]
    assert found == [
        ("total", 6, 7, "all of them", False),
        ("total", 8, 13, "sum = sum - half;", False),
        ("each", 19, 24, "x[i] = x[j];", True),
        ("each", 20, 23, "light", False),
    ]


@pytest.mark.parametrize("goal", reports.goals(), ids=lambda goal: f"{goal.kind}-{goal.processor}")
def test_each_goal_has_a_verdict_on_every_loop(goal: reports.Goal) -> None:
    given = reports.verdicts(LOOPS, "loops.c", goal)
    assert {line: verdict.bytes for line, verdict in given.items()} == {8: goal.bytes, 13: goal.bytes, 18: 0}
    assert given[8].reasons == given[13].reasons == ()
    assert given[18].reasons
    assert given[18].reasons != (reports.SILENCE,)


def test_a_goal_whose_flags_are_refused_is_said_and_the_others_are_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    goal = next((goal for goal in reports.goals() if not goal.is_foreign), None)
    assert goal is not None
    refused = reports.Goal(goal.kind, "aarch64", (*goal.command, "-march=no-such-processor"), 16)
    monkeypatch.setattr(vectors, "goals", lambda: (goal, refused))
    (tmp_path / "loops.c").write_text(LOOPS["loops.c"])
    monkeypatch.setenv("SYMRENDER_CACHE_DIR", str(tmp_path))
    assert main(["doctor", "--vectors", str(tmp_path / "loops.c")]) == 0
    shown = capsys.readouterr().out
    assert re.search(rf"^ +8  roots +y\[i\] = shade\(x\[i\]\); +{goal.bytes}$", shown, re.MULTILINE)
    assert re.search(r"^ +18  decay .* -$", shown, re.MULTILINE)
    assert re.search(rf"^line 18, {goal.kind}: \S", shown, re.MULTILINE)
    assert re.search(r"^runs here: \S+", shown, re.MULTILINE)
    assert re.search(rf"^not compiled: {goal.kind} for aarch64: .*no-such-processor", shown, re.MULTILINE)
    assert main(["doctor", "--vectors", str(tmp_path / "loops.c"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [loop["verdicts"][0]["bytes"] for loop in data["loops"]] == [goal.bytes, goal.bytes, 0]
    assert data["not_compiled"][0]["processor"] == "aarch64"


def test_a_kernel_that_is_not_there_is_an_error_of_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--vectors", "nowhere/kernel.c"]) == 2
    assert "there is no file nowhere/kernel.c" in capsys.readouterr().err


def test_the_vectors_of_a_level_are_those_of_its_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vectors, "goals", lambda: ())
    kernel, sources = vectors._sources("single")
    assert kernel == "centred_sphere_single"
    assert {loop.function for loop in vectors.survey(kernel, sources).loops} >= {
        "draw_rows",
        "finish",
        f"{kernel}_points",
    }
