"""The comparison that `check` prints, for kernels of scenes: against the oracle, exactly, and brute force in numpy.

Comes in: a Scene of any kind, kernels' accuracies, how many points to look at. Goes out: rows as `check` has them, one
for each evaluator and set of points. Never done here: printing, a plan of its own.

Points: the pixel centres of an image, drawn as an image is; and points found by halving the way between two pixels that
see different things, 4 to 45 times, so that the edge is from 1/16 to 3e-14 of a pixel away:

    near outlines     another surface is seen, or none
    near mirrored     the same surface, but other surfaces in it, or another tile of the plane
    near shadows      the same surfaces, but another light reaches the first of them: shadow edges and terminators

Stated of levels that prove their values, at every point without exception: 4 ulp (stable), half an ulp (certified),
and what is seen is right. Stated bounds of the others, on |value - truth| of each channel, I the brightest value of
any point: 1e-13 max(1, I) for double, 1e-5 max(1, I) for single, 2^-11 max(1, I) for fast where n <= 1000, and what is
seen is right at every point: of double without exception, of single and fast but for which of two surfaces that cut
each other is in front, within its rounding of their depths. Measured, not proved: on the built-in scenes the largest
errors on an image are 1.1e-15 and 9.0e-7, near edges in a mirror 7.6e-14 and 9.4e-6. There the bound leaves room for
what mirrors do: what one rounding turns a direction by grows at each bounce on a sphere by twice the distance over its
radius, so that no bound over all scenes can be stated. So a point that misses it is `in doubt` and counted apart where
brute force says that its value rests on a decision within rounding (at the edge of a shadow or of a tile, the
terminator of a gated highlight, an outline in a mirror), or that roundings grow along its rays beyond the bound. Other
points that miss it break it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import structs

from symrender_cg.pipeline import draw, pixel_size
from symrender_cg.reference import brute_force, compare, oracle
from symrender_cg.reference.check_rows import FAST_SHININESS, STATED_ULP, Row
from symrender_cg.run.drawing import Drawing
from symrender_cg.run.levels import job_of
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.ready import shape_of
from symrender_cg.run.render import evaluate
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.scene_numbers import scene_numbers
from symrender_cg.scene import Phong, Scene

BOUNDS = {"double": 1e-13, "single": 1e-5, "fast": 2.0**-11}
UNIT_ROUNDOFF = {"double": 2.0**-53, "single": 2.0**-24, "fast": 2.0**-24}
DOUBT = {"double": 1e-9, "single": 1e-4, "fast": 1e-4}
"""Margin of a decision below which the formats' roundings may take it either way."""
EXACT_ORDER = frozenset({"double"})
"""Accuracies of which another surface in front counts as wrong, never as in doubt: float64 tells all depths apart but
those that agree to their last places. Hit or miss is exact at all of them."""
ROUNDINGS = 16.0
"""How many roundings of a value one of its directions may cost."""
HALVINGS = (4, 45)
EDGE_SIDE = 48

Floats = npt.NDArray[np.float64]
Classes = Callable[[Floats, Floats], npt.NDArray[Any]]


@dataclass(frozen=True, slots=True)
class _Points:
    """A set of points; `size` where they are the pixel centres of an image."""

    where: str
    x: Floats
    y: Floats
    size: tuple[int, int] | None = None


def stated_scene_bound(accuracy: str, values: npt.NDArray[Any]) -> float:
    """The bound on errors of a scene kernel's values at points whose true values are these."""
    return BOUNDS[accuracy] * max(1.0, float(np.abs(values).max(initial=0.0)))


def scene_rows(
    scene: Scene, *, width: int, height: int, count: int, seed: int, accuracies: tuple[str, ...], portable: bool
) -> list[Row]:
    """A row for each kernel and for brute force on each set of points that is not empty."""
    frame = scene.in_camera_frame()
    sets = [_Points(f"image {width}x{height}", *_centres(frame, width, height), (width, height))]
    if count:
        sets += edge_points(frame, width / height, count, seed)
    rows: list[Row] = []
    for points in sets:
        answers, traced = oracle.evaluate(frame, points.x, points.y), brute_force.trace(frame, points.x, points.y)
        for accuracy in accuracies:
            job = job_of(scene, accuracy, clip=False, portable=portable)
            if job is not None:
                stated = STATED_ULP[job.variant.name.partition("_")[0]]
                rows.append(_of_stages(frame, accuracy, points, answers, traced, stated, portable))
                continue
            drawing = draw(scene, accuracy, size=points.size, portable=portable)
            rows.append(_of_kernel(scene, accuracy, drawing, points, answers, traced))
        row = _row("brute force", "", points, traced.value, answers, traced.index)
        rows.append(row)
    return rows


