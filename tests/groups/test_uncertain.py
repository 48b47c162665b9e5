"""Means, interpolation, covariances and fusion, against quadrature, sampling, ODE solvers and definitions."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from generators import haar_rotation

import lie_codegen as lc
from lie_codegen.errors import ComputationError, InputError, NotFiniteError, NotOnGroupError, ShapeError, SpreadWarning
from lie_codegen.groups.maps.covariance_kernels import covariance_kernels

GROUPS = ["so3", "se3", "se2", "sl2", "su2", "su3", "so31", "h3", "sim2", "osc4"]


def element(group, x):
    return scipy.linalg.expm(group.hat(x))


def logarithm(group, X):
    """By scipy: for elements near the identity."""
    return group.project(scipy.linalg.logm(X))


def cloud(group, rng, count, reach):
    return np.array(
        [element(group, reach * x / np.linalg.norm(x) * rng.uniform()) for x in rng.normal(size=(count, group.dim))]
    )


@pytest.mark.parametrize("name", GROUPS)
def test_the_mean_is_the_zero_of_the_mean_logarithm_and_bi_invariant(name):
    group, rng = lc.group(name), np.random.default_rng(3)
    Xs = cloud(group, rng, 7, 0.6)
    w = rng.uniform(0.2, 1, 7)
    found = lc.mean(group, Xs, weights=w)
    pull = sum(wi * logarithm(group, np.linalg.inv(found.X) @ X) for wi, X in zip(w, Xs, strict=True))
    assert np.max(np.abs(pull)) < 1e-12
    assert found.residual < 1e-12
    L, R = element(group, 0.4 * rng.normal(size=group.dim)), element(group, 0.4 * rng.normal(size=group.dim))
    moved = lc.mean(group, L @ Xs @ R, weights=w)
    np.testing.assert_allclose(moved.X, L @ found.X @ R, atol=1e-12)
    backwards = lc.mean(group, np.linalg.inv(Xs), weights=w)
    np.testing.assert_allclose(backwards.X, np.linalg.inv(found.X), atol=1e-12)


def test_data_wider_than_a_half_turn_have_no_mean():
    so3 = lc.group("so3")
    circle = [element(so3, [0, 0, 2 * np.pi * k / 3]) for k in range(3)]
    with pytest.raises(ComputationError, match="wider than a half turn"):
        lc.mean(so3, circle)
    with pytest.raises(NotOnGroupError, match=r"Xs\[1\].*X\^T X - 1"):
        lc.mean(so3, [np.eye(3), 1.1 * np.eye(3)])
    with pytest.raises(InputError, match="weights"):
        lc.mean(so3, [np.eye(3)], weights=[-1.0])
    with pytest.raises(ShapeError):
        lc.mean(so3, [])


@pytest.mark.parametrize("name", GROUPS)
def test_interpolation_is_the_one_parameter_group_between(name):
    group, rng = lc.group(name), np.random.default_rng(5)
    X, x = element(group, rng.normal(size=group.dim)), 0.7 * rng.normal(size=group.dim)
    Y = X @ element(group, x)
    s = np.array([0.0, 0.25, 1.0, 1.5])
    path = lc.interpolate(name, X, Y, s)
    for part, at in zip(s, path, strict=True):
        np.testing.assert_allclose(at, X @ element(group, part * x), atol=1e-11)
    np.testing.assert_array_equal(lc.interpolate(group, X, Y, 0.25), path[1])


@pytest.mark.parametrize(("name", "slopes"), [("se2", (4, 6)), ("so3", (4, 6)), ("sl2", (4, 6))])
def test_compounds_err_with_the_fourth_and_sixth_power_of_the_deviation(name, slopes):
    """Moments of log(X2^-1 exp(a) X2 exp(b)) by Gauss-Hermite quadrature, at two scales."""
    group, rng = lc.group(name), np.random.default_rng(2)
    n = group.dim
    A, B = rng.normal(size=(2, n, n))
    shape1, shape2 = A @ A.T / n, B @ B.T / n
    X2 = element(group, 0.8 * rng.normal(size=n))
    lib = lc.build(group)
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    weights = weights / weights.sum()
    grid = np.array(list(itertools.product(range(5), repeat=2 * n)))
    z, w = nodes[grid], np.prod(weights[grid], axis=1)
    errors = {2: [], 4: []}
    for size in (0.16, 0.08):
        S1, S2 = size**2 * shape1, size**2 * shape2
        a = z[:, :n] @ np.linalg.cholesky(S1).T
        b = z[:, n:] @ np.linalg.cholesky(S2).T
        Z = np.linalg.inv(X2) @ lib.exp.batch(a) @ X2 @ lib.exp.batch(b)
        xi = lib.log.batch(np.ascontiguousarray(Z))
        exact = np.einsum("k,ki,kj->ij", w, xi, xi)
        first, second = lc.Uncertain(group, np.eye(group.degree), S1), lc.Uncertain(group, X2, S2)
        for order in errors:
            found = first.compound(second, order=order)
            errors[order].append(np.max(np.abs(found.covariance - exact)))
            if order == 4:
                mean = w @ xi
                # of fourth order itself, right to the sixth
                assert np.max(np.abs(found.mean_shift - mean)) < 0.1 * np.max(np.abs(mean))
    for order, slope in zip((2, 4), slopes, strict=True):
        assert np.log2(errors[order][0] / errors[order][1]) == pytest.approx(slope, abs=0.25)


def test_published_compound_of_isotropic_rotations():
    first = lc.Uncertain("so3", np.eye(3), 0.09 * np.eye(3))
    found = first.compound(first)
    np.testing.assert_allclose(found.covariance, (2 * 0.09 - 0.3**4 / 6) * np.eye(3), atol=1e-15)
    assert found.covariance[0, 0] == pytest.approx(0.17865, abs=1e-12)


def test_the_fourth_order_is_exact_on_the_heisenberg_group():
    """log(exp a exp b) = a + b + [a, b]/2, a polynomial: its moments are exact by products of moments."""
    h3, rng = lc.group("h3"), np.random.default_rng(8)
    A, B = rng.normal(size=(2, 3, 3))
    S1, S2 = A @ A.T, B @ B.T
    found = lc.Uncertain(h3, np.eye(h3.degree), S1).compound(lc.Uncertain(h3, np.eye(h3.degree), S2))
    nodes, weights = np.polynomial.hermite_e.hermegauss(4)
    weights = weights / weights.sum()
    grid = np.array(list(itertools.product(range(4), repeat=6)))
    z, w = nodes[grid], np.prod(weights[grid], axis=1)
    a, b = z[:, :3] @ np.linalg.cholesky(S1).T, z[:, 3:] @ np.linalg.cholesky(S2).T
    commutator = np.array(
        [h3.project(h3.hat(x) @ h3.hat(y) - h3.hat(y) @ h3.hat(x)) for x, y in zip(a, b, strict=True)]
    )
    xi = a + b + commutator / 2
    np.testing.assert_allclose(found.covariance, np.einsum("k,ki,kj->ij", w, xi, xi), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.mean_shift, 0, atol=1e-15)


@pytest.mark.parametrize("name", ["so3", "se3", "sl2", "su3"])
def test_inverse_and_between_transport_the_covariance(name):
    group, rng = lc.group(name), np.random.default_rng(4)
    n = group.dim
    A = rng.normal(size=(n, n))
    X, xi = element(group, 0.6 * rng.normal(size=n)), 1e-5 * rng.normal(size=n)
    estimate = lc.Uncertain(group, X, 1e-4 * A @ A.T)
    Ad = np.column_stack([group.vee(X @ group.hat(e) @ np.linalg.inv(X)) for e in np.eye(n)])
    np.testing.assert_allclose(estimate.inverse().covariance, Ad @ estimate.covariance @ Ad.T, rtol=1e-10, atol=1e-16)
    # (X exp xi)^-1 = X^-1 exp(-Ad_X xi), to the second order in xi
    np.testing.assert_allclose(
        np.linalg.inv(X @ element(group, xi)), np.linalg.inv(X) @ element(group, -Ad @ xi), atol=1e-8
    )
    assert np.max(np.abs(estimate.between(estimate).X - np.eye(group.degree))) < 1e-12


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "sl2", "se2"])
def test_covariance_along_a_flow_solves_its_equation(name):
    group, rng = lc.group(name), np.random.default_rng(6)
    n = group.dim
    u, A, B = rng.normal(size=n), rng.normal(size=(n, n)), rng.normal(size=(n, n))
    S, Q = 1e-3 * A @ A.T, 1e-3 * B @ B.T
    ad = np.column_stack([group.vee(group.hat(u) @ group.hat(e) - group.hat(e) @ group.hat(u)) for e in np.eye(n)])

    def rate(t, flat):
        P = flat.reshape(n, n)
        return (-ad @ P - P @ ad.T + Q).ravel()

    run = scipy.integrate.solve_ivp(rate, (0, 1.7), S.ravel(), method="DOP853", rtol=1e-12, atol=1e-16)
    found = lc.Uncertain(group, np.eye(group.degree), S).flow(u, duration=1.7, noise=Q)
    np.testing.assert_allclose(found.covariance, run.y[:, -1].reshape(n, n), rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(found.X, element(group, 1.7 * u), atol=1e-12)


def test_fused_estimates_minimise_the_weighted_squares():
    group, rng = lc.group("se3"), np.random.default_rng(9)
    truth = element(group, rng.normal(size=6))
    estimates = []
    for _ in range(3):
        A = rng.normal(size=(6, 6))
        estimates.append(
            lc.Uncertain(group, truth @ element(group, 0.1 * rng.normal(size=6)), 1e-2 * (A @ A.T + np.eye(6)))
        )
    found = lc.fuse(estimates)

    def cost(d):
        Y = found.X @ element(group, d)
        errors = [logarithm(group, np.linalg.solve(each.X, Y)) for each in estimates]
        return sum(e @ np.linalg.solve(each.covariance, e) for e, each in zip(errors, estimates, strict=True))

    h = 1e-4
    gradient = [(cost(h * e) - cost(-h * e)) / (2 * h) for e in np.eye(6)]
    assert np.max(np.abs(gradient)) < 1e-5
    one = lc.fuse(estimates[:1])
    np.testing.assert_allclose(one.covariance, estimates[0].covariance, rtol=1e-9)
    with pytest.raises(InputError, match="singular"):
        lc.fuse([lc.Uncertain(group, truth, np.zeros((6, 6)))])


def test_uncertain_elements_are_values_and_refuse_what_is_none():
    a = lc.Uncertain("so3", haar_rotation(3, np.random.default_rng(0)), 0.01 * np.eye(3))
    assert a == pickle.loads(pickle.dumps(a))
    assert hash(a) == hash(pickle.loads(pickle.dumps(a)))
    assert a != a.inverse()
    assert len(repr(a).splitlines()) <= 10
    np.testing.assert_array_equal(a.samples(4, seed=1), a.samples(4, seed=1))
    with pytest.raises(InputError, match="not symmetric"):
        lc.Uncertain("so3", np.eye(3), [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]])
    with pytest.raises(InputError, match="negative eigenvalue"):
        lc.Uncertain("so3", np.eye(3), np.diag([1, 1, -1]))
    with pytest.warns(SpreadWarning, match="half turn"):
        lc.Uncertain("so3", np.eye(3), 2 * np.eye(3))


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "h3"])
def test_the_kernels_agree_with_the_methods(name):
    group, rng = lc.group(name), np.random.default_rng(11)
    n = group.dim
    lib = lc.build(covariance_kernels(group))
    A, B, C = rng.normal(size=(3, n, n))
    S1, S2, Q = 0.01 * A @ A.T, 0.01 * B @ B.T, 0.01 * C @ C.T
    X1, X2, u = element(group, 0.5 * rng.normal(size=n)), element(group, 0.5 * rng.normal(size=n)), rng.normal(size=n)
    first, second = lc.Uncertain(group, X1, S1), lc.Uncertain(group, X2, S2)
    both = first.compound(second)
    made = lib.compound(X1, S1, X2, S2)
    np.testing.assert_allclose(made.X, both.X, atol=1e-13)
    np.testing.assert_allclose(made.S, both.covariance, atol=1e-14)
    np.testing.assert_allclose(made.mean_shift, both.mean_shift, atol=1e-15)
    back = lib.inverse_covariance(X1, S1)
    np.testing.assert_allclose(back.S_inverse, first.inverse().covariance, atol=1e-14)
    moved = lib.flow_covariance(X1, S1, u, 1.3, Q)
    flown = first.flow(u, duration=1.3, noise=Q)
    np.testing.assert_allclose(moved.S_end, flown.covariance, atol=1e-13)
    np.testing.assert_allclose(moved.Y, flown.X, atol=1e-13)
    np.testing.assert_allclose(lib.mean_term(X1, X2), logarithm(group, np.linalg.solve(X1, X2)), atol=1e-12)
    W = np.linalg.inv(S2 + 0.01 * np.eye(n))
    term = lib.fuse_term(X1, X2, W)
    e = logarithm(group, np.linalg.solve(X2, X1))
    h = 1e-5
    J = np.column_stack(
        [
            (
                logarithm(group, np.linalg.solve(X2, X1 @ element(group, h * d)))
                - logarithm(group, np.linalg.solve(X2, X1 @ element(group, -h * d)))
            )
            / (2 * h)
            for d in np.eye(n)
        ]
    )
    np.testing.assert_allclose(term.slope, J.T @ W @ e, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(term.normal, J.T @ W @ J, rtol=1e-6, atol=1e-5)


def test_the_mean_is_nobodys_memory_and_names_the_element_that_is_off():
    one = np.eye(3)[None].copy()
    found = lc.mean("so3", one)
    one[:] = 7.0
    np.testing.assert_array_equal(found.X, np.eye(3))
    several = np.repeat(np.eye(3)[None], 4, axis=0)
    several[2, 0, 0] = 2.0
    with pytest.raises(NotOnGroupError, match=r"mean: Xs\[2\]"):
        lc.mean("so3", several)
    several[2, 0, 0] = np.nan
    with pytest.raises(NotFiniteError, match=r"mean: Xs\[2\]"):
        lc.mean("so3", several)
