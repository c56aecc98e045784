"""Boxes of steep highlights: where they are, which pixels they hold, and the bits of images that have one."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from evaluators import modest, same_bits
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from test_hand_over import STEEP, random_one_sphere

from symrender_cg import Scene, evaluate, render_batch, render_blocks, render_image
from symrender_cg.cli.main import main
from symrender_cg.lower.variants import MOST_ROUNDOFFS, variant
from symrender_cg.pipeline import draw, pixel_size, planned, settling_kernel, statistics
from symrender_cg.run import batch, steep_rows, target
from symrender_cg.run import threads as threads_of_rows
from symrender_cg.run.box_pixels import BOX, box_pixels
from symrender_cg.run.certify import settle_by_oracle
from symrender_cg.run.grid import pixel_centres
from symrender_cg.run.kernel import GRID
from symrender_cg.run.levels import hands_over, steep_part
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.settling_kernel import SettlingKernel
from symrender_cg.run.settling_many import enclosed_many
from symrender_cg.run.steep import MOST_OF_PICTURE, Box, boxes_drawn, roundoffs, steep_box, steep_boxes
from symrender_cg.scene import Camera, Phong, PointLight, Sphere
from symrender_cg.stress.families import FAMILIES

GLOSSY = Scene.chapter1(shininess=300.0)
FROM_BELOW = Scene.chapter1(light=(-3.0, -6.0, 10.0), shininess=100.0)


def boxed_scenes(count: int) -> list[Scene]:
    found = (random_one_sphere(seed) for seed in range(10_000))
    boxed = [scene for _, scene in zip(range(30 * count), found, strict=False) if steep_part(scene, 1.0) is not None]
    assert len(boxed) >= count
    return boxed[:count]


def zoomed(scene: Scene, share: float, aside: tuple[float, float] = (0.0, 0.0)) -> Scene:
    """The scene with a frame of that part of its usual half-height, its sphere and its light moved aside."""
    frame = scene.in_camera_frame()
    sphere, light = frame.spheres[0], frame.lights[0]
    assert isinstance(light, PointLight)
    assert frame.camera.half_height is not None

    def moved(at: tuple[float, float, float]) -> tuple[float, float, float]:
        return at[0] + aside[0], at[1] + aside[1], at[2]

    camera = Camera((0.0, 0.0, frame.camera.eye[2]), half_height=share * frame.camera.half_height)
    ball = Sphere(moved(sphere.center), sphere.radius, sphere.material)
    return Scene(camera, (ball,), (PointLight(moved(light.position), light.intensity),))


def by_points(scene: Scene, width: int, height: int, clip: bool) -> NDArray[np.float64]:
    """The image, by the plain kernel and that of `stable` at the centres of pixels."""
    box = steep_part(scene, width / height)
    x, y = np.meshgrid(*pixel_centres(width, height, pixel_size(scene.in_camera_frame(), height)))
    plain = render_image(scene, width, height, accuracy=variant("double"), clip=clip)
    if box is not None and (inside := box.holds(x, y)).any():
        plain[inside] = evaluate(scene, x[inside], y[inside], accuracy="stable", clip=clip)
    return plain


# ---- which pixels


@given(
    st.floats(-3.0, 3.0), st.floats(0.0, 2.0), st.floats(-3.0, 3.0), st.floats(0.0, 2.0),
    st.integers(1, 40), st.integers(1, 40), st.floats(1e-3, 1.0), st.sampled_from((None, "left", "right", "both")),
)  # fmt: skip
@modest(300)
def test_pixels_of_a_box_are_those_whose_centres_lie_in_it(
    left: float, across: float, bottom: float, up: float, width: int, height: int, pixel: float, on: str | None
) -> None:
    """Its edges may pass through centres exactly."""
    columns, rows = pixel_centres(width, height, pixel)
    right, top = left + across, bottom + up
    if on in ("left", "both"):
        left = columns[width // 3]
        right = max(left, right)
        bottom = rows[height // 2]
        top = max(bottom, top)
    if on in ("right", "both"):
        right = max(left, columns[width // 2])
        top = max(bottom, rows[height // 3])
    grid = np.array([(width, height, pixel, 1.0)], dtype=GRID)
    found = box_pixels(Box(left, right, bottom, top).edges, grid)[0]
    inside = Box(left, right, bottom, top).holds(*np.meshgrid(columns, rows))
    drawn = np.zeros((height, width), dtype=bool)
    drawn[found["row_begin"] : found["row_end"], found["column_begin"] : found["column_end"]] = True
    assert np.array_equal(drawn, inside)
    assert found["grid"] == grid[0]


def test_boxes_far_away_and_boxes_that_are_none_have_no_pixels() -> None:
    edges = np.array([[1e300, 2e300, 0.0, 1.0], [-2.0, -1.5, -1.0, 1.0], [np.nan] * 4, [-1e308, 1e308, -1e308, 1e308]])
    found = box_pixels(edges, np.full(4, np.array((8, 6, 1e-200, 1.0), dtype=GRID)))
    counts = (found["column_end"] - found["column_begin"]) * (found["row_end"] - found["row_begin"])
    assert counts.tolist() == [0, 0, 0, 48]


def test_the_boxes_of_many_scenes_have_the_bits_of_each_alone() -> None:
    scenes = [random_one_sphere(seed) for seed in range(400)] + list(STEEP.values())
    numbers = [numbers_of(planned(scene).scene) for scene in scenes]
    columns = {name: np.array([each[name] for each in numbers]) for name in numbers[0]}
    together, drawn = steep_boxes(columns), boxes_drawn(columns)
    found = 0
    for each, edges, needed in zip(numbers, together, drawn, strict=True):
        box = steep_box(each)
        alone = np.full((1, 4), np.nan) if box is None else box.edges
        assert same_bits(edges[np.newaxis], alone)
        plain = bool(roundoffs(each) <= MOST_ROUNDOFFS)
        assert same_bits(needed, np.full(4, np.nan) if plain else edges)
        found += box is not None and not plain
    assert found > 20


def test_a_box_holds_a_highlight_that_is_narrower_than_what_is_known_of_its_middle() -> None:
    """Exponents up to 1e100, at points of the highlight: no value of `double` is off by more than it promises."""
    boxed = 0
    (family,) = (entry for entry in FAMILIES if entry.name == "n_huge")
    for case in family.cases(1, 60):
        boxed += steep_part(case.scene, 1.0) is not None
        values = [float(evaluate(case.scene, case.x, case.y, accuracy=level)) for level in ("double", "stable")]
        assert abs(values[0] - values[1]) <= 1e-15 * max(1.0, values[1]), case
    assert boxed > 5


def test_a_box_over_most_of_the_spheres_picture_leaves_the_scene_to_stable_whatever_the_window() -> None:
    """A light from the side stretches the box of a sphere that is seen from near."""

    def seen_from(distance: float) -> Scene:
        ball, light = Sphere(material=Phong(0.1, 0.3, 1.0, shininess=20.0)), PointLight((6.6, 4.5, 1.6))
        return Scene(Camera((0.0, 0.0, distance)), (ball,), (light,))

    far, near = seen_from(2.0), seen_from(1.45)
    assert steep_part(far) is not None
    assert steep_part(near) is None
    for aspect in (None, 0.5, 1.0, 2.0):
        assert hands_over(near, aspect)
        assert not hands_over(far, aspect)
    for scene in boxed_scenes(30):
        box = steep_part(scene, 1.0)
        numbers = numbers_of(planned(scene).scene)
        assert box is not None
        e, radius = numbers["eye"], numbers["radius"]
        z, aside = (e - numbers["center_z"]) / radius, np.hypot(numbers["center_x"], numbers["center_y"]) / radius
        angle, half = np.arctan2(aside, z), np.arcsin(1.0 / np.hypot(z, aside))
        long_axis = 0.5 * e * (np.tan(angle + half) - np.tan(angle - half))
        across = np.sin(half) / np.sqrt(np.cos(angle + half) * np.cos(angle - half))
        share = (box.right - box.left) * (box.top - box.bottom) / (np.pi * long_axis * e * across)
        assert share <= MOST_OF_PICTURE * (1.0 + 1e-9)


# ---- images

PLACES = {
    "in the middle": GLOSSY,
    "over the whole image": zoomed(GLOSSY, 0.01, (-0.2545, -0.2545)),
    "at the right edge and the top": zoomed(GLOSSY, 0.2),
    "at the left edge and the bottom": zoomed(GLOSSY, 0.2, (-0.42, -0.42)),
    "outside": zoomed(GLOSSY, 0.1),
    "off the axis": STEEP["off the axis"],
    "over the silhouette": Scene(
        Camera((0.0, 0.0, 4.0)),
        (Sphere((0.3, -0.2, 0.1), 1.0, Phong(0.0, 0.7, 0.5, 41.0)),),
        (PointLight((9.0, 3.0, 2.0)),),
    ),
}


ON_THE_SILHOUETTE = Scene(
    Camera((0.0, 0.0, 4.0), half_height=1e-7),
    (Sphere((1.0, 0.0, 0.0), 1.0, Phong(0.1, 0.3, 1.0, 41.0)),),
    (PointLight((-3.0, 0.5, -1.0)),),
)
"""The axis touches the sphere, in its steep highlight: so close to the silhouette the kernel settles nothing."""


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("clip", [False, True])
def test_a_box_anywhere_has_the_bits_of_stable_and_the_rest_those_of_the_plain_kernel(place: str, clip: bool) -> None:
    scene = PLACES[place]
    width, height = 61, 48
    assert steep_part(scene, width / height) is not None
    wanted = by_points(scene, width, height, clip)
    assert same_bits(render_image(scene, width, height, clip=clip), wanted)
    columns, rows = pixel_centres(width, height, pixel_size(scene.in_camera_frame(), height))
    box = steep_part(scene, width / height)
    assert box is not None
    inside = box.holds(*np.meshgrid(columns, rows))
    assert inside.all() == ("whole" in place)
    assert inside.any() == (place != "outside")
    assert inside[[0, -1]].any() == ("edge" in place or "whole" in place)


def test_images_of_random_scenes_have_the_bits_of_their_points() -> None:
    for k, scene in enumerate(boxed_scenes(24)):
        width, height = 20 + 3 * k, 60 - 2 * k
        assert same_bits(render_image(scene, width, height), by_points(scene, width, height, True))


@pytest.mark.parametrize("threads", [1, 2])
def test_pixels_that_the_kernel_leaves_open_are_settled_on_any_number_of_threads(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[int] = []
    settled = steep_rows.BoundBox.settle

    def counted(self: steep_rows.BoundBox, image: Any, first: int, places: Any) -> None:
        left.append(len(places))
        settled(self, image, first, places)

    monkeypatch.setattr(steep_rows, "BOX_PIXELS", 512)
    monkeypatch.setattr(steep_rows.BoundBox, "settle", counted)
    image = render_image(ON_THE_SILHOUETTE, 96, 90, threads=threads)
    assert sum(left) > 0.4 * image.size
    assert 0.3 < np.count_nonzero(image) / image.size < 0.7
    assert same_bits(image, by_points(ON_THE_SILHOUETTE, 96, 90, True))
    assert same_bits(render_batch(None, [ON_THE_SILHOUETTE], 96, 90, threads=threads)[0], image)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_any_part_of_an_image_has_its_bits_on_any_number_of_threads(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sub-rows, strided rows, rows through another array; boxes shared by the threads of the pool."""
    monkeypatch.setattr(steep_rows, "BOX_PIXELS", 16)
    for scene in (GLOSSY, STEEP["off the axis"], PLACES["over the whole image"], PLACES["over the silhouette"]):
        wanted = by_points(scene, 150, 140, True)
        assert same_bits(render_image(scene, 150, 140, threads=threads), wanted)
        wide = np.zeros((140, 200))
        render_image(scene, 150, 140, out=wide[:, 25:175], threads=threads)
        assert same_bits(np.ascontiguousarray(wide[:, 25:175]), wanted)
        assert not wide[:, :25].any()
        assert not wide[:, 175:].any()
        turned = np.zeros((140, 300))
        render_image(scene, 150, 140, out=turned[::-1, ::2], threads=threads)
        assert same_bits(np.ascontiguousarray(turned[::-1, ::2]), wanted)
        for some in (1, 7, 64):
            blocks = dict(render_blocks(scene, 150, 140, block_rows=some, threads=threads))
            assert same_bits(np.concatenate([blocks[row] for row in sorted(blocks)]), wanted)


