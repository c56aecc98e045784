"""Hypothesis strategies for scenes and for points of the image plane, shared by the tests of every evaluator.

    ordinary_scenes()      one sphere wholly in front of the eye, anywhere in view, any camera, moderate numbers
    centred_scenes()       Chapter 1's arrangement: sphere at the origin, eye at (0, 0, e), moderate numbers
    nasty_scenes()         what breaks the literal formula; every family is one function below
    image_points(scene)    (x, y) on the plane of scene.in_camera_frame(): in view, on axes, near the outline, far out

Every scene has one sphere and one light, and `scene.in_camera_frame()` accepts it: a test needs no `assume`. Everything
is drawn from bounded pieces, so that examples shrink to round numbers. Nothing here is an expectation of a value.
"""

from __future__ import annotations

import math
import sys

from hypothesis import strategies as st

from symrender_cg.errors import SceneError
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere, Vector

LARGEST_SCALE = 400
"""nasty_scenes() multiply all lengths by 2^k with |k| up to this."""


def _finite(low: float, high: float) -> st.SearchStrategy[float]:
    """Floats of [low, high]; below 2^-100 they become 0, so that scaling by 2^k, |k| <= 450, rounds nothing."""
    floats = st.floats(low, high, allow_nan=False, allow_infinity=False, allow_subnormal=False)
    return floats.map(lambda value: 0.0 if abs(value) < 2.0**-100 else value)


def _along(origin: Vector, direction: Vector, length: float) -> Vector:
    x, y, z = (o + length * d for o, d in zip(origin, direction, strict=True))
    return x, y, z


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(v: Vector) -> Vector:
    length = math.sqrt(_dot(v, v))
    return v[0] / length, v[1] / length, v[2] / length


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@st.composite
def directions(draw: st.DrawFn) -> Vector:
    """Unit vectors (to rounding), from height and azimuth; the first to be tried is (0, 0, 1)."""
    z = draw(_finite(-1.0, 1.0).map(lambda v: 1.0 if v == 0.0 else v))
    azimuth = draw(_finite(0.0, 2.0 * math.pi))
    flat = math.sqrt(max(0.0, 1.0 - z * z))
    return flat * math.cos(azimuth), flat * math.sin(azimuth), z


def points(extent: float) -> st.SearchStrategy[Vector]:
    """Points of the cube [-extent, extent]^3."""
    axis = _finite(-extent, extent)
    return st.tuples(axis, axis, axis)


@st.composite
def materials(draw: st.DrawFn) -> Phong:
    """Coefficients in [0, 1], exactly 0 now and then; whole and broken shininess in [0, 200]; gated or not."""
    coefficient = st.one_of(_finite(0.0, 1.0), st.just(0.0), st.sampled_from((0.1, 0.5, 0.7)))
    shininess = st.one_of(st.integers(0, 200).map(float), _finite(0.0, 200.0))
    return Phong(draw(coefficient), draw(coefficient), draw(coefficient), draw(shininess), draw(st.booleans()))


@st.composite
def ordinary_lights(draw: st.DrawFn, sphere: Sphere) -> PointLight:
    """A light 0.1 to 20 radii above the surface of `sphere`, on any side of it."""
    distance = sphere.radius * draw(_finite(1.1, 21.0))
    return PointLight(_along(sphere.center, draw(directions()), distance), draw(_finite(0.0, 2.0)))


def _half_heights(scale: float) -> st.SearchStrategy[float | None]:
    return st.one_of(st.none(), _finite(0.25, 4.0).map(lambda v: v * scale))


@st.composite
def centred_scenes(draw: st.DrawFn) -> Scene:
    """Sphere at the origin with R in [0.1, 3], eye at (0, 0, e) with e/R in [1.05, 20], up (0, 1, 0), any light."""
    radius = draw(_finite(0.1, 3.0))
    sphere = Sphere((0.0, 0.0, 0.0), radius, draw(materials()))
    camera = Camera((0.0, 0.0, radius * draw(_finite(1.05, 20.0))), half_height=draw(_half_heights(radius)))
    return Scene(camera, (sphere,), (draw(ordinary_lights(sphere)),), draw(_finite(0.0, 1.0)))


