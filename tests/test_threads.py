"""Threads: any number of them gives the same bits, the GIL is released, and images may be drawn at once."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from evaluators import ACCURACIES, GEOMETRIES, same_bits, scene_of

from symrender_cg import evaluate, render_image
from symrender_cg.errors import ArgumentError
from symrender_cg.pipeline import compile_kernel
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.threads import PIXELS_A_THREAD, over_rows, thread_count
from symrender_cg.scene import Scene


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_any_number_of_threads_gives_the_same_bits(geometry: str, accuracy: str) -> None:
    scene = scene_of(geometry)
    one = render_image(scene, 61, 47, accuracy=accuracy, clip=False, threads=1)
    for threads in (2, 3, 7, 100):
        assert same_bits(render_image(scene, 61, 47, accuracy=accuracy, clip=False, threads=threads), one)


@pytest.mark.parametrize("height", [1, 2, 3, 5])
def test_an_image_of_few_rows_is_drawn_whole_by_many_threads(height: int) -> None:
    one = render_image(None, 300, height, threads=1)
    assert same_bits(render_image(None, 300, height, threads=16), one)


def test_rows_are_independent_of_how_they_are_cut() -> None:
    scene = scene_of("off_axis_sphere")
    kernel = compile_kernel(scene)
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None
    whole, pieces = np.full((2, 40, 33), math.nan)
    numbers, pixel = kernel.numbers(numbers_of(scene)), 2.0 * half_height / 40
    kernel.rows(whole, numbers, pixel=pixel, white=math.inf, begin=0, end=40)
    for begin, end in ((39, 40), (0, 1), (1, 17), (20, 20), (17, 39)):
        kernel.rows(pieces, numbers, pixel=pixel, white=math.inf, begin=begin, end=end)
    assert same_bits(whole, pieces)


def test_a_kernel_writes_the_rows_it_is_asked_for_and_no_others() -> None:
    scene = Scene.chapter1()
    kernel = compile_kernel(scene)
    image = np.full((10, 8), math.nan)
    kernel.rows(image, kernel.numbers(numbers_of(scene)), pixel=0.3, white=1.0, begin=3, end=5)
    assert np.isnan(np.delete(image, [3, 4], axis=0)).all()
    assert np.isfinite(image[3:5]).all()


@pytest.mark.parametrize("height", [1, 2, 7, 64, 1000])
@pytest.mark.parametrize("threads", [1, 2, 5, 64])
def test_blocks_cover_every_row_once(height: int, threads: int) -> None:
    seen = np.zeros(height, dtype=np.int64)
    guard = threading.Lock()

    def render(begin: int, end: int) -> None:
        with guard:
            seen[begin:end] += 1

    over_rows(render, height, threads)
    assert (seen == 1).all()


def test_an_error_in_a_thread_reaches_the_caller() -> None:
    def render(begin: int, end: int) -> None:
        raise ZeroDivisionError(f"{begin} {end}")

    with pytest.raises(ZeroDivisionError):
        over_rows(render, 100, 4)


def test_small_images_are_drawn_by_one_thread() -> None:
    assert thread_count(None, PIXELS_A_THREAD - 1) == 1
    assert thread_count(None, 0) == 1
    assert thread_count(5, 1) == 5
    assert thread_count(None, 1 << 40) >= thread_count(None, 2 * PIXELS_A_THREAD)


@pytest.mark.parametrize("threads", [0, -1, 1.0, "2", True])
def test_a_number_of_threads_that_is_none_is_refused(threads: object) -> None:
    with pytest.raises(
        ArgumentError, match=r"threads: .* is not a number of threads; expected a whole number from 1 up"
    ):
        render_image(None, 8, 8, threads=threads)  # type: ignore[arg-type]


def test_python_threads_draw_different_scenes_at_once() -> None:
    scenes = [scene_of(geometry, light=(x, 3.0, 5.0)) for geometry in GEOMETRIES for x in (-4.0, 0.0, 4.0)]
    alone = [render_image(scene, 200, 150, clip=False, threads=1) for scene in scenes]
    with ThreadPoolExecutor(len(scenes)) as pool:
        together = list(pool.map(lambda scene: render_image(scene, 200, 150, clip=False, threads=2), scenes * 4))
    assert all(same_bits(image, alone[k % len(scenes)]) for k, image in enumerate(together))


def test_threads_that_ask_first_at_once_share_one_kernel(tmp_path: object) -> None:
    start = threading.Barrier(6)

    def first_call(_: int) -> object:
        start.wait()
        return compile_kernel(Scene.chapter1(), cache=str(tmp_path))

    with ThreadPoolExecutor(6) as pool:
        kernels = list(pool.map(first_call, range(6)))
    assert all(kernel is kernels[0] for kernel in kernels)


def counted_during(call: Callable[[], object], attempts: int) -> list[int]:
    """How far another Python thread counts during each call, until it has once; the calling thread gives nothing away.

    The interpreter is kept from switching threads on its own, so that the other one counts only while `call` has
    released the GIL; it sleeps between its steps, so that the caller gets it back.
    """
    count, stop, running = [0], threading.Event(), threading.Event()

    def tick() -> None:
        while not stop.is_set():
            count[0] += 1
            running.set()
            time.sleep(1e-4)

    advanced: list[int] = []
    ticking, interval = threading.Thread(target=tick), sys.getswitchinterval()
    ticking.start()
    try:
        running.wait()
        sys.setswitchinterval(1000.0)
        while len(advanced) < attempts and not any(advanced):
            before = count[0]
            call()
            advanced.append(count[0] - before)
    finally:
        sys.setswitchinterval(interval)
        stop.set()
        ticking.join()
    return advanced


@pytest.mark.parametrize("entry", ["rows", "points"])
def test_the_gil_is_released_while_a_kernel_runs(entry: str) -> None:
    """A Python thread counts on while one C call draws; with the GIL held it could not take a single step."""
    scene = Scene.chapter1()
    kernel = compile_kernel(scene, "literal")
    numbers = kernel.numbers(numbers_of(scene))
    image = np.empty((1024, 1024))
    x, y = np.random.default_rng(1).uniform(-1.0, 1.0, (2, image.size))
    calls: dict[str, Callable[[], None]] = {
        "rows": lambda: kernel.rows(image, numbers, pixel=2.5 / 1024, white=1.0, begin=0, end=1024),
        "points": lambda: kernel.points(image.reshape(-1), x, y, numbers, white=1.0),
    }
    assert any(counted_during(calls[entry], 100))


def test_a_call_that_keeps_the_gil_is_told_from_one_that_does_not() -> None:
    """The control of the test above."""
    assert not any(counted_during(lambda: sum(range(20_000)), 50))
    assert any(counted_during(lambda: time.sleep(0.002), 50))


def test_a_spawned_process_draws_by_a_pool_of_its_own() -> None:
    """Nothing of the parent is needed: neither its pool nor its kernels."""
    import multiprocessing

    image = render_image(None, 64, 64, threads=3)
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        assert same_bits(pool.apply(render_image, (None, 64, 64), {"threads": 3}), image)


def test_points_are_drawn_alike_in_any_order() -> None:
    scene = scene_of("off_axis_sphere")
    x, y = np.random.default_rng(5).uniform(-2.0, 2.0, (2, 1000))
    order = np.random.default_rng(6).permutation(1000)
    assert same_bits(evaluate(scene, x, y)[order], evaluate(scene, x[order], y[order]))
