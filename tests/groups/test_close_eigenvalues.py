"""product_exp of generators whose eigenvalues nearly agree, against 60-digit arithmetic."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from kernel_calls import call_group

import lie_codegen as lc
from lie_codegen.exact.exponential import matrix_exponential
from lie_codegen.groups.wei_norman.exponential_entries import ExponentialEntries
from lie_codegen.kernel.arithmetic import FloatArithmetic


def exact(A: sp.Matrix, t: float) -> np.ndarray:
    with mp.workdps(60):
        rows = [[mp.mpf(sp.N(entry, 60)) for entry in row] for row in A.tolist()]
        return np.array(mp.expm(mp.matrix(rows) * mp.mpf(t)).tolist(), dtype=float)


def bidiagonal(eigenvalues: list[sp.Expr]) -> sp.Matrix:
    A = sp.diag(*eigenvalues)
    for i in range(len(eigenvalues) - 1):
        A[i, i + 1] = 1
    return A


@pytest.mark.parametrize("power", [6, 9, 12, 13])
def test_two_three_and_mixed_clusters(power: int) -> None:
    g = sp.Rational(1, 10**power)
    spectra = [
        [1, 1 + g],
        [1, 1 + g, 1 + 3 * g],
        [0, g, 2 * g, 5],
        [1, 1 + g, 1 + 3 * g, -1, -1 - g],
        [-20, 0, sp.Rational(1, 1000), 7],
    ]
    for spectrum in spectra:
        A = bidiagonal([sp.Integer(0) + value for value in spectrum])
        data = matrix_exponential(A)
        assert data.newton is not None
        for t in (-2.0, -0.5, 1e-3, 0.3, 1.0, 4.0):
            found = np.zeros(A.shape)
            for (i, j), value in ExponentialEntries(FloatArithmetic(), t, data).sparse().items():
                found[i, j] = value
            expected = exact(A, t)
            assert np.max(np.abs(found - expected)) <= 1e-14 * np.max(np.abs(expected))
            backward = np.zeros(A.shape)
            for (i, j), value in ExponentialEntries(FloatArithmetic(), -t, data.reflected).sparse().items():
                backward[i, j] = value
            np.testing.assert_allclose(backward, found, rtol=1e-13)


def test_complex_pairs_that_nearly_agree_and_small_frequencies() -> None:
    g = sp.Rational(1, 10**9)
    pairs = sp.Matrix([[0, -1, 1, 0], [1, 0, 0, 1], [0, 0, 0, -1 - g], [0, 0, 1 + g, 0]])
    spiral = sp.Matrix([[1, -g, 1], [g, 1, 0], [0, 0, 1]])
    for A in (pairs, spiral):
        data = matrix_exponential(A)
        assert data.newton is not None
        for t in (-2.0, 0.3, 4.0):
            expected = exact(A, t)
            for (i, j), value in ExponentialEntries(FloatArithmetic(), t, data).sparse().items():
                assert abs(value - expected[i, j]) <= 1e-14 * np.max(np.abs(expected))


def test_the_kernel_of_a_group_and_groups_that_need_nothing_new() -> None:
    g = sp.Rational(1, 10**9)
    group = lc.from_matrices("close", ("a",), [bidiagonal([sp.Integer(1), 1 + g, 1 + 3 * g])])
    np.testing.assert_allclose(call_group(group, "product_exp", [0.7]), exact(group.exact_basis[0], 0.7), rtol=1e-14)
    assert matrix_exponential(sp.Matrix([[0, -1], [1, 0]])).newton is None
    assert matrix_exponential(sp.diag(1, -1, 0)).newton is None
