"""A way made ready: what draws its image, what gives its values, its C, and what building it took.

Comes in: a Way, a Scene, the size of the image. Goes out: Ready. Compilations run side by side. Never done here: a
measurement of drawing.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from dataclasses import field as default
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.build.cache import Cache
from symrender_cg.cost.variants import Way
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import (
    Translation,
    build_kernel,
    draw,
    pixel_size,
    planned,
    recipe_of,
    translate,
)
from symrender_cg.run.levels import drawn_as, job_of
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.render import evaluate, render_image
from symrender_cg.run.settled_rows import SettledRows
from symrender_cg.scene import Scene

Floats = NDArray[np.float64]
Values = NDArray[Any]
Place = str | Path | None
_COMPILING_THREADS: Final = max(2, os.cpu_count() or 1)
_INNER: Final = ("frame", "row")
"""Rates whose operations no pixel pays for."""


@dataclass(frozen=True, eq=False)
class Ready:
    """A way that can be drawn.

    draw        draws one image into memory of its own, on one thread; what the time of a way is the time of
    field       the unclipped intensities at points, by the same arithmetic; grey levels of a way that gives those
    files       C texts by name, the kernel's own first; none for numpy
    steps       the kernel's program as text, step by step
    lines       of the kernel's own .c
    operations  a pixel; of a scene's kernel those of all its parts
    derive      seconds from the plan to the C text
    compile     seconds in the compiler, when the kernel was compiled
    """

    way: Way
    draw: Callable[[], object]
    field: Callable[[Floats, Floats], Values]
    files: dict[str, str] = default(default_factory=dict)
    steps: str = ""
    lines: int = 0
    operations: int = 0
    derive: float = 0.0
    compile: float = 0.0


def make_ready(
    ways: Sequence[Way],
    scene: Scene,
    size: tuple[int, int],
    told: Callable[[str], None] = lambda name: None,
    *,
    cache: Place = None,
) -> list[Ready]:
    """Every way ready to be drawn; `told(name)` after each. Derivation here, compilers side by side.

    `cache`: folder for kernels, as render_image takes it.
    """
    store = Cache(cache)
    with ThreadPoolExecutor(_COMPILING_THREADS, thread_name_prefix="symrender_cg-cost") as pool:
        jobs = []
        for way in ways:
            translation = _translated(way, scene, size) if way.maker == "native" else None
            recipe = None if translation is None or translation.variant.settles else _recipe(way, translation)
            work = None
            if translation is not None:
                work = pool.submit(build_kernel, translation, root=store.root, recipe=recipe)
            jobs.append((way, translation, work))
        ready = []
        for way, translation, work in jobs:
            seconds = 0.0 if work is None else work.result().manifest.seconds
            ready.append(_ready(way, scene, size, translation, seconds, cache))
            told(way.name)
        return ready


def _translated(way: Way, scene: Scene, size: tuple[int, int]) -> Translation:
    """The C of the way's kernel, the first of its kernels where its level proves its values."""
    drawn = drawn_as(scene, way.level) if not way.choices else way.variant
    job = None if _changed(way) else job_of(scene, drawn, way.target, clip=True, bake=way.bake)
    accuracy = drawn if job is None else job.variant
    return translate(
        scene,
        accuracy,
        bake=way.bake,
        force=way.force,
        aspect=size[0] / size[1],
        max_error=way.tolerance,
    )


def _recipe(way: Way, translation: Translation) -> str:
    baked = tuple(sorted(numbers_of(translation.plan.scene).items())) if way.bake else ()
    return recipe_of(translation.plan, translation.variant.key, baked, portable=False)


def recipe_for(way: Way, scene: Scene, size: tuple[int, int] = (1, 1)) -> str:
    """What the way's kernel is recalled by, without deriving it; for a way that is one kernel."""
    plan = planned(scene, force=way.force, aspect=size[0] / size[1], max_error=way.tolerance)
    drawn = way.variant if way.choices else variant(drawn_as(scene, way.level))
    baked = tuple(sorted(numbers_of(plan.scene).items())) if way.bake else ()
    return recipe_of(plan, drawn.key, baked, portable=False)


def _changed(way: Way) -> bool:
    """Whether the way asks the pipeline for what render_image does not offer."""
    return bool(way.force) or way.tolerance > 0.0


def _ready(
    way: Way,
    scene: Scene,
    size: tuple[int, int],
    translation: Translation | None,
    compile_seconds: float,
    cache: Place,
) -> Ready:
    if way.maker == "numpy":
        return _numpy(way, scene, size)
    if way.maker == "lambdify":
        return _lambdified(way, scene, size)
    assert translation is not None, "a native way has C"
    emitted = translation.emitted
    program = getattr(translation, "program", None)
    inner = {rate: counts for rate, counts in emitted.operations.items() if rate not in _INNER}
    return Ready(
        way,
        drawer(way, scene, size, cache=cache),
        field_of(way, scene, size, cache=cache),
        dict(emitted.files),
        program.text() if program is not None else "",
        emitted.files[f"{emitted.name}.c"].count("\n"),
        sum(sum(counts.values()) for counts in inner.values()),
        sum(translation.seconds.values()),
        compile_seconds,
    )