@st.composite
def ordinary_scenes(draw: st.DrawFn) -> Scene:
    """One sphere wholly in front of the plane through the eye, up to 45 degrees off the axis, any camera.

    R in [0.1, 3], depth of the centre k in [1.2 R, 20 R], look_at in [-10, 10]^3, e in [0.5, 20], up leaning at
    least 0.1 rad from the view; about half of the scenes leave half_height to the framing.
    """
    look_at = draw(points(10.0))
    backward = draw(directions())
    distance = draw(_finite(0.5, 20.0))
    eye = _along(look_at, backward, distance)
    seed = (0.0, 1.0, 0.0) if abs(backward[1]) < 0.9 else (1.0, 0.0, 0.0)
    right = _unit(_cross(seed, backward))
    upward = _cross(backward, right)
    roll, lean = draw(_finite(0.0, 2.0 * math.pi)), draw(_finite(-1.4, 1.4))
    up = _along(_along((0.0, 0.0, 0.0), right, math.sin(roll)), upward, math.cos(roll))
    up = _along(up, backward, math.tan(lean))

    radius = draw(_finite(0.1, 3.0))
    depth = radius * draw(_finite(1.2, 20.0))
    offset, azimuth = depth * draw(_finite(0.0, 1.0)), draw(_finite(0.0, 2.0 * math.pi))
    center = _along(eye, backward, -depth)
    center = _along(_along(center, right, offset * math.cos(azimuth)), upward, offset * math.sin(azimuth))
    sphere = Sphere(center, radius, draw(materials()))
    camera = Camera(eye, look_at, up, draw(_half_heights(radius)))
    return Scene(camera, (sphere,), (draw(ordinary_lights(sphere)),), draw(_finite(0.0, 1.0)))


def scaled(scene: Scene, k: int) -> Scene:
    """`scene` with every length multiplied by 2^k; exact short of subnormal numbers. Raises SceneError on overflow."""

    def length(value: float) -> float:
        try:
            return math.ldexp(value, k)
        except OverflowError:
            return math.inf

    def vector(v: Vector) -> Vector:
        return length(v[0]), length(v[1]), length(v[2])

    camera = scene.camera
    half_height = None if camera.half_height is None else length(camera.half_height)
    return Scene(
        Camera(vector(camera.eye), vector(camera.look_at), camera.up, half_height),
        tuple(Sphere(vector(s.center), length(s.radius), s.material) for s in scene.spheres),
        tuple(PointLight(vector(li.position), li.intensity) for li in scene.lights),
        scene.background,
    )


def _nasty_shininess() -> st.SearchStrategy[float]:
    return st.one_of(
        st.sampled_from((0.0, 1e-3, 0.5, 1.0, 2.0, 1e6, 1e12)),
        _finite(-3.0, 12.0).map(lambda exponent: 10.0**exponent),
    )


@st.composite
def _nasty_materials(draw: st.DrawFn) -> Phong:
    """Coefficients that are often exactly 0, shininess from 0 to 1e12."""
    coefficient = st.one_of(st.just(0.0), st.sampled_from((0.1, 0.7)), _finite(0.0, 1.0))
    return Phong(
        draw(coefficient),
        draw(coefficient),
        draw(coefficient),
        draw(_nasty_shininess()),
        gate_specular=draw(st.booleans()),
    )


def _just_above(value: float, draw: st.DrawFn) -> float:
    """A float a little above `value` > 0: one to eight ulp, or a relative 2^-j with j up to 52."""
    if draw(st.booleans()):
        return value + draw(st.integers(1, 8)) * math.ulp(value)
    return max(value * (1.0 + 2.0 ** -draw(st.integers(1, 52))), math.nextafter(value, math.inf))


@st.composite
def _eyes_near_or_far(draw: st.DrawFn) -> Scene:
    """e -> R+ (to the next float) or e/R up to 1e12, sphere at the origin."""
    radius = draw(_finite(0.5, 2.0))
    near = draw(st.booleans())
    e = _just_above(radius, draw) if near else radius * 10.0 ** draw(_finite(1.0, 12.0))
    sphere = Sphere((0.0, 0.0, 0.0), radius, draw(_nasty_materials()))
    return Scene(Camera((0.0, 0.0, e)), (sphere,), (draw(ordinary_lights(sphere)),))


