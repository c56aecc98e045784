"""The true image of a scene of many spheres, lights, a plane and mirrors at float64 points, correctly rounded.

Comes in: a Scene, points (x, y) of the image plane. Goes out: SceneAnswers, the value of each channel rounded to
float64 and float32, what float64 left over, and which surface is seen; or that index alone. Never done here: a plan, or
a decision or digit that is not proved.

    scene_whole   the scene in whole numbers
    scene_rays    first hits, shadows, mirrored rays: every sign proved
    surds         the exact numbers that decide what balls cannot, for primary rays
    here          the light that reaches the eye, at a precision that grows until all signs and digits stand

The formula is that of brute_force, its rays are those of no other module. Values that are rational at the hit point,
such as a highlight seen in its very middle, are computed as such, so that ties are rounded to even.

A decision behind a mirror that depends on two equal numbers (a mirrored ray that touches a sphere, or that meets two
different spheres in one point) stays open at any precision: AccuracyError.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt
from flint import arb, ctx, fmpq, fmpz

from symrender_cg.errors import AccuracyError
from symrender_cg.reference.oracle import Answers, _rounded_fraction, _rounded_sum, _to_float32
from symrender_cg.reference.points import FloatArray, as_points, whole_numbers
from symrender_cg.reference.scene_rays import (
    Ray,
    Site,
    Undecided,
    blocked,
    first_hit,
    material_at,
    mirrored,
    normal_to_lamp,
    sign_at,
    to_lamp,
)
from symrender_cg.reference.scene_whole import Lamp, Number, World, direction_of, dot, square_of
from symrender_cg.reference.surds import Surd, rational_root
from symrender_cg.scene import DirectionalLight, Gradient, Phong, Scene

BITS: Final = (160, 512, 2560, 10240)
"""2560 bits separate any two float64 values and their midpoints from 0; what is left after that may be a tie."""
EXACT_FROM: Final = 512
"""The precision from which a value that will not round is tried as a rational number first."""
LARGEST_POWER: Final = 4096

Colour: TypeAlias = float | tuple[float, float, float]
Rounded: TypeAlias = tuple[float, float, int]
"""value, residual, sign of the true value minus value"""


@dataclass(frozen=True, slots=True)
class SceneAnswers:
    """Correctly rounded values; `points` is the broadcast shape of x and y, channels nothing or (3,).

    value: float64 nearest to the true value; residual: float64 nearest to true - value; value32: float32 nearest to the
    true value; each points + channels, ties to even. index: points, int64: which of scene.spheres is seen,
    len(scene.spheres) for the plane, -1 for neither.
    """

    value: FloatArray
    residual: FloatArray
    value32: npt.NDArray[np.float32]
    index: npt.NDArray[np.int64]

    @property
    def answers(self) -> Answers:
        """The same for `compare.measure`: hit is index >= 0, repeated for each channel."""
        hit = self.index >= 0
        if hit.ndim < self.value.ndim:
            hit = np.repeat(hit[..., np.newaxis], self.value.shape[-1], axis=-1)
        return Answers(self.value, self.residual, hit, self.value32)


def evaluate(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> SceneAnswers:
    """The true value at each point, unclipped and correctly rounded (see SceneAnswers).

    0.1 ms a point, more with spheres, lights and bounces. Raises AccuracyError where 10,240 bits do not decide a sign
    or a rounding.
    """
    world = World(scene.in_camera_frame())
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    count, channels = columns.size, world.frame.channels
    value, residual = np.empty((count, channels)), np.empty((count, channels))
    sides, index = np.empty((count, channels), dtype=np.int8), np.empty(count, dtype=np.int64)
    for k, (u, v) in enumerate(zip(columns.ravel().tolist(), rows.ravel().tolist(), strict=True)):
        index[k], rounded = _at_point(world, u, v)
        value[k], residual[k], sides[k] = zip(*rounded, strict=True)
    shape = columns.shape if channels == 1 else (*columns.shape, channels)
    value32 = _to_float32(value, sides)
    return SceneAnswers(
        value.reshape(shape), residual.reshape(shape), value32.reshape(shape), index.reshape(columns.shape)
    )


def index(scene: Scene, x: npt.ArrayLike, y: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Which surface is seen at each point, always decided: sphere, len(spheres) for the plane, -1 for neither."""
    world = World(scene.in_camera_frame())
    columns, rows = np.broadcast_arrays(*as_points(x, y))
    found = []
    with ctx.workprec(BITS[0]):
        for u, v in zip(columns.ravel().tolist(), rows.ravel().tolist(), strict=True):
            site = first_hit(world, _eye_ray(world, u, v))
            found.append(-1 if site is None else site.index)
    return np.array(found, dtype=np.int64).reshape(columns.shape)


