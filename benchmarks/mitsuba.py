"""The peer Mitsuba 3: what its rays meet, and a Phong picture of spheres made of its rays.

Comes in: a Scene, and the size of an image. Goes out: depth, normal and index of every pixel (`layers`), and calls that
draw direct light with hard shadows (`picture`). Never done here: a judgement; agreement.py compares.

Mitsuba has no Phong material of the seed's kind, so it is asked for geometry: rays from the eye through exactly our
pixel centres, computed in float64 and rounded to the float32 that its wheels work in. Variant `llvm_ad_mono`: Embree
finds the hits, Dr.Jit compiles the arithmetic around them, so libLLVM is needed. Spheres are `sphere` shapes (its
`ellipsoids`, faster with thousands, draw other pictures: measured 24,547 wrong indices of 262,144 with 1,000 spheres).
A plane is a `rectangle` that ends at PLANE_REACH times the scene's extent.

Two ways to the same picture, because they differ by a factor of 50 with 10,000 spheres:
    as is    Scene.ray_intersect: every shape computes its own surface interaction, called through a dispatch
    lean     Scene.ray_intersect_preliminary: distance and shape alone; the normal is (P - C) / R, C gathered by index
Both then test one shadow ray and evaluate Phong's formula in Dr.Jit.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import Spread, spread
from symrender_cg import Scene
from symrender_cg.errors import ArgumentError
from symrender_cg.scene import Plane, PointLight

VARIANT: Final = "llvm_ad_mono"
INSTALL: Final = "pip install mitsuba; apt-get install libllvm15"
PLANE_REACH: Final = 1000.0
OFFSET: Final = 1e-7
"""Shadow rays of `lean` start this part of the scene's extent above the surface: 1e-4 gave 823 wrong pixels of 262,144
with 1,000 spheres, 1e-7 none; that none is dark by itself is because the gate leaves out rays into the sphere."""


@dataclass(frozen=True, slots=True)
class Layers:
    """Of every pixel: depth (inf at the background), normal (0 there), index (the plane: the number of spheres; -1)."""

    depth: NDArray[np.float64]
    normal: NDArray[np.float64]
    index: NDArray[np.int64]
    milliseconds: Spread


def missing() -> str | None:
    """None where Mitsuba runs here, else what is missing."""
    if find_spec("mitsuba") is None:
        return f"Mitsuba is not installed and left out; {INSTALL}"
    try:
        mi, dr = _modules()
        dr.eval(mi.Float([1.0, 2.0]) + 1.0)
    except Exception as problem:  # whatever its loader raises, the benchmark goes on without it
        return f"Mitsuba's variant {VARIANT} does not run and is left out ({problem}); {INSTALL}"
    return None


def version() -> str:
    """Mitsuba's version and variant."""
    mi, dr = _modules()
    llvm = ".".join(str(part) for part in dr.detail.llvm_version())
    return f"Mitsuba {mi.__version__}, {VARIANT}, Dr.Jit {dr.__version__}, LLVM {llvm}"


def _modules() -> tuple[Any, Any]:
    mi = import_module("mitsuba")
    if mi.variant() != VARIANT:
        mi.set_variant(VARIANT)
    return mi, import_module("drjit")


