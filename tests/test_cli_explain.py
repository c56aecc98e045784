"""Laws of `explain`: what it prints is the derivation's own, in three forms that agree."""

from __future__ import annotations

import json
import math
import re
from fractions import Fraction

import pytest
from command_line import Shell
from evaluators import PROVED

from symrender_cg import Scene, pipeline
from symrender_cg.cli.latex import escaped
from symrender_cg.derive.proofs import prove_invariants
from symrender_cg.errors import CompilerNotFoundError
from symrender_cg.explain import FORMATS, explain, proof_of, stages, swollen_operations
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import pixel_size, settling_kernel
from symrender_cg.run.levels import hands_over
from symrender_cg.run.numbers import numbers_of

SCENES = ("chapter1", "off_axis", "grazing_light")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.mark.parametrize("scene", SCENES)
def test_text_names_every_decision_definition_proof_and_pass(shell: Shell, scene: str) -> None:
    answer = shell("explain", scene)
    assert answer.code == 0
    translation = pipeline.translate(Scene.builtin(scene), "double")
    for decision in translation.plan.decisions:
        effect, margin = decision.effect, "" if decision.margin is None else f"{decision.margin:.3g} +"
        word = "in " if decision.needed else "out"
        row = rf"{word}  {effect.name} +{effect.title} +{margin}{re.escape(decision.reason)}"
        assert re.search(f"^{row}", answer.out, re.M)
    for definition in translation.image.definitions:
        assert re.search(rf"^    {definition.name} += {re.escape(str(definition.value))}$", answer.out, re.M)
        assert definition.meaning in answer.out
        assert definition.source in answer.out
    for invariant in prove_invariants(translation.image):
        assert f"  proved  {invariant.name}: {invariant.statement}\n" in answer.out
    for stage in translation.passes:
        assert re.search(rf"^  {stage.name} .* {sum(stage.operations.values())}$", answer.out, re.M)
    assert "NOT PROVED" not in answer.out


def test_the_silhouette_of_chapter_1_is_the_seed_s_circle(shell: Shell) -> None:
    answer = shell("explain")
    assert "x^2 + y^2 = e^2 R^2 / (e^2 - R^2) = rho^2, rho = 1.0327955589886446\n" in answer.out
    assert "here: -15 x^2 - 15 y^2 + 16 = 0: circle" in answer.out


@pytest.mark.parametrize("eye", [1.0009765625, 4.0, 1e4, 1e9])
def test_rho_is_correctly_rounded(eye: float) -> None:
    rho = explain(Scene.chapter1(eye=eye), "literal").silhouette.rho
    assert rho is not None
    square = Fraction(eye) ** 2 / (Fraction(eye) ** 2 - 1)
    below, above = ((Fraction(rho) + Fraction(math.nextafter(rho, to))) / 2 for to in (0.0, math.inf))
    assert below**2 <= square <= above**2


@pytest.mark.parametrize(
    ("center", "kind"),
    [((0.5, 0.25, 0.0), "ellipse"), ((0.5, 0.0, 3.0), "parabola"), ((0.5, 0.0, 3.5), "hyperbola")],
)
def test_the_silhouette_is_the_exact_conic_of_the_scene(center: tuple[float, float, float], kind: str) -> None:
    from symrender_cg import Camera, Sphere

    scene = Scene(Camera(half_height=4.0), (Sphere((center[0], 2.0, center[2]) if kind != "ellipse" else center),))
    found = explain(scene, "double").silhouette
    assert found.kind == kind
    assert found.rho is None
    a, b, c, d, e, f = map(Fraction, found.coefficients)
    x, y = Fraction(3, 7), Fraction(-5, 3)
    cx, cy, cz = (Fraction(v) for v in scene.spheres[0].center)
    m, ray = (cx, cy, cz - 4), (x, y, Fraction(-4))
    m_dot_d = sum(p * q for p, q in zip(m, ray, strict=True))
    disc = m_dot_d**2 - sum(q * q for q in ray) * (sum(p * p for p in m) - 1)
    assert a * x * x + b * x * y + c * y * y + d * x + e * y + f == disc


