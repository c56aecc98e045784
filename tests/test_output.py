"""Laws of the image files: what is read back is what was to be written, and a file is whole or as it was."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from symrender_cg.errors import ArgumentError
from symrender_cg.output import image_format, quantise, replacing, srgb, write_arrays, write_image, write_levels

COLOURS = np.random.default_rng(5).uniform(-0.25, 1.25, (37, 53, 3))
RAMP = np.linspace(-0.25, 1.25, 61 * 47).reshape(47, 61)


def chunks(path: Path) -> dict[bytes, bytes]:
    """The chunks of a PNG by type, read without any library."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found, at = {}, 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        found[data[at + 4 : at + 8]] = data[at + 8 : at + 8 + length]
        at += 12 + length
    return found


def pfm(path: Path) -> np.ndarray:
    """The image of a PFM as its definition reads: rows from the bottom, little endian where the scale is negative."""
    kind, size, scale, data = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert float(scale) == -1.0
    return np.frombuffer(data, "<f4").reshape((height, width) if kind == b"Pf" else (height, width, 3))[::-1]


def srgb_decoded(level: np.ndarray, white: int) -> np.ndarray:
    """IEC 61966-2-1 from encoded to linear, written from its other direction."""
    value = level.astype(np.float64) / white
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("bits", [8, 16])
def test_linear_png_holds_the_nearest_level_of_each_intensity(tmp_path: Path, bits: int) -> None:
    path = tmp_path / "ramp.png"
    form = write_image(path, RAMP, bits=bits, encoding="linear")
    levels = np.asarray(Image.open(path)).astype(np.int64)
    white = 2**bits - 1
    assert levels.shape == RAMP.shape
    assert np.abs(levels - white * np.clip(RAMP, 0.0, 1.0)).max() <= 0.5
    assert levels.min() == 0
    assert levels.max() == white
    assert str(form) == f"{bits} bit grey, linear"


@pytest.mark.parametrize("bits", [8, 16])
def test_srgb_png_decodes_to_the_intensity_within_half_a_level(tmp_path: Path, bits: int) -> None:
    path = tmp_path / "ramp.png"
    write_image(path, RAMP, bits=bits, encoding="srgb")
    levels = np.asarray(Image.open(path)).astype(np.int64)
    white = 2**bits - 1
    below = srgb_decoded(np.maximum(levels - 0.501, 0.0), white)
    above = srgb_decoded(np.minimum(levels + 0.501, white), white)
    clipped = np.clip(RAMP, 0.0, 1.0)
    assert (below <= clipped).all()
    assert (clipped <= above).all()


def test_srgb_curve_has_the_values_of_the_standard() -> None:
    linear = np.array([0.0, 0.0031308, 0.18, 0.21404114048223255, 0.5, 1.0])
    encoded = np.array([0.0, 0.040449936, 0.46135612950044164, 0.5, 0.7353569830524495, 1.0])
    assert np.abs(srgb(linear) - encoded).max() < 1e-7
    assert (np.diff(srgb(np.linspace(0.0, 1.0, 10001))) > 0).all()


@pytest.mark.parametrize(("bits", "depth"), [(8, 8), (16, 16)])
def test_png_declares_its_encoding_and_depth(tmp_path: Path, bits: int, depth: int) -> None:
    path = tmp_path / "ramp.png"
    write_image(path, RAMP, bits=bits, encoding="linear")
    found = chunks(path)
    assert struct.unpack(">I", found[b"gAMA"]) == (100000,)
    assert b"sRGB" not in found
    assert found[b"IHDR"][8:10] == bytes([depth, 0])
    write_image(path, RAMP, bits=bits, encoding="srgb")
    found = chunks(path)
    assert found[b"sRGB"] == b"\0"
    assert struct.unpack(">I", found[b"gAMA"]) == (45455,)


