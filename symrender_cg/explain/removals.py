"""A scene without one of its effects: what is left to draw when it is taken out of the scene, not of the kernel.

Comes in: a scene in the camera's frame, an effect's name. Goes out: the other scene and what was done, in words, or
None where the effect is no matter of choice (how spheres lie). Never done here: rendering.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from msgspec import structs

from symrender_cg.plan.flags import fades
from symrender_cg.scene import Colour, Gradient, Phong, Scene


def without(scene: Scene, effect: str) -> tuple[Scene, str] | None:
    """The scene without that effect, and what was done in words."""
    removal = REMOVALS.get(effect)
    if removal is None:
        return None
    what, change = removal
    return change(scene), what


def _materials(scene: Scene, change: Callable[[Phong], Phong]) -> Scene:
    """The scene with every material changed."""
    spheres = tuple(structs.replace(sphere, material=change(sphere.material)) for sphere in scene.spheres)
    plane = scene.plane
    if plane is not None:
        checker = None if plane.checker is None else change(plane.checker)
        plane = structs.replace(plane, material=change(plane.material), checker=checker)
    return structs.replace(scene, spheres=spheres, plane=plane)


def _with(**changes: Any) -> Callable[[Scene], Scene]:
    return lambda scene: structs.replace(scene, **changes)


def _material_with(**changes: Any) -> Callable[[Scene], Scene]:
    return lambda scene: _materials(scene, lambda material: structs.replace(material, **changes))


def _plain(scene: Scene) -> Scene:
    return scene if scene.plane is None else structs.replace(scene, plane=structs.replace(scene.plane, checker=None))


def _steady(scene: Scene) -> Scene:
    lights = (structs.replace(a, attenuation=(1.0, 0.0, 0.0)) if fades(a) else a for a in scene.lights)
    return structs.replace(scene, lights=tuple(lights))


def _channels(colour: Colour) -> tuple[float, float, float]:
    return colour if isinstance(colour, tuple) else (colour, colour, colour)


def _flat(scene: Scene) -> Scene:
    background = scene.background
    if not isinstance(background, Gradient):
        return scene
    pairs = zip(_channels(background.bottom), _channels(background.top), strict=True)
    red, green, blue = (0.5 * bottom + 0.5 * top for bottom, top in pairs)
    coloured = isinstance(background.bottom, tuple) or isinstance(background.top, tuple)
    return structs.replace(scene, background=(red, green, blue) if coloured else red)


def _mean(colour: Colour) -> float:
    return sum(channel / 3.0 for channel in colour) if isinstance(colour, tuple) else colour


def _grey(scene: Scene) -> Scene:
    def material(given: Phong) -> Phong:
        names = ("ambient", "diffuse", "specular")
        return structs.replace(given, **{name: _mean(getattr(given, name)) for name in names})

    background = scene.background
    if isinstance(background, Gradient):
        grey: float | Gradient = Gradient(_mean(background.bottom), _mean(background.top), background.up)
    else:
        grey = _mean(background)
    lights = tuple(structs.replace(light, intensity=_mean(light.intensity)) for light in scene.lights)
    return structs.replace(_materials(scene, material), lights=lights, background=grey)


REMOVALS: Final[dict[str, tuple[str, Callable[[Scene], Scene]]]] = {
    "diffuse": ("diffuse = 0", _material_with(diffuse=0.0)),
    "specular": ("specular = 0", _material_with(specular=0.0)),
    "specular_gate": ("gate_specular = false", _material_with(gate_specular=False)),
    "plane": ("no plane", _with(plane=None)),
    "checker": ("no checker", _plain),
    "lights": ("no lights", _with(lights=())),
    "shadow": ("shadows = false", _with(shadows=False)),
    "mirror": ("max_bounces = 0", _with(max_bounces=0)),
    "mirror_depth": ("max_bounces = 1", _with(max_bounces=1)),
    "attenuation": ("attenuation = [1, 0, 0]", _steady),
    "gradient": ("background = its middle", _flat),
    "colour": ("colours = their means", _grey),
}
