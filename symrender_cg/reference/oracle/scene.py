"""The true light of any scene at a point: spheres, lights, shadows, a plane, mirrors, a gradient; all signs proved.

Comes in: a camera-frame Scene, points, a rounding. Goes out: for each point the surface that is seen and each channel
rounded, or None where nothing at hand decides. Never done here: a plan, or a decision or digit that is not proved.

    whole         the scene in whole numbers
    near          which spheres a ray could meet, in float64
    rays, sites   first hits, mirrored rays, shadows: every sign proved
    surds         the exact numbers that decide what balls cannot
    light         the light along a ray, in balls
    light_exact   the same as a fraction, where it is one
    here          a precision that grows until all signs and digits stand

Values that are rational, such as a highlight seen in its very middle, are computed as such, so that ties are exact.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, TypeVar

from flint import ctx

from symrender_cg.reference.oracle.light import Look, look
from symrender_cg.reference.oracle.light_exact import rational_value
from symrender_cg.reference.oracle.rays import Ray, first_hit
from symrender_cg.reference.oracle.rounding import Rounding
from symrender_cg.reference.oracle.signs import Undecided
from symrender_cg.reference.oracle.whole import World, primary_directions
from symrender_cg.reference.points import FloatArray
from symrender_cg.scene import Scene

BITS: Final = (160, 512, 2560, 10240)
"""2560 bits separate any two float64 values and their midpoints from 0; what is left after that may be a tie."""
EXACT_FROM: Final = 512
"""The precision from which a value that will not round is tried as a rational number first."""

T = TypeVar("T")


class AnyScene:
    """The solver that takes every scene."""

    def __init__(self, frame: Scene) -> None:
        self.world = World(frame)
        self.channels = frame.channels

    def seen(self, columns: FloatArray, rows: FloatArray) -> list[int]:
        """The index of the surface that is seen at each point; always decided."""
        found = []
        with ctx.workprec(BITS[0]):
            for ray in self._rays(columns, rows):
                site = first_hit(self.world, ray)
                found.append(-1 if site is None else site.index)
        return found

    def answers(
        self, columns: FloatArray, rows: FloatArray, rounding: Rounding[T], bits: Sequence[int] | None = None
    ) -> list[tuple[int, list[T]] | None]:
        """(index, each channel rounded) at each point, None where no precision of `bits` decides it."""
        ladder = BITS if bits is None else bits
        return [self._at(ray, rounding, ladder) for ray in self._rays(columns, rows)]

    def _rays(self, columns: FloatArray, rows: FloatArray) -> Iterator[Ray]:
        world = self.world
        for direction in primary_directions(world.frame.camera.eye[2], columns, rows):
            yield Ray(world.eye, direction, -1, 0, None)

    def _at(self, ray: Ray, rounding: Rounding[T], ladder: Sequence[int]) -> tuple[int, list[T]] | None:
        for bits in ladder:
            with ctx.workprec(bits):
                try:
                    seen = look(self.world, ray, self.world.frame.max_bounces)
                except Undecided:
                    continue
                rounded = [rounding.of_ball(ground, added) for ground, added in seen.channels]
                if bits >= EXACT_FROM and None in rounded:
                    rounded = [
                        _rounded_exactly(self.world, seen, k, rounding) if done is None else done
                        for k, done in enumerate(rounded)
                    ]
            if None not in rounded:
                return (-1 if seen.site is None else seen.site.index), [done for done in rounded if done is not None]
        return None


def _rounded_exactly(world: World, seen: Look, channel: int, rounding: Rounding[T]) -> T | None:
    value = rational_value(world, seen, channel)
    return None if value is None else rounding.of_fraction(value)
