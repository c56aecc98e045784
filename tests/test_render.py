"""`render_image` and `evaluate`: shapes, types, pixels, `out=`, every backend, and every way to be refused."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluators import ACCURACIES, EXACT, GEOMETRIES, MARKER, STRUCTURES, modest, same_bits, scene_of, with_background
from hypothesis import given
from hypothesis import strategies as st
from strategies import nasty_scenes, ordinary_scenes

from symrender_cg import evaluate, render_image
from symrender_cg.errors import ArgumentError, CompilerNotFoundError, OutsidePlanError, SceneError, SymrenderError
from symrender_cg.reference import oracle, points
from symrender_cg.reference.per_pixel import render_per_pixel
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

ROOT = Path(__file__).resolve().parents[1]
DTYPES = {"literal": np.float64, "double": np.float64, "single": np.float32}
SIZES = [(1, 1), (2, 1), (1, 7), (7, 5), (33, 17), (257, 3), (300, 2)]
"""(width, height): one pixel, one row, one column, odd, wider than a block of points."""


def grid(scene: Scene, width: int, height: int) -> tuple[Any, Any]:
    columns, rows = points.pixel_centres(scene, width, height)
    return columns[np.newaxis, :], rows[:, np.newaxis]


# ---- the image


def test_without_arguments_it_is_chapter_1_at_256_by_256() -> None:
    image = render_image()
    assert image.shape == (256, 256)
    assert image.dtype == np.float64
    assert same_bits(image, render_image(Scene.chapter1(), 256, 256, accuracy="double"))
    assert same_bits(image, render_image("chapter1"))
    assert (float(image.min()), float(image.max())) == (0.0, 1.0)


def test_chapter_1_is_the_picture_of_the_seed() -> None:
    """399 pixels above white, the brightest 1.2537, 32,928 hits, and Cell 1's values within 5.2e-14 (golden)."""
    image = render_image(clip=False)
    assert np.count_nonzero(image > 1.0) == 399
    assert round(float(image.max()), 4) == 1.2537
    assert np.count_nonzero(image) == 32928
    small = render_image(width=48, height=48)
    assert np.abs(small - render_per_pixel(Scene.chapter1(), 48, 48)).max() < 1e-13


def test_row_0_is_the_top_and_column_0_the_left() -> None:
    image = render_image(Scene.chapter1(light=(-3.0, 6.0, 4.0)), 64, 64)
    y, x = np.unravel_index(int(np.argmax(image)), image.shape)
    assert y < 32
    assert x < 32


def test_pixels_are_square_and_the_camera_sets_the_height() -> None:
    square, wide = render_image(None, 64, 64, clip=False), render_image(None, 128, 64, clip=False)
    tall = render_image(None, 32, 64, clip=False)
    assert same_bits(np.ascontiguousarray(wide[:, 32:96]), square)
    assert same_bits(np.ascontiguousarray(square[:, 16:48]), tall)


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_an_image_is_evaluate_on_the_pixel_centres_bit_for_bit(name: str, accuracy: str) -> None:
    """In single within units of the last place: rows count their pixels in float32."""
    scene = with_background(STRUCTURES[name], 0.25)
    for width, height in SIZES:
        image = render_image(scene, width, height, accuracy=accuracy, clip=False)
        assert image.shape == (height, width)
        assert image.dtype == DTYPES[accuracy]
        values = evaluate(scene, *grid(scene, width, height), accuracy=accuracy)
        assert np.max(np.abs(image - values)) < 3e-6 if accuracy == "single" else same_bits(image, values)


@modest(40)
@given(st.one_of(ordinary_scenes(), nasty_scenes()), st.integers(1, 40), st.integers(1, 40), st.sampled_from(EXACT))
def test_an_image_of_any_scene_has_its_hits_where_the_oracle_has_them(
    scene: Scene, width: int, height: int, accuracy: str
) -> None:
    """The span of each row, settled at its ends, is every hit and only hits."""
    marked = with_background(scene, MARKER)
    image = render_image(marked, width, height, accuracy=accuracy, clip=False)
    assert np.array_equal(image != MARKER, oracle.hits(scene, *grid(scene, width, height)))
    values = evaluate(marked, *grid(scene, width, height), accuracy=accuracy)
    assert np.array_equal(image != MARKER, values != MARKER) if accuracy == "single" else same_bits(image, values)


