"""Connections: published numbers of swimmer, oscillator and cat, curvature by small loops, frames, gaits, C."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError

CIRCLE = lc.PeriodicInput(["cos(t)", "sin(t)"])


def swimmer():
    return lc.example_connection("three_link_swimmer")


def log_of(group, X):
    return lc.group(group).vee(np.real(logm(X)))


def flown(connection, r, rate, T):
    """X(T) by an integrator of another kind."""
    d = connection.group.degree

    def slope(t, y):
        u = -connection.A(r(t)) @ rate(t)
        return (y.reshape(d, d) @ connection.group.hat(u)).ravel()

    end = solve_ivp(slope, (0, T), np.eye(d).ravel(), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end.reshape(d, d)


def test_swimmer_connection_and_curvature():
    A = swimmer()
    np.testing.assert_allclose(A.A((0, 0)), [[-7 / 27, 7 / 27], [0, 0], [1 / 18, 1 / 18]], atol=1e-15)
    np.testing.assert_allclose(A.curvature((0, 0))[0, 1], (0, 5 / 243, 0), atol=1e-15)
    np.testing.assert_allclose(A.curvature((0.5, 0.2))[0, 1], (0.02836868, 0.02157771, -0.00357622), atol=6e-9)
    many = A.curvature(np.broadcast_to((0.5, 0.2), (4, 5, 2)))
    assert many.shape == (4, 5, 2, 2, 3)
    np.testing.assert_allclose(many[1, 2], -np.swapaxes(many[1, 2], 0, 1), atol=1e-17)


def test_swimmer_displacements():
    A = swimmer()
    for radius, log, area in (
        (0.8, (0, -0.0350382233, 0.00746289426), -0.0359349452),
        (1.2, (0, -0.0624323564, 0.0207309221), -0.0679791904),
    ):
        X = A.displacement(CIRCLE, amplitude=radius)
        np.testing.assert_allclose(log_of("se2", X), log, atol=6e-11)
        np.testing.assert_allclose(A.cbvi(CIRCLE, amplitude=radius), (0, area, 0), atol=6e-11)
    oracle = flown(
        A,
        lambda t: 0.8 * np.array([np.cos(t), np.sin(t)]),
        lambda t: 0.8 * np.array([-np.sin(t), np.cos(t)]),
        2 * np.pi,
    )
    np.testing.assert_allclose(A.displacement(CIRCLE, amplitude=0.8), oracle, atol=1e-11)


def test_swimmer_average_to_order_four():
    gait = lc.PeriodicInput(["cos(t) + 0.2*sin(2*t)", "sin(t)"])
    F = swimmer().average(gait, order=4, centre=(0.3, -0.2)).F
    expected = [
        (0, 0, 0),
        (-0.00165448732, -0.00862526397, 0.00266193617),
        (-0.00174358829, -0.0000131114229, 0.00206994673),
        (-0.000197576112, 0.00197549941, -0.000536407187),
    ]
    np.testing.assert_allclose(F, expected, atol=6e-12)


def test_oscillator_average_and_the_paper():
    """(77) of TR 93-59 is F_2; odd orders vanish."""
    A = lc.example_connection("oscillator")
    F = A.average(lc.PeriodicInput(["sin(t)", "cos(t) - 1", "sin(2*t)/2"]), order=6).F
    np.testing.assert_allclose(F[1], (0, 0, 0.14), atol=1e-13)
    np.testing.assert_allclose(F[3], (-0.0687361111, 0, -0.0513138889), atol=6e-11)
    np.testing.assert_allclose(F[5], (0.0786430150, 0, 0.00758641035), atol=6e-11)
    np.testing.assert_allclose(F[[0, 2, 4]], 0, atol=1e-13)


def test_falling_cat():
    cat = lc.example_connection("falling_cat")
    X = cat.displacement(CIRCLE)
    np.testing.assert_allclose(log_of("so3", X), (0, 1.17272252, -2.12770023), atol=6e-9)


def test_falling_cat_momentum_is_zero_by_particles():
    """The momentum of two rigid bodies made of point masses, moved by xi = -A r'."""
    cat = lc.example_connection("falling_cat", mass=1, distance="0.3", inertia=("0.06", "0.06", "0.02"))
    r, rate = np.array([0.4, -0.7]), np.array([0.3, 1.1])
    omega = -cat.A(r) @ rate
    # six points on the axes of a body with the moments (.06, .06, .02): x^2 = (Jy + Jz - Jx)/2 / m
    spread = np.sqrt([0.01, 0.01, 0.05]) * np.sqrt(3)
    points = np.vstack([np.diag(spread), -np.diag(spread)])

    def place(shape):
        a, b = shape
        Q = expm(np.cross(np.eye(3), [a, 0, 0])) @ expm(np.cross(np.eye(3), [0, b, 0]))
        own = np.vstack([points - [0, 0, 0.3], points @ Q.T + 0.3 * Q[:, 2]])
        return own - own.mean(axis=0)

    h = 1e-6
    velocity = (place(r + h * rate) - place(r - h * rate)) / (2 * h) + np.cross(omega, place(r))
    np.testing.assert_allclose(np.cross(place(r), velocity).sum(axis=0), 0, atol=1e-8)


