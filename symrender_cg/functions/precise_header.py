"""precise_power.h from its template: the tables of `pairs.py` and the bounds of `pair_rounding.py` written as C.

Comes in: the text of precise_power.h.j2. Goes out: the text of precise_power.h, the same bytes every time. Never done
here: mathematics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import jinja2
import mpmath

from symrender_cg.functions.formats import DOUBLE
from symrender_cg.functions.header import rounded_up
from symrender_cg.functions.pair_rounding import PairBounds, bound_pairs
from symrender_cg.functions.pairs import (
    DOUBLE_DOUBLE,
    HIGHEST_MANTISSA,
    LARGEST_F,
    LARGEST_S,
    LOWEST_MANTISSA,
    MIDDLE_ZONE,
    PRECISE,
    SQUARINGS,
    Pair,
    PairLevel,
    PairTables,
    pair_tables,
)

TEMPLATE = "support/precise_power.h.j2"
HEADER = "support/precise_power.h"


def proved_bounds(level: PairLevel) -> PairBounds:
    """The bounds of one level."""
    return bound_pairs(pair_tables(level))


@dataclass(frozen=True, slots=True)
class HeaderLevel:
    """The words and numbers of one level as the template names them, each a piece of C or of a comment."""

    tables: PairTables
    bounds: PairBounds

    @property
    def prefix(self) -> str:
        return self.tables.level.prefix

    @property
    def lowest_power(self) -> int:
        return self.tables.level.lowest_power

    @property
    def macro(self) -> str:
        return f"{self.prefix.upper()}POWER_ERROR"

    @property
    def power_macro(self) -> str:
        """The least power of two that is not below the bound."""
        return f"0x1p-{self.bits}"

    @property
    def bits(self) -> int:
        return math.floor(-math.log2(self.bounds.power))

    @property
    def power_bound(self) -> str:
        return as_power_of_two(self.bounds.power)

    @property
    def log2_bound(self) -> str:
        return as_power_of_two(self.bounds.log2)

    @property
    def exp2_bound(self) -> str:
        return as_power_of_two(self.bounds.exp2)

    @property
    def log_fit(self) -> str:
        return as_power_of_two(self.tables.log_error)

    @property
    def exp2_fit(self) -> str:
        return as_power_of_two(self.tables.exp2_error)

    @property
    def log_degree(self) -> int:
        return len(self.tables.log_pairs) + len(self.tables.log_tail) - 1

    @property
    def exp2_degree(self) -> int:
        return len(self.tables.exp2_pairs) + len(self.tables.exp2_tail)

    @property
    def last_log_pair(self) -> int:
        return len(self.tables.log_pairs) - 1

    @property
    def last_exp2_pair(self) -> int:
        return len(self.tables.exp2_pairs)

    def zone_log(self, zone: int, part: int) -> str:
        return literal(self.tables.zone_logs[zone][part])

    @property
    def log_text(self) -> str:
        return horner(self.tables.log_pairs, self.tables.log_tail, "z.hi", "z")

    @property
    def exp2_text(self) -> str:
        return horner(self.tables.exp2_pairs, self.tables.exp2_tail, "x", "x")


def horner(pairs: tuple[Pair, ...], tail: tuple[float, ...], x: str, argument: str) -> str:
    """Statements for Horner's rule: the tail in doubles, then the pairs; the sum is named e."""
    step = "precise_step" if x != argument else "precise_step_by_double"
    lines = [f"double t = {literal(tail[-1])};"]
    lines += [f"t = fma(t, {x}, {literal(c)});" for c in tail[-2::-1]]
    lines += [f"double_double e = precise_step_of_doubles({as_c(pairs[-1])}, {x}, t);"]
    lines += [f"e = {step}({as_c(pair)}, {argument}, e);" for pair in pairs[-2::-1]]
    return "\n    ".join(lines)


def as_c(pair: Pair) -> str:
    return f"(double_double){{{literal(pair[0])}, {literal(pair[1])}}}"


def literal(value: float) -> str:
    return DOUBLE.literal(value)


def as_power_of_two(bound: float) -> str:
    """A small positive number as 2^-69.2, never below it."""
    return f"2^-{math.floor(-10.0 * math.log2(bound)) / 10.0:.1f}"


def render_precise_header(template: str) -> str:
    """The text of precise_power.h; a template that names something unknown is an error."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    with mpmath.workdps(40):
        ln2_of_squarings = literal(float(mpmath.log(2) / 2**SQUARINGS))
    return environment.from_string(template).render(
        levels=[HeaderLevel(pair_tables(level), proved_bounds(level)) for level in (PRECISE, DOUBLE_DOUBLE)],
        lowest_mantissa=LOWEST_MANTISSA,
        highest_mantissa=HIGHEST_MANTISSA,
        largest_direct=1 - LOWEST_MANTISSA,
        largest_direct_literal=literal(float(1 - LOWEST_MANTISSA)),
        lowest_bits=DOUBLE.bits(DOUBLE.bits_of(float(LOWEST_MANTISSA))),
        one_bits=DOUBLE.bits(DOUBLE.bits_of(1.0)),
        low_border=literal(float(1 - MIDDLE_ZONE.low)),
        high_border=literal(float(1 - MIDDLE_ZONE.high)),
        largest_f=rounded_up(float(LARGEST_F)),
        largest_z=rounded_up(float(LARGEST_S**2)),
        ln2_of_squarings=ln2_of_squarings,
    )
