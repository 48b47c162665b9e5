"""What an invariant bilinear form says about the entries of matrices.

If A^T S + S A = 0 for a symmetric S, then (S M)^T = +- S M for every even (odd) function M of A. Where the rows i and s(i) of S have a
single nonzero entry, S_{i s(i)}, that reads M_{a j} = +- (S_{j s(j)} / S_{a s(a)}) M_{s(j) s(a)}: half of the entries follow from
the others.
"""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.exact.numbers import Number
from lie_codegen.on_demand import sympy as sp

#: (a, j) -> ((k, l), factor): M_aj = factor M_kl for even functions, - factor M_kl for odd ones.
Relation = dict[tuple[int, int], tuple[tuple[int, int], Number]]


def entry_relation(form: sp.MatrixBase) -> Relation:
    """The relation between entries that a symmetric invariant form gives; empty where it gives none."""
    single: dict[int, tuple[int, Number]] = {}
    for i, row in enumerate(form.tolist()):
        places = [(j, value) for j, value in enumerate(row) if value != 0]
        if len(places) == 1:
            single[i] = places[0]
    # Row s(a) must be single too: M_aj is read off row s(a) of S M.
    single = {i: (j, value) for i, (j, value) in single.items() if j in single}
    return {
        (a, j): ((single[j][0], single[a][0]), sp.radsimp(single[j][1] / single[a][1])) for a in single for j in single
    }


def matrix_relation(matrices: Sequence[sp.MatrixBase]) -> Relation:
    """The relation of antisymmetric matrices, M_ij = +- M_ji; empty for others."""
    if any(not (m + m.T).is_zero_matrix for m in matrices):
        return {}
    return entry_relation(sp.eye(int(matrices[0].rows)))