@pytest.mark.parametrize("accuracy", EXACT)
@pytest.mark.parametrize("zoom", [2.0**-40, 2.0**-20, 1e-3, 1.0, 1e3, 2.0**20])
def test_the_spans_are_right_at_any_zoom(accuracy: str, zoom: float) -> None:
    """From pixels far smaller than the sphere, all or none of them hit, to a sphere smaller than a pixel."""
    for center in ((0.0, 0.0, 0.0), (0.3, 0.1, -1.0)):
        scene = Scene(Camera(half_height=zoom), (Sphere(center),), background=MARKER)
        for width, height in ((31, 9), (8, 8)):
            image = render_image(scene, width, height, accuracy=accuracy, clip=False)
            assert np.array_equal(image != MARKER, oracle.hits(scene, *grid(scene, width, height)))


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_clipping_cuts_at_white_and_changes_nothing_else(accuracy: str, geometry: str) -> None:
    scene = with_background(scene_of(geometry, Phong(0.4, 0.9, 0.9, 4.0)), 1.75)
    field = render_image(scene, 40, 30, accuracy=accuracy, clip=False)
    assert field.max() > 1.0
    picture = render_image(scene, 40, 30, accuracy=accuracy)
    assert same_bits(picture, np.clip(field, 0.0, 1.0).astype(field.dtype))
    values = evaluate(scene, *grid(scene, 40, 30), accuracy=accuracy)
    assert same_bits(
        evaluate(scene, *grid(scene, 40, 30), accuracy=accuracy, clip=True),
        np.clip(values, 0.0, 1.0).astype(field.dtype),
    )


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_a_baked_image_agrees_and_a_portable_one_is_the_same(accuracy: str) -> None:
    scene = scene_of("off_axis_sphere")
    image = render_image(scene, 40, 30, accuracy=accuracy, clip=False)
    baked = render_image(scene, 40, 30, accuracy=accuracy, clip=False, bake=True)
    portable = render_image(scene, 40, 30, accuracy=accuracy, clip=False, portable=True)
    assert np.abs(image - baked).max() < {"single": 2e-6}.get(accuracy, 2e-13)
    assert np.array_equal(image == 0.0, baked == 0.0)
    assert same_bits(image, portable)


def test_a_scene_can_be_given_by_name_or_by_file(tmp_path: Path) -> None:
    scene = scene_of("off_axis_sphere")
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    image = render_image(scene, 16, 12)
    assert same_bits(render_image(path, 16, 12), image)
    assert same_bits(render_image(str(path), 16, 12), image)
    assert float(evaluate(path, 0.5, 0.25)) == float(evaluate(scene, 0.5, 0.25))


# ---- out=


def test_out_is_written_and_returned() -> None:
    out = np.full((12, 16), math.nan)
    assert render_image(None, 16, 12, out=out) is out
    assert same_bits(out, render_image(None, 16, 12))


VIEWS: dict[str, Callable[[Any], Any]] = {
    "slice": lambda big: big[3:15, 5:21],
    "every second row": lambda big: big[:24:2, :16],
    "every third column": lambda big: big[:12, :48:3],
    "upside down": lambda big: big[11::-1, :16],
    "mirrored": lambda big: big[:12, 15::-1],
    "both": lambda big: big[11::-1, 15::-1],
    "transposed": lambda big: big[:16, :12].T,
    "column major": lambda big: np.asfortranarray(big)[:12, :16],
    "one of several channels": lambda big: big.reshape(40, 10, 6)[:12, :, :].reshape(12, 60)[:, :16],
}


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("accuracy", ["double", "single"])
def test_out_may_have_any_strides_and_nothing_beside_it_is_touched(view: str, accuracy: str) -> None:
    big = np.full((40, 60), math.nan, dtype=DTYPES[accuracy])
    out = VIEWS[view](big)
    assert out.shape == (12, 16)
    assert render_image(None, 16, 12, accuracy=accuracy, out=out) is out
    assert same_bits(np.ascontiguousarray(out), render_image(None, 16, 12, accuracy=accuracy))
    if np.shares_memory(out, big):
        assert np.isnan(big).sum() == big.size - out.size


def test_out_may_lie_at_an_odd_address() -> None:
    raw = np.zeros(12 * 16 * 8 + 1, dtype=np.uint8)
    out = raw[1:].view(np.float64).reshape(12, 16)
    assert not out.flags.aligned
    assert same_bits(np.ascontiguousarray(render_image(None, 16, 12, out=out)), render_image(None, 16, 12))


OUT_REFUSED: dict[str, tuple[Any, str]] = {
    "a list": ([[0.0]], r"out: expected a numpy array of shape \(12, 16\) and dtype float64, not list"),
    "a shape": (np.zeros((16, 12)), r"out: has shape \(16, 12\); expected \(height, width\) = \(12, 16\)"),
    "a third axis": (np.zeros((12, 16, 1)), r"out: has shape \(12, 16, 1\)"),
    "a dtype": (np.zeros((12, 16), np.float32), "out: has dtype float32; this accuracy writes float64"),
    "bytes swapped": (np.zeros((12, 16), ">f8"), "out: has dtype >f8; this accuracy writes float64"),
    "read-only": (np.broadcast_to(0.0, (12, 16)), "out: is read-only; pass an array that can be written to"),
}


