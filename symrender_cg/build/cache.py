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

import json
import os
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from symrender_cg.build import library
from symrender_cg.build.entries import FORMAT, BuildJob, build_under, identity_of, machine_identity, recipe_name
from symrender_cg.build.files import children, discard, remove_at_exit, size_of, unused_name, write_whole
from symrender_cg.build.library import CachedKernel, Library, read_kernel
from symrender_cg.build.toolchain import RecordStore, Toolchain, find_toolchain
from symrender_cg.errors import ArgumentError, CompileError, CompilerNotFoundError, LibraryError

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

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
        job = BuildJob(dict(sources), cdef, chosen, portable, tuple(extra_flags))
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
            identity = identity_of(toolchain or self.toolchain(), portable, extra_flags)
        except CompilerNotFoundError:
            if os.environ.get("CC", "").strip():
                return None  # a CC that does not work is for kernel() to report, never to be passed over
            identity = machine_identity(portable, extra_flags)
        for place in self._places():
            entry = _read_recipe(place / "recipes" / recipe_name(recipe, identity))
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
                write_whole(recipes / recipe_name(recipe, identity), text)
        except OSError as problem:
            self._substitute(problem)

    def size(self) -> CacheSize:
        """Kernels, recipes and bytes under the root; zeros where there is no such folder."""
        kernels = sum(1 for path in children(self.root / "kernels") if not path.name.startswith("."))
        recipes = sum(1 for path in children(self.root / "recipes") if path.suffix == ".json")
        files = (path for part in ("kernels", "recipes", "toolchains") for path in (self.root / part).rglob("*"))
        return CacheSize(kernels, recipes, sum(size_of(path) for path in files))

    def clear(self) -> CacheSize:
        """Remove every entry, nothing else under the root, and return what there was. Loaded libraries stay usable."""
        before = self.size()
        for part in ("recipes", "kernels", "toolchains", "cost"):
            for path in children(self.root / part):
                discard(path)
        self._records.forget()
        return before

    def problem(self) -> str | None:
        """Why this root cannot be written, or None where it can: found by writing a file and removing it."""
        kernels = self.root / "kernels"
        try:
            kernels.mkdir(parents=True, exist_ok=True)
            probe = kernels / unused_name("probe")
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

    def _build(self, job: BuildJob, key: str) -> CachedKernel:
        try:
            return build_under(self.root, job, key)
        except OSError as problem:
            reason: Exception = problem
        except CompileError as problem:
            if "No space left on device" not in problem.stderr:
                raise
            reason = OSError("the compiler found no space left on the device")
        return build_under(self._substitute(reason), job, key)

    def _rebuild(self, kernel: CachedKernel) -> CachedKernel:
        manifest = kernel.manifest
        toolchain = Toolchain.from_json(manifest.toolchain)
        try:
            texts = {name: (kernel.folder / name).read_bytes().decode() for name in manifest.sources}
            cdef = (kernel.folder / library.CDEF_NAME).read_bytes().decode()
        except (OSError, UnicodeDecodeError):
            toolchain = None
        discard(kernel.folder)
        if toolchain is not None:
            job = BuildJob(texts, cdef, toolchain, manifest.portable, manifest.extra_flags)
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
        atexit.register(remove_at_exit, made, os.getpid())
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
            write_whole(self._folder / f"{name}.json", text)
        except OSError:
            return  # kernel() meets the same obstacle and warns

    def forget(self) -> None:
        self._memory.clear()


def _read_recipe(path: Path) -> tuple[str, Any] | None:
    try:
        entry = json.loads(path.read_bytes())
        return str(entry["kernel"]), entry["payload"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
