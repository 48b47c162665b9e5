"""Sampled laws: hold, delay, noise, limits and disturbances, against loops written out with scipy and plain integers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.runtime.philox import philox

J = np.array([[1.5, 0.1, 0], [0.1, 1.25, 0.2], [0, 0.2, 1.75]])
K_P, K_D = 2.0, 3.0
START = Rotation.from_rotvec([0.5, -0.4, 0.9]).as_matrix()
OMEGA = np.array([0.3, 0.1, -0.2])
T = np.linspace(0, 1, 6)


def law() -> Any:
    return lc.attitude_law("pd", inertia=J, k_p=K_P, k_d=K_D)


def hat(w: Any) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def moved(X: np.ndarray, w: np.ndarray, torque: np.ndarray, h: float, push: Any = None, t0: float = 0.0) -> Any:
    """A body under a constant torque for h seconds, by scipy."""

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        R, v = y[:9].reshape(3, 3), y[9:]
        total = torque if push is None else torque + push(t0 + t, R, v)
        return np.concatenate([(R @ hat(v)).ravel(), np.linalg.solve(J, np.cross(J @ v, v) + total)])

    end = solve_ivp(rate, (0, h), np.concatenate([X.ravel(), w]), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end[:9].reshape(3, 3), end[9:]


def philox_by_integers(counter: list[int], key: int) -> list[int]:
    """Philox4x32-10 as it is printed, on Python's integers."""
    low, high, (a, b, c, d) = key & 0xFFFFFFFF, key >> 32, counter
    for _ in range(10):
        p, q = 0xD2511F53 * a, 0xCD9E8D57 * c
        a, b, c, d = (q >> 32) ^ b ^ low, q & 0xFFFFFFFF, (p >> 32) ^ d ^ high, p & 0xFFFFFFFF
        low, high = (low + 0x9E3779B9) & 0xFFFFFFFF, (high + 0xBB67AE85) & 0xFFFFFFFF
    return [a, b, c, d]


