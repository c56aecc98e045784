"""What requests and `cost` measured and remember: times by plan, errors by scene, times of this machine, choices.

Comes in: keys and measurements. Goes out: the same, as it was kept in symrender_cg.cost.store. What is there already is
added to, so that one measurement serves every later request. Never done here: a measurement, a choice.

    times    of a plan on this machine, by way: ratio to `double`, and the nanoseconds a pixel of `double`
    errors   of a scene, by way: the largest error and that in ulp, no margin included; and the brightest value seen
    habits   of this machine, by way: the ratio to `double` that was measured last, whatever the plan
    choice   of a scene and a request

Two processes that write at once lose a measurement at most, which is then made again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final, TypeVar

import msgspec
from msgspec.structs import replace

from symrender_cg.build.cache import Cache
from symrender_cg.cost import store
from symrender_cg.pipeline import planned, recipe_of
from symrender_cg.scene import Scene
from symrender_cg.version import VERSION

Place = str | Path | None
Kept = TypeVar("Kept", bound=msgspec.Struct)

MOST: Final = 1e300
"""Stands for an error without end: JSON has no infinity."""


class Times(msgspec.Struct, frozen=True):
    """Ratios to `double` by the name of the way; unit: nanoseconds a pixel of `double` on one thread.

    built      kernels that requests had compiled for this plan, all together
    searched   how many runs of `cost` added to this: after one, the ways are known
    """

    unit: float = 0.0
    ratios: dict[str, float] = {}
    built: int = 0
    searched: int = 0

    def with_ratios(self, unit: float, ratios: Mapping[str, float]) -> Times:
        """The same with these ratios in place of older ones; the unit stays once it is known."""
        return replace(self, unit=self.unit or unit, ratios={**self.ratios, **ratios})


class Largest(msgspec.Struct, frozen=True):
    """The largest error of a way over a sample, absolute and in ulp; MOST where it flipped or was not finite."""

    absolute: float
    ulp: float


class ErrorsSeen(msgspec.Struct, frozen=True):
    """Errors by the name of the way; top: the brightest value of the samples, None where none was drawn."""

    top: float | None = None
    largest: dict[str, Largest] = {}


class Habits(msgspec.Struct, frozen=True):
    """Ratios to `double` by the name of the way."""

    ratios: dict[str, float] = {}


def times_of(scene: Scene, cache: Place) -> Times:
    """What is known of the plan of the scene, with as many spheres and lights."""
    return _read(Times, "times", _plan_key(scene), cache)


def keep_times(scene: Scene, found: Times, cache: Place) -> None:
    """Keeps them, and their ratios as habits of this machine."""
    store.write("times", _plan_key(scene), msgspec.json.encode(found), root=cache)
    key = _habits_key(scene)
    habits = {**_read(Habits, "habits", key, cache).ratios, **found.ratios}
    store.write("habits", key, msgspec.json.encode(Habits(habits)), root=cache)


def habits_of(scene: Scene, cache: Place) -> dict[str, float]:
    """What ways usually take on this machine: of one sphere, or of scenes."""
    return _read(Habits, "habits", _habits_key(scene), cache).ratios


def errors_seen(scene: Scene, what: str, cache: Place) -> ErrorsSeen:
    """What is known of the scene's errors; `what` names the points."""
    return _read(ErrorsSeen, "errors", _scene_key(scene, what), cache)


def keep_errors(scene: Scene, what: str, found: ErrorsSeen, cache: Place) -> None:
    """Keeps them."""
    store.write("errors", _scene_key(scene, what), msgspec.json.encode(found), root=cache)


def kept_choice(kind: type[Kept], scene: Scene, request: str, cache: Place) -> Kept | None:
    """What that request chose for the scene; None where it is not known."""
    kept = store.read("choice", _scene_key(scene, request), root=cache)
    try:
        return None if kept is None else msgspec.json.decode(kept, type=kind)
    except msgspec.DecodeError:
        return None


def keep_choice(scene: Scene, request: str, found: msgspec.Struct, cache: Place) -> None:
    """Keeps it."""
    store.write("choice", _scene_key(scene, request), msgspec.json.encode(found), root=cache)


def recipe(scene: Scene) -> str:
    """What the kernels of a scene depend on: plan, compiler, version of this package."""
    return recipe_of(planned(scene), f"cost {_compiler()}", (), portable=False)


def _read(kind: type[Kept], name: str, key: object, cache: Place) -> Kept:
    kept = store.read(name, key, root=cache)
    try:
        return kind() if kept is None else msgspec.json.decode(kept, type=kind)
    except msgspec.DecodeError:
        return kind()


def _compiler() -> str:
    return Cache().toolchain().version


def _plan_key(scene: Scene) -> list[object]:
    return [recipe(scene), len(scene.spheres), len(scene.lights)]


def _habits_key(scene: Scene) -> list[object]:
    return [VERSION, _compiler(), "one sphere" if planned(scene).arrangement is None else "scenes"]


@lru_cache(maxsize=64)
def _scene_key(scene: Scene, what: str) -> str:
    text = msgspec.json.encode(scene)
    return f"{recipe(scene)} {what} {hashlib.sha256(text).hexdigest()}"
