"""lc.simulate by Magnus steps: orders, inputs of every kind, aliases and pulses, batches, threads, other times."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import ComputationError, ExpressionError, InputError, NotFiniteError
from lie_codegen.flow.magnus import numpy_steps
from lie_codegen.flow.magnus.norms import norms_of, size_of
from lie_codegen.flow.magnus.run import flow
from lie_codegen.flow.magnus.steps import plan_steps
from lie_codegen.runtime.formula_input import fourier_input

RATES = np.array([1.3, 2.1])


def waves(n: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.random.default_rng(seed).normal(size=(2, 2, n)) / np.sqrt(n))


def reference(group: lc.MatrixGroup, u, end: float, X0: np.ndarray | None = None) -> np.ndarray:
    """X(end) by scipy's DOP853, which knows nothing of groups."""
    d, kind = group.degree, complex if group.is_complex else float
    start = np.eye(d, dtype=kind) if X0 is None else X0
    run = solve_ivp(
        lambda t, x: (x.reshape(d, d) @ group.hat(u(t))).ravel(), (0, end), start.ravel(), method="DOP853", rtol=2.3e-14, atol=1e-14
    )  # fmt: skip
    return run.y[:, -1].reshape(d, d)


def slopes_are_the_orders(
    group: lc.MatrixGroup, u, wanted: np.ndarray, end: float, counts: dict[int, tuple[int, ...]]
) -> None:
    """Slopes of the error over ever shorter steps, as long as it is above rounding; where it never is, the steps are exact."""
    floor = 1e-13 * np.max(np.abs(wanted))
    for order, steps in counts.items():
        runs = [lc.simulate(group, u, t=[0, end], method=f"magnus{order}", steps=count) for count in steps]
        assert [run.steps for run in runs] == list(steps)
        errors = [np.max(np.abs(run.X[-1] - wanted)) for run in runs]
        above = [error for error in errors if error > floor]
        if len(above) > 1:
            slopes = np.diff(np.log(above)) / -np.diff(np.log(steps[: len(above)]))
            assert slopes[-1] == pytest.approx(order, abs=0.15), (order, errors)
        else:
            assert errors[-1] <= floor


SMOOTH = {4: (20, 40, 80), 6: (20, 40, 80), 8: (14, 20, 28)}
NAMES = ["so3", "se3", "su2", "su4", "sl2", "so7", "gl4"]


@pytest.mark.parametrize(
    "name", [*NAMES, *(pytest.param(n, marks=pytest.mark.slow) for n in lc.group_names() if n not in NAMES)]
)
def test_the_order_of_each_step_is_what_it_says(name: str) -> None:
    """so7 and gl4 take their brackets as products of matrices."""
    group = lc.group(name)
    cosines, sines = waves(group.dim)
    end = 4.0
    wanted = reference(group, lambda t: np.cos(RATES * t) @ cosines + np.sin(RATES * t) @ sines, end)
    slopes_are_the_orders(group, fourier_input(RATES, cosines, sines), wanted, end, SMOOTH)


