"""Sources -> the folder of a built kernel, built at most once; a recipe -> a kernel that was built for it before.

In:  C texts and declarations, or a caller's recipe string. Out: CachedKernel, and the payload stored with a recipe.
Never here: sympy, a lock file, a half-written entry, or a failure that outlives the call that met it.

    <root>/kernels/<sha256>/      sources, kernel.so, binding.py, kernel.cdef, manifest.json
    <root>/recipes/<sha256>.json  recipe -> key of a kernel, and a payload
    <root>/toolchains/<sha256>.json   what a compiler said about itself

The root is the argument, else SYMRENDER_CACHE_DIR, else the user's cache folder. An entry is built under a name that
starts with a dot and appears by one atomic rename, so that others see all of it or nothing. A root that cannot be
written is replaced, for the life of the process and with one CacheWarning, by a temporary folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from symrender_cg.build import library
from symrender_cg.build.compile import compile_library, kernel_flags, project_flags
from symrender_cg.build.library import CachedKernel, Library, read_kernel
from symrender_cg.build.portable import binding_text, fingerprint
from symrender_cg.build.toolchain import RecordStore, Toolchain, cpu_identity, find_toolchain
from symrender_cg.errors import ArgumentError, CompileError, CompilerNotFoundError, LibraryError

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

FORMAT = 2
ABANDONED_SECONDS = 3600.0  # a build that is still under a dotted name after an hour was killed
PUBLISH_ATTEMPTS = 8

# Keyed by process id: a child of fork must not wait for a lock that a thread of its parent held.
_build_locks: dict[tuple[int, str], threading.Lock] = {}
_substitutes: dict[tuple[int, str], Path] = {}


class CacheWarning(UserWarning):
    """The cache cannot be written; names the place and the reason. Results are right, the next start compiles again."""


@dataclass(frozen=True, slots=True)
class CacheSize:
    """How much a cache holds: kernels, recipes, and bytes on disk in all its files."""

    kernels: int
    recipes: int
    bytes: int


def default_root() -> Path:
    """SYMRENDER_CACHE_DIR, else the user's cache folder as platformdirs gives it."""
    setting = os.environ.get("SYMRENDER_CACHE_DIR", "").strip()
    if setting:
        return Path(setting).absolute()
    if sys.platform == "linux":
        # platformdirs' own answer, without its import (10 ms of every start): XDG Base Directory Specification
        base = os.environ.get("XDG_CACHE_HOME", "").strip() or os.path.expanduser("~/.cache")
        if os.path.isabs(base):
            return Path(base, "symrender_cg")
    import platformdirs

    return Path(platformdirs.user_cache_dir("symrender_cg"))


