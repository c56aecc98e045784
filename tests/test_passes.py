"""Laws of the passes: input untouched, the value kept to 40 digits, idempotent, and what each one states of itself."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp
from evaluators import ACCURACIES, STRUCTURES, modest
from hypothesis import given
from hypothesis import strategies as st
from sympy.core.symbol import Str

from symrender_cg.derive.forms import CosinePower
from symrender_cg.derive.symbols import symbol, symbols
from symrender_cg.lower import passes
from symrender_cg.lower.formats import convert_formats
from symrender_cg.lower.freeze import freeze, frozen
from symrender_cg.lower.lower import Stage
from symrender_cg.lower.nodes import (
    Both,
    Call,
    Cast,
    Difference,
    Greater,
    Larger,
    Negative,
    Node,
    NotNegative,
    Number,
    Part,
    Positive,
    Product,
    Quotient,
    Root,
    Select,
    Sum,
    Zero,
    walk,
)
from symrender_cg.lower.program import RATES, KernelProgram, Step
from symrender_cg.pipeline import Translation, translate
from symrender_cg.reference import oracle
from symrender_cg.run.numbers import numbers_of
from symrender_cg.scene import Scene

Known = dict[str, mpmath.mpf]
PLANS = ("centred_sphere", "off_axis_sphere", "any_sphere", "centred_sphere_gated", "off_axis_sphere_matte")


@cache
def lowered(name: str, accuracy: str, *, bake: bool = False) -> Translation:
    return translate(STRUCTURES[name], accuracy, bake=bake)


# ---- what steps mean, to 50 digits: an evaluator of its own


def meaning(node: sp.Basic, known: Known) -> mpmath.mpf:
    """The value of a step before or after freezing, formats left aside: words of a double-double are value and 0."""
    if node.is_Symbol:
        return known[node.name]
    if isinstance(node, Number):
        return mpmath.mpf(node.value.p) / node.value.q
    if isinstance(node, Part):
        return meaning(node.args[1], known) if node.args[0].name == "hi" else mpmath.mpf(0)
    if isinstance(node, Cast):
        return meaning(node.args[1], known)
    if isinstance(node, Select):
        condition, first, second = node.args
        return meaning(first if meaning(condition, known) else second, known)
    if isinstance(node, sp.Piecewise):
        return next(meaning(value, known) for value, condition in node.args if meaning(condition, known))
    if node in (sp.true, sp.false):
        return bool(node)
    if node.is_Rational:
        return mpmath.mpf(node.p) / node.q
    arguments = [meaning(argument, known) for argument in node.args if not isinstance(argument, Str)]
    if isinstance(node, Call):
        return CALLS[node.function](*arguments)
    return OPERATIONS[node.func](*arguments)


def cosine_power(cos2: mpmath.mpf, sin2: mpmath.mpf, exponent: mpmath.mpf) -> mpmath.mpf:
    assert mpmath.almosteq(cos2 + sin2, 1, rel_eps=mpmath.mpf(10) ** -30)
    return mpmath.power(cos2, exponent / 2)


def light_exponent(world: mpmath.mpf, radius: mpmath.mpf, *offsets_and_farthest: mpmath.mpf) -> mpmath.mpf:
    *offsets, _ = offsets_and_farthest
    longest = max(radius, *map(abs, offsets))
    assert longest < radius * 2**20, "these scenes have near lights: theirs is the scene's own unit"
    return world


OPERATIONS: dict[type[sp.Basic], Callable[..., mpmath.mpf]] = {
    sp.Add: lambda *a: mpmath.fsum(a),
    sp.Mul: lambda *a: mpmath.fprod(a),
    sp.Pow: mpmath.power,
    sp.Max: lambda *a: max(a),
    sp.StrictGreaterThan: lambda a, b: a > b,
    sp.StrictLessThan: lambda a, b: a < b,
    sp.GreaterThan: lambda a, b: a >= b,
    sp.LessThan: lambda a, b: a <= b,
    sp.Equality: lambda a, b: a == b,
    sp.And: lambda *a: all(a),
    CosinePower: cosine_power,
    Sum: lambda a, b: a + b,
    Difference: lambda a, b: a - b,
    Product: lambda a, b: a * b,
    Quotient: lambda a, b: a / b,
    Negative: lambda a: -a,
    Root: mpmath.sqrt,
    Larger: lambda a, b: max(a, b),
    Positive: lambda a: a > 0,
    Greater: lambda a, b: a > b,
    NotNegative: lambda a: a >= 0,
    Zero: lambda a: a == 0,
    Both: lambda a, b: a and b,
}

CALLS: dict[str, Callable[..., mpmath.mpf]] = {
    **{name: (lambda a, b: a + b) for name in ("dd_sum", "dd_add", "dd_add_double")},
    **{name: (lambda a, b: a - b) for name in ("dd_difference", "dd_sub")},
    **{name: (lambda a, b: a * b) for name in ("dd_product", "dd_mul", "dd_mul_double")},
    **dict.fromkeys(("power_of_cosine", "power_of_cosinef"), cosine_power),
    **dict.fromkeys(("log2_of_lobe", "log2_of_lobef"), lambda cos2, sin2: mpmath.log(cos2, 2)),
    **dict.fromkeys(("power_of_lobe", "power_of_lobef"), lambda log2, n: mpmath.power(2, n * log2 / 2)),
    **dict.fromkeys(("power", "powerf"), mpmath.power),
    "half_of_whole": lambda n: n / 2 if n % 2 == 0 and 2 <= n <= 1024 else mpmath.mpf(0),
    "dd_from": lambda a: a,
    "dd_words": lambda a, b: a + b,
    "dd_div": lambda a, b: a / b,
    "dd_sqrt": mpmath.sqrt,
    "dd_neg": lambda a: -a,
    "dd_positive_part": lambda a: max(a, mpmath.mpf(0)),
    "square": lambda a: a * a,
    "ldexp": lambda a, k: mpmath.ldexp(a, int(k)),
    "unit_exponent": lambda length: mpmath.mpf(1 - mpmath.frexp(length)[1]),
    "light_exponent": light_exponent,
}


def value_of(program: KernelProgram, scene: Scene, x: float, y: float) -> Known:
    """Every step's value at a point; x and y are put into the unit of the program's image plane."""
    numbers = numbers_of(scene)
    known: Known = {name: mpmath.mpf(numbers[name.removeprefix("scene_")]) for name in program.inputs}
    unit = mpmath.mpf(1)
    if "plane_unit" in program:
        unit = CALLS["ldexp"](1, CALLS["unit_exponent"](mpmath.mpf(numbers["eye"])))
    known |= {"x": x * unit, "y": y * unit}
    for step in program.steps:
        known[step.name] = meaning(step.value, known)
    return known


@cache
def hits(name: str) -> tuple[tuple[float, float], ...]:
    """Six points of the image that hit."""
    scene = STRUCTURES[name]
    half_height = scene.in_camera_frame().camera.half_height
    assert half_height is not None
    x, y = np.random.default_rng(4).uniform(-half_height, half_height, (2, 200))
    hit = oracle.hits(scene, x, y)
    return tuple((float(u), float(v)) for u, v in zip(x[hit][:6], y[hit][:6], strict=True))


@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_every_pass_keeps_the_value_to_40_digits(name: str, accuracy: str) -> None:
    """From the textbook's definitions through every pass; formats round only in C."""
    translation, scene = lowered(name, accuracy), STRUCTURES[name]
    assert len(hits(name)) == 6
    with mpmath.workdps(50):
        for x, y in hits(name):
            numbers = {key: mpmath.mpf(number) for key, number in numbers_of(scene).items()}
            known: Known = numbers | {"x": mpmath.mpf(x), "y": mpmath.mpf(y)}
            for definition in translation.image.definitions:
                known[definition.name] = meaning(definition.value, known)
            truth = known[translation.image.value]
            for stage in translation.passes:
                got = value_of(stage.program, scene, x, y)[stage.program.result]
                assert mpmath.almosteq(got, truth, rel_eps=mpmath.mpf(10) ** -40), stage.name
            assert abs(float(truth) - oracle.evaluate(scene, x, y).value) < 1e-15


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_baking_rounds_each_frame_constant_once_and_keeps_the_rest(accuracy: str) -> None:
    name = "off_axis_sphere"
    translation, scene = lowered(name, accuracy, bake=True), STRUCTURES[name]
    names = [stage.name for stage in translation.passes]
    unit = {"single": 2.0**-24}.get(accuracy, 2.0**-53)
    with mpmath.workdps(50):
        for x, y in hits(name):
            exact = oracle.evaluate(scene, x, y).value
            got = value_of(translation.program, scene, x, y)[translation.program.result]
            assert abs(float(got - mpmath.mpf(float(exact)))) < 200 * unit
    assert names.index("bake") == names.index("prune") - 1
    assert translation.emitted.inputs == ()
    frame = [step for step in translation.program.steps if step.rate == "frame"]
    assert all(isinstance(node, Number | Str | Call) for step in frame for node in walk(step.value))


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 7, 32, 33, 100])
def test_a_baked_whole_exponent_is_a_chain_of_products(exponent: int) -> None:
    scene = Scene.chapter1(shininess=float(exponent))
    for accuracy in ("double", "literal"):
        program = translate(scene, accuracy, bake=True).program
        calls = {node.function for step in program.steps for node in walk(step.value) if isinstance(node, Call)}
        assert not calls & {"power", "power_of_cosine"}
        with mpmath.workdps(40):
            for x, y in hits("centred_sphere"):
                got = float(value_of(program, scene, x, y)[program.result])
                assert abs(got - oracle.evaluate(scene, x, y).value) < 1e-14


