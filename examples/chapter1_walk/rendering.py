"""Cells 1 to 4: the same image by a python loop, by one swollen expression, by numpy and by kernels; errors and times.

Comes in: the scene, or a Lab. Goes out: Findings, and a picture a cell. Never done here: the seed's own formulas.
"""

from __future__ import annotations

import time
from functools import partial

import mpmath
import numpy as np
import sympy as sp
from rich.console import Console
from rich.table import Table

from chapter1_walk import seed as seed_cells
from chapter1_walk.lab import Finding, FloatArray, Lab, ns_a_pixel, ns_of_kernel
from chapter1_walk.pictures import Gallery
from symrender_cg import Scene, render_image, translate
from symrender_cg.derive import seed as seed_derivation
from symrender_cg.derive.symbols import symbol
from symrender_cg.pipeline import SphereTranslation
from symrender_cg.reference import oracle
from symrender_cg.reference.compare import measure
from symrender_cg.reference.per_pixel import evaluate_per_pixel, render_per_pixel
from symrender_cg.reference.vectorised import render_vectorised


def cell_1(scene: Scene, size: int) -> tuple[FloatArray, list[Finding]]:
    """The unclipped image by a python loop, branches at run time."""
    start = time.perf_counter()
    image = render_per_pixel(scene, size, size, clip=False)
    seconds = time.perf_counter() - start
    finding = Finding(
        1,
        "loop_seconds",
        f"python loop, {size} x {size}",
        "0.3 to 1 s at 256 x 256",
        seconds,
        f"{seconds:.2f} s, {seconds / image.size * 1e9:,.0f} ns a pixel",
    )
    over = int(np.count_nonzero(image > 1))
    brightest = float(image.max())
    return image, [
        finding,
        Finding(1, "over_one", "pixels above 1, before the clip", "-", over, f"{over}, up to {brightest:.4f}"),
    ]


def cell_2(scene: Scene, gallery: Gallery, console: Console) -> tuple[seed_derivation.SeedImage, list[Finding]]:
    """The seed derives one expression; we derive named definitions. Same mathematics, checked to 50 digits."""
    seed = seed_derivation.cell_2()
    start = time.perf_counter()
    ours = translate(scene, "literal")
    assert isinstance(ours, SphereTranslation), "Chapter 1 has one sphere"
    seconds = time.perf_counter() - start
    named = ours.image.operations()
    swell = seed.swell()
    for definition in ours.image.definitions:
        console.print(f"  {definition.name} = {definition.value}", highlight=False)
    shared = sum(ours.program.operations().values())
    gallery.swell(swell, named)
    agreement = _digits_of_agreement(seed, ours)
    counts = ", ".join(f"{name} {count:,}" for name, count in swell.items())
    return seed, [
        Finding(2, "swell", "operations of the seed's expressions", "prints a swell table", swell, counts),
        Finding(
            2, "named", "the same image as named definitions", "-", named, f"{named} operations, {shared} once shared"
        ),
        Finding(
            2,
            "seconds",
            "time to derive",
            "a few seconds",
            (seed.seconds, seconds),
            f"seed {seed.seconds:.1f} s; ours, down to the C text, {seconds:.2f} s",
        ),
        Finding(2, "digits", "both closed forms at 20 points", "-", agreement, f"equal to {agreement} digits"),
    ]


def cell_3(lab: Lab) -> list[Finding]:
    """The compiled image against the per-pixel one, and both against the true values."""
    compiled = seed_cells.cell_3_function(lab.seed, lab.seed.I_img)
    numeric = np.clip(evaluate_per_pixel(lab.scene, *seed_cells.cell_1_grid(lab.size, lab.size)), 0, 1)
    symbolic = np.clip(np.nan_to_num(compiled(*seed_cells.cell_3_grid(lab.size, lab.size))), 0, 1)
    structural = float(np.abs(numeric - symbolic).max())
    truth = oracle.evaluate(lab.scene, lab.x, lab.y)
    images = {
        "per_pixel": lab.per_pixel,
        "lambdify": compiled(lab.x, lab.y),
        "numpy": render_vectorised(lab.scene, lab.size, lab.size, form="literal", clip=False),
        "literal": render_image(lab.scene, lab.size, lab.size, accuracy="literal", clip=False),
        "double": render_image(lab.scene, lab.size, lab.size, clip=False),
    }
    errors = {name: measure(values, truth) for name, values in images.items()}
    off = {name: np.abs((images[name] - truth.value) - truth.residual) for name in ("per_pixel", "lambdify", "double")}
    titles = {
        "per_pixel": "error of the per-pixel loop",
        "lambdify": "error of the seed's lambdify",
        "double": "error of `double`",
    }
    lab.gallery.difference(np.clip(lab.per_pixel, 0, 1), [(titles[name], off[name]) for name in off], 1e-17)
    return [
        Finding(3, "structural", "max |numeric - symbolic|", "about 1e-15", structural, f"{structural:.1e}"),
        *(
            Finding(
                3,
                f"error_{name}",
                f"largest error of {title}",
                "-",
                error,
                f"{error.max_abs:.1e} ({error.max_ulp:.0f} ulp)",
            )
            for (name, error), title in zip(
                errors.items(),
                ("the loop (Cell 1)", "lambdify (Cell 3)", "numpy (Cell 4)", "our literal", "our double"),
                strict=True,
            )
        ),
    ]


