"""Averaged torques: published numbers, closed forms, the true motion, events, refusals, C."""

from __future__ import annotations

import numpy as np
import pytest
from package_program import run_example
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

import lie_codegen as lc
from lie_codegen.errors import ExpressionError, InputError, ShapeError

START, OMEGA, BODY = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix(), (0.3, 0.4, 0.9), (3, 4, 5)
FIELD, DIPOLE = (0.2, -0.5, 0.4), (0.1, 0.2, 0.3)
TENSOR = [[0.03, 0.004, 0], [0.004, 0.02, -0.003], [0, -0.003, 0.04]]


def debris():
    normals = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0.6, 0.8, 0), (-0.6, -0.8, 0)]
    centres = [
        (0.6, 0, 0),
        (-0.6, 0, 0),
        (0, 0.5, 0.1),
        (0, -0.5, 0.1),
        (0.05, 0, 0.8),
        (0.05, 0, -0.8),
        (0.1, 1.9, 0.2),
        (0.1, 1.9, 0.2),
    ]
    return lc.plates(
        normals=normals, centres=centres, areas=[2, 2, 1.5, 1.5, 1, 1, 3, 3],
        specular=[0.3, 0.1, 0.2, 0.2, 0.4, 0.1, 0.2, 0.05], diffuse=[0.2, 0.4, 0.2, 0.5, 0.1, 0.3, 0.1, 0.1],
    )  # fmt: skip


def orbiting(pressure=2e-4):
    sun = ["cos(n*t)", "0.6*sin(n*t)", "0.8*sin(n*t)"]
    return lc.tumbling_average(
        BODY, [lc.torque.solar_pressure(debris(), sun=sun, pressure=pressure, parameters={"n": 2e-4})]
    )


@pytest.mark.parametrize(
    ("torque", "mean", "power", "digits"),
    [
        (lc.torque.gravity_gradient((0.3, 0.8, -0.5), 0.01), (-0.01709477084, 0.00131190911, -0.00815780793), 0, 1e-11),
        (lc.torque.eddy_current(TENSOR, FIELD), (0.00702318630, -0.00313679961, -0.00743259266), -0.00987315116, 1e-11),
        (lc.torque.residual_dipole(DIPOLE, FIELD), (0.11368343271, 0.09824158348, 0.06596026300), 0, 1e-11),
        (lc.torque.solar_pressure(debris(), (1, 2, -1), 0.9), (0.1914104, -0.0960000, 0.1622550), 0.0700865, 1e-7),
        (lc.torque.drag(debris(), (0.2, -1, 0.6), 0.7), (-0.1538324, -0.0834978, -0.0878855), -0.0036814, 1e-7),
    ],
)  # fmt: skip
def test_published_means(torque, mean, power, digits):
    found = lc.tumbling_average(BODY, [torque]).rate(START, OMEGA)
    np.testing.assert_allclose(found.H_dot, mean, atol=digits)
    assert found.power == pytest.approx(power, abs=digits)


def test_closed_forms():
    """Gravity gradient, a round eddy tensor and the dipole by their formulas, with SciPy's elliptic integral."""
    free = lc.free_rotation(BODY, START, OMEGA)
    h, L = free.H / np.linalg.norm(free.H), np.linalg.norm(free.H)
    t = free.nutation_period * np.arange(64) / 64
    w = free.omega(t)
    momentum = w * BODY
    c = np.mean(np.sum(momentum**2 * BODY, axis=1)) / L**2
    r, d = 2.5, np.array([0.3, 0.8, -0.5]) / np.linalg.norm([0.3, 0.8, -0.5])
    found = lc.tumbling_average(BODY, [lc.torque.gravity_gradient(r * d, 0.7)]).rate(START, OMEGA).H_dot
    np.testing.assert_allclose(found, 3 * 0.7 / r**3 * (3 * c - 12) / 2 * (d @ h) * np.cross(d, h), atol=1e-12)
    B = np.array(FIELD)
    found = lc.tumbling_average(BODY, [lc.torque.eddy_current(0.03, B)]).rate(START, OMEGA)
    expected = 0.03 * 2 * free.energy / L**2 * ((B @ free.H) * B - B @ B * free.H)
    np.testing.assert_allclose(found.H_dot, expected, atol=1e-13)
    found = lc.tumbling_average(BODY, [lc.torque.residual_dipole((0, 0, 0.3), B)]).rate(START, OMEGA).H_dot
    r3 = np.sqrt(1 - 3 * (L**2 - 2 * 5 * free.energy) / (L**2 * (3 - 5)))
    np.testing.assert_allclose(found, 0.3 * np.pi * r3 / (2 * ellipk(free.k**2)) * np.cross(h, B), atol=1e-12)


