"""Cell 2 of the document that this project starts from, as it stands: the image as one sympy expression.

Symbolic Rendering, Chapter 1 (Van Warren). The formulas are not to be improved: they are what the derivation and the
kernels are measured against.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache
from typing import Any

import sympy as sp


@dataclass(frozen=True, slots=True)
class SeedImage:
    """Cell 2's expressions, the parameters in the order of Cell 3's `params`, and how long the derivation took."""

    parameters: tuple[Any, ...]
    A: Any
    disc: Any
    t_hit: Any
    ndl: Any
    rdv: Any
    I_shade: Any
    I_img: Any
    seconds: float

    def swell(self) -> dict[str, int]:
        """Cell 2's swell meter: operations of each expression as it stands."""
        named = {"t_hit": self.t_hit, "ndl": self.ndl, "rdv": self.rdv, "I_shade": self.I_shade, "I_img": self.I_img}
        return {name: int(sp.count_ops(value)) for name, value in named.items()}


@cache
def cell_2() -> SeedImage:
    """I(x, y) = Piecewise((k_a + k_d max(0, n.l) + k_s max(0, r.v)^n, disc >= 0), (0, True)), derived by Cell 2."""
    start = time.perf_counter()
    x, y = sp.symbols("x y", real=True)
    R, e = sp.symbols("R e", positive=True)
    lx, ly, lz = sp.symbols("l_x l_y l_z", real=True)
    ka, kd, ks, n = sp.symbols("k_a k_d k_s n", positive=True)
    E = sp.Matrix([0, 0, e])
    D = sp.Matrix([x, y, -e])
    A = D.dot(D)
    b = E.dot(D)
    c = e**2 - R**2
    disc = sp.expand(b**2 - A * c)
    t_hit = sp.simplify((-b - sp.sqrt(disc)) / A)
    P = (E + t_hit * D).applyfunc(sp.simplify)
    N = P / R
    L = sp.Matrix([lx, ly, lz])
    w = L - P
    w_hat = w / sp.sqrt(w.dot(w))
    v_hat = -D / sp.sqrt(A)
    ndl = sp.simplify(N.dot(w_hat))
    r_vec = 2 * ndl * N - w_hat
    rdv = sp.simplify(r_vec.dot(v_hat))
    I_shade = ka + kd * sp.Max(0, ndl) + ks * sp.Max(0, rdv) ** n
    I_img = sp.Piecewise((I_shade, disc >= 0), (0, True))
    parameters = (x, y, R, e, lx, ly, lz, ka, kd, ks, n)
    return SeedImage(parameters, A, disc, t_hit, ndl, rdv, I_shade, I_img, time.perf_counter() - start)