def cell_4(lab: Lab) -> list[Finding]:
    """Loop, numpy, the seed's lambdify, ours: nanoseconds a pixel, one thread."""
    compiled = seed_cells.cell_3_function(lab.seed, lab.seed.I_img)
    sizes = [size for size in (lab.size // 4, lab.size // 2, lab.size, 2 * lab.size) if size >= 8]
    rows: dict[str, list[float | None]] = {
        name: [] for name in ("loop", "numpy", "lambdify", "literal", "double", "single")
    }
    for side in sizes:
        grid = seed_cells.cell_3_grid(side, side)
        looped = side <= lab.size
        rows["loop"].append(ns_a_pixel(partial(render_per_pixel, lab.scene, side, side), side, 1) if looped else None)
        rows["numpy"].append(ns_a_pixel(partial(render_vectorised, lab.scene, side, side, form="literal"), side))
        rows["lambdify"].append(ns_a_pixel(partial(compiled, *grid), side))
        for accuracy in ("literal", "double", "single"):
            rows[accuracy].append(ns_of_kernel(lab.scene, side, accuracy))
    table = Table("ns a pixel", *(f"{side} x {side}" for side in sizes), title="one thread")
    for name, values in rows.items():
        table.add_row(name, *("-" if value is None else f"{value:,.1f}" for value in values))
    lab.console.print(table)
    lab.gallery.timings(sizes, rows)
    last = {name: values[-1] or 0.0 for name, values in rows.items() if name != "loop"}
    swollen = last["lambdify"] / last["numpy"]
    slower = (rows["loop"][0] or 0.0) / (rows["numpy"][0] or 1.0)
    ours = {name: last[name] / last["double"] for name in ("numpy", "lambdify")}
    return [
        Finding(
            4, "rows", "loop against numpy", "loop far slower", rows, f"{slower:.0f} times, {sizes[0]} x {sizes[0]}"
        ),
        Finding(
            4, "swollen", "the seed's lambdify against numpy", "about as fast", swollen, f"{swollen:.1f} times slower"
        ),
        Finding(
            4,
            "ours",
            f"our double at {sizes[-1]} x {sizes[-1]}",
            "-",
            ours,
            f"{last['double']:.2f} ns a pixel: numpy / {ours['numpy']:.0f}, lambdify / {ours['lambdify']:.0f}",
        ),
    ]


def _digits_of_agreement(seed: seed_derivation.SeedImage, ours: SphereTranslation) -> int:
    """Digits, of 50 computed, to which the two closed forms agree at 20 points of 20 scenes (seeded)."""
    lengths = ("x", "y", "radius", "eye", "light_x", "light_y", "light_z")
    names = (*lengths, "k_ambient", "k_diffuse", "k_specular", "shininess")
    closed = ours.image.closed(ours.image.value).xreplace({symbol("light_intensity"): 1})
    theirs = sp.lambdify(seed.parameters, seed.I_shade, "mpmath")
    mine = sp.lambdify([symbol(name) for name in names], closed, "mpmath")
    random = np.random.default_rng(1)
    worst = mpmath.mpf(0)
    with mpmath.workdps(50):
        for _ in range(20):
            drawn = [*random.uniform(-0.6, 0.6, 2), 1.0, random.uniform(2, 9), *random.uniform(1, 9, 3)]
            numbers = [mpmath.mpf(v) for v in (*drawn, *random.uniform(0.1, 1, 3), float(random.integers(1, 40)))]
            worst = max(worst, abs(theirs(*numbers) - mine(*numbers)))
    return 50 if worst == 0 else int(-mpmath.log10(worst))
