"""The float references: the seed's own numbers, the stable form's bounds, exact hits, point sets, and the measure."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import image_points, nasty_scenes, ordinary_scenes, scaled

from symrender_cg.errors import ArgumentError, SceneError
from symrender_cg.reference import decisions, hard_places, oracle, points, stable_tiles
from symrender_cg.reference.camera_numbers import frame_numbers
from symrender_cg.reference.compare import Errors, measure
from symrender_cg.reference.oracle import Answers
from symrender_cg.reference.per_pixel import evaluate_per_pixel, render_per_pixel
from symrender_cg.reference.points import pixel_centres, whole_image
from symrender_cg.reference.vectorised import evaluate_vectorised, render_vectorised
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

U = 2.0**-53


def with_material(scene: Scene, material: Phong) -> Scene:
    sphere = scene.spheres[0]
    return Scene(scene.camera, (Sphere(sphere.center, sphere.radius, material),), scene.lights, scene.background)


def mask(scene: Scene) -> Scene:
    """The scene that is 1 where the sphere is hit and 0 elsewhere."""
    flat = with_material(scene, Phong(1.0, 0.0, 0.0, 1.0))
    return Scene(flat.camera, flat.spheres, flat.lights, 0.0)


def radii_over_nearest_light(scene: Scene) -> float:
    """R / min |w| over the surface: what the error of w / |w| grows with."""
    f = frame_numbers(scene)
    distance = math.dist(f.light, f.center) if max(map(abs, f.light)) < 1e150 else 1e150
    return f.radius / max(abs(distance - f.radius), 2.0**-60 * f.radius)


# ------------------------------------------------------------------------------------------------ the seed's facts


def cell_1(x: float, y: float) -> float:
    """The inner loop of the seed's render_numeric, as printed; Chapter 1's scene."""
    R, e, ka, kd, ks, shin = 1.0, 4.0, 0.1, 0.7, 0.5, 32.0
    E, L = np.array([0.0, 0.0, e]), np.array((5.0, 5.0, 10.0))
    D = np.array([x, y, -e])
    A = float(D @ D)
    b = float(E @ D)
    c = e * e - R * R
    disc = b * b - A * c
    if disc < 0.0:
        return 0.0
    t = (-b - np.sqrt(disc)) / A
    P = E + t * D
    N = P / R
    w = L - P
    w_hat = w / np.linalg.norm(w)
    v_hat = (E - P) / np.linalg.norm(E - P)
    ndl = float(N @ w_hat)
    r = 2.0 * ndl * N - w_hat
    rdv = float(r @ v_hat)
    return float(ka + kd * max(0.0, ndl) + ks * max(0.0, rdv) ** shin)


def cell_4(X: npt.NDArray[np.float64], Y: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The body of the seed's render_numeric_vec, as printed, before the clip; Chapter 1's scene."""
    R, e, light, ka, kd, ks, shin = 1.0, 4.0, (5.0, 5.0, 10.0), 0.1, 0.7, 0.5, 32.0
    A = X**2 + Y**2 + e**2
    disc = e**2 * R**2 - (e**2 - R**2) * (X**2 + Y**2)
    hit = disc >= 0
    sq = np.sqrt(np.maximum(disc, 0))
    t = (e**2 - sq) / A
    Px, Py, Pz = t * X, t * Y, e * (1 - t)
    Nx, Ny, Nz = Px / R, Py / R, Pz / R
    Lx, Ly, Lz = light
    wx, wy, wz = Lx - Px, Ly - Py, Lz - Pz
    wn = np.sqrt(wx**2 + wy**2 + wz**2)
    ndl = (Nx * wx + Ny * wy + Nz * wz) / wn
    va = np.sqrt(A)
    vx, vy, vz = -X / va, -Y / va, e / va
    rdv = 2 * ndl * (Nx * vx + Ny * vy + Nz * vz) - (wx * vx + wy * vy + wz * vz) / wn
    return np.where(hit, ka + kd * np.maximum(0, ndl) + ks * np.maximum(0, rdv) ** shin, 0.0)


