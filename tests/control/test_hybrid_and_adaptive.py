"""The hybrid law, adaptation and margins against published numbers and simulated loops."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kernel_calls import interpreted
from package_program import run_example
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.control.closed_loop_package import generate_closed_loop
from lie_codegen.errors import InputError

SO3, ONE, ZERO = lc.group("so3"), np.eye(3), np.zeros(3)
INERTIA = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1]])
K, K_D = np.diag([4.0, 5, 6]), np.diag([3.0, 4, 5])


def hybrid() -> Any:
    return lc.hybrid_law("so3", inertia=INERTIA, K_p=K, K_d=K_D)


def test_published_numbers_of_the_warp() -> None:
    law = hybrid()
    assert np.array(law.direction) ** 2 == pytest.approx(np.array([7, 13, 17]) / 37)
    assert law.kappa_max == pytest.approx(0.2043090767, rel=1e-9)
    assert law.kappa == pytest.approx(0.9 * law.kappa_max)
    assert law.gaps == pytest.approx([3.1979541, 3.2414888, 3.1556658], abs=1e-7)
    assert law.hysteresis == pytest.approx(law.gap / 2)


def test_force_is_the_gradient_and_unwanted_points_are_critical() -> None:
    law, step = hybrid(), 1e-5
    function = interpreted(law)
    rng = np.random.default_rng(0)
    for E in [expm(SO3.hat(x)) for x in rng.normal(size=(4, 3))]:
        force, q = function(E, ZERO, ONE, ZERO, ZERO, 1)
        slope = [
            (
                law.potential(E @ expm(SO3.hat(step * e)), int(q[0]))
                - law.potential(E @ expm(SO3.hat(-step * e)), int(q[0]))
            )
            / (2 * step)
            for e in ONE
        ]
        assert force == pytest.approx(-np.array(slope), abs=1e-8)
    for q in (1, -1):
        points = law.unwanted(q)
        assert [law.potential(E, q) for E in points] == pytest.approx([11, 10, 9], abs=1e-9)
        drops = [law.potential(E, q) - law.potential(E, -q) for E in points]
        assert drops == pytest.approx(law.gaps, abs=1e-9)
        for E in points:  # it jumps at once, and the torque of the same call is that of the other function
            force, after = function(E, ZERO, ONE, ZERO, ZERO, q)
            assert after[0] == -q
            assert np.linalg.norm(force) > 1


def flown(law: Any, X: np.ndarray, q: float, seconds: float, h: float = 0.01) -> tuple[np.ndarray, int, np.ndarray]:
    """Held torques, a fine splitting of the rotation between; the end, the number of jumps, angles."""
    function = interpreted(law)
    states = len(law.inputs) > 5
    omega, jumps, angles = np.zeros(3), 0, []
    for _ in range(round(seconds / h)):
        given = (X, omega, ONE, ZERO, ZERO, q) if states else (X, omega, ONE, ZERO, ZERO)
        out = function(*given)
        if states:
            jumps += int(out[1][0] != q)
            q = out[1][0]
        turn = np.linalg.solve(INERTIA, np.cross(INERTIA @ omega, omega) + out[0])
        X = X @ expm(SO3.hat(h * (omega + h * turn / 2)))
        omega = omega + h * turn
        U, _, V = np.linalg.svd(X)
        X = U @ V
        angles.append(np.arccos(np.clip((np.trace(X) - 1) / 2, -1, 1)))
    return X, jumps, np.array(angles)


def test_from_half_turns_the_smooth_law_stays_and_this_one_comes_home() -> None:
    smooth = lc.tracking_law(
        "so3", inertia=INERTIA, error="so3_right", gains={"K_p": K, "K_d": K_D}, feedforward="levi_civita"
    )
    law = hybrid()
    for half in (np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])):
        assert np.min(flown(smooth, half, 1, 3)[2]) > np.pi - 1e-9
        _, jumps, angles = flown(law, half, 1, 40, 0.02)
        assert (jumps, angles[-1] < 1e-3) == (0, True)
    _, jumps, angles = flown(law, law.unwanted(1)[0], 1, 40, 0.02)
    assert (jumps, angles[-1] < 1e-3) == (1, True)


def test_hybrid_energy_falls_as_it_must_about_a_moving_reference() -> None:
    """dV/dt = -xi_e.K_d xi_e between jumps, for every feedforward."""
    rng = np.random.default_rng(3)
    ad = np.einsum("ijk->ikj", SO3.algebra.structure_constants)
    for feedforward in ("basic", "right", "levi_civita"):
        law = lc.hybrid_law("so3", inertia=INERTIA, K_p=K, K_d=K_D, feedforward=feedforward)
        function = interpreted(law)
        X, X_d = (expm(SO3.hat(x)) for x in 0.5 * rng.normal(size=(2, 3)))
        xi, xi_d, rate = rng.normal(size=(3, 3))
        force, q = function(X, xi, X_d, xi_d, rate, 1)
        accel = np.linalg.solve(INERTIA, np.einsum("i,ikj->kj", xi, ad).T @ INERTIA @ xi + force)

        def energy(s: float, law=law, X=X, X_d=X_d, xi=xi, xi_d=xi_d, rate=rate, accel=accel, q=q) -> float:
            Y, Y_d = X @ expm(SO3.hat(s * xi)), X_d @ expm(SO3.hat(s * xi_d))
            E = Y_d.T @ Y
            error = xi + s * accel - E.T @ (xi_d + s * rate)
            return law.potential(E, int(q[0])) + float(error @ INERTIA @ error / 2)

        step = 1e-3
        slope = sum(w * (energy(k * step) - energy(-k * step)) for k, w in enumerate((45, -9, 1), 1)) / (60 * step)
        error = xi - X.T @ X_d @ xi_d
        assert slope == pytest.approx(-error @ K_D @ error, rel=1e-8)


def test_hybrid_refusals() -> None:
    with pytest.raises(InputError, match="critical circles"):
        lc.hybrid_law("so3", inertia=1, K_p=[4, 4, 6], K_d=1)
    with pytest.raises(InputError, match=r"below|between 0 and the gap"):
        lc.hybrid_law("so3", inertia=1, K_p=[4, 5, 6], K_d=1, hysteresis=4)
    with pytest.raises(InputError, match="kappa_max"):
        lc.hybrid_law("so3", inertia=1, K_p=[4, 5, 6], K_d=1, kappa=0.3)


def adaptive(**options: Any) -> Any:
    return lc.adaptive_law(
        "so3",
        error="so3_right",
        gains={"K_p": K, "K_d": K_D},
        rate=2,
        start=[1, 1, 1, 0, 0, 0],
        feedforward="basic",
        **options,
    )


def adapted(law: Any, omega_d: Any, omega_d_dot: Any, seconds: float) -> np.ndarray:
    function = interpreted(law)

    def polar(M: np.ndarray) -> np.ndarray:
        U, _, V = np.linalg.svd(M)
        return U @ V

    def rate(t: float, s: np.ndarray) -> np.ndarray:
        R, R_d = polar(s[:9].reshape(3, 3)), polar(s[9:18].reshape(3, 3))
        w, a = s[18:21], s[21:]
        force, change, _ = function(R, w, R_d, omega_d(t), omega_d_dot(t), a)
        turn = np.linalg.solve(INERTIA, np.cross(INERTIA @ w, w) + force)
        return np.concatenate([(R @ SO3.hat(w)).ravel(), (R_d @ SO3.hat(omega_d(t))).ravel(), turn, change])

    start = np.concatenate([expm(SO3.hat([0.5, -0.4, 0.6])).ravel(), ONE.ravel(), ZERO, law.guess])
    return solve_ivp(rate, [0, seconds], start, rtol=1e-9, atol=1e-11).y[21:]


def test_adapted_inertia_of_the_published_run() -> None:
    a = adapted(
        adaptive(project=False),
        lambda t: 0.8 * np.array([np.sin(t), np.cos(0.7 * t), 0.5 * np.sin(1.7 * t)]),
        lambda t: 0.8 * np.array([np.cos(t), -0.7 * np.sin(0.7 * t), 0.85 * np.cos(1.7 * t)]),
        10,
    )
    wanted = [2.0724793, 1.6124101, 0.7909497, 0.3006910, -0.0076803, 0.2479213]
    assert a[:, -1] == pytest.approx(wanted, abs=1e-5)


def test_projection_keeps_a_rigid_body() -> None:
    law = adaptive(project=True)
    a = adapted(
        law,
        lambda t: 0.8 * np.array([np.sin(t), np.cos(0.7 * t), 0.5 * np.sin(1.7 * t)]),
        lambda t: 0.8 * np.array([np.cos(t), -0.7 * np.sin(0.7 * t), 0.85 * np.cos(1.7 * t)]),
        4,
    )
    for column in a.T:
        J = law.inertia(column)
        assert np.linalg.eigvalsh(np.trace(J) / 2 * ONE - J)[0] > 0


def test_excitation_says_what_can_be_found() -> None:
    t = np.linspace(0, 10, 101)
    one = adaptive().excitation(lc.reference("so3", ["0", "0", "sin(t)"]), t)
    assert np.sum(one > 1e-9 * one[0]) == 3
    rich = adaptive().excitation(lc.reference("so3", ["sin(t)", "cos(0.7*t)", "sin(1.7*t)/2"]), t)
    assert np.sum(rich > 1e-9 * rich[0]) == 6


def test_margins_of_the_published_loop() -> None:
    S = (np.trace(K) * ONE - K) / 2
    margins = lc.loop_margins(inertia=INERTIA, stiffness=S, damping=K_D)
    assert [margins.sample_period(delay=d) for d in (0, 1, 2)] == pytest.approx(
        [0.3770669, 0.1696851, 0.1032739], abs=1e-7
    )
    assert margins.delay == pytest.approx(0.2601467, abs=1e-7)
    same = lc.loop_margins("so3", inertia=INERTIA, error="so3_right", gains={"K_p": K, "K_d": K_D})
    assert same.delay == pytest.approx(margins.delay)
    for d in (0, 1, 2):  # the sampled system on both sides of its margin
        h = margins.sample_period(delay=d)
        radii = [np.max(np.abs(np.linalg.eigvals(margins.sampled(f * h, d)))) for f in (0.999, 1.001)]
        assert radii[0] < 1 < radii[1]


def test_first_order_margins() -> None:
    margins = lc.loop_margins(rate=2)
    assert margins.rate(0.5) == pytest.approx(0.6362631, abs=1e-7)
    assert margins.deviation(0.05, 0.02) == pytest.approx(0.0045883, abs=1e-7)
    assert (margins.sample_period(), margins.delay) == (pytest.approx(1), pytest.approx(np.pi / 4))
    h = margins.sample_period(delay=3)
    sizes = [np.max(np.abs(np.roots([1, -1, 0, 0, 2 * f * h]))) for f in (0.999, 1.001)]
    assert sizes[0] < 1 < sizes[1]


def test_the_hybrid_law_flies_as_c_with_its_state_held(tmp_path: Path) -> None:
    """closed_loop.c: q is kept between calls, from a half turn home."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    reference = lc.reference("so3", ["0.3*sin(t/5)", "0.2*cos(t/5)", "0.1*t"])
    folder = generate_closed_loop(
        "so3",
        tmp_path / "flight",
        inertia=INERTIA,
        law=hybrid(),
        reference=reference,
        X0=np.diag([1.0, -1, -1]),
        duration=40,
        step=0.02,
    )
    printed = run_example(folder, "so3", "closed_loop.c")
    assert float(printed.splitlines()[-1].split()[2]) < 1e-3


