"""A plan and a level -> which kernel that is: whether there is one, its name, and its recipe in the cache.

In: a Plan, a Variant or the name of what is built, baked numbers. Out: a string that determines the C text, found
without deriving it; or an error that says why there is no such kernel. Never here: sympy, C text, a library.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from functools import cache as once
from pathlib import Path

from symrender_cg.errors import ArgumentError, OutsidePlanError
from symrender_cg.lower.variants import Variant
from symrender_cg.plan.plan import Plan
from symrender_cg.resources import templates
from symrender_cg.version import VERSION

ENCLOSURE = "enclosure"
"""Stands in recipes and manifests in place of a level: several levels rest on it."""


def require_kind(found: Plan, chosen: Variant, *, bake: bool) -> None:
    """Raises where there is no such kernel of scenes: baked, or by the formula of the seed, which has one sphere."""
    if bake and chosen.settles:
        raise ArgumentError(f"bake: a kernel of {chosen.name!r} takes its numbers as arguments; leave bake out")
    if found.arrangement is None:
        return
    if bake:
        raise ArgumentError(
            "bake: the kernel of a scene loops over arrays of spheres and lights, so there are no numbers to fold in; "
            "baked kernels are of one sphere and one light; leave bake out"
        )
    if not chosen.exact:
        raise OutsidePlanError(
            f"accuracy: {chosen.name!r} is the formula of one sphere under one light; this scene has more; "
            "use 'double' or 'single'"
        )


def enclosure_name(found: Plan) -> str:
    """The C name of a scene's enclosure."""
    return f"{found.name}_enclosure"


def recipe_of(scene_plan: Plan, accuracy: str, baked: Iterable[tuple[str, float]], portable: bool) -> str:
    """What determines a kernel's C text, without deriving it: the version of this compiler, the plan, the variant."""
    exact = [(name, value.hex()) for name, value in baked]
    reasons = [f"{d.effect.name}: {d.reason}" for d in scene_plan.decisions] if exact else []
    return json.dumps([VERSION, _source_digest(), scene_plan.key, reasons, accuracy, exact, portable])


@once
def _source_digest() -> str:
    """A digest of everything that the C text depends on: the sources of the compiler's stages and the templates."""
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    files = [path for stage in ("plan", "derive", "lower", "emit") for path in (package / stage).rglob("*.py")]
    files += [path for path in templates().rglob("*") if path.suffix in (".j2", ".h")]
    for path in sorted(files, key=lambda p: p.parts[-3:]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
