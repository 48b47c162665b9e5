"""lc.simulate of a plan: its own system, with drift, equation, start and inertia, against scipy."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InputError

TURN = lc.build("so3").exp(np.array([0.4, -0.7, 0.5]))
START = lc.build("so3").exp(np.array([0.1, 0.2, 0.3]))
QUBIT = lc.build("su2").exp(np.array([0.3, 0.5, -1.0]))
INERTIA = np.diag([1.0, 2.0, 3.0])


def drift(t: float) -> np.ndarray[Any, Any]:
    return np.array([0.3 * np.sin(t), 0.0, t / 5])


def optimal() -> Any:
    return lc.steer("so3", TURN, ["w1", "w2"], 1.5)


def drifting() -> Any:
    entries = ["0.3*sin(t)", "0", "t/5"]
    return lc.steer("so3", TURN, ["w1", "w2"], 1.5, "direct", drift=entries, start=START, polish=False, starts=4)


def right() -> Any:
    return lc.steer(
        "su2", QUBIT, ["sx", "sy"], 2.0, "direct", equation="right", drift=[0, 0, 0.7], polish=False, starts=4
    )


def torques() -> Any:
    return lc.steer("so3", TURN, ["w1", "w2", "w3"], 2.0, dynamics="second_order", inertia=[1, 2, 3], bounds=5)


def integrated(rate: Callable[[float, Any], Any], y0: Any, knots: Any) -> Any:
    """DOP853 from knot to knot, so that no jump of the controls lies inside a step."""
    y = np.asarray(y0).astype(complex if np.iscomplexobj(y0) else float)
    for first, last in pairwise(knots):
        inside = lambda t, z, a=first, b=last: rate(float(np.clip(t, a + 1e-12, b - 1e-12)), z)  # noqa: E731
        y = solve_ivp(inside, (first, last), y, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    return y


def oracle(plan: Any, X0: Any, end: float, extra: Callable[[float], Any], *, left: bool) -> Any:
    d = plan.group.degree

    def rate(t: float, flat: Any) -> Any:
        X, A = flat.reshape(d, d), plan.group.hat(plan.u(t) + extra(t))
        return (X @ A if left else A @ X).ravel()

    marks = np.unique(np.clip([0.0, *plan.u.breakpoints, end], 0, end))
    return integrated(rate, X0.ravel(), marks).reshape(d, d)


CASES = {
    "optimal": (optimal, np.eye(3), lambda t: 0.0, True),
    "drifting": (drifting, START, drift, True),
    "right": (right, np.eye(2, dtype=complex), lambda t: np.array([0, 0, 0.7]), False),
}


@pytest.mark.parametrize("name", CASES)
def test_a_plan_is_flown_on_its_own_system(name: str) -> None:
    make, X0, extra, left = CASES[name]
    plan = make()
    run = lc.simulate(plan)
    assert isinstance(run, lc.Trajectory)
    assert run.X.shape == (101, *X0.shape)
    np.testing.assert_allclose(run.t[[0, -1]], [0, plan.duration])
    np.testing.assert_allclose(run.X[-1], plan.X_final, rtol=0, atol=1e-10)
    end = 0.61 * plan.duration
    again = lc.simulate(plan.group, plan, t=[0, 0.5, end], rtol=1e-12)
    np.testing.assert_array_equal(again.X[0], X0)
    np.testing.assert_allclose(again.X[-1], oracle(plan, X0, end, extra, left=left), rtol=0, atol=1e-8)
    np.testing.assert_allclose(again.at(0.4), plan.X(0.4), rtol=0, atol=1e-9)
    second = lc.build(plan.group).product_exp(again.g[-1])
    np.testing.assert_allclose(again.X[0] @ second, again.X[-1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_a_plan_is_flown_from_other_places_and_times(name: str) -> None:
    make, X0, _, left = CASES[name]
    plan = make()
    later = lc.simulate(plan, t=[0.5, 1.0, plan.duration])
    np.testing.assert_allclose(later.X, plan.X(later.t), rtol=0, atol=1e-9)
    other = lc.build(plan.group).exp(np.array([0.3, -0.2, 0.6]))
    many = lc.simulate(plan, t=[0, plan.duration], X0=np.stack([X0, other]))
    assert many.X.shape == (2, 2, *X0.shape)
    moved = other @ np.linalg.solve(X0, plan.X_final) if left else plan.X_final @ np.linalg.solve(X0, other)
    np.testing.assert_allclose(many.X[-1, 0], plan.X_final, rtol=0, atol=1e-9)
    np.testing.assert_allclose(many.X[-1, 1], moved, rtol=0, atol=1e-9)


def test_torques_move_the_body_that_the_plan_is_of() -> None:
    plan = torques()
    run = lc.simulate(plan, t=[0, 0.7, 2])

    def rate(t: float, y: Any) -> Any:
        X, w = y[:9].reshape(3, 3), y[9:]
        return np.concatenate(
            [(X @ lc.group("so3").hat(w)).ravel(), np.linalg.solve(INERTIA, plan.u(t) - np.cross(w, INERTIA @ w))]
        )

    marks = np.unique(np.clip([0.0, *plan.u.breakpoints, 0.7], 0, 0.7))
    expected = integrated(rate, np.concatenate([np.eye(3).ravel(), np.zeros(3)]), marks)
    np.testing.assert_allclose(run.X[1].ravel(), expected[:9], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.xi[1], expected[9:], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.X[-1], plan.X_final, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.at(0.9), plan.X(0.9), rtol=0, atol=1e-9)
    later = lc.simulate(plan, t=[0.7, 2.0], X0=START)
    np.testing.assert_allclose(later.X[-1], START @ np.linalg.solve(run.X[1], run.X[-1]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(later.xi[0], run.xi[1], rtol=0, atol=1e-9)
    with pytest.raises(InputError, match="events goes with body velocities"):
        lc.simulate(plan, events=[lc.Event("X[0][0]")])
    with pytest.raises(InputError, match="charts"):
        _ = run.charts


@pytest.mark.parametrize("damping", [None, [[0.5, 0.1, 0], [0.1, 0.4, 0], [0, 0, 0.3]]])
def test_torques_that_oscillate_meet_the_drag_that_the_plan_was_made_for(damping: Any) -> None:
    target = lc.build("so3").exp(np.array([0.1, 0.0, 0.2]))
    plan = lc.steer("so3", target, ["w1", "w2"], 2.0, "symmetric_product", inertia=[1, 2, 3], damping=damping, cycles=3)
    np.testing.assert_allclose(plan.X(2.0), plan.X_final, rtol=0, atol=1e-8)
    run = lc.simulate(plan, t=[0, 1.1, 2.0])
    D = np.zeros((3, 3)) if damping is None else np.array(damping)

    def rate(t: float, y: Any) -> Any:
        w = y[9:]
        force = plan.u(t) - np.cross(w, INERTIA @ w) - D @ w
        return np.concatenate([(y[:9].reshape(3, 3) @ lc.group("so3").hat(w)).ravel(), np.linalg.solve(INERTIA, force)])

    expected = integrated(rate, np.concatenate([np.eye(3).ravel(), np.zeros(3)]), [0.0, 1.1])
    np.testing.assert_allclose(run.X[1].ravel(), expected[:9], rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.xi[1], expected[9:], rtol=0, atol=1e-7)


def test_what_cannot_be_flown_is_said() -> None:
    plan = optimal()
    for words, arguments, named in (
        ("one of so3, not of se2", ("se2", plan), {}),
        (r"t = 1.6 is outside", (plan,), {"t": [0, 1.6]}),
        ("simulated as it is", (plan,), {"eps": 0.5}),
        ("give an input u", ("so3",), {"t": [0, 1]}),
        ("give the times t", ("so3", [1.0, 0, 0]), {}),
        ("rtol must be positive", (plan,), {"rtol": 0.0}),
    ):
        with pytest.raises(InputError, match=words):
            lc.simulate(*arguments, **named)


def test_a_saved_plan_ends_at_the_same_place_in_a_fresh_process(tmp_path: Path) -> None:
    plan = optimal()
    file = plan.save(tmp_path / "plan.npz")
    code = f"import lie_codegen as lc; p = lc.load({str(file)!r}); print(lc.simulate(p).X[-1].tobytes().hex(), p.X_final.tobytes().hex())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [lc.simulate(plan).X[-1].tobytes().hex(), plan.X_final.tobytes().hex()]
    run = lc.simulate(plan)
    assert lc.load(run.save(tmp_path / "run.npz")) == run
