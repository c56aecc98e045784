"""How much half an ulp of every input moves a pixel: conditioning, which is the scene's, apart from error, a kernel's.

Comes in: a scene of any kind, an image size or points. Goes out: Conditioning: for each point

    sum over all inputs p of |dI/dp| ulp(p)/2            in first order, absolute and in ulp of the pixel

which is the farthest that the true image can move when every input is rounded once. Inputs are the scene's numbers in
the camera's frame (centres, radii, lights, coefficients, exponents, the plane, the distance of the eye) and the point
(x, y) itself; the image's half-height acts through the point. An input that is 0 is exact. Where such a move takes a
decision over its border (an outline, a shadow's or tile's edge, the nearer of two surfaces, a gated highlight), no
derivative says how far the pixel goes: it flips, and both figures are infinite. Never done here: a kernel's error.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import ArgumentError, OutsidePlanError
from symrender_cg.reference.brute_rays import World
from symrender_cg.reference.points import as_points
from symrender_cg.scene import Scene
from symrender_cg.stress.adjoint import Floats, Indices, Mask, Tape
from symrender_cg.stress.sight import Walk, look

CHUNK: Final = 4096
"""Points that are gone on with at once."""
DOUBT: Final = 1e-12
"""Decisions nearer to their border than that share of what they compare are looked at: 9,000 roundings."""
ROUNDED: Final = 2.0
"""How many times what half ulps move a margin it must be away from 0 where it is itself rounded."""


@dataclass(frozen=True, slots=True)
class Conditioning:
    """How far half an ulp of the inputs moves each point; all arrays have the broadcast shape of the points.

    absolute, ulps: the largest move of a channel, and the largest in ulp of the channel's value; inf where the point
    flips. ulps may be inf also where the value is 0 and half ulps of the inputs make it something else.
    flips: whether half ulps of the inputs may take a decision over its border. index: the surface seen, -1 for none.
    strongest: which input moves the point most, as an index of `inputs`; -1 where none does.
    reasons: (decision, points that flip by it), such as ("outline", 3); a point may flip by several.
    """

    absolute: Floats
    ulps: Floats
    flips: Mask
    index: Indices
    strongest: Indices
    inputs: tuple[str, ...]
    reasons: tuple[tuple[str, int], ...]

    def input_at(self, place: tuple[int, ...]) -> str:
        """The name of the input that moves the point at that place most, such as `spheres[0].radius`; or `nothing`."""
        which = int(self.strongest[place])
        return "nothing" if which < 0 else self.inputs[which]

    @property
    def worst(self) -> tuple[int, ...]:
        """Where the largest finite move in ulp is; () where there is none."""
        finite = np.where(np.isfinite(self.ulps), self.ulps, -1.0)
        if finite.size == 0 or float(finite.max()) < 0.0:
            return ()
        return tuple(int(i) for i in np.unravel_index(int(np.argmax(finite)), finite.shape))


def condition(scene: Scene, width: int, height: int) -> Conditioning:
    """`condition_at` on the pixel centres of an image: arrays are (height, width), row 0 at the top."""
    for name, size in (("width", width), ("height", height)):
        if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
            raise ArgumentError(f"{name}: {size!r}; expected a whole number of pixels, at least 1")
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None, "a scene in the camera's frame has a half_height"
    step = np.float64(2.0 * half_height / height)
    columns = (np.arange(width, dtype=np.float64) + 0.5 - 0.5 * width) * step
    rows = (0.5 * height - 0.5 - np.arange(height, dtype=np.float64)) * step
    return condition_at(scene, columns[np.newaxis, :], rows[:, np.newaxis])


def condition_at(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> Conditioning:
    """Conditioning at points (x, y) of the image plane, which broadcast against each other.

    Raises ArgumentError for points that are not finite, OutsidePlanError where a derivative leaves float64: lengths
    should lie within 2^+-400 of the eye's distance.
    """
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    shape = columns.shape
    world = World(scene.in_camera_frame())
    flat_x, flat_y = columns.ravel(), rows.ravel()
    names: dict[str, int] = {}
    reasons: dict[str, int] = {}
    parts = []
    with np.errstate(all="ignore"):
        for begin in range(0, max(flat_x.size, 1), CHUNK):
            piece = slice(begin, begin + CHUNK)
            parts.append(_moved(world, flat_x[piece], flat_y[piece], names))
        absolute, ulps, index, strongest, suspects = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        flips = np.zeros(flat_x.size, dtype=np.bool_)
        doubtful = np.flatnonzero(suspects)
        for begin in range(0, doubtful.size, CHUNK):
            some = doubtful[begin : begin + CHUNK]
            for what, over in _flipping(world, flat_x[some], flat_y[some]).items():
                flips[some[over]] = True
                reasons[what] = reasons.get(what, 0) + int(np.count_nonzero(over))
    absolute[flips], ulps[flips] = np.inf, np.inf
    if np.isnan(absolute).any():
        at = int(np.argmax(np.isnan(absolute)))
        raise OutsidePlanError(
            f"the derivatives at ({flat_x[at]}, {flat_y[at]}) leave float64; expected lengths within 2^+-400 of the "
            "eye's distance and none that is subnormal; write the scene in another unit"
        )
    return Conditioning(
        absolute.reshape(shape),
        ulps.reshape(shape),
        flips.reshape(shape),
        index.reshape(shape),
        strongest.reshape(shape),
        tuple(names),
        tuple(sorted(reasons.items())),
    )


def _moved(world: World, x: Floats, y: Floats, names: dict[str, int]) -> tuple[Floats, Floats, Indices, Indices, Mask]:
    """(absolute, ulps, index, strongest, whether a decision is in doubt) of a chunk; new names get the next number."""
    tape, suspects = Tape(x.size), np.zeros(x.size, dtype=np.bool_)
    channels, index = look(Walk(world, tape, x, y, DOUBT, suspects))
    absolute, ulps = np.zeros(x.size), np.zeros(x.size)
    strongest, most = np.full(x.size, -1), np.zeros(x.size)
    for channel in channels:
        total = np.zeros(x.size)
        for place, which, move in tape.moves(channel):
            size = np.abs(move)
            total += size
            leading = np.flatnonzero(size > most)
            most[leading] = size[leading]
            for number in np.unique(which[leading]):
                name = _named(world, place, int(number))
                strongest[leading[which[leading] == number]] = names.setdefault(name, len(names))
        absolute = np.maximum(absolute, total)
        ulps = np.maximum(ulps, np.where(total == 0.0, 0.0, total / np.spacing(np.abs(channel.value))))
    return absolute, ulps, index, strongest, suspects


def _flipping(world: World, x: Floats, y: Floats) -> dict[str, Mask]:
    """Of each kind of decision: whether half ulps of the inputs may take one of a point over its border."""
    tape = Tape(x.size)
    walk = Walk(world, tape, x, y, DOUBT)
    look(walk)
    found: dict[str, Mask] = {}
    for decision in walk.decisions:
        reach = np.zeros(x.size)
        for _, _, move in tape.moves(decision.margin):
            reach += np.abs(move)
        slack = 1.0 if decision.exact else ROUNDED
        here = slack * reach[decision.points]
        over = ~(np.abs(decision.margin.value) > here) & ~(here == 0.0)
        if over.any():
            found.setdefault(decision.what, np.zeros(x.size, dtype=np.bool_))[decision.points[over]] = True
    return found


def _named(world: World, place: str, index: int) -> str:
    """The place of an input as the scene names it: a surface's number put in, the channel of a grey left out."""
    spheres = len(world.radii)
    if place == "eye":
        return "camera.eye[2]"
    if place.startswith("{}."):
        owner = (
            f"spheres[{index}].material" if index < spheres else ("plane.material", "plane.checker")[index - spheres]
        )
        place = owner + place[2:]
    name = place.replace("{}", str(index))
    whole, bracket, _ = name.rpartition("[")
    return whole if bracket and isinstance(_value(world.frame, whole), float) else name


def _value(scene: Scene, place: str) -> object:
    """What the scene holds at a place such as `lights[1].intensity`."""
    found: Any = scene
    for word in re.findall(r"\w+", place):
        found = found[int(word)] if word.isdigit() else getattr(found, word)
    return found
