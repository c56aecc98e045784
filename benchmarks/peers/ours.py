"""Our kernels, called as a user calls them: render_image, and evaluate where the grid is not an image's.

Comes in: a Case. Goes out: one arrangement; nothing where a level has another format than the case, or where a baked
kernel is asked for and the case has arguments. Never done here: an entry point that users do not have, but
for `double_alone`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks.peers.case import Arrangements, Case, Factory, Grid, Numbers, Render, image_grid


def level(accuracy: str, form: str, *, bake: bool) -> Factory:
    """The contestant of an accuracy level whose kernel computes in that format, its numbers baked or not."""

    def factory(case: Case, threads: int) -> Arrangements:
        if case.format != form or (bake and not case.baked):
            return {}
        return {"render_image": partial(_draw, case, accuracy, bake, threads)}

    return factory


literal = level("literal", "float64", bake=False)
double = level("double", "float64", bake=False)
double_baked = level("double", "float64", bake=True)
double_inner = level("double_inner", "float64", bake=False)
double_inner_baked = level("double_inner", "float64", bake=True)
single = level("single", "float32", bake=False)
single_baked = level("single", "float32", bake=True)
single_inner = level("single_inner", "float32", bake=False)
fast = level("fast", "float32", bake=False)
fast_baked = level("fast", "float32", bake=True)


def scene_of(numbers: Numbers, grid: Grid | None = None) -> Any:
    """Chapter 1's scene with these numbers, framed by the grid where there is one."""
    from msgspec.structs import replace

    from symrender_cg import Camera, Scene

    n = numbers
    scene = Scene.chapter1(
        radius=n.radius,
        eye=n.eye,
        light=(n.light_x, n.light_y, n.light_z),
        ambient=n.ambient,
        diffuse=n.diffuse,
        specular=n.specular,
        shininess=n.shininess,
    )
    if grid is None:
        return scene
    return replace(scene, camera=Camera(eye=(0.0, 0.0, n.eye), half_height=grid.size * grid.step / 2.0))


def _draw(case: Case, accuracy: str, bake: bool, threads: int, grid: Grid) -> Render:
    from symrender_cg import evaluate, render_image

    if grid == image_grid(case.numbers, grid.size):
        scene = scene_of(case.numbers, grid)
        out = np.empty((grid.size, grid.size), case.dtype)
        return partial(
            render_image,
            scene,
            grid.size,
            grid.size,
            clip=False,
            accuracy=accuracy,
            bake=bake,
            threads=threads,
            out=out,
        )
    x, y = grid.axes(np.dtype(np.float64))
    scene = scene_of(case.numbers)
    return partial(evaluate, scene, x[np.newaxis, :], y[:, np.newaxis], accuracy=accuracy, bake=bake, clip=False)
