"""The formulas of a scene of many spheres, cut where the loops of its kernel meet: each part has inputs and results.

    span, near        a sphere and a ray of the eye: the row's ends, normal, mirrored ray, distance (near: at the eye)
    plane             the ground plane and a ray of the eye; tiles: which of its two materials
    lamp              a light as its receiver sees it
    reach             from a point to a lamp
    matte, glossy     n.l and the highlight of a point
    fading            how a point light fades with its distance
    shadow            whether a sphere stands between a point and a lamp
    echo, echo_plane  a mirrored ray and what it meets
    arrival, landing  the normal there and the ray mirrored once more; in two words, if asked for
    gradient          the background of a direction

span, near, lamp, matte and glossy are cut from the derivation of one sphere, form by form the same. The others are
written here. A point is a place on a receiver, measured from its origin in its unit of length: centre and radius of a
sphere, where the point is the normal; the eye and its height above the plane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import sympy as sp

from symrender_cg.derive import forms
from symrender_cg.derive.image import LAGRANGE, PHONG, derive_sphere
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols

_STABLE = (
    ("off_axis_span", "off_axis_foot"),
    ("cross_disc", "cross_foot"),
)
_LIGHT_FORMS = ("light_in_radii", "diffuse_gain", "mirrored_ray", "gained")
_FOOT = "the foot point -(d x (m x d)) / |d|^2 lies on the ray, nearest to the centre"


@dataclass(frozen=True, slots=True)
class Part:
    """A cut of the derivation: definitions in order, what they give, and the rates of what they take.

    rates    of inputs: "sphere" changes with the receiver, the light or the blocker, "pixel" with the point
    arrays   inputs that another part wrote for every point
    ends     the two ends of a row's span of hits, where it has them

    Where mirrors would magnify what rounding leaves, points and rays go from part to part in two words:

    in_full       results that are computed so, and whose first word is the nearest float64
    second_words  results that stay as they are, and whose second word is computed beside them
    low_inputs    inputs that come in two words, of which what is computed beside makes use
    """

    name: str
    definitions: tuple[Definition, ...]
    results: tuple[str, ...]
    rates: tuple[tuple[str, str], ...]
    arrays: tuple[str, ...] = ()
    ends: tuple[str, str] | None = None
    in_full: tuple[str, ...] = ()
    second_words: tuple[str, ...] = ()
    low_inputs: tuple[str, ...] = ()

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names that are used and not defined, in the order of the alphabet."""
        defined = {definition.name for definition in self.definitions}
        used = {s.name for definition in self.definitions for s in definition.value.free_symbols}
        used |= {low(name) for name in self.low_inputs}
        return tuple(sorted(used - defined))

    def closed(self, name: str) -> sp.Expr:
        """A result with every definition substituted: a formula in the inputs alone."""
        return ImageProgram(self.name, self.definitions, (), name).closed(name)


def vector(stem: str) -> sp.Matrix:
    """The vector of the symbols stem_x, stem_y, stem_z."""
    return sp.Matrix(symbols(f"{stem}_x {stem}_y {stem}_z"))


def _vector(
    stem: str, value: sp.Matrix, section: str, meaning: str = "", source: str = ""
) -> tuple[Definition, Definition, Definition]:
    x, y, z = (
        Definition(f"{stem}_{axis}", value[i], section, meaning if i == 0 else "", source if i == 0 else "")
        for i, axis in enumerate("xyz")
    )
    return x, y, z


def _cut(
    definitions: tuple[Definition, ...], results: tuple[str, ...], given: tuple[str, ...] = ()
) -> tuple[Definition, ...]:
    """The definitions that lead to the results, in their order; what is given is not looked into."""
    needed = set(results)
    kept: list[Definition] = []
    for definition in reversed(definitions):
        if definition.name in needed and definition.name not in given:
            kept.append(definition)
            needed |= {s.name for s in definition.value.free_symbols}
    return tuple(reversed(kept))


@cache
def _one_sphere(near: bool) -> ImageProgram:
    """The derivation of one sphere under one light with the forms of the accurate levels, every definition kept."""
    image = derive_sphere("sphere", front_test=near, diffuse=True, specular=True, gated=False)
    chosen = tuple(forms.form(name) for name in (*_STABLE[near], *_LIGHT_FORMS))
    return forms.apply(image, chosen, keep_all=True)


