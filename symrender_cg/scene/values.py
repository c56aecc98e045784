"""Checks of single values: anything that a caller or a file may write -> float, colour, vector, whole number, bool.

Comes in: a value of any type and its place. Goes out: a plain Python value, with -0.0 turned into 0.0, so that equal
scenes have the same bits. Never done here: a check that needs two fields at once (that belongs to the model), or a
silent repair of a value that has no meaning. numpy's scalars and arrays are understood without importing numpy.
"""

from __future__ import annotations

import math
import reprlib
from math import isfinite
from numbers import Integral, Real
from typing import Any, Final, TypeAlias, TypeVar

from symrender_cg.errors import SceneError

T = TypeVar("T")

Colour: TypeAlias = float | tuple[float, float, float]
"""A grey, or linear red, green and blue; each >= 0 and finite."""

LARGEST: Final = "1.7976931348623157e308"
INFINITY: Final = math.inf


def _plain(value: object) -> object:
    """A numpy scalar as a Python number, an array as nested lists, anything else as it is."""
    tolist = getattr(value, "tolist", None)
    return tolist() if callable(tolist) else value


def described(value: object) -> str:
    """`value` with its type, short enough for one line of a message."""
    return f"{reprlib.repr(value)} of type {type(value).__name__}"


def finite(place: str, value: object, meaning: str) -> float:
    """`value` as a finite float64; integers and fractions are rounded to the nearest float.

    `meaning` completes "expected ..." in the message, such as "a shininess, a number >= 0".

    Raises SceneError for text, bool and other types, for NaN, for infinity, for an integer beyond float64.
    """
    if type(value) is float and isfinite(value):
        return value + 0.0
    plain = _plain(value)
    if isinstance(plain, bool) or not isinstance(plain, Real):
        hint = "; write it without quotes" if isinstance(plain, str) else ""
        raise SceneError(place, f"{described(value)} is not a number; expected {meaning}{hint}")
    try:
        result = float(plain)
    except OverflowError:
        result = math.inf
    if math.isnan(result):
        raise SceneError(place, f"nan is not a number; expected {meaning}; look for 0/0 or inf - inf where it was made")
    if math.isinf(result):
        raise SceneError(
            place,
            f"{reprlib.repr(plain)} is not finite in float64; expected {meaning}, at most {LARGEST}; "
            "write a large finite number, or use a larger unit",
        )
    return result + 0.0


def positive(place: str, value: object, meaning: str, remedy: str) -> float:
    """`value` as a finite float64 > 0; `remedy` says what to write instead of 0 or a negative number."""
    result = finite(place, value, f"{meaning}, a number > 0")
    if result <= 0.0:
        raise SceneError(place, f"{result!r} is not positive; expected {meaning}, a number > 0; {remedy}")
    return result


def non_negative(place: str, value: object, meaning: str, remedy: str) -> float:
    """`value` as a finite float64 >= 0; `remedy` says what to write instead of a negative number."""
    result = finite(place, value, f"{meaning}, a number >= 0")
    if result < 0.0:
        raise SceneError(place, f"{result!r} is negative; expected {meaning}, a number >= 0; {remedy}")
    return result


def fraction(place: str, value: object, meaning: str, remedy: str) -> float:
    """`value` as a float64 of [0, 1]; `remedy` says what to write instead of a number outside."""
    result = finite(place, value, f"{meaning}, a number from 0 to 1")
    if not 0.0 <= result <= 1.0:
        raise SceneError(place, f"{result!r} is not from 0 to 1; expected {meaning}, a number >= 0 and <= 1; {remedy}")
    return result


def whole(place: str, value: object, meaning: str, largest: int) -> int:
    """`value` as an int of [0, largest]; numpy's whole numbers are accepted, 4.0 and true are not."""
    plain = _plain(value)
    expected = f"expected {meaning}, a whole number from 0 to {largest}"
    if isinstance(plain, bool) or not isinstance(plain, Integral):
        raise SceneError(place, f"{described(value)} is not a whole number; {expected}; write it without a point")
    result = int(plain)
    if not 0 <= result <= largest:
        raise SceneError(place, f"{reprlib.repr(result)} is out of range; {expected}; write one of these")
    return result


