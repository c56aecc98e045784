"""Laws of lobe_power.h: both halves of a power stay within their proved bounds, and the power within 0 and 1."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from c_harness import COMPILERS, SnippetLibrary, compile_c
from numpy.typing import NDArray

from symrender_cg.functions.formats import DOUBLE, FLOAT, Format
from symrender_cg.functions.lobe import lobe_tables
from symrender_cg.functions.lobe_header import HEADER, TEMPLATE, render_lobe_header
from symrender_cg.resources import template_path

Array = NDArray[Any]
TARGET = {DOUBLE: 2.8e-16, FLOAT: 1.5e-7}
DIRECT = 0.3125
"""sin^2 up to which 1 - sin^2 needs no power of two taken out."""


class Lobe:
    """Both halves over arrays, as one compiler builds them in one format."""

    def __init__(self, form: Format, compiler: str) -> None:
        real, f = form.name, form.suffix
        body = f"""#include "lobe_power.h"
#include <stddef.h>
void run_log(const {real} *restrict cos2, const {real} *restrict sin2, {real} *restrict out, ptrdiff_t count)
{{
    for (ptrdiff_t i = 0; i < count; ++i)
        out[i] = log2_of_lobe{f}(cos2[i], sin2[i]);
}}
void run_whole(const {real} *restrict sin2, {real} *restrict room, {real} *restrict out, int h, ptrdiff_t count)
{{
    whole_powers_of_lobe{f}(sin2, room, out, h, (int)count);
}}
void run_power(const {real} *restrict log2, const {real} *restrict n, {real} *restrict out, ptrdiff_t count)
{{
    for (ptrdiff_t i = 0; i < count; ++i)
        out[i] = power_of_lobe{f}(log2[i], n[i]);
}}
"""
        rows = f"(const {real} *, const {real} *, {real} *, ptrdiff_t);"
        self.form = form
        self.library: SnippetLibrary = compile_c(
            body,
            f"void run_log{rows} void run_power{rows} "
            f"void run_whole(const {real} *, {real} *, {real} *, int, ptrdiff_t);",
            compiler=compiler,
        )

    def array(self, values: Any) -> Array:
        return np.array(values, dtype=np.float64 if self.form is DOUBLE else np.float32)

    def run(self, entry: str, first: Any, second: Any) -> Array:
        one, two = (np.ascontiguousarray(c) for c in np.broadcast_arrays(self.array(first), self.array(second)))
        out = np.empty_like(one)
        self.library.call(entry, one, two, out, out.size)
        return out

    def power(self, cos2: Any, sin2: Any, n: Any) -> Array:
        return self.run("run_power", self.run("run_log", cos2, sin2), n)


@pytest.fixture(
    scope="module",
    params=[(form, compiler) for form in (DOUBLE, FLOAT) for compiler in COMPILERS],
    ids=lambda both: f"{both[0].name}-{both[1]}",
)
def lobe(request: pytest.FixtureRequest) -> Lobe:
    return Lobe(*request.param)


def drawn(lobe: Lobe, count: int) -> tuple[Array, Array, Array]:
    """cos^2 and sin^2 of angles from 1e-7 to 90 degrees, and exponents that put the power between e^-30 and 1."""
    draw = np.random.default_rng(5)
    sin2 = np.concatenate([10.0 ** draw.uniform(-14.0, -0.0001, count), draw.uniform(0.0, 1.0, count)])
    cos2 = 1.0 - sin2
    n = 2.0 * np.exp(draw.uniform(-6.0, 3.4, sin2.size)) / -np.log1p(-sin2)
    return lobe.array(cos2), lobe.array(sin2), lobe.array(n)


def base_of(cos2: float, sin2: float) -> Any:
    """The number whose power is meant: 1 - sin^2 where sin^2 < 1/2, else cos^2."""
    return 1 - flint.arb(sin2) if sin2 < 0.5 else flint.arb(cos2)


def test_the_logarithm_stays_within_its_proved_relative_bound(lobe: Lobe) -> None:
    cos2, sin2, _ = drawn(lobe, 3000)
    bound = lobe_tables(lobe.form).log2_bound * float(lobe.form.unit_roundoff)
    computed, worst = lobe.run("run_log", cos2, sin2), 0.0
    with flint.ctx.workprec(140):
        for value, c, s in zip(computed.tolist(), cos2.tolist(), sin2.tolist(), strict=True):
            exact = base_of(c, s).log() / flint.arb(2).log()
            worst = max(worst, float((abs(value - exact) / abs(exact)).upper()))
    assert 0.4 * bound < worst <= bound


def test_a_power_stays_within_its_proved_absolute_bound(lobe: Lobe) -> None:
    cos2, sin2, n = drawn(lobe, 3000)
    bound = lobe_tables(lobe.form).power_bound
    computed, worst = lobe.power(cos2, sin2, n), 0.0
    with flint.ctx.workprec(140):
        for value, c, s, e in zip(computed.tolist(), cos2.tolist(), sin2.tolist(), n.tolist(), strict=True):
            exact = (base_of(c, s).log() * flint.arb(e) / 2).exp()
            worst = max(worst, float(abs(value - exact).upper()))
    assert 0.3 * bound < worst <= bound < TARGET[lobe.form]


def test_a_whole_power_by_squaring_errs_no_more_however_large_it_is(lobe: Lobe) -> None:
    """Measured at most 4.1 u; each squaring adds less than one."""
    _, sin2, _ = drawn(lobe, 1500)
    with flint.ctx.workprec(200):
        for h in (1, 2, 3, 4, 5, 8, 16, 25, 50, 100, 511, 512):
            power, room = np.empty_like(sin2), np.empty_like(sin2)
            lobe.library.call("run_whole", sin2, room, power, h, power.size)
            exact = [(1 - flint.arb(s)) ** h for s in sin2.tolist()]
            worst = max(float(abs(p - e).upper()) for p, e in zip(power.tolist(), exact, strict=True))
            assert worst <= 6.0 * float(lobe.form.unit_roundoff), h
            assert np.all((power >= 0.0) & (power <= 1.0))


def test_the_zeroth_power_is_one_also_of_zero(lobe: Lobe) -> None:
    cos2 = np.array([0.0, 1e-300, 0.25, 0.75, 1.0]) if lobe.form is DOUBLE else np.array([0.0, 1e-30, 0.25, 0.75, 1.0])
    assert np.array_equal(lobe.power(cos2, 1.0 - cos2, 0.0), np.ones(5, cos2.dtype))


def test_a_power_is_never_nan_and_lies_between_zero_and_one(lobe: Lobe) -> None:
    draw = np.random.default_rng(8)
    largest = 1e308 if lobe.form is DOUBLE else 3e38
    sin2 = np.concatenate([draw.uniform(0.0, 1.0, 500), 10.0 ** draw.uniform(-37.0, 0.0, 500), [0.0, 1.0, 0.5, DIRECT]])
    for n in (1e-30, 0.5, 1.0, 32.0, 1e6, 1e30, largest):
        powers = lobe.power(1.0 - sin2, sin2, n)
        assert np.all((powers >= 0.0) & (powers <= 1.0)), n


def test_the_power_of_the_axis_is_one_and_far_powers_of_the_rim_are_zero(lobe: Lobe) -> None:
    assert lobe.power([1.0, 1.0], [0.0, 0.0], [1.0, 1e30]).tolist() == [1.0, 1.0]
    assert lobe.power([0.0, 0.25], [1.0, 0.75], [40.0, 1e30]).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("form", [DOUBLE, FLOAT], ids=lambda form: form.name)
def test_every_compiler_gives_the_same_bits(form: Format) -> None:
    built = [Lobe(form, compiler) for compiler in COMPILERS]
    cos2, sin2, n = drawn(built[0], 2000)
    first, *others = (one.power(cos2, sin2, n) for one in built)
    assert all(first.tobytes() == other.tobytes() for other in others)


def test_the_header_is_what_its_template_and_tables_give() -> None:
    written = Path(template_path(HEADER)).read_text(encoding="utf-8")
    assert render_lobe_header(Path(template_path(TEMPLATE)).read_text(encoding="utf-8")) == written
