"""`stress` on the command line: the table, JSON, what is broken, a scene's own points, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import Shell, in_a_process

from symrender_cg.stress import measure
from symrender_cg.stress.kept import read_kept
from symrender_cg.stress.promises import PROMISES

FEW = ("--count", "6", "--level", "double", "--level", "literal")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


def spoiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adds 1e-12 to every value of every level."""
    honest = measure.evaluate_at

    def evaluate_at(*arguments: Any) -> Any:
        values = honest(*arguments)
        values[values < 6.0] += 1e-12
        return values

    monkeypatch.setattr(measure, "evaluate_at", evaluate_at)


def test_the_table_has_a_row_for_each_family_and_level_and_says_what_is_stated(shell: Shell) -> None:
    answer = shell("stress", *FEW, "--family", "generic", "--family", "sil_exact", "--family", "eye_in")
    assert answer.code == 0, answer.err
    lines = answer.out.splitlines()
    assert (
        " ".join(lines[0].split()) == "family level cases refused ulp error hit flips zero flips nan, inf wrong inputs"
    )
    rows = [line.split() for line in lines if line.split()[:1] in (["generic"], ["sil_exact"], ["eye_in"])]
    assert [row[:4] for row in rows] == [
        ["generic", "literal", "6", "0"],
        ["sil_exact", "literal", "6", "0"],
        ["eye_in", "literal", "6", "6"],
    ]
    assert sum(line.split()[:2] == ["double", "6"] for line in lines) == 3
    assert f"  {'double':<19}{PROMISES['double'].words}" in lines
    assert lines[-1] == "double: kept"


def test_json_holds_the_rows_of_the_table_and_what_is_stated(shell: Shell) -> None:
    answer = shell("stress", *FEW, "--family", "scale", "--seed", "3", "--json")
    assert answer.code == 0
    data = json.loads(answer.out)
    assert (data["seed"], data["holds"], data["undecided"]) == (3, True, 0)
    assert data["stated"] == {level: PROMISES[level].words for level in ("literal", "double")}
    assert [(row["family"], row["level"], row["cases"]) for row in data["rows"]] == [
        ("scale", "literal", 6),
        ("scale", "double", 6),
    ]
    literal, double = data["rows"]
    assert literal["max_abs"] > 1e-3 > double["max_abs"]
    assert double["worst"]["case"].startswith("scale #")
    assert double["broken"] == 0
    assert double["inputs_move"] < 1e-13
    assert double["inputs_flip"] is False
    assert double["first_broken"] is None


def test_a_level_that_breaks_what_it_states_ends_with_4_and_is_named_with_its_case(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    spoiled(monkeypatch)
    answer = shell("stress", *FEW, "--family", "generic")
    assert answer.code == 4
    assert "BROKEN" in next(line for line in answer.out.splitlines() if line.split()[:2] == ["double", "6"])
    assert "BROKEN: double, generic #" in answer.out
    assert "error 1.00e-12, stated 1e-15" in answer.out
    assert "double: kept" not in answer.out
    assert "error: double on generic: 6 of 6 cases break what is stated" in answer.err
    answer = shell("stress", *FEW, "--family", "generic", "--json")
    assert answer.code == 4
    assert json.loads(answer.out)["holds"] is False


def test_the_seed_s_formula_states_nothing_and_breaks_nothing(shell: Shell) -> None:
    answer = shell("stress", "--count", "30", "--level", "literal", "--family", "sil_search")
    assert answer.code == 0
    assert "BROKEN" not in answer.out
    assert "kept" not in answer.out
    flips = answer.out.splitlines()[1].split()[6]
    assert int(flips) > 5


def test_a_scene_is_measured_on_its_own_hard_points(shell: Shell) -> None:
    answer = shell("stress", "two_spheres", "--count", "10", "--level", "double")
    assert answer.code == 0, answer.err
    for name in ("image", "outlines", "highlights", "edges: outlines"):
        assert any(line.startswith(name) for line in answer.out.splitlines())
    assert answer.out.rstrip().endswith("double: kept")


def test_a_scene_that_literal_cannot_draw_is_refused_if_it_is_asked_for_and_left_out_if_not(shell: Shell) -> None:
    answer = shell("stress", "two_spheres", "--count", "4", "--level", "literal")
    assert answer.code == 3
    assert "formula of one sphere" in answer.err


def test_worst_points_are_kept_in_a_file(shell: Shell, tmp_path: Path) -> None:
    file = tmp_path / "worst.json"
    answer = shell("stress", *FEW, "--family", "generic", "--keep", file)
    assert answer.code == 0
    assert f"2 points added to {file}" in answer.out
    assert [(point.family, point.level) for point in read_kept(file)] == [("generic", "double"), ("generic", "literal")]
    answer = shell("stress", *FEW, "--family", "generic", "--keep", file)
    assert f"0 points added to {file}" in answer.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--family", "terminater"), "did you mean 'terminator'?"),
        (("--level", "triple"), "level: 'triple' is not known"),
        (("--count", "0"), "expected a whole number from 1 up"),
        (("--count", "-3"), "expected a whole number from"),
        (("two_spheres", "--family", "generic"), "families have scenes of their own"),
        (("no_such_scene",), "neither a scene file nor a built-in scene"),
    ],
)
def test_what_cannot_be_measured_is_refused_with_2(shell: Shell, words: tuple[str, ...], said: str) -> None:
    answer = shell("stress", *words)
    assert answer.code == 2
    assert said in answer.err


def test_a_run_in_a_process_of_its_own_warns_of_nothing(tmp_path: Path) -> None:
    answer = in_a_process("stress", *FEW, "--family", "denormal", "--family", "n_huge", folder=tmp_path)
    assert answer.code == 0, answer.err
    assert answer.err == ""
    assert list(tmp_path.iterdir()) == []