def _eye_ray(world: World, x: float, y: float) -> Ray:
    dx, dy, dz = whole_numbers((x, y, -world.frame.camera.eye[2]))
    return Ray(world.eye, (fmpz(dx), fmpz(dy), fmpz(dz)), -1)


def _at_point(world: World, x: float, y: float) -> tuple[int, list[Rounded]]:
    """(index, each channel rounded), at growing precision."""
    ray = _eye_ray(world, x, y)
    for bits in BITS:
        with ctx.workprec(bits):
            try:
                seen = _look(world, ray, world.frame.max_bounces)
            except Undecided:
                continue
            rounded = [_rounded_sum(ground, added) for ground, added in seen.channels]
            if bits >= EXACT_FROM and None in rounded:
                rounded = [done or _rounded_exactly(world, seen, channel) for channel, done in enumerate(rounded)]
        if None not in rounded:
            return (-1 if seen.site is None else seen.site.index), [done for done in rounded if done is not None]
    raise AccuracyError(
        f"the value at ({x!r}, {y!r}) of a scene of {len(world.balls)} spheres rests on a sign or a rounding that "
        f"{BITS[-1]} bits leave open; expected a point where nothing touches and nothing ties; move it by one float"
    )


# -------------------------------------------------------------------------------------------------- the light, in balls


@dataclass(frozen=True, slots=True)
class _Lit:
    """A light that adds something: on the surface (n.l > 0), in its highlight; the other factors follow from these."""

    lamp: Lamp
    facing: bool
    shining: bool


@dataclass(frozen=True, slots=True)
class _Seen:
    """What a ray sees: for each channel an exact number and a ball whose sum is the value; and how it came about."""

    channels: list[tuple[arb, arb]]
    site: Site | None
    material: Phong | None
    lit: tuple[_Lit, ...]
    reflected: list[arb]


def _look(world: World, ray: Ray, bounces: int) -> _Seen:
    """colour(ray, bounces): the background, or ambient + light by light + reflect colour(mirrored, bounces - 1)"""
    channels = range(world.frame.channels)
    site = first_hit(world, ray)
    if site is None:
        return _Seen(_background(world, ray), None, None, (), [])
    material = material_at(world, site)
    lit = tuple(found for lamp in world.lamps if (found := _lit(world, site, material, lamp)) is not None)
    added = [arb(0) for _ in channels]
    for light in lit:
        n_dot_l, power, share = _factors(world, site, material, light)
        intensity = world.frame.lights[light.lamp.number].intensity
        for k in channels:
            surface = arb(_of(material.diffuse, k)) * n_dot_l + arb(_of(material.specular, k)) * power
            added[k] = added[k] + arb(_of(intensity, k)) * share * surface
    reflected = [arb(0) for _ in channels]
    if material.reflect > 0.0 and bounces > 0:
        beyond = _look(world, mirrored(site), bounces - 1)
        reflected = [arb(material.reflect) * (ground + more) for ground, more in beyond.channels]
    sums = [(arb(_of(material.ambient, k)), added[k] + reflected[k]) for k in channels]
    return _Seen(sums, site, material, lit, reflected)


def _background(world: World, ray: Ray) -> list[tuple[arb, arb]]:
    """The constant, or bottom + (top - bottom) s with s = (1 + up.D / (|up| |D|)) / 2."""
    background, channels = world.frame.background, range(world.frame.channels)
    if not isinstance(background, Gradient):
        return [(arb(_of(background, k)), arb(0)) for k in channels]
    up, d = direction_of(background.up), ray.direction
    s = (arb(dot(up, d)) / (arb(dot(up, up)) * dot(d, d)).sqrt() + 1) / 2
    bottom, top = ([arb(_of(colour, k)) for k in channels] for colour in (background.bottom, background.top))
    return [(low, (high - low) * s) for low, high in zip(bottom, top, strict=True)]


def _lit(world: World, site: Site, material: Phong, lamp: Lamp) -> _Lit | None:
    """The signs of n.l and r.v, and whether the light is seen; None where it adds nothing."""
    if lamp.position is not None and sign_at(site, lambda s: square_of(to_lamp(s, lamp))) == 0:
        return None
    facing = sign_at(site, lambda s: normal_to_lamp(s, lamp)) > 0
    shining = (
        _any(material.specular)
        and (facing or not material.gate_specular)
        and (material.shininess == 0.0 or sign_at(site, lambda s: _towards_eye(s, lamp)) > 0)
    )
    if not _any(world.frame.lights[lamp.number].intensity) or not (shining or (facing and _any(material.diffuse))):
        return None
    if world.frame.shadows and blocked(world, site, lamp):
        return None
    return _Lit(lamp, facing, shining)