def test_the_per_pixel_reference_is_cell_1_bit_for_bit() -> None:
    x, y = whole_image(Scene.chapter1(), 40, 40)
    seed = np.array([cell_1(u, v) for u, v in zip(x.tolist(), y.tolist(), strict=True)])
    assert (seed > 0).sum() > 700
    np.testing.assert_array_equal(evaluate_per_pixel(Scene.chapter1(), x, y), seed)


def test_the_literal_form_is_cell_4_bit_for_bit() -> None:
    x, y = whole_image(Scene.chapter1(), 128, 128)
    np.testing.assert_array_equal(evaluate_vectorised(Scene.chapter1(), x, y, form="literal"), cell_4(x, y))


def test_chapter_1_has_the_seed_s_facts_at_256() -> None:
    per_pixel = render_per_pixel(Scene.chapter1(), 256, 256, clip=False)
    literal = render_vectorised(Scene.chapter1(), 256, 256, form="literal", clip=False)
    assert 1e-15 < np.abs(per_pixel - literal).max() < 1e-13  # measured 5.2e-14
    for image in (per_pixel, literal, render_vectorised(Scene.chapter1(), 256, 256, clip=False)):
        assert (image > 1.0).sum() == 399
        assert round(float(image.max()), 4) == 1.2537
        assert (image == 0.0).sum() == 32608
    clipped = render_vectorised(Scene.chapter1(), 256, 256)
    assert clipped.max() == 1.0
    np.testing.assert_array_equal(clipped, np.clip(render_vectorised(Scene.chapter1(), 256, 256, clip=False), 0, 1))
    np.testing.assert_array_equal(render_per_pixel(Scene.chapter1(), 9, 7).shape, (7, 9))


def test_off_the_axis_the_two_seed_forms_agree_to_their_rounding() -> None:
    scene = Scene(
        Camera((0.0, 0.0, 5.0), half_height=2.0),
        (Sphere((0.75, -0.5, 0.25), 1.0, Phong(0.1, 0.7, 0.5, 8.0, gate_specular=True)),),
        (PointLight((3.0, 2.0, 1.0), 0.5),),
        0.25,
    )
    x, y = whole_image(scene, 48, 48)
    per_pixel, literal = (
        evaluate_per_pixel(scene, x, y),
        evaluate_vectorised(scene, x, y, form="literal"),
    )
    assert np.abs(per_pixel - literal).max() < 1e-12  # measured 1.1e-14
    assert np.abs(per_pixel - oracle.evaluate(scene, x, y).value).max() < 1e-12  # measured 9.6e-15
    assert (per_pixel == 0.25).any()


def test_pixel_centres_mirror_exactly_and_are_the_seed_s_to_two_ulp_of_the_half_extent() -> None:
    scene = Scene.chapter1()
    half = frame_numbers(scene).half_height
    for size in (1, 2, 5, 256):
        x, y = pixel_centres(scene, size, size)
        np.testing.assert_array_equal(x, -x[::-1])
        np.testing.assert_array_equal(y, x[::-1])
        seed = np.linspace(-half + half / size, half - half / size, size)
        assert np.abs(x - seed).max() <= 2 * np.spacing(half)  # measured 1.5, of which linspace has its share
    wide_x, wide_y = pixel_centres(scene, 20, 10)
    assert wide_x.shape == (20,)
    assert np.diff(wide_x).max() == pytest.approx(-np.diff(wide_y).min(), rel=1e-14)


# --------------------------------------------------------------------------------------------- the stable form


