"""The numbers of a scene in its camera's frame, and points on its image plane: pixel centres and hard places.

Comes in: a Scene with one sphere and one light. Goes out: its camera-frame numbers, exact decisions on the silhouette's
conic, and arrays of float64 points (x, y) on the plane z = 0. Every point set is a function of scene, count and seed.
Never done here: shading.

The hard places are found with 320-bit balls (python-flint, loaded only by them) and rounded once, so that the offsets
below are those of the float64 points and not of the way they were found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import ArgumentError, OutsidePlanError
from symrender_cg.scene import Colour, Gradient, PointLight, Scene

if TYPE_CHECKING:
    from flint import arb

FloatArray: TypeAlias = npt.NDArray[np.float64]
Vector: TypeAlias = tuple[float, float, float]
Points: TypeAlias = tuple[FloatArray, FloatArray]
BallVector: TypeAlias = "tuple[arb, arb, arb]"

SEARCH_BITS = 320
"""Precision of the search for hard places: 53 bits of the answer, 212 of e/R = 1e32 twice, and room."""


@dataclass(frozen=True, slots=True)
class FrameNumbers:
    """One sphere and one light in the camera's frame; eye at (0, 0, eye), lengths in scene units."""

    eye: float
    half_height: float
    center: Vector
    radius: float
    light: Vector
    intensity: float
    ambient: float
    diffuse: float
    specular: float
    shininess: float
    gate_specular: bool
    background: float


def frame_numbers(scene: Scene) -> FrameNumbers:
    """The float64 numbers of `scene` in its camera's frame: exact from there on.

    Raises OutsidePlanError unless the scene is grey and has exactly one sphere and one point light.
    """
    for kind, members in (("spheres", scene.spheres), ("lights", scene.lights)):
        if len(members) != 1:
            raise OutsidePlanError(
                f"{kind}: {len(members)} of them; the references of one sphere take exactly one; "
                "compare scenes of one sphere and one light with them"
            )
    framed = scene.in_camera_frame()
    sphere, light = framed.spheres[0], framed.lights[0]
    material = sphere.material
    if not isinstance(light, PointLight):
        raise OutsidePlanError(f"lights[0]: a {type(light).__name__}; this reference takes one PointLight")
    half_height = framed.camera.half_height
    assert half_height is not None, "a scene in the camera's frame has a half_height"
    return FrameNumbers(
        eye=framed.camera.eye[2],
        half_height=half_height,
        center=sphere.center,
        radius=sphere.radius,
        light=light.position,
        intensity=_grey("lights[0].intensity", light.intensity),
        ambient=_grey("spheres[0].material.ambient", material.ambient),
        diffuse=_grey("spheres[0].material.diffuse", material.diffuse),
        specular=_grey("spheres[0].material.specular", material.specular),
        shininess=material.shininess,
        gate_specular=material.gate_specular,
        background=_grey("background", framed.background),
    )


def _grey(place: str, value: Colour | Gradient) -> float:
    if not isinstance(value, float):
        raise OutsidePlanError(f"{place}: {value} is not one number; this reference takes grey scenes")
    return value


def as_points(x: npt.ArrayLike, y: npt.ArrayLike) -> Points:
    """x and y as float64 arrays that broadcast against each other. Raises ArgumentError where they are no points."""
    columns: npt.NDArray[Any] = np.asarray(x)
    rows: npt.NDArray[Any] = np.asarray(y)
    for name, values in (("x", columns), ("y", rows)):
        if values.dtype.kind not in "fiu":
            raise ArgumentError(f"{name}: dtype {values.dtype}; expected real numbers; pass an array of float64")
        if not np.isfinite(values).all():
            raise ArgumentError(f"{name}: holds NaN or infinity; expected finite coordinates on the image plane")
    try:
        np.broadcast_shapes(columns.shape, rows.shape)
    except ValueError:
        raise ArgumentError(
            f"x and y: shapes {columns.shape} and {rows.shape} do not broadcast; expected one y for each x; reshape one"
        ) from None
    return columns.astype(np.float64, copy=False), rows.astype(np.float64, copy=False)


