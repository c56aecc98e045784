"""What no plan covers: scenes of more than one sphere or light, and lengths so far apart that float64 cannot hold
their squares. Such a scene is refused before anything is derived.
"""

from __future__ import annotations

import math

from symrender_cg.errors import OutsidePlanError
from symrender_cg.scene import Scene

LARGEST_RATIO = 2.0**200
"""Largest ratio of the distances of eye and centre to the radius: its fifth power is still a float64."""

LARGEST_RATIO_OFF_AXIS = 2.0**50
"""The same off the axis, where the silhouette's place is a difference: 106 bits still settle a hit to 2^-40."""

LARGEST_RATIO_AT_EYE = 2.0**30
"""The same for a sphere that reaches the plane of the eye: the sign of m.D is then certain wherever disc's is."""

LARGEST_RATIO_AT_EYE_SINGLE = 2.0**15
"""The same in float32: the rays to such a sphere reach as many times beyond the distance of the image plane."""

LARGEST_RATIO_SINGLE = 2.0**60
"""The same for kernels that shade in float32: its square is still a float32."""

LARGEST_VIEW = 2.0**100
"""Largest ratio of half_height to the distance of the eye; 57 already see 178 degrees, an eye at a sphere needs 1e8."""

LARGEST_VIEW_SINGLE = 2.0**30
"""The same for kernels that shade in float32."""

SMALLEST_LENGTH = 2.0**-900
LARGEST_LENGTH = 2.0**1000


def require_supported(scene: Scene) -> None:
    """Raises OutsidePlanError unless the camera-frame scene is one that kernels can be proved right for."""
    if len(scene.spheres) != 1 or len(scene.lights) != 1:
        raise OutsidePlanError(
            f"scene: {len(scene.spheres)} spheres and {len(scene.lights)} lights; kernels are derived for one sphere "
            "and one light"
        )
    sphere, light = scene.spheres[0], scene.lights[0]
    eye = scene.camera.eye[2]
    places = {
        "camera.eye": (eye,),
        "spheres[0].radius": (sphere.radius,),
        "spheres[0].center": sphere.center,
        "lights[0].position": light.position,
    }
    for place, values in places.items():
        if max(abs(value) for value in values) > LARGEST_LENGTH:
            raise OutsidePlanError(f"{place}: {values} is longer than 2^1000; give the scene in another unit of length")
    for place, value in (("camera.eye", eye), ("spheres[0].radius", sphere.radius)):
        if value < SMALLEST_LENGTH:
            raise OutsidePlanError(
                f"{place}: {value} is below 2^-900 in the camera's frame; give the scene in another unit of length"
            )
    _require_view(scene, LARGEST_VIEW, "")
    off_axis = sphere.center[0] != 0.0 or sphere.center[1] != 0.0
    at_eye = eye - sphere.center[2] <= sphere.radius
    limit = LARGEST_RATIO_AT_EYE if at_eye else LARGEST_RATIO_OFF_AXIS if off_axis else LARGEST_RATIO
    if (ratio := spread(scene)) > limit:
        raise OutsidePlanError(
            f"spheres[0].radius: {sphere.radius} is {ratio:.3g} times smaller than the distance to the eye or the "
            f"offset of the centre; kernels for such a sphere are proved right up to {limit:.3g} times"
        )


def require_single(scene: Scene, *, at_eye: bool) -> None:
    """Raises OutsidePlanError where float32 cannot hold the squares that shading in it needs."""
    _require_view(scene, LARGEST_VIEW_SINGLE, " in float32: use 'double'")
    limit = LARGEST_RATIO_AT_EYE_SINGLE if at_eye else LARGEST_RATIO_SINGLE
    if (ratio := spread(scene)) > limit:
        raise OutsidePlanError(
            f"spheres[0].radius: {scene.spheres[0].radius} is {ratio:.3g} times smaller than the eye's distance or "
            f"the offset of the centre; float32 reaches {limit:.3g}: use 'double'"
        )


def _require_view(scene: Scene, largest: float, remedy: str) -> None:
    half_height, eye = scene.camera.half_height, scene.camera.eye[2]
    if half_height is not None and half_height / largest > eye:
        raise OutsidePlanError(
            f"camera.half_height: {half_height} is more than {largest:.3g} times the eye's distance {eye}; kernels "
            f"are not proved right for a view so wide{remedy}"
        )


def spread(scene: Scene) -> float:
    """The largest of eye distance and centre offset, in radii; infinity where the quotient overflows."""
    sphere = scene.spheres[0]
    longest = max(scene.camera.eye[2], *(abs(c) for c in sphere.center))
    exponent = math.frexp(longest)[1] - math.frexp(sphere.radius)[1]
    return math.inf if exponent > 1000 else longest / sphere.radius
