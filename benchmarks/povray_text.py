"""A scene as POV-Ray 3.7's text, for an image of a size.

Comes in: a Scene and the size of the image. Goes out: the text (`export`), in how many pictures it must be drawn
(`channels`), sentences for what POV-Ray means otherwise (`departures`). Never done here: running POV-Ray (povray.py).

The text is written in the camera's frame, so POV-Ray shoots the very rays of our pixel centres: location (0, 0, e),
direction (0, 0, -e), and right, up as long as the image. POV-Ray is left-handed only in its defaults; with the three
vectors given, this right-handed frame is drawn as it is. Every length is multiplied by one power of two
(`_unit_of_length`), because POV-Ray's tolerances are absolute: hits nearer than 1e-6, blockers nearer than 1e-3 and
spheres smaller than 1e-5 are dropped, and so is what is farther than 1e7.

How the formula is stated, as the source of POV-Ray 3.7.0.10 has it (render/trace.cpp, lighting/point.cpp):
    k_a, k_d, k_s, n    `ambient`, `diffuse`, `phong`, `phong_size`: k_s max(0, r.v)^n is POV-Ray's formula too. A
                        colour of k_d is the pigment (diffuse 1), and k_a is divided by it. `phong` is one number: a
                        picture with a coloured k_s is drawn three times, once a channel
    gate                POV-Ray always gates: a light with n.l < 1e-10 adds neither term
    attenuation         `fade_distance f fade_power p` multiplies by 2 / (1 + (l / f)^p): twice what one expects, so the
                        colour is halved; a + b l and a + c l^2 are exact; a, b and c together are the difference of two
                        lights where a + b l + c l^2 has two well separated real roots, and cannot be stated otherwise
    directional         `parallel`, from 4e6 units away
    max_bounces         max_trace_level - 1; adc_bailout 0, or POV-Ray drops reflections below 1/255
    shadows = false     `no_shadow` on every object (shadowless lights would lose their highlights)
    checker             POV-Ray's is a pattern of cubes: the plane is put half-way up a layer of them
    gradient            a sky_sphere in the middle half of its colour map, away from the ends where it wraps around

The image is linear (assumed_gamma 1) and POV-Ray clips it at 1: `gain` darkens lights, ambient and background alike, so
that nothing of the unclipped field is lost.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from symrender_cg import Scene
from symrender_cg.errors import ArgumentError
from symrender_cg.scene import Colour, DirectionalLight, Gradient, Phong, Plane, PointLight

EXTENT: Final = 64.0
"""The farthest length of a scene in POV-Ray's units, about: well above its tolerances, squares well within float64."""

LEAST_RADIUS: Final = 0.5
"""The smallest sphere in those units, unless that puts a sphere beyond FARTHEST from the eye."""

FARTHEST: Final = 2.0**18
"""Beyond it POV-Ray's rounding of hit points outgrows its tolerances, and spheres lie in their own shadow."""

SUN: Final = 4e6

RGB = tuple[float, float, float]


class NotStatedError(ArgumentError):
    """A scene that POV-Ray's language cannot state; the message names what."""


def export(scene: Scene, width: int, height: int, *, channel: int | None = None, gain: float = 1.0) -> str:
    """The scene as POV-Ray text for an image of that size; `channel` 0, 1 or 2 is a grey picture of that channel.

    gain: multiplies every light, ambient and the background. Raises NotStatedError (see `channels`).
    """
    frame = scene.in_camera_frame()
    return "\n".join(_Writer(frame, width, height, channel, gain).lines()) + "\n"


def channels(scene: Scene) -> tuple[int | None, ...]:
    """(None,) where one picture states all colours, else (0, 1, 2): one for each channel."""
    return (None,) if all(_in_one_picture(material) for material in _materials(scene)) else (0, 1, 2)


def departures(scene: Scene) -> tuple[str, ...]:
    """What POV-Ray means otherwise in a scene that it can state, a sentence each."""
    found = []
    if any(not m.gate_specular and _brightest(m.specular) > 0.0 for m in _materials(scene)):
        found.append("POV-Ray gates every highlight by n.l > 0; compared with gate_specular = true")
    if any(m.shininess == 0.0 and _brightest(m.specular) > 0.0 for m in _materials(scene)):
        found.append("POV-Ray has max(0, r.v)^0 = 0 where r.v <= 0, not 1")
    return tuple(found)