# ---- every pass, run again on what it was given


def sequence(accuracy: str) -> dict[str, Callable[[KernelProgram], KernelProgram]]:
    from symrender_cg.lower.variants import variant

    return {
        "assign formats": lambda program: passes.assign_formats(program, variant(accuracy)),
        "regularise": passes.regularise,
        "place": passes.place,
        "hoist": passes.hoist,
        "share": passes.share,
        "place shares": passes.place,
        "freeze": freeze,
        "convert formats": convert_formats,
        "prune": passes.prune,
        "arrange": passes.arrange,
    }


def given_to(stages: tuple[Stage, ...], name: str) -> tuple[KernelProgram, KernelProgram]:
    """What a pass was given, and what it gave."""
    index = next(i for i, stage in enumerate(stages) if stage.name == name)
    return stages[index - 1].program, stages[index].program


@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_a_pass_leaves_its_input_untouched_and_gives_the_same_again(name: str, accuracy: str) -> None:
    stages = lowered(name, accuracy).passes
    for title, apply in sequence(accuracy).items():
        before, after = given_to(stages, title)
        text = before.text()
        assert apply(before) == after, title
        assert before.text() == text, title


@pytest.mark.parametrize("title", ["assign formats", "regularise", "place", "share", "freeze", "prune", "arrange"])
@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_a_pass_done_twice_is_done_once(title: str, name: str, accuracy: str) -> None:
    _, after = given_to(lowered(name, accuracy).passes, title)
    assert sequence(accuracy)[title](after) == after


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_after_the_last_pass_a_program_is_frozen_placed_and_without_dead_steps(name: str, accuracy: str) -> None:
    program = lowered(name, accuracy).program
    program.check()
    used = {entry for step in program.steps for entry in step.uses()} | program.outputs
    for step in program.steps:
        assert step.name in used, f"{step.name} is dead"
        assert step.value.is_Symbol or isinstance(step.value, Node)
        assert all(node.is_Symbol or isinstance(node, Node) for node in walk(step.value))
        youngest = max((rate_of(program, entry) for entry in step.uses()), default=0)
        assert RATES.index(step.rate) == youngest, f"{step.name} is not where its youngest symbol is"


