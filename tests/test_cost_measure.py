"""Laws of the measurement: errors are those of the oracle, what is made worse is seen, reports are kept by scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from symrender_cg import Camera, Phong, PointLight, Scene, Sphere, choose, evaluate
from symrender_cg.cost import search as searching
from symrender_cg.cost import store
from symrender_cg.cost.effects import NONE, measure_effects, stages_of
from symrender_cg.cost.front import with_front
from symrender_cg.cost.looking import learn
from symrender_cg.cost.measure import Measured, entries_of, measure
from symrender_cg.cost.ready import Ready, make_ready, subsamples
from symrender_cg.cost.report import Errors
from symrender_cg.cost.sample import LOWEST_BIN, draw_sample, errors_of
from symrender_cg.cost.timing import interleaved
from symrender_cg.cost.variants import Way, content, way_of
from symrender_cg.reference import oracle

SIZE = (48, 32)
Field = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[Any]]


@pytest.fixture(scope="module")
def measured() -> Measured:
    return measure(Scene.chapter1(), "chapter1", SIZE, rounds=3, quick=True)


def errors(field: Field, scene: Scene | None = None, *, points: int = 300, hard: int = 40) -> Errors:
    return errors_of(field, draw_sample(scene or Scene.chapter1(), SIZE, points, hard, 4))


# ------------------------------------------------------------------------------------------------------------- errors


def test_the_error_is_the_distance_from_the_oracle() -> None:
    scene = Scene.chapter1()
    sample = draw_sample(scene, SIZE, 300, 40, 4)
    truth = oracle.evaluate(scene, sample.x, sample.y)
    seen = errors_of(lambda x, y: np.where(truth.hit, truth.value + 1e-3, 0.0), sample)
    assert seen.largest == pytest.approx(1e-3, abs=1e-12)
    assert seen.flips == 0
    exact = errors_of(lambda x, y: truth.value, sample)
    assert exact.largest <= 2.0**-53
    assert exact.ulp <= 0.5
    assert exact.right8 == 1.0


def test_points_of_another_seed_are_other_points_and_of_the_same_seed_the_same() -> None:
    one, same, other = (draw_sample(Scene.chapter1(), SIZE, 50, 0, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.x, same.x)
    assert not np.intersect1d(one.x, other.x).size


def test_a_surface_taken_for_background_is_a_flip_and_no_error() -> None:
    scene = Scene.chapter1()

    def blind(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        values: NDArray[np.float64] = evaluate(scene, x, y)
        return np.where(np.hypot(x, y) > 0.9, 0.0, values)

    seen = errors(blind)
    assert seen.flips > 20
    assert seen.largest < 1e-14
    assert not seen.sound


def test_background_that_is_not_black_shows_flips_too() -> None:
    scene = Scene(Camera((0.0, 0.0, 4.0)), (Sphere((0.0, 0.0, 0.0), 1.0, Phong()),), (PointLight(),), background=0.25)
    assert errors(lambda x, y: evaluate(scene, x, y), scene).sound
    assert errors(lambda x, y: np.full(x.shape, 0.25), scene).flips > 100


def test_the_other_side_of_an_edge_is_a_flip_and_no_error() -> None:
    """A shadow at less than one point of 100, where there is none; the same at many is no edge but an error."""

    def shadowed(share: float) -> Field:
        def field(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
            values: NDArray[np.float64] = evaluate(None, x, y)
            return np.where((values > 0.15) & (np.arange(x.size) % round(1.0 / share) == 0), 0.1, values)

        return field

    rare = errors(shadowed(0.02), points=1000)
    assert 0 < rare.flips < 10
    assert rare.largest < 1e-14
    often = errors(shadowed(0.5))
    assert often.flips == 0
    assert often.largest > 0.3


def test_values_that_are_not_finite_are_counted_and_leave_the_errors_alone() -> None:
    def broken(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        values: NDArray[np.float64] = evaluate(None, x, y)
        return np.where(x > 0.5, np.nan, values)

    seen = errors(broken)
    assert seen.nonfinite > 20
    assert seen.largest < 1e-14
    assert np.isfinite(seen.right8)


def test_the_histogram_holds_every_point_of_the_window_by_its_ulp() -> None:
    seen = errors(lambda x, y: evaluate(None, x, y, accuracy="double"))
    assert sum(seen.histogram) == seen.points == 300
    assert seen.histogram[0] > 50
    highest = LOWEST_BIN + len(seen.histogram) - 2
    assert 2.0 ** (highest - 1) < seen.ulp <= 2.0**6


def test_grey_levels_are_compared_as_grey_levels() -> None:
    seen = errors(lambda x, y: evaluate(None, x, y, accuracy="certified", target="uint8"))
    assert seen.ulp == 0.0
    assert seen.right8 == 1.0
    assert seen.largest <= 0.5 / 255.0 + 1e-15


def test_supersampling_is_compared_with_the_mean_of_the_truth() -> None:
    scene = Scene.chapter1()
    (ready,) = make_ready([replace(way_of("double"), name="double 2x2", kind="samples", side=2)], scene, SIZE)
    sample = draw_sample(scene, SIZE, 200, 0, 4)
    assert errors_of(ready.field, sample, 2).largest < 2e-15
    assert errors_of(ready.field, sample, 1).largest > 1e-3
    assert sorted(subsamples(scene, (10, 10), 2)) == sorted((-u, -v) for u, v in subsamples(scene, (10, 10), 2))


# ---------------------------------------------------------------------------------------------------- the measurement


def test_every_level_is_measured_and_keeps_what_it_proves(measured: Measured) -> None:
    names = {entry.name for entry in measured.report.entries}
    assert {"fast", "single", "literal", "double", "stable", "certified uint8", "numpy", "lambdify"} <= names
    for entry in measured.report.entries:
        if entry.bound is not None:
            assert entry.errors.largest <= entry.bound
            assert entry.errors.sound
    assert measured.report.entry("double").ratio.median == 1.0
    assert measured.report.entry("literal").errors.flips > 0


def test_every_native_way_comes_with_its_c_and_what_building_it_took(measured: Measured) -> None:
    for one, entry in zip(measured.ready, measured.report.entries, strict=True):
        assert one.way.name == entry.name
        assert (entry.lines > 100) == (one.way.maker == "native")
        assert (entry.operations > 30) == (one.way.maker == "native")
        if one.way.maker == "native":
            assert entry.derive > 0.0
            assert entry.compile > 0.0
            assert any(name.endswith(".c") for name in one.files)


def test_the_front_holds_the_fastest_and_the_most_accurate(measured: Measured) -> None:
    front = measured.report.front
    rivals = [
        e for e in measured.report.entries if not e.bake and e.kind in ("level", "reference") and e.target != "uint8"
    ]
    assert front[0].ns.median == min(e.ns.median for e in rivals)
    assert front[-1].errors.largest <= 1.1 * min(e.errors.largest for e in rivals)
    assert len(measured.report.steps) >= len(front) - 2


def test_after_it_nothing_on_the_front_that_meets_a_request_is_faster_than_what_is_chosen(
    measured: Measured, tmp_path: Any
) -> None:
    """By the times that the report holds: it is learned by an empty cache, and nothing more is measured there."""
    scene, report = Scene.chapter1(), msgspec.structs.replace(measured.report, quick=False)
    learn(scene, report, measured.top, cache=tmp_path)
    for limit in (1e-3, 1e-5, 1e-8, 1e-12, 1e-15):
        found = choose(scene, max_error=limit, cache=tmp_path)
        bounds = {entry.way: entry.bound for entry in found.considered}
        meets = [entry for entry in report.front if bounds.get(entry.name, 1.0) <= limit]
        assert report.entry(found.way).on_front or found.kind == "proved" or len(meets) == 0
        assert found.ns == report.entry(found.way).ns.median
        assert all(found.ns <= entry.ns.median for entry in meets)
        assert set(bounds) >= {entry.name for entry in report.front if entry.kind == "level" and entry.bound is None}
    assert not (tmp_path / "kernels").exists()


def worse(ready: Ready, error: float) -> Ready:
    """The way with its values off by so much."""

    def field(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[Any]:
        values = ready.field(x, y)
        return np.where(values != 0, values + values.dtype.type(error), values)

    return replace(ready, way=replace(ready.way, name=f"worse {ready.way.name}"), field=field)


def test_a_kernel_made_worse_on_purpose_is_seen_to_leave_the_front() -> None:
    """`single` off by 1e-3 at the same time; `double` as it is, in three times the time. Errors are measured."""
    scene = Scene.chapter1()
    ready = make_ready([way_of(name) for name in ("single", "double", "stable")], scene, SIZE)
    ready += [worse(ready[0], 1e-3), worse(ready[1], 0.0)]
    seconds = [[1.0, 1.1], [2.0, 2.1], [5.0, 5.1], [1.0, 1.2], [6.0, 6.1]]
    entries = with_front(entries_of(ready, seconds, draw_sample(scene, SIZE, 200, 20, 9), SIZE))
    found = {entry.name: entry for entry in entries}
    assert found["worse single"].errors.largest == pytest.approx(1e-3, rel=1e-3)
    assert found["worse double"].errors == found["double"].errors
    assert found["worse double"].ns.median == pytest.approx(3.0 * found["double"].ns.median, rel=0.05)
    assert {name for name, entry in found.items() if entry.on_front} == {"single", "double", "stable"}
    assert found["worse single"].dominated_by == "single"
    assert found["worse double"].dominated_by == "stable"


def test_a_round_that_was_disturbed_changes_no_ratio() -> None:
    """Times are ratios within a round: what slows all ways down slows none of them."""
    ready = make_ready([way_of(name) for name in ("single", "double")], Scene.chapter1(), SIZE)
    sample = draw_sample(Scene.chapter1(), SIZE, 20, 0, 9)
    calm = entries_of(ready, [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]], sample, SIZE)
    busy = entries_of(ready, [[1.0, 1.0, 9.0], [2.0, 2.0, 18.0]], sample, SIZE)
    assert calm == busy
    assert calm[0].ratio.median == 0.5


def test_a_search_stays_within_its_budget_and_tries_nothing_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.chapter1()

    def made(ways: list[Way], *_: object) -> list[Ready]:
        return [Ready(way, lambda: None, lambda x, y: evaluate(scene, x, y)) for way in ways]

    monkeypatch.setattr(searching, "make_ready", made)
    for budget, choices in ((0, 0), (5, 5), (1000, 20)):
        found = searching.search(scene, (32, 32), seed=1, budget=budget)
        assert found.tried <= budget
        assert sum(one.way.kind == "choice" for one in found.ready) >= choices
        contents = [content(one.way) for one in found.ready]
        assert len(set(contents)) == len(contents)


def test_what_is_slow_sits_rounds_out_and_nothing_less_than_two(monkeypatch: pytest.MonkeyPatch) -> None:
    from symrender_cg.cost import timing

    monkeypatch.setattr(timing, "MOST", 0.0)
    samples = interleaved([lambda: sum(range(1000))], 6, 1)
    assert np.count_nonzero(np.isfinite(samples[0])) == 2
    monkeypatch.setattr(timing, "MOST", 1e9)
    assert np.isfinite(interleaved([lambda: None], 6, 1)).all()


# -------------------------------------------------------------------------------------------------- effects, the store


def test_effects_are_put_back_one_after_the_other_until_the_scene_is_whole() -> None:
    scene = Scene.builtin("mirrors")
    stages = stages_of(scene)
    assert stages[0][0] == NONE
    assert stages[-1][2] == scene.in_camera_frame()
    assert [name for name, _, _ in stages[1:]][-2:] == ["mirror", "mirror_depth"]
    assert stages[-3][2].max_bounces == 0
    assert stages[-2][2].max_bounces == 1
    assert len({stage[2] for stage in stages}) == len(stages)


def test_what_a_plan_leaves_out_is_no_effect_of_the_scene() -> None:
    assert [name for name, _, _ in stages_of(Scene.chapter1())] == [NONE, "diffuse", "specular"]


def test_the_time_of_the_effects_adds_up_to_that_of_the_scene() -> None:
    found = measure_effects(Scene.chapter1(), (64, 64), rounds=3, seed=1)
    assert sum(effect.added for effect in found) == pytest.approx(found[-1].ns.median)


def test_what_is_kept_is_found_by_its_key_alone(tmp_path: Any) -> None:
    store.write("report", ["a", 1], b"one", root=tmp_path)
    assert store.read("report", ["a", 1], root=tmp_path) == b"one"
    assert store.read("report", ["a", 2], root=tmp_path) is None
    assert store.read("times", ["a", 1], root=tmp_path) is None
