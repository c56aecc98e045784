"""What rays meet: spheres, a plane, and behind everything the background.

Comes in: numbers and materials. Goes out: frozen, checked Sphere, Plane, Gradient. Never done here: an intersection.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import force_setattr

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact, values
from symrender_cg.scene.exact import Vector
from symrender_cg.scene.materials import Phong
from symrender_cg.scene.values import Colour

_PHONG = "Phong(ambient=0.1, diffuse=0.7, specular=0.5, shininess=32)"


class Sphere(Struct, frozen=True, forbid_unknown_fields=True):
    """|X - center| = radius, with its material; center and radius in scene units, radius > 0."""

    center: Vector = (0.0, 0.0, 0.0)
    radius: float = 1.0
    material: Phong = Phong()

    def __post_init__(self) -> None:
        force_setattr(self, "center", values.vector("center", self.center, "the centre of a sphere"))
        if type(self.radius) is not float or not 0.0 < self.radius < values.INFINITY:
            remedy = "leave the sphere out of the scene if it should not be seen"
            force_setattr(self, "radius", values.positive("radius", self.radius, "a radius in scene units", remedy))
        if type(self.material) is not Phong:
            values.instance("material", self.material, Phong, _PHONG)


class Plane(Struct, frozen=True, forbid_unknown_fields=True):
    """normal . (X - point) = 0: a plane without end, seen from both sides, plain or in two materials as a checker.

    point: scene units. normal: of any length > 0; its sign and length have no effect on a plain plane, as the normal
    is turned towards the ray. With `checker`, u = axis made perpendicular to normal and of length 1,
    v = normal/|normal| x u, and the tile of X is
        floor(u.(X - point) / tile) + floor(v.(X - point) / tile):  even -> material, odd -> checker.
    tile: the side of a square, scene units, > 0. axis: not parallel to normal.
    """

    point: Vector = (0.0, -1.0, 0.0)
    normal: Vector = (0.0, 1.0, 0.0)
    material: Phong = Phong()
    checker: Phong | None = None
    tile: float = 1.0
    axis: Vector = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        force_setattr(self, "point", values.vector("point", self.point, "a point of the plane"))
        normal = values.direction("normal", self.normal, "the normal of the plane", "(0, 1, 0) for a floor")
        force_setattr(self, "normal", normal)
        values.instance("material", self.material, Phong, _PHONG)
        if self.checker is not None:
            values.instance("checker", self.checker, Phong, f"{_PHONG}, or None for one material")
        remedy = "leave checker out for a plane of one material"
        force_setattr(self, "tile", values.positive("tile", self.tile, "the side of a tile in scene units", remedy))
        axis = values.direction("axis", self.axis, "the direction of the tiles", "(1, 0, 0)")
        force_setattr(self, "axis", axis)
        if exact.are_parallel(axis, normal):
            raise SceneError(
                "axis",
                f"{axis} is parallel to the normal {normal}, so the tiles have no direction; expected a direction that "
                "leans away from the normal; (1, 0, 0), (0, 1, 0) or (0, 0, 1) will do",
            )


class Gradient(Struct, frozen=True, forbid_unknown_fields=True):
    """The background of a ray of direction D: bottom (1 - s) + top s with s = (1 + up.D / (|up| |D|)) / 2.

    bottom, top: colours >= 0. up: a direction of any length > 0, in the scene's frame like every other.
    """

    bottom: Colour = 0.0
    top: Colour = 1.0
    up: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("bottom", "top"):
            meaning, remedy = f"the {name} of the background", "write 0 for black"
            force_setattr(self, name, values.colour(name, getattr(self, name), meaning, remedy))
        force_setattr(self, "up", values.direction("up", self.up, "the way to the top", "(0, 1, 0)"))
