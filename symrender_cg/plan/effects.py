"""The registry of effects: for each, the condition under which it provably cannot change the image.

A condition is evaluated exactly, in rationals, on the camera-frame float64 numbers; tangency counts as needed.
Adding an effect is adding an entry here, a place in the derivation, and its tests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from symrender_cg.scene import Scene


@dataclass(frozen=True, slots=True)
class Finding:
    """What examining a scene for one effect found; the margin is the slack of the inequality in the reason."""

    needed: bool
    reason: str
    margin: float | None = None


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect: what it is, what leaving it out removes from the kernel, and how a scene is examined for it.

    `optional` effects may be forced in; the others are facts of the geometry that no kernel has a use for.
    """

    name: str
    title: str
    removes: str
    examine: Callable[[Scene], Finding]
    optional: bool = True


FARTHEST_ASIDE = 256
"""How far off the axis a sphere may be seen, in its depth: the normal from the image of the centre loses so many units
of its last place, and beyond it the kernel for a sphere in the plane of the eye is the accurate one."""


def _off_axis(scene: Scene) -> Finding:
    x, y, z = scene.spheres[0].center
    if x == y == z == 0.0:
        return Finding(False, "the centre is the point looked at: disc depends on x^2 + y^2 alone")
    return Finding(True, f"the centre ({x:.6g}, {y:.6g}, {z:.6g}) is not the point looked at")


def _front_test(scene: Scene) -> Finding:
    sphere = scene.spheres[0]
    eye = Fraction(scene.camera.eye[2])
    depth = eye - Fraction(sphere.center[2])
    margin = float(depth - Fraction(sphere.radius))
    aside = max(abs(sphere.center[0]), abs(sphere.center[1]))
    if depth > Fraction(sphere.radius) and Fraction(aside) > FARTHEST_ASIDE * depth:
        return Finding(
            True,
            f"the sphere is seen {aside / float(depth):.3g} times its depth off the axis, all but in the eye's plane",
            margin,
        )
    if depth > Fraction(sphere.radius):
        return Finding(
            False,
            f"the sphere lies wholly before the eye: depth of its centre {float(depth):.6g} > R {sphere.radius:.6g}",
            margin,
        )
    return Finding(
        True, f"the sphere reaches the plane of the eye: depth {float(depth):.6g} <= {sphere.radius:.6g}", margin
    )


def _diffuse(scene: Scene) -> Finding:
    coefficient, intensity = scene.spheres[0].material.diffuse, scene.lights[0].intensity
    if coefficient == 0.0 or intensity == 0.0:
        return Finding(False, f"diffuse {coefficient:.6g} times light intensity {intensity:.6g} is 0")
    return Finding(True, f"diffuse coefficient {coefficient:.6g}, light intensity {intensity:.6g}")


def _specular(scene: Scene) -> Finding:
    coefficient, intensity = scene.spheres[0].material.specular, scene.lights[0].intensity
    if coefficient == 0.0 or intensity == 0.0:
        return Finding(False, f"specular {coefficient:.6g} times light intensity {intensity:.6g} is 0")
    return Finding(True, f"specular coefficient {coefficient:.6g}, light intensity {intensity:.6g}")


def _specular_gate(scene: Scene) -> Finding:
    if not scene.spheres[0].material.gate_specular:
        return Finding(False, "the material asks for the specular term as Phong wrote it, not gated by n.l > 0")
    if not _specular(scene).needed:
        return Finding(False, "there is no specular term to gate")
    return Finding(True, "gate_specular is set: no highlight where the light is below the horizon")


def _self_shadow(scene: Scene) -> Finding:
    del scene
    return Finding(False, "a sphere is convex: where n.l > 0 the way to the light leaves it; where not, diffuse is 0")


EFFECTS: tuple[Effect, ...] = (
    Effect("off_axis", "sphere off the axis", "the image of the centre, the tilt of the conic", _off_axis),
    Effect("front_test", "sphere at the plane of the eye", "the test m.D > 0; a row's hits are one span", _front_test),
    Effect("diffuse", "diffuse term", "max(0, n.l)", _diffuse),
    Effect("specular", "specular term", "the mirrored ray and the power", _specular),
    Effect("specular_gate", "gated specular", "the test n.l > 0 of the highlight", _specular_gate),
    Effect("self_shadow", "shadow of the sphere on itself", "a shadow ray", _self_shadow, optional=False),
)
