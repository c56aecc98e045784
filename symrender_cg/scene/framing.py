"""The half-height that frames the spheres of a scene, as Chapter 1 frames its own.

Comes in: the distance of the eye and the spheres in the camera's frame. Goes out: a half-height > 0. A plane has no
outline and is not framed. Never done here: a guess where the outline of a sphere has no end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact
from symrender_cg.scene.exact import Vector
from symrender_cg.scene.surfaces import Sphere

MARGIN = 1.25
"""Half-height of the image over the half-height of what is seen in it, as in Chapter 1."""

ORIGIN: Vector = (0.0, 0.0, 0.0)


def framed_half_height(e: float, spheres: tuple[Sphere, ...]) -> float:
    """1.25 times the largest |x| or |y| of the spheres' outlines on the plane z = 0, seen from (0, 0, e).

    spheres: in the camera's frame. One sphere at the origin: 1.25 e R / sqrt(e^2 - R^2) in the order of operations of
    Chapter 1. Spheres wholly behind the eye are left out while another one is in front. Without any sphere every frame
    shows the same background, and the half-height is e (a view of 90 degrees).

    Raises SceneError where the outline is not bounded (a sphere reaches the plane through the eye), where nothing is in
    front, or where the frame is beyond float64.
    """
    if not spheres:
        return e
    try:
        if len(spheres) == 1 and spheres[0].center == ORIGIN:
            half_height = _chapter_1_half_height(e, spheres[0].radius)
        else:
            half_height = max(
                (_outline_half_height(index, e, spheres[index]) for index in _widest(e, spheres)), default=0.0
            )
    except OverflowError:
        half_height = math.inf
    if half_height == 0.0:
        if all(sphere.center[2] >= e for sphere in spheres):
            raise SceneError(
                "camera.half_height",
                "no sphere is in front of the eye, so there is nothing to frame; expected a half-height in scene "
                "units; give one, or turn the camera with look_at",
            )
        raise _cannot_frame("smaller than the smallest float64")
    if math.isinf(half_height):
        raise _cannot_frame("larger than the largest float64")
    return half_height


def _widest(e: float, spheres: tuple[Sphere, ...]) -> Iterator[int]:
    """Indices of the spheres whose outline may reach furthest, in order; the others are proved to reach less far.

    The slope (k m + R root) / ((k - R)(k + R)), root = sqrt((k - R)(k + R) + m^2), is taken in float64 where it is good
    to 1e-9: k - R > 1e-6 k, so the rounding of k = e - z is at most 2e-10 of k - R, and all else is sums of positive
    numbers far from both ends of float64. Any other sphere is kept, except one surely behind the eye.
    """
    reach: list[tuple[int, float]] = []
    for index, sphere in enumerate(spheres):
        x, y, z = sphere.center
        radius, k, m = sphere.radius, e - z, max(abs(x), abs(y))
        if radius > 1e-100 and k - radius > 1e-6 * k and k + m < 1e100:
            square = (k - radius) * (k + radius)
            reach.append((index, (k * m + radius * math.sqrt(square + m * m)) / square))
        elif not -1e100 < k < -1.000001 * radius:
            reach.append((index, math.inf))
    finite = max((slope for _, slope in reach if slope < math.inf), default=0.0)
    return (index for index, slope in reach if slope >= finite * (1.0 - 1e-6))


def _cannot_frame(reason: str) -> SceneError:
    return SceneError(
        "camera.half_height",
        f"the half-height that frames the spheres is {reason}; expected a half-height in scene units; give one",
    )


def _chapter_1_half_height(e: float, radius: float) -> float:
    """1.25 e R / sqrt(e^2 - R^2), the order of operations of Chapter 1, free of overflow.

    e and R are brought to [1, 2) by powers of two first: the bits are those of the plain expression where that neither
    overflows nor underflows. The power of two is a product: libm's pow(e, 2) may differ from it in the last place.
    """
    significand, exponent = math.frexp(e)
    e_scaled = 2.0 * significand
    radius_scaled = math.ldexp(radius, 1 - exponent)
    radius_significand, radius_exponent = math.frexp(radius)
    root = math.sqrt(e_scaled * e_scaled - radius_scaled * radius_scaled)
    return math.ldexp(MARGIN * e_scaled * radius_significand / root, radius_exponent)


def _outline_half_height(index: int, e: float, sphere: Sphere) -> float:
    """1.25 e (k m + R sqrt(k^2 + m^2 - R^2)) / (k^2 - R^2), m = max(|m_x|, |m_y|), k = -m_z; 0 when behind the eye.

    With m = center - eye. The plane through the eye and the horizontal line of the image at height e s touches the
    sphere when |m_y - s k| = R sqrt(1 + s^2); the outer root of this quadratic in s is the slope above, it grows with
    |m_y|.
    The root is taken to 64 bits below its last whole digit and the ratio is rounded once.
    """
    grid = exact.grid_of((e, *sphere.center, sphere.radius))
    e_units, radius = exact.on_grid(e, grid), exact.on_grid(sphere.radius, grid)
    x, y, z = exact.vector_on_grid(sphere.center, grid)
    k, m = e_units - z, max(abs(x), abs(y))
    if k <= -radius:
        return 0.0
    if k <= radius:
        raise SceneError(
            "camera.half_height",
            f"spheres[{index}] (center {sphere.center}, radius {sphere.radius!r} in the camera's frame, eye at {e!r}) "
            "reaches the plane through the eye, so its outline has no end to frame; expected a half-height in scene "
            "units; give one",
        )
    bits = 64
    root = math.isqrt(radius * radius * (k * k + m * m - radius * radius) << 2 * bits)
    numerator = 5 * e_units * ((k * m << bits) + root)
    denominator = 4 * (k * k - radius * radius) << bits
    return exact.nearest_ratio(numerator, denominator, grid)
