"""Lagrangians from text, Routh reduction, vector fields: against hand-derived equations and the full dynamics."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from mechanical_systems import arm, cart, dumbbell, pendulum
from scipy.integrate import solve_ivp

from lie_codegen.errors import ExpressionError, InputError
from lie_codegen.groups.build import build
from lie_codegen.mechanics.lagrangian import lagrangian_system
from lie_codegen.mechanics.routh import routh_reduce
from lie_codegen.mechanics.vector_fields import (
    homogeneous_parts,
    is_vertical_lift,
    lie_bracket,
    pull_back_series,
    symmetric_product,
    tidy,
)
from lie_codegen.mechanics.vibrational_kernels import lagrangian_kernels


def numeric(expression, values):
    return float(expression.subs(values))


def test_pendulum_equations():
    system = pendulum()
    (th,), (w,) = system.q, system.v
    assert sp.simplify(system.drift[1] - (sp.Rational(981, 100) * sp.sin(th) - w / 5)) == 0
    assert system.input_fields[0] == sp.ImmutableMatrix([0, sp.sin(th)])
    assert system.cyclic == ()
    assert system.inputs == ("u",)
    assert pendulum(g=None).parameters == ("g",)


def test_euler_lagrange_by_differences_of_the_lagrangian():
    """d/dt dL/dv - dL/dq = Q along the computed accelerations, with L differenced numerically."""
    system = arm()
    (rate, _) = lagrangian_kernels(system)
    function = build(rate)["rate"]
    lagrangian = sp.lambdify([system.q, system.v], system.lagrangian)
    rng = np.random.default_rng(0)
    step = 1e-5
    for _ in range(10):
        q, v, u = rng.normal(size=2), rng.normal(size=2), rng.normal(size=2)
        acceleration = function([*q, *v], u)[2:]

        def momentum(time, i, q=q, v=v, acceleration=acceleration):
            at, speed = q + v * time + acceleration * time**2 / 2, v + acceleration * time
            move = np.eye(2)[i] * step
            return (lagrangian(at, speed + move) - lagrangian(at, speed - move)) / (2 * step)

        force = [u[0] - 10 * q[0] - 3 * v[0], u[1] - 0.1 * v[1]]
        for i in range(2):
            move = np.eye(2)[i] * step
            slope = (lagrangian(q + move, v) - lagrangian(q - move, v)) / (2 * step)
            change = (momentum(1e-4, i) - momentum(-1e-4, i)) / 2e-4
            assert change - slope == pytest.approx(force[i], abs=3e-5)


def test_routh_reduction_moves_as_the_full_system_and_reconstructs_the_cyclic_angle():
    reduced = dumbbell()
    full = reduced.full
    p = 2.0010
    y0 = np.array([1.02, 1.5, 0.01, -0.02])
    shape = dict(zip(reduced.system.state, y0, strict=True))
    turn = numeric(reduced.cyclic_velocity[0].subs(shape), {"p": p} | {sp.Symbol("p", real=True): p})
    outer = build(lagrangian_kernels(full))["rate"]
    inner = build(lagrangian_kernels(reduced.system, "reduced"))["rate"]
    start = [y0[0], y0[1], 0.0, y0[2], y0[3], turn]
    whole = solve_ivp(lambda t, y: outer(y, [0.0]), (0, 8), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    part = solve_ivp(lambda t, y: inner(y, [0.0], p), (0, 8), y0, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(part, whole[[0, 1, 3, 4]], atol=1e-9)


def test_connection_curvature_and_amended_potential_of_the_dumbbell():
    """nu' = p / 2(rho^2 + e^2) - A th', A = e^2 / (rho^2 + e^2); amendment p^2 / 4(rho^2 + e^2)."""
    reduced = dumbbell()
    rho, th = reduced.system.q
    e2, p = sp.Rational(1, 400), sp.Symbol("p", real=True)
    connection = e2 / (rho**2 + e2)
    assert sp.simplify(reduced.connection[0, 1] - connection) == 0
    assert reduced.connection[0, 0] == 0
    assert sp.simplify(reduced.curvature[0][1, 0] - sp.diff(connection, rho)) == 0
    potential = p**2 / (4 * (rho**2 + e2)) - (2 - e2 / rho**2 * (1 - 3 * sp.cos(th) ** 2)) / rho
    assert sp.simplify(reduced.amended_potential - potential) == 0
    assert reduced.full.cyclic == ("nu",)


def test_gyroscopic_force_is_minus_b_p_v():
    """(2): EL of the Routhian = EL of the modified Routhian plus B p x'."""
    reduced = dumbbell()
    system, (b,) = reduced.system, reduced.curvature
    p = sp.Symbol("p", real=True)
    v = sp.Matrix(system.v)
    modified = (v.T * system.mass * v)[0] / 2 - reduced.amended_potential
    momentum = sp.Matrix([sp.diff(modified, x) for x in system.v])
    force = sp.Matrix([sp.diff(modified, x) for x in system.q]) - momentum.jacobian(sp.Matrix(system.q)) * v
    assert (system.generalized_force - force + b * v * p).applyfunc(sp.simplify) == sp.zeros(2, 1)


