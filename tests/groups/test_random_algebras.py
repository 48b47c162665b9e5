"""Known groups in random rational bases, their matrices conjugated as well: from the matrices through every kernel in CasADi.

Oracles: the transformation law of structure constants in rationals, scipy's expm and expm_frechet. `test_algebra_chain` has the exact
Wei-Norman matrices of milder changes of basis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from kernel_calls import flatten, unflatten
from scipy.linalg import expm, expm_frechet

import lie_codegen as lc
from lie_codegen.groups.group_file import parse_group_file
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.casadi_arithmetic import function_of

#: A product is written a*b.
SOLVABLE = ("se2", "osc4", "aff1*h3")
NILPOTENT = ("h3", "engel", "h3*r2")
SEMISIMPLE = ("so3", "sl2", "so4", "so3*sl2")
MIXED = ("so3*h3", "sl2*aff1")
SETTINGS = {
    "max_examples": 5,
    "deadline": None,
    "derandomize": True,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large],
}
FACTORS = [sp.Rational(p, q) for p, q in ((-2, 1), (-1, 1), (-1, 2), (1, 3), (1, 1), (2, 1))]


@cache
def original(name: str) -> MatrixGroup:
    if "*" in name:
        first, second = name.split("*")
        return lc.product(lc.group(first), lc.group(second))
    return lc.group(name)


@dataclass(frozen=True)
class Moved:
    """B_i = P (sum_j C_ij A_j) P^-1."""

    name: str
    C: sp.Matrix
    group: MatrixGroup


@st.composite
def invertible(draw: st.DrawFn, n: int) -> sp.Matrix:
    """A product of shears, scalings and exchanges."""
    matrix = sp.eye(n)
    for _ in range(draw(st.integers(1, 3))):
        i, j = draw(st.integers(0, n - 1)), draw(st.integers(0, n - 1))
        factor = draw(st.sampled_from(FACTORS))
        if i == j:
            matrix[i, :] = factor * matrix[i, :]
        elif factor == 1:
            matrix.row_swap(i, j)
        else:
            matrix[i, :] = matrix[i, :] + factor * matrix[j, :]
    return matrix


@st.composite
def moved(draw: st.DrawFn, names: tuple[str, ...]) -> Moved:
    name = draw(st.sampled_from(names))
    group = original(name)
    n = group.dim
    C, P = draw(invertible(n)), draw(invertible(group.degree))
    combined = [sum((C[i, j] * group.exact_basis[j] for j in range(n)), sp.zeros(group.degree)) for i in range(n)]
    matrices = [(P * matrix * P.inv()).tolist() for matrix in combined]
    return Moved(name, C, lc.from_matrices("moved", [f"b{i}" for i in range(n)], matrices))


def check_everything(case: Moved) -> None:
    check_structure_constants(case)
    check_file(case.group)
    rng = np.random.default_rng(5)
    check_wei_norman(case.group, rng)
    check_exponential(case.group, rng)


def check_structure_constants(case: Moved) -> None:
    """c'_ijk = C_ia C_jb c_abm (C^-1)_mk, in rationals."""
    old, new, n = original(case.name).algebra, case.group.algebra, case.group.dim
    inverse = case.C.inv()
    for i in range(n):
        for j in range(n):
            x, y = ({a: case.C[row, a] for a in range(n) if case.C[row, a] != 0} for row in (i, j))
            bracket = old.bracket(x, y)
            row = [sum((value * inverse[m, k] for m, value in bracket.items()), sp.S.Zero) for k in range(n)]
            assert new.bracket({i: sp.S.One}, {j: sp.S.One}) == {k: v for k, v in enumerate(row) if v != 0}


def check_file(group: MatrixGroup) -> None:
    """Written as TOML and read again, it is the same group."""
    lines = [f'name = "{group.name}"', f"labels = {list(group.labels)}", "[matrices]"]
    lines += [
        f"{label} = {[[str(entry) for entry in row] for row in matrix.tolist()]}"
        for label, matrix in zip(group.labels, group.exact_basis, strict=True)
    ]
    again = parse_group_file("\n".join(lines).encode(), "moved.toml")
    assert again.algebra == group.algebra
    assert again.exact_basis == group.exact_basis


def call(group: MatrixGroup, name: str, *arguments: np.ndarray) -> np.ndarray:
    kernel = group_kernel(group, name)
    flat = [flatten(port, value) for port, value in zip(kernel.inputs, arguments, strict=True)]
    return unflatten(kernel.outputs[0], np.array(function_of(kernel)(*flat)))


def close(actual: np.ndarray, expected: np.ndarray, condition: float = 1.0) -> None:
    assert np.all(np.isfinite(actual))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-13 * condition * max(1.0, np.max(np.abs(expected))))


