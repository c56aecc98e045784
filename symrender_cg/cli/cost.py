"""`cost`: what accuracy costs in a scene, as a table, a chart, JSON or one HTML file; and what a request would choose.

A measurement is kept by scene and machine: the same command shows it again, `--again` measures anew.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import msgspec

from symrender_cg.cli.console import Column, Table, counted, duration
from symrender_cg.cli.progress import Progress
from symrender_cg.cli.requests import choice_data, show_choice
from symrender_cg.cost import store
from symrender_cg.cost.choose import Choice, choose
from symrender_cg.cost.front import BESIDE
from symrender_cg.cost.looking import learn
from symrender_cg.cost.measure import QUICK_ROUNDS, ROUNDS, Measured, measure
from symrender_cg.cost.records import recipe
from symrender_cg.cost.report import FORMAT, Effect, Entry, Report
from symrender_cg.cost.search import BUDGET
from symrender_cg.errors import ArgumentError
from symrender_cg.scene import Scene, load_scene

_STEPS = 24
"""Ways that a scene has about, beside those that a search tries: for the progress bar."""


def run(arguments: argparse.Namespace) -> int:
    """Measures or recalls the report, prints what is asked for."""
    scene = load_scene(arguments.scene)
    if _requests(arguments):
        found = _chosen(arguments, scene)
        if arguments.json:
            print(json.dumps(choice_data(found), indent=2))
        else:
            show_choice(found)
        return 0
    for path, suffixes in ((arguments.plot, (".png", ".svg", ".pdf")), (arguments.html, (".html", ".htm"))):
        _require_place(path, suffixes)
    report, measured = _report(arguments, scene)
    if arguments.json:
        print(msgspec.json.format(msgspec.json.encode(report), indent=2).decode())
    else:
        show(report, everything=arguments.all)
    if arguments.plot:
        from symrender_cg.cost.chart import write_chart

        write_chart(arguments.plot, report)
        _said(arguments, f"chart    {arguments.plot}")
    if arguments.html:
        from symrender_cg.cost.html import write_html

        assert measured is not None, "what HTML shows is made ready"
        write_html(arguments.html, scene, measured)
        _said(arguments, f"report   {arguments.html}")
    return 0


def _said(arguments: argparse.Namespace, line: str) -> None:
    if not arguments.json:
        print(line)


def _requests(arguments: argparse.Namespace) -> bool:
    return any(getattr(arguments, name) is not None for name in ("max_error", "max_ulp", "bits"))


def _chosen(arguments: argparse.Namespace, scene: Scene) -> Choice:
    return choose(
        scene,
        max_error=arguments.max_error,
        max_ulp=arguments.max_ulp,
        bits=arguments.bits,
        proved=arguments.proved,
        bake=arguments.bake,
        aspect=arguments.size[0] / arguments.size[1],
    )


def _require_place(path: str | None, suffixes: tuple[str, ...]) -> None:
    """Raises ArgumentError for a place that will not do, before anything is measured."""
    if path is None:
        return
    target = Path(path)
    if target.suffix.lower() not in suffixes:
        raise ArgumentError(f"{target}: {target.suffix!r} is not a suffix for it; expected {', '.join(suffixes)}")
    if target.is_dir() or not target.parent.is_dir():
        raise ArgumentError(f"{target}: not a place for a file; expected a file's name in a folder that exists")


def _report(arguments: argparse.Namespace, scene: Scene) -> tuple[Report, Measured | None]:
    """The report as it was kept, or measured now; HTML needs what was measured, too."""
    size, rounds = arguments.size, arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    key = [FORMAT, BUDGET, recipe(scene), scene.to_toml(), size, rounds, arguments.seed, arguments.quick]
    kept = None if arguments.again or arguments.html else store.read("report", key)
    report: Report | None = None
    if kept is not None:
        try:
            report = msgspec.json.decode(kept, type=Report)
        except msgspec.DecodeError:
            report = None
    measured = None
    if report is None:
        name = arguments.scene or "chapter1"
        total = _STEPS + rounds + (0 if arguments.quick else BUDGET)
        with Progress(total, "compiling and measuring", "steps") as progress:

            def told(what: str) -> None:
                progress.now(what)
                progress.done(1)

            measured = measure(scene, name, size, rounds=rounds, seed=arguments.seed, quick=arguments.quick, told=told)
        report = measured.report
        store.write("report", key, msgspec.json.encode(report))
        learn(scene, report, measured.top)
    if arguments.effects and not report.effects:
        from symrender_cg.cost.effects import measure_effects

        effects = measure_effects(scene, size, rounds=rounds, seed=arguments.seed)
        report = msgspec.structs.replace(report, effects=effects)
        store.write("report", key, msgspec.json.encode(report))
        if measured is not None:
            measured = Measured(report, measured.ready, measured.top)
    return report, measured


# -------------------------------------------------------------------------------------------------------------- tables


def show(report: Report, *, everything: bool) -> None:
    """The report as text."""
    print(
        f"{report.scene}, {report.width} x {report.height}, one thread, {report.rounds} interleaved rounds; "
        f"{counted(len(report.entries), 'way')} to draw it, {report.tried} of {report.budget} found by search; "
        f"seed {report.seed}\n{report.machine.line()}\n"
    )
    _table(report, everything=everything).show()
    first = report.entries[0].errors
    print(
        "\nns: nanoseconds a pixel; ratio: to `double`, median and quartiles of the rounds; error: the largest of the\n"
        f"unclipped field against the oracle at {first.points:,} points of the window and {first.hard:,} hard ones, "
        "none of which was\nused to choose; 99.9 %: of those in the window alone; ulp: of the way's own format; 8 bit: "
        "grey levels right;\nflips: points where background and surface, or the sides of an edge, are mistaken; lines, "
        "ops: of C, operations a pixel"
    )
    if report.steps:
        print("\nalong the front")
        for step in report.steps:
            print(f"  {step}")
    if report.break_even:
        print("\nbreak-even: the build of a special kernel against the time a pixel that it saves")
        _break_even(report).show()
    if report.effects:
        print("\none effect after the other, at `double`")
        _effects(report.effects).show()
    print(f"\nmeasured in {duration(report.seconds)}")


def _table(report: Report, *, everything: bool) -> Table:
    right = ("ns", "ratio", "error", "99.9 %", "ulp", "8 bit", "flips", "lines", "ops")
    table = Table(
        (Column("way"), *(Column(head, right=True) for head in right), Column("proved", right=True), Column(""))
    )
    for entry in report.front:
        table.add(*_cells(entry), "front")
    table.section()
    for entry in report.baked_front:
        table.add(*_cells(entry), "front of what is baked")
    table.section()
    rest = sorted((entry for entry in report.entries if not entry.on_front), key=lambda entry: entry.ns.median)
    for entry in rest:
        if everything or entry.kind != "choice":
            word = entry.dominated_by if entry.dominated_by in BESIDE else f"dominated by {entry.dominated_by}"
            table.add(*_cells(entry), word)
    hidden = 0 if everything else sum(entry.kind == "choice" for entry in rest)
    if hidden:
        table.section()
        table.add(f"{counted(hidden, 'choice')} more, dominated: --all")
    return table


def _cells(entry: Entry) -> tuple[str, ...]:
    errors, ratio = entry.errors, entry.ratio
    wrong = f"{errors.flips}" + (f" + {errors.nonfinite} not finite" if errors.nonfinite else "")
    return (
        entry.name,
        f"{entry.ns.median:.3g}",
        f"{ratio.median:.2f} ({ratio.low:.2f} .. {ratio.high:.2f})",
        f"{errors.largest:.1e}",
        f"{errors.p999:.1e}",
        f"{errors.ulp:.2g}",
        f"{100.0 * errors.right8:.4g} %",
        wrong,
        str(entry.lines or ""),
        str(entry.operations or ""),
        "" if entry.bound is None else f"{entry.bound:.1e}",
    )


def _break_even(report: Report) -> Table:
    table = Table(
        (
            Column("special"),
            Column("against"),
            Column("what"),
            Column("build", right=True),
            Column("saves, ns a pixel", right=True),
            Column("pays after pixels", right=True),
            Column(f"images of {report.width} x {report.height}", right=True),
        )
    )
    for row in report.break_even:
        pays = "never" if row.pixels is None else f"{row.pixels:.2g}"
        images = "" if row.images is None else f"{row.images:,.0f}"
        table.add(row.special, row.general, row.what, duration(row.build), f"{row.saved:.3g}", pays, images)
    return table


def _effects(effects: tuple[Effect, ...]) -> Table:
    table = Table((Column("with"), Column("ns a pixel", right=True), Column("added", right=True), Column("")))
    for effect in effects:
        table.add(effect.effect, f"{effect.ns.median:.3g}", f"{effect.added:+.3g}", effect.did)
    return table
