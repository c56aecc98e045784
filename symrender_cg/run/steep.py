"""How far double's kernel of one sphere may be off, and the box of the image plane where its highlight is too steep.

Comes in: the numbers of a scene, as kernels take them, or of many scenes as arrays. Goes out: bounds in roundoffs,
2^-53, of max(1, value), and boxes: outside its box the kernel keeps 1e-15, inside it another one draws. A scene's box
has the same bits alone and among others: every operation on arrays is one that rounds correctly.
Never done here: a kernel, or an image.

An error of the mirrored ray's angle changes r.v^n by n sin(angle) r.v^(n - 1) times as much: by nothing in the middle
of the highlight, by sqrt(n / e) at 1 / sqrt(n) radians from it, and by nothing far from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symrender_cg.lower.variants import MOST_ROUNDOFFS

Floats = NDArray[np.float64]

LEAST_SHININESS = 8.0
"""From here on cos^n of an angle is close to exp(-n angle^2 / 2)."""

MOST_ANGLE = 0.6
"""A box for more of the highlight than this, in radians of r.v, would be a large part of the image."""

MOST_OF_PICTURE = 0.75
"""The largest part of the sphere's picture that a box may have. The kernel of `double` takes 0.2 to 0.5 of the time
that `stable` takes for a pixel: beyond this part the latter draws everything about as soon as the two together. It is a
matter of the scene alone, so that images of any size, points and sets of a batch agree."""

LEAST_FACING = 0.3
"""Cosine of the angle at which a mirrored ray meets the sphere: flatter ones draw a highlight out to the silhouette."""

FARTHEST = 1e60
"""A light farther away, in radii, shines in parallel."""

ROOM = 1.1
CORNERS = 24

NEARLY_MIDDLE = 1e-9
"""Radians by which the middle of a highlight is turned at last where it counts as found."""

AROUND_MIDDLE = 1e-7
"""What a box has beyond the highlight, in radii, a hundred times as much: a highlight may be narrower than what is
known of its middle."""


@dataclass(frozen=True, slots=True)
class Box:
    """Points (x, y) of the image plane, in scene units: left <= x <= right, bottom <= y <= top."""

    left: float
    right: float
    bottom: float
    top: float

    def holds(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Which points lie in it."""
        across, down = (x >= self.left) & (x <= self.right), (y >= self.bottom) & (y <= self.top)
        return np.asarray(across & down, dtype=np.bool_)

    @property
    def edges(self) -> Floats:
        """(1, 4): left, right, bottom, top."""
        return np.array([[self.left, self.right, self.bottom, self.top]])


class _Terms(NamedTuple):
    """Of the bound: what diffuse adds, what specular adds where it is flat, and more where it is steepest."""

    diffuse: Any
    flat: Any
    steep: Any
    known: Any


def roundoffs(numbers: Mapping[str, Any]) -> Any:
    """What errors of the kernel of `double` stay below; inf for a light in the surface. By a scene's numbers, or by
    those of many as arrays.

    With d the distance of the light from the surface in radii, and a the angle at which its ray is mirrored to the eye:

        diffuse   k_d (4.5 + 2 / d)
        specular  k_s (3 + 1.2 / d + sqrt(n) (b + 1.2 / d)),  b = 0.45 + 1.75 min(0.8, sin 2a); for a sphere off the
                  axis 3.6 in place of 3, and b = 1 + 1.9 sin 2a
        both      1 + I_L sqrt(diffuse^2 + specular^2)

    The constants are fitted: `python -m benchmarks hand-over` measures what part of this bound errors reach.
    """
    terms = _terms(numbers)
    return _together(numbers, terms, terms.flat + terms.steep)


def least_roundoffs(numbers: Mapping[str, Any]) -> Any:
    """The same where the highlight is flat: what is more than MOST_ROUNDOFFS is no matter of a box."""
    terms = _terms(numbers)
    return _together(numbers, terms, terms.flat)


def _together(numbers: Mapping[str, Any], terms: _Terms, specular: Any) -> Any:
    with np.errstate(all="ignore"):
        bound = 1.0 + numbers["light_intensity"] * np.hypot(terms.diffuse, specular)
    return np.where(terms.known, bound, np.inf)


