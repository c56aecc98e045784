"""A warm call costs a fixed, small number of Python calls: nothing of a scene is hashed, compared or looked through."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from evaluators import ACCURACIES, same_bits, scene_of

from symrender_cg import render_image
from symrender_cg.errors import ArgumentError
from symrender_cg.pipeline import statistics
from symrender_cg.run import ready
from symrender_cg.scene import Phong, PointLight, Scene, Sphere

MOST_PYTHON_CALLS = 26
"""Of one warm call; measured: 21 for one sphere, 23 for a scene of many. Before they were remembered: 78 and 69."""

MOST_C_CALLS = 24
"""The same for functions that are not Python's: 15 and 19; before, 76 and 69."""


def calls_during(call: Callable[[], object]) -> tuple[int, int]:
    """How many Python functions and how many others run during the second of two calls."""
    call()
    counted = {"call": 0, "c_call": 0}

    def count(_frame: object, event: str, _argument: object) -> None:
        if event in counted:
            counted[event] += 1

    sys.setprofile(count)
    try:
        call()
    finally:
        sys.setprofile(None)
    return counted["call"] - 1, counted["c_call"] - 1  # not the lambda, nor the last setprofile


def row_of_spheres(count: int) -> Scene:
    """Disjoint spheres side by side, without shadows."""
    spheres = tuple(Sphere((3.0 * k / count - 1.5, 0.0, 0.0), 1.0 / count) for k in range(count))
    return Scene(spheres=spheres, shadows=False)


@pytest.mark.parametrize("accuracy", [*ACCURACIES, "fast"])
def test_a_warm_call_makes_few_python_calls(accuracy: str) -> None:
    scene, out = Scene.chapter1(), np.empty((64, 64), np.float32 if accuracy in ("single", "fast") else np.float64)
    for call in (
        lambda: render_image(scene, 64, 64, accuracy=accuracy),
        lambda: render_image(scene, 64, 64, accuracy=accuracy, out=out),
        lambda: render_image(None, 64, 64, accuracy=accuracy, clip=False, threads=1),
    ):
        python, others = calls_during(call)
        assert python <= MOST_PYTHON_CALLS
        assert others <= MOST_C_CALLS


def test_a_warm_call_of_many_spheres_makes_as_few_calls_as_one_of_two() -> None:
    counts = set()
    for count in (2, 20, 300):
        scene = row_of_spheres(count)
        counts.add(calls_during(lambda scene=scene: render_image(scene, 32, 32, threads=1)))  # type: ignore[misc]
    assert len(counts) == 1
    python, others = counts.pop()
    assert python <= MOST_PYTHON_CALLS
    assert others <= MOST_C_CALLS


def test_the_calls_of_a_call_do_not_depend_on_the_size_of_the_image() -> None:
    scene = Scene.chapter1()
    assert len({calls_during(lambda w=w: render_image(scene, w, w)) for w in (1, 16, 200)}) == 1  # type: ignore[misc]


def test_a_warm_call_has_the_bits_of_a_cold_one() -> None:
    scene = scene_of("off_axis_sphere")
    cold = render_image(scene, 33, 20)
    assert same_bits(render_image(scene, 33, 20), cold)
    assert not same_bits(render_image(scene, 33, 20, clip=False), cold)
    assert render_image(scene, 20, 33).shape == (33, 20)
    assert same_bits(render_image(scene, 33, 20), cold)


def test_a_scene_in_the_place_of_a_forgotten_one_is_not_taken_for_it() -> None:
    """Scenes are known by identity, and Python gives the identity of a scene that is gone to another one."""
    identities, images = set(), []
    for k in range(40):
        scene = Scene.chapter1(light=(5.0, 5.0, 10.0 + 0.1 * k))
        identities.add(id(scene))
        images.append(render_image(scene, 12, 12, clip=False).tobytes())
        del scene
    assert len(set(images)) == 40
    assert [
        render_image(Scene.chapter1(light=(5.0, 5.0, 10.0 + 0.1 * k)), 12, 12, clip=False).tobytes() for k in (0, 39)
    ] == [
        images[0],
        images[39],
    ]


def test_few_images_are_remembered() -> None:
    scene = Scene.chapter1()
    for width in range(1, 4 * ready.MOST_KEPT):
        render_image(scene, width, 3)
        assert len(ready._kept) <= ready.MOST_KEPT


@pytest.mark.parametrize(("width", "height"), [(True, 64), (64.0, 64), (1, True), (64, 64.0)])
def test_what_equals_a_known_size_and_is_none_is_refused_when_warm(width: int, height: int) -> None:
    render_image(None, 64, 64)
    render_image(None, 1, 64)
    render_image(None, 1, 1)
    with pytest.raises(ArgumentError, match=r"is not a number of pixels"):
        render_image(None, width, height)


def test_numpy_integers_are_sizes_when_warm() -> None:
    image = render_image(None, 9, 7)
    assert same_bits(render_image(None, np.int64(9), np.uint8(7)), image)  # type: ignore[arg-type]


@pytest.mark.parametrize("target", [["float32"], {}])
def test_an_argument_that_has_no_hash_is_refused_with_its_name(target: object) -> None:
    render_image(None, 9, 7)
    with pytest.raises(ArgumentError, match="target"):
        render_image(None, 9, 7, target=target)  # type: ignore[arg-type]


def test_another_cache_folder_is_looked_into_when_warm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(lights=(PointLight(),), spheres=(Sphere(material=Phong(specular=0.0)),))
    image = render_image(scene, 10, 10)
    before = statistics.compiled + statistics.recalled
    assert same_bits(render_image(scene, 10, 10), image)
    assert statistics.compiled + statistics.recalled == before
    monkeypatch.setenv("SYMRENDER_CACHE_DIR", str(tmp_path))
    assert same_bits(render_image(scene, 10, 10), image)
    assert statistics.compiled + statistics.recalled == before + 1
    assert any(tmp_path.iterdir())


def test_a_warm_call_counts_as_a_kernel_reused() -> None:
    render_image(None, 11, 11)
    before = statistics.reused
    render_image(None, 11, 11)
    assert statistics.reused == before + 1
