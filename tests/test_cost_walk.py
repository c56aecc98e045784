"""Laws of the walk over ways that a request makes: what it finds, what it may cost, what a run of `cost` adds.

Nothing is timed: a bench gives times and errors that were recorded (cost_ways.json), or drawn at random.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from symrender_cg import Camera, Phong, PointLight, Scene, Sphere, choose, evaluate, render_image
from symrender_cg.cost.bounds import strength_of_highlights
from symrender_cg.cost.choose import LEAST_ERROR, MARGIN
from symrender_cg.cost.expected import expected
from symrender_cg.cost.looking import Looking, entries_by_way, learn
from symrender_cg.cost.records import Largest, Times, errors_seen, habits_of, keep_times, times_of
from symrender_cg.cost.report import Entry, Errors, Machine, Report, Spread
from symrender_cg.cost.variants import Way, content, moved, named_ways, requestable, way_of
from symrender_cg.cost.walk import BUILDS, kind_of, walk

SIZE = (64, 64)
SCENES = ("chapter1", "off_axis", "two_spheres")
LIMITS = (1e-2, 0.5 / 255.0, 1e-4, 1e-5, 2e-6, 1e-6, 1e-9, 5e-14, 3e-15)
NEARLY = 1.06
"""How far from the fastest way a first request may end, over the recorded scenes; the largest seen is 1.051."""

Table = dict[str, tuple[float, float, float]]


def recorded(name: str) -> Table:
    """Ratio to `double`, largest error, the same in ulp, by way."""
    data = json.loads((Path(__file__).parent / "cost_ways.json").read_text())
    return {way: (ratio, error, ulp) for way, (ratio, error, ulp) in data[name].items()}


class Bench:
    """Gives what a table holds, and counts what it is asked for."""

    def __init__(self, table: Table, usual: Mapping[str, float] | None = None) -> None:
        self.table, self.usual = table, dict(usual or {})
        self.errors: dict[str, Largest] = {}
        self.ratios: dict[str, float] = {}
        self.kernels: list[str] = []
        self.compiled: set[str] = set()

    def built(self, way: Way) -> bool:
        return way.name in self.compiled

    def look(self, ways: Sequence[Way]) -> None:
        for way in ways:
            assert way.name not in self.errors, "an error is measured once"
            self.errors[way.name] = Largest(*self.table[way.name][1:])
            self.kernels.append(way.name)
        self.compiled |= {*self.kernels, "double"}

    def time(self, ways: Sequence[Way]) -> None:
        for way in ways:
            self.ratios[way.name] = self.table[way.name][0]
        self.ratios["double"] = 1.0


def ways_of(name: str) -> list[Way]:
    return [way for way in requestable(Scene.builtin(name)) if not way.variant.settles]


def least_of_its_format(way: Way) -> float:
    return MARGIN * (2.0**-23 if way.variant.result == "float32" else 2.0**-52)


def excess_over(limit: float) -> Callable[[Way, Largest], float]:
    return lambda way, errors: max(MARGIN * errors.absolute, least_of_its_format(way)) / limit


def hopeless_for(scene: Scene, limit: float) -> Callable[[Way], bool]:
    def hopeless(way: Way) -> bool:
        powers = LEAST_ERROR.get(way.variant.functions, 0.0) * strength_of_highlights(scene)
        return max(MARGIN * powers, least_of_its_format(way)) > limit

    return hopeless


def fastest(ways: Sequence[Way], table: Table, limit: float, among: Mapping[str, Largest] | None = None) -> float:
    excess = excess_over(limit)
    return min(
        (
            table[way.name][0]
            for way in ways
            if (among is None or way.name in among) and excess(way, Largest(*table[way.name][1:])) <= 1.0
        ),
        default=math.inf,
    )


@pytest.mark.parametrize("name", SCENES)
def test_every_way_of_the_record_can_be_requested_and_no_other(name: str) -> None:
    assert {way.name for way in ways_of(name)} == set(recorded(name))


@pytest.mark.parametrize("limit", LIMITS)
@pytest.mark.parametrize("name", SCENES)
def test_a_first_request_ends_near_the_fastest_way_and_compiles_few_kernels(name: str, limit: float) -> None:
    """With nothing usual yet, and with what is usual where the other scene of one sphere was timed."""
    table, ways = recorded(name), ways_of(name)
    other = {"chapter1": "off_axis", "off_axis": "chapter1"}.get(name)
    usual = {way: row[0] for way, row in recorded(other).items()} if other else {}
    for known in ({}, usual):
        bench = Bench(table, known)
        walk(ways, bench, excess=excess_over(limit), hopeless=hopeless_for(Scene.builtin(name), limit))
        assert len(bench.kernels) <= BUILDS
        assert fastest(ways, table, limit, bench.errors) <= NEARLY * fastest(ways, table, limit)


def test_a_second_request_asks_for_nothing_that_is_known() -> None:
    table, ways = recorded("chapter1"), ways_of("chapter1")
    bench = Bench(table)
    walk(ways, bench, excess=excess_over(1e-5))
    count = len(bench.kernels)
    walk(ways, bench, excess=excess_over(1e-5))
    assert len(bench.kernels) == count


def test_nothing_is_compiled_beyond_the_budget_and_what_is_compiled_is_free() -> None:
    table = {name: (row[0], 1.0, 1e9) for name, row in recorded("chapter1").items()}
    ways = ways_of("chapter1")
    bench = Bench(table)
    walk(ways, bench, excess=excess_over(1e-3), builds=4)
    assert len([way for way in bench.kernels if way != "double"]) == 4
    again = Bench(table)
    again.compiled = {way.name for way in ways}
    walk(ways, again, excess=excess_over(1e-3), builds=0)
    assert len(again.errors) == len({kind_of(way) for way in ways})


def test_when_the_budget_is_used_up_double_is_looked_at_still() -> None:
    """It is compiled with the first: what others take is told as a ratio to it."""
    table = {
        name: (row[0], row[1] if name.startswith("double") else 1.0, 1e9) for name, row in recorded("chapter1").items()
    }
    bench = Bench(table)
    walk(ways_of("chapter1"), bench, excess=excess_over(1e-6), builds=3)
    assert "double" in bench.errors
    assert len(bench.kernels) == 4


def test_where_a_way_is_far_from_the_request_those_of_its_kind_are_left_out() -> None:
    table, ways = recorded("chapter1"), ways_of("chapter1")
    bench = Bench(table)
    walk(ways, bench, excess=excess_over(1e-6), builds=100)
    wrong = [way for way in ways if way.name in bench.errors and MARGIN * table[way.name][1] > 2e-6]
    kinds = [kind_of(way) for way in wrong]
    assert kinds
    assert len(set(kinds)) == len(kinds)


NUMBERS = st.tuples(st.floats(0.1, 10.0), st.floats(1e-16, 1e-1), st.floats(0.5, 1e6))


@given(st.data(), st.sampled_from(LIMITS))
def test_with_all_times_and_errors_known_the_fastest_of_all_is_known_whatever_they_are(
    data: st.DataObject, limit: float
) -> None:
    ways = ways_of("two_spheres")
    table = {way.name: data.draw(NUMBERS) for way in ways}
    bench = Bench(table)
    bench.look(ways)
    bench.time(ways)
    walk(ways, bench, excess=excess_over(limit))
    assert fastest(ways, table, limit, bench.errors) == fastest(ways, table, limit)


def test_a_time_that_was_measured_is_expected_and_moves_what_its_neighbours_may_take() -> None:
    ways = ways_of("chapter1")
    plain, fused, both = (way_of(name) for name in ("single", "single_fused", "single_complement_fused"))
    assert expected(fused, {"single_fused": 3.0}, {}, ways) == 3.0
    assert expected(fused, {"single": 3.0}, {}, ways) > 2.0
    assert expected(fused, {}, {"single_fused": 0.25}, ways) == 0.25
    assert expected(plain, {}, {}, ways) > expected(both, {}, {}, ways)


# --------------------------------------------------------------------------------------------------------- one list


@pytest.mark.parametrize("name", [*SCENES, "mirrors"])
def test_what_cost_finds_and_render_image_can_draw_may_be_requested(name: str) -> None:
    """All but references, supersampling, other plans, and what may take surface for background."""
    scene = Scene.builtin(name)
    known = {content(way) for way in requestable(scene, bake=True)}
    found = list(named_ways(scene, SIZE))
    for start in list(found):
        for move in moved(start, scene, SIZE):
            found += [move, *moved(move, scene, SIZE)]
    wanted = {way for way in found if way.kind in ("level", "choice", "baked", "plan") and way.variant.exact}
    assert len(wanted) > 20
    assert {content(way) for way in wanted} <= known


def test_nothing_may_be_requested_that_may_flip() -> None:
    for scene in (Scene.chapter1(), Scene.builtin("mirrors")):
        assert all(way.variant.exact and way.maker == "native" for way in requestable(scene, bake=True))


# ------------------------------------------------------------------------------------------------ after a run of cost


def report_of(scene: Scene, table: Table, unit: float = 2.0) -> Report:
    """A report of these ways, in which stable and certified take ten times as long as `double`."""
    proved = {"stable": 10.0, "certified float64": 12.0, "certified float32": 11.0}
    ways = {way.name: way for way in requestable(scene, bake=True)}
    rows = {**{name: (ratio, 1e-16, 0.5) for name, ratio in proved.items()}, **table}
    entries = []
    for name, (ratio, error, ulp) in rows.items():
        way = ways[name]
        errors = Errors(error, error, ulp, ulp, 1.0, 0, 0, 4000, 500)
        spread, ns = Spread(ratio, ratio, ratio), Spread(unit * ratio, unit * ratio, unit * ratio)
        entries.append(
            Entry(
                name=name,
                kind=way.kind,
                does="",
                level=way.level,
                choices=way.choices,
                target=way.target,
                bake=way.bake,
                ns=ns,
                ratio=spread,
                errors=errors,
                bound=None,
                lines=100,
                operations=50,
                derive=0.5,
                compile=1.5,
            )
        )
    machine = Machine("cpu", 2, "gcc", "znver3", "3.11", "2.0", "0.1")
    return Report("scene", scene.to_toml(), 256, 256, 15, 1, False, machine, tuple(entries))


@pytest.mark.parametrize("name", SCENES)
def test_after_a_run_of_cost_nothing_that_meets_a_request_is_faster_than_what_is_chosen(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the times and errors that the report holds; nothing is measured or compiled."""
    scene, table = Scene.builtin(name), recorded(name)
    report = report_of(scene, table)
    learn(scene, report, 1.25, cache=tmp_path)
    for word in ("look", "time", "_sample"):
        monkeypatch.setattr(Looking, word, lambda *_, **__: pytest.fail("measured again"))
    for limit in LIMITS:
        found = choose(scene, max_error=limit, cache=tmp_path)
        assert found.bound <= limit
        excess = excess_over(limit)
        rivals = [
            one
            for way, one in entries_by_way(scene, report).items()
            if not way.variant.settles and excess(way, Largest(one.errors.largest, 0.0)) <= 1.0
        ]
        assert found.ns is not None
        assert all(found.ns <= one.ns.median for one in rivals), (limit, found.way)
        assert rivals or found.kind == "proved"
    for limit in (500.0, 100.0, 4.0):
        found = choose(scene, max_ulp=limit, cache=tmp_path)
        doubles = [one for one in report.entries if one.level == "double" and 8.0 * one.errors.ulp <= limit]
        assert found.ns == min((one.ns.median for one in doubles), default=20.0)


