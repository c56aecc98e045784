"""`plan(scene)` -> `Plan`: the effects that this scene calls for, and the proof of each one left out.

A plan is the structure of a kernel: scenes with equal `Plan.key` share one compiled kernel and differ in numbers only.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from symrender_cg.errors import ArgumentError
from symrender_cg.plan.bounds import require_single, require_supported
from symrender_cg.plan.effects import EFFECTS, Effect, Finding
from symrender_cg.scene import Scene


@dataclass(frozen=True, slots=True)
class Decision:
    """One effect: needed, or absent with the inequality that proves it, its numbers and its margin."""

    effect: Effect
    needed: bool
    reason: str
    margin: float | None = None

    @property
    def status(self) -> str:
        """`needed` or `absent`, the words that are printed."""
        return "needed" if self.needed else "absent"


@dataclass(frozen=True, slots=True)
class Plan:
    """The decisions for one scene, one an effect, in the order of the registry."""

    decisions: tuple[Decision, ...]

    def needs(self, effect: str) -> bool:
        """Whether the effect of that name can change the image."""
        for decision in self.decisions:
            if decision.effect.name == effect:
                return decision.needed
        raise KeyError(effect)

    @property
    def key(self) -> tuple[str, ...]:
        """The names of the needed effects: what a kernel's structure depends on."""
        return tuple(decision.effect.name for decision in self.decisions if decision.needed)

    @property
    def name(self) -> str:
        """A name for the structure that can stand in a C identifier: `centred_sphere`, `off_axis_sphere_gated`, ..."""
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
        """The effects left out."""
        return tuple(decision for decision in self.decisions if not decision.needed)


def plan(scene: Scene, *, force: Iterable[str] = ()) -> Plan:
    """The plan of a scene. Effects named in `force` are kept although the scene does not call for them (ablation).

    Raises OutsidePlanError for a scene that no plan covers (several spheres, lengths too far apart in size),
    ArgumentError for an unknown name in `force`.
    """
    forced = frozenset(force)
    known = {effect.name for effect in EFFECTS}
    if unknown := sorted(forced - known):
        raise ArgumentError(f"force: unknown effect {unknown[0]!r}; the effects are {', '.join(sorted(known))}")
    frame = scene.in_camera_frame()
    require_supported(frame)
    return Plan(tuple(_decide(effect, effect.examine(frame), effect.name in forced) for effect in EFFECTS))


def require_format(scene: Scene, found: Plan, shading: str) -> None:
    """Raises OutsidePlanError where kernels that shade in this format are not proved right for the scene."""
    if shading == "float32":
        require_single(scene.in_camera_frame(), at_eye=found.needs("front_test"))


def _decide(effect: Effect, finding: Finding, forced: bool) -> Decision:
    if forced and not finding.needed and effect.optional:
        return Decision(effect, True, f"forced in; left out otherwise, for {finding.reason}", finding.margin)
    return Decision(effect, finding.needed, finding.reason, finding.margin)
