"""What a hard case is: a scene and one point of its image plane, drawn from a seed by the family that it belongs to.

Comes in: a family's drawing function, a seed. Goes out: Case, the same for the same seed on every machine. Never done
here: an evaluation, or an expectation of a value.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from symrender_cg.errors import SceneError
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere, Vector

T = TypeVar("T")

MOST_ATTEMPTS: Final = 400
"""A drawing function may find nothing; so often it is asked again, with other numbers."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Chapter 1's numbers as they are given, valid or not: sphere at the origin, eye at (0, 0, eye), one light."""

    radius: float
    eye: float
    light: Vector
    ambient: float = 0.1
    diffuse: float = 0.7
    specular: float = 0.5
    shininess: float = 32.0
    gate_specular: bool = False

    def scene(self) -> Scene:
        """The scene of these numbers, its view 45 degrees each way. Raises SceneError where they have no image."""
        material = Phong(self.ambient, self.diffuse, self.specular, self.shininess, self.gate_specular)
        sphere = Sphere((0.0, 0.0, 0.0), self.radius, material)
        return Scene(Camera((0.0, 0.0, self.eye), half_height=self.eye), (sphere,), (PointLight(self.light),))


@dataclass(frozen=True, slots=True)
class Case:
    """One point (x, y) of one scene, in scene units; `number` counts the cases of one draw of a family from 0.

    inputs: the numbers behind a scene of one centred sphere. scene is None where these are numbers that have no image.
    """

    family: str
    number: int
    scene: Scene | None
    x: float
    y: float
    note: str
    inputs: Inputs | None = None

    @property
    def name(self) -> str:
        """`family #number`."""
        return f"{self.family} #{self.number}"

    @property
    def refused(self) -> bool:
        """Whether there is nothing to evaluate, no scene or no point: building or evaluating it must raise."""
        return self.scene is None or not (math.isfinite(self.x) and math.isfinite(self.y))


Drawn = tuple[Scene | Inputs, float, float, str]
"""(scene or its numbers, x, y, note)"""


class Dice:
    """Random numbers of one case: a function of the words that it was made with, on every machine."""

    def __init__(self, *words: object) -> None:
        self._random = random.Random("/".join(map(str, words)))

    def real(self, low: float, high: float) -> float:
        """Uniform in [low, high]."""
        return self._random.uniform(low, high)

    def ten_to(self, low: float, high: float) -> float:
        """10^u with u uniform in [low, high]."""
        return float(10.0 ** self._random.uniform(low, high))

    def whole(self, low: int, high: int) -> int:
        """low <= result <= high."""
        return self._random.randint(low, high)

    def one(self, values: Sequence[T]) -> T:
        """One of them, each as likely."""
        return self._random.choice(values)

    def often(self, share: float) -> bool:
        """True with that probability."""
        return self._random.random() < share

    def direction(self) -> Vector:
        """A unit vector, to rounding; every direction as likely."""
        z, turn = self._random.uniform(-1.0, 1.0), self._random.uniform(0.0, 2.0 * math.pi)
        flat = math.sqrt(max(0.0, 1.0 - z * z))
        return flat * math.cos(turn), flat * math.sin(turn), z

    def stepped(self, value: float, most: int) -> float:
        """Up to `most` floats away from `value`, in either direction."""
        steps = self._random.randint(-most, most)
        for _ in range(abs(steps)):
            value = math.nextafter(value, math.copysign(math.inf, steps))
        return value


@dataclass(frozen=True, slots=True)
class Family:
    """One kind of difficulty.

    name, title    for people and tables
    hard           what goes wrong there in the textbook's formula, in one sentence
    source         where the difficulty is known from
    draw           Dice -> (scene or numbers, x, y, note), or None where these numbers hold no such case
    refused        some or all cases are numbers without an image, which must be refused
    """

    name: str
    title: str
    hard: str
    source: str
    draw: Callable[[Dice], Drawn | None]
    refused: bool = False

    def cases(self, seed: int, count: int) -> tuple[Case, ...]:
        """`count` cases; case k is a function of the family's name, the seed and k."""
        return tuple(self._case(seed, number) for number in range(count))

    def _case(self, seed: int, number: int) -> Case:
        for attempt in range(MOST_ATTEMPTS):
            drawn = self.draw(Dice(self.name, seed, number, attempt))
            if drawn is None:
                continue
            made, x, y, note = drawn
            if isinstance(made, Scene):
                return Case(self.name, number, made, x, y, note)
            try:
                scene = made.scene()
            except SceneError:
                if not self.refused:
                    raise
                return Case(self.name, number, None, x, y, note, made)
            return Case(self.name, number, scene, x, y, note, made)
        raise AssertionError(f"{self.name}: no case in {MOST_ATTEMPTS} attempts from seed {seed}, number {number}")
