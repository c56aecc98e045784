"""Laws of the scene model: what is accepted and turned into plain floats, what is refused, and with which words."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scene_strategies import scaled as scaled_with_all_parts
from scene_strategies import scenes
from strategies import centred_scenes, nasty_scenes, ordinary_scenes, points, scaled

import symrender_cg
from symrender_cg.errors import SceneError, SymrenderError
from symrender_cg.scene import (
    Camera,
    Colour,
    DirectionalLight,
    Gradient,
    Phong,
    Plane,
    PointLight,
    Scene,
    Sphere,
    Vector,
)
from symrender_cg.scene import model as scene_model
from symrender_cg.scene.exact import are_parallel, excess_over_sphere, first_not_outside, side_of_plane

NAN, INF = math.nan, math.inf


def refused(make: Callable[[], object]) -> SceneError:
    with pytest.raises(SceneError) as caught:
        make()
    return caught.value


def test_default_scene_is_chapter_1_field_by_field() -> None:
    scene = Scene.chapter1()
    assert scene == Scene()
    assert scene.camera == Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), None)
    assert scene.spheres == (Sphere((0, 0, 0), 1.0, Phong(0.1, 0.7, 0.5, 32.0, False)),)
    assert scene.lights == (PointLight((5, 5, 10), 1.0),)
    assert scene.background == 0.0
    assert (scene.plane, scene.shadows, scene.max_bounces, scene.channels) == (None, True, 4, 1)


def test_defaults_are_those_that_the_document_states() -> None:
    assert Phong() == Phong(0.1, 0.7, 0.5, 32.0, False, 0.0)
    assert PointLight() == PointLight((5, 5, 10), 1.0, (1, 0, 0))
    assert DirectionalLight() == DirectionalLight((-5, -5, -10), 1.0)
    assert Plane() == Plane((0, -1, 0), (0, 1, 0), Phong(), None, 1.0, (1, 0, 0))
    assert Gradient() == Gradient(0.0, 1.0, (0, 1, 0))


def test_every_class_of_a_scene_is_a_public_name_of_the_package() -> None:
    for name in ("Camera", "DirectionalLight", "Gradient", "Phong", "Plane", "PointLight", "Scene", "Sphere"):
        assert getattr(symrender_cg, name) is getattr(scene_model, name)


def test_chapter_1_arguments_reach_their_fields() -> None:
    scene = Scene.chapter1(2.0, 5.0, (1, 2, 3), 0.2, 0.3, 0.4, 7.0)
    assert scene.camera.eye == (0.0, 0.0, 5.0)
    assert scene.spheres[0] == Sphere((0, 0, 0), 2.0, Phong(0.2, 0.3, 0.4, 7.0))
    assert scene.lights == (PointLight((1.0, 2.0, 3.0)),)


def test_numbers_of_every_kind_become_plain_floats_and_tuples() -> None:
    vectors: Any = ([0, 0, 4], np.zeros(3), np.array([0, 1, 0]), np.array([0.5, 0, 0], dtype=np.float32))
    mixed: Any = (np.float32(5), 5, np.array(10.0))
    numbers_in: Any = (np.float32(1.5), np.int64(1), np.float64(0.25), np.float32(0.5))
    material = Phong(numbers_in[2], shininess=8)
    spheres: Any = [Sphere(vectors[3], numbers_in[1], material)]
    lights: Any = [PointLight(mixed)]
    scene: Any = Scene(Camera(vectors[0], vectors[1], vectors[2], numbers_in[0]), spheres, lights, numbers_in[3])
    numbers = [
        *scene.camera.eye,
        *scene.camera.look_at,
        *scene.camera.up,
        scene.camera.half_height,
        *scene.spheres[0].center,
        scene.spheres[0].radius,
        scene.spheres[0].material.ambient,
        scene.spheres[0].material.shininess,
        *scene.lights[0].position,
        scene.background,
    ]
    assert {type(number) for number in numbers} == {float}
    assert type(scene.spheres) is tuple
    assert type(scene.lights) is tuple
    assert type(scene.camera.eye) is tuple
    assert type(Phong(gate_specular=np.bool_(True)).gate_specular) is bool  # type: ignore[arg-type]
    assert scene.spheres[0].center == (0.5, 0.0, 0.0)


def test_colours_switches_and_counts_of_every_kind_become_plain_values() -> None:
    colours: Any = ([1, 0, 0.5], np.array([0.25, 0, 1], dtype=np.float32), np.float32(0.5), np.array(1), (1, 1, 1))
    material = Phong(colours[0], colours[1], colours[2], reflect=np.float64(1))
    assert (material.ambient, material.diffuse, material.specular) == ((1.0, 0.0, 0.5), (0.25, 0.0, 1.0), 0.5)
    light: Any = PointLight(intensity=colours[3], attenuation=np.array([0, -0.0, 2]))  # type: ignore[arg-type]
    assert repr(light.attenuation) == "(0.0, 0.0, 2.0)"
    scene: Any = Scene(background=colours[4], shadows=np.bool_(False), max_bounces=np.int64(3))  # type: ignore[arg-type]
    assert scene.background == (1.0, 1.0, 1.0)
    plain = [*material.ambient, *material.diffuse, material.specular, light.intensity, *scene.background]  # type: ignore[misc]
    assert {type(number) for number in plain} == {float}
    assert (type(scene.shadows), type(scene.max_bounces)) == (bool, int)
    assert type(material.ambient) is type(material.diffuse) is type(scene.background) is tuple


def test_three_equal_numbers_are_a_colour_of_their_own_and_not_the_grey() -> None:
    grey, rgb = Scene(background=0.5), Scene(background=(0.5, 0.5, 0.5))
    assert grey != rgb
    assert (grey.channels, rgb.channels) == (1, 3)


@pytest.mark.parametrize(
    "scene",
    [
        Scene(spheres=(Sphere(), Sphere((3, 0, 0), 1, Phong(ambient=(0, 0, 0))))),
        Scene(spheres=(Sphere(material=Phong(diffuse=(1, 1, 1))),)),
        Scene(spheres=(Sphere(material=Phong(specular=(1, 0, 0))),)),
        Scene(lights=(PointLight(), PointLight(intensity=(1, 1, 1)))),
        Scene(lights=(DirectionalLight(intensity=(1, 0.5, 1)),)),
        Scene(background=(0, 0, 0)),
        Scene(background=Gradient(bottom=(0, 0, 0))),
        Scene(background=Gradient(top=(0, 0, 1))),
        Scene(plane=Plane(material=Phong((1, 0, 0)))),
        Scene(plane=Plane(checker=Phong((1, 0, 0)))),
    ],
)
def test_one_colour_anywhere_makes_three_channels(scene: Scene) -> None:
    assert scene.channels == 3
    assert scene.in_camera_frame().channels == 3


@given(scenes())
def test_channels_are_three_exactly_when_a_colour_is_written_as_three_numbers(scene: Scene) -> None:
    def grey(colour: Colour) -> float:
        return colour[0] if isinstance(colour, tuple) else colour

    def plain(m: Phong) -> Phong:
        return Phong(grey(m.ambient), grey(m.diffuse), grey(m.specular), m.shininess, m.gate_specular, m.reflect)

    replace, background, plane = msgspec.structs.replace, scene.background, scene.plane
    if isinstance(background, Gradient):
        background = Gradient(grey(background.bottom), grey(background.top), background.up)
    else:
        background = grey(background)
    if plane is not None:
        checker = None if plane.checker is None else plain(plane.checker)
        plane = replace(plane, material=plain(plane.material), checker=checker)
    greys = replace(
        scene,
        spheres=tuple(replace(s, material=plain(s.material)) for s in scene.spheres),
        lights=tuple(replace(light, intensity=grey(light.intensity)) for light in scene.lights),
        background=background,
        plane=plane,
    )
    assert greys.channels == 1
    assert scene.channels == (1 if greys == scene else 3)


def test_equal_scenes_have_equal_hashes_and_the_same_bits() -> None:
    one = Scene(Camera((0, 0, 4)), (Sphere((-0.0, 0, 0), 1),), (PointLight((5, -0.0, 10)),), -0.0)
    two = Scene(Camera((0.0, 0.0, 4.0)), (Sphere(),), (PointLight((5.0, 0.0, 10.0)),), 0.0)
    assert one == two
    assert hash(one) == hash(two)
    assert repr(one) == repr(two)
    assert len({one, two, Scene()}) == 2
    assert repr(Sphere((-0.0, -1.0, -0.0)).center) == "(0.0, -1.0, 0.0)"


@given(st.one_of(ordinary_scenes(), nasty_scenes(), scenes()))
def test_pickle_and_deepcopy_give_an_equal_scene(scene: Scene) -> None:
    assert pickle.loads(pickle.dumps(scene)) == scene
    assert copy.deepcopy(scene) == scene
    assert hash(pickle.loads(pickle.dumps(scene))) == hash(copy.deepcopy(scene)) == hash(scene)


def test_scenes_are_frozen_and_replaced_values_are_checked() -> None:
    scene = Scene()
    with pytest.raises(AttributeError):
        scene.background = 1.0  # type: ignore[misc]
    with pytest.raises(AttributeError):
        scene.spheres[0].extra = 1  # type: ignore[attr-defined]
    assert msgspec.structs.replace(scene, background=1).background == 1.0
    assert refused(lambda: msgspec.structs.replace(scene, background=-1)).place == "background"
    assert hash(scene) != hash(msgspec.structs.replace(scene, background=1))


def test_no_or_several_spheres_and_lights_can_be_described() -> None:
    scene = Scene(spheres=(Sphere(), Sphere((2.5, 0, 0))), lights=())
    assert len(scene.spheres) == 2
    assert scene.lights == ()
    assert Scene(spheres=()).spheres == ()
    assert Scene(lights=[DirectionalLight(), PointLight()]).lights == (DirectionalLight(), PointLight())  # type: ignore[arg-type]


def test_light_inside_a_sphere_is_allowed() -> None:
    assert Scene.chapter1(light=(0, 0, 0)).lights == (PointLight((0.0, 0.0, 0.0)),)
    assert Scene.chapter1(light=(0, 0, 1)).lights == (PointLight((0.0, 0.0, 1.0)),)


REFUSED_VALUES: list[tuple[Callable[[], object], str, tuple[str, ...]]] = [
    (lambda: Sphere(radius="a"), "radius", ("'a' of type str", "number > 0", "without quotes")),  # type: ignore[arg-type]
    (lambda: Sphere(radius=None), "radius", ("None", "is not a number")),  # type: ignore[arg-type]
    (lambda: Sphere(radius=True), "radius", ("True of type bool", "is not a number")),
    (lambda: Sphere(radius=1j), "radius", ("1j of type complex",)),  # type: ignore[arg-type]
    (lambda: Sphere(radius=0), "radius", ("0.0 is not positive", "number > 0", "leave the sphere out")),
    (lambda: Sphere(radius=-0.0), "radius", ("0.0 is not positive",)),
    (lambda: Sphere(radius=-1), "radius", ("-1.0 is not positive", "number > 0", "leave the sphere out")),
    (lambda: Sphere(radius=NAN), "radius", ("nan is not a number", "a radius", "0/0")),
    (lambda: Sphere(radius=INF), "radius", ("inf is not finite", "1.7976931348623157e308")),
    (lambda: Sphere(radius=10**400), "radius", ("is not finite in float64",)),
    (lambda: Sphere(radius=np.array([1.0])), "radius", ("is not a number",)),  # type: ignore[arg-type]
    (lambda: Sphere(center=(0, 0)), "center", ("has 2 entries", "exactly three")),  # type: ignore[arg-type]
    (lambda: Sphere(center=(0, 0, 0, 0)), "center", ("has 4 entries",)),  # type: ignore[arg-type]
    (lambda: Sphere(center=3.0), "center", ("3.0 of type float", "is not a vector")),  # type: ignore[arg-type]
    (lambda: Sphere(center="xyz"), "center", ("is not a vector",)),  # type: ignore[arg-type]
    (lambda: Sphere(center={1, 2, 3}), "center", ("is not a vector",)),  # type: ignore[arg-type]
    (lambda: Sphere(center=(0, "b", 0)), "center[1]", ("'b' of type str",)),  # type: ignore[arg-type]
    (lambda: Sphere(center=(0, 0, NAN)), "center[2]", ("nan", "centre of a sphere")),
    (lambda: Sphere(center=np.eye(3)), "center[0]", ("is not a number",)),  # type: ignore[arg-type]
    (lambda: Sphere(material={}), "material", ("{} of type dict", "write Phong(")),  # type: ignore[arg-type]
    (lambda: Phong(ambient=-0.1), "ambient", ("-0.1 is negative", "number >= 0", "write 0")),
    (lambda: Phong(diffuse=-1e-300), "diffuse", ("-1e-300 is negative",)),
    (lambda: Phong(specular=-2), "specular", ("-2.0 is negative",)),
    (lambda: Phong(shininess=-1), "shininess", ("-1.0 is negative", "a shininess")),
    (lambda: Phong(shininess=INF), "shininess", ("inf is not finite",)),
    (lambda: Phong(ambient=NAN), "ambient", ("nan",)),
    (lambda: Phong(gate_specular=1), "gate_specular", ("1 of type int", "true or false")),  # type: ignore[arg-type]
    (lambda: Phong("red"), "ambient", ("'red' of type str is not a colour", "(0.9, 0.5, 0.1)")),  # type: ignore[arg-type]
    (lambda: Phong(ambient=None), "ambient", ("None", "is not a colour")),  # type: ignore[arg-type]
    (lambda: Phong(ambient=True), "ambient", ("True of type bool", "is not a number")),
    (lambda: Phong((0.1, -0.2, 0)), "ambient[1]", ("-0.2 is negative", "the green of the ambient")),
    (lambda: Phong(diffuse=(0.1, 0.2, NAN)), "diffuse[2]", ("nan", "the blue of the diffuse")),
    (lambda: Phong(specular=(INF, 0.2, 1)), "specular[0]", ("inf is not finite", "the red of the specular")),
    (lambda: Phong(specular=(1, "x", 1)), "specular[1]", ("'x' of type str",)),  # type: ignore[arg-type]
    (lambda: Phong(ambient=(1, 2)), "ambient", ("has 2 entries", "(red, green, blue)")),  # type: ignore[arg-type]
    (lambda: Phong(ambient=np.eye(3)), "ambient[0]", ("is not a number",)),  # type: ignore[arg-type]
    (lambda: Phong(reflect=-0.25), "reflect", ("-0.25 is not from 0 to 1", "no mirror")),
    (lambda: Phong(reflect=1.0000000000000002), "reflect", ("1.0000000000000002 is not from 0 to 1",)),
    (lambda: Phong(reflect=(1, 1, 1)), "reflect", ("is not a number", "from 0 to 1")),  # type: ignore[arg-type]
    (lambda: Phong(reflect=NAN), "reflect", ("nan",)),
    (lambda: PointLight(intensity=(1, 1, -1)), "intensity[2]", ("-1.0 is negative", "the blue of an intensity")),
    (lambda: PointLight(attenuation=(0, 0, 0)), "attenuation", ("divides the intensity by 0", "write (1, 0, 0)")),
    (lambda: PointLight(attenuation=(1, -1, 0)), "attenuation[1]", ("-1.0 is negative", "leave that power")),
    (lambda: PointLight(attenuation=(1, 0)), "attenuation", ("has 2 entries", "a + b l + c l^2")),  # type: ignore[arg-type]
    (lambda: PointLight(attenuation=1.0), "attenuation", ("is not a vector",)),  # type: ignore[arg-type]
    (lambda: PointLight(attenuation=(1, 0, INF)), "attenuation[2]", ("inf",)),
    (lambda: DirectionalLight((0, -0.0, 0)), "direction", ("has no direction", "(0, -1, 0)")),
    (lambda: DirectionalLight((0, NAN, 1)), "direction[1]", ("nan", "the way the light travels")),
    (lambda: DirectionalLight(intensity=-2), "intensity", ("-2.0 is negative", "switch the light off")),
    (lambda: Plane(point=(0, 0)), "point", ("has 2 entries", "a point of the plane")),  # type: ignore[arg-type]
    (lambda: Plane(normal=(0, 0, 0)), "normal", ("has no direction", "floor")),
    (lambda: Plane(normal=(0, INF, 0)), "normal[1]", ("inf",)),
    (lambda: Plane(tile=0), "tile", ("0.0 is not positive", "leave checker out")),
    (lambda: Plane(axis=(0, 0, 0)), "axis", ("has no direction", "(1, 0, 0)")),
    (lambda: Plane(axis=(0, -3, 0)), "axis", ("(0.0, -3.0, 0.0) is parallel to the normal", "leans away")),
    (lambda: Plane(material=None), "material", ("None", "write Phong(")),  # type: ignore[arg-type]
    (lambda: Plane(checker=1), "checker", ("1 of type int", "or None")),  # type: ignore[arg-type]
    (lambda: Gradient(bottom=-1), "bottom", ("-1.0 is negative", "write 0 for black")),
    (lambda: Gradient(top=(1, 1, NAN)), "top[2]", ("nan", "the blue of the top")),
    (lambda: Gradient(up=(0, 0, 0)), "up", ("has no direction",)),
    (lambda: PointLight((0, INF, 0)), "position[1]", ("inf", "position of a light")),
    (lambda: PointLight((0, -INF, 0)), "position[1]", ("-inf",)),
    (lambda: PointLight(intensity=-1), "intensity", ("-1.0 is negative", "switch the light off")),
    (lambda: PointLight(intensity=NAN), "intensity", ("nan",)),
    (lambda: Camera(eye=(NAN, 0, 4)), "eye[0]", ("nan",)),
    (lambda: Camera(look_at=(0, INF, 0)), "look_at[1]", ("inf",)),
    (lambda: Camera(up=(0, NAN, 0)), "up[1]", ("nan",)),
    (lambda: Camera((1, 2, 3), (1, 2, 3)), "eye", ("(1.0, 2.0, 3.0) is also look_at", "direction of view")),
    (lambda: Camera(up=(0, 0, 0)), "up", ("has no direction", "(0, 1, 0)")),
    (lambda: Camera(up=(0, 0, -2)), "up", ("(0.0, 0.0, -2.0) is parallel to the view", "leans away")),
    (lambda: Camera(half_height=0), "half_height", ("0.0 is not positive", "leave it out")),
    (lambda: Camera(half_height=-1), "half_height", ("-1.0 is not positive",)),
    (lambda: Camera(half_height=NAN), "half_height", ("nan",)),
    (lambda: Scene(background=NAN), "background", ("nan",)),
    (lambda: Scene(background=-0.5), "background", ("-0.5 is negative", "write 0 for black")),
    (lambda: Scene(camera=None), "camera", ("None", "write Camera(")),  # type: ignore[arg-type]
    (lambda: Scene(spheres=Sphere()), "spheres", ("is not a tuple", "write (Sphere(")),  # type: ignore[arg-type]
    (lambda: Scene(spheres=(Sphere(), 1)), "spheres[1]", ("1 of type int", "Sphere")),  # type: ignore[arg-type]
    (lambda: Scene(lights=(Sphere(),)), "lights[0]", ("is not a PointLight or a DirectionalLight",)),  # type: ignore[arg-type]
    (lambda: Scene(background="black"), "background", ("'black' of type str is not a colour",)),  # type: ignore[arg-type]
    (lambda: Scene(background=(0, -1, 0)), "background[1]", ("-1.0 is negative",)),
    (lambda: Scene(plane=Sphere()), "plane", ("is not a Plane", "or None")),  # type: ignore[arg-type]
    (lambda: Scene(shadows=0), "shadows", ("0 of type int", "true or false")),  # type: ignore[arg-type]
    (lambda: Scene(max_bounces=17), "max_bounces", ("17 is out of range", "from 0 to 16")),
    (lambda: Scene(max_bounces=-1), "max_bounces", ("-1 is out of range",)),
    (lambda: Scene(max_bounces=4.0), "max_bounces", ("4.0 of type float", "whole number")),  # type: ignore[arg-type]
    (lambda: Scene(max_bounces=True), "max_bounces", ("True of type bool", "whole number")),
    (lambda: Scene(plane=Plane((1, 2, 4), (0, 0, 1))), "camera.eye", ("is on the plane", "on one side")),
    (
        lambda: Scene(spheres=(Sphere(material=Phong(1e308, reflect=1.0)),)),
        "max_bounces",
        ("4 bounces", "more than float64", "lower reflect"),
    ),
    (lambda: Scene.chapter1(radius=-1), "radius", ("-1.0 is not positive",)),
    (lambda: Scene.chapter1(eye="far"), "eye", ("'far' of type str",)),  # type: ignore[arg-type]
    (lambda: Scene.chapter1(eye=0.5), "camera.eye", ("(0.0, 0.0, 0.5) is inside spheres[0]", "move the eye")),
    (lambda: Scene.chapter1(eye=1), "camera.eye", ("(0.0, 0.0, 1.0) is on spheres[0]", "outside every sphere")),
    (lambda: Scene.chapter1(eye=0), "eye", ("is also look_at",)),
    (lambda: Scene.chapter1(diffuse=1e308, specular=1e308), "spheres[0].material", ("beyond float64", "lower")),
]


@pytest.mark.parametrize(("make", "place", "words"), REFUSED_VALUES, ids=[str(i) for i in range(len(REFUSED_VALUES))])
def test_refused_value_is_named_with_its_place_and_a_way_out(
    make: Callable[[], object], place: str, words: tuple[str, ...]
) -> None:
    error = refused(make)
    assert error.place == place
    assert str(error).startswith(f"{place}: ")
    assert [word for word in words if word not in str(error)] == []
    assert "expected" in error.problem


def test_no_two_kinds_of_refusal_share_their_text() -> None:
    problems = [refused(make).problem for make, _, _ in REFUSED_VALUES]
    same = {p for p in problems if problems.count(p) > 1}
    assert same <= {refused(lambda: Sphere(radius=0)).problem, refused(lambda: Sphere(radius=-1)).problem}


def test_scene_errors_are_value_errors_with_exit_code_2_that_pickle() -> None:
    error = refused(lambda: Sphere(radius=0))
    assert isinstance(error, SymrenderError)
    assert isinstance(error, ValueError)
    assert error.exit_code == 2
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


EYE_TOUCHES: list[tuple[dict[str, Any], bool]] = [
    ({"eye": math.nextafter(1.0, 2.0)}, True),
    ({"eye": math.nextafter(1.0, 0.0)}, False),
    ({"radius": 1e300, "eye": math.nextafter(1e300, INF)}, True),
    ({"radius": 1e300, "eye": 1e300}, False),
    ({"radius": 5e-324, "eye": 1e-323}, True),
    ({"radius": 5e-324, "eye": 5e-324}, False),
    ({"radius": 1e-200, "eye": -1e-200}, False),
    ({"radius": 1e-200, "eye": -1.0000000000000002e-200}, True),
]


@pytest.mark.parametrize(("arguments", "allowed"), EYE_TOUCHES)
def test_eye_on_the_sphere_is_told_from_eye_one_ulp_outside(arguments: dict[str, Any], allowed: bool) -> None:
    if allowed:
        assert Scene.chapter1(**arguments).camera.eye[2] == arguments["eye"]
    else:
        assert refused(lambda: Scene.chapter1(**arguments)).place == "camera.eye"


def test_eye_test_is_exact_off_the_axes() -> None:
    """2^2 + 3^2 + 6^2 = 7^2: the eye is on the sphere exactly, and in floating point at many scales by luck only."""
    for k in (-500, -1, 0, 1, 500):
        eye, radius = (math.ldexp(2.0, k), math.ldexp(3.0, k), math.ldexp(6.0, k)), math.ldexp(7.0, k)
        for r, allowed in ((radius, False), (math.nextafter(radius, 0.0), True), (math.nextafter(radius, INF), False)):
            try:
                Scene(Camera(eye), (Sphere((0, 0, 0), r),))
            except SceneError as error:
                assert not allowed, (k, r)
                assert ("is on" if r == radius else "is inside") in error.problem  # noqa: PT017
            else:
                assert allowed, (k, r)


def test_up_a_hair_from_the_view_is_accepted_and_exactly_parallel_is_not() -> None:
    eye, look_at = (0.1, 0.2, 0.3), (0.0, 0.0, 0.0)
    assert Camera(eye, look_at, (0.1, 0.2, math.nextafter(0.3, 1.0))).up[2] > 0.3
    assert refused(lambda: Camera(eye, look_at, (-0.2, -0.4, -0.6))).place == "up"
    assert Camera((1e300, 1e300, 0), (0, 0, 0), (1e-300, 1.0000000000000002e-300, 0)).up[0] == 1e-300


@given(st.one_of(centred_scenes(), ordinary_scenes()), st.integers(-450, 450))
def test_validity_does_not_depend_on_the_unit_of_length(scene: Scene, k: int) -> None:
    assert scaled(scaled(scene, k), -k) == scene


def test_importing_the_scene_loads_neither_sympy_nor_numpy_nor_rich() -> None:
    code = (
        "import sys, symrender_cg.scene as s; s.load_scene(None).in_camera_frame(); "
        "print([m for m in ('sympy', 'numpy', 'rich', 'tomllib', 'tomli_w', 'difflib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


BRIGHT_BUT_FINITE: list[Callable[[], Scene]] = [
    lambda: Scene.chapter1(diffuse=1e308, specular=0.0),
    lambda: Scene(spheres=(Sphere(material=Phong((1e308, 0, 0), (0, 1e308, 0), (0, 0, 1e308))),)),
    lambda: Scene(spheres=(Sphere(material=Phong(1e308, reflect=1.0)),), max_bounces=0),
    lambda: Scene(spheres=(Sphere(material=Phong(1e308)),), max_bounces=16),
    lambda: Scene(spheres=(Sphere(material=Phong(0, 0, 0, reflect=1.0)),), background=1e308, max_bounces=16),
    lambda: Scene(spheres=(Sphere(material=Phong(1, 0, 0)),), lights=(PointLight(intensity=1e308),) * 2),
    lambda: Scene(spheres=(Sphere(material=Phong(diffuse=1e308)),), lights=(PointLight(intensity=0),)),
    lambda: Scene(spheres=(), lights=(PointLight(intensity=1e308),) * 2),
    lambda: Scene(lights=(PointLight(intensity=1e300, attenuation=(1e3, 0, 0)),)),
    lambda: Scene(lights=(PointLight(attenuation=(0, 0, 1)), PointLight(attenuation=(0, 1e-300, 0)))),
]


@pytest.mark.parametrize("make", BRIGHT_BUT_FINITE)
def test_scene_whose_values_stay_in_float64_is_accepted_however_bright(make: Callable[[], Scene]) -> None:
    assert isinstance(make(), Scene)


TOO_BRIGHT: list[tuple[Callable[[], Scene], str]] = [
    (lambda: Scene(lights=(PointLight(intensity=1e308),) * 2), "spheres[0].material"),
    (
        lambda: Scene(lights=(PointLight(intensity=(1e308, 0, 0)), DirectionalLight(intensity=1e308))),
        "spheres[0].material",
    ),
    (lambda: Scene(lights=(PointLight(attenuation=(1e-310, 0, 0)),)), "spheres[0].material"),
    (lambda: Scene(spheres=(Sphere(), Sphere((3, 0, 0), 1, Phong(1e308, 1e308)))), "spheres[1].material"),
    (lambda: Scene(spheres=(), plane=Plane(material=Phong(1e308, 1e308))), "plane.material"),
    (lambda: Scene(plane=Plane(checker=Phong(diffuse=(0, 1e308, 0), specular=1e308))), "plane.checker"),
    (lambda: Scene(spheres=(Sphere(material=Phong((0, 0, 1e308), reflect=0.9)),)), "max_bounces"),
    (
        lambda: Scene(spheres=(Sphere(material=Phong(1e308, reflect=1)),), background=(0, 0, 1.7e308), max_bounces=1),
        "max_bounces",
    ),
]


@pytest.mark.parametrize(("make", "place"), TOO_BRIGHT)
def test_scene_whose_values_can_leave_float64_is_refused_at_what_is_too_bright(
    make: Callable[[], Scene], place: str
) -> None:
    assert refused(make).place == place


@given(points(4.0), points(4.0), st.floats(0.01, 9.0), st.integers(-530, 500), st.integers(-3, 3))
def test_first_sphere_that_the_eye_is_not_outside_is_found_exactly(
    eye: Vector, center: Vector, radius: float, k: int, ulps: int
) -> None:
    """At every scale, and with a radius within 3 ulp of the distance, where float64 cannot tell."""
    close = math.dist(eye, center)
    close = max(close + ulps * math.ulp(close), 1e-3)
    spheres = [Sphere(center, close), Sphere(center, radius)]
    spheres = [Sphere(scaled_point(s.center, k), math.ldexp(s.radius, k)) for s in spheres]
    eye = scaled_point(eye, k)
    expected = [i for i, s in enumerate(spheres) if excess_over_sphere(eye, s.center, s.radius) <= 0]
    assert first_not_outside(eye, spheres) == (expected[0] if expected else None)


def test_eye_inside_a_sphere_whose_square_rounds_below_the_eye_s_is_found() -> None:
    """In units of 2^-1074 the true squares are 1.8 and 2.2; in float64 they are 3 and 2."""
    a, radius = math.ldexp(math.sqrt(0.6), -537), math.ldexp(math.sqrt(2.2), -537)
    assert radius * radius < a * a + a * a + a * a
    assert first_not_outside((a, a, a), [Sphere((0, 0, 0), radius)]) == 0


def scaled_point(v: Vector, k: int) -> Vector:
    return math.ldexp(v[0], k), math.ldexp(v[1], k), math.ldexp(v[2], k)


def test_eye_on_the_plane_is_told_from_eye_one_ulp_beside_it() -> None:
    """(3, 3, 3) and (0.1, 0.1, 0.1) differ by a vector that is perpendicular to (1, -2, 1) exactly, at any scale."""
    for k in (-900, -3, 0, 900):
        point, normal = scaled_point((0.1, 0.1, 0.1), k), (1e-5, -2e-5, 1e-5)
        for y, side in ((3.0, 0), (math.nextafter(3.0, 4.0), -1), (math.nextafter(3.0, 0.0), 1)):
            eye = scaled_point((3.0, y, 3.0), k)
            assert side_of_plane(eye, point, normal) == side
            if side:
                assert Scene(Camera(eye), (), plane=Plane(point, normal)).camera.eye == eye
            else:
                plane = Plane(point, normal)
                with pytest.raises(SceneError, match="is on the plane"):
                    Scene(Camera(eye), (), plane=plane)


@given(points(9.0), st.integers(-60, 60), st.integers(0, 2))
def test_axis_parallel_to_the_normal_is_told_from_one_an_ulp_beside_it(v: Vector, k: int, axis: int) -> None:
    parallel = scaled_point(v, k)
    assert are_parallel(v, parallel)
    if sum(map(bool, v)) > 1 and v[axis]:
        moved = [*parallel]
        moved[axis] = math.nextafter(moved[axis], math.inf)
        assert not are_parallel(v, (moved[0], moved[1], moved[2]))
        assert Plane(normal=v, axis=(moved[0], moved[1], moved[2])).normal == v
        assert refused(lambda: Plane(normal=v, axis=parallel)).place == "axis"


@given(scenes(), st.integers(-300, 300))
def test_validity_of_a_scene_with_all_parts_does_not_depend_on_the_unit_of_length(scene: Scene, k: int) -> None:
    assert scaled_with_all_parts(scaled_with_all_parts(scene, k), -k) == scene
