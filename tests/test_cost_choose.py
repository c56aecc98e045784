"""Laws of `choose` and of max_error, max_ulp, bits: what is chosen keeps its bound on points and scenes it never saw,
what cannot be kept is refused, and nothing is measured twice."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from symrender_cg import Camera, DirectionalLight, Phong, PointLight, Scene, Sphere, choose, evaluate, render_image
from symrender_cg.cost import choose as choosing
from symrender_cg.cost.bounds import brightest, proved_bounds
from symrender_cg.cost.choose import Choice, jumps
from symrender_cg.cost.looking import Looking
from symrender_cg.cost.sample import draw_sample, errors_of
from symrender_cg.cost.variants import Way, requestable
from symrender_cg.errors import AccuracyError, ArgumentError
from symrender_cg.lower.variants import variant
from symrender_cg.pipeline import planned
from symrender_cg.reference import oracle
from symrender_cg.run.levels import hands_over
from symrender_cg.scene.random import random_spheres

SIZE = (64, 64)
PROVED = {"stable", "certified float32", "certified float64"}
REQUESTS: tuple[dict[str, float], ...] = (
    {"max_error": 1e-3},
    {"max_error": 1e-6},
    {"max_error": 1e-9},
    {"max_error": 1e-14},
    {"max_error": 1e-15},
    {"max_ulp": 64},
    {"max_ulp": 4},
    {"max_ulp": 0.5},
    {"bits": 8},
    {"bits": 16},
)


def one_sphere(seed: int) -> Scene:
    """A sphere of any size, near or far, in the middle (every other seed) or not, with a light above the horizon.

    Their kernels are those of two plans, whatever the seed.
    """
    random = Random(seed)
    radius = 10.0 ** random.uniform(-2.0, 2.0)
    distance = radius * (1.0 + 10.0 ** random.uniform(-1.0, 2.0))
    material = Phong(
        random.uniform(0.01, 0.3),
        random.uniform(0.1, 1.0),
        random.uniform(0.1, 1.0),
        10.0 ** random.uniform(0.0, 2.7),
    )
    center = (0.0, 0.0, 0.0)
    if seed % 2:
        center = (random.uniform(-0.5, 0.5) * radius, random.uniform(-0.5, 0.5) * radius, 0.0)
    away = np.array([random.gauss(0.0, 1.0) for _ in range(3)])
    away *= radius * (1.0 + 10.0 ** random.uniform(-1.0, 2.0)) / np.linalg.norm(away)
    away[2] = abs(away[2])
    x, y, z = (float(a + c) for a, c in zip(away, center, strict=True))
    lights = (PointLight((x, y, z), random.uniform(0.3, 1.5)),)
    return Scene(Camera((0.0, 0.0, distance + radius)), (Sphere(center, radius, material),), lights)


def several(seed: int) -> Scene:
    """A few disjoint spheres; of every other seed without shadows and gates, so that nothing jumps."""
    scene = random_spheres(2 + seed % 3, seed, shadows=bool(seed % 2))
    if seed % 2:
        return scene
    spheres = tuple(Sphere(s.center, s.radius, Phong(0.1, 0.6, 0.4, 20.0)) for s in scene.spheres)
    return Scene(scene.camera, spheres, (DirectionalLight((0.3, 0.4, 1.0)),), shadows=False)


def excess(scene: Scene, found: Choice, seed: int, points: int = 250) -> float:
    """The largest error of what was chosen over its bound, at fresh points: at most 1 where the promise is kept."""
    sample = draw_sample(scene, SIZE, points, 25, seed)
    errors = errors_of(lambda x, y: evaluate(scene, x, y, accuracy=found.accuracy, target=found.target), sample)
    assert errors.flips == 0
    assert errors.nonfinite == 0
    return (errors.largest if found.unit == "absolute" else errors.ulp) / found.bound


def asked(scene: Scene, request: dict[str, float]) -> Choice | None:
    try:
        return choose(scene, **request)  # type: ignore[arg-type]
    except AccuracyError:
        return None


@pytest.mark.parametrize("first", range(0, 160, 40))
def test_on_scenes_and_points_that_chose_nothing_no_bound_is_exceeded(first: int) -> None:
    met: Counter[str] = Counter()
    for seed in range(first, first + 40):
        scene = one_sphere(1_000_000 + seed)
        request = REQUESTS[seed // 2 % len(REQUESTS)]
        found = asked(scene, request)
        if found is None:
            assert request.get("max_error", 1.0) < 1e-14
            continue
        met[found.kind] += 1
        assert found.bound <= next(iter(request.values())) or "bits" in request
        assert excess(scene, found, 77 + seed) <= 1.0, (seed, str(found))
    assert met["measured"] > 6
    assert met["proved"] > 3


@pytest.mark.parametrize("first", range(0, 40, 20))
def test_in_scenes_of_several_spheres_too(first: int) -> None:
    for seed in range(first, first + 20):
        scene = several(seed)
        found = asked(scene, REQUESTS[seed % 4])
        if found is not None:
            assert excess(scene, found, 99 + seed, 120) <= 1.0, (seed, str(found))


@pytest.mark.parametrize("name", ["chapter1", "off_axis", "two_spheres", "mirrors"])
def test_a_built_in_scene_has_a_variant_for_8_bits_that_keeps_its_bound(name: str) -> None:
    scene = Scene.builtin(name)
    found = choose(scene, bits=8)
    assert found.bound <= 0.5 / 255.0
    assert excess(scene, found, 5, 200) <= 1.0


def test_of_what_meets_a_request_the_fastest_is_taken_and_all_that_was_considered_is_told() -> None:
    found = choose(max_error=1e-3)
    known = {entry.way: entry for entry in found.considered}
    ways = {way.name for way in requestable(Scene.chapter1())}
    assert set(known) <= ways
    assert found.possible == len(ways) - 1 > 90, "grey levels are no intensities"
    assert all(entry.meets == (entry.bound <= 1e-3) for entry in found.considered)
    assert known[found.way].meets
    assert all(entry.ns is not None and entry.ns >= known[found.way].ns for entry in found.considered if entry.meets)
    assert str(found).startswith(f"max_error=0.001: `{found.way}`, bound")
    assert "times a margin of 4" in str(found)


def test_a_request_is_tied_to_the_scene() -> None:
    """In a dim scene the same kernel's absolute errors are smaller."""
    dim, usual = Scene.chapter1(ambient=0.01, diffuse=0.02, specular=0.01), Scene.chapter1()
    low, high = (
        min(entry.bound for entry in choose(scene, max_error=1e-5).considered if entry.result == "float32")
        for scene in (dim, usual)
    )
    assert low < 0.2 * high
    between = (low * high) ** 0.5
    assert variant(choose(dim, max_error=between).accuracy).result == "float32"
    assert variant(choose(usual, max_error=between).accuracy).result == "float64"


