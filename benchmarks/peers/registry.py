"""The contestants, in the order of the tables: what each is called, where it is, what it needs, how to get it.

Comes in: nothing. Goes out: ENTRIES. Never done here: an import of any of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from typing import Final


@dataclass(frozen=True, slots=True)
class Entry:
    """One contestant.

    title         its name in tables
    factory       "module:function", a `case.Factory`
    needs         modules that must be there, none for what the project itself needs
    distribution  whose version stands beside it
    threads       whether it can use several
    ours          one of our kernels
    again         whether its start with a kernel in the cache is timed as well
    """

    title: str
    factory: str
    needs: tuple[str, ...] = ()
    distribution: str = ""
    threads: bool = False
    ours: bool = False
    again: bool = False

    def missing(self) -> str:
        """What is not installed and how to install it; "" where nothing is."""
        lacking = [module for module in self.needs if find_spec(module) is None]
        return f"not installed; pip install {self.distribution}" if lacking else ""

    def version(self) -> str:
        """The version of its distribution; "" where it has none of its own."""
        try:
            return metadata.version(self.distribution) if self.distribution else ""
        except metadata.PackageNotFoundError:
            return ""


def _peer(title: str, factory: str, module: str, distribution: str, *, threads: bool = False) -> Entry:
    return Entry(title, f"benchmarks.peers.{factory}", (module,), distribution, threads)


def _ours(title: str, function: str, *, again: bool = False) -> Entry:
    return Entry(title, f"benchmarks.peers.ours:{function}", threads=True, ours=True, again=again)


ENTRIES: Final = (
    _peer("lambdify", "symbolic:lambdify", "sympy", "sympy"),
    _peer("lambdify, cse", "symbolic:lambdify_cse", "sympy", "sympy"),
    _peer("ufuncify", "symbolic:ufuncify", "sympy", "sympy"),
    _peer("numpy by hand", "arrays:numpy_by_hand", "numpy", "numpy"),
    _peer("numexpr", "arrays:numexpr", "numexpr", "numexpr", threads=True),
    _peer("symengine LLVM", "symbolic:symengine_llvm", "symengine", "symengine"),
    _peer("numba", "numba_loops:numba", "numba", "numba", threads=True),
    _peer("JAX", "jax_jit:jax", "jax", "jax", threads=True),
    _peer("Dr.Jit LLVM", "drjit_llvm:drjit", "drjit", "drjit", threads=True),
    _peer("Halide", "halide_jit:halide", "halide", "halide", threads=True),
    _peer("taichi", "taichi_kernel:taichi", "taichi", "taichi", threads=True),
    Entry("C, -O3 -ffast-math", "benchmarks.peers.c_loop:fast_math_loop", threads=True),
    _ours("literal", "literal"),
    _ours("double", "double", again=True),
    _ours("double, baked", "double_baked"),
    _ours("double_inner", "double_inner"),
    _ours("double_inner, baked", "double_inner_baked"),
    _ours("single", "single"),
    _ours("single, baked", "single_baked"),
    _ours("single_inner", "single_inner"),
    _ours("fast", "fast"),
    _ours("fast, baked", "fast_baked"),
)

BASES: Final = {
    ("float64", True): "double, baked",
    ("float64", False): "double",
    ("float32", True): "single, baked",
    ("float32", False): "single",
}
"""(format, baked) -> the contestant that times are compared with."""


def present(entries: Sequence[Entry]) -> tuple[list[Entry], dict[str, str]]:
    """(those that can be asked, why the others cannot by title)"""
    lacking = {entry.title: entry.missing() for entry in entries}
    return [e for e in entries if not lacking[e.title]], {title: why for title, why in lacking.items() if why}
