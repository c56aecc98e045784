"""Chunks: sets of a batch, planned, with their kernels and numbers, sorted into lots.

In: what a batch is asked for, the sets that wait. Out: `Chunk`: as many sets as fit into a bounded memory, or are made
ready in a bounded time, in lots that one kernel draws each. Sets that surely have the plan of one before them, but for
numbers and lists, are not planned: symrender_cg.run.alike for one sphere, symrender_cg.plan.stack for many.
Never here: an image.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from symrender_cg.lower.variants import Variant, variant
from symrender_cg.pipeline import pixel_size, planned
from symrender_cg.pipeline.kernels import kernel_of
from symrender_cg.plan.plan import Plan
from symrender_cg.plan.stack import EFFECTS, Weighed, effects_of, is_stackable, weigh
from symrender_cg.plan.stack_lists import decide
from symrender_cg.plan.stack_numbers import Stack
from symrender_cg.run.alike import inputs_for, rows_alike
from symrender_cg.run.certificate import Job
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.levels import MOST_SHININESS, drawn_as, job_of
from symrender_cg.run.lots import Lot, OwnLot, ProvedLot, SceneLot
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.parameters import Sets
from symrender_cg.run.ready import make_ready
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.scene_numbers import scene_numbers
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.sphere_lots import PlainLot, SettlingLot
from symrender_cg.run.stack_structures import structures_of
from symrender_cg.run.stacking import stack_of
from symrender_cg.run.steep import boxes_drawn
from symrender_cg.run.target import named
from symrender_cg.run.threads import MOST_PIXELS
from symrender_cg.scene import Scene

MOST_SETS = 4096
"""Sets whose numbers are made ready before they are drawn."""

MOST_ENTRIES = 1 << 17
"""Surfaces, lamps and blockers of all scenes of a chunk: the C's tables of them take some 300 bytes each."""

MOST_PAIRS = 1 << 19
"""Pairs of spheres that are looked at together in the scenes of a stack."""

_AS_PIXELS = 16
"""A pixel that is enclosed takes the memory of so many that are not."""

_NO_BOX = np.full((1, 4), np.nan)

L = TypeVar("L", bound=Lot)


@dataclass(frozen=True)
class Asked:
    """The arguments of render_batch, checked."""

    sets: Sets
    width: int
    height: int
    accuracy: str
    target: str | None
    clip: bool
    threads: int | None
    portable: bool
    cache: str | Path | None

    @property
    def pixels(self) -> int:
        """Of an image."""
        return self.width * self.height

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.width / self.height

    @property
    def settles(self) -> bool:
        """Whether the level proves its values."""
        return variant(self.accuracy, self.target).settles is not None

    def job(self, scene: Scene) -> Job | None:
        """See symrender_cg.run.levels."""
        options: dict[str, Any] = {"portable": self.portable, "cache": self.cache, "threads": self.threads}
        return job_of(scene, self.accuracy, self.target, clip=self.clip, aspect=self.aspect, **options)

    def planned(self, scene: Scene) -> Plan:
        """The plan of a set for the images."""
        return planned(scene, aspect=self.aspect)

    def kernel(self, found: Plan, chosen: Variant) -> Kernel | SceneKernel:
        """The kernel of a plan."""
        return kernel_of(found, chosen, bake=False, portable=self.portable, cache=self.cache)


@dataclass
class Waiting:
    """The sets that are still to be drawn.

    ahead    how many of them are looked at together: as many as before were found alike, and some
    base     a scene of many surfaces and its plan, that sets are compared with
    """

    sets: deque[int]
    ahead: int = MOST_SETS
    base: tuple[Scene, Plan] | None = None

    def some(self, most: int) -> list[int]:
        """The next sets, at least one."""
        return list(islice(self.sets, max(1, min(most, self.ahead))))

    def take(self, looked_at: Sequence[int], taken: Sequence[int]) -> None:
        """Some of the sets that were looked at are made ready; the others are still to be drawn."""
        gone = set(taken)
        for _ in looked_at:
            self.sets.popleft()
        self.sets.extendleft(index for index in reversed(looked_at) if index not in gone)
        self.ahead = 16 + 4 * len(gone)


