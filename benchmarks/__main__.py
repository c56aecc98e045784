"""`python -m benchmarks`: arguments in, tables or JSON out."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

import benchmarks
from benchmarks import agreement, hand_over, levels, promises, random_scenes, roofline, scaling, scenes, speed, start
from benchmarks.peers import chart, contest
from benchmarks.peers import report as peers
from symrender_cg.errors import SymrenderError


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one benchmark; 0, or the exit code of what went wrong."""
    options = _parser().parse_args(argv)
    console = Console() if sys.stdout.isatty() else Console(width=170)
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
    | hand_over.Report
    | promises.Report
    | peers.Report
    | roofline.Report
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
    if options.command == "hand-over":
        return hand_over.measure_hand_over(options.scenes, options.points, options.seed, told)
    if options.command == "levels":
        size, rounds, seed = options.size, options.rounds, options.seed
        return levels.measure_levels(options.scenes, size, rounds, options.points, seed, told)
    if options.command == "promises":
        return promises.measure_promises(options.count, options.others, options.seed, told)
    if options.command == "scaling":
        return scaling.measure_all(_scaling_plan(options), told)
    if options.command == "peers":
        return _peers(options, told)
    if options.command == "roofline":
        return _roofline(options, told)
    return speed.measure_speed(options.size, options.rounds, options.shininess, options.points, options.seed, told)


def _peers(options: argparse.Namespace, told: Callable[[str], None]) -> peers.Report:
    if options.plot:
        chart.require_chart(options.plot)
    plan = contest.Plan.quick(options.seed) if options.quick else contest.Plan(seed=options.seed)
    plan = replace(
        plan,
        size=options.size or plan.size,
        rounds=options.rounds or plan.rounds,
        points=options.points or plan.points,
        threads=tuple(options.threads or plan.threads),
    )
    found = contest.measure_peers(plan, told)
    if options.plot:
        chart.draw_chart(found, options.plot)
    return found


def _roofline(options: argparse.Namespace, told: Callable[[str], None]) -> roofline.Report:
    if options.plot:
        chart.require_chart(options.plot)
    found = roofline.measure_roofline(options.sizes, options.rounds, options.seed, told)
    if options.plot:
        roofline.draw_chart(found, options.plot)
    return found


def _scaling_plan(options: argparse.Namespace) -> scaling.Plan:
    kinds = tuple(options.kinds or scaling.KINDS)
    plan = scaling.Plan.quick(kinds, options.size, options.seed)
    if not options.quick:
        plan = scaling.Plan(kinds, size=options.size, seed=options.seed)
    return replace(
        plan,
        counts=tuple(options.counts or plan.counts),
        lights=tuple(options.lights or plan.lights),
        sizes=tuple(options.sizes or plan.sizes),
        rounds=options.rounds or plan.rounds,
    )


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
    others = commands.add_parser("agreement", help="pictures and geometry beside POV-Ray's and Mitsuba's")
    others.add_argument("scenes", nargs="*", help="built-in names or TOML files (all built-in scenes)")
    others.add_argument("--size", type=_count, default=512, help="side of the image (512)")
    others.add_argument("--rounds", type=_count, default=5, help="samples of each time (5)")
    others.add_argument("--out", type=Path, help="folder for pictures: ours, the peer's, 100 times the difference")
    many = commands.add_parser("scaling", help="times against numbers of spheres, lights and pixels; compile times")
    many.add_argument("kinds", nargs="*", metavar="KIND", type=_kind, help=f"{', '.join(scaling.KINDS)} (all)")
    many.add_argument("--counts", type=_count, nargs="+", help="numbers of spheres (1 10 100 1000 10000)")
    many.add_argument("--lights", type=_count, nargs="+", help="numbers of lights (1 2 4 8 16 32)")
    many.add_argument("--sizes", type=_count, nargs="+", help="sides of the images (64 and its doubles up to 8192)")
    many.add_argument("--size", type=_count, default=512, help="side of the image with many spheres or lights (512)")
    many.add_argument("--rounds", type=_count, help="samples of each contestant (9)")
    many.add_argument("--quick", action="store_true", help="to 100 spheres, 8 lights, 2048 x 2048, in 3 rounds")
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
    kept = commands.add_parser("promises", help="bounds and requests on scenes that nothing was fitted to; minutes")
    kept.add_argument("--count", type=_count, default=500, help="scenes whose bounds are compared (500)")
    kept.add_argument("--others", type=_count, default=160, help="other scenes, of ten requests each (160)")
    rule = commands.add_parser("hand-over", help="errors of double's kernel of one sphere beside the rule's bound")
    rule.add_argument("--scenes", type=_count, default=2400, help="random scenes (2400)")
    rule.add_argument("--points", type=_count, default=1000, help="hard points of each (1000)")
    rivals = commands.add_parser("peers", help="ns a pixel and errors beside numba, JAX, Dr.Jit, Halide and others")
    rivals.add_argument("--quick", action="store_true", help="512 x 512, one thread, 5 rounds: under two minutes")
    rivals.add_argument("--size", type=_count, help="side of the image (1024)")
    rivals.add_argument("--rounds", type=_count, help="samples of each contestant (15)")
    rivals.add_argument("--threads", type=_count, nargs="+", help="numbers of threads (1, and one a processor)")
    rivals.add_argument("--points", type=_count, help="most pixels to compare with the oracle (16384)")
    rivals.add_argument("--plot", type=Path, metavar="FILE", help="chart of error against time, .png or .svg")
    roof = commands.add_parser("roofline", help="operations and bytes of the kernels beside the machine's peaks")
    roof.add_argument("--sizes", type=_count, nargs="+", default=[128, 512, 4096], help="sides (128 512 4096)")
    roof.add_argument("--rounds", type=_count, default=9, help="samples of each time (9)")
    roof.add_argument("--plot", type=Path, metavar="FILE", help="chart of the roofline, .png or .svg")
    for command in (fast, first, others, many, effects, costs, truth, kept, rule, rivals, roof):
        command.add_argument("--seed", type=int, default=1, help="seed of the order of turns and of the pixels (1)")
        command.add_argument("--json", action="store_true", help="print JSON, not tables")
    return parser


def _kind(text: str) -> str:
    if text not in scaling.KINDS:
        raise argparse.ArgumentTypeError(f"{text!r} is none of {', '.join(scaling.KINDS)}")
    return text


def _count(text: str) -> int:
    number = int(text)
    if not 1 <= number <= 1 << 20:
        raise argparse.ArgumentTypeError(f"{number} is not from 1 to {1 << 20}")
    return number


if __name__ == "__main__":
    raise SystemExit(main())
