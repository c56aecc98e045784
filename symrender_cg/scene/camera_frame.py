"""Moving a scene to the camera's frame: eye at (0, 0, e), look_at at the origin, up along y; and framing it.

Comes in: a Scene. Goes out: the same scene in that frame, with a half_height that is a number. Each coordinate is the
float64 nearest to the true one (at most half an ulp of itself), computed in whole numbers; a scene that is already in
the frame keeps its numbers. From there on these float64 numbers are the inputs, and every later "exact" means exact for
them. Never done here: a change of what is seen, or a repair of a scene that cannot be framed.
"""

from __future__ import annotations

import math
from functools import lru_cache

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact
from symrender_cg.scene.exact import Vector
from symrender_cg.scene.model import Camera, PointLight, Scene, Sphere
from symrender_cg.scene.values import LARGEST

ORIGIN: Vector = (0.0, 0.0, 0.0)
UP: Vector = (0.0, 1.0, 0.0)
MARGIN = 1.25
"""Half-height of the image over the half-height of what is seen in it, as in Chapter 1."""


def is_in_frame(camera: Camera) -> bool:
    """Whether eye = (0, 0, e) with e > 0, look_at = 0, and up has no x and a positive y."""
    eye, up = camera.eye, camera.up
    return camera.look_at == ORIGIN and eye[:2] == (0.0, 0.0) and eye[2] > 0.0 and up[0] == 0.0 and up[1] > 0.0


def in_camera_frame(scene: Scene) -> Scene:
    """The scene with Camera(eye=(0, 0, e), look_at=(0, 0, 0), up=(0, 1, 0), half_height=h); itself when it is that.

    With b = eye - look_at, r = up x b, and p a point minus look_at:
        e = |b|,  x = p.r / |r|,  y = p.(b x r) / (|b| |r|),  z = p.b / |b|.
    Multiplying all lengths by 2^k multiplies the result by exactly 2^k, short of subnormal numbers.
    """
    camera = scene.camera
    if is_in_frame(camera) and camera.up == UP and camera.half_height is not None:
        return scene
    return _into_frame(scene)


@lru_cache(maxsize=256)
def _into_frame(scene: Scene) -> Scene:
    """The same for a scene that is not in the frame yet; remembered, as a scene is drawn more than once."""
    camera = scene.camera
    if is_in_frame(camera):
        e, spheres, lights = camera.eye[2], scene.spheres, scene.lights
    else:
        e, spheres, lights = _moved(scene)
        _check_eye_outside((0.0, 0.0, e), spheres)
    half_height = framed_half_height(e, spheres) if camera.half_height is None else camera.half_height
    return Scene(Camera((0.0, 0.0, e), ORIGIN, UP, half_height), spheres, lights, scene.background)


def _moved(scene: Scene) -> tuple[float, tuple[Sphere, ...], tuple[PointLight, ...]]:
    """(e, spheres, lights) with their points in the camera's frame."""
    camera = scene.camera
    points = [camera.eye, camera.look_at, *(s.center for s in scene.spheres), *(li.position for li in scene.lights)]
    grid = exact.grid_of(coordinate for point in points for coordinate in point)
    look_at = exact.vector_on_grid(camera.look_at, grid)
    backward = exact.difference(exact.vector_on_grid(camera.eye, grid), look_at)
    right = exact.cross(exact.vector_on_grid(camera.up, exact.grid_of(camera.up)), backward)
    upward = exact.cross(backward, right)
    backward_square, right_square = exact.dot(backward, backward), exact.dot(right, right)
    axes = ((right, right_square), (upward, backward_square * right_square), (backward, backward_square))

    def moved(place: str, point: Vector) -> Vector:
        offset = exact.difference(exact.vector_on_grid(point, grid), look_at)
        try:
            x, y, z = (exact.nearest_root(exact.dot(offset, axis), square, grid) for axis, square in axes)
        except OverflowError:
            raise SceneError(
                place,
                f"{point} leaves the range of float64 when it is moved to the camera's frame; expected coordinates of "
                f"at most {LARGEST} there; use a larger unit of length or bring the point nearer",
            ) from None
        return x, y, z

    e = moved("camera.eye", camera.eye)[2]
    spheres = tuple(
        Sphere(moved(f"spheres[{index}].center", sphere.center), sphere.radius, sphere.material)
        for index, sphere in enumerate(scene.spheres)
    )
    lights = tuple(
        PointLight(moved(f"lights[{index}].position", light.position), light.intensity)
        for index, light in enumerate(scene.lights)
    )
    return e, spheres, lights


def _check_eye_outside(eye: Vector, spheres: tuple[Sphere, ...]) -> None:
    """Refuse a scene whose eye is outside every sphere, but not outside every sphere after rounding."""
    for index, sphere in enumerate(spheres):
        if exact.excess_over_sphere(eye, sphere.center, sphere.radius) <= 0:
            raise SceneError(
                "camera.eye",
                f"{eye} in the camera's frame is so near spheres[{index}] (center {sphere.center}, radius "
                f"{sphere.radius!r} there) that rounding puts it on or in the sphere; expected an eye outside after "
                "rounding too; move it away by a few units in the last place, or write the scene with eye (0, 0, e) "
                "and look_at (0, 0, 0), which is not rounded",
            )


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
            half_height = max(_outline_half_height(index, e, sphere) for index, sphere in enumerate(spheres))
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
