"""Forms of the normal, from the foot point of the ray: the point of it that is nearest to the centre."""

from __future__ import annotations

import sympy as sp

from symrender_cg.derive.forms.form import Claim, Form
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols

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


def off_axis_foot() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """The foot point times |D|^2, by differences from the image of the centre."""
    x, y, focal, depth, dx, dy, tilt = symbols("x y focal depth dx dy tilt")
    return depth * (focal * dx - tilt * y), depth * (focal * dy + tilt * x), depth * (x * dx + y * dy)


def cross_foot() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """The foot point times |D|^2, by the cross product m x D."""
    x, y, focal, c_x, c_y, c_z = symbols("x y focal cross_x cross_y cross_z")
    return -c_y * focal - c_z * y, c_x * focal + c_z * x, c_x * y - c_y * x


def normal_from_foot() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """n from named components of the foot point."""
    x, y, focal, facing, inv_d2 = symbols("x y focal facing inv_d2")
    n_x, n_y, n_z = (
        (S(f"foot_{axis}") - facing * ray) * inv_d2 for axis, ray in zip("xyz", (x, y, -focal), strict=True)
    )
    return n_x, n_y, n_z


def _off_axis_normal(_: ImageProgram) -> tuple[Definition, ...]:
    x, y, focal, facing, inv_d2 = symbols("x y focal facing inv_d2")
    dx, dy, image_x, image_y = symbols("dx dy image_x image_y")
    foot_x, foot_y, foot_z = off_axis_foot()
    return (
        _inverse(),
        Definition("dx", x - image_x, _NORMAL, "the pixel seen from the image of the centre"),
        Definition("dy", y - image_y, _NORMAL),
        Definition("tilt", (image_x * dy - image_y * dx) / focal, _NORMAL),
        Definition("n_x", (foot_x - facing * x) * inv_d2, _NORMAL, _FOOT),
        Definition("n_y", (foot_y - facing * y) * inv_d2, _NORMAL),
        Definition("n_z", (foot_z + focal * facing) * inv_d2, _NORMAL),
    )


def _any_normal(_: ImageProgram) -> tuple[Definition, ...]:
    components = zip("xyz", cross_foot(), normal_from_foot(), strict=True)
    feet, normals = [], []
    for axis, foot, normal in components:
        feet.append(Definition(f"foot_{axis}", foot, _NORMAL, _FOOT if axis == "x" else ""))
        normals.append(Definition(f"n_{axis}", normal, _NORMAL))
    return (_inverse(), *feet, *normals)


def _normal_claims() -> tuple[Claim, ...]:
    """Given root = R facing: both are not negative, and their squares are equal by the claims on facing2."""
    root = {"root": S("radius") * S("facing")}
    return tuple(Claim(S(f"n_{axis}"), S(f"n_{axis}"), given=root, keep=("facing",)) for axis in "xyz")


FORMS: tuple[Form, ...] = (
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
)
