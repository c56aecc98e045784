"""Findings about light: terms of lamps, lights as a whole, shadows, clipping. See `findings`.

Comes in: an Examination. Goes out: Findings, one a subject. Never done here: a decision.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symrender_cg.plan.effects import Finding
from symrender_cg.plan.examination import Examination
from symrender_cg.plan.lamps import enclosing
from symrender_cg.plan.measures import angle, cap_above, colour, cross, dot, norm
from symrender_cg.plan.tolerance import Brightness, brightness
from symrender_cg.scene import Phong


def place(found: Examination, receiver: int) -> str:
    """The path of a receiver in the scene."""
    over = receiver - found.measures.count
    return f"spheres[{receiver}]" if over < 0 else ("plane", "plane.checker")[over]


def material_of(found: Examination, receiver: int) -> Phong:
    """The material of a receiver."""
    measures = found.measures
    if receiver < measures.count:
        return measures.materials[int(measures.material[receiver])]
    return measures.plane_materials[receiver - measures.count]


def _bright(found: Examination) -> Brightness:
    return brightness(found.measures, found.mirrors, found.lamps_before)


def _receivers(found: Examination) -> list[int]:
    return [int(r) for r in np.flatnonzero(found.matters)]


def _term(found: Examination, name: str) -> Iterator[Finding]:
    now, before = getattr(found.lamps, name), getattr(found.lamps_before, name)
    bounds = getattr(_bright(found), name) if found.budget is not None else None
    for receiver in _receivers(found):
        for light in range(len(found.measures.at)):
            subject = f"{place(found, receiver)} from lights[{light}]"
            if now[receiver, light]:
                coefficient = getattr(material_of(found, receiver), name)
                intensity = found.measures.scene.lights[light].intensity
                yield Finding(True, f"coefficient {coefficient}, intensity {intensity}", None, subject)
            elif before[receiver, light] and bounds is not None:
                bound = float(bounds[receiver, light])
                yield Finding(False, f"at most {bound:.6g}, within the tolerance", None, subject, bound)
            else:
                reason, margin = _why_dark(found, receiver, light, name)
                yield Finding(False, reason, margin, subject)


def _why_dark(found: Examination, receiver: int, light: int, term: str) -> tuple[str, float | None]:
    """Why a term of a lamp is 0."""
    measures, unit = found.measures, found.measures.unit
    given = measures.scene.lights[light]
    material = material_of(found, receiver)
    factors = zip(colour(getattr(material, term)), colour(given.intensity), strict=True)
    if not any(k > 0.0 and i > 0.0 for k, i in factors):
        return f"{term} {getattr(material, term)} times intensity {given.intensity} is 0", None
    is_sphere = receiver < measures.count
    if measures.scene.shadows:
        around = np.flatnonzero(enclosing(measures)[:, light])
        around = around[around != receiver]
        if around.size:
            index = int(around[0])
            slack = float(measures.radius[index] - norm(measures.center[index] - measures.at[light])) * unit
            return f"the light is inside spheres[{index}], {slack:.6g} below its surface: dark outside", slack
        if is_sphere and measures.separated[light]:
            return _across(found, light)
    if not is_sphere:
        return _across(found, light)
    radius = float(measures.radius[receiver])
    to_light = measures.at[light] - (0.0 if measures.directional[light] else measures.center[receiver])
    away = float(norm(to_light))
    if not measures.directional[light] and away < radius:
        text = f"the light is inside the sphere, {away * unit:.6g} from its centre: below the horizon of every point"
        return text, (radius - away) * unit
    psi = float(angle(-measures.m[receiver], to_light))
    seen = float(cap_above(measures.distance[receiver : receiver + 1], measures.radius[receiver : receiver + 1])[0])
    lit = np.pi / 2 if measures.directional[light] else float(np.arccos(radius / away))
    text = f"what is lit is not seen: psi {psi:.6g} >= phi_E {seen:.6g} + phi_L {lit:.6g}"
    return text, psi - seen - lit


def _across(found: Examination, light: int) -> tuple[str, float | None]:
    height = float(found.measures.light_heights[0][light])
    if found.measures.directional[light]:
        return f"the light comes from the other side of the plane than the eye: n.l = {height:.6g} < 0", -height
    height *= found.measures.unit
    return f"the light is on the other side of the plane than the eye, at height {height:.6g} < 0", -height


def diffuse_terms(found: Examination) -> Iterator[Finding]:
    """The diffuse term of each receiver and light."""
    return _term(found, "diffuse")


def specular_terms(found: Examination) -> Iterator[Finding]:
    """The specular term of each receiver and light."""
    return _term(found, "specular")


def gates(found: Examination) -> Iterator[Finding]:
    """The gate of each highlight that there is."""
    for receiver in _receivers(found):
        subject, gated = place(found, receiver), material_of(found, receiver).gate_specular
        if not found.lamps.specular[receiver].any():
            yield Finding(False, "there is no specular term to gate", None, subject)
        elif not gated:
            text = "the material asks for the specular term as Phong wrote it, not gated by n.l > 0"
            yield Finding(False, text, None, subject)
        else:
            text = "gate_specular is set: no highlight where the light is below the horizon"
            yield Finding(True, text, None, subject)


def lights(found: Examination) -> Iterator[Finding]:
    """Each light on each receiver."""
    bright = _bright(found) if found.budget is not None else None
    for receiver in _receivers(found):
        for light in range(len(found.measures.at)):
            subject = f"{place(found, receiver)} from lights[{light}]"
            terms = [name for name in ("diffuse", "specular") if getattr(found.lamps, name)[receiver, light]]
            if terms:
                yield Finding(True, f"its {' and '.join(terms)} term", None, subject)
            elif bright is not None and found.lamps_before.any[receiver, light]:
                bound = float(bright.diffuse[receiver, light] + bright.specular[receiver, light])
                yield Finding(False, f"at most {bound:.6g}, within the tolerance", None, subject, bound)
            else:
                first, margin = _why_dark(found, receiver, light, "diffuse")
                second, other = _why_dark(found, receiver, light, "specular")
                known = [slack for slack in (margin, other) if slack is not None]
                text = first if first == second else f"{first}; {second}"
                yield Finding(False, text, min(known, default=None), subject)


def plane_shadows(found: Examination) -> Iterator[Finding]:
    """Each light: on the eye's side of the plane, or dark for every sphere."""
    if found.measures.plane is None:
        yield Finding(False, "the scene has no plane")
        return
    for light in range(len(found.measures.at)):
        subject = f"lights[{light}]"
        if found.measures.separated[light]:
            reason, margin = _across(found, light)
            yield Finding(False, f"{reason}: it is dark for every sphere, without a test", margin, subject)
        else:
            height = float(found.measures.light_heights[0][light])
            text = "the light is on the eye's side of the plane, as is all that is seen"
            yield Finding(
                False, text, height if found.measures.directional[light] else height * found.measures.unit, subject
            )


