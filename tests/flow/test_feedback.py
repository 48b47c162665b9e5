"""lc.simulate under feedback u(t, X) and u(t, g): texts, Kernels and Python functions against scipy; and the average of u(t, g)."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import ChartError, ExpressionError, InputError, ShapeError, SlowWarning

T = np.linspace(0, 5, 11)


def by_scipy(group: Any, u: Any, t: np.ndarray, X0: np.ndarray | None = None) -> np.ndarray:
    d = group.degree
    start = np.eye(d) if X0 is None else X0
    kind = complex if group.is_complex else float

    def rate(s: float, y: np.ndarray) -> np.ndarray:
        X = y.view(kind).reshape(d, d)
        return np.ascontiguousarray(X @ np.einsum("i,ijk->jk", u(s, X), group.basis)).ravel().view(float)

    flat = np.ascontiguousarray(start.astype(kind)).ravel().view(float)
    y = solve_ivp(rate, (t[0], t[-1]), flat, t_eval=t, rtol=1e-12, atol=1e-13, method="DOP853").y.T
    return np.ascontiguousarray(y).view(kind).reshape(-1, d, d)


CASES: dict[str, Any] = {
    "so3": (
        ["-X[2][1] + X[1][2] + cos(t)", "X31 - X13", "sin(2*t)"],
        lambda t, X: np.array([-X[2, 1] + X[1, 2] + np.cos(t), X[2, 0] - X[0, 2], np.sin(2 * t)]),
    ),
    "se2": (
        ["sin(t) - X[1][0]", "1 - X[0][2]/2", "-X[1][2]"],
        lambda t, X: np.array([np.sin(t) - X[1, 0], 1 - X[0, 2] / 2, -X[1, 2]]),
    ),
    "h3": (["cos(t) - X13", "X12/3", "-X13"], lambda t, X: np.array([np.cos(t) - X[0, 2], X[0, 1] / 3, -X[0, 2]])),
    "sl2": (["-X12/4", "1 - X11", "cos(t)/5"], lambda t, X: np.array([-X[0, 1] / 4, 1 - X[0, 0], np.cos(t) / 5])),
}


@pytest.mark.parametrize("name", CASES)
def test_texts_of_t_and_X_against_scipy(name: str) -> None:
    texts, u = CASES[name]
    group = lc.group(name)
    run = lc.simulate(name, texts, t=T)
    want = by_scipy(group, u, T)
    scale = np.max(np.abs(want))
    np.testing.assert_allclose(run.X, want, atol=2e-10 * scale)
    assert np.max(np.abs(run.X - want)) < max(20 * run.error_estimate, 1e-11 * scale)
    np.testing.assert_allclose(run.u, [u(t, X) for t, X in zip(T, want, strict=True)], atol=1e-9 * scale)
    np.testing.assert_allclose(run.at([1.3, 2.7]), by_scipy(group, u, np.array([0, 1.3, 2.7]))[1:], atol=2e-10 * scale)
    assert run.method == "pair853"


def test_a_python_function_is_called_and_says_that_it_is_slow() -> None:
    texts, u = CASES["so3"]
    with pytest.warns(SlowWarning, match="Python function"):
        slow = lc.simulate("so3", u, t=T, rtol=1e-9)
    np.testing.assert_allclose(slow.X, lc.simulate("so3", texts, t=T).X, atol=1e-8)
    assert slow.evaluations > 0
    with pytest.warns(SlowWarning):
        chart = lc.simulate("so3", lambda t, g: [np.cos(t) - g[0], -g[1], g[0] / 2], t=T, rtol=1e-9)
    np.testing.assert_allclose(chart.g, lc.simulate("so3", ["cos(t) - g1", "-g2", "g1/2"], t=T).g, atol=1e-8)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lc.simulate("so3", lambda t, scale=2: np.array([np.cos(scale * t), 0, 0]), t=T)  # of time alone


def test_a_kernel_and_a_complex_group() -> None:
    group = lc.group("su2")

    def body(ops: Any, t: Any, X: Any) -> Any:
        return ([X[0][1].im - t / 4, ops.cos(t), X[0][0].re],)

    law = lc.Kernel(
        "law", "su2", (lc.Port("t", ()), lc.Port("X", (2, 2), is_complex=True)), (lc.Port("u", (3,)),), body
    )
    run = lc.simulate(group, law, t=T)
    want = by_scipy(group, lambda t, X: np.array([X[0, 1].imag - t / 4, np.cos(t), X[0, 0].real]), T)
    np.testing.assert_allclose(run.X, want, atol=1e-9)
    with pytest.raises(InputError, match="for real groups"):
        lc.simulate(group, ["X[0][0]", "0", "0"], t=T)


def chart_rate(g: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(15) of TR 93-59."""
    (s2, c2), (s3, c3) = ((np.sin(x), np.cos(x)) for x in g[1:])
    M = np.array([[c3 / c2, -s3 / c2, 0], [s3, c3, 0], [-c3 * s2 / c2, s3 * s2 / c2, 1]])
    return M @ u


