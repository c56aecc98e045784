"""Polynomials whose exact sign decides hit or miss: the discriminant and m.D, expanded in the inputs."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from symrender_cg.derive.program import ImageProgram
from symrender_cg.derive.symbols import symbol


@dataclass(frozen=True, slots=True)
class Monomial:
    """coefficient times the product of at most four inputs."""

    coefficient: int
    factors: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SignTest:
    """The sign of the sum of these monomials, where no rounding may change it; `strict` asks for > 0, else >= 0."""

    name: str
    strict: bool
    monomials: tuple[Monomial, ...]


def sign_tests(program: ImageProgram) -> tuple[SignTest, ...]:
    """One test for each guarded quantity of the textbook's derivation, a polynomial in the inputs of degree <= 4."""
    return tuple(_test(program, name) for name in program.guard)


def _test(program: ImageProgram, name: str) -> SignTest:
    generators = [symbol(entry) for entry in program.inputs]
    polynomial = sp.Poly(sp.expand(program.closed(name)), *generators)
    monomials = []
    for powers, coefficient in polynomial.terms():
        assert sum(powers) <= 4, f"{name} has a monomial of degree {sum(powers)}"
        factors = tuple(str(g) for g, power in zip(generators, powers, strict=True) for _ in range(power))
        monomials.append(Monomial(int(coefficient), factors))
    return SignTest(name, name != "disc", tuple(monomials))
