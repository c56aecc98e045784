"""What is proved of a level's values whatever the scene: half an ulp or four, in numbers of this scene.

Comes in: a Scene, a level. Goes out: bounds, absolute and in ulp. Never done here: a measurement.

The intensity of a scene is at most, in each channel and with K a light's intensity over its constant attenuation,

    L = ambient + (sum of K) (diffuse + specular),    and with mirrors V_k = max(background, L + reflect V_(k-1)).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from symrender_cg.lower.variants import Variant
from symrender_cg.scene import Colour, Gradient, Phong, PointLight, Scene

ULP: Final = {"ulp": 4.0, "float64": 0.5, "float32": 0.5}
"""What a variant that settles its values proves, in units of the last place of its format."""
_ROUNDED_UP: Final = 1.0 + 2.0**-40


def brightest(scene: Scene) -> float:
    """An upper bound of the intensity of any point, the largest channel; inf where attenuation leaves none."""
    strength = _lights(scene)
    if math.isinf(strength):
        return math.inf
    behind = _background(scene)
    local, mirrored = 0.0, 0.0
    for material in _materials(scene):
        local = max(local, _largest(material.ambient) + strength * _shade(material))
        mirrored = max(mirrored, material.reflect)
    value = max(local, behind)
    for _ in range(scene.max_bounces if mirrored > 0.0 else 0):
        value = max(behind, local + mirrored * value)
    return value * _ROUNDED_UP


def strength_of_highlights(scene: Scene) -> float:
    """The intensity that the highlights of a point may have, the largest channel; mirrored ones left out."""
    return min(_lights(scene), 1e30) * max((_largest(one.specular) for one in _materials(scene)), default=0.0)


def _lights(scene: Scene) -> float:
    """The sum of the lights' intensities, each over its constant attenuation; inf where that is 0."""
    strength = 0.0
    for light in scene.lights:
        constant = light.attenuation[0] if isinstance(light, PointLight) else 1.0
        if constant == 0.0:
            return math.inf
        strength += _largest(light.intensity) / constant
    return strength


def proved_bounds(scene: Scene, variant: Variant) -> tuple[float, float] | None:
    """(absolute, ulp) that no value of a variant exceeds, in its own format; None where nothing is proved.

    Grey levels are as intensities within half a level of those of the image cut to [0, 1]; 0.5 is in levels.
    """
    if variant.settles is None:
        return None
    if variant.settles == "uint8":
        return 0.5 / 255.0, 0.5
    ulp = ULP[variant.settles]
    top = brightest(scene)
    if not math.isfinite(top):
        return math.inf, ulp
    unit = float(np.spacing(np.float32(top))) if variant.settles == "float32" else float(np.spacing(top))
    return ulp * unit, ulp


def _materials(scene: Scene) -> list[Phong]:
    found = [sphere.material for sphere in scene.spheres]
    if scene.plane is not None:
        found += [scene.plane.material, *([scene.plane.checker] if scene.plane.checker is not None else [])]
    return found


def _shade(material: Phong) -> float:
    return _largest(material.diffuse) + _largest(material.specular)


def _background(scene: Scene) -> float:
    if isinstance(scene.background, Gradient):
        return max(_largest(scene.background.bottom), _largest(scene.background.top))
    return _largest(scene.background)


def _largest(colour: Colour) -> float:
    return max(colour) if isinstance(colour, tuple) else colour
