"""The bracket of polynomial fields, against SymPy in coordinates and against flows; advected vectors against matrices."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.mechanics.advected import advected_vectors
from lie_codegen.mechanics.polynomial_fields import FieldSpace
from lie_codegen.mechanics.polynomial_kernels import evaluate


def random_field(space, rng, terms=7):
    rows = []
    for _ in range(terms):
        exponents = rng.multinomial(rng.integers(0, 3), np.ones(space.variables) / space.variables)
        rows.append((int(rng.integers(2 * space.dim)), exponents, float(rng.normal())))
    unique = {(c, tuple(e)): v for c, e, v in rows}
    return space.field((c, e, v) for (c, e), v in unique.items())


CASES = [
    ("so3", {"G": ("direction", (0, 0, 1))}),
    ("se2", {"P": ("point", (0.3, -0.2)), "D": ("direction", (1, 2))}),
    ("se3", {"m": ("momentum", (1, 2, 3, 4, 5, 6))}),
    ("sl2", {"G": ("direction", (1, 0)), "a": ("adjoint", (1, 2, 3))}),
    ("su2", {"B": ("direction", (0, 0, 1))}),
    ("h3", {}),
]


def space_of(group, vectors):
    matrices = [v.matrices for v in vectors]
    k = sum(v.size for v in vectors)
    rho, r, first = np.zeros((group.dim, k, k)), np.zeros((group.dim, k)), 0
    for (one, other), v in zip(matrices, vectors, strict=True):
        here = slice(first, first + v.size)
        rho[:, here, here], r[:, here] = one, other
        first += v.size
    return FieldSpace(group.algebra.structure_constants, rho, r, 12, 2 * np.pi)


@pytest.mark.parametrize(("name", "advected"), CASES)
def test_advected_vectors_move_as_the_matrices_say(name, advected):
    group = lc.group(name)
    rng = np.random.default_rng(1)
    X, alpha, h = expm(group.hat(0.4 * rng.normal(size=group.dim))), rng.normal(size=group.dim), 1e-5
    for vector in advected_vectors(group, advected):
        rho, r = vector.matrices
        numeric = (vector.seen(X @ expm(h * group.hat(alpha))) - vector.seen(X @ expm(-h * group.hat(alpha)))) / (2 * h)
        gamma = vector.seen(X)
        expected = -(np.einsum("i,iab,b->a", alpha, rho, gamma) + alpha @ r)
        np.testing.assert_allclose(numeric, expected, atol=1e-8)
        np.testing.assert_allclose(vector.seen(np.eye(group.degree)), np.asarray(advected[vector.name][1]), atol=1e-14)


@pytest.mark.parametrize(("name", "advected"), CASES)
def test_bracket_in_coordinates_and_jacobi(name, advected):
    """(xi, Gamma) under a field is an honest vector field, and V -> that field is a homomorphism: SymPy's bracket is the oracle."""
    group = lc.group(name)
    space, rng = space_of(group, advected_vectors(group, advected)), np.random.default_rng(2)
    n, s = group.dim, sp.symbols(f"s0:{space.variables}")

    def formulas(field):
        total = [sp.S.Zero] * (2 * n)
        for e, c, v in zip(
            space.exponents(field.codes), space.components(field.codes), field.values[:, 0], strict=True
        ):
            total[c] += sp.Float(v) * sp.prod(x ** int(k) for x, k in zip(s, e, strict=True))
        alpha, gamma = total[:n], s[n:]
        rates = [
            -sum(
                alpha[i] * (sum(space.advection[i, a, b] * g for b, g in enumerate(gamma)) + space.offset[i, a])
                for i in range(n)
            )
            for a in range(len(gamma))
        ]
        return sp.Matrix([*total[n:], *rates]), sp.Matrix(total[:n])

    V, W, Z = (random_field(space, rng) for _ in range(3))
    (v, av), (w, aw) = formulas(V), formulas(W)
    got, alpha = formulas(space.bracket(V, W))
    c = group.algebra.structure_constants
    turned = sp.Matrix([sum(c[i, j, k] * av[i] * aw[j] for i in range(n) for j in range(n)) for k in range(n)])
    expected = w.jacobian(s) * v - v.jacobian(s) * w
    point = dict(zip(s, rng.normal(size=len(s)), strict=True))
    difference = np.array((got - expected).subs(point).evalf().tolist(), dtype=float)
    assert np.abs(difference).max() < 1e-11
    moved = aw.jacobian(s) * v - av.jacobian(s) * w + turned
    assert np.abs(np.array((alpha - moved).subs(point).evalf().tolist(), dtype=float)).max() < 1e-11
    cyclic = space.combine(
        [(1, space.bracket(a, space.bracket(b, d))) for a, b, d in ((V, W, Z), (W, Z, V), (Z, V, W))]
    )
    assert np.abs(evaluate(space, cyclic, rng.normal(size=space.variables))).max() < 1e-10


def test_means_of_products_are_products_at_nodes():
    group = lc.group("so3")
    space, rng = space_of(group, advected_vectors(group, {"G": ("direction", (0, 0, 1))})), np.random.default_rng(3)
    times = np.arange(9) * 2 * np.pi / 9
    V, W = random_field(space, rng), random_field(space, rng)
    moving = [type(f)(f.codes, f.values * wave) for f, wave in ((V, np.cos(times)), (W, 1 + np.cos(times)))]
    mean = space.bracket(*moving, mean_only=True)
    state = rng.normal(size=space.variables)
    np.testing.assert_allclose(
        evaluate(space, mean, state), evaluate(space, space.bracket(V, W), state) / 2, atol=1e-13
    )
    whole = space.mean(space.bracket(*moving))
    np.testing.assert_allclose(evaluate(space, whole, state), evaluate(space, mean, state), atol=1e-13)
