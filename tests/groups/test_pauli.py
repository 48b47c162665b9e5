"""lc.pauli: the strings, their brackets against commutators in numpy, and groups from matrices the quick way."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.algebra import constructions


def test_strings_are_kronecker_products() -> None:
    X, Z, Y = np.array([[0, 1], [1, 0]]), np.diag([1, -1]), np.array([[0, -1j], [1j, 0]])
    np.testing.assert_array_equal(lc.pauli("ZX"), np.kron(Z, X))
    np.testing.assert_array_equal(lc.pauli("IYZ"), np.kron(np.eye(2), np.kron(Y, Z)))
    for wrong in ("", "xy", "A", 0, 4, True, 1.5):
        with pytest.raises(lc.errors.InputError, match="pauli"):
            lc.pauli(wrong)


@pytest.mark.parametrize("qubits", [1, 2, 3])
def test_brackets_are_commutators(qubits: int) -> None:
    group = lc.pauli(qubits)
    assert group.dim == 4**qubits - 1
    assert group.labels[0] == "I" * (qubits - 1) + "X"
    for label, matrix in zip(group.labels, group.basis, strict=True):
        np.testing.assert_array_equal(matrix, -0.5j * lc.pauli(label))
    c = group.algebra.structure_constants
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, group.dim))
    A, B = group.hat(x), group.hat(y)
    np.testing.assert_allclose(group.hat(np.einsum("i,j,ijk->k", x, y, c)), A @ B - B @ A, atol=1e-12)


@pytest.mark.parametrize("name", ["so3", "se2", "se3", "su2", "so5", "sp4", "h3"])
def test_inner_products_find_the_structure_constants_that_elimination_finds(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    group = lc.group(name)
    quick = constructions.algebra_from_matrices(name, group.labels, group.exact_basis)
    monkeypatch.setattr(constructions, "orthogonal_table", lambda *_: None)
    slow = constructions.algebra_from_matrices(name, group.labels, group.exact_basis)
    assert quick.table == slow.table


def test_matrices_that_are_not_closed_or_not_independent_are_still_named() -> None:
    X, Y = -0.5j * lc.pauli("X"), -0.5j * lc.pauli("Y")
    with pytest.raises(lc.errors.NotClosedError):
        lc.from_matrices("open_", ("a", "b"), [X, Y])
    with pytest.raises(lc.errors.DependentBasisError):
        lc.from_matrices("twice", ("a", "b"), [X, X])


@pytest.mark.slow
def test_a_toffoli_gate_from_a_chain_of_three_qubits() -> None:
    toffoli = np.eye(8)[[0, 1, 2, 3, 4, 5, 7, 6]]
    local = ("XII", "YII", "IXI", "IYI", "IIX", "IIY")
    plan = lc.steer(
        lc.pauli(3), lc.UpToPhase(toffoli), local, 12.0, drift={"ZZI": 1, "IZZ": 1}, bounds=4, pieces=60, starts=8,
        iterations=25, polish=False,
    )  # fmt: skip
    assert plan.details["fidelity"] == pytest.approx(1, abs=1e-10)
    assert np.max(np.abs(plan.inputs(np.linspace(0, 12, 601)))) <= 4
