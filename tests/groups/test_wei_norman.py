"""Exact Wei-Norman matrices: published closed forms, and differences of the product of exponentials."""

from __future__ import annotations

import itertools
import time

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.groups.catalogue_names import FAMILY_EXAMPLES, group_names
from lie_codegen.groups.change_of_basis import change_of_basis
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.matrix import wei_norman
from lie_codegen.kernel.casadi_arithmetic import function_of

SO3 = "[[cos(g3)/cos(g2), -sin(g3)/cos(g2), 0], [sin(g3), cos(g3), 0], [-cos(g3)*tan(g2), sin(g3)*tan(g2), 1]]"
#: (group, order, det M^-1, M): Leonard and Krishnaprasad (15) for so3; the others from an independent derivation.
PUBLISHED = [
    ("so3", "w1 w2 w3", "cos(g2)", SO3),
    ("se2", "omega vx vy", "1", "[[1, 0, 0], [g3, 1, 0], [-g2, 0, 1]]"),
    ("h3", "x y z", "1", "[[1, 0, 0], [0, 1, 0], [-g2, 0, 1]]"),
    ("sl2", "h e f", "1", "[[1, -g3, 0], [-2*g2, 2*g2*g3 + 1, 0], [2*g3, -g3**2, 1]]"),
    ("sl2", "e h f", "exp(-2*g2)", "[[exp(2*g2), 0, 0], [-g3, 1, 0], [-g3**2, 2*g3, 1]]"),
    ("sl2", "e f h", "1", "[[exp(2*g3), 0, 0], [g2**2*exp(2*g3), exp(-2*g3), 0], [-g2*exp(2*g3), 0, 1]]"),
    ("sl2", "h f e", "1", "[[1, g3, 0], [2*g2, 2*g2*g3 + 1, 0], [-2*g3, -g3**2, 1]]"),
    ("sl2", "f h e", "exp(2*g2)", "[[exp(-2*g2), 0, 0], [g3, 1, 0], [-g3**2, -2*g3, 1]]"),
    ("sl2", "f e h", "1", "[[exp(-2*g3), 0, 0], [g2**2*exp(-2*g3), exp(2*g3), 0], [g2*exp(-2*g3), 0, 1]]"),
    ("su2", "sx sy sz", "cos(g2)", SO3),
    ("se3", "w1 w2 w3 v1 v2 v3", "cos(g2)", None),
    ("se3", "v1 v2 v3 w1 w2 w3", "cos(g5)", None),
    ("so4", "L12 L13 L14 L23 L24 L34", "cos(g2)*cos(g3)**2*cos(g5)", None),
    ("osc4", "J P Q Z", "1", "[[1, 0, 0, 0], [g3, 1, 0, 0], [-g2, 0, 1, 0], [g2**2/2 - g3**2/2, -g3, 0, 1]]"),
    (
        "osc4",
        "P J Q Z",
        "cos(g2)",
        "[[1/cos(g2), g3/cos(g2), 0, 0], [0, 1, 0, 0], [tan(g2), g3*tan(g2), 1, 0], [-g3, -g3**2/2, 0, 1]]",
    ),
    (
        "osc4",
        "Z Q P J",
        "1",
        "[[1, g3*cos(g4), g3*sin(g4), 0], [0, cos(g4), sin(g4), 0], [0, -sin(g4), cos(g4), 0], [0, 0, 0, 1]]",
    ),
    ("aff1", "d t", "1", "[[1, 0], [-g2, 1]]"),
    ("aff1", "t d", "exp(-g2)", "[[exp(g2), 0], [0, 1]]"),
    ("se2", "vx omega vy", "cos(g2)", "[[1/cos(g2), g3/cos(g2), 0], [0, 1, 0], [tan(g2), g3*tan(g2), 1]]"),
    ("se2", "vx vy omega", "1", "[[cos(g3), -sin(g3), 0], [sin(g3), cos(g3), 0], [0, 0, 1]]"),
    ("engel", "x1 x2 x3 x4", "1", "[[1, 0, 0, 0], [0, 1, 0, 0], [-g2, 0, 1, 0], [-g3, 0, 0, 1]]"),
]


