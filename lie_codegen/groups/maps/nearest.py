"""lc.nearest: the element of a group nearest to a matrix in the Frobenius norm, with its distance.

Closed forms, X = U diag(s) V^H its singular values:
    SO(n)    U diag(1, ..., 1, det U V^T) V^T
    U(n)     U V^H
    SU(n)    U diag(e^{i phi}) V^H with s_j sin phi_j = lambda, sum phi = -arg det U V^H (the polar factor times a phase is wrong at second order)
    SL(n)    U diag(t) V^T with t_j^2 - s_j t_j + m = 0, prod t = 1
Any other group: from the projections of X's diagonal blocks, or from exp(vee(log X)), the Gauss-Newton steps
    Y <- Y exp(hat d), d = argmin |Y (1 + hat d) - X|, halved until the distance falls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.exact.block_structure import diagonal_blocks
from lie_codegen.groups.catalogue_load import group as load_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import scipy

_STEPS = 200
_HALVINGS = 40
#: The gradient below which a step changes nothing, relative to |X|.
_SETTLED = 1e-15
_FLAT = 1e-7
#: How much worse conditioned than X its nearest element may be; beyond, the steps run towards a singular matrix.
_SINGULAR = 1e6


@dataclass(frozen=True, eq=False, repr=False)
class Nearest(Saved):
    """An element of a group, and how far the matrix given was from it.

    Attributes:
        X: (d, d), or (N, d, d) for several matrices.
        distance: Frobenius norm of the difference; (N,) for several.
    """

    X: Array
    distance: Any


def nearest(group: MatrixGroup | str | Path, X: ArrayLike) -> Nearest:
    """The element Y of the group that minimises |Y - X| (Frobenius).

    SO(n), U(n), SU(n), SL(n): the global minimum, in closed form. Other groups: a local one, which is the nearest element where X is
    near the group.

    Args:
        group: object, catalogue name or file.
        X: (d, d), or (N, d, d); complex entries for a complex group.

    Raises:
        InputError, ShapeError, NotFiniteError: X is no array of finite numbers of this shape; complex for a real group.
        NotOnGroupError: no element is nearest: the infimum is not attained, as for a determinant below 0 in GL(n).
    """
    group = group if isinstance(group, MatrixGroup) else load_group(group)
    matrices = _checked(group, X)
    several = matrices.reshape(-1, group.degree, group.degree)
    found = np.array([_nearest(group, each) for each in several]).reshape(matrices.shape)
    distances = np.linalg.norm((found - matrices).reshape(*matrices.shape[:-2], -1), axis=-1)
    return Nearest(found, distances if matrices.ndim > 2 else float(distances))


def _checked(group: MatrixGroup, X: ArrayLike) -> Array:
    try:
        matrices = np.array(X, dtype=complex)
    except (TypeError, ValueError):
        raise InputError(f"nearest: X must be an array of numbers, got {X!r:.60}") from None
    d = group.degree
    if matrices.ndim not in (2, 3) or matrices.shape[-2:] != (d, d):
        raise ShapeError(f"nearest: X has shape {matrices.shape}; {group.name} needs ({d}, {d}) or (N, {d}, {d})")
    if not np.all(np.isfinite(matrices)):
        raise NotFiniteError("nearest: X holds NaN or infinity")
    if group.is_complex:
        return matrices
    if np.any(matrices.imag):
        raise InputError(f"nearest: X has complex entries; the matrices of {group.name} are real")
    return np.ascontiguousarray(matrices.real)


def _nearest(group: MatrixGroup, X: Array) -> Array:
    kind = _closed_of(group)
    if kind is not None:
        return _CLOSED[kind](X)
    best: tuple[float, Array] | None = None
    for start in _starts(group, X):
        Y, distance = _descend(group, start, X)
        if best is None or distance < best[0] * (1 - 1e-12):
            best = (distance, Y)
        if distance <= 1e-3 * max(1.0, float(np.linalg.norm(X))):
            break
    if best is None or np.linalg.cond(best[1]) > _SINGULAR * np.linalg.cond(X):
        raise NotOnGroupError(
            f"nearest: no element of {group.name} is nearest to X; is its determinant negative or zero?"
        )
    return best[1]


@lru_cache(maxsize=64)
def _closed_of(group: MatrixGroup) -> str | None:
    return closed_kind(group.basis, group.is_complex)


def closed_kind(basis: Array, is_complex: bool) -> str | None:
    """Which of the groups with a closed form spans all of these matrices, if one does."""
    n, d = basis.shape[:2]
    scale = float(np.max(np.abs(basis)))
    adjoint = basis.conj().transpose(0, 2, 1)
    skew = bool(np.max(np.abs(basis + adjoint)) <= 1e-14 * scale)
    traceless = bool(np.max(np.abs(np.trace(basis, axis1=1, axis2=2))) <= 1e-14 * scale)
    if is_complex:
        return {d * d: "unitary", d * d - 1: "special unitary" if traceless else None}.get(n) if skew else None
    if skew:
        return "rotation" if n == d * (d - 1) // 2 else None
    return "special linear" if traceless and n == d * d - 1 and d > 1 else None


def _rotation(X: Array) -> Array:
    U, _, V = np.linalg.svd(X)
    U[:, -1] *= np.sign(np.linalg.det(U) * np.linalg.det(V))
    return np.asarray(U @ V)


def _unitary(X: Array) -> Array:
    U, _, V = np.linalg.svd(X)
    return np.asarray(U @ V)


def _special_unitary(X: Array) -> Array:
    """The phases follow from that of the smallest singular value, which is monotone in the sum; |lambda| <= s_n holds by itself."""
    U, s, V = np.linalg.svd(X)
    target = -float(np.angle(np.linalg.det(U @ V)))

    def phases(last: float) -> Array:
        ratio = s[-1] / np.where(s > 0, s, 1.0)
        return np.append(np.arcsin(np.clip(ratio[:-1] * np.sin(last), -1, 1)), last)

    end = np.copysign(np.pi, target)
    last = _root(lambda phi: float(np.sum(phases(phi))) - target, 0.0, end) if target else 0.0
    Y = (U * np.exp(1j * phases(last))) @ V
    return np.asarray(Y)


def _special_linear(X: Array) -> Array:
    """All t_j follow from the smallest of them: m = t (s - t)."""
    U, s, V = np.linalg.svd(X)
    if np.linalg.det(U) * np.linalg.det(V) < 0:
        U[:, -1] *= -1
        s[-1] *= -1

    def values(log_last: float) -> Array:
        last = np.exp(log_last)
        m = last * (s[-1] - last)
        others = (s[:-1] + np.sqrt(np.maximum(s[:-1] ** 2 - 4 * m, 0.0))) / 2
        return np.append(others, last)

    def excess(log_last: float) -> float:
        return float(np.sum(np.log(np.maximum(values(log_last), 1e-300))))

    low, high = -1.0, 1.0
    while excess(low) > 0:
        low *= 2
    while excess(high) < 0:
        high *= 2
    return np.asarray((U * values(_root(excess, low, high))) @ V)


def _root(function: Any, a: float, b: float) -> float:
    return float(scipy.optimize.brentq(function, a, b, xtol=1e-16, rtol=4 * np.finfo(float).eps, maxiter=200))


_CLOSED = {
    "rotation": _rotation,
    "unitary": _unitary,
    "special unitary": _special_unitary,
    "special linear": _special_linear,
}


def _starts(group: MatrixGroup, X: Array) -> Iterator[Array]:
    """Elements of the group to start from: the blocks' own projections, a Cartan decomposition, a logarithm, the identity."""
    projected = _by_blocks(group, X)
    if projected is not None:
        yield projected
    with np.errstate(all="ignore"):
        U, s, V = np.linalg.svd(X)
        polar = U @ V
        if s[-1] > 0:
            stretch = (V.conj().T * np.log(s)) @ V
            turned = _logarithm(polar)
            if turned is not None:
                yield _exp(group, turned) @ _exp(group, stretch)
        plain = _logarithm(X)
        if plain is not None:
            yield _exp(group, plain)
    yield np.eye(group.degree, dtype=X.dtype)


