"""Sets of goals with costs of one's own: gates on levels, any phase, cosets of any group; ends judged by SciPy's exponential and by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm, logm
from scipy.stats import unitary_group
from transmon import ANHARMONIC, HX, HY, velocity

import lie_codegen as lc
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.steering.ocp.goal_terms import away, goal_terms


def played(group: lc.MatrixGroup, plan: lc.Plan, drift: np.ndarray, N: int) -> np.ndarray:
    """X' = X hat(u + drift), u constant on N intervals."""
    X, h = np.eye(group.degree), plan.duration / N
    for k in range(N):
        X = X @ expm(h * group.hat(plan.u(h * (k + 0.5)) + drift))
    return X


def met(terms: Any, group: lc.MatrixGroup, X: np.ndarray) -> float:
    """The largest condition at X, from the numbers in it: X v - e, or a sum over the entries that vary."""
    values = terms.values
    if "goal_v0" in values:
        count = len(values) // 2
        return max(float(np.max(np.abs(X @ values[f"goal_v{k}"] - values[f"goal_e{k}"]))) for k in range(count))
    entries = np.array([X[i, j] for i, j in varying_entries(group)])
    parts = [entries.real, entries.imag] if group.is_complex else [entries]
    known = np.concatenate([*parts, [1.0]])
    return max(abs(float(known @ row)) for row in values.values())


def test_a_transmon_ends_in_its_gate_at_a_cost_of_its_own() -> None:
    gate = unitary_group.rvs(2, random_state=4)
    group, drift = lc.group("su3"), velocity(ANHARMONIC)
    plan = lc.steer(
        group, lc.UpToPhase(gate, levels=(0, 1)), (velocity(HX), velocity(HY)), 8.0, drift=drift, bounds=2,
        cost="norm2(u) + 0.5*u1^2", intervals=30, starts=3,
    )  # fmt: skip
    assert plan.status is lc.Status.LOCAL
    block = played(group, plan, drift, 30)[:2, :2]
    overlap = np.trace(gate.conj().T @ block)
    np.testing.assert_allclose(block, overlap / abs(overlap) * gate, atol=1e-7)
    assert plan.details["fidelity"] == pytest.approx(1, abs=1e-9)
    assert plan.details["leakage"] < 1e-9


def test_turns_that_are_free_on_su2_cost_what_the_direct_method_finds() -> None:
    su2, rng = lc.group("su2"), np.random.default_rng(3)
    goal = lc.Coset(expm(su2.hat(rng.normal(size=3))), free=(2,))
    own = lc.steer(su2, goal, (0, 1), 1.0, cost="norm2(u)", intervals=20)
    # X = T exp(s A_3) in the sense of the Bloch sphere: the way is a great circle from e_3 to T e_3
    rotation = np.real(
        np.trace(np.array(goal.element) @ np.diag([1, -1]) @ np.array(goal.element).conj().T @ np.diag([1, -1])) / 2
    )
    assert own.cost == pytest.approx(np.arccos(rotation) ** 2, rel=1e-6)
    X = played(su2, own, np.zeros(3), 20)
    rest = np.linalg.solve(np.array(goal.element), X)
    assert abs(rest[0, 1]) < 1e-7


@pytest.mark.parametrize("side", ["left", "right"])
def test_shifts_along_a_line_are_free(side: str) -> None:
    T = np.eye(3)
    T[:2, 2] = 1, 0.5
    own = lc.steer("se2", lc.Coset(T, free=("vx",), side=side), ("omega", "vx"), 1.0, cost="norm2(u)", intervals=40)
    free = lc.steer("se2", lc.Coset(T, free=("vx",), side=side), ("omega", "vx"), 1.0, method="direct")
    assert own.cost == pytest.approx(free.cost, rel=2e-3)
    X = played(lc.group("se2"), own, np.zeros(3), 40)
    np.testing.assert_allclose(X[:2, :2], np.eye(2), atol=1e-7)
    assert X[1, 2] == pytest.approx(0.5, abs=1e-7)


