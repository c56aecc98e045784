"""range.h against exact rationals: whatever an operation computes is as near to the truth as its range says.

Operands are drawn as the header's first lines allow them: any v in the range, any hi + lo that the errors admit, as far
off as they admit. The operation itself is the C of the kernels, in each of its formats.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from c_harness import SnippetLibrary, compile_c
from evaluators import THOROUGH, modest
from hypothesis import given
from hypothesis import strategies as st

FLOAT64, PAIR, DOUBLE_DOUBLE = 0, 1, 2
FORMATS = {"float64": FLOAT64, "pair": PAIR, "double_double": DOUBLE_DOUBLE}
U = 2.0**-53
ROOM = 1 + Fraction(1, 2**8)
"""What range_error adds at the end, for all roundings and products of errors that the operations leave out."""
UNDERFLOW = Fraction(1, 2**900)
DRAWS = 40_000 if THOROUGH else 400

C = r"""
#include "range.h"
#include "pair.h"
#include "phong_power.h"
#include "precise_power.h"
#include "whole_power.h"
#include <stddef.h>

static range range_of(const double *p)
{
    const range r = {.least = p[0], .most = p[1], .relative = p[2], .root = p[3], .absolute = p[4],
                     .low_relative = p[5], .low = p[6]};
    return r;
}

static void put(double *p, range r)
{
    p[0] = r.least, p[1] = r.most, p[2] = r.relative, p[3] = r.root, p[4] = r.absolute;
    p[5] = r.low_relative, p[6] = r.low;
}

void apply(int operation, int form, const double *a, const double *b, const double *x, const double *y, double *r,
           double *z, ptrdiff_t count)
{
    for (ptrdiff_t i = 0; i < count; ++i) {
        const range p = range_of(a + 7 * i), q = range_of(b + 7 * i);
        const double_double v = {x[2 * i], x[2 * i + 1]}, w = {y[2 * i], y[2 * i + 1]};
        const number_format f = (number_format)form;
        range found = p;
        double_double d = v;
        switch (operation) {
        case 0:
            found = range_sum(f, p, q);
            d = f == FLOAT64 ? dd_from(v.hi + w.hi) : f == PAIR ? pair_add(v, w) : dd_add(v, w);
            break;
        case 1:
            found = range_difference(f, p, q);
            d = f == FLOAT64 ? dd_from(v.hi - w.hi) : f == PAIR ? pair_sub(v, w) : dd_sub(v, w);
            break;
        case 2:
            found = range_product(f, p, q);
            d = f == FLOAT64 ? dd_from(v.hi * w.hi) : f == PAIR ? pair_mul(v, w) : dd_mul(v, w);
            break;
        case 3:
            found = range_square(f, p);
            d = f == FLOAT64 ? dd_from(v.hi * v.hi) : f == PAIR ? pair_square(v) : dd_mul(v, v);
            break;
        case 4:
            found = range_inverse(f, p);
            d = f == FLOAT64 ? dd_from(1.0 / v.hi) : f == PAIR ? pair_inverse(v) : dd_div(dd_from(1.0), v);
            break;
        case 5:
            found = range_quotient(f, p, q);
            d = f == FLOAT64 ? dd_from(v.hi / w.hi) : f == PAIR ? pair_div(v, w) : dd_div(v, w);
            break;
        case 6:
            found = range_root(f, p);
            d = f == FLOAT64 ? dd_from(sqrt(v.hi > 0.0 ? v.hi : 0.0))
                : f == PAIR ? pair_sqrt(pair_positive_part(v)) : dd_sqrt(dd_positive_part(v));
            break;
        case 7:
            found = range_positive_part(p);
            d = f == FLOAT64 ? dd_from(v.hi > 0.0 ? v.hi : 0.0)
                : f == PAIR ? pair_positive_part(v) : dd_positive_part(v);
            break;
        case 8: found = range_neg(p); d = dd_neg(v); break;
        case 9: found = range_scaled(p, 0x1p-7); d = dd_scale(v, 0x1p-7); break;
        case 10: found = range_ldexp(p, 9); d = dd_ldexp(v, 9); break;
        case 11: found = range_high(p); d = dd_from(v.hi); break;
        case 12: found = range_either(p, q); break;
        case 13:
            found = range_difference_in_order(p, q);
            d = dd_from(w.lo != 0.0 ? (v.hi - w.hi) - w.lo : (v.hi - w.hi) + v.lo);
            break;
        case 14:   /* one operand a double: its lo and low are 0 */
            found = range_sum(f, p, q);
            d = f == PAIR ? pair_add_double(v, w.hi) : dd_add_double(v, w.hi);
            break;
        case 15:
            found = range_product(f, p, q);
            d = f == PAIR ? pair_mul_double(v, w.hi) : dd_mul_double(v, w.hi);
            break;
        case 16: found = range_sum(DOUBLE_DOUBLE, p, q); d = dd_sum(v.hi, w.hi); break;
        case 17: found = range_difference(DOUBLE_DOUBLE, p, q); d = dd_difference(v.hi, w.hi); break;
        case 18: found = range_product(DOUBLE_DOUBLE, p, q); d = dd_product(v.hi, w.hi); break;
        case 19: found = range_blurred(p, 0x1p-58); break;
        case 20: found = range_known(p.least); break;
        case 21: found = range_known_wide(v); break;
        default: found.least = NAN; break;
        }
        put(r + 7 * i, found);
        z[2 * i] = d.hi;
        z[2 * i + 1] = d.lo;
    }
}