def test_wheels_are_the_constant_connection_of_the_paper():
    wheels = lc.MomentumWheels((1, 2, 3), [(1, 0, 0), (0, 1, 1)], (0.1, 0.2), (0.05, 0.1))
    A = lc.example_connection("momentum_wheels", wheels=wheels)
    np.testing.assert_allclose(A.A((0.3, 5.0)), -wheels.C, rtol=1e-13)


@pytest.mark.parametrize(
    ("group", "A"),
    [
        ("so3", [["r1*r2", "cos(r2)"], ["sin(r1)", "r2^2"], ["1 + r1", "exp(r1)/3"]]),
        ("se2", [["r2", "1"], ["r1^2", "sin(r1*r2)"], ["1", "r1"]]),
        ("h3", [["r2", "1"], ["r1", "2"], ["cos(r2)", "r1*r2"]]),
        ("su2", [["r2", "1"], ["r1", "2"], ["cos(r2)", "r1*r2"]]),
        ("se3", [["r1", "0"], ["0", "r2"], ["1", "1"], ["r2", "r1"], ["1", "r1*r2"], ["sin(r1)", "1"]]),
    ],
)
def test_small_loops_measure_the_curvature(group, A):
    """log X = -DA area + O(radius^3), area > 0 counter-clockwise: the sign of the bracket is the classic mistake."""
    connection = lc.connection(group, shape=("r1", "r2"), A=A)
    centre, radius = (0.4, -0.3), 0.01
    # both directions of the circle, from opposite points: the third-order terms cancel in the mean
    X = connection.displacement(CIRCLE, amplitude=radius, centre=centre)
    Y = connection.displacement(CIRCLE, amplitude=-radius, centre=centre)
    log = (log_of_group(connection.group, X) + log_of_group(connection.group, Y)) / 2
    expected = -connection.curvature(centre)[0, 1] * np.pi * radius**2
    np.testing.assert_allclose(log, expected, atol=2e-3 * np.abs(expected).max())


def log_of_group(group, X):
    return group.project(logm(X))


def test_frame_of_least_motion_makes_the_area_rule_good():
    A = swimmer()
    B = A.best_frame(half_width=1.4, degree=3, length=1.0)
    assert (B.frame.cost_before, B.frame.cost_after) == pytest.approx((1.1425, 0.0038), abs=5e-5)
    for radius, before, after in ((0.4, 0.10, 0.0041), (0.8, 0.21, 0.0023), (1.2, 0.33, 0.013)):
        errors = []
        for connection in (A, B):
            exact = log_of("se2", connection.displacement(CIRCLE, amplitude=radius))
            near = connection.cbvi(CIRCLE, amplitude=radius)
            errors.append(np.linalg.norm(near - exact) / np.linalg.norm(exact))
        assert errors == pytest.approx((before, after), rel=0.05)