_SPHERE = tuple((name, "sphere") for name in ("center_x", "center_y", "center_z", "radius"))
_PRIMARY = (*_SPHERE, ("y", "row"), ("x", "pixel"))


def low(name: str) -> str:
    """The name of the second word of an input that comes in two."""
    return f"{name}_low"


def with_low_words(part: Part, names: tuple[str, ...]) -> Part:
    """The part with those inputs in two words: each is the sum of its own and of a second, small one.

    (p_x, ...) -> (p_x + p_x_low, ...), under the name full_p_x
    """
    full = {S(name): S(f"full_{name}") for name in names}
    heads = tuple(
        Definition(f"full_{name}", S(name) + S(low(name)), "inputs in full", "both words" if i == 0 else "")
        for i, name in enumerate(names)
    )
    body = tuple(replace(definition, value=definition.value.xreplace(full)) for definition in part.definitions)
    rates = dict(part.rates)
    return replace(
        part,
        definitions=heads + body,
        rates=(*part.rates, *((low(name), rates[name]) for name in names if name in rates)),
        arrays=(*part.arrays, *(low(name) for name in names if name in part.arrays)),
    )


def sphere_part(*, near: bool, mirrored: bool, in_full: bool = False) -> Part:
    """A sphere seen by the eye; `near`: it reaches the plane of the eye, so each pixel is tested.

    `mirrored`: with the eye's ray mirrored at it; `in_full`: of point and mirrored ray also the second words.
    """
    section = "distance"
    x, y, focal = symbols("x y focal")
    offset_x, offset_y, depth = symbols("offset_x offset_y depth")
    program = _one_sphere(near)
    power = offset_x**2 + offset_y**2 + depth**2 - 1 if near else S("alpha") + offset_x**2
    ahead = S("before_eye") if near else S("ahead")
    more: list[Definition] = [
        Definition("power", power, section, "|m|^2 - 1: the power of the eye in radii, squared"),
    ]
    if not near:
        more.append(Definition("ahead", offset_x * x + offset_y * y + depth * focal, section, "m.D"))
    more.append(
        Definition(
            "hit_distance",
            sp.sqrt(S("d_dot_d")) * S("power") / (ahead + S("facing")),
            section,
            "|P - E| in radii: the nearer root as a quotient, free of cancellation",
            "t_1 t_2 = (|m|^2 - R^2) / |D|^2 (Vieta)",
        )
    )
    if not near:
        half = sp.sqrt(S("alpha"))
        silhouette = "silhouette"
        more += [
            Definition(
                "row_low",
                focal * (depth * offset_y - half) / S("height2"),
                silhouette,
                "the rows that meet the silhouette: row_disc = 0",
            ),
            Definition("row_high", focal * (depth * offset_y + half) / S("height2"), silhouette),
        ]
    results: tuple[str, ...] = ("facing2", "d_dot_d", "n_x", "n_y", "n_z", "hit_distance")
    results += ("before_eye",) if near else ("x_left", "x_right", "row_low", "row_high")
    results += ("mirror_x", "mirror_y", "mirror_z", "inv_d2") if mirrored else ()
    definitions = _cut((*program.definitions, *more), results)
    return Part(
        "near" if near else "span",
        definitions,
        results,
        _PRIMARY,
        ends=None if near else ("x_left", "x_right"),
        second_words=(*_xyz("n"), *_xyz("mirror")) if in_full else (),
    )


def lamp_part() -> Part:
    """A light as a sphere sees it: its place from the centre in radii; a light in parallel has a direction."""
    results = ("lamp_x", "lamp_y", "lamp_z")
    rates = (*_SPHERE, *((f"light_{axis}", "sphere") for axis in "xyz"))
    return Part("lamp", _cut(_one_sphere(False).definitions, results), results, rates)


def reach_part(point: str) -> Part:
    """w = lamp - p for a point light, w = lamp for a light in parallel; `point` names the array of the points."""
    section = "light"
    w = vector("lamp") - S("nearness") * vector(point)
    definitions = (
        *_vector("w", w, section, "w = (L - P) in the receiver's unit; nearness is 0 for a light in parallel, else 1"),
        Definition("w2", vector("w").dot(vector("w")), section, "|w|^2"),
    )
    rates = (*((f"lamp_{axis}", "sphere") for axis in "xyz"), ("nearness", "sphere"), *_of_points(point))
    return Part("reach", definitions, ("w_x", "w_y", "w_z", "w2"), rates, _xyz(point))


