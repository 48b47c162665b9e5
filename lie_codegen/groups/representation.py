"""A faithful matrix representation of an algebra given by brackets.

Without a centre the adjoint representation is faithful. With one it is not, and derivations help: for
derivations D_1..D_r the matrices

    rho(x) = [[ad x, D_1 x, ..., D_r x], [0, 0, ..., 0]]

represent the algebra on g + R^r (a derivation is a 1-cocycle of the adjoint module), faithfully if and only if no
central x is killed by all D_i. This covers every algebra with a grading that is positive on the centre, the
Heisenberg, Engel and oscillator algebras among them (a constructive case of Ado's theorem).
"""

from __future__ import annotations

from lie_codegen.algebra.adjoint import ad
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import AlgebraError
from lie_codegen.exact.numbers import Number, domain_matrix, to_numbers
from lie_codegen.on_demand import sympy as sp


def faithful_representation(algebra: LieAlgebra) -> tuple[sp.ImmutableMatrix, ...]:
    """(n) exact matrices whose commutators follow the algebra's brackets, linearly independent.

    Raises:
        AlgebraError: if derivations do not separate the centre; give matrices then.
    """
    n = algebra.dim
    ads = [ad(algebra, i) for i in range(n)]
    centre = _centre(ads)
    if not centre:
        return tuple(sp.ImmutableMatrix(matrix) for matrix in ads)
    chosen = _separating_derivations(algebra, centre)
    size = n + len(chosen)
    matrices = []
    for i in range(n):
        matrix = sp.zeros(size, size)
        matrix[:n, :n] = ads[i]
        for r, derivation in enumerate(chosen):
            matrix[:n, n + r] = derivation[:, i]
        matrices.append(sp.ImmutableMatrix(matrix))
    return tuple(matrices)


def _centre(ads: list[sp.Matrix]) -> list[list[Number]]:
    n = len(ads)
    rows = [[ads[i][k, j] for i in range(n)] for k in range(n) for j in range(n)]
    return to_numbers(domain_matrix(rows).nullspace().to_dense()) if any(map(any, rows)) else _unit_vectors(n)


def _unit_vectors(n: int) -> list[list[Number]]:
    """The unit vectors, exact."""
    return [[sp.Integer(int(i == j)) for j in range(n)] for i in range(n)]


def derivations(algebra: LieAlgebra) -> list[sp.Matrix]:
    """A basis of Der(g): all D with D[x, y] = [Dx, y] + [x, Dy]."""
    n = algebra.dim
    c: dict[tuple[int, int, int], Number] = {(i, j, k): value for i, j, k, value in algebra.constants()}
    zero = sp.S.Zero
    rows = []
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(n):
                row = [zero] * (n * n)
                for m in range(n):
                    row[k * n + m] += c.get((i, j, m), zero)
                    row[m * n + i] -= c.get((m, j, k), zero)
                    row[m * n + j] -= c.get((i, m, k), zero)
                if any(row):
                    rows.append(row)
    solutions = to_numbers(domain_matrix(rows).nullspace().to_dense()) if rows else _unit_vectors(n * n)
    return [sp.Matrix(n, n, solution) for solution in solutions]


def _separating_derivations(algebra: LieAlgebra, centre: list[list[Number]]) -> list[sp.Matrix]:
    """As few derivations as a greedy choice finds, with no common kernel on the centre."""
    n = algebra.dim
    vectors = [sp.Matrix(vector) for vector in centre]
    candidates = derivations(algebra)
    combined = sp.zeros(n, n)
    for weight, candidate in enumerate(candidates, start=1):
        combined += weight * candidate
    chosen: list[sp.Matrix] = []
    rank = 0
    for candidate in [*(d for d in candidates if d.is_diagonal()), combined, *candidates]:
        images = [sp.Matrix.vstack(*((d * v) for d in [*chosen, candidate])) for v in vectors]
        new_rank = int(domain_matrix([list(image) for image in images]).rank())
        if new_rank > rank:
            chosen.append(candidate)
            rank = new_rank
        if rank == len(vectors):
            break
    if rank < len(vectors):
        raise AlgebraError(
            f"{algebra.name}: no faithful matrices found from the brackets alone (its centre is killed by every "
            "derivation); define the group by matrices instead"
        )
    return _without_needless(chosen, vectors)


def _without_needless(chosen: list[sp.Matrix], vectors: list[sp.Matrix]) -> list[sp.Matrix]:
    for derivation in list(chosen):
        fewer = [d for d in chosen if d is not derivation]
        if fewer and domain_matrix([list(sp.Matrix.vstack(*(d * v for d in fewer))) for v in vectors]).rank() == len(
            vectors
        ):
            chosen = fewer
    return chosen
