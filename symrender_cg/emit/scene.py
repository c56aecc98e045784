"""`emit_scene(...)` -> the C text of the kernel of a scene of many spheres, lights and what else its plan calls for.

The parts of the derivation become the bodies of its loops; templates/scene.c.j2 has the loops, the lists and the entry
points, and contains no mathematics of the image. What the plan leaves out leaves the text.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from symrender_cg.derive import parts
from symrender_cg.derive.exact import sign_tests
from symrender_cg.derive.image import derive_sphere
from symrender_cg.derive.margins import MOST_TURN, gate_part, with_margin
from symrender_cg.derive.parts import Part, low
from symrender_cg.emit.bodies import INDENT, body, closure, counts, operations
from symrender_cg.emit.c99 import SUPPORT, Emitted, environment, printed_test, support_files
from symrender_cg.emit.lobes import Lobes, lobes_of
from symrender_cg.emit.parts import PrimaryBodies
from symrender_cg.emit.scene_fields import Needs, field_lines, scene_fields
from symrender_cg.lower.formats import WIDE
from symrender_cg.lower.lower import FUNCTIONS
from symrender_cg.lower.nodes import Call, walk
from symrender_cg.lower.program import RATES, KernelProgram
from symrender_cg.lower.variants import MOST_ROUNDOFFS, Variant
from symrender_cg.plan.plan import Plan
from symrender_cg.version import VERSION

_GIVEN_AS = {"blur": "blurred", "turn": "turned"}
"""Arrays of the points by what a part calls the quantity that it gives them; the blur of spheres is 1."""

_LOW = tuple(low(f"{stem}_{axis}") for stem in ("p", "mirror") for axis in "xyz")
"""Arrays of second words, where points and rays have two."""

_LOOP = 2 * INDENT
_DEEP = 3 * INDENT
_TITLES = {
    "span": "spheres before the eye: their pixels in a row are one span",
    "near": "spheres that reach the plane of the eye: each pixel is tested",
    "plane": "the ground plane",
}


@dataclass(frozen=True, slots=True)
class Primary:
    """What the template needs of a part that takes the eye's ray."""

    name: str
    title: str
    bodies: PrimaryBodies
    arguments: str
    uses: str
    sign_tests: tuple[dict[str, object], ...]
    distance: list[str]
    sight: list[str]
    stores: list[str]
    void_row: str
    void_distance: str
    void_sight: str
    void_surface: str


def scene_parts(need: Needs, *, marks: bool = False) -> dict[str, Part]:
    """The parts of the derivation that a scene's kernel is made of; `marks`: with the margins of what they decide."""
    bent, in_full = need.specular or need.mirrors, marks and need.mirrors
    found: list[Part] = []
    if need.spans:
        found.append(parts.sphere_part(near=False, mirrored=bent, in_full=in_full))
    if need.at_eye:
        found.append(parts.sphere_part(near=True, mirrored=bent, in_full=in_full))
    if need.plane:
        found.append(parts.plane_part(mirrored=bent, in_full=in_full))
    if need.checker:
        found.append(parts.tiles_part())
    if need.lit:
        found += [parts.lamp_part(), parts.reach_part("p"), parts.shading_part(glossy=False)]
    if need.specular:
        found.append(parts.shading_part(glossy=True))
    if need.specular_gate and marks:
        found.append(gate_part())
    if need.attenuation:
        found.append(parts.fading_part())
    if need.shadows:
        found.append(parts.shadow_part("p"))
    if need.mirrors:
        found += [parts.echo_part("p"), parts.arrival_part("p", in_full=in_full, grounded=need.plane)]
        if need.plane:
            found.append(parts.echo_plane_part("p"))
        if need.plane and in_full:
            found.append(parts.landing_part("p"))
    if need.gradient:
        found.append(parts.gradient_part())
    return {part.name: with_margin(part, blurred=need.plane) if marks else part for part in found}


