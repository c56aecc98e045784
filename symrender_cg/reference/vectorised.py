"""The image by numpy: the seed's Cell 4 as it stands, and the cancellation-free forms with exact hit and miss.

Comes in: a Scene with one sphere and one light, points or an image size. Goes out: float64 or float32 intensities. The
stable form is the backend that needs no compiler. Never done here: symbols, compiled code, balls.

The stable form, with m = C - E, D = (x, y, -e), A = |D|^2:
    c = m x D = m x (D - D_0), D_0 the ray to the centre: c keeps its relative accuracy
    disc = R^2 A - |c|^2                     Lagrange's identity; in double-double where disc < R^2 A / 16
    N = (c x D - sqrt(disc) D) / (R A)       from the ray's foot point, the point of the ray nearest the centre
    n.l = N.w / |w|                          w = L - C - R N
    r.v = (2 (N.w) n.v + w.D / sqrt(A)) / |w|,  n.v = sqrt(disc) / (R sqrt(A))
    (r.v)^n = (1 - |w x v'|^2 / |w|^2)^(n/2) where r.v > 0.9,  v' = 2 (n.v) N + D / sqrt(A)
The sign of disc: float64, where it exceeds `_View.doubt` A; then double-double, where it exceeds `_View.deep_doubt` A;
then whole numbers. Lengths are scaled by powers of two: D so that e is in [1, 2), the sphere so that R is (short of
|m|/R = 2^900), the light by its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.errors import ArgumentError
from symrender_cg.reference.points import (
    FloatArray,
    FrameNumbers,
    as_points,
    exact_hit_test,
    exact_lit_test,
    frame_numbers,
    pixel_centres,
)
from symrender_cg.scene import Scene

Form: TypeAlias = Literal["literal", "stable"]
Floats: TypeAlias = npt.NDArray[Any]
"""float64, or float32 where the caller asked for it"""
Triple: TypeAlias = tuple[Floats, Floats, Floats]
Pair: TypeAlias = tuple[Floats, Floats]
Indices: TypeAlias = npt.NDArray[np.intp]

UNIT_ROUNDOFF: Final = 2.0**-53
CHUNK: Final = 16384
"""Points a block: the arrays of one block stay in the cache."""
LOW: Final = 1.0 / 16.0
"""disc / (R^2 A) = (n.v)^2 below which disc is computed in double-double."""
STEEP: Final = 2.0**60
"""max(|x|, |y|) / e above which D is scaled point by point."""


def render_vectorised(
    scene: Scene,
    width: int,
    height: int,
    *,
    form: Form = "stable",
    clip: bool = True,
    dtype: npt.DTypeLike = np.float64,
) -> Floats:
    """The image, (height, width) of `dtype`, row 0 at the top; clipped to [0, 1] unless clip=False."""
    columns, rows = pixel_centres(scene, width, height)
    image = evaluate_vectorised(scene, columns[np.newaxis, :], rows[:, np.newaxis], form=form, dtype=dtype)
    return np.clip(image, 0.0, 1.0, out=image) if clip else image


def evaluate_vectorised(
    scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike, *, form: Form = "stable", dtype: npt.DTypeLike = np.float64
) -> Floats:
    """The unclipped intensity at points (x, y) of the image plane, of `dtype`, in the broadcast shape.

    form "literal": Symbolic Rendering, Chapter 1, Cell 4 (render_numeric_vec), off the axis disc = (m.D)^2 - A (|m|^2 -
    R^2); all operations in `dtype`, with all that the formula does in hard cases. form "stable": see the module; hit or
    miss is exact in both dtypes, there is no warning and no overflow; float32 shades in float32.
    Raises ArgumentError for another form or dtype, or for points that are NaN or infinite.
    """
    numeric: np.dtype[Any] = np.dtype(dtype)
    if numeric not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise ArgumentError(f"dtype: {numeric}; expected float64 or float32")
    if form not in ("literal", "stable"):
        raise ArgumentError(f"form: {form!r}; expected 'literal' or 'stable'")
    numbers = frame_numbers(scene)
    columns, rows = as_points(x, y)
    if form == "literal":
        with np.errstate(all="ignore"):
            return _literal(numbers, columns.astype(numeric, copy=False), rows.astype(numeric, copy=False))
    return _stable(numbers, columns, rows, numeric)


# -------------------------------------------------------------------------------------------------------- literal


def _literal(numbers: FrameNumbers, X: Floats, Y: Floats) -> Floats:
    """Cell 4: masks instead of branches, the formula as it stands, every operation in the dtype of X."""
    number = X.dtype.type
    R, e = number(numbers.radius), number(numbers.eye)
    Cx, Cy, Cz = (number(v) for v in numbers.center)
    Lx, Ly, Lz = (number(v) for v in numbers.light)
    ka, n = number(numbers.ambient), number(numbers.shininess)
    kd, ks = number(numbers.intensity * numbers.diffuse), number(numbers.intensity * numbers.specular)
    A = X**2 + Y**2 + e**2
    if numbers.center == (0.0, 0.0, 0.0):
        b = -(e**2)
        disc = e**2 * R**2 - (e**2 - R**2) * (X**2 + Y**2)
    else:
        b = -Cx * X - Cy * Y - (e - Cz) * e
        c = Cx**2 + Cy**2 + (e - Cz) ** 2 - R**2
        disc = b**2 - A * c
    hit = (disc >= 0) & (b < 0)
    sq = np.sqrt(np.maximum(disc, 0))
    t = (-b - sq) / A
    Px, Py, Pz = t * X, t * Y, e * (1 - t)
    Nx, Ny, Nz = (Px - Cx) / R, (Py - Cy) / R, (Pz - Cz) / R
    wx, wy, wz = Lx - Px, Ly - Py, Lz - Pz
    wn = np.sqrt(wx**2 + wy**2 + wz**2)
    ndl = (Nx * wx + Ny * wy + Nz * wz) / wn
    va = np.sqrt(A)
    vx, vy, vz = -X / va, -Y / va, e / va
    rdv = 2 * ndl * (Nx * vx + Ny * vy + Nz * vz) - (wx * vx + wy * vy + wz * vz) / wn
    specular = ks * np.maximum(0, rdv) ** n
    if numbers.gate_specular:
        specular = np.where(ndl > 0, specular, number(0.0))
    value = np.where(wn > 0, ka + kd * np.maximum(0, ndl) + specular, ka)
    image: Floats = np.where(hit, value, number(numbers.background))
    return image


# --------------------------------------------------------------------------------------------------------- stable


@dataclass(frozen=True, slots=True)
class _View:
    """What does not change within a frame, scaled by powers of two, each number rounded once."""

    ray_shift: int
    """x, y and e are taken times 2^ray_shift"""
    eye: float
    m: tuple[float, float, float]
    m_z_rest: float
    """m_z = m[2] + m_z_rest, exact"""
    r: float
    r2: tuple[float, float]
    """R^2 = r2[0] + r2[1] to 2^-106"""
    toward: tuple[float, float, float, float] | None
    """x_0 + its rest, y_0 + its rest: the ray to the centre meets the plane there; None for a centre beside the eye"""
    doubt: float
    """a float64 disc above doubt * A in size has the right sign"""
    deep_doubt: float
    light: tuple[float, float, float]
    r_light: float
    """R in the light's scale"""
    on_axis: bool
    """the centre lies on the view axis, so m.D > 0 for every D"""
    normal_doubt: float
    """N of float64 is good to normal_doubt u"""
    numbers: FrameNumbers
    hit: Callable[[float, float], bool]
    lit: Callable[[float, float, float], bool]


