"""One entry of the cache: what decides its bytes and so its key, how it is built, how it appears.

In: sources, declarations, a toolchain and flags. Out: a key; or the entry's folder, published by one rename. Never
here: a look for an entry that may be there already (cache.py), or a half-written one.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from symrender_cg.build import library
from symrender_cg.build.compile import compile_library, kernel_flags, project_flags
from symrender_cg.build.files import discard, remove, remove_abandoned, unused_name
from symrender_cg.build.library import CachedKernel, read_kernel
from symrender_cg.build.portable import binding_text, fingerprint
from symrender_cg.build.toolchain import Toolchain, cpu_identity

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

FORMAT = 2
"""Of entries and recipes on disk; a cache of another format is passed over."""
PUBLISH_ATTEMPTS = 8


@dataclass(frozen=True, slots=True)
class BuildJob:
    """What an entry is built from: file name -> text, declarations, compiler, flags."""

    sources: dict[str, str]
    cdef: str
    toolchain: Toolchain
    portable: bool
    extra_flags: tuple[str, ...]

    def key(self) -> str:
        """sha256 of all that decides the bytes of the library and of its binding."""
        identity = identity_of(self.toolchain, self.portable, self.extra_flags)
        return digest([FORMAT, sorted(self.sources.items()), self.cdef, identity])


def identity_of(toolchain: Toolchain, portable: bool, extra_flags: Sequence[str]) -> str:
    """A digest of all that decides a library beside its texts: compiler, target, flags, cffi's version."""
    target = toolchain.target(portable)
    flags = kernel_flags(toolchain, portable, extra_flags)
    compiler = [toolchain.path, toolchain.kind, toolchain.version, toolchain.command]
    builds = fingerprint(toolchain) if portable else ""
    return digest([compiler, target.cpu, target.fingerprint, flags, builds, library.cffi_version()])


def machine_identity(portable: bool, extra_flags: Sequence[str]) -> str:
    """The same without a compiler: what is enough to load a library that was built on this processor."""
    flags = [*project_flags(), *extra_flags]
    return digest(["any compiler", cpu_identity(), portable, flags, library.cffi_version()])


def digest(parts: list[Any]) -> str:
    """sha256 of some JSON, as hexadecimal digits."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def recipe_name(recipe: str, identity: str) -> str:
    """The name of the file that remembers a recipe under an identity."""
    return f"{digest([FORMAT, recipe, identity])}.json"


def build_under(root: Path, job: BuildJob, key: str) -> CachedKernel:
    """Build in a dotted folder beside the target, then publish. Whatever happens, the dotted folder is gone after."""
    kernels = root / "kernels"
    kernels.mkdir(parents=True, exist_ok=True)
    remove_abandoned(kernels)
    folder = kernels / unused_name("building")
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
            identity=identity_of(job.toolchain, job.portable, job.extra_flags),
            machine=machine_identity(job.portable, job.extra_flags),
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
        remove(folder)


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
        discard(built.folder)
    raise OSError(f"{built.folder} cannot be replaced")
