"""method="symmetric_product": published costs and errors, true ends by scipy, refusals in words, primitives."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InputError, SteeringInputError, UncontrollableError

ROTATION = expm(lc.group("so3").hat((0.3, -0.2, 0.6)))
PARKED = np.array([[np.cos(0.3), -np.sin(0.3), 0.2], [np.sin(0.3), np.cos(0.3), 0.8], [0, 0, 1]])
BODY = {"method": "symmetric_product", "inertia": (3, 2, 1)}
CART = {"method": "symmetric_product", "inertia": (1, 2, 2)}


def flown(plan, J, D=0.0):
    """X and xi at the end; <ad*_xi p, y> = <p, [xi, y]> written out on matrices."""
    group, J = plan.group, np.diag(J) if np.ndim(J) == 1 else np.asarray(J)
    d, n = group.degree, group.dim

    def rate(t, y):
        X, xi = y[: d * d].reshape(d, d), y[d * d :]
        hat = group.hat(xi)
        turned = np.array([group.vee(hat @ A - A @ hat) for A in group.basis]) @ (J @ xi)
        return np.concatenate([(X @ hat).ravel(), np.linalg.solve(J, turned - D * xi + plan.u(float(t)))])

    y = np.concatenate([np.eye(d).ravel(), np.zeros(n)])
    for a, b in pairwise([0.0, *plan.u.breakpoints, plan.duration]):
        y = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return y[: d * d].reshape(d, d), y[d * d :]


@pytest.mark.parametrize(
    ("cycles", "first", "cost"), [(2, 0.38, 6.84), (4, 0.029, 26.8), (8, 0.0041, 105), (16, 0.00065, 417)]
)
def test_errors_before_retuning_and_costs_on_so3(cycles, first, cost):
    plan = lc.steer("so3", ROTATION, ("w1", "w2"), 10.0, cycles=cycles, **BODY)
    assert plan.details["first_error"] == pytest.approx(first, rel=0.03)
    assert plan.cost == pytest.approx(cost, rel=0.02)
    assert plan.details["cycles"] == cycles
    assert plan.error < 1e-9


def test_torques_reach_the_target_and_rest_by_another_integrator():
    for group, target, controls, given in (
        ("so3", ROTATION, ("w1", "w2"), BODY),
        ("se2", PARKED, ("omega", "vx"), CART),
    ):
        plan = lc.steer(group, target, controls, 10.0, cycles=2.5, **given)
        X, xi = flown(plan, given["inertia"])
        np.testing.assert_allclose(X, target, atol=2e-9)
        np.testing.assert_allclose(xi, 0, atol=2e-9)
        idle = [i for i, label in enumerate(plan.group.labels) if label not in controls]
        assert not plan.u(np.linspace(0, 10, 50))[:, idle].any()
        np.testing.assert_allclose(plan.u([0.0, 10.0]), 0, atol=1e-12)


def test_continuation_in_cycles_goes_down_while_the_cost_falls():
    plan = lc.steer("so3", ROTATION, ("w1", "w2"), 10.0, **BODY)
    assert plan.details["cycles"] == 1.5
    assert plan.cost == pytest.approx(4.20, rel=0.02)
    cart = lc.steer("se2", PARKED, ("omega", "vx"), 10.0, **CART)
    assert (cart.details["cycles"], cart.cost) == (1.0, pytest.approx(0.929, rel=0.02))


def test_three_of_six_forces():
    group = lc.group("se3")
    target = expm(group.hat((0.3, -0.2, 0.4, 0.5, 0.2, -0.3)))
    J = np.diag((3, 2, 1, 5, 6, 7)) + 0.2 * np.eye(6)[::-1]
    free = lc.steer(
        group, target, ("w1", "w2", "v3"), 10.0, method="symmetric_product", inertia=(3, 2, 1, 5, 6, 7), cycles=3
    )
    assert free.details["multiples"] == [1, 3, 5]
    X, xi = flown(free, np.diag((3, 2, 1, 5, 6, 7)))
    np.testing.assert_allclose(X, target, atol=1e-8)
    np.testing.assert_allclose(xi, 0, atol=1e-8)
    # an inertia that couples everything makes each force push off its line; combinations of the same three are taken
    coupled = lc.steer(group, target, ("w1", "w2", "v3"), 10.0, method="symmetric_product", inertia=J, cycles=3)
    np.testing.assert_allclose(flown(coupled, J)[0], target, atol=1e-8)
    np.testing.assert_allclose(coupled.inputs(3.0), coupled.u(3.0)[[0, 1, 5]], atol=1e-12)


def test_drag_is_retuned_too():
    plan = lc.steer("so3", ROTATION, ("w1", "w2"), 10.0, cycles=2, damping=0.3, **BODY)
    X, xi = flown(plan, (3, 2, 1), 0.3)
    np.testing.assert_allclose(X, ROTATION, atol=1e-8)
    np.testing.assert_allclose(xi, 0, atol=1e-8)


def test_thrusters_that_are_no_basis_elements():
    """Each of two jets alone pushes the craft off its line; their sum and difference do not, and are taken."""
    jets = [[0.5, 1, 0], [-0.5, 1, 0]]
    plan = lc.steer("se2", PARKED, None, 10.0, forces=jets, cycles=2, **CART)
    X, xi = flown(plan, (1, 2, 2))
    np.testing.assert_allclose(X, PARKED, atol=1e-8)
    np.testing.assert_allclose(xi, 0, atol=1e-8)
    times = np.linspace(0, 10, 30)
    np.testing.assert_allclose(plan.inputs(times) @ np.array(jets), plan.u(times), atol=1e-12)
    assert plan.inputs(1.0).shape == (2,)


def test_primitives_and_their_costs():
    plan = lc.steer("so3", ROTATION, ("w1", "w2"), 10.0, form="primitives", **BODY)
    assert plan.details["word"] == ("w2", "w1", "w2")
    assert plan.cost == pytest.approx(4.46, abs=5e-3)
    assert plan.cost == pytest.approx(plan.details["predicted_cost"], rel=1e-9)
    # the best durations of single-axis inertias: 12 (sum (J |angle|)^(1/2))^4 / T^3, angle = amount / J along Y = e / J
    angles = [a / {"w1": 3, "w2": 2}[w] for w, a in zip(plan.details["word"], plan.details["amounts"], strict=True)]
    R2, R1 = (lambda a: expm(a * lc.group("so3").basis[1])), (lambda a: expm(a * lc.group("so3").basis[0]))
    np.testing.assert_allclose(R2(angles[0]) @ R1(angles[1]) @ R2(angles[2]), ROTATION, atol=1e-10)
    sizes = np.sqrt([2 * abs(angles[0]), 3 * abs(angles[1]), 2 * abs(angles[2])])
    assert plan.cost == pytest.approx(12 * sum(sizes) ** 4 / 10**3, rel=1e-9)
    X, xi = flown(plan, (3, 2, 1))
    np.testing.assert_allclose(X, ROTATION, atol=1e-9)
    np.testing.assert_allclose(xi, 0, atol=1e-9)
    cart = lc.steer("se2", PARKED, ("omega", "vx"), 10.0, form="primitives", **CART)
    assert (cart.details["word"], cart.cost) == (("omega", "vx", "omega"), pytest.approx(1.70, abs=5e-3))


def test_equal_moments_say_what_nothing_turns_and_offer_primitives():
    with pytest.raises(UncontrollableError) as caught:
        lc.steer("so3", ROTATION, ("w1", "w2"), 10.0, method="symmetric_product", inertia=(2, 2, 1))
    message = str(caught.value)
    assert "<w1:w2> = 0" in message
    assert "nothing turns w3" in message
    assert "form='primitives'" in message
    plan = lc.steer(
        "so3", ROTATION, ("w1", "w2"), 10.0, method="symmetric_product", inertia=(2, 2, 1), form="primitives"
    )
    assert plan.error < 1e-9


@pytest.mark.parametrize(
    ("group", "target", "controls", "given", "error", "words"),
    [
        ("se2", PARKED, ("vx",), {"inertia": [[1, 0.2, 0.3], [0.2, 2, 0], [0.3, 0, 2]]}, UncontrollableError, ["<vx:vx>", "is bad"]),
        ("so3", ROTATION, ("w1",), {"inertia": (3, 2, 1)}, UncontrollableError, ["nothing turns w2 or w3", "not necessary"]),
        ("so3", ROTATION, ("w1", "w2"), {}, InputError, ["inertia="]),
        ("so3", ROTATION, ("w1", "w2"), {"inertia": (3, -2, 1)}, InputError, ["not positive definite"]),
        ("so3", ROTATION, ("w1", "w2"), {"inertia": 1, "drift": (0, 0, 1)}, SteeringInputError, ["cannot be held"]),
        ("so3", ROTATION, ("w1", "w2"), {"inertia": (3, 2, 1), "cycles": 0}, SteeringInputError, ["cycles"]),
        ("so3", ROTATION, ("w1", "w2"), {"inertia": (3, 2, 1), "form": "both"}, SteeringInputError, ["primitives"]),
        ("so3", ROTATION, ("w1", "w2"), {"inertia": (3, 2, 1), "bounds": 1}, SteeringInputError, ["no option bounds"]),
        ("so3", ROTATION, ("w1", "w2"), {"inertia": (3, 2, 1), "damping": 0.1, "form": "primitives"}, SteeringInputError, ["damping"]),
        ("so3", np.diag((-1.0, -1, 1)), ("w1", "w2"), {"inertia": (3, 2, 1)}, None, []),
    ],
)  # fmt: skip
def test_refusals(group, target, controls, given, error, words):
    if error is None:
        # a half turn has a logarithm, of which there are two: one is taken
        assert lc.steer(group, target, controls, 10.0, method="symmetric_product", **given).error < 1e-8
        return
    with pytest.raises(error) as caught:
        lc.steer(group, target, controls, 10.0, method="symmetric_product", **given)
    assert all(word in str(caught.value) for word in words)


def test_a_target_without_logarithm_is_to_be_cut_in_two():
    with pytest.raises(SteeringInputError, match="cut the manoeuvre in two"):
        lc.steer(
            "sl2",
            np.diag((-2.0, -0.5)),
            ("h", "e"),
            10.0,
            method="symmetric_product",
            inertia=[[3, 0, 0], [0, 2, 0.5], [0, 0.5, 1]],
        )


def test_the_plan_says_what_it_costs_beside_the_transcription():
    plan = lc.steer("so3", ROTATION, ("w1", "w2"), 10.0, cycles=2, compare=True, **BODY)
    assert plan.details["transcription_cost"] == pytest.approx(1.371, abs=2e-3)
    assert "transcription" in plan.details["advice"]


def test_another_start_and_pickles():
    import pickle

    start = expm(lc.group("so3").hat((0.5, 0, 0)))
    plan = lc.steer("so3", start @ ROTATION, ("w1", "w2"), 10.0, start=start, cycles=2, **BODY)
    assert plan.error < 1e-8
    direct = lc.steer("so3", ROTATION, ("w1", "w2"), 10.0, cycles=2, **BODY)
    times = np.linspace(0, 10, 20)
    np.testing.assert_allclose(plan.u(times), direct.u(times), atol=1e-7)
    again = pickle.loads(pickle.dumps(direct))
    np.testing.assert_array_equal(again.u(times), direct.u(times))
    assert again == direct


def test_many_targets_without_a_failure_and_fast():
    import time

    rng, group, seconds = np.random.default_rng(0), lc.group("so3"), []
    for _ in range(10):
        x = rng.normal(size=3)
        target = expm(group.hat(x * rng.uniform(0.2, 2.46) / np.linalg.norm(x)))
        started = time.perf_counter()
        plan = lc.steer(group, target, ("w1", "w2"), 10.0, cycles=3, **BODY)
        seconds.append(time.perf_counter() - started)
        assert plan.error < 1e-8
        assert plan.details["iterations"] <= 6
    assert np.median(seconds) < 1.0  # 0.05 on an idle machine
