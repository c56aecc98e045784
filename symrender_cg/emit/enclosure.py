"""`emit_enclosure(...)` -> the C text of the kernel that encloses a scene's intensities: values with a proved error.

Comes in: parts of the derivation lowered to balls, what the scene needs. Goes out: C99 text. The formulas are those of
the parts; templates/enclosure.c.j2 has the loops and the decisions. What the plan leaves out leaves the text.
Never done here: a bound; ball.h has those.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from symrender_cg.derive import parts
from symrender_cg.derive.parts import Part
from symrender_cg.derive.symbols import symbol
from symrender_cg.emit.bodies import INDENT, body, closure, declared, operations
from symrender_cg.emit.c99 import Emitted, environment, support_files
from symrender_cg.emit.printer import C_TYPES
from symrender_cg.emit.scene import hit_tests, scene_parts, tidied
from symrender_cg.emit.scene_fields import Field, Needs, field_lines, scene_fields
from symrender_cg.lower.program import KernelProgram, Step
from symrender_cg.plan.plan import Plan
from symrender_cg.version import VERSION

_DEEP = 2 * INDENT
_SIGHT = ("facing2", "before_eye")
_RAY = {"x": "r->", "y": "r->"}


@dataclass(frozen=True, slots=True)
class _Primary:
    """A part that takes the eye's ray: what is kept of each sphere, and the functions of a point."""

    declarations: list[str]
    sphere_lines: list[str]
    inits: list[str]
    sight: list[str]
    surface: list[str]
    stores: list[str]
    distance: list[str]
    m_x: str = ""
    m_y: str = ""
    depth: str = ""


def enclosure_parts(need: Needs) -> dict[str, Part]:
    """The parts of a scene's enclosure: those of its kernel, with the cross-product form for every sphere of the eye.

    Whether a blocker ends beyond the lamp is decided apart; no distance is cut at the horizon.
    """
    found = {name: part for name, part in scene_parts(need).items() if name != "span"}
    if need.spheres:
        found["near"] = parts.sphere_part(near=True, mirrored=need.specular or need.mirrors)
    if need.shadows:
        results = ("inside2", "toward")
        shadow = found["shadow"]
        kept = tuple(definition for definition in shadow.definitions if definition.name != "shade")
        found["shadow"] = replace(shadow, definitions=kept, results=results)
    if need.attenuation:
        fading = found["fading"]
        whole = {symbol("finite_w2"): symbol("w2")}
        kept = tuple(replace(d, value=d.value.xreplace(whole)) for d in fading.definitions if d.name != "finite_w2")
        found["fading"] = replace(fading, definitions=kept)
    return found


def enclosure_fields(need: Needs) -> tuple[Field, ...]:
    """The fields of the enclosure's scene structure: those of the scene's kernel, with what is no double as balls."""
    gone = {f"{stem}_{axis}" for stem in ("across", "along") for axis in "xyz0"} | {"at_eye"}
    gone |= {f"up_{axis}" for axis in "xyz"}
    fields = [field for field in scene_fields(need) if field.name not in gone]
    meanings = {
        "plane_x": "normal of the plane as it is given, on the eye's side",
        "light_x": "place; for a light in parallel direction to it, of any length",
    }
    if need.lit:
        fields.append(Field("nearer", "reals", "[lights] 1 for a light that was brought nearer, else 0"))
    fields = [replace(field, meaning=meanings.get(field.name, field.meaning)) for field in fields]
    if need.plane:
        fields.append(Field("ground", "reals", "[4][3] unit normal of the plane, height of the eye"))
    if need.checker:
        fields.append(Field("tiles", "reals", "[8][3] steps of tiles across, the eye's tile; and along"))
    if need.gradient:
        fields.append(Field("upward", "reals", "[3][3] unit vector upwards"))
    return tuple(fields)