def test_a_rotated_body_gives_the_same_mean():
    """The same torque in other body axes: X R, R^T J R, R^T m."""
    R = Rotation.from_rotvec([0.7, 0.2, -1.1]).as_matrix()
    there = lc.tumbling_average(R.T @ np.diag(BODY) @ R, [lc.torque.eddy_current(R.T @ np.array(TENSOR) @ R, FIELD)])
    here = lc.tumbling_average(BODY, [lc.torque.eddy_current(TENSOR, FIELD)])
    np.testing.assert_allclose(there.rate(START @ R, R.T @ OMEGA).H_dot, here.rate(START, OMEGA).H_dot, atol=1e-13)


def test_a_formula_of_the_same_torque():
    b = [f"(X1{i}*0.2 - X2{i}*0.5 + X3{i}*0.4)" for i in (1, 2, 3)]
    formulas = [f"0.2*{b[2]} - 0.3*{b[1]}", f"0.3*{b[0]} - 0.1*{b[2]}", f"0.1*{b[1]} - 0.2*{b[0]}"]
    mean = lc.tumbling_average(BODY, [lc.torque.formula(formulas)]).rate(START, OMEGA)
    known = lc.tumbling_average(BODY, [lc.torque.residual_dipole(DIPOLE, FIELD)]).rate(START, OMEGA)
    np.testing.assert_allclose(mean.H_dot, known.H_dot, atol=1e-13)


def dipole_and_drag(ops, omega, t, X, m, c):
    """A kernel written by hand: m x b(t) less c omega, its inputs in an order of its own."""
    field = (0.2, -0.5 * ops.cos(ops.constant(0.3) * t), 0.4)
    b = [sum(X[i][j] * field[i] for i in range(3)) for j in range(3)]
    pairs = ((1, 2), (2, 0), (0, 1))
    return ([m[i] * b[j] - m[j] * b[i] - c * w for (i, j), w in zip(pairs, omega, strict=True)],)


def own_kernel(body=dipole_and_drag, size=3):
    ports = (lc.Port("omega", (3,)), lc.Port("t", ()), lc.Port("X", (3, 3)), lc.Port("m", (3,)), lc.Port("c", ()))
    return lc.Kernel("own", "stranger", ports, (lc.Port("N", (size,)),), body)


