"""The true value of the image at float64 points, correctly rounded: exact integers up to the one square root, then Arb.

Comes in: a Scene with one sphere and one light, points (x, y). Goes out: hit or miss, the intensity rounded to float64
and float32, what float64 left over, or an enclosure as a ball. Never done here: a decision or digit that is not proved.

Every input is an integer times a power of two, and intensity does not change when all lengths, or D alone, are scaled.
So with whole numbers m = C - E, l = L - C, R on one grid and D = (x, y, -e) on another,
    A = |D|^2,  a = m.D,  disc = a^2 - A (|m|^2 - R^2),  q = sqrt(disc),  g = l.D,  u = a g - A (l.m + R^2)
everything below is s + t q with whole s and t (P' = P - C, w = L - P):
    A P'.w       = u - g q                                    n.l = (u - g q) / (R sqrt(A W))
    W = A |w|^2  = A (|l|^2 - R^2) - 2 u + 2 g q
    r.v          = (alpha q + beta) / (A R^2 sqrt(W))         alpha = 2 u + A R^2,  beta = g (A R^2 - 2 disc)
    1 - (r.v)^2  = (A^2 R^4 W - (alpha q + beta)^2) / (A^2 R^4 W)
and s + t q = (s^2 - t^2 disc) / (s - t q) has an exact sign and no cancellation. The first attempt takes the sums as
they stand at 192 bits; whatever it cannot decide goes through the conjugates, exp and log1p, at growing precision.

python-flint's precision belongs to the process: another thread that changes it costs time here, never a wrong digit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np
import numpy.typing as npt
from flint import arb, ctx, fmpq, fmpz

from symrender_cg.errors import AccuracyError
from symrender_cg.reference.points import FloatArray, FrameNumbers, as_points, frame_numbers, whole_numbers
from symrender_cg.scene import Scene

FIRST_BITS: Final = 192
CAREFUL_BITS: Final = (224, 512, 2560)
LAST_BITS: Final = (10240, 40960)
"""2560 bits separate any two float64 values and their midpoints from 0; what is left after that may be a tie."""
_FAR: Final = 1 << 20
"""Stands for the exponent of 0, which has none."""


@dataclass(frozen=True, slots=True)
class Answers:
    """Correctly rounded intensities; all arrays have the broadcast shape of the points.

    value: float64 nearest to the true value; residual: float64 nearest to true - value; hit: bool; value32: float32
    nearest to the true value. Ties go to even. Where the value is beyond float64 it is inf and the residual 0.
    """

    value: FloatArray
    residual: FloatArray
    hit: npt.NDArray[np.bool_]
    value32: npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class _Whole:
    """The scene in whole numbers: m, l, and the scalars that the formulas share."""

    m: tuple[fmpz, fmpz, fmpz]
    light: tuple[fmpz, fmpz, fmpz]
    r2: fmpz
    eye_excess: fmpz
    """|m|^2 - R^2 > 0"""
    light_excess: fmpz
    """|l|^2 - R^2"""
    kappa: fmpz
    """l.m + R^2"""
    eye: tuple[int, int]
    """e as an odd number and the exponent of its power of two"""


@dataclass(frozen=True, slots=True)
class _Ray:
    """A ray that hits, in whole numbers named as in the module's docstring."""

    a_dd: fmpz
    disc: fmpz
    g: fmpz
    u: fmpz
    w_part: fmpz
    """W = w_part + 2 g q"""
    numbers: FrameNumbers
    r2: fmpz

    def n_dot_l(self) -> tuple[fmpz, fmpz]:
        """(s, t) of the numerator of n.l."""
        return self.u, -self.g

    def w(self) -> tuple[fmpz, fmpz]:
        """(s, t) of W."""
        return self.w_part, 2 * self.g

    def r_dot_v(self) -> tuple[fmpz, fmpz]:
        """(s, t) of the numerator of r.v."""
        area = self.a_dd * self.r2
        return self.g * (area - 2 * self.disc), 2 * self.u + area

    def sine_squared(self) -> tuple[fmpz, fmpz]:
        """(s, t) of the numerator of 1 - (r.v)^2; the denominator is (A R^2)^2 W."""
        area2 = (self.a_dd * self.r2) ** 2
        beta, alpha = self.r_dot_v()
        return area2 * self.w_part - alpha * alpha * self.disc - beta * beta, 2 * (area2 * self.g - alpha * beta)


