"""Every registered form is proved equal to the textbook's derivation, for every structure of a plan that it fits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import mpmath
import numpy as np
import pytest
import sympy as sp
from evaluators import STRUCTURES

from symrender_cg.derive.forms import FORMS, CosinePower, Form, apply, form
from symrender_cg.derive.image import derive
from symrender_cg.derive.program import Definition, ImageProgram
from symrender_cg.derive.proofs import prove_form
from symrender_cg.derive.symbols import symbol, symbols
from symrender_cg.lower.variants import LEVELS, VARIANTS, Variant
from symrender_cg.plan.plan import plan
from symrender_cg.reference import hard_places, oracle
from symrender_cg.run.numbers import numbers_of

FULL = ("centred_sphere", "off_axis_sphere", "any_sphere")


@cache
def image(name: str) -> ImageProgram:
    return derive(plan(STRUCTURES[name]))


def fits(entry: Form, name: str) -> bool:
    found = plan(STRUCTURES[name])
    return entry.fits(image(name), off_axis=found.needs("off_axis"), front_test=found.needs("front_test"))


FITTING = [(entry.name, name) for entry in FORMS for name in FULL if fits(entry, name)]


@pytest.mark.parametrize(("name", "structure"), FITTING)
def test_every_form_is_proved_equal_to_the_textbook(name: str, structure: str) -> None:
    entry = form(name)
    proofs = prove_form(entry, image(structure))
    assert all(proof.holds for proof in proofs), [proof for proof in proofs if not proof.holds]
    assert all(proof.residue == 0 for proof in proofs)
    assert len(proofs) == len(entry.claims())


@pytest.mark.parametrize("entry", FORMS, ids=lambda entry: entry.name)
def test_every_form_fits_a_structure_and_says_what_it_removes_and_where_it_is_from(entry: Form) -> None:
    assert any(fits(entry, name) for name in STRUCTURES)
    assert entry.removes
    assert entry.source
    assert form(entry.name) is entry


def test_every_form_makes_a_claim() -> None:
    """What a form brings and never claims, nobody proves."""
    assert [entry.name for entry in FORMS if not entry.claims()] == []


def test_every_form_is_used_by_a_variant_and_every_variant_names_forms_that_exist() -> None:
    assert {name for entry in (*VARIANTS, *LEVELS) for name in entry.forms} == {entry.name for entry in FORMS}
    with pytest.raises(KeyError):
        form("no_such_form")


def wrong(entry: Form, name: str, change: sp.Expr) -> Form:
    """The form with something added to one of its definitions."""

    def definitions(program: ImageProgram) -> tuple[Definition, ...]:
        return tuple(
            replace(definition, value=definition.value + change) if definition.name == name else definition
            for definition in entry.definitions(program)
        )

    return replace(entry, definitions=definitions)


X, Y = symbols("x y")
WRONG = [
    ("seed_disc", "centred_sphere", "disc", symbol("radius") ** 4),
    ("quadratic_disc", "off_axis_sphere", "disc", X * Y),
    ("centred_span", "centred_sphere", "alpha", sp.Rational(1, 10**9)),
    ("off_axis_span", "off_axis_sphere", "row_mid", Y),
    ("cross_disc", "any_sphere", "before_eye", X),
    ("centred_foot", "centred_sphere", "n_z", X),
    ("off_axis_foot", "off_axis_sphere", "n_x", symbol("facing")),
    ("cross_foot", "any_sphere", "n_y", sp.Integer(1)),
    ("light_in_radii", "centred_sphere", "w_x", sp.Rational(1, 10**6)),
    ("mirrored_ray", "centred_sphere", "mirror_x", X),
    ("centred_foot_dot_lamp", "centred_sphere", "slope", symbol("depth")),
    ("off_axis_foot_dot_lamp", "off_axis_sphere", "base", Y),
    ("inner_products", "centred_sphere", "w_dot_mirror", symbol("facing")),
    ("middle_facing", "centred_sphere", "facing2_middle", X),
    ("mirrored_foot", "centred_sphere", "spread", symbol("focal")),
    ("mirrored_foot", "off_axis_sphere", "foot_x", Y),
    ("mirrored_foot", "any_sphere", "gap2", symbol("radius")),
    ("diffuse_gain", "centred_sphere", "diffuse", symbol("k_diffuse")),
]


@pytest.mark.parametrize(("name", "structure", "quantity", "change"), WRONG, ids=[case[0] for case in WRONG])
def test_a_form_that_is_wrong_is_seen_to_be(name: str, structure: str, quantity: str, change: sp.Expr) -> None:
    broken = wrong(form(name), quantity, change)
    assert any(
        before.value != after.value
        for before, after in zip(
            form(name).definitions(image(structure)), broken.definitions(image(structure)), strict=True
        )
    )
    proofs = prove_form(broken, image(structure))
    failed = [proof for proof in proofs if not proof.holds]
    assert failed
    assert all(proof.residue != 0 for proof in failed)


@pytest.mark.parametrize(("name", "structure"), FITTING)
def test_no_claim_holds_with_something_added_to_it(name: str, structure: str) -> None:
    """Each claim by itself is read: none is 0 = 0 for want of substitution."""
    entry = form(name)
    for index, claim in enumerate(entry.claims()):
        claims = list(entry.claims())
        claims[index] = replace(claim, right=claim.right + symbol("radius"))
        changed = replace(entry, claims=partial(tuple, claims))
        proofs = prove_form(changed, image(structure))
        assert [proof.holds for proof in proofs] == [k != index for k in range(len(claims))]


# ---- the forms together


@pytest.mark.parametrize("structure", FULL)
@pytest.mark.parametrize("entry", VARIANTS, ids=lambda entry: entry.name)
def test_a_variants_forms_together_have_the_textbooks_value_to_40_digits(entry: Variant, structure: str) -> None:
    """All forms of a variant at once, as kernels use them: the value, not only what each form claims."""
    found, program = plan(STRUCTURES[structure]), image(structure)
    chosen = tuple(
        candidate
        for name in entry.forms
        if (candidate := form(name)).fits(
            program, off_axis=found.needs("off_axis"), front_test=found.needs("front_test")
        )
    )
    changed = apply(program, chosen)
    numbers = inputs_of(structure)
    for x, y in hits_of(structure):
        with mpmath.workdps(60):
            place = numbers | {"x": mpmath.mpf(x), "y": mpmath.mpf(y)}
            assert mpmath.almosteq(value(changed, place), value(program, place), rel_eps=mpmath.mpf(10) ** -40)


def inputs_of(structure: str) -> dict[str, mpmath.mpf]:
    return {name: mpmath.mpf(number) for name, number in numbers_of(STRUCTURES[structure]).items()}


def hits_of(structure: str) -> list[tuple[float, float]]:
    """Points that hit, of 60 in the image and 30 at the silhouette."""
    scene = STRUCTURES[structure]
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None
    wide = np.random.default_rng(1).uniform(-half_height, half_height, (2, 60))
    near = hard_places.near_silhouette(scene, 30, 3)
    x, y = np.concatenate([wide[0], near[0]]), np.concatenate([wide[1], near[1]])
    hit = oracle.hits(scene, x, y)
    assert hit.sum() >= 10
    return [(float(u), float(v)) for u, v in zip(x[hit], y[hit], strict=True)]


def value(program: ImageProgram, place: dict[str, mpmath.mpf]) -> mpmath.mpf:
    """The image's value by its definitions in their order, at the working precision of mpmath."""
    known = dict(place)
    for definition in program.definitions:
        known[definition.name] = evaluated(definition.value, known)
    return known[program.value]


