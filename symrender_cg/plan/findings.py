"""What was found for each subject of an effect: sphere by sphere, pair by pair, with inequality, numbers and margin.

Comes in: an Examination. Goes out: Findings, made on demand, one a subject, in the order of the scene. Whether a
subject is needed is what the examination decided; the numbers beside it are computed again, in scene units and radians,
to be read. Never done here: a decision.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from symrender_cg.plan.effects import Finding, reaches_eye
from symrender_cg.plan.examination import Examination
from symrender_cg.plan.flags import fades
from symrender_cg.plan.measures import angle, cone_above, cone_below, norm
from symrender_cg.scene import DirectionalLight, Gradient


def behind_eye(found: Examination) -> Iterator[Finding]:
    eye = found.measures.scene.camera.eye[2]
    for index, sphere in enumerate(found.measures.scene.spheres):
        depth = eye - sphere.center[2]
        slack, behind = -depth - sphere.radius, bool(found.views.behind[index])
        relation = "<=" if behind else ">"
        yield Finding(
            not behind,
            f"depth of the centre {depth:.6g} {relation} -R {-sphere.radius:.6g}",
            slack if behind else None,
            f"spheres[{index}]",
        )


def in_view(found: Examination) -> Iterator[Finding]:
    measures, aspect = found.measures, found.views.aspect
    for index in range(measures.count):
        subject = f"spheres[{index}]"
        if aspect is None:
            yield Finding(True, "any point of the image plane may be asked for", None, subject)
            continue
        sides = []
        for axis, slope in enumerate(measures.slopes(aspect)):
            reach = float(measures.radius[index]) * math.hypot(1.0, slope)
            place = abs(float(measures.m[index, axis])) + slope * float(measures.m[index, 2])
            side = (("left", "right"), ("lower", "upper"))[axis][int(measures.m[index, axis] > 0.0)]
            sides.append(((place - reach) / math.hypot(1.0, slope) * measures.unit, side))
        slack, side = max(sides)
        out = bool(found.views.outside[index])
        where = f"n.m + R = {-slack:.6g}" if out else f"n.m + R = {-slack:.6g} >= 0"
        text = f"beyond the {side} side of the window: {where} < 0" if out else f"may be in the window: {where}"
        yield Finding(not out, text, slack if out else None, subject)


def hidden(found: Examination) -> Iterator[Finding]:
    views, measures = found.views, found.measures
    unit = measures.unit
    for index in range(measures.count):
        subject, radius = f"spheres[{index}]", float(measures.radius[index])
        if views.beyond[index]:
            height = float(measures.sphere_heights[0][index])
            text = f"beyond the plane: height of the centre {height * unit:.6g} < -R {-radius * unit:.6g}"
            yield Finding(False, text, -(height + radius) * unit, subject)
        elif views.contained[index]:
            gaps = measures.radius - norm(measures.center - measures.center[index]) - radius
            gaps[index] = -np.inf
            outer = int(np.argmax(gaps))
            text = (
                f"inside spheres[{outer}]: |C_A - C_B| + R_B {(float(measures.radius[outer]) - gaps[outer]) * unit:.6g}"
            )
            text += f" < R_A {float(measures.radius[outer]) * unit:.6g}"
            yield Finding(False, text, float(gaps[outer]) * unit, subject)
        elif views.hidden[index]:
            yield _covered(found, index)
        else:
            yield Finding(True, "no single surface hides all of it", None, subject)


def _covered(found: Examination, index: int) -> Finding:
    """The sphere whose cone holds that of another with the most to spare."""
    measures = found.measures
    alpha = cone_below(measures.distance, measures.radius)
    beta = float(cone_above(measures.distance[index : index + 1], measures.radius[index : index + 1])[0])
    gamma = angle(measures.m, np.broadcast_to(measures.m[index], measures.m.shape))
    slack = alpha - gamma - beta
    power = (measures.distance - measures.radius) * (measures.distance + measures.radius)
    slack[~(power < power[index])] = -np.inf
    gap = norm(measures.center - measures.center[index])
    slack[~(gap > measures.radius + measures.radius[index])] = -np.inf
    hider = int(np.argmax(slack))
    return Finding(
        False,
        f"hidden by spheres[{hider}]: gamma {float(gamma[hider]):.6g} + beta {beta:.6g} <= alpha "
        f"{float(alpha[hider]):.6g}, disjoint, power {float(power[hider]) * measures.unit**2:.6g} < "
        f"{float(power[index]) * measures.unit**2:.6g}",
        float(slack[hider]),
        f"spheres[{index}]",
    )


def order(found: Examination) -> Iterator[Finding]:
    measures = found.measures
    i, j, _ = found.views.touching
    touching = set(zip(i.tolist(), j.tolist(), strict=True))
    for a, b in combinations(np.flatnonzero(found.views.visible).tolist(), 2):
        gap = float(norm(measures.center[a] - measures.center[b])) * measures.unit
        reach = float(measures.radius[a] + measures.radius[b]) * measures.unit
        subject = f"spheres[{a}] and spheres[{b}]"
        if (a, b) in touching:
            yield Finding(True, f"not disjoint: distance {gap:.6g} <= {reach:.6g}, the radii together", None, subject)
        else:
            text = f"disjoint: distance {gap:.6g} > {reach:.6g}; the smaller power of the eye is in front on every ray"
            yield Finding(False, text, gap - reach, subject)


def front_test(found: Examination) -> Iterator[Finding]:
    for index in np.flatnonzero(found.views.visible).tolist():
        one = reaches_eye(found.measures.scene, index)
        yield Finding(one.needed, one.reason, one.margin, f"spheres[{index}]")


def off_axis(found: Examination) -> Iterator[Finding]:
    del found
    yield Finding(True, "the kernel of a scene takes spheres anywhere")


def self_shadow(found: Examination) -> Iterator[Finding]:
    for index in np.flatnonzero(found.matters[: found.measures.count]).tolist():
        text = "convex: where n.l > 0 the way to the light leaves it; where not, diffuse is 0"
        yield Finding(False, text, None, f"spheres[{index}]")


def plane(found: Examination) -> Iterator[Finding]:
    views, measures = found.views, found.measures
    if measures.normal is None:
        yield Finding(False, "the scene has no plane")
        return
    mirrored = bool(found.mirrors.mirrored[measures.count :].any())
    seen = "some ray of the window falls towards it" if views.plane_seen else ""
    shown = "a mirror may show it" if mirrored else ""
    if views.plane_seen or mirrored:
        yield Finding(True, "; ".join(filter(None, (seen, shown))), None, "plane")
        return
    x, y, z = (float(v) for v in measures.normal)
    slope_x, slope_y = measures.slopes(views.aspect) if views.aspect is not None else (0.0, 0.0)
    lowest = -abs(x) * slope_x - abs(y) * slope_y - z
    text = (
        f"above the horizon everywhere: least n.D over the corners of the window {lowest:.6g} >= 0, no mirror shows it"
    )
    yield Finding(False, text, lowest, "plane")


def checker(found: Examination) -> Iterator[Finding]:
    plane, measures = found.measures.plane, found.measures
    if plane is None or plane.checker is None:
        yield Finding(False, "the scene has no plane" if plane is None else "the plane has one material")
    elif len(measures.plane_materials) > 1:
        yield Finding(True, "tiles of both kinds may be seen", None, "plane")
    elif plane.checker == plane.material:
        yield Finding(False, "both materials are the same", None, "plane")
    else:
        kind = "odd" if measures.plane_materials[0] == plane.checker else "even"
        yield Finding(
            False, f"the corners of the window fall into one tile, an {kind} one, and so does all between them"
        )


def attenuation(found: Examination) -> Iterator[Finding]:
    used = np.asarray(np.any(found.lamps.any, axis=0))
    for number, light in enumerate(found.measures.scene.lights):
        subject = f"lights[{number}]"
        if isinstance(light, DirectionalLight):
            yield Finding(False, "a light from a direction does not fade", None, subject)
        elif not fades(light):
            yield Finding(False, "(a, b, c) = (1, 0, 0): as strong at every distance", None, subject)
        else:
            a, b, c = light.attenuation
            needed = bool(used[number])
            text = f"1 / ({a:.6g} + {b:.6g} l + {c:.6g} l^2)" if needed else "it lights nothing that is seen"
            yield Finding(needed, text, None, subject)


def directional(found: Examination) -> Iterator[Finding]:
    for number, light in enumerate(found.measures.scene.lights):
        if isinstance(light, DirectionalLight):
            yield Finding(True, "from one direction everywhere", None, f"lights[{number}]")
        else:
            yield Finding(False, f"at the point {light.position}", None, f"lights[{number}]")


def gradient(found: Examination) -> Iterator[Finding]:
    background = found.measures.scene.background
    if not isinstance(background, Gradient):
        yield Finding(False, f"the background is {background} in every direction")
    elif background.bottom == background.top:
        yield Finding(False, f"bottom and top are both {background.bottom}")
    else:
        yield Finding(True, f"from {background.bottom} below to {background.top} above")


def colour(found: Examination) -> Iterator[Finding]:
    if not found.measures.scene.is_grey:
        yield Finding(True, "a colour of the scene is not grey")
    else:
        yield Finding(False, "every colour of the scene is grey: one channel")
