"""A scene in the camera's frame: eye at (0, 0, e), look_at at the origin, up along y, half_height a number.

Comes in: a Scene. Goes out: the same scene in that frame. Each coordinate is the float64 nearest to the true one (at
most half an ulp of itself), computed in whole numbers; a scene that is already in the frame keeps its numbers. From
there on these float64 numbers are the inputs, and every later "exact" means exact for them. Never done here: a change
of what is seen, or a repair of a scene that cannot be framed.
"""

from __future__ import annotations

from functools import lru_cache

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact
from symrender_cg.scene.exact import Vector
from symrender_cg.scene.framing import framed_half_height
from symrender_cg.scene.model import Camera, Plane, Scene, Sphere
from symrender_cg.scene.turning import Frame

ORIGIN: Vector = (0.0, 0.0, 0.0)
UP: Vector = (0.0, 1.0, 0.0)


def is_in_frame(camera: Camera) -> bool:
    """Whether eye = (0, 0, e) with e > 0, look_at = 0, and up has no x and a positive y."""
    eye, up = camera.eye, camera.up
    return camera.look_at == ORIGIN and eye[:2] == (0.0, 0.0) and eye[2] > 0.0 and up[0] == 0.0 and up[1] > 0.0


def in_camera_frame(scene: Scene) -> Scene:
    """The scene with Camera(eye=(0, 0, e), look_at=(0, 0, 0), up=(0, 1, 0), half_height=h); itself when it is that.

    With b = eye - look_at, r = up x b, and p a point minus look_at:
        e = |b|,  x = p.r / |r|,  y = p.(b x r) / (|b| |r|),  z = p.b / |b|.
    A direction is turned in the same way, without minus look_at, and keeps its length to rounding.
    Multiplying all lengths by 2^k multiplies the result by exactly 2^k, short of subnormal numbers.
    """
    camera = scene.camera
    if is_in_frame(camera) and camera.up == UP and camera.half_height is not None:
        return scene
    return _into_frame(scene)


@lru_cache(maxsize=32)
def _into_frame(scene: Scene) -> Scene:
    """The same for a scene that is not in the frame yet; remembered, as a scene is drawn more than once."""
    camera = scene.camera
    if is_in_frame(camera):
        e, spheres, lights = camera.eye[2], scene.spheres, scene.lights
        background, plane = scene.background, scene.plane
    else:
        frame = Frame(scene)
        e = frame.point("camera.eye", camera.eye)[2]
        spheres, lights = frame.spheres(scene.spheres), frame.lights(scene.lights)
        background, plane = frame.background(scene.background), frame.plane(scene.plane)
        _check_eye((0.0, 0.0, e), spheres, plane)
    half_height = framed_half_height(e, spheres) if camera.half_height is None else camera.half_height
    camera = Camera((0.0, 0.0, e), ORIGIN, UP, half_height)
    return Scene(camera, spheres, lights, background, plane, scene.shadows, scene.max_bounces)


def _check_eye(eye: Vector, spheres: tuple[Sphere, ...], plane: Plane | None) -> None:
    """Refuse a scene whose eye is outside every sphere and off the plane, but not so after rounding."""
    index = exact.first_not_outside(eye, spheres)
    if index is not None:
        sphere = spheres[index]
        raise SceneError(
            "camera.eye",
            f"{eye} in the camera's frame is so near spheres[{index}] (center {sphere.center}, radius "
            f"{sphere.radius!r} there) that rounding puts it on or in the sphere; expected an eye outside after "
            "rounding too; move it away by a few units in the last place, or write the scene with eye (0, 0, e) "
            "and look_at (0, 0, 0), which is not rounded",
        )
    if plane is not None and exact.side_of_plane(eye, plane.point, plane.normal) == 0:
        raise SceneError(
            "camera.eye",
            f"{eye} in the camera's frame is so near the plane (point {plane.point}, normal {plane.normal} there) that "
            "rounding puts it on the plane; expected an eye on one side after rounding too; move it away by a few "
            "units in the last place, or write the scene with eye (0, 0, e) and look_at (0, 0, 0), which is not "
            "rounded",
        )
