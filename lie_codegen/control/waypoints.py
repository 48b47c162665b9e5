"""Waypoints on a group joined by quintics of the algebra, twice continuously differentiable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.control.reference_motion import WaypointReference
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.build import library_of
from lie_codegen.groups.derivation import GroupDerivation, derivation_of
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.maps.checked_log import log_coordinates
from lie_codegen.groups.maps.exponential import exp_matrix, jacobian
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.definition import doubles, record_factory
from lie_codegen.kernel.dual import Dual, DualArithmetic, tangent_of
from lie_codegen.kernel.linear import matvec
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic

#: How far a waypoint may lie off the group, relative to its size.
_ON_GROUP = 1e-8
#: A turn beyond is as short the other way round.
_SHORT_WAY = np.pi * (1 - 1e-9)


@record_factory(times=doubles, waypoints=doubles)
def waypoint_reference(group: MatrixGroup, times: ArrayLike, waypoints: ArrayLike) -> WaypointReference:
    """A twice continuously differentiable curve through the waypoints, at rest at both ends.

    At an inner waypoint its velocity is the mean of the constant velocities of the two segments that meet there,
    weighted by the other's duration, and its acceleration is zero.

    Args:
        group: the group.
        times: (k,) increasing [s], k >= 2.
        waypoints: (k, d, d) elements.

    Raises:
        ShapeError: the shapes do not fit.
        InputError: times that do not increase (a jump), or two waypoints whose relative element has no unique
        logarithm. NotOnGroupError: a waypoint is off the group by more than 1e-5; nearer ones are projected.
    """
    t = np.asarray(times, dtype=float)
    X = np.asarray(waypoints, dtype=complex if group.is_complex else float)
    if t.ndim != 1 or len(t) < 2 or X.shape != (len(t), group.degree, group.degree):
        raise ShapeError(
            f"waypoints on {group.name}: times {t.shape} and elements {X.shape}; give (k,) and "
            f"(k, {group.degree}, {group.degree}) with k >= 2"
        )
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(X))):
        raise InputError("waypoints hold NaN or infinity")
    bad = np.flatnonzero(np.diff(t) <= 0)
    if len(bad):
        raise InputError(
            f"the reference jumps: waypoint {bad[0] + 2} at t = {t[bad[0] + 1]:g} does not come after waypoint "
            f"{bad[0] + 1} at t = {t[bad[0]]:g}; times must increase"
        )
    X = np.array([admitted(group, each, f"waypoint {number}").X for number, each in enumerate(X, start=1)])
    derivation = derivation_of(group)
    moves = np.array([_relative_log(derivation, X[i], X[i + 1], i) for i in range(len(t) - 1)])
    spans = np.diff(t)
    mean = moves / spans[:, None]
    speed = np.zeros((len(t), group.dim))
    weight = spans[1:] / (spans[1:] + spans[:-1])
    speed[1:-1] = weight[:, None] * mean[:-1] + (1 - weight)[:, None] * mean[1:]
    return WaypointReference(group, t, X, quintics(derivation, moves, speed[:-1], speed[1:], spans))


def _relative_log(derivation: GroupDerivation, X: NDArray[Any], Y: NDArray[Any], index: int) -> NDArray[Any]:
    relative = np.linalg.solve(X, Y)
    x = logarithm(derivation, relative)
    if x is not None:
        return x
    raise InputError(
        f"between waypoints {index + 1} and {index + 2} there is no unique way (their relative element has no "
        "principal logarithm, as a turn by 180 degrees has none); put a waypoint between them"
    )


def _relative_logs(derivation: GroupDerivation, X: NDArray[Any], pairs: Sequence[tuple[int, int]]) -> NDArray[Any]:
    """log(X_i^-1 X_j) of many pairs by compiled code; those that it has none of are refused as `_relative_log` does."""
    library, (first, second) = library_of(derivation.group), np.transpose(pairs)
    relative = np.linalg.solve(X[first], X[second])
    x = np.asarray(library.log.batch(relative))
    for k in np.flatnonzero(~_is_the_way(derivation.group, x, np.asarray(library.exp.batch(x)), relative)):
        i, j = pairs[int(k)]
        x[k] = _relative_log(derivation, X[i], X[j], min(i, j))
    return x


def logarithm(derivation: GroupDerivation, X: NDArray[Any]) -> NDArray[Any] | None:
    """The x with exp(hat(x)) = X, or None where the principal logarithm is not in the algebra."""
    ops = FloatArithmetic()
    try:
        x = np.array(log_coordinates(ops, derivation, _scalars(X)), dtype=float)
        found = _numbers(exp_matrix(ops, derivation, x.tolist()))
    except (ArithmeticError, ValueError):
        return None
    return x if _is_the_way(derivation.group, x, found, X) else None


def _is_the_way(group: MatrixGroup, x: NDArray[Any], found: NDArray[Any], X: NDArray[Any]) -> Any:
    """Whether exp(hat x), which is `found`, is X, and no turn is as short the other way round; of one or of many. False for NaN."""
    off, size = (np.max(np.abs(each), axis=(-2, -1)) for each in (found - X, X))
    turn = np.max(np.abs(np.linalg.eigvals(group.hat(np.nan_to_num(x))).imag), axis=-1)
    return (off <= _ON_GROUP * np.maximum(1.0, size)) & (turn <= _SHORT_WAY)


def _scalars(X: NDArray[Any]) -> list[list[Any]]:
    if np.iscomplexobj(X):
        return [[Complex(float(z.real), float(z.imag)) for z in row] for row in X]
    return [[float(x) for x in row] for row in X]


def _numbers(X: Sequence[Sequence[Any]]) -> NDArray[Any]:
    return np.array([[complex(z.re, z.im) if isinstance(z, Complex) else float(z) for z in row] for row in X])


def quintics(
    derivation: GroupDerivation,
    moves: NDArray[Any],
    first: NDArray[Any],
    last: NDArray[Any],
    spans: NDArray[Any],
    bends: tuple[NDArray[Any], NDArray[Any]] | None = None,
) -> NDArray[Any]:
    """(k, 6, n), all segments at once: p(0) = 0, p(1) = move, body velocities first and last [1/s], body accelerations [1/s^2] zero if not given.

    From xi = J(p) p': xi' = J(p) p'' + (dJ/dt) p', and (dJ/dt) p' = -[p', p']/2 = 0 at p = 0.

    Args:
        derivation: of the group.
        moves, first, last: (k, n).
        spans: (k,) [s].
        bends: (k, n) accelerations at both ends.
    """
    ops, span = NumpyArithmetic(), spans[:, None]
    dual = DualArithmetic(ops)
    with np.errstate(all="ignore"):  # both sides of a branch are evaluated
        inverse = _stacked(jacobian(ops, derivation, list(moves.T), "right", inverse=True), len(moves))
        rate = np.einsum("kij,kj->ki", inverse, last) * span
        moving = [dual.variable(a, {0: b}) for a, b in zip(moves.T, rate.T, strict=True)]
        turning = matvec(jacobian(dual, derivation, moving, "right", inverse=False), list(rate.T))
        turned = _stacked([[tangent_of(x) if isinstance(x, Dual) else 0.0 for x in turning]], len(moves))[:, 0]
    begin, end = (np.zeros_like(moves),) * 2 if bends is None else (each * span**2 for each in bends)
    bend = np.einsum("kij,kj->ki", inverse, end - turned)
    start = first * span
    conditions = np.array([[1, 1, 1], [3, 4, 5], [6, 12, 20]], dtype=float)
    asked = np.stack([moves - start - begin / 2, rate - start - begin, bend - begin], axis=1)
    rest = np.linalg.solve(conditions, asked)
    return np.concatenate([np.zeros_like(moves)[:, None], start[:, None], begin[:, None] / 2, rest], axis=1)


def _stacked(matrix: Sequence[Sequence[Any]], count: int) -> NDArray[Any]:
    """(k, rows, columns) of entries that are numbers or (k,) each."""
    return np.moveaxis(
        np.array([[np.broadcast_to(entry, count) for entry in row] for row in matrix], dtype=float), -1, 0
    )


#: Samples at most: each segment is a row of the tables that are compiled.
_MOST = 1024


@record_factory(times=doubles, samples=doubles)
def sampled_reference(group: MatrixGroup, times: ArrayLike, samples: ArrayLike) -> WaypointReference:
    """A twice continuously differentiable curve through samples of a smooth one, of fourth order in their distance.

    At each sample p(t) = log(X_i^-1 X(t)) through it and its four nearest neighbours is a polynomial of degree four; there p' is the body
    velocity, and p'' its rate, for [p', p'] = 0. Quintics join the samples with both.

    Args:
        group: the group.
        times: (k,) increasing [s], k >= 5.
        samples: (k, d, d) elements.

    Raises:
        ShapeError, InputError: as `waypoint_reference`; fewer than five samples, or more than 1024.
    """
    smooth = waypoint_reference(group, times, samples)  # which checks them
    t, X = smooth.times, smooth.elements
    if not 5 <= len(t) <= _MOST:
        raise InputError(
            f"a reference from samples needs 5 to {_MOST} of them, got {len(t)}; thin them out, or give waypoints="
        )
    derivation = derivation_of(group)
    speed, bend = np.empty((2, len(t), group.dim))
    firsts = [min(max(i - 2, 0), len(t) - 5) for i in range(len(t))]
    neighbours = [[j for j in range(first, first + 5) if j != i] for i, first in enumerate(firsts)]
    all_moves = _relative_logs(derivation, X, [(i, j) for i, near in enumerate(neighbours) for j in near])
    for i, near in enumerate(neighbours):
        moves = all_moves[4 * i : 4 * i + 4]
        width = float(np.max(np.abs(t[near] - t[i])))
        powers = ((t[near] - t[i]) / width)[:, None] ** np.arange(1, 5)
        fit = np.linalg.solve(powers, moves)
        speed[i], bend[i] = fit[0] / width, 2 * fit[1] / width**2
    moves = _relative_logs(derivation, X, [(i, i + 1) for i in range(len(t) - 1)])
    table = quintics(derivation, moves, speed[:-1], speed[1:], np.diff(t), (bend[:-1], bend[1:]))
    return WaypointReference(group, t, X, table)
