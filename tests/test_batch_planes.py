"""`render_batch` of scenes with planes, mirrors and cameras that move: the bits of render_image, and few plans."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from evaluators import same_bits
from msgspec import structs

from symrender_cg import Camera, DirectionalLight, Phong, Plane, PointLight, Scene, Sphere, render_batch, render_image
from symrender_cg.errors import SceneError
from symrender_cg.pipeline import statistics
from symrender_cg.run import batch
from symrender_cg.run.parameters import parameter_sets
from symrender_cg.scene import Gradient

MIRROR = Phong(0.05, 0.4, 0.3, 20.0, True, 0.4)
GLOSSY = Phong(0.1, 0.3, 0.2, 9.0, True, 0.25)
PLAIN = Scene(
    Camera((0.0, 0.5, 6.0), half_height=1.5),
    (Sphere((-0.5, 0.0, 0.5), 0.5, Phong(gate_specular=True)), Sphere((0.4, 0.1, -0.6), 0.6, Phong(0.05, 0.6, 0.0))),
    (PointLight((-6.0, 4.0, 6.0)), DirectionalLight((1.0, -2.0, -1.0), 0.25)),
)
FLOOR = structs.replace(PLAIN, plane=Plane((0.0, -0.7, 0.0), (0.0, 1.0, 0.0), Phong(0.1, 0.5, 0.0)))
TILES = structs.replace(PLAIN, plane=Plane((0.0, -0.7, 0.0), (0.1, 1.0, 0.0), GLOSSY, Phong(0.1, 0.1, 0.0), 0.7))
HALL = structs.replace(
    TILES,
    spheres=(Sphere((-0.6, 0.0, 0.5), 0.5, MIRROR), Sphere((0.6, 0.1, -0.4), 0.6, MIRROR)),
    background=Gradient(0.1, 0.6),
)
SCENES = {"plain": PLAIN, "floor": FLOOR, "tiles": TILES, "hall": HALL}
SIZE = (24, 18)
PLACES = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 3))
CHANGES: dict[str, Any] = {
    "a light": {"lights.0.position": np.array((-6.0, 4.0, 6.0)) + 3.0 * PLACES},
    "a sphere": {"spheres.0.center": np.array((-0.5, 0.0, 0.5)) + 0.3 * PLACES},
    "the eye": {"camera.eye": np.array((0.0, 0.5, 6.0)) + PLACES},
    "what the camera looks at, and its view": {
        "camera.look_at": 0.3 * PLACES,
        "camera.half_height": 1.5 + 0.2 * PLACES[:, 0],
    },
    "the plane": {"plane.point.1": -0.7 + 0.3 * PLACES[:, 0], "plane.normal.0": 0.1 * PLACES[:, 1]},
    "a light in parallel, and a mirror": {
        "lights.1.direction": np.array((1.0, -2.0, -1.0)) + PLACES,
        "spheres.1.material.reflect": 0.5 + 0.4 * PLACES[:, 0],
    },
}
CASES = [
    ("plain", "the eye"),
    ("floor", "a light"),
    ("floor", "the eye"),
    ("tiles", "the plane"),
    ("tiles", "what the camera looks at, and its view"),
    ("hall", "a light"),
    ("hall", "a sphere"),
    ("hall", "the eye"),
    ("hall", "a light in parallel, and a mirror"),
]


@pytest.mark.parametrize(("name", "what"), CASES)
def test_every_image_has_the_bits_of_render_image(name: str, what: str) -> None:
    scene, parameters = SCENES[name], {path: values[:7] for path, values in CHANGES[what].items()}
    sets = parameter_sets(scene, parameters)
    scenes = [sets.scene(k) for k in range(sets.count)]
    wanted = np.stack([render_image(each, *SIZE, clip=False) for each in scenes])
    assert same_bits(render_batch(scene, parameters, *SIZE, clip=False, threads=2), wanted)
    assert same_bits(render_batch(None, scenes, *SIZE, clip=False), wanted)


@pytest.mark.parametrize(("name", "what"), [("hall", "the eye"), ("floor", "a light")])
@pytest.mark.parametrize("accuracy", ["single", "stable"])
def test_at_other_levels_too(name: str, what: str, accuracy: str) -> None:
    scene, parameters = SCENES[name], {path: values[:4] for path, values in CHANGES[what].items()}
    sets = parameter_sets(scene, parameters)
    wanted = np.stack([render_image(sets.scene(k), 12, 9, accuracy=accuracy) for k in range(4)])
    assert same_bits(render_batch(scene, parameters, 12, 9, accuracy=accuracy), wanted)


@pytest.mark.parametrize(("name", "what"), CASES)
def test_hundreds_of_sets_are_planned_once_for_each_set_of_effects(
    name: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That occurs: at most three or four, however much moves."""
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 60.0)
    before = statistics.planned
    render_batch(SCENES[name], CHANGES[what], 4, 3)
    assert statistics.planned - before <= 5


