"""lc.mean and lc.interpolate: the exponential barycentre of elements, and the geodesic of a one-parameter group between two."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError, NotFiniteError, ShapeError
from lie_codegen.groups.build import library_of
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.maps.admission import admitted, admitted_all
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.rows import row_by_row

#: The iteration converges linearly at worst, with the square of the spread of the data as its rate: this is far beyond.
_MOST_STEPS = 200
_SETTLED = 1e-14
#: Below this the last steps are rounding: eps times the condition of the data.
_ROUNDING = 1e-11


@dataclass(frozen=True, eq=False, repr=False)
class Mean(Saved):
    """The exponential barycentre of elements of a group.

    Attributes:
        X: (d, d) the mean.
        iterations: steps taken.
        residual: |sum w_i log(X^-1 X_i)| / sum w, the equation that defines it.
        spread: the largest angle of any log(X^-1 X_i), the imaginary part of an eigenvalue of its matrix. [rad]
    """

    X: Array
    iterations: int
    residual: float
    spread: float


def mean(group: MatrixGroup | str | Path, Xs: ArrayLike, weights: ArrayLike | None = None) -> Mean:
    """The exponential barycentre: sum_i w_i log(X^-1 X_i) = 0, by X <- X exp(sum w_i log(X^-1 X_i) / sum w).

    On compact groups it is the Riemannian mean of the bi-invariant metric; on every group it is bi-invariant, mean(L X_i R)
    = L mean(X_i) R and mean(X_i^-1) = mean(X_i)^-1, but on others it minimises no distance (Pennec and Arsigny, 2013).

    Args:
        group: a group, its name or its file.
        Xs: (N, d, d) elements.
        weights: (N,) not negative; equal ones when None.

    Raises:
        ShapeError, NotFiniteError, InputError: about what does not fit.
        NotOnGroupError: an element is not on the group; says which and how far off.
        ComputationError: the data are wider than a half turn, so that the mean is not unique, or some X^-1 X_i has no
            logarithm; names the element.
    """
    found = as_group(group)
    elements = _elements(found, Xs, "mean: Xs")
    w = _weights(weights, len(elements))
    lib = library_of(found)
    X = elements[int(np.argmax(w))]
    last, step = np.inf, np.inf
    for iterations in range(1, _MOST_STEPS + 1):  # noqa: B007
        logs = _logarithms(found, X, elements, "mean")
        move = w @ logs
        last, step = step, float(np.linalg.norm(move))
        # Steps fall by a factor each until rounding: one that no longer falls is the end, not a failure.
        if step <= _SETTLED or (step <= _ROUNDING and step >= last / 2):
            break
        X = X @ lib.exp(np.ascontiguousarray(move))
    else:
        raise ComputationError(
            f"mean on {found.name}: {_MOST_STEPS} steps leave a residual of {step:.3g}; the data are too far apart"
        )
    spread = _angles(found, logs)
    if np.max(spread) >= np.pi / 2:
        worst = int(np.argmax(spread))
        raise ComputationError(
            f"mean on {found.name}: element {worst} is {spread[worst]:.4g} rad from the mean of all, so the data are wider "
            "than a half turn and the mean is not unique; leave out what lies apart, or take means of parts"
        )
    return Mean(X, iterations, step, float(np.max(spread)))


def interpolate(group: MatrixGroup | str | Path, X: ArrayLike, Y: ArrayLike, s: ArrayLike) -> Array:
    """X exp(s log(X^-1 Y)): X at s = 0, Y at s = 1, at a constant body velocity between.

    Args:
        group: a group, its name or its file.
        X, Y: (d, d) elements.
        s: a number, or an array of numbers; outside [0, 1] it extrapolates.

    Returns:
        (d, d), or (*shape of s, d, d).

    Raises:
        ShapeError, NotFiniteError: about what does not fit.
        NotOnGroupError: X or Y is not on the group; says how far off.
        ComputationError: X^-1 Y has no logarithm.
    """
    found = as_group(group)
    start, end = admitted(found, X, "interpolate: X").X, admitted(found, Y, "interpolate: Y").X
    parts = np.asarray(s, dtype=float)
    if not np.all(np.isfinite(parts)):
        raise NotFiniteError("interpolate: s holds NaN or infinity")
    [x] = _logarithms(found, start, end[None], "interpolate")
    moved = row_by_row(library_of(found).exp, np.ascontiguousarray(parts.reshape(-1, 1) * x))[0]
    result: Array = (start @ moved).reshape(*parts.shape, found.degree, found.degree)
    return result


def _elements(group: MatrixGroup, given: ArrayLike, where: str) -> Array:
    several = list(given) if isinstance(given, list | tuple) else np.asarray(given)
    if not len(several):
        raise ShapeError(f"{where}: give one element of {group.name} at least")
    if (
        isinstance(several, np.ndarray)
        and several.shape[1:] == (group.degree,) * 2
        and several.dtype == group.basis.dtype
    ):
        return np.array(admitted_all(group, several, where)[0])  # the mean of one element is a part of these
    return np.ascontiguousarray([admitted(group, each, f"{where}[{i}]").X for i, each in enumerate(several)])


def _weights(given: ArrayLike | None, count: int) -> Array:
    w = np.ones(count) if given is None else np.asarray(given, dtype=float)
    if w.shape != (count,):
        raise ShapeError(f"mean: weights {w.shape} for {count} elements")
    if not np.all(np.isfinite(w)) or np.any(w < 0) or not np.any(w > 0):
        raise InputError("mean: weights are finite and not negative, and one at least is positive")
    return np.asarray(w / np.sum(w))


def _logarithms(group: MatrixGroup, X: Array, elements: Array, where: str) -> Array:
    """(N, n) log(X^-1 X_i)."""
    with np.errstate(all="ignore"):
        logs = row_by_row(library_of(group).log, np.ascontiguousarray(np.linalg.inv(X) @ elements))[0]
    bad = np.flatnonzero(~np.all(np.isfinite(logs), axis=1))
    if bad.size:
        raise ComputationError(
            f"{where} on {group.name}: from the present mean to element {bad[0]} there is no logarithm, so no one-parameter "
            "group joins them"
            if where == "mean"
            else f"{where} on {group.name}: X^-1 Y has no logarithm; put an element between X and Y"
        )
    return logs


def _angles(group: MatrixGroup, logs: Array) -> Array:
    """(N,) the largest |Im| of the eigenvalues of hat(x): how far each turns, in any basis."""
    return np.asarray(np.max(np.abs(np.linalg.eigvals(group.hat(logs)).imag), axis=-1))
