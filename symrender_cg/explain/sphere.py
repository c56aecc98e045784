"""What the kernel of one sphere rests on: plan, derivation, chosen forms, proved invariants, silhouette, operations.

Comes in: its translation. Goes out: Explanation, frozen, of text and numbers: formulas as text and as LaTeX.
Never done here: printing, compiling, or a formula that is not the derivation's own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import isqrt
from typing import TYPE_CHECKING

import sympy as sp

from symrender_cg.derive import forms
from symrender_cg.derive.exact import sign_tests
from symrender_cg.derive.proofs import Invariant, prove_invariants
from symrender_cg.derive.symbols import INPUTS, symbol
from symrender_cg.explain.operations import by_format, swollen_operations
from symrender_cg.explain.quantities import Quantity, latex_symbols, quantity
from symrender_cg.plan.plan import Decision
from symrender_cg.run.numbers import numbers_of

if TYPE_CHECKING:
    from symrender_cg.pipeline import SphereTranslation

CENTRED = "x^2 + y^2 = e^2 R^2 / (e^2 - R^2)"


@dataclass(frozen=True, slots=True)
class ChosenForm:
    """A form that the accuracy uses: its name, what it removes, its source."""

    name: str
    removes: str
    source: str


@dataclass(frozen=True, slots=True)
class Silhouette:
    """disc = 0 as a conic a x^2 + b x y + c y^2 + d x + e y + f = 0 in the scene's numbers.

    kind is decided exactly. rho is the radius of the circle for a centred sphere, else None.
    """

    equation: str
    coefficients: tuple[float, ...]
    kind: str
    rho: float | None


@dataclass(frozen=True, slots=True)
class Step:
    """A stage or a pass: seconds, operations before and after it (None where it has none)."""

    name: str
    seconds: float
    before: int | None
    after: int | None


@dataclass(frozen=True, slots=True)
class Explanation:
    """All of it.

    formats      the number formats of the kernel, each with the quantities in it
    operations   of the kernel by rate (frame, row, pixel) and kind
    """

    kernel: str
    accuracy: str
    promise: str
    decisions: tuple[Decision, ...]
    inputs: tuple[tuple[str, str, str, float], ...]
    textbook: tuple[Quantity, ...]
    guard: tuple[str, ...]
    forms: tuple[ChosenForm, ...]
    chosen: tuple[Quantity, ...]
    formats: tuple[tuple[str, tuple[str, ...]], ...]
    invariants: tuple[Invariant, ...]
    silhouette: Silhouette
    stages: tuple[Step, ...]
    passes: tuple[Step, ...]
    operations: dict[str, dict[str, int]]


def explain_sphere(translation: SphereTranslation) -> Explanation:
    """The explanation of the kernel of one sphere; its numbers are those of the plan's scene."""
    plan, variant, image = translation.plan, translation.variant, translation.image
    numbers = numbers_of(plan.scene)
    first = translation.passes[0].program
    named = [(d.name, d.value) for d in image.definitions]
    names = latex_symbols([*named, *((step.name, step.value) for step in first.steps)])
    textbook = tuple(quantity(d.name, d.value, d.meaning, d.source, d.section, names) for d in image.definitions)
    own = {(definition.name, definition.value) for definition in image.definitions}
    used = (forms.form(name) for name in variant.forms)
    fitting = [
        entry
        for entry in used
        if entry.fits(image, off_axis=plan.needs("off_axis"), front_test=plan.needs("front_test"))
    ]
    return Explanation(
        kernel=translation.emitted.name,
        accuracy=variant.name,
        promise=variant.promise,
        decisions=plan.decisions if plan.scene is plan.given else plan.summary,
        inputs=tuple(
            (row.name, row.latex, row.meaning, numbers[row.name])
            for row in INPUTS
            if row.name in translation.emitted.inputs
        ),
        textbook=textbook,
        guard=image.guard,
        forms=tuple(ChosenForm(entry.name, entry.removes, entry.source) for entry in fitting),
        chosen=_by_section(
            quantity(s.name, s.value, s.meaning, s.source, s.section, names)
            for s in first.steps
            if (s.name, s.value) not in own
        ),
        formats=by_format(translation.program),
        invariants=prove_invariants(image),
        silhouette=_silhouette(translation, numbers),
        stages=_stages(translation),
        passes=_passes(translation),
        operations={rate: dict(sorted(counts.items())) for rate, counts in translation.emitted.operations.items()},
    )


def _by_section(quantities: Iterable[Quantity]) -> tuple[Quantity, ...]:
    """The quantities of one section together, sections in the order in which they begin."""
    groups: dict[str, list[Quantity]] = {}
    for entry in quantities:
        groups.setdefault(entry.section, []).append(entry)
    return tuple(entry for group in groups.values() for entry in group)


def _silhouette(translation: SphereTranslation, numbers: dict[str, float]) -> Silhouette:
    """The conic of the exact test of disc, its coefficients in exact rationals, rounded once for display."""
    test = sign_tests(translation.image)[0]
    powers = ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1), (0, 0))
    sums = dict.fromkeys(powers, Fraction(0))
    for monomial in test.monomials:
        term = Fraction(monomial.coefficient)
        for factor in monomial.factors:
            if factor not in ("x", "y"):
                term *= Fraction(numbers[factor])
        sums[monomial.factors.count("x"), monomial.factors.count("y")] += term
    a, b, c, d, e, f = (sums[power] for power in powers)
    bend = b * b - 4 * a * c
    kind = "hyperbola" if bend > 0 else "parabola" if bend == 0 else "circle" if b == 0 and a == c else "ellipse"
    centred = b == d == e == 0 and a == c and not translation.plan.needs("off_axis")
    return Silhouette(
        equation=f"{sp.collect(sp.expand(translation.image.closed('disc')), (symbol('x'), symbol('y')))} = 0",
        coefficients=tuple(_rounded(value) for value in (a, b, c, d, e, f)),
        kind=kind,
        rho=_root(-f / a) if centred else None,
    )


def _root(square: Fraction) -> float:
    """sqrt of a positive rational, to 200 bits and then rounded."""
    shift = 200 + square.denominator.bit_length()
    return float(Fraction(isqrt((square.numerator << (2 * shift)) // square.denominator), 1 << shift))


def _rounded(value: Fraction) -> float:
    """The float64 nearest to a rational; an infinity where it is too large for one."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def _stages(translation: SphereTranslation) -> tuple[Step, ...]:
    seconds = translation.seconds
    named, kernel = translation.image.operations(), sum(translation.program.operations().values())
    closed = swollen_operations(translation.image)["image"]
    return (
        Step("plan", seconds["plan"], None, None),
        Step("derive", seconds["derive"], closed, named),
        Step("lower", seconds["lower"], named, kernel),
        Step("emit", seconds["emit"], None, None),
    )


def _passes(translation: SphereTranslation) -> tuple[Step, ...]:
    steps = []
    before = translation.image.operations()
    for stage in translation.passes:
        after = sum(stage.operations.values())
        steps.append(Step(stage.name, stage.seconds, before, after))
        before = after
    return tuple(steps)
