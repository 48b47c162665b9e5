"""lc.ocp against published optima, closed forms, and oracles that share no code with it."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ocp_systems import (
    QUADROTOR,
    SATELLITE,
    SE3,
    SO3,
    car,
    kernel,
    planar,
    quadrotor,
    rotation,
    satellite,
    underwater,
)
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import (
    AssumptionWarning,
    ExpressionError,
    InputError,
    NotFiniteError,
    NotOnGroupError,
    ShapeError,
)
from lie_codegen.steering.ocp.interpreted import InterpretedMachine
from lie_codegen.steering.ocp.model import ModelBuilder
from lie_codegen.steering.plan import Status

COST = "q*(3 - tr(X))/2 + norm2(u)/2"
END = "4*sqrt(q)*(1 - sqrt(1 + tr(X))/2)"


def regulator(**options: Any) -> Any:
    settings = {"stage_cost": COST, "terminal_cost": END, "parameters": {"q": ()}, "name": "regulator", **options}
    return lc.ocp(SO3, controls=SO3.labels, duration=4.0, intervals=40, **settings)


@pytest.mark.parametrize(
    ("quadrature", "cost"), [("trapezoid", 1.839597950455), ("left", 1.910364085), ("simpson", 1.839258507)]
)
def test_the_attitude_regulator_has_its_closed_form_and_its_published_discrete_values(
    quadrature: str, cost: float
) -> None:
    axis = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])
    plan = regulator(quadrature=quadrature).solve(rotation(2 * axis), q=1.0)
    assert plan.status is Status.SOLVED
    assert plan.cost == pytest.approx(cost, rel=1e-9)
    assert abs(plan.cost - 4 * (1 - np.cos(1))) < {"left": 8e-2, "trapezoid": 1e-3, "simpson": 5e-4}[quadrature]
    np.testing.assert_allclose(np.cross(plan.u, axis), 0, atol=1e-7)  # V' = -2 sin(theta/2) n: along the axis
    if quadrature == "trapezoid":
        np.testing.assert_allclose(plan.u[0], -1.637097762 * axis, atol=1e-8)


def test_bounds_are_exact_and_the_optimum_is_the_published_one() -> None:
    plan = regulator(bounds=1.2).solve(rotation((0, 2, 0)), q=1.0)
    assert plan.cost == pytest.approx(1.864850493051, rel=1e-11)
    assert np.sum(np.abs(plan.u) == 1.2) == 6
    assert np.max(np.abs(plan.u)) == 1.2
    assert plan.iterations <= 6


def test_a_bounded_optimum_satisfies_the_first_order_conditions_of_an_independent_discretisation() -> None:
    """Cost by matrix exponentials and finite differences: the gradient vanishes or presses against a bound."""
    plan = regulator(bounds=1.2, quadrature="left").solve(rotation((0.3, 1.9, -0.4)), q=1.3)

    def cost(u: np.ndarray) -> float:
        X, total = rotation((0.3, 1.9, -0.4)), 0.0
        for row in u:
            total += 0.1 * (1.3 * (3 - np.trace(X)) / 2 + row @ row / 2)
            X = X @ expm(SO3.hat(0.1 * row))
        return float(total + 4 * np.sqrt(1.3) * (1 - np.sqrt(1 + np.trace(X)) / 2))

    u = np.array(plan.u)
    assert plan.cost == pytest.approx(cost(u), rel=1e-12)
    for k, i in [(0, 1), (0, 0), (3, 1), (7, 2), (20, 1), (39, 0)]:
        step = np.zeros_like(u)
        step[k, i] = 1e-5
        slope = (cost(u + step) - cost(u - step)) / 2e-5
        inside = abs(u[k, i]) < 1.2
        assert abs(slope) < 1e-7 if inside else slope * u[k, i] < 0


@pytest.mark.parametrize("intervals", [1, 7])
def test_energy_to_an_attitude_is_half_the_square_of_its_angle(intervals: int) -> None:
    problem = lc.ocp(
        SO3, controls=SO3.labels, duration=3.0, intervals=intervals, stage_cost="norm2(u)/2", target="Xd", name="energy"
    )
    plan = problem.solve(Xd=rotation((0.8, -1.1, 0.5)))
    assert plan.cost == pytest.approx((0.8**2 + 1.1**2 + 0.5**2) / 6, rel=1e-9)
    assert plan.error < 1e-8
    np.testing.assert_allclose(plan.u, np.tile([0.8 / 3, -1.1 / 3, 0.5 / 3], (intervals, 1)), atol=1e-7)


def test_the_quadrotor_among_cylinders_has_the_published_optimum_and_exact_gains() -> None:
    problem = quadrotor()
    plan = problem.solve(**QUADROTOR)
    assert plan.status is Status.SOLVED
    assert plan.cost == pytest.approx(6.119001823, rel=1e-9)
    np.testing.assert_allclose(plan.u[0], [20, 3.91263, 6, 0.20131], atol=1e-5)
    assert plan.violation < 1e-8
    differences = np.zeros((4, 9))
    for i in range(9):
        d = np.zeros(9)
        d[i] = 1e-4
        ends = [
            problem.solve(expm(SE3.hat(s * d[:6])), v=s * d[6:], guess=plan, tolerance=1e-13, **QUADROTOR).u[0]
            for s in (1, -1)
        ]
        differences[:, i] = (ends[0] - ends[1]) / 2e-4
    assert np.max(np.abs(plan.gain[0] - differences)) < 1e-3 * np.linalg.norm(differences)
    assert not plan.gain[0][[0, 2]].any()  # thrust and pitch rate at their bounds


def test_the_satellite_with_wheels_truly_ends_at_its_target_on_the_cheaper_side_of_the_cone() -> None:
    plan = satellite().solve(starts=4, **SATELLITE)
    assert plan.status is Status.SOLVED
    assert plan.cost == pytest.approx(1.871532414, rel=1e-9)
    assert plan.error < 1e-7
    angle = np.arccos(np.clip((np.trace(SATELLITE["Rd"].T @ plan.X_final) - 1) / 2, -1, 1))
    assert angle < 1e-6
    assert np.max(np.abs(plan.states["w"])) <= 0.25 + 1e-9
    assert np.max(plan.X[:, :, 0] @ SATELLITE["cone"]) <= np.cos(0.3) + 1e-8
    assert plan.starts.shape == (4, 2)


@pytest.mark.parametrize(("goal", "cost"), [((0.8, 3, 1), 0.277507734), ((0, 0.5, 1), 1.422607742)])
def test_parking(goal: tuple[float, float, float], cost: float) -> None:
    plan = car().solve(goal=planar(*goal), starts=4)
    assert plan.cost == pytest.approx(cost, rel=2e-8)
    assert plan.error < 1e-7
    np.testing.assert_allclose(plan.X_final, planar(*goal), atol=1e-8)


def test_the_motion_of_a_plan_is_that_of_the_differential_equation() -> None:
    """Underwater vehicle, Kirchhoff's equations with drag, by DOP853 in matrices."""
    goal = expm(SE3.hat([0.3, -0.2, 0.8, 1.0, 0.5, -0.4]))
    plan = underwater().solve(goal=goal)
    assert plan.status is Status.SOLVED
    inertia = np.array([1.2, 1.5, 1.8, 20.0, 25.0, 28.0])
    drag = np.array([2.0, 2.0, 2.5, 10.0, 15.0, 18.0])
    x = np.concatenate([np.eye(4).ravel(), np.zeros(6)])
    for u in plan.u:

        def rate(_t: float, x: np.ndarray, u: np.ndarray = u) -> np.ndarray:
            xi = x[16:]
            p, L = inertia[:3] * xi[:3], inertia[3:] * xi[3:]
            torque = np.cross(p, xi[:3]) + np.cross(L, xi[3:])
            force = np.cross(L, xi[:3])
            moved = (np.concatenate([torque, force]) - drag * xi + u) / inertia
            return np.concatenate([(x[:16].reshape(4, 4) @ SE3.hat(xi)).ravel(), moved])

        x = solve_ivp(rate, (0, 0.1), x, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(plan.X_final, x[:16].reshape(4, 4), atol=2e-5)
    np.testing.assert_allclose(plan.states["xi"][-1], x[16:], atol=2e-5)


def test_a_qubit_with_bounded_drive_reaches_its_gate() -> None:
    su2 = lc.group("su2")
    gate = expm(su2.hat([0.9, 0.4, 0.7]))
    problem = lc.ocp(
        su2, controls=su2.labels[:2], duration=4.0, intervals=40, stage_cost="norm2(u)/2", target="gate", bounds=0.8,
        name="qubit",
    )  # fmt: skip
    plan = problem.solve(gate=gate, starts=4)
    assert plan.error < 1e-7
    np.testing.assert_allclose(plan.X_final, gate, atol=1e-8)
    assert np.max(np.abs(plan.u)) <= 0.8
    distance = lc.ocp(
        su2, controls=su2.labels, duration=1.0, intervals=5, stage_cost="norm2(X - gate) + norm2(u)/2",
        parameters={"gate": "X"}, name="near",
    )  # fmt: skip
    held = distance.solve(gate, gate=gate)
    assert held.cost == pytest.approx(0, abs=1e-14)
    assert distance.solve(gate=gate).cost > 0.1


def test_parameters_may_move_from_stage_to_stage() -> None:
    """A reference that turns steadily costs nothing once it is followed."""
    problem = lc.ocp(
        SO3, controls=SO3.labels, duration=2.0, intervals=20, stage_cost=("X - R", "0.001*(u - w)"),
        parameters={"R": (3, 3), "w": 3}, name="follow",
    )  # fmt: skip
    w = np.array([0.3, -0.2, 0.5])
    R = np.array([expm(SO3.hat(0.1 * k * w)) for k in range(21)])
    plan = problem.solve(R=R, w=w)
    assert plan.cost < 1e-20
    np.testing.assert_allclose(plan.u, np.tile(w, (20, 1)), atol=1e-9)
    with pytest.raises(ShapeError, match="R has shape"):
        problem.solve(R=R[:7], w=w)


def test_a_false_root_is_reported_by_the_true_distance() -> None:
    """X Xd' = Xd X' holds at half a turn too; with the entries of X - Xd as condition it does not."""
    options = {"controls": SO3.labels, "duration": 2.0, "intervals": 10, "stage_cost": "norm2(u)/2"}
    entries = lc.ocp(SO3, terminal="X - Xd", parameters={"Xd": (3, 3)}, name="entries", **options)
    plan = entries.solve(rotation((0, 0, np.pi - 1e-3)), Xd=np.eye(3))
    assert plan.error < 1e-6
    fooled = lc.ocp(SO3, terminal="skew(X)", name="fooled", **options).solve(rotation((0, 0, np.pi)))
    assert fooled.cost < 1e-12  # nothing to do, it says
    honest = lc.ocp(SO3, terminal=("skew(X)", "X - Xd"), parameters={"Xd": (3, 3)}, name="honest", **options)
    stuck = honest.solve(rotation((0, 0, np.pi)), Xd=np.eye(3), iterations=1)
    assert stuck.error > 1


def test_sensitivities_are_derivatives_and_the_predictor_is_of_second_order() -> None:
    problem = regulator(bounds=1.2)
    X0 = rotation((0.3, 1.9, 0.1))
    plan = problem.solve(X0, q=1.0, tolerance=1e-13)
    ends = [np.array(problem.solve(X0, q=1 + e, guess=plan, tolerance=1e-13).u) for e in (1e-5, -1e-5)]
    slopes = plan.sensitivity("q")
    assert slopes.shape == (40, 3)
    np.testing.assert_allclose(slopes, (ends[0] - ends[1]) / 2e-5, atol=1e-7)
    by_state = plan.state_sensitivity()
    np.testing.assert_allclose(by_state[0], plan.gain[0])
    moved = [
        np.array(problem.solve(X0 @ expm(SO3.hat([0, 0, e])), q=1.0, guess=plan, tolerance=1e-13).u)
        for e in (1e-5, -1e-5)
    ]
    np.testing.assert_allclose(by_state[:, :, 2], (moved[0] - moved[1]) / 2e-5, atol=1e-6)
    errors = []
    for change in (0.08, 0.04):
        truth = problem.solve(X0, q=1 + change, guess=plan, tolerance=1e-13).u
        errors.append(np.max(np.abs(plan.predict(q=1 + change) - truth)))
    assert 3 < errors[0] / errors[1] < 5.5


def test_a_weakly_active_bound_makes_a_sensitivity_one_sided() -> None:
    free = regulator(name="free").solve(rotation((0, 2, 0)), q=1.0, tolerance=1e-14)
    at = float(-free.u[0, 1])  # the bound touches the first control without pressing
    plan = regulator(bounds=at, name="touching").solve(rotation((0, 2, 0)), q=1.0, tolerance=1e-14)
    if np.abs(plan.u[0, 1]) == at:
        assert ("u2", 0) in plan.weakly_active
        with pytest.warns(AssumptionWarning, match="one-sided"):
            plan.sensitivity("q")


def test_plans_are_values(tmp_path: Path, elsewhere: Callable[[Any], list[Any]]) -> None:
    plan = regulator().solve(rotation((0, 1, 0)), q=1.0, starts=3)
    again = regulator().solve(rotation((0, 1, 0)), q=1.0, starts=3)
    assert plan == again
    assert all(twin == plan for twin in (pickle.loads(pickle.dumps(plan)), *elsewhere(plan)))
    assert plan != regulator().solve(rotation((0, 1, 0)), q=1.1)
    assert len(repr(plan).splitlines()) <= 10
    np.testing.assert_array_equal(plan.u(0.05), plan.u[0])
    np.testing.assert_array_equal(plan.u([0.15, 3.99]), plan.u[[1, 39]])
    back = lc.load(plan.save(tmp_path / "plan.npz"))
    assert back == plan
    np.testing.assert_array_equal(back.u(3.99), plan.u[39])
    assert regulator().solve(rotation((0, 1, 0)), q=1.0, guess=back).iterations <= 2
    with pytest.raises(InputError, match=r"velocity.* cannot be saved: function"):
        quadrotor().solve(**QUADROTOR).save(tmp_path / "quadrotor.npz")


def test_a_plan_of_steer_keeps_the_plan_of_its_problem_in_a_file(tmp_path: Path) -> None:
    plan = lc.steer(SO3, rotation((0, 0, 1)), SO3.labels, 2.0, cost="norm2(u)", intervals=8)
    back = lc.load(plan.save(tmp_path / "plan.npz"))
    assert back == plan
    assert back.details["plan"] == plan.details["plan"]
    np.testing.assert_array_equal(back.u(0.7), plan.u(0.7))


def test_no_parameter_no_state_and_no_guess_builds_anything(compiles: list[str]) -> None:
    problem = regulator(name="built_once")
    first = problem.solve(rotation((0, 1, 0)), q=1.0)
    assert compiles.count("built_once.c") == 1
    plan = problem.solve(rotation((0.4, 1, 0)), q=2.0, guess=first, starts=3)
    problem.solve(rotation((0.4, 1, 0)), q=2.0, guess=np.zeros((40, 3)))
    assert compiles.count("built_once.c") == 1
    warm = problem.solve(rotation((0.4, 1, 0)), q=2.0, guess=plan)
    assert warm.iterations <= 2
    assert warm.cost == pytest.approx(plan.cost, rel=1e-12)


def test_a_plan_of_steer_is_a_guess() -> None:
    problem = lc.ocp(
        SO3, controls=("w1", "w2"), duration=2.0, intervals=40, stage_cost="norm2(u)/2", target="Xd", name="guessed"
    )
    Xd = rotation((0.1, 0.05, 0.4))
    steered = lc.steer(SO3, Xd, controls=("w1", "w2"), duration=2.0, method="optimal")
    plan = problem.solve(Xd=Xd, guess=steered)
    assert plan.status is Status.SOLVED
    assert 2 * plan.cost == pytest.approx(steered.cost, rel=2e-3)  # steer's cost is int |u|^2
    assert problem.solve(Xd=Xd, starts=8).cost >= plan.cost * (1 - 1e-6)
    area = lc.steer(SO3, Xd, controls=("w1", "w2"), duration=2.0, method="area_rule")
    several = problem.solve(Xd=Xd, guess=[None, steered, area, plan], starts=5)
    assert several.starts.shape == (5, 2)
    assert several.cost == pytest.approx(plan.cost, rel=1e-8)


def spinning(**options: Any) -> Any:
    """A body with three torques, its cost by Simpson's rule."""
    settings = {
        "stage_cost": "3 - tr(X) + norm2(xi) + norm2(u)/2",
        "quadrature": "simpson",
        "name": "spinning",
        **options,
    }
    return lc.ocp(
        SO3,
        dynamics="second_order",
        inertia=(3.0, 2.0, 1.0),
        controls=SO3.labels,
        **{"duration": 2.0, "intervals": 8, **settings},
    )


@pytest.mark.parametrize(("integrator", "order"), [("rkmk4", 4), ("midpoint", 2)])
def test_the_state_within_an_interval_keeps_the_order_of_the_quadrature(integrator: str, order: int) -> None:
    """The cost of given controls against SciPy's: Simpson's node in the middle is reached by the integrator's own interpolant."""
    J, torque = np.array([3.0, 2.0, 1.0]), np.array([0.6, -0.4, 0.5])

    def rate(_t: float, y: np.ndarray) -> np.ndarray:
        X, w = y[:9].reshape(3, 3), y[9:12]
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        cost = 3 - np.trace(X) + w @ w + torque @ torque / 2
        return np.concatenate([(X @ skew).ravel(), (np.cross(J * w, w) + torque) / J, [cost]])

    start = np.concatenate([rotation((0.3, 0.2, -0.5)).ravel(), [0.4, 0.9, -0.3, 0]])
    true = solve_ivp(rate, (0, 2), start, rtol=1e-12, atol=1e-12).y[-1, -1]
    errors = []
    for intervals in (8, 16):
        pinned = (torque, torque + 1e-13)
        problem = spinning(
            integrator=integrator, intervals=intervals, bounds=pinned, name=f"pinned_{integrator}_{intervals}"
        )
        plan = problem.solve(rotation((0.3, 0.2, -0.5)), xi=start[9:12], threads=1)
        errors.append(abs(plan.cost - true))
    assert order - 0.4 < np.log2(errors[0] / errors[1]) < order + 1.5


@pytest.mark.parametrize(
    "make", [regulator, car, satellite, spinning], ids=["regulator", "car", "satellite", "spinning"]
)
def test_without_a_compiler_numpy_does_the_same(make: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    values, first, most = {
        "regulator": ({"q": 1.0}, rotation((0.3, 1.9, 0)), 600),
        "car": ({"goal": planar(0.8, 3, 1)}, None, 4),
        "satellite": (SATELLITE, None, 3),
        "spinning": ({"xi": (0.4, 0.9, -0.3)}, rotation((0.3, 1.9, 0)), 600),
    }[make.__name__]
    problem = make()
    compiled = problem.solve(first, iterations=most, threads=1, **values)
    machine = InterpretedMachine(problem.data, ModelBuilder(problem.data).build(second_order=True))
    monkeypatch.setattr(
        import_module("lie_codegen.steering.ocp.problem"), "machine_of", lambda data, second_order: machine
    )
    monkeypatch.setattr(import_module("lie_codegen.steering.ocp.search"), "_MORE", 0)
    twin = problem.solve(first, iterations=most, **values)
    assert twin.iterations == compiled.iterations or compiled.status is not Status.SOLVED
    if compiled.status is Status.SOLVED:
        np.testing.assert_allclose(twin.u, compiled.u, atol=1e-8)
        np.testing.assert_allclose(twin.gain, compiled.gain, atol=1e-6)
        assert twin.cost == pytest.approx(compiled.cost, rel=1e-12)


def test_the_interpreted_step_of_the_car_after_few_iterations_is_the_compiled_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = car()
    monkeypatch.setattr(import_module("lie_codegen.steering.ocp.search"), "_MORE", 0)
    compiled = problem.solve(goal=planar(0.8, 3, 1), iterations=5)
    machine = InterpretedMachine(problem.data, ModelBuilder(problem.data).build(second_order=True))
    monkeypatch.setattr(
        import_module("lie_codegen.steering.ocp.problem"), "machine_of", lambda data, second_order: machine
    )
    twin = problem.solve(goal=planar(0.8, 3, 1), iterations=5)
    np.testing.assert_allclose(twin.u, compiled.u, atol=1e-9)
    np.testing.assert_allclose(twin.multipliers, compiled.multipliers, atol=1e-7)
    assert twin.worst == compiled.worst


def test_what_is_not_admissible_says_which_condition_and_where() -> None:
    problem = lc.ocp(
        SO3,
        controls=SO3.labels,
        duration=1.0,
        intervals=10,
        stage_cost="norm2(u)/2",
        target="Xd",
        bounds=0.5,
        name="far",
    )
    plan = problem.solve(Xd=rotation((0, 0, 2)))
    assert plan.status is Status.NOT_ADMISSIBLE
    assert plan.worst is not None
    assert plan.worst[0].startswith("X - Xd")
    assert plan.worst[1] == 10
    assert 1.3 < plan.error <= 1.5  # half a radian a second about one axis, and a little by turning about the others
    assert "infeasible" not in str(plan.status)


def test_a_text_may_keep_a_value_between_two() -> None:
    """-1/2 <= u1 + u2 <= 1/4 as one text is the two rows."""
    options = {**BASE, "parameters": {"Xd": "X"}, "terminal": ("X - Xd",), "intervals": 10}
    both = lc.ocp(SO3, **options, constraints=("-1/2 <= u1 + u2 <= 1/4",), name="between")
    rows = lc.ocp(SO3, **options, constraints=("-1/2 - u1 - u2", "u1 + u2 - 1/4"), name="between")
    assert [each.name for each in both.data.constraints] == ["-1/2 <= u1 + u2", "u1 + u2 <= 1/4"]
    plan, other = both.solve(Xd=rotation((0.4, 0.1, 0.2))), rows.solve(Xd=rotation((0.4, 0.1, 0.2)))
    assert plan.status is Status.SOLVED
    assert plan.cost == pytest.approx(other.cost, rel=1e-12)
    assert np.max(np.sum(plan.u[:, :2], axis=1)) == pytest.approx(0.25, abs=1e-8)


def test_limits_of_iterations_are_kept_and_said() -> None:
    plan = regulator().solve(rotation((0, 2, 0)), q=1.0, iterations=1)
    assert plan.iterations == 1
    assert plan.status is Status.ADMISSIBLE


BASE = {"controls": SO3.labels, "duration": 1.0, "intervals": 5, "stage_cost": "norm2(u)"}


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"stage_cost": "norm2(u) + foo"}, ExpressionError, "foo"),
        ({"stage_cost": "X - 1"}, ExpressionError, "not a number"),
        ({"terminal_cost": "norm2(u)"}, ExpressionError, "no name 'u'"),
        ({"bounds": (2, 1)}, InputError, "crossed"),
        ({"bounds": {"w": 1}}, InputError, "no input"),
        ({"stage_cost": "tr(X)"}, InputError, "u1"),
        ({"stage_cost": None}, InputError, "u1"),
        ({"parameters": {"X": ()}}, InputError, "'X'"),
        ({"parameters": {"p": (0,)}}, ShapeError, "no shape"),
        ({"states": {"z": 1}}, InputError, "rates"),
        ({"states": {"z": 2}, "rates": {"z": "u1"}}, ShapeError, "rates of z"),
        ({"quadrature": "gauss"}, InputError, "quadrature"),
        ({"integrator": "euler"}, InputError, "integrator"),
        ({"duration": -1.0}, InputError, "duration"),
        ({"intervals": 2.5}, InputError, "intervals"),
        ({"controls": ("w1", "w9")}, InputError, "w9"),
        ({"dynamics": "second_order"}, InputError, "inertia"),
        ({"inertia": 1.0}, InputError, "inertia"),
        ({"velocity": "u"}, InputError, "velocity"),
        ({"constraints": ("u1 <= nope",)}, ExpressionError, "nope"),
        ({"parameters": {"u1": ()}}, InputError, "u1"),
        ({"stage_cost": 3}, InputError, "expected a text"),
        ({"constraints": (None,)}, InputError, "expected a text"),
        ({"bounds": "wide"}, ShapeError, "bounds"),
        ({"bounds": -1}, InputError, "bounds of u1 are crossed"),
        ({"bounds": np.nan}, NotFiniteError, "bounds"),
        ({"duration": (3, 1)}, InputError, "no range"),
        ({"constraints": ("u1 == 1",)}, ExpressionError, "a <= b"),
        ({"constraints": ("X11 < 1",)}, ExpressionError, "a <= b"),
        ({"constraints": ("0 <= X11 >= 1",)}, ExpressionError, "a <= b"),
        ({"terminal": ("X11 <= 0",)}, ExpressionError, "zero there"),
        ({"terminal": ("nope",)}, ExpressionError, "ocp(so3): terminal: nope"),
        ({"terminal": ("u1",)}, ExpressionError, "no name 'u1'"),
        ({"parameters": {"k": ()}, "stage_cost": "norm2(u)^k"}, ExpressionError, "exponent"),
        ({"parameters": {"k": ()}, "stage_cost": "norm2(u) + tr(X^k)"}, ExpressionError, "exponent"),
        ({"parameters": {"v": 2}, "stage_cost": "norm2(u) + v*v"}, ExpressionError, "2 x 1 times 2 x 1"),
        ({"parameters": {"curvature": ()}}, InputError, "'curvature'"),
        ({"dynamics": "second_order", "inertia": 1.0, "force": "wind"}, ExpressionError, "force"),
    ],
)
def test_what_cannot_be_a_problem_is_refused_by_name(change: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=re.escape(said)):
        lc.ocp(SO3, **{**BASE, **change})