def test_a_kernel_of_ones_own():
    """Rates, runs and direct motion of a kernel are those of the same torque as formulas; two kernels are told apart."""
    b = [f"(X1{i}*0.2 - X2{i}*0.5*cos(0.3*t) + X3{i}*0.4)" for i in (1, 2, 3)]
    rows = [f"0.2*{b[2]} - 0.3*{b[1]}", f"0.3*{b[0]} - 0.1*{b[2]}", f"0.1*{b[1]} - 0.2*{b[0]}"]
    text = lc.torque.formula([f"0.01*({row}) - 0.002*w{i + 1}" for i, row in enumerate(rows)])
    given = {"m": 0.01 * np.array(DIPOLE), "c": 0.002}
    models = [lc.tumbling_average(BODY, [each]) for each in (lc.torque.formula(own_kernel(), given), text)]
    rates = [model.rate(START, OMEGA, t=1.7) for model in models]
    np.testing.assert_allclose(rates[0].H_dot, rates[1].H_dot, rtol=1e-12)
    assert rates[0].power == pytest.approx(rates[1].power, rel=1e-12)
    runs = [model.direct(START, OMEGA, [0, 10]) for model in models]
    np.testing.assert_allclose(runs[0].H, runs[1].H, atol=1e-13)
    other = lc.torque.formula(own_kernel(lambda ops, omega, t, X, m, c: ([-c * w for w in omega],)), given)
    damped = lc.tumbling_average(BODY, [other]).rate(START, OMEGA)
    free = lc.free_rotation(BODY, START, OMEGA)
    spin = free.omega(free.nutation_period * np.arange(64) / 64)
    assert damped.power == pytest.approx(-0.002 * np.mean(np.sum(spin**2, axis=1)), rel=1e-11)


def test_kernels_that_are_no_torque():
    for broken, parameters, why in (
        (own_kernel(), {}, "parameters="),
        (own_kernel(), {"m": DIPOLE, "c": 1, "d": 2}, "'d'"),
        (own_kernel(), {"m": (1, 2), "c": 1}, "shape"),
        (own_kernel(), {"m": (1, 2, np.nan), "c": 1}, "NaN"),
        (own_kernel(size=4), {"m": DIPOLE, "c": 1}, "shape"),
        (7, None, "three formulas or a kernel"),
    ):
        with pytest.raises(ValueError, match=why):
            lc.torque.formula(broken, parameters)


def test_direct_is_the_true_system():
    """Against SciPy with the plates written out once more."""
    model, plates = orbiting(0.005), debris()
    J = np.diag(BODY).astype(float)

    def rate(t, y):
        X, w = y[:9].reshape(3, 3), y[9:]
        d = np.array([np.cos(2e-4 * t), 0.6 * np.sin(2e-4 * t), 0.8 * np.sin(2e-4 * t)])
        b, N = X.T @ d, np.zeros(3)
        for n, r, A, s, q in zip(
            plates.normals, plates.centres, plates.areas, plates.specular, plates.diffuse, strict=True
        ):
            lit = max(0.0, n @ b)
            N += np.cross(r, -0.005 * A * lit * ((1 - s) * b + (2 * s * lit + 2 / 3 * q) * n))
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([(X @ skew).ravel(), np.linalg.solve(J, np.cross(J @ w, w) + N)])

    true = solve_ivp(
        rate, (0, 20), np.concatenate([START.ravel(), OMEGA]), method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.05
    ).y[:, -1]
    run = model.direct(START, OMEGA, [0, 20], steps_per_turn=3000)
    np.testing.assert_allclose(run.X[-1].ravel(), true[:9], atol=3e-8)
    np.testing.assert_allclose(run.omega[-1], true[9:], atol=3e-8)
    uneven = model.direct(START, OMEGA, [0, 3, 20], steps_per_turn=3000)
    np.testing.assert_allclose(uneven.X[-1], run.X[-1], atol=3e-8)


def test_published_run_under_solar_pressure():
    model = orbiting()
    run = model.solve(START, OMEGA, [0, 6000])
    assert run.status == "ok"
    np.testing.assert_allclose(run.H[0], [-2.1127496, -0.4765899, 4.3502184], atol=2e-7)
    assert run.energy[0] == pytest.approx(2.4794209, abs=3e-7)
    np.testing.assert_allclose(run.H[-1], [-1.9713440, -0.9478551, 4.4607753], atol=4e-7)
    assert run.energy[-1] == pytest.approx(2.5836623, abs=3e-7)
    naive = model.solve(START, OMEGA, [0, 6000], start="osculating", osculating=False)
    true = np.array([-1.9714121, -0.9478844, 4.4606254])  # published mean of the direct run
    assert np.abs(naive.H[-1] - true).max() > 2.5 * np.abs(run.H[-1] - true).max()
    assert abs(naive.energy[-1] - 2.5836) > 0


