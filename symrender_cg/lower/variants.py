"""The named variants: for each accuracy level its forms, its number formats and what it promises.

A variant is data. The passes read it; what accuracy costs is measured over variants.
"""

from __future__ import annotations

from dataclasses import dataclass

from symrender_cg.errors import ArgumentError

_STABLE_FORMS = (
    "centred_span",
    "off_axis_span",
    "cross_disc",
    "centred_foot",
    "off_axis_foot",
    "cross_foot",
    "light_in_radii",
    "diffuse_gain",
    "mirrored_ray",
    "gained",
)

_DOUBLE_DOUBLE = frozenset(
    {
        *("depth", "offset_x", "offset_y", "image_x", "image_y", "alpha", "rho2", "reach"),
        *("distance", "row_gap", "row_disc", "row_mid", "row_half", "x_left", "x_right", "power"),
    }
)

_PER_PIXEL = frozenset({"cross_x", "cross_y", "cross_z", "s", "d_dot_d", "facing2"})


@dataclass(frozen=True, slots=True)
class Variant:
    """One way to compute an image: forms, formats, and whether hit and miss are decided exactly.

    shading         format of every quantity that is not named below, and of the image
    float64         quantities kept in float64 where shading is float32
    double_double   quantities kept to 106 bits; where the ray is tested pixel by pixel, also those in `per_pixel_exact`
    """

    name: str
    promise: str
    shading: str
    forms: tuple[str, ...]
    exact: bool
    float64: frozenset[str] = frozenset()
    double_double: frozenset[str] = frozenset()
    per_pixel_exact: frozenset[str] = frozenset()


VARIANTS: tuple[Variant, ...] = (
    Variant(
        "single",
        "a few units of 1e-6 on the unclipped field, under the conditions of double; hit or miss never wrong",
        "float32",
        _STABLE_FORMS,
        exact=True,
        float64=frozenset(
            {
                "x",
                "y",
                "from_left",
                "to_right",
                "chord",
                "facing2",
                "zero_power",
                "dx",
                "dy",
                "before_eye",
                "focal",
                "plane_unit",
                *("height2", "row_low", "row_high", "ahead", "wide_facing", "hit_distance"),
                *(
                    "gap_room",
                    "plain_gap",
                    "less_gap",
                    "least_gap",
                    "most_disc",
                    "most_half",
                    "outline_left",
                    "outline_right",
                ),
                *("descent", "p_x", "p_y", "p_z", "tile_u", "tile_v", "tile", "parity"),
            }
        ),
        double_double=_DOUBLE_DOUBLE,
        per_pixel_exact=_PER_PIXEL,
    ),
    Variant(
        "literal",
        "none: the seed's formula as it stands, in float64",
        "float64",
        ("seed_disc", "quadratic_disc"),
        exact=False,
    ),
    Variant(
        "double",
        "about 1e-15 absolute where the light is farther than 1e-3 R from the surface and n >= 1 (a gated highlight "
        "may be switched wrongly within rounding of the terminator); no overflow; hit or miss never wrong",
        "float64",
        _STABLE_FORMS,
        exact=True,
        double_double=_DOUBLE_DOUBLE,
        per_pixel_exact=_PER_PIXEL,
    ),
)

ACCURACIES = tuple(entry.name for entry in VARIANTS)


def variant(name: str) -> Variant:
    """The variant of that name; ArgumentError naming the known ones otherwise."""
    for entry in VARIANTS:
        if entry.name == name:
            return entry
    raise ArgumentError(f"accuracy: {name!r} is not known; expected one of {', '.join(map(repr, ACCURACIES))}")
