"""The bodies of a kernel's functions: steps become declarations, sections with their sources and operations.

sympy.codegen.ast declarations and comments, printed by `KernelPrinter`; lines of at most 120 columns.
"""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from sympy.codegen.ast import Comment, Declaration, Variable, value_const

from symrender_cg.derive.symbols import symbol
from symrender_cg.emit.printer import C_TYPES, KernelPrinter
from symrender_cg.lower.formats import WIDE
from symrender_cg.lower.nodes import Call
from symrender_cg.lower.program import KernelProgram, Step, operations_of

WIDTH = 120
INDENT = "    "


def operations(steps: Iterable[Step]) -> Counter[str]:
    total: Counter[str] = Counter()
    for step in steps:
        total += operations_of(step)
    return total


def counts(steps: Iterable[Step]) -> str:
    """Operations in words: `12 mul 7 add 2 sqrt`."""
    total = operations(steps)
    order = ("mul", "add", "div", "sqrt", "max", "select", "call")
    return " ".join(f"{total[kind]} {kind}" for kind in order if total[kind]) or "none"


class Bodies:
    """The bodies of a kernel's functions, printed once, for the template to place."""

    def __init__(self, program: KernelProgram, *, baked: bool) -> None:
        self.program = program
        self.baked = baked
        self.rate = {step.name: step.rate for step in program.steps}
        self.format = {step.name: step.format for step in program.steps}
        pixel, row = program.at("pixel"), program.at("row")
        later = {name for step in (*row, *pixel) for name in step.uses()} | set(program.outputs)
        self.frame_fields = [] if baked else self._fields(program.at("frame"), later, program.inputs)
        of_row = {name for step in pixel for name in step.uses()} | set(program.ends or ()) | set(program.hit)
        self.row_fields = [(self._type(s), s.name) for s in row if s.name in of_row]
        if "y" in of_row:
            self.row_fields.insert(0, ("double", "y"))
        self.frame = body(program.at("frame"), dict.fromkeys(program.inputs, "scene->"))
        carried = "" if baked else "f->"
        frame_places = dict.fromkeys((*program.inputs, *(s.name for s in program.at("frame"))), carried)
        self.row = body(row, frame_places)
        self.frame_places = frame_places
        self.pixel_places = frame_places | {s.name: "r->" for s in row} | {"y": "r->"}
        self.pixel = body(pixel, self.pixel_places)
        self.sight = body(closure(pixel, ("d_dot_d", *program.hit)), self.pixel_places)
        self.constants = self._constants(program.at("frame")) if baked else []

    def word(self, name: str) -> str:
        """The C expression of a quantity in `shade`, as one floating-point number: the high word of a double-double."""
        place = self.pixel_places.get(name, "")
        return place + (f"{name}.hi" if self.format[name] in WIDE else name)

    @property
    def row_uses_frame(self) -> bool:
        """Whether the row's statements read the frame."""
        return any("f->" in line for line in self.row)

    @property
    def background(self) -> str:
        """The C expression of the background's intensity in an entry point."""
        return "background" if self.baked else f"scene->{self.program.background.removeprefix('scene_')}"

    @property
    def row_inits(self) -> list[str]:
        """Initialisers of the row structure, in lines."""
        inits = ", ".join(f".{name} = {name}" for _, name in self.row_fields)
        return textwrap.wrap(inits + ",", WIDTH - 10, break_long_words=False)

    @property
    def frame_inits(self) -> list[str]:
        """Initialisers of the frame structure."""
        inputs = {f"scene_{name}": f"scene->{name}" for name in (i.removeprefix("scene_") for i in self.program.inputs)}
        return [f".{n.removeprefix('scene_')} = {inputs.get(n, n)}" for _, n in self.frame_fields]

    def frame_declarations(self) -> list[str]:
        """Fields of the frame structure, those of one type together."""
        return declared((kind, name.removeprefix("scene_")) for kind, name in self.frame_fields)

    def row_declarations(self) -> list[str]:
        """Fields of the row structure."""
        return declared(self.row_fields)

    def _type(self, step: Step) -> str:
        return str(C_TYPES[step.format].name)

    def _fields(self, steps: Sequence[Step], later: set[str], inputs: Sequence[str]) -> list[tuple[str, str]]:
        fields = [(self._type(step), step.name) for step in steps if step.name in later]
        return fields + [("double", name) for name in inputs if name in later and name != self.program.background]

    def _constants(self, steps: Sequence[Step]) -> list[str]:
        lines = []
        used = {name for step in self.program.steps for name in step.uses()} | set(self.program.outputs)
        for step in steps:
            if step.name not in used:
                continue
            printer = KernelPrinter({}, step.format == "float32")
            kind = C_TYPES[step.format].name
            if isinstance(step.value, Call):
                words = ", ".join(printer._print(word) for word in step.value.args[1:])
                value = f"{{{words}}}"
            else:
                value = printer._print(step.value)
            line = f"static const {kind} {step.name} = {value};"
            if step.meaning and len(line) + len(step.meaning) + 9 > WIDTH:
                lines += [f"/* {step.meaning} */", line]
            else:
                lines.append(f"{line}   /* {step.meaning} */" if step.meaning else line)
        return lines


