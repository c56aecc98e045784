"""`python -m benchmarks`: arguments in, tables or JSON out."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

import benchmarks
from benchmarks import agreement, levels, random_scenes, scaling, scenes, speed, start
from symrender_cg.errors import SymrenderError


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one benchmark; 0, or the exit code of what went wrong."""
    options = _parser().parse_args(argv)
    console = Console() if sys.stdout.isatty() else Console(width=140)
    try:
        with Console(stderr=True).status("starting") as status:
            told: Callable[[str], None] = status.update
            report = _measured(options, told)
    except SymrenderError as problem:
        print(f"benchmarks: error: {problem}", file=sys.stderr)
        return problem.exit_code
    if options.json:
        print(json.dumps(report.to_dict(), indent=1))
    else:
        report.show(console)
    return 0


Report = (
    speed.Report
    | start.Report
    | agreement.Report
    | scaling.Report
    | random_scenes.Report
    | scenes.Report
    | levels.Report
)


def _measured(options: argparse.Namespace, told: Callable[[str], None]) -> Report:
    if options.command == "start":
        return start.measure_start(options.size, options.rounds, options.seed, told)
    if options.command == "agreement":
        size, rounds, seed = options.size, options.rounds, options.seed
        return agreement.measure_agreement(options.scenes, size, rounds, seed, options.out, told)
    if options.command == "random-scenes":
        size = (options.width, options.height)
        return random_scenes.measure_random_scenes(options.count, options.seed, size, options.jobs, told)
    if options.command == "scenes":
        return scenes.measure_scenes(options.scenes, options.size, options.rounds, options.seed, told)
    if options.command == "levels":
        size, rounds, seed = options.size, options.rounds, options.seed
        return levels.measure_levels(options.scenes, size, rounds, options.points, seed, told)
    if options.command == "scaling":
        counts = options.counts or (scaling.QUICK_COUNTS if options.quick else scaling.COUNTS)
        rounds = options.rounds or (3 if options.quick else 9)
        return scaling.measure_scaling(counts, options.size, rounds, options.seed, told)
    return speed.measure_speed(options.size, options.rounds, options.shininess, options.points, options.seed, told)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=benchmarks.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True)
    fast = commands.add_parser("speed", help="nanoseconds a pixel of every contestant, and its largest errors")
    fast.add_argument("--size", type=_count, nargs="+", default=[256, 1024], help="sides of the images (256 1024)")
    fast.add_argument("--rounds", type=_count, default=15, help="samples of each contestant (15)")
    fast.add_argument("--shininess", type=float, default=32.0, help="exponent of the highlight (32)")
    fast.add_argument("--points", type=_count, default=65536, help="most pixels to compare with the oracle (65536)")
    first = commands.add_parser("start", help="seconds from the start of a process to its first image")
    first.add_argument("--size", type=_count, default=256, help="side of the image (256)")
    first.add_argument("--rounds", type=_count, default=7, help="processes of each case (7)")
    peers = commands.add_parser("agreement", help="pictures and geometry beside POV-Ray's and Mitsuba's")
    peers.add_argument("scenes", nargs="*", help="built-in names or TOML files (all built-in scenes)")
    peers.add_argument("--size", type=_count, default=512, help="side of the image (512)")
    peers.add_argument("--rounds", type=_count, default=5, help="samples of each time (5)")
    peers.add_argument("--out", type=Path, help="folder for pictures: ours, the peer's, 100 times the difference")
    many = commands.add_parser("scaling", help="milliseconds against the number of spheres, beside POV-Ray and Mitsuba")
    many.add_argument("--counts", type=_count, nargs="+", help="numbers of spheres (1 10 100 1000 10000)")
    many.add_argument("--size", type=_count, default=512, help="side of the image (512)")
    many.add_argument("--rounds", type=_count, help="samples of each contestant (9)")
    many.add_argument("--quick", action="store_true", help="to 100 spheres in 3 rounds")
    effects = commands.add_parser("scenes", help="each scene with its plan and with every effect forced in")
    effects.add_argument("scenes", nargs="*", help="built-in names or TOML files (all built-in scenes)")
    effects.add_argument("--size", type=_count, default=512, help="side of the image (512)")
    effects.add_argument("--rounds", type=_count, default=9, help="samples of each time (9)")
    costs = commands.add_parser("levels", help="what each accuracy costs and delivers, scene by scene")
    costs.add_argument("scenes", nargs="*", help="built-in names or TOML files (all built-in scenes)")
    costs.add_argument("--size", type=_count, default=256, help="side of the image (256)")
    costs.add_argument("--rounds", type=_count, default=9, help="samples of each time (9)")
    costs.add_argument("--points", type=_count, default=2000, help="most pixels to compare with the oracle (2000)")
    truth = commands.add_parser("random-scenes", help="random scenes against brute force and the oracle; minutes")
    truth.add_argument("--count", type=_count, default=2000, help="how many scenes (2000)")
    truth.add_argument("--width", type=_count, default=24, help="pixels of a row (24)")
    truth.add_argument("--height", type=_count, default=20, help="rows of an image (20)")
    truth.add_argument("--jobs", type=_count, help="processes (one for each processor)")
    for command in (fast, first, peers, many, effects, costs, truth):
        command.add_argument("--seed", type=int, default=1, help="seed of the order of turns and of the pixels (1)")
        command.add_argument("--json", action="store_true", help="print JSON, not tables")
    return parser


def _count(text: str) -> int:
    number = int(text)
    if not 1 <= number <= 1 << 20:
        raise argparse.ArgumentTypeError(f"{number} is not from 1 to {1 << 20}")
    return number


if __name__ == "__main__":
    raise SystemExit(main())
