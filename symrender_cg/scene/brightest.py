"""The check that no intensity of a scene leaves float64.

Comes in: a Scene whose fields are checked. Goes out: nothing, or a SceneError at the material or the mirrors that are
too bright. Never done here: a limit on how bright a picture may be; clipping at 1 is the renderer's.

Per channel, with K a light's intensity / a of its attenuation (a + b l + c l^2; as it is when a = 0, where no distance
is ruled out and so no bound exists):
    a surface alone   L = ambient + (sum of the lights' K) (diffuse + specular)
    with mirrors      V_0 = max(L, background),  V_k = max(background, L + reflect V_(k-1)),  k up to max_bounces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from symrender_cg.errors import SceneError
from symrender_cg.scene import values
from symrender_cg.scene.lights import Light, PointLight
from symrender_cg.scene.materials import Phong
from symrender_cg.scene.surfaces import Gradient
from symrender_cg.scene.values import Colour

if TYPE_CHECKING:
    from symrender_cg.scene.model import Scene


def check_brightest(scene: Scene) -> None:
    """Refuse a scene in which an upper bound of some pixel's value is beyond float64."""
    channels = scene.channels
    totals = [sum(_strength(light, channel) for light in scene.lights) for channel in range(channels)]
    brightest, mirrored = [0.0] * channels, 0.0
    for place, material in _materials(scene):
        mirrored = max(mirrored, material.reflect)
        for channel, total in enumerate(totals):
            shade = _channel(material.diffuse, channel) + _channel(material.specular, channel)
            value = _channel(material.ambient, channel) + (total * shade if total and shade else 0.0)
            if not math.isfinite(value):
                raise SceneError(
                    place,
                    "ambient + (sum of the lights' intensities) (diffuse + specular) is beyond float64; expected a "
                    f"finite largest intensity, at most {values.LARGEST}; lower the coefficients or the lights",
                )
            brightest[channel] = max(brightest[channel], value)
    if mirrored == 0.0 or scene.max_bounces == 0:
        return
    for channel, local in enumerate(brightest):
        behind = _background(scene.background, channel)
        value = max(local, behind)
        for _ in range(scene.max_bounces):
            value = max(behind, local + mirrored * value)
        if not math.isfinite(value):
            raise SceneError(
                "max_bounces",
                f"after {scene.max_bounces} bounces the mirrored intensities add up to more than float64 holds; "
                f"expected a finite largest intensity, at most {values.LARGEST}; lower reflect, the coefficients or "
                "the lights",
            )


def _materials(scene: Scene) -> Iterator[tuple[str, Phong]]:
    """(place, material) of each distinct material, at its first place."""
    seen: set[int] = set()
    for index, sphere in enumerate(scene.spheres):
        if id(sphere.material) not in seen:
            seen.add(id(sphere.material))
            yield f"spheres[{index}].material", sphere.material
    if scene.plane is not None:
        yield "plane.material", scene.plane.material
        if scene.plane.checker is not None:
            yield "plane.checker", scene.plane.checker


def _strength(light: Light, channel: int) -> float:
    """The largest intensity of a light in one channel, over all distances; infinite where that is beyond float64."""
    intensity = _channel(light.intensity, channel)
    if not isinstance(light, PointLight) or intensity == 0.0:
        return intensity
    constant = light.attenuation[0]
    return intensity / constant if constant > 0.0 else intensity


def _background(background: Colour | Gradient, channel: int) -> float:
    if isinstance(background, Gradient):
        return max(_channel(background.bottom, channel), _channel(background.top, channel))
    return _channel(background, channel)


def _channel(colour: Colour, channel: int) -> float:
    return colour[channel] if isinstance(colour, tuple) else colour
