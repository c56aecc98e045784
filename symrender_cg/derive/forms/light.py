"""Forms of the light's terms: lengths in radii, gains once a frame, the highlight from the mirrored ray."""

from __future__ import annotations

import sympy as sp

from symrender_cg.derive.forms.form import Claim, Form
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols

_LIGHT = "light"
_SPECULAR = "specular"


def _light_in_radii(program: ImageProgram) -> tuple[Definition, ...]:
    centred = not any(f"center_{axis}" in program.inputs for axis in "xyz")
    w = sp.Matrix(symbols("w_x w_y w_z"))
    n = sp.Matrix(symbols("n_x n_y n_z"))
    from_center = {axis: S(f"light_{axis}") - (0 if centred else S(f"center_{axis}")) for axis in "xyz"}
    return (
        *(
            Definition(f"from_center_{axis}", value, _LIGHT, "L - C" if axis == "x" else "")
            for axis, value in from_center.items()
        ),
        *(
            Definition(
                f"lamp_{axis}", S(f"from_center_{axis}") / S("radius"), _LIGHT, "(L - C) / R" if axis == "x" else ""
            )
            for axis in "xyz"
        ),
        *(
            Definition(
                f"w_{axis}", S(f"lamp_{axis}") - S(f"n_{axis}"), _LIGHT, "w = (L - P) / R" if axis == "x" else ""
            )
            for axis in "xyz"
        ),
        Definition("w2", w.dot(w), _LIGHT, "|w|^2"),
        Definition("inv_w2", 1 / S("w2"), _LIGHT),
        Definition("n_dot_l", n.dot(w) * sp.sqrt(S("inv_w2")), _LIGHT, "n.l = n.w / |w|"),
    )


def _light_claims() -> tuple[Claim, ...]:
    """Given P = C + R n, and then w (textbook) = R w, |w| (textbook) = R |w|."""
    radius, normal = S("radius"), ("n_x", "n_y", "n_z")
    hit = {f"hit_{axis}": S(f"center_{axis}") + radius * S(f"n_{axis}") for axis in "xyz"}
    w = {f"w_{axis}": radius * S(f"w_{axis}") for axis in "xyz"}
    length = {"w_length": radius / sp.sqrt(S("inv_w2"))}
    same = {name: S(name) for name in normal}
    return (
        *(Claim(S(f"w_{axis}") * radius, S(f"w_{axis}"), given=hit, keep=normal) for axis in "xyz"),
        Claim(S("w2") * radius**2, S("w_length") ** 2, given=w, keep=("w_x", "w_y", "w_z")),
        Claim(S("n_dot_l"), S("n_dot_l"), given=w | length | same, keep=(*normal, "w_x", "w_y", "w_z", "inv_w2")),
    )


class CosinePower(sp.Function):  # type: ignore[misc]
    """CosinePower(c, s, n) = c^(n/2), for c = cos^2 of an angle and s = sin^2 of it, given apart.

    Whoever computes it may use 1 - s in place of c where that is the more accurate.
    """

    nargs = 3


