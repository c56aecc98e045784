"""Points and directions of many scenes in the frames of their cameras: each coordinate the float64 nearest to the true
one, as symrender_cg.scene.turning gives it.

In: eyes, points looked at, ways up; points and directions. Out: coordinates. They are computed in two words, good to
2^-84 of the offset's length; where that does not tell which float64 is the nearest, whole numbers do. Never here: a
camera that sees along its way up to within 2^-10, or lengths beyond 2^400: such a scene has no number here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from symrender_cg.reference.pairs import Pair, two_sum
from symrender_cg.run.two_words import cross_of, dot_of, is_nearest, root_of, unit_of
from symrender_cg.scene import Camera, PointLight, Scene, exact
from symrender_cg.scene.turning import Frame

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

ERROR: Final = 2.0**-84
"""Exceeds the relative error of a turned offset: some 60 roundings of 2^-104, divided by the least sine, 2^-10."""

_LEAST_SINE: Final = 2.0**-10
_LONGEST, _SHORTEST = 2.0**200, 2.0**-200


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames of C cameras: eye, look_at, up (C, 3) as they are given; axes, right, upward and backward, (C, 3, 3)
    in two words, and where their coordinates are exactly 0; eye_distance (C,); in_frame (C,): nothing is to be turned.
    nan where there is no number."""

    eye: Floats
    look_at: Floats
    up: Floats
    axes: Pair
    zeros: Truths
    in_frame: Truths
    eye_distance: Floats

    def points(self, points: Floats) -> Floats:
        """Points (C or 1, n, 3) in the frames, (C, n, 3)."""
        if self.in_frame.all():
            return points
        return self._turned(points, two_sum(points, -self.look_at[:, np.newaxis]), is_point=True)

    def directions(self, directions: Floats) -> Floats:
        """Directions (C or 1, n, 3) in the frames, (C, n, 3), of the same lengths to rounding."""
        if self.in_frame.all():
            return directions
        shape = (max(len(directions), len(self.eye)), *directions.shape[1:])
        return self._turned(directions, (np.broadcast_to(directions, shape), np.zeros(shape)), is_point=False)

    def _turned(self, given: Floats, offset: Pair, *, is_point: bool) -> Floats:
        high, low = offset
        if not high.size:
            return high
        size = np.abs(high).max(axis=2)
        in_range = (size == 0.0) | ((size >= _SHORTEST) & (size <= _LONGEST))
        axes = self.axes[0][:, np.newaxis], self.axes[1][:, np.newaxis]
        turned = dot_of((high[:, :, np.newaxis], low[:, :, np.newaxis]), axes)
        found = turned[0] + 0.0
        found[~in_range] = np.nan
        adds = np.where(self.zeros[:, np.newaxis], 0.0, np.abs(high)[:, :, np.newaxis]).max(axis=3)
        unsure = ~is_nearest(turned, ERROR * adds) & np.isfinite(found)
        unsure &= ~self.in_frame[:, np.newaxis, np.newaxis]
        every = np.broadcast_to(given, found.shape)
        for t in np.flatnonzero(unsure.any(axis=(1, 2))).tolist():
            doubtful = np.flatnonzero(unsure[t].any(axis=1))
            found[t, doubtful] = self._exactly(t, every[t, doubtful], is_point=is_point)
        return np.where(self.in_frame[:, np.newaxis, np.newaxis], every, found)

    def _exactly(self, t: int, given: Floats, *, is_point: bool) -> list[Any]:
        """The same for points or directions of one scene."""
        eye, look_at, up = (_vector(word[t if len(word) > 1 else 0]) for word in (self.eye, self.look_at, self.up))
        places = [(x, y, z) for x, y, z in given.tolist()]
        lights = tuple(PointLight(place) for place in places) if is_point else ()
        frame = Frame(Scene(Camera(eye, look_at, up, 1.0), (), lights))
        return [frame.point("", place) if is_point else frame.direction(place) for place in places]