def marks_doubt(variant: Variant) -> bool:
    """Whether the kernel of a level lists the pixels that rounding may have decided, for somebody else to settle."""
    return variant.shading == "float64" and variant.exact


def emit_scene(
    programs: Mapping[str, KernelProgram],
    *,
    need: Needs,
    plan: Plan,
    variant: Variant,
    command: str,
    name: str,
) -> Emitted:
    """C99 text of a scene's kernel. `command` is the line that regenerates it."""
    single = variant.shading == "float32"
    real = "float" if single else "double"
    marks, stored = marks_doubt(variant), _stored(need)
    in_full = marks and need.mirrors
    stored += ("blur",) if marks and need.plane else ()
    stored += ("turn", *_LOW) if in_full else ()
    primaries = [_primary(programs[key], need, stored) for key in ("span", "near", "plane") if key in programs]
    fields = scene_fields(need, in_full=in_full)
    lines = field_lines(fields)
    writer = _Loops(programs, need, marks)
    includes = _includes(programs, need)
    held = [f"{part.name}s" for part in primaries if part.bodies.has_sphere]
    held += ["row_first", "row_last"] if need.spheres else []
    held += ["lamps"] if need.lit else []
    lobes = writer.lobes
    squares = FUNCTIONS[variant.powers].get("whole") if lobes is not None and variant.passes.whole else None
    held += ["half_exponents"] if squares else []
    spared = marks and need.lit and not need.mirrors and not need.attenuation
    held += ["spared"] if spared else []
    unit = f"h->{primaries[0].name}.plane_unit" if primaries else "1.0"
    contest = [
        *(["scene->partners_begin[k + 1] > scene->partners_begin[k]"] if need.intersections else []),
        *(["scene->crosses_plane[k]"] if need.crossing else []),
    ]
    contested = need.spheres and (need.intersections or need.crossing)
    context = {
        "marks": marks,
        "row_marks": marks and (contested or need.plane),
        "blurred": need.plane,
        "in_full": in_full,
        "most_roundoffs": MOST_ROUNDOFFS,
        "most_turn": float(MOST_TURN).hex(),
        "name": name,
        "version": VERSION,
        "command": command,
        "plan": plan,
        "variant": variant,
        "title": _title(need),
        "decided": _decided(need),
        "real": real,
        "single": single,
        "cast": "(float)" if single else "",
        "zero": "0.0f" if single else "0.0",
        "one": "1.0f" if single else "1.0",
        "channels": need.channels,
        "need": need,
        "lit": need.lit,
        "dimmed": need.shadows or need.attenuation,
        "spheres": need.spheres,
        "seen": need.spheres or need.plane,
        "spans": need.spans,
        "near": need.at_eye,
        "contested": contested,
        "by_gaps": need.spans and not need.at_eye and not contested,
        "owners": contested or need.at_eye or need.plane,
        "lobes": lobes,
        "squares": squares,
        "spared": spared,
        "contest": " || ".join(contest),
        "mirrored_spheres": need.mirrors,
        "primaries": primaries,
        "fields": lines,
        "width": max(len(line.declaration) for line in lines) + 3,
        "includes": includes,
        "point_arrays": _point_arrays(need, stored, real),
        "held_arrays": held,
        "missing": " || ".join(f"!h->{array}" for array in held) or "0",
        "unit": unit,
        "cost": _cost(programs),
        **writer.context(),
    }
    source = tidied(environment().get_template("scene.c.j2").render(context))
    header = environment().get_template("scene.h.j2").render(context)
    files = {f"{name}.c": source, f"{name}.h": header}
    files |= support_files(("grid.h", *includes))
    steps = [step for program in programs.values() for step in program.steps]
    total: dict[str, dict[str, int]] = {
        rate: dict(operations(step for step in steps if step.rate == rate)) for rate in RATES
    }
    return Emitted(
        name=name,
        files=files,
        cdef=environment().get_template("scene.cdef.j2").render(context),
        inputs=tuple(field.name for field in fields),
        result_type=real,
        operations=total,
        fields=tuple((field.name, field.shape) for field in fields),
    )


