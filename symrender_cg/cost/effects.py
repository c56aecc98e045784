"""What each effect costs: a scene's time with one effect after the other put back in, until it is whole.

Comes in: a Scene. Goes out: Effects, the first of them the scene without any that can be taken out. Never done here: a
change of what an effect is; symrender_cg.explain.removals says what a scene without one is.

`explain --ablate` asks the other question: what the whole scene would save without this effect alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from symrender_cg.cost.ready import make_ready
from symrender_cg.cost.report import Effect, Spread
from symrender_cg.cost.timing import interleaved
from symrender_cg.cost.variants import DEFAULT, way_of
from symrender_cg.explain.removals import without
from symrender_cg.pipeline import planned
from symrender_cg.scene import Scene

ORDER: Final = (
    "diffuse",
    "specular",
    "specular_gate",
    "attenuation",
    "colour",
    "gradient",
    "plane",
    "checker",
    "shadow",
    "mirror",
    "mirror_depth",
)
"""The order in which effects are put back in: what later ones rest on comes first."""
NONE: Final = "nothing of these"


def stages_of(scene: Scene) -> list[tuple[str, str, Scene]]:
    """(effect, what its absence was, the scene with it and all before it); the first without any. The window stays.

    What the plan of the whole scene leaves out is no effect of it.
    """
    whole = scene.in_camera_frame()
    found = planned(whole)
    decisions = found.decisions if found.arrangement is None else found.summary
    needed = {decision.effect.name for decision in decisions if decision.needed}
    present, words = [], {}
    for effect in ORDER:
        other = without(whole, effect)
        if effect in needed and other is not None and other[0] != whole:
            present.append(effect)
            words[effect] = other[1]
    stages = [(NONE, "ambient light alone" if present else "the whole scene", _left(whole, present))]
    for count, effect in enumerate(present, 1):
        stages.append((effect, f"before: {words[effect]}", _left(whole, present[count:])))
    return stages


def _left(scene: Scene, effects: Sequence[str]) -> Scene:
    """The scene without these; deeper bounces are taken out before the first one is."""
    for effect in reversed(effects):
        other = without(scene, effect)
        assert other is not None, "the effect was found in the scene"
        scene = other[0]
    return scene


def measure_effects(
    scene: Scene, size: tuple[int, int], *, rounds: int, seed: int, told: Callable[[str], None] = lambda what: None
) -> tuple[Effect, ...]:
    """The time of every stage in one interleaved run, at `double`, and what each effect added to the one before."""
    stages = stages_of(scene)
    ready = []
    for name, _, one in stages:
        ready += make_ready([way_of(DEFAULT)], one, size)
        told(name)
    samples = np.asarray(interleaved([one.draw for one in ready], rounds, seed)) * (1e9 / (size[0] * size[1]))
    last = samples[-1]
    unit = float(np.nanmedian(last))
    found: list[Effect] = []
    before = 0.0
    for (name, did, _), taken in zip(stages, samples, strict=True):
        ratios = taken / last
        spread = Spread.of((unit * ratios[np.isfinite(ratios)]).tolist())
        found.append(Effect(name, did, spread, spread.median - before))
        before = spread.median
    return tuple(found)
