"""Points of a scene's image plane, the truth there, and how far the values of a way are from it.

Comes in: a Scene, the size of its image, counts, a seed. Goes out: Sample, Errors. Never done here: a choice.

Points anywhere are uniform over the window of the image; hard points are beside outlines (the two nearest floats,
within 6 floats, 1e-15 to 1e-3 off), on each surface, and for one sphere under one light also about its terminator and
its highlight.
The edges of shadows, tiles and mirrored surfaces are not looked for: there every level that is not proved may take the
other side.
The truth is the oracle's: value + residual, good to 106 bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from symrender_cg.cost.ready import subsamples
from symrender_cg.cost.report import Errors
from symrender_cg.errors import AccuracyError
from symrender_cg.reference import oracle
from symrender_cg.reference.hard_places import near_highlight, near_silhouette, near_terminator
from symrender_cg.scene import Gradient, Phong, PointLight, Scene

Floats = NDArray[np.float64]

LOWEST_BIN, HIGHEST_BIN = -3, 60
MOST_SPHERES: Final = 24
"""Of more spheres every k-th has its outline looked at."""
JUMP: Final = 0.001
"""An error beyond this, and beyond SHARE times the 99th percentile of the way, is a flip: the other side of an edge."""
SHARE: Final = 100.0


@dataclass(frozen=True, eq=False)
class Truth:
    """(points, channels): float64 value, residual, float32 value, grey level; background is seen where not `hit`."""

    value: Floats
    residual: Floats
    value32: NDArray[np.float32]
    value8: NDArray[np.uint8]
    hit: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Sample:
    """Points and the truth at them; the first `anywhere` are uniform over the window, the others hard."""

    scene: Scene
    size: tuple[int, int]
    x: Floats
    y: Floats
    anywhere: int
    truth: Truth

    def averaged(self, side: int) -> Truth:
        """The mean of the truths at side x side places of the pixel about each point, for supersampling."""
        offsets = subsamples(self.scene, self.size, side)
        found = [truth_at(self.scene, self.x + dx, self.y + dy) for dx, dy in offsets]
        value: Floats = np.mean([one.value for one in found], axis=0)
        rest = sum((one.value - value) + one.residual for one in found) / len(found)
        whole = value + rest
        level = np.floor(255.0 * np.clip(whole, 0.0, 1.0) + 0.5).astype(np.uint8)
        hit = np.any([one.hit for one in found], axis=0)
        return Truth(whole, rest - (whole - value), whole.astype(np.float32), level, hit)


def draw_sample(
    scene: Scene, size: tuple[int, int], points: int, hard: int, seed: int, *, reach: float = 1.0
) -> Sample:
    """`points` anywhere in the window of the image, at most `hard` of each kind of hard point; by the seed alone.

    `reach`: how many times as far as the window's edge points may lie.
    """
    frame = scene.in_camera_frame()
    half_height = frame.camera.half_height
    assert half_height is not None, "a scene in the camera's frame has a half_height"
    half_height *= reach
    half_width = half_height * size[0] / size[1]
    random = np.random.default_rng(seed)
    x, y = random.uniform(-half_width, half_width, points), random.uniform(-half_height, half_height, points)
    near_x, near_y = _hard_points(frame, hard, seed) if hard else (np.empty(0), np.empty(0))
    inside = (np.abs(near_x) <= half_width) & (np.abs(near_y) <= half_height)
    x, y = np.concatenate((x, near_x[inside])), np.concatenate((y, near_y[inside]))
    return Sample(scene, size, x, y, points, truth_at(scene, x, y))


def _hard_points(frame: Scene, count: int, seed: int) -> tuple[Floats, Floats]:
    alone = len(frame.spheres) == 1 and len(frame.lights) == 1 and frame.plane is None and frame.channels == 1
    every = -(-len(frame.spheres) // MOST_SPHERES) if frame.spheres else 1
    bare = [Scene(frame.camera, (structs.replace(one, material=Phong()),)) for one in frame.spheres[::every]]
    share = -(-count // max(1, len(bare)))
    found = [near_silhouette(one, share, seed + number) for number, one in enumerate(bare)]
    found += [_on_surface(one, share, seed + number) for number, one in enumerate(bare)]
    if alone and isinstance(frame.lights[0], PointLight):
        found += [near_terminator(frame, count, seed), near_highlight(frame, count, seed)]
    if not found:
        return np.empty(0), np.empty(0)
    return np.concatenate([x for x, _ in found]), np.concatenate([y for _, y in found])


def _on_surface(frame: Scene, count: int, seed: int) -> tuple[Floats, Floats]:
    """Where random points of a sphere's surface that face the eye appear, however small its picture is."""
    sphere, eye = frame.spheres[0], frame.camera.eye[2]
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    place = np.asarray(sphere.center) + sphere.radius * directions
    facing = np.sum(directions * (np.array((0.0, 0.0, eye)) - place), axis=1) > 0.0
    place = place[facing & (place[:, 2] < eye)]
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        x, y = (eye * place[:, axis] / (eye - place[:, 2]) for axis in (0, 1))
    usable = np.isfinite(x) & np.isfinite(y)
    return x[usable], y[usable]


