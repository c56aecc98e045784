"""What a form is, and what it claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import sympy as sp

from symrender_cg.derive.program import Definition, ImageProgram


@dataclass(frozen=True, slots=True)
class Claim:
    """left = right: a new quantity and what it equals in the textbook's derivation.

    given    textbook quantities in new ones, by an earlier claim or by definition; they are not expanded
    keep     new quantities that the proof need not look into
    facts    what kept symbols are, used last
    squares  symbols with a known square
    """

    left: sp.Expr
    right: sp.Expr
    given: Mapping[str, sp.Expr] = field(default_factory=dict)
    keep: tuple[str, ...] = ()
    facts: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)
    squares: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Form:
    """A set of definitions that replace those of the same name.

    `off_axis` and `front_test` say which plans the form is for (None: either); `brings` which quantities of the
    derivation it is for, so that it is passed over where the plan left them out. `guard` renames the guarded
    quantities. `ends` names the two ends of a row's span of hits, where the form has them.
    """

    name: str
    definitions: Callable[[ImageProgram], tuple[Definition, ...]]
    removes: str
    source: str
    claims: Callable[[], tuple[Claim, ...]]
    off_axis: bool | None = None
    front_test: bool | None = None
    brings: tuple[str, ...] = ()
    guard: tuple[tuple[str, str], ...] = ()
    ends: tuple[str, str] | None = None

    def fits(self, program: ImageProgram, *, off_axis: bool, front_test: bool) -> bool:
        """Whether the form is for such a plan and such a program."""
        return (
            self.off_axis in (None, off_axis)
            and self.front_test in (None, front_test)
            and all(name in program for name in self.brings)
        )
