"""`double` in scenes of many surfaces: what rounding may have decided is listed, and settled by enclosures.

Figures in docstrings: seeds 0 to 59 of random_scene at 48 x 48.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scene_strategies import random_scene

from symrender_cg import evaluate, render_image
from symrender_cg.derive.margins import GRAIN, gate_part, with_margin
from symrender_cg.derive.parts import echo_part, reach_part, shadow_part, tiles_part
from symrender_cg.errors import AccuracyError
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import draw, enclosure_kernel
from symrender_cg.reference import oracle
from symrender_cg.run import certify
from symrender_cg.run.drawing import Drawing
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.scene import Camera, Phong, Plane, PointLight, Scene, Sphere
from symrender_cg.stress.families import FAMILIES
from symrender_cg.stress.promises import has_absolute_bound

SIDE = 32
SEEDS = range(8)
PROMISED = 1e-15


def bound_kernel(scene: Scene, side: int = SIDE) -> Drawing:
    drawing = draw(scene, size=(side, side), force=("scene",))
    assert isinstance(drawing.kernel, SceneKernel)
    return drawing


def listed(drawing: Drawing, side: int = SIDE) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """The kernel's own image, and the pixels that it leaves open."""
    assert isinstance(drawing.kernel, SceneKernel)
    image, is_open = np.empty(drawing.shape(side, side)), np.zeros(side * side, dtype=np.bool_)
    places = drawing.kernel.rows(image, drawing.numbers, begin=0, end=side)
    assert len(np.unique(places)) == len(places), "no pixel is listed twice"
    is_open[places] = True
    return image, is_open.reshape(side, side)


def off(image: NDArray[Any], scene: Scene, drawing: Drawing, side: int = SIDE) -> NDArray[np.float64]:
    """|image - true intensity| / max(1, intensity), 0 where the enclosure knows nothing; the largest of channels."""
    x, y = pixel_centres(side, side, drawing.pixel)
    true = enclosure_kernel(scene).enclose(x[np.newaxis, :], y[:, np.newaxis])
    hi = true.hi.reshape(side, side, -1)[..., : drawing.channels]
    lo, error = true.lo.reshape(hi.shape), true.error.reshape(hi.shape)
    gap = np.abs((image.reshape(hi.shape) - hi) - lo) / np.maximum(1.0, np.abs(hi))
    return np.asarray(np.where(error < 1e-17, gap, 0.0).max(axis=-1))


@cache
def edge_cases(name: str, count: int = 40) -> tuple[tuple[Scene, float, float], ...]:
    family = next(entry for entry in FAMILIES if entry.name == name)
    found = [(case.scene, case.x, case.y) for case in family.cases(3, count)]
    return tuple((scene, x, y) for scene, x, y in found if scene is not None)


def split_tiles() -> Scene:
    """The plane y = -1 with tiles of side 1 that have an edge in x = 0."""
    plane = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), Phong(ambient=0.1), checker=Phong(ambient=0.7), tile=1.0)
    camera = Camera((0.0, 0.0, 4.0), half_height=1.0)
    return Scene(camera, (), (PointLight((0.0, 3.0, 2.0), 0.5),), plane=plane, shadows=False)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_pixel_that_the_kernel_does_not_list_is_off_by_more_than_is_promised(seed: int) -> None:
    """Settled pixels: at most 9.98e-16; of the pixels that are listed 15 were off by more."""
    scene = random_scene(seed)
    if not has_absolute_bound(scene):
        pytest.skip("nothing absolute is promised of this scene")
    drawing = bound_kernel(scene)
    image, is_open = listed(drawing)
    errors = off(image, scene, drawing)
    assert errors[~is_open].max(initial=0.0) <= PROMISED
    whole = np.empty_like(image)
    drawing.rows(whole, 0, SIDE)
    assert off(whole, scene, drawing).max() <= PROMISED
    np.testing.assert_array_equal(whole[~is_open], image[~is_open])


def test_few_pixels_are_listed_where_nothing_is_close() -> None:
    for name in ("two_spheres", "shadow", "intersecting", "hidden", "hundred", "mirrors"):
        _, is_open = listed(bound_kernel(Scene.builtin(name), 128), 128)
        assert is_open.mean() < 0.001, name


@pytest.mark.parametrize("name", ["shadow_edge", "mirror_edge", "near_depths", "tile_edge"])
def test_edges_are_on_the_side_where_the_oracle_has_them(name: str) -> None:
    """Without the list of doubts some of these show the other side of the edge: the same kernel, nobody asked."""
    flips = 0
    for scene, x, y in edge_cases(name):
        try:
            true = np.asarray(oracle.evaluate(scene, x, y).value)
        except AccuracyError:
            continue
        if has_absolute_bound(scene):
            value = evaluate(scene, x, y)
            assert np.abs(value - true).max() <= PROMISED * max(1.0, float(np.abs(true).max()))
        alone = draw(scene, force=("scene",))
        own = np.empty(alone.shape())
        assert isinstance(alone.kernel, SceneKernel)
        alone.kernel.points(own, np.array(x), np.array(y), alone.numbers)
        flips += bool(np.abs(own - true.reshape(-1)[: own.size].reshape(own.shape)).max() > 1e-9)
    assert flips > 0, "these cases are not hard"


