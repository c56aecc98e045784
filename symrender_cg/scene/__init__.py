"""The scene: what is to be seen, checked when it is made, and its numbers in the camera's frame.

    model           Scene
    camera          Camera
    surfaces        Sphere, Plane, Gradient
    materials       Phong
    lights          PointLight, DirectionalLight
    values          checks of single numbers, colours, vectors and switches
    exact           whole-number arithmetic on lengths, rounded once
    brightest       refuses intensities beyond float64
    camera_frame    Scene -> the same scene seen from (0, 0, e)
    turning         points and directions -> their coordinates in that frame
    framing         spheres -> the half-height that frames them
    files           TOML text <-> Scene
    builtin         scenes by name; load_scene
    random          scenes of many random disjoint spheres

Never done here: rendering, symbols, or a decision about effects. Importing it loads no numpy and no sympy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from symrender_cg.scene.exact import Vector
from symrender_cg.scene.model import (
    Camera,
    Colour,
    DirectionalLight,
    Gradient,
    Light,
    Phong,
    Plane,
    PointLight,
    Scene,
    Sphere,
)

if TYPE_CHECKING:
    from pathlib import Path

__all__ = [
    "Camera",
    "Colour",
    "DirectionalLight",
    "Gradient",
    "Light",
    "Phong",
    "Plane",
    "PointLight",
    "Scene",
    "Sphere",
    "Vector",
    "load_scene",
]


def load_scene(name_or_path: str | Path | Scene | None) -> Scene:
    """The scene that a user names: None is Chapter 1's, a Scene is itself, a file is read, else a built-in name.

    A Path, an existing file, and anything that ends in .toml is a file. Raises SceneError for anything else that is not
    the name of a built-in scene.
    """
    if name_or_path is None:
        return Scene.chapter1()
    from symrender_cg.scene.builtin import named_scene

    return named_scene(name_or_path)
