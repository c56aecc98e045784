"""Every part of a scene's kernel is what the textbook says of it: proved by sympy, each statement written here anew.

A statement is a quotient of polynomials that is 0; roots are reduced by their squares. Where a part decides by an
inequality, the identity that carries it is proved, and the decision is tried on rational numbers. Every proof is also
tried on a part that is wrong, to see that it can fail.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import pytest
import sympy as sp

from symrender_cg.derive import parts
from symrender_cg.derive.parts import Part, vector
from symrender_cg.derive.symbols import symbol as S
from symrender_cg.derive.symbols import symbols

Squares = Mapping[sp.Symbol, sp.Expr]
Rests = dict[str, Callable[[], list[Any]]]
"""What is left of each statement: expressions that are 0 where it holds."""

BUILDERS: dict[str, Callable[[], Part]] = {
    "span": lambda: parts.sphere_part(near=False, mirrored=True),
    "near": lambda: parts.sphere_part(near=True, mirrored=True),
    "lamp": parts.lamp_part,
    "reach": lambda: parts.reach_part("p"),
    "matte": lambda: parts.shading_part(glossy=False),
    "glossy": lambda: parts.shading_part(glossy=True),
    "fading": parts.fading_part,
    "shadow": lambda: parts.shadow_part("p"),
    "plane": lambda: parts.plane_part(mirrored=True),
    "tiles": parts.tiles_part,
    "echo": lambda: parts.echo_part("p"),
    "arrival": lambda: parts.arrival_part("p"),
    "echo_plane": lambda: parts.echo_plane_part("p"),
    "gradient": parts.gradient_part,
}


@cache
def part(name: str) -> Part:
    """The part with everything that it can have."""
    return BUILDERS[name]()


def closed(of: Part, value: sp.Expr | str, *keep: str) -> sp.Expr:
    """A quantity of a part in its inputs and in what is kept."""
    value = S(value) if isinstance(value, str) else value
    for definition in reversed(of.definitions):
        if definition.name not in keep:
            value = value.xreplace({definition.symbol: definition.value})
    return value


def closed_vector(of: Part, stem: str, *keep: str) -> sp.Matrix:
    return sp.Matrix([closed(of, f"{stem}_{axis}", *keep) for axis in "xyz"])


def square_of(of: Part, name: str, *keep: str) -> sp.Expr:
    """The square of a quantity that is defined as a root."""
    value = next(d.value for d in of.definitions if d.name == name)
    assert isinstance(value, sp.Pow), name
    assert value.exp == sp.Rational(1, 2), name
    return closed(of, value.base, *keep)


def rest(difference: sp.Expr, squares: Squares | None = None) -> sp.Expr:
    """The numerator of a difference, even powers of each root replaced by its square: 0 where they are equal."""
    numerator = sp.expand(sp.fraction(sp.together(difference))[0])
    for root, square in (squares or {}).items():
        terms = [c * square ** (k // 2) * root ** (k % 2) for (k,), c in sp.Poly(numerator, root).terms()]
        numerator = sp.expand(sp.fraction(sp.together(sp.Add(*terms)))[0])
    return numerator


def rests(difference: sp.Matrix, squares: Squares | None = None) -> list[sp.Expr]:
    return [rest(component, squares) for component in difference]


def failing(found: Rests) -> Iterator[str]:
    """The statements that do not hold, as they are met."""
    return (statement for statement, left in found.items() if any(value != 0 for value in left()))


def spoilt(of: Part, name: str, change: sp.Expr) -> Part:
    """The part with something added to one of its definitions."""
    assert any(definition.name == name for definition in of.definitions), name
    return replace(
        of, definitions=tuple(replace(d, value=d.value + change) if d.name == name else d for d in of.definitions)
    )


# ------------------------------------------------------------------------------------------------ spheres and the eye

X, Y, EYE, RADIUS = symbols("x y eye radius")
CENTER = vector("center")
ORIGIN = sp.Matrix([0, 0, EYE])
RAY = sp.Matrix([X, Y, -EYE])
M = CENTER - ORIGIN
DISC = RADIUS**2 * RAY.dot(RAY) - M.cross(RAY).dot(M.cross(RAY))
"""R^2 |D|^2 - |m x D|^2"""


def test_disc_is_a_quarter_of_the_discriminant_of_ray_and_sphere() -> None:
    """What the statements below rest on: |E + t D - C|^2 = R^2, quadratic in t."""
    t = sp.Symbol("t")
    offset = ORIGIN + t * RAY - CENTER
    quadratic = sp.Poly(sp.expand(offset.dot(offset) - RADIUS**2), t)
    assert sp.expand(quadratic.discriminant() - 4 * DISC) == 0


def sphere_statements(of: Part) -> Rests:
    """With facing a symbol whose square is disc / R^2, and the span's half-length one by its own."""
    n, mirror, facing = closed_vector(of, "n", "facing"), closed_vector(of, "mirror", "facing"), S("facing")
    squares = {facing: DISC / RADIUS**2}
    halves = {S("row_half"): square_of(of, "row_half")} if of.name == "span" else {}
    t = (M.dot(RAY) - RADIUS * facing) / RAY.dot(RAY)
    offset = ORIGIN + t * RAY - CENTER
    distance = closed(of, "hit_distance", "facing", "d_dot_d") / sp.sqrt(S("d_dot_d"))
    found: Rests = {
        "the nearer root is on the sphere": lambda: [rest(offset.dot(offset) - RADIUS**2, squares)],
        "facing2 = disc / R^2": lambda: [rest(closed(of, "facing2", "row_half") - DISC / RADIUS**2, halves)],
        "facing = sqrt(facing2)": lambda: [square_of(of, "facing", "facing2") - S("facing2")],
        "|n| = 1": lambda: [rest(n.dot(n) - 1, squares)],
        "n = (P - C) / R": lambda: rests(n - offset / RADIUS, squares),
        "facing = -n.D": lambda: [rest(n.dot(RAY) + facing, squares)],
        "mirror = D - 2 (n.D) n": lambda: rests(mirror - (RAY - 2 * n.dot(RAY) * n), squares),
        "|mirror| = |D|": lambda: [rest(mirror.dot(mirror) - RAY.dot(RAY), squares)],
        "hit_distance = t |D| / R": lambda: [rest(distance - t / RADIUS, squares)],
        "d_dot_d = |D|^2": lambda: [rest(closed(of, "d_dot_d") - RAY.dot(RAY))],
        "inv_d2 = 1 / |D|^2": lambda: [rest(closed(of, "inv_d2") * RAY.dot(RAY) - 1)],
    }
    if of.name == "near":
        found["before_eye = m.D / R"] = lambda: [rest(closed(of, "before_eye") - M.dot(RAY) / RADIUS)]
    return found


