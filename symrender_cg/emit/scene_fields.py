"""What the kernel of a scene needs, and the arrays and numbers of the structure that it is called with.

The one list of the fields: the C header, the declarations for cffi and the packing in Python all follow it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Shape = Literal["number", "whole", "reals", "wholes"]


@dataclass(frozen=True, slots=True)
class Needs:
    """The effects that decide the text of a scene's kernel."""

    channels: int = 1
    spans: bool = False
    at_eye: bool = False
    intersections: bool = False
    plane: bool = False
    checker: bool = False
    crossing: bool = False
    diffuse: bool = False
    specular: bool = False
    specular_gate: bool = False
    attenuation: bool = False
    shadows: bool = False
    mirrors: bool = False
    gradient: bool = False

    @property
    def spheres(self) -> bool:
        """Whether a sphere is seen by the eye."""
        return self.spans or self.at_eye

    @property
    def lit(self) -> bool:
        """Whether a light adds anything."""
        return self.diffuse or self.specular

    @staticmethod
    def of(flags: frozenset[str]) -> Needs:
        """The needs of a plan's flags; `colour` makes three channels."""
        known = set(Needs.__dataclass_fields__) - {"channels"}
        return Needs(channels=3 if "colour" in flags else 1, **dict.fromkeys(sorted(flags & known), True))


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the structure: fields of one type that are explained together."""

    declaration: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Field:
    """One field: its name, whether a number or an array of reals or whole numbers, and its meaning."""

    name: str
    shape: Shape
    meaning: str


_TYPES = {"number": ("double", ""), "whole": ("int", ""), "reals": ("const double", "*"), "wholes": ("const int", "*")}


def field_lines(fields: tuple[Field, ...]) -> tuple[Line, ...]:
    """The declarations in C; a field without a meaning of its own stands on the line of the one before it."""
    groups: list[list[Field]] = []
    for field in fields:
        if field.meaning or not groups or groups[-1][0].shape != field.shape:
            groups.append([])
        groups[-1].append(field)
    lines = []
    for group in groups:
        kind, star = _TYPES[group[0].shape]
        names = ", ".join(star + field.name for field in group)
        lines.append(Line(f"{kind} {names};", group[0].meaning))
    return tuple(lines)


def scene_fields(need: Needs, *, in_full: bool = False) -> tuple[Field, ...]:
    """The fields of a kernel's scene structure, in their order; `in_full`: what no float64 holds in two words."""
    c = f"[{need.channels}]"
    fields: list[tuple[bool, str, Shape, str]] = [
        (True, "eye", "number", "distance of the eye from the image plane"),
        (True, "spheres", "whole", "how many spheres the arrays hold,"),
        (True, "visible", "whole", "and how many the eye may see: the first, front to back"),
        (True, "receivers", "whole", "spheres, then the plane's materials: what may be lit"),
        (True, "center_x", "reals", "[receivers] centre of a sphere; for the plane the eye"),
        (True, "center_y", "reals", ""),
        (True, "center_z", "reals", ""),
        (True, "radius", "reals", "[receivers] radius; for the plane the eye's height above it"),
        (need.plane and in_full, "radius_low", "reals", "[receivers] what rounding left of that height; else 0"),
        (need.at_eye and need.spans, "at_eye", "wholes", "[visible] the sphere reaches the plane of the eye"),
        (need.intersections, "partners_begin", "wholes", "[visible + 1] lists of the spheres before it"),
        (need.intersections, "partners", "wholes", "that a sphere intersects"),
        (need.crossing, "crosses_plane", "wholes", "[spheres] the sphere may lie on both sides of the plane"),
        (True, "ambient", "reals", f"[receivers]{c} ambient coefficient"),
        (need.lit, "diffuse", "reals", f"[receivers]{c} diffuse coefficient"),
        (need.lit, "specular", "reals", f"[receivers]{c} specular coefficient"),
        (need.specular, "shininess", "reals", "[receivers] exponent of the specular term"),
        (need.lit, "light_x", "reals", "[lights] place; for a light in parallel unit vector to it"),
        (need.lit, "light_y", "reals", ""),
        (need.lit, "light_z", "reals", ""),
        (need.lit, "nearness", "reals", "[lights] 1 for a point light, 0 for one in parallel"),
        (need.lit, "light_intensity", "reals", f"[lights]{c}"),
        (need.attenuation, "fade_a", "reals", "[lights] attenuation 1 / (a + b l + c l^2) at the distance l"),
        (need.attenuation, "fade_b", "reals", ""),
        (need.attenuation, "fade_c", "reals", ""),
        (need.lit, "lamps_begin", "wholes", "[receivers + 1] lists of lamps, lights of a receiver"),
        (need.lit, "lamp_light", "wholes", "which light,"),
        (need.lit, "lamp_terms", "wholes", "terms: 1 diffuse, 2 specular, 4 that where n.l > 0 alone"),
        (need.shadows, "blockers_begin", "wholes", "[lamps + 1] lists of spheres that may be before it"),
        (need.shadows, "blockers", "wholes", ""),
        (need.mirrors, "reflect", "reals", "[receivers] how much of the mirrored ray's intensity is added"),
        (need.mirrors, "bounces", "whole", "how often a ray is mirrored at most"),
        (need.mirrors, "mirrors_begin", "wholes", "[receivers + 1] lists of spheres seen in it"),
        (need.mirrors, "mirrors", "wholes", ""),
        (need.mirrors and need.plane, "mirror_plane", "wholes", "[receivers] the plane may be seen in it"),
        (need.plane, "plane_seen", "whole", "the eye may see the plane, not only mirrors"),
        (need.plane, "plane_x", "number", "unit normal of the plane, on the eye's side"),
        (need.plane, "plane_y", "number", ""),
        (need.plane, "plane_z", "number", ""),
        (need.plane and in_full, "plane_x_low", "number", "and what rounding left of it"),
        (need.plane and in_full, "plane_y_low", "number", ""),
        (need.plane and in_full, "plane_z_low", "number", ""),
        (need.checker, "across_x", "number", "a tile's number across: floor(across.p + across_0)"),
        (need.checker, "across_y", "number", ""),
        (need.checker, "across_z", "number", ""),
        (need.checker, "across_0", "number", ""),
        (need.checker, "along_x", "number", "and along"),
        (need.checker, "along_y", "number", ""),
        (need.checker, "along_z", "number", ""),
        (need.checker, "along_0", "number", ""),
        (True, "background", "reals", f"{c} intensity where no ray hits{', straight down' if need.gradient else ''}"),
        (need.gradient, "background_top", "reals", f"{c} straight up"),
        (need.gradient, "up_x", "number", "unit vector upwards"),
        (need.gradient, "up_y", "number", ""),
        (need.gradient, "up_z", "number", ""),
    ]
    return tuple(Field(name, shape, meaning) for wanted, name, shape, meaning in fields if wanted)
