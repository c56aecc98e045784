"""Image files: intensities -> .png, .npy, .npz or .pfm, each written whole or not at all.

Comes in: float intensities of shape (height, width), or (height, width, 3) in colour, row 0 at the top. Goes out: one
file. Never done here: rendering, a format guessed from anything but the name, a half-written file.

    .png   grey or RGB of 8 or 16 bits; intensities are cut to [0, 1], encoded, and rounded to the nearest level
           srgb     the transfer curve of IEC 61966-2-1; the file says so by an sRGB chunk (and gAMA 0.45455)
           linear   levels proportional to intensity; the file says so by a gAMA chunk of 1.0
    .npy   the array itself, in its own format
    .npz   several arrays by name, the image under `image`, not compressed
    .pfm   float32, little endian, rows from bottom to top; linear intensity

Grey levels that are rounded already (uint8, level / 255 is the intensity) are written as they are: to a linear .png of
8 bits, a .npy or a .npz.
"""

from __future__ import annotations

import os
import secrets
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import ArgumentError

SUFFIXES: Final = (".png", ".npy", ".npz", ".pfm")
BITS: Final = (8, 16)
ENCODINGS: Final = ("srgb", "linear")
_PIXELS_A_BLOCK: Final = 1 << 18
_SRGB_CHUNK: Final = (b"sRGB", b"\0")  # rendering intent 0, perceptual
_GAMMA: Final = {"srgb": 45455, "linear": 100000}  # PNG stores gamma times 100,000


@dataclass(frozen=True, slots=True)
class ImageFormat:
    """What a file will hold. `bits` and `encoding` are of .png; None where the file keeps the numbers themselves."""

    suffix: str
    bits: int | None = None
    encoding: str | None = None
    colour: bool = False

    @property
    def keeps_field(self) -> bool:
        """Whether intensities above 1 can be written."""
        return self.bits is None

    def __str__(self) -> str:
        kind = "RGB" if self.colour else "grey"
        if self.bits is not None:
            return f"{self.bits} bit {kind}, {'sRGB' if self.encoding == 'srgb' else 'linear'}"
        held = {".npy": "numpy array", ".npz": "numpy arrays", ".pfm": "float32"}[self.suffix]
        return f"{held}, {kind}, linear" if self.colour else f"{held}, linear"


def image_format(
    path: str | Path, *, bits: int | None = None, encoding: str | None = None, levels: bool = False
) -> ImageFormat:
    """The format that a file's name asks for; PNG is 8 bit sRGB unless told otherwise.

    levels: what is written is uint8 grey levels, not intensities; a PNG of them is 8 bit linear.
    Raises ArgumentError for another extension, unknown bits or encoding, and for either where the format has none, or
    where it would round grey levels again.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ArgumentError(
            f"{path}: the extension {suffix!r} names no image format; expected one of {', '.join(SUFFIXES)}"
        )
    if suffix != ".png":
        for name, given in (("bits", bits), ("encoding", encoding)):
            if given is not None:
                raise ArgumentError(
                    f"{name}: {given} has no meaning for {suffix}, which holds the linear intensities as numbers; "
                    "leave it out, or write a .png"
                )
        if levels and suffix == ".pfm":
            raise ArgumentError(f"{path}: a .pfm holds floats, not grey levels of 0 to 255; write a .png, .npy or .npz")
        return ImageFormat(suffix)
    if levels and encoding == "srgb":
        raise ArgumentError(
            "encoding: 'srgb' would round grey levels a second time, which are proportional to intensity and right as "
            "they are; leave it out, or ask for intensities (another target) to be encoded"
        )
    if levels and bits == 16:
        raise ArgumentError("bits: 16 has no meaning for grey levels of 0 to 255; leave it out, or ask for intensities")
    usual = "linear" if levels else "srgb"
    chosen = ImageFormat(suffix, 8 if bits is None else bits, usual if encoding is None else encoding)
    if chosen.bits not in BITS:
        raise ArgumentError(f"bits: {bits!r} is not offered; expected 8 or 16")
    if chosen.encoding not in ENCODINGS:
        raise ArgumentError(f"encoding: {encoding!r} is not known; expected 'srgb' or 'linear'")
    return chosen


def write_image(
    path: str | Path, values: NDArray[Any], *, bits: int | None = None, encoding: str | None = None
) -> ImageFormat:
    """Writes intensities (height, width) or (height, width, 3) to a file in the format of its name, which is returned.

    Values of dtype uint8 are grey levels of 0 to 255 and are written as they are.
    Raises ArgumentError for what image_format refuses, an array of another kind, intensities that are not finite in a
    .png, and a place that cannot be written. Whatever happens, the path holds the old file or the whole new one.
    """
    levels = values.dtype == np.uint8
    chosen = image_format(path, bits=bits, encoding=encoding, levels=levels)
    real = levels or values.dtype.kind == "f"
    if values.shape[2:] not in ((), (3,)) or values.ndim < 2 or not real or values.size == 0:
        raise ArgumentError(
            f"values: dtype {values.dtype} and shape {values.shape}; expected floating-point intensities of shape "
            "(height, width) or (height, width, 3), at least one pixel"
        )
    chosen = replace(chosen, colour=values.ndim == 3)
    if chosen.suffix == ".png":
        grey = values if levels else quantise(values, chosen)
        with replacing(path) as file:
            _write_png(file, grey, chosen)
    elif chosen.suffix == ".npz":
        write_arrays(path, {"image": values})
    else:
        with replacing(path) as file:
            (_write_npy if chosen.suffix == ".npy" else _write_pfm)(file, values)
    return chosen


def write_arrays(path: str | Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Writes arrays by name to one .npz. Raises ArgumentError for a place that cannot be written."""
    held: dict[str, Any] = dict(arrays)
    with replacing(path) as file:
        np.savez(file, allow_pickle=False, **held)


