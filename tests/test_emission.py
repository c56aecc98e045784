"""Laws of the emitted C: strict C99 for every structure, readable, the same bytes in every process."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import struct
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
import jinja2.nodes
import pytest
import sympy as sp
from evaluators import ACCURACIES, EXACT, STRUCTURES, modest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import meta

from symrender_cg.build import project_flags
from symrender_cg.emit import c99
from symrender_cg.emit.bodies import WIDTH, wrap
from symrender_cg.emit.c99 import Emitted
from symrender_cg.emit.printer import literal
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import Translation, translate
from symrender_cg.plan.plan import plan
from symrender_cg.resources import templates
from symrender_cg.scene import Scene
from symrender_cg.version import VERSION

ROOT = Path(__file__).resolve().parents[1]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
KERNELS = [(name, accuracy) for name in STRUCTURES for accuracy in ACCURACIES]


@cache
def translated(name: str, accuracy: str, *, bake: bool = False) -> Translation:
    return translate(STRUCTURES[name], accuracy, bake=bake)


def emitted(name: str, accuracy: str, *, bake: bool = False) -> Emitted:
    return translated(name, accuracy, bake=bake).emitted


def source(name: str, accuracy: str, *, bake: bool = False) -> str:
    files = emitted(name, accuracy, bake=bake)
    return files.files[f"{files.name}.c"]


def own_files(files: Emitted) -> dict[str, str]:
    return {name: text for name, text in files.files.items() if name.startswith(files.name)}


def code_of(text: str) -> str:
    """The text without its comments."""
    return re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL)


def checked(compiler: str, files: Emitted, folder: Path, *more: str) -> str:
    """What the compiler says about a kernel, syntax and warnings only."""
    for name, text in files.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    command = [compiler, *project_flags(), "-fsyntax-only", *more, f"{files.name}.c"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False).stderr


# ---- C99


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("bake", [False, True], ids=["arguments", "baked"])
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_every_structure_is_strict_c99_without_a_warning(
    compiler: str, bake: bool, accuracy: str, tmp_path: Path
) -> None:
    assert {"-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"} <= set(project_flags())
    for name in STRUCTURES:
        folder = tmp_path / name
        folder.mkdir()
        assert checked(compiler, emitted(name, accuracy, bake=bake), folder) == ""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_other_warnings_that_find_mistakes_are_silent_too(compiler: str, tmp_path: Path) -> None:
    """Shadowed names, implicit narrowing to float or int, missing prototypes, undefined macros."""
    flags = ("-Wshadow", "-Wfloat-conversion", "-Wmissing-prototypes", "-Wundef", "-Wstrict-prototypes", "-Wvla")
    for accuracy in ACCURACIES:
        assert checked(compiler, emitted("any_sphere", accuracy), tmp_path, *flags) == ""


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("effect", ["off_axis", "front_test", "diffuse", "specular", "specular_gate"])
def test_forced_effects_are_strict_c99_too(compiler: str, effect: str, tmp_path: Path) -> None:
    for name in ("centred_sphere", "centred_sphere_flat", "off_axis_sphere_specular"):
        for accuracy in ACCURACIES:
            folder = tmp_path / f"{name}_{accuracy}"
            folder.mkdir()
            forced = translate(STRUCTURES[name], accuracy, force=[effect]).emitted
            assert checked(compiler, forced, folder) == ""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_header_stands_alone_and_can_be_used_from_cpp(compiler: str, tmp_path: Path) -> None:
    files = emitted("centred_sphere", "double")
    for name, text in files.files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    text = f'#include "{files.name}.h"\n#include "{files.name}.h"\nint used({files.name}_scene *s);\n'
    (tmp_path / "user.c").write_text(text)
    (tmp_path / "user.cpp").write_text(text)
    for language in (["-std=c99", "user.c"], ["-x", "c++", "-std=c++11", "user.cpp"]):
        command = [compiler, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", *language]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.stderr == ""


# ---- readable


@pytest.mark.parametrize("bake", [False, True], ids=["arguments", "baked"])
def test_no_line_is_longer_than_120_columns_or_ends_in_space(bake: bool) -> None:
    for name, accuracy in KERNELS:
        for file, text in emitted(name, accuracy, bake=bake).files.items():
            for number, line in enumerate(text.split("\n"), 1):
                assert len(line) <= WIDTH, f"{file}:{number} has {len(line)} columns"
                assert line == line.rstrip(), f"{file}:{number} ends in space"
                assert "\t" not in line
            assert text.endswith("\n")
            assert not text.endswith("\n\n")


FORBIDDEN = {
    r"\bpow\(": "an exponent is a chain of products or a call of power.h",
    r"\bM_PI\b": "undefined under -std=c99",
    r"\bfmaxf?\(": "a call where one instruction would do (the header of units has its own)",
    r"\b_tmp|\btmp": "a name that says nothing",
    r"/\d+\.0\)": "a reciprocal in place of a division",
    r"\bgoto\b": "",
}


@pytest.mark.parametrize("bake", [False, True], ids=["arguments", "baked"])
@pytest.mark.parametrize("pattern", FORBIDDEN)
def test_the_c_is_free_of(pattern: str, bake: bool) -> None:
    for name, accuracy in KERNELS:
        code = code_of(source(name, accuracy, bake=bake))
        assert not re.search(pattern, code), f"{name} {accuracy}: {pattern} {FORBIDDEN[pattern]}"


@pytest.mark.parametrize("bake", [False, True], ids=["arguments", "baked"])
def test_no_state_is_kept_between_calls(bake: bool) -> None:
    """What is static is const or a function; nothing is a variable of the file."""
    for name, accuracy in KERNELS:
        for text in emitted(name, accuracy, bake=bake).files.values():
            for line in code_of(text).split("\n"):
                if re.match(r"\s*static\b", line):
                    assert re.match(r"\s*static (const|inline)\b", line) or "(" in line, line
                assert not re.match(r"(double|float|int|double_double) \w+( =.*)?;", line), line


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_every_step_is_declared_const_once_where_it_is_first_known(name: str, accuracy: str) -> None:
    program, text = translated(name, accuracy).program, code_of(source(name, accuracy))
    for step in program.steps:
        kind = {"int": "int", "float32": "float", "float64": "double", "double_double": "double_double"}[step.format]
        assert re.search(rf"\bconst {kind} {step.name} =", text), step.name
    bodies = re.findall(r"^(?!typedef).*\)\n\{\n(.*?)^\}", text, flags=re.DOTALL | re.MULTILINE)
    assert bodies
    shades = re.findall(r"^SYMRENDER_INLINE \w+ (?:shade|stage_\d+)\(.*?^\}", text, flags=re.DOTALL | re.MULTILINE)
    assert len(shades) == max(1, len(program.stages))
    for line in (line for shade in shades for line in shade.split("\n")[1:-1]):
        assert re.match(r"\s*(const|return|\*|b->\w+\[i\] = (p\.)?\w+;|\{|$)|\s{8}", line), line


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_header_comment_says_what_is_in_and_why_the_rest_is_not(accuracy: str) -> None:
    for name in STRUCTURES:
        text = source(name, accuracy)
        comment = " ".join(text[: text.index("*/")].replace("\n *", " ").split())
        found = plan(STRUCTURES[name])
        assert f"(symrender_cg {VERSION})" in comment
        assert "do not edit" in comment
        assert f"--accuracy {accuracy}" in comment
        assert variant(accuracy).promise in comment
        for decision in found.decisions:
            assert decision.effect.title in comment
        for decision in found.absent:
            assert decision.reason in comment, decision.effect.name
        assert "a pixel:" in comment


def test_sections_state_their_formulas_and_sources() -> None:
    text = source("centred_sphere", "double")
    for phrase in ("Phong 1975", "k_d max(0, n.l)", "k_s max(0, r.v)^n", "I = k_a", "x^2 + y^2 = rho^2"):
        assert phrase in text


def test_operation_counts_in_the_comment_are_those_of_the_program() -> None:
    for name, accuracy in KERNELS:
        files, text = emitted(name, accuracy), source(name, accuracy)
        line = next(line for line in text.split("\n") if "a pixel:" in line)
        said = {kind: int(number) for number, kind in re.findall(r"(\d+) (\w+)", line)}
        assert said == {kind: number for kind, number in files.operations["pixel"].items() if number}


def test_nothing_of_this_machine_or_this_day_is_in_the_text() -> None:
    traces = [platform.node(), str(ROOT), os.path.expanduser("~"), os.environ.get("USER", "") or "root@"]
    for name, accuracy in KERNELS:
        for text in emitted(name, accuracy).files.values():
            assert not any(trace in text for trace in traces if len(trace) > 4)
            assert not re.search(r"\b20[2-9]\d-?[01]\d|/(home|tmp|usr|work|var)/", text)


# ---- numbers in C


@modest(300)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_constant_reads_back_as_the_float64_it_is(value: float) -> None:
    text = literal(sp.Rational(*value.as_integer_ratio()), "float64")
    assert float(text) == value
    assert re.fullmatch(r"-?\d+(\.\d+)?(e[-+]?\d+)?", text)
    assert "." in text or "e" in text
    assert len(re.sub(r"e.*|\D", "", text).lstrip("0")) <= 17


@modest(300)
@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_constant_reads_back_as_the_float32_it_is(value: float) -> None:
    text = literal(sp.Rational(*value.as_integer_ratio()), "float32")
    assert text.endswith("f")
    assert struct.unpack("f", struct.pack("f", float(text[:-1])))[0] == value
    assert "." in text or "e" in text


def test_integers_print_as_integers() -> None:
    assert literal(sp.Integer(-60), "int") == "-60"


@modest(100)
@given(st.lists(st.sampled_from(["alpha", "f->beta", "(a + b)", "sqrt(x * y)", "delta_of_something_long"]), min_size=2))
def test_a_long_statement_is_broken_at_operators_and_says_the_same(operands: list[str]) -> None:
    statement = "const double name = " + " + ".join(operands) + ";"
    lines = wrap(statement, "    ")
    assert all(len(line) <= WIDTH for line in lines)
    assert " ".join(" ".join(lines).split()) == statement


# ---- templates


@pytest.fixture
def contexts(monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, Any]]:
    """What each template was rendered with, for one kernel of each kind."""
    seen: dict[str, dict[str, Any]] = {}
    render = jinja2.Template.render

    def recorded(self: jinja2.Template, *args: Any, **kwargs: Any) -> str:
        assert self.name is not None
        seen[self.name] = dict(*args, **kwargs)
        return render(self, *args, **kwargs)

    monkeypatch.setattr(jinja2.Template, "render", recorded)
    translate(Scene.chapter1(), "stable")
    translate(Scene.chapter1(), "double")
    return seen


def asked_for(name: str) -> set[str]:
    """Keys that a template, or one that it includes, reads and that it does not define."""
    tree = c99.environment().parse((templates() / name).read_text(encoding="utf-8"))
    included = {str(other) for other in meta.find_referenced_templates(tree)}
    own = {macro.name for macro in tree.find_all(jinja2.nodes.Macro)}
    targets = [entry.target for entry in tree.find_all((jinja2.nodes.Assign, jinja2.nodes.AssignBlock))]
    named = [name for target in targets for name in (target, *target.find_all(jinja2.nodes.Name))]
    own |= {name.name for name in named if isinstance(name, jinja2.nodes.Name)}
    own |= {name for entry in tree.find_all(jinja2.nodes.FromImport) for name in entry.names if isinstance(name, str)}
    return meta.find_undeclared_variables(tree).union(*map(asked_for, included)) - own


@pytest.mark.parametrize("key", ["name", "real", "baked"])
def test_a_template_that_lacks_a_key_fails(contexts: dict[str, dict[str, Any]], key: str) -> None:
    assert set(contexts) >= {"kernel.c.j2", "kernel.h.j2", "kernel.cdef.j2"}
    for name, context in contexts.items():
        smaller = {other: value for other, value in context.items() if other != key}
        assert key in asked_for(name)
        with pytest.raises(jinja2.UndefinedError, match=key):
            c99.environment().get_template(name).render(smaller)


def test_every_key_given_to_the_templates_is_used_by_one(contexts: dict[str, dict[str, Any]]) -> None:
    given_keys = {key for context in contexts.values() for key in context}
    assert given_keys == {key for name in contexts for key in asked_for(name)}


# ---- the same bytes


PRINT_DIGESTS = f"""
import sys
sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / "tests")!r}]
import hashlib
from evaluators import STRUCTURES
from symrender_cg.pipeline import translate
for name in ("centred_sphere", "off_axis_sphere_gated", "any_sphere_specular", "any_sphere"):
    for accuracy in ("literal", "double", "single"):
        for bake in (False, True):
            files = translate(STRUCTURES[name], accuracy, bake=bake).emitted
            text = repr(sorted(files.files.items())) + files.cdef + repr(files.inputs)
            print(name, accuracy, bake, hashlib.sha256(text.encode()).hexdigest())
