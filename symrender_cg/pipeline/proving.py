"""The kernels that prove values: of one sphere, one that bounds its own error; of any scene, its enclosure.

In: a scene. Out: the kernel, and the scene that it draws. Never here: the stages that they serve (run/certify.py).
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from symrender_cg.build.cache import Cache, default_root
from symrender_cg.lower.variants import Variant
from symrender_cg.pipeline.counts import statistics
from symrender_cg.pipeline.kernels import build_kernel, kernel_of, lock_of, payload_of
from symrender_cg.pipeline.plans import planned
from symrender_cg.pipeline.recipes import ENCLOSURE, recipe_of
from symrender_cg.pipeline.translation import translate_enclosure
from symrender_cg.plan.plan import Plan
from symrender_cg.run.drawing import SamePlan
from symrender_cg.run.enclosure_kernel import EnclosureKernel
from symrender_cg.run.enclosure_numbers import brought_nearer
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.scene import Scene

_enclosures: dict[tuple[Any, ...], EnclosureKernel] = {}


def settling_kernel(
    scene: Scene,
    chosen: Variant,
    *,
    aspect: float | None = None,
    portable: bool = False,
    cache: str | Path | None = None,
) -> tuple[SettlingKernel, Scene] | None:
    """The kernel that bounds its own error, and the scene that it draws; None where a scene has more than one sphere
    under one light: then the enclosure is the first stage."""
    found = planned(scene, aspect=aspect)
    if found.arrangement is not None:
        return None
    kernel = kernel_of(found, chosen, bake=False, portable=portable, cache=cache)
    assert isinstance(kernel, SettlingKernel), f"{chosen.name} settles"
    return kernel, found.scene


def enclosure_kernel(
    scene: Scene, *, aspect: float | None = None, portable: bool = False, cache: str | Path | None = None
) -> EnclosureKernel:
    """The kernel that encloses a scene's intensities at points in the window of that aspect, bound to the scene.

    aspect: None for any points of the image plane; that of an image for its pixels, so that one plan serves the image
    and what is settled of it.
    """
    found, nearer = planned(scene, aspect=aspect), None
    if found.arrangement is None:
        nearer = brought_nearer(found.scene)
        found = planned(nearer or scene, force=("scene",))
    root = Path(cache) if cache is not None else default_root()
    key = (found.key, "enclosure", portable, root)
    with lock_of(key):
        kernel = _enclosures.get(key)
        if kernel is None:
            kernel = _enclosures[key] = _enclosure(found, portable=portable, root=root)
    return _enclosing(kernel, SamePlan(found), nearer is not None)


@lru_cache(maxsize=8)
def _enclosing(kernel: EnclosureKernel, same: SamePlan, nearer: bool) -> EnclosureKernel:
    """The kernel bound to a scene, remembered with the scene's tables."""
    return replace(kernel, plan=same.plan, nearer=nearer)


def _enclosure(found: Plan, *, portable: bool, root: Path) -> EnclosureKernel:
    recipe = recipe_of(found, ENCLOSURE, (), portable)
    store = Cache(root)
    recalled = store.recall(recipe, portable=portable)
    if recalled is not None:
        cached, payload = recalled
        statistics.add("recalled")
    else:
        translation = translate_enclosure(found)
        cached = build_kernel(translation, portable=portable, root=root, recipe=recipe)
        payload = payload_of(translation)
    fields = tuple((str(name), str(shape)) for name, shape in payload["fields"])
    channels = 3 if "colour" in found.flags else 1
    return EnclosureKernel(payload["name"], fields, channels, found, cached, store.load(cached))
