"""Inputs that compiled loops evaluate themselves: Fourier series, pieces, samples; one run, many, and very long ones."""

from __future__ import annotations

import shutil
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import ComputationError, InputError, NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.flow import formulas
from lie_codegen.flow.libraries import integrators
from lie_codegen.groups.maps.commutator_free import commutator_free_step
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime import drive
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.formula_input import FormulaInput, formula_input, fourier_input, lines_input
from lie_codegen.runtime.library import Library

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")
ROWS = [[1.0, 0.5, -0.3], [0.2, 0.0, 0.7]]


@pytest.fixture(scope="module")
def probe() -> Library:
    """Steps that show what they were given: state <- u(t + h/2), and state <- (t, h, u(t) + gain)."""

    def clock(ops: Any, state: Any, u0: Any, gain: Any, t: Any, h: Any) -> Any:
        return ([t, h, u0 + gain],)

    seen = Kernel(
        "seen", "probe", (Port("s", (3,)), Port("um", (3,))), (Port("s_next", (3,)),), lambda ops, s, um: (um,)
    )
    inputs = (Port("s", (3,)), *(Port(name, ()) for name in ("u0", "gain", "t", "h")))
    return build_kernels(lambda: [seen, Kernel("clock", "probe", inputs, (Port("s_next", (3,)),), clock)])


