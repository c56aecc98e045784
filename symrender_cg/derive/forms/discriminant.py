"""The seed's and the textbook's own discriminants: what the literal kernels compute."""

from __future__ import annotations

from symrender_cg.derive.forms.form import Claim, Form
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols


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
)