@pytest.mark.parametrize("name", ["span", "near"])
def test_a_sphere_s_normal_mirrored_ray_and_distance_are_those_of_the_nearer_root(name: str) -> None:
    found = sphere_statements(part(name))
    assert list(failing(found)) == []
    assert len(found) >= 11


def _zero(difference: sp.Expr, squares: Squares) -> Callable[[], list[Any]]:
    return lambda: [rest(difference, squares)]


def span_statements(of: Part) -> Rests:
    """The row's ends are the zeros in x of disc; the rows' ends the zeros in y of its discriminant in x."""
    half, root = S("row_half"), sp.Symbol("root_of_alpha", nonnegative=True)
    halves = {half: square_of(of, "row_half")}
    found: Rests = {
        f"disc = 0 at {end}": _zero(DISC.subs(X, closed(of, end, "row_half")), halves) for end in ("x_left", "x_right")
    }
    alpha = closed(of, "alpha")
    discriminant = sp.Poly(sp.expand(DISC), X).discriminant()
    row_disc = closed(of, "row_disc")
    power = alpha + closed(of, "offset_x") ** 2
    found["row_disc is the discriminant in x"] = lambda: [rest(discriminant - 4 * RADIUS**4 * power * row_disc)]
    found["alpha = -(coefficient of x^2) / R^2"] = lambda: [
        rest(sp.Poly(sp.expand(DISC), X).coeff_monomial(X**2) + RADIUS**2 * alpha)
    ]
    for end, sign in (("row_low", -1), ("row_high", 1)):
        row = closed(of, end, "alpha").xreplace({sp.sqrt(S("alpha")): root})
        assert row.has(root)
        found[f"row_disc = 0 at {end}"] = _zero(row_disc.subs(Y, row), {root: alpha})
        slope = sp.diff(row.subs(S("alpha"), root**2), root) * sign
        found[f"{end} on its side"] = _zero(slope - EYE / ((M[2] ** 2 - RADIUS**2) / RADIUS**2), {})
    return found


