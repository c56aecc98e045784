"""`explain`: what a kernel rests on as text, as a LaTeX document, or as JSON; findings; what each effect costs."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from symrender_cg.cli import explain_scene, explain_sphere
from symrender_cg.cli.derivation import finding_data, print_findings
from symrender_cg.cli.proof import print_proof, print_steep
from symrender_cg.cli.requests import choice_data, show_choice
from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import variant
from symrender_cg.scene import Scene, load_scene

if TYPE_CHECKING:
    from symrender_cg.cost.choose import Choice


def run(arguments: argparse.Namespace) -> int:
    """Prints what is asked for in the form that is asked for."""
    scene = load_scene(arguments.scene)
    if arguments.latex and (arguments.ablate or arguments.findings):
        raise ArgumentError("--latex: findings and ablations are printed as text or as --json; leave --latex out")
    choice = _choice(scene, arguments)
    chosen = variant(arguments.accuracy, arguments.target)
    if arguments.ablate and chosen.settles:
        raise ArgumentError(
            "--ablate: what an effect costs is measured where one kernel draws alone, and accuracy "
            f"{arguments.accuracy} is drawn by stages; take fast, single, literal or double"
        )
    if arguments.ablate:
        return _ablate(scene, arguments)
    if arguments.findings:
        return _findings(scene, arguments)
    from symrender_cg.explain import Explanation, explain, proof_of, steep_highlight_of

    width, height = arguments.size
    found = explain(
        scene, arguments.accuracy, target=arguments.target, aspect=width / height, max_error=arguments.max_error
    )
    if arguments.latex:
        from symrender_cg.cli.latex import document

        print(document(found), end="")
        return 0
    proof = proof_of(scene, arguments.accuracy, arguments.target, width=width, height=height)
    steep = steep_highlight_of(scene, arguments.accuracy, width=width, height=height)
    if arguments.json:
        data = explain_sphere.as_data(found) if isinstance(found, Explanation) else explain_scene.as_data(found)
        rest = {name: None if part is None else asdict(part) for name, part in (("proof", proof), ("steep", steep))}
        _out(data | rest | _choice_data(choice))
        return 0
    if choice is not None:
        show_choice(choice)
        print()
    explain_sphere.show(found) if isinstance(found, Explanation) else explain_scene.show(found)
    if proof is not None:
        print_proof(proof)
    if steep is not None:
        print_steep(steep)
    return 0


def _choice(scene: Scene, arguments: argparse.Namespace) -> Choice | None:
    """What --meets chooses, put in the place of --accuracy and --target; None without it."""
    if arguments.meets is None:
        return None
    from symrender_cg.cost.choose import choose

    name, value = arguments.meets
    width, height = arguments.size
    found = choose(scene, aspect=width / height, **{name: value})
    arguments.accuracy, arguments.target = found.accuracy, found.target
    arguments.max_error = max(arguments.max_error, found.tolerance)
    return found


def _choice_data(choice: Choice | None) -> dict[str, Any]:
    return {} if choice is None else {"choice": choice_data(choice)}


def _ablate(scene: Scene, arguments: argparse.Namespace) -> int:
    """Prints the table, and only then raises AccuracyError where an effect that was left out changes a pixel."""
    from symrender_cg.cli import ablation

    found = ablation.measured(scene, arguments.accuracy, arguments.size, arguments.max_error)
    if arguments.json:
        _out(ablation.as_data(found))
    else:
        ablation.show(found)
    found.require()
    return 0


def _findings(scene: Scene, arguments: argparse.Namespace) -> int:
    from symrender_cg.plan.effects import EFFECTS
    from symrender_cg.plan.plan import plan

    names = [entry.name for entry in EFFECTS]
    if arguments.findings not in names:
        raise ArgumentError(f"--findings: {arguments.findings!r} is no effect; expected one of {', '.join(names)}")
    width, height = arguments.size
    findings = plan(scene, aspect=width / height, max_error=arguments.max_error).findings(arguments.findings)
    if arguments.json:
        data = {"effect": arguments.findings, "findings": [finding_data(finding) for finding in findings]}
        _out(data)
    else:
        print_findings(findings)
    return 0


def _out(data: dict[str, Any]) -> None:
    print(json.dumps(data, indent=2, allow_nan=False))