@pytest.fixture(params=["C", "numpy"])
def loop(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """With the compiled loop, and without it."""
    if request.param == "numpy":
        monkeypatch.setattr(drive, "drive_library", lambda: None)
    return str(request.param)


@pytest.mark.parametrize(("t0", "n"), [(0.0, 3_000), (1e4, 1_000), (-1e7, 1_000)])
def test_a_series_is_good_to_the_last_digits_however_late(probe: Library, t0: float, n: int) -> None:
    """u at t0 + (k + 1/2) h against mpmath with the exact rates k omega."""
    h = 0.037
    u = lc.PeriodicInput.from_fourier(ROWS, ROWS[::-1], mean=[0.1, 0.0, -0.2], period="sqrt(2)")
    got = probe.seen.drive(np.zeros(3), u, n=n, h=h, t0=t0)
    with mp.workdps(40):
        omega, c, s = 2 * mp.pi / mp.sqrt(2), ROWS, ROWS[::-1]
        for k in (0, 1, 63, 64, 65, n // 2, n - 1):
            t = mp.mpf(t0) + (k + mp.mpf(1) / 2) * mp.mpf(h)
            wanted = [
                m + sum(c[f][i] * mp.cos((f + 1) * omega * t) + s[f][i] * mp.sin((f + 1) * omega * t) for f in range(2))
                for i, m in enumerate((0.1, 0.0, -0.2))
            ]
            np.testing.assert_allclose(got[k + 1], [float(x) for x in wanted], rtol=0, atol=4e-15)


def test_clock_step_and_other_inputs(probe: Library, loop: str) -> None:
    u = fourier_input([0.0, 1.0], [[0.5], [0.0]], [[0.0], [1.0]])
    gains = np.array([1.0, 2.0, 3.0])
    got = probe.clock.drive(np.zeros((3, 3)), u, n=130, h=0.1, t0=5.0, gain=gains)
    t = 5.0 + 0.1 * np.arange(130)
    for run, gain in zip(got, gains, strict=True):
        np.testing.assert_allclose(run[1:, 0], t, rtol=1e-15)
        np.testing.assert_array_equal(run[1:, 1], 0.1)
        np.testing.assert_allclose(run[1:, 2], 0.5 + np.sin(t) + gain, atol=1e-14)
    own = np.linspace(0, 1, 130)
    got = probe.clock.drive(np.zeros(3), u, n=130, h=0.1, gain=own[None], every=13)
    np.testing.assert_allclose(got[1:, 2], (0.5 + np.sin(0.1 * np.arange(130)) + own)[12::13], atol=1e-14)


@pytest.mark.parametrize("every", [1, 7, 100, 350])
def test_one_run_and_many_agree_with_sampled_loops(loop: str, every: int) -> None:
    so3 = lc.group("so3")
    step = integrators(so3).rkmk4_step
    u = lc.PeriodicInput(["cos(t)", "sin(2*t)/2", "1/3"], period="2*pi")
    n, h, t0 = 700, 0.02, -1.0
    t = t0 + h * np.arange(n)
    wanted = step.scan(np.eye(3), u(t), u(t + h / 2), u(t + h), h, n=n, every=every)
    np.testing.assert_allclose(step.drive(np.eye(3), u, n=n, h=h, t0=t0, every=every), wanted, rtol=0, atol=1e-13)
    starts = np.array([expm(so3.hat(x)) for x in np.random.default_rng(0).normal(size=(19, 3))])
    runs = step.drive(starts, u, n=n, h=h, t0=t0, every=every)
    assert runs.shape == (19, n // every + 1, 3, 3)
    np.testing.assert_allclose(runs, starts[:, None] @ wanted, rtol=0, atol=1e-13)


def test_every_trajectory_may_have_its_own_series(loop: str) -> None:
    so3 = lc.group("so3")
    step = integrators(so3).rkmk4_step
    shared = formula_input(lc.PeriodicInput(["cos(t)", "sin(t)", "1/5"], period="2*pi"), 0, 1)
    assert shared is not None
    factors = np.linspace(0.2, 1.0, 37)
    runs = step.drive(np.eye(3), shared.scaled(factors), n=300, h=0.02, every=50)
    for run, factor in zip(runs, factors, strict=True):
        np.testing.assert_allclose(
            run, step.drive(np.eye(3), shared.scaled(factor), n=300, h=0.02, every=50), atol=1e-14
        )


def test_threads_do_not_change_a_run() -> None:
    so3 = lc.group("so3")
    step = integrators(so3).rkmk4_step
    u = lc.PeriodicInput(["cos(t)", "sin(t)", "0"], period="2*pi")
    starts = np.repeat(np.eye(3)[None], 2100, axis=0)
    one, two = (step.drive(starts, u, n=20, h=0.1, every=20, threads=k) for k in (1, 2))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("between", ["constant", "linear"])
def test_samples_are_held_or_joined_as_documented(probe: Library, loop: str, between: str) -> None:
    """Each step reads the piece that its middle lies in; outside, u keeps its outermost values."""
    times = np.array([0.0, 0.4, 0.6, 2.0])
    values = np.array([[1.0, 0, 0], [0, 2.0, 0], [0, 0, 3.0], [1, 1, 1.0]])[: 3 if between == "constant" else 4]
    u = lc.SampledInput(times, values, between=between)
    got = probe.seen.drive(np.zeros(3), u, n=160, h=0.02, t0=-0.4)[1:]
    t = -0.4 + 0.02 * np.arange(160) + 0.01
    if between == "linear":
        wanted = np.stack([np.interp(t, times, column) for column in values.T], axis=-1)
    else:
        wanted = values[np.clip(np.searchsorted(times, t, side="right") - 1, 0, 2)]
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-13)
    np.testing.assert_allclose(u(t), wanted, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(u(0.4), values[1])


def test_piecewise_constant_inputs_are_products_of_exponentials() -> None:
    """On breakpoints that no even grid meets, and few steps: the method is exact for a constant input."""
    so3 = lc.group("so3")
    rng = np.random.default_rng(1)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 1.0, 40))])
    values = rng.normal(size=(40, 3))
    run = lc.simulate(so3, lc.SampledInput(times, values), t=times)
    X = np.eye(3)
    for k, value in enumerate(values):
        X = X @ expm((times[k + 1] - times[k]) * so3.hat(value))
        np.testing.assert_allclose(run.X[k + 1], X, rtol=0, atol=1e-13)
    assert run.steps < 2_000


def test_periodic_pieces_are_stepped_on_for_many_periods() -> None:
    h3 = lc.group("h3")
    u = lc.PeriodicInput.from_pieces([("1/3", ["1", "0", "0"]), ("1", ["0", "t", "0"])])
    form = formula_input(u, 0.0, 10.0)
    assert form is not None
    assert len(form.times) == 21
    run = lc.simulate(h3, u, t=[0.0, 2.5, 10.0])
    a, b = expm(h3.basis[0] / 3), expm((1 - 1 / 9) / 2 * h3.basis[1])
    np.testing.assert_allclose(run.X[-1], np.linalg.matrix_power(a @ b, 10), rtol=0, atol=1e-12)
    half = expm((0.25 - 1 / 9) / 2 * h3.basis[1])
    np.testing.assert_allclose(run.X[1], np.linalg.matrix_power(a @ b, 2) @ a @ half, rtol=0, atol=1e-12)


