"""Every group of the catalogue against the axioms, scipy's expm and finite differences: at the identity, near it, near the
cut of the logarithm, and at random. A new group is picked up by its file alone."""

from __future__ import annotations

import zlib
from functools import cache

import numpy as np
import pytest
import scipy.linalg
from kernel_calls import adjoint_matrix, call, kernel, load

import lie_codegen as lc
from lie_codegen.groups.maps.log_structure import log_structure

GROUPS = lc.group_names()
WHERE = ("identity", "1e-8", "1e-4", "random", "large", "cut")


@cache
def points(name: str, where: str, count: int = 2) -> tuple[np.ndarray, ...]:
    """Seeded vectors of the given size; near the cut the largest eigenvalue of hat(x) has modulus 3.1.

    Where the logarithm knows the group's blocks it is right up to the cut; elsewhere digits go towards it.
    """
    group = load(name)
    rng = np.random.default_rng(zlib.crc32(f"{name} {where}".encode()))
    result = []
    for _ in range(count):
        x = rng.normal(size=group.dim)
        radius = float(np.max(np.abs(np.linalg.eigvals(group.hat(x)))))
        if where == "cut":
            x *= (3.1 if log_structure(group) is not None else 2.8) / radius if radius > 1e-9 else 3.0
        else:
            x *= {"identity": 0.0, "1e-8": 1e-8, "1e-4": 1e-4, "random": 1.0, "large": 2.0}[where] / np.linalg.norm(x)
        result.append(x)
    return tuple(result)


def cases() -> pytest.MarkDecorator:
    return pytest.mark.parametrize(("name", "where"), [(name, where) for name in GROUPS for where in WHERE])


