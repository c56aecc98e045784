"""`render`: a scene -> an image file, and its layers beside it; a progress bar where it takes over a second.

What proves its values also prints its certificate. On a warm start: no sympy, no templates, no rich.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.cli.console import Column, Table, duration
from symrender_cg.cli.layers import chosen_layers, write_layers
from symrender_cg.cli.progress import Progress
from symrender_cg.cli.requests import choose_for
from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import Variant, variant
from symrender_cg.output import SUFFIXES, ImageFormat, image_format, write_image
from symrender_cg.pipeline import draw, enclosure_name, pixel_size, planned, statistics
from symrender_cg.run.certificate import Certified, Job
from symrender_cg.run.certify import settle_image
from symrender_cg.run.levels import job_of
from symrender_cg.run.ready import shape_of
from symrender_cg.run.render import evaluate, render_layers
from symrender_cg.run.threads import over_rows, thread_count
from symrender_cg.scene import Scene, load_scene

PIXELS_A_BLOCK = 1 << 20


def run(arguments: argparse.Namespace) -> int:
    """Renders, writes, and says what was written, a line a file."""
    if arguments.list:
        return _list_scenes()
    if arguments.output is None:
        raise ArgumentError(
            f"-o FILE is missing: where should the image go? expected a file's name that ends in {_suffixes()}"
        )
    target = Path(arguments.output)
    if arguments.max_error is not None or arguments.max_ulp is not None:
        found = choose_for(arguments, load_scene(arguments.scene), names=("max_error", "max_ulp"), plans=True)
        arguments.tolerance = 0.0 if found is None else found.tolerance
    chosen = variant(arguments.accuracy, arguments.target)
    grey_levels = chosen.result == "uint8"
    form = image_format(target, bits=arguments.bits, encoding=arguments.encoding, levels=grey_levels)
    _require_possible(arguments, chosen, form)
    if target.is_dir() or not target.parent.is_dir():
        raise ArgumentError(
            f"{target}: {'is a folder' if target.is_dir() else 'its folder does not exist'}; expected a file's name in "
            "a folder that exists"
        )
    width, height = arguments.size
    try:
        (_with_layers if arguments.layers else _image_alone)(arguments, load_scene(arguments.scene), target)
    except MemoryError:
        raise ArgumentError(
            f"--size {width}x{height}: this image does not fit into memory; render a smaller one"
        ) from None
    return 0


def _require_possible(arguments: argparse.Namespace, chosen: Variant, form: ImageFormat) -> None:
    """Raises ArgumentError for options that exclude each other."""
    if arguments.no_clip and chosen.result == "uint8":
        raise ArgumentError("--no-clip: grey levels end at 255; leave it out, or ask for --target float32 or float64")
    if arguments.no_clip and not form.keeps_field:
        raise ArgumentError(f"--no-clip: a {form.suffix} cannot hold intensities above 1; write a .npy, .npz or .pfm")
    if arguments.layers and arguments.backend == "numpy":
        raise ArgumentError("--layers: layers come from the native kernel; leave --backend numpy out")
    if chosen.settles and arguments.layers:
        raise ArgumentError(
            f"--layers: accuracy {arguments.accuracy} proves the image alone, not its layers; leave --layers out, or "
            "take double"
        )
    if chosen.settles and arguments.backend == "numpy":
        raise ArgumentError(
            f"--backend numpy: accuracy {arguments.accuracy} is proved by native kernels; leave --backend out, or take "
            "double"
        )


def _image_alone(arguments: argparse.Namespace, scene: Scene, target: Path) -> None:
    width, height = arguments.size
    job = None
    if arguments.backend == "native":
        job = job_of(
            scene,
            arguments.accuracy,
            arguments.target,
            clip=not arguments.no_clip,
            portable=arguments.portable,
            threads=arguments.threads,
            aspect=width / height,
        )
    if job is not None:
        _proved(arguments, job, target)
        return
    begin = time.perf_counter()
    with Progress(height, "rendering", "rows") as progress:
        values, kernel = render_in_blocks(
            scene,
            width,
            height,
            accuracy=arguments.accuracy,
            clip=not arguments.no_clip,
            threads=arguments.threads,
            portable=arguments.portable,
            backend=arguments.backend,
            rows_done=progress.done,
            tolerance=getattr(arguments, "tolerance", 0.0),
        )
        seconds = time.perf_counter() - begin
        progress.now(f"writing {target.name}")
        form = write_image(target, values, bits=arguments.bits, encoding=arguments.encoding)
    print(f"{target}: {width} x {height}, {form}; {arguments.accuracy}, {kernel}, rendered in {duration(seconds)}")


def _proved(arguments: argparse.Namespace, job: Job, target: Path) -> None:
    """Draws stage by stage; what is not proved raises AccuracyError, and nothing is written."""
    width, height = arguments.size
    begin, compiled, derived = time.perf_counter(), statistics.compiled, statistics.derived
    with Progress(height, f"proving by {arguments.accuracy}", "rows") as progress:
        found: Certified = settle_image(job, width, height)
        seconds = time.perf_counter() - begin
        progress.done(height)
        progress.now(f"writing {target.name}")
        form = write_image(target, found.values, bits=arguments.bits, encoding=arguments.encoding)
    level = arguments.accuracy if arguments.target is None else f"{arguments.accuracy} {arguments.target}"
    handed_over = not variant(arguments.accuracy).settles
    how = f"{level}, drawn by the compensated kernel:" if handed_over else f"{level},"
    kernel = f"{_first_kernel(job, width / height)} {_origin(compiled, derived)}"
    print(f"{target}: {width} x {height}, {form}; {how} {kernel}, rendered in {duration(seconds)}")
    why = "plain float64 may be off by more than 1e-15 in this scene; " if handed_over else ""
    print(f"{why}{found.certificate}")


def _first_kernel(job: Job, aspect: float) -> str:
    """The C name of the kernel of a job's first stage."""
    plan = planned(job.scene, aspect=aspect)
    if plan.arrangement is None:
        return f"{plan.name}_{job.variant.name}"
    return enclosure_name(planned(job.scene))


