"""Symbolic Rendering, Chapter 1, its eight cells walked through with this package.

    python examples/chapter1.py [--out chapter1] [--size 256]

Each cell does what the seed's cell does and then what symrender_cg makes of it; at the end stands a table of what was
measured beside what the seed says. Pictures go to the folder of --out. Comes in: nothing. Never done here: the seed's
own cells (chapter1_seed.py), the derivative (chapter1_derivative.py), drawing (chapter1_pictures.py).
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import chapter1_seed as seed_cells
import mpmath
import numpy as np
import sympy as sp
from chapter1_derivative import differentiate, evaluate_by_name
from chapter1_pictures import Gallery
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from symrender_cg import Camera, Phong, Scene, Sphere, compile_kernel, evaluate, render_image, translate
from symrender_cg.derive.symbols import symbol
from symrender_cg.lower.nodes import Call, walk as nodes_of
from symrender_cg.lower.program import RATES, operations_of
from symrender_cg.pipeline import Translation
from symrender_cg.reference import oracle
from symrender_cg.reference.compare import measure
from symrender_cg.reference.per_pixel import evaluate_per_pixel, render_per_pixel
from symrender_cg.reference.points import pixel_centres
from symrender_cg.reference.vectorised import render_vectorised
from symrender_cg.run.numbers import numbers_of

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the table: a cell, what was looked at, what the seed says of it, and what was measured."""

    cell: int
    key: str
    what: str
    seed_says: str
    value: Any
    shown: str = ""


@dataclass(frozen=True, slots=True)
class Lab:
    """What the cells share: the scene, the image's side, its grid, the seed's derivation, the per-pixel image."""

    scene: Scene
    size: int
    x: FloatArray
    y: FloatArray
    seed: seed_cells.SeedImage
    per_pixel: FloatArray
    gallery: Gallery
    console: Console


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the walk, prints its table, saves the pictures; 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--out", type=Path, default=Path("chapter1"), help="folder for the pictures (default: ./chapter1)"
    )
    parser.add_argument("--size", type=_side, default=256, help="pixels a side of the image (default: 256, the seed's)")
    options = parser.parse_args(argv)
    console = Console() if sys.stdout.isatty() else Console(width=120)
    findings = walk(options.size, options.out, console)
    console.print(report(findings, options.size))
    return 0


def walk(size: int, out: Path, console: Console) -> list[Finding]:
    """All eight cells in their order, and what they found."""
    scene = Scene.chapter1()
    half = scene.in_camera_frame().camera.half_height
    assert half is not None, "a camera-frame scene has its half_height"
    gallery = Gallery(out, half)
    columns, rows = pixel_centres(scene, size, size)
    x, y = np.meshgrid(columns, rows)
    findings: list[Finding] = []

    console.rule("1  the baseline, pixel by pixel")
    image, found = cell_1(scene, size)
    gallery.baseline(np.clip(image, 0, 1))
    findings += found

    console.rule("2  the derivation, and how expressions swell")
    seed, found = cell_2(scene, gallery, console)
    findings += found

    lab = Lab(scene, size, x, y, seed, image, gallery, console)
    for title, cell in CELLS.items():
        console.rule(title)
        findings += cell(lab)
    console.print(gallery.missing or f"pictures: {out / 'cell1.png'} to cell8.png")
    return findings


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


