"""lc.closed_loop(rtol=) by the pair 8(5,3): against scipy on the matrices, batches, references, own states, warm calls, C to take home."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.runtime import compiling

J = np.diag([1.0, 2.0, 3.0])
TIMES = np.linspace(0, 10, 101)
START = {"X0": expm(lc.group("so3").hat([0.5, 1.0, 0.2])), "xi0": [1.0, 0.5, -0.2]}


def by_scipy(
    force: Any, X0: np.ndarray, xi0: np.ndarray, inertia: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """J xi' = J xi x xi + force(t, X, xi) on the entries of X."""
    so3 = lc.group("so3")

    def rate(s: float, y: np.ndarray) -> np.ndarray:
        X, w = y[:9].reshape(3, 3), y[9:]
        turn = np.linalg.solve(inertia, np.cross(inertia @ w, w) + force(s, X, w))
        return np.concatenate([(X @ so3.hat(w)).ravel(), turn])

    run = solve_ivp(
        rate, (t[0], t[-1]), np.concatenate([X0.ravel(), xi0]), method="DOP853", t_eval=t, rtol=1e-13, atol=1e-14
    )
    return run.y[:9].T.reshape(-1, 3, 3), run.y[9:].T


def pd_torque(k_p: float, k_d: float) -> Any:
    law = lc.build(lc.attitude_law("pd", inertia=(1, 2, 3), k_p=k_p, k_d=k_d)).attitude_pd
    return lambda t, X, w: np.asarray(law(np.ascontiguousarray(X), np.ascontiguousarray(w))[0])


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
def test_the_attitude_law_to_every_tolerance(rtol: float) -> None:
    law = lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6)
    run = lc.closed_loop("so3", law=law, inertia=(1, 2, 3), t=TIMES, rtol=rtol, **START)
    X, w = by_scipy(pd_torque(4, 6), START["X0"], np.array(START["xi0"]), J, TIMES)
    assert max(np.max(np.abs(run.X - X)), np.max(np.abs(run.xi - w))) <= max(rtol, 2e-12)
    assert run.error_estimate <= rtol
    assert run.steps < 200
    assert pickle.loads(pickle.dumps(run)) == run


def test_a_reference_is_followed_at_every_stage() -> None:
    reference = lc.reference("so3", ["3*sin(t)/10", "2*cos(2*t)/10", "t/5"])
    law = lc.tracking_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": 4, "K_d": 5})
    given = {"law": law, "inertia": (1, 2, 3), "reference": reference, "t": np.linspace(0, 4, 21), **START}
    run, steps = lc.closed_loop("so3", rtol=1e-10, **given), lc.closed_loop("so3", step=1e-3, **given)
    np.testing.assert_allclose(run.X, steps.X, rtol=0, atol=2e-10)
    np.testing.assert_allclose(run.xi, steps.xi, rtol=0, atol=2e-10)
    np.testing.assert_allclose(run.X_d, steps.X_d, rtol=0, atol=1e-14)


def test_states_of_the_law_and_disturbances_go_along() -> None:
    law = lc.integral_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": 4, "K_d": 5, "K_i": 1})
    given = {
        "law": law, "inertia": (1, 2, 3), "t": np.linspace(0, 5, 11), "disturbance": ["3/10", "sin(t)/5", "0"],
        "reference": lc.reference("so3", ["sin(t)/5", "0", "0"]), **START,
    }  # fmt: skip
    run, steps = lc.closed_loop("so3", rtol=1e-9, **given), lc.closed_loop("so3", step=1e-3, **given)
    np.testing.assert_allclose(run.X, steps.X, rtol=0, atol=2e-9)
    assert run.states.keys() == steps.states.keys() == {"integral"}
    np.testing.assert_allclose(run.states["integral"], steps.states["integral"], rtol=0, atol=2e-9)