def test_the_same_image_gives_the_same_bytes(tmp_path: Path) -> None:
    for suffix in (".png", ".npy", ".pfm"):
        first, second = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
        write_image(first, RAMP)
        write_image(second, RAMP)
        assert first.read_bytes() == second.read_bytes()


def test_large_images_are_quantised_block_by_block_as_in_one_piece() -> None:
    form = image_format("x.png", bits=16)
    values = np.random.default_rng(5).random((700, 1000))
    pieces = np.vstack([quantise(values[row : row + 1], form) for row in range(700)])
    assert np.array_equal(quantise(values, form), pieces)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_npy_gives_the_array_back_bit_for_bit(tmp_path: Path, dtype: type) -> None:
    values = RAMP.astype(dtype)
    path = tmp_path / "field.npy"
    write_image(path, values)
    read = np.load(path)
    assert read.dtype == dtype
    assert np.array_equal(read, values)


def test_pfm_gives_float32_back_with_row_0_at_the_top(tmp_path: Path) -> None:
    path = tmp_path / "field.pfm"
    write_image(path, RAMP[:, ::-1])
    assert np.array_equal(pfm(path), RAMP[:, ::-1].astype(np.float32))


def test_views_of_any_stride_are_written_as_they_look(tmp_path: Path) -> None:
    view = RAMP[::-2, ::3]
    for suffix in (".png", ".npy", ".pfm"):
        a, b = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
        write_image(a, view)
        write_image(b, np.ascontiguousarray(view))
        assert np.array_equal(np.load(a), view) if suffix == ".npy" else a.read_bytes() == b.read_bytes()


@pytest.mark.parametrize("name", ["out.jpg", "out", "out.png.txt"])
def test_an_unknown_extension_is_refused_with_the_list(name: str) -> None:
    with pytest.raises(ArgumentError, match=r"names no image format; expected one of \.png, \.npy, \.npz, \.pfm"):
        image_format(name)


@pytest.mark.parametrize(
    ("path", "options", "text"),
    [
        ("a.npy", {"bits": 8}, "bits: 8 has no meaning for .npy"),
        ("a.pfm", {"encoding": "srgb"}, "encoding: srgb has no meaning for .pfm"),
        ("a.png", {"bits": 12}, "bits: 12 is not offered; expected 8 or 16"),
        ("a.png", {"encoding": "gamma"}, "encoding: 'gamma' is not known; expected 'srgb' or 'linear'"),
    ],
)
def test_options_that_a_format_does_not_have_are_refused(path: str, options: dict[str, object], text: str) -> None:
    with pytest.raises(ArgumentError) as refusal:
        image_format(path, **options)  # type: ignore[arg-type]
    assert text in str(refusal.value)


@pytest.mark.parametrize("values", [np.zeros((2, 2), int), np.zeros(4), np.zeros((0, 3))])
def test_arrays_that_are_no_image_are_refused(tmp_path: Path, values: np.ndarray) -> None:
    with pytest.raises(ArgumentError, match=r"expected floating-point intensities of shape \(height, width\)"):
        write_image(tmp_path / "a.png", values)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_png_refuses_an_intensity_that_no_grey_stands_for(tmp_path: Path, bad: float) -> None:
    values = np.zeros((3, 4))
    values[1, 2] = bad
    with pytest.raises(ArgumentError, match=r"values\[1, 2\]: -?(nan|inf) has no grey level"):
        write_image(tmp_path / "a.png", values)
    assert not list(tmp_path.iterdir())
    write_image(tmp_path / "a.npy", values)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"old")

    def interrupted() -> None:
        with replacing(path) as file:
            file.write(b"half of it")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"missing/a\.npy: cannot be written: No such file or directory"):
        write_image(tmp_path / "missing" / "a.npy", RAMP)
    (tmp_path / "folder.npy").mkdir()
    with pytest.raises(ArgumentError, match=r"folder\.npy: cannot be written"):
        write_image(tmp_path / "folder.npy", RAMP)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.npy"]


