"""CC, PATH, the ziglang wheel -> Toolchain: which C compiler, which version, and what machine it compiles for.

In:  the environment variables CC and PATH, the processor's own description, and records of earlier answers.
Out: a Toolchain whose two Targets (the machine's own, and portable) say what the compiler resolved its flags to.
Never here: compiling a kernel, or a decision about where files are kept.

Asking a compiler costs two processes. The answer is handed to a RecordStore under a name that holds everything it
depends on, so that the next start asks nobody.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from symrender_cg.errors import CompilerNotFoundError

TYPE_CHECKING = False
if TYPE_CHECKING:
    import subprocess

RECORD_FORMAT = 2
NAMES_ON_PATH = ("cc", "gcc", "clang")
# The first major versions that know -march=x86-64-v3; Apple counts by itself.
LEVELS_SINCE = {"gcc": 11, "clang": 12, "apple": 13, "zig": 12}
LASTING_CPU_FACTS = frozenset(
    {"vendor_id", "cpu family", "model", "model name", "stepping", "flags"}  # x86
    | {"cpu implementer", "cpu architecture", "cpu variant", "cpu part", "cpu revision", "features"}  # ARM
    | {"isa", "uarch", "cpu", "machine", "revision"}  # RISC-V, POWER
)
REMEDIES = (
    "install a compiler: apt install gcc (Debian, Ubuntu), dnf install gcc (Fedora), xcode-select --install (macOS)",
    "pip install ziglang: a complete C compiler as a Python wheel, no root needed",
    'render_image(..., backend="numpy"): the same image without any compiler, more slowly',
)


@dataclass(frozen=True, slots=True)
class Target:
    """What the compiler makes of the machine: flags (-march=native or none), processor, vector width, feature macros.

    `fingerprint` is the sha256 of the compiler's predefined macros under those flags: two machines for which it is
    equal have the same instruction set as far as the compiler knows.
    """

    flags: tuple[str, ...]
    triple: str
    cpu: str
    vector_bytes: int
    fingerprint: str


@dataclass(frozen=True, slots=True)
class Toolchain:
    """A C compiler that answered: its path, kind ("gcc", "clang" or "zig"), version line and command prefix.

    `knows_levels`: it compiles for x86-64 and knows its levels x86-64-v3 and x86-64-v4, and CC names no processor.
    """

    path: str
    kind: str
    version: str
    command: tuple[str, ...]
    native: Target
    portable: Target
    knows_levels: bool

    def target(self, portable: bool) -> Target:
        """The machine's own target, or the one that every machine of this architecture can run."""
        return self.portable if portable else self.native

    def to_json(self) -> str:
        """The record of this toolchain."""
        return json.dumps(asdict(self), indent=1)

    @staticmethod
    def from_json(text: str) -> Toolchain | None:
        """The toolchain of a record; None for one that is cut short or of another make."""
        try:
            read = json.loads(text)
            native, portable = ({**read[name], "flags": tuple(read[name]["flags"])} for name in ("native", "portable"))
            resolved = {"native": Target(**native), "portable": Target(**portable)}
            said = {"command": tuple(read["command"]), "knows_levels": bool(read["knows_levels"])}
            return Toolchain(**{**read, **resolved, **said})
        except (ValueError, KeyError, TypeError):
            return None


class RecordStore:
    """What toolchain discovery remembers, as texts by name. This one forgets; the cache has one that keeps."""

    def read(self, name: str) -> str | None:
        """The text stored under `name`, or None."""
        return None

    def write(self, name: str, text: str) -> None:
        """Keep `text` under `name`, if there is a place for it."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    label: str
    path: str
    command: tuple[str, ...]
    is_zig: bool = False


class _ProbeError(Exception):
    """A program that did not answer as a C compiler; the text says what it did."""


def find_toolchain(*, records: RecordStore | None = None) -> Toolchain:
    """CC, else cc, gcc, clang on PATH, else the ziglang wheel: the first that answers as a C compiler.

    CC may hold arguments ("ccache gcc -m64"). A CC that does not work is an error and never a silent fall-back.
    With `records` that know the answer no process is started; without, two are.
    Raises CompilerNotFoundError, naming the places searched and three remedies.
    """
    store = records if records is not None else RecordStore()
    refused: list[str] = []
    for candidate in _candidates():
        name = _record_name(candidate)
        record = store.read(name)
        known = None if record is None else Toolchain.from_json(record)
        if known is not None:
            return known
        try:
            toolchain = _asked(candidate)
        except _ProbeError as refusal:
            refused.append(f"{candidate.label} ({' '.join(candidate.command)}) is no working C compiler: {refusal}")
            continue
        store.write(name, toolchain.to_json())
        return toolchain
    raise CompilerNotFoundError(_not_found_message(refused))


def run_compiler(command: Sequence[str], folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a compiler in `folder`, its messages in English (LC_ALL=C). Raises OSError where it cannot be started."""
    import subprocess

    environment = {**os.environ, "LC_ALL": "C"}
    return subprocess.run(
        list(command),
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )


def cpu_identity() -> str:
    """A text that differs between processors with different instruction sets; read from the system, no process run.

    Linux: the first processor of /proc/cpuinfo, without what changes from second to second. Elsewhere: uname.
    """
    system = os.uname()
    try:
        with open("/proc/cpuinfo", "rb") as source:
            first = source.read(1 << 14).split(b"\n\n", 1)[0].decode("utf-8", "replace")
    except OSError:
        return json.dumps(list(system))
    lines = (line.partition(":") for line in first.splitlines())
    lasting = [f"{name.strip()}:{value}" for name, _, value in lines if name.strip().lower() in LASTING_CPU_FACTS]
    return json.dumps([system.sysname, system.machine, *lasting])


def _candidates() -> Iterator[_Candidate]:
    setting = os.environ.get("CC", "").strip()
    if setting:
        yield _candidate_of_cc(setting)
        return
    for name in NAMES_ON_PATH:
        path = which(name)
        if path is not None:
            yield _Candidate(f"{name} on PATH", path, (path,))
    zig = _zig_wheel()
    if zig is not None:
        yield _Candidate("the ziglang wheel", zig, (sys.executable, "-m", "ziglang", "cc"), is_zig=True)


def _candidate_of_cc(setting: str) -> _Candidate:
    import shlex

    try:
        words = shlex.split(setting)
    except ValueError as problem:
        raise CompilerNotFoundError(f"CC is {setting!r}, which is not a command: {problem}") from None
    path = which(words[0])
    if path is None:
        raise CompilerNotFoundError(
            f"CC is {setting!r}, but there is no program {words[0]!r} (PATH is {os.environ.get('PATH', '')!r}). "
            f"Unset CC to search {', '.join(NAMES_ON_PATH)} and the ziglang wheel, or:{_remedy_lines()}"
        )
    is_zig = os.path.basename(path).startswith("zig") or "ziglang" in words
    return _Candidate("CC", path, (path, *words[1:]), is_zig)


def which(program: str) -> str | None:
    """The absolute path of a program on PATH, or of a path that is executable; None where there is none."""
    if os.path.dirname(program):
        places = [program]
    else:
        folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
        places = [os.path.join(folder, program) for folder in folders if folder]
    found = (place for place in places if os.path.isfile(place) and os.access(place, os.X_OK))
    place = next(found, None)
    return None if place is None else os.path.abspath(place)


def _zig_wheel() -> str | None:
    from importlib.util import find_spec

    spec = find_spec("ziglang")
    if spec is None or spec.origin is None:
        return None
    binary = os.path.join(os.path.dirname(spec.origin), "zig")
    return binary if os.path.isfile(binary) else spec.origin