def test_a_frame_is_a_change_of_gauge():
    A = swimmer()
    B = A.best_frame(half_width=1.0, degree=2)
    h0 = B.frame.element(np.array([0.8, 0.0]))
    X = A.displacement(CIRCLE, amplitude=0.8)
    np.testing.assert_allclose(B.displacement(CIRCLE, amplitude=0.8), np.linalg.solve(h0, X @ h0), atol=1e-12)
    oracle = flown(
        B,
        lambda t: 0.8 * np.array([np.cos(t), np.sin(t)]),
        lambda t: 0.8 * np.array([-np.sin(t), np.cos(t)]),
        2 * np.pi,
    )
    np.testing.assert_allclose(B.displacement(CIRCLE, amplitude=0.8), oracle, atol=1e-10)
    # the curvature of the new A, by differences of it, is the old one turned
    at, step = np.array([0.5, 0.2]), 1e-5
    slopes = [(B.A(at + step * e) - B.A(at - step * e)) / (2 * step) for e in np.eye(2)]
    first, second = B.A(at).T
    turned = (
        slopes[0][:, 1] - slopes[1][:, 0] - np.einsum("i,j,ijk->k", first, second, B.group.algebra.structure_constants)
    )
    np.testing.assert_allclose(B.curvature(at)[0, 1], turned, atol=1e-9)
    F = B.average(lc.PeriodicInput(["cos(t)", "sin(t)"]), order=3).F
    small = B.displacement(CIRCLE, amplitude=0.02)
    np.testing.assert_allclose(log_of("se2", small), 2 * np.pi * (F[1] * 0.02**2 + F[2] * 0.02**3), atol=2e-7)


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_averages_have_error_of_one_order_more(order):
    A = swimmer()
    gait = lc.PeriodicInput(["cos(t) + 0.2*sin(2*t)", "sin(t)"])
    average = A.average(gait, order=order, centre=(0.3, -0.2))
    errors = []
    for eps in (0.2, 0.1):
        exact = log_of("se2", A.displacement(gait, amplitude=eps, centre=(0.3, -0.2)))
        errors.append(np.abs(exact - average.log(eps)).max())
        np.testing.assert_allclose(average.displacement(eps), expm(A.group.hat(average.log(eps))), atol=1e-14)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=0.35)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_stored_momentum_slopes(order):
    """xi = -A r' + M_11^-1 Ad*_X mu with mu = eps mu_1; errors O(eps^p) over times of order 1 / eps."""
    A = lc.example_connection("oscillator")
    gait, mu = lc.PeriodicInput(["sin(t)", "cos(t)", "sin(2*t)/2"]), np.array([0.3, -0.5, 0.4])
    average = A.average(gait, order=order, momentum=mu)

    def actual(eps, periods):
        def slope(t, y):
            X = y.reshape(3, 3)
            r = eps * np.array([np.sin(t), np.cos(t), np.sin(2 * t) / 2])
            rate = eps * np.array([np.cos(t), -np.sin(t), np.cos(2 * t)])
            inertia = np.diag([3, 4, 5]) + 0.7 * (r @ r * np.eye(3) - np.outer(r, r))
            u = np.linalg.solve(inertia, -0.7 * np.cross(r, rate) + X.T @ (eps * mu))
            return (X @ np.cross(np.eye(3), u)).ravel()

        span = (0, 2 * np.pi * periods)
        return solve_ivp(slope, span, np.eye(3).ravel(), method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1].reshape(3, 3)

    errors = [
        np.abs(actual(eps, periods) - average.displacement(eps, periods)).max()
        for eps, periods in ((0.2, 4), (0.1, 8), (0.05, 16))
    ]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    # the oscillator's odd orders vanish but for the momentum, so that slopes may be one better
    assert slopes[-1] > order - 0.3


def test_a_square_gait_and_a_path_of_corners_agree():
    A = swimmer()
    corners = [(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)]
    pieces = lc.PeriodicInput.from_pieces(
        [("1", ["0.5 - t", "0.5"]), ("2", ["-0.5", "1.5 - t"]), ("3", ["t - 2.5", "-0.5"]), ("4", ["0.5", "t - 3.5"])]
    )
    X = A.displacement(corners)
    np.testing.assert_allclose(A.displacement(pieces), X, atol=1e-11)
    assert A.cbvi(corners)[1] == pytest.approx(A.cbvi(pieces)[1], rel=1e-10)


def test_best_gait_of_the_swimmer():
    gait = lc.gait(swimmer(), maximise="vx", harmonics=3)
    assert gait.objective == pytest.approx(0.11140, abs=6e-6)
    assert (gait.efficiency, gait.distance) == pytest.approx((0.11184, 0.0844), abs=5e-5)
    assert abs(gait.log[0]) == pytest.approx(0.0066, abs=6e-5)
    X = swimmer().displacement(gait.r)
    np.testing.assert_allclose(X, gait.X, atol=1e-11)


def test_gradients_of_gaits_are_those_of_differences():
    from lie_codegen.averaging.gait_design import _Search

    search = _Search(swimmer(), "distance", 2, 10.0, 32)
    p = 0.5 * np.random.default_rng(0).normal(size=10)
    step = 1e-6
    numeric = [(search.objective(p + step * e) - search.objective(p - step * e)) / (2 * step) for e in np.eye(10)]
    np.testing.assert_allclose(search.gradient(p), numeric, atol=1e-8)


