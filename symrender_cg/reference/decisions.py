"""Whether a ray hits the sphere, and whether the light faces the point it hits: exact, in whole numbers.

Comes in: camera-frame numbers. Goes out: functions of one ray that answer True or False. Never done here: rounding.
"""

from __future__ import annotations

from collections.abc import Callable

from symrender_cg.reference.camera_numbers import FrameNumbers, whole_numbers


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