@dataclass
class Chunk:
    """Sets made ready, in lots.

    scenes   of those sets that are planned or asked for
    pixels   in the memory of lots that note what they leave open; entries: see MOST_ENTRIES
    """

    lots: dict[object, Lot] = field(default_factory=dict)
    scenes: dict[int, Scene] = field(default_factory=dict)
    pixels: int = 0
    entries: int = 0

    @property
    def is_full(self) -> bool:
        """Whether no set more is to be made ready before these are drawn."""
        return self.pixels >= MOST_PIXELS or self.entries >= MOST_ENTRIES or len(self.scenes) >= MOST_SETS

    def scene(self, sets: Sets, index: int) -> Scene:
        """The scene of a set, made once."""
        found = self.scenes.get(index)
        if found is None:
            found = self.scenes[index] = sets.scene(index)
        return found

    def lot(self, key: object, kind: type[L], *arguments: Any) -> L:
        """The lot of that key, begun where there is none."""
        found = self.lots.get(key)
        if found is None:
            made = kind(*arguments)
            self.lots[key] = made
            return made
        assert isinstance(found, kind)
        return found


def make_chunk(asked: Asked, waiting: Waiting, seconds: float) -> Chunk:
    """Sets that wait, made ready for about so many seconds. Raises what render_image raises for one of them, with the
    number of the set."""
    chunk, begun = Chunk(), time.monotonic()
    while waiting.sets and not chunk.is_full:
        with named(waiting.sets[0]):
            _add(chunk, asked, waiting)
        if time.monotonic() - begun > seconds:
            break
    return chunk


def _add(chunk: Chunk, asked: Asked, waiting: Waiting) -> None:
    """Adds the next set, and those after it that surely are drawn as it is, to their lots."""
    if _add_stack(chunk, asked, waiting):
        return
    index = waiting.sets[0]
    scene = chunk.scene(asked.sets, index)
    if asked.pixels > MOST_PIXELS:
        waiting.sets.popleft()
        chunk.lots[index] = _own(asked, index, scene)
        chunk.pixels += asked.pixels
        return
    found = asked.planned(scene)
    job = asked.job(scene)
    if found.arrangement is not None and is_stackable(scene, found):
        waiting.base = scene, found
        if _add_stack(chunk, asked, waiting):
            return
        waiting.base = None
    if job is not None and found.arrangement is not None:
        waiting.sets.popleft()
        _add_proved(chunk, asked, [index])
        return
    kernel = asked.kernel(found, variant(drawn_as(scene, asked.accuracy)) if job is None else job.variant)
    if not isinstance(kernel, SceneKernel):
        _add_spheres(chunk, asked, waiting, kernel, found)
        return
    waiting.sets.popleft()
    arrangement = found.arrangement
    assert arrangement is not None, "a kernel of scenes is for plans with an arrangement"
    made, keeps = kernel.structures([scene_numbers(found.scene, arrangement, kernel.channels)])
    _add_scenes(chunk, asked, kernel, [index], made, keeps, [pixel_size(found.scene, asked.height)])
    entries = len(arrangement.spheres) + len(arrangement.lamp_light) + len(arrangement.blockers)
    chunk.entries += entries + len(arrangement.mirrors) + len(arrangement.partners)


def _own(asked: Asked, index: int, scene: Scene) -> OwnLot:
    made = make_ready(
        scene,
        asked.width,
        asked.height,
        asked.accuracy,
        asked.target,
        clip=asked.clip,
        threads=asked.threads,
        portable=asked.portable,
        cache=asked.cache,
    )
    return OwnLot([index], made)


def _add_stack(chunk: Chunk, asked: Asked, waiting: Waiting) -> bool:
    """Adds the next sets that are seen to have the plan that sets are compared with, or one that differs in what lights
    and shadows add alone; False where the next one is not."""
    if waiting.base is None or len(waiting.sets) < 2:  # a plan is as soon made as the arrays of one set
        return False
    scene, found = waiting.base
    pairs = len(scene.spheres) ** 2 + 1
    pixels = asked.pixels * (_AS_PIXELS if asked.settles else 1)
    room = (MOST_PIXELS - chunk.pixels) // pixels, MOST_PAIRS // pairs
    looked_at = waiting.some(min(room))
    read = stack_of(scene, asked.sets, looked_at)
    if read is None or read[1][0] != looked_at[0]:
        return False
    stack, members = read
    weighed = weigh(found, stack, _of_one_level(asked, scene, stack))
    if not weighed.alike[0]:
        return False
    if asked.settles:
        taken = [members[k] for k in np.flatnonzero(weighed.alike).tolist()]
        _add_proved(chunk, asked, taken)
    else:
        taken = _add_weighed(chunk, asked, members, scene, found, weighed)
    waiting.take(looked_at, taken)
    return bool(taken)


