"""The named variants: for each accuracy level its forms, its number formats and what it promises.

A variant is data. The passes read it; what accuracy costs is measured over variants. A level is what a user asks for:
most are one variant; `certified` is one for each target, and what such a kernel cannot settle goes on to the enclosure
kernel and the oracle.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from typing import Literal

from symrender_cg.errors import ArgumentError
from symrender_cg.lower.switches import ALL, Passes

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

INNER_FORMS = (
    *_STABLE_FORMS,
    "centred_foot_dot_lamp",
    "off_axis_foot_dot_lamp",
    "inner_products",
    "complement",
)
"""For kernels that bound their own error: what cancels is counted."""

MOST_ROUNDOFFS = 9.1
"""Unit roundoffs, 2^-53, that keep an error of `double` below 1e-15."""

_DOUBLE_DOUBLE = frozenset(
    {
        *("depth", "offset_x", "offset_y", "image_x", "image_y", "alpha", "rho2", "reach"),
        *("distance", "row_gap", "row_disc", "row_mid", "row_half", "x_left", "x_right", "power"),
    }
)

_FACTORS = frozenset({"depth2", "depth_focal"})
"""Constants of a frame that the mirrored ray is a multiple of: rounded once."""

_EXACT_NUMBERS = frozenset({"focal", "plane_unit", "zero_power", "extent_x", "extent_y"})
"""Quantities that a float64 holds exactly, or that need be known but roughly."""

_WIDE_LIGHT = frozenset({*(f"{stem}_{axis}" for stem in ("from_center", "lamp") for axis in "xyz")})

_RENORMALISED = frozenset({"from_left", "to_right"})
"""At the silhouette these are the small difference of two numbers, and the root of their product is taken."""

_TARGETS: tuple[tuple[Literal["float32", "uint8"], str], ...] = (
    ("float32", "the float32 nearest to the true value"),
    ("uint8", "the grey level floor(255 I + 1/2) of the true intensity I, cut to [0, 1]"),
)

_PER_PIXEL = frozenset({"cross_x", "cross_y", "cross_z", "s", "d_dot_d", "facing2"})


_SINGLE_FLOAT64 = frozenset(
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
        *("descent", "p_x", "p_y", "p_z", "tile_u", "tile_v", "tile", "parity"),
    }
)
"""Quantities that single and fast keep in float64: where the ray meets the surface, exactly on its outline."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One way to compute an image: forms, formats, and whether hit and miss are decided exactly.

    shading         format of every quantity that is not named below
    float64         quantities kept in float64 where shading is another format
    double_double   quantities kept to 106 bits; where the ray is tested pixel by pixel, also those in `per_pixel_exact`
    functions       "fast" for powers that are good for grey levels alone; others in symrender_cg.lower.choices
    fills           the row's span of hits is filled without a test; False: every pixel is tested
    contracts       the compiler may fuse a * b + c into one rounding wherever it likes
    passes          the passes that make a kernel of one sphere fast and can be left out, each by itself
    settles         the kernel bounds its own error and reports every pixel where the bound does not settle this:
                    the rounding of the true value to a target, or four units in the last place ("ulp")
    """

    name: str
    promise: str
    shading: Literal["float32", "float64", "pair"]
    forms: tuple[str, ...]
    exact: bool
    float64: frozenset[str] = frozenset()
    double_double: frozenset[str] = frozenset()
    per_pixel_exact: frozenset[str] = frozenset()
    settles: Literal["ulp", "float64", "float32", "uint8"] | None = None
    functions: str = ""
    fills: bool = True
    contracts: bool = False
    passes: Passes = ALL

    @property
    def staged(self) -> bool:
        """Whether its kernels of one sphere run in stages: where spans are filled."""
        return self.passes.staged and self.exact and self.fills

    @property
    def key(self) -> str:
        """What tells its kernels from those of others: the name, and for a variant that is no level a digest of it."""
        if any(self is entry for entry in (*VARIANTS, *LEVELS)):
            return self.name
        values = [getattr(self, entry.name) for entry in fields(self)]
        told = repr([sorted(value) if isinstance(value, frozenset) else value for value in values])
        return f"{self.name}:{hashlib.sha256(told.encode()).hexdigest()[:16]}"

    @property
    def flags(self) -> tuple[str, ...]:
        """Compiler flags beyond those of every kernel."""
        return ("-ffp-contract=fast",) if self.contracts else ()

    @property
    def powers(self) -> str:
        """Which powers the kernel calls: those of its shading's format, unless the variant names others."""
        return self.functions or self.shading

    @property
    def result(self) -> str:
        """The numpy name of the type of the image's values."""
        if self.settles in ("float32", "uint8"):
            return self.settles
        return "float32" if self.shading == "float32" else "float64"

    @property
    def c_type(self) -> str:
        """The C type of the image's values."""
        return {"float32": "float", "float64": "double", "uint8": "unsigned char"}[self.result]


