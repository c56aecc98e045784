"""First derivatives of a number with respect to all its inputs at once, over arrays of points: the reverse mode.

Comes in: inputs, each with the half ulp that it may be off; arithmetic on them. Goes out: for one result how far each
input moves it, in first order. Every operation is a node that keeps its value and the derivatives to its operands; a
sweep from the result back to the inputs multiplies and adds them (Linnainmaa 1970; Griewank and Walther 2008, ch. 3).
All derivatives cost a few times what the value does, however many inputs there are. Never done here: a decision.

Arrays have one entry a point. A part of the points is gone on with by `take`, and brought back by `put`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.reference.brute_rays import cross as accurate_cross

Floats: TypeAlias = npt.NDArray[np.float64]
Indices: TypeAlias = npt.NDArray[np.int64]
Mask: TypeAlias = npt.NDArray[np.bool_]
Derivative: TypeAlias = Floats | float
Operand: TypeAlias = "Number | Floats | float"
Triple: TypeAlias = "tuple[Number, Number, Number]"


@dataclass(frozen=True, slots=True)
class Input:
    """A number of the scene as some points see it.

    place: its name with {} for the index. index: which of its kind each point sees. points: those points, as positions
    in the whole chunk. half_ulp: what the number may be off, in the unit of its value.
    """

    place: str
    index: Indices
    points: Indices
    number: Number
    half_ulp: Floats


class Tape:
    """The nodes in the order in which they were made, and which of them are inputs; `count` points in the chunk."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.nodes: list[Number] = []
        self.inputs: list[Input] = []

    def input(self, place: str, values: Floats, index: Indices | int, points: Indices) -> Number:
        """A new input. A number that is 0 is exact: it stands for something that is not there."""
        value = np.ascontiguousarray(np.broadcast_to(values, points.shape), dtype=np.float64)
        number = Number(self, value)
        indices = np.broadcast_to(np.asarray(index, dtype=np.int64), points.shape)
        half_ulp = np.where(value == 0.0, 0.0, 0.5 * np.spacing(np.abs(value)))
        self.inputs.append(Input(place, indices, points, number, half_ulp))
        return number

    def moves(self, result: Number) -> list[tuple[str, Indices, Floats]]:
        """(place, index, move) of each input, for all points of the chunk: how far half an ulp of it moves `result`.

        `result` may be of some of the points only. An input that enters more than once, such as a sphere that is seen
        in a mirror again, comes once for each time with its moves added up at the first; index is -1 and the move 0
        where a point does not see the input.
        """
        adjoints = self._adjoints(result)
        found: dict[str, list[tuple[Indices, Floats]]] = {}
        for entry in self.inputs:
            adjoint = adjoints.get(entry.number.place)
            if adjoint is None:
                continue
            index, move = np.full(self.count, -1), np.zeros(self.count)
            index[entry.points], move[entry.points] = entry.index, adjoint * entry.half_ulp
            for earlier_index, earlier_move in found.setdefault(entry.place, []):
                same = (earlier_index == index) & (index >= 0)
                earlier_move[same] += move[same]
                move[same], index[same] = 0.0, -1
            found[entry.place].append((index, move))
        return [(place, index, move) for place, entries in found.items() for index, move in entries]

    def _adjoints(self, result: Number) -> dict[int, Floats]:
        """d result / d node for every node that it rests on, by the node's place."""
        adjoints: dict[int, Floats] = {result.place: np.ones(result.value.shape)}
        for node in reversed(self.nodes[: result.place + 1]):
            if not node.operands or node.place not in adjoints:
                continue
            adjoint = adjoints.pop(node.place)
            for operand, derivative in node.operands:
                into = adjoints.get(operand.place)
                if into is None:
                    into = adjoints[operand.place] = np.zeros(operand.value.shape)
                if node.taken is not None:
                    into[node.taken] += adjoint
                elif node.put is not None:
                    into += adjoint[node.put]
                else:
                    into += derivative * adjoint
        return adjoints