def _logarithm(X: Array) -> Array | None:
    try:
        A = scipy.linalg.logm(X)
    except (ValueError, np.linalg.LinAlgError):
        return None
    return np.asarray(A) if np.all(np.isfinite(A)) else None


def _exp(group: MatrixGroup, A: Array) -> Array:
    """exp of the part of A in the algebra."""
    return np.asarray(scipy.linalg.expm(group.hat(group.project(A))))


def _by_blocks(group: MatrixGroup, X: Array) -> Array | None:
    """Every diagonal block by its own closed form, the rest as it is where it is free; None where blocks are of other kinds.

    Where blocks depend on each other this is not the nearest element, nor even one: the steps that follow decide.
    """
    d = group.degree
    pattern = np.any(np.abs(group.basis) > 0, axis=0)
    Y = np.where(pattern, X, np.eye(d))
    for block in diagonal_blocks(group.exact_basis):
        index = np.ix_(block, block)
        parts = group.basis[:, block][:, :, block]
        if not np.any(parts):
            continue
        independent = _independent(parts)
        kind = closed_kind(independent, group.is_complex)
        if kind is not None:
            Y[index] = _CLOSED[kind](X[index])
            continue
        trace = np.trace(independent, axis1=1, axis2=2)[:, None, None] * np.eye(len(block)) / len(block)
        rest = independent - trace
        if np.max(np.abs(rest)) < 1e-14:
            if group.is_complex or np.trace(X[index]) <= 0:
                return None
            Y[index] = np.eye(len(block)) * np.trace(X[index]) / len(block)
        elif not group.is_complex and closed_kind(_independent(rest), False) == "rotation":
            Q = _rotation(X[index])
            Y[index] = Q * max(float(np.sum(Q * X[index])) / len(block), 1e-6)
        else:
            return None
    return _on_group(group, Y)


