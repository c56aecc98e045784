"""Frames and half-heights of many cameras at once: the bits that each scene has alone."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

from symrender_cg import Camera, PointLight, Scene, Sphere
from symrender_cg.errors import SceneError
from symrender_cg.run.framed import framed_half_heights
from symrender_cg.run.turned import frames_of, unit_vectors
from symrender_cg.run.two_words import is_nearest, quotient_of, root_of, sum_of
from symrender_cg.scene import DirectionalLight
from symrender_cg.scene.framing import framed_half_height

Floats = NDArray[np.float64]
COUNT = 300


def cameras(seed: int) -> tuple[Floats, Floats, Floats]:
    """Eyes, points looked at, ways up: anywhere, on whole numbers, upright, towards the origin, in their own frame."""
    draws = np.random.default_rng(seed)
    eye, look_at, up = draws.uniform(-5, 5, (COUNT, 3)), draws.uniform(-1, 1, (COUNT, 3)), draws.normal(size=(COUNT, 3))
    for array in (eye, look_at, up):
        array[::3] = np.round(array[::3])
    up[::4] = (0.0, 1.0, 0.0)
    look_at[::6] = 0.0
    eye[::30] = (0.0, 0.0, 4.0)
    return eye, look_at, up


@pytest.mark.parametrize("seed", range(3))
def test_points_and_directions_are_turned_as_each_scene_turns_its_own(seed: int) -> None:
    eye, look_at, up = cameras(seed)
    draws = np.random.default_rng(100 + seed)
    points = np.concatenate(
        (draws.uniform(-9, 9, (COUNT, 2, 3)), np.round(draws.uniform(-3, 3, (COUNT, 3, 3)))), axis=1
    )
    points[:, 4] = look_at
    directions = np.concatenate(
        (draws.normal(size=(COUNT, 1, 3)), np.round(draws.uniform(-1.4, 1.4, (COUNT, 2, 3)))), axis=1
    )
    directions[(directions == 0.0).all(axis=2)] = (0.0, 1.0, 0.0)
    with np.errstate(all="ignore"):
        frames = frames_of(*(array + 0.0 for array in (eye, look_at, up)))
        placed, aimed = frames.points(points + 0.0), frames.directions(directions + 0.0)
    turned = 0
    for t in range(COUNT):
        lights = [PointLight(tuple(place)) for place in points[t].tolist()]
        lamps = [DirectionalLight(tuple(direction)) for direction in directions[t].tolist()]
        try:
            camera = Camera(tuple(eye[t].tolist()), tuple(look_at[t].tolist()), tuple(up[t].tolist()), 1.0)
        except SceneError:
            assert np.isnan(placed[t]).all()
            continue
        own = Scene(camera, (), (*lights, *lamps)).in_camera_frame()
        if np.isnan(placed[t]).any():
            continue
        turned += 1
        assert own.camera.eye == (0.0, 0.0, float(frames.eye_distance[t]))
        for k, light in enumerate(own.lights[:5]):
            assert isinstance(light, PointLight)
            assert np.array(light.position).tobytes() == placed[t, k].tobytes()
        for k, lamp in enumerate(own.lights[5:]):
            assert isinstance(lamp, DirectionalLight)
            assert np.array(lamp.direction).tobytes() == aimed[t, k].tobytes()
    assert turned > 0.9 * COUNT


def test_one_camera_turns_the_points_of_many_scenes() -> None:
    eye, look_at, up = (np.array([v]) for v in ((3.0, 2.0, 6.0), (0.25, -0.5, 0.0), (0.1, 1.0, 0.2)))
    points = np.random.default_rng(0).uniform(-9, 9, (20, 3, 3))
    one = frames_of(eye, look_at, up)
    every = frames_of(*(np.repeat(v, 20, axis=0) for v in (eye, look_at, up)))
    assert one.points(points).tobytes() == every.points(points).tobytes()
    assert one.points(points[:1]).shape == (1, 3, 3)


def test_unit_vectors_are_the_nearest_float64() -> None:
    """|hi - v_k / |v|| is at most half the distance of its neighbours: by squares of whole numbers."""
    draws = np.random.default_rng(5)
    given = np.concatenate((draws.normal(size=(40, 3)), np.round(draws.uniform(-3, 3, (40, 3))), [(3.0, 0.0, 4.0)]))
    given[(given == 0.0).all(axis=1)] = (0.0, 0.0, -7.0)
    for v, unit in zip(given.tolist(), unit_vectors(given).tolist(), strict=True):
        square = sum(Fraction(c) ** 2 for c in v)
        for c, u in zip(v, unit, strict=True):
            near = [abs((Fraction(u) + Fraction(math.nextafter(u, end))) / 2) for end in (-math.inf, math.inf)]
            assert min(near) ** 2 * square <= Fraction(c) ** 2 <= max(near) ** 2 * square or u == c == 0.0


@pytest.mark.parametrize("number", [1, 2, 5, 20])
def test_half_heights_frame_the_spheres_as_each_scene_frames_its_own(number: int) -> None:
    """Also where a sphere is at the origin, behind the eye, close to its plane, or all numbers are multiples of 1/4."""
    draws = np.random.default_rng(number)
    eye, center = draws.uniform(3, 8, COUNT), draws.uniform(-2, 2, (COUNT, number, 3))
    radius = draws.uniform(0.1, 1.2, (COUNT, number))
    center[::7, 0] = 0.0
    center[::11, -1, 2] = eye[::11] + draws.uniform(-3, 4, len(eye[::11]))
    eye[::5] = 6.0
    center[::15], radius[::15] = np.round(center[::15] * 4) / 4, np.maximum(np.round(radius[::15] * 4) / 4, 0.25)
    found = framed_half_heights(eye, center, radius)
    for t in range(COUNT):
        places = zip(center[t].tolist(), radius[t].tolist(), strict=True)
        try:
            wanted = framed_half_height(float(eye[t]), tuple(Sphere((x, y, z), r) for (x, y, z), r in places))
        except SceneError:
            assert np.isnan(found[t])
        else:
            assert wanted == found[t]
    assert np.isnan(found).sum() < 0.2 * COUNT


def test_a_scene_that_cannot_be_framed_leaves_the_others_as_they_are() -> None:
    eye, radius = np.array([4.0, math.nan, 4.0, 4.0, 4.0]), np.array([[1.0], [1.0], [-1.0], [math.nan], [1.0]])
    found = framed_half_heights(eye, np.zeros((5, 1, 3)), radius)
    assert np.isnan(found).tolist() == [False, True, True, True, False]
    assert found[0] == framed_half_height(4.0, (Sphere(),))


def test_two_words_hold_sums_quotients_and_roots_to_96_bits() -> None:
    draws = np.random.default_rng(9)
    a, b = ((draws.uniform(1, 2, 50), draws.uniform(-1, 1, 50) * 2.0**-54) for _ in range(2))

    def whole(pair: tuple[Floats, Floats], k: int) -> Fraction:
        return Fraction(float(pair[0][k])) + Fraction(float(pair[1][k]))

    total, ratio, root = sum_of([a, b]), quotient_of(a, b), root_of(a)
    for k in range(50):
        x, y = whole(a, k), whole(b, k)
        assert abs(whole(total, k) / (x + y) - 1) < Fraction(1, 2**96)
        assert abs(whole(ratio, k) * y / x - 1) < Fraction(1, 2**96)
        assert abs(whole(root, k) ** 2 / x - 1) < Fraction(1, 2**95)


def test_a_tie_is_not_said_to_be_decided() -> None:
    one, half = np.ones(4), np.array([2.0**-53, 2.0**-53 * (1 - 2.0**-20), -(2.0**-54), 0.0])
    assert is_nearest((one, half), 2.0**-90).tolist() == [False, True, False, True]
    assert not is_nearest((np.zeros(1), np.zeros(1)), 2.0**-90).any()
    assert is_nearest((np.zeros(1), np.zeros(1)), 0.0).all()
