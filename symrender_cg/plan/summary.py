"""The sum of what was found for an effect: counts, without a list of subjects, however many there are.

Comes in: an Examination. Goes out: Tally. Never done here: a decision about one subject (see `findings`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symrender_cg.plan.examination import Examination
from symrender_cg.plan.flags import fades
from symrender_cg.plan.tolerance import brightness
from symrender_cg.plan.visibility import at_eye
from symrender_cg.scene import DirectionalLight, Gradient


@dataclass(frozen=True, slots=True)
class Tally:
    """Whether the effect is needed anywhere, in words and numbers; its bound; how many subjects were examined."""

    needed: bool
    reason: str
    subjects: int
    bound: float | None = None


def _many(count: int, what: str) -> str:
    """`1 sphere`, `3 spheres`."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _left_out(some: int, of: int, where: str) -> Tally:
    if some == 0:
        return Tally(False, f"no sphere of {of} {where}", of)
    return Tally(False, f"{some} of {_many(of, 'sphere')} {where}", of)


def behind_eye_tally(found: Examination) -> Tally:
    return _left_out(int(found.views.behind.sum()), found.measures.count, "wholly behind the plane of the eye")


def in_view_tally(found: Examination) -> Tally:
    count = found.measures.count
    if found.views.aspect is None:
        return Tally(False, "no window: any point of the image plane may be asked for", count)
    return _left_out(int(found.views.outside.sum()), count, f"outside the window of aspect {found.views.aspect:.6g}")


def hidden_tally(found: Examination) -> Tally:
    views = found.views
    kinds = ((views.beyond, "beyond the plane"), (views.contained, "inside another"), (views.hidden, "behind another"))
    told = ", ".join(f"{int(some.sum())} {where}" for some, where in kinds if some.any())
    total = int((views.beyond | views.contained | views.hidden).sum())
    return _left_out(total, found.measures.count, f"wholly hidden{f': {told}' if told else ''}")


def order_tally(found: Examination) -> Tally:
    visible = found.views.visible
    i, j, _ = found.views.touching
    cut, count = int((visible[i] & visible[j]).sum()), int(visible.sum())
    pairs = count * (count - 1) // 2
    if cut:
        return Tally(True, f"{cut} of {_many(pairs, 'pair')} of visible spheres not proved disjoint", pairs)
    if pairs == 0:
        return Tally(False, "fewer than two spheres are visible", pairs)
    text = f"{_many(pairs, 'pair')} of visible spheres disjoint: the smaller power of the eye is in front on every ray"
    return Tally(False, text, pairs)


def off_axis_tally(found: Examination) -> Tally:
    del found
    return Tally(True, "the kernel of a scene takes spheres anywhere", 1)


def front_test_tally(found: Examination) -> Tally:
    seen = at_eye(found.measures)[found.views.visible]
    near, count = int(seen.sum()), len(seen)
    if near:
        return Tally(True, f"{near} of {_many(count, 'visible sphere')} at the plane of the eye or far aside", count)
    return Tally(False, f"{_many(count, 'visible sphere')} wholly before the eye", count)


def self_shadow_tally(found: Examination) -> Tally:
    text = "a sphere is convex: where n.l > 0 the way to the light leaves it; where not, diffuse is 0"
    return Tally(False, text, int(found.matters[: found.measures.count].sum()))


def plane_tally(found: Examination) -> Tally:
    if found.measures.plane is None:
        return Tally(False, "the scene has no plane", 1)
    if found.views.plane_seen:
        return Tally(True, "some ray of the window falls towards it", 1)
    if found.mirrors.mirrored[found.measures.count :].any():
        return Tally(True, "a mirror may show it", 1)
    return Tally(False, "above the horizon at every corner of the window, and no mirror shows it", 1)


def checker_tally(found: Examination) -> Tally:
    plane = found.measures.plane
    if plane is None or plane.checker is None:
        return Tally(False, "the scene has no plane" if plane is None else "the plane has one material", 1)
    if len(found.measures.plane_materials) > 1:
        return Tally(True, "tiles of both kinds may be seen", 1)
    if plane.checker == plane.material:
        return Tally(False, "both materials are the same", 1)
    return Tally(False, "the corners of the window fall into one tile, and so does all between them", 1)


def _terms(found: Examination, name: str, what: str) -> Tally:
    now, before = getattr(found.lamps, name), getattr(found.lamps_before, name)
    pairs = int(found.matters.sum()) * len(found.measures.at)
    kept, cut = int(now.sum()), int((before & ~now).sum())
    text = f"{kept} of {_many(pairs, 'pair')} of a surface and a light have {what}"
    bound = getattr(found.budget, f"{name}_bound") if found.budget is not None and cut else None
    if cut:
        text += f"; {cut} left out for at most {bound:.6g} in all"
    return Tally(kept > 0, text, pairs, bound)


def diffuse_tally(found: Examination) -> Tally:
    return _terms(found, "diffuse", "a diffuse term")


def specular_tally(found: Examination) -> Tally:
    return _terms(found, "specular", "a specular term")


