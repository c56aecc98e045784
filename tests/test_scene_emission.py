"""Laws of the C text of scene kernels: strict C99 for every combination of effects, nothing of an effect left out,
loops that become vector code, one text for any number of spheres, no undefined behaviour.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import fields, replace
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scene_strategies import random_scene

from benchmarks.random_scenes import EVERY_EFFECT, errors, numbers_for_every_effect
from symrender_cg.build import find_toolchain, project_flags
from symrender_cg.build.vectorisation import report
from symrender_cg.derive.parts import Part
from symrender_cg.emit.c99 import Emitted
from symrender_cg.emit.scene import emit_scene, marks_doubt, scene_parts
from symrender_cg.emit.scene_fields import Needs
from symrender_cg.lower.parts import lower_part
from symrender_cg.lower.program import KernelProgram
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import pixel_size, planned, translate
from symrender_cg.plan.effects import SCENE
from symrender_cg.reference import brute_force
from symrender_cg.scene import Scene
from symrender_cg.scene.random import random_spheres

ROOT = Path(__file__).resolve().parents[1]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
ACCURACIES = ("double", "single")
WIDTH = 120
FLAGS = tuple(field.name for field in fields(Needs) if field.name != "channels")
MORE_WARNINGS = ("-Wshadow", "-Wmissing-prototypes", "-Wstrict-prototypes", "-Wundef", "-Wvla")


def needs(*flags: str, colour: bool = False) -> Needs:
    """Needs with these flags, less those that nothing can ask for without another one."""
    on = set(flags)
    on -= set() if "plane" in on else {"checker", "crossing"}
    on -= set() if on & {"spans", "at_eye"} else {"intersections", "crossing"}
    on -= set() if on & {"spans", "at_eye", "plane"} else {"diffuse", "specular", "mirrors"}
    on -= set() if "specular" in on else {"specular_gate"}
    on -= set() if on & {"diffuse", "specular"} else {"attenuation", "shadows"}
    return replace(Needs(channels=3 if colour else 1), **dict.fromkeys(sorted(on), True))


@cache
def covering() -> tuple[Needs, ...]:
    """Of all, none, each beside what it rests on, each left out of all, and random halves, those that show two effects
    in a way (both, neither, one of the two) that none before them does.
    """
    chance = np.random.default_rng(6)
    found = [EVERY_EFFECT, needs(), needs("spans"), needs("at_eye"), needs("plane")]
    found += [needs(*(f for f in FLAGS if chance.random() < 0.5), colour=bool(k % 2)) for k in range(40)]
    found += [needs(*(set(FLAGS) - {flag}), colour=k % 2 == 0) for k, flag in enumerate(FLAGS)]
    found += [needs("spans", "plane", "specular", "diffuse", flag) for flag in FLAGS]
    seen: set[tuple[str, str, bool, bool]] = set()
    kept = []
    for need in found:
        if not ways(need) <= seen:
            kept.append(need)
            seen |= ways(need)
    return tuple(kept)


def test_the_covering_set_has_every_pair_of_effects_in_every_way_that_there_is() -> None:
    possible: set[tuple[str, str, bool, bool]] = set()
    for size in range(len(FLAGS) + 1):
        for some in combinations(FLAGS, size) if size < 4 or size > len(FLAGS) - 3 else ():
            possible |= ways(needs(*some))
    assert len(possible) > 300
    assert possible <= {way for need in covering() for way in ways(need)}


def ways(need: Needs) -> set[tuple[str, str, bool, bool]]:
    return {(a, b, getattr(need, a), getattr(need, b)) for a, b in combinations(FLAGS, 2)}


@cache
def lowered(part: Part, accuracy: str) -> KernelProgram:
    return lower_part(part, variant(accuracy))


@cache
def emitted(need: Needs, accuracy: str) -> Emitted:
    marks = marks_doubt(variant(accuracy))
    programs = {name: lowered(part, accuracy) for name, part in scene_parts(need, marks=marks).items()}
    found = planned(Scene.chapter1(), force=(SCENE,))
    return emit_scene(
        programs, need=need, plan=found, variant=variant(accuracy), command="none", name=f"scene_{accuracy}"
    )


def source(files: Emitted) -> str:
    return files.files[f"{files.name}.c"]


def body_of(files: Emitted) -> str:
    """The C after the comment at its head, which names what is left out; and the header."""
    text, header = source(files), files.files[f"{files.name}.h"]
    return text[text.index("*/") :] + header[header.index("*/") :]


# ------------------------------------------------------------------------------------------------------------- C99


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_every_combination_is_strict_c99_without_a_warning(compiler: str, accuracy: str, tmp_path: Path) -> None:
    assert {"-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"} <= set(project_flags())
    for name, text in emitted(EVERY_EFFECT, accuracy).files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    for number, need in enumerate(covering()):
        files = emitted(need, accuracy)
        for name, text in files.files.items():
            (tmp_path / name).write_text(text, encoding="utf-8")
        command = [compiler, *project_flags(), *MORE_WARNINGS, "-fsyntax-only", f"{files.name}.c"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.stderr, done.returncode) == ("", 0), f"{number}: {need}"


def test_every_text_is_ascii_within_120_columns_and_tidy() -> None:
    for accuracy in ACCURACIES:
        for need in covering():
            files = emitted(need, accuracy)
            for file, text in files.files.items():
                assert text.isascii()
                assert text.endswith("\n")
                assert not text.endswith("\n\n")
                for number, line in enumerate(text.split("\n"), 1):
                    assert len(line) <= WIDTH, f"{file}:{number} has {len(line)} columns: {line}"
                    assert line == line.rstrip(), f"{file}:{number} ends in space"
                    assert "\t" not in line
                assert "\n\n\n" not in text, file


TRACES = {
    "spans": r"\bspan_|\bpixel_span\b|row_disc",
    "at_eye": r"\bnear_|at_eye|before_eye",
    "intersections": r"partners|intersect",
    "plane": r"\bplane_(row|frame|surface|distance|x|z|seen)\b|\bground\b|descent",
    "checker": r"parity|\btiles?\b|tile_|across_|along_",
    "crossing": r"crosses_plane",
    "specular": r"lobe|glossy|shininess|phong_power|highlight|leaf",
    "specular_gate": r"\bGATED\b(?! = 4)",
    "attenuation": r"fade|fading|attenuation",
    "shadows": r"shadow|blocker|\bshade\b\s*=",
    "mirrors": r"find_in_mirror|find_plane_in_mirror|flush_mirror|arrive\(|mirrors_begin|\bweight\b|\bchild\b",
    "gradient": r"backdrop|gradient|background_top|\bup_[xyz]\b|climb",
}
"""What the text of each effect leaves in the C."""


@pytest.mark.parametrize("flag", TRACES)
def test_an_effect_left_out_leaves_no_trace_in_the_text_and_one_left_in_does(flag: str) -> None:
    there = 0
    for need in covering():
        for accuracy in ACCURACIES:
            found = re.search(TRACES[flag], body_of(emitted(need, accuracy)))
            if getattr(need, flag):
                there += found is not None
            else:
                assert found is None, f"{found and found[0]!r} in {need}"
    assert there == 2 * sum(getattr(need, flag) for need in covering())


def test_lights_leave_no_trace_where_nothing_is_lit() -> None:
    for need in covering():
        if not need.lit:
            for accuracy in ACCURACIES:
                assert not re.search(r"\blamps?\b|cosine|nearness|\breach\(", body_of(emitted(need, accuracy))), need


ENTRIES = ("prepare", "release", "rows", "points", "prepare_many", "release_many", "batch")


def test_no_state_is_kept_between_calls_and_every_function_but_the_entry_points_is_static() -> None:
    for accuracy in ACCURACIES:
        files = emitted(EVERY_EFFECT, accuracy)
        code = re.sub(r"/\*.*?\*/", " ", source(files), flags=re.DOTALL)
        for line in code.split("\n"):
            if re.match(r"\s*static\b", line):
                assert re.match(r"\s*static (const|inline)\b", line) or "(" in line, line
        entries = set(re.findall(rf"^[^\s#/}}].*?\b({files.name}_\w+)\([^;]*$", code, flags=re.MULTILINE))
        assert entries == {f"{files.name}_{name}" for name in ENTRIES}


DIGESTS = f"""
import hashlib, sys
sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / "tests")!r}]
from scene_strategies import random_scene
from symrender_cg.pipeline import translate
for seed in (3, 11, 19, 56):
    for accuracy in ("double", "single"):
        files = translate(random_scene(seed), accuracy, force=("scene",)).emitted
        text = repr(sorted(files.files.items())) + files.cdef + repr(files.inputs) + repr(files.fields)
        print(seed, accuracy, hashlib.sha256(text.encode()).hexdigest())
