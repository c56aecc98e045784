"""The highlight's angle from the foot point of the ray: what decides it is rounded once, and nothing magnifies it.

With F = D x (D x m) = n |D|^2 + facing D, the foot point times |D|^2, and gap = |m x D| (see normal.py), F is at right
angles to D and |F| = gap |D|, gap^2 + facing^2 = |D|^2. The mirrored ray, times |D|^2, is

    mirror = (gap^2 - facing^2) D + 2 facing F

and sin^2 of its angle to w is that of its part across w. D + 2 facing n is the same vector, but an error of `facing`
makes n longer or shorter too, and turns that sum up to three times as far as it turns n itself. In w x mirror products
as long as both vectors cancel; in mirror less its part along w two vectors do, once.
"""

from __future__ import annotations

import sympy as sp

from symrender_cg.derive.forms.form import Claim, Form
from symrender_cg.derive.forms.normal import cross_foot, normal_from_foot, off_axis_foot
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols

_SPECULAR = "specular"
_RESCALE = "1 / (cos^2 + sin^2): 2 - a is 1 / a where a is within rounding of 1"
_MIRROR = "the primary ray mirrored at the surface, times |D|^2"


def _mirrored_foot(program: ImageProgram) -> tuple[Definition, ...]:
    centred = not any(f"center_{axis}" in program.inputs for axis in "xyz")
    mirrored = _mirror_near() if "m_dot_d" in program.guard else _mirror_of_centred() if centred else _mirror_off_axis()
    mirror = sp.Matrix(symbols("mirror_x mirror_y mirror_z"))
    across = sp.Matrix(symbols("across_x across_y across_z"))
    w = sp.Matrix(symbols("w_x w_y w_z"))
    return (
        *mirrored,
        Definition("w_dot_mirror", w.dot(mirror), _SPECULAR, "r.v = w . mirror / (|w| |D|^3)"),
        Definition("along_w", S("w_dot_mirror") * S("inv_w2"), _SPECULAR, "mirror = along_w w + across"),
        *(
            Definition(
                f"across_{axis}",
                mirror[i] - S("along_w") * w[i],
                _SPECULAR,
                "what of mirror is at right angles to w, short where the highlight is" if i == 0 else "",
            )
            for i, axis in enumerate("xyz")
        ),
        Definition("inv_d4", S("inv_d2") ** 2, _SPECULAR),
        Definition("inv_d6", S("inv_d2") * S("inv_d4"), _SPECULAR, "1 / |mirror|^2"),
        Definition(
            "near_cos2", S("along_w") * S("w_dot_mirror") * S("inv_d6"), _SPECULAR, "(r.v)^2, but for its scale"
        ),
        Definition("near_sin2", across.dot(across) * S("inv_d6"), _SPECULAR),
        Definition("rescale", 2 - (S("near_cos2") + S("near_sin2")), _SPECULAR, _RESCALE),
        Definition("cos2", S("near_cos2") * S("rescale"), _SPECULAR, "(r.v)^2"),
        Definition("sin2", S("near_sin2") * S("rescale"), _SPECULAR, "1 - (r.v)^2, accurate where r.v is near 1"),
    )


def _turn(gap2: sp.Expr) -> tuple[Definition, ...]:
    return (
        Definition("depth2", S("depth") ** 2, _SPECULAR),
        Definition("gap2", gap2, _SPECULAR, "|m x D|^2 in radii = |D|^2 - facing^2, free of cancellation"),
        Definition("turn", S("gap2") - S("facing2"), _SPECULAR, "-|D|^2 cos 2a, a the angle of incidence"),
        Definition("bounce", 2 * S("facing"), _SPECULAR),
    )


def _mirror_of_centred() -> tuple[Definition, ...]:
    x, y, focal, depth, s, turn, bounce, spread = symbols("x y focal depth s turn bounce spread")
    return (
        *_turn(S("depth2") * s),
        Definition("depth_focal", depth * focal, _SPECULAR),
        Definition("spread", turn + bounce * S("depth_focal"), _SPECULAR),
        Definition("mirror_x", x * spread, _SPECULAR, f"{_MIRROR}: turn D + bounce F, F = kappa (f x, f y, s)"),
        Definition("mirror_y", y * spread, _SPECULAR),
        Definition("mirror_z", bounce * (depth * s) - focal * turn, _SPECULAR),
    )


def _mirror_off_axis() -> tuple[Definition, ...]:
    dx, dy, tilt = symbols("dx dy tilt")
    return _mirror_by_foot(off_axis_foot(), S("depth2") * (dx**2 + dy**2 + tilt**2))


def _mirror_near() -> tuple[Definition, ...]:
    c_x, c_y, c_z = symbols("cross_x cross_y cross_z")
    return _mirror_by_foot(cross_foot(), c_x**2 + c_y**2 + c_z**2)


