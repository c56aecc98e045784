"""A word of the command line -> a value: sizes, lists of levels and layers, tolerances, counts.

In: the text of one argument. Out: its value, or ArgumentTypeError with what was expected, which argparse prints. Never
here: an option, a default, or whether values fit each other.
"""

from __future__ import annotations

import argparse

from symrender_cg.lower.variants import ACCURACIES

LARGEST_SIDE = 1 << 24
LAYERS = ("depth", "normal", "index", "background", "ambient", "reflected", "diffuse", "specular")


class Accuracies(tuple[str, ...]):
    """The levels as argparse lists them; a level with choices that `cost` found, such as `single_fused`, is one too."""

    __slots__ = ()

    def __contains__(self, name: object) -> bool:
        return tuple.__contains__(self, name) or (isinstance(name, str) and _is_choice(name))


def _is_choice(name: str) -> bool:
    if "_" not in name:
        return False
    from symrender_cg.lower.choices import named

    return named(name) is not None


def image_size(text: str) -> tuple[int, int]:
    """`800x600` -> (800, 600). Raises ArgumentTypeError for anything else."""
    sides = text.lower().split("x")
    if len(sides) == 2 and all(side.isascii() and side.isdigit() for side in sides):
        width, height = int(sides[0][:12]), int(sides[1][:12])
        if 1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE:
            return width, height
    raise argparse.ArgumentTypeError(
        f"{text!r} is not a size; expected WIDTHxHEIGHT in pixels, each from 1 to {LARGEST_SIDE}, such as 800x600"
    )


def accuracy_list(text: str) -> tuple[str, ...] | str:
    """`double,literal` -> those accuracies in the order of the package, each once; `all` -> `all`."""
    names = [name.strip() for name in text.split(",")]
    if unknown := [name for name in names if name not in (*ACCURACIES, "all") and not _is_choice(name)]:
        raise argparse.ArgumentTypeError(
            f"{unknown[0]!r} is not known; expected some of {', '.join(ACCURACIES)}, or all"
        )
    levels = tuple(name for name in ACCURACIES if name in names)
    return "all" if "all" in names else levels + tuple(dict.fromkeys(name for name in names if name not in ACCURACIES))


def layer_list(text: str) -> tuple[str, ...]:
    """`depth,terms` -> those names, each once. Raises ArgumentTypeError for an unknown one."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    choices = (*LAYERS, "terms", "all")
    if unknown := [name for name in names if name not in choices]:
        raise argparse.ArgumentTypeError(f"{unknown[0]!r} is not known; expected some of {', '.join(choices)}")
    return names


def tolerance(text: str) -> float:
    """A finite number >= 0. Raises ArgumentTypeError for anything else."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if 0.0 <= value < float("inf"):
        return value
    raise argparse.ArgumentTypeError(f"{text!r} is not a tolerance; expected a number >= 0, such as 0.002")


def request(text: str) -> tuple[str, float]:
    """`max_error=1e-6` -> ("max_error", 1e-6). Raises ArgumentTypeError for anything else."""
    name, _, value = text.partition("=")
    if name not in ("max_error", "max_ulp", "bits"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a request; expected max_error=E, max_ulp=U or bits=B")
    return name, positive(value)


def positive(text: str) -> float:
    """A finite number above 0. Raises ArgumentTypeError for anything else."""
    if (value := tolerance(text)) > 0.0:
        return value
    raise argparse.ArgumentTypeError(f"{text!r} is not a bound; expected a number above 0, such as 1e-6")


def count_from_one(text: str) -> int:
    """A whole number from 1 up, of at most nine digits. Raises ArgumentTypeError for anything else."""
    if (number := count(text)) > 0:
        return number
    raise argparse.ArgumentTypeError(f"{text!r} is not a count; expected a whole number from 1 up")


def count(text: str) -> int:
    """A whole number from 0 up, of at most nine digits. Raises ArgumentTypeError for anything else."""
    if text.isascii() and text.isdigit() and len(text) <= 9:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not a count; expected a whole number from 0 up")