def evaluated(node: sp.Basic, known: dict[str, mpmath.mpf]) -> mpmath.mpf:
    if node.is_Symbol:
        return known[node.name]
    if node.is_Rational:
        return mpmath.mpf(node.p) / node.q
    arguments = [evaluated(argument, known) for argument in node.args if not isinstance(node, sp.Piecewise)]
    if isinstance(node, sp.Piecewise):
        return next(evaluated(branch, known) for branch, condition in node.args if holds(condition, known))
    if isinstance(node, CosinePower):
        return mpmath.power(arguments[0], arguments[2] / 2)
    if node.is_Add:
        return mpmath.fsum(arguments)
    if node.is_Mul:
        return mpmath.fprod(arguments)
    if node.is_Pow:
        return mpmath.power(*arguments)
    assert isinstance(node, sp.Max), node
    return max(arguments)


def holds(condition: sp.Basic, known: dict[str, mpmath.mpf]) -> bool:
    if condition in (sp.true, sp.false):
        return bool(condition)
    left, right = (evaluated(side, known) for side in condition.args)
    if isinstance(condition, sp.Eq):
        return bool(left == right)
    if isinstance(condition, sp.Gt):
        return bool(left > right)
    assert isinstance(condition, sp.Lt | sp.Ge | sp.Le), condition
    return bool(
        left < right
        if isinstance(condition, sp.Lt)
        else left >= right
        if isinstance(condition, sp.Ge)
        else left <= right
    )
