"""The pool of threads in C: every row once, balanced, no race; what becomes of it around forks, signals and exits."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from c_harness import COMPILERS, FLAGS, TEMPLATES
from evaluators import same_bits, scene_of

from symrender_cg import Scene, render_image
from symrender_cg.build.cache import Cache
from symrender_cg.errors import ArgumentError, CompileError
from symrender_cg.pipeline import draw
from symrender_cg.run import drawing, pool
from symrender_cg.run import threads as rows_over_threads
from symrender_cg.run.kernel import Kernel
from symrender_cg.run.pool import NativeRows, Pool, pool_beside, spin_microseconds
from symrender_cg.run.settling_kernel import SettlingRows
from symrender_cg.run.threads import over_rows

SOURCES = TEMPLATES / "pool"
C11 = (*(flag for flag in FLAGS if flag != "-std=c99"), "-std=c11", "-pthread", f"-I{SOURCES}")


def run_c(
    text: str, folder: Path, *, compiler: str = "gcc", extra: tuple[str, ...] = (), before: tuple[str, ...] = ()
) -> str:
    """What a C program prints that includes pool.c; it fails by a status that is not 0."""
    source, program = folder / "program.c", folder / "program"
    source.write_text(text)
    command = [compiler, *C11, *extra, "-o", str(program), str(source), "-lm"]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    done = subprocess.run([*before, str(program)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, f"{done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout


def the_pool() -> Pool:
    """The pool of this process."""
    found = pool_beside(draw(Scene.chapter1(), size=(8, 8)).kernel.library)
    assert found is not None, "there is a compiler, and pthreads"
    return found


@pytest.fixture
def without_pool(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(pool._found, "pool", None)


@pytest.fixture
def no_pool_yet(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "_found", {})


@pytest.fixture
def row_by_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small images are cut as finely as large ones are."""
    monkeypatch.setattr(NativeRows, "least_pixels", 1)
    monkeypatch.setattr(drawing.SceneRows, "least_pixels", 1)
    monkeypatch.setattr(SettlingRows, "least_pixels", 1)


STRESS = r"""
#include "pool.c"
#include <stdio.h>

enum { HEIGHT = 700, CALLERS = 3, CALLS = 300 };

/* Not atomic: two threads at one row, or a caller who goes on too early, is a race that the sanitizer sees. */
typedef struct { int times[HEIGHT]; } picture;

static void count_rows(void *image, ptrdiff_t stride, const void *grid, int begin, int end)
{
    (void)stride, (void)grid;
    for (int j = begin; j < end; ++j)
        ++((picture *)image)->times[j];
}

static ptrdiff_t list_rows(void *image, ptrdiff_t stride, const void *grid, const void *scene, int begin, int end,
    ptrdiff_t *unsettled)
{
    (void)scene;
    count_rows(image, stride, grid, begin, end);
    ptrdiff_t found = 0;
    for (int j = begin; j < end; ++j)
        if (j % 7 == 0)
            unsettled[found++] = 2 * j;
    return grid && begin <= 350 && 350 < end ? -1 : found;
}

static void *call_often(void *seed)
{
    unsigned random = *(unsigned *)seed;
    for (int k = 0; k < CALLS; ++k) {
        picture seen = {{0}};
        random = random * 1664525u + 1013904223u;
        const int begin = (int)(random >> 20) % 50, end = begin + (int)(random >> 8) % (HEIGHT - 50);
        const int least = 1 + (int)(random >> 16) % 9, threads = 1 + (int)(random >> 12) % 5;
        if (k % 2) {
            symrender_pool_baked(count_rows, &seen, 0, NULL, begin, end, least, threads);
        } else {
            ptrdiff_t unsettled[2 * HEIGHT], found[HEIGHT] = {0}, expected = 0, listed = 0;
            const bool fails = k % 8 == 0;
            const ptrdiff_t total = symrender_pool_listing(
                list_rows, &seen, 0, fails ? seed : NULL, NULL, begin, end, least, threads, unsettled, 2, found);
            for (int j = begin; j < end; ++j) {
                expected += j % 7 == 0;
                for (ptrdiff_t i = 0; i < found[j - begin]; ++i, ++listed)
                    if (unsettled[(j - begin) * 2 + i] % 14 != 0)
                        abort();
            }
            if (fails && begin <= 350 && 350 < end ? total != -1 : total != expected || listed != expected)
                abort();
        }
        for (int j = 0; j < HEIGHT; ++j)
            if (seen.times[j] != (begin <= j && j < end))
                abort();
    }
    return NULL;
}

int main(void)
{
    static const long long spins[] = {0, 2000, 100000};
    for (int s = 0; s < 3; ++s) {
        symrender_pool_set(spins[s], 1 + s);
        pthread_t callers[CALLERS];
        unsigned seeds[CALLERS];
        for (int i = 0; i < CALLERS; ++i) {
            seeds[i] = (unsigned)(17 * s + i);
            pthread_create(&callers[i], NULL, call_often, &seeds[i]);
        }
        for (int i = 0; i < CALLERS; ++i)
            pthread_join(callers[i], NULL);
    }
    printf("%d\n", symrender_pool_started());
    return 0;
}
"""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_every_row_is_drawn_once_whoever_calls_and_however_long_threads_look_out(compiler: str, tmp_path: Path) -> None:
    """Three callers at once, up to 5 threads each, random rows, listed pixels and failures among them."""
    started = int(run_c(STRESS, tmp_path, compiler=compiler))
    assert 4 <= started <= 12