def families(seed: int) -> list[tuple[str, Scene]]:
    """One scene of each kind: ordinary, the eye near or far, off the axis, beside the eye, scaled, the light far."""
    random = np.random.default_rng(seed)
    radius = float(random.uniform(0.5, 2.0))
    material = Phong(
        float(random.choice([0.0, 0.1])), 0.7, 0.5, float(random.choice([1, 2, 8, 37.5, 200])), bool(seed % 2)
    )

    def scene(eye: float, offset: npt.ArrayLike, light: float, half_height: float, k: int = 0) -> Scene:
        center = np.array([0.0, 0.0, eye]) + np.asarray(offset, dtype=np.float64) * radius
        direction = random.normal(size=3)
        position = center + direction / np.linalg.norm(direction) * radius * light
        made = Scene(
            Camera((0.0, 0.0, eye), half_height=half_height),
            (Sphere(tuple(map(float, center)), radius, material),),
            (PointLight(tuple(map(float, position))),),
        )
        return scaled(made, k)

    def decades(low: float, high: float) -> float:
        return float(10.0 ** random.uniform(low, high))

    def aside(x: float, y: float, depth: float) -> tuple[float, float, float]:
        return x, y, -depth

    near, far, ratio = 1.0 + decades(-15, -1), decades(3, 12), float(random.uniform(2.0, 9.0))
    turn = random.uniform(0.0, 2.0 * math.pi)
    flank = aside(2.0 * math.cos(turn), 2.0 * math.sin(turn), decades(-9, 0) * (-1.0) ** seed)
    off = aside(float(random.uniform(-1, 1)), float(random.uniform(-1, 1)), ratio)
    return [
        ("centred", scene(radius * ratio, aside(0.0, 0.0, ratio), decades(0.1, 1.5), 1.5 * radius)),
        ("off the axis", scene(radius * ratio, off, decades(0.1, 1.5), 3.0 * radius)),
        ("off the axis and far", scene(1.0, aside(0.3 * far, -0.4 * far, far), decades(0.1, 1.5), 0.6)),
        ("eye near", scene(radius * near, aside(0.0, 0.0, near), decades(0.1, 1.5), 3.0 * radius)),
        ("eye far", scene(radius * far, aside(0.0, 0.0, far), decades(0.1, 1.5), 1.2 * radius)),
        ("beside the eye", scene(radius * ratio, flank, decades(0.1, 1.5), 20.0 * radius)),
        ("scaled", scene(radius * ratio, off, decades(0.1, 1.5), 3.0 * radius, int(random.integers(-480, 480)))),
        ("light far", scene(radius * ratio, off, decades(10, 290), 3.0 * radius)),
        ("light inside", scene(radius * ratio, off, float(random.uniform(0, 0.9)), 3.0 * radius)),
    ]


def hard_points(scene: Scene, seed: int) -> points.Points:
    random = np.random.default_rng(seed)
    half = frame_numbers(scene).half_height
    sets = [
        hard_places.near_silhouette(scene, 45, seed),
        hard_places.near_terminator(scene, 30, seed),
        hard_places.near_highlight(scene, 30, seed),
        (random.uniform(-half, half, 45), random.uniform(-half, half, 45)),
    ]
    return np.concatenate([x for x, _ in sets]), np.concatenate([y for _, y in sets])


@pytest.mark.parametrize(
    ("dtype", "bound"),
    [
        (np.float64, 8e-15),  # measured 5.0e-15 over 150 scenes of each kind, 28,000 points each
        (np.float32, 2e-6),  # measured 1.3e-6
    ],
)
def test_the_stable_form_stays_within_its_bound_and_never_flips_a_hit(dtype: npt.DTypeLike, bound: float) -> None:
    for seed in range(6):
        for name, scene in families(seed):
            x, y = hard_points(scene, seed)
            answers = oracle.evaluate(scene, x, y)
            hit = evaluate_vectorised(mask(scene), x, y, dtype=dtype) == 1.0
            assert answers.hit.any(), name
            errors = measure(evaluate_vectorised(scene, x, y, dtype=dtype), answers)
            np.testing.assert_array_equal(hit, answers.hit, name)
            assert errors.nonfinite == 0, name
            assert errors.max_abs <= bound * (1.0 + radii_over_nearest_light(scene)), (name, seed, errors)


def test_the_literal_form_breaks_that_bound_on_the_same_points() -> None:
    worst = 0.0
    for _, scene in families(0):
        x, y = hard_points(scene, 0)
        worst = max(
            worst, measure(evaluate_vectorised(scene, x, y, form="literal"), oracle.evaluate(scene, x, y)).max_abs
        )
    assert worst > 1e-3


