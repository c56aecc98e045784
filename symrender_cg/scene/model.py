"""The scene model: camera, spheres with their material, point lights, background; frozen, checked, equal by value.

Comes in: numbers from Python or from a scene file. Goes out: a Scene of plain floats and tuples that has an image, or a
SceneError that names the value, its place, what was expected and what to do. Lengths share one unit of the user's
choice; intensities are linear, 1.0 is white. Never done here: rendering, symbols, or a decision about effects.

Every field has the value of Chapter 1's scene as its default: one unit sphere, an eye at distance 4, one light.
"""

from __future__ import annotations

import math
from os import PathLike

from msgspec import Struct
from msgspec.structs import force_setattr

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact, values
from symrender_cg.scene.exact import Vector


class Phong(Struct, frozen=True, forbid_unknown_fields=True):
    """I = ambient + sum over lights of intensity (diffuse max(0, n.l) + specular max(0, r.v)^shininess)   (Phong 1975)

    Four numbers >= 0 without a unit; a sum above 1 is allowed, clipping is the renderer's last step.
    gate_specular: True adds the specular term only where n.l > 0, so that a light behind a surface leaves no highlight.
    """

    ambient: float = 0.1
    diffuse: float = 0.7
    specular: float = 0.5
    shininess: float = 32.0
    gate_specular: bool = False

    def __post_init__(self) -> None:
        for name in ("ambient", "diffuse", "specular"):
            meaning, remedy = f"the {name} coefficient", "write 0 to leave the term out"
            force_setattr(self, name, values.non_negative(name, getattr(self, name), meaning, remedy))
        shininess = values.non_negative("shininess", self.shininess, "a shininess", "a wide highlight has one near 1")
        force_setattr(self, "shininess", shininess)
        force_setattr(self, "gate_specular", values.flag("gate_specular", self.gate_specular, "a switch"))


class Sphere(Struct, frozen=True, forbid_unknown_fields=True):
    """|X - center| = radius, with its material; center and radius in scene units, radius > 0."""

    center: Vector = (0.0, 0.0, 0.0)
    radius: float = 1.0
    material: Phong = Phong()

    def __post_init__(self) -> None:
        force_setattr(self, "center", values.vector("center", self.center, "the centre of a sphere"))
        remedy = "leave the sphere out of the scene if it should not be seen"
        force_setattr(self, "radius", values.positive("radius", self.radius, "a radius in scene units", remedy))
        values.instance("material", self.material, Phong, "Phong(ambient=0.1, diffuse=0.7, specular=0.5, shininess=32)")


class PointLight(Struct, frozen=True, forbid_unknown_fields=True):
    """A light at `position` (scene units), `intensity` >= 0, the same at every distance; it may lie inside a sphere."""

    position: Vector = (5.0, 5.0, 10.0)
    intensity: float = 1.0

    def __post_init__(self) -> None:
        force_setattr(self, "position", values.vector("position", self.position, "the position of a light"))
        remedy = "write 0 to switch the light off"
        force_setattr(self, "intensity", values.non_negative("intensity", self.intensity, "an intensity", remedy))


class Camera(Struct, frozen=True, forbid_unknown_fields=True):
    """A pinhole at `eye`; its image plane passes through `look_at`, perpendicular to the view.

    `up` is a direction of any length > 0 that is not parallel to the view; its part along the view has no effect.
    `half_height` is the vertical half-extent of the image on that plane, in scene units, > 0; None frames the spheres.
    """

    eye: Vector = (0.0, 0.0, 4.0)
    look_at: Vector = (0.0, 0.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    half_height: float | None = None

    def __post_init__(self) -> None:
        force_setattr(self, "eye", values.vector("eye", self.eye, "the position of the eye"))
        force_setattr(self, "look_at", values.vector("look_at", self.look_at, "the point that the eye looks at"))
        force_setattr(self, "up", values.vector("up", self.up, "the direction that is up in the image"))
        if self.half_height is not None:
            meaning, remedy = "half the height of the image in scene units", "leave it out to frame the spheres"
            force_setattr(self, "half_height", values.positive("half_height", self.half_height, meaning, remedy))
        if self.eye == self.look_at:
            raise SceneError(
                "eye", f"{self.eye} is also look_at, so there is no direction of view; expected two points; move one"
            )
        if self.up == (0.0, 0.0, 0.0):
            raise SceneError(
                "up", "(0.0, 0.0, 0.0) has no direction; expected a vector of length > 0, such as (0, 1, 0)"
            )
        if not any(exact.cross(self._grid_up(), self._grid_backward())):
            raise SceneError(
                "up",
                f"{self.up} is parallel to the view from eye {self.eye} to look_at {self.look_at}; expected a "
                "direction that leans away from it; for a view straight down (0, 0, -1) or (1, 0, 0) will do",
            )

    def _grid_up(self) -> exact.GridVector:
        return exact.vector_on_grid(self.up, exact.grid_of(self.up))

    def _grid_backward(self) -> exact.GridVector:
        grid = exact.grid_of((*self.eye, *self.look_at))
        return exact.difference(exact.vector_on_grid(self.eye, grid), exact.vector_on_grid(self.look_at, grid))


class Scene(Struct, frozen=True, forbid_unknown_fields=True):
    """What is to be seen: a camera, spheres, point lights, and `background` >= 0, the intensity where no sphere is hit.

    Raises SceneError where there is no image: eye in or on a sphere (decided exactly), or an intensity beyond float64.
    """

    camera: Camera = Camera()
    spheres: tuple[Sphere, ...] = (Sphere(),)
    lights: tuple[PointLight, ...] = (PointLight(),)
    background: float = 0.0

    def __post_init__(self) -> None:
        values.instance("camera", self.camera, Camera, "Camera(eye=(0, 0, 4), look_at=(0, 0, 0))")
        force_setattr(
            self, "spheres", values.members("spheres", self.spheres, Sphere, "Sphere(center=(0, 0, 0), radius=1)")
        )
        force_setattr(
            self, "lights", values.members("lights", self.lights, PointLight, "PointLight(position=(5, 5, 10))")
        )
        meaning, remedy = "the intensity of the background", "write 0 for black"
        force_setattr(self, "background", values.non_negative("background", self.background, meaning, remedy))
        eye = self.camera.eye
        for index, sphere in enumerate(self.spheres):
            excess = exact.excess_over_sphere(eye, sphere.center, sphere.radius)
            if excess <= 0:
                raise SceneError(
                    "camera.eye",
                    f"{eye} is {'on' if excess == 0 else 'inside'} spheres[{index}] (center {sphere.center}, radius "
                    f"{sphere.radius!r}); expected an eye outside every sphere; move the eye or shrink the sphere",
                )
        self._check_brightest()

    def _check_brightest(self) -> None:
        """Refuse coefficients whose largest sum, ambient + sum of intensity (diffuse + specular), overflows."""
        total = sum(light.intensity for light in self.lights)
        for index, sphere in enumerate(self.spheres):
            material = sphere.material
            brightest = material.ambient + total * (material.diffuse + material.specular)
            if not math.isfinite(brightest):
                raise SceneError(
                    f"spheres[{index}].material",
                    "ambient + (sum of the lights' intensities) (diffuse + specular) is beyond float64; expected a "
                    f"finite largest intensity, at most {values.LARGEST}; lower the coefficients or the lights",
                )

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
