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
from strategies import centred_scenes, nasty_scenes, ordinary_scenes, scaled

from symrender_cg.errors import SceneError, SymrenderError
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

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


def test_chapter_1_arguments_reach_their_fields() -> None:
    scene = Scene.chapter1(2.0, 5.0, (1, 2, 3), 0.2, 0.3, 0.4, 7.0)
    assert scene.camera.eye == (0.0, 0.0, 5.0)
    assert scene.spheres[0] == Sphere((0, 0, 0), 2.0, Phong(0.2, 0.3, 0.4, 7.0))
    assert scene.lights[0].position == (1.0, 2.0, 3.0)


def test_numbers_of_every_kind_become_plain_floats_and_tuples() -> None:
    vectors: Any = ([0, 0, 4], np.zeros(3), np.array([0, 1, 0]), np.array([0.5, 0, 0], dtype=np.float32))
    mixed: Any = (np.float32(5), 5, np.array(10.0))
    numbers_in: Any = (np.float32(1.5), np.int64(1), np.float64(0.25), np.float32(0.5))
    material = Phong(numbers_in[2], shininess=8)
    spheres: Any = [Sphere(vectors[3], numbers_in[1], material)]
    lights: Any = [PointLight(mixed)]
    scene = Scene(Camera(vectors[0], vectors[1], vectors[2], numbers_in[0]), spheres, lights, numbers_in[3])
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


def test_equal_scenes_have_equal_hashes_and_the_same_bits() -> None:
    one = Scene(Camera((0, 0, 4)), (Sphere((-0.0, 0, 0), 1),), (PointLight((5, -0.0, 10)),), -0.0)
    two = Scene(Camera((0.0, 0.0, 4.0)), (Sphere(),), (PointLight((5.0, 0.0, 10.0)),), 0.0)
    assert one == two
    assert hash(one) == hash(two)
    assert repr(one) == repr(two)
    assert len({one, two, Scene()}) == 2


@given(st.one_of(ordinary_scenes(), nasty_scenes()))
def test_pickle_and_deepcopy_give_an_equal_scene(scene: Scene) -> None:
    assert pickle.loads(pickle.dumps(scene)) == scene
    assert copy.deepcopy(scene) == scene


def test_scenes_are_frozen_and_replaced_values_are_checked() -> None:
    scene = Scene()
    with pytest.raises(AttributeError):
        scene.background = 1.0  # type: ignore[misc]
    with pytest.raises(AttributeError):
        scene.spheres[0].extra = 1  # type: ignore[attr-defined]
    assert msgspec.structs.replace(scene, background=1).background == 1.0
    assert refused(lambda: msgspec.structs.replace(scene, background=-1)).place == "background"


def test_no_or_several_spheres_and_lights_can_be_described() -> None:
    scene = Scene(spheres=(Sphere(), Sphere((2.5, 0, 0))), lights=())
    assert len(scene.spheres) == 2
    assert scene.lights == ()
    assert Scene(spheres=()).spheres == ()


def test_light_inside_a_sphere_is_allowed() -> None:
    assert Scene.chapter1(light=(0, 0, 0)).lights[0].position == (0.0, 0.0, 0.0)
    assert Scene.chapter1(light=(0, 0, 1)).lights[0].position == (0.0, 0.0, 1.0)


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
    (lambda: Scene(lights=(Sphere(),)), "lights[0]", ("is not a PointLight",)),  # type: ignore[arg-type]
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