def test_a_span_s_ends_and_rows_are_those_of_the_silhouette() -> None:
    assert list(failing(span_statements(part("span")))) == []


def random_spheres(count: int) -> list[dict[str, Any]]:
    """Inputs of the part `span` that see the sphere's row: before the eye, near and far, high and low."""
    chance = random.Random(5)
    found = []
    for _ in range(count):
        eye = chance.uniform(0.5, 9.0)
        radius = eye * 10.0 ** chance.uniform(-3.0, 3.0)
        depth = radius * (1.0 + 10.0 ** chance.uniform(-6.0, 3.0))
        x, y = (depth * chance.uniform(-3.0, 3.0) for _ in range(2))
        point = eye * (y + radius * chance.uniform(-1.0, 1.0)) / depth
        numbers = {"eye": eye, "radius": radius, "center_x": x, "center_y": y, "center_z": eye - depth, "y": point}
        found.append({name: mpmath.mpf(value) for name, value in numbers.items()})
    return found


def evaluated(of: Part, known: dict[str, Any]) -> dict[str, Any]:
    """Every definition's value at the working precision of mpmath, in their order, as far as the inputs go."""
    known = dict(known)
    for definition in of.definitions:
        names = sorted(s.name for s in definition.value.free_symbols)
        if all(name in known for name in names):
            function = _function(definition.value, tuple(names))
            known[definition.name] = function(*(known[name] for name in names))
    return known


def _cosine_power(cos2: Any, sin2: Any, exponent: Any) -> Any:
    del sin2
    return mpmath.power(cos2, exponent / 2)


@cache
def _function(value: sp.Expr, names: tuple[str, ...]) -> Callable[..., Any]:
    given = [{"CosinePower": _cosine_power}, "mpmath"]
    found: Callable[..., Any] = sp.lambdify([S(name) for name in names], value, modules=given, cse=False)
    return found


# -------------------------------------------------------------------------------------------------------------- light

P, LAMP, W, N, MIRROR = (vector(stem) for stem in ("p", "lamp", "w", "n", "mirror"))
LIGHT = vector("light")


def light_statements(of: Part) -> Rests:
    """Of `reach`, with the lamp from `lamp`: P = C + R p is the point, L the light."""
    w = closed_vector(of, "w")
    lamp = closed_vector(part("lamp"), "lamp")
    to_light = dict(zip(LAMP, lamp, strict=True))
    at = {S("nearness"): sp.Integer(1)} | to_light
    parallel = {S("nearness"): sp.Integer(0)}
    return {
        "R w = L - P": lambda: rests(RADIUS * w.xreplace(at) - (LIGHT - (CENTER + RADIUS * P))),
        "w = lamp in parallel": lambda: rests(w.xreplace(parallel) - LAMP),
        "w2 = |w|^2": lambda: [rest(closed(of, "w2") - w.dot(w))],
    }


def test_w_leads_from_the_point_to_the_light_or_along_the_parallel_rays() -> None:
    assert list(failing(light_statements(part("reach")))) == []


def test_a_light_in_parallel_is_the_limit_of_a_point_light_ever_farther_away() -> None:
    far = sp.Symbol("far", positive=True)
    w = closed_vector(part("reach"), "w").xreplace({S("nearness"): sp.Integer(1)})
    distant = w.xreplace({lamp: far * lamp for lamp in LAMP}) / far
    assert [sp.limit(component, far, sp.oo) for component in distant] == list(LAMP)


