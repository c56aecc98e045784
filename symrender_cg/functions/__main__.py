"""`python -m symrender_cg.functions`: print the coefficients and their proved bounds; `--write` regenerates power.h."""

from __future__ import annotations

import argparse
from pathlib import Path

from symrender_cg.functions.formats import DOUBLE, FLOAT
from symrender_cg.functions.header import HEADER, TEMPLATE, render_power_header
from symrender_cg.functions.power import PowerTables, power_tables


def main(arguments: list[str] | None = None) -> int:
    """Print the tables; with --write, write support/power.h in the folder of templates. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m symrender_cg.functions", description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"regenerate {HEADER} from {TEMPLATE}")
    parser.add_argument("--templates", type=Path, default=Path("templates"), help="folder of templates (./templates)")
    options = parser.parse_args(arguments)
    for form in (DOUBLE, FLOAT):
        print(_described(power_tables(form)))
    if options.write:
        header = options.templates / HEADER
        header.write_text(render_power_header((options.templates / TEMPLATE).read_text()))
        print(f"wrote {header}")
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


def _column(formula: str, name: str, coefficients: tuple[float, ...], tables: PowerTables, error: float) -> list[str]:
    lines = [f"  {formula}   relative error of the polynomial <= {error:.3g} = {tables.in_roundoffs(error):.3f} u"]
    lines += [f"    {name}{k:<3d} {tables.format.literal(c)}" for k, c in enumerate(coefficients)]
    return lines


if __name__ == "__main__":
    raise SystemExit(main())
