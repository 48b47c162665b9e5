"""Inverses of many symmetric positive definite matrices: those of LAPACK, and no verdict where eigenvalues have to say it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.control.positive_batch import clear_inverses
from lie_codegen.errors import InputError


def spread(n: int, least: float, count: int = 50, seed: int = 0) -> Any:
    """(count, n, n) matrices with eigenvalues between `least` and 1, symmetric to the last bit."""
    rng = np.random.default_rng(seed)
    turns = np.linalg.qr(rng.normal(size=(count, n, n)))[0]
    values = rng.uniform(max(least, 0.1), 1, (count, n))
    values[:, 0] = least
    found = np.einsum("kia,ka,kja->kij", turns, values, turns)
    return (found + np.swapaxes(found, 1, 2)) / 2


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_the_inverses_are_those_of_lapack(n: int) -> None:
    matrices = spread(n, 1e-3)
    found = clear_inverses(matrices)
    assert found is not None
    np.testing.assert_allclose(found, np.linalg.inv(matrices), rtol=0, atol=1e-12 / 1e-3)
    np.testing.assert_array_equal(found, np.swapaxes(found, 1, 2))


@pytest.mark.parametrize("least", [1e-13, 0.0, -1e-13, -0.5])
@pytest.mark.parametrize("n", [2, 3, 6])
def test_one_that_is_not_clearly_positive_leaves_the_verdict_to_eigenvalues(n: int, least: float) -> None:
    matrices = spread(n, 0.2)
    matrices[7] = spread(n, least, 1, seed=1)[0]
    assert clear_inverses(matrices) is None


@pytest.mark.parametrize("entry", [np.nan, np.inf, 1e200])
def test_what_leaves_the_range_is_not_clear(entry: float) -> None:
    matrices = spread(3, 0.2)
    matrices[3, 0, 0] = entry
    assert clear_inverses(matrices) is None


def test_two_negative_eigenvalues_do_not_pass_for_a_positive_determinant() -> None:
    matrices = np.stack([np.eye(3), np.diag([-1.0, -1.0, 5.0])])
    assert clear_inverses(matrices) is None


def loops(inertia: Any, **named: Any) -> Any:
    law = lc.attitude_law("pd", tunable=True)
    gains = {"k_p": 4.0, "k_d": 6.0}
    return lc.closed_loop(
        "so3", law=law, inertia=inertia, gains=gains, xi0=[0.3, 0.1, -0.2], t=[0, 0.5, 1], rtol=1e-9, **named
    )


def test_a_body_that_is_not_positive_is_named() -> None:
    bodies = np.repeat(np.diag([1.0, 2.0, 3.0])[None], 4, axis=0)
    bodies[2, 0, 0] = -1
    with pytest.raises(InputError, match="inertia of loop 2 is not symmetric positive definite"):
        loops(bodies)
    bodies[2, 0, 0] = 1
    bodies[3, 0, 1] = 0.5  # not symmetric
    with pytest.raises(InputError, match="inertia of loop 3 is not symmetric positive definite"):
        loops(bodies)


def test_an_inertia_that_is_symmetric_but_for_rounding_moves_alike() -> None:
    bodies = spread(3, 0.5, 5) + np.eye(3)
    nearly = bodies.copy()
    nearly[:, 0, 1] *= 1 + 2e-16 * np.arange(5)
    np.testing.assert_allclose(loops(nearly).X, loops(bodies).X, rtol=0, atol=1e-12)
