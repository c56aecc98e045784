"""The numbers of a scene by the names of the inputs of the derivation: what a kernel is called with."""

from __future__ import annotations

from symrender_cg.scene import Scene


def numbers_of(scene: Scene) -> dict[str, float]:
    """The camera-frame numbers of a scene with one sphere and one light."""
    frame = scene.in_camera_frame()
    sphere, light = frame.spheres[0], frame.lights[0]
    material = sphere.material
    numbers = {
        "eye": frame.camera.eye[2],
        "radius": sphere.radius,
        "light_intensity": light.intensity,
        "k_ambient": material.ambient,
        "k_diffuse": material.diffuse,
        "k_specular": material.specular,
        "shininess": material.shininess,
        "background": frame.background,
    }
    for i, axis in enumerate("xyz"):
        numbers[f"center_{axis}"] = sphere.center[i]
        numbers[f"light_{axis}"] = light.position[i]
    return numbers
