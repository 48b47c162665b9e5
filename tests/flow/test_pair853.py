"""The pair 8(5,3) on groups: orders, tolerances, times wanted, members with numbers of their own, knots and refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import ComputationError
from lie_codegen.flow import pair853, pair_single
from lie_codegen.flow.pair853 import integrate
from lie_codegen.flow.pair_system import System
from lie_codegen.flow.product_rate import product_rate, reach_of, turning
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.maps.rkmk import times_taylor_exp
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.brackets import ad_star
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import matmul, matvec


class Move:
    def __init__(self, group: lc.MatrixGroup) -> None:
        self.group, self.derivation = group, GroupDerivation(group)

    def __call__(self, ops: Any, X: Any, theta: Any) -> Any:
        if self.derivation.matrix_pattern is None:
            return times_taylor_exp(self.group, ops, X, theta)
        return matmul(X, exp_matrix(ops, self.derivation, theta))


def free_body(name: str, damping: bool = False) -> System:
    """J xi' = ad*_xi J xi - k xi - grad of |X - 1|^2/2, J, its inverse and k as inputs."""
    group = lc.group(name)
    n, size, move = group.dim, packed_size(group), Move(group)

    def rate(ops: Any, X: Any, y: Any, t: Any, J: Any, inverse: Any, k: Any) -> tuple[Any, ...]:
        def rates(t: Any, elements: Any, v: Any) -> tuple[Any, Any]:
            force = list(ad_star(ops, group.algebra, v, matvec(J, v)))
            if damping:  # on SO(3): torque towards the identity, vee of the skew part
                [Y] = elements
                error = [(Y[2][1] - Y[1][2]) / 2, (Y[0][2] - Y[2][0]) / 2, (Y[1][0] - Y[0][1]) / 2]
                force = [f - 4 * e - k * w for f, e, w in zip(force, error, v, strict=True)]
            return [list(v)], matvec(inverse, force)

        return (product_rate(ops, [move], [unpack(group, X)], y, rates, t),)

    def moved(ops: Any, X: Any, theta: Any) -> tuple[Any, ...]:
        return (pack(group, move(ops, unpack(group, X), theta)),)

    J = Port("J", (n, n))
    library = lc.build(
        [
            Kernel(
                name="rate", namespace=f"{name}_body{int(damping)}",
                inputs=(Port("X", (size,)), Port("y", (2 * n,)), Port("t", ()), J, Port("J_inverse", (n, n)), Port("k", ())),
                outputs=(Port("y_dot", (2 * n,)),), body=rate, formula="", source="",
                sampler=lambda rng: ([rng.uniform(-1, 1) for _ in range(size)], [rng.uniform(-1, 1) for _ in range(2 * n)], 0.0,
                    np.eye(n).tolist(), np.eye(n).tolist(), 1.0),
            ),
            Kernel(
                name="move", namespace=f"{name}_body{int(damping)}", inputs=(Port("X", (size,)), Port("theta", (n,))),
                outputs=(Port("X_next", (size,)),), body=moved, formula="", source="",
                sampler=lambda rng: ([rng.uniform(-1, 1) for _ in range(size)], [rng.uniform(-1, 1) for _ in range(n)]),
            ),
        ]
    )  # fmt: skip
    return System(library.rate, library.move, n, reach_of(group, closed=move.derivation.matrix_pattern is not None))


def with_numbers(system: System, J: np.ndarray, k: Any = 0.0) -> System:
    return System(
        system.rate, system.move, system.group, system.reach, (J, np.linalg.inv(J), np.asarray(k, dtype=float))
    )


def interpolated(system: System, name: str) -> System:
    """The same, known not to read the time: steps go as they like, and states between are interpolated."""
    return replace(system, steady=True, algebra=lc.group(name).algebra)