def shading_part(*, glossy: bool) -> Part:
    """max(0, n.l), and for a glossy surface max(0, r.v)^n; both 0 for a light at the point itself."""
    program = _one_sphere(False)
    cosine = sp.Piecewise((sp.Max(0, S("n_dot_l")), S("w2") > 0), (0, True))
    more = [Definition("cosine", cosine, "diffuse", "max(0, n.l); a light at the point itself adds nothing", PHONG)]
    results: tuple[str, ...] = ("cosine",)
    arrays = [*_xyz("n"), *_xyz("w"), "w2"]
    if glossy:
        lobe = sp.Piecewise((S("highlight"), S("w_dot_mirror") > 0), (S("zero_power"), True))
        more += [
            Definition("leaf", lobe, "specular", "max(0, r.v)^n", PHONG),
            Definition("lobe", sp.Piecewise((S("leaf"), S("w2") > 0), (0, True)), "specular"),
        ]
        results += ("lobe",)
        arrays += [*_xyz("mirror"), "inv_d2", "shininess"]
    definitions = _cut((*program.definitions, *more), results, tuple(arrays))
    rates = tuple((name, "pixel") for name in arrays)
    return Part("glossy" if glossy else "matte", definitions, results, rates, tuple(arrays))


def fading_part() -> Part:
    """1 / (a + b l + c l^2) at the distance l = |w| r, with b r and c r^2 given, for |w|^2 up to farthest2."""
    section = "attenuation"
    a, b, c, length, w2, farthest2 = symbols("fade_a fade_b fade_c w_length w2 farthest2")
    finite = sp.Piecewise((w2, farthest2 - w2 > 0), (farthest2, True))
    definitions = (
        Definition("finite_w2", finite, section, "|w|^2, finite also at the horizon of a plane"),
        Definition("w_length", sp.sqrt(S("finite_w2")), section, "l / r"),
        Definition("fading", 1 / (a + length * (b + length * c)), section, "1 / (a + b l + c l^2)"),
    )
    given = ("fade_a", "fade_b", "fade_c", "farthest2")
    rates = (*((name, "sphere") for name in given), ("w2", "pixel"))
    return Part("fading", definitions, ("fading",), rates, ("w2",))


def shadow_part(point: str) -> Part:
    """Does the blocker, `gap` away from the receiver's origin and `ratio` as large as its unit, stand before the lamp?

    With b = gap - p and w to the lamp, the segment meets the ball where ratio^2 |w|^2 > |b x w|^2 and its nearest point
    lies between the ends: 0 < b.w < far |w|^2. far is 1, or infinite for a light in parallel or within the blocker.
    """
    section = "shadow"
    b, w, cross = vector("b"), vector("w"), vector("cross")
    definitions = (
        *_vector("b", vector("gap") - vector(point), section, "b, the blocker's centre seen from the point"),
        *_vector("cross", b.cross(w), section, "b x w", LAGRANGE),
        Definition("toward", b.dot(w), section, "b.w"),
        Definition(
            "inside2",
            S("ratio2") * S("w2") - cross.dot(cross),
            section,
            "positive where the line to the light meets the blocker",
        ),
        Definition(
            "shade",
            sp.Piecewise(
                (0, sp.And(S("inside2") > 0, S("toward") > 0, S("far") * S("w2") - S("toward") > 0)), (S("light"), True)
            ),
            section,
            "no light where it does so between point and light",
        ),
    )
    given = (*_xyz("gap"), "ratio2", "far")
    arrays = (*_xyz(point), *_xyz("w"), "w2", "light")
    rates = (*((name, "sphere") for name in given), *((name, "pixel") for name in arrays))
    return Part("shadow", definitions, ("shade",), rates, arrays)


_PLANE = tuple((f"plane_{axis}", "sphere") for axis in "xyz")
"""The unit normal of the plane, on the eye's side of it."""


