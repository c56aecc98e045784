"""`draw`: a scene bound to its kernel, ready to write an image or values at points.

In: a scene, a level, a size. Out: a Drawing, with what settles the points that rounding decided. Never here: an image,
or a level that is proved in stages.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import Variant, variant
from symrender_cg.pipeline.kernels import kernel_of
from symrender_cg.pipeline.plans import pixel_size, planned
from symrender_cg.pipeline.proving import settling_kernel
from symrender_cg.run.drawing import Drawing, bind
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.steep_rows import Steep
from symrender_cg.scene import Scene

Floats = NDArray[np.float64]


def draw(
    scene: Scene,
    accuracy: str | Variant = "double",
    *,
    size: tuple[int, int] | None = None,
    clip: bool = False,
    bake: bool = False,
    portable: bool = False,
    force: Iterable[str] = (),
    max_error: float = 0.0,
    cache: str | Path | None = None,
) -> Drawing:
    """A scene bound to its kernel: for an image of `size` (width, height) pixels, or for points where it is None.

    Raises ArgumentError for a level that several stages prove: no kernel draws it alone.
    """
    if variant(accuracy).settles:
        raise ArgumentError(
            f"accuracy: {variant(accuracy).name!r} is proved value by value, in stages; expected a level that one "
            "kernel draws alone: 'fast', 'single', 'literal' or 'double'"
        )
    aspect = None if size is None else size[0] / size[1]
    found = planned(scene, force=tuple(force), aspect=aspect, max_error=max_error)
    kernel = kernel_of(found, variant(accuracy), bake=bake, portable=portable, cache=cache)
    white = 1.0 if clip else math.inf
    decide = partial(_decided, scene, aspect, portable, cache) if found.arrangement is not None else None
    steep = _steep(scene, accuracy, aspect, portable, cache) if found.arrangement is None and not bake else None
    if size is None:
        return bind(kernel, found, white=white, decide=decide, steep=steep)
    pixel = pixel_size(found.scene, size[1])
    return bind(kernel, found, width=size[0], height=size[1], pixel=pixel, white=white, decide=decide, steep=steep)


def _steep(
    scene: Scene, accuracy: str | Variant, aspect: float | None, portable: bool, cache: str | Path | None
) -> Steep | None:
    """What draws the box of an image at `double` where the highlight is too steep for its kernel."""
    from symrender_cg.run.levels import steep_part

    if accuracy != "double" or (box := steep_part(scene, aspect)) is None:
        return None
    return Steep(
        box,
        partial(_stable_kernel, scene, aspect, portable, cache),
        partial(_stable_values, scene, portable, cache),
        partial(_stable_pixels, scene, portable, cache),
    )


def _stable_kernel(
    scene: Scene, aspect: float | None, portable: bool, cache: str | Path | None
) -> tuple[SettlingKernel, Any]:
    """The kernel of `stable` and the scene's numbers."""
    found = settling_kernel(scene, variant("stable"), aspect=aspect, portable=portable, cache=cache)
    assert found is not None, "it is one sphere under one light"
    kernel, frame = found
    return kernel, kernel.numbers(numbers_of(frame))


def _stable_values(scene: Scene, portable: bool, cache: str | Path | None, x: Floats, y: Floats) -> Any:
    """Values within 4 ulp at points."""
    from symrender_cg.run.certificate import Job
    from symrender_cg.run.certify import settle_points

    return settle_points(Job(scene, variant("stable"), False, portable, cache, 1), x, y).values


def _stable_pixels(
    scene: Scene, portable: bool, cache: str | Path | None, places: NDArray[np.intp], width: int, height: int
) -> Any:
    """Values within 4 ulp of pixels that the kernel of `stable` leaves open."""
    from symrender_cg.run.certificate import Job
    from symrender_cg.run.certify import settle_by_oracle
    from symrender_cg.run.settling_many import enclosed_many

    job = Job(scene, variant("stable"), False, portable, cache, 1)
    values, known = enclosed_many([job], [places], width, height, 1)[0]
    if not known.all():
        values[~known, 0] = settle_by_oracle(job, width, height, places[~known])
    return values[:, 0]


def _decided(
    scene: Scene, aspect: float | None, portable: bool, cache: str | Path | None, x: Floats, y: Floats
) -> tuple[Any, Any]:
    """Values within 4 ulp at points where rounding decided a kernel of a scene, and which of them are known."""
    from symrender_cg.run.certificate import Job
    from symrender_cg.run.certify import settle_if_known

    return settle_if_known(Job(scene, variant("stable"), False, portable, cache, 1), x, y, aspect)
