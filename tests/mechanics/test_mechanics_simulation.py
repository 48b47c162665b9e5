"""Second-order systems on groups: order of the method, published targets, references, and the variational integrator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm

from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.control.reference_check import check_reference
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.control.reference_motion import formula_reference
from lie_codegen.control.second_order_step import second_order_step
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.control.waypoints import waypoint_reference
from lie_codegen.errors import ComputationError, InputError, NotOnGroupError, ShapeError
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.mechanics.kernels import spatial_momentum_kernel
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.mechanics.variational_step import variational_step
from lie_codegen.runtime.build import build_kernels

pytestmark = pytest.mark.filterwarnings("ignore::lie_codegen.errors.InertiaWarning")


def test_published_attitude_trajectory_compiled() -> None:
    so3 = load("so3")
    law = attitude_law("pd", inertia=[6, 3, 1], k_p=4, k_d=6)
    run = closed_loop(
        so3,
        inertia=[6, 3, 1],
        law=law,
        X0=expm(so3.hat([1.2, -0.8, 1])),
        xi0=[0.3, -0.4, 0.5],
        t=np.linspace(0, 10, 101),
    )
    theta = so3.project(logm(run.X[-1]))
    np.testing.assert_allclose(theta, [0.0101356443745298, 7.72832249593381e-05, 7.32487101341846e-04], atol=1e-10)
    assert run.outputs["V"][-1] == pytest.approx(2.06713158951836e-4, abs=1e-11)
    assert np.all(np.diff(run.outputs["V"]) < 0)
    assert np.max(np.abs(run.X[-1].T @ run.X[-1] - np.eye(3))) < 1e-12


@pytest.mark.parametrize("name", ["so3", "se3", "sl2"])
def test_the_step_is_of_fourth_order_and_agrees_with_scipy(name: str) -> None:
    group = load(name)
    n, d = group.dim, group.degree
    inertia = np.diag(np.arange(2.0, n + 2))
    rng = np.random.default_rng(0)
    xi0 = 0.7 * rng.normal(size=n)
    c = group.algebra.structure_constants

    def rate(_, x):
        X, xi = x[: d * d].reshape(d, d), x[d * d :]
        force = np.einsum("ijk,i->kj", c, xi).T @ inertia @ xi
        return np.concatenate([(X @ group.hat(xi)).ravel(), np.linalg.solve(inertia, force)])

    exact = solve_ivp(rate, (0, 1), np.concatenate([np.eye(d).ravel(), xi0]), rtol=1e-13, atol=1e-14, method="DOP853")
    errors = []
    for step in (0.1, 0.05, 0.025):
        run = closed_loop(group, inertia=inertia, xi0=xi0, t=[0, 1], step=step)
        errors.append(np.max(np.abs(run.X[-1].ravel() - exact.y[: d * d, -1])))
    slopes = np.diff(np.log2(errors))
    assert np.all(np.abs(slopes + 4) < 0.25), (errors, slopes)


def test_many_initial_states_at_once_are_the_single_runs() -> None:
    so3 = load("so3")
    law = attitude_law("pd", inertia=[3, 2, 2], k_p=4, k_d=6)
    rng = np.random.default_rng(0)
    X0 = np.array([expm(so3.hat(x)) for x in rng.normal(size=(5, 3))])
    xi0 = rng.normal(size=(5, 3))
    t = np.linspace(0, 1, 5)
    many = closed_loop(so3, inertia=[3, 2, 2], law=law, X0=X0, xi0=xi0, t=t, step=0.01)
    assert many.X.shape == (5, 5, 3, 3)
    one = closed_loop(so3, inertia=[3, 2, 2], law=law, X0=X0[3], xi0=xi0[3], t=t, step=0.01)
    np.testing.assert_allclose(many.X[:, 3], one.X, atol=1e-14)
    np.testing.assert_allclose(many.outputs["torque"][:, 3], one.outputs["torque"], atol=1e-13)


def test_complex_group_closed_loop_converges() -> None:
    su2 = load("su2")
    law = tracking_law(su2, inertia=[2, 3, 4], error="frobenius", gains={"k_p": 4, "K_d": 6}, feedforward="right")
    reference = formula_reference(su2, ["sin(t)", "t/3", "cos(t)"])
    run = closed_loop(
        su2, inertia=[2, 3, 4], law=law, reference=reference, X0=expm(su2.hat([1, 0.5, -1])), t=np.linspace(0, 15, 31),
        tolerance=1e-8,
    )  # fmt: skip
    assert run.outputs["W"][-1] < 1e-5 * run.outputs["W"][0]
    np.testing.assert_allclose(run.X[-1], run.X_d[-1], atol=5e-3)


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "sl2"])
def test_formula_reference_velocities_are_those_of_the_curve(name: str) -> None:
    group = load(name)
    start = expm(group.hat(0.3 * np.arange(group.dim)))
    reference = formula_reference(group, [f"sin({k + 1}*t)/3 + t^2/10" for k in range(group.dim)], start=start)
    check_velocities(group, reference, (0.4, 1.3))
    check_reference(reference, 0, 2, samples=40)


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "h3"])
def test_waypoints_are_passed_smoothly_with_derived_velocities(name: str) -> None:
    group = load(name)
    rng = np.random.default_rng(1)
    times = [0, 1, 1.5, 3]
    points = [expm(group.hat(0.8 * rng.normal(size=group.dim))) for _ in times]
    reference = waypoint_reference(group, times, points)
    function = function_of(reference_kernel(reference))

    def at(t):
        X, xi, rate = (np.array(value).ravel() for value in function(t))
        X = X.view(complex) if group.is_complex else X
        return X.reshape(group.degree, group.degree), xi, rate

    for t, X in zip(times, points, strict=True):
        np.testing.assert_allclose(at(t)[0], X, atol=1e-12)
    for t in times:  # twice continuously differentiable, at rest at the ends
        (_, a, p), (_, b, q) = at(t - 1e-9), at(t + 1e-9)
        np.testing.assert_allclose(a, b, atol=1e-6)
        np.testing.assert_allclose(p, q, atol=2e-6)
    np.testing.assert_allclose(at(0)[1], 0, atol=1e-14)
    np.testing.assert_allclose(at(9)[1], 0, atol=1e-12)
    check_velocities(group, reference, (0.4, 1.2, 2.0))
    check_reference(reference, 0, 3, at)


def check_velocities(group, reference, times):
    function = function_of(reference_kernel(reference))

    def at(t):
        X, xi, rate = (np.array(value).ravel() for value in function(t))
        X = X.view(complex) if group.is_complex else X
        return X.reshape(group.degree, group.degree), xi, rate

    h = 1e-4
    for t in times:
        X, xi, rate = at(t)
        slope = (8 * (at(t + h)[0] - at(t - h)[0]) - at(t + 2 * h)[0] + at(t - 2 * h)[0]) / (12 * h)
        np.testing.assert_allclose(group.vee(np.linalg.solve(X, slope)), xi, atol=1e-9)
        np.testing.assert_allclose((at(t + h)[1] - at(t - h)[1]) / (2 * h), rate, atol=1e-5)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("1/(t-1)", "no finite value|jumps"),
        ("abs(t-0.731)", "has a kink"),
        ("tan(t*2)", "jumps|no finite"),
        ("atan(tan(t))", "jumps by 2 at t = 1.5707"),
    ],
)
def test_references_that_jump_are_refused(formula: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_reference(formula_reference(load("so3"), [formula, "0", "t"]), 0, 2)


def test_wrong_references_and_states_are_refused() -> None:
    so3 = load("so3")
    eye = np.eye(3)
    with pytest.raises(InputError, match="the reference jumps: waypoint 3 at t = 1"):
        waypoint_reference(so3, [0, 1, 1], [eye] * 3)
    with pytest.raises(InputError, match="no unique way"):
        waypoint_reference(so3, [0, 1], [eye, np.diag([1.0, -1, -1])])
    with pytest.raises(NotOnGroupError, match="waypoint 2 is not on the group"):
        waypoint_reference(so3, [0, 1], [eye, 1.1 * eye])
    with pytest.raises(InputError, match="needs 3 formulas"):
        formula_reference(so3, ["t"])
    law = tracking_law(so3, inertia=1, error="so3_right", gains={"K_p": 1, "K_d": 1})
    with pytest.raises(InputError, match="tracks: give it a reference"):
        closed_loop(so3, inertia=1, law=law, t=[0, 1])
    with pytest.raises(ShapeError, match="give \\(3, 3\\)"):
        closed_loop(so3, inertia=1, xi0=[1, 2], t=[0, 1])
    with pytest.raises(InputError, match="equal steps"):
        closed_loop(so3, inertia=1, t=[0, 1, 3])
    with pytest.raises(NotOnGroupError, match="not on the group se3"):
        closed_loop(load("se3"), inertia=1, X0=np.ones((4, 4)), t=[0, 1])
    with pytest.raises(ComputationError, match="do not bring the error below"):
        closed_loop(so3, inertia=[1, 2, 3], xi0=[1e5, 1e5, 0], t=[0, 1000], tolerance=1e-14)


@pytest.mark.parametrize("name", ["so3", "se3"])
def test_variational_integrator_keeps_momentum_and_bounds_the_energy(name: str) -> None:
    group = load(name)
    inertia = np.diag([6.0, 3, 1, 4, 5, 7][: group.dim])
    lib = build_kernels(
        lambda: [variational_step(group, inertia), spatial_momentum_kernel(group, inertia)], namespace=group.name
    )
    xi = np.array([0.2, 1.0, 0.1, 0.3, -0.2, 0.1][: group.dim])
    start, _ = initial_states(group, None, inertia @ xi)
    states = lib.variational_step.scan(start[0], n=20_000, every=100, h=0.05)
    X, mu = split_states(group, states)
    velocities = np.linalg.solve(inertia, mu.T).T
    momentum = lib.spatial_momentum.batch(X, np.ascontiguousarray(velocities))
    assert np.max(np.abs(momentum - momentum[0])) < 1e-10 * max(1.0, np.max(np.abs(X)))
    energy = np.einsum("ki,ki->k", velocities, mu) / 2
    assert np.max(np.abs(energy / energy[0] - 1)) < 5e-3
    halves = np.abs(energy - energy[0])
    assert halves[100:].max() < 1.2 * halves[:101].max() + 1e-9  # bounded, without drift


def test_variational_integrator_is_of_second_order_and_with_gravity_keeps_what_gravity_keeps() -> None:
    so3 = load("so3")
    inertia = np.diag([6.0, 4, 3])

    def heavy(ops, X):  # a heavy top: torque e3 x R' g
        return [X[2][1], -1 * X[2][0], 0]

    lib = build_kernels(lambda: [variational_step(so3, inertia, heavy)], namespace="so3")
    start, _ = initial_states(so3, expm(so3.hat([0.3, 0.5, 0.1])), inertia @ np.array([0.1, 0.2, 2.0]))
    ends = [
        split_states(so3, lib.variational_step.scan(start[0], n=n, every=n, h=2.0 / n)[-1:])
        for n in (100, 200, 400, 3200)
    ]
    errors = [np.max(np.abs(X - ends[-1][0])) for X, _ in ends[:-1]]
    assert np.all(np.abs(np.diff(np.log2(errors)) + 2) < 0.1)
    X0, mu0 = split_states(so3, start)
    for X, mu in ends:  # the vertical component of the spatial momentum
        assert abs((X[0] @ mu[0])[2] - (X0[0] @ mu0[0])[2]) < 1e-12


def test_variational_integrator_refuses_a_group_its_map_leaves() -> None:
    from lie_codegen.groups.definition import from_matrices

    aff = from_matrices("scale", ["a"], [[["1", 0], [0, "2"]]])
    with pytest.raises(InputError, match="Cayley map leaves the group"):
        variational_step(aff, 1)


def test_the_step_refuses_an_indefinite_inertia() -> None:
    with pytest.raises(InputError, match="not positive definite"):
        second_order_step(load("so3"), [1, 1, 0])