class _Writer:
    """One camera-frame scene, line by line."""

    def __init__(self, frame: Scene, width: int, height: int, channel: int | None, gain: float) -> None:
        self.frame, self.width, self.height, self.channel, self.gain = frame, width, height, channel, gain
        self.unit = _unit_of_length(frame)
        self.names: dict[Phong, str] = {}
        for material in _materials(frame):
            self.names.setdefault(material, f"Material_{len(self.names)}")

    def lines(self) -> Iterator[str]:
        frame = self.frame
        yield f"// {self.width} x {self.height} pixels; lengths times {_number(self.unit)}; linear light"
        yield f"// intensities times {_number(self.gain)}"
        yield "#version 3.7;"
        yield (
            "global_settings { assumed_gamma 1 ambient_light rgb 1 adc_bailout 0 "
            f"max_trace_level {frame.max_bounces + 1} }}"
        )
        yield self.camera()
        if isinstance(frame.background, Gradient):
            yield self.sky(frame.background)
        else:
            yield f"background {{ {self.light_colour(frame.background)} }}"
        for light in frame.lights:
            yield from self.light(light)
        for material, name in self.names.items():
            yield f"#declare {name} = texture {{ {self.texture(material)} }}"
        shadow = "" if frame.shadows else " no_shadow"
        for sphere in frame.spheres:
            name = self.names[sphere.material]
            yield f"sphere {{ {self.point(sphere.center)}, {self.length(sphere.radius)} texture {{ {name} }}{shadow} }}"
        if frame.plane is not None:
            yield self.plane(frame.plane, shadow)

    def camera(self) -> str:
        e, half = self.frame.camera.eye[2], self.frame.camera.half_height
        assert half is not None, "a camera-frame scene has its half_height"
        pixel = 2.0 * half / self.height
        return (
            f"camera {{ perspective location {self.point((0.0, 0.0, e))} direction {self.point((0.0, 0.0, -e))} "
            f"right {self.point((self.width * pixel, 0.0, 0.0))} up {self.point((0.0, self.height * pixel, 0.0))} }}"
        )

    def light(self, light: PointLight | DirectionalLight) -> Iterator[str]:
        """One light_source, two where the attenuation is a difference, none where it is dark."""
        if _brightest(light.intensity) == 0.0:
            return
        if isinstance(light, DirectionalLight):
            d = _unit(light.direction)
            position = _vector(tuple(-SUN * c for c in d))
            yield f"light_source {{ {position} {self.light_colour(light.intensity)} parallel point_at <0, 0, 0> }}"
            return
        for share, distance, power in fades(light.attenuation):
            fade = f" fade_distance {self.length(distance)} fade_power {power}" if power else ""
            yield f"light_source {{ {self.point(light.position)} {self.light_colour(light.intensity, share)}{fade} }}"

    def texture(self, material: Phong) -> str:
        ambient, diffuse = self.picked(material.ambient), self.picked(material.diffuse)
        phong = self.picked(material.specular)[0]
        if diffuse[0] == diffuse[1] == diffuse[2]:
            pigment, share = (1.0, 1.0, 1.0), diffuse[0]
        else:
            pigment, share = diffuse, 1.0
        glow = tuple(self.gain * a / p if p > 0.0 else 0.0 for a, p in zip(ambient, pigment, strict=True))
        reflect = material.reflect if self.frame.max_bounces else 0.0
        mirror = f" reflection {{ rgb {_number(reflect)} }}" if reflect else ""
        return (
            f"pigment {{ rgb {_vector(pigment)} }} finish {{ ambient rgb {_vector(glow)} diffuse {_number(share)} "
            f"phong {_number(phong)} phong_size {_number(material.shininess)}{mirror} }}"
        )

    def plane(self, plane: Plane, shadow: str) -> str:
        n = _unit(plane.normal)
        level = self.unit * math.fsum(a * b for a, b in zip(n, plane.point, strict=True))
        texture = f"texture {{ {self.names[plane.material]} }}"
        if plane.checker is not None:
            along = math.fsum(a * b for a, b in zip(plane.axis, n, strict=True))
            u = _unit(tuple(a - along * b for a, b in zip(plane.axis, n, strict=True)))
            tile = self.unit * plane.tile
            axes = [tuple(tile * c for c in axis) for axis in (u, n, _cross(n, u))]
            corner = tuple(self.unit * p - 0.5 * up for p, up in zip(plane.point, axes[1], strict=True))
            texture = (
                f"texture {{ checker texture {{ {self.names[plane.material]} }}, "
                f"texture {{ {self.names[plane.checker]} }} {_matrix(*axes, corner)} }}"
            )
        return f"plane {{ {_vector(n)}, {_number(level)} {texture}{shadow} }}"

    def sky(self, sky: Gradient) -> str:
        up = _unit(sky.up)
        aside = _unit(_cross(up, (1.0, 0.0, 0.0) if abs(up[0]) < 0.7 else (0.0, 1.0, 0.0)))
        turned = _matrix(aside, up, _cross(aside, up), (0.0, 0.0, 0.0))
        ends = f"[0.25 {self.light_colour(sky.bottom)}] [0.75 {self.light_colour(sky.top)}]"
        pattern = f"gradient y color_map {{ {ends} }} scale 4 translate <0, -2, 0> {turned}"
        return f"sky_sphere {{ pigment {{ {pattern} }} }}"

    def picked(self, colour: Colour) -> RGB:
        if not isinstance(colour, tuple):
            return (colour, colour, colour)
        return colour if self.channel is None else (colour[self.channel],) * 3

    def light_colour(self, colour: Colour, share: float = 1.0) -> str:
        return f"rgb {_vector(tuple(share * self.gain * c for c in self.picked(colour)))}"

    def point(self, coordinates: tuple[float, ...]) -> str:
        return _vector(tuple(self.unit * c for c in coordinates))

    def length(self, length: float) -> str:
        return _number(self.unit * length)


