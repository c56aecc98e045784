"""Laws of the pair rules, each against many points or rays, and of the findings that are told about them.

A rule that leaves out a pair is wrong if one sample contradicts it; a control counts that it leaves out many.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from arranged import draw
from scene_strategies import random_scene, scene_points

from symrender_cg.plan import effects
from symrender_cg.plan import plan as planning
from symrender_cg.plan.arrangement import arrange
from symrender_cg.plan.examination import examine, look
from symrender_cg.plan.lamps import caps_apart
from symrender_cg.plan.measures import Measures, measure
from symrender_cg.plan.mirrors import below_horizon
from symrender_cg.plan.plan import plan
from symrender_cg.plan.shadows import misses_sphere
from symrender_cg.plan.visibility import hidden
from symrender_cg.reference import brute_force
from symrender_cg.scene import Camera, DirectionalLight, Phong, Plane, PointLight, Scene, Sphere
from symrender_cg.scene.random import random_spheres

Floats = npt.NDArray[np.float64]
CAMERA = Camera((0.0, 0.0, 4.0), half_height=2.0)
LEAKY, GATED = Phong(shininess=2.0), Phong(shininess=2.0, gate_specular=True)


def unit_vectors(random: np.random.Generator, count: int) -> Floats:
    v = random.normal(size=(count, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1)[:, np.newaxis])


def two_spheres(random: np.random.Generator, *, directional: bool) -> tuple[Measures, Scene]:
    """Two spheres and a light of sizes and distances that often almost touch, seen from (0, 0, 4)."""
    while True:
        centers = random.normal(size=(2, 3)) * random.choice([0.3, 1.0, 2.0])
        radii = np.exp(random.normal(size=2) * 0.8 - 0.7)
        if (np.linalg.norm(centers - (0.0, 0.0, 4.0), axis=1) > radii).all():
            break
    towards = random.normal(size=3)
    if random.random() < 0.5:
        towards = centers[1] - centers[0] + 0.3 * towards
    place = centers[0] + towards * float(random.choice([0.5, 1.0, 3.0]))
    light: Any = PointLight(vector(place)) if not directional else DirectionalLight(vector(-towards))
    spheres = tuple(Sphere(vector(c), float(r), LEAKY) for c, r in zip(centers, radii, strict=True))
    frame = Scene(CAMERA, spheres, (light,))
    return measure(frame), frame


def vector(v: Floats) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in v)
    return x, y, z


@pytest.mark.parametrize("directional", [False, True])
@pytest.mark.parametrize("leaking", [False, True])
def test_a_blocker_left_out_darkens_no_point(directional: bool, leaking: bool) -> None:
    """Points all over A; only those that face the light where the lamp's terms need it."""
    random = np.random.default_rng(11 + directional)
    left_out = 0
    for _ in range(700):
        measures, _ = two_spheres(random, directional=directional)
        if not misses_sphere(measures, 0, np.array([0]), np.array([1]), np.array([leaking, leaking]))[0]:
            continue
        left_out += 1
        n = unit_vectors(random, 400)
        point = measures.center[0] + measures.radius[0] * n
        way = np.broadcast_to(measures.at[0], point.shape) if directional else measures.at[0] - point
        distance = np.linalg.norm(way, axis=1)
        way = way / distance[:, np.newaxis]
        m = measures.center[1] - point
        along = np.einsum("ij,ij->i", m, way)
        ends = along if directional else np.minimum(along, distance)
        nearest = np.linalg.norm(m - np.maximum(ends, 0.0)[:, np.newaxis] * way, axis=1)
        meets = nearest < measures.radius[1] * (1.0 - 1e-12)
        if not leaking:
            meets &= np.einsum("ij,ij->i", n, way) > 0.0
        assert not meets.any()
    assert left_out > 150


def test_caps_that_are_apart_have_no_point_in_common() -> None:
    random = np.random.default_rng(13)
    apart = 0
    for number in range(600):
        measures, _ = two_spheres(random, directional=number % 3 == 0)
        if not caps_apart(measures, 0, np.array([0]), np.array([True]))[0]:
            continue
        apart += 1
        n = unit_vectors(random, 2000)
        point = measures.center[0] + measures.radius[0] * n
        to_eye = np.array((0.0, 0.0, measures.eye)) - point
        to_light = measures.at[0] - (0.0 * point if measures.directional[0] else point)
        assert not ((np.einsum("ij,ij->i", n, to_eye) > 0.0) & (np.einsum("ij,ij->i", n, to_light) > 0.0)).any()
    assert apart > 60


