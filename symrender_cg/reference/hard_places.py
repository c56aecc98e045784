"""Points where an image is hard to get right: near the silhouette, the terminator and the middle of the highlight.

Comes in: a Scene with one sphere and one light, a count, a seed. Goes out: arrays of float64 points (x, y) on the plane
z = 0, a function of these three. Never done here: shading.

The places are found with 320-bit balls (python-flint, loaded only when they are looked for) and rounded once, so that
the offsets below are those of the float64 points and not of the way they were found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from symrender_cg.reference.camera_numbers import FrameNumbers, Vector, frame_numbers
from symrender_cg.reference.points import Points
from symrender_cg.scene import Scene

if TYPE_CHECKING:
    from flint import arb

BallVector: TypeAlias = "tuple[arb, arb, arb]"

SEARCH_BITS = 320
"""Precision of the search for hard places: 53 bits of the answer, 212 of e/R = 1e32 twice, and room."""


def near_silhouette(scene: Scene, count: int, seed: int) -> Points:
    """Points on both sides of disc = 0: a third the two nearest floats, a third within 6 ulp, a third 1e-15..1e-3 off.

    For a tangent direction of the cone of tangents one coordinate is rounded and disc = 0 is solved for the other (the
    one along which disc changes faster). The relative offsets are from the conic towards or away from the image of the
    centre. Two float64 arrays of `count` entries; empty where no tangent meets the image plane in front of the eye.
    """
    from flint import arb, ctx

    numbers = frame_numbers(scene)
    random = np.random.default_rng(seed)
    with ctx.workprec(SEARCH_BITS):
        e, r = arb(numbers.eye), arb(numbers.radius)
        m = _offset(numbers.center, (0.0, 0.0, numbers.eye))
        m2, r2 = _dot(m, m), r * r
        axis, p, q = _frame_around(m)
        sine = r / m2.sqrt()
        cosine = (1 - sine * sine).sqrt()

        def point(index: int) -> tuple[float, float] | None:
            d = _on_cone(axis, p, q, cosine, sine, random.uniform(0.0, 2.0 * math.pi))
            steps = int(random.integers(-6, 7)) if index % 3 else int(random.integers(-1, 1))
            offset = _log_uniform(random, -15.0, -3.0)
            if not d[2] < 0:
                return None
            x, y = float(-e * d[0] / d[2]), float(-e * d[1] / d[2])
            if index % 3 == 2:
                towards_x, towards_y = (-e * m[0] / m[2], -e * m[1] / m[2]) if m[2] < 0 else (arb(0), arb(0))
                return float(x + offset * (x - towards_x)), float(y + offset * (y - towards_y))
            disc_x = r2 * x - (m[2] * (m[2] * x + m[0] * e) - m[1] * (m[0] * y - m[1] * x))
            disc_y = r2 * y - (m[2] * (m[1] * e + m[2] * y) + m[0] * (m[0] * y - m[1] * x))
            if abs(disc_x).mid() >= abs(disc_y).mid():
                return _stepped(_root_nearest((m[0], m[1], m[2]), r2, e, x, y), steps, index % 3 == 0), y
            return x, _stepped(_root_nearest((m[1], m[0], m[2]), r2, e, y, x), steps, index % 3 == 0)

        return _collect(point, count)


def near_terminator(scene: Scene, count: int, seed: int) -> Points:
    """Points where n.l is about 0: a quarter the floats nearest to n.l = 0, the rest 1e-17 .. 1e-2 radians from it.

    n.l = 0 on the circle (P - C).(L - C) = R^2, where the cone of tangents from the light touches the sphere; its
    visible part is seen through the plane. Two float64 arrays of at most `count` entries; empty where none is visible.
    """
    from flint import arb, ctx

    numbers = frame_numbers(scene)
    random = np.random.default_rng(seed)
    with ctx.workprec(SEARCH_BITS):
        light = _offset(numbers.light, numbers.center)
        light2 = _dot(light, light)
        if not light2 > arb(numbers.radius) ** 2:
            return np.empty(0), np.empty(0)
        axis, p, q = _frame_around(light)
        cosine = numbers.radius / light2.sqrt()
        sine = (1 - cosine * cosine).sqrt()

        def point(index: int) -> tuple[float, float] | None:
            turn = random.uniform(0.0, 2.0 * math.pi)
            angle = _log_uniform(random, -17.0, -2.0) if index % 4 else 0.0
            ds, dc = arb(angle).sin_cos()
            normal = _on_cone(axis, p, q, cosine * dc - sine * ds, sine * dc + cosine * ds, turn)
            return _seen(numbers, normal)

        return _collect(point, count)


def near_highlight(scene: Scene, count: int, seed: int) -> Points:
    """Points about r.v = 1: a quarter within two floats of it, a quarter anywhere up to 3/sqrt(n) radians off (the turn
    of the normal), the rest 1e-17 .. 3/sqrt(n) off.

    The mirror point lies in the plane of eye, centre and light (Alhazen's problem); its angle from the eye is the zero
    of a monotone function, found by bisection. Two float64 arrays of at most `count` entries; empty where the mirror
    point is hidden (light inside or behind the sphere) or outside the half-space before the eye.
    """
    from flint import arb, ctx

    numbers = frame_numbers(scene)
    random = np.random.default_rng(seed)
    with ctx.workprec(SEARCH_BITS):
        mirror = _mirror_normal(numbers)
        if mirror is None or (seen := _seen(numbers, mirror)) is None:
            return np.empty(0), np.empty(0)
        axis, p, q = _frame_around(mirror)
        widest = math.log10(3.0) - 0.5 * math.log10(max(numbers.shininess, 9.0))

        def point(index: int) -> tuple[float, float] | None:
            turn = random.uniform(0.0, 2.0 * math.pi)
            steps = random.integers(-2, 3, size=2)
            angle = abs(_log_uniform(random, min(-17.0, widest - 3.0), widest))
            if index % 4 == 1:
                angle = 10.0**widest * random.uniform(0.0, 1.0)
            if index % 4 == 0:
                return _stepped(arb(seen[0]), int(steps[0]), False), _stepped(arb(seen[1]), int(steps[1]), False)
            ds, dc = arb(angle).sin_cos()
            return _seen(numbers, _on_cone(axis, p, q, dc, ds, turn))

        return _collect(point, count)


def _collect(point: Callable[[int], tuple[float, float] | None], count: int) -> Points:
    """The first `count` points that exist among 40 count + 200 trials."""
    found: list[tuple[float, float]] = []
    for _ in range(40 * count + 200):
        if len(found) == count:
            break
        candidate = point(len(found))
        if candidate is not None and all(map(math.isfinite, candidate)):
            found.append(candidate)
    pairs = np.array(found, dtype=np.float64).reshape(-1, 2)
    return pairs[:, 0].copy(), pairs[:, 1].copy()


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """+-10^u with u uniform in [low, high]."""
    magnitude = 10.0 ** random.uniform(low, high)
    return float(magnitude if random.integers(2) else -magnitude)


def _stepped(value: arb, steps: int, straddle: bool) -> float:
    """The float64 nearest to `value`, `steps` floats on; straddling: the last float not above it (-1), or the next."""
    nearest = float(value)
    if straddle:
        below = nearest if value >= nearest else math.nextafter(nearest, -math.inf)
        return below if steps < 0 else math.nextafter(below, math.inf)
    for _ in range(abs(steps)):
        nearest = math.nextafter(nearest, math.copysign(math.inf, steps))
    return nearest


def _root_nearest(m: BallVector, r2: arb, e: arb, x: float, y: float) -> arb:
    """The root of x -> disc(x, y) nearest to x; with y and x, m_y and m_x exchanged the root of y -> disc(x, y).

    disc = a x^2 + 2 b x + c; |m x D|^2 does not change its value when x and y change places together with m_x and m_y.
    """
    from flint import arb

    mx, my, mz = m
    exact_y = arb(y)
    a = r2 - mz * mz - my * my
    b = mx * (my * y - mz * e)
    c = (r2 - mx * mx) * (e * e + exact_y * exact_y) - (my * e + mz * y) ** 2
    root = (b * b - a * c).nonnegative_part().sqrt()
    larger = -b - root if b > 0 else -b + root
    candidates = [c / larger] if a.is_zero() else [larger / a, c / larger]
    distances = [float(abs(candidate - x)) if candidate.is_finite() else math.inf for candidate in candidates]
    return candidates[distances.index(min(distances))]


def _mirror_normal(numbers: FrameNumbers) -> BallVector | None:
    """n with r.v = 1: sin(eye, n) as seen from the point = sin(n, light); None when the light cannot be mirrored."""
    from flint import arb

    r = arb(numbers.radius)
    to_eye = _offset((0.0, 0.0, numbers.eye), numbers.center)
    to_light = _offset(numbers.light, numbers.center)
    eye2, light2 = _dot(to_eye, to_eye), _dot(to_light, to_light)
    if not light2 > r * r:
        return None
    eye_distance, light_distance = eye2.sqrt(), light2.sqrt()
    axis, _, _ = _frame_around(to_eye)
    across = _cross(_cross(to_eye, to_light), to_eye)
    across2 = _dot(across, across)
    if not across2 > 0:
        return axis if _dot(to_eye, to_light) > 0 else None
    length = across2.sqrt()
    p = (across[0] / length, across[1] / length, across[2] / length)
    whole = arb.atan2(_dot(p, to_light), _dot(axis, to_light))
    low, high = arb(0), whole.mid()
    for _ in range(SEARCH_BITS - 20):
        middle = ((low + high) / 2).mid()
        s, c = middle.sin_cos()
        ls, lc = (whole - middle).sin_cos()
        eye_part = eye_distance * s / (eye2 + r * r - 2 * r * eye_distance * c).sqrt()
        light_part = light_distance * ls / (light2 + r * r - 2 * r * light_distance * lc).sqrt()
        if light_part > eye_part:
            low = middle
        else:
            high = middle
    s, c = low.sin_cos()
    ls, lc = (whole - low).sin_cos()
    if not (eye_distance * c > r and light_distance * lc > r):
        return None
    return axis[0] * c + p[0] * s, axis[1] * c + p[1] * s, axis[2] * c + p[2] * s


def _seen(numbers: FrameNumbers, normal: BallVector) -> tuple[float, float] | None:
    """Where the surface point with this normal appears on the plane, rounded once; None when it is hidden."""
    from flint import arb

    r, e = arb(numbers.radius), arb(numbers.eye)
    x, y, z = (arb(center) + r * n for center, n in zip(numbers.center, normal, strict=True))
    outward = -x * normal[0] - y * normal[1] + (e - z) * normal[2]
    if not (outward > 0 and e > z):
        return None
    return float(e * x / (e - z)), float(e * y / (e - z))


def _on_cone(axis: BallVector, p: BallVector, q: BallVector, cosine: arb, sine: arb, turn: float) -> BallVector:
    """cosine axis + sine (cos(turn) p + sin(turn) q)."""
    along_p, along_q = sine * math.cos(turn), sine * math.sin(turn)
    scale = 1 / (cosine * cosine + along_p * along_p + along_q * along_q).sqrt()
    x, y, z = ((cosine * a + along_p * b + along_q * c) * scale for a, b, c in zip(axis, p, q, strict=True))
    return x, y, z


def _frame_around(v: BallVector) -> tuple[BallVector, BallVector, BallVector]:
    """Orthonormal (v/|v|, p, q)."""
    from flint import arb

    length = _dot(v, v).sqrt()
    axis = (v[0] / length, v[1] / length, v[2] / length)
    sizes = [abs(float(component)) for component in axis]
    unit = [arb(0), arb(0), arb(0)]
    unit[sizes.index(min(sizes))] = arb(1)
    p = _cross(axis, (unit[0], unit[1], unit[2]))
    length = _dot(p, p).sqrt()
    p = (p[0] / length, p[1] / length, p[2] / length)
    return axis, p, _cross(axis, p)


def _offset(a: Vector, b: Vector) -> BallVector:
    """a - b."""
    from flint import arb

    return arb(a[0]) - arb(b[0]), arb(a[1]) - arb(b[1]), arb(a[2]) - arb(b[2])


def _dot(a: BallVector, b: BallVector) -> arb:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: BallVector, b: BallVector) -> BallVector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