def fades(attenuation: tuple[float, float, float]) -> tuple[tuple[float, float, int], ...]:
    """1 / (a + b l + c l^2) as the sum of share 2 / (1 + (l / distance)^power), in (share, distance, power).

    power 0: share alone. A missing a is a distance so short that 1 is lost beside (l / distance)^power.
    With two real roots -p and -q, 1 / (c (l + p) (l + q)) = (1 / (l + p) - 1 / (l + q)) / (c (q - p)).
    Raises NotStatedError where a, b and c are all there and the roots are complex, or nearer than a factor of 2.
    """
    a, b, c = attenuation
    if b == c == 0.0:
        return ((1.0 / a, 0.0, 0),)
    if c == 0.0:
        distance = a / b if a > 0.0 else 1e-8
        return ((0.5 / (b * distance), distance, 1),)
    if b == 0.0:
        distance = math.sqrt(a / c) if a > 0.0 else 1e-5
        return ((0.5 / (c * distance * distance), distance, 2),)
    square = b * b - 4.0 * a * c
    outer = (b + math.sqrt(square)) / (2.0 * c) if square > 0.0 else 0.0
    inner = a / (c * outer) if outer else 0.0
    if square <= 0.0 or outer < 2.0 * inner:
        raise NotStatedError(
            f"attenuation: {attenuation} has no form in POV-Ray, whose lights fade by 2 / (1 + (l / f)^p); expected b "
            "or c to be 0, or b^2 well above 4 a c; leave POV-Ray out for this scene"
        )
    inner = max(inner, 1e-8)
    shared = 0.5 / (c * (outer - inner))
    return ((shared / inner, inner, 1), (-shared / outer, outer, 1))


def _materials(scene: Scene) -> list[Phong]:
    """Every material of the scene once, in the order of the scene."""
    plane = [] if scene.plane is None else [scene.plane.material, scene.plane.checker]
    return list(dict.fromkeys(m for m in (*(s.material for s in scene.spheres), *plane) if m is not None))


def _in_one_picture(material: Phong) -> bool:
    """Whether `phong`, one number, is k_s, and no channel has ambient light on a pigment of 0."""
    ambient, diffuse, specular = (
        colour if isinstance(colour, tuple) else (colour,) * 3
        for colour in (material.ambient, material.diffuse, material.specular)
    )
    if len(set(specular)) > 1:
        return False
    return len(set(diffuse)) == 1 or all(d > 0.0 or a == 0.0 for a, d in zip(ambient, diffuse, strict=True))


def _unit_of_length(frame: Scene) -> float:
    """The power of two that brings the scene's extent near EXTENT, its smallest sphere to LEAST_RADIUS if it may."""
    points = [(frame.camera.eye, 0.0)] + [(sphere.center, sphere.radius) for sphere in frame.spheres]
    points += [(light.position, 0.0) for light in frame.lights if isinstance(light, PointLight)]
    if frame.plane is not None:
        points.append((frame.plane.point, 0.0))
    extent = max(math.hypot(*center) + radius for center, radius in points)
    least = min((sphere.radius for sphere in frame.spheres), default=extent)
    eye = frame.camera.eye
    reach = max((math.dist(eye, sphere.center) + sphere.radius for sphere in frame.spheres), default=extent)
    wanted = min(max(EXTENT / extent, LEAST_RADIUS / least), FARTHEST / reach)
    return math.ldexp(1.0, math.frexp(wanted)[1] - 1)


def _brightest(colour: Colour) -> float:
    return max(colour) if isinstance(colour, tuple) else colour


def _unit(v: tuple[float, ...]) -> RGB:
    largest = max(abs(c) for c in v)
    x, y, z = (c / largest for c in v)
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length)


def _cross(a: tuple[float, ...], b: tuple[float, ...]) -> RGB:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _number(value: float) -> str:
    """The shortest text that reads back as the same float64."""
    return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))


def _vector(v: tuple[float, ...]) -> str:
    return f"<{', '.join(_number(c) for c in v)}>"


def _matrix(*rows: tuple[float, ...]) -> str:
    """POV-Ray's matrix: where the axes go, then where the origin goes."""
    return f"matrix <{', '.join(_number(c) for row in rows for c in row)}>"