def test_rows_folded_in_the_middle_have_the_bits_of_the_image() -> None:
    """The array is a part of memory, and rows are taken in any order."""
    for scene, height in ((GLOSSY, 61), (GLOSSY, 60), (FROM_BELOW, 61), (FROM_BELOW, 60), (ON_THE_SILHOUETTE, 20)):
        drawing = draw(scene, "double", size=(50, height), clip=True)
        image = np.full((height, 50), np.nan)
        rows = drawing.onto(image)
        assert isinstance(rows, steep_rows.SteepRows)
        folded = rows.folded(0, height)
        assert (folded is None) == (rows.rows.pairs is None)
        if folded is not None:
            for begin, end in ((7, height - height // 2), (0, 3), (3, 7)):
                folded(begin, end)
            assert same_bits(image, render_image(scene, 50, height))
        assert rows.folded(1, height) is None


@pytest.mark.parametrize("threads", [1, 2])
def test_images_of_more_than_the_most_pixels_have_the_same_bits(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = [render_image(scene, 150, 141) for scene in (GLOSSY, FROM_BELOW)]
    monkeypatch.setattr(threads_of_rows, "MOST_PIXELS", 4096)
    monkeypatch.setattr(steep_rows, "BOX_PIXELS", 16)
    threads_of_rows.block_ends.cache_clear()
    try:
        for scene, image in zip((GLOSSY, FROM_BELOW), wanted, strict=True):
            assert same_bits(render_image(scene, 150, 141, threads=threads), image)
    finally:
        threads_of_rows.block_ends.cache_clear()


def test_an_image_without_a_pixel_of_its_box_asks_for_no_second_kernel(tmp_path: Any) -> None:
    before = statistics.compiled
    render_image(PLACES["outside"], 16, 12, cache=tmp_path)
    assert statistics.compiled - before <= 1
    render_image(PLACES["in the middle"], 16, 12, cache=tmp_path)
    assert statistics.compiled - before == 2


def test_what_is_bound_to_an_image_is_looked_up_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[object] = []

    def counted(*given: Any) -> Any:
        calls.append(given)
        return box_pixels(*given)

    monkeypatch.setattr(steep_rows, "box_pixels", counted)
    scene = Scene.chapter1(shininess=301.0)
    images = [render_image(scene, 64, 64) for _ in range(3)]
    assert len(calls) == 1
    assert same_bits(images[0], images[2])


# ---- the kernel's own box


@pytest.mark.parametrize(("level", "target_of"), [("stable", None), ("certified", "float32"), ("certified", "uint8")])
@pytest.mark.parametrize("scene", [GLOSSY, STEEP["off the axis"], PLACES["over the silhouette"]])
def test_a_box_of_a_settling_kernel_writes_its_pixels_alone_and_lists_those_that_it_leaves(
    level: str, target_of: str | None, scene: Scene
) -> None:
    found = settling_kernel(scene, variant(level, target_of), aspect=1.0)
    assert found is not None
    kernel, frame = found
    size, pixel = 40, pixel_size(frame, 40)
    numbers = kernel.numbers(numbers_of(frame))
    whole = np.zeros((size, size), dtype=kernel.dtype)
    left = kernel.settle_rows(whole, numbers, pixel=pixel, white=1.0, begin=0, end=size)
    images = np.full((1, size, size), 77, dtype=kernel.dtype)
    boxes = np.array([((size, size, pixel, 1.0), 5, 38, 3, 31)], dtype=BOX)
    given = np.array([[numbers_of(frame)[name] for name in kernel.inputs]])
    rows = kernel.settle_boxes(images, given, boxes)
    listed = np.concatenate([rows(0, 11), rows(11, 12), rows(12, size)])
    inside = np.zeros((size, size), dtype=bool)
    inside[3:31, 5:38] = True
    assert (images[0][~inside] == 77).all()
    assert inside.reshape(-1)[listed].all()
    known = inside.copy()
    known.reshape(-1)[np.concatenate([listed, left])] = False
    assert known.sum() > 500
    assert same_bits(images[0][known], whole[known])
    assert len(set(listed.tolist())) == listed.size
    assert listed.size <= inside.sum() // 4


def test_pixels_that_the_kernel_leaves_are_those_of_the_enclosure_and_the_oracle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the kernel leaves all of its box, image and batch have the same values nonetheless."""
    wanted = render_image(GLOSSY, 40, 40, clip=False)
    drawing = draw(GLOSSY, "double", size=(40, 40))
    assert drawing.box is not None
    begin, end = int(drawing.box.pixels.column_begin), int(drawing.box.pixels.column_end)
    places = [row * 40 + i for row in range(drawing.box.begin, drawing.box.end) for i in range(begin, end)]
    image = wanted.copy()
    image.reshape(-1)[places] = np.nan
    drawing.box.settle(image, 0, np.array(places, dtype=np.intp))
    assert same_bits(image, wanted)
    asked: list[int] = []

    def nothing_known(*given: Any) -> Any:
        return [(values * 0.0, known & False) for values, known in enclosed_many(*given)]

    def counted(job: Any, width: int, height: int, left: Any) -> Any:
        asked.append(left.size)
        return settle_by_oracle(job, width, height, left)

    monkeypatch.setattr(target, "enclosed_many", nothing_known)
    monkeypatch.setattr(target, "settle_by_oracle", counted)

    def all_left(self: SettlingKernel, images: Any, numbers: Any, boxes: Any) -> Any:
        height, pixels = images.shape[1], np.array(places, dtype=np.intp)

        def rows(begin: int, end: int) -> Any:
            every = np.concatenate([k * height * 40 + pixels for k in range(len(images))])
            return every[(every >= begin * 40) & (every < end * 40)]

        return rows

    monkeypatch.setattr(SettlingKernel, "settle_boxes", all_left)
    found = render_batch(None, [GLOSSY, GLOSSY], 40, 40, clip=False)
    assert asked == [len(places)] * 2
    assert same_bits(found, np.stack([wanted, wanted]))


# ---- batches


def test_sets_with_and_without_boxes_are_drawn_in_one_call_of_each_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    n = np.random.default_rng(3).uniform(8.0, 200.0, 64)
    render_batch(None, {"spheres.0.material.shininess": [60.0, 30.0]}, 24, 20)
    calls: list[tuple[str, int]] = []
    for holder, name in ((SettlingKernel, "settle_boxes"), (SettlingKernel, "settle_many")):
        plain = getattr(holder, name)

        def counted(self: Any, images: Any, *given: Any, plain: Any = plain, name: str = name) -> Any:
            calls.append((name, len(images)))
            return plain(self, images, *given)

        monkeypatch.setattr(holder, name, counted)
    before = statistics.planned
    found = render_batch(None, {"spheres.0.material.shininess": n}, 24, 20)
    assert calls == [("settle_boxes", 64)]
    assert statistics.planned - before <= 4
    for k in range(64):
        assert same_bits(found[k], render_image(Scene.chapter1(shininess=n[k]), 24, 20))


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("clip", [False, True])
def test_a_batch_of_random_steep_scenes_has_the_bits_of_its_images(threads: int, clip: bool) -> None:
    scenes = [*boxed_scenes(12), Scene.chapter1(), *STEEP.values(), *PLACES.values()]
    for width, height in ((33, 21), (1, 1)):
        found = render_batch(None, scenes, width, height, threads=threads, clip=clip)
        assert same_bits(found, np.stack([render_image(each, width, height, clip=clip) for each in scenes]))
    strided = np.zeros((len(scenes), 21, 66))
    render_batch(None, scenes, 33, 21, out=strided[..., ::2], threads=threads, clip=clip)
    assert same_bits(
        np.ascontiguousarray(strided[..., ::2]), render_batch(None, scenes, 33, 21, threads=threads, clip=clip)
    )


def test_progress_of_a_batch_with_boxes_counts_each_image_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "SECONDS_BETWEEN", 0.0)
    told: list[tuple[int, int]] = []
    scenes = [Scene.chapter1(shininess=n) for n in np.linspace(30.0, 90.0, 10)] + [Scene.builtin("two_spheres")] * 20
    render_batch(None, scenes, 16, 16, threads=2, progress=lambda *counts: told.append(counts))
    assert told == sorted(told)
    assert told[-1] == (30, 30)
    assert told.count((30, 30)) == 1


# ---- explain


def test_explain_says_where_the_highlight_is_steep_and_who_draws_it(capsys: pytest.CaptureFixture[str]) -> None:
    def explained(*words: str) -> str:
        assert main(["explain", *words]) == 0
        return capsys.readouterr().out

    steep, matte = "off_axis", "chapter1"
    box = steep_part(Scene.builtin(steep), 1.0)
    assert box is not None
    lines = [line for line in explained(steep, "--size", "64x64").splitlines() if "drawn by" in line]
    assert len(lines) == 1
    assert f"{box.left:.4g} <= x <= {box.right:.4g}" in lines[0]
    assert "6 x 6 of 64 x 64 pixels" in lines[0]
    assert "off_axis_sphere_stable" in lines[0]
    data = json.loads(explained(steep, "--json"))["steep"]
    assert (data["top"], data["kernel"]) == (box.top, "off_axis_sphere_stable")
    assert "steep" not in explained(matte)
    assert json.loads(explained(matte, "--json"))["steep"] is None
    assert json.loads(explained(steep, "--json", "--accuracy", "stable"))["steep"] is None