class Number:
    """An array of values that knows what it was made of."""

    __array_ufunc__ = None
    __slots__ = ("operands", "place", "put", "taken", "tape", "value")

    def __init__(
        self,
        tape: Tape,
        value: Floats,
        operands: tuple[tuple[Number, Derivative], ...] = (),
        *,
        taken: Indices | None = None,
        put: Indices | None = None,
    ) -> None:
        self.tape, self.value, self.operands, self.taken, self.put = tape, value, operands, taken, put
        self.place = len(tape.nodes)
        tape.nodes.append(self)

    def made(self, value: Floats, *operands: tuple[Number, Derivative]) -> Number:
        """A number of that value whose derivatives are given."""
        return Number(self.tape, value, operands)

    def take(self, chosen: Indices) -> Number:
        """The chosen points; no point twice."""
        return Number(self.tape, self.value[chosen], ((self, 1.0),), taken=chosen)

    def placed(self, chosen: Indices, count: int) -> Number:
        """`count` points with these at the chosen ones and 0 elsewhere."""
        value = np.zeros(count)
        value[chosen] = self.value
        return Number(self.tape, value, ((self, 1.0),), put=chosen)

    def __add__(self, other: Operand) -> Number:
        if isinstance(other, Number):
            return self.made(self.value + other.value, (self, 1.0), (other, 1.0))
        return self.made(self.value + other, (self, 1.0))

    def __sub__(self, other: Operand) -> Number:
        if isinstance(other, Number):
            return self.made(self.value - other.value, (self, 1.0), (other, -1.0))
        return self.made(self.value - other, (self, 1.0))

    def __mul__(self, other: Operand) -> Number:
        if isinstance(other, Number):
            return self.made(self.value * other.value, (self, other.value), (other, self.value))
        return self.made(self.value * other, (self, other))

    def __truediv__(self, other: Operand) -> Number:
        if isinstance(other, Number):
            ratio = self.value / other.value
            return self.made(ratio, (self, 1.0 / other.value), (other, -ratio / other.value))
        return self.made(self.value / other, (self, 1.0 / other))

    def __neg__(self) -> Number:
        return self.made(-self.value, (self, -1.0))

    def root(self) -> Number:
        """sqrt(max(0, .)); the derivative at 0 is taken as 0: what rests on it there is a decision."""
        value = np.sqrt(np.maximum(self.value, 0.0))
        with np.errstate(divide="ignore"):
            return self.made(value, (self, np.where(value > 0.0, 0.5 / value, 0.0)))


# --------------------------------------------------------------------------------------------------------- vectors


def values(a: Triple) -> Floats:
    """(3, n)"""
    return np.stack([part.value for part in a])


def plus(a: Triple, b: Triple) -> Triple:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Triple, b: Triple) -> Triple:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(a: Triple, factor: Operand) -> Triple:
    return a[0] * factor, a[1] * factor, a[2] * factor


def over(a: Triple, divisor: Operand) -> Triple:
    return a[0] / divisor, a[1] / divisor, a[2] / divisor


def dot(a: Triple, b: Triple) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Triple, b: Triple) -> Triple:
    """a x b, each component to about an ulp of itself."""
    x, y, z = accurate_cross(values(a), values(b))
    (ax, ay, az), (bx, by, bz) = a, b
    return (
        ax.made(x, (ay, bz.value), (bz, ay.value), (az, -by.value), (by, -az.value)),
        ax.made(y, (az, bx.value), (bx, az.value), (ax, -bz.value), (bz, -ax.value)),
        ax.made(z, (ax, by.value), (by, ax.value), (ay, -bx.value), (bx, -ay.value)),
    )


def unit(a: Triple) -> tuple[Triple, Number]:
    """(a / |a|, |a|), with a power of two taken out first so that no square overflows."""
    largest = np.abs(values(a)).max(axis=0)
    power = np.ldexp(1.0, np.frexp(np.where(largest > 0.0, largest, 1.0))[1] - 1)
    small = over(a, power)
    length = dot(small, small).root()
    return over(small, length), length * power


def take(a: Triple, chosen: Indices) -> Triple:
    return a[0].take(chosen), a[1].take(chosen), a[2].take(chosen)


def sum_of(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """a + b = sum + error, exactly   (Knuth)"""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)
