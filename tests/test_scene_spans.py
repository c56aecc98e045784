"""Spans of many rows side by side, gaps that spheres leave in a row, highlights of neighbours raised together: none of
it may show in the image. Bits are compared, so nothing here has a tolerance.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from symrender_cg import evaluate, render_image
from symrender_cg.pipeline import draw
from symrender_cg.reference import oracle
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.scene_kernel import SceneKernel, layer_arrays
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere
from symrender_cg.scene.random import random_spheres

Floats = npt.NDArray[np.float64]
ROWS = 8
"""So many rows the kernel works out side by side."""

SCENES = ("two_spheres", "intersecting", "eye_plane", "hundred", "mirrors")


def rows_of(scene: Scene, size: tuple[int, int], begin: int, end: int, accuracy: str = "double") -> Floats:
    """Rows [begin, end) as one call of the kernel writes them, before what is in doubt is settled."""
    drawing = draw(scene, accuracy, size=size)
    assert isinstance(drawing.kernel, SceneKernel)
    image = np.full(drawing.shape(end - begin, size[0]), np.nan, drawing.dtype)
    drawing.kernel.rows(image, drawing.numbers, begin=begin, end=end, first=begin)
    return image


@pytest.mark.parametrize("name", SCENES)
def test_a_row_is_the_same_wherever_the_rows_of_a_call_begin_and_end(name: str) -> None:
    scene, size = Scene.builtin(name), (67, 3 * ROWS + 5)
    whole = rows_of(scene, size, 0, size[1])
    assert np.isfinite(whole).all()
    for begin in range(ROWS + 2):
        for end in (begin, begin + 1, begin + ROWS, size[1] - 1, size[1]):
            assert np.array_equal(rows_of(scene, size, begin, end), whole[begin:end]), (begin, end)


def behind_one_another(count: int, width: int) -> Scene:
    """Spheres of a few pixels in a fence of `width`, each front row with gaps, and large ones behind them."""
    material = Phong(gate_specular=True)
    places = np.linspace(-0.7, 0.7, count)
    near = [Sphere((x, 0.001 * k, 1.0), 1.2 / width, material) for k, x in enumerate(places)]
    far = [Sphere((x, 0.0, -2.0), 0.6, material) for x in (-1.3, 0.0, 1.3)]
    return Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (*near, *far), (PointLight(),), shadows=False)


@pytest.mark.parametrize("count", [1, 7, 21])
def test_every_gap_of_a_row_shows_the_sphere_that_the_oracle_sees(count: int) -> None:
    width, height = 60, 60
    scene = behind_one_another(count, width)
    drawing = draw(scene, size=(width, height))
    assert isinstance(drawing.kernel, SceneKernel)
    layers = layer_arrays(("index",), (height, width), 1, 1)
    image = np.empty((height, width))
    drawing.kernel.rows(image, drawing.numbers, begin=0, end=height, layers=layers)
    found = drawing.plan.arrangement
    assert found is not None
    shown = np.where(layers["index"] < 0, -1, found.spheres[np.maximum(layers["index"], 0)])
    x, y = (values.ravel() for values in np.meshgrid(*pixel_centres(width, height, drawing.pixel)))
    assert np.array_equal(shown.ravel(), oracle.index(drawing.plan.scene, x, y))
    assert len(np.unique(shown)) > min(count, 4) + 1
    changes = np.diff(shown, axis=1) != 0
    assert changes.sum(axis=1).max() > count


@cache
def of_many_exponents(gated: bool) -> Scene:
    """A row of small spheres whose exponents are even and whole, odd, broken, small, large and 0, in turn."""
    exponents = (32.0, 33.0, 8.0, 7.0, 1024.0, 2000.0, 0.0, 10.5, 12.0, 64.0, 1.0, 0.5, 32.0, 32.0)
    spheres = [
        Sphere((-0.9 + 1.8 * k / (len(exponents) - 1), 0.05 * (k % 3), 0.0), 0.06, Phong(0.1, 0.3, 0.4, n, gated))
        for k, n in enumerate(exponents)
    ]
    return Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), tuple(spheres), (PointLight((0.5, 1.0, 6.0)),))


@pytest.mark.parametrize("accuracy", ["double", "single", "fast"])
@pytest.mark.parametrize("gated", [False, True])
def test_a_highlight_does_not_depend_on_the_exponents_of_what_is_shaded_with_it(accuracy: str, gated: bool) -> None:
    scene, side = of_many_exponents(gated), 96
    image = rows_of(scene, (side, side), 0, side, accuracy)
    for k, sphere in enumerate(scene.spheres):
        away = Sphere((0.0, -0.9, 0.0), 0.06, sphere.material)  # two spheres: a kernel of scenes
        alone = Scene(scene.camera, (sphere, away), scene.lights)
        its_own = rows_of(alone, (side, side), 0, side, accuracy)
        its_own[side * 3 // 4 :] = 0.0
        across = its_own > 0.0
        assert across.sum() > 8
        assert np.array_equal(image[across], its_own[across]), (k, sphere.material.shininess)


def test_an_even_whole_exponent_raises_highlights_as_well_as_its_neighbours_do() -> None:
    """Between n - 2^-40 and n + 2^-40 the power comes another way; what differs is rounding."""
    base = of_many_exponents(False)
    x = np.linspace(-0.95, 0.95, 4001)
    y = np.full_like(x, 0.01)
    for n in (8.0, 32.0, 50.0, 1024.0):
        values = []
        for exponent in (n, n * (1.0 + 2.0**-40)):
            material = Phong(0.1, 0.3, 0.4, exponent)
            spheres = tuple(Sphere(s.center, s.radius, material) for s in base.spheres)
            values.append(evaluate(Scene(base.camera, spheres, base.lights), x, y, clip=False))
        slope = 0.4 * 2.0**-40  # |d c^n / dn| n = |c^n ln c^n| <= 1/e
        assert np.abs(values[0] - values[1]).max() < slope + 1e-15
        assert (values[0] > 0.2).sum() > 20


def test_a_thousand_spheres_are_the_same_for_any_number_of_threads() -> None:
    scene = random_spheres(1000, 3)
    one = render_image(scene, 301, 203, threads=1)
    for threads in (2, 3, 5):
        assert np.array_equal(render_image(scene, 301, 203, threads=threads), one)
