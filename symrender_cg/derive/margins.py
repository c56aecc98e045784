"""How far from a jump a decision in floating point was: each part of a scene that decides gets a margin.

    part        decides                                        margin
    shadow      does the line to the light meet a blocker?     | |inside2| - keen |b|^2 |w|^2
    gate        does the surface face the light?               | (n.w)^2 - keen^2 |w|^2
    echo        does a mirrored ray meet a sphere?             | |disc| - keen |d|^2
    plane       does the eye's ray meet the plane?             | |n.D| - keen |D|_1
    echo_plane  does a mirrored ray?                           | |n.d| - keen |d|_1
    tiles       which of the plane's two materials is it?      | distance to the next edge - keen

keen is the error of the decision's left side as a share of what stands beside it: GRAIN times how much the part
magnifies. Where points may lie on the plane, each brings its own `blur`: how far, in units of GRAIN, rounding to
float64 moves it, in its receiver's unit; on a sphere that is 1.
A decision whose margin is positive is right; one whose margin is not is in doubt, and somebody else decides.

Where there are mirrors, points and rays are in two words, so that each mirrored point is rounded no more than one that
the eye sees. What the second words leave is magnified from mirror to mirror: `turn` follows it, in units of 2^-100,
and a point whose turn is not below MOST_TURN is in doubt.

Comes in: parts of the derivation. Goes out: the same with margins, and with the blur and the turn that a mirror or the
plane hands on. Never done here: a decision.
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

MOST_TURN = sp.Integer(2) ** 40
"""Units of 2^-100 that a point and its ray may be off: far below what rounding them to float64 does."""

_SECTION = "margin"


def with_margin(part: Part, *, blurred: bool) -> Part:
    """The part with the margin of its decision, and where it hands on two words with the turn of what it gives.

    `blurred`: points bring a blur of their own; else it is 1. Parts that decide nothing are returned as they are.
    """
    if part.name not in _MARGINS:
        return part
    added = _MARGINS[part.name](S("blur") if blurred else sp.Integer(1), bool(part.in_full or part.second_words))
    names = {definition.name for definition in added}
    definitions = tuple(d for d in part.definitions if d.name not in names) + added
    used = {s.name for definition in definitions for s in definition.value.free_symbols}
    given = used - {definition.name for definition in definitions} - {name for name, _ in part.rates}
    results = tuple(name for name in ("margin", "blurred", "turned") if name in names)
    rates = (*part.rates, *((name, "sphere") for name in sorted(given & _SLOW)))
    arrays = part.arrays
    for name in ("blur", "turn"):
        if name in given:
            rates, arrays = (*rates, (name, "pixel")), (*arrays, name)
    return replace(part, definitions=definitions, results=(*part.results, *results), rates=rates, arrays=arrays)


def gate_part() -> Part:
    """Whether a surface faces its light, which a gated highlight rests on: the margin alone."""
    arrays = ("n_x", "n_y", "n_z", "w_x", "w_y", "w_z", "w2")
    facing = Definition("n_dot_w", vector("n").dot(vector("w")), "gate", "|w| n.l")
    return Part("gate", (facing,), (), tuple((name, "pixel") for name in arrays), arrays)


_SLOW = frozenset({"keen"})


def _sphere(_: sp.Expr, in_full: bool) -> tuple[Definition, ...]:
    if not in_full:
        return ()
    away = sp.sqrt(S("power") + 1) * sp.sqrt(S("d_dot_d")) / S("facing")
    return (Definition("turned", away, _SECTION, "at grazing rays, and far away, two words are less exact"),)


def _shadow(blur: sp.Expr, _: bool) -> tuple[Definition, ...]:
    return (
        Definition("b2", vector("b").dot(vector("b")), _SECTION, "|b|^2, at least ratio^2"),
        Definition(
            "margin",
            sp.Abs(S("inside2")) - S("keen") * blur * S("b2") * S("w2"),
            _SECTION,
            "not above 0: in doubt",
        ),
    )


def _gate(blur: sp.Expr, _: bool) -> tuple[Definition, ...]:
    return (
        Definition("keen_here", S("keen") * blur, _SECTION),
        Definition("margin", S("n_dot_w") ** 2 - S("keen_here") ** 2 * S("w2"), _SECTION, "not above 0: in doubt"),
    )


def _echo(blur: sp.Expr, _: bool) -> tuple[Definition, ...]:
    margin = sp.Abs(S("disc")) - S("keen") * (1 + blur) * S("d2")
    return (Definition("margin", margin, _SECTION, "not above 0: in doubt"),)


def _arrival(_: sp.Expr, in_full: bool) -> tuple[Definition, ...]:
    if not in_full:
        return ()
    m, turn = vector("m"), S("turn")
    return (
        Definition("d_size", sp.sqrt(S("d2")), _SECTION, "|d|"),
        Definition("ahead", m.dot(vector("mirror")), _SECTION, "m.d"),
        Definition(
            "travelled", S("d_size") * (m.dot(m) - 1) / (S("ahead") + S("facing")), _SECTION, "the ray's way, in radii"
        ),
        Definition(
            "turned",
            1 + _aside(turn, turn, S("shrink")) * S("d_size") / S("facing"),
            _SECTION,
            "how far what two words leave moves the new point: more at grazing rays",
        ),
    )


def _plane(_: sp.Expr, in_full: bool) -> tuple[Definition, ...]:
    size = sp.Abs(S("x")) + sp.Abs(S("y")) + S("focal")
    p = vector("p")
    found = (
        Definition("margin", sp.Abs(S("descent")) - GRAIN * size, _SECTION, "not above 0: in doubt"),
        Definition("blurred", 1 + p.dot(p), _SECTION, "far away rounding moves the point along the ray by |p|^2"),
    )
    return (*found, Definition("turned", S("blurred"), _SECTION, "and so what two words leave")) if in_full else found


def _echo_plane(blur: sp.Expr, _: bool) -> tuple[Definition, ...]:
    return (
        *_way_to_plane(),
        Definition("margin", sp.Abs(S("descent")) - GRAIN * S("d_size"), _SECTION, "not above 0: in doubt"),
        Definition("drifted", 1 + _aside(blur, sp.Integer(1), S("scale")), _SECTION, "rounding moves the ray aside"),
        Definition("blurred", S("drifted") * S("d_size") / S("descent"), _SECTION, "and so the foot, along the plane"),
    )


def _landing(_: sp.Expr, __: bool) -> tuple[Definition, ...]:
    foot, turn = vector("foot"), S("turn")
    return (
        *_way_to_plane(),
        Definition("blurred", 1 + sp.sqrt(foot.dot(foot)), _SECTION, "rounding moves the point by its distance"),
        Definition("drifted", 1 + _aside(turn, turn, S("scale")), _SECTION, "what two words leave moves the ray aside"),
        Definition("turned", S("drifted") * S("d_size") / S("descent"), _SECTION, "and so the foot, along the plane"),
    )


def _way_to_plane() -> tuple[Definition, ...]:
    size = sum((sp.Abs(S(f"mirror_{axis}")) for axis in "xyz"), sp.Integer(0))
    return (
        Definition("d_size", size, _SECTION, "at least |d|"),
        Definition("travelled", S("t_plane") * S("d_size"), _SECTION, "the ray's way, in heights"),
    )


def _aside(drift: sp.Expr, turn: sp.Expr, scale: sp.Expr) -> sp.Expr:
    """What a mirrored ray is aside where it meets the next surface: the old point's drift, in the new unit, and twice
    its turn for each unit of the way. Three quarters of that is what was seen at most."""
    return sp.Rational(3, 4) * (drift * scale + 2 * turn * S("travelled"))


def _tiles(blur: sp.Expr, _: bool) -> tuple[Definition, ...]:
    across = vector("across").dot(vector("p")) + S("across_0")
    along = vector("along").dot(vector("p")) + S("along_0")
    half = sp.Rational(1, 2)
    inner = sp.Max(sp.Abs(across - S("tile_u") - half), sp.Abs(along - S("tile_v") - half))
    return (
        Definition("from_middle", inner, _SECTION, "from the middle of the tile, 1/2 at its edge"),
        Definition("margin", half - S("from_middle") - S("keen") * blur, _SECTION, "not above 0: in doubt"),
    )


_MARGINS = {
    "span": _sphere,
    "near": _sphere,
    "shadow": _shadow,
    "gate": _gate,
    "echo": _echo,
    "arrival": _arrival,
    "plane": _plane,
    "echo_plane": _echo_plane,
    "landing": _landing,
    "tiles": _tiles,
}
