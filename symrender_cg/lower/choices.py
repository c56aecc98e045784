"""Choices beside the levels: a variant with one of its coordinates put to another value.

Comes in: a Variant. Goes out: another one, or None where the move is not for it. Such a variant promises nothing: it is
measured. Never done here: a measurement, a search.

    coordinate   moves
    powers       coarse, fast, own (power.h), libm: the functions of the highlight's power
    outline      unsettled: hit or miss in floating point alone, every pixel tested
    rows         tested: hit or miss settled, but no span is filled without a test
    rays         narrow: where the ray meets the surface also in float32 (needs an unsettled outline)
    formula      seed, lagrange: the seed's formula, or the textbook's with the discriminant as a cross product
    highlight    complement: sin^2 as 1 - cos^2; side: as a cross product; inner: n.l and r.v from two inner products
    contraction  fused: the compiler may make one rounding of a * b + c
    passes       whole: a pixel's steps in one loop; lopsided: nothing is shared by the pixels at x and -x

Moves of different coordinates may follow one another; a variant's name tells its level and its moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

from symrender_cg.lower.variants import INNER_FORMS, VARIANTS, Variant

UNSTATED: Final = "none: a choice that was measured, see symrender_cg cost"

Move = Callable[[Variant], "Variant | None"]


@dataclass(frozen=True, slots=True)
class Choice:
    """One value of one coordinate.

    does    what it changes, in words
    move    the variant with it, or None where it changes nothing or is not for that variant
    alone   only kernels of one sphere have it
    """

    coordinate: str
    name: str
    does: str
    move: Move
    alone: bool = True


def _powers(name: str) -> Move:
    def move(given: Variant) -> Variant | None:
        single = given.shading == "float32"
        functions = {"own": "", "libm": "libmf" if single else "libm"}.get(name, name)
        if given.settles or functions == given.functions or (name in ("coarse", "fast") and not single):
            return None
        return replace(given, functions=functions)

    return move


def _unsettled(given: Variant) -> Variant | None:
    """Span forms in one float64 number, compared with 0."""
    if given.settles or not given.exact:
        return None
    return replace(given, exact=False, fills=False, double_double=frozenset(), per_pixel_exact=frozenset())


def _tested(given: Variant) -> Variant | None:
    if given.settles or not given.exact or not given.fills:
        return None
    return replace(given, fills=False, per_pixel_exact=frozenset())


def _narrow(given: Variant) -> Variant | None:
    """float32 from the pixel's coordinates on; the unscaled numbers of the scene are rounded to it."""
    if given.shading != "float32" or not given.float64:
        return None
    plain = _unsettled(given) or given
    return replace(plain, float64=frozenset())


def _formula(forms: tuple[str, ...]) -> Move:
    def move(given: Variant) -> Variant | None:
        if given.settles or given.forms == forms:
            return None
        plain = _unsettled(given) or given
        return replace(plain, forms=forms, float64=frozenset(), fills=True)

    return move


def _complement(given: Variant) -> Variant | None:
    if given.settles or "mirrored_ray" not in given.forms or "complement" in given.forms:
        return None
    return replace(given, forms=(*given.forms, "complement"))


def _side(given: Variant) -> Variant | None:
    if given.settles or "complement" not in given.forms or "inner_products" in given.forms:
        return None
    return replace(given, forms=tuple(form for form in given.forms if form != "complement"))


def _inner(given: Variant) -> Variant | None:
    if given.settles or "mirrored_ray" not in given.forms or "inner_products" in given.forms:
        return None
    return replace(given, forms=(*INNER_FORMS, *(form for form in given.forms if form == "middle_facing")))


def _fused(given: Variant) -> Variant | None:
    return None if given.settles or given.contracts else replace(given, contracts=True)


def _passes(**switches: bool) -> Move:
    def move(given: Variant) -> Variant | None:
        return replace(given, passes=replace(given.passes, **switches)) if given.staged else None

    return move


CHOICES: Final[tuple[Choice, ...]] = (
    Choice("powers", "coarse", "powers by polynomials of degree 2 and 1", _powers("coarse"), alone=False),
    Choice("powers", "fast", "powers by polynomials of degree 3 and 2", _powers("fast"), alone=False),
    Choice("powers", "own", "powers good to the last place", _powers("own"), alone=False),
    Choice("powers", "libm", "powers by the C library's pow", _powers("libm"), alone=False),
    Choice("outline", "unsettled", "hit or miss by one comparison in floating point", _unsettled),
    Choice("rows", "tested", "every pixel tested, none filled", _tested),
    Choice("rays", "narrow", "rays and outline in float32 too", _narrow),
    Choice("formula", "seed", "the seed's formula as it stands", _formula(("seed_disc", "quadratic_disc"))),
    Choice("formula", "lagrange", "the textbook's formula, disc as a cross product", _formula(())),
    Choice("highlight", "complement", "sin^2 as 1 - cos^2", _complement, alone=False),
    Choice("highlight", "side", "sin^2 as a cross product", _side, alone=False),
    Choice("highlight", "inner", "the light's terms from two inner products", _inner),
    Choice("contraction", "fused", "-ffp-contract=fast: a * b + c in one rounding", _fused, alone=False),
    Choice("passes", "whole", "a pixel's steps in one loop, not in short ones", _passes(fission=False, halves=False)),
    Choice("passes", "lopsided", "nothing shared by the pixels at x and -x", _passes(symmetry=False)),
)


def chosen(level: str, *names: str) -> Variant | None:
    """A level with these choices made in turn: `double` with `unsettled` and `fused` is `double_unsettled_fused`.

    None where a level or a choice is not known, or a choice is not for the variant that it meets.
    """
    found = next((entry for entry in VARIANTS if entry.name == level), None)
    for name in names:
        entry = next((entry for entry in CHOICES if entry.name == name), None)
        found = None if found is None or entry is None else entry.move(found)
    if found is None or not names:
        return found
    return replace(found, name="_".join((level, *names)), promise=UNSTATED)


@lru_cache(maxsize=256)
def named(name: str) -> Variant | None:
    """The variant of a name that `chosen` gave; None for another name."""
    return chosen(*name.split("_"))
