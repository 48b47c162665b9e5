"""Groups in random rational bases: eigenvalues that are conjugate and written as radicals, elements far out for small coordinates."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from generators import generic_basis

import lie_codegen as lc
from lie_codegen.codegen.vectors import make_vectors
from lie_codegen.kernel.arithmetic import FloatArithmetic


@pytest.mark.parametrize("name", ["so4", "so31", pytest.param("sp4", marks=pytest.mark.slow), "sl3"])
def test_products_of_exponentials(name: str) -> None:
    """Newton's form over complex nodes: its symmetric sums took minutes on so31, and equal nodes were told apart on so4."""
    group = generic_basis(lc.group(name), np.random.default_rng(5))
    product_exp = lc.build(group, kernels=("product_exp",)).product_exp
    x = np.random.default_rng(3).uniform(-0.3, 0.3, size=(20, group.dim))
    for row, X in zip(x, product_exp.batch(x), strict=True):
        wanted = np.eye(group.degree)
        for c, e in zip(row, np.eye(group.dim), strict=True):
            wanted = wanted @ scipy.linalg.expm(group.hat(c * e))
        assert np.max(np.abs(X - wanted)) < 1e-14 * np.max(np.abs(wanted))


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", ["sl2", "so3", "sim2"])
def test_elements_of_the_vectors_have_logarithms(name: str, real: str) -> None:
    """Coordinates in [-1, 1] of large matrices gave elements of SL(2) with eigenvalues below zero, and no package."""
    for seed in range(3):
        group = generic_basis(lc.group(name), np.random.default_rng(seed))
        (log,) = [kernel for kernel in lc.group_kernels(group) if kernel.name == "log"]
        assert all(np.isfinite(vector.outputs[0]).all() for vector in make_vectors(log, real=real))


@pytest.mark.parametrize("name", ["se_2_3", pytest.param("sgal3", marks=pytest.mark.slow)])
def test_jacobians_of_screws(name: str) -> None:
    """Exact polynomials in factors are short in the usual basis; in this one they grew until the derivation took minutes."""
    group = generic_basis(lc.group(name), np.random.default_rng(1))
    (kernel,) = [kernel for kernel in lc.group_kernels(group) if kernel.name == "ljac"]
    rng, n = np.random.default_rng(3), group.dim
    x = rng.normal(size=n) / 10
    ad = np.zeros((2 * n, 2 * n))
    for i, j, k, value in group.algebra.constants():
        ad[k, j] += x[i] * float(value)
    ad[:n, n:] = np.eye(n)
    (J,) = kernel.evaluate(FloatArithmetic(), x.tolist())
    wanted = scipy.linalg.expm(ad)[:n, n:]
    assert np.max(np.abs(np.array(J, dtype=float) - wanted)) < 1e-13 * np.max(np.abs(wanted))


@pytest.mark.parametrize("name", ["sl3", pytest.param("sp4", marks=pytest.mark.slow)])
def test_wei_norman_where_adjoint_spectra_are_involved(name: str) -> None:
    """The roots of ad_k span fields of degree 6 and 16: Sp(4) and SO(5) were refused, SU(3) took minutes."""
    group = generic_basis(lc.group(name), np.random.default_rng(1))
    (kernel,) = [kernel for kernel in lc.group_kernels(group) if kernel.name == "wei_norman_rate"]
    rng, n = np.random.default_rng(3), group.dim
    g, u = rng.normal(size=n) / 20, rng.normal(size=n)
    ads = np.zeros((n, n, n))
    for i, j, k, value in group.algebra.constants():
        ads[i, k, j] += float(value)
    columns, after = np.zeros((n, n)), np.eye(n)
    for k in reversed(range(n)):
        columns[:, k] = after[:, k]
        after = after @ scipy.linalg.expm(-g[k] * ads[k])
    (rate,) = kernel.evaluate(FloatArithmetic(), g.tolist(), u.tolist())
    assert np.max(np.abs(columns @ np.array(rate, dtype=float) - u)) < 1e-12
