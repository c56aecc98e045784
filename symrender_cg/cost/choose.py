"""`choose`: the fastest variant on this machine whose bound meets what is asked for, or an error that says why not.

Comes in: a Scene and one of max_error, max_ulp, bits. Goes out: Choice, with everything that was considered. Never done
here: drawing the image.

    max_error   absolute, on the unclipped field
    max_ulp     units in the last place of the result's format: float64, or what `dtype` says
    bits        half a step of so many bits, 0.5 / (2^bits - 1), on the image cut to [0, 1]

A bound is *proved* for `stable` and `certified`, whatever the scene. For the others it is *measured*: the largest error
against the oracle over POINTS points of the window and hard points of the scene (both sides of outlines; terminator and
highlight of one sphere; places on every surface), times MARGIN (in ulp ULP_MARGIN), and never below MARGIN units in the
last place of the brightest value seen. Where the image jumps (edges of shadows, tiles, mirrored and intersecting
surfaces, gated highlights) a float32 kernel takes the other side within some 1e-7 of an edge, which no sample of points
bounds: of what is not proved such scenes are drawn by `double` alone. And where `double` hands over to `stable`, no
kernel stands in for it that would not.

What proves its values costs more than what does not, so it is compiled and timed only if nothing else meets the bound,
or if `proved` asks for it. Times are kept for a plan, errors for a scene; a second call looks both up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import DTypeLike

from symrender_cg.build.cache import Cache
from symrender_cg.cost import store
from symrender_cg.cost.bounds import proved_bounds
from symrender_cg.cost.ready import drawer, field_of, make_ready
from symrender_cg.cost.sample import draw_sample, errors_of
from symrender_cg.cost.timing import interleaved
from symrender_cg.cost.variants import DEFAULT, Way, way_of
from symrender_cg.errors import AccuracyError, ArgumentError, OutsidePlanError
from symrender_cg.pipeline import planned, recipe_of, require_kind
from symrender_cg.plan.plan import Plan, require_format
from symrender_cg.run.levels import hands_over, job_of
from symrender_cg.scene import Scene, load_scene

MARGIN: Final = 4.0
ULP_MARGIN: Final = 8.0
"""Errors in ulp have a longer tail: a value near 0 that no sample found has many of them."""
POINTS: Final = 1000
HARD: Final = 250
SEED: Final = 20_240_501
ROUNDS: Final = 5
TIMED: Final = (256, 256)
MEASURED: Final = (
    *("fast_fused", "fast", "fast_own_fused", "fast_own"),
    *("single_fused", "single", "double_complement", "double_fused", "double"),
)
"""What has no proved bound and may yet be chosen: of the fronts of the built-in scenes, and the levels themselves."""
PROVED: Final = ("certified float32", "stable", "certified float64")

JUMPS: Final = frozenset({"intersections", "crossing", "checker", "specular_gate", "shadows", "mirrors"})
"""Flags of a plan whose image has edges that no exact test decides at every level."""

Unit = Literal["absolute", "ulp"]
Kind = Literal["proved", "measured"]


class Considered(msgspec.Struct, frozen=True):
    """A variant that was looked at: its time, its bound in the unit that was asked for, and whether that is enough."""

    way: str
    result: str
    kind: Kind
    bound: float
    meets: bool
    ns: float | None = None


@dataclass(frozen=True, slots=True)
class Choice:
    """What render_image and evaluate draw with: `accuracy`, `target` as they take them.

    asked       the request in words
    unit        of the bound: absolute, or ulp of the result's format
    kind        proved, or measured with a margin
    ns          nanoseconds a pixel on one thread, as it was timed for this plan
    considered  everything that was looked at, in the order of its cost
    """

    asked: str
    way: str
    accuracy: str
    target: str | None
    bound: float
    unit: Unit
    kind: Kind
    ns: float | None
    considered: tuple[Considered, ...]

    def __str__(self) -> str:
        unit = "" if self.unit == "absolute" else " ulp"
        margin = MARGIN if self.unit == "absolute" else ULP_MARGIN
        how = "proved" if self.kind == "proved" else f"measured, times a margin of {margin:g}"
        return f"{self.asked}: `{self.way}`, bound {self.bound:.2g}{unit} ({how}), {self.ns:.2f} ns a pixel"


def choose(
    scene: Scene | str | Path | None = None,
    *,
    max_error: float | None = None,
    max_ulp: float | None = None,
    bits: float | None = None,
    proved: bool = False,
    dtype: DTypeLike | None = None,
    reach: float = 1.0,
    flags: bool = True,
    cache: str | Path | None = None,
) -> Choice:
    """The fastest variant that meets max_error, max_ulp or bits; exactly one of them is given.

    proved   take a proved bound and no measured one
    dtype    the format of the result: float32 or float64; any for max_error and bits, float64 for max_ulp, if left out
    reach    half-heights of the window that points may be away from its middle, for `evaluate`
    flags    take also variants that are compiled with flags of their own; without them for C that others compile

    Raises AccuracyError (exit code 4) with the reason where no variant meets it, ArgumentError for a request that is
    none.
    """
    asked, limit, unit = _request(max_error, max_ulp, bits)
    wanted = None if dtype is None else np.dtype(dtype).name
    if wanted not in (None, "float32", "float64"):
        raise ArgumentError(f"dtype: {wanted} holds no intensities; expected float32 or float64")
    if unit == "ulp" and wanted is None:
        wanted = "float64"
    chosen = load_scene(scene)
    considered: list[Considered] = []
    for tier in (PROVED,) if proved else (MEASURED, PROVED):
        every = [way for name in tier if (way := _possible(chosen, name)) is not None]
        ways = [way for way in every if wanted in (None, way.variant.result) and (flags or not way.variant.flags)]
        bounds = _bounds(chosen, ways, reach, cache)
        meets = {name: bound.of(unit) <= limit and (bound.proved or not proved) for name, bound in bounds.items()}
        times = _times(chosen, every, cache) if any(meets.values()) else {}
        for way in ways:
            bound = bounds[way.name]
            kind: Kind = "proved" if bound.proved else "measured"
            seen = Considered(way.name, way.variant.result, kind, bound.of(unit), meets[way.name], times.get(way.name))
            considered.append(seen)
        if any(meets.values()):
            best = min((name for name in meets if meets[name]), key=lambda name: times[name])
            return _choice(asked, unit, best, considered)
    raise AccuracyError(_refusal(asked, limit, unit, considered, proved=proved))


def _request(max_error: float | None, max_ulp: float | None, bits: float | None) -> tuple[str, float, Unit]:
    given = [(n, v) for n, v in (("max_error", max_error), ("max_ulp", max_ulp), ("bits", bits)) if v is not None]
    if len(given) != 1:
        names = ", ".join(name for name, _ in given) or "none"
        raise ArgumentError(f"max_error, max_ulp, bits: {names} given; expected exactly one of them")
    name, value = given[0]
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0.0 < value < math.inf:
        raise ArgumentError(f"{name}: {value!r}; expected a finite number above 0")
    number = float(value)
    if name == "bits" and not 1.0 <= number <= 1000.0:
        raise ArgumentError(f"bits: {value!r}; expected a number of bits from 1 to 1000")
    limit = 0.5 / (2.0**number - 1.0) if name == "bits" else number
    return f"{name}={number:g}", limit, "ulp" if name == "max_ulp" else "absolute"


def jumps(found: Plan) -> bool:
    """Whether the image of a plan has edges that are no sphere's outline."""
    if found.arrangement is None:
        return found.needs("specular_gate")
    return bool(found.flags & JUMPS)


