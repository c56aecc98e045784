"""Running the command line from tests: in this process, and in one of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from symrender_cg.cli.main import main

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Answer:
    """What one run said."""

    code: int
    out: str
    err: str


class Shell:
    """`shell("render", "-o", path)` runs the command in this process."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys = capsys

    def __call__(self, *words: str | Path) -> Answer:
        self.capsys.readouterr()
        code = main([str(word) for word in words])
        said = self.capsys.readouterr()
        assert "Traceback" not in said.err
        return Answer(code, said.out, said.err)


def in_a_process(
    *words: str | Path, code: str | None = None, folder: Path | None = None, env: Mapping[str, str] | None = None
) -> Answer:
    """`python -m symrender_cg words`, or `python -c code words`, warnings as errors, in a process of its own."""
    start = ["-m", "symrender_cg"] if code is None else ["-c", code]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **(env or {})}
    command = [sys.executable, "-W", "error", *start, *map(str, words)]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env=environment, timeout=300, check=False
    )
    return Answer(done.returncode, done.stdout, done.stderr)


LOADED_AFTER = """
import sys
from symrender_cg.cli.main import main
code = main(sys.argv[1:])
assert code == 0, code
print("loaded:", *[name for name in ("sympy", "jinja2", "rich", "flint") if name in sys.modules])
"""
"""Runs a command and prints which of the modules that a warm start does without it has loaded."""
