"""--max-error, --max-ulp and --bits of a command: the accuracy that they choose, put in its place and printed.

Comes in: the arguments of a command. Goes out: the same with accuracy and target set. Never done here: a choice;
symrender_cg.cost.choose makes it.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from symrender_cg.cli.console import Column, Table, counted
from symrender_cg.errors import ArgumentError
from symrender_cg.scene import Scene

if TYPE_CHECKING:
    from symrender_cg.cost.choose import Choice

NO_BOUND = 1e300
REQUESTS = ("max_error", "max_ulp", "bits")


def choose_for(
    arguments: argparse.Namespace,
    scene: Scene,
    *,
    flags: bool = True,
    plans: bool = False,
    names: tuple[str, ...] = REQUESTS,
) -> Choice | None:
    """What a request chose, None where there is no request. `flags`: variants with compiler flags of their own, too;
    `plans`: those by plans that leave out what is within the tolerance.

    `names` of the options that are requests: to `render` --bits is another thing.

    Raises ArgumentError beside options that choose a kernel themselves, AccuracyError (exit code 4) where nothing meets
    the request.
    """
    given: dict[str, Any] = {name: getattr(arguments, name, None) for name in names}
    if all(value is None for value in given.values()):
        return None
    if arguments.target is not None or getattr(arguments, "bake", False):
        option = "--target" if arguments.target is not None else "--bake"
        raise ArgumentError(f"{option}: chooses a kernel, and so does a request for an error; leave one of them out")
    from symrender_cg.cost.choose import choose

    width, height = getattr(arguments, "size", (1, 1))
    found = choose(scene, **given, flags=flags, plans=plans, aspect=width / height)
    print(found)
    several = isinstance(arguments.accuracy, tuple) or arguments.accuracy == "all"
    arguments.accuracy = (found.accuracy,) if several else found.accuracy
    arguments.target = found.target
    return found


def show_choice(found: Choice) -> None:
    """The choice, and everything that was considered."""
    looked = f"looked at {counted(len(found.considered), 'way')} of {found.possible}"
    print(f"{found}\n{looked}: those that may be fastest, until none was left that may be faster\n")
    table = Table(
        (
            Column("variant"),
            Column("result"),
            Column("bound", right=True),
            Column(""),
            Column("ns a pixel", right=True),
            Column(""),
        )
    )
    for entry in found.considered:
        verdict = "chosen" if entry.way == found.way else "meets it" if entry.meets else "does not meet it"
        ns = "" if entry.ns is None else f"{entry.ns:.3g}"
        bound = f"{entry.bound:.2g}" if entry.bound < NO_BOUND else "none"
        table.add(entry.way, entry.result, bound, entry.kind, ns, verdict)
    table.show()


def choice_data(found: Choice) -> dict[str, Any]:
    """The choice as what JSON holds; a bound that is none is null."""
    import msgspec

    data: dict[str, Any] = msgspec.to_builtins(found)
    for entry in data["considered"]:
        entry["bound"] = entry["bound"] if entry["bound"] < NO_BOUND else None
    return data
