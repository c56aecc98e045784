"""What a kernel rests on, as data: plan, derivation, proofs, operations; and what each effect costs, measured.

    quantities   named formulas as text and as LaTeX
    operations   operations of closed formulas, of named definitions, of the kernels
    sphere       the kernel of one sphere: Explanation
    scene        the kernel of a scene: SceneExplanation, part by part
    stages       how a level proves its values: Proof
    ablation     a scene with effects forced in, and without those that it has

Comes in: a Scene and an accuracy. Goes out: frozen data. Never done here: printing, or a formula that is not the
derivation's own.
"""

from __future__ import annotations

from symrender_cg.errors import ArgumentError
from symrender_cg.explain.operations import part_operations, swollen_operations
from symrender_cg.explain.quantities import Quantity
from symrender_cg.explain.scene import PartExplanation, SceneExplanation, explain_scene
from symrender_cg.explain.sphere import CENTRED, Explanation, Step, explain_sphere
from symrender_cg.explain.stages import (
    FORMATS,
    Proof,
    ProofStage,
    SteepHighlight,
    proof_of,
    steep_highlight_of,
)
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import SphereTranslation, translate
from symrender_cg.scene import Scene

__all__ = [
    "CENTRED",
    "FORMATS",
    "Explanation",
    "PartExplanation",
    "Proof",
    "ProofStage",
    "Quantity",
    "SceneExplanation",
    "SteepHighlight",
    "Step",
    "explain",
    "part_operations",
    "proof_of",
    "steep_highlight_of",
    "swollen_operations",
]


def explain(
    scene: Scene,
    accuracy: str = "double",
    *,
    target: str | None = None,
    aspect: float | None = None,
    max_error: float = 0.0,
) -> Explanation | SceneExplanation:
    """The explanation of the kernel that a scene gets at an accuracy, for images of that width over height.

    target: what `certified` rounds to. aspect None: for any point of the image plane, which an enclosure always is for.
    max_error: what the plan may leave out although it is not absent; levels that prove their values allow none.
    Raises ArgumentError for an unknown accuracy, OutsidePlanError for a scene that no plan covers.
    """
    proves = variant(accuracy, target).settles is not None
    if proves and max_error:
        raise ArgumentError(
            f"max_error: {max_error:g} would leave out what changes the image, and {accuracy!r} proves every value; "
            "leave it out, or take 'double'"
        )
    translation = translate(scene, accuracy, target=target, aspect=aspect, max_error=max_error)
    if isinstance(translation, SphereTranslation):
        return explain_sphere(translation)
    if proves and aspect is not None:
        return explain(scene, accuracy, target=target)
    return explain_scene(translation)
