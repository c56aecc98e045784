"""The registry of effects: what each is, what leaving it out removes, and under which condition it provably may be.

Two groups. SPHERE_EFFECTS decide the kernel of one sphere and one light; each is examined exactly, in rationals, on the
camera-frame float64 numbers. SCENE_EFFECTS decide the arrangement of everything else, subject by subject. An entry
names what finds an effect's subjects with their inequalities, and what tallies them; adding an effect is adding an
entry and what it names, a part of the derivation, and its tests. Tangency counts as needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Literal

from symrender_cg.scene import PointLight, Scene

if TYPE_CHECKING:
    from symrender_cg.plan.examination import Examination
    from symrender_cg.plan.summary import Tally

Status = Literal["needed", "absent", "bounded"]


FARTHEST_ASIDE: Final = 256
"""How far off the axis a sphere may be seen, in its depth: the normal from the image of the centre loses so many units
of its last place, and beyond it the kernel for a sphere in the plane of the eye is the accurate one."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What examining one subject for one effect found; the margin is the slack of the inequality in the reason.

    subject: such as `spheres[3] on spheres[0] from lights[1]`; empty where the effect has only one. bound: what the
    image may change by where the effect is neither needed nor absent, but left out within a tolerance.
    """

    needed: bool
    reason: str
    margin: float | None = None
    subject: str = ""
    bound: float | None = None

    @property
    def status(self) -> Status:
        """`needed`, `absent` or `bounded`, the words that are printed."""
        return "needed" if self.needed else "absent" if self.bound is None else "bounded"


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect: what it is, what leaving it out removes from the kernel, and the condition under which it is absent.

    `examine` is that of SPHERE_EFFECTS. `find` gives the finding of each subject, `tally` sums them up. `optional`
    effects may be forced in; the others are facts of the geometry that no kernel has a use for, or what the shape of
    the image asks for.
    """

    name: str
    title: str
    removes: str
    examine: Callable[[Scene], Finding] | None = None
    optional: bool = True
    condition: str = ""
    source: str = ""
    find: Callable[[Examination], Iterator[Finding]] = field(kw_only=True)
    tally: Callable[[Examination], Tally] = field(kw_only=True)


def _later(module: str, name: str) -> Callable[[Examination], Any]:
    """A function of a module of this package that is imported when it is first called: few plans are explained."""

    def call(found: Examination) -> Any:
        return getattr(import_module(f"symrender_cg.plan.{module}"), name)(found)

    return call


def _off_axis(scene: Scene) -> Finding:
    x, y, z = scene.spheres[0].center
    if x == y == z == 0.0:
        return Finding(False, "the centre is the point looked at: disc depends on x^2 + y^2 alone")
    return Finding(True, f"the centre ({x:.6g}, {y:.6g}, {z:.6g}) is not the point looked at")


def _front_test(scene: Scene) -> Finding:
    return reaches_eye(scene, 0)


def reaches_eye(scene: Scene, index: int) -> Finding:
    """Whether a sphere reaches the plane of the eye, or is seen so far aside that it all but does."""
    sphere = scene.spheres[index]
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


def _term(scene: Scene, name: str) -> Finding:
    coefficient, light = getattr(scene.spheres[0].material, name), scene.lights[0]
    assert isinstance(light, PointLight), "one sphere's kernel has a point light"
    intensity = light.intensity
    if coefficient == 0.0 or intensity == 0.0:
        return Finding(False, f"{name} {coefficient:.6g} times light intensity {intensity:.6g} is 0")
    return Finding(True, f"{name} coefficient {coefficient:.6g}, light intensity {intensity:.6g}")


def _diffuse(scene: Scene) -> Finding:
    return _term(scene, "diffuse")


def _specular(scene: Scene) -> Finding:
    return _term(scene, "specular")


def _specular_gate(scene: Scene) -> Finding:
    if not scene.spheres[0].material.gate_specular:
        return Finding(False, "the material asks for the specular term as Phong wrote it, not gated by n.l > 0")
    if not _specular(scene).needed:
        return Finding(False, "there is no specular term to gate")
    return Finding(True, "gate_specular is set: no highlight where the light is below the horizon")


def _self_shadow(scene: Scene) -> Finding:
    del scene
    return Finding(False, "a sphere is convex: where n.l > 0 the way to the light leaves it; where not, diffuse is 0")


SPHERE_EFFECTS: tuple[Effect, ...] = (
    Effect(
        "off_axis",
        "sphere off the axis",
        "the image of the centre, the tilt of the conic",
        _off_axis,
        find=_later("findings", "off_axis"),
        tally=_later("summary", "off_axis_tally"),
    ),
    Effect(
        "front_test",
        "sphere at the plane of the eye",
        "the test m.D > 0; a row's hits are one span",
        _front_test,
        condition="depth of the centre > R, and not 256 times farther off the axis",
        find=_later("findings", "front_test"),
        tally=_later("summary", "front_test_tally"),
    ),
    Effect(
        "diffuse",
        "diffuse term",
        "max(0, n.l)",
        _diffuse,
        condition="k_d I = 0, or psi >= phi_E + phi_L: the caps that eye and light see are apart",
        source="Phong 1975",
        find=_later("lighting_findings", "diffuse_terms"),
        tally=_later("summary", "diffuse_tally"),
    ),
    Effect(
        "specular",
        "specular term",
        "the mirrored ray and the power",
        _specular,
        condition="k_s I = 0, or the caps apart where the highlight is gated",
        source="Phong 1975",
        find=_later("lighting_findings", "specular_terms"),
        tally=_later("summary", "specular_tally"),
    ),
    Effect(
        "specular_gate",
        "gated specular",
        "the test n.l > 0 of the highlight",
        _specular_gate,
        find=_later("lighting_findings", "gates"),
        tally=_later("summary", "specular_gate_tally"),
    ),
    Effect(
        "self_shadow",
        "shadow of the sphere on itself",
        "a shadow ray",
        _self_shadow,
        optional=False,
        condition="convex",
        find=_later("findings", "self_shadow"),
        tally=_later("summary", "self_shadow_tally"),
    ),
)