"""


def test_every_process_emits_the_same_bytes_whatever_its_hash_seed() -> None:
    said = []
    for seed in ("1", "20260701"):
        environment = os.environ | {"PYTHONHASHSEED": seed}
        command = [sys.executable, "-W", "error", "-c", DIGESTS]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        said.append(done.stdout)
    assert said[0] == said[1]
    assert len(set(said[0].split("\n"))) == 9


# ------------------------------------------------------------------------------------------------- size and speed


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_text_does_not_depend_on_the_number_of_spheres(accuracy: str) -> None:
    kernels = {count: translate(random_spheres(count, 1), accuracy) for count in (10, 100, 1000)}
    assert len({found.plan.key for found in kernels.values()}) == 1
    bodies = {count: body_of(found.emitted) for count, found in kernels.items()}
    assert all(one == other for one, other in pairwise(bodies.values()))
    assert bodies[10] != body_of(translate(random_spheres(10, 1, shadows=False), accuracy).emitted)


VECTOR_LOOPS = (
    "span_strip_of",
    "span_surface",
    "near_surface",
    "plane_surface",
    "reach",
    "shade_matte",
    "shade_glossy",
    "raise_lobes",
    "finish_glossy",
    "fade",
    "cast_shadows",
    "accumulate",
    "find_in_mirror",
)


def function_at(text: str, line: int) -> str:
    """The name of the function whose body holds a line."""
    for before in reversed(text.split("\n")[:line]):
        found = re.match(r"^(?:static|SYMRENDER_INLINE|int|void|struct|[a-z_]+ \*?)[^;=]*?\b(\w+)\(", before)
        if found is not None and not before.startswith(" "):
            return found[1]
    return ""


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_loops_over_points_become_vector_code(accuracy: str) -> None:
    """Of shading, shadows, geometry and mirrors; on this machine and by the compiler that the package takes here."""
    toolchain = find_toolchain()
    if toolchain.native.vector_bytes < 16:
        pytest.skip("no vectors of two float64 numbers on this machine")
    files = emitted(EVERY_EFFECT, accuracy)
    text = source(files)
    loops = [loop for loop in report(files.files, toolchain=toolchain) if loop.file == f"{files.name}.c"]
    vectorised = {function_at(text, loop.line) for loop in loops if loop.bytes >= 16}
    assert {name for name in VECTOR_LOOPS if f"{name}(" in text} == set(VECTOR_LOOPS)
    assert set(VECTOR_LOOPS) - vectorised == set()


# -------------------------------------------------------------------------------------------- no undefined behaviour

SIDE = 9
MAIN = """
static int draw(const char *what, const {name}_scene *scene, double pixel)
{{
    enum {{ SIDE = {side}, CHANNELS = 3, LIGHTS = 8 }};
    const symrender_grid grid = {{SIDE, SIDE, pixel, INFINITY}};
    {real} *image = malloc(sizeof *image * SIDE * SIDE * CHANNELS);
    {real} *values = malloc(sizeof *image * SIDE * SIDE * CHANNELS);
    double *depth = malloc(sizeof *depth * SIDE * SIDE), *normal = malloc(sizeof *depth * SIDE * SIDE * 3);
    int *index = malloc(sizeof *index * SIDE * SIDE);
    double *term[5];
    for (int k = 0; k < 5; ++k)
        term[k] = calloc(SIDE * SIDE * CHANNELS * (k < 3 ? 1 : LIGHTS), sizeof **term);
    {name}_layers layers = {{depth, normal, index, term[0], term[1], term[2], term[3], term[4]}};
    {name}_frame *frame = {name}_prepare(scene, &grid);
    ptrdiff_t unsettled[SIDE * SIDE];
    int failed = {name}_rows(image, SIDE * CHANNELS, frame, &layers, 0, SIDE / 2, unsettled) < 0;
    failed |= {name}_rows(image, SIDE * CHANNELS, frame, NULL, SIDE / 2, SIDE, NULL) != 0;
    double x[SIDE * SIDE], y[SIDE * SIDE];
    for (int j = 0; j < SIDE; ++j)
        for (int i = 0; i < SIDE; ++i) {{
            x[SIDE * j + i] = (i + 0.5 - 0.5 * SIDE) * pixel;
            y[SIDE * j + i] = (0.5 * SIDE - 0.5 - j) * pixel;
        }}
    failed |= {name}_points(values, x, y, SIDE * SIDE, frame, unsettled) < 0;
    failed |= {name}_points(values, x, y, 0, frame, NULL) != 0;
    failed |= {name}_rows(image, SIDE * CHANNELS, frame, NULL, 3, 3, NULL) != 0;
    {name}_release(frame);
    {name}_release(NULL);
    for (int i = 0; i < SIDE * SIDE * CHANNELS; ++i)
        printf("%s %a %a\\n", what, (double)image[i], (double)values[i]);
    free(image), free(values), free(depth), free(normal), free(index);
    for (int k = 0; k < 5; ++k)
        free(term[k]);
    return failed;
}}
"""


def initialised(name: str, numbers: dict[str, Any], files: Emitted) -> str:
    """A scene structure as C text, each array just as long as it is."""
    lines, members = [], []
    for field, shape in files.fields:
        value = numbers[field]
        if shape in ("reals", "wholes"):
            kind = "double" if shape == "reals" else "int"
            items = [float(v).hex() if shape == "reals" else str(int(v)) for v in np.asarray(value).ravel()]
            given = "NULL"
            if items:
                lines.append(f"static const {kind} {name}_{field}[] = {{{', '.join(items)}}};")
                given = f"{name}_{field}"
            members.append(f"    .{field} = {given},")
        else:
            members.append(f"    .{field} = {float(value).hex() if shape == 'number' else int(value)},")
    return "\n".join([*lines, f"static const {files.name}_scene {name} = {{", *members, "};"])


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_no_undefined_behaviour_and_no_access_outside_arrays(accuracy: str, tmp_path: Path) -> None:
    """Under AddressSanitizer and UBSan, images and points of random scenes, whose arrays end where they end."""
    compiler = COMPILERS[0] if COMPILERS else pytest.skip("no compiler")
    files = emitted(EVERY_EFFECT, accuracy)
    for name, text in files.files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    seeds = (3, 19, 44, 56)
    scenes = [random_scene(seed) for seed in seeds]
    found = [planned(scene, force=(SCENE,), aspect=1.0) for scene in scenes]
    single = {plan.arrangement.receivers for plan in found if plan.arrangement is not None}
    assert len(single) > 1
    real = "float" if accuracy == "single" else "double"
    program = [f'#include "{files.name}.h"', "#include <math.h>", "#include <stdio.h>", "#include <stdlib.h>"]
    program.append(MAIN.format(name=files.name, real=real, side=SIDE))
    calls = []
    for number, plan in enumerate(found):
        program.append(initialised(f"scene_{number}", numbers_for_every_effect(plan, files.fields), files))
        calls.append(f'draw("{number}", &scene_{number}, {pixel_size(plan.scene, SIDE).hex()})')
    program.append("int main(void)\n{\n    return " + " | ".join(calls) + ";\n}\n")
    (tmp_path / "main.c").write_text("\n".join(program))
    flags = ("-std=c99", "-O0", "-g", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    command = [compiler, *flags, "main.c", f"{files.name}.c", "-o", "main", "-lm"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    if "cannot find" in done.stderr or "unsupported" in done.stderr:
        pytest.skip("no sanitizers here")
    assert done.returncode == 0, done.stderr
    ran = subprocess.run(["./main"], cwd=tmp_path, capture_output=True, text=True, check=False)
    if "LeakSanitizer has encountered a fatal error" in ran.stderr:
        environment = os.environ | {"ASAN_OPTIONS": "detect_leaks=0"}
        ran = subprocess.run(["./main"], cwd=tmp_path, capture_output=True, text=True, check=False, env=environment)
    assert (ran.stderr, ran.returncode) == ("", 0)
    rows = [line.split() for line in ran.stdout.split("\n") if line]
    for number, scene in enumerate(scenes):
        image, values = (np.array([float.fromhex(row[k]) for row in rows if row[0] == str(number)]) for k in (1, 2))
        np.testing.assert_array_equal(image, values)
        traced = brute_force.image(scene, SIDE, SIDE)
        wanted = traced.value if scene.channels == 3 else np.repeat(traced.value[..., np.newaxis], 3, axis=-1)
        clear = traced.doubt > (1e-9 if accuracy == "double" else 1e-4)
        assert errors(image.reshape(SIDE, SIDE, 3), wanted, clear) < (1e-12 if accuracy == "double" else 1e-5)
