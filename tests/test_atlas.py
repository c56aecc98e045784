"""The failure atlas: its scenes are where they say, its figures the oracle's, its chart shows where levels break."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Shell, in_a_process

from symrender_cg.errors import AccuracyError, ArgumentError, OutsidePlanError
from symrender_cg.reference import oracle
from symrender_cg.reference.compare import measure
from symrender_cg.run.render import evaluate
from symrender_cg.scene import PointLight, Scene
from symrender_cg.stress import atlas as module
from symrender_cg.stress.atlas import (
    Atlas,
    as_data,
    breaking_points,
    draw_atlas,
    known_levels,
    measure_atlas,
    power_text,
)
from symrender_cg.stress.atlas_limits import Limit, limit_of, promised_range
from symrender_cg.stress.sweeps import AXES, Axis, cases_of

LEVELS = ("literal", "double")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture(scope="module")
def measured() -> Atlas:
    return measure_atlas((*LEVELS, "single", "stable"), seed=4, scenes=2, points=8)


def axis_of(name: str) -> Axis:
    return next(axis for axis in AXES if axis.name == name)


# ------------------------------------------------------------------------------------------------------------- scenes


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: str(axis.name))
def test_the_same_seed_gives_the_same_cases_and_another_seed_others(axis: Axis) -> None:
    given, same, other = (list(cases_of(axis, seed, 1, 3)) for seed in (7, 7, 8))
    assert [case.scene for case in given] == [case.scene for case in same]
    assert all(np.array_equal(a.x, b.x) and np.array_equal(a.y, b.y) for a, b in zip(given, same, strict=True))
    assert [case.scene for case in given] != [case.scene for case in other]


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: str(axis.name))
def test_nearly_every_point_lies_in_the_bin_that_it_was_made_for(axis: Axis) -> None:
    cases = list(cases_of(axis, 7, 2, 6))
    assert len(cases) == 2 * (len(axis.edges) - 1)
    inside = [
        ((axis.edges[k // 2] - 1e-9 <= case.abscissa) & (case.abscissa <= axis.edges[k // 2 + 1] + 1e-9)).mean()
        for k, case in enumerate(cases)
    ]
    assert np.mean(inside) > 0.8


def abscissa_of(axis: str, scene: Scene, x: float, y: float) -> float:
    """The exponent of a point, from the scene's own numbers as fractions."""
    eye, sphere, light = Fraction(scene.camera.eye[2]), scene.spheres[0], scene.lights[0]
    radius = Fraction(sphere.radius)
    assert isinstance(light, PointLight)
    if axis == "eye":
        return math.log10(eye / radius - 1)
    if axis == "light":
        square = sum(Fraction(c) ** 2 for c in light.position) / radius**2
        return _small_gap(square)
    if axis == "shininess":
        return math.log10(sphere.material.shininess)
    if axis == "scale":
        return math.log2(radius)
    rho2 = (eye * radius) ** 2 / (eye**2 - radius**2)
    share = (Fraction(x) ** 2 + Fraction(y) ** 2) / rho2
    return _small_gap(share) if abs(share - 1) < 1 / 10 else math.log10(abs(1 - math.sqrt(share)))


def _small_gap(square: Fraction) -> float:
    """log10 |sqrt(square) - 1|, by (square - 1) / (sqrt(square) + 1)."""
    return math.log10(abs(square - 1) / Fraction(math.sqrt(square) + 1.0))


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: str(axis.name))
def test_an_abscissa_is_that_of_the_rounded_numbers_of_the_scene_and_point(axis: Axis) -> None:
    for case in list(cases_of(axis, 9, 1, 3))[::2]:
        for k in range(case.x.size):
            if case.abscissa[k] < -250:
                continue
            if axis.name == "light" and case.abscissa[k] > 100:
                assert math.hypot(*case.scene.lights[0].position) == pytest.approx(10.0 ** case.abscissa[k], rel=1e-9)
                continue
            assert abscissa_of(axis.name, case.scene, float(case.x[k]), float(case.y[k])) == pytest.approx(
                float(case.abscissa[k]), abs=1e-6
            )


@pytest.mark.parametrize("name", ["eye", "light", "shininess", "scale"])
def test_away_from_the_silhouettes_axis_every_point_sees_the_sphere(name: str) -> None:
    for case in list(cases_of(axis_of(name), 5, 1, 6))[::3]:
        assert oracle.hits(case.scene, case.x, case.y).all()


def test_the_silhouettes_axis_has_points_on_both_sides_in_every_bin() -> None:
    seen = [oracle.hits(case.scene, case.x, case.y).mean() for case in cases_of(axis_of("silhouette"), 5, 1, 40)]
    assert all(0.1 < share < 0.9 for share in seen)


