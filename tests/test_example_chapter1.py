"""The Chapter 1 example runs, and finds what the seed's cells do when they are run (golden facts of the seed)."""

from __future__ import annotations

import importlib
import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SEED_SWELL = {"t_hit": 29, "ndl": 284, "rdv": 723, "I_shade": 1014, "I_img": 1034}


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The example's module, imported as `python examples/chapter1.py` imports it, with a cache of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYMRENDER_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        patch.syspath_prepend(str(EXAMPLES))
        patch.setattr(sys, "dont_write_bytecode", True)
        yield importlib.import_module("chapter1")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out") / "pictures"


@pytest.fixture(scope="module")
def measured(example: Any, pictures: Path) -> dict[tuple[int, str], Any]:
    """What the walk found at the seed's own 256 x 256, by cell and key."""
    pytest.importorskip("matplotlib")
    findings = example.walk(256, pictures, Console(file=io.StringIO(), width=120))
    assert sorted({finding.cell for finding in findings}) == list(range(1, 9))
    return {(finding.cell, finding.key): finding.value for finding in findings}


def test_cell_1_image_exceeds_1_where_the_seed_does(measured: dict[tuple[int, str], Any]) -> None:
    assert measured[1, "over_one"] == 399


def test_cell_2_swell_is_the_seeds_and_named_definitions_do_not_swell(measured: dict[tuple[int, str], Any]) -> None:
    assert measured[2, "swell"] == SEED_SWELL
    assert 0 < measured[2, "named"] < 100
    assert measured[2, "digits"] >= 45


def test_cell_3_renderers_differ_by_more_than_the_seed_says_and_double_by_less(
    measured: dict[tuple[int, str], Any],
) -> None:
    # 5.2e-14 with numpy 2.4 and AVX-512; its powers differ by an ulp from machine to machine
    assert 2e-14 < measured[3, "structural"] < 1e-13
    assert measured[3, "error_per_pixel"].max_abs > 1e-14  # measured 5.8e-14
    assert measured[3, "error_double"].max_abs < 2e-15  # measured 7.8e-16
    assert measured[3, "error_double"].flips == 0


def test_cell_4_every_renderer_is_timed_at_every_size(measured: dict[tuple[int, str], Any]) -> None:
    rows = measured[4, "rows"]
    assert [len(values) for values in rows.values()] == [4] * 6
    assert rows["loop"][-1] is None
    assert all(value > 0 for values in rows.values() for value in values if value is not None)


def test_cell_5_silhouette_radius_is_exact_and_no_pixel_is_on_its_wrong_side(
    measured: dict[tuple[int, str], Any],
) -> None:
    assert measured[5, "rho"] == 1.0327955589886444
    assert measured[5, "misplaced"] == 0


def test_cell_6_named_derivative_equals_central_differences_where_the_seeds_does_not(
    measured: dict[tuple[int, str], Any],
) -> None:
    assert measured[6, "swollen_slope"] == 3245
    assert measured[6, "named_slope"] < 200
    assert measured[6, "central"] < 1e-9  # measured 5e-11
    assert measured[6, "unclamped"] == 6499


def test_cell_6_baking_folds_the_frame_and_keeps_the_image(measured: dict[tuple[int, str], Any]) -> None:
    assert measured[6, "seed_baked"] == (1034, 398)
    before, after = measured[6, "work_frame"]
    assert int(after.split()[0]) < int(before.split()[0])
    before, after = measured[6, "work_pixel"]
    assert "power" in before
    assert "power" not in after
    assert measured[6, "baked_change"] < 5e-15  # measured 6.7e-16


def test_cell_7_every_miss_is_nan_until_regularised_and_images_agree_once_both_are_clipped(
    measured: dict[tuple[int, str], Any],
) -> None:
    assert measured[7, "nan_raw"] == 32_608
    assert measured[7, "nan_regularised"] == 0
    assert measured[7, "as_the_seed_compares"] is False
    assert measured[7, "both_clipped"] is True


def test_cell_8_condition_is_wrong_behind_and_order_by_power_only_where_spheres_meet(
    measured: dict[tuple[int, str], Any],
) -> None:
    assert measured[8, "in front"] == (0, 0)
    for case in ("behind A", "behind the eye"):
        naive, ordered = measured[8, case]
        assert naive > 10_000
        assert ordered == 0
    assert min(measured[8, "through A"]) > 1_000


@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize("cell", range(1, 9))
def test_every_cell_leaves_a_picture_with_something_in_it(pictures: Path, cell: int) -> None:
    with Image.open(pictures / f"cell{cell}.png") as picture:
        pixels = np.asarray(picture.convert("L"))
    assert min(pixels.shape) > 300
    assert np.ptp(pixels) > 200


def test_main_without_matplotlib_says_so_and_prints_what_the_seed_says_beside_what_was_measured(
    example: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("chapter1_walk.pictures.find_spec", lambda name: None)
    assert example.main(["--size", "16", "--out", str(tmp_path / "none")]) == 0
    printed = capsys.readouterr().out
    assert "matplotlib is not installed" in printed
    assert not (tmp_path / "none").exists()
    for text in ("Chapter 1 at 16 x 16", "the seed says", "4/sqrt(15) = 1.0327955589886444", "1,034 -> 398"):
        assert text in printed


@pytest.mark.parametrize("size", ["15", "4096", "wide"])
def test_a_size_out_of_range_is_a_usage_error(example: Any, size: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        example.main(["--size", size])
    assert stop.value.code == 2
    assert "--size" in capsys.readouterr().err
