"""Laws of `cost` on the command line, of --max-error and its kin, and of the files that they write."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import numpy as np
import pytest
from command_line import Shell

from symrender_cg import Scene, choose, render_image
from symrender_cg.cli import cost as command
from symrender_cg.cost import html as page
from symrender_cg.cost import search as searching
from symrender_cg.cost.report import Report
from symrender_cg.cost.variants import Way
from symrender_cg.errors import ArgumentError

QUICK = ("--quick", "--size", "24x16", "--rounds", "2")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


def test_the_table_marks_the_front_and_names_what_dominates_the_rest(shell: Shell) -> None:
    answer = shell("cost", *QUICK)
    assert answer.code == 0
    words = [line.split("  ") for line in answer.out.partition("\nns: ")[0].splitlines()]
    ends = {row[0]: row[-1].strip() for row in words}
    assert "front" in (ends["stable"], ends["certified float64"])
    assert all(ends[name].startswith("dominated by ") for name in ("lambdify", "numpy literal"))
    for words in ("along the front", "times the time, error", "break-even", "against the oracle", "measured in"):
        assert words in answer.out
    assert re.search(r"20 ways to draw it, 0 of 0 found by search; seed 1", answer.out)


def test_what_was_measured_is_shown_again_unless_it_is_asked_for_anew(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = shell("cost", *QUICK)
    monkeypatch.setattr(command, "measure", lambda *_, **__: pytest.fail("measured again"))
    assert shell("cost", *QUICK).out == first.out
    with pytest.raises(pytest.fail.Exception, match="measured again"):
        shell("cost", *QUICK, "--again")
    with pytest.raises(pytest.fail.Exception, match="measured again"):
        shell("cost", *QUICK, "--seed", "2")


def test_json_is_the_whole_report(shell: Shell) -> None:
    answer = shell("cost", *QUICK, "--json", "--effects")
    report = msgspec.json.decode(answer.out, type=Report)
    assert (report.width, report.height, report.rounds, report.quick) == (24, 16, 2, True)
    assert report.machine.cores >= 1
    assert report.machine.compiler
    assert {row.general for row in report.break_even} >= {"double", "double +scene", "double +off_axis"}
    assert [effect.effect for effect in report.effects][1:] == ["diffuse", "specular"]
    assert json.loads(answer.out)["scene"] == "chapter1"


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_chart_is_written_and_the_same_report_gives_the_same_bytes(
    shell: Shell, tmp_path: Path, suffix: str
) -> None:
    places = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for place in places:
        assert shell("cost", *QUICK, "--plot", place).code == 0
    assert places[0].read_bytes() == places[1].read_bytes()
    if suffix == ".svg":
        text = " ".join(ElementTree.parse(places[0]).getroot().itertext())
        for level in ("fast", "single", "literal", "double", "stable", "certified float64", "numpy", "lambdify"):
            assert level in text
        assert "nanoseconds a pixel" in text
    else:
        assert places[0].read_bytes().startswith(b"\x89PNG")


class _Reader(HTMLParser):
    """Sources of a page, and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.images = 0
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "src" and value is not None and value.startswith("data:image/png;base64,"):
                self.images += 1
            elif (name == "src" or (name == "href" and tag in ("link", "a"))) and not (value or "").startswith("#"):
                self.outside.append(value or "")

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_html_file_needs_nothing_else_and_shows_every_way(shell: Shell, tmp_path: Path) -> None:
    place = tmp_path / "cost.html"
    assert shell("cost", *QUICK, "--html", place).code == 0
    reader = _Reader()
    reader.feed(place.read_text())
    assert reader.outside == []
    assert reader.images == 20
    for words in (
        "What accuracy costs in time",
        "centred_sphere_double_rows",
        "differences to",
        "points of the window",
    ):
        assert words in reader.text
    assert "--- fast" in reader.text
    assert "<script" not in place.read_text()


def test_an_error_image_is_white_where_nothing_is_wrong_and_red_where_all_is() -> None:
    shown = page.shades(np.array([0.0, 1e-17, 1e-9, 0.1, 0.2, np.inf, np.nan]))
    assert shown[0].tolist() == shown[1].tolist() == [255, 255, 255]
    assert shown[3].tolist() == [0, 0, 0]
    assert 100 < shown[2][0] < 140
    assert shown[4].tolist() == shown[5].tolist() == shown[6].tolist()
    assert shown[4][0] > shown[4][1]


def test_a_request_prints_the_choice_and_what_it_was_chosen_from(shell: Shell) -> None:
    answer = shell("cost", "--max-error", "1e-6")
    assert answer.code == 0
    assert answer.out.startswith(str(choose(max_error=1e-6)))
    assert "does not meet it" in answer.out
    assert "chosen" in answer.out
    data = json.loads(shell("cost", "--max-ulp", "4", "--json").out)
    assert (data["unit"], data["kind"]) == ("ulp", "proved")