def body(steps: Sequence[Step], places: Mapping[str, str], indent: str = INDENT) -> list[str]:
    """Lines of declarations, a comment before each section; `places` as for KernelPrinter."""
    lines: list[str] = []
    section: str | None = None
    group: list[Step] = []
    for step in (*steps, None):
        if step is None or step.section != section:
            if group:
                lines += ["", *_section(group, places, indent)] if lines else _section(group, places, indent)
            group = []
            section = step.section if step else None
        if step is not None:
            group.append(step)
    return lines


def closure(steps: Sequence[Step], names: Iterable[str]) -> tuple[Step, ...]:
    """Those of the steps that lead to the named ones, in their order."""
    needed = set(names)
    kept: list[Step] = []
    for step in reversed(steps):
        if step.name in needed:
            kept.append(step)
            needed |= step.uses()
    return tuple(reversed(kept))


def _section(steps: Sequence[Step], places: Mapping[str, str], indent: str) -> list[str]:
    """A comment with the section's sources and operations, then its statements, each with its formula in words."""
    sources = dict.fromkeys(step.source for step in steps if step.source)
    operations = counts(steps)
    text = steps[0].section + (f" [{operations}]" if operations != "none" else "")
    text += "".join(f". {source}" for source in sources)
    width = WIDTH - 8 - len(indent)
    comment = Comment(f"\n{indent} * ".join(textwrap.wrap(text, width, break_long_words=False)))
    lines = (indent + str(KernelPrinter(places, False)._print(comment))).split("\n")
    return lines + [line for step in steps for line in statement(step, places, indent)]


def statement(step: Step, places: Mapping[str, str], indent: str = INDENT) -> list[str]:
    """The declaration of one step, with its formula in words beside or above it."""
    printer = KernelPrinter(places, step.format == "float32")
    variable = Variable(symbol(step.name), type=C_TYPES[step.format], attrs={value_const})
    text = printer._print(Declaration(variable.as_Declaration(value=step.value).variable)) + ";"
    lines = wrap(text, indent)
    if not step.meaning:
        return lines
    if len(lines) == 1 and len(lines[0]) + len(step.meaning) + 9 <= WIDTH:
        return [f"{lines[0]}   /* {step.meaning} */"]
    first, *rest = textwrap.wrap(step.meaning, WIDTH - 8 - len(indent), break_long_words=False)
    comment = [f"{indent}/* {first}", *(f"{indent} * {line}" for line in rest)]
    return [*comment[:-1], comment[-1] + " */", *lines]


def declared(fields: Iterable[tuple[str, str]]) -> list[str]:
    """Fields of a structure, those of one type together."""
    groups: dict[str, list[str]] = {}
    for kind, name in fields:
        groups.setdefault(kind, []).append(name)
    lines: list[str] = []
    for kind, names in groups.items():
        lines += textwrap.wrap(
            f"{kind} {', '.join(names)};", WIDTH, initial_indent="    ", subsequent_indent="        "
        )
    return lines


def wrap(text: str, indent: str, continuation: str | None = None) -> list[str]:
    """A C statement in lines of at most 120 characters, broken before an operator at the outermost level it can be."""
    line = indent + text
    if len(line) <= WIDTH:
        return [line]
    breaks: list[tuple[int, int]] = []
    depth = 0
    for match in re.finditer(r"[()]|(?<= )[-+?:*/](?= )|(?<=, )", line):
        token = match.group()
        if token == "(":
            depth += 1
        elif token == ")":
            depth -= 1
        elif match.start() < WIDTH:
            breaks.append((depth, match.start()))
    assert breaks, f"no place to break {text!r}"
    shallowest = min(depth for depth, _ in breaks)
    at = max(place for depth, place in breaks if depth == shallowest)
    if at < WIDTH // 3:
        at = max(place for _, place in breaks)
    hanging = continuation or indent + INDENT
    return [line[:at].rstrip(), *wrap(line[at:], hanging, hanging)]
