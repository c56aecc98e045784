"""Operations of a pixel, counted from the lowered program: its steps, and the bodies of the functions that they call.

Comes in: a Translation. Goes out: Work: operations by format and kind, bytes written. Never done here: a guess; a
function that is called and whose text is not among the kernel's files is an error.

A function of a support header is counted in its C text: binary + - * / between values that are no integers, a
condition ? a : b as one select with its comparison, sqrt, fma, and what it calls in turn.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from symrender_cg.errors import ArgumentError
from symrender_cg.lower.nodes import Call, walk
from symrender_cg.lower.program import operations_of
from symrender_cg.pipeline import SphereTranslation

KINDS: Final = ("mul", "add", "select", "div", "sqrt", "fma", "int")
"""select: also a maximum; int: bit operations and whole-number additions of the powers' functions."""

LOOP: Final = Counter({"add": 1, "mul": 1, "select": 1})
"""float64 operations of the loop around a pixel: x = (i + left) step, and the cut at white."""

_FUNCTION = re.compile(
    r"^(?:static inline|SYMRENDER_INLINE)\s+(?:[\w ]+?[ *])(\w+)\(([^)]*)\)\s*\{\n(.*?)^\}", re.MULTILINE | re.DOTALL
)
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_BINARY = re.compile(r"(?<=[\w)\]]) ([-+*/]) (?=[\w(-])")
_COMPOUND = re.compile(r"(?<=[\w)\]]) ([-+*/])= ")
_CALL = re.compile(r"\b(\w+)\(")
_WHOLE = re.compile(r"^\s*(?:const )?(?:u?int\d+_t|int|unsigned)\b")
_KIND: Final = {"max": "select"}
_CALLS: Final = ("call", "ops")
_NAMES: Final = {"+": "add", "-": "add", "*": "mul", "/": "div"}
_LANGUAGE: Final = frozenset(
    {"memcpy", "sizeof", "if", "for", "while", "return", "UINT64_C", "UINT32_C", "fabs", "fabsf"}
)


@dataclass(frozen=True, slots=True)
class Work:
    """What a kernel does for one pixel of the sphere and stores for any.

    operations   (format, kind) -> how many, calls taken apart; what the pixels at x and -x share counts half for each
    bytes        stored, for a pixel of the sphere or of the background
    everywhere   whether pixels of the background are computed like the others
    """

    operations: Mapping[tuple[str, str], float]
    bytes: int
    everywhere: bool

    def flops(self) -> float:
        """Floating-point operations of a pixel, an fma as two; selects and bit operations are none."""
        weight = {"mul": 1, "add": 1, "div": 1, "sqrt": 1, "fma": 2}
        return sum(weight.get(kind, 0) * count for (_, kind), count in self.operations.items())


def work_of(translation: SphereTranslation) -> Work:
    """The work of the kernel of one sphere. Raises ArgumentError for a call whose function is nowhere."""
    functions = functions_of(translation.emitted.files)
    program = translation.program
    share = {name: 0.5 for stage in program.stages[: program.mirrored] for name in stage}
    share |= {name: 0.25 for stage in program.stages[: program.twins] for name in stage}
    total: dict[tuple[str, str], float] = {("float64", kind): float(count) for kind, count in LOOP.items()}
    for step in program.at("pixel"):
        counts: Counter[str] = Counter()
        for kind, count in operations_of(step).items():
            if kind not in _CALLS:
                counts[_KIND.get(kind, kind)] += count
        for node in walk(step.value):
            if isinstance(node, Call):
                counts += operations_in(node.function, functions)
        for kind, count in counts.items():
            key = step.format, kind
            total[key] = total.get(key, 0.0) + share.get(step.name, 1.0) * count
    size = 4 if translation.emitted.result_type == "float" else 8
    return Work(total, size, program.ends is None)


def functions_of(files: Mapping[str, str]) -> dict[str, str]:
    """The bodies of the inline functions in some C texts, by name, without comments."""
    texts = (_COMMENT.sub("", text) for name, text in sorted(files.items()))
    return {match[1]: match[3] for text in texts for match in _FUNCTION.finditer(text)}


def operations_in(name: str, functions: Mapping[str, str]) -> Counter[str]:
    """Operations of a call of a function, by kind. Raises ArgumentError where it, or one that it calls, is unknown."""
    if name in ("sqrt", "sqrtf"):
        return Counter({"sqrt": 1})
    if name in ("fma", "fmaf"):
        return Counter({"fma": 1})
    if name not in functions:
        raise ArgumentError(f"function {name!r}: not found among the kernel's files; expected an inline function there")
    total: Counter[str] = Counter()
    for statement in functions[name].split(";"):
        text = " ".join(statement.split())
        whole = _WHOLE.match(text) is not None and "?" not in text
        for operator in (*_BINARY.findall(text), *_COMPOUND.findall(text)):
            total["int" if _WHOLE.match(text) else _NAMES[operator]] += 1
        total["int" if whole else "select"] += text.count(" ? ")
        total["int"] += len(re.findall(r" (?:<<|>>|[&|^]) ", text))
        for called in _CALL.findall(text):
            if called not in _LANGUAGE:
                total += operations_in(called, functions)
    return +total
