"""Every error that this package raises on purpose.

    SymrenderError                      exit code
      SceneError (ValueError)               2     a scene, or a scene file, that has no image
      ArgumentError (ValueError)            2     an argument of a call or of the command line
      OutsidePlanError (ValueError)         3     numbers outside what the plan of a kernel proved
      AccuracyError                         4     a stated bound or certificate that is not met
      ToolchainError (RuntimeError)         5
        CompilerNotFoundError               5     no C compiler, with the three ways to get one
        CompileError                        5     the compiler's command, exit status and message
        LibraryError                        5     a library that was built but cannot be loaded

A message says what was wrong, with its value and its place, what was expected, and what to do about it.
The command line prints it without a traceback and exits with the code of its class.
"""

from __future__ import annotations

from collections.abc import Sequence


class SymrenderError(Exception):
    """Root of the tree: catch this to catch everything that this package raises on purpose."""

    exit_code = 1


class SceneError(SymrenderError, ValueError):
    """A scene that has no image; `place` is the path of the offending value, such as `spheres[2].radius`."""

    exit_code = 2

    def __init__(self, place: str, problem: str) -> None:
        self.place = place
        self.problem = problem
        super().__init__(f"{place}: {problem}" if place else problem)

    def __reduce__(self) -> tuple[type[SceneError], tuple[str, str]]:
        return type(self), (self.place, self.problem)


class ArgumentError(SymrenderError, ValueError):
    """An argument with a value, type or shape that the call cannot use."""

    exit_code = 2


class OutsidePlanError(SymrenderError, ValueError):
    """Numbers for which the proofs of a plan do not hold, or a scene that no plan covers yet."""

    exit_code = 3


class AccuracyError(SymrenderError):
    """A stated bound or certificate that is not met; `points`: indices of the points that it is about, if any."""

    exit_code = 4

    def __init__(self, message: str, points: Sequence[int] = ()) -> None:
        self.points = tuple(points)
        super().__init__(message)

    def __reduce__(self) -> tuple[type[AccuracyError], tuple[str, tuple[int, ...]]]:
        return type(self), (str(self), self.points)


class ToolchainError(SymrenderError, RuntimeError):
    """Something between the C text and a loaded library went wrong."""

    exit_code = 5


class CompilerNotFoundError(ToolchainError):
    """No C compiler; the message names the places searched and three remedies."""


class CompileError(ToolchainError):
    """The compiler ran and refused; the message holds its command, exit status and first lines of stderr."""

    def __init__(self, command: Sequence[str], status: int, stderr: str) -> None:
        self.command = tuple(command)
        self.status = status
        self.stderr = stderr
        lines = stderr.strip().splitlines()
        shown = "\n".join(f"    {line}" for line in lines[:20])
        more = f"\n    ... {len(lines) - 20} more lines" if len(lines) > 20 else ""
        super().__init__(
            f"the compiler failed with exit status {status}\n  command: {' '.join(command)}\n  it said:\n{shown}{more}"
        )

    def __reduce__(self) -> tuple[type[CompileError], tuple[tuple[str, ...], int, str]]:
        return type(self), (self.command, self.status, self.stderr)


class LibraryError(ToolchainError):
    """A shared library that cannot be loaded, or that lacks an entry point."""
