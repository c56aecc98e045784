"""The driver: from a scene to a loaded kernel, one timed call a stage.

    stage    in -> out                            owner
    plan     Scene -> Plan                        symrender_cg.plan
    derive   Plan -> ImageProgram                 symrender_cg.derive
    lower    ImageProgram -> KernelProgram        symrender_cg.lower
    emit     KernelProgram -> C text              symrender_cg.emit
    build    C text -> library                    symrender_cg.build
    run      library + numbers -> image           symrender_cg.run

A kernel is remembered twice: in this process, and in the cache on disk under its recipe (plan, accuracy, version of the
compiler), so that neither sympy nor a C compiler is touched when only numbers change.
"""

from __future__ import annotations

import hashlib
import json
import logging
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache as once
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symrender_cg.build.cache import Cache, default_root
from symrender_cg.build.library import CachedKernel
from symrender_cg.lower.variants import Variant, variant
from symrender_cg.plan.plan import Plan, plan, require_format
from symrender_cg.resources import templates
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Scene
from symrender_cg.version import VERSION

if TYPE_CHECKING:
    from symrender_cg.derive.program import ImageProgram
    from symrender_cg.emit.c99 import Emitted
    from symrender_cg.lower.lower import Stage
    from symrender_cg.lower.program import KernelProgram

log = logging.getLogger("symrender_cg")


@dataclass
class Statistics:
    """What this process did so far: kernels derived, compiled, recalled from the cache on disk, reused in memory."""

    derived: int = 0
    compiled: int = 0
    recalled: int = 0
    reused: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def add(self, what: str) -> None:
        """Counts one more of that kind."""
        with self.lock:
            setattr(self, what, getattr(self, what) + 1)


statistics = Statistics()


@dataclass(frozen=True)
class Translation:
    """A scene's C text and how it came about: the plan, the programs, every pass, and the seconds of each stage."""

    plan: Plan
    variant: Variant
    image: ImageProgram
    program: KernelProgram
    passes: tuple[Stage, ...]
    emitted: Emitted
    seconds: dict[str, float]


_kernels: dict[tuple[Any, ...], Kernel] = {}
_locks: dict[tuple[Any, ...], threading.Lock] = {}
_guard = threading.Lock()


def compile_kernel(
    scene: Scene,
    accuracy: str = "double",
    *,
    bake: bool = False,
    portable: bool = False,
    force: Iterable[str] = (),
    cache: str | Path | None = None,
) -> Kernel:
    """The kernel for a scene: from memory, from the cache on disk, or derived, emitted and compiled now."""
    chosen = variant(accuracy)
    scene_plan = _planned(scene, tuple(force))
    require_format(scene, scene_plan, chosen.shading)
    root = Path(cache) if cache is not None else default_root()
    baked = tuple(sorted(numbers_of(scene).items())) if bake else ()
    key = (scene_plan.key, chosen.name, baked, portable, root)
    kernel = _kernels.get(key)
    if kernel is not None:
        statistics.add("reused")
        return kernel
    with _lock_of(key):
        kernel = _kernels.get(key)
        if kernel is None:
            kernel = _kernels[key] = _kernel(scene, scene_plan, chosen, bake=bake, portable=portable, root=root)
    return kernel


def translate(
    scene: Scene,
    accuracy: str = "double",
    *,
    bake: bool = False,
    force: Iterable[str] = (),
    name: str | None = None,
    command: str | None = None,
) -> Translation:
    """Plan, derive, lower and emit: the C text of a scene's kernel, without compiling it."""
    from symrender_cg.derive.exact import sign_tests
    from symrender_cg.derive.image import derive
    from symrender_cg.emit.c99 import emit
    from symrender_cg.lower.lower import lower

    chosen = variant(accuracy)
    seconds: dict[str, float] = {}

    def timed(stage: str, start: float) -> None:
        seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start

    start = time.perf_counter()
    scene_plan = plan(scene, force=force)
    timed("plan", start)
    start = time.perf_counter()
    image = derive(scene_plan)
    tests = sign_tests(image)
    timed("derive", start)
    start = time.perf_counter()
    numbers = numbers_of(scene) if bake else None
    program, passes = lower(image, scene_plan, chosen, numbers=numbers)
    timed("lower", start)
    start = time.perf_counter()
    emitted = emit(
        program,
        plan=scene_plan,
        variant=chosen,
        sign_tests=tests,
        command=command or f"python -m symrender_cg build SCENE --accuracy {chosen.name}",
        numbers=numbers,
        name=name or (f"{program.name}_baked" if bake else None),
    )
    timed("emit", start)
    statistics.add("derived")
    return Translation(scene_plan, chosen, image, program, passes, emitted, seconds)


