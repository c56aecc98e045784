"""The accuracies that a command is asked for, as those that the scene can have."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from symrender_cg.errors import OutsidePlanError
from symrender_cg.lower.variants import ACCURACIES, variant
from symrender_cg.pipeline import require_kind
from symrender_cg.plan.plan import plan, require_format
from symrender_cg.scene import Scene


def accuracies_for(scene: Scene, asked: Sequence[str] | str, *, bake: bool = False) -> tuple[str, ...]:
    """`all` -> every accuracy that the scene can have, the others named on stderr; a list -> that list.

    Baked, `all` are the accuracies whose kernels can be: of those that prove their values the numbers are arguments.
    Raises OutsidePlanError where a list asks for one that the scene cannot have, ArgumentError for a scene, or an
    accuracy of a list, that cannot be baked.
    """
    found = plan(scene)
    possible = []
    for name in ACCURACIES if asked == "all" else asked:
        chosen = variant(name)
        if asked == "all" and bake and chosen.settles:
            continue
        try:
            require_kind(found, chosen, bake=bake)
            require_format(found, chosen.shading)
        except OutsidePlanError as refusal:
            if asked != "all":
                raise
            print(f"symrender_cg: {name} is left out: {refusal}", file=sys.stderr)
            continue
        possible.append(name)
    return tuple(possible)