def _title(need: Needs) -> str:
    what = "spheres" if need.spheres else "an empty scene"
    if need.plane:
        what = "spheres on a plane" if need.spheres else "a plane"
    return f"{what}, every number an argument"


def _decided(need: Needs) -> str:
    """What is decided in floating point, as words; empty where nothing is."""
    things = [
        *(["which of two intersecting surfaces is in front"] if need.intersections or need.crossing else []),
        *(["the horizon of the plane"] if need.plane else []),
        *(["the edges of tiles"] if need.checker else []),
        *(["the edges of shadows"] if need.shadows else []),
        *(["what mirrors show"] if need.mirrors else []),
    ]
    if not things:
        return ""
    listed = things[0] if len(things) == 1 else f"{', '.join(things[:-1])} and {things[-1]}"
    return f"{listed} {'are' if len(things) > 1 or need.shadows else 'is'}"


def _stored(need: Needs) -> tuple[str, ...]:
    names = ["n_x", "n_y", "n_z"]
    names += ["p_x", "p_y", "p_z"] if need.plane else []
    names += ["mirror_x", "mirror_y", "mirror_z", "inv_d2"] if need.specular or need.mirrors else []
    return tuple(names)


def _point_arrays(need: Needs, stored: Sequence[str], real: str) -> list[str]:
    groups: list[tuple[list[str], str]] = [(["n_x", "n_y", "n_z"], "outward normal")]
    if need.plane:
        groups.append((["p_x", "p_y", "p_z"], "from its receiver's origin, in its unit: a sphere's normal"))
    if "inv_d2" in stored:
        groups.append((["mirror_x", "mirror_y", "mirror_z"], "the ray mirrored there"))
        groups.append((["inv_d2"], "one over its length squared"))
    if need.lit:
        groups.append((["w_x", "w_y", "w_z", "w2"], "to the lamp, and its length squared"))
        if need.shadows or need.attenuation:
            groups.append((["light"], "how much of the lamp's light arrives"))
        groups.append((["cosine"], "max(0, n.l)"))
    if need.specular:
        groups.append((["lobe", "shininess"], "max(0, r.v)^n, and n"))
    texts = [(f"    {real} {', '.join(f'{n}[POINTS]' for n in names)};", meaning) for names, meaning in groups]
    return [f"{text}   /* {meaning} */" for text, meaning in texts]


def _primary(program: KernelProgram, need: Needs, stored: Sequence[str]) -> Primary:
    kind = program.name
    sources = [_source(name, of_sphere=kind != "plane") for name in stored]
    bodies = PrimaryBodies(program, sources)
    given = [("ball", f"const {kind}_sphere *ball")] if bodies.has_sphere else []
    given.append(("f", f"const {kind}_frame *f"))
    names = [name for name, _ in given]
    distance = bodies.pixel(("hit_distance",) if bodies.has_sphere else ("hit_distance", "descent"))
    sight = bodies.sight() if bodies.has_sphere else []
    stores = [
        f"p->{target}[at + i] = {bodies.carried_word(source)};"
        for target, source in zip(stored, sources, strict=True)
        if source in program
    ]
    tests = hit_tests(near=kind == "near") if bodies.has_sphere else ()
    return Primary(
        name=kind,
        title=_TITLES[kind],
        bodies=bodies,
        arguments="".join(f", {declaration}" for _, declaration in given),
        uses="".join(f", {name}" for name in names),
        sign_tests=tests,
        distance=distance,
        sight=sight,
        stores=[_LOOP + line for line in stores],
        void_row=_void(bodies.row.lines, names),
        void_distance=_void(distance, ["r", *names]),
        void_sight=_void(sight, ["r", *names]),
        void_surface=_void([*bodies.surface, *stores], ["r", *names]),
    )


def _source(name: str, *, of_sphere: bool) -> str:
    """The quantity that an array takes: a sphere's point, seen from its centre in radii, is its normal."""
    source = _GIVEN_AS.get(name, name)
    return source.replace("p_", "n_") if source.startswith("p_") and of_sphere else source


