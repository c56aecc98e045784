"""Laws of `explain` for scenes of many spheres: plan, findings and parts are the compiler's own, in three forms."""

from __future__ import annotations

import json
import re

import pytest
from command_line import Shell

from symrender_cg import Scene, pipeline
from symrender_cg.cli.latex import escaped
from symrender_cg.explain import SceneExplanation, explain
from symrender_cg.plan.effects import EFFECTS
from symrender_cg.plan.plan import plan

SCENES = ("lights", "mirrors", "eye_plane", "hundred")
WORDS = {"needed": "in", "absent": "out", "bounded": "bounded"}


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.mark.parametrize("scene", SCENES)
def test_text_has_one_row_for_every_effect_and_every_formula_of_every_part(shell: Shell, scene: str) -> None:
    answer = shell("explain", scene)
    assert answer.code == 0
    translation = pipeline.translate(Scene.builtin(scene), "double", aspect=1.0)
    assert answer.out.startswith(f"{translation.emitted.name}: ")
    table = answer.out[: answer.out.index("what the kernel loops over")].splitlines()
    for decision in translation.plan.summary:
        effect, margin = decision.effect, "" if decision.margin is None else f"{decision.margin:.3g} +"
        row = (
            rf"{WORDS[decision.status]} +{effect.name} +{re.escape(effect.title)} +{margin}{re.escape(decision.reason)}"
        )
        left = "" if decision.needed else rf"\. Leaves out: {re.escape(effect.removes)}"
        assert sum(bool(re.fullmatch(row + left, line)) for line in table) == 1
    for name, part in translation.parts.items():
        assert re.search(rf"^{name}: \w", answer.out, re.M)
        for definition in part.definitions:
            assert re.search(rf"^    {definition.name} += {re.escape(str(definition.value))}$", answer.out, re.M)
            assert definition.meaning in answer.out
        total = sum(translation.programs[name].operations().values())
        row = next(line for line in answer.out.splitlines()[::-1] if line.startswith(f"{name} "))
        numbers = [int(word) for word in re.split(r"\s{2,}", row)[3:] if word.isdigit()]
        assert sum(numbers) == total
    arrangement = translation.plan.arrangement
    assert re.search(rf"^ +{arrangement.visible}  spheres that may own a pixel$", answer.out, re.M)
    assert re.search(rf"^ +{len(arrangement.blockers)}  spheres that may shadow one of these$", answer.out, re.M)


def test_every_part_that_a_scene_can_have_has_a_meaning() -> None:
    for name in Scene.builtin_names():
        found = explain(Scene.builtin(name), aspect=1.0)
        if isinstance(found, SceneExplanation):
            assert all(part.meaning for part in found.parts)


def test_json_holds_what_the_text_holds(shell: Shell) -> None:
    data = json.loads(shell("explain", "mirrors", "--accuracy", "single", "--size", "300x200", "--json").out)
    translation = pipeline.translate(Scene.builtin("mirrors"), "single", aspect=1.5)
    assert (data["kind"], data["kernel"], data["aspect"]) == ("scene", translation.emitted.name, 1.5)
    assert [(e["effect"], e["status"], e["reason"], e["margin"]) for e in data["plan"]] == [
        (d.effect.name, d.status, d.reason, d.margin) for d in translation.plan.summary
    ]
    assert [entry["effect"] for entry in data["plan"]] == [entry.name for entry in EFFECTS]
    assert all((entry["leaves_out"] is None) == (entry["status"] == "needed") for entry in data["plan"])
    for entry in data["parts"]:
        part = translation.parts[entry["name"]]
        assert [q["formula"] for q in entry["quantities"]] == [str(d.value) for d in part.definitions]
        assert [given["name"] for given in entry["inputs"]] == list(part.inputs)
        kernel = sum(sum(counts.values()) for counts in entry["operations"].values())
        assert kernel == entry["swell"]["kernel"] == sum(translation.programs[entry["name"]].operations().values())
    assert data["operations"] == translation.emitted.operations


@pytest.mark.parametrize("scene", ["lights", "mirrors"])
def test_latex_is_a_whole_document_with_every_formula(shell: Shell, scene: str) -> None:
    text = shell("explain", scene, "--latex").out
    assert text.startswith("\\documentclass{article}\n")
    assert text.endswith("\\end{document}\n")
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", text):
        depth += 1 if brace == "{" else -1
        assert depth >= 0
    assert depth == 0
    assert sorted(re.findall(r"\\begin\{(\w+)\}", text)) == sorted(re.findall(r"\\end\{(\w+)\}", text))
    words = re.sub(r"\\\[.*?\\\]|\$.*?\$", "", text)
    assert not re.search(r"(?<!\\)[_^#%]", words)
    translation = pipeline.translate(Scene.builtin(scene), "double", aspect=1.0)
    formulas = sum(len(part.definitions) for part in translation.parts.values())
    assert len(re.findall(r"^\\\[ ", text, re.M)) == formulas
    for part in translation.parts.values():
        assert all(escaped(definition.meaning) in text for definition in part.definitions)


