"""lobe_power.h from its template: the tables of `lobe.py` written as C.

Comes in: the text of lobe_power.h.j2. Goes out: the text of lobe_power.h, the same bytes every time. Never done here:
mathematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import jinja2

from symrender_cg.functions.formats import DOUBLE, FLOAT, Format
from symrender_cg.functions.header import HeaderFormat, rounded_up
from symrender_cg.functions.lobe import GROUP, LobeTables, lobe_tables
from symrender_cg.functions.power import LOWEST_MANTISSA, power_tables

TEMPLATE = "support/lobe_power.h.j2"
HEADER = "support/lobe_power.h"


@dataclass(frozen=True, slots=True)
class LobeFormat:
    """The words and numbers of one format as the template names them; `plain` has those of every header."""

    tables: LobeTables

    @property
    def form(self) -> Format:
        return self.tables.format

    @property
    def plain(self) -> HeaderFormat:
        return HeaderFormat(power_tables(self.form))

    @property
    def two_over_ln2(self) -> str:
        return self.form.literal(self.tables.log[0])

    @property
    def ln2(self) -> str:
        return self.form.literal(self.tables.exp2[0])

    @property
    def log_tail(self) -> str:
        return self._by_groups("p", "z", self.tables.log[1:])

    @property
    def exp2_tail(self) -> str:
        return self._by_groups("q", "r", self.tables.exp2[1:])

    @property
    def log2_bound(self) -> str:
        return rounded_up(self.tables.log2_bound)

    @property
    def exp2_bound(self) -> str:
        return rounded_up(self.tables.exp2_bound)

    @property
    def power_bound(self) -> str:
        return rounded_up(self.tables.power_bound)

    def _by_groups(self, name: str, x: str, coefficients: tuple[float, ...]) -> str:
        """Statements that sum groups of four terms by Horner's rule in x^4."""
        literals = [self.form.literal(c) for c in coefficients]
        groups = [self._group(literals[k : k + GROUP], x) for k in range(0, len(literals), GROUP)]
        steps = [f"{name} = {name} * {x}4\n        + ({group});" for group in groups[-2::-1]]
        return "\n    ".join([f"{self.form.name} {name} = {groups[-1]};", *steps])

    @staticmethod
    def _group(literals: list[str], x: str) -> str:
        pairs = [literals[k : k + 2] for k in range(0, len(literals), 2)]
        sums = [f"{pair[0]} + {pair[1]} * {x}" if len(pair) == 2 else pair[0] for pair in pairs]
        if len(sums) == 1:
            return sums[0]
        high = f"({sums[1]})" if "+" in sums[1] else sums[1]
        return f"({sums[0]})\n        + {high} * {x}2"


def render_lobe_header(template: str) -> str:
    """The text of lobe_power.h; a template that names something unknown is an error."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    formats = [LobeFormat(lobe_tables(form)) for form in (DOUBLE, FLOAT)]
    largest_direct = float(1 - LOWEST_MANTISSA)
    return environment.from_string(template).render(formats=formats, largest_direct=largest_direct)
