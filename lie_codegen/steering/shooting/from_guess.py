"""A costate for the caller's own controls: the one whose extremal has controls nearest to theirs.

Along a motion X(t) an extremal has mu(t) . A_i = mu0 . Ad_X(t) A_i, and u_i = mu(t) . A_i / w_i: linear in mu0.
"""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.matrix_group import MatrixGroup


def nearest_costate(group: MatrixGroup, controls: tuple[int, ...], v: Array, weights: Array) -> Array:
    """(n,) mu0, by least squares along the motion of velocities v (N + 1, m) at equal times of unit time."""
    steps = len(v) - 1
    rates = np.zeros((steps, group.dim))
    rates[:, list(controls)] = (v[:-1] + v[1:]) / (2 * steps)
    X = np.eye(group.degree, dtype=group.basis.dtype)
    rows = []
    for step in expm(group.hat(rates)):
        back = np.linalg.inv(X)
        rows += [
            weight**-0.5 * group.project(X @ group.basis[i] @ back) for i, weight in zip(controls, weights, strict=True)
        ]
        X = X @ step
    return np.asarray(np.linalg.lstsq(np.array(rows), (v[:-1] * np.sqrt(weights)).ravel(), rcond=1e-10)[0])