void powers(int form, const double *a, const double *b, const double *n, const double *x, const double *y, double *r,
            double *z, ptrdiff_t count)
{
    for (ptrdiff_t i = 0; i < count; ++i) {
        const range p = range_of(a + 7 * i), q = range_of(b + 7 * i), e = range_exact(n[i]);
        const double_double c = {x[2 * i], x[2 * i + 1]}, s = {y[2 * i], y[2 * i + 1]};
        const double_double d = form == FLOAT64 ? dd_from(power_of_cosine(c.hi, s.hi, n[i]))
                                                : precise_power_of_cosine(c, s, n[i]);
        if (form == FLOAT64)
            put(r + 7 * i, range_power_of_cosine(FLOAT64, p, q, e, 0.0, POWER_ERROR));
        else
            put(r + 7 * i, range_power_of_cosine(PAIR, p, q, e, PRECISE_POWER_ERROR, PRECISE_POWER_FLOOR));
        z[2 * i] = d.hi;
        z[2 * i + 1] = d.lo;
    }
}

void wholes(int form, const double *a, const int *h, const double *x, double *r, double *z, ptrdiff_t count)
{
    for (ptrdiff_t i = 0; i < count; ++i) {
        double square = x[2 * i], low = x[2 * i + 1];
        z[2 * i + 1] = 0.0;
        if (form == FLOAT64)
            whole_powers_of_square(&square, z + 2 * i, h[i], 1);
        else
            whole_powers_of_pair(&square, &low, z + 2 * i, z + 2 * i + 1, h[i], 1);
        put(r + 7 * i, range_whole_power(form == FLOAT64 ? FLOAT64 : PAIR, range_of(a + 7 * i), h[i]));
    }
}

void errors(const double *a, double *bound, ptrdiff_t count)
{
    for (ptrdiff_t i = 0; i < count; ++i)
        bound[i] = range_error(range_of(a + 7 * i));
}

double light_gap2(const double *x, const double *y, const double *z)
{
    return range_light_gap2(range_of(x), range_of(y), range_of(z));
}

double length(const double *x, const double *y, const double *z)
{
    return range_length(range_of(x), range_of(y), range_of(z));
}
"""
CDEF = """
void apply(int, int, const double *, const double *, const double *, const double *, double *, double *, ptrdiff_t);
void errors(const double *, double *, ptrdiff_t);
double light_gap2(const double *, const double *, const double *);
double length(const double *, const double *, const double *);
void wholes(int, const double *, const int *, const double *, double *, double *, ptrdiff_t);
void powers(int, const double *, const double *, const double *, const double *, const double *, double *, double *,
            ptrdiff_t);
