"""What only exact numbers decide: mirrored rays that touch, spheres met in one point, values that are exact ties.

Scenes that are symmetric about a slanted plane are used, where no coordinate is 0 and no ball is a point: what is equal
by symmetry is equal, and no precision shows it.
"""

from __future__ import annotations

import math
import pickle
from fractions import Fraction

import numpy as np
import pytest
from msgspec import structs

from symrender_cg.errors import AccuracyError
from symrender_cg.reference import oracle
from symrender_cg.scene import Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere

TIE = 1.0 + 2.0**-52
"""An odd last place: half an ulp more is rounded up, from 1.0 down."""


def shade(value: float, reflect: float = 0.0) -> Phong:
    return Phong(value, 0.0, 0.0, reflect=reflect)


def slanted(x: float, y: float, z: float) -> tuple[float, float, float]:
    """A turn about the z axis by atan(4 / 3), times 5: the plane x = 0 becomes 4 x = 3 y; exact for short numbers."""
    return 4.0 * x + 3.0 * y, 4.0 * y - 3.0 * x, 5.0 * z


def ball(y: float, z: float, radius: float, material: Phong, x: float = 0.0) -> Sphere:
    return Sphere(slanted(x, y, z), 5.0 * radius, material)


MIRRORS = tuple(
    ball(y, z, radius, shade(0.0, 1.0))
    for y, z, radius in ((-0.75, 0.0, 0.75), (1.0, 0.5, 0.75), (0.25, -4.0, 1.0), (3.5, 0.0, 1.25), (-3.5, 1.0, 1.25))
)
# how many mirrors, how many of MIRRORS there are, (y, z) of the pair that is seen in the last, y of the image point
PATHS = (
    (1, 3, (1.75, -3.0), -0.0263671875),
    (2, 3, (-3.0, -3.0), 0.0341796875),
    (3, 3, (-2.25, -3.0), 0.107421875),
    (4, 5, (-3.0, -3.0), 0.0060176696116),
)


def paired(count: int, place: tuple[float, float], bounces: int, first: int) -> Scene:
    """Mirrors, and two spheres that cut one another in the plane of symmetry: grey 1/4 and 3/4, `first` first."""
    pair = [ball(*place, 0.75, shade(s), x) for x, s in ((-0.5, 0.25), (0.5, 0.75))]
    camera = Camera((0.0, 0.0, 20.0), half_height=10.0)
    return Scene(camera, (*MIRRORS[:count], pair[first], pair[1 - first]), (), max_bounces=bounces)


def on_the_plane(y: float) -> tuple[float, float]:
    short = round(y * 2.0**40) / 2.0**40
    return 3.0 * short, 4.0 * short


@pytest.mark.parametrize(("mirrors", "count", "place", "y"), PATHS)
def test_two_spheres_that_a_mirrored_ray_meets_in_one_point_give_the_lower_index(
    mirrors: int, count: int, place: tuple[float, float], y: float
) -> None:
    px, py = on_the_plane(y)
    for first, wanted in ((0, 0.25), (1, 0.75))[: 1 if mirrors == 4 else 2]:  # four mirrors take a second
        scene = paired(count, place, mirrors, first)
        assert float(oracle.evaluate(scene, px, py).value) == wanted
        aside = oracle.evaluate(scene, [px - 2.0**-40, px + 2.0**-40], [py, py]).value.tolist()
        assert sorted(aside) == [0.25, 0.75], "either side of the plane shows its own sphere"
        fewer = structs.replace(scene, max_bounces=mirrors - 1)
        assert float(oracle.evaluate(fewer, px, py).value) == 0.0, "it takes all these mirrors to see it"


def test_points_that_stay_open_behind_five_mirrors_are_named_and_the_error_survives_a_pickle() -> None:
    scene = paired(5, (-3.0, -3.0), 5, 0)
    px, py = on_the_plane(0.22708784797466)
    x, y = np.array([[0.0, px, px + 2.0**-30], [9.0, px, 0.0]]), np.array([[0.0, py, py], [9.0, py, 0.0]])
    for ask in (oracle.evaluate, oracle.settle, oracle.enclose):
        named = r"2 of 6 points, the first at \(0\.68\d*, 0\.9\d*\), in a scene of 7 spheres: the value rests on a sign"
        with pytest.raises(AccuracyError, match=named) as e:
            ask(scene, x, y)
        assert e.value.points == (1, 4)
        again = pickle.loads(pickle.dumps(e.value))
        assert (str(again), again.points) == (str(e.value), (1, 4))
    rest = np.delete(x.ravel(), [1, 4]), np.delete(y.ravel(), [1, 4])
    assert np.isfinite(oracle.evaluate(scene, *rest).value).all()