def test_any_phase_will_do_on_a_unitary_group() -> None:
    pauli = [np.array([[0, 1], [1, 0]]), np.array([[0, -1j], [1j, 0]]), np.diag([1, -1]), np.eye(2)]
    u2 = lc.from_matrices(
        name="u2",
        labels=("x", "y", "z", "p"),
        matrices=[sp.Matrix(-sp.I * sp.Matrix(s) / 2) for s in map(_exact, pauli)],
    )
    gate = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    plan = lc.steer(u2, lc.UpToPhase(gate), ("x", "y"), 2.0, drift=(0, 0, 0, 0.7), cost="norm2(u)", intervals=20)
    X = played(u2, plan, np.array([0, 0, 0, 0.7]), 20)
    assert abs(np.trace(gate @ X)) / 2 == pytest.approx(1, abs=1e-9)
    assert plan.details["fidelity"] == pytest.approx(1, abs=1e-9)


def _exact(matrix: np.ndarray) -> list[list[sp.Expr]]:
    return [
        [sp.nsimplify(complex(entry).real) + sp.I * sp.nsimplify(complex(entry).imag) for entry in row]
        for row in matrix
    ]


@pytest.mark.parametrize(
    ("name", "goal"),
    [
        ("su3", lambda rng: lc.UpToPhase(unitary_group.rvs(2, random_state=1), levels=(2, 0))),
        ("su2", lambda rng: lc.Coset(expm(lc.group("su2").hat(rng.normal(size=3))), free=(1,), side="left")),
        ("se3", lambda rng: lc.Coset(expm(lc.group("se3").hat(rng.normal(size=6))), free=("w3", "v3"))),
        ("se2", lambda rng: lc.Coset(expm(lc.group("se2").hat(rng.normal(size=3))), free=("vx", "vy"), side="left")),
    ],
)  # fmt: skip
def test_conditions_vanish_on_the_coset_and_nowhere_near_it(name: str, goal: Any) -> None:
    group, rng = lc.group(name), np.random.default_rng(5)
    terms = goal_terms(group, goal(rng), "test")
    for _ in range(5):
        on = terms.element @ expm(group.hat(rng.normal(size=len(terms.free)) @ terms.free))
        assert met(terms, group, on) < 1e-12
        assert away(group, terms, on) < 1e-9
        # a step across the free directions is seen by the conditions and by the distance
        across = rng.normal(size=group.dim)
        across -= np.linalg.lstsq(terms.free.T, across, rcond=None)[0] @ terms.free
        off = on @ expm(group.hat(1e-3 * across / np.linalg.norm(across)))
        assert met(terms, group, off) > 1e-5
        assert 1e-5 < away(group, terms, off) < 1.1e-3


def test_another_sheet_of_the_equations_is_not_the_goal() -> None:
    """Of SO(4), turns in the plane of 1 and 2 and -1 on 3 and 4 lies in the algebra that turns in that plane generate, not among them."""
    E = lambda i, j: sp.Matrix(4, 4, lambda a, b: int((a, b) == (i, j)) - int((a, b) == (j, i)))  # noqa: E731
    pairs = [(i, j) for i in range(4) for j in range(i + 1, 4)]
    so4 = lc.from_matrices(
        name="so4", labels=tuple(f"w{i + 1}{j + 1}" for i, j in pairs), matrices=[E(i, j) for i, j in pairs]
    )
    terms = goal_terms(so4, lc.Coset(np.eye(4), free=("w12",)), "test")
    other = np.diag([1.0, 1, -1, -1])
    assert away(so4, terms, other) > 1
    turned = expm(so4.hat([0.4, 0, 0, 0, 0, 0]))
    assert np.linalg.norm(logm(turned)) > 0.1
    assert away(so4, terms, turned) < 1e-12


def test_cosets_without_linear_equations_are_refused_with_the_reason() -> None:
    su3 = lc.group("su3")
    wound = np.zeros(8)
    wound[[2, 7]] = 1, np.sqrt(2)  # a line that winds round the torus of diagonal elements
    with pytest.raises(lc.errors.SteeringInputError, match=r"1 dimensions.*2 dimensions.*direct"):
        lc.steer(su3, lc.Coset(np.eye(3), free=(wound,)), ("l1", "l4"), 1.0, cost="norm2(u)")
    with pytest.raises(lc.errors.SteeringInputError, match="function of the time"):
        lc.steer("so3", np.eye(3), (lambda t: (np.cos(t), np.sin(t), 0),), 1.0, cost="norm2(u)")
    with pytest.raises(lc.errors.SteeringInputError, match="goal_r0_"):
        lc.steer(
            "su2", lc.Coset(np.eye(2), free=(2,)), (0, 1), 1.0, cost="norm2(u)", parameters={"goal_r0_": np.zeros(9)}
        )


