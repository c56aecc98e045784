"""The options of every command with their help. Imports nothing but what names accuracies and sizes."""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import ACCURACIES, TARGETS
from symrender_cg.version import VERSION

LARGEST_SIDE = 1 << 24
LAYERS = ("depth", "normal", "index", "background", "ambient", "reflected", "diffuse", "specular")
SCENE_HELP = "a built-in scene's name or a TOML file; Chapter 1's scene if left out (render --list names the others)"

_DESCRIPTION = """\
A scene becomes its image as one formula, the formula readable C99, the C99 a native kernel.

Exit codes: 0 done, 2 usage or scene, 3 outside what a plan covers, 4 a stated bound broken or a certificate that cannot
be given, 5 no compiler or a failed compilation, 130 interrupted."""

_EXAMPLES = """\
examples:
  python -m symrender_cg build                          Chapter 1's kernels as C under generated/, compiled
  python -m symrender_cg render -o sphere.png           its image
  python -m symrender_cg render scene.toml -o out.png --size 800x600
  python -m symrender_cg render -o sphere.png --accuracy certified --target uint8
  python -m symrender_cg explain off_axis               the plan and the derivation
  python -m symrender_cg explain mirrors --ablate       what each effect costs
  python -m symrender_cg check                          the kernels against numpy and the oracle
  python -m symrender_cg stress                         accuracy levels on hard cases
  python -m symrender_cg conditioning -o moved.png      how much half an ulp of the inputs moves each pixel
  python -m symrender_cg cost                           what accuracy costs in time, measured
  python -m symrender_cg doctor                         what this machine has and lacks
"""

_BUILD = """\
Derives the image of a scene, writes its kernel as C99 under DIR, and compiles it into the cache.

    DIR/<kernel>/<kernel>.c, <kernel>.h, manifest.json     DIR/support/*.h

To compile the C yourself, add both folders to the include path. What is up to date is not touched: a second run derives
and compiles nothing. The kernel is the one for any window. A scene of many spheres has no kernel of accuracy literal,
which is the formula of one sphere, and none that is baked: its kernel loops over arrays. Of one sphere, stable and
certified have kernels that bound their own error; of many, both rest on one kernel that encloses intensities."""
_BUILD_EXAMPLES = """\
examples:
  python -m symrender_cg build
  python -m symrender_cg build scene.toml --accuracy double --passes
  python -m symrender_cg build --accuracy double --bake     the scene's numbers folded into the C
  python -m symrender_cg build --accuracy certified --target uint8
  python -m symrender_cg build --max-error 1e-6             the C of the fastest variant that meets it
  python -m symrender_cg build mirrors                      the kernels of a scene of many spheres
"""

_RENDER = """\
Renders a scene to an image file; its extension chooses the format.

    .png   grey, cut to [0, 1]; --bits 8 (default) or 16
           --encoding srgb (default): the transfer curve of IEC 61966-2-1, declared by an sRGB chunk in the file
           --encoding linear: grey levels proportional to intensity, declared by a gAMA chunk of 1.0
    .npy   the array of linear intensities, float64 (float32 with --accuracy fast or single)
    .npz   the same under the name `image`, with every layer that --layers names
    .pfm   linear intensities as float32, little endian, rows from bottom to top

A scene with a colour anywhere is written as RGB. --layers writes what else the kernel knows of each pixel beside the
image, out-depth.png, out-normal.png, ...:

    depth    distance from the eye; as a .png near is white, far is dark, the background black
    normal   in the camera's frame; as a .png (n + 1) / 2
    index    which sphere, then the plane; as a .png a colour each
    terms    background, ambient, diffuse and specular of each light, reflected: they add up to the image

--accuracy stable proves every value to be within 4 ulp, certified proves each to be the nearest float64, float32 or
grey level, whichever --target names; both print how many pixels each stage settled. Grey levels are written as they
are: a .png of them is 8 bit linear. Where a tie cannot be decided the pixels are named, exit code 4, and nothing is
written.

Every file is written whole or not at all."""
_RENDER_EXAMPLES = """\
examples:
  python -m symrender_cg render -o sphere.png
  python -m symrender_cg render scene.toml -o out.png --size 1920x1080 --bits 16 --encoding linear
  python -m symrender_cg render off_axis -o field.npy --no-clip
  python -m symrender_cg render -o levels.png --accuracy certified --target uint8
  python -m symrender_cg render mirrors -o out.png --layers depth,normal,index,terms
  python -m symrender_cg render --list
"""