def test_points_and_pixels_that_are_settled_are_the_same_bits() -> None:
    scene = split_tiles()
    drawing = bound_kernel(scene, 33)
    _, is_open = listed(drawing, 33)
    assert is_open.any()
    x, y = pixel_centres(33, 33, drawing.pixel)
    whole = render_image(scene, 33, 33, clip=False)
    np.testing.assert_array_equal(evaluate(scene, x[np.newaxis, :], y[:, np.newaxis]), whole)
    assert whole.max() > 1.0
    clipped = render_image(scene, 33, 33)
    np.testing.assert_array_equal(clipped, np.minimum(whole, 1.0))


def test_what_nothing_settles_stays_as_the_kernel_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(job: Any, points: Any, places: Any) -> Any:
        raise AccuracyError("a tie", [int(place) for place in places])

    scene = split_tiles()
    drawing = bound_kernel(scene, 33)
    image, is_open = listed(drawing, 33)
    monkeypatch.setattr(certify, "_enclosed", never)
    monkeypatch.setattr(certify, "_asked", never)
    whole = np.empty_like(image)
    drawing.rows(whole, 0, 33)
    assert is_open.any()
    np.testing.assert_array_equal(whole, image)


def test_of_points_some_of_which_rest_on_a_tie_the_others_are_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = certify._asked

    def partly(job: Any, points: Any, places: Any) -> Any:
        if 2 in places:
            raise AccuracyError("a tie", [2])
        return honest(job, points, places)

    def nothing(job: Any, points: Any, places: Any) -> Any:
        return np.zeros((places.size, 1)), np.zeros(places.size, dtype=np.bool_), 0.0

    monkeypatch.setattr(certify, "_asked", partly)
    monkeypatch.setattr(certify, "_enclosed", nothing)
    scene = Scene.builtin("two_spheres")
    x, y = np.linspace(-0.5, 0.5, 5), np.zeros(5)
    job = certify.Job(scene, variant("stable"), clip=False)
    values, known = certify.settle_if_known(job, x, y)
    assert known.tolist() == [True, True, False, True, True]
    true = np.asarray(oracle.evaluate(scene, x, y).value)
    np.testing.assert_allclose(values[known, 0], true[known], rtol=1e-15)


def test_an_edge_of_a_tile_through_pixel_centres_is_listed_and_a_float_beside_it_is_right() -> None:
    """Odd widths put a column of pixels on the edge in x = 0."""
    scene = split_tiles()
    drawing = bound_kernel(scene, 33)
    _, is_open = listed(drawing, 33)
    assert is_open[20:, 16].all()
    assert not is_open[20:, 17:].all()
    image = render_image(scene, 33, 33, clip=False)
    true = np.asarray(oracle.evaluate(scene, np.zeros(12), pixel_centres(33, 33, drawing.pixel)[1][20:32]).value)
    np.testing.assert_allclose(image[20:32, 16], true, atol=1e-15)


def test_a_highlight_with_an_infinite_slope_is_left_to_the_enclosure() -> None:
    glossy = Phong(ambient=0.1, diffuse=0.2, specular=0.5, shininess=0.5)
    camera = Camera((0.0, 0.0, 4.0), half_height=1.2)
    lights = (PointLight((2.0, 1.0, 3.0), 0.5), PointLight((-3.0, 0.0, 4.0), 0.5))
    scene = Scene(camera, (Sphere((0.0, 0.0, 0.0), 1.0, glossy),), lights, shadows=False)
    drawing = bound_kernel(scene)
    _, is_open = listed(drawing)
    assert is_open.any()
    whole = np.empty(drawing.shape(SIDE, SIDE))
    drawing.rows(whole, 0, SIDE)
    assert off(whole, scene, drawing).max() <= PROMISED


def test_single_lists_nothing() -> None:
    scene = Scene.builtin("mirrors")
    drawing = draw(scene, "single", size=(SIDE, SIDE))
    assert isinstance(drawing.kernel, SceneKernel)
    image = np.empty(drawing.shape(SIDE, SIDE), np.float32)
    assert drawing.kernel.rows(image, drawing.numbers, begin=0, end=SIDE).size == 0


def test_margins_grow_with_the_blur_of_the_points_and_vanish_where_nothing_is_decided() -> None:
    for part in (shadow_part("p"), tiles_part(), gate_part(), echo_part("p")):
        sharp, blurred = with_margin(part, blurred=False), with_margin(part, blurred=True)
        assert "margin" in sharp.results
        assert "blur" in blurred.inputs
        assert "blur" not in sharp.inputs
        margin = blurred.closed("margin")
        numbers = {symbol: 0.5 + 0.125 * k for k, symbol in enumerate(sorted(margin.free_symbols, key=str))}
        blur = next(symbol for symbol in margin.free_symbols if symbol.name == "blur")
        near, far = (float(margin.subs(numbers | {blur: value})) for value in (1.0, 2.0))
        assert far < near, part.name
    assert 2.0**-46 < float(GRAIN) < 2.0**-40
    reach = reach_part("p")
    assert with_margin(reach, blurred=True) is reach
