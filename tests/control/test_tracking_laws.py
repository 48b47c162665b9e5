"""Tracking laws on groups against formulas written by hand in numpy, and the one identity that catches every sign error."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from kernel_calls import interpreted

from lie_codegen.control.error_function import ErrorSymbols
from lie_codegen.control.tracking_law import FEEDFORWARDS, tracking_law
from lie_codegen.errors import IncompatibleError, InertiaWarning, InputError
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.definition import from_matrices
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.dual import DualArithmetic, tangent_of
from lie_codegen.kernel.kernel import Kernel

SE3_GAINS = {"K_1": [1, 2, 3], "K_2": [[4, 1, 0], [1, 5, 0.5], [0, 0.5, 6]], "K_d": [2, 3, 4, 5, 6, 7]}
SE3_INERTIA = np.diag([2.0, 3, 4, 5, 6, 8]) + 0.3 * (np.eye(6, k=3) + np.eye(6, k=-3))
SO3_GAINS = {"K_p": [[3, 0.5, 0], [0.5, 2, 0.1], [0, 0.1, 1]], "K_d": [2, 3, 4]}
SO3_INERTIA = [[3, 0.5, 0], [0.5, 2, 0.1], [0, 0.1, 1]]
SE2_GAINS = {"K_1": [1, 2], "K_2": [[4, 1], [1, 5]], "K_d": [2, 3, 4]}

PAIRS = (
    [("so3", side, SO3_GAINS, [6, 4, 3]) for side in ("so3_right", "so3_left")]
    + [("se3", f"se3_{row}", SE3_GAINS, SE3_INERTIA) for row in range(1, 7)]
    + [("se2", f"se2_{row}", SE2_GAINS, [2, 3, 5]) for row in range(1, 7)]
    + [(name, "frobenius", {"k_p": 2, "K_d": 1.5}, [2, 3, 5]) for name in ("h3", "sl2", "su2", "se2")]
    + [("so3", "so3_geodesic", {"K_p": SO3_INERTIA, "K_d": 1.5}, [6, 4, 3])]
    + [("h3", "geodesic", {"K_p": SO3_INERTIA, "K_d": 1.5}, [2, 3, 5])]
)


@cache
def law(index: int, feedforward: str) -> tuple[MatrixGroup, Kernel, Callable[..., list[np.ndarray]]]:
    name, error, gains, inertia = PAIRS[index]
    group = load(name)
    kernel = tracking_law(group, inertia=inertia, error=error, gains=gains, feedforward=feedforward)
    function = interpreted(kernel)

    def call(X: np.ndarray, *vectors: np.ndarray) -> list[np.ndarray]:
        flat = [interleaved(group, a) if np.ndim(a) == 2 else a for a in (X, *vectors)]
        return function(*flat)

    return group, kernel, call


def interleaved(group: MatrixGroup, X: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(X, dtype=complex).view(float).ravel() if group.is_complex else np.real(X).ravel()


def exp(group: MatrixGroup, x: np.ndarray) -> np.ndarray:
    from scipy.linalg import expm

    return expm(group.hat(x))


def ad(group: MatrixGroup, x: np.ndarray) -> np.ndarray:
    return np.einsum("ijk,i->kj", group.algebra.structure_constants, x)


def matrix(value: object, n: int) -> np.ndarray:
    array = np.array(value, dtype=float)
    return array * np.eye(n) if array.ndim == 0 else np.diag(array) if array.ndim == 1 else array


def state(group: MatrixGroup, rng: np.random.Generator) -> list[np.ndarray]:
    n = group.dim
    return [
        exp(group, rng.normal(size=n)),
        rng.normal(size=n),
        exp(group, rng.normal(size=n)),
        *rng.normal(size=(2, n)),
    ]


@pytest.mark.parametrize("feedforward", FEEDFORWARDS)
@pytest.mark.parametrize("index", range(len(PAIRS)), ids=[f"{p[0]}-{p[1]}" for p in PAIRS])
def test_energy_decays_as_the_dissipation_says(index: int, feedforward: str) -> None:
    """dW/dt along the closed loop, differenced to sixth order from W itself, equals -xi_e' K_d xi_e."""
    group, _, call = law(index, feedforward)
    inertia = matrix(PAIRS[index][3], group.dim)
    rng = np.random.default_rng(index)
    for _ in range(3):
        X, xi, X_d, xi_d, xi_dd = state(group, rng)
        force, phi, W, W_dot = call(X, xi, X_d, xi_d, xi_dd)
        accel = np.linalg.solve(inertia, ad(group, xi).T @ inertia @ xi + force)

        def energy(s: float, X=X, xi=xi, X_d=X_d, xi_d=xi_d, xi_dd=xi_dd, accel=accel) -> float:
            moved = (X @ exp(group, s * xi), xi + s * accel, X_d @ exp(group, s * xi_d), xi_d + s * xi_dd, xi_dd)
            return float(call(*moved)[2][0])

        step, weights = 2e-3, (45, -9, 1)
        rate = sum(w * (energy(k * step) - energy(-k * step)) for k, w in enumerate(weights, 1)) / (60 * step)
        scale = abs(W_dot[0]) + abs(W[0]) + 1
        assert abs(rate - W_dot[0]) / scale < 2e-9
        assert W[0] >= phi[0] >= 0


