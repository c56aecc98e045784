"""Named quantities of a derivation with their formulas as text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from symrender_cg.derive.symbols import latex_names, symbol


@dataclass(frozen=True, slots=True)
class Quantity:
    """One named quantity: its formula as text and as LaTeX, what it means, its source, the section it stands in."""

    name: str
    formula: str
    latex_name: str
    latex: str
    meaning: str
    source: str
    section: str


def quantity(
    name: str, value: sp.Basic, meaning: str, source: str, section: str, names: dict[sp.Symbol, str]
) -> Quantity:
    """A definition as it is shown; `names` are those of latex_symbols."""
    shown = names[symbol(name)]
    return Quantity(name, str(value), shown, sp.latex(value, symbol_names=names), meaning, source, section)


def latex_symbols(named: Iterable[tuple[str, sp.Basic]]) -> dict[sp.Symbol, str]:
    """How every symbol of some definitions is set; a word is set upright, not as a product."""
    found: set[sp.Symbol] = set()
    for name, value in named:
        found |= {symbol(name), *value.free_symbols}
    return {s: _latex_of(s.name) for s in sorted(found, key=str)} | latex_names()


def _latex_of(name: str) -> str:
    head, _, rest = name.partition("_")
    shown = head if len(head) == 1 else rf"\mathrm{{{head}}}"
    return shown if not rest else shown + rf"_{{\mathrm{{{rest.replace('_', ' ')}}}}}".replace(" ", r"\,")
