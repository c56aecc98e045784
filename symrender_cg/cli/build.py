"""`build`: a scene -> C under a folder, libraries in the cache, and one table of how they came about.

What was built before is recalled by its recipe and its C compared with the folder, without sympy and without templates.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shlex
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrender_cg import generate, pipeline
from symrender_cg.build.cache import Cache
from symrender_cg.build.library import CachedKernel
from symrender_cg.cli.console import counted, duration, listed
from symrender_cg.cli.levels import accuracies_for
from symrender_cg.cli.requests import choose_for
from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import variant
from symrender_cg.plan.plan import Plan, plan
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Scene, load_scene

if TYPE_CHECKING:
    from symrender_cg.pipeline import Translation

COMPILING_THREADS = 2


@dataclass(frozen=True, slots=True)
class Order:
    """One kernel that is asked for; of several levels that rest on one enclosure, the first."""

    scene: Scene
    plan: Plan
    accuracy: str
    bake: bool
    portable: bool
    command: str
    target: str | None = None

    @property
    def encloses(self) -> bool:
        """Whether the kernel is the enclosure of a scene."""
        return rests_on_enclosure(self.plan, self.accuracy)

    @property
    def kernel(self) -> str:
        """What tells the kernels of one scene apart."""
        return pipeline.ENCLOSURE if self.encloses else variant(self.accuracy, self.target).key

    @property
    def numbers(self) -> dict[str, float] | None:
        """The numbers to bake in, or None."""
        return dict(sorted(numbers_of(self.plan.scene).items())) if self.bake else None

    @property
    def recipe(self) -> str:
        """The recipe under which render_image looks for the kernel."""
        return pipeline.recipe_of(self.plan, self.kernel, (self.numbers or {}).items(), self.portable)

    @property
    def text_recipe(self) -> str:
        """What determines every byte of the generated files: the kernel, and what its comments say of the scene."""
        said = [(d.effect.name, d.status, d.reason, d.margin, d.bound) for d in self.plan.decisions]
        return json.dumps(["generated", generate.LAYOUT, self.recipe, self.command, said])


@dataclass(frozen=True, slots=True)
class Built:
    """One kernel as it is now: its library, its files by place, and how it was derived unless it was recalled."""

    order: Order
    name: str
    cached: CachedKernel
    files: dict[str, str]
    translation: Translation | None = None
    seconds: float = 0.0


def run(arguments: argparse.Namespace) -> int:
    """Builds every accuracy that is asked for and prints what was done."""
    begin = time.perf_counter()
    scene = load_scene(arguments.scene)
    scene_plan = plan(scene)
    choose_for(arguments, scene, flags=False)
    accuracies = accuracies_for(scene, arguments.accuracy, bake=arguments.bake)
    folder = Path(arguments.out)
    orders = _orders(arguments, scene, scene_plan, accuracies)
    store = Cache()
    recalled = [None if arguments.passes else _recall(store, order) for order in orders]
    missing = [order for order, built in zip(orders, recalled, strict=True) if built is None]
    fresh = _build(store, missing) if missing else []
    kernels = [*filter(None, recalled), *fresh]
    files = {place: text for built in kernels for place, text in built.files.items()}
    written = generate.write(files, folder)
    if not missing and all(outcome.status == "unchanged" for outcome in written):
        names = listed([built.name for built in kernels])
        print(f"nothing had to be done: {names} up to date, {counted(len(files), 'file')} unchanged in {folder}/")
    else:
        if fresh:
            from symrender_cg.cli.build_table import build_table

            build_table(fresh, passes=arguments.passes).show()
            print()
        _print_files(written, folder)
    for built in kernels:
        _print_library(built)
    print(f"{duration(time.perf_counter() - begin)} of work")
    return 0


def rests_on_enclosure(found: Plan, accuracy: str) -> bool:
    """Whether the first kernel of that accuracy is the enclosure: of more than one sphere under one light."""
    return variant(accuracy).settles is not None and found.arrangement is not None


def _orders(arguments: argparse.Namespace, scene: Scene, found: Plan, accuracies: Sequence[str]) -> list[Order]:
    """An order for every kernel that the accuracies call for, each kernel once.

    The command of an enclosure is that of `certified`, whoever asks for it: its text is one.
    """
    if arguments.target is not None and "certified" not in accuracies:
        raise ArgumentError(
            f"--target {arguments.target}: this is what accuracy certified rounds to; leave it out, or add certified"
        )
    orders: dict[str, Order] = {}
    for accuracy in accuracies:
        target = arguments.target if accuracy == "certified" else None
        one = rests_on_enclosure(found, accuracy)
        command = generate.regenerate_command(
            arguments.scene,
            "certified" if one else accuracy,
            target=None if one else target,
            bake=arguments.bake,
        )
        order = Order(scene, found, accuracy, arguments.bake, arguments.portable, command, target)
        orders.setdefault(order.kernel, order)
    return list(orders.values())


def _recall(store: Cache, order: Order) -> Built | None:
    """The kernel as it was built before, its texts read from the cache and checked; None where anything is missing."""
    flags = variant(order.accuracy, order.target).flags
    found = store.recall(order.text_recipe, portable=order.portable, extra_flags=flags)
    if found is None:
        return None
    cached, payload = found
    digests = {entry.name: entry.sha256 for entry in cached.manifest.files}
    texts: dict[str, str] = {}
    for name in cached.manifest.sources:
        try:
            data = (cached.folder / name).read_bytes()
        except OSError:
            return None
        if hashlib.sha256(data).hexdigest() != digests.get(name):
            return None
        texts[name] = data.decode()
    return Built(order, payload["name"], cached, generate.places(payload["name"], texts, payload["manifest"]))


def _build(store: Cache, orders: Sequence[Order]) -> list[Built]:
    """Derives every order here and compiles them side by side."""
    with ThreadPoolExecutor(COMPILING_THREADS, thread_name_prefix="symrender_cg-build") as pool:
        jobs: list[tuple[Order, Translation, Future[tuple[CachedKernel, float]]]] = []
        for order in orders:
            translation = pipeline.translate(
                order.scene, order.accuracy, target=order.target, bake=order.bake, command=order.command
            )
            jobs.append((order, translation, pool.submit(_compile, store, order, translation)))
        return [_kept(store, order, translation, *job.result()) for order, translation, job in jobs]


def _compile(store: Cache, order: Order, translation: Translation) -> tuple[CachedKernel, float]:
    begin = time.perf_counter()
    cached = pipeline.build_kernel(translation, portable=order.portable, root=store.root, recipe=order.recipe)
    return cached, time.perf_counter() - begin


def _kept(store: Cache, order: Order, translation: Translation, cached: CachedKernel, seconds: float) -> Built:
    manifest = generate.manifest_text(translation, command=order.command, numbers=order.numbers)
    emitted = translation.emitted
    store.remember(order.text_recipe, cached, {"name": emitted.name, "manifest": manifest})
    files = generate.places(emitted.name, emitted.files, manifest)
    return Built(order, emitted.name, cached, files, translation, seconds)


def _print_files(written: Sequence[generate.Outcome], folder: Path) -> None:
    print(f"files in {folder}/")
    for outcome in sorted(written, key=lambda o: o.place):
        print(f"  {outcome.status:9}  {outcome.place}")
    print()


def _print_library(built: Built) -> None:
    cached: Any = built.cached
    if built.translation is not None:
        print(f"command  {shlex.join(cached.manifest.command)}")
    origin = "from the cache" if cached.from_cache else f"compiled in {duration(cached.compile_seconds)}"
    print(f"library  {cached.library_path} ({origin})")