def _add_weighed(
    chunk: Chunk, asked: Asked, sets: Sequence[int], scene: Scene, found: Plan, weighed: Weighed
) -> list[int]:
    """Adds the sets that are alike to the lots of their kernels: one for each set of effects that occurs."""
    arrangement = found.arrangement
    assert arrangement is not None, "scenes are compared with one that has an arrangement"
    taken: list[int] = []
    for effects in np.unique(weighed.effects[weighed.alike]).tolist():
        chosen = np.flatnonzero(weighed.alike & (weighed.effects == effects))
        members = [sets[k] for k in chosen.tolist()]
        other = found
        if effects != effects_of(found):
            with named(members[0]):
                other = asked.planned(chunk.scene(asked.sets, members[0]))
            if effects_of(other) != effects or not other.flags ^ found.flags <= set(EFFECTS):
                continue
        kernel = asked.kernel(other, variant(drawn_as(scene, asked.accuracy)))
        assert isinstance(kernel, SceneKernel), "it has the spheres of a scene"
        decided = decide(weighed, chosen)
        same = scene_numbers(found.scene, arrangement, kernel.channels)
        made, keeps = structures_of(kernel, found.scene, same, weighed.stack, decided)
        sides = 2.0 * weighed.stack.half_height[chosen] / asked.height
        _add_scenes(chunk, asked, kernel, members, made, keeps, sides.tolist())
        chunk.entries += len(decided.spheres) + len(decided.lamp_light) + len(decided.blockers.members)
        chunk.entries += len(decided.mirrors.members) + len(decided.partners.members)
        taken += members
    return taken


def _add_proved(chunk: Chunk, asked: Asked, sets: Sequence[int]) -> None:
    chunk.lot("proved", ProvedLot).sets.extend(sets)
    chunk.pixels += len(sets) * _AS_PIXELS * asked.pixels


def _add_scenes(
    chunk: Chunk,
    asked: Asked,
    kernel: SceneKernel,
    sets: Sequence[int],
    structures: NDArray[Any],
    keeps: Any,
    pixels: Sequence[float],
) -> None:
    lot = chunk.lot(kernel, SceneLot, kernel)
    lot.sets += sets
    lot.structures.append(structures)
    lot.keeps.append(keeps)
    lot.pixels += pixels
    chunk.pixels += len(sets) * asked.pixels


def _of_one_level(asked: Asked, scene: Scene, stack: Stack) -> NDArray[np.bool_]:
    """(T,): the level's kernel is that of the scene, see symrender_cg.run.levels.drawn_as."""
    steep = np.asarray((stack.shininess > MOST_SHININESS).any(axis=1))
    is_steep = drawn_as(scene, "fast") != "fast"
    return np.asarray((steep == is_steep) | (asked.accuracy != "fast"), dtype=np.bool_)


def _add_spheres(chunk: Chunk, asked: Asked, waiting: Waiting, kernel: Kernel, found: Plan) -> None:
    sets, settles = asked.sets, isinstance(kernel, SettlingKernel)
    looked_at = waiting.some((MOST_PIXELS - chunk.pixels) // asked.pixels if settles else MOST_SETS)
    scene = chunk.scene(sets, looked_at[0])
    inputs = inputs_for(scene, sets, looked_at)
    first = numbers_of(found.scene)
    names, boxed = tuple(first), asked.accuracy == "double" and not settles
    if inputs:
        alike = rows_alike(scene, found, inputs, asked.accuracy, names, handed=settles, boxed=boxed)
        numbers, pixels, edges = alike.numbers, 2.0 * alike.half_heights / asked.height, alike.edges
    else:
        numbers, pixels = np.array([[*first.values()]]), np.array([pixel_size(found.scene, asked.height)])
        edges = boxes_drawn({name: np.array([value]) for name, value in first.items()}) if boxed else _NO_BOX
    taken = looked_at[: len(numbers)]
    lot = chunk.lot(kernel, SettlingLot if settles else PlainLot, kernel, names)
    lot.add(taken, numbers, pixels)
    open_images = len(taken)
    if isinstance(lot, PlainLot):
        open_images = int(np.count_nonzero(~np.isnan(edges[:, 0])))
        lot.edges.append(edges)
        lot.stable = lot.stable or (_stable(asked, found) if open_images else None)
    chunk.pixels += open_images * asked.pixels
    waiting.take(looked_at, taken)


def _stable(asked: Asked, found: Plan) -> SettlingKernel:
    kernel = asked.kernel(found, variant("stable"))
    assert isinstance(kernel, SettlingKernel), "it bounds its own error"
    return kernel
