"""Scenes as POV-Ray text: what the text says, read back number by number, is the scene.

The text is read by the small parser below and given its meaning by POV-Ray's published formulas, written here anew.
What needs the povray program is skipped where there is none; nothing here needs Mitsuba.
"""

from __future__ import annotations

import math
import re
import shutil

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from benchmarks import povray, povray_text, strips
from benchmarks.agreement import statable
from symrender_cg import Camera, Phong, PointLight, Scene, Sphere
from symrender_cg.reference import brute_force
from symrender_cg.scene import DirectionalLight, Gradient, Plane

MATERIAL = Phong(gate_specular=True)
MIRROR = replace(MATERIAL, reflect=0.25)
TWO = (Sphere((-0.5, 0.0, 0.0), 0.75, MIRROR), Sphere((0.75, 0.25, -0.5), 0.5, MATERIAL))
SCENE = Scene(
    Camera((0.0, 0.0, 6.0), half_height=1.5),
    TWO,
    (PointLight((5.0, 5.0, 10.0), 0.75), DirectionalLight((1.0, -2.0, -2.0), (0.125, 0.25, 0.5))),
    background=(0.0625, 0.125, 0.25),
    plane=Plane(
        (0.25, -1.0, 0.5), (0.0, 2.0, 0.0), MATERIAL, Phong(0.5, 0.25, 0.0, gate_specular=True), 0.5, (1, 0, 1)
    ),
)
NUMBER = r"[-+0-9.e]+"
unit_numbers = st.floats(0.0, 1.0, allow_subnormal=False)
colours = st.one_of(unit_numbers, st.tuples(unit_numbers, unit_numbers, unit_numbers))


def numbers(text: str) -> list[float]:
    """Every number between the first < and the next >."""
    return [float(part) for part in text[text.index("<") + 1 : text.index(">")].split(",")]


def lines_of(text: str, keyword: str) -> list[str]:
    """The lines that open with a keyword."""
    return [line for line in text.splitlines() if line.startswith(keyword)]


def after(line: str, keyword: str) -> list[float]:
    """The vector that follows a keyword."""
    return numbers(line[line.index(f"{keyword} <") :])


def scalar(line: str, keyword: str) -> float:
    """The number that follows a keyword."""
    found = re.search(rf"\b{keyword} ({NUMBER})", line)
    assert found is not None, f"no {keyword} in {line}"
    return float(found[1])


def unit_of(text: str) -> float:
    """The power of two that lengths were multiplied by, from the first line."""
    return scalar(text, "lengths times")


def seen_colours(text: str, name: str) -> tuple[np.ndarray, np.ndarray, float]:
    """(ambient, diffuse, phong) that POV-Ray computes with: ambient pigment, diffuse pigment, phong."""
    line = next(line for line in lines_of(text, "#declare") if f" {name} " in line)
    pigment = np.array(after(line, "pigment { rgb"))
    return np.array(after(line, "ambient rgb")) * pigment, scalar(line, "diffuse") * pigment, scalar(line, "phong")


def test_rays_of_the_exported_camera_go_through_our_pixel_centres() -> None:
    width, height = 7, 4
    text = povray_text.export(SCENE, width, height)
    camera, unit = lines_of(text, "camera")[0], unit_of(text)
    location, direction, right, up = (
        np.array(after(camera, word)) / unit for word in ("location", "direction", "right", "up")
    )
    pixel = 2.0 * 1.5 / height
    for row in range(height):
        for column in range(width):
            ray = direction + ((column + 0.5) / width - 0.5) * right + (0.5 - (row + 0.5) / height) * up
            centre = ((column + 0.5 - 0.5 * width) * pixel, (0.5 * height - row - 0.5) * pixel, -6.0)
            np.testing.assert_allclose(ray, centre, rtol=0, atol=1e-15)
    assert location.tolist() == [0.0, 0.0, 6.0]


