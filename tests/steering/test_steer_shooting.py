"""Exact minimum-energy steering: published costs, an integration that shares no code, random targets."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.shooting.bracket_lengths import bracket_lengths
from lie_codegen.steering.shooting.defaults import Defaults
from lie_codegen.steering.shooting.extremal import Extremal
from lie_codegen.steering.shooting.extremals import SOLVED
from lie_codegen.steering.shooting.numpy_solver import NumpyShooting
from lie_codegen.steering.shooting.shooter import shooter
from lie_codegen.steering.shooting.source import PROBLEM, render_steering, steering_view

SYSTEMS = {"so3": ("w1", "w2"), "se2": (0, 1), "h3": (0, 1), "su2": (0, 1), "se3": (0, 1, 2, 3)}


def heisenberg_target() -> NDArray[np.float64]:
    return expm(lc.group("h3").hat([0, 0, 1.0]))


def se3_target() -> NDArray[np.float64]:
    so3 = lc.group("so3")
    T = np.eye(4)
    for x, A in zip((0.3, -0.2, 0.4), so3.basis, strict=True):
        T[:3, :3] = T[:3, :3] @ expm(x * A)
    T[:3, 3] = (0.5, 0.3, -0.2)
    return T


def random_targets(group: MatrixGroup, count: int, seed: int, size: float = 2.0) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return np.array([expm(group.hat(rng.uniform(-size, size, group.dim))) for _ in range(count)])


def integrated(group: MatrixGroup, plan: Plan) -> NDArray[np.float64]:
    """X(T) by scipy's DOP853 on the matrix entries."""
    d = group.degree

    def rate(t: float, x: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return (x.reshape(d, d) @ group.hat(plan.u(t))).ravel()

    start = np.eye(d, dtype=group.basis.dtype).ravel()
    knots = np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]])
    for a, b in pairwise(knots):
        start = solve_ivp(rate, (a, b), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return start.reshape(d, d)


@pytest.mark.parametrize(
    ("name", "target", "cost"),
    [
        ("h3", heisenberg_target(), 4 * np.pi),
        ("se2", np.array([[0, -1, 1], [1, 0, 1], [0, 0, 1.0]]), 4.891645516826),
        ("se3", se3_target(), 2.831793229318),
    ],
)
def test_published_minimum_energies(name: str, target: NDArray[np.float64], cost: float) -> None:
    plan = lc.steer(lc.group(name), target, SYSTEMS[name], 1.0, method="optimal")
    assert plan.cost == pytest.approx(cost, rel=1e-10)
    assert plan.error < 1e-10


@pytest.mark.parametrize("phi", [0.05, 0.8, 2.0, 3.0, np.pi])
def test_so3_about_the_missing_axis(phi: float) -> None:
    so3 = lc.group("so3")
    plan = lc.steer(so3, expm(phi * so3.basis[2]), ("w1", "w2"), 3.0, method="optimal")
    assert plan.cost * 3.0 == pytest.approx(phi * (4 * np.pi - phi), rel=1e-9)
    assert plan.error < 1e-10
    assert plan.details["conjugate_target"]
    assert not plan.details["conjugate_times"]


def test_the_satellite_costs_what_the_paper_page_says() -> None:
    plan = lc.steer(lc.group("so3"), [0.1, 0.05, np.pi / 40], ("w1", "w2"), 24.0)
    assert plan.method == "optimal"
    assert plan.cost == pytest.approx(0.80350066222184167 / 24, rel=1e-12)
    assert "not proved" in plan.details["optimality"]


@pytest.mark.parametrize("name", SYSTEMS)
def test_plans_hold_against_an_independent_integration(name: str) -> None:
    group = lc.group(name)
    target = random_targets(group, 1, seed=4, size=1.0)[0]
    plan = lc.steer(group, target, SYSTEMS[name], 2.0, method="optimal")
    np.testing.assert_allclose(integrated(group, plan), target, atol=2e-10)
    speed = np.sum(plan.u(np.linspace(0, 2.0, 50)) ** 2, axis=1)
    np.testing.assert_allclose(speed, speed[0], rtol=1e-10)


def test_sensitivities_against_differences() -> None:
    group = lc.group("se2")
    solver = shooter(group, (0, 1))
    mu0 = np.array([1.0, -0.7, 2.0])
    exact = solver.extremal(mu0).sensitivities[-1]
    h = 1e-5
    for column in range(3):
        e = h * np.eye(3)[column]
        after, before = (solver.extremal(mu0 + sign * e).X[-1] for sign in (1, -1))
        X = solver.extremal(mu0).X[-1]
        slope = group.project(np.linalg.solve(X, after - before)) / (2 * h)
        np.testing.assert_allclose(exact[:, column], slope, atol=1e-8)


def test_an_extremal_past_its_conjugate_point_is_told() -> None:
    """Heisenberg: mu = (1, 0, p) turns at rate p; the first conjugate time is 2 pi / p."""
    group = lc.group("h3")
    solver = shooter(group, (0, 1))
    beyond = solver.extremal([1.0, 0.2, 8.0])
    assert beyond.conjugate_times()[0] == pytest.approx(2 * np.pi / 8, abs=0.01)
    assert solver.extremal([1.0, 0.2, 6.0]).conjugate_times() == ()


def test_short_manoeuvres_are_not_taken_for_conjugate_points() -> None:
    """Their Jacobian is singular to rounding, as it must be: weight-5 directions have moved by r^5."""
    su3 = gell_mann()
    short = shooter(su3, (0, 1)).extremal([0.2, -0.2, 0.1, 0.3, -0.1, 0.2, 0.1, -0.3])
    assert short.singular_values()[-1] < 1e-12
    assert short.conjugate_times() == ()
    so3 = lc.group("so3")
    plan = lc.steer(so3, expm(so3.hat([1e-3, 2e-3, 1e-6])), ("w1", "w2"), 1.0)
    assert not plan.details["conjugate_target"]
    assert "strict local minimum" in plan.details["optimality"]


def test_weights_make_a_control_dearer() -> None:
    group = lc.group("so3")
    target = random_targets(group, 1, seed=8, size=0.8)[0]
    even = lc.steer(group, target, ("w1", "w2"), 1.0)
    dear = lc.steer(group, target, ("w1", "w2"), 1.0, weights=(4.0, 1.0))
    assert dear.error < 1e-10
    times = np.linspace(0, 1, 400)
    assert np.sum(dear.u(times)[:, 0] ** 2) < np.sum(even.u(times)[:, 0] ** 2)
    weighted = np.trapezoid(dear.u(times) ** 2 @ np.array([4.0, 1.0, 0.0]), times)
    assert dear.details["weighted_cost"] == pytest.approx(weighted, rel=1e-4)
    assert dear.details["weighted_cost"] < np.trapezoid(even.u(times) ** 2 @ np.array([4.0, 1.0, 0.0]), times)


@pytest.mark.parametrize(
    "name", [pytest.param("so3", marks=pytest.mark.slow), "se2", pytest.param("su2", marks=pytest.mark.slow)]
)
def test_numpy_stands_in_for_the_compiler(name: str) -> None:
    group = lc.group(name)
    compiled = shooter(group, (0, 1))
    plain = NumpyShooting(group, (0, 1), 1, Defaults(8, 12, 12))
    target = random_targets(group, 1, seed=2, size=0.6)
    a, b = compiled.solve(target), plain.solve(target, np.ones(2), 8)
    assert b.status[0] == SOLVED
    np.testing.assert_allclose(a.cost, b.cost, rtol=1e-8)
    extremal = Extremal(group, (0, 1), np.ones(2), b.mu0[0], plain.sample(b.mu0[0], np.ones(2), 33))
    np.testing.assert_allclose(extremal.X[-1], target[0], atol=1e-8)


def test_when_shooting_stops_is_said_once_for_c_and_numpy() -> None:
    """The numbers of `Defaults` reach the header that the C core reads, and a rule that nothing meets stops the search in numpy."""
    group, strict = lc.group("se2"), Defaults(8, 12, 12, search_residual=0.0, polish_share=0.25, most_damping=512.0)
    texts = render_steering(replace(steering_view(group, (0, 1), 1), defaults=strict))
    numbers = dict(re.findall(r"#define (SEARCH_RESIDUAL|POLISH_SHARE|MOST_DAMPING) (\S+)", texts[PROBLEM]))
    assert {name: float(value) for name, value in numbers.items()} == {
        "SEARCH_RESIDUAL": 0.0, "POLISH_SHARE": 0.25, "MOST_DAMPING": 512.0,
    }  # fmt: skip
    core = next(text for name, text in texts.items() if name.endswith(".c"))
    assert all(name in core for name in numbers)
    target = random_targets(group, 1, seed=2, size=0.6)
    assert NumpyShooting(group, (0, 1), 1, strict).solve(target, np.ones(2), 8).converged[0] == 0


def gell_mann() -> MatrixGroup:
    """su(3): -i/2 of the Gell-Mann matrices, the first replaced by 1 + 6 and the second by 3, so that two controls do."""
    i_unit, half = sp.I, sp.Rational(1, 2)
    unit = [[sp.Matrix(3, 3, lambda r, c, i=i, j=j: int((r, c) == (i, j))) for j in range(3)] for i in range(3)]
    sym = {(i, j): unit[i][j] + unit[j][i] for i in range(3) for j in range(i + 1, 3)}
    skew = {(i, j): -i_unit * unit[i][j] + i_unit * unit[j][i] for i in range(3) for j in range(i + 1, 3)}
    l3, l8 = unit[0][0] - unit[1][1], unit[0][0] + unit[1][1] - 2 * unit[2][2]
    hermitian = [sym[0, 1] + sym[1, 2], l3 + l8 / 3, sym[0, 1], skew[0, 1], l8, sym[0, 2], skew[0, 2], skew[1, 2]]
    matrices = [(-i_unit * half * m).tolist() for m in hermitian]
    return lc.from_matrices("su3_two", tuple("abcdefgh"), matrices)


DEEP = {
    "se3 with three controls": (lambda: lc.group("se3"), (0, 1, 3)),
    "engel": (lambda: lc.from_brackets("engel4", tuple("abcd"), {("a", "b"): {"c": 1}, ("a", "c"): {"d": 1}}), (0, 1)),
    "su3 with four controls": (gell_mann, (0, 1, 2, 5)),
}


@pytest.mark.parametrize("case", DEEP)
def test_brackets_of_brackets(case: str) -> None:
    make, controls = DEEP[case]
    group = make()
    found = shooter(group, controls).solve(random_targets(group, 6, seed=5, size=0.5))
    assert np.all(found.status == SOLVED)
    assert np.max(found.residual) < 1e-10


def test_su3_with_two_controls_needs_brackets_four_deep() -> None:
    """Costs of the same manoeuvres with piecewise constant controls, 48, 96 and 192 of them, extrapolated: 2e-8 off."""
    group = gell_mann()
    assert lc.controllability(group, (0, 1)).growth == (2, 3, 5, 7, 8)
    found = shooter(group, (0, 1)).solve(random_targets(group, 2, seed=5, size=0.5))
    assert np.all(found.status == SOLVED)
    np.testing.assert_allclose(found.cost, [76.10314001853261, 64.07352970185471], rtol=1e-7)


@pytest.mark.slow
def test_su3_with_two_controls_against_an_independent_integration() -> None:
    group = gell_mann()
    for target in random_targets(group, 4, seed=6, size=1.0):
        plan = lc.steer(group, target, (0, 1), 1.0)
        assert plan.method == "optimal"
        np.testing.assert_allclose(integrated(group, plan), target, atol=1e-9)


SMALL = {
    **{name: (lambda name=name: lc.group(name), SYSTEMS[name]) for name in ("so3", "se2", "h3", "su2", "se3")},
    **{name: DEEP[name] for name in ("se3 with three controls", "engel")},
}


@pytest.mark.parametrize("size", [1e-8, 1e-5, 1e-2, np.pi * 0.999])
@pytest.mark.parametrize("case", SMALL)
def test_targets_of_every_size(case: str, size: float) -> None:
    """Brackets of l controls move r^l under controls of size r: errors and unknowns are measured so."""
    make, controls = SMALL[case]
    group = make()
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, (8, group.dim))
    x[4:, [group.algebra.index(control) for control in controls]] = 0.0
    x *= size / np.max(np.abs(x), axis=1, keepdims=True)
    found = shooter(group, controls).solve(np.array([expm(group.hat(row)) for row in x]))
    assert np.all(found.status == SOLVED)