def _independent(parts: Array) -> Array:
    flat = parts.reshape(len(parts), -1)
    both = np.concatenate([flat.real, flat.imag], axis=1)
    chosen: list[int] = []
    for k in range(len(parts)):
        if np.linalg.matrix_rank(both[[*chosen, k]], tol=1e-10) > len(chosen):
            chosen.append(k)
    return np.asarray(parts[chosen])


def _on_group(group: MatrixGroup, Y: Array) -> Array | None:
    """Y, if the group's own logarithm of it is one: what the blocks gave may be off the group where they are coupled."""
    A = _logarithm(Y)
    if A is None:
        return None
    element = _exp(group, A)
    return element if np.linalg.norm(element - Y) <= 1e-8 * max(1.0, float(np.linalg.norm(Y))) else None


def _descend(group: MatrixGroup, Y: Array, X: Array) -> tuple[Array, float]:
    """Gauss-Newton steps in body coordinates, each halved until the distance falls; the distance with them."""
    size = max(1.0, float(np.linalg.norm(X)))
    distance, before = float(np.linalg.norm(Y - X)), np.inf
    for _ in range(_STEPS):
        columns = np.array([_real(Y @ matrix) for matrix in group.basis]).T
        step = np.linalg.lstsq(columns, _real(X - Y), rcond=None)[0]
        length = float(np.linalg.norm(columns @ step))
        # The distance is flat at its minimum to the square of the step: below 1e-7 the steps themselves are the better judge.
        small = length <= _FLAT * size
        if length <= _SETTLED * size or (small and length > before / 2):
            break
        before = length if small else np.inf
        for _ in range(_HALVINGS):
            trial = Y @ scipy.linalg.expm(group.hat(step))
            found = float(np.linalg.norm(trial - X))
            if small or found < distance:
                break
            step = step / 2
        else:
            break
        Y, distance = trial, found
    return Y, distance


def _real(A: Array) -> Array:
    flat = np.asarray(A, dtype=complex).ravel()
    return np.concatenate([flat.real, flat.imag])