@given(
    st.tuples(*[st.floats(-3, 3).filter(lambda c: c == 0.0 or abs(c) > 1e-300)] * 3),
    st.floats(1e-3, 2.0),
    st.floats(5.5, 1e5),
)
def test_spheres_are_those_of_the_camera_frame_times_one_power_of_two(
    center: tuple[float, float, float], radius: float, eye: float
) -> None:
    assume(math.dist(center, (0, 0, eye)) > radius)
    scene = Scene(Camera((0.0, 0.0, eye), half_height=1.0), (Sphere(center, radius, MATERIAL),))
    text = povray_text.export(scene, 8, 8)
    unit, line = unit_of(text), lines_of(text, "sphere")[0]
    assert math.frexp(unit)[0] == 0.5
    assert tuple(c / unit for c in numbers(line)) == center
    assert float(re.search(rf">, ({NUMBER}) texture", line)[1]) / unit == radius  # type: ignore[index]


def test_a_scene_is_exported_as_it_is_in_the_camera_frame() -> None:
    moved = replace(SCENE, camera=Camera((3.0, 1.0, 5.0), (0.25, 0.0, 0.0), (0.1, 1.0, 0.0)))
    assert povray_text.export(moved, 9, 5) == povray_text.export(moved.in_camera_frame(), 9, 5)


@given(*[st.one_of(st.just(0.0), st.floats(1e-3, 10.0))] * 3)
def test_fades_add_up_to_the_attenuation(a: float, b: float, c: float) -> None:
    assume(a + b + c > 0.0)
    if a > 0.0 and b > 0.0 and c > 0.0:
        assume(b * b > 4.5 * a * c)
    elif b > 0.0 and c > 0.0:
        assume(b > 1e-3 * c)
    for length in (0.01, 0.7, 1.0, 3.0, 50.0):
        total = sum(
            share * (2.0 / (1.0 + (length / distance) ** power) if power else 1.0)
            for share, distance, power in povray_text.fades((a, b, c))
        )
        assert total == pytest.approx(1.0 / (a + b * length + c * length * length), rel=2e-6)


@pytest.mark.parametrize("attenuation", [(1.0, 0.1, 0.1), (1.0, 2.0, 1.0), (0.5, 0.0625, 0.03125)])
def test_an_attenuation_without_a_form_is_refused_by_its_numbers(attenuation: tuple[float, float, float]) -> None:
    with pytest.raises(povray_text.NotStatedError, match=re.escape(str(attenuation))):
        povray_text.fades(attenuation)


def test_a_scene_that_cannot_be_stated_is_replaced_by_one_that_can_and_the_change_is_told() -> None:
    light = PointLight((1.0, 2.0, 3.0), 1.0, (0.5, 0.0625, 0.03125))
    scene = replace(SCENE, lights=(light,), spheres=(replace(TWO[0], material=Phong()),))
    stated, notes = statable(scene)
    assert stated.lights[0] == replace(light, attenuation=(0.5, 0.0, 0.03125))
    assert all(sphere.material.gate_specular for sphere in stated.spheres)
    assert any("lights[0]" in note for note in notes)
    assert any("gate" in note for note in notes)
    assert statable(SCENE) == (SCENE, [])


def test_lights_stand_where_they_are_and_parallel_ones_shine_along_their_direction() -> None:
    text = povray_text.export(SCENE, 8, 8)
    point, sun = lines_of(text, "light_source")
    assert [c / unit_of(text) for c in numbers(point)] == [5.0, 5.0, 10.0]
    assert after(point, "rgb") == [0.75, 0.75, 0.75]
    assert "parallel" not in point
    assert "parallel point_at <0, 0, 0>" in sun
    np.testing.assert_allclose(-np.array(numbers(sun)) / np.linalg.norm(numbers(sun)), [1 / 3, -2 / 3, -2 / 3])
    assert after(sun, "rgb") == [0.125, 0.25, 0.5]


def test_a_light_of_intensity_0_is_not_exported() -> None:
    dark = replace(SCENE, lights=(PointLight((1.0, 1.0, 5.0), 0.0),))
    assert "light_source" not in povray_text.export(dark, 8, 8)


