"""The true value of one grey sphere under one light, in whole numbers up to the one square root, then in balls.

Comes in: a camera-frame Scene that `takes` accepts, points, a rounding. Goes out: hit or miss, and the value rounded,
or None where nothing at hand decides. Never done here: a decision or digit that is not proved.

Every input is an integer times a power of two, and intensity does not change when all lengths, or D alone, are scaled.
So with whole numbers m = C - E, l = L - C, R on one grid and D = (x, y, -e) on another,
    A = |D|^2,  a = m.D,  disc = a^2 - A (|m|^2 - R^2),  q = sqrt(disc),  g = l.D,  u = a g - A (l.m + R^2)
everything below is s + t q with whole s and t (P' = P - C, w = L - P):
    A P'.w       = u - g q                                    n.l = (u - g q) / (R sqrt(A W))
    W = A |w|^2  = A (|l|^2 - R^2) - 2 u + 2 g q
    r.v          = (alpha q + beta) / (A R^2 sqrt(W))         alpha = 2 u + A R^2,  beta = g (A R^2 - 2 disc)
The first attempt takes the sums as they stand at 192 bits; one_sphere_exact takes what that cannot decide. What may be
a tie is left to the solver of all scenes.

python-flint's precision belongs to the process: another thread that changes it costs time here, never a wrong digit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, TypeVar

from flint import arb, ctx, fmpz

from symrender_cg.reference.camera_numbers import FrameNumbers, frame_numbers, whole_numbers
from symrender_cg.reference.oracle.one_sphere_exact import Cast, added_light
from symrender_cg.reference.oracle.rounding import Rounding
from symrender_cg.reference.oracle.whole import primary_directions
from symrender_cg.reference.points import FloatArray
from symrender_cg.scene import PointLight, Scene

FIRST_BITS: Final = 192
CAREFUL_BITS: Final = (224, 512, 2560)
"""2560 bits separate any two float64 values and their midpoints from 0; what is left after that may be a tie."""

T = TypeVar("T")


def takes(frame: Scene) -> bool:
    """One sphere, one point light that does not fade, one channel, nothing else that a ray could see."""
    return (
        len(frame.spheres) == len(frame.lights) == frame.channels == 1
        and isinstance(frame.lights[0], PointLight)
        and frame.lights[0].attenuation == (1.0, 0.0, 0.0)
        and frame.plane is None
        and isinstance(frame.background, float)
        and (frame.spheres[0].material.reflect == 0.0 or frame.max_bounces == 0)
    )


class OneSphere:
    """The solver of such a scene."""

    channels = 1

    def __init__(self, frame: Scene) -> None:
        numbers = frame_numbers(frame)
        self.numbers = numbers
        cx, cy, cz, e, r, x, y, z = whole_numbers((*numbers.center, numbers.eye, numbers.radius, *numbers.light))
        lengths = (cx, cy, cz - e, x - cx, y - cy, z - cz, r)
        unit = math.gcd(*lengths)
        mx, my, mz, lx, ly, lz, radius = (fmpz(length // unit) for length in lengths)
        self.m, self.light, self.r2 = (mx, my, mz), (lx, ly, lz), radius * radius
        self.eye_excess = mx * mx + my * my + mz * mz - self.r2
        """|m|^2 - R^2 > 0"""
        self.light_excess = lx * lx + ly * ly + lz * lz - self.r2
        self.kappa = lx * mx + ly * my + lz * mz + self.r2

    def seen(self, columns: FloatArray, rows: FloatArray) -> list[int]:
        """0 where the sphere is hit, -1 elsewhere: disc >= 0 and the sphere before the eye, in whole numbers."""
        return [-1 if self._cast(*d) is None else 0 for d in primary_directions(self.numbers.eye, columns, rows)]

    def answers(
        self, columns: FloatArray, rows: FloatArray, rounding: Rounding[T], bits: Sequence[int] | None = None
    ) -> list[tuple[int, list[T]] | None]:
        """(index, [the value rounded]) at each point, None where balls do not decide it: a tie, perhaps exact."""
        found: list[tuple[int, list[T]] | None] = []
        of_ball = rounding.of_ball
        with ctx.workprec(FIRST_BITS):
            first = _FirstAttempt(self.numbers, self.r2)
            ground = first.ambient
            background = rounding.of_ball(arb(self.numbers.background), arb(0))
            assert background is not None, "a float64 is known exactly"
            missed = (-1, [background])
            for d in primary_directions(self.numbers.eye, columns, rows):
                ray = self._cast(*d)
                if ray is None:
                    found.append(missed)
                    continue
                added = first.light(*ray) if bits is None else None
                done = None if added is None else of_ball(ground, added)
                if done is None:
                    done = self._carefully(Cast(*ray, self.r2), rounding, CAREFUL_BITS if bits is None else bits)
                found.append(None if done is None else (0, [done]))
        return found

    def _cast(self, dx: fmpz, dy: fmpz, dz: fmpz) -> tuple[fmpz, fmpz, fmpz, fmpz, fmpz] | None:
        """(A, disc, g, u, W - 2 g q) of a ray that hits, else None."""
        mx, my, mz = self.m
        a_dd = dx * dx + dy * dy + dz * dz
        a = mx * dx + my * dy + mz * dz
        disc = a * a - a_dd * self.eye_excess
        if disc < 0 or a < 0:
            return None
        lx, ly, lz = self.light
        g = lx * dx + ly * dy + lz * dz
        u = a * g - a_dd * self.kappa
        return a_dd, disc, g, u, a_dd * self.light_excess - 2 * u

    def _carefully(self, ray: Cast, rounding: Rounding[T], bits: Sequence[int]) -> T | None:
        """The same through exact signs and conjugates at growing precision."""
        for precision in bits:
            with ctx.workprec(precision):
                done = rounding.of_ball(arb(self.numbers.ambient), added_light(self.numbers, ray))
            if done is not None:
                return done
        return None


class _FirstAttempt:
    """The formulas as they stand, at the precision of the context; None wherever a sign is undecided."""

    __slots__ = ("ambient", "diffuse", "gated", "nothing", "r2", "shininess", "specular")

    def __init__(self, numbers: FrameNumbers, r2: fmpz) -> None:
        self.ambient, self.nothing = arb(numbers.ambient), arb(0)
        self.diffuse = arb(numbers.intensity) * numbers.diffuse
        self.specular = arb(numbers.intensity) * numbers.specular
        self.shininess = arb(numbers.shininess)
        self.gated = numbers.gate_specular
        self.r2 = r2

    def light(self, a_dd: fmpz, disc: fmpz, g: fmpz, u: fmpz, w_part: fmpz) -> arb | None:
        """What the light adds to ambient."""
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
            return self.nothing if inverse_w.is_finite() else None
        return added