def test_kernels_that_do_not_fit_are_refused_by_name() -> None:
    fits = {**BASE, "parameters": {"p": 2}}
    cases = [
        (kernel("c", {"w": (3,)}, "residual", 1, lambda _o, w: [w[0]]), InputError, "'w'"),
        (kernel("c", {"u": (2,)}, "residual", 1, lambda _o, u: [u[0]]), ShapeError, r"\(2,\)"),
        (kernel("c", {"u": (3,)}, "cost", 3, lambda _o, u: list(u)), ShapeError, "number"),
        (kernel("c", {"u": (3,)}, "g", 1, lambda _o, u: [u[0]]), InputError, "residual or cost"),
    ]
    for term, error, said in cases:
        with pytest.raises(error, match=said):
            lc.ocp(SO3, **{**fits, "stage_cost": term})
    with pytest.raises(InputError, match="name its output g"):
        lc.ocp(SO3, **fits, constraints=(kernel("c", {"u": (3,)}, "cost", 1, lambda _o, u: [u[0]]),))


def test_a_complex_cost_is_refused_and_one_that_is_real_on_the_group_is_not() -> None:
    su2 = lc.group("su2")
    options = {"controls": su2.labels, "duration": 1.0, "intervals": 5, "parameters": {"g": "X"}}
    with pytest.raises(InputError, match="complex"):
        lc.ocp(su2, stage_cost="norm2(u) + X11", **options)
    plan = lc.ocp(su2, stage_cost="norm2(u)/2 + 2 - tr(X)", name="trace", **options).solve(g=np.eye(2))
    assert plan.cost == pytest.approx(0, abs=1e-14)


