"""The comparison that `check` prints: each evaluator against the oracle and against its float references.

Comes in: a Scene and how many points to look at. Goes out: Report, a row for each evaluator and set of points.
Never done here: printing, or a verdict on an accuracy that states no bound. Errors are those of the unclipped field.

Stated bounds, on |value - truth|, u = 2^-53 for double and 2^-24 for single, n the shininess:

    u I (6 + 2 sqrt(n)) (1 + 1 / (4 d)),   I = max(1, ambient + intensity (diffuse + specular), background),
                                         d = the light's distance from the surface, in radii

The highlight's slope grows with sqrt(n), the direction of the light with 1 / d. The constants are measured, not proved:
over 1,000 random scenes (eye 1.01 to 10,000 radii away, n to 100,000, d from 0.001 to 10,000; a 24 x 24 image and 120
points near each hard place) the largest errors were these parts of the bound, and no hit or miss was wrong:

    accuracy    bound for Chapter 1's scene    largest error there    largest part of the bound, random scenes
    double      2.6e-15                        1.1e-15                0.56
    single      1.4e-6                         3.7e-7                 0.58
    literal     none                           0.61 (wrong hits)      -
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from msgspec import structs

from symrender_cg.lower.variants import ACCURACIES, variant
from symrender_cg.pipeline import draw
from symrender_cg.plan.plan import plan
from symrender_cg.reference import compare, oracle, points
from symrender_cg.reference.check_rows import Report, Row
from symrender_cg.reference.per_pixel import evaluate_per_pixel
from symrender_cg.reference.points import Points
from symrender_cg.reference.vectorised import evaluate_vectorised
from symrender_cg.run.drawing import Drawing
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Phong, PointLight, Scene

UNIT_ROUNDOFF = {"double": 2.0**-53, "single": 2.0**-24}
DOUBT = 32.0
"""How many roundings of a point may decide on which side of the terminator of a gated scene it is seen."""

PER_PIXEL_POINTS = 10_000
"""The per-pixel loop takes 15 us a point: of more points than these it computes every k-th."""

Form = Literal["stable", "literal"]
FORMS: tuple[Form, ...] = ("stable", "literal")
Values = npt.NDArray[np.float64] | npt.NDArray[np.float32]
Evaluator = Callable[[Scene, npt.NDArray[np.float64], npt.NDArray[np.float64]], Values]


def stated_bound(scene: Scene, accuracy: str) -> float | None:
    """u I (6 + 2 sqrt(n)) (1 + 1 / (4 d)), see above; None for `literal`, and for a light on the surface."""
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
    kernels = {accuracy: draw(scene, accuracy, portable=portable) for accuracy in accuracies or ACCURACIES}
    frame = scene.in_camera_frame()
    sets = {f"image {width}x{height}": points.whole_image(frame, width, height)}
    if count:
        sets["near silhouette"] = points.near_silhouette(frame, count, seed)
        sets["near terminator"] = points.near_terminator(frame, count, seed)
        sets["near highlight"] = points.near_highlight(frame, count, seed)
    rows = []
    sampled: dict[str, int] = {}
    for where, (x, y) in sets.items():
        if x.size == 0:
            continue
        few = slice(None, None, -(-x.size // PER_PIXEL_POINTS))
        sampled[where] = x[few].size
        rows += _rows(frame, where, (x, y), few, kernels)
    return Report(width, height, sampled, _by_evaluator(rows))


def _by_evaluator(rows: list[Row]) -> tuple[Row, ...]:
    """The rows of one evaluator together, in the order in which they begin."""
    order = {name: k for k, name in enumerate(dict.fromkeys(row.evaluator for row in rows))}
    return tuple(sorted(rows, key=lambda row: order[row.evaluator]))


def _rows(frame: Scene, where: str, where_points: Points, few: slice, kernels: dict[str, Drawing]) -> list[Row]:
    x, y = where_points
    answers = oracle.evaluate(frame, x, y)
    some = oracle.Answers(answers.value[few], answers.residual[few], answers.hit[few], answers.value32[few])
    references: dict[Form, Values] = {form: evaluate_vectorised(frame, x, y, form=form) for form in FORMS}
    loop = evaluate_per_pixel(frame, x[few], y[few])
    rows = []
    for accuracy, kernel in kernels.items():
        evaluate = _by_kernel(kernel)
        values = evaluate(frame, x, y)
        bound = stated_bound(frame, accuracy)
        doubtful = _in_doubt(frame, accuracy, (x, y), values, answers, bound)
        hits = _hits(evaluate, frame, x, y)
        judged: Values = values.copy()
        judged[doubtful] = (answers.value32 if kernel.dtype == np.float32 else answers.value)[doubtful]
        row = _row(f"kernel {accuracy}", where, judged, answers, hits)
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


def _row(evaluator: str, where: str, values: Values, answers: oracle.Answers, hits: npt.NDArray[np.bool_]) -> Row:
    errors = compare.measure(values, answers)
    wrong = int(np.count_nonzero(hits != answers.hit))
    return Row(evaluator, "", where, values.size, errors.max_ulp, errors.max_abs, wrong, 0, errors.nonfinite)


def _in_doubt(
    frame: Scene, accuracy: str, where: Points, values: Values, answers: oracle.Answers, bound: float | None
) -> npt.NDArray[np.bool_]:
    """Points that miss the bound of a gated scene and whose exact n.l changes sign within DOUBT roundings of them.

    A rounding is u R (1 + 1 / (4 d)) at the sphere's depth, seen on the image plane.
    """
    doubtful = np.zeros(values.shape, dtype=np.bool_)
    numbers = points.frame_numbers(frame)
    if bound is None or not numbers.gate_specular:
        return doubtful
    eye, depth = numbers.eye, numbers.eye - numbers.center[2]
    distance = abs(math.dist(numbers.light, numbers.center) / numbers.radius - 1.0)
    step = DOUBT * UNIT_ROUNDOFF[accuracy] * numbers.radius * (1.0 + 0.25 / distance) * eye / depth
    lit = points.exact_lit_test(numbers)
    with np.errstate(invalid="ignore", over="ignore"):
        missed = np.abs((values - answers.value) - answers.residual) > bound
    for index in np.flatnonzero(missed & answers.hit):
        x, y = float(where[0][index]), float(where[1][index])
        near = ((x + step, y), (x - step, y), (x, y + step), (x, y - step))
        doubtful[index] = len({lit(u, v, -eye) for u, v in ((x, y), *near)}) == 2
    return doubtful


def _by_kernel(drawing: Drawing) -> Evaluator:
    kernel = drawing.kernel
    assert isinstance(kernel, Kernel), "one sphere under one light has the kernel of one sphere"

    def evaluate(frame: Scene, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> Values:
        values = np.empty(x.shape, kernel.dtype)
        kernel.points(values, x, y, kernel.numbers(numbers_of(frame)), white=math.inf)
        return values

    return evaluate


def _by_numpy(form: Form) -> Evaluator:
    def evaluate(frame: Scene, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> Values:
        return evaluate_vectorised(frame, x, y, form=form)

    return evaluate


def _hits(
    evaluate: Evaluator, frame: Scene, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]
) -> npt.NDArray[np.bool_]:
    """What an evaluator takes for a hit: where a sphere without any light before a background of 1 is not seen as 1."""
    (sphere,) = frame.spheres
    dark = structs.replace(sphere, material=Phong(0.0, 0.0, 0.0, 1.0, sphere.material.gate_specular))
    values = evaluate(structs.replace(frame, spheres=(dark,), background=1.0), x, y)
    return np.asarray(values != 1.0, dtype=np.bool_)


def _apart(a: Values, b: Values) -> float:
    """The largest |a - b|, over points where both are finite."""
    with np.errstate(all="ignore"):
        difference = np.abs(np.subtract(a, b, dtype=np.float64))
    usable = difference[np.isfinite(difference)]
    return float(usable.max()) if usable.size else 0.0
