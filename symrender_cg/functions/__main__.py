"""`python -m symrender_cg.functions`: print coefficients and proved bounds; `--write` regenerates the headers."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

from symrender_cg.functions import elementary_header, fast_header, header, lobe_header, precise_header
from symrender_cg.functions.elementary import elementary_bounds
from symrender_cg.functions.elementary_pairs import dd_bounds
from symrender_cg.functions.fast import fast_tables
from symrender_cg.functions.formats import DOUBLE, FLOAT
from symrender_cg.functions.pairs import DOUBLE_DOUBLE, PRECISE, Pair, PairTables, pair_tables
from symrender_cg.functions.power import PowerTables, power_tables

HEADERS: tuple[tuple[str, str, Callable[[str], str]], ...] = (
    (header.TEMPLATE, header.HEADER, header.render_power_header),
    (fast_header.TEMPLATE, fast_header.HEADER, fast_header.render_fast_header),
    (lobe_header.TEMPLATE, lobe_header.HEADER, lobe_header.render_lobe_header),
    (precise_header.TEMPLATE, precise_header.HEADER, precise_header.render_precise_header),
    (elementary_header.TEMPLATE, elementary_header.HEADER, elementary_header.render_elementary_header),
)
"""(template, header, what turns the text of one into that of the other)."""


def main(arguments: list[str] | None = None) -> int:
    """Print the tables; with --write, write the headers in the folder of templates. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m symrender_cg.functions", description=__doc__)
    parser.add_argument("--write", action="store_true", help="regenerate " + ", ".join(name for _, name, _ in HEADERS))
    parser.add_argument("--templates", type=Path, default=Path("templates"), help="folder of templates (./templates)")
    options = parser.parse_args(arguments)
    for form in (DOUBLE, FLOAT):
        print(_described(power_tables(form)))
    print(_described_fast())
    for level in (PRECISE, DOUBLE_DOUBLE):
        print(_described_pairs(pair_tables(level)))
    print(_described_elementary())
    if options.write:
        for template, name, render in HEADERS:
            (options.templates / name).write_text(render((options.templates / template).read_text()))
            print(f"wrote {options.templates / name}")
    return 0


def _described(tables: PowerTables) -> str:
    form, bounds = tables.format, tables.bounds
    return "\n".join(
        [
            f"{form.name}: u = 2^-{form.precision}; every bound is proved in ball arithmetic",
            *_column("2^r = 1 + r q(r)", "q", tables.exp2_tail, tables, tables.exp2_error),
            *_column("ln(1 + f) = 2 s + s z p(z)", "p", tables.log_tail, tables, tables.log_error),
            f"  with rounding   log2(1 + f) {bounds.log2_of_sum:.3f} u   log2 x {bounds.log2_unit:.3f} u   "
            f"2^y {bounds.exp2:.3f} u   x^n {bounds.power:.3g} absolute",
            "",
        ]
    )


def _described_fast() -> str:
    tables = fast_tables()
    rows = [f"    p{k:<3d} {FLOAT.literal(c)}" for k, c in enumerate(tables.log)]
    rows += [f"    q{k:<3d} {FLOAT.literal(c)}" for k, c in enumerate(tables.exp2)]
    return "\n".join(
        [
            f"fast: log2(1 + f) = f p(f) to {tables.log_error:.3g}, 2^r = 1 + r q(r) to {tables.exp2_error:.3g}",
            *rows,
            f"  with rounding   log2 x {tables.log_bound:.3g}   2^y {tables.exp2_bound:.3g}   "
            f"x^n {tables.power_bound:.3g} absolute",
            "",
        ]
    )


def _described_pairs(tables: PairTables) -> str:
    bounds = precise_header.proved_bounds(tables.level)
    return "\n".join(
        [
            f"{tables.level.prefix.rstrip('_')}: leading coefficients in two doubles",
            *_pairs("log2(1 + f) = s e(s^2)", "e", tables.log_pairs, tables.log_tail, tables.log_error),
            *_pairs("2^r = (1 + r d(r))^8", "d", tables.exp2_pairs, tables.exp2_tail, tables.exp2_error),
            f"  with rounding   log2 x 2^{math.log2(bounds.log2):.2f}   2^r 2^{math.log2(bounds.exp2):.2f}   "
            f"x^n 2^{math.log2(bounds.power):.2f}, all relative",
            "",
        ]
    )


def _described_elementary() -> str:
    double, single, pairs = (
        dataclasses.asdict(bounds) for bounds in (*map(elementary_bounds, (DOUBLE, FLOAT)), dd_bounds())
    )
    lines = ["elementary: relative errors with rounding    float, u = 2^-24   double, u = 2^-53   double-double"]
    lines += [
        f"  {name:<42s} {single[name]:<11.9g} u     {double[name]:<12.9g} u     2^{math.log2(pairs[name]):.2f}"
        for name in double
    ]
    return "\n".join([*lines, ""])


def _column(formula: str, name: str, coefficients: tuple[float, ...], tables: PowerTables, error: float) -> list[str]:
    lines = [f"  {formula}   relative error of the polynomial <= {error:.3g} = {tables.in_roundoffs(error):.3f} u"]
    lines += [f"    {name}{k:<3d} {tables.format.literal(c)}" for k, c in enumerate(coefficients)]
    return lines


def _pairs(formula: str, name: str, pairs: tuple[Pair, ...], tail: tuple[float, ...], error: float) -> list[str]:
    lines = [f"  {formula}   relative error of the polynomial <= {error:.3g} = 2^{math.log2(error):.2f}"]
    rows = [*(f"{DOUBLE.literal(high)} {low:+.17g}" for high, low in pairs), *map(DOUBLE.literal, tail)]
    return [*lines, *(f"    {name}{k:<3d} {row}" for k, row in enumerate(rows))]


if __name__ == "__main__":
    raise SystemExit(main())