_EXPLAIN = """\
Prints what a kernel rests on: the effects that are in and the proof of each one left out, every named quantity with its
formula and source, the forms that the accuracy chose, the number format of each quantity, the invariants that sympy
proved, the silhouette, and operations per stage; of stable and certified also the stages that prove a value, with the
bound of their kernel for an image of --size. Of a scene of many spheres: the plan, what the kernel loops over, and the
parts that its loops are made of.

The plan is that of an image of the shape --size; what is outside such a window is left out.

--findings EFFECT   what was found for each sphere, pair or triple, with inequality, numbers and margin
--max-error E       leave out also what changes no pixel by more than E in all; such effects are called bounded
--ablate            measure: each effect left out is forced in again (no pixel may change: exit code 4) and timed; each
                    effect kept is taken out of the scene, where it can be"""
_EXPLAIN_EXAMPLES = """\
examples:
  python -m symrender_cg explain
  python -m symrender_cg explain off_axis --accuracy single
  python -m symrender_cg explain --accuracy certified --target uint8
  python -m symrender_cg explain mirrors --findings shadow
  python -m symrender_cg explain mirrors --ablate --size 512x512
  python -m symrender_cg explain --latex > derivation.tex     a document that pdflatex compiles as it is
"""

_CHECK = """\
Compares each compiled kernel with the oracle (exact arithmetic and Arb balls, correctly rounded), with vectorised numpy
and with the per-pixel loop: on the pixel centres of a whole image, and on points near the silhouette, the terminator
and the highlight; of a scene of many spheres with brute force in numpy, and on points near outlines, mirrored outlines
and shadows. Errors are those of the unclipped field; certified is compared as float64. Exit code 4 when a stated bound
is broken, or another surface is seen than the oracle's."""
_CHECK_EXAMPLES = """\
examples:
  python -m symrender_cg check
  python -m symrender_cg check far --accuracy literal,double --points 5000
  python -m symrender_cg check --json > check.json
"""

_STRESS = """\
Measures accuracy levels on families of hard cases, each drawn from a seed and compared with the oracle: outlines to the
last float, eyes and lights on the surface or 1e300 away, exponents to 1e300, edges of shadows, mirrors and tiles. With
SCENE that scene's own hard points: outlines, terminators, highlights, edges. Errors are those of the unclipped field.

Exit code 4 when a level breaks what it states; the statements, family and case are printed below the table."""
_STRESS_EXAMPLES = """\
examples:
  python -m symrender_cg stress
  python -m symrender_cg stress --family terminator --family rdv0 --level double --count 2000
  python -m symrender_cg stress mirrors --level double
  python -m symrender_cg stress --seed 7 --keep worst.json
  python -m symrender_cg stress --atlas atlas.png
"""

_CONDITIONING = """\
How much half an ulp of every input (each number of the scene in the camera's frame, and the point) moves each pixel,
in first order: what no kernel can be blamed for. A pixel flips where such a move takes a decision over its border: an
outline, the edge of a shadow or a tile, the nearer of two surfaces. Prints one line of figures of the pixels that show
a surface; with -o also draws a picture, colours on a log scale, flips marked."""
_CONDITIONING_EXAMPLES = """\
examples:
  python -m symrender_cg conditioning
  python -m symrender_cg conditioning mirrors -o moved.png --size 320x180
  python -m symrender_cg conditioning far_small --json
"""

_COST = """\
Measures what accuracy costs in time: every level, choices beside the levels that a search finds, kernels with the
scene's numbers baked in, plans that leave out more or less, numpy, sympy's lambdify, four rays a pixel. Times are
interleaved in one run on one thread; errors are those of the unclipped field against the oracle, at points that the
search did not use. Printed are the front (nothing is both faster and more accurate), what each step along it buys, what
dominates the rest, and when a special kernel has paid for its build. Kept by scene and machine.

--max-error, --max-ulp, --bits   which variant render_image would draw with, and what it was chosen from; exit code 4
                                 where none meets it"""
_COST_EXAMPLES = """\
examples:
  python -m symrender_cg cost
  python -m symrender_cg cost mirrors --plot cost.png --html cost.html
  python -m symrender_cg cost hundred --quick --effects
  python -m symrender_cg cost --max-error 1e-6
"""