def rate_of(program: KernelProgram, name: str) -> int:
    if name in program:
        return RATES.index(program[name].rate)
    return program.input_rates().get(name, 0)


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_every_pass_is_timed_and_counted(accuracy: str) -> None:
    stages = lowered("centred_sphere", accuracy).passes
    assert len({stage.name for stage in stages}) == len(stages)
    for stage in stages:
        assert stage.seconds >= 0.0
        assert stage.operations == stage.program.operations()
        assert sum(stage.operations.values()) > 0


# ---- single passes on small programs

X, Y, A, B, C = (*symbols("x y"), *(symbol(name) for name in ("a", "b", "c")))


def program_of(*steps: Step, hit: tuple[str, ...] = ()) -> KernelProgram:
    return KernelProgram("p", steps, hit, None, steps[-1].name, ("a", "b", "c"))


def step(name: str, value: sp.Basic, **more: str) -> Step:
    return Step(name, value, "section", **more)  # type: ignore[arg-type]


def test_freezing_keeps_what_sympy_would_undo() -> None:
    """2 (a - b) stays a product of a difference; x / 3 stays one division; (a - b) - c is not flattened."""
    assert str(frozen(sp.Mul(2, sp.Add(A, -B), evaluate=False))) == "Product(2, Difference(a, b))"
    assert str(frozen(A / 3)) == "Quotient(a, 3)"
    assert str(frozen(A / 4)) == "Product(1/4, a)"
    kept = Difference(Difference(A, B), C)
    assert frozen(kept) is kept
    assert sp.expand(2 * kept) == 2 * kept
    assert str((kept + 0).xreplace({A: X})) == "Difference(Difference(x, b), c)"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (A**2, "Product(a, a)"),
        ((A + B) ** 2, "square(Sum(a, b))"),
        (sp.sqrt(A), "Root(a)"),
        (1 / A, "Quotient(1, a)"),
        (A / (B * C), "Quotient(a, Product(b, c))"),
        (-A * B, "Negative(Product(a, b))"),
        (A - B, "Difference(a, b)"),
        (-A - B, "Difference(Negative(a), b)"),
        (sp.Max(0, A), "Larger(a, 0)"),
        (sp.Piecewise((A, B > 0), (C, True)), "Select(Positive(b), a, c)"),
        (sp.Piecewise((A, B >= 0), (C, True)), "Select(NotNegative(b), a, c)"),
        (sp.Rational(1, 3) * A, "Quotient(a, 3)"),
        (sp.Rational(2, 3) * A, "Quotient(Product(2, a), 3)"),
    ],
    ids=str,
)
def test_freezing_is_one_operation_a_node(value: sp.Expr, text: str) -> None:
    assert str(frozen(value)) == text


