"""What each accuracy level promises of hard cases, and whether one measured case keeps it.

Comes in: a level's name, a scene, an Outcome. Goes out: what is broken, in words, or None. Never done here: a
measurement.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from symrender_cg.scene import Phong, PointLight, Scene

NEAREST_LIGHT: Final = 1e-3
"""Radii: the absolute bound holds where no light is nearer to a surface."""
LARGEST_SHININESS: Final = 1000.0


@dataclass(frozen=True, slots=True)
class Promise:
    """What a level states; every level but the seed's formula also promises finite values.

    words      as it is printed
    hits       hit or miss is never wrong
    zeros      a value is 0 exactly where the true one is
    absolute   the largest error, times max(1, value), where no light is within NEAREST_LIGHT of a surface and n is at
               most LARGEST_SHININESS
    ulp        the largest error, in units of the last place of the level's own format
    rounded    every value is the float nearest to the true one
    """

    words: str
    hits: bool = False
    zeros: bool = False
    absolute: float = math.inf
    ulp: float = math.inf
    rounded: bool = False


NOTHING: Final = Promise("nothing")
PROMISES: Final[dict[str, Promise]] = {
    "literal": NOTHING,
    "fast": Promise("hit or miss is never wrong", hits=True),
    "single": Promise("hit or miss is never wrong", hits=True),
    "double": Promise(
        "hit or miss is never wrong; at most 1e-15 max(1, value) off where no light is within 1e-3 R of a surface and "
        "n <= 1000, shadows, mirrors and edges of tiles included",
        hits=True,
        absolute=1e-15,
    ),
    "stable": Promise("at most 4 ulp off, nothing flips", hits=True, zeros=True, ulp=4.0),
    "certified": Promise("every value is the nearest float", hits=True, zeros=True, rounded=True),
}
"""In the order of what they cost; a level that is not named here promises nothing."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One case at one level.

    refused     the refusal in words, None where there is a value
    ulp, error  of the value, in units of its last place and absolute; 0 where it flipped, inf where it is not finite
    hit_flip    hit or miss is wrong
    zero_flip   exactly one of value and truth is 0
    non_finite  NaN or infinite where the truth is not
    wrong       another float than the nearest to the truth
    size        |truth|
    """

    refused: str | None = None
    ulp: float = 0.0
    error: float = 0.0
    hit_flip: bool = False
    zero_flip: bool = False
    non_finite: bool = False
    wrong: bool = False
    size: float = 0.0

    @property
    def badness(self) -> tuple[bool, bool, bool, float]:
        """Larger is worse: not finite, a wrong hit, a wrong zero, then the error in ulp."""
        return self.non_finite, self.hit_flip, self.zero_flip, self.ulp


def promise_of(level: str) -> Promise:
    """What the level states, `certified:uint8` what `certified` does."""
    return PROMISES.get(level.partition(":")[0], NOTHING)


def broken(level: str, scene: Scene, outcome: Outcome) -> str | None:
    """What the level promised and the outcome does not keep; None where it is kept, and for a refusal."""
    promise = promise_of(level)
    if outcome.refused is not None or promise is NOTHING:
        return None
    if outcome.non_finite:
        return "a value that is not finite"
    if promise.hits and outcome.hit_flip:
        return "hit or miss is wrong"
    if promise.zeros and outcome.zero_flip:
        return "a value is 0 where it should not be, or the other way round"
    if promise.rounded and outcome.wrong:
        return f"not the nearest float, {outcome.ulp:.3g} ulp off"
    if outcome.ulp > promise.ulp:
        return f"{outcome.ulp:.3g} ulp, stated {promise.ulp:g}"
    if outcome.error > promise.absolute * max(1.0, outcome.size) and has_absolute_bound(scene):
        return f"error {outcome.error:.2e}, stated {promise.absolute:g}"
    return None


def has_absolute_bound(scene: Scene) -> bool:
    """Whether an absolute bound is stated of the scene: see Promise."""
    if any(material.shininess > LARGEST_SHININESS and material.specular != 0.0 for material in _materials(scene)):
        return False
    for light in scene.lights:
        if not isinstance(light, PointLight):
            continue
        for sphere in scene.spheres:
            away = math.dist(light.position, sphere.center) / sphere.radius
            if abs(away - 1.0) <= NEAREST_LIGHT:
                return False
    return True


def _materials(scene: Scene) -> Iterator[Phong]:
    for sphere in scene.spheres:
        yield sphere.material
    if scene.plane is not None:
        yield scene.plane.material
        if scene.plane.checker is not None:
            yield scene.plane.checker
