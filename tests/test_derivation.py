"""The derivation is the seed's mathematics: proved for the centred sphere, specialised from a sphere anywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp
from evaluators import STRUCTURES, scene_of

from symrender_cg.derive import seed as seed_cells
from symrender_cg.derive.exact import sign_tests
from symrender_cg.derive.image import centred, derive
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.proofs import prove_invariants
from symrender_cg.derive.symbols import INPUTS, latex_names, symbol, symbols
from symrender_cg.pipeline import translate
from symrender_cg.plan.plan import plan
from symrender_cg.reference import camera_numbers, decisions, hard_places
from symrender_cg.scene import Scene

X, Y, E, R = symbols("x y eye radius")
LIGHT = sp.Matrix(symbols("light_x light_y light_z"))
KA, KD, KS, N, INTENSITY, BACKGROUND = symbols("k_ambient k_diffuse k_specular shininess light_intensity background")


@cache
def image(name: str) -> ImageProgram:
    return derive(plan(STRUCTURES[name]))


@cache
def forced(*effects: str) -> ImageProgram:
    return derive(plan(Scene.chapter1(), force=effects))


def vanishes(difference: sp.Expr, root: sp.Symbol, square: sp.Expr) -> bool:
    """Whether a rational expression in `root` is 0, given root^2 = square."""
    numerator = sp.expand(sp.fraction(sp.together(difference))[0])
    return bool(sp.expand(sp.rem(sp.Poly(numerator, root), sp.Poly(root**2 - square, root)).as_expr()) == 0)


# ---- the seed's own formulas, written here once more


def seed_discriminant() -> sp.Expr:
    """Chapter 1, section 3: e^2 R^2 - (e^2 - R^2)(x^2 + y^2)."""
    return E**2 * R**2 - (E**2 - R**2) * (X**2 + Y**2)


@dataclass(frozen=True)
class Terms:
    """n.l and r.v of a derivation, and the squares of the two lengths in their denominators."""

    n_dot_l: sp.Expr
    r_dot_v: sp.Expr
    w_squared: sp.Expr
    d_squared: sp.Expr


def section_3(q: sp.Expr, length_w: sp.Expr | None = None, length_d: sp.Expr | None = None) -> Terms:
    """Section 3's closed form, q for the square root of the discriminant; lengths as symbols if they are given."""
    area = X**2 + Y**2 + E**2
    t = (E**2 - q) / area
    hit = sp.Matrix([t * X, t * Y, E * (1 - t)])
    w = LIGHT - hit
    w_hat = w / (length_w or sp.sqrt(w.dot(w)))
    d = length_d or sp.sqrt(area)
    mu, nu = (hit / R).dot(w_hat), q / (R * d)
    return Terms(mu, 2 * mu * nu - w_hat.dot(sp.Matrix([-X, -Y, E]) / d), w.dot(w), area)


def cell_2(q: sp.Expr, length_w: sp.Expr | None = None, length_d: sp.Expr | None = None) -> Terms:
    """Cell 2's construction from vectors: r = 2 (n.l) n - l, v = -D / |D|, nothing simplified."""
    eye, ray = sp.Matrix([0, 0, E]), sp.Matrix([X, Y, -E])
    area, b = ray.dot(ray), eye.dot(ray)
    hit = eye + (-b - q) / area * ray
    normal = hit / R
    w = LIGHT - hit
    w_hat = w / (length_w or sp.sqrt(w.dot(w)))
    ndl = normal.dot(w_hat)
    r_vec = 2 * ndl * normal - w_hat
    return Terms(ndl, r_vec.dot(-ray / (length_d or sp.sqrt(area))), w.dot(w), area)


def seed_image(terms: Terms) -> sp.Piecewise:
    """I = k_a + k_d max(0, n.l) + k_s max(0, r.v)^n where the discriminant is not negative; else 0."""
    shade = KA + KD * sp.Max(0, terms.n_dot_l) + KS * sp.Max(0, terms.r_dot_v) ** N
    return sp.Piecewise((shade, sp.Ge(seed_discriminant(), 0, evaluate=False)), (0, True), evaluate=False)


