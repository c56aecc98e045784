"""Laws of the front, of what a step along it buys, and of break-even: arithmetic on entries, nothing is drawn."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from symrender_cg.cost.break_even import break_even, break_evens
from symrender_cg.cost.front import LEAST_GAIN, OTHER_IMAGE, OTHER_PLAN, dominates, steps_along, with_front
from symrender_cg.cost.report import Entry, Errors, Machine, Report, Spread


def entry(
    name: str, time: float, error: float, flips: int = 0, *, kind: str = "level", bake: bool = False, broken: int = 0
) -> Entry:
    """A way with that time a pixel, largest error and flips; what it took to build is 0.5 + 1.5 s."""
    errors = Errors(error, error / 2.0, error * 2.0**53, error * 2.0**52, 1.0, flips, broken, 1000, 100, (3, 2, 1))
    spread = Spread(time, time, time)
    return Entry(name, kind, "", "double", (), None, bake, spread, spread, errors, None, 100, 50, 0.5, 1.5)


def front(*entries: Entry) -> dict[str, str]:
    """Name -> what dominates it, empty on the front."""
    return {found.name: found.dominated_by for found in with_front(entries)}


def test_what_is_slower_and_less_accurate_is_dominated_and_its_rival_is_named() -> None:
    ways = [entry("fast", 1.0, 1e-5), entry("single", 2.0, 1e-7), entry("bad", 3.0, 1e-6), entry("good", 4.0, 0.0)]
    assert front(*ways) == {"fast": "", "single": "", "bad": "single", "good": ""}


def test_a_way_made_slower_on_purpose_leaves_the_front() -> None:
    ways = [entry("fast", 1.0, 1e-5), entry("single", 2.0, 1e-7), entry("double", 3.0, 1e-15)]
    assert not any(front(*ways).values())
    ways[1] = entry("single", 3.5, 1e-7)
    assert front(*ways) == {"fast": "", "single": "double", "double": ""}


def test_a_way_made_less_accurate_on_purpose_leaves_the_front() -> None:
    ways = [entry("fast", 1.0, 1e-5), entry("single", 2.0, 1e-4)]
    assert front(*ways) == {"fast": "", "single": "fast"}


def test_flips_are_an_axis_of_their_own() -> None:
    """A way that is fast and accurate and wrong at outlines dominates nothing that is sound, and nothing sound it."""
    ways = [entry("hasty", 1.0, 1e-15, flips=5), entry("sound", 2.0, 1e-15), entry("both", 3.0, 1e-15, flips=5)]
    assert front(*ways) == {"hasty": "", "sound": "", "both": "sound"}
    assert front(entry("sound", 1.0, 1e-15), entry("hasty", 1.5, 1e-16, flips=1)) == {"sound": "", "hasty": ""}
    assert front(entry("nan", 1.0, 1e-15, broken=1), entry("sound", 2.0, 1e-14)) == {"nan": "", "sound": ""}


def test_a_slower_way_has_to_buy_a_tenth_of_the_error() -> None:
    assert front(entry("a", 1.0, 1e-5), entry("b", 1.1, 0.95e-5)) == {"a": "", "b": "a"}
    assert front(entry("a", 1.0, 1e-5), entry("b", 1.1, 0.8e-5)) == {"a": "", "b": ""}


def test_baked_kernels_have_a_front_below_the_one_of_kernels_for_any_numbers() -> None:
    found = front(
        entry("double", 2.0, 1e-15),
        entry("double baked", 1.0, 1e-15, bake=True),
        entry("single baked", 1.5, 1e-7, bake=True),
        entry("literal baked", 2.5, 1e-14, bake=True),
    )
    assert found["double"] == ""
    assert found["double baked"] == ""
    assert found["single baked"] == "double baked"
    assert found["literal baked"] in ("double", "double baked")


def test_supersampling_and_general_plans_stand_beside_the_front_and_dominate_nothing() -> None:
    found = front(
        entry("2x2", 1.0, 1e-16, kind="samples"), entry("+scene", 1.0, 1e-16, kind="general"), entry("a", 2.0, 1e-15)
    )
    assert found == {"2x2": OTHER_IMAGE, "+scene": OTHER_PLAN, "a": ""}


ENTRIES = st.lists(
    st.tuples(st.floats(0.1, 100.0), st.floats(0.0, 1.0), st.integers(0, 3)), min_size=1, max_size=12
).map(lambda rows: [entry(f"way {i}", *row) for i, row in enumerate(rows)])


@given(ENTRIES)
def test_every_way_is_on_the_front_or_dominated_by_one_that_is(ways: list[Entry]) -> None:
    marked = {found.name: found for found in with_front(ways)}
    assert any(found.on_front for found in marked.values())
    for found in marked.values():
        if not found.on_front:
            rival = marked[found.dominated_by]
            assert rival.on_front
            assert rival.ns.median <= found.ns.median
            assert rival.errors.largest <= LEAST_GAIN * found.errors.largest
            assert rival.errors.flips <= found.errors.flips


@given(ENTRIES)
def test_no_way_of_the_front_dominates_another_that_is_slower(ways: list[Entry]) -> None:
    on_front = [found for found in with_front(ways) if found.on_front]
    assert not any(dominates(a, b) for a in on_front for b in on_front if a.ns.median < b.ns.median)


@given(ENTRIES, st.randoms())
def test_the_front_does_not_depend_on_the_order_of_the_ways(ways: list[Entry], random: object) -> None:
    shuffled = list(ways)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert front(*ways) == front(*shuffled)


def test_steps_tell_what_the_next_way_of_the_front_costs_and_buys() -> None:
    ways = with_front([entry("b", 2.4, 1e-16), entry("a", 1.0, 1e-15), entry("c", 3.0, 1e-15)])
    (step,) = steps_along(ways)
    assert str(step) == "from `a` to `b`: 2.40 times the time, error 1.0e-15 -> 1.0e-16"


def test_the_first_step_says_what_it_costs_to_be_sound() -> None:
    ways = with_front([entry("hasty", 1.0, 1e-9, flips=7), entry("sound", 1.5, 1e-9)])
    (step,) = steps_along(ways)
    assert str(step).endswith("error 1.0e-09 -> 1.0e-09, flips 7 -> 0")


def test_no_step_leads_to_a_baked_kernel() -> None:
    ways = with_front([entry("a", 1.0, 1e-5), entry("b", 2.0, 1e-9), entry("c", 3.0, 1e-12, bake=True, kind="baked")])
    assert [(step.before, step.after) for step in steps_along(ways)] == [("a", "b")]


def test_break_even_is_the_build_over_the_time_saved() -> None:
    found = break_even("numbers", entry("double baked", 1.0, 0.0), entry("double", 3.0, 0.0), (100, 50))
    assert found.build == 2.0
    assert found.saved == 2.0
    assert found.pixels == pytest.approx(1e9)
    assert found.images == pytest.approx(1e9 / 5000)


def test_what_saves_nothing_never_pays() -> None:
    found = break_even("numbers", entry("double baked", 3.0, 0.0), entry("double", 3.0, 0.0), (100, 50))
    assert (found.pixels, found.images) == (None, None)


def test_every_baked_kernel_and_every_plan_has_its_break_even() -> None:
    ways = [
        entry("double", 1.0, 0.0),
        entry("double baked", 0.5, 0.0, kind="baked", bake=True),
        entry("single baked", 0.5, 0.0, kind="baked", bake=True),
        entry("double +scene", 2.0, 0.0, kind="general"),
    ]
    found = {(row.special, row.general) for row in break_evens(ways, (10, 10))}
    assert found == {("double baked", "double"), ("double", "double +scene")}


def test_a_report_is_read_back_from_json_as_it_was_written() -> None:
    machine = Machine("cpu", 2, "gcc", "znver3", "3.11", "2.0", "0.1")
    entries = with_front([entry("a", 1.0, 1e-5), entry("b", 2.0, 1e-9)])
    report = Report("chapter1", "", 8, 6, 3, 1, False, machine, entries, steps_along(entries))
    assert msgspec.json.decode(msgspec.json.encode(report), type=Report) == report
    assert [found.name for found in report.front] == ["a", "b"]
    with pytest.raises(KeyError):
        report.entry("c")
    assert report.entry("b") == replace(entries[1])
