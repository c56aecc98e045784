"""Seeded corpora: cases of every family, the same for the same seed on every machine.

Comes in: a seed, how many of each family. Goes out: Cases. Never done here: a measurement. The cases are drawn, so they
are others than the kept ones of tests/hardcases.json; a test holds that.
"""

from __future__ import annotations

from collections.abc import Sequence

from symrender_cg.stress.cases import Case
from symrender_cg.stress.families import families


def corpus(seed: int, per_family: int, names: Sequence[str] = ()) -> tuple[Case, ...]:
    """`per_family` cases of each family, or of the families of these names, in the table's order."""
    return tuple(case for entry in families(names) for case in entry.cases(seed, per_family))