def _void(lines: Iterable[str], names: Iterable[str]) -> str:
    text = "\n".join(lines)
    absent = [name for name in names if f"{name}->" not in text]
    return INDENT + " ".join(f"(void){name};" for name in absent) + "\n" if absent else ""


def hit_tests(*, near: bool) -> tuple[dict[str, object], ...]:
    """The polynomials whose signs decide whether a ray hits sphere k; `near`: it may lie behind the eye."""
    image = derive_sphere("sphere", front_test=near, diffuse=False, specular=False, gated=False)

    def place(factor: str) -> str:
        if factor in ("x", "y"):
            return factor
        return "scene->eye" if factor == "eye" else f"scene->{factor}[k]"

    return tuple(printed_test(test, place) for test in sign_tests(image))


def _includes(programs: Mapping[str, KernelProgram], need: Needs) -> list[str]:
    uses = {
        node.function
        for program in programs.values()
        for step in program.steps
        for node in walk(step.value)
        if isinstance(node, Call)
    }
    formats = {step.format for program in programs.values() for step in program.steps}
    always = {"inline.h", "units.h", "block.h"}
    always |= {"span.h"} if need.spans else set()
    always |= {"double_double.h", "exact_sign.h"} if need.spheres else set()
    always |= {"double_double.h", "pair.h"} if "pair" in formats else set()
    return [
        header
        for header, functions in SUPPORT.items()
        if header in always or (functions and header != "double_double.h" and uses & set(functions))
    ]


def _cost(programs: Mapping[str, KernelProgram]) -> list[str]:
    lines = []
    for name, program in programs.items():
        by_rate = [(rate, counts(program.at(rate))) for rate in RATES]
        told = ", ".join(f"a {rate}: {text}" for rate, text in by_rate if text != "none")
        lines.append(f"{name}: {told}")
    return lines


def tidied(text: str) -> str:
    """Without the blank lines that left-out parts leave behind."""
    lines: list[str] = []
    for line in text.split("\n"):
        line = line.rstrip()
        if not line and lines and (not lines[-1] or lines[-1].endswith("{")):
            continue
        if line.strip() == "}" and lines and not lines[-1]:
            lines.pop()
        lines.append(line)
    return "\n".join(lines)