def test_small_exponents_are_seen_where_the_highlight_ends() -> None:
    """r.v = 0 lies between the points of a bin: some of them have a highlight, some have none."""
    for case in list(cases_of(axis_of("shininess"), 5, 4, 12))[:16:3]:
        material = case.scene.spheres[0].material
        value = oracle.evaluate(case.scene, case.x, case.y).value
        bright = value > material.ambient + 0.5 * material.specular
        assert bright.any()


# ------------------------------------------------------------------------------------------------------------- figures


def test_the_errors_of_a_bin_are_those_that_compare_measures() -> None:
    axis = axis_of("shininess")
    atlas = measure_atlas(("double",), seed=2, scenes=2, points=5, axes=("shininess",))
    cases = list(cases_of(axis, 2, 2, 5))
    for k, found in enumerate(atlas.panels[0].curves[0].bins):
        worst = [
            measure(evaluate(case.scene, case.x, case.y), oracle.evaluate(case.scene, case.x, case.y))
            for case in cases[2 * k : 2 * k + 2]
        ]
        assert found.absolute == max(errors.max_abs for errors in worst)
        assert found.ulp == max(errors.max_ulp for errors in worst)
        assert (found.count, found.refused, found.nonfinite) == (10, 0, 0)


def test_a_level_keeps_its_limit_between_the_points_where_it_breaks(measured: Atlas) -> None:
    for panel in measured.panels:
        for curve in panel.curves:
            below, above = (-math.inf if curve.breaks[0] is None else curve.breaks[0]), (curve.breaks[1] or math.inf)
            assert below <= panel.easy < above
            for b in curve.bins:
                if b.low > below and b.high < above:
                    assert b.error(curve.limit.measure) <= curve.limit.most
            for at in (at for at in curve.breaks if at is not None):
                assert any(
                    b.low <= at <= b.high and b.error(curve.limit.measure) > curve.limit.most for b in curve.bins
                )


def test_literal_breaks_on_every_axis_double_and_stable_on_none(measured: Atlas) -> None:
    """Measured with 51,264 points a level: double at most 5.4e-16, stable at most 0.5 ulp."""
    found = {(panel.axis, curve.level): curve.breaks for panel in measured.panels for curve in panel.curves}
    for axis in AXES:
        assert found[axis.name, "literal"] != (None, None)
        assert found[axis.name, "double"] == found[axis.name, "stable"] == (None, None)
    for name in ("eye", "scale", "silhouette"):
        assert found[name, "single"] == (None, None)
    low, high = found["scale", "literal"]
    assert low == pytest.approx(-262, abs=25), "e^2 R^2 underflows"
    assert high == pytest.approx(260, abs=25), "and overflows"
    assert found["light", "literal"][1] == pytest.approx(156, abs=15), "|L - P|^2 overflows"


def test_what_literal_gets_wrong_by_itself_is_told_apart_from_what_the_inputs_leave_open(measured: Atlas) -> None:
    excess = {(panel.axis, curve.level): curve.excess for panel in measured.panels for curve in panel.curves}
    for axis in AXES:
        assert 0.0 < excess[axis.name, "double"] < 4.0, "measured: at most 2.2"
    assert excess["eye", "literal"] > 1e6, "a far eye is no fault of the scene's"
    assert excess["silhouette", "literal"] < 30.0, "at an outline the inputs' last digits decide"


def test_a_refusal_is_counted_and_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refusing(scene: Scene, x: Any, y: Any, *, accuracy: str, clip: bool = False) -> Any:
        if scene is not None and scene.camera.eye[2] > 1e6:
            raise (OutsidePlanError if scene.camera.eye[2] > 1e9 else AccuracyError)("refused")
        return evaluate(scene, x, y, accuracy=accuracy, clip=clip)

    monkeypatch.setattr(module, "evaluate", refusing)
    bins = measure_atlas(("double",), scenes=1, points=3, axes=("eye",)).panels[0].curves[0].bins
    assert [b.refused for b in bins] == [3 if b.low >= 6 else 0 for b in bins]
    assert all((b.absolute == 0.0) == (b.refused == 3) for b in bins)


