"""Checks of single values: anything that a caller or a file may write -> float, tuple of three floats, bool.

Comes in: a value of any type and its place. Goes out: a plain Python value, with -0.0 turned into 0.0, so that equal
scenes have the same bits. Never done here: a check that needs two fields at once (that belongs to the model), or a
silent repair of a value that has no meaning. numpy's scalars and arrays are understood without importing numpy.
"""

from __future__ import annotations

import math
import reprlib
from numbers import Real
from typing import Final, TypeVar

from symrender_cg.errors import SceneError

T = TypeVar("T")

LARGEST: Final = "1.7976931348623157e308"


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


def vector(place: str, value: object, meaning: str) -> tuple[float, float, float]:
    """`value` as a tuple of three finite float64; tuples, lists and numpy arrays of three are accepted."""
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


def flag(place: str, value: object, meaning: str) -> bool:
    """`value` as a bool; numpy's bool is accepted, 0 and 1 and text are not."""
    plain = _plain(value)
    if not isinstance(plain, bool):
        raise SceneError(place, f"{described(value)} is not a truth value; expected {meaning}, true or false")
    return plain


def instance(place: str, value: object, expected: type[T], example: str) -> T:
    """`value` when it is an `expected`; `example` shows how to write one."""
    if not isinstance(value, expected):
        name = expected.__name__
        raise SceneError(place, f"{described(value)} is not a {name}; expected a {name}; write {example}")
    return value


def members(place: str, value: object, expected: type[T], example: str) -> tuple[T, ...]:
    """`value`, a tuple or list, as a tuple whose entries are all of the expected class."""
    if not isinstance(value, (list, tuple)):
        name = expected.__name__
        raise SceneError(place, f"{described(value)} is not a tuple; expected a tuple of {name}; write ({example},)")
    return tuple(instance(f"{place}[{index}]", entry, expected, example) for index, entry in enumerate(value))