class Loaded:
    """A scene of spheres and a plane in Mitsuba, and the rays of an image. threads: of Dr.Jit and Embree."""

    def __init__(self, scene: Scene, width: int, height: int, threads: int) -> None:
        self.mi, self.dr = _modules()
        self.dr.set_thread_count(threads)
        self.frame = scene.in_camera_frame()
        self.shape = (height, width)
        spheres = self.frame.spheres
        shapes: dict[str, Any] = {"type": "scene"}
        for number, sphere in enumerate(spheres):
            shapes[f"surface_{number}"] = {"type": "sphere", "center": list(sphere.center), "radius": sphere.radius}
        reach = [abs(c) + s.radius for s in spheres for c in s.center]
        reach += [abs(c) for light in self.frame.lights if isinstance(light, PointLight) for c in light.position]
        self.extent = max((self.frame.camera.eye[2], *reach))
        if self.frame.plane is not None:
            shapes[f"surface_{len(spheres)}"] = self._rectangle(self.frame.plane)
        self.scene = self.mi.load_dict(shapes)
        self.surface_of_shape = self._surfaces()
        centers = np.array([s.center for s in spheres], dtype=np.float32).reshape(-1, 3)
        self.centers = self.mi.Point3f(*(self.mi.Float(np.ascontiguousarray(column)) for column in centers.T))
        self.eye, self.toward = self._rays(width, height)

    def _rectangle(self, plane: Plane) -> dict[str, Any]:
        """The square of side 2 PLANE_REACH extent around the foot of the eye on the plane."""
        n = np.array(plane.normal) / np.linalg.norm(plane.normal)
        u = np.cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.7 else (0.0, 1.0, 0.0))
        u /= np.linalg.norm(u)
        eye = np.array(self.frame.camera.eye)
        foot = eye - n * (n @ (eye - np.array(plane.point)))
        size = PLANE_REACH * max(self.extent, float(np.abs(foot).max()))
        matrix = np.eye(4)
        matrix[:3] = np.stack([size * u, size * np.cross(n, u), n, foot], axis=1)
        return {"type": "rectangle", "to_world": self.mi.ScalarTransform4f(matrix.tolist())}

    def _surfaces(self) -> Any:
        """Our index of each shape, by the number that Dr.Jit knows it by."""
        shapes = self.scene.shapes()
        known = [int(self.dr.reinterpret_array(self.mi.UInt32, self.mi.ShapePtr(shape))[0]) for shape in shapes]
        table = np.zeros(max(known, default=0) + 1, dtype=np.uint32)
        for number, shape in zip(known, shapes, strict=True):
            table[number] = int(shape.id().removeprefix("surface_"))
        return self.mi.UInt32(table)

    def _rays(self, width: int, height: int) -> tuple[Any, Any]:
        """The eye, and unit directions to the pixel centres, each rounded once to float32."""
        e, half = self.frame.camera.eye[2], self.frame.camera.half_height
        assert half is not None, "a camera-frame scene has its half_height"
        pixel = 2.0 * half / height
        x = (np.arange(width) + 0.5 - 0.5 * width) * pixel
        y = (0.5 * height - 0.5 - np.arange(height)) * pixel
        d = np.stack([*(axis.ravel() for axis in np.meshgrid(x, y)), np.full(width * height, -e)])
        d = (d / np.sqrt((d * d).sum(axis=0))).astype(np.float32)
        toward = self.mi.Vector3f(*(self.mi.Float(np.ascontiguousarray(row)) for row in d))
        eye = self.mi.Point3f(0.0, 0.0, e)
        self.dr.make_opaque(eye, toward)
        return eye, toward

    def surface(self, shape: Any, hit: Any) -> Any:
        """Our index of the shapes that were hit."""
        number = self.dr.reinterpret_array(self.mi.UInt32, shape)
        return self.dr.gather(self.mi.UInt32, self.surface_of_shape, number, hit)

    def intersect(self) -> tuple[Any, Any, Any, Any]:
        """(hit, distance, normal, index), computed when this returns."""
        met = self.scene.ray_intersect(self.mi.Ray3f(self.eye, self.toward))
        hit = met.is_valid()
        found = (hit, met.t, met.n, self.surface(met.shape, hit))
        self.dr.eval(*found)
        self.dr.sync_thread()
        return found


def layers(scene: Scene, width: int, height: int, *, threads: int = 1, rounds: int = 5) -> Layers:
    """What the rays of our pixel centres meet; time: a warm ray_intersect with its normal and index."""
    loaded = Loaded(scene, width, height, threads)
    loaded.intersect()
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        found = loaded.intersect()
        seconds.append(1e3 * (time.perf_counter() - start))
    hit, distance, normal, index = (np.asarray(array) for array in found)
    hit = hit.astype(bool)
    n = np.where(hit, normal, 0.0).astype(np.float64)
    n *= np.where((n * np.asarray(loaded.toward)).sum(axis=0) > 0.0, -1.0, 1.0)
    return Layers(
        np.where(hit, distance, np.inf).astype(np.float64).reshape(loaded.shape),
        n.T.reshape(*loaded.shape, 3),
        np.where(hit, index.astype(np.int64), -1).reshape(loaded.shape),
        spread(seconds),
    )


