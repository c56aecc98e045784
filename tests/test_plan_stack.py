"""Scenes that are weighed together: whatever is said of one is what its own plan says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from symrender_cg import Camera, DirectionalLight, Phong, Plane, PointLight, Scene, Sphere
from symrender_cg.pipeline import planned
from symrender_cg.plan import stack as stacks
from symrender_cg.plan.plan import Plan, plan
from symrender_cg.plan.stack import Stack, effects_of, is_stackable, weigh
from symrender_cg.plan.stack_lists import Decided, decide
from symrender_cg.run.parameters import Sets, parameter_sets
from symrender_cg.run.stacking import stack_of, stack_of_scenes

ASPECT = 1.5


def random_scene(seed: int) -> Scene:
    """Up to 9 spheres, some of which touch, hide one another, or are out of view; up to 3 lights of both kinds."""
    draws = np.random.default_rng(seed)

    def material() -> Phong:
        diffuse, specular = np.where(draws.random(2) < 0.8, 0.4, 0.0).tolist()
        return Phong(0.1, diffuse, specular, 9.0, bool(draws.random() < 0.5))

    spheres: list[Sphere] = []
    while len(spheres) < 3 + seed % 7:
        center, radius = tuple(draws.uniform(-2.5, 2.5, 3).tolist()), float(draws.uniform(0.1, 0.8))
        if math.dist(center, (0.0, 0.0, 6.0)) > radius + 0.1:
            spheres.append(Sphere(center, radius, material()))
    lights: list[Any] = [PointLight(tuple(draws.uniform(-9.0, 9.0, 3).tolist())) for _ in range(1 + seed % 2)]
    if seed % 3 == 0:
        lights.append(DirectionalLight((1.0, -2.0, -1.0), 0.5))
    if seed % 5 == 0:
        lights[0] = structs.replace(lights[0], attenuation=(1.0, 0.1, 0.0))
    camera = Camera((0.0, 0.0, 6.0), half_height=None if seed % 4 == 0 else 1.5)
    return Scene(camera, tuple(spheres), tuple(lights), shadows=seed % 11 != 0)


def changes(scene: Scene, seed: int, count: int) -> dict[str, Any]:
    """Something that moves or changes, by a little or by much."""
    draws = np.random.default_rng(1000 + seed)
    far = (0.02, 0.3, 3.0)[seed % 3]
    light, sphere = scene.lights[0], scene.spheres[0]
    assert isinstance(light, PointLight)
    return (
        {"lights.0.position": np.array(light.position) + draws.uniform(-far, far, (count, 3))},
        {"spheres.0.center": np.array(sphere.center) + draws.uniform(-far, far, (count, 3)) * 0.3},
        {"spheres.1.radius": scene.spheres[1].radius * draws.uniform(0.5, 1.5, count)},
        {
            "spheres.0.material.specular": draws.choice([0.0, 0.5], count),
            "spheres.2.material.diffuse": draws.choice([0.0, 0.5], count),
            "lights.0.intensity": draws.choice([0.0, 1.0], count),
        },
    )[seed // 3 % 4]


def stacked(scene: Scene, found: Plan, sets: Sets, count: int) -> Stack:
    """All sets."""
    read = stack_of(scene, found, sets, range(count))
    assert read is not None
    assert read[1] == list(range(count))
    return read[0]


def lists_of(found: Plan) -> dict[str, Any]:
    """A plan's lists by the indices of the scene's spheres and lights."""
    arrangement = found.arrangement
    assert arrangement is not None
    spheres, visible = arrangement.spheres.tolist(), arrangement.visible
    terms = arrangement.lamp_diffuse + 2 * arrangement.lamp_specular + 4 * arrangement.lamp_gated
    return _named(
        spheres,
        visible,
        arrangement.lamps_begin.tolist(),
        arrangement.lamp_light.tolist(),
        terms.tolist(),
        arrangement.blockers_begin.tolist(),
        arrangement.blockers.tolist(),
    )


def _named(
    spheres: Any, visible: int, lamps_begin: Any, lights: Any, terms: Any, begin: Any, blockers: Any
) -> dict[str, Any]:
    lamps = [(spheres[k], lamp) for k in range(visible) for lamp in range(lamps_begin[k], lamps_begin[k + 1])]
    return {
        "front": spheres[:visible],
        "lamps": [(k, lights[lamp], terms[lamp]) for k, lamp in lamps],
        "shades": [[spheres[at] for at in blockers[begin[lamp] : begin[lamp + 1]]] for _, lamp in lamps],
    }


def decided_lists(decided: Decided, visible: int) -> list[dict[str, Any]]:
    """The same of every scene that was decided."""
    lamps, shades = np.cumsum([0, *decided.lamps]), np.cumsum([0, *decided.shades])
    return [
        _named(
            decided.spheres[k].tolist(),
            visible,
            decided.lamps_begin[k].tolist(),
            decided.lamp_light[lamps[k] : lamps[k + 1]].tolist(),
            decided.lamp_terms[lamps[k] : lamps[k + 1]].tolist(),
            decided.blockers_begin[lamps[k] + k : lamps[k + 1] + k + 1].tolist(),
            decided.blockers[shades[k] : shades[k + 1]].tolist(),
        )
        for k in range(len(decided.chosen))
    ]


@pytest.mark.parametrize("force", [(), ("scene",)])
@pytest.mark.parametrize("aspect", [ASPECT, None])
def test_scenes_that_are_alike_have_the_lists_of_their_own_plans(aspect: float | None, force: tuple[str, ...]) -> None:
    """And the same spheres, effects and frame; of 120 families of 12 scenes most are said to be alike."""
    alike = every = groups = 0
    for seed in range(120):
        scene = random_scene(seed)
        try:
            found = plan(scene, aspect=aspect, force=force)
        except ValueError:
            continue
        if not is_stackable(scene, found):
            continue
        sets = parameter_sets(scene, changes(scene, seed, 12))
        stack = stacked(scene, found, sets, 12)
        weighed = weigh(found, stack, np.ones(12, dtype=bool))
        every += 12
        assert found.arrangement is not None
        for effects in np.unique(weighed.effects[weighed.alike]).tolist():
            chosen = np.flatnonzero(weighed.alike & (weighed.effects == effects))
            groups += 1
            for k, lists in zip(
                chosen.tolist(), decided_lists(decide(weighed, chosen), found.arrangement.visible), strict=True
            ):
                own = plan(sets.scene(k), aspect=aspect, force=force)
                alike += 1
                assert own.flags ^ found.flags <= set(stacks.EFFECTS)
                assert effects_of(own) == effects
                assert lists == lists_of(own)
                assert own.scene.camera.half_height == stack.half_height[k]
                assert own.arrangement is not None
                assert own.arrangement.at_eye.tolist() == found.arrangement.at_eye.tolist()
                assert own.arrangement.partners.tolist() == found.arrangement.partners.tolist()
    assert groups > 100
    assert alike > 0.6 * every > 600


def test_scenes_in_a_row_are_read_as_their_columns_are() -> None:
    for seed in range(12):
        scene = random_scene(seed)
        found = plan(scene, aspect=ASPECT, force=("scene",))
        sets = parameter_sets(scene, changes(scene, seed, 6))
        try:
            scenes = [sets.scene(k) for k in range(6)]
        except ValueError:
            continue
        read = stack_of_scenes(scene, found, scenes)
        assert read is not None
        assert read[1] == list(range(6))
        by_column = stacked(scene, found, sets, 6)
        for name in Stack.__dataclass_fields__:
            one, other = getattr(by_column, name), getattr(read[0], name)
            assert np.array_equal(one, other, equal_nan=True) if one is not None else other is None, name


OTHERS: dict[str, dict[str, Any]] = {
    "another camera": {"camera": Camera((0.0, 0.0, 7.0), half_height=1.5)},
    "a plane": {"plane": Plane((0.0, -3.0, 0.0))},
    "no shadows": {"shadows": False},
    "a light more": {"lights": (PointLight((9.0, 9.0, 9.0)), PointLight((5.0, 5.0, 9.0)))},
    "a light in parallel": {"lights": (DirectionalLight((-1.0, -1.0, -2.0)),)},
    "a mirror": {"spheres": (Sphere((-0.7, 0.0, 0.0), 0.5, Phong(reflect=0.5)), Sphere((0.7, 0.0, 0.0), 0.5))},
    "a sphere more": {"spheres": tuple(Sphere((x, 0.0, 0.0), 0.3) for x in (-0.8, 0.0, 0.8))},
}
PAIR = Scene(
    Camera((0.0, 0.0, 6.0), half_height=1.5),
    (Sphere((-0.7, 0.0, 0.0), 0.5), Sphere((0.7, 0.0, 0.25), 0.5)),
    (PointLight((9.0, 9.0, 9.0)),),
)


@pytest.mark.parametrize("case", OTHERS)
def test_a_scene_of_another_kind_is_not_stacked(case: str) -> None:
    found = planned(PAIR, aspect=1.0)
    read = stack_of_scenes(PAIR, found, [PAIR, PAIR, structs.replace(PAIR, **OTHERS[case]), PAIR])
    assert read is not None
    assert read[1] == [0, 1, 3]
    assert read[0].count == 3
    other = structs.replace(PAIR, **OTHERS[case])
    if case in ("a plane", "a mirror"):
        assert not is_stackable(other, planned(other, aspect=1.0))


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("spheres.0.radius", [0.5, -0.5, 0.0, math.nan, math.inf, 1e-20, 6.1, 0.5]),
        ("spheres.0.center.2", [0.0, math.nan, 5.9, 6.6, 1e9, 5.5, 2.0**40, 0.0]),
        ("lights.0.position.0", [9.0, math.nan, math.inf, -math.inf, 1e300, 1e200, 2.0**60, 9.0]),
        ("lights.0.intensity", [1.0, -1.0, math.nan, math.inf, 1e300, 1e200, -0.5, 1.0]),
        ("spheres.1.material.shininess", [1.0, -1.0, math.nan, math.inf, 1e300, 1e200, -0.5, 1.0]),
        ("background", [1.0, -1.0, math.nan, math.inf, 1e300, 1e200, -0.5, 1.0]),
    ],
)
def test_numbers_that_make_no_scene_or_an_extraordinary_one_are_not_alike(path: str, values: list[float]) -> None:
    found = planned(PAIR, aspect=1.0)
    stack = stacked(PAIR, found, parameter_sets(PAIR, {path: values}), 8)
    assert weigh(found, stack, np.ones(8, dtype=bool)).alike.tolist() == [True, *[False] * 6, True]


def test_a_comparison_too_close_to_call_is_left_to_the_plan() -> None:
    """Two spheres of one power: only whole numbers order them."""
    found = planned(PAIR, aspect=1.0)
    sets = parameter_sets(PAIR, {"spheres.1.center.2": [0.25, 0.0, 1e-16, -0.25]})
    stack = stacked(PAIR, found, sets, 4)
    assert weigh(found, stack, np.ones(4, dtype=bool)).alike.tolist() == [True, False, False, True]