@pytest.mark.parametrize("name", ["se3", "se2", "so4"])
def test_free_bodies_on_other_groups(name: str) -> None:
    group = lc.group(name)
    inertia, xi0 = np.arange(1.0, group.dim + 1), np.linspace(0.2, 0.9, group.dim)
    given = {"inertia": inertia, "xi0": xi0, "t": np.linspace(0, 3, 7)}
    run, steps = lc.closed_loop(name, rtol=1e-10, **given), lc.closed_loop(name, step=5e-4, **given)
    np.testing.assert_allclose(run.X, steps.X, rtol=0, atol=1e-9 * np.max(np.abs(steps.X)))
    energy = np.einsum("ti,i,ti->t", run.xi, inertia, run.xi)
    assert np.ptp(energy) < 1e-8


def test_loops_with_inertias_gains_and_starts_of_their_own() -> None:
    rng, N = np.random.default_rng(0), 100
    law = lc.attitude_law("pd", tunable=True)
    inertias = np.array([np.diag(row) for row in rng.uniform(1, 3, (N, 3))])
    k_p, xi0, t = rng.uniform(2, 6, N), rng.normal(size=(N, 3)), np.linspace(0, 5, 6)
    run = lc.closed_loop(
        "so3", law=law, inertia=inertias, gains={"k_p": k_p, "k_d": 5}, xi0=xi0, t=t, rtol=1e-9, threads=2
    )
    for m in (0, 63, 64, 99):
        one = lc.closed_loop(
            "so3", law=law, inertia=inertias[m][None], gains={"k_p": k_p[m], "k_d": 5}, xi0=xi0[m], t=t, rtol=1e-11
        )
        np.testing.assert_allclose(run.X[:, m], one.X[:, 0], rtol=0, atol=2e-9)
        np.testing.assert_allclose(run.xi[:, m], one.xi[:, 0], rtol=0, atol=2e-9)


def test_another_inertia_starts_no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    law = lc.attitude_law("pd", tunable=True)
    given = {"law": law, "gains": {"k_p": 4, "k_d": 6}, "t": TIMES, "rtol": 1e-9, "xi0": [1.0, 0.5, -0.2]}
    lc.closed_loop("so3", inertia=J[None], **given)

    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("a compiler was started")

    monkeypatch.setattr(compiling, "compile_library", refuse)
    run = lc.closed_loop("so3", inertia=np.diag([2.0, 2.0, 5.0])[None], **given)
    assert run.steps < 200


def test_a_velocity_law_moves_the_group_alone() -> None:
    law = lc.attitude_law("p", k_p=2)
    given = {"law": law, "t": np.linspace(0, 3, 7), "X0": START["X0"]}
    run, steps = lc.closed_loop("so3", rtol=1e-10, **given), lc.closed_loop("so3", step=1e-3, **given)
    np.testing.assert_allclose(run.X, steps.X, rtol=0, atol=1e-10)


def test_the_loop_goes_home_as_equal_steps(tmp_path: Path) -> None:
    law = lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6)
    run = lc.closed_loop("so3", law=law, inertia=(1, 2, 3), t=np.linspace(0, 2, 5), rtol=1e-6, **START)
    folder = lc.generate(run, tmp_path / "loop")
    assert (folder / "include").is_dir()
    assert any(path.name.endswith("_loop.c") for path in folder.rglob("*.c"))


def test_other_times_and_events_are_as_exact_as_the_run() -> None:
    """A symmetric free body: xi_1 = cos(k t), k = (J_3 - J_1) w_3 / J_1, vanishes at (pi/2 + m pi)/k."""
    run = lc.closed_loop(
        "so3", inertia=(1, 1, 2), xi0=[1.0, 0.0, 0.8], t=np.linspace(0, 20, 5), rtol=1e-11,
        events=[lc.Event("xi[0]"), lc.Event("X[2][2] - 6/10", direction=-1)],
    )  # fmt: skip
    k = 0.8
    np.testing.assert_allclose(run.events[0].t, (np.pi / 2 + np.pi * np.arange(5)) / k, rtol=0, atol=1e-10)
    assert np.max(np.abs(run.events[0].xi[:, 0])) < 1e-10
    assert np.max(np.abs(run.events[1].X[:, 2, 2] - 0.6)) < 1e-10
    moments = np.sort(np.random.default_rng(0).uniform(0, 20, 30))
    X, xi = run.at(moments)
    np.testing.assert_allclose(xi[:, 0], np.cos(k * moments), rtol=0, atol=5e-11)
    # X(t) = exp(t hat(Omega)) exp(t hat(s e_3)): precession about the momentum J xi = (1, 0, 1.6), and spin
    so3 = lc.group("so3")
    for t, Y in zip(moments, X, strict=True):
        np.testing.assert_allclose(
            Y, expm(t * so3.hat([1.0, 0.0, 1.6])) @ expm(-t * so3.hat([0, 0, 0.8])), rtol=0, atol=1e-10
        )
    one, _ = run.at(3.0)
    assert one.shape == (3, 3)
    with pytest.raises(InputError, match="from 0 to 20"):
        run.at(21.0)