def test_bad_values_are_refused_by_name() -> None:
    problem = regulator()
    with pytest.raises(InputError, match="no value for q"):
        problem.solve(np.eye(3))
    with pytest.raises(ShapeError, match="q has shape"):
        problem.solve(np.eye(3), q=[1.0, 2.0])
    with pytest.raises(NotFiniteError, match="q"):
        problem.solve(np.eye(3), q=np.nan)
    with pytest.raises(InputError, match="intervals"):
        problem.solve(np.eye(3), q=1.0, intervals=7)
    with pytest.raises(NotOnGroupError, match="X0"):
        problem.solve(1.1 * np.eye(3), q=1.0)
    elements = lc.ocp(
        SO3, **{**BASE, "parameters": {"Xd": "X", "M": (3, 3)}, "stage_cost": "norm2(u + M*u) + norm2(X - Xd)"}
    )
    moving = np.array([np.eye(3)] * 5 + [1.1 * np.eye(3)])
    with pytest.raises(NotOnGroupError, match="Xd"):
        elements.solve(Xd=moving, M=2 * np.eye(3))
    with pytest.raises(ShapeError, match="guess"):
        problem.solve(np.eye(3), q=1.0, guess=np.zeros((3, 3)))
    with pytest.raises(InputError, match="starts"):
        problem.solve(np.eye(3), q=1.0, starts=0)
    with pytest.raises(InputError, match="tolerance"):
        problem.solve(np.eye(3), q=1.0, tolerance=-1.0)
    with pytest.raises(InputError, match="iterations"):
        problem.solve(np.eye(3), q=1.0, iterations=0)
    with pytest.raises(InputError, match="no parameter 'p'"):
        problem.solve(np.eye(3), q=1.0).sensitivity("p")