@pytest.mark.parametrize("size", [1e-8, 1e-6, 1e-4, 1e-2, 1.0])
def test_small_turns_cost_what_the_formula_says(size: float) -> None:
    so3, h3 = lc.group("so3"), lc.group("h3")
    turn = shooter(so3, (0, 1)).solve(expm(size * so3.basis[2]))
    loop = shooter(h3, (0, 1)).solve(expm(size * h3.basis[2]))
    assert turn.cost[0] == pytest.approx(size * (4 * np.pi - size), rel=1e-6)
    assert loop.cost[0] == pytest.approx(size * 4 * np.pi, rel=1e-6)


def test_the_missing_axis_and_a_little_beside_it() -> None:
    """Nearly a conjugate point: the phase of the loop is fixed by a millionth of the way."""
    h3 = lc.group("h3")
    target = expm(h3.hat([1e-6, -2e-6, 1.0]))
    found = shooter(h3, (0, 1)).solve(target)
    assert found.status[0] == SOLVED
    end = shooter(h3, (0, 1)).extremal(found.mu0[0]).X[-1]
    np.testing.assert_allclose(end, target, atol=1e-10)
    assert found.cost[0] == pytest.approx(4 * np.pi, rel=1e-5)


def test_brackets_that_each_direction_takes() -> None:
    engel, controls = DEEP["engel"]
    assert bracket_lengths(engel(), controls) == (1, 1, 2, 3)
    assert bracket_lengths(lc.group("se3"), (0, 1, 3)) == (1, 1, 2, 1, 3, 2)
    assert bracket_lengths(lc.group("se3"), (0, 1, 2, 3)) == (1, 1, 1, 1, 2, 2)