@pytest.mark.parametrize("kind", ["function", "function with a corner", "samples", "texts"])
def test_the_order_is_the_same_whatever_u_is(kind: str) -> None:
    """The pieces in which a function is read are the steps' own: they cost no order."""
    se3, end = lc.group("se3"), 4.0
    a, b = np.random.default_rng(7).normal(size=(2, 6)) / 2
    knots = np.arange(5.0)
    values = np.random.default_rng(8).normal(size=(5, 6)) / 2

    def smooth(t: float) -> np.ndarray:
        return a * np.cos(1.3 * t) + b * np.exp(-(((t - 1.7) / 0.8) ** 2))

    def corner(t: float) -> np.ndarray:
        return smooth(t) + a * abs(t - 2)

    corner.breakpoints = [2.0]
    texts = ["cos(13*t/10)", "1/2", "sin(21*t/10)/2", "0", "exp(-t)*t", "1/3"]

    def by_texts(t: float) -> np.ndarray:
        return np.array([np.cos(1.3 * t), 0.5, np.sin(2.1 * t) / 2, 0, np.exp(-t) * t, 1 / 3])

    def between(t: float) -> np.ndarray:
        return np.array([np.interp(t, knots, column) for column in values.T])

    u, exact = {
        "function": (smooth, smooth),
        "function with a corner": (corner, corner),
        "samples": (lc.SampledInput(knots, values, between="linear"), between),
        "texts": (texts, by_texts),
    }[kind]
    # The reference stops where u has corners.
    wanted, before = np.eye(4), 0.0
    for stop in knots[1:]:
        wanted = wanted @ reference(se3, lambda t, t0=before: exact(t0 + t), float(stop) - before)
        before = float(stop)
    slopes_are_the_orders(se3, u, wanted, end, {4: (20, 40, 80), 6: (20, 40, 80), 8: (12, 16, 24)})


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "su3", "sl2", "gl4", "so7", "h3"])
def test_the_compiled_steps_are_those_of_numpy(name: str) -> None:
    group = lc.group(name)
    cosines, sines = waves(group.dim, 2)
    run = lc.simulate(group, fourier_input(RATES, cosines, sines), t=[0.0, 0.31, 1.7], rtol=1e-9)
    steps = plan_steps(run.drive, norms_of(group), run.t, 10**6)
    kind = complex if group.is_complex else float
    start = expm(group.hat(0.3 * cosines[0])).astype(kind)
    for order in (4, 6, 8):
        by_c, by_numpy = (
            flow(group, run.drive, steps, order, start),
            numpy_steps.flow(group, run.drive, steps, order, start),
        )
        np.testing.assert_allclose(by_c, by_numpy, rtol=0, atol=1e-14 * max(1.0, np.max(np.abs(by_numpy))))


def test_the_driven_qubit_to_twelve_digits() -> None:
    """H = sigma_z/2 + cos(1.1 t) sigma_x/2, X' = X iH over 50: stored digits."""
    su2 = lc.group("su2")
    run = lc.simulate(su2, lc.PeriodicInput(["-cos(11*t/10)", "0", "-1"]), t=[0, 50], rtol=1e-12)
    assert run.X[-1, 0, 0] == pytest.approx(-0.689657341175016 + 0.652294314113328j, abs=1e-12)
    assert run.X[-1, 0, 1] == pytest.approx(0.0267674604084 + 0.313318340673063j, abs=1e-12)
    assert run.steps < 1000


def test_a_rotating_field_over_a_long_time() -> None:
    """X(T) = exp(T (0.3 e_1 + e_3)^) exp(-T e_3^) under (0.3 cos t, 0.3 sin t, 0)."""
    so3, end = lc.group("so3"), 5e4
    run = lc.simulate(so3, lc.PeriodicInput(["3*cos(t)/10", "3*sin(t)/10", "0"]), t=[0, end], rtol=1e-11)
    turn = so3.hat([0.3, 0, 1]) * (end / 2**20)
    exact = np.linalg.matrix_power(expm(turn).astype(np.longdouble), 2**20) @ expm(
        so3.hat([0, 0, -np.fmod(end, 2 * np.pi)])
    )
    angle = float(np.fmod(np.longdouble(end) * np.sqrt(np.longdouble(109) / 100), 2 * np.pi * np.longdouble(1)))
    first = expm(so3.hat(np.array([0.3, 0, 1]) / np.sqrt(1.09)) * angle)
    exact = first @ expm(so3.hat([0, 0, -np.fmod(end, 2 * np.pi)]))
    assert np.max(np.abs(run.X[-1] - exact)) < 1e-10
    assert np.max(np.abs(run.X[-1].T @ run.X[-1] - np.eye(3))) < 1e-13


