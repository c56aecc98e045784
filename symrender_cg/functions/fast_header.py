"""fast_power.h from its template: the tables of `fast.py` written as C.

Comes in: the text of fast_power.h.j2. Goes out: the text of fast_power.h, the same bytes every time. Never done here:
mathematics.
"""

from __future__ import annotations

import math

import jinja2

from symrender_cg.functions.fast import EXP2_DEGREE, LEAST_LARGE_EXPONENT, LOBE_DEGREE, LOG_DEGREE, fast_tables
from symrender_cg.functions.formats import FLOAT
from symrender_cg.functions.header import rounded_up
from symrender_cg.functions.power import HIGHEST_MANTISSA, LOWEST_MANTISSA

TEMPLATE = "support/fast_power.h.j2"
HEADER = "support/fast_power.h"


def render_fast_header(template: str) -> str:
    """The text of fast_power.h; a template that names something unknown is an error."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    tables = fast_tables()
    p, q, s = ([FLOAT.literal(c) for c in coefficients] for coefficients in (tables.log, tables.exp2, tables.lobe))
    return environment.from_string(template).render(
        bound=rounded_up(tables.power_bound),
        macro=f"0x1p{math.ceil(math.log2(tables.power_bound))}f",
        log_bound=rounded_up(tables.log_bound),
        log_share=rounded_up(tables.log_bound / math.e),
        exp2_bound=rounded_up(tables.exp2_bound),
        log_degree=LOG_DEGREE,
        exp2_degree=EXP2_DEGREE,
        lowest_mantissa=LOWEST_MANTISSA,
        highest_mantissa=HIGHEST_MANTISSA,
        largest_direct=1 - LOWEST_MANTISSA,
        largest_direct_literal=FLOAT.literal(float(1 - LOWEST_MANTISSA)),
        lowest_bits=FLOAT.bits(FLOAT.bits_of(float(LOWEST_MANTISSA))),
        one_bits=FLOAT.bits(FLOAT.bits_of(1.0)),
        fraction_mask=FLOAT.bits(2**FLOAT.fraction_bits - 1),
        integer_bits=FLOAT.bits(FLOAT.bits_of(2.0**FLOAT.fraction_bits)),
        log_text=f"const float p = ({p[0]} + {p[1]} * f) + ({p[2]} + {p[3]} * f) * f2;",
        lobe_text=f"const float s = ({s[0]} + {s[1]} * g) + ({s[2]} + {s[3]} * g) * g2;",
        lobe_degree=LOBE_DEGREE,
        lobe_bound=rounded_up(tables.lobe_bound),
        narrow_bound=rounded_up(tables.narrow_bound),
        least_large=LEAST_LARGE_EXPONENT,
        exp2_text=f"const float q = {q[0]} + r * ({q[1]} + r * {q[2]});",
    )
