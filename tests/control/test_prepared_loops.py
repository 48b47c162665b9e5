"""Loops that are prepared once: calls alike give the same, whatever the caller does with his arrays, and laws still refuse what is off the group."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.benchmarks.loop_cases import START, rate_of, states_of
from lie_codegen.control import loop_prepared
from lie_codegen.control.guarded_law import GuardedBody, evaluated_within, own_body
from lie_codegen.flow.near_identity import NearIdentity
from lie_codegen.flow.product_rate import reach_of
from lie_codegen.flow.product_step import Move
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex

TURN = states_of(START, np.zeros(3))[:9].reshape(3, 3)
TIMES = np.linspace(0, 2, 11)


def law(**named: Any) -> Any:
    return lc.attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=6, **named)


def run(control: Any, **named: Any) -> Any:
    given: dict[str, Any] = {"X0": TURN, "xi0": [1.0, 0.5, -0.2], "t": TIMES, "rtol": 1e-9}
    return lc.closed_loop("so3", law=control, **{**given, **named})


def test_a_call_alike_is_prepared_once_and_gives_the_same() -> None:
    control = law()
    first = run(control)
    before = loop_prepared._kept.cache_info().hits
    again = run(control)
    assert loop_prepared._kept.cache_info().hits == before + 1
    assert again == first
    np.testing.assert_array_equal(again.outputs["V"], first.outputs["V"])
    np.testing.assert_array_equal(again.u, first.u)
    other = run(control, X0=np.eye(3))
    assert np.max(np.abs(other.X[0] - np.eye(3))) == 0


def test_what_the_caller_does_with_his_arrays_changes_no_later_call() -> None:
    control, inertia, limits, t = law(), np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 2.0]), TIMES.copy()
    first = run(control, inertia=inertia, limits=limits, t=t)
    wanted = first.X.copy()
    first.t[-1], first.X[:] = 77.0, 0.0
    inertia[0], limits[:], t[:] = 2.0, 0.5, 2 * TIMES
    changed = run(control, inertia=inertia, limits=limits, t=t)
    assert np.max(np.abs(changed.u)) <= 0.5
    assert changed.t[-1] == 2 * TIMES[-1]
    again = run(control, inertia=np.array([1.0, 2.0, 3.0]), limits=np.array([2.0, 2.0, 2.0]))
    np.testing.assert_array_equal(again.X, wanted)
    np.testing.assert_array_equal(again.t, TIMES)


@pytest.mark.parametrize("loops", [1, 300])
def test_what_the_caller_does_with_what_he_gave_or_got_changes_nothing_that_is_computed_later(loops: int) -> None:
    X0, xi0 = np.repeat(TURN[None], loops, axis=0), np.full((loops, 3), 0.3)
    bodies = np.repeat(np.diag([1.0, 2.0, 3.0])[None], loops, axis=0)
    given: dict[str, Any] = {"X0": X0, "xi0": xi0, "inertia": bodies, "gains": {"k_p": 4.0, "k_d": 6.0}}
    if loops == 1:
        given |= {"X0": X0[0], "xi0": xi0[0], "inertia": bodies[0]}
    control = lc.attitude_law("pd", tunable=True)
    told, asked = run(control, **given), run(control, **given)
    wanted = told.u.copy(), told.outputs["torque"].copy(), told.origin, told.error.copy()
    for mine in (X0, xi0, bodies, asked.X, asked.xi, asked.t):
        mine[:] = 7.0
    np.testing.assert_array_equal(asked.u, wanted[0])
    np.testing.assert_array_equal(asked.outputs["torque"], wanted[1])
    assert asked.origin.start.tolist() == wanted[2].start.tolist()
    assert asked.origin.numbers["inertia"].tolist() == wanted[2].numbers["inertia"].tolist()


def test_what_was_warned_of_is_warned_of_again() -> None:
    control = lc.attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=6)
    heard = []
    for _ in range(2):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            run(control, inertia=[1.0, 1.0, 3.0])  # of no rigid body
        heard.append([str(each.message) for each in caught])
    assert heard[0] == heard[1]


def test_a_function_is_read_anew() -> None:
    push = [0.0]

    def force(ops: Any, t: Any, X: Any, xi: Any) -> list[Any]:
        return [push[0], 0, 0]

    control = law()
    calm = run(control, disturbance=force)
    push[0] = 1.0
    assert np.max(np.abs(run(control, disturbance=force).xi - calm.xi)) > 1e-2


@pytest.mark.parametrize("made", ["attitude", "tracking"])
def test_a_law_refuses_what_is_off_the_group_and_a_loop_need_not_ask(made: str) -> None:
    """Also where the law comes from its record in the cache, and whoever derives with it makes it."""
    make = (
        law
        if made == "attitude"
        else lambda: lc.tracking_law("so3", error="so3_right", inertia=[1, 2, 3], gains={"K_p": 4, "K_d": 5})
    )
    make()
    control, ops, mirror = make(), FloatArithmetic(), np.diag([1.0, 1.0, -1.0]).tolist()
    assert isinstance(own_body(control), GuardedBody)
    rest = [np.ones(port.shape).tolist() for port in control.inputs[1:]]
    rest = [
        TURN.tolist() if port.name == "X_d" else value for port, value in zip(control.inputs[1:], rest, strict=True)
    ]
    refused, told = control.evaluate(ops, mirror, *rest)[0], evaluated_within(control, ops, mirror, *rest)[0]
    assert all(math.isnan(x) for x in refused)
    assert all(math.isfinite(x) for x in told)
    inside = control.evaluate(ops, TURN.tolist(), *rest)[0]
    np.testing.assert_array_equal(evaluated_within(control, ops, TURN.tolist(), *rest)[0], inside)


@pytest.mark.parametrize("name", ["so3", "su2", "se2", "se3", "sl2", "h3", "so22"])
def test_series_alone_are_the_exponential_within_the_reach_of_a_step(name: str) -> None:
    group, rng = lc.group(name), np.random.default_rng(0)
    move = Move(group)
    reach = reach_of(group, closed=derivation_of(group).closed_exponential)
    one = np.eye(group.degree, dtype=group.basis.dtype)
    for _ in range(5):
        theta = rng.normal(size=group.dim)
        theta *= min(reach, 1.0) / np.linalg.norm(theta)
        found = move(NearIdentity(FloatArithmetic()), one.tolist(), theta.tolist())
        values = np.array([[complex(Complex.of(x).re, Complex.of(x).im) for x in row] for row in found])
        np.testing.assert_allclose(values, expm(group.hat(theta)), rtol=0, atol=2e-15)


def test_the_error_of_many_loops_is_not_understated() -> None:
    """Numbers of their own, some of them stiff; scipy's DOP853 on quaternions knows nothing of groups."""
    rng, N = np.random.default_rng(4), 300
    J, k_p, k_d = rng.uniform(1, 3, (N, 3)), rng.uniform(2, 6, N), rng.uniform(4, 6, N)
    xi0, t = 0.5 * rng.uniform(-1, 1, (N, 3)), np.linspace(0, 10, 6)
    found = lc.closed_loop(
        "so3", law=lc.attitude_law("pd", tunable=True), inertia=J[:, :, None] * np.eye(3), gains={"k_p": k_p, "k_d": k_d},
        X0=TURN, xi0=xi0, t=t, rtol=1e-7,
    )  # fmt: skip
    rate, worst = rate_of(math.sqrt, math.atan2), 0.0
    for i in [*range(0, N, 10), int(np.argmax(k_d / J.min(axis=1)))]:
        body = [*J[i], k_p[i], k_d[i]]
        y = solve_ivp(
            lambda s, y, body=body: rate(*y, *body),
            (0, 10),
            [*START, *xi0[i]],
            method="DOP853",
            t_eval=t,
            rtol=1e-11,
            atol=1e-12,
        ).y.T
        wanted = states_of(y[:, :4], y[:, 4:])
        mine = np.concatenate([found.X[:, i].reshape(6, 9), found.xi[:, i]], axis=1)
        worst = max(worst, float(np.max(np.abs(mine - wanted))))
    assert worst <= found.error_estimate <= 1e-7