def test_a_bounded_control_without_a_cost_is_bang_bang_and_said_to_be() -> None:
    with pytest.warns(AssumptionWarning, match="bang-bang"):
        lc.ocp(SO3, **{**BASE, "stage_cost": "3 - tr(X)", "bounds": 1.0})


def test_a_free_duration_is_found_and_its_derivatives_are_right() -> None:
    """int (w + |u|^2/2) dt to an attitude of angle a: V(T) = w T + a^2/(2T), so T = a/sqrt(2w), V = a sqrt(2w)."""
    problem = lc.ocp(
        SO3, controls=SO3.labels, duration=(0.1, 20.0), intervals=8, stage_cost="w + norm2(u)/2", target="Xd",
        parameters={"w": ()}, name="hurry",
    )  # fmt: skip
    angle = 1.3
    plan = problem.solve(Xd=rotation((0, angle, 0)), w=0.7)
    assert plan.duration == pytest.approx(angle / np.sqrt(1.4), rel=1e-7)
    assert plan.cost == pytest.approx(angle * np.sqrt(1.4), rel=1e-9)
    np.testing.assert_allclose(plan.t, np.linspace(0, plan.duration, 9))
    np.testing.assert_allclose(plan.u[:, 1], np.sqrt(1.4), atol=1e-6)  # |u| = sqrt(2 w)
    np.testing.assert_allclose(plan.sensitivity("w")[:, 1], 1 / np.sqrt(1.4), atol=1e-4)
    short = lc.ocp(
        SO3, controls=SO3.labels, duration=(0.1, 0.5), intervals=8, stage_cost="0.7 + norm2(u)/2", target="Xd", name="short_time"
    ).solve(Xd=rotation((0, angle, 0)))  # fmt: skip
    assert short.duration == pytest.approx(0.5)
    late = lc.ocp(
        SO3, controls=("w2",), duration=(0.1, 20.0), intervals=8, stage_cost="10 + norm2(u)/2", target="Xd", bounds=1.0,
        name="bounded_time",
    ).solve(Xd=rotation((0, angle, 0)))  # fmt: skip
    assert late.duration == pytest.approx(angle, rel=1e-3)  # at full rate, 1 rad/s
    assert late.status is short.status is plan.status is Status.SOLVED
    with pytest.raises(InputError, match="no range"):
        lc.ocp(SO3, **{**BASE, "duration": (2, 1)})