def build_kernel(
    translation: Translation, *, portable: bool = False, root: Path | None = None, recipe: str | None = None
) -> CachedKernel:
    """The compiled library of a translation, from the cache where it is there; remembered under `recipe`, if given."""
    store = Cache(root if root is not None else default_root())
    emitted = translation.emitted
    cached = store.kernel(emitted.files, emitted.cdef, portable=portable)
    if not cached.from_cache:
        statistics.add("compiled")
    if recipe is not None:
        store.remember(recipe, cached, _payload(translation))
    return cached


def recipe_of(scene_plan: Plan, accuracy: str, baked: Iterable[tuple[str, float]], portable: bool) -> str:
    """What determines a kernel's C text, without deriving it: the version of this compiler, the plan, the variant."""
    exact = [(name, value.hex()) for name, value in baked]
    reasons = [f"{d.effect.name}: {d.reason}" for d in scene_plan.decisions] if exact else []
    return json.dumps([VERSION, _source_digest(), scene_plan.key, reasons, accuracy, exact, portable])


def _kernel(scene: Scene, scene_plan: Plan, chosen: Variant, *, bake: bool, portable: bool, root: Path) -> Kernel:
    baked = tuple(sorted(numbers_of(scene).items())) if bake else ()
    recipe = recipe_of(scene_plan, chosen.name, baked, portable)
    store = Cache(root)
    recalled = store.recall(recipe, portable=portable)
    if recalled is not None:
        cached, payload = recalled
        statistics.add("recalled")
        log.debug("kernel %s recalled from %s", payload["name"], cached.folder)
    else:
        forced = [d.effect.name for d in scene_plan.decisions if d.needed]
        translation = translate(scene, chosen.name, bake=bake, force=forced)
        cached = build_kernel(translation, portable=portable, root=root, recipe=recipe)
        payload = _payload(translation)
        log.debug("kernel %s compiled: %s", payload["name"], " ".join(cached.manifest.command))
    return Kernel(
        name=payload["name"],
        inputs=tuple(payload["inputs"]),
        dtype=np.dtype(np.float32 if payload["type"] == "float" else np.float64),
        cached=cached,
        library=store.load(cached),
        baked=payload["baked"],
    )


def _payload(translation: Translation) -> dict[str, Any]:
    emitted = translation.emitted
    return {
        "name": emitted.name,
        "inputs": list(emitted.inputs),
        "type": emitted.result_type,
        "baked": not emitted.inputs,
        "operations": emitted.operations,
    }


@lru_cache(maxsize=256)
def _planned(scene: Scene, force: tuple[str, ...]) -> Plan:
    """The plan of a scene, remembered: a scene is drawn more than once."""
    return plan(scene, force=force)


def _lock_of(key: tuple[Any, ...]) -> threading.Lock:
    with _guard:
        return _locks.setdefault(key, threading.Lock())


@once
def _source_digest() -> str:
    """A digest of everything that the C text depends on: the sources of the compiler's stages and the templates."""
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    files = [path for stage in ("plan", "derive", "lower", "emit") for path in (package / stage).rglob("*.py")]
    files += [path for path in templates().rglob("*") if path.suffix in (".j2", ".h")]
    for path in sorted(files, key=lambda p: p.parts[-3:]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