@pytest.mark.parametrize("k", [32, 64, 128, 640])
def test_no_alias_is_taken_for_a_constant(k: int) -> None:
    """int_0^1 cos(2 pi k t) dt = 0, for k that equal steps with ends and middles would read as 1 everywhere."""
    so3 = lc.group("so3")
    run = lc.simulate(so3, lambda t: [np.cos(2 * np.pi * k * t), 0.0, 0.0], t=[0, 1])
    assert np.max(np.abs(run.X[-1] - np.eye(3))) < 1e-9
    assert run.evaluations > 0
    assert 0 < run.resolution <= 1 / 2000
    assert run.error_estimate < 1e-10


@pytest.mark.parametrize("seed", range(4))
def test_a_short_pulse_is_found_wherever_it_lies(seed: int) -> None:
    so3, width = lc.group("so3"), 1e-2
    centre = np.random.default_rng(seed).uniform(0.1, 49.9)
    height = np.pi / 2 / (width * np.sqrt(np.pi))

    def u(t: np.ndarray) -> np.ndarray:
        return np.stack(
            [height * np.exp(-(((np.asarray(t) - centre) / width) ** 2)), *np.zeros((2, *np.shape(t)))], axis=-1
        )

    run = lc.simulate(so3, u, t=[0, 50], resolution=width)
    assert np.arctan2(run.X[-1, 2, 1], run.X[-1, 1, 1]) == pytest.approx(np.pi / 2, abs=1e-9)
    assert run.resolution <= width


@pytest.mark.parametrize("method", ["auto", "rkmk4"])
def test_jumps_and_corners_are_found_without_being_named(method: str) -> None:
    h3 = lc.group("h3")
    x, y, _ = h3.basis

    def u(t: float) -> np.ndarray:
        return np.array([1.0, 0, 0]) if t < 0.3 else np.array([0, abs(t - np.sqrt(0.5)), 0])

    area = ((np.sqrt(0.5) - 0.3) ** 2 + (1 - np.sqrt(0.5)) ** 2) / 2
    run = lc.simulate(h3, u, t=[0.0, 1.0], method=method, rtol=1e-10)
    np.testing.assert_allclose(run.X[-1], expm(0.3 * x) @ expm(area * y), rtol=0, atol=1e-10)


def test_a_corner_beside_the_end_of_a_piece_is_found() -> None:
    """A corner between the outermost node of a piece and its end is no node's business: the neighbours do not meet."""
    h3 = lc.group("h3")
    for corner in (0.5 + 1e-6, 0.5 - 3e-6, 0.5 + 2e-5):
        run = lc.simulate(h3, lambda t, c=corner: np.array([abs(t - c), 0, 0]), t=[0.0, 1.0], rtol=1e-13)
        assert run.X[-1, 0, 1] == pytest.approx((corner**2 + (1 - corner) ** 2) / 2, abs=3e-14)


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "sl2"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_the_error_estimate_is_honest(name: str, rtol: float) -> None:
    group = lc.group(name)
    a, b = np.random.default_rng(5).normal(size=(2, group.dim))

    def u(t: float) -> np.ndarray:
        return a * np.cos(1.3 * t) + b * np.exp(-(((t - 2) / 0.3) ** 2))

    run = lc.simulate(group, u, t=[0, 4], rtol=rtol)
    exact = reference(group, u, 4.0)
    error = np.max(np.abs(run.X[-1] - exact))
    assert error <= max(rtol * max(1.0, np.max(np.abs(exact))), 2e-13 * np.max(np.abs(exact)) ** 2)
    assert run.method == ("magnus8" if rtol < 1e-7 else "magnus6")


