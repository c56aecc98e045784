"""Laws of packaging: a wheel holds all that the compiler reads, and an editable install reads the checkout."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from symrender_cg import __version__
from symrender_cg.pipeline import translate
from symrender_cg.scene import load_scene
from symrender_cg.scene.builtin import builtin_names

ROOT = Path(__file__).resolve().parents[1]
LEAST_SETUPTOOLS = (70, 1)
"""From this version on setuptools makes wheels by itself; pyproject.toml asks for it."""

EMIT = """\
import json, site, sys
place, more = sys.argv[1], sys.argv[2:]
site.addsitedir(place)
import symrender_cg, symrender_cg.templates
sys.path += more
from symrender_cg.pipeline import translate
from symrender_cg.resources import templates
from symrender_cg.scene import load_scene
from symrender_cg.scene.builtin import builtin_names
print(json.dumps({
    "package": symrender_cg.__file__,
    "templates": str(templates()),
    "scenes": builtin_names(),
    "files": dict(translate(load_scene("chapter1")).emitted.files),
}))
"""
"""Run without site-packages, so that only the install in `place` can be found; its dependencies are added after it."""

pytestmark = pytest.mark.skipif(
    tuple(map(int, version("setuptools").split(".")[:2])) < LEAST_SETUPTOOLS,
    reason=f"setuptools {version('setuptools')} makes no wheel by itself: python -m pip install -U setuptools",
)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what an install reads: a build writes into the folder that it is started in."""
    folder = tmp_path_factory.mktemp("checkout")
    ignored = shutil.ignore_patterns("__pycache__", ".*")
    for name in ("symrender_cg", "templates"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, folder / name)
    return folder


def built(checkout: Path, kind: str, folder: Path) -> Path:
    """What `pip install .` (kind "wheel") or `pip install -e .` ("editable") puts into site-packages."""
    ask = f"import sys; from setuptools import build_meta; build_meta.build_{kind}(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", ask, folder], cwd=checkout, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    place = folder / "site-packages"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(place)
    return place


@pytest.fixture(scope="module")
def wheel(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The contents of the wheel."""
    return built(checkout, "wheel", tmp_path_factory.mktemp("wheel"))


def emitted_by(place: Path, elsewhere: Path) -> dict[str, Any]:
    """What the package that is installed in `place` emits for Chapter 1's scene, asked from another folder."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    dependencies = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", EMIT, str(place), *dependencies],
        cwd=elsewhere, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def test_every_source_file_of_the_package_is_in_the_wheel(wheel: Path) -> None:
    sources = {path.relative_to(ROOT).as_posix() for path in (ROOT / "symrender_cg").rglob("*.py")}
    packed = {path.relative_to(wheel).as_posix() for path in (wheel / "symrender_cg").rglob("*.py")}
    missing = sources - packed
    assert not missing, f"add their packages to [tool.setuptools] packages in pyproject.toml: {sorted(missing)}"
    assert packed - sources == {"symrender_cg/templates/__init__.py"}


def test_every_template_and_scene_is_in_the_wheel(wheel: Path) -> None:
    for source, packed in ((ROOT / "templates", "templates"), (ROOT / "symrender_cg" / "scenes", "scenes")):
        for path in source.rglob("*"):
            if path.is_file() and path.suffix != ".pyc":
                copy = wheel / "symrender_cg" / packed / path.relative_to(source)
                assert copy.read_bytes() == path.read_bytes(), path.name


def test_the_wheel_puts_nothing_beside_the_package(wheel: Path) -> None:
    assert {path.name for path in wheel.iterdir()} == {"symrender_cg", f"symrender_cg-{__version__}.dist-info"}


def test_an_installed_wheel_emits_what_the_checkout_emits(wheel: Path, tmp_path: Path) -> None:
    answer = emitted_by(wheel, tmp_path)
    assert Path(answer["package"]).is_relative_to(wheel)
    assert Path(answer["templates"]) == wheel / "symrender_cg" / "templates"
    assert answer["scenes"] == list(builtin_names())
    assert answer["files"] == dict(translate(load_scene("chapter1")).emitted.files)


def test_an_editable_install_emits_from_the_checkout(checkout: Path, tmp_path: Path) -> None:
    checkout = shutil.copytree(checkout, tmp_path / "checkout")
    place = built(checkout, "editable", tmp_path)
    answer = emitted_by(place, tmp_path)
    assert Path(answer["package"]).is_relative_to(checkout)
    assert Path(answer["templates"]) == checkout / "templates"
    assert answer["files"] == dict(translate(load_scene("chapter1")).emitted.files)
    support = checkout / "templates" / "support" / "grid.h"
    support.write_text(support.read_text() + "/* edited */\n")
    assert emitted_by(place, tmp_path)["files"]["grid.h"].endswith("/* edited */\n")


def test_the_version_is_said_in_one_place() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "symrender_cg.version.VERSION"}