def test_a_sphere_below_the_horizon_is_in_no_mirrored_ray() -> None:
    random = np.random.default_rng(17)
    below = 0
    for _ in range(900):
        measures, _ = two_spheres(random, directional=False)
        if not below_horizon(measures, np.array([0]), np.array([1]))[0]:
            continue
        below += 1
        n = unit_vectors(random, 1500)
        point = measures.center[0] + measures.radius[0] * n
        d = point - np.array((0.0, 0.0, measures.eye))
        visible = np.einsum("ij,ij->i", n, d) < 0.0
        r = d - 2.0 * np.einsum("ij,ij->i", n, d)[:, np.newaxis] * n
        r /= np.linalg.norm(r, axis=1)[:, np.newaxis]
        m = measures.center[1] - point
        along = np.einsum("ij,ij->i", m, r)
        aside = np.linalg.norm(m - along[:, np.newaxis] * r, axis=1)
        assert not (visible & (along > 0.0) & (aside < measures.radius[1] * (1.0 - 1e-12))).any()
    assert below > 60


def test_a_hidden_sphere_is_behind_its_hider_on_every_ray() -> None:
    random = np.random.default_rng(19)
    covered = 0
    for _ in range(600):
        measures, frame = two_spheres(random, directional=False)
        m = measures.m[0] * random.uniform(1.0, 3.0) + random.normal(size=3) * 0.1
        center = vector((m + np.array((0.0, 0.0, measures.eye))) * measures.unit)
        behind = Sphere(center, float(random.uniform(0.05, 0.6)))
        if np.linalg.norm(np.array(behind.center) - (0.0, 0.0, 4.0)) <= behind.radius:
            continue
        measures = measure(Scene(CAMERA, (frame.spheres[0], behind), ()))
        if not hidden(measures, np.arange(2))[1]:
            continue
        covered += 1
        target = measures.center[1] + measures.radius[1] * unit_vectors(random, 500)
        d = target - np.array((0.0, 0.0, measures.eye))
        square = np.einsum("ij,ij->i", d, d)
        along = d @ measures.m[0]
        disc = along**2 - square * (measures.distance[0] ** 2 - measures.radius[0] ** 2)
        assert (disc > 0.0).all()
        assert ((along - np.sqrt(np.maximum(disc, 0.0))) / square < 1.0).all()
    assert covered > 60


def test_the_smaller_power_of_the_eye_is_in_front_of_a_disjoint_sphere() -> None:
    """Every ray to a point of the sphere with the larger power meets the other one, if at all, before it."""
    random = np.random.default_rng(23)
    for _ in range(300):
        measures, frame = two_spheres(random, directional=False)
        found = arrange(frame, aspect=None)
        if found.visible < 2 or found.partners.size:
            continue
        first, second = found.spheres[:2].tolist()
        d = measures.m[second] + measures.radius[second] * unit_vectors(random, 500)
        square, along = np.einsum("ij,ij->i", d, d), d @ measures.m[first]
        disc = along**2 - square * (measures.distance[first] ** 2 - measures.radius[first] ** 2)
        hits = (disc > 0.0) & (along > 0.0)
        near = (along - np.sqrt(np.maximum(disc, 0.0))) / square
        assert (near[hits] < 1.0 + 1e-12).all()


# -------------------------------------------------------------------------------------------- what a sphere inside does


def leak(material: Phong, blocker_inside: bool) -> tuple[Scene, Floats, Floats]:
    """A sphere with a light inside it, and in that, if wanted, a small sphere about the light's way."""
    inner = (Sphere((0.4, 0.0, -0.2), 0.3, material),) if blocker_inside else ()
    frame = Scene(CAMERA, (Sphere((0.0, 0.0, 0.0), 1.0, material), *inner), (PointLight((0.0, 0.0, -0.9)),))
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(-1.0, 1.0, 41))
    return frame, x.ravel(), y.ravel()


def test_a_sphere_inside_another_blocks_a_highlight_that_leaks_through_it() -> None:
    """An ungated highlight shines through; what is inside may keep it, so that it is a blocker though never seen."""
    frame, x, y = leak(LEAKY, True)
    open_frame, _, _ = leak(LEAKY, False)
    found = arrange(frame, aspect=None)
    assert (found.visible, len(found.blockers), found.spheres.tolist()) == (1, 1, [0, 1])
    with_inner, without = (brute_force.trace(it, x, y).value for it in (frame, open_frame))
    assert np.abs(with_inner - without).max() > 0.01
    assert np.abs(draw(frame, found, x, y).value[0] - with_inner).max() < 1e-12
    gated, _, _ = leak(GATED, True)
    assert len(arrange(gated, aspect=None).lamp_light) == 0


