"""Each kernel's time beside the least that its operations and its stores could take.

Comes in: sides of images, rounds. Goes out: Report. Peaks and kernels are measured in the same run, on one thread; a
kernel's time is that of its rows entry point through render_image, of a peak and of a kernel the best round counts,
since both are limits. Never done here: a bound that counts what the compiler added, such as loads of constants.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from benchmarks.machine import SHORTEST_SAMPLE, take_turns, this_machine
from benchmarks.roofline.counting import Work, work_of
from benchmarks.roofline.peaks import CHAINS, FORMATS, Peaks, measure_peaks
from benchmarks.roofline.report import Report, Row
from symrender_cg import Scene, render_image, translate
from symrender_cg.build import find_toolchain
from symrender_cg.pipeline import SphereTranslation

KERNELS: Final = (
    ("literal", False),
    ("double", False),
    ("double", True),
    ("single", False),
    ("single", True),
    ("fast", False),
    ("fast", True),
)
"""(accuracy, baked)"""


def measure_roofline(sizes: Sequence[int], rounds: int, seed: int, told: Callable[[str], None]) -> Report:
    """Chapter 1's scene at each size; told(text) says what is going on."""
    scene = Scene.chapter1()
    told("the programs")
    works = {_name(*kernel): _work(scene, *kernel) for kernel in KERNELS}
    toolchain = find_toolchain()
    pixels = tuple(size * size for size in sizes)
    peaks = measure_peaks(toolchain, pixels, rounds, seed, told)
    rows: list[Row] = []
    for size in sizes:
        told(f"{size} x {size}: kernels")
        calls, hits = _calls(scene, size)
        best = take_turns(calls, rounds, seed, partial(_say, told, size, rounds))
        rows += [row(name, works[name], size, hits, min(best[name]), peaks) for name in works]
    return Report(
        machine=this_machine(),
        rounds=rounds,
        peaks={form: {kind: peaks.gflops(form, kind) for kind in CHAINS if " " not in kind} for form in FORMATS},
        stores={form: {str(size): 1.0 / peaks.store_ns[form, size * size] for size in sizes} for form in FORMATS},
        rows=tuple(rows),
    )


def _say(told: Callable[[str], None], size: int, rounds: int, number: int) -> None:
    told(f"{size} x {size}: round {number + 1} of {rounds}")


def row(name: str, work: Work, size: int, hits: float, measured_ns: float, peaks: Peaks) -> Row:
    """A kernel's bounds for an image of which the part `hits` is computed, all in ns a pixel of the image."""
    form = "float64" if work.bytes == 8 else "float32"
    computed = 1.0 if work.everywhere else hits
    operations = _per_kind(work.operations)
    return Row(
        kernel=name,
        size=size,
        operations=operations,
        flops=computed * work.flops(),
        bytes=work.bytes,
        measured_ns=measured_ns,
        pipes_ns=computed * peaks.pipes_ns(work.operations),
        divider_ns=computed * peaks.divider_ns(work.operations),
        store_ns=work.bytes * peaks.store_ns[form, size * size],
    )


def _per_kind(operations: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """Operations by kind, both formats together."""
    kinds: dict[str, float] = {}
    for (_, kind), count in operations.items():
        kinds[kind] = kinds.get(kind, 0.0) + count
    return kinds


def _work(scene: Scene, accuracy: str, bake: bool) -> Work:
    translation = translate(scene, accuracy, bake=bake)
    assert isinstance(translation, SphereTranslation), "Chapter 1's scene has one sphere"
    return work_of(translation)


def _name(accuracy: str, bake: bool) -> str:
    return f"{accuracy}, baked" if bake else accuracy


def _calls(scene: Scene, size: int) -> tuple[dict[str, Callable[[], float]], float]:
    """(nanoseconds a pixel of each kernel, the part of the pixels that the sphere covers)"""
    calls: dict[str, Callable[[], float]] = {}
    hits = 0.0
    for accuracy, bake in KERNELS:
        out = render_image(scene, size, size, accuracy=accuracy, bake=bake, threads=1, clip=False)
        hits = float(np.count_nonzero(out)) / size**2
        render = partial(render_image, scene, size, size, accuracy=accuracy, bake=bake, threads=1, clip=False, out=out)
        calls[_name(accuracy, bake)] = partial(_sample, render, size)
    return calls, hits


def _sample(render: Callable[[], object], size: int) -> float:
    """Nanoseconds a pixel: the best of some images after one that is not timed."""
    render()
    best, until = float("inf"), time.perf_counter() + SHORTEST_SAMPLE
    while best == float("inf") or time.perf_counter() < until:
        start = time.perf_counter()
        render()
        best = min(best, time.perf_counter() - start)
    return best * 1e9 / size**2
