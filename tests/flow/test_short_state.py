"""Elements as unit quaternions with free entries beside: which groups, the motion, logarithms, and the pair 8(5,3) in these numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, logm

import lie_codegen as lc
from lie_codegen.flow import pair_single
from lie_codegen.flow.pair853 import integrate
from lie_codegen.flow.pair_system import System
from lie_codegen.flow.product_rate import short_rate
from lie_codegen.flow.short_state import ShortStates, short_state, short_states
from lie_codegen.groups.maps.carried_quaternions import QuaternionMatrix, rotation_matrix, spin_matrix
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.log_blocks import spin_log
from lie_codegen.groups.maps.rotation_log import rotation_log, short_arc
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.brackets import ad_star
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import matvec

OPS = FloatArithmetic()


def slanted(name: str) -> lc.MatrixGroup:
    """The group in another basis of its algebra."""
    group = lc.group(name)
    rows = {f"b{k}": {a: 1, b: 2} for k, (a, b) in enumerate(zip(group.labels, group.labels[1:], strict=False))}
    return lc.change_of_basis(group, {**rows, "last": {group.labels[-1]: 3}}, name=f"{name}_slanted")


def groups() -> list[lc.MatrixGroup]:
    so3 = lc.group("so3")
    return [
        so3, lc.group("su2"), lc.group("se3"), lc.group("se_2_3"), lc.product(so3, lc.group("se3"), name="so3_se3"),
        slanted("so3"), slanted("su2"), slanted("se3"),
    ]  # fmt: skip


def random_elements(group: lc.MatrixGroup, count: int, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [expm(group.hat(rng.normal(size=group.dim))) for _ in range(count)]


def as_lists(group: lc.MatrixGroup, X: np.ndarray) -> list[list[Any]]:
    return X.tolist() if group.is_complex else X.real.tolist()


def as_array(group: lc.MatrixGroup, X: Any) -> np.ndarray:
    if not group.is_complex:
        return np.array(X, dtype=float)
    return np.array([[complex(getattr(z, "re", z), getattr(z, "im", 0)) for z in row] for row in X])


def test_groups_of_rotations_and_free_entries_are_found_in_any_basis() -> None:
    counts = [(len(s.blocks), s.others) for s in map(short_state, groups()) if s is not None]
    assert counts == [(1, 0), (1, 0), (1, 3), (1, 6), (2, 3), (1, 0), (1, 0), (1, 3)]
    for name in ("se2", "so2", "sl2", "h3", "so4", "su3", "r3", "so31", "gl2"):
        assert short_state(lc.group(name)) is None
    assert short_states([]) is None
    assert short_states([lc.group("so3"), lc.group("h3")]) is None


def test_the_same_rotation_twice_is_not_free() -> None:
    """Two blocks that must stay equal: steps of each alone would part them."""
    basis = np.asarray(lc.group("so3").basis).real.astype(int)
    zero = np.zeros((3, 3), dtype=int)
    twice = [np.block([[A, zero], [zero, A]]) for A in basis]
    assert short_state(lc.from_matrices("so3_twice", ("a", "b", "c"), twice)) is None


@pytest.mark.parametrize("group", groups(), ids=lambda group: group.name)
def test_an_element_is_what_it_was_lifted_from(group: lc.MatrixGroup) -> None:
    states = short_states([group])
    assert states is not None
    for X in random_elements(group, 20):
        flat = states.lifted(OPS, [as_lists(group, X)])
        for k in range(states.quaternions):
            assert abs(np.linalg.norm(flat[4 * k : 4 * k + 4]) - 1) < 1e-13  # X as good as scipy's exponential
        [again] = states.elements(flat)
        np.testing.assert_allclose(as_array(group, again), X, rtol=0, atol=1e-13)


@pytest.mark.parametrize("group", groups(), ids=lambda group: group.name)
def test_the_numbers_move_as_the_element_does(group: lc.MatrixGroup) -> None:
    """X exp(h hat(xi)), lifted and differenced, against the rate."""
    states, rng, h = short_states([group]), np.random.default_rng(1), 1e-3
    assert states is not None
    for X in random_elements(group, 5, seed=2):
        xi = rng.normal(size=group.dim)
        y = np.array(states.lifted(OPS, [as_lists(group, X)]))
        rate = np.array(states.rates(OPS, list(y), states.elements(list(y)), [list(xi)]), dtype=float)
        near = [
            np.array(states.lifted(OPS, [as_lists(group, X @ expm(k * h * group.hat(xi)))])) for k in (-2, -1, 1, 2)
        ]
        for q in near:  # of q and -q that beside y
            for k in range(0, 4 * states.quaternions, 4):
                q[k : k + 4] *= np.sign(q[k : k + 4] @ y[k : k + 4])
        slope = (near[0] - 8 * near[1] + 8 * near[2] - near[3]) / (12 * h)
        np.testing.assert_allclose(rate, slope, rtol=0, atol=1e-9 * max(1.0, np.abs(slope).max()))


def test_the_angle_over_its_sine_is_exact_to_rounding() -> None:
    with mpmath.workdps(40):
        for c in [1.0, 1 - 1e-15, 1 - 1e-9, *np.linspace(0, 1, 203)[:-1].tolist()]:
            u = mpmath.mpf(1.0 - c)  # the rounded argument
            wanted = mpmath.mpf(1) if u == 0 else mpmath.acos(1 - u) / mpmath.sqrt(1 - (1 - u) ** 2)
            assert abs(short_arc(OPS, 1.0 - c) - wanted) <= 4e-16 * wanted


def test_logarithms_of_known_quaternions_are_those_of_their_matrices() -> None:
    rng = np.random.default_rng(3)
    for angle in [0.0, 1e-200, 1e-12, 1e-4, 0.3, 1.5, 3.0, np.pi - 1e-7, np.pi - 1e-12]:
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        theta = angle * axis
        q = [np.cos(angle / 2), *(np.sin(angle / 2) * axis)]
        for sign in (1, -1):
            known = [sign * c for c in q]
            R = rotation_matrix(known)
            found = rotation_log(OPS, QuaternionMatrix(R, {(0, 1, 2): known}))
            np.testing.assert_allclose(found, theta, rtol=0, atol=2e-15 * max(angle, 1e-300))
            if 1e-5 < angle < 3.1:
                S = np.array(logm(np.array(R))).real
                np.testing.assert_allclose(found, [S[2, 1], S[0, 2], S[1, 0]], rtol=0, atol=1e-11)
            spin = spin_log(OPS, spin_matrix(known))
            half = expm(-0.5j * sum(v * s for v, s in zip(spin, PAULI, strict=True)))
            np.testing.assert_allclose(
                half, sign * (q[0] * np.eye(2) - 1j * np.einsum("i,ijk", q[1:], PAULI)), atol=1e-14
            )


PAULI = np.array([[[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])


def test_a_half_turn_takes_the_way_that_its_matrix_does() -> None:
    states = short_states([lc.group("so3")])
    assert states is not None
    for diagonal in ([1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1]):
        X = np.diag(diagonal).tolist()
        [known] = states.elements(states.lifted(OPS, [X]))
        np.testing.assert_array_equal(rotation_log(OPS, known), rotation_log(OPS, X))
        np.testing.assert_allclose(rotation_log(OPS, known), np.pi * (np.array(diagonal) > 0), rtol=0, atol=1e-15)


def body(name: str) -> tuple[System, lc.MatrixGroup, ShortStates]:
    """J xi' = ad*_xi J xi - 2 Re of the first row of X but for its first entry - k xi: a law that reads X, J, its inverse and k as inputs."""
    group = lc.group(name)
    states = short_states([group])
    assert states is not None
    n, vectors, packed = group.dim, states.size, packed_size(group)

    def rate(ops: Any, y: Any, t: Any, J: Any, inverse: Any, k: Any) -> tuple[Any, ...]:
        def rates(t: Any, elements: Any, v: Any) -> tuple[Any, Any]:
            force = list(ad_star(ops, group.algebra, v, matvec(J, v)))
            pull = pack(group, elements[0])
            return [list(v)], matvec(
                inverse, [f - 2 * pull[i] - k * w for i, (f, w) in enumerate(zip(force, v, strict=True))]
            )

        return (short_rate(ops, states, y, rates, t),)

    def sampled(count: int) -> Any:
        return lambda rng: [rng.uniform(-1, 1) for _ in range(count)]

    eye = np.eye(n).tolist()
    library = lc.build(
        [
            Kernel(
                "rate", f"{name}_short", (
                    Port("y", (vectors + n,)), Port("t", ()), Port("J", (n, n)), Port("J_inverse", (n, n)), Port("k", ()),
                ), (Port("y_dot", (vectors + n,)),), rate, sampler=lambda rng: (sampled(vectors + n)(rng), 0.0, eye, eye, 1.0),
            ),
            Kernel(
                "express", f"{name}_short", (Port("y", (vectors,)),), (Port("X", (packed,)),),
                lambda ops, y: (pack(group, states.elements(y)[0]),), sampler=lambda rng: (sampled(vectors)(rng),),
            ),
            Kernel(
                "lift", f"{name}_short", (Port("X", (packed,)),), (Port("y", (vectors,)),),
                lambda ops, X: (states.lifted(ops, [unpack(group, X)]),),
                sampler=lambda rng: (pack(group, as_lists(group, np.eye(group.degree))),),
            ),
        ]
    )  # fmt: skip
    made = System(
        library.rate, library.express, states.size, float("inf"), lift=library.lift, quaternions=states.quaternions
    )
    return made, group, states


