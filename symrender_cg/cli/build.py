"""`build`: a scene -> C under a folder, libraries in the cache, and one table of how they came about.

What was built before is recalled by its recipe and its C compared with the folder, without sympy and without templates.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shlex
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symrender_cg import generate, pipeline
from symrender_cg.build.cache import Cache
from symrender_cg.build.library import CachedKernel
from symrender_cg.cli.console import Column, Table, counted, duration, listed
from symrender_cg.cli.levels import accuracies_for
from symrender_cg.plan.plan import Plan, plan
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Scene, load_scene

if TYPE_CHECKING:
    from symrender_cg.pipeline import Translation

COMPILING_THREADS = 2


@dataclass(frozen=True, slots=True)
class Order:
    """One kernel that is asked for."""

    scene: Scene
    plan: Plan
    accuracy: str
    bake: bool
    portable: bool
    command: str

    @property
    def numbers(self) -> dict[str, float] | None:
        """The numbers to bake in, or None."""
        return dict(sorted(numbers_of(self.scene).items())) if self.bake else None

    @property
    def recipe(self) -> str:
        """The recipe under which render_image looks for the kernel."""
        return pipeline.recipe_of(self.plan, self.accuracy, (self.numbers or {}).items(), self.portable)

    @property
    def text_recipe(self) -> str:
        """What determines every byte of the generated files: the kernel, and what its comments say of the scene."""
        said = [(d.effect.name, d.needed, d.reason, d.margin) for d in self.plan.decisions]
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
    accuracies = accuracies_for(scene, arguments.accuracy)
    folder = Path(arguments.out)
    orders = [
        Order(
            scene,
            scene_plan,
            accuracy,
            arguments.bake,
            arguments.portable,
            generate.regenerate_command(arguments.scene, accuracy, bake=arguments.bake),
        )
        for accuracy in accuracies
    ]
    store = Cache()
    recalled = [None if arguments.passes else _recall(store, order) for order in orders]
    missing = [order for order, built in zip(orders, recalled, strict=True) if built is None]
    fresh, closed = _build(store, missing) if missing else ([], {})
    kernels = [*filter(None, recalled), *fresh]
    files = {place: text for built in kernels for place, text in built.files.items()}
    written = generate.write(files, folder)
    if not missing and all(outcome.status == "unchanged" for outcome in written):
        names = listed([built.name for built in kernels])
        print(f"nothing had to be done: {names} up to date, {counted(len(files), 'file')} unchanged in {folder}/")
    else:
        if fresh:
            _table(fresh, closed, passes=arguments.passes).show()
            print()
        _print_files(written, folder)
    for built in kernels:
        _print_library(built)
    print(f"{duration(time.perf_counter() - begin)} of work")
    return 0


def _recall(store: Cache, order: Order) -> Built | None:
    """The kernel as it was built before, its texts read from the cache and checked; None where anything is missing."""
    found = store.recall(order.text_recipe, portable=order.portable)
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


def _build(store: Cache, orders: Sequence[Order]) -> tuple[list[Built], dict[str, int]]:
    """Derives every order here and compiles them side by side; and the swell meter's counts, the same for all."""
    from symrender_cg.explain import swollen_operations

    with ThreadPoolExecutor(COMPILING_THREADS, thread_name_prefix="symrender_cg-build") as pool:
        jobs: list[tuple[Order, Translation, Future[tuple[CachedKernel, float]]]] = []
        for order in orders:
            translation = pipeline.translate(order.scene, order.accuracy, bake=order.bake, command=order.command)
            jobs.append((order, translation, pool.submit(_compile, store, order, translation)))
        counts = swollen_operations(jobs[0][1].image)  # counted while the compiler runs
        return [_kept(store, order, translation, *job.result()) for order, translation, job in jobs], counts


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


# ---------------------------------------------------------------------------------------------------- what is printed

_COLUMNS = (
    Column("stage"),
    Column("time", right=True),
    Column("operations", right=True),
    Column("after", right=True),
    Column("result"),
)
_SWELL = (
    ("t_hit", "t"),
    ("n.l", "n_dot_l"),
    ("r.v", "r_dot_v"),
    ("shading", "value"),
    ("image", "image"),
)