def plane_part(*, mirrored: bool, in_full: bool = False) -> Part:
    """The plane seen by the eye: the point P - E in heights of the eye above it, and where the ray meets it at all.

    `in_full`: its normal in two words, and of the point and the mirrored ray also the second words.
    """
    section = "ground plane"
    x, y, focal = symbols("x y focal")
    ray = sp.Matrix([x, y, -focal])
    normal = vector("plane")
    definitions: list[Definition] = [
        Definition("focal", S("eye"), section, "rays D = (x, y, -f): f is e, in the unit of the image plane"),
        Definition("descent", -normal.dot(ray), section, "-n.D: the ray meets the plane where it is positive"),
        *_vector("p", ray / S("descent"), section, "P - E = D / -n.D, in heights of the eye above the plane"),
        Definition("d_dot_d", ray.dot(ray), section, "|D|^2"),
        Definition("hit_distance", sp.sqrt(S("d_dot_d")) / S("descent"), section, "|P - E|"),
    ]
    definitions += _vector("n", normal, section, "its normal, towards the eye")
    results: tuple[str, ...] = ("descent", *_xyz("p"), *_xyz("n"), "hit_distance")
    if mirrored:
        definitions += [
            Definition("inv_d2", 1 / S("d_dot_d"), section),
            Definition("bounce", 2 * S("descent"), section),
            *_vector("mirror", ray + S("bounce") * normal, section, "the ray mirrored at the plane"),
        ]
        results += ("inv_d2", *_xyz("mirror"))
    rates = (*((n, "frame") for n, _ in _PLANE), ("y", "row"), ("x", "pixel"))
    part = Part("plane", tuple(definitions), results, rates)
    if not in_full:
        return part
    return replace(part, second_words=(*_xyz("p"), *_xyz("mirror")), low_inputs=_xyz("plane"))


def tiles_part() -> Part:
    """0 on tiles of the plane's material, 1 on those of the checker: the parity of the sum of the tile's numbers."""
    section = "tiles"
    point = vector("p")
    across, along = vector("across"), vector("along")
    definitions = (
        Definition("tile_u", sp.floor(across.dot(point) + S("across_0")), section, "number of the tile across"),
        Definition("tile_v", sp.floor(along.dot(point) + S("along_0")), section, "and along the axis"),
        Definition("tile", S("tile_u") + S("tile_v"), section),
        Definition("parity", S("tile") - 2 * sp.floor(S("tile") / 2), section, "even: 0, odd: 1"),
    )
    given = (*_xyz("across"), "across_0", *_xyz("along"), "along_0")
    rates = (*((name, "frame") for name in given), *_of_points("p"))
    return Part("tiles", definitions, ("parity",), rates)


def echo_part(point: str) -> Part:
    """A mirrored ray and a sphere, in the sphere's radii: m = link - shrink p is its centre seen from the point."""
    section = "mirrored ray and sphere"
    m, ray, cross = vector("m"), vector("mirror"), vector("cross")
    definitions = (
        *_vector(
            "m", vector("link") - S("shrink") * vector(point), section, "m, the centre seen from the point, in radii"
        ),
        *_vector("cross", m.cross(ray), section, "m x d, with d the mirrored ray", LAGRANGE),
        Definition("d2", ray.dot(ray), section, "|d|^2"),
        Definition("disc", S("d2") - cross.dot(cross), section, "disc / R^2: a hit where >= 0 and m.d > 0"),
        Definition("ahead", m.dot(ray), section, "m.d"),
        Definition("facing", sp.sqrt(S("disc")), section, "-n.d"),
        Definition("t", S("reach") * (m.dot(m) - 1) / (S("ahead") + S("facing")), section, "distance in lengths of d"),
    )
    arrays = (*_xyz(point), *_xyz("mirror"))
    given = (*_xyz("link"), "shrink", "reach")
    rates = (*((name, "sphere") for name in given), *((name, "pixel") for name in arrays))
    return Part("echo", definitions, ("disc", "ahead", "t"), rates, arrays)


