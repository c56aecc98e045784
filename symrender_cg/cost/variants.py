"""The ways to draw a scene: what a point on the chart of cost is.

Comes in: a Scene and the size of its image. Goes out: Ways, in an order that does not change. Never done here: a
compilation, a measurement.

    level       what a user names by `accuracy`
    choice      a level with some of its coordinates put elsewhere, see symrender_cg.lower.choices
    baked       a level or a choice with the scene's numbers folded in
    plan        a level whose plan leaves out more, within a tolerance
    general     `double` with effects forced in that the plan leaves out: what planning is compared with
    reference   numpy, or sympy's lambdify
    samples     several rays a pixel: the price of plain antialiasing
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, Literal

from symrender_cg.errors import ArgumentError, OutsidePlanError
from symrender_cg.lower.choices import CHOICES, chosen, named
from symrender_cg.lower.variants import ACCURACIES, TARGETS, Variant, variant
from symrender_cg.pipeline import planned, require_kind
from symrender_cg.plan.plan import Plan, require_format
from symrender_cg.scene import Scene

Kind = Literal["level", "choice", "baked", "plan", "general", "reference", "samples"]
Maker = Literal["native", "numpy", "lambdify"]

TOLERANCES: Final = (1e-2, 1e-3, 1e-4)
"""How much a plan may change a pixel, for ways of the kind `plan`."""
STARTS: Final = ("fast", "single", "double", "literal")
"""Levels that one kernel draws alone: where coordinates are moved."""
DEFAULT: Final = "double"


@dataclass(frozen=True, slots=True)
class Way:
    """One way to draw a scene.

    name       what tells it from the others: `double`, `certified uint8`, `double_fused`, `single baked`
    does       what sets it apart, in words
    level      the accuracy that it is, or starts from
    choices    the moves from there, in their order
    target     of `certified`
    bake       the scene's numbers are in the C
    force      effects that its plan keeps although they change nothing
    tolerance  how much its plan may change a pixel
    side       side x side rays a pixel, averaged
    """

    name: str
    kind: Kind
    does: str
    level: str
    choices: tuple[str, ...] = ()
    target: str | None = None
    bake: bool = False
    force: tuple[str, ...] = ()
    tolerance: float = 0.0
    side: int = 1
    maker: Maker = "native"
    cse: bool = False

    @property
    def variant(self) -> Variant:
        """What its kernel is lowered with."""
        if self.choices:
            found = named("_".join((self.level, *self.choices)))
            assert found is not None, "a way has choices that fit"
            return found
        return variant(self.level, self.target)

    @property
    def accuracy(self) -> str:
        """What `render_image` takes for it, beside `target` and `bake`."""
        return self.variant.name if self.choices else self.level


def named_ways(scene: Scene, size: tuple[int, int]) -> tuple[Way, ...]:
    """Levels, baked levels, plans, references and supersampling, as far as the scene can have them."""
    found = planned(scene, aspect=size[0] / size[1])
    alone = found.arrangement is None
    ways = [way for way in _levels() if _possible(found, way)]
    if alone:
        ways += [b for way in ways if (b := baked(way)) is not None and _possible(found, b)]
    ways += _plans(scene, found, size)
    ways.append(Way("numpy", "reference", "hand-written numpy, forms that do not cancel", DEFAULT, maker="numpy"))
    if alone:
        ways.append(Way("numpy literal", "reference", "numpy, the seed's formula", "literal", maker="numpy"))
        ways.append(Way("lambdify", "reference", "sympy.lambdify of the closed form", "literal", maker="lambdify"))
        words = "the same with cse=True"
        ways.append(Way("lambdify cse", "reference", words, "literal", maker="lambdify", cse=True))
    for level in ("fast", DEFAULT):
        words = f"{level}, four rays a pixel averaged"
        ways.append(Way(f"{level} 2x2", "samples", words, level, side=2))
    return tuple(ways)


def requestable(scene: Scene, *, bake: bool = False, aspect: float | None = None) -> tuple[Way, ...]:
    """What a request may be drawn with, of all the ways there are: every level and every combination of moves from it
    whose hits and misses are exact; with `bake` the same with the scene's numbers folded in; plans within a tolerance.

    Left out are references, supersampling, general plans, and what decides outlines in floating point.
    """
    found = planned(scene, aspect=aspect)
    known: dict[Variant, Way] = {}
    layer = [way for way in _levels() if way.variant.exact and _possible(found, way)]
    while layer:
        for way in layer:
            known.setdefault(nameless(way.variant), way)
        nearby = {nameless(one.variant): one for way in layer for one in moved(way, scene, (1, 1))}
        layer = [way for key, way in nearby.items() if key not in known and way.variant.exact]
    ways = list(known.values())
    if bake:
        ways += [one for way in ways if (one := baked(way)) is not None and _possible(found, one)]
    if found.arrangement is not None:
        ways += [way for way in _tolerant(scene, found, aspect) if way.variant.exact and _possible(found, way)]
    return tuple(ways)


def content(way: Way) -> object:
    """What tells ways apart that would be drawn the same: the variant but for its name, and how it is planned."""
    return nameless(way.variant), way.target, way.bake, way.force, way.tolerance, way.side, way.maker, way.cse


def nameless(given: Variant) -> Variant:
    """The variant without its name and promise: what tells apart kernels that differ."""
    return replace(given, name="", promise="")


@lru_cache(maxsize=256)
def way_of(name: str) -> Way:
    """The level or choice of that name: `double`, `certified float32`, `single_fused`. KeyError for another name."""
    level, *rest = name.split("_")
    start = next((way for way in _levels() if way.name == level), None)
    if start is None:
        raise KeyError(name)
    found = _with_choices(start, tuple(rest)) if rest else start
    if found is None:
        raise KeyError(name)
    return found


def moved(way: Way, scene: Scene, size: tuple[int, int]) -> tuple[Way, ...]:
    """Every way that is one move from a level or a choice; none for what is no kernel of its own."""
    found = planned(scene, aspect=size[0] / size[1])
    if way.kind not in ("level", "choice") or way.level not in STARTS:
        return ()
    taken = {_coordinate(name) for name in way.choices}
    ways = []
    for entry in CHOICES:
        if entry.coordinate in taken or (entry.alone and found.arrangement is not None):
            continue
        ways.append(_with_choices(way, (*way.choices, entry.name)))
    return tuple(one for one in ways if one is not None and _possible(found, one))


def _with_choices(way: Way, names: tuple[str, ...]) -> Way | None:
    """The way with these choices, in the order of the registry; None where they do not fit."""
    order = [entry.name for entry in CHOICES]
    names = tuple(sorted(names, key=order.index))
    if chosen_or_none(way.level, names) is None:
        return None
    does = "; ".join(entry.does for entry in CHOICES if entry.name in names)
    return replace(way, name="_".join((way.level, *names)), kind="choice", does=does, choices=names)


def combined(ways: Sequence[Way]) -> Way | None:
    """The moves of several ways of one level together; None where two of them are of one coordinate, or do not fit."""
    names = tuple(dict.fromkeys(name for way in ways for name in way.choices))
    if len({_coordinate(name) for name in names}) < len(names) or len({way.level for way in ways}) != 1:
        return None
    return _with_choices(ways[0], names)


def chosen_or_none(level: str, names: tuple[str, ...]) -> Variant | None:
    """The variant of a level with choices, each of which must change something."""
    for count in range(1, len(names) + 1):
        if chosen(level, *names[:count]) is None:
            return None
    return chosen(level, *names)


def baked(way: Way) -> Way | None:
    """The way with the scene's numbers folded in; None for a level that proves its values."""
    if way.variant.settles or way.kind not in ("level", "choice"):
        return None
    return replace(way, name=f"{way.name} baked", kind="baked", does="the scene's numbers folded in", bake=True)


