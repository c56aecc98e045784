"""The passes that make a kernel of one sphere fast and leave its promise alone, each with a switch.

Comes in: nothing. Goes out: `Passes`, a part of every Variant. docs/passes.md shows what each does to the C and what it
gains.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace


@dataclass(frozen=True, slots=True)
class Passes:
    """Which passes run. Where one does not apply to a scene it changes nothing.

    symmetry   what the pixels at x and -x share is computed once (symmetry.py); the first part of each sum is even
    twins      and of that, what the rows at y and -y share, once for both
    fission    the steps of a pixel in short loops over a block (fission.py)
    halves     a power in two steps, its logarithm and 2^y, so that fission may cut between them
    whole      an exponent that is an argument, even and whole: by squaring instead, a block at a time (lobe_power.h);
               for `fast` one of 32 or more: by a shorter polynomial (fast_power.h)
    anchors    where a pixel lies in its row: float64 at the ends of its hits, counted in float32 between (anchors.py)
    prefetch   the next row is begun while this one is computed: its numbers, and its memory is asked for (block.h)
    """

    symmetry: bool = True
    twins: bool = True
    fission: bool = True
    halves: bool = True
    whole: bool = True
    anchors: bool = True
    prefetch: bool = True

    @property
    def staged(self) -> bool:
        """Whether a pixel's steps are in stages at all."""
        return self.symmetry or self.fission

    def without(self, *names: str) -> Passes:
        """The same with the named ones off."""
        return replace(self, **dict.fromkeys(names, False))


ALL = Passes()
"""Every pass."""

NAMES = tuple(entry.name for entry in fields(Passes))
"""Their names, in the order above."""
