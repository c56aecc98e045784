"""Laws of `render`: the file holds render_image's pixels, errors come before work, a warm start loads little."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import LOADED_AFTER, Shell, in_a_process
from PIL import Image

from symrender_cg import Scene, render_image
from symrender_cg.cli import render


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.mark.parametrize("accuracy", ["literal", "single", "double"])
@pytest.mark.parametrize("scene", ["chapter1", "off_axis"])
def test_npy_holds_the_image_of_render_image_bit_for_bit(
    shell: Shell, tmp_path: Path, scene: str, accuracy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render, "PIXELS_A_BLOCK", 300)  # many blocks, the last one short
    path = tmp_path / "a.npy"
    answer = shell(
        "render", scene, "-o", path, "--size", "67x41", "--accuracy", accuracy, "--no-clip", "--threads", "3"
    )
    assert answer.code == 0
    expected = render_image(scene, 67, 41, accuracy=accuracy, clip=False)
    assert np.array_equal(np.load(path), expected)
    assert np.load(path).dtype == expected.dtype


@pytest.mark.parametrize("accuracy", ["literal", "single", "double"])
def test_the_numpy_backend_writes_what_render_image_gives(
    shell: Shell, tmp_path: Path, accuracy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render, "PIXELS_A_BLOCK", 300)
    path = tmp_path / "a.npy"
    words = ("off_axis", "-o", path, "--size", "67x41", "--accuracy", accuracy, "--backend", "numpy")
    answer = shell("render", *words)
    assert answer.code == 0
    assert "numpy, rendered in" in answer.out
    expected = render_image("off_axis", 67, 41, accuracy=accuracy, backend="numpy")
    assert np.array_equal(np.load(path), expected)
    assert np.load(path).dtype == expected.dtype


def test_without_a_scene_chapter_1_is_rendered_at_512_x_512_in_8_bit_srgb(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    answer = shell("render", "-o", path)
    assert answer.code == 0
    assert f"{path}: 512 x 512, 8 bit grey, sRGB; double, centred_sphere_double" in answer.out
    levels = np.asarray(Image.open(path)).astype(int)
    assert levels.shape == (512, 512)
    assert levels.max() == 255
    image = render_image(Scene.chapter1(), 512, 512)
    assert ((levels == 0) == (image == 0.0)).all()


def test_a_scene_file_and_every_option_of_png_are_followed(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text("background = 0.5\n[[spheres]]\nradius = 0.5\n")
    path = tmp_path / "a.png"
    words = (tmp_path / "scene.toml", "-o", path, "--size", "40x30", "--bits", "16", "--encoding", "linear")
    answer = shell("render", *words)
    assert answer.code == 0
    assert "40 x 30, 16 bit grey, linear" in answer.out
    levels = np.asarray(Image.open(path)).astype(int)
    assert levels.shape == (30, 40)
    assert levels[0, 0] == 32768


def test_portable_kernels_render_too(shell: Shell, tmp_path: Path) -> None:
    answer = shell("render", "-o", tmp_path / "a.pfm", "--size", "16x16", "--portable", "--threads", "1")
    assert answer.code == 0
    assert "float32, linear" in answer.out


def test_list_names_each_built_in_scene_with_its_description(shell: Shell) -> None:
    answer = shell("render", "--list")
    assert answer.code == 0
    for name in Scene.builtin_names():
        assert any(line.startswith(f"{name} ") and len(line) > 40 for line in answer.out.splitlines())


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((), "-o FILE is missing"),
        (("-o", "a.jpg"), "the extension '.jpg' names no image format; expected one of .png, .npy, .pfm"),
        (("-o", "a"), "the extension '' names no image format"),
        (("-o", "a.png", "--no-clip"), "--no-clip: a .png cannot hold intensities above 1; write a .npy or .pfm"),
        (("-o", "a.npy", "--bits", "16"), "bits: 16 has no meaning for .npy"),
        (("-o", "a.pfm", "--encoding", "linear"), "encoding: linear has no meaning for .pfm"),
        (("-o", "missing/a.png"), "its folder does not exist"),
        (("-o", "folder.png"), "is a folder"),
        (("-o", "a.png", "--threads", "0"), "threads: 0 is not a number of threads"),
        (("-o", "a.png", "--size", "16777216x16777216"), "does not fit into memory; render a smaller one"),
    ],
)
def test_what_cannot_be_written_is_refused_and_leaves_no_file(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.png").mkdir()
    answer = shell("render", *words)
    assert answer.code == 2
    assert text in answer.err
    assert answer.err.startswith("symrender_cg: error: ")
    assert [path.name for path in tmp_path.iterdir()] == ["folder.png"]


def test_a_warm_start_loads_no_sympy_no_templates_and_no_rich(tmp_path: Path) -> None:
    words = ("render", "off_axis", "-o", tmp_path / "a.png", "--size", "64x64")
    assert in_a_process(*words).code == 0
    answer = in_a_process(*words, code=LOADED_AFTER)
    assert answer.code == 0, answer.err
    assert answer.out.splitlines()[-1] == "loaded:"
    assert "from the cache" in answer.out


def test_the_bar_shows_rows_on_a_terminal_after_a_second_and_not_before(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with render.Progress(200) as progress:
        progress.rows_done(50)
        assert screen.getvalue() == ""
        monkeypatch.setattr(render, "BAR_AFTER_SECONDS", -1.0)
        progress.rows_done(50)
        progress.writing("a.png")
    assert "of 200" in screen.getvalue()


def test_no_bar_is_drawn_where_no_terminal_is(shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(render, "BAR_AFTER_SECONDS", -1.0)
    answer = shell("render", "-o", tmp_path / "a.npy", "--size", "16x16")
    assert answer.code == 0
    assert answer.err == ""