def unpacked(path: Path) -> np.ndarray:
    """The levels of an RGB PNG of 16 bits whose rows all have the filter 2 (up), read as the standard says."""
    data, at, packed = path.read_bytes(), 8, b""
    head = chunks(path)[b"IHDR"]
    width, height, depth, kind = struct.unpack(">IIBB", head[:10])
    assert (depth, kind) == (16, 2)
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        body = data[at + 4 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length]) == (zlib.crc32(body),)
        packed += body[4:] if body[:4] == b"IDAT" else b""
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 6 * width)
    assert (rows[:, 0] == 2).all()
    return np.cumsum(rows[:, 1:], axis=0, dtype=np.uint8).view(">u2").reshape(height, width, 3)


@pytest.mark.parametrize("bits", [8, 16])
def test_rgb_png_holds_the_nearest_level_of_each_channel(tmp_path: Path, bits: int) -> None:
    path = tmp_path / "a.png"
    form = write_image(path, COLOURS, bits=bits, encoding="linear")
    levels = unpacked(path) if bits == 16 else np.asarray(Image.open(path))
    assert levels.shape == COLOURS.shape
    assert np.abs(levels - (2**bits - 1) * np.clip(COLOURS, 0.0, 1.0)).max() <= 0.5
    assert str(form) == f"{bits} bit RGB, linear"
    assert chunks(path)[b"gAMA"] == (100000).to_bytes(4, "big")


def test_a_deep_rgb_png_of_many_blocks_is_one_picture_that_pillow_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = tmp_path / "whole.png"
    write_image(whole, COLOURS, bits=16)
    monkeypatch.setattr("symrender_cg.output._PIXELS_A_BLOCK", 150)
    blocks = tmp_path / "blocks.png"
    write_image(blocks, COLOURS, bits=16)
    assert np.array_equal(unpacked(whole), unpacked(blocks))
    picture = Image.open(blocks)
    assert (picture.mode, picture.size) == ("RGB", (53, 37))
    assert np.abs(np.asarray(picture) - unpacked(blocks) / 257.0).max() <= 1.0


def test_rgb_goes_through_npy_npz_and_pfm_unchanged(tmp_path: Path) -> None:
    for suffix in (".npy", ".npz", ".pfm"):
        form = write_image(tmp_path / f"a{suffix}", COLOURS)
        assert "RGB, linear" in str(form)
    assert np.array_equal(np.load(tmp_path / "a.npy"), COLOURS)
    with np.load(tmp_path / "a.npz") as held:
        assert list(held) == ["image"]
        assert np.array_equal(held["image"], COLOURS)
    assert np.array_equal(pfm(tmp_path / "a.pfm"), COLOURS.astype(np.float32))


def test_arrays_of_any_kind_are_kept_by_name(tmp_path: Path) -> None:
    arrays = {"image": RAMP, "index": np.arange(12, dtype=np.int32).reshape(3, 4), "depth": np.full((2, 2), np.inf)}
    write_arrays(tmp_path / "a.npz", arrays)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as held:
        assert set(held) == set(arrays)
        assert all(
            np.array_equal(held[name], array) and held[name].dtype == array.dtype for name, array in arrays.items()
        )


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_levels_are_written_as_they_are(tmp_path: Path, dtype: type) -> None:
    grey = np.arange(12, dtype=dtype).reshape(3, 4) * 20
    write_levels(tmp_path / "a.png", grey)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")).astype(int), grey)
    assert b"sRGB" in chunks(tmp_path / "a.png")


def test_an_rgb_intensity_without_a_level_is_named_with_its_channel(tmp_path: Path) -> None:
    bad = COLOURS.copy()
    bad[3, 4, 2] = np.nan
    with pytest.raises(ArgumentError, match=r"values\[3, 4, 2\]: nan has no grey level"):
        write_image(tmp_path / "a.png", bad)
    assert not list(tmp_path.iterdir())
