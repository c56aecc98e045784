"""The registry of forms: algebraically equal ways to compute the named quantities of the derivation.

A form states the definitions that it brings, the scenes it is for, what it removes, and its claims: what each new
quantity equals in the textbook's derivation. `proofs.prove_form` shows every claim's difference to be 0; the tests run
it over the whole registry. Adding a form is adding one entry in one of the modules of this package.

The forms below measure lengths of the scene in radii and write f for the distance of the image plane from the eye,
which is e: rays may be scaled apart from the scene, as only their direction counts.
"""

from __future__ import annotations

from collections.abc import Callable

from symrender_cg.derive.forms import discriminant, highlight, inner_products, light, normal, silhouette
from symrender_cg.derive.forms.form import Claim, Form
from symrender_cg.derive.forms.light import CosinePower
from symrender_cg.derive.program import Definition, ImageProgram

__all__ = ["FORMS", "Claim", "CosinePower", "Form", "apply", "form"]

FORMS: tuple[Form, ...] = (
    *discriminant.FORMS,
    *silhouette.FORMS,
    *normal.FORMS,
    *highlight.FORMS,
    *light.FORMS,
    *inner_products.FORMS,
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