@pytest.mark.parametrize("effect", [entry.name for entry in EFFECTS])
def test_findings_lists_every_subject_in_text_and_json(shell: Shell, effect: str) -> None:
    found = plan(Scene.builtin("mirrors"), aspect=1.5).findings(effect)
    words = ("explain", "mirrors", "--findings", effect, "--size", "300x200")
    data = json.loads(shell(*words, "--json").out)
    assert data["effect"] == effect
    assert [(f["subject"], f["status"], f["reason"], f["margin"]) for f in data["findings"]] == [
        (f.subject, f.status, f.reason, f.margin) for f in found
    ]
    rows = shell(*words).out.splitlines()[1:]
    assert len(rows) == len(found)
    for row, finding in zip(rows, found, strict=True):
        assert row.startswith(WORDS[finding.status])
        assert finding.subject in row
        assert row.endswith(finding.reason.rstrip())


def test_findings_are_there_for_one_sphere_too(shell: Shell) -> None:
    answer = shell("explain", "chapter1", "--findings", "front_test")
    assert answer.code == 0
    assert "spheres[0]" in answer.out


def test_an_unknown_effect_is_refused_with_the_names(shell: Shell) -> None:
    answer = shell("explain", "mirrors", "--findings", "shadows")
    assert answer.code == 2
    assert "'shadows' is no effect; expected one of off_axis, " in answer.err
    answer = shell("explain", "mirrors", "--findings", "shadow", "--latex")
    assert answer.code == 2
    assert "leave --latex out" in answer.err


def test_the_plan_is_that_of_the_shape_that_is_asked_for(shell: Shell, tmp_path: object) -> None:
    wide, tall = (
        json.loads(shell("explain", "mirrors", "--size", size, "--json").out) for size in ("400x100", "100x400")
    )
    out = [next(e["reason"] for e in data["plan"] if e["effect"] == "in_view") for data in (wide, tall)]
    assert out[0].startswith("no sphere of 5 outside")
    assert re.match(r"[1-5] of 5 spheres outside the window of aspect 0.25", out[1])


def test_a_tolerance_names_bounded_effects_with_their_bounds(shell: Shell) -> None:
    data = json.loads(shell("explain", "mirrors", "--max-error", "0.4", "--json").out)
    found = plan(Scene.builtin("mirrors"), aspect=1.0, max_error=0.4)
    assert data["max_error"] == 0.4
    assert 0.0 < data["bound"] == found.bound <= 0.4
    bounds = {e["effect"]: e["bound"] for e in data["plan"] if e["bound"] is not None}
    assert bounds == {d.effect.name: d.bound for d in found.summary if d.bound is not None}
    text = shell("explain", "mirrors", "--max-error", "0.4").out
    assert "within 0.4 of each pixel" in text
    assert f"changes no pixel by more than {found.bound:.3g}" in text
    assert "changes at most" in text
    assert any(d.status == "bounded" for d in found.summary) == bool(re.search(r"^bounded ", text, re.M))


@pytest.mark.parametrize("accuracy", ["stable", "certified"])
def test_of_a_scene_the_enclosure_is_explained_for_any_window(shell: Shell, accuracy: str) -> None:
    data = json.loads(shell("explain", "lights", "--accuracy", accuracy, "--size", "300x200", "--json").out)
    translation = pipeline.translate(Scene.builtin("lights"), accuracy)
    assert data["kernel"] == translation.emitted.name == f"{translation.plan.name}_enclosure"
    assert data["aspect"] is None
    assert {part["name"]: part["formats"].keys() <= {"ball", "float64"} for part in data["parts"]} == dict.fromkeys(
        translation.programs, True
    )
    assert [stage["name"] for stage in data["proof"]["stages"]] == ["enclosure", "oracle"]
    assert data["proof"]["stages"][0]["kernel"] == data["kernel"]
    text = shell("explain", "lights", "--accuracy", accuracy).out
    assert "near: a sphere and a ray of the eye: hit, normal, distance" in text
    assert re.search(r"^ball: a double-double and a bound of its error +\d+  ", text, re.M)
    assert re.search(r"^enclosure +all points +scene_gated_fade_shadow_rgb_enclosure ", text, re.M)


def test_formats_of_a_scene_are_those_of_its_parts(shell: Shell) -> None:
    data = json.loads(shell("explain", "mirrors", "--accuracy", "single", "--json").out)
    programs = pipeline.translate(Scene.builtin("mirrors"), "single", aspect=1.0).programs
    for part in data["parts"]:
        listed = {name: form for form, names in part["formats"].items() for name in names}
        assert listed == {step.name: step.format for step in programs[part["name"]].steps}
    assert data["proof"] is None