def _of_kernel(
    scene: Scene,
    accuracy: str,
    drawing: Drawing,
    points: _Points,
    answers: oracle.Answers,
    traced: brute_force.Traced,
) -> Row:
    values = _values(scene, drawing, points)
    bound = stated_scene_bound(accuracy, answers.value)
    unit = UNIT_ROUNDOFF[accuracy] * bound / BOUNDS[accuracy]
    with np.errstate(invalid="ignore", over="ignore"):
        missed = np.abs((values - answers.value) - answers.residual) > bound
    if missed.ndim > points.x.ndim:
        missed = np.asarray(missed.any(axis=-1))
    shaky = (traced.doubt < DOUBT[accuracy]) | (ROUNDINGS * unit * traced.condition > bound)
    index = seen(drawing, points, answers.index)
    swapped = (index != answers.index) & (index >= 0) & (answers.index >= 0) & (traced.doubt < DOUBT[accuracy])
    if accuracy in EXACT_ORDER:
        swapped[...] = False
    doubtful = (missed & shaky) | swapped
    judged = values.copy()
    judged[doubtful] = (answers.value32 if values.dtype == np.float32 else answers.value)[doubtful]
    row = _row(f"kernel {accuracy}", accuracy, points, judged, answers, np.where(swapped, answers.index, index))
    apart = np.abs(judged - traced.value)[~shaky]
    apart = apart[np.isfinite(apart)]
    return replace(
        row,
        in_doubt=int(np.count_nonzero(doubtful)),
        from_numpy=float(apart.max(initial=0.0)),
        bound=bound if _states(scene, accuracy) else None,
    )


def _states(scene: Scene, accuracy: str) -> bool:
    """Whether a bound is stated: of `fast` where no highlight has an exponent above FAST_SHININESS."""
    materials = [sphere.material for sphere in scene.spheres]
    if scene.plane is not None:
        materials += [one for one in (scene.plane.material, scene.plane.checker) if one is not None]
    return accuracy != "fast" or all(one.specular == 0.0 or one.shininess <= FAST_SHININESS for one in materials)


def _of_stages(
    frame: Scene,
    accuracy: str,
    points: _Points,
    answers: oracle.Answers,
    traced: brute_force.Traced,
    stated: float,
    portable: bool,
) -> Row:
    """Of a level that proves its values, at every point; what is seen is asked of it as values of their own."""
    values = evaluate(frame, points.x, points.y, accuracy=accuracy, portable=portable)
    codes = evaluate(_numbered(frame), points.x, points.y, accuracy=accuracy, portable=portable)
    row = _row(f"kernel {accuracy}", accuracy, points, values, answers, codes.astype(np.int64) - 1, stated)
    apart = np.abs(values - traced.value)[traced.doubt >= DOUBT["double"]]
    apart = apart[np.isfinite(apart)]
    return replace(row, from_numpy=float(apart.max(initial=0.0)))


def _numbered(frame: Scene) -> Scene:
    """The scene where the surface with index k has the value k + 1 everywhere, and the background 0."""
    spheres = tuple(structs.replace(s, material=_flat(k + 1.0)) for k, s in enumerate(frame.spheres))
    plane = frame.plane
    if plane is not None:
        plane = structs.replace(plane, material=_flat(len(spheres) + 1.0), checker=None)
    return structs.replace(frame, spheres=spheres, plane=plane, lights=(), background=0.0, max_bounces=0)


def _flat(ambient: float) -> Phong:
    return Phong(ambient, 0.0, 0.0, 1.0)