def test_a_least_time_is_that_of_the_closed_form() -> None:
    """A double integrator about one axis: T = 2 sqrt(J phi / b), the torque at its bound, then at the other."""
    phi, J, b = 0.8, 2.0, 0.5
    problem = lc.ocp(
        SO3, dynamics="second_order", inertia=(1.0, J, 3.0), controls=("w2",), duration=(0.5, 20.0), intervals=32, bounds=b,
        stage_cost="1 + 1e-6*norm2(u)", target="Xd", terminal=("xi",), name="least_time",
    )  # fmt: skip
    plan = problem.solve(Xd=rotation((0, phi, 0)))
    assert plan.status is Status.SOLVED
    assert plan.duration == pytest.approx(2 * np.sqrt(J * phi / b), rel=1e-6)
    np.testing.assert_allclose(plan.u[[0, 15, 16, 31], 0], [b, b, -b, -b], atol=1e-3)
    several = problem.solve(Xd=rotation((0, phi, 0)), starts=4)
    assert several.duration == pytest.approx(plan.duration, rel=1e-6)


def test_forces_and_allocation_of_the_second_order_are_those_of_the_equations() -> None:
    """A satellite on four skew thrusters in a gravity gradient, by DOP853."""
    inertia = np.array([3.0, 2.0, 1.5])
    columns = np.array([[1, -1, 1, -1], [1, 1, -1, -1], [1, 1, 1, 1]]) / np.sqrt(3)
    problem = lc.ocp(
        SO3, dynamics="second_order", inertia=inertia, drag=0.1, allocation=columns, inputs={"f": 4},
        force="p*skew(X)*c", stage_cost=("X - Xd", "xi", "0.3*f"), terminal_cost=("3*(X - Xd)", "2*xi"),
        parameters={"Xd": (3, 3), "p": (), "c": 3}, bounds={"f": (0, 1.5)}, duration=3.0, intervals=60, name="thrusters",
    )  # fmt: skip
    c = np.array([0.2, -0.4, 0.3])
    plan = problem.solve(rotation((0.3, 0.2, 0)), Xd=rotation((0, 0.9, 0.4)), p=0.8, c=c)
    assert plan.status is Status.SOLVED
    assert np.min(plan.controls["f"]) >= 0
    x = np.concatenate([rotation((0.3, 0.2, 0)).ravel(), np.zeros(3)])
    for f in plan.u:

        def rate(_t: float, x: np.ndarray, f: np.ndarray = f) -> np.ndarray:
            X, w = x[:9].reshape(3, 3), x[9:]
            torque = np.cross(inertia * w, w) - 0.1 * w + 0.8 * (X - X.T) / 2 @ c + columns @ f
            return np.concatenate([(X @ SO3.hat(w)).ravel(), torque / inertia])

        x = solve_ivp(rate, (0, 0.05), x, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(plan.X_final, x[:9].reshape(3, 3), atol=1e-6)
    np.testing.assert_allclose(plan.states["xi"][-1], x[9:], atol=1e-6)