def test_no_two_threads_touch_a_row_or_a_call_without_order(tmp_path: Path) -> None:
    """The same under the thread sanitizer."""
    plain = ("setarch", "-R") if shutil.which("setarch") else ()
    probe = tmp_path / "probe"
    probe.mkdir()
    try:
        run_c("int main(void) { return 0; }", probe, extra=("-fsanitize=thread",), before=plain)
    except AssertionError as problem:
        pytest.skip(f"no thread sanitizer here: {str(problem)[:80]}")
    run_c(STRESS.replace("CALLS = 300", "CALLS = 60"), tmp_path, extra=("-fsanitize=thread", "-g"), before=plain)


MEETING = r"""
#include "pool.c"
#include <stdio.h>

static atomic_int here;

static void rest(long microseconds)
{
    const struct timespec time = {.tv_nsec = 1000 * microseconds};
    nanosleep(&time, NULL);
}

/* Every row waits for the other two, those of the workers a while longer: the caller is then asleep, or looks out. */
static void meet(void *image, ptrdiff_t stride, const void *grid, int begin, int end)
{
    (void)stride, (void)grid;
    atomic_fetch_add(&here, end - begin);
    for (int k = 0; atomic_load(&here) < 3; ++k, rest(100))
        if (k == 200000)
            abort();
    if (!pthread_equal(pthread_self(), *(pthread_t *)image))
        rest(500);
}

int main(void)
{
    pthread_t caller = pthread_self();
    for (int k = 0; k < 60; ++k) {
        symrender_pool_set(k % 3 ? 0 : 50000, 3);
        atomic_store(&here, 0);
        symrender_pool_baked(meet, &caller, 0, NULL, 0, 3, 1, 3);
        rest(k % 2 ? 1000 : 0);
    }
    printf("%d\n", symrender_pool_started());
    return 0;
}
"""


def test_threads_that_sleep_wake_and_so_does_their_caller(tmp_path: Path) -> None:
    """Three rows wait for one another: if one thread slept on, no call would end."""
    assert run_c(MEETING, tmp_path) == "2\n"


SCHEDULE = r"""
#include "pool.c"
#include <stdio.h>

/* When the last row is done if each thread takes rows as soon as it is free: no thread runs here, only the schedule. */
static double makespan(const double *cost, int height, int least, int threads, double late)
{
    part parts[MOST_THREADS];
    job task = {.least = least, .threads = threads, .parts = parts};
    deal(&task, height);
    double free_at[MOST_THREADS], last = 0.0;
    for (int i = 0; i < threads; ++i)
        free_at[i] = i ? late : 0.0;
    for (;;) {
        int first = 0, begin, end;
        for (int i = 1; i < threads; ++i)
            if (free_at[i] < free_at[first])
                first = i;
        if (!take_own(&task, first, &begin, &end) && !take_over(&task, first, &begin, &end))
            break;
        for (int j = begin; j < end; ++j)
            free_at[first] += cost[j];
        last = free_at[first] > last ? free_at[first] : last;
    }
    return last;
}

int main(void)
{
    double cost[1 << 12];
    int height, least, threads;
    double late;
    while (scanf("%d %d %d %lf", &height, &least, &threads, &late) == 4) {
        for (int j = 0; j < height; ++j)
            if (scanf("%lf", &cost[j]) != 1)
                return 1;
        printf("%.9g\n", makespan(cost, height, least, threads, late));
    }
    return 0;
}
"""

