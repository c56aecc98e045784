"""Laws of the checked-in C of generated/: it is what the compiler writes today, and what its own commands write."""

from __future__ import annotations

import difflib
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from symrender_cg import generate
from symrender_cg.pipeline import translate
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import load_scene

ROOT = Path(__file__).resolve().parents[1]
GENERATED = ROOT / "generated"
README = GENERATED / "README.md"
KERNELS = (
    ("chapter1", "literal", None, False),
    ("chapter1", "fast", None, False),
    ("chapter1", "single", None, False),
    ("chapter1", "double", None, False),
    ("chapter1", "double", None, True),
    ("chapter1", "stable", None, False),
    ("chapter1", "certified", None, False),
    ("chapter1", "certified", "uint8", False),
    ("off_axis", "double", None, False),
    ("shadow", "double", None, False),
    ("shadow", "certified", None, False),
    ("mirrors", "double", None, False),
)
"""The kernels that are checked in: scene, accuracy, what it rounds to, whether its numbers are baked in."""

UPDATE = "python -m pytest tests/test_golden.py --update"
LONGEST_DIFF = 80


def test_the_c_that_the_readme_shows_is_that_of_the_kernel_it_names() -> None:
    shown = re.findall(r"^```c\n(.*?)^```", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    kernel = set((GENERATED / "centred_sphere_double" / "centred_sphere_double.c").read_text().splitlines())
    assert len(shown) == 3
    assert not [line for block in shown for line in block.splitlines() if line not in kernel]


def regenerated() -> dict[str, str]:
    """The texts of generated/ as the compiler writes them now, by their place in that folder."""
    texts: dict[str, str] = {}
    for name, accuracy, target, bake in KERNELS:
        scene = load_scene(name)
        command = generate.regenerate_command(name, accuracy, target=target, bake=bake)
        translation = translate(scene, accuracy, target=target, bake=bake, command=command)
        numbers = numbers_of(scene) if bake else None
        for place, text in generate.generate(translation, command=command, numbers=numbers).items():
            assert texts.setdefault(place, text) == text, f"two kernels disagree about {place}"
    return texts


def checked_in() -> dict[str, str]:
    """The texts of generated/ as they are, by their place; the README is written by hand and is left out."""
    paths = (path for path in sorted(GENERATED.rglob("*")) if path.is_file() and path != README)
    return {path.relative_to(GENERATED).as_posix(): path.read_bytes().decode() for path in paths}


def manifests() -> list[dict[str, Any]]:
    """What the kernels of generated/ say about themselves, in the order of their names."""
    return [json.loads(path.read_text()) for path in sorted(GENERATED.glob("*/manifest.json"))]


def difference(expected: dict[str, str], found: dict[str, str]) -> str:
    """A unified diff from the texts that were found to the expected ones, over all places; empty if they are equal."""
    lines: list[str] = []
    for place in sorted(expected.keys() | found.keys()):
        old, new = found.get(place, "").splitlines(), expected.get(place, "").splitlines()
        here = place if place in found else "(missing)"
        there = place if place in expected else "(written by no kernel)"
        if found.get(place) != expected.get(place):
            lines += difflib.unified_diff(old, new, f"generated/{here}", f"regenerated/{there}", lineterm="")
    rest = len(lines) - LONGEST_DIFF
    return "\n".join(lines[:LONGEST_DIFF] + ([f"... and {rest} lines more"] if rest > 0 else []))


def update(texts: dict[str, str]) -> None:
    """Bring generated/ up to date, and remove what no kernel writes any more."""
    generate.write(texts, GENERATED)
    for place in checked_in().keys() - texts.keys():
        (GENERATED / place).unlink()
    for folder in GENERATED.iterdir():
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def test_generated_is_what_the_compiler_writes_today(request: pytest.FixtureRequest) -> None:
    expected = regenerated()
    if request.config.getoption("--update"):
        update(expected)
    changes = difference(expected, checked_in())
    if changes:
        pytest.fail(f"{changes}\n\nIf this change is meant: {UPDATE}", pytrace=False)


def test_a_changed_a_missing_and_a_left_over_file_show_in_the_difference() -> None:
    changes = difference({"a.c": "x = 1;\n", "b.c": "y;\n"}, {"a.c": "x = 2;\n", "c.c": "z;\n"})
    assert changes.splitlines() == [
        "--- generated/a.c",
        "+++ regenerated/a.c",
        "@@ -1 +1 @@",
        "-x = 2;",
        "+x = 1;",
        "--- generated/(missing)",
        "+++ regenerated/b.c",
        "@@ -0,0 +1 @@",
        "+y;",
        "--- generated/c.c",
        "+++ regenerated/(written by no kernel)",
        "@@ -1 +0,0 @@",
        "-z;",
    ]


def test_the_same_bytes_are_written_whatever_the_hash_seed() -> None:
    ask = "import json, test_golden; print(json.dumps(test_golden.regenerated()))"
    python_path = os.pathsep.join([str(ROOT / "tests"), str(ROOT), os.environ.get("PYTHONPATH", "")])
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", ask],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": python_path},
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed in ("0", "4219")
    ]
    first, second = (run.communicate()[0] for run in runs)
    assert [run.returncode for run in runs] == [0, 0]
    assert first == second
    assert difference(json.loads(first), checked_in()) == ""


@pytest.mark.parametrize(("scene", "accuracy", "target", "bake"), KERNELS)
def test_the_command_in_a_kernels_manifest_writes_that_kernel(
    scene: str, accuracy: str, target: str | None, bake: bool, tmp_path: Path
) -> None:
    command = generate.regenerate_command(scene, accuracy, target=target, bake=bake)
    (manifest,) = (entry for entry in manifests() if entry["command"] == command)
    words = shlex.split(command)
    assert words[:4] == ["python", "-m", "symrender_cg", "build"]
    run = subprocess.run(
        [sys.executable, *words[1:], "--out", str(tmp_path)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    for path in (GENERATED / manifest["name"]).iterdir():
        assert (tmp_path / manifest["name"] / path.name).read_bytes() == path.read_bytes(), path.name
    for place in manifest["support"]:
        assert (tmp_path / place).read_bytes() == (GENERATED / place).read_bytes(), place


def test_the_readme_names_every_kernel_with_the_command_that_makes_it() -> None:
    rows = dict(re.findall(r"^\| \[`(\w+)`\]\(\1/\1\.c\) \|.*\| `([^`]+)` \|$", README.read_text(), re.MULTILINE))
    assert rows == {manifest["name"]: manifest["command"] for manifest in manifests()}


def test_no_text_holds_a_date_a_place_of_this_machine_or_its_name() -> None:
    forbidden = re.compile(r"/(home|root|tmp|usr|work|Users)/|\b20\d\d-\d\d-\d\d\b|\b\d\d:\d\d:\d\d\b")
    for place, text in checked_in().items():
        assert not forbidden.search(text), place
        assert os.uname().nodename not in text, place