def _record_name(candidate: _Candidate) -> str:
    """The sha256 of all that the answer depends on: the command, the programs in it, the processor, CC."""
    programs = [candidate.path, *(path for word in candidate.command if (path := which(word)) is not None)]
    stats = [(path, os.stat(path)) for path in programs]
    seen = [(path, stat.st_mtime_ns, stat.st_size) for path, stat in stats]
    parts = [RECORD_FORMAT, candidate.command, seen, cpu_identity(), os.environ.get("CC", "")]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _asked(candidate: _Candidate) -> Toolchain:
    """Ask the compiler for its predefined macros, once for the machine's own target and once for the portable one."""
    chosen_by_user = any(word.startswith(("-march=", "-mcpu=")) for word in candidate.command)
    native_choices: tuple[tuple[str, ...], ...] = (("-march=native",), ("-mcpu=native",), ())
    portable_choices: tuple[tuple[str, ...], ...] = ((),)
    if candidate.is_zig:  # left alone, zig compiles for the machine it runs on
        portable_choices = (("-mcpu=baseline",), ())
    if chosen_by_user:
        native_choices = portable_choices = ((),)
    native, kind, version, _ = _probe(candidate, native_choices)
    portable, _, _, macros = _probe(candidate, portable_choices)
    levels = not chosen_by_user and _knows_levels(kind, macros)
    return Toolchain(candidate.path, kind, version, candidate.command, native, portable, levels)


def _knows_levels(kind: str, macros: dict[str, str]) -> bool:
    version = macros.get("__GNUC__" if kind == "gcc" else "__clang_major__", "0")
    family = "apple" if "__apple_build_version__" in macros else kind
    return "__x86_64__" in macros and version.isdigit() and int(version) >= LEVELS_SINCE.get(family, 1 << 30)


def _probe(candidate: _Candidate, choices: Sequence[tuple[str, ...]]) -> tuple[Target, str, str, dict[str, str]]:
    """(target, kind, version line, predefined macros) under the first of several flag choices that are accepted."""
    for flags in choices:
        command = (*candidate.command, *flags, "-v", "-dM", "-E", "-x", "c", os.devnull)
        try:
            answer = run_compiler(command)
        except OSError as problem:
            raise _ProbeError(str(problem)) from None
        macros = dict(line.split(" ", 2)[1:3] for line in answer.stdout.splitlines() if line.count(" ") >= 2)
        if answer.returncode == 0 and "__STDC__" in macros:
            kind = "zig" if candidate.is_zig else "clang" if "__clang__" in macros else "gcc"
            return _target(flags, macros, answer.stderr), kind, _version_line(macros, answer.stderr), macros
    said = answer.stderr.strip().splitlines()
    telling = [line for line in said if "error" in line] or said[-1:] or ["nothing"]
    raise _ProbeError(f"exit status {answer.returncode}, it said: {telling[0]}")


def _target(flags: tuple[str, ...], macros: dict[str, str], stderr: str) -> Target:
    import re

    triples = re.findall(r"^Target: *(\S+)", stderr, re.MULTILINE)
    # gcc passes -march=znver4 and clang -target-cpu znver4 to the compiler proper; the last one holds
    processors = re.findall(r'(?:"?-target-cpu"? |-m(?:arch|cpu)=)"?([A-Za-z0-9_.+-]+)', stderr)
    resolved = [name for name in processors if name not in ("native", "baseline")]
    widths = {"__AVX512F__": 64, "__AVX__": 32, "__SSE2__": 16, "__ARM_NEON": 16, "__ALTIVEC__": 16}
    return Target(
        flags=flags,
        triple=triples[-1] if triples else "unknown",
        cpu=resolved[-1] if resolved else "unknown",
        vector_bytes=max((width for name, width in widths.items() if name in macros), default=0),
        fingerprint=hashlib.sha256(json.dumps(sorted(macros.items())).encode()).hexdigest(),
    )


def _version_line(macros: dict[str, str], stderr: str) -> str:
    lines = [line.strip() for line in stderr.splitlines() if " version " in line and not line.startswith("Found")]
    return lines[0] if lines else macros.get("__VERSION__", "unknown").strip('"')


def _remedy_lines() -> str:
    return "".join(f"\n    {number}. {remedy}" for number, remedy in enumerate(REMEDIES, 1))


def _not_found_message(refused: Sequence[str]) -> str:
    setting = os.environ.get("CC", "").strip()
    if setting:
        return f"{refused[0]}\n  Correct CC, or unset it to search {', '.join(NAMES_ON_PATH)}, or:{_remedy_lines()}"
    searched = f"CC (not set); {', '.join(NAMES_ON_PATH)} on PATH ({os.environ.get('PATH', '')}); the ziglang wheel"
    found = "".join(f"\n    {line}" for line in refused)
    return f"no C compiler found\n  searched: {searched}{found}\n  remedies:{_remedy_lines()}"