@pytest.mark.parametrize("case", OUT_REFUSED)
@pytest.mark.parametrize("backend", ["native", "numpy"])
def test_an_out_that_cannot_take_the_image_is_refused(case: str, backend: str) -> None:
    out, message = OUT_REFUSED[case]
    with pytest.raises(ArgumentError, match=message) as caught:
        render_image(None, 16, 12, out=out, backend=backend)
    assert caught.value.exit_code == 2


# ---- evaluate


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_points_broadcast_and_keep_their_shape(accuracy: str) -> None:
    x, y = np.linspace(-1.0, 1.0, 7), np.linspace(-1.0, 1.0, 5)
    values = evaluate(None, x, y[:, np.newaxis], accuracy=accuracy)
    assert values.shape == (5, 7)
    assert values.dtype == DTYPES[accuracy]
    for j in range(5):
        assert same_bits(values[j], evaluate(None, x, float(y[j]), accuracy=accuracy))
    assert evaluate(None, 0.0, 0.0, accuracy=accuracy).shape == ()
    assert evaluate(None, [], [], accuracy=accuracy).shape == (0,)
    assert evaluate(None, np.zeros((0, 3)), 0.0, accuracy=accuracy).shape == (0, 3)
    assert evaluate(None, np.zeros((2, 1, 3)), np.zeros((4, 1)), accuracy=accuracy).shape == (2, 4, 3)


def test_points_may_be_numbers_of_any_real_kind() -> None:
    expected = evaluate(None, [0.0, 1.0], [0.0, 0.0])
    for x in ([0, 1], (0.0, 1.0), np.array([0, 1], np.int8), np.array([0, 1], np.uint64), np.array([0, 1], np.float32)):
        assert same_bits(evaluate(None, x, 0), expected)
    backwards = np.arange(100, dtype=np.float64)[::-1][:99:98]
    assert same_bits(evaluate(None, backwards / 99.0, 0.0), evaluate(None, [1.0, 1.0 / 99.0], 0.0))


def test_more_points_than_a_block_are_all_evaluated() -> None:
    x, y = np.random.default_rng(2).uniform(-1.5, 1.5, (2, 1025))
    values = evaluate(None, x, y)
    assert same_bits(values, np.array([float(evaluate(None, u, v)) for u, v in zip(x, y, strict=True)]))


POINTS_REFUSED: dict[str, tuple[Any, Any, str]] = {
    "nan": (math.nan, 0.0, "x: nan is not a point; expected finite coordinates"),
    "infinity": ([0.0, 1.0], [0.0, math.inf], r"y\[1\]: inf is not a point; expected finite coordinates"),
    "nan in two axes": (np.array([[0.0, 1.0], [math.nan, 0.0]]), 0.0, r"x\[1, 0\]: nan is not a point"),
    "text": ("left", 0.0, "x: expected real numbers, not an array of <U4"),
    "complex": (1j, 0.0, "x: expected real numbers, not an array of complex128"),
    "truth": (0.0, [True], "y: expected real numbers, not an array of bool"),
    "objects": ([None], 0.0, "x: expected real numbers, not an array of object"),
}


@pytest.mark.parametrize("case", POINTS_REFUSED)
@pytest.mark.parametrize("backend", ["native", "numpy"])
def test_what_is_no_point_is_refused_with_its_place(case: str, backend: str) -> None:
    x, y, message = POINTS_REFUSED[case]
    with pytest.raises(ArgumentError, match=message):
        evaluate(None, x, y, backend=backend)


def test_points_that_do_not_broadcast_are_refused() -> None:
    with pytest.raises(ArgumentError, match=r"x and y: shapes \(3,\) and \(4,\) do not broadcast"):
        evaluate(None, np.zeros(3), np.zeros(4))


# ---- other arguments


@pytest.mark.parametrize("value", [0, -1, 1.5, "64", None, True, (1 << 24) + 1, math.nan])
@pytest.mark.parametrize("name", ["width", "height"])
def test_a_size_that_is_none_is_refused(name: str, value: Any) -> None:
    message = f"{name}: .* is not a number of pixels; expected a whole number from 1 to {1 << 24}"
    with pytest.raises(ArgumentError, match=message):
        render_image(None, **{"width": 8, "height": 8, name: value})


def test_numpy_integers_are_sizes() -> None:
    sizes: Any = (np.int64(5), np.uint8(3))
    assert render_image(None, *sizes).shape == (3, 5)


