"""method="direct": reached goals, least costs, goal sets, honest refusals; against DOP853, published values and certificates."""

from __future__ import annotations

import pickle
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.codegen.templates import template_folder
from lie_codegen.steering.direct import method
from lie_codegen.steering.direct.assemble import Manoeuvre, constant_pieces, linear_pieces
from lie_codegen.steering.direct.chain import end as chain_end
from lie_codegen.steering.direct.compiled import machine
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.magnus_flow import end_reached, states_reached
from lie_codegen.steering.direct.numpy_search import NumpySearch
from lie_codegen.steering.direct.problem import manoeuvre
from lie_codegen.steering.direct.programme import Settings
from lie_codegen.steering.direct.starts import starts

SX, SY, SZ = np.array([[0, 1], [1, 0]]), np.array([[0, -1j], [1j, 0]]), np.diag([1, -1])
HADAMARD = (SX + SZ) / np.sqrt(2)
CNOT = np.eye(4, dtype=complex)[[0, 1, 3, 2]]


def end_of_flight(plan: Any, drift: Any = None, start: Any = None, right: bool = False) -> np.ndarray:
    """Where the true system ends, by DOP853 from breakpoint to breakpoint."""
    group, d = plan.group, plan.group.degree
    fall = (
        (lambda t: np.zeros(group.dim)) if drift is None else drift if callable(drift) else lambda t: np.asarray(drift)
    )
    X = np.eye(d, dtype=group.basis.dtype) if start is None else np.asarray(start, dtype=group.basis.dtype)
    knots = np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]])
    for a, b in pairwise(knots):
        inside = lambda t, a=a, b=b: min(max(t, a + 1e-12 * (b - a)), b - 1e-12 * (b - a))  # noqa: E731

        def rate(t: float, x: np.ndarray, inside: Any = inside) -> np.ndarray:
            A = group.hat(plan.u(inside(t)) + fall(t))
            Y = x.reshape(d, d)
            return (A @ Y if right else Y @ A).ravel()

        X = solve_ivp(rate, (a, b), X.ravel(), method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1].reshape(d, d)
    return X


QUBIT: dict[str, Any] = {"drift": [0, 0, 1], "bounds": {"sx": 1, "sy": 0.5}}


@pytest.mark.parametrize(("gate", "least"), [(-1j * HADAMARD, 2.40915), (1j * HADAMARD, 2.89735), (1j * SX, 1.64536)])
def test_bounded_qubit_gates_cost_what_shooting_found(gate: np.ndarray, least: float) -> None:
    plan = lc.steer(lc.group("su2"), gate, ("sx", "sy"), 6.0, **QUBIT)
    assert plan.method == "direct"
    assert plan.status.name == "LOCAL"
    assert plan.cost == pytest.approx(least, rel=2e-5)
    assert np.max(np.abs(end_of_flight(plan, [0, 0, 1]) - gate)) < 1e-8
    peaks = np.max(np.abs(plan.inputs(np.linspace(0, 6, 5001))), axis=0)
    assert np.all(peaks <= [1 + 1e-12, 0.5 + 1e-12])
    assert plan.details["agree"] >= 3
    assert plan.violation == {"end": plan.error, "bound": 0.0}


def test_right_invariant_plans_are_flown_by_schroedingers_equation() -> None:
    start = expm(lc.group("su2").hat([0.3, -0.4, 0.2]))
    plan = lc.steer(lc.group("su2"), 1j * HADAMARD, ("sx", "sy"), 6.0, equation="right", start=start, **QUBIT)
    assert np.max(np.abs(end_of_flight(plan, [0, 0, 1], start, right=True) - 1j * HADAMARD)) < 1e-8
    assert np.max(np.abs(end_of_flight(plan, [0, 0, 1], start) - 1j * HADAMARD)) > 1e-2


