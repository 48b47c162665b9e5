"""Plans as references, against the path that scipy's DOP853 finds from the plan's controls alone."""

from __future__ import annotations

import itertools
import pickle
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.kernel.plain_data import made_from

SO3 = lc.group("so3")
TARGET = expm(SO3.hat(np.array([0.3, 0.2, 0.8])))
INERTIA = np.array([1.0, 2, 3])


def path(group: Any, plan: Any, times: np.ndarray, cuts: np.ndarray) -> Any:
    """X(t) by scipy, from jump to jump."""
    marks = np.unique(np.concatenate([[0.0], cuts, [plan.duration]]))
    X, found = (
        np.eye(group.degree, dtype=complex if group.is_complex else float),
        np.empty((len(times), group.degree, group.degree), dtype=complex),
    )
    for a, b in itertools.pairwise(marks):
        eps = 1e-12 * plan.duration

        def rate(t: float, y: np.ndarray, a: float = a, b: float = b, eps: float = eps) -> np.ndarray:
            u = plan.u(min(max(t, a + eps), b - eps))
            return np.asarray(y.reshape(group.degree, -1) @ group.hat(u)).ravel()

        inside = (times >= a) & (times <= b)
        y = solve_ivp(rate, (a, b), X.ravel(), method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True).sol
        if inside.any():
            found[inside] = y(times[inside]).T.reshape(-1, group.degree, group.degree)
        X = y(b).reshape(group.degree, -1)
    return found


def values(reference: Any, times: np.ndarray) -> Any:
    from lie_codegen.control.reference_kernels import reference_kernel

    return lc.build(reference_kernel(reference)).reference.batch(times)


def away(reference: Any, times: np.ndarray) -> np.ndarray:
    inside = np.zeros(len(times), dtype=bool)
    for a, b in reference.smoothed:
        inside |= (times >= a - 1e-4) & (times <= b + 1e-4)
    return ~inside


@pytest.mark.parametrize(("name", "method"), [("so3", "optimal"), ("so3", "loops"), ("su2", "optimal")])
def test_smooth_plans_are_met_in_configuration_velocity_and_acceleration(name: str, method: str) -> None:
    group = lc.group(name)
    target = expm(group.hat(np.array([0.3, 0.2, 0.8])))
    plan = lc.steer(group, target, list(group.labels[:2]), 10, method=method)
    reference = lc.reference(name, plan)
    times = np.linspace(0.05, 9.95, 67)
    X, xi, rate = values(reference, times)
    keep = away(reference, times)
    assert np.sum(keep) > 30
    assert np.max(np.abs(X - path(group, plan, times, plan.u.breakpoints))[keep]) < 5e-8
    assert np.max(np.abs(xi - plan.u(times))[keep]) < 1e-6
    slope = (plan.u(times + 1e-4) - plan.u(times - 1e-4)) / 2e-4
    assert np.max(np.abs(rate - slope)[keep]) < 2e-5
    assert reference.error <= 1e-8


@dataclass(frozen=True)
class Bang:
    """A plan by nobody: an axis after the other, without a word on where it jumps."""

    duration: float = 4.0

    def u(self, t: Any) -> np.ndarray:
        s = np.asarray(t, dtype=float)
        return np.stack([np.where(s < 1.3, 0.5, -0.2), np.where(s < 1.3, 0.0, 0.4 * np.sin(s)), 0 * s], axis=-1)

    def X(self, t: Any) -> Any:
        return path(SO3, self, np.asarray(t), np.array([1.3])).real


def test_a_jump_is_rounded_off_with_its_error_stated_and_nothing_stays_behind() -> None:
    plan = Bang()
    reference = lc.reference("so3", plan, smoothing=0.05)
    assert np.all(np.abs(reference.smoothed - [[1.25, 1.35]]) < 0.02)
    times = np.linspace(0, 4, 801)
    X, xi, rate = values(reference, times)
    keep, off = away(reference, times), np.abs(X - path(SO3, plan, times, np.array([1.3]))).max(axis=(1, 2))
    assert np.max(off[keep]) < 2e-8
    assert 1e-4 < np.max(off[~keep]) <= 1.05 * reference.smoothing_error
    # one and the same motion: X' = X hat(xi), xi' = the acceleration, through the jump as well
    h = 1e-5
    (Y, eta, _), (Z, zeta, _) = values(reference, times[1:-1] + h), values(reference, times[1:-1] - h)
    hats = np.array([SO3.hat(x) for x in xi[1:-1]])
    assert np.max(np.abs((Y - Z) / (2 * h) - X[1:-1] @ hats)) < 1e-6
    assert np.max(np.abs((eta - zeta) / (2 * h) - rate[1:-1])) < 1e-2  # of 7, at kinks of the acceleration
    assert lc.reference("so3", plan, smoothing=0.01).smoothing_error < reference.smoothing_error / 3


@pytest.mark.parametrize("method", ["optimal", "bang"])
def test_a_law_flies_the_plan(method: str) -> None:
    plan = Bang() if method == "bang" else lc.steer("so3", TARGET, list(SO3.labels[:2]), 10, method=method)
    reference = lc.reference("so3", plan)
    law = lc.tracking_law("so3", inertia=INERTIA, error="so3_right", gains={"K_p": [3, 2, 1], "K_d": 4})
    t = np.linspace(0, plan.duration, 41)
    start = np.asarray(plan.u(0.0))
    run = lc.closed_loop("so3", inertia=INERTIA, law=law, reference=reference, xi0=start, t=t, tolerance=1e-8)
    keep = away(reference, t)
    assert np.max(np.abs(run.X - path(SO3, plan, t, reference.smoothed.mean(axis=1)))[keep]) < 1e-6
    tilted = lc.closed_loop(
        "so3", inertia=INERTIA, law=law, reference=reference, X0=expm(SO3.hat([0.2, 0, 0.1])), t=t, tolerance=1e-8
    )
    assert tilted.outputs["W"][-1] < tilted.outputs["W"][0] / 10


