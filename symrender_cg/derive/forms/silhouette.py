"""Forms of the discriminant that do not cancel: by the ends of a row's span of hits, or by the cross product."""

from __future__ import annotations

import sympy as sp

from symrender_cg.derive.forms.form import Claim, Form
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols

_SILHOUETTE = "silhouette"
_RAY = "ray and sphere"
_EDGE = "disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette"


def _centred_span(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, eye, radius, focal = symbols("x y eye radius focal")
    alpha, rho2, reach = symbols("alpha rho2 reach")
    return (
        Definition("focal", eye, _SILHOUETTE, "rays D = (x, y, -f): f is e, in the unit of the image plane"),
        Definition("depth", eye / radius, _SILHOUETTE, "kappa = e / R: lengths of the scene in radii"),
        Definition(
            "alpha",
            (eye - radius) * (eye + radius) / radius**2,
            _SILHOUETTE,
            "alpha = kappa^2 - 1, free of cancellation",
        ),
        Definition(
            "rho2", focal**2 / alpha, _SILHOUETTE, "the silhouette is the circle x^2 + y^2 = rho^2 = f^2 / alpha"
        ),
        Definition("reach", sp.sqrt(rho2 - y**2), _SILHOUETTE, "the row's hits are -reach <= x <= reach"),
        Definition("x_left", -reach, _SILHOUETTE),
        Definition("x_right", reach, _SILHOUETTE),
        Definition("extent_x", sp.sqrt(rho2), _SILHOUETTE, "no hit is farther from the axis, to the side or up"),
        Definition("extent_y", sp.sqrt(rho2), _SILHOUETTE),
        *_facing(),
        Definition("s", x**2 + y**2, _RAY, "s = x^2 + y^2, A = |D|^2 = s + f^2"),
        Definition("d_dot_d", S("s") + focal**2, _RAY),
    )


def _off_axis_span(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, eye, radius, focal = symbols("x y eye radius focal")
    center_x, center_y, center_z = symbols("center_x center_y center_z")
    depth, offset_x, offset_y, alpha = symbols("depth offset_x offset_y alpha")
    row_disc, row_mid, row_half = symbols("row_disc row_mid row_half")
    return (
        Definition("focal", eye, _SILHOUETTE, "rays D = (x, y, -f): f is e, in the unit of the image plane"),
        Definition("distance", eye - center_z, _SILHOUETTE, "of the eye from the plane of the centre"),
        Definition("depth", S("distance") / radius, _SILHOUETTE, "kappa: the same in radii"),
        Definition("offset_x", center_x / radius, _SILHOUETTE),
        Definition("offset_y", center_y / radius, _SILHOUETTE),
        Definition("image_x", offset_x * focal / depth, _SILHOUETTE, "where the centre appears on the image plane"),
        Definition("image_y", offset_y * focal / depth, _SILHOUETTE),
        Definition(
            "alpha",
            (S("distance") - radius) * (S("distance") + radius) / radius**2 + offset_y**2,
            _SILHOUETTE,
            "disc / R^2 is -alpha x^2 + ... along a row; alpha = kappa^2 - 1 + offset_y^2 > 0",
        ),
        Definition("row_gap", depth * y - offset_y * focal, _SILHOUETTE, "by how much the row misses the centre"),
        Definition(
            "row_disc",
            y**2 + focal**2 - S("row_gap") ** 2,
            _SILHOUETTE,
            "positive where the plane through eye and row cuts the sphere",
        ),
        Definition("row_mid", offset_x * (depth * focal + offset_y * y), _SILHOUETTE, "alpha times the span's middle"),
        Definition(
            "row_half",
            sp.sqrt((alpha + offset_x**2) * row_disc),
            _SILHOUETTE,
            "alpha times half the span's length",
        ),
        Definition("x_left", (row_mid - row_half) / alpha, _SILHOUETTE, "the row's hits are x_left <= x <= x_right"),
        Definition("x_right", (row_mid + row_half) / alpha, _SILHOUETTE),
        Definition(
            "height2", (S("distance") - radius) * (S("distance") + radius) / radius**2, _SILHOUETTE, "kappa^2 - 1"
        ),
        *(
            Definition(
                f"extent_{axis}",
                focal * (depth * sp.Abs(offset) + sp.sqrt(S("height2") + offset**2)) / S("height2"),
                _SILHOUETTE,
                "no hit is farther from the axis, to the side or up" if axis == "x" else "",
            )
            for axis, offset in (("x", offset_x), ("y", offset_y))
        ),
        *_facing(),
        Definition("s", x**2 + y**2, _RAY, "s = x^2 + y^2, A = |D|^2 = s + f^2"),
        Definition("d_dot_d", S("s") + focal**2, _RAY),
    )


def _facing() -> tuple[Definition, ...]:
    x = S("x")
    return (
        Definition("from_left", x - S("x_left"), _RAY, "distance to the two ends of the span, not negative inside it"),
        Definition("to_right", S("x_right") - x, _RAY),
        Definition("chord", S("from_left") * S("to_right"), _RAY),
        Definition(
            "facing2",
            S("alpha") * S("chord"),
            _RAY,
            _EDGE,
        ),
        Definition("facing", sp.sqrt(S("facing2")), _RAY, "-n.D, how far the surface faces the ray: root / R"),
    )


def _middle_facing(_: ImageProgram) -> tuple[Definition, ...]:
    focal, alpha, s = symbols("focal alpha s")
    return (
        Definition("middle_s", S("rho2") / 2, _SILHOUETTE, "where the angle of incidence is 45 degrees"),
        Definition("facing2_middle", focal**2 - alpha * s, _RAY, "disc / R^2 where that takes little from f^2"),
        Definition("facing2_edge", alpha * S("chord"), _RAY, _EDGE),
        Definition(
            "facing2",
            sp.Piecewise((S("facing2_middle"), S("middle_s") - s > 0), (S("facing2_edge"), True)),
            _RAY,
        ),
    )


def _middle_claims() -> tuple[Claim, ...]:
    return tuple(Claim(S(f"facing2_{where}") * S("radius") ** 2, S("disc")) for where in ("middle", "edge"))


def _facing_claims() -> tuple[Claim, ...]:
    return Claim(S("facing2") * S("radius") ** 2, S("disc")), Claim(S("d_dot_d"), S("d_dot_d"))


def _any_sphere(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, eye, radius, focal = symbols("x y eye radius focal")
    center_x, center_y, center_z = symbols("center_x center_y center_z")
    depth, offset_x, offset_y = symbols("depth offset_x offset_y")
    return (
        Definition("focal", eye, _RAY, "rays D = (x, y, -f): f is e, in the unit of the image plane"),
        Definition("distance", eye - center_z, _RAY, "of the eye from the plane of the centre"),
        Definition("depth", S("distance") / radius, _RAY, "kappa: the same in radii"),
        Definition("offset_x", center_x / radius, _RAY),
        Definition("offset_y", center_y / radius, _RAY),
        Definition("s", x**2 + y**2, _RAY, "s = x^2 + y^2, A = |D|^2 = s + f^2"),
        Definition("d_dot_d", S("s") + focal**2, _RAY),
        Definition("cross_y", offset_x * focal - depth * x, _RAY, "m x D in radii"),
        Definition("cross_x", depth * y - offset_y * focal, _RAY),
        Definition("cross_z", offset_x * y - offset_y * x, _RAY),
        Definition(
            "facing2",
            S("d_dot_d") - (S("cross_x") ** 2 + S("cross_y") ** 2 + S("cross_z") ** 2),
            _RAY,
            "disc / R^2 = |D|^2 - |m x D|^2 / R^2: a hit where >= 0",
        ),
        Definition("before_eye", offset_x * x + offset_y * y + depth * focal, _RAY, "m.D: positive before the eye"),
        Definition("facing", sp.sqrt(S("facing2")), _RAY, "-n.D, how far the surface faces the ray: root / R"),
    )


def _any_sphere_claims() -> tuple[Claim, ...]:
    return (*_facing_claims(), Claim(S("before_eye") * S("radius"), S("m_dot_d")))


FORMS: tuple[Form, ...] = (
    Form(
        "middle_facing",
        _middle_facing,
        "five of six roundings of the discriminant, where it does not cancel",
        "disc / R^2 = f^2 - alpha s, and the same as a product of two differences",
        _middle_claims,
        off_axis=False,
        front_test=False,
    ),
    Form(
        "centred_span",
        _centred_span,
        "the cancellation of disc at the silhouette, and of e^2 - R^2 where the eye is close",
        "the silhouette of a centred sphere is a circle",
        _facing_claims,
        off_axis=False,
        front_test=False,
        guard=(("disc", "facing2"),),
        ends=("x_left", "x_right"),
    ),
    Form(
        "off_axis_span",
        _off_axis_span,
        "the cancellation of disc at the silhouette, wherever the sphere is",
        "disc is a quadratic in x with the discriminant (|m|^2 - R^2)(R^2 (y^2 + e^2) - (m_y e + m_z y)^2)",
        _facing_claims,
        off_axis=True,
        front_test=False,
        guard=(("disc", "facing2"),),
        ends=("x_left", "x_right"),
    ),
    Form(
        "cross_disc",
        _any_sphere,
        "the cancellation of (m.D)^2 - |D|^2 (|m|^2 - R^2) for a far sphere",
        "Lagrange's identity",
        _any_sphere_claims,
        front_test=True,
        guard=(("disc", "facing2"), ("m_dot_d", "before_eye")),
    ),
)
