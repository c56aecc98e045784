"""Images block by block: the bits of render_image, at a memory that does not grow with the height of the image."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluators import same_bits, scene_of

from symrender_cg import Camera, PointLight, Scene, Sphere, render_blocks, render_image
from symrender_cg.errors import ArgumentError, SceneError
from symrender_cg.run import blocks, ready, settled_rows, threads
from symrender_cg.run.threads import block_ends

CAMERA = Camera((0.0, 0.0, 6.0), half_height=1.5)
PAIR = (Sphere((-0.5, 0.0, 0.0), 0.5), Sphere((0.6, 0.1, 0.3), 0.5))
WHITE = PointLight((9.0, 9.0, 6.0), (1.0, 1.0, 1.0))

SCENES: dict[str, Scene] = {
    "one sphere": scene_of("off_axis_sphere"),
    "two spheres": Scene(CAMERA, PAIR, (PointLight((9.0, 9.0, 6.0)),)),
    "grey in colours": Scene(CAMERA, PAIR[:1], (WHITE,)),
    "colours": Scene(CAMERA, PAIR, (PointLight((9.0, 9.0, 6.0), (1.0, 0.5, 0.0)),)),
    "light at hand": Scene.chapter1(light=(0.5, 0.5, 1.2)),
}
"""One of each way to draw: straight into the array, with lists of spheres, by a canvas, in channels, in stages."""


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("block_rows", [1, 5, 16, 23, 100, None])
def test_the_blocks_are_the_rows_of_the_image(name: str, block_rows: int | None) -> None:
    scene = SCENES[name]
    whole = render_image(scene, 19, 23, clip=False)
    expected = 0
    for first, rows in render_blocks(scene, 19, 23, block_rows=block_rows, clip=False, threads=2):
        assert first == expected
        assert rows.dtype == whole.dtype
        assert rows.flags.c_contiguous
        assert same_bits(rows, np.ascontiguousarray(whole[first : first + len(rows)]))
        assert len(rows) == min(23 - first, block_rows or 23)
        expected += len(rows)
    assert expected == 23


@pytest.mark.parametrize(
    ("accuracy", "target"),
    [
        ("literal", None),
        ("single", None),
        ("fast", None),
        ("stable", None),
        ("certified", "float64"),
        ("certified", "uint8"),
    ],
)
def test_every_level_has_the_bits_of_the_image_in_its_blocks(accuracy: str, target: str | None) -> None:
    whole = render_image(None, 20, 17, accuracy=accuracy, target=target)
    found = render_blocks(None, 20, 17, accuracy=accuracy, target=target, block_rows=4)
    assert same_bits(np.concatenate([rows for _, rows in found]), whole)


def test_blocks_are_drawn_when_they_are_asked_for() -> None:
    found = render_blocks(None, 8, 1 << 24, block_rows=2)
    assert next(found)[0] == 0
    first, rows = next(found)
    assert (first, rows.shape) == (2, (2, 8))


def test_blocks_may_be_kept() -> None:
    kept = [rows for _, rows in render_blocks(None, 8, 8, block_rows=2)]
    assert not any(np.shares_memory(a, b) for a in kept for b in kept if a is not b)
    assert same_bits(np.concatenate(kept), render_image(None, 8, 8))


@pytest.mark.parametrize("block_rows", [0, -1, 2.0, True, "4"])
def test_a_number_of_rows_that_is_none_is_refused_before_any_block(block_rows: Any) -> None:
    with pytest.raises(
        ArgumentError, match=r"block_rows: .* is not a number of rows; expected a whole number from 1 up"
    ):
        render_blocks(None, 8, 8, block_rows=block_rows)


def test_other_arguments_are_refused_before_any_block() -> None:
    with pytest.raises(ArgumentError, match="height: 0"):
        render_blocks(None, 8, 0)
    with pytest.raises(ArgumentError, match="threads"):
        render_blocks(None, 8, 8, threads=0)
    with pytest.raises(SceneError):
        render_blocks("no such scene", 8, 8)


# ---- memory

WIDTH, SHORT, TALL = 64, 1024, 8192


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Blocks of 8,192 pixels where two million are usual, so that an image of many blocks is drawn in a moment."""
    for module in (settled_rows, ready, threads):
        monkeypatch.setattr(module, "MOST_PIXELS", 1 << 13)
    monkeypatch.setattr(blocks, "PIXELS_A_BLOCK", 1 << 13)
    block_ends.cache_clear()
    yield
    block_ends.cache_clear()


def peak(call: Callable[[], object]) -> int:
    """The most memory, in bytes, that Python and numpy held at once during a call, beyond what they held before it."""
    call()
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        call()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", SCENES)
def test_the_memory_of_blocks_does_not_grow_with_the_height(name: str, small_blocks: None) -> None:
    def all_blocks(height: int) -> None:
        for _first, _rows in render_blocks(SCENES[name], WIDTH, height, threads=1):
            pass

    short, tall = peak(lambda: all_blocks(SHORT)), peak(lambda: all_blocks(TALL))
    assert tall < 1.3 * short + 10_000
    assert tall < 8 * WIDTH * TALL


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("strided", [False, True])
def test_an_image_into_a_file_takes_no_memory_of_its_own(
    name: str, strided: bool, small_blocks: None, tmp_path: Path
) -> None:
    """Also where the kernel cannot write to the file's memory itself: every other column, grey for three channels."""
    scene = SCENES[name]
    channels = (3,) if scene.channels == 3 else ()

    def into_file(height: int) -> int:
        shape = (height, 2 * WIDTH if strided else WIDTH, *channels)
        file = np.lib.format.open_memmap(tmp_path / "image.npy", mode="w+", dtype=np.float64, shape=shape)
        out = file[:, ::2] if strided else file
        return peak(lambda: render_image(scene, WIDTH, height, out=out, threads=1))

    short, tall = into_file(SHORT), into_file(TALL)
    assert tall < 1.3 * short + 10_000
    assert tall < 8 * WIDTH * TALL
    kept = np.load(tmp_path / "image.npy", mmap_mode="r")[:, ::2] if strided else np.load(tmp_path / "image.npy")
    assert same_bits(np.ascontiguousarray(kept), render_image(scene, WIDTH, TALL))


def test_an_array_that_is_returned_is_all_the_memory_that_an_image_takes() -> None:
    size = 8 * 512 * 512
    assert size <= peak(lambda: render_image(None, 512, 512)) < 1.1 * size
