"""What the kernel of a scene rests on: its plan, what it loops over, and its parts with formulas and operations.

Comes in: its translation. Goes out: SceneExplanation, frozen, of text and numbers. Never done here: printing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from symrender_cg.explain.operations import Swell, by_format, by_rate, swell_of
from symrender_cg.explain.quantities import Quantity, latex_symbols, quantity
from symrender_cg.plan.plan import Decision, Plan

if TYPE_CHECKING:
    from symrender_cg.derive.parts import Part
    from symrender_cg.lower.program import KernelProgram
    from symrender_cg.pipeline import SceneTranslation

MEANINGS: Final = {
    "span": "a sphere before the eye and a ray of the eye: the ends of its span in a row, normal, distance",
    "near": "a sphere at the plane of the eye and a ray of the eye: hit, normal, distance",
    "plane": "the ground plane and a ray of the eye",
    "tiles": "which of the plane's two materials a point has",
    "lamp": "a light as its receiver sees it",
    "reach": "from a point to a lamp",
    "matte": "n.l of a point",
    "glossy": "n.l and the highlight of a point",
    "gate": "how sure it is that a surface faces the light, which a gated highlight rests on",
    "fading": "how a point light fades with its distance",
    "shadow": "whether a sphere stands between a point and a lamp",
    "echo": "a mirrored ray and a sphere",
    "arrival": "the normal where a mirrored ray arrives, and the ray mirrored once more",
    "echo_plane": "a mirrored ray and the plane",
    "landing": "where a mirrored ray meets the plane, and the ray mirrored there, in two words",
    "gradient": "the background of a direction",
}


_ENCLOSED: Final = {"near": "a sphere and a ray of the eye: hit, normal, distance"}
"""Parts that mean more in an enclosure."""


@dataclass(frozen=True, slots=True)
class PartExplanation:
    """One part: what it is, the names it takes by rate and gives, its definitions, its operations by rate and kind.

    formats: the number formats of its steps, each with the quantities in it.
    """

    name: str
    meaning: str
    inputs: tuple[str, ...]
    rates: tuple[tuple[str, str], ...]
    results: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    operations: dict[str, dict[str, int]]
    swell: Swell
    formats: tuple[tuple[str, tuple[str, ...]], ...]


@dataclass(frozen=True, slots=True)
class SceneExplanation:
    """All of it.

    decisions   one for every effect;  bound: how much any pixel may change by what is left out within `max_error`
    counts      what the kernel loops over, in words and numbers
    seconds     of each stage
    """

    kernel: str
    accuracy: str
    promise: str
    aspect: float | None
    max_error: float
    bound: float
    flags: tuple[str, ...]
    decisions: tuple[Decision, ...]
    counts: tuple[tuple[str, int], ...]
    parts: tuple[PartExplanation, ...]
    seconds: dict[str, float]
    operations: dict[str, dict[str, int]]


def explain_scene(translation: SceneTranslation) -> SceneExplanation:
    """The explanation of the kernel of a scene."""
    found, emitted = translation.plan, translation.emitted
    return SceneExplanation(
        kernel=emitted.name,
        accuracy=translation.variant.name,
        promise=translation.variant.promise,
        aspect=found.aspect,
        max_error=found.max_error,
        bound=found.bound,
        flags=tuple(sorted(found.flags)),
        decisions=found.summary,
        counts=_counts(found),
        parts=tuple(
            _part(part, translation.programs[name], MEANINGS | (_ENCLOSED if translation.encloses else {}))
            for name, part in translation.parts.items()
        ),
        seconds=dict(translation.seconds),
        operations={rate: dict(sorted(counts.items())) for rate, counts in emitted.operations.items()},
    )


def _part(part: Part, program: KernelProgram, meanings: Mapping[str, str]) -> PartExplanation:
    names = latex_symbols((d.name, d.value) for d in part.definitions)
    return PartExplanation(
        name=part.name,
        meaning=meanings.get(part.name, ""),
        inputs=part.inputs,
        rates=tuple((name, rate) for name, rate in part.rates if name in part.inputs),
        results=part.results,
        quantities=tuple(quantity(d.name, d.value, d.meaning, d.source, d.section, names) for d in part.definitions),
        operations=by_rate(program),
        swell=swell_of(part, program),
        formats=by_format(program),
    )


def _counts(found: Plan) -> tuple[tuple[str, int], ...]:
    arrangement = found.arrangement
    assert arrangement is not None, "the kernel of a scene has an arrangement"
    return (
        ("spheres of the scene", len(found.given.spheres)),
        ("spheres in the kernel's lists", len(arrangement.spheres)),
        ("spheres that may own a pixel", arrangement.visible),
        ("pairs of spheres compared by depth", len(arrangement.partners)),
        ("pairs of a surface and a light", len(arrangement.lamp_light)),
        ("spheres that may shadow one of these", len(arrangement.blockers)),
        ("spheres that may be seen in a mirror", len(arrangement.mirrors)),
        ("bounces", arrangement.bounces),
    )
