"""ball.h and ball_power.h against rational arithmetic: what is in the operands' balls is in the result's.

A ball is tried at its centre, at both ends and in between; operands cancel, are zero, tiny, huge, infinite, or balls
that reach over 0. The true result is a fraction (fmpq: Python's are slow for numbers so tiny), or mpmath's at 400
bits.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from functools import cache

import mpmath
import numpy as np
import pytest
from c_harness import COMPILERS, SnippetLibrary, compile_c
from flint import fmpq
from hypothesis import example, given, settings
from hypothesis import strategies as st

Ball = tuple[float, float, float]

NO, YES, UNKNOWN = 0, 1, 2


def exactly(value: float) -> fmpq:
    """The float64 as a fraction."""
    return fmpq(*value.as_integer_ratio())


def nearest(value: fmpq) -> float:
    """The float64 nearest to a fraction."""
    return int(value.p) / int(value.q)


ARITHMETIC: dict[str, tuple[str, Callable[[fmpq, fmpq, float], fmpq | None]]] = {
    "neg": ("ball_neg(x)", lambda x, y, a: -x),
    "add": ("ball_add(x, y)", lambda x, y, a: x + y),
    "sub": ("ball_sub(x, y)", lambda x, y, a: x - y),
    "mul": ("ball_mul(x, y)", lambda x, y, a: x * y),
    "square": ("ball_square(x)", lambda x, y, a: x * x),
    "div": ("ball_div(x, y)", lambda x, y, a: x / y if y else None),
    "add_double": ("ball_add_double(x, a)", lambda x, y, a: x + exactly(a)),
    "mul_double": ("ball_mul_double(x, a)", lambda x, y, a: x * exactly(a)),
    "positive_part": ("ball_positive_part(x)", lambda x, y, a: max(fmpq(0), x)),
    "scaled": ("ball_scaled(x, -30)", lambda x, y, a: x / 2**30),
    "first": ("ball_hull(x, y)", lambda x, y, a: x),
    "second": ("ball_hull(x, y)", lambda x, y, a: y),
    "larger": ("ball_select(ball_less(x, y), y, x)", lambda x, y, a: max(x, y)),
}
"""operation -> its C, and the true result for x and y in their balls and a number a; None where there is none"""

OF_NUMBERS: dict[str, tuple[str, Callable[[fmpq, fmpq], fmpq]]] = {
    "sum": ("ball_sum(x.hi, y.hi)", lambda x, y: x + y),
    "difference": ("ball_difference(x.hi, y.hi)", lambda x, y: x - y),
    "product": ("ball_product(x.hi, y.hi)", lambda x, y: x * y),
    "from": ("ball_from(x.hi)", lambda x, y: x),
    "ldexp": ("ball_ldexp(x.hi, -60)", lambda x, y: x / 2**60),
}

DECISIONS: dict[str, tuple[str, Callable[[fmpq, fmpq], bool]]] = {
    "positive": ("ball_positive(x)", lambda x, y: x > 0),
    "not_negative": ("ball_not_negative(x)", lambda x, y: x >= 0),
    "zero": ("ball_zero(x)", lambda x, y: x == 0),
    "less": ("ball_less(x, y)", lambda x, y: x < y),
    "both": ("ball_both(ball_positive(x), ball_positive(y))", lambda x, y: x > 0 and y > 0),
    "either": ("ball_either(ball_positive(x), ball_positive(y))", lambda x, y: x > 0 or y > 0),
}

_ROOTS = {"sqrt": "ball_sqrt(x)", "power": "ball_power_of_cosine(x, y, a)"}


def _function(name: str, expression: str) -> str:
    return f"""