@pytest.mark.parametrize("right", [False, True])
@pytest.mark.parametrize("pieces", [1, 2, 7])
def test_the_end_of_constant_pieces_is_their_product_in_order(pieces: int, right: bool) -> None:
    group, rng = lc.group("su2"), np.random.default_rng(pieces)
    start = expm(group.hat([0.3, -0.4, 0.2]))
    task = manoeuvre(group, np.eye(2), ("sx", "sy"), 3.0, [0, 0, 1], 1, None, start, "right" if right else "left")
    u, h = rng.uniform(-1, 1, (pieces, 2)), 3.0 / pieces
    X = start
    for row in u:
        E = expm(h * group.hat([*row, 1.0]))
        X = E @ X if right else X @ E
    drive = Drive(task.system, Inputs.constant(np.linspace(0, 3, pieces + 1), u))
    np.testing.assert_allclose(end_reached(drive), X, atol=1e-14)
    np.testing.assert_allclose(states_reached(drive, 3)[1][-1], X, atol=1e-14)


def test_goal_sets_cost_what_transversal_shooting_found() -> None:
    so3, se2 = lc.group("so3"), lc.group("se2")
    d = (0.48, -0.6, 0.64)
    plan = lc.steer(so3, lc.Pointing(axis=(0, 0, 1), direction=d), ("w1", "w2"), 1.0)
    assert plan.cost == pytest.approx(np.arccos(d[2]) ** 2, rel=1e-6)
    plan = lc.steer(so3, lc.Pointing(axis=(1, 0, 0), direction=d), ("w1", "w2"), 1.0)
    assert plan.cost == pytest.approx(2.473659, rel=2e-5)
    np.testing.assert_allclose(end_of_flight(plan)[:, 0], d, atol=1e-8)
    for point, least in (((0, 1), 5.161601), ((-1, 0.5), 1.880744), ((0.5, 2), 9.288260)):
        plan = lc.steer(se2, lc.Position(point), ("omega", "vx"), 1.0)
        assert plan.cost == pytest.approx(least, rel=2e-5)
        np.testing.assert_allclose(end_of_flight(plan)[:2, 2], point, atol=1e-8)


def test_cosets_leave_free_what_they_say() -> None:
    so3 = lc.group("so3")
    T, start = expm(so3.hat([0.4, -0.3, 0.7])), expm(so3.hat([0.1, 0.2, 0.3]))
    right = lc.steer(so3, lc.Coset(T, free=("w3",)), ("w1", "w2"), 1.0)
    # X in T exp(a w3): the third column is T's
    np.testing.assert_allclose(end_of_flight(right)[:, 2], T[:, 2], atol=1e-8)
    pointing = lc.steer(so3, lc.Pointing((0, 0, 1), T[:, 2]), ("w1", "w2"), 1.0)
    assert right.cost == pytest.approx(pointing.cost, rel=1e-6)
    left = lc.steer(so3, lc.Coset(T, free=("w1",), side="left"), ("w1", "w2"), 1.0, start=start)
    np.testing.assert_allclose(end_of_flight(left, start=start)[0], T[0], atol=1e-8)


def test_fuel_is_bang_off_bang_and_as_cheap_as_words() -> None:
    so3 = lc.group("so3")
    plan = lc.steer(so3, expm(so3.hat([0.4, -0.3, 0.9])), ("w1", "w2"), 5.0, bounds=1, objective="fuel")
    assert plan.cost == pytest.approx(3.182836, rel=2e-5)
    t = np.linspace(0, 5, 200_001)
    assert np.trapezoid(np.sum(np.abs(plan.inputs(t)), axis=1), t) == pytest.approx(plan.cost, rel=1e-3)
    assert np.mean(np.abs(plan.inputs(t)) < 1e-9) > 0.2


def test_a_turning_control_is_a_constant_one_seen_from_a_turning_frame() -> None:
    so3, w = lc.group("so3"), 1.3
    T0 = expm(so3.hat([0.4, -0.3, 0.7]))
    turning = lc.steer(so3, T0, (lambda t: (np.cos(w * t), np.sin(w * t), 0.0),), 6.0)
    texts = lc.steer(so3, T0, (("cos(1.3*t)", "sin(1.3*t)", 0),), 6.0)
    still = lc.steer(so3, T0 @ expm(so3.hat([0, 0, 6 * w])), ("w1",), 6.0, drift=[0, 0, w])
    assert turning.cost == pytest.approx(1.40429, rel=2e-5)
    assert still.cost == pytest.approx(1.40429, rel=2e-5)
    assert texts.cost == turning.cost
    t = np.linspace(0.1, 5.9, 7)
    expected = texts.inputs(t) * np.column_stack([np.cos(w * t), np.sin(w * t), 0 * t])
    np.testing.assert_allclose(texts.u(t), expected, atol=1e-12)
    assert np.max(np.abs(end_of_flight(texts) - T0)) < 1e-8