SMALL = st.integers(-4, 4).filter(bool)


@st.composite
def expressions(draw: st.DrawFn, depth: int = 3) -> sp.Expr:
    """Polynomials, quotients by what is positive, roots and maxima in a, b, c."""
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        return draw(st.sampled_from([A, B, C, sp.Integer(draw(SMALL)), sp.Rational(draw(SMALL), 3)]))
    one, two = draw(expressions(depth - 1)), draw(expressions(depth - 1))
    kind = draw(st.sampled_from(["add", "sub", "mul", "div", "square", "root", "max", "choose"]))
    return {
        "add": lambda: one + two,
        "sub": lambda: one - two,
        "mul": lambda: one * two,
        "div": lambda: one / (two**2 + 1),
        "square": lambda: one**2,
        "root": lambda: sp.sqrt(one**2 + 1),
        "max": lambda: sp.Max(0, one),
        "choose": lambda: sp.Piecewise((one, A > 0), (two, True)),
    }[kind]()


def lowerable(value: sp.Expr) -> bool:
    """Powers that the pass before freezing would have lowered are not for freezing."""
    allowed = {2, -1, -2, sp.Rational(1, 2), sp.Rational(-1, 2)}
    return all(power.exp in allowed for power in value.atoms(sp.Pow)) and all(
        len(entry.args) == 2 for entry in value.atoms(sp.Max, sp.Piecewise)
    )


