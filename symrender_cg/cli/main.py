"""argv -> exit code. The one place where an error becomes a line on stderr.

0 done   2 usage or scene   3 outside what a plan covers   4 a bound broken   5 toolchain   130 interrupted
141 nobody reads the output any longer (quiet, as a program that SIGPIPE ends)
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module

from symrender_cg.cli.parser import build_parser
from symrender_cg.errors import ArgumentError, SymrenderError

INTERRUPTED = 130
PIPE_CLOSED = 141

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import TextIO


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code; `argv` is sys.argv[1:] unless given. Never raises SystemExit."""
    try:
        code = _run(argv)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        _discard_output()
        return PIPE_CLOSED
    except KeyboardInterrupt:
        print("symrender_cg: interrupted", file=sys.stderr)
        return INTERRUPTED


def _run(argv: Sequence[str] | None) -> int:
    try:
        arguments = build_parser().parse_args(argv)
    except SystemExit as usage:  # argparse has said why, or printed the help that was asked for
        return usage.code if isinstance(usage.code, int) else ArgumentError.exit_code
    debug = arguments.debug or os.environ.get("SYMRENDER_DEBUG", "").strip() not in ("", "0")
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            if debug:
                _log_everything()
            return int(import_module(f"symrender_cg.cli.{arguments.command}").run(arguments))
    except SymrenderError as error:
        if debug:
            import traceback

            traceback.print_exc()
        print(f"symrender_cg: error: {error}", file=sys.stderr)
        return error.exit_code


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """A warning as a user reads it: without the line of ours that raised it."""
    del category, filename, lineno, line
    print(f"symrender_cg: warning: {message}", file=file or sys.stderr)


def _log_everything() -> None:
    import logging

    logging.basicConfig(level=logging.WARNING, format="%(name)s: %(levelname)s: %(message)s", stream=sys.stderr)
    logging.getLogger("symrender_cg").setLevel(logging.DEBUG)


def _discard_output() -> None:
    """Sends what is still to be flushed nowhere, so that the interpreter's own end is quiet too."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
    except (OSError, ValueError):
        return