def test_the_stable_form_on_chapter_1_is_a_few_1e_16_off() -> None:
    x, y = whole_image(Scene.chapter1(), 96, 96)
    answers = oracle.evaluate(Scene.chapter1(), x, y)
    stable = measure(evaluate_vectorised(Scene.chapter1(), x, y), answers, hit=answers.hit)
    literal = measure(evaluate_vectorised(Scene.chapter1(), x, y, form="literal"), answers)
    assert stable.max_abs < 1.5e-15  # measured 7.4e-16
    assert literal.max_abs > 10 * stable.max_abs  # measured 2.0e-14
    assert stable.flips == literal.flips == 0


@pytest.mark.parametrize("shininess", [1e3, 1e6, 1e9, 1e12])
def test_the_stable_highlight_s_error_grows_with_the_root_of_the_shininess(shininess: float) -> None:
    for seed in range(4):
        scene = with_material(families(seed)[1][1], Phong(0.1, 0.7, 0.5, shininess))
        x, y = hard_places.near_highlight(scene, 60, seed)
        if x.size:
            answers = oracle.evaluate(scene, x, y)
            errors = measure(evaluate_vectorised(scene, x, y), answers)
            bound = (8e-15 + 16.0 * U * math.sqrt(shininess)) * (1.0 + radii_over_nearest_light(scene))
            assert errors.max_abs <= bound  # measured 2.5 u sqrt(n) at 1e12
            assert answers.value.max() > 0.3


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_hits_of_the_stable_form_are_the_oracle_s_on_nasty_scenes(data: st.DataObject) -> None:
    scene = data.draw(nasty_scenes())
    pairs = [data.draw(image_points(scene)) for _ in range(8)]
    x, y = (np.array(part) for part in zip(*pairs, strict=True))
    edge_x, edge_y = hard_places.near_silhouette(scene, 16, 0)
    x, y = np.append(x, edge_x), np.append(y, edge_y)
    truth = oracle.hits(scene, x, y)
    for dtype in (np.float64, np.float32):
        np.testing.assert_array_equal(evaluate_vectorised(mask(scene), x, y, dtype=dtype) == 1.0, truth)
        assert np.isfinite(evaluate_vectorised(scene, x, y, dtype=dtype)).all()


@settings(max_examples=30, deadline=None)
@given(scene=ordinary_scenes())
def test_ordinary_scenes_stay_within_the_bound(scene: Scene) -> None:
    sphere = scene.spheres[0]
    material = Phong(
        sphere.material.ambient, sphere.material.diffuse, sphere.material.specular, max(1.0, sphere.material.shininess)
    )
    scene = with_material(scene, material)
    try:
        x, y = whole_image(scene, 12, 12)
    except SceneError:
        return
    edge_x, edge_y = hard_places.near_silhouette(scene, 12, 0)
    x, y = np.append(x, edge_x), np.append(y, edge_y)
    errors = measure(evaluate_vectorised(scene, x, y), oracle.evaluate(scene, x, y))
    assert errors.max_abs <= 2e-14 * (1.0 + radii_over_nearest_light(scene))


def test_the_gate_is_decided_exactly_at_the_terminator() -> None:
    for seed in range(8):
        for index in (0, 1, 3, 4):
            scene = with_material(families(seed)[index][1], Phong(0.0, 0.0, 1.0, 0.0, gate_specular=True))
            x, y = hard_places.near_terminator(scene, 40, seed)
            truth = oracle.evaluate(scene, x, y)
            for dtype in (np.float64, np.float32):
                np.testing.assert_array_equal(evaluate_vectorised(scene, x, y, dtype=dtype), truth.value)


def test_scaling_all_lengths_by_a_power_of_two_changes_no_bit_of_the_stable_form() -> None:
    for name, scene in families(4)[:6]:
        x, y = hard_points(scene, 1)
        for dtype in (np.float64, np.float32):
            here = evaluate_vectorised(scene, x, y, dtype=dtype)
            for k in (-400, -1, 3, 400):
                there = evaluate_vectorised(scaled(scene, k), np.ldexp(x, k), np.ldexp(y, k), dtype=dtype)
                np.testing.assert_array_equal(here, there, f"{name} 2^{k}")