def test_samples_at_the_output_times_are_joined_by_lines() -> None:
    so3 = lc.group("so3")
    t = np.array([0.0, 0.3, 1.0, 1.1])
    values = np.random.default_rng(3).normal(size=(4, 3))

    def field(s: float, x: np.ndarray) -> np.ndarray:
        u = np.array([np.interp(s, t, column) for column in values.T])
        return (x.reshape(3, 3) @ so3.hat(u)).ravel()

    x = np.eye(3).ravel()
    for a, b in pairwise(t):
        x = solve_ivp(field, (a, b), x, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    for u in (values, lc.SampledInput(t, values, between="linear")):
        np.testing.assert_allclose(lc.simulate(so3, u, t=t).X[-1].ravel(), x, rtol=0, atol=2e-11)


def _turning(t: float) -> np.ndarray:
    """X of u = (cos w t, sin w t, c - w), w = 7/10, c = 3/10: exp(t hat(1, 0, c)) exp(-w t hat(0, 0, 1)), in 40 digits."""

    def rotation(axis: tuple[mp.mpf, ...], angle: mp.mpf) -> mp.matrix:
        a, b, c = axis
        K = mp.matrix([[0, -c, b], [c, 0, -a], [-b, a, 0]])
        return mp.eye(3) + mp.sin(angle) * K + (1 - mp.cos(angle)) * K * K

    with mp.workdps(40):
        size = mp.sqrt(1 + mp.mpf(9) / 100)
        first = rotation((1 / size, mp.mpf(0), mp.mpf(3) / 10 / size), size * mp.mpf(t))
        return np.array(
            (first * rotation((mp.mpf(0), mp.mpf(0), mp.mpf(1)), -mp.mpf(7) / 10 * mp.mpf(t))).tolist(), float
        )


@pytest.mark.parametrize("horizon", [300.0, pytest.param(1e4, marks=pytest.mark.slow)])
def test_long_horizons_reach_the_tolerance_and_keep_no_state_a_step(horizon: float) -> None:
    """From 5e4 steps (t = 300) to 6.5e6 (t = 10^4, two seconds): the truth is known in closed form."""
    u = lc.PeriodicInput(["cos(7*t/10)", "sin(7*t/10)", "-2/5"], period="20*pi/7")
    run = lc.simulate(lc.group("so3"), u, t=np.linspace(0, horizon, 11), method="rkmk4")
    assert run.steps > 150 * horizon
    for t, X in zip(run.t, run.X, strict=True):
        np.testing.assert_allclose(X, _turning(t), rtol=0, atol=2e-11)
        assert np.max(np.abs(X.T @ X - np.eye(3))) < 1e-12


def test_a_fast_sine_is_not_taken_for_a_constant() -> None:
    """32 coarse steps over [0, 1] would read cos(64 pi t) as 1 at both ends and the middle of every step."""
    so3 = lc.group("so3")
    u = lc.PeriodicInput(["cos(256*pi*t)", "0", "0"], period="1/128")
    np.testing.assert_allclose(lc.simulate(so3, u, t=[0, 1]).X[-1], np.eye(3), atol=1e-10)


@pytest.mark.parametrize(
    ("texts", "in_loop", "wanted"),
    [
        (
            ["cos(t)^2", "sin(t)*cos(3*t)", "1/2"],
            True,
            lambda t: [np.cos(t) ** 2, np.sin(t) * np.cos(3 * t), 0.5 + 0 * t],
        ),
        (["1", "2", "3"], True, lambda t: [1 + 0 * t, 2 + 0 * t, 3 + 0 * t]),
        (["cos(t)", "cos(sqrt(2)*t)", "0"], True, lambda t: [np.cos(t), np.cos(2**0.5 * t), 0 * t]),
        (["exp(-t)", "t", "0"], False, lambda t: [np.exp(-t), t, 0 * t]),
    ],
)
def test_formulas_of_the_command_line_become_series_where_they_are(
    texts: list[str], in_loop: bool, wanted: Any
) -> None:
    u = formulas.formula_input(lc.group("so3"), texts)
    assert (formula_input(u, 0.0, 1.0) is not None) == in_loop
    t = np.linspace(0, 3, 7)
    np.testing.assert_allclose(u(t), np.stack(wanted(t), axis=-1), rtol=0, atol=1e-14)


def test_what_is_out_of_reach_is_said_at_once() -> None:
    u = lc.PeriodicInput(["cos(1000*t)", "0", "0"])
    with pytest.raises(ComputationError, match="more than the 67108864 steps"):
        lc.simulate(lc.group("so3"), u, t=[0, 1e9])


@pytest.mark.parametrize("name", ["so3", "su2", "se3"])
def test_methods_and_monte_carlo_over_starts_and_amplitudes(name: str) -> None:
    group = lc.group(name)
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(2, 1, group.dim))
    u = lc.PeriodicInput.from_fourier(a, b, period="2*pi")
    starts = np.array([expm(group.hat(x)) for x in 0.5 * rng.normal(size=(5, group.dim))])
    factors = np.linspace(0.2, 1.0, 5)
    t = [0.0, 0.5, 2.0]
    together = lc.simulate(group, u, t=t, X0=starts, eps=factors)
    assert together.X.shape == (3, 5, *starts.shape[1:])
    as_function = lc.simulate(group, lambda s: u(s), t=t, X0=starts, eps=factors)
    np.testing.assert_allclose(as_function.X, together.X, rtol=0, atol=2e-10)
    free = lc.simulate(group, u, t=t, X0=starts, eps=factors, method="commutator_free")
    np.testing.assert_allclose(free.X, together.X, rtol=0, atol=2e-10)
    for number, (start, factor) in enumerate(zip(starts, factors, strict=True)):
        alone = lc.simulate(group, u, t=t, X0=start, eps=factor)
        np.testing.assert_allclose(together.X[:, number], alone.X, rtol=0, atol=2e-10)
    with pytest.raises(InputError, match="one trajectory"):
        _ = together.g


