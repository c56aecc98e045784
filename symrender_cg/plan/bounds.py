"""What no plan covers: lengths so far apart that float64 cannot hold their squares, or that a kernel is not proved
right for. Such a scene is refused before anything is derived.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from symrender_cg.errors import OutsidePlanError
from symrender_cg.scene import PointLight, Scene, Sphere

LARGEST_RATIO = 2.0**200
"""Largest ratio of the distances of eye and centre to the radius: its fifth power is still a float64."""

LARGEST_RATIO_OFF_AXIS = 2.0**50
"""The same off the axis, where the silhouette's place is a difference: 106 bits still settle a hit to 2^-40."""

LARGEST_RATIO_AT_EYE = 2.0**30
"""The same for a sphere that reaches the plane of the eye: the sign of m.D is then certain wherever disc's is."""

LARGEST_RATIO_AT_EYE_SINGLE = 2.0**15
"""The same in float32: the rays to such a sphere reach as many times beyond the distance of the image plane."""

LARGEST_RATIO_SINGLE = 2.0**50
"""The same for kernels that shade in float32: products of distances on the image plane, down to its inverse square and
2^-25 of it, are still float32."""

LARGEST_VIEW = 2.0**100
"""Largest ratio of half_height to the distance of the eye; 57 already see 178 degrees, an eye at a sphere needs 1e8."""

LARGEST_VIEW_SINGLE = 2.0**30
"""The same for kernels that shade in float32."""

FARTHEST = 2.0**200
"""Largest ratio of any length to the distance of the eye, and of that to a radius, where a plan weighs several spheres,
lights or a plane against each other: products of four lengths stay in range."""

SMALLEST_LENGTH = 2.0**-900
LARGEST_LENGTH = 2.0**1000


def require_supported(scene: Scene) -> None:
    """Raises OutsidePlanError unless the kernel of one sphere can be proved right for the camera-frame scene."""
    require_lengths(scene)
    require_sphere(scene, 0)


def require_lengths(scene: Scene) -> None:
    """Raises OutsidePlanError where a length, or the view, is out of all range."""
    eye = scene.camera.eye[2]
    places: dict[str, tuple[float, ...]] = {"camera.eye": (eye,)}
    for index, sphere in enumerate(scene.spheres):
        places[f"spheres[{index}].radius"] = (sphere.radius,)
        places[f"spheres[{index}].center"] = sphere.center
    for index, light in enumerate(scene.lights):
        if isinstance(light, PointLight):
            places[f"lights[{index}].position"] = light.position
    for place, values in places.items():
        if max(abs(value) for value in values) > LARGEST_LENGTH:
            raise OutsidePlanError(f"{place}: {values} is longer than 2^1000; give the scene in another unit of length")
    radii = ((f"spheres[{index}].radius", sphere.radius) for index, sphere in enumerate(scene.spheres))
    for place, value in (("camera.eye", eye), *radii):
        if value < SMALLEST_LENGTH:
            raise OutsidePlanError(
                f"{place}: {value} is below 2^-900 in the camera's frame; give the scene in another unit of length"
            )
    _require_view(scene, LARGEST_VIEW, "")


def require_comparable(scene: Scene) -> None:
    """Raises OutsidePlanError where a length is too far from the distance of the eye to be weighed against others."""
    eye = scene.camera.eye[2]
    longest, smallest = FARTHEST * eye, eye / FARTHEST
    for index, sphere in enumerate(scene.spheres):
        x, y, z = sphere.center
        if not (-longest <= x <= longest and -longest <= y <= longest and -longest <= z <= longest):
            raise _incomparable(f"spheres[{index}].center", sphere.center, eye, "bring the sphere nearer")
        if not smallest <= sphere.radius <= longest:
            raise _incomparable(f"spheres[{index}].radius", sphere.radius, eye, "leave the sphere out")
    for index, light in enumerate(scene.lights):
        if isinstance(light, PointLight) and max(abs(value) for value in light.position) > longest:
            remedy = "a DirectionalLight is what it looks like"
            raise _incomparable(f"lights[{index}].position", light.position, eye, remedy)
    plane = scene.plane
    if plane is not None and max(abs(value) for value in plane.point) > longest:
        raise _incomparable("plane.point", plane.point, eye, "give a point of the plane that is nearer")


def _incomparable(place: str, value: object, eye: float, remedy: str) -> OutsidePlanError:
    return OutsidePlanError(
        f"{place}: {value} is more than 2^200 times longer or shorter than the eye's distance {eye}; scenes of several "
        f"surfaces or lights are planned within that; {remedy}"
    )


def require_spheres(scene: Scene, seen: Iterable[int]) -> None:
    """Raises OutsidePlanError, with the index, unless kernels can be proved right for each of the spheres seen."""
    for index in seen:
        require_sphere(scene, index)


def require_sphere(scene: Scene, index: int) -> None:
    """Raises OutsidePlanError unless the ratio of distances to the radius is one that kernels are proved right for."""
    sphere, eye = scene.spheres[index], scene.camera.eye[2]
    off_axis = sphere.center[0] != 0.0 or sphere.center[1] != 0.0
    at_eye = eye - sphere.center[2] <= sphere.radius
    limit = LARGEST_RATIO_AT_EYE if at_eye else LARGEST_RATIO_OFF_AXIS if off_axis else LARGEST_RATIO
    if (ratio := _spread(sphere, eye)) > limit:
        raise OutsidePlanError(
            f"spheres[{index}].radius: {sphere.radius} is {ratio:.3g} times smaller than the distance to the eye or "
            f"the offset of the centre; kernels for such a sphere are proved right up to {limit:.3g} times"
        )


def require_single(scene: Scene, index: int, *, at_eye: bool) -> None:
    """Raises OutsidePlanError where float32 cannot hold the squares that shading a sphere in it needs."""
    limit = LARGEST_RATIO_AT_EYE_SINGLE if at_eye else LARGEST_RATIO_SINGLE
    if (ratio := _spread(scene.spheres[index], scene.camera.eye[2])) > limit:
        raise OutsidePlanError(
            f"spheres[{index}].radius: {scene.spheres[index].radius} is {ratio:.3g} times smaller than the eye's "
            f"distance or the offset of the centre; float32 reaches {limit:.3g}: use 'double'"
        )


def require_single_view(scene: Scene) -> None:
    """Raises OutsidePlanError where the view is too wide for float32."""
    _require_view(scene, LARGEST_VIEW_SINGLE, " in float32: use 'double'")


def _require_view(scene: Scene, largest: float, remedy: str) -> None:
    half_height, eye = scene.camera.half_height, scene.camera.eye[2]
    if half_height is not None and half_height / largest > eye:
        raise OutsidePlanError(
            f"camera.half_height: {half_height} is more than {largest:.3g} times the eye's distance {eye}; kernels "
            f"are not proved right for a view so wide{remedy}"
        )


def _spread(sphere: Sphere, eye: float) -> float:
    """The largest of eye distance and centre offset, in radii; infinity where the quotient overflows."""
    longest = max(eye, *(abs(c) for c in sphere.center))
    exponent = math.frexp(longest)[1] - math.frexp(sphere.radius)[1]
    return math.inf if exponent > 1000 else longest / sphere.radius