"""


def library() -> SnippetLibrary:
    return compile_c(C, CDEF)


@dataclass(frozen=True, slots=True)
class Range:
    """The structure of range.h, and its first lines as predicates."""

    least: float
    most: float
    relative: float = 0.0
    root: float = 0.0
    absolute: float = 0.0
    low_relative: float = 0.0
    low: float = 0.0

    @property
    def row(self) -> tuple[float, ...]:
        return self.least, self.most, self.relative, self.root, self.absolute, self.low_relative, self.low

    def holds(self, v: Fraction) -> bool:
        return (self.least == -math.inf or self.least <= v) and (self.most == math.inf or v <= self.most)

    def allows(self, v: Fraction, c: Fraction, room: Fraction = Fraction(1)) -> bool:
        """|c - v| <= relative |v| + 2 root sqrt|v| + root^2 + absolute"""
        if math.inf in (self.relative, self.root, self.absolute) or math.isnan(self.absolute + self.relative):
            return True
        rest = abs(c - v) - room * (_(self.relative) * abs(v) + _(self.root) ** 2 + _(self.absolute))
        if rest <= 0 or self.root == 0.0:
            return rest <= 0
        return rest**2 <= (2 * room * _(self.root)) ** 2 * abs(v)

    def allows_low(self, c: Fraction, lo: float, room: Fraction = Fraction(1)) -> bool:
        """|lo| <= low_relative |c| + low"""
        if not math.isfinite(self.low_relative + self.low + self.relative + self.root + self.absolute):
            return True
        return abs(_(lo)) <= room * (_(self.low_relative) * abs(c) + _(self.low)) + Fraction(1, 2**1000)


def _(value: float) -> Fraction:
    return Fraction(value)


@dataclass(frozen=True, slots=True)
class Operand:
    """A true value, what the kernel holds of it, and what the range says of both."""

    range: Range
    true: Fraction
    hi: float
    lo: float

    @property
    def computed(self) -> Fraction:
        return _(self.hi) + _(self.lo)


# ------------------------------------------------------------------------------------------------------------- drawing


def size_of_error(draw: random.Random, kind: str) -> float:
    """A part of the size: 0, about one rounding of float64, about one of pairs, up to 2^-9, or as large as the size."""
    if kind == "none" or draw.random() < 0.35:
        return 0.0
    if kind == "wide":
        return draw.uniform(0.5, 4.0) * 2.0 ** -draw.choice((100, 104, 106, draw.randint(90, 115)))
    if kind == "plain":
        return draw.uniform(0.5, 8.0) * 2.0 ** -draw.choice((53, 52, draw.randint(40, 60)))
    if kind == "drowned":
        return draw.uniform(0.1, 2.0)
    return draw.uniform(0.5, 1.0) * 2.0 ** -draw.randint(9, 40)


def operand(
    draw: random.Random,
    form: int,
    *,
    drowned: bool,
    positive: bool = False,
    away: bool = False,
    cut: bool = False,
    factor: bool = False,
) -> Operand:
    """An operand whose true value is as far from what the kernel holds as its range admits, or less.

    positive, away    v >= 0, v and its errors clear of 0
    cut, factor       for max(0, a), where a relative error and a root at once are not counted to the last; see FACTORS
    """
    size = 2.0 ** draw.choice((0, 0, 0, draw.randint(-4, 4), draw.randint(-60, 60), draw.randint(-200, 200)))
    hi = size * draw.choice((1.0, draw.uniform(1.0, 2.0), 1.0 + draw.randint(0, 8) * 2.0**-52, 2.0 - 2.0**-52))
    if not (positive or draw.random() < 0.6):
        hi = -hi
    if not away and draw.random() < 0.03:
        hi = 0.0
    kinds = ("none", "plain", "plain", "large", *(("drowned", "drowned") if drowned else ()))
    kind = draw.choice(kinds if form == FLOAT64 else ("wide", "wide", *kinds))
    smallest = 1 if drowned and not factor else 9
    relative, root, absolute = (size_of_error(draw, kind) for _unused in range(3))
    lo, low_relative, low = 0.0, 0.0, 0.0
    if form == DOUBLE_DOUBLE:
        low_relative = U
        lo = draw.choice((0.0, draw.uniform(-0.5, 0.5), 0.4999)) * math.ulp(hi) if hi else 0.0
    if form == PAIR:
        low_relative = draw.choice((0.0, U, 4.0 * U, 2.0 ** -draw.randint(smallest, 50)))
        low = size * draw.choice(
            (0.0, U, 2.0 ** -draw.randint(smallest, 60), 8.0 if kind == "drowned" and not factor else 0.0)
        )
        lo = draw.choice((-1.0, 1.0, draw.uniform(-1.0, 1.0))) * (0.99 * low_relative * abs(hi) + low)
    if cut:
        relative = 0.0 if root else relative
    low = enough_low(hi, lo, low_relative, low)
    root *= math.sqrt(size)
    absolute *= size
    if away:  # the error must leave the sign alone, or nothing is known
        root, absolute = min(root, 2.0**-4 * math.sqrt(size)), min(absolute, 2.0**-4 * size)
    computed = _(hi) + _(lo)
    bare = Range(-math.inf, math.inf, relative, root, absolute, low_relative, low)
    true = computed
    share = draw.choice((0.0, 1.0, 1.0, draw.random()))
    if share:
        off = relative * abs(hi) + 2.0 * root * math.sqrt(abs(hi)) + root**2 + absolute
        sign = draw.choice((-1, 1))
        for _k in range(24):
            moved = computed + sign * _(share * off)
            if bare.allows(moved, computed) and not (positive and moved < 0):
                true = moved
                break
            share *= 0.97 if _k < 12 else 0.5
    if positive and true < 0:
        true = Fraction(0)
        if not bare.allows(true, computed):
            return operand(draw, form, drowned=drowned, positive=positive, away=away, cut=cut, factor=factor)
    least, most = ends(draw, true, size, positive=positive, away=away)
    return Operand(replace(bare, least=least, most=most), true, hi, lo)


def enough_low(hi: float, lo: float, low_relative: float, low: float) -> float:
    """The least `low`, or a little more, with which |lo| <= low_relative |hi + lo| + low."""
    missing = abs(_(lo)) - _(low_relative) * abs(_(hi) + _(lo))
    return max(low, math.nextafter(float(missing), math.inf)) if missing > _(low) else low


def ends(draw: random.Random, true: Fraction, size: float, *, positive: bool, away: bool) -> tuple[float, float]:
    """A range that holds the value: tight, wide, from 0 on, across 0, without an end."""
    least = math.nextafter(float(true), -math.inf) if _(float(true)) > true else float(true)
    most = math.nextafter(float(true), math.inf) if _(float(true)) < true else float(true)
    width = size * draw.choice((0.0, 0.0, 2.0**-52, 2.0**-20, 0.5, 1.0, 64.0))
    other = size * draw.choice((0.0, 0.0, 2.0**-52, 0.5, 64.0, math.inf))
    below, above = (width, other) if draw.random() < 0.5 else (other, width)
    low, high = least - below, most + above
    if positive:
        low = max(low, 0.0)
    if away and low <= 0.0 <= high:
        low, high = (0.75 * least, high) if least > 0.0 else (low, 0.75 * most)
    return low, high


def opposite(draw: random.Random, form: int, x: Operand, *, drowned: bool) -> Operand:
    """An operand whose value is nearly minus that of x: their sum cancels."""
    other = operand(draw, form, drowned=drowned)
    hi = -x.hi * (1.0 + draw.choice((0.0, 2.0**-52, -(2.0**-52), 2.0**-30)))
    shift = _(hi) + _(x.lo if form == PAIR else 0.0)
    lo = x.lo if form == PAIR else 0.0
    error = abs(other.true - other.computed)
    true = shift + error * draw.choice((-1, 1))
    found = replace(other.range, low_relative=x.range.low_relative, low=x.range.low if form == PAIR else 0.0)
    found = replace(found, low=enough_low(hi, lo, found.low_relative, found.low))
    found = replace(found, least=-math.inf, most=math.inf)
    if not found.allows(true, shift):
        true = shift
    least, most = ends(draw, true, abs(hi) or 1.0, positive=False, away=False)
    return Operand(replace(found, least=least, most=most), true, hi, lo)


# ---------------------------------------------------------------------------------------------------------- operations


@dataclass(frozen=True, slots=True)
class Operation:
    """Its number in C; the exact result; which operands it takes."""

    code: int
    exact: Callable[[Fraction, Fraction], Fraction]
    formats: tuple[str, ...] = ("float64", "pair", "double_double")
    positive: bool = False
    away: tuple[bool, bool] = (False, False)
    second: str = "same"


def _positive(a: Fraction, _b: Fraction) -> Fraction:
    return max(a, Fraction(0))


OPERATIONS: dict[str, Operation] = {
    "sum": Operation(0, lambda a, b: a + b),
    "difference": Operation(1, lambda a, b: a - b),
    "product": Operation(2, lambda a, b: a * b),
    "square": Operation(3, lambda a, b: a * a),
    "inverse": Operation(4, lambda a, b: 1 / a, away=(True, True)),
    "quotient": Operation(5, lambda a, b: a / b, away=(False, True)),
    "root": Operation(6, lambda a, b: a, positive=True),
    "positive_part": Operation(7, _positive),
    "neg": Operation(8, lambda a, b: -a),
    "scaled": Operation(9, lambda a, b: a / 128),
    "ldexp": Operation(10, lambda a, b: a * 512),
    "high": Operation(11, lambda a, b: a, ("pair", "double_double")),
    "either": Operation(12, lambda a, b: a),
    "difference_in_order": Operation(13, lambda a, b: a - b, ("double_double",), second="one is a double"),
    "sum with a double": Operation(14, lambda a, b: a + b, ("pair", "double_double"), second="double"),
    "product with a double": Operation(15, lambda a, b: a * b, ("pair", "double_double"), second="double"),
    "sum of doubles": Operation(16, lambda a, b: a + b, ("float64",)),
    "difference of doubles": Operation(17, lambda a, b: a - b, ("float64",)),
    "product of doubles": Operation(18, lambda a, b: a * b, ("float64",)),
}
FACTORS = {"product", "square", "inverse", "quotient", "root", "product with a double"}
"""Operations on pairs whose ranges leave out products of three lows: here lows are at most 2^-9 of the value."""
CASES = [(name, form) for name, operation in OPERATIONS.items() for form in operation.formats]


def operands(draw: random.Random, name: str, form: int, *, drowned: bool) -> tuple[Operand, Operand]:
    operation = OPERATIONS[name]
    factor, cut = name in FACTORS, name == "positive_part"
    x = operand(
        draw, form, drowned=drowned, positive=operation.positive, away=operation.away[0], cut=cut, factor=factor
    )
    second = FLOAT64 if operation.second == "double" else form
    if operation.code in (0, 1, 13, 14, 16, 17) and draw.random() < 0.4:
        y = opposite(draw, second, x, drowned=drowned)
        if operation.code in (1, 13, 17):
            y = negated(y)
    else:
        y = operand(draw, second, drowned=drowned, away=operation.away[1], factor=factor)
    if second == FLOAT64:
        y = plain(y)
    if operation.second == "one is a double":
        x, y = (plain(x), y) if draw.random() < 0.5 else (x, plain(y))
    return x, y


def negated(y: Operand) -> Operand:
    return Operand(replace(y.range, least=-y.range.most, most=-y.range.least), -y.true, -y.hi, -y.lo)


def plain(x: Operand) -> Operand:
    """The operand as a double: without lo, its value moved along."""
    found = replace(x.range, low_relative=0.0, low=0.0, least=-math.inf, most=math.inf)
    true = x.true - _(x.lo)
    if not found.allows(true, _(x.hi)):
        true = _(x.hi)
    least = x.range.least if x.range.least <= true else math.nextafter(float(true), -math.inf)
    most = x.range.most if x.range.most >= true else math.nextafter(float(true), math.inf)
    return Operand(replace(found, least=least, most=most), true, x.hi, 0.0)


def applied(name: str, form: int, pairs: list[tuple[Operand, Operand]]) -> Iterator[tuple[Range, float, float]]:
    """The resulting range, and hi and lo of what the kernel computes."""
    count = len(pairs)
    a, b = (np.array([both[k].range.row for both in pairs]) for k in (0, 1))
    x, y = (np.array([(both[k].hi, both[k].lo) for both in pairs]) for k in (0, 1))
    r, z = np.empty((count, 7)), np.empty((count, 2))
    library().call("apply", OPERATIONS[name].code, form, a, b, x, y, r, z, count)
    for row, (hi, lo) in zip(r.tolist(), z.tolist(), strict=True):
        yield Range(*row), hi, lo


def violation(name: str, x: Operand, y: Operand, found: Range, hi: float, lo: float) -> str | None:
    """What of the header's first lines does not hold of the result; None where all does."""
    if not math.isfinite(hi + lo) or math.isnan(found.least) or math.isnan(found.most):
        return None if math.inf in (found.relative, found.absolute) else "not a number, and no word of it"
    computed, true = _(hi) + _(lo), OPERATIONS[name].exact(x.true, y.true)
    if name == "root":
        return root_violation(true, found, computed, lo)
    if not found.holds(true):
        return f"true {float(true)!r} is not between {found.least!r} and {found.most!r}"
    if not found.allows(true, computed, ROOM) and abs(true - computed) > UNDERFLOW:
        return f"off by {float(computed - true):.4e}, true {float(true):.4e}"
    if not found.allows_low(computed, lo, ROOM):
        return f"lo is {lo:.4e} of {float(computed):.4e}"
    return None