@pytest.mark.parametrize(("name", "order", "determinant", "M"), PUBLISHED, ids=[f"{p[0]}-{p[1]}" for p in PUBLISHED])
def test_published_matrices_come_out_as_they_are_written(
    name: str, order: str, determinant: str, M: str | None
) -> None:
    wn = wei_norman(lc.group(name).reorder(order.split()))
    names = {str(symbol): symbol for symbol in wn.g}
    assert wn.determinant == sp.parse_expr(determinant, names)
    if M is not None:
        assert sp.ImmutableMatrix(sp.parse_expr(M, names)) == wn.M


def test_split_so4_and_so5_have_products_of_cosines() -> None:
    so4 = lc.group("so4")
    split = {
        f"{sign}{k}": {a: "1/2", b: f"{'-' if sign == 'm' else ''}1/2"}
        for sign in "pm"
        for k, (a, b) in enumerate((("L12", "L34"), ("L13", "L24"), ("L14", "L23")))
    }
    split["p1"]["L24"], split["m1"]["L24"] = "-1/2", "1/2"
    assert str(wei_norman(change_of_basis(so4, split)).determinant) == "cos(g2)*cos(g5)"
    so5 = "cos(g2)*cos(g3)**2*cos(g4)**3*cos(g6)*cos(g7)**2*cos(g9)"
    assert str(wei_norman(lc.group("so5")).determinant) == so5


def test_iwasawa_order_of_sl2() -> None:
    wn = wei_norman(change_of_basis(lc.group("sl2"), {"k": {"e": 1, "f": -1}, "h": {"h": 1}, "e": {"e": 1}}))
    g2, g3 = wn.g[1:]
    assert wn.determinant == sp.exp(2 * g2)
    expected = [[sp.exp(-2 * g2), 0, 0], [-g3, 1, 0], [g3**2 + 1 - sp.exp(-4 * g2), -2 * g3, 1]]
    assert (wn.M - sp.Matrix(expected)).expand() == sp.zeros(3)


def product(group: MatrixGroup, g: np.ndarray) -> np.ndarray:
    X = np.eye(group.degree, dtype=complex)
    for A, x in zip(group.basis, g, strict=True):
        X = X @ expm(x * A)
    return X


def body_frame(group: MatrixGroup, g: np.ndarray, step: float = 1e-4) -> np.ndarray:
    """M^-1 by fourth-order differences of the product of exponentials: shares no code with the exact form."""
    inverse = np.linalg.inv(product(group, g))
    columns = []
    for unit in np.eye(group.dim):
        near, far = (product(group, g + s * unit) - product(group, g - s * unit) for s in (step, 2 * step))
        columns.append(group.project(inverse @ (8 * near - far) / (12 * step)))
    return np.array(columns).T


@pytest.mark.parametrize("name", [*group_names(), "so5", "sl4", "so22", "se_3_2", "h7", "gl3"])
def test_exact_inverse_and_determinant_agree_with_differences(name: str) -> None:
    group = lc.group(name)
    wn = wei_norman(group)
    inverse = sp.lambdify([wn.g], wn.M_inverse, "numpy")
    determinant = sp.lambdify([wn.g], wn.determinant, "numpy")
    rng = np.random.default_rng(3)
    for g in 0.8 * rng.uniform(-1, 1, size=(3, group.dim)):
        frame = body_frame(group, g)
        np.testing.assert_allclose(np.array(inverse(g), dtype=float), frame, atol=1e-9)
        np.testing.assert_allclose(float(determinant(g)), np.linalg.det(frame), atol=1e-8, rtol=1e-8)