class Cache:
    """Kernels and recipes under one root, shared by any number of threads and processes. Making one touches no file."""

    def __init__(self, root: Path | str | None = None) -> None:
        self.root = default_root() if root is None else Path(root).absolute()
        self._records = _DiskRecords(self)

    def toolchain(self) -> Toolchain:
        """The compiler, from this cache's record where it holds one (then no process is run).

        Raises CompilerNotFoundError.
        """
        return find_toolchain(records=self._records)

    def kernel(
        self,
        sources: Mapping[str, str],
        cdef: str,
        *,
        toolchain: Toolchain | None = None,
        portable: bool = False,
        extra_flags: Sequence[str] = (),
    ) -> CachedKernel:
        """The kernel of these sources (file name -> text, headers included), compiled unless the cache has it.

        The key is the sha256 of the texts, the declarations, the compiler's path and version, the resolved target and
        flags, and cffi's version. Raises CompileError, after removing all traces; CompilerNotFoundError; LibraryError
        for declarations that cffi cannot read; ArgumentError for file names that cannot be used.
        """
        reserved = sorted(set(sources) & set(library.RESERVED_NAMES))
        if reserved:
            raise ArgumentError(f"sources[{reserved[0]!r}]: the cache writes a file of that name; choose another one")
        chosen = self.toolchain() if toolchain is None else toolchain
        job = _Job(dict(sources), cdef, chosen, portable, tuple(extra_flags))
        key = job.key()
        found = self._find(key)
        if found is not None:
            return found
        with _build_locks.setdefault((os.getpid(), key), threading.Lock()):
            return self._find(key) or self._build(job, key)

    def load(self, kernel: CachedKernel) -> Library:
        """The kernel's library, loaded; one that was damaged on disk is first built again from its own sources.

        Raises LibraryError where the library is as it was built and yet cannot be loaded, or cannot be rebuilt.
        """
        try:
            return library.load(kernel)
        except LibraryError:
            if read_kernel(kernel.folder, thorough=True) is not None:
                raise
        return library.load(self._rebuild(kernel))

    def recall(
        self,
        recipe: str,
        *,
        toolchain: Toolchain | None = None,
        portable: bool = False,
        extra_flags: Sequence[str] = (),
    ) -> tuple[CachedKernel, Any] | None:
        """The kernel and payload remembered for a recipe under the compiler and flags that would be used now, or None.

        Where no compiler is installed any longer, what was built for this processor is still found.
        """
        try:
            identity = _identity(toolchain or self.toolchain(), portable, extra_flags)
        except CompilerNotFoundError:
            if os.environ.get("CC", "").strip():
                return None  # a CC that does not work is for kernel() to report, never to be passed over
            identity = _machine_identity(portable, extra_flags)
        for place in self._places():
            entry = _read_recipe(place / "recipes" / _recipe_name(recipe, identity))
            kernel = None if entry is None else read_kernel(place / "kernels" / entry[0])
            if entry is not None and kernel is not None:
                return kernel, entry[1]
        return None

    def remember(self, recipe: str, kernel: CachedKernel, payload: Any) -> None:
        """Let recall(recipe) find the kernel and the payload (JSON: tuples come back as lists), beside the kernel.

        Raises TypeError for a payload that JSON cannot hold.
        """
        text = json.dumps({"format": FORMAT, "kernel": kernel.manifest.key, "payload": payload, "recipe": recipe})
        recipes = kernel.folder.parent.parent / "recipes"
        try:
            recipes.mkdir(parents=True, exist_ok=True)
            for identity in (kernel.manifest.identity, kernel.manifest.machine):
                _write_whole(recipes / _recipe_name(recipe, identity), text)
        except OSError as problem:
            self._substitute(problem)

    def size(self) -> CacheSize:
        """Kernels, recipes and bytes under the root; zeros where there is no such folder."""
        kernels = sum(1 for path in _children(self.root / "kernels") if not path.name.startswith("."))
        recipes = sum(1 for path in _children(self.root / "recipes") if path.suffix == ".json")
        files = (path for part in ("kernels", "recipes", "toolchains") for path in (self.root / part).rglob("*"))
        return CacheSize(kernels, recipes, sum(_bytes(path) for path in files))

    def clear(self) -> CacheSize:
        """Remove every entry, nothing else under the root, and return what there was. Loaded libraries stay usable."""
        before = self.size()
        for part in ("recipes", "kernels", "toolchains", "cost"):
            for path in _children(self.root / part):
                _discard(path)
        self._records.forget()
        return before

    def problem(self) -> str | None:
        """Why this root cannot be written, or None where it can: found by writing a file and removing it."""
        kernels = self.root / "kernels"
        try:
            kernels.mkdir(parents=True, exist_ok=True)
            probe = kernels / _unused_name("probe")
            probe.write_bytes(b"probe")
            probe.unlink()
        except OSError as problem:
            return str(problem)
        return None

    def _places(self) -> Iterator[Path]:
        substitute = _substitutes.get((os.getpid(), str(self.root)))
        if substitute is not None:
            yield substitute
        yield self.root

    def _find(self, key: str, *, thorough: bool = False) -> CachedKernel | None:
        kernels = (read_kernel(place / "kernels" / key, thorough=thorough) for place in self._places())
        return next((kernel for kernel in kernels if kernel is not None), None)

    def _build(self, job: _Job, key: str) -> CachedKernel:
        try:
            return _build_under(self.root, job, key)
        except OSError as problem:
            reason: Exception = problem
        except CompileError as problem:
            if "No space left on device" not in problem.stderr:
                raise
            reason = OSError("the compiler found no space left on the device")
        return _build_under(self._substitute(reason), job, key)

    def _rebuild(self, kernel: CachedKernel) -> CachedKernel:
        manifest = kernel.manifest
        toolchain = Toolchain.from_json(manifest.toolchain)
        try:
            texts = {name: (kernel.folder / name).read_bytes().decode() for name in manifest.sources}
            cdef = (kernel.folder / library.CDEF_NAME).read_bytes().decode()
        except (OSError, UnicodeDecodeError):
            toolchain = None
        _discard(kernel.folder)
        if toolchain is not None:
            job = _Job(texts, cdef, toolchain, manifest.portable, manifest.extra_flags)
            if job.key() == manifest.key:
                with _build_locks.setdefault((os.getpid(), manifest.key), threading.Lock()):
                    return self._find(manifest.key, thorough=True) or self._build(job, manifest.key)
        raise LibraryError(f"the cached kernel {kernel.folder} was damaged and is removed; run the same command again")

    def _substitute(self, reason: Exception) -> Path:
        """A temporary folder in place of the root, one a process, removed at exit. Warns when it is made."""
        name = (os.getpid(), str(self.root))
        known = _substitutes.get(name)
        if known is not None:
            return known
        import atexit
        import tempfile

        made = Path(tempfile.mkdtemp(prefix="symrender_cg-"))
        atexit.register(_remove_at_exit, made, os.getpid())
        chosen = _substitutes.setdefault(name, made)
        if chosen is made:
            warnings.warn(
                f"the cache {self.root} cannot be written ({reason}); this process keeps its kernels in a temporary "
                "folder and the next one compiles again. Set SYMRENDER_CACHE_DIR to a folder that can be written.",
                CacheWarning,
                stacklevel=4,
            )
        return chosen