def shading_statements(of: Part) -> Rests:
    """With l = w / |w|, v = -D / |D|, r = 2 (n.l) n - l, |n| = 1 and mirror = D - 2 (n.D) n."""
    ray, length = vector("d"), sp.Symbol("length_of_w", positive=True)
    unit = {N[0]: 1 - N[1] ** 2 - N[2] ** 2}
    mirror = ray - 2 * N.dot(ray) * N
    bent = dict(zip(MIRROR, mirror, strict=True)) | {S("inv_d2"): 1 / ray.dot(ray)}
    lengths = {length: W.dot(W)}
    direction = W / length
    r = 2 * N.dot(direction) * N - direction
    n_dot_l = closed(of, "n_dot_l").xreplace({S("w2"): length**2}).replace(sp.sqrt(length**-2), 1 / length)
    found: Rests = {"n.l": lambda: [rest(n_dot_l - N.dot(direction), lengths)]}
    if of.name == "glossy":
        found["w.mirror = (r.v) |w| |D|"] = lambda: [
            rest(closed(of, "w_dot_mirror").xreplace(bent) - r.dot(-ray) * length, lengths)
        ]
        r_dot_v2 = r.dot(-ray) ** 2 / ray.dot(ray)
        cos2, sin2 = (closed(of, name).xreplace({S("w2"): W.dot(W)}).xreplace(bent) for name in ("cos2", "sin2"))
        found["cos2 = (r.v)^2"] = lambda: [rest(cos2 - r_dot_v2, lengths)]
        found["sin2 = 1 - (r.v)^2"] = lambda: [_unit_rest(sin2 - (1 - r_dot_v2), lengths, unit)]
    return found


def _unit_rest(difference: sp.Expr, lengths: Squares, unit: Squares) -> sp.Expr:
    """The rest where n has length 1: N[0] is the one symbol by whose square the others are known."""
    (root, square), *_ = unit.items()
    return rest(difference, {**lengths, root: square})


@pytest.mark.parametrize("name", ["matte", "glossy"])
def test_cosine_and_highlight_are_phong_s(name: str) -> None:
    assert list(failing(shading_statements(part(name)))) == []


def values(of: Part, **given: Any) -> dict[str, Any]:
    return evaluated(of, {name: mpmath.mpf(value) for name, value in given.items()})


SHADED = {"n_x": 0, "n_y": 0, "n_z": 1, "mirror_x": 0, "mirror_y": 0, "mirror_z": 2, "inv_d2": 0.25, "shininess": 3}


@pytest.mark.parametrize(
    ("w", "shininess", "cosine", "lobe"),
    [
        ((0, 3, 4), 3, 0.8, 0.8**3),
        ((0, 3, -4), 3, 0, 0),
        ((0, 3, -4), 0, 0, 1),
        ((0, 1, 0), 0, 0, 1),
        ((0, 1, 0), 0.5, 0, 0),
        ((0, 3, 4), 0, 0.8, 1),
    ],
)
def test_shading_ends_where_the_light_is_below_the_horizon_and_x_to_the_0_is_1(
    w: tuple[float, float, float], shininess: float, cosine: float, lobe: float
) -> None:
    given = SHADED | dict(zip(("w_x", "w_y", "w_z"), w, strict=True)) | {"shininess": shininess}
    found = values(part("glossy"), w2=sum(c * c for c in w), **given)
    assert mpmath.almosteq(found["cosine"], cosine, abs_eps=1e-15)
    assert mpmath.almosteq(found["lobe"], lobe, abs_eps=1e-15)


def test_a_light_at_the_point_itself_adds_nothing() -> None:
    """Only the branches of w2 > 0 are asked: what stands behind them is never reached."""
    for name, result in (("matte", "cosine"), ("glossy", "cosine"), ("glossy", "lobe")):
        value = next(d.value for d in part(name).definitions if d.name == result)
        assert value.subs(S("w2"), 0) == 0
        assert value.subs(S("w2"), sp.Rational(1, 7)) != 0


def fading_statements(of: Part) -> Rests:
    """At the distance l = r |w| of a light whose attenuation is (a, b, c): fading (a + b l + c l^2) = 1."""
    a, b, c, r = sp.symbols("a b c r", positive=True)
    length = S("w_length")
    given = {S("fade_a"): a, S("fade_b"): b * r, S("fade_c"): c * r**2}
    distance = r * length
    fading = closed(of, "fading", "w_length").xreplace(given)
    return {
        "fading = 1 / (a + b l + c l^2)": lambda: [rest(fading * (a + b * distance + c * distance**2) - 1)],
        "w_length^2 = |w|^2, no more than the farthest": lambda: [
            square_of(of, "w_length").subs({S("w2"): w2, S("farthest2"): 25}) - min(w2, 25) for w2 in (0, 9, 25, 10**40)
        ],
    }


