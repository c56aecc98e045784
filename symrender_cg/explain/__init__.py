"""What a kernel rests on, as data: plan, derivation, proofs, operations; and what each effect costs, measured.

    quantities   named formulas as text and as LaTeX
    operations   operations of closed formulas, of named definitions, of the kernels
    sphere       the kernel of one sphere: Explanation
    scene        the kernel of a scene: SceneExplanation, part by part
    ablation     a scene with effects forced in, and without those that it has

Comes in: a Scene and an accuracy. Goes out: frozen data. Never done here: printing, or a formula that is not the
derivation's own.
"""

from __future__ import annotations

from symrender_cg.explain.operations import part_operations, swollen_operations
from symrender_cg.explain.quantities import Quantity
from symrender_cg.explain.scene import PartExplanation, SceneExplanation, explain_scene
from symrender_cg.explain.sphere import CENTRED, Explanation, Step, explain_sphere
from symrender_cg.pipeline import SphereTranslation, translate
from symrender_cg.scene import Scene

__all__ = [
    "CENTRED",
    "Explanation",
    "PartExplanation",
    "Quantity",
    "SceneExplanation",
    "Step",
    "explain",
    "part_operations",
    "swollen_operations",
]


def explain(
    scene: Scene, accuracy: str = "double", *, aspect: float | None = None, max_error: float = 0.0
) -> Explanation | SceneExplanation:
    """The explanation of the kernel that a scene gets at an accuracy, for images of that width over height.

    aspect None: for any point of the image plane. max_error: what the plan may leave out although it is not absent.
    Raises ArgumentError for an unknown accuracy, OutsidePlanError for a scene that no plan covers.
    """
    translation = translate(scene, accuracy, aspect=aspect, max_error=max_error)
    if isinstance(translation, SphereTranslation):
        return explain_sphere(translation)
    return explain_scene(translation)