@st.composite
def _lights_near_surface(draw: st.DrawFn) -> Scene:
    """A light 2^-1 to 2^-52 radii above or below the visible surface, on it to rounding, or at the centre."""
    scene = draw(st.one_of(centred_scenes(), ordinary_scenes()))
    sphere = Sphere(scene.spheres[0].center, scene.spheres[0].radius, draw(_nasty_materials()))
    height = draw(st.sampled_from((1.0, -1.0, 0.0))) * 2.0 ** -draw(st.integers(0, 52))
    position = _along(sphere.center, draw(directions()), sphere.radius * (1.0 + height))
    return Scene(scene.camera, (sphere,), (PointLight(position),))


@st.composite
def _lights_on_surface_point(draw: st.DrawFn) -> Scene:
    """A light exactly at the point of the sphere that faces the eye, or a few ulp above or below it."""
    scene = draw(centred_scenes())
    radius = scene.spheres[0].radius
    position = (0.0, 0.0, radius + draw(st.integers(-3, 3)) * math.ulp(radius))
    return Scene(scene.camera, scene.spheres, (PointLight(position),))


@st.composite
def _lights_far_or_behind(draw: st.DrawFn) -> Scene:
    """A light up to 1e300 away in any direction, straight behind the sphere included."""
    scene = draw(st.one_of(centred_scenes(), ordinary_scenes()))
    sphere = Sphere(scene.spheres[0].center, scene.spheres[0].radius, draw(_nasty_materials()))
    distance = 10.0 ** draw(st.one_of(_finite(1.0, 20.0), _finite(20.0, 300.0)))
    direction = draw(st.one_of(directions(), st.just((0.0, 0.0, -1.0)), st.just((0.0, 0.0, 1.0))))
    return Scene(scene.camera, (sphere,), (PointLight(_along((0.0, 0.0, 0.0), direction, distance)),))


@st.composite
def _near_eye_plane(draw: st.DrawFn) -> Scene:
    """A sphere beside the eye: its depth k runs from -0.99 R to 1.5 R, so its outline may be a hyperbola."""
    radius, e = draw(_finite(0.5, 2.0)), draw(_finite(0.5, 8.0))
    depth = radius * draw(st.one_of(_finite(-0.99, 1.5), st.sampled_from((1.0, 0.0, 1.0 + 2.0**-40))))
    aside, azimuth = radius * draw(_finite(1.05, 4.0)), draw(_finite(0.0, 2.0 * math.pi))
    center = (aside * math.cos(azimuth), aside * math.sin(azimuth), e - depth)
    sphere = Sphere(center, radius, draw(_nasty_materials()))
    camera = Camera((0.0, 0.0, e), half_height=e * 2.0 ** draw(st.integers(-2, 6)))
    return Scene(camera, (sphere,), (draw(ordinary_lights(sphere)),))


@st.composite
def _off_axis_and_far(draw: st.DrawFn) -> Scene:
    """A sphere 1e2 to 1e8 radii from the eye and up to 45 degrees off the axis."""
    radius, e = draw(_finite(0.5, 2.0)), draw(_finite(0.5, 8.0))
    depth = radius * 10.0 ** draw(_finite(2.0, 8.0))
    aside, azimuth = depth * draw(_finite(0.0, 1.0)), draw(_finite(0.0, 2.0 * math.pi))
    center = (aside * math.cos(azimuth), aside * math.sin(azimuth), e - depth)
    sphere = Sphere(center, radius, draw(_nasty_materials()))
    return Scene(Camera((0.0, 0.0, e)), (sphere,), (draw(ordinary_lights(sphere)),))


@st.composite
def _with_nasty_material(draw: st.DrawFn) -> Scene:
    """An ordinary arrangement with coefficients of 0 and any shininess."""
    scene = draw(st.one_of(centred_scenes(), ordinary_scenes()))
    sphere = Sphere(scene.spheres[0].center, scene.spheres[0].radius, draw(_nasty_materials()))
    return Scene(scene.camera, (sphere,), scene.lights, scene.background)


@st.composite
def _scaled_scenes(draw: st.DrawFn) -> Scene:
    """Any of the families above with all lengths multiplied by 2^k, |k| <= 400."""
    scene = draw(st.one_of(*_UNSCALED))
    return _scaled_if_possible(scene, draw(st.integers(-LARGEST_SCALE, LARGEST_SCALE)))