def test_reduced_equations_match_the_papers_29_30_to_the_order_stated():
    """(29)-(30) with l/r read as eps/rho and r' as rho': they keep eps^2 of the amendment and drop eps^4."""
    system = dumbbell().system
    rho, th, drho, dth = system.state
    p, e = sp.Symbol("p", real=True), sp.Rational(1, 20)
    short = e**2 / rho**2
    first = (
        e**4 / rho**3 * (1 - 2 * short) * dth**2
        - p * e**2 / rho**3 * (1 - 2 * short) * dth
        + p**2 / (4 * rho**3) * (1 - 2 * short)
        - 1 / rho**2
        + 3 * e**2 / (2 * rho**4) * (1 - 3 * sp.cos(th) ** 2)
    )
    second = (
        -2 * e**2 / rho**3 * (1 - short) * drho * dth
        + p / rho**3 * (1 - short) * drho
        - 3 / rho**3 * (1 + short) * sp.cos(th) * sp.sin(th)
    )
    at = {rho: 1.02, th: 1.4, drho: 0.1, dth: 0.3, p: 2.0}
    assert abs(numeric(system.drift[2] - first, at)) < 1.1 * 3 * 0.05**4 * 4 / 4
    assert abs(numeric(system.drift[3] - second, at)) < 2 * 0.05**4 * 2 * 0.1


def test_brackets_symmetric_products_and_degrees():
    system = arm()
    state, drift = system.state, system.drift
    first, second = system.input_fields
    assert lie_bracket(first, second, state) == sp.zeros(4, 1)
    assert symmetric_product(first, second, drift, state) == symmetric_product(second, first, drift, state)
    delta = sp.ImmutableMatrix([0, 0, *system.v])
    parts = homogeneous_parts(drift, state)
    assert set(parts) == {-1, 0, 1}
    assert (sum(parts.values(), sp.zeros(4, 1)) - drift).applyfunc(tidy) == sp.zeros(4, 1)
    for degree, part in parts.items():
        assert (lie_bracket(delta, part, state) - degree * part).applyfunc(tidy) == sp.zeros(4, 1)
    bracket = lie_bracket(first, drift, state)
    assert set(homogeneous_parts(bracket, state)) <= {-1, 0}
    product = symmetric_product(first, first, drift, state)
    assert is_vertical_lift(product, state)
    assert lie_bracket(second, product, state) == sp.zeros(4, 1)


def test_pull_back_series_is_the_change_of_variables():
    """X pulled back along y = w + s Y(q) is X + s [Y, X] - s^2 <Y : Y> / 2, exactly."""
    system = pendulum()
    state, lift = system.state, system.input_fields[0]
    s = sp.Symbol("s")
    x, bracket, product = pull_back_series(system.drift, lift, state)
    moved = dict(zip(state, sp.Matrix(state) + s * lift, strict=True))
    jacobian = (sp.Matrix(state) + s * lift).jacobian(sp.Matrix(state))
    pulled = jacobian.inv() * system.drift.subs(moved, simultaneous=True)
    assert (pulled - x - s * bracket - s**2 / 2 * product).applyfunc(sp.simplify) == sp.zeros(2, 1)


def test_two_cyclic_coordinates_at_once():
    planar = lagrangian_system(
        coordinates=("r", "x", "phi"), lagrangian="dr^2/2 + r^2*dphi^2/2 + dx^2/2 + r*dx*dr - r^4", parameters={}
    )
    assert planar.cyclic == ("x", "phi")
    reduced = routh_reduce(planar, momentum={"x": "px", "phi": 3})
    assert reduced.system.parameters == ("px",)
    valued = lagrangian_system(
        coordinates=("r", "x"), lagrangian="dr^2/2 + dx^2/2 + r*dx*dr - k*r^4", parameters={"k": 2, "p": "1/3"}
    )
    assert routh_reduce(valued, momentum={"x": "3*p*k"}).momenta == (2,)
    assert routh_reduce(valued, momentum={"x": "3*p*k"}).system.parameters == ()
    r = reduced.system.q[0]
    assert sp.simplify(reduced.amended_potential - (r**4 + sp.Symbol("px", real=True) ** 2 / 2 + 9 / (2 * r**2))) == 0


def test_refusals_say_what_is_wrong():
    def system(**changes):
        arguments = {"coordinates": ("x",), "lagrangian": "dx^2/2", "parameters": {}}
        return lagrangian_system(**{**arguments, **changes})

    cases = [
        (lambda: system(lagrangian="dx^4/4"), "not quadratic in the velocities"),
        (lambda: system(coordinates=("x", "z")), "no kinetic energy contains dz"),
        (lambda: system(coordinates=("x", "z"), lagrangian="(dx + dz)^2/2"), r"no kinetic energy along \(-1, 1\)"),
        (lambda: system(forces={"x": "u^2"}), "not affine"),
        (lambda: system(forces={"z": "u"}), "'z' is no coordinate"),
        (lambda: system(parameters={"x": 1}), "hides a coordinate"),
        (lambda: system(coordinates=("x", "dx")), "also the velocity"),
        (lambda: system(coordinates="x"), "sequence of different names"),
        (lambda: system(forces={"x": "u + k"}, inputs=("u",)), "no name 'k'"),
        (lambda: routh_reduce(cart(), momentum={"th": 1}), "th is not cyclic: the Lagrangian depends on it"),
        (lambda: routh_reduce(cart(), momentum={"y": 1}), "no coordinate"),
        (lambda: routh_reduce(cart(), momentum={}), "cyclic here: x"),
        (lambda: routh_reduce(cart(), momentum={"x": "u"}), "something that varies"),
        (lambda: routh_reduce(system(), momentum={"x": 1}), "every coordinate"),
        (lambda: routh_reduce(system(forces={"x": "u"}), momentum={"x": 1}), "force or an input acts on it"),
        (lambda: routh_reduce(system(dissipation="dx^2"), momentum={"x": 1}), "dissipation acts on it"),
    ]
    for call, words in cases:
        with pytest.raises(InputError, match=words):
            call()
    with pytest.raises(ExpressionError, match="lagrangian: column 1: no name 'dy'"):
        system(lagrangian="dy^2/2")
