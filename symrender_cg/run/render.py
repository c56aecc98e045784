"""`render_image` and `evaluate`: the two functions of this package that most users call."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from symrender_cg.errors import ArgumentError, OutsidePlanError
from symrender_cg.lower.variants import Variant
from symrender_cg.pipeline import draw, pixel_size
from symrender_cg.run.bounds import error_bounds
from symrender_cg.run.certificate import Certified
from symrender_cg.run.certify import settle_image, settle_points
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.levels import drawn_as, job_of
from symrender_cg.run.ready import checked_out, ready, shape_of, side
from symrender_cg.run.scene_kernel import LAYERS, layer_arrays
from symrender_cg.run.threads import over_rows, thread_count
from symrender_cg.scene import PointLight, Scene, load_scene

if TYPE_CHECKING:
    from symrender_cg.plan.plan import Plan


def render_image(
    scene: Scene | str | Path | None = None,
    width: int = 256,
    height: int = 256,
    *,
    accuracy: str | Variant = "double",
    target: str | None = None,
    max_error: float | None = None,
    max_ulp: float | None = None,
    bits: float | None = None,
    clip: bool = True,
    out: NDArray[Any] | None = None,
    threads: int | None = None,
    bake: bool = False,
    portable: bool = False,
    backend: str = "native",
    cache: str | Path | None = None,
) -> NDArray[Any]:
    """The image of a scene: linear intensity, shape (height, width), or (height, width, 3) for a scene with colours.

    Row 0 is at the top.

    scene      a Scene, a built-in scene's name, a path of a TOML file; none is Chapter 1's scene
    accuracy   "literal" (the seed's formula), "single" (float32, returns it), "double" (cancellation-free float64),
               "stable" (within 4 ulp), "certified" (every value correctly rounded, see `certify`)
    target     what "certified" rounds to, and returns: "float64", "float32" or "uint8" (grey levels of 0 to 255)
    max_error  in place of accuracy: the fastest variant on this machine whose error is at most this, unclipped
    max_ulp    the same in units of the last place; `bits`: half a step of so many bits (see symrender_cg.cost.choose);
               beside one of them `bake` takes baked kernels into account, too
    clip       cut to [0, 1] as a picture is; False keeps the field itself, which may exceed 1
    out        array of that shape and dtype to write into; any strides, writable
    threads    threads over rows; any number gives the same bits
    bake       fold the scene's numbers into the kernel: faster, but a kernel for this scene alone (one sphere)
    portable   compile for any processor of this kind, not for this machine's own
    backend    "native", or "numpy", which needs no compiler (by hand-written numpy, slower)
    cache      folder for compiled kernels; by default SYMRENDER_CACHE_DIR, or the user's cache folder

    Raises ArgumentError, SceneError, OutsidePlanError or ToolchainError, and AccuracyError where no certificate can be
    given or nothing meets what is asked for, see symrender_cg.errors.
    """
    tolerance = 0.0
    if max_error is not None or max_ulp is not None or bits is not None:
        width, height = side("width", width), side("height", height)
        given = _choosing(accuracy, target, portable, backend)
        how = {"bake": bake, "out": out, "aspect": width / height, "cache": cache}
        accuracy, target, bake, tolerance = _meeting(scene, max_error, max_ulp, bits, given, **how)
    if backend == "numpy":
        width, height = side("width", width), side("height", height)
        chosen = load_scene(scene)
        frame = chosen.in_camera_frame()
        columns, rows = pixel_centres(width, height, pixel_size(frame, height))
        values = _numpy_backend(frame, columns[np.newaxis, :], rows[:, np.newaxis], accuracy, clip)
        return values if out is None else _copied(values, checked_out(out, values.shape, values.dtype))
    _require_native(backend)
    found = ready(
        scene,
        width,
        height,
        accuracy=accuracy,
        target=target,
        clip=clip,
        bake=bake,
        portable=portable,
        cache=cache,
        threads=threads,
        tolerance=tolerance,
    )
    image = np.empty(found.shape, found.dtype) if out is None else checked_out(out, found.shape, found.dtype)
    found.draw(image, threads=threads)
    return image


def certify(
    scene: Scene | str | Path | None = None,
    width: int = 256,
    height: int = 256,
    *,
    target: str = "float64",
    clip: bool = True,
    threads: int | None = None,
    portable: bool = False,
    cache: str | Path | None = None,
) -> Certified:
    """The image with every value correctly rounded to the target, and the certificate: (values, certificate).

    target     "float64", "float32": nearest, ties to even; "uint8": floor(255 I + 1/2) of the intensity I cut to [0, 1]

    The certificate says how many pixels each stage settled, and with which bound. Other arguments as for render_image.
    Raises AccuracyError, whose message and `points` (row * width + column) name the pixels, where a value rests on a
    tie that nothing decides.
    """
    width, height = side("width", width), side("height", height)
    job = job_of(load_scene(scene), "certified", target, clip=clip, portable=portable, cache=cache, threads=threads)
    assert job is not None
    return settle_image(job, width, height)


def render_layers(
    scene: Scene | str | Path | None = None,
    width: int = 256,
    height: int = 256,
    *,
    layers: Iterable[str] = LAYERS,
    accuracy: str = "double",
    clip: bool = False,
    threads: int | None = None,
    portable: bool = False,
    cache: str | Path | None = None,
) -> dict[str, NDArray[Any]]:
    """The image and what else its kernel knows of each pixel, by name; arguments as for render_image.

    image        as render_image returns it, but for `clip`
    depth        distance from the eye to what is seen, scene units; inf where nothing is; (height, width)
    normal       outward unit normal in the camera's frame; 0 where nothing is; (height, width, 3)
    index        which sphere of scene.spheres, len(scene.spheres) for the plane, -1 for the background; int32
    background, ambient, reflected     terms of the image, of its shape
    diffuse, specular                  the same for each light: (lights, *image.shape)

    The terms add up to the unclipped image. Raises ArgumentError for an unknown name.
    """
    width, height = side("width", width), side("height", height)
    names = tuple(dict.fromkeys(layers))
    if unknown := [name for name in names if name not in LAYERS]:
        raise ArgumentError(f"layers: {unknown[0]!r} is not known; expected some of {', '.join(LAYERS)}")
    chosen = load_scene(scene)
    drawn = drawn_as(chosen, accuracy)
    drawing = draw(chosen, drawn, size=(width, height), clip=clip, portable=portable, force=("scene",), cache=cache)
    arrays = layer_arrays(names, (height, width), drawing.channels, len(chosen.lights))
    image = np.empty(drawing.shape(height, width), drawing.dtype)
    over_rows(partial(drawing.rows, image, layers=arrays), height, thread_count(threads, width * height), width=width)
    shape = shape_of(chosen, height, width)
    found: dict[str, NDArray[Any]] = {"image": _as_colour(image, shape).copy()}
    for name, array in arrays.items():
        if name == "index":
            found[name] = _scene_indices(array, drawing.plan)
        elif name in ("depth", "normal"):
            found[name] = array
        else:
            grey = array if drawing.channels == 3 else array[..., 0]
            found[name] = _as_colour(grey, (*array.shape[:-3], *shape)).copy()
    return found


def evaluate(
    scene: Scene | str | Path | None,
    x: ArrayLike,
    y: ArrayLike,
    *,
    accuracy: str | Variant = "double",
    target: str | None = None,
    max_error: float | None = None,
    max_ulp: float | None = None,
    bits: float | None = None,
    with_bound: bool = False,
    clip: bool = False,
    bake: bool = False,
    portable: bool = False,
    backend: str = "native",
    cache: str | Path | None = None,
) -> Any:
    """The intensity at points (x, y) of the image plane, in scene units; x and y broadcast, the result has their shape,
    and a last axis of 3 channels for a scene with colours.

    The plane passes through the point looked at, x to the right and y upwards. On the pixel centres of an image the
    values are those of `render_image`, bit for bit ("single" and "fast": a few units in the last place apart, as rows
    count their pixels in float32). Arguments as there, but `clip` is off by default.

    with_bound    (values, bounds): of each value a float64 that its error does not exceed, proved; for any accuracy

    Raises ArgumentError for points that are not finite real numbers.
    """
    chosen = load_scene(scene)
    points_x, points_y = _points(x, y)
    if max_error is not None or max_ulp is not None or bits is not None:
        given = _choosing(accuracy, target, portable, backend)
        points = points_x, points_y
        accuracy, target, bake, _ = _meeting(
            chosen, max_error, max_ulp, bits, given, bake=bake, points=points, cache=cache
        )
    if with_bound:
        values = evaluate(
            chosen,
            points_x,
            points_y,
            accuracy=accuracy,
            target=target,
            bake=bake,
            portable=portable,
            backend=backend,
            cache=cache,
        )
        bounds = error_bounds(chosen, values, points_x, points_y, portable=portable, cache=cache)
        return (np.clip(values, 0, 1) if clip and values.dtype.kind == "f" else values), bounds
    if backend == "numpy":
        return _numpy_backend(chosen.in_camera_frame(), points_x, points_y, accuracy, clip)
    _require_native(backend)
    job = job_of(chosen, accuracy, target, clip=clip, bake=bake, portable=portable, cache=cache)
    if job is not None:
        return settle_points(job, points_x, points_y).values
    drawing = draw(chosen, drawn_as(chosen, accuracy), clip=clip, bake=bake, portable=portable, cache=cache)
    values = np.empty(drawing.shape(*points_x.shape), drawing.dtype)
    drawing.points(values, np.ascontiguousarray(points_x), np.ascontiguousarray(points_y))
    return np.array(_as_colour(values, shape_of(chosen, *points_x.shape)))


def _choosing(accuracy: str | Variant, target: str | None, portable: bool, backend: str) -> dict[str, tuple[Any, Any]]:
    """Arguments that choose a kernel, each with what it is if it is left out."""
    return {
        "accuracy": (accuracy, "double"),
        "target": (target, None),
        "portable": (portable, False),
        "backend": (backend, "native"),
    }


def _meeting(
    scene: Scene | str | Path | None,
    max_error: float | None,
    max_ulp: float | None,
    bits: float | None,
    given: dict[str, tuple[Any, Any]],
    **how: Any,
) -> tuple[str, str | None, bool, float]:
    from symrender_cg.cost.asked import meeting

    return meeting(scene, max_error=max_error, max_ulp=max_ulp, bits=bits, given=given, **how)


def _as_colour(values: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Grey values of a scene whose colours are all grey, in its three channels; others as they are."""
    return values if values.shape == shape else np.broadcast_to(values[..., np.newaxis], shape)


def _scene_indices(positions: NDArray[Any], plan: Plan) -> NDArray[Any]:
    """Positions in the kernel's arrays as indices of the scene's spheres."""
    assert plan.arrangement is not None, "layers come from the kernel of scenes"
    spheres, plane = plan.arrangement.spheres, len(plan.given.spheres)
    table = np.concatenate((spheres, [plane] * (plan.arrangement.receivers - len(spheres)), [-1])).astype(np.int32)
    indices: NDArray[Any] = table[positions]
    return indices


def _numpy_backend(
    frame: Scene, x: NDArray[np.float64], y: NDArray[np.float64], accuracy: str | Variant, clip: bool
) -> NDArray[Any]:
    from symrender_cg.lower.variants import variant

    chosen = variant(accuracy)
    if chosen.settles:
        raise ArgumentError(f"backend: 'numpy' proves nothing, and {accuracy!r} is proved; leave the backend out")
    dtype: DTypeLike = np.float32 if chosen.shading == "float32" else np.float64
    form: Literal["stable", "literal"] = "stable" if chosen.exact else "literal"
    if _is_one_sphere(frame):
        from symrender_cg.reference.vectorised import evaluate_vectorised

        values = evaluate_vectorised(frame, x, y, form=form)
    elif chosen.exact:
        from symrender_cg.reference.brute_force import trace

        values = trace(frame, *np.broadcast_arrays(x, y)).value
    else:
        raise OutsidePlanError(
            f"accuracy: {accuracy!r} is the formula of one sphere under one light; this scene has more; use 'double'"
        )
    values = values.astype(dtype, copy=False)
    return np.clip(values, 0.0, 1.0) if clip else values


def _is_one_sphere(frame: Scene) -> bool:
    """Whether the numpy form of Chapter 1's formula is all that the scene calls for."""
    if len(frame.spheres) != 1 or len(frame.lights) != 1 or frame.plane is not None or frame.channels != 1:
        return False
    light, mirror = frame.lights[0], frame.spheres[0].material.reflect
    plain = isinstance(light, PointLight) and light.attenuation == (1.0, 0.0, 0.0)
    return plain and isinstance(frame.background, float) and (mirror == 0.0 or frame.background == 0.0)


def _require_native(backend: str) -> None:
    if backend != "native":
        raise ArgumentError(f"backend: {backend!r} is not known; expected 'native' or 'numpy'")


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


def _copied(values: NDArray[Any], out: NDArray[Any]) -> NDArray[Any]:
    out[...] = values
    return out
