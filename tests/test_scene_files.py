"""Laws of scene files: what is written reads back bit for bit, and what is misspelled is named with its path."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scene_strategies import scenes
from strategies import nasty_scenes, ordinary_scenes

from symrender_cg.errors import SceneError
from symrender_cg.scene import (
    Camera,
    DirectionalLight,
    Gradient,
    Phong,
    Plane,
    PointLight,
    Scene,
    Sphere,
    load_scene,
)
from symrender_cg.scene.files import parse_scene

DOCUMENT = Path(__file__).resolve().parent.parent / "docs" / "scenes.md"


def refused_text(text: str) -> SceneError:
    with pytest.raises(SceneError) as caught:
        parse_scene(text, source="a.toml")
    return caught.value


@given(st.one_of(ordinary_scenes(), nasty_scenes(), scenes()))
def test_written_scene_reads_back_bit_for_bit(scene: Scene) -> None:
    text = scene.to_toml()
    again = parse_scene(text)
    assert again == scene
    assert repr(again) == repr(scene)
    assert again.to_toml() == text


@pytest.mark.parametrize(
    "scene",
    [
        Scene(spheres=(), lights=()),
        Scene(spheres=(Sphere((0, 0, 0)), Sphere((3, 0, 0), 0.5, Phong(gate_specular=True)))),
        Scene(lights=(PointLight((1, 2, 3)), PointLight((5e-324, 1.7976931348623157e308, -1e22), 0.1))),
        Scene(Camera((1, 2, 30), (0, 0, 0.1), (1e-5, 1, 0), 0.3), background=1 / 3),
        Scene(background=(0.1, 1 / 3, 5e-324), shadows=False, max_bounces=0),
        Scene(background=Gradient((0.1, 0.2, 0.3), 0.7, (1e-300, 1, 0)), max_bounces=16),
        Scene(plane=Plane((0, -2, 1e17), (0, 1 / 3, 0), Phong((1, 0, 1 / 3), reflect=1), None, 1e-9, (1, 1, 1))),
        Scene(spheres=(), lights=(), plane=Plane(checker=Phong(0, (0, 0, 0), 1, 2, True, 0.1))),
        Scene(lights=(DirectionalLight((0, -1e300, 1), (1, 0.1, 0)), PointLight((1, 2, 3), 0.1, (0, 1e-9, 0.1)))),
    ],
)
def test_lists_of_any_length_and_extreme_numbers_survive_a_file(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    assert Scene.from_toml(path) == scene
    assert Scene.from_toml(str(path)) == scene


def test_written_scene_names_every_field_and_keeps_a_vector_on_one_line() -> None:
    text = Scene(Camera(half_height=1.5)).to_toml()
    table = tomllib.loads(text)
    assert set(table) == {"background", "shadows", "max_bounces", "camera", "spheres", "lights"}
    assert set(table["camera"]) == {"eye", "look_at", "up", "half_height"}
    assert set(table["spheres"][0]) == {"center", "radius", "material"}
    assert set(table["spheres"][0]["material"]) == {
        "ambient",
        "diffuse",
        "specular",
        "shininess",
        "gate_specular",
        "reflect",
    }
    assert set(table["lights"][0]) == {"position", "intensity", "attenuation"}
    assert "eye = [0.0, 0.0, 4.0]\n" in text
    scene = Scene(
        spheres=(),
        lights=(DirectionalLight(intensity=(1, 0.5, 0.25)),),
        background=Gradient(),
        plane=Plane(checker=Phong()),
    )
    text = scene.to_toml()
    table = tomllib.loads(text)
    assert set(table) == {"background", "shadows", "max_bounces", "camera", "spheres", "lights", "plane"}
    assert set(table["camera"]) == {"eye", "look_at", "up"}
    assert set(table["lights"][0]) == {"direction", "intensity"}
    assert set(table["plane"]) == {"point", "normal", "material", "checker", "tile", "axis"}
    assert set(table["background"]) == {"bottom", "top", "up"}
    assert "intensity = [1.0, 0.5, 0.25]\n" in text
    assert "checker" not in Scene(plane=Plane()).to_toml()


def test_what_a_file_leaves_out_is_chapter_1() -> None:
    assert parse_scene("") == Scene.chapter1()
    assert parse_scene("[[spheres]]\nradius = 2").spheres == (Sphere(radius=2.0),)
    assert parse_scene("lights = []").lights == ()
    assert parse_scene("[plane]").plane == Plane()
    assert parse_scene("[plane.checker]").plane == Plane(checker=Phong())
    assert parse_scene("[background]").background == Gradient()
    assert parse_scene("[[lights]]\n").lights == (PointLight(),)
    assert parse_scene("max_bounces = 0\nshadows = false") == Scene(max_bounces=0, shadows=False)


def test_light_is_of_the_kind_that_its_keys_say() -> None:
    scene = parse_scene("lights = [{direction = [0, -1, 0]}, {position = [1, 2, 3]}, {intensity = 2}]")
    assert scene.lights == (DirectionalLight((0, -1, 0)), PointLight((1, 2, 3)), PointLight(intensity=2))


def test_background_is_a_grey_a_colour_or_a_gradient_as_it_is_written() -> None:
    assert parse_scene("background = 1").background == 1.0
    assert parse_scene("background = [1, 0, 0.5]").background == (1.0, 0.0, 0.5)
    assert parse_scene("background = {top = [1, 0, 0.5]}").background == Gradient(0.0, (1, 0, 0.5))


REFUSED_TEXTS = [
    ("[[spheres]]\nradius = -1", "spheres[0].radius", ("-1.0 is not positive",)),
    ("[[spheres]]\n[[spheres]]\ncenter = [3, 0, 0]\nradius = nan", "spheres[1].radius", ("nan",)),
    ("[[spheres]]\nradius = '1'", "spheres[0].radius", ("'1' of type str", "without quotes")),
    ("[[spheres]]\nradius = 2020-01-01", "spheres[0].radius", ("is not a number",)),
    ("[[spheres]]\ncenter = [0, 0]", "spheres[0].center", ("has 2 entries",)),
    ("[[spheres]]\ncenter = [0, 0, inf]", "spheres[0].center[2]", ("inf",)),
    ("[[spheres]]\n[spheres.material]\nshininess = -3", "spheres[0].material.shininess", ("-3.0 is negative",)),
    ("[[spheres]]\n[spheres.material]\nshinines = 3", "spheres[0].material.shinines", ("did you mean 'shininess'?",)),
    ("[[spheres]]\nmaterial = 3", "spheres[0].material", ("3 is not a table", "[spheres[0].material]")),
    ("[[spheres]]\ncentre = [0, 0, 0]", "spheres[0].centre", ("unknown key", "did you mean 'center'?")),
    ("[[sphere]]\nradius = 1", "sphere", ("did you mean 'spheres'?",)),
    ("[spheres]\nradius = 1", "spheres", ("is not a list of tables", "[[spheres]]")),
    ("[[lights]]\nposition = [nan, 0, 0]", "lights[0].position[0]", ("nan",)),
    ("[[lights]]\nRadius = 1", "lights[0].Radius", ("expected one of position, intensity", "remove it")),
    ("lights = [1]", "lights[0]", ("1 is not a table",)),
    ("[lights]\nposition = [1, 2, 3]", "lights", ("is not a list of tables", "[[lights]]")),
    ("[[lights]]\ndirecton = [0, -1, 0]", "lights[0].directon", ("did you mean 'direction'?", "DirectionalLight")),
    ("[[lights]]\nintensty = 1", "lights[0].intensty", ("did you mean 'intensity'?",)),
    (
        "[[lights]]\ndirection = [0, 1, 0]\npositon = 1",
        "lights[0].positon",
        ("unknown key", "did you mean 'position'?"),
    ),
    (
        "[[lights]]\nposition = [0, 9, 0]\ndirection = [0, -1, 0]",
        "lights[0].position",
        ("beside direction", "remove one of the two"),
    ),
    (
        "[[lights]]\ndirection = [0, -1, 0]\nattenuation = [1, 0, 0]",
        "lights[0].attenuation",
        ("beside direction", "comes from no point"),
    ),
    ("[[lights]]\ndirection = [0, 0, 0]", "lights[0].direction", ("has no direction",)),
    ("[[lights]]\nattenuation = [0, 0, 0]", "lights[0].attenuation", ("divides the intensity by 0",)),
    ("[[lights]]\nintensity = [1, 1]", "lights[0].intensity", ("has 2 entries",)),
    ("[[lights]]\nintensity = [1, -1, 1]", "lights[0].intensity[1]", ("-1.0 is negative",)),
    ("[[spheres]]\n[spheres.material]\nreflect = 2", "spheres[0].material.reflect", ("2.0 is not from 0 to 1",)),
    ("[[spheres]]\nmaterial.diffuse = 'red'", "spheres[0].material.diffuse", ("is not a colour",)),
    ("plane = true", "plane", ("True is not a table", "[plane]")),
    ("[[plane]]\ntile = 1", "plane", ("is not a table", "[plane]")),
    ("[plane]\ntiles = 1", "plane.tiles", ("did you mean 'tile'?",)),
    ("[plane]\ntile = -1", "plane.tile", ("-1.0 is not positive",)),
    ("[plane]\naxis = [0, 1, 0]", "plane.axis", ("is parallel to the normal",)),
    ("[plane.checker]\nambient = nan", "plane.checker.ambient", ("nan",)),
    ("[plane.material]\nshinyness = 1", "plane.material.shinyness", ("did you mean 'shininess'?",)),
    ("[plane]\npoint = [0, 0, 4]\nnormal = [0, 0, 1]", "camera.eye", ("is on the plane",)),
    ("[background]\ncolour = 1", "background.colour", ("expected one of bottom, top, up in a Gradient",)),
    ("[background]\nbotom = 1", "background.botom", ("did you mean 'bottom'?",)),
    ("background = {top = [1, 1, nan]}", "background.top[2]", ("nan",)),
    ("background = [1, 1]", "background", ("has 2 entries",)),
    ("background = 'black'", "background", ("'black' of type str is not a colour",)),
    ("shadows = 1", "shadows", ("1 of type int", "true or false")),
    ("shadow = true", "shadow", ("did you mean 'shadows'?",)),
    ("max_bounces = 2.0", "max_bounces", ("2.0 of type float", "whole number")),
    ("max_bounces = 99", "max_bounces", ("99 is out of range",)),
    ("bounces = 2", "bounces", ("did you mean 'max_bounces'?",)),
    ("[camera]\nEye = [0, 0, 4]", "camera.Eye", ("did you mean 'eye'?",)),
    ("[camera]\neye = [0, 0, 0]", "camera.eye", ("is also look_at",)),
    ("[camera]\nup = [0, 0, 1]", "camera.up", ("is parallel to the view",)),
    ("[camera]\nhalf_height = 0", "camera.half_height", ("0.0 is not positive",)),
    ("[camera]\neye = [0, 0, 1]", "camera.eye", ("is on spheres[0]",)),
    ("camera = 4", "camera", ("4 is not a table", "[camera]")),
    ("backgrund = 1", "backgrund", ("did you mean 'background'?",)),
    ("background = true", "background", ("True of type bool",)),
    ("zzz = 1", "zzz", ("unknown key", "expected one of camera, spheres, lights, background", "remove it")),
    ("radius = = 1", "", ("is not valid TOML", "line 1")),
]


@pytest.mark.parametrize(("text", "place", "words"), REFUSED_TEXTS)
def test_error_in_a_file_has_the_path_of_the_key_and_the_name_of_the_file(
    text: str, place: str, words: tuple[str, ...]
) -> None:
    error = refused_text(text)
    assert error.place == place
    assert [word for word in (*words, "a.toml") if word not in str(error)] == []


def test_file_that_cannot_be_read_is_a_scene_error_with_its_name(tmp_path: Path) -> None:
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    for path, words in (
        (tmp_path / "none.toml", "there is no file"),
        (tmp_path, "cannot be read"),
        (binary, "is not text in UTF-8"),
    ):
        with pytest.raises(SceneError, match=words) as caught:
            Scene.from_toml(path)
        assert path.name in str(caught.value)


def test_scene_is_named_by_nothing_itself_a_file_or_a_built_in_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene.chapter1(radius=0.5)
    path = tmp_path / "mine.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    (tmp_path / "no_suffix").write_text(scene.to_toml(), encoding="utf-8")
    (tmp_path / "far").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_scene(None) == Scene.chapter1()
    assert load_scene(scene) is scene
    assert load_scene(path) == load_scene(str(path)) == load_scene("mine.toml") == load_scene("no_suffix") == scene
    assert load_scene("far") == Scene.builtin("far")


@pytest.mark.parametrize("name", ["chapter_1", "Chapter1", "chapter 1"])
def test_misspelled_built_in_name_gets_a_suggestion_and_the_list(name: str) -> None:
    for load in (load_scene, Scene.builtin):
        with pytest.raises(SceneError) as caught:
            load(name)
        assert "did you mean 'chapter1'?" in str(caught.value)
        assert all(known in str(caught.value) for known in Scene.builtin_names())


def test_name_of_nothing_is_refused() -> None:
    for name, words in (("mine.toml", "there is no file 'mine.toml'"), ("qqq", "neither a scene file nor a built-in")):
        with pytest.raises(SceneError, match=words):
            load_scene(name)
    with pytest.raises(SceneError, match="3 does not name a scene"):
        load_scene(3)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="no built-in scene is named"):
        Scene.builtin("../scenes/far")


def test_document_lists_every_key_and_its_examples_are_scenes() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    keys = [*Scene.__struct_fields__, *Camera.__struct_fields__, *Sphere.__struct_fields__]
    for model in (Phong, PointLight, DirectionalLight, Plane, Gradient):
        keys += model.__struct_fields__
    assert [key for key in keys if f"`{key}`" not in text] == []
    assert [name for name in Scene.builtin_names() if f"`{name}`" not in text] == []
    examples = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    assert len(examples) >= 3
    for example in examples:
        assert isinstance(parse_scene(example), Scene)


def test_document_s_longest_example_has_every_key_and_its_python_makes_a_scene() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    example = max(re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL), key=len)
    scene = parse_scene(example)
    assert scene.plane is not None
    assert scene.plane.checker is not None
    written = {line.split(" =")[0] for line in scene.to_toml().splitlines() if " = " in line}
    assert [key for key in sorted(written) if f"\n{key} = " not in example] == []
    programs = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert programs
    for program in programs:
        names: dict[str, object] = {}
        exec(program, names)
        assert isinstance(names["scene"], Scene)


def test_document_quotes_the_message_of_a_misspelled_key() -> None:
    text = " ".join(DOCUMENT.read_text(encoding="utf-8").split())
    assert str(refused_text("[[spheres]]\nmaterial.shinines = 3")).replace("a.toml", "scene.toml") in text