def root_violation(square: Fraction, found: Range, computed: Fraction, lo: float) -> str | None:
    """The same for a square root, by its enclosure between two fractions."""
    with mpmath.workprec(600):
        value = mpmath.sqrt(mpmath.mpf(square.numerator) / square.denominator)
        man, exponent = mpmath.frexp(value)
        below = Fraction(int(mpmath.floor(man * 2**560)), 2**560) * Fraction(2) ** int(exponent)
    above = below * (1 + Fraction(1, 2**550))
    if not (found.holds(below) or found.holds(above)):
        return f"true {float(below)!r} is not between {found.least!r} and {found.most!r}"
    if not (found.allows(below, computed, ROOM) or found.allows(above, computed, ROOM)):
        return f"off by {float(computed - below):.4e}, true {float(below):.4e}"
    if not found.allows_low(computed, lo, ROOM):
        return f"lo is {lo:.4e} of {float(computed):.4e}"
    return None


def violations(name: str, form: int, pairs: list[tuple[Operand, Operand]]) -> list[str]:
    found = []
    for (x, y), (result, hi, lo) in zip(pairs, applied(name, form, pairs), strict=True):
        assert x.range.holds(x.true), x
        assert x.range.allows(x.true, x.computed), x
        assert x.range.allows_low(x.computed, x.lo), x
        assert y.range.holds(y.true), y
        assert y.range.allows_low(y.computed, y.lo), y
        assert y.range.allows(y.true, y.computed), y
        said = violation(name, x, y, result, hi, lo)
        if said:
            found.append(f"{said}\n  x {x}\n  y {y}\n  -> {result} {hi!r} {lo!r}")
    return found