def arrival_part(point: str, *, in_full: bool = False, grounded: bool = False) -> Part:
    """The normal where a mirrored ray meets the sphere, and the ray mirrored once more.

    `in_full`: point and ray come and go in two words, and the way from sphere to sphere follows from the scene's own
    numbers; `grounded`: the ray may start on the plane, whose unit has two words.
    """
    echo = echo_part(point)
    section = "normal"
    ray, cross, normal = vector("mirror"), vector("cross"), vector("n")
    definitions = (
        *echo.definitions,
        Definition("inv_d2", 1 / S("d2"), section),
        *_vector("n", -(ray.cross(cross) + S("facing") * ray) * S("inv_d2"), section, _FOOT),
        Definition("bounce", 2 * S("facing"), section),
        *_vector("next", ray + S("bounce") * normal, section, "d mirrored at the surface, d + 2 facing n"),
    )
    results = (*_xyz("n"), *_xyz("next"), "inv_d2")
    rates = tuple((name, rate) for name, rate in echo.rates if name != "reach")
    if not in_full:
        return Part("arrival", _cut(definitions, results), results, rates, echo.arrays)
    own, seen, between = vector("own"), vector("seen"), "from sphere to sphere"
    way = (
        *_vector("link", (seen - own) / S("reach"), between, "the centre seen from the mirror's, in radii"),
        Definition("shrink", S("own_radius") / S("reach"), between, "the mirror's unit in radii"),
    )
    given = ((name, "sphere") for name in (*_xyz("own"), *_xyz("seen"), "own_radius", "reach"))
    part = Part(
        "arrival",
        _cut((*way, *definitions), results),
        results,
        (*given, *((name, "pixel") for name in echo.arrays)),
        echo.arrays,
        in_full=(*_xyz("n"), *_xyz("next")),
    )
    return with_low_words(part, (*echo.arrays, *(("own_radius",) if grounded else ())))


def echo_plane_part(point: str) -> Part:
    """A mirrored ray and the plane, in heights of the eye above it.

    o = origin + scale p is the point that mirrors, seen from the eye.
    """
    section = "mirrored ray and plane"
    start, ray, normal = vector("o"), vector("mirror"), vector("plane")
    definitions = (
        *_vector("o", vector("origin") + S("scale") * vector(point), section, "the point seen from the eye"),
        Definition("descent", -normal.dot(ray), section, "-n.d: the ray meets the plane where it is positive"),
        Definition("t_plane", (1 + normal.dot(start)) / S("descent"), section, "height over descent"),
        Definition("t", S("height") * S("t_plane"), section, "distance in lengths of d"),
        *_vector("foot", start + S("t_plane") * ray, section, "where it meets the plane, seen from the eye"),
        Definition("inv_d2", 1 / ray.dot(ray), section),
        Definition("bounce", 2 * S("descent"), section),
        *_vector("next", ray + S("bounce") * normal, section, "d mirrored at the plane"),
    )
    arrays = (*_xyz(point), *_xyz("mirror"))
    given = (*_xyz("origin"), "scale", "height")
    rates = (
        *((f"plane_{axis}", "frame") for axis in "xyz"),
        *((name, "sphere") for name in given),
        *((name, "pixel") for name in arrays),
    )
    return Part("echo_plane", definitions, ("descent", "t", *_xyz("foot"), *_xyz("next"), "inv_d2"), rates, arrays)


def landing_part(point: str) -> Part:
    """Where a mirrored ray meets the plane, and the ray mirrored there, in two words from two words."""
    echo = echo_plane_part(point)
    own, section = vector("own"), "from sphere to plane"
    eye = sp.Matrix([0, 0, S("eye_z")])
    way = (
        *_vector("origin", (own - eye) / S("height"), section, "the mirror's centre seen from the eye, in heights"),
        Definition("scale", S("own_radius") / S("height"), section, "the mirror's unit in heights"),
    )
    words = (*_xyz("foot"), *_xyz("next"))
    results = (*words, "inv_d2")
    slow = (*_xyz("own"), "eye_z", "own_radius", "height")
    rates = (
        *((name, rate) for name, rate in echo.rates if rate != "sphere"),
        *((name, "sphere") for name in slow),
    )
    definitions = _cut((*way, *echo.definitions), results)
    part = Part("landing", definitions, results, rates, echo.arrays, in_full=words)
    return with_low_words(part, (*_xyz("plane"), "height", "own_radius", *echo.arrays))


def gradient_part() -> Part:
    """s = (1 + up.D / |D|) / 2 of a direction: 0 straight down, 1 straight up."""
    direction, up = vector("d"), vector("up")
    definitions = (
        Definition(
            "climb", up.dot(direction) / sp.sqrt(direction.dot(direction)), "background", "sine of the elevation"
        ),
        Definition("height", sp.Rational(1, 2) + S("climb") / 2, "background", "0 straight down, 1 straight up"),
    )
    rates = (*((f"up_{axis}", "frame") for axis in "xyz"), *_of_points("d"))
    return Part("gradient", definitions, ("height",), rates)


def _xyz(stem: str) -> tuple[str, str, str]:
    return f"{stem}_x", f"{stem}_y", f"{stem}_z"


def _of_points(stem: str) -> tuple[tuple[str, str], ...]:
    return tuple((name, "pixel") for name in _xyz(stem))
