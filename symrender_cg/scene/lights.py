"""Lights: at a point, with an intensity that may fall off with distance, or from a direction.

Comes in: numbers. Goes out: frozen, checked lights. Never done here: a decision about what a light can reach.
"""

from __future__ import annotations

from typing import TypeAlias

from msgspec import Struct
from msgspec.structs import force_setattr

from symrender_cg.errors import SceneError
from symrender_cg.scene import values
from symrender_cg.scene.exact import Vector
from symrender_cg.scene.values import Colour

_MEANING, _REMEDY = "an intensity", "write 0 to switch the light off"


class PointLight(Struct, frozen=True, forbid_unknown_fields=True):
    """A light at `position`: its intensity at distance l is intensity / (a + b l + c l^2), (a, b, c) = attenuation.

    position and l: scene units; the light may lie inside a sphere. intensity: a colour >= 0.
    a, b, c >= 0 and not all 0; (1, 0, 0) is the same intensity at every distance.
    """

    position: Vector = (5.0, 5.0, 10.0)
    intensity: Colour = 1.0
    attenuation: tuple[float, float, float] = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        force_setattr(self, "position", values.vector("position", self.position, "the position of a light"))
        force_setattr(self, "intensity", values.colour("intensity", self.intensity, _MEANING, _REMEDY))
        meaning = "the coefficients (a, b, c) of a + b l + c l^2"
        a, b, c = values.vector("attenuation", self.attenuation, meaning)
        for index, entry in enumerate((a, b, c)):
            remedy = "write 0 to leave that power of the distance out"
            values.non_negative(f"attenuation[{index}]", entry, "a coefficient of the attenuation", remedy)
        if a == b == c == 0.0:
            raise SceneError(
                "attenuation",
                f"{(a, b, c)} divides the intensity by 0; expected {meaning}, at least one of them > 0; write "
                "(1, 0, 0) for a light that is as strong at every distance",
            )
        force_setattr(self, "attenuation", (a, b, c))


class DirectionalLight(Struct, frozen=True, forbid_unknown_fields=True):
    """Light that travels along `direction` everywhere, as from a point without end; `intensity` a colour >= 0.

    The length of `direction` is > 0 and has no effect.
    """

    direction: Vector = (-5.0, -5.0, -10.0)
    intensity: Colour = 1.0

    def __post_init__(self) -> None:
        meaning = "the way the light travels"
        force_setattr(
            self, "direction", values.direction("direction", self.direction, meaning, "(0, -1, 0) for light from above")
        )
        force_setattr(self, "intensity", values.colour("intensity", self.intensity, _MEANING, _REMEDY))


Light: TypeAlias = PointLight | DirectionalLight
