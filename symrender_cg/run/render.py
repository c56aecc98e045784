"""`render_image` and `evaluate`: the two functions of this package that most users call."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from symrender_cg.errors import ArgumentError
from symrender_cg.pipeline import compile_kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.threads import over_rows, thread_count
from symrender_cg.scene import Scene, load_scene

LARGEST_SIDE = 1 << 24


def render_image(
    scene: Scene | str | Path | None = None,
    width: int = 256,
    height: int = 256,
    *,
    accuracy: str = "double",
    clip: bool = True,
    out: NDArray[Any] | None = None,
    threads: int | None = None,
    bake: bool = False,
    portable: bool = False,
    backend: str = "native",
    cache: str | Path | None = None,
) -> NDArray[Any]:
    """The image of a scene: linear intensity, shape (height, width), row 0 at the top.

    scene      a Scene, a built-in scene's name, a path of a TOML file; none is Chapter 1's scene
    accuracy   "literal" (the seed's formula), "double" (cancellation-free float64), "single" (float32, returns it)
    clip       cut to [0, 1] as a picture is; False keeps the field itself, which may exceed 1
    out        array of that shape and dtype to write into; any strides, writable
    threads    threads over rows; any number gives the same bits
    bake       fold the scene's numbers into the kernel: faster, but a kernel for this scene alone
    portable   compile for any processor of this kind, not for this machine's own
    backend    "native", or "numpy", which needs no compiler ("double" and "literal" by hand-written numpy, slower)
    cache      folder for compiled kernels; by default SYMRENDER_CACHE_DIR, or the user's cache folder

    Raises ArgumentError, SceneError, OutsidePlanError or ToolchainError, see symrender_cg.errors.
    """
    width, height = _side("width", width), _side("height", height)
    chosen = load_scene(scene)
    frame = chosen.in_camera_frame()
    pixel = pixel_size(frame, height)
    if backend == "numpy":
        values = _numpy_backend(frame, *_grid(width, height, pixel), accuracy, clip)
        return values if out is None else _copied(values, _checked(out, (height, width), values.dtype))
    _require_native(backend)
    kernel = compile_kernel(chosen, accuracy, bake=bake, portable=portable, cache=cache)
    image = np.empty((height, width), kernel.dtype) if out is None else _checked(out, (height, width), kernel.dtype)
    target = image if _rows_are_contiguous(image) else np.empty((height, width), kernel.dtype)
    numbers = kernel.numbers(numbers_of(frame))
    white = 1.0 if clip else math.inf

    def render(begin: int, end: int) -> None:
        kernel.rows(target, numbers, pixel=pixel, white=white, begin=begin, end=end)

    over_rows(render, height, thread_count(threads, width * height))
    return image if target is image else _copied(target, image)


def evaluate(
    scene: Scene | str | Path | None,
    x: ArrayLike,
    y: ArrayLike,
    *,
    accuracy: str = "double",
    clip: bool = False,
    bake: bool = False,
    portable: bool = False,
    backend: str = "native",
    cache: str | Path | None = None,
) -> NDArray[Any]:
    """The intensity at points (x, y) of the image plane, in scene units; x and y broadcast, the result has their shape.

    The plane passes through the point looked at, x to the right and y upwards. On the pixel centres of an image the
    values are those of `render_image`, bit for bit. Arguments as there, but `clip` is off by default.
    Raises ArgumentError for points that are not finite real numbers.
    """
    chosen = load_scene(scene)
    points_x, points_y = _points(x, y)
    if backend == "numpy":
        return _numpy_backend(chosen.in_camera_frame(), points_x, points_y, accuracy, clip)
    _require_native(backend)
    kernel = compile_kernel(chosen, accuracy, bake=bake, portable=portable, cache=cache)
    values = np.empty(points_x.shape, kernel.dtype)
    kernel.points(
        values,
        np.ascontiguousarray(points_x),
        np.ascontiguousarray(points_y),
        kernel.numbers(numbers_of(chosen)),
        white=1.0 if clip else math.inf,
    )
    return values


def pixel_size(frame: Scene, height: int) -> float:
    """The side of a pixel of an image with that many rows, in scene units; `frame` is a camera-frame scene."""
    half_height = frame.camera.half_height
    assert half_height is not None, "a camera-frame scene has its half_height"
    return 2.0 * half_height / height


def _grid(width: int, height: int, pixel: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    columns = (np.arange(width, dtype=np.float64) + 0.5 - 0.5 * width) * np.float64(pixel)
    rows = (0.5 * height - 0.5 - np.arange(height, dtype=np.float64)) * np.float64(pixel)
    return columns[np.newaxis, :], rows[:, np.newaxis]


def _numpy_backend(
    frame: Scene, x: NDArray[np.float64], y: NDArray[np.float64], accuracy: str, clip: bool
) -> NDArray[Any]:
    from symrender_cg.lower.variants import variant
    from symrender_cg.reference.vectorised import evaluate_vectorised

    chosen = variant(accuracy)
    dtype: DTypeLike = np.float32 if chosen.shading == "float32" else np.float64
    form: Literal["stable", "literal"] = "stable" if chosen.exact else "literal"
    values = evaluate_vectorised(frame, x, y, form=form).astype(dtype, copy=False)
    return np.clip(values, 0.0, 1.0) if clip else values


def _require_native(backend: str) -> None:
    if backend != "native":
        raise ArgumentError(f"backend: {backend!r} is not known; expected 'native' or 'numpy'")


def _side(name: str, value: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 1 <= value <= LARGEST_SIDE:
        raise ArgumentError(
            f"{name}: {value!r} is not a number of pixels; expected a whole number from 1 to {LARGEST_SIDE}"
        )
    return int(value)


def _points(x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    points_x, points_y = _coordinates("x", x), _coordinates("y", y)
    try:
        np.broadcast_shapes(points_x.shape, points_y.shape)
    except ValueError:
        raise ArgumentError(
            f"x and y: shapes {points_x.shape} and {points_y.shape} do not broadcast; expected one shape, or numbers"
        ) from None
    broadcast_x, broadcast_y = np.broadcast_arrays(points_x, points_y)
    return broadcast_x, broadcast_y


def _coordinates(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise ArgumentError(f"{name}: expected real numbers, not an array of {array.dtype}")
    points = array.astype(np.float64, copy=False)
    if not np.isfinite(points).all():
        index = np.argwhere(~np.isfinite(points))[0]
        place = f"{name}[{', '.join(map(str, index))}]" if points.ndim else name
        raise ArgumentError(f"{place}: {points[tuple(index)]} is not a point; expected finite coordinates")
    return points


def _checked(out: NDArray[Any], shape: tuple[int, int], dtype: np.dtype[Any]) -> NDArray[Any]:
    if not isinstance(out, np.ndarray):
        raise ArgumentError(f"out: expected a numpy array of shape {shape} and dtype {dtype}, not {type(out).__name__}")
    if out.shape != shape:
        raise ArgumentError(f"out: has shape {out.shape}; expected (height, width) = {shape}")
    if out.dtype != dtype:
        raise ArgumentError(f"out: has dtype {out.dtype}; this accuracy writes {dtype}")
    if not out.flags.writeable:
        raise ArgumentError("out: is read-only; pass an array that can be written to")
    return out


def _rows_are_contiguous(image: NDArray[Any]) -> bool:
    item = image.itemsize
    return image.strides[1] == item and image.strides[0] % item == 0 and image.ctypes.data % item == 0


def _copied(values: NDArray[Any], out: NDArray[Any]) -> NDArray[Any]:
    out[...] = values
    return out
