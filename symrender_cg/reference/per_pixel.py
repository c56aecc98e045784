"""The seed's Cell 1: one ray after another, a python loop on 3-vectors, branches as they come; a sphere anywhere.

Comes in: a Scene with one sphere and one light, an image size or points. Goes out: float64 intensities. With the sphere
at the origin and a light of intensity 1 these are the seed's own operations in the seed's own order. Never done here: a
better formula, a shared subexpression, an operation on many pixels: this is what the others are compared with.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from symrender_cg.reference.camera_numbers import FrameNumbers, frame_numbers
from symrender_cg.reference.points import FloatArray, as_points, pixel_centres
from symrender_cg.scene import Scene


def render_per_pixel(scene: Scene, width: int, height: int, *, clip: bool = True) -> FloatArray:
    """The image, (height, width) float64, row 0 at the top; clipped to [0, 1] unless clip=False.

    About 15 us a pixel. Source: Symbolic Rendering, Chapter 1, Cell 1 (render_numeric); pixel centres as everywhere.
    """
    columns, rows = pixel_centres(scene, width, height)
    image = evaluate_per_pixel(scene, columns[np.newaxis, :], rows[:, np.newaxis])
    return np.clip(image, 0.0, 1.0) if clip else image


def evaluate_per_pixel(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> FloatArray:
    """The unclipped intensity at points (x, y) of the image plane; float64 of the broadcast shape."""
    numbers = frame_numbers(scene)
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    with np.errstate(all="ignore"):
        values = [_intensity(numbers, u, v) for u, v in zip(columns.ravel(), rows.ravel(), strict=True)]
    return np.array(values, dtype=np.float64).reshape(columns.shape)


def _intensity(numbers: FrameNumbers, x: np.float64, y: np.float64) -> float:
    """k_a + intensity (k_d max(0, n.l) + k_s max(0, r.v)^n) where the ray hits, else the background   (Phong 1975)"""
    R, e = numbers.radius, np.float64(numbers.eye)
    ka = numbers.ambient
    kd, ks = numbers.intensity * numbers.diffuse, numbers.intensity * numbers.specular
    C = np.array(numbers.center)
    E = np.array([0.0, 0.0, e])
    L = np.array(numbers.light)
    D = np.array([x, y, -e])  # the ray, not normalised
    A = D @ D  # A t^2 + 2 b t + c = 0
    b = (E - C) @ D
    c = (E - C) @ (E - C) - R * np.float64(R)
    disc = b * b - A * c
    if disc < 0.0 or b > 0.0:
        return numbers.background
    t = (-b - np.sqrt(disc)) / A
    P = E + t * D
    N = (P - C) / R
    w = L - P
    distance = np.linalg.norm(w)
    if distance == 0.0:
        return ka
    w_hat = w / distance
    v_hat = (E - P) / np.linalg.norm(E - P)
    ndl = N @ w_hat
    r = 2.0 * ndl * N - w_hat
    rdv = r @ v_hat
    specular = max(np.float64(0.0), rdv) ** numbers.shininess
    if numbers.gate_specular and not ndl > 0.0:
        specular = 0.0
    return float(ka + kd * max(0.0, ndl) + ks * specular)