def _terms(numbers: Mapping[str, Any]) -> _Terms:
    x, y, z = (numbers[f"light_{axis}"] - numbers[f"center_{axis}"] for axis in "xyz")
    to_x, to_y, to_z = -numbers["center_x"], -numbers["center_y"], numbers["eye"] - numbers["center_z"]
    radius, root = numbers["radius"], np.sqrt(numbers["shininess"])
    with np.errstate(all="ignore"):
        light, eye = (np.hypot(np.hypot(a, b), c) / radius for a, b, c in ((x, y, z), (to_x, to_y, to_z)))
        near = 1.0 / np.abs(light - 1.0)
        cosine = (x / radius / light) * (to_x / radius / eye)
        cosine += (y / radius / light) * (to_y / radius / eye)
        cosine += (z / radius / light) * (to_z / radius / eye)
        tangent = _tangent(np.clip(cosine, -1.0, 1.0), np.minimum(light, eye))
        turned = 2.0 * tangent / (1.0 + tangent * tangent)
        aside = (numbers["center_x"] != 0.0) | (numbers["center_y"] != 0.0) | (numbers["center_z"] != 0.0)
        slope = np.where(aside, 1.0 + 1.9 * turned, 0.45 + 1.75 * np.minimum(turned, 0.8))
        flat = np.where(root > 0.0, np.where(aside, 3.6, 3.0) + 1.2 * near, 1.0)
        steep = root * (slope + 1.2 * near)
        diffuse = numbers["k_diffuse"] * (4.5 + 2.0 * near)
        return _Terms(diffuse, numbers["k_specular"] * flat, numbers["k_specular"] * steep, np.isfinite(near))


def _tangent(cosine: Any, distance: Any) -> Any:
    """What the tangent of the angle of incidence a, up to 45 degrees, is at most where the light's ray is mirrored to
    the eye; 1 for larger angles. By the cosine between the ways to light and eye from the centre, and the distance of
    the nearer one in radii.

    The normal there stands at some angles g and h from those two ways, and g + h is the angle between them: one of the
    two is at most half of it, and tan a = sin g / (cos g - 1 / distance) grows with g and falls with the distance.
    """
    ahead = np.sqrt(0.5 + 0.5 * cosine) - 1.0 / distance
    return np.where(ahead > 0.0, np.minimum(np.sqrt(0.5 - 0.5 * cosine) / ahead, 1.0), 1.0)


def steep_share(numbers: Mapping[str, Any]) -> Any:
    """The part of the highlight's greatest steepness, sqrt(n / e), that leaves errors at MOST_ROUNDOFFS; at most 1, and
    0 where it is not the highlight alone that is in the way. By a scene's numbers, or by those of many as arrays."""
    terms, intensity = _terms(numbers), np.asarray(numbers["light_intensity"])
    with np.errstate(all="ignore"):
        whole = (MOST_ROUNDOFFS - 1.0) / intensity
        left = whole * whole - terms.diffuse * terms.diffuse
        share = np.clip((np.sqrt(left) - terms.flat) / terms.steep, 0.0, 1.0)
    return np.where(terms.known & (intensity > 0.0) & (left > 0.0) & (terms.steep > 0.0), share, 0.0)


def steep_box(numbers: Mapping[str, float]) -> Box | None:
    """The box outside which errors of the kernel of `double` are at most MOST_ROUNDOFFS; None where there is no small
    one."""
    edges = steep_boxes({name: np.array([value]) for name, value in numbers.items()})[0]
    return None if np.isnan(edges[0]) else Box(*edges.tolist())


def boxes_drawn(numbers: Mapping[str, Floats]) -> Floats:
    """(scenes, 4): the boxes that another kernel draws at `double`, as `steep_boxes` has them; NaN where there is none,
    or none is needed."""
    edges = np.full((len(numbers["radius"]), 4), np.nan)
    with np.errstate(all="ignore"):  # numbers may be those of no scene
        beyond = np.flatnonzero(~(roundoffs(numbers) <= MOST_ROUNDOFFS))
        if beyond.size:
            edges[beyond] = steep_boxes({name: column[beyond] for name, column in numbers.items()})
    return edges


def steep_boxes(numbers: Mapping[str, Floats]) -> Floats:
    """(scenes, 4): left, right, bottom and top of the box of each scene, by columns of numbers; NaN where there is no
    small one.

    t exp(-t^2 / 2) is at most a part q of its largest value from t = 1 + sqrt(2 log(1 / q)) on, and t = sqrt(n) angle.
    """
    share, n = steep_share(numbers), numbers["shininess"]
    edges = np.full((len(n), 4), np.nan)
    boxed = np.flatnonzero((share > 0.0) & (n >= LEAST_SHININESS))
    logarithm = _each(math.log, share[boxed])
    angle = (1.0 + np.sqrt(-2.0 * logarithm)) / np.sqrt(n[boxed] - 1.0)
    boxed, angle = boxed[angle <= MOST_ANGLE], angle[angle <= MOST_ANGLE]
    if boxed.size:
        edges[boxed] = _boxes_around({name: column[boxed] for name, column in numbers.items()}, angle)
    return edges