def _scaled_if_possible(scene: Scene, k: int) -> Scene:
    """`scaled`, or the scene itself when a light far away would leave the range of float64."""
    try:
        return scaled(scene, k)
    except SceneError:
        return scene


def _has_image(scene: Scene) -> bool:
    try:
        scene.in_camera_frame()
    except SceneError:
        return False
    return True


_UNSCALED = (
    _eyes_near_or_far(),
    _lights_near_surface(),
    _lights_on_surface_point(),
    _lights_far_or_behind(),
    _near_eye_plane(),
    _off_axis_and_far(),
    _with_nasty_material(),
)


def nasty_scenes() -> st.SearchStrategy[Scene]:
    """Scenes on which the literal formula loses digits or decisions: one of the families of this module.

    e -> R+ and e/R to 1e12; light at, just above, just below the surface, inside, behind, or 1e300 away; a sphere
    beside the eye or far off the axis; coefficients of 0, shininess 0 to 1e12; all lengths times 2^k, |k| <= 400. The
    rare scene whose eye is rounded onto the sphere is filtered out.
    """
    return st.one_of(*_UNSCALED, _scaled_scenes()).filter(_has_image)


@st.composite
def image_points(draw: st.DrawFn, scene: Scene) -> tuple[float, float]:
    """(x, y) on the image plane of `scene.in_camera_frame()`, in scene units, finite.

    One of: a point up to 2 half-heights from the middle, on an axis, the middle itself; a point on the outline of the
    sphere to rounding, moved by a few ulp or a relative 2^-j; a point up to 2^40 half-heights out.
    """
    framed = scene.in_camera_frame()
    half_height = framed.camera.half_height
    assert half_height is not None
    kind = draw(st.sampled_from(("inside", "axis", "outline", "far")))
    if kind == "outline" and framed.spheres:
        outline = _outline_point(framed, draw(_finite(0.0, 2.0 * math.pi)))
        if outline is not None:
            return _moved_slightly(outline[0], draw), _moved_slightly(outline[1], draw)
    x, y = draw(_finite(-2.0, 2.0)), draw(_finite(-2.0, 2.0))
    if kind == "axis":
        x, y = (x, 0.0) if draw(st.booleans()) else (0.0, y)
    if kind == "far":
        x *= 2.0 ** draw(st.integers(0, 40))
    return _clipped(x * half_height), _clipped(y * half_height)


def _clipped(value: float) -> float:
    return min(max(value, -sys.float_info.max), sys.float_info.max)


def _moved_slightly(value: float, draw: st.DrawFn) -> float:
    if draw(st.booleans()):
        moved = value + draw(st.integers(-4, 4)) * math.ulp(value)
    else:
        moved = value * (1.0 + draw(st.sampled_from((-1.0, 0.0, 1.0))) * 2.0 ** -draw(st.integers(4, 53)))
    return _clipped(moved)


def _outline_point(framed: Scene, angle: float) -> tuple[float, float] | None:
    """The point of the outline of the first sphere at `angle` around its cone of tangent rays, to about 1e-15.

    A tangent ray leaves the eye at asin(R/|m|) from the direction of m = center - eye. None where that ray does not
    meet the image plane within float64.
    """
    sphere, e = framed.spheres[0], framed.camera.eye[2]
    m = (sphere.center[0], sphere.center[1], sphere.center[2] - e)
    distance = math.hypot(*m)
    if not 0.0 < distance < math.inf:
        return None
    axis = (m[0] / distance, m[1] / distance, m[2] / distance)
    seed = (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0)
    first = _unit(_cross(axis, seed))
    second = _cross(axis, first)
    sine = min(1.0, sphere.radius / distance)
    cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
    ray = _along((0.0, 0.0, 0.0), axis, cosine)
    ray = _along(_along(ray, first, sine * math.cos(angle)), second, sine * math.sin(angle))
    if not ray[2] < 0.0:
        return None
    x, y = e * (ray[0] / -ray[2]), e * (ray[1] / -ray[2])
    return (x, y) if math.isfinite(x) and math.isfinite(y) else None