def test_coordinates_of_a_formula_are_those_of_the_function() -> None:
    so3 = lc.group("so3")
    u = lc.PeriodicInput(["cos(t)", "sin(t)", "1/3"], period="2*pi")
    runs = [lc.simulate(so3, each, eps=0.3, t=np.linspace(0, 8, 17)) for each in (u, lambda t: u(t))]
    np.testing.assert_allclose(runs[0].g, runs[1].g, rtol=0, atol=1e-9)
    assert [c.reason for c in runs[0].charts] == [c.reason for c in runs[1].charts]


def test_users_kernels_say_which_inputs_read_u() -> None:
    """x'' = -x + f(t) by the implicit midpoint rule: the resonance x = t sin(t) / 2 for f = cos t."""

    def body(ops: Any, x: Any, forces: Any, h: Any) -> Any:
        half, [force] = h / 2, forces
        d = 1 + half * half
        q, v = x
        middle = (q + half * v + half * half * force) / d
        return ([2 * middle - q, v + h * (force - middle)],)

    kernel = Kernel(
        "midpoint", "oscillator", (Port("x", (2,)), Port("force", (1,)), Port("h", ())), (Port("x_next", (2,)),), body
    )
    lib = build_kernels(lambda: [kernel])
    run = lib.midpoint.drive(
        np.zeros(2), lc.PeriodicInput(["cos(t)"], period="2*pi"), n=20_000, h=1e-3, at={"force": 0.5}
    )
    np.testing.assert_allclose(run[-1, 0], 10 * np.sin(20.0), atol=1e-4)


