"""power.h from its template: the tables of `power.py` written as C.

Comes in: the text of power.h.j2. Goes out: the text of power.h, the same bytes every time. Never done here:
mathematics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import jinja2

from symrender_cg.functions.formats import DOUBLE, FLOAT, Format
from symrender_cg.functions.power import HIGHEST_MANTISSA, LOWEST_MANTISSA, PowerTables, power_tables

TEMPLATE = "support/power.h.j2"
HEADER = "support/power.h"


@dataclass(frozen=True, slots=True)
class HeaderFormat:
    """The words and numbers of one format as the template names them, each a piece of C or of a comment."""

    tables: PowerTables

    @property
    def form(self) -> Format:
        return self.tables.format

    @property
    def real(self) -> str:
        return self.form.name

    @property
    def word(self) -> str:
        return self.form.word

    @property
    def suffix(self) -> str:
        return self.form.suffix

    @property
    def zero(self) -> str:
        return self.form.literal(0.0)

    @property
    def half(self) -> str:
        return self.form.literal(0.5)

    @property
    def one(self) -> str:
        return self.form.literal(1.0)

    @property
    def two(self) -> str:
        return self.form.literal(2.0)

    @property
    def largest_direct(self) -> str:
        """The largest g for which 1 - g needs no power of two taken out."""
        return self.form.literal(float(1 - LOWEST_MANTISSA))

    @property
    def fraction_bits(self) -> int:
        return self.form.fraction_bits

    @property
    def fraction_mask(self) -> str:
        return self.form.bits(2**self.form.fraction_bits - 1)

    @property
    def lowest_bits(self) -> str:
        return self.form.bits(self.form.bits_of(float(LOWEST_MANTISSA)))

    @property
    def one_bits(self) -> str:
        return self.form.bits(self.form.bits_of(1.0))

    @property
    def smallest_normal(self) -> str:
        return f"0x1p{1 - self.form.bias}{self.suffix}"

    @property
    def smallest_exponent(self) -> int:
        return 1 - self.form.bias

    @property
    def lowest_power(self) -> str:
        return self.form.literal(float(self.smallest_exponent))

    @property
    def subnormal_scale(self) -> str:
        return f"0x1p{self.form.precision + 1}{self.suffix}"

    @property
    def integer_bits(self) -> str:
        """The bits of 2^(precision - 1), whose low bits are a counter of ones."""
        return self.form.bits(self.form.bits_of(2.0**self.form.fraction_bits))

    @property
    def integer_offset(self) -> str:
        return f"0x1p{self.form.fraction_bits}{self.suffix} + {self.form.literal(float(self.form.bias))}"

    @property
    def integer_offset_subnormal(self) -> str:
        bias = float(self.form.bias + self.form.precision + 1)
        return f"0x1p{self.form.fraction_bits}{self.suffix} + {self.form.literal(bias)}"

    @property
    def round_shift(self) -> str:
        return f"0x1.8p{self.form.fraction_bits}{self.suffix}"

    @property
    def inverse_ln2(self) -> str:
        return self.form.literal(self.tables.inverse_ln2)

    @property
    def ln2(self) -> str:
        return self.form.literal(self.tables.exp2_tail[0])

    @property
    def log_tail(self) -> str:
        return self._by_pairs("p", "z", "z2", self.tables.log_tail)

    @property
    def exp2_tail(self) -> str:
        return self._by_pairs("q", "r", "r2", self.tables.exp2_tail[1:])

    @property
    def log_fit(self) -> str:
        return rounded_up(self.tables.in_roundoffs(self.tables.log_error))

    @property
    def exp2_fit(self) -> str:
        return rounded_up(self.tables.in_roundoffs(self.tables.exp2_error))

    @property
    def log2_of_sum_bound(self) -> str:
        return rounded_up(self.tables.bounds.log2_of_sum)

    @property
    def log2_bound(self) -> str:
        return rounded_up(self.tables.bounds.log2_unit)

    @property
    def exp2_bound(self) -> str:
        return rounded_up(self.tables.bounds.exp2)

    @property
    def power_bound(self) -> str:
        return rounded_up(self.tables.bounds.power)

    def _by_pairs(self, name: str, x: str, square: str, coefficients: tuple[float, ...]) -> str:
        """Statements for Horner's rule in x^2 over the pairs c + c' x: half as many dependent steps as in x."""
        literals = [self.form.literal(c) for c in coefficients]
        pairs = [literals[k : k + 2] for k in range(0, len(literals), 2)]
        terms = [f"{pair[0]} + {pair[1]} * {x}" if len(pair) == 2 else pair[0] for pair in pairs]
        steps = [f"{name} = {name} * {square} + ({term});" for term in terms[-2::-1]]
        return "\n    ".join([f"{self.real} {name} = {terms[-1]};", *steps])


def render_power_header(template: str) -> str:
    """The text of power.h; a template that names something unknown is an error."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    formats = [HeaderFormat(power_tables(form)) for form in (DOUBLE, FLOAT)]
    return environment.from_string(template).render(
        formats=formats, lowest_mantissa=LOWEST_MANTISSA, highest_mantissa=HIGHEST_MANTISSA
    )


def rounded_up(value: float) -> str:
    """A positive number in three digits, never below it: 0.0467, 2.78, 2.49e-16."""
    exponent = math.floor(math.log10(value)) - 2
    digits = math.ceil(value / 10.0**exponent * (1.0 - 2.0**-40))
    return f"{float(f'{digits}e{exponent}'):.3g}"