class _Loops:
    """The bodies of the loops over points that wait in arrays."""

    def __init__(self, programs: Mapping[str, KernelProgram], need: Needs, marks: bool) -> None:
        self.programs = programs
        self.need = need
        self.marks = marks
        self.parts = scene_parts(need, marks=marks)
        self.point = "p" if need.plane else "n"
        self.lobes = self._lobes() if need.specular else None

    def context(self) -> dict[str, object]:
        """What the template places, by name."""
        found: dict[str, object] = {}
        need = self.need
        if need.lit:
            found |= self._loop("reach", "reach")
            found |= self._loop("matte", "matte")
            lamp = {
                name: f"scene->{{}}[{'light' if 'light_' in name else 'k'}]" for name in self.programs["lamp"].inputs
            }
            found["lamp_lines"] = body(self.programs["lamp"].steps, lamp, _LOOP)
        if need.specular:
            found |= self._loop("glossy", "glossy")
        if need.specular_gate and self.marks:
            found |= self._loop("gate", "gate", indent=_DEEP, head=_LOOP)
        if need.attenuation:
            found |= self._loop("fading", "fading")
        if need.shadows:
            found |= self._loop("shadow", "shadow", indent=_DEEP, head=_LOOP)
        if need.checker:
            found["tiles_lines"] = body(self.programs["tiles"].steps, {})
        if need.gradient:
            found["gradient_lines"] = body(self.programs["gradient"].steps, {})
        if need.plane:
            plane = PrimaryBodies(self.programs["plane"], ())
            told = ("margin", *(("blurred",) if need.checker else ())) if self.marks else ()
            ground = plane.pixel(("descent", *(("p_x", "p_y", "p_z") if need.checker else ()), *told))
            found |= {"ground_lines": ground, "void_ground": _void(ground, ["r", "f"])}
        if need.mirrors:
            margin = ("margin",) if self.marks else ()
            found |= self._loop("echo", "echo", ("disc", "ahead", "t", *margin))
            found |= self._loop("arrival", "arrival")
            found["arrival_stores"] = self._stores("arrival", ("n", "n"), ("mirror", "next"), point="n")
            if need.plane:
                first = ("descent", "t", *(("foot_x", "foot_y", "foot_z") if need.checker else ()), *margin)
                first += ("blurred",) if self.marks and need.checker else ()
                found |= self._loop("echo_plane", "echo_plane", first)
                second = ("foot_x", "foot_y", "foot_z", "next_x", "next_y", "next_z", "inv_d2")
                told = ("blurred", "turned") if self.marks else ()
                landing, normal = ("landing", "full_plane") if self.marks else ("echo_plane", "plane")
                found |= self._loop("landing", landing, (*second, *told))
                found["landing_stores"] = self._stores(landing, ("mirror", "next"), ("n", normal), point="foot")
        return found

    def _lobes(self) -> Lobes | None:
        arrays = self.parts["glossy"].arrays
        return lobes_of(self.programs["glossy"], ("cosine", "lobe"), dict.fromkeys(arrays, "p->{}[i]"), _LOOP)

    def _loop(
        self,
        key: str,
        part: str,
        results: tuple[str, ...] | None = None,
        *,
        indent: str = _LOOP,
        head: str = INDENT,
    ) -> dict[str, object]:
        program = self.programs[part]
        arrays = self.parts[part].arrays
        places = dict.fromkeys(arrays, "p->{}[i]")
        places |= {f"p_{axis}": f"=p->{self.point}_{axis}[i]" for axis in "xyz"}
        places |= _WAY if self.parts[part].in_full else {}
        steps = program.steps if results is None else closure(program.steps, results)
        before = [step for step in steps if step.rate != "pixel"]
        inside = [step for step in steps if step.rate == "pixel"]
        return {f"{key}_lines": body(inside, places, indent), f"{key}_head": body(before, places, head)}

    def _stores(self, part: str, *pairs: tuple[str, str], point: str) -> list[str]:
        """What a point that is seen in a mirror keeps: arrays by the stems of their quantities, and where it lies."""
        format_of = {step.name: step.format for step in self.programs[part].steps}
        pairs = (*pairs, ("p", point)) if self.need.plane else pairs
        lines = []
        for target, source in pairs:
            for axis in "xyz":
                word = f"{source}_{axis}.hi" if format_of.get(f"{source}_{axis}") in WIDE else f"{source}_{axis}"
                lines.append(f"child->{target}_{axis}[j] = {word};")
        lines.append(f"child->inv_d2[j] = inv_d2{'.hi' if format_of['inv_d2'] in WIDE else ''};")
        if self.marks:
            stems = {"p": point, "mirror": "next"}
            lines += [f"child->{low(f'{k}_{axis}')}[j] = {stems[k]}_{axis}.lo;" for k in stems for axis in "xyz"]
        return [_LOOP + line for line in lines]


_WAY = {
    **{f"own_{axis}": f"=scene->center_{axis}[of]" for axis in "xyz"},
    **{f"seen_{axis}": f"=scene->center_{axis}[k]" for axis in "xyz"},
    "own_radius": "=scene->radius[of]",
    "own_radius_low": "=scene->radius_low[of]",
    "reach": "=scene->radius[k]",
    "eye_z": "=scene->center_z[scene->spheres]",
    "height": "=scene->radius[scene->spheres]",
    "height_low": "=scene->radius_low[scene->spheres]",
    **{f"plane_{axis}{end}": f"=scene->plane_{axis}{end}" for axis in "xyz" for end in ("", low(""))},
}
"""Where the numbers of a mirror, of what is seen in it, and of the plane are, for the parts that take them in full."""
