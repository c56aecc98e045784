"""Every way to evaluate an image behind one signature, the structures that a plan can have, and exhaustive checks.

Comes in: a Scene and points. Goes out: unclipped intensities. Never done here: an expectation about an accuracy; bounds
stand in the tests.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from hypothesis import settings

from symrender_cg import evaluate
from symrender_cg.pipeline import compile_kernel
from symrender_cg.reference.per_pixel import evaluate_per_pixel
from symrender_cg.reference.vectorised import evaluate_vectorised
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere, Vector

FloatArray: TypeAlias = npt.NDArray[np.float64]
Values: TypeAlias = npt.NDArray[Any]

THOROUGH = os.environ.get("SYMRENDER_THOROUGH", "") not in ("", "0")
"""SYMRENDER_THOROUGH=1 draws twenty times as many examples."""

ACCURACIES = ("literal", "double", "single")
EXACT = ("double", "single")
"""The accuracy levels whose one kernel promises the right hit or miss, of those in ACCURACIES."""

PROVED = (("stable", None), ("certified", "float64"), ("certified", "float32"), ("certified", "uint8"))
"""The accuracy levels that prove their values, each with what it rounds to."""

MARKER = 7.0
"""A background that no shading of these tests reaches: a value is MARKER exactly where the evaluator saw a miss."""


def modest(examples: int) -> settings:
    """Hypothesis settings: so many examples, twenty times as many with SYMRENDER_THOROUGH=1; no deadline."""
    return settings(max_examples=examples * (20 if THOROUGH else 1), deadline=None)


@dataclass(frozen=True, slots=True)
class Evaluator:
    """(scene, x, y) -> intensities of `dtype`, unclipped; `exact` where it promises the right hit or miss."""

    name: str
    values: Callable[[Scene, FloatArray, FloatArray], Values]
    dtype: type[np.floating[Any]] = np.float64
    exact: bool = False


EVALUATORS: tuple[Evaluator, ...] = (
    Evaluator("per_pixel", evaluate_per_pixel),
    Evaluator("numpy_literal", lambda s, x, y: evaluate_vectorised(s, x, y, form="literal")),
    Evaluator("numpy_stable", lambda s, x, y: evaluate_vectorised(s, x, y), exact=True),
    Evaluator("literal", lambda s, x, y: evaluate(s, x, y, accuracy="literal")),
    Evaluator("double", lambda s, x, y: evaluate(s, x, y, accuracy="double"), exact=True),
    Evaluator("single", lambda s, x, y: evaluate(s, x, y, accuracy="single"), np.float32, exact=True),
    Evaluator("fast", lambda s, x, y: evaluate(s, x, y, accuracy="fast"), np.float32, exact=True),
    Evaluator("baked", lambda s, x, y: evaluate(s, x, y, accuracy="double", bake=True), exact=True),
)


def evaluator(name: str) -> Evaluator:
    """The evaluator of that name."""
    return next(entry for entry in EVALUATORS if entry.name == name)


def evaluate_forced(scene: Scene, x: FloatArray, y: FloatArray, accuracy: str, force: Iterable[str]) -> Values:
    """`evaluate` by the kernel that keeps effects which the scene does not call for."""
    kernel = compile_kernel(scene, accuracy, force=force)
    values = np.empty(x.shape, kernel.dtype)
    columns, rows = np.ascontiguousarray(x), np.ascontiguousarray(y)
    kernel.points(values, columns, rows, kernel.numbers(numbers_of(scene)), white=math.inf)
    return values


# -------------------------------------------------------------------------------------------------- structures of plans

GEOMETRIES: dict[str, tuple[Vector, float | None]] = {
    "centred_sphere": ((0.0, 0.0, 0.0), None),
    "off_axis_sphere": ((0.5, 0.25, -0.5), None),
    "any_sphere": ((1.25, 0.25, 3.5), 6.0),
}
"""Name of the geometry in a plan -> centre, half_height, for the eye at (0, 0, 4) and radius 1."""

_LIT_FROM: dict[str, Vector] = {"any_sphere": (-2.0, 3.0, 1.0)}
"""Where a light shines on the side that is seen, if Chapter 1's does not."""

_LIGHTS = {"": (0.7, 0.5), "_matte": (0.7, 0.0), "_specular": (0.0, 0.5), "_flat": (0.0, 0.0)}


def scene_of(geometry: str, material: Phong | None = None, light: Vector | None = None) -> Scene:
    """A scene of that geometry, by default with Chapter 1's material, lit from the side that is seen."""
    center, half_height = GEOMETRIES[geometry]
    sphere = Sphere(center, 1.0, material or Phong())
    position = light or _LIT_FROM.get(geometry, (5.0, 5.0, 10.0))
    return Scene(Camera(half_height=half_height), (sphere,), (PointLight(position),))


def structures() -> dict[str, Scene]:
    """One scene for each structure that a plan can have, under the plan's name."""
    found: dict[str, Scene] = {}
    for geometry, (kind, (diffuse, specular)), gated in itertools.product(GEOMETRIES, _LIGHTS.items(), (False, True)):
        if gated and specular == 0.0:
            continue
        material = Phong(0.1, diffuse, specular, 32.0, gate_specular=gated)
        found[geometry + kind + ("_gated" if gated else "")] = scene_of(geometry, material)
    return found


STRUCTURES = structures()


# -------------------------------------------------------------------------------------------- points and changed scenes


def square_of_points(scene: Scene, count: int) -> tuple[FloatArray, FloatArray]:
    """count x count pixel centres of the scene's square image, flat."""
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None
    axis = (np.arange(count) + 0.5 - count / 2.0) * (2.0 * half_height / count)
    x, y = np.meshgrid(axis, axis[::-1])
    return np.ascontiguousarray(x).ravel(), np.ascontiguousarray(y).ravel()


def with_background(scene: Scene, background: float) -> Scene:
    """The same scene before another background."""
    return Scene(scene.camera, scene.spheres, scene.lights, background)


def same_bits(a: Values, b: Values) -> bool:
    """Equal dtype, shape and bit patterns; 0.0 and -0.0 differ, a NaN equals itself."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