def write_levels(path: str | Path, levels: NDArray[Any]) -> None:
    """Writes a .png of grey or RGB levels, uint8 or uint16, that are what a screen shall show: no curve is applied."""
    bits = 8 * levels.itemsize
    with replacing(path) as file:
        _write_png(file, levels, ImageFormat(".png", bits, "srgb", levels.ndim == 3))


def srgb(intensity: NDArray[Any]) -> NDArray[Any]:
    """12.92 v where v <= 0.0031308, else 1.055 v^(1/2.4) - 0.055, for v in [0, 1]   (IEC 61966-2-1)"""
    curve = 1.055 * np.power(np.maximum(intensity, 0.0031308), 1.0 / 2.4) - 0.055
    return np.where(intensity <= 0.0031308, 12.92 * intensity, curve)


def quantise(values: NDArray[Any], form: ImageFormat) -> NDArray[Any]:
    """round((2^bits - 1) encoded(clip(v, 0, 1))), uint8 or uint16, halves to even.

    Raises ArgumentError where an intensity is not finite: no grey stands for it.
    """
    assert form.bits is not None, "levels are of a .png"
    white = 2**form.bits - 1
    height, width = values.shape[:2]
    levels = np.empty(values.shape, np.uint8 if form.bits == 8 else np.uint16)
    rows = max(1, _PIXELS_A_BLOCK // width)
    for begin in range(0, height, rows):
        block = values[begin : begin + rows].astype(np.float64)
        if not np.isfinite(block).all():
            row, *rest = (int(index) for index in np.argwhere(~np.isfinite(block))[0])
            place = ", ".join(map(str, (begin + row, *rest)))
            raise ArgumentError(
                f"values[{place}]: {block[(row, *rest)]} has no grey level; write a .npy or .pfm to see "
                "such intensities"
            )
        block = np.clip(block, 0.0, 1.0, out=block)
        encoded = srgb(block) if form.encoding == "srgb" else block
        levels[begin : begin + rows] = np.rint(white * encoded)
    return levels


@contextmanager
def replacing(path: str | Path) -> Iterator[BinaryIO]:
    """A file to write that takes the place of `path` when all went well, by one rename; else `path` is as it was.

    Raises ArgumentError, naming the path, where the system refuses.
    """
    target = Path(path)
    unfinished = target.with_name(f".{target.name[:80]}.{os.getpid()}-{secrets.token_hex(4)}")
    try:
        with open(unfinished, "xb") as file:
            yield file
        unfinished.replace(target)
    except OSError as problem:
        if isinstance(problem, BrokenPipeError):
            raise
        raise ArgumentError(
            f"{target}: cannot be written: {problem.strerror or problem}; choose another place"
        ) from None
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)


def _write_png(file: BinaryIO, levels: NDArray[Any], form: ImageFormat) -> None:
    assert form.encoding is not None, "a .png has an encoding"
    chunks = [(b"gAMA", _GAMMA[form.encoding].to_bytes(4, "big"))]
    if form.encoding == "srgb":
        chunks.append(_SRGB_CHUNK)
    if form.colour and form.bits == 16:
        _write_deep_rgb(file, levels, chunks)
        return
    from PIL import Image, PngImagePlugin

    info = PngImagePlugin.PngInfo()
    for chunk in chunks:
        info.add(*chunk)
    Image.fromarray(levels).save(file, format="PNG", pnginfo=info)


def _write_deep_rgb(file: BinaryIO, levels: NDArray[Any], chunks: list[tuple[bytes, bytes]]) -> None:
    """PNG of colour type 2 and 16 bits, which pillow does not write; each row as its difference from the one above."""
    height, width = levels.shape[:2]

    def chunk(name: bytes, data: bytes) -> None:
        file.write(struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)))

    file.write(b"\x89PNG\r\n\x1a\n")
    chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0))
    for name, data in chunks:
        chunk(name, data)
    packed = zlib.compressobj()
    above = np.zeros(6 * width, np.uint8)
    for begin in range(0, height, rows := max(1, _PIXELS_A_BLOCK // width)):
        block = np.ascontiguousarray(levels[begin : begin + rows], dtype=">u2").view(np.uint8).reshape(-1, 6 * width)
        up = np.full((len(block), 1 + 6 * width), 2, np.uint8)  # the filter "up" of every row
        up[:, 1:] = block - np.vstack((above, block[:-1]))
        above = block[-1]
        if data := packed.compress(up.tobytes()):
            chunk(b"IDAT", data)
    chunk(b"IDAT", packed.flush())
    chunk(b"IEND", b"")


def _write_npy(file: BinaryIO, values: NDArray[Any]) -> None:
    np.save(file, values, allow_pickle=False)


def _write_pfm(file: BinaryIO, values: NDArray[Any]) -> None:
    height, width = values.shape[:2]
    file.write(f"{'Pf' if values.ndim == 2 else 'PF'}\n{width} {height}\n-1.0\n".encode())
    with np.errstate(over="ignore"):
        file.write(np.ascontiguousarray(values[::-1], dtype="<f4").tobytes())