def emit_enclosure(
    programs: Mapping[str, KernelProgram], *, need: Needs, plan: Plan, command: str, name: str
) -> Emitted:
    """C99 text of a scene's enclosure. `command` is the line that regenerates it."""
    fields = enclosure_fields(need)
    lines = field_lines(fields)
    includes = ["inline.h", "units.h", "double_double.h", "ball.h", "settle.h"]
    includes += ["ball_power.h"] if need.specular else []
    includes += ["exact_sign.h"] if need.spheres or need.plane else []
    context: dict[str, object] = {
        "name": name,
        "version": VERSION,
        "command": command,
        "plan": plan,
        "title": "enclosures of the image of a scene, every number an argument",
        "channels": need.channels,
        "need": need,
        "lit": need.lit,
        "spheres": need.spheres,
        "seen": need.spheres or need.plane,
        "bent": need.specular or need.mirrors,
        "contested": need.spheres and (need.intersections or need.crossing),
        "given": need.plane or need.gradient,
        "fields": lines,
        "width": max(len(line.declaration) for line in lines) + 3,
        "includes": includes,
        "cost": ["on balls, a point: " + ", ".join(f"{key} {_calls(program)}" for key, program in programs.items())],
        **_bodies(programs, need),
    }
    source = tidied(environment().get_template("enclosure.c.j2").render(context))
    header = environment().get_template("enclosure.h.j2").render(context)
    files = {f"{name}.c": source, f"{name}.h": header}
    files |= support_files((*includes, *(["precise_power.h"] if need.specular else [])))
    return Emitted(
        name=name,
        files=files,
        cdef=environment().get_template("enclosure.cdef.j2").render(context),
        inputs=tuple(field.name for field in fields),
        result_type="double",
        operations={"pixel": dict(operations(s for program in programs.values() for s in program.at("pixel")))},
        fields=tuple((field.name, field.shape) for field in fields),
    )


def _bodies(programs: Mapping[str, KernelProgram], need: Needs) -> dict[str, object]:
    """What the template places, by name."""
    point = "p" if need.plane else "n"
    of_site = {f"{stem}_{axis}": f"at->{stem}_{axis}" for stem in ("n", "mirror") for axis in "xyz"}
    of_site |= {f"p_{axis}": f"at->{point}_{axis}" for axis in "xyz"} | {"inv_d2": "at->inv_d2"}
    of_plane = {f"plane_{axis}": f"h->plane_{axis}" for axis in "xyz"}
    found: dict[str, object] = {f"point_{axis}": f"at->{point}_{axis}" for axis in "xyz"}

    def loop(key: str, part: str, places: Mapping[str, str], indent: str, names: Iterable[str] = ()) -> None:
        program = programs[part]
        places = {name: f"={place}" for name, place in places.items() if name not in program}
        steps = closure(program.steps, tuple(names) or program.wanted)
        found[f"{key}_lines"] = body(steps, places, indent)

    if need.spheres:
        found["near"] = _primary(programs["near"], need)
        found["sign_tests"] = hit_tests(near=True)
    if need.plane:
        found["plane"] = _primary(programs["plane"], need)
    if need.checker:
        loop(
            "tiles",
            "tiles",
            {f"{stem}_{end}": f"h->{stem}_{end}" for stem in ("across", "along") for end in "xyz0"},
            INDENT,
        )
    if need.lit:
        place = {f"center_{axis}": f"c->{axis}" for axis in "xyz"} | {"radius": "c->radius"}
        loop("lamp", "lamp", place, _DEEP)
        lamp = {f"lamp_{axis}": f"l->lamp_{axis}" for axis in "xyz"} | {"nearness": "l->nearness"}
        loop("reach", "reach", of_site | lamp, INDENT)
        loop("matte", "matte", of_site, _DEEP if need.specular else INDENT)
    if need.specular:
        loop("glossy", "glossy", of_site, _DEEP)
    if need.attenuation:
        loop("fading", "fading", {f"fade_{k}": f"l->fade_{k}" for k in "abc"}, INDENT)
    if need.shadows:
        gap = {f"gap_{axis}": f"q->gap_{axis}" for axis in "xyz"} | {"ratio2": "q->ratio2"}
        loop("shadow", "shadow", of_site | gap, _DEEP)
    if need.gradient:
        loop("gradient", "gradient", {f"up_{axis}": f"h->up_{axis}" for axis in "xyz"}, INDENT)
    if need.mirrors:
        loop("echo", "echo", of_site, INDENT)
        loop("arrival", "arrival", of_site, INDENT)
        found["arrival_stores"] = _stores("next->", need, normal="n_{}", point="n_{}", mirror="next_{}")
        if need.plane:
            loop("echo_plane", "echo_plane", of_site | of_plane, INDENT, ("descent", "t"))
            landing = [f"{stem}_{axis}" for stem in ("foot", "next") for axis in "xyz"]
            loop("landing", "echo_plane", of_site | of_plane, INDENT, (*landing, "inv_d2"))
            found["landing_stores"] = _stores("next->", need, normal="h->plane_{}", point="foot_{}", mirror="next_{}")
    return found


