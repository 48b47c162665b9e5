"""Certificates: constants against published values and closed forms, rates against simulated loops, refusals."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.control.certificate_constants import Metric
from lie_codegen.control.error_catalogue import as_error
from lie_codegen.control.interval_proof import proved_hessian, proved_ratio, proved_transport
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.errors import InputError

INERTIA = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1]])
GAINS = {"K_p": np.diag([4.0, 5, 6]), "K_d": np.diag([3.0, 4, 5])}
LOOP: dict[str, Any] = {"inertia": INERTIA, "error": "so3_right", "gains": GAINS}
ONE, ZERO = np.eye(3), np.zeros(3)


@cache
def found(**options: Any) -> Any:
    return lc.certificate("so3", **LOOP, **{"prove": False, **options})


def test_published_constants() -> None:
    cert = found(level=4.5)
    assert abs(cert.L - 9) < 1e-13  # a level at a critical point, which Newton finds to rounding
    assert (cert.b_1, cert.b_2) == (pytest.approx(0.3451565, rel=1e-6), pytest.approx(0.0988490, rel=1e-6))
    assert (cert.hessian, cert.transport) == (pytest.approx(5.0646167, rel=1e-6), pytest.approx(0.7952147, rel=1e-6))
    assert cert.theorem_epsilon == pytest.approx(0.0248073, rel=1e-5)
    assert cert.theorem_rate == pytest.approx(0.0375980, rel=1e-5)
    assert cert.theorem_k == pytest.approx(1.1181792, rel=1e-6)
    assert cert.rate == pytest.approx(0.94611, rel=2e-5)
    assert cert.epsilon == pytest.approx(0.34591, rel=1e-4)
    assert cert.limit_rate == pytest.approx(1.474156, rel=1e-6)
    assert found(level=4.5, epsilon=0.34).rate == pytest.approx(0.930963, rel=1e-5)


def test_a_moving_reference_costs_rate() -> None:
    cert = found(level=4.5, speed=0.8)
    assert cert.theorem_rate == pytest.approx(0.0307078, rel=1e-5)
    assert cert.theorem_k == pytest.approx(1.0963139, rel=1e-6)
    assert cert.rate == pytest.approx(0.8508, rel=1e-3)
    assert found(level=4.5, speed=0.8, epsilon=0.324).rate == pytest.approx(0.845598, rel=1e-5)


def test_b_1_grows_with_the_level() -> None:
    assert found(level=7.2).b_1 == pytest.approx(0.6147708, rel=1e-6)


@pytest.mark.parametrize(
    ("level", "b_1", "b_2"), [(1, 0.8, 0.2734634), (4, 1.1300388, 0.1458160), (10, 1.527234416, None)]
)
def test_heisenberg_is_global_with_a_rate_that_falls(level: float, b_1: float, b_2: float | None) -> None:
    cert = lc.certificate("h3", inertia=1, error="frobenius", gains={"k_p": 1, "K_d": 1}, level=level)
    assert float("inf") == cert.L
    assert cert.b_1 == pytest.approx(b_1, rel=1e-6)
    if b_2 is not None:
        assert cert.b_2 == pytest.approx(b_2, rel=1e-4)


def test_bounds_hold_on_fresh_samples_and_the_proof_is_beyond_them() -> None:
    cert = found(level=4.5, prove=True)
    A = np.trace(GAINS["K_p"]) * ONE - GAINS["K_p"]
    rng = np.random.default_rng(5)
    n = rng.normal(size=(100_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    a = rng.uniform(0, np.pi / 2, (len(n), 1))
    phi = np.sin(a[:, 0]) ** 2 * np.einsum("ni,ij,nj->n", n, A, n)
    w = np.cos(a) * (n @ A) - np.sin(a) * np.cross(n, n @ A)
    ratio = np.einsum("ni,ij,nj->n", n, A, n) / np.einsum("ni,ij,nj->n", w, np.linalg.inv(INERTIA), w)
    ratio = ratio[phi <= 4.5]
    assert cert.b_2 <= ratio.min()
    assert ratio.max() <= cert.b_1 <= cert.b_1_proved <= 1.011 * cert.b_1
    assert 0.989 * cert.b_2 <= cert.b_2_proved <= cert.b_2
    assert "proved in interval arithmetic" in cert.status
    assert cert.hessian <= cert.hessian_proved <= 1.011 * cert.hessian
    assert cert.transport <= cert.transport_proved <= 1.011 * cert.transport
    assert 0.9 * cert.theorem_rate < cert.theorem_rate_proved < cert.theorem_rate
    assert np.isnan(found(level=4.5).theorem_rate_proved)


def test_a_false_bound_is_never_proved() -> None:
    metric = Metric(lc.group("so3"), INERTIA)
    assert proved_hessian(GAINS["K_p"], INERTIA, metric.nabla, 4.5, 1.01 * 5.0646167)
    assert not proved_hessian(GAINS["K_p"], INERTIA, metric.nabla, 4.5, 0.99 * 5.0646167)
    assert proved_transport(INERTIA, metric.nabla, 1.01 * 0.7952147)
    assert not proved_transport(INERTIA, metric.nabla, 0.99 * 0.7952147)
    unit = np.eye(3)  # I = 1: b_1 = 1/(least of A - level), b_2 = 1/largest of A, both attained
    assert proved_ratio(GAINS["K_p"], unit, 4.5, 1.01 / 4.5, upper=True)
    assert not proved_ratio(GAINS["K_p"], unit, 4.5, 0.97 / 4.5, upper=True)
    assert proved_ratio(GAINS["K_p"], unit, 4.5, 0.99 / 11, upper=False)
    assert not proved_ratio(GAINS["K_p"], unit, 4.5, 1.03 / 11, upper=False)


def test_overshoot_is_traded_for_rate() -> None:
    bounded = found(level=4.5, overshoot=2.6)
    assert bounded.k == pytest.approx(2.6)
    assert bounded.rate == pytest.approx(0.546, rel=1e-3)
    with pytest.raises(InputError, match="overshoot"):
        found(level=4.5, overshoot=0.9)
    edge = np.sqrt(2 * bounded.b_2)  # where |eps d phi . xi_e| <= eps/sqrt(2 b_2) W_total reaches W_total
    for epsilon in (50.0, 1.001 * edge, 0.0, -0.1, np.nan):
        with pytest.raises(InputError, match="stops being positive"):
            found(level=4.5, epsilon=epsilon)
    with pytest.raises(InputError, match="has the overshoot"):
        found(level=4.5, epsilon=1.001 * edge * 1.6 / 3.6, overshoot=2.6)


def test_inside_has_three_values() -> None:
    cert = found(level=4.5)
    so3 = lc.group("so3")
    turned = [expm(so3.hat([angle, 0, 0])) for angle in (0.3, 2.0, np.pi)]
    assert cert.inside(turned[0], ZERO, ONE, ZERO) is True
    assert cert.inside(turned[1], ZERO, ONE, ZERO) is None  # between the level and L: no rate
    assert cert.inside(turned[2], ZERO, ONE, ZERO) is False
    assert cert.inside(ONE, ZERO, ONE, [0.1, 0, 0]) is None  # the reference is faster than `speed`
    assert cert.W(turned[2], ZERO, ONE, ZERO) == pytest.approx(11)


def test_what_is_not_covered_is_refused() -> None:
    for option in ({"limits": 3}, {"sample": 0.01}, {"delay": 1}):
        with pytest.raises(InputError, match="voids the proof"):
            lc.certificate("so3", **LOOP, **option)
    with pytest.raises(InputError, match="not positive definite"):
        lc.certificate("so3", inertia=1, error="so3_right", gains={"K_p": 1, "K_d": [1, 1, -1]})
    with pytest.raises(InputError, match="between 0 and L = 9"):
        found(level=9.0)
    with pytest.raises(InputError, match="L is infinite"):
        lc.certificate("h3", inertia=1, error="frobenius", gains={"k_p": 1, "K_d": 1})
    integral = lc.integral_law("so3", inertia=1, error="so3_right", gains={"K_p": 1, "K_d": 1, "K_i": 1})
    with pytest.raises(InputError, match="integral_law"):
        lc.certificate("so3", law=integral)
    law = lc.tracking_law("so3", **LOOP, feedforward="levi_civita")
    assert lc.certificate("so3", law=law, level=4.5, prove=False).b_1 == found(level=4.5).b_1
    for other in ({"inertia": 2 * INERTIA}, {"gains": GAINS}, {"error": "so3_left"}, {"feedforward": "basic"}):
        with pytest.raises(InputError, match="beside law"):
            lc.certificate("so3", law=law, **other)


def simulated(cert: Any, starts: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, W over time and whether the start was inside, for random starts about a turning reference."""
    law = lc.tracking_law("so3", **LOOP, feedforward=cert.feedforward)
    reference = lc.reference("so3", ["0.3*sin(t)", "0.2*cos(t)", "0.1*t"])
    so3, rng = lc.group("so3"), np.random.default_rng(seed)
    X_d, xi_d, _ = lc.build(reference_kernel(reference)).reference(0.0)
    x, xi = rng.normal(size=(2, starts, 3))
    X = np.array([X_d @ expm(so3.hat(0.8 * each)) for each in x])
    xi = xi_d + 0.7 * xi
    inside = np.array([cert.inside(a, b, X_d, xi_d) is True for a, b in zip(X, xi, strict=True)])
    t = np.linspace(0, 8, 33)
    run = lc.closed_loop("so3", inertia=INERTIA, law=law, reference=reference, X0=X, xi0=xi, t=t, step=0.02)
    return t, run.outputs["W"], inside


