"""Threads: any number of them gives the same bits, the GIL is released, and images may be drawn at once."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest
from evaluators import ACCURACIES, GEOMETRIES, same_bits, scene_of

from symrender_cg import evaluate, render_image
from symrender_cg.errors import ArgumentError
from symrender_cg.pipeline import compile_kernel
from symrender_cg.run import threads as pool
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.threads import (
    LEAST_PIXELS,
    MOST_BLOCKS,
    MOST_PIXELS,
    PIXELS_A_THREAD,
    block_ends,
    over_rows,
    thread_count,
)
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


@pytest.mark.parametrize("width", [1, 64, 1 << 14, 1 << 22])
@pytest.mark.parametrize("height", [1, 10, 4096])
@pytest.mark.parametrize("threads", [1, 2, 16])
def test_blocks_shrink_towards_the_end_and_are_neither_tiny_nor_huge(width: int, height: int, threads: int) -> None:
    blocks = block_ends(height, width, threads)
    assert [begin for begin, _ in blocks] + [height] == [0] + [end for _, end in blocks]
    rows = [end - begin for begin, end in blocks]
    assert all(after <= before for before, after in pairwise(rows))
    assert all(count * width <= max(MOST_PIXELS, width) for count in rows)
    assert all(count * width >= min(LEAST_PIXELS, MOST_PIXELS) for count in rows[:-1]) or width == 1
    assert len(blocks) <= 2 * MOST_BLOCKS * threads + height * width // MOST_PIXELS + (
        height if width > MOST_PIXELS else 0
    )


def makespan(cost: np.ndarray, blocks: tuple[tuple[int, int], ...], wakes: list[float]) -> float:
    """When the last block is done if each thread takes the next one as soon as it is free, first when it wakes."""
    free = list(wakes)
    for begin, end in blocks:
        thread = free.index(min(free))
        free[thread] += float(cost[begin:end].sum())
    return max(free)


ROWS = np.linspace(-1.25, 1.25, 512)
COSTS: dict[str, np.ndarray] = {
    "a sphere in the middle": 0.1 + np.sqrt(np.maximum(0.0, 1.0 - ROWS**2)),
    "the same in each row": np.ones(512),
    "all at the bottom": 0.02 + (ROWS > 0.75),
    "all at the top": 0.02 + (ROWS < -0.75),
    "more and more": 0.05 + np.cumsum(np.ones(512)) / 256,
    "many small spheres": 0.1 + np.random.default_rng(3).uniform(0.0, 1.0, 512),
}


@pytest.mark.parametrize(
    ("threads", "side", "most"), [(2, 512, 1.015), (4, 512, 1.08), (2, 2048, 1.015), (8, 2048, 1.04)]
)
@pytest.mark.parametrize("profile", COSTS)
def test_rows_of_unequal_cost_are_balanced(profile: str, threads: int, side: int, most: float) -> None:
    """The last block is done soon after the time of an even share, also where threads wake late; `most` was measured.
    Where the first or the last fifth of the rows is all there is to draw, it takes at most a quarter longer.

    Waking takes a twentieth of a thread's share; the caller draws meanwhile. Halves would take up to twice the time.
    """
    cost = np.repeat(COSTS[profile], side // 512)
    share = float(cost.sum()) / threads
    late = 0.05 * share
    blocks = block_ends(side, side, threads)
    most = 1.25 if profile.startswith("all at") else most
    assert makespan(cost, blocks, [0.0] * threads) < most * share
    assert makespan(cost, blocks, [0.0] + [late] * (threads - 1)) < most * share + late


def test_one_thread_draws_an_ordinary_image_in_one_call() -> None:
    seen: list[tuple[int, int]] = []
    over_rows(lambda begin, end: seen.append((begin, end)), 1024, 1, width=1024)
    assert seen == [(0, 1024)]


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize("at", [0, 50, 99])
def test_an_error_in_any_thread_reaches_the_caller_when_nobody_draws_any_more(threads: int, at: int) -> None:
    drawing, begun = [0], [0]
    guard = threading.Lock()

    def render(begin: int, end: int) -> None:
        with guard:
            drawing[0] += 1
            begun[0] += 1
        try:
            time.sleep(2e-3)
            if begin <= at < end:
                raise ZeroDivisionError(f"{begin} {end}")
        finally:
            with guard:
                drawing[0] -= 1

    with pytest.raises(ZeroDivisionError):
        over_rows(render, 100, threads)
    assert drawing[0] == 0
    after = begun[0]
    time.sleep(0.02)
    assert begun[0] == after


def test_an_interrupt_of_the_caller_waits_for_the_other_threads() -> None:
    """The array is the caller's again when the call is over, however it ends."""
    caller, at_it, released, drawing = threading.get_ident(), threading.Event(), threading.Event(), [0]

    def render(begin: int, end: int) -> None:
        if threading.get_ident() == caller:
            at_it.wait(10.0)
            threading.Timer(0.05, released.set).start()
            raise KeyboardInterrupt
        drawing[0] += 1
        at_it.set()
        released.wait(10.0)
        drawing[0] -= 1

    with pytest.raises(KeyboardInterrupt):
        over_rows(render, 100, 2)
    assert released.is_set()
    assert drawing[0] == 0


