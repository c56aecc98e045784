"""Laws of `render`: the file holds render_image's pixels, errors come before work, a warm start loads little."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import LOADED_AFTER, Shell, in_a_process
from evaluators import PROVED
from PIL import Image

from symrender_cg import Scene, render_image, render_layers
from symrender_cg.cli import layers, parser, progress, render
from symrender_cg.errors import AccuracyError
from symrender_cg.reference import oracle
from symrender_cg.run import certify as certify_module
from symrender_cg.run.render import certify

GREY = ("--accuracy", "certified", "--target", "uint8")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.mark.parametrize("accuracy", ["literal", "fast", "single", "double"])
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


@pytest.mark.parametrize("accuracy", ["literal", "fast", "single", "double"])
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
        (("-o", "a.jpg"), "the extension '.jpg' names no image format; expected one of .png, .npy, .npz, .pfm"),
        (("-o", "a"), "the extension '' names no image format"),
        (("-o", "a.png", "--no-clip"), "--no-clip: a .png cannot hold intensities above 1; write a .npy, .npz or .pfm"),
        (("-o", "a.npy", "--bits", "16"), "bits: 16 has no meaning for .npy"),
        (("-o", "a.pfm", "--encoding", "linear"), "encoding: linear has no meaning for .pfm"),
        (("-o", "missing/a.png"), "its folder does not exist"),
        (("-o", "folder.png"), "is a folder"),
        (("-o", "a.png", "--layers", "depth", "--backend", "numpy"), "leave --backend numpy out"),
        (("-o", "a.png", "--threads", "0"), "threads: 0 is not a number of threads"),
        (("-o", "a.png", "--size", "16777216x16777216"), "does not fit into memory; render a smaller one"),
        (("-o", "a.png", "--target", "uint8"), "target: 'uint8' is for accuracy='certified', not for 'double'"),
        ((*GREY, "-o", "a.png", "--encoding", "srgb"), "encoding: 'srgb' would round grey levels a second time"),
        ((*GREY, "-o", "a.png", "--bits", "16"), "bits: 16 has no meaning for grey levels of 0 to 255"),
        ((*GREY, "-o", "a.pfm"), "a.pfm: a .pfm holds floats, not grey levels of 0 to 255; write a .png, .npy or .npz"),
        ((*GREY, "-o", "a.npy", "--no-clip"), "--no-clip: grey levels end at 255"),
        (
            ("-o", "a.npy", "--accuracy", "stable", "--layers", "all"),
            "--layers: accuracy stable proves the image alone",
        ),
        (("-o", "a.npy", "--accuracy", "certified", "--backend", "numpy"), "certified is proved by native kernels"),
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
    with progress.Progress(200, "rendering", "rows") as bar:
        bar.done(50)
        assert screen.getvalue() == ""
        monkeypatch.setattr(progress, "BAR_AFTER_SECONDS", -1.0)
        bar.done(50)
        bar.now("writing a.png")
    assert "of 200 rows" in screen.getvalue()


def test_no_bar_is_drawn_where_no_terminal_is(shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "BAR_AFTER_SECONDS", -1.0)
    answer = shell("render", "-o", tmp_path / "a.npy", "--size", "16x16")
    assert answer.code == 0
    assert answer.err == ""


SCENES = ("two_spheres", "mirrors")


@pytest.mark.parametrize("scene", SCENES)
def test_scenes_are_rendered_bit_for_bit_as_by_render_image(
    shell: Shell, tmp_path: Path, scene: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render, "PIXELS_A_BLOCK", 300)
    path = tmp_path / "a.npy"
    assert shell("render", scene, "-o", path, "--size", "47x31", "--no-clip", "--threads", "2").code == 0
    expected = render_image(scene, 47, 31, clip=False)
    assert expected.ndim == (3 if scene == "mirrors" else 2)
    assert np.array_equal(np.load(path), expected)


def test_the_numpy_backend_renders_scenes_too(shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(render, "PIXELS_A_BLOCK", 300)
    answer = shell("render", "mirrors", "-o", tmp_path / "a.npy", "--size", "31x20", "--backend", "numpy")
    assert answer.code == 0
    assert np.abs(np.load(tmp_path / "a.npy") - render_image("mirrors", 31, 20)).max() < 1e-11


def test_colours_that_are_all_grey_are_written_as_rgb(shell: Shell, tmp_path: Path) -> None:
    text = "[camera]\nhalf_height = 2.0\n[[spheres]]\n[spheres.material]\nambient = [0.25, 0.25, 0.25]\n"
    (tmp_path / "grey.toml").write_text(text)
    answer = shell("render", tmp_path / "grey.toml", "-o", tmp_path / "a.npy", "--size", "20x16")
    assert answer.code == 0
    image = np.load(tmp_path / "a.npy")
    assert image.shape == (16, 20, 3)
    assert np.array_equal(image, render_image(tmp_path / "grey.toml", 20, 16))
    assert (image == image[..., :1]).all()


@pytest.mark.parametrize("scene", ["chapter1", "mirrors"])
def test_an_npz_holds_the_layers_of_render_layers(shell: Shell, tmp_path: Path, scene: str) -> None:
    path = tmp_path / "a.npz"
    answer = shell("render", scene, "-o", path, "--size", "40x30", "--layers", "all", "--no-clip")
    assert answer.code == 0
    expected = render_layers(scene, 40, 30)
    with np.load(path) as held:
        assert set(held) == set(expected)
        assert all(np.array_equal(held[name], array) for name, array in expected.items())
        names = ("background", "ambient", "reflected")
        total = sum(held[name] for name in names) + held["diffuse"].sum(axis=0) + held["specular"].sum(axis=0)
        assert np.abs(total - held["image"]).max() < 1e-14
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_layers_stand_beside_the_image_a_file_each(shell: Shell, tmp_path: Path) -> None:
    answer = shell("render", "lights", "-o", tmp_path / "a.npy", "--size", "24x18", "--layers", "depth,index,terms")
    assert answer.code == 0
    lights = range(len(Scene.builtin("lights").lights))
    of_lights = {f"a-{term}-{light}.npy" for term in ("diffuse", "specular") for light in lights}
    alone = {"a.npy", "a-depth.npy", "a-index.npy", "a-background.npy", "a-ambient.npy", "a-reflected.npy"}
    assert {path.name for path in tmp_path.iterdir()} == alone | of_lights
    found = render_layers("lights", 24, 18)
    assert np.array_equal(np.load(tmp_path / "a-depth.npy"), found["depth"])
    assert np.load(tmp_path / "a-index.npy").dtype == np.int32
    assert np.array_equal(np.load(tmp_path / "a-specular-1.npy"), found["specular"][1])
    assert all(str(tmp_path / name) in answer.out for name in alone | of_lights)


def test_pictures_of_layers_show_what_they_say(shell: Shell, tmp_path: Path) -> None:
    words = ("mirrors", "-o", tmp_path / "a.png", "--size", "60x45", "--layers", "depth,normal,index")
    assert shell("render", *words).code == 0
    found = render_layers("mirrors", 60, 45, layers=("depth", "normal", "index"))
    seen = found["index"] >= 0
    assert 0 < seen.sum() < seen.size
    depth, normal, index = (np.asarray(Image.open(tmp_path / f"a-{name}.png")) for name in ("depth", "normal", "index"))
    assert depth.max() == 255
    assert ((depth > 0) == seen).all()
    order = np.argsort(found["depth"][seen])
    assert (np.diff(depth[seen][order].astype(int)) <= 0).all()
    assert np.abs(normal[seen] / 127.5 - 1.0 - found["normal"][seen]).max() < 1.0 / 255.0 + 1e-12
    assert (normal[~seen] == 0).all()
    colours = {tuple(index[found["index"] == k][0].tolist()) for k in np.unique(found["index"])}
    assert len(colours) == len(np.unique(found["index"]))
    assert all((index[found["index"] == k] == index[found["index"] == k][0]).all() for k in np.unique(found["index"]))


def test_pictures_of_nothing_are_black() -> None:
    nothing = np.full((2, 3), np.inf)
    assert (layers.depth_picture(nothing)[0] == 0.0).all()
    assert (layers.normal_picture(np.zeros((2, 3, 3)))[0] == 0.0).all()
    assert (layers.index_picture(np.full((2, 3), -1))[0] == 0.0).all()
    assert (layers.depth_picture(np.full((2, 3), 7.0))[0] == 1.0).all()


@pytest.mark.parametrize(
    ("text", "chosen"),
    [
        (("all",), layers.LAYERS),
        (("index", "depth"), ("depth", "index")),
        (("terms",), ("background", "ambient", "reflected", "diffuse", "specular")),
    ],
)
def test_names_of_layers_stand_for_those_of_render_layers(text: tuple[str, ...], chosen: tuple[str, ...]) -> None:
    assert layers.chosen_layers(text) == chosen
    assert parser.LAYERS == layers.LAYERS


# --------------------------------------------------------------------------------------- levels that prove their values


@pytest.mark.parametrize(("accuracy", "target"), PROVED)
@pytest.mark.parametrize("scene", ["chapter1", "two_spheres"])
def test_what_is_proved_is_written_as_render_image_gives_it(
    shell: Shell, tmp_path: Path, scene: str, accuracy: str, target: str | None
) -> None:
    path = tmp_path / "a.npy"
    rounding = () if target is None else ("--target", target)
    answer = shell("render", scene, "-o", path, "--size", "37x29", "--accuracy", accuracy, *rounding)
    assert answer.code == 0
    expected = render_image(scene, 37, 29, accuracy=accuracy, target=target)
    assert np.array_equal(np.load(path), expected)
    assert np.load(path).dtype == expected.dtype
    first, certificate = answer.out.splitlines()
    assert first.startswith(f"{path}: 37 x 29, numpy array, linear; {' '.join(filter(None, (accuracy, target)))}, ")
    assert f"{'centred_sphere' if scene == 'chapter1' else 'scene_enclosure'}" in first
    if target is not None:
        assert certificate == str(certify(scene, 37, 29, target=target).certificate)
    else:
        assert certificate.startswith("within 4 ulp at all 1,073: ")


def test_no_clip_keeps_what_is_proved_above_1(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    assert shell("render", "-o", path, "--size", "40x40", "--accuracy", "stable", "--no-clip").code == 0
    assert np.load(path).max() > 1.2
    assert np.array_equal(np.load(path), render_image(None, 40, 40, accuracy="stable", clip=False))


@pytest.mark.parametrize("scene", ["chapter1", "lights"])
def test_certified_grey_levels_reach_the_picture_as_they_are(shell: Shell, tmp_path: Path, scene: str) -> None:
    path = tmp_path / "a.png"
    answer = shell("render", scene, "-o", path, "--size", "40x30", *GREY)
    assert answer.code == 0
    levels = certify(scene, 40, 30, target="uint8").values
    assert levels.dtype == np.uint8
    assert levels.max() == 255
    picture = Image.open(path)
    assert np.array_equal(np.asarray(picture), levels)
    assert picture.info["gamma"] == 1.0
    kind = "grey" if levels.ndim == 2 else "RGB"
    assert f"40 x 30, 8 bit {kind}, linear; certified uint8, " in answer.out
    assert "the right grey level at all 1,200: " in answer.out


def test_grey_levels_in_a_npz_are_whole_numbers(shell: Shell, tmp_path: Path) -> None:
    assert shell("render", "-o", tmp_path / "a.npz", "--size", "20x20", *GREY).code == 0
    with np.load(tmp_path / "a.npz") as held:
        assert np.array_equal(held["image"], render_image(None, 20, 20, accuracy="certified", target="uint8"))
        assert held["image"].dtype == np.uint8


def test_double_says_where_the_compensated_kernel_draws_in_its_place(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    answer = shell("render", "grazing_light", "-o", path, "--size", "24x24")
    assert answer.code == 0
    first, second = answer.out.splitlines()
    assert "; double, drawn by the compensated kernel: centred_sphere_gated_stable " in first
    assert second.startswith("plain float64 may be off by more than 1e-15 in this scene; within 4 ulp at all 576: ")
    assert np.array_equal(np.load(path), render_image("grazing_light", 24, 24, accuracy="stable"))
    assert len(shell("render", "-o", path, "--size", "24x24").out.splitlines()) == 1


def test_a_certificate_that_cannot_be_given_names_the_pixels_with_exit_code_4(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def undecided(scene: Scene, x: Any, y: Any, target: str) -> Any:
        raise AccuracyError("two values are open", (0, 13))

    def nothing(job: Any, points: Any, places: Any, threads: Any = None, kernel: Any = None) -> Any:
        return np.zeros((places.size, 1)), np.zeros(places.size, dtype=bool), 0.0

    monkeypatch.setattr(certify_module, "_enclosed", nothing)
    monkeypatch.setattr(oracle, "settle", undecided)
    answer = shell("render", "two_spheres", "-o", tmp_path / "a.npy", "--size", "12x10", "--accuracy", "certified")
    assert answer.code == 4
    assert "2 of 120 values are not settled: column 0, row 0; column 1, row 1; " in answer.err
    assert "move the scene or the camera by one float" in answer.err
    assert list(tmp_path.iterdir()) == []


def test_a_warm_start_of_what_is_proved_loads_no_sympy_either(tmp_path: Path) -> None:
    words = ("render", "off_axis", "-o", tmp_path / "a.png", "--size", "64x64", *GREY)
    assert in_a_process(*words).code == 0
    answer = in_a_process(*words, code=LOADED_AFTER)
    assert answer.code == 0, answer.err
    assert answer.out.splitlines()[-1] == "loaded:"