def conditions_at(problem: lc.OptimalControlProblem, X: np.ndarray) -> np.ndarray:
    """The end's texts as numbers: sums of (factor)*entry and a (constant)."""
    entries: dict[str, float] = {"": 1.0}
    for i, j in np.ndindex(*X.shape):
        name = f"X{i + 1}{j + 1}"
        entries |= {name: X[i, j].real, f"{name}_re": X[i, j].real, f"{name}_im": X[i, j].imag}
    rows = []
    for condition in problem.data.terminal:
        pairs = (part.partition(")") for part in str(condition.term).split(" + "))
        rows.append(sum(float(factor[1:]) * entries[name[1:]] for factor, _, name in pairs))
    return np.array(rows)


def test_a_gate_on_levels_is_the_end_of_a_problem() -> None:
    """lc.ocp(target=UpToPhase(U, levels=)): zero on e^(i f) U and anything outside, and on nothing else of the group; any order of levels."""
    rng = np.random.default_rng(8)
    for levels in ((0, 1), (2, 0), (1,)):
        s = len(levels)
        gate = unitary_group.rvs(s, random_state=s) if s > 1 else np.eye(1)
        problem = lc.ocp(
            "su3",
            controls=(0, 1, 2),
            duration=1.0,
            intervals=3,
            stage_cost="norm2(u)",
            target=lc.UpToPhase(gate, levels=levels),
        )
        others = [level for level in range(3) if level not in levels]
        for _ in range(4):
            X = np.zeros((3, 3), dtype=complex)
            X[np.ix_(levels, levels)] = np.exp(1j * rng.uniform(0, 2 * np.pi)) * gate
            X[np.ix_(others, others)] = np.atleast_2d(
                unitary_group.rvs(3 - s, random_state=int(rng.integers(99))) if s < 2 else 1
            )
            X[others[0]] /= np.linalg.det(X)
            assert np.max(np.abs(conditions_at(problem, X))) < 1e-13
            away = X @ expm(0.1 * lc.group("su3").hat(rng.normal(size=8)))
            assert np.max(np.abs(conditions_at(problem, away))) > 1e-3


@pytest.mark.parametrize(
    ("group", "goal", "controls", "end"),
    [
        ("se2", lc.Position((1, 0.5)), ("omega", "vx"), lambda X: X[:2, 2] - [1, 0.5]),
        ("so3", lc.Pointing((0, 0, 1), (1, 0, 1)), ("w1", "w2"), lambda X: X[:, 2] - np.array([1, 0, 1]) / np.sqrt(2)),
    ],
)
def test_a_set_of_goals_is_the_end_of_a_problem(group: str, goal: Any, controls: tuple[str, ...], end: Any) -> None:
    problem = lc.ocp(group, controls=controls, duration=1.0, intervals=30, stage_cost="norm2(u)", target=goal)
    plan = problem.solve(starts=3)
    assert np.max(np.abs(end(plan.X[-1]))) < 1e-9
    own = lc.steer(group, goal, controls, 1.0, cost="norm2(u)", intervals=30, starts=3)
    assert plan.cost == pytest.approx(own.cost, rel=1e-9)


@pytest.mark.parametrize(
    ("target", "said"),
    [(lc.UpToPhase(np.eye(2)), "2 phases"), (3, "name of a parameter"), (lc.Position((1, 2)), "se2, se3")],
)
def test_ends_that_a_problem_has_not_are_named(target: Any, said: str) -> None:
    with pytest.raises(lc.errors.InputError, match=said):
        lc.ocp("su2", controls=(0, 1), duration=1.0, intervals=5, stage_cost="norm2(u)", target=target)
