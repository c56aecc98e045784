"""Phong's material: the coefficients of one surface, each a grey or a colour, and how much of the mirrored ray it adds.

Comes in: numbers. Goes out: a frozen, checked Phong. Never done here: shading.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import force_setattr

from symrender_cg.scene import values
from symrender_cg.scene.values import Colour

_COEFFICIENTS = tuple((name, f"the {name} coefficient") for name in ("ambient", "diffuse", "specular"))


class Phong(Struct, frozen=True, forbid_unknown_fields=True, cache_hash=True):
    """I = ambient + sum over lights of intensity (diffuse max(0, n.l) + specular max(0, r.v)^shininess)   (Phong 1975)

    Three colours >= 0 and a shininess >= 0, all without a unit; a sum above 1 is allowed, clipping is the renderer's
    last step. A colour is one number for a grey, or (red, green, blue).
    gate_specular: True adds the specular term only where n.l > 0, so that a light behind a surface leaves no highlight.
    reflect: the share, 0 to 1, of what the mirrored ray meets that is added to I; I itself is not lowered.
    """

    ambient: Colour = 0.1
    diffuse: Colour = 0.7
    specular: Colour = 0.5
    shininess: float = 32.0
    gate_specular: bool = False
    reflect: float = 0.0

    def __post_init__(self) -> None:
        for name, meaning in _COEFFICIENTS:
            colour = values.colour(name, getattr(self, name), meaning, "write 0 to leave the term out")
            force_setattr(self, name, colour)
        shininess = values.non_negative("shininess", self.shininess, "a shininess", "a wide highlight has one near 1")
        force_setattr(self, "shininess", shininess)
        force_setattr(self, "gate_specular", values.flag("gate_specular", self.gate_specular, "a switch"))
        meaning, remedy = "the share of the mirrored ray", "write 0 for no mirror, 1 for a perfect one"
        force_setattr(self, "reflect", values.fraction("reflect", self.reflect, meaning, remedy))