@given(colours, colours, unit_numbers)
def test_pigment_and_finish_multiply_to_the_coefficients(
    ambient: float | tuple[float, float, float], diffuse: float | tuple[float, float, float], specular: float
) -> None:
    material = Phong(ambient, diffuse, specular, 20.5, True)
    scene = replace(SCENE, spheres=(Sphere(material=material),), plane=None)
    pictures = povray_text.channels(scene)
    for channel in pictures:
        text = povray_text.export(scene, 8, 8, channel=channel)
        expected = [np.broadcast_to(np.array(c), 3) for c in (ambient, diffuse)]
        if channel is not None:
            expected = [np.repeat(c[channel], 3) for c in expected]
        seen_ambient, seen_diffuse, phong = seen_colours(text, "Material_0")
        np.testing.assert_allclose(seen_ambient, expected[0], rtol=1e-15, atol=1e-300)
        np.testing.assert_allclose(seen_diffuse, expected[1], rtol=1e-15, atol=1e-300)
        assert phong == specular
        assert scalar(text, "phong_size") == 20.5


def test_coloured_highlights_take_three_pictures_each_of_its_own_channel() -> None:
    material = Phong((0.1, 0.2, 0.3), 0.5, (0.25, 0.5, 0.75), gate_specular=True)
    scene = replace(SCENE, spheres=(Sphere(material=material),))
    assert povray_text.channels(SCENE) == (None,)
    assert povray_text.channels(scene) == (0, 1, 2)
    for channel in (0, 1, 2):
        text = povray_text.export(scene, 8, 8, channel=channel)
        assert seen_colours(text, "Material_0")[2] == (0.25, 0.5, 0.75)[channel]
        assert after(lines_of(text, "background")[0], "rgb") == [(0.0625, 0.125, 0.25)[channel]] * 3
        assert after(lines_of(text, "light_source")[1], "rgb") == [(0.125, 0.25, 0.5)[channel]] * 3


def test_without_shadows_no_object_casts_one_and_with_them_every_object_does() -> None:
    bodies = ("sphere", "plane")
    for shadows in (True, False):
        text = povray_text.export(replace(SCENE, shadows=shadows), 8, 8)
        objects = [line for body in bodies for line in lines_of(text, f"{body} {{")]
        assert len(objects) == 3
        assert all(("no_shadow" in line) != shadows for line in objects)
        assert "shadowless" not in text  # such lights lose their highlights


@pytest.mark.parametrize("bounces", [0, 1, 4, 16])
def test_the_trace_level_is_one_more_than_the_bounces(bounces: int) -> None:
    text = povray_text.export(replace(SCENE, max_bounces=bounces), 8, 8)
    assert scalar(text, "max_trace_level") == bounces + 1
    assert scalar(text, "adc_bailout") == 0.0
    assert ("reflection { rgb 0.25 }" in text) == (bounces > 0)
    assert scalar(text, "assumed_gamma") == 1.0


def test_gain_multiplies_lights_ambient_and_background_and_nothing_else() -> None:
    full, half = povray_text.export(SCENE, 8, 8), povray_text.export(SCENE, 8, 8, gain=0.5)
    for plain, dark in zip(full.splitlines(), half.splitlines(), strict=True):
        if plain.startswith("//"):
            continue
        for keyword in ("ambient rgb", "light_source", "background"):
            if keyword in plain:
                brighter = after(plain, "ambient rgb" if keyword == "ambient rgb" else "rgb")
                assert after(dark, "ambient rgb" if keyword == "ambient rgb" else "rgb") == [0.5 * c for c in brighter]
                break
        else:
            assert dark == plain
    assert seen_colours(half, "Material_0")[1].tolist() == seen_colours(full, "Material_0")[1].tolist()


