"""An explanation -> a LaTeX document that pdflatex compiles as it is: article class, amsmath, no other package.

Comes in: formulas that sympy has set, and words as plain text. Never done here: mathematics.
"""

from __future__ import annotations

from collections.abc import Iterator

from symrender_cg.explain import Explanation, Quantity, SceneExplanation
from symrender_cg.plan.plan import Decision

_ESCAPES = {
    "\\": r"\textbackslash{}",
    "^": r"\^{}",
    "~": r"\~{}",
    "|": r"\textbar{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    **{letter: f"\\{letter}" for letter in "#$%&_{}"},
}

_PREAMBLE = r"""\documentclass{article}
\usepackage[a4paper,landscape,margin=18mm]{geometry}
\usepackage[T1]{fontenc}
\usepackage{amsmath}
\setlength{\parindent}{0pt}
\allowdisplaybreaks
\begin{document}
"""


def document(found: Explanation | SceneExplanation) -> str:
    """The text of the document."""
    body = _body(found) if isinstance(found, Explanation) else _scene_body(found)
    return _PREAMBLE + "\n".join(body) + "\n\\end{document}\n"


def escaped(text: str) -> str:
    """Plain text as LaTeX: every letter with a meaning to TeX is set as itself."""
    return "".join(_ESCAPES.get(letter, letter) for letter in text)


def _body(found: Explanation) -> Iterator[str]:
    yield rf"\section*{{{escaped(found.kernel)}}}"
    yield f"Accuracy ``{escaped(found.accuracy)}''; promise: {escaped(found.promise)}."
    yield from _plan(found.decisions)
    yield r"\subsection*{Inputs, in the camera's frame}"
    yield r"\begin{tabular}{lrl}"
    for _, latex, meaning, value in found.inputs:
        yield rf"${latex}$ & {value:.17g} & {escaped(meaning)} \\"
    yield r"\end{tabular}"
    yield r"\subsection*{The textbook's derivation}"
    yield from _quantities(found.textbook)
    shown = {q.name: q.latex_name for q in found.textbook}
    relations = [(shown[g], r"\ge" if g == "disc" else ">") for g in found.guard]
    guards = " and ".join(f"${name} {relation} 0$" for name, relation in relations)
    yield f"The ray hits where {guards}; elsewhere the background is seen."
    yield rf"\subsection*{{The forms that ``{escaped(found.accuracy)}'' uses}}"
    yield r"\begin{description}"
    for entry in found.forms:
        yield rf"\item[{escaped(entry.name)}] removes {escaped(entry.removes)}. {escaped(entry.source)}"
    yield r"\end{description}"
    yield from _quantities(found.chosen)
    yield r"\subsection*{Proved by sympy, exactly}"
    yield r"\begin{description}"
    for invariant in found.invariants:
        word = "proved" if invariant.holds else "NOT PROVED"
        yield rf"\item[{escaped(invariant.name)}, {word}:] {escaped(invariant.statement)}."
    yield r"\end{description}"
    yield r"\subsection*{Silhouette}"
    a, b, c, d, e, f = (f"({_number(value)})" for value in found.silhouette.coefficients)
    yield rf"\[ {a} x^2 + {b} x y + {c} y^2 + {d} x + {e} y + {f} = 0 \]"
    yield rf"which is a conic: {escaped(found.silhouette.kind)}."
    if found.silhouette.rho is not None:
        rho = _number(found.silhouette.rho)
        yield rf"\[ x^2 + y^2 = \frac{{e^2 R^2}}{{e^2 - R^2}} = \rho^2, \qquad \rho = {rho} \]"


def _scene_body(found: SceneExplanation) -> Iterator[str]:
    yield rf"\section*{{{escaped(found.kernel)}}}"
    yield f"Accuracy ``{escaped(found.accuracy)}''; promise: {escaped(found.promise)}."
    yield from _plan(found.decisions)
    for part in found.parts:
        yield rf"\subsection*{{{escaped(part.name)}: {escaped(part.meaning)}}}"
        total = ", ".join(f"{sum(counts.values())} a {rate}" for rate, counts in part.operations.items())
        yield f"Operations: {escaped(total or 'none')}."
        yield from _quantities(part.quantities)


def _plan(decisions: tuple[Decision, ...]) -> Iterator[str]:
    yield r"\subsection*{Plan: which effects can change this image}"
    yield r"\begin{description}"
    for decision in decisions:
        word = {"needed": "in", "absent": "out", "bounded": "bounded"}[decision.status]
        yield rf"\item[{word}: {escaped(decision.effect.title)}] {escaped(decision.reason)}."
    yield r"\end{description}"


def _quantities(quantities: tuple[Quantity, ...]) -> Iterator[str]:
    section = ""
    for quantity in quantities:
        if quantity.section != section:
            section = quantity.section
            yield rf"\paragraph{{{escaped(section)}}}"
        said = ". ".join(filter(None, (quantity.meaning, quantity.source)))
        if said:
            yield rf"\par {escaped(said)}"
        yield rf"\[ {quantity.latex_name} = {quantity.latex} \]"


def _number(value: float) -> str:
    mantissa, mark, exponent = f"{value:.10g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if mark else mantissa.replace("inf", r"\infty")
