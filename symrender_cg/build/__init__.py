"""C text -> a loaded native library: compiler, flags, content-addressed cache, binding.

In:  sources and declarations as text. Out: CachedKernel, and Library with functions to call.
Never here: sympy, templates, numpy, or a process on a warm start. Silence neither: every failure shows its command.
Beside these names, imported by those who ask: `portable` (the builds of one library for every processor of a kind),
`vectorisation` (which loops became vector code), `reports` (the same for processors that are not here), `instructions`
(the arithmetic of a loop, counted in its assembly) and `diagnosis` (what `doctor` prints).
"""

from symrender_cg.build.cache import Cache, CacheSize, CacheWarning, default_root
from symrender_cg.build.compile import CompileRecord, compile_library, kernel_flags, project_flags
from symrender_cg.build.library import CachedKernel, FileEntry, Library, Manifest, load, write_binding
from symrender_cg.build.toolchain import Target, Toolchain, find_toolchain

__all__ = [
    "Cache",
    "CacheSize",
    "CacheWarning",
    "CachedKernel",
    "CompileRecord",
    "FileEntry",
    "Library",
    "Manifest",
    "Target",
    "Toolchain",
    "compile_library",
    "default_root",
    "find_toolchain",
    "kernel_flags",
    "load",
    "project_flags",
    "write_binding",
]
