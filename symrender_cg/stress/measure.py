"""One level on hard cases: its values, its hits and misses, and how far both are from the truth.

Comes in: scenes and points, the name of a level, the truth. Goes out: Outcomes. Never done here: a verdict.

Hit or miss is read off a background that no surface has: a miss is where the value is that of the background. The field
itself is that of the scene as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import structs

from symrender_cg.errors import AccuracyError, ArgumentError, OutsidePlanError, SymrenderError
from symrender_cg.lower.variants import ACCURACIES, TARGETS
from symrender_cg.run.render import evaluate
from symrender_cg.scene import Colour, Gradient, Phong, Scene
from symrender_cg.stress.cases import Case
from symrender_cg.stress.promises import PROMISES, Outcome
from symrender_cg.stress.truth import Truth, truth

Values: TypeAlias = npt.NDArray[Any]
Hits: TypeAlias = npt.NDArray[np.bool_]
MARKER: Final = 7.0
ROUNDING: Final = "certified"
"""The level that has targets."""


@lru_cache(maxsize=1)
def levels() -> tuple[str, ...]:
    """Every level that `evaluate` knows, the cheapest first; `certified` rounds to float64, and there is one more for
    each of its other targets, `certified:float32` and `certified:uint8`."""
    names: list[str] = []
    for name in dict.fromkeys((*PROMISES, *ACCURACIES)):
        if name in ACCURACIES:
            names.append(name)
        if name == ROUNDING and name in ACCURACIES:
            names += [f"{name}:{target}" for target in TARGETS if target != "float64"]
    return tuple(names)


def evaluate_at(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike, level: str) -> Values:
    """`evaluate` at a level of `levels()`."""
    name, _, target = level.partition(":")
    values: Values = evaluate(scene, x, y, accuracy=name, target=target or None)
    return values


def chosen_levels(names: Iterable[str]) -> tuple[str, ...]:
    """These levels in the order of their cost, each once; all for no name. Raises ArgumentError for an unknown one."""
    wanted = tuple(names)
    for name in wanted:
        if name not in levels():
            raise ArgumentError(f"level: {name!r} is not known; expected one of {', '.join(map(repr, levels()))}")
    return tuple(name for name in levels() if not wanted or name in wanted)


# ------------------------------------------------------------------------------------------------------------- a level


def look(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike, level: str) -> tuple[Values, Hits | None]:
    """(values, hits) of a level at n points: (n, channels) in the level's own format, and (n,), None of bytes."""
    u, v = (np.ravel(np.asarray(values, dtype=np.float64)) for values in (x, y))
    coded, same = _before_marker(scene)
    found = evaluate_at(coded, u, v, level).reshape(u.size, -1)
    if found.dtype == np.uint8:
        return evaluate_at(scene, u, v, level).reshape(u.size, -1), None
    hit = (found != MARKER).any(axis=1)
    if not same:
        return evaluate_at(scene, u, v, level).reshape(u.size, -1), hit
    values = found.copy()
    values[~hit] = 0
    return values, hit


def _before_marker(scene: Scene) -> tuple[Scene, bool]:
    """The scene before the marker, and whether its surfaces have the same values there.

    Where something is mirrored the background is seen in it; then every surface gets 1 more of ambient light, so that
    no mirror shows the marker as it is.
    """
    materials = [sphere.material for sphere in scene.spheres]
    if scene.plane is not None:
        materials += [m for m in (scene.plane.material, scene.plane.checker) if m is not None]
    mirrors = scene.max_bounces > 0 and any(material.reflect > 0.0 for material in materials)
    if not mirrors:
        same = not isinstance(scene.background, Gradient) and scene.background == 0.0
        return structs.replace(scene, background=MARKER), same
    plane = scene.plane
    if plane is not None:
        checker = plane.checker if plane.checker is None else _brighter(plane.checker)
        plane = structs.replace(plane, material=_brighter(plane.material), checker=checker)
    spheres = tuple(structs.replace(sphere, material=_brighter(sphere.material)) for sphere in scene.spheres)
    return structs.replace(scene, spheres=spheres, plane=plane, background=MARKER), False