VARIANTS: tuple[Variant, ...] = (
    Variant(
        "fast",
        "right to within one grey level of 256, under the conditions of double; hit or miss never wrong",
        "float32",
        (*_STABLE_FORMS, "complement"),
        exact=True,
        float64=_SINGLE_FLOAT64,
        double_double=_DOUBLE_DOUBLE,
        per_pixel_exact=_PER_PIXEL,
        functions="fast",
    ),
    Variant(
        "single",
        "a few units of 1e-6 on the unclipped field, under the conditions of double; hit or miss never wrong",
        "float32",
        _STABLE_FORMS,
        exact=True,
        float64=_SINGLE_FLOAT64,
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
        "at most 1e-15 max(1, value) off where no light is within 1e-3 R of a surface and n <= 1000; another kernel "
        "draws what this one may not; no overflow; hit or miss never wrong",
        "float64",
        (*_STABLE_FORMS, "middle_facing", "mirrored_foot"),
        exact=True,
        double_double=_DOUBLE_DOUBLE | _FACTORS,
        per_pixel_exact=_PER_PIXEL,
    ),
)

LEVELS: tuple[Variant, ...] = (
    Variant(
        "stable",
        "at most 4 ulp, for every valid scene: pixels whose own bound does not show that are reported",
        "pair",
        INNER_FORMS,
        exact=True,
        float64=_EXACT_NUMBERS,
        double_double=_DOUBLE_DOUBLE | _WIDE_LIGHT | _RENORMALISED,
        per_pixel_exact=frozenset(),
        settles="ulp",
    ),
    Variant(
        "certified_float64",
        "the float64 nearest to the true value; pixels whose own bound does not show that are reported",
        "pair",
        INNER_FORMS,
        exact=True,
        float64=_EXACT_NUMBERS,
        double_double=_DOUBLE_DOUBLE | _WIDE_LIGHT | _RENORMALISED,
        settles="float64",
    ),
    *(
        Variant(
            f"certified_{target}",
            f"{words}; pixels whose own bound does not show that are reported",
            "float64",
            INNER_FORMS,
            exact=True,
            double_double=_DOUBLE_DOUBLE,
            per_pixel_exact=_PER_PIXEL,
            settles=target,
        )
        for target, words in _TARGETS
    ),
)
"""Variants whose kernels bound their own error."""

TARGETS = ("float64", "float32", "uint8")
"""What `certified` may round to."""

ACCURACIES = (*(entry.name for entry in VARIANTS), "stable", "certified")
"""What a user may ask for."""


def variant(name: str | Variant, target: str | None = None) -> Variant:
    """The variant of that level, for `certified` that of its target (by default float64), or of a level with choices
    (`single_fused`, see symrender_cg.lower.choices); a variant is itself.

    Raises ArgumentError naming the known ones.
    """
    if isinstance(name, Variant):
        return name
    wanted = name
    if name == "certified":
        if target not in (None, *TARGETS):
            raise ArgumentError(f"target: {target!r} is not known; expected one of {', '.join(map(repr, TARGETS))}")
        wanted = f"certified_{target or 'float64'}"
    elif target is not None:
        raise ArgumentError(f"target: {target!r} is for accuracy='certified', not for {name!r}; leave it out")
    for entry in (*VARIANTS, *LEVELS):
        if entry.name == wanted:
            return entry
    if "_" in wanted and target is None:
        from symrender_cg.lower.choices import named

        if (found := named(wanted)) is not None:
            return found
    raise ArgumentError(f"accuracy: {name!r} is not known; expected one of {', '.join(map(repr, ACCURACIES))}")
