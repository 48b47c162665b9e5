"""Error functions of the logarithm: laws against scipy's logm, energies, the cut, and formulas with log."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.errors import ExpressionError, InputError

K3 = np.array([[4, 1, 0], [1, 5, 0.5], [0, 0.5, 6]])
CASES = [
    ("so3", "so3_geodesic", K3),
    ("se3", "se3_geodesic", np.diag([4.0, 5, 6, 2, 2, 3]) + 0.3),
    ("sl2", "geodesic", K3),
    ("h3", "geodesic", K3),
]


@pytest.mark.parametrize(("name", "error", "K"), CASES, ids=[case[0] for case in CASES])
def test_energy_falls_as_it_must_and_phi_is_that_of_scipy(name: str, error: str, K: np.ndarray) -> None:
    group, rng = lc.group(name), np.random.default_rng(1)
    n = group.dim
    inertia, K_d = np.diag(np.arange(1.0, n + 1) + 3), 2.0
    law = lc.build(lc.tracking_law(group, inertia=inertia, error=error, gains={"K_p": K, "K_d": K_d})).tracking_law
    ad = np.einsum("ijk->ikj", group.algebra.structure_constants)
    for _ in range(3):
        X, X_d = (expm(group.hat(0.5 * rng.normal(size=n))) for _ in range(2))
        xi, xi_d, rate = rng.normal(size=(3, n))
        out = law(X, xi, X_d, xi_d, rate)
        x = group.vee(np.real(logm(np.linalg.solve(X_d, X))))
        assert out.phi == pytest.approx(x @ K @ x / 2, rel=1e-11)
        accel = np.linalg.solve(inertia, np.einsum("i,ikj->kj", xi, ad).T @ inertia @ xi + out.force)

        def energy(s: float, X=X, xi=xi, X_d=X_d, xi_d=xi_d, rate=rate, accel=accel) -> float:
            moved = (
                X @ expm(group.hat(s * xi)),
                xi + s * accel,
                X_d @ expm(group.hat(s * xi_d)),
                xi_d + s * rate,
                rate,
            )
            return float(law(*moved).W)

        step = 1e-3
        slope = sum(w * (energy(k * step) - energy(-k * step)) for k, w in enumerate((45, -9, 1), 1)) / (60 * step)
        assert slope == pytest.approx(out.W_dot, abs=1e-8 * (1 + abs(out.W_dot)))


def test_a_matrix_gain_times_the_logarithm_is_no_gradient() -> None:
    """d phi = rjac_inv(theta)^T K theta: theta^T d phi = theta^T K theta, but d phi is not K theta."""
    so3, theta = lc.group("so3"), np.array([0.9, -1.1, 0.8])
    law = lc.build(lc.tracking_law("so3", inertia=1, error="so3_geodesic", gains={"K_p": K3, "K_d": 1})).tracking_law
    force = law(expm(so3.hat(theta)), np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3)).force
    assert theta @ force == pytest.approx(-theta @ K3 @ theta)
    assert np.max(np.abs(force + K3 @ theta)) > 0.1


def test_the_level_ends_at_the_cut() -> None:
    cert = lc.certificate("so3", inertia=1, error="so3_geodesic", gains={"K_p": [2, 3, 4], "K_d": 2}, prove=False)
    assert pytest.approx(2 * np.pi**2 / 2) == cert.L
    assert "cut" in cert.status
    one = lc.certificate("so3", inertia=1, error="so3_geodesic", gains={"K_p": 1, "K_d": 2})
    assert (one.b_1, one.b_2) == (pytest.approx(0.5), pytest.approx(0.5))
    found = lc.critical_points("geodesic", group="se3", gains={"K_p": 2})
    assert found.status == "cut"
    assert pytest.approx(np.pi**2, rel=1e-6) == found.L


def test_log_in_formulas() -> None:
    so3, x = lc.group("so3"), np.array([0.4, -0.7, 0.9])
    turn = expm(so3.hat(x))
    for text, value in (
        ("norm2(log(Xd^-1*X))/4", x @ x / 2),
        ("norm2(K*vee(log(Xd'*X)))/2", np.sum((K3 @ x) ** 2) / 2),
        ("tr(log(Xd^-1*X)'*log(Xd^-1*X))", 2 * x @ x),
    ):
        pair = lc.error_function("so3", text, parameters={"K": K3})
        law = lc.build(lc.tracking_law("so3", inertia=1, error=pair, gains={"K_d": 1})).tracking_law
        assert law(turn, np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3)).phi == pytest.approx(value, rel=1e-12)
    with pytest.raises(InputError, match="so3_geodesic"):
        lc.error_function("so3", "acos((tr(Xd^-1*X) - 1)/2)^2")
    with pytest.raises(ExpressionError, match=r"log takes Xd\^-1\*X"):
        lc.error_function("so3", "norm2(log(X))")


def test_incompatible_logarithms_are_refused() -> None:
    pair = lc.error_function("so3", "norm2(K*vee(log(Xd^-1*X)))/2", "left", parameters={"K": K3})
    with pytest.raises(lc.errors.IncompatibleError):
        lc.check_compatibility(pair)
