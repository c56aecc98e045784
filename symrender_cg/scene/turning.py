"""Turning the parts of a scene into the camera's frame: every coordinate the float64 nearest to the true one.

Comes in: a Scene and its points and directions. Goes out: the same parts in the frame in which the eye is (0, 0, e),
look_at the origin and up along y. Never done here: two roundings of one number.
"""

from __future__ import annotations

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact
from symrender_cg.scene.exact import GridVector, Vector
from symrender_cg.scene.lights import DirectionalLight, Light, PointLight
from symrender_cg.scene.model import Scene
from symrender_cg.scene.surfaces import Gradient, Plane, Sphere
from symrender_cg.scene.values import LARGEST, Colour

_SHORTEST, _LONGEST = 2.0**-960, 2.0**1022
"""A direction shorter or longer than these is scaled by a power of two first: turned, it would leave float64."""


class Frame:
    """The axes of a scene's camera in whole numbers: right = up x b, upward = b x right, backward b = eye - look_at."""

    def __init__(self, scene: Scene) -> None:
        camera = scene.camera
        points = [camera.eye, camera.look_at, *(sphere.center for sphere in scene.spheres)]
        points += [light.position for light in scene.lights if isinstance(light, PointLight)]
        if scene.plane is not None:
            points.append(scene.plane.point)
        self._grid = exact.grid_of(coordinate for point in points for coordinate in point)
        self._look_at = exact.vector_on_grid(camera.look_at, self._grid)
        backward = exact.difference(exact.vector_on_grid(camera.eye, self._grid), self._look_at)
        right = exact.cross(exact.vector_on_grid(camera.up, exact.grid_of(camera.up)), backward)
        upward = exact.cross(backward, right)
        backward_square, right_square = exact.dot(backward, backward), exact.dot(right, right)
        self._axes = tuple(
            _without_common_powers_of_two(axis, square)
            for axis, square in (
                (right, right_square),
                (upward, backward_square * right_square),
                (backward, backward_square),
            )
        )

    def _turned(self, offset: GridVector, grid: int) -> Vector:
        """An offset in units of 2^grid along the three axes; raises OverflowError beyond float64."""
        x, y, z = (exact.nearest_root(exact.dot(offset, axis), square, grid) for axis, square in self._axes)
        return x, y, z

    def point(self, place: str, point: Vector) -> Vector:
        """A point of the scene in the frame. Raises SceneError at `place` when a coordinate leaves float64."""
        offset = exact.difference(exact.vector_on_grid(point, self._grid), self._look_at)
        try:
            return self._turned(offset, self._grid)
        except OverflowError:
            raise SceneError(
                place,
                f"{point} leaves the range of float64 when it is moved to the camera's frame; expected coordinates of "
                f"at most {LARGEST} there; use a larger unit of length or bring the point nearer",
            ) from None

    def direction(self, direction: Vector) -> Vector:
        """A direction in the frame, of the same length to rounding; times a power of two where float64 ends."""
        grid = exact.grid_of(direction)
        offset = exact.vector_on_grid(direction, grid)
        largest = max(map(abs, direction))
        if largest < _SHORTEST:
            grid += 60
        elif largest >= _LONGEST:
            grid -= 2
        return self._turned(offset, grid)

    def spheres(self, spheres: tuple[Sphere, ...]) -> tuple[Sphere, ...]:
        """The spheres in the frame; radius and material as they are."""
        return tuple(
            Sphere(self.point(f"spheres[{index}].center", sphere.center), sphere.radius, sphere.material)
            for index, sphere in enumerate(spheres)
        )

    def lights(self, lights: tuple[Light, ...]) -> tuple[Light, ...]:
        """The lights in the frame."""
        return tuple(self._light(f"lights[{index}].position", light) for index, light in enumerate(lights))

    def _light(self, place: str, light: Light) -> Light:
        if isinstance(light, DirectionalLight):
            return DirectionalLight(self.direction(light.direction), light.intensity)
        return PointLight(self.point(place, light.position), light.intensity, light.attenuation)

    def plane(self, plane: Plane | None) -> Plane | None:
        """The plane in the frame. Raises SceneError when rounding makes its axis parallel to its normal."""
        if plane is None:
            return None
        point = self.point("plane.point", plane.point)
        normal, axis = self.direction(plane.normal), self.direction(plane.axis)
        try:
            return Plane(point, normal, plane.material, plane.checker, plane.tile, axis)
        except SceneError:
            raise SceneError(
                "plane.axis",
                f"{plane.axis} is so near the normal {plane.normal} that rounding makes them parallel in the camera's "
                "frame; expected a direction that leans away from the normal; turn the axis away from it",
            ) from None

    def background(self, background: Colour | Gradient) -> Colour | Gradient:
        """The background in the frame."""
        if not isinstance(background, Gradient):
            return background
        return Gradient(background.bottom, background.top, self.direction(background.up))


def _without_common_powers_of_two(axis: GridVector, square: int) -> tuple[GridVector, int]:
    """axis / 2^k and square / 4^k, the same ratio in shorter numbers; square = |axis|^2, so 4^k divides it too."""
    k = min(((entry & -entry).bit_length() - 1 for entry in axis if entry), default=0)
    x, y, z = axis
    return (x >> k, y >> k, z >> k), square >> 2 * k
