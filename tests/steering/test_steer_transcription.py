"""The transcription's own derivatives, its record of what was done, and what it says where there is no manoeuvre."""

from __future__ import annotations

import collections
import itertools
import signal
import threading
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InfeasibleError, SteeringError, SteeringInputError, UncontrollableError
from lie_codegen.groups.maps.packed_arrays import packed_elements
from lie_codegen.steering.accessibility import with_drift
from lie_codegen.steering.constraints import Ball
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.transcription import problem as transcription_problem
from lie_codegen.steering.transcription import watched_solver
from lie_codegen.steering.transcription.stage import interval
from lie_codegen.steering.transcription.structure import Structure

G = (0.4, -0.3, 1.2)


@pytest.mark.parametrize(
    ("name", "controls", "shape", "rough"),
    [
        ("so3", (0, 1), {}, 1e-5),
        ("se2", (0, 1), {"free_time": True}, 1e-5),
        ("su2", (0, 2), {}, 1e-5),
        ("so3", (0, 1), {"second_order": True}, 5e-3),
    ],
)
def test_derivatives_of_an_interval_are_those_casadi_finds(
    name: str, controls: tuple[int, ...], shape: dict[str, bool], rough: float
) -> None:
    """First ones to rounding; second ones to the square of the angle of a step, which is what they claim."""
    group, rng = lc.group(name), np.random.default_rng(3)
    structure = Structure(group, controls, 40, **shape)
    step = interval(structure)
    w, p = ca.SX.sym("w", structure.width), ca.SX.sym("p", structure.parameters)
    multipliers = rng.normal(size=step.rows)
    total = 0.7 * step.cost(w, p) + ca.dot(ca.DM(multipliers), step.value(w, p))
    exact = ca.Function("exact", [w, p], [ca.jacobian(step.value(w, p), w), *reversed(ca.hessian(total, w))])
    at = rng.normal(size=structure.width)
    at[: structure.size] = packed_elements(group, expm(group.hat(rng.normal(size=group.dim))))
    numbers = rng.uniform(0.5, 1.5, size=structure.parameters)
    if structure.second_order:
        first, last = structure.parameter_ranges["masses"]
        numbers[first:last] = np.concatenate([np.diag((1.0, 2, 3)).ravel(), np.diag((1, 1 / 2, 1 / 3)).ravel()])
    jacobian, gradient, hessian = (np.asarray(each) for each in exact(at, numbers))
    np.testing.assert_allclose(np.asarray(step.slope(at, numbers)[1]), jacobian, atol=1e-14)
    slope, curve = (np.asarray(each) for each in step.curve(at, numbers, 0.7, multipliers))
    np.testing.assert_allclose(slope, gradient, atol=1e-14)
    np.testing.assert_allclose(curve, hessian, atol=rough * np.max(np.abs(hessian)))
    np.testing.assert_array_equal(curve, curve.T)


