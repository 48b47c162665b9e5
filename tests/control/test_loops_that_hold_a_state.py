"""Continuous loops of laws that hold a state: to the tolerance where nothing jumps, refused with the reason where something does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import ComputationError

INERTIA, T = np.diag([2.0, 3, 4]), np.linspace(0, 10, 21)
REFERENCE = ["0.1*cos(t)", "0.2*sin(t)", "0.1*t"]
LAWS = {
    "quaternion": lambda: lc.quaternion_law("so3", inertia=INERTIA, k_p=4, K_d=3),
    "hybrid": lambda: lc.hybrid_law("so3", inertia=INERTIA, K_p=[4, 5, 6], K_d=3),
}


def loop(name, seed, **how):
    rng = np.random.default_rng(seed)
    X0, xi0 = Rotation.from_rotvec(2 * rng.normal(size=3)).as_matrix(), 4 * rng.normal(size=3)
    reference = lc.reference("so3", REFERENCE)
    return lc.closed_loop("so3", law=LAWS[name](), reference=reference, inertia=INERTIA, X0=X0, xi0=xi0, t=T, **how)


@pytest.mark.parametrize("name", LAWS)
def test_the_tolerance_is_met_where_nothing_jumps(name):
    """The quaternion that is held lags by a step, which says nothing of the motion."""
    run, fine = loop(name, 2), loop(name, 2, step=2e-4)
    np.testing.assert_allclose(run.X, fine.X, atol=1e-9)
    assert run.steps < 20_000


def test_the_motion_is_that_of_the_law_written_out():
    """k_p sign(q0) q + K_d (omega - ..) about a fixed attitude, by SciPy; no jump, for q0 keeps its sign."""
    law = lc.quaternion_law("so3", inertia=INERTIA, k_p=4, K_d=3)
    X0 = Rotation.from_rotvec([1.2, -0.7, 0.4]).as_matrix()
    rest = lc.reference("so3", ["0", "0", "0"])
    run = lc.closed_loop("so3", law=law, reference=rest, inertia=INERTIA, X0=X0, xi0=[0.3, -0.2, 0.1], t=T)
    energy = []
    for X, xi in zip(run.X, run.xi, strict=True):
        q = Rotation.from_matrix(X).as_quat()
        energy.append(xi @ INERTIA @ xi / 2 + 2 * 4 * (1 - abs(q[3])))

    def rate(t, y):
        q, w = y[:4], y[4:]
        v = q[1:]
        turn = np.concatenate([[-v @ w], q[0] * w + np.cross(v, w)]) / 2
        return np.concatenate([turn, np.linalg.solve(INERTIA, np.cross(INERTIA @ w, w) - 4 * v - 3 * w)])

    start = Rotation.from_matrix(X0).as_quat()
    true = solve_ivp(rate, (0, 10), [start[3], *start[:3], 0.3, -0.2, 0.1], rtol=1e-11, atol=1e-13, t_eval=T).y.T
    np.testing.assert_allclose(run.xi, true[:, 4:], atol=1e-8)
    assert np.all(np.diff(energy) < 1e-9)


@pytest.mark.parametrize(("name", "seed"), [("hybrid", 1), ("quaternion", 5)])
def test_a_jump_is_refused_at_once_with_what_to_do(name, seed):
    with pytest.raises(ComputationError, match=r"the law jumps on the way.*step=.*sample="):
        loop(name, seed)
    assert np.all(np.isfinite(loop(name, seed, step=1e-3).X))
    assert np.all(np.isfinite(loop(name, seed, sample=1e-2).X))
