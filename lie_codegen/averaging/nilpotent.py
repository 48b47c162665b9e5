"""The step of a nilpotent Lie algebra, from its lower central series."""

from __future__ import annotations

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.exact.numbers import Number, domain_matrix
from lie_codegen.on_demand import sympy as sp


def nilpotency_step(algebra: LieAlgebra) -> int | None:
    """The smallest s with every bracket of s + 1 elements zero; None if there is none."""
    unit = [{i: sp.S.One} for i in range(algebra.dim)]
    layer: list[dict[int, Number]] = list(unit)
    for step in range(1, algebra.dim + 1):
        images = [image for a in unit for b in layer if (image := algebra.bracket(a, b))]
        if not images:
            return step
        reduced = _basis(algebra, images)
        if len(reduced) == len(layer):
            return None
        layer = reduced
    return None


def _basis(algebra: LieAlgebra, vectors: list[dict[int, Number]]) -> list[dict[int, Number]]:
    """Independent vectors with the same span."""
    rows = [[vector.get(k, sp.S.Zero) for k in range(algebra.dim)] for vector in vectors]
    _, pivots = domain_matrix(rows).transpose().rref()
    return [vectors[p] for p in pivots]