def test_osculating_motion_from_the_mean():
    """Adding the torus map brings the average nearer to the direct run, at every time."""
    model, t = orbiting(), np.linspace(0, 400, 9)
    run, true = model.solve(START, OMEGA, t), model.direct(START, OMEGA, t)
    mean, full = np.abs(run.H - true.H).max(axis=1), np.abs(run.osculating_H - true.H).max(axis=1)
    np.testing.assert_allclose(run.osculating_H[0], true.H[0], atol=2e-6)
    assert full.max() < 0.5 * mean.max()
    assert np.abs(run.osculating_energy - true.energy).max() < np.abs(run.energy - true.energy).max()


def test_error_of_the_mean_falls_with_the_force():
    errors = []
    for pressure in (8e-4, 4e-4, 2e-4):
        model, end = orbiting(pressure), 200 * 2e-4 / pressure
        t = np.array([0, end])
        errors.append(np.abs(model.solve(START, OMEGA, t).osculating_H[-1] - model.direct(START, OMEGA, t).H[-1]).max())
    assert errors[2] < 0.5 * errors[0]


def test_a_function_of_time_is_a_direction():
    def sun(t):
        return [np.cos(2e-4 * t), 0.6 * np.sin(2e-4 * t), 0.8 * np.sin(2e-4 * t)]

    called = lc.tumbling_average(BODY, [lc.torque.solar_pressure(debris(), sun, 2e-4)])
    run, known = called.solve(START, OMEGA, [0, 500]), orbiting().solve(START, OMEGA, [0, 500])
    np.testing.assert_allclose(run.H, known.H, atol=1e-12)
    np.testing.assert_allclose(
        called.direct(START, OMEGA, [0, 5]).X, orbiting().direct(START, OMEGA, [0, 5]).X, atol=1e-12
    )


def despun():
    return lc.tumbling_average(
        (5, 4, 2.5), [lc.torque.eddy_current(np.diag([0.001, 0.0025, 0.0045]), (0.3, 0.8, -0.5))]
    )


def test_published_separatrix():
    run = despun().solve(START, (0.35, 0.2, 1), [0, 2706.244, 8000], start="osculating")
    assert run.status.startswith("separatrix")
    np.testing.assert_allclose(run.H[-1], [-0.39641020, -0.78468590, 1.02665845], atol=1e-7)
    assert run.dynamic_inertia[-1] == pytest.approx(3.28431158, abs=1e-7)
    assert len(run.t) == 2
    event = run.event
    assert event.t == pytest.approx(5412.49, abs=0.006)
    assert np.linalg.norm(event.H) == pytest.approx(1.27484, abs=5e-6)
    assert (event.kind, event.mode_left, event.mode_entered) == ("separatrix", "LAM", "SAM")
    for name, (X, omega) in event.continuations.items():
        np.testing.assert_allclose(X @ (np.array([5, 4, 2.5]) * omega), event.H, atol=1e-12)
        assert np.sign(omega[0]) == float(name)  # the axis of the largest moment


def test_both_continuations():
    t = [0, 5000, 5500, 8000]
    plus, minus = (despun().solve(START, (0.35, 0.2, 1), t, start="osculating", sign=s) for s in (1, -1))
    for run in (plus, minus):
        np.testing.assert_array_equal(run.t, t)
        assert list(run.mode) == ["LAM", "LAM", "SAM", "SAM"]
        assert "continued" in run.status
        assert np.all(np.diff(run.dynamic_inertia) > 0)


