"""What `explain` prints of number formats, of how a level proves its values, and of boxes that another kernel draws."""

from __future__ import annotations

from collections.abc import Iterable

from symrender_cg.cli.console import Column, Table
from symrender_cg.cli.derivation import head
from symrender_cg.explain import FORMATS, Proof, SteepHighlight


def print_formats(formats: Iterable[tuple[str, tuple[str, ...]]]) -> None:
    """A row a number format: how many quantities are in it, and which."""
    found = dict(formats)
    table = Table((Column("format"), Column("quantities", right=True), Column("")))
    for form, words in FORMATS.items():
        if form in found:
            table.add(words, str(len(found[form])), ", ".join(found[form]))
    table.show()


def print_steep(found: SteepHighlight) -> None:
    """The box of the image that another kernel draws, in a line."""
    head("where the highlight is steep")
    edges = f"{found.left:.4g} <= x <= {found.right:.4g}, {found.bottom:.4g} <= y <= {found.top:.4g}"
    pixels = f"{found.columns} x {found.rows} of {found.width} x {found.height} pixels"
    print(f"{edges} ({pixels}) is drawn by {found.kernel}: plain float64 may be off by more than 1e-15 there")


def print_proof(proof: Proof) -> None:
    """What is claimed of every value, and the chain of stages that proves it."""
    head("how every value is proved")
    if proof.handed_over:
        print("plain float64 may be off by more than 1e-15 in this scene: the compensated kernel draws in its place\n")
    print(f"proved of every value: {proof.claim}; each stage settles what its bound can decide and hands on the rest\n")
    table = Table((Column("stage"), Column("takes"), Column("kernel"), Column("error", right=True), Column("how")))
    for stage in proof.stages:
        bound = "" if stage.bound is None else f"{stage.bound:.2e}"
        table.add(stage.name, stage.takes, stage.kernel, bound, stage.what)
    table.show()
    if proof.stages[0].bound is not None:
        print(
            f"\nerror: the most that the kernel's own value of any pixel of {proof.width} x {proof.height} can be off, "
            "before rounding"
        )