def test_the_jacobian_of_the_end_against_differences() -> None:
    group = lc.group("so3")
    solver = shooter(group, (0, 1))
    found = solver.solve(expm(group.hat([0.4, -0.3, 0.9])), weights=(2.0, 0.5))
    h, X = 1e-5, solver.extremal(found.mu0[0], weights=(2.0, 0.5)).X[-1]
    for column in range(3):
        e = h * np.eye(3)[column]
        after, before = (solver.extremal(found.mu0[0] + sign * e, weights=(2.0, 0.5)).X[-1] for sign in (1, -1))
        slope = group.project(np.linalg.solve(X, after - before)) / (2 * h)
        np.testing.assert_allclose(found.jacobian[0][:, column], slope, atol=3e-4)


def test_only_the_ratio_of_weights_matters() -> None:
    solver = shooter(lc.group("so3"), (0, 1))
    targets = random_targets(solver.group, 10, seed=13)
    plain, heavy = solver.solve(targets), solver.solve(targets, weights=(1e6, 1e6))
    np.testing.assert_allclose(heavy.cost, 1e6 * plain.cost, rtol=1e-9)
    np.testing.assert_allclose(heavy.mu0, 1e6 * plain.mu0, rtol=1e-6)


@pytest.mark.parametrize("name", ["so3", "se2", "su2"])
def test_uneven_weights_are_steered_globally(name: str) -> None:
    solver = shooter(lc.group(name), SYSTEMS[name])
    targets = random_targets(solver.group, 60, seed=14)
    found, best = (solver.solve(targets, weights=(5.0, 0.5), starts=starts) for starts in (None, 300))
    assert np.all(found.status == SOLVED)
    assert np.mean(found.cost <= 1.001 * np.fmin(found.cost, best.cost)) >= 0.95


