"""`conditioning`: how much half an ulp of every input moves each pixel; a picture and a line of numbers, or JSON."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from symrender_cg.errors import ArgumentError
from symrender_cg.scene import load_scene
from symrender_cg.stress.conditioning import Conditioning, condition
from symrender_cg.stress.conditioning_chart import SUFFIXES, draw_conditioning


def run(arguments: argparse.Namespace) -> int:
    """Differentiates, draws where a file is named, prints."""
    width, height = arguments.size
    target = None if arguments.output is None else Path(arguments.output)
    if target is not None:
        _check(target)
    scene = load_scene(arguments.scene)
    found = condition(scene, width, height)
    name = "chapter1" if arguments.scene is None else Path(arguments.scene).stem
    if target is not None:
        draw_conditioning(target, found, name, measure="absolute" if arguments.absolute else "ulp")
    data = as_data(found)
    if arguments.json:
        print(json.dumps(data, indent=2, allow_nan=False))
        return 0
    print(f"{name}, {width} x {height}: {summary(data)}")
    if target is not None:
        print(f"{target}: {'absolute' if arguments.absolute else 'in ulp of the pixel'}, on a log scale")
    return 0


def as_data(found: Conditioning) -> dict[str, Any]:
    """Figures of an image as what JSON holds; of the pixels that show a surface, or of all where none does.

    ulp, absolute: median, p999 (the 99.9th percentile) and worst of the pixels that do not flip. worst: the pixel that
    moves most in ulp, and the input that moves it most; null where nothing moves. reasons: pixels by kind of decision.
    """
    chosen = found.index >= 0 if (found.index >= 0).any() else np.ones(found.index.shape, dtype=np.bool_)
    chosen &= ~found.flips
    place = found.worst
    return {
        "size": [found.index.shape[1], found.index.shape[0]],
        "pixels": int(np.count_nonzero(chosen)),
        "flips": int(np.count_nonzero(found.flips)),
        "reasons": dict(found.reasons),
        "ulp": _figures(found.ulps[chosen]),
        "absolute": _figures(found.absolute[chosen]),
        "worst": None
        if not place
        else {
            "row": place[0],
            "column": place[1],
            "ulp": _finite(float(found.ulps[place])),
            "absolute": _finite(float(found.absolute[place])),
            "input": found.input_at(place),
        },
    }


def summary(data: dict[str, Any]) -> str:
    """The figures in words."""
    reasons = ", ".join(f"{what}: {count}" for what, count in data["reasons"].items())
    flips = ("1 pixel flips" if data["flips"] == 1 else f"{data['flips']} pixels flip") + (reasons and f" ({reasons})")
    worst, ulp = data["worst"], data["ulp"]
    if worst is None or ulp["median"] is None:
        return f"no input moves a pixel; {flips}"
    return (
        f"half an ulp of every input moves a pixel by {ulp['median']:.3g} ulp (median), 99.9 % of them by less than "
        f"{ulp['p999']:.3g}, the worst by {worst['ulp']:.3g} ({worst['absolute']:.2e}), row {worst['row']}, column "
        f"{worst['column']}, most of it by {worst['input']}; {flips}"
    )


def _figures(numbers: Any) -> dict[str, float | None]:
    if not numbers.size:
        return {"median": None, "p999": None, "worst": None}
    return {
        "median": _finite(float(np.median(numbers))),
        "p999": _finite(float(np.quantile(numbers, 0.999, method="higher"))),
        "worst": _finite(float(numbers.max())),
    }


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None


def _check(target: Path) -> None:
    """Refuses a file that cannot be drawn before anything is computed."""
    if target.suffix.lower() not in SUFFIXES:
        raise ArgumentError(
            f"{target}: {target.suffix!r} is not the suffix of a picture; expected {', '.join(SUFFIXES)}; rename it"
        )
    if target.is_dir() or not target.parent.is_dir():
        raise ArgumentError(f"{target}: not a place for a file; expected a file's name in a folder that exists")
