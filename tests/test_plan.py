"""Laws of planning: what is left out is proved exactly, tangency counts as needed, numbers are not structure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from fractions import Fraction

import pytest
from evaluators import GEOMETRIES, STRUCTURES, modest, scene_of, square_of_points
from hypothesis import given
from hypothesis import strategies as st
from strategies import centred_scenes, nasty_scenes, ordinary_scenes, scaled

from symrender_cg.errors import ArgumentError, OutsidePlanError, SceneError
from symrender_cg.plan.effects import EFFECTS, SPHERE_EFFECTS
from symrender_cg.plan.flags import scene_name
from symrender_cg.plan.plan import Plan, plan, require_format
from symrender_cg.reference import brute_force, oracle
from symrender_cg.scene import Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere

CAMERA = Camera((0.0, 0.0, 4.0), half_height=2.0)
HIDDEN = Sphere((0.0, 0.0, -5.0), 0.5)
BESIDE = Sphere((1.0, 0.0, 3.9), 0.95)


def reason(found: Plan, name: str) -> str:
    return next(decision.reason for decision in found.decisions if decision.effect.name == name)


def margin(found: Plan, name: str) -> float | None:
    return next(decision.margin for decision in found.decisions if decision.effect.name == name)


@pytest.mark.parametrize("name", STRUCTURES)
def test_a_plan_is_named_after_its_structure(name: str) -> None:
    found = plan(STRUCTURES[name])
    assert found.name == name
    assert [decision.effect for decision in found.decisions] == list(SPHERE_EFFECTS)
    assert all(decision.reason for decision in found.decisions)
    assert {decision.effect.name for decision in found.absent} == {e.name for e in SPHERE_EFFECTS} - set(found.key)
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
        ArgumentError,
        match="force: unknown effect 'caustics'; the effects are attenuation, behind_eye, checker, clip, ",
    ):
        plan(Scene.chapter1(), force=["caustics"])
    with pytest.raises(KeyError, match="caustics"):
        plan(Scene.chapter1()).needs("caustics")
    with pytest.raises(KeyError, match="caustics"):
        plan(Scene.chapter1()).findings("caustics")


@pytest.mark.parametrize("aspect", [0.0, -1.0, math.inf, math.nan])
def test_an_aspect_that_is_no_window_is_refused(aspect: float) -> None:
    with pytest.raises(
        ArgumentError, match=r"aspect: .*; expected width over height of the image, a number > 0, or No"
    ):
        plan(Scene.chapter1(), aspect=aspect)


@pytest.mark.parametrize("max_error", [-1e-9, math.inf, math.nan])
def test_a_tolerance_that_is_none_is_refused(max_error: float) -> None:
    with pytest.raises(ArgumentError, match=r"max_error: .*; expected the largest change of a pixel, a number >= 0"):
        plan(Scene.chapter1(), max_error=max_error)


# ------------------------------------------------------------------------------------------- which kernel a scene gets


MANY: dict[str, tuple[Scene, str]] = {
    "two spheres": (Scene(CAMERA, (Sphere(), Sphere((3.0, 0.0, 0.0)))), "scene"),
    "one in the other's light": (Scene(CAMERA, (Sphere(), Sphere((0.6, 0.6, 1.2), 0.25))), "scene_shadow"),
    "two that intersect": (Scene(CAMERA, (Sphere(), Sphere((1.0, 0.0, 0.0)))), "scene_cut_shadow"),
    "no shadows": (Scene(CAMERA, (Sphere(), Sphere((0.6, 0.6, 1.2), 0.25)), shadows=False), "scene"),
    "two lights": (Scene(lights=(PointLight(), PointLight((1.0, 2.0, 3.0)))), "scene"),
    "light from a direction": (Scene(lights=(DirectionalLight(),)), "scene"),
    "light that fades": (Scene(lights=(PointLight(attenuation=(1.0, 0.0, 1.0)),)), "scene_fade"),
    "on a plane": (Scene(CAMERA, plane=Plane((0.0, -2.0, 0.0))), "scene_plane_shadow"),
    "in a plane": (Scene(CAMERA, plane=Plane((0.0, -0.5, 0.0))), "scene_plane_sunk_shadow"),
    "tiles alone": (Scene(CAMERA, (), plane=Plane(checker=Phong(0.5))), "scene_void_tiles"),
    "mirror": (Scene(CAMERA, (Sphere(material=Phong(reflect=0.5)),), background=0.5), "scene_mirror"),
    "sky": (Scene(CAMERA, background=Gradient()), "scene_sky"),
    "colour": (Scene(CAMERA, (Sphere(material=Phong((0.1, 0.2, 0.3))),)), "scene_rgb"),
    "grey as a colour": (Scene(CAMERA, background=(0.5, 0.5, 0.5)), "scene"),
    "at the eye": (Scene(CAMERA, (BESIDE, Sphere((-1.0, 0.0, 3.9), 0.95)), shadows=False), "scene_close"),
    "at the eye and not": (Scene(CAMERA, (BESIDE, Sphere()), shadows=False), "scene_near"),
    "nothing": (Scene(CAMERA, (), ()), "scene_void_flat"),
}
"""Scenes that keep an arrangement."""

ONE: dict[str, tuple[Scene, str]] = {
    "one hidden": (Scene(CAMERA, (HIDDEN, Sphere())), "centred_sphere"),
    "one behind the eye": (
        Scene(CAMERA, (Sphere((0.0, 0.0, 9.0)), Sphere()), (PointLight((0.0, 0.0, 5.0)),)),
        "centred_sphere",
    ),
    "one outside the window": (Scene(CAMERA, (Sphere((9.0, 0.0, 0.0), 0.5), Sphere())), "centred_sphere"),
    "a light that is off": (Scene(CAMERA, lights=(PointLight((1.0, 2.0, 3.0), 0.0), PointLight())), "centred_sphere"),
    "a light behind a matte one": (
        Scene(CAMERA, (Sphere(material=Phong(specular=0.0)),), (PointLight((0.0, 0.0, -9.0)), PointLight())),
        "centred_sphere_matte",
    ),
    "no light": (Scene(CAMERA, lights=()), "centred_sphere_flat"),
    "a plane that is not seen": (Scene(CAMERA, plane=Plane((0.0, 0.0, 20.0), (0.0, 0.0, 1.0))), "centred_sphere"),
    "a mirror of nothing": (Scene(CAMERA, (Sphere(material=Phong(reflect=0.5)),)), "centred_sphere"),
    "a mirror without bounces": (
        Scene(CAMERA, (Sphere(material=Phong(reflect=0.5)),), background=0.5, max_bounces=0),
        "centred_sphere",
    ),
    "before a grey background": (Scene(CAMERA, (Sphere(), HIDDEN), background=0.25), "centred_sphere"),
}
"""Scenes of which one sphere and one light is left."""


@pytest.mark.parametrize("case", MANY)
def test_a_scene_has_the_kernel_of_what_its_plan_keeps(case: str) -> None:
    scene, name = MANY[case]
    found = plan(scene, aspect=1.0)
    assert found.arrangement is not None
    assert found.name == name
    assert found.key == ("scene", *sorted(found.flags))
    assert found.scene == found.given == scene.in_camera_frame()
    assert [decision.effect for decision in found.decisions] == list(EFFECTS)
    assert all(decision.reason for decision in found.decisions)


@pytest.mark.parametrize("case", ONE)
def test_a_scene_of_which_one_sphere_is_left_has_its_kernel(case: str) -> None:
    scene, name = ONE[case]
    found = plan(scene, aspect=1.0)
    assert found.arrangement is None
    assert (found.name, len(found.scene.spheres), len(found.scene.lights)) == (name, 1, 1)
    assert [decision.effect for decision in found.decisions] == list(SPHERE_EFFECTS)
    assert [decision.effect for decision in found.summary] == list(EFFECTS)
    assert plan(found.scene).key == found.key
    x, y = square_of_points(scene, 24)
    left, whole = brute_force.trace(found.scene, x, y), brute_force.trace(scene, x, y)
    assert (left.value == whole.value).all()


@pytest.mark.parametrize("case", ONE)
def test_any_scene_can_have_the_kernel_of_scenes(case: str) -> None:
    found = plan(ONE[case][0], force=["scene"])
    assert found.arrangement is not None
    assert found.name.startswith("scene")


def test_names_of_scene_kernels_are_short_identifiers_one_for_each_structure() -> None:
    names: dict[str, frozenset[str]] = {}
    free = ("spans", "at_eye", "intersections", "attenuation", "shadows", "mirrors", "gradient", "colour")
    both = ("diffuse", "specular")
    lit = ((), ("diffuse",), ("specular",), both, ("specular", "specular_gate"), (*both, "specular_gate"))
    ground = ((), ("plane",), ("plane", "checker"), ("plane", "crossing"), ("plane", "checker", "crossing"))
    for size in range(len(free) + 1):
        for some, light, plane_flags in itertools.product(itertools.combinations(free, size), lit, ground):
            flags = frozenset((*some, *light, *plane_flags))
            name = scene_name(flags)
            assert len(name) <= 60
            assert name.isidentifier()
            assert names.setdefault(name, flags) == flags


def test_numbers_of_a_scene_are_not_structure() -> None:
    scene = MANY["on a plane"][0]
    moved = Scene(scene.camera, (Sphere((0.5, 0.1, -1.0), 0.7),), (PointLight((3.0, 4.0, 5.0), 0.5),), 0.9, scene.plane)
    assert plan(scene, aspect=1.0).key == plan(moved, aspect=1.5).key


def test_a_format_too_narrow_for_one_of_the_spheres_seen_is_refused() -> None:
    near = Scene(CAMERA, (Sphere(), Sphere((0.001, 0.0, 4.0), 2.0**-16)))
    found = plan(near)
    require_format(found, "float64")
    with pytest.raises(OutsidePlanError, match=r"spheres\[1\].radius: .* float32 reaches 3.28e\+04: use 'double'"):
        require_format(found, "float32")


def test_a_plan_is_a_frozen_value() -> None:
    found = plan(Scene.chapter1())
    assert found == plan(Scene.chapter1())
    assert hash(found) == hash(plan(Scene.chapter1()))
    with pytest.raises(FrozenInstanceError):
        found.scene = Scene()  # type: ignore[misc]


OUTSIDE: dict[str, tuple[Callable[[], Scene], str]] = {
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
    "one of several too far apart": (
        lambda: Scene(CAMERA, (Sphere(), Sphere((1.0, 0.0, 3.0), 2.0**-60))),
        r"spheres\[1\].radius: .* times smaller than the distance to the eye or the offset of the centre",
    ),
    "one of several out of all proportion": (
        lambda: Scene(CAMERA, (Sphere(), Sphere((1.0, 0.0, 2.0**210)))),
        r"spheres\[1\].center: .* is more than 2\^200 times longer or shorter than the eye's distance",
    ),
    "a speck that nobody sees": (
        lambda: Scene(CAMERA, (Sphere(), Sphere((1.0, 0.0, 9.0), 2.0**-210))),
        r"spheres\[1\].radius: .* is more than 2\^200 times longer or shorter than the eye's .*; leave the sphere out",
    ),
    "one of several lights out of all proportion": (
        lambda: Scene(CAMERA, lights=(PointLight(), PointLight((0.0, 2.0**210, 0.0)))),
        r"lights\[1\].position: .* a DirectionalLight is what it looks like",
    ),
    "a plane out of all proportion": (
        lambda: Scene(CAMERA, plane=Plane((0.0, -(2.0**210), 0.0))),
        r"plane.point: .* give a point of the plane that is nearer",
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