def _row(
    evaluator: str,
    accuracy: str,
    points: _Points,
    values: npt.NDArray[Any],
    answers: oracle.Answers,
    index: npt.NDArray[Any],
    bound_ulp: float | None = None,
) -> Row:
    errors = compare.measure(values, answers)
    wrong = int(np.count_nonzero(index != answers.index))
    ulp = math.inf if bound_ulp is not None and errors.flips else errors.max_ulp
    where, count, broken = points.where, points.x.size, errors.nonfinite
    return Row(evaluator, accuracy, where, count, ulp, errors.max_abs, wrong, 0, broken, bound_ulp=bound_ulp)


# ------------------------------------------------------------------------------------------------- what a kernel says


def _values(scene: Scene, drawing: Drawing, points: _Points) -> npt.NDArray[Any]:
    values = np.empty(drawing.shape(*points.x.shape), drawing.dtype)
    _draw(drawing, values, points)
    shape = shape_of(scene, *points.x.shape)
    return values if values.shape == shape else np.repeat(values[..., np.newaxis], shape[-1], axis=-1)


def _draw(drawing: Drawing, values: npt.NDArray[Any], points: _Points) -> None:
    if points.size is not None:
        drawing.rows(values, 0, points.size[1])
    else:
        drawing.points(values, points.x, points.y)