@pytest.mark.parametrize("count", [2, 3, 4, 6, 9, 14])
def test_a_jump_that_long_steps_meet_first_is_passed(count: int) -> None:
    """The stages of a step across the ramp run away; the step that follows was a 1e58th of it, and none was short enough."""
    plan = Bang()
    reference = lc.reference("so3", plan)
    law = lc.tracking_law("so3", inertia=[1, 2, 2], error="so3_right", gains={"K_p": [4, 5, 6], "K_d": 4})
    t, start = np.linspace(0, plan.duration, count), np.asarray(plan.u(0.0))
    run = lc.closed_loop("so3", law=law, reference=reference, xi0=start, t=t, tolerance=1e-8)
    path_there, velocity, _ = values(reference, t)
    assert np.max(np.abs(run.X - path_there)) < 1e-7
    assert np.max(np.abs(run.xi - velocity)) < 1e-6


def test_it_is_a_value() -> None:
    plan = lc.steer("so3", TARGET, list(SO3.labels[:2]), 10, method="optimal")
    reference = lc.reference("so3", plan)
    copy = pickle.loads(pickle.dumps(reference))
    assert copy == reference
    assert hash(copy) == hash(reference)
    assert vars(copy)["definition"] == vars(reference)["definition"]
    assert reference != lc.reference("so3", plan, tolerance=1e-6)
    assert len(repr(reference).splitlines()) <= 10
    other = lc.reference("so3", times=[0, 1], waypoints=[np.eye(3), TARGET])
    assert other == pickle.loads(pickle.dumps(other))


def test_what_cannot_be_flown_is_refused() -> None:
    plan = Bang()
    with pytest.raises(lc.errors.InputError, match=r"not of se2"):
        lc.reference("se2", lc.steer("so3", TARGET, list(SO3.labels[:2]), 10, method="optimal"))
    with pytest.raises(lc.errors.InputError, match="smoothing = 0"):
        lc.reference("so3", plan, smoothing=0)
    with pytest.raises(lc.errors.InputError, match="goes with a plan"):
        lc.reference("so3", ["t", "t", "t"], smoothing=1.0)
    with pytest.raises(lc.errors.InputError, match="start"):
        lc.reference("so3", plan, start=np.eye(3))  # type: ignore[call-overload]
    law = lc.tracking_law("so3", inertia=INERTIA, error="so3_right", gains={"K_p": [3, 2, 1], "K_d": 4})
    with pytest.raises(lc.errors.InputError, match=r"known on \[0, 4\], not up to t = 5"):
        lc.closed_loop("so3", inertia=INERTIA, law=law, reference=lc.reference("so3", plan), t=np.linspace(0, 5, 11))


def test_a_plan_brings_its_group() -> None:
    plan = lc.steer("so3", TARGET, controls=[0, 1], duration=1.0)
    alone, after = lc.reference(plan, smoothing=0.05), lc.reference("so3", plan, smoothing=0.05)
    assert alone == after
    made = made_from(alone.definition)
    assert made == alone
    with pytest.raises(lc.errors.InputError, match="comes alone, or after its group"):
        lc.reference(plan, plan)


def test_its_definition_makes_it_again() -> None:
    """A loop that is known by its definition is given texts: "1/10" for a time, "1/100000000" for the tolerance."""
    plan = lc.steer("so3", (0.1, 0.05, 0.08), ("w1", "w2"), 24.0, method="four_phase")
    turns = [np.eye(3)] * 3
    for made in (
        lc.reference("so3", plan, smoothing=0.1),
        lc.reference("so3", plan=plan, duration=30.5, tolerance=1e-7),
        lc.reference("so3", times=[0, 0.5, 1.1], waypoints=turns),
        lc.reference("so3", times=[0, 0.5, 1.1, 1.5, 2], samples=[np.eye(3)] * 5),
    ):
        assert made_from(made.definition) == made


SYSTEMS = {
    "a drift of time": {"method": "direct", "drift": ("0", "0", "0.3*cos(2*t)")},
    "a right-invariant system": {"method": "direct", "equation": "right", "drift": (0, 0, 0.3), "bounds": 4},
    "a start": {"start": expm(SO3.hat(np.array([0.2, 0.1, 0.0])))},
}


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_body_velocity_of_a_plan_is_that_of_its_path(system: str) -> None:
    """xi(t) against differences of X(t); a reference of the plan was made from u alone, and refused."""
    plan = lc.steer("so3", TARGET, ("w1", "w2"), 2.0, **SYSTEMS[system])
    rng = np.random.default_rng(4)
    marks = np.asarray(plan.u.breakpoints, dtype=float)
    t = rng.uniform(0.01, 1.99, 40)
    t = t[np.abs(t[:, None] - np.append(marks, 9.0)).min(axis=1) > 1e-4]
    step = 1e-5
    slope = (plan.X(t + step) - plan.X(t - step)) / (2 * step)
    moved = np.array([SO3.vee(np.linalg.solve(X, dX)) for X, dX in zip(plan.X(t), slope, strict=True)])
    np.testing.assert_allclose(plan.xi(t), moved, atol=1e-7)
    assert plan.xi(0.7).shape == (3,)
    reference = lc.reference("so3", plan, smoothing=0.01)
    assert reference.error < 1e-8
    assert reference.smoothing_error < 1e-4