def test_a_gate_up_to_its_phase_names_the_phase_it_took() -> None:
    su2 = lc.group("su2")
    plan = lc.steer(su2, lc.UpToPhase(HADAMARD), ("sx", "sy"), 6.0, **QUBIT)
    assert plan.cost == pytest.approx(2.40915, rel=2e-5)
    np.testing.assert_allclose(plan.X_final, np.exp(1j * plan.details["phase"]) * HADAMARD, atol=1e-9)
    assert plan.details["fidelity"] == pytest.approx(1, abs=1e-12)


def test_cnot_with_a_coupling_drift_is_found_from_every_start() -> None:
    su4 = lc.group("su4")

    def two(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return su4.vee(-0.5j * np.kron(a, b))

    local = [two(s, np.eye(2)) for s in (SX, SY)] + [two(np.eye(2), s) for s in (SX, SY)]
    plan = lc.steer(su4, lc.UpToPhase(CNOT), local, 6.0, drift=two(SZ, SZ), bounds=4, pieces=30, starts=8)
    assert plan.cost == pytest.approx(8.6643, rel=1e-4)
    assert plan.details["reached"] >= 12
    phase = np.exp(1j * plan.details["phase"])
    # the pieces of the search, played by exponentials
    pulses = plan.details["pieces"]
    X = np.eye(4, dtype=complex)
    for u in pulses.first:
        X = X @ expm(su4.hat(6.0 / 30 * (two(SZ, SZ) + u @ np.array(local))))
    np.testing.assert_allclose(X, phase * CNOT, atol=1e-9)


def test_a_gate_in_short_time_is_found_once_starts_choose_their_phase() -> None:
    """At two thirds of pi of coupling 2 of 16 starts arrive at the phase that they were given, and most at one of their own."""
    two, gate = lc.pauli(2), lc.UpToPhase(CNOT)
    options: dict[str, Any] = {"drift": {"ZZ": 1}, "bounds": 8, "pieces": 30, "polish": False}
    plan = lc.steer(two, gate, ("XI", "YI", "IX", "IY"), 2.0, **options)
    assert plan.error < 1e-9
    assert len(plan.details["tried"]) == 2
    assert plan.details["reached"] >= 8
    X = plan.X_final
    np.testing.assert_allclose(X, np.exp(1j * plan.details["phase"]) * CNOT, atol=1e-9)


def test_random_feasible_targets_are_reached() -> None:
    rng = np.random.default_rng(3)
    reached = 0
    systems = [
        ("so3", ("w1",), [0, 0, 1]),
        ("se2", ("omega",), [0, 1, 0]),
        ("su3", ("l1", "l3", "l7"), None),
        ("se3", ("w1", "w2", "w3"), [0, 0, 0, 1, 0, 0]),
    ]
    for name, controls, drift in systems:
        group = lc.group(name)
        rows = [group.labels.index(label) for label in controls]
        for _ in range(2):
            target = np.eye(group.degree, dtype=group.basis.dtype)
            for _ in range(37):
                u = np.zeros(group.dim) if drift is None else np.array(drift, dtype=float)
                u[rows] += rng.uniform(-1, 1, len(rows))
                target = target @ expm(group.hat(5.0 / 37 * u))
            plan = lc.steer(group, target, controls, 5.0, method="direct", drift=drift, bounds=1, polish=False)
            reached += plan.error < 1e-9
    assert reached == 8


def test_refusals_prove_or_say_that_they_do_not() -> None:
    su2 = lc.group("su2")
    with pytest.raises(lc.errors.InfeasibleError) as proved:
        lc.steer(su2, 1j * SX, ("sx", "sy"), 1.0, bounds=0.5)
    # half a turn (pi) at |u| <= sqrt(1/2) rad/s in a second: the angles of the matrix are half as large
    assert proved.value.certificate.need > proved.value.certificate.most
    with pytest.raises(lc.errors.SteeringError) as open_:
        lc.steer(su2, np.eye(2), ("sx", "sy"), 6.0, starts=4, rounds=2, seed=5, **QUBIT)
    assert not isinstance(open_.value, lc.errors.InfeasibleError)
    assert open_.value.best.status.name == "NOT_FOUND"
    assert open_.value.violation["end"] > 0.1
    assert "longer" not in str(open_.value)
    with pytest.raises(lc.errors.InfeasibleError):
        lc.steer(lc.group("se2"), lc.Position((3.0, 0.0)), ("omega",), 2.0, drift=[0, 1, 0], bounds=1)
    with pytest.raises(lc.errors.UncontrollableError):
        lc.steer(su2, 1j * SX, ("sz",), 1.0, bounds=1)


def test_certificates_never_refuse_what_was_made_from_admissible_controls() -> None:
    rng = np.random.default_rng(8)
    from lie_codegen.steering.direct.certificates import certificate

    for name, controls in (
        ("so3", ("w1", "w2")),
        ("se2", ("omega", "vx")),
        ("su3", ("l1", "l4", "l8")),
        ("se3", ("w1", "w2", "v1")),
    ):
        group = lc.group(name)
        rows = [group.labels.index(label) for label in controls]
        for _ in range(20):
            target = np.eye(group.degree, dtype=group.basis.dtype)
            sign = rng.choice([-1, 1], len(rows))
            for _ in range(5):
                u = np.zeros(group.dim)
                u[rows] = sign * rng.uniform(0.9, 1.0)
                target = target @ expm(group.hat(0.3 * u))
            assert certificate(manoeuvre(group, target, controls, 1.5, None, 1.0, None, None, "left")) is None


def test_the_same_seed_gives_the_same_answer_and_guesses_are_starts() -> None:
    su2 = lc.group("su2")
    one, two = (lc.steer(su2, 1j * SX, ("sx", "sy"), 6.0, seed=7, **QUBIT) for _ in range(2))
    np.testing.assert_array_equal(one.inputs([1.0, 2.0]), two.inputs([1.0, 2.0]))
    again = lc.steer(su2, 1j * SX, ("sx", "sy"), 6.0, guess=one, starts=1, rounds=1, **QUBIT)
    assert again.details["reached"] >= 1
    assert again.cost == pytest.approx(one.cost, rel=1e-5)
    for guess in (lambda t: (0.3 * np.cos(t), 0.1), np.full((7, 2), 0.1)):
        assert lc.steer(su2, 1j * SX, ("sx", "sy"), 6.0, guess=guess, **QUBIT).details["starts"] == 17
    with pytest.raises(lc.errors.ShapeError, match="guess"):
        lc.steer(su2, 1j * SX, ("sx", "sy"), 6.0, guess=np.zeros((7, 3)), **QUBIT)
    copy = pickle.loads(pickle.dumps(one))
    np.testing.assert_array_equal(copy.u([1.0, 2.0]), one.u([1.0, 2.0]))
    for name in ("inputs", "pieces", "system"):
        assert copy.details[name] == one.details[name] == two.details[name]
        assert len(repr(one.details[name]).splitlines()) <= 10


def _task(name: str, controls: tuple[str, ...], **options: Any) -> Manoeuvre:
    group = lc.group(name)
    target = expm(group.hat(0.4 * np.cos(np.arange(group.dim))))
    goal = options.pop("goal", target)
    given = {"drift": None, "bounds": 1.0, "weights": None, "start": None, "equation": "left", **options}
    return manoeuvre(group, goal, controls, 5.0, **given)


@pytest.mark.parametrize("name", ["so3", "se2", "su3", "se3"])
@pytest.mark.parametrize("linear", [False, True])
def test_derivatives_are_exact_and_the_two_machines_agree(name: str, linear: bool) -> None:
    group = lc.group(name)
    task = _task(name, group.labels[:2], drift=0.3 * np.sin(np.arange(group.dim)))
    programme = linear_pieces(task, 6, 2.0) if linear else constant_pieces(task, 6)
    goal, rng = task.goal(np.zeros(3, int)), np.random.default_rng(1)
    u = rng.uniform(-1, 1, (3, *programme.low.shape))
    c, numpy_ = machine(group, 2), NumpySearch()
    for one, two in zip(c.linearise(programme, goal, u), numpy_.linearise(programme, goal, u), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-11)
    # at the goal, where the rows that reduce the residual stand still, central differences
    goal = replace(goal, value=chain_end(programme, u) @ goal.right)
    J = c.linearise(programme, goal, u)[2]
    e = 1e-5
    for slot, i in ((0, 0), (3, 1), (5, 0)):
        up, down = u.copy(), u.copy()
        up[:, slot, i] += e
        down[:, slot, i] -= e
        slope = (c.linearise(programme, goal, up)[1] - c.linearise(programme, goal, down)[1]) / (2 * e)
        np.testing.assert_allclose(J[:, :, slot * 2 + i], slope, atol=1e-8)


def test_a_phase_that_is_free_follows_the_controls() -> None:
    """J'r is the slope of |X - e^(i f) U|^2 / 2 with the best f, far from the goal too; the phase told is that f."""
    two = lc.pauli(2)
    rows = [two.labels.index(label) for label in ("XI", "YI", "IX", "IY")]
    drift = np.eye(15)[two.labels.index("ZZ")]
    task = manoeuvre(two, lc.UpToPhase(CNOT), list(np.eye(15)[rows]), 6.0, drift, 4, None, None, "left")
    programme, goal = constant_pieces(task, 6), replace(task.goal(np.zeros(2, int)), free_phase=True)
    u = np.random.default_rng(4).uniform(-2, 2, (2, 6, 4))
    for solver in (machine(two, 4), NumpySearch()):
        _, r, J = solver.linearise(programme, goal, u)
        slope = np.einsum("lnc,ln->lc", J, r).reshape(u.shape)
        for slot, i in ((0, 0), (3, 1), (5, 3)):
            e = 1e-5 * np.eye(24)[4 * slot + i].reshape(6, 4)
            up, down = (solver.linearise(programme, goal, u + sign * e)[0] for sign in (1, -1))
            np.testing.assert_allclose(slope[:, slot, i], (up**2 - down**2) / 4e-5, atol=1e-8)
        found = solver.reach(programme, goal, u, replace(Settings(), reach_iterations=1))
        X = chain_end(programme, found.u)
        ahead = np.angle(np.sum(np.conj(goal.value) * X, axis=(1, 2)))
        np.testing.assert_allclose(found.phase, ahead, atol=1e-9)


def test_numpy_finds_what_the_compiled_search_finds() -> None:
    task = _task("so3", ("w1", "w2"), drift=[0, 0, 0.5])
    programme = constant_pieces(task, 24)
    goal, u = task.goal(np.zeros(5, int)), np.random.default_rng(2).uniform(-0.3, 0.3, (5, 24, 2))
    costs = []
    for solver in (machine(task.system.group, 2), NumpySearch()):
        reached = solver.reach(programme, goal, u, Settings())
        assert np.all(reached.size < 1e-10)
        costs.append(np.min(solver.descend(programme, goal, reached.u, Settings()).cost))
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)


