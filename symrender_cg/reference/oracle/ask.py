"""The questions that the oracle answers, for arrays of points.

Comes in: a Scene, points (x, y) of its image plane. Goes out: arrays of the points' broadcast shape, one axis more for
colour. Never done here: mathematics; one_sphere and scene have it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, Literal, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import AccuracyError, ArgumentError
from symrender_cg.reference.oracle.answers import Answers, Enclosures
from symrender_cg.reference.oracle.one_sphere import OneSphere, takes
from symrender_cg.reference.oracle.rounding import FLOAT32, FLOAT64, FULL, UINT8, Rounding, interval, to_float32
from symrender_cg.reference.oracle.scene import AnyScene
from symrender_cg.reference.points import as_points
from symrender_cg.scene import Scene

Target: TypeAlias = Literal["float64", "float32", "uint8"]
TARGETS: Final[tuple[Target, ...]] = ("float64", "float32", "uint8")
MOST_BITS: Final = 32768
"""The narrowest ball that `enclose` can be asked for."""

T = TypeVar("T")


def evaluate(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> Answers:
    """The true intensity at each point of any scene, unclipped and correctly rounded to every target (see Answers).

    Raises AccuracyError with the `points` (indices of the raveled points) that nothing decides: see the package.
    """
    found = _ask(scene, x, y, FULL)
    numbers = found.table(np.float64)
    value, residual, sides, levels = (numbers[..., k].copy() for k in range(4))
    value32 = to_float32(value, sides.astype(np.int8))
    return Answers(value, residual, value32, levels.astype(np.uint8), found.index())


def settle(
    scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike, target: Target = "float64", *, clip: bool = False
) -> npt.NDArray[np.float64] | npt.NDArray[np.float32] | npt.NDArray[np.uint8]:
    """The true intensity correctly rounded to one target; float64 and float32 to even, uint8 floor(255 clip(I) + 1/2).

    clip: to [0, 1], before or after rounding, which is the same; uint8 always is. Decides more than `evaluate`, as only
    ties of this target count. Raises AccuracyError as evaluate does, ArgumentError for another target.
    """
    if target == "float64":
        value = _ask(scene, x, y, FLOAT64).table(np.float64)
        return np.clip(value, 0.0, 1.0) if clip else value
    if target == "float32":
        numbers = _ask(scene, x, y, FLOAT32).table(np.float64)
        single = to_float32(numbers[..., 0], numbers[..., 1].astype(np.int8))
        return np.clip(single, np.float32(0.0), np.float32(1.0)) if clip else single
    if target == "uint8":
        return _ask(scene, x, y, UINT8).table(np.uint8)
    raise ArgumentError(f"target: {target!r}; expected one of {', '.join(map(repr, TARGETS))}")


def enclose(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike, *, bits: int = 256) -> Enclosures:
    """A ball about the true intensity at each point, its radius at most 2^-bits of its middle, as exact fractions.

    bits: 1 to 32768. Raises AccuracyError as evaluate does, and ArgumentError for other bits.
    """
    if isinstance(bits, bool) or not isinstance(bits, int | np.integer) or not 1 <= bits <= MOST_BITS:
        raise ArgumentError(f"bits: {bits!r}; expected a whole number from 1 to {MOST_BITS}")
    wanted = int(bits)
    precisions = (wanted + 64, 2 * wanted + 512, 4 * wanted + 2560, 8 * wanted + 10240)
    numbers = _ask(scene, x, y, interval(wanted), precisions).table(np.object_)
    return Enclosures(numbers[..., 0], numbers[..., 1])


def index(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Which surface is seen at each point, always decided: sphere, len(spheres) for the plane, -1 for neither."""
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    frame = scene.in_camera_frame()
    solver = OneSphere(frame) if takes(frame) else AnyScene(frame)
    return np.array(solver.seen(columns.ravel(), rows.ravel()), dtype=np.int64).reshape(columns.shape)


def hits(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Whether a surface is seen at each point, always decided: tangency is a hit."""
    return np.asarray(index(scene, x, y) >= 0)


# ------------------------------------------------------------------------------------------------------------ asking


@dataclass(frozen=True, slots=True)
class _Found(Generic[T]):
    """For each point the index and the rounded channels; shape is that of the points."""

    shape: tuple[int, ...]
    channels: int
    parts: int
    points: list[tuple[int, list[T]]]

    def table(self, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """Shape points + channels, and one axis more where the rounding gives several numbers."""
        one = (len(self.points), self.channels, *(() if self.parts == 1 else (self.parts,)))
        table = np.array([rounded for _, rounded in self.points], dtype=dtype).reshape(one)
        return table.reshape((*self.shape, *one[1 if self.channels > 1 else 2 :]))

    def index(self) -> npt.NDArray[np.int64]:
        return np.array([index for index, _ in self.points], dtype=np.int64).reshape(self.shape)


def _ask(
    scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike, rounding: Rounding[T], bits: Sequence[int] | None = None
) -> _Found[T]:
    """What was found at each point; AccuracyError where something was not."""
    frame = scene.in_camera_frame()
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    us, vs = columns.ravel(), rows.ravel()
    found: list[tuple[int, list[T]] | None] = [None] * us.size
    for solver in (OneSphere, AnyScene) if takes(frame) else (AnyScene,):
        left = [k for k, answer in enumerate(found) if answer is None]
        if left:
            for k, answer in zip(left, solver(frame).answers(us[left], vs[left], rounding, bits), strict=True):
                found[k] = answer
    decided = [answer for answer in found if answer is not None]
    if len(decided) < len(found):
        open_ = tuple(k for k, answer in enumerate(found) if answer is None)
        first = float(us[open_[0]]), float(vs[open_[0]])
        raise AccuracyError(
            f"{len(open_)} of {len(found)} points, the first at {first!r}, in a scene of {len(scene.spheres)} spheres: "
            "the value rests on a sign or a rounding that neither balls nor exact numbers decide; expected points that "
            "round one way; move them by one float, or leave them out",
            open_,
        )
    return _Found(columns.shape, frame.channels, rounding.parts, decided)