def frames_of(eye: Floats, look_at: Floats, up: Floats) -> Frames:
    """The frames of cameras (C, 3) each; nan where a camera is none, or beyond what is said above."""
    in_frame = (look_at == 0.0).all(axis=1) & (eye[:, :2] == 0.0).all(axis=1) & (eye[:, 2] > 0.0)
    in_frame &= (up[:, 0] == 0.0) & (up[:, 1] > 0.0) & np.isfinite(up).all(axis=1)
    nothing = np.zeros((len(eye), 3, 3))
    if in_frame.all():
        return Frames(eye, look_at, up, (nothing, nothing), nothing == 0.0, in_frame, eye[:, 2])
    backward = two_sum(eye, -look_at)
    right = cross_of((up, np.zeros_like(up)), backward)
    sure = _length(right[0]) >= _LEAST_SINE * _length(up) * _length(backward[0])
    for vector in (eye, look_at, up):
        sure &= np.abs(vector).max(axis=1) <= _LONGEST
    for vector in (up, backward[0]):
        sure &= np.abs(vector).max(axis=1) >= _SHORTEST
    units = [unit_of(vector) for vector in (right, cross_of(backward, right), backward)]
    high, low = (np.stack([unit[word] for unit in units], axis=1) for word in (0, 1))
    high[~sure] = low[~sure] = np.nan
    distance = np.where(in_frame, eye[:, 2], _distances(eye, look_at, backward, sure))
    right_zeros = _is_zero(up, backward[0])
    upward_zeros = _is_zero(backward[0], np.where(right_zeros, 0.0, 1.0))
    zeros = np.stack((right_zeros, upward_zeros, backward[0] == 0.0), axis=1)
    return Frames(eye, look_at, up, (high, low), zeros, in_frame, distance)


def _is_zero(a: Floats, b: Floats) -> Truths:
    """(C, 3): which coordinates of a x b are 0 because each of their terms is."""
    meets = (a != 0.0)[:, :, np.newaxis] & (b != 0.0)[:, np.newaxis]
    return np.stack([~(meets[:, i, j] | meets[:, j, i]) for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)


def _distances(eye: Floats, look_at: Floats, backward: Pair, sure: Truths) -> Floats:
    """|eye - look_at|, correctly rounded; nan where that is not sure."""
    _, exponent = np.frexp(np.abs(backward[0]).max(axis=1))
    scale = np.ldexp(1.0, -exponent)[:, np.newaxis]
    scaled = backward[0] * scale, backward[1] * scale
    length = root_of(dot_of(scaled, scaled))
    found = np.where(sure, np.ldexp(length[0], exponent), np.nan)
    for t in np.flatnonzero(sure & ~is_nearest(length, ERROR * length[0])).tolist():
        ends = _vector(eye[t]), _vector(look_at[t])
        grid = exact.grid_of((*ends[0], *ends[1]))
        away = exact.difference(*(exact.vector_on_grid(end, grid) for end in ends))
        square = exact.dot(away, away)
        found[t] = exact.nearest_root(square, square, grid)
    return found


def unit_vectors(directions: Floats) -> Floats:
    """Directions (n, 3) of length 1, each coordinate the float64 nearest to the true one."""
    unit = unit_of((directions, np.zeros_like(directions)))
    found = unit[0] + 0.0
    for t, k in np.argwhere(~is_nearest(unit, ERROR) & (directions != 0.0)).tolist():
        given = _vector(directions[t])
        whole = exact.vector_on_grid(given, exact.grid_of(given))
        found[t, k] = exact.nearest_root(whole[k], exact.dot(whole, whole), 0)
    return found


def _vector(v: Floats) -> exact.Vector:
    x, y, z = v.tolist()
    return x, y, z


def _length(v: Floats) -> Floats:
    """|v| along the last axis."""
    return np.asarray(np.sqrt((v * v).sum(axis=-1)))