def test_after_a_run_of_cost_other_scenes_of_its_plan_choose_among_its_ways(tmp_path: Path) -> None:
    scene, other = Scene.chapter1(), Scene.chapter1(ambient=0.2)
    table = {name: recorded("chapter1")[name] for name in ("single", "double", "double_fused")}
    learn(scene, report_of(scene, table), 1.25, cache=tmp_path)
    found = choose(other, max_error=1e-5, cache=tmp_path)
    assert {entry.way for entry in found.considered} <= set(table)


def test_a_run_of_cost_makes_a_choice_anew(tmp_path: Path) -> None:
    scene = Scene.chapter1()
    table = {name: recorded("chapter1")[name] for name in ("single", "double")}
    learn(scene, report_of(scene, table), 1.25, cache=tmp_path)
    assert choose(scene, max_error=1e-5, cache=tmp_path).way == "single"
    table["single_fused"] = (0.1, 1e-7, 4.0)
    learn(scene, report_of(scene, table), 1.25, cache=tmp_path)
    assert choose(scene, max_error=1e-5, cache=tmp_path).way == "single_fused"


def test_baked_kernels_are_taken_only_where_they_are_asked_for(tmp_path: Path) -> None:
    scene = Scene.chapter1()
    table = {name: recorded("chapter1")[name] for name in ("single", "double")}
    table["single baked"] = (0.1, 1e-7, 4.0)
    learn(scene, report_of(scene, table), 1.25, cache=tmp_path)
    assert choose(scene, max_error=1e-5, cache=tmp_path).way == "single"
    found = choose(scene, max_error=1e-5, bake=True, cache=tmp_path)
    assert (found.way, found.accuracy, found.bake) == ("single baked", "single", True)