def test_values_that_are_not_finite_are_the_largest_error_and_null_in_json(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def infinite(scene: Scene, x: Any, y: Any, *, accuracy: str, clip: bool = False) -> Any:
        values = evaluate(scene, x, y, accuracy=accuracy, clip=clip)
        return np.full(values.shape, np.nan) if values.size == 4 else values

    monkeypatch.setattr(module, "evaluate", infinite)
    atlas = measure_atlas(("double",), scenes=1, points=4, axes=("scale",))
    curve = atlas.panels[0].curves[0]
    assert all((b.ulp, b.absolute, b.nonfinite) == (math.inf, math.inf, 4) for b in curve.bins)
    data = json.loads(json.dumps(as_data(atlas), allow_nan=False))
    assert data["panels"][0]["curves"][0]["bins"][0]["ulp"] is None
    draw_atlas(tmp_path / "broken.png", atlas)
    assert (tmp_path / "broken.png").stat().st_size > 10_000


def test_limits_are_the_promises_where_these_have_a_figure() -> None:
    assert limit_of("double") == Limit("absolute", 1e-15)
    assert limit_of("stable") == Limit("ulp", 4.0)
    assert limit_of("certified") == Limit("ulp", 0.5)
    assert not limit_of("literal").promised
    assert promised_range("double", "light") == (-3.0, math.inf)
    assert promised_range("double", "shininess") == (-math.inf, 3.0)
    assert promised_range("stable", "light") == (-math.inf, math.inf)


@pytest.mark.parametrize(
    ("base", "exponent", "text"),
    [(10, -3.17, "6.8e-4"), (10, -15.0, "1e-15"), (10, 2.87, "740"), (10, -0.17, "0.68"), (10, 154.3, "2e154"),
     (2, -260.7, "2^-261"), (10, 5.9999, "1e6")],
)  # fmt: skip
def test_abscissas_are_written_to_two_digits(base: int, exponent: float, text: str) -> None:
    assert power_text(base, exponent) == text


def test_unknown_names_and_no_points_are_refused() -> None:
    with pytest.raises(ArgumentError, match=r"levels: 'exact' is not known; expected some of .*literal, double"):
        measure_atlas(("double", "exact"))
    with pytest.raises(ArgumentError, match=r"axes: 'fog' is not known; expected some of eye, light"):
        measure_atlas(("double",), axes=("fog",))
    with pytest.raises(ArgumentError, match=r"scenes and points: 0 and 3; expected at least 1 of each"):
        measure_atlas(("double",), scenes=0, points=3)
    assert known_levels(("double", "literal", "double")) == ("double", "literal")


# --------------------------------------------------------------------------------------------------------------- chart


def test_the_chart_names_every_level_and_says_where_it_breaks(measured: Atlas, tmp_path: Path) -> None:
    draw_atlas(tmp_path / "atlas.svg", measured)
    text = (tmp_path / "atlas.svg").read_text()
    rows = breaking_points(measured)
    assert len(rows) == len(AXES) * 4
    for title, level, _, below, above, *_ in rows:
        assert f">{title.replace(' - ', ' − ')}</text>" in text
        assert f">{level}</text>" in text
        assert all(f">{at}</text>" in text for at in (below, above) if at != "never")


def test_a_chart_twice_has_the_same_bytes(measured: Atlas, tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg"):
        draw_atlas(tmp_path / name, measured)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_another_suffix_is_refused(measured: Atlas, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"'\.gif' is not the suffix of a chart; expected \.png, \.svg, \.pdf"):
        draw_atlas(tmp_path / "atlas.gif", measured)
    assert not list(tmp_path.iterdir())


def test_matplotlib_is_loaded_when_a_chart_is_drawn_and_not_before() -> None:
    code = (
        "import sys; from symrender_cg.stress.atlas import measure_atlas, draw_atlas; "
        "a = measure_atlas(('double',), scenes=1, points=1, axes=('scale',)); "
        "print('matplotlib' in sys.modules); draw_atlas(sys.argv[1], a); print('matplotlib' in sys.modules)"
    )
    said = in_a_process("/dev/null/nowhere.png", code=code)
    assert said.out.split() == ["False"]
    assert "cannot be written" in said.err


def test_the_command_writes_the_chart_and_prints_where_levels_break(shell: Shell, tmp_path: Path) -> None:
    from symrender_cg.cli.atlas import show

    place = tmp_path / "atlas.png"
    shell.capsys.readouterr()
    measured = measure_atlas(("double",), scenes=1, points=2)
    assert show(place, levels=("double",), scenes=1, points=2) == 0
    said = shell.capsys.readouterr().out
    assert place.read_bytes().startswith(b"\x89PNG")
    for row in breaking_points(measured):
        assert " ".join(row).split() in [line.split() for line in said.splitlines()]
    assert f"{place}: 5 axes, {measured.count} points a level, seed 1" in said


def test_its_json_holds_every_bin(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from symrender_cg.cli.atlas import show

    assert show(tmp_path / "atlas.svg", levels=("double",), scenes=1, points=1, as_json=True) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["levels"] == ["double"]
    assert [len(panel["curves"][0]["bins"]) for panel in data["panels"]] == [len(axis.edges) - 1 for axis in AXES]


def test_a_place_that_will_not_do_is_refused_before_anything_is_measured(shell: Shell, tmp_path: Path) -> None:
    said = shell("stress", "--atlas", tmp_path / "atlas.bmp", "--level", "double")
    assert said.code == 2
    assert "'.bmp' is not the suffix of a chart; expected .png, .svg, .pdf; rename it" in said.err
    said = shell("stress", "--atlas", tmp_path / "none" / "atlas.png", "--level", "double")
    assert said.code == 2
    assert "expected a file's name in a folder that exists" in said.err
