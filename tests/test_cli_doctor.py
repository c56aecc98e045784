"""Laws of `doctor`: it says what is there, what is missing and how to get it, and exits with 5 without a compiler."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import Shell

from symrender_cg import Scene, render_image
from symrender_cg.build.cache import Cache
from symrender_cg.build.reports import function_at
from symrender_cg.cli import doctor
from symrender_cg.plan.plan import plan


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


def test_a_machine_with_a_compiler_is_usable_and_fully_described(shell: Shell) -> None:
    answer = shell("doctor")
    assert answer.code == 0
    toolchain = Cache().toolchain()
    for text in (toolchain.path, toolchain.version, " ".join(toolchain.native.flags), toolchain.native.cpu):
        assert text in answer.out
    for word in ("python", "compiler", "flags", "target", "trial", "cache", "packages", "sympy", "python-flint"):
        assert word in answer.out
    assert str(Cache().root) in answer.out


def test_the_shading_loops_of_each_kernel_are_reported_with_their_vector_width(shell: Shell) -> None:
    data = json.loads(shell("doctor", "--json").out)
    assert data["usable"] is True
    kernels = {loop["kernel"] for loop in data["loops"]}
    spheres = {f"centred_sphere_{level}" for level in ("literal", "fast", "single", "double")}
    settling = {f"centred_sphere_{level}" for level in ("stable", "certified_uint8")}
    (scene,) = kernels - spheres - settling
    assert scene == f"{plan(Scene.builtin(doctor.LOOPING_SCENE)).name}_double"
    shading = {loop["function"].removeprefix(f"{scene}_") for loop in data["loops"] if loop["kernel"] == scene}
    assert {"shade_matte", "shade_glossy", "cast_shadows"} <= shading
    for kernel in spheres:
        functions = {loop["function"]: loop["bytes"] for loop in data["loops"] if loop["kernel"] == kernel}
        rows = f"{kernel}_rows" if kernel.endswith("literal") else "draw_rows"
        assert {rows, f"{kernel}_points"} <= set(functions)
        assert all(16 <= width <= 64 for width in functions.values())
    for kernel in settling:
        functions = {loop["function"]: loop["bytes"] for loop in data["loops"] if loop["kernel"] == kernel}
        assert {"settle", "shade_block"} <= set(functions)
        assert all(16 <= width <= 64 for width in functions.values())
    assert all(data["packages"].values())
    assert data["toolchain"]["kind"] in ("gcc", "clang", "zig")


def test_a_line_is_put_into_the_function_that_it_stands_in() -> None:
    lines = [
        "static int f(int a)",
        "{",
        "    for (;;)",
        "}",
        "",
        "void g_rows(double *x,",
        "    int n)",
        "{",
        "    for",
    ]
    assert function_at(lines, 3) == "f"
    assert function_at(lines, 9) == "g_rows"


def test_without_a_compiler_the_exit_code_is_5_and_the_remedies_are_listed(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("SYMRENDER_CACHE_DIR", str(tmp_path / "cache"))
    answer = shell("doctor")
    if answer.code == 0:
        pytest.skip("the ziglang wheel is installed, a compiler without PATH")
    assert answer.code == 5
    assert "problem: no C compiler found" in answer.out
    assert "    1. install a compiler" in answer.out
    assert "    3. render_image(" in answer.out
    data = json.loads(shell("doctor", "--json").out)
    assert data["usable"] is False
    assert data["toolchain"] is None
    assert data["problems"][0]["remedies"]


def test_a_compiler_that_does_not_compile_is_not_usable(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "/bin/false")
    monkeypatch.setenv("SYMRENDER_CACHE_DIR", str(tmp_path))
    answer = shell("doctor")
    assert answer.code == 5
    assert "problem: CC (/bin/false) is no working C compiler" in answer.out


def test_a_missing_package_is_named_with_the_command_that_gets_it(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = doctor._installed
    monkeypatch.setattr(doctor, "_installed", lambda name: None if name == "python-flint" else honest(name))
    answer = shell("doctor")
    assert answer.code == 0
    assert "python-flint MISSING" in answer.out
    assert "problem: the Python package python-flint is missing, needed for the oracle of check" in answer.out
    assert "    1. pip install python-flint" in answer.out


def test_clear_cache_removes_every_kernel_and_says_so(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SYMRENDER_CACHE_DIR", str(tmp_path))
    render_image(Scene.chapter1(), 8, 8, accuracy="literal", cache=tmp_path)
    assert Cache().size().kernels == 1
    answer = shell("doctor", "--clear-cache")
    assert answer.code == 0
    assert answer.out.startswith("removed 1 kernel, 2 recipes, ")
    assert answer.out.endswith(f" from {tmp_path}\n")
    assert Cache().size().bytes == 0
    assert json.loads(shell("doctor", "--clear-cache", "--json").out)["removed"] == {
        "kernels": 0,
        "recipes": 0,
        "bytes": 0,
    }
