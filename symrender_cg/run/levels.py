"""What a level asks for: the kernel of its variant alone, or a `Job` for the stages that prove each value.

`stable` and `certified` are jobs. `double` becomes one where plain float64 would not keep its promise of 1e-15: a light
so close, or an exponent so large, that rounding is magnified; and where a sign decides more than rounding may: a gated
highlight, or r.v near 0 under an exponent below 1. Then the compensated kernel of `stable` draws. `fast` is `single`
where an exponent exceeds 1000: its cosines are too crude for that.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import MOST_ROUNDOFFS, Variant, variant
from symrender_cg.pipeline import planned
from symrender_cg.run.certify import Job
from symrender_cg.run.numbers import numbers_of
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
) -> Job | None:
    """The job of a level, or None where one kernel does it all. Raises ArgumentError for an unknown level or target."""
    chosen = variant(accuracy, target)
    if chosen.settles and bake:
        raise ArgumentError(f"bake: a kernel of {accuracy!r} takes its numbers as arguments; leave bake out")
    if not chosen.settles:
        if accuracy != "double" or bake or not hands_over(scene):
            return None
        chosen = variant("stable")
    return Job(scene, chosen, clip, portable, cache, threads)


@lru_cache(maxsize=256)
def hands_over(scene: Scene) -> bool:
    """Whether plain float64 may be off by more than 1e-15 in a scene of one sphere under one light.

    With d the distance of the light from the surface in radii, the largest errors measured over 2,400 points for each
    of 90 pairs (d, n), and over 1,000 points of 1,054 random scenes, stay below I_L (3 k_d / d + k_s max(13, 1 + 2.9
    sqrt(n)) (1 + 1 / (4 d))) roundoffs, and 2 for each unit of intensity by which the scene may be brighter than
    Chapter 1's 1.3; or below 9, where that is less.
    """
    found = planned(scene)
    if found.arrangement is not None:
        return False
    numbers = numbers_of(found.scene)
    shininess, k_specular = numbers["shininess"], numbers["k_specular"]
    material = found.scene.spheres[0].material
    if k_specular > 0.0 and (material.gate_specular or 0.0 < shininess < 1.0):
        return True
    away = math.dist(*([numbers[f"{what}_{axis}"] for axis in "xyz"] for what in ("light", "center")))
    distance = abs(away / numbers["radius"] - 1.0)
    if distance == 0.0:
        return True
    diffuse = 3.0 * numbers["k_diffuse"] / distance
    slope = max(13.0, 1.0 + 2.9 * math.sqrt(shininess)) if shininess > 0.0 else 1.0
    specular = k_specular * slope * (1.0 + 0.25 / distance)
    intensity = numbers["light_intensity"]
    brightest = numbers["k_ambient"] + intensity * (numbers["k_diffuse"] + k_specular)
    return intensity * (diffuse + specular) + 2.0 * max(0.0, brightest - 1.3) > MOST_ROUNDOFFS