_DOCTOR = """\
Says what this machine has: compiler, flags and target as resolved, the vector width in the kernels' inner loops (from
the compiler's own report), the cache, Python packages; and how to get what is missing. Exit code 5 without a compiler
that works."""
_DOCTOR_EXAMPLES = """\
examples:
  python -m symrender_cg doctor
  python -m symrender_cg doctor --vectors generated/centred_sphere_double/centred_sphere_double.c
  python -m symrender_cg doctor --clear-cache
"""


class Parser(argparse.ArgumentParser):
    """argparse, with usage errors in the form of all others."""

    def error(self, message: str) -> NoReturn:
        """Prints what is wrong and where help is, and exits with 2."""
        print(f"symrender_cg: error: {message}\n{self.format_usage().rstrip()}", file=sys.stderr)
        print(f"try: python -m {self.prog} --help", file=sys.stderr)
        raise SystemExit(ArgumentError.exit_code)


def build_parser() -> Parser:
    """The parser of the whole command line; `command` is the module of symrender_cg.cli that runs."""
    parser = Parser(
        prog="symrender_cg",
        description=_DESCRIPTION,
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"symrender_cg {VERSION}")
    parser.add_argument("--debug", action="store_true", help="traceback and log of an error; also SYMRENDER_DEBUG=1")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)
    _add_build(commands)
    _add_render(commands)
    _add_explain(commands)
    _add_check(commands)
    _add_stress(commands)
    _add_conditioning(commands)
    _add_cost(commands)
    _add_doctor(commands)
    return parser