def _brighter(material: Phong) -> Phong:
    def more(colour: Colour) -> Colour:
        return (colour[0] + 1.0, colour[1] + 1.0, colour[2] + 1.0) if isinstance(colour, tuple) else colour + 1.0

    return structs.replace(material, ambient=more(material.ambient))


# --------------------------------------------------------------------------------------------------------- the errors


def compare(values: Values, hit: Hits | None, true: Truth) -> tuple[Outcome, ...]:
    """One Outcome a point; of several channels the worst. Of bytes the unit in the last place is a grey level."""
    if values.dtype == np.uint8:
        return _compare_bytes(values, true)
    assert hit is not None, "values in floating point come with hits"
    single = values.dtype == np.float32
    answer = true.value32 if single else true.value
    finite = np.isfinite(values) & np.isfinite(answer)
    error = np.zeros(values.shape)
    np.subtract(values, true.value, out=error, where=finite, dtype=np.float64)
    np.subtract(error, true.residual, out=error, where=finite)
    np.abs(error, out=error)
    hit_flip = hit != true.hit
    zero_flip = ((values == 0) != (answer == 0)) & finite
    broken = np.isfinite(answer) & ~np.isfinite(values)
    with np.errstate(over="ignore", invalid="ignore"):
        ulp = np.where(finite & ~zero_flip, error / np.abs(np.spacing(answer)).astype(np.float64), 0.0)
    error[broken], ulp[broken] = math.inf, math.inf
    wrong = (values != answer) & ~(np.isnan(values) & np.isnan(answer))
    return tuple(
        Outcome(
            None,
            float(ulp[k].max()) if not hit_flip[k] else 0.0,
            float(error[k].max()),
            bool(hit_flip[k]),
            bool(zero_flip[k].any()),
            bool(broken[k].any()),
            bool(wrong[k].any()),
            float(np.abs(true.value[k]).max()),
        )
        for k in range(values.shape[0])
    )


def _compare_bytes(values: Values, true: Truth) -> tuple[Outcome, ...]:
    steps = np.abs(values.astype(np.int64) - true.value8.astype(np.int64)).astype(np.float64)
    error = np.abs(values / 255.0 - np.clip(true.value, 0.0, 1.0))
    zero_flip = (values == 0) != (true.value8 == 0)
    return tuple(
        Outcome(
            ulp=float(steps[k].max()),
            error=float(error[k].max()),
            zero_flip=bool(zero_flip[k].any()),
            wrong=bool(steps[k].any()),
            size=float(np.abs(true.value[k]).max()),
        )
        for k in range(values.shape[0])
    )


def outcome_of(case: Case, level: str, true: Truth | None) -> Outcome:
    """What a level makes of a case; `true` is its truth, None where the case must be refused."""
    if case.refused:
        return _refusal(case, level)
    assert case.scene is not None, "a case that is not refused has a scene"
    assert true is not None, "a case that is not refused has a truth"
    return outcomes_at(case.scene, [(case.x, case.y)], level, true)[0]


def outcomes_at(scene: Scene, points: list[tuple[float, float]], level: str, true: Truth) -> tuple[Outcome, ...]:
    """What a level makes of points of one scene; all of them are refused where one is."""
    try:
        values, hit = look(scene, [x for x, _ in points], [y for _, y in points], level)
    except (OutsidePlanError, AccuracyError) as refusal:
        return (Outcome(str(refusal)),) * len(points)
    return compare(values, hit, true)


def _refusal(case: Case, level: str) -> Outcome:
    """The refusal of what has no image; a value counts as one that is not finite."""
    try:
        scene = case.scene
        if scene is None:
            assert case.inputs is not None, "a case without a scene has the numbers of one"
            scene = case.inputs.scene()
        evaluate_at(scene, case.x, case.y, level)
    except SymrenderError as refusal:
        return Outcome(str(refusal))
    return Outcome(error=math.inf, ulp=math.inf, non_finite=True, wrong=True)


def truth_of(case: Case) -> Truth | None:
    """The truth of a case, None where it must be refused. Raises AccuracyError where the oracle leaves it open."""
    if case.refused:
        return None
    assert case.scene is not None, "a case that is not refused has a scene"
    return truth(case.scene, [case.x], [case.y])
