"""The short form of the Taylor polynomial is the polynomial, on every group that has one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.groups.maps.rkmk import TAYLOR_DEGREE, hat_body, rkmk4_step
from lie_codegen.groups.maps.short_exponential import short_pattern, times_short_exp
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import find_compilers

#: How many products of matrices the exponential takes instead of twelve.
PRODUCTS = {"so3": 2, "se3": 3, "se2": 2, "su2": 1, "sl2": 1, "so2": 1, "h3": 2, "h5": 2, "engel": 3, "r3": 1, "osc4": 3,
            "se_2_3": 3, "sgal3": 4}  # fmt: skip


def plain(entries: object) -> np.ndarray:
    rows = [[complex(e.re, e.im) if isinstance(e, Complex) else e for e in row] for row in entries]  # type: ignore[attr-defined]
    return np.array(rows, dtype=complex)


@pytest.mark.parametrize("name", lc.group_names())
def test_which_groups_have_one(name: str) -> None:
    pattern = short_pattern(lc.group(name))
    found = None if pattern is None else pattern.zeros + (1 if pattern.form is not None else -1)
    assert found == PRODUCTS.get(name)


@pytest.mark.parametrize("name", PRODUCTS)
@pytest.mark.parametrize("degree", [5, 6, 7, 12])
def test_it_is_the_polynomial_cut_at_the_degree(name: str, degree: int) -> None:
    group, rng = lc.group(name), np.random.default_rng(degree)
    pattern, ops = short_pattern(group), FloatArithmetic()
    assert pattern is not None
    x = rng.uniform(-1, 1, group.dim)
    A = group.hat(x)
    wanted, term = np.eye(group.degree), np.eye(group.degree)
    for order in range(1, degree + 1):
        term = term @ A / order
        wanted = wanted + term
    X = rng.normal(size=(group.degree, group.degree))
    got = times_short_exp(ops, pattern, X.tolist(), hat_body(group, ops, list(x)), list(x), degree)
    np.testing.assert_allclose(plain(got), X @ wanted, rtol=0, atol=1e-14 * np.abs(X @ wanted).max() * 4)
    small = hat_body(group, ops, list(0.2 * x / np.linalg.norm(x)))
    got = times_short_exp(ops, pattern, X.tolist(), small, list(0.2 * x / np.linalg.norm(x)), TAYLOR_DEGREE)
    np.testing.assert_allclose(plain(got), X @ expm(0.2 * A / np.linalg.norm(x)), rtol=0, atol=4e-15 * np.abs(X).max())


def test_a_step_is_half_as_long_as_it_was() -> None:
    """600 and 1,500 instructions with twelve products."""
    assert function_of(rkmk4_step(lc.group("so3"))).expand().n_instructions() < 320
    assert function_of(rkmk4_step(lc.group("se3"))).expand().n_instructions() < 700


@pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")
@pytest.mark.parametrize("name", ["so3", "su2", "se3"])
def test_a_million_steps_stay_on_the_group(name: str) -> None:
    """A constant velocity, for which every step rounds alike: nothing gathers."""
    group = lc.group(name)
    u = np.linspace(0.1, 0.3, group.dim)
    kind = complex if group.is_complex else float
    step = build_kernels(lambda: [rkmk4_step(group)]).rkmk4_step
    start = np.eye(group.degree, dtype=kind)
    X = step.scan(start, u, u, u, 1e-3, n=10**6, every=10**6)[-1]
    R = X[:3, :3] if name == "se3" else X
    assert np.max(np.abs(R.conj().T @ R - np.eye(len(R)))) < 3e-13
