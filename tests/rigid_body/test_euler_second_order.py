"""Euler's equations to second order: the published numbers, Figure 3(d) repaired, slopes against SciPy, valid parts."""

from __future__ import annotations

import numpy as np
import pytest
from package_program import run_example
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import InputError
from lie_codegen.kernel.numpy_arithmetic import evaluate

TERMS = ["-0.3*w1 + 0.2 - 0.1*w2*w3", "0.25*w2 + 0.3*w1 - 0.2", "0.4 - 0.3*w3^2 + 0.2*w1^2"]
GAINS = (-1.35614, 1.26209, -0.187738)


@pytest.fixture(scope="module")
def flow():
    return lc.euler_average(lc.free_rigid_body((3, 4, 5)), TERMS)


@pytest.fixture(scope="module")
def figure():
    return lc.euler_average(lc.free_rigid_body((3, 4, 5)), [f"{g}*w{n + 1}" for n, g in enumerate(GAINS)])


def perturbing(w):
    return np.array([
        -0.3 * w[0] + 0.2 - 0.1 * w[1] * w[2], 0.25 * w[1] + 0.3 * w[0] - 0.2, 0.4 - 0.3 * w[2] ** 2 + 0.2 * w[0] ** 2
    ])  # fmt: skip


def actual(omega0, t, eps):
    def rate(_, w):
        return np.array([-w[1] * w[2] / 3, w[2] * w[0] / 2, -w[0] * w[1] / 5]) + eps * perturbing(w)

    return solve_ivp(rate, (t[0], t[-1]), omega0, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=t).y.T


def test_published_point(flow):
    np.testing.assert_allclose(flow.second_order(1.3, 0.6), [-0.07035630582, 0.00670785606, 0.02302506020], atol=1e-11)
    np.testing.assert_allclose(
        flow.near_identity(1.3, 0.6, 0.123), [0.1591378687, 0.0758399055, -0.0897479084], atol=1e-10
    )
    np.testing.assert_allclose(flow.averaged(1.3, 0.6), [0.13861017791, -0.06979302749, -0.02935763107], atol=1e-11)
    mean = flow.to_mean(1.3, 0.6, 0.2, 0.01)
    np.testing.assert_allclose(mean, [1.2987910580, 0.6010246135, 0.2010198296], atol=1e-10)
    np.testing.assert_allclose(flow.to_osculating(*mean, 0.01), [1.3, 0.6, 0.2], atol=1e-13)


def test_published_run(flow):
    run = flow.solve(flow.body.from_slow(1.3, 0.6, 0.2), [0, 100], 0.01, order=2)
    found = [run.Omega[-1], run.k[-1], run.phi[-1] % 1]
    np.testing.assert_allclose(found, [1.3951902693, 0.5527133131, 0.1952292016], atol=1e-10)
    true = flow.body.to_slow(actual(flow.body.from_slow(1.3, 0.6, 0.2), [0, 100], 0.01)[-1])
    np.testing.assert_allclose(found, true, atol=4e-4)
    np.testing.assert_allclose(found[:2], true[:2], atol=3e-5)


def test_figure_3d_rises(figure):
    """The paper's curve falls because it starts below the cycle; the mean start rises, as the truth does."""
    t, start = [0, 200], (0.5, 0.5, 1)
    np.testing.assert_allclose(figure.solve(start, t, 0.1).mean.Omega[-1], 1.23050, atol=5e-6)
    assert figure.solve(start, t, 0.1).Omega[-1] == pytest.approx(1.21856, abs=5e-6)
    assert figure.solve(start, t, 0.1, order=1).Omega[-1] == pytest.approx(1.20854, abs=5e-6)
    assert figure.solve(start, t, 0.1, order=1, start="osculating").mean.Omega[-1] == pytest.approx(0.98216, abs=5e-6)
    mean = figure.to_mean(*map(float, figure.body.to_slow(start)), 0.1)
    np.testing.assert_allclose(mean, [1.07774, 0.55010, -0.10872], atol=5e-6)


def test_third_order_with_the_phase_as_time(figure):
    """The published run, c3 and the shift of the cycle; then the growth rate of the true system."""
    run = figure.solve((0.5, 0.5, 1), [0, 200], 0.1, order=3)
    assert run.status == "ok"
    assert run.mean.Omega[-1] == pytest.approx(1.3352, abs=5e-5)
    assert run.Omega[-1] == pytest.approx(1.3329, abs=5e-5)
    (cycle,) = lc.limit_cycles(figure)
    c3, dk = figure.cycle_growth(cycle.k)
    assert c3 == pytest.approx(0.738374562, abs=2e-8)
    assert dk == pytest.approx(-0.8747, abs=5e-5)


