"""Cells 5 to 8: what the formula is good for beside pixels, and where it hurts.

Comes in: a Lab. Goes out: Findings, and a picture a cell. Never done here: the seed's own formulas.
"""

from __future__ import annotations

import tempfile
import time
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from chapter1_walk import seed as seed_cells
from chapter1_walk.derivative import differentiate, evaluate_by_name
from chapter1_walk.lab import BoolArray, Finding, FloatArray, Lab, ns_of_kernel
from symrender_cg import Camera, Phong, Scene, Sphere, compile_kernel, evaluate, render_image, translate
from symrender_cg.lower.nodes import Call
from symrender_cg.lower.nodes import walk as nodes_of
from symrender_cg.lower.program import operations_of
from symrender_cg.pipeline import SphereTranslation, Translation
from symrender_cg.reference import oracle
from symrender_cg.run.numbers import numbers_of

SEED_ON_ORDER = "naive: ignores occlusion order"
TWO_SPHERES = (("in front", 1.8, 0.35), ("behind A", -2.5, 1.3), ("behind the eye", 6.0, 0.6), ("through A", 0.5, 0.62))
"""title, centre on the z axis and radius of sphere B; A is the seed's"""


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
    """Two spheres: the seed's condition, and order by |E - C|^2 - R^2, against depth in each pixel."""
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


def _derivative(lab: Lab) -> list[Finding]:
    literal = translate(lab.scene, "literal")
    assert isinstance(literal, SphereTranslation), "Chapter 1 has one sphere"
    program = literal.image
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
    times = [ns_of_kernel(lab.scene, side, "double", bake=bake) for bake in (False, True)]
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
    assert isinstance(translation, SphereTranslation), "Chapter 1 has one sphere"
    counts: dict[str, str] = {}
    for rate in ("frame", "row", "pixel"):
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
