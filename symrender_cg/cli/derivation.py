"""What the explanations of both kinds of kernels share: decisions and named quantities, as text and as JSON's data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from symrender_cg.cli.console import Column, Table
from symrender_cg.explain import Quantity
from symrender_cg.plan.effects import Finding
from symrender_cg.plan.plan import Decision

WORDS = {"needed": "in", "absent": "out", "bounded": "bounded"}
"""What is printed for the status of an effect or a finding."""


def head(text: str) -> None:
    """A headline, underlined."""
    print(f"\n{text}\n{'-' * len(text)}")


def print_decisions(decisions: Sequence[Decision]) -> None:
    """The one table of the plan: in, out or bounded; why, with the tightest margin; what is left out."""
    bounds = any(decision.bound is not None for decision in decisions)
    extra = (Column("changes at most", right=True),) if bounds else ()
    table = Table(
        (Column(""), Column("effect"), Column("what it is"), Column("margin", right=True), *extra, Column("why"))
    )
    for decision in decisions:
        effect = decision.effect
        why = decision.reason if decision.needed else f"{decision.reason}. Leaves out: {effect.removes}"
        more = (number(decision.bound),) if bounds else ()
        table.add(WORDS[decision.status], effect.name, effect.title, number(decision.margin), *more, why)
    table.show()


def print_findings(findings: Sequence[Finding]) -> None:
    """One line a subject: a sphere, a pair or a triple."""
    bounds = any(finding.bound is not None for finding in findings)
    extra = (Column("changes at most", right=True),) if bounds else ()
    table = Table((Column(""), Column("subject"), Column("margin", right=True), *extra, Column("why")))
    for finding in findings:
        more = (number(finding.bound),) if bounds else ()
        table.add(WORDS[finding.status], finding.subject, number(finding.margin), *more, finding.reason)
    table.show()


def number(value: float | None) -> str:
    """Three digits, or nothing where there is no number."""
    return "" if value is None else f"{value:.3g}"


def decision_data(decision: Decision) -> dict[str, Any]:
    """A decision as what JSON holds."""
    return {
        "effect": decision.effect.name,
        "title": decision.effect.title,
        "status": decision.status,
        "reason": decision.reason,
        "margin": decision.margin,
        "bound": decision.bound,
        "condition": decision.effect.condition,
        "source": decision.effect.source,
        "leaves_out": None if decision.needed else decision.effect.removes,
    }


def finding_data(finding: Finding) -> dict[str, Any]:
    """A finding as what JSON holds."""
    return {
        "subject": finding.subject,
        "status": finding.status,
        "reason": finding.reason,
        "margin": finding.margin,
        "bound": finding.bound,
    }


def quantity_data(quantity: Quantity) -> dict[str, str]:
    """A named quantity as what JSON holds."""
    return {
        "name": quantity.name,
        "formula": quantity.formula,
        "latex": f"{quantity.latex_name} = {quantity.latex}",
        "meaning": quantity.meaning,
        "source": quantity.source,
        "section": quantity.section,
    }


def sections(quantities: tuple[Quantity, ...]) -> Iterator[tuple[str, list[Quantity]]]:
    """Neighbours of one section together."""
    group: list[Quantity] = []
    for quantity in quantities:
        if group and quantity.section != group[-1].section:
            yield group[0].section, group
            group = []
        group.append(quantity)
    if group:
        yield group[0].section, group


def print_quantities(quantities: tuple[Quantity, ...]) -> None:
    """Formulas by section, each with its meaning and source below it."""
    width = max((len(q.name) for q in quantities), default=0)
    for section, group in sections(quantities):
        print(f"  {section}")
        for quantity in group:
            print(f"    {quantity.name:{width}} = {quantity.formula}")
            said = ". ".join(filter(None, (quantity.meaning, quantity.source)))
            if said:
                print(f"    {'':{width}}   {said}")
        print()