def numbered(system: System, J: np.ndarray, k: Any) -> System:
    return replace(system, numbers=(J, np.linalg.inv(J), np.asarray(k, dtype=float)))


def begun(group: lc.MatrixGroup, states: ShortStates, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    xi = np.atleast_2d(xi)
    X = np.array(pack(group, as_lists(group, np.eye(group.degree))), dtype=float)
    return np.repeat(X[None], len(xi), 0), np.hstack([np.zeros((len(xi), states.size)), xi])


def truth(
    group: lc.MatrixGroup, J: np.ndarray, xi: np.ndarray, times: np.ndarray, k: float
) -> tuple[np.ndarray, np.ndarray]:
    """DOP853 of scipy on the packed entries of X and xi; ad* from the structure constants."""
    inverse, c, packed = np.linalg.inv(J), group.algebra.structure_constants, packed_size(group)

    def rate(t: float, s: np.ndarray) -> np.ndarray:
        X, w = as_array(group, unpack(group, s[:packed].tolist())), s[packed:]
        force = np.einsum("i,ijk,k->j", w, c, J @ w) - 2 * s[: group.dim] - k * w
        moved = as_lists(group, X @ group.hat(w))
        return np.concatenate([np.array(pack(group, moved), dtype=float), inverse @ force])

    start = np.array(pack(group, as_lists(group, np.eye(group.degree))), dtype=float)
    run = solve_ivp(
        rate, (times[0], times[-1]), np.concatenate([start, xi]), method="DOP853", t_eval=times, rtol=1e-13, atol=1e-14
    )
    return run.y[:packed].T, run.y[packed:].T


@pytest.mark.parametrize("steady", [False, True], ids=["ends", "free"])
@pytest.mark.parametrize("name", ["so3", "su2", "se3"])
def test_the_tolerance_holds_at_the_times_and_within(name: str, steady: bool) -> None:
    """At times at which steps end, or that are interpolated; errors fall as the tolerance does, and the estimate covers them."""
    made, group, states = body(name)
    n = group.dim
    J, xi, times = np.diag(np.arange(1.0, n + 1)) + 0.1, np.linspace(0.3, 1.1, n), np.linspace(0, 3, 151)
    system = replace(numbered(made, J, 1.0), steady=steady)
    X, w = truth(group, J, xi, times, 1.0)
    scale = max(1.0, np.max(np.abs(X)), np.max(np.abs(w)))
    for rtol in (1e-5, 1e-7, 1e-9, 1e-11):
        run = integrate(system, *begun(group, states, xi), times, rtol=rtol, atol=0.0, where="test")
        off = max(np.max(np.abs(run.X[:, 0] - X)), np.max(np.abs(run.y[:, 0, -n:] - w)))
        assert off <= run.error_estimate + 1e-12 * scale
        assert run.error_estimate <= rtol * scale
        assert not steady or run.steps < 120
        inside = np.sort(np.random.default_rng(1).uniform(0, 3, 20))
        at, v = run.at(system, inside)
        X_in, w_in = truth(group, J, xi, np.concatenate([[0.0], inside]), 1.0)
        assert np.max(np.abs(at - X_in[1:])) <= 3 * rtol * scale + 1e-12
        assert np.max(np.abs(v[:, -n:] - w_in[1:])) <= 3 * rtol * scale + 1e-12


def test_runs_in_blocks_and_in_one_call_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    made, group, states = body("so3")
    system, times = replace(numbered(made, np.diag([1.0, 2.0, 3.0]), 1.0), steady=True), np.linspace(0, 20, 301)
    whole = integrate(system, *begun(group, states, np.ones(3)), times, rtol=1e-9, atol=0.0, where="test")
    monkeypatch.setattr(pair_single, "FIRST_STEPS", 3)
    monkeypatch.setattr(pair_single, "STEPS", 5)
    parts = integrate(system, *begun(group, states, np.ones(3)), times, rtol=1e-9, atol=0.0, where="test")
    assert whole.steps == parts.steps
    np.testing.assert_allclose(parts.X, whole.X, rtol=0, atol=1e-13)
    assert parts.error_estimate == pytest.approx(whole.error_estimate, rel=1e-3)


@pytest.mark.parametrize("name", ["so3", "su2", "se3"])
@pytest.mark.parametrize("count", [3, 65])
def test_members_on_lanes_go_as_they_would_alone(name: str, count: int) -> None:
    made, group, states = body(name)
    n, rng = group.dim, np.random.default_rng(count)
    J = np.array([np.diag(row) for row in rng.uniform(1, 2, (count, n))])
    k, xi, times = (
        rng.uniform(0.5, 2, count),
        0.5 * rng.normal(size=(count, n)),
        np.array([0.0, 0.05, 0.9, 1.0, 3.0]),
    )
    whole, start = numbered(made, J, k), begun(group, states, xi)
    together = integrate(whole, *start, times, rtol=1e-9, atol=0.0, where="test", threads=2)
    assert np.max(np.abs(np.linalg.norm(together.y[1:, :, :4], axis=-1) - 1)) < 4e-16
    for m in range(0, count, 16):
        X, w = truth(group, J[m], xi[m], times, float(k[m]))
        scale = max(1.0, np.max(np.abs(X)), np.max(np.abs(w)))
        assert np.max(np.abs(together.X[:, m] - X)) <= 1e-9 * scale
        assert np.max(np.abs(together.y[:, m, -n:] - w)) <= 1e-9 * scale


def test_knots_of_files_with_matrices_give_the_states_between() -> None:
    made, group, states = body("so3")
    system = numbered(made, np.diag([1.0, 2.0, 3.0]), 1.0)
    run = integrate(system, *begun(group, states, np.ones(3)), np.linspace(0, 3, 4), rtol=1e-9, atol=0.0, where="test")
    X = np.array([pack(group, states.elements(list(y))[0]) for y in run.knot_y])
    knots = np.hstack([run.knots[:, :2], X, np.zeros((len(X), 3)), run.knot_y[:, -3:]])
    older = run._replace(y=np.empty((0, 1, 6)), knots=knots)
    for mine, theirs in zip(run.at(system, np.array([0.3, 1.7])), older.at(system, np.array([0.3, 1.7])), strict=True):
        np.testing.assert_allclose(theirs[..., -3:], mine[..., -3:], rtol=0, atol=1e-13)