def start(name: str, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    group = lc.group(name)
    X = np.array(pack(group, [[float(i == j) for j in range(group.degree)] for i in range(group.degree)]))
    xi = np.atleast_2d(xi)
    return np.repeat(X[None], len(xi), 0), np.hstack([np.zeros_like(xi), xi])


def reference(
    name: str, J: np.ndarray, xi: np.ndarray, times: np.ndarray, k: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """DOP853 of scipy on the entries of X and xi; ad* from the structure constants."""
    group, inverse = lc.group(name), np.linalg.inv(J)
    d, c = group.degree, group.algebra.structure_constants

    def rate(t: float, s: np.ndarray) -> np.ndarray:
        X, w = s[: d * d].reshape(d, d), s[d * d :]
        force = np.einsum("i,ijk,k->j", w, c, J @ w)
        if k is not None:
            S = (X - X.T) / 2
            force = force - 4 * np.array([S[2, 1], S[0, 2], S[1, 0]]) - k * w
        return np.concatenate([(X @ group.hat(w)).ravel(), inverse @ force])

    s0 = np.concatenate([np.eye(d).ravel(), xi])
    run = solve_ivp(rate, (times[0], times[-1]), s0, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-14)
    return run.y[: d * d].T.reshape(-1, d, d), run.y[d * d :].T


def matrices(name: str, packed: np.ndarray) -> np.ndarray:
    group = lc.group(name)
    return np.array([unpack(group, list(row)) for row in packed], dtype=float)


@pytest.mark.parametrize("name", ["so3", "se3", "se2", "sl2", "h3", "so4", "se_2_3"])
def test_theta_moves_as_the_group_does(name: str) -> None:
    """d/dt X_0 exp(Theta) = X hat(xi) for Theta' = dexp^-1 xi: scipy's exponential, differenced."""
    group, rng, h = lc.group(name), np.random.default_rng(0), 1e-3
    for _ in range(5):
        theta = rng.normal(size=group.dim)
        theta *= 0.9 * reach_of(group, closed=True) / np.linalg.norm(theta) if name != "h3" else 1.0
        xi = rng.normal(size=group.dim)
        rate = np.array(turning(FloatArithmetic(), group, list(theta), list(xi)), dtype=float)
        E = [expm(group.hat(theta + k * h * rate)) for k in (-2, -1, 1, 2)]
        slope = (E[0] - 8 * E[1] + 8 * E[2] - E[3]) / (12 * h)
        wanted = expm(group.hat(theta)) @ group.hat(xi)
        np.testing.assert_allclose(slope, wanted, rtol=0, atol=3e-10 * max(1.0, np.max(np.abs(wanted))))


@pytest.mark.parametrize("name", ["so3", "se3", "sl2"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_the_tolerance_holds_at_the_times_and_within(name: str, rtol: float) -> None:
    n = lc.group(name).dim
    J = np.diag(np.arange(1.0, n + 1)) + 0.1
    xi, times = np.linspace(0.3, 1.1, n), np.linspace(0, 3, 11)
    system = with_numbers(free_body(name), J)
    run = integrate(system, *start(name, xi), times, rtol=rtol, atol=0.0, where="test")
    X, w = reference(name, J, xi, times, None)
    scale = max(1.0, np.max(np.abs(X)), np.max(np.abs(w)))
    allowed = max(rtol, 1e-12) * scale
    assert np.max(np.abs(matrices(name, run.X[:, 0]) - X)) <= allowed
    assert np.max(np.abs(run.y[:, 0, n:] - w)) <= allowed
    assert run.error_estimate <= max(rtol * scale, 1e-14 * scale * np.sqrt(run.steps))
    inside = np.sort(np.random.default_rng(1).uniform(0, 3, 40))
    knots = np.searchsorted(run.knot_t, inside, side="right") - 1
    at, v = run.within(system, knots, (inside - run.knot_t[knots]) / run.knot_h[knots])
    X, w = reference(name, J, xi, np.concatenate([[0.0], inside]), None)
    assert np.max(np.abs(matrices(name, at) - X[1:])) <= 3 * allowed
    assert np.max(np.abs(v[:, n:] - w[1:])) <= 3 * allowed


@pytest.mark.parametrize("count", [2, 5, 40, 400])
def test_times_that_are_wanted_cost_what_they_must(count: int) -> None:
    """Few times: a step of its own to each. Many: steps end at them."""
    J, xi = np.diag([1.0, 2.0, 3.0]), np.array([1.0, 0.5, -0.2])
    system = with_numbers(free_body("so3", damping=True), J, 6.0)
    times = np.sort(np.concatenate([[0.0, 10.0], np.random.default_rng(2).uniform(0, 10, count - 2)]))
    run = integrate(system, *start("so3", xi), times, rtol=1e-9, atol=0.0, where="test")
    X, w = reference("so3", J, xi, times, 6.0)
    assert np.max(np.abs(matrices("so3", run.X[:, 0]) - X)) < 1e-9
    assert np.max(np.abs(run.y[:, 0, 3:] - w)) < 1e-9
    assert run.steps <= 60 + count
    np.testing.assert_allclose(np.append(run.knot_t[1:], 10.0) - run.knot_t, run.knot_h, rtol=0, atol=1e-13)


@pytest.mark.parametrize("threads", [1, 2])
def test_members_have_inertias_gains_and_states_of_their_own(threads: int) -> None:
    rng, N = np.random.default_rng(3), 150
    J = np.array([np.diag(row) for row in rng.uniform(0.5, 3, (N, 3))])
    k, xi, times = rng.uniform(2, 8, N), rng.normal(size=(N, 3)), np.linspace(0, 4, 9)
    system = with_numbers(free_body("so3", damping=True), J, k)
    run = integrate(system, *start("so3", xi), times, rtol=1e-9, atol=0.0, where="test", threads=threads)
    assert run.X.shape == (9, N, 9)
    for m in (0, 17, 63, 64, 149):
        X, w = reference("so3", J[m], xi[m], times, float(k[m]))
        assert np.max(np.abs(matrices("so3", run.X[:, m]) - X)) < 2e-9
        assert np.max(np.abs(run.y[:, m, 3:] - w)) < 2e-9


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_the_worst_of_thousands_is_within_the_tolerance(rtol: float) -> None:
    rng, N = np.random.default_rng(8), 3000
    J = np.array([np.diag(row) for row in rng.uniform(0.5, 4, (N, 3))])
    k, xi, times = rng.uniform(1, 8, N), rng.normal(size=(N, 3)), np.linspace(0, 6, 5)
    system = with_numbers(free_body("so3", damping=True), J, k)
    run, exact = (
        integrate(system, *start("so3", xi), times, rtol=each, atol=0.0, where="test") for each in (rtol, 1e-13)
    )
    off = np.maximum(np.abs(run.X - exact.X).max(axis=(0, 2)), np.abs(run.y - exact.y).max(axis=(0, 2)))
    worst = int(np.argmax(off))
    X, w = reference("so3", J[worst], xi[worst], times, float(k[worst]))
    assert np.max(np.abs(matrices("so3", exact.X[:, worst]) - X)) < 2e-12
    assert off[worst] <= rtol * max(1.0, float(np.abs(w).max()))
    assert off[worst] <= run.error_estimate


def test_a_free_body_over_a_long_time_keeps_its_energy_to_the_tolerance() -> None:
    J, xi = np.diag([1.0, 2.0, 3.0]), np.array([0.3, 1.0, 0.2])
    run = integrate(
        with_numbers(free_body("so3"), J), *start("so3", xi), np.linspace(0, 500, 6), rtol=1e-10, atol=0.0, where="test"
    )
    w = run.y[:, 0, 3:]
    energy, momentum = np.einsum("ti,ij,tj->t", w, J, w), np.linalg.norm(w @ J, axis=1)
    assert np.ptp(energy) < 1e-10
    assert np.ptp(momentum) < 1e-10
    X = matrices("so3", run.X[:, 0])
    assert np.max(np.abs(np.einsum("tji,tjk->tik", X, X) - np.eye(3))) < 1e-12


def test_a_state_that_escapes_is_refused_with_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pair_single, "MOST_STEPS", 20_000)
    system = with_numbers(free_body("so3", damping=True), np.eye(3), -1e3)
    with pytest.raises(ComputationError, match=r"no longer finite|grows without bound"):
        integrate(system, *start("so3", np.ones(3)), np.array([0.0, 5.0]), rtol=1e-9, atol=0.0, where="test")


def test_blocks_of_steps_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    system, times = with_numbers(free_body("so3"), np.diag([1.0, 2.0, 3.0])), np.linspace(0, 20, 7)
    whole = integrate(system, *start("so3", np.ones(3)), times, rtol=1e-9, atol=0.0, where="test")
    monkeypatch.setattr(pair_single, "STEPS", 5)
    parts = integrate(system, *start("so3", np.ones(3)), times, rtol=1e-9, atol=0.0, where="test")
    np.testing.assert_allclose(parts.y, whole.y, rtol=0, atol=1e-13)
    np.testing.assert_allclose(parts.knot_t, whole.knot_t, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [2, 3, 5, 63, 65])
@pytest.mark.parametrize("name", ["so3", "se3", "sl2"])
def test_members_go_as_they_would_alone(name: str, count: int) -> None:
    """Whatever lane a member has, and whoever had it before: to the tolerance, at times that lie unevenly."""
    n, rng = lc.group(name).dim, np.random.default_rng(count)
    J = np.array([np.diag(row) for row in rng.uniform(1, 2, (count, n))])
    xi, times = 0.5 * rng.normal(size=(count, n)), np.array([0.0, 0.05, 0.9, 1.0, 3.0])
    whole, start_of = with_numbers(free_body(name), J), start(name, xi)
    together = integrate(whole, *start_of, times, rtol=1e-9, atol=0.0, where="test")
    for m in range(0, count, 7):
        one = slice(m, m + 1)
        X0, y0 = (each[one] for each in start_of)
        alone = integrate(whole.of_members(one), X0, y0, times, rtol=1e-9, atol=0.0, where="test")
        allowed = 2e-9 * max(1.0, np.max(np.abs(alone.X)), np.max(np.abs(alone.y)))
        assert np.max(np.abs(together.X[:, m] - alone.X[:, 0])) <= allowed
        assert np.max(np.abs(together.y[:, m] - alone.y[:, 0])) <= allowed


def test_a_member_takes_its_steps_whoever_its_neighbours_are() -> None:
    """The same bits in a batch and among other members, in another lane; fast and slow ones mixed."""
    rng, N = np.random.default_rng(4), 30
    J = np.array([np.diag(row) for row in rng.uniform(0.5, 3, (N, 3))])
    k, xi, times = rng.uniform(2, 8, N), rng.normal(size=(N, 3)) * rng.uniform(0.1, 20, (N, 1)), np.linspace(0, 2, 4)
    system, (X0, y0) = with_numbers(free_body("so3", damping=True), J, k), start("so3", xi)
    run = pair853._many(system, X0, y0, times, 1e-9, 1e-9, "test")
    order = rng.permutation(N)[:19]
    some = pair853._many(system.of_members(order), X0[order], y0[order], times, 1e-9, 1e-9, "test")
    np.testing.assert_array_equal(some.X, run.X[:, order])
    np.testing.assert_array_equal(some.y, run.y[:, order])


def test_members_go_one_after_another_where_lanes_cannot_be_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    J = np.array([np.diag([1.0, 2.0, z]) for z in (1.5, 2.5, 3.5)])
    body, begun, times = free_body("so3", damping=True), start("so3", np.ones((3, 3))), np.linspace(0, 4, 3)
    there = integrate(with_numbers(body, J, 6.0), *begun, times, rtol=1e-9, atol=0.0, where="test")
    monkeypatch.setattr(System, "blocks", (0, 0))
    found = integrate(with_numbers(body, J, 6.0), *begun, times, rtol=1e-9, atol=0.0, where="test")
    np.testing.assert_allclose(found.X, there.X, rtol=0, atol=2e-9)
    np.testing.assert_allclose(found.y, there.y, rtol=0, atol=2e-9)


def test_one_member_that_escapes_stops_them_all() -> None:
    J, k = np.repeat(np.eye(3)[None], 20, 0), np.full(20, 6.0)
    k[13] = -1e3
    with pytest.raises(ComputationError, match=r"no longer finite|no step is short enough|grows without bound"):
        pair853._many(
            with_numbers(free_body("so3", damping=True), J, k), *start("so3", np.ones((20, 3))), np.array([0.0, 5.0]), 1e-9, 1e-9, "test"
        )  # fmt: skip


@pytest.mark.parametrize("name", ["so3", "se3", "sl2", "se2"])
def test_interpolated_states_are_as_good_as_the_tolerance_at_every_time(name: str) -> None:
    """Errors at 201 times of a run of far fewer steps fall as the tolerance does, and the estimate covers them."""
    n = lc.group(name).dim
    J, xi, times = np.diag(np.arange(1.0, n + 1)) + 0.1, np.linspace(0.3, 1.1, n), np.linspace(0, 3, 201)
    system = interpolated(with_numbers(free_body(name), J), name)
    X, w = reference(name, J, xi, times, None)
    scale = max(1.0, np.max(np.abs(X)), np.max(np.abs(w)))
    tolerances, errors = np.array([1e-4, 1e-6, 1e-8, 1e-10]), []
    for rtol in tolerances:
        run = integrate(system, *start(name, xi), times, rtol=rtol, atol=0.0, where="test")
        off = max(np.max(np.abs(matrices(name, run.X[:, 0]) - X)), np.max(np.abs(run.y[:, 0, n:] - w)))
        assert off <= run.error_estimate + 1e-12 * scale
        assert run.error_estimate <= rtol * scale
        assert run.steps < 100
        assert np.all(run.y[:, 0, :n] == 0)
        errors.append(off)
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert 0.7 < slope < 1.3


def test_states_between_few_steps_are_found_by_steps_of_their_own() -> None:
    J, xi, times = np.diag([1.0, 2.0, 3.0]), np.array([0.3, 1.0, 0.2]), np.linspace(0, 0.02, 31)
    run = integrate(
        interpolated(with_numbers(free_body("so3"), J), "so3"),
        *start("so3", xi),
        times,
        rtol=1e-10,
        atol=0.0,
        where="test",
    )
    X, w = reference("so3", J, xi, times, None)
    assert run.steps < 5
    assert np.max(np.abs(matrices("so3", run.X[:, 0]) - X)) < 1e-12
    assert np.max(np.abs(run.y[:, 0, 3:] - w)) < 1e-12


def test_interpolated_states_of_a_run_in_blocks_are_those_of_one_in_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    times = np.linspace(0, 20, 301)
    system = interpolated(with_numbers(free_body("so3", damping=True), np.diag([1.0, 2.0, 3.0]), 1.0), "so3")
    whole = integrate(system, *start("so3", np.ones(3)), times, rtol=1e-9, atol=0.0, where="test")
    monkeypatch.setattr(pair_single, "FIRST_STEPS", 3)
    monkeypatch.setattr(pair_single, "STEPS", 5)
    parts = integrate(system, *start("so3", np.ones(3)), times, rtol=1e-9, atol=0.0, where="test")
    assert whole.steps == parts.steps
    np.testing.assert_allclose(parts.y, whole.y, rtol=0, atol=1e-13)
    np.testing.assert_allclose(parts.X, whole.X, rtol=0, atol=1e-13)
    np.testing.assert_allclose(parts.knot_t, whole.knot_t, rtol=0, atol=1e-12)
    assert parts.error_estimate == pytest.approx(whole.error_estimate, rel=1e-3)
