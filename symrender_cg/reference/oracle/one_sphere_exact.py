"""One sphere, one light, without cancellation: exact signs and conjugates.

Comes in: the whole numbers of a ray that hits (see one_sphere). Goes out: what the light adds, as a ball.
Never done here: a rounding.

    1 - (r.v)^2  = (A^2 R^4 W - (alpha q + beta)^2) / (A^2 R^4 W)
and s + t q = (s^2 - t^2 disc) / (s - t q) has an exact sign and no cancellation.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import arb, fmpz

from symrender_cg.reference.camera_numbers import FrameNumbers


@dataclass(frozen=True, slots=True)
class Cast:
    """A ray that hits, in whole numbers named as in one_sphere's docstring."""

    a_dd: fmpz
    disc: fmpz
    g: fmpz
    u: fmpz
    w_part: fmpz
    """W = w_part + 2 g q"""
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


def added_light(numbers: FrameNumbers, ray: Cast) -> arb:
    """intensity (k_d max(0, n.l) + k_s max(0, r.v)^n): every factor with nearly the whole precision, signs exact."""
    q = arb(ray.disc).sqrt()
    w = _surd(ray.w(), ray.disc, q)
    if w.is_zero():
        return arb(0)
    towards = _surd(ray.n_dot_l(), ray.disc, q)
    area = ray.a_dd * ray.r2
    lit = towards > 0
    added = arb(numbers.diffuse) * towards / (w * area).sqrt() if lit else arb(0)
    if lit or not numbers.gate_specular:
        added = added + arb(numbers.specular) * _highlight(numbers, ray, q, w, area)
    return arb(numbers.intensity) * added


def _highlight(numbers: FrameNumbers, ray: Cast, q: arb, w: arb, area: fmpz) -> arb:
    """max(0, r.v)^n, by log1p of -(1 - (r.v)^2) where r.v is near 1, so that any n is as good as n = 1."""
    shininess = arb(numbers.shininess)
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
