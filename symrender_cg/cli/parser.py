"""The options of every command. Imports nothing but what names accuracies and sizes.

In: nothing. Out: the parser. Never here: what an argument's text means (arguments.py), or help of more than a line
(texts.py).
"""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

from symrender_cg.cli import texts
from symrender_cg.cli.arguments import (
    LAYERS,
    Accuracies,
    accuracy_list,
    count,
    count_from_one,
    image_size,
    layer_list,
    positive,
    request,
    tolerance,
)
from symrender_cg.errors import ArgumentError
from symrender_cg.lower.variants import ACCURACIES, TARGETS
from symrender_cg.version import VERSION

SCENE_HELP = "a built-in scene's name or a TOML file; Chapter 1's scene if left out (render --list names the others)"


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
        description=texts.DESCRIPTION,
        epilog=texts.EXAMPLES,
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
    parser = _command(commands, "build", "derive, write the C, compile", texts.BUILD, texts.BUILD_EXAMPLES)
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
    parser = _command(
        commands, "render", "render a scene to .png, .npy, .npz or .pfm", texts.RENDER, texts.RENDER_EXAMPLES
    )
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
    parser = _command(
        commands, "explain", "the plan, the derivation, the proofs", texts.EXPLAIN, texts.EXPLAIN_EXAMPLES
    )
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
    parser = _command(
        commands, "check", "compare the kernels with references and oracle", texts.CHECK, texts.CHECK_EXAMPLES
    )
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    _size(parser, (96, 96))
    parser.add_argument(
        "--points", type=count, default=1000, metavar="N", help="points near each hard place (default: 1000)"
    )
    parser.add_argument("--seed", type=count, default=1, metavar="N", help="of those points (default: 1)")
    _accuracies(parser, "all")
    _portable(parser)
    parser.add_argument("--json", action="store_true", help="the table as one JSON object")


def _add_stress(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "stress", "accuracy levels on hard cases", texts.STRESS, texts.STRESS_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="a scene whose own hard points are meant")
    parser.add_argument("--level", action="append", default=[], metavar="LEVEL", help="once or more; all if left out")
    parser.add_argument("--family", action="append", default=[], metavar="NAME", help="once or more; all if left out")
    parser.add_argument(
        "--count", type=count_from_one, default=200, metavar="N", help="cases a family, or points a set (default: 200)"
    )
    parser.add_argument("--seed", type=count, default=1, metavar="N", help="of the cases (default: 1)")
    parser.add_argument("--json", action="store_true", help="the table as one JSON object")
    parser.add_argument("--keep", metavar="FILE", help="add the worst point of each row to FILE")
    parser.add_argument("--atlas", metavar="FILE", help="draw where each level breaks instead: .png, .svg or .pdf")


def _add_conditioning(commands: argparse._SubParsersAction[Parser]) -> None:
    short = "how much the inputs' last digits move each pixel"
    parser = _command(commands, "conditioning", short, texts.CONDITIONING, texts.CONDITIONING_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    parser.add_argument("-o", "--output", metavar="FILE", help="the picture: .png, .svg or .pdf (needs matplotlib)")
    _size(parser, (256, 256))
    parser.add_argument("--absolute", action="store_true", help="absolute moves in the picture, not ulp of the pixel")
    parser.add_argument("--json", action="store_true", help="the figures as one JSON object")


def _add_cost(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "cost", "what accuracy costs in time", texts.COST, texts.COST_EXAMPLES)
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE_HELP)
    _size(parser, (256, 256))
    parser.add_argument("--rounds", type=count_from_one, metavar="N", help="interleaved rounds (default: 15; quick: 7)")
    parser.add_argument("--seed", type=count, default=1, metavar="N", help="of points and rounds (default: 1)")
    parser.add_argument("--quick", action="store_true", help="no search, fewer rounds and points")
    parser.add_argument("--again", action="store_true", help="measure anew what was measured before")
    parser.add_argument("--all", action="store_true", help="every choice that was tried, also where it is dominated")
    parser.add_argument("--effects", action="store_true", help="the scene's time with one effect after the other")
    parser.add_argument("--plot", metavar="FILE", help="the chart: .png, .svg or .pdf (needs matplotlib)")
    parser.add_argument("--html", metavar="FILE", help="everything in one .html: chart, images, histograms, the C")
    parser.add_argument("--json", action="store_true", help="the report as one JSON object")
    _request(parser)
    parser.add_argument("--proved", action="store_true", help="of a request: by a proved bound alone")
    parser.add_argument("--bake", action="store_true", help="of a request: kernels with the scene's numbers in, too")


def _request(parser: Parser, *, bits: bool = True) -> None:
    """What a variant may be asked for in place of an accuracy."""
    asked = parser.add_mutually_exclusive_group()
    asked.add_argument("--max-error", type=positive, metavar="E", help="the fastest variant with errors up to E")
    asked.add_argument("--max-ulp", type=positive, metavar="U", help="the fastest within U units in the last place")
    if bits:
        asked.add_argument("--bits", type=positive, metavar="B", help="the fastest within half a step of B bits")


def _add_doctor(commands: argparse._SubParsersAction[Parser]) -> None:
    parser = _command(commands, "doctor", "compiler, target, vector width, cache", texts.DOCTOR, texts.DOCTOR_EXAMPLES)
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


def _accuracy(parser: Parser) -> None:
    parser.add_argument(
        "--accuracy",
        choices=Accuracies(ACCURACIES),
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