def test_an_image_has_the_bits_of_its_points_whatever_the_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    for _, scene in families(1)[:3]:
        image = render_vectorised(scene, 70, 50, clip=False)
        x, y = whole_image(scene, 70, 50)
        np.testing.assert_allclose(evaluate_vectorised(scene, x, y).reshape(50, 70), image, rtol=0.0, atol=4 * U)
        monkeypatch.setattr(stable_tiles, "CHUNK", 33)
        np.testing.assert_allclose(render_vectorised(scene, 70, 50, clip=False), image, rtol=0.0, atol=4 * U)
        monkeypatch.undo()


def test_points_far_out_on_the_plane_neither_overflow_nor_warn() -> None:
    x = np.array([1e300, -1e308, 0.0, 1e200, 5e-324, 0.0])
    y = np.array([1e300, 1e308, 1e250, -3.0, -5e-324, 0.0])
    for _, scene in families(2)[:7]:
        with np.errstate(all="raise"):
            value = evaluate_vectorised(mask(scene), x, y)
        np.testing.assert_array_equal(value == 1.0, oracle.hits(scene, x, y))


def test_a_light_exactly_at_the_hit_point_adds_nothing() -> None:
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=1.0), (Sphere(),), (PointLight((0.0, 0.0, 1.0)),))
    assert float(oracle.evaluate(scene, 0.0, 0.0).value) == 0.1
    assert evaluate_per_pixel(scene, 0.0, 0.0) == 0.1
    for form in ("literal", "stable"):
        assert evaluate_vectorised(scene, 0.0, 0.0, form=form) == 0.1  # type: ignore[arg-type]


def test_form_dtype_and_size_that_do_not_exist_are_refused() -> None:
    with pytest.raises(ArgumentError, match="form: 'fast'; expected 'literal' or 'stable'"):
        evaluate_vectorised(Scene(), 0.0, 0.0, form="fast")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="dtype: int64; expected float64 or float32"):
        evaluate_vectorised(Scene(), 0.0, 0.0, dtype=np.int64)
    with pytest.raises(ArgumentError, match="height: 0; expected a whole number of pixels"):
        render_vectorised(Scene(), 4, 0)
    with pytest.raises(ArgumentError, match=r"width: 2\.5"):
        render_per_pixel(Scene(), 2.5, 4)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------------ point sets


@pytest.mark.parametrize("make", [hard_places.near_silhouette, hard_places.near_terminator, hard_places.near_highlight])
def test_point_sets_are_a_function_of_scene_count_and_seed(make: object) -> None:
    assert callable(make)
    first, again, other = make(Scene(), 30, 5), make(Scene(), 30, 5), make(Scene(), 30, 6)
    assert first[0].dtype == first[1].dtype == np.float64
    assert first[0].shape == first[1].shape == (30,)
    np.testing.assert_array_equal(first, again)
    assert (first[0] != other[0]).any()
    assert make(Scene(), 0, 5)[0].shape == (0,)


def test_silhouette_points_lie_on_both_sides_down_to_neighbouring_floats() -> None:
    for name, scene in families(3):
        x, y = hard_places.near_silhouette(scene, 60, 1)
        nearest_x, nearest_y = x[::3], y[::3]
        hit = oracle.hits(scene, nearest_x, nearest_y)
        assert 0 < hit.sum() < hit.size, name
        around = [
            oracle.hits(scene, np.nextafter(nearest_x, tx), np.nextafter(nearest_y, ty))
            for tx, ty in ((np.inf, nearest_y), (-np.inf, nearest_y), (nearest_x, np.inf), (nearest_x, -np.inf))
        ]
        assert np.logical_or.reduce([other != hit for other in around]).all(), name


