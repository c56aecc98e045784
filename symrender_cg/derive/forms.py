"""The registry of forms: algebraically equal ways to compute the named quantities of the derivation.

A form states the definitions that it brings, the scenes it is for, what it removes, and its claims: what each new
quantity equals in the textbook's derivation. `proofs.prove` shows every claim's difference to be 0; the
tests run it over the whole registry. Adding a form is adding one entry here.

The forms below measure lengths of the scene in radii and write f for the distance of the image plane from the eye,
which is e: rays may be scaled apart from the scene, as only their direction counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import sympy as sp

from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol, symbols

S = symbol


@dataclass(frozen=True, slots=True)
class Claim:
    """left = right: a new quantity and what it equals in the textbook's derivation.

    given    textbook quantities in new ones, by an earlier claim or by definition; they are not expanded
    keep     new quantities that the proof need not look into
    facts    what kept symbols are, used last
    squares  symbols with a known square
    """

    left: sp.Expr
    right: sp.Expr
    given: Mapping[str, sp.Expr] = field(default_factory=dict)
    keep: tuple[str, ...] = ()
    facts: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)
    squares: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Form:
    """A set of definitions that replace those of the same name.

    `off_axis` and `front_test` say which plans the form is for (None: either); `brings` which quantities of the
    derivation it is for, so that it is passed over where the plan left them out. `guard` renames the guarded
    quantities. `ends` names the two ends of a row's span of hits, where the form has them.
    """

    name: str
    definitions: Callable[[ImageProgram], tuple[Definition, ...]]
    removes: str
    source: str
    claims: Callable[[], tuple[Claim, ...]]
    off_axis: bool | None = None
    front_test: bool | None = None
    brings: tuple[str, ...] = ()
    guard: tuple[tuple[str, str], ...] = ()
    ends: tuple[str, str] | None = None

    def fits(self, program: ImageProgram, *, off_axis: bool, front_test: bool) -> bool:
        """Whether the form is for such a plan and such a program."""
        return (
            self.off_axis in (None, off_axis)
            and self.front_test in (None, front_test)
            and all(name in program for name in self.brings)
        )


# ------------------------------------------------------------------------------- the seed's own discriminants


def _seed_disc(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, eye, radius = symbols("x y eye radius")
    value = eye**2 * radius**2 - (eye**2 - radius**2) * (x**2 + y**2)
    return (Definition("disc", value, "ray and sphere", "disc = e^2 R^2 - (e^2 - R^2)(x^2 + y^2): a hit where >= 0"),)


def _quadratic_disc(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, eye = symbols("x y eye")
    m2 = sum(S(f"m_{axis}") ** 2 for axis in "xyz")
    value = S("m_dot_d") ** 2 - S("d_dot_d") * (m2 - S("radius") ** 2)
    return (
        Definition("d_dot_d", x**2 + y**2 + eye**2, "ray and sphere", "D = (x, y, -e), A = |D|^2"),
        Definition(
            "m_dot_d",
            S("m_x") * x + S("m_y") * y - S("m_z") * eye,
            "ray and sphere",
            "positive where the sphere lies before the eye",
        ),
        Definition("disc", value, "ray and sphere", "disc = (m.D)^2 - |D|^2 (|m|^2 - R^2): a hit where >= 0"),
    )


def _disc_claim() -> tuple[Claim, ...]:
    return (Claim(S("disc"), S("disc")),)


# --------------------------------------------------------------------- the span of a row: where its hits begin and end

_SILHOUETTE = "silhouette"
_RAY = "ray and sphere"


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
            "disc / R^2 = alpha (x - x_left)(x_right - x): no cancellation at the silhouette",
        ),
        Definition("facing", sp.sqrt(S("facing2")), _RAY, "-n.D, how far the surface faces the ray: root / R"),
    )


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


# --------------------------------------------------------------------------------- the normal from the foot point

_NORMAL = "normal"
_FOOT = "the foot point (D x (D x m)) / |D|^2 lies on the ray, nearest to the centre; n is it less facing D / |D|^2"


def _inverse() -> Definition:
    return Definition("inv_d2", 1 / S("d_dot_d"), _NORMAL)


def _centred_normal(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, depth, facing, inv_d2, along = symbols("x y focal depth facing inv_d2 along")
    return (
        _inverse(),
        Definition("along", (depth * focal - facing) * inv_d2, _NORMAL, "t / R: n = (t x, t y, e (1 - t)) / R"),
        Definition("n_x", x * along, _NORMAL),
        Definition("n_y", y * along, _NORMAL),
        Definition("n_z", (depth * S("s") + focal * facing) * inv_d2, _NORMAL, "a sum, where e (1 - t) would cancel"),
    )


def _off_axis_normal(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, depth, facing, inv_d2 = symbols("x y focal depth facing inv_d2")
    dx, dy, tilt = symbols("dx dy tilt")
    image_x, image_y = symbols("image_x image_y")
    return (
        _inverse(),
        Definition("dx", x - image_x, _NORMAL, "the pixel seen from the image of the centre"),
        Definition("dy", y - image_y, _NORMAL),
        Definition("tilt", (image_x * dy - image_y * dx) / focal, _NORMAL),
        Definition("n_x", (depth * (focal * dx - tilt * y) - facing * x) * inv_d2, _NORMAL, _FOOT),
        Definition("n_y", (depth * (focal * dy + tilt * x) - facing * y) * inv_d2, _NORMAL),
        Definition("n_z", (depth * (x * dx + y * dy) + focal * facing) * inv_d2, _NORMAL),
    )


def _any_normal(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, facing, inv_d2 = symbols("x y focal facing inv_d2")
    c_x, c_y, c_z = symbols("cross_x cross_y cross_z")
    return (
        _inverse(),
        Definition("n_x", (-c_y * focal - c_z * y - facing * x) * inv_d2, _NORMAL, _FOOT),
        Definition("n_y", (c_x * focal + c_z * x - facing * y) * inv_d2, _NORMAL),
        Definition("n_z", (c_x * y - c_y * x + facing * focal) * inv_d2, _NORMAL),
    )


def _normal_claims() -> tuple[Claim, ...]:
    """Given root = R facing: both are not negative, and their squares are equal by the claims on facing2."""
    root = {"root": S("radius") * S("facing")}
    return tuple(Claim(S(f"n_{axis}"), S(f"n_{axis}"), given=root, keep=("facing",)) for axis in "xyz")


# ---------------------------------------------------------------------------------------- light and highlight

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
    Form("seed_disc", _seed_disc, "nothing: the seed's formula", "Chapter 1", _disc_claim, off_axis=False),
    Form(
        "quadratic_disc",
        _quadratic_disc,
        "nothing: the textbook's formula b^2 - A c",
        "Chapter 1, Cell 1",
        _disc_claim,
        off_axis=True,
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
    Form(
        "centred_foot",
        _centred_normal,
        "the cancellation of 1 - t where the eye is far",
        "the foot point of the ray",
        _normal_claims,
        off_axis=False,
        front_test=False,
    ),
    Form(
        "off_axis_foot",
        _off_axis_normal,
        "the difference of two long vectors in P - C, and of two long products in m x D",
        "the foot point of the ray; m x D vanishes at the image of the centre",
        _normal_claims,
        off_axis=True,
        front_test=False,
    ),
    Form(
        "cross_foot",
        _any_normal,
        "the difference of two long vectors in P - C",
        "the foot point of the ray",
        _normal_claims,
        front_test=True,
    ),
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
)


def form(name: str) -> Form:
    """The form of that name; KeyError if there is none."""
    for entry in FORMS:
        if entry.name == name:
            return entry
    raise KeyError(name)


def apply(
    program: ImageProgram, chosen: tuple[Form, ...], *, keep: tuple[str, ...] = (), keep_all: bool = False
) -> ImageProgram:
    """The program with the definitions of the chosen forms in place of its own, in an order that defines before use.

    Definitions that nothing uses are left out, unless `keep` names them or `keep_all` asks for all (a proof may speak
    of them).
    """
    table = {definition.name: definition for definition in program.definitions}
    rename: dict[str, str] = {}
    for entry in chosen:
        table |= {definition.name: definition for definition in entry.definitions(program)}
        rename |= dict(entry.guard)
    guard = tuple(rename.get(name, name) for name in program.guard)
    ordered: list[Definition] = []
    placed: set[str] = set()

    def place(name: str) -> None:
        if name in table and name not in placed:
            placed.add(name)
            for used in sorted({s.name for s in table[name].value.free_symbols}, key=_position(table)):
                place(used)
            ordered.append(table[name])

    for name in (*guard, *table):
        place(name)
    if keep_all:
        return ImageProgram(program.name, tuple(ordered), guard, program.value, program.background)
    return ImageProgram(program.name, (), guard, program.value, program.background).replacing(tuple(ordered), keep=keep)


def _position(table: dict[str, Definition]) -> Callable[[str], int]:
    positions = {name: i for i, name in enumerate(table)}
    return lambda name: positions.get(name, -1)
