"""Proofs: differences that sympy shows to be 0.

A claim says that a new quantity equals a textbook one. Both are substituted down to what the claim keeps, the
numerator of their difference is taken, and symbols with a known square (roots, the normal's last component) are
reduced, the youngest first. What is left is a polynomial: it is 0, or the claim is false. Nothing is tried numerically
and nothing is guessed.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from symrender_cg.derive.forms import FORMS, Claim, Form, apply
from symrender_cg.derive.program import ImageProgram
from symrender_cg.derive.symbols import symbol, symbols


@dataclass(frozen=True, slots=True)
class Proof:
    """A claim of a form: left side = right side, and what was left of the difference (0 where it holds)."""

    claim: str
    holds: bool
    residue: sp.Expr


@dataclass(frozen=True, slots=True)
class Invariant:
    """A statement about the derivation that sympy proved, or could not."""

    name: str
    statement: str
    holds: bool
    detail: str = ""


def _reduced(numerator: sp.Expr, root: sp.Symbol, square: sp.Expr) -> sp.Expr:
    """The numerator as even + root odd, even powers of the root replaced; free of it where the odd part vanishes."""
    if not numerator.has(root):
        return numerator
    even, odd = sp.Integer(0), sp.Integer(0)
    for (power,), coefficient in sp.Poly(numerator, root).terms():
        term = coefficient * square ** (power // 2)
        even, odd = (even, odd + term) if power % 2 else (even + term, odd)
    even, odd = (sp.fraction(sp.together(part))[0] for part in (even, odd))
    return sp.expand(even) if sp.expand(odd) == 0 else sp.expand(even) ** 2 + sp.expand(odd) ** 2


def prove_form(form: Form, image: ImageProgram) -> tuple[Proof, ...]:
    """Every claim of a form that speaks of quantities of this plan, against the textbook's derivation of it."""
    program = apply(image, (*_companions(form, image), form), keep_all=True)
    proofs = []
    for claim in form.claims():
        if all(s.name in image or s.name in image.inputs for s in claim.right.free_symbols):
            rest = residue(claim, program, image)
            proofs.append(Proof(f"{claim.left} = textbook {claim.right}", rest == 0, rest))
    return tuple(proofs)


def residue(claim: Claim, program: ImageProgram, image: ImageProgram) -> sp.Expr:
    """A claim's left side, in the form's program, less its right side, in the textbook's: 0 if it holds."""
    new, roots = _substituted(claim.left, program, claim.keep)
    old, old_roots = _substituted(claim.right, image, tuple(claim.given))
    given = {symbol(name): value for name, value in claim.given.items()}
    roots |= {root: square.xreplace(given) for root, square in old_roots.items()}
    difference = (new - old.xreplace(given)).xreplace({symbol("focal"): symbol("eye")}).xreplace(dict(claim.facts))
    centre = {symbol(f"center_{axis}"): sp.Integer(0) for axis in "xyz" if f"center_{axis}" not in image.inputs}
    numerator = sp.fraction(sp.together(difference.xreplace(centre)))[0]
    for root, square in (*roots.items(), *claim.squares.items()):
        numerator = _reduced(sp.expand(numerator), root, square.xreplace({symbol("focal"): symbol("eye")}))
    return sp.expand(numerator)


def _substituted(
    value: sp.Expr, program: ImageProgram, keep: tuple[str, ...]
) -> tuple[sp.Expr, dict[sp.Symbol, sp.Expr]]:
    """A value in inputs and kept names; definitions that are square roots stay symbols, their squares go along."""
    squares: dict[sp.Symbol, sp.Expr] = {}
    for definition in reversed(program.definitions):
        name = definition.symbol
        if definition.name in keep:
            continue
        if isinstance(definition.value, sp.Pow) and definition.value.exp == sp.Rational(1, 2):
            if value.has(name) or any(square.has(name) for square in squares.values()):
                squares[name] = definition.value.base
            continue
        change = {name: definition.value}
        value = value.xreplace(change)
        squares = {root: square.xreplace(change) for root, square in squares.items()}
    return value, squares


def _companions(form: Form, image: ImageProgram) -> tuple[Form, ...]:
    """The forms whose quantities a form builds upon, for this plan."""
    if "disc" in {definition.name for definition in form.definitions(image)}:
        return ()
    front_test, off_axis = "m_dot_d" in image.guard, "center_x" in image.inputs
    return tuple(
        entry
        for entry in FORMS
        if entry.name != form.name
        and entry.name not in ("seed_disc", "quadratic_disc")
        and entry.fits(image, off_axis=off_axis, front_test=front_test)
    )


def prove_invariants(image: ImageProgram) -> tuple[Invariant, ...]:
    """What the seed calls the gifts of the symbolic route, proved on the textbook's derivation of a plan."""
    x, y, eye, radius = symbols("x y eye radius")
    center = [symbol(f"center_{axis}") if f"center_{axis}" in image.inputs else sp.Integer(0) for axis in "xyz"]
    root, t = sp.Symbol("root", nonnegative=True), sp.Symbol("t", real=True)
    ray = sp.Matrix([x, y, -eye])
    found: list[Invariant] = []

    disc = image.closed("disc")
    m = sp.Matrix([center[0], center[1], center[2] - eye])
    t_hit = (m.dot(ray) - root) / ray.dot(ray)
    offset = t_hit * ray - m
    length = sp.fraction(sp.together(offset.dot(offset) - radius**2))[0]
    length = _reduced(sp.expand(length), root, disc)
    found.append(
        Invariant("hit point", "|P - C| = R: the normal (P - C) / R has length 1, without a square root", length == 0)
    )

    view = (sp.Matrix([0, 0, eye]) - (sp.Matrix([0, 0, eye]) + t * ray)) - (-t * ray)
    found.append(
        Invariant(
            "view direction",
            "E - P = -t D: v = -D / |D| needs no hit point",
            all(sp.expand(component) == 0 for component in view),
        )
    )

    facing = sp.together(offset.dot(-ray) / radius - root / radius)
    found.append(
        Invariant("facing", "n.v = root / (R |D|)", sp.expand(sp.fraction(facing)[0].subs(root**2, disc)) == 0)
    )

    conic = sp.Poly(sp.expand(disc), x, y)
    found.append(
        Invariant(
            "silhouette",
            "the outline disc = 0 is a conic in x and y",
            conic.total_degree() <= 2,
            f"{sp.collect(sp.expand(disc), (x, y))} = 0",
        )
    )
    if all(c == 0 for c in center):
        s = sp.Symbol("s", nonnegative=True)
        rho2 = sp.solve(sp.expand(disc).subs(x**2, s - y**2).expand(), s)[0]
        circle = sp.simplify(rho2 - eye**2 * radius**2 / (eye**2 - radius**2)) == 0
        found.append(
            Invariant(
                "silhouette circle", "x^2 + y^2 = rho^2 = e^2 R^2 / (e^2 - R^2)", circle, f"rho^2 = {sp.factor(rho2)}"
            )
        )
    return tuple(found)