def test_what_flips_in_a_report_has_no_bound(tmp_path: Path) -> None:
    scene = Scene.chapter1()
    table = {name: recorded("chapter1")[name] for name in ("single", "double")}
    report = report_of(scene, table)
    wrong = Errors(0.0, 0.0, 0.0, 0.0, 1.0, 1, 0, 4000, 500)
    entries = tuple(replace(one, errors=wrong) if one.name == "single" else one for one in report.entries)
    learn(scene, replace(report, entries=entries), 1.25, cache=tmp_path)
    assert choose(scene, max_error=1e-3, cache=tmp_path).way == "double"


def test_a_way_of_a_report_has_the_name_that_requests_know() -> None:
    """`fast_own` and `single_complement` are one kernel."""
    scene = Scene.chapter1()
    report = report_of(scene, {"double": (1.0, 1e-16, 2.0), "single_complement": (0.5, 1e-6, 9.0)})
    entries = tuple(
        replace(one, name="fast_own", level="fast", choices=("own",)) if one.name == "single_complement" else one
        for one in report.entries
    )
    other = replace(report, entries=entries)
    assert {way.name for way in entries_by_way(scene, other)} == {way.name for way in entries_by_way(scene, report)}


def test_what_is_kept_is_added_to_and_becomes_usual(tmp_path: Path) -> None:
    scene = Scene.chapter1()
    keep_times(scene, times_of(scene, tmp_path).with_ratios(2.0, {"single": 0.5}), tmp_path)
    keep_times(scene, times_of(scene, tmp_path).with_ratios(3.0, {"fast": 0.4}), tmp_path)
    assert times_of(scene, tmp_path) == Times(2.0, {"single": 0.5, "fast": 0.4})
    assert habits_of(Scene.chapter1(eye=9.0), tmp_path) == {"single": 0.5, "fast": 0.4}
    assert habits_of(Scene.builtin("two_spheres"), tmp_path) == {}
    assert errors_seen(scene, "anywhere", tmp_path).top is None