def _view(numbers: FrameNumbers) -> _View:
    """The frame's constants, from exact fractions.

    With kappa = 16 (1 + tan) for a centre at the angle atan(tan) from the view axis, c is computed with an error
    |dc| <= u kappa (|c| + u |m||D|) and disc with at most 2 u (40 + 8 kappa) (R + u kappa |m|)^2 A where |c| <= 2 R |D|
    (beyond, its sign is not in doubt). Where tan exceeds |m|/R, c is better as the plain cross product (`toward` None):
    |dc| <= 5 u |m||D|, and 64 u |m| max(R, 64 u |m|) A bounds the error of disc. The double-double disc is good to
    1024 u^2 |m| max(R, 1024 u^2 |m|) A.
    """
    u = UNIT_ROUNDOFF
    eye = Fraction(numbers.eye)
    center = [Fraction(v) for v in numbers.center]
    m = [center[0], center[1], center[2] - eye]
    radius = Fraction(numbers.radius)
    ray_shift = 1 - math.frexp(numbers.eye)[1]
    ratio = max(_exponent(max(map(abs, m))) - _exponent(radius), 0)
    shrunk = max(ratio - 900, 0)
    scale = _power_of_two(-_exponent(radius) - shrunk)
    scaled = [v * scale for v in m]
    r = radius * scale
    m_z = float(scaled[2])
    length = float(sum(abs(v) for v in scaled))
    beside = abs(m[2]) * round(min(max(8.0, length / float(r)), 2.0**30)) < abs(m[0]) + abs(m[1])
    toward = None
    if not beside:
        x_0, y_0 = (-eye * _power_of_two(ray_shift) * v / m[2] for v in m[:2])
        toward = (*_pair(x_0), *_pair(y_0))
        kappa = 16.0 * (1.0 + float((abs(m[0]) + abs(m[1])) / abs(m[2])))
        reach = float(r) + u * kappa * length
        doubt = 2.0 * u * (40.0 + 8.0 * kappa) * reach * reach
    else:
        doubt = 64.0 * u * length * max(float(r), 64.0 * u * length)
        kappa = 16.0 * (1.0 + length / float(r))
    light = [Fraction(v) - c for v, c in zip(numbers.light, center, strict=True)]
    light_scale = _power_of_two(-_exponent(max(radius, *map(abs, light))))
    return _View(
        ray_shift=ray_shift,
        eye=float(eye * _power_of_two(ray_shift)),
        m=(float(scaled[0]), float(scaled[1]), m_z),
        m_z_rest=float(scaled[2] - Fraction(m_z)),
        r=float(r),
        r2=_pair(r * r),
        toward=toward,
        doubt=doubt,
        deep_doubt=1024.0 * u * u * length * max(float(r), 1024.0 * u * u * length),
        light=(float(light[0] * light_scale), float(light[1] * light_scale), float(light[2] * light_scale)),
        r_light=float(radius * light_scale),
        on_axis=numbers.center[0] == 0.0 and numbers.center[1] == 0.0 and m[2] < 0,
        numbers=numbers,
        normal_doubt=128.0 * kappa,
        hit=exact_hit_test(numbers),
        lit=exact_lit_test(numbers),
    )