def assert_close(actual: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Relative to the largest entry, and never better than to 1."""
    assert np.all(np.isfinite(actual))
    scale = max(1.0, float(np.max(np.abs(expected), initial=0.0)))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


@cases()
def test_exp_is_the_matrix_exponential_and_log_inverts_it(name: str, where: str) -> None:
    group = load(name)
    for x in points(name, where):
        X = call(name, "exp", x)
        assert_close(X, scipy.linalg.expm(group.hat(x)), 1e-13)
        back = call(name, "log", X)
        # Without blocks of its own the logarithm works with (X + X^{-1})/2, and loses what that rounds away.
        known = log_structure(group) is not None
        assert_close(call(name, "exp", back), X, 1e-13 * (1.0 if known else float(np.linalg.norm(X, 2))))
        # The logarithm amplifies a rounding of X by the inverse of the differential of exp.
        amplification = (
            np.linalg.norm(call(name, "rjac_inv", x), 2)
            * np.linalg.norm(X, 2)
            * np.linalg.norm(call(name, "inverse", X), 2)
        )
        assert_close(back, x, 2e-14 * max(1.0, amplification))


@cases()
def test_group_axioms(name: str, where: str) -> None:
    group = load(name)
    eye = np.eye(group.degree)
    x, y = points(name, where)
    [z] = points(name, "random", 1)
    X, Y, Z = (call(name, "exp", v) for v in (x, y, z))
    scale = 1e-13 * float(np.linalg.norm(X, 2) * np.linalg.norm(Y, 2))
    inverse = call(name, "inverse", X)
    assert_close(call(name, "compose", X, inverse), eye, scale)
    assert_close(call(name, "compose", inverse, X), eye, scale)
    assert_close(inverse, call(name, "exp", -x), scale)
    assert_close(call(name, "compose", X, eye), X, 1e-15)
    assert_close(call(name, "compose", X, Y), X @ Y, scale)
    left = call(name, "compose", call(name, "compose", X, Y), Z)
    assert_close(left, call(name, "compose", X, call(name, "compose", Y, Z)), scale)


@cases()
def test_Ad_is_a_homomorphism_and_the_exponential_of_ad(name: str, where: str) -> None:
    group = load(name)
    x, y = points(name, where)
    X, Y = call(name, "exp", x), call(name, "exp", y)
    Ad_X, Ad_Y = call(name, "Ad", X), call(name, "Ad", Y)
    tolerance = 1e-13 * float(np.linalg.norm(Ad_X, 2) * np.linalg.norm(Ad_Y, 2))
    assert_close(call(name, "Ad", X @ Y), Ad_X @ Ad_Y, tolerance)
    assert_close(call(name, "ad", x), adjoint_matrix(group, x), 1e-14)
    assert_close(Ad_X, scipy.linalg.expm(adjoint_matrix(group, x)), tolerance)
    assert_close(group.hat(Ad_X @ y), X @ group.hat(y) @ np.linalg.inv(X), tolerance)


@cases()
def test_Jacobians(name: str, where: str) -> None:
    group = load(name)
    n = group.dim
    for x in points(name, where):
        left, right = call(name, "ljac", x), call(name, "rjac", x)
        ad = adjoint_matrix(group, x)
        series = scipy.linalg.expm(np.block([[ad, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:]
        assert_close(left, series, 2e-13)
        assert_close(left, call(name, "Ad", call(name, "exp", x)) @ right, 2e-13)
        for J, J_inverse in ((left, call(name, "ljac_inv", x)), (right, call(name, "rjac_inv", x))):
            condition = np.linalg.norm(J, 2) * np.linalg.norm(J_inverse, 2)
            assert_close(J @ J_inverse, np.eye(n), 2e-14 * condition)


@pytest.mark.parametrize("name", GROUPS)
def test_Jacobians_against_differences_of_exp(name: str) -> None:
    group = load(name)
    h = 1e-5
    for where in ("1e-4", "random"):
        x, v = points(name, where)
        v = v / np.linalg.norm(v)
        moved = [call(name, "exp", x + s * h * v) for s in (1, -1)]
        X_inverse = call(name, "inverse", call(name, "exp", x))
        difference = (moved[0] - moved[1]) / (2 * h)
        assert_close(call(name, "ljac", x) @ v, group.project(difference @ X_inverse), 1e-8)
        assert_close(call(name, "rjac", x) @ v, group.project(X_inverse @ difference), 1e-8)


@pytest.mark.parametrize("name", GROUPS)
def test_brackets_are_commutators(name: str) -> None:
    group = load(name)
    x, y = points(name, "random")
    X, Y = group.hat(x), group.hat(y)
    assert_close(group.hat(call(name, "bracket", x, y)), X @ Y - Y @ X, 1e-14)
    assert_close(call(name, "ad", x) @ y, call(name, "bracket", x, y), 1e-14)


@pytest.mark.parametrize("name", GROUPS)
def test_Wei_Norman_kernels_move_the_group_at_the_commanded_velocity(name: str) -> None:
    group = load(name)
    h = 1e-5
    g, u = 0.3 * points(name, "random")[0], points(name, "random")[1]
    expected = np.eye(group.degree)
    for value, A in zip(g, group.basis, strict=True):
        expected = expected @ scipy.linalg.expm(value * A)
    X = call(name, "product_exp", g)
    assert_close(X, expected, 1e-13)
    g_dot = call(name, "wei_norman_rate", g, u)
    assert_close(call(name, "wei_norman_matrix", g) @ u, g_dot, 1e-13)
    difference = (call(name, "product_exp", g + h * g_dot) - call(name, "product_exp", g - h * g_dot)) / (2 * h)
    assert_close(difference, X @ group.hat(u), 1e-8)


@pytest.mark.parametrize("name", GROUPS)
def test_samples_lie_on_the_group_and_in_the_domain_of_log(name: str) -> None:
    import random

    from lie_codegen.kernel.complex_scalar import Complex

    rng = random.Random(5)
    for _ in range(5):
        [sample] = kernel(name, "log").sample(rng)
        X = np.array([[Complex.of(z).re + 1j * Complex.of(z).im for z in row] for row in sample])
        X = X if load(name).is_complex else X.real
        assert_close(call(name, "exp", call(name, "log", X)), X, 1e-12)