def _table(kernels: Sequence[Built], closed: dict[str, int], *, passes: bool) -> Table:
    table = Table(_COLUMNS)
    first = kernels[0].translation
    assert first is not None, "a fresh kernel has its translation"
    for built in kernels:
        translation = built.translation
        assert translation is not None, "a fresh kernel has its translation"
        table.section()
        table.add(built.name)
        _stage_rows(table, built, translation, closed["image"], passes=passes)
    table.section()
    table.add("swell meter", "", "one formula", "named", "operations as sympy counts them, then those of the kernels")
    for label, name in _SWELL:
        if name in closed:
            inside = [f"{built.order.accuracy} {_kernel_operations(built, name) or '-'}" for built in kernels]
            table.add(f"  {label}", "", str(closed[name]), str(_named_operations(first, name)), ", ".join(inside))
    return table


def _stage_rows(table: Table, built: Built, translation: Translation, image: int, *, passes: bool) -> None:
    seconds, emitted = translation.seconds, translation.emitted
    absent = len(translation.plan.absent)
    needed = [d.effect.name for d in translation.plan.decisions if d.needed]
    named = translation.image.operations()
    rates = ", ".join(f"{sum(counts.values())} a {rate}" for rate, counts in emitted.operations.items())
    lines = {name: text.count("\n") for name, text in emitted.files.items()}
    table.add("  plan", duration(seconds["plan"]), "", "", f"{listed(needed)} in, {absent} effects proved away")
    definitions = counted(len(translation.image.definitions), "named definition")
    table.add("  derive", duration(seconds["derive"]), str(image), str(named), f"one formula -> {definitions}")
    total = sum(translation.program.operations().values())
    listed_by = "" if passes else " (--passes lists them)"
    ran = f"{len(translation.passes)} passes{listed_by}: {rates}"
    table.add("  lower", duration(seconds["lower"]), str(named), str(total), ran)
    if passes:
        before = named
        for stage in translation.passes:
            after = sum(stage.operations.values())
            steps = counted(len(stage.program.steps), "step")
            table.add(f"    {stage.name}", duration(stage.seconds), str(before), str(after), steps)
            before = after
    table.add("  emit", duration(seconds["emit"]), "", "", f"{emitted.name}.c, {lines[f'{emitted.name}.c']} lines")
    if built.order.bake:
        table.add("  bake", "", "", "", _saved(built))
    made = "the library was in the cache" if built.cached.from_cache else "compiled"
    table.add("  build", duration(built.seconds), "", "", made)


def _named_operations(translation: Translation, name: str) -> int:
    """Operations of the definitions that the quantity rests on, each counted once."""
    import sympy as sp

    image = translation.image
    if name == "image":
        return image.operations()
    needed, total = {name}, 0
    for definition in reversed(image.definitions):
        if definition.name in needed:
            total += int(sp.count_ops(definition.value))
            needed |= {s.name for s in definition.value.free_symbols}
    return total


def _kernel_operations(built: Built, name: str) -> int | None:
    """Operations of the kernel's steps that the quantity rests on; None where the kernel has no such step."""
    from symrender_cg.lower.program import operations_of

    assert built.translation is not None, "a fresh kernel has its translation"
    program = built.translation.program
    if name == "image":
        return sum(program.operations().values())
    wanted = program.result if name == "value" else name
    if wanted not in program:
        return None
    needed = {wanted}
    total: Counter[str] = Counter()
    for step in reversed(program.steps):
        if step.name in needed:
            total += operations_of(step)
            needed |= step.uses()
    return sum(total.values())


def _saved(built: Built) -> str:
    """What baking saved: operations with the numbers as arguments, without, and after how many pixels it pays."""
    from symrender_cg.cli.timing import nanoseconds_a_pixel

    order = built.order
    assert built.translation is not None, "a fresh kernel has its translation"
    free = pipeline.translate(order.scene, order.accuracy)
    before = {rate: sum(counts.values()) for rate, counts in free.emitted.operations.items()}
    after = {rate: sum(counts.values()) for rate, counts in built.translation.emitted.operations.items()}
    parts = ", ".join(f"{before[rate]} -> {after[rate]} a {rate}" for rate in before)
    slow, fast = (
        nanoseconds_a_pixel(order.scene, order.accuracy, bake=bake, portable=order.portable) for bake in (False, True)
    )
    text = f"{parts}; {slow:.2f} -> {fast:.2f} ns a pixel"
    cost = sum(built.translation.seconds.values()) + built.seconds
    if fast < slow:
        return f"{text}, pays after {cost / (slow - fast) * 1e9:.2g} pixels"
    return f"{text}, which saves nothing here"


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