def test_plans_within_a_tolerance_are_taken_where_what_they_leave_out_is_within_the_request() -> None:
    """A mirror so faint that a request allows to leave it out: with it gone nothing jumps, and float32 may draw."""
    plain = Scene.builtin("two_spheres")
    spheres = tuple(replace(one, material=replace(one.material, reflect=0.004)) for one in plain.spheres)
    scene = Scene(plain.camera, spheres, plain.lights, max_bounces=1, shadows=False)
    ways = [way for way in requestable(scene) if way.tolerance]
    assert {way.tolerance for way in ways} == {1e-2}
    found = choose(scene, max_error=3e-2)
    assert found.tolerance > 0.0
    assert found.tolerance < found.bound <= 3e-2
    image = render_image(scene, 40, 30, max_error=3e-2, clip=False)
    whole = render_image(scene, 40, 30, clip=False)
    assert image.dtype == way_of(found.accuracy).variant.result
    assert 0.0 < np.abs(image - whole).max() <= found.bound
    assert evaluate(scene, 0.0, 0.0, max_error=3e-2).dtype == np.float64
    assert choose(scene, max_error=3e-2, plans=False).tolerance == 0.0
    assert choose(scene, max_error=1e-6).tolerance == 0.0


def test_a_wide_image_is_measured_where_it_is_seen() -> None:
    """A sphere to the left of the square window: its errors count for an image that is twice as wide."""
    sphere = Sphere((-1.8, 0.0, 0.0), 0.5, Phong())
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (sphere,), (PointLight((5.0, 5.0, 10.0)),))
    square, wide = (Looking(scene, reach=1.0, aspect=aspect, cache=None) for aspect in (1.0, 2.0))
    assert square.top == 0.0
    assert wide.top > 0.5
    limit = 1e-4
    found = choose(scene, max_error=limit, aspect=1.7)
    image = render_image(scene, 68, 40, accuracy=found.accuracy, target=found.target, clip=False)
    assert np.abs(image - render_image(scene, 68, 40, clip=False)).max() <= found.bound <= limit
    assert np.array_equal(image, render_image(scene, 68, 40, max_error=limit, clip=False))


def test_a_baked_kernel_draws_where_it_is_chosen(tmp_path: Path) -> None:
    scene = Scene.chapter1(shininess=7.0)
    table = {"double": (1.0, 1e-16, 2.0), "double_fused": (0.9, 1e-16, 2.0), "double baked": (0.1, 1e-16, 2.0)}
    learn(scene, report_of(scene, table), 1.25, cache=tmp_path)
    image = render_image(scene, 32, 32, max_error=1e-12, bake=True, cache=tmp_path)
    assert np.array_equal(image, render_image(scene, 32, 32, bake=True, cache=tmp_path))
    assert len(list((tmp_path / "kernels").iterdir())) == 1