@pytest.mark.parametrize("starts", [300, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_simulated_loop_leaves_its_certificate(starts: int) -> None:
    for options in ({"overshoot": 2.6}, {}):
        cert = found(level=4.5, speed=0.6, **options)
        t, W, inside = simulated(cert, starts, seed=starts)
        assert 0.2 < inside.mean() < 0.98
        bound = cert.k * W[0] * np.exp(-cert.rate * t)[:, None]
        assert np.all((bound * (1 + 1e-9) + 1e-12 >= W)[:, inside])


def test_invariances_are_computed() -> None:
    gains = {"K_1": [1, 2, 3], "K_2": [[4, 1, 0], [1, 5, 0.5], [0, 0.5, 6]], "K_d": 1}
    rows = {row: as_error(lc.group("se3"), f"se3_{row}", gains) for row in range(1, 7)}
    which = {row: lc.invariance(pair) for row, pair in rows.items()}
    assert [row for row, each in which.items() if each.left] == [2, 3, 4]
    assert [row for row, each in which.items() if each.right] == [5]
    assert [row for row, each in which.items() if each.symmetric] == [1, 4, 5, 6]


@pytest.mark.parametrize("moment", [1.0, 2.5])
def test_equal_moments_have_closed_forms_within_the_proof(moment: float) -> None:
    """I = c 1: b_1 = c/(lambda_min(A) - level), b_2 = c/lambda_max(A), t = 1/(2 sqrt c), A = tr(K) 1 - K."""
    cert = lc.certificate("so3", inertia=moment, error="so3_right", gains=GAINS, level=1.0)
    for proved, exact in (
        (cert.b_1_proved, moment / (9 - 1)),
        (1 / cert.b_2_proved, 11 / moment),
        (cert.transport_proved, 0.5 / np.sqrt(moment)),
    ):
        assert exact <= proved <= 1.02 * exact
    assert cert.theorem_rate_proved > 0