SCENE_EFFECTS: tuple[Effect, ...] = (
    Effect(
        "behind_eye",
        "spheres behind the eye",
        "the sphere, from what the eye sees",
        condition="depth of the centre <= -R (exact)",
        find=_later("findings", "behind_eye"),
        tally=_later("summary", "behind_eye_tally"),
    ),
    Effect(
        "in_view",
        "spheres outside the window",
        "the sphere, from what the eye sees",
        condition="n.m <= -R for the inward unit normal n of one side of the window",
        source="view frustum culling, Clark 1976",
        find=_later("findings", "in_view"),
        tally=_later("summary", "in_view_tally"),
    ),
    Effect(
        "hidden",
        "hidden spheres",
        "the sphere, from what the eye sees",
        condition="gamma + beta <= alpha and pow_A(E) < pow_B(E), A and B disjoint; B inside A; the plane between",
        find=_later("findings", "hidden"),
        tally=_later("summary", "hidden_tally"),
    ),
    Effect(
        "order",
        "order along the ray",
        "the comparison of depths; the first hit is the last",
        condition="|C_A - C_B| >= R_A + R_B: the smaller power |E - C|^2 - R^2 is in front on every ray",
        source="power diagrams, Aurenhammer 1987",
        find=_later("findings", "order"),
        tally=_later("summary", "order_tally"),
    ),
    Effect(
        "plane",
        "the plane",
        "the plane",
        condition="n.D >= 0 at the four corners of the window, no mirror shows it",
        find=_later("findings", "plane"),
        tally=_later("summary", "plane_tally"),
    ),
    Effect(
        "checker",
        "tiles of the plane",
        "floor and parity",
        condition="equal materials, or the quadrangle that the window cuts out lies in one tile",
        find=_later("findings", "checker"),
        tally=_later("summary", "checker_tally"),
    ),
    Effect(
        "lights",
        "lights on surfaces",
        "the light, from the sum on that surface",
        condition="both its terms absent; inside another sphere; on the other side of the plane",
        find=_later("lighting_findings", "lights"),
        tally=_later("summary", "lights_tally"),
    ),
    Effect(
        "shadow",
        "shadows of spheres",
        "the test of that blocker",
        condition="B misses the hull of the light and A; on the plane: B below it or above the light",
        source="shadow volumes, Crow 1977",
        find=_later("lighting_findings", "shadows"),
        tally=_later("summary", "shadow_tally"),
    ),
    Effect(
        "plane_shadow",
        "shadow of the plane",
        "the test of the plane",
        optional=False,
        condition="what is seen is on the eye's side of the plane: a light is there too, or dark for every sphere",
        find=_later("lighting_findings", "plane_shadows"),
        tally=_later("summary", "plane_shadow_tally"),
    ),
    Effect(
        "mirror",
        "reflections",
        "the test of the mirrored ray against that surface",
        condition="reflect = 0; or below the tangent plane of every visible point; mirror image outside the window",
        source="Whitted 1980",
        find=_later("mirror_findings", "mirrors"),
        tally=_later("summary", "mirror_tally"),
    ),
    Effect(
        "mirror_depth",
        "reflections of reflections",
        "deeper bounces",
        condition="no longer chain of mirrors that may see one another",
        source="Whitted 1980",
        find=_later("mirror_findings", "depths"),
        tally=_later("summary", "mirror_depth_tally"),
    ),
    Effect(
        "attenuation",
        "lights that fade with distance",
        "1 / (a + b l + c l^2)",
        condition="(a, b, c) = (1, 0, 0)",
        find=_later("findings", "attenuation"),
        tally=_later("summary", "attenuation_tally"),
    ),
    Effect(
        "directional",
        "lights from a direction",
        "the light's direction as a constant",
        optional=False,
        condition="the light is at a point",
        find=_later("findings", "directional"),
        tally=_later("summary", "directional_tally"),
    ),
    Effect(
        "gradient",
        "background in two colours",
        "the background's blend",
        optional=False,
        condition="bottom = top, or one background for all directions",
        find=_later("findings", "gradient"),
        tally=_later("summary", "gradient_tally"),
    ),
    Effect(
        "colour",
        "colour",
        "two of three channels",
        optional=False,
        condition="every colour of the scene is grey",
        find=_later("findings", "colour"),
        tally=_later("summary", "colour_tally"),
    ),
    Effect(
        "clip",
        "clipping at 1",
        "the upper clamp, when the image is clipped",
        optional=False,
        condition="k_a + sum of I (k_d + k_s), and what mirrors add, <= 1",
        find=_later("lighting_findings", "clipping"),
        tally=_later("summary", "clip_tally"),
    ),
)

EFFECTS: tuple[Effect, ...] = SPHERE_EFFECTS + SCENE_EFFECTS

SCENE = "scene"
"""Not an effect: forcing it takes the kernel of many-sphere scenes for any scene."""


def effect(name: str) -> Effect:
    """The effect of that name. Raises KeyError where there is none."""
    for entry in EFFECTS:
        if entry.name == name:
            return entry
    raise KeyError(name)
