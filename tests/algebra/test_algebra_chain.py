"""Random exact changes of basis of known algebras through the whole chain: structure, chart, exact and numeric kernels."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import JacobiError
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic

OPS = FloatArithmetic()
NAMES = {
    "solvable": ("se2", "osc4", "aff1", "sim2"),
    "nilpotent": ("h3", "engel", "h5"),
    "semisimple": ("so3", "sl2", "su2"),
}


@st.composite
def shears(draw: st.DrawFn, name: str) -> MatrixGroup:
    """The group in a basis moved by a few exact shears and scalings: always invertible, entries stay small."""
    group = lc.group(name)
    n = group.dim
    matrix = sp.eye(n)
    for _ in range(draw(st.integers(0, 3))):
        i, j = draw(st.integers(0, n - 1)), draw(st.integers(0, n - 1))
        factor = draw(st.sampled_from([-2, -1, sp.Rational(-1, 2), sp.Rational(1, 3), 1, 2]))
        if i != j:
            matrix[i, :] = matrix[i, :] + factor * matrix[j, :]
        else:
            matrix[i, :] = factor * matrix[i, :]
    rows = {f"b{i}": {label: matrix[i, k] for k, label in enumerate(group.labels)} for i in range(n)}
    return lc.change_of_basis(group, rows)


def check_chain(group: MatrixGroup, seed: int) -> None:
    rng = np.random.default_rng(seed)
    c = group.algebra.structure_constants
    commutators = np.einsum("iab,jbc->ijac", group.basis, group.basis)
    np.testing.assert_allclose(
        commutators - commutators.swapaxes(0, 1), np.tensordot(c, group.basis, axes=(2, 0)), atol=1e-12
    )
    g = 0.4 * rng.uniform(-1, 1, group.dim)
    X = np.eye(group.degree, dtype=complex)
    for A, x in zip(group.basis, g, strict=True):
        X = X @ expm(x * A)
    [phi] = group_kernel(group, "product_exp").evaluate(OPS, list(g))
    ours = np.array([[_number(entry) for entry in row] for row in phi])
    np.testing.assert_allclose(ours, X, atol=1e-12 * np.max(np.abs(X)))
    wn = lc.wei_norman(group)
    determinant = float(sp.lambdify([wn.g], wn.determinant, "numpy")(g))
    [M] = group_kernel(group, "wei_norman_matrix").evaluate(OPS, list(g))
    assert determinant * np.linalg.det(np.array(M, dtype=float)) == pytest.approx(1, rel=1e-9)
    exact = np.array(sp.lambdify([wn.g], wn.M_inverse, "numpy")(g), dtype=float)
    np.testing.assert_allclose(exact @ np.array(M, dtype=float), np.eye(group.dim), atol=1e-9)


def _number(entry) -> complex:
    return complex(entry.re, entry.im) if hasattr(entry, "im") else complex(float(entry))


COMMON = {"deadline": None, "derandomize": True, "suppress_health_check": [HealthCheck.too_slow]}


@settings(max_examples=10, **COMMON)
@given(st.data())
def test_solvable_algebras_in_any_basis(data: st.DataObject) -> None:
    group = data.draw(shears(data.draw(st.sampled_from(NAMES["solvable"]))))
    parts = lc.structure(group)
    assert parts.solvable
    assert not parts.nilpotent
    check_chain(group, 1)
    order = lc.wei_norman_order(group)
    assert order.is_global or order.changed_domain.is_global


@settings(max_examples=10, **COMMON)
@given(st.data())
def test_nilpotent_algebras_in_any_basis(data: st.DataObject) -> None:
    group = data.draw(shears(data.draw(st.sampled_from(NAMES["nilpotent"]))))
    assert lc.structure(group).nilpotent
    check_chain(group, 2)
    wn = lc.wei_norman(group)
    assert wn.M_inverse.applyfunc(lambda e: sp.Integer(int(e.is_polynomial(*wn.g)))) == sp.ones(group.dim)


@settings(max_examples=10, **COMMON)
@given(st.data())
def test_semisimple_algebras_in_any_basis(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(NAMES["semisimple"]))
    group = data.draw(shears(name))
    parts = lc.structure(group)
    assert parts.semisimple
    eigenvalues = np.linalg.eigvalsh(np.array(parts.killing, dtype=float))
    assert np.sum(eigenvalues > 0) == (2 if name == "sl2" else 0)
    check_chain(group, 3)


@settings(max_examples=25, **COMMON)
@given(st.lists(st.integers(-2, 2), min_size=9, max_size=9))
def test_brackets_are_accepted_exactly_when_jacobi_holds(values: list[int]) -> None:
    """All three-dimensional bracket tables with small integers, against the identity in floating point."""
    labels = ("a", "b", "c")
    pairs = [("a", "b"), ("b", "c"), ("c", "a")]
    c = np.zeros((3, 3, 3))
    table = {}
    for row, (x, y) in enumerate(pairs):
        i, j = labels.index(x), labels.index(y)
        coefficients = values[3 * row : 3 * row + 3]
        c[i, j], c[j, i] = coefficients, [-v for v in coefficients]
        table[x, y] = dict(zip(labels, coefficients, strict=True))
    jacobi = np.einsum("ijm,mkl->ijkl", c, c)
    jacobi = jacobi + jacobi.transpose(1, 2, 0, 3) + jacobi.transpose(2, 0, 1, 3)
    from lie_codegen.algebra.constructions import algebra_from_brackets

    if np.any(np.abs(jacobi) > 1e-9):
        with pytest.raises(JacobiError, match=r"\(a, b, c\)"):
            algebra_from_brackets("free", labels, table)
    else:
        np.testing.assert_array_equal(algebra_from_brackets("free", labels, table).structure_constants, c)
