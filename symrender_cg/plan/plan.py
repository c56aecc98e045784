"""`plan(scene)` -> `Plan`: the effects that this scene calls for, and the proof of each one left out.

A plan is the structure of a kernel: scenes with equal `Plan.key` share one compiled kernel and differ in numbers only.
A scene of which one visible sphere and one point light is left, grey and without shadow or mirror, has the kernel of
one sphere; every other has an Arrangement, and the kernel of scenes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Final

from symrender_cg.errors import ArgumentError, OutsidePlanError
from symrender_cg.plan.bounds import (
    require_single,
    require_single_view,
    require_supported,
)
from symrender_cg.plan.effects import EFFECTS, SCENE, SPHERE_EFFECTS, Effect, Finding, Status, effect
from symrender_cg.plan.flags import fades, scene_name
from symrender_cg.scene import Gradient, PointLight, Scene

if TYPE_CHECKING:
    from symrender_cg.plan.arrangement import Arrangement
    from symrender_cg.plan.examination import Examination

MOST_FINDINGS: Final = 10_000
"""Subjects of one effect that are written out; of more, the last finding says how many there are."""

MOST_SUMMARISED: Final = 512
"""The tightest margin of an effect is looked for among at most so many subjects."""


@dataclass(frozen=True, slots=True)
class Decision:
    """One effect: needed, or absent with the inequality that proves it, or bounded; its numbers and its margin.

    margin: the tightest of all subjects, None where there is none or they are too many. bound: how much the image may
    change where the effect, or, if it is needed, part of it, is left out within the tolerance; what two effects have in
    common is in the bounds of both, `Plan.bound` is that of all.
    """

    effect: Effect
    needed: bool
    reason: str
    margin: float | None = None
    bound: float | None = None

    @property
    def status(self) -> Status:
        """`needed`, `absent` or `bounded`, the words that are printed."""
        return "needed" if self.needed else "absent" if self.bound is None else "bounded"


@dataclass(frozen=True)
class Plan:
    """What to draw, with which kernel, and why.

    scene        in the camera's frame: what is drawn; one sphere and one PointLight where there is no arrangement
    given        the scene that was planned, in the camera's frame
    arrangement  of the kernel of scenes; None where the kernel of one sphere serves
    flags        what the C of a scene kernel depends on; empty for one sphere
    """

    scene: Scene
    given: Scene
    flags: frozenset[str] = frozenset()
    force: frozenset[str] = frozenset()
    aspect: float | None = None
    max_error: float = 0.0
    arrangement: Arrangement | None = field(default=None, compare=False, repr=False)

    @cached_property
    def decisions(self) -> tuple[Decision, ...]:
        """One an effect, in the order of the registry: those that the kernel rests on."""
        if self.arrangement is None:
            return tuple(self._of_sphere(entry) for entry in SPHERE_EFFECTS)
        return self.summary

    @cached_property
    def summary(self) -> tuple[Decision, ...]:
        """One decision for every effect of the registry, also for one sphere."""
        found = self.examination
        of_sphere = self.arrangement is None
        return tuple(
            self._of_sphere(entry) if of_sphere and entry in SPHERE_EFFECTS else self._of_scene(entry, found)
            for entry in EFFECTS
        )

    @cached_property
    def examination(self) -> Examination:
        """All that is known about the scene, by indices of its spheres and lights; made again when asked for."""
        from symrender_cg.plan.examination import examine, look

        return examine(look(self.given, aspect=self.aspect, force=self.force), self.max_error)

    @cached_property
    def bound(self) -> float:
        """How much any pixel may change by what is left out although it is not absent; at most max_error."""
        budget = self.examination.budget if self.max_error > 0.0 else None
        return 0.0 if budget is None else budget.diffuse_bound + budget.specular_bound + budget.depth_bound

    @cached_property
    def fits_single(self) -> bool:
        """Whether kernels that shade in float32 are proved right for the scene."""
        try:
            _require_single(self)
        except OutsidePlanError:
            return False
        return True

    def findings(self, name: str) -> tuple[Finding, ...]:
        """What was found for each subject of an effect, such as `spheres[3] on spheres[0] from lights[1]`.

        At most 10,000; a last one says how many more there are. Raises KeyError for an unknown effect.
        """
        entry = effect(name)
        found = tuple(islice(entry.find(self.examination), MOST_FINDINGS + 1))
        if len(found) <= MOST_FINDINGS:
            return found
        left = entry.tally(self.examination).subjects - MOST_FINDINGS
        return (*found[:MOST_FINDINGS], Finding(True, f"and {left} more, not written out"))

    def needs(self, effect: str) -> bool:
        """Whether the effect of that name can change the image."""
        for decision in self.decisions:
            if decision.effect.name == effect:
                return decision.needed
        raise KeyError(effect)

    @cached_property
    def key(self) -> tuple[str, ...]:
        """What a kernel's structure depends on: the names of the needed effects, or `scene` and its flags."""
        if self.arrangement is not None:
            return (SCENE, *sorted(self.flags))
        return tuple(decision.effect.name for decision in self.decisions if decision.needed)

    @property
    def name(self) -> str:
        """A name for the structure that can stand in a C identifier: `centred_sphere`, `scene_shadow_mirror`, ..."""
        if self.arrangement is not None:
            return scene_name(self.flags)
        if self.needs("front_test"):
            sphere = "any_sphere"
        else:
            sphere = "off_axis_sphere" if self.needs("off_axis") else "centred_sphere"
        light = {
            (True, True): "",
            (True, False): "_matte",
            (False, True): "_specular",
            (False, False): "_flat",
        }[self.needs("diffuse"), self.needs("specular")]
        return sphere + light + ("_gated" if self.needs("specular_gate") else "")

    @property
    def absent(self) -> tuple[Decision, ...]:
        """The effects left out, absent or bounded."""
        return tuple(decision for decision in self.decisions if not decision.needed)

    def _of_sphere(self, entry: Effect) -> Decision:
        assert entry.examine is not None, "an effect of one sphere is examined exactly"
        finding = entry.examine(self.scene)
        if entry.name in self.force and not finding.needed and entry.optional:
            return Decision(
                entry, True, f"forced in; left out otherwise, for {finding.reason}", finding.margin, finding.bound
            )
        if self.scene is not self.given and entry.name in ("diffuse", "specular"):
            tally = entry.tally(self.examination)
            return Decision(entry, finding.needed, tally.reason, None, tally.bound)
        return Decision(entry, finding.needed, finding.reason, finding.margin)

    def _of_scene(self, entry: Effect, found: Examination) -> Decision:
        tally = entry.tally(found)
        needed, reason = tally.needed, tally.reason
        if entry.name in self.force and entry.optional:
            needed, reason = True, f"forced in everywhere; {reason}"
        margin = None
        if tally.subjects <= MOST_SUMMARISED:
            margins = [f.margin for f in entry.find(found) if f.status == "absent" and f.margin is not None]
            margin = min(margins, default=None)
        return Decision(entry, needed, reason, margin, tally.bound)