class _DiskRecords(RecordStore):
    """Toolchain records under the cache's root; in memory alone where that cannot be written."""

    def __init__(self, cache: Cache) -> None:
        self._folder = cache.root / "toolchains"
        self._memory: dict[str, str] = {}

    def read(self, name: str) -> str | None:
        try:
            return self._memory.get(name) or (self._folder / f"{name}.json").read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            return None

    def write(self, name: str, text: str) -> None:
        self._memory[name] = text
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            _write_whole(self._folder / f"{name}.json", text)
        except OSError:
            return  # kernel() meets the same obstacle and warns

    def forget(self) -> None:
        self._memory.clear()


@dataclass(frozen=True, slots=True)
class _Job:
    sources: dict[str, str]
    cdef: str
    toolchain: Toolchain
    portable: bool
    extra_flags: tuple[str, ...]

    def key(self) -> str:
        """sha256 of all that decides the bytes of the library and of its binding."""
        identity = _identity(self.toolchain, self.portable, self.extra_flags)
        return _digest([FORMAT, sorted(self.sources.items()), self.cdef, identity])


def _identity(toolchain: Toolchain, portable: bool, extra_flags: Sequence[str]) -> str:
    target = toolchain.target(portable)
    flags = kernel_flags(toolchain, portable, extra_flags)
    compiler = [toolchain.path, toolchain.kind, toolchain.version, toolchain.command]
    builds = fingerprint(toolchain) if portable else ""
    return _digest([compiler, target.cpu, target.fingerprint, flags, builds, library.cffi_version()])