def _boxes_around(numbers: Mapping[str, Floats], angle: Floats) -> Floats:
    """(scenes, 4): boxes that hold all points of a sphere whose mirrored ray passes the light by at most that angle;
    NaN where there is none.

    With the normal turned by b, in any direction, the ray mirrored there is 2 cos(a) sin(b) away from the one that
    meets a far light, on the unit sphere, or farther, a being the angle of incidence; a light or an eye that is near
    turns away, too. The cap of the sphere within b of the highlight's middle lies in a cylinder of radius sin(b)
    between two planes, and its picture in the hull of that of a prism around it.
    """
    radius, eye = numbers["radius"], numbers["eye"]
    center, to_light = (np.stack([numbers[f"{what}_{axis}"] for axis in "xyz"]) for what in ("center", "light"))
    to_light = to_light - center
    to_eye = np.stack([-center[0], -center[1], eye - center[2]]) / radius
    with np.errstate(all="ignore"):
        middle = _middles_of_highlights(to_light / np.maximum(radius, np.abs(to_light).max(axis=0) / FARTHEST), to_eye)
        facing = _dot(middle, _unit(to_eye - middle))
        sine = np.where(facing >= LEAST_FACING, ROOM * _each(math.sin, 0.5 * angle) / facing + AROUND_MIDDLE, np.inf)
        first = _unit(_cross(middle, np.eye(3)[:, np.argmin(np.abs(middle), axis=0)]))
        second = _cross(middle, first)
        ring = np.multiply.outer(_COSINES, first) + np.multiply.outer(_SINES, second)
        ring *= sine / math.cos(math.pi / CORNERS)
        prism = np.concatenate([ring + height * middle for height in (np.sqrt(1.0 - sine * sine), np.ones_like(sine))])
        x, y, z = (center + radius * prism).transpose(1, 0, 2)
        depth = eye - z
        x, y = x * eye / depth, y * eye / depth
        edges = left, right, bottom, top = x.min(axis=0), x.max(axis=0), y.min(axis=0), y.max(axis=0)
        small = (right - left) * (top - bottom) <= MOST_OF_PICTURE * _picture(to_eye, eye)
    known = (sine <= MOST_ANGLE) & (depth.min(axis=0) > 1e-3 * radius) & small
    return np.where(known[:, np.newaxis], np.stack(edges, axis=1), np.nan)


def _picture(to_eye: Floats, eye: Floats) -> Floats:
    """The area of the ellipse that a sphere is seen as, pi e^2 sqrt(d^2 - 1) / (z^2 - 1)^(3/2); inf for a sphere that
    reaches the plane of the eye. d is the distance of the eye from the centre in radii, z that along the axis."""
    beyond = np.maximum(to_eye[2] * to_eye[2] - 1.0, 0.0)
    area: Floats = math.pi * eye * eye * np.sqrt(_dot(to_eye, to_eye) - 1.0) / (beyond * np.sqrt(beyond))
    return area


def _middles_of_highlights(to_light: Floats, to_eye: Floats) -> Floats:
    """(3, scenes): the normals where a light's ray is mirrored to the eye; both are ways from the centre, in radii. NaN
    where none is found.

    The normal is turned to the one half way between the ways to light and eye, which turns that back by about half of
    1 / length of each way: so it is turned by as much less.
    """
    found = np.full_like(to_light, np.nan)
    left = np.flatnonzero((_dot(to_light, to_light) > 1.0) & (_dot(to_eye, to_eye) > 1.0))
    ends = np.stack([to_light, to_eye], axis=1)[..., left]
    middle = _unit(_unit(ends).sum(axis=1))
    for _ in range(100 if left.size else 0):
        ways = ends - middle[:, np.newaxis]
        inverse = 1.0 / np.sqrt(_dot(ways, ways))
        half = _unit((inverse * ways).sum(axis=1))
        turn = half - middle
        near = np.abs(turn).max(axis=0) < NEARLY_MIDDLE
        middle = _unit(middle + turn / (1.0 + 0.5 * inverse.sum(axis=0)))
        if near.any():
            found[:, left[near]] = half[:, near]
            left, ends, middle = left[~near], ends[..., ~near], middle[:, ~near]
            if not left.size:
                break
    return found


_COSINES, _SINES = (
    np.array([turn(k * (2.0 * math.pi / CORNERS)) for k in range(CORNERS)]) for turn in (math.cos, math.sin)
)


def _each(function: Callable[[float], float], values: Floats) -> Floats:
    """The function of each value: numpy's own may depend on where in an array a value stands."""
    return np.fromiter(map(function, values.tolist()), dtype=np.float64, count=len(values))


def _dot(a: Floats, b: Floats) -> Floats:
    x, y, z = a * b
    found: Floats = x + y + z
    return found


def _cross(a: Floats, b: Floats) -> Floats:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _unit(vector: Floats) -> Floats:
    """NaN for no direction."""
    return vector / np.sqrt(_dot(vector, vector))
