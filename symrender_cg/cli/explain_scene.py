"""The explanation of the kernel of a scene as text and as JSON's data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from symrender_cg.cli.console import Column, Table, duration
from symrender_cg.cli.derivation import decision_data, head, print_decisions, print_quantities, quantity_data
from symrender_cg.cli.proof import print_formats
from symrender_cg.explain import PartExplanation, SceneExplanation
from symrender_cg.lower.program import RATES


def as_data(found: SceneExplanation) -> dict[str, Any]:
    """The explanation as what JSON holds."""

    def part(entry: PartExplanation) -> dict[str, Any]:
        return {
            "name": entry.name,
            "meaning": entry.meaning,
            "inputs": [{"name": name, "rate": dict(entry.rates).get(name, "sphere")} for name in entry.inputs],
            "results": list(entry.results),
            "quantities": [quantity_data(q) for q in entry.quantities],
            "operations": entry.operations,
            "formats": {form: list(names) for form, names in entry.formats},
            "swell": asdict(entry.swell),
        }

    return {
        "kind": "scene",
        "kernel": found.kernel,
        "accuracy": found.accuracy,
        "promise": found.promise,
        "aspect": found.aspect,
        "max_error": found.max_error,
        "bound": found.bound,
        "flags": list(found.flags),
        "plan": [decision_data(d) for d in found.decisions],
        "counts": dict(found.counts),
        "parts": [part(entry) for entry in found.parts],
        "seconds": found.seconds,
        "operations": found.operations,
    }


def show(found: SceneExplanation) -> None:
    """Prints it as text."""
    print(f'{found.kernel}: accuracy "{found.accuracy}", promise: {found.promise}')
    where = (
        "any point of the image plane" if found.aspect is None else f"an image of width over height {found.aspect:.4g}"
    )
    allowed = f", within {found.max_error:g} of each pixel" if found.max_error else ""
    head(f"plan: which effects can change this image ({where}{allowed})")
    print_decisions(found.decisions)
    if found.max_error:
        print(f"\nall that is left out within the tolerance changes no pixel by more than {found.bound:.3g}")

    head("what the kernel loops over")
    for what, count in found.counts:
        print(f"  {count:8}  {what}")

    head("the parts of the derivation")
    for entry in found.parts:
        print(f"{entry.name}: {entry.meaning}")
        print(f"  takes {', '.join(entry.inputs) or 'nothing'}")
        print(f"  gives {', '.join(entry.results)}\n")
        print_quantities(entry.quantities)

    head("number formats of the kernel's quantities")
    print_formats(_formats(found))

    head("operations")
    table = Table(
        (
            Column("part"),
            Column("one formula", right=True),
            Column("named", right=True),
            *(Column(f"a {rate}", right=True) for rate in RATES),
            Column("a pixel"),
        )
    )
    for entry in found.parts:
        totals = [sum(entry.operations.get(rate, {}).values()) for rate in RATES]
        kinds = ", ".join(f"{count} {kind}" for kind, count in entry.operations.get("pixel", {}).items())
        numbers = (str(entry.swell.closed), str(entry.swell.named), *(str(total) if total else "" for total in totals))
        table.add(entry.name, *numbers, kinds)
    table.show()
    print("\n" + ", ".join(f"{stage} {duration(spent)}" for stage, spent in found.seconds.items()))


def _formats(found: SceneExplanation) -> list[tuple[str, tuple[str, ...]]]:
    """The number formats of all parts, each with the quantities that are in it in any part."""
    merged: dict[str, dict[str, None]] = {}
    for part in found.parts:
        for form, names in part.formats:
            merged.setdefault(form, {}).update(dict.fromkeys(names))
    return [(form, tuple(names)) for form, names in merged.items()]