def picture(
    scene: Scene, width: int, height: int, *, threads: int = 1, lean: bool = False
) -> Callable[[], NDArray[np.float32]]:
    """A call that draws the scene anew, (height, width) float32, scene and kernels kept from call to call.

    Only what `scaling` needs. Raises ArgumentError: anything but spheres of one grey, gated, unmirrored material under
    one grey PointLight without attenuation on a grey background.
    """
    material, light, background = _plain(scene)
    loaded = Loaded(scene, width, height, threads)
    mi, dr = loaded.mi, loaded.dr
    ambient, diffuse, specular = (mi.Float(c) for c in (material.ambient, material.diffuse, material.specular))
    shininess, intensity = mi.Float(material.shininess), mi.Float(light.intensity)
    lamp = loaded.frame.lights[0]
    assert isinstance(lamp, PointLight), "_plain refuses every other light"
    position = mi.Point3f(*lamp.position)
    dr.make_opaque(ambient, diffuse, specular, shininess, intensity, position)
    radii = mi.Float(np.array([s.radius for s in scene.spheres], dtype=np.float32))

    def hits() -> tuple[Any, Any, Any]:
        ray = mi.Ray3f(loaded.eye, loaded.toward)
        if not lean:
            met = loaded.scene.ray_intersect(ray)
            return met.is_valid(), met.p, met.n
        near = loaded.scene.ray_intersect_preliminary(ray, coherent=True)
        hit = near.is_valid()
        index = loaded.surface(near.shape, hit)
        center = dr.gather(mi.Point3f, loaded.centers, index, hit)
        n = dr.normalize(loaded.eye + near.t * loaded.toward - center)
        return hit, mi.Point3f(center + dr.gather(mi.Float, radii, index, hit) * n), n

    def draw() -> NDArray[np.float32]:
        hit, point, n = hits()
        w = position - point
        distance = dr.norm(w)
        toward_light = w / distance
        n_dot_l = dr.dot(n, toward_light)
        lit = hit & (n_dot_l > 0.0)
        if scene.shadows:
            start = point + OFFSET * loaded.extent * n
            lit &= ~loaded.scene.ray_test(mi.Ray3f(start, toward_light, distance, 0.0, []), active=lit)
        r_dot_v = dr.dot(toward_light, loaded.toward) - 2.0 * n_dot_l * dr.dot(n, loaded.toward)
        # not dr.maximum: LLVM 14 and 15 cannot compile what it becomes, and end the process
        highlight = dr.select(r_dot_v > 0.0, r_dot_v, 0.0) ** shininess
        shaded = ambient + dr.select(lit, intensity * (diffuse * n_dot_l + specular * highlight), 0.0)
        value = dr.select(hit, shaded, background)
        dr.eval(value)
        dr.sync_thread()
        return np.asarray(value).reshape(height, width)

    draw()
    return draw


def _plain(scene: Scene) -> tuple[Any, Any, float]:
    """(material, light, background) where `picture` can draw the scene."""
    light = scene.lights[0] if len(scene.lights) == 1 else None
    materials = {sphere.material for sphere in scene.spheres}
    material = materials.pop() if len(materials) == 1 else None
    if (
        scene.plane is not None
        or scene.channels != 1
        or not isinstance(scene.background, float)
        or not isinstance(light, PointLight)
        or light.attenuation != (1.0, 0.0, 0.0)
        or material is None
        or not material.gate_specular
        or material.reflect > 0.0
    ):
        raise ArgumentError(
            "scene: Mitsuba's picture is drawn of spheres of one grey, gated material without a mirror, under one "
            "point light without attenuation; expected such a scene; random_spheres makes them"
        )
    return material, light, scene.background