def test_third_order_beats_the_second(flow):
    errors = {2: [], 3: []}
    for eps in (0.02, 0.01):
        t = np.linspace(0, 1 / eps, 41)
        true = flow.body.to_slow(actual((0.5, 0.5, 1), t, eps))
        for order, rows in errors.items():
            run = flow.solve((0.5, 0.5, 1), t, eps, order=order)
            rows.append(max(np.abs(true.Omega - run.Omega).max(), np.abs(true.k - run.k).max()))
    assert errors[3][1] < errors[2][1] / 3


def test_slopes_to_the_smallest_eps(flow):
    rows = []
    for eps in (0.01, 0.005, 0.0025):
        t = np.linspace(0, 1 / eps, 101)
        true, run = flow.body.to_slow(actual((0.5, 0.5, 1), t, eps)), flow.solve((0.5, 0.5, 1), t, eps)
        turn = true.phi - run.phi
        slow = max(np.abs(true.Omega - run.Omega).max(), np.abs(true.k - run.k).max())
        rows.append([slow, np.abs(turn - np.round(turn)).max()])
        np.testing.assert_allclose(run.omega[0], [0.5, 0.5, 1], atol=1e-11)
    slopes = np.log2(np.array(rows)[:-1] / np.array(rows)[1:])
    assert np.all(slopes[:, 0] > 1.9), slopes
    assert np.all(slopes[:, 1] > 0.9), slopes
    assert rows[-1][0] < 1e-5


def test_a_slowly_varying_inertia_is_a_third_slow_variable():
    body = lc.free_rigid_body(("3 + tau/10", "4 - tau/20", "5 + tau/8"))
    flow = lc.euler_average(body, ["0.2*w1*sin(tau) - (1/10)*w1/(3 + tau/10)", "0", "-0.1*w3"])
    errors = []
    for eps in (0.02, 0.01):
        t = np.linspace(0, 1 / eps, 51)
        run = flow.solve((0.5, 0.5, 1), t, eps)
        rate = flow.library["rate"]
        true = solve_ivp(
            lambda s, w, e=eps, rate=rate: rate(w, e, e * s),
            (0, t[-1]),
            (0.5, 0.5, 1),
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            t_eval=t,
        ).y.T
        slow = body.to_slow(true, eps * t)
        errors.append(max(np.abs(slow.Omega - run.Omega).max(), np.abs(slow.k - run.k).max()))
    assert np.log2(errors[0] / errors[1]) > 1.85


def test_the_valid_part_before_the_separatrix_is_returned():
    flow = lc.euler_average(lc.free_rigid_body((3, 4, 5)), ["0", "0", "-1"])
    start = flow.body.from_slow(1.0, 0.6, 0.0)
    run = flow.solve(start, np.linspace(0, 300, 301), 0.01)
    assert run.status == "separatrix"
    assert 0 < run.t_end < 300
    assert len(run.t) == len(run.k) == int(run.t_end) + 1
    assert run.mean.k[-1] < 0.999
    short = flow.solve(start, [0, run.t_end / 2], 0.01)
    assert short.status == "ok"


def test_batches_and_other_modes(flow):
    starts = np.array([[0.5, 0.5, 1], [1, 0.5, 0.1]])  # about the largest and about the smallest moment
    runs = flow.solve(starts, [0, 20], 0.01)
    for start, run in zip(starts, runs, strict=True):
        np.testing.assert_allclose(run.omega[-1], actual(start, [0, 20], 0.01)[-1], atol=5e-3)
        np.testing.assert_allclose(run.omega[0], start, atol=1e-10)


def test_c_and_its_twin_and_the_package(flow, tmp_path):
    kernels = {kernel.name: kernel for kernel in flow.kernels()}
    for mine, theirs in zip(
        evaluate(kernels["terms"], [1.3, 0.95]), flow.second_order_library.terms([1.3, 0.95]), strict=True
    ):
        np.testing.assert_allclose(mine, theirs, rtol=1e-11, atol=1e-12)
    folder = lc.generate(list(kernels.values()), tmp_path / "out", name="euler_average")
    run_example(folder, "euler_average")


def test_refusals(flow):
    with pytest.raises(InputError, match="order is 1, 2 or 3"):
        flow.solve((0.5, 0.5, 1), [0, 1], 0.01, order=5)
    with pytest.raises(InputError, match="increasing"):
        flow.solve((0.5, 0.5, 1), [1, 0], 0.01)
    with pytest.raises(InputError, match="pole"):
        flow.second_order(1.0, 0.0)
    with pytest.raises(InputError, match="separatrix"):
        flow.second_order(1.0, 0.9999999)


def test_a_run_is_a_value(flow, tmp_path):
    run = flow.solve((0.5, 0.5, 1), [0, 20], 0.01)
    assert lc.load(run.save(tmp_path / "run.npz")) == run