@pytest.mark.parametrize("backend", ["native", "numpy"])
def test_an_unknown_accuracy_is_refused_with_the_known_ones(backend: str) -> None:
    message = "accuracy: 'triple' is not known; expected one of "
    with pytest.raises(ArgumentError, match=message) as caught:
        render_image(None, 8, 8, accuracy="triple", backend=backend)
    assert all(repr(name) in str(caught.value) for name in ACCURACIES)
    with pytest.raises(ArgumentError, match=message):
        evaluate(None, 0.0, 0.0, accuracy="triple", backend=backend)


@pytest.mark.parametrize(
    "call", [lambda b: render_image(None, 8, 8, backend=b), lambda b: evaluate(None, 0, 0, backend=b)]
)
def test_an_unknown_backend_is_refused(call: Any) -> None:
    with pytest.raises(ArgumentError, match="backend: 'cuda' is not known; expected 'native' or 'numpy'"):
        call("cuda")


@pytest.mark.parametrize("backend", ["native", "numpy"])
def test_a_scene_without_an_image_is_refused(backend: str) -> None:
    with pytest.raises(SceneError, match="no_such_scene"):
        render_image("no_such_scene", 8, 8, backend=backend)
    two = Scene(spheres=(Sphere(), Sphere((3.0, 0.0, 0.0))))
    with pytest.raises(OutsidePlanError, match="one sphere under one light"):
        render_image(two, 8, 8, accuracy="literal", backend=backend)


@pytest.mark.parametrize("scene", [3, [1, 2], object(), b"chapter1"], ids=lambda value: type(value).__name__)
def test_what_is_no_scene_is_refused_by_an_error_of_ours(scene: Any) -> None:
    with pytest.raises(SymrenderError):
        render_image(scene, 8, 8)


# ---- the numpy backend


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_the_numpy_backend_agrees_and_needs_no_kernel(accuracy: str, geometry: str, tmp_path: Path) -> None:
    scene = scene_of(geometry)
    native = render_image(scene, 60, 40, accuracy=accuracy, clip=False)
    numpy = render_image(scene, 60, 40, accuracy=accuracy, clip=False, backend="numpy", cache=tmp_path)
    assert numpy.dtype == native.dtype
    assert numpy.shape == native.shape
    assert np.abs(native - numpy).max() < {"single": 2e-6, "literal": 2e-13}.get(accuracy, 1e-14)
    assert np.array_equal(native == 0.0, numpy == 0.0)
    assert list(tmp_path.iterdir()) == []
    clipped = evaluate(scene, *grid(scene, 60, 40), accuracy=accuracy, clip=True, backend="numpy")
    assert same_bits(clipped, np.clip(numpy, 0.0, 1.0).astype(numpy.dtype))


NO_COMPILER = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
import numpy as np
from symrender_cg import evaluate, render_image
from symrender_cg.errors import CompilerNotFoundError
image = render_image(None, 32, 32, backend="numpy")
assert image.shape == (32, 32) and image.max() == 1.0
assert float(evaluate(None, 5.0, 5.0, backend="numpy")) == 0.0
try:
    render_image(None, 32, 32)
except CompilerNotFoundError as problem:
    print(problem, problem.exit_code)
else:
    print("compiled by what?")
"""


def test_without_a_compiler_numpy_draws_and_native_names_three_remedies(tmp_path: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key not in ("CC", "PATH")}
    environment |= {"PATH": str(tmp_path), "SYMRENDER_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, "-W", "error", "-c", NO_COMPILER]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for remedy in ("CC", "ziglang", 'backend="numpy"'):
        assert remedy in done.stdout
    assert done.stdout.rstrip().endswith(" 5")


def test_a_missing_compiler_is_forgotten_when_there_is_one_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setenv("PATH", str(tmp_path))
        patch.delenv("CC", raising=False)
        try:
            render_image(Scene.chapter1(), 8, 8, cache=tmp_path / "cache")
        except CompilerNotFoundError:
            pass
        else:
            pytest.skip("a compiler that needs no PATH is installed")
    assert render_image(Scene.chapter1(), 8, 8, cache=tmp_path / "cache").shape == (8, 8)


# ---- nothing is said that need not be


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_hard_scenes_are_drawn_without_a_warning(accuracy: str) -> None:
    scenes = [
        Scene.chapter1(eye=math.nextafter(1.0, 2.0), light=(1e300, 0.0, 1e300)),
        Scene.chapter1(shininess=1e300, light=(0.0, 0.0, 1.0)),
        Scene(
            Camera((0.0, 0.0, 1.0), half_height=1.0), (Sphere((1.0, 0.0, 1.0), 0.5),), (PointLight((0.0, 0.0, 1.0)),)
        ),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for scene in scenes:
            for backend in ("native", "numpy"):
                render_image(scene, 9, 9, accuracy=accuracy, backend=backend)