def _machine_identity(portable: bool, extra_flags: Sequence[str]) -> str:
    flags = [*project_flags(), *extra_flags]
    return _digest(["any compiler", cpu_identity(), portable, flags, library.cffi_version()])


def _digest(parts: list[Any]) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _recipe_name(recipe: str, identity: str) -> str:
    return f"{_digest([FORMAT, recipe, identity])}.json"


def _read_recipe(path: Path) -> tuple[str, Any] | None:
    try:
        entry = json.loads(path.read_bytes())
        return str(entry["kernel"]), entry["payload"]
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _build_under(root: Path, job: _Job, key: str) -> CachedKernel:
    """Build in a dotted folder beside the target, then publish. Whatever happens, the dotted folder is gone after."""
    kernels = root / "kernels"
    kernels.mkdir(parents=True, exist_ok=True)
    _remove_abandoned(kernels)
    folder = kernels / _unused_name("building")
    folder.mkdir()
    try:
        record = compile_library(
            job.sources,
            folder / library.LIBRARY_NAME,
            toolchain=job.toolchain,
            portable=job.portable,
            extra_flags=job.extra_flags,
            declarations=job.cdef,
        )
        library.write_binding(binding_text(job.cdef, job.toolchain, portable=job.portable), folder)
        (folder / library.CDEF_NAME).write_bytes(job.cdef.encode())
        manifest = library.write_manifest(
            folder,
            key=key,
            identity=_identity(job.toolchain, job.portable, job.extra_flags),
            machine=_machine_identity(job.portable, job.extra_flags),
            toolchain=job.toolchain.to_json(),
            portable=job.portable,
            extra_flags=job.extra_flags,
            sources=tuple(sorted(job.sources)),
            command=record.command,
            seconds=record.seconds,
        )
        target = kernels / key
        built = CachedKernel(target, target / library.LIBRARY_NAME, manifest, False, record.seconds)
        return _publish(folder, built)
    finally:
        _remove(folder)


def _publish(folder: Path, built: CachedKernel) -> CachedKernel:
    """Rename to the final name. A whole entry that is there already wins; a damaged one is moved out of the way."""
    for _ in range(PUBLISH_ATTEMPTS):
        try:
            os.rename(folder, built.folder)
            return built
        except OSError:
            if not os.path.lexists(built.folder):
                raise
        present = read_kernel(built.folder, thorough=True)
        if present is not None:
            return replace(present, compile_seconds=built.compile_seconds)
        _discard(built.folder)
    raise OSError(f"{built.folder} cannot be replaced")


def _write_whole(path: Path, text: str) -> None:
    """Write a file that others see whole or not at all."""
    unfinished = path.parent / _unused_name(path.stem[:16])
    try:
        unfinished.write_text(text, encoding="utf-8")
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def _unused_name(purpose: str) -> str:
    return f".{purpose}-{os.getpid()}-{os.urandom(6).hex()}"


def _discard(path: Path) -> None:
    """Make an entry disappear at once for every reader, then remove it."""
    aside = path.parent / _unused_name("removed")
    try:
        os.rename(path, aside)
    except OSError:
        return  # another process was faster, or the place is read-only
    _remove(aside)


def _remove(path: Path) -> None:
    if path.is_dir():
        import shutil

        shutil.rmtree(path, ignore_errors=True)
        return
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return


def _remove_abandoned(folder: Path) -> None:
    oldest = time.time() - ABANDONED_SECONDS
    for path in _children(folder):
        if path.name.startswith(".") and _modified(path) < oldest:
            _remove(path)


def _remove_at_exit(folder: Path, owner: int) -> None:
    if os.getpid() == owner:
        _remove(folder)


def _children(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _bytes(path: Path) -> int:
    try:
        return path.stat().st_size if path.is_file() else 0
    except OSError:
        return 0


def _modified(path: Path) -> float:
    try:
        return path.lstat().st_mtime
    except OSError:
        return float("inf")
