"""The numbers of one sphere and one light in the camera's frame: what the references take as exact.

Comes in: a Scene with one sphere and one light. Goes out: its camera-frame numbers as float64, or as whole numbers on a
grid of powers of two. Never done here: a ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from symrender_cg.errors import OutsidePlanError
from symrender_cg.scene import Colour, Gradient, PointLight, Scene

Vector: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class FrameNumbers:
    """One sphere and one light in the camera's frame; eye at (0, 0, eye), lengths in scene units."""

    eye: float
    half_height: float
    center: Vector
    radius: float
    light: Vector
    intensity: float
    ambient: float
    diffuse: float
    specular: float
    shininess: float
    gate_specular: bool
    background: float


def frame_numbers(scene: Scene) -> FrameNumbers:
    """The float64 numbers of `scene` in its camera's frame: exact from there on.

    Raises OutsidePlanError unless the scene is grey and has exactly one sphere and one point light.
    """
    for kind, members in (("spheres", scene.spheres), ("lights", scene.lights)):
        if len(members) != 1:
            raise OutsidePlanError(
                f"{kind}: {len(members)} of them; the references of one sphere take exactly one; "
                "compare scenes of one sphere and one light with them"
            )
    framed = scene.in_camera_frame()
    sphere, light = framed.spheres[0], framed.lights[0]
    material = sphere.material
    if not isinstance(light, PointLight):
        raise OutsidePlanError(f"lights[0]: a {type(light).__name__}; this reference takes one PointLight")
    half_height = framed.camera.half_height
    assert half_height is not None, "a scene in the camera's frame has a half_height"
    return FrameNumbers(
        eye=framed.camera.eye[2],
        half_height=half_height,
        center=sphere.center,
        radius=sphere.radius,
        light=light.position,
        intensity=_grey("lights[0].intensity", light.intensity),
        ambient=_grey("spheres[0].material.ambient", material.ambient),
        diffuse=_grey("spheres[0].material.diffuse", material.diffuse),
        specular=_grey("spheres[0].material.specular", material.specular),
        shininess=material.shininess,
        gate_specular=material.gate_specular,
        background=_grey("background", framed.background),
    )


def _grey(place: str, value: Colour | Gradient) -> float:
    if not isinstance(value, float):
        raise OutsidePlanError(f"{place}: {value} is not one number; this reference takes grey scenes")
    return value


def whole_numbers(values: tuple[float, ...]) -> tuple[int, ...]:
    """The values times the smallest power of two that makes all of them whole."""
    ratios = [value.as_integer_ratio() for value in values]
    unit = max(denominator for _, denominator in ratios)
    return tuple(numerator * (unit // denominator) for numerator, denominator in ratios)
