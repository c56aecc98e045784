"""How far double's kernel of one sphere may be off, and the box of the image plane where its highlight is too steep.

Comes in: the numbers of a scene, as kernels take them. Goes out: bounds in roundoffs, 2^-53, of max(1, value), and a
`Box`: outside it the kernel keeps 1e-15, inside it another one draws. Never done here: a kernel, or an image.

An error of the mirrored ray's angle changes r.v^n by n sin(angle) r.v^(n - 1) times as much: by nothing in the middle
of the highlight, by sqrt(n / e) at 1 / sqrt(n) radians from it, and by nothing far from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
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

LEAST_FACING = 0.3
"""Cosine of the angle at which a mirrored ray meets the sphere: flatter ones draw a highlight out to the silhouette."""

FARTHEST = 1e60
"""A light farther away, in radii, shines in parallel."""

ROOM = 1.1
CORNERS = 24


@dataclass(frozen=True, slots=True)
class Box:
    """Points (x, y) of the image plane, in scene units: left <= x <= right, bottom <= y <= top."""

    left: float
    right: float
    bottom: float
    top: float

    def holds(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Which points lie in it."""
        return self.across(x) & self.down(y)

    def across(self, x: Floats) -> NDArray[np.bool_]:
        """Which columns cross it."""
        return np.asarray((x >= self.left) & (x <= self.right), dtype=np.bool_)

    def down(self, y: Floats) -> NDArray[np.bool_]:
        """Which rows do."""
        return np.asarray((y >= self.bottom) & (y <= self.top), dtype=np.bool_)


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


def steep_share(numbers: Mapping[str, float]) -> float:
    """The part of the highlight's greatest steepness, sqrt(n / e), that leaves errors at MOST_ROUNDOFFS; at most 1, and
    0 where it is not the highlight alone that is in the way."""
    terms, intensity = _terms(numbers), numbers["light_intensity"]
    if not terms.known or intensity <= 0.0:
        return 0.0
    left = ((MOST_ROUNDOFFS - 1.0) / intensity) ** 2 - float(terms.diffuse) ** 2
    if left <= 0.0 or terms.steep <= 0.0:
        return 0.0
    return min(1.0, max(0.0, (math.sqrt(left) - float(terms.flat)) / float(terms.steep)))


def steep_box(numbers: Mapping[str, float]) -> Box | None:
    """The box outside which errors of the kernel of `double` are at most MOST_ROUNDOFFS; None where there is no small
    one.

    t exp(-t^2 / 2) is at most a part q of its largest value from t = 1 + sqrt(2 log(1 / q)) on, and t = sqrt(n) angle.
    """
    share, n = steep_share(numbers), numbers["shininess"]
    if share <= 0.0 or n < LEAST_SHININESS:
        return None
    angle = (1.0 + math.sqrt(-2.0 * math.log(share))) / math.sqrt(n - 1.0)
    return None if angle > MOST_ANGLE else _box_around(numbers, angle)


def _box_around(numbers: Mapping[str, float], angle: float) -> Box | None:
    """A box that holds all points of the sphere whose mirrored ray passes the light by at most that angle.

    With the normal turned by b, in any direction, the ray mirrored there is 2 cos(a) sin(b) away from the one that
    meets a far light, on the unit sphere, or farther, a being the angle of incidence; a light or an eye that is near
    turns away, too. The cap of the sphere within b of the highlight's middle lies in a cylinder of radius sin(b)
    between two planes, and its picture in the hull of that of a prism around it.
    """
    radius = numbers["radius"]
    center = np.array([numbers[f"center_{axis}"] for axis in "xyz"])
    to_light = np.array([numbers[f"light_{axis}"] for axis in "xyz"]) - center
    to_light /= max(radius, float(np.abs(to_light).max()) / FARTHEST)
    eye = np.array([0.0, 0.0, numbers["eye"]])
    to_eye = (eye - center) / radius
    middle = _middle_of_highlight(to_light, to_eye)
    if middle is None:
        return None
    facing = float(middle @ _unit(to_eye - middle))
    sine = ROOM * math.sin(0.5 * angle) / facing if facing >= LEAST_FACING else 1.0
    if sine > MOST_ANGLE:
        return None
    first = _unit(np.cross(middle, np.eye(3)[int(np.argmin(np.abs(middle)))]))
    second = np.cross(middle, first)
    turns = np.arange(CORNERS) * (2.0 * math.pi / CORNERS)
    ring = np.outer(np.cos(turns), first) + np.outer(np.sin(turns), second)
    ring *= sine / math.cos(math.pi / CORNERS)
    corners = center + radius * np.concatenate(
        [ring + height * middle for height in (math.sqrt(1.0 - sine * sine), 1.0)]
    )
    depth = eye[2] - corners[:, 2]
    if depth.min() <= 1e-3 * radius:
        return None
    x, y = corners[:, 0] * eye[2] / depth, corners[:, 1] * eye[2] / depth
    return Box(float(x.min()), float(x.max()), float(y.min()), float(y.max()))


def _middle_of_highlight(to_light: Floats, to_eye: Floats) -> Floats | None:
    """The normal where the light's ray is mirrored to the eye; both are ways from the centre, in radii. None where it
    is not found."""
    if to_light @ to_light <= 1.0 or to_eye @ to_eye <= 1.0:
        return None
    middle = _unit(_unit(to_light) + _unit(to_eye))
    for _ in range(100):
        half = _unit(_unit(to_light - middle) + _unit(to_eye - middle))
        if float(np.abs(half - middle).max()) < 1e-9:
            return half
        middle = _unit(middle + 0.6 * (half - middle))
    return None


def _unit(vector: Floats) -> Floats:
    length = math.sqrt(float(vector @ vector))
    return vector / length if length > 0.0 else vector