def _with_layers(arguments: argparse.Namespace, scene: Scene, target: Path) -> None:
    width, height = arguments.size
    names = chosen_layers(arguments.layers)
    begin, compiled, derived = time.perf_counter(), statistics.compiled, statistics.derived
    found = render_layers(
        scene,
        width,
        height,
        layers=names,
        accuracy=arguments.accuracy,
        clip=not arguments.no_clip,
        threads=arguments.threads,
        portable=arguments.portable,
    )
    seconds = time.perf_counter() - begin
    plan = planned(scene, force=("scene",), aspect=width / height)
    kernel = f"{plan.name}_{arguments.accuracy} {_origin(compiled, derived)}"
    form = image_format(target, bits=arguments.bits, encoding=arguments.encoding)
    if form.suffix != ".npz":
        form = write_image(target, found["image"], bits=arguments.bits, encoding=arguments.encoding)
    said = write_layers(target, found, bits=arguments.bits, encoding=arguments.encoding)
    held = f", with {', '.join(names)}" if form.suffix == ".npz" else ""
    print(
        f"{target}: {width} x {height}, {form}{held}; {arguments.accuracy}, {kernel}, rendered in {duration(seconds)}"
    )
    for place, what in said:
        print(f"{place}{f': {what}' if what else ''}")


def render_in_blocks(
    scene: Scene,
    width: int,
    height: int,
    *,
    accuracy: str,
    clip: bool,
    threads: int | None,
    portable: bool,
    backend: str,
    rows_done: Callable[[int], None],
    tolerance: float = 0.0,
) -> tuple[NDArray[Any], str]:
    """The image of render_image, bit for bit, made block by block of rows, and where its kernel came from, in words.

    tolerance   how much any pixel may change by what the plan leaves out

    `rows_done` is called with the number of rows of each block that is finished.
    """
    rows = max(1, PIXELS_A_BLOCK // width)
    if backend == "numpy":
        return _by_numpy(scene.in_camera_frame(), width, height, rows, accuracy, clip, rows_done), "numpy"
    compiled, derived = statistics.compiled, statistics.derived
    drawing = draw(scene, accuracy, size=(width, height), clip=clip, portable=portable, max_error=tolerance)
    origin = _origin(compiled, derived)
    image = np.empty(drawing.shape(height, width), drawing.dtype)
    for first in range(0, height, rows):
        last = min(first + rows, height)

        def some(begin: int, end: int, first: int = first) -> None:
            drawing.rows(image, first + begin, first + end)

        over_rows(some, last - first, thread_count(threads, (last - first) * width))
        rows_done(last - first)
    shape = shape_of(scene, height, width)
    if image.shape != shape:  # colours that are all grey
        image = np.repeat(image[..., np.newaxis], shape[-1], axis=-1)
    return image, f"{drawing.kernel.name} {origin}"


def _origin(compiled: int, derived: int) -> str:
    """Where a kernel came from, by what was counted before."""
    origin = "just derived" if statistics.derived > derived else "from the cache"
    return origin + (" and compiled" if statistics.compiled > compiled else "")


def _suffixes() -> str:
    return f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"


def _by_numpy(
    frame: Scene, width: int, height: int, rows: int, accuracy: str, clip: bool, rows_done: Callable[[int], None]
) -> NDArray[Any]:
    pixel = pixel_size(frame, height)
    x = (np.arange(width, dtype=np.float64) + 0.5 - 0.5 * width) * np.float64(pixel)
    y = (0.5 * height - 0.5 - np.arange(height, dtype=np.float64)) * np.float64(pixel)
    image = np.empty(shape_of(frame, height, width), variant(accuracy).result)
    for first in range(0, height, rows):
        block = y[first : first + rows, np.newaxis]
        image[first : first + rows] = evaluate(
            frame, x[np.newaxis, :], block, accuracy=accuracy, clip=clip, backend="numpy"
        )
        rows_done(block.size)
    return image


def _list_scenes() -> int:
    from symrender_cg.scene.builtin import builtin_description, builtin_names

    table = Table((Column("scene"), Column("what it shows")))
    for name in builtin_names():
        table.add(name, builtin_description(name))
    table.show()
    return 0
