"""The explanation of the kernel of one sphere as text and as JSON's data."""

from __future__ import annotations

import math
from typing import Any

from symrender_cg.cli.console import Column, Table, duration
from symrender_cg.cli.derivation import decision_data, head, print_decisions, print_quantities, quantity_data
from symrender_cg.cli.proof import print_formats
from symrender_cg.explain import CENTRED, Explanation


def as_data(found: Explanation) -> dict[str, Any]:
    """The explanation as what JSON holds; numbers beyond float64 become null."""

    def steps(entries: tuple[Any, ...]) -> list[dict[str, Any]]:
        return [{"name": s.name, "seconds": s.seconds, "before": s.before, "after": s.after} for s in entries]

    silhouette = found.silhouette
    return {
        "kind": "sphere",
        "kernel": found.kernel,
        "accuracy": found.accuracy,
        "promise": found.promise,
        "plan": [decision_data(d) for d in found.decisions],
        "inputs": [
            {"name": name, "latex": latex, "meaning": text, "value": v} for name, latex, text, v in found.inputs
        ],
        "textbook": [quantity_data(q) for q in found.textbook],
        "hit_where": [condition(name) for name in found.guard],
        "forms": [{"name": f.name, "removes": f.removes, "source": f.source} for f in found.forms],
        "chosen": [quantity_data(q) for q in found.chosen],
        "formats": {form: list(names) for form, names in found.formats},
        "invariants": [
            {"name": i.name, "statement": i.statement, "holds": i.holds, "detail": i.detail} for i in found.invariants
        ],
        "silhouette": {
            "equation": silhouette.equation,
            "coefficients": {
                power: value if math.isfinite(value) else None
                for power, value in zip(("x2", "xy", "y2", "x", "y", "1"), silhouette.coefficients, strict=True)
            },
            "kind": silhouette.kind,
            "rho": silhouette.rho,
        },
        "stages": steps(found.stages),
        "passes": steps(found.passes),
        "operations": found.operations,
    }


def condition(name: str) -> str:
    """The condition on a guarded quantity, as text."""
    return f"{name} >= 0" if name == "disc" else f"{name} > 0"


def show(found: Explanation) -> None:
    """Prints it as text."""
    print(f'{found.kernel}: accuracy "{found.accuracy}", promise: {found.promise}')
    head("plan: which effects can change this image")
    print_decisions(found.decisions)

    head("inputs, in the camera's frame")
    table = Table((Column("name"), Column("value", right=True), Column("meaning")))
    for name, _, meaning, value in found.inputs:
        table.add(name, f"{value:.17g}", meaning)
    table.show()

    head("the textbook's derivation")
    print_quantities(found.textbook)
    print(
        f"the ray hits where {' and '.join(condition(name) for name in found.guard)}; elsewhere the background is seen"
    )

    head(f'the forms that "{found.accuracy}" uses in place of the textbook\'s')
    table = Table((Column("form"), Column("removes"), Column("source")))
    for entry in found.forms:
        table.add(entry.name, entry.removes, entry.source)
    table.show()
    print()
    print_quantities(found.chosen)

    head("number formats of the kernel's quantities")
    print_formats(found.formats)

    head("proved by sympy, exactly")
    for invariant in found.invariants:
        print(f"  {'proved' if invariant.holds else 'NOT PROVED':7} {invariant.name}: {invariant.statement}")
        if invariant.detail:
            print(f"          {invariant.detail}")

    head("silhouette")
    silhouette = found.silhouette
    print(f"  {silhouette.equation}")
    print(f"  here: {_conic(silhouette.coefficients)} = 0: {silhouette.kind}")
    if silhouette.rho is not None:
        print(f"  {CENTRED} = rho^2, rho = {silhouette.rho!r}")

    head("operations")
    table = Table(
        (Column("stage"), Column("time", right=True), Column("before", right=True), Column("after", right=True))
    )
    for step in found.stages:
        table.add(step.name, duration(step.seconds), *("" if n is None else str(n) for n in (step.before, step.after)))
        if step.name == "lower":
            for inner in found.passes:
                table.add(f"  {inner.name}", duration(inner.seconds), str(inner.before), str(inner.after))
    table.show()
    print()
    for rate, counts in found.operations.items():
        text = ", ".join(f"{count} {kind}" for kind, count in counts.items())
        print(f"  a {rate:5}  {text or 'none'}")


def _conic(coefficients: tuple[float, ...]) -> str:
    parts: list[str] = []
    for value, power in zip(coefficients, ("x^2", "x y", "y^2", "x", "y", ""), strict=True):
        if value != 0.0:
            sign = ("- " if value < 0 else "+ ") if parts else ("-" if value < 0 else "")
            parts.append(f"{sign}{abs(value):.10g} {power}".rstrip())
    return " ".join(parts)