@settings(max_examples=30)
@given(st.floats(-20, 20), st.floats(-20, 20))
def test_the_tile_of_the_exported_pattern_is_that_of_the_plane(along: float, across: float) -> None:
    plane = SCENE.plane
    assert plane is not None
    assert plane.checker is not None
    u, v = np.array([1.0, 0.0, 1.0]) / math.sqrt(2.0), np.array([1.0, 0.0, -1.0]) / math.sqrt(2.0)  # v = n x u
    tiles = (along / 0.5, across / 0.5)
    assume(min(abs(t - round(t)) for t in tiles) > 1e-9)
    point = np.array(plane.point) + along * u + across * v

    text = povray_text.export(SCENE, 8, 8)
    line = lines_of(text, "plane {")[0]
    rows = np.array(after(line, "matrix")).reshape(4, 3)
    pattern = np.linalg.solve(rows[:3].T, unit_of(text) * point - rows[3])
    odd = int(np.floor(pattern).sum()) % 2  # POV-Ray's checker: first texture where the sum is even
    first, second = re.findall(r"texture \{ (Material_\d) \}", line)
    assert (math.floor(tiles[0]) + math.floor(tiles[1])) % 2 == odd
    assert seen_colours(text, first)[1][0] == plane.material.diffuse
    assert seen_colours(text, second)[1][0] == plane.checker.diffuse


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (-3.0, 0.5, 2.0), (0.0, -1.0, 0.0)])
def test_the_sky_has_the_gradients_colour_in_every_direction(up: tuple[float, float, float]) -> None:
    sky = Gradient((0.0, 0.25, 0.5), (1.0, 0.5, 0.25), up)
    line = lines_of(povray_text.export(replace(SCENE, background=sky), 8, 8), "sky_sphere")[0]
    rows = np.array(after(line, "matrix")).reshape(4, 3)
    scale, shift = scalar(line, "scale"), np.array(after(line, "translate"))
    entries = re.findall(rf"\[({NUMBER}) rgb <([^>]*)>\]", line)
    places = [float(place) for place, _ in entries]
    ends = np.array([[float(c) for c in colour.split(",")] for _, colour in entries])
    for d in np.random.default_rng(1).normal(size=(20, 3)):
        d = d / np.linalg.norm(d)
        pattern = (np.linalg.solve(rows[:3].T, d - rows[3]) - shift)[1] / scale
        assert 0.0 < pattern < 1.0  # where POV-Ray's gradient does not wrap around
        colour = [np.interp(pattern, places, channel) for channel in ends.T]
        s = 0.5 * (1.0 + float(np.dot(up, d)) / math.hypot(*up))
        np.testing.assert_allclose(colour, (1 - s) * np.array(sky.bottom) + s * np.array(sky.top), atol=1e-12)


def test_equal_materials_are_declared_once() -> None:
    spheres = tuple(Sphere((float(k), 0.0, 0.0), 0.25, MATERIAL) for k in range(5))
    text = povray_text.export(replace(SCENE, spheres=spheres, plane=None), 8, 8)
    assert len(lines_of(text, "#declare")) == 1
    assert text.count("texture { Material_0 }") == 5


def test_a_16_bit_ppm_reads_as_its_levels() -> None:
    levels = np.arange(18, dtype=np.uint16).reshape(2, 3, 3) * 3000
    data = b"P6\n# a comment\n3 2\n65535\n" + levels.astype(">u2").tobytes()
    assert povray.read_ppm(data).tolist() == levels.tolist()
    with pytest.raises(RuntimeError, match="PPM"):
        povray.read_ppm(b"P6\n3 2\n255\n" + bytes(18))


def test_a_strip_shows_both_pictures_and_100_times_their_difference() -> None:
    ours, theirs = np.zeros((2, 3)), np.full((2, 3), 0.004)
    row = strips.strip(ours, theirs)
    assert row.shape == (2, 3 * 3 + 2 * strips.GAP, 3)
    assert (row[:, :3] == 0).all()
    assert (row[:, 3 + strips.GAP : 6 + strips.GAP] == round(255 * (1.055 * 0.004 ** (1 / 2.4) - 0.055))).all()
    assert (row[:, -3:] == round(255 * 0.4)).all()


@pytest.mark.skipif(shutil.which("povray") is None, reason="povray is not installed; apt-get install povray")
def test_povray_draws_the_reference_to_half_of_its_last_level() -> None:
    program, size = povray.find(), 48
    assert program is not None
    drawn = povray.draw(program, SCENE, size, size, gain=0.5)
    expected = brute_force.image(SCENE, size, size)
    sure = expected.doubt > 1e-6
    assert np.count_nonzero(sure) > 0.9 * size * size
    assert np.abs(drawn.image - expected.value)[sure].max() < 0.51 * drawn.level