def drawer(way: Way, scene: Scene, size: tuple[int, int], *, cache: Place = None) -> Callable[[], object]:
    """A call that draws a clipped image; memory is made once, as `out=` does for a user."""
    width, height = size[0] * way.side, size[1] * way.side
    if not _changed(way):
        job = job_of(scene, way.accuracy, way.target, clip=True, bake=way.bake, cache=cache, threads=1)
        if job is not None:
            settled = SettledRows(job, width, height)
            return partial(settled.draw, np.empty(settled.shape, settled.dtype), threads=1)
    drawing = _drawing(way, scene, (width, height), clip=True, cache=cache)
    image = np.empty(drawing.shape(height, width), drawing.dtype)
    if way.side == 1:
        return lambda: drawing.rows(image, 0, height)
    averaged = np.empty((size[1], size[0], *image.shape[2:]), image.dtype)

    def supersampled() -> None:
        drawing.rows(image, 0, height)
        averaged[...] = 0.0
        for row in range(way.side):
            for column in range(way.side):
                np.add(averaged, image[row :: way.side, column :: way.side], out=averaged)
        np.multiply(averaged, averaged.dtype.type(1.0 / way.side**2), out=averaged)

    return supersampled


def _drawing(way: Way, scene: Scene, size: tuple[int, int] | None, *, clip: bool, cache: Place) -> Any:
    accuracy = way.variant if way.choices else drawn_as(scene, way.level)
    return draw(
        scene, accuracy, size=size, clip=clip, bake=way.bake, force=way.force, max_error=way.tolerance, cache=cache
    )


def field_of(
    way: Way, scene: Scene, size: tuple[int, int], *, cache: Place = None
) -> Callable[[Floats, Floats], Values]:
    """What gives the unclipped values of the way at points, as `evaluate` would."""

    def at(x: Floats, y: Floats) -> Values:
        if _changed(way):
            drawing = _drawing(way, scene, None, clip=False, cache=cache)
            values = np.empty(drawing.shape(x.size), drawing.dtype)
            drawing.points(values, x, y)
            if scene.channels == 3 and values.ndim == 1:
                return np.repeat(values[:, np.newaxis], 3, axis=1)
            return values
        found: Values = evaluate(scene, x, y, accuracy=way.accuracy, target=way.target, bake=way.bake, cache=cache)
        return found

    if way.side == 1:
        return at
    offsets = subsamples(scene, size, way.side)

    def averaged(x: Floats, y: Floats) -> Values:
        values: Values = np.mean([at(x + dx, y + dy) for dx, dy in offsets], axis=0)
        return values

    return averaged


def subsamples(scene: Scene, size: tuple[int, int], side: int) -> list[tuple[float, float]]:
    """The side x side offsets from a pixel's centre at which it is sampled, in scene units."""
    pixel = pixel_size(scene.in_camera_frame(), size[1])
    steps = [(k + 0.5) / side - 0.5 for k in range(side)]
    return [(pixel * u, pixel * v) for v in steps for u in steps]


def _numpy(way: Way, scene: Scene, size: tuple[int, int]) -> Ready:
    def drawn() -> object:
        return render_image(scene, *size, accuracy=way.level, backend="numpy")

    def at(x: Floats, y: Floats) -> Values:
        found: Values = evaluate(scene, x, y, accuracy=way.level, backend="numpy")
        return found

    return Ready(way, drawn, at)


def _lambdified(way: Way, scene: Scene, size: tuple[int, int]) -> Ready:
    """sympy's own way to numbers, of the closed form of this scene's plan; its time holds no grid and no clip."""
    import time

    import sympy as sp

    from symrender_cg.derive.image import derive
    from symrender_cg.derive.symbols import symbol
    from symrender_cg.run.grid import pixel_centres

    start = time.perf_counter()
    found = planned(scene)
    image = derive(found)
    numbers = numbers_of(found.scene)
    names = sorted(str(s) for s in image.as_piecewise().free_symbols)
    function = sp.lambdify([symbol(name) for name in names], image.as_piecewise(), modules="numpy", cse=way.cse)
    seconds = time.perf_counter() - start

    def at(x: Floats, y: Floats) -> Values:
        given = {**numbers, "x": x, "y": y}
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            values: Values = np.asarray(function(*(given[name] for name in names)))
        return values

    frame = scene.in_camera_frame()
    columns, rows = pixel_centres(*size, pixel_size(frame, size[1]))
    grid_x, grid_y = np.meshgrid(columns, rows)
    return Ready(way, lambda: at(grid_x, grid_y), at, derive=seconds)