def test_refusals(probe: Library) -> None:
    u = lc.PeriodicInput(["cos(t)", "sin(t)", "0"], period="2*pi")
    zero, seen, clock = np.zeros(3), probe.seen, probe.clock
    one = fourier_input([1.0], [[1.0]], [[0.0]])
    cases: list[tuple[Any, type[Exception], str]] = [
        (lambda: seen.drive(zero, lambda t: zero, n=1, h=0.1), InputError, "use scan"),
        (lambda: seen.drive(zero, u, n=5, h=0.1, every=2), InputError, "multiple"),
        (lambda: seen.drive(zero, u, n=5, h=np.nan), InputError, "h is a finite"),
        (lambda: seen.drive(zero, u, n=5, h=0.1, at={"v": 0}), InputError, "among v"),
        (lambda: seen.drive(zero, u, n=5, h=0.1, at={"um": 2}), InputError, r"\[0, 1\]"),
        (lambda: seen.drive(zero, one, n=5, h=0.1), ShapeError, "um has shape"),
        (lambda: seen.drive(np.zeros(2), u, n=5, h=0.1), ShapeError, "s has shape"),
        (lambda: seen.drive(zero, u, n=5, h=0.1, gain=1), ShapeError, "no argument 'gain'"),
        (lambda: seen.drive(zero, u, n=5, h=0.1, um=zero), ShapeError, "reads u"),
        (lambda: clock.drive(zero, one, n=5, h=0.1), ShapeError, "missing gain"),
        (lambda: seen.drive(np.zeros((2, 3)), _three(u), n=5, h=0.1), ShapeError, "trajectories"),
        (lambda: lc.SampledInput([0, 1], [[1.0], [2.0]]), ShapeError, "m \\+ 1 times"),
        (lambda: lc.SampledInput([0, 1], [[1.0]], between="cubic"), InputError, "cubic"),  # type: ignore[arg-type]
        (lambda: lc.SampledInput([0, 0], [[1.0]]), InputError, "increase"),
        (lambda: lc.SampledInput([0, 1], [[np.nan]]), NotFiniteError, "NaN"),
        (lambda: fourier_input([1.0], [[1.0]], [[0.0, 1.0]]), ShapeError, "Fourier"),
        (lambda: lines_input([0, 1, 2], [[1.0]], [[1.0]]), ShapeError, "pieces"),
        (lambda: lc.simulate(lc.group("so3"), one, t=[0, 1]), ShapeError, "1 components"),
        (lambda: lc.simulate(lc.group("so3"), u, t=[0, 1], method="euler"), InputError, "rkmk4, commutator_free"),
        (lambda: lc.simulate(lc.group("so3"), _three(u), t=[0, 1], eps=[1, 2]), ShapeError, "eps has 2, u has 3"),
        (lambda: lc.simulate(lc.group("so3"), u, t=[0, 1], eps=[[1.0]]), ShapeError, "eps has shape"),
        (
            lambda: lc.simulate(lc.group("so3"), u, t=[0, 1], X0=[np.eye(3), 2 * np.eye(3)]),
            NotOnGroupError,
            r"X0\[1\] is not on the group so3: X\^T X - 1 = 3",
        ),
    ]
    for call, error, words in cases:
        with pytest.raises(error, match=words):
            call()


def _three(u: lc.PeriodicInput) -> FormulaInput:
    form = formula_input(u, 0.0, 1.0)
    if form is None:
        raise AssertionError
    return form.scaled([1.0, 2.0, 3.0])


def test_the_commutator_free_method_is_in_the_users_hands() -> None:
    """As a kernel, driven, and with outputs every k steps only."""
    se3 = lc.group("se3")
    lib = build_kernels(lambda: [commutator_free_step(se3)])
    u = lc.PeriodicInput(["cos(t)", "0", "sin(t)", "1", "0", "cos(2*t)"], period="2*pi")
    run = lib.commutator_free_step.drive(np.eye(4), u, n=4_000, h=1e-3, every=1_000)
    np.testing.assert_allclose(run, lc.simulate(se3, u, t=np.arange(5.0)).X, rtol=0, atol=1e-11)


