"""Logarithms of unitary, orthogonal and general matrices in NumPy: the twins of the C in templates/log_routine.c.jinja, by other means."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.on_demand import scipy


def unitary_log(X: Array, *, special: bool) -> Array:
    """log of a unitary matrix, angles in (-pi, pi]; `special`: of determinant 1, the angles sum to zero.

    Then the sum is 2 pi k, and the k largest angles go back by a turn (|k| smallest forward): the shortest of all choices.
    """
    near = _near_log(X)
    if near is not None:
        return np.asarray((near - near.conj().T) / 2)
    T, Q = scipy.linalg.schur(X, output="complex")
    theta = np.angle(np.diag(T))
    turns = round(float(np.sum(theta)) / (2 * np.pi)) if special else 0
    while turns:
        theta[int(np.argmax(theta) if turns > 0 else np.argmin(theta))] -= 2 * np.pi * np.sign(turns)
        turns -= int(np.sign(turns))
    return np.asarray((Q * (1j * theta)) @ Q.conj().T)


def rotation_log(X: Array) -> Array:
    """The real logarithm of a rotation, angles up to pi; eigenvalues -1 are paired in the order of the Schur form."""
    n = len(X)
    near = _near_log(X)
    if near is not None:
        return np.asarray((near - near.T) / 2)
    T, Q = scipy.linalg.schur(X, output="real")
    A = np.zeros((n, n))
    halves, k = [], 0
    while k < n:
        if k + 1 < n and T[k + 1, k] != 0:
            sine, cosine = (T[k + 1, k] - T[k, k + 1]) / 2, (T[k, k] + T[k + 1, k + 1]) / 2
            A[k + 1, k] = np.arctan2(sine, cosine)
            A[k, k + 1] = -A[k + 1, k]
            k += 2
            continue
        if T[k, k] < 0:
            halves.append(k)
        k += 1
    for i, j in zip(halves[::2], halves[1::2], strict=False):
        A[j, i], A[i, j] = np.pi, -np.pi
    return np.asarray(Q @ A @ Q.T)


def matrix_log(X: Array) -> Array:
    """The principal logarithm: square roots of the Schur form until it is near 1, the [8/8] Pade approximant, the diagonal exactly."""
    near = _near_log(X)
    if near is not None:
        return near
    T, Q = scipy.linalg.schur(X.astype(complex), output="complex")
    diagonal = np.log(np.abs(np.diag(T))) + 1j * np.angle(np.diag(T))
    power = 1.0
    for _ in range(60):
        if np.linalg.norm(T - np.eye(len(T)), 1) < 0.25:
            break
        T = _triangular_root(T)
        power *= 2
    L = power * _pade(T - np.eye(len(T)))
    np.fill_diagonal(L, diagonal)
    return np.asarray(Q @ L @ Q.conj().T)


def _near_log(X: NDArray[Any]) -> NDArray[Any] | None:
    """log X where |X - 1| < 1/4, with an error relative to X - 1 and not to 1."""
    E = X - np.eye(len(X))
    return _pade(E) if np.max(np.sum(np.abs(E.real) + np.abs(E.imag), axis=0)) < 0.25 else None


def _pade(E: NDArray[Any]) -> NDArray[Any]:
    """log(1 + E), the integral of (1 + s E)^{-1} E over s in [0, 1], by Gauss's sum, the [8/8] Pade approximant."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    parts = [w / 2 * np.linalg.solve(np.eye(len(E)) + (s + 1) / 2 * E, E) for s, w in zip(nodes, weights, strict=True)]
    return np.asarray(sum(parts))


def _triangular_root(T: Array) -> Array:
    n = len(T)
    R = np.zeros_like(T)
    for j in range(n):
        R[j, j] = np.sqrt(T[j, j])
        for i in range(j - 1, -1, -1):
            value = T[i, j] - R[i, i + 1 : j] @ R[i + 1 : j, j]
            R[i, j] = 0 if value == 0 else value / (R[i, i] + R[j, j])
    return R
