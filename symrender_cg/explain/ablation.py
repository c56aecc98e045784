"""What each effect costs, measured: a scene with left-out effects forced in, and without those that it has.

    left out    drawn again with the effect forced in everywhere: no pixel may change, and what time it would have cost
    kept        drawn again as a scene without it, where there is such a scene: what it costs, and what it changes

Comes in: a scene, an accuracy, a size. Goes out: Ablation, a Trial an effect. Never done here: printing.

Images are unclipped; times are medians over rounds in which every variation is drawn once, in turn, on one thread. A
forced effect must leave every bit as it is, with two exceptions, both written into Trial.allowed: `off_axis` and
`front_test` put other formulas of the same value in (twice the stated bound on rounding), and a plan with a tolerance
may be off by its bound.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg import pipeline
from symrender_cg.build.cache import Cache
from symrender_cg.cli.timing import interleaved_medians
from symrender_cg.errors import AccuracyError
from symrender_cg.explain.removals import without
from symrender_cg.lower.variants import variant
from symrender_cg.plan.effects import SCENE, Status
from symrender_cg.plan.plan import Decision, Plan
from symrender_cg.run.drawing import Drawing
from symrender_cg.scene import Scene

ROUNDS: Final = 9
OTHER_FORMULAS: Final = frozenset({"off_axis", "front_test"})
ROUNDING: Final = {"double": 1e-13, "single": 1e-5, "fast": 2.0**-11}
"""Stated bound on the error of a value not above 1, see symrender_cg.reference.check_scene."""
_COMPILING_THREADS: Final = max(2, os.cpu_count() or 1)

Told = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Trial:
    """One effect tried.

    tried     what was drawn: `forced in`, or the scene without it, such as `shadows = false`; or why nothing was drawn
    change    largest change of any channel of any pixel; None where nothing was drawn
    share     share of the pixels that differ
    allowed   of an effect left out: the largest change that may be; None where nothing is stated of the accuracy
    seconds   of one image of what was drawn
    ratio     time with the effect over time without it
    """

    effect: str
    title: str
    status: Status
    tried: str
    change: float | None = None
    share: float | None = None
    allowed: float | None = None
    seconds: float | None = None
    ratio: float | None = None

    @property
    def holds(self) -> bool:
        """Whether an effect left out changes no more than it may; true where nothing is stated."""
        return self.allowed is None or self.change is None or self.change <= self.allowed


@dataclass(frozen=True, slots=True)
class Ablation:
    """All trials; `seconds` is the time of one image as planned."""

    kernel: str
    accuracy: str
    width: int
    height: int
    max_error: float
    seconds: float
    rounds: int
    trials: tuple[Trial, ...]

    def require(self) -> None:
        """Raises AccuracyError naming the first effect that was left out and yet changes a pixel."""
        for trial in self.trials:
            if not trial.holds:
                raise AccuracyError(
                    f"{trial.effect}: left out as {trial.status}, but forced in it changes a pixel by "
                    f"{trial.change:.3g}, allowed {trial.allowed:.3g}; please report the scene"
                )


@dataclass(frozen=True, slots=True)
class _Variation:
    """One drawing to be made; `against` is what it is compared with, by its place in the list."""

    scene: Scene
    decision: Decision | None
    tried: str
    plan: Plan
    against: int = 0
    clip: bool = False


class Experiment:
    """The variations of a scene, planned; `steps` is how much `run` counts by its callback.

    effects: names of those that are tried, all if not given.
    """

    def __init__(
        self,
        scene: Scene,
        accuracy: str,
        *,
        size: tuple[int, int],
        max_error: float = 0.0,
        portable: bool = False,
        effects: Collection[str] | None = None,
    ) -> None:
        self.scene = scene.in_camera_frame()  # so that leaving something out does not move the window
        self.accuracy = accuracy
        self.size = size
        self.max_error = max_error
        self.portable = portable
        self.effects = effects
        self.variations: list[_Variation] = []
        self._untried: dict[str, str] = {}
        self._base = self._planned(self.scene)
        self._list()

    @property
    def steps(self) -> int:
        """How many steps `run` takes."""
        return len(self.variations) + ROUNDS

    def _planned(self, scene: Scene, force: tuple[str, ...] = ()) -> Plan:
        width, height = self.size
        return pipeline.planned(scene, force=force, aspect=width / height, max_error=self.max_error)

    @property
    def decisions(self) -> tuple[Decision, ...]:
        """The effects that are tried, in the order of the registry."""
        base = self._base
        known = base.decisions if base.arrangement is None and base.scene is base.given else base.summary
        return tuple(d for d in known if self.effects is None or d.effect.name in self.effects)

    def _list(self) -> None:
        self.variations.append(_Variation(self.scene, None, "", self._base))
        scene_base: int | None = 0 if self._base.arrangement is not None else None
        for decision in self.decisions:
            effect = decision.effect
            if decision.needed:
                self._list_without(decision)
                continue
            if not effect.optional:
                continue
            forced = self._planned(self.scene, (effect.name,))
            against = 0
            if (forced.arrangement is None) != (self._base.arrangement is None):  # one sphere's kernel, and a scene's
                if scene_base is None:
                    scene_base = len(self.variations)
                    self.variations.append(_Variation(self.scene, None, "", self._planned(self.scene, (SCENE,))))
                against = scene_base
            if _same(forced, self.variations[against].plan):
                self._untried[effect.name] = "forced in, it adds nothing"
            else:
                self.variations.append(_Variation(self.scene, decision, "forced in", forced, against))

    def _list_without(self, decision: Decision) -> None:
        name = decision.effect.name
        if name == "clip":
            self.variations.append(_Variation(self.scene, decision, "clipped", self._base, clip=True))
            return
        other = without(self.scene, name)
        if other is None:
            self._untried[name] = "no matter of choice"
        elif other[0] == self.scene:
            self._untried[name] = "nothing to take out"
        else:
            self.variations.append(_Variation(other[0], decision, other[1], self._planned(other[0])))

    def run(self, told: Told = lambda count: None) -> Ablation:
        """Compiles what is missing, draws and measures; `told` is called with the number of steps that are done."""
        pipeline.require_kind(self._base, variant(self.accuracy), bake=False)
        self._compile(told)
        drawings = [self._drawing(variation) for variation in self.variations]
        width, height = self.size
        images = [_image(drawing, width, height) for drawing in drawings]
        medians = interleaved_medians(drawings, self.size, rounds=ROUNDS, done=lambda: told(1))
        tried: dict[str, Trial] = {}
        for variation, image, seconds in zip(self.variations, images, medians, strict=True):
            if variation.decision is not None:
                base = images[variation.against]
                trial = self._trial(variation, image, base, seconds, medians[variation.against])
                tried[trial.effect] = trial
        trials = [
            tried.get(d.effect.name)
            or Trial(d.effect.name, d.effect.title, d.status, self._untried.get(d.effect.name, "a fact of geometry"))
            for d in self.decisions
        ]
        kernel = drawings[0].kernel.name
        return Ablation(kernel, self.accuracy, width, height, self.max_error, medians[0], ROUNDS, tuple(trials))

    def _compile(self, told: Told) -> None:
        """Derives the kernels that are not in the cache here, and compiles them side by side."""
        store, seen = Cache(), set()
        with ThreadPoolExecutor(_COMPILING_THREADS, thread_name_prefix="symrender_cg-ablate") as pool:
            jobs: list[Future[Any]] = []
            for variation in self.variations:
                recipe = pipeline.recipe_of(variation.plan, self.accuracy, (), self.portable)
                if recipe not in seen and store.recall(recipe, portable=self.portable) is None:
                    found = variation.plan
                    translation = pipeline.translate(
                        variation.scene,
                        self.accuracy,
                        force=found.force,
                        aspect=found.aspect,
                        max_error=self.max_error,
                    )
                    job = pool.submit(
                        pipeline.build_kernel, translation, portable=self.portable, root=store.root, recipe=recipe
                    )
                    job.add_done_callback(lambda _: told(1))
                    jobs.append(job)
                else:
                    told(1)
                seen.add(recipe)
            for done in jobs:
                done.result()

    def _drawing(self, variation: _Variation) -> Drawing:
        return pipeline.draw(
            variation.scene,
            self.accuracy,
            size=self.size,
            clip=variation.clip,
            force=tuple(sorted(variation.plan.force)),
            max_error=self.max_error,
            portable=self.portable,
        )

    def _trial(
        self, variation: _Variation, image: NDArray[Any], base: NDArray[Any], seconds: float, base_seconds: float
    ) -> Trial:
        decision = variation.decision
        assert decision is not None, "a trial is of an effect"
        effect = decision.effect
        change, share = difference(image, base)
        forced, allowed = not decision.needed, None
        if forced:
            allowed = self._base.bound + variation.plan.bound
            if effect.name in OTHER_FORMULAS or self.max_error > 0.0:
                top = max(1.0, float(np.abs(base).max(initial=0.0)))
                rounding = ROUNDING.get(self.accuracy)
                allowed = None if rounding is None else allowed + 2.0 * top * rounding
        with_it, without_it = (seconds, base_seconds) if forced or variation.clip else (base_seconds, seconds)
        return Trial(
            effect.name,
            effect.title,
            decision.status,
            variation.tried,
            change,
            share,
            allowed,
            seconds,
            with_it / without_it,
        )


def difference(image: NDArray[Any], base: NDArray[Any]) -> tuple[float, float]:
    """Largest change of any channel, and the share of pixels that differ; grey against colour is grey in each channel.

    What is not finite in one alone is an infinite change.
    """
    if image.ndim != base.ndim:
        image, base = (a if a.ndim == 3 else a[..., np.newaxis] for a in (image, base))
    with np.errstate(invalid="ignore"):
        apart = np.where(image == base, 0.0, np.abs(np.subtract(image, base, dtype=np.float64)))
    both = np.isnan(image) & np.isnan(base)
    apart = np.where(both, 0.0, np.where(np.isnan(apart), np.inf, apart))
    pixels = apart if apart.ndim == 2 else apart.max(axis=-1)
    return float(pixels.max(initial=0.0)), float(np.count_nonzero(pixels) / pixels.size)


def _image(drawing: Drawing, width: int, height: int) -> NDArray[Any]:
    image = np.empty(drawing.shape(height, width), drawing.dtype)
    drawing.rows(image, 0, height)
    return image


def _same(one: Plan, other: Plan) -> bool:
    """Whether two plans of one scene draw the same with the same kernel: nothing was forced in."""
    if one.key != other.key or (one.arrangement is None) != (other.arrangement is None):
        return False
    if one.arrangement is None or other.arrangement is None:
        return True
    a, b = one.arrangement, other.arrangement
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
