"""The scene model: a camera, spheres, lights, a plane, a background; frozen, checked, equal by value, hashable.

Comes in: numbers from Python or from a scene file. Goes out: a Scene of plain floats and tuples that has an image, or a
SceneError that names the value, its place, what was expected and what to do. Lengths share one unit of the user's
choice; intensities are linear, 1.0 is white. Never done here: rendering, symbols, or a decision about effects.

Every field has the value of Chapter 1's scene as its default: one unit sphere, an eye at distance 4, one light.
"""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike

from msgspec import Struct
from msgspec.structs import force_setattr

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact, values
from symrender_cg.scene.brightest import check_brightest
from symrender_cg.scene.camera import Camera
from symrender_cg.scene.exact import Vector
from symrender_cg.scene.lights import DirectionalLight, Light, PointLight
from symrender_cg.scene.materials import Phong
from symrender_cg.scene.surfaces import Gradient, Plane, Sphere
from symrender_cg.scene.values import Colour

__all__ = [
    "MOST_BOUNCES",
    "Camera",
    "Colour",
    "DirectionalLight",
    "Gradient",
    "Light",
    "Phong",
    "Plane",
    "PointLight",
    "Scene",
    "Sphere",
]

MOST_BOUNCES = 16
"""The largest `max_bounces` of a scene."""


class Scene(Struct, frozen=True, forbid_unknown_fields=True, cache_hash=True):
    """What is to be seen: a camera, spheres, lights, the background where nothing is hit, and perhaps a plane.

    background: a colour >= 0 or a Gradient. shadows: whether surfaces keep light from each other.
    max_bounces: how often a ray is mirrored before what is left of it is 0; 0 to 16.

    Raises SceneError where there is no image: eye in or on a sphere, or on the plane (decided exactly), or an intensity
    beyond float64.
    """

    camera: Camera = Camera()
    spheres: tuple[Sphere, ...] = (Sphere(),)
    lights: tuple[PointLight | DirectionalLight, ...] = (PointLight(),)
    background: Colour | Gradient = 0.0
    plane: Plane | None = None
    shadows: bool = True
    max_bounces: int = 4

    def __post_init__(self) -> None:
        values.instance("camera", self.camera, Camera, "Camera(eye=(0, 0, 4), look_at=(0, 0, 0))")
        force_setattr(
            self, "spheres", values.members("spheres", self.spheres, Sphere, "Sphere(center=(0, 0, 0), radius=1)")
        )
        kinds = (PointLight, DirectionalLight)
        force_setattr(self, "lights", values.members("lights", self.lights, kinds, "PointLight(position=(5, 5, 10))"))
        if not isinstance(self.background, Gradient):
            meaning, remedy = "the intensity of the background", "write 0 for black"
            force_setattr(self, "background", values.colour("background", self.background, meaning, remedy))
        if self.plane is not None:
            values.instance("plane", self.plane, Plane, "Plane(point=(0, -1, 0), normal=(0, 1, 0)), or None for none")
        force_setattr(self, "shadows", values.flag("shadows", self.shadows, "a switch"))
        meaning = "how often a ray is mirrored"
        force_setattr(self, "max_bounces", values.whole("max_bounces", self.max_bounces, meaning, MOST_BOUNCES))
        self._check_eye()
        check_brightest(self)

    def _check_eye(self) -> None:
        """Refuse an eye in or on a sphere, or on the plane."""
        eye = self.camera.eye
        index = exact.first_not_outside(eye, self.spheres)
        if index is not None:
            sphere = self.spheres[index]
            on = exact.excess_over_sphere(eye, sphere.center, sphere.radius) == 0
            raise SceneError(
                "camera.eye",
                f"{eye} is {'on' if on else 'inside'} spheres[{index}] (center {sphere.center}, radius "
                f"{sphere.radius!r}); expected an eye outside every sphere; move the eye or shrink the sphere",
            )
        plane = self.plane
        if plane is not None and exact.side_of_plane(eye, plane.point, plane.normal) == 0:
            raise SceneError(
                "camera.eye",
                f"{eye} is on the plane (point {plane.point}, normal {plane.normal}), which is seen from there as a "
                "line; expected an eye on one side of the plane; move the eye or the plane",
            )

    @property
    def channels(self) -> int:
        """3 when any colour of the scene is (red, green, blue), else 1: the image is (h, w, 3) or (h, w)."""
        return 3 if any(isinstance(colour, tuple) for colour in self._colours()) else 1

    @property
    def is_grey(self) -> bool:
        """Whether the channels of every colour are equal: one channel is then all there is to compute."""
        return all(not isinstance(c, tuple) or c[0] == c[1] == c[2] for c in self._colours())

    def _colours(self) -> Iterator[Colour]:
        """Every colour of the scene, each distinct material once."""
        if isinstance(self.background, Gradient):
            yield from (self.background.bottom, self.background.top)
        else:
            yield self.background
        for light in self.lights:
            yield light.intensity
        materials = {id(sphere.material): sphere.material for sphere in self.spheres}
        if self.plane is not None:
            materials |= {id(m): m for m in (self.plane.material, self.plane.checker) if m is not None}
        for material in materials.values():
            yield from (material.ambient, material.diffuse, material.specular)

    @classmethod
    def chapter1(
        cls,
        radius: float = 1.0,
        eye: float = 4.0,
        light: Vector = (5.0, 5.0, 10.0),
        ambient: float = 0.1,
        diffuse: float = 0.7,
        specular: float = 0.5,
        shininess: float = 32.0,
    ) -> Scene:
        """Chapter 1's scene: a sphere at the origin, the eye at (0, 0, eye), one light, black background.

        Source: Symbolic Rendering, Chapter 1 (Van Warren), the arguments of its render functions.
        """
        material = Phong(ambient, diffuse, specular, shininess)
        distance = values.finite("eye", eye, "the distance of the eye, a number")
        sphere = Sphere((0.0, 0.0, 0.0), radius, material)
        return cls(Camera(eye=(0.0, 0.0, distance)), (sphere,), (PointLight(light),))

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Scene:
        """The scene in a TOML file; its keys are the names of these classes' fields (docs/scenes.md).

        Raises SceneError: no such file, not TOML, an unknown key (with a suggestion), a value that is refused.
        """
        from symrender_cg.scene.files import read_scene

        return read_scene(path)

    def to_toml(self) -> str:
        """This scene as the text of a TOML file: every field, floats so that they read back bit for bit."""
        from symrender_cg.scene.files import write_scene

        return write_scene(self)

    @classmethod
    def builtin(cls, name: str) -> Scene:
        """A scene that comes with the package, by name. Raises SceneError with the names when there is none such."""
        from symrender_cg.scene.builtin import builtin_scene

        return builtin_scene(name)

    @staticmethod
    def builtin_names() -> tuple[str, ...]:
        """The names of the scenes that come with the package, in alphabetical order."""
        from symrender_cg.scene.builtin import builtin_names

        return builtin_names()

    def in_camera_frame(self) -> Scene:
        """The same scene seen from (0, 0, e) towards the origin with up (0, 1, 0) and a half_height that is a number.

        Exact when the scene is already in that frame; otherwise each coordinate is the float64 nearest to the true one.
        Raises SceneError when a number leaves float64, when rounding puts the eye on a sphere, or when the spheres
        cannot be framed.
        """
        from symrender_cg.scene.camera_frame import in_camera_frame

        return in_camera_frame(self)