def colour(place: str, value: object, meaning: str, remedy: str) -> Colour:
    """`value` as a float64 >= 0 or a tuple of three; lists and numpy arrays of three are accepted.

    A tuple of three equal numbers stays a tuple. The place of a wrong entry has its index, such as `ambient[1]`.
    """
    if type(value) is tuple and len(value) == 3:
        red, green, blue = value
        plain_floats = type(red) is type(green) is type(blue) is float
        if plain_floats and min(red, green, blue) >= 0.0 and isfinite(red + green + blue):
            return red + 0.0, green + 0.0, blue + 0.0
    plain = _plain(value)
    if isinstance(plain, (list, tuple)):
        if len(plain) != 3:
            raise SceneError(
                place,
                f"{reprlib.repr(plain)} has {len(plain)} entries; expected {meaning}, one number >= 0 for a grey or "
                "exactly three (red, green, blue)",
            )
        red, green, blue = (
            non_negative(f"{place}[{index}]", entry, f"the {name} of {meaning}", remedy)
            for index, (entry, name) in enumerate(zip(plain, ("red", "green", "blue"), strict=True))
        )
        return red, green, blue
    if isinstance(plain, str) or not isinstance(plain, Real):
        raise SceneError(
            place,
            f"{described(value)} is not a colour; expected {meaning}, a number >= 0 for a grey or three such as "
            "(0.9, 0.5, 0.1) for red, green and blue",
        )
    return non_negative(place, plain, meaning, remedy)


def vector(place: str, value: object, meaning: str) -> tuple[float, float, float]:
    """`value` as a tuple of three finite float64; tuples, lists and numpy arrays of three are accepted."""
    if type(value) is tuple and len(value) == 3:
        x, y, z = value
        if type(x) is type(y) is type(z) is float and isfinite(x) and isfinite(y) and isfinite(z):
            return x + 0.0, y + 0.0, z + 0.0
    plain = _plain(value)
    if not isinstance(plain, (list, tuple)):
        raise SceneError(
            place, f"{described(value)} is not a vector; expected {meaning}, three numbers such as (0, 0, 4)"
        )
    if len(plain) != 3:
        raise SceneError(
            place,
            f"{reprlib.repr(plain)} has {len(plain)} entries; expected {meaning}, exactly three numbers (x, y, z)",
        )
    x, y, z = (finite(f"{place}[{axis}]", entry, f"a coordinate of {meaning}") for axis, entry in enumerate(plain))
    return x, y, z


def direction(place: str, value: object, meaning: str, example: str) -> tuple[float, float, float]:
    """`value` as a vector that is not zero; its length may be anything else."""
    result = vector(place, value, meaning)
    if result == (0.0, 0.0, 0.0):
        raise SceneError(
            place, f"{result} has no direction; expected {meaning}, a vector of length > 0, such as {example}"
        )
    return result


def flag(place: str, value: object, meaning: str) -> bool:
    """`value` as a bool; numpy's bool is accepted, 0 and 1 and text are not."""
    plain = _plain(value)
    if not isinstance(plain, bool):
        raise SceneError(place, f"{described(value)} is not a truth value; expected {meaning}, true or false")
    return plain


def instance(place: str, value: object, expected: type[T] | tuple[type[T], ...], example: str) -> T:
    """`value` when it is an `expected`, or one of them; `example` shows how to write one."""
    if not isinstance(value, expected):
        name = _named(expected)
        raise SceneError(place, f"{described(value)} is not a {name}; expected a {name}; write {example}")
    return value


def members(place: str, value: object, expected: type[T] | tuple[type[T], ...], example: str) -> tuple[T, ...]:
    """`value`, a tuple or list, as a tuple whose entries are all of the expected class or classes."""
    if not isinstance(value, (list, tuple)):
        name = _named(expected)
        raise SceneError(place, f"{described(value)} is not a tuple; expected a tuple of {name}; write ({example},)")
    for index, entry in enumerate(value):
        if not isinstance(entry, expected):
            instance(f"{place}[{index}]", entry, expected, example)
    return tuple(value)


def _named(expected: type[Any] | tuple[type[Any], ...]) -> str:
    return " or a ".join(kind.__name__ for kind in (expected if isinstance(expected, tuple) else (expected,)))