def _levels() -> list[Way]:
    names = [name for name in ACCURACIES if name != "certified"]
    ways = [Way(name, "level", _promise(variant(name)), name) for name in names]
    for target in TARGETS:
        words = _promise(variant("certified", target))
        ways.append(Way(f"certified {target}", "level", words, "certified", target=target))
    return ways


def _promise(given: Variant) -> str:
    return given.promise.partition(";")[0].partition(" where ")[0].partition(":")[0]


def _plans(scene: Scene, found: Plan, size: tuple[int, int]) -> list[Way]:
    """The plan with effects forced in, and with what a tolerance leaves out, where that is another plan."""
    ways = []
    for effect, does in (("off_axis", "a sphere anywhere, though it is centred"), ("scene", "the loops of scenes")):
        if found.arrangement is None and not (effect == "off_axis" and found.needs("off_axis")):
            ways.append(Way(f"{DEFAULT} +{effect}", "general", does, DEFAULT, force=(effect,)))
    if found.arrangement is None:
        return [way for way in ways if _possible(found, way)]
    optional = [d.effect.name for d in found.summary if not d.needed and d.effect.optional]
    if optional:
        does = "all effects forced in that the plan leaves out"
        ways.append(Way(f"{DEFAULT} unplanned", "general", does, DEFAULT, force=tuple(optional)))
    ways += _tolerant(scene, found, size[0] / size[1])
    return [way for way in ways if _possible(found, way)]


def _tolerant(scene: Scene, found: Plan, aspect: float | None) -> list[Way]:
    """`fast` and `double` by the plans that leave out what is within a tolerance, where they leave out more."""
    ways = []
    for tolerance in TOLERANCES:
        less = planned(scene, aspect=aspect, max_error=tolerance)
        if less.bound > 0.0:
            does = f"leaves out what changes no pixel by more than {tolerance:g} (proved: {less.bound:.2g})"
            ways += [
                Way(f"{level} -{tolerance:g}", "plan", does, level, tolerance=tolerance) for level in ("fast", DEFAULT)
            ]
    return ways


def _possible(found: Plan, way: Way) -> bool:
    """Whether the scene has such a kernel."""
    try:
        require_kind(found, way.variant, bake=way.bake)
        require_format(found, way.variant.shading)
    except (ArgumentError, OutsidePlanError):
        return False
    return True


def _coordinate(name: str) -> str:
    return next(entry.coordinate for entry in CHOICES if entry.name == name)