@pytest.mark.parametrize("drowned", [False, True], ids=["small errors", "errors as large as the value"])
@pytest.mark.parametrize(("name", "form"), CASES)
def test_no_admissible_operands_lead_out_of_the_range_of_the_result(name: str, form: str, drowned: bool) -> None:
    draw = random.Random(f"{name} {form} {drowned}")
    pairs = [operands(draw, name, FORMATS[form], drowned=drowned) for _k in range(DRAWS)]
    found = violations(name, FORMATS[form], pairs)
    assert not found, f"{len(found)} of {len(pairs)}; {found[0]}"


@modest(40)
@given(st.sampled_from(CASES), st.booleans(), st.randoms(use_true_random=False))
def test_no_operands_that_hypothesis_finds_lead_out_either(
    case: tuple[str, str], drowned: bool, draw: random.Random
) -> None:
    name, form = case
    pairs = [operands(draw, name, FORMATS[form], drowned=drowned) for _k in range(4)]
    assert not violations(name, FORMATS[form], pairs)


# -------------------------------------------------------------------------------------------------------- the highlight


def cosine(draw: random.Random, n: float) -> Fraction:
    """r.v from 1 down to 0: where the power falls, all over, and next to 0; for n < 2 not below 2^-10."""
    kind = draw.choice(("top", "top", "all", "zero"))
    if kind == "top":
        sin2 = Fraction(min(0.9, draw.uniform(0.0, 40.0) / max(n, 1.0))) * Fraction(draw.choice((1.0, 1e-3, 1e-12)))
        found = Fraction(math.sqrt(float(1 - sin2))) if sin2 > 1e-6 else 1 - sin2 / 2
    else:
        found = Fraction(draw.random() if kind == "all" else 10.0 ** -draw.uniform(0.0, 20.0))
    return max(found, Fraction(1, 2**10)) if n < 2.0 else found