def test_resonances_are_reported():
    run = despun().solve(START, (0.35, 0.2, 1), [0, 5000], start="osculating")
    ratios = {(each.n1, each.n2) for each in run.resonances}
    assert ratios
    for each in run.resonances:
        state = despun().solve(START, (0.35, 0.2, 1), [0, each.t], start="osculating", osculating=False)
        k, m = state.k[-1], np.diff(state.H[:, 0])[0]
        assert 0 < k < 1
        assert m != 0


def test_batches():
    model = despun()
    omegas = np.array([(0.35, 0.2, 1), (0.1, 0.2, 1)])
    rates = model.rate(START, omegas)
    assert rates.H_dot.shape == (2, 3)
    np.testing.assert_array_equal(rates.H_dot[1], model.rate(START, omegas[1]).H_dot)
    runs = model.solve(START, omegas, [0, 100])
    np.testing.assert_array_equal(runs[1].H, model.solve(START, omegas[1], [0, 100]).H)
    assert len(model.direct(START, omegas, [0, 1])) == 2


def test_the_package_in_c(tmp_path):
    torques = [
        lc.torque.solar_pressure(debris(), ["cos(t)", "0", "sin(t)"], 1e-3),
        lc.torque.eddy_current(TENSOR, FIELD),
        lc.torque.formula(own_kernel(), {"m": DIPOLE, "c": 0.1}),
        lc.torque.drag(debris(), lambda t: (1, t, 0), 0.1),
    ]
    folder = lc.generate(list(lc.tumbling_average(BODY, torques).kernels()), tmp_path / "out", name="tumbling")
    run_example(folder, "tumbling")


def test_refusals():
    def box(**changes):
        given = {"normals": [(1, 0, 0)], "centres": [(1, 0, 0)], "areas": [1], "specular": [0.3], "diffuse": [0.2]}
        return lc.plates(**{**given, **changes})

    cases = [
        (lambda: box(normals=[(0, 0, 0)]), InputError, "plate 1 has a normal of length zero"),
        (lambda: box(areas=[-1]), InputError, "negative area"),
        (lambda: box(specular=[0.9]), InputError, "specular [+] diffuse > 1"),
        (lambda: box(centres=[(1, 0)]), ShapeError, "normals have shape"),
        (lambda: lc.torque.solar_pressure(box(), (0, 0, 0)), InputError, "direction is zero"),
        (lambda: lc.torque.solar_pressure(box(), "x"), InputError, "three numbers"),
        (lambda: lc.torque.formula(["X44", "0", "0"]), ExpressionError, "no name 'X44'"),
        (lambda: lc.torque.formula(["w1"]), InputError, "three formulas"),
        (lambda: lc.torque.drag(3, (1, 0, 0), 1), InputError, "lc.plates"),
        (lambda: lc.tumbling_average(BODY, []), InputError, "no torque"),
        (lambda: lc.tumbling_average(BODY, [3]), InputError, "no torque of lc.torque"),
        (
            lambda: lc.tumbling_average((2, 2, 2), [lc.torque.residual_dipole(DIPOLE, FIELD)]).rate(START, OMEGA),
            InputError,
            "no torus",
        ),
        (lambda: orbiting(5.0).solve(START, OMEGA, [0, 1]), InputError, r"\|N\| Tn / L, at most 0.1"),
        (lambda: despun().solve(START, OMEGA, [1, 0]), InputError, "increasing"),
        (lambda: lc.euler_average(lc.free_rigid_body(BODY), ["X11*w1", "0", "0"]), InputError, "tumbling_average"),
    ]
    for call, error, words in cases:
        with pytest.raises(error, match=words):
            call()
    assert orbiting(5.0).solve(START, OMEGA, [0, 0.01], force=True).torque_ratio > 0.1


def test_models_and_runs_are_values(tmp_path):
    model = despun()
    assert lc.load(model.save(tmp_path / "model.npz")) == model
    run = model.solve(START, (0.35, 0.2, 1), [0, 100])
    assert lc.load(run.save(tmp_path / "run.npz")) == run