def _command(commands: argparse._SubParsersAction[Parser], name: str, short: str, text: str, examples: str) -> Parser:
    parser = commands.add_parser(
        name,
        help=short,
        description=text,
        epilog=examples,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--debug", action="store_true", default=argparse.SUPPRESS, help="traceback and log of an error")
    return parser


def _add_build(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "build", "derive, write the C, compile", _BUILD, _BUILD_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    _accuracies(parser, "all")
    _target(parser)
    parser.add_argument("--bake", action="store_true", help="fold the scene's numbers into the kernel (one sphere)")
    _portable(parser)
    parser.add_argument("--out", default="generated", metavar="DIR", help="folder for the C (default: generated)")
    parser.add_argument(
        "--passes", action="store_true", help="derive anew, and show every pass (or part) of the lowering"
    )
    _request(parser)


def _add_render(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "render", "render a scene to .png, .npy, .npz or .pfm", _RENDER, _RENDER_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    parser.add_argument("-o", "--output", metavar="FILE", help="the image file: .png, .npy, .npz or .pfm")
    _size(parser, (512, 512))
    _accuracy(parser)
    _target(parser)
    parser.add_argument("--threads", type=int, metavar="N", help="threads (default: by size; any number, same bits)")
    parser.add_argument("--bits", type=int, choices=(8, 16), help="of a .png (default: 8)")
    parser.add_argument("--encoding", choices=("srgb", "linear"), help="of a .png (default: srgb)")
    parser.add_argument("--no-clip", action="store_true", help="keep intensities above 1; not in a .png")
    parser.add_argument(
        "--layers",
        type=layer_list,
        default=(),
        metavar="L[,L]",
        help=f"some of {', '.join(LAYERS)}, terms (the last five), all; with commas",
    )
    _portable(parser)
    parser.add_argument(
        "--backend", choices=("native", "numpy"), default="native", help="numpy needs no compiler and is slower"
    )
    _request(parser, bits=False)
    parser.add_argument("--list", action="store_true", help="list the built-in scenes and exit")


def _add_explain(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "explain", "the plan, the derivation, the proofs", _EXPLAIN, _EXPLAIN_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    _accuracy(parser)
    _target(parser)
    forms = parser.add_mutually_exclusive_group()
    forms.add_argument("--latex", action="store_true", help="a whole LaTeX document (article class, amsmath)")
    forms.add_argument("--json", action="store_true", help="everything as one JSON object")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--findings", metavar="EFFECT", help="what was found for each subject of an effect")
    what.add_argument("--ablate", action="store_true", help="measure what each effect costs and changes")
    parser.add_argument(
        "--max-error", type=tolerance, default=0.0, metavar="E", help="how much any pixel may change (default: 0)"
    )
    parser.add_argument(
        "--meets",
        type=request,
        metavar="R=V",
        help="max_error=1e-6, max_ulp=4 or bits=8: the variant that meets it on this machine, in place of --accuracy",
    )
    _size(parser, (256, 256))


def _add_check(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "check", "compare the kernels with references and oracle", _CHECK, _CHECK_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    _size(parser, (96, 96))
    parser.add_argument(
        "--points", type=_count, default=1000, metavar="N", help="points near each hard place (default: 1000)"
    )
    parser.add_argument("--seed", type=_count, default=1, metavar="N", help="of those points (default: 1)")
    _accuracies(parser, "all")
    _portable(parser)
    parser.add_argument("--json", action="store_true", help="the table as one JSON object")


def _add_stress(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "stress", "accuracy levels on hard cases", _STRESS, _STRESS_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="a scene whose own hard points are meant")
    parser.add_argument("--level", action="append", default=[], metavar="LEVEL", help="once or more; all if left out")
    parser.add_argument("--family", action="append", default=[], metavar="NAME", help="once or more; all if left out")
    parser.add_argument(
        "--count", type=_count_from_one, default=200, metavar="N", help="cases a family, or points a set (default: 200)"
    )
    parser.add_argument("--seed", type=_count, default=1, metavar="N", help="of the cases (default: 1)")
    parser.add_argument("--json", action="store_true", help="the table as one JSON object")
    parser.add_argument("--keep", metavar="FILE", help="add the worst point of each row to FILE")
    parser.add_argument("--atlas", metavar="FILE", help="draw where each level breaks instead: .png, .svg or .pdf")


def _add_conditioning(commands: argparse._SubParsersAction[Parser]) -> None:
    short = "how much the inputs' last digits move each pixel"
    parser = _command(commands, "conditioning", short, _CONDITIONING, _CONDITIONING_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    parser.add_argument("-o", "--output", metavar="FILE", help="the picture: .png, .svg or .pdf (needs matplotlib)")
    _size(parser, (256, 256))
    parser.add_argument("--absolute", action="store_true", help="absolute moves in the picture, not ulp of the pixel")
    parser.add_argument("--json", action="store_true", help="the figures as one JSON object")


def _add_cost(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "cost", "what accuracy costs in time", _COST, _COST_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    _size(parser, (256, 256))
    parser.add_argument(
        "--rounds", type=_count_from_one, metavar="N", help="interleaved rounds (default: 15; quick: 7)"
    )
    parser.add_argument("--seed", type=_count, default=1, metavar="N", help="of points and rounds (default: 1)")
    parser.add_argument("--quick", action="store_true", help="no search, fewer rounds and points")
    parser.add_argument("--again", action="store_true", help="measure anew what was measured before")
    parser.add_argument("--all", action="store_true", help="every choice that was tried, also where it is dominated")
    parser.add_argument("--effects", action="store_true", help="the scene's time with one effect after the other")
    parser.add_argument("--plot", metavar="FILE", help="the chart: .png, .svg or .pdf (needs matplotlib)")
    parser.add_argument("--html", metavar="FILE", help="everything in one .html: chart, images, histograms, the C")
    parser.add_argument("--json", action="store_true", help="the report as one JSON object")
    _request(parser)
    parser.add_argument("--proved", action="store_true", help="of a request: by a proved bound alone")


def _request(parser: Parser, *, bits: bool = True) -> None:
    """What a variant may be asked for in place of an accuracy."""
    asked = parser.add_mutually_exclusive_group()
    asked.add_argument("--max-error", type=_positive, metavar="E", help="the fastest variant with errors up to E")
    asked.add_argument("--max-ulp", type=_positive, metavar="U", help="the fastest within U units in the last place")
    if bits:
        asked.add_argument("--bits", type=_positive, metavar="B", help="the fastest within half a step of B bits")


def _add_doctor(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "doctor", "compiler, target, vector width, cache", _DOCTOR, _DOCTOR_EXAMPLES)
    _portable(parser)
    parser.add_argument("--json", action="store_true", help="everything as one JSON object")
    parser.add_argument("--clear-cache", action="store_true", help="remove every cached kernel, say what, and exit")
    parser.add_argument(
        "--vectors",
        nargs="?",
        const="double",
        metavar="KERNEL",
        help="what gcc and clang make of each loop of a kernel, for each processor they can compile for: a level of "
        "Chapter 1's scene (default: double), a scene, or a kernel's .c file",
    )


def _size(parser: Parser, default: tuple[int, int]) -> None:
    parser.add_argument(
        "--size",
        type=image_size,
        default=default,
        metavar="WxH",
        help=f"width x height in pixels (default: {default[0]}x{default[1]})",
    )


class _Accuracies(tuple[str, ...]):
    """The levels as argparse lists them; a level with choices that `cost` found, such as `single_fused`, is one too."""

    __slots__ = ()

    def __contains__(self, name: object) -> bool:
        return tuple.__contains__(self, name) or (isinstance(name, str) and _is_choice(name))


def _is_choice(name: str) -> bool:
    if "_" not in name:
        return False
    from symrender_cg.lower.choices import named

    return named(name) is not None


def _accuracy(parser: Parser) -> None:
    parser.add_argument(
        "--accuracy",
        choices=_Accuracies(ACCURACIES),
        default="double",
        metavar="A",
        help=f"{', '.join(ACCURACIES)} (default: double)",
    )


def _accuracies(parser: Parser, default: str) -> None:
    parser.add_argument(
        "--accuracy",
        type=accuracy_list,
        default=default,
        metavar="A[,A]",
        help=f"some of {', '.join(ACCURACIES)}, with commas, or all (default: {default})",
    )


def _target(parser: Parser) -> None:
    parser.add_argument(
        "--target",
        choices=TARGETS,
        metavar="T",
        help=f"what accuracy certified rounds to: {', '.join(TARGETS)} (default: {TARGETS[0]})",
    )


def _portable(parser: Parser) -> None:
    parser.add_argument("--portable", action="store_true", help="compile for any processor of this kind")


def image_size(text: str) -> tuple[int, int]:
    """`800x600` -> (800, 600). Raises ArgumentTypeError for anything else."""
    sides = text.lower().split("x")
    if len(sides) == 2 and all(side.isascii() and side.isdigit() for side in sides):
        width, height = int(sides[0][:12]), int(sides[1][:12])
        if 1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE:
            return width, height
    raise argparse.ArgumentTypeError(
        f"{text!r} is not a size; expected WIDTHxHEIGHT in pixels, each from 1 to {LARGEST_SIDE}, such as 800x600"
    )


def accuracy_list(text: str) -> tuple[str, ...] | str:
    """`double,literal` -> those accuracies in the order of the package, each once; `all` -> `all`."""
    names = [name.strip() for name in text.split(",")]
    if unknown := [name for name in names if name not in (*ACCURACIES, "all") and not _is_choice(name)]:
        raise argparse.ArgumentTypeError(
            f"{unknown[0]!r} is not known; expected some of {', '.join(ACCURACIES)}, or all"
        )
    levels = tuple(name for name in ACCURACIES if name in names)
    return "all" if "all" in names else levels + tuple(dict.fromkeys(name for name in names if name not in ACCURACIES))


def layer_list(text: str) -> tuple[str, ...]:
    """`depth,terms` -> those names, each once. Raises ArgumentTypeError for an unknown one."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    choices = (*LAYERS, "terms", "all")
    if unknown := [name for name in names if name not in choices]:
        raise argparse.ArgumentTypeError(f"{unknown[0]!r} is not known; expected some of {', '.join(choices)}")
    return names


def tolerance(text: str) -> float:
    """A finite number >= 0. Raises ArgumentTypeError for anything else."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if 0.0 <= value < float("inf"):
        return value
    raise argparse.ArgumentTypeError(f"{text!r} is not a tolerance; expected a number >= 0, such as 0.002")


def request(text: str) -> tuple[str, float]:
    """`max_error=1e-6` -> ("max_error", 1e-6). Raises ArgumentTypeError for anything else."""
    name, _, value = text.partition("=")
    if name not in ("max_error", "max_ulp", "bits"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a request; expected max_error=E, max_ulp=U or bits=B")
    return name, _positive(value)


def _positive(text: str) -> float:
    if (value := tolerance(text)) > 0.0:
        return value
    raise argparse.ArgumentTypeError(f"{text!r} is not a bound; expected a number above 0, such as 1e-6")


def _count_from_one(text: str) -> int:
    if (count := _count(text)) > 0:
        return count
    raise argparse.ArgumentTypeError(f"{text!r} is not a count; expected a whole number from 1 up")


def _count(text: str) -> int:
    if text.isascii() and text.isdigit() and len(text) <= 9:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not a count; expected a whole number from 0 up")
