"""Both runs of one member: over lanes and in turn, in memory that its system keeps, from several threads, compared where the first is best known."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import LieCodegenError
from lie_codegen.flow.pair_system import System

T = np.linspace(0, 10, 101)


def law(name: str) -> dict[str, Any]:
    """A loop on a group of quaternions, on one with entries beside, with a matrix of its own for an inertia, and on one by Theta."""
    if name == "so3":
        return {"group": "so3", "law": lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4.0, k_d=6.0), "inertia": (1, 2, 3)}
    if name == "so3_inputs":
        given = {"law": lc.attitude_law("pd", tunable=True), "inertia": np.diag([1.0, 2.0, 3.0])}
        return {"group": "so3", "gains": {"k_p": 4.0, "k_d": 6.0}, **given}
    n = lc.group(name).dim
    return {"group": name, "inertia": np.arange(1.0, n + 1), "disturbance": [0.1] * n}


def starts(name: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    rng, group = np.random.default_rng(len(name)), lc.group(name.partition("_")[0])
    return lc.build(group).exp.batch(x=0.5 * rng.normal(size=(count, group.dim))), 0.3 * rng.normal(
        size=(count, group.dim)
    )


@pytest.mark.parametrize("rtol", [1e-6, 1e-11])
@pytest.mark.parametrize("name", ["so3", "so3_inputs", "se3", "sl2"])
def test_over_lanes_and_in_turn_are_the_same_run(name: str, rtol: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps are the same to rounding, so all that follows is; without lanes the law is written anew, since a loop is remembered."""
    (X0, xi0), t = (each[0] for each in starts(name, 1)), T / 5
    there = lc.closed_loop(X0=X0, xi0=xi0, t=t, rtol=rtol, **law(name))
    monkeypatch.setattr(System, "both", 0)
    here = lc.closed_loop(X0=X0, xi0=xi0, t=t + 0.0, rtol=rtol * (1 + 1e-9), **law(name))
    assert here.steps == there.steps
    np.testing.assert_allclose(here.X, there.X, rtol=0, atol=2e-12 * np.max(np.abs(there.X)))
    np.testing.assert_allclose(here.xi, there.xi, rtol=0, atol=2e-12)
    assert here.error_estimate == pytest.approx(there.error_estimate, rel=0.05, abs=1e-13)


def test_a_result_is_nobody_elses_memory() -> None:
    (X0, Y0), (v0, w0) = starts("so3", 2)
    first = lc.closed_loop(X0=X0, xi0=v0, t=T, rtol=1e-8, **law("so3"))
    kept = first.X.copy(), first.xi.copy(), first.at(3.21)
    lc.closed_loop(X0=Y0, xi0=w0, t=T, rtol=1e-8, **law("so3"))
    first.X[...] += 0.0
    np.testing.assert_array_equal(first.X, kept[0])
    np.testing.assert_array_equal(first.xi, kept[1])
    for mine, before in zip(first.at(3.21), kept[2], strict=True):
        np.testing.assert_array_equal(mine, before)
    again = lc.closed_loop(X0=X0, xi0=v0, t=T, rtol=1e-8, **law("so3"))
    first.X[...] = first.xi[...] = first.t[...] = np.nan
    np.testing.assert_array_equal(again.X, kept[0])
    np.testing.assert_array_equal(again.t, T)


def test_threads_may_run_one_loop_at_once() -> None:
    X0, xi0 = starts("so3", 40)
    told = law("so3")

    def run(k: int) -> tuple[np.ndarray, np.ndarray, float]:
        made = lc.closed_loop(X0=X0[k % 40], xi0=xi0[k % 40], t=T, rtol=1e-10, **told)
        return made.X, made.xi, made.error_estimate

    alone = [run(k) for k in range(40)]
    with ThreadPoolExecutor(4) as pool:
        for k, found in enumerate(pool.map(run, range(200))):
            for mine, theirs in zip(found, alone[k % 40], strict=True):
                np.testing.assert_array_equal(mine, theirs)


def test_what_is_not_finite_stays_so_and_the_next_call_is_well() -> None:
    X0, xi0 = (each[0] for each in starts("so3", 1))
    before = lc.closed_loop(X0=X0, xi0=xi0, t=T, rtol=1e-8, **law("so3"))
    for wrong in (np.nan, np.inf, 1e200):
        with pytest.raises(LieCodegenError):
            lc.closed_loop(X0=X0, xi0=[wrong, 0.0, 0.0], t=T, rtol=1e-8, **law("so3"))
    after = lc.closed_loop(X0=X0, xi0=xi0, t=T, rtol=1e-8, **law("so3"))
    np.testing.assert_array_equal(after.X, before.X)


@pytest.mark.parametrize("times", [7, 400])
@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
def test_the_estimate_holds_wherever_the_runs_are_compared(times: int, rtol: float) -> None:
    """Few times are compared as they are, of many the ends of steps; the truth is a run at a tolerance a thousand times smaller."""
    t, told = np.linspace(0, 10, times), law("so3")
    for X0, xi0 in zip(*starts("so3", 5), strict=True):
        found = lc.closed_loop(X0=X0, xi0=3 * xi0, t=t, rtol=rtol, **told)
        exact = lc.closed_loop(X0=X0, xi0=3 * xi0, t=t, rtol=max(1e-3 * rtol, 2e-14), **told)
        off = max(np.max(np.abs(found.X - exact.X)), np.max(np.abs(found.xi - exact.xi)))
        assert off <= rtol
        assert off <= 2 * found.error_estimate + 1e-13
        assert found.error_estimate <= rtol * max(1.0, np.max(np.abs(found.xi)))
