"""What the C text of a scene kernel depends on: its flags, and a name made of them.

Comes in: Arrangement and scene. Goes out: flags, a name. Never done here: a decision about what can be seen.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from symrender_cg.scene import Gradient, PointLight, Scene

if TYPE_CHECKING:
    from symrender_cg.plan.arrangement import Arrangement


def scene_flags(scene: Scene, found: Arrangement, force: Collection[str] = ()) -> frozenset[str]:
    """The flags that hold.

    Of: spans, at_eye, intersections, plane, checker, crossing, diffuse, specular, specular_gate, attenuation, shadows,
    mirrors, gradient, colour.
    """
    near = bool(found.at_eye.any())
    plane = found.plane_seen or found.plane_mirrored
    lights = (scene.lights[light] for light in set(found.lamp_light.tolist()))
    background = scene.background
    flags = {
        "spans": not bool(found.at_eye.all()),
        "at_eye": near,
        "intersections": bool(found.partners.size),
        "plane": plane,
        "checker": plane and len(found.plane_materials) > 1,
        "crossing": found.plane_seen and bool(found.crosses_plane[: found.visible].any()),
        "diffuse": bool(found.lamp_diffuse.any()),
        "specular": bool(found.lamp_specular.any()),
        "specular_gate": bool(found.lamp_gated.any()),
        "attenuation": bool(found.lamp_light.size)
        and ("attenuation" in force or any(fades(light) for light in lights)),
        "shadows": bool(found.blockers.size),
        "mirrors": found.bounces > 0,
        "gradient": isinstance(background, Gradient) and background.bottom != background.top,
        "colour": not scene.is_grey,
    }
    return frozenset(name for name, holds in flags.items() if holds)


def fades(light: object) -> bool:
    """Whether a light's intensity depends on the distance, or is divided by another number than 1."""
    return isinstance(light, PointLight) and light.attenuation != (1.0, 0.0, 0.0)


def scene_name(flags: frozenset[str]) -> str:
    """A C identifier of at most 60 characters, a different one for different flags: `scene_plane_shadow_mirror`, ..."""
    tags = {
        (True, False): (),
        (True, True): ("near",),
        (False, True): ("close",),
        (False, False): ("void",),
    }["spans" in flags, "at_eye" in flags]
    light = {
        (True, True, False): (),
        (True, True, True): ("gated",),
        (False, True, False): ("gloss",),
        (False, True, True): ("glint",),
        (True, False, False): ("matte",),
    }.get(("diffuse" in flags, "specular" in flags, "specular_gate" in flags), ("flat",))
    rest = (
        ("intersections", "cut"),
        ("checker", "tiles") if "checker" in flags else ("plane", "plane"),
        ("crossing", "sunk"),
    )
    more = (
        ("attenuation", "fade"),
        ("shadows", "shadow"),
        ("mirrors", "mirror"),
        ("gradient", "sky"),
        ("colour", "rgb"),
    )
    words = (
        "scene",
        *tags,
        *(tag for flag, tag in rest if flag in flags),
        *light,
        *(tag for flag, tag in more if flag in flags),
    )
    return "_".join(words)