def test_inputs_of_every_kind_give_the_same_motion() -> None:
    se3 = lc.group("se3")
    t = np.linspace(0, 3, 7)
    texts = ["cos(2*t)", "1/2", "0", "sin(t)", "0", "1"]

    def u(s: float) -> np.ndarray:
        return np.array([np.cos(2 * s), 0.5, 0, np.sin(s), 0, 1])

    runs = [lc.simulate(se3, each, t=t, rtol=1e-12).X for each in (texts, lc.PeriodicInput(texts), u)]
    for X in runs[1:]:
        np.testing.assert_allclose(X, runs[0], rtol=0, atol=1e-11)
    values = np.random.default_rng(0).normal(size=(7, 6))
    sampled = lc.simulate(se3, lc.SampledInput(t, values, between="linear"), t=t).X
    np.testing.assert_allclose(sampled, lc.simulate(se3, values, t=t).X, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        sampled,
        lc.simulate(se3, lc.SampledInput(t, values, between="linear"), t=t, method="rkmk4").X,
        rtol=0,
        atol=1e-10,
    )


def test_many_trajectories_are_those_one_by_one_also_on_threads() -> None:
    su3 = lc.group("su3")
    rng = np.random.default_rng(3)
    cosines, sines = rng.normal(size=(2, 70, 2, 8)) / 2
    starts = np.array([expm(su3.hat(x)) for x in rng.normal(size=(70, 8))])
    eps = rng.uniform(0.2, 1, size=70)
    many = lc.simulate(su3, fourier_input(RATES, cosines, sines), t=[0, 1, 2], eps=eps, X0=starts, threads=2)
    assert many.X.shape == (3, 70, 3, 3)
    for k in (0, 7, 8, 69):
        one = lc.simulate(su3, fourier_input(RATES, cosines[k], sines[k]), t=[0, 1, 2], eps=eps[k], X0=starts[k])
        np.testing.assert_allclose(many.X[:, k], one.X, rtol=0, atol=1e-11)
    np.testing.assert_allclose(many.at(1.5)[3], lc.simulate(
        su3, fourier_input(RATES, cosines[3], sines[3]), t=[0, 1.5], eps=eps[3], X0=starts[3]
    ).X[-1], rtol=0, atol=1e-11)  # fmt: skip


def test_threads_over_time_give_the_same_motion() -> None:
    so3 = lc.group("so3")
    u = lc.PeriodicInput(["cos(t)", "sin(2*t)", "1/2"])
    t = np.linspace(0, 4000, 57)
    one, two = (lc.simulate(so3, u, t=t, threads=threads) for threads in (1, 2))
    assert one.steps > 8192
    np.testing.assert_allclose(two.X, one.X, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["auto", "rkmk4"])
def test_other_times_of_a_run_are_as_exact_as_the_run(method: str) -> None:
    so3 = lc.group("so3")

    def u(t: float) -> np.ndarray:
        return np.array([np.cos(3 * t), 0.5, np.sin(t)])

    run = lc.simulate(so3, u, t=[0, 1, 5], method=method)
    moments = [4.9, 0.0, 2.345, 1.0, 5.0]
    found = run.at(moments)
    for t, X in zip(moments, found, strict=True):
        np.testing.assert_allclose(X, reference(so3, u, t) if t else np.eye(3), rtol=0, atol=3e-11)
    np.testing.assert_allclose(run.at(2.345), found[2], rtol=0, atol=1e-13)
    with pytest.raises(InputError, match="from 0 to 5"):
        run.at(5.1)


def test_events_are_where_the_closed_form_says() -> None:
    """X_33 = cos(w t) passes 3/10 at (+-acos 0.3 + 2 pi m)/w."""
    so3, w = lc.group("so3"), 1.3
    events = [
        lc.Event("X[2][2] - 3/10"),
        lc.Event("X[2][2] - 3/10", direction=1),
        lc.Event("X[2][2] + 1", grazing=True),
    ]
    run = lc.simulate(so3, lambda t: [w, 0, 0], t=[0, 10], events=events)
    passages = np.array([(sign * np.arccos(0.3) + 2 * np.pi * m) / w for m in range(4) for sign in (1, -1)])
    passages = np.sort(passages[(passages > 0) & (passages < 10)])
    np.testing.assert_allclose(run.events[0].t, passages, rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.events[0].X[:, 2, 2], 0.3, rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.events[1].t, passages[1::2], rtol=0, atol=1e-13)
    assert len(run.events[2].t) == 0
    np.testing.assert_allclose(run.events[2].grazing, np.pi * np.array([1, 3]) / w, rtol=0, atol=1e-6)


