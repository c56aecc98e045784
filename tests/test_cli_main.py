"""Laws of the command line as a whole: exit codes, one line an error, no traceback, quiet ends."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import ROOT, Shell, in_a_process

from symrender_cg import Scene, errors
from symrender_cg.cli import doctor, main, render
from symrender_cg.cli.console import Column, Table, counted, duration, listed, size
from symrender_cg.version import VERSION

COMMANDS = ("build", "render", "explain", "check", "doctor")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_examples(shell: Shell, command: str) -> None:
    answer = shell(command, "--help")
    assert answer.code == 0
    assert f"python -m symrender_cg {command}" in answer.out
    assert "examples:" in answer.out
    assert max(map(len, answer.out.splitlines())) <= 120


def test_help_lists_the_commands_and_the_exit_codes(shell: Shell) -> None:
    answer = shell("--help")
    assert answer.code == 0
    assert all(f"\n    {command} " in answer.out for command in COMMANDS)
    assert "4 a stated bound broken" in answer.out
    assert shell("--version").out == f"symrender_cg {VERSION}\n"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((), "the following arguments are required: COMMAND"),
        (("paint",), "invalid choice: 'paint'"),
        (("render", "--size", "12"), "'12' is not a size; expected WIDTHxHEIGHT in pixels, each from 1 to 16777216"),
        (("render", "--size", "0x5"), "'0x5' is not a size"),
        (("render", "--size", "5x-5"), "'5x-5' is not a size"),
        (("render", "--size", "99999999x1"), "'99999999x1' is not a size"),
        (("render", "--accuracy", "exact"), "invalid choice: 'exact'"),
        (("render", "--bits", "12"), "invalid choice: 12"),
        (("render", "--threads", "two"), "invalid int value: 'two'"),
        (("build", "--accuracy", "double,exact"), "'exact' is not known; expected some of"),
        (("check", "--points", "-1"), "expected a whole number from 0 up"),
        (("explain", "--latex", "--json"), "not allowed with argument"),
        (("explain", "--findings", "shadow", "--ablate"), "not allowed with argument"),
        (("explain", "--max-error", "-1"), "'-1' is not a tolerance; expected a number >= 0"),
        (("explain", "--max-error", "nan"), "'nan' is not a tolerance"),
        (("render", "--layers", "depth,colour"), "'colour' is not known; expected some of depth, normal"),
        (("doctor", "--clear"), "unrecognized arguments: --clear"),
    ],
)
def test_usage_errors_exit_with_2_and_say_where_help_is(shell: Shell, words: tuple[str, ...], text: str) -> None:
    answer = shell(*words)
    assert answer.code == 2
    assert answer.err.startswith("symrender_cg: error: ")
    assert text in answer.err
    assert "usage: symrender_cg" in answer.err
    assert "--help" in answer.err
    assert answer.out == ""


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (errors.SymrenderError("odd"), 1),
        (errors.SceneError("spheres[0].radius", "0.0"), 2),
        (errors.ArgumentError("width: 0"), 2),
        (errors.OutsidePlanError("two spheres"), 3),
        (errors.AccuracyError("bound"), 4),
        (errors.ToolchainError("tools"), 5),
        (errors.CompilerNotFoundError("no compiler"), 5),
        (errors.CompileError(("cc", "a.c"), 1, "a.c:1: error"), 5),
        (errors.LibraryError("library"), 5),
    ],
)
def test_each_error_is_one_message_with_the_exit_code_of_its_class(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, error: errors.SymrenderError, code: int
) -> None:
    def fails(_: object) -> int:
        raise error

    monkeypatch.setattr(doctor, "run", fails)
    answer = shell("doctor")
    assert answer.code == code == error.exit_code
    assert answer.err == f"symrender_cg: error: {error}\n"


@pytest.mark.parametrize("words", [("--debug", "render", "nowhere"), ("render", "nowhere", "--debug")])
def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str], words: tuple[str, ...]) -> None:
    assert main.main([*words, "-o", "x.png"]) == 2
    said = capsys.readouterr().err
    assert "Traceback (most recent call last)" in said
    assert said.endswith(f"{Scene.builtin_names()[-1]}\n")


def test_debug_by_environment_logs_what_the_pipeline_does(tmp_path: Path) -> None:
    words = ("render", "-o", tmp_path / "a.npy", "--size", "8x8")
    assert "kernel centred_sphere_double" not in in_a_process(*words).err
    answer = in_a_process(*words, env={"SYMRENDER_DEBUG": "1"})
    assert answer.code == 0
    assert "symrender_cg: DEBUG: kernel centred_sphere_double recalled from" in answer.err


def test_an_unforeseen_error_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: object) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr(doctor, "run", broken)
    with pytest.raises(ZeroDivisionError):
        main.main(["doctor"])


def test_an_interrupt_exits_with_130_and_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(render, "run", interrupted)
    answer = shell("render")
    assert answer.code == 130
    assert answer.err == "symrender_cg: interrupted\n"


@pytest.mark.parametrize(
    ("words", "code"),
    [(["explain"], 141), (["render", "--list"], 141), (["--help"], 0)],  # argparse itself forgives a closed pipe
)
def test_a_reader_that_goes_away_ends_the_command_quietly(words: list[str], code: int) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "symrender_cg", *words]
    with os.fdopen(writing, "wb") as pipe:
        done = subprocess.run(command, stdout=pipe, stderr=subprocess.PIPE, env=environment, timeout=120, check=False)
    assert done.returncode == code
    assert done.stderr == b""


def test_scene_errors_name_the_place_and_exit_with_2(shell: Shell, tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("[[spheres]]\nradius = -1.0\n")
    for command in ("build", "explain", "check"):
        answer = shell(command, bad)
        assert answer.code == 2
        assert answer.err.startswith("symrender_cg: error: spheres[0].radius: -1.0 is not")
    answer = shell("explain", "chapter2")
    assert answer.code == 2
    assert "did you mean 'chapter1'?" in answer.err
    answer = shell("explain", tmp_path / "missing.toml")
    assert answer.code == 2
    assert "missing.toml" in answer.err


def test_scenes_that_no_plan_covers_exit_with_3(shell: Shell, tmp_path: Path) -> None:
    far = tmp_path / "far.toml"
    far.write_text("[camera]\neye = [0.0, 0.0, 1e200]\n[[spheres]]\n[[spheres]]\ncenter = [3.0, 0.0, 0.0]\n")
    for words in (("build", far), ("render", far, "-o", tmp_path / "a.png"), ("explain", far), ("check", far)):
        answer = shell(*words)
        assert answer.code == 3
        assert "spheres[0].radius: 1.0" in answer.err
    assert [path.name for path in tmp_path.iterdir()] == ["far.toml"]


@pytest.mark.parametrize("command", ["build", "render", "explain", "check"])
def test_the_formula_of_one_sphere_is_refused_for_scenes_with_exit_code_3(
    shell: Shell, tmp_path: Path, command: str
) -> None:
    place = {"build": ("--out", tmp_path), "render": ("-o", tmp_path / "a.png")}.get(command, ())
    answer = shell(command, "two_spheres", "--accuracy", "literal", *place)
    assert answer.code == 3
    assert "'literal' is the formula of one sphere under one light" in answer.err
    assert "use 'double' or 'single'" in answer.err
    assert not list(tmp_path.iterdir())


def test_the_module_runs_as_a_program() -> None:
    answer = in_a_process("render", "--size", "no")
    assert answer.code == 2
    assert answer.err.startswith("symrender_cg: error: ")
    assert "Traceback" not in answer.err


def test_warnings_are_shown_without_the_line_that_raised_them(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    del recwarn

    def warns(_: object) -> int:
        import warnings

        warnings.simplefilter("always")
        warnings.warn("the cache is read-only", UserWarning, stacklevel=1)
        return 0

    monkeypatch.setattr(doctor, "run", warns)
    assert shell("doctor").err == "symrender_cg: warning: the cache is read-only\n"


def test_tables_are_plain_text_where_no_terminal_is(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table((Column("what"), Column("count", right=True)))
    table.add("a", "1")
    table.section()
    table.section()
    table.add("longer", "100")
    table.add("x")
    table.show()
    assert capsys.readouterr().out == "what    count\na           1\n\nlonger    100\nx\n"


def test_tables_on_a_terminal_hold_the_same_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stdout", screen)
    monkeypatch.setenv("COLUMNS", "100")
    table = Table((Column("what"), Column("count", right=True)))
    table.add("[bold]a[/bold]", "1")
    table.section()
    table.add("b", "100")
    table.show()
    shown = screen.getvalue()
    assert all(cell in shown for cell in ("what", "count", "[bold]a[/bold]", "100"))


def test_numbers_are_printed_in_the_unit_that_fits() -> None:
    assert [duration(s) for s in (2.5, 0.0376, 1.25e-4, 4.2e-7, 3e-9, 123.4)] == [
        "2.5 s",
        "37.6 ms",
        "125 us",
        "420 ns",
        "3 ns",
        "123 s",
    ]
    assert [size(n) for n in (0, 1, 812, 1400, 1_400_000, 3 * 10**9)] == [
        "0 bytes",
        "1 byte",
        "812 bytes",
        "1.4 kB",
        "1.4 MB",
        "3.0 GB",
    ]
    assert [counted(n, "kernel") for n in (0, 1, 2)] == ["0 kernels", "1 kernel", "2 kernels"]
    assert [listed(words) for words in ((), ("a",), ("a", "b"), ("a", "b", "c"))] == [
        "none",
        "a",
        "a and b",
        "a, b and c",
    ]


def test_accuracies_that_a_scene_cannot_have_are_left_out_of_all_and_refused_by_name(
    shell: Shell, tmp_path: Path
) -> None:
    far = tmp_path / "far.toml"
    far.write_text("[camera]\neye = [0.0, 0.0, 1e25]\n[[lights]]\nposition = [5.0, 5.0, 10.0]\n")
    for command in (("check", far, "--size", "8x8", "--points", "9"), ("build", far, "--out", tmp_path / "c")):
        answer = shell(*command)
        assert answer.code == 0
        for name in ("fast", "single"):
            assert f"symrender_cg: {name} is left out: spheres[0].radius: 1.0 is 1e+25 times smaller" in answer.err
        assert answer.err.count("is left out") == 2
        assert "double" in answer.out
        assert shell(*command, "--accuracy", "single").code == 3
    assert shell("render", far, "-o", tmp_path / "a.npy", "--accuracy", "single").code == 3