def test_events_and_other_times_are_refused_where_there_are_none() -> None:
    free = {"inertia": (1, 2, 3), "t": np.linspace(0, 1, 3)}
    with pytest.raises(InputError, match="events are of one loop"):
        lc.closed_loop("so3", xi0=np.ones((2, 3)), events=[lc.Event("xi[0] - 2")], **free)
    with pytest.raises(InputError, match="not with step or sample"):
        lc.closed_loop("so3", xi0=np.ones(3), step=0.1, events=[lc.Event("xi[0] - 2")], **free)
    with pytest.raises(InputError, match="only of a single loop"):
        lc.closed_loop("so3", xi0=np.ones(3), step=0.1, **free).at(0.5)


def test_gauss_steps_have_order_six_and_keep_energy_and_momentum() -> None:
    free = {"inertia": (1, 2, 3), "xi0": [0.3, 1.0, 0.2]}
    exact = lc.closed_loop("so3", t=np.linspace(0, 5, 2), rtol=1e-13, **free)
    errors = []
    for step in (0.25, 0.125):
        run = lc.closed_loop("so3", t=np.linspace(0, 5, 2), step=step, method="gauss", **free)
        errors.append(np.max(np.abs(run.X - exact.X)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6, abs=0.2)
    run = lc.closed_loop("so3", t=np.linspace(0, 3000, 31), step=0.1, method="gauss", **free)
    assert run.steps == 30_000
    energy = np.einsum("ti,i,ti->t", run.xi, [1.0, 2, 3], run.xi)
    assert np.ptp(energy) < 1e-14
    assert np.ptp(np.linalg.norm(run.xi * [1, 2, 3], axis=1)) < 1e-14
    usual = lc.closed_loop("so3", t=np.linspace(0, 3000, 31), step=0.1, **free)
    assert np.ptp(np.einsum("ti,i,ti->t", usual.xi, [1.0, 2, 3], usual.xi)) > 1e-7


def test_gauss_steps_of_several_loops_under_a_law() -> None:
    law = lc.attitude_law("pd", tunable=True)
    given = {
        "law": law, "inertia": np.array([J, 2 * J]), "gains": {"k_p": np.array([4.0, 3.0]), "k_d": 6}, "t": np.linspace(0, 3, 4),
        "xi0": [1.0, 0.5, -0.2],
    }  # fmt: skip
    by_gauss, by_pair = (
        lc.closed_loop("so3", step=0.01, method="gauss", **given),
        lc.closed_loop("so3", rtol=1e-11, **given),
    )
    np.testing.assert_allclose(by_gauss.X, by_pair.X, rtol=0, atol=1e-10)
    with pytest.raises(InputError, match="give it a step"):
        lc.closed_loop("so3", method="gauss", **given)
    with pytest.raises(ComputationError, match="too long"):
        lc.closed_loop("so3", inertia=(1, 2, 3), xi0=[50.0, 1, 1], t=[0, 1], step=1.0, method="gauss")


def test_a_tolerance_below_rounding_is_refused() -> None:
    law = lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6)
    with pytest.raises(lc.errors.InputError, match="rtol = 1e-15 is below 1e-14"):
        lc.closed_loop("so3", law=law, inertia=(1, 2, 3), X0=np.eye(3), xi0=[1, 0, 0], t=[0, 1], rtol=1e-15)
