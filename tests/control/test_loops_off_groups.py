"""Loops of spheres, mechanisms, Lagrangian systems and vibrational laws, against scipy with the equations written again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError

T = np.linspace(0, 3, 7)
CIRCLE = ["cos(t)", "3/5*sin(t)", "4/5*sin(t)"]


def curve(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b = np.array([1, 0, 0]), np.array([0, 0.6, 0.8])
    return np.cos(t) * a + np.sin(t) * b, -np.sin(t) * a + np.cos(t) * b, -np.cos(t) * a - np.sin(t) * b


def pointing(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Lemma 5.1 mended: T r' = (q.r) r' - (q.r') r, and its derivative along the motion by a difference."""
    r, *_ = curve(t)

    def moved(s: float) -> np.ndarray:
        at, x, y = q + s * v, *curve(t + s)[:2]
        return np.asarray((at @ x) * y - (at @ y) * x)

    change = (moved(1e-6) - moved(-1e-6)) / 2e-6
    force = 4 * r - 2 * (v - moved(0)) + change
    return np.asarray(force - (q @ force) * q)


def test_a_pointing_device() -> None:
    law = lc.sphere_law(2, k_p=4, k_d=2)
    run = lc.closed_loop("s2", law=law, reference=CIRCLE, X0=[0, 0, 1], xi0=[0.3, 0.2, 0], t=T, rtol=1e-10)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:3], y[3:]
        return np.concatenate([v, pointing(t, q, v) - (v @ v) * q])

    want = solve_ivp(rate, (0, 3), [0, 0, 1, 0.3, 0.2, 0], t_eval=T, rtol=1e-9, atol=1e-10).y.T
    np.testing.assert_allclose(run.X, want[:, :3], atol=1e-7)
    np.testing.assert_allclose(run.xi, want[:, 3:], atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(run.X, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(
        run.error, np.linalg.norm(run.X - np.array([curve(t)[0] for t in T]), axis=1), atol=1e-14
    )
    assert run.outputs["W"][-1] < run.outputs["W"][0] / 50
    assert run == lc.closed_loop(law=law, reference=CIRCLE, X0=[0, 0, 1], xi0=[0.3, 0.2, 0], t=T, rtol=1e-10)


def test_a_sampled_pointing_device_under_noise() -> None:
    law = lc.sphere_law(2, k_p="input", k_d=2)
    options: dict[str, Any] = {"law": law, "reference": CIRCLE, "X0": [0, 0, 1], "t": T, "sample": 0.05, "step": 0.05}
    run = lc.closed_loop("S^2", **options, gains={"k_p": [4, 2, 1]}, noise={"X": 0.01, "u": 0.1}, limits=3)
    assert run.X.shape == (7, 3, 3)
    np.testing.assert_allclose(np.linalg.norm(run.X, axis=-1), 1, atol=1e-14)
    quiet = lc.closed_loop("S^2", **options, gains={"k_p": 4})
    assert 1e-4 < np.max(np.abs(run.X[:, 0] - quiet.X)) < 0.2
    assert run.u is not None
    assert np.max(np.abs(run.u)) < 3.6
    for wrong, message in (
        ({"X0": [0, 0, 2]}, "length 2"), ({"xi0": [0, 0, 1]}, "not tangent"), ({"reference": ["1", "t", "0"]}, "unit sphere"),
        ({"reference": ["1", "0"]}, "2 coordinates"), ({"reference": None}, "tracks"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            lc.closed_loop("s2", **{**options, **wrong}, gains={"k_p": 4})
    with pytest.raises(ShapeError, match="X0 has shape"):
        lc.closed_loop("s2", **{**options, "X0": [0, 1]}, gains={"k_p": 4})


def mass(q: np.ndarray) -> np.ndarray:
    c = np.cos(q[1])
    return np.array([[3 + 2 * c, 1 + c], [1 + c, 1]])


ARM = [["3+2*cos(q2)", "1+cos(q2)"], ["1+cos(q2)", "1"]]


@pytest.mark.parametrize("kind", ["augmented_pd", "computed_torque"])
def test_an_arm_follows_its_reference(kind: str) -> None:
    """Two links, M q'' = F - (what differences of M and V give)."""
    law = lc.manipulator_law(ARM, K_p=5, K_d=3, kind=kind, potential="9*cos(q1) + 3*cos(q1+q2)")
    run = lc.closed_loop(law=law, reference=["sin(t)", "t/5"], X0=[0.3, -0.2], t=T, rtol=1e-9)

    def coriolis(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        s = np.sin(q[1])
        return np.array([[-s * v[1], -s * (v[0] + v[1])], [s * v[0], 0]])

    def weight(q: np.ndarray) -> np.ndarray:
        both = -3 * np.sin(q[0] + q[1])
        return np.array([-9 * np.sin(q[0]) + both, both])

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:2], y[2:]
        r, w, a = np.array([np.sin(t), t / 5]), np.array([np.cos(t), 0.2]), np.array([-np.sin(t), 0])
        M, C = mass(q), coriolis(q, v)
        if kind == "computed_torque":
            force = M @ (a - 5 * (q - r) - 3 * (v - w)) + C @ v + weight(q)
        else:
            force = M @ a + C @ w - 5 * (q - r) - 3 * (v - w) + weight(q)
        return np.concatenate([v, np.linalg.solve(M, force - C @ v - weight(q))])

    want = solve_ivp(rate, (0, 3), [0.3, -0.2, 0, 0], t_eval=T, rtol=1e-10, atol=1e-11).y.T
    np.testing.assert_allclose(run.X, want[:, :2], atol=1e-7)
    np.testing.assert_allclose(run.xi, want[:, 2:], atol=1e-7)
    heavier = [["4+2*cos(q2)", "1+cos(q2)"], ["1+cos(q2)", "1"]]
    other = lc.closed_loop(law=law, inertia=heavier, reference=["sin(t)", "t/5"], X0=[0.3, -0.2], t=T, rtol=1e-9)
    assert np.max(np.abs(other.X - run.X)) > 1e-3


def test_a_lagrangian_system_under_a_law_of_ones_own() -> None:
    """A pendulum on a cart, pushed at the cart alone."""
    system = lc.lagrangian_system(
        coordinates=("x", "a"), lagrangian="dx^2 + da^2/2 + dx*da*cos(a) - 9.81*cos(a)", forces={"x": "u"}
    )

    def body(ops: Any, q: Any, v: Any) -> Any:
        return ([3 * q[0] + 5 * v[0] + 60 * q[1] + 15 * v[1]],)

    law = lc.Kernel("balance", "cart", (lc.Port("q", (2,)), lc.Port("q_dot", (2,))), (lc.Port("force", (1,)),), body)
    run = lc.closed_loop(system, law=law, X0=[0.0, 0.2], t=T, rtol=1e-10, limits=12)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        (x, a), (dx, da) = y[:2], y[2:]
        u = np.clip(3 * x + 5 * dx + 60 * a + 15 * da, -12, 12)
        M = np.array([[2, np.cos(a)], [np.cos(a), 1]])
        return np.concatenate([[dx, da], np.linalg.solve(M, [u + da**2 * np.sin(a), 9.81 * np.sin(a)])])

    want = solve_ivp(rate, (0, 3), [0, 0.2, 0, 0], t_eval=T, rtol=1e-11, atol=1e-12, max_step=0.01).y.T
    np.testing.assert_allclose(run.X, want[:, :2], atol=1e-5)
    with pytest.raises(InputError, match="no inputs"):
        lc.closed_loop(lc.lagrangian_system(coordinates=("x",), lagrangian="dx^2"), law=law, t=T)


def test_a_vibrational_law_switched_once_a_period() -> None:
    """Kapitza's pendulum at a tilt: the amplitude is that of the averaged state at each switch; scipy in between."""
    from lie_codegen.gallery.vibrational_kapitza import tilt_design
    from lie_codegen.kernel.arithmetic import FloatArithmetic
    from lie_codegen.mechanics.vibrational_law import feedback_kernels

    design, _ = tilt_design()
    period, eps = 2 * np.pi * design.eps, design.eps
    start = [float(design.equilibrium[0]) + 0.15, float(design.equilibrium[1])]
    run = lc.closed_loop(law=design, X0=start[:1], xi0=start[1:], t=np.arange(13) * period, rtol=1e-9)
    command = feedback_kernels(design, "tilt")[0]
    y, held = np.array(start), [0.0]
    for i in range(13):
        (held,) = command.evaluate(FloatArithmetic(), list(y), held)
        np.testing.assert_allclose([*run.X[i], *run.xi[i]], y, atol=1e-7)
        assert run.u is not None
        np.testing.assert_allclose(run.u[i], held, atol=1e-6)

        def rate(t: float, y: np.ndarray, alpha: float = float(held[0])) -> np.ndarray:
            # spherical pendulum reduced at the momentum 1/2, its pivot shaken: th'' = sin(th) (g + u) + cos(th)/(4 sin(th)^3)
            force = (6 + alpha) * np.cos(design.switch_phase + t / eps) / eps
            s = np.sin(y[0])
            return np.array([y[1], s * (9.81 + force) + np.cos(y[0]) / (4 * s**3)])

        y = solve_ivp(rate, (0, period), y, rtol=1e-11, atol=1e-12, method="DOP853").y[:, -1]
