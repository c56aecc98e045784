"""The image of a Phong-shaded sphere, derived from vectors: ray, hit point, normal, light, intensity.

Everything is written once, for a sphere anywhere and a camera at (0, 0, e); a centred sphere is the specialisation
c = 0 of the same definitions. What a plan leaves out (a term, the front test, the gate) is never derived.
"""

from __future__ import annotations

import sympy as sp

from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.symbols import symbol, symbols
from symrender_cg.plan.plan import Plan

PHONG = "Phong 1975, Illumination for computer generated pictures"
LAGRANGE = "Lagrange's identity |m|^2 |D|^2 - (m.D)^2 = |m x D|^2"


def derive(plan: Plan) -> ImageProgram:
    """The definitions of the planned image, in the order of the mathematics."""
    program = derive_sphere(
        plan.name,
        front_test=plan.needs("front_test"),
        diffuse=plan.needs("diffuse"),
        specular=plan.needs("specular"),
        gated=plan.needs("specular_gate"),
    )
    return program if plan.needs("off_axis") else centred(program)


def derive_sphere(name: str, *, front_test: bool, diffuse: bool, specular: bool, gated: bool) -> ImageProgram:
    """The definitions of the image of one sphere anywhere under one point light, with the terms asked for."""
    definitions = [*_ray_and_sphere(), *_hit_point()]
    if diffuse or specular:
        definitions += _light()
    definitions += _shading(diffuse=diffuse, specular=specular, gated=gated)
    guard = ("disc", "m_dot_d") if front_test else ("disc",)
    return ImageProgram(name=name, definitions=(), guard=guard).replacing(tuple(definitions))


def centred(program: ImageProgram) -> ImageProgram:
    """The specialisation C = (0, 0, 0) of a program: the sphere of Chapter 1.

    Definitions that become a number or another name are substituted into those that use them, except the image's value.
    """
    known: dict[sp.Symbol, sp.Expr] = {symbol(f"center_{axis}"): sp.Integer(0) for axis in "xyz"}
    kept: list[Definition] = []
    for definition in program.definitions:
        value = definition.value.xreplace(known).doit()
        trivial = value.is_number or value.is_Symbol or (-value).is_Symbol
        if trivial and definition.name != program.value:
            known[definition.symbol] = value
        else:
            kept.append(Definition(definition.name, value, definition.section, definition.meaning, definition.source))
    return program.replacing(tuple(kept))


def direction() -> sp.Matrix:
    """D = (x, y, -e): the primary ray through (x, y), not normalised."""
    x, y, eye = symbols("x y eye")
    return sp.Matrix([x, y, -eye])


def _ray_and_sphere() -> list[Definition]:
    eye, radius, center_z = symbols("eye radius center_z")
    ray = direction()
    m = sp.Matrix(symbols("m_x m_y m_z"))
    cross = m.cross(ray)
    section = "ray and sphere"
    return [
        Definition("m_x", symbol("center_x"), section, "m = C - E, the centre seen from the eye"),
        Definition("m_y", symbol("center_y"), section),
        Definition("m_z", center_z - eye, section),
        Definition("d_dot_d", ray.dot(ray), section, "D = (x, y, -e), A = |D|^2"),
        Definition("m_dot_d", m.dot(ray), section, "positive where the sphere lies before the eye"),
        Definition("cross_x", cross[0], section, "m x D", LAGRANGE),
        Definition("cross_y", cross[1], section),
        Definition("cross_z", cross[2], section),
        Definition(
            "disc",
            radius**2 * symbol("d_dot_d") - sum(symbol(f"cross_{axis}") ** 2 for axis in "xyz"),
            section,
            "disc = R^2 |D|^2 - |m x D|^2, the reduced discriminant of |E + t D - C|^2 = R^2: a hit where disc >= 0",
            LAGRANGE,
        ),
        Definition("root", sp.sqrt(symbol("disc")), section),
    ]