def an_exponent(draw: random.Random) -> float:
    return draw.choice(
        (10.0 ** draw.uniform(-3.0, 13.0), float(draw.randint(1, 200)), draw.uniform(0.0, 2.0), 1.0, 2.0)
    )


def a_power(draw: random.Random, form: int, n: float) -> tuple[Operand, Operand, float, Fraction]:
    """cos^2 and sin^2 as a kernel holds them, n, and r.v, which is negative where its sign was lost."""
    true = cosine(draw, n)
    unit = U if form == FLOAT64 else U * U
    root, absolute, relative = (unit * 2.0 ** draw.uniform(0.0, 12.0) * draw.choice((0.0, 1.0)) for _k in range(3))
    if draw.random() < 0.2:
        root, absolute = root + 10.0 ** draw.uniform(-12.0, -3.0) / n, absolute + 10.0 ** draw.uniform(-12.0, -1.0) / n
    least, most = (2.0**-20 if n < 2.0 else 0.0), 1.0
    off = Fraction(root) * draw.choice((-1, 0, 1))
    lost = off < 0 and n >= 2.0 and draw.random() < 0.2
    if lost:  # r.v < 0 was computed as positive
        true = -draw.choice((Fraction(0), Fraction(1, 2), Fraction(999, 1000))) * abs(off)
        off = -off
    held = abs(true + off)
    cos2 = held**2 * (1 + draw.choice((-1, 0, 1)) * Fraction(relative)) + draw.choice((0, 1)) * Fraction(absolute)
    if form == PAIR:
        shift = draw.choice((0.0, 2.0**-53, -(2.0**-50), 2.0**-51))
        word = float(held) - shift
        hi = word * word
        lo = float(cos2 - Fraction(hi))
        low = 2.0 * abs(shift) + 4.0 * U
        computed = Operand(Range(least, most, relative + 2.0**-104, root, absolute, 4.0 * U, low), true**2, hi, lo)
    else:
        computed = Operand(Range(least, most, relative + 2.0 * U, root, absolute), true**2, float(cos2), 0.0)
    sin2_true = 1 - true**2
    if form == PAIR:  # the complement of what is held of cos^2
        hi = 1.0 - computed.hi
        lo = float(1 - cos2 - Fraction(hi))
        bound = relative + 2.0 * root + root**2 + absolute + 2.0**-104
        sine = Operand(Range(0.0, 1.0, absolute=bound, low_relative=U, low=low + U), sin2_true, hi, lo)
    else:
        size = Fraction(math.sqrt(max(0.0, float(sin2_true))))
        held_sin2 = (size + draw.choice((-1, 0, 1)) * Fraction(root)) ** 2 if size else Fraction(root) ** 2
        held_sin2 *= 1 + draw.choice((-1, 0, 1)) * Fraction(relative)
        bounds = Range(0.0, 1.0, relative + 4.0 * U, root * (1.0 + 4.0 * U), absolute)
        sine = Operand(bounds, sin2_true, float(held_sin2), 0.0)
    return computed, sine, n, true


