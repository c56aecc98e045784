"""The stable form's light: the intensity of rays that hit, from the foot point and the mirrored ray; numpy.

Comes in: rays D, c = m x D and sqrt(disc), both over R. Goes out: intensities in the dtype of what came in. Never done
here: hit or miss. The sign of n.l that gates a highlight is exact.

    N = (c x D - sqrt(disc) D) / (R A)       from the ray's foot point, the point of the ray nearest the centre
    n.l = N.w / |w|                          w = L - C - R N
    r.v = (2 (N.w) n.v + w.D / sqrt(A)) / |w|,  n.v = sqrt(disc) / (R sqrt(A))
    (r.v)^n = (1 - |w x v'|^2 / |w|^2)^(n/2) where r.v > 0.9,  v' = 2 (n.v) N + D / sqrt(A)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from symrender_cg.reference.stable_view import UNIT_ROUNDOFF, View

Floats: TypeAlias = npt.NDArray[Any]
"""float64, or float32 where the caller asked for it"""
Triple: TypeAlias = tuple[Floats, Floats, Floats]
Indices: TypeAlias = npt.NDArray[np.intp]


def shade(view: View, rays: Triple, d: Triple, c: Triple, a_dd: Floats, root: Floats) -> Floats:
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


def _lit(view: View, rays: Triple, n_dot_l: Floats, inverse_w: Floats) -> npt.NDArray[np.bool_]:
    """n.l > 0, exact for rays that hit: whole numbers decide where |n.l| is within its error, some u (1 + R/|w|)."""
    u = float(np.finfo(n_dot_l.dtype).eps)
    bound = (64.0 * u + view.normal_doubt * UNIT_ROUNDOFF) * (1.0 + view.r_light * inverse_w)
    lit: npt.NDArray[np.bool_] = n_dot_l > 0.0
    doubtful = np.nonzero(~(np.abs(n_dot_l) > bound))
    for row, column, *ray in zip(*doubtful, *(at(part, doubtful).tolist() for part in rays), strict=True):
        lit[row, column] = view.lit(*ray)
    return lit


def _highlight(
    view: View, base: Floats, w_w: Floats, normal: Triple, w: Triple, n_v: Floats, inverse_d: Floats, d: Triple
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


def at(values: Floats, places: tuple[Indices, ...]) -> Floats:
    """values[places], where an axis of length 1 stands for all."""
    rows, columns = (part if size > 1 else 0 for part, size in zip(places, values.shape, strict=True))
    picked: Floats = np.broadcast_to(values[rows, columns], places[0].shape)
    return picked


def _dot(a: Sequence[Floats], b: Sequence[Floats]) -> Floats:
    total = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def _plain_cross(a: Sequence[Floats], b: Sequence[Floats]) -> list[Floats]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