def check_wei_norman(group: MatrixGroup, rng: np.random.Generator) -> None:
    """X = prod exp(g_k A_k), and sum_k g_k' dX/dg_k = X hat(u) with dX/dg_k = (factors before k) A_k (the others)."""
    n = group.dim
    scale = np.max(np.linalg.norm(group.basis, axis=(1, 2)))
    g, u = 0.5 / scale * rng.uniform(-1, 1, n), rng.normal(size=n)
    factors = [expm(x * A) for x, A in zip(g, group.basis, strict=True)]
    X = np.linalg.multi_dot([np.eye(group.degree), *factors])
    close(call(group, "product_exp", g), X)
    rate = call(group, "wei_norman_rate", g, u)
    M = call(group, "wei_norman_matrix", g)
    condition = np.linalg.cond(M) * scale
    close(M @ u, rate, condition)
    velocity = sum(
        rate[k] * np.linalg.multi_dot([np.eye(group.degree), *factors[:k], group.basis[k], *factors[k:]])
        for k in range(n)
    )
    close(velocity, X @ group.hat(u), condition)
    wn = lc.wei_norman(group)
    determinant = float(wn.determinant.subs(dict(zip(wn.g, g, strict=True))))
    np.testing.assert_allclose(determinant * np.linalg.det(M), 1, rtol=1e-13 * condition)


def check_exponential(group: MatrixGroup, rng: np.random.Generator) -> None:
    n = group.dim
    x, y = rng.normal(size=(2, n))
    x /= max(1.0, np.linalg.norm(group.hat(x)))
    X = call(group, "exp", x)
    close(X, expm(group.hat(x)))
    condition = np.linalg.norm(group.coordinate_rows) * np.linalg.cond(X)
    close(call(group, "log", X), x, condition)
    slope = expm_frechet(group.hat(x), group.hat(y), compute_expm=False)
    close(group.hat(call(group, "ljac", x) @ y) @ X, slope, condition)
    close(X @ group.hat(call(group, "rjac", x) @ y), slope, condition)
    ad = np.tensordot(x, group.algebra.structure_constants, axes=(0, 0)).T
    close(call(group, "Ad", X), expm(ad), condition)
    close(call(group, "ad", x), ad)
    close(call(group, "ljac_inv", x) @ call(group, "ljac", x), np.eye(n), condition)


def test_matrices_without_a_block_of_zeros_keep_their_logarithm() -> None:
    """SE(3) and Engel's group by matrices that look full: zero is an eigenvalue with Jordan blocks there."""
    rng = np.random.default_rng(8)
    for name in ("se3", "engel"):
        group = original(name)
        P = sp.Matrix([[1, 2, 0, 1], [0, 1, 1, 0], [1, 0, 1, -1], [2, 0, 0, 1]])
        matrices = [(P * matrix * P.inv()).tolist() for matrix in group.exact_basis]
        full = lc.from_matrices("full", group.labels, matrices)
        for size in (1e-8, 1e-3, 1.0, 2.0):
            x = rng.normal(size=group.dim)
            x[:3] *= size / np.linalg.norm(x[:3])
            X = call(full, "exp", x)
            close(X, expm(full.hat(x)), 10)
            close(call(full, "log", X), x, np.linalg.cond(np.array(P, dtype=float)) ** 2)


def test_jacobians_where_the_killing_form_pairs_some_elements_alone() -> None:
    """b2 = w3 - e / 2 of so(3) + sl(2): the row of e in the Killing form has one entry, the row of its partner f two."""
    C = sp.eye(6)
    C[2, 4] = -sp.Rational(1, 2)
    group = original("so3*sl2")
    matrices = [sum((C[i, j] * group.exact_basis[j] for j in range(6)), sp.zeros(5)).tolist() for i in range(6)]
    check_everything(Moved("so3*sl2", C, lc.from_matrices("moved", [f"b{i}" for i in range(6)], matrices)))


@settings(**SETTINGS)
@given(moved(SOLVABLE))
def test_solvable(case: Moved) -> None:
    assert lc.structure(case.group).solvable
    check_everything(case)


@settings(**SETTINGS)
@given(moved(NILPOTENT))
def test_nilpotent(case: Moved) -> None:
    assert lc.structure(case.group).nilpotent
    check_everything(case)


@settings(**SETTINGS)
@given(moved(SEMISIMPLE))
def test_semisimple(case: Moved) -> None:
    assert lc.structure(case.group).semisimple
    check_everything(case)


@settings(**SETTINGS)
@given(moved(MIXED))
def test_neither(case: Moved) -> None:
    parts = lc.structure(case.group)
    assert not parts.semisimple
    assert not parts.nilpotent
    check_everything(case)