def test_the_loop_holds_states_of_every_kind() -> None:
    """q held, a integrated, X_hat on the group: the published offset, and adaptation from where the law starts."""
    t = np.linspace(0, 30, 4)
    still = lc.reference("so3", ["0", "0", "0"])
    run = lc.closed_loop(
        "so3", law=hybrid(), inertia=INERTIA, reference=still, X0=np.diag([1.0, -1, -1]), t=t, sample=0.02, step=0.02
    )
    assert run.error[-1] < 1e-4
    assert set(run.states["q"].ravel()) == {1.0}
    moving = lc.reference("so3", ["0.3*sin(t)", "0.2*cos(t)", "0.1*t"])
    learning = lc.closed_loop("so3", law=adaptive(), inertia=INERTIA, reference=moving, t=t, step=0.02)
    assert learning.states["a"][0] == pytest.approx([1, 1, 1, 0, 0, 0])
    assert learning.outputs["phi"][-1] < learning.outputs["phi"][0] / 10
    law = lc.output_feedback_law("so3", directions=[[0, 0, 1]], target_directions=[[0, 0.6, 0.8]], r=3, g=4, G=1.5)
    X = expm(SO3.hat([0.9, 0, 0]))
    far = lc.closed_loop(
        "so3", law=law, inertia=INERTIA, X0=X, xi0=[0.3, 1.1, 1.6], t=[0, 100, 200], states={"X_hat": X}, step=0.02
    )
    y = far.X[-1].T[:, 2]
    assert np.arccos(y @ [0, 0.6, 0.8]) == pytest.approx(0.3585656, abs=1e-5)
    assert np.linalg.norm(far.xi[-1]) == pytest.approx(1.6802515, abs=1e-5)
