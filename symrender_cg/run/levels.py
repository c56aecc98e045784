"""What a level asks for: the kernel of its variant alone, or a `Job` for the stages that prove each value.

`stable` and `certified` are jobs. `double` becomes one where plain float64 would not keep its promise of 1e-15: a light
so close that rounding is magnified; and where a sign decides more than rounding may: a gated highlight, or r.v near 0
under an exponent below 1. Then the compensated kernel of `stable` draws, and where rounding is magnified by the
exponent alone, it draws the box of the image where the highlight is steep (steep.py). `fast` is `single`
where an exponent exceeds 1000: its cosines are too crude for that.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Literal

from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import MOST_ROUNDOFFS, Variant, variant
from symrender_cg.pipeline import planned
from symrender_cg.run.certificate import Job
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.steep import Box, roundoffs, steep_box
from symrender_cg.scene import Scene

MOST_SHININESS = 1000.0
"""The largest exponent that `fast` keeps its promise for."""


def drawn_as(scene: Scene, accuracy: str | Variant) -> str | Variant:
    """The level whose kernel draws the scene: the one that is asked for, but for `fast` under large exponents."""
    if accuracy != "fast":
        return accuracy
    materials = [sphere.material for sphere in scene.spheres]
    if scene.plane is not None:
        materials += [scene.plane.material, *([scene.plane.checker] if scene.plane.checker is not None else [])]
    return "single" if any(material.shininess > MOST_SHININESS for material in materials) else "fast"


def job_of(
    scene: Scene,
    accuracy: str | Variant,
    target: str | None = None,
    *,
    clip: bool,
    bake: bool = False,
    portable: bool = False,
    cache: str | Path | None = None,
    threads: int | None = None,
    aspect: float | None = None,
) -> Job | None:
    """The job of a level, or None where one kernel does it all; `aspect` is that of the image, None for any points.

    Raises ArgumentError for an unknown level or target.
    """
    chosen = variant(accuracy, target)
    if chosen.settles and bake:
        raise ArgumentError(f"bake: a kernel of {accuracy!r} takes its numbers as arguments; leave bake out")
    if not chosen.settles:
        if accuracy != "double" or bake or not hands_over(scene, aspect):
            return None
        chosen = variant("stable")
    return Job(scene, chosen, clip, portable, cache, threads)


def hands_over(scene: Scene, aspect: float | None = None) -> bool:
    """Whether plain float64 may be off by more than 1e-15 max(1, value) in what an image of that aspect, or any points,
    show of a scene, where that is one sphere under one light, and not in a small box of it alone (`steep_part`).

    A gated highlight, and an exponent below 1, are decided by signs; they are handed over whatever the roundoffs.
    """
    return _drawn(scene, aspect) == "stable"


def steep_part(scene: Scene, aspect: float | None = None) -> Box | None:
    """The box of the image plane where the kernel of `stable` draws for that of `double`; None where nothing, or where
    everything, is drawn so."""
    found = _drawn(scene, aspect)
    return found if isinstance(found, Box) else None


@lru_cache(maxsize=256)
def _drawn(scene: Scene, aspect: float | None) -> Literal["double", "stable"] | Box:
    """Which kernel draws a scene at `double`, or the box where two do."""
    found = planned(scene, aspect=aspect)
    if found.arrangement is not None:
        return "double"
    numbers = numbers_of(found.scene)
    shininess, k_specular = numbers["shininess"], numbers["k_specular"]
    material = found.scene.spheres[0].material
    if k_specular > 0.0 and (material.gate_specular or 0.0 < shininess < 1.0):
        return "stable"
    if roundoffs(numbers) <= MOST_ROUNDOFFS:
        return "double"
    return steep_box(numbers) or "stable"