def test_a_light_fades_with_the_distance_in_scene_units() -> None:
    assert list(failing(fading_statements(part("fading")))) == []


# ------------------------------------------------------------------------------------------------------------ shadows


def shadow_statements(of: Part) -> Rests:
    """s_0 is where p + s w is nearest to the blocker's centre; there its distance is at most the blocker's radius."""
    s = sp.Symbol("s", real=True)
    away = P + s * W - vector("gap")
    square = sp.expand(away.dot(away))
    nearest = sp.solve(sp.diff(square, s), s)
    assert len(nearest) == 1
    at = {S("w2"): W.dot(W)}
    inside2, toward = closed(of, "inside2").xreplace(at), closed(of, "toward").xreplace(at)
    return {
        "toward = s_0 |w|^2": lambda: [rest(toward - nearest[0] * W.dot(W))],
        "inside2 = |w|^2 (ratio^2 - distance^2 at s_0)": lambda: [
            rest(inside2 - W.dot(W) * (S("ratio2") - square.subs(s, nearest[0])))
        ],
        "the distance is least there": lambda: [rest(sp.diff(square, s, 2) - 2 * W.dot(W))],
    }


def test_a_shadow_falls_where_the_nearest_point_of_the_way_lies_in_the_ball() -> None:
    assert list(failing(shadow_statements(part("shadow")))) == []


def is_dark(of: Part, p: list[Fraction], w: list[Fraction], gap: list[Fraction], ratio: Fraction, far: Any) -> bool:
    """The part's decision, in rational numbers."""
    known: dict[sp.Symbol, Any] = {S("ratio2"): sp.Rational(ratio**2), S("far"): far, S("light"): sp.Integer(1)}
    known |= {
        S(f"{stem}_{axis}"): sp.Rational(v)
        for stem, v3 in (("p", p), ("w", w), ("gap", gap))
        for axis, v in zip("xyz", v3, strict=True)
    }
    known[S("w2")] = sp.Rational(sum(c * c for c in w))
    for definition in of.definitions:
        known[definition.symbol] = definition.value.xreplace(known)
    assert known[S("shade")] in (0, 1)
    return bool(known[S("shade")] == 0)


def meets(p: list[Fraction], w: list[Fraction], gap: list[Fraction], ratio: Fraction, end: Fraction | None) -> bool:
    """Whether the segment p + s w, 0 < s < end (a half-line for None), comes within `ratio` of the centre."""
    b = [g - a for g, a in zip(gap, p, strict=True)]
    w2 = sum(c * c for c in w)
    s = max(sum(x * y for x, y in zip(b, w, strict=True)) / w2, Fraction(0))
    s = s if end is None else min(s, end)
    return sum((x - s * y) ** 2 for x, y in zip(b, w, strict=True)) < ratio**2


def test_a_shadow_is_decided_as_by_the_distance_of_segment_and_ball() -> None:
    """Points and lights on a grid of rationals, outside the ball and inside; in parallel; each answer occurs."""
    chance, answers = random.Random(11), {False: 0, True: 0}
    of = part("shadow")
    for _ in range(400):
        p, lamp, gap = ([Fraction(chance.randint(-12, 12), 4) for _ in range(3)] for _ in range(3))
        ratio = Fraction(chance.randint(1, 8), 4)
        w = [a - b for a, b in zip(lamp, p, strict=True)]
        outside = sum((a - b) ** 2 for a, b in zip(p, gap, strict=True)) > ratio**2
        if not outside or not any(w):
            continue
        to_lamp = sum((a - b) ** 2 for a, b in zip(lamp, gap, strict=True)) - ratio**2
        if to_lamp != 0:  # as the kernel sets it: no end where the light is within the blocker
            far = sp.Integer(1) if to_lamp > 0 else sp.oo
            dark = is_dark(of, p, w, gap, ratio, far)
            assert dark == meets(p, w, gap, ratio, Fraction(1))
            assert dark or to_lamp > 0
            answers[dark] += 1
        assert is_dark(of, p, w, gap, ratio, sp.oo) == meets(p, w, gap, ratio, None)
    assert min(answers.values()) > 20


# -------------------------------------------------------------------------------------------------------------- plane

