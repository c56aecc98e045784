"""The stages of a pixel as C functions: each takes what it needs from a block of values, and leaves what others need.

Comes in: a KernelProgram that fission.py has cut, and where the names of the frame and the row live. Goes out: for each
stage its parameters, its lines and what it leaves, for templates/kernel.c.j2 to place. Never done here: a cut.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from symrender_cg.emit.bodies import INDENT, WIDTH, body, counts, declared, wrap
from symrender_cg.emit.printer import C_TYPES
from symrender_cg.lower.anchors import anchoring
from symrender_cg.lower.fission import crossing
from symrender_cg.lower.formats import WIDE
from symrender_cg.lower.nodes import Select, walk
from symrender_cg.lower.program import KernelProgram, Shortcut, Step
from symrender_cg.lower.symmetry import parities


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage in C.

    mirrored   it is the same for x and -x
    twin       and for y and -y, too
    sided      it reads what is odd in x, with the sign of `side`
    takes      which of x, place, row and frame it reads
    replaced   the shortcut of the program computes what it leaves, where it may
    """

    number: int
    mirrored: bool
    twin: bool
    sided: bool
    takes: frozenset[str]
    told: tuple[str, ...]
    lines: tuple[str, ...]
    replaced: bool = False

    def parameters(self, real: str) -> str:
        """The parameters of the C function."""
        kinds = {"x": "double x", "place": "place p", "side": f"{real} side"}
        kinds |= {"row": "const row *r", "frame": "const frame *f"}
        return ", ".join([*(kinds[name] for name in kinds if name in self._named), "block *b", "int i"])

    def call(self, **given: str) -> str:
        """A call of it, its arguments by the words of `takes`, `side` and `block`."""
        order = ("x", "place", "side", "row", "frame")
        arguments = [*(given[name] for name in order if name in self._named), given["block"], "i"]
        return f"stage_{self.number}({', '.join(arguments)})"

    @property
    def _named(self) -> frozenset[str]:
        return self.takes | ({"side"} if self.sided else set())


@dataclass(frozen=True, slots=True)
class Place:
    """Where a pixel lies in its row: the names of its numbers, and the lines that compute them from x.

    counted    the same numbers for a pixel between the `first` hit of a row and the `last`
    reads      which of row and frame the lines read
    """

    names: tuple[str, ...]
    lines: tuple[str, ...]
    counted: tuple[str, ...]
    reads: frozenset[str]


@dataclass(frozen=True, slots=True)
class Stages:
    """All stages of a kernel, and the arrays of the block between them, a type at a time."""

    each: tuple[Stage, ...]
    arrays: tuple[str, ...]
    shortcut: Shortcut | None = None
    wide: frozenset[str] = frozenset()
    place: Place | None = None

    def shortcut_call(self, block: str, frame: str, count: str, indent: str) -> str:
        """The call that computes a step for a block, its later lines indented."""
        assert self.shortcut is not None, "there is one"
        cut = self.shortcut
        held = ", ".join(f"{block}{word}" for name in cut.held for word in words(name, name in self.wide))
        lines = wrap(f"{cut.function}({held}, {frame}{cut.when}, {count});", indent[: -len(INDENT)], indent)
        return "\n".join(lines).strip().removesuffix(";")

    @property
    def mirrored(self) -> tuple[Stage, ...]:
        """Those that are the same for x and -x."""
        return tuple(stage for stage in self.each if stage.mirrored)

    @property
    def twins(self) -> tuple[Stage, ...]:
        """Those of them that are the same for y and -y."""
        return tuple(stage for stage in self.each if stage.twin)

    @property
    def others(self) -> tuple[Stage, ...]:
        """Those that are not."""
        return tuple(stage for stage in self.each if not stage.mirrored)

    @property
    def sided(self) -> bool:
        """Whether any of them reads the side."""
        return any(stage.sided for stage in self.each)

    def reads(self, stages: Sequence[Stage], name: str) -> bool:
        """Whether one of those stages takes the row, or the frame."""
        return any(name in stage.takes for stage in stages)


def stages_of(program: KernelProgram, frame: Mapping[str, str], places: Mapping[str, str]) -> Stages | None:
    """The stages of a program, None where it has none; `frame` and `places` as for KernelPrinter, for all but a pixel's
    own steps."""
    if not program.stages:
        return None
    parity = parities(program) if program.mirrored else {}
    later = {used for stage in program.stages[1:] for name in stage for used in program[name].uses()}
    crossed = list(crossing(program))
    crossed[-1] = (*crossed[-1], program.result)
    if program.shortcut is not None:
        for number, names in enumerate(program.stages):
            held = (program.shortcut.source, program.shortcut.room)
            crossed[number] += tuple(name for name in held if name in names and name not in crossed[number])
    given = ("x", *(name for name, _ in program.anchors))
    crossed[0] = (*(name for name in given if name in later), *crossed[0])
    formats = {step.name: step.format for step in program.steps} | {"x": "float64"}
    wide = frozenset(name for names in crossed for name in names if formats[name] in WIDE)
    judged = [tuple(name for name in program.judged if name in names) for names in program.stages]
    leaves = [(*names, *(n for n in more if n not in names)) for names, more in zip(crossed, judged, strict=True)]
    carried = [word for names in leaves for name in names for word in words(name, name in wide)]
    places = {**places, **dict.fromkeys(given[1:], "p.")}
    done: set[str] = set()
    found: list[Stage] = []
    for number, (names, left) in enumerate(zip(program.stages, leaves, strict=True), 1):
        steps = tuple(program[name] for name in names)
        shared = (number <= program.mirrored) + (number <= program.twins)
        side = {} if shared else parity
        found.append(_stage(number, steps, left, done, side, places, formats, frame, shared, wide))
        done |= set(left)
    kinds = {name: "double" if form in WIDE else str(C_TYPES[form].name) for name, form in formats.items()}
    arrays = declared((kinds[name.removesuffix(_LOW)], f"{name}[POINTS]") for name in dict.fromkeys(carried))
    replaced = program.shortcut.stages if program.shortcut else ()
    each = tuple(replace(stage, replaced=stage.number - 1 in replaced) for stage in found)
    return Stages(each, tuple(arrays), program.shortcut, wide, _place_of(program, places))


