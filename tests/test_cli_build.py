"""Laws of `build` and of the files that it writes: deterministic, complete, and not touched when they are right."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
from pathlib import Path

import pytest
import sympy as sp
from command_line import LOADED_AFTER, Shell, in_a_process
from evaluators import PROVED

from symrender_cg import Scene, generate, pipeline, statistics
from symrender_cg.build.toolchain import find_toolchain
from symrender_cg.cli.main import main
from symrender_cg.errors import ArgumentError
from symrender_cg.explain import swollen_operations
from symrender_cg.explain.operations import swell_of
from symrender_cg.plan.plan import plan

ONE_KERNEL = ("literal", "single", "double")
KERNELS = ("fast", *ONE_KERNEL, "stable", "certified_float64")
"""What accuracy `all` is of one sphere."""


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("SYMRENDER_CACHE_DIR", str(folder))
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def cells(text: str, first: str) -> list[str]:
    """The cells of the first row of a plain table that starts with `first`."""
    row = next(line for line in text.splitlines() if line.strip().startswith(first))
    return re.split(r"\s{2,}", row.strip())


def test_a_first_build_prints_stages_swell_files_command_and_library(
    shell: Shell, tmp_path: Path, empty_cache: Path
) -> None:
    folder = tmp_path / "c"
    answer = shell("build", "--out", folder)
    assert answer.code == 0
    for level in KERNELS:
        name = f"centred_sphere_{level}"
        assert f"\n{name}\n" in f"\n{answer.out}"
        for kind in (f"{name}.c", f"{name}.h", "manifest.json"):
            assert (folder / name / kind).is_file()
            assert f"  new        {name}/{kind}\n" in answer.out
    for stage in ("plan", "derive", "lower", "emit", "build"):
        assert sum(line.startswith(f"  {stage} ") for line in answer.out.splitlines()) == len(KERNELS)
    assert answer.out.count("\ncommand  ") == len(KERNELS)
    libraries = re.findall(r"^library  (\S+) \(compiled in", answer.out, re.M)
    assert len(libraries) == len(KERNELS)
    assert all(Path(library).is_file() and empty_cache in Path(library).parents for library in libraries)


def test_the_swell_meter_counts_what_sympy_counts(shell: Shell, tmp_path: Path) -> None:
    answer = shell("build", "--accuracy", "literal", "--passes", "--out", tmp_path)
    image = pipeline.translate(Scene.chapter1(), "literal").image
    swollen = swollen_operations(image)
    for label, name in (("t_hit", "t"), ("n.l", "n_dot_l"), ("r.v", "r_dot_v"), ("shading", "value")):
        assert cells(answer.out, label)[1] == str(swollen[name])
    _, closed, named, kernel = cells(answer.out, "image")
    assert (int(closed), int(named)) == (swollen["image"], image.operations())
    assert swollen["image"] > 10 * image.operations()
    total = sum(pipeline.translate(Scene.chapter1(), "literal").program.operations().values())
    assert kernel == f"literal {total}"


def test_passes_lists_every_pass_of_the_lowering(shell: Shell, tmp_path: Path) -> None:
    answer = shell("build", "--accuracy", "double", "--passes", "--out", tmp_path)
    before = None
    for stage in pipeline.translate(Scene.chapter1(), "double").passes:
        row = cells(answer.out, f"{stage.name} ")
        assert row[0] == stage.name
        assert int(row[3]) == sum(stage.operations.values())
        assert before in (None, row[2])
        before = row[3]


def test_a_second_build_does_nothing_and_says_so(shell: Shell, tmp_path: Path) -> None:
    shell("build", "--out", tmp_path)
    stamps = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    before = (statistics.derived, statistics.compiled)
    answer = shell("build", "--out", tmp_path)
    assert answer.code == 0
    assert answer.out.startswith("nothing had to be done: ")
    assert (statistics.derived, statistics.compiled) == before
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == stamps
    assert len(re.findall(r"^library  \S+ \(from the cache\)$", answer.out, re.M)) == len(KERNELS)


def test_a_second_build_loads_no_sympy_no_templates_and_no_rich(tmp_path: Path) -> None:
    words = ("build", "grazing_light", "--out", tmp_path, "--accuracy", "double,single")
    assert in_a_process(*words).code == 0
    answer = in_a_process(*words, code=LOADED_AFTER)
    assert answer.code == 0, answer.err
    assert answer.out.startswith("nothing had to be done")
    assert answer.out.splitlines()[-1] == "loaded:"


def test_lost_and_edited_files_come_back_from_the_cache(shell: Shell, tmp_path: Path) -> None:
    shell("build", "--accuracy", "double", "--out", tmp_path)
    expected = contents(tmp_path)
    (tmp_path / "support" / "grid.h").unlink()
    (tmp_path / "centred_sphere_double" / "centred_sphere_double.c").write_text("int edited;\n")
    before = statistics.derived
    answer = shell("build", "--accuracy", "double", "--out", tmp_path)
    assert "  new        support/grid.h\n" in answer.out
    assert "  updated    centred_sphere_double/centred_sphere_double.c\n" in answer.out
    assert "  unchanged  centred_sphere_double/manifest.json\n" in answer.out
    assert contents(tmp_path) == expected
    assert statistics.derived == before


def test_texts_that_were_changed_inside_the_cache_are_not_trusted(
    shell: Shell, tmp_path: Path, empty_cache: Path
) -> None:
    folder = tmp_path / "c"
    shell("build", "--accuracy", "literal", "--out", folder)
    expected = contents(folder)
    (source,) = empty_cache.glob("kernels/*/centred_sphere_literal.c")
    source.write_text(source.read_text() + "/* not ours */\n")
    assert shell("build", "--accuracy", "literal", "--out", folder).code == 0
    assert contents(folder) == expected


def test_the_command_in_a_kernel_makes_the_same_files_again(shell: Shell, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    shell("build", "off_axis", "--accuracy", "single", "--out", first)
    manifest = json.loads((first / "off_axis_sphere_single" / "manifest.json").read_text())
    command = manifest["command"]
    assert command == "python -m symrender_cg build off_axis --accuracy single"
    for suffix in ("c", "h"):
        text = (first / "off_axis_sphere_single" / f"off_axis_sphere_single.{suffix}").read_text()
        assert f"Regenerate with:\n *     {command}\n" in text
    shell(*shlex.split(command)[3:], "--out", second, "--passes")
    assert contents(second) == contents(first)


def test_files_speak_of_their_own_scene_even_where_another_shares_the_kernel(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.toml").write_text("[camera]\nhalf_height = 2.0\n[[spheres]]\ncenter = [0.5, 0.0, 0.0]\n")
    shell("build", "off_axis", "--accuracy", "double", "--out", "a")
    shell("build", "other.toml", "--accuracy", "double", "--out", "b")
    places = [tmp_path / folder / "off_axis_sphere_double" / "off_axis_sphere_double.c" for folder in "ab"]
    a, b = (" ".join(place.read_text().replace(" * ", " ").split()) for place in places)
    assert "build off_axis --accuracy double" in a
    assert "build other.toml --accuracy double" in b
    (reason,) = (d.reason for d in plan(Scene.from_toml("other.toml")).decisions if d.effect.name == "front_test")
    assert reason in b
    assert reason not in a


def test_the_manifest_says_what_the_kernel_is_without_date_path_or_host(shell: Shell, tmp_path: Path) -> None:
    shell("build", "--accuracy", "double", "--out", tmp_path)
    text = (tmp_path / "centred_sphere_double" / "manifest.json").read_text()
    manifest = json.loads(text)
    translation = pipeline.translate(Scene.chapter1(), "double")
    assert manifest["name"] == "centred_sphere_double"
    assert manifest["inputs"] == list(translation.emitted.inputs)
    assert manifest["operations"] == translation.emitted.operations
    assert [(e["effect"], e["status"]) for e in manifest["plan"]] == [
        (d.effect.name, d.status) for d in translation.plan.decisions
    ]
    assert all(entry["reason"] for entry in manifest["plan"])
    assert manifest["files"] == ["centred_sphere_double.c", "centred_sphere_double.h"]
    assert all((tmp_path / place).is_file() for place in manifest["support"])
    assert str(tmp_path) not in text
    assert not re.search(r"\b20\d\d-\d\d", text)


def test_baking_says_what_it_baked_and_what_that_saved(shell: Shell, tmp_path: Path) -> None:
    answer = shell("build", "--accuracy", "double", "--bake", "--out", tmp_path)
    assert answer.code == 0
    row = cells(answer.out, "bake ")[-1]
    assert re.search(r"\d+ -> \d+ a frame, .* a pixel; [\d.]+ -> [\d.]+ ns a pixel, ", row)
    manifest = json.loads((tmp_path / "centred_sphere_double_baked" / "manifest.json").read_text())
    assert manifest["inputs"] == []
    assert manifest["baked"]["shininess"] == 32.0
    assert manifest["command"].endswith("--accuracy double --bake")
    assert shell("build", "--accuracy", "double", "--bake", "--out", tmp_path).out.startswith("nothing had to be done")


def test_the_c_compiles_by_hand_with_the_two_folders_on_the_include_path(shell: Shell, tmp_path: Path) -> None:
    shell("build", "--out", tmp_path, "--accuracy", "double")
    kernel = tmp_path / "centred_sphere_double"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"]
    command = [*find_toolchain().command, *flags, f"-I{kernel}", f"-I{tmp_path / 'support'}"]
    done = subprocess.run(
        [*command, str(kernel / "centred_sphere_double.c")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_a_build_serves_render_image_without_another_compilation(
    shell: Shell, tmp_path: Path, empty_cache: Path
) -> None:
    shell("build", "--accuracy", "double", "--out", tmp_path / "c")
    answer = in_a_process("render", "-o", tmp_path / "a.npy", "--size", "8x8")
    assert "centred_sphere_double from the cache" in answer.out
    assert len(list(empty_cache.glob("kernels/*"))) == 1


def test_portable_is_a_library_of_its_own_with_the_same_c(shell: Shell, tmp_path: Path) -> None:
    native = shell("build", "--accuracy", "literal", "--out", tmp_path)
    portable = shell("build", "--accuracy", "literal", "--out", tmp_path, "--portable")
    assert "  unchanged  centred_sphere_literal/centred_sphere_literal.c\n" in portable.out
    assert "-march=native" not in portable.out
    assert native.out.split("library  ")[1] != portable.out.split("library  ")[1]


def test_a_compiler_that_fails_is_quoted_with_exit_code_5_and_the_next_run_works(
    shell: Shell, tmp_path: Path, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = find_toolchain().path
    fake = tmp_path / "cc"
    fake.write_text(
        f'#!/bin/sh\ncase "$*" in *-shared*) echo "a.c:1: error: no luck" >&2; exit 3;; esac\nexec {real} "$@"\n'
    )
    fake.chmod(0o755)
    with monkeypatch.context() as patched:
        patched.setenv("CC", str(fake))
        answer = shell("build", "--accuracy", "literal", "--out", tmp_path / "c")
    assert answer.code == 5
    assert "the compiler failed with exit status 3" in answer.err
    assert f"command: {fake} -std=c99" in answer.err
    assert "a.c:1: error: no luck" in answer.err
    assert shell("build", "--accuracy", "literal", "--out", tmp_path / "c").code == 0
    assert empty_cache.is_dir()


def test_without_a_compiler_the_error_names_three_remedies(
    shell: Shell, tmp_path: Path, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(empty_cache))
    monkeypatch.delenv("CC", raising=False)
    answer = shell("build", "--accuracy", "literal", "--out", tmp_path / "c")
    if answer.code == 0:
        pytest.skip("the ziglang wheel is installed, a compiler without PATH")
    assert answer.code == 5
    assert "no C compiler found" in answer.err
    assert all(f"\n    {number}. " in answer.err for number in (1, 2, 3))


def test_a_folder_that_cannot_be_made_is_an_error_of_usage(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    answer = shell("build", "--accuracy", "literal", "--out", tmp_path / "file")
    assert answer.code == 2
    assert "choose another folder for the C" in answer.err


@pytest.mark.parametrize(
    ("scene", "named"),
    [
        (None, "chapter1"),
        ("off_axis", "off_axis"),
        ("scenes/mine.toml", "scenes/mine.toml"),
        ("/home/me/mine.toml", "mine.toml"),
        ("two words.toml", "'two words.toml'"),
        ("a/" * 60 + "mine.toml", "mine.toml"),
        ("evil*/x.toml", "x.toml"),
        ("x*/", "SCENE"),
        ("a\nb.toml", "SCENE"),
    ],
)
def test_the_command_of_a_kernel_can_stand_in_a_c_comment(scene: str | None, named: str) -> None:
    command = generate.regenerate_command(scene, "double")
    assert command == f"python -m symrender_cg build {named} --accuracy double"
    assert "*/" not in command
    assert "\n" not in command


def test_generated_texts_do_not_depend_on_the_hash_seed(tmp_path: Path) -> None:
    for seed in ("0", "4711"):
        words = ("build", "off_axis", "--accuracy", "single", "--passes", "--out", tmp_path / seed)
        assert in_a_process(*words, env={"PYTHONHASHSEED": seed}).code == 0
    assert contents(tmp_path / "0") == contents(tmp_path / "4711")


def test_the_entry_point_of_the_package_is_this_command_line() -> None:
    from symrender_cg import __main__ as module

    assert module.main is main


def test_a_scene_of_many_spheres_is_built_part_by_part(shell: Shell, tmp_path: Path) -> None:
    answer = shell("build", "lights", "--accuracy", "double", "--passes", "--out", tmp_path)
    assert answer.code == 0
    translation = pipeline.translate(Scene.builtin("lights"), "double")
    name = translation.emitted.name
    assert (tmp_path / name / f"{name}.c").is_file()
    image = {part: swell_of(translation.parts[part], translation.programs[part]) for part in translation.parts}
    swell = answer.out[answer.out.index("swell meter") :]
    for part, counts in image.items():
        row = cells(swell, f"{part} ")
        assert row[1:] == [str(counts.closed), str(counts.named), f"double {counts.kernel}"]
        assert counts.closed == sum(
            int(sp.count_ops(translation.parts[part].closed(result))) for result in translation.parts[part].results
        )
    assert f"{len(image)} parts with" in answer.out
    assert "colour in, " in answer.out.replace(" and clip", "")


def test_the_manifest_of_a_scene_has_its_decisions_fields_and_parts(shell: Shell, tmp_path: Path) -> None:
    words = ("build", "lights", "--accuracy", "double", "--out", tmp_path)
    shell(*words)
    translation = pipeline.translate(Scene.builtin("lights"), "double")
    name = translation.emitted.name
    manifest = json.loads((tmp_path / name / "manifest.json").read_text())
    assert [(e["effect"], e["status"], e["margin"], e["bound"]) for e in manifest["plan"]] == [
        (d.effect.name, d.status, d.margin, d.bound) for d in translation.plan.decisions
    ]
    assert any(entry["margin"] is not None for entry in manifest["plan"])
    assert [field["name"] for field in manifest["fields"]] == manifest["inputs"]
    assert manifest["channels"] == 3
    assert set(manifest["parts"]) == set(translation.parts)
    for rate, counts in manifest["operations"].items():
        parts = sum(sum(part.get(rate, {}).values()) for part in manifest["parts"].values())
        assert parts == sum(counts.values())
    assert shell(*words).out.startswith(f"nothing had to be done: {name} up to date")


def test_all_of_a_scene_leaves_the_formula_of_one_sphere_out(shell: Shell, tmp_path: Path) -> None:
    answer = shell("build", "two_spheres", "--out", tmp_path)
    assert answer.code == 0
    assert answer.err.startswith("symrender_cg: literal is left out: ")
    scenes = {f"scene_{kernel}" for kernel in ("fast", "single", "double", "enclosure")}
    assert {path.name for path in tmp_path.iterdir()} == scenes | {"support"}
    assert answer.out.count("\ncommand  ") == 4


def test_baking_a_scene_is_refused_as_usage(shell: Shell, tmp_path: Path) -> None:
    for accuracy in ("all", "double"):
        answer = shell("build", "two_spheres", "--bake", "--accuracy", accuracy, "--out", tmp_path)
        assert answer.code == 2
        assert "leave bake out" in answer.err
    assert not list(tmp_path.iterdir())


# --------------------------------------------------------------------------------------- levels that prove their values


@pytest.mark.parametrize(("accuracy", "target"), PROVED)
def test_a_level_that_proves_its_values_is_built_with_the_command_that_makes_it_again(
    shell: Shell, tmp_path: Path, accuracy: str, target: str | None
) -> None:
    rounding = () if target is None else ("--target", target)
    answer = shell("build", "--accuracy", accuracy, *rounding, "--out", tmp_path)
    assert answer.code == 0
    translation = pipeline.translate(Scene.chapter1(), accuracy, target=target)
    name = translation.emitted.name
    assert name == "centred_sphere_" + "_".join(filter(None, (accuracy, target)))
    manifest = json.loads((tmp_path / name / "manifest.json").read_text())
    assert manifest["command"] == " ".join(("python -m symrender_cg build chapter1 --accuracy", accuracy, *rounding))
    assert manifest["accuracy"] == translation.variant.name
    assert manifest["result_type"] == {"float32": "float", "uint8": "unsigned char"}.get(target or "", "double")
    text = (tmp_path / name / f"{name}.c").read_text()
    assert f"Regenerate with:\n *     {manifest['command']}\n" in text
    assert {"support/range.h", "support/settle.h"} <= set(manifest["support"])
    again = shell(*shlex.split(manifest["command"])[3:], "--out", tmp_path)
    assert again.out.startswith(f"nothing had to be done: {name} up to date")


def test_certified_without_a_target_is_float64_also_in_its_command(shell: Shell, tmp_path: Path) -> None:
    assert shell("build", "--accuracy", "certified", "--out", tmp_path).code == 0
    manifest = json.loads((tmp_path / "centred_sphere_certified_float64" / "manifest.json").read_text())
    assert manifest["command"] == "python -m symrender_cg build chapter1 --accuracy certified"


def test_every_level_of_a_scene_that_proves_its_values_rests_on_one_enclosure(shell: Shell, tmp_path: Path) -> None:
    for place, words in (
        ("a", ("--accuracy", "stable")),
        ("b", ("--accuracy", "certified", "--target", "uint8")),
        ("c", ("--accuracy", "stable,certified", "--passes")),
    ):
        answer = shell("build", "two_spheres", *words, "--out", tmp_path / place)
        assert answer.code == 0
        assert answer.out.count("library  ") == 1
    assert contents(tmp_path / "a") == contents(tmp_path / "b") == contents(tmp_path / "c")
    manifest = json.loads((tmp_path / "a" / "scene_enclosure" / "manifest.json").read_text())
    assert (manifest["accuracy"], manifest["promise"]) == ("enclosure", generate.ENCLOSES)
    assert manifest["command"] == "python -m symrender_cg build two_spheres --accuracy certified"
    assert [field["name"] for field in manifest["fields"]] == manifest["inputs"]
    assert set(manifest["parts"]) == set(pipeline.translate(Scene.builtin("two_spheres"), "stable").parts)
    assert (tmp_path / "a" / "support" / "ball.h").is_file()


def test_the_swell_meter_of_a_scene_has_the_parts_of_values_and_of_enclosures(shell: Shell, tmp_path: Path) -> None:
    answer = shell("build", "two_spheres", "--accuracy", "double,stable", "--passes", "--out", tmp_path)
    swell = answer.out[answer.out.index("swell meter") :]
    found = {level: pipeline.translate(Scene.builtin("two_spheres"), level).programs for level in ("double", "stable")}
    for part in dict.fromkeys((*found["double"], *found["stable"])):
        words = {"double": "double", "stable": "enclosure"}
        inside = [
            f"{words[level]} {sum(programs[part].operations().values())}"
            for level, programs in found.items()
            if part in programs
        ]
        assert cells(swell, f"{part} ")[-1] == ", ".join(inside)
    assert set(found["double"]) - set(found["stable"]) == {"span"}
    assert set(found["stable"]) - set(found["double"]) == {"near"}


def test_a_build_serves_certify_without_another_compilation(shell: Shell, tmp_path: Path, empty_cache: Path) -> None:
    assert shell("build", "two_spheres", "--accuracy", "stable", "--out", tmp_path / "c").code == 0
    words = ("two_spheres", "-o", tmp_path / "a.npy", "--size", "8x8", "--accuracy", "certified")
    assert "scene_enclosure from the cache, " in in_a_process("render", *words).out
    assert len(list(empty_cache.glob("kernels/*"))) == 1


def test_an_enclosure_compiles_by_hand_under_strict_c99(shell: Shell, tmp_path: Path) -> None:
    assert shell("build", "lights", "--accuracy", "stable", "--out", tmp_path).code == 0
    (kernel,) = tmp_path.glob("*_enclosure")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"]
    command = [*find_toolchain().command, *flags, f"-I{kernel}", f"-I{tmp_path / 'support'}"]
    done = subprocess.run([*command, str(kernel / f"{kernel.name}.c")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--target", "uint8", "--accuracy", "double"), "--target uint8: this is what accuracy certified rounds to"),
        (("--accuracy", "stable", "--bake"), "a kernel of 'stable' takes its numbers as arguments; leave bake out"),
    ],
)
def test_what_no_kernel_is_made_of_is_refused(shell: Shell, tmp_path: Path, words: tuple[str, ...], text: str) -> None:
    answer = shell("build", *words, "--out", tmp_path)
    assert answer.code == 2
    assert text in answer.err
    assert not list(tmp_path.iterdir())


def test_baking_all_bakes_what_one_kernel_draws_alone(shell: Shell, tmp_path: Path) -> None:
    assert shell("build", "--bake", "--out", tmp_path).code == 0
    baked = {f"centred_sphere_{level}_baked" for level in ("fast", *ONE_KERNEL)}
    assert {path.name for path in tmp_path.iterdir()} == baked | {"support"}


def test_no_kernel_alone_draws_a_level_of_stages() -> None:
    for scene in (Scene.chapter1(), Scene.builtin("two_spheres")):
        for accuracy in ("stable", "certified"):
            with pytest.raises(ArgumentError, match="in stages; expected a level that one kernel draws alone"):
                pipeline.draw(scene, accuracy)