def test_half_turns_about_any_axis() -> None:
    solver = shooter(lc.group("so3"), (0, 1))
    axes = np.random.default_rng(15).normal(size=(60, 3))
    axes *= np.pi / np.linalg.norm(axes, axis=1, keepdims=True)
    targets = np.array([expm(solver.group.hat(axis)) for axis in axes])
    found, best = solver.solve(targets), solver.solve(targets, starts=300)
    assert np.all(found.status == SOLVED)
    assert np.mean(found.cost <= 1.001 * np.fmin(found.cost, best.cost)) >= 0.95


def test_batches_and_threads_give_the_single_answers() -> None:
    solver = shooter(lc.group("so3"), (0, 1))
    targets = random_targets(solver.group, 21, seed=1)
    together = solver.solve(targets)
    parallel = solver.solve(targets, threads=2)
    alone = np.array([solver.solve(target).cost[0] for target in targets])
    np.testing.assert_array_equal(together.cost.shape, (21,))
    np.testing.assert_allclose(together.cost, alone, rtol=1e-9)
    np.testing.assert_allclose(parallel.cost, alone, rtol=1e-9)


@pytest.mark.parametrize("name", ["so3", "se2", "h3"])
def test_random_targets_are_solved_globally(name: str) -> None:
    solver = shooter(lc.group(name), SYSTEMS[name])
    targets = random_targets(solver.group, 100, seed=11)
    found, best = solver.solve(targets), solver.solve(targets, starts=500)
    assert np.all(found.status == SOLVED)
    assert np.mean(found.cost <= 1.001 * np.fmin(found.cost, best.cost)) >= 0.99


def test_lonely_extremals_are_searched_for_again() -> None:
    """On SL(2) the default starts alone miss the cheapest extremal of 4 of these 60 targets."""
    group, rng = lc.group("sl2"), np.random.default_rng(5)
    solver, missed = shooter(group, ("e", "f")), 0
    for _ in range(60):
        x = rng.normal(size=3)
        target = expm(group.hat(3 * rng.uniform() / np.linalg.norm(x) * x))
        best = solver.solve(target, starts=500).cost[0]
        missed += lc.steer(group, target, ("e", "f"), 1.0).cost > 1.001 * best
    assert missed <= 1


@pytest.mark.slow
@pytest.mark.parametrize(("name", "share"), [("so3", 0.99), ("se2", 0.99), ("h3", 0.99), ("su2", 0.99), ("se3", 0.95)])
def test_a_thousand_random_targets(name: str, share: float) -> None:
    solver = shooter(lc.group(name), SYSTEMS[name])
    targets = random_targets(solver.group, 1000, seed=12)
    found, best = solver.solve(targets), solver.solve(targets, starts=500, threads=2)
    assert np.all(found.status == SOLVED)
    assert np.mean(found.cost <= 1.001 * np.fmin(found.cost, best.cost)) >= share
