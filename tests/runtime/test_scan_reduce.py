"""Loops of which nothing is stored: sums, extremes and last values of what a step tells, against loops in NumPy."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError


def body(ops: Any, x: Any, a: Any, w: Any) -> Any:
    y = [x[0] + 0.01 * x[1], x[1] - 0.01 * a * ops.sin(x[0]) + w]
    return y, y[0] * y[0] + y[1] * y[1], [ops.sqrt(y[0] * y[0] + 1), -y[1]]


def pendulum() -> lc.Kernel:
    inputs = (lc.Port("x", (2,)), lc.Port("a", ()), lc.Port("w", ()))
    outputs = (lc.Port("x_next", (2,)), lc.Port("cost", ()), lc.Port("most", (2,)))
    return lc.Kernel("pendulum", "toy", inputs, outputs, body)


def by_numpy(x: Any, a: Any, w: Any) -> tuple[Any, Any, Any]:
    """The last states, and of all steps the costs and the other output."""
    costs, others = [], []
    for k in range(w.shape[1]):
        x = np.stack([x[:, 0] + 0.01 * x[:, 1], x[:, 1] - 0.01 * a * np.sin(x[:, 0]) + w[:, k]], 1)
        costs.append(x[:, 0] ** 2 + x[:, 1] ** 2)
        others.append(np.stack([np.sqrt(x[:, 0] ** 2 + 1), -x[:, 1]], 1))
    return x, np.array(costs), np.array(others)


def samples(count: int, steps: int) -> tuple[Any, Any, Any]:
    rng = np.random.default_rng(0)
    return rng.normal(size=(count, 2)), rng.uniform(0.5, 2, count), 1e-3 * rng.normal(size=(count, steps))


@pytest.fixture(scope="module")
def step() -> Any:
    return lc.build(pendulum()).pendulum


@pytest.mark.parametrize("count", [1, 7, 8, 53])
def test_every_reduction(step: Any, count: int) -> None:
    x, a, w = samples(count, 60)
    last, costs, others = by_numpy(x, a, w)
    wanted = {
        "sum": (costs.sum(0), others.sum(0)),
        "max": (costs.max(0), others.max(0)),
        "min": (costs.min(0), others.min(0)),
        "last": (costs[-1], others[-1]),
    }
    for way, (cost, most) in wanted.items():
        found = step.scan_batch(x, a, w, n=60, reduce={"cost": way, "most": way})
        assert found._fields == ("x_next", "cost", "most")
        for one, other in zip(found, (last, cost, most), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-14)
    some = step.scan_batch(x, a, w, n=60, reduce={"most": "max"}, real="float")
    assert some._fields == ("x_next", "most")
    np.testing.assert_allclose(some.most, others.max(0), rtol=1e-5, atol=1e-5)


def test_the_last_states_alone_of_any_step() -> None:
    step = lc.build(lc.rkmk4_step("so3")).rkmk4_step
    u = np.random.default_rng(1).normal(size=(11, 3))
    common = {"u0": u, "um": u, "u1": u, "h": 0.01}
    stored = step.scan_batch(np.eye(3), **common, n=50)
    np.testing.assert_array_equal(step.scan_batch(np.eye(3), **common, n=50, reduce={}).X_next, stored[:, -1])


def test_no_steps_threads_and_long_loops_in_pieces(step: Any) -> None:
    x, a, w = samples(2_100, 3)
    none = step.scan_batch(x, a, w[:, :0], n=0, reduce={"cost": "sum", "most": "max"})
    np.testing.assert_array_equal(none.x_next, x)
    assert not none.cost.any()
    assert np.isneginf(none.most).all()
    one = step.scan_batch(x, a, 0.0, n=600, reduce={"cost": "sum"})
    for threads in (1, 2):
        again = step.scan_batch(x, a, 0.0, n=600, reduce={"cost": "sum"}, threads=threads)
        np.testing.assert_array_equal(again.cost, one.cost)
    few = step.scan_batch(
        x[:3], a[:3], 0.0, n=600_000, reduce={"cost": "sum"}
    )  # in more than one call of compiled code
    assert np.isfinite(few.cost).all()
    stored = step.scan_batch(x[:3], a[:3], 0.0, n=600_000)
    np.testing.assert_array_equal(few.x_next, stored[:, -1])
    np.testing.assert_allclose(few.cost, (stored[:, 1:] ** 2).sum((1, 2)), rtol=1e-10)


def test_a_nan_stays(step: Any) -> None:
    x, a, w = samples(20, 30)
    w[5, 10] = np.nan
    for way in ("sum", "max", "min"):
        found = step.scan_batch(x, a, w, n=30, reduce={"cost": way})
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.cost)), [5])


def test_what_is_refused(step: Any) -> None:
    x, a, w = samples(2, 4)
    with pytest.raises(InputError, match=r"outputs behind the state \(cost, most\), given 'x_next'"):
        step.scan_batch(x, a, w, n=4, reduce={"x_next": "sum"})
    with pytest.raises(InputError, match="cost is reduced by sum, max, min, last; given 'mean'"):
        step.scan_batch(x, a, w, n=4, reduce={"cost": "mean"})
    with pytest.raises(InputError, match="leave every= and out= out"):
        step.scan_batch(x, a, w, n=4, every=2, reduce={"cost": "sum"})
    single = lc.build(lc.rkmk4_step("so3")).rkmk4_step
    with pytest.raises(InputError, match="it has none"):
        single.scan_batch(np.eye(3)[None], np.zeros(3), np.zeros(3), np.zeros(3), 0.1, n=1, reduce={"cost": "sum"})


def test_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CC", "none")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # said once a process
        step = lc.build(pendulum()).pendulum
    x, a, w = samples(3, 20)
    last, costs, others = by_numpy(x, a, w)
    for real, tolerance in (("double", 1e-13), ("float", 1e-5)):
        found = step.scan_batch(x, a, w, n=20, reduce={"cost": "sum", "most": "min"}, real=real)
        for one, other in zip(found, (last, costs.sum(0), others.min(0)), strict=True):
            np.testing.assert_allclose(one, other, rtol=tolerance, atol=tolerance)