@modest(150)
@given(expressions().filter(lowerable), st.tuples(SMALL, SMALL, SMALL))
def test_freezing_keeps_the_value_of_any_expression(value: sp.Expr, point: tuple[int, int, int]) -> None:
    with mpmath.workdps(50):
        known = {name: mpmath.mpf(number) / 7 for name, number in zip("abc", point, strict=True)}
        kept = frozen(value)
        assert all(node.is_Symbol or isinstance(node, Node) for node in walk(kept))
        assert mpmath.almosteq(meaning(kept, known), meaning(value, known), rel_eps=mpmath.mpf(10) ** -40)


def test_sharing_computes_once_what_one_format_computes_twice() -> None:
    shared = passes.share(program_of(step("one", sp.sqrt(A + B) + 1), step("two", sp.sqrt(A + B) + C)))
    assert [entry.name for entry in shared.steps] == ["share_1", "one", "two"]
    assert shared["share_1"].value == sp.sqrt(A + B)


def test_sharing_never_mixes_formats() -> None:
    steps = (
        step("one", sp.sqrt(A + B) + 1, format="float32"),
        step("two", sp.sqrt(A + B) + C, format="float64"),
        step("three", sp.sqrt(A + B) * C, format="double_double"),
    )
    assert passes.share(program_of(*steps)).steps == steps


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_a_shared_step_is_used_by_steps_of_its_own_format_only(name: str, accuracy: str) -> None:
    _, program = given_to(lowered(name, accuracy).passes, "share")
    for entry in program.steps:
        for used in entry.uses():
            if used.startswith("share_"):
                assert program[used].format == entry.format


def test_sharing_keeps_divisions_one_rounding() -> None:
    """a/c and b/c share 1/c under sympy's cse: two roundings each, where one was meant."""
    shared = passes.share(program_of(step("one", A / C), step("two", B / C)))
    assert [entry.value for entry in shared.steps] == [A / C, B / C]


def test_pruning_drops_what_nothing_uses() -> None:
    program = program_of(
        step("dead", A), step("deader", symbol("dead") + 1), step("one", B), step("two", symbol("one"))
    )
    assert [entry.name for entry in passes.prune(program).steps] == ["one", "two"]


def test_pruning_keeps_what_the_entry_points_read() -> None:
    program = program_of(step("disc", X), step("m_dot_d", Y), step("value", A), hit=("disc", "m_dot_d"))
    assert passes.prune(program) == program


def test_a_step_is_placed_by_its_youngest_symbol() -> None:
    placed = passes.place(
        program_of(
            step("one", A), step("two", symbol("one") + Y), step("three", symbol("two") * X), step("four", Y + B)
        )
    )
    assert [entry.rate for entry in placed.steps] == ["frame", "row", "pixel", "row"]


def test_the_slow_part_of_a_sum_is_hoisted_to_its_own_rate() -> None:
    hoisted = passes.hoist(passes.place(program_of(step("one", X**2 + Y**2 + A**2 + B))))
    rates = {entry.name: entry.rate for entry in hoisted.steps}
    assert set(rates.values()) == {"frame", "row", "pixel"}
    assert "x" not in {used for entry in hoisted.steps if entry.rate != "pixel" for used in entry.uses()}
    hoisted.check()