def cell_2(scene: Scene, gallery: Gallery, console: Console) -> tuple[seed_cells.SeedImage, list[Finding]]:
    """The seed derives one expression; we derive named definitions. Same mathematics, checked to 50 digits."""
    seed = seed_cells.cell_2()
    start = time.perf_counter()
    ours = translate(scene, "literal")
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
        loops = side <= lab.size
        rows["loop"].append(_ns_a_pixel(lambda n: render_per_pixel(lab.scene, n, n), side, 1) if loops else None)
        rows["numpy"].append(_ns_a_pixel(lambda n: render_vectorised(lab.scene, n, n, form="literal"), side))
        rows["lambdify"].append(_ns_a_pixel(lambda _, points=grid: compiled(*points), side))
        for accuracy in ("literal", "double", "single"):
            rows[accuracy].append(_ns_of_kernel(lab.scene, side, accuracy))
    table = Table("ns a pixel", *(f"{side} x {side}" for side in sizes), title="one thread")
    for name, values in rows.items():
        table.add_row(name, *("-" if value is None else f"{value:,.1f}" for value in values))
    lab.console.print(table)
    lab.gallery.timings(sizes, rows)
    last = {name: values[-1] or 0.0 for name, values in rows.items() if name != "loop"}
    swollen = last["lambdify"] / last["numpy"]
    loops = (rows["loop"][0] or 0.0) / (rows["numpy"][0] or 1.0)
    ours = {name: last[name] / last["double"] for name in ("numpy", "lambdify")}
    return [
        Finding(
            4, "rows", "loop against numpy", "loop far slower", rows, f"{loops:.0f} times, {sizes[0]} x {sizes[0]}"
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


def cell_5(lab: Lab) -> list[Finding]:
    """The silhouette is a theorem: disc = 0 solved, and laid over the pixels."""
    rho2 = seed_cells.cell_5_rho2(lab.seed)
    R, e = lab.seed.parameters[2:4]
    rho = float(mpmath.sqrt(mpmath.mpf(float(rho2.subs({R: 1, e: 4})))))
    image = render_image(lab.scene, lab.size, lab.size)
    wrong = int(np.count_nonzero((image > 0) != oracle.hits(lab.scene, lab.x, lab.y)))
    lab.console.print(f"  x^2 + y^2 = {rho2}", highlight=False)
    lab.gallery.silhouette(image, rho)
    return [
        Finding(5, "rho", "rho at e = 4, R = 1", "4/sqrt(15) = 1.0327955589886444", rho, repr(rho)),
        Finding(
            5, "misplaced", "pixels on the wrong side of it", "-", wrong, f"{wrong} of {image.size:,}, decided exactly"
        ),
    ]


def cell_6(lab: Lab) -> list[Finding]:
    """dI/dl_x name by name against the seed's one expression; and the scene's numbers baked into the kernel."""
    return [*_derivative(lab), *_baking(lab)]


def cell_7(lab: Lab) -> list[Finding]:
    """0 * nan is nan: the Heaviside temptation, its cure, and the comparison that the seed gets wrong."""
    raw, regularised = seed_cells.cell_7_images(lab.seed)
    bad = seed_cells.cell_3_function(lab.seed, raw)(lab.x, lab.y)
    good = seed_cells.cell_3_function(lab.seed, regularised)(lab.x, lab.y)
    piecewise = np.clip(np.nan_to_num(seed_cells.cell_3_function(lab.seed, lab.seed.I_img)(lab.x, lab.y)), 0, 1)
    nans, left = int(np.isnan(bad).sum()), int(np.isnan(good).sum())
    as_compared = bool(np.allclose(np.nan_to_num(good), piecewise, atol=1e-12))
    both_clipped = bool(np.allclose(np.clip(good, 0, 1), piecewise, atol=1e-12))
    misses = int(np.count_nonzero(~oracle.hits(lab.scene, lab.x, lab.y)))
    lab.gallery.heaviside(np.clip(bad, 0, 1), np.clip(good, 0, 1), piecewise)
    return [
        Finding(
            7,
            "nan_raw",
            "nan in H(disc) I_shade",
            "tens of thousands",
            nans,
            f"{nans:,} of {bad.size:,}; {misses:,} misses",
        ),
        Finding(7, "nan_regularised", "nan once sqrt(max(0, disc))", "0", left, str(left)),
        Finding(7, "as_the_seed_compares", "equal, unclipped against clipped", "True", as_compared, str(as_compared)),
        Finding(7, "both_clipped", "equal, both clipped", "-", both_clipped, str(both_clipped)),
    ]


def cell_8(lab: Lab) -> list[Finding]:
    """Two spheres: the seed's condition, and one line that sorts them by |E - C|^2 - R^2, against depth in each pixel."""
    naive, arguments = seed_cells.cell_8_image(lab.seed)
    lab.console.print(f"  {naive}", highlight=False)
    shown = []
    wrong: dict[str, tuple[int, int]] = {}
    for title, center, radius in TWO_SPHERES:
        image, naive_wrong, ordered_wrong = _two_spheres(lab, naive, arguments, center, radius)
        shown.append((f"B {title}", image, naive_wrong, ordered_wrong))
        wrong[title] = (int(naive_wrong.sum()), int(ordered_wrong.sum()))
    lab.gallery.two_spheres(shown)
    return [
        Finding(
            8,
            title,
            f"wrong pixels, B {title}",
            SEED_ON_ORDER if title == "behind A" else "-",
            counts,
            f"Cell 8 {counts[0]:,}; sorted by power of the eye {counts[1]:,}"
            + (" (they intersect: compare depths)" if title == "through A" else ""),
        )
        for title, counts in wrong.items()
    ]


CELLS: dict[str, Callable[[Lab], list[Finding]]] = {
    "3  the compiled image against the per-pixel one": cell_3,
    "4  timings": cell_4,
    "5  the silhouette is a theorem": cell_5,
    "6  derivatives, and baking": cell_6,
    "7  the Heaviside pitfall": cell_7,
    "8  two spheres": cell_8,
}

SEED_ON_ORDER = "naive: ignores occlusion order"
TWO_SPHERES = (("in front", 1.8, 0.35), ("behind A", -2.5, 1.3), ("behind the eye", 6.0, 0.6), ("through A", 0.5, 0.62))
"""title, centre on the z axis and radius of sphere B; A is the seed's"""


def report(findings: Sequence[Finding], size: int) -> Table:
    """The table: what was measured beside what the seed says."""
    table = Table("cell", "what", "the seed says", "measured", title=f"Chapter 1 at {size} x {size}")
    cell = 0
    for finding in findings:
        if finding.cell != cell and cell:
            table.add_section()
        table.add_row(str(finding.cell) if finding.cell != cell else "", finding.what, finding.seed_says, finding.shown)
        cell = finding.cell
    return table


def _derivative(lab: Lab) -> list[Finding]:
    program = translate(lab.scene, "literal").image
    slope = differentiate(program, "light_x")
    values = evaluate_by_name(slope, {**numbers_of(lab.scene), "x": lab.x, "y": lab.y})
    field = seed_cells.cell_6_derivative(lab.seed)
    unclamped = np.where(
        oracle.hits(lab.scene, lab.x, lab.y), seed_cells.cell_3_function(lab.seed, field)(lab.x, lab.y), 0
    )
    step = 2.0**-18
    beside = [evaluate(Scene.chapter1(light=(5.0 + sign * step, 5.0, 10.0)), lab.x, lab.y) for sign in (1, -1)]
    central = (beside[0] - beside[1]) / (2 * step)
    off = np.abs(values - central)
    dark = int(np.count_nonzero(np.abs(unclamped - values) > 1e-9))
    lab.gallery.derivative(values, unclamped)
    swollen, named = int(field.count_ops()), slope.operations()
    return [
        Finding(6, "swollen_slope", "operations of the seed's dI/dl_x", "swell again", swollen, f"{swollen:,}"),
        Finding(6, "named_slope", "the same, name by name", "-", named, f"{named} with the image itself"),
        Finding(6, "central", "against central differences", "-", float(off.max()), f"within {off.max():.0e}"),
        Finding(
            6,
            "unclamped",
            "pixels where the unclamped field is not the image's slope",
            "warns of the clamps",
            dark,
            f"{dark:,}, by up to {np.abs(unclamped - values).max():.2g}",
        ),
    ]


def _baking(lab: Lab) -> list[Finding]:
    swollen = int(lab.seed.I_img.count_ops())
    folded = int(seed_cells.cell_6_baked(lab.seed).count_ops())
    counts = [_work(translate(lab.scene, "double", bake=bake)) for bake in (False, True)]
    side = 2 * lab.size
    times = [_ns_of_kernel(lab.scene, side, "double", bake=bake) for bake in (False, True)]
    images = [render_image(lab.scene, lab.size, lab.size, bake=bake, clip=False) for bake in (False, True)]
    change = float(np.abs(images[0] - images[1]).max())
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        compile_kernel(lab.scene, bake=True, cache=folder)
        cost = time.perf_counter() - start
    saved = times[0] - times[1]
    pays = f"after {cost / saved * 1e3:,.0f} million pixels" if saved > 0 else "never, on this run"
    return [
        Finding(
            6,
            "seed_baked",
            "operations of the seed's image, baked",
            "slightly fewer",
            (swollen, folded),
            f"{swollen:,} -> {folded:,}",
        ),
        *(
            Finding(
                6, f"work_{rate}", f"operations of our double, a {rate}", "-", (before, after), f"{before} -> {after}"
            )
            for rate, before, after in zip(counts[0], counts[0].values(), counts[1].values(), strict=True)
        ),
        Finding(6, "baked_ns", f"its ns a pixel, {side} x {side}", "-", times, f"{times[0]:.2f} -> {times[1]:.2f}"),
        Finding(6, "baked_cost", "deriving and compiling it again", "-", cost, f"{cost:.2f} s: pays {pays}"),
        Finding(6, "baked_change", "change of the image by baking", "none to 1e-12", change, f"at most {change:.1e}"),
    ]


def _work(translation: Translation) -> dict[str, str]:
    """Operations at each rate, powers b^n apart, for they cost as much as the rest together."""
    counts = {}
    for rate in RATES:
        steps = translation.program.at(rate)
        total = sum(sum(operations_of(step).values()) for step in steps)
        powers = sum(
            isinstance(node, Call) and node.function.startswith("power")
            for step in steps
            for node in nodes_of(step.value)
        )
        counts[rate] = f"{total - powers} and a power" if powers else str(total)
    return counts


def _two_spheres(
    lab: Lab, naive: Any, arguments: tuple[Any, ...], center: float, radius: float
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """The true image, where the naive condition picks the wrong sphere, and where order by power does."""
    eye = 4.0
    camera = Camera(eye=(0.0, 0.0, eye), half_height=lab.gallery.half)
    spheres = (Sphere(), Sphere((0.0, 0.0, center), radius, Phong(ambient=0.25, diffuse=0.5, specular=0.3)))
    shades = [evaluate(Scene(camera, (sphere,), lab.scene.lights), lab.x, lab.y, clip=True) for sphere in spheres]
    depths = [_depth(lab, sphere, eye) for sphere in spheres]
    first = np.where(np.isinf(np.minimum(*depths)), 0, np.where(depths[0] <= depths[1], 1, 2))
    chosen = sp.lambdify(arguments, naive, "numpy")(lab.x, lab.y, 1.0, eye, radius, center, 1.0, 2.0)
    powers = [(eye - sphere.center[2]) ** 2 - sphere.radius**2 for sphere in spheres]
    front, back = (0, 1) if powers[0] < powers[1] else (1, 0)
    hit = [np.isfinite(depth) for depth in depths]
    ordered = np.where(hit[front], front + 1, np.where(hit[back], back + 1, 0))
    image = np.choose(first, [np.zeros_like(shades[0]), shades[0], shades[1]])
    return image, chosen != first, ordered != first


def _depth(lab: Lab, sphere: Sphere, eye: float) -> FloatArray:
    """t of the nearer hit on a sphere of the z axis, infinite where the ray misses it or leaves it behind."""
    s = lab.x**2 + lab.y**2
    m = sphere.center[2] - eye
    facing, length2 = -m * eye, s + eye**2
    disc = sphere.radius**2 * length2 - m**2 * s
    with np.errstate(invalid="ignore"):
        t = (facing - np.sqrt(disc)) / length2
    return np.where((disc >= 0) & (facing > 0), t, np.inf)


def _digits_of_agreement(seed: seed_cells.SeedImage, ours: Translation) -> int:
    """Digits, of 50 computed, to which the two closed forms agree at 20 points of 20 scenes (seeded)."""
    names = "x y radius eye light_x light_y light_z k_ambient k_diffuse k_specular shininess".split()
    closed = ours.image.closed(ours.image.value).xreplace({symbol("light_intensity"): 1})
    theirs = sp.lambdify(seed.parameters, seed.I_shade, "mpmath")
    mine = sp.lambdify([symbol(name) for name in names], closed, "mpmath")
    random = np.random.default_rng(1)
    worst = mpmath.mpf(0)
    with mpmath.workdps(50):
        for _ in range(20):
            lengths = [*random.uniform(-0.6, 0.6, 2), 1.0, random.uniform(2, 9), *random.uniform(1, 9, 3)]
            numbers = [mpmath.mpf(v) for v in (*lengths, *random.uniform(0.1, 1, 3), float(random.integers(1, 40)))]
            worst = max(worst, abs(theirs(*numbers) - mine(*numbers)))
    return 50 if worst == 0 else int(-mpmath.log10(worst))


def _ns_of_kernel(scene: Scene, side: int, accuracy: str, *, bake: bool = False) -> float:
    dtype = compile_kernel(scene, accuracy, bake=bake).dtype
    out = np.empty((side, side), dtype)
    return _ns_a_pixel(lambda n: render_image(scene, n, n, accuracy=accuracy, bake=bake, out=out, threads=1), side, 20)


def _ns_a_pixel(render: Callable[[int], Any], side: int, rounds: int = 3) -> float:
    """Median over the rounds, in nanoseconds a pixel."""
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        render(side)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds) / side**2 * 1e9


def _side(text: str) -> int:
    side = int(text)
    if not 16 <= side <= 2048:
        raise argparse.ArgumentTypeError(f"{side} is not from 16 to 2048")
    return side


if __name__ == "__main__":
    raise SystemExit(main())