@pytest.mark.parametrize("form", ["float64", "pair"])
def test_powers_of_a_cosine_are_within_their_range(form: str) -> None:
    """Errors of cos^2 and sin^2 as of a kernel's steps, and now and then as large as the range admits."""
    draw = random.Random(form)
    drawn = (a_power(draw, FORMATS[form], an_exponent(draw)) for _k in range(4 * DRAWS))
    cases = [case for case in drawn if admitted(case)]
    assert len(cases) > 2 * DRAWS
    a, b = (np.array([case[k].range.row for case in cases]) for k in (0, 1))  # type: ignore[union-attr]
    x, y = (np.array([(case[k].hi, case[k].lo) for case in cases]) for k in (0, 1))  # type: ignore[union-attr]
    n = np.array([case[2] for case in cases])
    r, z = np.empty((len(cases), 7)), np.empty((len(cases), 2))
    library().call("powers", FORMATS[form], a, b, n, x, y, r, z, len(cases))
    share = within_ranges(cases, r, z)
    print(f"{form}: largest share of the bound {share:.3f}")


@pytest.mark.parametrize("form", ["float64", "pair"])
def test_even_whole_powers_by_squaring_are_within_their_range(form: str) -> None:
    """The same, for whole_power.h and every kind of whole half exponent: odd, even, a power of two."""
    draw = random.Random(f"whole {form}")
    halves = [*range(4, 20), 32, 64, 96, 127, 128, 255, 500, 511, 512]
    drawn = (a_power(draw, FORMATS[form], 2.0 * draw.choice(halves)) for _k in range(2 * DRAWS))
    cases = [case for case in drawn if admitted(case)]
    a = np.array([case[0].range.row for case in cases])
    x = np.array([(case[0].hi, case[0].lo) for case in cases])
    h = np.array([int(case[2]) // 2 for case in cases], dtype=np.intc)
    r, z = np.empty((len(cases), 7)), np.empty((len(cases), 2))
    library().call("wholes", FORMATS[form], a, h, x, r, z, len(cases))
    share = within_ranges(cases, r, z)
    print(f"{form}: largest share of the bound {share:.3f}")


def within_ranges(cases: list[tuple[Operand, Operand, float, Fraction]], r: np.ndarray, z: np.ndarray) -> float:
    """The largest share of its bound that the error of a power takes; asserts that none takes more."""
    bounded, worst = 0, 0.0
    with mpmath.workprec(400):
        for (cos2, sin2, exponent, true), row, (hi, lo) in zip(cases, r.tolist(), z.tolist(), strict=True):
            found = Range(*row)
            value = mpmath.mpf(0)
            if true > 0:
                value = (mpmath.mpf(true.numerator) / true.denominator) ** mpmath.mpf(exponent)
            away = abs(mpmath.mpf(hi) + mpmath.mpf(lo) - value)
            bound = found.relative * value + 2 * found.root * mpmath.sqrt(value) + mpmath.mpf(found.root) ** 2
            bound += found.absolute
            sizes = f"off {mpmath.nstr(away)}, bound {mpmath.nstr(bound)}"
            where = f"{cos2} {sin2} n {exponent!r} r.v {float(true)!r}: {sizes}"
            assert away <= bound * (1 + mpmath.mpf(2) ** -8) + mpmath.mpf(2) ** -900, where
            most_low = found.low_relative * abs(hi) * (1.0 + 2.0**-8) + found.low
            assert math.isinf(found.absolute) or abs(lo) <= most_low, where
            bounded += not math.isinf(found.absolute)
            worst = max(worst, float(away / bound)) if bound > mpmath.mpf(2) ** -900 else worst
    assert bounded > len(cases) // 2
    return worst


def admitted(case: tuple[Operand, Operand, float, Fraction]) -> bool:
    """Whether both operands are as their ranges say."""
    return all(
        op.range.holds(op.true) and op.range.allows(op.true, op.computed) and op.range.allows_low(op.computed, op.lo)
        for op in case[:2]
    )


# ---------------------------------------------------------------------------------------------------------- the rest


def test_a_known_number_is_within_its_range() -> None:
    """range_known: the true value is within one rounding of what is known; range_known_wide: within 2^-100."""
    draw = random.Random(7)
    true = [Fraction(draw.uniform(-1.0, 1.0)) + Fraction(draw.uniform(-1.0, 1.0)) / 2**60 for _k in range(500)]
    hi = [float(v) for v in true]
    lo = [float(v - Fraction(h)) for v, h in zip(true, hi, strict=True)]
    a = np.array([(h, h, *[0.0] * 5) for h in hi])
    x = np.array(list(zip(hi, lo, strict=True)))
    for code, words in ((20, 1), (21, 2)):
        r, z = np.empty((500, 7)), np.empty((500, 2))
        library().call("apply", code, DOUBLE_DOUBLE, a, a, x, x, r, z, 500)
        for row, v, h, rest in zip(r.tolist(), true, hi, lo, strict=True):
            found, computed = Range(*row), _(h) + (_(rest) if words == 2 else 0)
            assert found.holds(v)
            assert found.allows(v, computed)
            assert found.allows_low(computed, rest if words == 2 else 0.0)


def test_the_error_of_a_range_is_the_largest_that_it_admits_and_unknown_is_infinite() -> None:
    draw = random.Random(8)
    found = [operand(draw, PAIR, drowned=False) for _k in range(500)]
    a = np.array([x.range.row for x in found])
    bound = np.empty(500)
    library().call("errors", a, bound, 500)
    for x, most in zip(found, bound.tolist(), strict=True):
        assert most == math.inf or abs(x.computed - x.true) <= _(most)
    odd = np.array([(0.0, 1.0, math.nan, 0.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0, math.inf, 0.0, 0.0)])
    library().call("errors", odd, bound, 2)
    assert bound[:2].tolist() == [math.inf, math.inf]


def test_no_light_is_nearer_to_the_unit_sphere_than_the_gap_says() -> None:
    draw = random.Random(9)
    for _k in range(400):
        near = 1.0 + draw.choice((-1, 1)) * 10.0 ** draw.uniform(-15.0, -1.0)
        away = draw.choice((10.0 ** draw.uniform(-3.0, 3.0), near))
        way = [draw.gauss(0.0, 1.0) for _j in range(3)]
        length = math.sqrt(sum(v * v for v in way))
        lamp = [away * v / length for v in way]
        rows = []
        for v in lamp:
            room = abs(v) * draw.choice((0.0, 2.0**-50, 1e-3))
            rows.append(np.array((v - room * draw.random(), v + room * draw.random(), *[0.0] * 5)))
        gap = library().call("light_gap2", *rows)
        with mpmath.workprec(200):
            true = (mpmath.sqrt(sum(mpmath.mpf(v) ** 2 for v in lamp)) - 1) ** 2
            assert gap <= true
            assert library().call("length", *rows) >= mpmath.sqrt(sum(mpmath.mpf(v) ** 2 for v in lamp))
