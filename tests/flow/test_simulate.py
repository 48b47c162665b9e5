"""lc.simulate against matrix exponentials, against scipy's solve_ivp, and at the end of the chart."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import ChartError, InputError, NotFiniteError, NotOnGroupError, ShapeError

NAMES = ("so3", "se2", "se3", "su2", "sl2", "h3")


@pytest.mark.parametrize("name", NAMES)
def test_a_constant_input_is_one_exponential(name: str) -> None:
    group = lc.group(name)
    u = np.random.default_rng(1).normal(size=group.dim)
    run = lc.simulate(group, u, eps=0.5, t=[0.0, 0.7, 2.0])
    for t, X in zip(run.t, run.X, strict=True):
        np.testing.assert_allclose(X, expm(0.5 * t * group.hat(u)), rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", NAMES)
def test_a_varying_input_agrees_with_a_general_solver(name: str) -> None:
    group = lc.group(name)
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, group.dim))
    X0 = expm(group.hat(rng.normal(size=group.dim)))

    def u(t: float) -> np.ndarray:
        return a * np.cos(3 * t) + b * np.sin(t) ** 2

    d = group.degree
    kind = X0.dtype
    exact = solve_ivp(
        lambda t, x: (x.reshape(d, d) @ group.hat(u(t))).ravel(),
        (0, 2),
        X0.ravel().astype(kind),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    run = lc.simulate(group, u, t=[0.0, 2.0], X0=X0)
    np.testing.assert_allclose(run.X[-1].ravel(), exact.y[:, -1], rtol=0, atol=3e-10)


@pytest.mark.parametrize("name", NAMES)
def test_coordinates_of_the_second_kind_follow_the_trajectory(name: str) -> None:
    group = lc.group(name)
    u = 0.3 * np.random.default_rng(3).normal(size=group.dim)
    run = lc.simulate(group, u, t=np.linspace(0, 1, 11))
    for g, X in zip(run.g, run.X, strict=True):
        product = np.eye(group.degree)
        for coordinate, matrix in zip(g, group.basis, strict=True):
            product = product @ expm(coordinate * matrix)
        np.testing.assert_allclose(product, X, rtol=0, atol=1e-12)


def test_the_trajectory_stays_on_the_group_over_many_steps() -> None:
    so3 = lc.group("so3")
    run = lc.simulate(
        so3, lambda t: np.array([np.cos(t), np.sin(2 * t), 0.3]), t=[0.0, 500.0], tolerance=1e-9, method="rkmk4"
    )
    assert run.steps > 8_000
    assert np.max(np.abs(run.X[-1].T @ run.X[-1] - np.eye(3))) < 1e-11


def test_the_end_of_the_chart_is_an_error_that_names_the_time_not_a_nan() -> None:
    so3 = lc.group("so3")
    run = lc.simulate(so3, [0.0, 1.0, 0.0], t=np.linspace(0, 4, 81))
    assert np.all(np.isfinite(run.X))
    with pytest.raises(ChartError, match=r"between t = 1\.\d+ and t = 1\.\d+"):
        _ = run.g


def test_breakpoints_are_stepped_on_exactly() -> None:
    h3 = lc.group("h3")

    class Bang:
        breakpoints = (0.3, 0.7)

        def __call__(self, t: float) -> np.ndarray:
            return np.array([1.0, 0, 0]) if t < 0.3 else np.array([0, 2.0, 0]) if t < 0.7 else np.array([0, 0, 3.0])

    run = lc.simulate(h3, Bang(), t=[0.0, 1.0])
    x, y, z = h3.basis
    np.testing.assert_allclose(run.X[-1], expm(0.3 * x) @ expm(0.8 * y) @ expm(0.9 * z), rtol=0, atol=1e-11)
    assert run.steps < 5000


@pytest.mark.parametrize("name", ["so3", "su2", "sl2", "se3", "se2"])
def test_restarted_charts_cover_a_long_trajectory(name: str) -> None:
    group = lc.group(name)
    rng = np.random.default_rng(7)
    a = np.array([0.0, 1.0, -1.0]) if name == "sl2" else 0.3 + 1.2 * (np.arange(group.dim) == 1)
    b = 0.2 * rng.normal(size=group.dim)
    run = lc.simulate(group, lambda t: a + b * np.sin(1.3 * t), t=np.linspace(0, 10, 101))
    charts = run.charts
    assert charts[0].start == 0.0
    assert charts[-1].end == 10.0
    assert charts[-1].reason == "end"
    assert len(charts) > 1 or name == "se2"
    seen = 0
    for chart, after in zip(charts, [*charts[1:], None], strict=True):
        assert after is None or after.start == chart.end
        for t, g in zip(chart.t, chart.g, strict=True):
            product = chart.origin
            for coordinate, matrix in zip(g, group.basis, strict=True):
                product = product @ expm(coordinate * matrix)
            X = run.X[np.argmin(np.abs(run.t - t))]
            np.testing.assert_allclose(product, X, rtol=0, atol=1e-9 * max(1, np.abs(X).max()))
            seen += 1
    assert seen >= len(run.t)


@pytest.mark.parametrize("name", ["so4", "su3"])
def test_restarts_at_several_walls_against_expm(name: str) -> None:
    """A constant velocity: X(t) = exp(t hat(u)), whatever charts it crosses."""
    group = lc.group(name)
    u = np.random.default_rng(4).normal(size=group.dim)
    u *= 1.5 / np.linalg.norm(u)
    run = lc.simulate(group, list(u), t=np.linspace(0, 6, 25))
    assert len(run.charts) > 2
    assert {chart.reason for chart in run.charts[:-1]} <= {"wall", "growth"}
    for chart in run.charts:
        np.testing.assert_allclose(chart.origin, expm(chart.start * group.hat(u)), rtol=0, atol=1e-9)
        for t, g in zip(chart.t, chart.g, strict=True):
            product = chart.origin
            for coordinate, matrix in zip(g, group.basis, strict=True):
                product = product @ expm(coordinate * matrix)
            np.testing.assert_allclose(product, expm(t * group.hat(u)), rtol=0, atol=1e-9)
    assert sum(len(chart.t) for chart in run.charts) >= len(run.t)


def test_a_global_chart_is_never_restarted() -> None:
    h3 = lc.group("h3")
    run = lc.simulate(h3, lambda t: np.array([np.cos(t), np.sin(t), 0.1]), t=np.linspace(0, 20, 21))
    assert [chart.reason for chart in run.charts] == ["end"]
    np.testing.assert_allclose(run.charts[0].g, run.g, rtol=0, atol=1e-12)


def test_finite_escape_is_an_error_too() -> None:
    sl2 = lc.group("sl2")
    run = lc.simulate(sl2, [0.0, 1.0, -1.0], t=np.linspace(0, 2, 41))
    with pytest.raises(ChartError, match=r"t = 1\.5.*never vanishes.*escape"):
        _ = run.g
    t = 1.5
    g = lc.simulate(sl2, [0.0, 1.0, -1.0], t=[0.0, t]).g[-1]
    np.testing.assert_allclose(g, [-np.log(np.cos(t)), np.sin(t) * np.cos(t), -np.tan(t)], rtol=1e-11)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"t": [0.0]}, ShapeError),
        ({"t": [0.0, 0.0]}, InputError),
        ({"t": [0.0, np.nan]}, NotFiniteError),
        ({"u": [1.0, 2.0]}, ShapeError),
        ({"u": [1.0, 2.0, np.inf]}, NotFiniteError),
        ({"u": lambda t: np.full((*np.shape(t), 3), np.nan)}, NotFiniteError),
        ({"u": lambda t: np.zeros(2)}, ShapeError),
        ({"X0": np.eye(2)}, ShapeError),
        ({"X0": np.full((3, 3), np.nan)}, NotFiniteError),
        ({"eps": np.nan}, NotFiniteError),
        ({"tolerance": 0.0}, InputError),
    ],
)
def test_bad_input_is_named(change: dict[str, object], error: type[Exception]) -> None:
    arguments: dict[str, object] = {"u": [1.0, 0.0, 0.0], "t": [0.0, 1.0], **change}
    with pytest.raises(error):
        lc.simulate(lc.group("so3"), arguments.pop("u"), **arguments)


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "su3", "sl3", "h3", "so31", "sp4", "osc4", "aff1"])
def test_a_start_off_the_group_is_refused_and_one_on_it_is_not(name: str) -> None:
    group, rng = lc.group(name), np.random.default_rng(5)
    X = np.eye(group.degree)
    for _ in range(3):
        X = X @ expm(group.hat(0.4 * rng.normal(size=group.dim)))
    zero = np.zeros(group.dim)
    np.testing.assert_array_equal(lc.simulate(group, zero, t=[0, 1], X0=X).X[0], X)
    for off in (2 * X, X + 1e-3 * rng.normal(size=X.shape), np.zeros_like(X)):
        with pytest.raises(NotOnGroupError, match="X0 is not on"):
            lc.simulate(group, zero, t=[0, 1], X0=off)


def test_another_component_of_the_orthogonal_group_is_refused() -> None:
    with pytest.raises(NotOnGroupError, match="det X"):
        lc.simulate(lc.group("so3"), np.zeros(3), t=[0, 1], X0=np.diag([1, 1, -1.0]))


def test_texts_where_numbers_belong_are_named() -> None:
    so3 = lc.group("so3")
    for u, named, words in (
        (["cos(s)", "0", "0"], {"t": [0, 1]}, "no name 's'"),
        (lambda t: "x", {"t": [0, 1]}, "real numbers"),
        (np.zeros(3), {"t": "x"}, "array of numbers"),
        (np.zeros(3), {"t": [0, 1], "eps": "x"}, "eps is 'x'"),
        (np.zeros(3), {"t": [0, 1], "X0": "x"}, "array of numbers"),
        (np.zeros(3), {"t": [0, 1], "steps": 4, "atol": 1e-6}, "steps or atol, not both"),
    ):
        with pytest.raises(InputError, match=words):
            lc.simulate(so3, u, **named)
    for call in (
        lambda: lc.simulate(3, np.zeros(3), t=[0, 1]),
        lambda: lc.average(3, lc.PeriodicInput(["cos(t)"], period="2*pi")),
        lambda: lc.steer(3, np.zeros(3), controls=("w1", "w2"), duration=1),
        lambda: lc.wei_norman(3),
        lambda: lc.controllability(3, ("w1",)),
        lambda: lc.structure(3),
        lambda: lc.tracking_law(3, inertia=1, error="so3_right"),
    ):
        with pytest.raises(InputError, match=r"expected (a|the name of a) group"):
            call()


def test_steps_of_a_function_are_as_many_as_were_asked_for() -> None:
    """The pieces by which a function is read do not cut the steps: their error falls with the order, not with the pieces."""
    group = lc.group("se3")
    a, b, c = np.random.default_rng(3).normal(size=(3, group.dim)) / np.sqrt(group.dim)

    def u(t: float) -> np.ndarray:
        return a * np.cos(t) + b * np.exp(-((t - 2) ** 2)) + c * t / 4

    wanted = solve_ivp(
        lambda t, x: (x.reshape(4, 4) @ group.hat(u(t))).ravel(), (0, 4), np.eye(4).ravel(), method="DOP853", rtol=2.3e-14, atol=1e-14
    ).y[:, -1].reshape(4, 4)  # fmt: skip
    for order, counts in ((4, (40, 80)), (6, (40, 80)), (8, (16, 28))):
        runs = [lc.simulate(group, u, t=[0, 2, 4], method=f"magnus{order}", steps=count) for count in counts]
        coarse, fine = (np.max(np.abs(run.X[-1] - wanted)) for run in runs)
        assert [run.steps for run in runs] == list(counts)
        assert np.log(coarse / fine) / np.log(counts[1] / counts[0]) == pytest.approx(order, abs=0.5)
        np.testing.assert_array_equal(runs[1].at(2.0), runs[1].X[1])
        np.testing.assert_allclose(
            runs[1].at(2.5), lc.simulate(group, u, t=[0, 2.5]).X[-1], rtol=0, atol=3 * fine + 1e-9
        )


def test_texts_of_any_rates_are_evaluated_by_the_loop() -> None:
    """Nothing is read, so nothing is missed; and the same as the function."""
    texts = ["cos(t)*sin(sqrt(2)*t)", "3*cos(123456789012345*t/10^15)/10", "1/3"]

    def u(t: float) -> np.ndarray:
        return np.array([np.cos(t) * np.sin(np.sqrt(2) * t), 0.3 * np.cos(0.123456789012345 * t), 1 / 3])

    run, read = lc.simulate("so3", texts, t=[0, 1, 5]), lc.simulate("so3", u, t=[0, 1, 5])
    assert run.resolution == run.evaluations == 0 < read.resolution
    np.testing.assert_allclose(run.X, read.X, rtol=0, atol=1e-11)
    same = lc.simulate("so3", lc.ParametricInput(texts, ()), t=[0, 1, 5])
    np.testing.assert_array_equal(run.X, same.X)


@pytest.mark.parametrize("off", [-1e-13, -1e-15, 0, 3e-16, 5e-14])
def test_output_times_beside_a_jump(off: float) -> None:
    """A jump that lies a few roundings from an output time still lies between two steps: three turns with constant velocities."""

    class Jumps:
        breakpoints = np.array([0.3, 1.1])

        def __call__(self, t: Any) -> Any:
            s = np.asarray(t)[..., None]
            return np.where(s < 0.3, [1.0, 0, 0], np.where(s < 1.1, [0, 2.0, 0], [0, 0, -1.5]))

    t = np.array([0, 0.3 + off, 1.1 - off, 2])
    hat = lc.group("so3").hat
    wanted = expm(hat([0.3, 0, 0])) @ expm(hat([0, 1.6, 0])) @ expm(hat([0, 0, -1.35]))
    for method in ("auto", "rkmk4"):
        run = lc.simulate("so3", Jumps(), t=t, method=method, tolerance=1e-9)
        np.testing.assert_allclose(run.X[-1], wanted, atol=1e-12)


def test_a_run_is_nobodys_memory() -> None:
    t, X0 = np.linspace(0.0, 1.0, 3), np.eye(3)
    run = lc.simulate("so3", [1.0, 0.0, 0.0], t=t, X0=X0)
    alone = lc.simulate("so3", [1.0, 0.0, 0.0], t=t)
    wanted = run.X.copy(), run.at(0.7)
    t[:], X0[:] = 7.0, 7.0
    alone.X[:] = 7.0  # nor is the identity that all begin with
    np.testing.assert_array_equal(run.t, [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(run.X, wanted[0])
    np.testing.assert_array_equal(run.at(0.7), wanted[1])
    np.testing.assert_array_equal(lc.simulate("so3", [1.0, 0.0, 0.0], t=run.t).X, wanted[0])