PLANE = vector("plane")
UNIT = {PLANE[0]: 1 - PLANE[1] ** 2 - PLANE[2] ** 2}
"""|n| = 1"""


def plane_statements(of: Part) -> Rests:
    """The plane n.(X - E) = -h, rays of the eye E + t D; p = (P - E) / h."""
    p, mirror, height = closed_vector(of, "p"), closed_vector(of, "mirror"), sp.Symbol("h", positive=True)
    point = ORIGIN + height * p
    n = closed_vector(of, "n")
    return {
        "P on the plane": lambda: [rest(PLANE.dot(point - ORIGIN) + height)],
        "P on the ray": lambda: rests((point - ORIGIN).cross(RAY)),
        "in front of the eye where descent > 0": lambda: [rest(p.dot(RAY) * closed(of, "descent") - RAY.dot(RAY))],
        "hit_distance = |P - E| / h": lambda: [rest(closed(of, "hit_distance") ** 2 - p.dot(p))],
        "n is the plane's": lambda: rests(n - PLANE),
        "descent = -n.D": lambda: [rest(closed(of, "descent") + n.dot(RAY))],
        "mirror = D - 2 (n.D) n": lambda: rests(mirror - (RAY - 2 * n.dot(RAY) * n)),
        "|mirror| = |D|": lambda: [rest(mirror.dot(mirror) - RAY.dot(RAY), UNIT)],
        "inv_d2 = 1 / |D|^2": lambda: [rest(closed(of, "inv_d2") * RAY.dot(RAY) - 1)],
    }


def test_a_point_of_the_plane_lies_on_the_plane_and_on_the_ray() -> None:
    assert list(failing(plane_statements(part("plane")))) == []


def test_tiles_are_the_parity_of_the_sum_of_floors() -> None:
    """In float64 as in C: random points, negative numbers of tiles, and points on their edges."""
    of = part("tiles")
    names = (*(f"{stem}_{axis}" for stem in ("across", "along", "p") for axis in "xyz"), "across_0", "along_0")
    function = sp.lambdify([S(name) for name in names], closed(of, "parity"), modules="math")
    chance, seen = random.Random(3), {0: 0, 1: 0}
    for turn in range(2000):
        whole = turn % 2 == 0
        numbers = [float(chance.randint(-5, 5)) if whole else chance.uniform(-50.0, 50.0) for _ in names]
        across, along, p, (across_0, along_0) = numbers[:3], numbers[3:6], numbers[6:9], numbers[9:]
        u = Fraction(across_0) + sum(Fraction(a) * Fraction(b) for a, b in zip(across, p, strict=True))
        v = Fraction(along_0) + sum(Fraction(a) * Fraction(b) for a, b in zip(along, p, strict=True))
        if not whole and min(abs(u - round(u)), abs(v - round(v))) < 1e-9:
            continue
        wanted = (math.floor(u) + math.floor(v)) % 2
        assert function(*numbers) == wanted
        seen[wanted] += 1
    assert min(seen.values()) > 500


# ------------------------------------------------------------------------------------------------------------ mirrors

TO = vector("to")
R_OF, R_TO = sp.symbols("r_of r_to", positive=True)
LINK = dict(zip(vector("link"), TO / R_TO, strict=True)) | {S("shrink"): R_OF / R_TO, S("reach"): R_TO}
"""How the kernel sets them: from a receiver of unit r_of at the origin to a sphere of radius r_to at `to`."""

ROOT = sp.Symbol("root", nonnegative=True)


def echo_disc() -> sp.Expr:
    """A quarter of the discriminant of |P + t d - C|^2 = R^2 in t, over R^2, for P = r_of p."""
    t = sp.Symbol("t")
    away = R_OF * P + t * MIRROR - TO
    quadratic = sp.Poly(sp.expand(away.dot(away) - R_TO**2), t)
    return sp.expand(quadratic.discriminant() / (4 * R_TO**2))