ball {name}(ball x, ball y, double a);
ball {name}(ball x, ball y, double a)
{{
    (void)x, (void)y, (void)a;
    return {expression};
}}
"""


@cache
def library(compiler: str = "gcc") -> SnippetLibrary:
    operations = {name: c for name, (c, _) in ARITHMETIC.items()} | {name: c for name, (c, _) in OF_NUMBERS.items()}
    operations |= {name: f"ball_from({c})" for name, (c, _) in DECISIONS.items()} | _ROOTS
    operations["floor"] = "ball_from(ball_floor(x))"
    operations["lower"], operations["upper"] = "ball_from(ball_lower(x))", "ball_from(ball_upper(x))"
    text = '#include "ball_power.h"\n' + "".join(_function(f"try_{name}", c) for name, c in operations.items())
    text += "void apply(int which, const double *in, double *out, int count);\n"
    text += "void apply(int which, const double *in, double *out, int count)\n{\n"
    text += "    for (int i = 0; i < count; ++i, in += 7, out += 3) {\n"
    text += (
        "        const ball x = {in[0], in[1], in[2]}, y = {in[3], in[4], in[5]};\n        ball z = ball_unknown();\n"
    )
    for number, name in enumerate(operations):
        text += f"        if (which == {number}) z = try_{name}(x, y, in[6]);\n"
    text += "        out[0] = z.hi;\n        out[1] = z.lo;\n        out[2] = z.error;\n    }\n}\n"
    built = compile_c(text, "void apply(int which, const double *in, double *out, int count);", compiler=compiler)
    _numbers.update({name: number for number, name in enumerate(operations)})
    return built


_numbers: dict[str, int] = {}


def apply(name: str, operands: list[tuple[Ball, Ball, float]], compiler: str = "gcc") -> list[Ball]:
    built = library(compiler)
    columns = np.array([(*x, *y, a) for x, y, a in operands], dtype=np.float64)
    out = np.empty((len(operands), 3))
    built.call("apply", _numbers[name], columns, out, len(operands))
    return [(hi, lo, error) for hi, lo, error in out.tolist()]


def points_of(x: Ball, draw: random.Random) -> list[fmpq]:
    """Numbers that the ball encloses: its centre, its ends, and one between."""
    centre, radius = exactly(x[0]) + exactly(x[1]), exactly(x[2])
    between = fmpq(draw.randint(-(2**40), 2**40), 2**40)
    return [centre, centre - radius, centre + radius, centre + between * radius]


def holds(z: Ball, true: fmpq) -> bool:
    if not math.isfinite(z[2]):
        return True
    return abs(exactly(z[0]) + exactly(z[1]) - true) <= exactly(z[2])


def normalised(hi: float, part: float) -> tuple[float, float]:
    total = exactly(hi) + exactly(part * math.ulp(hi) * 0.5)
    rounded = nearest(total)
    return rounded, nearest(total - exactly(rounded))


def a_ball(draw: random.Random, exponents: tuple[int, int] = (-60, 60)) -> Ball:
    """Exact or not, wide or narrow, about 0 or not, with a low part at, near or far below half an ulp."""
    mantissa = draw.choice((draw.uniform(1.0, 2.0), 1.0, 1.5, 2.0 - 2.0**-52, 1.0 + 2.0**-52))
    hi = draw.choice((1.0, -1.0, 1.0, -1.0, 0.0)) * math.ldexp(mantissa, draw.randint(*exponents))
    hi, lo = normalised(hi, draw.choice((draw.uniform(-1.0, 1.0), 1.0, -1.0, 0.0, 2.0**-52)))
    radius = abs(hi) * draw.choice((0.0, 2.0**-104, 2.0**-90, 2.0**-40, 0.5, 1.0, 1.0 - 2.0**-53, 1.5))
    return hi, lo, draw.choice((radius, radius, 0.0 if hi else 2.0 ** draw.randint(-1000, 3)))


def operands(count: int, seed: int, exponents: tuple[int, int] = (-60, 60)) -> list[tuple[Ball, Ball, float]]:
    """Every third pair of operands is nearly opposite or nearly equal."""
    draw = random.Random(seed)
    found = []
    for i in range(count):
        x, y = a_ball(draw, exponents), a_ball(draw, exponents)
        if i % 3 == 0:
            hi = x[0] * draw.choice((1.0, -1.0)) + draw.randint(-2, 2) * math.ulp(x[0])
            y = (*normalised(hi, draw.uniform(-1.0, 1.0)), y[2])
        a = draw.choice((y[0], 2.0, -1.0, 0.0, x[0], -x[0]))
        found.append((x, y, a))
    return found


RANGES = {"ordinary": (-60, 60), "tiny": (-1074, -400), "huge": (300, 1023), "both": (-1074, 1023)}


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("exponents", RANGES)
@pytest.mark.parametrize("name", ARITHMETIC)
def test_the_result_encloses_whatever_the_operands_enclose(name: str, exponents: str, compiler: str) -> None:
    draw, true = random.Random(5), ARITHMETIC[name][1]
    tried = operands(300, 11, RANGES[exponents])
    for (x, y, a), z in zip(tried, apply(name, tried, compiler), strict=True):
        for of_x in points_of(x, draw):
            for of_y in points_of(y, draw):
                wanted = true(of_x, of_y, a)
                assert wanted is not None or not math.isfinite(z[2]), f"{name} of a ball with no result: {x} {y}"
                assert wanted is None or holds(z, wanted), f"{name} {x} {y} {a} -> {z}"


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("exponents", RANGES)
@pytest.mark.parametrize("name", OF_NUMBERS)
def test_operations_on_numbers_enclose_their_result(name: str, exponents: str, compiler: str) -> None:
    tried = operands(300, 12, RANGES[exponents])
    for (x, y, _), z in zip(tried, apply(name, tried, compiler), strict=True):
        assert holds(z, OF_NUMBERS[name][1](exactly(x[0]), exactly(y[0])))


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("exponents", RANGES)
@pytest.mark.parametrize("name", DECISIONS)
def test_what_is_decided_is_so_for_all_that_the_operands_enclose(name: str, exponents: str, compiler: str) -> None:
    draw, decided = random.Random(6), 0
    tried = operands(300, 13, RANGES[exponents])
    for (x, y, _), (answer, _, _) in zip(tried, apply(name, tried, compiler), strict=True):
        truths = {DECISIONS[name][1](p, q) for p in points_of(x, draw) for q in points_of(y, draw)}
        assert answer == UNKNOWN or truths == {answer == YES}, f"{name} {x} {y} -> {answer}"
        decided += answer != UNKNOWN
    assert decided > 30, "a decision that is never taken is no decision"


@pytest.mark.parametrize("compiler", COMPILERS)
def test_roots_enclose_the_roots_of_all_that_is_not_negative(compiler: str) -> None:
    draw = random.Random(7)
    tried = operands(500, 14) + operands(300, 15, (-1074, 1000))
    for (x, _, _), z in zip(tried, apply("sqrt", tried, compiler), strict=True):
        for of_x in points_of(x, draw):
            if of_x >= 0 and math.isfinite(z[2]):
                low = max(fmpq(0), exactly(z[0]) + exactly(z[1]) - exactly(z[2]))
                high = exactly(z[0]) + exactly(z[1]) + exactly(z[2])
                assert low * low <= of_x <= high * high, f"{x} -> {z}"


@pytest.mark.parametrize("compiler", COMPILERS)
def test_powers_of_a_cosine_are_enclosed_at_every_angle_and_exponent(compiler: str) -> None:
    draw = random.Random(8)
    exponents = (0.0, 1e-3, 0.5, 1.0, 2.0, 7.5, 32.0, 1000.0, 1e6, 1e12, 2.0**200, 2.0**300)
    tried: list[tuple[Ball, Ball, float]] = []
    truths: list[fmpq] = []
    with mpmath.workprec(400):
        for _ in range(600):
            sin2 = exactly(draw.random() * draw.choice((1.0, 1e-3, 1e-9, 1e-20, 1e-60)))
            sin2 = draw.choice((sin2, sin2, 1 - sin2, fmpq(0), fmpq(1)))
            n = draw.choice(exponents)
            balls: list[Ball] = []
            for true in (1 - sin2, sin2):
                radius = draw.choice((0.0, 2.0**-100, 2.0**-60, 0.1)) * nearest(true) + draw.choice((0.0, 2.0**-200))
                centre = true + exactly(draw.uniform(-0.999, 0.999)) * exactly(radius)
                hi = nearest(centre)
                lo = nearest(centre - exactly(hi))
                slack = nearest(abs(centre - exactly(hi) - exactly(lo)))
                balls.append((hi, lo, radius + 2.0 * slack))
            tried.append((balls[0], balls[1], n))
            power = mpmath.mpf(1) if n == 0.0 else mpmath.power(_as_mpf(1 - sin2), mpmath.mpf(n) / 2)
            truths.append(_as_fraction(power))
    for (x, y, n), true, z in zip(tried, truths, apply("power", tried, compiler), strict=True):
        assert z[2] <= 0.5 * (1.0 + 2.0**-39)
        assert abs(exactly(z[0]) + exactly(z[1]) - true) <= exactly(z[2]) + true / 2**390, f"{x} {y} {n} -> {z}"


def _as_mpf(value: fmpq) -> mpmath.mpf:
    return mpmath.mpf(int(value.p)) / mpmath.mpf(int(value.q))


def _as_fraction(value: mpmath.mpf) -> fmpq:
    """A number that is not negative; below 2^-2000 it is 0 for what is asked of it here."""
    _, mantissa, exponent, _ = value._mpf_
    if int(exponent) < -3000:
        return fmpq(0)
    return fmpq(int(mantissa)) * fmpq(2) ** int(exponent)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_floors_are_told_where_the_ball_tells_them_and_only_there(compiler: str) -> None:
    draw = random.Random(9)
    near = [
        ((*normalised(math.floor(w) + d, draw.uniform(-1.0, 1.0)), r), (0.0, 0.0, 0.0), 0.0)
        for w in (0.0, 1.0, -7.0, 2.0**40, -(2.0**50))
        for d in (0.0, 0.25, 2.0**-30, -(2.0**-30), 1.0 - 2.0**-53)
        for r in (0.0, 2.0**-90, 2.0**-20, 0.25, 0.5, 1.0)
    ]
    tried = near + operands(400, 16, (-80, 60))
    told = 0
    for (x, _, _), (whole, _, _) in zip(tried, apply("floor", tried, compiler), strict=True):
        floors = {int(p.floor()) for p in points_of(x, draw)}
        assert math.isnan(whole) or floors == {int(whole)}, f"{x} -> {whole}"
        told += not math.isnan(whole)
    assert told > 150


def test_the_ends_of_a_ball_lie_outside_of_it() -> None:
    tried = operands(500, 17, (-1000, 1000))
    ends = zip(tried, apply("lower", tried), apply("upper", tried), strict=True)
    for (x, _, _), (lower, _, _), (upper, _, _) in ends:
        centre, radius = exactly(x[0]) + exactly(x[1]), exactly(x[2])
        assert not math.isfinite(lower) or exactly(lower) <= centre - radius
        assert not math.isfinite(upper) or exactly(upper) >= centre + radius


@pytest.mark.parametrize("name", [*ARITHMETIC, *_ROOTS, *DECISIONS, "floor"])
@pytest.mark.parametrize("bad", [math.inf, -math.inf, math.nan])
def test_what_overflowed_says_nothing_and_decides_nothing(name: str, bad: float) -> None:
    """A ball of an infinite or NaN centre has an infinite or NaN radius, and so has all that is made of it."""
    for error in (math.inf, math.nan):
        x: Ball = (bad, math.nan, error)
        for y in ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), x):
            (z,) = apply(name, [(x, y, 1.0)])
            if name == "power":
                assert y[0] == -1.0 or z == (0.5, 0.0, 0.5)  # a power of a cosine is between 0 and 1 all the same
            elif name in DECISIONS:
                assert z[0] != (YES if name == "both" else NO if name == "either" else z[0] + 1.0)
                assert z[0] == UNKNOWN or (name in ("both", "either") and y is not x)
            elif name == "floor":
                assert math.isnan(z[0])
            elif name == "second" and y is not x:
                assert not math.isfinite(z[2])
            else:
                assert not math.isfinite(z[2]), f"{name} forgot that nothing is known: {z}"


TIGHT = {"add": 4, "sub": 4, "mul": 8, "square": 8, "div": 32, "add_double": 2, "mul_double": 4, "sqrt": 8}
"""operation on exact operands -> its radius in u^2 of what it rounds"""


@pytest.mark.parametrize("name", TIGHT)
def test_radii_of_exact_operands_are_the_roundings_and_no_more(name: str) -> None:
    tried = [((*x[:2], 0.0), (*y[:2], 0.0), a) for x, y, a in operands(900, 18)]
    for (x, y, _), z in zip(tried, apply(name, tried), strict=True):
        size = abs(x[0]) + abs(y[0]) if name in ("add", "sub") else abs(z[0])
        if (name == "div" and not y[0]) or (name == "sqrt" and x[0] < 0.0):
            continue
        assert z[2] <= TIGHT[name] * 2.0**-106 * size * (1.0 + 2.0**-30) + 2.0**-900 * (1.0 + 1.0 / abs(y[0] or 1.0))


def test_the_radius_of_a_power_grows_with_the_exponent_and_its_argument_only() -> None:
    """n/2 times the relative radius of 1 - sin^2, and 2^-90 of the function itself."""
    for n in (1.0, 32.0, 1e6):
        sin2 = min(0.25, 10.0 / n)
        radius = sin2 * 2.0**-95
        (z,) = apply("power", [((1.0 - sin2, 0.0, 2.0**-95), (sin2, 0.0, radius), n)])
        expected = z[0] * (2.0**-90 + 0.5 * n * radius / (1.0 - sin2))
        assert expected <= z[2] <= 1.01 * expected + 2.0**-897


finite = st.floats(min_value=2.0**-300, max_value=2.0**300).flatmap(lambda a: st.sampled_from([a, -a, 0.0]))
centres = st.builds(normalised, finite, st.floats(min_value=-1.0, max_value=1.0))
radii = st.one_of(st.just(0.0), st.floats(min_value=2.0**-500, max_value=2.0**300))
balls = st.builds(lambda centre, error: (*centre, error), centres, radii)


@settings(max_examples=60, deadline=None)
@example(x=(262144.0, 1e-323, 1.0), y=(1.0, 0.0, 0.0), a=1.0, seed=0)
@given(x=balls, y=balls, a=finite, seed=st.integers(0, 2**20))
def test_no_balls_that_hypothesis_finds_break_an_enclosure(x: Ball, y: Ball, a: float, seed: int) -> None:
    draw = random.Random(seed)
    for name, (_, true) in ARITHMETIC.items():
        (z,) = apply(name, [(x, y, a)])
        for of_x in points_of(x, draw):
            for of_y in points_of(y, draw):
                wanted = true(of_x, of_y, a)
                assert not math.isfinite(z[2]) if wanted is None else holds(z, wanted), name


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("header", ["ball.h", "ball_power.h"])
def test_the_headers_compile_without_a_warning_when_nothing_of_them_is_used(header: str, compiler: str) -> None:
    compile_c(f'#include "{header}"\nint unused(void) {{ return 0; }}\n', "int unused(void);", compiler=compiler)