ASIDE = Camera((3.0, 2.0, 6.0), (0.1, -0.2, 0.0), (0.1, 1.0, 0.2))
BALL = Sphere((0.3, 0.1, -0.2), 1.0)
ONE_SPHERE: dict[str, Scene] = {
    "Chapter 1's": Scene.chapter1(),
    "beside the point looked at": Scene(ASIDE, (BALL,), (PointLight((5.0, 5.0, 10.0)),)),
    "a gated highlight": Scene(ASIDE, (structs.replace(BALL, material=MIRROR),), (PointLight((5.0, 5.0, 10.0)),)),
    "a light close by": Scene(
        structs.replace(ASIDE, half_height=1.5),
        (structs.replace(BALL, material=Phong(shininess=200.0)),),
        (PointLight((0.4, 0.3, 1.0)),),
    ),
}
ONE_CHANGES: dict[str, Any] = {
    "the eye": {"camera.eye": np.array((2.5, 2.0, 6.0)) + PLACES},
    "along its axis": {"camera.eye": np.array([(0.0, 0.0, 5.0 + z) for z in PLACES[:, 2].tolist()])},
    "what it looks at, upside down": {
        "camera.look_at": 0.3 * PLACES,
        "camera.up": np.array((0.0, -1.0, 0.0)) + 0.1 * PLACES,
    },
    "its view, and the sphere": {
        "camera.half_height": 1.5 + 0.2 * PLACES[:, 0],
        "spheres.0.center": 0.3 * PLACES,
        "spheres.0.radius": 1.0 + 0.1 * PLACES[:, 1],
    },
    "a light": {"lights.0.position": np.array((3.0, 4.0, 6.0)) + PLACES},
}


@pytest.mark.parametrize("what", ONE_CHANGES)
@pytest.mark.parametrize("name", ONE_SPHERE)
def test_one_sphere_seen_by_cameras_that_move_has_the_bits_of_render_image(name: str, what: str) -> None:
    scene, parameters = ONE_SPHERE[name], {path: values[:7] for path, values in ONE_CHANGES[what].items()}
    sets = parameter_sets(scene, parameters)
    scenes = [sets.scene(k) for k in range(sets.count)]
    for accuracy in ("double", "single", "stable"):
        wanted = np.stack([render_image(each, *SIZE, accuracy=accuracy, clip=False) for each in scenes])
        assert same_bits(render_batch(scene, parameters, *SIZE, accuracy=accuracy, clip=False), wanted)
        assert same_bits(render_batch(None, scenes, *SIZE, accuracy=accuracy, clip=False), wanted)


@pytest.mark.parametrize("what", ONE_CHANGES)
def test_one_sphere_is_planned_once_wherever_the_camera_stands(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 60.0)
    before = statistics.planned
    render_batch(ONE_SPHERE["beside the point looked at"], ONE_CHANGES[what], 4, 3, accuracy="single")
    assert statistics.planned - before <= 2


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("camera.eye", [(3.0, 2.0, 6.0), (0.5, 0.1, -0.2)]),
        ("camera.eye", [(3.0, 2.0, 6.0), (0.1, -0.2, 0.0)]),
        ("camera.up", [(0.1, 1.0, 0.2), (0.0, 0.0, 0.0)]),
        ("camera.half_height", [1.0, -1.0]),
    ],
)
def test_a_camera_that_sees_nothing_is_named_by_its_set(path: str, values: list[Any]) -> None:
    with pytest.raises(SceneError, match=r"^parameters, set 1: camera"):
        render_batch(ONE_SPHERE["a gated highlight"], {path: values}, 8, 8)