def _mirror_by_foot(foot: tuple[sp.Expr, ...], gap2: sp.Expr) -> tuple[Definition, ...]:
    x, y, focal, turn, bounce = symbols("x y focal turn bounce")
    meaning = "F, the foot point of the ray times |D|^2, is at right angles to D"
    normals = normal_from_foot()
    return (
        *(Definition(f"foot_{axis}", foot[i], "normal", meaning if i == 0 else "") for i, axis in enumerate("xyz")),
        *(
            Definition(f"n_{axis}", normals[i], "normal", "n is F less facing D, over |D|^2" if i == 0 else "")
            for i, axis in enumerate("xyz")
        ),
        *_turn(gap2),
        *(
            Definition(
                f"mirror_{axis}", ray * turn + bounce * S(f"foot_{axis}"), _SPECULAR, _MIRROR if axis == "x" else ""
            )
            for axis, ray in zip("xyz", (x, y, -focal), strict=True)
        ),
    )


def _claims() -> tuple[Claim, ...]:
    """Given root = R facing and l = w / |w|; at last facing^2 + gap^2 = |D|^2, facing = -n.D and |n| = 1."""
    x, y, eye, radius, facing = symbols("x y eye radius facing")
    n, w = symbols("n_x n_y n_z"), symbols("w_x w_y w_z")
    mirror = symbols("mirror_x mirror_y mirror_z")
    ray = (x, y, -eye)
    d2 = x**2 + y**2 + eye**2
    length = sp.sqrt(S("inv_w2"))
    root = {"root": radius * facing}
    lengths = {S("gap2"): d2 - facing**2, S("facing2"): facing**2}
    given = {f"l_{axis}": S(f"w_{axis}") * length for axis in "xyz"} | {f"n_{axis}": S(f"n_{axis}") for axis in "xyz"}
    given |= {"d_length": 1 / sp.sqrt(S("inv_d2")), "n_dot_v": facing * sp.sqrt(S("inv_d2"))}
    falls = -sum(n[i] * ray[i] for i in range(3))
    mirrored = {mirror[i]: d2 * (ray[i] + 2 * falls * n[i]) for i in range(3)}
    unit = {n[2]: 1 - n[0] ** 2 - n[1] ** 2}
    w2, m2 = (sum(a**2 for a in vector) for vector in (w, mirror))
    w_dot_mirror = sum(a * b for a, b in zip(w, mirror, strict=True))
    facts = {facing: falls, S("inv_w2"): 1 / w2, S("inv_d2"): 1 / d2}
    names = tuple(str(s) for s in (*n, *w, *mirror))
    complement = {S("near_sin2"): 1 - S("near_cos2")}
    square = {S("near_cos2"): w_dot_mirror**2 / (w2 * m2), S("inv_w2"): 1 / w2, S("inv_d6"): 1 / m2}
    return (
        Claim(S("gap2"), S("d_dot_d") - S("disc") / radius**2),
        *(Claim(S(f"n_{axis}"), S(f"n_{axis}"), given=root, keep=("facing",)) for axis in "xyz"),
        *(
            Claim(
                S(f"mirror_{axis}"),
                S("d_dot_d") * (ray[i] + 2 * S("root") / radius * S(f"n_{axis}")),
                given=root,
                keep=("facing", "facing2", "gap2"),
                facts=lengths,
            )
            for i, axis in enumerate("xyz")
        ),
        Claim(m2, S("d_dot_d") ** 3, keep=names, facts=mirrored, squares=unit),
        Claim(S("inv_d6"), S("d_dot_d") ** -3),
        Claim(S("near_cos2"), S("r_dot_v") ** 2, given, (*names, "facing", "inv_w2", "inv_d2"), facts | mirrored, unit),
        Claim(
            S("near_sin2"),
            1 - S("r_dot_v") ** 2,
            given={"r_dot_v": sp.sqrt(S("near_cos2"))},
            keep=(*names, "near_cos2", "inv_w2", "inv_d6"),
            facts=square,
        ),
        *(
            Claim(S(name), right, {"r_dot_v": sp.sqrt(S("near_cos2"))}, ("near_cos2", "near_sin2"), complement)
            for name, right in (("cos2", S("r_dot_v") ** 2), ("sin2", 1 - S("r_dot_v") ** 2))
        ),
    )


FORMS: tuple[Form, ...] = (
    Form(
        "mirrored_foot",
        _mirrored_foot,
        "what errors of facing are magnified by in D + 2 facing n, and the cancellation in w x mirror",
        "D and the foot point are at right angles: cos 2a and sin 2a of the angle of incidence; Gram and Schmidt",
        _claims,
        brings=("specular",),
    ),
)