def seen(drawing: Drawing, points: _Points, truth: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Which surface the kernel sees at each point, as the oracle numbers them: the kernel drawn with the scene's own
    lists, where every surface has an ambient coefficient of its own and nothing else adds light. Points that the kernel
    leaves open are not its decision: there it is `truth`.

    The kernel of one sphere knows hit and miss alone: where it agrees with `truth` in that, that is what it sees.
    """
    if not isinstance(drawing.kernel, SceneKernel):
        (sphere,) = drawing.plan.scene.spheres
        dark = structs.replace(sphere, material=Phong(1.0, 0.0, 0.0, 1.0, sphere.material.gate_specular))
        coded = structs.replace(drawing.plan.scene, spheres=(dark,), background=0.0)
        values = np.empty(points.x.shape, drawing.dtype)
        _draw(replace(drawing, numbers=drawing.kernel.numbers(numbers_of(coded))), values, points)
        hit = values != 0.0
        return np.where(hit == (truth >= 0), truth, np.where(hit, -2, -1))
    kernel, plan = drawing.kernel, drawing.plan
    arrangement = plan.arrangement
    assert arrangement is not None, "the kernel of a scene has an arrangement"
    numbers = scene_numbers(plan.scene, arrangement, kernel.channels)
    codes = np.repeat(np.arange(1.0, arrangement.receivers + 1.0), kernel.channels)
    black = {name: np.zeros_like(numbers[name]) for name in ("diffuse", "specular", "reflect", "background")}
    if "background_top" in numbers:
        black["background_top"] = np.zeros_like(numbers["background_top"])
    numbers = numbers | black | {"ambient": codes}
    width, height = points.size or (1, 1)
    prepared = kernel.prepare(numbers, width=width, height=height, pixel=drawing.pixel, white=math.inf)
    values = np.empty(drawing.shape(*points.x.shape), drawing.dtype)
    _draw(replace(drawing, numbers=prepared, decide=_left_open), values, points)
    first = values if kernel.channels == 1 else values[..., 0]
    planes = arrangement.receivers - len(arrangement.spheres)
    table = np.concatenate(([-1], arrangement.spheres, [len(plan.given.spheres)] * planes, [-2])).astype(np.int64)
    with np.errstate(invalid="ignore"):
        whole = np.where(np.isfinite(first), first, -1.0).astype(np.int64)
    known = (whole == first) & (whole >= 0) & (whole <= arrangement.receivers)
    found: npt.NDArray[np.int64] = table[np.where(known, whole, len(table) - 1)]
    return np.where(first == _OPEN, truth, found)


_OPEN = -2.0


def _left_open(x: Floats, _: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """In place of what settles a kernel's doubts: a mark."""
    return np.full((x.size, 1), _OPEN), np.ones(x.size, dtype=np.bool_)


# ------------------------------------------------------------------------------------------------------ where to look


def _centres(frame: Scene, width: int, height: int) -> tuple[Floats, Floats]:
    """Pixel centres, broadcast to (height, width), as render_image has them."""
    step = np.float64(pixel_size(frame, height))
    columns = (np.arange(width, dtype=np.float64) + 0.5 - 0.5 * width) * step
    rows = (0.5 * height - 0.5 - np.arange(height, dtype=np.float64)) * step
    x, y = np.broadcast_arrays(columns[np.newaxis, :], rows[:, np.newaxis])
    return x.copy(), y.copy()


def edge_points(frame: Scene, aspect: float, count: int, seed: int) -> list[_Points]:
    """Up to three sets of `count` points near edges of the image of that width over height; a set without edges is
    left out."""
    first = structs.replace(frame, lights=(), max_bounces=0)
    codes, lit = _coded(frame), structs.replace(frame, max_bounces=0)

    def outlines(x: Floats, y: Floats) -> npt.NDArray[Any]:
        return brute_force.trace(first, x, y).index[..., np.newaxis]

    def surfaces(x: Floats, y: Floats) -> npt.NDArray[Any]:
        traced = brute_force.trace(codes, x, y)
        return np.stack((traced.index, traced.value), axis=-1)

    def lights(x: Floats, y: Floats) -> npt.NDArray[Any]:
        traced = brute_force.trace(lit, x, y)
        diffuse = traced.diffuse if frame.channels == 1 else traced.diffuse.max(axis=-1)
        arrives = np.moveaxis(diffuse > 0.0, 0, -1)
        return np.concatenate((surfaces(x, y), arrives), axis=-1)

    kinds: list[tuple[str, Classes, int]] = [
        ("near outlines", outlines, 0),
        ("near mirrored", surfaces, 1),
        ("near shadows", lights, 2),
    ]
    width = max(4, round(EDGE_SIDE * min(aspect, 4.0)))
    x, y = _centres(frame, width, max(4, round(width / aspect)))
    found = []
    for number, (where, classes, same) in enumerate(kinds):
        ends = _edges(classes(x, y), x, y, same)
        if ends.size:
            random = np.random.default_rng((seed, number))
            found.append(_Points(where, *_halved(classes, ends[:, random.integers(ends.shape[1], size=count)], random)))
    return found


def _edges(classes: npt.NDArray[Any], x: Floats, y: Floats, same: int) -> Floats:
    """(4, n): x, y, x, y of neighbours of different classes, the first `same` numbers of which are equal."""
    pairs = []
    for one, other in (
        ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
        (slice(None, -1), slice(1, None)),
    ):
        differs = classes[one] != classes[other]
        edge = differs.any(axis=-1) & ~differs[..., :same].any(axis=-1)
        pairs.append(np.array([x[one][edge], y[one][edge], x[other][edge], y[other][edge]]))
    return np.concatenate(pairs, axis=1)


def _halved(classes: Classes, ends: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Points on either side of an edge between two points, after a random number of halvings."""
    near, far = ends[:2].copy(), ends[2:].copy()
    left: npt.NDArray[np.int64] = np.asarray(random.integers(*HALVINGS, size=ends.shape[1]))
    of_near = classes(near[0], near[1])
    while (left > 0).any():
        open_ = np.flatnonzero(left > 0)
        middle = 0.5 * (near[:, open_] + far[:, open_])
        as_near = (classes(middle[0], middle[1]) == of_near[open_]).all(axis=-1)
        near[:, open_] = np.where(as_near, middle, near[:, open_])
        far[:, open_] = np.where(as_near, far[:, open_], middle)
        left[open_] -= 1
    chosen = np.where(random.random(ends.shape[1]) < 0.5, near, far)
    return chosen[0].copy(), chosen[1].copy()


def _coded(frame: Scene) -> Scene:
    """The scene where every surface has its own ambient coefficient, so that a value tells the surfaces of a path."""

    def code(material: Phong, number: int) -> Phong:
        return Phong(1.0 + math.sqrt(2.0 + number), 0.0, 0.0, 1.0, False, 0.75 if material.reflect > 0.0 else 0.0)

    spheres = tuple(
        structs.replace(sphere, material=code(sphere.material, number)) for number, sphere in enumerate(frame.spheres)
    )
    plane, count = frame.plane, len(spheres)
    if plane is not None:
        checker = plane.checker if plane.checker is None else code(plane.checker, count + 1)
        plane = structs.replace(plane, material=code(plane.material, count), checker=checker)
    return structs.replace(frame, spheres=spheres, plane=plane, lights=(), background=0.5)