@pytest.fixture
def fresh_pool() -> Iterator[None]:
    pool._pool.cache_clear()
    yield
    pool._pool.cache_clear()


def test_threads_are_kept_and_taken_again(fresh_pool: None) -> None:
    def count() -> int:
        return sum(thread.name == "symrender_cg" for thread in threading.enumerate())

    before = count()
    for _ in range(60):
        over_rows(lambda begin, end: time.sleep(1e-5), 64, 3)
    assert count() == before + 2


def test_a_thread_that_never_wakes_is_not_waited_for(fresh_pool: None, monkeypatch: pytest.MonkeyPatch) -> None:
    asleep, serve = threading.Event(), pool._Worker._serve

    def late(self: pool._Worker) -> None:
        asleep.wait(10.0)
        serve(self)

    monkeypatch.setattr(pool._Worker, "_serve", late)
    seen: list[tuple[int, int]] = []
    caller = threading.get_ident()
    for _ in range(3):
        seen.clear()
        over_rows(lambda begin, end: seen.append((begin, threading.get_ident())), 100, 4)
        assert [begin for begin, _ in seen] == [begin for begin, _ in block_ends(100, 1, 4)]
        assert {thread for _, thread in seen} == {caller}
    assert len(pool._pool()._idle) == 3
    asleep.set()

    def slow(begin: int, end: int) -> None:
        seen.append((begin, threading.get_ident()))
        time.sleep(1e-3)

    for _ in range(200):  # who was called in vain finds no work, and then serves as ever
        over_rows(slow, 100, 4)
        if {thread for _, thread in seen} != {caller}:
            return
    raise AssertionError("no other thread ever drew a block")


def test_a_call_from_within_a_thread_s_block_is_drawn_too() -> None:
    seen = np.zeros((8, 50), dtype=np.int64)
    guard = threading.Lock()

    def inner(row: int, begin: int, end: int) -> None:
        with guard:
            seen[row, begin:end] += 1

    def outer(begin: int, end: int) -> None:
        for row in range(begin, end):
            over_rows(lambda first, last, row=row: inner(row, first, last), 50, 3)  # type: ignore[misc]

    over_rows(outer, 8, 3)
    assert (seen == 1).all()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_forked_process_draws_by_a_pool_of_its_own() -> None:
    program = (
        "import os, numpy as np\n"
        "from symrender_cg import render_image\n"
        "image = render_image(None, 300, 300, threads=3)\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    os._exit(0 if (render_image(None, 300, 300, threads=3) == image).all() else 1)\n"
        "raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


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
        time.sleep(0.01)  # whoever waits for the GIL by the old interval gets it now
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
