"""Numbers are arguments: whatever changes in number only is drawn by one compiled kernel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evaluators import ACCURACIES, GEOMETRIES, MARKER, scene_of, with_background

from symrender_cg import evaluate, render_image
from symrender_cg.build import Cache
from symrender_cg.pipeline import build_kernel, compile_kernel, statistics, translate
from symrender_cg.reference import oracle
from symrender_cg.run.levels import hands_over, steep_part
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

Counts = tuple[int, int, int, int]


def counts() -> Counts:
    return statistics.derived, statistics.compiled, statistics.recalled, statistics.reused


def grown(before: Counts) -> Counts:
    derived, compiled, recalled, reused = (after - past for after, past in zip(counts(), before, strict=True))
    return derived, compiled, recalled, reused


def scenes_of_numbers(count: int, *, centred: bool) -> list[Scene]:
    """Scenes that differ in every number: position, radius, eye, light, coefficients, whole and broken shininess."""
    random = np.random.default_rng(count)
    found = []
    for index in range(count):
        radius, depth = random.uniform(0.1, 3.0), random.uniform(1.5, 9.0)
        eye = radius * depth
        center = (0.0, 0.0, 0.0)
        if not centred:
            center = (
                radius * random.uniform(-1.0, 1.0),
                radius * random.uniform(0.1, 1.0),
                radius * random.uniform(-1.0, 0.4),
            )
        shininess = float(random.integers(0, 300)) if index % 2 else random.uniform(0.0, 300.0)
        material = Phong(random.uniform(0.0, 1.0), random.uniform(0.1, 1.0), random.uniform(0.1, 1.0), shininess)
        light = PointLight((random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(4, 9)), random.uniform(0.1, 2))
        camera = Camera((0.0, 0.0, eye), half_height=1.5 * radius)
        found.append(Scene(camera, (Sphere(center, radius, material),), (light,), random.uniform(0.0, 1.0)))
    return found


@pytest.mark.parametrize("centred", [True, False])
def test_a_hundred_scenes_that_differ_in_numbers_are_one_compile(tmp_path: Path, centred: bool) -> None:
    before = counts()
    scenes = scenes_of_numbers(100, centred=centred)
    images = [render_image(scene, 9, 7, accuracy="single", cache=tmp_path) for scene in scenes]
    assert grown(before) == (1, 1, 0, 99)
    assert len({image.tobytes() for image in images}) == 100


def test_a_hundred_scenes_at_double_are_two_compiles_at_most(tmp_path: Path) -> None:
    """The kernel of double, and the compensated one that draws where plain float64 would not keep its promise."""
    before = counts()
    scenes = scenes_of_numbers(100, centred=True)
    assert {hands_over(scene) for scene in scenes} == {True, False}
    boxed = [scene for scene in scenes if steep_part(scene) is not None]
    for scene in scenes:
        render_image(scene, 9, 7, cache=tmp_path)
    derived, compiled, recalled, reused = grown(before)
    assert (derived, compiled, recalled) == (2, 2, 0)
    assert 98 <= reused <= 98 + len(boxed), "where the highlight is steep a scene asks for both kernels"


def test_a_moved_camera_and_a_moved_point_are_no_new_kernel(tmp_path: Path) -> None:
    scene = scene_of("off_axis_sphere")
    evaluate(scene, 0.0, 0.0, cache=tmp_path)
    before = counts()
    for step in range(10):
        moved = Scene(
            Camera((0.1 * step, 1.0, 4.0), (0.2, 0.1 * step, 0.0), (0.1, 1.0, 0.0)), scene.spheres, scene.lights
        )
        evaluate(moved, [0.1 * step], 0.3, cache=tmp_path)
    assert grown(before) == (0, 0, 0, 10)


def test_each_structure_and_each_accuracy_is_a_kernel_of_its_own(tmp_path: Path) -> None:
    before = counts()
    for geometry in GEOMETRIES:
        for accuracy in ACCURACIES:
            evaluate(scene_of(geometry), 0.0, 0.0, accuracy=accuracy, cache=tmp_path)
    assert grown(before)[:2] == (9, 9)


def test_another_process_would_recall_the_kernel_and_not_derive_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty memory is what another process has: `derived` stays, and so does the value."""
    scene = Scene.chapter1(shininess=3.25)
    value = evaluate(scene, 0.1, 0.2, cache=tmp_path)
    monkeypatch.setattr("symrender_cg.pipeline.kernels._kernels", {})
    before = counts()
    assert evaluate(scene, 0.1, 0.2, cache=tmp_path) == value
    assert grown(before) == (0, 0, 1, 0)


def test_a_kernel_recalled_for_other_numbers_is_right_for_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = scenes_of_numbers(2, centred=True)
    evaluate(first, 0.0, 0.0, cache=tmp_path)
    monkeypatch.setattr("symrender_cg.pipeline.kernels._kernels", {})
    x, y = np.array([0.0, 0.05]), np.array([0.03, 0.0])
    values = evaluate(second, x, y, cache=tmp_path)
    assert np.abs(values - oracle.evaluate(second, x, y).value).max() < 1e-14


def test_baked_kernels_hold_their_numbers_and_unbaked_ones_do_not(tmp_path: Path) -> None:
    before = counts()
    for radius in (1.0, 1.25):
        evaluate(Scene.chapter1(radius=radius), 0.0, 0.0, bake=True, cache=tmp_path)
    assert grown(before)[:2] == (2, 2)
    evaluate(Scene.chapter1(radius=1.25), 0.5, 0.0, bake=True, cache=tmp_path)
    assert grown(before) == (2, 2, 0, 1)
    assert compile_kernel(Scene.chapter1(), bake=True, cache=tmp_path).inputs == ()
    assert "radius" in compile_kernel(Scene.chapter1(), cache=tmp_path).inputs


def test_a_baked_kernel_is_never_used_for_another_background(tmp_path: Path) -> None:
    scene = Scene.chapter1()
    dark = evaluate(scene, 5.0, 5.0, bake=True, cache=tmp_path)
    light = evaluate(with_background(scene, MARKER), 5.0, 5.0, bake=True, cache=tmp_path)
    assert (float(dark), float(light)) == (0.0, MARKER)


def test_a_kernel_forced_to_keep_an_effect_is_another_one(tmp_path: Path) -> None:
    scene = scene_of("centred_sphere", Phong(specular=0.0))
    plain = compile_kernel(scene, cache=tmp_path)
    forced = compile_kernel(scene, force=["specular"], cache=tmp_path)
    assert plain.name != forced.name
    assert compile_kernel(scene, cache=tmp_path) is plain


def test_the_same_c_text_is_the_same_library(tmp_path: Path) -> None:
    """The text of a kernel, not the scene it came from, is what the cache is addressed by."""
    one, two = (translate(scene) for scene in (Scene.chapter1(), Scene.chapter1(shininess=5.0)))
    before = counts()
    first, second = build_kernel(one, root=tmp_path), build_kernel(two, root=tmp_path)
    assert grown(before)[1] == 1
    assert first.folder == second.folder
    assert not first.from_cache
    assert second.from_cache
    assert Cache(tmp_path).load(first) is not None