def pixel_centres(scene: Scene, width: int, height: int) -> Points:
    """x_i = (i + 1/2 - width/2) p and y_j = (height/2 - j - 1/2) p with p = 2 half_height / height.

    Shapes (width,) and (height,); row 0 at the top. The brackets are exact, so the centres mirror exactly.
    Raises ArgumentError for an image without pixels.
    """
    for name, size in (("width", width), ("height", height)):
        if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
            raise ArgumentError(f"{name}: {size!r}; expected a whole number of pixels, at least 1")
    step = 2.0 * frame_numbers(scene).half_height / height
    columns = np.arange(width, dtype=np.float64) + (0.5 - width / 2.0)
    rows = (height / 2.0 - 0.5) - np.arange(height, dtype=np.float64)
    return columns * step, rows * step


def whole_image(scene: Scene, width: int, height: int) -> Points:
    """All pixel centres, row by row: two float64 arrays of width * height entries."""
    columns, rows = pixel_centres(scene, width, height)
    return np.tile(columns, height), np.repeat(rows, width)


def exact_hit_test(numbers: FrameNumbers) -> Callable[[float, float], bool]:
    """A function (x, y) -> disc >= 0 and m.D > 0, exact: R^2 |D|^2 - |m x D|^2 in whole numbers.

    D and the scene's lengths are put on two grids of powers of two; neither scale changes a sign.
    """
    cx, cy, cz, e, r = whole_numbers((*numbers.center, numbers.eye, numbers.radius))
    mx, my, mz, r2 = cx, cy, cz - e, r * r
    eye = numbers.eye

    def hit(x: float, y: float) -> bool:
        dx, dy, dz = whole_numbers((x, y, -eye))
        a, b, c = my * dz - mz * dy, mz * dx - mx * dz, mx * dy - my * dx
        disc = r2 * (dx * dx + dy * dy + dz * dz) - (a * a + b * b + c * c)
        return disc >= 0 and mx * dx + my * dy + mz * dz > 0

    return hit


def exact_lit_test(numbers: FrameNumbers) -> Callable[[float, float, float], bool]:
    """A function of D, (x, y, -e) times any positive number -> n.l > 0 where that ray hits, exact.

    n.l has the sign of u - g q with q = sqrt(disc), g = l.D, u = (m.D) g - A (l.m + R^2), l = L - C: whole numbers and
    one square root, decided by the signs of u and g, else by u^2 - g^2 disc.
    """
    cx, cy, cz, e, r, *light = whole_numbers((*numbers.center, numbers.eye, numbers.radius, *numbers.light))
    mx, my, mz, r2 = cx, cy, cz - e, r * r
    lx, ly, lz = light[0] - cx, light[1] - cy, light[2] - cz
    m2, kappa = mx * mx + my * my + mz * mz, lx * mx + ly * my + lz * mz + r2

    def lit(x: float, y: float, z: float) -> bool:
        dx, dy, dz = whole_numbers((x, y, z))
        a_dd, m_dot_d, g = dx * dx + dy * dy + dz * dz, mx * dx + my * dy + mz * dz, lx * dx + ly * dy + lz * dz
        u, disc = m_dot_d * g - a_dd * kappa, m_dot_d * m_dot_d - a_dd * (m2 - r2)
        if g > 0:
            return u > 0 and u * u > g * g * disc
        if u < 0:
            return g * g * disc > u * u
        return u > 0 or (g < 0 < disc)

    return lit


def whole_numbers(values: tuple[float, ...]) -> tuple[int, ...]:
    """The values times the smallest power of two that makes all of them whole."""
    ratios = [value.as_integer_ratio() for value in values]
    unit = max(denominator for _, denominator in ratios)
    return tuple(numerator * (unit // denominator) for numerator, denominator in ratios)


# ---------------------------------------------------------------------------------------------------- hard places


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
