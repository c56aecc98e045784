"""Our kernels, called as a user calls them: render_image, and evaluate where the grid is not an image's.

Comes in: a Case. Goes out: one arrangement; nothing where a level has another format than the case, or where a baked
kernel is asked for and the case has arguments. Never done here: an entry point that users do not have, but
for `double_alone`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.case import Arrangements, Case, Factory, Grid, Numbers, Render, image_grid


def level(accuracy: str, form: str, *, bake: bool) -> Factory:
    """The contestant of an accuracy level whose kernel computes in that format, its numbers baked or not."""

    def factory(case: Case, threads: int) -> Arrangements:
        if case.format != form or (bake and not case.baked):
            return {}
        by = "stable's kernel" if _hands_over(case, accuracy, bake) else "render_image"
        return {by: partial(_draw, case, accuracy, bake, threads)}

    return factory


def double_alone(case: Case, threads: int) -> Arrangements:
    """The kernel of `double` where render_image does not take it, because it would break the promise of the level."""
    if case.format != "float64" or not _hands_over(case, "double", False):
        return {}

    def draw(grid: Grid) -> Render:
        from symrender_cg.pipeline import draw as bound

        if grid != image_grid(case.numbers, grid.size):
            return _draw(case, "double", False, threads, grid)
        drawing = bound(scene_of(case.numbers, grid), "double", size=(grid.size, grid.size))
        out = np.empty((grid.size, grid.size), case.dtype)

        def render() -> NDArray[Any]:
            drawing.rows(out, 0, grid.size)
            return out

        return render

    return {"double's kernel": draw}


def _hands_over(case: Case, accuracy: str, bake: bool) -> bool:
    from symrender_cg.run.levels import hands_over

    return accuracy == "double" and not bake and hands_over(scene_of(case.numbers))


literal = level("literal", "float64", bake=False)
double = level("double", "float64", bake=False)
double_baked = level("double", "float64", bake=True)
single = level("single", "float32", bake=False)
single_baked = level("single", "float32", bake=True)
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