def _exponent(value: Fraction) -> int:
    """k with value / 2^k in (1/2, 2)."""
    return value.numerator.bit_length() - value.denominator.bit_length()


def _power_of_two(exponent: int) -> Fraction:
    return Fraction(1 << exponent) if exponent >= 0 else Fraction(1, 1 << -exponent)


def _pair(value: Fraction) -> tuple[float, float]:
    """value as hi + lo."""
    high = float(value)
    return high, float(value - Fraction(high))


def _stable(numbers: FrameNumbers, x: FloatArray, y: FloatArray, dtype: np.dtype[Any]) -> Floats:
    """Tiles that stay in the cache, then all points near the edge of the sphere together."""
    view = _view(numbers)
    shape = np.broadcast_shapes(x.shape, y.shape)
    image: Floats = np.full(shape, numbers.background, dtype=dtype)
    if image.size == 0:
        return image
    if len(shape) == 2 and x.shape == (1, shape[1]) and y.shape == (shape[0], 1):
        grid = image
    else:
        grid = image.reshape(1, -1)
        x, y = (np.reshape(values, (1, -1)) for values in np.broadcast_arrays(x, y))
    height, width = grid.shape
    step = max(1, CHUNK // width)
    edges: list[tuple[Indices, Indices]] = []
    with np.errstate(over="ignore", under="ignore", invalid="ignore", divide="ignore"):
        for row in range(0, height, step):
            for column in range(0, width, CHUNK):
                tile = np.s_[row : row + step, column : column + CHUNK]
                near = _shade_inside(view, _cut(x, tile), _cut(y, tile), grid[tile])
                if near[0].size:
                    edges.append((near[0] + row, near[1] + column))
        if edges:
            rows, columns = (np.concatenate(part) for part in zip(*edges, strict=True))
            for first in range(0, rows.size, CHUNK):
                places = rows[first : first + CHUNK], columns[first : first + CHUNK]
                _shade_edge(view, _at(x, places), _at(y, places), grid, places)
    return image


def _shade_inside(view: _View, x: FloatArray, y: FloatArray, image: Floats) -> tuple[Indices, ...]:
    """Shades what plain float64 is sure to hit and has n.v > 1/4; returns the points of the tile left to `_shade_edge`.

    Works on the smallest rectangle of the tile that holds those hits; the others in it are shaded in vain and masked.
    Rows and columns of a grid stay one-dimensional as long as a quantity depends on one of them.
    """
    d = _rays(view, x, y)
    c = _cross(view, d)
    a_dd = d[0] * d[0] + d[2] * d[2] + d[1] * d[1]
    disc = view.r2[0] * a_dd - c[0] * c[0]
    disc -= c[1] * c[1]
    if not view.on_axis:
        disc -= c[2] * c[2]
    possible = disc >= a_dd * -view.doubt
    if not possible.any():
        return np.nonzero(possible)
    hit = disc > a_dd * max(view.r2[0] * LOW, view.doubt)
    if not _all_before_eye(view, d):
        before, slack = _before_eye(view, d)
        possible &= before >= -slack
        hit &= before > slack
    possible &= ~hit
    columns = np.flatnonzero(hit.any(axis=0))
    if columns.size:
        rows = np.flatnonzero(hit.any(axis=1))
        window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        d = (_cut(d[0], window), _cut(d[1], window), _cut(d[2], window))
        c = (_cut(c[0], window), _cut(c[1], window), _cut(c[2], window))
        value = _shade_in_dtype(view, d, c, a_dd[window], np.maximum(disc[window], 0.0), image.dtype)
        np.copyto(image[window], value, where=hit[window])
    return np.nonzero(possible)


def _shade_edge(view: _View, x: FloatArray, y: FloatArray, grid: Floats, places: tuple[Indices, Indices]) -> None:
    """Shades points near the edge, on either side: disc in double-double, each hit decided exactly."""
    x, y = x[np.newaxis, :], y[np.newaxis, :]
    d = _rays(view, x, y)
    a_dd = d[0] * d[0] + d[2] * d[2] + d[1] * d[1]
    disc = _deep_disc(view, d)
    hit = disc >= 0.0
    doubtful = np.abs(disc) <= view.deep_doubt * a_dd
    if not view.on_axis:
        before, slack = _before_eye(view, d)
        hit &= before > 0.0
        doubtful |= np.abs(before) <= slack
    for index in np.flatnonzero(doubtful):
        hit[0, index] = view.hit(float(x[0, index]), float(y[0, index]))
    value = _shade_in_dtype(view, d, _cross(view, d), a_dd, np.maximum(disc, 0.0), grid.dtype)
    rows, columns = places
    grid[rows[hit[0]], columns[hit[0]]] = value[hit]


def _shade_in_dtype(view: _View, d: Triple, c: Triple, a_dd: Floats, disc: FloatArray, dtype: np.dtype[Any]) -> Floats:
    """`_shade` with c and sqrt(disc) over R, everything rounded to `dtype` first; disc >= 0 is used up."""
    root = np.sqrt(disc, out=disc)
    if view.r != 1.0:
        inverse = 1.0 / view.r
        root *= inverse
        c = (c[0] * inverse, c[1] * inverse, c[2] * inverse)
    if dtype == root.dtype:
        return _shade(view, d, d, c, a_dd, root)
    rounded = (d[0].astype(dtype), d[1].astype(dtype), d[2].astype(dtype))
    c = (c[0].astype(dtype), c[1].astype(dtype), c[2].astype(dtype))
    return _shade(view, d, rounded, c, a_dd.astype(dtype), root.astype(dtype))


def _cut(values: Floats, window: tuple[slice, slice]) -> Floats:
    """values[window], where an axis of length 1 stands for all."""
    rows, columns = (part if size > 1 else slice(None) for part, size in zip(window, values.shape, strict=True))
    return values[rows, columns]


def _at(values: Floats, places: tuple[Indices, ...]) -> Floats:
    """values[places], where an axis of length 1 stands for all."""
    rows, columns = (part if size > 1 else 0 for part, size in zip(places, values.shape, strict=True))
    picked: Floats = np.broadcast_to(values[rows, columns], places[0].shape)
    return picked


def _before_eye(view: _View, d: Triple) -> Pair:
    """m.D, and a bound of its error."""
    (mx, my, mz), (dx, dy, dz) = view.m, d
    size = np.abs(dx) + np.abs(dy) + np.abs(dz)
    return mx * dx + my * dy + mz * dz, 16.0 * UNIT_ROUNDOFF * (abs(mx) + abs(my) + abs(mz)) * size


def _all_before_eye(view: _View, d: Triple) -> bool:
    """Whether m.D > 0 on the whole tile: always on the axis, else by the tile's largest |x| and |y|."""
    if view.on_axis:
        return True
    (mx, my, mz), (dx, dy, dz) = view.m, d
    aside = abs(mx) * np.abs(dx).max() + abs(my) * np.abs(dy).max()
    return bool((mz * dz).min() > 1.001 * aside)


def _rays(view: _View, x: FloatArray, y: FloatArray) -> Triple:
    """D = (x, y, -e) times a power of two, the same for all points unless one is beyond STEEP."""
    dx, dy = np.ldexp(x, view.ray_shift), np.ldexp(y, view.ray_shift)
    dz = np.full((1, 1), -view.eye)
    if max(np.abs(dx).max(), np.abs(dy).max()) <= STEEP:
        return dx, dy, dz
    shift = -np.maximum(np.frexp(np.maximum(np.abs(x), np.abs(y)))[1], math.frexp(view.numbers.eye)[1])
    return np.ldexp(x, shift), np.ldexp(y, shift), np.ldexp(np.full(shift.shape, -view.numbers.eye), shift)


def _cross(view: _View, d: Triple) -> Triple:
    """c = m x D; from D - D_0, whose z is 0, where the centre is not beside the eye."""
    (mx, my, mz), (dx, dy, dz) = view.m, d
    if view.toward is None:
        return my * dz - mz * dy, mz * dx - mx * dz, mx * dy - my * dx
    if view.on_axis:
        return -mz * dy, mz * dx, np.zeros((1, 1))
    x_0, x_rest, y_0, y_rest = view.toward
    scale = dz / -view.eye
    dx = (dx - x_0 * scale) - x_rest * scale
    dy = (dy - y_0 * scale) - y_rest * scale
    return -mz * dy, mz * dx, mx * dy - my * dx


def _shade(view: _View, rays: Triple, d: Triple, c: Triple, a_dd: Floats, root: Floats) -> Floats:
    """k_a + intensity (k_d max(0, n.l) + k_s max(0, r.v)^n) of rays that hit; c and root = sqrt(disc) over R.

    All arrays but rays (D in float64, for exact decisions) have one dtype; root is used up.
    """
    numbers = view.numbers
    (dx, dy, dz), (cx, cy, cz) = d, c
    inverse_d = np.sqrt(a_dd)
    np.divide(1.0, inverse_d, out=inverse_d)
    inverse_a = inverse_d * inverse_d
    if view.on_axis:
        normal = (cy * dz - root * dx, -cx * dz - root * dy, cx * dy - cy * dx - root * dz)
    else:
        normal = (cy * dz - cz * dy - root * dx, cz * dx - cx * dz - root * dy, cx * dy - cy * dx - root * dz)
    w = []
    for component, light in zip(normal, view.light, strict=True):
        component *= inverse_a
        part = component * -view.r_light
        part += light
        w.append(part)
    w_w = _dot(w, w)
    n_w = _dot(normal, w)
    w_d = _dot(w, d)
    inverse_w = np.sqrt(w_w)
    at_light = not inverse_w.all()
    np.divide(1.0, inverse_w, out=inverse_w)
    n_v = np.multiply(root, inverse_d, out=root)
    w_d *= inverse_d
    r_dot_v = n_w * n_v
    r_dot_v *= 2.0
    r_dot_v += w_d
    r_dot_v *= inverse_w
    n_dot_l = np.multiply(n_w, inverse_w, out=n_w)

    power = _highlight(view, r_dot_v, w_w, normal, (w[0], w[1], w[2]), n_v, inverse_d, d)
    power *= numbers.intensity * numbers.specular
    if numbers.gate_specular:
        power *= _lit(view, rays, n_dot_l, inverse_w)
    value = np.maximum(n_dot_l, 0.0, out=n_dot_l)
    value *= numbers.intensity * numbers.diffuse
    value += power
    if at_light:
        value[w_w == 0.0] = 0.0
    value += numbers.ambient
    return value


def _lit(view: _View, rays: Triple, n_dot_l: Floats, inverse_w: Floats) -> npt.NDArray[np.bool_]:
    """n.l > 0, exact for rays that hit: whole numbers decide where |n.l| is within its error, some u (1 + R/|w|)."""
    u = float(np.finfo(n_dot_l.dtype).eps)
    bound = (64.0 * u + view.normal_doubt * UNIT_ROUNDOFF) * (1.0 + view.r_light * inverse_w)
    lit: npt.NDArray[np.bool_] = n_dot_l > 0.0
    doubtful = np.nonzero(~(np.abs(n_dot_l) > bound))
    for row, column, *ray in zip(*doubtful, *(_at(part, doubtful).tolist() for part in rays), strict=True):
        lit[row, column] = view.lit(*ray)
    return lit


def _highlight(
    view: _View, base: Floats, w_w: Floats, normal: Triple, w: Triple, n_v: Floats, inverse_d: Floats, d: Triple
) -> Floats:
    """max(0, base)^n; where base > 0.9 from sin^2 = |w x v'|^2 / |w|^2, so that the error grows with sqrt(n), not n."""
    shininess = view.numbers.shininess
    if shininess == 0.0:
        return np.ones_like(base)
    near = np.nonzero(base > 0.9)
    dark = base <= 0.0
    power = base
    power[dark] = 1.0  # numpy's power is slow at 0
    power **= shininess
    power[dark] = 0.0
    if near[0].size:
        twice, inverse = 2.0 * n_v[near], inverse_d[near]
        mirrored = [
            twice * n[near] + inverse * np.broadcast_to(part, base.shape)[near]
            for n, part in zip(normal, d, strict=True)
        ]
        sine = _plain_cross([part[near] for part in w], mirrored)
        exponent = _dot(sine, sine)
        exponent /= w_w[near]
        np.minimum(exponent, 0.5, out=exponent)
        np.log1p(np.negative(exponent, out=exponent), out=exponent)
        power[near] = np.exp(exponent * np.float64(0.5 * shininess))  # n may be beyond float32
    return power


def _dot(a: Sequence[Floats], b: Sequence[Floats]) -> Floats:
    total = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def _plain_cross(a: Sequence[Floats], b: Sequence[Floats]) -> list[Floats]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


# -------------------------------------------------------------------------------------------------- double-double


def _deep_disc(view: _View, d: Triple) -> Floats:
    """R^2 A - |m x D|^2, every product and sum with its error; good to view.deep_doubt A before the last sum."""
    dx, dy, dz = d
    rests = (0.0, 0.0, view.m_z_rest)
    mx, my, mz = ((np.asarray(v), np.asarray(rest)) for v, rest in zip(view.m, rests, strict=True))
    components = (_determinant(my, mz, dy, dz), _determinant(mz, mx, dz, dx), _determinant(mx, my, dx, dy))
    a_high, a_low = _square_sum(((dx, None), (dy, None), (dz, None)))
    c_high, c_low = _square_sum(components)
    high, low = _two_product(np.asarray(view.r2[0]), a_high)
    low = low + (view.r2[0] * a_low + view.r2[1] * a_high)
    disc, rest = _two_sum(high, -c_high)
    disc += rest + (low - c_low)
    return disc


def _determinant(p: Pair, q: Pair, dp: Floats, dq: Floats) -> Pair:
    """p dq - q dp with p and q in two parts."""
    first, first_low = _two_product(p[0], dq)
    second, second_low = _two_product(q[0], dp)
    high, low = _two_sum(first, -second)
    low = low + ((first_low - second_low) + (p[1] * dq - q[1] * dp))
    total = high + low
    return total, low - (total - high)


def _square_sum(values: Sequence[tuple[Floats, Floats | None]]) -> Pair:
    """The sum of the squares of three numbers, each alone or in two parts."""
    total, rest = _two_product(values[0][0], values[0][0])
    if values[0][1] is not None:
        rest = rest + 2.0 * values[0][0] * values[0][1]
    for value, value_rest in values[1:]:
        square, square_rest = _two_product(value, value)
        if value_rest is not None:
            square_rest = square_rest + 2.0 * value * value_rest
        total, error = _two_sum(total, square)
        rest = rest + (error + square_rest)
    return total, rest


def _two_sum(a: Floats, b: Floats) -> Pair:
    """a + b = sum + error, exactly (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _two_product(a: Floats, b: Floats) -> Pair:
    """a b = product + error, exactly short of subnormal numbers (Veltkamp, Dekker); sizes below 2^990."""
    product = a * b
    a_high, a_low = _split(a)
    b_high, b_low = _split(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _split(a: Floats) -> Pair:
    wide = a * 134217729.0
    high = wide - (wide - a)
    return high, a - high
