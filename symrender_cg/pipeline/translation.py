"""Scene -> C text: plan, derive, lower and emit, one timed call a stage.

In: a scene or its plan, a level. Out: a Translation, which keeps what every stage made beside the C text. sympy is
imported where a stage runs, so that recalling a kernel never does. Never here: a compiler, or anything remembered.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from symrender_cg.lower.variants import Variant, variant
from symrender_cg.pipeline.counts import statistics
from symrender_cg.pipeline.recipes import enclosure_name, require_kind
from symrender_cg.plan.plan import Plan, plan
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Scene

if TYPE_CHECKING:
    from symrender_cg.derive.parts import Part
    from symrender_cg.derive.program import ImageProgram
    from symrender_cg.emit.c99 import Emitted
    from symrender_cg.lower.lower import Stage
    from symrender_cg.lower.program import KernelProgram


@dataclass(frozen=True)
class SphereTranslation:
    """The C text of the kernel of one sphere and how it came about: the programs, every pass, seconds of each stage."""

    plan: Plan
    variant: Variant
    emitted: Emitted
    seconds: dict[str, float]
    image: ImageProgram
    program: KernelProgram
    passes: tuple[Stage, ...]


@dataclass(frozen=True)
class SceneTranslation:
    """The C text of the kernel of a scene and how it came about: its parts, derived and lowered.

    Of a level that proves its values this is the enclosure of the scene: one text for all such levels.
    """

    plan: Plan
    variant: Variant
    emitted: Emitted
    seconds: dict[str, float]
    parts: dict[str, Part]
    programs: dict[str, KernelProgram]

    @property
    def encloses(self) -> bool:
        """Whether the kernel gives enclosures (hi, lo, error), not values."""
        return self.variant.settles is not None


Translation = SphereTranslation | SceneTranslation


def translate(
    scene: Scene,
    accuracy: str | Variant = "double",
    *,
    target: str | None = None,
    bake: bool = False,
    force: Iterable[str] = (),
    aspect: float | None = None,
    max_error: float = 0.0,
    name: str | None = None,
    command: str | None = None,
) -> Translation:
    """Plan, derive, lower and emit: the C text of a scene's kernel, without compiling it.

    Of `stable` and `certified` that is the kernel that bounds its own error, where there is one sphere under one light,
    and else the enclosure; `target` is what `certified` rounds to.
    """
    chosen = variant(accuracy, target)
    start = time.perf_counter()
    found = plan(scene, force=force, aspect=aspect, max_error=max_error)
    seconds = {"plan": time.perf_counter() - start}
    return translated(found, chosen, seconds, bake=bake, name=name, command=command)


def translated(
    found: Plan,
    chosen: Variant,
    seconds: dict[str, float],
    *,
    bake: bool = False,
    name: str | None = None,
    command: str | None = None,
) -> Translation:
    """Derive, lower and emit what was planned; the seconds of each stage are added to `seconds`.

    Raises where there is no such kernel (`require_kind`).
    """
    require_kind(found, chosen, bake=bake)
    if chosen.settles and found.arrangement is not None:
        return translate_enclosure(found, chosen, seconds, name=name, command=command)
    level, _, target = chosen.name.partition("_")
    told = command or f"python -m symrender_cg build SCENE --accuracy {level}{f' --target {target}' if target else ''}"
    statistics.add("derived")
    if found.arrangement is None:
        return _translated_sphere(found, chosen, seconds, bake=bake, name=name, command=told)
    return _translated_scene(found, chosen, seconds, name=name, command=told)


def _translated_sphere(
    found: Plan, chosen: Variant, seconds: dict[str, float], *, bake: bool, name: str | None, command: str
) -> SphereTranslation:
    from symrender_cg.derive.exact import sign_tests
    from symrender_cg.derive.image import derive
    from symrender_cg.emit.c99 import emit
    from symrender_cg.lower.lower import lower

    start = time.perf_counter()
    image = derive(found)
    tests = sign_tests(image)
    derived = time.perf_counter()
    numbers = numbers_of(found.scene) if bake else None
    program, passes = lower(image, found, chosen, numbers=numbers)
    lowered = time.perf_counter()
    emitted = emit(
        program,
        plan=found,
        variant=chosen,
        sign_tests=tests,
        command=command,
        numbers=numbers,
        name=name or (f"{program.name}_baked" if bake else None),
    )
    seconds |= {"derive": derived - start, "lower": lowered - derived, "emit": time.perf_counter() - lowered}
    return SphereTranslation(found, chosen, emitted, seconds, image, program, passes)


def _translated_scene(
    found: Plan, chosen: Variant, seconds: dict[str, float], *, name: str | None, command: str
) -> SceneTranslation:
    from symrender_cg.emit.scene import emit_scene, marks_doubt, scene_parts
    from symrender_cg.emit.scene_fields import Needs
    from symrender_cg.lower.parts import lower_part

    start = time.perf_counter()
    need = Needs.of(found.flags)
    parts = scene_parts(need, marks=marks_doubt(chosen))
    derived = time.perf_counter()
    programs = {key: lower_part(part, chosen) for key, part in parts.items()}
    lowered = time.perf_counter()
    emitted = emit_scene(
        programs,
        need=need,
        plan=found,
        variant=chosen,
        command=command,
        name=name or f"{found.name}_{chosen.name}",
    )
    seconds |= {"derive": derived - start, "lower": lowered - derived, "emit": time.perf_counter() - lowered}
    return SceneTranslation(found, chosen, emitted, seconds, parts, programs)


def translate_enclosure(
    found: Plan,
    chosen: Variant | None = None,
    seconds: dict[str, float] | None = None,
    *,
    name: str | None = None,
    command: str | None = None,
) -> SceneTranslation:
    """Derive, lower and emit: the C text of the enclosure of a planned scene, which has an arrangement.

    The text is the same for every level that rests on it; `chosen` is the one that asks for it, certified by default.
    """
    from symrender_cg.emit.enclosure import emit_enclosure, enclosure_parts
    from symrender_cg.emit.scene_fields import Needs
    from symrender_cg.lower.enclose import enclose_part

    statistics.add("derived")
    spent = {} if seconds is None else seconds
    start = time.perf_counter()
    need = Needs.of(found.flags)
    parts = enclosure_parts(need)
    derived = time.perf_counter()
    programs = {key: enclose_part(part) for key, part in parts.items()}
    lowered = time.perf_counter()
    told = command or "python -m symrender_cg build SCENE --accuracy certified"
    emitted = emit_enclosure(programs, need=need, plan=found, command=told, name=name or enclosure_name(found))
    spent |= {"derive": derived - start, "lower": lowered - derived, "emit": time.perf_counter() - lowered}
    return SceneTranslation(found, chosen or variant("certified"), emitted, spent, parts, programs)