def _possible(scene: Scene, name: str) -> Way | None:
    """The way of that name if the scene has such a kernel and its bound can be told."""
    way = way_of(name)
    found = planned(scene)
    if not way.variant.settles and name != DEFAULT and (jumps(found) or hands_over(scene)):
        return None
    try:
        require_kind(found, way.variant, bake=False)
        require_format(found, way.variant.shading)
    except (ArgumentError, OutsidePlanError):
        return None
    return way


def _choice(asked: str, unit: Unit, best: str, considered: list[Considered]) -> Choice:
    way = way_of(best)
    entry = next(entry for entry in considered if entry.way == best)
    return Choice(asked, best, way.accuracy, way.target, entry.bound, unit, entry.kind, entry.ns, tuple(considered))


def _refusal(asked: str, limit: float, unit: Unit, considered: list[Considered], *, proved: bool) -> str:
    if not considered:
        return f"{asked}: no variant of this scene gives results of that format; leave `dtype`, or `out`, as it is"
    best = min(considered, key=lambda entry: entry.bound)
    word = "ulp" if unit == "ulp" else "absolute"
    how = "proved" if best.kind == "proved" else "measured with its margin"
    only = " that is proved" if proved else ""
    return (
        f"{asked}: no variant{only} has a bound of {limit:.3g} {word} on this scene; the nearest is {best.way!r} with "
        f"{best.bound:.3g} ({how}); ask for that much, or let certify() name what is left"
    )


# ------------------------------------------------------------------------------------------------------------- bounds


@dataclass(frozen=True, slots=True)
class _Bound:
    absolute: float
    ulp: float
    proved: bool

    def of(self, unit: Unit) -> float:
        return self.absolute if unit == "absolute" else self.ulp


