"""`python -m benchmarks promises`: whether bounds and requests keep what they say, on scenes that nothing saw.

Comes in: how many scenes of one sphere have their bounds compared, how many other scenes are asked ten requests each, a
seed. Goes out: Report: how many bounds were exceeded at points that did not make them, the share of its bound that the
worst used; how many requests were met, by measured and by proved bounds, how many were refused, how many were not kept.
Never done here: a time.

    bounds     each of WAYS, where `choose` may take it, at POINTS points of the window and HARD of each kind
    requests   REQUESTS, each at fewer such points; one scene in four has two to four spheres
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from random import Random
from typing import Any, Final

import numpy as np
from rich.console import Console

from benchmarks.machine import Machine, this_machine
from symrender_cg import Camera, DirectionalLight, Phong, PointLight, Scene, Sphere, choose, evaluate
from symrender_cg.cost.choose import Choice, jumps, measured_bound
from symrender_cg.cost.looking import Looking
from symrender_cg.cost.sample import draw_sample, errors_of
from symrender_cg.cost.variants import way_of
from symrender_cg.errors import AccuracyError
from symrender_cg.pipeline import planned
from symrender_cg.run.levels import hands_over
from symrender_cg.scene.random import random_spheres

SIZE: Final = (64, 64)
POINTS: Final = 1500
HARD: Final = 250
FEW_POINTS: Final = 300
FEW_HARD: Final = 40
WAYS: Final = (
    *("fast_coarse_fused", "fast_fused", "fast", "single_complement_fused", "single_complement", "single_fused"),
    *("fast_inner", "single_inner_fused", "single_inner", "single", "double_inner_fused", "double_inner"),
    *("double_complement_fused", "double_complement", "double_fused", "double"),
)
REQUESTS: Final[tuple[dict[str, Any], ...]] = (
    *({"max_error": error} for error in (1e-3, 1e-6, 1e-9, 1e-14, 1e-15)),
    *({"max_ulp": ulp} for ulp in (64.0, 4.0, 0.5)),
    *({"bits": bits} for bits in (8.0, 16.0)),
)


@dataclass(frozen=True)
class Report:
    """Shares are of the bound: 1 and below keeps it. `refused`: requests that nothing meets."""

    machine: Machine
    seed: int
    scenes: int
    bounds: int
    exceeded: tuple[str, ...]
    worst: float
    worst_ulp: float
    most: float
    most_ulp: float
    other_scenes: int
    requests: int
    kinds: dict[str, int]
    ways: dict[str, int]
    broken: tuple[str, ...]
    closest: float

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """A few lines."""
        console.print(self.machine.line(), highlight=False)
        console.print(
            f"{self.bounds:,} measured bounds of {len(WAYS)} ways in {self.scenes:,} scenes, seed {self.seed}: "
            f"{len(self.exceeded)} exceeded; the worst used {self.worst:.0%} of its bound ({self.worst_ulp:.0%} "
            f"of that in ulp), 99 of 100 less than {self.most:.0%} ({self.most_ulp:.0%})",
            *self.exceeded,
            highlight=False,
            sep="\n",
        )
        kinds = ", ".join(f"{count:,} {kind}" for kind, count in self.kinds.items())
        console.print(
            f"{self.requests:,} requests for {self.other_scenes:,} other scenes: {kinds}; {len(self.broken)} not kept; "
            f"the closest that rests on a measured bound used {self.closest:.0%} of it",
            *self.broken,
            highlight=False,
            sep="\n",
        )
        console.print("chosen: " + ", ".join(f"{name} {count}" for name, count in self.ways.items()), highlight=False)


def measure_promises(scenes: int, others: int, seed: int, told: Callable[[str], None]) -> Report:
    """`scenes` of one sphere for the bounds, `others` for the requests; every fourth of those has several spheres."""
    exceeded: list[str] = []
    shares: list[tuple[float, float]] = []
    for number in range(scenes):
        told(f"bounds of scene {number + 1} of {scenes}")
        for name, absolute, ulp in _shares(one_sphere(1_000_000 * seed + number), number):
            shares.append((absolute, ulp))
            if max(absolute, ulp) > 1.0:
                exceeded.append(f"scene {number}, {name}: {absolute:.2f} of its bound, {ulp:.2f} of that in ulp")
    kinds: Counter[str] = Counter()
    ways: Counter[str] = Counter()
    broken: list[str] = []
    closest = 0.0
    for number in range(others):
        told(f"requests for scene {number + 1} of {others}")
        of = 1_000_000 * seed + 500_000 + number
        scene = several(of) if number % 4 == 3 else one_sphere(of)
        for request in REQUESTS:
            try:
                found = choose(scene, **request)
            except AccuracyError:
                kinds["refused"] += 1
                continue
            kinds[found.kind] += 1
            ways[found.way] += 1
            share = _kept(scene, found, number)
            closest = max(closest, share if found.kind == "measured" else 0.0)
            if share > 1.0:
                broken.append(f"scene {number}, {found}: {share:.2f} of its bound")
    used = np.asarray(shares or [(0.0, 0.0)])
    worst, most = used.max(axis=0), np.quantile(used, 0.99, axis=0)
    return Report(
        machine=this_machine(),
        seed=seed,
        scenes=scenes,
        bounds=len(shares),
        exceeded=tuple(exceeded),
        worst=float(worst[0]),
        worst_ulp=float(worst[1]),
        most=float(most[0]),
        most_ulp=float(most[1]),
        other_scenes=others,
        requests=others * len(REQUESTS),
        kinds=dict(kinds.most_common()),
        ways=dict(ways.most_common()),
        broken=tuple(broken),
        closest=closest,
    )


def one_sphere(seed: int) -> Scene:
    """A sphere of any size, near or far, in the middle (every other seed) or not, with a light above the horizon."""
    random = Random(seed)
    radius = 10.0 ** random.uniform(-2.0, 2.0)
    distance = radius * (1.0 + 10.0 ** random.uniform(-1.0, 2.0))
    material = Phong(
        random.uniform(0.01, 0.3),
        random.uniform(0.1, 1.0),
        random.uniform(0.1, 1.0),
        10.0 ** random.uniform(0.0, 2.7),
    )
    center = (0.0, 0.0, 0.0)
    if seed % 2:
        center = (random.uniform(-0.5, 0.5) * radius, random.uniform(-0.5, 0.5) * radius, 0.0)
    away = np.array([random.gauss(0.0, 1.0) for _ in range(3)])
    away *= radius * (1.0 + 10.0 ** random.uniform(-1.0, 2.0)) / np.linalg.norm(away)
    away[2] = abs(away[2])
    x, y, z = (float(a + c) for a, c in zip(away, center, strict=True))
    light = PointLight((x, y, z), random.uniform(0.3, 1.5))
    return Scene(Camera((0.0, 0.0, distance + radius)), (Sphere(center, radius, material),), (light,))


def several(seed: int) -> Scene:
    """Two to four disjoint spheres; of every other one without shadows and gates, so that nothing jumps."""
    scene = random_spheres(2 + seed % 3, seed, shadows=bool(seed % 8 < 4))
    if seed % 8 < 4:
        return scene
    spheres = tuple(Sphere(s.center, s.radius, Phong(0.1, 0.6, 0.4, 20.0)) for s in scene.spheres)
    return Scene(scene.camera, spheres, (DirectionalLight((0.3, 0.4, 1.0)),), shadows=False)


def _shares(scene: Scene, number: int) -> list[tuple[str, float, float]]:
    """(way, largest error over its bound, the same in ulp) at points of another seed than those of the bound."""
    if jumps(planned(scene)) or hands_over(scene):
        return []
    bench = Looking(scene, reach=1.0, aspect=1.0, cache=None)
    ways = [way_of(name) for name in WAYS]
    if missing := [way for way in ways if way.name not in bench.errors]:
        bench.look(missing)
    sample = draw_sample(scene, SIZE, POINTS, HARD, 77 + number)
    found = []
    for way in ways:
        seen, result = bench.errors[way.name], way.variant.result
        fresh = errors_of(partial(evaluate, scene, accuracy=way.name), sample)
        absolute = measured_bound(seen, bench.top, result, 0.0, "absolute")
        ulp = measured_bound(seen, bench.top, result, 0.0, "ulp")
        if absolute < 1e100:
            wrong = math.inf if not fresh.sound else 0.0
            found.append((way.name, max(wrong, fresh.largest / absolute), max(wrong, fresh.ulp / ulp)))
    return found


def _kept(scene: Scene, found: Choice, number: int) -> float:
    """The largest error of what was chosen over its bound; inf where it flipped."""
    sample = draw_sample(scene, SIZE, FEW_POINTS, FEW_HARD, 99 + number)
    fresh = errors_of(lambda x, y: evaluate(scene, x, y, accuracy=found.accuracy, target=found.target), sample)
    if not fresh.sound:
        return math.inf
    return (fresh.largest if found.unit == "absolute" else fresh.ulp) / found.bound
