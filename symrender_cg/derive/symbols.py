"""The symbols of the derivation, one row a symbol: name, LaTeX, what it means.

`symbol(name)` is the one way to a symbol, so that a name has the same assumptions wherever it is used.
The camera's frame is meant throughout: the eye at (0, 0, e), the image plane z = 0, the view along -z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import sympy as sp


@dataclass(frozen=True, slots=True)
class Quantity:
    """An input of the image formula: its LaTeX, its meaning, whether it is known to be positive or not negative."""

    name: str
    latex: str
    meaning: str
    sign: str = "real"


INPUTS: tuple[Quantity, ...] = (
    Quantity("x", "x", "image plane, to the right"),
    Quantity("y", "y", "image plane, upwards"),
    Quantity("eye", "e", "distance of the eye from the image plane", "positive"),
    Quantity("center_x", "c_x", "centre of the sphere"),
    Quantity("center_y", "c_y", "centre of the sphere"),
    Quantity("center_z", "c_z", "centre of the sphere"),
    Quantity("radius", "R", "radius of the sphere", "positive"),
    Quantity("light_x", r"\ell_x", "position of the point light"),
    Quantity("light_y", r"\ell_y", "position of the point light"),
    Quantity("light_z", r"\ell_z", "position of the point light"),
    Quantity("light_intensity", "I_L", "intensity of the point light", "nonnegative"),
    Quantity("k_ambient", "k_a", "ambient coefficient", "nonnegative"),
    Quantity("k_diffuse", "k_d", "diffuse coefficient", "nonnegative"),
    Quantity("k_specular", "k_s", "specular coefficient", "nonnegative"),
    Quantity("shininess", "n", "exponent of the specular term", "nonnegative"),
    Quantity("background", "I_0", "intensity where no ray hits"),
)

_POSITIVE = ("focal", "d_dot_d", "inv_d2", "d_length")
_NOT_NEGATIVE = ("root", "facing", "reach", "row_half", "w2", "inv_w2", "w_length", "cos2", "sin2")

_SIGN = (
    {row.name: row.sign for row in INPUTS}
    | dict.fromkeys(_POSITIVE, "positive")
    | dict.fromkeys(_NOT_NEGATIVE, "nonnegative")
)

_LATEX = {row.name: row.latex for row in INPUTS} | {
    "focal": "f",
    "d_dot_d": "A",
    "d_length": r"\lVert D\rVert",
    "m_dot_d": r"m\cdot D",
    "disc": r"\Delta",
    "root": r"\sqrt{\Delta}",
    "w_length": r"\lVert w\rVert",
    "n_dot_l": r"\mu",
    "n_dot_v": r"\nu",
    "l_dot_v": r"\hat w\cdot\hat V",
    "r_dot_v": r"\hat r\cdot\hat V",
    "depth": r"\kappa",
    "alpha": r"\alpha",
    "rho2": r"\rho^2",
    "sin2": r"\sin^2\theta",
    "cos2": r"\cos^2\theta",
}


@cache
def symbol(name: str) -> sp.Symbol:
    """The symbol of that name, real, and positive or not negative where that is known of it."""
    sign = _SIGN.get(name, "real")
    return sp.Symbol(name, real=True) if sign == "real" else sp.Symbol(name, **{sign: True})


def symbols(names: str) -> tuple[sp.Symbol, ...]:
    """Several symbols at once: `symbols("x y eye")`."""
    return tuple(symbol(name) for name in names.split())


def latex_names() -> dict[sp.Symbol, str]:
    """How each symbol is set in LaTeX, where its name alone would not do."""
    return {symbol(name): latex for name, latex in _LATEX.items()}