def hits(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """disc >= 0 and the sphere before the eye, decided in whole numbers; a bool array of the broadcast shape."""
    numbers = frame_numbers(scene)
    whole = _whole(numbers)
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    found = [_cast(whole, dx, dy, dz) is not None for dx, dy, dz in _directions(whole, columns, rows)]
    return np.array(found, dtype=np.bool_).reshape(columns.shape)


def evaluate(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> Answers:
    """The true intensity at each point, unclipped and correctly rounded (see Answers).

    Raises AccuracyError for a value that 40,960 bits and exact arithmetic cannot tell from a tie of float64 or float32.
    """
    numbers = frame_numbers(scene)
    whole = _whole(numbers)
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    count = columns.size
    value, residual = np.full(count, numbers.background), np.zeros(count)
    sides, hit = np.zeros(count, dtype=np.int8), np.zeros(count, dtype=np.bool_)
    with ctx.workprec(FIRST_BITS):
        first = _FirstAttempt(numbers, whole)
        for index, (dx, dy, dz) in enumerate(_directions(whole, columns, rows)):
            ray = _cast(whole, dx, dy, dz)
            if ray is None:
                continue
            hit[index] = True
            value[index], residual[index], sides[index] = first.rounded(*ray) or _rounded_carefully(
                _ray(numbers, whole, *ray)
            )
    shape = columns.shape
    value32 = _to_float32(value, sides)
    return Answers(value.reshape(shape), residual.reshape(shape), hit.reshape(shape), value32.reshape(shape))


def enclosure(scene: Scene, x: float, y: float, bits: int) -> arb:
    """A ball that contains the true intensity at (x, y); relative radius about 2^-bits."""
    numbers = frame_numbers(scene)
    whole = _whole(numbers)
    columns, rows = as_points(np.array([x], dtype=np.float64), np.array([y], dtype=np.float64))
    ray = _cast(whole, *next(_directions(whole, columns, rows)))
    if ray is None:
        return arb(numbers.background)
    with ctx.workprec(bits + 32):
        return arb(numbers.ambient) + _light_added(_ray(numbers, whole, *ray))


# ------------------------------------------------------------------------------------------------- whole numbers


def _whole(numbers: FrameNumbers) -> _Whole:
    """The scene on its own grid, divided by what its lengths have in common."""
    cx, cy, cz, e, r, x, y, z = whole_numbers((*numbers.center, numbers.eye, numbers.radius, *numbers.light))
    lengths = (cx, cy, cz - e, x - cx, y - cy, z - cz, r)
    unit = math.gcd(*lengths)
    mx, my, mz, lx, ly, lz, radius = (fmpz(length // unit) for length in lengths)
    r2 = radius * radius
    eye = numbers.eye
    numerator, denominator = eye.as_integer_ratio()
    twos = (numerator & -numerator).bit_length() - 1
    return _Whole(
        m=(mx, my, mz),
        light=(lx, ly, lz),
        r2=r2,
        eye_excess=mx * mx + my * my + mz * mz - r2,
        light_excess=lx * lx + ly * ly + lz * lz - r2,
        kappa=lx * mx + ly * my + lz * mz + r2,
        eye=(numerator >> twos, twos - (denominator.bit_length() - 1)),
    )


def _directions(whole: _Whole, columns: FloatArray, rows: FloatArray) -> Iterator[tuple[fmpz, fmpz, fmpz]]:
    """D = (x, y, -e) times a power of two that makes it whole, for each point."""
    eye, eye_exponent = whole.eye
    eye_number = fmpz(-eye)
    significands, exponents = [], []
    for values in (columns, rows):
        fraction, exponent = np.frexp(values.ravel())
        significands.append((fraction * 2.0**53).astype(np.int64).tolist())
        exponents.append(np.where(fraction == 0.0, _FAR, exponent.astype(np.int64) - 53).tolist())
    for x, y, x_exponent, y_exponent in zip(*significands, *exponents, strict=True):
        grid = min(x_exponent, y_exponent, eye_exponent)
        dx = fmpz(x) << (x_exponent - grid) if x else fmpz(0)
        dy = fmpz(y) << (y_exponent - grid) if y else fmpz(0)
        yield dx, dy, eye_number << (eye_exponent - grid)


def _cast(whole: _Whole, dx: fmpz, dy: fmpz, dz: fmpz) -> tuple[fmpz, fmpz, fmpz, fmpz, fmpz] | None:
    """(A, disc, g, u, W - 2 g q) of a ray that hits, else None."""
    mx, my, mz = whole.m
    a_dd = dx * dx + dy * dy + dz * dz
    a = mx * dx + my * dy + mz * dz
    disc = a * a - a_dd * whole.eye_excess
    if disc < 0 or a < 0:
        return None
    lx, ly, lz = whole.light
    g = lx * dx + ly * dy + lz * dz
    u = a * g - a_dd * whole.kappa
    return a_dd, disc, g, u, a_dd * whole.light_excess - 2 * u


def _ray(numbers: FrameNumbers, whole: _Whole, a_dd: fmpz, disc: fmpz, g: fmpz, u: fmpz, w_part: fmpz) -> _Ray:
    return _Ray(a_dd, disc, g, u, w_part, numbers, whole.r2)


# --------------------------------------------------------------------------------------------------- first attempt

_Rounded = tuple[float, float, int]
"""value, residual, sign of the true value minus value"""


class _FirstAttempt:
    """The formulas as they stand, at the precision of the context; None wherever a sign or a rounding is undecided."""

    __slots__ = ("ambient", "diffuse", "gated", "r2", "shininess", "specular")

    def __init__(self, numbers: FrameNumbers, whole: _Whole) -> None:
        self.ambient = arb(numbers.ambient)
        self.diffuse = arb(numbers.intensity) * numbers.diffuse
        self.specular = arb(numbers.intensity) * numbers.specular
        self.shininess = arb(numbers.shininess)
        self.gated = numbers.gate_specular
        self.r2 = whole.r2

    def rounded(self, a_dd: fmpz, disc: fmpz, g: fmpz, u: fmpz, w_part: fmpz) -> _Rounded | None:
        q = arb(disc).sqrt()
        gq = q * g
        towards = u - gq
        lit = towards > 0
        if not lit and not towards <= 0:
            return None
        inverse_w = (gq + gq + w_part).rsqrt()
        area = a_dd * self.r2
        added: arb | None = None
        if lit:
            added = self.diffuse * towards * inverse_w * arb(area).rsqrt()
        if lit or not self.gated:
            mirrored = q * (u + u + area) + g * (area - disc - disc)
            if mirrored > 0:
                power = self.specular * (mirrored * inverse_w / area) ** self.shininess
                added = power if added is None else added + power
            elif not mirrored <= 0 or self.shininess.is_zero():
                return None
        if added is None:
            return (float(self.ambient), 0.0, 0) if inverse_w.is_finite() else None
        return _rounded_sum(self.ambient, added)


def _rounded_sum(ambient: arb, added: arb) -> _Rounded | None:
    """ambient + added rounded to float64, with residual and its sign; None where the balls leave any of them open.

    The residual is (ambient - value) + added: its first term is exact, so a tiny `added` keeps all its digits.
    """
    value = float(ambient + added)
    if not -math.inf < value < math.inf:
        return None
    rest = (ambient - value) + added
    low_ball, high_ball = rest.lower(), rest.upper()
    low, high = float(low_ball), float(high_ball)
    if low != high:
        return None
    if low_ball > 0:
        side = 1
    elif high_ball < 0:
        side = -1
    elif rest.is_zero() or not _is_float32_tie(value):
        side = 0
    else:
        return None
    if abs(low) >= 0.24 * math.ulp(value) and not (
        float((ambient + added).lower()) == float((ambient + added).upper()) == value
    ):
        return None
    return value, low + 0.0, side


# ------------------------------------------------------------------------------------------- conjugates and beyond


def _rounded_carefully(ray: _Ray) -> _Rounded:
    """The same answer through exact signs and conjugates; exact rational values where there are such."""
    for bits in CAREFUL_BITS:
        with ctx.workprec(bits):
            rounded = _rounded_sum(arb(ray.numbers.ambient), _light_added(ray))
        if rounded is not None:
            return rounded
    added = _rational_light(ray)
    if added is not None:
        return _rounded_fraction(Fraction(ray.numbers.ambient) + added)
    for bits in LAST_BITS:
        with ctx.workprec(bits):
            rounded = _rounded_sum(arb(ray.numbers.ambient), _light_added(ray))
        if rounded is not None:
            return rounded
    raise AccuracyError(
        f"a value that {LAST_BITS[-1]} bits cannot tell from a tie between two floats, in a scene of {ray.numbers}; "
        "expected a value that rounds one way; move the point by one float, or use enclosure()"
    )


def _light_added(ray: _Ray) -> arb:
    """intensity (k_d max(0, n.l) + k_s max(0, r.v)^n): every factor with nearly the whole precision, signs exact."""
    numbers = ray.numbers
    q = arb(ray.disc).sqrt()
    w = _surd(ray.w(), ray.disc, q)
    if w.is_zero():
        return arb(0)
    towards = _surd(ray.n_dot_l(), ray.disc, q)
    area = ray.a_dd * ray.r2
    lit = towards > 0
    added = arb(numbers.diffuse) * towards / (w * area).sqrt() if lit else arb(0)
    if lit or not numbers.gate_specular:
        added = added + arb(numbers.specular) * _highlight(ray, q, w, area)
    return arb(numbers.intensity) * added


def _highlight(ray: _Ray, q: arb, w: arb, area: fmpz) -> arb:
    """max(0, r.v)^n, by log1p of -(1 - (r.v)^2) where r.v is near 1, so that any n is as good as n = 1."""
    shininess = arb(ray.numbers.shininess)
    if shininess.is_zero():
        return arb(1)
    mirrored = _surd(ray.r_dot_v(), ray.disc, q)
    if not mirrored > 0:
        return arb(0)
    cosine = mirrored / (area * w.sqrt())
    if not cosine > 0.75:
        return (shininess * cosine.log()).exp()
    sine2 = _surd(ray.sine_squared(), ray.disc, q) / (area * area * w)
    return (shininess / 2 * (-sine2).log1p()).exp()


def _surd(parts: tuple[fmpz, fmpz], disc: fmpz, q: arb) -> arb:
    """s + t q without cancellation: (s^2 - t^2 disc) / (s - t q) where the signs differ; exactly 0 where it is 0."""
    s, t = parts
    if s == 0 or t == 0 or (s > 0) == (t > 0):
        return q * t + s
    numerator = s * s - t * t * disc
    return arb(numerator) / (s - q * t) if numerator != 0 else arb(0)


def _rational_light(ray: _Ray) -> Fraction | None:
    """What the light adds when n.l and (r.v)^n are rational, exactly; else None."""
    numbers = ray.numbers
    root = math.isqrt(int(ray.disc))
    square_disc = root if root * root == int(ray.disc) else None
    with ctx.workprec(CAREFUL_BITS[-1]):
        q = arb(ray.disc).sqrt()
        if _surd(ray.w(), ray.disc, q).is_zero():
            return Fraction(0)
        lit = _surd(ray.n_dot_l(), ray.disc, q) > 0
        facing = _surd(ray.r_dot_v(), ray.disc, q) > 0
    added = Fraction(0)
    if lit:
        n_dot_l = _rational_ratio(ray, ray.n_dot_l(), ray.a_dd * ray.r2, square_disc)
        if n_dot_l is None:
            return None
        added += Fraction(numbers.diffuse) * n_dot_l
    if lit or not numbers.gate_specular:
        if numbers.shininess == 0.0:
            power: Fraction | None = Fraction(1)
        elif not facing:
            power = Fraction(0)
        else:
            base = _rational_ratio(ray, ray.r_dot_v(), (ray.a_dd * ray.r2) ** 2, square_disc)
            power = None if base is None else _rational_power(base, numbers.shininess)
        if power is None:
            return None
        added += Fraction(numbers.specular) * power
    return Fraction(numbers.intensity) * added


def _rational_ratio(ray: _Ray, parts: tuple[fmpz, fmpz], factor: fmpz, square_disc: int | None) -> Fraction | None:
    """(s + t q) / sqrt(factor W), known to be positive, when it is rational, else None.

    Its square is (b1 + b2 q) / (c1 + c2 q); with q irrational it is rational only where b1 c2 = b2 c1.
    """
    s, t = parts
    w_s, w_t = ray.w()
    b1, b2 = s * s + t * t * ray.disc, 2 * s * t
    c1, c2 = factor * w_s, factor * w_t
    if square_disc is not None:
        square = fmpq(b1 + b2 * square_disc, c1 + c2 * square_disc)
    elif b1 * c2 == b2 * c1:
        square = fmpq(b1, c1) if c1 != 0 else fmpq(b2, c2)
    else:
        return None
    return _rational_root(Fraction(int(square.p), int(square.q)))


def _rational_root(square: Fraction) -> Fraction | None:
    numerator, denominator = math.isqrt(square.numerator), math.isqrt(square.denominator)
    root = Fraction(numerator, denominator)
    return root if root * root == square else None


def _rational_power(base: Fraction, exponent: float) -> Fraction | None:
    """base^exponent when it is rational and small enough to write down."""
    if base == 1:
        return base
    numerator, denominator = exponent.as_integer_ratio()
    if numerator > 4096:
        return None
    while denominator > 1:
        root = _rational_root(base)
        if root is None:
            return None
        base, denominator = root, denominator // 2
    return Fraction(base**numerator)


def _rounded_fraction(value: Fraction) -> _Rounded:
    nearest = value.numerator / value.denominator
    rest = value - Fraction(nearest)
    return nearest, rest.numerator / rest.denominator, (rest > 0) - (rest < 0)


def _to_float32(value: FloatArray, sides: npt.NDArray[np.int8]) -> npt.NDArray[np.float32]:
    """float32 nearest to the true values: a float64 in the middle of two float32 gives way to the side of the truth."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        nearest = value.astype(np.float32)
        away = value - nearest
        other = np.nextafter(nearest, np.where(away > 0, np.float32(np.inf), np.float32(-np.inf)))
        tie = (away != 0.0) & (other.astype(np.float64) - value == away)
    return np.where(tie & (sides == np.sign(away)), other, nearest)


def _is_float32_tie(value: float) -> bool:
    """Whether `value` lies in the middle of two float32, so that the sign of the residual decides value32."""
    one = np.array([value])
    up, down = (_to_float32(one, np.array([side], dtype=np.int8)) for side in (1, -1))
    return bool(up[0] != down[0])