@pytest.mark.parametrize("size", [1e-3, 0.05, 0.3, 3.0, 40.0])
def test_exponentials_of_any_size_have_the_derivatives_that_numpy_finds(size: float) -> None:
    """Each of the series' lengths, and squarings."""
    group = lc.group("su3")
    task = manoeuvre(group, np.eye(3), ("l1", "l4", "l7"), 1.0, [0] * 7 + [1], None, None, None, "left")
    u = size * np.random.default_rng(3).uniform(-1, 1, (3, 4, 3))
    goal, programme = task.goal(np.zeros(3, int)), constant_pieces(task, 4)
    c, numpy_ = machine(group, 3), NumpySearch()
    for one, two in zip(c.linearise(programme, goal, u), numpy_.linearise(programme, goal, u), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12 * (1 + size))


def test_a_descent_ends_at_the_bottom_of_a_flat_valley_within_bounds() -> None:
    """CNOT in T = 2: proximal steps alone ended 4e-5 to 4e-4 above it, after 150 of them."""
    two = lc.pauli(2)
    local, coupling = ("XI", "YI", "IX", "IY"), {"ZZ": 1}
    options: dict[str, Any] = {"drift": coupling, "bounds": 8, "pieces": 30, "polish": False, "method": "direct"}
    for seed in (1, 2):
        plan = lc.steer(two, lc.UpToPhase(CNOT), local, 2.0, seed=seed, **options)
        assert plan.cost == pytest.approx(54.905878, rel=1e-6)