def test_regularising_makes_every_root_total() -> None:
    total = passes.regularise(program_of(step("one", sp.sqrt(A - B)), step("two", sp.sqrt(A**2))))
    assert total["one"].value == sp.sqrt(sp.Max(0, A - B))
    assert total["two"].value == sp.sqrt(A**2)


def test_powers_are_calls_or_chains_and_never_pow() -> None:
    functions = {"power": "power", "cosine": "power_of_cosine"}
    chain = passes.lower_powers(program_of(step("lobe", sp.Max(0, A) ** 11)), functions)
    assert [entry.name for entry in chain.steps] == ["lobe_1", "lobe_2", "lobe_4", "lobe_8", "lobe"]
    with mpmath.workdps(40):
        known: Known = {"a": mpmath.mpf(3)}
        for entry in chain.steps:
            known[entry.name] = meaning(entry.value, known)
        assert known["lobe"] == 3**11
    called = passes.lower_powers(program_of(step("lobe", sp.Max(0, A) ** B)), functions)["lobe"].value
    assert isinstance(called, Call)
    assert called.function == "power"


def test_arranging_brings_sections_together_and_moves_nothing_before_what_it_uses() -> None:
    steps = (
        Step("one", A, "light"),
        Step("two", B, "shade"),
        Step("three", C, "light"),
        Step("four", symbol("two") + symbol("three"), "shade"),
    )
    arranged = passes.arrange(KernelProgram("p", steps, (), None, "four", ("a", "b", "c")))
    assert [entry.name for entry in arranged.steps] == ["one", "three", "two", "four"]
    arranged.check()


def test_the_invariants_of_a_program_are_checked() -> None:
    with pytest.raises(AssertionError, match="one is defined twice"):
        program_of(step("one", A), step("one", B)).check()
    with pytest.raises(AssertionError, match="one uses two before its definition"):
        program_of(step("one", symbol("two")), step("two", A)).check()
    with pytest.raises(AssertionError, match="two changes slower than one"):
        program_of(step("one", X, rate="pixel"), step("two", symbol("one"), rate="frame")).check()
    with pytest.raises(KeyError):
        program_of(step("one", A))["two"]


# ---- names

TAKEN = """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while _Bool _Complex
    _Imaginary asm typeof

    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor fma fmax
    fmin fmod frexp gamma hypot ilogb isnan j0 j1 jn ldexp lgamma llrint log log10 log1p log2 logb lrint modf nan
    nearbyint nextafter pow remainder remquo rint round scalbn significand sin sinh sqrt tan tanh tgamma trunc y0 y1 yn
    near far div abs index signal time clock exit free main stride image grid scene row frame NULL INFINITY NAN
"""
"""Keywords of C99, names of math.h and of other headers, macros of Windows, and what the templates call their own."""


@pytest.mark.parametrize("bake", [False, True])
def test_no_step_has_the_name_of_something_else_in_c(bake: bool) -> None:
    names: dict[str, str] = {}
    for structure in STRUCTURES:
        for accuracy in ACCURACIES:
            translation = lowered(structure, accuracy, bake=bake)
            headers = "\n".join(text for file, text in translation.emitted.files.items() if file.endswith(".h"))
            own = translation.emitted.name
            functions = set(re.findall(r"\b(\w+)\(", headers.replace(own, "")))
            for entry in translation.program.steps:
                names[entry.name] = structure
                assert entry.name not in functions, f"{entry.name} is a function of the support headers"
    taken = set(TAKEN.split())
    for name, structure in names.items():
        assert re.fullmatch(r"[a-z][a-z0-9_]*", name), name
        assert name not in taken, f"{name} in {structure}"
        assert not keyword.iskeyword(name)
        assert not any(name == entry + "f" for entry in taken), name


def test_a_program_prints_as_text_a_line_a_step() -> None:
    program = lowered("centred_sphere", "double").program
    assert len(program.text().splitlines()) == len(program.steps)
    assert replace(program, steps=program.steps[:1]).text() == program.text().splitlines()[0]
