"""power.h against Arb: the laws of a power, the proved bounds, the vectors, and the header's own derivation."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import flint
import mpmath
import numpy as np
import pytest
from c_harness import COMPILERS, SUPPORT, TEMPLATES, SnippetLibrary, compile_c, vectorised_lines
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from symrender_cg.functions import __main__ as command
from symrender_cg.functions.formats import DOUBLE, FLOAT, Format
from symrender_cg.functions.header import render_power_header, rounded_up
from symrender_cg.functions.minimax import fit_minimax
from symrender_cg.functions.power import power_tables
from symrender_cg.functions.supremum import bound_of_quotient

Array = NDArray[Any]

POWER, COMPLEMENT, LOG2, ONE_MINUS, EXP2 = range(5)
LOOPS = (
    "out[i] = unit_power{f}(x[i], n[i]);",
    "out[i] = unit_power_with_complement{f}(x[i], g[i], n[i]);",
    "out[i] = log2_unit{f}(x[i]);",
    "out[i] = log2_one_minus{f}(g[i]);",
    "out[i] = power_exp2{f}(x[i]);",
)


def snippet(form: Format) -> str:
    functions = [
        f"""
void run_{k}(const {form.name} *restrict x, const {form.name} *restrict g, const {form.name} *restrict n,
             {form.name} *restrict out, ptrdiff_t count)
{{
    (void)x, (void)g, (void)n;
    for (ptrdiff_t i = 0; i < count; ++i)
        {loop.format(f=form.suffix)}
}}
"""
        for k, loop in enumerate(LOOPS)
    ]
    return '#include "power.h"\n#include <stddef.h>\n' + "".join(functions)


@dataclass(frozen=True, slots=True)
class Header:
    """power.h as one compiler builds it, in one format: loops over arrays."""

    form: Format
    library: SnippetLibrary

    def array(self, values: Any) -> Array:
        return np.array(values, dtype=np.float64 if self.form is DOUBLE else np.float32)

    def run(self, loop: int, x: Any, n: Any = 0.0, g: Any = 0.0) -> Array:
        columns = [np.ascontiguousarray(c) for c in np.broadcast_arrays(*map(self.array, (x, g, n)))]
        out = np.empty_like(columns[0])
        self.library.call(f"run_{loop}", *columns, out, out.size)
        return out


def header(form: Format, compiler: str) -> Header:
    pointers = ", ".join([f"const {form.name} *"] * 3)
    declarations = "".join(f"void run_{k}({pointers}, {form.name} *, ptrdiff_t);" for k in range(len(LOOPS)))
    return Header(form, compile_c(snippet(form), declarations, compiler=compiler))


BOTH = [(form, compiler) for form in (DOUBLE, FLOAT) for compiler in COMPILERS]


@pytest.fixture(scope="module", params=BOTH, ids=lambda both: f"{both[0].name}-{both[1]}")
def power(request: pytest.FixtureRequest) -> Header:
    return header(*request.param)


def largest_error(computed: Array, true: Callable[..., Any], *columns: Array, relative: bool) -> float:
    """Largest error against a formula in Arb, absolute or relative: the upper end of a ball, never too small."""
    worst = 0.0
    with flint.ctx.workprec(140):
        for value, *arguments in zip(computed.tolist(), *(c.tolist() for c in columns), strict=True):
            exact = true(*map(flint.arb, arguments))
            error = abs(value - exact) / (abs(exact) if relative else 1)
            worst = max(worst, float(error.upper()))
    return worst


def log2(x: Any) -> Any:
    return x.log() / flint.arb(2).log()


def log2_one_minus(g: Any) -> Any:
    return (-g).log1p() / flint.arb(2).log()


def exp2(y: Any) -> Any:
    return (y * flint.arb(2).log()).exp()


def seeded(power: Header, count: int, seed: int) -> tuple[Array, Array]:
    """Bases all over (0, 1), near 1 and near 0, with exponents that put the power between e^-30 and 1."""
    draw = np.random.default_rng(seed)
    near_one, near_zero = 1.0 - 10.0 ** draw.uniform(-15.0, -0.3, count), 10.0 ** draw.uniform(-30.0, 0.0, count)
    base = power.array(
        np.concatenate([draw.uniform(0.0, 1.0, count), draw.uniform(0.4, 1.0, count), near_one, near_zero])
    )
    base = base[(base > 0.0) & (base < 1.0)]
    exponent = power.array(np.exp(draw.uniform(-6.0, 3.4, base.size)) / -np.log(base.astype(np.float64)))
    return base, exponent


# The worst of 48 million pairs of base and exponent in each format: 1.68e-16 absolute, and 9.21e-8 in float.
WORST = {
    DOUBLE: (
        ("0x1.5d955f58d5e00p-1", "0x1.aebb2954ee266p-1"),
        ("0x1.5bbe0d9f54977p-1", "0x1.06d12943c6f07p+0"),
        ("0x1.5377b6514e7d6p-1", "0x1.a0a460147f198p-1"),
        ("0x1.5eeec9bbde538p-1", "0x1.d2df6b3401c04p-1"),
        ("0x1.84208372be8a8p-1", "0x1.38c941f6027f6p+0"),
    ),
    FLOAT: (
        ("0x1.64a26c0000000p-1", "0x1.e11ff60000000p-1"),
        ("0x1.a149fa0000000p-1", "0x1.ae309e0000000p+0"),
        ("0x1.8c9fcc0000000p-1", "0x1.5303500000000p+0"),
        ("0x1.a7afb80000000p-1", "0x1.cb273c0000000p+0"),
    ),
}
WORST_ERROR = {DOUBLE: (1.68e-16, 1.69e-16), FLOAT: (9.2e-8, 9.21e-8)}
TARGET = {DOUBLE: 2.5e-16, FLOAT: 1.5e-7}
LARGEST = {DOUBLE: 1.7976931348623157e308, FLOAT: 3.4028234663852886e38}
SMALLEST = {DOUBLE: 5e-324, FLOAT: 1.401298464324817e-45}


@pytest.mark.parametrize("form", [DOUBLE, FLOAT], ids=lambda form: form.name)
def test_the_proved_bound_of_a_power_meets_its_target(form: Format) -> None:
    assert power_tables(form).bounds.power <= TARGET[form]


def test_a_power_stays_within_the_proved_bound(power: Header) -> None:
    base, exponent = seeded(power, 1500, seed=31)
    error = largest_error(power.run(POWER, base, exponent), lambda x, n: x**n, base, exponent, relative=False)
    assert error <= power_tables(power.form).bounds.power


def test_the_worst_known_powers_err_as_much_as_was_measured_and_no_more(power: Header) -> None:
    base, exponent = (power.array([float.fromhex(pair[k]) for pair in WORST[power.form]]) for k in (0, 1))
    error = largest_error(power.run(POWER, base, exponent), lambda x, n: x**n, base, exponent, relative=False)
    lowest, highest = WORST_ERROR[power.form]
    assert lowest <= error <= highest


@settings(max_examples=200, deadline=None)
@given(
    base=st.floats(min_value=2.0**-149, max_value=1.0, width=32),
    exponent=st.one_of(st.floats(0.0, 2.0**100, width=32), st.floats(0.0, 64.0, width=32), st.integers(0, 1000)),
)
def test_no_power_that_hypothesis_finds_breaks_the_bound(base: float, exponent: float) -> None:
    for form, compiler in BOTH:
        power = header(form, compiler)
        x, n = power.array([base]), power.array([exponent])
        error = largest_error(power.run(POWER, x, n), lambda b, e: b**e, x, n, relative=False)
        assert error <= power_tables(form).bounds.power


def test_the_logarithm_stays_within_its_proved_relative_bound(power: Header) -> None:
    base, _ = seeded(power, 1000, seed=32)
    base = np.concatenate([base, power.array([SMALLEST[power.form], 0.6875, 0.68, 0.7, 0.5, 0.25, 0.34375])])
    error = largest_error(power.run(LOG2, base), log2, base, relative=True)
    assert error <= power_tables(power.form).bounds.log2_unit * power.form.unit_roundoff


def test_the_logarithm_of_one_minus_g_keeps_its_relative_accuracy_however_small_g_is(power: Header) -> None:
    draw = np.random.default_rng(33)
    tiny = 10.0 ** draw.uniform(-300.0 if power.form is DOUBLE else -37.0, 0.0, 2000)
    g = power.array(np.concatenate([tiny, draw.uniform(0.0, 1.0, 2000), 1.0 - 10.0 ** draw.uniform(-6.0, 0.0, 1000)]))
    g = g[(g > 0.0) & (g < 1.0)]
    below_half, above_half = g[g < 0.5], g[g >= 0.5]
    unit, bound = power.form.unit_roundoff, power_tables(power.form).bounds.log2_unit
    assert (
        largest_error(power.run(ONE_MINUS, 0.0, g=below_half), log2_one_minus, below_half, relative=True)
        <= bound * unit
    )
    rounded_once = largest_error(power.run(ONE_MINUS, 0.0, g=above_half), log2_one_minus, above_half, relative=True)
    assert rounded_once <= (bound + 0.8) * unit


def test_two_to_the_y_stays_within_its_proved_relative_bound(power: Header) -> None:
    draw = np.random.default_rng(34)
    lowest = 2 - power.form.bias
    y = power.array(
        np.concatenate([draw.uniform(-2.0, 0.0, 3000), draw.uniform(lowest, 0.0, 3000), np.arange(lowest, 1)])
    )
    error = largest_error(power.run(EXP2, y), exp2, y, relative=True)
    assert error <= power_tables(power.form).bounds.exp2 * power.form.unit_roundoff


def nasty_bases(form: Format) -> list[float]:
    smallest_normal = 2.0 ** (1 - form.bias)
    below_one = 1.0 - float(form.unit_roundoff)
    return [SMALLEST[form], smallest_normal / 2, smallest_normal, 1e-30, 0.1, 0.5, 0.6875, 0.75, below_one, 1.0]


def nasty_exponents(form: Format) -> list[float]:
    return [SMALLEST[form], 1e-30, 1e-3, 0.5, 1.0, 32.0, 37.5, 1e6, 1e30, LARGEST[form]]


def test_the_zeroth_power_is_one_also_of_zero(power: Header) -> None:
    assert np.all(power.run(POWER, [0.0, *nasty_bases(power.form)], 0.0) == 1.0)
    assert np.all(power.run(COMPLEMENT, [0.0, 0.5, 1.0], 0.0, g=[1.0, 0.75, 0.0]) == 1.0)


def test_every_positive_power_of_zero_is_zero_and_of_one_is_one(power: Header) -> None:
    exponents = nasty_exponents(power.form)
    assert np.all(power.run(POWER, 0.0, exponents) == 0.0)
    assert np.all(power.run(COMPLEMENT, 0.0, exponents, g=1.0) == 0.0)
    assert np.all(power.run(POWER, 1.0, exponents) == 1.0)
    assert np.all(power.run(COMPLEMENT, 1.0, exponents, g=0.0) == 1.0)


def test_a_power_is_never_nan_never_negative_and_never_above_one(power: Header) -> None:
    base, exponent = np.meshgrid([0.0, *nasty_bases(power.form)], [0.0, *nasty_exponents(power.form)])
    random_base, random_exponent = seeded(power, 3000, seed=35)
    base = np.concatenate([power.array(base.ravel()), random_base])
    exponent = np.concatenate([power.array(exponent.ravel()), random_exponent])
    complement = (1.0 - base.astype(np.float64)) * (1.0 + base.astype(np.float64))
    for result in (power.run(POWER, base, exponent), power.run(COMPLEMENT, base, exponent, g=complement)):
        assert np.all((result >= 0.0) & (result <= 1.0))


def test_a_power_that_underflows_is_zero_and_not_a_subnormal(power: Header) -> None:
    smallest_exponent = 1 - power.form.bias
    result = power.run(POWER, 0.5, [-smallest_exponent - 1, -smallest_exponent, -smallest_exponent + 1, 1e30])
    assert result.tolist() == [2.0 ** (smallest_exponent + 1), 2.0**smallest_exponent, 0.0, 0.0]


def test_powers_of_subnormal_bases_are_powers_of_their_values(power: Header) -> None:
    base = power.array([SMALLEST[power.form] * k for k in (1, 3, 1000, 12345)])
    error = largest_error(
        power.run(POWER, base, 0.01), lambda x, n: x**n, base, power.array([0.01] * 4), relative=False
    )
    assert error <= power_tables(power.form).bounds.power


def test_the_complement_keeps_a_highlight_exact_where_the_base_alone_loses_it(power: Header) -> None:
    """x^n = (1 - g)^(n/2) for n g of order 1: the rounding of x to the format costs n u, the complement nothing."""
    draw = np.random.default_rng(36)
    half = float(power.form.unit_roundoff) ** 0.5
    g = power.array(10.0 ** draw.uniform(np.log10(half) - 1.0, np.log10(half) + 1.0, 2000))
    x = power.array(np.sqrt(1.0 - g.astype(np.float64)))
    n = power.array(np.exp(draw.uniform(-1.0, 2.0, g.size)) / g)

    def true(complement: Any, exponent: Any) -> Any:
        return ((-complement).log1p() * exponent / 2).exp()

    with_complement = largest_error(power.run(COMPLEMENT, x, n, g=g), true, g, n, relative=False)
    without = largest_error(power.run(POWER, x, n), true, g, n, relative=False)
    assert with_complement <= power_tables(power.form).bounds.power
    assert without >= 1e4 * power.form.unit_roundoff ** Fraction(1, 2) * half


def test_the_complement_decides_below_one_half_and_the_base_above(power: Header) -> None:
    g = power.array([0.5, 0.6, 0.9, 1.0])
    x = power.array([0.7, 0.6, 0.3, 0.1])
    assert np.array_equal(power.run(COMPLEMENT, x, 7.5, g=g), power.run(POWER, x, 7.5))
    small = power.array([0.0, 1e-20, 0.3125, 0.32, 0.49])
    ignored_base = power.run(COMPLEMENT, 0.5, 7.5, g=small)
    error = largest_error(ignored_base, lambda c: ((-c).log1p() * 3.75).exp(), small, relative=False)
    assert error <= power_tables(power.form).bounds.power


@pytest.mark.parametrize("form", [DOUBLE, FLOAT], ids=lambda form: form.name)
def test_every_compiler_gives_the_same_bits_in_vectors_and_one_by_one(form: Format) -> None:
    powers = [header(form, compiler) for compiler in COMPILERS]
    base, exponent = seeded(powers[0], 500, seed=37)
    complement = powers[0].array((1.0 - base.astype(np.float64)) * (1.0 + base.astype(np.float64)))
    together = [power.run(COMPLEMENT, base, exponent, g=complement) for power in powers]
    one_by_one = [
        power.run(COMPLEMENT, base[k : k + 1], exponent[k : k + 1], g=complement[k : k + 1])[0]
        for power in powers
        for k in range(0, base.size, 7)
    ]
    assert all(np.array_equal(result, together[0]) for result in together)
    assert np.array_equal(one_by_one, np.tile(together[0][::7], len(powers)))


TARGETS = ((), ("-march=x86-64-v3",)) if platform.machine() == "x86_64" else ((),)


@pytest.mark.parametrize("target", TARGETS, ids=lambda flags: "".join(flags) or "native")
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("form", [DOUBLE, FLOAT], ids=lambda form: form.name)
def test_every_loop_over_the_header_vectorises(form: Format, compiler: str, target: tuple[str, ...]) -> None:
    source = snippet(form)
    widths = vectorised_lines(source, compiler=compiler, extra_flags=target)
    loops = [number for number, line in enumerate(source.splitlines(), start=1) if "for (" in line]
    least = 32 if compiler == "gcc" else 32 // (form.width // 8)
    assert len(loops) == len(LOOPS)
    assert all(widths.get(line, 0) >= least for line in loops)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("flags", [(), ("-O0",), ("-march=x86-64",) if platform.machine() == "x86_64" else ("-O1",)])
def test_the_header_compiles_without_a_warning_used_or_not(compiler: str, flags: tuple[str, ...]) -> None:
    nothing = '#include "power.h"\nint unused(void) { return 0; }\n'
    compile_c(nothing, "int unused(void);", compiler=compiler, extra_flags=flags)
    compile_c(snippet(DOUBLE) + snippet(FLOAT).replace("run_", "runf_"), "", compiler=compiler, extra_flags=flags)


def test_the_header_is_what_its_template_and_tables_give() -> None:
    rendered = render_power_header((SUPPORT / "power.h.j2").read_text())
    assert rendered == (SUPPORT / "power.h").read_text(), "run: python -m symrender_cg.functions --write"


def test_the_command_prints_every_coefficient_and_writes_the_header(
    tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "support").mkdir()
    for template, _, _ in command.HEADERS:
        (tmp_path / template).write_text((TEMPLATES / template).read_text())
    assert command.main(["--write", "--templates", str(tmp_path)]) == 0
    written, printed = (tmp_path / "support" / "power.h").read_text(), capsys.readouterr().out
    assert all((tmp_path / name).read_text() == (TEMPLATES / name).read_text() for _, name, _ in command.HEADERS)
    for form in (DOUBLE, FLOAT):
        for coefficient in (*power_tables(form).exp2_tail, *power_tables(form).log_tail):
            assert form.literal(coefficient) in printed
            assert form.literal(coefficient) in written


@pytest.mark.parametrize("form", [DOUBLE, FLOAT], ids=lambda form: form.name)
def test_the_proved_error_of_each_polynomial_is_reached_and_never_exceeded(form: Format) -> None:
    tables = power_tables(form)
    with mpmath.workdps(40):
        exp2_errors = [
            abs((1 + r * mpmath.polyval(tables.exp2_tail[::-1], r)) / mpmath.power(2, r) - 1)
            for r in mpmath.linspace(mpmath.mpf(-1) / 2, mpmath.mpf(1) / 2, 501)
        ]
        log_errors = [
            abs((2 * s + s**3 * mpmath.polyval(tables.log_tail[::-1], s * s)) / (2 * mpmath.atanh(s)) - 1)
            for s in mpmath.linspace(mpmath.mpf(1) / 1000, mpmath.mpf(5) / 27, 501)
        ]
        assert 0.9 * tables.exp2_error <= max(exp2_errors) <= tables.exp2_error
        assert 0.9 * tables.log_error <= max(log_errors) <= tables.log_error


@pytest.mark.parametrize("degree", [2, 5, 8])
def test_the_best_polynomial_below_a_power_leaves_a_chebyshev_polynomial(degree: int) -> None:
    """min over p of max |x^(n+1) - p(x)| on [-1, 1] is 2^-n (Chebyshev 1854)."""
    with mpmath.workdps(40):
        coefficients = fit_minimax(lambda x: x ** (degree + 1), lambda _: mpmath.mpf(1), (-1, 1), degree)
        largest = max(
            abs(x ** (degree + 1) - mpmath.polyval(coefficients[::-1], x)) for x in mpmath.linspace(-1, 1, 401)
        )
        assert abs(largest * 2**degree - 1) < 1e-3


def test_the_rigorous_bound_of_a_quotient_is_above_its_maximum_and_near_it() -> None:
    chebyshev_5 = flint.arb_poly([0, 5, 0, -20, 0, 16])
    bound = bound_of_quotient(chebyshev_5, lambda x: 2 + 0 * x, (Fraction(-1), Fraction(1)))
    assert 0.5 <= bound <= 0.6


@pytest.mark.parametrize(
    ("value", "text"), [(0.04671, "0.0468"), (2.78, "2.78"), (2.485e-16, "2.49e-16"), (0.99901, "1"), (1.0, "1")]
)
def test_a_bound_is_printed_rounded_up(value: float, text: str) -> None:
    assert rounded_up(value) == text