def test_controls_that_a_step_pushes_out_of_the_box_are_held_at_once() -> None:
    """Starts for a gate at a bound that most controls meet: 44 of 96 arrived within 150 steps where they were clipped, now 56."""
    two = lc.pauli(2)
    rows = [two.labels.index(label) for label in ("XI", "YI", "IX", "IY")]
    drift = np.eye(15)[two.labels.index("ZZ")]
    task = manoeuvre(two, lc.UpToPhase(CNOT), list(np.eye(15)[rows]), 6.0, drift, 1, None, None, "left")
    programme, solver, goal = constant_pieces(task, 30), machine(two, 4), task.goal(np.arange(16) // 4)
    reached = 0
    for seed in range(3):
        found = solver.reach(programme, goal, starts(task, 30, 16, seed, 0), Settings())
        reached += int(np.sum(found.size < 1e-9))
    assert reached >= 26


def test_to_reach_alone_is_an_objective_too() -> None:
    su2 = lc.group("su2")
    plan = lc.steer(su2, 1j * HADAMARD, ("sx", "sy"), 6.0, method="direct", objective="none", **QUBIT)
    assert plan.error < 1e-9
    assert plan.details["objective"] == "none"
    assert plan.cost > 2.89735


@pytest.mark.parametrize("flags", [("-DLIE_CODEGEN_ONE_LANE", "-Wconversion", "-Wno-sign-conversion"), ("-Wno-psabi",)])
def test_the_core_is_clean_c99_with_lanes_and_without(flags: tuple[str, ...], tmp_path: Any) -> None:
    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no compiler")
    (tmp_path / "direct_sizes.h").write_text("#define PARTS 2\nenum { D = 4, N = 15, M = 4 };\n")
    core = template_folder() / "direct_core.c"
    strict = ("-std=c99", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-c", "-O1")
    command = (compiler, *strict, *flags, f"-I{tmp_path}", str(core), "-o", str(tmp_path / "core.o"))
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_valleys_of_whole_turns_are_found_by_steady_starts() -> None:
    """A target of steady controls with noise, at .6234 of the cost of the controls that made it: without steady starts at .7546."""
    se3, rng = lc.group("se3"), np.random.default_rng([1, 316])
    for _ in range(2):  # the second of these targets
        mean = rng.uniform(-1, 1, 3)
        u = np.clip(mean + rng.uniform(-1, 1, (20, 3)), -1, 1)
    X = np.eye(4)
    for row in u:
        X = X @ expm(se3.hat(0.25 * np.array([*row, 1, 0, 0])))
    plan = lc.steer(se3, X, ("w1", "w2", "w3"), 5.0, drift=(0, 0, 0, 1, 0, 0), bounds=1)
    assert plan.cost <= 0.63 * 0.25 * np.sum(u**2)


@pytest.mark.parametrize(
    ("group", "target", "controls", "compiled"),
    [
        ("so3", np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), ("w1", "w2"), True),
        ("so3", np.diag([-1.0, -1.0, 1.0]), ("w1", "w2"), True),
        ("se2", np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]), ("omega", "vx"), False),
    ],
)
def test_controls_of_zero_are_left_where_a_symmetry_keeps_every_step_at_them(
    group: str, target: Any, controls: tuple[str, ...], compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The slope vanishes at zero by hand (brackets alone lead there); the start of zero and a guess of zeros arrive as the others do."""
    if not compiled:
        monkeypatch.setattr(method, "machine", lambda group, controls: NumpySearch())
    asked: dict[str, Any] = {"bounds": 20, "guess": np.zeros((4, 2)), "starts": 4, "rounds": 1, "polish": False}
    plan = lc.steer(group, target, controls, 1.0, method="direct", **asked)
    assert plan.details["reached"] == plan.details["starts"] == 5
    again = lc.steer(group, target, controls, 1.0, method="direct", **asked)
    assert again.cost == plan.cost
    np.testing.assert_allclose(end_of_flight(plan), target, atol=1e-6)