def truth_at(scene: Scene, x: Floats, y: Floats) -> Truth:
    """The oracle's answers; a point that it leaves open (an exact tie) is answered a float further to the right."""
    try:
        found = oracle.evaluate(scene, x, y)
    except AccuracyError as refusal:
        moved = x.copy()
        moved[list(refusal.points)] = np.nextafter(moved[list(refusal.points)], np.inf)
        found = oracle.evaluate(scene, moved, y)
    shape = (x.size, -1)
    return Truth(
        found.value.reshape(shape),
        found.residual.reshape(shape),
        found.value32.reshape(shape),
        found.value8.reshape(shape),
        np.ravel(found.hit),
    )


def errors_of(field: Callable[[Floats, Floats], NDArray[Any]], sample: Sample, side: int = 1) -> Errors:
    """How far a field is from the truth on a sample; `side`: of the mean of side x side rays a pixel."""
    truth = sample.truth if side == 1 else sample.averaged(side)
    values = field(sample.x, sample.y)
    values = values.reshape(sample.x.size, -1)
    if values.shape != truth.value.shape:
        values = np.broadcast_to(values, truth.value.shape)
    grey = values.dtype == np.uint8
    answer = truth.value8 if grey else truth.value32 if values.dtype == np.float32 else truth.value
    wide = values.astype(np.float64)
    if grey:
        error = np.abs(wide / 255.0 - np.clip(truth.value, 0.0, 1.0))
        ulps = np.abs(wide - truth.value8.astype(np.float64))
    else:
        with np.errstate(invalid="ignore", over="ignore"):
            error = np.abs((wide - truth.value) - truth.residual)
            ulps = error / np.abs(np.spacing(answer)).astype(np.float64)
    broken = np.any(~np.isfinite(wide), axis=1)
    flipped = (_flips(values, answer, sample) | _jumps(error)) & ~broken
    if side > 1:
        flipped[:] = False
    kept = ~(flipped | broken)
    with np.errstate(invalid="ignore"):
        level = values if grey else np.floor(255.0 * np.clip(wide, 0.0, 1.0) + 0.5)
    right = np.all(level == truth.value8, axis=1)[: sample.anywhere]
    in_window = kept & (np.arange(kept.size) < sample.anywhere)
    return Errors(
        largest=float(error[kept].max(initial=0.0)),
        p999=_high(error[in_window]),
        ulp=float(ulps[kept].max(initial=0.0)),
        ulp_p999=_high(ulps[in_window]),
        right8=float(np.mean(right)) if right.size else 1.0,
        flips=int(np.count_nonzero(flipped)),
        nonfinite=int(np.count_nonzero(broken)),
        points=sample.anywhere,
        hard=sample.x.size - sample.anywhere,
        histogram=_histogram(ulps[in_window]),
    )


def _high(errors: Floats) -> float:
    """The 99.9th percentile."""
    return float(np.quantile(errors, 0.999)) if errors.size else 0.0


def _jumps(error: Floats) -> NDArray[np.bool_]:
    """What is far beyond the way's other errors: a shadow, a tile, a mirrored or a nearer surface is mistaken."""
    largest = error.max(axis=1, initial=0.0)
    usual = float(np.quantile(largest[np.isfinite(largest)], 0.99)) if np.isfinite(largest).any() else 0.0
    return np.asarray(largest > max(JUMP, SHARE * usual))


def _flips(values: NDArray[Any], answer: NDArray[Any], sample: Sample) -> NDArray[np.bool_]:
    """Exactly one of value and truth is the background's; before a gradient no value tells."""
    background = sample.scene.background
    if isinstance(background, Gradient):
        return np.zeros(sample.x.shape, dtype=np.bool_)
    colour = np.asarray(background, dtype=np.float64).reshape(-1)
    if values.dtype == np.uint8:
        shown = np.floor(255.0 * np.clip(colour, 0.0, 1.0) + 0.5).astype(np.uint8)
    else:
        shown = colour.astype(values.dtype)
    missed, should_miss = np.all(values == shown, axis=1), np.all(answer == shown, axis=1)
    return np.asarray(missed != should_miss)


def _histogram(ulps: Floats) -> tuple[int, ...]:
    """Counts of 0, (0, 2^-3], (2^-3, 2^-2], ...; without trailing zeros."""
    positive = ulps[ulps > 0.0]
    with np.errstate(over="ignore"):
        bins = np.clip(np.ceil(np.log2(positive)), LOWEST_BIN, HIGHEST_BIN).astype(int) - LOWEST_BIN
    counts = np.bincount(bins, minlength=1)
    return (int(ulps.size - positive.size), *(int(count) for count in counts))