@pytest.mark.parametrize("feedforward", FEEDFORWARDS)
@pytest.mark.parametrize("index", range(len(PAIRS)), ids=[f"{p[0]}-{p[1]}" for p in PAIRS])
def test_energy_identity_to_rounding(index: int, feedforward: str) -> None:
    """The same derivative without differencing: the kernel's own W at a dual number in time, to 1e-12."""
    group, kernel, call = law(index, feedforward)
    inertia = matrix(PAIRS[index][3], group.dim)
    rng = np.random.default_rng(index + 100)
    ops = DualArithmetic(FloatArithmetic())

    def moving(value: np.ndarray, rate: np.ndarray) -> list:
        def entry(a: complex, b: complex) -> object:
            if group.is_complex and value.ndim == 2:
                return Complex(ops.variable(a.real, {0: b.real}), ops.variable(a.imag, {0: b.imag}))
            return ops.variable(float(np.real(a)), {0: float(np.real(b))})

        pairs = np.stack([value, rate], axis=-1)
        rows = [[entry(*ab) for ab in row] for row in pairs.reshape(-1, value.shape[-1], 2)]
        return rows if value.ndim == 2 else rows[0]

    for _ in range(3):
        X, xi, X_d, xi_d, xi_dd = state(group, rng)
        force, _, _, W_dot = call(X, xi, X_d, xi_d, xi_dd)
        accel = np.linalg.solve(inertia, ad(group, xi).T @ inertia @ xi + force)
        arguments = [
            moving(X, X @ group.hat(xi)), moving(xi, accel), moving(X_d, X_d @ group.hat(xi_d)), moving(xi_d, xi_dd),
            xi_dd.tolist(),
        ]  # fmt: skip
        W = kernel.evaluate(ops, *arguments)[2]
        size = 1 + abs(W_dot[0]) + np.linalg.norm(xi) * np.linalg.norm(force)
        assert abs(tangent_of(W) - W_dot[0]) < 1e-12 * size