def _hit_point() -> list[Definition]:
    eye, radius, t = symbols("eye radius t")
    ray = direction()
    origin = sp.Matrix([0, 0, eye])
    center = sp.Matrix(symbols("center_x center_y center_z"))
    hit = sp.Matrix(symbols("hit_x hit_y hit_z"))
    section = "hit point and normal"
    point = origin + t * ray
    point[2] = eye * (1 - t)
    normal = (hit - center) / radius
    return [
        Definition(
            "t", (symbol("m_dot_d") - symbol("root")) / symbol("d_dot_d"), section, "nearer root of the quadratic"
        ),
        *(
            Definition(f"hit_{axis}", point[i], section, "P = E + t D" if i == 0 else "")
            for i, axis in enumerate("xyz")
        ),
        *(
            Definition(f"n_{axis}", normal[i], section, "n = (P - C) / R, of length 1" if i == 0 else "")
            for i, axis in enumerate("xyz")
        ),
    ]


def _light() -> list[Definition]:
    section = "light"
    position = sp.Matrix(symbols("light_x light_y light_z"))
    hit = sp.Matrix(symbols("hit_x hit_y hit_z"))
    w = sp.Matrix(symbols("w_x w_y w_z"))
    toward = position - hit
    length = symbol("w_length")
    n = sp.Matrix(symbols("n_x n_y n_z"))
    light = sp.Matrix(symbols("l_x l_y l_z"))
    return [
        *(Definition(f"w_{axis}", toward[i], section, "w = L - P" if i == 0 else "") for i, axis in enumerate("xyz")),
        Definition("w_length", sp.sqrt(w.dot(w)), section),
        *(
            Definition(f"l_{axis}", w[i] / length, section, "l = w / |w|" if i == 0 else "")
            for i, axis in enumerate("xyz")
        ),
        Definition("n_dot_l", n.dot(light), section, "n.l"),
    ]


def _shading(*, diffuse: bool, specular: bool, gated: bool) -> list[Definition]:
    n_dot_l = symbol("n_dot_l")
    definitions: list[Definition] = []
    total: sp.Expr = symbol("k_ambient")
    terms: list[sp.Expr] = []
    if diffuse:
        section = "diffuse"
        definitions.append(
            Definition("diffuse", symbol("k_diffuse") * sp.Max(0, n_dot_l), section, "k_d max(0, n.l)", PHONG)
        )
        terms.append(symbol("diffuse"))
    if specular:
        definitions += _specular(gated=gated)
        terms.append(symbol("specular"))
    if terms:
        lit = symbol("light_intensity") * sp.Add(*terms)
        definitions.append(Definition("lit", lit, "intensity", "what the light adds: I_L (diffuse + specular)"))
        total = total + symbol("lit")
    return [*definitions, Definition("value", total, "intensity", "I = k_a + what the light adds", PHONG)]


def _specular(*, gated: bool) -> list[Definition]:
    section = "specular"
    ray = direction()
    v = -ray / symbol("d_length")
    light = sp.Matrix(symbols("l_x l_y l_z"))
    r_dot_v = symbol("r_dot_v")
    term = symbol("k_specular") * sp.Max(0, r_dot_v) ** symbol("shininess")
    if gated:
        term = sp.Piecewise((term, symbol("n_dot_l") > 0), (0, True))
    return [
        Definition("d_length", sp.sqrt(symbol("d_dot_d")), section),
        *(
            Definition(
                f"v_{axis}", v[i], section, "v = (E - P) / |E - P| = -D / |D|: no hit point in it" if i == 0 else ""
            )
            for i, axis in enumerate("xyz")
        ),
        Definition("l_dot_v", light.dot(sp.Matrix(symbols("v_x v_y v_z"))), section, "l.v"),
        Definition(
            "n_dot_v", symbol("root") / (symbol("radius") * symbol("d_length")), section, "n.v = root / (R |D|)"
        ),
        Definition(
            "r_dot_v",
            2 * symbol("n_dot_l") * symbol("n_dot_v") - symbol("l_dot_v"),
            section,
            "r.v with r = 2 (n.l) n - l, the light mirrored at the normal",
            PHONG,
        ),
        Definition("specular", term, section, "k_s max(0, r.v)^n" + (", where n.l > 0" if gated else ""), PHONG),
    ]
