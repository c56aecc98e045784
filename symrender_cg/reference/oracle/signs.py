"""Yes, no, or not yet: what a ball decides, and what is asked of exact numbers where it does not.

Comes in: balls and exact numbers. Goes out: True, False, or None where a ball leaves it open; Exactly, the exact twin
of what is in balls, made when it is asked for. Never done here: a guess.

Exact numbers grow with each mirror's root, so that behind mirrors they are asked only from MIRRORS_FROM bits on, and
never behind more than MOST_MIRRORS.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Generic, TypeVar

from flint import ctx

from symrender_cg.reference.oracle.surds import Surd, sign
from symrender_cg.reference.oracle.whole import Number

MIRRORS_FROM: Final = 2560
MOST_MIRRORS: Final = 4

T = TypeVar("T")


class Undecided(Exception):  # noqa: N818 - not an error: the next precision may decide it
    """A sign that balls of this precision leave open."""


class Exactly(Generic[T]):
    """The exact twin of a ray or site, made when it is first asked for. Raises Undecided where that is not yet done."""

    __slots__ = ("_found", "_make", "_mirrors")

    def __init__(self, mirrors: int, make: Callable[[], T]) -> None:
        self._mirrors, self._make = mirrors, make
        self._found: list[T] = []

    def __call__(self) -> T:
        if self._mirrors and (self._mirrors > MOST_MIRRORS or ctx.prec < MIRRORS_FROM):
            raise Undecided
        if not self._found:
            self._found.append(self._make())
        return self._found[0]


def above_0(value: Number) -> bool | None:
    """value > 0, None where a ball leaves it open."""
    if isinstance(value, Surd):
        return sign(value) > 0
    return True if value > 0 else False if value <= 0 else None


def at_least_0(value: Number) -> bool | None:
    if isinstance(value, Surd):
        return sign(value) >= 0
    return True if value >= 0 else False if value < 0 else None


def all_true(*parts: bool | None) -> bool | None:
    """False where one part is, None where none is false and one is open."""
    if False in parts:
        return False
    return None if None in parts else True