def specular_gate_tally(found: Examination) -> Tally:
    gated, total = int(found.lamps.gated.sum()), int(found.lamps.specular.sum())
    if gated:
        return Tally(True, f"{gated} of {_many(total, 'highlight')} gated by n.l > 0", int(found.matters.sum()))
    text = "there is no specular term to gate" if not total else "no highlight is to be gated"
    return Tally(False, text, int(found.matters.sum()))


def lights_tally(found: Examination) -> Tally:
    pairs = int(found.matters.sum()) * len(found.measures.at)
    lit, cut = int(found.lamps.any.sum()), int((found.lamps_before.any & ~found.lamps.any).sum())
    text = f"{lit} of {_many(pairs, 'pair')} of a surface and a light"
    if not cut:
        return Tally(lit > 0, text, pairs)
    bound = 0.0 if found.budget is None else found.budget.diffuse_bound + found.budget.specular_bound
    return Tally(lit > 0, f"{text}; {cut} left out for at most {bound:.6g}", pairs, bound)


def shadow_tally(found: Examination) -> Tally:
    if not found.measures.scene.shadows:
        return Tally(False, "the scene asks for no shadows", 1)
    lamps = found.lamps.any
    others = int(lamps[: found.measures.count].sum()) * (found.measures.count - 1)
    pairs = others + int(lamps[found.measures.count :].sum()) * found.measures.count
    kept = len(found.blockers[0])
    return Tally(kept > 0, f"{kept} of {_many(pairs, 'pair')} of a sphere and a lit surface", pairs)


def plane_shadow_tally(found: Examination) -> Tally:
    if found.measures.plane is None:
        return Tally(False, "the scene has no plane", 1)
    count, dark = len(found.measures.at), int(found.measures.separated.sum())
    text = f"{count - dark} of {_many(count, 'light')} on the eye's side of the plane, as is all that is seen"
    if dark and found.measures.scene.shadows:
        text += f"; {_many(dark, 'light')} on the other side, dark for every sphere"
    return Tally(False, text, count)


def mirror_tally(found: Examination) -> Tally:
    mirrors, count = found.mirrors, found.measures.count
    if not mirrors.bounces:
        bound = None if found.budget is None or not found.budget.depth_bound else found.budget.depth_bound
        text = "no surface that is seen mirrors anything" if bound is None else f"reflections add at most {bound:.6g}"
        return Tally(False, text, int(found.matters.sum()), bound)
    pairs = sum(count - (receiver < count) for receiver in mirrors.seen)
    kept = sum(len(others) for others in mirrors.seen.values())
    text = f"{_many(len(mirrors.seen), 'mirror')}, {kept} of {_many(pairs, 'pair')} of a sphere and a mirror"
    return Tally(True, text, pairs + int(mirrors.plane.sum()) + int((found.matters & ~mirrors.mirror).sum()))


def mirror_depth_tally(found: Examination) -> Tally:
    limit, bounces, budget = found.measures.scene.max_bounces, found.mirrors.bounces, found.budget
    bound = None if budget is None or not budget.depth_bound else budget.depth_bound
    text = f"{bounces} of {_many(limit, 'bounce')}"
    if bound is not None:
        text += f"; deeper ones add at most {bound:.6g}"
    elif bounces < limit:
        text += ": no longer chain of mirrors that may see one another"
    return Tally(bounces > 1, text, max(limit, 1), bound)


def attenuation_tally(found: Examination) -> Tally:
    lights = found.measures.scene.lights
    used = np.any(found.lamps.any, axis=0)
    fading = sum(1 for light, lit in zip(lights, used, strict=True) if lit and fades(light))
    if fading:
        return Tally(
            True, f"{fading} of {_many(len(lights), 'light')} with (a, b, c) other than (1, 0, 0)", len(lights)
        )
    return Tally(False, "every light that lights anything is as strong at every distance", len(lights))


def directional_tally(found: Examination) -> Tally:
    lights = found.measures.scene.lights
    some = sum(isinstance(light, DirectionalLight) for light in lights)
    return Tally(some > 0, f"{some} of {_many(len(lights), 'light')} from a direction", len(lights))


def gradient_tally(found: Examination) -> Tally:
    background = found.measures.scene.background
    if not isinstance(background, Gradient):
        return Tally(False, f"the background is {background} in every direction", 1)
    if background.bottom == background.top:
        return Tally(False, f"bottom and top are both {background.bottom}", 1)
    return Tally(True, f"from {background.bottom} below to {background.top} above", 1)


def colour_tally(found: Examination) -> Tally:
    if not found.measures.scene.is_grey:
        return Tally(True, "a colour of the scene is not grey", 1)
    return Tally(False, "every colour of the scene is grey: one channel", 1)


def clip_tally(found: Examination) -> Tally:
    bright = brightness(found.measures, found.mirrors, found.lamps_before)
    own = np.where(found.matters, bright.receiver, 0.0)
    top = max(float(own.max(initial=0.0)), bright.background) * bright.passed_on(found.mirrors.bounces)
    relation = "<=" if top <= 1.0 else ">"
    return Tally(top > 1.0, f"values up to {top:.6g} {relation} 1", int(found.matters.sum()) + 1)
