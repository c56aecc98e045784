"""Symbolic Rendering, Chapter 1, its eight cells walked through with this package.

    python examples/chapter1.py [--out chapter1] [--size 256]

Each cell does what the seed's cell does and then what symrender_cg makes of it; at the end stands a table of what was
measured beside what the seed says. Pictures go to the folder of --out. The cells are in chapter1_walk: rendering.py
(1 to 4), algebra.py (5 to 8), seed.py (the seed's own text).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from chapter1_walk.algebra import cell_5, cell_6, cell_7, cell_8
from chapter1_walk.lab import Finding, Lab
from chapter1_walk.pictures import Gallery
from chapter1_walk.rendering import cell_1, cell_2, cell_3, cell_4
from rich.console import Console
from rich.table import Table

from symrender_cg import Scene
from symrender_cg.reference.points import pixel_centres

CELLS: dict[str, Callable[[Lab], list[Finding]]] = {
    "3  the compiled image against the per-pixel one": cell_3,
    "4  timings": cell_4,
    "5  the silhouette is a theorem": cell_5,
    "6  derivatives, and baking": cell_6,
    "7  the Heaviside pitfall": cell_7,
    "8  two spheres": cell_8,
}


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


def _side(text: str) -> int:
    side = int(text)
    if not 16 <= side <= 2048:
        raise argparse.ArgumentTypeError(f"{side} is not from 16 to 2048")
    return side


if __name__ == "__main__":
    raise SystemExit(main())
