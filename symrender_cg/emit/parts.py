"""The bodies of the functions of a scene's kernel, part by part: what templates/scene.c.j2 places in its loops.

Comes in: parts lowered to `KernelProgram`s. Goes out: lines of C, the fields of the structures that carry a quantity
from the rate at which it is computed to the faster one where it is used. Never done here: a formula.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from symrender_cg.emit.bodies import INDENT, body, closure, declared
from symrender_cg.emit.printer import C_TYPES
from symrender_cg.lower.program import KernelProgram, Rate

_LOOP = 2 * INDENT
_CARRIERS: Mapping[Rate, str] = {"frame": "f", "sphere": "ball", "row": "r"}


@dataclass(frozen=True, slots=True)
class Carried:
    """A structure with what is computed at one rate and used at a faster one, and the function that fills it."""

    declarations: tuple[str, ...]
    lines: tuple[str, ...]
    names: tuple[str, ...]


class PrimaryBodies:
    """A part that takes the eye's ray: structures for frame, sphere and row, and bodies for what a pixel needs.

    The two ends of a row's span are a row's too, but have a function of their own.
    """

    def __init__(self, program: KernelProgram, stored: Sequence[str]) -> None:
        self.program = program
        self.name = program.name
        self.format = {step.name: step.format for step in program.steps}
        rates = program.input_rates()
        self.inputs: dict[str, Rate] = {
            name: "sphere" if rates.get(name, 0) == 1 else "frame" for name in program.inputs
        }
        self.has_sphere = "sphere" in self.inputs.values()
        self.frame = self._carried("frame")
        self.sphere = self._carried("sphere")
        self.row = self._carried("row")
        self.stored = tuple(name for name in stored if name in program)
        self.surface = self.pixel(self.stored, _LOOP)

    def pixel(self, names: Iterable[str], indent: str = INDENT) -> list[str]:
        """The statements at the rate of a pixel that lead to the named quantities."""
        return body(closure(self.program.at("pixel"), names), self._places("pixel"), indent)

    @property
    def ends(self) -> list[str]:
        """The statements at the rate of a row that lead to the ends of its span."""
        return body(closure(self.program.at("row"), self.program.ends or ()), self._places("row"))

    def sight(self) -> list[str]:
        """The statements that tell how surely a ray hits."""
        names = ("facing2", "d_dot_d", "before_eye")
        return self.pixel([name for name in names if name in self.program])

    def word(self, name: str) -> str:
        """A pixel's quantity as one floating-point number: the high word of a double-double."""
        return f"{name}.hi" if self.format[name] == "double_double" else name

    def carried_word(self, name: str) -> str:
        """The same where a pixel's statements stand: by its carrier if it changes more slowly."""
        rate = self.program[name].rate
        return self.word(name) if rate == "pixel" else f"{_CARRIERS[rate]}->{self.word(name)}"

    def _carried(self, rate: Rate) -> Carried:
        steps = self.program.at(rate)
        faster = [step for r in _faster(rate) for step in self.program.at(r)]
        used = {name for step in faster for name in step.uses()} | set(self.program.outputs)
        fields = [(str(C_TYPES[step.format].name), step.name) for step in steps if step.name in used]
        fields += [("double", name) for name, of in self.inputs.items() if of == rate and name in used]
        if rate == "row" and any("y" in step.uses() for step in self.program.at("pixel")):
            fields.insert(0, ("double", "y"))
        shown = [(kind, name.removeprefix("scene_")) for kind, name in fields]
        places = self._places(rate)
        ends = self.program.ends or ()
        if rate == "row":
            steps = closure([step for step in steps if step.name not in ends], used)
            places |= dict.fromkeys(ends, "ends.")
        inits = tuple(
            f".{name.removeprefix('scene_')} = {places[name].replace('{}', name.removeprefix('scene_'))}"
            if name in self.inputs
            else f".{name} = {places.get(name, '')}{name}"
            for _, name in fields
        )
        return Carried(tuple(declared(shown)), tuple(body(steps, places)), inits)

    def _places(self, rate: Rate) -> dict[str, str]:
        """Where each name lives for the statements of a rate."""
        places = {
            name: ("scene->{}[k]" if of == "sphere" else "scene->{}") if of == rate else f"{_CARRIERS[of]}->{{}}"
            for name, of in self.inputs.items()
            if of == rate or of in _slower(rate)
        }
        for slower in _slower(rate):
            places |= {step.name: f"{_CARRIERS[slower]}->" for step in self.program.at(slower)}
        if rate == "pixel":
            places["y"] = "r->"
        return places


def _slower(rate: Rate) -> tuple[Rate, ...]:
    order: tuple[Rate, ...] = ("frame", "sphere", "row", "pixel")
    return order[: order.index(rate)]


def _faster(rate: Rate) -> tuple[Rate, ...]:
    order: tuple[Rate, ...] = ("frame", "sphere", "row", "pixel")
    return order[order.index(rate) + 1 :]
