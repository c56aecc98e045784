"""Laws of `check`: it sees a kernel that is wrong, says by how much, and lets the right ones pass."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from command_line import Shell
from msgspec import structs

from symrender_cg import PointLight, Scene, Sphere, evaluate
from symrender_cg.errors import AccuracyError
from symrender_cg.reference import check as module
from symrender_cg.reference import compare, oracle, points
from symrender_cg.reference.check import Row, check, stated_bound
from symrender_cg.run.kernel import Kernel

FEW = ("--size", "24x24", "--points", "60")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.mark.parametrize("scene", Scene.builtin_names())
def test_stated_bounds_hold_on_every_built_in_scene(scene: str) -> None:
    report = check(Scene.builtin(scene), width=32, height=32, count=200)
    report.require()
    exact = [row for row in report.rows if row.accuracy in ("single", "double")]
    assert len(exact) >= 6
    assert all(row.bound is not None and row.wrong_hits == 0 for row in exact)


def test_the_table_has_a_row_for_each_evaluator_and_set_of_points(shell: Shell) -> None:
    answer = shell("check", *FEW)
    assert answer.code == 0
    rows = [line for line in answer.out.splitlines() if line.startswith(("kernel", "numpy", "per pixel"))]
    for evaluator in ("kernel literal", "kernel single", "kernel double", "numpy stable", "numpy literal", "per pixel"):
        for where in ("image 24x24", "near silhouette", "near terminator", "near highlight"):
            assert sum(row.startswith(evaluator) and where in row for row in rows) == 1
    assert len(rows) == 24
    assert sum(row.endswith("holds") for row in rows) == 8
    assert "576 (image 24x24), 60 (near silhouette)" in answer.out


def test_the_numbers_are_those_of_compare_against_the_oracle() -> None:
    scene = Scene.builtin("far")
    report = check(scene, width=8, height=8, count=150, seed=3, accuracies=("literal",))
    x, y = points.near_silhouette(scene, 150, 3)
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


def _spoiled(monkeypatch: pytest.MonkeyPatch, spoil: Any) -> None:
    """Lets every double kernel give other values than it computes."""
    honest = Kernel.points

    def points_of(self: Kernel, values: Any, *arguments: Any, **options: Any) -> None:
        honest(self, values, *arguments, **options)
        if self.dtype == np.float64 and self.name.endswith("double"):
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
        report = check(scene, width=16, height=16, count=200, accuracies=("double",))
        report.require()
        doubt = {row.where: row.in_doubt for row in report.rows if row.accuracy}
        assert doubt["image 16x16"] == doubt["near silhouette"] == doubt["near highlight"] == 0
        assert doubt["near terminator"] < 100
        assert (doubt["near terminator"] > 0) <= scene.spheres[0].material.gate_specular


def test_a_wrong_value_away_from_the_terminator_is_no_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[values > 0.2] += 1e-12

    _spoiled(monkeypatch, spoil)
    report = check(Scene.builtin("grazing_light"), width=16, height=16, count=100, accuracies=("double",))
    with pytest.raises(AccuracyError, match="kernel double, image 16x16"):
        report.require()


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
    report = module.Report(2, 2, {}, (replace(row, bound=None), row, row))
    with pytest.raises(
        AccuracyError, match=r"kernel double, image: largest error 1e-09, stated bound 1e-15; .*\(2 of 3"
    ):
        report.require()
