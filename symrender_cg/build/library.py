"""The folder of one kernel: sources, kernel.so, binding, manifest -> is it whole? -> functions that can be called.

In:  C declarations (write_binding), or a folder that holds a finished build (read_kernel, load).
Out: CachedKernel, and Library with cffi's `lib` and `ffi`.
Never here: a decision about where folders are, a compiler, C parsed when a library is loaded, Python's headers.
The binding is cffi's out-of-line ABI mode: type tables made once with the library. Calls through it release the GIL.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from symrender_cg.build.portable import PICKING_NAME, PROCESSOR_FUNCTION, SCRIPT_NAME, require_asked_processor
from symrender_cg.errors import LibraryError

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

LIBRARY_NAME = "kernel.so"
BINDING_NAME = "binding.py"
CDEF_NAME = "kernel.cdef"
MANIFEST_NAME = "manifest.json"
# Every library that was loaded, by path, inode and time of change.
_opened: dict[tuple[str, int, int], Library] = {}

RESERVED_NAMES = (LIBRARY_NAME, BINDING_NAME, CDEF_NAME, MANIFEST_NAME, PICKING_NAME, SCRIPT_NAME)


@dataclass(frozen=True, slots=True)
class FileEntry:
    """A file of the folder: its name, size in bytes, and sha256."""

    name: str
    bytes: int
    sha256: str


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a kernel folder holds and how it was made. Written last: a folder without it was never finished.

    `identity` stands for the toolchain with its resolved target and flags, `machine` for the processor and flags
    alone; `toolchain` is the compiler's whole record as text.
    """

    key: str
    identity: str
    machine: str
    toolchain: str
    portable: bool
    extra_flags: tuple[str, ...]
    sources: tuple[str, ...]
    files: tuple[FileEntry, ...]
    command: tuple[str, ...]
    seconds: float

    def to_json(self) -> str:
        """The text of manifest.json."""
        return json.dumps(asdict(self), indent=1)

    @staticmethod
    def from_json(text: str) -> Manifest | None:
        """The manifest of a text; None for one that is cut short or of another make."""
        try:
            read = json.loads(text)
            lists = {name: tuple(read[name]) for name in ("extra_flags", "sources", "command")}
            files = tuple(FileEntry(str(e["name"]), int(e["bytes"]), str(e["sha256"])) for e in read["files"])
            return Manifest(**{**read, **lists, "files": files})
        except (ValueError, KeyError, TypeError):
            return None


@dataclass(frozen=True, slots=True)
class CachedKernel:
    """A kernel folder that is whole. `compile_seconds` is what this call spent in the compiler, 0.0 where nothing."""

    folder: Path
    library_path: Path
    manifest: Manifest
    from_cache: bool
    compile_seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class Library:
    """A loaded library: `lib.<function>(...)`, its `ffi` for buffers and structs, and its path.

    It stays open for the life of the process: cffi would close it with `lib`, and a function taken from it would
    then jump into memory that is gone. Pickling sends the folder, and the other process loads it again.
    """

    lib: Any
    ffi: Any
    path: Path

    @property
    def processor(self) -> str:
        """The build that a portable library runs: x86-64, x86-64-v3 or x86-64-v4; empty for a library of one build."""
        if PROCESSOR_FUNCTION not in dir(self.lib):
            return ""
        return str(self.ffi.string(getattr(self.lib, PROCESSOR_FUNCTION)()).decode())

    def __reduce__(self) -> tuple[object, tuple[Path]]:
        return load, (self.path.parent,)


def cffi_version() -> str:
    """The version of cffi, without the import of its parser."""
    from importlib import import_module

    return str(import_module("_cffi_backend").__version__)


def write_binding(cdef: str, folder: Path) -> Path:
    """folder/binding.py: the type tables of the declarations, for a library to be opened later.

    Raises LibraryError where cffi cannot read the declarations, OSError where the folder cannot be written.
    """
    import cffi
    from cffi.recompiler import make_py_source

    path = folder / BINDING_NAME
    builder = cffi.FFI()
    builder.set_source("binding", None)
    try:
        builder.cdef(cdef)
    except (cffi.CDefError, cffi.FFIError) as problem:
        raise LibraryError(f"the C declarations of the kernel cannot be read by cffi: {problem}") from problem
    make_py_source(builder, "binding", str(path))
    return path


def write_manifest(folder: Path, **facts: Any) -> Manifest:
    """Describe every file of the folder and write manifest.json. The facts are Manifest's other fields."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    files = tuple(FileEntry(path.relative_to(folder).as_posix(), path.stat().st_size, _sha256(path)) for path in paths)
    manifest = Manifest(files=files, **facts)
    (folder / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")
    return manifest


def read_kernel(folder: Path, *, thorough: bool = False) -> CachedKernel | None:
    """The finished kernel in a folder, or None where the manifest is missing or damaged, or a file has another size.

    The quick check costs one read and two stats. `thorough` compares the sha256 of every file as well.
    """
    try:
        manifest = Manifest.from_json((folder / MANIFEST_NAME).read_text(encoding="utf-8"))
        if manifest is None or manifest.key != folder.name:
            return None
        sizes: Mapping[str, int] = {entry.name: entry.bytes for entry in manifest.files}
        for name in (LIBRARY_NAME, BINDING_NAME):
            if (folder / name).stat().st_size != sizes.get(name):
                return None
        if thorough and any(_sha256(folder / entry.name) != entry.sha256 for entry in manifest.files):
            return None
    except (OSError, UnicodeDecodeError):
        return None
    return CachedKernel(folder, folder / LIBRARY_NAME, manifest, from_cache=True, compile_seconds=0.0)


def load(place: Path | CachedKernel) -> Library:
    """Open the library of a folder or of a cached kernel, and look up every function that its binding declares.

    A library that is open already is returned as it is: a path stands for one content, as the cache's names do.
    Raises LibraryError where the binding or the library cannot be read, or lacks an entry point.
    """
    folder = place.folder if isinstance(place, CachedKernel) else place
    path = folder / LIBRARY_NAME
    name = _file_identity(path)
    return _opened.get(name) or _opened.setdefault(name, _open(folder / BINDING_NAME, path))


def _open(binding: Path, path: Path) -> Library:
    ffi = _ffi_of(binding)
    try:
        lib = ffi.dlopen(str(path))
    except OSError as problem:
        raise LibraryError(f"the library {path} cannot be loaded: {problem}") from problem
    for name in dir(lib):
        try:
            getattr(lib, name)
        except (AttributeError, ffi.error) as problem:
            raise LibraryError(f"the library {path} lacks the entry point {name!r}: {problem}") from problem
    opened = Library(lib, ffi, path)
    if opened.processor:
        require_asked_processor(opened.processor)
    return opened


def _ffi_of(path: Path) -> Any:
    """The `ffi` of a binding, whose text is run directly: no entry in sys.modules, no .pyc in a read-only place."""
    namespace: dict[str, Any] = {"__name__": f"symrender_cg_binding_{path.parent.name}"}
    try:
        exec(compile(path.read_bytes(), str(path), "exec"), namespace)
        return namespace["ffi"]
    except (OSError, SyntaxError, ValueError, KeyError, NameError, TypeError, ImportError) as problem:
        raise LibraryError(f"the binding {path} cannot be read: {type(problem).__name__}: {problem}") from problem


def _file_identity(path: Path) -> tuple[str, int, int]:
    try:
        status = path.stat()
    except OSError:
        return str(path), 0, 0  # the attempt to open it will say what is wrong
    return str(path), status.st_ino, status.st_mtime_ns


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