"""


def test_every_process_emits_the_same_bytes_whatever_its_hash_seed() -> None:
    digests = []
    for seed in ("1", "20260701"):
        environment = os.environ | {"PYTHONHASHSEED": seed}
        command = [sys.executable, "-W", "error", "-c", PRINT_DIGESTS]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        digests.append(done.stdout)
    assert digests[0] == digests[1]
    assert len(digests[0].splitlines()) == 24


def test_the_same_scene_gives_the_same_bytes_again() -> None:
    first, second = (translate(Scene.chapter1(), accuracy) for accuracy in ("double", "double"))
    assert dict(first.emitted.files) == dict(second.emitted.files)


def test_support_headers_are_carried_where_they_are_used_and_only_there() -> None:
    for name, accuracy in KERNELS:
        files, text = emitted(name, accuracy), source(name, accuracy)
        included = set(re.findall(r'#include "([\w.]+)"', text))
        assert included <= set(files.files)
        for header in files.files.keys() - {f"{files.name}.c", f"{files.name}.h"}:
            used = any(f'"{header}"' in other for key, other in files.files.items() if key != header)
            assert used, f"{name} {accuracy} carries {header} for nothing"
        assert ("double_double.h" in files.files) == (accuracy in EXACT)
        assert ("exact_sign.h" in files.files) == (accuracy in EXACT)
        powers = {"phong_power.h", "lobe_power.h"} & files.files.keys()
        assert len(powers) == ("_matte" not in name and "_flat" not in name)


def test_the_digest_of_a_text_is_of_its_bytes_and_not_of_its_object() -> None:
    """The control: two structures differ in their bytes."""
    texts = [source("centred_sphere", "double"), source("off_axis_sphere", "double")]
    assert len({hashlib.sha256(text.encode()).hexdigest() for text in texts}) == 2
