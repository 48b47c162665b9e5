"""How far an approximation Y is from X: the metrics of TR 93-59 and a matrix norm.

frobenius: |Y^-1 X - I|_F;  angle: phi(Y^T X) = arccos((tr - 1) / 2), rotations of space only;
product: d~, the 1-norm of the difference of coordinates of the second kind, (9);
single: d^, the 1-norm of the difference of logarithms, (53).
"""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ChartError, InputError
from lie_codegen.flow.batched_exponential import expm, logm
from lie_codegen.groups.matrix_group import MatrixGroup

METRICS = ("frobenius", "product", "single", "angle")
_ON_CHART = 1e-8


def distances(group: MatrixGroup, X: Array, Y: Array, metric: str) -> Array:
    """(k,) the distance of each Y from its X, both (k, d, d) along a path that starts at the same element.

    Raises:
        InputError: no such metric, or "angle" on a group other than rotations of space.
        ChartError: the coordinates end before the path does, naming the sample.
    """
    if metric == "product":
        return np.asarray(np.sum(np.abs(second_kind_along(group, X) - second_kind_along(group, Y)), axis=1))
    if metric == "single":
        return np.asarray(np.sum(np.abs(_logarithms(group, X) - _logarithms(group, Y)), axis=1))
    relative = np.linalg.solve(Y, X)
    if metric == "frobenius":
        return np.asarray(np.linalg.norm(relative - np.eye(group.degree), axis=(1, 2)))
    if metric == "angle":
        return rotation_angle(group, relative)
    raise InputError(f"no metric {metric!r}; choose one of {', '.join(METRICS)}")


def rotation_angle(group: MatrixGroup, R: Array) -> Array:
    """phi(R) of (k, 3, 3) rotations, accurate also near 0: 2 arcsin(|R - I|_F / (2 sqrt 2))."""
    orthogonal = (
        group.degree == 3 and not group.is_complex and np.allclose(group.basis, -np.swapaxes(group.basis, 1, 2))
    )
    if not orthogonal:
        raise InputError(f"the metric 'angle' is that of rotations of space; {group.name} has others: use 'frobenius'")
    chord = np.linalg.norm(R - np.eye(3), axis=(-2, -1)) / (2 * np.sqrt(2))
    return np.asarray(2 * np.arcsin(np.minimum(chord, 1.0)))


def second_kind_along(group: MatrixGroup, X: Array) -> Array:
    """(k, n) coordinates along a path from the identity, each from the one before by Newton's method."""
    from lie_codegen.flow.chart import mismatch, newton

    result = np.empty((len(X), group.dim))
    g = np.zeros((1, group.dim))
    with np.errstate(all="ignore"):
        for k, target in enumerate(X):
            g = newton(group, g, target[None], iterations=6)
            off = mismatch(group, g, target[None])[0]
            if not off <= _ON_CHART * max(1.0, float(np.max(np.abs(target)))):
                raise ChartError(
                    f"{group.name}: coordinates of the second kind in the order {', '.join(group.labels)} end at sample {k} "
                    f"of {len(X)}; shorten the horizon, reorder the basis, or use the metric 'frobenius'"
                )
            result[k] = g[0]
    return result


def _logarithms(group: MatrixGroup, X: Array) -> Array:
    """(k, n) principal logarithms."""
    matrices = logm(X)
    x = group.project(np.nan_to_num(matrices))
    off = np.max(np.abs(expm(group.hat(x)) - X), axis=(1, 2))
    bad = np.flatnonzero(~(off <= _ON_CHART * np.maximum(1.0, np.max(np.abs(X), axis=(1, 2)))))
    if len(bad):
        raise ChartError(
            f"{group.name}: no principal logarithm at sample {bad[0]} of {len(X)}; shorten the horizon or use another metric"
        )
    return x