def test_no_steps_are_the_start(probe: Library, loop: str) -> None:
    u = fourier_input([1.0], [[1.0, 0, 0]], [[0.0, 1, 0]])
    start = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(probe.seen.drive(start, u, n=0, h=0.1), [start])


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_the_driver_is_clean_under_the_sanitizers(compiler: str, tmp_path: Path) -> None:
    """A copy of u into the state, over spans of all lengths, one run and many, on exact-sized memory."""
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    (tmp_path / "main.c").write_text(_MAIN, encoding="utf-8")
    flags = [
        "-std=c99",
        "-g",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-fsanitize=address,undefined,float-cast-overflow",
        "-fno-sanitize-recover=all",
    ]
    command = [compiler, *flags, f"-I{template_folder()}", "main.c", "-lm", "-o", "main"]
    made = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    if "cannot find" in made.stderr:
        pytest.skip("no sanitizer libraries")
    assert made.returncode == 0, made.stderr
    done = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


_MAIN = r"""
#include "drive.c"
#include <stdio.h>
#include <stdlib.h>

static void scan(ptrdiff_t n, ptrdiff_t every, const double *const *in, const ptrdiff_t *step, double *to)
{
    ptrdiff_t k;
    to[0] = in[0][0];
    for (k = 0; k < n; ++k) {
        const double last = to[k / every];
        to[(k + every) / every] = 0.5 * (in[1][k * step[1]] + in[2][k * step[2]]) + 0.0 * last + 0.0 * in[3][k * step[3]];
    }
}

static void batch(ptrdiff_t count, ptrdiff_t n, ptrdiff_t every, const double *const *in, const ptrdiff_t *lane,
    const ptrdiff_t *step, double *to)
{
    ptrdiff_t j;
    for (j = 0; j < count; ++j) {
        const double *mine[4] = {in[0] + j * lane[0], in[1] + j * lane[1], in[2] + j * lane[2], in[3] + j * lane[3]};
        scan(n, every, mine, step, to + j * (n / every + 1));
    }
}

int main(void)
{
    static const double rate[2] = {1.0, 3.0}, low[2] = {0.0, 0.0}, at[2] = {0.0, 1.0};
    static const ptrdiff_t point[4] = {-1, 0, 1, -1}, lane[4] = {1, 0, 0, 0}, step[4] = {0, 0, 0, 0};
    static const ptrdiff_t parts[6] = {1, 3, 63, 64, 65, 200}, counts[4] = {1, 2, 128, 130};
    int p, c, own;
    for (p = 0; p < 6; ++p) {
        for (c = 0; c < 4; ++c) {
            for (own = 0; own < 2; ++own) {
                const ptrdiff_t count = counts[c], spans = 7;
                double *start = calloc((size_t)count, sizeof(double)), *to = calloc((size_t)(count * (spans + 1)), sizeof(double));
                double *a = calloc((size_t)(2 * count), sizeof(double)), *b = calloc((size_t)(2 * count), sizeof(double));
                double *space = calloc((size_t)lie_codegen_drive_work(1, 2, 2, 1), sizeof(double)), knots[8];
                const double *in[4] = {start, NULL, NULL, NULL};
                Signal u = {1, 2, 0, own ? 2 : 0, 0, rate, low, a, b, NULL, NULL, NULL};
                Grid grid = {spans, parts[p], p % 2 ? knots : NULL, 0.0, 1.0 / (double)parts[p]};
                Ports ports = {4, 1, 3, -1, 2, at, point, in, lane, step};
                ptrdiff_t k;
                for (k = 0; k < 8; ++k) {
                    knots[k] = (double)k;
                }
                for (k = 0; k < 2 * count; ++k) {
                    a[k] = 1.0;
                    b[k] = 0.5;
                }
                lie_codegen_drive(scan, batch, count, &u, &grid, &ports, space, to);
                for (k = 0; k < count; ++k) {
                    const double h = 1.0 / (double)parts[p], t = 7.0 - h;
                    const double first = cos(t) + cos(3 * t) + 0.5 * (sin(t) + sin(3 * t));
                    const double last = cos(7.0) + cos(21.0) + 0.5 * (sin(7.0) + sin(21.0));
                    if (!(fabs(to[k * 8 + 7] - 0.5 * (first + last)) < 1e-13)) {
                        fprintf(stderr, "parts %d, count %d: %.17g\n", (int)parts[p], (int)count, to[k * 8 + 7]);
                        return 1;
                    }
                }
                free(start), free(to), free(a), free(b), free(space);
            }
        }
    }
    return 0;
}
"""
