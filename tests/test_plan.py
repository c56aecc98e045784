"""Laws of planning: what is left out is proved exactly, tangency counts as needed, numbers are not structure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError
from fractions import Fraction

import pytest
from evaluators import GEOMETRIES, STRUCTURES, modest, scene_of, square_of_points
from hypothesis import given
from hypothesis import strategies as st
from strategies import centred_scenes, nasty_scenes, ordinary_scenes, scaled

from symrender_cg.errors import ArgumentError, OutsidePlanError, SceneError
from symrender_cg.plan.effects import EFFECTS
from symrender_cg.plan.plan import Plan, plan
from symrender_cg.reference import oracle
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere


def reason(found: Plan, name: str) -> str:
    return next(decision.reason for decision in found.decisions if decision.effect.name == name)


def margin(found: Plan, name: str) -> float | None:
    return next(decision.margin for decision in found.decisions if decision.effect.name == name)


@pytest.mark.parametrize("name", STRUCTURES)
def test_a_plan_is_named_after_its_structure(name: str) -> None:
    found = plan(STRUCTURES[name])
    assert found.name == name
    assert [decision.effect for decision in found.decisions] == list(EFFECTS)
    assert all(decision.reason for decision in found.decisions)
    assert {decision.effect.name for decision in found.absent} == {e.name for e in EFFECTS} - set(found.key)
    assert {decision.status for decision in found.absent} == {"absent"}


def test_different_structures_have_different_keys_and_names() -> None:
    plans = [plan(scene) for scene in STRUCTURES.values()]
    assert len({found.key for found in plans}) == len({found.name for found in plans}) == len(STRUCTURES)


@modest(60)
@given(st.one_of(centred_scenes(), ordinary_scenes()), st.integers(-300, 300), st.data())
def test_numbers_are_not_structure(scene: Scene, k: int, data: st.DataObject) -> None:
    """Another unit, light, shininess, ambient, background: the same key, so the same kernel."""
    material, sphere = scene.spheres[0].material, scene.spheres[0]
    another = Phong(0.9, material.diffuse, material.specular, data.draw(st.floats(0.0, 1e6)), material.gate_specular)
    lights = tuple(PointLight((3.0, 4.0, 5.0), light.intensity) for light in scene.lights)
    changed = Scene(scene.camera, (Sphere(sphere.center, sphere.radius, another),), lights, 0.5)
    assert plan(scene).key == plan(changed).key
    assert plan(scene.in_camera_frame()).key == plan(scaled(scene.in_camera_frame(), k)).key


@pytest.mark.parametrize(("center_z", "needed"), [(0.0, True), (5e-324, True), (-5e-324, False), (-(2.0**-60), False)])
def test_a_sphere_that_touches_the_plane_of_the_eye_is_tested(center_z: float, needed: bool) -> None:
    """Depth of the centre = radius is tangency, which counts as needed; any less than that is a proof."""
    scene = Scene(Camera((0.0, 0.0, 1.0), half_height=6.0), (Sphere((2.0, 0.0, center_z), 1.0),))
    assert plan(scene).needs("front_test") is needed


def test_the_margin_is_the_slack_of_the_inequality_in_the_reason() -> None:
    found = plan(Scene.chapter1())
    assert margin(found, "front_test") == 3.0
    assert reason(found, "front_test").startswith("the sphere lies wholly before the eye: depth of")
    assert "4 >" in reason(found, "front_test")


@modest(100)
@given(nasty_scenes())
def test_the_front_test_is_left_out_only_where_the_whole_sphere_lies_before_the_eye(scene: Scene) -> None:
    try:
        found = plan(scene)
    except OutsidePlanError:
        return
    frame = scene.in_camera_frame()
    sphere = frame.spheres[0]
    before = Fraction(frame.camera.eye[2]) - Fraction(sphere.center[2]) > Fraction(sphere.radius)
    assert found.needs("front_test") is not before
    assert found.needs("off_axis") == (sphere.center != (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("diffuse", "specular", "intensity", "gate", "needed"),
    [
        (0.7, 0.5, 1.0, False, {"diffuse", "specular"}),
        (0.0, 0.5, 1.0, False, {"specular"}),
        (0.7, 0.0, 1.0, False, {"diffuse"}),
        (5e-324, 5e-324, 5e-324, False, {"diffuse", "specular"}),
        (0.7, 0.5, 0.0, True, set()),
        (0.7, 0.0, 1.0, True, {"diffuse"}),
        (0.7, 0.5, 1.0, True, {"diffuse", "specular", "specular_gate"}),
    ],
)
def test_a_term_is_left_out_only_where_its_factor_is_exactly_0(
    diffuse: float, specular: float, intensity: float, gate: bool, needed: set[str]
) -> None:
    sphere = Sphere(material=Phong(0.1, diffuse, specular, 32.0, gate_specular=gate))
    assert set(plan(Scene(spheres=(sphere,), lights=(PointLight(intensity=intensity),))).key) == needed


def test_effects_can_be_forced_in_and_say_so() -> None:
    found = plan(Scene.chapter1(), force=["off_axis", "front_test", "specular_gate"])
    assert {"off_axis", "front_test", "specular_gate"} <= set(found.key)
    assert reason(found, "off_axis").startswith("forced in; left out otherwise, for the centre is the point looked at")
    assert "forced" not in reason(found, "diffuse")


def test_a_fact_of_the_geometry_cannot_be_forced_in() -> None:
    assert not plan(Scene.chapter1(), force=["self_shadow"]).needs("self_shadow")


def test_an_unknown_effect_is_refused_with_the_known_ones() -> None:
    with pytest.raises(
        ArgumentError, match="force: unknown effect 'shadow'; the effects are diffuse, front_test, off_a"
    ):
        plan(Scene.chapter1(), force=["shadow"])
    with pytest.raises(KeyError, match="shadow"):
        plan(Scene.chapter1()).needs("shadow")


def test_a_plan_is_a_frozen_value() -> None:
    found = plan(Scene.chapter1())
    assert found == plan(Scene.chapter1())
    assert hash(found) == hash(plan(Scene.chapter1()))
    with pytest.raises(FrozenInstanceError):
        found.decisions = ()  # type: ignore[misc]


OUTSIDE: dict[str, tuple[Callable[[], Scene], str]] = {
    "two spheres": (
        lambda: Scene(spheres=(Sphere(), Sphere((3.0, 0.0, 0.0)))),
        "scene: 2 spheres and 1 lights; kernels are derived for one sphere and one light",
    ),
    "no light": (lambda: Scene(lights=()), "scene: 1 spheres and 0 lights"),
    "two lights": (lambda: Scene(lights=(PointLight(), PointLight())), "scene: 1 spheres and 2 lights"),
    "too long": (
        lambda: scaled(Scene(Camera(half_height=1.0)), 999),
        r"camera.eye: .* is longer than 2\^1000; give the scene in another unit of length",
    ),
    "too short": (
        lambda: scaled(Scene(Camera(half_height=1.0)), -901),
        r"spheres\[0\].radius: .* is below 2\^-900 in the camera's frame; give the scene in another unit of length",
    ),
    "too far apart": (
        lambda: Scene(Camera((0.0, 0.0, 2.0**70), half_height=2.0**69), (Sphere(radius=2.0**-140),)),
        r"spheres\[0\].radius: .* times smaller than the distance to the eye or the offset of the centre",
    ),
}


@pytest.mark.parametrize("case", OUTSIDE)
def test_a_scene_that_no_plan_covers_is_refused_before_anything_is_derived(case: str) -> None:
    make, message = OUTSIDE[case]
    with pytest.raises(OutsidePlanError, match=message) as caught:
        plan(make())
    assert caught.value.exit_code == 3


def test_a_scene_without_an_image_never_gets_so_far() -> None:
    with pytest.raises(SceneError, match=r"camera\.eye"):
        plan(Scene(Camera((0.0, 0.0, 0.5))))


@pytest.mark.parametrize("name", GEOMETRIES)
def test_the_scenes_of_these_tests_are_what_they_are_called_and_are_seen(name: str) -> None:
    scene = scene_of(name)
    assert plan(scene).name == name
    answers = oracle.evaluate(scene, *square_of_points(scene, 32))
    assert 0.1 < answers.hit.mean() < 0.9
    assert (answers.value > 0.3).sum() > 0.3 * answers.hit.sum()