def test_a_shadow_outside_the_window_is_kept_where_a_mirror_shows_the_plane() -> None:
    """The sphere and its shadow are left of the window; the sphere in it mirrors them."""
    floor = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), GATED)
    aside = Sphere((-6.0, 0.0, 0.0), 1.0, GATED)
    lights = (PointLight((0.0, 6.0, 0.0)),)
    for reflect, kept in ((0.0, 0), (1.0, 1)):
        ball = Sphere((0.0, 0.0, 0.0), 0.9, Phong(gate_specular=True, reflect=reflect))
        frame = Scene(CAMERA, (ball, aside), lights, 0.0, floor, max_bounces=1)
        found = arrange(frame, aspect=1.0)
        begin = found.blockers_begin[found.lamps_begin[len(found.spheres)] :]
        blockers = {int(found.spheres[k]) for k in found.blockers[begin[0] : begin[1]]}
        assert (1 in blockers) == kept
        x, y = scene_points(frame, 200, 3)
        x, y = np.clip(x, -1.9, 1.9), np.clip(y, -1.9, 1.9)
        assert np.abs(draw(frame, found, x, y).value[0] - brute_force.trace(frame, x, y).value).max() < 1e-9


def test_a_mirror_shows_the_lit_side_that_the_eye_does_not_see() -> None:
    """The light is behind the sphere, and beside it is a mirror: the light is left out without it, needed with it."""
    sphere = Sphere((0.0, 0.0, 1.0), 0.5, GATED)
    for reflect, lit in ((0.0, 0), (1.0, 1)):
        mirror = Sphere((1.6, 0.0, -1.2), 0.9, Phong(0.1, 0.0, 0.0, reflect=reflect))
        frame = Scene(CAMERA, (sphere, mirror), (PointLight((0.6, 0.0, -0.1)),))
        found = arrange(frame, aspect=None)
        assert len(found.lamp_light) == lit
        x, y = np.meshgrid(np.linspace(-1.9, 1.9, 31), np.linspace(-1.9, 1.9, 31))
        true = brute_force.trace(frame, x.ravel(), y.ravel()).value
        assert np.abs(draw(frame, found, x.ravel(), y.ravel()).value[0] - true).max() < 1e-9
        assert (true.max() > 0.2) == bool(lit)


def test_without_shadows_there_are_no_blockers_and_no_dark_lights() -> None:
    for seed in range(60):
        frame = random_scene(seed).in_camera_frame()
        if not frame.shadows:
            assert arrange(frame, aspect=1.0).blockers.size == 0


# ------------------------------------------------------------------------------------------------------------ findings


def test_every_effect_has_findings_and_a_tally() -> None:
    names = [entry.name for entry in effects.EFFECTS]
    assert len(set(names)) == len(names)
    found = examine(look(random_scene(1).in_camera_frame(), aspect=1.0), 0.0)
    for entry in effects.EFFECTS:
        assert all(finding.reason for finding in entry.find(found)), entry.name
        assert entry.tally(found).reason, entry.name


KEPT: dict[str, Callable[[Any], int]] = {
    "order": lambda found: len(found.partners),
    "shadow": lambda found: len(found.blockers),
    "lights": lambda found: len(found.lamp_light),
    "diffuse": lambda found: int(found.lamp_diffuse.sum()),
    "specular": lambda found: int(found.lamp_specular.sum()),
    "mirror_depth": lambda found: found.bounces,
}


def test_findings_are_what_the_arrangement_has() -> None:
    """As many needed subjects as the arrangement has entries; each one absent has a reason, none a negative margin."""
    absent = 0
    for seed in range(80):
        found = plan(random_scene(seed), force=("scene",), aspect=1.0)
        arrangement = found.arrangement
        assert arrangement is not None
        for name, kept in KEPT.items():
            assert sum(finding.needed for finding in found.findings(name)) == kept(arrangement), (seed, name)
        seen = [finding.needed for finding in found.findings("mirror") if " in " in finding.subject]
        assert sum(seen) == len(arrangement.mirrors) + int(arrangement.mirror_plane.sum())
        for decision in found.decisions:
            subjects = effects.effect(decision.effect.name).tally(found.examination).subjects
            assert subjects == len(found.findings(decision.effect.name)), (seed, decision)
            for finding in found.findings(decision.effect.name):
                assert finding.reason
                assert finding.status in ("needed", "absent"), (seed, finding)
                if finding.status == "absent" and finding.margin is not None:
                    assert finding.margin >= 0.0, (seed, finding)
                    absent += 1
            if decision.status == "absent" and decision.margin is not None:
                margins = [f.margin for f in found.findings(decision.effect.name) if f.status == "absent"]
                assert decision.margin == min(m for m in margins if m is not None)
    assert absent > 1000