def plan(scene: Scene, *, force: Iterable[str] = (), aspect: float | None = None, max_error: float = 0.0) -> Plan:
    """The plan of a scene.

    force: effects that are kept everywhere although the scene does not call for them (ablation), or `scene` for the
    kernel of many-sphere scenes. aspect: width over height of the image; None where any point of the image plane may be
    asked for. max_error: what may be left out although it is not absent, the largest change of any pixel.

    Raises OutsidePlanError for lengths too far apart in size, ArgumentError for an unknown name in `force`, an aspect
    that is not a positive number, a negative max_error.
    """
    forced = frozenset(force)
    known = {entry.name for entry in EFFECTS} | {SCENE}
    if unknown := sorted(forced - known):
        raise ArgumentError(f"force: unknown effect {unknown[0]!r}; the effects are {', '.join(sorted(known))}")
    if aspect is not None and not (math.isfinite(aspect) and aspect > 0.0):
        raise ArgumentError(f"aspect: {aspect!r}; expected width over height of the image, a number > 0, or None")
    if not (math.isfinite(max_error) and max_error >= 0.0):
        raise ArgumentError(f"max_error: {max_error!r}; expected the largest change of a pixel, a number >= 0")
    frame = scene.in_camera_frame()
    of_sphere = {entry.name for entry in SPHERE_EFFECTS}
    if _is_one_sphere(frame) and forced <= of_sphere and max_error == 0.0:
        require_supported(frame)
        return Plan(frame, frame, force=forced, aspect=aspect)
    from symrender_cg.plan.arranging import arranged

    return arranged(frame, forced, aspect, max_error)


def require_format(found: Plan, shading: str) -> None:
    """Raises OutsidePlanError where kernels that shade in this format are not proved right for the plan's scene."""
    if shading == "float32" and not found.fits_single:
        _require_single(found)


def _require_single(found: Plan) -> None:
    require_single_view(found.scene)
    if found.arrangement is None:
        require_single(found.scene, 0, at_eye=found.needs("front_test"))
        return
    seen = found.arrangement.spheres[: found.arrangement.visible].tolist()
    for index, at_eye in zip(seen, found.arrangement.at_eye.tolist(), strict=True):
        require_single(found.scene, index, at_eye=at_eye)


def _is_one_sphere(frame: Scene) -> bool:
    """Whether the scene is one sphere and one point light, with nothing that the kernel of one sphere does not have."""
    if len(frame.spheres) != 1 or len(frame.lights) != 1 or frame.plane is not None or frame.channels != 1:
        return False
    light, background = frame.lights[0], frame.background
    if not isinstance(light, PointLight) or fades(light) or isinstance(background, Gradient):
        return False
    return frame.spheres[0].material.reflect == 0.0 or frame.max_bounces == 0 or background == 0.0
