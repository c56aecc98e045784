"""Scenes that are weighed together: whatever is said of one is what its own plan says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs
from scene_strategies import random_scene, scenes
from stacked_scenes import changes, decided_lists, lists_of

from symrender_cg import Camera, DirectionalLight, Phong, Plane, PointLight, Scene, Sphere
from symrender_cg.errors import SceneError, SymrenderError
from symrender_cg.pipeline import planned
from symrender_cg.plan.plan import Plan, plan
from symrender_cg.plan.stack import Weighed, effects_of, is_stackable, weigh
from symrender_cg.plan.stack_lists import decide
from symrender_cg.plan.stack_numbers import Stack
from symrender_cg.run.enclosure_numbers import exact_numbers
from symrender_cg.run.parameters import Sets, parameter_sets
from symrender_cg.run.scene_numbers import scene_numbers
from symrender_cg.run.stack_structures import numbers_of_stack
from symrender_cg.run.stacking import stack_of, stack_of_scenes
from symrender_cg.scene import Gradient, exact

ASPECT = 1.5
COUNT = 6


def stacked(scene: Scene, sets: Sets, count: int = COUNT) -> Stack:
    """All sets."""
    read = stack_of(scene, sets, range(count))
    assert read is not None
    assert read[1] == list(range(count))
    return read[0]


def numbers(found: Plan) -> dict[str, Any]:
    """What kernels and enclosures of a plan are called with."""
    assert found.arrangement is not None
    of_kernel = scene_numbers(found.scene, found.arrangement, 1 if found.scene.is_grey else 3)
    of_enclosure = {**exact_numbers(found.scene), "radius": of_kernel["radius"], "center_z": of_kernel["center_z"]}
    return of_kernel | {f"exact {name}": value for name, value in of_enclosure.items()}


def stacked_numbers(found: Plan, weighed: Weighed, k: int) -> dict[str, Any]:
    """The same of one scene of a stack, by the plan of another."""
    decided, channels, given = decide(weighed, np.array([k])), 1 if found.scene.is_grey else 3, numbers(found)
    result: dict[str, Any] = dict(given)
    for prefix, in_full in (("exact ", True), ("", False)):
        same = {name.removeprefix("exact ") if in_full else name: value for name, value in given.items()}
        some, lists = numbers_of_stack(found.scene, same, weighed.stack, decided, channels, in_full=in_full)
        every = {**some, **{name: values for name, (values, _) in lists.items()}}
        result |= {prefix + name: value for name, value in every.items() if prefix + name in given}
    result["at_eye"] = result["at_eye"][: int(decided.visible[0])]
    return result


def check(
    scene: Scene, parameters: dict[str, Any], aspect: float | None, force: tuple[str, ...] = ()
) -> tuple[int, int]:
    """Compares all that is said of scenes with their own plans; (scenes that are alike, scenes that have a plan)."""
    try:
        found = plan(scene, aspect=aspect, force=force)
    except SymrenderError:
        return 0, 0
    if not is_stackable(scene, found):
        return 0, 0
    sets = parameter_sets(scene, parameters)
    weighed = weigh(found, stacked(scene, sets), np.ones(COUNT, dtype=bool))
    alike = every = 0
    for k in range(COUNT):
        try:
            own = plan(sets.scene(k), aspect=aspect, force=force)
        except SymrenderError:
            assert not weighed.alike[k]
            continue
        if own.arrangement is None:
            assert not weighed.alike[k]
            continue
        every += 1
        if weighed.alike[k]:
            alike += 1
            assert effects_of(own) == weighed.effects[k]
            assert own.scene.camera.half_height == weighed.stack.half_height[k]
            assert decided_lists(decide(weighed, np.array([k]))) == [lists_of(own.arrangement)]
            got = stacked_numbers(found, weighed, k)
            for name, wanted in numbers(own).items():
                bits = np.asarray(wanted, dtype=np.float64).tobytes()
                assert np.asarray(got[name], dtype=np.float64).tobytes() == bits, name
    return alike, every


@pytest.mark.parametrize("force", [(), ("scene",)])
@pytest.mark.parametrize("aspect", [ASPECT, None])
def test_scenes_that_are_alike_have_the_lists_and_numbers_of_their_own_plans(
    aspect: float | None, force: tuple[str, ...]
) -> None:
    """Bit by bit; of scenes of all kinds, ordinary and degenerate, nearly all that have a plan are said to be alike."""
    found = np.zeros(2, dtype=int)
    for seed in range(90):
        scene = random_scene(seed)
        if scene.spheres:
            found += check(scene, changes(scene, seed, COUNT), aspect, force)
    alike, every = found.tolist()
    assert alike > 0.97 * every
    assert every > 450


@given(scene=scenes(), seed=st.integers(0, 500), wide=st.booleans())
@settings(max_examples=60, deadline=None)
def test_whatever_changes_in_whatever_scene_its_plan_is_that_of_its_own(scene: Scene, seed: int, wide: bool) -> None:
    if scene.spheres:
        check(scene, changes(scene, seed, COUNT), None if wide else ASPECT)


def test_scenes_decided_together_have_the_lists_that_each_has_alone() -> None:
    """However many spheres, lamps and blockers the others have."""
    for seed in (3, 8, 17, 21, 40, 66):
        scene = random_scene(seed)
        found = plan(scene, aspect=ASPECT, force=("scene",))
        weighed = weigh(found, stacked(scene, parameter_sets(scene, changes(scene, seed, COUNT))), np.ones(COUNT, bool))
        chosen = np.flatnonzero(weighed.alike)
        alone = [decided_lists(decide(weighed, np.array([k])))[0] for k in chosen]
        assert decided_lists(decide(weighed, chosen)) == alone


def test_scenes_in_a_row_are_read_as_their_columns_are() -> None:
    read_rows = 0
    for seed in range(40):
        scene = random_scene(seed)
        if not scene.spheres:
            continue
        sets = parameter_sets(scene, changes(scene, seed, COUNT))
        try:
            rows = [sets.scene(k) for k in range(COUNT)]
        except SceneError:
            continue
        read = stack_of_scenes(scene, rows)
        assert read is not None
        assert read[1] == list(range(COUNT))
        by_column = stacked(scene, sets)
        for name in set(Stack.__dataclass_fields__) - {"changes", "ground"}:
            one, other = getattr(by_column, name), getattr(read[0], name)
            assert np.array_equal(one, other, equal_nan=True) if one is not None else other is None, name
        assert read[0].changes <= by_column.changes
        read_rows += 1
    assert read_rows > 20


OTHERS: dict[str, dict[str, Any]] = {
    "a plane": {"plane": Plane((0.0, -3.0, 0.0))},
    "no shadows": {"shadows": False},
    "fewer bounces": {"max_bounces": 1},
    "a light more": {"lights": (PointLight((9.0, 9.0, 9.0)), PointLight((5.0, 5.0, 9.0)))},
    "a light in parallel": {"lights": (DirectionalLight((-1.0, -1.0, -2.0)),)},
    "a light that fades": {"lights": (PointLight((9.0, 9.0, 9.0), attenuation=(1.0, 0.5, 0.0)),)},
    "a gradient": {"background": Gradient(0.0, 1.0)},
    "a gated highlight": {"spheres": (Sphere((-0.7, 0.0, 0.0), 0.5, Phong(gate_specular=True)), Sphere())},
    "a sphere more": {"spheres": tuple(Sphere((x, 0.0, 0.0), 0.3) for x in (-0.8, 0.0, 0.8))},
}
PAIR = Scene(
    Camera((0.0, 0.0, 6.0), half_height=1.5),
    (Sphere((-0.7, 0.0, 0.0), 0.5), Sphere((0.7, 0.0, 0.25), 0.5)),
    (PointLight((9.0, 9.0, 9.0)),),
)
GROUNDED = structs.replace(PAIR, plane=Plane((0.0, -1.0, 0.0)))


@pytest.mark.parametrize("case", OTHERS)
def test_a_scene_of_another_kind_is_not_stacked(case: str) -> None:
    read = stack_of_scenes(PAIR, [PAIR, PAIR, structs.replace(PAIR, **OTHERS[case]), PAIR])
    assert read is not None
    assert read[1] == [0, 1, 3]
    assert read[0].count == 3


def test_a_plan_of_one_sphere_or_within_a_tolerance_is_not_stackable() -> None:
    assert not is_stackable(Scene.chapter1(), plan(Scene.chapter1()))
    assert not is_stackable(PAIR, plan(PAIR, max_error=0.01))
    assert not is_stackable(PAIR, plan(PAIR, force=("shadow",)))
    assert is_stackable(PAIR, plan(PAIR, force=("scene",)))


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("spheres.0.radius", [0.5, -0.5, 0.0, math.nan, math.inf, 1e-20, 6.1, 0.5]),
        ("spheres.0.center.2", [0.0, math.nan, math.inf, 6.4, 1e9, 5.5, 2.0**40, 0.0]),
        ("spheres.0.material.reflect", [0.0, -0.5, math.nan, math.inf, 1.5, 1e300, -1e-9, 1.0]),
        ("lights.0.position.0", [9.0, math.nan, math.inf, -math.inf, 1e300, 1e200, 2.0**60, 9.0]),
        ("lights.0.intensity", [1.0, -1.0, math.nan, math.inf, 1e300, 1e200, -0.5, 1.0]),
        ("spheres.1.material.shininess", [1.0, -1.0, math.nan, math.inf, 1e300, 1e200, -0.5, 1.0]),
        ("background", [1.0, -1.0, math.nan, math.inf, 1e300, 1e200, -0.5, 1.0]),
        ("camera.half_height", [1.0, -1.0, 0.0, math.inf, 1e300, 1e-200, -0.5, 1.0]),
        ("camera.eye.2", [6.0, 0.0, math.nan, math.inf, 1e300, 1e-200, -1e20, 7.0]),
        ("camera.eye.1", [2.0, math.nan, math.inf, -math.inf, 1e300, 2.0**60, -1e20, 0.0]),
        ("camera.up.2", [0.5, math.nan, math.inf, math.nan, -math.inf, math.inf, math.nan, 1e300]),
        ("camera.up.1", [0.5, math.nan, math.inf, 0.0, -math.inf, -0.0, math.nan, 1e-300]),
        ("camera.look_at.2", [0.0, math.nan, math.inf, 6.0, -math.inf, 1e300, -1e18, 1.0]),
        ("plane.point.1", [-1.0, math.nan, math.inf, 0.0, 1e300, 1e9, -math.inf, -2.0]),
        ("plane.normal.1", [1.0, math.nan, math.inf, 0.0, 1e300, 1e200, 1e-80, 0.5]),
        ("plane.axis.0", [1.0, math.nan, math.inf, 0.0, 1e300, 1e200, 1e-80, 0.5]),
        ("plane.tile", [1.0, math.nan, math.inf, 0.0, 1e300, 1e200, -1.0, 0.5]),
    ],
)
def test_numbers_that_make_no_scene_or_an_extraordinary_one_are_not_alike(path: str, values: list[float]) -> None:
    scene = GROUNDED if path.startswith("plane") else PAIR
    stack = stacked(scene, parameter_sets(scene, {path: values}), 8)
    weighed = weigh(planned(scene, aspect=1.0), stack, np.ones(8, dtype=bool))
    assert weighed.alike.tolist() == [True, *[False] * 6, True]


LEANING = Plane((0.0, -1.0, 0.0), (0.1, 0.7, 0.3))


def lights_near(plane: Plane) -> list[tuple[float, float, float]]:
    """Places whose side of the plane is not that of the float64 value of n.(X - point)."""
    draws = np.random.default_rng(0)
    found: list[tuple[float, float, float]] = []
    normal, point = np.array(plane.normal), np.array(plane.point)
    while len(found) < COUNT:
        x, z = draws.uniform(-4.0, 4.0, 2).tolist()
        place = (x, -1.0 - (0.1 * x + 0.3 * z) / 0.7, z)
        height = float((np.array(place) - point) @ normal)
        if exact.side_of_plane(place, plane.point, plane.normal) * height <= 0.0 != height:
            found.append(place)
    return found


DEGENERATE: dict[str, tuple[Scene, dict[str, Any]]] = {
    "two spheres of one power": (PAIR, {"spheres.1.center.2": [0.25, 0.0, 1e-16, -0.25, 0.0, 2.0**-60]}),
    "spheres that touch": (
        PAIR,
        {"spheres.1.center": [(d, 0.0, 0.0) for d in (0.3, 0.3 - 2.0**-54, 0.5, 0.25, 0.0, -0.7)]},
    ),
    "a sphere that reaches the plane of the eye": (
        PAIR,
        {"spheres.0.center": [(4.0, 0.0, z) for z in (5.5, 5.5 + 2.0**-50, 6.5, 6.5 - 2.0**-50, 6.0, 7.0)]},
    ),
    "a plane through a sphere, and at its pole": (
        GROUNDED,
        {"plane.point.1": [-0.5, 0.0, 0.25, 0.5, -0.5 - 2.0**-53, 0.1]},
    ),
    "an eye all but in the plane": (
        GROUNDED,
        {"plane.point": [(0.0, y, 0.0) for y in (-1e-9, 1e-9, -(2.0**-40), 2.0**-30, -1e-300, 1e-16)]},
    ),
    "an eye in the plane": (GROUNDED, {"plane.point.1": [-1.0, 0.0, -0.0, 0.0, 1.0, 0.5]}),
    "a light in the plane": (
        GROUNDED,
        {"lights.0.position.1": [-1.0, -1.0 + 2.0**-52, -1.0 - 2.0**-52, 0.0, -2.0, 5.0]},
    ),
    "a light in parallel along the plane": (
        structs.replace(GROUNDED, lights=(DirectionalLight((1.0, 0.0, 0.0)),)),
        {"lights.0.direction.1": [0.0, 1e-300, -1e-300, -0.5, 0.5, 2.0**-60]},
    ),
    "a mirror that touches the plane": (
        structs.replace(GROUNDED, spheres=(Sphere((-0.7, 0.0, 0.0), 0.5, Phong(reflect=0.5)), PAIR.spheres[1])),
        {"spheres.0.center.1": [-0.5, -0.5 - 2.0**-53, -0.5 + 2.0**-53, 0.0, -1.0, -1.5]},
    ),
    "a plane seen along its edge": (
        GROUNDED,
        {"plane.normal": [(0.0, 0.25, z) for z in (1.0, -1.0, 0.0, 1e-9, 4.0, -4.0)]},
    ),
    "one tile that fills the window, odd or even, or more": (
        structs.replace(
            GROUNDED,
            plane=Plane((-3.0, -32.0, -2.0), (0.0, 0.0, 1.0), Phong(), Phong(diffuse=0.1), 64.0, (1.0, 0.0, 0.0)),
        ),
        {"plane.point.0": [-3.0, 3.0, 2.0, 2.0 + 2.0**-20, -62.0, 31.0]},
    ),
    "a light so near the plane that float64 sees it on the other side": (
        structs.replace(GROUNDED, plane=LEANING),
        {"lights.0.position": lights_near(LEANING)},
    ),
    "a sphere whose depth rounds to its radius": (
        structs.replace(PAIR, spheres=(Sphere((8.0, 0.0, 0.0), 6.0), *PAIR.spheres)),
        {"spheres.0.center.2": [0.0, -(2.0**-60), 2.0**-60, -1.0, 1.0, 12.0 - 2.0**-60]},
    ),
    "an eye that comes as near as it may": (
        PAIR,
        {"camera.eye": [(-0.7, 0.0, 0.5 + d) for d in (1.0, 0.1, 1e-3, 1e-9, 2.0**-52, 0.0)]},
    ),
    "a camera that sees along its way up": (
        PAIR,
        {"camera.up": [(x, 0.0, 1.0) for x in (1.0, 0.1, 1e-3, 1e-9, 1e-300, 0.0)]},
    ),
}
EXTRAORDINARY = (
    "an eye all but in the plane",
    "an eye that comes as near as it may",
    "a camera that sees along its way up",
)
"""Some of these have numbers beyond what is weighed."""


@pytest.mark.parametrize("case", DEGENERATE)
def test_of_a_degenerate_scene_is_said_what_its_plan_says(case: str) -> None:
    """What only whole numbers decide is decided so: but for what has no plan, or no ordinary numbers, all are alike."""
    scene, parameters = DEGENERATE[case]
    alike, every = np.array([check(scene, parameters, aspect) for aspect in (1.0, None)]).sum(axis=0).tolist()
    assert every > 3
    assert alike >= (every if case not in EXTRAORDINARY else every // 2)
