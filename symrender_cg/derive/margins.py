"""How far from a jump a decision in floating point was: each part of a scene that decides gets a margin.

    part        decides                                        margin
    shadow      does the line to the light meet a blocker?     | |inside2| - keen |b|^2 |w|^2
    gate        does the surface face the light?               | (n.w)^2 - keen^2 |w|^2
    echo        does a mirrored ray meet a sphere?             | |disc| - keen |d|^2
    plane       does the eye's ray meet the plane?             | |n.D| - keen |D|_1
    echo_plane  does a mirrored ray?                           | |n.d| - keen |d|_1
    tiles       which of the plane's two materials is it?      | distance to the next edge - keen

keen is the error of the decision's left side as a share of what stands beside it: GRAIN times how much the part
magnifies. Where rays may have been mirrored, or come from the plane, each point brings its own `blur`: how far, in
units of GRAIN, rounding moves it, in its receiver's unit; `drift`, how far it moves the ray mirrored there aside; and
`turn`, how much it turns the normal and that ray.
A decision whose margin is positive is right; one whose margin is not is in doubt, and somebody else decides.

Comes in: parts of the derivation. Goes out: the same with margins, and with the blur that a mirror or the plane hands
on. Never done here: a decision.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from symrender_cg.derive.parts import Part, vector
from symrender_cg.derive.program import Definition
from symrender_cg.derive.symbols import symbol as S

GRAIN = sp.Rational(1, 2**44)
"""What rounding moves a point by that the eye sees, in its receiver's unit: an upper bound, about a hundred times what
it was ever seen to be."""

_SECTION = "margin"


def with_margin(part: Part, *, blurred: bool) -> Part:
    """The part with the margin of its decision, and where rays may be mirrored with the blur of what they meet.

    `blurred`: points bring a blur of their own; else it is 1. Parts that decide nothing are returned as they are.
    """
    if part.name not in _MARGINS:
        return part
    added = _MARGINS[part.name](S("blur") if blurred else sp.Integer(1))
    names = {definition.name for definition in added}
    definitions = tuple(d for d in part.definitions if d.name not in names) + added
    used = {s.name for definition in definitions for s in definition.value.free_symbols}
    given = used - {definition.name for definition in definitions} - {name for name, _ in part.rates}
    results = tuple(name for name in _RESULTS.get(part.name, ("margin",)) if name in names)
    known = {name for name in given if name in _SLOW}
    rates = (*part.rates, *((name, "sphere") for name in sorted(known)))
    arrays = part.arrays
    for name in ("blur", "drift", "turn"):
        if name in given:
            rates, arrays = (*rates, (name, "pixel")), (*arrays, name)
    return replace(part, definitions=definitions, results=(*part.results, *results), rates=rates, arrays=arrays)


def gate_part() -> Part:
    """Whether a surface faces its light, which a gated highlight rests on: the margin alone."""
    arrays = ("n_x", "n_y", "n_z", "w_x", "w_y", "w_z", "w2")
    facing = Definition("n_dot_w", vector("n").dot(vector("w")), "gate", "|w| n.l")
    return Part("gate", (facing,), (), tuple((name, "pixel") for name in arrays), arrays)


_SLOW = frozenset({"keen"})
_RESULTS = {
    "arrival": ("drifted",),
    "plane": ("margin", "blurred", "drifted"),
    "echo_plane": ("margin", "blurred", "drifted"),
}


def _shadow(blur: sp.Expr) -> tuple[Definition, ...]:
    return (
        Definition("b2", vector("b").dot(vector("b")), _SECTION, "|b|^2, at least ratio^2"),
        Definition(
            "margin",
            sp.Abs(S("inside2")) - S("keen") * blur * S("b2") * S("w2"),
            _SECTION,
            "not above 0: in doubt",
        ),
    )


def _gate(blur: sp.Expr) -> tuple[Definition, ...]:
    return (
        Definition("keen_here", S("keen") * blur, _SECTION),
        Definition("margin", S("n_dot_w") ** 2 - S("keen_here") ** 2 * S("w2"), _SECTION, "not above 0: in doubt"),
    )


def _echo(_: sp.Expr) -> tuple[Definition, ...]:
    margin = sp.Abs(S("disc")) - S("keen") * (S("drift") + S("turn")) * S("d2")
    return (Definition("margin", margin, _SECTION, "not above 0: in doubt"),)


def _arrival(_: sp.Expr) -> tuple[Definition, ...]:
    m = vector("m")
    length = sp.sqrt(S("d2"))
    return (
        Definition("d_size", length, _SECTION, "|d|"),
        Definition("ahead", m.dot(vector("mirror")), _SECTION, "m.d"),
        Definition(
            "travelled", S("d_size") * (m.dot(m) - 1) / (S("ahead") + S("facing")), _SECTION, "the ray's way, in radii"
        ),
        Definition(
            "drifted",
            1 + _aside(S("shrink")) * S("d_size") / S("facing"),
            _SECTION,
            "how far rounding moves the new point: more at grazing rays",
        ),
    )


def _plane(_: sp.Expr) -> tuple[Definition, ...]:
    size = sp.Abs(S("x")) + sp.Abs(S("y")) + S("focal")
    p = vector("p")
    return (
        Definition("margin", sp.Abs(S("descent")) - GRAIN * size, _SECTION, "not above 0: in doubt"),
        Definition("blurred", 1 + p.dot(p), _SECTION, "far away rounding moves the point along the ray by |p|^2"),
        Definition("drifted", 1 + 2 * sp.sqrt(p.dot(p)), _SECTION, "and the mirrored ray aside by |p|"),
    )


def _echo_plane(_: sp.Expr) -> tuple[Definition, ...]:
    size = sum((sp.Abs(S(f"mirror_{axis}")) for axis in "xyz"), sp.Integer(0))
    return (
        Definition("d_size", size, _SECTION, "at least |d|"),
        Definition("travelled", S("t_plane") * S("d_size"), _SECTION, "the ray's way, in heights"),
        Definition("margin", sp.Abs(S("descent")) - GRAIN * S("turn") * S("d_size"), _SECTION, "not above 0: in doubt"),
        Definition("drifted", 1 + _aside(S("scale")), _SECTION, "how far rounding moves the ray aside"),
        Definition("blurred", S("drifted") * S("d_size") / S("descent"), _SECTION, "and so the foot, along the plane"),
    )


def _aside(scale: sp.Expr) -> sp.Expr:
    """What a mirrored ray is aside where it meets the next surface: the old point's drift, in the new unit, and twice
    its turn for each unit of the way. Three quarters of that is what was seen at most."""
    return sp.Rational(3, 4) * (S("drift") * scale + 2 * S("turn") * S("travelled"))


def _tiles(blur: sp.Expr) -> tuple[Definition, ...]:
    across = vector("across").dot(vector("p")) + S("across_0")
    along = vector("along").dot(vector("p")) + S("along_0")
    half = sp.Rational(1, 2)
    inner = sp.Max(sp.Abs(across - S("tile_u") - half), sp.Abs(along - S("tile_v") - half))
    return (
        Definition("from_middle", inner, _SECTION, "from the middle of the tile, 1/2 at its edge"),
        Definition("margin", half - S("from_middle") - S("keen") * blur, _SECTION, "not above 0: in doubt"),
    )


_MARGINS = {
    "shadow": _shadow,
    "gate": _gate,
    "echo": _echo,
    "arrival": _arrival,
    "plane": _plane,
    "echo_plane": _echo_plane,
    "tiles": _tiles,
}
