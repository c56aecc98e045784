"""`python -m benchmarks scaling`: exponents of known series, as many lights as asked, what is missing said."""

from __future__ import annotations

import io
import json
import math
import os
import re
from typing import Protocol

import numpy as np
import pytest
from rich.console import Console

from benchmarks.machine import Spread, this_machine
from benchmarks.scaling import KINDS, Plan, measure_all
from benchmarks.scaling.compiling import CompileReport, compilers
from benchmarks.scaling.compiling import Row as CompileRow
from benchmarks.scaling.growth import exponent
from benchmarks.scaling.lights import measure_lights, ring_of_lights
from benchmarks.scaling.sizes import SizesReport, measure_sizes
from symrender_cg import Scene, evaluate, translate
from symrender_cg.errors import ArgumentError

COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
PIXELS = [float(4**k) for k in range(6, 14)]


class Shown(Protocol):
    def show(self, console: Console) -> None: ...


def shown(report: Shown) -> str:
    console = Console(width=250, file=io.StringIO())
    report.show(console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize(("p", "scale"), [(1.0, 2e-9), (0.0, 5.0), (2.0, 1e-3), (0.5, 7.0)])
def test_the_exponent_of_a_power_is_its_power(p: float, scale: float) -> None:
    assert exponent(PIXELS, [scale * amount**p for amount in PIXELS]) == pytest.approx(p, abs=1e-12)


def test_a_constant_overhead_lowers_the_exponent_and_a_slower_memory_raises_it() -> None:
    linear = [2e-9 * amount for amount in PIXELS]
    assert exponent(PIXELS, [time + 1e-4 for time in linear]) < 0.95
    assert (
        exponent(PIXELS, [time * (1.0 if amount < 1e6 else 3.0) for time, amount in zip(linear, PIXELS, strict=True)])
        > 1.05
    )


@pytest.mark.parametrize(("amounts", "times"), [([1.0], [1.0]), ([1.0, 1.0], [1.0, 2.0]), ([1.0, 2.0], [0.0, 1.0])])
def test_a_series_without_an_exponent_is_refused(amounts: list[float], times: list[float]) -> None:
    with pytest.raises(ArgumentError, match="all positive"):
        exponent(amounts, times)


def test_every_size_is_measured_in_both_formats_and_beside_a_fill() -> None:
    report = measure_sizes((16, 256, 512), 1, 1, lambda text: None)
    names = {series.name for series in report.series}
    assert {"double 1t", "single 1t", "fill float64", "fill float32"} <= names
    for series in report.series:
        assert len(series.ns_a_pixel) == 3
        assert all(value.median > 0.0 for value in series.ns_a_pixel)
        assert series.microseconds(report.sizes)[0] == pytest.approx(series.ns_a_pixel[0].median * 0.256)
        assert math.isfinite(series.exponent)
    assert "exponent" in shown(report)
    assert isinstance(report, SizesReport)


@pytest.mark.parametrize("count", [1, 2, 5, 32])
def test_a_ring_has_as_many_lights_as_asked_and_one_light_s_intensity(count: int) -> None:
    scene = ring_of_lights(count, 1)
    assert len(scene.lights) == count
    assert scene.lights[0].intensity == pytest.approx(1.0 / count)
    assert len({light.position for light in scene.lights}) == count  # type: ignore[union-attr]


def test_more_lights_do_not_change_the_text_of_the_kernel() -> None:
    few, many = (translate(ring_of_lights(count, 1)).emitted for count in (3, 24))
    assert few.files.keys() == many.files.keys()
    for name, text in few.files.items():  # the comments state the scene's own margins
        assert COMMENT.sub("", text) == COMMENT.sub("", many.files[name]), name


def test_lights_are_measured_without_pov_ray_and_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.povray.find", lambda: None)
    report = measure_lights((1, 2), 48, 1, 1, lambda text: None)
    assert report.missing == ("POV-Ray is not installed and left out; apt-get install povray",)
    assert [row.count for row in report.rows] == [1, 2]
    assert "POV-Ray is not installed" in shown(report)
    assert json.dumps(report.to_dict())


def test_a_compiler_that_is_not_installed_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.scaling.compiling.COMPILERS", ("no-such-compiler",))
    assert compilers() == ({}, ("no-such-compiler is not installed and left out; apt-get install no-such-compiler",))


def test_the_environment_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "cc")
    compilers()
    assert os.environ["CC"] == "cc"


def test_a_compiler_that_refuses_a_kernel_is_said() -> None:
    once = Spread(1.0, 1.0, 1.0)
    row = CompileRow("chapter1", "double", False, 0.1, 300, {"gcc": once}, {"gcc": 40000}, {"clang": "status 1"})
    text = shown(CompileReport(this_machine(), {"gcc": "12", "clang": "14"}, (), 1, (row,)))
    assert "chapter1, double, clang: status 1" in text
    assert "failed" in text


def test_only_the_kinds_that_are_asked_for_run(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = Plan.quick(("sizes",), 64, 1)
    ran: list[str] = []
    for kind in KINDS:
        name = {"compile": "measure_compiling"}.get(kind, f"measure_{kind}")
        monkeypatch.setattr(f"benchmarks.scaling.{name}", lambda *given, kind=kind: ran.append(kind))
    measure_all(plan, lambda text: None)
    assert ran == ["sizes"]
    measure_all(Plan(), lambda text: None)
    assert ran[1:] == list(KINDS)


def test_a_light_of_a_ring_is_a_part_of_the_whole() -> None:
    whole = ring_of_lights(2, 1)
    x = np.linspace(-0.5, 0.5, 7)
    one, other = (Scene(whole.camera, whole.spheres, (light,), shadows=True) for light in whole.lights)
    ambient = 0.1 * (evaluate(whole, x, x, clip=False) > 0.0)
    parts = evaluate(one, x, x, clip=False) + evaluate(other, x, x, clip=False) - ambient
    assert np.allclose(evaluate(whole, x, x, clip=False), parts, atol=1e-14)
