"""exp(x A) from exact minimal polynomials: every entry to full relative precision, against mpmath."""

from __future__ import annotations

import mpmath as mp
import pytest
import sympy as sp

from lie_codegen.exact.exponential import matrix_exponential
from lie_codegen.groups.wei_norman.exponential_entries import ExponentialEntries
from lie_codegen.kernel.arithmetic import FloatArithmetic

_P = sp.Matrix([[1, 2, 1], [0, 1, 3], [2, 1, 1]])


def conjugate(rows: list[list[int]]) -> sp.Matrix:
    return _P * sp.Matrix(rows) * _P.inv()


MATRICES = {
    "no roots in radicals": sp.Matrix([[0, 1, 0], [0, 0, 1], [1, 1, 0]]),
    "screw": sp.Matrix([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 0, 1], [0, 0, 0, 0]]),
    "real quadratic": sp.Matrix([[1, 2], [3, -1]]),
    "boost": sp.Matrix([[0, 1, 0], [1, 0, 0], [0, 0, 0]]),
    "spiral": sp.Matrix([[1, 0, 0], [0, 1, -2], [0, 2, 1]]),
    "Jordan block": sp.Matrix([[1, 1, 0], [0, 1, 1], [0, 0, 2]]),
    "double complex pair": sp.Matrix([[0, -1, 1, 0], [1, 0, 0, 1], [0, 0, 0, -1], [0, 0, 1, 0]]),
    "nilpotent": sp.Matrix([[0, 1, 0], [0, 0, 1], [0, 0, 0]]),
    "mixed rotation": conjugate([[0, -1, 0], [1, 0, 0], [0, 0, 0]]),
    "mixed boost": conjugate([[0, 1, 0], [1, 0, 0], [0, 0, 0]]),
    "mixed spiral": conjugate([[1, 0, 0], [0, 1, -2], [0, 2, 1]]),
    "zero": sp.zeros(2, 2),
}


@pytest.mark.parametrize("name", sorted(MATRICES))
def test_every_entry_has_full_relative_precision(name: str) -> None:
    matrix = MATRICES[name]
    data = matrix_exponential(matrix)
    with mp.workdps(50):
        for x in (0.0, 1e-9, 1e-6, -1e-5, 1e-3, 0.1, 0.5, 1.0, 3.0, -2.0):
            entries = ExponentialEntries(FloatArithmetic(), x, data).sparse()
            exact = mp.expm(mp.matrix(matrix.tolist()) * mp.mpf(x))
            for i in range(matrix.rows):
                for j in range(matrix.cols):
                    got, want = entries.get((i, j), 0), exact[i, j]
                    assert abs(got - want) <= 2e-14 * abs(want) + mp.mpf("1e-45"), (x, i, j)


def test_the_printed_form_is_the_textbook_form() -> None:
    from lie_codegen.kernel.exact_arithmetic import ExactArithmetic

    x = sp.Symbol("x", real=True)
    data = matrix_exponential(sp.Matrix([[0, -1], [1, 0]]))
    entries = ExponentialEntries(ExactArithmetic(), x, data, printed=True).sparse()
    assert entries == {(0, 0): sp.cos(x), (0, 1): -sp.sin(x), (1, 0): sp.sin(x), (1, 1): sp.cos(x)}