def _stores(target: str, need: Needs, *, normal: str, point: str, mirror: str, inverse: str = "inv_d2") -> list[str]:
    """The statements that fill a site."""
    pairs = [("n", normal)]
    pairs += [("p", point)] if need.plane else []
    pairs += [("mirror", mirror)] if need.specular or need.mirrors else []
    stores = [f"{target}{stem}_{axis} = {source.format(axis)};" for stem, source in pairs for axis in "xyz"]
    stores += [f"{target}inv_d2 = {inverse};"] if need.specular or need.mirrors else []
    return [INDENT + store for store in stores]


def _primary(program: KernelProgram, need: Needs) -> _Primary:
    """`sphere->` has what is kept of a sphere; what is the same for every ray of the plane is computed again."""
    of_sphere = program.name == "near"
    pixel = program.at("pixel")
    slow = tuple(step for step in program.steps if step.rate != "pixel")
    places = {f"center_{axis}": f"=c->{axis}" for axis in "xyz"} | {"radius": "=c->radius", "eye": "=eye"}
    bent = ("mirror_x", "mirror_y", "mirror_z", "inv_d2") if need.specular or need.mirrors else ()
    own = ("n_x", "n_y", "n_z") if of_sphere else ("p_x", "p_y", "p_z")

    def words(names: Sequence[str]) -> list[str]:
        if of_sphere:
            return body(closure(pixel, names), _RAY | {step.name: "sphere->" for step in slow})
        fixed = {f"plane_{axis}": "h->" for axis in "xyz"} | {"eye": "h->"}
        return body(closure(program.steps, names), _RAY | fixed)

    kept = {name for step in pixel for name in step.uses()} & {step.name for step in slow}
    kept |= {"offset_x", "offset_y", "depth"} if of_sphere else set()
    carried = [step for step in slow if step.name in kept]
    distance = ("hit_distance",)
    return _Primary(
        declarations=declared((_c_type(step), step.name) for step in carried),
        sphere_lines=body(closure(slow, [step.name for step in carried]), places) if of_sphere else [],
        inits=[f".{step.name} = {step.name}" for step in carried],
        sight=words(_SIGHT if of_sphere else ("descent",)),
        surface=words((*own, *bent)),
        stores=_stores(
            "at->",
            need,
            normal="n_{}" if of_sphere else "h->plane_{}",
            point="n_{}" if of_sphere else "p_{}",
            mirror="mirror_{}",
        ),
        distance=words(distance) if distance[0] in program else [],
        m_x="offset_x",
        m_y="offset_y",
        depth="depth",
    )


def _calls(program: KernelProgram) -> int:
    """How many functions of ball.h the steps of a point call."""
    return operations(program.at("pixel"))["call"]


def _c_type(step: Step) -> str:
    return str(C_TYPES[step.format].name)