@pytest.mark.parametrize("mirrors", [1, 2, 3])
def test_a_mirrored_point_on_the_terminator_is_dark_exactly(mirrors: int) -> None:
    """n.l = 0 all over the plane of symmetry for light at a right angle to it; shininess 0 adds all or nothing."""
    count, place, y = PATHS[mirrors - 1][1:]
    px, py = on_the_plane(y)
    for gate, wanted in ((True, 0.25), (False, 0.75)):
        seen = ball(*place, 0.75, Phong(0.25, 1.0, 0.5, 0.0, gate_specular=gate))
        sideways = DirectionalLight(slanted(-1.0, 0.0, 0.0))
        camera = Camera((0.0, 0.0, 20.0), half_height=10.0)
        scene = Scene(camera, (*MIRRORS[:count], seen), (sideways,), shadows=False, max_bounces=mirrors)
        assert float(oracle.evaluate(scene, px, py).value) == wanted
        lit = oracle.evaluate(scene, [px - 2.0**-40, px + 2.0**-40], [py, py]).value
        assert min(lit) == wanted
        assert max(lit) > 0.75


def test_a_mirrored_ray_that_touches_a_sphere_meets_it_and_its_neighbour_does_not() -> None:
    mirror = Sphere((0.0, 0.0, 0.0), 1.0, shade(0.0, 1.0))
    beyond = Sphere(slanted(0.25, 0.0, 2.0), 1.25, shade(0.5))  # its centre is 5/4 from the axis
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (mirror, beyond), (), max_bounces=1)
    assert float(oracle.evaluate(scene, 0.0, 0.0).value) == 0.5
    assert float(oracle.evaluate(scene, -(2.0**-80), 0.0).value) == 0.0
    floor = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), shade(0.0, 1.0))
    # at y = -1/2 the ray meets the floor in (0, -1, -4) and leaves it along (0, 1, -8)
    over = Sphere((1.5, 0.0, -12.0), 1.5, shade(0.5))
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (over,), (), 0.0, floor, max_bounces=1)
    seen = oracle.evaluate(scene, [0.0, -(2.0**-80), 2.0**-80], [-0.5] * 3).value.tolist()
    assert seen == [0.5, 0.0, 0.5]


FLOOR = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), shade(0.0, 1.0))
"""A mirror: at (0, -1/2) it shows what lies along (0, -1, -4) + t (0, 1, -8)."""


def behind_the_floor(material: Phong, light: PointLight | DirectionalLight, *others: Sphere) -> Scene:
    """The mirrored ray meets this sphere in (0, 1, -20), where n = (0, 0, 1)."""
    wall = Sphere((0.0, 1.0, -21.0), 1.0, material)
    camera = Camera((0.0, 0.0, 4.0), half_height=1.0)
    return Scene(camera, (wall, *others), (light,), 0.0, FLOOR, max_bounces=1)


def test_a_shadow_ray_behind_a_mirror_that_touches_a_sphere_is_blocked() -> None:
    light = DirectionalLight((0.0, 0.0, -3.0))
    for x, wanted in ((2.0, 0.125), (math.nextafter(2.0, 3.0), 0.625), (math.nextafter(2.0, 1.0), 0.125)):
        scene = behind_the_floor(Phong(0.125, 0.5, 0.0), light, Sphere((x, 1.0, -10.0), 2.0))
        assert float(oracle.evaluate(scene, 0.0, -0.5).value) == wanted


# -------------------------------------------------------------------------------------------------- ties of values


