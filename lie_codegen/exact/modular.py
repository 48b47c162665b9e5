"""Exact numbers modulo a large prime, for fast tests of polynomial identities.

A number field is mapped into the prime field by sending its generator to a root of its minimal polynomial, a transcendental
such as pi to a fixed arbitrary residue. An identity that fails is seen to fail at a random point with a probability of at least 1 - degree / 2^61 (Schwartz and Zippel).
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from lie_codegen.exact.numbers import Number, field_elements
from lie_codegen.on_demand import sympy as sp

#: The first prime tried, a Mersenne prime.
_PRIME = 2**61 - 1
_MOST_PRIMES = 200


def modular_images(values: Sequence[Number]) -> tuple[int, list[int]] | None:
    """A prime p and the residues of the values, or None if the field they live in is of no kind treated here."""
    domain, elements = field_elements(values)
    if domain.is_QQ:
        return _PRIME, [_rational(_PRIME, value) for value in elements]
    if getattr(domain, "is_AlgebraicField", False):
        return _algebraic(domain, elements)
    if domain.is_FractionField and (domain.dom.is_QQ or domain.dom.is_ZZ):
        residues = random_point(random.Random(0), _PRIME, domain.ngens)
        return _PRIME, [_quotient(_PRIME, residues, element) for element in elements]
    return None


def _algebraic(domain: Any, elements: Sequence[Any]) -> tuple[int, list[int]] | None:
    modulus = [domain.dom.to_sympy(c) for c in domain.mod.to_list()]
    denominator = 1
    for c in modulus:
        denominator *= int(c.q)
    integers = [int(c * denominator) for c in modulus]
    prime = _PRIME
    for _ in range(_MOST_PRIMES):
        factors = sp.polys.galoistools.gf_factor(
            sp.polys.galoistools.gf_from_int_poly(integers, prime), prime, sp.polys.domains.ZZ
        )[1]
        root = next((-int(f[1]) % prime for f, _ in factors if len(f) == 2), None)
        if root is not None:
            return prime, [_evaluated(prime, root, domain, element) for element in elements]
        prime = int(sp.nextprime(prime))
    return None


def _evaluated(prime: int, root: int, domain: Any, element: Any) -> int:
    total = 0
    for c in element.to_list():
        total = (total * root + _rational(prime, c)) % prime
    return total


def _quotient(prime: int, residues: list[int], element: Any) -> int:
    """A rational function of the generators at the residues."""
    above, below = (
        sum(_rational(prime, c) * _monomial(prime, residues, powers) for powers, c in part.terms()) % prime
        for part in (element.numer, element.denom)
    )
    return above * pow(below, -1, prime) % prime


def _monomial(prime: int, residues: list[int], powers: Sequence[int]) -> int:
    total = 1
    for residue, power in zip(residues, powers, strict=True):
        total = total * pow(residue, power, prime) % prime
    return total


def _rational(prime: int, value: Any) -> int:
    return int(value.numerator) * pow(int(value.denominator), -1, prime) % prime


def random_point(rng: random.Random, prime: int, size: int) -> list[int]:
    """Residues, uniform."""
    return [rng.randrange(prime) for _ in range(size)]