def test_json_holds_what_the_text_holds(shell: Shell) -> None:
    data = json.loads(shell("explain", "off_axis", "--accuracy", "single", "--json").out)
    translation = pipeline.translate(Scene.builtin("off_axis"), "single")
    assert data["kernel"] == translation.emitted.name
    assert [q["name"] for q in data["textbook"]] == [d.name for d in translation.image.definitions]
    assert data["operations"] == translation.emitted.operations
    assert [p["name"] for p in data["passes"]] == [p.name for p in translation.passes]
    assert all(entry["holds"] for entry in data["invariants"])
    assert data["silhouette"]["kind"] == "ellipse"
    assert {entry["status"] for entry in data["plan"]} == {"needed", "absent"}
    assert [step["name"] for step in data["stages"]] == ["plan", "derive", "lower", "emit"]
    first = translation.passes[0].program
    chosen = {q["name"] for q in data["chosen"]}
    assert chosen <= {step.name for step in first.steps}
    assert {"alpha", "facing2", "sin2"} <= chosen


@pytest.mark.parametrize(
    ("scene", "accuracy"), [("chapter1", "literal"), ("off_axis", "single"), ("grazing_light", "double")]
)
def test_latex_is_a_whole_document_with_matched_braces_and_environments(
    shell: Shell, scene: str, accuracy: str
) -> None:
    text = shell("explain", scene, "--accuracy", accuracy, "--latex").out
    assert text.startswith("\\documentclass{article}\n")
    assert text.endswith("\\end{document}\n")
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", text):
        depth += 1 if brace == "{" else -1
        assert depth >= 0
    assert depth == 0
    assert sorted(re.findall(r"\\begin\{(\w+)\}", text)) == sorted(re.findall(r"\\end\{(\w+)\}", text))
    assert text.count("\\[") == text.count("\\]") - text.count("\\\\]")
    words = re.sub(r"\\\[.*?\\\]|\$.*?\$", "", text)
    assert not re.search(r"(?<!\\)[_^#%]", words)
    for definition in pipeline.translate(Scene.builtin(scene), accuracy).image.definitions:
        assert escaped(definition.meaning) in text


def test_every_formula_of_the_latex_can_be_set(shell: Shell) -> None:
    mathtext = pytest.importorskip("matplotlib.mathtext")
    text = shell("explain", "off_axis", "--latex").out
    formulas = re.findall(r"\\\[ (.*?) \\\]", text)
    assert len(formulas) > 60
    parser = mathtext.MathTextParser("path")
    for formula in formulas:
        if "cases" not in formula:  # mathtext is one line, TeX is not
            known = re.sub(r"\\lVert|\\rVert", "|", formula).replace(r"\middle|", "|")
            parser.parse(f"${known}$")


def test_letters_with_a_meaning_to_tex_are_set_as_themselves() -> None:
    assert escaped("a_b^2 & 50% {x} |n| < #1 ~ \\") == (
        r"a\_b\^{}2 \& 50\% \{x\} \textbar{}n\textbar{} \textless{} \#1 \~{} \textbackslash{}"
    )


def test_operations_of_the_swollen_formulas_are_those_of_the_closed_forms() -> None:
    import sympy as sp

    image = pipeline.translate(Scene.chapter1(), "double").image
    counts = swollen_operations(image)
    for name in ("t", "n_dot_l", "r_dot_v", "value"):
        assert counts[name] == int(sp.count_ops(image.closed(name)))
    assert counts["image"] == int(sp.count_ops(image.as_piecewise()))


# --------------------------------------------------------------------------------------- formats, and levels that prove