def _bounds(scene: Scene, ways: list[Way], reach: float, cache: str | Path | None) -> dict[str, _Bound]:
    """The bound of each way: proved, also of `double` where it hands over, or measured."""
    proofs = {way.name: _proof(scene, way) for way in ways}
    measured = _measured(scene, tuple(name for name, proof in proofs.items() if proof is None), reach, cache)
    return {
        name: _Bound(*measured[name], proved=False) if proof is None else _Bound(*proof, proved=True)
        for name, proof in proofs.items()
    }


def _proof(scene: Scene, way: Way) -> tuple[float, float] | None:
    job = None if way.choices else job_of(scene, way.level, way.target, clip=False)
    return proved_bounds(scene, way.variant if job is None else job.variant)


def _measured(
    scene: Scene, names: tuple[str, ...], reach: float, cache: str | Path | None
) -> dict[str, tuple[float, float]]:
    """(absolute, ulp) of each way, margin included; what is missing is measured and kept."""
    if not names:
        return {}
    key = _scene_key(scene, reach)
    known: dict[str, tuple[float, float]] = dict(_remembered(key, None if cache is None else str(cache)))
    if missing := [name for name in names if name not in known]:
        known |= _measure(scene, [way_of(name) for name in missing], reach, cache)
        store.write("errors", key, msgspec.json.encode(known), root=cache)
        _remembered.cache_clear()
    return known


@lru_cache(maxsize=64)
def _remembered(key: str, cache: str | None) -> dict[str, tuple[float, float]]:
    kept = store.read("errors", key, root=cache)
    try:
        return {} if kept is None else msgspec.json.decode(kept, type=dict[str, tuple[float, float]])
    except msgspec.DecodeError:
        return {}


@lru_cache(maxsize=64)
def _scene_key(scene: Scene, reach: float) -> str:
    text = msgspec.json.encode(scene).decode()
    return f"{recipe(scene)} {MARGIN} {ULP_MARGIN} {POINTS} {HARD} {SEED} {reach} {text}"


def _measure(scene: Scene, ways: list[Way], reach: float, cache: str | Path | None) -> dict[str, tuple[float, float]]:
    """The margin times the largest error of each way on the sample, not below that of one unit in the last place."""
    build(scene, ways, cache)
    size = TIMED
    sample = draw_sample(scene, size, POINTS, HARD, SEED, reach=reach)
    top = float(np.abs(sample.truth.value).max(initial=0.0))
    found = {}
    for way in ways:
        errors = errors_of(field_of(way, scene, size, cache=cache), sample)
        unit = float(np.spacing(np.asarray(top, way.variant.result)))
        wrong = errors.flips + errors.nonfinite > 0
        absolute = math.inf if wrong else MARGIN * max(errors.largest, unit)
        found[way.name] = (absolute, math.inf if wrong else ULP_MARGIN * max(errors.ulp, 0.5))
    return {name: (min(a, _LARGEST), min(b, _LARGEST)) for name, (a, b) in found.items()}


_LARGEST: Final = 1e300
"""Stands for no bound at all: JSON has no infinity."""


# -------------------------------------------------------------------------------------------------------------- times


def build(scene: Scene, ways: list[Way], cache: str | Path | None) -> None:
    """Compiles what the cache lacks, side by side."""
    kernels, found = Cache(cache), planned(scene)
    missing = [
        way
        for way in ways
        if not way.variant.settles
        and kernels.recall(recipe_of(found, way.variant.key, (), portable=False), extra_flags=way.variant.flags) is None
    ]
    if len(missing) > 1:
        make_ready(missing, scene, TIMED, cache=cache)


def _times(scene: Scene, ways: list[Way], cache: str | Path | None) -> dict[str, float]:
    """Nanoseconds a pixel of each way, the least of its rounds; kept for the plan and the number of spheres and lights.

    The least: a round that something else disturbed must not decide what is drawn with from then on.
    """
    key = [recipe(scene), len(scene.spheres), len(scene.lights), *(way.name for way in ways)]
    kept = store.read("times", key, root=cache)
    if kept is not None:
        try:
            return msgspec.json.decode(kept, type=dict[str, float])
        except msgspec.DecodeError:
            pass
    samples = np.asarray(interleaved([drawer(way, scene, TIMED, cache=cache) for way in ways], ROUNDS, SEED))
    least: Any = np.nanmin(samples, axis=1) * (1e9 / (TIMED[0] * TIMED[1]))
    found = {way.name: float(time) for way, time in zip(ways, least, strict=True)}
    store.write("times", key, msgspec.json.encode(found), root=cache)
    return found


def recipe(scene: Scene) -> str:
    """What the kernels of a scene depend on: plan, compiler, version of this package."""
    toolchain = Cache().toolchain()
    return recipe_of(planned(scene), f"cost {toolchain.version}", (), portable=False)
