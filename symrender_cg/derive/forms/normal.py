"""Forms of the normal, from the foot point of the ray: the point of it that is nearest to the centre."""

from __future__ import annotations

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
    foot = (-c_y * focal - c_z * y, c_x * focal + c_z * x, c_x * y - c_y * x)
    return (
        _inverse(),
        *(Definition(f"foot_{axis}", foot[i], _NORMAL, _FOOT if i == 0 else "") for i, axis in enumerate("xyz")),
        *(
            Definition(f"n_{axis}", (S(f"foot_{axis}") - facing * ray) * inv_d2, _NORMAL)
            for axis, ray in zip("xyz", (x, y, -focal), strict=True)
        ),
    )


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
