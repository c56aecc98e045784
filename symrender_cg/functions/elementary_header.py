"""elementary.h from its template: constants and proved bounds written as C.

Comes in: the text of elementary.h.j2. Goes out: the text of elementary.h, the same bytes every time. Never done here:
mathematics.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import jinja2
import mpmath

from symrender_cg.functions.elementary import ElementaryBounds, Logarithms, elementary_bounds, logarithms
from symrender_cg.functions.elementary_pairs import dd_bounds
from symrender_cg.functions.formats import DOUBLE, FLOAT, Format
from symrender_cg.functions.header import HeaderFormat, rounded_up
from symrender_cg.functions.pairs import HIGHEST_MANTISSA as HIGHEST_PAIR_MANTISSA
from symrender_cg.functions.pairs import LOWEST_MANTISSA as LOWEST_PAIR_MANTISSA
from symrender_cg.functions.pairs import PRECISE, SQUARINGS, as_pair
from symrender_cg.functions.power import HIGHEST_MANTISSA, LOWEST_MANTISSA, power_tables
from symrender_cg.functions.precise_header import as_c, as_power_of_two, literal, proved_bounds

TEMPLATE = "support/elementary.h.j2"
HEADER = "support/elementary.h"
NAMES = {"double": "double", "float": "single"}


@dataclass(frozen=True, slots=True)
class ElementaryFormat:
    """What the template names of one format beside what power.h does: each a piece of C or of a comment."""

    form: Format
    base: HeaderFormat
    constants: Logarithms
    bounds: ElementaryBounds

    def words(self) -> dict[str, str]:
        """Name in the template -> text."""
        form, constants = self.form, self.constants
        numbers = {
            "inverse_high": constants.inverse_high,
            "inverse_low": constants.inverse_low,
            "ln2_high": constants.ln2_high,
            "ln2_low": constants.ln2_low,
            "lowest_direct": float(LOWEST_MANTISSA - 1),
            "highest_direct": float(HIGHEST_MANTISSA - 1),
            "lowest_exponent": float(1 - form.bias - form.precision - 4),
            "highest_exponent": float(form.bias + 7),
            "lowest_expm1": -float(form.precision + 8),
            "highest_expm1": form.round(_largest_expm1(form)),
        }
        shared = ("real", "word", "suffix", "zero", "half", "one", "two", "round_shift", "fraction_bits", "ln2")
        return {
            **{name: str(getattr(self.base, name)) for name in shared},
            **{name: form.literal(value) for name, value in numbers.items()},
            **printed(self.bounds),
            "name": NAMES[form.name],
            "one_bits": form.bits(form.bits_of(1.0)),
            "tiny": f"0x1p-{form.precision + (1 if form is DOUBLE else 0)}{form.suffix}",
        }


def printed(bounds: ElementaryBounds) -> dict[str, str]:
    """The bounds in unit roundoffs, three digits or as many as tell it from 1, never below them."""
    return {name: _in_roundoffs(value) for name, value in dataclasses.asdict(bounds).items()}


def _in_roundoffs(value: float) -> str:
    if not 1.0 < value < 1.01:
        return rounded_up(value)
    digits = math.ceil(-math.log10(value - 1.0)) + 1
    return f"{1.0 + math.ceil((value - 1.0) * 10**digits) / 10**digits:.{digits}f}"


def _largest_expm1(form: Format) -> Any:
    """A little more than the largest x with a finite e^x."""
    with mpmath.workdps(30):
        return mpmath.log(2) * (form.bias + 1) * (1 + mpmath.mpf(2) ** -16)


def render_elementary_header(template: str) -> str:
    """The text of elementary.h; a template that names something unknown is an error."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    formats = [
        ElementaryFormat(form, HeaderFormat(power_tables(form)), logarithms(form), elementary_bounds(form)).words()
        for form in (DOUBLE, FLOAT)
    ]
    with mpmath.workdps(60):
        ln2 = mpmath.log(2)
        pairs = {"dd_ln2": as_pair(ln2), "dd_inverse_ln2": as_pair(1 / ln2)}
        ln2_of_squarings = literal(float(ln2 / 2**SQUARINGS))
    dd = {name: as_power_of_two(value) for name, value in dataclasses.asdict(dd_bounds()).items()}
    return environment.from_string(template).render(
        formats=formats,
        names=list(dd),
        double=formats[0],
        single=formats[1],
        dd=dd,
        round_shift=formats[0]["round_shift"],
        precise_bits=math.floor(-math.log2(proved_bounds(PRECISE).power)),
        dd_lowest_direct=literal(float(LOWEST_PAIR_MANTISSA - 1)),
        dd_highest_direct=literal(float(HIGHEST_PAIR_MANTISSA - 1)),
        ln2_of_squarings=ln2_of_squarings,
        **{name: as_c(pair) for name, pair in pairs.items()},
    )