@pytest.mark.parametrize("accuracy", ["literal", "fast", "double", "stable", "certified"])
def test_every_quantity_of_the_kernel_is_listed_under_its_number_format(shell: Shell, accuracy: str) -> None:
    answer = shell("explain", "--accuracy", accuracy)
    assert answer.code == 0
    steps = pipeline.translate(Scene.chapter1(), accuracy).program.steps
    for form in {step.format for step in steps}:
        names = [step.name for step in steps if step.format == form]
        row = rf"^{re.escape(FORMATS[form])} +{len(names)}  {', '.join(names)}$"
        assert re.search(row, answer.out, re.M)
    data = json.loads(shell("explain", "--accuracy", accuracy, "--json").out)
    assert {name: form for form, names in data["formats"].items() for name in names} == {
        step.name: step.format for step in steps
    }


@pytest.mark.parametrize(("accuracy", "target"), PROVED)
def test_the_bound_of_a_proof_is_that_of_the_kernel_for_the_size(
    shell: Shell, accuracy: str, target: str | None
) -> None:
    words = ("explain", "--accuracy", accuracy, *(() if target is None else ("--target", target)), "--size", "320x200")
    data = json.loads(shell(*words, "--json").out)
    chosen = variant(accuracy, target)
    found = settling_kernel(Scene.chapter1(), chosen, aspect=1.6)
    assert found is not None
    kernel, frame = found
    bound = kernel.bound(kernel.numbers(numbers_of(frame)), width=320, height=200, pixel=pixel_size(frame, 200))
    proof = data["proof"]
    assert [stage["name"] for stage in proof["stages"]] == ["kernel", "enclosure", "oracle"]
    assert proof["stages"][0]["bound"] == bound
    assert 0.0 < bound < {"float32": 1e-12, "uint8": 1e-12}.get(target or "", 1e-19)
    assert (proof["width"], proof["height"], proof["handed_over"]) == (320, 200, False)
    assert proof["stages"][0]["kernel"] == data["kernel"] == kernel.name
    text = shell(*words).out
    assert f"proved of every value: {proof['claim']}; " in text
    assert f"{bound:.2e}" in text
    assert "any pixel of 320 x 200 can be off" in text


def test_double_says_where_it_hands_over_and_else_has_no_proof(shell: Shell) -> None:
    handed = json.loads(shell("explain", "grazing_light", "--json").out)
    assert hands_over(Scene.builtin("grazing_light"))
    assert handed["proof"]["handed_over"] is True
    assert handed["proof"]["stages"][0]["kernel"] == "centred_sphere_gated_stable"
    assert "the compensated kernel draws in its place" in shell("explain", "grazing_light").out
    assert json.loads(shell("explain", "--json").out)["proof"] is None
    assert "how every value is proved" not in shell("explain").out


def test_without_a_compiler_a_proof_has_its_stages_and_no_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object, **__: object) -> None:
        raise CompilerNotFoundError("no C compiler found")

    monkeypatch.setattr(stages, "settling_kernel", none)
    proof = proof_of(Scene.chapter1(), "stable", None, width=8, height=8)
    assert proof is not None
    assert [stage.bound for stage in proof.stages] == [None, None, None]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ("--max-error", "0.1"),
            "max_error: 0.1 would leave out what changes the image, and 'stable' proves",
        ),
        (("--ablate",), "--ablate: what an effect costs is measured where one kernel draws alone, and accuracy stable"),
        (("--target", "uint8"), "target: 'uint8' is for accuracy='certified', not for 'stable'"),
    ],
)
def test_what_a_proof_excludes_is_refused(shell: Shell, words: tuple[str, ...], text: str) -> None:
    answer = shell("explain", "--accuracy", "stable", *words)
    assert answer.code == 2
    assert text in answer.err


def test_a_level_that_proves_its_values_is_set_in_latex_too(shell: Shell) -> None:
    for scene in ("chapter1", "two_spheres"):
        text = shell("explain", scene, "--accuracy", "certified", "--target", "float32", "--latex").out
        assert "Accuracy ``certified\\_float32''" in text
        assert text.endswith("\\end{document}\n")