def assert_tied(scene: Scene, x: float, y: float) -> None:
    """The value is TIE and half an ulp: rounded up, in all ways to ask."""
    assert float(oracle.settle(scene, x, y)) == 1.0 + 2.0**-51
    answers = oracle.evaluate(scene, x, y)
    assert (float(answers.value), float(answers.residual)) == (1.0 + 2.0**-51, -(2.0**-53))
    balls = oracle.enclose(scene, x, y, bits=3000)
    exact = Fraction(TIE) + Fraction(1, 2**53)
    assert abs(balls.middle.item() - exact) <= balls.radius.item() <= Fraction(1, 2**2999)


def test_a_tie_of_diffuse_light_seen_in_a_mirror_goes_to_even() -> None:
    assert_tied(behind_the_floor(Phong(TIE, 2.0**-53, 0.0), DirectionalLight((0.0, 0.0, -3.0))), 0.0, -0.5)


@pytest.mark.parametrize("shininess", [0.0, 1.0, 37.5, 1e300])
def test_a_tie_in_the_middle_of_a_highlight_seen_in_a_mirror_goes_to_even(shininess: float) -> None:
    """The ray comes back along the axis and meets a sphere behind the eye, with the light right before it."""
    mirror = Sphere((0.0, 0.0, 0.0), 1.0, shade(0.0, 1.0))
    behind = Sphere((0.0, 0.0, 9.0), 1.0, Phong(TIE, 0.0, 2.0**-53, shininess))
    camera = Camera((0.0, 0.0, 4.0), half_height=1.0)
    assert_tied(Scene(camera, (mirror, behind), (PointLight((0.0, 0.0, 5.0)),), max_bounces=1), 0.0, 0.0)


def test_irrational_lights_that_add_up_to_a_tie_go_to_even() -> None:
    """D (l1 + l2) = 0: the roots in n.l1 and n.l2 cancel, and the two add up to 1."""
    grey = Sphere((0.5, 0.0, 1.25), 1.5, Phong(TIE, 2.0**-53, 0.0))
    lights = (DirectionalLight((-24.0, 0.0, 7.0)), DirectionalLight((0.0, 0.0, -1.0)))
    assert_tied(Scene(Camera((0.0, 0.0, 4.0), half_height=4.0), (grey,), lights), 3.0, 0.0)


def test_a_light_whose_fading_takes_the_root_out_again_is_a_tie_to_even() -> None:
    """n.l = 1 / sqrt(2) and 1 / l = 1 / sqrt(2): together 1 / 2."""
    wall = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), Phong(TIE, 2.0**-52, 0.0))
    camera = Camera((0.0, 0.0, 4.0), half_height=4.0)
    assert_tied(Scene(camera, (), (PointLight((1.0, 0.0, 1.0), 1.0, (0.0, 1.0, 0.0)),), 0.0, wall), 0.0, 0.0)


def test_a_gradient_whose_elevation_is_rational_is_a_tie_to_even() -> None:
    """D = (3, 0, -4) and up = (0, 0, 1): s = (1 - 4/5) / 2 = 1/10"""
    sky = Gradient(TIE, TIE + 10.0 * 2.0**-53, (0.0, 0.0, 1.0))
    assert_tied(Scene(Camera((0.0, 0.0, 4.0), half_height=4.0), (), (), sky), 3.0, 0.0)


def test_levels_are_rounded_on_the_true_value() -> None:
    """n.l = 3/5, so that 255 I + 1/2 is 77 exactly, which no float64 says; and a hair to either side of it."""
    wall = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), Phong(0.0, 0.5, 0.0))
    camera = Camera((0.0, 0.0, 4.0), half_height=4.0)
    for (lx, ly, lz), wanted in (((4.0, 0.0, 3.0), 77), ((4.0, 2.0**-300, 3.0), 76), ((4.0 - 2.0**-50, 0.0, 3.0), 77)):
        light = DirectionalLight((-lx, -ly, -lz))
        scene = Scene(camera, (), (light,), 0.0, wall)
        assert int(oracle.settle(scene, 0.3, 0.2, "uint8")) == wanted
        assert int(oracle.evaluate(scene, 0.3, 0.2).value8) == wanted
        lamp = PointLight((lx, ly, lz))
        ball_ = Sphere((0.0, 0.0, -1.0), 1.0, Phong(0.0, 0.5, 0.0))
        assert int(oracle.settle(Scene(camera, (ball_,), (lamp,)), 0.0, 0.0, "uint8")) == wanted
