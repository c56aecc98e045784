"""`explain --ablate`: what each effect costs, as a table or as JSON's data."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from symrender_cg.cli.console import Column, Table, duration
from symrender_cg.cli.derivation import WORDS
from symrender_cg.cli.progress import Progress
from symrender_cg.explain.ablation import Ablation, Experiment, Trial
from symrender_cg.scene import Scene


def measured(scene: Scene, accuracy: str, size: tuple[int, int], max_error: float) -> Ablation:
    """The ablation of a scene, with a progress bar on a terminal."""
    experiment = Experiment(scene, accuracy, size=size, max_error=max_error)
    with Progress(experiment.steps, "compiling and measuring", "steps") as progress:
        return experiment.run(progress.done)


def as_data(found: Ablation) -> dict[str, Any]:
    """The ablation as what JSON holds."""

    def trial_data(trial: Trial) -> dict[str, Any]:
        """What is not finite becomes null."""
        change = trial.change if trial.change is not None and math.isfinite(trial.change) else None
        return asdict(trial) | {"change": change, "holds": trial.holds}

    return asdict(found) | {
        "trials": [trial_data(trial) for trial in found.trials],
        "holds": all(trial.holds for trial in found.trials),
    }


def show(found: Ablation) -> None:
    """Prints it as text."""
    within = f", within {found.max_error:g}" if found.max_error else ""
    print(
        f"{found.kernel}, {found.width} x {found.height}{within}: {duration(found.seconds)} an image on one thread, "
        f"{found.seconds / (found.width * found.height) * 1e9:.3g} ns a pixel\n"
    )
    table = Table(
        (
            Column(""),
            Column("effect"),
            Column("tried"),
            Column("largest change", right=True),
            Column("pixels changed", right=True),
            Column("time", right=True),
            Column("with / without", right=True),
            Column(""),
        )
    )
    for out in (False, True):
        table.section()
        for trial in found.trials:
            if (trial.status != "needed") == out:
                table.add(*_cells(trial))
    table.show()
    print(
        f"\nin: drawn again without the effect; out, bounded: drawn again with the effect forced in everywhere"
        f"\nlargest change of any channel of the unclipped image; time: median of {found.rounds} interleaved rounds;"
        "\nwith / without: the time with the effect over the time without it"
    )


def _cells(trial: Trial) -> tuple[str, ...]:
    word = WORDS[trial.status]
    if trial.change is None or trial.share is None or trial.seconds is None or trial.ratio is None:
        return word, trial.effect, trial.tried
    share = "none" if trial.share == 0.0 else f"{100.0 * trial.share:.3g} %"
    return (
        word,
        trial.effect,
        trial.tried,
        "0" if trial.change == 0.0 else f"{trial.change:.3g}",
        share,
        duration(trial.seconds),
        f"{trial.ratio:.2f}",
        _verdict(trial),
    )


def _verdict(trial: Trial) -> str:
    if trial.allowed is None:
        return ""
    if not trial.holds:
        return f"BROKEN: at most {trial.allowed:.3g} is stated"
    return "holds" if trial.allowed == 0.0 else f"holds, at most {trial.allowed:.3g}"
