"""The kernel of a plan at a level: from this process's memory, from the cache on disk, or translated and compiled now.

In: a scene or its plan, a level. Out: a loaded Kernel or SceneKernel; or the folder of a compiled library. Several
threads that ask for one kernel at once wait for the first. Never here: which level a scene needs, or an image.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from symrender_cg.build.cache import Cache, default_root
from symrender_cg.build.library import CachedKernel
from symrender_cg.errors import OutsidePlanError
from symrender_cg.lower.variants import Variant, variant
from symrender_cg.pipeline.counts import statistics
from symrender_cg.pipeline.plans import planned
from symrender_cg.pipeline.recipes import recipe_of, require_kind
from symrender_cg.pipeline.translation import SceneTranslation, Translation, translated
from symrender_cg.plan.plan import Plan, require_format
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.scene import Scene

log = logging.getLogger("symrender_cg")

_kernels: dict[tuple[Any, ...], Kernel | SceneKernel] = {}
_locks: dict[tuple[Any, ...], threading.Lock] = {}
_guard = threading.Lock()


def compile_kernel(
    scene: Scene,
    accuracy: str | Variant = "double",
    *,
    bake: bool = False,
    portable: bool = False,
    force: Iterable[str] = (),
    cache: str | Path | None = None,
) -> Kernel | SceneKernel:
    """The kernel for a scene, at any point of the image plane: from memory, from the cache on disk, or compiled now."""
    found = planned(scene, force=tuple(force))
    return kernel_of(found, variant(accuracy), bake=bake, portable=portable, cache=cache)


def kernel_of(
    found: Plan, chosen: Variant, *, bake: bool, portable: bool, cache: str | Path | None
) -> Kernel | SceneKernel:
    """The kernel of a plan: from memory, from the cache on disk, or compiled now.

    Raises where there is none: `require_kind`, `require_format`, or a level that the enclosure of a scene draws.
    """
    require_kind(found, chosen, bake=bake)
    if chosen.settles and found.arrangement is not None:
        raise OutsidePlanError(
            f"accuracy: {chosen.name!r} has a kernel of its own for one sphere under one light; this scene has more, "
            "and is drawn by its enclosure"
        )
    require_format(found, chosen.shading)
    root = Path(cache) if cache is not None else default_root()
    baked = tuple(sorted(numbers_of(found.scene).items())) if bake else ()
    key = (found.key, chosen.key, baked, portable, root)
    kernel = _kernels.get(key)
    if kernel is not None:
        statistics.add("reused")
        return kernel
    with lock_of(key):
        kernel = _kernels.get(key)
        if kernel is None:
            kernel = _kernels[key] = _kernel(found, chosen, baked, portable=portable, root=root)
    return kernel


def _kernel(
    found: Plan, chosen: Variant, baked: tuple[tuple[str, float], ...], *, portable: bool, root: Path
) -> Kernel | SceneKernel:
    recipe = recipe_of(found, chosen.key, baked, portable)
    store = Cache(root)
    recalled = store.recall(recipe, portable=portable, extra_flags=chosen.flags)
    if recalled is not None:
        cached, payload = recalled
        statistics.add("recalled")
        log.debug("kernel %s recalled from %s", payload["name"], cached.folder)
    else:
        translation = translated(found, chosen, {}, bake=bool(baked))
        cached = build_kernel(translation, portable=portable, root=root, recipe=recipe)
        payload = payload_of(translation)
        log.debug("kernel %s compiled: %s", payload["name"], " ".join(cached.manifest.command))
    dtype = np.dtype({"float": "float32", "unsigned char": "uint8"}.get(payload["type"], "float64"))
    library = store.load(cached)
    if "fields" in payload:
        fields = tuple((str(name), str(shape)) for name, shape in payload["fields"])
        return SceneKernel(payload["name"], fields, int(payload["channels"]), dtype, cached, library)
    return (SettlingKernel if chosen.settles else Kernel)(
        name=payload["name"],
        inputs=tuple(payload["inputs"]),
        dtype=dtype,
        cached=cached,
        library=library,
        baked=payload["baked"],
    )


def build_kernel(
    translation: Translation, *, portable: bool = False, root: Path | None = None, recipe: str | None = None
) -> CachedKernel:
    """The compiled library of a translation, from the cache where it is there; remembered under `recipe`, if given."""
    store = Cache(root if root is not None else default_root())
    emitted = translation.emitted
    flags = translation.variant.flags
    cached = store.kernel(emitted.files, emitted.cdef, portable=portable, extra_flags=flags)
    if not cached.from_cache:
        statistics.add("compiled")
    if recipe is not None:
        store.remember(recipe, cached, payload_of(translation))
    return cached


def payload_of(translation: Translation) -> dict[str, Any]:
    """What the cache remembers with a recipe: all that a loaded library does not say of itself."""
    emitted = translation.emitted
    payload: dict[str, Any] = {
        "name": emitted.name,
        "inputs": list(emitted.inputs),
        "type": emitted.result_type,
        "baked": not emitted.inputs,
        "operations": emitted.operations,
    }
    if isinstance(translation, SceneTranslation):
        payload["fields"] = [list(field) for field in emitted.fields]
        payload["channels"] = 3 if "colour" in translation.plan.flags else 1
    return payload


def lock_of(key: tuple[Any, ...]) -> threading.Lock:
    """The lock of what is made under a key, so that it is made once."""
    with _guard:
        return _locks.setdefault(key, threading.Lock())
