"""lc.kinetic_energy_metric: angles where I is the identity, else geodesics of Euler's equations by scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import InputError, NotOnGroupError, ShapeError


def shortest(J: np.ndarray, target: np.ndarray) -> float:
    """Free motions of the body that end at the target in unit time, by shooting from many starts: the least |xi|_J."""

    def end(w0: np.ndarray) -> np.ndarray:
        def rate(_: float, y: np.ndarray) -> np.ndarray:
            R, w = y[:9].reshape(3, 3), y[9:]
            hat = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
            return np.concatenate([(R @ hat).ravel(), np.linalg.solve(J, np.cross(J @ w, w))])

        y = solve_ivp(rate, (0, 1), np.concatenate([np.eye(3).ravel(), w0]), rtol=1e-9, atol=1e-11).y[:, -1]
        return Rotation.from_matrix(y[:9].reshape(3, 3).T @ target).as_rotvec()

    rng, best = np.random.default_rng(0), np.inf
    guess = Rotation.from_matrix(target).as_rotvec()
    for k in range(12):
        found = root(end, guess + (rng.normal(size=3) if k else 0), tol=1e-10)
        if found.success and np.linalg.norm(found.fun) < 1e-8:
            best = min(best, float(np.sqrt(found.x @ J @ found.x)))
    return best


@pytest.mark.parametrize("J", [np.diag([1.0, 2.0, 0.8]), np.array([[2, 0.3, -0.1], [0.3, 1.5, 0.2], [-0.1, 0.2, 1.0]])])
def test_distances_of_attitudes(J: np.ndarray) -> None:
    metric = lc.kinetic_energy_metric("so3", J)
    X, target = Rotation.from_rotvec([0.3, 0.2, -0.4]).as_matrix(), Rotation.from_rotvec([0.8, -0.5, 1.1]).as_matrix()
    expected = shortest(J, target)
    assert metric.distance(np.eye(3), target) == pytest.approx(expected, rel=1e-7)
    assert metric.distance(X, X @ target) == pytest.approx(expected, rel=1e-7)  # left-invariant
    plan = metric.geodesic(np.eye(3), target)
    path = plan.X(np.linspace(0, 1, 401))
    assert metric.length(path) == pytest.approx(expected, rel=1e-5)
    arc = np.array(
        [Rotation.from_rotvec(s * Rotation.from_matrix(target).as_rotvec()).as_matrix() for s in np.linspace(0, 1, 9)]
    )
    assert metric.length(arc) > expected * (1 + 1e-4)


def test_the_identity_measures_angles_and_an_abelian_group_is_flat() -> None:
    target = Rotation.from_rotvec([0.8, -0.5, 1.1]).as_matrix()
    angle = Rotation.from_matrix(target).magnitude()
    assert lc.kinetic_energy_metric("so3", 1).distance(np.eye(3), target) == pytest.approx(angle, rel=1e-9)
    assert lc.kinetic_energy_metric("so3", 4).distance(target, np.eye(3)) == pytest.approx(2 * angle, rel=1e-9)
    assert lc.kinetic_energy_metric("so3", 4).distance(target, target) == 0.0
    flat = lc.kinetic_energy_metric("so3", ["1/2", 1, 2])
    assert float(flat.norm([1, 0, 0])) == pytest.approx(np.sqrt(0.5))
    np.testing.assert_allclose(flat.inner([[1, 2, 3], [0, 1, 0]], [1, 1, 1]), [8.5, 1])


def test_what_is_refused() -> None:
    metric = lc.kinetic_energy_metric("so3", 1)
    with pytest.raises(NotOnGroupError):
        metric.distance(np.eye(3), np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(ShapeError, match="takes"):
        metric.length(np.eye(3))
    with pytest.raises(InputError):
        lc.kinetic_energy_metric("so3", [1, -1, 1])
