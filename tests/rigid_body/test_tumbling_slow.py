"""The slow flow of a tumbling body: exact derivatives of its averages, equilibria, periodic orbits with their multipliers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.averaging.orbit_kernels import kernel_orbit_kernels
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.runtime.ode import integrate
from lie_codegen.runtime.ode_field import Field

START, OMEGA, BODY = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix(), (0.3, 0.4, 0.9), (3, 4, 5)
#: Damped, spun about the third axis, and shaken across it until w1 is large: it goes on tumbling.
SHAKEN = lc.torque.formula(["0.1*w1*(1 - 5*w1^2)", "-0.01*w2", "0.08 - 0.06*w3"])


def held(field, **parameters):
    return lc.tumbling_average(BODY, [lc.torque.eddy_current(0.06, field, parameters=parameters or None), SHAKEN])


def differences(function, y, size):
    """(4, 4) by central differences of order 4."""
    columns = []
    for i in range(4):
        e = np.zeros(4)
        e[i] = size[i]
        near, far = function(y + e) - function(y - e), function(y + 2 * e) - function(y - 2 * e)
        columns.append((8 * near - far) / (12 * size[i]))
    return np.array(columns).T


def averaged(model, axes_of):
    """(H, D), t -> their rates, by the kernel that `solve` integrates, at 64 phases."""
    motion = lc.free_rotation(BODY, *axes_of).motion
    constants = {"paper": motion["paper"], "inertia": motion["inertia"], "nodes": 64.0, "carry": 0.0}
    return Field(model.library["slow_rate"], 6, constants=constants)


@pytest.mark.parametrize(
    "torque",
    [
        lc.torque.solar_pressure(
            lc.plates([(1, 0, 0), (0.6, 0.8, 0), (0, 0, -1)], [(0.6, 0, 0), (0.1, 1.9, 0.2), (0.1, 0, -0.8)], 2, 0.3, 0.2),
            ["cos(0.1*t)", "0.6*sin(0.1*t)", "0.8*sin(0.1*t)"], 2e-2,
        ),
        lc.torque.eddy_current([[0.03, 0.004, 0], [0.004, 0.02, -0.003], [0, -0.003, 0.04]], (0.2, -0.5, 0.4)),
    ],
)  # fmt: skip
def test_averages_are_differentiated_exactly(torque):
    kernel, y, scale = lc.tumbling_average(BODY, [torque]).slow_flow(START, OMEGA)
    kernels = {each.name: each for each in kernel_orbit_kernels(kernel, {})}
    library = lc.build(list(kernels.values()))
    time = (1.3,)
    found = np.asarray(library.jacobian(y, *time))
    expected = differences(lambda at: np.asarray(library.rate(at, *time)), y, 3e-4 * scale)
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())  # plates have kinks
    twin = np.array(kernels["jacobian"].evaluate(FloatArithmetic(), y.tolist(), *time)[0], dtype=float)
    np.testing.assert_allclose(twin, found, atol=1e-14)


def test_an_equilibrium_and_its_eigenvalues():
    """A body that shakes itself against eddy currents ends in a tumbling motion about the field."""
    model = held((0.2, -0.8, 0.4))
    run = model.solve(START, OMEGA, [0, 500], force=True, osculating=False)
    X, omega = run.end
    np.testing.assert_allclose(X @ (np.array(BODY) * omega), run.H[-1], atol=1e-13)
    assert np.sum(BODY * omega**2) / 2 == pytest.approx(run.energy[-1], rel=1e-13)
    found = model.equilibrium(X, omega)
    assert found.stable
    assert found.residual < 1e-14
    assert 0.1 < found.k < 0.5
    np.testing.assert_allclose(np.cross(found.H, (0.2, -0.8, 0.4)), 0, atol=1e-12)
    field = averaged(model, (X, omega))
    y = np.append(found.H, found.H @ found.H - 10 * found.energy)
    matrix = differences(lambda at: field(0.0, np.append(at, [0, 0]))[:4], y, 1e-3 * np.array([5, 5, 5, 5]))
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(matrix)), np.sort_complex(found.eigenvalues), atol=1e-8
    )
    late = model.solve(START, OMEGA, [0, 4000], force=True, osculating=False)
    np.testing.assert_allclose(late.H[-1], found.H, atol=1e-6)
    assert late.k[-1] == pytest.approx(found.k, abs=1e-6)


def test_a_run_goes_on_from_its_end():
    model = held((0.2, -0.8, 0.4))
    whole = model.solve(START, OMEGA, [0, 50, 80], force=True, osculating=False)
    first = model.solve(START, OMEGA, [0, 50], force=True, osculating=False)
    rest = model.solve(*first.end, [50, 80], start="osculating", force=True, osculating=False)
    np.testing.assert_allclose(rest.H[-1], whole.H[-1], atol=1e-8)


@pytest.mark.slow
def test_the_orbit_of_a_turning_field():
    """Its start returns, its monodromy is that of differences, and the averaged run settles on it."""
    model, T = held(["0.3*cos(n*t)", "-0.8", "0.3*sin(n*t)"], n="0.02"), 2 * np.pi / 0.02
    run = model.solve(START, OMEGA, [0, 4 * T, 12 * T], force=True, osculating=False)
    orbit = lc.floquet(model, guess=run.end, period=T)
    assert orbit.stable
    assert not orbit.autonomous
    assert orbit.liouville < 1e-10
    np.testing.assert_allclose(orbit.start[:3], run.H[-1], atol=1e-6)
    field = averaged(model, run.end)

    def flow(y):
        return integrate(field, np.append(y, [0, 0]), 0, T, rtol=1e-12, atol=[1e-12] * 4 + [np.inf] * 2).y[-1, :4]

    np.testing.assert_allclose(flow(orbit.start), orbit.start, atol=1e-10)
    np.testing.assert_allclose(orbit.monodromy, differences(flow, orbit.start, np.full(4, 1e-2)), atol=1e-7)
    np.testing.assert_allclose(
        orbit.at(T / 3), integrate(field, np.append(orbit.start, [0, 0]), 0, T / 3).y[-1, :4], atol=1e-9
    )


@pytest.mark.slow
def test_a_limit_cycle_of_the_slow_flow():
    """H is driven round the vertical at a rate of 0.05: the period follows from the symmetry, one multiplier is 1."""
    H = [f"(3*X{i}1*w1 + 4*X{i}2*w2 + 5*X{i}3*w3)" for i in (1, 2, 3)]
    inertial = [f"0.02*{H[0]}*(1 - ({H[0]}^2 + {H[1]}^2)/9) - 0.05*{H[1]}",
                f"0.02*{H[1]}*(1 - ({H[0]}^2 + {H[1]}^2)/9) + 0.05*{H[0]}", f"0.02*(2 - {H[2]})"]  # fmt: skip
    turning = lc.torque.formula([" + ".join(f"X{i + 1}{j}*({inertial[i]})" for i in range(3)) for j in (1, 2, 3)])
    model = lc.tumbling_average(BODY, [turning, lc.torque.formula(["0.1*w1*(1 - 5*w1^2)", "-0.01*w2", "0"])])
    run = model.solve(START, OMEGA, [0, 400], force=True, osculating=False, rtol=1e-7)
    orbit = lc.floquet(model, guess=run.end)
    assert orbit.period == pytest.approx(2 * np.pi / 0.05, rel=1e-9)
    assert orbit.stable
    assert orbit.trivial_error < 1e-8


def test_refusals():
    model = held((0.2, -0.8, 0.4))
    called = lc.tumbling_average(BODY, [lc.torque.eddy_current(0.06, lambda t: (1, 0, 0))])
    for call, error, why in (
        (lambda: lc.floquet(model, guess=(1, 2, 3, 4)), InputError, "(X, omega)"),
        (lambda: lc.floquet(model), InputError, "(X, omega)"),
        (lambda: model.equilibrium(START, [OMEGA, OMEGA]), InputError, "one motion"),
        (lambda: model.equilibrium(START, (0, 0, 0)), InputError, "no torus"),
        (lambda: called.equilibrium(START, OMEGA), InputError, "torque.eddy_current is a Python function"),
        (lambda: lc.tumbling_average(BODY, [lc.torque.formula(["1", "0", "0"])]).equilibrium(START, OMEGA), ComputationError, "no equilibrium"),
    ):  # fmt: skip
        with pytest.raises(error) as raised:
            call()
        assert why in str(raised.value)