def normals(seed: int, loop: int, sample: int, kind: int, size: int) -> np.ndarray:
    """Box and Muller on the four numbers of each block."""
    found: list[float] = []
    for block in range(-(-size // 4)):
        words = philox_by_integers([sample, loop, 0, 256 * kind + block], seed)
        u = [(word + 0.5) / 2**32 for word in words]
        for first, second in ((u[0], u[1]), (u[2], u[3])):
            length = math.sqrt(-2 * math.log(first))
            found += [length * math.cos(2 * math.pi * second), length * math.sin(2 * math.pi * second)]
    return np.array(found[:size])


def by_hand(
    h: float,
    *,
    delay: int = 0,
    limit: float = np.inf,
    noise: Any = None,
    seed: int = 0,
    loop: int = 0,
    push: Any = None,
) -> tuple[Any, Any, Any]:
    sigma = {"X": 0.0, "xi": 0.0, "u": 0.0, **(noise or {})}
    X, w, way = START, OMEGA, [np.zeros(3)] * delay
    states, commands = [], []
    for j in range(round(1 / h) + 1):
        drawn = [s * normals(seed, loop, j, kind, 3) for kind, s in enumerate(sigma.values())]
        measured = X @ Rotation.from_rotvec(drawn[0]).as_matrix()
        felt = w + drawn[1]
        torque = np.cross(felt, J @ felt) - K_P * Rotation.from_matrix(measured).as_rotvec() - K_D * felt
        way.append(np.clip(torque, -limit, limit) + drawn[2])
        acting = way.pop(0)
        states.append((X, w))
        commands.append(acting)
        X, w = moved(X, w, acting, h, push, j * h)
    every = round(0.2 / h)
    return (
        np.array([X for X, _ in states])[::every],
        np.array([w for _, w in states])[::every],
        np.array(commands)[::every],
    )


@pytest.mark.parametrize(
    ("options", "hand"),
    [
        ({"sample": 0.05}, {}),
        ({"sample": 0.05, "delay": 3}, {"delay": 3}),
        ({"sample": 0.05, "delay": 0.1}, {"delay": 2}),
        ({"sample": 0.05, "limits": 0.4}, {"limit": 0.4}),
        ({"sample": 0.05, "noise": {"xi": 0.1}, "seed": 7}, {"noise": {"xi": 0.1}, "seed": 7}),
        (
            {"sample": 0.1, "noise": {"X": 0.05, "xi": 0.1, "u": 0.2}, "limits": 0.8, "delay": 1, "seed": 2**40 + 5},
            {"noise": {"X": 0.05, "xi": 0.1, "u": 0.2}, "limit": 0.8, "delay": 1, "seed": 2**40 + 5},
        ),
    ],
    ids=lambda each: "",
)
def test_a_sampled_loop_is_the_one_written_out(options: dict[str, Any], hand: dict[str, Any]) -> None:
    run = lc.closed_loop("so3", inertia=J, law=law(), X0=START, xi0=OMEGA, t=T, rtol=1e-11, **options)
    X, xi, u = by_hand(options["sample"], **hand)
    np.testing.assert_allclose(run.X, X, atol=1e-9)
    np.testing.assert_allclose(run.xi, xi, atol=1e-9)
    assert run.u is not None
    np.testing.assert_allclose(run.u, u, atol=1e-8)
    assert run.error_estimate < 1e-11
    np.testing.assert_allclose(run.error, np.linalg.norm(Rotation.from_matrix(X).as_rotvec(), axis=1), atol=1e-8)


def test_loops_are_the_same_however_the_batch_is_cut() -> None:
    noise = {"X": 0.05, "xi": 0.1, "u": 0.2}
    options: dict[str, Any] = {
        "inertia": J, "law": law(), "X0": START, "xi0": OMEGA, "t": T, "sample": 0.05, "noise": noise, "seed": 3,
    }  # fmt: skip
    for step in (0.05, 0.025):
        whole = lc.closed_loop("so3", **options, step=step, runs=150)
        parts = [lc.closed_loop("so3", **options, step=step, runs=n, first=first) for first, n in ((0, 67), (67, 83))]
        np.testing.assert_array_equal(whole.X, np.concatenate([part.X for part in parts], axis=1))
        assert whole == lc.closed_loop("so3", **options, step=step, runs=150, threads=2)
        assert np.ptp(whole.error[-1]) > 0.01
    X, *_ = by_hand(0.05, noise=noise, seed=3, loop=149)
    np.testing.assert_allclose(whole.X[:, 149], X, atol=1e-7)
    alone = lc.closed_loop("so3", **options, step=0.025, first=149)
    np.testing.assert_allclose(alone.X, whole.X[:, 149], atol=1e-13)


def test_known_answers_of_philox() -> None:
    """The two of Random123's file of known answers that everybody quotes, and random counters on Python's integers."""
    zeros = philox(np.zeros(4, dtype=np.uint64), 0)
    assert [int(x) for x in zeros] == [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]
    ones = philox(np.full(4, 0xFFFFFFFF, dtype=np.uint64), 2**64 - 1)
    assert [int(x) for x in ones] == [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]
    rng = np.random.default_rng(0)
    for _ in range(20):
        counter, key = rng.integers(0, 2**32, 4, dtype=np.uint64), int(rng.integers(0, 2**63))
        assert [int(x) for x in philox(counter, key)] == philox_by_integers([int(x) for x in counter], key)


def test_the_noise_has_the_spread_that_was_asked_for() -> None:
    """The page's first-order loop: steady variance k h s^2/(2 - k h) of each component of the logarithm."""
    sampled = lc.closed_loop(
        "so3", law=lc.attitude_law("p", k_p=2), t=[0, 10], sample=0.05, step=0.05, noise={"X": 0.02}, runs=4000, seed=1
    )
    angles = Rotation.from_matrix(sampled.X[-1]).as_rotvec()
    np.testing.assert_allclose(np.std(angles, axis=0), 0.0045883, rtol=0.05)
    assert abs(np.mean(angles)) < 4 * 0.0045883 / np.sqrt(12000)


def test_a_delay_up_to_its_margin() -> None:
    """x' = -k x(t - d) along one axis: rate .6362631 at k = 2, d = .5."""
    t = np.linspace(0, 8, 81)
    start = Rotation.from_rotvec([0, 0, 0.8]).as_matrix()
    run = lc.closed_loop("so3", law=lc.attitude_law("p", k_p=2), X0=start, t=t, sample=0.001, step=0.001, delay=0.5)
    x = np.arctan2(run.X[:, 1, 0], run.X[:, 0, 0])
    spread = np.log(np.max(np.abs(x[(t > 1) & (t < 3)])) / np.max(np.abs(x[(t > 5.6) & (t < 7.6)]))) / 4.6
    assert abs(spread - 0.6362631) < 0.1


def test_disturbances_as_formulas_constants_and_kernels() -> None:
    options: dict[str, Any] = {"inertia": J, "law": law(), "X0": START, "xi0": OMEGA, "t": T, "rtol": 1e-11}
    texts = ["0.3*sin(2*t) + X[0][1]", "xi2/4 - X33", "1/5"]

    def push(t: float, R: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.array([0.3 * np.sin(2 * t) + R[0, 1], v[1] / 4 - R[2, 2], 0.2])

    run = lc.closed_loop("so3", **options, sample=0.1, disturbance=texts)
    np.testing.assert_allclose(run.X, by_hand(0.1, push=push)[0], atol=1e-9)
    np.testing.assert_allclose(run.xi, by_hand(0.1, push=push)[1], atol=1e-9)

    def body(ops: Any, t: Any, X: Any, xi: Any) -> Any:
        return ([0.3 * ops.sin(2 * t) + X[0][1], xi[1] / 4 - X[2][2], 0.2],)

    ports = (lc.Port("t", ()), lc.Port("X", (3, 3)), lc.Port("xi", (3,)))
    kernel = lc.Kernel("wind", "so3", ports, (lc.Port("f", (3,)),), body)
    for other in (kernel, lambda ops, t, X, xi: body(ops, t, X, xi)[0]):
        np.testing.assert_allclose(lc.closed_loop("so3", **options, sample=0.1, disturbance=other).X, run.X, atol=1e-12)
    smooth = [lc.closed_loop("so3", **options, disturbance=each) for each in (texts, kernel)]
    np.testing.assert_allclose(smooth[0].X, smooth[1].X, atol=1e-10)
    constants = np.array([[0.1, 0, 0], [0, 0.2, 0.3]])
    many = lc.closed_loop("so3", **options, disturbance=constants)
    for i, constant in enumerate(constants):
        alone = lc.closed_loop("so3", **options, disturbance=[float(x) for x in constant])
        np.testing.assert_allclose(many.X[:, i], alone.X, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sample": 0.3}, r"times t are 0\.2 s apart, which is no multiple of sample = 0\.3"),
        ({"sample": -1}, "sample is a positive number"),
        ({"sample": 0.1, "delay": 0.05}, r"delay = 0\.05 s is no multiple of sample"),
        ({"sample": 0.1, "delay": -1}, "delay is a number of samples"),
        ({"noise": {"X": 0.1}}, "noise on X needs sample="),
        ({"delay": 2}, "a delay needs sample="),
        ({"sample": 0.1, "noise": 0.1}, "noise is a mapping"),
        ({"sample": 0.1, "noise": {"Y": 0.1}}, "no noise on Y; it goes on X, xi, u, y, bias"),
        ({"sample": 0.1, "noise": {"y": 0.1}}, "noise on y, which neither"),
        ({"sample": 0.1, "noise": {"X": -0.1}}, r"noise\['X'\] is negative"),
        ({"sample": 0.1, "noise": {"X": "big"}}, r"noise\['X'\] is 'big'"),
        ({"limits": 0}, "limits must be positive"),
        ({"limits": [[1, 2]]}, r"limits has shape \(1, 2\)"),
        ({"disturbance": "sin(t)"}, "one formula a component"),
        ({"disturbance": ["sin(t)"]}, "the disturbance has 1 components, the command 3"),
        ({"disturbance": ["q", "0", "0"]}, "q"),
        ({"rtol": 1e-8, "step": 0.1}, "the step or the tolerance, not both"),
        ({"rtol": 1e-8, "tolerance": 1e-8}, "not both"),
        ({"rtol": -1}, "rtol must be positive"),
        ({"runs": 0}, "runs is a positive integer"),
        ({"seed": -1}, "seed is a whole number"),
        ({"states": {"z": 1}}, "no state z of the law"),
        ({"gains": [1]}, "gains is a mapping"),
        ({"reference": 3}, "reference is what lc.reference makes"),
        ({"substeps": 3}, "substeps without mpc="),
        ({"threads": 0}, "threads"),
        ({"law": None, "order": 2}, "order says what a law commands"),
    ],
    ids=lambda each: "",
)
def test_wrong_arguments_are_named_in_one_line(options: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"inertia": J, "law": law(), "t": T, "X0": START[None], **options}
    with pytest.raises((InputError, ShapeError), match=message) as caught:
        lc.closed_loop("so3", **given)
    assert "\n" not in str(caught.value)


def test_a_loop_needs_a_group_and_a_law_what_it_reads() -> None:
    with pytest.raises(InputError, match="no group"):
        lc.closed_loop(t=T)
    with pytest.raises(InputError, match="give inertia="):
        lc.closed_loop("so3", law=lc.attitude_law("pd", inertia="input", k_p=4, k_d=6), t=T)
    with pytest.raises(InputError, match="xi0 is given"):
        lc.closed_loop("so3", law=lc.attitude_law("p"), xi0=OMEGA, t=T)
    assert lc.closed_loop(law=lc.attitude_law("p"), X0=START, t=T) == lc.closed_loop(
        "SO(3)", law=lc.attitude_law("p"), X0=START, t=T
    )


def test_an_observer_between_the_sensors_and_the_law() -> None:
    """Two directions with noise, a gyro with noise and a bias; the filter's step itself is called alone here."""
    z = np.array([[0, 0, 1], [0.6, 0, 0.8]])
    observer = lc.observer("so3", directions=z, weights=[1, 0.5], k_p=1.2, k_i=0.3)
    tilt, bias = Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix(), np.array([0.05, -0.08, 0.03])
    noise = {"y": 0.02, "xi": 0.01, "bias": bias}
    run = lc.closed_loop(
        "so3", inertia=J, law=law(), X0=START, xi0=OMEGA, t=T, sample=0.05, rtol=1e-10, observer=observer, noise=noise,
        seed=5, states={"X_hat": tilt},
    )  # fmt: skip
    step = lc.build(observer.kernel)[observer.kernel.name]
    X, w, X_hat, b = START, OMEGA, tilt, np.zeros(3)
    for j in range(21):
        seen = z @ X + 0.02 * normals(5, 0, j, 3, 6).reshape(2, 3)
        seen /= np.linalg.norm(seen, axis=1, keepdims=True)
        gyro = w + 0.01 * normals(5, 0, j, 1, 3) + bias
        felt = gyro - b
        torque = np.cross(felt, J @ felt) - K_P * Rotation.from_matrix(X_hat).as_rotvec() - K_D * felt
        if j % 4 == 0:
            np.testing.assert_allclose(run.X[j // 4], X, atol=1e-8)
            np.testing.assert_allclose(run.states["X_hat"][j // 4], X_hat, atol=1e-8)
            np.testing.assert_allclose(run.states["bias"][j // 4], b, atol=1e-8)
        X_hat, b = step(X_hat, b, gyro, seen, 0.05)
        X, w = moved(X, w, torque, 0.05)


def test_batches_over_limits_and_noise() -> None:
    options: dict[str, Any] = {"inertia": J, "law": law(), "X0": START, "t": T, "sample": 0.1, "step": 0.05, "seed": 2}
    spread = np.array([0.0, 0.01, 0.02, 0.05, 0.1])
    many = lc.closed_loop("so3", **options, noise={"X": spread}, limits=np.arange(1.0, 6)[:, None])
    for i, sigma in enumerate(spread):
        alone = lc.closed_loop("so3", **options, noise={"X": sigma}, limits=i + 1.0, first=i)
        np.testing.assert_allclose(many.X[:, i], alone.X, atol=1e-12)
    with pytest.raises(ShapeError, match="different numbers of loops"):
        lc.closed_loop("so3", **options, noise={"X": spread}, limits=np.ones((4, 3)))
