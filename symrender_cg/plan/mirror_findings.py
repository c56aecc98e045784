"""Findings about reflections: what may be seen in what, and how deep. See `findings`.

Comes in: an Examination. Goes out: Findings, one a subject. Never done here: a decision.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symrender_cg.plan.effects import Finding
from symrender_cg.plan.examination import Examination
from symrender_cg.plan.lighting_findings import material_of, place
from symrender_cg.plan.measures import angle, cap_above, norm
from symrender_cg.plan.tolerance import brightness


def mirrors(found: Examination) -> Iterator[Finding]:
    """Each surface in each mirror; a surface that is no mirror once."""
    measures = found.measures
    for receiver in np.flatnonzero(found.matters).tolist():
        name, reflect = place(found, receiver), material_of(found, receiver).reflect
        if not found.mirrors.mirror[receiver]:
            yield _no_mirror(found, name, reflect)
            continue
        seen = set(found.mirrors.seen[receiver].tolist())
        for b in range(measures.count):
            if b == receiver:
                continue
            subject = f"spheres[{b}] in {name}"
            if b in seen:
                yield Finding(True, f"may be seen, {reflect:.6g} of it", None, subject)
            else:
                reason, margin = _why_unseen(found, receiver, b)
                yield Finding(False, reason, margin, subject)
        if found.mirrors.plane[receiver]:
            yield Finding(True, f"may be seen, {reflect:.6g} of it", None, f"plane in {name}")


def _no_mirror(found: Examination, name: str, reflect: float) -> Finding:
    if reflect == 0.0:
        return Finding(False, "reflect is 0", None, name)
    if found.measures.scene.max_bounces == 0:
        return Finding(False, "the scene asks for no bounces", None, name)
    budget = found.budget
    if budget is not None and budget.depth_bound > 0.0 and found.mirrors.bounces == 0:
        return Finding(False, f"at most {budget.depth_bound:.6g}, within the tolerance", None, name, budget.depth_bound)
    if found.mirrors.bounces and name.startswith("spheres"):
        return Finding(False, "it is seen only where no bounces are left, or shows a background of 0 alone", None, name)
    return Finding(False, "it shows nothing but a background of 0", None, name)


def _why_unseen(found: Examination, a: int, b: int) -> tuple[str, float | None]:
    """Why sphere b is not seen in receiver a."""
    views, measures = found.views, found.measures
    if views.beyond[b]:
        return "beyond the plane", -float(measures.sphere_heights[0][b] + measures.radius[b]) * measures.unit
    if views.contained[b]:
        return "inside another sphere", None
    if a >= measures.count:
        return "its mirror image is outside the window", None
    between = measures.center[b] - measures.center[a]
    psi = float(angle(-measures.m[a], between))
    seen = float(cap_above(measures.distance[a : a + 1], measures.radius[a : a + 1])[0])
    horizon = float(np.arccos(np.clip((measures.radius[a] - measures.radius[b]) / norm(between), -1.0, 1.0)))
    text = f"under every visible tangent plane: psi {psi:.6g} - phi_E {seen:.6g} >= {horizon:.6g}"
    return text, psi - seen - horizon


def depths(found: Examination) -> Iterator[Finding]:
    """Each number of bounces up to the scene's."""
    limit, bounces = found.measures.scene.max_bounces, found.mirrors.bounces
    budget = found.budget
    bright = brightness(found.measures, found.mirrors, found.lamps_before)
    if limit == 0:
        yield Finding(False, "the scene asks for no bounces")
    for depth in range(1, limit + 1):
        subject = f"bounce {depth}"
        if depth <= bounces:
            top = bright.share**depth * bright.brightest
            text = f"up to {bright.share:.6g}^{depth} times {bright.brightest:.6g} = {top:.6g}"
            yield Finding(True, text, None, subject)
        elif budget is not None and budget.depth_bound > 0.0:
            bound = budget.depth_bound
            yield Finding(
                False, f"with all deeper ones at most {bound:.6g}, within the tolerance", None, subject, bound
            )
        elif bounces == 0:
            yield Finding(False, "no mirror that is seen shows anything", None, subject)
        else:
            yield Finding(False, f"no chain of {depth} mirrors that may see one another", None, subject)