def test_events_of_complex_matrices_and_of_time() -> None:
    su2 = lc.group("su2")
    run = lc.simulate(su2, [0, 0, 1.0], t=[0, 7], events=[lc.Event("re(X[0][0])"), lc.Event("abs(X[0][1]) + t^2 - 2")])
    np.testing.assert_allclose(run.events[0].t, [np.pi], rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.events[1].t, [np.sqrt(2)], rtol=0, atol=1e-13)


def test_bad_input_is_named() -> None:
    so3 = lc.group("so3")
    u = [0.1, 0.2, 0.3]
    for named, words in (
        ({"rtol": 1e-15}, "below 1e-14"),
        ({"rtol": 1e-9, "tolerance": 1e-9}, "not both"),
        ({"rtol": float("nan")}, "rtol must be positive"),
        ({"atol": -1.0}, "atol"),
        ({"method": "magnus5"}, "magnus6"),
        ({"resolution": -1.0}, "resolution"),
        ({"steps": 0}, "steps is an integer"),
        ({"steps": 10, "method": "rkmk4"}, "Magnus"),
        ({"events": [lc.Event("X[0][0] - 1")]}, "zero at the start"),
        ({"events": ["X[0][0]"]}, "lc.Event"),
        ({"events": [lc.Event("X[0][1]")], "eps": [1.0, 2.0]}, "one trajectory"),
        ({"threads": 0}, "threads"),
    ):
        with pytest.raises(InputError, match=words):
            lc.simulate(so3, u, t=[0, 1], **named)
    with pytest.raises(ExpressionError, match=r"no entry X\[3\]\[0\]; the last is X\[2\]\[2\]"):
        lc.simulate(so3, u, t=[0, 1], events=[lc.Event("X[3][0]")])
    with pytest.raises(InputError, match="is complex"):
        lc.simulate(lc.group("su2"), u, t=[0, 1], events=[lc.Event("X[0][0]")])
    with pytest.raises(InputError, match="values of u; at most"):
        lc.simulate(so3, lambda t: u, t=[0, 1], resolution=1e-9)
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="changes when it is asked again"):
        lc.simulate(so3, lambda t: rng.normal(size=3), t=[0, 1])
    with pytest.raises(NotFiniteError, match="NaN or infinite at t = "):
        lc.simulate(so3, lambda t: [1.0, np.sqrt(0.5 - t) if t < 0.5 else np.nan, 0.0], t=[0, 1])
    with pytest.raises(ComputationError, match="steps"):
        lc.simulate(so3, [1e9, 0, 0], t=[0, 1])


def test_a_trajectory_prints_in_a_line() -> None:
    text = repr(lc.simulate(lc.group("so3"), [0.1, 0.2, 0.3], t=[0, 1]))
    assert text.startswith("Trajectory(so3, 2 times from 0 to 1, magnus8")
    assert "\n" not in text


@pytest.mark.parametrize("name", ["so3", "se3", "su4", "sl2"])
def test_steps_are_as_long_as_the_spectral_norm_allows(name: str) -> None:
    """The bound is one, is no more than the Frobenius norm, and is sharp for one basis element."""
    group, rng = lc.group(name), np.random.default_rng(4)
    norms = norms_of(group)
    for x in [*rng.normal(size=(50, group.dim)), *np.eye(group.dim)]:
        bound, A = size_of(norms, x), group.hat(x)
        assert np.linalg.norm(A, 2) <= bound * (1 + 1e-14)
        assert bound <= np.linalg.norm(A) * (1 + 1e-14)
        if np.count_nonzero(x) == 1:
            assert abs(bound - np.linalg.norm(A, 2)) <= 1e-14