def shadows(found: Examination) -> Iterator[Finding]:
    """Each other sphere before each lamp."""
    if not found.measures.scene.shadows:
        yield Finding(False, "the scene asks for no shadows")
        return
    receiver, light, blocker = found.blockers
    kept = set(zip(receiver.tolist(), light.tolist(), blocker.tolist(), strict=True))
    for a, lamp in np.argwhere(found.lamps.any).tolist():
        for b in range(found.measures.count):
            if b == a:
                continue
            subject = f"spheres[{b}] on {place(found, a)} from lights[{lamp}]"
            if (a, lamp, b) in kept:
                yield Finding(True, "it may come between", None, subject)
            else:
                reason, margin = _why_clear(found, a, b, lamp)
                yield Finding(False, reason, margin, subject)


def _why_clear(found: Examination, a: int, b: int, light: int) -> tuple[str, float | None]:
    """Why sphere b keeps the light from no point of receiver a."""
    measures, unit = found.measures, found.measures.unit
    size = float(measures.radius[b])
    if a >= measures.count or (measures.beyond_plane[b] and not measures.separated[light]):
        return _why_clear_of_plane(found, b, light)
    between = measures.center[b] - measures.center[a]
    gap, radius = float(norm(between)), float(measures.radius[a])
    if gap + size < radius:
        slack = (radius - gap - size) * unit
        return (
            f"inside the sphere it would darken: |C_A - C_B| + R_B {(gap + size) * unit:.6g} < R_A {radius * unit:.6g}",
            slack,
        )
    if measures.directional[light]:
        towards = measures.at[light]
        aside, ahead = float(norm(cross(between, towards))), float(dot(between, towards))
        if aside > radius + size:
            return f"beside the light's way: {aside * unit:.6g} > R_A + R_B", (aside - radius - size) * unit
        return f"farther from the light: w.(C_B - C_A) {ahead * unit:.6g} <= 0, disjoint", (gap - radius - size) * unit
    to_a, to_b = measures.center[a] - measures.at[light], measures.center[b] - measures.at[light]
    d, q = float(norm(to_a)), float(norm(to_b))
    power_a, power_b = (d - radius) * (d + radius), (q - size) * (q + size)
    gamma = float(angle(to_a, to_b))
    if d > radius and q > size:
        alpha, beta = float(np.arcsin(radius / d)), float(np.arcsin(size / q))
        if gamma > alpha + beta:
            text = f"cones from the light apart: gamma {gamma:.6g} > alpha {alpha:.6g} + beta {beta:.6g}"
            return text, gamma - alpha - beta
    if gap > radius + size and power_b > power_a:
        text = f"behind: power of the light {power_b * unit**2:.6g} >= {power_a * unit**2:.6g}, disjoint"
        return text, (power_b - power_a) * unit**2
    return "misses the hull of the light and the sphere", None


def _why_clear_of_plane(found: Examination, b: int, light: int) -> tuple[str, float | None]:
    measures, unit = found.measures, found.measures.unit
    height, size = float(measures.sphere_heights[0][b]) * unit, float(measures.radius[b]) * unit
    up = float(measures.light_heights[0][light]) * unit
    if not measures.separated[light]:
        if height + size < 0.0:
            return f"below the plane: its top at {height + size:.6g} <= 0", -height - size
        if not measures.directional[light] and height - size > up:
            return f"above the light: its bottom at {height - size:.6g} >= {up:.6g}", height - size - up
    elif height - size > 0.0:
        return f"above the plane, the light below: its bottom at {height - size:.6g} >= 0", height - size
    elif not measures.directional[light] and height + size < up:
        return (
            f"below the light, and that below the plane: its top at {height + size:.6g} <= {up:.6g}",
            up - height - size,
        )
    return "its shadow falls outside the window", None


def clipping(found: Examination) -> Iterator[Finding]:
    """The largest value of each receiver and of the background, with what mirrors add."""
    bright = _bright(found)
    passed = bright.passed_on(found.mirrors.bounces)
    reflected = bright.brightest * (passed - 1.0)
    tops = [(place(found, r), float(bright.receiver[r])) for r in _receivers(found)]
    tops = [(name, own + (reflected if found.mirrors.bounces else 0.0)) for name, own in tops]
    for name, top in (*tops, ("background", bright.background)):
        if top <= 1.0:
            yield Finding(False, f"at most {top:.6g} <= 1", 1.0 - top, name)
        else:
            yield Finding(True, f"up to {top:.6g} > 1", None, name)
