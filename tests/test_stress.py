"""Hard families: found exactly, drawn again the same; errors, flips and promises by hand-made values; kept points."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import ctx
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from symrender_cg.errors import AccuracyError, ArgumentError
from symrender_cg.reference import oracle
from symrender_cg.scene import Camera, Gradient, Phong, Plane, PointLight, Scene, Sphere
from symrender_cg.stress import measure
from symrender_cg.stress.cases import Case, Family, Inputs
from symrender_cg.stress.corpus import corpus
from symrender_cg.stress.families import FAMILIES, families, family
from symrender_cg.stress.hard_points import hard_points
from symrender_cg.stress.kept import Kept, keep, read_kept, worst_points
from symrender_cg.stress.measure import chosen_levels, compare, levels, look
from symrender_cg.stress.promises import PROMISES, Outcome, broken, has_absolute_bound, promise_of
from symrender_cg.stress.run import Report, Row, input_move, run, run_scene
from symrender_cg.stress.searches import disc, exact_signs, neighbours, surface_at
from symrender_cg.stress.truth import first_surface, truth

DOCS = Path(__file__).resolve().parent.parent / "docs"
SEED = 5


def drawn(name: str, count: int = 40) -> tuple[Case, ...]:
    return family(name).cases(SEED, count)


def inputs_of(case: Case) -> Inputs:
    assert case.inputs is not None
    return case.inputs


def scene_of(case: Case) -> Scene:
    assert case.scene is not None
    return case.scene


# ------------------------------------------------------------------------------------------------------------- families


@pytest.mark.parametrize("entry", FAMILIES, ids=lambda entry: entry.name)
def test_a_case_is_a_function_of_family_seed_and_number(entry: Family) -> None:
    few, more = entry.cases(SEED, 3), entry.cases(SEED, 5)
    assert [repr(case) for case in more[:3]] == [repr(case) for case in few]
    assert len({repr((case.scene, case.inputs, case.x, case.y)) for case in more}) > 1
    assert [repr(case) for case in entry.cases(SEED + 1, 3)] != [repr(case) for case in few]
    assert [case.number for case in more] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("entry", FAMILIES, ids=lambda entry: entry.name)
def test_what_a_family_does_not_refuse_the_oracle_answers(entry: Family) -> None:
    cases = entry.cases(SEED, 12)
    for case in cases:
        if not case.refused:
            assert np.isfinite(truth(scene_of(case), [case.x], [case.y]).value).all()
        else:
            assert entry.refused
    assert entry.refused == any(case.refused for case in drawn(entry.name))


def test_a_corpus_is_the_families_in_order_and_its_names_can_be_chosen() -> None:
    assert [case.family for case in corpus(SEED, 1)] == [entry.name for entry in FAMILIES]
    assert [case.name for case in corpus(SEED, 2, ("scale", "generic"))] == [
        "generic #0",
        "generic #1",
        "scale #0",
        "scale #1",
    ]
    assert families(()) == FAMILIES
    with pytest.raises(ArgumentError, match=r"family: 'terminater' is not known; .*did you mean 'terminator'\?"):
        family("terminater")


def test_outline_families_lie_on_the_outline() -> None:
    exact = [disc(inputs_of(case), case.x, case.y) for case in drawn("sil_exact")]
    assert 5 <= sum(value == 0 for value in exact) < len(exact), "disc is 0, and not in each of them"
    for name, size in (("sil_ulps", 2.0**-48), ("sil_search", 2.0**-50)):
        for case in drawn(name):
            e, r = Fraction(inputs_of(case).eye), Fraction(inputs_of(case).radius)
            assert abs(disc(inputs_of(case), case.x, case.y)) <= e * e * r * r * Fraction(size) * 4, case
    hits = [bool(oracle.hits(scene_of(case), case.x, case.y)) for case in drawn("sil_off_axis")]
    assert 10 < sum(hits) < 30


def test_a_light_at_the_hit_point_is_there_exactly_or_one_float_away() -> None:
    cases = drawn("light_at_hit", 60)
    exact = 0
    for case in cases:
        surface = surface_at(inputs_of(case), case.x, case.y)
        assert surface is not None
        away = [float(p - light) for p, light in zip(surface.point, inputs_of(case).light, strict=True)]
        exact += max(map(abs, away)) < 2.0**-200 * inputs_of(case).radius
        assert max(map(abs, away)) <= 2.0**-50 * inputs_of(case).radius
    assert 10 < exact < 50


@pytest.mark.parametrize("name", ["terminator", "gate", "rdv0"])
def test_edges_of_n_dot_l_and_r_dot_v_are_between_neighbouring_floats(name: str) -> None:
    close = 0
    for case in drawn(name):
        signs = exact_signs(inputs_of(case))
        x, found = case.x, []
        for _ in range(4):
            x = math.nextafter(x, -math.inf)
        for _ in range(9):
            here = signs(x, case.y)
            found.append((here.r_dot_v if name == "rdv0" else here.n_dot_l) > 0)
            x = math.nextafter(x, math.inf)
        close += len(set(found)) == 2
    assert close >= 15


@pytest.mark.parametrize("name", ["near_depths", "tile_edge"])
def test_edges_of_scenes_have_both_sides_within_a_few_floats(name: str) -> None:
    close = 0
    for case in drawn(name, 30):
        scene = scene_of(case)
        around = [case.x]
        for way in (-math.inf, math.inf):
            x = case.x
            for _ in range(4):
                x = math.nextafter(x, way)
                around.append(x)
        if name == "near_depths":
            close += len({first_surface(scene, x, case.y) for x in around}) == 2
        else:
            values = truth(scene, around, [case.y] * len(around)).value
            close += float(np.ptp(values)) > 1e-3
    assert close >= 8


def test_the_edges_of_shadows_and_mirrored_outlines_are_jumps() -> None:
    for name in ("shadow_edge", "mirror_edge"):
        jumps = 0
        for case in drawn(name, 30):
            x = [math.nextafter(case.x, -9.0), case.x, math.nextafter(case.x, 9.0)]
            values = truth(scene_of(case), x, [case.y] * 3).value
            jumps += float(np.ptp(values)) > 1e-9
        assert jumps >= 8, name


def test_scaled_scenes_have_the_value_of_the_scene_that_was_scaled() -> None:
    sizes = set()
    for case in drawn("scale", 20):
        numbers = inputs_of(case)
        k = math.frexp(numbers.radius)[1]
        sizes.add(k)
        at_one = replace(
            numbers,
            radius=math.ldexp(numbers.radius, -k),
            eye=math.ldexp(numbers.eye, -k),
            light=tuple(math.ldexp(part, -k) for part in numbers.light),
        )
        point = math.ldexp(case.x, -k), math.ldexp(case.y, -k)
        assert oracle.evaluate(at_one.scene(), *point).value == oracle.evaluate(scene_of(case), case.x, case.y).value
    assert max(sizes) > 200
    assert min(sizes) < -200


def test_powers_that_underflow_are_subnormal_or_nearly() -> None:
    for case in drawn("pow_uflow"):
        assert 0.0 <= float(oracle.evaluate(scene_of(case), case.x, case.y).value) < 1e-297


def test_spheres_in_contact_touch_to_a_float() -> None:
    gaps = []
    for case in drawn("contact"):
        first, second = scene_of(case).spheres
        square = sum((Fraction(a) - Fraction(b)) ** 2 for a, b in zip(first.center, second.center, strict=True))
        gaps.append(square - (Fraction(first.radius) + Fraction(second.radius)) ** 2)
    assert sum(gap == 0 for gap in gaps) >= 5
    assert any(gap > 0 for gap in gaps)
    assert any(gap < 0 for gap in gaps)
    assert max(map(abs, gaps)) < 1e-14


# ------------------------------------------------------------------------------------------------------------- searches


@given(st.floats(-1e300, 1e300), st.floats(-1e300, 1e300), st.floats(-1e300, 1e300))
def test_neighbours_end_as_neighbouring_floats_on_different_sides(a: float, b: float, edge: float) -> None:
    low, high = min(a, b), max(a, b)
    if not low <= edge < high:
        return
    near, far = neighbours(lambda x, _: x <= edge, low, high, 0.0)
    assert (near, far) == (edge, math.nextafter(edge, math.inf))


def test_exact_signs_are_those_of_the_256_bit_geometry() -> None:
    seen = set()
    for case in (*drawn("generic"), *drawn("rdv0"), *drawn("light_inside"), *drawn("light_behind")):
        numbers = inputs_of(case)
        signs, surface = exact_signs(numbers)(case.x, case.y), surface_at(numbers, case.x, case.y)
        assert signs.hit == (surface is not None)
        if surface is None:
            continue
        for sign, way in ((signs.n_dot_l, surface.normal), (signs.r_dot_v, surface.mirrored_view())):
            with ctx.workprec(256):
                to_light = [light - p for light, p in zip(numbers.light, surface.point, strict=True)]
                value = sum((a * b for a, b in zip(to_light, way, strict=True)), start=0 * to_light[0])
            assert sign == (1 if value > 0 else -1 if value < 0 else 0)
            seen.add(sign)
    assert {-1, 1} <= seen


# -------------------------------------------------------------------------------------------------------------- errors


def one_point() -> Any:
    return truth(Scene.chapter1(), [0.1], [0.2])


def test_errors_are_measured_against_value_and_residual_in_the_format_s_own_ulp() -> None:
    true = one_point()
    value = true.value[0, 0]
    hit = np.array([True])
    (exact,) = compare(true.value.copy(), hit, true)
    assert exact.ulp == abs(true.residual[0, 0]) / math.ulp(value) <= 0.5
    assert not exact.wrong
    (off,) = compare(true.value + 3 * math.ulp(value), hit, true)
    assert 2.5 <= off.ulp <= 3.5
    assert off.wrong
    (single,) = compare(true.value32.copy(), hit, true)
    assert single.ulp <= 0.5
    assert not single.wrong
    assert single.error > exact.error


def test_flips_and_values_that_are_not_finite_are_counted_apart_from_errors() -> None:
    true = one_point()
    (zero,) = compare(np.zeros((1, 1)), np.array([True]), true)
    assert (zero.zero_flip, zero.hit_flip, zero.ulp) == (True, False, 0.0)
    (miss,) = compare(true.value.copy(), np.array([False]), true)
    assert (miss.zero_flip, miss.hit_flip, miss.ulp) == (False, True, 0.0)
    (nan,) = compare(np.full((1, 1), math.nan), np.array([True]), true)
    assert (nan.non_finite, nan.ulp, nan.wrong) == (True, math.inf, True)


def test_bytes_are_compared_as_grey_levels() -> None:
    true = one_point()
    (right,) = compare(true.value8.copy(), None, true)
    assert (right.wrong, right.ulp) == (False, 0.0)
    assert right.error <= 0.5 / 255
    (wrong,) = compare(true.value8 + np.uint8(1), None, true)
    assert (wrong.wrong, wrong.ulp) == (True, 1.0)


@pytest.mark.parametrize(
    "scene",
    [
        Scene.chapter1(ambient=0.0),
        structs.replace(Scene.chapter1(), background=0.25),
        structs.replace(Scene.chapter1(), background=Gradient(0.1, 0.4)),
        Scene(
            Camera((0.0, 0.0, 4.0), half_height=2.0),
            (Sphere((0.0, 0.0, 0.0), 1.0, Phong(0.0, 0.0, 0.0, 1.0, reflect=1.0)), Sphere((1.5, 0.5, 1.0), 0.5)),
            background=7.0,
        ),
        Scene.builtin("lights"),
    ],
    ids=["dark", "grey background", "gradient", "a perfect mirror before the marker's colour", "colours"],
)
def test_hits_are_read_off_any_scene_and_the_values_are_its_own(scene: Scene) -> None:
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1.9, 1.9, 14), np.linspace(-1.9, 1.9, 14)))
    values, hit = look(scene, x, y, "double")
    true = truth(scene, x, y)
    assert np.array_equal(hit, true.hit)
    assert 10 < hit.sum() < hit.size
    assert np.abs(values - true.value).max() < 1e-14


def test_levels_are_those_that_evaluate_knows_in_the_order_of_their_cost() -> None:
    known = levels()
    assert known.index("literal") < known.index("single") < known.index("double")
    assert chosen_levels(("double", "literal", "double")) == ("literal", "double")
    assert chosen_levels(()) == known
    with pytest.raises(ArgumentError, match="level: 'triple' is not known; expected one of 'literal'"):
        chosen_levels(("triple",))


# ------------------------------------------------------------------------------------------------------------ promises


CHAPTER1 = Scene.chapter1()
FINE = Outcome(ulp=0.4, error=1e-16, size=0.5)


@pytest.mark.parametrize(
    ("level", "outcome", "why"),
    [
        ("single", replace(FINE, hit_flip=True), "hit or miss is wrong"),
        ("single", replace(FINE, non_finite=True), "not finite"),
        ("single", replace(FINE, zero_flip=True, ulp=1e6), None),
        ("double", replace(FINE, error=1.1e-15), r"error 1.10e-15, stated 1e-15"),
        ("double", replace(FINE, error=1.1e-15, size=1.2), None),
        ("double", replace(FINE, ulp=1e4), None),
        ("stable", replace(FINE, ulp=4.1), "4.1 ulp, stated 4"),
        ("stable", replace(FINE, zero_flip=True), "0 where it should not be"),
        ("stable", replace(FINE, ulp=4.0, wrong=True), None),
        ("certified", replace(FINE, wrong=True, ulp=0.6), "not the nearest float"),
        ("certified:uint8", replace(FINE, wrong=True, ulp=1.0), "not the nearest float"),
        ("certified", FINE, None),
        ("literal", replace(FINE, non_finite=True, hit_flip=True, ulp=1e9), None),
        ("stable", Outcome(refused="outside"), None),
    ],
)
def test_a_promise_is_broken_by_what_it_states_and_by_nothing_else(
    level: str, outcome: Outcome, why: str | None
) -> None:
    found = broken(level, CHAPTER1, outcome)
    assert (found is None) == (why is None)
    if why is not None:
        assert found is not None
        assert why in found


def test_the_absolute_bound_is_not_stated_near_the_light_and_of_narrow_highlights() -> None:
    assert has_absolute_bound(CHAPTER1)
    for scene in (
        Scene.chapter1(light=(0.0, 0.0, 1.0009765)),
        Scene.chapter1(light=(0.0, 0.999023, 0.0)),
        Scene.chapter1(shininess=1001.0),
    ):
        assert not has_absolute_bound(scene)
        assert broken("double", scene, replace(FINE, error=1e-3)) is None
    assert has_absolute_bound(Scene.chapter1(light=(0.0, 0.0, 1.002), shininess=1000.0))
    mirror = structs.replace(CHAPTER1.spheres[0], material=Phong(reflect=0.5))
    assert has_absolute_bound(structs.replace(CHAPTER1, spheres=(mirror,)))
    assert set(levels()) <= {*PROMISES, *(level for level in levels() if ":" in level)}
    assert promise_of("certified:uint8") is PROMISES["certified"]


# ---------------------------------------------------------------------------------------------------------------- runs


def spoiled(monkeypatch: pytest.MonkeyPatch, spoil: Any) -> None:
    """Lets every level give other values than it computes."""
    honest = measure.evaluate_at

    def evaluate_at(*arguments: Any) -> Any:
        values = honest(*arguments)
        spoil(values)
        return values

    monkeypatch.setattr(measure, "evaluate_at", evaluate_at)


def test_a_run_counts_cases_and_refusals_and_has_a_row_for_each_family_and_level() -> None:
    told: list[int] = []
    report = run(families(("generic", "eye_in", "denormal")), ("literal", "double"), count=8, seed=2, done=told.append)
    assert [(row.family, row.level) for row in report.rows] == [
        (name, level) for name in ("generic", "denormal", "eye_in") for level in ("literal", "double")
    ]
    assert sum(told) == 48
    assert all(row.cases == 8 and row.broken == 0 for row in report.rows)
    assert [row.refused for row in report.rows if row.family == "eye_in"] == [8, 8]
    assert report.holds
    report.require()
    again = run(families(("generic",)), ("double",), count=8, seed=2)
    assert again.rows[0] == report.rows[1]


def test_how_far_the_inputs_move_the_worst_case_is_said_of_every_row_that_has_one() -> None:
    moves = {}
    for name in ("generic", "sil_exact", "highlight", "eye_in"):
        (row,) = run(families((name,)), ("literal",), count=20, seed=SEED).rows
        moves[name] = input_move(row)
    assert moves["generic"] is not None
    assert 0.0 < moves["generic"] < 1e-14
    assert moves["sil_exact"] == math.inf
    assert moves["highlight"] is not None
    assert moves["highlight"] > 1e-14, "ill-conditioned"
    assert moves["eye_in"] is None


def test_a_wrong_value_breaks_the_promise_and_names_level_family_and_case(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[values < 6.0] += 1e-13

    spoiled(monkeypatch, spoil)
    report = run(families(("generic", "scale")), ("double",), count=6, seed=2)
    assert not report.holds
    with pytest.raises(AccuracyError, match=r"double on generic: \d of 6 cases break .*generic #\d \(.*\(2 of 2 rows"):
        report.require()


def test_a_wrong_hit_is_a_flip(monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(values: Any) -> None:
        values[values == measure.MARKER] = 0.0

    spoiled(monkeypatch, spoil)
    (row,) = run(families(("sil_exact",)), ("double",), count=30, seed=SEED).rows
    assert row.hit_flips == row.broken > 5
    assert "hit or miss is wrong" in row.first


def test_a_value_of_what_must_be_refused_breaks_every_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "evaluate_at", lambda *_: np.array(0.5))
    entry = family("invalid")
    of_points = [number for number, case in enumerate(entry.cases(SEED, 40)) if case.scene is not None]
    assert of_points
    (row,) = run((entry,), ("literal",), count=40, seed=SEED).rows
    assert row.broken == len(of_points), "what is no scene is refused by Scene"
    assert "has no image" in row.first


def test_a_scene_s_own_points_are_measured_as_one_set_each() -> None:
    frame = Scene.builtin("two_spheres").in_camera_frame()
    sets = hard_points(frame, 20, SEED)
    assert {"image", "outlines", "highlights"} <= {entry.name for entry in sets}
    report = run_scene(((e.name, frame, e.points) for e in sets), ("double",), seed=SEED)
    assert [row.family for row in report.rows] == [entry.name for entry in sets]
    assert all(row.cases == len(entry.points) for row, entry in zip(report.rows, sets, strict=True))
    assert report.holds
    assert sets == hard_points(frame, 20, SEED)


def test_the_outline_points_of_a_scene_are_those_of_each_of_its_spheres() -> None:
    frame = Scene.builtin("two_spheres").in_camera_frame()
    (outlines,) = (entry for entry in hard_points(frame, 60, SEED) if entry.name == "outlines")
    touched = set()
    for number, sphere in enumerate(frame.spheres):
        alone = structs.replace(frame, spheres=(sphere,), lights=(PointLight(),))
        for x, y in outlines.points:
            near = {bool(oracle.hits(alone, x * factor, y * factor)) for factor in (1 - 2e-3, 1 + 2e-3)}
            if len(near) == 2:
                touched.add(number)
    assert touched == {0, 1}


# ---------------------------------------------------------------------------------------------------------- kept points


def kept_point(level: str = "double", ulp: float = 9.0, **more: Any) -> Kept:
    return Kept("generic", level, CHAPTER1, 0.1, 0.2, "a note", ulp, 1e-15, False, **more)


def test_kept_points_are_read_back_bit_for_bit(tmp_path: Path) -> None:
    scene = Scene(
        Camera((0.1, -0.0, 4.0), half_height=5e-324),
        (Sphere((1e300, 0.1, -7.3), 0.3, Phong((0.1, 0.2, 1 / 3), shininess=1e-310)),),
        Scene.builtin("lights").lights,
        Gradient(0.1, (0.0, 1e-17, 1.0)),
        Plane(checker=Phong(gate_specular=True)),
        shadows=False,
        max_bounces=3,
    )
    file = tmp_path / "worst.json"
    point = Kept("generic", "double", scene, 0.1, -1e-320, "a note", 9.0, 1e-15, False)
    assert keep(file, [point]) == 1
    (back,) = read_kept(file)
    assert back == point
    assert repr(back) == repr(point), "-0.0 and 0.0 differ"


def test_of_two_points_of_a_family_and_level_the_worse_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "worst.json"
    assert keep(file, [kept_point(ulp=5.0), kept_point("single", ulp=2.0)]) == 2
    assert keep(file, [kept_point(ulp=4.0), kept_point("single", ulp=3.0)]) == 1
    assert [(point.level, point.ulp) for point in read_kept(file)] == [("double", 5.0), ("single", 3.0)]
    flipped = replace(kept_point(ulp=0.0), flipped=True)
    assert keep(file, [flipped]) == 1, "a flip is worse than any error"
    text = file.read_text()
    assert keep(file, []) == 0
    assert file.read_text() == text


def test_the_worst_point_of_a_row_is_kept_and_rows_without_errors_are_not() -> None:
    report = run(families(("generic", "huge_xy", "eye_in")), ("literal", "double"), count=10, seed=SEED)
    found = worst_points(report)
    assert [(point.family, point.level) for point in found] == [("generic", "literal"), ("generic", "double")]
    assert [point.ulp for point in found] == [row.ulp for row in report.rows if row.family == "generic"]


def test_a_file_that_is_no_kept_list_is_refused(tmp_path: Path) -> None:
    for text in ("{", "{}", '{"points": [{"family": "generic"}]}', '{"points": [{"scene": {"Camera": {}}}]}'):
        file = tmp_path / "other.json"
        file.write_text(text)
        with pytest.raises(ArgumentError, match="not a list of kept points"):
            read_kept(file)
    with pytest.raises(ArgumentError, match="cannot be written"):
        keep(tmp_path / "nowhere" / "worst.json", [kept_point()])


def test_a_report_without_broken_rows_holds_and_one_with_raises() -> None:
    row = Row("generic", "double", 4, 0, 9.0, 1e-9, 0, 0, 0, 4, 0, "", None, None)
    Report((row,), 1, 0).require()
    with pytest.raises(AccuracyError, match=r"^double on generic: 2 of 4 cases break what is stated; generic #1: why$"):
        Report((row, replace(row, broken=2, first="generic #1: why")), 1, 0).require()


# ---------------------------------------------------------------------------------------------------------------- docs


def test_the_documented_table_of_families_is_the_registry() -> None:
    lines = (DOCS / "hard_cases.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.startswith("| `") and line.count("|") == 5]
    assert rows == [f"| `{f.name}` | {f.title} | {f.hard} | {f.source} |" for f in FAMILIES]


def test_the_documented_statements_are_those_of_the_levels() -> None:
    text = (DOCS / "hard_cases.md").read_text(encoding="utf-8")
    for level, promise in PROMISES.items():
        assert f"| `{level}` | {promise.words} |" in text