def _mirrored_ray(program: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, facing = symbols("x y focal facing")
    mirror = sp.Matrix(symbols("mirror_x mirror_y mirror_z"))
    w = sp.Matrix(symbols("w_x w_y w_z"))
    cross = w.cross(mirror)
    ray = (x, y, -focal)
    scale = S("inv_w2_d2")
    lobe = sp.Piecewise((S("highlight"), S("w_dot_mirror") > 0), (S("zero_power"), True))
    if program["specular"].value.has(sp.Piecewise):
        lobe = sp.Piecewise((lobe, S("n_dot_l") > 0), (0, True))
    return (
        Definition("bounce", 2 * facing, _SPECULAR),
        *(
            Definition(
                f"mirror_{axis}",
                ray[i] + S("bounce") * S(f"n_{axis}"),
                _SPECULAR,
                "the primary ray mirrored at the surface, D + 2 facing n, as long as D" if i == 0 else "",
            )
            for i, axis in enumerate("xyz")
        ),
        Definition("w_dot_mirror", w.dot(mirror), _SPECULAR, "r.v = w . mirror / (|w| |D|)"),
        *(
            Definition(
                f"side_{axis}", cross[i], _SPECULAR, "w x mirror, short where the highlight is" if i == 0 else ""
            )
            for i, axis in enumerate("xyz")
        ),
        Definition("inv_w2_d2", S("inv_w2") * S("inv_d2"), _SPECULAR),
        Definition("cos2", S("w_dot_mirror") ** 2 * scale, _SPECULAR, "(r.v)^2"),
        Definition(
            "sin2",
            sum(S(f"side_{axis}") ** 2 for axis in "xyz") * scale,
            _SPECULAR,
            "1 - (r.v)^2, accurate where r.v is near 1",
        ),
        Definition(
            "highlight",
            CosinePower(S("cos2"), S("sin2"), S("shininess")),
            _SPECULAR,
            "max(0, r.v)^n where r.v > 0",
            program["specular"].source,
        ),
        Definition("zero_power", sp.Piecewise((1, sp.Eq(S("shininess"), 0)), (0, True)), _SPECULAR, "0^n: 1 for n = 0"),
        Definition("specular_gain", S("light_intensity") * S("k_specular"), _SPECULAR, "I_L k_s"),
        Definition(
            "specular", S("specular_gain") * lobe, _SPECULAR, program["specular"].meaning, program["specular"].source
        ),
    )


def _complement(_: ImageProgram) -> tuple[Definition, ...]:
    meaning = "1 - (r.v)^2 as a difference: what cancels is paid for"
    return (Definition("sin2", 1 - S("cos2"), _SPECULAR, meaning),)


def _complement_claims() -> tuple[Claim, ...]:
    return (Claim(S("sin2"), 1 - S("r_dot_v") ** 2, given={"r_dot_v": sp.sqrt(S("cos2"))}, keep=("cos2",)),)


def _mirror_claims() -> tuple[Claim, ...]:
    """Given l = w / |w|, n.v = facing / |D|; at last facing = -n.D and |n| = 1."""
    length, distance = sp.sqrt(S("inv_w2")), sp.sqrt(S("inv_d2"))
    x, y, eye = symbols("x y eye")
    n, w = symbols("n_x n_y n_z"), symbols("w_x w_y w_z")
    given = {f"l_{axis}": S(f"w_{axis}") * length for axis in "xyz"} | {f"n_{axis}": S(f"n_{axis}") for axis in "xyz"}
    given |= {"d_length": 1 / distance, "n_dot_v": S("facing") * distance}
    keep = (*tuple(str(s) for s in (*n, *w)), "facing", "inv_w2", "inv_d2")
    facts = {
        S("facing"): -(n[0] * x + n[1] * y - n[2] * eye),
        S("inv_w2"): 1 / (w[0] ** 2 + w[1] ** 2 + w[2] ** 2),
        S("inv_d2"): 1 / (x**2 + y**2 + eye**2),
    }
    unit = {n[2]: 1 - n[0] ** 2 - n[1] ** 2}
    return (
        Claim(S("cos2"), S("r_dot_v") ** 2, given, keep, facts, unit),
        Claim(S("sin2"), 1 - S("r_dot_v") ** 2, given, keep, facts, unit),
    )


def _diffuse_gain(program: ImageProgram) -> tuple[Definition, ...]:
    base = program["diffuse"]
    return (
        Definition("diffuse_gain", S("light_intensity") * S("k_diffuse"), "diffuse", "I_L k_d"),
        Definition("diffuse", S("diffuse_gain") * sp.Max(0, S("n_dot_l")), "diffuse", base.meaning, base.source),
    )


def _diffuse_claims() -> tuple[Claim, ...]:
    same = {"n_dot_l": S("n_dot_l")}
    return (Claim(S("diffuse"), S("light_intensity") * S("diffuse"), given=same, keep=("n_dot_l",)),)


def _gained_claims() -> tuple[Claim, ...]:
    """Given that the new diffuse and specular are I_L times the textbook's: their gains hold I_L."""
    terms = ("diffuse", "specular")
    given = {name: S(name) / S("light_intensity") for name in terms}
    return (Claim(S("lit"), S("lit"), given=given, keep=terms),)


def _gained(program: ImageProgram) -> tuple[Definition, ...]:
    terms = [S(name) for name in ("diffuse", "specular") if name in program]
    return (Definition("lit", sp.Add(*terms), "intensity", "what the light adds; the gains hold its intensity"),)


FORMS: tuple[Form, ...] = (
    Form(
        "light_in_radii",
        _light_in_radii,
        "a square root and two divisions",
        "n.l = n.w / |w|",
        _light_claims,
        brings=("n_dot_l",),
    ),
    Form(
        "diffuse_gain",
        _diffuse_gain,
        "a multiplication a pixel: the gain is a frame's constant",
        "I_L (k_d a) = (I_L k_d) a",
        _diffuse_claims,
        brings=("diffuse",),
    ),
    Form("gained", _gained, "a multiplication a pixel", "I_L (a + b) = I_L a + I_L b", _gained_claims, brings=("lit",)),
    Form(
        "mirrored_ray",
        _mirrored_ray,
        "the growth of the error with the shininess: 1 - r.v is computed, not subtracted",
        "r.v = l.(D mirrored at n) / |D|; |a x b|^2 + (a.b)^2 = |a|^2 |b|^2",
        _mirror_claims,
        brings=("specular",),
    ),
    Form(
        "complement",
        _complement,
        "the nine products of w x mirror, where what 1 - cos2 cancels is paid for: in pairs, or by a bound",
        "sin^2 + cos^2 = 1",
        _complement_claims,
        brings=("specular",),
    ),
)
