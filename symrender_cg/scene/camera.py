"""The camera: a pinhole, the point that it looks at, and which way is up.

Comes in: numbers. Goes out: a frozen, checked Camera. Never done here: the move to the camera's frame.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import force_setattr

from symrender_cg.errors import SceneError
from symrender_cg.scene import exact, values
from symrender_cg.scene.exact import Vector


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
        force_setattr(self, "up", values.direction("up", self.up, "what is up in the image", "(0, 1, 0)"))
        if self.half_height is not None:
            meaning, remedy = "half the height of the image in scene units", "leave it out to frame the spheres"
            force_setattr(self, "half_height", values.positive("half_height", self.half_height, meaning, remedy))
        if self.eye == self.look_at:
            raise SceneError(
                "eye", f"{self.eye} is also look_at, so there is no direction of view; expected two points; move one"
            )
        grid = exact.grid_of((*self.eye, *self.look_at))
        eye, look_at = exact.vector_on_grid(self.eye, grid), exact.vector_on_grid(self.look_at, grid)
        up = exact.vector_on_grid(self.up, exact.grid_of(self.up))
        if not any(exact.cross(up, exact.difference(eye, look_at))):
            raise SceneError(
                "up",
                f"{self.up} is parallel to the view from eye {self.eye} to look_at {self.look_at}; expected a "
                "direction that leans away from it; for a view straight down (0, 0, -1) or (1, 0, 0) will do",
            )
