"""Exact algebra: constructors prove what they promise, exponentials, named errors."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import (
    AlgebraError,
    DependentBasisError,
    IdentifierError,
    InputError,
    JacobiError,
    NotClosedError,
    NotFiniteError,
    NotInAlgebraError,
    ShapeError,
)
from lie_codegen.exact.exponential import matrix_exponential
from lie_codegen.exact.numbers import exact_number

E12, E21, H = [[0, 1], [0, 0]], [[0, 0], [1, 0]], [[1, 0], [0, -1]]


def test_what_does_not_close_names_the_pair() -> None:
    with pytest.raises(NotClosedError, match=r"\[e, f\]"):
        lc.from_matrices("open_", ["e", "f"], [E12, E21])


def test_dependent_matrices_name_the_relation() -> None:
    with pytest.raises(DependentBasisError, match=r"\(-2\) a \+ \(1\) b = 0|\(1\) b"):
        lc.from_matrices("twice", ["a", "b"], [E12, [[0, 2], [0, 0]]])


def test_jacobi_names_the_triple() -> None:
    with pytest.raises(JacobiError, match=r"fails for \(x, y, z\)"):
        lc.from_brackets("bad", ["x", "y", "z"], {("x", "y"): {"x": 1}, ("y", "z"): {"z": 1}, ("x", "z"): {"z": 1}})


@pytest.mark.parametrize(
    ("brackets", "message"),
    [
        ({("x", "q"): {"x": 1}}, "not a label"),
        ({("x", "x"): {"y": 1}}, "must be 0"),
        ({("x", "y"): {"y": 1}, ("y", "x"): {"y": 1}}, "not antisymmetric"),
        ({("x", "y"): {"y": "i"}}, "real"),
        ({"xy": {"y": 1}}, "pair of labels"),
    ],
)
def test_bracket_tables_that_are_none(brackets: dict, message: str) -> None:
    with pytest.raises(AlgebraError, match=message):
        lc.from_brackets("g", ["x", "y"], brackets)


def test_both_orders_of_a_bracket_may_be_given_if_they_agree() -> None:
    group = lc.from_brackets("g", ["x", "y"], {("x", "y"): {"y": 1}, ("y", "x"): {"y": -1}})
    assert group.algebra.table == {(0, 1): {1: 1}}


@pytest.mark.parametrize(
    ("matrices", "error", "message"),
    [
        ([[[0, 1], [0]]], ShapeError, "ragged"),
        ([[[0, 1]]], ShapeError, "ragged"),
        (["text"], ShapeError, "list of rows"),
        ([[]], ShapeError, "list of rows"),
        ([[0, 1]], ShapeError, "row 1"),
        ([[["q"]]], InputError, "row 1, column 1"),
        ([[[0.1]]], InputError, "not exact"),
        ([[[float("nan")]]], NotFiniteError, "not finite"),
        ([[[None]]], InputError, "not a number"),
        ([[[True]]], InputError, "not a number"),
    ],
)
def test_matrices_that_are_none(matrices: list, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        lc.from_matrices("g", ["a"], matrices)


def test_other_bad_definitions() -> None:
    with pytest.raises(ShapeError, match="2 labels for 1"):
        lc.from_matrices("g", ["a", "b"], [E12])
    with pytest.raises(ShapeError, match="different sizes"):
        lc.from_matrices("g", ["a", "b"], [E12, [[1]]])
    with pytest.raises(InputError, match="list of names"):
        lc.from_matrices("g", "ab", [E12, E21])
    with pytest.raises(InputError, match="units"):
        lc.from_matrices("g", ["a"], [E12], units=["m", "s"])
    with pytest.raises(AlgebraError, match="repeated"):
        lc.from_matrices("g", ["a", "a"], [E12, H])
    for name in ("1g", "for", "class", "a-b", "_g", "g" * 64, "", 3):
        with pytest.raises(IdentifierError):
            lc.from_matrices(name, ["a"], [E12])
    with pytest.raises(AlgebraError, match="at least one"):
        LieAlgebra("g", (), {})


def test_bases_need_independence_over_the_reals_only() -> None:
    """[[1]] and [[i]] are dependent over C and independent over R."""
    group = lc.from_matrices("c_times", ["r", "phase"], [[[1]], [["i"]]])
    assert group.is_complex
    np.testing.assert_allclose(group.vee(np.array([[2 - 3j]])), [2, -3], atol=1e-14)


def test_irrational_structure_constants_stay_exact() -> None:
    algebra = lc.group("su3").algebra
    value = algebra.bracket({3: sp.Integer(1)}, {4: sp.Integer(1)})
    assert value == {2: sp.Rational(1, 2), 7: sp.sqrt(3) / 2}


@pytest.mark.parametrize(
    "matrix",
    [
        [[0, 0], [0, 0]],
        [[1, 0], [0, 1]],
        [[0, 1, 0], [0, 0, 1], [0, 0, 0]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 2]],
        [[1, 1], [-1, 1]],
        [[0, 2], [1, 0]],
        [[0, 1, 0, 0], [-1, 0, 1, 0], [0, 0, 0, 1], [0, 0, -1, 0]],
        [[1, 2, 3], [0, 1, 4], [0, 0, -2]],
        [[0, 1, 0], [0, 0, 1], [2, 0, 0]],
        [[0, 1, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 0, 1], [1, 1, 0, 0, 0]],
    ],
    ids=range(10),
)
def test_matrix_exponentials_from_the_minimal_polynomial(matrix: list[list[int]]) -> None:
    """Nilpotent, semisimple, defective, complex, cubic and unsolvable quintic spectra against scipy."""
    exact = sp.Matrix(matrix)
    found = matrix_exponential(exact)
    for x in (-1.3, 0.0, 0.7):
        value = np.zeros(exact.shape)
        for (i, j), terms in found.entries.items():
            for m, coefficient in terms.items():
                mode = found.modes[m]
                wave = np.sin if mode.odd else np.cos
                value[i, j] += (
                    float(coefficient) * x**mode.power * np.exp(float(mode.rate) * x) * wave(float(mode.frequency) * x)
                )
        np.testing.assert_allclose(value, expm(x * np.array(matrix, dtype=float)), atol=1e-12)


def test_taylor_coefficients_continue_the_powers() -> None:
    matrix = sp.Matrix([[0, 1, 0], [0, 0, 1], [2, 0, 0]])
    found = matrix_exponential(matrix)
    for (i, j), values in found.taylor.items():
        for order in (0, 3, 7, 12):
            assert values[order] == (matrix**order)[i, j] / sp.factorial(order)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (3, 3),
        ("1/3", sp.Rational(1, 3)),
        (0.5, sp.Rational(1, 2)),
        (1 - 2j, 1 - 2 * sp.I),
        ("sqrt(2)/2", sp.sqrt(2) / 2),
    ],
)
def test_exact_numbers(value: object, expected: sp.Expr) -> None:
    assert exact_number(value) == expected


@pytest.mark.parametrize(
    "value", [0.1, float("inf"), float("nan"), sp.Symbol("x"), sp.Float("0.1"), None, [1], True, "x"]
)
def test_numbers_that_are_not_exact(value: object) -> None:
    with pytest.raises(InputError):
        exact_number(value)


def test_hat_and_vee_refuse_what_they_cannot_read() -> None:
    so3 = lc.group("so3")
    x = np.array([[0.1, -0.2, 0.3], [1, 2, 3]])
    np.testing.assert_allclose(so3.vee(so3.hat(x)), x, atol=1e-15)
    with pytest.raises(ShapeError):
        so3.hat([1, 2])
    with pytest.raises(ShapeError):
        so3.vee(np.eye(2))
    with pytest.raises(NotFiniteError):
        so3.vee(np.full((3, 3), np.nan))
    with pytest.raises(NotInAlgebraError, match="differs by"):
        so3.vee(np.eye(3))


def test_brackets_alone_find_a_faithful_representation() -> None:
    for name in ("h3", "engel", "osc4", "so3", "se2", "aff1", "h5"):
        algebra = lc.group(name).algebra
        table = {
            (algebra.labels[i], algebra.labels[j]): {algebra.labels[k]: v for k, v in row.items()}
            for (i, j), row in algebra.table.items()
        }
        group = lc.from_brackets(name, algebra.labels, table)
        stacked = group.basis.reshape(group.dim, -1)
        assert np.linalg.matrix_rank(stacked) == group.dim
        commutators = np.einsum("iab,jbc->ijac", group.basis, group.basis)
        commutators = commutators - commutators.swapaxes(0, 1)
        np.testing.assert_allclose(
            commutators, np.tensordot(algebra.structure_constants, group.basis, axes=(2, 0)), atol=1e-14
        )


def test_an_abelian_algebra_from_no_brackets() -> None:
    group = lc.from_brackets("flat", ["a", "b"], {})
    assert np.linalg.matrix_rank(group.basis.reshape(2, -1)) == 2


def test_a_pickled_algebra_has_the_hash_of_its_process() -> None:
    """The hash is kept, but texts hash differently in every process."""
    algebra = lc.group("so3").algebra
    hash(algebra)
    code = (
        f"import pickle, lie_codegen as lc; there = pickle.loads({pickle.dumps(algebra)!r}); here = lc.group('so3').algebra; "
        "assert there == here and hash(there) == hash(here)"
    )
    for seed in ("1", "2"):
        subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "PYTHONHASHSEED": seed})
