"""A bar on stderr over work that is counted; it appears after a second, and only on a terminal."""

from __future__ import annotations

import sys
import time
from typing import Any

BAR_AFTER_SECONDS = 1.0


class Progress:
    """`with Progress(height, "rendering", "rows") as progress: progress.done(8)`. rich is imported when it appears."""

    def __init__(self, total: int, what: str, unit: str) -> None:
        self._total = total
        self._what = what
        self._unit = unit
        self._done = 0
        self._begin = time.perf_counter()
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def done(self, count: int) -> None:
        """Counts what is finished."""
        self._done += count
        if self._appears():
            self._bar.update(self._task, completed=self._done)

    def now(self, what: str) -> None:
        """Says what is being done from here on."""
        self._what = what
        if self._appears():
            self._bar.update(self._task, description=what)

    def _appears(self) -> bool:
        if self._bar is None and time.perf_counter() - self._begin > BAR_AFTER_SECONDS and sys.stderr.isatty():
            from rich import progress
            from rich.console import Console

            columns = (
                progress.TextColumn("{task.description}"),
                progress.BarColumn(),
                progress.TextColumn(f"{{task.completed}} of {{task.total}} {self._unit}"),
                progress.TimeRemainingColumn(),
            )
            self._bar = progress.Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task(self._what, total=self._total, completed=self._done)
            self._bar.start()
        return self._bar is not None
