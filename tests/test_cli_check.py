"""Laws of `check`: it sees a kernel that is wrong, says by how much, and lets the right ones pass."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from command_line import Shell
from msgspec import structs

from symrender_cg import Camera, Phong, PointLight, Scene, Sphere, evaluate, pipeline
from symrender_cg.errors import AccuracyError
from symrender_cg.lower.variants import ACCURACIES
from symrender_cg.reference import brute_force, check_scene, compare, hard_places, oracle
from symrender_cg.reference import check as module
from symrender_cg.reference.check import check, stated_bound
from symrender_cg.reference.check_rows import STATED_ULP, Report, Row
from symrender_cg.run import render
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.levels import hands_over
from symrender_cg.run.scene_kernel import SceneKernel
from symrender_cg.run.settling_kernel import SettlingKernel

FEW = ("--size", "24x24", "--points", "60")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.mark.parametrize("scene", Scene.builtin_names())
def test_stated_bounds_hold_on_every_built_in_scene(scene: str) -> None:
    report = check(Scene.builtin(scene), width=24, height=24, count=120)
    report.require()
    exact = [row for row in report.rows if row.accuracy in ("fast", "single", "double")]
    assert len(exact) >= 9
    assert all(row.bound is not None and row.wrong_hits == 0 for row in exact)
    for level, ulp in STATED_ULP.items():
        proved = [row for row in report.rows if row.accuracy == level]
        assert len(proved) >= 3
        assert all(row.max_ulp <= ulp == row.bound_ulp and (row.wrong_hits, row.in_doubt) == (0, 0) for row in proved)
    # near the places alone that are looked for may a decision be within rounding, and not at most of them
    assert all(row.in_doubt < (1 if row.where.startswith("image") else row.count // 2) for row in exact)


def test_the_table_has_a_row_for_each_evaluator_and_set_of_points(shell: Shell) -> None:
    answer = shell("check", *FEW)
    assert answer.code == 0
    rows = [line for line in answer.out.splitlines() if line.startswith(("kernel", "numpy", "per pixel"))]
    for evaluator in (*(f"kernel {name}" for name in ACCURACIES), "numpy stable", "numpy literal", "per pixel"):
        for where in ("image 24x24", "near silhouette", "near terminator", "near highlight"):
            assert sum(row.startswith(evaluator) and where in row for row in rows) == 1
    assert len(rows) == 36
    assert sum(row.endswith("holds") for row in rows) == 20
    assert sum(row.endswith("  4 ulp  holds") for row in rows) == 4
    assert sum(row.endswith("0.5 ulp  holds") for row in rows) == 4
    assert "576 (image 24x24), 60 (near silhouette)" in answer.out


def test_the_numbers_are_those_of_compare_against_the_oracle() -> None:
    scene = Scene.builtin("far")
    report = check(scene, width=8, height=8, count=150, seed=3, accuracies=("literal",))
    x, y = hard_places.near_silhouette(scene, 150, 3)
    errors = compare.measure(evaluate(scene, x, y, accuracy="literal"), oracle.evaluate(scene, x, y))
    (row,) = (row for row in report.rows if row.accuracy and row.where == "near silhouette")
    assert (row.max_ulp, row.max_abs, row.count) == (errors.max_ulp, errors.max_abs, 150)
    assert row.wrong_hits > 0
    assert row.holds  # nothing is stated of it


def test_wrong_hits_are_seen_where_hit_and_miss_look_alike() -> None:
    material = Scene.chapter1().spheres[0].material
    scene = Scene(spheres=(Sphere((0.0, 0.0, 0.0), 1.0, type(material)(0.0, 0.0, 0.0, 1.0)),), background=0.0)
    report = check(scene, width=8, height=8, count=300, accuracies=("double",))
    wrong = {(row.evaluator, row.where): row.wrong_hits for row in report.rows}
    assert wrong["per pixel", "near silhouette"] > 0
    assert wrong["numpy literal", "near silhouette"] > 0
    assert wrong["kernel double", "near silhouette"] == 0
    assert wrong["numpy stable", "near silhouette"] == 0


def _spoiled(monkeypatch: pytest.MonkeyPatch, spoil: Any, level: str = "double") -> None:
    """Lets every kernel of a level give other values than it computes."""
    honest = Kernel.points

    def points_of(self: Kernel, values: Any, *arguments: Any, **options: Any) -> None:
        honest(self, values, *arguments, **options)
        if self.name.endswith(f"_{level}"):
            spoil(values)

    monkeypatch.setattr(Kernel, "points", points_of)


def test_a_broken_bound_exits_with_4_after_the_table(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[values > 0.0] += 1e-13

    _spoiled(monkeypatch, spoil)
    answer = shell("check", *FEW)
    assert answer.code == 4
    assert "BROKEN" in answer.out
    assert "near highlight" in answer.out
    assert "symrender_cg: error: kernel double, image 24x24: largest error 1" in answer.err
    assert "e-13, stated bound 2." in answer.err


def test_a_wrong_hit_breaks_what_is_stated(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[values == 1.0] = 0.0  # what is asked for hits alone: misses pass for hits

    _spoiled(monkeypatch, spoil)
    answer = shell("check", *FEW, "--accuracy", "double")
    assert answer.code == 4
    assert "wrong hits" in answer.err


def test_a_value_that_is_not_finite_breaks_what_is_stated(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[5] = np.nan

    _spoiled(monkeypatch, spoil)
    answer = shell("check", *FEW, "--accuracy", "double", "--json")
    assert answer.code == 4
    data = json.loads(answer.out)
    assert data["holds"] is False
    assert all(row["non_finite"] == 1 for row in data["rows"] if row["evaluator"] == "kernel double")


def test_points_in_doubt_are_those_at_the_jump_of_a_gated_scene_alone() -> None:
    gated = Scene.builtin("grazing_light")
    (sphere,) = gated.spheres
    plain = structs.replace(sphere, material=structs.replace(sphere.material, gate_specular=False))
    for scene in (gated, structs.replace(gated, spheres=(plain,))):
        report = check(scene, width=16, height=16, count=200, accuracies=("single",))
        report.require()
        doubt = {row.where: row.in_doubt for row in report.rows if row.accuracy}
        assert doubt["image 16x16"] == doubt["near silhouette"] == doubt["near highlight"] == 0
        assert doubt["near terminator"] < 100
        assert (doubt["near terminator"] > 0) <= scene.spheres[0].material.gate_specular


def test_a_wrong_value_away_from_the_terminator_is_no_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[values > 0.2] += np.float32(1e-3)

    _spoiled(monkeypatch, spoil, "single")
    report = check(Scene.builtin("grazing_light"), width=16, height=16, count=100, accuracies=("single",))
    with pytest.raises(AccuracyError, match="kernel single, image 16x16"):
        report.require()


def test_double_that_is_handed_over_states_what_stable_does_and_has_no_doubts() -> None:
    scene = Scene.builtin("grazing_light")
    assert hands_over(scene)
    report = check(scene, width=16, height=16, count=200, accuracies=("double",))
    report.require()
    rows = [row for row in report.rows if row.accuracy]
    assert len(rows) == 4
    assert all(row.bound_ulp == 4.0 >= row.max_ulp and row.bound is not None and row.in_doubt == 0 for row in rows)


# --------------------------------------------------------------------------------------- levels that prove their values


def _other_values(monkeypatch: pytest.MonkeyPatch, level: str, spoil: Any) -> None:
    """Lets a level give other values than it proves."""
    honest = render.evaluate

    def evaluate_wrongly(*arguments: Any, **options: Any) -> Any:
        values = honest(*arguments, **options)
        return spoil(values) if options.get("accuracy") == level else values

    for place in (render, check_scene):
        monkeypatch.setattr(place, "evaluate", evaluate_wrongly)


def _ulps_up(count: int) -> Any:
    return lambda values: values + count * np.spacing(np.abs(values)) * (values > 0.25)


@pytest.mark.parametrize("scene", ["chapter1", "two_spheres"])
@pytest.mark.parametrize(("level", "ulps"), [("stable", 5), ("certified", 1)])
def test_a_level_that_proves_its_values_is_broken_by_a_few_ulp(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, scene: str, level: str, ulps: int
) -> None:
    words = ("check", scene, *FEW, "--accuracy", level)
    assert shell(*words).code == 0
    _other_values(monkeypatch, level, _ulps_up(ulps))
    answer = shell(*words)
    assert answer.code == 4
    assert "BROKEN" in answer.out
    assert f"kernel {level}, image 24x24: largest error {ulps}" in answer.err
    assert f"ulp, stated bound {'4' if level == 'stable' else '0.5'} ulp; " in answer.err


@pytest.mark.parametrize("scene", ["chapter1", "two_spheres"])
def test_a_0_in_place_of_a_value_breaks_a_bound_in_ulp(monkeypatch: pytest.MonkeyPatch, scene: str) -> None:
    _other_values(monkeypatch, "stable", lambda values: np.where(values < 0.2, 0.0, values))
    report = check(Scene.builtin(scene), width=24, height=24, count=0, accuracies=("stable",))
    (row,) = (row for row in report.rows if row.accuracy)
    assert row.max_ulp == np.inf
    assert not row.holds
    with pytest.raises(AccuracyError, match="largest error inf ulp, stated bound 4 ulp"):
        report.require()


def test_a_wrong_hit_of_a_kernel_that_bounds_its_error_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = SettlingKernel.settle_points

    def settle_points(self: SettlingKernel, values: Any, *arguments: Any, **options: Any) -> Any:
        left = honest(self, values, *arguments, **options)
        values[values == 1.0] = 0.0  # what is asked for hits alone: misses pass for hits
        return left

    monkeypatch.setattr(SettlingKernel, "settle_points", settle_points)
    report = check(Scene.chapter1(), width=16, height=16, count=0, accuracies=("certified",))
    with pytest.raises(AccuracyError, match=r"kernel certified, image 16x16: .* wrong hits"):
        report.require()


def test_a_wrong_surface_of_a_level_that_proves_its_values_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.builtin("two_spheres")
    _other_values(monkeypatch, "stable", lambda values: np.where(values == 1.0, 2.0, values))  # a number each
    report = check(scene, width=24, height=24, count=0, accuracies=("stable",))
    (row,) = (row for row in report.rows if row.accuracy)
    assert row.wrong_hits > 0
    assert row.max_ulp <= 4.0
    assert not row.holds


def test_fast_states_no_bound_beyond_its_exponents() -> None:
    base = stated_bound(Scene.chapter1(), "fast")
    single = stated_bound(Scene.chapter1(), "single")
    assert base is not None
    assert single is not None
    assert base == pytest.approx(single + 1.3 * 2.0**-11)
    assert stated_bound(Scene.chapter1(shininess=1001.0), "fast") is None
    spheres = tuple(structs.replace(s, material=Phong(shininess=1001.0)) for s in Scene.builtin("two_spheres").spheres)
    shiny = structs.replace(Scene.builtin("two_spheres"), spheres=spheres)
    report = check(shiny, width=8, height=8, count=0, accuracies=("fast", "single"))
    assert {row.accuracy: row.bound is None for row in report.rows if row.accuracy} == {"fast": True, "single": False}


def test_json_holds_the_bounds_in_ulp(shell: Shell) -> None:
    data = json.loads(shell("check", *FEW, "--accuracy", "double,stable,certified", "--json").out)
    stated = {row["accuracy"]: row["bound_ulp"] for row in data["rows"] if row["accuracy"]}
    assert stated == {"double": None, "stable": 4.0, "certified": 0.5}


def test_json_holds_the_rows_of_the_table(shell: Shell) -> None:
    answer = shell("check", "off_axis", *FEW, "--accuracy", "double,literal", "--json")
    assert answer.code == 0
    data = json.loads(answer.out)
    assert data["size"] == [24, 24]
    assert data["holds"] is True
    assert {row["evaluator"] for row in data["rows"]} == {
        "kernel literal",
        "kernel double",
        "numpy stable",
        "numpy literal",
        "per pixel",
    }
    double = [row for row in data["rows"] if row["evaluator"] == "kernel double"]
    assert all(row["max_abs"] <= row["bound"] and row["from_numpy"] < 1e-13 for row in double)
    assert all(row["bound"] is None for row in data["rows"] if row["evaluator"] != "kernel double")


def test_the_same_seed_gives_the_same_points_and_another_seed_others() -> None:
    def errors(seed: int) -> list[tuple[float, float]]:
        report = check(Scene.chapter1(), width=4, height=4, count=50, seed=seed, accuracies=("double",))
        return [(row.max_ulp, row.max_abs) for row in report.rows]

    assert errors(1) == errors(1)
    assert errors(1) != errors(2)


def test_of_large_images_the_slow_loop_takes_every_kth_point(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PER_PIXEL_POINTS", 100)
    report = check(Scene.chapter1(), width=16, height=16, count=0, accuracies=("double",))
    assert report.per_pixel_points == {"image 16x16": 86}
    assert {row.evaluator: row.count for row in report.rows}["per pixel"] == 86
    assert {row.evaluator: row.count for row in report.rows}["kernel double"] == 256


def test_bounds_grow_with_shininess_brightness_and_a_light_near_the_surface() -> None:
    base = stated_bound(Scene.chapter1(), "double")
    assert base is not None
    assert base == pytest.approx(2.55e-15, rel=0.01)
    assert stated_bound(Scene.chapter1(), "single") == pytest.approx(base * 2.0**29)
    for other in (
        Scene.chapter1(shininess=4000.0),
        Scene.chapter1(diffuse=7.0),
        Scene.chapter1(light=(0.0, 0.0, 1.0625)),
    ):
        bound = stated_bound(other, "double")
        assert bound is not None
        assert bound > 2 * base
    assert stated_bound(Scene.chapter1(), "literal") is None
    assert stated_bound(Scene(lights=(PointLight((0.0, 1.0, 0.0)),)), "double") is None


def test_a_report_names_the_first_broken_row() -> None:
    row = Row("kernel double", "double", "image", 4, 9.0, 1e-9, 0, 0, 0, bound=1e-15)
    report = Report(2, 2, {}, (replace(row, bound=None), row, row))
    with pytest.raises(
        AccuracyError, match=r"kernel double, image: largest error 1e-09, stated bound 1e-15; .*\(2 of 3"
    ):
        report.require()


# ------------------------------------------------------------------------------------------------------------- scenes


def _spoiled_scene(monkeypatch: pytest.MonkeyPatch, spoil: Any) -> None:
    """Lets every double kernel of a scene give other values at points than it computes."""
    honest = SceneKernel.points

    def points_of(self: SceneKernel, values: Any, x: Any, y: Any, prepared: Any) -> Any:
        doubtful = honest(self, values, x, y, prepared)
        if self.dtype == np.float64:
            spoil(values)
        return doubtful

    monkeypatch.setattr(SceneKernel, "points", points_of)


def test_scenes_have_rows_for_their_kernels_and_brute_force(shell: Shell) -> None:
    answer = shell("check", "mirrors", *FEW)
    assert answer.code == 0
    assert "literal is left out" in answer.err
    rows = [line for line in answer.out.splitlines() if line.startswith(("kernel", "brute"))]
    for evaluator in (*(f"kernel {name}" for name in ACCURACIES if name != "literal"), "brute force"):
        for where in ("image 24x24", "near outlines", "near mirrored", "near shadows"):
            assert sum(row.startswith(evaluator) and where in row for row in rows) == 1
    assert len(rows) == 24
    assert sum(row.endswith("holds") for row in rows) == 20


def test_the_numbers_of_a_scene_are_those_of_the_oracle() -> None:
    scene = Scene.builtin("lights")
    report = check(scene, width=6, height=4, count=50, seed=3, accuracies=("double",))
    frame = scene.in_camera_frame()
    (shadows,) = (p for p in check_scene.edge_points(frame, 1.5, 50, 3) if p.where == "near shadows")
    errors = compare.measure(evaluate(scene, shadows.x, shadows.y), oracle.evaluate(scene, shadows.x, shadows.y))
    (row,) = (row for row in report.rows if row.accuracy and row.where == "near shadows")
    assert row.in_doubt == 0
    assert (row.max_ulp, row.max_abs, row.count) == (errors.max_ulp, errors.max_abs, 50)


def test_edge_points_lie_on_both_sides_of_edges_of_their_kind() -> None:
    frame = Scene.builtin("mirrors").in_camera_frame()
    found = {p.where: p for p in check_scene.edge_points(frame, 1.0, 300, 1)}
    assert set(found) == {"near outlines", "near mirrored", "near shadows"}
    pixel = 2.0 * frame.camera.half_height / check_scene.EDGE_SIDE
    step = 0.5**4 * pixel
    for where, points_found in found.items():
        x, y = points_found.x, points_found.y
        close = np.zeros(x.shape, dtype=bool)
        for dx, dy in ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)):
            here, there = brute_force.trace(frame, x, y), brute_force.trace(frame, x + dx, y + dy)
            if where == "near outlines":
                close |= here.index != there.index
            else:
                same = here.index == there.index
                lit = ((here.diffuse > 0.0) != (there.diffuse > 0.0)).any(axis=(0, -1))
                jump = np.abs(here.value - there.value).max(axis=-1) > 1e-3
                close |= same & (lit | jump)
        assert close.mean() > 0.8, where
    assert len(check_scene.edge_points(Scene.chapter1().in_camera_frame(), 1.0, 20, 1)) == 2


def test_a_wrong_colour_breaks_the_bound_of_a_scene(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[..., 1] += 1e-12

    _spoiled_scene(monkeypatch, spoil)
    answer = shell("check", "mirrors", *FEW, "--accuracy", "double")
    assert answer.code == 4
    assert "BROKEN" in answer.out
    assert "kernel double, near outlines" in answer.err


def test_a_wrong_surface_breaks_what_is_stated_even_where_it_looks_alike(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def spoil(values: Any) -> None:
        coded = values == np.rint(values)  # what is asked for surfaces alone: a number each
        values[coded & (values == 1.0)] = 2.0

    _spoiled_scene(monkeypatch, spoil)
    answer = shell("check", "two_spheres", *FEW, "--accuracy", "double")
    assert answer.code == 4
    assert "wrong hits" in answer.err


def test_every_surface_is_told_from_every_other() -> None:
    scene = Scene.builtin("hidden")
    frame = scene.in_camera_frame()
    for size in (None, (40, 30)):
        x, y = check_scene._centres(frame, 40, 30)
        drawing = pipeline.draw(scene, size=size)
        found = check_scene.seen(drawing, check_scene._Points("", x, y, size), np.zeros(x.shape, dtype=np.int64))
        assert np.array_equal(found, oracle.index(scene, x, y))
        assert len(np.unique(found)) > 2


def test_a_scene_that_comes_down_to_one_sphere_is_checked_as_a_scene() -> None:
    front, back = Sphere((0.0, 0.0, 0.0), 1.0, Phong(specular=0.0)), Sphere((0.0, 0.0, -3.0), 0.25)
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=2.0), (back, front), shadows=False)
    assert pipeline.planned(scene).arrangement is None
    report = check(scene, width=12, height=12, count=40)
    report.require()
    kernels = {f"kernel {name}" for name in ACCURACIES if name != "literal"}
    assert {row.evaluator for row in report.rows} == kernels | {"brute force"}


def test_points_in_doubt_of_a_scene_have_decisions_within_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.builtin("shadow")
    single = [row for row in check(scene, width=8, height=8, count=300, accuracies=("single",)).rows if row.accuracy]
    assert sum(row.in_doubt for row in single) > 0
    monkeypatch.setitem(check_scene.DOUBT, "single", 0.0)
    monkeypatch.setattr(check_scene, "ROUNDINGS", 0.0)
    report = check(scene, width=8, height=8, count=300, accuracies=("single",))
    with pytest.raises(AccuracyError, match="kernel single, near shadows"):
        report.require()