def _place_of(program: KernelProgram, places: Mapping[str, str]) -> Place | None:
    """What the anchors of a program are in C, None where it has none."""
    if not program.anchors:
        return None
    steps = anchoring(program)
    own = dict.fromkeys((step.name for step in steps), "")
    uses = {name for step in steps for name in step.uses()} - own.keys()
    reads = {word for word, place in (("row", "r->"), ("frame", "f->")) if place in {places.get(n) for n in uses}}
    ways = {"first": "from_first", "middle": "aside", "last": "to_last"}
    counted = tuple(f".{name} = h->{where}.{name} + {ways[where]}," for name, where in program.anchors)
    names = tuple(name for name, _ in program.anchors)
    return Place(names, tuple(body(steps, {**places, **own})), counted, frozenset(reads))


_LOW = "_lo"


def words(name: str, wide: bool) -> tuple[str, ...]:
    """The arrays of a quantity in a block: the high and the low words apart."""
    return (name, name + _LOW) if wide else (name,)


def _chosen(step: Step) -> set[str]:
    """Names that a step chooses from."""
    selects = [node for node in walk(step.value) if isinstance(node, Select)]
    return {branch.name for node in selects for branch in node.args[1:] if branch.is_Symbol}


def _stage(
    number: int,
    steps: Sequence[Step],
    left: Sequence[str],
    done: set[str],
    parity: Mapping[str, str],
    places: Mapping[str, str],
    formats: Mapping[str, str],
    frame: Mapping[str, str],
    shared: int,
    wide: frozenset[str],
) -> Stage:
    own = {step.name for step in steps}
    uses = {name for step in steps for name in step.uses()} - own
    from_block = sorted(uses & done, key=list(formats).index)
    odd = [name for name in from_block if parity.get(name) == "odd"]
    pairs = [name for name in from_block if name in wide]
    here = dict(places) | {name: "b->{}[i]" for name in from_block if name not in odd} | dict.fromkeys(own, "")
    lines = []
    for name in dict.fromkeys((*odd, *pairs)):
        told = [f"{'side * ' if name in odd else ''}b->{word}[i]" for word in words(name, name in wide)]
        value = f"{{{', '.join(told)}}}" if name in wide else told[0]
        lines.append(f"{INDENT}const {C_TYPES[formats[name]].name} {name} = {value};")
    chosen = sorted({name for step in steps for name in _chosen(step)} - own)
    read = {name: f"b->{name}[i]" for name in chosen if name in from_block and name not in odd}
    read |= {name: f"f->{name}" for name in chosen if frame.get(name) == "f->" and name in formats}
    here |= dict.fromkeys(read, "")  # read before they are chosen from: a read under a condition stops vectorisation
    lines += [f"{INDENT}const {C_TYPES[formats[name]].name} {name} = {place};" for name, place in read.items()]
    lines += [""] if lines else []
    lines += body(steps, here | dict.fromkeys((*odd, *pairs), ""))
    lines.append("")
    for name in left:
        from_place = places.get(name) == "p."
        parts = (f"{name}.hi", f"{name}.lo") if formats[name] in WIDE else (f"p.{name}" if from_place else name,)
        arrays = words(name, name in wide)
        lines += [f"{INDENT}b->{word}[i] = {part};" for word, part in zip(arrays, parts, strict=False)]
    takes = {"x"} if "x" in uses - done else set()
    takes |= {"place"} if any(places.get(name) == "p." for name in (uses - done) | set(left)) else set()
    takes |= {"row"} if any(place == "r->" for name, place in places.items() if name in uses) else set()
    takes |= {"frame"} if any(place == "f->" for name, place in frame.items() if name in uses) else set()
    sections = ", ".join(dict.fromkeys(step.section for step in steps))
    same = ("", ", the same for x and -x", ", the same for x and -x, y and -y")[shared]
    heading = f"Stage {number}{same}: {sections} [{counts(steps)}]."
    told_lines = textwrap.wrap(f"{heading} Leaves {', '.join(left)}.", WIDTH - 6, break_long_words=False)
    return Stage(number, shared > 0, shared > 1, bool(odd), frozenset(takes), tuple(told_lines), tuple(lines))