def test_a_request_that_nothing_meets_has_exit_code_4_and_the_reason(shell: Shell, tmp_path: Path) -> None:
    for words in (("cost",), ("build", "--out", tmp_path), ("render", "-o", tmp_path / "a.npy")):
        answer = shell(*words, "--max-error", "1e-25")
        assert answer.code == 4
        assert "no variant has a bound of 1e-25 absolute on this scene; the nearest is" in answer.err
    assert list(tmp_path.iterdir()) == []


def test_build_writes_the_c_of_the_variant_that_meets_the_request(shell: Shell, tmp_path: Path) -> None:
    answer = shell("build", "--max-error", "1e-6", "--out", tmp_path)
    assert answer.code == 0
    found = choose(max_error=1e-6, flags=False)
    assert str(found) in answer.out
    manifest = json.loads((tmp_path / f"centred_sphere_{found.accuracy}" / "manifest.json").read_text())
    assert manifest["accuracy"] == found.accuracy
    assert manifest["command"] == f"python -m symrender_cg build chapter1 --accuracy {found.accuracy}"
    again = shell("build", "--max-error", "1e-6", "--out", tmp_path)
    assert "nothing had to be done" in again.out


def test_render_draws_with_the_variant_that_meets_the_request(shell: Shell, tmp_path: Path) -> None:
    answer = shell("render", "--max-error", "1e-3", "-o", tmp_path / "a.npy", "--size", "20x10")
    assert answer.code == 0
    assert str(choose(max_error=1e-3, aspect=2.0)) in answer.out
    assert np.array_equal(np.load(tmp_path / "a.npy"), render_image(None, 20, 10, max_error=1e-3))


def test_a_level_with_choices_is_an_accuracy_like_any_other(shell: Shell, tmp_path: Path) -> None:
    assert shell("render", "--accuracy", "double_fused", "-o", tmp_path / "a.npy", "--size", "20x10").code == 0
    assert np.array_equal(np.load(tmp_path / "a.npy"), render_image(None, 20, 10, accuracy="double_fused"))
    first = shell("build", "--accuracy", "double_fused,double", "--out", tmp_path / "c")
    assert first.code == 0
    assert "-ffp-contract=fast" in first.out
    assert {path.name for path in (tmp_path / "c").iterdir()} == {
        "centred_sphere_double",
        "centred_sphere_double_fused",
        "support",
    }
    assert "nothing had to be done" in shell("build", "--accuracy", "double_fused", "--out", tmp_path / "c").out
    assert shell("render", "--accuracy", "double_gold", "-o", tmp_path / "b.npy").code == 2
    assert shell("build", "--accuracy", "double_gold").code == 2


def test_explain_tells_the_choice_and_explains_what_was_chosen(shell: Shell) -> None:
    answer = shell("explain", "--meets", "max_error=1e-6")
    found = choose(max_error=1e-6)
    assert answer.code == 0
    assert answer.out.startswith(str(found))
    assert f"centred_sphere_{found.accuracy}" in answer.out
    data = json.loads(shell("explain", "--meets", "bits=8", "--json").out)
    assert data["choice"]["asked"] == "bits=8"
    considered = {entry["way"]: entry["meets"] for entry in data["choice"]["considered"]}
    assert considered[data["choice"]["way"]]
    possible = data["choice"]["possible"]
    assert possible > 140
    assert f"ways of {possible}: those that may be fastest" in answer.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("cost", "--plot", "chart.bmp"), "'.bmp' is not a suffix for it"),
        (("cost", "--html", "report.png"), "'.png' is not a suffix for it"),
        (("cost", "--plot", "no/such/folder/a.png"), "not a place for a file"),
        (("cost", "--max-error", "0"), "expected a number above 0"),
        (("cost", "--max-error", "1e-3", "--bits", "8"), "not allowed with argument"),
        (("explain", "--meets", "speed=3"), "expected max_error=E, max_ulp=U or bits=B"),
        (("build", "--max-error", "1e-3", "--bake"), "--bake: chooses a kernel"),
        (("render", "--max-error", "1e-3", "--target", "uint8", "-o", "a.png"), "--target: chooses a kernel"),
    ],
)
def test_what_cannot_be_done_is_refused_before_anything_is_measured(
    shell: Shell, words: tuple[str, ...], said: str
) -> None:
    answer = shell(*words)
    assert answer.code == ArgumentError.exit_code
    assert said in answer.err


def test_scenes_have_their_chart_too(shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    every = searching.named_ways

    def some(scene: Scene, size: tuple[int, int]) -> tuple[Way, ...]:
        return tuple(way for way in every(scene, size) if way.name in ("single", "double", "double unplanned"))

    monkeypatch.setattr(searching, "named_ways", some)
    answer = shell("cost", "two_spheres", *QUICK, "--plot", tmp_path / "a.svg")
    assert answer.code == 0
    assert "planned: effects left out" in answer.out
    assert "two_spheres" in (tmp_path / "a.svg").read_text()