def test_gait_in_c():
    A = swimmer()
    lib = lc.build(A.kernels(1))
    np.testing.assert_allclose(lib.connection((0.5, 0.2)), A.A((0.5, 0.2)), atol=1e-15)
    N, gait = 128, np.array([[0, 0.8, 0], [0, 0, 0.8]])
    times = 2 * np.pi / N * np.arange(N)
    end = lib.gait_step.scan(np.eye(3), n=N, every=N, gait=gait, t=times, h=2 * np.pi / N)[-1]
    np.testing.assert_allclose(end, A.displacement(CIRCLE, amplitude=0.8), atol=2e-9)


@pytest.mark.slow
def test_a_cat_turns_over_within_limits_by_optimal_control():
    """The open layer in shape space: X' = X hat(-A(r) v), r' = v, |v| <= 3, a given attitude, the back as it was."""
    cat = lc.example_connection("falling_cat")
    velocity = next(kernel for kernel in cat.kernels() if kernel.name == "shape_velocity")
    goal = expm(cat.group.hat((0, 1.0, -2.0)))
    ends = [f"X{i + 1}{j + 1} - ({goal[i, j]:.15f})" for i, j in ((0, 1), (0, 2), (1, 2))]
    problem = lc.ocp(
        "so3", inputs={"v": (2,)}, states={"r": (2,)}, velocity=velocity, rates={"r": ["v1", "v2"]}, duration=6.0, intervals=60,
        stage_cost="norm2(v)/2", bounds=3.0, terminal=["r1 - 1", "r2", *ends],
    )  # fmt: skip
    t, w = (np.arange(60) + 0.5) / 10, np.pi / 3
    plan = problem.solve(np.eye(3), r=(1.0, 0.0), guess=w * np.stack([-np.sin(w * t), np.cos(w * t)], axis=-1))
    np.testing.assert_allclose(plan.X[-1], goal, atol=1e-8)
    assert np.abs(plan.u[:]).max() <= 3 + 1e-9


def test_formulas_stand_for_a_gait():
    X = swimmer().displacement(["cos(t)", "sin(t)"], amplitude=0.8)
    np.testing.assert_array_equal(X, swimmer().displacement(CIRCLE, amplitude=0.8))


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda A: A.displacement([(0, 0), (1, 0), (0, 1)]), InputError, ["does not close", "rates"]),
        (lambda A: A.displacement(lc.PeriodicInput.from_pieces([("1", ["t", "0"])])), InputError, ["does not close"]),
        (lambda A: A.displacement(lc.PeriodicInput(["cos(t)"])), ShapeError, ["1 components", "2"]),
        (
            lambda A: A.average(lc.PeriodicInput.from_pieces([("1", ["t", "0"]), ("2", ["2-t", "0"])])),
            InputError,
            ["corners"],
        ),
        (lambda A: A.average(CIRCLE, order=0), InputError, ["order"]),
        (lambda A: lc.gait(A, maximise="vz"), InputError, ["omega, vx, vy"]),
        (lambda A: A.A((1, 2, 3)), ShapeError, ["last axis"]),
        (lambda A: lc.connection("se2", shape=("r",), A=[["1"], ["2"]]), ShapeError, ["3 x 1"]),
        (lambda A: lc.connection("se2", shape=("r",), A=[["abs(r)"], ["2"], ["0"]]), InputError, ["not analytic"]),
        (lambda A: lc.connection("se2", shape=("r",)), InputError, ["either A="]),
        (lambda A: lc.example_connection("snakeboard"), InputError, ["falling_cat"]),
    ],
)
def test_refusals(call, error, words):
    with pytest.raises(error) as caught:
        call(swimmer())
    assert all(word in str(caught.value) for word in words)


def test_a_singular_metric_names_the_shape():
    metric = [["r1", "0", "0", "1"], ["0", "1", "0", "0"], ["0", "0", "1", "0"], ["1", "0", "0", "1"]]
    A = lc.connection("se2", shape=("r1",), metric=metric)
    assert A.A((0.5,))[0, 0] == pytest.approx(2)
    with pytest.raises(InputError, match=r"singular at r = \[0.0\].*nonholonomic"):
        A.A((0.0,))
    with pytest.raises(InputError, match="not symmetric"):
        lc.connection("se2", shape=("r1",), metric=[["1", "0", "0", "1"], *metric[1:3], ["0", "0", "0", "1"]])