def hat(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def skew_vee(A: np.ndarray) -> np.ndarray:
    S = (A - A.T) / 2
    return np.array([S[2, 1], S[0, 2], S[1, 0]])


def test_satellite_laws_are_those_of_lemma_5_2() -> None:
    K_p, K_d, J = matrix(SO3_GAINS["K_p"], 3), matrix(SO3_GAINS["K_d"], 3), np.diag([6.0, 4, 3])
    rng = np.random.default_rng(0)
    group = load("so3")
    R, w, S, wd, wdd = state(group, rng)
    Re, turn = S.T @ R, R.T @ S
    right = -skew_vee(K_p @ Re) - K_d @ (w - turn @ wd) + np.cross(w, J @ turn @ wd) + J @ turn @ wdd
    left = -S.T @ skew_vee(K_p @ R @ S.T) - K_d @ (w - wd) + np.cross(wd, J @ w) + J @ wdd
    _, _, f_right = law(0, "right")
    _, _, f_left = law(1, "left")
    np.testing.assert_allclose(f_right(R, w, S, wd, wdd)[0], right, atol=1e-13)
    np.testing.assert_allclose(f_left(R, w, S, wd, wdd)[0], left, atol=1e-13)
    phi = np.trace(K_p @ (np.eye(3) - Re)) / 2
    W = phi + (w - turn @ wd) @ J @ (w - turn @ wd) / 2
    np.testing.assert_allclose(np.concatenate(f_right(R, w, S, wd, wdd)[1:3]), [phi, W], atol=1e-13)


@pytest.mark.parametrize("row", [1, 2, 3, 6])
def test_proportional_derivative_action_on_se3_by_hand(row: int) -> None:
    """f_P + f_D of rows 1, 2, 3 and 6 of Table 1 (row 3 as printed mixes two rows), at rest of the reference."""
    K1, K2, K_d = (matrix(SE3_GAINS[key], n) for key, n in (("K_1", 3), ("K_2", 3), ("K_d", 6)))
    rng = np.random.default_rng(row)
    X, xi, X_d, _, _ = state(load("se3"), rng)
    R, p, S, q = X[:3, :3], X[:3, 3], X_d[:3, :3], X_d[:3, 3]
    x, y = R.T @ (p - q), R.T @ p - S.T @ q
    turning = {1: 0, 2: 0, 3: np.cross(K2 @ x, x), 6: np.cross(K2 @ y, R.T @ p)}[row]
    pull = {1: R.T @ K2 @ (p - q), 2: R.T @ S @ K2 @ S.T @ (p - q), 3: K2 @ x, 6: K2 @ y}[row]
    attitude = skew_vee(K1 @ S.T @ R) if row < 6 else S.T @ skew_vee(K1 @ R @ S.T)
    expected = -np.concatenate([attitude + turning, pull]) - K_d @ xi
    _, _, call = law(1 + row, "basic")
    np.testing.assert_allclose(call(X, xi, X_d, np.zeros(6), np.zeros(6))[0], expected, atol=1e-12)


def test_feedforwards_differ_and_the_skew_operator_relates_them() -> None:
    """basic + S = levi_civita and basic + 2 S = right, S_tau as in section 5.4 with I restored in its last term."""
    group = load("se3")
    rng = np.random.default_rng(3)
    X, xi, X_d, xi_d, xi_dd = state(group, rng)
    forces = {kind: law(3, kind)[2](X, xi, X_d, xi_d, xi_dd)[0] for kind in FEEDFORWARDS}
    inertia = matrix(SE3_INERTIA, 6)
    tau = np.linalg.inv(X) @ X_d
    nu = group.vee(tau @ group.hat(xi_d) @ np.linalg.inv(tau))
    e = xi - nu
    S = (inertia @ ad(group, e) @ nu + ad(group, nu).T @ inertia @ e - ad(group, e).T @ inertia @ nu) / 2
    np.testing.assert_allclose(forces["levi_civita"], forces["basic"] + S, atol=1e-12)
    np.testing.assert_allclose(forces["right"], forces["basic"] + 2 * S, atol=1e-12)
    assert abs(S @ e) < 1e-12
    assert np.max(np.abs(S)) > 0.1


def test_incompatible_pairs_are_refused_with_the_residual() -> None:
    so3, se3 = load("so3"), load("se3")
    phi = "tr(K*(1 - Xd'*X))/2"
    with pytest.raises(IncompatibleError, match=r"= 0\.\d+ at a random point, computed in rational numbers"):
        tracking_law(so3, inertia=[6, 4, 3], error=(phi, "left"), gains={"K": np.diag([1.0, 2, 3]), "K_d": 1})
    tracking_law(so3, inertia=[6, 4, 3], error=(phi, "left"), gains={"K": 2 * np.eye(3), "K_d": 1})  # scalar gain: fine
    symbols = ErrorSymbols(se3)
    R, p, S, q = symbols.X[:3, :3], symbols.X[:3, 3], symbols.X_d[:3, :3], symbols.X_d[:3, 3]
    x = (R + S) * (p - q)  # Table 1, row 5, as printed; with R'p - S'q in place of p - q it is compatible
    phi5 = (3 - (R * S.T).trace()) / 2 + x.dot(x) / 2
    with pytest.raises(IncompatibleError, match=r"\(A2\)"):
        tracking_law(se3, inertia=1, error=(phi5, "left"), gains={"K_d": 1})


def test_a_users_pair_on_a_users_group() -> None:
    """SE_2(3)-like double translations of the plane, phi and tau as text."""
    E = np.zeros((5, 4, 4), int)
    E[0, 1, 0], E[0, 0, 1] = 1, -1
    E[1, 0, 2] = E[2, 1, 2] = E[3, 0, 3] = E[4, 1, 3] = 1
    group = from_matrices("se2_2", ["w", "ax", "ay", "bx", "by"], [m.tolist() for m in E])
    kernel = tracking_law(
        group, inertia=[1, 2, 3, 4, 5], error=("norm2(Xd^-1*X - 1)/2", "right"), gains={"K_d": 1}, feedforward="right"
    )
    by_tau = tracking_law(
        group, inertia=[1, 2, 3, 4, 5], error=("norm2(Xd^-1*X - 1)/2", {"tau": "X^-1*Xd"}), gains={"K_d": 1},
        feedforward="right",
    )  # fmt: skip
    rng = np.random.default_rng(0)
    values = [a.ravel() for a in state(group, rng)]
    a, b = function_of(kernel)(*values), function_of(by_tau)(*values)
    for x, y in zip(a, b, strict=True):
        np.testing.assert_allclose(np.array(x), np.array(y), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"inertia": [6, 4, -3]}, "inertia is not positive definite: its eigenvalues are -3"),
        ({"inertia": [[6, 1, 0], [0, 4, 0], [0, 0, 3]]}, "inertia is not symmetric"),
        ({"gains": {"K_p": [1, 2, -3], "K_d": 1}}, "sum of any two must be positive"),
        ({"gains": {"K_p": [1, 2, 3], "K_d": [1, 0, 1]}}, "K_d is not positive definite"),
        ({"gains": {"K_p": [1, 2, 3]}}, "needs the gain K_d"),
        ({"gains": {"K_p": [1, float("nan"), 3], "K_d": 1}}, "finite"),
        ({"error": "so3_rigth"}, "did you mean 'so3_right'"),
        ({"feedforward": "none"}, "choose one of basic, right, left, levi_civita"),
        ({"error": ("tr(1 - Xd'*X", "right")}, "expected '\\)'"),
        ({"error": ("tr(1 - Xd'*Q)", "right")}, "no name 'Q'"),
        ({"error": ("tr(Xd'*X)", "right")}, "phi\\(X, X\\) is not 0"),
        ({"error": ("-tr(1 - Xd'*X)", "right")}, "not positive definite"),
        ({"error": ("tr(1 - Xd'*X)", "up")}, "transport 'up' is not known"),
    ],
)
def test_wrong_input_is_refused_with_a_sentence(change: dict, message: str) -> None:
    given = {"inertia": [6, 4, 3], "error": "so3_right", "gains": SO3_GAINS} | change
    with pytest.raises(InputError, match=message):
        tracking_law(load("so3"), **given)


def test_an_impossible_rigid_body_warns_only() -> None:
    with pytest.warns(InertiaWarning, match="triangle inequality"):
        tracking_law(load("so3"), inertia=[6, 3, 1], error="so3_right", gains=SO3_GAINS)