def test_what_proves_its_values_comes_with_a_proved_bound() -> None:
    found = choose(max_ulp=4)
    assert (found.accuracy, found.kind, found.unit) in (
        ("stable", "proved", "ulp"),
        ("certified", "proved", "ulp"),
    )
    assert {entry.way for entry in found.considered if entry.kind == "proved"} <= PROVED
    assert choose(max_ulp=0.5).way == "certified float64"


def test_a_proved_bound_can_be_asked_for() -> None:
    found = choose(max_error=1e-3, proved=True)
    assert found.kind == "proved"
    assert found.way in PROVED
    assert all(entry.kind == "proved" for entry in found.considered)


def test_a_promise_that_cannot_be_kept_is_refused_with_the_reason() -> None:
    with pytest.raises(AccuracyError) as refusal:
        choose(max_error=1e-20)
    assert refusal.value.exit_code == 4
    assert "no variant has a bound of 1e-20 absolute on this scene" in str(refusal.value)
    assert "the nearest is 'certified float64' with 1.11e-16 (proved)" in str(refusal.value)
    with pytest.raises(AccuracyError, match=r"bound of 0\.1 ulp"):
        render_image(None, 8, 8, max_ulp=0.1)
    with pytest.raises(AccuracyError, match="no variant that is proved"):
        choose(max_error=1e-8, dtype="float32", proved=True)


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({}, "none given; expected exactly one"),
        ({"max_error": 1e-3, "bits": 8}, "max_error, bits given; expected exactly one"),
        ({"max_error": 0.0}, "max_error: 0.0; expected a finite number above 0"),
        ({"max_ulp": math.nan}, "max_ulp: nan; expected"),
        ({"max_error": True}, "max_error: True; expected"),
        ({"bits": 0.5}, "bits: 0.5; expected a number of bits from 1 to 1000"),
        ({"bits": 8, "dtype": "uint8"}, "dtype: uint8 holds no intensities"),
    ],
)
def test_a_request_that_is_none_is_refused(request_: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        choose(**request_)


@pytest.mark.parametrize(
    ("argument", "value"),
    [("accuracy", "single"), ("target", "float32"), ("portable", True), ("backend", "numpy")],
)
def test_what_chooses_a_kernel_cannot_stand_beside_a_request(argument: str, value: object) -> None:
    for call in (
        lambda **more: render_image(None, 8, 8, max_error=1e-3, **more),
        lambda **more: evaluate(None, 0.1, 0.2, bits=8, **more),
    ):
        with pytest.raises(ArgumentError, match=f"{argument}: {value!r} chooses a kernel, and so do max_error"):
            call(**{argument: value})


def test_render_image_and_evaluate_draw_with_what_is_chosen() -> None:
    scene = Scene.chapter1(shininess=20.0)
    for request in ({"max_error": 1e-3}, {"max_ulp": 4}):
        found = choose(scene, **request)  # type: ignore[arg-type]
        image = render_image(scene, 40, 30, **request)  # type: ignore[arg-type]
        again = render_image(scene, 40, 30, accuracy=found.accuracy, target=found.target)
        assert image.dtype == again.dtype
        assert np.array_equal(image, again)
        points = np.linspace(-1.0, 1.0, 50)
        values = evaluate(scene, points, 0.3, **request)
        assert np.array_equal(values, evaluate(scene, points, 0.3, accuracy=found.accuracy, target=found.target))


def test_an_array_to_write_into_decides_the_format_of_the_result() -> None:
    out = np.empty((8, 8))
    assert render_image(None, 8, 8, max_error=1e-3, out=out) is out
    small = np.empty((8, 8), np.float32)
    assert render_image(None, 8, 8, max_error=1e-3, out=small) is small
    with pytest.raises(AccuracyError, match="no variant has a bound of 1e-09"):
        render_image(None, 8, 8, max_error=1e-9, out=small)
    narrow = choose(max_ulp=4, dtype="float32")
    assert variant(narrow.accuracy, narrow.target).result == "float32"


def test_where_the_image_jumps_no_float32_kernel_is_measured() -> None:
    for name in ("mirrors", "shadow", "intersecting", "hundred", "grazing_light"):
        assert jumps(planned(Scene.builtin(name)))
    found = choose("mirrors", bits=8)
    assert {entry.way for entry in found.considered} == {"double"}
    assert not jumps(planned(Scene.chapter1()))
    assert not jumps(planned(Scene.builtin("two_spheres")))


def test_where_double_hands_over_no_kernel_stands_in_for_it() -> None:
    scene = Scene.builtin("grazing_light")
    assert hands_over(scene)
    found = choose(scene, max_error=1e-12)
    assert (found.way, found.kind) == ("double", "proved")
    assert excess(scene, found, 8) <= 1.0


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two candidates, so that a cache of one's own is soon filled."""

    def some(scene: Scene, **how: Any) -> tuple[Way, ...]:
        return tuple(way for way in requestable(scene, **how) if way.name in ("single", "double"))

    monkeypatch.setattr(choosing, "requestable", some)


@pytest.mark.usefixtures("few")
def test_a_second_choice_is_looked_up_and_measures_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.chapter1(shininess=11.0)
    first = choose(scene, max_error=1e-5, cache=tmp_path)
    kinds = ["choice", "errors", "habits", "times"]
    assert sorted(path.name.partition("-")[0] for path in (tmp_path / "cost").iterdir()) == kinds
    assert len(list((tmp_path / "kernels").iterdir())) >= 2
    for name in ("look", "time", "_sample"):
        monkeypatch.setattr(Looking, name, lambda *_, **__: pytest.fail("measured again"))
    assert choose(scene, max_error=1e-5, cache=tmp_path) == first
    assert choose(scene, max_error=1e-12, cache=tmp_path).way == "double"


@pytest.mark.usefixtures("few")
def test_a_damaged_record_is_measured_anew(tmp_path: Path) -> None:
    scene = Scene.chapter1(shininess=12.0)
    first = choose(scene, max_error=1e-12, cache=tmp_path)
    for path in (tmp_path / "cost").iterdir():
        path.write_bytes(path.read_bytes()[:7])
    assert choose(scene, max_error=1e-12, cache=tmp_path).bound == first.bound


@pytest.mark.usefixtures("few")
@pytest.mark.filterwarnings("ignore::symrender_cg.build.cache.CacheWarning")
def test_a_place_that_cannot_be_written_still_chooses(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    assert choose(Scene.chapter1(), max_error=1e-12, cache=blocked).bound <= 1e-12


def test_points_far_outside_of_the_window_are_part_of_the_sample() -> None:
    """Zoomed in on the dark middle: the highlight lies outside the window, and evaluate is asked there."""
    sphere = Sphere((0.0, 0.0, 0.0), 1.0, Phong(0.05, 0.0, 1.0, 900.0))
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=0.01), (sphere,), (PointLight((5.0, 5.0, 10.0)),))
    x, y = np.random.default_rng(2).uniform(-1.0, 1.0, (2, 300))
    values = evaluate(scene, x, y, max_error=1e-5)
    truth = oracle.evaluate(scene, x, y)
    assert np.abs(values - truth.value).max() <= 1e-5


def test_the_brightest_value_is_a_bound_of_every_value() -> None:
    for name in ("chapter1", "two_spheres", "mirrors"):
        scene = Scene.builtin(name)
        half = scene.in_camera_frame().camera.half_height
        assert half is not None
        x, y = np.random.default_rng(3).uniform(-half, half, (2, 400))
        assert evaluate(scene, x, y).max() <= brightest(scene)
    assert brightest(Scene.chapter1()) == pytest.approx(1.3)
    fading = Scene(
        Scene.chapter1().camera, Scene.chapter1().spheres, (PointLight((5.0, 5.0, 10.0), attenuation=(0.0, 0.0, 1.0)),)
    )
    assert brightest(fading) == math.inf
    assert proved_bounds(fading, variant("stable")) == (math.inf, 4.0)
    assert proved_bounds(fading, variant("double")) is None
