"""The passes before freezing: exact rewrites of the steps, while they are still sympy expressions.

Each is a function KernelProgram -> KernelProgram that leaves its argument as it was.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from symrender_cg.derive.forms import CosinePower
from symrender_cg.derive.symbols import symbol
from symrender_cg.lower.nodes import call
from symrender_cg.lower.program import RATES, Format, KernelProgram, Rate, Shortcut, Step
from symrender_cg.lower.variants import Variant


def assign_formats(program: KernelProgram, variant: Variant, *, exact: bool = True) -> KernelProgram:
    """Each step gets the number format that the variant states for its quantity. Exact: formats round later.

    `exact` is False for a part of a kernel that decides no hit of the eye's ray.
    """
    per_pixel = frozenset() if program.ends else variant.per_pixel_exact
    wide: frozenset[str] = variant.double_double | per_pixel if exact else frozenset()
    shading: Format = variant.shading

    def chosen(name: str) -> Format:
        if name in wide:
            return "double_double"
        return "float64" if name in variant.float64 else shading

    return program.with_steps(replace(step, format=chosen(step.name)) for step in program.steps)


def regularise(program: KernelProgram) -> KernelProgram:
    """Every step becomes total: sqrt(a) -> sqrt(max(0, a)) where a may be negative, and a light adds nothing where
    the hit point is its own position. Exact wherever the original is defined.

        facing = sqrt(facing2)       ->  facing = sqrt(max(0, facing2))
        value = k_ambient + lit      ->  value = k_ambient + (lit where w2 > 0, else 0)
    """

    def total(value: sp.Basic) -> sp.Basic:
        roots = [node for node in value.atoms(sp.Pow) if node.exp == sp.Rational(1, 2) and not node.base.is_nonnegative]
        return value.xreplace({node: sp.sqrt(sp.Max(0, node.base)) for node in roots})

    change = {step.name: total(step.value) for step in program.steps}
    for distance in ("w2", "w_length"):
        if distance in program and "lit" in program:
            lit = symbol("lit")
            guarded = sp.Piecewise((lit, symbol(distance) > 0), (0, True))
            change["value"] = program["value"].value.xreplace({lit: guarded})
    return program.map(change)


def scale_lengths(program: KernelProgram, *, farthest: int | None = None) -> KernelProgram:
    """Lengths of the image plane in units of 2^k so that f is in [1, 2), lengths of the scene so that R is: exact,
    and no square can overflow. A light farther than 2^60 (float32: 2^30) radii is brought to that distance, which
    turns its direction by less than 2^-60.

        focal = eye                  ->  plane_exponent = -exponent(scene_eye); focal = scene_eye 2^plane_exponent
        lamp_x = from_center_x / R   ->  lamp_x = (from_center_x 2^light_exponent) / R

    A part of a program may lack the eye or the radius; `farthest` is given where its result does not tell the format.
    """
    scaled = [name for name in ("eye", "radius", "center_x", "center_y", "center_z") if name in program.inputs]
    raw = {symbol(name): symbol(f"scene_{name}") for name in program.inputs}
    section = "units of length, powers of two"
    eye, radius = symbol("scene_eye"), symbol("scene_radius")
    plane, world, lamp = symbol("plane_exponent"), symbol("world_exponent"), symbol("lamp_exponent")
    head: list[Step] = []
    if "eye" in program.inputs:
        head += [
            Step("plane_exponent", call("unit_exponent", eye), section, "f = e 2^k in [1, 2)", format="int"),
            Step("plane_unit", call("ldexp", sp.Integer(1), plane), section, format="float64"),
        ]
    if "radius" in program.inputs:
        head.append(Step("world_exponent", call("unit_exponent", radius), section, "R 2^k in [1, 2)", format="int"))
    head += [Step(name, call("ldexp", raw[symbol(name)], world), section) for name in scaled if "radius" in scaled]
    limit = sp.Integer(farthest or FARTHEST[program[program.result].format])
    offsets = [step for step in program.steps if step.name.startswith("from_center_")]
    if offsets:
        head += [
            replace(step, value=step.value.xreplace(raw), format=_at_least_float64(step.format)) for step in offsets
        ]
        exponent = call("light_exponent", world, radius, *(step.symbol for step in offsets), limit)
        meaning = f"farther than 2^{limit} R a light shines in parallel"
        head.append(Step("lamp_exponent", exponent, offsets[0].section, meaning, format="int"))
    body: list[Step] = []
    for step in program.steps:
        if step.name == "focal":
            body.append(replace(step, value=call("ldexp", eye, plane)))
        elif step.name.startswith("lamp_"):
            offset = symbol(step.name.replace("lamp", "from_center"))
            value = step.value.xreplace({offset: call("ldexp", offset, lamp)})
            body.append(replace(step, value=value, format=_at_least_float64(step.format)))
        elif step not in offsets:
            body.append(step)
    others = {s: t for s, t in raw.items() if s.name not in scaled}
    body = [replace(step, value=step.value.xreplace(others)) for step in body]
    inputs = tuple(f"scene_{name}" for name in program.inputs)
    return replace(program, steps=tuple(head + body), inputs=inputs, background=f"scene_{program.background}")


FARTHEST: dict[Format, int] = {"float32": 30, "float64": 60, "pair": 200}
"""A light farther than 2^this radii is brought to that distance: by the format of the shading."""


def _at_least_float64(form: Format) -> Format:
    return "float64" if form == "float32" else form


def lower_powers(program: KernelProgram, functions: dict[str, str], *, halves: bool = False) -> KernelProgram:
    """b^n becomes a call, or for a whole number n a chain of products on named steps; x^2 is left to the freeze pass.

    With `halves`, and where the functions have them, a cosine's power is two steps: its logarithm and 2^y.

    CosinePower(cos2, sin2, n)  ->  power_of_cosine(cos2, sin2, n)
                                or  ..._log2 = log2_of_lobe(cos2, sin2); power_of_lobe(..._log2, n)
    max(0, r_dot_v)^3               ->  ..._1 = max(0, r_dot_v); ..._2 = ..._1 ..._1; ..._2 ..._1
    """
    steps: list[Step] = []
    for step in program.steps:
        value = step.value
        for power in sorted(value.atoms(sp.Pow), key=sp.default_sort_key):
            if power.exp.is_Rational and abs(power.exp) in (1, 2, sp.Rational(1, 2)):
                continue
            if power.exp.is_Rational and power.exp.q == 2 and power.exp > 1:
                chain, result = _product_chain(step, power.base, int(power.exp))
                root = replace(step, name=f"{step.name}_root", value=sp.sqrt(power.base), meaning="", source="")
                steps += [*chain, root]
                value = value.xreplace({power: result * root.symbol})
            elif power.exp.is_Integer and power.exp > 0:
                chain, result = _product_chain(step, power.base, int(power.exp))
                steps += chain
                value = value.xreplace({power: result})
            else:
                value = value.xreplace({power: call(functions["power"], power.base, power.exp)})
        for power in sorted(value.atoms(CosinePower), key=sp.default_sort_key):
            if halves and "log2" in functions:
                cos2, sin2, exponent = power.args
                told: tuple[sp.Expr, ...] = (cos2, sin2)
                function = functions["log2"]
                if "log2_of_square" in functions and program[sin2.name].value == 1 - cos2:
                    told, function = (cos2,), functions["log2_of_square"]
                logarithm = replace(
                    step,
                    name=f"{step.name}_log2",
                    value=call(function, *told),
                    meaning="log2 (r.v)^2",
                    source="",
                )
                steps.append(logarithm)
                value = value.xreplace({power: call(functions["exp2"], logarithm.symbol, exponent)})
            else:
                value = value.xreplace({power: call(functions["cosine"], *power.args)})
        for function, name in ((sp.floor, "floor"), (sp.Abs, "fabs")):
            of_format = f"{name}f" if step.format == "float32" else name
            for applied in sorted(value.atoms(function), key=sp.default_sort_key):
                value = value.xreplace({applied: call(of_format, *applied.args)})
        steps.append(replace(step, value=value))
    return program.with_steps(steps)


def shortcut_power(program: KernelProgram, function: str) -> KernelProgram:
    """An even whole exponent that is an argument: the power of a block by squaring, in place of its two halves.

    highlight = power_of_lobe(highlight_log2, n)  ->  also half_exponent = half_of_whole(n), once a frame, and where
                                                      it is not 0: whole_powers_of_lobe(sin2, ..., half_exponent, ...)
    highlight = power_of_cosine(cos2, sin2, n)    ->  the same from cos2: whole_powers_of_square(cos2, ...)
    """
    if "highlight" not in program:
        return program
    halves = "highlight_log2" in program
    source = program["highlight_log2"].value.args[-1].name if halves else "cos2"
    meaning = "n / 2 where n is an even whole number, else 0"
    room = "highlight_log2" if halves else ""
    return _with_shortcut(program, function, source, room, "half_of_whole", meaning, "int")


def shortcut_narrow_lobe(program: KernelProgram, function: str) -> KernelProgram:
    """A large exponent that is an argument: its lobe is narrow, and a short polynomial does for it. Exact where the
    power is 0 or 1, else within the bound of `function`.

    highlight = fast_power_of_lobef(highlight_log2, n)  ->  also half_exponent = half_of_large(n), once a frame, and
                                                            where it is not 0: fast_powers_of_lobef(cos2, ...)
    """
    if "highlight_log2" not in program or program["highlight_log2"].value.args[1:] != (symbol("cos2"),):
        return program
    meaning = "n / 2 where n is large, else 0"
    return _with_shortcut(program, function, "cos2", "highlight_log2", "half_of_large", meaning, "float32")


def _with_shortcut(
    program: KernelProgram, function: str, source: str, room: str, half_of: str, meaning: str, form: Format
) -> KernelProgram:
    last = program["highlight"]
    half = Step("half_exponent", call(half_of, last.value.args[-1]), last.section, meaning, format=form)
    found = Shortcut(function, source, room, last.name, half.name)
    steps = (half, *program.steps)
    return replace(program.with_steps(steps), wanted=(*program.wanted, half.name), shortcut=found)


def _product_chain(step: Step, base: sp.Expr, exponent: int) -> tuple[list[Step], sp.Expr]:
    """base^exponent by repeated squaring: the steps of the squares, and the product that remains."""
    chain: list[Step] = []
    if not base.is_Symbol:
        chain.append(replace(step, name=f"{step.name}_1", value=base, meaning="", source=""))
        base = symbol(f"{step.name}_1")
    stem = base.name.removesuffix("_1")
    factors: list[sp.Expr] = []
    square, power = base, 1
    while True:
        if exponent & power:
            factors.append(square)
        power *= 2
        if power > exponent:
            break
        name = f"{stem}_{power}"
        chain.append(replace(step, name=name, value=call("square", square), meaning=f"{stem}^{power}", source=""))
        square = symbol(name)
    return chain, sp.Mul(*factors)


def share(program: KernelProgram) -> KernelProgram:
    """What two steps of one format both compute is computed once, in a step `share_k` before them. Exact.

    Every step is total here, so that nothing is hoisted above a condition that it needs; formats are not mixed, so
    that a double-double quantity never rests on a shared float64 one.
    """
    extra: dict[int, list[Step]] = {}
    values = [step.value for step in program.steps]
    counter = 0
    for form in ("float32", "float64", "double_double"):
        where = [i for i, step in enumerate(program.steps) if step.format == form]
        fresh = (symbol(f"share_{k}") for k in range(counter + 1, 10_000))
        shared, reduced = sp.cse([values[i] for i in where], symbols=fresh, order="canonical")
        counter += len(shared)
        shared, reduced = _without_reciprocals(shared, reduced)
        for i, value in zip(where, reduced, strict=True):
            values[i] = value
        pending = dict(shared)
        for i in where:
            for name in _in_order(values[i], pending):
                step = program.steps[i]
                extra.setdefault(i, []).append(
                    replace(step, name=name.name, value=pending.pop(name), meaning="", source="")
                )
    steps: list[Step] = []
    for i, step in enumerate(program.steps):
        steps += extra.get(i, [])
        steps.append(replace(step, value=values[i]))
    return program.with_steps(steps)


def _without_reciprocals(
    shared: list[tuple[sp.Symbol, sp.Basic]], reduced: list[sp.Basic]
) -> tuple[list[tuple[sp.Symbol, sp.Basic]], list[sp.Basic]]:
    """Shared 1/a go back to where they were: a/b is one rounding, a times a shared 1/b would be two."""
    back: dict[sp.Basic, sp.Basic] = {}
    kept: list[tuple[sp.Symbol, sp.Basic]] = []
    for name, value in shared:
        whole = value.xreplace(back)
        if whole.is_Pow and whole.exp.is_Rational and whole.exp.is_negative:
            back[name] = whole
        else:
            kept.append((name, whole))
    return kept, [value.xreplace(back) for value in reduced]


def _in_order(value: sp.Basic, pending: dict[sp.Symbol, sp.Basic]) -> list[sp.Symbol]:
    """The pending symbols that a value needs, those that others need first."""
    found: list[sp.Symbol] = []

    def visit(expression: sp.Basic) -> None:
        for name in sorted(expression.free_symbols & pending.keys(), key=lambda s: int(s.name.split("_")[1])):
            if name not in found:
                visit(pending[name])
                found.append(name)

    visit(value)
    return found


def place(program: KernelProgram) -> KernelProgram:
    """Each step gets the rate of its youngest symbol: pixel where x is in it, row where y is, sphere where
    a number of one sphere among many is, else frame. Exact."""
    rates = program.input_rates()
    steps: list[Step] = []
    for step in program.steps:
        rates[step.name] = max((rates.get(name, 0) for name in step.uses()), default=0)
        steps.append(replace(step, rate=RATES[rates[step.name]]))
    return program.with_steps(steps)


def carry_slow_in_full(program: KernelProgram) -> KernelProgram:
    """What does not change with the pixel is a double-double rather than a pair: it costs nothing there."""
    return program.with_steps(
        replace(step, format="double_double") if step.format == "pair" and step.rate != "pixel" else step
        for step in program.steps
    )


def hoist(program: KernelProgram) -> KernelProgram:
    """The part of a sum or product that changes more slowly than the rest becomes a step at its own rate.

        d_dot_d = x^2 + y^2 + focal^2  ->  row: d_dot_d_row = y^2 + focal^2;  pixel: d_dot_d = x^2 + d_dot_d_row

    Exact in the reals; in floating point a sum or product is associated anew, within its own rounding error.
    """
    rates = program.input_rates()
    steps: list[Step] = []
    known: dict[tuple[sp.Basic, Format], sp.Symbol] = {}
    taken = {*program.inputs, *(step.name for step in program.steps)}
    for step in program.steps:
        slower: list[Step] = []
        value = _hoisted(step.value, step, rates, slower, known, taken)
        for new in (*slower, replace(step, value=value)):
            rates[new.name] = RATES.index(new.rate)
            steps.append(new)
    return program.with_steps(steps)


def _name_of_square(value: sp.Basic) -> str | None:
    """focal2 for focal^2; None for what is not the square of a name."""
    if isinstance(value, sp.Pow) and isinstance(value.base, sp.Symbol) and value.exp == 2:
        return f"{value.base.name.removeprefix('scene_')}2"
    return None


def _hoisted(
    value: sp.Basic,
    step: Step,
    rates: dict[str, int],
    slower: list[Step],
    known: dict[tuple[sp.Basic, Format], sp.Symbol],
    taken: set[str],
) -> sp.Basic:
    def rate_of(expression: sp.Basic) -> int:
        return max((rates.get(s.name, 0) for s in expression.free_symbols), default=0)

    def named(expression: sp.Basic, rate: int) -> sp.Basic:
        if expression.is_Atom or (-expression).is_Atom:
            return expression
        key = expression, step.format
        if key not in known:
            word: Rate = RATES[rate]
            square = _name_of_square(expression)
            is_square = square is not None and square not in taken
            stem = square if square is not None and is_square else f"{step.name}_{word}"
            name = stem if all(s.name != stem for s in slower) else f"{stem}_{len(slower)}"
            taken.add(name)
            known[key] = symbol(name)
            slower.append(
                replace(
                    step,
                    name=name,
                    value=expression,
                    rate=word,
                    meaning="" if is_square else f"what is the same for a {word} in {step.name}",
                    source="",
                )
            )
        return known[key]

    here = rate_of(value)
    if value.is_Atom or here == 0 or not value.args:
        return value
    if value.is_Add or value.is_Mul:
        groups: dict[int, list[sp.Basic]] = {}
        for argument in value.args:
            groups.setdefault(rate_of(argument), []).append(argument)
        parts: list[sp.Basic] = []
        for rate, members in sorted(groups.items()):
            if rate < here:
                symbols_only = [m for m in members if not m.is_Number]
                joined = value.func(*members)
                parts.append(named(joined, rate) if symbols_only and not (rate == 0 and joined.is_Number) else joined)
            else:
                parts += [_hoisted(member, step, rates, slower, known, taken) for member in members]
        return value.func(*parts)
    rebuilt = [
        named(argument, rate_of(argument))
        if rate_of(argument) < here and argument.is_Pow
        else _hoisted(argument, step, rates, slower, known, taken)
        for argument in value.args
    ]
    return value.func(*rebuilt)


def prune(program: KernelProgram) -> KernelProgram:
    """Steps whose value nothing uses are left out. Exact."""
    needed = set(program.outputs)
    kept: list[Step] = []
    for step in reversed(program.steps):
        if step.name in needed:
            kept.append(step)
            needed |= step.uses()
    return program.with_steps(reversed(kept))


def arrange(program: KernelProgram) -> KernelProgram:
    """Steps of one section and rate are brought together as far as their order allows; none moves before what it uses.
    Exact.
    """
    waiting = list(program.steps)
    defined: set[str] = set()
    names = {step.name for step in waiting}
    ordered: list[Step] = []
    last: dict[Rate, str] = {}
    while waiting:
        ready = [step for step in waiting if step.uses() & names <= defined]
        rate = ready[0].rate
        of_rate = [step for step in ready if step.rate == rate]
        step = next((entry for entry in of_rate if entry.section == last.get(rate)), of_rate[0])
        last[rate] = step.section
        waiting.remove(step)
        defined.add(step.name)
        ordered.append(step)
    return program.with_steps(ordered)