ROWS = np.linspace(-1.25, 1.25, 512)
COSTS: dict[str, np.ndarray] = {
    "a sphere in the middle": 0.1 + np.sqrt(np.maximum(0.0, 1.0 - ROWS**2)),
    "the same in each row": np.ones(512),
    "all at the bottom": 0.02 + (ROWS > 0.75),
    "all at the top": 0.02 + (ROWS < -0.75),
    "more and more": 0.05 + np.cumsum(np.ones(512)) / 256,
    "many small spheres": 0.1 + np.random.default_rng(3).uniform(0.0, 1.0, 512),
}


@pytest.fixture(scope="module")
def makespan(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., float]:
    folder = tmp_path_factory.mktemp("schedule")
    run_c(SCHEDULE, folder)

    def measured(cost: np.ndarray, least: int, threads: int, late: float) -> float:
        numbers = f"{cost.size} {least} {threads} {late}\n" + " ".join(map(repr, cost.tolist()))
        done = subprocess.run([folder / "program"], input=numbers, capture_output=True, text=True, check=True)
        return float(done.stdout)

    return measured


@pytest.mark.parametrize(
    ("threads", "side", "most"), [(2, 512, 1.01), (4, 512, 1.03), (2, 2048, 1.003), (8, 2048, 1.02)]
)
@pytest.mark.parametrize("profile", COSTS)
def test_rows_of_unequal_cost_are_balanced(
    makespan: Callable[..., float], profile: str, threads: int, side: int, most: float
) -> None:
    """The last row is done soon after the time of an even share, also where threads wake late; `most` was measured.
    Where the first or the last tenth of the rows is all there is to draw, it takes at most a third longer.
    """
    cost = np.repeat(COSTS[profile], side // 512)
    share = float(cost.sum()) / threads
    late = 0.25 * share
    least = -(-pool.SPHERE_PIXELS // side)
    most = 1.33 if profile.startswith("all at") else most
    assert makespan(cost, least, threads, 0.0) < most * share
    assert makespan(cost, least, threads, late) < most * share + late


@pytest.mark.parametrize(
    ("accuracy", "bake"), [("single", False), ("double", False), ("double", True), ("stable", False)]
)
def test_the_pool_draws_a_sphere_as_one_thread_does(accuracy: str, bake: bool, row_by_row: None) -> None:
    scene = scene_of("off_axis_sphere")
    one = render_image(scene, 97, 61, accuracy=accuracy, bake=bake, clip=False, threads=1)
    for threads in (2, 3, 40, 1000):
        image = np.full((61, 97), np.nan, one.dtype)
        render_image(scene, 97, 61, accuracy=accuracy, bake=bake, clip=False, threads=threads, out=image)
        assert same_bits(image, one), threads


@pytest.mark.parametrize("name", ["two_spheres", "mirrors"])
@pytest.mark.parametrize("few", [1, 1 << 30])
def test_the_pool_draws_a_scene_as_one_thread_does(
    name: str, few: int, row_by_row: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also what rounding decided, settled in this thread or by threads of Python."""
    monkeypatch.setattr(drawing, "LEAST_SHARED", few)
    one = render_image(name, 48, 32, threads=1)
    for threads in (2, 5):
        assert same_bits(render_image(name, 48, 32, threads=threads), one)


def test_rows_of_a_part_of_an_image_are_drawn_where_they_belong(row_by_row: None) -> None:
    whole = render_image(None, 40, 60, threads=1)
    bound = draw(Scene.chapter1(), size=(40, 60), clip=True)
    for first, last in ((0, 60), (7, 60), (13, 14), (20, 41)):
        image = np.full((last - first, 40), np.nan)
        over_rows(bound.onto(image, first), last - first, 3, width=40, first=first)
        assert same_bits(image, np.ascontiguousarray(whole[first:last]))


def test_an_image_that_is_drawn_in_a_moment_wakes_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    def shared(*_: object) -> None:
        raise AssertionError("a call of the pool")

    monkeypatch.setattr(NativeRows, "share", shared)
    assert same_bits(render_image(None, 64, 64, threads=8), render_image(None, 64, 64, threads=1))
    with pytest.raises(AssertionError, match="a call of the pool"):
        render_image(None, 128, 64, threads=8)


def test_large_images_are_drawn_round_by_round(row_by_row: None, monkeypatch: pytest.MonkeyPatch) -> None:
    one, rounds = render_image(None, 64, 64, threads=1), []
    monkeypatch.setattr(rows_over_threads, "MOST_PIXELS", 64 * 5)
    share = NativeRows.share

    def noted(self: NativeRows, found: Pool, begin: int, end: int, least: int, threads: int) -> None:
        rounds.append((begin, end))
        share(self, found, begin, end, least, threads)

    monkeypatch.setattr(NativeRows, "share", noted)
    bound, image = draw(Scene.chapter1(), size=(64, 64), clip=True), np.full((64, 64), np.nan)
    over_rows(bound.onto(image), 64, 2, width=64)
    assert rounds == [(begin, min(begin + 5, 32)) for begin in range(0, 32, 5)], "folded: 32 rows of 128 pixels"
    assert same_bits(image, one)
    rounds.clear()
    over_rows(bound.onto(image[1:], 1), 63, 2, width=64, first=1)
    assert rounds == [(begin, min(begin + 10, 64)) for begin in range(1, 64, 10)], "a part of the image"
    assert same_bits(image, one)


def test_a_kernel_without_memory_says_which_rows(row_by_row: None, monkeypatch: pytest.MonkeyPatch) -> None:
    bound = draw(Scene.builtin("two_spheres"), size=(16, 16), clip=True)
    found = the_pool()
    fails = found.library.ffi.callback("symrender_listing_rows", lambda *_: -1)
    monkeypatch.setitem(found._listing, getattr(bound.kernel.library.lib, f"{bound.kernel.name}_rows"), fails)
    with pytest.raises(MemoryError, match="no memory for rows 0 to 16 of the image"):
        over_rows(bound.onto(np.zeros((16, 16))), 16, 2, width=16)


def test_without_the_pool_threads_of_python_draw_the_same(without_pool: None, row_by_row: None) -> None:
    for scene in (None, "two_spheres"):
        one = render_image(scene, 70, 50, threads=1)
        assert same_bits(render_image(scene, 70, 50, threads=3), one)


@pytest.mark.parametrize("problem", [CompileError(("cc",), 1, "pthread.h: No such file or directory"), OSError("no")])
def test_where_the_pool_cannot_be_compiled_nothing_else_fails(
    problem: Exception, no_pool_yet: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    one = render_image(None, 200, 200, cache=tmp_path, threads=1)

    def refused(*_: object, **__: object) -> None:
        raise problem

    monkeypatch.setattr(Cache, "kernel", refused)
    assert same_bits(render_image(None, 200, 200, cache=tmp_path, threads=2), one)
    assert pool._found == {"pool": None}


def test_a_cache_that_cannot_be_written_is_not_asked_for_the_pool(
    no_pool_yet: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """No warning, no temporary folder: the kernel is there, and only a thread would have woken faster."""
    one = render_image(None, 200, 200, cache=tmp_path, threads=1)
    monkeypatch.setattr(Cache, "problem", lambda _: "read-only file system")
    assert same_bits(render_image(None, 200, 200, cache=tmp_path, threads=2), one)
    assert pool._found == {"pool": None}


def test_the_pool_is_found_again_without_a_compiler(
    no_pool_yet: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    render_image(None, 200, 200, cache=tmp_path, threads=2)
    assert pool._found["pool"] is not None

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("it is in the cache")

    monkeypatch.setattr(pool, "_found", {})
    monkeypatch.setattr(Cache, "kernel", refused)
    render_image(None, 200, 200, cache=tmp_path, threads=2)
    assert pool._found["pool"] is not None


@pytest.mark.parametrize("text", ["-1", "soon", "nan", "inf"])
def test_a_time_to_look_out_that_is_none_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SYMRENDER_SPIN_MICROSECONDS", text)
    with pytest.raises(
        ArgumentError, match=r"SYMRENDER_SPIN_MICROSECONDS: .* is no time; expected microseconds from 0"
    ):
        spin_microseconds()


def test_the_time_to_look_out_is_a_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SYMRENDER_SPIN_MICROSECONDS", raising=False)
    assert spin_microseconds() == 100.0
    monkeypatch.setenv("SYMRENDER_SPIN_MICROSECONDS", " 2.5 ")
    assert spin_microseconds() == 2.5


def test_a_kernel_that_has_drawn_is_pickled_like_any_other() -> None:
    bound, image = draw(Scene.chapter1(), size=(8, 8), clip=True), np.empty((8, 8))
    over_rows(bound.onto(image), 8, 2, width=8)
    assert isinstance(bound.kernel, Kernel)
    again = pickle.loads(pickle.dumps(bound.kernel)).onto(other := np.empty((8, 8)), bound.numbers, bound.grid)
    over_rows(again, 8, 2, width=8)
    assert same_bits(image, other)


def until(condition: Callable[[], bool]) -> bool:
    """Whether it comes true; a slow machine gets half a minute."""
    for _ in range(3000):
        if condition():
            return True
        time.sleep(0.01)
    return False


def test_threads_that_have_drawn_go_to_sleep(row_by_row: None) -> None:
    found = the_pool()
    for _ in range(20):
        render_image(None, 64, 64, threads=3)
    assert found.started() >= 2
    assert until(lambda: found.awake() == 0)


def test_threads_are_kept_and_taken_again(row_by_row: None) -> None:
    render_image(None, 64, 64, threads=3)
    before = the_pool().started()
    for _ in range(60):
        render_image(None, 64, 64, threads=3)
    assert the_pool().started() == before


def test_python_threads_share_the_pool(row_by_row: None) -> None:
    scenes = [scene_of("centred_sphere", light=(x, 3.0, 5.0)) for x in (-4.0, 0.0, 4.0)]
    alone = [render_image(scene, 80, 60, threads=1) for scene in scenes]
    with ThreadPoolExecutor(6) as callers:
        drawn = list(callers.map(lambda k: render_image(scenes[k % 3], 80, 60, threads=1 + k % 4), range(200)))
    assert all(same_bits(image, alone[k % 3]) for k, image in enumerate(drawn))


def run_python(program: str, **environment: str) -> str:
    """What a program prints that ends well, and says nothing else."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, f"{done.returncode}: {done.stderr}"
    assert done.stderr == ""
    return done.stdout


BEGIN = """
import os, signal, sys, threading, time
from pathlib import Path
import numpy as np
from symrender_cg import Scene, render_image
from symrender_cg.run import pool
image = render_image(None, 400, 400, threads=3)
found = pool._found["pool"]
"""


@pytest.mark.parametrize("spin", ["0", "100", "1000000"])
def test_a_process_ends_while_threads_look_out(spin: str) -> None:
    assert run_python(f"{BEGIN}print(found.started())", SYMRENDER_SPIN_MICROSECONDS=spin) == "2\n"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.parametrize("spin", ["0", "1000000"])
@pytest.mark.filterwarnings("default")
def test_a_forked_process_starts_threads_of_its_own(spin: str) -> None:
    """Also while the parent's threads look out for more, and other threads of the parent draw."""
    program = f"""{BEGIN}
import warnings
warnings.simplefilter("ignore", DeprecationWarning)  # from Python 3.12 on: fork in a process of several threads
stop = threading.Event()
def draw():
    while not stop.is_set():
        render_image(None, 400, 400, threads=2)
other = threading.Thread(target=draw)
other.start()
for _ in range(20):
    child = os.fork()
    if child == 0:
        none = found.started() == 0 and found.awake() == 0
        same = all((render_image(None, 400, 400, threads=3) == image).all() for _ in range(3))
        os._exit(0 if none and same and found.started() == 2 else 1)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        print("a child failed")
    render_image(None, 400, 400, threads=3)
stop.set()
other.join()
print("done")
"""
    assert run_python(program, SYMRENDER_SPIN_MICROSECONDS=spin) == "done\n"


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no /proc")
def test_the_pool_s_threads_take_no_signal() -> None:
    """So that an interrupt always reaches a thread that Python runs on."""
    program = f"""{BEGIN}
blocked = []
for task in os.listdir("/proc/self/task"):
    text = Path(f"/proc/self/task/{{task}}/status").read_text()
    lines = dict(line.split(":\\t") for line in text.splitlines() if ":\\t" in line)
    blocked.append(all(int(lines["SigBlk"], 16) >> (number - 1) & 1 for number in (signal.SIGINT, signal.SIGALRM)))
print(sum(blocked))
"""
    assert run_python(program) == "2\n"


@pytest.mark.skipif(not hasattr(signal_names := __import__("signal"), "setitimer"), reason="no timer")
def test_an_interrupted_caller_has_its_array_back_and_draws_again() -> None:
    """The interrupt comes between two rounds or after the image; the threads have left the array by then."""
    program = f"""{BEGIN}
out = np.empty((4096, 2048))
def interrupt(*_):
    raise KeyboardInterrupt
signal.signal(signal.SIGALRM, interrupt)
for _ in range(5):
    signal.setitimer(signal.ITIMER_REAL, 0.01)
    try:
        while True:
            render_image(None, 2048, 4096, threads=3, out=out)
    except KeyboardInterrupt:
        out[:] = 7.0
        time.sleep(0.01)
        print((out == 7.0).all(), (render_image(None, 400, 400, threads=3) == image).all())
"""
    assert run_python(program) == 5 * "True True\n"