def _towards_eye(site: Site, lamp: Lamp) -> Number:
    """r.v |w| |D| n2 = w.D n2 - 2 (n.w) (n.D), with n and w as they are."""
    w, d = to_lamp(site, lamp), site.direction
    return dot(w, d) * site.n2 - normal_to_lamp(site, lamp) * dot(site.normal, d) * 2


def _factors(world: World, site: Site, material: Phong, light: _Lit) -> tuple[arb, arb, arb]:
    """max(0, n.l), max(0, r.v)^n and the attenuation 1 / (a + b l + c l^2), as balls."""
    lamp = light.lamp
    w = to_lamp(site, lamp)
    w2 = arb(square_of(w))
    n_dot_l = normal_to_lamp(site, lamp) / (w2 * site.n2).sqrt() if light.facing else arb(0)
    power = arb(0)
    if light.shining:
        base = _towards_eye(site, lamp) / ((w2 * square_of(site.direction)).sqrt() * site.n2)
        power = base ** arb(material.shininess) if material.shininess != 0.0 else arb(1)
    source = world.frame.lights[lamp.number]
    if isinstance(source, DirectionalLight) or source.attenuation == (1.0, 0.0, 0.0):
        return n_dot_l, power, arb(1)
    a, b, c = (arb(number) for number in source.attenuation)
    unit = arb(fmpq(world.unit.numerator, world.unit.denominator))
    return n_dot_l, power, 1 / (a + b * unit * w2.sqrt() + c * unit * unit * w2)


def _of(colour: Colour, channel: int) -> float:
    return colour[channel] if isinstance(colour, tuple) else colour


def _any(colour: Colour) -> bool:
    return any(colour) if isinstance(colour, tuple) else colour > 0.0


# ------------------------------------------------------------------------------------------------- rational values


def _rounded_exactly(world: World, seen: _Seen, channel: int) -> Rounded | None:
    """The value of a channel as a rational number, rounded; None where a term of it is irrational."""
    site, material = seen.site, seen.material
    if site is None or site.exactly is None or material is None:
        return None
    if not seen.reflected[channel].is_exact():
        return None
    mantissa, exponent = seen.reflected[channel].man_exp()
    value = Fraction(_of(material.ambient, channel)) + Fraction(int(mantissa)) * Fraction(2) ** int(exponent)
    exact = site.exactly()
    for light in seen.lit:
        factors = _rational_factors(world, exact, material, light)
        if factors is None:
            return None
        n_dot_l, power, share = factors
        surface = Fraction(_of(material.diffuse, channel)) * n_dot_l + Fraction(_of(material.specular, channel)) * power
        value += Fraction(_of(world.frame.lights[light.lamp.number].intensity, channel)) * share * surface
    return _rounded_fraction(value)


def _rational_factors(
    world: World, exact: Site, material: Phong, light: _Lit
) -> tuple[Fraction, Fraction, Fraction] | None:
    """The factors of `_factors` where those that count are rational, else None."""
    lamp, zero = light.lamp, Fraction(0)
    w = to_lamp(exact, lamp)
    w2 = Surd(0) + square_of(w)
    n_dot_l: Fraction | None = zero
    if light.facing and _any(material.diffuse):
        n_dot_l = _ratio(normal_to_lamp(exact, lamp), w2 * exact.n2)
    power: Fraction | None = zero
    if light.shining:
        base = _ratio(_towards_eye(exact, lamp), w2 * square_of(exact.direction) * exact.n2 * exact.n2)
        power = Fraction(1) if material.shininess == 0.0 else _power(base, material.shininess)
    share: Fraction | None = Fraction(1)
    source = world.frame.lights[lamp.number]
    if not isinstance(source, DirectionalLight) and source.attenuation != (1.0, 0.0, 0.0):
        a, b, c = (Fraction(number) for number in source.attenuation)
        square = w2.rational()
        length = zero if b == 0 else None if square is None else rational_root(square)
        if square is None or length is None:
            return None
        share = 1 / (a + b * world.unit * length + c * world.unit**2 * square)
    if n_dot_l is None or power is None or share is None:
        return None
    return n_dot_l, power, share


def _ratio(numerator: Number, square: Surd) -> Fraction | None:
    """numerator / sqrt(square), known to be positive, where it is rational."""
    top = Surd(0) + numerator
    value = (top * top / square).rational()
    return None if value is None else rational_root(value)


def _power(base: Fraction | None, exponent: float) -> Fraction | None:
    """base^exponent where it is rational and small enough to write down."""
    if base is None or base == 1:
        return base
    numerator, denominator = exponent.as_integer_ratio()
    if numerator > LARGEST_POWER:
        return None
    for _ in range(denominator.bit_length() - 1):
        root = rational_root(base)
        if root is None:
            return None
        base = root
    return base**numerator