def test_subjects_are_named_by_their_place_in_the_scene() -> None:
    found = plan(Scene.builtin("hidden"), aspect=1.0)
    told = {finding.subject: finding for finding in found.findings("shadow")}
    assert told["spheres[5] on spheres[0] from lights[0]"].status == "needed"
    finding = told["spheres[3] on spheres[0] from lights[0]"]
    assert finding.status == "absent"
    assert finding.reason.startswith("behind: power of the light")
    told = {finding.subject: finding for finding in found.findings("hidden")}
    assert "hidden by spheres[0]: gamma" in told["spheres[3]"].reason
    assert "inside spheres[0]" in told["spheres[4]"].reason


def test_of_very_many_findings_the_last_one_says_how_many_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "MOST_FINDINGS", 100)
    found = plan(random_spheres(20, 1), aspect=1.0)
    told = found.findings("order")
    assert len(told) == 101
    visible = found.arrangement.visible if found.arrangement is not None else 0
    assert told[-1].reason == f"and {visible * (visible - 1) // 2 - 100} more, not written out"


# ------------------------------------------------------------------------------------------------------------ tolerance


@pytest.mark.parametrize("max_error", [1e-3, 0.02, 0.3])
def test_what_a_tolerance_leaves_out_changes_no_pixel_by_more_than_its_bound(max_error: float) -> None:
    """Measured over 600 scenes: up to 0.98 of the tolerance is used."""
    bounded = 0
    for seed in range(60):
        frame = random_scene(seed).in_camera_frame()
        found = plan(frame, force=("scene",), aspect=1.0, max_error=max_error)
        assert found.arrangement is not None
        assert found.bound <= max_error
        x, y = scene_points(frame, 80, seed)
        inside = (np.abs(x) < (frame.camera.half_height or 0.0)) & (np.abs(y) < (frame.camera.half_height or 0.0))
        x, y = x[inside], y[inside]
        true = brute_force.trace(frame, x, y)
        value = np.atleast_2d(true.value if true.value.ndim == 1 else true.value.T)
        error = np.abs(value - draw(found.scene, found.arrangement, x, y).value).max(axis=0, initial=0.0)
        assert error[true.doubt > 1e-9].max(initial=0.0) <= found.bound + 1e-9, seed
        told = {d.effect.name for d in found.decisions if d.bound is not None}
        assert bool(told) == (found.bound > 0.0)
        for name in told & {"diffuse", "specular", "lights"}:
            bounds = [f.bound for f in found.findings(name) if f.status == "bounded" and f.bound is not None]
            assert all(0.0 < bound <= max_error for bound in bounds)
        bounded += bool(told)
    assert bounded > 0


def test_without_a_tolerance_nothing_is_bounded() -> None:
    for seed in range(30):
        found = plan(random_scene(seed), force=("scene",))
        assert found.bound == 0.0
        assert all(decision.status != "bounded" for decision in found.decisions)


def test_a_tolerance_spends_the_smallest_contributions_first() -> None:
    def lamps(max_error: float) -> list[int]:
        lights = tuple(PointLight((3.0, float(k), 9.0), 0.01 * 2.0**k) for k in range(4))
        matte = Phong(0.1, 1.0, 0.0)
        frame = Scene(CAMERA, (Sphere(material=matte), Sphere((2.0, 0.0, 0.0), 0.5, matte)), lights)
        found = plan(frame, aspect=1.0, max_error=max_error)
        assert found.arrangement is not None
        first = int(np.flatnonzero(found.arrangement.spheres == 0)[0])
        begin, end = found.arrangement.lamps_begin[first : first + 2]
        return sorted(found.arrangement.lamp_light[begin:end].tolist())

    assert lamps(0.0) == [0, 1, 2, 3]
    assert lamps(0.011) == [1, 2, 3]
    assert lamps(0.031) == [2, 3]
    assert lamps(0.0299) == [1, 2, 3]


def test_a_mirror_is_followed_as_deep_as_the_tolerance_asks() -> None:
    mirror = Phong(0.1, 0.0, 0.0, reflect=0.1)
    spheres = (Sphere((-1.0, 0.0, 0.0), 0.5, mirror), Sphere((1.0, 0.0, 0.0), 0.5, mirror))
    frame = Scene(CAMERA, spheres, (), 0.5)

    def bounces(max_error: float) -> int:
        found = plan(frame, max_error=max_error).arrangement
        assert found is not None
        return found.bounces

    assert [bounces(e) for e in (0.0, 1e-4, 1e-3, 1e-2, 0.1)] == [4, 3, 2, 1, 0]


def test_an_effect_that_is_forced_in_is_not_bounded() -> None:
    found = plan(random_scene(1), force=("scene", "lights", "mirror_depth"), max_error=10.0)
    assert found.bound == 0.0


def test_an_examination_is_made_of_what_was_looked_at() -> None:
    frame = random_scene(5).in_camera_frame()
    views = look(frame, aspect=1.0)
    found = examine(views)
    assert found.views.visible.tolist() == views.visible.tolist()
    assert found.budget is None
    assert found.lamps is found.lamps_before