def test_terminator_points_have_small_n_dot_l_of_both_signs() -> None:
    for name, scene in families(3)[:5]:
        x, y = hard_places.near_terminator(scene, 120, 1)
        if not x.size:
            continue
        flat = with_material(scene, Phong(0.0, 1.0, 0.0))
        numbers = frame_numbers(scene)
        lit = np.array([decisions.exact_lit_test(numbers)(u, v, -numbers.eye) for u, v in zip(x, y, strict=True)])
        n_dot_l = oracle.evaluate(flat, x, y).value
        np.testing.assert_array_equal(lit, n_dot_l > 0.0)
        assert 0 < lit.sum() < lit.size, name
        assert n_dot_l.max() < 0.011, name
        if name != "off the axis and far":  # there the floats of the plane are further apart than that
            assert n_dot_l[lit].min() < 1e-14, name


def test_highlight_points_reach_the_whole_specular_term() -> None:
    found = 0
    for seed in range(6):
        scene = with_material(families(seed)[1][1], Phong(0.0, 0.0, 1.0, 50.0))
        x, y = hard_places.near_highlight(scene, 40, seed)
        if x.size:
            found += 1
            value = oracle.evaluate(scene, x, y).value
            assert value.max() > 1.0 - 1e-12
            assert value.min() < 0.9
    assert found >= 2


def test_sets_of_curves_that_cannot_be_seen_are_empty() -> None:
    inside = Scene(lights=(PointLight((0.0, 0.1, 0.2)),))
    assert hard_places.near_terminator(inside, 5, 0)[0].size == hard_places.near_highlight(inside, 5, 0)[0].size == 0
    behind = Scene(lights=(PointLight((0.0, 0.0, -5.0)),))
    assert hard_places.near_highlight(behind, 5, 0)[0].size == 0
    assert hard_places.near_silhouette(Scene(Camera(half_height=1.0), (Sphere((0.0, 0.0, 9.0)),)), 5, 0)[0].size == 0


# --------------------------------------------------------------------------------------------------------- compare


def answers_of(value: list[float], residual: list[float], hit: list[bool]) -> Answers:
    array = np.array(value)
    levels = np.floor(255.0 * array.clip(0.0, 1.0) + 0.5).astype(np.uint8)
    return Answers(array, np.array(residual), array.astype(np.float32), levels, np.array(hit, dtype=np.int64) - 1)


def test_measure_counts_ulps_flips_and_values_that_are_not_finite() -> None:
    answers = answers_of([1.0, 0.0, 0.5, 0.25, 0.0], [2.0**-54, 0.0, 0.0, 0.0, 0.0], [True, False, True, True, True])
    values = np.array([1.0 + 2.0**-51, 1e-3, 0.0, np.nan, 0.0])
    errors = measure(values, answers)
    assert errors.max_ulp == 2.0 - 0.25
    assert (errors.max_abs, errors.flips, errors.nonfinite, errors.count, errors.worst) == (0.5, 2, 1, 5, (3,))
    assert measure(values[:1], answers_of([1.0], [2.0**-54], [True])).worst == (0,)
    decided = measure(answers.value, answers, hit=[True, False, True, False, True])
    assert (decided.flips, decided.worst, decided.max_abs) == (1, (3,), 2.0**-54)
    assert measure(np.empty(0), answers_of([], [], [])) == Errors(0.0, 0.0, 0.0, 0, 0, 0, ())


def test_float32_values_are_measured_in_ulp_of_float32_against_the_float64_truth() -> None:
    answers = answers_of([1.0 + 2.0**-30], [0.0], [True])
    errors = measure(np.array([1.0 + 2.0**-23], dtype=np.float32), answers)
    assert errors.max_abs == 2.0**-23 - 2.0**-30
    assert errors.max_ulp == 1.0 - 2.0**-7


def test_measure_refuses_other_dtypes_and_shapes() -> None:
    answers = answers_of([1.0], [0.0], [True])
    with pytest.raises(ArgumentError, match="values: dtype int64; expected float64 or float32"):
        measure(np.array([1]), answers)
    with pytest.raises(ArgumentError, match=r"hit: shape \(2,\); expected that of the answers, \(1,\)"):
        measure(np.array([1.0]), answers, hit=[True, False])
