"""The light's terms from two inner products with the light's position: no vector is formed for a pixel.

With m = (C - E) / R, lamp = (L - C) / R and n = (F - facing D) / |D|^2, where F = D x (D x m), the foot point of the
ray times |D|^2 (see normal.py):

    n.lamp = (F.lamp - facing D.lamp) / |D|^2
    n.w = n.lamp - 1,   |w|^2 = |lamp|^2 + 1 - 2 n.lamp,   w.mirror = D.lamp + facing (2 n.lamp - 1)

A third of the operations. What it costs: |w|^2 cancels where the light is close, so that these forms are for pairs, or
for a kernel that bounds its own error.
"""

from __future__ import annotations

import sympy as sp

from symrender_cg.derive.forms.form import Claim, Form
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols

_NORMAL = "normal"
_LIGHT = "light"
_SOURCE = "n.F = |F|^2 / |D|^2 and w = lamp - n, |n| = 1"


def _centred_foot(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, depth, s = symbols("x y focal depth s")
    lamp_x, lamp_y, lamp_z = symbols("lamp_x lamp_y lamp_z")
    return (
        Definition(
            "slope", depth * focal * lamp_x, _NORMAL, "F = kappa (f x, f y, s): F.lamp = slope x + bend s + base"
        ),
        Definition("bend", depth * lamp_z, _NORMAL),
        Definition("base", depth * focal * lamp_y * y, _NORMAL),
        Definition("foot_dot_lamp", S("slope") * x + S("bend") * s + S("base"), _NORMAL),
    )


def _off_axis_foot(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, depth = symbols("x y focal depth")
    dx, dy, image_x, image_y = symbols("dx dy image_x image_y")
    lamp_x, lamp_y, lamp_z = symbols("lamp_x lamp_y lamp_z")
    bend, slope, base = symbols("bend slope base")
    return (
        Definition("dx", x - image_x, _NORMAL, "the pixel seen from the image of the centre"),
        Definition("dy", y - image_y, _NORMAL),
        Definition("bend", depth * (lamp_z - lamp_y * image_y / focal), _NORMAL),
        Definition(
            "slope",
            depth
            * (lamp_x * (focal + image_y * y / focal) + lamp_y * image_x * (dy - image_y) / focal + lamp_z * image_x),
            _NORMAL,
        ),
        Definition(
            "base",
            depth * dy * (lamp_y * (focal + image_x**2 / focal) + lamp_z * y - lamp_x * image_x * y / focal),
            _NORMAL,
        ),
        Definition(
            "foot_dot_lamp",
            (bend * dx + slope) * dx + base,
            _NORMAL,
            "F.lamp along a row: 0 at the image of the centre",
        ),
    )


def _foot_claims() -> tuple[Claim, ...]:
    """F is n |D|^2 + facing D, and lamp = w / R + n for the textbook's n and w = L - P."""
    x, y, eye, radius = symbols("x y eye radius")
    n, w = sp.Matrix(symbols("n_x n_y n_z")), sp.Matrix(symbols("w_x w_y w_z"))
    ray = sp.Matrix([x, y, -eye])
    foot = n * S("d_dot_d") + S("root") / radius * ray
    return (
        Claim(S("foot_dot_lamp"), foot.dot(w / radius + n), given={"root": radius * S("facing")}, keep=("facing",)),
    )


def _light_terms(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, facing = symbols("x y focal facing")
    lamp = sp.Matrix(symbols("lamp_x lamp_y lamp_z"))
    n_dot_lamp, d_dot_lamp = symbols("n_dot_lamp d_dot_lamp")
    return (
        Definition("row_dot_lamp", lamp[1] * y - lamp[2] * focal, _LIGHT),
        Definition("d_dot_lamp", lamp[0] * x + S("row_dot_lamp"), _LIGHT, "D.lamp"),
        Definition("inv_d2", 1 / S("d_dot_d"), _NORMAL),
        Definition(
            "n_dot_lamp",
            (S("foot_dot_lamp") - facing * d_dot_lamp) * S("inv_d2"),
            _LIGHT,
            "n.lamp, with n = (F - facing D) / |D|^2",
        ),
        Definition("lamp2", lamp.dot(lamp) + 1, _LIGHT, "|lamp|^2 + |n|^2"),
        Definition("w2", S("lamp2") - 2 * n_dot_lamp, _LIGHT, "|w|^2 for w = lamp - n"),
        Definition("inv_w2", 1 / S("w2"), _LIGHT),
        Definition("n_dot_l", (n_dot_lamp - 1) * sp.sqrt(S("inv_w2")), _LIGHT, "n.l = n.w / |w|"),
        Definition(
            "w_dot_mirror",
            d_dot_lamp + facing * (2 * n_dot_lamp - 1),
            "specular",
            "r.v = w . mirror / (|w| |D|), mirror = D + 2 facing n",
        ),
    )


def _light_claims() -> tuple[Claim, ...]:
    """Given P = C + R n and w (textbook) = R w, so that lamp = w + n; at last F = |D|^2 n + facing D, facing = -n.D and
    |n| = 1."""
    x, y, eye = symbols("x y eye")
    n, w = symbols("n_x n_y n_z"), symbols("w_x w_y w_z")
    names = tuple(s.name for s in (*n, *w))
    lamp = {S(f"lamp_{axis}"): n[i] + w[i] for i, axis in enumerate("xyz")}
    along = sum(a * b for a, b in zip(n, w, strict=True))
    facing = -(n[0] * x + n[1] * y - n[2] * eye)
    distance2 = x**2 + y**2 + eye**2
    d_dot_lamp = sum(a * b for a, b in zip(lamp.values(), (x, y, -eye), strict=True))
    unit = {n[2]: 1 - n[0] ** 2 - n[1] ** 2}
    facts = {
        **lamp,
        S("facing"): facing,
        S("foot_dot_lamp"): distance2 * (along + 1) + facing * d_dot_lamp,
        S("n_dot_lamp"): along + 1,
        S("inv_w2"): 1 / sum(a**2 for a in w),
        S("inv_d2"): 1 / distance2,
    }
    kept = ("foot_dot_lamp", *(s.name for s in lamp), "facing", "inv_w2", "inv_d2", *names)
    later = (*kept, "n_dot_lamp")
    given: dict[str, sp.Expr] = {name: S(name) for name in names}
    light = {f"l_{axis}": S(f"w_{axis}") * sp.sqrt(S("inv_w2")) for axis in "xyz"} | given
    seen = {"d_length": 1 / sp.sqrt(S("inv_d2")), "n_dot_v": S("facing") * sp.sqrt(S("inv_d2"))}
    return (
        Claim(S("n_dot_lamp"), sp.Matrix(n).dot(sp.Matrix(w)) + 1, given, kept, facts, unit),
        Claim(S("w2"), S("w_length") ** 2, given, later, facts, unit),
        Claim(S("n_dot_l"), S("n_dot_l"), light, later, facts, unit),
        Claim(S("cos2"), S("r_dot_v") ** 2, light | seen, later, facts, unit),
    )


FORMS: tuple[Form, ...] = (
    Form(
        "centred_foot_dot_lamp",
        _centred_foot,
        "the normal, for what is asked of it: n.lamp",
        "the foot point of the ray",
        _foot_claims,
        off_axis=False,
        front_test=False,
        brings=("n_dot_l",),
    ),
    Form(
        "off_axis_foot_dot_lamp",
        _off_axis_foot,
        "the normal, for what is asked of it: n.lamp",
        "the foot point of the ray; m x D vanishes at the image of the centre",
        _foot_claims,
        off_axis=True,
        front_test=False,
        brings=("n_dot_l",),
    ),
    Form(
        "inner_products",
        _light_terms,
        "w, the mirrored ray and their products, where what |w|^2 cancels is paid for: in pairs, or by a bound",
        _SOURCE,
        _light_claims,
        front_test=False,
        brings=("n_dot_l",),
    ),
)