def value_of(piecewise: sp.Piecewise, place: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """50 digits of the first branch whose condition holds there; the others are not looked at."""
    branch = next(value for value, condition in piecewise.args if condition.xreplace(place) == sp.true)
    return sp.N(branch.xreplace(place), 50)


# ---- the centred sphere


@cache
def recovered() -> sp.Piecewise:
    return image("centred_sphere").as_piecewise()


def test_the_discriminant_is_the_seeds() -> None:
    assert sp.expand(image("centred_sphere").closed("disc") - seed_discriminant()) == 0


def test_the_recovered_piecewise_branches_where_the_seeds_does() -> None:
    (_, condition), (outside, otherwise) = recovered().args
    assert otherwise == sp.true
    assert outside == BACKGROUND
    assert condition.func in (sp.Ge, sp.Le)
    positive = condition.lhs - condition.rhs if condition.func is sp.Ge else condition.rhs - condition.lhs
    assert sp.expand(positive - seed_discriminant()) == 0


@pytest.mark.parametrize("terms", [section_3, cell_2], ids=["section_3", "cell_2"])
def test_the_shading_is_proved_equal_to_the_seeds_closed_form(terms: Callable[..., Terms]) -> None:
    """Part by part, which together are all of it: the sum, n.l and r.v, and the lengths they are divided by."""
    program = image("centred_sphere")
    q, length_w, length_d, n_dot_l, r_dot_v = symbols("root w_length d_length n_dot_l r_dot_v")
    total = program.closed("value", keep=("n_dot_l", "r_dot_v"))
    expected = KA + INTENSITY * (KD * sp.Max(0, n_dot_l) + KS * sp.Max(0, r_dot_v) ** N)
    assert sp.expand(total - expected) == 0

    disc, seed = seed_discriminant(), terms(q, length_w, length_d)
    for name, formula in (("n_dot_l", seed.n_dot_l), ("r_dot_v", seed.r_dot_v)):
        ours = program.closed(name, keep=("root", "w_length", "d_length"))
        assert vanishes(ours - formula, q, disc), name
    for name, square in (("w_length", seed.w_squared), ("d_length", seed.d_squared)):
        assert vanishes(program.closed(name, keep=("root",)) ** 2 - square, q, disc), name
    assert program["root"].value == sp.sqrt(symbol("disc"))


def test_a_changed_sign_would_not_be_proved_equal() -> None:
    """The control: the proof is of this formula and of no other."""
    q, length_w, length_d = symbols("root w_length d_length")
    ours = image("centred_sphere").closed("r_dot_v", keep=("root", "w_length", "d_length"))
    assert not vanishes(ours + section_3(q, length_w, length_d).r_dot_v, q, seed_discriminant())


NUMBERS = {
    E: sp.Integer(4),
    R: sp.Integer(1),
    LIGHT[0]: sp.Integer(5),
    LIGHT[1]: sp.Integer(5),
    LIGHT[2]: sp.Integer(10),
    KA: sp.Rational(1, 10),
    KD: sp.Rational(7, 10),
    KS: sp.Rational(1, 2),
    N: sp.Integer(32),
    INTENSITY: sp.Integer(1),
    BACKGROUND: sp.Integer(0),
}


@pytest.mark.parametrize("point", [(0, 0), ("1/3", "2/7"), ("-3/4", "1/2"), ("1/5", "-9/10"), ("11/10", 0)])
def test_the_whole_piecewise_has_the_seeds_value_to_40_digits(point: tuple[object, object]) -> None:
    place = NUMBERS | {X: sp.Rational(point[0]), Y: sp.Rational(point[1])}
    seed = seed_image(cell_2(sp.sqrt(seed_discriminant())))
    ours, theirs = value_of(recovered(), place), value_of(seed, place)
    assert abs(ours - theirs) < sp.Float(10) ** -40


def test_the_general_derivation_at_the_origin_is_the_centred_one() -> None:
    """C = 0 put into every quantity that both derivations have: the same expressions, exactly."""
    general, special = forced("off_axis"), image("centred_sphere")
    at_origin = {symbol(f"center_{axis}"): sp.Integer(0) for axis in "xyz"}
    assert set(at_origin) <= {symbol(name) for name in general.inputs}
    for name in ("disc", "d_dot_d", "t", "n_x", "n_y", "n_z", "n_dot_l", "n_dot_v", "l_dot_v", "r_dot_v", "value"):
        keep = tuple(k for k in ("root", "w_length", "d_length", "n_dot_l", "r_dot_v") if k != name)
        difference = general.closed(name, keep=keep).xreplace(at_origin) - special.closed(name, keep=keep)
        assert vanishes(difference, symbol("root"), seed_discriminant()), name


def test_centring_twice_changes_nothing() -> None:
    once = centred(forced("off_axis"))
    assert centred(once) == once
    assert once.definitions == image("centred_sphere").definitions


@pytest.mark.parametrize("accuracy", ["literal", "double", "single"])
def test_the_centred_kernel_is_simpler_than_the_general_one(accuracy: str) -> None:
    special, general = (translate(scene_of(name), accuracy) for name in ("centred_sphere", "off_axis_sphere"))
    assert not any(name.startswith("center_") for name in special.emitted.inputs)
    assert {"center_x", "center_y", "center_z"} <= set(general.emitted.inputs)
    assert special.image.operations() < general.image.operations()
    for rate in ("row", "pixel"):
        assert sum(special.emitted.operations[rate].values()) <= sum(general.emitted.operations[rate].values())
    assert sum(special.program.operations().values()) < sum(general.program.operations().values())


# ---- every structure


@pytest.mark.parametrize("name", STRUCTURES)
def test_what_a_plan_leaves_out_is_never_derived(name: str) -> None:
    program, found = image(name), plan(STRUCTURES[name])
    for effect, quantity in (("diffuse", "diffuse"), ("specular", "r_dot_v"), ("off_axis", "m_x")):
        assert (quantity in program) == found.needs(effect)
    assert ("m_dot_d" in program.guard) == found.needs("front_test")
    assert program.value in program
    assert set(program.inputs) <= {row.name for row in INPUTS}
    if name.endswith("_flat"):
        assert not {"light_x", "k_diffuse", "shininess"} & set(program.inputs)


@pytest.mark.parametrize("name", STRUCTURES)
def test_the_invariants_of_the_derivation_are_proved(name: str) -> None:
    found = prove_invariants(image(name))
    assert {entry.name for entry in found} >= {"hit point", "view direction", "facing", "silhouette"}
    assert all(entry.holds for entry in found), found
    assert ("silhouette circle" in {entry.name for entry in found}) == name.startswith("centred")


@pytest.mark.parametrize("name", ["centred_sphere", "off_axis_sphere", "any_sphere"])
def test_the_exact_sign_tests_are_the_discriminant_and_m_dot_d(name: str) -> None:
    """The monomials, summed in rationals at float64 points, have the sign that whole-number arithmetic gives."""
    scene = STRUCTURES[name]
    numbers = camera_numbers.frame_numbers(scene)
    tests = sign_tests(image(name))
    assert [test.name for test in tests] == list(image(name).guard)
    assert all(len(monomial.factors) <= 4 for test in tests for monomial in test.monomials)
    place = {"eye": numbers.eye, "radius": numbers.radius}
    place |= {f"center_{axis}": value for axis, value in zip("xyz", numbers.center, strict=True)}
    hit = decisions.exact_hit_test(numbers)
    xs, ys = hard_places.near_silhouette(scene, 60, 1)
    random = np.random.default_rng(2).uniform(-6.0, 6.0, (2, 60))
    for x, y in zip(np.concatenate([xs, random[0]]), np.concatenate([ys, random[1]]), strict=True):
        exact = {key: Fraction(float(value)) for key, value in (place | {"x": x, "y": y}).items()}
        signs = []
        for test in tests:
            total = Fraction(0)
            for monomial in test.monomials:
                product = Fraction(monomial.coefficient)
                for factor in monomial.factors:
                    product *= exact[factor]
                total += product
            signs.append(total > 0 if test.strict else total >= 0)
        assert all(signs) == hit(float(x), float(y))


@pytest.mark.parametrize("name", STRUCTURES)
def test_closed_forms_hold_inputs_only(name: str) -> None:
    program = image(name)
    allowed = {symbol(entry) for entry in program.inputs}
    for quantity in ("value", *program.guard):
        assert program.closed(quantity).free_symbols <= allowed
    assert "light_intensity" in program.inputs or name.endswith("_flat")


def test_a_program_refuses_a_name_that_is_defined_twice_or_used_too_early() -> None:
    one, two = Definition("one", symbol("x"), ""), Definition("two", symbol("one"), "")
    with pytest.raises(AssertionError, match="one is defined twice"):
        ImageProgram("p", (one, one), ())
    with pytest.raises(AssertionError, match=r"two uses \['one'\] before their definition"):
        ImageProgram("p", (two, one), ())
    with pytest.raises(KeyError):
        ImageProgram("p", (one, two), ())["three"]


def test_a_symbol_has_the_same_assumptions_wherever_it_is_made() -> None:
    assert symbol("eye") is symbol("eye")
    assert symbol("eye").is_positive
    assert symbol("k_diffuse").is_nonnegative
    assert symbol("disc").is_positive is None
    assert all(name.name for name in latex_names())


# ---- the seed, run


def test_cell_2_swells_as_it_did_and_the_program_does_not() -> None:
    """Chapter 1, Cell 2, its own code and its own operation counts under sympy 1.14; ours are a tenth."""
    seed = seed_cells.cell_2()
    x, y, R, e, lx, ly, lz, ka, kd, ks, n = seed.parameters
    img = seed.I_img
    counted = list(seed.swell().values())
    if sp.__version__.startswith("1.14"):
        assert counted == [29, 284, 723, 1014, 1034]
    assert 10 * image("centred_sphere").operations() <= counted[-1]
    baked = {R: 1.0, e: 4.0, lx: 5.0, ly: 5.0, lz: 10.0, ka: 0.1, kd: 0.7, ks: 0.5, n: 32.0}
    baked = {name: sp.Rational(str(value)) for name, value in baked.items()}
    for px, py in ((0.125, 0.25), (-0.5, 0.375), (0.75, -0.5)):
        seed_value = value_of(img, baked | {x: sp.Rational(px), y: sp.Rational(py)})
        our_value = value_of(recovered(), NUMBERS | {X: sp.Rational(px), Y: sp.Rational(py)})
        assert abs(seed_value - our_value) < 1e-15


def test_the_silhouette_of_chapter_1_has_the_radius_that_cell_5_prints() -> None:
    disc = image("centred_sphere").closed("disc")
    rho = sp.sqrt(sp.solve(disc.subs(Y, 0), X**2)[0]).subs({E: 4, R: 1})
    assert rho == 4 / sp.sqrt(15)
    assert float(rho) == 1.0327955589886444
    assert mpmath.almosteq(mpmath.mpf(4) / mpmath.sqrt(15), float(rho))
