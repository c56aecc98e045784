"""I = k_a + k_d max(0, n.l) + k_s max(0, r.v)^n where the ray hits, in whatever arithmetic is handed in.

Comes in: coordinates, numbers, an `Arithmetic` of numpy, JAX, Dr.Jit or Halide. Goes out: the unclipped intensity.
Never done here: a better form. It is the seed's Cell 4 with what a careful person shares by hand: no vector of length 1
is made, r.v comes from n.v = root / (R |D|), and there are two divisions and three roots a point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """sqrt(a), positive(a) = max(0, a), select(condition, a, b), power(a, n) for an n that is no constant."""

    sqrt: Callable[[Any], Any]
    positive: Callable[[Any], Any]
    select: Callable[[Any, Any, Any], Any]
    power: Callable[[Any, Any], Any]


def intensity(x: Any, y: Any, numbers: tuple[Any, ...], a: Arithmetic) -> Any:
    """The intensity along the ray through (x, y); numbers in the order of `Numbers`, as constants or as arguments."""
    R, e, lx, ly, lz, ka, kd, ks, n = numbers
    s = x * x + y * y
    disc = e * e * R * R - (e * e - R * R) * s
    root = a.sqrt(a.positive(disc))
    inv_a = 1 / (s + e * e)
    t = (e * e - root) * inv_a
    px, py, pz = t * x, t * y, e - t * e
    wx, wy, wz = lx - px, ly - py, lz - pz
    inv_w2 = 1 / (wx * wx + wy * wy + wz * wz)
    n_dot_w = (px * wx + py * wy + pz * wz) * (1 / R)
    towards_eye = e * wz - x * wx - y * wy
    mirrored = (2 / R) * (n_dot_w * root) - towards_eye
    n_dot_l = n_dot_w * a.sqrt(inv_w2)
    r_dot_v = a.positive(mirrored * a.sqrt(inv_a * inv_w2))
    shade = ka + kd * a.positive(n_dot_l) + ks * power(r_dot_v, n, a.power)
    return a.select(disc >= 0, shade, 0 * shade)


def power(base: Any, exponent: Any, otherwise: Callable[[Any, Any], Any]) -> Any:
    """base^exponent: by squaring where the exponent is a whole Python number, else as the arithmetic has it."""
    if not isinstance(exponent, float) or exponent != int(exponent) or not 0 < exponent <= 1024:
        return otherwise(base, exponent)
    left, result = int(exponent), None
    while True:
        if left % 2:
            result = base if result is None else result * base
        left //= 2
        if not left:
            return result
        base = base * base
