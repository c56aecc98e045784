"""`ImageProgram`: the image as an ordered list of named definitions, and the closed form recovered from it.

The swollen expression is never stored: it is the substitution of the definitions into one another, made on demand
for display and for proofs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import sympy as sp

from symrender_cg.derive.symbols import symbol


@dataclass(frozen=True, slots=True)
class Definition:
    """name = value: one step of the derivation, with the formula in words and its source."""

    name: str
    value: sp.Expr
    section: str
    meaning: str = ""
    source: str = ""

    @property
    def symbol(self) -> sp.Symbol:
        """The symbol that later definitions use for this one."""
        return symbol(self.name)


@dataclass(frozen=True, slots=True)
class ImageProgram:
    """I(x, y) = value where guard holds, else background.

    Each definition uses inputs and earlier definitions only. `guard` is a tuple of names: the ray hits where the
    discriminant `disc` is not negative and every other named quantity is positive.
    """

    name: str
    definitions: tuple[Definition, ...]
    guard: tuple[str, ...]
    value: str = "value"
    background: str = "background"

    def __post_init__(self) -> None:
        known: set[str] = set()
        for definition in self.definitions:
            assert definition.name not in known, f"{definition.name} is defined twice"
            known.add(definition.name)
        later = set(known)
        for definition in self.definitions:
            ahead = {s.name for s in definition.value.free_symbols} & later
            assert not ahead, f"{definition.name} uses {sorted(ahead)} before their definition"
            later.discard(definition.name)

    def __getitem__(self, name: str) -> Definition:
        for definition in self.definitions:
            if definition.name == name:
                return definition
        raise KeyError(name)

    def __contains__(self, name: object) -> bool:
        return any(definition.name == name for definition in self.definitions)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names that are used and not defined, in the order of the alphabet."""
        defined = {definition.name for definition in self.definitions}
        used = {s.name for definition in self.definitions for s in definition.value.free_symbols}
        return tuple(sorted((used | {self.background}) - defined))

    def closed(self, name: str, *, keep: tuple[str, ...] = ()) -> sp.Expr:
        """The named quantity with every definition substituted, except those in `keep`."""
        closed: dict[sp.Symbol, sp.Expr] = {}
        for definition in self.definitions:
            if definition.name == name:
                return definition.value.xreplace(closed)
            if definition.name not in keep:
                closed[definition.symbol] = definition.value.xreplace(closed)
        return symbol(name)

    def condition(self) -> sp.Basic:
        """The guard as a sympy condition in the inputs: disc >= 0 and every other guarded name > 0."""
        parts = [
            sp.Ge(self.closed(name), 0, evaluate=False)
            if name == "disc"
            else sp.Gt(self.closed(name), 0, evaluate=False)
            for name in self.guard
        ]
        return sp.And(*parts) if len(parts) > 1 else parts[0]

    def as_piecewise(self) -> sp.Piecewise:
        """The image as one expression: Piecewise((shading, hit), (background, True))."""
        return sp.Piecewise(
            (self.closed(self.value), self.condition()), (symbol(self.background), True), evaluate=False
        )

    def replacing(self, definitions: tuple[Definition, ...], *, keep: tuple[str, ...] = ()) -> ImageProgram:
        """The same program with other definitions, those that nothing uses and `keep` does not name left out."""
        needed = {self.value, *self.guard, *keep}
        kept: list[Definition] = []
        for definition in reversed(definitions):
            if definition.name in needed:
                kept.append(definition)
                needed |= {s.name for s in definition.value.free_symbols}
        return replace(self, definitions=tuple(reversed(kept)))

    def operations(self) -> int:
        """Operations of the definitions as they stand: sympy's count, each definition once."""
        return int(sum(sp.count_ops(definition.value) for definition in self.definitions))
