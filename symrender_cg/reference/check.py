"""The comparison that `check` prints: each evaluator against the oracle and against its float references.

Comes in: a Scene and how many points to look at. Goes out: Report, a row for each evaluator and set of points.
Never done here: printing, or a verdict on an accuracy that states no bound. Errors are those of the unclipped field.

Stated of levels that prove their values: 4 ulp (stable), half an ulp of float64 (certified). `double` is drawn by the
kernel of stable where plain float64 may be off by more than 1e-15, and then states what stable does as well.

Stated bounds of the others, on |value - truth|, u = 2^-53 for double and 2^-24 for single, n the shininess:

    u I (6 + 2 sqrt(n)) (1 + 1 / (4 d)),   I = max(1, ambient + intensity (diffuse + specular), background),
                                         d = the light's distance from the surface, in radii

and for fast that of single and 2^-11 I, where n <= 1000. The highlight's slope grows with sqrt(n), the direction of
the light with 1 / d. The constants are measured, not proved: over 1,000 random scenes (eye 1.01 to 10,000 radii away,
n to 100,000, d from 0.001 to 10,000; a 24 x 24 image and 120 points near each hard place) the largest errors were
these parts of the bound, and no hit or miss was wrong:

    accuracy    bound for Chapter 1's scene    largest error there    largest part of the bound, random scenes
    fast        6.4e-4                         7.2e-5                 0.18 (over 420 scenes, 60 points each)
    double      2.6e-15                        1.1e-15                0.56
    single      1.4e-6                         3.7e-7                 0.58
    literal     none                           0.61 (wrong hits)      -
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from msgspec import structs

from symrender_cg.lower.variants import ACCURACIES, variant
from symrender_cg.pipeline import draw, settling_kernel
from symrender_cg.plan.plan import plan
from symrender_cg.reference import camera_numbers, compare, decisions, hard_places, oracle, points
from symrender_cg.reference.check_rows import FAST_SHININESS, STATED_ULP, Report, Row
from symrender_cg.reference.per_pixel import evaluate_per_pixel
from symrender_cg.reference.points import Points
from symrender_cg.reference.vectorised import evaluate_vectorised
from symrender_cg.run import render
from symrender_cg.run.certificate import Job
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.levels import job_of
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Phong, PointLight, Scene

UNIT_ROUNDOFF = {"double": 2.0**-53, "single": 2.0**-24, "fast": 2.0**-24}
FAST_POWER = 2.0**-11
"""Part of the brightest value by which the powers of `fast` may be off."""

DOUBT = 32.0
"""How many roundings of a point may decide on which side of the terminator of a gated scene it is seen."""

PER_PIXEL_POINTS = 10_000
"""The per-pixel loop takes 15 us a point: of more points than these it computes every k-th."""

Form = Literal["stable", "literal"]
FORMS: tuple[Form, ...] = ("stable", "literal")
Floats = npt.NDArray[np.float64]
Values = npt.NDArray[np.float64] | npt.NDArray[np.float32]
Evaluator = Callable[[Scene, Floats, Floats], Values]


@dataclass(frozen=True, slots=True)
class Level:
    """An accuracy as it is drawn: its values, what it takes for a hit, whether it proves its values, and to what."""

    accuracy: str
    values: Evaluator
    hits: Callable[[Scene, Floats, Floats], npt.NDArray[np.bool_]]
    proved: bool
    bound_ulp: float | None


def stated_bound(scene: Scene, accuracy: str) -> float | None:
    """u I (6 + 2 sqrt(n)) (1 + 1 / (4 d)), see above; None for `literal`, for a light on the surface, for `fast` beyond
    its exponents, and for levels whose bound is in ulp."""
    unit = UNIT_ROUNDOFF.get(accuracy)
    frame = scene.in_camera_frame()
    sphere, light = frame.spheres[0], frame.lights[0]
    assert isinstance(light, PointLight), "a scene of one sphere under one point light"
    numbers = numbers_of(frame)
    away = math.dist(light.position, sphere.center) / sphere.radius
    distance = abs(away - 1.0)
    if unit is None or not distance > 0.0:
        return None
    lit = numbers["k_ambient"] + numbers["light_intensity"] * (numbers["k_diffuse"] + numbers["k_specular"])
    brightest = max(1.0, lit, numbers["background"])
    bound = unit * brightest * (6.0 + 2.0 * math.sqrt(numbers["shininess"])) * (1.0 + 0.25 / distance)
    if accuracy == "fast":
        bound = bound + FAST_POWER * brightest if numbers["shininess"] <= FAST_SHININESS else math.inf
    return bound if math.isfinite(bound) else None


def check(
    scene: Scene,
    *,
    width: int = 96,
    height: int = 96,
    count: int = 1000,
    seed: int = 1,
    accuracies: tuple[str, ...] | None = None,
    portable: bool = False,
) -> Report:
    """Compares the kernels of a scene and the float references with the oracle.

    On the pixel centres of a width x height image, and on `count` seeded points near each kind of hard place: the
    silhouette, the terminator and the highlight; for scenes see check_scene. accuracies: all that there are, if not
    given. Raises OutsidePlanError for a scene that no plan covers; never AccuracyError: see Report.require.
    """
    found = plan(scene)
    if found.arrangement is not None or found.scene is not found.given:
        exact = tuple(name for name in ACCURACIES if variant(name).exact) if accuracies is None else accuracies
        from symrender_cg.reference.check_scene import scene_rows

        rows = scene_rows(
            scene, width=width, height=height, count=count, seed=seed, accuracies=exact, portable=portable
        )
        return Report(width, height, {}, _by_evaluator(rows))
    frame = scene.in_camera_frame()
    levels = [_level(frame, accuracy, portable) for accuracy in accuracies or ACCURACIES]
    sets = {f"image {width}x{height}": points.whole_image(frame, width, height)}
    if count:
        sets["near silhouette"] = hard_places.near_silhouette(frame, count, seed)
        sets["near terminator"] = hard_places.near_terminator(frame, count, seed)
        sets["near highlight"] = hard_places.near_highlight(frame, count, seed)
    rows = []
    sampled: dict[str, int] = {}
    for where, (x, y) in sets.items():
        if x.size == 0:
            continue
        few = slice(None, None, -(-x.size // PER_PIXEL_POINTS))
        sampled[where] = x[few].size
        rows += _rows(frame, where, (x, y), few, levels)
    return Report(width, height, sampled, _by_evaluator(rows))


def _by_evaluator(rows: list[Row]) -> tuple[Row, ...]:
    """The rows of one evaluator together, in the order in which they begin."""
    order = {name: k for k, name in enumerate(dict.fromkeys(row.evaluator for row in rows))}
    return tuple(sorted(rows, key=lambda row: order[row.evaluator]))


def _rows(frame: Scene, where: str, where_points: Points, few: slice, levels: list[Level]) -> list[Row]:
    x, y = where_points
    answers = oracle.evaluate(frame, x, y)
    some = answers.at(few)
    references: dict[Form, Values] = {form: evaluate_vectorised(frame, x, y, form=form) for form in FORMS}
    loop = evaluate_per_pixel(frame, x[few], y[few])
    rows = []
    for level in levels:
        accuracy, values = level.accuracy, level.values(frame, x, y)
        bound = stated_bound(frame, accuracy)
        doubtful = np.zeros(values.shape, dtype=np.bool_)
        if not level.proved:
            doubtful = _in_doubt(frame, accuracy, (x, y), values, answers, bound)
        judged: Values = values.copy()
        judged[doubtful] = (answers.value32 if values.dtype == np.float32 else answers.value)[doubtful]
        row = _row(f"kernel {accuracy}", where, judged, answers, level.hits(frame, x, y), level.bound_ulp)
        by_numpy = references["literal" if accuracy == "literal" else "stable"]
        rows.append(
            replace(
                row,
                accuracy=accuracy,
                in_doubt=int(np.count_nonzero(doubtful)),
                from_numpy=_apart(values, by_numpy),
                from_per_pixel=_apart(values[few], loop),
                bound=bound,
            )
        )
    for form, values in references.items():
        hits = _hits(_by_numpy(form), frame, x, y)
        rows.append(_row(f"numpy {form}", where, values, answers, hits))
    rows.append(_row("per pixel", where, loop, some, _hits(evaluate_per_pixel, frame, x[few], y[few])))
    return rows


def _row(
    evaluator: str,
    where: str,
    values: Values,
    answers: oracle.Answers,
    hits: npt.NDArray[np.bool_],
    bound_ulp: float | None = None,
) -> Row:
    errors = compare.measure(values, answers)
    wrong = int(np.count_nonzero(hits != answers.hit))
    ulp = math.inf if bound_ulp is not None and errors.flips else errors.max_ulp
    return Row(evaluator, "", where, values.size, ulp, errors.max_abs, wrong, 0, errors.nonfinite, bound_ulp=bound_ulp)


def _in_doubt(
    frame: Scene, accuracy: str, where: Points, values: Values, answers: oracle.Answers, bound: float | None
) -> npt.NDArray[np.bool_]:
    """Points that miss the bound of a gated scene and whose exact n.l changes sign within DOUBT roundings of them.

    A rounding is u R (1 + 1 / (4 d)) at the sphere's depth, seen on the image plane.
    """
    doubtful = np.zeros(values.shape, dtype=np.bool_)
    numbers = camera_numbers.frame_numbers(frame)
    if bound is None or not numbers.gate_specular:
        return doubtful
    eye, depth = numbers.eye, numbers.eye - numbers.center[2]
    distance = abs(math.dist(numbers.light, numbers.center) / numbers.radius - 1.0)
    step = DOUBT * UNIT_ROUNDOFF[accuracy] * numbers.radius * (1.0 + 0.25 / distance) * eye / depth
    lit = decisions.exact_lit_test(numbers)
    with np.errstate(invalid="ignore", over="ignore"):
        missed = np.abs((values - answers.value) - answers.residual) > bound
    for index in np.flatnonzero(missed & answers.hit):
        x, y = float(where[0][index]), float(where[1][index])
        near = ((x + step, y), (x - step, y), (x, y + step), (x, y - step))
        doubtful[index] = len({lit(u, v, -eye) for u, v in ((x, y), *near)}) == 2
    return doubtful


def _level(frame: Scene, accuracy: str, portable: bool) -> Level:
    """An accuracy as `evaluate` draws it. Hits are asked of the very kernel, with the numbers of a dark scene."""

    def values(frame: Scene, x: Floats, y: Floats) -> Values:
        found: Values = render.evaluate(frame, x, y, accuracy=accuracy, portable=portable)
        return found

    job = job_of(frame, accuracy, clip=False, portable=portable)
    if job is not None:
        return Level(accuracy, values, _hits_by_stages(job), True, STATED_ULP[job.variant.name.partition("_")[0]])
    kernel = draw(frame, accuracy, portable=portable).kernel
    assert isinstance(kernel, Kernel), "one sphere under one light has the kernel of one sphere"

    def hits(frame: Scene, x: Floats, y: Floats) -> npt.NDArray[np.bool_]:
        seen = np.empty(x.shape, kernel.dtype)
        kernel.points(seen, x, y, kernel.numbers(numbers_of(dark(frame))), white=math.inf)
        return np.asarray(seen != 1.0, dtype=np.bool_)

    return Level(accuracy, values, hits, False, None)


def _hits_by_stages(job: Job) -> Callable[[Scene, Floats, Floats], npt.NDArray[np.bool_]]:
    """What the kernel of a job settles, and of what it leaves, what the stages after it say."""

    def hits(frame: Scene, x: Floats, y: Floats) -> npt.NDArray[np.bool_]:
        first = settling_kernel(frame, job.variant, portable=job.portable)
        assert first is not None, "one sphere under one light has the kernel of one sphere"
        kernel, unlit = first[0], dark(frame)
        seen = np.empty(x.shape, kernel.dtype)
        left = kernel.settle_points(seen, x, y, kernel.numbers(numbers_of(unlit)), white=math.inf)
        if left.size:
            seen[left] = render.evaluate(unlit, x[left], y[left], accuracy="stable", portable=job.portable)
        return np.asarray(seen != 1.0, dtype=np.bool_)

    return hits


def _by_numpy(form: Form) -> Evaluator:
    def evaluate(frame: Scene, x: Floats, y: Floats) -> Values:
        return evaluate_vectorised(frame, x, y, form=form)

    return evaluate


def _hits(evaluate: Evaluator, frame: Scene, x: Floats, y: Floats) -> npt.NDArray[np.bool_]:
    """What an evaluator takes for a hit: where the dark sphere is seen."""
    return np.asarray(evaluate(dark(frame), x, y) != 1.0, dtype=np.bool_)


def dark(frame: Scene) -> Scene:
    """The same sphere without any light before a background of 1: a value is 1 exactly where it is missed."""
    (sphere,) = frame.spheres
    black = structs.replace(sphere, material=Phong(0.0, 0.0, 0.0, 1.0, sphere.material.gate_specular))
    return structs.replace(frame, spheres=(black,), background=1.0)


def _apart(a: Values, b: Values) -> float:
    """The largest |a - b|, over points where both are finite."""
    with np.errstate(all="ignore"):
        difference = np.abs(np.subtract(a, b, dtype=np.float64))
    usable = difference[np.isfinite(difference)]
    return float(usable.max()) if usable.size else 0.0