@pytest.mark.parametrize("name", [name for name in group_names() if name != "su3"] + ["so5", "sl4"])
def test_exact_matrix_inverts_the_exact_inverse(name: str) -> None:
    wn = wei_norman(lc.group(name))
    rng = np.random.default_rng(5)
    g = 0.7 * rng.uniform(-1, 1, size=wn.group.dim)
    M, inverse = (np.array(sp.lambdify([wn.g], part, "numpy")(g), dtype=float) for part in (wn.M, wn.M_inverse))
    np.testing.assert_allclose(M @ inverse, np.eye(wn.group.dim), atol=1e-12)


def test_determinant_of_su3_has_a_closed_form() -> None:
    wn = wei_norman(lc.group("su3"))
    unit, factors = wn.determinant_factors
    assert unit == sp.Rational(-1, 16)
    assert [str(factor) for factor, _ in factors][-1] == "cos(g2)"
    assert len(factors) == 3
    assert wn.determinant.subs(dict.fromkeys(wn.g, 0)) == 1


def test_unit_of_a_group_that_is_not_unimodular() -> None:
    """sim2 with the scale last: det Ad of the scale is e^{-2 g} on the translations."""
    wn = wei_norman(lc.group("sim2").reorder(["omega", "vx", "vy", "s"]))
    assert wn.determinant == sp.exp(-2 * wn.g[3])


def test_all_orders_of_three_axes_end_at_the_middle_angle() -> None:
    for order in itertools.permutations(("w1", "w2", "w3")):
        assert str(wei_norman(lc.group("so3").reorder(order)).determinant) == "cos(g2)"


def test_sl4_from_its_definition_to_casadi_in_two_seconds() -> None:
    from lie_codegen.groups.derivation import derivation_of
    from lie_codegen.groups.families import family

    family("sl2")
    seconds = []
    for _ in range(3):
        derivation_of.cache_clear()
        started = time.process_time()
        function = function_of(group_kernel(family("sl4"), "wei_norman_rate"))
        seconds.append(time.process_time() - started)
    assert function.size1_out(0) == 15
    assert min(seconds) < 2.0


def test_se3_rate_stays_small() -> None:
    """Block-triangular solve with adjugates: about 70 nodes, its Jacobian about 180 (not 534 and 5107)."""
    function = function_of(group_kernel(lc.group("se3"), "wei_norman_rate"))
    g, u = ca.SX.sym("g", 6), ca.SX.sym("u", 6)
    jacobian = ca.Function("jacobian", [g, u], [ca.jacobian(function(g, u), ca.vertcat(g, u))], {"cse": True})
    assert function.n_nodes() <= 70
    assert jacobian.n_nodes() <= 195


def test_family_examples_are_groups() -> None:
    for name in FAMILY_EXAMPLES:
        if name not in ("su4", "sp6"):
            assert wei_norman(lc.group(name)).determinant.subs({f"g{k}": 0 for k in range(1, 40)}) == 1


@pytest.mark.parametrize("name", [*group_names(), *FAMILY_EXAMPLES])
def test_rates_hold_all_over_the_chart(name: str) -> None:
    """Far from the identity too, where a pivot of a careless elimination vanishes: dense adjoints of expm as oracle."""
    group, rng = lc.group(name), np.random.default_rng(11)
    n, c = group.dim, group.algebra.structure_constants
    rate = function_of(group_kernel(group, "wei_norman_rate"))
    for _ in range(20):
        g, u = rng.uniform(-3, 3, n), rng.uniform(-1, 1, n)
        columns, tail = np.zeros((n, n)), np.eye(n)
        for j in reversed(range(n)):
            columns[:, j] = tail[:, j]
            tail = tail @ expm(-g[j] * c[j].T)
        expected = np.linalg.solve(columns, u)
        measured = np.asarray(rate(g, u)).ravel()
        scale = np.linalg.cond(columns) * np.linalg.norm(expected)
        np.testing.assert_allclose(measured, expected, rtol=0, atol=2e-14 * scale)
