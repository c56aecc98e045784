"""A new scene is planned once: the level that draws it, its kernel and what settles its pixels share that plan."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from evaluators import same_bits

from symrender_cg import Scene, certify, render_image
from symrender_cg.pipeline import planned, statistics
from symrender_cg.reference import oracle
from symrender_cg.reference.points import whole_image
from symrender_cg.run.levels import hands_over
from symrender_cg.scene import Sphere

SIZE = 48


BACKGROUNDS = {"double": 0.0123, "stable": 0.0124}
"""Of scenes that nobody has drawn yet."""


@pytest.mark.parametrize("accuracy", BACKGROUNDS)
@pytest.mark.parametrize("name", ["two_spheres", "mirrors"])
def test_an_image_of_a_new_scene_of_many_surfaces_takes_one_plan(name: str, accuracy: str) -> None:
    render_image(Scene.builtin(name), SIZE, SIZE, accuracy=accuracy)
    scene = msgspec.structs.replace(Scene.builtin(name), background=BACKGROUNDS[accuracy])
    before = statistics.planned
    render_image(scene, SIZE, SIZE, accuracy=accuracy)
    render_image(scene, SIZE, 2 * SIZE, accuracy=accuracy)
    assert statistics.planned == before + 2  # one for each shape of the window


def aside(one: Scene) -> Scene:
    """The same with a small sphere far out of every window of these tests."""
    camera = msgspec.structs.replace(one.camera, half_height=1.25)
    return msgspec.structs.replace(one, camera=camera, spheres=(*one.spheres, Sphere((40.0, 0.0, -3.0), 0.5)))


def test_a_sphere_outside_the_window_does_not_keep_the_compensated_kernel_away() -> None:
    scene = aside(Scene.chapter1(shininess=0.5))
    assert planned(scene).arrangement is not None
    assert planned(scene, aspect=1.0).arrangement is None
    assert not hands_over(scene)
    assert hands_over(scene, 1.0)
    image = render_image(scene, SIZE, SIZE, clip=False)
    assert same_bits(image, render_image(scene, SIZE, SIZE, accuracy="stable", clip=False))
    truth = oracle.evaluate(scene, *whole_image(alone(scene), SIZE, SIZE)).value.reshape(SIZE, SIZE)
    assert (np.abs(image - truth) <= 1e-15 * np.maximum(1.0, truth)).all()


@pytest.mark.parametrize("scene", [aside(Scene.chapter1()), Scene.builtin("mirrors")], ids=["aside", "mirrors"])
def test_the_plan_of_the_window_settles_the_same_values_as_the_plan_of_any_points(scene: Scene) -> None:
    """Rounding is the certificate's; only what no pixel can see is left out of the window's plan."""
    image = certify(scene, SIZE, SIZE, clip=False).values
    x, y = (part.reshape(SIZE, SIZE) for part in whole_image(alone(scene), SIZE, SIZE))
    assert same_bits(image, oracle.settle(scene, x, y, "float64"))


def alone(scene: Scene) -> Scene:
    """One grey sphere and one light with the camera of a scene: what the pixel grid is taken from."""
    return msgspec.structs.replace(Scene.chapter1(), camera=scene.in_camera_frame().camera)