def test_the_compiled_program_is_the_symbolic_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same plan without a compiler, to the accuracy of the solver; and the same constraints at any point."""
    group = lc.group("se2")
    options = {"intervals": 12, "starts": 1, "obstacles": [Ball((0.5, 0.05), 0.2)], "via": [(0.5, (0.0, 0.5, 0.4))]}
    target = (0.3, 1.0, 0.1)
    quick = lc.steer(group, target, (0, 1), 1.0, **options)
    structure = Structure(group, (0, 1), 12, balls=1, via=(6,))
    built = transcription_problem.program(structure, "fatrop")
    symbolic = transcription_problem._symbolic(structure)
    same = ca.Function("g", [symbolic["x"], symbolic["p"]], [symbolic["g"], symbolic["f"]])
    rng = np.random.default_rng(0)
    x, p = rng.normal(size=structure.variables), rng.normal(size=structure.parameters)
    np.testing.assert_allclose(
        np.asarray(built.solver.get_function("nlp_g")(x, p)), np.asarray(same(x, p)[0]), atol=1e-12
    )
    np.testing.assert_allclose(float(built.solver.get_function("nlp_f")(x, p)), float(same(x, p)[1]), rtol=1e-12)
    transcription_problem.program.cache_clear()
    monkeypatch.setattr(transcription_problem, "compiled", lambda structure, solver: None)
    slow = lc.steer(group, target, (0, 1), 1.0, **options)
    transcription_problem.program.cache_clear()
    assert slow.cost == pytest.approx(quick.cost, rel=1e-6)


class Endless:
    """Whoever unpickles it counts for ever, inside C."""

    def __reduce__(self) -> Any:
        return collections.deque, (itertools.repeat(0), 0)


def test_a_solver_that_takes_too_long_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """fatrop can loop for ever; ipopt then takes over, and the next problem finds a new process."""
    group, options = lc.group("so3"), {"intervals": 16, "starts": 1, "bounds": 20.0}
    transcription_problem.program.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(watched_solver, "_PATIENCE", 0.1)
        patch.setitem(transcription_problem._FATROP, "print_level", Endless())
        plan = lc.steer(group, G, (0, 1), 1.0, **options)
    transcription_problem.program.cache_clear()
    assert "of processor time" in plan.details["solves"][0].message
    assert plan.details["solver"] == "ipopt"
    assert lc.steer(group, G, (0, 1), 1.0, **options).details["solver"] == "fatrop"


@pytest.mark.skipif(not watched_solver._COUNTS, reason="no timer of processor time")
def test_time_in_which_a_solver_does_not_run_is_not_counted() -> None:
    """The process is stopped for longer than it may take, and answers all the same."""
    worker = watched_solver._Worker()
    try:
        worker.ask(("none", "none", {}, {}), 0.2)  # an error is an answer
        assert worker._running is not None
        process = worker._running.process
        process.send_signal(signal.SIGSTOP)
        threading.Timer(0.5, lambda: process.send_signal(signal.SIGCONT)).start()
        assert isinstance(worker.ask(("none", "none", {}, {}), 0.2), RuntimeError)
    finally:
        worker.end()


def test_every_solve_is_on_record_and_told_when_asked() -> None:
    lines: list[str] = []
    plan = lc.steer(lc.group("so3"), G, (0, 1), 1.0, bounds=3.0, solver="ipopt", intervals=16, progress=lines.append)
    solves = plan.details["solves"]
    assert len(lines) >= len(solves) >= 3
    assert "ipopt from shooting" in lines[0]
    assert plan.details["iterations"] == sum(solve.iterations for solve in solves)
    first = solves[0]
    assert len(first.residuals["inf_pr"]) == first.iterations + 1
    assert first.residuals["inf_du"][-1] < 1e-6
    assert first.seconds > 0


def test_solvers_agree_on_bounded_wheels() -> None:
    costs = [
        lc.steer(
            lc.group("so3"), G, (0, 1), 1.0, bounds=4.5, rate_bounds=60.0, rest=True, intervals=32, starts=1, solver=s
        )
        for s in ("fatrop", "ipopt", "auto")
    ]
    assert costs[0].cost == pytest.approx(costs[1].cost, rel=1e-6)
    assert costs[2].details["solver"] == "fatrop"
    assert max(plan.error for plan in costs) < 1e-8


def test_bounds_hold_at_every_knot_to_rounding() -> None:
    plan = lc.steer(lc.group("so3"), G, (0, 1), 1.0, bounds=(-2.6, 2.5), intervals=32, starts=1)
    u = plan.u(np.concatenate([[0.0], plan.u.breakpoints, [1.0]]))[:, :2]
    assert np.min(u) >= -2.6
    assert np.max(u) <= 2.5
    assert np.max(u) > 2.49


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rate_bounds": 0.5, "rest": True}, "times the rate bound of w1"),
        ({"bounds": {"w2": 0.05}}, "times the bound of w2"),
        ({"bounds": (0.5, 1.0)}, "bounds of w2 exclude zero"),
        ({"bounds": 0.1, "objective": "time", "longest": 2.0}, "larger `longest`"),
    ],
)
def test_the_limit_in_the_way_is_named(options: dict[str, object], words: str) -> None:
    with pytest.raises(SteeringError, match=words):
        lc.steer(lc.group("so3"), G, (0, 1), 1.0, intervals=12, starts=1, **options)


def test_ends_inside_an_obstacle_are_refused_at_once_by_the_users_number() -> None:
    group = lc.group("se2")
    with pytest.raises(InfeasibleError, match="target itself is inside obstacle 2"):
        lc.steer(group, (0, 1.0, 0), (0, 1), 1.0, obstacles=[Ball((5, 5), 1.0), Ball((1, 0), 0.3)])
    with pytest.raises(InfeasibleError, match="via point 1 itself is inside obstacle 1"):
        lc.steer(group, (0, 1.0, 0), (0, 1), 1.0, obstacles=[Ball((0.5, 0.5), 0.2)], via=[(0.5, (0, 0.5, 0.5))])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"via": [0.5]}, "a pair"),
        ({"rate_bounds": (0.1, 0.5)}, "allow zero"),
        ({"objective": "time", "bounds": 1, "longest": -1}, "positive multiple"),
    ],
)
def test_more_refusals(options: dict[str, object], words: str) -> None:
    with pytest.raises(SteeringInputError, match=words):
        lc.steer(lc.group("so3"), G, (0, 1), 1.0, method="transcription", **options)


def end(plan: Plan, drift: NDArray[np.float64]) -> NDArray[np.float64]:
    """X at the end by DOP853 on the entries."""
    d = plan.group.degree
    state = np.eye(d, dtype=plan.X_final.dtype).ravel()

    def rate(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return (x.reshape(d, d) @ plan.group.hat(plan.u(t) + drift)).ravel()

    for a, b in pairwise(np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]])):
        state = solve_ivp(rate, (a, b), state, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    return state.reshape(d, d)


def test_a_drift_helps_one_control_to_steer_a_qubit_and_a_car() -> None:
    """A single field against a precession, whose end conditions also hold at minus the target; a car that cannot stop."""
    su2, field = lc.group("su2"), np.array([0.0, 0.0, 1.0])
    plan = lc.steer(su2, (0.5, 0.2, 1.0), ("sx",), 6.0, drift=field, bounds=2.0, intervals=32, starts=2)
    np.testing.assert_allclose(end(plan, field), plan.target, atol=1e-7)
    se2, forward = lc.group("se2"), np.array([0.0, 1.0, 0.0])
    target = np.array([[0, -1, 2.0], [1, 0, 2.0], [0, 0, 1]])
    car = lc.steer(se2, target, ("omega",), 4.0, drift=forward, bounds=1.0, objective="time", intervals=32, starts=2)
    np.testing.assert_allclose(end(car, forward), target, atol=1e-7)
    assert (
        2 + np.pi / 2 - 2 + 1 < car.duration
    )  # Dubins: quarter turn of radius 1 between two straight pieces of length 1
    assert car.duration < 1.02 * (2 + np.pi / 2)


def test_what_a_drift_cannot_mend() -> None:
    so3 = lc.group("so3")
    with pytest.raises(UncontrollableError, match="even with the drift"):
        lc.steer(so3, G, ("w1",), 1.0, drift=(1.0, 0, 0))
    assert with_drift(so3.algebra, (0,), np.array([0, 0, 1.0])) == 3
    assert with_drift(so3.algebra, (0,), np.array([1.0, 0, 0])) == 1


@pytest.mark.parametrize(("name", "target", "cost"), [("so3", 0.8, 0.8 * (4 * np.pi - 0.8)), ("h3", 1.0, 4 * np.pi)])
def test_targets_that_are_a_bracket_alone(name: str, target: float, cost: float) -> None:
    """Conjugate points: the phase of the loop is free, and the Hessian singular."""
    plan = lc.steer(lc.group(name), (0, 0, target), (0, 1), 1.0, bounds=5.0, starts=1)
    assert cost < plan.cost < cost * (1 + 1e-4)
    assert plan.error < 1e-8


def test_bounds_by_rows_and_plans_that_are_the_same_are_equal() -> None:
    """The wall time of a solver's call made two plans of the same problem differ."""
    given = [{"omega": (-1, 1), "vx": (-0.2, 1)}, [(-1, 1), (-0.2, 1)], np.array([[-1, 1], [-0.2, 1]])]
    plans = [
        lc.steer("se2", (1, 0.5, 0.3), controls=("omega", "vx"), duration=3.0, method="transcription", bounds=bounds)
        for bounds in given
    ]
    assert plans[0] == plans[1] == plans[2]