def echo_statements(of: Part) -> Rests:
    """`echo`: where P + t d meets the sphere, by the general quadratic."""
    point = R_OF * P
    squares = {ROOT: echo_disc()}
    disc, ahead = closed(of, "disc").xreplace(LINK), closed(of, "ahead").xreplace(LINK)
    t = closed(of, "t", "facing").xreplace(LINK).xreplace({S("facing"): ROOT})
    nearer = ((TO - point).dot(MIRROR) - R_TO * ROOT) / MIRROR.dot(MIRROR)
    away = point + nearer * MIRROR - TO
    return {
        "disc is the quadratic's": lambda: [rest(disc - echo_disc())],
        "facing = sqrt(disc)": lambda: [square_of(of, "facing", "disc") - S("disc")],
        "ahead = (C - P).d / R": lambda: [rest(ahead - (TO - point).dot(MIRROR) / R_TO)],
        "t is the nearer root": lambda: [rest(t - nearer, squares)],
        "P + t d on the sphere": lambda: [rest(away.dot(away) - R_TO**2, squares)],
    }


def test_a_mirrored_ray_meets_a_sphere_where_the_quadratic_says() -> None:
    assert list(failing(echo_statements(part("echo")))) == []


def arrival_statements(of: Part) -> Rests:
    """`arrival`: the normal at that point, and the ray mirrored there."""
    point = R_OF * P
    squares = {ROOT: echo_disc()}
    to_root = {S("facing"): ROOT}
    n, onward = (closed_vector(of, stem, "facing").xreplace(LINK).xreplace(to_root) for stem in ("n", "next"))
    t = ((TO - point).dot(MIRROR) - R_TO * ROOT) / MIRROR.dot(MIRROR)
    return {
        "n = (P + t d - C) / R": lambda: rests(n - (point + t * MIRROR - TO) / R_TO, squares),
        "|n| = 1": lambda: [rest(n.dot(n) - 1, squares)],
        "facing = -n.d": lambda: [rest(n.dot(MIRROR) + ROOT, squares)],
        "next = d - 2 (n.d) n": lambda: rests(onward - (MIRROR - 2 * n.dot(MIRROR) * n), squares),
        "|next| = |d|": lambda: [rest(onward.dot(onward) - MIRROR.dot(MIRROR), squares)],
        "inv_d2 = 1 / |d|^2": lambda: [rest(closed(of, "inv_d2") * MIRROR.dot(MIRROR) - 1)],
        "facing = sqrt(disc)": lambda: [rest(square_of(of, "facing").xreplace(LINK) - echo_disc())],
    }


def test_where_a_mirrored_ray_arrives_the_normal_has_length_1_and_mirrors_it_once_more() -> None:
    assert list(failing(arrival_statements(part("arrival")))) == []


def echo_plane_statements(of: Part) -> Rests:
    """`echo_plane`: P + t d on the plane n.(X - E) = -h, for P = r_of p."""
    height, eye = S("height"), vector("e")
    start = {S(f"origin_{axis}"): -eye[k] / height for k, axis in enumerate("xyz")}
    start[S("scale")] = R_OF / height
    point = R_OF * P
    t = closed(of, "t").xreplace(start)
    foot, onward = closed_vector(of, "foot").xreplace(start), closed_vector(of, "next").xreplace(start)
    hit = point + t * MIRROR
    return {
        "P + t d on the plane": lambda: [rest(PLANE.dot(hit - eye) + height)],
        "foot = (P + t d - E) / h": lambda: rests(foot - (hit - eye) / height),
        "descent = -n.d": lambda: [rest(closed(of, "descent") + PLANE.dot(MIRROR))],
        "next = d - 2 (n.d) n": lambda: rests(onward - (MIRROR - 2 * PLANE.dot(MIRROR) * PLANE)),
        "|next| = |d|": lambda: [rest(onward.dot(onward) - MIRROR.dot(MIRROR), UNIT)],
        "inv_d2 = 1 / |d|^2": lambda: [rest(closed(of, "inv_d2") * MIRROR.dot(MIRROR) - 1)],
    }


def test_a_mirrored_ray_meets_the_plane_where_it_lies() -> None:
    assert list(failing(echo_plane_statements(part("echo_plane")))) == []


# --------------------------------------------------------------------------------------------------------- background


