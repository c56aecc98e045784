"""The numbers of a scene by the names of the inputs of the derivation: what a kernel is called with."""

from __future__ import annotations

from symrender_cg.scene import Colour, Gradient, PointLight, Scene


def numbers_of(scene: Scene) -> dict[str, float]:
    """The camera-frame numbers of a grey scene with one sphere and one point light."""
    frame = scene.in_camera_frame()
    sphere, light = frame.spheres[0], frame.lights[0]
    material, background = sphere.material, frame.background
    assert isinstance(light, PointLight), "the plan chose another kernel"
    assert not isinstance(background, Gradient), "the plan chose another kernel"
    numbers = {
        "eye": frame.camera.eye[2],
        "radius": sphere.radius,
        "light_intensity": _grey(light.intensity),
        "k_ambient": _grey(material.ambient),
        "k_diffuse": _grey(material.diffuse),
        "k_specular": _grey(material.specular),
        "shininess": material.shininess,
        "background": _grey(background),
    }
    for i, axis in enumerate("xyz"):
        numbers[f"center_{axis}"] = sphere.center[i]
        numbers[f"light_{axis}"] = light.position[i]
    return numbers


def _grey(colour: Colour) -> float:
    assert isinstance(colour, float), "the plan chose another kernel"
    return colour
