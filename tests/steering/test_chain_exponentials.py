"""Exponentials and their derivatives in the numpy search of direct steering, against 30 digits of the exponential of [[a, b], [0, a]]."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.steering.direct.chain import exponentials


def exact(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    d = len(a)
    with mp.workdps(30):
        whole = mp.expm(mp.matrix(np.block([[a, b], [np.zeros_like(a), a]]).tolist()), method="taylor")
        E = np.array(whole.tolist(), dtype=complex)
    return E[:d, :d], E[:d, d:]


@pytest.mark.parametrize("name", ["so3", "su2", "su4", "so4", "se3", "sl3"])
@pytest.mark.parametrize("size", [0.0, 1e-9, 0.3, 4.0])
def test_exponentials_and_their_derivatives(name: str, size: float) -> None:
    group, rng = lc.group(name), np.random.default_rng(5)
    x = rng.normal(size=(1, 2, group.dim))
    x[0, 1] = 0.0
    x[0, 1, 0] = 1.0  # equal eigenvalues
    a = group.hat(size * x / np.linalg.norm(x, axis=-1, keepdims=True))
    b = group.hat(rng.normal(size=(1, 2, 2, group.dim)))
    E, dE = exponentials(a, b)
    assert np.iscomplexobj(E) == group.is_complex
    for k in range(2):
        for i in range(2):
            value, slope = exact(a[0, k], b[0, k, i])
            assert np.max(np.abs(E[0, k] - value)) < 4e-15 * np.abs(value).sum()
            assert np.max(np.abs(dE[0, k, i] - slope)) < 4e-15 * max(np.abs(slope).sum(), np.abs(value).sum())