def gradient_statements(of: Part) -> Rests:
    """s = (1 + up.d / |d|) / 2, for |up| = 1."""
    d, up, k = vector("d"), vector("up"), sp.Symbol("k", positive=True)
    unit = {up[0]: 1 - up[1] ** 2 - up[2] ** 2}
    s = closed(of, "height")
    length = sp.Symbol("length_of_d", positive=True)
    rooted = s.xreplace({sp.sqrt(d.dot(d)): length, 1 / sp.sqrt(d.dot(d)): 1 / length})

    def along(direction: sp.Matrix) -> sp.Expr:
        square = sp.expand(direction.dot(direction))
        numerator = up.dot(direction)
        return (1 + numerator / sp.sqrt(square)) / 2, rooted.xreplace(dict(zip(d, direction, strict=True)))

    straight_up = along(k * up)[1].xreplace({length: k})
    straight_down = along(-k * up)[1].xreplace({length: k})
    level = along(up.cross(d))[1]
    return {
        "(2 s - 1) |d| = up.d": lambda: [rest((2 * rooted - 1) * length - up.dot(d))],
        "1 straight up": lambda: [rest(straight_up - 1, unit)],
        "0 straight down": lambda: [rest(straight_down, unit)],
        "1/2 on the horizon": lambda: [rest(level - sp.Rational(1, 2))],
    }


def test_the_background_is_the_bottom_s_straight_down_and_the_top_s_straight_up() -> None:
    assert list(failing(gradient_statements(part("gradient")))) == []


# --------------------------------------------------------------------------------------------------- proofs can fail

STATEMENTS: dict[str, Callable[[Part], Rests]] = {
    "near": sphere_statements,
    "span": sphere_statements,
    "reach": light_statements,
    "glossy": shading_statements,
    "fading": fading_statements,
    "shadow": shadow_statements,
    "plane": plane_statements,
    "echo": echo_statements,
    "arrival": arrival_statements,
    "echo_plane": echo_plane_statements,
    "gradient": gradient_statements,
}

LITTLE = sp.Rational(1, 10**9)
SPOILT = [
    ("near", "n_z", LITTLE),
    ("near", "cross_y", X),
    ("near", "bounce", LITTLE),
    ("near", "power", LITTLE),
    ("near", "before_eye", LITTLE),
    ("span", "n_x", S("facing") * LITTLE),
    ("span", "ahead", LITTLE),
    ("span", "row_mid", Y * LITTLE),
    ("reach", "w_y", S("p_y")),
    ("glossy", "w_dot_mirror", S("w_x")),
    ("glossy", "side_z", LITTLE),
    ("glossy", "n_dot_l", LITTLE),
    ("fading", "fading", LITTLE),
    ("fading", "finite_w2", LITTLE),
    ("shadow", "cross_x", S("w_x") * LITTLE),
    ("shadow", "toward", LITTLE),
    ("shadow", "inside2", LITTLE),
    ("plane", "p_z", LITTLE),
    ("plane", "bounce", LITTLE),
    ("plane", "descent", LITTLE),
    ("echo", "m_x", S("shrink")),
    ("echo", "t", LITTLE),
    ("echo", "ahead", LITTLE),
    ("arrival", "n_y", LITTLE),
    ("arrival", "next_z", S("mirror_z") * LITTLE),
    ("arrival", "disc", LITTLE),
    ("echo_plane", "t_plane", LITTLE),
    ("echo_plane", "foot_x", LITTLE),
    ("echo_plane", "bounce", LITTLE),
    ("gradient", "climb", LITTLE),
    ("gradient", "height", LITTLE),
]


@pytest.mark.parametrize(("name", "quantity", "change"), SPOILT, ids=[f"{n}.{q}" for n, q, _ in SPOILT])
def test_a_part_that_is_wrong_is_seen_to_be(name: str, quantity: str, change: sp.Expr) -> None:
    assert any(failing(STATEMENTS[name](spoilt(part(name), quantity, change))))


def test_a_span_whose_rows_are_wrong_is_seen_to_be() -> None:
    for quantity in ("row_low", "row_high", "alpha"):
        assert any(failing(span_statements(spoilt(part("span"), quantity, LITTLE)))), quantity


def test_every_part_is_stated_and_defines_all_that_it_gives() -> None:
    assert set(BUILDERS) == {*STATEMENTS, "lamp", "matte", "tiles"}
    for name in BUILDERS:
        of = part(name)
        assert of.name == name
        assert set(of.results) <= {definition.name for definition in of.definitions}
        assert {rate_of for rate_of, _ in of.rates} >= set(of.inputs) - {"eye"}