def test_feedback_of_the_coordinates() -> None:
    texts = ["-g1 + cos(t)", "-g2 + g3/3", "-g3 + g1/2"]
    start = np.array([0.4, -0.3, 0.5])
    X0 = Rotation.from_euler("XYZ", start).as_matrix()
    run = lc.simulate("so3", texts, t=T, eps=0.5, X0=X0)

    def rate(t: float, g: np.ndarray) -> np.ndarray:
        return 0.5 * chart_rate(g, np.array([-g[0] + np.cos(t), -g[1] + g[2] / 3, -g[2] + g[0] / 2]))

    want = solve_ivp(rate, (0, 5), start, t_eval=T, rtol=1e-12, atol=1e-13).y.T
    np.testing.assert_allclose(run.g, want, atol=1e-10)
    np.testing.assert_allclose(run.X, Rotation.from_euler("XYZ", want).as_matrix(), atol=1e-10)
    np.testing.assert_allclose(run.at(2.2), Rotation.from_euler("XYZ", solve_ivp(
        rate, (0, 2.2), start, rtol=1e-12, atol=1e-13).y[:, -1]).as_matrix(), atol=1e-10)  # fmt: skip
    with pytest.raises(ChartError, match="chart"):
        lc.simulate("sl2", ["0*g1", "1", "-1"], t=[0, 2])  # a turn: its coordinates escape at pi/2


def test_many_trajectories_and_values() -> None:
    texts, u = CASES["so3"]
    eps = np.linspace(0.1, 1, 20)
    many = lc.simulate("so3", texts, t=T, eps=eps, threads=2)
    assert many.X.shape == (11, 20, 3, 3)
    want = by_scipy(lc.group("so3"), lambda t, X: eps[7] * u(t, X), T)
    np.testing.assert_allclose(many.X[:, 7], want, atol=1e-9)
    again = pickle.loads(pickle.dumps(many))
    assert again == many


def test_runs_and_averages_are_saved(tmp_path: Path) -> None:
    run = lc.simulate("so3", CASES["so3"][0], t=T)
    assert lc.load(run.save(tmp_path / "run.npz")) == run
    average = lc.feedback_average("so3", ["-k*g1*sin(t)^2", "-g2", "-g3"], parameters=["k"])
    assert lc.load(average.save(tmp_path / "average.npz")) == average
    assert pickle.loads(pickle.dumps(average)) == average


@pytest.mark.parametrize(
    ("u", "options", "error", "message"),
    [
        (["X[0][3]", "0", "0"], {}, ExpressionError, "X"),
        (["X[0][0]", "0"], {}, ShapeError, "2 formulas"),
        (["X[0][0]", "g1", "0"], {}, InputError, "not both"),
        (["X[0][0]", "h", "0"], {}, ExpressionError, "h"),
        (["X[0][0]", "0", "0"], {"method": "magnus8"}, InputError, "method goes with inputs of time"),
        (["X[0][0]", "0", "0"], {"steps": 5}, InputError, "steps goes with"),
    ],
)
def test_wrong_feedback_is_named(u: Any, options: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        lc.simulate("so3", u, t=T, **options)


def test_the_average_of_a_feedback_is_of_first_order() -> None:
    """Proposition 1: against scipy at one eps, and the slope over four; the example that is exact in slow time stays O(eps)."""
    average = lc.feedback_average(
        "so3", ["-2*g1*sin(t)^2", "-7/5*g2*sin(t)^2 + cos(t)", "-13/5*k*g3*sin(t)^2"], parameters=["k"]
    )
    start = [0.4, -0.3, 0.5]
    check = average.order_check(start, k=1)
    assert check.passed
    assert check.order == 1
    assert abs(check.slopes[-1] - 1) < 0.1
    eps, T_end = 0.1, 25.0

    def true(t: float, g: np.ndarray) -> np.ndarray:
        wave = np.sin(t) ** 2
        return eps * chart_rate(g, np.array([-2 * g[0] * wave, -1.4 * g[1] * wave + np.cos(t), -2.6 * g[2] * wave]))

    def mean(_: float, g: np.ndarray) -> np.ndarray:
        return eps * chart_rate(g, np.array([-g[0], -0.7 * g[1], -1.3 * g[2]]))

    times = np.linspace(0, T_end, 4001)
    paths = [solve_ivp(f, (0, T_end), start, t_eval=times, rtol=1e-10, atol=1e-12).y for f in (true, mean)]
    assert abs(check.errors[check.eps.index(0.1)] - np.max(np.abs(paths[0] - paths[1]))) < 2e-3
    assert "first" in check.statement or "order 1" in check.statement
    stability = average.linearise([0, 0, 0], k=1)
    assert stability.exponentially_stable
    with pytest.raises(InputError, match="k have no values"):
        average.order_check(start)
    with pytest.raises(InputError, match="eps"):
        average.order_check(start, eps=[0.1], k=1)
